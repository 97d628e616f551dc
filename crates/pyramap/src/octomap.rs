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
//! - OctoMap clamps when it updates a voxel, this map does so only if asked. Files are read and written as they are: what
//!   was written to an `.ot` comes back the same, up to log-odds of 4096, where the precision of `f32` ends. The leaves of
//!   a `.bt` get the log-odds that OctoMap gives them: its clamping limits ([`CLAMP`]).
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
        let header = header::text(format, octree.nodes, self.voxel_size());
        let bytes = [header.into_bytes(), octree.bytes].concat();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{BLOCK_VOXELS, Block, BlockData, BlockKey};
    use crate::log_odds;

    /// A block whose voxels differ, one whose eighths do not, and 2 x 2 x 2 blocks that are one leaf.
    fn map() -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(GridConfig::new(0.05).unwrap()).unwrap();
        let mixed: BlockData = std::array::from_fn(|n| (n as i32 * 37) % 101 - 50);
        let eighths: BlockData = std::array::from_fn(|n| if n < BLOCK_VOXELS / 2 { 70_000 } else { -3 });
        grid.put_block([-1, 0, 4095], Block::Dense(&mixed)).unwrap();
        grid.put_block([-4096, 5, -7], Block::Dense(&eighths)).unwrap();
        for n in 0..8 {
            grid.put_block([8 + (n & 1), -2 + (n >> 1 & 1), n >> 2], Block::Uniform(-1234)).unwrap();
        }
        grid
    }

    fn blocks(grid: &OccupancyGrid, value: impl Fn(i32) -> i32) -> Vec<(BlockKey, BlockData)> {
        let keys = grid.block_coords().into_iter();
        keys.map(|key| (key, grid.block(key).expect("a block").to_data().map(&value))).collect()
    }

    #[test]
    fn maps_come_back() {
        let (grid, folder) = (map(), tempfile::tempdir().unwrap());
        let [full, binary] = ["map.ot", "map.BT"].map(|name| folder.path().join(name));
        grid.save_octomap(&full).unwrap();
        assert_eq!(blocks(&OccupancyGrid::load_octomap(&full).unwrap(), |v| v), blocks(&grid, |v| v));

        grid.save_octomap(&binary).unwrap();
        let [free, occupied] = CLAMP.map(|p| log_odds::to_fixed(log_odds::from_probability(p)));
        let state = |value: i32| if value > 0 { occupied } else { free * value.signum().abs() };
        assert_eq!(blocks(&OccupancyGrid::load_octomap(&binary).unwrap(), |v| v), blocks(&grid, state));
    }

    #[test]
    fn eight_equal_leaves_are_one() {
        let mut grid = map();
        for key in [[-1, 0, 4095], [-4096, 5, -7]] {
            grid.put_block(key, Block::Uniform(0)).unwrap();
        }
        // The root, a node a level, and the leaf in place of eight blocks.
        assert_eq!(writing::octree(&grid, &ot::Writer::new(&grid)).unwrap().nodes, 13);
        grid.put_block([9, -1, 1], Block::Uniform(-1235)).unwrap();
        assert_eq!(writing::octree(&grid, &ot::Writer::new(&grid)).unwrap().nodes, 21);
        assert_eq!(writing::octree(&grid, &bt::Writer::new(&grid)).unwrap().nodes, 13);
    }

    #[test]
    fn a_file_that_is_cut_off_is_no_map() {
        let (grid, folder) = (map(), tempfile::tempdir().unwrap());
        for name in ["map.ot", "map.bt"] {
            let path = folder.path().join(name);
            grid.save_octomap(&path).unwrap();
            let file = std::fs::read(&path).unwrap();
            for length in 0..file.len() {
                let mut rest = &file[..length];
                let leaves = Header::read(&mut rest).and_then(|header| read_nodes(&header, rest));
                assert!(leaves.is_err(), "{length} bytes of {name}");
            }
        }
    }
}
