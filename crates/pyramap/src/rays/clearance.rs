//! How much room there is around each voxel: the largest cube around it in which nothing stops a ray.

use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, BlockKey};
use crate::mask::Mask;
use crate::state::Unknown;
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
/// As far as one looks: cubes reach into a block's neighbours, not beyond.
pub const FARTHEST: u8 = BLOCK_EDGE as u8;
/// A block and its neighbours, along an axis.
const SIDE: usize = 3 * BLOCK_EDGE;
/// A bit a voxel of those, by x and y; z is the place of the bit.
type Bits = [[u32; SIDE]; SIDE];

/// The clearance of a block; where there is no block, all voxels stop rays if unknown counts as occupied.
pub fn clearance(stops: &Window<Stops>, key: BlockKey, unknown: Unknown) -> Clearance {
    let absent = if unknown == Unknown::Occupied { Mask::ALL } else { Mask::NONE };
    let absent = Stops { all: absent, occupied: Mask::NONE };
    let find = |key| stops.get(key).copied().unwrap_or(absent);
    let mut near: Bits = [[0; SIDE]; SIDE];
    let mut any = false;
    for n in 0..27 {
        let away = [n / 9, n / 3 % 3, n % 3];
        let mask = find(std::array::from_fn(|a| key[a] + away[a] as i32 - 1)).all;
        any |= !mask.is_empty();
        for (x, word) in mask.words().iter().enumerate() {
            for (y, byte) in word.to_le_bytes().into_iter().enumerate() {
                near[away[0] * BLOCK_EDGE + x][away[1] * BLOCK_EDGE + y] |= u32::from(byte) << (away[2] * BLOCK_EDGE);
            }
        }
    }
    if !any {
        return [FARTHEST; BLOCK_VOXELS];
    }
    // Each time around one more layer of voxels is near; what is not yet so is farther by one.
    let mut rows = [0_u64; BLOCK_VOXELS / BLOCK_EDGE];
    for _ in 0..FARTHEST {
        for (n, row) in rows.iter_mut().enumerate() {
            let bits = near[BLOCK_EDGE + n / BLOCK_EDGE][BLOCK_EDGE + n % BLOCK_EDGE] >> BLOCK_EDGE;
            *row += a_byte_each(!bits as u8);
        }
        near = grown(&near);
    }
    let distances = rows.map(u64::to_le_bytes);
    let mut clearance: Clearance = std::array::from_fn(|offset| distances[offset / BLOCK_EDGE][offset % BLOCK_EDGE]);
    let Stops { all, occupied } = find(key);
    (all & !occupied).offsets().for_each(|offset| clearance[offset] = UNKNOWN);
    clearance
}

/// All voxels that touch one of these, by a face, an edge or a corner, as far as there is room.
fn grown(near: &Bits) -> Bits {
    let mut along_z = *near;
    along_z.iter_mut().flatten().for_each(|row| *row |= *row << 1 | *row >> 1);
    let mut along_y = along_z;
    for (out, rows) in along_y.iter_mut().zip(&along_z) {
        for y in 1..SIDE - 1 {
            out[y] = rows[y - 1] | rows[y] | rows[y + 1];
        }
    }
    let mut along_x = along_y;
    for x in 1..SIDE - 1 {
        for y in 0..SIDE {
            along_x[x][y] = along_y[x - 1][y] | along_y[x][y] | along_y[x + 1][y];
        }
    }
    along_x
}

/// The eight bits of a byte as eight bytes of 0 or 1, the lowest first.
fn a_byte_each(bits: u8) -> u64 {
    const ONES: u64 = u64::from_le_bytes([1; 8]);
    // In byte n only bit n is kept; what is then not 0 carries into the highest bit.
    let kept = (u64::from(bits) * ONES) & u64::from_le_bytes([1, 2, 4, 8, 16, 32, 64, 128]);
    ((kept + 0x7f * ONES) >> 7) & ONES
}
