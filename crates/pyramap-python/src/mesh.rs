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
}

impl Mesh {
    pub fn new(py: Python<'_>, mesh: pyramap::mesh::Mesh) -> PyResult<Self> {
        Ok(Self { vertices: rows(py, mesh.vertices)?, faces: rows(py, mesh.faces)?, normals: rows(py, mesh.normals)? })
    }
}

fn rows<T: Element>(py: Python<'_>, rows: Vec<[T; 3]>) -> PyResult<Py<PyArray2<T>>> {
    let count = rows.len();
    Ok(PyArray1::from_vec(py, rows.into_flattened()).reshape([count, 3])?.unbind())
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

    /// The mesh as a `trimesh.Trimesh`, to be measured, shown, or written as PLY, OBJ, STL or GLB.
    ///
    /// Returns:
    ///     A `trimesh.Trimesh` with the same vertices and faces in the same order, and the normals.
    fn to_trimesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let arguments = pyo3::types::PyDict::new(py);
        arguments.set_item("vertices", self.vertices(py))?;
        arguments.set_item("faces", self.faces(py))?;
        arguments.set_item("vertex_normals", self.normals(py))?;
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
