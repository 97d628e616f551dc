//! The stages of a frame, each by itself, as the map's own clock books them: `ranges`, `pyramid` with the bounds over
//! its layers, `cull`, `update`, `commit`. The frame as a whole is the benchmark `frame`.

use criterion::{Criterion, criterion_group, criterion_main};
use pyramap::FrameStats;
use pyramap_benches::{Frames, VOXEL_SIZES, config, rules};
use std::time::Duration;

fn stages(criterion: &mut Criterion) {
    let frames = Frames::load();
    let names = FrameStats::default().seconds.named().map(|(name, _)| name);
    for voxel_size in VOXEL_SIZES {
        for (rule_name, rule) in rules(voxel_size) {
            let mut grid = frames.map(config(voxel_size, rule));
            let mut group = criterion.benchmark_group(format!("stages/{}/{rule_name}/{voxel_size}", frames.source));
            group.sample_size(10);
            for (stage, name) in names.iter().enumerate() {
                group.bench_function(*name, |bencher| {
                    bencher.iter_custom(|iterations| {
                        let run = frames.frames.iter().cycle().take(iterations as usize);
                        let seconds = run.map(|frame| {
                            let stats = frames.integrate(&mut grid, frame).expect("a valid frame");
                            stats.seconds.named()[stage].1
                        });
                        Duration::from_secs_f64(seconds.sum())
                    });
                });
            }
            group.finish();
        }
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
