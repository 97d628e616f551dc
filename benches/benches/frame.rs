//! One frame, fused into a map that has seen it: every rule at every voxel size.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use pyramap_benches::{Frames, VOXEL_SIZES, config, rules};

fn frame(criterion: &mut Criterion) {
    let frames = Frames::load();
    let mut group = criterion.benchmark_group(format!("frame/{}", frames.source));
    group.sample_size(10);
    for voxel_size in VOXEL_SIZES {
        for (name, rule) in rules(voxel_size) {
            let mut grid = frames.map(config(voxel_size, rule));
            let mut next = frames.frames.iter().cycle();
            group.bench_function(BenchmarkId::new(name, voxel_size), |bencher| {
                bencher.iter(|| frames.integrate(&mut grid, next.next().expect("frames come round again")).unwrap());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, frame);
criterion_main!(benches);
