//! OctoMap's files: `.ot` with a log-odd for each node, `.bt` with no more than whether it is free or occupied.
//!
//! ```text
//! # Octomap OcTree file               (.bt: # Octomap OcTree binary file)
//! id OcTree
//! size 17                             nodes, inner ones too
//! res 0.05                            edge of a voxel, metres
//! data
//! nodes: the root first, each before its children
//! ```
//!
//! Voxel `(i, j, k)` is the same cube in both libraries. What differs:
//!
//! - OctoMap calls a log-odd of 0 occupied, and for this map 0 is unknown. A leaf within half a step of 0 is read as one
//!   step to the side that OctoMap takes it for, and what is free here is written below 0: states never change.
//! - OctoMap clamps when it updates a voxel, this map does so only if asked. Files are read and written as they are. The
//!   leaves of a `.bt` get the log-odds that OctoMap gives them: its clamping limits ([`CLAMP`]).
//! - OctoMap reaches 32768 voxels from the origin; a map that goes farther is not written.

mod bt;
mod header;
mod ot;
mod reading;
mod tree;
mod writing;

use crate::block::Blocks;
use crate::config::GridConfig;
use crate::error::{Error, Result};
use crate::file::write_whole;
use crate::grid::OccupancyGrid;
use header::{Format, Header};
use reading::Leaves;
use std::path::Path;

/// The probabilities between which OctoMap keeps its voxels unless told otherwise.
pub const CLAMP: [f64; 2] = [0.1192, 0.971];

/// The most blocks that the leaves of a file may come to: a few bytes can stand for 65536^3 voxels, and the entries of
/// so many blocks take a gigabyte.
pub const MAX_BLOCKS: u64 = 1 << 24;

impl OccupancyGrid {
    /// Reads a `.bt` or `.ot` file of OctoMap, whatever it is called, to go on with it on the CPU; colours of a
    /// `ColorOcTree` are left out.
    ///
    /// The map has the parameters of [`GridConfig::new`] for the file's resolution, with a `max_range` that is valid for
    /// it. To go on with others, use [`OccupancyGrid::load_octomap_on`].
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read; [`Error::File`] if it is no octree of OctoMap, is cut off or damaged, or
    /// would take more than [`MAX_BLOCKS`] blocks.
    pub fn load_octomap(path: impl AsRef<Path>) -> Result<Self> {
        Self::load_octomap_on(path, Self::new)
    }

    /// Reads a file of OctoMap into an empty map that is made of the parameters which [`OccupancyGrid::load_octomap`]
    /// takes: with others, or on a device of your choice. A clamp of the map holds for what is read.
    ///
    /// # Errors
    /// As [`OccupancyGrid::load_octomap`]; and what `empty` fails with.
    pub fn load_octomap_on(path: impl AsRef<Path>, empty: impl FnOnce(GridConfig) -> Result<Self>) -> Result<Self> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
        let damaged = |reason| Error::File { path: path.into(), reason };
        let mut rest = bytes.as_slice();
        let header = Header::read(&mut rest).map_err(damaged)?;
        let leaves = read_nodes(&header, rest).map_err(damaged)?;
        let mut grid = empty(config(header.voxel_size)?)?;
        leaves.put_into(&mut grid)?;
        Ok(grid)
    }

    /// Writes the map as an octree for OctoMap, with equal children pruned: `.ot` with all log-odds, prior included, or
    /// `.bt`, which keeps states only. As with [`OccupancyGrid::save`], the path holds the whole file or what was there.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the path ends in something else; [`Error::Unsupported`] if the map goes farther than
    /// OctoMap's keys of 16 bits; [`Error::Io`] if the file cannot be written; [`Error::Device`].
    pub fn save_octomap(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let format = Format::of_path(path)?;
        self.fetch()?;
        let octree = match format {
            Format::Binary => writing::octree(self, &bt::Writer::new(self))?,
            Format::Full => writing::octree(self, &ot::Writer::new(self))?,
        };
        let header = Header { format, colour: false, nodes: octree.nodes, voxel_size: self.voxel_size() };
        let bytes = [header.to_bytes(), octree.bytes].concat();
        write_whole(path, &bytes).map_err(|source| Error::Io { path: path.into(), source })
    }
}

/// Parameters for voxels of any size.
fn config(voxel_size: f64) -> Result<GridConfig> {
    let mut config = GridConfig::new(voxel_size)?;
    config.max_range = config.max_range.clamp(voxel_size, GridConfig::MAX_VOXELS_IN_RANGE * voxel_size);
    Ok(config)
}

/// The leaves in the rest of a file.
fn read_nodes(header: &Header, mut rest: &[u8]) -> std::result::Result<Leaves, String> {
    let mut leaves = Leaves::default();
    // The file of an empty tree ends with its header.
    if header.nodes > 0 {
        match header.format {
            Format::Binary => bt::read(&mut rest, &mut leaves)?,
            Format::Full => ot::read(&mut rest, &mut leaves, header.colour)?,
        }
    }
    if !rest.is_empty() {
        return Err(format!("{} bytes after the last node", rest.len()));
    }
    if leaves.nodes() != header.nodes {
        return Err(format!("holds {} nodes, its header says {}", leaves.nodes(), header.nodes));
    }
    Ok(leaves)
}
