//! The CPU's pool of dense blocks: 16 bits a voxel as long as that is enough, 32 from then on.
//!
//! Whether a block is narrow is no part of what a map holds: it changes neither sums nor files.

use crate::backend::{Addition, Committed, Source};
use crate::block::{BLOCK_VOXELS, Block, BlockData, NarrowBlockData};
use crate::log_odds::Limits;
use crate::simd::{Instructions, Kernel, Simd};
use rayon::prelude::*;
use std::mem::{size_of, take};

/// The blocks, by slot.
#[derive(Default)]
pub struct Pool {
    slots: Vec<Option<Voxels>>,
    unused: Vec<u32>,
    /// Narrow blocks that slots gave back, for the next ones: a clamped map gives back and takes some in every frame.
    spare: Vec<Voxels>,
    num_narrow: usize,
    num_wide: usize,
    /// Room for [`Pool::add`] to work in, kept from frame to frame.
    taken: Vec<(Voxels, Addition)>,
    results: Vec<Added>,
}

enum Voxels {
    Narrow(Box<NarrowBlockData>),
    Wide(Box<BlockData>),
}

/// The table of slots grows by so many at a time, not by doubling: then what it will take is known, and `max_bytes` holds.
const TABLE_STEP: usize = 1024;

/// So many blocks are kept to be used again.
const SPARE: usize = 64;

/// The directory names only slots that it was given and has not given back.
const IN_USE: &str = "a slot that is in use";

impl Pool {
    /// Bytes of all blocks, and of the table of slots.
    pub fn bytes(&self) -> usize {
        (self.num_narrow + self.spare.len()) * size_of::<NarrowBlockData>()
            + self.spare.capacity() * size_of::<Voxels>()
            + self.num_wide * size_of::<BlockData>()
            + Self::table_bytes(self.slots.capacity())
    }

    /// Bytes of a table of so many slots, and of the list of those that are not in use.
    fn table_bytes(slots: usize) -> usize {
        slots * (size_of::<Option<Voxels>>() + size_of::<u32>())
    }

    /// Bytes by which the table would grow if so many slots were allocated.
    pub fn table_growth(&self, new: usize) -> usize {
        let slots = (self.slots.len() + new).saturating_sub(self.unused.len()).next_multiple_of(TABLE_STEP);
        Self::table_bytes(slots.saturating_sub(self.slots.capacity()))
    }

    /// Bytes by which blocks would grow at most: narrow blocks may widen, and new ones be wide.
    pub fn most_growth(&self, to_slots: usize, to_new: usize) -> usize {
        to_slots * (size_of::<BlockData>() - size_of::<NarrowBlockData>()) + to_new * size_of::<BlockData>()
    }

    /// Bytes by which blocks would grow if `values` were stored in a slot, or a new one.
    pub fn growth_to(&self, slot: Option<u32>, values: &BlockData) -> usize {
        let needed = if narrowed(values).is_some() { size_of::<NarrowBlockData>() } else { size_of::<BlockData>() };
        let taken = slot.map_or(0, |slot| match self.voxels(slot) {
            Voxels::Narrow(_) => size_of::<NarrowBlockData>(),
            Voxels::Wide(_) => size_of::<BlockData>(),
        });
        needed.saturating_sub(taken)
    }

    /// A slot, which holds anything.
    pub fn allocate(&mut self) -> u32 {
        let slot = self.unused.pop().unwrap_or_else(|| {
            if self.slots.len() == self.slots.capacity() {
                self.slots.reserve_exact(TABLE_STEP);
                self.unused.reserve_exact(self.slots.capacity());
            }
            self.slots.push(None);
            (self.slots.len() - 1) as u32
        });
        let voxels = self.spare.pop().unwrap_or_else(|| Voxels::Narrow(Box::new([0; BLOCK_VOXELS])));
        self.put(slot, voxels);
        slot
    }

    /// Gives a slot back.
    pub fn release(&mut self, slot: u32) {
        let voxels = self.take(slot);
        if matches!(voxels, Voxels::Narrow(_)) && self.spare.len() < SPARE {
            self.spare.reserve_exact(SPARE - self.spare.len());
            self.spare.push(voxels);
        }
        self.unused.push(slot);
    }

    /// Gives up what is kept to be used again.
    pub fn trim(&mut self) {
        self.spare = Vec::new();
    }

    /// The voxels of a slot.
    pub fn read(&self, slot: u32) -> Block<'_> {
        match self.voxels(slot) {
            Voxels::Narrow(values) => Block::Narrow(values),
            Voxels::Wide(values) => Block::Dense(values),
        }
    }

    /// Replaces the voxels of a slot.
    pub fn write(&mut self, slot: u32, values: &BlockData) {
        self.take(slot);
        self.put(slot, Voxels::new(values));
    }

    /// Adds to each slot, in parallel; `mixed` holds the increments that [`Source::Mixed`] names.
    pub fn add(
        &mut self,
        additions: &[Addition],
        mixed: &[BlockData],
        sign: i32,
        limits: Limits,
        committed: &mut Committed,
    ) {
        // Each slot's block is taken out of the pool, so that threads own the blocks they add to.
        let (mut taken, mut results) = (take(&mut self.taken), take(&mut self.results));
        taken.extend(additions.iter().map(|addition| (self.take(addition.slot), *addition)));
        taken
            .par_iter_mut()
            .with_min_len(16)
            .map(|(voxels, addition)| Instructions::widest().run(Add { voxels, addition, mixed, sign, limits }))
            .collect_into_vec(&mut results);
        for (addition, (voxels, _)) in additions.iter().zip(taken.drain(..)) {
            self.put(addition.slot, voxels);
        }
        committed.lost = results.iter().map(|added| added.lost).sum();
        committed.uniform.clear();
        let uniform = results.iter().enumerate().filter_map(|(n, added)| added.uniform.map(|value| (n, value)));
        committed.uniform.extend(uniform);
        (self.taken, self.results) = (taken, results);
    }

    fn voxels(&self, slot: u32) -> &Voxels {
        self.slots[slot as usize].as_ref().expect(IN_USE)
    }

    fn take(&mut self, slot: u32) -> Voxels {
        let voxels = self.slots[slot as usize].take().expect(IN_USE);
        *self.count(&voxels) -= 1;
        voxels
    }

    fn put(&mut self, slot: u32, voxels: Voxels) {
        *self.count(&voxels) += 1;
        self.slots[slot as usize] = Some(voxels);
    }

    fn count(&mut self, voxels: &Voxels) -> &mut usize {
        match voxels {
            Voxels::Narrow(_) => &mut self.num_narrow,
            Voxels::Wide(_) => &mut self.num_wide,
        }
    }
}

/// An addition to one block.
struct Add<'a> {
    voxels: &'a mut Voxels,
    addition: &'a Addition,
    mixed: &'a [BlockData],
    sign: i32,
    limits: Limits,
}

impl Kernel for Add<'_> {
    type Output = Added;

    #[inline(always)]
    fn run<S: Simd>(self) -> Added {
        let Self { voxels, addition, mixed, sign, limits } = self;
        if let Some(base) = addition.base {
            voxels.fill(base);
        }
        match addition.source {
            Source::Uniform(increment) => voxels.add(|_| increment * sign, limits),
            Source::Mixed(n) => {
                let increments = &mixed[n];
                voxels.add(|i| increments[i] * sign, limits)
            }
        }
    }
}

/// What an addition did to a block.
struct Added {
    /// Voxels that `i32` was too small for.
    lost: u64,
    /// The value of all voxels, if they have the same now.
    uniform: Option<i32>,
}

impl Voxels {
    fn new(values: &BlockData) -> Self {
        match narrowed(values) {
            Some(narrow) => Voxels::Narrow(Box::new(narrow)),
            None => Voxels::Wide(Box::new(*values)),
        }
    }

    /// Gives all voxels one value.
    fn fill(&mut self, value: i32) {
        match (&mut *self, i16::try_from(value)) {
            (Voxels::Narrow(values), Ok(value)) => values.fill(value),
            (Voxels::Wide(values), _) => values.fill(value),
            (voxels, Err(_)) => *voxels = Voxels::Wide(Box::new([value; BLOCK_VOXELS])),
        }
    }

    /// Adds to all voxels; a narrow block that is too small for the sums becomes wide.
    #[inline(always)]
    fn add(&mut self, increment: impl Fn(usize) -> i32, limits: Limits) -> Added {
        let mut lost = 0u32;
        let mut sum = |value: i32, i: usize| {
            let (sum, overflow) = limits.add(value, increment(i));
            lost += u32::from(overflow);
            sum
        };
        let uniform = match self {
            Voxels::Wide(values) => {
                values.iter_mut().enumerate().for_each(|(i, value)| *value = sum(*value, i));
                Block::Dense(values).uniform_value()
            }
            Voxels::Narrow(values) => {
                let mut sums = values.map(i32::from);
                sums.iter_mut().enumerate().for_each(|(i, value)| *value = sum(*value, i));
                match narrowed(&sums) {
                    Some(narrow) => **values = narrow,
                    None => *self = Voxels::Wide(Box::new(sums)),
                }
                Block::Dense(&sums).uniform_value()
            }
        };
        Added { lost: u64::from(lost), uniform }
    }
}

/// The values in 16 bits, if all fit.
#[inline(always)]
fn narrowed(values: &BlockData) -> Option<NarrowBlockData> {
    let misfits = values.iter().fold(0, |misfits, &value| misfits | (value ^ i32::from(value as i16)));
    (misfits == 0).then(|| values.map(|value| value as i16))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { low: i32::MIN, high: i32::MAX };

    fn add(pool: &mut Pool, slot: u32, base: Option<i32>, increments: &BlockData) -> Committed {
        let mut committed = Committed::default();
        let additions = [Addition { slot, base, source: Source::Mixed(0) }];
        pool.add(&additions, std::slice::from_ref(increments), 1, LIMITS, &mut committed);
        committed
    }

    #[test]
    fn blocks_widen_when_they_must_and_bytes_say_so() {
        let mut pool = Pool::default();
        let slot = pool.allocate();
        let narrow = pool.bytes();
        let ramp: BlockData = std::array::from_fn(|i| i as i32 * 60);
        assert!(add(&mut pool, slot, Some(5), &ramp).uniform.is_empty());
        assert!(matches!(pool.read(slot), Block::Narrow(_)));
        assert_eq!(pool.bytes(), narrow);

        let doubled = ramp.map(|value| 2 * value + 5);
        let growth = pool.growth_to(Some(slot), &doubled);
        add(&mut pool, slot, None, &ramp);
        assert!(matches!(pool.read(slot), Block::Dense(values) if *values == doubled));
        assert_eq!(pool.bytes(), narrow + growth);
        assert_eq!(growth, 1024);

        let back = add(&mut pool, slot, None, &doubled.map(|value| 7 - value));
        assert_eq!((back.lost, back.uniform), (0, vec![(0, 7)]));
        pool.release(slot);
        assert_eq!(pool.allocate(), slot);
        add(&mut pool, slot, Some(40_000), &ramp);
        assert_eq!(pool.read(slot).value(3), 40_180);
        assert!(matches!(pool.read(slot), Block::Dense(_)));
    }

    #[test]
    fn sums_beyond_32_bits_are_counted() {
        let mut pool = Pool::default();
        let slot = pool.allocate();
        let mut increments = [0; BLOCK_VOXELS];
        (increments[3], increments[4]) = (i32::MAX, i32::MIN + 1);
        assert_eq!(add(&mut pool, slot, Some(0), &increments).lost, 0);
        assert_eq!(add(&mut pool, slot, None, &increments).lost, 2);
        assert_eq!((pool.read(slot).value(3), pool.read(slot).value(4)), (i32::MAX, i32::MIN));
    }
}
