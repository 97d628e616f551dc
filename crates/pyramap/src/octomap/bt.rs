//! Nodes of a `.bt` file: 16 bits for each node that has children, two a child, the first child in the lowest.

use super::CLAMP;
use super::reading::{Leaves, take};
use super::tree::Cube;
use super::writing::{Node, NodeWriter};
use crate::grid::OccupancyGrid;
use crate::log_odds;
use crate::state::{State, Threshold};

const UNKNOWN: u16 = 0;
const FREE: u16 = 1;
const OCCUPIED: u16 = 2;
const INNER: u16 = 3;

/// Reads all nodes.
pub fn read(rest: &mut &[u8], leaves: &mut Leaves) -> Result<(), String> {
    read_inner(rest, leaves, Cube::ROOT, CLAMP.map(|p| log_odds::from_probability(p) as f32))
}

fn read_inner(rest: &mut &[u8], leaves: &mut Leaves, cube: Cube, [free, occupied]: [f32; 2]) -> Result<(), String> {
    leaves.add_inner(cube)?;
    let children = u16::from_le_bytes(take(rest)?);
    if children == 0 {
        return Err("a node that should have children has none".into());
    }
    for n in 0..8 {
        let child = cube.child(n);
        match children >> (2 * n) & 3 {
            UNKNOWN => {}
            FREE => leaves.add(child, free)?,
            OCCUPIED => leaves.add(child, occupied)?,
            _ => read_inner(rest, leaves, child, [free, occupied])?,
        }
    }
    Ok(())
}

/// Writes nodes; their values are 1, occupied, and -1, free.
pub struct Writer(Threshold);

impl Writer {
    pub fn new(grid: &OccupancyGrid) -> Self {
        Self(Threshold::of(grid))
    }
}

impl NodeWriter for Writer {
    const INNER_BYTES: usize = 2;

    fn value(&self, evidence: i32) -> i32 {
        match self.0.state(evidence) {
            State::Unknown => 0,
            State::Free => -1,
            State::Occupied => 1,
        }
    }

    fn leaf(&self, _value: i32, _out: &mut Vec<u8>) {
        // Its parent says it all.
    }

    fn inner(&self, children: &[Node; 8], _highest: i32, out: &mut [u8]) {
        let bits = children.iter().enumerate().map(|(n, child)| {
            let kind = match child {
                Node::Unknown => UNKNOWN,
                Node::Leaf(..0) => FREE,
                Node::Leaf(_) => OCCUPIED,
                Node::Inner(_) => INNER,
            };
            kind << (2 * n)
        });
        out.copy_from_slice(&bits.sum::<u16>().to_le_bytes());
    }
}
