//! What rays keep of a map for the next call is noticed to be stale, however the map has changed.

use pyramap::rays::{RayHits, cast_rays};
use pyramap::{Depth, DepthImage, GridConfig, OccupancyGrid, PinholeCamera, Pose, Region, Unknown, UpdateRule};

const WIDTH: usize = 80;
const HEIGHT: usize = 60;
const RAYS: usize = 20_000;
const MAX_RANGE: f64 = 3.0;

fn config(update: UpdateRule) -> GridConfig {
    let mut config = GridConfig::new(0.1).unwrap();
    (config.max_range, config.update) = (4.0, update);
    config
}

fn camera() -> PinholeCamera {
    PinholeCamera::new(WIDTH, HEIGHT, 70.0, 71.0, 40.2, 29.1).unwrap()
}

fn pose(number: u32) -> Pose {
    let n = f64::from(number);
    let (sin, cos) = (0.4 * n).sin_cos();
    let rows =
        [[cos, 0.0, sin, 0.2 * n - 0.5], [0.0, 1.0, 0.0, -0.1 * n], [-sin, 0.0, cos, 0.07], [0.0, 0.0, 0.0, 1.0]];
    Pose::from_rows(&rows).unwrap()
}

/// A slanted wall with a post before it.
fn with_image<T>(fuse: impl FnOnce(&DepthImage) -> T) -> T {
    let reading = |i: usize| if (40..50).contains(&(i % WIDTH)) { 1.3 } else { 2.6 + 0.01 * (i % WIDTH) as f32 };
    let depth: Vec<f32> = (0..WIDTH * HEIGHT).map(reading).collect();
    fuse(&DepthImage::new(Depth::F32(&depth), WIDTH, HEIGHT).unwrap())
}

fn integrate(grid: &mut OccupancyGrid, number: u32) {
    with_image(|image| grid.integrate(image, &camera(), &pose(number)).unwrap());
}

fn map_of(frames: impl IntoIterator<Item = u32>) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(config(UpdateRule::Pyramid)).unwrap();
    frames.into_iter().for_each(|number| integrate(&mut grid, number));
    grid
}

/// Rays from all around, in all directions; no two coordinates of them are alike.
fn rays() -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    // The fractional parts of multiples of irrational numbers fill an interval evenly.
    let part = |n: usize, step: f64| (n as f64 * step).fract();
    let origin = |n| [3.0 * part(n, 0.754_877_666) - 1.5, 2.0 * part(n, 0.569_840_291) - 1.0, 3.0 * part(n, 0.43)];
    let direction = |n| [part(n, 0.618_033_989) - 0.5, part(n, 0.414_213_562) - 0.5, part(n, 0.732_050_808) - 0.3];
    ((0..RAYS).map(origin).collect(), (1..=RAYS).map(direction).collect())
}

/// Many rays at once, which find out what there is around every voxel and keep it.
fn cast(grid: &OccupancyGrid, unknown: Unknown) -> RayHits {
    let (origins, directions) = rays();
    assert!(RAYS > 16 * grid.num_blocks(), "too few for anything to be kept: {} blocks", grid.num_blocks());
    grid.cast_rays(&origins, &directions, MAX_RANGE, unknown).unwrap()
}

/// The same rays, each through a map that knows nothing of others.
fn cast_anew(grid: &OccupancyGrid, unknown: Unknown) -> RayHits {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("map.pmap");
    grid.save(&file).unwrap();
    let fresh = OccupancyGrid::load(&file).unwrap();
    let (origins, directions) = rays();
    let mut all = RayHits::default();
    for (origin, direction) in origins.into_iter().zip(directions) {
        let hit = cast_rays(&fresh, &[origin], &[direction], MAX_RANGE, unknown).unwrap();
        all.distance.extend(hit.distance);
        all.state.extend(hit.state);
        all.voxel.extend(hit.voxel);
    }
    all
}

const BOTH: [Unknown; 2] = [Unknown::Occupied, Unknown::Free];

/// Asks before and after; the answers must differ, or the test would see nothing.
fn check(what: &str, grid: &mut OccupancyGrid, change: impl FnOnce(&mut OccupancyGrid)) {
    let before = BOTH.map(|unknown| cast(grid, unknown));
    change(grid);
    for (unknown, before) in BOTH.into_iter().zip(before) {
        let after = cast(grid, unknown);
        assert!(after != before, "{what} changes no ray, unknown counts as {unknown:?}");
        assert!(after == cast_anew(grid, unknown), "after {what}, unknown counts as {unknown:?}");
        assert!(after == cast(grid, unknown), "after {what}, asked once more, unknown counts as {unknown:?}");
    }
}

#[test]
fn after_every_kind_of_change() {
    let region = Region::new([-1.0, -1.5, 0.6], [1.6, 0.3, 3.2]).unwrap();
    let mut grid = map_of([0]);
    check("integrate", &mut grid, |grid| integrate(grid, 1));
    check("submit", &mut grid, |grid| {
        with_image(|image| grid.submit(image, &camera(), &pose(2)).unwrap());
        grid.synchronize().unwrap();
    });
    check("remove", &mut grid, |grid| {
        with_image(|image| grid.remove(image, &camera(), &pose(0)).unwrap());
    });
    check("reintegrate", &mut grid, |grid| {
        with_image(|image| grid.reintegrate(image, &camera(), &pose(1), &pose(4)).unwrap());
    });
    check("merge", &mut grid, |grid| grid.merge(&map_of([6, 7])).unwrap());
    check("clear", &mut grid, |grid| grid.clear(&region).unwrap());
    check("decay", &mut grid, |grid| {
        let low_half = Region::new([f64::NEG_INFINITY; 3], [f64::INFINITY, -0.1, f64::INFINITY]).unwrap();
        grid.decay(1e-5, Some(&low_half)).unwrap();
    });
    check("crop", &mut grid, |grid| grid.crop(&region.clone()).unwrap());
}

#[test]
fn after_points() {
    let mut grid = OccupancyGrid::new(config(UpdateRule::Rays)).unwrap();
    let points =
        |n: i32| -> Vec<[f64; 3]> { (-40..40).map(|x| [0.05 * f64::from(x), 0.1 * f64::from(n), 2.0]).collect() };
    grid.integrate_points(&points(0), &pose(0)).unwrap();
    check("integrate_points", &mut grid, |grid| {
        (1..4).for_each(|n| {
            grid.integrate_points(&points(n), &pose(0)).unwrap();
        });
    });
}

/// Calls too small to find out anything of a whole map do so together.
#[test]
fn small_calls_give_what_large_ones_do() {
    let grid = map_of([0, 3]);
    let (origins, directions) = rays();
    for unknown in BOTH {
        let expected = cast_anew(&grid, unknown);
        let mut first = 0;
        for (origins, directions) in origins.chunks(100).zip(directions.chunks(100)) {
            let hits = grid.cast_rays(origins, directions, MAX_RANGE, unknown).unwrap();
            let rows = first..first + origins.len();
            assert_eq!(hits.distance, expected.distance[rows.clone()]);
            assert_eq!(hits.voxel, expected.voxel[rows.clone()]);
            assert_eq!(hits.state, expected.state[rows]);
            first += origins.len();
        }
    }
}
