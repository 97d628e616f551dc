//! Every sensor: the cull changes nothing, bounds hold, and where an image begins and ends does not matter.

use pyramap::block::{BLOCK_VOXELS, BlockKey, Blocks};
use pyramap::cull::{Eighths, LayersRead, Reads};
use pyramap::sensors::{DistortedPinhole, Orthographic, Pinhole, Projection, Spherical};
use pyramap::view::View;
use pyramap::{
    Depth, DepthImage, Distortion, GridConfig, OccupancyGrid, OrthographicCamera, PinholeCamera, Pose, Sensor,
    SensorModel, SphericalSensor, SurfaceOffset, UpdateRule,
};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Numbers that look random, the same in every run, from 0 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// A turn by two angles, away from the origin.
fn pose(n: usize) -> Pose {
    let (a, b) = (0.3 + 0.7 * n as f64, 0.15 * (n as f64 + 1.0).cos());
    let ([s, c], [t, d]) = ([a.sin(), a.cos()], [b.sin(), b.cos()]);
    Pose::from_rows(&[
        [c, -s * d, s * t, 0.3 * n as f64 - 0.4],
        [s, c * d, -c * t, 0.2],
        [0.0, t, d, 0.1 * n as f64],
        [0.0, 0.0, 0.0, 1.0],
    ])
    .unwrap()
}

/// What a sensor reads in a room of 5 x 4 x 3 m with a pillar, noise, holes, and places without return.
fn room(sensor: &Sensor, pose: &Pose, seed: u64) -> Vec<f32> {
    let mut random = Random(seed);
    let mut values = Vec::new();
    for row in 0..sensor.height() {
        for column in 0..sensor.width() {
            let ray = sensor.ray(column, row);
            let (start, along) = (pose.rotation * ray.start + pose.translation, pose.rotation * ray.direction);
            let walls = (0..3).map(|k| ([2.5_f64, 2.0, 1.5][k].copysign(along[k]) - start[k]) / along[k]);
            let room = walls.fold(f64::INFINITY, f64::min);
            // An upright pillar of 0.3 m radius at (1.2, -0.9).
            let (x, y) = (start.x - 1.2, start.y + 0.9);
            let (a, b) = (along.x * along.x + along.y * along.y, x * along.x + y * along.y);
            let discriminant = b * b - a * (x * x + y * y - 0.09);
            let pillar = (-b - discriminant.max(0.0).sqrt()) / a;
            let hit = if discriminant > 0.0 && pillar > 0.0 { room.min(pillar) } else { room };
            values.push(match random.next() {
                r if r < 0.02 => 0.0,
                r if r < 0.03 => f32::INFINITY,
                r => (hit + 0.01 * (r - 0.5)) as f32,
            });
            if (column / 9 + row / 5).is_multiple_of(17) {
                *values.last_mut().unwrap() = f32::NAN;
            }
        }
    }
    values
}

fn spinning(width: usize, height: usize) -> SphericalSensor {
    SphericalSensor::new(width, &SphericalSensor::even_elevations(height, 0.5, -0.6)).unwrap()
}

/// Sensors of every kind, with the rules' corner cases: odd widths, sectors, uneven and rising beams, shifted rows.
fn sensors() -> Vec<(&'static str, Sensor)> {
    let uneven: Vec<f64> = (0..24).map(|i| 0.3 - 0.02 * f64::from(i) - 0.0006 * f64::from(i * i)).collect();
    let rising: Vec<f64> = uneven.iter().rev().copied().collect();
    let offsets: Vec<f64> = (0..32).map(|row| [0.055, 0.018, -0.018, -0.055][row % 4]).collect();
    let lens = |fx: f64, coefficients| {
        let camera = PinholeCamera::new(80, 60, fx, 1.02 * fx, 41.3, 27.9).unwrap();
        Sensor::from(&camera.with_distortion(Distortion::from_coefficients(coefficients)).unwrap())
    };
    vec![
        ("a barrel lens", lens(60.0, [-0.28, 0.07, 0.0, 0.0, 0.0])),
        ("a pincushion lens", lens(70.0, [0.15, 0.02, 0.001, -0.002, 0.01])),
        ("a lens that folds back in the image", lens(60.0, [-0.4, 0.0, 0.004, 0.0, 0.0])),
        ("a full turn", (&spinning(256, 32)).into()),
        ("an odd number of columns", (&spinning(225, 24).with_azimuths(2.0, TAU).unwrap()).into()),
        ("uneven beams", (&SphericalSensor::new(192, &uneven).unwrap()).into()),
        ("a sector", (&SphericalSensor::new(100, &rising).unwrap().with_azimuths(3.0, -2.1).unwrap()).into()),
        ("nearly all around", (&spinning(200, 20).with_azimuths(-1.0, 6.0).unwrap()).into()),
        ("shifted rows", (&spinning(256, 32).with_row_offsets(&offsets).unwrap()).into()),
        ("a pinhole", (&PinholeCamera::new(80, 60, 70.0, 72.0, 41.3, 27.9).unwrap()).into()),
        ("one row", (&SphericalSensor::new(360, &[0.0]).unwrap()).into()),
        ("parallel rays", (&OrthographicCamera::new(70, 60, 25.0, 31.0, 22.0, 40.5).unwrap()).into()),
    ]
}

fn config(voxel_size: f64, update: UpdateRule) -> GridConfig {
    let mut config = GridConfig::new(voxel_size).unwrap();
    config.update = update;
    config.max_range = 3.2;
    config.sensor_model = SensorModel::new([0.02, 0.0, 0.004], None, SurfaceOffset::Centred).unwrap();
    config
}

fn fuse(grid: &mut OccupancyGrid, sensor: &Sensor, values: &[f32], pose: &Pose) {
    let image = DepthImage::of_ranges(Depth::F32(values), sensor.width(), sensor.height()).unwrap();
    grid.integrate(&image, sensor, pose).unwrap();
}

/// All evidence of a map, block by block, unknown blocks left out.
fn contents(grid: &OccupancyGrid) -> BTreeMap<BlockKey, Vec<i32>> {
    let values = |key| (0..BLOCK_VOXELS).map(|i| grid.block(key).unwrap().value(i)).collect::<Vec<_>>();
    grid.keys().into_iter().map(|key| (key, values(key))).filter(|(_, v)| v.iter().any(|&e| e != 0)).collect()
}

#[test]
fn the_cull_changes_no_bit() {
    for (name, sensor) in sensors() {
        for update in [UpdateRule::Pyramid, UpdateRule::Area, UpdateRule::MinLayer, UpdateRule::Ideal] {
            for voxel_size in if update == UpdateRule::Ideal { vec![0.12] } else { vec![0.04, 0.12, 0.4] } {
                let maps = [true, false].map(|cull| {
                    let mut config = config(voxel_size, update);
                    config.cull = cull;
                    let mut grid = OccupancyGrid::new(config).unwrap();
                    for n in 0..2 {
                        fuse(&mut grid, &sensor, &room(&sensor, &pose(n), n as u64), &pose(n));
                    }
                    contents(&grid)
                });
                assert!(maps[0].len() > 3, "a map of {} blocks shows nothing", maps[0].len());
                assert!(maps[0] == maps[1], "{name}: {update:?} at {voxel_size} m");
            }
        }
    }
}

#[test]
fn the_cull_does_something() {
    let sensor = Sensor::from(&spinning(1024, 64));
    let mut grid = OccupancyGrid::new(config(0.04, UpdateRule::Pyramid)).unwrap();
    let walls = vec![2.5; 1024 * 64];
    let image = DepthImage::of_ranges(Depth::F32(&walls), 1024, 64).unwrap();
    let stats = grid.integrate(&image, &sensor, &Pose::identity()).unwrap();
    assert!(stats.blocks_free > 400, "{stats:?}");
}

/// Turning the image and the azimuth of its first column alike is no change at all.
#[test]
fn where_the_image_begins_does_not_matter() {
    let (width, height) = (256, 32);
    let sensor = spinning(width, height);
    let values = room(&Sensor::from(&sensor), &pose(1), 5);
    let map = |sensor: &SphericalSensor, values: &[f32], update| {
        let mut grid = OccupancyGrid::new(config(0.05, update)).unwrap();
        fuse(&mut grid, &sensor.into(), values, &pose(1));
        contents(&grid)
    };
    // The pyramid has six layers: windows of 32 columns, which must stay the same windows.
    for (update, columns) in [(UpdateRule::Area, 77), (UpdateRule::Pyramid, 96), (UpdateRule::MinLayer, 160)] {
        let turned = sensor.with_azimuths(-TAU * columns as f64 / width as f64, -TAU).unwrap();
        let mut rolled = values.clone();
        rolled.chunks_mut(width).for_each(|row| row.rotate_left(columns));
        let (expected, got) = (map(&sensor, &values, update), map(&turned, &rolled, update));
        assert!(expected.len() > 100);
        assert!(expected == got, "{update:?}");
        // The test sees a difference of one column.
        rolled.chunks_mut(width).for_each(|row| row.rotate_left(1));
        assert!(expected != map(&turned, &rolled, update));
    }
}

/// Rows shifted by whole columns are the same image once they are shifted back.
#[test]
fn rows_are_aligned() {
    let (width, height) = (256, 32);
    let plain = spinning(width, height);
    let columns: Vec<usize> = (0..height).map(|row| [3, 1, 250, 0][row % 4]).collect();
    // Columns go clockwise: to look further in the sense of azimuth is to look at earlier columns.
    let offsets: Vec<f64> = columns.iter().map(|&n| -TAU * n as f64 / width as f64).collect();
    let shifted = plain.with_row_offsets(&offsets).unwrap();
    let values = room(&Sensor::from(&plain), &pose(0), 9);
    let mut staggered = values.clone();
    staggered.chunks_mut(width).zip(&columns).for_each(|(row, &n)| row.rotate_left(n));
    for update in [UpdateRule::Pyramid, UpdateRule::Area, UpdateRule::Ideal, UpdateRule::Rays] {
        let [a, b] = [(&plain, &values), (&shifted, &staggered)].map(|(sensor, values)| {
            let mut grid = OccupancyGrid::new(config(0.1, update)).unwrap();
            fuse(&mut grid, &sensor.into(), values, &pose(0));
            grid
        });
        if matches!(update, UpdateRule::Pyramid | UpdateRule::Area) {
            assert!(contents(&a) == contents(&b), "{update:?}");
        } else {
            // Cosine and sine of what remains are 1 and 0 but for rounding, which may decide whether a ray cuts a corner.
            let (a, b) = (contents(&a), contents(&b));
            let differing = a.iter().filter(|(key, values)| b.get(*key) != Some(*values)).count();
            assert!(differing * 50 < a.len(), "{update:?}: {differing} of {} blocks differ", a.len());
        }
    }
}

/// Reads nothing but the voxel's cube.
struct WholeVoxel;

impl Reads for WholeVoxel {
    const REACH: f32 = 0.0;
    const HALF_EDGE: f64 = 0.5;

    fn layers(&self, _: f32, _: f32) -> LayersRead {
        LayersRead { first: 0, last: 0, fallback: false, certain: true }
    }
}

/// Cubes of all sizes at random places, and random points in them.
fn check_outlines<P: Projection>(name: &str, projection: P) {
    let mut random = Random(11);
    let view = View::new(projection, &pose(2), 0.1, 10.0);
    let [width, height] = view.projection.image();
    let mut bounded = 0;
    for edge in [2, 4, 16, 64] {
        let eighths = Eighths::new::<WholeVoxel>(&view, edge);
        let reach = f64::from(eighths.projected) + 1e-3;
        for _ in 0..3000 {
            // Near places are the hard ones.
            let scale = reach * 40f64.powf(random.next());
            let place: [f64; 3] = std::array::from_fn(|_| random.within(-scale, scale));
            let centre = place.map(|c| c as f32);
            let [low, high] = view.projection.ranges(&eighths, centre);
            let outline = view.projection.outline(&eighths, centre, high);
            bounded += usize::from(outline.bounded);
            for _ in 0..20 {
                let at = |half: f32, part: [f64; 3]| -> [f32; 3] {
                    std::array::from_fn(|k| {
                        let moved = (0..3).map(|a| f64::from(eighths.axes[a][k]) * f64::from(half) * part[a]);
                        (place[k] + moved.sum::<f64>()) as f32
                    })
                };
                // Corners and faces as well as what is inside.
                let part: [f64; 3] = std::array::from_fn(|_| random.within(-1.6, 1.6).clamp(-1.0, 1.0));
                let range = view.projection.project(at(eighths.voxels, part)).range;
                assert!((low..=high).contains(&range), "{name}: {range} is not within {low} to {high}");
                let pixel = view.projection.project(at(eighths.projected, part));
                let seen = pixel.in_front && (0.0..width).contains(&pixel.u) && (0.0..height).contains(&pixel.v);
                let what = format!("{name}: {pixel:?} of a cube at {centre:?}, edge {edge}, {outline:?}");
                assert!(outline.in_sight || !seen, "{what}");
                assert!(seen || !outline.inside, "{what}");
                if outline.bounded && pixel.in_front {
                    let wraps = view.projection.wraps();
                    let turns: &[f32] = if wraps { &[-width, 0.0, width] } else { &[0.0] };
                    let [left, right] = outline.columns;
                    // What lies beyond the image is read at its border.
                    let within = |u: f32, low: f32, high: f32, side: f32| {
                        let clamped = |u: f32| u.clamp(0.0, side);
                        clamped(low) <= clamped(u) && clamped(u) <= clamped(high)
                    };
                    let column = |turn: &f32| {
                        let u = pixel.u + turn;
                        if wraps { left <= u && u <= right } else { within(u, left, right, width) }
                    };
                    assert!(turns.iter().any(column) || (!wraps && !outline.in_sight), "{what}");
                    let [top, bottom] = outline.rows;
                    assert!(within(pixel.v, top, bottom, height), "{what}");
                }
            }
        }
    }
    assert!(bounded > 3000, "{name}: only {bounded} cubes have an outline");
}

#[test]
fn outlines_hold_all_of_a_cube() {
    for (name, sensor) in sensors() {
        match &sensor {
            Sensor::Spherical(sensor) => check_outlines(name, Spherical::new(sensor)),
            Sensor::Orthographic(camera) => check_outlines(name, Orthographic::new(camera)),
            Sensor::Pinhole(camera) => match camera.lens() {
                Some(lens) => check_outlines(name, DistortedPinhole::new(camera, lens)),
                None => check_outlines(name, Pinhole::new(camera)),
            },
        }
    }
}

#[test]
fn pixels_of_lenses_project_onto_their_rays() {
    for (name, sensor) in sensors() {
        let Sensor::Pinhole(camera) = &sensor else { continue };
        let Some(lens) = camera.lens() else { continue };
        let projection = DistortedPinhole::new(camera, lens);
        let mut blind = 0;
        for (row, column) in (0..60).flat_map(|row| (0..80).map(move |column| (row, column))) {
            let direction = camera.ray(column, row).direction;
            if direction.x.is_nan() {
                blind += 1;
                continue;
            }
            let pixel = projection.project((direction * 2.0).cast::<f32>().into());
            let off = (pixel.u - (column as f32 + 0.5)).abs().max((pixel.v - (row as f32 + 0.5)).abs());
            assert!(off < 1e-3 && pixel.in_front, "{name}: {pixel:?} of {column}, {row}");
        }
        // The third lens brings nothing to the corners.
        assert_eq!(blind > 0, name.contains("folds"), "{name}: {blind} pixels see nothing");
        assert!(blind < 2000, "{name}: {blind} pixels see nothing");
    }
}

#[test]
fn pixels_project_onto_their_rays() {
    for (name, sensor) in sensors() {
        let Sensor::Spherical(spherical) = &sensor else { continue };
        let projection = Spherical::new(spherical);
        for row in 0..sensor.height() {
            for column in 0..sensor.width() {
                let point = projection.ray(column, row).direction * 2.0;
                let pixel = projection.project([point.x as f32, point.y as f32, point.z as f32]);
                // Rows shifted by parts of a column may be off by half of one; beams that lie unevenly by a 64th of a row,
                // and rounding makes a thousandth.
                let slack = if spherical.row_offsets().is_empty() { 2e-3 } else { 0.502 };
                assert!((pixel.u - (column as f32 + 0.5)).abs() < slack, "{name}: {pixel:?} of {column}, {row}");
                assert!((pixel.v - (row as f32 + 0.5)).abs() < 0.018, "{name}: {pixel:?} of {column}, {row}");
                assert!((pixel.range - 2.0).abs() < 1e-6 && pixel.in_front);
            }
        }
    }
    // And an image as it comes has the azimuths that it was said to have.
    let sensor = spinning(8, 3).with_azimuths(1.0, -TAU).unwrap().with_row_offsets(&[0.0, 0.3, -0.3]).unwrap();
    for (row, offset) in [0.0, 0.3, -0.3].into_iter().enumerate() {
        for column in 0..8 {
            let direction = sensor.ray(column, row).direction;
            let expected = 1.0 - TAU * column as f64 / 8.0 + offset;
            let off = (direction.y.atan2(direction.x) - expected).rem_euclid(TAU);
            assert!(off.min(TAU - off) < 1e-12);
            assert!((direction.z.asin() - sensor.elevations()[row]).abs() < 1e-12);
        }
    }
}

#[test]
fn what_is_no_sensor_is_refused() {
    let message = |sensor: pyramap::Result<SphericalSensor>| sensor.unwrap_err().to_string();
    let good = spinning(64, 8);
    for (refused, expected) in [
        (SphericalSensor::new(0, &[0.1]), "width is 0, expected 1 to 16384 pixels"),
        (SphericalSensor::new(16_385, &[0.1]), "width is 16385"),
        (SphericalSensor::new(10, &[]), "height is 0"),
        (SphericalSensor::new(10, &[0.1, f64::NAN]), "elevations is NaN in row 1"),
        (SphericalSensor::new(10, &[PI / 2.0]), "elevations is 1.57"),
        (SphericalSensor::new(10, &[0.1, 0.1]), "elevations is 0.1 in row 0 and 0.1 in the next"),
        (SphericalSensor::new(10, &[0.1, 0.2, 0.15]), "elevations is 0.2 in row 1 and 0.15 in the next"),
        (good.with_azimuths(f64::INFINITY, 1.0), "first_azimuth is inf"),
        (good.with_azimuths(0.0, 0.0), "azimuth_span is 0"),
        (good.with_azimuths(0.0, 6.3), "azimuth_span is 6.3"),
        (good.with_azimuths(0.0, f64::NAN), "azimuth_span is NaN"),
        (good.with_azimuths(0.0, 0.02), "azimuth_span is 0.02 for 64 columns"),
        (good.with_row_offsets(&[0.1]), "row_offsets is 1 numbers, expected one for each of 8 rows"),
        (good.with_row_offsets(&[f64::NAN; 8]), "row_offsets is NaN in row 0"),
        (good.with_azimuths(0.0, 1.0).unwrap().with_row_offsets(&[0.1; 8]), "row_offsets is given for a sensor of 1"),
    ] {
        let got = message(refused);
        assert!(got.starts_with(expected), "{got:?}, expected {expected:?}");
    }
}
