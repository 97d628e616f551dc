//! The pinhole camera with a lens that distorts, as the kernels see it.

use super::lens::Lens;
use super::pinhole::{Pinhole, Size, reach_of, spread};
use super::projection::{Outline, PixelRay, Projected, Projection};
use crate::camera::PinholeCamera;
use crate::cull::{Eighths, PIXEL_SLACK, dot};
use crate::pose::Pose;
use nalgebra::Vector3;

/// Projects through a pinhole and a lens. Points beyond the radius up to which the lens can be undone, or beyond the
/// corners of the image, are out of sight.
#[derive(Clone, Debug)]
pub struct DistortedPinhole {
    camera: PinholeCamera,
    lens: Lens,
    /// Without the lens, but with the sides of the pyramid that holds all rays.
    pub plain: Pinhole,
    /// k1, k2, p1, p2, k3.
    pub coefficients: [f32; 5],
    /// How far from the axis anything is in sight, at one metre.
    pub radius: f32,
    /// The most that columns and rows change with x and y.
    pub stretch: [[f32; 2]; 2],
}

impl DistortedPinhole {
    /// Makes ready what is the same for all points.
    pub fn new(camera: &PinholeCamera, lens: &Lens) -> Self {
        let mut plain = Pinhole::new(camera);
        let ([fx, fy], [low, high]) = (plain.focal, lens.bounds().map(|corner| corner.map(|c| c as f32)));
        plain.sides =
            [[fx, 0.0, -fx * low[0]], [-fx, 0.0, fx * high[0]], [0.0, fy, -fy * low[1]], [0.0, -fy, fy * high[1]]];
        Self {
            camera: *camera,
            lens: *lens,
            plain,
            coefficients: lens.distortion().coefficients().map(|c| c as f32),
            radius: lens.radius() as f32,
            stretch: lens.stretch().map(|row| row.map(|c| c as f32)),
        }
    }

    /// The pixel of a point in the plane z = 1.
    #[inline(always)]
    fn pixel(&self, x: f32, y: f32) -> [f32; 2] {
        let [k1, k2, p1, p2, k3] = self.coefficients;
        let (xx, xy, yy) = (x * x, x * y, y * y);
        let r2 = xx + yy;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let distorted =
            [x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx), y * radial + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy];
        let ([fx, fy], [cx, cy]) = (self.plain.focal, self.plain.principal);
        [distorted[0] * fx + cx, distorted[1] * fy + cy]
    }
}

impl Projection for DistortedPinhole {
    const PERSPECTIVE: bool = true;
    type Size = Size;

    #[inline(always)]
    fn image(&self) -> [f32; 2] {
        self.plain.image
    }

    fn focal_length(&self) -> f64 {
        self.plain.focal_length()
    }

    #[inline(always)]
    fn wraps(&self) -> bool {
        false
    }

    #[inline(always)]
    fn project(&self, [x, y, z]: [f32; 3]) -> Projected {
        let inverse = 1.0 / z;
        let (flat_x, flat_y) = (x * inverse, y * inverse);
        let [u, v] = self.pixel(flat_x, flat_y);
        let within = flat_x * flat_x + flat_y * flat_y <= self.radius * self.radius;
        Projected { u, v, range: (x * x + y * y + z * z).sqrt(), in_front: (inverse > 0.0) & within }
    }

    fn ray(&self, column: usize, row: usize) -> PixelRay {
        self.camera.ray(column, row)
    }

    /// Nowhere: pixels differ in size.
    fn certain_within(&self, _: f64) -> f32 {
        0.0
    }

    fn size(&self, axes: &[[f32; 3]; 3], half: f32) -> Size {
        self.plain.size(axes, half)
    }

    #[inline(always)]
    fn ranges(&self, cubes: &Eighths<Self>, centre: [f32; 3]) -> [f32; 2] {
        cubes.distances(centre)
    }

    /// The disc up to the radius is convex, so that between two points in it the distortion moves no further apart than
    /// the most that it stretches. A centre outside is taken to the disc's border: whatever is in the disc is no farther
    /// from there, though its x or y alone may be.
    #[inline(always)]
    fn outline(&self, cubes: &Eighths<Self>, centre: [f32; 3], far: f32) -> Outline {
        let ([x, y, z], depth, focal) = (centre, cubes.size.depth, self.plain.focal);
        let inverse = 1.0 / z;
        let (flat_x, flat_y) = (x * inverse, y * inverse);
        let (dx, dy) = (spread(cubes, depth, 0, centre), spread(cubes, depth, 1, centre));
        let distance = (flat_x * flat_x + flat_y * flat_y).sqrt();
        let (farthest, outside) = ((dx * dx + dy * dy).sqrt(), distance > self.radius);
        let inwards = if outside { self.radius / distance } else { 1.0 };
        let (dx, dy) = if outside { (farthest, farthest) } else { (dx, dy) };
        let [u, v] = self.pixel(flat_x * inwards, flat_y * inwards);
        let du = (self.stretch[0][0] * dx + self.stretch[0][1] * dy) * focal[0] + PIXEL_SLACK;
        let dv = (self.stretch[1][0] * dx + self.stretch[1][1] * dy) * focal[1] + PIXEL_SLACK;
        let (columns, rows, [width, height]) = ([u - du, u + du], [v - dv, v + dv], self.plain.image);

        let bounded = z - depth > 1e-3;
        let mut in_sight = z > -depth;
        for (side, extent) in self.plain.sides.iter().zip(&cubes.size.across_sides) {
            in_sight &= dot(side, &centre) + extent + PIXEL_SLACK * far >= 0.0;
        }
        let within = (columns[0] >= 0.0) & (columns[1] <= width) & (rows[0] >= 0.0) & (rows[1] <= height);
        Outline {
            columns,
            rows,
            bounded,
            in_sight,
            inside: bounded & within & (distance + farthest < 0.999 * self.radius),
        }
    }

    fn reach(&self, pose: &Pose, max_range: f64) -> [Vector3<f64>; 2] {
        reach_of(self.lens.bounds(), pose, max_range)
    }
}
