//! The orthographic camera: all rays are parallel, as in height maps and images of telecentric lenses. Axes as those of
//! the pinhole camera, x right, y down, z forward.

use crate::camera::PinholeCamera;
use crate::cull::{DISTANCE_SLACK, Eighths, PIXEL_SLACK};
use crate::error::{Error, Result};
use crate::pose::Pose;
use crate::sensors::{Outline, PixelRay, Projected, Projection};
use nalgebra::Vector3;

/// An orthographic camera. Its readings are distances along z.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OrthographicCamera {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Pixels a metre along a row.
    pub fx: f64,
    /// Pixels a metre along a column.
    pub fy: f64,
    /// Column of the pixel at x = 0; `0` is the centre of the first pixel.
    pub cx: f64,
    /// Row of the pixel at y = 0.
    pub cy: f64,
}

impl OrthographicCamera {
    /// Checks the numbers and makes the camera.
    ///
    /// # Errors
    /// [`Error::Camera`] for what a [`PinholeCamera`] of these numbers would be refused.
    pub fn new(width: usize, height: usize, fx: f64, fy: f64, cx: f64, cy: f64) -> Result<Self> {
        match PinholeCamera::new(width, height, fx, fy, cx, cy) {
            Ok(_) => Ok(Self { width, height, fx, fy, cx, cy }),
            Err(Error::Camera { name: name @ ("fx" | "fy"), got, .. }) => {
                Err(Error::Camera { name, got, expected: "a positive, finite number of pixels a metre" })
            }
            Err(error) => Err(error),
        }
    }

    /// The ray of a pixel, which starts in the plane z = 0.
    pub fn ray(&self, column: usize, row: usize) -> PixelRay {
        let start = Vector3::new((column as f64 - self.cx) / self.fx, (row as f64 - self.cy) / self.fy, 0.0);
        PixelRay { start, direction: Vector3::z() }
    }

    /// Lowest and highest x and y in the image, metres.
    fn extent(&self) -> [[f64; 2]; 2] {
        let border = |pixel: f64, c: f64, f: f64| (pixel - 0.5 - c) / f;
        [
            [border(0.0, self.cx, self.fx), border(0.0, self.cy, self.fy)],
            [border(self.width as f64, self.cx, self.fx), border(self.height as f64, self.cy, self.fy)],
        ]
    }

    /// How far aside of its pose the camera sees, metres.
    pub(crate) fn aside(&self) -> f64 {
        let farthest = |axis: usize| self.extent().iter().map(|side| side[axis].abs()).fold(0.0, f64::max);
        farthest(0).hypot(farthest(1))
    }
}

/// The orthographic camera as the kernels see it.
#[derive(Clone, Debug)]
pub struct Orthographic {
    camera: OrthographicCamera,
    image: [f32; 2],
    /// Along a row, and along a column.
    pub pixels_per_metre: [f32; 2],
    /// The pixel at x = y = 0, counted from the image's border.
    pub principal: [f32; 2],
}

/// How far a cube reaches.
#[derive(Clone, Debug)]
pub struct Size {
    /// Half its extent in columns and rows.
    pub pixels: [f32; 2],
    /// Half its depth, metres.
    pub depth: f32,
    /// Half the depth of a cube of half an edge of one.
    pub depth_of_unit: f32,
}

impl Orthographic {
    /// Makes ready what is the same for all points.
    pub fn new(camera: &OrthographicCamera) -> Self {
        Self {
            camera: *camera,
            image: [camera.width as f32, camera.height as f32],
            pixels_per_metre: [camera.fx as f32, camera.fy as f32],
            principal: [(camera.cx + 0.5) as f32, (camera.cy + 0.5) as f32],
        }
    }
}

impl Projection for Orthographic {
    const PERSPECTIVE: bool = false;
    type Size = Size;

    #[inline(always)]
    fn image(&self) -> [f32; 2] {
        self.image
    }

    fn focal_length(&self) -> f64 {
        (self.camera.fx * self.camera.fy).sqrt()
    }

    #[inline(always)]
    fn wraps(&self) -> bool {
        false
    }

    #[inline(always)]
    fn project(&self, [x, y, z]: [f32; 3]) -> Projected {
        Projected {
            u: x * self.pixels_per_metre[0] + self.principal[0],
            v: y * self.pixels_per_metre[1] + self.principal[1],
            range: z,
            in_front: z > 0.0,
        }
    }

    fn ray(&self, column: usize, row: usize) -> PixelRay {
        self.camera.ray(column, row)
    }

    fn certain_within(&self, voxel_size: f64) -> f32 {
        // As for the pinhole camera, at whatever distance.
        let disc = 0.999 * self.pixels_per_metre[0].min(self.pixels_per_metre[1]) * voxel_size as f32;
        if disc >= std::f32::consts::SQRT_2 { f32::INFINITY } else { 0.0 }
    }

    fn size(&self, axes: &[[f32; 3]; 3], half: f32) -> Size {
        let along = |k: usize| axes.iter().map(|axis| axis[k].abs()).sum::<f32>();
        let pixels = [0, 1].map(|k| half * along(k) * self.pixels_per_metre[k]);
        Size { pixels, depth: half * along(2), depth_of_unit: along(2) }
    }

    #[inline(always)]
    fn ranges(&self, cubes: &Eighths<Self>, [x, y, z]: [f32; 3]) -> [f32; 2] {
        let depth = cubes.voxels * cubes.size.depth_of_unit;
        // Places are rounded in proportion to how far off they are, not to their depth alone.
        let slack = DISTANCE_SLACK * (x.abs() + y.abs() + z.abs() + depth);
        [z - depth - slack, z + depth + slack]
    }

    #[inline(always)]
    fn outline(&self, cubes: &Eighths<Self>, centre: [f32; 3], _: f32) -> Outline {
        let Projected { u, v, range: z, .. } = self.project(centre);
        let ([du, dv], depth) = (cubes.size.pixels.map(|extent| extent + PIXEL_SLACK), cubes.size.depth);
        let (columns, rows, [width, height]) = ([u - du, u + du], [v - dv, v + dv], self.image);
        let beside = (columns[1] < 0.0) | (columns[0] > width) | (rows[1] < 0.0) | (rows[0] > height);
        let within = (columns[0] >= 0.0) & (columns[1] <= width) & (rows[0] >= 0.0) & (rows[1] <= height);
        let bounded = z - depth > 1e-3;
        Outline { columns, rows, bounded, in_sight: (z > -depth) & !beside, inside: bounded & within }
    }

    fn reach(&self, pose: &Pose, max_range: f64) -> [Vector3<f64>; 2] {
        let [low, high] = self.camera.extent();
        let corner = |n: usize| {
            let side = |axis: usize| if n >> axis & 1 == 0 { low[axis] } else { high[axis] };
            let depth = if n >> 2 == 0 { 0.0 } else { max_range };
            pose.rotation * Vector3::new(side(0), side(1), depth) + pose.translation
        };
        let first = [corner(0); 2];
        (1..8).map(corner).fold(first, |[low, high], corner| [low.inf(&corner), high.sup(&corner)])
    }
}
