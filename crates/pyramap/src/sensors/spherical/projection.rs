//! The spherical sensor as the kernels see it.

use super::SphericalSensor;
use super::angle::atan2;
use super::rows::Rows;
use crate::cull::{Eighths, PIXEL_SLACK};
use crate::pose::Pose;
use crate::sensors::{Outline, PixelRay, Projected, Projection};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Projects onto azimuth and elevation.
///
/// Columns are counted in whole steps of some power of two, in which all sums are exact: turning the image and the first
/// column's azimuth alike changes no bit of what is projected.
#[derive(Clone, Debug)]
pub struct Spherical<'a> {
    sensor: &'a SphericalSensor,
    /// Which row an elevation belongs to.
    pub rows: &'a Rows,
    /// Columns and rows of the image.
    pub image: [f32; 2],
    /// Negative if columns go clockwise.
    pub columns_per_radian: f32,
    /// The power of two of columns in which they are counted.
    pub step: f32,
    /// Adding and taking off this rounds a number of columns to whole steps.
    round: f32,
    /// The column in the middle of the image, counted from azimuth 0.
    pub middle: f32,
    /// Columns in a full turn.
    pub turn: f32,
    full_turn: bool,
    /// How far beside its column a pixel's ray may be, in columns, once rows are aligned.
    pub unaligned: f32,
}

/// More than all roundings on the way to a bound, relative.
pub const BOUND_SLACK: f32 = 1.0 + 1e-5;

impl<'a> Spherical<'a> {
    /// Makes ready what is the same for all points.
    pub fn new(sensor: &'a SphericalSensor) -> Self {
        let (width, span) = (sensor.width() as f64, sensor.azimuth_span());
        let columns_per_radian = width / span;
        let turn = TAU * columns_per_radian.abs();
        // All columns and differences of two stay below 2^24 steps.
        let step = (turn.log2().ceil() + 1.0 - 24.0).exp2();
        let whole = |columns: f64| (columns / step).round() * step;
        let middle = sensor.first_azimuth() * columns_per_radian + 0.5 * (width - 1.0);
        Self {
            sensor,
            rows: sensor.rows(),
            image: [width as f32, sensor.height() as f32],
            columns_per_radian: columns_per_radian as f32,
            step: step as f32,
            round: (1.5 * 8_388_608.0 * step) as f32,
            middle: whole(middle - turn * (middle / turn).round()) as f32,
            turn: whole(turn) as f32,
            full_turn: sensor.full_turn(),
            unaligned: if sensor.row_offsets().is_empty() { 0.0 } else { 0.5 },
        }
    }

    /// The column of an azimuth, counted from the image's border.
    #[inline(always)]
    fn column(&self, azimuth: f32) -> f32 {
        let columns = (azimuth * self.columns_per_radian + self.round) - self.round - self.middle;
        columns - self.turn * (columns / self.turn + 0.5).floor() + 0.5 * self.image[0]
    }
}

impl Projection for Spherical<'_> {
    const PERSPECTIVE: bool = true;
    type Size = ();

    #[inline(always)]
    fn image(&self) -> [f32; 2] {
        self.image
    }

    /// Rows may lie unevenly: the mean stands for all.
    fn focal_length(&self) -> f64 {
        self.sensor.focal_length()
    }

    #[inline(always)]
    fn wraps(&self) -> bool {
        self.full_turn
    }

    #[inline(always)]
    fn project(&self, [x, y, z]: [f32; 3]) -> Projected {
        let flat = x * x + y * y;
        let range = (flat + z * z).sqrt();
        Projected { u: self.column(atan2(y, x)), v: self.rows.row(atan2(z, flat.sqrt())), range, in_front: range > 0.0 }
    }

    fn ray(&self, column: usize, row: usize) -> PixelRay {
        self.sensor.aligned_ray(column, row)
    }

    fn certain_within(&self, voxel_size: f64) -> f32 {
        // A voxel holds a ball of diameter r, which is seen under an angle of more than r / z. The pixel that holds its
        // centre is no larger than the least column and the widest row, so that a ball which looks as large as its diagonal
        // holds the pixel's centre. Columns that are off by up to half of one count twice. A tenth is slack for large
        // angles and for the table of the rows.
        let column = self.sensor.column_width() * if self.sensor.row_offsets().is_empty() { 1.0 } else { 2.0 };
        (0.9 * voxel_size / column.hypot(self.rows.widest_spacing())) as f32
    }

    fn size(&self, _: &[[f32; 3]; 3], _: f32) {}

    #[inline(always)]
    fn ranges(&self, cubes: &Eighths<Self>, centre: [f32; 3]) -> [f32; 2] {
        cubes.distances(centre)
    }

    /// In the plane through the z axis and a centre c, with x' forward and z up, a point p of the cube lies at x' = s + e:
    /// s is its place along c's direction, and e = |(s, t)| - s <= t^2 / 2s, for t across. So the tangents of both its
    /// angles to c are bounded by extents of the cube along fixed directions, over its least distance.
    #[inline(always)]
    fn outline(&self, cubes: &Eighths<Self>, centre: [f32; 3], _: f32) -> Outline {
        let [x, y, z] = centre;
        let flat = (x * x + y * y).sqrt();
        let distance = (flat * flat + z * z).sqrt();
        let (inverse_flat, inverse) = (1.0 / flat, 1.0 / distance);
        let [mut across, mut along, mut upwards, mut away] = [0.0f32; 4];
        for axis in &cubes.axes {
            let forward = (axis[0] * x + axis[1] * y) * inverse_flat;
            across += (axis[1] * x - axis[0] * y).abs() * inverse_flat;
            along += forward.abs();
            upwards += (axis[2] * flat - forward * z).abs() * inverse;
            away += (forward * flat + axis[2] * z).abs() * inverse;
        }
        let half = cubes.projected * BOUND_SLACK;
        let (across, nearest_flat, nearest) = (half * across, flat - half * along, distance - half * away);
        // A cube around the axis has no bound in azimuth, and one around the sensor none at all.
        let off_axis = nearest_flat > 1e-3;
        let bounded = off_axis & (nearest > 1e-3);
        let excess = across * across / (2.0 * nearest_flat);
        let tilt = (half * upwards + excess * z.abs() * inverse) / nearest * BOUND_SLACK;
        let turn = across / nearest_flat * self.columns_per_radian.abs() * BOUND_SLACK + self.unaligned + PIXEL_SLACK;

        let elevation = atan2(z, flat);
        let (high, low) = (self.rows.row(elevation + tilt), self.rows.row(elevation - tilt));
        let (top, bottom) = if high < low { (high, low) } else { (low, high) };
        let (top, bottom) = (top - PIXEL_SLACK, bottom + PIXEL_SLACK);

        let [width, height] = self.image;
        let u = self.column(atan2(y, x));
        // From the middle, the short way around.
        let aside = (u - 0.5 * width).abs();
        // What reaches all around, or is on both sides of a sector's back, may be read in any column.
        let everywhere = if self.full_turn { 2.0 * turn >= self.turn } else { 2.0 * (aside + turn) >= self.turn };
        let beside = self.full_turn | (aside - turn <= 0.5 * width);
        let within = self.full_turn | (aside + turn <= 0.5 * width);
        Outline {
            columns: if everywhere { [0.0, width] } else { [u - turn, u + turn] },
            rows: [top, bottom],
            bounded,
            in_sight: !bounded | (beside & (bottom >= 0.0) & (top <= height)),
            inside: bounded & within & (top >= 0.0) & (bottom <= height),
        }
    }

    /// Whatever lies within the range.
    fn reach(&self, pose: &Pose, max_range: f64) -> [Vector3<f64>; 2] {
        let reach = Vector3::repeat(max_range);
        [pose.translation - reach, pose.translation + reach]
    }
}
