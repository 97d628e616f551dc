//! The stages on the device against those on the CPU, each by itself and together.
//!
//! On a device that divides and takes roots exactly (lavapipe does) both agree to the bit but for what each test names.
//! Others may be off by a few roundings: the bounds below hold for them too.

mod frames;
mod layers;
mod sensors;

use super::*;
use crate::testing::{download, gpu};
use pyramap::block::BlockData;
use pyramap::cull::{CullBuffers, Culled, Scope, cull};
use pyramap::pyramid::Pyramid as Layers;
use pyramap::ranges::Ranges;
use pyramap::sensor::SensorTable;
use pyramap::sensors::Projection;
use pyramap::simd::Instructions;
use pyramap::surfaces::{SurfaceLayer, compute};
use pyramap::update::area::Area;
use pyramap::update::min_layer::MinLayer;
use pyramap::update::pyramid::Pyramid;
use pyramap::update::{Rule, free_increment, update};
use pyramap::{BeyondMaxRange, PinholeCamera, SensorModel, SurfaceOffset, UpdateRule};
use std::collections::BTreeMap;

const RULES: [UpdateRule; 3] = [UpdateRule::Pyramid, UpdateRule::MinLayer, UpdateRule::Area];

/// The increments of the blocks that a frame changes.
type Effects = BTreeMap<BlockKey, BlockData>;

/// Numbers that look random, the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }
}

/// A wavy wall with things before it, holes, places without return, and readings that are no readings.
fn depths(width: usize, height: usize, seed: u64) -> Vec<f32> {
    let mut random = Random(seed);
    let mut depths: Vec<f32> = (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as f64 / width as f64, (i / width) as f64 / height as f64);
            (2.5 + (9.0 * x).sin() + 0.7 * (7.0 * y).cos() + 0.01 * random.next()) as f32
        })
        .collect();
    for thing in 0..12 {
        let [x, y, size] = [random.next(), random.next(), 0.02 + 0.2 * random.next()];
        let value = [0.0, f32::INFINITY, 1.2, 0.6, 30.0, f32::NAN][thing % 6];
        for (i, depth) in depths.iter_mut().enumerate() {
            let (u, v) = ((i % width) as f64 / width as f64, (i / width) as f64 / height as f64);
            if (u - x).abs() < size && (v - y).abs() < size {
                *depth = value;
            }
        }
    }
    for depth in depths.iter_mut() {
        match (random.next() * 400.0) as u32 {
            0 => *depth = 0.0,
            1 => *depth = f32::INFINITY,
            2 => *depth = -1.0,
            3 => *depth = 0.3,
            _ => {}
        }
    }
    depths[0] = 1.5;
    depths
}

fn camera(width: usize, height: usize) -> PinholeCamera {
    let f = 0.9 * width.max(height) as f64;
    PinholeCamera::new(width, height, f, 1.02 * f, 0.48 * width as f64, 0.51 * height as f64).unwrap()
}

/// Tilted, away from the origin, so that nothing lies along an axis.
fn pose(n: u32) -> Pose {
    let (a, b) = (0.3 + 0.7 * f64::from(n), 0.2 - 0.4 * f64::from(n));
    let ([s, c], [t, d]) = ([a.sin(), a.cos()], [b.sin(), b.cos()]);
    Pose::from_rows(&[
        [c, s * t, s * d, 3.1 - f64::from(n)],
        [0.0, d, -t, -1.7],
        [-s, c * t, c * d, 0.4],
        [0.0, 0.0, 0.0, 1.0],
    ])
    .unwrap()
}

fn config(voxel_size: f64, rule: UpdateRule) -> GridConfig {
    let mut config = GridConfig::new(voxel_size).unwrap();
    config.update = rule;
    config
}

/// What the CPU makes of a frame.
struct OnCpu {
    layers: Layers,
    surfaces: Vec<SurfaceLayer>,
    culled: Culled,
    effects: Effects,
}

fn on_cpu(config: &GridConfig, image: &DepthImage, sensor: impl Into<Sensor>, pose: &Pose) -> OnCpu {
    let (sensor, r, max_range) = (sensor.into(), config.voxel_size, config.max_range);
    match &sensor {
        Sensor::Pinhole(camera) => match camera.lens() {
            None => seen_by(config, image, &sensor, View::new(Pinhole::new(camera), pose, r, max_range)),
            Some(lens) => {
                let projection = DistortedPinhole::new(camera, lens);
                seen_by(config, image, &sensor, View::new(projection, pose, r, max_range))
            }
        },
        Sensor::Spherical(it) => seen_by(config, image, &sensor, View::new(Spherical::new(it), pose, r, max_range)),
        Sensor::Orthographic(it) => {
            seen_by(config, image, &sensor, View::new(Orthographic::new(it), pose, r, max_range))
        }
    }
}

fn seen_by<P: Projection>(config: &GridConfig, image: &DepthImage, sensor: &Sensor, view: View<P>) -> OnCpu {
    let (t_0, count) = (view.t_0 as f32, view.projection.num_layers());
    match config.update {
        UpdateRule::MinLayer => by_rule(config, image, sensor, &view, &MinLayer { t_0, count }),
        UpdateRule::Area => by_rule(config, image, sensor, &view, &Area::new(&view)),
        _ => by_rule(config, image, sensor, &view, &Pyramid { t_0, count }),
    }
}

fn by_rule<P: Projection, R: Rule<P>>(
    config: &GridConfig,
    image: &DepthImage,
    sensor: &Sensor,
    view: &View<P>,
    rule: &R,
) -> OnCpu {
    let model = image.sensor_model().unwrap_or(config.sensor_model);
    let table = SensorTable::new(&model);
    let (mut ranges, mut layers) = (Ranges::default(), Layers::default());
    ranges.compute(image, sensor, config.max_range, config.beyond_max_range).unwrap();
    let count = view.projection.num_layers();
    let wanted = config.update.layers(view, count);
    layers.compute(&ranges, view.t_0, config.update.selection::<P>(), wanted.clone());
    let (mut surfaces, sampling, wraps) = (Vec::new(), config.update.sampling(), view.projection.wraps());
    compute(&mut surfaces, &layers.layers, wanted, (&model, &table), sampling, wraps);
    let scope = Scope { view, layers: &surfaces, rule, enabled: config.cull, instructions: Instructions::widest() };
    let (mut culled, mut increments, mut changes) = (Culled::default(), Vec::new(), Vec::new());
    cull(&scope, &mut CullBuffers::default(), &mut culled);
    update(&scope, &table, &culled.mixed, &mut increments, &mut changes);
    let effects = effects(&culled, &changes, &increments, free_increment(&table));
    OnCpu { layers, surfaces, culled, effects }
}

/// What a frame does in the end, however it is said.
fn effects(culled: &Culled, changes: &[Change], increments: &[BlockData], free: i32) -> Effects {
    let free = culled.free.iter().map(|&key| (key, [free; BLOCK_VOXELS]));
    let mixed = culled.mixed.iter().zip(changes).enumerate().map(|(n, (&key, change))| match *change {
        Change::None => (key, [0; BLOCK_VOXELS]),
        Change::Uniform(increment) => (key, [increment; BLOCK_VOXELS]),
        Change::Dense { voxels } => {
            assert_eq!(voxels as usize, increments[n].iter().filter(|&&increment| increment != 0).count());
            (key, increments[n])
        }
    });
    let all: Vec<_> = free.chain(mixed).collect();
    let effects: Effects = all.iter().copied().collect();
    assert_eq!(effects.len(), all.len(), "a block occurs twice");
    effects.into_iter().filter(|(_, increments)| increments.iter().any(|&i| i != 0)).collect()
}

/// What the device makes of a frame.
struct OnGpu {
    culled: Culled,
    effects: Effects,
}

fn on_gpu(
    gpu: &Gpu,
    frames: &mut Frames,
    config: &GridConfig,
    image: &DepthImage,
    sensor: impl Into<Sensor>,
    pose: &Pose,
) -> OnGpu {
    frames.see(gpu, config, image, &sensor.into(), pose).unwrap();
    seen(gpu, frames)
}

fn seen(gpu: &Gpu, frames: &mut Frames) -> OnGpu {
    let mut seen = Seen::default();
    frames.seen(gpu, &mut seen).unwrap();
    let mut increments: Vec<BlockData> = Vec::new();
    for page in frames.increments() {
        let blocks = (seen.culled.mixed.len() - increments.len()).min(frames.blocks_per_page());
        increments.extend(download::<BlockData>(gpu, page, blocks));
    }
    let free = free_increment(&SensorTable::new(&SensorModel::constant(0.05).unwrap()));
    OnGpu { effects: effects(&seen.culled, &seen.changes, &increments, free), culled: seen.culled }
}

/// Where two frames differ: how many voxels of how many, by how many fixed-point steps at most, and how many blocks one
/// has and the other has not.
#[derive(Debug, Default, PartialEq)]
struct Difference {
    voxels: usize,
    of: usize,
    most: i32,
    blocks: usize,
}

fn difference(a: &Effects, b: &Effects) -> Difference {
    let only_in_a = a.keys().filter(|key| !b.contains_key(*key)).count();
    let only_in_b = b.keys().filter(|key| !a.contains_key(*key)).count();
    let mut found = Difference { blocks: only_in_a + only_in_b, ..Difference::default() };
    for (key, a) in a {
        for (a, b) in a.iter().zip(b.get(key).unwrap_or(&[0; BLOCK_VOXELS])) {
            found.of += 1;
            found.voxels += usize::from(a != b);
            found.most = found.most.max((a - b).abs());
        }
    }
    found
}

/// lavapipe reckons like the CPU, to the bit. Cards divide and take roots with an error of some units in the last place,
/// and may fuse a multiplication with an addition: 1e-6 of a distance of metres is 1e-4 sigmas of centimetres, less than a
/// step of log-odds. Only what jumps may differ by more: a voxel at the image's border, a texel between two ranges that
/// are equally near to its layer's distance, a sample of `area` between two pixels. Such are rare.
fn check(gpu: &Gpu, what: &str, cpu: &Effects, device: &Effects) {
    let found = difference(cpu, device);
    if gpu.name().contains("llvmpipe") {
        assert_eq!(found, Difference { of: found.of, ..Difference::default() }, "{what}");
    } else {
        let all_but_few = found.voxels * 1000 <= found.of && found.blocks * 1000 <= cpu.len();
        assert!(all_but_few, "{what}: {found:?} in {} blocks", cpu.len());
    }
}

#[test]
fn a_difference_is_noticed() {
    let one: Effects = [([0; 3], [5; BLOCK_VOXELS]), ([1, 0, 0], [1; BLOCK_VOXELS])].into();
    assert_eq!(difference(&one, &one), Difference { of: 2 * BLOCK_VOXELS, ..Difference::default() });
    let mut other = one.clone();
    other.get_mut(&[1, 0, 0]).unwrap()[77] = -6;
    assert_eq!(difference(&one, &other), Difference { voxels: 1, most: 7, blocks: 0, of: 2 * BLOCK_VOXELS });
    other.remove(&[0; 3]);
    assert_eq!((difference(&one, &other).blocks, difference(&other, &one).blocks), (1, 1));
}
