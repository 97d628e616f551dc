//! What is done with a whole map: mesh, save, load, merge; and questions to it.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use pyramap::mesh::{MeshOptions, extract};
use pyramap::rays::cast_rays;
use pyramap::{Interpolation, OccupancyGrid, Unknown, UpdateRule};
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

/// How many points and rays are asked of a map in a call.
const QUESTIONS: usize = 100_000;

/// Questions that lie all over the box around a map, and directions: the fractional parts of multiples of irrational
/// numbers fill it evenly.
fn questions(grid: &OccupancyGrid) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    const STEPS: [f64; 6] = [0.754_877_666, 0.569_840_291, 0.430_159_709, 0.618_033_989, 0.414_213_562, 0.732_050_808];
    let [low, high] = grid.bounds().expect("a map that is not empty");
    let part = |n: usize, step: usize| (n as f64 * STEPS[step]).fract();
    let point = |n| std::array::from_fn(|a| low[a] + (high[a] - low[a]) * part(n, a));
    let direction = |n| std::array::from_fn(|a| part(n, 3 + a) - 0.5);
    ((1..=QUESTIONS).map(point).collect(), (1..=QUESTIONS).map(direction).collect())
}

fn ask(criterion: &mut Criterion) {
    let frames = Frames::load();
    let mut group = criterion.benchmark_group(format!("ask/{}", frames.source));
    group.sample_size(10).throughput(Throughput::Elements(QUESTIONS as u64));
    for voxel_size in VOXEL_SIZES {
        let grid = frames.map(config(voxel_size, UpdateRule::Pyramid));
        let (points, directions) = questions(&grid);
        let range = grid.config().max_range;
        group.bench_function(BenchmarkId::new("state", voxel_size), |bencher| {
            bencher.iter(|| grid.state(&points).unwrap());
        });
        group.bench_function(BenchmarkId::new("trilinear", voxel_size), |bencher| {
            bencher.iter(|| grid.log_odds(&points, Interpolation::Trilinear).unwrap());
        });
        for (name, unknown) in [("stop", Unknown::Occupied), ("pass", Unknown::Free)] {
            group.bench_function(BenchmarkId::new(format!("rays/{name}"), voxel_size), |bencher| {
                bencher.iter(|| grid.cast_rays(&points, &directions, range, unknown).unwrap());
            });
            group.bench_function(BenchmarkId::new(format!("rays/{name}/after a change"), voxel_size), |bencher| {
                bencher.iter(|| cast_rays(&grid, &points, &directions, range, unknown).unwrap());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, map, ask);
criterion_main!(benches);
