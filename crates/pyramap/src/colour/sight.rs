//! What the colour camera sees of the surfaces that the depth sensor measured.

use super::ColourImage;
use super::means::Means;
use crate::sensors::{DistortedPinhole, Pinhole, Projected, Projection};
use crate::update::layer_of;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// The colour camera, seen from the depth sensor.
pub(super) struct Eye {
    projection: Lens,
    /// From the depth sensor's frame to the colour camera's.
    rotation: [[f32; 3]; 3],
    translation: [f32; 3],
    /// The distance at which a voxel is one pixel wide (Eq. 11).
    t_0: f32,
}

enum Lens {
    Plain(Pinhole),
    Distorted(Box<DistortedPinhole>),
}

impl Eye {
    pub fn new(image: &ColourImage, voxel_size: f64) -> Self {
        let camera = &image.camera;
        let pose = &image.depth_from_colour;
        let projection = match camera.lens() {
            None => Lens::Plain(Pinhole::new(camera)),
            Some(lens) => Lens::Distorted(Box::new(DistortedPinhole::new(camera, lens))),
        };
        let translation = pose.camera_from_world(&Vector3::zeros());
        Self {
            projection,
            rotation: std::array::from_fn(|r| std::array::from_fn(|c| pose.rotation[(c, r)] as f32)),
            translation: std::array::from_fn(|axis| translation[axis] as f32),
            t_0: (camera.focal_length() * voxel_size) as f32,
        }
    }

    /// Where a point in the depth sensor's frame is seen; nothing if it is out of sight.
    fn project(&self, point: [f32; 3]) -> Option<Projected> {
        let point = std::array::from_fn(|r| {
            let [x, y, z] = self.rotation[r];
            x * point[0] + y * point[1] + z * point[2] + self.translation[r]
        });
        let (projected, [width, height]) = match &self.projection {
            Lens::Plain(pinhole) => (pinhole.project(point), pinhole.image()),
            Lens::Distorted(camera) => (camera.project(point), camera.image()),
        };
        let Projected { u, v, in_front, .. } = projected;
        (in_front && u >= 0.0 && u < width && v >= 0.0 && v < height).then_some(projected)
    }

    /// The colour of a voxel that lies at a point in the depth sensor's frame: the mean over about as many pixels as the
    /// voxel covers. Nothing if it is out of the camera's sight, or hidden.
    pub fn colour(&self, point: [f32; 3], means: &Means, sight: Option<&Sight>) -> Option<[u8; 3]> {
        let Projected { u, v, range, .. } = self.project(point)?;
        if sight.is_some_and(|sight| sight.hides(u, v, range)) {
            return None;
        }
        // The coarsest image whose pixels are no wider than the voxel; four of them are read.
        Some(means.colour(layer_of(self.t_0 / range, means.count()), u, v))
    }
}

/// How much nearer, as a share of its distance, a surface must be to hide what is behind. Nearer ones hide a strip that is
/// as wide as this share of the parallax between the two sensors: less than a pixel for cameras in one housing. A surface
/// seen at a slant, and the noise of depth, stay below.
const NEARER: f32 = 0.05;

/// How far the colour camera sees: to the nearest surface that was measured there. A camera where the depth sensor is
/// needs none of this, since what it sees the other sees too.
#[derive(Default)]
pub(super) struct Sight {
    columns: usize,
    rows: usize,
    /// Pixels along the side of a cell.
    cell: f32,
    /// The bits of the least range in each cell; those of numbers that are not negative have the numbers' order.
    nearest: Vec<AtomicU32>,
}

impl Sight {
    /// Looks at points on surfaces, which are so many pixels of the colour image apart, or less.
    pub fn compute(
        &mut self,
        eye: &Eye,
        image: &ColourImage,
        spacing: f64,
        points: impl ParallelIterator<Item = [f32; 3]>,
    ) {
        let (width, height) = (image.camera.width, image.camera.height);
        // Cells wider than the distance of two points, so that a surface leaves none of them empty.
        let cell = (spacing.ceil() as usize + 1).min(width.max(height));
        (self.columns, self.rows, self.cell) = (width.div_ceil(cell), height.div_ceil(cell), cell as f32);
        self.nearest.clear();
        self.nearest.resize_with(self.columns * self.rows, || AtomicU32::new(f32::INFINITY.to_bits()));
        points.for_each(|point| {
            if let Some(Projected { u, v, range, .. }) = eye.project(point) {
                let (nearest, bits) = (&self.nearest[self.cell_of(u, v)], range.to_bits());
                // Most are no nearer than what is there, and to look is cheaper than to exchange.
                if bits < nearest.load(Ordering::Relaxed) {
                    nearest.fetch_min(bits, Ordering::Relaxed);
                }
            }
        });
    }

    /// The cell of a place in the image.
    fn cell_of(&self, u: f32, v: f32) -> usize {
        (v / self.cell) as usize * self.columns + (u / self.cell) as usize
    }

    fn hides(&self, u: f32, v: f32, range: f32) -> bool {
        f32::from_bits(self.nearest[self.cell_of(u, v)].load(Ordering::Relaxed)) < range * (1.0 - NEARER)
    }
}
