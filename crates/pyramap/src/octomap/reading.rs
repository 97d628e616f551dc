//! From the leaves of an octree to the blocks of a map.

use super::MAX_BLOCKS;
use super::tree::{BLOCK_DEPTH, Cube, VOXEL_DEPTH};
use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, Block, BlockData, BlockKey, Blocks, locate, voxel_offset};
use crate::error::Result;
use crate::grid::OccupancyGrid;
use crate::log_odds;
use crate::state::{State, Threshold};

/// The leaves of a file, in its order: those of one block follow each other.
#[derive(Default)]
pub struct Leaves {
    leaves: Vec<Leaf>,
    nodes: u64,
    /// Blocks that the leaves come to.
    blocks: u64,
}

#[derive(Clone, Copy)]
struct Leaf {
    cube: Cube,
    log_odds: f32,
}

impl Leaf {
    /// The block that it lies in, or the first of its blocks.
    fn block(&self) -> BlockKey {
        locate(self.cube.first).0
    }

    /// Whether it is less than a block.
    fn is_part(&self) -> bool {
        self.cube.depth > BLOCK_DEPTH
    }

    /// Blocks along its edge.
    fn edge_in_blocks(&self) -> usize {
        self.cube.edge() as usize / BLOCK_EDGE
    }
}

impl Leaves {
    /// Takes in a node that has children.
    pub fn add_inner(&mut self, cube: Cube) -> std::result::Result<(), String> {
        self.nodes += 1;
        if cube.depth == VOXEL_DEPTH { Err(format!("nodes lie deeper than {VOXEL_DEPTH} levels")) } else { Ok(()) }
    }

    /// Takes in a leaf, whose voxels all have these log-odds.
    pub fn add(&mut self, cube: Cube, log_odds: f32) -> std::result::Result<(), String> {
        let fits = f64::from(log_odds).abs() < log_odds::from_fixed(i32::MAX);
        if !fits {
            return Err(format!("a leaf has log-odds of {log_odds}"));
        }
        let leaf = Leaf { cube, log_odds };
        self.nodes += 1;
        self.blocks += match self.leaves.last() {
            Some(last) if last.is_part() && leaf.is_part() && last.block() == leaf.block() => 0,
            _ if leaf.is_part() => 1,
            _ => (leaf.edge_in_blocks() as u64).pow(3),
        };
        if self.blocks > MAX_BLOCKS {
            let Self { blocks, .. } = self;
            return Err(format!("its leaves come to {blocks} blocks of voxels or more, expected at most {MAX_BLOCKS}"));
        }
        self.leaves.push(leaf);
        Ok(())
    }

    /// How many nodes there were, inner ones too.
    pub fn nodes(&self) -> u64 {
        self.nodes
    }

    /// Puts all voxels into an empty map.
    pub fn put_into(&self, grid: &mut OccupancyGrid) -> Result<()> {
        let rounding = Rounding::of(grid);
        for leaves in self.leaves.chunk_by(|a, b| a.is_part() && b.is_part() && a.block() == b.block()) {
            let (first, evidence) = (leaves[0].block(), |leaf: &Leaf| rounding.evidence(leaf.log_odds.into()));
            if leaves[0].is_part() {
                let mut values: BlockData = [0; BLOCK_VOXELS];
                leaves.iter().for_each(|leaf| fill(&mut values, leaf.cube, evidence(leaf)));
                grid.put_block(first, Block::Dense(&values))?;
                continue;
            }
            let block = Block::Uniform(evidence(&leaves[0]));
            for [x, y, z] in cells(leaves[0].edge_in_blocks()) {
                grid.put_block([first[0] + x as i32, first[1] + y as i32, first[2] + z as i32], block)?;
            }
        }
        Ok(())
    }
}

/// Gives all voxels of a cube inside a block one value.
fn fill(values: &mut BlockData, cube: Cube, value: i32) {
    let (_, first) = locate(cube.first);
    cells(cube.edge() as usize).for_each(|[x, y, z]| values[first + voxel_offset(x, y, z)] = value);
}

/// All cells of a cube.
fn cells(edge: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..edge).flat_map(move |x| (0..edge).flat_map(move |y| (0..edge).map(move |z| [x, y, z])))
}

/// From log-odds to what a map stores.
struct Rounding {
    l_0: f64,
    threshold: Threshold,
    limits: log_odds::Limits,
}

impl Rounding {
    fn of(grid: &OccupancyGrid) -> Self {
        Self { l_0: grid.prior_log_odds(), threshold: Threshold::of(grid), limits: grid.config().limits() }
    }

    /// The nearest evidence with the state that OctoMap sees, which is never unknown.
    fn evidence(&self, log_odds: f64) -> i32 {
        let nearest = log_odds::to_fixed(log_odds - self.l_0);
        let state = if log_odds >= 0.0 { State::Occupied } else { State::Free };
        let mut near = [nearest, nearest.saturating_add(1), nearest.saturating_sub(1)].into_iter();
        let fitting = near.find(|&evidence| self.threshold.state(evidence) == state);
        self.limits.add(0, fitting.unwrap_or(nearest)).0
    }
}

/// Takes bytes off the start of the rest of a file.
pub fn take<const N: usize>(rest: &mut &[u8]) -> std::result::Result<[u8; N], String> {
    let (taken, left) = rest.split_first_chunk().ok_or("cut off among its nodes")?;
    *rest = left;
    Ok(*taken)
}
