//! Whole frames, up to commit.

use super::*;

#[test]
fn frames_are_those_of_the_cpu() {
    let Some(gpu) = gpu() else { return };
    for rule in RULES {
        for voxel_size in [0.03, 0.08, 0.3] {
            for (n, &(width, height)) in [(160, 120), (641, 479), (7, 5), (1, 1), (3, 40)].iter().enumerate() {
                let (camera, pose, config) = (camera(width, height), pose(n as u32), config(voxel_size, rule));
                let depths = depths(width, height, n as u64);
                let image = DepthImage::new(Depth::F32(&depths), width, height).unwrap();
                let mut frames = Frames::new(&gpu, &config).unwrap();
                let cpu = on_cpu(&config, &image, &camera, &pose);
                let device = on_gpu(&gpu, &mut frames, &config, &image, &camera, &pose);
                check(&gpu, &format!("{rule:?}, {voxel_size} m, {width} x {height}"), &cpu.effects, &device.effects);
            }
        }
    }
}

/// Culling is looser than the CPU's, since its rectangles are read as larger cells, but not by much.
#[test]
fn free_and_hidden_blocks_are_told_apart() {
    let Some(gpu) = gpu() else { return };
    let (width, height) = (320, 240);
    let (camera, wall) = (camera(width, height), vec![4.0f32; 320 * 240]);
    let image = DepthImage::new(Depth::F32(&wall), width, height).unwrap();
    for rule in RULES {
        let config = config(0.02, rule);
        let cpu = on_cpu(&config, &image, &camera, &pose(1));
        let mut frames = Frames::new(&gpu, &config).unwrap();
        let device = on_gpu(&gpu, &mut frames, &config, &image, &camera, &pose(1));
        let (cpu, device) = (cpu.culled, device.culled);
        assert!(device.free.len() * 10 >= cpu.free.len() * 9, "{rule:?}: {} {}", device.free.len(), cpu.free.len());
        assert!(
            device.mixed.len() * 10 <= cpu.mixed.len() * 12,
            "{rule:?}: {} {}",
            device.mixed.len(),
            cpu.mixed.len()
        );
    }
}

#[test]
fn every_model_and_option() {
    let Some(gpu) = gpu() else { return };
    let (width, height) = (161, 120);
    let (camera, depths) = (camera(width, height), depths(width, height, 7));
    let image = DepthImage::new(Depth::F32(&depths), width, height).unwrap();
    let far_away = Pose { translation: pose(0).translation.add_scalar(1e5), ..pose(0) };
    for rule in RULES {
        let usual = config(0.06, rule);
        let mut configs = vec![("a map", usual.clone()); 5];
        configs[0].1.sensor_model = SensorModel::new([0.05, 0.0, 0.0], Some(0.02), SurfaceOffset::Centred).unwrap();
        configs[1].1.sensor_model = SensorModel::new([0.05, 0.0, 0.0], None, SurfaceOffset::Metres(0.1)).unwrap();
        configs[2].1.beyond_max_range = BeyondMaxRange::Ignore;
        configs[2].1.max_range = 3.0;
        configs[3].1.cull = false;
        configs[4].0 = "a growing sigma";
        configs[4].1.sensor_model = SensorModel::new([0.02, 0.002, 0.01], None, SurfaceOffset::Centred).unwrap();
        for (n, (what, config)) in configs.iter().enumerate() {
            for pose in [pose(0), far_away] {
                let cpu = on_cpu(config, &image, &camera, &pose).effects;
                let mut frames = Frames::new(&gpu, config).unwrap();
                let device = on_gpu(&gpu, &mut frames, config, &image, &camera, &pose).effects;
                if n < 4 {
                    check(&gpu, &format!("{what} {n}, {rule:?}"), &cpu, &device);
                } else {
                    // Its sigma is a few roundings off: a step at most.
                    let found = difference(&cpu, &device);
                    let close = found.voxels * 1000 <= found.of && found.blocks == 0;
                    assert!(
                        close && (found.most <= 1 || !gpu.name().contains("llvmpipe")),
                        "{what}, {rule:?}: {found:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn every_number_type() {
    let Some(gpu) = gpu() else { return };
    for (width, height) in [(64, 48), (63, 47)] {
        let (camera, config) = (camera(width, height), config(0.1, UpdateRule::Pyramid));
        let mut random = Random(3);
        let raw: Vec<u16> = (0..width * height).map(|_| (random.next() * 6000.0) as u16).collect();
        let single: Vec<f32> = raw.iter().map(|&raw| f32::from(raw) / 1000.0).collect();
        let double: Vec<f64> = raw.iter().map(|&raw| f64::from(raw) / 1000.0).collect();
        let mut frames = Frames::new(&gpu, &config).unwrap();
        for depth in [Depth::U16 { values: &raw, scale: 1000.0 }, Depth::F32(&single), Depth::F64(&double)] {
            let image = DepthImage::new(depth, width, height).unwrap();
            let cpu = on_cpu(&config, &image, &camera, &pose(0));
            let device = on_gpu(&gpu, &mut frames, &config, &image, &camera, &pose(0));
            check(&gpu, &format!("{width} x {height}"), &cpu.effects, &device.effects);
        }
    }
}

/// Frames of two cameras in turns, two under way, in buffers that are too small at first: each is done again while the
/// other's layers lie between the stages.
#[test]
fn what_there_is_no_room_for_is_done_again() {
    let Some(gpu) = gpu() else { return };
    for rule in RULES {
        let config = config(0.05, rule);
        let room = Room { free: 1, mixed: 2, page_blocks: 3 };
        let mut frames = Frames::with_room(&gpu, &config, room).unwrap();
        let images = [(120, 90), (61, 47)].map(|(w, h)| (camera(w, h), depths(w, h, 5)));
        let mut expected = VecDeque::new();
        for n in 0..6 {
            let (camera, depths) = &images[n % 2];
            let image = DepthImage::new(Depth::F32(depths), camera.width, camera.height).unwrap();
            // Frame 4 is given up, and the one before it that was under way too.
            if n == 4 {
                frames.forget();
                expected.clear();
            }
            expected.push_back(on_cpu(&config, &image, camera, &pose(n as u32)).effects);
            frames.see(&gpu, &config, &image, &camera.into(), &pose(n as u32)).unwrap();
            if expected.len() == 2 {
                check(
                    &gpu,
                    &format!("{rule:?}, frame {n}"),
                    &expected.pop_front().unwrap(),
                    &seen(&gpu, &mut frames).effects,
                );
            }
        }
        assert!(frames.increments().len() > 10, "every page holds three blocks");
    }
}

#[test]
fn the_reference_rule_is_refused() {
    let Some(gpu) = gpu() else { return };
    assert!(matches!(Frames::new(&gpu, &config(0.1, UpdateRule::Ideal)), Err(pyramap::Error::Unsupported { .. })));
}
