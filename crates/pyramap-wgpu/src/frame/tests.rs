//! The stages on the device against those on the CPU, each by itself and together.
//!
//! On a device that divides and takes roots exactly (lavapipe does) both agree to the bit but for what each test names.
//! Others may be off by a few roundings: the bounds below hold for them too.

use super::*;
use crate::testing::{download, gpu};
use pyramap::block::{BlockData, voxel_offset};
use pyramap::cull::{CullBuffers, Culled, Scope, cull};
use pyramap::pyramid::{Pyramid as Layers, num_layers};
use pyramap::ranges::Ranges;
use pyramap::sensor::SensorTable;
use pyramap::surfaces::SurfaceLayer;
use pyramap::update::area::Area;
use pyramap::update::min_layer::MinLayer;
use pyramap::update::pyramid::Pyramid;
use pyramap::update::{Rule, free_increment, update};
use pyramap::{BeyondMaxRange, SensorModel, SurfaceOffset};
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
        for i in 0..width * height {
            let (u, v) = ((i % width) as f64 / width as f64, (i / width) as f64 / height as f64);
            if (u - x).abs() < size && (v - y).abs() < size {
                depths[i] = value;
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
    depths[0] = 2.0;
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

fn on_cpu(config: &GridConfig, image: &DepthImage, camera: &PinholeCamera, pose: &Pose) -> OnCpu {
    let view = View::new(Pinhole::new(camera), pose, config.voxel_size, config.max_range);
    let (t_0, count) = (view.t_0 as f32, num_layers(camera.width, camera.height));
    match config.update {
        UpdateRule::MinLayer => by_rule(config, image, camera, &view, &MinLayer { t_0, count }),
        UpdateRule::Area => by_rule(config, image, camera, &view, &Area::new(&view)),
        _ => by_rule(config, image, camera, &view, &Pyramid { t_0, count }),
    }
}

fn by_rule<R: Rule<Pinhole>>(config: &GridConfig, image: &DepthImage, camera: &PinholeCamera, view: &View<Pinhole>, rule: &R) -> OnCpu {
    let table = SensorTable::new(&config.sensor_model);
    let (mut ranges, mut layers) = (Ranges::default(), Layers::default());
    ranges.compute(image, &camera.into(), config.max_range, config.beyond_max_range).unwrap();
    let count = num_layers(camera.width, camera.height);
    let wanted = config.update.layers(view, count);
    layers.compute(&ranges, view.t_0, config.update.selection::<Pinhole>(), wanted.clone());
    let mut surfaces = vec![SurfaceLayer::default(); count];
    for i in wanted {
        surfaces[i].compute(&layers.layers[i], &config.sensor_model, &table, config.update.finest_bounds());
    }
    let scope = Scope { view, layers: &surfaces, rule, enabled: config.cull };
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

struct OnGpu {
    culled: Culled,
    effects: Effects,
    /// Where each texel of the layers that are made puts its surface.
    surfaces: Vec<f32>,
}

fn on_gpu(
    gpu: &Gpu,
    frames: &mut Frames,
    config: &GridConfig,
    image: &DepthImage,
    camera: &PinholeCamera,
    pose: &Pose,
) -> OnGpu {
    frames.see(gpu, config, image, camera, pose).unwrap();
    let mut seen = Seen::default();
    frames.seen(gpu, &mut seen).unwrap();
    let mut increments: Vec<BlockData> = Vec::new();
    for page in frames.increments() {
        let blocks = (seen.culled.mixed.len() - increments.len()).min(frames.blocks_per_page());
        increments.extend(download::<[i32; BLOCK_VOXELS]>(gpu, page, blocks));
    }
    let shot = &frames.shots[frames.asked];
    let numbers = if frames.sigma == Sigma::Constant { 1 } else { 2 };
    let view = View::new(Pinhole::new(camera), pose, config.voxel_size, config.max_range);
    let texels = params::layers(config, &view, camera.width, camera.height).num_texels;
    let surfaces = download::<f32>(gpu, &shot.buffers.surfaces, texels * numbers);
    OnGpu {
        effects: effects(&seen.culled, &seen.changes, &increments, free_increment(&frames.model.table)),
        culled: seen.culled,
        surfaces: surfaces.into_iter().step_by(numbers).collect(),
    }
}

#[test]
fn explore() {
    let Some(gpu) = gpu() else { return };
    for rule in RULES {
        for voxel in [0.02, 0.05, 0.16] {
            for (w, h) in [(320, 240), (641, 479), (7, 5), (1, 1)] {
                let (camera, pose) = (camera(w, h), pose(0));
                let config = config(voxel, rule);
                let depth = depths(w, h, 1);
                let image = DepthImage::new(Depth::F32(&depth), w, h).unwrap();
                let mut frames = Frames::new(&gpu, &config).unwrap();
                let a = on_cpu(&config, &image, &camera, &pose);
                let b = on_gpu(&gpu, &mut frames, &config, &image, &camera, &pose);
                let mut at = 0;
                let mut differ = 0;
                for (layer, s) in a.layers.layers.iter().zip(&a.surfaces) {
                    for (i, &range) in layer.values.iter().enumerate() {
                        let got = b.surfaces[at];
                        at += 1;
                        let fits = if range == 0.0 {
                            got == pyramap_shaders::HOLE
                        } else if range == f32::INFINITY {
                            got == pyramap_shaders::NO_RETURN
                        } else {
                            got == s.surface[i]
                        };
                        differ += usize::from(!fits);
                    }
                }
                let missing = a.effects.keys().filter(|k| !b.effects.contains_key(*k)).count();
                let spurious = b.effects.keys().filter(|k| !a.effects.contains_key(*k)).count();
                let (mut n, mut voxels, mut worst) = (0, 0, 0);
                for (k, x) in &a.effects {
                    if let Some(y) = b.effects.get(k) {
                        for i in 0..512 {
                            voxels += 1;
                            if x[i] != y[i] {
                                n += 1;
                                worst = worst.max((x[i] - y[i]).abs());
                            }
                        }
                    }
                }
                println!(
                    "{rule:?} {voxel} {w}x{h}: surfaces {differ} of {at}; cpu {} free {} mixed, gpu {} {}; missing {missing} spurious {spurious}, {n} of {voxels} differ, worst {worst}",
                    a.culled.free.len(),
                    a.culled.mixed.len(),
                    b.culled.free.len(),
                    b.culled.mixed.len()
                );
            }
        }
    }
}
