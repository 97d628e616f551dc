//! Colours of vertices: between those of the two voxels at the ends of the edge that the vertex lies on.

use crate::block::{BLOCK_EDGE, BlockKey};
use crate::colour::{Colours, Rgba};

/// A vertex on an edge of the grid.
pub(super) struct OnEdge {
    /// The edge's first voxel, in its block.
    pub voxel: [usize; 3],
    pub axis: usize,
    /// How much of the edge lies before the vertex.
    pub fraction: f64,
}

/// The colour of a vertex, interpolated as its position is. Where only one of the voxels has a colour it is that one's.
pub(super) fn at(colours: &Colours, key: BlockKey, vertex: &OnEdge) -> Rgba {
    let first: [i32; 3] = std::array::from_fn(|i| key[i] * BLOCK_EDGE as i32 + vertex.voxel[i] as i32);
    let second = std::array::from_fn(|i| first[i] + i32::from(i == vertex.axis));
    let ends = [first, second].map(|voxel| colours.colour(voxel));
    match ends.map(|[.., seen]| seen > 0) {
        [true, false] => ends[0],
        [false, true] => ends[1],
        _ => std::array::from_fn(|c| {
            let [start, end] = ends.map(|end| f64::from(end[c]));
            (start + (end - start) * vertex.fraction).round() as u8
        }),
    }
}
