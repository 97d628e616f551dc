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
    keys: Vec<BlockKey>,
    items: Vec<T>,
}

/// Up to so many places for each block that the map holds: beyond, the map is too scattered for a window.
const PLACES_PER_BLOCK: usize = 256;

impl<T: Send + Sync> Window<T> {
    /// What `item` makes of each block of a map; `None` if the map has more than `most` blocks, or is too scattered.
    pub fn new<'a>(
        blocks: &'a (impl Blocks + ?Sized),
        most: usize,
        item: impl Fn(Block<'a>) -> T + Sync,
    ) -> Option<Self> {
        // Not to list all blocks for a few questions.
        if most == 0 {
            return None;
        }
        let keys = blocks.keys();
        let [low, high] = bounds(&keys)?;
        let size: [usize; 3] = std::array::from_fn(|a| (high[a] - low[a]) as usize + 1);
        let places = size.into_iter().try_fold(1, usize::checked_mul)?;
        if keys.len() > most || places > PLACES_PER_BLOCK * keys.len() {
            return None;
        }
        let read = |&key: &BlockKey| item(blocks.block(key).unwrap_or(Block::Uniform(0)));
        let items = keys.par_iter().with_min_len(64).map(read).collect();
        let mut window = Self { low, size, places: vec![0; places], keys, items };
        for n in 0..window.keys.len() {
            let place = window.place(window.keys[n]).expect("the window holds all keys");
            window.places[place] = n as u32 + 1;
        }
        Some(window)
    }

    /// The same window with other items, each made of a block's key and what there is now.
    pub fn map<U: Send + Sync>(self, item: impl Fn(&Self, BlockKey) -> U + Sync) -> Window<U> {
        let items = self.keys.par_iter().with_min_len(16).map(|&key| item(&self, key)).collect();
        Window { low: self.low, size: self.size, places: self.places, keys: self.keys, items }
    }

    /// The same, with items too for all that touch a block by a face, an edge or a corner.
    pub fn map_around<U: Send + Sync>(self, item: impl Fn(&Self, BlockKey) -> U + Sync) -> Window<U> {
        let (low, size) = (self.low.map(|k| k - 1), self.size.map(|n| n + 2));
        let mut around =
            Window { low, size, places: vec![0; size.iter().product()], keys: Vec::new(), items: Vec::new() };
        for &key in &self.keys {
            for n in 0..27 {
                let key = [key[0] + n / 9 - 1, key[1] + n / 3 % 3 - 1, key[2] + n % 3 - 1];
                let place = around.place(key).expect("the window was widened");
                if around.places[place] == 0 {
                    around.keys.push(key);
                    around.places[place] = around.keys.len() as u32;
                }
            }
        }
        around.items = around.keys.par_iter().with_min_len(16).map(|&key| item(&self, key)).collect();
        around
    }

    /// The lowest and the highest key.
    pub fn bounds(&self) -> [BlockKey; 2] {
        [self.low, each(|a| self.low[a] + self.size[a] as i32 - 1)]
    }

    /// What there is for a block; `None` where the map holds none.
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
        /// So many questions pay for one block.
        const QUESTIONS_PER_BLOCK: usize = 4;
        match Window::new(blocks, questions / QUESTIONS_PER_BLOCK, |block| block) {
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
