//! Many rays at once: eight lanes, each with a ray, all going on to their next cubes in vector instructions.

use super::clearance::{Clearance, FARTHEST, OCCUPIED, UNKNOWN};
use super::{Chunk, Space};
use crate::block::{BlockKey, VoxelIndex, locate};
use crate::ray::{DOUBT, ONES, Place, Ray, each, least, most};
use crate::state::{State, Unknown};
use crate::window::Window;

const LANES: usize = 8;
type Lane = [f64; LANES];

/// The rays of a chunk: those under way, those ready to go, and those still to come.
pub struct Lanes<'a> {
    space: &'a Space,
    window: &'a Window<Clearance>,
    bounds: [BlockKey; 2],
    chunk: Chunk<'a>,
    /// Which ray of the chunk; `None` if there is no other.
    row: [Option<usize>; LANES],
    steps: Steps,
    ready: Rays,
    /// The next ray.
    next: usize,
}

/// Rays by axis, then by lane; in voxels.
#[derive(Default)]
struct Rays {
    origin: [Lane; 3],
    direction: [Lane; 3],
    inverse: [Lane; 3],
    /// 1 on axes along which coordinates rise or stay, 0 where they fall.
    upwards: [Lane; 3],
}

/// What is computed for all lanes alike.
#[derive(Default)]
struct Steps {
    rays: Rays,
    /// The middle of the cube that a ray is about to leave, and how many voxels there are on each side of it.
    middle: [Lane; 3],
    room: Lane,
    /// The voxel that it enters then, as a number and as an index, and where.
    voxel: [Lane; 3],
    index: [[i32; LANES]; 3],
    distance: Lane,
    /// Less than 0 where rounding may have chosen the wrong voxel.
    margin: Lane,
}

impl<'a> Lanes<'a> {
    pub fn new(space: &'a Space, window: &'a Window<Clearance>, chunk: Chunk<'a>) -> Self {
        let (steps, ready, bounds) = (Steps::default(), Rays::default(), window.bounds());
        Self { space, window, bounds, chunk, row: [None; LANES], steps, ready, next: 0 }
    }

    /// Casts the rays with the widest instructions that the processor has. Results do not depend on them.
    pub fn cast(self) {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn with_avx2(lanes: Lanes) {
                lanes.cast_all();
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor was just asked.
                return unsafe { with_avx2(self) };
            }
        }
        self.cast_all();
    }

    #[inline(always)]
    fn cast_all(mut self) {
        for lane in 0..LANES {
            self.begin(lane);
        }
        while self.row.iter().any(Option::is_some) {
            self.steps.leave_cubes();
            for lane in 0..LANES {
                if let Some(row) = self.row[lane]
                    && !self.go_on(lane, row)
                {
                    self.begin(lane);
                }
            }
        }
    }

    /// Takes up the next ray that does not end where it begins, if there is one.
    #[inline(always)]
    fn begin(&mut self, lane: usize) {
        self.row[lane] = None;
        while self.row[lane].is_none() && self.next < self.chunk.origins.len() {
            let (row, from) = (self.next, self.next % LANES);
            if from == 0 {
                self.prepare();
            }
            self.next += 1;
            let (rays, ready) = (&mut self.steps.rays, &self.ready);
            for a in 0..3 {
                rays.origin[a][lane] = ready.origin[a][from];
                rays.direction[a][lane] = ready.direction[a][from];
                rays.inverse[a][lane] = ready.inverse[a][from];
                rays.upwards[a][lane] = ready.upwards[a][from];
            }
            let Some(start) = self.space.start(&rays.get(lane), self.bounds) else { continue };
            if self.enter(lane, row, start) {
                self.steps.set_voxel(lane, start.voxel);
                self.row[lane] = Some(row);
            }
        }
    }

    /// Makes the next few rays ready, all at once.
    #[inline(always)]
    fn prepare(&mut self) {
        let last = self.chunk.origins.len() - 1;
        for n in 0..LANES {
            let row = (self.next + n).min(last);
            let ray = self.space.ray(&self.chunk.origins[row], &self.chunk.directions[row]);
            for a in 0..3 {
                self.ready.origin[a][n] = ray.origin[a];
                self.ready.direction[a][n] = ray.direction[a];
                self.ready.inverse[a][n] = ray.inverse[a];
                self.ready.upwards[a][n] = if ray.upwards[a] { 1.0 } else { 0.0 };
            }
        }
    }

    /// Follows a ray out of its cube; whether it goes on from there.
    #[inline(always)]
    fn go_on(&mut self, lane: usize, row: usize) -> bool {
        let steps = &self.steps;
        let mut place = Place { voxel: each(|a| steps.index[a][lane]), distance: steps.distance[lane] };
        if steps.margin[lane] < 0.0 {
            place = self.steps.leave_cube(lane);
            self.steps.set_voxel(lane, place.voxel);
        }
        self.enter(lane, row, place)
    }

    /// Lets a ray into a voxel: it ends there, or gets a cube to leave.
    #[inline(always)]
    fn enter(&mut self, lane: usize, row: usize, place: Place) -> bool {
        if place.distance > self.space.max_range {
            return false;
        }
        let (key, offset) = locate(place.voxel);
        let clearance = match self.window.get(key) {
            Some(clearance) => clearance[offset],
            None if self.space.unknown == Unknown::Occupied => UNKNOWN,
            None if is_within(key, self.bounds) => FARTHEST,
            None => return false,
        };
        let state = match clearance {
            OCCUPIED => State::Occupied,
            UNKNOWN => State::Unknown,
            clearance => {
                self.steps.room[lane] = f64::from(clearance - 1);
                return true;
            }
        };
        self.chunk.set(row, self.space, place, state);
        false
    }
}

fn is_within(key: BlockKey, [low, high]: [BlockKey; 2]) -> bool {
    (0..3).all(|a| low[a] <= key[a] && key[a] <= high[a])
}

impl Rays {
    #[inline(always)]
    fn get(&self, lane: usize) -> Ray {
        Ray {
            origin: each(|a| self.origin[a][lane]),
            direction: each(|a| self.direction[a][lane]),
            inverse: each(|a| self.inverse[a][lane]),
            upwards: each(|a| self.upwards[a][lane] > 0.0),
        }
    }
}

impl Steps {
    /// [`Ray::leave_box`] for all lanes, up to rounding.
    #[inline(always)]
    fn leave_cubes(&mut self) {
        let Rays { origin, direction, inverse, upwards } = &self.rays;
        self.middle = self.voxel;
        for n in 0..LANES {
            let room = self.room[n];
            let first = each(|a| self.middle[a][n] - room);
            let face = each(|a| first[a] + upwards[a][n] * (2.0 * room + 1.0));
            let exit = each(|a| (face[a] - origin[a][n]) * inverse[a][n]);
            let distance = least(exit[0], least(exit[1], exit[2]));
            // Places in voxels from the centre of voxel 0, and the centres that they are nearest to.
            let at = each(|a| origin[a][n] + distance * direction[a][n] - 0.5);
            let nearest = each(|a| (at[a] + ONES) - ONES);
            let margin = each(|a| if exit[a] == distance { 1.0 } else { (0.5 - DOUBT) - (at[a] - nearest[a]).abs() });
            self.distance[n] = distance;
            self.margin[n] = least(margin[0], least(margin[1], margin[2]));
            for a in 0..3 {
                let inside = least(most(nearest[a], first[a]), first[a] + 2.0 * room);
                let beyond = face[a] + (upwards[a][n] - 1.0);
                let voxel = if exit[a] == distance { beyond } else { inside };
                self.voxel[a][n] = voxel;
                self.index[a][n] = (voxel + ONES).to_bits() as i32;
            }
        }
    }

    #[inline(always)]
    fn set_voxel(&mut self, lane: usize, voxel: VoxelIndex) {
        for (lanes, index) in self.voxel.iter_mut().zip(voxel) {
            lanes[lane] = f64::from(index);
        }
    }

    /// The same as [`Steps::leave_cubes`] for one lane, exactly.
    #[cold]
    fn leave_cube(&self, lane: usize) -> Place {
        let side = |sign: f64| -> VoxelIndex { each(|a| (self.middle[a][lane] + sign * self.room[lane]) as i32) };
        self.rays.get(lane).leave_box(side(-1.0), side(1.0))
    }
}
