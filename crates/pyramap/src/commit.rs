//! Stage 5, commit: the frame's increments are added to the map, all of them or, if it would grow too large, none.

use crate::backend::{Addition, Backend, Base, Seen, Source};
use crate::block::{BLOCK_VOXELS, BlockKey};
use crate::directory::{self, Directory, Entry};
use crate::error::{Error, Result};
use crate::log_odds::Limits;
use crate::update::Change;

/// What a frame does to blocks, before it is done.
#[derive(Debug, Default)]
pub struct Changes {
    /// Blocks that get one increment throughout, each with it.
    pub uniform: Vec<(BlockKey, i32)>,
    /// Mixed blocks with an increment for each voxel: their key, and their place among the frame's mixed blocks.
    pub dense: Vec<(BlockKey, usize)>,
}

impl Changes {
    /// Sorts the blocks of a frame by what happens to them.
    pub fn sort(&mut self, Seen { culled, changes, .. }: &Seen, free_increment: i32) {
        self.uniform.clear();
        self.dense.clear();
        self.uniform.extend(culled.free.iter().map(|&key| (key, free_increment)));
        for (n, (&key, change)) in culled.mixed.iter().zip(changes).enumerate() {
            match *change {
                Change::None => {}
                Change::Uniform(increment) => self.uniform.push((key, increment)),
                Change::Dense { .. } => self.dense.push((key, n)),
            }
        }
    }
}

/// Stands for the slot of a block that has none yet.
const NO_SLOT: u32 = u32::MAX;

/// What a commit keeps from frame to frame, so that it need not be allocated again.
#[derive(Debug, Default)]
pub struct CommitBuffers {
    additions: Vec<Addition>,
    /// The blocks added to.
    keys: Vec<BlockKey>,
}

impl CommitBuffers {
    /// Takes blocks that a commit left with one value out of the pool: free space costs an entry, not a block.
    pub fn collapse(&self, uniform: &[(usize, i32)], directory: &mut Directory, backend: &mut dyn Backend) {
        for &(n, value) in uniform {
            backend.release(self.additions[n].slot);
            set_uniform(directory, self.keys[n], value);
        }
    }
}

/// An addition to a map.
pub struct Commit<'a> {
    /// What is added.
    pub changes: &'a Changes,
    /// `1` to add, `-1` to take back.
    pub sign: i32,
    /// The range of stored evidence.
    pub limits: Limits,
    /// The map's blocks.
    pub directory: &'a mut Directory,
    /// Room to work in.
    pub buffers: &'a mut CommitBuffers,
    /// Bytes that the map's colours will take.
    pub colour_bytes: usize,
}

impl Commit<'_> {
    /// Has everything added; returns how many voxels of uniform blocks `i32` was too small for. What comes of the others
    /// the backend tells when it is done.
    ///
    /// # Errors
    /// [`Error::MapFull`] if the map would take more than `max_bytes`, or [`Error::Device`]; nothing is added then.
    pub fn apply(self, backend: &mut dyn Backend, max_bytes: Option<usize>) -> Result<u64> {
        if self.check_budget(backend, max_bytes).is_err() {
            backend.trim();
            self.check_budget(backend, max_bytes)?;
        }
        let Self { changes: Changes { uniform, dense }, sign, limits, directory, buffers, .. } = self;
        let CommitBuffers { additions, keys } = buffers;
        additions.clear();
        keys.clear();
        let mut new = 0;
        for &(key, n) in dense {
            let (slot, base) = match directory.get(&key) {
                Some(&Entry::Dense(slot)) => (slot, None),
                Some(&Entry::Uniform(value)) => (NO_SLOT, Some(value)),
                None => (NO_SLOT, Some(0)),
            };
            new += usize::from(base.is_some());
            additions.push(Addition { slot, base, source: Source::Mixed(n) });
            keys.push(key);
        }
        backend.reserve(new)?;
        for (addition, &key) in additions.iter_mut().zip(&*keys).filter(|(addition, _)| addition.base.is_some()) {
            addition.slot = backend.allocate();
            directory.insert(key, Entry::Dense(addition.slot));
        }
        let mut lost = 0;
        for &(key, increment) in uniform {
            let value = match directory.get(&key) {
                Some(&Entry::Dense(slot)) => {
                    additions.push(Addition { slot, base: None, source: Source::Uniform(increment) });
                    keys.push(key);
                    continue;
                }
                Some(&Entry::Uniform(value)) => value,
                None => 0,
            };
            let (sum, overflow) = limits.add(value, increment * sign);
            lost += if overflow { BLOCK_VOXELS as u64 } else { 0 };
            set_uniform(directory, key, sum);
        }
        backend.commit(additions, sign, limits)?;
        Ok(lost)
    }

    fn check_budget(&self, backend: &dyn Backend, max_bytes: Option<usize>) -> Result<()> {
        let Some(max_bytes) = max_bytes else { return Ok(()) };
        let Changes { uniform, dense } = self.changes;
        let entry = |key: &BlockKey| self.directory.get(key).copied();
        let keys = || uniform.iter().map(|(key, _)| key).chain(dense.iter().map(|(key, _)| key));
        let entries = self.directory.len() + keys().filter(|key| entry(key).is_none()).count();
        let to_slots = keys().filter(|key| matches!(entry(key), Some(Entry::Dense(_)))).count();
        let to_new = dense.iter().filter(|(key, _)| !matches!(entry(key), Some(Entry::Dense(_)))).count();
        let check =
            |blocks| budget(self.directory, entries, backend, to_new, blocks + self.colour_bytes, Some(max_bytes));
        if check(backend.most_growth(to_slots, to_new)).is_ok() {
            return Ok(());
        }
        // The most that the frame may need does not fit: see what it does need.
        let base = |key: &BlockKey| match entry(key) {
            Some(Entry::Dense(slot)) => Base::Slot(slot),
            Some(Entry::Uniform(value)) => Base::Value(value),
            None => Base::Value(0),
        };
        let growth = |base, source| backend.growth(base, source, self.sign, self.limits);
        let to_slots = uniform.iter().filter_map(|(key, increment)| match base(key) {
            Base::Value(_) => None,
            slot => Some(growth(slot, Source::Uniform(*increment))),
        });
        let mixed = dense.iter().map(|(key, n)| growth(base(key), Source::Mixed(*n)));
        check(to_slots.chain(mixed).sum())
    }
}

/// Refuses a map that would take more than it may, with so many entries, new slots, and more bytes beside: those by which
/// blocks grow, and those of colours.
///
/// # Errors
/// [`Error::MapFull`].
pub fn budget(
    directory: &Directory,
    entries: usize,
    backend: &dyn Backend,
    new_slots: usize,
    beside: usize,
    max_bytes: Option<usize>,
) -> Result<()> {
    let pool = backend.pool_bytes() + backend.table_growth(new_slots) + beside;
    let needed = directory::bytes(directory, entries) + pool;
    match max_bytes {
        Some(max_bytes) if needed > max_bytes => Err(Error::MapFull { needed, max_bytes }),
        _ => Ok(()),
    }
}

/// Stores one value for a whole block; `0` is unknown, and takes the block out.
pub fn set_uniform(directory: &mut Directory, key: BlockKey, value: i32) {
    if value == 0 {
        directory.remove(&key);
    } else {
        directory.insert(key, Entry::Uniform(value));
    }
}
