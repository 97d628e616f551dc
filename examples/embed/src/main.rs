//! A robot program in small: it maps what its depth camera sees, asks whether the way ahead is free, and keeps the map.
//!
//! `cargo run -p embed [FOLDER]` writes `office.pmap` and `office.obj` to the folder, `out` by default. The camera is
//! simulated here; a robot would take images and poses from its drivers, and all else would stay as it is.

use pyramap::mesh::{Mesh, MeshOptions, extract};
use pyramap::{Depth, DepthImage, Error, GridConfig, Interpolation, OccupancyGrid, Pose, State};
use pyramap_scenes::{Scene, kinect_noise, office_loop};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The robot has walked this many frames of its loop, and plans to walk the next.
const WALKED: usize = 40;
const PLANNED: usize = 40;
/// Its body is this far above the floor, and needs this much room to each side, metres.
const BODY_HEIGHT: f64 = 0.7;
const CLEARANCE: f64 = 0.25;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).unwrap_or("out".into()));
    std::fs::create_dir_all(&folder)?;
    run(&folder)
}

fn run(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let office = office_loop();
    let mut config = GridConfig::new(0.05)?;
    config.max_bytes = Some(256 << 20);
    let mut grid = OccupancyGrid::new(config)?;

    let (walked, ahead) = office.poses().split_at(WALKED);
    for (number, pose) in walked.iter().enumerate() {
        let depth = take_image(&office, pose, number)?;
        // A frame is fused whole or not at all. When the budget is spent the map stays as it was, and is still good to
        // navigate by; whatever else may go wrong is an error of this program.
        match integrate(&mut grid, &depth, &office, pose) {
            Ok(()) => {}
            Err(error @ Error::MapFull { .. }) => {
                eprintln!("mapping ends after {number} frames: {error}");
                break;
            }
            Err(error) => return Err(error.into()),
        }
    }
    println!("{} frames, {} voxels seen, {} bytes", grid.num_frames(), grid.num_observed()?, grid.nbytes());

    let way = &ahead[..PLANNED];
    match first_obstacle(&grid, way)? {
        None => println!("the next {PLANNED} poses are free"),
        Some((step, state, probability)) => {
            println!("{state:?} space at step {step} of {PLANNED} (occupied with a probability of {probability:.2})");
        }
    }

    let file = folder.join("office.pmap");
    grid.save(&file)?;
    let grid = OccupancyGrid::load(&file)?;
    let mesh = extract(&grid, &MeshOptions { min_evidence: 0.1, ..MeshOptions::default() })?;
    std::fs::write(folder.join("office.obj"), wavefront(&mesh))?;
    println!("{} triangles in {}", mesh.faces.len(), folder.join("office.obj").display());
    Ok(())
}

/// What the camera sees from a pose: z-depth in metres, row by row, 0 where it sees nothing.
fn take_image(office: &Scene, pose: &Pose, number: usize) -> Result<Vec<f32>, Error> {
    kinect_noise(&office.render(office.camera(), pose), office.camera(), number as u64)
}

fn integrate(grid: &mut OccupancyGrid, depth: &[f32], office: &Scene, pose: &Pose) -> Result<(), Error> {
    let camera = office.camera();
    let image = DepthImage::new(Depth::F32(depth), camera.width, camera.height)?;
    grid.integrate(&image, camera, pose).map(|_| ())
}

/// The first step of a way on which the robot's body would not be in free space, what is there, and its probability.
fn first_obstacle(grid: &OccupancyGrid, way: &[Pose]) -> Result<Option<(usize, State, f32)>, Error> {
    for (step, pose) in way.iter().enumerate() {
        let (x, y, z) = (pose.translation.x, pose.translation.y, BODY_HEIGHT);
        let sides = [-CLEARANCE, 0.0, CLEARANCE];
        let body: Vec<_> = sides.iter().flat_map(|dx| sides.map(|dy| [x + dx, y + dy, z])).collect();
        let states = grid.state(&body)?;
        // Where nobody has looked a robot should not go either.
        if let Some(place) = states.iter().position(|&state| state != State::Free) {
            return Ok(Some((step, states[place], grid.probability(&body, Interpolation::Nearest)?[place])));
        }
    }
    Ok(None)
}

/// The mesh as a Wavefront OBJ file, which counts vertices from 1.
fn wavefront(mesh: &Mesh) -> String {
    let mut obj = String::new();
    for [x, y, z] in &mesh.vertices {
        writeln!(obj, "v {x} {y} {z}").expect("a string takes all");
    }
    for [a, b, c] in mesh.faces.iter().map(|face| face.map(|vertex| vertex + 1)) {
        writeln!(obj, "f {a} {b} {c}").expect("a string takes all");
    }
    obj
}

#[cfg(test)]
mod tests {
    #[test]
    fn writes_a_map_and_a_mesh() {
        let folder = tempfile::tempdir().unwrap();
        super::run(folder.path()).unwrap();
        let grid = pyramap::OccupancyGrid::load(folder.path().join("office.pmap")).unwrap();
        assert_eq!(grid.num_frames(), super::WALKED as i64);
        let obj = std::fs::read_to_string(folder.path().join("office.obj")).unwrap();
        let count = |kind: &str| obj.lines().filter(|line| line.starts_with(kind)).count();
        assert!(count("v ") > 1000 && count("f ") > count("v "));
    }
}
