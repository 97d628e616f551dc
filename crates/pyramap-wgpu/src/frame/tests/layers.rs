//! Ranges, pyramid and surfaces.

use super::*;
use pyramap_shaders::{HOLE, NO_RETURN};

/// Layers, placed by every sensor model, and bounds over them.
#[test]
fn layers_and_bounds() {
    let Some(gpu) = gpu() else { return };
    let centred = SurfaceOffset::Centred;
    let models = [
        SensorModel::constant(0.05).unwrap(),
        SensorModel::new([0.05, 0.0, 0.0], Some(0.03), SurfaceOffset::Metres(-0.04)).unwrap(),
        SensorModel::new([0.01, 0.001, 0.004], None, centred).unwrap(),
    ];
    for (n, &(width, height)) in [(65, 48), (37, 70), (9, 8), (7, 5), (1, 1), (1, 30)].iter().enumerate() {
        let (camera, depths) = (camera(width, height), depths(width, height, n as u64));
        let image = DepthImage::new(Depth::F32(&depths), width, height).unwrap();
        for rule in RULES {
            for model in models {
                let mut config = config(0.2, rule);
                config.sensor_model = model;
                // With most of the range in the coarser layers, and with all of it in the finer ones.
                for max_range in [2.5, 20.0] {
                    config.max_range = max_range;
                    config.beyond_max_range = [BeyondMaxRange::Free, BeyondMaxRange::Ignore][n % 2];
                    check_layers(&gpu, &config, &image, &camera);
                }
            }
        }
    }
}

fn check_layers(gpu: &Gpu, config: &GridConfig, image: &DepthImage, camera: &PinholeCamera) {
    let cpu = on_cpu(config, image, camera, &pose(0));
    let mut frames = Frames::new(gpu, config).unwrap();
    on_gpu(gpu, &mut frames, config, image, camera, &pose(0));

    let view = View::new(Pinhole::new(camera), &pose(0), config.voxel_size, config.max_range);
    let layout = params::layers(config, &view);
    let constant = config.sensor_model.is_constant();
    let buffers = &frames.shots[frames.asked].buffers;
    let placed: Vec<[f32; 2]> = match constant {
        false => download(gpu, &buffers.surfaces, layout.num_texels),
        true => {
            let inv_sigma = (1.0 / config.sensor_model.sigma_at(0.0)) as f32;
            download(gpu, &buffers.surfaces, layout.num_texels)
                .into_iter()
                .map(|surface| [surface, inv_sigma])
                .collect()
        }
    };
    let bounds: Vec<[f32; 2]> = download(gpu, &buffers.bounds, layout.num_cells);

    // A sigma that grows is a polynomial in f32 here, in f64 on the CPU: a few roundings.
    let exact = constant && gpu.name().contains("llvmpipe");
    let near = |a: f32, b: f32| if exact { a == b } else { (a - b).abs() <= 1e-6 * b.abs().max(1.0) };
    let reach = |inv_sigma: f32| SensorTable::new(&config.sensor_model).cutoff() / inv_sigma;
    let (mut texels, mut cells) = (placed.as_slice(), bounds.as_slice());
    for i in layout.made.0..layout.made.1 {
        let (layer, surfaces) = (&cpu.layers.layers[i], &cpu.surfaces[i]);
        let (here, rest) = texels.split_at(layer.values.len());
        texels = rest;
        for (n, &[surface, inv_sigma]) in here.iter().enumerate() {
            let expected_sigma = surfaces.inv_sigma[if surfaces.inv_sigma.len() == 1 { 0 } else { n }];
            assert!(near(inv_sigma, expected_sigma), "layer {i}, texel {n}: {inv_sigma}, {expected_sigma}");
            match layer.values[n] {
                0.0 => assert_eq!(surface, HOLE),
                f32::INFINITY => assert!(near(surface, NO_RETURN)),
                _ => assert!(near(surface, surfaces.surface[n]), "layer {i}, texel {n}: {surface}"),
            }
        }
        for level in 1..=layout.coarsest_bounds(i) {
            let (width, height) = (layer.width.div_ceil(1 << level), layer.height.div_ceil(1 << level));
            let (these, rest) = cells.split_at(width * height);
            cells = rest;
            let mut inside = vec![Vec::new(); these.len()];
            for (texel, &placed) in here.iter().enumerate() {
                let (x, y) = ((texel % layer.width) >> level, (texel / layer.width) >> level);
                inside[y * width + x].push(placed);
            }
            for (n, (&[free_up_to, hidden_from], inside)) in these.iter().zip(inside).enumerate() {
                let valid = || inside.iter().filter(|&&[surface, _]| surface != HOLE);
                assert_eq!(free_up_to < 0.0, inside.len() > valid().count(), "a hole in cell {n}, level {level}");
                let nearest = valid().map(|&[s, inv]| s - reach(inv)).fold(f32::INFINITY, f32::min);
                let farthest = valid().map(|&[s, inv]| s + reach(inv)).fold(f32::NEG_INFINITY, f32::max);
                if valid().count() > 0 {
                    assert!(near(free_up_to.abs(), nearest.max(1e-30)), "cell {n}, level {level}: {free_up_to}");
                    assert!(near(hidden_from, farthest), "cell {n}, level {level}: {hidden_from}");
                } else {
                    assert!(hidden_from < 0.0);
                }
            }
        }
    }
    assert!(texels.is_empty() && cells.is_empty());
}

/// So long a lens that ranges are depths, and a distance t_1 of 1 m in the middle between two of them.
#[test]
fn of_two_ranges_equally_near_the_smaller_is_taken() {
    let Some(gpu) = gpu() else { return };
    let camera = PinholeCamera::new(2, 2, 4096.0, 4096.0, 0.5, 0.5).unwrap();
    let mut config = config(2.0 / 4096.0, UpdateRule::Pyramid);
    config.max_range = 2.0;
    let depths = [1.25, 0.0, 0.75, 0.5];
    let image = DepthImage::new(Depth::F32(&depths), 2, 2).unwrap();
    assert_eq!(on_cpu(&config, &image, &camera, &pose(0)).layers.layers[1].values, [0.75]);
    check_layers(&gpu, &config, &image, &camera);
}
