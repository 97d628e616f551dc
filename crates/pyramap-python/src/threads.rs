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
    with_pool(py, |pool| pool.install(work))
}

/// Runs `work` on the caller's thread with the GIL released; it takes its locks there and only then enters the pool.
/// A thread of the pool must never wait for a lock: while it waits for a part of its own work, it may take up another's,
/// and that would wait for what it holds itself.
pub fn with_pool<T: Send>(py: Python<'_>, work: impl FnOnce(&ThreadPool) -> pyramap::Result<T> + Send) -> PyResult<T> {
    let pool = pool()?;
    py.detach(|| work(&pool)).map_err(to_py)
}

/// Sets how many threads the mapper uses from now on, for all maps.
///
/// Without this call it is as many as the environment's `RAYON_NUM_THREADS` says, or as the machine has cores. Maps do
/// not depend on it. After a fork the child makes threads of its own, as many as if this had not been called; it may
/// use every map that no other thread of the parent was using at that moment.
///
/// Args:
///     n: At least 1.
///
/// Raises:
///     ValueError: If `n` is less than 1, or more than a pool can have.
///     OSError: If the system does not give as many.
#[pyfunction]
pub fn set_num_threads(n: i64) -> PyResult<()> {
    match usize::try_from(n) {
        Ok(threads) if (1..=rayon::max_num_threads()).contains(&threads) => replace(threads).map(|_| ()),
        _ => {
            Err(PyValueError::new_err(format!("number of threads is {n}, expected 1 to {}", rayon::max_num_threads())))
        }
    }
}

/// How many threads the mapper uses.
///
/// Raises:
///     OSError: If there are none yet and the system does not give any.
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
    // A pool inherited through a fork has no threads, and one of them may have held a lock when they vanished: to drop
    // it could wait for ever.
    if let Some((process, inherited)) = old
        && process != std::process::id()
    {
        std::mem::forget(inherited);
    }
    Ok(pool)
}
