//! Colour: frames may carry a colour image, and the voxels near the surfaces that they measure keep a mean colour.
//!
//! ```text
//! colour image ──  means     colour/means.rs   coarser images, each pixel the mean of four
//! depth image  ──  near      colour/near.rs    the blocks near the surfaces measured
//!                  stage     colour/stage.rs   of each voxel near a surface, the colour of that surface
//!              ──  sight     colour/sight.rs   what the colour camera sees of it, and what hides it there
//! the map: store.rs, from block coordinates to sums of colours and their number
//! ```
//!
//! The stage runs on the host whatever the map runs on, beside the device, and asks only the images, the sensor model and
//! the voxel size: not the update rule, nor what was culled. So there is one store and one set of bits, on every backend.
//!
//! A frame adds `(red, green, blue, 1)` to each voxel that it colours. These are integers, and a group as evidence is: the
//! order of frames does not matter, a frame can be taken off exactly, and maps can be merged. The mean is only taken when
//! it is asked for.
//!
//! Values are averaged as they come in the image: for photographs that is sRGB, not light.

mod means;
mod near;
mod points;
mod sight;
mod stage;
mod store;

pub use stage::{ColourStage, Paint};
pub use store::{Colours, Sums};

use crate::camera::PinholeCamera;
use crate::error::{Error, Result};
use crate::pose::Pose;

/// The colour of a place: red, green, blue, and 255 if any was seen there. Where none was seen all four are 0.
pub type Rgba = [u8; 4];

/// A colour image that belongs to a depth image, the camera that took it, and where that was.
#[derive(Clone, Copy, Debug)]
pub struct ColourImage<'a> {
    pub(crate) pixels: &'a [[u8; 3]],
    pub(crate) camera: PinholeCamera,
    pub(crate) depth_from_colour: Pose,
}

impl<'a> ColourImage<'a> {
    /// Takes the pixels, red, green and blue, row by row. The pose is that of the colour camera in the frame of the depth
    /// sensor, metres: the identity for images that are registered to the depth.
    ///
    /// # Errors
    /// [`Error::ImageSize`] if image and camera differ; [`Error::Parameter`] if there are not `width * height` pixels.
    pub fn new(
        pixels: &'a [[u8; 3]],
        width: usize,
        height: usize,
        camera: &PinholeCamera,
        depth_from_colour: &Pose,
    ) -> Result<Self> {
        if Some(pixels.len()) != width.checked_mul(height) {
            return Err(Error::Parameter {
                name: IMAGE,
                got: format!("{} pixels", pixels.len()),
                expected: format!("height x width = {height} x {width} pixels"),
            });
        }
        if (width, height) != (camera.width, camera.height) {
            let (got_width, got_height) = (width, height);
            return Err(Error::ImageSize {
                image: IMAGE,
                got_width,
                got_height,
                width: camera.width,
                height: camera.height,
            });
        }
        Ok(Self { pixels, camera: *camera, depth_from_colour: *depth_from_colour })
    }
}

/// What errors call it.
const IMAGE: &str = "colour image";
