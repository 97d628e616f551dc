//! Many rays at once: eight lanes, each with a ray, all going on to their next cubes in vector instructions.

use super::clearance::Clearance;
use super::{Chunk, EDGE, Space};
use crate::block::{BlockKey, Blocks, locate};
use crate::ray::{DOUBT, ONES, Place, Ray, each};
use crate::state::{State, Unknown};
use crate::window::Window;
use std::ops::Range;

const LANES: usize = 8;
type Lane = [f64; LANES];

/// The rays under way.
pub struct Lanes<'a, B: ?Sized> {
    space: &'a Space,
    window: &'a Window<Clearance>,
    blocks: &'a B,
    bounds: [BlockKey; 2],
    /// Which ray of the chunk; `None` if there is no other.
    row: [Option<usize>; LANES],
    ray: [Ray; LANES],
    steps: Steps,
}

/// What is computed for all lanes alike; by axis, then by lane; in voxels.
#[derive(Default)]
struct Steps {
    origin: [Lane; 3],
    direction: [Lane; 3],
    inverse: [Lane; 3],
    /// The first and the last voxel of the cube that a ray is about to leave.
    first: [Lane; 3],
    last: [Lane; 3],
    /// The face through which it can leave, and the voxel behind that.
    face: [Lane; 3],
    beyond: [Lane; 3],
    /// The voxel that it enters then, and where.
    voxel: [[i32; LANES]; 3],
    distance: Lane,
    /// Less than 0 where rounding may have chosen the wrong voxel.
    margin: Lane,
}

impl<'a, B: Blocks + ?Sized> Lanes<'a, B> {
    pub fn new(space: &'a Space, window: &'a Window<Clearance>, blocks: &'a B) -> Self {
        let ray = [Ray::new([0.0; 3], [1.0; 3]); LANES];
        Self { space, window, blocks, bounds: window.bounds(), row: [None; LANES], ray, steps: Steps::default() }
    }

    /// Casts the rays of a chunk, with the widest instructions that the processor has. Results do not depend on them.
    pub fn cast(self, chunk: Chunk) {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn with_avx2<B: Blocks + ?Sized>(lanes: Lanes<B>, chunk: Chunk) {
                lanes.cast_all(chunk);
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor was just asked.
                return unsafe { with_avx2(self, chunk) };
            }
        }
        self.cast_all(chunk);
    }

    #[inline(always)]
    fn cast_all(mut self, mut chunk: Chunk) {
        let mut rows = 0..chunk.origins.len();
        (0..LANES).for_each(|lane| self.begin(lane, &mut rows, &mut chunk));
        while self.row != [None; LANES] {
            self.steps.leave_cubes();
            for lane in 0..LANES {
                if let Some(row) = self.row[lane]
                    && !self.go_on(lane, row, &mut chunk)
                {
                    self.begin(lane, &mut rows, &mut chunk);
                }
            }
        }
    }

    /// Takes up the next ray that does not end where it begins, if there is one.
    #[inline(always)]
    fn begin(&mut self, lane: usize, rows: &mut Range<usize>, chunk: &mut Chunk) {
        self.row[lane] = None;
        for row in rows {
            let ray = self.space.ray(&chunk.origins[row], &chunk.directions[row]);
            let Some(start) = self.space.start(&ray, self.bounds) else { continue };
            self.ray[lane] = ray;
            if self.enter(lane, row, start, chunk) {
                for a in 0..3 {
                    self.steps.origin[a][lane] = ray.origin[a];
                    self.steps.direction[a][lane] = ray.direction[a];
                    self.steps.inverse[a][lane] = ray.inverse[a];
                }
                self.row[lane] = Some(row);
                return;
            }
        }
    }

    /// Follows a ray out of its cube; whether it goes on from there.
    #[inline(always)]
    fn go_on(&mut self, lane: usize, row: usize, chunk: &mut Chunk) -> bool {
        let Steps { first, last, voxel, distance, margin, .. } = &self.steps;
        let mut place = Place { voxel: each(|a| voxel[a][lane]), distance: distance[lane] };
        if margin[lane] < 0.0 {
            place = self.ray[lane].leave_box(each(|a| first[a][lane] as i32), each(|a| last[a][lane] as i32));
        }
        self.enter(lane, row, place, chunk)
    }

    /// Lets a ray into a voxel: it ends there, or gets a cube to leave.
    #[inline(always)]
    fn enter(&mut self, lane: usize, row: usize, place: Place, chunk: &mut Chunk) -> bool {
        if place.distance > self.space.max_range {
            return false;
        }
        let (key, offset) = locate(place.voxel);
        let (below, above) = match (self.window.get(key), self.space.unknown) {
            (Some(clearance), _) => match clearance[offset] {
                0 => return self.stop(row, place, chunk),
                room => ([i32::from(room) - 1; 3], [i32::from(room) - 1; 3]),
            },
            (None, Unknown::Occupied) => return self.stop(row, place, chunk),
            (None, Unknown::Free) => {
                let [low, high] = self.bounds;
                if (0..3).any(|a| key[a] < low[a] || key[a] > high[a]) {
                    return false;
                }
                let within = each(|a| place.voxel[a].rem_euclid(EDGE));
                (within, each(|a| EDGE - 1 - within[a]))
            }
        };
        let (steps, upwards) = (&mut self.steps, self.ray[lane].upwards);
        for a in 0..3 {
            let (first, last) = (f64::from(place.voxel[a] - below[a]), f64::from(place.voxel[a] + above[a]));
            (steps.first[a][lane], steps.last[a][lane]) = (first, last);
            steps.face[a][lane] = if upwards[a] { last + 1.0 } else { first };
            steps.beyond[a][lane] = if upwards[a] { last + 1.0 } else { first - 1.0 };
        }
        true
    }

    #[inline(always)]
    fn stop(&self, row: usize, place: Place, chunk: &mut Chunk) -> bool {
        let (key, offset) = locate(place.voxel);
        let state = match self.space.unknown {
            Unknown::Free => State::Occupied,
            Unknown::Occupied => {
                self.space.threshold.state(self.blocks.block(key).map_or(0, |block| block.value(offset)))
            }
        };
        chunk.set(row, self.space, place, state);
        false
    }
}

impl Steps {
    /// [`Ray::leave_box`] for all lanes, up to rounding.
    #[inline(always)]
    fn leave_cubes(&mut self) {
        let exits = each(|a| exit(self.face[a], self.origin[a], self.inverse[a]));
        let distance = least(exits[0], least(exits[1], exits[2]));
        let mut margins = [1.0; LANES];
        for a in 0..3 {
            let at = along(self.origin[a], self.direction[a], distance);
            let nearest = whole(at);
            let out = lanes(|n| exits[a][n] - distance[n]);
            let inside = least(most(nearest, self.first[a]), self.last[a]);
            let voxel = where_zero(out, self.beyond[a], inside);
            margins = least(margins, where_zero(out, [1.0; LANES], margin(at, nearest)));
            self.voxel[a] = whole_bits(voxel);
        }
        (self.distance, self.margin) = (distance, margins);
    }
}

#[inline(always)]
fn exit(face: Lane, origin: Lane, inverse: Lane) -> Lane {
    lanes(|n| (face[n] - origin[n]) * inverse[n])
}

/// Places along an axis, in voxels from the centre of voxel 0.
#[inline(always)]
fn along(origin: Lane, direction: Lane, distance: Lane) -> Lane {
    lanes(|n| origin[n] + distance[n] * direction[n] - 0.5)
}

#[inline(always)]
fn whole(x: Lane) -> Lane {
    lanes(|n| (x[n] + ONES) - ONES)
}

#[inline(always)]
fn whole_bits(x: Lane) -> [i32; LANES] {
    let mut bits = [0; LANES];
    for n in 0..LANES {
        bits[n] = (x[n] + ONES).to_bits() as i32;
    }
    bits
}

/// How far places are from where a face is in doubt; `nearest` are the centres that they are nearest to.
#[inline(always)]
fn margin(at: Lane, nearest: Lane) -> Lane {
    lanes(|n| (0.5 - DOUBT) - (at[n] - nearest[n]).abs())
}

/// `f64::min` without its care for NaN, which takes three more instructions.
#[inline(always)]
fn least(a: Lane, b: Lane) -> Lane {
    lanes(|n| if a[n] < b[n] { a[n] } else { b[n] })
}

#[inline(always)]
fn most(a: Lane, b: Lane) -> Lane {
    lanes(|n| if a[n] > b[n] { a[n] } else { b[n] })
}

#[inline(always)]
fn where_zero(x: Lane, yes: Lane, no: Lane) -> Lane {
    lanes(|n| if x[n] == 0.0 { yes[n] } else { no[n] })
}

/// One value of each lane.
#[inline(always)]
fn lanes(of: impl Fn(usize) -> f64) -> Lane {
    let mut values = [0.0; LANES];
    for (n, value) in values.iter_mut().enumerate() {
        *value = of(n);
    }
    values
}
