//! Many rays at once: all of a chunk go on to their next cubes together, in vector instructions.

use super::clearance::{AROUND, Clearance, OCCUPIED};
use super::{CHUNK, Chunk, NO_VOXEL, Space};
use crate::ray::{DOUBT, Directions, ONES, Place, Ray, each, lanes, least, most, to_i32, whole};
use crate::simd::{Kernel, Simd};
use crate::state::{State, Unknown};
use crate::window::{Layout, Window};

/// How many numbers the widest vectors hold.
const LANES: usize = 8;
/// A number a ray.
type Each = [f64; CHUNK];

/// The rays of a chunk that are under way, the first `count`: where one ends, the last takes its place. By axis, then by
/// ray; in voxels.
pub struct Lanes {
    count: usize,
    /// Which ray of the chunk.
    row: [u16; CHUNK],
    origin: [Each; 3],
    direction: [Each; 3],
    inverse: [Each; 3],
    /// 1 on axes along which coordinates rise or stay, -1 where they fall.
    sign: [Each; 3],
    /// The voxel that a ray has entered, and where.
    voxel: [Each; 3],
    distance: Each,
    /// How many voxels on each side of it are in its cube, in which nothing stops the ray.
    room: Each,
    /// The middle of the cube before.
    middle: [Each; 3],
    /// How far the ray was off the centre of the voxel that it entered then, on the axis where that is most.
    off: Each,
    along: [[u32; CHUNK]; 3],
    place: [u32; CHUNK],
    offset: [u32; CHUNK],
    clearance: [u8; CHUNK],
    ends: [bool; CHUNK],
    ended: [u16; CHUNK],
}

struct Cast<'a> {
    lanes: &'a mut Lanes,
    space: &'a Space,
    window: &'a Window<Clearance>,
    chunk: Chunk<'a>,
}

impl Kernel for Cast<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        self.lanes.cast_all(self.space, self.window, self.chunk);
    }
}

impl Default for Lanes {
    fn default() -> Self {
        Self {
            count: 0,
            row: [0; CHUNK],
            origin: [[0.0; CHUNK]; 3],
            direction: [[0.0; CHUNK]; 3],
            inverse: [[0.0; CHUNK]; 3],
            sign: [[0.0; CHUNK]; 3],
            voxel: [[0.0; CHUNK]; 3],
            distance: [0.0; CHUNK],
            room: [0.0; CHUNK],
            middle: [[0.0; CHUNK]; 3],
            off: [0.0; CHUNK],
            along: [[0; CHUNK]; 3],
            place: [0; CHUNK],
            offset: [0; CHUNK],
            clearance: [0; CHUNK],
            ends: [false; CHUNK],
            ended: [0; CHUNK],
        }
    }
}

impl Lanes {
    /// Casts the rays of a chunk. What comes of it does not depend on the instructions.
    pub fn cast(&mut self, space: &Space, window: &Window<Clearance>, chunk: Chunk) {
        space.instructions.run(Cast { lanes: self, space, window, chunk });
    }

    #[inline(always)]
    fn cast_all(&mut self, space: &Space, window: &Window<Clearance>, mut chunk: Chunk) {
        self.begin(space, &chunk);
        if space.unknown == Unknown::Free {
            self.begin_within(window);
        }
        self.enter(space, window, &mut chunk);
        while self.count > 0 {
            self.leave_cubes();
            self.enter(space, window, &mut chunk);
        }
    }

    /// All rays where they begin.
    #[inline(always)]
    fn begin(&mut self, space: &Space, chunk: &Chunk) {
        self.count = chunk.origins.len();
        for first in (0..self.count).step_by(LANES) {
            // Where there are no others, the last ray once more.
            let row = |n: usize| (first + n).min(chunk.origins.len() - 1);
            let origin: [[f64; LANES]; 3] = each(|a| lanes(|n| chunk.origins[row(n)][a]));
            let origin: [[f64; LANES]; 3] = each(|a| lanes(|n| origin[a][n] / space.voxel_size));
            let Directions { unit, inverse, sign } =
                Directions::<LANES>::new(each(|a| lanes(|n| chunk.directions[row(n)][a])));
            for a in 0..3 {
                self.origin[a][first..][..LANES].copy_from_slice(&origin[a]);
                self.direction[a][first..][..LANES].copy_from_slice(&unit[a]);
                self.inverse[a][first..][..LANES].copy_from_slice(&inverse[a]);
                self.sign[a][first..][..LANES].copy_from_slice(&sign[a]);
                self.voxel[a][first..][..LANES].copy_from_slice(&lanes::<LANES>(|n| whole(origin[a][n])));
            }
        }
        self.distance = [0.0; CHUNK];
        self.row = std::array::from_fn(|n| n as u16);
    }

    /// Moves rays from outside to where they first are in the box of all blocks, if they ever are.
    fn begin_within(&mut self, window: &Window<Clearance>) {
        let [first, last] = window.voxels();
        for n in 0..self.count {
            if let Some(start) = self.ray(n).enter(first, last) {
                self.set(n, start);
            }
        }
    }

    /// How many rays there are with those that fill the last vector up, and of which it does not matter what they do.
    #[inline(always)]
    fn in_vectors(&self) -> usize {
        self.count.next_multiple_of(LANES).min(CHUNK)
    }

    /// [`Ray::leave_box`] for all rays.
    #[inline(always)]
    fn leave_cubes(&mut self) {
        let mut doubtful = false;
        for n in 0..self.in_vectors() {
            let (origin, direction) = (each(|a| self.origin[a][n]), each(|a| self.direction[a][n]));
            let (inverse, sign) = (each(|a| self.inverse[a][n]), each(|a| self.sign[a][n]));
            let (middle, half) = (each(|a| self.voxel[a][n]), self.room[n] + 0.5);
            let face = each(|a| (middle[a] + 0.5) + sign[a] * half);
            let exit = each(|a| (face[a] - origin[a]) * inverse[a]);
            let distance = least(exit[0], least(exit[1], exit[2]));
            // Places in voxels from the centre of voxel 0, and the centres that they are nearest to.
            let at = each(|a| origin[a] + distance * direction[a] - 0.5);
            let nearest = each(|a| (at[a] + ONES) - ONES);
            let off = each(|a| if exit[a] == distance { 0.0 } else { (at[a] - nearest[a]).abs() });
            self.off[n] = most(off[0], most(off[1], off[2]));
            doubtful |= self.off[n] > 0.5 - DOUBT;
            self.distance[n] = distance;
            for a in 0..3 {
                let beyond = middle[a] + sign[a] * (half + 0.5);
                self.voxel[a][n] = if exit[a] == distance { beyond } else { nearest[a] };
                self.middle[a][n] = middle[a];
            }
        }
        if doubtful {
            self.leave_cubes_exactly();
        }
    }

    /// The same where rounding may have chosen the wrong voxel.
    #[cold]
    fn leave_cubes_exactly(&mut self) {
        for n in 0..self.count {
            if self.off[n] > 0.5 - DOUBT {
                let side = |sign: f64| each(|a| (self.middle[a][n] + sign * self.room[n]) as i32);
                let place = self.ray(n).leave_box(side(-1.0), side(1.0));
                self.set(n, place);
            }
        }
    }

    /// Lets all rays into the voxels that they have come to: they end there, or get cubes to leave.
    #[inline(always)]
    fn enter(&mut self, space: &Space, window: &Window<Clearance>, chunk: &mut Chunk) {
        let (count, layout) = (self.in_vectors(), window.layout());
        // Many short loops: the compiler makes vectors of all but two of them.
        for a in 0..3 {
            for n in 0..count {
                self.along[a][n] = layout.along(a, self.voxel[a][n]);
            }
        }
        for n in 0..count {
            let along = each(|a| self.along[a][n]);
            self.place[n] = layout.place(along);
            self.offset[n] = Layout::offset(along);
        }
        for n in 0..count {
            self.clearance[n] = window.at(self.place[n])[self.offset[n] as usize];
        }
        for n in 0..count {
            let clearance = self.clearance[n];
            self.room[n] = f64::from(clearance) - 1.0;
            // 0 wraps around to the largest number.
            self.ends[n] = (clearance.wrapping_sub(1) >= AROUND - 1) | (self.distance[n] > space.max_range);
        }
        let mut ended = 0;
        for n in 0..self.count.min(CHUNK) {
            // Without a branch, which would often be guessed wrongly.
            self.ended[ended] = n as u16;
            ended += usize::from(self.ends[n]);
        }
        // From the last on, so that what takes a ray's place has not ended.
        for n in (0..ended).rev() {
            self.end(self.ended[n].into(), space, chunk);
        }
    }

    /// Ends a ray.
    #[inline(always)]
    fn end(&mut self, n: usize, space: &Space, chunk: &mut Chunk) {
        let (row, clearance, distance) = (usize::from(self.row[n]), self.clearance[n], self.distance[n]);
        let stopped = (clearance != AROUND) & (distance <= space.max_range);
        let state = if clearance == OCCUPIED { State::Occupied } else { State::Unknown };
        let voxel = each(|a| to_i32(self.voxel[a][n]));
        chunk.distance[row] = if stopped { distance * space.voxel_size } else { f64::INFINITY };
        chunk.state[row] = if stopped { state } else { State::Free };
        chunk.voxel[row] = each(|a| if stopped { voxel[a] } else { NO_VOXEL[a] });

        self.count -= 1;
        let last = self.count;
        self.row[n] = self.row[last];
        for axes in [&mut self.origin, &mut self.direction, &mut self.inverse, &mut self.sign, &mut self.voxel] {
            axes.iter_mut().for_each(|all| all[n] = all[last]);
        }
        (self.distance[n], self.room[n]) = (self.distance[last], self.room[last]);
    }

    fn ray(&self, n: usize) -> Ray {
        Ray {
            origin: each(|a| self.origin[a][n]),
            direction: each(|a| self.direction[a][n]),
            inverse: each(|a| self.inverse[a][n]),
            upwards: each(|a| self.sign[a][n] > 0.0),
        }
    }

    fn set(&mut self, n: usize, place: Place) {
        for a in 0..3 {
            self.voxel[a][n] = f64::from(place.voxel[a]);
        }
        self.distance[n] = place.distance;
    }
}
