//! Which blocks of a distance field hold distances: those within reach of a border between its two sides.
//!
//! The outside is whatever unknown space counts as, and goes on for ever; the inside is the rest. A border passes
//! through every block with voxels of both sides, and between two blocks of one side each. A tile is kept wherever one
//! of these *seeds* is near, and counts them, so that it goes when the last of them has gone.

use super::reach::Reach;
use super::tile::Tile;
use crate::block::BlockKey;
use crate::mask::Mask;
use hashbrown::HashMap;

/// A place in the list of tiles.
pub type Slot = u32;

/// A block with voxels that changed sides.
pub struct Change {
    /// Which block.
    pub key: BlockKey,
    /// What was inside.
    pub old: Mask,
    /// What is inside now.
    pub new: Mask,
}

impl Change {
    /// How many voxels.
    pub fn count(&self) -> usize {
        (self.old ^ self.new).count() as usize
    }
}

/// All tiles, and what is known of the blocks.
pub struct Tiles {
    cells: HashMap<BlockKey, Cell>,
    #[expect(clippy::vec_box, reason = "a large field grows without being moved")]
    tiles: Vec<Box<Tile>>,
    ball: Vec<BlockKey>,
    beyond: u16,
}

/// What is known of a block that is not outside throughout, or is near to a seed.
#[derive(Clone, Copy, Default)]
struct Cell {
    fill: Fill,
    is_seed: bool,
    seeds_near: u32,
    slot: Option<Slot>,
}

/// How much of a block is inside.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Fill {
    #[default]
    Empty,
    Mixed,
    All,
}

impl Fill {
    fn of(mask: &Mask) -> Self {
        match *mask {
            Mask::NONE => Fill::Empty,
            Mask::ALL => Fill::All,
            _ => Fill::Mixed,
        }
    }

    /// Of a block that lies on one side; a mixed one has a tile, which knows.
    fn mask(self) -> Mask {
        if self == Fill::All { Mask::ALL } else { Mask::NONE }
    }
}

const FACES: [BlockKey; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

impl Tiles {
    /// Everything is outside.
    pub fn new(reach: Reach) -> Self {
        Self { cells: HashMap::new(), tiles: Vec::new(), ball: reach.ball(), beyond: reach.beyond() }
    }

    /// What of a block is inside.
    pub fn inside(&self, key: BlockKey) -> Mask {
        self.cells.get(&key).map_or(Mask::NONE, |cell| self.mask_of(cell))
    }

    fn mask_of(&self, cell: &Cell) -> Mask {
        cell.slot.map_or_else(|| cell.fill.mask(), |slot| self.tile(slot).inside)
    }

    /// Blocks that have something inside.
    pub fn filled(&self) -> impl Iterator<Item = BlockKey> {
        self.cells.iter().filter(|(_, cell)| cell.fill != Fill::Empty).map(|(&key, _)| key)
    }

    /// The tile of a block, or which side all of it is on.
    pub fn get(&self, key: BlockKey) -> Result<&Tile, bool> {
        match self.cells.get(&key) {
            None => Err(false),
            Some(Cell { slot: Some(slot), .. }) => Ok(self.tile(*slot)),
            Some(cell) => Err(cell.fill == Fill::All),
        }
    }

    /// The tile in a slot.
    pub fn tile(&self, slot: Slot) -> &Tile {
        &self.tiles[slot as usize]
    }

    /// How many tiles there are.
    pub fn len(&self) -> usize {
        self.tiles.len()
    }

    /// Bytes taken by tiles and table.
    pub fn nbytes(&self) -> usize {
        self.tiles.len() * size_of::<Tile>()
            + self.tiles.capacity() * size_of::<Box<Tile>>()
            + self.cells.allocation_size()
    }

    /// Changes sides of voxels and makes tiles where they are needed now; gives the tiles with changes, which are then to
    /// be swept along each axis, and the blocks whose tiles may be dropped after that.
    pub fn apply(&mut self, changes: &[Change]) -> (Vec<Slot>, Vec<BlockKey>) {
        let (mut in_doubt, mut left) = (Vec::new(), Vec::new());
        for change in changes {
            let fill = Fill::of(&change.new);
            let cell = self.cells.entry(change.key).or_default();
            if cell.fill != fill {
                cell.fill = fill;
                in_doubt.push(change.key);
                in_doubt.extend(FACES.map(|face| add(change.key, face)));
            }
            if fill == Fill::Empty {
                left.push(change.key);
            }
        }
        in_doubt.sort_unstable();
        in_doubt.dedup();
        for key in in_doubt {
            self.judge(key, &mut left);
        }
        let mut touched = Vec::with_capacity(changes.len());
        for Change { key, old, new } in changes {
            // Without a tile it is far from any border, now as before: nothing depends on it.
            if let Some(slot) = self.cells[key].slot {
                let tile = &mut self.tiles[slot as usize];
                tile.inside = *new;
                tile.flips = *old ^ *new;
                touched.push(slot);
            }
        }
        (touched, left)
    }

    /// Finds out whether a block is a seed, and tells all blocks near it if that has changed.
    fn judge(&mut self, key: BlockKey, left: &mut Vec<BlockKey>) {
        let fill = |key| self.cells.get(&key).map_or(Fill::Empty, |cell| cell.fill);
        let is_seed = match fill(key) {
            Fill::Mixed => true,
            // Of two blocks that lie on one side each, one is enough: they are within reach of the same voxels but for
            // those that a border beside them sees to.
            Fill::All => FACES.iter().any(|&face| fill(add(key, face)) == Fill::Empty),
            Fill::Empty => false,
        };
        match self.cells.get_mut(&key) {
            Some(cell) if cell.is_seed != is_seed => cell.is_seed = is_seed,
            _ => return,
        }
        for &offset in &self.ball {
            let near = add(key, offset);
            let cell = self.cells.entry(near).or_default();
            if is_seed {
                cell.seeds_near += 1;
                if cell.slot.is_none() {
                    cell.slot = Some(self.tiles.len() as Slot);
                    self.tiles.push(Box::new(Tile::new(near, cell.fill.mask(), self.beyond)));
                }
            } else {
                cell.seeds_near -= 1;
                if cell.seeds_near == 0 {
                    left.push(near);
                }
            }
        }
    }

    /// Ends an update: what was noted for the passes is forgotten, and tiles that no seed is near any more are dropped.
    pub fn settle(&mut self, changed: &[Slot], left: &[BlockKey]) {
        for &slot in changed {
            self.tiles[slot as usize].flips = Mask::NONE;
        }
        for key in left {
            let Some(cell) = self.cells.get_mut(key) else { continue };
            if cell.seeds_near > 0 {
                continue;
            }
            let slot = cell.slot.take();
            if cell.fill == Fill::Empty {
                self.cells.remove(key);
            }
            let Some(slot) = slot else { continue };
            self.tiles.swap_remove(slot as usize);
            if let Some(moved) = self.tiles.get(slot as usize) {
                self.cells.get_mut(&moved.key).expect("every tile has a cell").slot = Some(slot);
            }
        }
    }

    /// The tiles up to `blocks` away, along an axis, from given ones, and these, in the order of their slots.
    pub fn beside<const AXIS: usize>(&self, slots: &[Slot], blocks: i32) -> Vec<Slot> {
        let mut beside: Vec<Slot> = Vec::with_capacity(slots.len());
        for &slot in slots {
            let mut key = self.tile(slot).key;
            let middle = key[AXIS];
            beside.extend((-blocks..=blocks).filter_map(|distance| {
                key[AXIS] = middle + distance;
                self.cells.get(&key)?.slot
            }));
        }
        beside.sort_unstable();
        beside.dedup();
        beside
    }

    /// The tiles in slots given in their order.
    pub fn pick(&mut self, slots: &[Slot]) -> Vec<&mut Tile> {
        let (mut rest, mut passed) = (&mut self.tiles[..], 0);
        let take = |&slot: &Slot| {
            let (_, from) = std::mem::take(&mut rest).split_at_mut(slot as usize - passed);
            let (tile, after) = from.split_first_mut().expect("the slot is in use");
            (rest, passed) = (after, slot as usize + 1);
            &mut **tile
        };
        slots.iter().map(take).collect()
    }
}

fn add(key: BlockKey, offset: BlockKey) -> BlockKey {
    std::array::from_fn(|a| key[a] + offset[a])
}
