//! Python bindings: one line a method, errors mapped in one place ([`errors`]), the GIL released in one ([`threads`]).

mod arrays;
mod camera;
mod change;
mod clouds;
mod colour;
mod devices;
mod distance;
mod errors;
mod explore;
mod frame;
mod grid;
mod mesh;
mod octomap;
mod orthographic;
mod properties;
mod queries;
mod scenes;
mod sensor;
mod sensors;
mod stages;
mod stats;
mod threads;

use pyo3::prelude::*;

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("MapFullError", m.py().get_type::<errors::MapFullError>())?;
    m.add("DeviceError", m.py().get_type::<errors::DeviceError>())?;
    m.add("DeviceForkedError", m.py().get_type::<errors::DeviceForkedError>())?;
    m.add("DeviceNotFoundError", m.py().get_type::<errors::DeviceNotFoundError>())?;
    m.add("DeviceLostError", m.py().get_type::<errors::DeviceLostError>())?;
    m.add("DeviceMemoryError", m.py().get_type::<errors::DeviceMemoryError>())?;
    m.add_class::<devices::Device>()?;
    m.add_function(wrap_pyfunction!(devices::devices, m)?)?;
    m.add_class::<camera::PinholeCamera>()?;
    m.add_class::<sensor::SensorModel>()?;
    m.add_class::<sensors::SphericalSensor>()?;
    m.add_class::<orthographic::OrthographicCamera>()?;
    m.add_class::<grid::OccupancyGrid>()?;
    m.add_class::<stats::FrameStats>()?;
    m.add_class::<mesh::Mesh>()?;
    m.add_class::<queries::RayHits>()?;
    m.add_class::<distance::DistanceField>()?;
    m.add_class::<explore::Frontiers>()?;
    m.add_class::<explore::ViewGain>()?;
    m.add("OCTOMAP_CLAMP", octomap::octomap_clamp())?;
    m.add_function(wrap_pyfunction!(octomap::load_octomap, m)?)?;
    m.add_function(wrap_pyfunction!(stages::ranges, m)?)?;
    m.add_function(wrap_pyfunction!(stages::pyramid, m)?)?;
    m.add_function(wrap_pyfunction!(clouds::range_image, m)?)?;
    m.add_function(wrap_pyfunction!(threads::set_num_threads, m)?)?;
    m.add_function(wrap_pyfunction!(threads::num_threads, m)?)?;
    scenes::register(m)
}
