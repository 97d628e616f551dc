//! From the blocks of a map to an octree: eight children that are equal leaves become one.

use super::tree::{BLOCK_DEPTH, path_to, side, turn};
use crate::block::{BLOCK_EDGE, Block, BlockData, BlockKey, Blocks, voxel_offset};
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::update::rays::REACH;
use rayon::prelude::*;

/// What became of a part of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Node {
    /// Nothing is known of it, and there is no node.
    Unknown,
    /// A leaf, and the value of all its voxels.
    Leaf(i32),
    /// A node with children, and the highest value of them.
    Inner(i32),
}

/// How nodes are written in one format.
pub trait NodeWriter: Sync {
    /// Bytes of a node with children, in front of theirs.
    const INNER_BYTES: usize;
    /// What is kept of a voxel; 0 if it is unknown.
    fn value(&self, evidence: i32) -> i32;
    /// Writes a leaf.
    fn leaf(&self, value: i32, out: &mut Vec<u8>);
    /// Writes a node with children.
    fn inner(&self, children: &[Node; 8], highest: i32, out: &mut [u8]);
}

/// Nodes as they are in the file.
#[derive(Default)]
pub struct Octree {
    pub bytes: Vec<u8>,
    /// How many there are.
    pub nodes: u64,
}

/// Writes all nodes of a map.
///
/// # Errors
/// [`Error::Unsupported`] naming a voxel that lies beyond OctoMap's keys.
pub fn octree<W: NodeWriter>(grid: &OccupancyGrid, writer: &W) -> Result<Octree> {
    let part = |key| {
        let path = path_to(key).ok_or_else(|| beyond_keys(key))?;
        let mut octree = Octree::default();
        let node = grid.block(key).map_or(Node::Unknown, |block| octree.block(writer, &block));
        Ok(Part { path, node, octree })
    };
    let mut parts: Vec<Part> = grid.keys().into_par_iter().map(part).collect::<Result<_>>()?;
    parts.par_sort_unstable_by_key(|part| part.path);
    let mut octree = Octree::default();
    octree.parts(writer, &parts, 0);
    Ok(octree)
}

fn beyond_keys(block: BlockKey) -> Error {
    let voxel = block.map(|k| i64::from(k) * BLOCK_EDGE as i64);
    Error::Unsupported {
        operation: "save_octomap",
        reason: format!(
            "voxel {voxel:?} lies beyond OctoMap's keys of 16 bits, which are for -{REACH} to {}",
            REACH - 1
        ),
    }
}

/// One block's nodes.
struct Part {
    /// The way to it from the root.
    path: u64,
    node: Node,
    octree: Octree,
}

impl Octree {
    /// Writes blocks, in their order, that lie in one node of a level.
    fn parts<W: NodeWriter>(&mut self, writer: &W, parts: &[Part], depth: u32) -> Node {
        match parts {
            [] => Node::Unknown,
            [part] if depth == BLOCK_DEPTH => {
                self.bytes.extend(&part.octree.bytes);
                self.nodes += part.octree.nodes;
                part.node
            }
            _ => {
                let mut rest = parts;
                self.inner(writer, |octree, n| {
                    let (child, after) = rest.split_at(rest.partition_point(|part| turn(part.path, depth) == n));
                    rest = after;
                    octree.parts(writer, child, depth + 1)
                })
            }
        }
    }

    fn block<W: NodeWriter>(&mut self, writer: &W, block: &Block) -> Node {
        match block {
            Block::Uniform(evidence) => self.leaf(writer, *evidence),
            block => self.voxels(writer, &block.to_data(), 0, BLOCK_EDGE),
        }
    }

    /// Writes a cube of voxels in a block, of so many voxels along an edge.
    fn voxels<W: NodeWriter>(&mut self, writer: &W, block: &BlockData, first: usize, edge: usize) -> Node {
        if edge == 1 {
            return self.leaf(writer, block[first]);
        }
        let half = edge / 2;
        self.inner(writer, |octree, n| {
            let [x, y, z] = std::array::from_fn(|axis| half * side(n, axis));
            octree.voxels(writer, block, first + voxel_offset(x, y, z), half)
        })
    }

    fn leaf<W: NodeWriter>(&mut self, writer: &W, evidence: i32) -> Node {
        match writer.value(evidence) {
            0 => Node::Unknown,
            value => {
                writer.leaf(value, &mut self.bytes);
                self.nodes += 1;
                Node::Leaf(value)
            }
        }
    }

    /// Writes a node after its children have been, each asked for once and in order.
    fn inner<W: NodeWriter>(&mut self, writer: &W, mut child: impl FnMut(&mut Self, usize) -> Node) -> Node {
        let (start, nodes) = (self.bytes.len(), self.nodes);
        let own = start..start + W::INNER_BYTES;
        self.bytes.resize(own.end, 0);
        let children: [Node; 8] = std::array::from_fn(|n| child(self, n));
        let highest = children.iter().filter_map(|child| match *child {
            Node::Unknown => None,
            Node::Leaf(value) | Node::Inner(value) => Some(value),
        });
        match (children[0], highest.max()) {
            (Node::Leaf(value), _) if children == [Node::Leaf(value); 8] => {
                self.bytes.truncate(start);
                self.nodes = nodes + 1;
                writer.leaf(value, &mut self.bytes);
                Node::Leaf(value)
            }
            (_, Some(highest)) => {
                self.nodes += 1;
                writer.inner(&children, highest, &mut self.bytes[own]);
                Node::Inner(highest)
            }
            (_, None) => {
                self.bytes.truncate(start);
                Node::Unknown
            }
        }
    }
}
