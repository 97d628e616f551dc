//! Probabilistic 3D occupancy mapping from depth images: what is free, what is occupied, and what nobody has seen.
//!
//! The method is that of Pirker, Rüther, Schweighofer and Bischof, *Fast and Accurate Environment Modeling using
//! Three-Dimensional Occupancy Grids* (2011), "the paper" in these pages; "Eq. n" is that paper's. A frame runs through
//! five stages, each in a module of its name:
//!
//! [`ranges`] → [`pyramid`] (as the sensor sees it: [`surfaces`]) → [`cull`] → [`update`] → [`commit`]
//!
//! [`OccupancyGrid`] is the map, [`GridConfig`] its parameters; [`mesh`] and [`mod@file`] read it.
//!
//! Camera axes are x right, y down, z forward; integer pixel coordinates are pixel centres; depth is z-depth, metres;
//! a pose is `world_from_camera`.

pub mod backend;
pub mod block;
pub mod camera;
pub mod collide;
pub mod colour;
pub mod commit;
pub mod config;
pub mod cpu;
pub mod cull;
pub mod dense;
pub mod depth;
pub mod directory;
mod disjoint_sets;
pub mod distance;
pub mod error;
pub mod file;
pub mod frontier;
pub mod grid;
pub mod history;
pub mod log_odds;
mod mask;
pub mod mesh;
pub mod octomap;
pub mod pool;
pub mod pose;
pub mod pyramid;
pub mod query;
pub mod ranges;
mod ray;
pub mod rays;
pub mod region;
pub mod sensor;
pub mod sensors;
pub mod simd;
pub mod state;
pub mod stats;
pub mod surfaces;
pub mod update;
pub mod view;
pub mod view_gain;
pub mod voxels;
mod window;

pub use camera::PinholeCamera;
pub use colour::ColourImage;
pub use config::GridConfig;
pub use depth::{Depth, DepthImage, Reading};
pub use distance::DistanceField;
pub use error::{Error, Result};
pub use grid::OccupancyGrid;
pub use grid::change::decay_factor;
pub use history::History;
pub use pose::Pose;
pub use query::Interpolation;
pub use ranges::BeyondMaxRange;
pub use rays::RayHits;
pub use region::Region;
pub use sensor::{SensorModel, SurfaceOffset};
pub use sensors::{Distortion, OrthographicCamera, Sensor, SphericalSensor};
pub use state::{State, Unknown};
pub use stats::FrameStats;
pub use update::UpdateRule;
