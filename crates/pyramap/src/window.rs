//! Something of each block, laid out in space, for many questions at a time: finding it is an index, not a hash.

use crate::block::{Block, BlockKey, Blocks};
use crate::ray::each;
use rayon::prelude::*;

/// The box of all blocks of a map, one place a block.
pub struct Window<T> {
    low: BlockKey,
    size: [usize; 3],
    /// One more than where in `items` it is, or 0.
    places: Vec<u32>,
    items: Vec<T>,
}

/// Up to so many places for each block that the map holds: beyond, the map is too scattered for a window.
const PLACES_PER_BLOCK: usize = 256;
/// So many questions pay for one block.
const QUESTIONS_PER_BLOCK: usize = 4;

impl<T: Send> Window<T> {
    /// What `item` makes of each block of a map; `None` if that is not worth while for so many questions.
    pub fn new<'a>(
        blocks: &'a (impl Blocks + ?Sized),
        questions: usize,
        item: impl Fn(Block<'a>) -> T + Sync,
    ) -> Option<Self> {
        // Not to list all blocks for a few questions.
        if questions < QUESTIONS_PER_BLOCK {
            return None;
        }
        let keys = blocks.keys();
        let [low, high] = bounds(&keys)?;
        let size: [usize; 3] = std::array::from_fn(|a| (high[a] - low[a]) as usize + 1);
        let places = size.into_iter().try_fold(1, usize::checked_mul)?;
        if QUESTIONS_PER_BLOCK * keys.len() > questions || places > PLACES_PER_BLOCK * keys.len() {
            return None;
        }
        let read = |&key: &BlockKey| item(blocks.block(key).unwrap_or(Block::Uniform(0)));
        let mut window = Self {
            low,
            size,
            places: vec![0; places],
            items: keys.par_iter().with_min_len(64).map(read).collect(),
        };
        for (n, &key) in (1..).zip(&keys) {
            let place = window.place(key).expect("the window holds all keys");
            window.places[place] = n;
        }
        Some(window)
    }
}

impl<T> Window<T> {
    /// What was made of a block; `None` where the map holds none.
    #[inline(always)]
    pub fn get(&self, key: BlockKey) -> Option<&T> {
        // 0 wraps around to what is beyond all items.
        self.items.get((self.places[self.place(key)?] as usize).wrapping_sub(1))
    }

    #[inline(always)]
    fn place(&self, key: BlockKey) -> Option<usize> {
        // What lies below wraps around to what lies far above.
        let at = each(|a| key[a].wrapping_sub(self.low[a]) as u32 as usize);
        let [x, y, z] = self.size;
        (at[0] < x && at[1] < y && at[2] < z).then(|| (at[0] * y + at[1]) * z + at[2])
    }
}

/// The quickest way to the blocks of a map for so many questions.
pub enum Lookup<'a, B: ?Sized> {
    /// Few questions, or a scattered map.
    Map(&'a B),
    /// Many questions.
    Window(&'a B, Window<Block<'a>>),
}

impl<'a, B: Blocks + ?Sized> Lookup<'a, B> {
    pub fn new(blocks: &'a B, questions: usize) -> Self {
        match Window::new(blocks, questions, |block| block) {
            None => Self::Map(blocks),
            Some(window) => Self::Window(blocks, window),
        }
    }

    fn map(&self) -> &'a B {
        match self {
            Self::Map(map) | Self::Window(map, _) => map,
        }
    }
}

impl<B: Blocks + ?Sized> Blocks for Lookup<'_, B> {
    fn keys(&self) -> Vec<BlockKey> {
        self.map().keys()
    }

    #[inline(always)]
    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        match self {
            Self::Map(map) => map.block(key),
            Self::Window(_, window) => window.get(key).copied(),
        }
    }

    fn voxel_size(&self) -> f64 {
        self.map().voxel_size()
    }

    fn prior_log_odds(&self) -> f64 {
        self.map().prior_log_odds()
    }
}

/// The lowest and highest coordinates of blocks; `None` if there are none.
pub fn bounds(keys: &[BlockKey]) -> Option<[BlockKey; 2]> {
    let first = *keys.first()?;
    Some(keys.iter().fold([first, first], |[low, high], key| {
        [std::array::from_fn(|a| low[a].min(key[a])), std::array::from_fn(|a| high[a].max(key[a]))]
    }))
}
