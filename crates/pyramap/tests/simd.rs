//! Whatever instructions a frame is seen with, not a bit of it differs.

use pyramap::block::BlockData;
use pyramap::cull::{CullBuffers, Culled, Scope, cull};
use pyramap::pyramid::Pyramid as Layers;
use pyramap::ranges::Ranges;
use pyramap::sensor::SensorTable;
use pyramap::sensors::{DistortedPinhole, Orthographic, Pinhole, Projection, Spherical};
use pyramap::simd::Instructions;
use pyramap::surfaces::compute;
use pyramap::update::{Change, Rule, area::Area, min_layer::MinLayer, pyramid::Pyramid, update};
use pyramap::view::View;
use pyramap::{
    Depth, DepthImage, Distortion, GridConfig, OrthographicCamera, PinholeCamera, Pose, Sensor, SensorModel,
    SphericalSensor, SurfaceOffset, UpdateRule,
};

const WIDTH: usize = 128;
const HEIGHT: usize = 90;

/// A slanted wall with pillars, holes, and corners without return, at every distance from very near to out of range.
fn ranges() -> Vec<f32> {
    let pixel = |u: usize, v: usize| match (u * 7919 + v * 104_729) % 97 {
        0..4 => 0.0,
        _ if u < 12 && v < 30 => f32::INFINITY,
        _ if u % 31 < 6 => 0.15 + 0.01 * v as f32,
        noise => 0.8 + 0.05 * u as f32 - 0.01 * v as f32 + 0.0005 * noise as f32,
    };
    (0..WIDTH * HEIGHT).map(|i| pixel(i % WIDTH, i / WIDTH)).collect()
}

/// A turn about all axes, and a step aside.
fn pose() -> Pose {
    let (s, c) = 0.4f64.sin_cos();
    let rows = [[c, -s, 0.0, 0.37], [s * c, c * c, -s, -1.21], [s * s, s * c, c, 0.53], [0.0, 0.0, 0.0, 1.0]];
    Pose::from_rows(&rows).unwrap()
}

/// The blocks of a frame, and what happens to each mixed one.
#[derive(PartialEq)]
struct Seen {
    culled: Culled,
    changes: Vec<Change>,
    increments: Vec<BlockData>,
}

fn seen<P: Projection>(config: &GridConfig, sensor: &Sensor, projection: P, instructions: Instructions) -> Seen {
    let view = View::new(projection, &pose(), config.voxel_size, config.max_range);
    let (t_0, count) = (view.t_0 as f32, view.projection.num_layers());
    match config.update {
        UpdateRule::MinLayer => by_rule(config, sensor, &view, &MinLayer { t_0, count }, instructions),
        UpdateRule::Area => by_rule(config, sensor, &view, &Area::new(&view), instructions),
        _ => by_rule(config, sensor, &view, &Pyramid { t_0, count }, instructions),
    }
}

fn by_rule<P: Projection, R: Rule<P>>(
    config: &GridConfig,
    sensor: &Sensor,
    view: &View<P>,
    rule: &R,
    instructions: Instructions,
) -> Seen {
    let values = self::ranges();
    let image = DepthImage::of_ranges(Depth::F32(&values), WIDTH, HEIGHT).unwrap();
    let (model, table) = (&config.sensor_model, SensorTable::new(&config.sensor_model));
    let (mut ranges, mut layers, mut surfaces) = (Ranges::default(), Layers::default(), Vec::new());
    ranges.compute(&image, sensor, config.max_range, config.beyond_max_range).unwrap();
    let wanted = config.update.layers(view, view.projection.num_layers());
    layers.compute(&ranges, view.t_0, config.update.selection::<P>(), wanted.clone());
    let (sampling, wraps) = (config.update.sampling(), view.projection.wraps());
    compute(&mut surfaces, &layers.layers, wanted, (model, &table), sampling, wraps);
    let scope = Scope { view, layers: &surfaces, rule, enabled: config.cull, instructions };
    let (mut culled, mut increments, mut changes) = (Culled::default(), Vec::new(), Vec::new());
    cull(&scope, &mut CullBuffers::default(), &mut culled);
    update(&scope, &table, &culled.mixed, &mut increments, &mut changes);
    Seen { culled, changes, increments }
}

fn seen_by(config: &GridConfig, sensor: &Sensor, instructions: Instructions) -> Seen {
    match sensor {
        Sensor::Pinhole(camera) => match camera.lens() {
            None => seen(config, sensor, Pinhole::new(camera), instructions),
            Some(lens) => seen(config, sensor, DistortedPinhole::new(camera, lens), instructions),
        },
        Sensor::Spherical(it) => seen(config, sensor, Spherical::new(it), instructions),
        Sensor::Orthographic(it) => seen(config, sensor, Orthographic::new(it), instructions),
    }
}

fn sensors() -> Vec<Sensor> {
    let camera = PinholeCamera::new(WIDTH, HEIGHT, 110.0, 105.0, 63.2, 44.1).unwrap();
    let elevations: Vec<f64> = (0..HEIGHT).map(|row| 0.6 - 0.013 * row as f64).collect();
    let lens = Distortion::from_coefficients([-0.2, 0.05, 0.001, 0.0, 0.0]);
    vec![
        Sensor::from(&camera),
        Sensor::from(&camera.with_distortion(lens).unwrap()),
        Sensor::from(&SphericalSensor::new(WIDTH, &elevations).unwrap()),
        Sensor::from(&OrthographicCamera::new(WIDTH, HEIGHT, 30.0, 28.0, 63.0, 45.0).unwrap()),
    ]
}

#[test]
fn every_set_gives_the_same_bits() {
    let sets = Instructions::all();
    let growing = SensorModel::new([0.01, 0.002, 0.004], None, SurfaceOffset::Centred).unwrap();
    let mut dense = 0;
    for sensor in sensors() {
        for update in [UpdateRule::Pyramid, UpdateRule::MinLayer, UpdateRule::Area] {
            for (voxel_size, model) in [(0.03, SensorModel::constant(0.03).unwrap()), (0.11, growing)] {
                let mut config = GridConfig::new(voxel_size).unwrap();
                (config.update, config.max_range, config.sensor_model) = (update, 4.0, model);
                let expected = seen_by(&config, &sensor, sets[0]);
                dense += expected.changes.iter().filter(|change| matches!(change, Change::Dense { .. })).count();
                for &set in &sets[1..] {
                    assert!(
                        seen_by(&config, &sensor, set) == expected,
                        "{set:?}: {update:?}, {voxel_size} m, {sensor:?}"
                    );
                }
            }
        }
    }
    assert!(dense > 1000, "{dense} blocks show little");
}

#[test]
fn one_altered_increment_is_noticed() {
    let config = GridConfig::new(0.11).unwrap();
    let see = || seen_by(&config, &sensors()[0], Instructions::widest());
    let mut altered = see();
    assert!(altered == see());
    altered.increments[0][77] ^= 1;
    assert!(altered != see());
}
