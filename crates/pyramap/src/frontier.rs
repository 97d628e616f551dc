//! Frontiers: where free space ends and nobody has looked any further. They are where an explorer goes.
//!
//! B. Yamauchi, "A frontier-based approach for autonomous exploration", CIRA 1997. A voxel is of the frontier if it is
//! free and shares a face with an unknown one: through a face a view or a robot can pass, through an edge or a corner
//! hardly. Voxels of the frontier belong together if they touch at all, so that a slanted sheet is in one piece.
//!
//! Sets of voxels are bits (`mask.rs`). Each block finds its own part of the frontier, on all threads, in one read
//! of itself and of the faces of its neighbours; a block that is free throughout asks only what its six neighbours are.
//! What then has to be joined is not voxels but the few connected patches of each block.

use crate::block::{BLOCK_EDGE, Block, BlockKey, Blocks, VoxelIndex};
use crate::disjoint_sets::DisjointSets;
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::mask::Mask;
use crate::state::{State, Threshold};
use hashbrown::HashMap;
use rayon::prelude::*;

/// Which frontiers to look for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrontierOptions {
    /// Clusters with fewer voxels than this are left out.
    pub min_size: usize,
    /// Clusters longer than this along an axis, metres, are divided until they are not; at least the edge of a block.
    /// What a depth image leaves behind is often one sheet around all that it saw, and its centre no place to go to.
    pub max_extent: Option<f64>,
}

/// A cluster of frontier voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct Frontier {
    /// The voxels, in rising order.
    pub voxels: Vec<VoxelIndex>,
    /// Area, square metres. A voxel with `n_x`, `n_y`, `n_z` unknown neighbours along the axes has
    /// `r^2 sqrt(n_x^2 + n_y^2 + n_z^2)`, which is right for sheets along an axis and for diagonal ones; in between it is
    /// too large, by 8 % at most where the sheet is parallel to an axis.
    pub area: f64,
    /// The mean of the voxels' centres, metres. It need not lie in one of them, nor in free space.
    pub centre: [f64; 3],
    /// Unit vector from free towards unknown space: the mean over the faces between the two. Zero if they cancel out.
    pub normal: [f64; 3],
}

impl OccupancyGrid {
    /// The frontiers of the map: see [`find`].
    ///
    /// # Errors
    /// As [`find`].
    pub fn frontiers(&self, options: &FrontierOptions) -> Result<Vec<Frontier>> {
        find(self, options)
    }
}

/// The frontiers of a map, those with the most voxels first; among equals, the one with the lowest voxel.
///
/// They depend on the voxels alone, not on how blocks are stored, nor on the number of threads.
///
/// # Errors
/// [`Error::Parameter`] if `max_extent` is not at least the edge of a block; what [`Blocks::fetch`] gives.
pub fn find(blocks: &(impl Blocks + ?Sized), options: &FrontierOptions) -> Result<Vec<Frontier>> {
    let voxel_size = blocks.voxel_size();
    let max_extent = options.max_extent.map(|extent| extent_in_voxels(extent, voxel_size)).transpose()?;
    blocks.fetch()?;
    let mut keys = blocks.keys();
    keys.par_sort_unstable();
    let patches: Vec<Patch> = keys.par_iter().with_min_len(64).flat_map_iter(|&key| patches(blocks, key)).collect();

    let mut clusters = clusters(&patches);
    clusters.retain(|cluster| cluster.iter().map(Patch::size).sum::<usize>() >= options.min_size);
    if let Some(max_extent) = max_extent {
        clusters = clusters.into_par_iter().flat_map_iter(|cluster| divided(cluster, max_extent)).collect();
    }
    let mut frontiers: Vec<_> = clusters.par_iter().map(|cluster| frontier(cluster, voxel_size)).collect();
    frontiers.par_sort_unstable_by_key(|frontier| (std::cmp::Reverse(frontier.voxels.len()), frontier.voxels[0]));
    Ok(frontiers)
}

fn extent_in_voxels(extent: f64, voxel_size: f64) -> Result<i32> {
    let least = BLOCK_EDGE as f64 * voxel_size;
    // A hair of slack: 8 * 0.05 is not what 0.4 is, and neither must count as more.
    let voxels = (extent / voxel_size + 1e-6).floor();
    if voxels >= BLOCK_EDGE as f64 {
        return Ok(voxels.min(f64::from(i32::MAX)) as i32);
    }
    Err(Error::Parameter {
        name: "max_extent",
        got: format!("{extent}"),
        expected: format!("at least the edge of a block, {least} m"),
    })
}

/// The part of a cluster that lies in one block; its voxels are connected within the block.
#[derive(Clone, Copy)]
struct Patch {
    key: BlockKey,
    voxels: Mask,
    /// Faces towards unknown voxels: those that look up an axis less those that look down.
    faces: [i32; 3],
    /// See [`Frontier::area`], for voxels of edge 1.
    area: f64,
}

/// The frontier within one block.
fn patches(blocks: &(impl Blocks + ?Sized), key: BlockKey) -> Vec<Patch> {
    let Some(block) = blocks.block(key) else { return Vec::new() };
    let threshold = Threshold::of(blocks);
    let free = Mask::of(&block, |evidence| threshold.state(evidence) == State::Free);
    if free.is_empty() {
        return Vec::new();
    }
    let unknown = Mask::of(&block, |evidence| evidence == 0);
    let exits = [0, 1, 2].map(|axis| {
        [false, true].map(|up| free & (unknown.step(axis, !up).0 | unknown_beyond(blocks, key, free, axis, up)))
    });

    let mut rest = exits.iter().flatten().fold(Mask::NONE, |all, &exit| all | exit);
    let mut patches = Vec::new();
    while let Some(first) = rest.offsets().next() {
        let voxels = connected(first, rest);
        rest = rest & !voxels;
        let count = |axis: usize, up: bool| (voxels & exits[axis][usize::from(up)]).count() as i32;
        let faces = [0, 1, 2].map(|axis| count(axis, true) - count(axis, false));
        patches.push(Patch { key, voxels, faces, area: voxels.offsets().map(|voxel| area(&exits, voxel)).sum() });
    }
    patches
}

/// Those voxels on a face of a block whose neighbours in the next block are unknown; `free` are the ones of interest.
fn unknown_beyond(blocks: &(impl Blocks + ?Sized), key: BlockKey, free: Mask, axis: usize, up: bool) -> Mask {
    let face = Mask::face(axis, up);
    if (free & face).is_empty() {
        return Mask::NONE;
    }
    let mut next = key;
    next[axis] += if up { 1 } else { -1 };
    match blocks.block(next) {
        None | Some(Block::Uniform(0)) => face,
        Some(Block::Uniform(_)) => Mask::NONE,
        Some(block) => Mask::of_face(&block, axis, !up, |evidence| evidence == 0).step(axis, !up).1,
    }
}

/// The voxels of a set that are connected to one of them.
fn connected(first: usize, set: Mask) -> Mask {
    let mut part = Mask::single(first);
    loop {
        let grown = part.touching([0; 3]) & set;
        if grown == part {
            return part;
        }
        part = grown;
    }
}

fn area(exits: &[[Mask; 2]; 3], voxel: usize) -> f64 {
    let faces = exits.map(|pair| pair.map(|exit| f64::from(u8::from(exit.contains(voxel)))).iter().sum::<f64>());
    faces.iter().map(|n| n * n).sum::<f64>().sqrt()
}

/// The 13 neighbours of a block that have higher keys.
fn later_neighbours() -> impl Iterator<Item = [i32; 3]> {
    (14..27).map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1])
}

/// Patches, sorted by their blocks, put together where they touch.
fn clusters(patches: &[Patch]) -> Vec<Vec<Patch>> {
    let mut of_block: HashMap<BlockKey, std::ops::Range<usize>> = HashMap::new();
    for (n, patch) in patches.iter().enumerate() {
        of_block.entry(patch.key).or_insert(n..n).end = n + 1;
    }
    let touching = |n: usize| {
        let (patch, of_block) = (&patches[n], &of_block);
        later_neighbours().flat_map(move |away| {
            let others = of_block.get(&std::array::from_fn(|axis| patch.key[axis] + away[axis]));
            let near = patch.voxels.touching(away);
            others
                .cloned()
                .unwrap_or(0..0)
                .filter(move |&m| !(near & patches[m].voxels).is_empty())
                .map(move |m| (n, m))
        })
    };
    let pairs: Vec<_> = (0..patches.len()).into_par_iter().with_min_len(64).flat_map_iter(touching).collect();
    let mut sets = DisjointSets::new(patches.len());
    pairs.into_iter().for_each(|(a, b)| sets.join(a as u32, b as u32));

    let mut clusters: Vec<Vec<Patch>> = Vec::new();
    let mut place = HashMap::new();
    for (n, patch) in (0..).zip(patches) {
        let cluster = *place.entry(sets.first(n)).or_insert_with(|| {
            clusters.push(Vec::new());
            clusters.len() - 1
        });
        clusters[cluster].push(*patch);
    }
    clusters
}

/// A cluster in parts that are at most so many voxels long on each axis: halved across its longest axis, and so on.
fn divided(mut cluster: Vec<Patch>, max_extent: i32) -> Vec<Vec<Patch>> {
    let corners = cluster.iter().map(Patch::corners);
    let (low, high) = corners
        .reduce(|(low, high), (a, b)| {
            (std::array::from_fn(|axis| low[axis].min(a[axis])), std::array::from_fn(|axis| high[axis].max(b[axis])))
        })
        .expect("a cluster is not empty");
    let (extent, axis) = (0..3).map(|axis| (high[axis] - low[axis] + 1, axis)).max().expect("three axes");
    if extent <= max_extent {
        return vec![cluster];
    }
    // Within a block nothing exceeds a block's edge: there are at least two patches.
    cluster.sort_by_key(|patch| {
        let (low, high) = patch.corners();
        (low[axis] + high[axis], patch.key)
    });
    let other = cluster.split_off(cluster.len() / 2);
    [divided(cluster, max_extent), divided(other, max_extent)].concat()
}

fn frontier(cluster: &[Patch], voxel_size: f64) -> Frontier {
    let mut voxels: Vec<_> = cluster.iter().flat_map(Patch::indices).collect();
    voxels.sort_unstable();
    let sum = |axis: usize| voxels.iter().map(|voxel| i64::from(voxel[axis])).sum::<i64>() as f64;
    let centre = [0, 1, 2].map(|axis| (sum(axis) / voxels.len() as f64 + 0.5) * voxel_size);
    let faces = [0, 1, 2].map(|axis| cluster.iter().map(|patch| i64::from(patch.faces[axis])).sum::<i64>() as f64);
    let length = faces.iter().map(|n| n * n).sum::<f64>().sqrt();
    let normal = if length > 0.0 { faces.map(|n| n / length) } else { [0.0; 3] };
    let area = cluster.iter().map(|patch| patch.area).sum::<f64>() * voxel_size * voxel_size;
    Frontier { voxels, area, centre, normal }
}

impl Patch {
    fn size(&self) -> usize {
        self.voxels.count() as usize
    }

    fn indices(&self) -> impl Iterator<Item = VoxelIndex> {
        let first = self.key.map(|k| k * BLOCK_EDGE as i32);
        self.voxels.offsets().map(move |offset| {
            let [x, y, z] = [offset / (BLOCK_EDGE * BLOCK_EDGE), offset / BLOCK_EDGE % BLOCK_EDGE, offset % BLOCK_EDGE];
            [first[0] + x as i32, first[1] + y as i32, first[2] + z as i32]
        })
    }

    /// The lowest and the highest coordinates of its voxels.
    fn corners(&self) -> (VoxelIndex, VoxelIndex) {
        let bounds = |axis: usize| {
            let along = || self.indices().map(|voxel| voxel[axis]);
            (along().min().expect("a patch is not empty"), along().max().expect("a patch is not empty"))
        };
        let bounds = [0, 1, 2].map(bounds);
        (bounds.map(|(low, _)| low), bounds.map(|(_, high)| high))
    }
}
