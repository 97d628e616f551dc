//! Errors of the library as Python exceptions.

use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyFileNotFoundError, PyOSError, PyPermissionError, PyValueError};
use pyo3::prelude::*;
use pyramap::Error;
use pyramap::error::DeviceFault;
use std::io::ErrorKind;

create_exception!(
    pyramap,
    MapFullError,
    PyException,
    "A frame or a merge would take the map beyond its `max_bytes`. The map is as it was before the call."
);

create_exception!(
    pyramap,
    DeviceError,
    PyException,
    "A GPU cannot be used, or failed. The message says what was found, and what became of the map."
);
create_exception!(
    pyramap,
    DeviceNotFoundError,
    DeviceError,
    "There is no such GPU, or none that can be used. The message says what was found and what to install."
);
create_exception!(
    pyramap,
    DeviceForkedError,
    DeviceError,
    "This process was forked from one that had opened a GPU; devices do not survive that."
);
create_exception!(
    pyramap,
    DeviceLostError,
    DeviceError,
    "The GPU went away, or hangs. What had not been read from it before is gone."
);
create_exception!(
    pyramap,
    DeviceMemoryError,
    DeviceError,
    "The GPU has no more memory. The map is as it was before the frame."
);

/// The exception for an error, with the same words.
pub fn to_py(error: Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::MapFull { .. } => MapFullError::new_err(message),
        Error::Device { fault, .. } => match fault {
            DeviceFault::NotFound => DeviceNotFoundError::new_err(message),
            DeviceFault::Lost => DeviceLostError::new_err(message),
            DeviceFault::OutOfMemory => DeviceMemoryError::new_err(message),
            DeviceFault::Forked => DeviceForkedError::new_err(message),
            DeviceFault::Internal => DeviceError::new_err(message),
        },
        Error::File { .. } => PyOSError::new_err(message),
        Error::Io { source, .. } => match source.kind() {
            ErrorKind::NotFound => PyFileNotFoundError::new_err(message),
            ErrorKind::PermissionDenied => PyPermissionError::new_err(message),
            _ => PyOSError::new_err(message),
        },
        _ => PyValueError::new_err(message),
    }
}
