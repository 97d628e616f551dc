//! Coarser images of a colour image, so that a voxel that covers many pixels can take the mean of them.

use super::ColourImage;
use rayon::prelude::*;

/// The image, and images of half its width and height, down to one pixel.
#[derive(Default)]
pub(super) struct Means {
    levels: Vec<Level>,
}

#[derive(Default)]
struct Level {
    width: usize,
    height: usize,
    /// Red, green, blue, and nothing, so that a pixel is read at once.
    pixels: Vec<[u8; 4]>,
}

/// Parts of a pixel between two texels' centres that interpolation tells apart.
const PARTS: u32 = 256;

impl Means {
    /// Makes the images, into these buffers.
    pub fn compute(&mut self, image: &ColourImage) {
        let (mut width, mut height) = (image.camera.width, image.camera.height);
        let count = width.max(height).next_power_of_two().ilog2() as usize + 1;
        self.levels.resize_with(count, Level::default);
        self.levels[0].fit(width, height);
        let pixels = self.levels[0].pixels.par_iter_mut().zip(image.pixels).with_min_len(1 << 14);
        pixels.for_each(|(out, &[r, g, b])| *out = [r, g, b, 0]);
        for i in 1..count {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            let (finer, coarser) = self.levels.split_at_mut(i);
            coarser[0].fit(width, height);
            coarser[0].halve(&finer[i - 1]);
        }
    }

    /// How many images there are.
    pub fn count(&self) -> usize {
        self.levels.len()
    }

    /// The colour at a place in the image, counted in pixels from its border, out of one of the coarser images:
    /// bilinear between the centres of four of its pixels, those at the border standing for what is beyond.
    pub fn colour(&self, level: usize, u: f32, v: f32) -> [u8; 3] {
        let Level { width, height, pixels } = &self.levels[level];
        let scale = 1.0 / (1u32 << level) as f32;
        let ([left, right], across) = between(u * scale, *width);
        let ([upper, lower], down) = between(v * scale, *height);
        let corners = [(upper, left), (upper, right), (lower, left), (lower, right)];
        let corners = corners.map(|(row, column)| pixels[row * width + column]);
        let weights =
            [(PARTS - down) * (PARTS - across), (PARTS - down) * across, down * (PARTS - across), down * across];
        std::array::from_fn(|channel| {
            let sum: u32 = corners.iter().zip(weights).map(|(pixel, weight)| weight * u32::from(pixel[channel])).sum();
            ((sum + PARTS * PARTS / 2) / (PARTS * PARTS)) as u8
        })
    }
}

/// The two pixels along an axis between whose centres a coordinate lies, and how many parts of the way it is to the second.
fn between(coordinate: f32, size: usize) -> ([usize; 2], u32) {
    let x = coordinate - 0.5;
    let floor = x.floor();
    let last = size as i32 - 1;
    let clamped = |i: i32| i.clamp(0, last) as usize;
    ([clamped(floor as i32), clamped(floor as i32 + 1)], ((x - floor) * PARTS as f32) as u32)
}

impl Level {
    fn fit(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.pixels.resize(width * height, [0; 4]);
    }

    /// Means of 2 x 2 pixels, rounded; the last row and column of odd sizes stand for the ones that are missing.
    fn halve(&mut self, finer: &Level) {
        self.pixels.par_chunks_mut(self.width).with_min_len(32).enumerate().for_each(|(row, out)| {
            let row_at = |row: usize| {
                let row = row.min(finer.height - 1);
                &finer.pixels[row * finer.width..(row + 1) * finer.width]
            };
            let (upper, lower) = (row_at(2 * row), row_at(2 * row + 1));
            for (column, out) in out.iter_mut().enumerate() {
                let (left, right) = (2 * column, (2 * column + 1).min(finer.width - 1));
                let four = [upper[left], upper[right], lower[left], lower[right]];
                *out = std::array::from_fn(|c| {
                    let sum: u16 = four.iter().map(|pixel| u16::from(pixel[c])).sum();
                    ((sum + 2) / 4) as u8
                });
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::PinholeCamera;
    use crate::pose::Pose;

    fn means(pixels: &[[u8; 3]], width: usize, height: usize) -> Means {
        let camera = PinholeCamera::new(width, height, 1.0, 1.0, 0.0, 0.0).unwrap();
        let mut means = Means::default();
        means.compute(&ColourImage::new(pixels, width, height, &camera, &Pose::identity()).unwrap());
        means
    }

    #[test]
    fn each_image_holds_the_means_of_the_finer_one() {
        // 3 x 2 pixels: two of them, then one, in each further image.
        let pixels = [[0, 0, 0], [10, 0, 0], [100, 7, 0], [20, 0, 0], [30, 0, 1], [200, 7, 3]];
        let means = means(&pixels, 3, 2);
        assert_eq!(means.count(), 3);
        assert_eq!(means.colour(1, 1.0, 1.0), [15, 0, 0]);
        assert_eq!(means.colour(1, 3.0, 1.0), [150, 7, 2]);
        assert_eq!(means.colour(2, 0.7, 1.9), [83, 4, 1]);
    }

    #[test]
    fn between_the_centres_of_pixels_colours_are_mixed() {
        let means = means(&[[0, 100, 255], [200, 100, 0]], 2, 1);
        assert_eq!(means.colour(0, 0.5, 0.5), [0, 100, 255]);
        assert_eq!(means.colour(0, 1.0, 0.2), [100, 100, 128]);
        assert_eq!(means.colour(0, 1.25, 0.9), [150, 100, 64]);
        assert_eq!(means.colour(0, 2.0, 0.0), [200, 100, 0]);
        assert_eq!(means.colour(0, 0.0, 1.0), [0, 100, 255]);
    }
}
