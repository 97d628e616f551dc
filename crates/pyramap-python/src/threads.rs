//! Work without the GIL, on a thread pool of this process.

use crate::errors::to_py;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::{Arc, PoisonError, RwLock};

/// The pool, and the process that made it: threads do not survive a fork, so a child makes its own.
static POOL: RwLock<Option<(u32, Arc<ThreadPool>)>> = RwLock::new(None);

/// Runs `work` on the pool with the GIL released.
pub fn run<T: Send>(py: Python<'_>, work: impl FnOnce() -> pyramap::Result<T> + Send) -> PyResult<T> {
    let pool = pool()?;
    py.detach(|| pool.install(work)).map_err(to_py)
}

/// Use `n` threads from now on, at least one. Without this call it is as many as `RAYON_NUM_THREADS` says, or as the
/// machine has cores.
#[pyfunction]
pub fn set_num_threads(n: usize) -> PyResult<()> {
    if n == 0 {
        return Err(PyValueError::new_err("number of threads is 0, expected at least 1"));
    }
    replace(n).map(|_| ())
}

/// How many threads are in use.
#[pyfunction]
pub fn num_threads() -> PyResult<usize> {
    Ok(pool()?.current_num_threads())
}

fn pool() -> PyResult<Arc<ThreadPool>> {
    match &*POOL.read().unwrap_or_else(PoisonError::into_inner) {
        Some((process, pool)) if *process == std::process::id() => return Ok(pool.clone()),
        _ => {}
    }
    // 0 leaves the number to rayon, which asks RAYON_NUM_THREADS and then the machine.
    replace(0)
}

fn replace(num_threads: usize) -> PyResult<Arc<ThreadPool>> {
    let pool = ThreadPoolBuilder::new().num_threads(num_threads).thread_name(|i| format!("pyramap-{i}")).build();
    let pool = Arc::new(pool.map_err(|error| PyOSError::new_err(format!("no thread pool: {error}")))?);
    let mut current = POOL.write().unwrap_or_else(PoisonError::into_inner);
    let old = current.replace((std::process::id(), pool.clone()));
    // A pool inherited through a fork has no threads to join: waiting for them would never end.
    if let Some((process, inherited)) = old
        && process != std::process::id()
    {
        std::mem::forget(inherited);
    }
    Ok(pool)
}
