//! Something of each block, laid out in space, for many questions at a time: finding it is an index, not a hash.

use crate::block::{BLOCK_EDGE, Block, BlockKey, Blocks, VoxelIndex};
use crate::ray::{each, least, most, to_i32};
use rayon::prelude::*;

/// The box of all blocks of a map, one place a block, and a layer of places around it. Whatever is farther away is looked
/// up in that layer: so there is an answer for every voxel, and it takes no branch.
pub struct Window<T> {
    /// The lowest key, in the layer around the box.
    low: BlockKey,
    size: [usize; 3],
    /// Which item there is.
    places: Vec<u32>,
    keys: Vec<BlockKey>,
    /// What there is where the map holds nothing, and then an item a key.
    items: Vec<T>,
}

/// What there is where the map holds nothing: in the box of all blocks, and around it.
pub type Nothing<T> = [T; 2];

/// Which items these are, and the first that is a block's.
const ABSENT: u32 = 0;
const AROUND: u32 = 1;
const FIRST: u32 = 2;

/// Up to so many places for each block that the map holds, and 2^31 at all: beyond, the map is too scattered for a window.
const PLACES_PER_BLOCK: usize = 256;

impl<T: Send + Sync> Window<T> {
    /// What `item` makes of each block of a map; `None` if the map is empty or too scattered.
    pub fn new<'a>(
        blocks: &'a (impl Blocks + ?Sized),
        nothing: Nothing<T>,
        item: impl Fn(Block<'a>) -> T + Sync,
    ) -> Option<Self> {
        let keys = blocks.keys();
        let [low, high] = bounds(&keys)?;
        let size: [usize; 3] = std::array::from_fn(|a| (high[a] - low[a]) as usize + 1);
        let places = size.into_iter().try_fold(1, usize::checked_mul)?;
        if places > (PLACES_PER_BLOCK * keys.len()).min(i32::MAX as usize) {
            return None;
        }
        let window = Self::empty(each(|a| low[a] - 1), size.map(|n| n + 2));
        Some(window.fill(keys, nothing, |key| item(blocks.block(key).unwrap_or(Block::Uniform(0)))))
    }

    /// A window with other items, each made of a block's key and what there is now.
    pub fn map<U: Send + Sync>(&self, nothing: Nothing<U>, item: impl Fn(&Self, BlockKey) -> U + Sync) -> Window<U> {
        Window::empty(self.low, self.size).fill(self.keys.iter().copied(), nothing, |key| item(self, key))
    }

    /// The same, with items too for all that touch a block by a face, an edge or a corner.
    pub fn map_around<U: Send + Sync>(
        &self,
        nothing: Nothing<U>,
        item: impl Fn(&Self, BlockKey) -> U + Sync,
    ) -> Window<U> {
        let around = |&[x, y, z]: &BlockKey| (0..27).map(move |n| [x + n / 9 - 1, y + n / 3 % 3 - 1, z + n % 3 - 1]);
        let wider = Window::empty(each(|a| self.low[a] - 1), self.size.map(|n| n + 2));
        wider.fill(self.keys.iter().flat_map(around), nothing, |key| item(self, key))
    }

    fn empty(low: BlockKey, size: [usize; 3]) -> Self {
        let mut places = vec![AROUND; size.iter().product()];
        for x in 1..size[0] - 1 {
            for y in 1..size[1] - 1 {
                let row = (x * size[1] + y) * size[2];
                places[row + 1..row + size[2] - 1].fill(ABSENT);
            }
        }
        Self { low, size, places, keys: Vec::new(), items: Vec::new() }
    }

    /// Puts items into an empty window, one a key, however often that comes.
    fn fill(
        mut self,
        keys: impl IntoIterator<Item = BlockKey>,
        nothing: Nothing<T>,
        item: impl Fn(BlockKey) -> T + Sync,
    ) -> Self {
        for key in keys {
            let place = self.place(key);
            if self.places[place] == ABSENT {
                self.places[place] = FIRST + self.keys.len() as u32;
                self.keys.push(key);
            }
        }
        self.items = nothing.into();
        self.items.par_extend(self.keys.par_iter().with_min_len(16).map(|&key| item(key)));
        self
    }

    /// The first and the last voxel of the box.
    pub fn voxels(&self) -> [VoxelIndex; 2] {
        let edge = BLOCK_EDGE as i32;
        [each(|a| (self.low[a] + 1) * edge), each(|a| (self.low[a] + self.size[a] as i32 - 1) * edge - 1)]
    }

    /// What there is for a block.
    #[inline(always)]
    pub fn get(&self, key: BlockKey) -> &T {
        &self.items[self.places[self.place(key)] as usize]
    }

    #[inline(always)]
    fn place(&self, key: BlockKey) -> usize {
        let at = each(|a| (i64::from(key[a]) - i64::from(self.low[a])).clamp(0, self.size[a] as i64 - 1) as usize);
        (at[0] * self.size[1] + at[1]) * self.size[2] + at[2]
    }

    /// How to find voxels.
    pub fn layout(&self) -> Layout {
        let edge = BLOCK_EDGE as f64;
        Layout {
            low: each(|a| f64::from(self.low[a]) * edge),
            last: each(|a| self.size[a] as f64 * edge - 1.0),
            size: each(|a| self.size[a] as u32),
        }
    }

    /// What there is in the place of a block.
    #[inline(always)]
    pub fn at(&self, place: u32) -> &T {
        &self.items[self.places[place as usize] as usize]
    }
}

/// Where the voxels of a window are. For many of them each of its functions is called in a loop of its own, which then
/// becomes one of vectors.
#[derive(Clone, Copy)]
pub struct Layout {
    /// The first voxel.
    low: [f64; 3],
    /// From there to the last.
    last: [f64; 3],
    /// In blocks.
    size: [u32; 3],
}

const EDGE: u32 = BLOCK_EDGE as u32;

impl Layout {
    /// How many voxels it is along an axis from the first to one that is given by a whole number, or to the end that is
    /// nearer to it. What is not a number is somewhere.
    #[inline(always)]
    pub fn along(&self, axis: usize, voxel: f64) -> u32 {
        to_i32(least(most(voxel - self.low[axis], 0.0), self.last[axis])) as u32
    }

    /// The place of a voxel's block.
    #[inline(always)]
    pub fn place(&self, along: [u32; 3]) -> u32 {
        let [x, y, z] = each(|a| along[a] / EDGE);
        (x * self.size[1] + y) * self.size[2] + z
    }

    /// The offset of a voxel within its block.
    #[inline(always)]
    pub fn offset(along: [u32; 3]) -> u32 {
        let [x, y, z] = each(|a| along[a] % EDGE);
        (x * EDGE + y) * EDGE + z
    }
}

/// A window for so many questions about voxels, if they pay for it.
pub fn window_for<'a, T: Copy + Send + Sync>(
    blocks: &'a (impl Blocks + ?Sized),
    questions: usize,
    nothing: T,
    item: impl Fn(Block<'a>) -> T + Sync,
) -> Option<Window<T>> {
    /// So many pay for one block.
    const QUESTIONS_PER_BLOCK: usize = 4;
    (questions / QUESTIONS_PER_BLOCK >= blocks.count()).then(|| Window::new(blocks, [nothing; 2], item))?
}

/// The quickest way to the blocks of a map for so many questions.
pub enum Lookup<'a, B: ?Sized> {
    /// Few questions, or a scattered map.
    Map(&'a B),
    /// Many questions.
    Window(&'a B, Window<Option<Block<'a>>>),
}

impl<'a, B: Blocks + ?Sized> Lookup<'a, B> {
    pub fn new(blocks: &'a B, questions: usize) -> Self {
        match window_for(blocks, questions, None, Some) {
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

    fn count(&self) -> usize {
        self.map().count()
    }

    #[inline(always)]
    fn block(&self, key: BlockKey) -> Option<Block<'_>> {
        match self {
            Self::Map(map) => map.block(key),
            Self::Window(_, window) => *window.get(key),
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
