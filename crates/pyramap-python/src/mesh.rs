//! `Mesh`.

use numpy::{Element, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

/// A triangle mesh in world coordinates: a surface of constant log-odds, made by `OccupancyGrid.mesh`.
///
/// Every vertex is used by a face, and faces that meet share their vertices.
#[pyclass(frozen, module = "pyramap")]
pub struct Mesh {
    vertices: Py<PyArray2<f32>>,
    faces: Py<PyArray2<u32>>,
    normals: Py<PyArray2<f32>>,
    colours: Option<Py<PyArray2<u8>>>,
}

/// What a vertex without a colour is painted with where a mesh has colours: a grey, opaque.
const NO_COLOUR: [u8; 4] = [128, 128, 128, 255];

impl Mesh {
    pub fn new(py: Python<'_>, mesh: pyramap::mesh::Mesh) -> PyResult<Self> {
        Ok(Self {
            vertices: rows(py, mesh.vertices)?,
            faces: rows(py, mesh.faces)?,
            normals: rows(py, mesh.normals)?,
            colours: mesh.colours.map(|colours| rows(py, colours)).transpose()?,
        })
    }
}

fn rows<T: Element, const N: usize>(py: Python<'_>, rows: Vec<[T; N]>) -> PyResult<Py<PyArray2<T>>> {
    let count = rows.len();
    Ok(PyArray1::from_vec(py, rows.into_flattened()).reshape([count, N])?.unbind())
}

#[pymethods]
impl Mesh {
    /// Positions of the vertices, (V, 3) float32, metres.
    #[getter]
    fn vertices(&self, py: Python<'_>) -> Py<PyArray2<f32>> {
        self.vertices.clone_ref(py)
    }

    /// Triangles as indices of vertices, (F, 3) uint32, counter-clockwise as seen from free space.
    #[getter]
    fn faces(&self, py: Python<'_>) -> Py<PyArray2<u32>> {
        self.faces.clone_ref(py)
    }

    /// Unit normals of the vertices, (V, 3) float32, towards free space.
    #[getter]
    fn normals(&self, py: Python<'_>) -> Py<PyArray2<f32>> {
        self.normals.clone_ref(py)
    }

    /// Colours of the vertices, (V, 4) uint8: red, green, blue, and 255; four zeros where no colour was seen. None if the map
    /// keeps no colours.
    ///
    /// A vertex lies between two voxels' centres, and so does its colour, or it is that of the one voxel that has any.
    #[getter]
    fn colours(&self, py: Python<'_>) -> Option<Py<PyArray2<u8>>> {
        self.colours.as_ref().map(|colours| colours.clone_ref(py))
    }

    /// The mesh as a `trimesh.Trimesh`, to be measured, shown, or written as PLY, OBJ, STL or GLB.
    ///
    /// Returns:
    ///     A `trimesh.Trimesh` with the same vertices and faces in the same order, the normals, and the colours if the mesh
    ///     has them, grey where none was seen. PLY and GLB files hold them.
    fn to_trimesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let arguments = pyo3::types::PyDict::new(py);
        arguments.set_item("vertices", self.vertices(py))?;
        arguments.set_item("faces", self.faces(py))?;
        arguments.set_item("vertex_normals", self.normals(py))?;
        if let Some(colours) = &self.colours {
            let colours = colours.bind(py).to_owned_array().into_raw_vec_and_offset().0;
            let painted = colours.as_chunks().0.iter().map(|&colour| if colour[3] == 0 { NO_COLOUR } else { colour });
            arguments.set_item("vertex_colors", rows(py, painted.collect())?)?;
        }
        // The mesh is welded and free of degenerate faces already: nothing is to be merged or dropped.
        arguments.set_item("process", false)?;
        py.import("trimesh")?.getattr("Trimesh")?.call((), Some(&arguments))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let count = |array: &Bound<'_, PyAny>| array.len();
        let (vertices, faces) = (count(self.vertices.bind(py).as_any())?, count(self.faces.bind(py).as_any())?);
        Ok(format!("Mesh({vertices} vertices, {faces} faces)"))
    }
}
