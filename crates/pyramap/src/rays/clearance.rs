//! How much room there is around each voxel: the largest cube around it in which nothing stops a ray.

use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, BlockKey};
use crate::mask::Mask;
use crate::simd::{Instructions, Kernel, Simd};
use crate::window::Window;

/// What stops rays in a block.
#[derive(Clone, Copy)]
pub struct Stops {
    /// The voxels that do.
    pub all: Mask,
    /// Those among them that are occupied.
    pub occupied: Mask,
}

/// For each voxel of a block how many voxels it is from the nearest one that stops rays, along the axis where that is
/// most, but at most [`FARTHEST`]: so the cube of `2 n - 1` voxels around it is free. [`OCCUPIED`] or [`UNKNOWN`] if it
/// stops rays itself.
pub type Clearance = [u8; BLOCK_VOXELS];

/// In place of a distance.
pub const OCCUPIED: u8 = 0;
/// The same.
pub const UNKNOWN: u8 = u8::MAX;
/// In place of a distance where rays have left the map, and nothing will stop them. All numbers from here on end rays.
pub const AROUND: u8 = UNKNOWN - 1;
/// As far as one looks: cubes reach into a block's neighbours, not beyond.
pub const FARTHEST: u8 = BLOCK_EDGE as u8;
/// A block and its neighbours, along an axis.
const SIDE: usize = 3 * BLOCK_EDGE;
/// A bit a voxel of those, by x and y; z is the place of the bit.
type Bits = [[u32; SIDE]; SIDE];

/// The clearance of a block.
pub fn clearance(stops: &Window<Stops>, key: BlockKey, instructions: Instructions) -> Clearance {
    instructions.run(Find { stops, key })
}

struct Find<'a> {
    stops: &'a Window<Stops>,
    key: BlockKey,
}

impl Kernel for Find<'_> {
    type Output = Clearance;

    #[inline(always)]
    fn run<S: Simd>(self) -> Clearance {
        clearance_of(self.stops, self.key)
    }
}

#[inline(always)]
fn clearance_of(stops: &Window<Stops>, key: BlockKey) -> Clearance {
    let find = |key| *stops.get(key);
    let around: [Mask; 27] = std::array::from_fn(|n| {
        let [x, y, z] = away(n);
        find([key[0] + x as i32 - 1, key[1] + y as i32 - 1, key[2] + z as i32 - 1]).all
    });
    if around.iter().all(|mask| mask.is_empty()) {
        return [FARTHEST; BLOCK_VOXELS];
    }
    let mut near = joined(&around);
    // Each time around one more layer of voxels is near; what is not yet so is farther by one.
    let mut distances = [0_u64; BLOCK_VOXELS / BLOCK_EDGE];
    for layer in 1..=usize::from(FARTHEST) {
        for (n, distances) in distances.iter_mut().enumerate() {
            let row = near[BLOCK_EDGE + n / BLOCK_EDGE][BLOCK_EDGE + n % BLOCK_EDGE] >> BLOCK_EDGE;
            *distances += a_byte_each(!row as u8);
        }
        near = grown(&near, layer);
    }
    let distances = distances.map(u64::to_le_bytes);
    let mut clearance: Clearance = std::array::from_fn(|offset| distances[offset / BLOCK_EDGE][offset % BLOCK_EDGE]);
    let Stops { all, occupied } = find(key);
    (all & !occupied).offsets().for_each(|offset| clearance[offset] = UNKNOWN);
    clearance
}

/// Where the `n`-th of a block and its neighbours lies among them.
fn away(n: usize) -> [usize; 3] {
    [n / 9, n / 3 % 3, n % 3]
}

/// A block and its neighbours in one.
#[inline(always)]
fn joined(around: &[Mask; 27]) -> Bits {
    let mut bits = [[0; SIDE]; SIDE];
    for (n, mask) in around.iter().enumerate() {
        let first = away(n).map(|n| n * BLOCK_EDGE);
        for (x, word) in mask.words().iter().enumerate() {
            for (y, byte) in word.to_le_bytes().into_iter().enumerate() {
                bits[first[0] + x][first[1] + y] |= u32::from(byte) << first[2];
            }
        }
    }
    bits
}

/// All voxels that touch one of these, by a face, an edge or a corner, but for the outermost `layers` of them.
#[inline(always)]
fn grown(near: &Bits, layers: usize) -> Bits {
    let mut grown = [[0; SIDE]; SIDE];
    for x in layers..SIDE - layers {
        let mut rows = [0; SIDE];
        for y in 0..SIDE {
            let along_x = near[x - 1][y] | near[x][y] | near[x + 1][y];
            rows[y] = along_x | along_x << 1 | along_x >> 1;
        }
        for y in 1..SIDE - 1 {
            grown[x][y] = rows[y - 1] | rows[y] | rows[y + 1];
        }
    }
    grown
}

/// The eight bits of a byte as eight bytes of 0 or 1, the lowest first.
fn a_byte_each(bits: u8) -> u64 {
    const ONES: u64 = u64::from_le_bytes([1; 8]);
    // In byte n only bit n is kept; what is then not 0 carries into the highest bit.
    let kept = (u64::from(bits) * ONES) & u64::from_le_bytes([1, 2, 4, 8, 16, 32, 64, 128]);
    ((kept + 0x7f * ONES) >> 7) & ONES
}
