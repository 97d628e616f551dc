//! `Scene`: the simulated scenes. `pyramap.scenes` adds the frames.

use crate::arrays::{points, pose};
use crate::camera::PinholeCamera;
use crate::sensors::AnySensor;
use crate::threads::run;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap_scenes::nalgebra::Vector3;
use pyramap_scenes::{box_scene, kinect_noise, office_loop, spheres};

/// Adds this module's classes.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<Scene>()
}

/// The base of `pyramap.scenes.Scene`.
#[pyclass(frozen, subclass, module = "pyramap")]
pub struct Scene(pyramap_scenes::Scene);

#[pymethods]
impl Scene {
    #[new]
    fn new(name: &str) -> PyResult<Self> {
        match name {
            "box" => Ok(Self(box_scene())),
            "spheres" => Ok(Self(spheres())),
            "office_loop" => Ok(Self(office_loop())),
            _ => Err(PyValueError::new_err(format!(
                "scene is {name:?}, expected \"box\", \"spheres\" or \"office_loop\""
            ))),
        }
    }

    /// "box", "spheres" or "office_loop".
    #[getter]
    fn name(&self) -> &'static str {
        self.0.name()
    }

    /// The camera that the poses are made for.
    #[getter]
    fn camera(&self) -> PinholeCamera {
        PinholeCamera(*self.0.camera())
    }

    /// The views: `world_from_camera` of each, (N, 4, 4) float64, metres.
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let poses = self.0.poses();
        let mut values = Vec::with_capacity(16 * poses.len());
        for pose in poses {
            for row in 0..3 {
                values.extend(&pose.rotation.row(row));
                values.push(pose.translation[row]);
            }
            values.extend([0.0, 0.0, 0.0, 1.0]);
        }
        PyArray1::from_vec(py, values).reshape([poses.len(), 4, 4])
    }

    /// The depth image that a camera at a pose takes.
    ///
    /// The camera should be in free space: a solid that contains it is not drawn. A Kinect's axial noise is
    /// 0.0012 + 0.0019 (z - 0.4)^2 m (Nguyen, Izadi and Lovell 2012), its disparity comes in steps of 1/8 pixel, and it has
    /// no reading at edges, in the projector's shadow, at grazing angles, and outside of 0.8 to 5 m.
    ///
    /// Args:
    ///     camera: Of any size.
    ///     world_from_camera: (4, 4) rigid transform, metres.
    ///     noise: None for exact depth; an integer, the seed, for what a Kinect would have measured.
    ///
    /// Returns:
    ///     (H, W) float32 z-depth in metres at the pixel centres; 0 where there is no surface, or no reading.
    ///
    /// Raises:
    ///     ValueError: If the pose is not finite or not rigid.
    #[pyo3(signature = (camera, world_from_camera, noise = None))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: PinholeCamera,
        world_from_camera: &Bound<'py, PyAny>,
        noise: Option<i64>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (camera, pose) = (camera.0, pose(world_from_camera)?);
        let depth = run(py, || {
            let exact = self.0.render(&camera, &pose);
            match noise {
                Some(seed) => kinect_noise(&exact, &camera, seed.cast_unsigned()),
                None => Ok(exact),
            }
        })?;
        PyArray1::from_vec(py, depth).reshape([camera.height, camera.width])
    }

    /// What any sensor at a pose measures, exactly: distances along its pixels' rays.
    ///
    /// The sensor should be in free space: a solid that contains it is not seen.
    ///
    /// Args:
    ///     camera: A sensor of any kind and size.
    ///     world_from_camera: (4, 4) rigid transform, metres: the sensor's pose.
    ///
    /// Returns:
    ///     (H, W) float32 metres; 0 where there is no surface.
    ///
    /// Raises:
    ///     ValueError: If the pose is not finite or not rigid.
    fn render_ranges<'py>(
        &self,
        py: Python<'py>,
        camera: AnySensor,
        world_from_camera: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (sensor, pose) = (camera.0, pose(world_from_camera)?);
        let ranges = run(py, || Ok(self.0.render_ranges(&sensor, &pose)))?;
        PyArray1::from_vec(py, ranges).reshape([sensor.height(), sensor.width()])
    }

    /// Distances to the nearest surface.
    ///
    /// Args:
    ///     points: (N, 3) world coordinates, metres.
    ///
    /// Returns:
    ///     (N,) float64 metres: positive in free space, and exact there; negative inside solids, where it is the depth
    ///     below the surface of one solid (a lower bound, if others cover that surface); NaN for a point that is not
    ///     finite.
    ///
    /// Raises:
    ///     ValueError: If the shape is another.
    #[pyo3(signature = (points))]
    fn signed_distance<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let py = points.py();
        let points = self::points(points)?;
        let distances = run(py, || {
            let points: Vec<_> = points.into_iter().map(Vector3::from).collect();
            Ok(self.0.signed_distance(&points))
        })?;
        Ok(PyArray1::from_vec(py, distances))
    }

    fn __repr__(&self) -> String {
        format!("<Scene {:?}, {} poses>", self.0.name(), self.0.poses().len())
    }
}
