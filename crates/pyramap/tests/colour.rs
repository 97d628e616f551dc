//! Colour through the crate's own interface: what a wall is painted with, and that frames come and go.

use pyramap::block::Blocks;
use pyramap::mesh::{MeshOptions, extract};
use pyramap::{ColourImage, Depth, DepthImage, Distortion, Error, GridConfig, OccupancyGrid, PinholeCamera, Pose};

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

fn camera() -> PinholeCamera {
    PinholeCamera::new(WIDTH, HEIGHT, 58.5, 58.5, 31.5, 23.5).unwrap()
}

fn grid(colour: bool) -> OccupancyGrid {
    let mut config = GridConfig::new(0.05).unwrap();
    config.colour = colour;
    OccupancyGrid::new(config).unwrap()
}

/// Left half red, right half blue.
fn halves() -> Vec<[u8; 3]> {
    (0..WIDTH * HEIGHT).map(|pixel| if pixel % WIDTH < WIDTH / 2 { [250, 0, 0] } else { [0, 0, 250] }).collect()
}

#[test]
fn a_wall_is_painted_and_washed() {
    let (wall, pixels) = (vec![2.0; WIDTH * HEIGHT], halves());
    let colour = ColourImage::new(&pixels, WIDTH, HEIGHT, &camera(), &Pose::identity()).unwrap();
    let image = DepthImage::new(Depth::F32(&wall), WIDTH, HEIGHT).unwrap().with_colour(colour);
    let mut grid = grid(true);
    grid.integrate(&image, &camera(), &Pose::identity()).unwrap();

    let colours = grid.colour(&[[-0.5, 0.0, 2.0], [0.5, 0.0, 2.0], [0.5, 0.0, 1.0], [0.0, 3.0, 2.0]]).unwrap();
    assert_eq!(colours, [[250, 0, 0, 255], [0, 0, 250, 255], [0; 4], [0; 4]]);
    let mesh = extract(&grid, &MeshOptions::default()).unwrap();
    for (vertex, colour) in mesh.vertices.iter().zip(mesh.colours.unwrap()) {
        // A voxel is 1.5 pixels wide, and texels are interpolated: the border is not sharp.
        if vertex[0].abs() > 0.15 {
            assert_eq!(colour, if vertex[0] < 0.0 { [250, 0, 0, 255] } else { [0, 0, 250, 255] }, "at {vertex:?}");
        }
    }

    let painted = grid.nbytes();
    grid.remove(&image, &camera(), &Pose::identity()).unwrap();
    assert_eq!(grid.colours().unwrap().keys().count(), 0);
    assert!(grid.nbytes() < painted);
}

/// A lens bends the picture, and the colours with it: a barrel moves what is far out inwards.
#[test]
fn the_colour_camera_may_have_a_lens() {
    let lens = Distortion { k1: -0.3, ..Distortion::default() };
    let bent = camera().with_distortion(lens).unwrap();
    // What each pixel of the bent image shows, found by walking outwards from its middle.
    let reds = (0..WIDTH * HEIGHT).map(|pixel| {
        let [x, y] = [(pixel % WIDTH) as f64 - 31.5, (pixel / WIDTH) as f64 - 23.5].map(|c| c / 58.5);
        let distorted = x.hypot(y);
        let plain = (0..20_000).map(|n| f64::from(n) * 1e-4).find(|r| r * (1.0 - 0.3 * r * r) >= distorted);
        let flat_x = plain.map_or(9.0, |plain| if distorted > 0.0 { x * plain / distorted } else { 0.0 });
        [(128.0 + 150.0 * flat_x).clamp(0.0, 255.0).round() as u8, 0, 0]
    });
    let (wall, pixels) = (vec![2.0; WIDTH * HEIGHT], reds.collect::<Vec<_>>());
    let colour = ColourImage::new(&pixels, WIDTH, HEIGHT, &bent, &Pose::identity()).unwrap();
    let image = DepthImage::new(Depth::F32(&wall), WIDTH, HEIGHT).unwrap().with_colour(colour);
    let mut grid = grid(true);
    grid.integrate(&image, &camera(), &Pose::identity()).unwrap();
    for x in [-0.85, -0.5, 0.0, 0.3, 0.7, 0.85] {
        let [[red, _, _, seen]] = grid.colour(&[[x, 0.01, 2.0]]).unwrap()[..] else { panic!("one point") };
        let centre = (f64::floor(x / 0.05) + 0.5) * 0.05;
        // The voxel's centre is seen along x / z; its depth is within a voxel of 2 m. A pixel is 2.6 levels wide.
        let expected = 128.0 + 150.0 * centre / 2.025;
        assert_eq!(seen, 255);
        assert!((f64::from(red) - expected).abs() < 3.0, "{red} for {expected} at {x}");
    }
}

#[test]
fn a_map_without_colour_says_so() {
    let (wall, pixels) = (vec![2.0; WIDTH * HEIGHT], halves());
    let colour = ColourImage::new(&pixels, WIDTH, HEIGHT, &camera(), &Pose::identity()).unwrap();
    let image = DepthImage::new(Depth::F32(&wall), WIDTH, HEIGHT).unwrap().with_colour(colour);
    let mut grid = grid(false);
    let error = grid.integrate(&image, &camera(), &Pose::identity()).unwrap_err();
    assert!(matches!(error, Error::Unsupported { .. }), "{error}");
    assert_eq!((grid.num_blocks(), grid.num_frames()), (0, 0));
    assert!(grid.colour(&[[0.0; 3]]).is_err());
    assert!(ColourImage::new(&pixels[1..], WIDTH, HEIGHT, &camera(), &Pose::identity()).is_err());
    assert!(ColourImage::new(&pixels, HEIGHT, WIDTH, &camera(), &Pose::identity()).is_err());
}
