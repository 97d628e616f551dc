//! What is done with a whole map: mesh, save, load, merge.

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use pyramap::mesh::{MeshOptions, extract};
use pyramap::{OccupancyGrid, UpdateRule};
use pyramap_benches::{Frames, VOXEL_SIZES, config};

fn map(criterion: &mut Criterion) {
    let frames = Frames::load();
    let folder = std::env::temp_dir().join(format!("pyramap-benches-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a place for files");
    let file = folder.join("map.pmap");
    let mut group = criterion.benchmark_group(format!("map/{}", frames.source));
    group.sample_size(10);
    for voxel_size in VOXEL_SIZES {
        let grid = frames.map(config(voxel_size, UpdateRule::Pyramid));
        group.bench_function(BenchmarkId::new("mesh", voxel_size), |bencher| {
            bencher.iter(|| extract(&grid, &MeshOptions::default()).unwrap());
        });
        group.bench_function(BenchmarkId::new("save", voxel_size), |bencher| {
            bencher.iter(|| grid.save(&file).unwrap());
        });
        grid.save(&file).expect("a writable folder");
        group.bench_function(BenchmarkId::new("load", voxel_size), |bencher| {
            bencher.iter(|| OccupancyGrid::load(&file).unwrap());
        });
        group.bench_function(BenchmarkId::new("merge", voxel_size), |bencher| {
            let empty = || OccupancyGrid::new(grid.config().clone()).unwrap();
            bencher.iter_batched_ref(empty, |sum| sum.merge(&grid).unwrap(), BatchSize::PerIteration);
        });
    }
    group.finish();
    std::fs::remove_dir_all(&folder).expect("the folder is ours");
}

criterion_group!(benches, map);
criterion_main!(benches);
