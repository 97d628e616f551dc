//! Unorganised point clouds as images: each point goes into the pixel that sees it, and of several the nearest stays.

use super::{DistortedPinhole, Orthographic, Pinhole, Projected, Projection, Sensor, Spherical};

/// An image of ranges made of points.
#[derive(Clone, Debug, PartialEq)]
pub struct RangeImage {
    /// Ranges row by row, metres, as the sensor gives them; `0` where there is no point.
    pub ranges: Vec<f32>,
    /// What is not in it.
    pub lost: LostPoints,
}

/// How many points an image could not take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LostPoints {
    /// Outside of the image, or behind the sensor.
    pub out_of_view: usize,
    /// Behind a nearer point, or as far as another one, in the same pixel.
    pub hidden: usize,
    /// With coordinates that are not finite, or where the sensor itself is.
    pub unusable: usize,
}

impl RangeImage {
    /// Puts points in the sensor's frame, metres, into an image of the sensor.
    pub fn new(points: &[[f64; 3]], sensor: &Sensor) -> Self {
        match sensor {
            Sensor::Pinhole(camera) => match camera.lens() {
                None => Self::projected(points, &Pinhole::new(camera), |column, _| column),
                Some(lens) => Self::projected(points, &DistortedPinhole::new(camera, lens), |column, _| column),
            },
            Sensor::Orthographic(camera) => Self::projected(points, &Orthographic::new(camera), |column, _| column),
            Sensor::Spherical(spherical) => Self::projected(points, &Spherical::new(spherical), |column, row| {
                let (shift, _) = spherical.shift(row);
                (column as isize - shift).rem_euclid(spherical.width() as isize) as usize
            }),
        }
    }

    /// `place` gives the column, in an image as the sensor gives it, of a column and a row of an aligned one.
    fn projected(points: &[[f64; 3]], projection: &impl Projection, place: impl Fn(usize, usize) -> usize) -> Self {
        let [width, height] = projection.image();
        let mut ranges = vec![0.0; width as usize * height as usize];
        let mut lost = LostPoints::default();
        for point in points {
            let point = point.map(|c| c as f32);
            let Projected { u, v, range, in_front } = projection.project(point);
            if !point.iter().all(|c| c.is_finite()) || point == [0.0; 3] {
                lost.unusable += 1;
            } else if !(in_front && (0.0..width).contains(&u) && (0.0..height).contains(&v) && range.is_finite()) {
                lost.out_of_view += 1;
            } else {
                let pixel = &mut ranges[v as usize * width as usize + place(u as usize, v as usize)];
                lost.hidden += usize::from(*pixel > 0.0);
                *pixel = if *pixel > 0.0 && *pixel < range { *pixel } else { range };
            }
        }
        Self { ranges, lost }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::{OrthographicCamera, SphericalSensor};
    use crate::{Depth, DepthImage, GridConfig, OccupancyGrid, PinholeCamera, Pose, UpdateRule};

    /// Points on the pixels' rays come back to their pixels.
    #[test]
    fn an_image_survives_being_taken_apart() {
        let offsets: Vec<f64> = (0..6).map(|row| [0.3, 0.0, -0.5][row % 3]).collect();
        let spinning = SphericalSensor::new(40, &SphericalSensor::even_elevations(6, 0.3, -0.4)).unwrap();
        let sensors: [Sensor; 4] = [
            (&PinholeCamera::new(20, 9, 18.0, 17.0, 9.2, 4.4).unwrap()).into(),
            (&OrthographicCamera::new(20, 9, 18.0, 17.0, 9.2, 4.4).unwrap()).into(),
            (&spinning).into(),
            (&spinning.with_row_offsets(&offsets).unwrap()).into(),
        ];
        for sensor in &sensors {
            let mut points = Vec::new();
            let mut expected = Vec::new();
            for row in 0..sensor.height() {
                for column in 0..sensor.width() {
                    let (ray, range) = (sensor.ray(column, row), 1.0 + 0.01 * column as f64 + 0.1 * row as f64);
                    points.push((ray.start + ray.direction * range).into());
                    expected.push(range as f32);
                }
            }
            let image = RangeImage::new(&points, sensor);
            assert_eq!(image.lost, LostPoints::default());
            // Two roundings of coordinates, and those of the length.
            assert!(image.ranges.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6 * b), "{sensor:?}");
            // And it is an image that a map takes.
            let mut config = GridConfig::new(0.1).unwrap();
            config.update = UpdateRule::Area;
            let readings = DepthImage::of_ranges(Depth::F32(&image.ranges), sensor.width(), sensor.height()).unwrap();
            OccupancyGrid::new(config).unwrap().integrate(&readings, sensor, &Pose::identity()).unwrap();
        }
    }

    #[test]
    fn what_is_lost_is_counted() {
        let camera = Sensor::from(&PinholeCamera::new(3, 3, 1.0, 1.0, 1.0, 1.0).unwrap());
        let nan = f64::NAN;
        let points = [
            [0.0, 0.0, 2.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, 3.0],
            [9.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
            [0.0, nan, 1.0],
            [f64::INFINITY, 0.0, 1.0],
            [0.0, 0.0, 0.0],
        ];
        let image = RangeImage::new(&points, &camera);
        assert_eq!(image.lost, LostPoints { out_of_view: 2, hidden: 2, unusable: 3 });
        assert_eq!(image.ranges, [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
