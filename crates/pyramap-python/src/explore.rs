//! Where to look next: `OccupancyGrid.frontiers` and `OccupancyGrid.view_gain`, and what they give.

use crate::arrays;
use crate::camera::PinholeCamera;
use crate::grid::{OccupancyGrid, count};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyList;
use pyramap::frontier::{Frontier, FrontierOptions};
use pyramap::view_gain::ViewGain as Gain;

/// The frontiers of a map, the largest first, made by `OccupancyGrid.frontiers`: one entry, or row, for each.
#[pyclass(frozen, module = "pyramap")]
pub struct Frontiers {
    size: Py<PyArray1<i64>>,
    area: Py<PyArray1<f64>>,
    centre: Py<PyArray2<f64>>,
    normal: Py<PyArray2<f64>>,
    voxels: Py<PyList>,
}

impl Frontiers {
    fn new(py: Python<'_>, frontiers: Vec<Frontier>) -> PyResult<Self> {
        let rows = |get: fn(&Frontier) -> [f64; 3]| {
            let values: Vec<f64> = frontiers.iter().flat_map(get).collect();
            PyArray1::from_vec(py, values).reshape([frontiers.len(), 3]).map(Bound::unbind)
        };
        let (centre, normal) = (rows(|frontier| frontier.centre)?, rows(|frontier| frontier.normal)?);
        let size = PyArray1::from_iter(py, frontiers.iter().map(|frontier| frontier.voxels.len() as i64)).unbind();
        let area = PyArray1::from_iter(py, frontiers.iter().map(|frontier| frontier.area)).unbind();
        let voxels = PyList::empty(py);
        for frontier in frontiers {
            let count = frontier.voxels.len();
            voxels.append(PyArray1::from_vec(py, frontier.voxels.into_flattened()).reshape([count, 3])?)?;
        }
        Ok(Self { size, area, centre, normal, voxels: voxels.unbind() })
    }
}

#[pymethods]
impl Frontiers {
    /// Numbers of voxels, (F,) int64, falling.
    #[getter]
    fn size(&self, py: Python<'_>) -> Py<PyArray1<i64>> {
        self.size.clone_ref(py)
    }

    /// Areas of the border between free and unknown space, (F,) float64, square metres.
    ///
    /// A voxel with unknown neighbours in n_x, n_y, n_z of the directions along each axis has
    /// `r^2 sqrt(n_x^2 + n_y^2 + n_z^2)`: right for sheets along an axis and for diagonal ones, a few percent too large
    /// for those in between.
    #[getter]
    fn area(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.area.clone_ref(py)
    }

    /// Means of the voxels' centres, (F, 3) float64, metres. Where a frontier is curved that need not be free space.
    #[getter]
    fn centre(&self, py: Python<'_>) -> Py<PyArray2<f64>> {
        self.centre.clone_ref(py)
    }

    /// Mean directions from free towards unknown space, (F, 3) float64 unit vectors; 0 where they cancel out.
    #[getter]
    fn normal(&self, py: Python<'_>) -> Py<PyArray2<f64>> {
        self.normal.clone_ref(py)
    }

    /// The free voxels of each frontier: a list of (size, 3) int32 arrays of voxel indices, sorted by x, then y, then z.
    #[getter]
    fn voxels(&self, py: Python<'_>) -> Py<PyList> {
        self.voxels.clone_ref(py)
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.voxels.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!("Frontiers({} clusters)", self.__len__(py))
    }
}

/// What views would bring, made by `OccupancyGrid.view_gain`: one entry for each pose.
#[pyclass(frozen, module = "pyramap")]
pub struct ViewGain {
    unknown_volume: Py<PyArray1<f64>>,
    entropy_reduction: Py<PyArray1<f64>>,
}

#[pymethods]
impl ViewGain {
    /// Unknown volume in sight, (N,) float64, cubic metres.
    #[getter]
    fn unknown_volume(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.unknown_volume.clone_ref(py)
    }

    /// By how much the entropy of all voxels in sight is expected to fall, (N,) float64, bits.
    #[getter]
    fn entropy_reduction(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.entropy_reduction.clone_ref(py)
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.unknown_volume.bind(py).as_any().len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("ViewGain({} poses)", self.__len__(py)?))
    }
}

#[pymethods]
impl OccupancyGrid {
    /// Frontiers: where free space ends and nobody has looked any further.
    ///
    /// A free voxel is of the frontier if it shares a face with an unknown one; such voxels belong together if they touch
    /// by a face, an edge or a corner. The same map gives the same frontiers on any number of threads.
    ///
    /// Args:
    ///     min_size: Clusters with fewer voxels are left out.
    ///     max_extent: Clusters longer than this along an axis, metres, are halved until they are not; at least 8 voxels.
    ///         What one image leaves behind is often one sheet around all that it saw, whose centre is no place to go to.
    ///         Default: clusters stay whole.
    ///
    /// Returns:
    ///     The frontiers, those with the most voxels first.
    ///
    /// Raises:
    ///     ValueError: If `min_size` is negative, or `max_extent` less than 8 voxels.
    #[pyo3(signature = (min_size = 1, max_extent = None))]
    fn frontiers(&self, py: Python<'_>, min_size: i64, max_extent: Option<f64>) -> PyResult<Frontiers> {
        let options = FrontierOptions { min_size: count("min_size", min_size, "0 or more")?, max_extent };
        Frontiers::new(py, self.ask(py, |grid| grid.frontiers(&options))?)
    }

    /// What a camera would bring at each of many poses, were it there alone: for the choice of the next view.
    ///
    /// Rays go through the map until an occupied voxel stops them or `max_range` is reached. Unknown voxels let them
    /// pass: the answer is the most that a view may bring. Each ray stands for the volume of its pixels' pyramids, so that
    /// nothing is counted twice; a voxel that is half in sight counts half.
    ///
    /// The entropy of a voxel occupied with probability p is `-p log2 p - (1 - p) log2 (1 - p)` bits. What one reading
    /// is expected to take off it is the mutual information of the voxel and a binary sensor whose log-likelihood
    /// ratios are the sensor model's log-odds at a surface and in front of it (Eq. 7). It is summed over all voxels in
    /// sight, free, unknown and occupied ones. A `clamp` is not considered.
    ///
    /// Args:
    ///     camera: The camera, of any size.
    ///     poses: (N, 4, 4) rigid transforms, `world_from_camera`, metres. A camera in an occupied voxel sees nothing else.
    ///     max_range: How far the camera sees, metres, up to 4096 voxels. Default: the map's `max_range`.
    ///     stride: One ray is cast for so many columns and rows of pixels. Default: as many as are at most one voxel apart
    ///         at `max_range`. More is faster and rougher.
    ///
    /// Returns:
    ///     Unknown volume and expected reduction of entropy, one of each for a pose.
    ///
    /// Raises:
    ///     ValueError: If the shape is another, a pose is not finite, not rigid or beyond the coordinates of the map;
    ///         `max_range` is not positive or too far; or `stride` is less than 1.
    #[pyo3(signature = (camera, poses, max_range = None, stride = None))]
    fn view_gain(
        &self,
        camera: PinholeCamera,
        poses: &Bound<'_, PyAny>,
        max_range: Option<f64>,
        stride: Option<i64>,
    ) -> PyResult<ViewGain> {
        let py = poses.py();
        let poses = arrays::poses(poses)?;
        let stride = stride.map(|stride| count("stride", stride, "at least 1 pixel")).transpose()?;
        let gains = self.ask(py, |grid| grid.view_gain(&camera.0, &poses, max_range, stride))?;
        let array = |get: fn(&Gain) -> f64| PyArray1::from_iter(py, gains.iter().map(get)).unbind();
        Ok(ViewGain {
            unknown_volume: array(|gain| gain.unknown_volume),
            entropy_reduction: array(|gain| gain.entropy_reduction),
        })
    }
}
