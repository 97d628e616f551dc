//! The host's copies of blocks on a device. What was read stays here until the device changes it, and what is written
//! waits here until the device needs it, so that each block crosses only when it must.

use crate::gpu::Gpu;
use crate::pool::Pool;
use pyramap::block::BlockData;
use pyramap::error::{DeviceFault, Error, Result};
use std::mem::take;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Blocks that wait to be sent at most: 8 MiB.
const MOST_UNSENT: usize = 4096;

/// Copies, by slot. While nothing changes they are shown, and can be read without a lock; to change them they are taken
/// back.
#[derive(Default)]
pub struct Mirror {
    shown: OnceLock<Copies>,
    behind: Mutex<Copies>,
    num_fetched: AtomicU64,
}

/// Where the true voxels of a slot are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Truth {
    /// The slot is not in use.
    #[default]
    Nowhere,
    Device,
    Both,
    Host,
}

#[derive(Default)]
struct Copies {
    slots: Vec<(Truth, Option<Box<BlockData>>)>,
    num_unsent: usize,
    num_stale: usize,
}

impl Mirror {
    /// Takes note that the device changes a slot.
    pub fn outdate(&mut self, slot: u32) {
        self.copies().set(slot, Truth::Device);
    }

    /// Takes note that a slot is given back.
    pub fn release(&mut self, slot: u32) {
        let copies = self.copies();
        copies.set(slot, Truth::Nowhere);
        copies.slots[slot as usize].1 = None;
    }

    /// Replaces the voxels of a slot, here. True when so many wait that they should be sent.
    pub fn write(&mut self, slot: u32, values: &BlockData) -> bool {
        let copies = self.copies();
        copies.set(slot, Truth::Host);
        copies.slots[slot as usize].1.get_or_insert_with(|| Box::new(*values)).copy_from_slice(values);
        copies.num_unsent >= MOST_UNSENT
    }

    /// Sends what was written. What could not be sent stays for the next time.
    ///
    /// # Errors
    /// As [`Pool::scatter`].
    pub fn send(&mut self, gpu: &Gpu, pool: &Pool) -> Result<()> {
        let copies = self.copies();
        if copies.num_unsent == 0 {
            return Ok(());
        }
        let slots = copies.slots_at(Truth::Host);
        pool.scatter(gpu, &slots, |slot| copies.slots[slot as usize].1.as_deref().expect("it was written"))?;
        slots.iter().for_each(|&slot| copies.set(slot, Truth::Both));
        Ok(())
    }

    /// Brings all copies up to date.
    ///
    /// # Errors
    /// As [`Pool::gather`].
    pub fn fetch(&self, gpu: &Gpu, pool: &Pool) -> Result<()> {
        if self.shown.get().is_none() {
            let mut behind = self.behind.lock().unwrap_or_else(PoisonError::into_inner);
            // Another thread may have been faster.
            if self.shown.get().is_none() {
                let fetched = behind.fetch(gpu, pool, &self.num_fetched);
                if let Err(Error::Device { fault: DeviceFault::OutOfMemory | DeviceFault::Internal, .. }) = fetched {
                    return fetched;
                }
                // Of a device that is gone, what was read before is all there will ever be.
                assert!(self.shown.set(take(&mut *behind)).is_ok(), "only this thread has the lock");
            }
        }
        let copies = self.shown.get().expect("copies are shown by now");
        if copies.num_stale > 0 { gpu.check() } else { Ok(()) }
    }

    /// The voxels of a slot, if they are here.
    pub fn read(&self, slot: u32) -> Option<&BlockData> {
        match self.shown.get()?.slots.get(slot as usize)? {
            (Truth::Both | Truth::Host, block) => block.as_deref(),
            _ => None,
        }
    }

    /// Blocks that were brought to the host since the map was made.
    pub fn num_fetched(&self) -> u64 {
        self.num_fetched.load(Ordering::Relaxed)
    }

    fn copies(&mut self) -> &mut Copies {
        let behind = self.behind.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(copies) = self.shown.take() {
            *behind = copies;
        }
        behind
    }
}

impl Copies {
    fn set(&mut self, slot: u32, truth: Truth) {
        let slot = slot as usize;
        if slot >= self.slots.len() {
            self.slots.resize_with(slot + 1, Default::default);
        }
        let before = std::mem::replace(&mut self.slots[slot].0, truth);
        let count = |counter: &mut usize, kind| {
            *counter += usize::from(truth == kind);
            *counter -= usize::from(before == kind);
        };
        count(&mut self.num_unsent, Truth::Host);
        count(&mut self.num_stale, Truth::Device);
    }

    fn slots_at(&self, truth: Truth) -> Vec<u32> {
        (0..).zip(&self.slots).filter(|(_, slot)| slot.0 == truth).map(|(slot, _)| slot).collect()
    }

    fn fetch(&mut self, gpu: &Gpu, pool: &Pool, num_fetched: &AtomicU64) -> Result<()> {
        if self.num_stale == 0 {
            return Ok(());
        }
        let slots = self.slots_at(Truth::Device);
        pool.gather(gpu, &slots, |slot, values| {
            self.slots[slot as usize].1 = Some(Box::new(values));
            self.set(slot, Truth::Both);
            num_fetched.fetch_add(1, Ordering::Relaxed);
        })
    }
}
