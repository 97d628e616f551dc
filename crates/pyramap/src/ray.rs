//! A ray among cubes of voxels, with exact faces.
//!
//! Where a ray crosses a face is computed from the face alone, never by adding up steps: whether it goes voxel by voxel
//! or over whole blocks, it crosses the same faces in the same order and enters the same voxels.

use crate::block::VoxelIndex;

/// A half line, in units of voxels.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    origin: [f64; 3],
    direction: [f64; 3],
    inverse: [f64; 3],
    /// All bits on axes along which coordinates rise or stay, none where they fall.
    upwards: [i32; 3],
}

/// A place on a ray: where it enters a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The voxel entered.
    pub voxel: VoxelIndex,
    /// How far along the ray, in voxels.
    pub distance: f64,
}

impl Ray {
    /// A ray from an origin given in voxels, which lies within `i32`, along a direction of any length but zero.
    pub fn new(origin: [f64; 3], direction: [f64; 3]) -> Self {
        // Scaled first, so that squares neither overflow nor vanish.
        let largest = direction[0].abs().max(direction[1].abs()).max(direction[2].abs());
        let scaled = each(|a| direction[a] / largest);
        let length = (scaled[0] * scaled[0] + scaled[1] * scaled[1] + scaled[2] * scaled[2]).sqrt();
        let inverse = each(|a| length / scaled[a]);
        // A component without a finite inverse never leads to another voxel: it counts as none, and as upwards.
        let moves = each(|a| inverse[a].is_finite());
        Self {
            origin,
            direction: each(|a| if moves[a] { scaled[a] / length } else { 0.0 }),
            inverse: each(|a| if moves[a] { inverse[a] } else { f64::INFINITY }),
            upwards: each(|a| if moves[a] && scaled[a] < 0.0 { 0 } else { -1 }),
        }
    }

    /// Where the ray starts: in the voxel that contains its origin.
    pub fn start(&self) -> Place {
        Place { voxel: each(|a| floor(self.origin[a])), distance: 0.0 }
    }

    /// Where the ray leaves a cube of `edge` voxels that it is in; `low` is the cube's first voxel.
    ///
    /// Through an edge or a corner it goes straight on, without entering the voxels that it only touches there.
    #[inline(always)]
    pub fn leave(&self, low: VoxelIndex, edge: i32) -> Place {
        let exits = each(|a| self.exit(a, low[a], edge));
        let distance = exits[0].min(exits[1]).min(exits[2]);
        let out = each(|a| exits[a] <= distance);
        let beyond = each(|a| self.beyond(a, low[a], edge));
        if edge == 1 {
            return Place { voxel: each(|a| if out[a] { beyond[a] } else { low[a] }), distance };
        }
        let guesses = each(|a| self.guess(a, distance, low[a], low[a] + edge - 1));
        if each(|a| out[a] | guesses[a].1) == [true; 3] {
            return Place { voxel: each(|a| if out[a] { beyond[a] } else { guesses[a].0 }), distance };
        }
        let index = |a: usize| self.index(a, distance, low[a], low[a] + edge - 1);
        Place { voxel: each(|a| if out[a] { beyond[a] } else { index(a) }), distance }
    }

    /// Where the ray first is in a box, given by its lowest and highest voxels.
    pub fn enter(&self, low: VoxelIndex, high: VoxelIndex) -> Option<Place> {
        let start = self.start();
        if (0..3).all(|a| low[a] <= start.voxel[a] && start.voxel[a] <= high[a]) {
            return Some(start);
        }
        let mut distance: f64 = 0.0;
        for a in 0..3 {
            let (below, above) = (start.voxel[a] < low[a], start.voxel[a] > high[a]);
            let (ahead, behind) = if self.upwards[a] != 0 { (below, above) } else { (above, below) };
            if behind || ahead && self.direction[a] == 0.0 {
                return None;
            }
            if ahead {
                // The ray enters the box where it leaves what lies before it.
                let before = if below { low[a] - 1 } else { high[a] + 1 };
                distance = distance.max(self.exit(a, before, 1));
            }
        }
        if (0..3).any(|a| self.exit(a, low[a], high[a] - low[a] + 1) <= distance) {
            return None;
        }
        Some(Place { voxel: each(|a| self.index(a, distance, low[a], high[a])), distance })
    }

    /// How far along the ray it leaves the `edge` voxels of an axis from `low` on.
    #[inline(always)]
    fn exit(&self, axis: usize, low: i32, edge: i32) -> f64 {
        (f64::from(low + (edge & self.upwards[axis])) - self.origin[axis]) * self.inverse[axis]
    }

    /// The voxel that the ray enters when it leaves the `edge` voxels of an axis from `low` on.
    #[inline(always)]
    fn beyond(&self, axis: usize, low: i32, edge: i32) -> i32 {
        low + (edge & self.upwards[axis]) + !self.upwards[axis]
    }

    /// Which of the voxels `low..=high` of an axis the ray is in at a distance, and whether that is certain. Beside a
    /// face it may be one off.
    #[inline(always)]
    fn guess(&self, axis: usize, distance: f64, low: i32, high: i32) -> (i32, bool) {
        /// In numbers of this size the last bit counts ones: what is added to them is rounded to a whole number.
        const ONES: f64 = (3_u64 << 51) as f64;
        /// Within this distance of a face, in voxels, rounding may matter: coordinates and distances are below 2^33
        /// voxels, and so rounded by less than 2^-19.
        const DOUBT: f64 = 1.0 / (1 << 16) as f64;
        let at = self.origin[axis] + distance * self.direction[axis] - 0.5;
        let rounded = at + ONES;
        let certain = (at - (rounded - ONES)).abs() < 0.5 - DOUBT;
        ((rounded.to_bits() as i32).clamp(low, high), certain)
    }

    /// Whether the ray has left a voxel of an axis, which it was in or may have been, by some distance.
    fn has_left(&self, axis: usize, index: i32, distance: f64) -> bool {
        // Not `<=` alone: where the ray moves along a face, it has left what lies below for ever, and that is 0 times
        // infinity.
        let exit = self.exit(axis, index, 1);
        exit.is_nan() || exit <= distance
    }

    /// Which of the voxels `low..=high` of an axis the ray is in at a distance, having left all whose exit is not
    /// beyond it.
    #[cold]
    fn index(&self, axis: usize, distance: f64, low: i32, high: i32) -> i32 {
        let up = self.upwards[axis] != 0;
        let (first, last, step) = if up { (low, high, 1) } else { (high, low, -1) };
        let mut index = self.guess(axis, distance, low, high).0;
        while index != last && self.has_left(axis, index, distance) {
            index += step;
        }
        while index != first && !self.has_left(axis, index - step, distance) {
            index -= step;
        }
        index
    }
}

/// The whole part of a number, rounded down, as far as `i32` goes: `f64::floor` is a call where processors may lack it.
#[inline(always)]
pub fn floor(x: f64) -> i32 {
    let truncated = x as i32;
    truncated.saturating_sub(i32::from(f64::from(truncated) > x))
}

/// One of each axis. [`std::array::from_fn`] does the same, but the compiler may make three calls of it.
#[inline(always)]
pub fn each<T>(of: impl Fn(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}
