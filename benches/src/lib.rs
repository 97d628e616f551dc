//! The frames that the benchmarks run on, and the maps made of them.
//!
//! Frames are real, of the 7-Scenes Red Kitchen, where that lies in `$PYRAMAP_DATA/redkitchen` or beside the repository
//! in `shared/data/redkitchen`; otherwise they are those of the simulated office, with a Kinect's noise.

use pyramap::{Depth, DepthImage, Error, FrameStats, GridConfig, OccupancyGrid, PinholeCamera, Pose, UpdateRule};
use pyramap_scenes::{kinect_noise, office_loop};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// How many frames the benchmarks take that say nothing else.
const COUNT: usize = 16;
/// Millimetres: steps in a metre.
const DEPTH_SCALE: f64 = 1000.0;

/// Voxel sizes, metres.
pub const VOXEL_SIZES: [f64; 4] = [0.16, 0.08, 0.04, 0.02];

/// The update rules and their names; those that a voxel size is measured with.
pub fn rules(voxel_size: f64) -> impl Iterator<Item = (&'static str, UpdateRule)> {
    let ideal_takes_seconds = voxel_size < VOXEL_SIZES[0];
    let rules = [
        ("pyramid", UpdateRule::Pyramid),
        ("area", UpdateRule::Area),
        ("min_layer", UpdateRule::MinLayer),
        ("ideal", UpdateRule::Ideal),
    ];
    rules.into_iter().filter(move |&(_, rule)| !(rule == UpdateRule::Ideal && ideal_takes_seconds))
}

/// A depth image and where it was taken.
pub struct Frame {
    /// Millimetres, 0 where there is no reading.
    pub depth: Vec<u16>,
    /// `world_from_camera`.
    pub pose: Pose,
}

/// Frames of one camera.
pub struct Frames {
    /// Where they come from: results on other frames are not to be compared.
    pub source: &'static str,
    /// The camera.
    pub camera: PinholeCamera,
    /// In the order of time.
    pub frames: Vec<Frame>,
}

impl Frames {
    /// Sixteen frames, real where there are any, else simulated.
    ///
    /// # Panics
    /// As [`Frames::spread`].
    pub fn load() -> Self {
        Self::spread(COUNT)
    }

    /// Frames spread evenly over a sequence, from its first on: real where there are any, else simulated.
    ///
    /// # Panics
    /// If real frames are there and cannot be read: a benchmark must not go on with others in silence.
    pub fn spread(count: usize) -> Self {
        match kitchen_folder() {
            Some(folder) => kitchen(&folder, count),
            None => Self::simulated(count),
        }
    }

    /// Frames of the simulated office, spread evenly over its loop: the same on every machine.
    pub fn simulated(count: usize) -> Self {
        office(count)
    }

    /// The image of a frame, as maps take it.
    pub fn image<'a>(&self, frame: &'a Frame) -> DepthImage<'a> {
        let depth = Depth::U16 { values: &frame.depth, scale: DEPTH_SCALE };
        DepthImage::new(depth, self.camera.width, self.camera.height).expect("sizes were checked on reading")
    }

    /// Fuses one frame into a map.
    ///
    /// # Errors
    /// As [`OccupancyGrid::integrate`].
    pub fn integrate(&self, grid: &mut OccupancyGrid, frame: &Frame) -> Result<FrameStats, Error> {
        grid.integrate(&self.image(frame), &self.camera, &frame.pose)
    }

    /// The map of all frames.
    pub fn map(&self, config: GridConfig) -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(config).expect("a valid configuration");
        for frame in &self.frames {
            self.integrate(&mut grid, frame).expect("a valid frame");
        }
        grid
    }
}

/// The parameters of a map: those of [`GridConfig::new`] but for the rule.
pub fn config(voxel_size: f64, update: UpdateRule) -> GridConfig {
    let mut config = GridConfig::new(voxel_size).expect("a valid voxel size");
    config.update = update;
    config
}

fn kitchen_folder() -> Option<PathBuf> {
    let data = match std::env::var_os("PYRAMAP_DATA") {
        Some(data) => PathBuf::from(data),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
    };
    Some(data.join("redkitchen")).filter(|folder| folder.is_dir())
}

/// No reading, besides 0.
const INVALID: u16 = u16::MAX;

fn kitchen(folder: &Path, count: usize) -> Frames {
    let mut images: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.to_string_lossy().ends_with(".depth.png"))
        .collect();
    images.sort();
    assert!(images.len() >= count, "{}: {} depth images, expected {count}", folder.display(), images.len());
    // What the data set's authors give for all its scenes.
    let camera = PinholeCamera::new(640, 480, 585.0, 585.0, 320.0, 240.0).expect("valid intrinsics");
    let read = |n: usize| {
        let path = &images[n * images.len() / count];
        let depth = read_depth(path, &camera).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let path = PathBuf::from(path.to_string_lossy().replace(".depth.png", ".pose.txt"));
        let pose = read_pose(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Frame { depth, pose }
    };
    Frames { source: "redkitchen", camera, frames: (0..count).map(read).collect() }
}

fn read_depth(path: &Path, camera: &PinholeCamera) -> Result<Vec<u16>, Box<dyn std::error::Error>> {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path)?)).read_info()?;
    let info = reader.info();
    let got = (info.width as usize, info.height as usize, info.color_type, info.bit_depth);
    let expected = (camera.width, camera.height, png::ColorType::Grayscale, png::BitDepth::Sixteen);
    if got != expected {
        return Err(format!("image is {got:?}, expected {expected:?}").into());
    }
    let mut bytes = vec![0; 2 * camera.width * camera.height];
    reader.next_frame(&mut bytes)?;
    let millimetres = bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]));
    Ok(millimetres.map(|depth| if depth == INVALID { 0 } else { depth }).collect())
}

fn read_pose(path: &Path) -> Result<Pose, Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(path)?;
    let numbers = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let numbers: [f64; 16] =
        numbers.try_into().map_err(|got: Vec<f64>| format!("{} numbers, expected 16", got.len()))?;
    Ok(Pose::from_rows(&std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column])))?)
}

fn office(count: usize) -> Frames {
    let scene = office_loop();
    let render = |n: usize| {
        let pose = scene.poses()[n * scene.poses().len() / count];
        let exact = scene.render(scene.camera(), &pose);
        let metres = kinect_noise(&exact, scene.camera(), n as u64).expect("an image of the camera's size");
        Frame { depth: metres.iter().map(|z| (f64::from(*z) * DEPTH_SCALE).round() as u16).collect(), pose }
    };
    Frames { source: "office", camera: *scene.camera(), frames: (0..count).map(render).collect() }
}
