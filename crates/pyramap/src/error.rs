//! Everything that can go wrong, each saying what was wrong, what was got and what was expected.

use std::path::PathBuf;

/// The result of anything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// Why an operation was refused. The map is then as it was before.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An intrinsic parameter of a camera.
    #[error("camera {name} is {got}, expected {expected}")]
    Camera {
        /// The parameter.
        name: &'static str,
        /// Its value.
        got: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// A `world_from_camera` that is not a rigid transform.
    #[error("world_from_camera: {entry} is {got}, expected {expected}")]
    Pose {
        /// Which entry or product of entries.
        entry: String,
        /// Its value.
        got: f64,
        /// What it may be.
        expected: String,
    },
    /// Any other parameter out of its range.
    #[error("{name} is {got}, expected {expected}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its value.
        got: String,
        /// What it may be.
        expected: String,
    },
    /// An image that does not fit its sensor.
    #[error("{image} is {got_height} x {got_width} (height x width), expected the camera's {height} x {width}")]
    ImageSize {
        /// What kind of image.
        image: &'static str,
        /// Columns of the image.
        got_width: usize,
        /// Rows of the image.
        got_height: usize,
        /// Columns of the camera.
        width: usize,
        /// Rows of the camera.
        height: usize,
    },
    /// A place beyond the coordinates that the grid can address.
    #[error("{what} lies at {got} m, expected within {limit} m of the origin on each axis (voxel size {voxel_size} m)")]
    OutOfBounds {
        /// What lies there.
        what: &'static str,
        /// The offending coordinate.
        got: f64,
        /// The largest allowed.
        limit: f64,
        /// The grid's voxel edge.
        voxel_size: f64,
    },
    /// The frame would take the map beyond its byte budget.
    #[error("map is full: the frame needs {needed} bytes, max_bytes is {max_bytes}")]
    MapFull {
        /// Bytes the map would then take.
        needed: usize,
        /// The budget.
        max_bytes: usize,
    },
    /// An operation that this map cannot do.
    #[error("{operation} is not possible: {reason}")]
    Unsupported {
        /// What was asked.
        operation: &'static str,
        /// Why not.
        reason: String,
    },
    /// A graphics card, or what stands between it and us.
    #[error("{reason}")]
    Device {
        /// What kind of fault it is.
        fault: DeviceFault,
        /// What was found, and what became of the map.
        reason: String,
    },
    /// A file that is not a map, or not a whole one.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The operating system refused to read or write.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's word.
        source: std::io::Error,
    },
}

/// What can go wrong with a device, and what is left of a map on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceFault {
    /// There is no such device, or none that can be used.
    NotFound,
    /// The device went away or hangs, and took along what was not read from it before.
    Lost,
    /// The device has no more memory. The map is as it was.
    OutOfMemory,
    /// The process was forked after the device was opened; devices do not survive that.
    Forked,
    /// The driver refused what it was given: a defect of ours or of the driver. The map is as it was.
    Internal,
}
