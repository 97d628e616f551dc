//! What the shaders must know of a sensor.

use crate::gpu::Gpu;
use pyramap::error::Result;
use pyramap::sensors::{DistortedPinhole, Orthographic, Pinhole, Projection, Spherical};
use pyramap_shaders::SensorKind;
use pyramap_shaders::layout::{Cube, Distortion, Frame, Sphere};
use wgpu::{Buffer, BufferUsages};

/// A projection that shaders know.
pub trait Described: Projection {
    /// Which kernels it has.
    fn kind(&self) -> SensorKind;
    /// Fills in what is the same for all points.
    fn describe(&self, frame: &mut Frame);
    /// Fills in how far a cube reaches.
    fn describe_cube(size: &Self::Size, cube: &mut Cube);
    /// The table of rows, if there is one.
    fn rows(&self) -> Option<&[[f32; 2]]>;
}

impl Described for Pinhole {
    fn kind(&self) -> SensorKind {
        SensorKind::Pinhole
    }

    fn describe(&self, frame: &mut Frame) {
        frame.sides = self.sides.map(|[x, y, z]| [x, y, z, 0.0]);
        (frame.focal, frame.principal) = (self.focal, self.principal);
    }

    fn describe_cube(size: &Self::Size, cube: &mut Cube) {
        (cube.across_sides, cube.depth) = (size.across_sides, size.depth);
    }

    fn rows(&self) -> Option<&[[f32; 2]]> {
        None
    }
}

impl Described for DistortedPinhole {
    fn kind(&self) -> SensorKind {
        SensorKind::DistortedPinhole
    }

    fn describe(&self, frame: &mut Frame) {
        self.plain.describe(frame);
        let ([k1, k2, p1, p2, k3], [[a, b], [c, d]]) = (self.coefficients, self.stretch);
        frame.distortion =
            Distortion { stretch: [a, b, c, d], k1, k2, p1, p2, k3, radius: self.radius, ..Distortion::default() };
    }

    fn describe_cube(size: &Self::Size, cube: &mut Cube) {
        Pinhole::describe_cube(size, cube);
    }

    fn rows(&self) -> Option<&[[f32; 2]]> {
        None
    }
}

impl Described for Spherical<'_> {
    fn kind(&self) -> SensorKind {
        SensorKind::Spherical
    }

    /// Numbers of columns are multiples of the step, which is a power of two: nothing is rounded here.
    fn describe(&self, frame: &mut Frame) {
        frame.sphere = Sphere {
            step: self.step,
            steps_per_radian: self.columns_per_radian / self.step,
            middle: self.middle / self.step,
            turn: self.turn / self.step,
            unaligned: self.unaligned,
            first_elevation: self.rows.start,
            intervals_per_radian: self.rows.intervals_per_radian,
            wraps: u32::from(self.wraps()),
        };
    }

    fn describe_cube(_: &(), _: &mut Cube) {}

    fn rows(&self) -> Option<&[[f32; 2]]> {
        Some(&self.rows.entries)
    }
}

impl Described for Orthographic {
    fn kind(&self) -> SensorKind {
        SensorKind::Orthographic
    }

    fn describe(&self, frame: &mut Frame) {
        (frame.focal, frame.principal) = (self.pixels_per_metre, self.principal);
    }

    fn describe_cube(size: &Self::Size, cube: &mut Cube) {
        let [columns, rows] = size.pixels;
        (cube.across_sides, cube.depth) = ([columns, rows, 0.0, 0.0], size.depth);
        cube.depth_of_voxels = cube.voxels * size.depth_of_unit;
    }

    fn rows(&self) -> Option<&[[f32; 2]]> {
        None
    }
}

/// A buffer with a table in it.
///
/// # Errors
/// As [`Gpu::buffer`].
pub fn table<T: bytemuck::NoUninit>(gpu: &Gpu, label: &str, entries: &[T]) -> Result<Buffer> {
    let bytes: &[u8] = bytemuck::cast_slice(entries);
    let buffer = gpu.buffer(label, bytes.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
    gpu.write(&buffer, 0, bytes)?;
    Ok(buffer)
}
