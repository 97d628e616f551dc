//! What a Kinect would have measured: noise, disparity steps, and pixels without a reading.

use pyramap::{Error, PinholeCamera, Result};
use rayon::prelude::*;

/// Least and greatest z-depth that is reported, metres.
pub const KINECT_RANGE: [f64; 2] = [0.8, 5.0];

/// Focal length, pixels, times the distance from camera to projector, metres: disparity is this over depth.
const DISPARITY: f64 = 585.0 * 0.075;
/// Disparity comes in steps of this many pixels.
const DISPARITY_STEP: f64 = 0.125;
/// Neighbours whose disparities differ by more than this, in pixels, do not match the pattern across the edge.
const EDGE_DISPARITY: f64 = 1.0;
/// A surface always returns enough light if the cosine between ray and normal is above the first, never below the second.
const GRAZING_COSINES: [f64; 2] = [0.26, 0.09];

/// Turns an exact depth image (z-depth, metres, `0` = no reading) into one like a Kinect's.
///
/// - No reading: outside [`KINECT_RANGE`]; at depth edges; in the projector's shadow, left of near things; and with
///   growing chance where a surface is seen at more than 75 degrees from its normal, always beyond 85.
/// - Axial noise of standard deviation `0.0012 + 0.0019 (z - 0.4)^2` metres (Nguyen, Izadi, Lovell, "Modeling Kinect
///   Sensor Noise for Improved 3D Reconstruction and Tracking", 2012; their term for steep angles, below a
///   millimetre where there are readings, is left out). It is independent from pixel to pixel.
/// - Disparity is rounded to an eighth of a pixel (of 585 pixels' focal length and 0.075 m baseline, whatever
///   `camera` is): steps of 2.8 mm at 1 m and 71 mm at 5 m.
///
/// The same `seed` gives the same image on any number of threads. Use another for each frame.
///
/// # Errors
/// [`Error::Parameter`] if `depth` does not have `width * height` pixels.
pub fn kinect_noise(depth: &[f32], camera: &PinholeCamera, seed: u64) -> Result<Vec<f32>> {
    let PinholeCamera { width, height, .. } = *camera;
    if depth.len() != width * height {
        return Err(Error::Parameter {
            name: "depth image",
            got: format!("{} pixels", depth.len()),
            expected: format!("the camera's height x width = {height} x {width} pixels"),
        });
    }
    let stream = mix(seed);
    let inverse_depth: Vec<f64> = depth.par_iter().map(|&z| if z > 0.0 { 1.0 / f64::from(z) } else { 0.0 }).collect();
    let image = Image { inverse_depth: &inverse_depth, camera };
    let mut noisy = vec![0.0; depth.len()];
    noisy.par_chunks_mut(width).enumerate().for_each(|(v, noisy)| {
        let lit = lit_by_projector(&inverse_depth[v * width..][..width]);
        for (u, noisy) in noisy.iter_mut().enumerate() {
            let pixel = v * width + u;
            let random = Random(stream.wrapping_add(pixel as u64));
            let steps = image.steps(u, v);
            if lit[u] && !is_edge(steps) && image.squared_cosine(u, v, steps) > random.least_cosine().powi(2) {
                *noisy = measured(f64::from(depth[pixel]), &random);
            }
        }
    });
    Ok(noisy)
}

/// Adds noise to a z-depth, rounds its disparity, and checks the range.
fn measured(z: f64, random: &Random) -> f32 {
    let sigma = 0.0012 + 0.0019 * (z - 0.4).powi(2);
    let disparity = DISPARITY / (z + sigma * random.normal());
    // The cast cuts off what is behind the point.
    let steps = (disparity / DISPARITY_STEP + 0.5) as u32;
    let z = DISPARITY / (f64::from(steps) * DISPARITY_STEP);
    if (KINECT_RANGE[0]..=KINECT_RANGE[1]).contains(&z) { z as f32 } else { 0.0 }
}

/// Whether the projector, to the right of the camera, reaches the pixels of a row. Its light meets what pixel `u` shows
/// in its own column `u - disparity`; it has been stopped before if that column serves a pixel farther right.
fn lit_by_projector(inverse_depths: &[f64]) -> Vec<bool> {
    let mut lit = vec![false; inverse_depths.len()];
    let mut leftmost_served = f64::INFINITY;
    for (u, &w) in inverse_depths.iter().enumerate().rev().filter(|(_, w)| **w > 0.0) {
        let column = u as f64 - DISPARITY * w;
        lit[u] = column < leftmost_served;
        leftmost_served = leftmost_served.min(column);
    }
    lit
}

fn is_edge(steps: [[f64; 2]; 2]) -> bool {
    steps.as_flattened().iter().any(|step| step.abs() * DISPARITY > EDGE_DISPARITY)
}

struct Image<'a> {
    /// `0` where there is no surface.
    inverse_depth: &'a [f64],
    camera: &'a PinholeCamera,
}

impl Image<'_> {
    /// Steps of inverse depth from the pixel before and to the pixel after: along u, then along v. At the border of the
    /// image the one stands in for the other.
    fn steps(&self, u: usize, v: usize) -> [[f64; 2]; 2] {
        let PinholeCamera { width, height, .. } = *self.camera;
        let pixel = v * width + u;
        let along = |place: usize, side: usize, stride: usize| {
            let step = |from: usize| self.inverse_depth[from + stride] - self.inverse_depth[from];
            match (place > 0, place + 1 < side) {
                (true, true) => [step(pixel - stride), step(pixel)],
                (true, false) => [step(pixel - stride); 2],
                (false, true) => [step(pixel); 2],
                (false, false) => [0.0; 2],
            }
        };
        [along(u, width, 1), along(v, height, width)]
    }

    /// Square of the cosine of the angle between the ray and the normal of the surface. On a plane `w = n . d` with
    /// `d = (x, y, 1)`, so the gradient in x and y is part of the normal `n`.
    fn squared_cosine(&self, u: usize, v: usize, steps: [[f64; 2]; 2]) -> f64 {
        let PinholeCamera { width, fx, fy, cx, cy, .. } = *self.camera;
        // The smaller of two steps is likelier to stay on the surface.
        let [along_u, along_v] = steps.map(|[a, b]| if a.abs() < b.abs() { a } else { b });
        let w = self.inverse_depth[v * width + u];
        let (x, y) = ((u as f64 - cx) / fx, (v as f64 - cy) / fy);
        let (nx, ny) = (along_u * fx, along_v * fy);
        let nz = w - nx * x - ny * y;
        w * w / ((nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1.0))
    }
}

/// Random numbers of one pixel, a pure function of its place in the stream: SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    /// Uniform between the cosines at which readings are never and always lost.
    fn least_cosine(&self) -> f64 {
        let uniform = (mix(self.0) >> 11) as f64 / (1_u64 << 53) as f64;
        let [always, never] = GRAZING_COSINES;
        never + (always - never) * uniform
    }

    /// Mean 0, variance 1: the sum of four 16-bit uniforms, a bell that ends at 3.5 standard deviations. It needs no
    /// logarithm, whose last bit differs between platforms.
    fn normal(&self) -> f64 {
        let bits = mix(!self.0);
        let sum: u32 = (0..4).map(|i| (bits >> (16 * i)) as u32 & 0xFFFF).sum();
        // Each is uniform on 0..=65535: mean 32767.5, variance (65536^2 - 1) / 12; sqrt(12 / 4) = sqrt(3).
        (f64::from(sum) - 4.0 * 32767.5) / 65536.0 * 3.0_f64.sqrt()
    }
}

/// SplitMix64's step and finaliser.
fn mix(counter: u64) -> u64 {
    let mut z = counter.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
