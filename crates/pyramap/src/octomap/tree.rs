//! The octree's geometry: 16 levels, of which one holds exactly the blocks of the map.

use crate::block::{BLOCK_EDGE, BlockKey, VoxelIndex};
use crate::update::rays::{KEY_BITS, REACH};

/// The level of voxels; the root is level 0.
pub const VOXEL_DEPTH: u32 = KEY_BITS;
/// The level of blocks.
pub const BLOCK_DEPTH: u32 = VOXEL_DEPTH - BLOCK_EDGE.ilog2();

/// The cube of voxels that a node stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube {
    /// Its level.
    pub depth: u32,
    /// Its first voxel.
    pub first: VoxelIndex,
}

impl Cube {
    pub const ROOT: Self = Self { depth: 0, first: [-REACH; 3] };

    /// Voxels along an edge.
    pub fn edge(&self) -> i32 {
        1 << (VOXEL_DEPTH - self.depth)
    }

    /// The `n`-th child.
    pub fn child(&self, n: usize) -> Self {
        let half = self.edge() / 2;
        Self {
            depth: self.depth + 1,
            first: std::array::from_fn(|axis| self.first[axis] + half * side(n, axis) as i32),
        }
    }
}

/// Which half of its parent the `n`-th child lies in: children are numbered with `x` in the lowest bit.
pub fn side(n: usize, axis: usize) -> usize {
    n >> axis & 1
}

/// The way from the root to a block, three bits a level: sorted by it, blocks come in the order of the file. `None` if
/// the block lies beyond [`REACH`].
pub fn path_to(block: BlockKey) -> Option<u64> {
    let reach = REACH / BLOCK_EDGE as i32;
    if block.iter().any(|k| !(-reach..reach).contains(k)) {
        return None;
    }
    let [x, y, z] = block.map(|k| (k + reach) as u64);
    let number = |bit: u32| (x >> bit & 1) | (y >> bit & 1) << 1 | (z >> bit & 1) << 2;
    Some((0..BLOCK_DEPTH).map(|bit| number(bit) << (3 * bit)).sum())
}

/// The number of the child, at `depth + 1`, that the way to a block goes through.
pub fn turn(path: u64, depth: u32) -> usize {
    (path >> (3 * (BLOCK_DEPTH - 1 - depth)) & 7) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_lead_to_their_blocks() {
        for block in [[0, 0, 0], [-1, 0, 5], [17, -300, 2], [4095, -4096, 1], [-4096; 3], [4095; 3]] {
            let path = path_to(block).expect("within reach");
            let end = (0..BLOCK_DEPTH).fold(Cube::ROOT, |cube, depth| cube.child(turn(path, depth)));
            assert_eq!(end, Cube { depth: BLOCK_DEPTH, first: block.map(|k| k * BLOCK_EDGE as i32) });
            assert_eq!(end.edge(), BLOCK_EDGE as i32);
        }
        assert_eq!(path_to([0, 4096, 0]), None);
        assert_eq!(path_to([0, 0, -4097]), None);
    }
}
