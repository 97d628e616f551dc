//! The `.pmap` file: a whole map, or an error.
//!
//! ```text
//! magic "PYRAMAP\0", version u32
//! section*: tag [u8; 4], length u64, CRC-32 u32 of tag, length and payload, payload
//!   "HEAD"  parameters, counts and history (postcard): all that differs from version to version
//!   "BLKS"  up to 4096 blocks, sorted by coordinates (postcard, zstd)
//!   "COLR"  colours of up to 1024 blocks, sorted by coordinates (postcard, zstd); from version 3 on
//!   "DONE"  empty: the file is whole
//! ```
//!
//! Maps that keep no colours are written as version 2, so that programs which know no colour read them.
//!
//! Numbers are little-endian. Blocks whose voxels are equal are written as one number and unknown ones not at all, so
//! equal maps of equal history give equal bytes in whatever order they came about. Nothing that the file says of its own size is trusted:
//! memory is taken for what was read, and a block section cannot unpack to more than its 4096 blocks can hold.

use crate::block::{BLOCK_VOXELS, Block, BlockKey, Blocks, MAX_BLOCK};
use crate::config::GridConfig;
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use head::{Head, VERSION};
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

mod colours;
mod head;

const MAGIC: [u8; 8] = *b"PYRAMAP\0";
const HEAD: [u8; 4] = *b"HEAD";
const BLOCKS: [u8; 4] = *b"BLKS";
const COLOURS: [u8; 4] = *b"COLR";
const DONE: [u8; 4] = *b"DONE";
const BLOCKS_IN_SECTION: usize = 4096;
/// A record's key takes at most 15 bytes, its values 5 each, their count and kind a few.
const MAX_SECTION_BYTES: usize = BLOCKS_IN_SECTION * (5 * BLOCK_VOXELS + 32);
const COMPRESSION_LEVEL: i32 = 3;

#[derive(Serialize, Deserialize)]
struct Record {
    key: BlockKey,
    content: Content,
}

#[derive(Serialize, Deserialize)]
enum Content {
    Uniform(i32),
    Dense(Vec<i32>),
}

impl OccupancyGrid {
    /// Writes the map to a file: to a temporary one beside it first, so that the path holds a whole map or what was
    /// there before.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        self.fetch()?;
        let bytes = self.to_bytes();
        write_whole(path, &bytes).map_err(|source| Error::Io { path: path.into(), source })
    }

    /// Reads a map that [`OccupancyGrid::save`] wrote, to go on with it on the CPU.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read; [`Error::File`] if it is no map, is cut off or altered, or comes from
    /// a newer version.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        Self::load_on(path, Self::new)
    }

    /// Reads a map into an empty one that is made for its parameters, on a device of your choice
    /// ([`OccupancyGrid::with_backend`]).
    ///
    /// # Errors
    /// As [`OccupancyGrid::load`]; and what `empty` fails with.
    pub fn load_on(path: impl AsRef<Path>, empty: impl FnOnce(GridConfig) -> Result<Self>) -> Result<Self> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
        Self::from_bytes(&bytes, empty).map_err(|error| match error {
            Damage::Reason(reason) => Error::File { path: path.into(), reason },
            Damage::Parameter(error) => Error::File { path: path.into(), reason: format!("bad parameters: {error}") },
            Damage::Other(error) => error,
        })
    }

    fn to_bytes(&self) -> Vec<u8> {
        let keys = self.block_coords();
        let records: Vec<Record> = keys.par_iter().filter_map(|&key| self.record(key)).collect();
        let head = Head {
            config: self.config().clone(),
            num_frames: self.num_frames(),
            saturated: self.saturated(),
            num_blocks: records.len() as u64,
            history: self.history(),
        };
        let sections: Vec<Vec<u8>> = records.par_chunks(BLOCKS_IN_SECTION).map(|records| pack(&records)).collect();
        let coloured = self.colours().map(colours::records);
        let mut bytes = MAGIC.to_vec();
        let (version, head) = head.written(coloured.as_ref().map(Vec::len));
        bytes.extend(version.to_le_bytes());
        put_section(&mut bytes, HEAD, &head);
        sections.iter().for_each(|payload| put_section(&mut bytes, BLOCKS, payload));
        let coloured = colours::packed(&coloured.unwrap_or_default());
        coloured.iter().for_each(|payload| put_section(&mut bytes, COLOURS, payload));
        put_section(&mut bytes, DONE, &[]);
        bytes
    }

    fn record(&self, key: BlockKey) -> Option<Record> {
        let block = self.block(key)?;
        let content = match block.uniform_value() {
            Some(0) => return None,
            Some(value) => Content::Uniform(value),
            None => Content::Dense(block.to_data().to_vec()),
        };
        Some(Record { key, content })
    }

    fn from_bytes(bytes: &[u8], empty: impl FnOnce(GridConfig) -> Result<Self>) -> std::result::Result<Self, Damage> {
        let mut rest = bytes;
        if take(&mut rest, MAGIC.len()) != Some(&MAGIC) {
            return damage("not a pyramap map (the first bytes are others)");
        }
        let version = match take(&mut rest, 4).map(|v| u32::from_le_bytes(v.try_into().expect("four bytes"))) {
            Some(version @ 1..=VERSION) => version,
            Some(version) => return damage(format!("format version {version}, this program reads 1 to {VERSION}")),
            None => return damage("cut off in its first bytes"),
        };
        let (tag, payload) = take_section(&mut rest)?;
        if tag != HEAD {
            return damage("the parameters are missing");
        }
        let (head, num_coloured) = Head::read(version, payload)?;
        head.history.validate().map_err(Damage::Parameter)?;
        let (mut sections, mut coloured) = (Vec::new(), Vec::new());
        loop {
            match take_section(&mut rest)? {
                (BLOCKS, payload) => sections.push(payload),
                (COLOURS, payload) if head.config.colour => coloured.push(payload),
                (DONE, []) if rest.is_empty() => break,
                (DONE, _) => return damage("bytes after the end of the map"),
                (tag, _) => return damage(format!("unknown section {:?}", String::from_utf8_lossy(&tag))),
            }
        }
        let sections = sections.par_iter().map(|payload| unpack(payload, BLOCKS_IN_SECTION, MAX_SECTION_BYTES));
        let sections: Vec<Vec<Record>> = sections.collect::<std::result::Result<_, _>>()?;
        let records: Vec<Record> = sections.into_iter().flatten().collect();
        if records.len() as u64 != head.num_blocks {
            return damage(format!("holds {} blocks, its head says {}", records.len(), head.num_blocks));
        }
        if !records.is_sorted_by(|a, b| a.key < b.key) {
            return damage("blocks are not in order");
        }
        let coloured = colours::read(&coloured)?;
        if coloured.len() as u64 != num_coloured {
            return damage(format!("holds colours of {} blocks, its head says {num_coloured}", coloured.len()));
        }
        if !coloured.is_sorted_by(|a, b| a.key < b.key) {
            return damage("colours are not in order");
        }
        head.config.validate().map_err(Damage::Parameter)?;
        let mut grid = empty(head.config).map_err(Damage::Other)?;
        let blocks = records.iter().map(|record| Ok((record.key, record.block()?)));
        let blocks: Vec<_> = blocks.collect::<std::result::Result<_, _>>()?;
        let colours: Vec<_> = coloured.iter().map(|record| record.block()).collect::<std::result::Result<_, _>>()?;
        let (blocks, colours) = (blocks.into_iter(), colours.into_iter());
        grid.restore(blocks, colours, head.num_frames, head.saturated, head.history).map_err(Damage::Other)?;
        Ok(grid)
    }
}

/// Why bytes are no map.
enum Damage {
    Reason(String),
    Parameter(Error),
    /// What is wrong is not the file.
    Other(Error),
}

fn damage<T>(reason: impl Into<String>) -> std::result::Result<T, Damage> {
    Err(Damage::Reason(reason.into()))
}

/// A section of records.
fn pack<T: Serialize>(records: &T) -> Vec<u8> {
    let plain = postcard::to_allocvec(records).expect("plain data can be written to memory");
    zstd::bulk::compress(&plain, COMPRESSION_LEVEL).expect("memory can be compressed")
}

/// The records of a section, if these are no more, and no larger, than any map writes.
fn unpack<T: DeserializeOwned>(payload: &[u8], most: usize, max_bytes: usize) -> std::result::Result<Vec<T>, Damage> {
    let mut plain = Vec::new();
    let decoder = zstd::stream::Decoder::with_buffer(payload);
    let mut limited = decoder.or_else(|e| damage(format!("blocks do not unpack: {e}")))?.take(max_bytes as u64 + 1);
    limited.read_to_end(&mut plain).or_else(|e| damage(format!("blocks do not unpack: {e}")))?;
    if plain.len() > max_bytes {
        return damage("a section of blocks is larger than any map writes");
    }
    let records: Vec<T> = postcard::from_bytes(&plain).or_else(|e| damage(format!("unreadable blocks: {e}")))?;
    if records.len() > most {
        return damage("a section of blocks is larger than any map writes");
    }
    Ok(records)
}

impl Record {
    fn block(&self) -> std::result::Result<Block<'_>, Damage> {
        let key = self.key;
        if key.iter().any(|k| k.unsigned_abs() > MAX_BLOCK) {
            return damage(format!("block {key:?} lies beyond the coordinates of any map"));
        }
        match &self.content {
            Content::Uniform(value) => Ok(Block::Uniform(*value)),
            Content::Dense(values) => match values.as_slice().try_into() {
                Ok(values) => Ok(Block::Dense(values)),
                Err(_) => damage(format!("block {key:?} has {} voxels, expected {BLOCK_VOXELS}", values.len())),
            },
        }
    }
}

fn put_section(out: &mut Vec<u8>, tag: [u8; 4], payload: &[u8]) {
    let length = (payload.len() as u64).to_le_bytes();
    out.extend(tag);
    out.extend(length);
    out.extend(checksum(&tag, &length, payload).to_le_bytes());
    out.extend(payload);
}

fn take_section<'a>(rest: &mut &'a [u8]) -> std::result::Result<([u8; 4], &'a [u8]), Damage> {
    let Some(head) = take(rest, 16) else { return damage("cut off between sections") };
    let (tag, length, sum) = (&head[..4], &head[4..12], &head[12..]);
    let bytes = u64::from_le_bytes(length.try_into().expect("eight bytes"));
    let payload = usize::try_from(bytes).ok().and_then(|bytes| take(rest, bytes));
    let Some(payload) = payload else { return damage("cut off inside a section") };
    if sum != checksum(tag, length, payload).to_le_bytes() {
        return damage("altered: a checksum does not match");
    }
    Ok((tag.try_into().expect("four bytes"), payload))
}

fn checksum(tag: &[u8], length: &[u8], payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    [tag, length, payload].into_iter().for_each(|part| hasher.update(part));
    hasher.finalize()
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, left) = rest.split_at_checked(count)?;
    *rest = left;
    Some(taken)
}

/// Writes a file beside its place first, so that the path holds all of it or what was there.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    make_readable(file.as_file())?;
    file.persist(path)?;
    // The new name lasts only once the folder is on disk too; not every system lets a folder be synced.
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Temporary files are private to their owner; a map is an ordinary file.
#[cfg(unix)]
fn make_readable(file: &File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &File) -> std::io::Result<()> {
    Ok(())
}
