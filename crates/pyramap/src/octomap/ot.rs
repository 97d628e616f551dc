//! Nodes of an `.ot` file: the log-odd as `f32`, with colours three bytes of them, and one bit for each child there is.

use super::reading::{Leaves, take};
use super::tree::Cube;
use super::writing::{Node, NodeWriter};
use crate::block::Blocks;
use crate::grid::OccupancyGrid;
use crate::log_odds;

/// Reads all nodes.
pub fn read(rest: &mut &[u8], leaves: &mut Leaves, colour: bool) -> Result<(), String> {
    read_node(rest, leaves, Cube::ROOT, colour)
}

fn read_node(rest: &mut &[u8], leaves: &mut Leaves, cube: Cube, colour: bool) -> Result<(), String> {
    let log_odds = f32::from_le_bytes(take(rest)?);
    if colour {
        take::<3>(rest)?;
    }
    let [children] = take(rest)?;
    if children == 0 {
        return leaves.add(cube, log_odds);
    }
    // What an inner node says follows from its children.
    leaves.add_inner(cube)?;
    (0..8).filter(|n| children >> n & 1 == 1).try_for_each(|n| read_node(rest, leaves, cube.child(n), colour))
}

/// Writes nodes; their values are the map's evidence.
pub struct Writer {
    /// Log-odds of the prior, which are part of what is written.
    l_0: f64,
}

impl Writer {
    pub fn new(grid: &OccupancyGrid) -> Self {
        Self { l_0: grid.prior_log_odds() }
    }

    fn put(&self, value: i32, children: u8, out: &mut [u8]) {
        let mut log_odds = (log_odds::from_fixed(value) + self.l_0) as f32;
        if log_odds == 0.0 {
            // Seen, and no more likely occupied than free: OctoMap would call it occupied.
            log_odds = -0.5 * log_odds::UNIT as f32;
        }
        out[..4].copy_from_slice(&log_odds.to_le_bytes());
        out[4] = children;
    }
}

impl NodeWriter for Writer {
    const INNER_BYTES: usize = 5;

    fn value(&self, evidence: i32) -> i32 {
        evidence
    }

    fn leaf(&self, value: i32, out: &mut Vec<u8>) {
        let mut node = [0; Self::INNER_BYTES];
        self.put(value, 0, &mut node);
        out.extend(node);
    }

    fn inner(&self, children: &[Node; 8], highest: i32, out: &mut [u8]) {
        let bits = children.iter().enumerate().map(|(n, child)| u8::from(*child != Node::Unknown) << n);
        self.put(highest, bits.sum(), out);
    }
}
