//! A ray among boxes of voxels, with exact faces.
//!
//! Where a ray crosses a face is computed from the face alone, never by adding up steps: whether it goes voxel by voxel
//! or over large boxes, it crosses the same faces in the same order and enters the same voxels.

use crate::block::VoxelIndex;

/// A half line, in units of voxels.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it begins; within `i32`.
    pub origin: [f64; 3],
    /// Its direction, of length one; 0 where coordinates change too little for `inverse`.
    pub direction: [f64; 3],
    /// One over the direction; infinite where that is 0.
    pub inverse: [f64; 3],
    /// Whether coordinates rise or stay, on each axis.
    pub upwards: [bool; 3],
}

/// A place on a ray: where it enters a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The voxel entered.
    pub voxel: VoxelIndex,
    /// How far along the ray, in voxels.
    pub distance: f64,
}

/// The squares of what is shorter than this might vanish, and those of what is longer than its inverse overflow.
const SMALL: f64 = 1e-100;
/// To make up for that: 2^700.
const HUGE: f64 = f64::from_bits((1023 + 700) << 52);

/// In numbers of this size the last bit counts ones: what is added to them is rounded to a whole number, which the low
/// bits hold.
pub const ONES: f64 = (3_u64 << 51) as f64;

/// Nearer than this to a face, in voxels, rounding may decide on which side of it a place along a ray lies:
/// coordinates and distances are below 2^33 voxels, and so rounded by less than 2^-18.
pub const DOUBT: f64 = 1.0 / (1 << 16) as f64;

impl Ray {
    /// A ray from an origin given in voxels, which lies within `i32`, along a direction of any length but zero.
    #[inline(always)]
    pub fn new(origin: [f64; 3], direction: [f64; 3]) -> Self {
        let Directions { unit, inverse, sign } = Directions::new(direction.map(|c| [c]));
        Self { origin, direction: unit.map(|[c]| c), inverse: inverse.map(|[c]| c), upwards: sign.map(|[s]| s > 0.0) }
    }

    /// Where the ray starts: in the voxel that contains its origin.
    #[inline(always)]
    pub fn start(&self) -> Place {
        Place { voxel: each(|a| floor(self.origin[a])), distance: 0.0 }
    }

    /// Where the ray leaves a cube of `edge` voxels that it is in; `low` is the cube's first voxel.
    #[inline(always)]
    pub fn leave(&self, low: VoxelIndex, edge: i32) -> Place {
        self.leave_box(low, each(|a| low[a] + edge - 1))
    }

    /// Where the ray leaves a box that it is in, given by its first and last voxels.
    ///
    /// Through an edge or a corner it goes straight on, without entering the voxels that it only touches there.
    #[inline(always)]
    pub fn leave_box(&self, first: VoxelIndex, last: VoxelIndex) -> Place {
        let exits = each(|a| self.exit(a, first[a], last[a]));
        let distance = exits[0].min(exits[1]).min(exits[2]);
        let index = |a: usize| match (exits[a] <= distance, self.upwards[a]) {
            (true, true) => last[a] + 1,
            (true, false) => first[a] - 1,
            (false, _) => self.index(a, distance, first[a], last[a]),
        };
        Place { voxel: each(index), distance }
    }

    /// Where the ray first is in a box, given by its first and last voxels.
    #[inline(always)]
    pub fn enter(&self, first: VoxelIndex, last: VoxelIndex) -> Option<Place> {
        let start = self.start();
        if (0..3).all(|a| first[a] <= start.voxel[a] && start.voxel[a] <= last[a]) {
            return Some(start);
        }
        self.enter_from_outside(start, first, last)
    }

    fn enter_from_outside(&self, start: Place, first: VoxelIndex, last: VoxelIndex) -> Option<Place> {
        let mut distance: f64 = 0.0;
        for a in 0..3 {
            let (below, above) = (start.voxel[a] < first[a], start.voxel[a] > last[a]);
            let (ahead, behind) = if self.upwards[a] { (below, above) } else { (above, below) };
            if behind || ahead && self.direction[a] == 0.0 {
                return None;
            }
            if ahead {
                // The ray enters the box where it leaves what lies before it.
                let before = if below { first[a] - 1 } else { last[a] + 1 };
                distance = distance.max(self.exit(a, before, before));
            }
        }
        if (0..3).any(|a| self.exit(a, first[a], last[a]) <= distance) {
            return None;
        }
        Some(Place { voxel: each(|a| self.index(a, distance, first[a], last[a])), distance })
    }

    /// How far along the ray it leaves the voxels `first..=last` of an axis.
    #[inline(always)]
    fn exit(&self, axis: usize, first: i32, last: i32) -> f64 {
        let face = if self.upwards[axis] { last + 1 } else { first };
        (f64::from(face) - self.origin[axis]) * self.inverse[axis]
    }

    /// Which of the voxels `first..=last` of an axis the ray is in at a distance, having left all whose exit is not
    /// beyond it.
    #[inline(always)]
    fn index(&self, axis: usize, distance: f64, first: i32, last: i32) -> i32 {
        if first == last {
            return first;
        }
        let (from, to, step) = if self.upwards[axis] { (first, last, 1) } else { (last, first, -1) };
        // Beside a face rounding may make this one too many or too few.
        let mut index = floor(self.origin[axis] + distance * self.direction[axis]).clamp(first, last);
        while index != to && self.has_left(axis, index, distance) {
            index += step;
        }
        while index != from && !self.has_left(axis, index - step, distance) {
            index -= step;
        }
        index
    }

    /// Whether the ray has left a voxel of an axis, which it was in or may have been, by some distance.
    #[inline(always)]
    fn has_left(&self, axis: usize, index: i32, distance: f64) -> bool {
        // Not `<=` alone: where the ray moves along a face, it has left what lies below for ever, and that is 0 times
        // infinity.
        let exit = self.exit(axis, index, index);
        exit.is_nan() || exit <= distance
    }
}

/// The directions of `N` rays, by axis.
pub struct Directions<const N: usize> {
    /// As [`Ray::direction`].
    pub unit: [[f64; N]; 3],
    /// As [`Ray::inverse`].
    pub inverse: [[f64; N]; 3],
    /// 1 on axes along which coordinates rise or stay, -1 where they fall.
    pub sign: [[f64; N]; 3],
}

impl<const N: usize> Directions<N> {
    /// Directions of any length but zero.
    #[inline(always)]
    pub fn new(given: [[f64; N]; 3]) -> Self {
        // Scaled first, exactly, so that squares neither overflow nor vanish.
        let largest = lanes::<N>(|n| most(most(given[0][n].abs(), given[1][n].abs()), given[2][n].abs()));
        let scale = lanes::<N>(|n| if largest[n] < SMALL { HUGE } else { 1.0 });
        let scale = lanes::<N>(|n| if largest[n] > 1.0 / SMALL { 1.0 / HUGE } else { scale[n] });
        let scaled: [[f64; N]; 3] = each(|a| lanes::<N>(|n| given[a][n] * scale[n]));
        let [x, y, z] = scaled;
        let length = lanes::<N>(|n| (x[n] * x[n] + y[n] * y[n] + z[n] * z[n]).sqrt());
        let one = lanes::<N>(|n| 1.0 / length[n]);
        let inverse = each(|a| lanes::<N>(|n| length[n] / scaled[a][n]));
        // A component without a finite inverse never leads to another voxel: it counts as none, and as upwards.
        let moves = |a: usize, n: usize| inverse[a][n].abs() <= f64::MAX;
        Self {
            unit: each(|a| lanes::<N>(|n| if moves(a, n) { scaled[a][n] * one[n] } else { 0.0 })),
            inverse: each(|a| lanes::<N>(|n| if moves(a, n) { inverse[a][n] } else { f64::INFINITY })),
            sign: each(|a| lanes::<N>(|n| if moves(a, n) & (scaled[a][n] < 0.0) { -1.0 } else { 1.0 })),
        }
    }
}

/// One number of each of `N` lanes. Step by step for all lanes, the compiler makes vectors of what it leaves scalar in a
/// loop over the lanes that does everything.
#[inline(always)]
pub fn lanes<const N: usize>(of: impl Fn(usize) -> f64) -> [f64; N] {
    let mut lanes = [0.0; N];
    for (n, lane) in lanes.iter_mut().enumerate() {
        *lane = of(n);
    }
    lanes
}

/// The whole part of a number, rounded down, as far as `i32` goes: `f64::floor` and `as` take many more instructions.
#[inline(always)]
pub fn floor(x: f64) -> i32 {
    let x = x.clamp(f64::from(i32::MIN), f64::from(i32::MAX));
    to_i32(whole(x))
}

/// A whole number within `i32`.
#[inline(always)]
pub fn to_i32(whole: f64) -> i32 {
    (whole + ONES).to_bits() as i32
}

/// The whole part of a number, rounded down, in few instructions; of numbers within 2^51, others stay large.
#[inline(always)]
pub fn whole(x: f64) -> f64 {
    let nearest = (x + ONES) - ONES;
    if nearest > x { nearest - 1.0 } else { nearest }
}

/// One of each axis. [`std::array::from_fn`] does the same, but the compiler may make three calls of it.
#[inline(always)]
pub fn each<T>(of: impl Fn(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}

/// `f64::min` without its care for NaN, which takes three more instructions.
#[inline(always)]
pub fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The same for `f64::max`.
#[inline(always)]
pub fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
