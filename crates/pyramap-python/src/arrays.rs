//! numpy arrays as the library takes them, and the errors of those that it does not.

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyramap::{Depth, DepthImage, Pose, Reading, Region};

/// An image of depths or ranges held for the length of a call: C-contiguous, of a type that the library knows.
pub struct ImageArray<'py> {
    data: ImageData<'py>,
    width: usize,
    height: usize,
    reading: Reading,
}

enum ImageData<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>),
    U16(PyReadonlyArrayDyn<'py, u16>, f64),
}

impl<'py> ImageArray<'py> {
    /// Takes either of the two arguments, and their scale.
    pub fn depth_or_ranges(
        depth: Option<&Bound<'py, PyAny>>,
        ranges: Option<&Bound<'py, PyAny>>,
        depth_scale: Option<f64>,
    ) -> PyResult<Self> {
        match (depth, ranges) {
            (Some(depth), None) => Self::depth(depth, depth_scale),
            (None, Some(ranges)) => Self::new(ranges, depth_scale, "ranges", Reading::Range),
            (None, None) => {
                Err(PyValueError::new_err("depth is a NoneType, expected a (H, W) numpy array, or ranges instead"))
            }
            (Some(_), Some(_)) => Err(PyValueError::new_err("depth and ranges are both given, expected one of them")),
        }
    }

    /// Takes the argument `depth`: (H, W) float32 or float64 metres, or uint16 with a scale; any strides, which cost a copy.
    pub fn depth(depth: &Bound<'py, PyAny>, depth_scale: Option<f64>) -> PyResult<Self> {
        Self::new(depth, depth_scale, "depth", Reading::Depth)
    }

    fn new(image: &Bound<'py, PyAny>, scale: Option<f64>, name: &str, reading: Reading) -> PyResult<Self> {
        let expected = "expected a (H, W) numpy array of float32 or float64 metres, or of uint16 with depth_scale";
        let array = image
            .cast::<PyUntypedArray>()
            .map_err(|_| PyValueError::new_err(format!("{name} is a {}, {expected}", type_name(image))))?;
        let &[height, width] = array.shape() else {
            return Err(PyValueError::new_err(format!("{name} has shape {:?}, {expected}", array.shape())));
        };
        let data = match (typed::<u16>(array)?, scale) {
            (Some(values), Some(scale)) => ImageData::U16(values, scale),
            (Some(_), None) => {
                return Err(PyValueError::new_err(format!(
                    "{name} is uint16 and depth_scale is missing, expected steps a metre (1000.0 for millimetres)"
                )));
            }
            (None, Some(scale)) => {
                return Err(PyValueError::new_err(format!(
                    "depth_scale is {scale} but {name} is {}, expected no scale for metres, or uint16 {name}",
                    array.dtype()
                )));
            }
            (None, None) => match (typed::<f32>(array)?, typed::<f64>(array)?) {
                (Some(values), _) => ImageData::F32(values),
                (_, Some(values)) => ImageData::F64(values),
                _ => return Err(PyValueError::new_err(format!("{name} has dtype {}, {expected}", array.dtype()))),
            },
        };
        Ok(Self { data, width, height, reading })
    }

    /// The image, to be used while the arrays are held.
    pub fn image(&self) -> PyResult<DepthImage<'_>> {
        let values = match &self.data {
            ImageData::F32(values) => Depth::F32(values.as_slice()?),
            ImageData::F64(values) => Depth::F64(values.as_slice()?),
            ImageData::U16(values, scale) => Depth::U16 { values: values.as_slice()?, scale: *scale },
        };
        match self.reading {
            Reading::Depth => DepthImage::new(values, self.width, self.height),
            Reading::Range => DepthImage::of_ranges(values, self.width, self.height),
        }
        .map_err(crate::errors::to_py)
    }
}

/// The array as one of `T`, C-contiguous and aligned (copied if it is not); `None` if its elements are others.
pub fn typed<'py, T: Element>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Option<PyReadonlyArrayDyn<'py, T>>> {
    if array.cast::<PyArrayDyn<T>>().is_err() {
        return Ok(None);
    }
    let plain = array.py().import("numpy")?.call_method1("require", (array, None::<()>, "CA"))?;
    Ok(Some(plain.cast::<PyArrayDyn<T>>()?.try_readonly()?))
}

/// A `world_from_camera`: anything that numpy makes a (4, 4) float64 array of.
pub fn pose(world_from_camera: &Bound<'_, PyAny>) -> PyResult<Pose> {
    let (rows, shape) = float64(world_from_camera, "world_from_camera")?;
    if shape != [4, 4] {
        return Err(PyValueError::new_err(format!("world_from_camera has shape {shape:?}, expected (4, 4)")));
    }
    Pose::from_rows(&std::array::from_fn(|r| std::array::from_fn(|c| rows[4 * r + c]))).map_err(crate::errors::to_py)
}

/// Many `world_from_camera`: anything that numpy makes an (N, 4, 4) float64 array of.
pub fn poses(poses: &Bound<'_, PyAny>) -> PyResult<Vec<Pose>> {
    let (values, shape) = float64(poses, "poses")?;
    if !matches!(shape[..], [_, 4, 4]) {
        return Err(PyValueError::new_err(format!("poses have shape {shape:?}, expected (N, 4, 4)")));
    }
    let pose = |(n, values): (usize, &[f64; 16])| {
        let rows = std::array::from_fn(|r| std::array::from_fn(|c| values[4 * r + c]));
        Pose::from_rows(&rows).map_err(|error| PyValueError::new_err(format!("poses[{n}] as a {error}")))
    };
    values.as_chunks().0.iter().enumerate().map(pose).collect()
}

/// A list of numbers: anything that numpy makes an (N,) float64 array of.
pub fn numbers(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    let (values, shape) = float64(value, name)?;
    match shape[..] {
        [_] => Ok(values),
        _ => Err(PyValueError::new_err(format!("{name} has shape {shape:?}, expected (N,)"))),
    }
}

/// World points: anything that numpy makes an (N, 3) float64 array of.
pub fn points(points: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 3]>> {
    Ok(Rows::new(points, "points")?.get()?.to_vec())
}

/// Rows of `N` numbers held for the length of a call: anything that numpy makes an (_, N) float64 array of, copied only
/// if it is not one already.
pub struct Rows<'py, const N: usize>(PyReadonlyArrayDyn<'py, f64>);

impl<'py, const N: usize> Rows<'py, N> {
    /// Takes the argument of this name.
    pub fn new(value: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        let (array, shape) = float64_array(value, name)?;
        match shape[..] {
            [_, columns] if columns == N => Ok(Self(array)),
            _ => Err(PyValueError::new_err(format!("{name} have shape {shape:?}, expected (N, {N})"))),
        }
    }

    /// The rows, to be used while the array is held.
    pub fn get(&self) -> PyResult<&[[f64; N]]> {
        Ok(self.0.as_slice()?.as_chunks().0)
    }
}

/// A box: anything that numpy makes a (2, 3) float64 array of, its lowest and its highest corner.
pub fn region(region: &Bound<'_, PyAny>) -> PyResult<Region> {
    let (values, shape) = float64(region, "region")?;
    match (&shape[..], values.as_chunks().0) {
        ([2, 3], &[low, high]) => Region::new(low, high).map_err(crate::errors::to_py),
        _ => Err(PyValueError::new_err(format!("region has shape {shape:?}, expected (2, 3): low and high corner"))),
    }
}

/// Coordinates of blocks or indices of voxels: an (N, 3) array of integers.
pub fn integers(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[i32; 3]>> {
    let expected = "expected an (N, 3) array of integers of at most 64 bits with sign";
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let dtype = array.getattr("dtype")?;
    let fits: bool = numpy.call_method1("can_cast", (&dtype, "int64"))?.extract()?;
    if !(kind == "i" || kind == "u") || !fits || shape.len() != 2 || shape[1] != 3 {
        return Err(PyValueError::new_err(format!("{name} have dtype {dtype} and shape {shape:?}, {expected}")));
    }
    let wide = numpy.call_method1("require", (array, "int64", "CA"))?;
    let wide = wide.cast::<PyArrayDyn<i64>>()?.try_readonly()?;
    let beyond = |c: &i64| PyValueError::new_err(format!("{name} hold {c}, expected numbers of 32 bits"));
    let keys: Result<Vec<i32>, &i64> = wide.as_slice()?.iter().map(|c| i32::try_from(*c).map_err(|_| c)).collect();
    Ok(keys.map_err(beyond)?.as_chunks().0.to_vec())
}

/// The elements of whatever numpy can make float64 of, in C order, and its shape.
fn float64(value: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let (array, shape) = float64_array(value, name)?;
    Ok((array.as_slice()?.to_vec(), shape))
}

/// The same without a copy where it is such an array already.
fn float64_array<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<(PyReadonlyArrayDyn<'py, f64>, Vec<usize>)> {
    let array = value.py().import("numpy")?.call_method1("require", (value, "float64", "CA")).map_err(|error| {
        PyValueError::new_err(format!("{name} is a {} that is no array of numbers: {error}", type_name(value)))
    })?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    Ok((array.cast::<PyArrayDyn<f64>>()?.try_readonly()?, shape))
}

pub fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "value".into(), |name| name.to_string())
}
