//! The pinhole camera without distortion, as the kernels see it.

use super::projection::{Outline, PixelRay, Projected, Projection};
use crate::camera::PinholeCamera;
use crate::cull::{Eighths, PIXEL_SLACK, dot};
use crate::pose::Pose;
use crate::simd::{Real, Simd};
use crate::view::Points;
use nalgebra::Vector3;

/// Projects through a pinhole (Eq. 13).
#[derive(Clone, Debug)]
pub struct Pinhole {
    /// Columns and rows of the image.
    pub image: [f32; 2],
    /// Focal lengths.
    pub focal: [f32; 2],
    /// The principal point, counted from the image's border: half a pixel more than from the first pixel's centre.
    pub principal: [f32; 2],
    /// The sides of the frustum, left, right, top, bottom: a point in front of the camera is in the image where its
    /// products with all four are positive. They grow by one for each pixel into the image at one metre.
    pub sides: [[f32; 3]; 4],
    focal_length: f64,
}

/// The extent of a cube.
#[derive(Clone, Debug)]
pub struct Size {
    /// Half its depth, along the camera's z, metres.
    pub depth: f32,
    /// Half its extent across each of the frustum's sides, in the units of [`Pinhole::sides`].
    pub across_sides: [f32; 4],
}

impl Pinhole {
    /// Makes ready what is the same for all points.
    pub fn new(camera: &PinholeCamera) -> Self {
        let image = [camera.width as f32, camera.height as f32];
        let focal = [camera.fx as f32, camera.fy as f32];
        let principal = [(camera.cx + 0.5) as f32, (camera.cy + 0.5) as f32];
        let sides = [
            [focal[0], 0.0, principal[0]],
            [-focal[0], 0.0, image[0] - principal[0]],
            [0.0, focal[1], principal[1]],
            [0.0, -focal[1], image[1] - principal[1]],
        ];
        Self { image, focal, principal, sides, focal_length: camera.focal_length() }
    }

    #[inline(always)]
    fn projected<R: Real>(&self, [x, y, z]: [R; 3]) -> Projected<R> {
        let inverse = R::splat(1.0) / z;
        Projected {
            u: x * inverse * R::splat(self.focal[0]) + R::splat(self.principal[0]),
            v: y * inverse * R::splat(self.focal[1]) + R::splat(self.principal[1]),
            range: (x * x + y * y + z * z).sqrt(),
            in_front: inverse.greater(R::splat(0.0)),
        }
    }

    #[inline(always)]
    fn outlined<R: Real>(&self, cubes: &Eighths<Self>, centre: [R; 3], far: R) -> Outline<R> {
        let ([x, y, z], depth, slack) = (centre, cubes.size.depth, R::splat(PIXEL_SLACK));
        let focal = [R::splat(self.focal[0]), R::splat(self.focal[1])];
        let principal = [R::splat(self.principal[0]), R::splat(self.principal[1])];
        let inverse = R::splat(1.0) / z;
        let u = x * inverse * focal[0] + principal[0];
        let v = y * inverse * focal[1] + principal[1];
        let du = spread(cubes, depth, 0, centre) * focal[0] + slack;
        let dv = spread(cubes, depth, 1, centre) * focal[1] + slack;
        // A cube that reaches behind the camera has no outline.
        let bounded = (z - R::splat(depth)).greater(R::splat(1e-3));
        let (mut in_sight, mut inside) = (z.greater(R::splat(-depth)), bounded);
        for (side, &extent) in self.sides.iter().zip(&cubes.size.across_sides) {
            let (within, reach) = (dot(side, &centre), R::splat(extent) + slack * far);
            in_sight = in_sight & (within + reach).at_least(R::splat(0.0));
            inside = inside & (within - reach).at_least(R::splat(0.0));
        }
        Outline { columns: [u - du, u + du], rows: [v - dv, v + dv], bounded, in_sight, inside }
    }
}

/// How far from a centre's column (`across` 0) or row (1) the cube around it may project, in focal lengths.
///
/// For p' in the cube around p, x'/z' - x/z = ((x' - x) z - x (z' - z)) / (z' z). The numerator is linear in p', so that
/// each of the cube's axes adds its own absolute value; z' is at least z less half the cube's depth.
#[inline(always)]
pub fn spread<R: Real, P: Projection>(cubes: &Eighths<P>, depth: f32, across: usize, centre: [R; 3]) -> R {
    let (x, z) = (centre[across], centre[2]);
    let mut reach = R::splat(0.0);
    for axis in &cubes.axes {
        reach = reach + (R::splat(axis[across]) * z - x * R::splat(axis[2])).abs();
    }
    R::splat(cubes.projected) * reach / ((z - R::splat(depth)) * z)
}

/// The pyramid of the rays through the corners of a rectangle in the plane z = 1, cut at z = `max_range`, holds every
/// point within that range that is seen through the rectangle; and nothing is farther off than that along any axis.
pub fn reach_of([low, high]: [[f64; 2]; 2], pose: &Pose, max_range: f64) -> [Vector3<f64>; 2] {
    let [mut lowest, mut highest] = [pose.translation; 2];
    for (x, y) in [(low[0], low[1]), (low[0], high[1]), (high[0], low[1]), (high[0], high[1])] {
        let corner = pose.rotation * (Vector3::new(x, y, 1.0) * max_range) + pose.translation;
        lowest = lowest.inf(&corner);
        highest = highest.sup(&corner);
    }
    let reach = Vector3::repeat(max_range);
    [lowest.sup(&(pose.translation - reach)), highest.inf(&(pose.translation + reach))]
}

impl Projection for Pinhole {
    const PERSPECTIVE: bool = true;
    type Size = Size;

    #[inline(always)]
    fn image(&self) -> [f32; 2] {
        self.image
    }

    fn focal_length(&self) -> f64 {
        self.focal_length
    }

    #[inline(always)]
    fn wraps(&self) -> bool {
        false
    }

    #[inline(always)]
    fn project(&self, point: [f32; 3]) -> Projected {
        self.projected(point)
    }

    #[inline(always)]
    fn project_eight<S: Simd>(&self, points: &Points) -> Projected<S::Eight> {
        self.projected([S::load(&points.x), S::load(&points.y), S::load(&points.z)])
    }

    fn ray(&self, column: usize, row: usize) -> PixelRay {
        let in_camera = |axis: usize, pixel: usize| {
            (pixel as f64 + 0.5 - f64::from(self.principal[axis])) / f64::from(self.focal[axis])
        };
        PixelRay { start: Vector3::zeros(), direction: Vector3::new(in_camera(0, column), in_camera(1, row), 1.0) }
    }

    fn certain_within(&self, voxel_size: f64) -> f32 {
        // A voxel holds a ball of diameter r, whose image is no smaller than a disc of diameter f r / z. A disc of
        // diameter sqrt(2) pixels holds a pixel centre wherever it lies; the rest is slack for rounding.
        let focal = self.focal[0].min(self.focal[1]);
        0.999 * focal * voxel_size as f32 / std::f32::consts::SQRT_2
    }

    fn size(&self, axes: &[[f32; 3]; 3], half: f32) -> Size {
        let extent = |normal: &[f32; 3]| half * axes.iter().map(|axis| dot(axis, normal).abs()).sum::<f32>();
        Size { depth: extent(&[0.0, 0.0, 1.0]), across_sides: self.sides.each_ref().map(extent) }
    }

    #[inline(always)]
    fn ranges(&self, cubes: &Eighths<Self>, centre: [f32; 3]) -> [f32; 2] {
        cubes.distances(centre)
    }

    #[inline(always)]
    fn outline(&self, cubes: &Eighths<Self>, centre: [f32; 3], far: f32) -> Outline {
        self.outlined(cubes, centre, far)
    }

    #[inline(always)]
    fn outline_eight<S: Simd>(&self, cubes: &Eighths<Self>, centres: &Points) -> ([S::Eight; 2], Outline<S::Eight>) {
        let centres = [S::load(&centres.x), S::load(&centres.y), S::load(&centres.z)];
        let ranges = cubes.distances(centres);
        (ranges, self.outlined(cubes, centres, ranges[1]))
    }

    fn reach(&self, pose: &Pose, max_range: f64) -> [Vector3<f64>; 2] {
        let corner = |border: [f32; 2]| [0, 1].map(|k| f64::from((border[k] - self.principal[k]) / self.focal[k]));
        reach_of([corner([0.0; 2]), corner(self.image)], pose, max_range)
    }
}
