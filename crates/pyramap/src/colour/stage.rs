//! The stage: of each voxel near a surface that a frame measured, the colour of that surface.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together, by their number")]

use super::ColourImage;
use super::means::Means;
use super::near::{Near, PixelRays, is_surface};
use super::sight::{Eye, Sight};
use crate::block::{BLOCK_EDGE, BLOCK_VOXELS, BlockKey};
use crate::config::GridConfig;
use crate::depth::DepthImage;
use crate::error::Result;
use crate::pose::Pose;
use crate::ranges::Ranges;
use crate::sensors::{DistortedPinhole, Orthographic, Pinhole, Projected, Projection, Sensor, Spherical};
use crate::surfaces::texel;
use crate::update::UpdateRule;
use crate::view::{Lanes, Points, View};
use rayon::prelude::*;

/// What a frame adds to the voxels of a block: red, green, blue and 1, or four zeros, in the order of
/// [`voxel_offset`](crate::block::voxel_offset).
pub type Paint = [[u8; 4]; BLOCK_VOXELS];

/// Buffers of the stage, kept from frame to frame.
#[derive(Default)]
pub struct ColourStage {
    ranges: Ranges,
    rays: PixelRays,
    means: Means,
    sight: Sight,
}

impl ColourStage {
    /// What a frame adds to the colours of blocks, sorted by key.
    ///
    /// # Errors
    /// As [`Ranges::compute`].
    pub fn see(
        &mut self,
        config: &GridConfig,
        image: &DepthImage,
        colour: &ColourImage,
        sensor: &Sensor,
        pose: &Pose,
    ) -> Result<Vec<(BlockKey, Box<Paint>)>> {
        self.ranges.compute(image, sensor, config.max_range, config.beyond_max_range)?;
        self.means.compute(colour);
        let model = image.sensor_model.unwrap_or(config.sensor_model);
        let asked = (config.update != UpdateRule::Rays).then_some(&model);
        let (r, max_range) = (config.voxel_size, config.max_range);
        let near = Near::new(asked, r, max_range);
        Ok(match sensor {
            Sensor::Pinhole(camera) => match camera.lens() {
                None => self.paint(sensor, &View::new(Pinhole::new(camera), pose, r, max_range), near, colour),
                Some(lens) => {
                    let projection = DistortedPinhole::new(camera, lens);
                    self.paint(sensor, &View::new(projection, pose, r, max_range), near, colour)
                }
            },
            Sensor::Spherical(spherical) => {
                self.paint(sensor, &View::new(Spherical::new(spherical), pose, r, max_range), near, colour)
            }
            Sensor::Orthographic(camera) => {
                self.paint(sensor, &View::new(Orthographic::new(camera), pose, r, max_range), near, colour)
            }
        })
    }

    fn paint<P: Projection>(
        &mut self,
        sensor: &Sensor,
        view: &View<P>,
        near: Near,
        colour: &ColourImage,
    ) -> Vec<(BlockKey, Box<Paint>)> {
        let (eye, focal) = (Eye::new(colour, view.voxel_size), view.projection.focal_length());
        let pixel = 1.0 / focal;
        let farthest = f64::from(view.projection.apparent_distance(view.max_range));
        self.rays.fit(sensor, pixel * farthest, BLOCK_EDGE as f64 * view.voxel_size);
        let displaced = colour.depth_from_colour.translation.norm() > 0.0;
        if displaced {
            // Two neighbouring pixels are about so many pixels of the colour image apart; no more than two are enough.
            let spacing = colour.camera.focal_length() / focal;
            let step = (2.0 / spacing).max(1.0) as usize;
            self.sight.compute(&eye, colour, step as f64 * spacing, self.rays.surfaces(&self.ranges, step));
        }
        let keys = self.rays.blocks(&self.ranges, near, &view.pose, view.voxel_size, pixel as f32);
        let frame = Frame {
            view,
            near,
            ranges: &self.ranges,
            rows: rows(view),
            eye,
            means: &self.means,
            sight: displaced.then_some(&self.sight),
        };
        keys.into_par_iter().with_min_len(4).filter_map(|key| Some((key, frame.paint(key)?))).collect()
    }
}

/// The voxels of a block in rows along z, relative to its centre.
fn rows<P: Projection>(view: &View<P>) -> Vec<Points> {
    let from_centre = |i: usize| i as f64 - (BLOCK_EDGE as f64 - 1.0) / 2.0;
    let row = |n: usize| {
        let (x, y) = (n / BLOCK_EDGE, n % BLOCK_EDGE);
        view.voxel_offsets(|z| [x, y, z].map(from_centre))
    };
    (0..BLOCK_EDGE * BLOCK_EDGE).map(row).collect()
}

/// What is asked for each block.
struct Frame<'a, P: Projection> {
    view: &'a View<P>,
    near: Near,
    ranges: &'a Ranges,
    rows: Vec<Points>,
    eye: Eye,
    means: &'a Means,
    sight: Option<&'a Sight>,
}

impl<P: Projection> Frame<'_, P> {
    /// What is added to a block; nothing if no voxel of it gets a colour.
    fn paint(&self, key: BlockKey) -> Option<Box<Paint>> {
        let centre = self.view.to_camera(&self.view.offset_of(key, 1));
        let mut paint = None;
        for (n, row) in self.rows.iter().enumerate() {
            let points = row.moved(centre);
            let Surfaces { measured, range } = self.surfaces(&points);
            for lane in 0..BLOCK_EDGE {
                if measured[lane] == 0.0 {
                    continue;
                }
                let surface = surface_on_ray::<P>(points.lane(lane), range[lane], measured[lane]);
                if let Some([r, g, b]) = self.eye.colour(surface, self.means, self.sight) {
                    let paint = paint.get_or_insert_with(|| Box::new([[0; 4]; BLOCK_VOXELS]));
                    paint[n * BLOCK_EDGE + lane] = [r, g, b, 1];
                }
            }
        }
        paint
    }

    /// The surfaces that eight voxels lie near: what was measured at the pixels that their centres are in (Eq. 13).
    #[inline(always)]
    fn surfaces(&self, points: &Points) -> Surfaces {
        let [width, height] = self.view.projection.image();
        let mut surfaces = Surfaces { measured: [0.0; 8], range: [0.0; 8] };
        for n in 0..8 {
            let Projected { u, v, range, in_front } = self.view.projection.project(points.lane(n));
            let seen = in_front & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height);
            let pixel =
                texel(v, self.ranges.height) as usize * self.ranges.width + texel(u, self.ranges.width) as usize;
            let measured = self.ranges.values[pixel];
            let [from, to] = self.near.part(measured);
            let near = seen & is_surface(measured) & (range >= from) & (range <= to);
            surfaces.measured[n] = if near { measured } else { 0.0 };
            surfaces.range[n] = range;
        }
        surfaces
    }
}

/// Eight voxels and their surfaces.
struct Surfaces {
    /// How far off each surface is; 0 where none is near.
    measured: Lanes,
    /// How far off each voxel is.
    range: Lanes,
}

/// The surface on the ray of a voxel. Its colour is asked for, not that of what another camera sees behind the voxel.
#[inline(always)]
fn surface_on_ray<P: Projection>([x, y, z]: [f32; 3], range: f32, measured: f32) -> [f32; 3] {
    if P::PERSPECTIVE {
        let further = measured / range;
        [x * further, y * further, z * further]
    } else {
        [x, y, measured]
    }
}
