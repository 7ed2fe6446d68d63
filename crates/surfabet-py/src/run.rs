//! Long work: interpreter lock released, progress shown, Ctrl-C heard, threads bounded.

use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock, mpsc};
use std::time::Duration;

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use surfabet_geom::Progress;

use crate::arguments;
use crate::errors::{IntoPyErr, internal, wrong_type, wrong_value};

/// How often the waiting thread looks for signals and passes on progress.
const POLL: Duration = Duration::from_millis(50);

/// The pool set by [`set_num_threads`]; the global pool of rayon (all cores) when `None`.
static POOL: RwLock<Option<Arc<ThreadPool>>> = RwLock::new(None);

/// Set in a process that was forked: rayon's global pool has no threads there, and work handed to it would never end.
static IS_FORKED: AtomicBool = AtomicBool::new(false);

/// Set there as long as [`POOL`] is that of the parent, which has no threads either.
static IS_STALE: AtomicBool = AtomicBool::new(false);

/// A pool of so many threads; as many as there are cores for zero.
fn pool_of(n_threads: usize) -> PyResult<Arc<ThreadPool>> {
    let built = ThreadPoolBuilder::new().num_threads(n_threads).build();
    built.map(Arc::new).map_err(internal)
}

/// Puts a pool in the place of the one that there is.
fn replace_pool(pool: Option<Arc<ThreadPool>>) {
    let before =
        std::mem::replace(&mut *POOL.write().unwrap_or_else(PoisonError::into_inner), pool);
    if IS_STALE.swap(false, Ordering::AcqRel) {
        // To end it would be to wake threads that are not there.
        std::mem::forget(before);
    }
}

/// The pool that work is to run on; the global pool of rayon when `None`.
///
/// # Errors
/// An internal error where the system gives no threads.
fn pool() -> PyResult<Option<Arc<ThreadPool>>> {
    let kept = || POOL.read().unwrap_or_else(PoisonError::into_inner).clone();
    if IS_STALE.load(Ordering::Acquire) {
        // Not to be ended either, see above.
        let of_parent = std::mem::ManuallyDrop::new(kept());
        let n_threads = of_parent.as_ref().map_or(0, |pool| pool.current_num_threads());
        replace_pool(Some(pool_of(n_threads)?));
    }
    Ok(kept())
}

/// Runs short work without the interpreter lock on the threads that [`run`] uses.
///
/// # Errors
/// As [`pool`].
pub fn released<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool()?;
    Ok(py.detach(|| match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }))
}

/// What asks work on another thread to stop: signals reach the main thread alone.
#[pyclass(name = "Stop", module = "surfabet._core", frozen)]
#[derive(Default)]
pub struct PyStop {
    asked: Arc<AtomicBool>,
}

#[pymethods]
impl PyStop {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// From now on.
    fn set(&self) {
        self.asked.store(true, Ordering::Relaxed);
    }
}

struct Monitor {
    cancelled: AtomicBool,
    /// Set by others.
    stop: Option<Arc<AtomicBool>>,
    latest: Mutex<Option<(&'static str, f32)>>,
}

impl Progress for Monitor {
    fn update(&self, stage: &'static str, fraction: f32) {
        *self.latest.lock().unwrap_or_else(PoisonError::into_inner) = Some((stage, fraction));
    }

    fn is_cancelled(&self) -> bool {
        let is_set = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        is_set(&self.cancelled) || self.stop.as_deref().is_some_and(is_set)
    }
}

impl Monitor {
    /// Passes the newest state to `callback` and lets Python handle its signals.
    fn poll(&self, callback: Option<&Py<PyAny>>) -> PyResult<()> {
        let latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner).take();
        Python::attach(|py| {
            py.check_signals()?;
            if let (Some(callback), Some((stage, fraction))) = (callback, latest) {
                callback.call1(py, (stage, fraction))?;
            }
            Ok(())
        })
    }
}

/// Runs `work` on a thread of its own without the interpreter lock and waits for it.
///
/// `callback` is called as `callback(stage: str, fraction: float)` from the calling thread. When it raises, or
/// a signal handler does, the work is cancelled and that exception is raised here.
pub fn run<T, E>(
    py: Python<'_>,
    callback: Option<Py<PyAny>>,
    work: impl FnOnce(&dyn Progress) -> Result<T, E> + Send,
) -> PyResult<T>
where
    T: Send,
    E: IntoPyErr + Send,
{
    run_until(py, callback, None, work)
}

/// As [`run`]; the work is cancelled too when `stop` is set.
pub fn run_until<T, E>(
    py: Python<'_>,
    callback: Option<Py<PyAny>>,
    stop: Option<&PyStop>,
    work: impl FnOnce(&dyn Progress) -> Result<T, E> + Send,
) -> PyResult<T>
where
    T: Send,
    E: IntoPyErr + Send,
{
    if let Some(callback) = &callback {
        let callback = callback.bind(py);
        if !callback.is_callable() {
            return Err(wrong_type("progress", callback, "None or a callable"));
        }
    }
    let stop = stop.map(|stop| Arc::clone(&stop.asked));
    let monitor = Monitor { cancelled: AtomicBool::new(false), stop, latest: Mutex::new(None) };
    let mut work = Some(work);
    let mut outcome = None;
    watch(py, &monitor, callback.as_ref(), &mut || {
        outcome = work.take().map(|work| work(&monitor));
    })?;
    match outcome {
        Some(Ok(value)) => monitor.poll(callback.as_ref()).map(|()| value),
        Some(Err(error)) => Err(error.into_py_err()),
        None => Err(internal("a worker thread ended early")),
    }
}

/// The part of [`run`] that is the same for every result, and so is compiled once: runs `work` on a thread of its own,
/// passes on what `monitor` learns meanwhile, and raises what `callback`, a signal handler or a panic raises.
fn watch(
    py: Python<'_>,
    monitor: &Monitor,
    callback: Option<&Py<PyAny>>,
    work: &mut (dyn FnMut() + Send),
) -> PyResult<()> {
    let pool = pool()?;
    py.detach(|| {
        std::thread::scope(|scope| {
            let (done, is_done) = mpsc::channel();
            let worker = scope.spawn(move || {
                let result = std::panic::catch_unwind(AssertUnwindSafe(|| match pool {
                    Some(pool) => pool.install(work),
                    None => work(),
                }));
                // The receiver lives until this thread is joined.
                let _ = done.send(());
                result
            });
            let mut interrupted = None;
            while is_done.recv_timeout(POLL).is_err() {
                if interrupted.is_none()
                    && let Err(error) = monitor.poll(callback)
                {
                    interrupted = Some(error);
                    monitor.cancelled.store(true, Ordering::Relaxed);
                }
            }
            let outcome = worker.join().unwrap_or_else(Err);
            if let Some(error) = interrupted {
                return Err(error);
            }
            outcome.map_err(|panic| {
                let message = panic
                    .downcast_ref::<String>()
                    .map(String::as_str)
                    .or_else(|| panic.downcast_ref::<&str>().copied())
                    .unwrap_or("a worker thread ended early");
                internal(message)
            })
        })
    })
}

/// Bounds the threads that surfabet uses from now on; `None` gives back all cores. Results do not depend on it.
#[pyfunction]
#[pyo3(signature = (n_threads))]
fn set_num_threads(n_threads: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
    let requirement = "None or an integer from 1 to 1024";
    let pool = match n_threads {
        None if IS_FORKED.load(Ordering::Acquire) => Some(pool_of(0)?),
        None => None,
        Some(given) => {
            let n: usize = arguments::integer("n_threads", given, requirement)?;
            if !(1..=1024).contains(&n) {
                return Err(wrong_value("n_threads", given, requirement));
            }
            Some(pool_of(n)?)
        }
    };
    replace_pool(pool);
    Ok(())
}

/// To be called in a process that was forked: from now on work runs on threads of its own.
#[pyfunction]
fn note_fork() {
    IS_FORKED.store(true, Ordering::Release);
    IS_STALE.store(true, Ordering::Release);
}

/// The number of threads that surfabet uses.
#[pyfunction]
fn get_num_threads() -> PyResult<usize> {
    let pool = pool()?;
    Ok(pool.map_or_else(rayon::current_num_threads, |pool| pool.current_num_threads()))
}

/// Adds this file's functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(set_num_threads, module)?)?;
    module.add_function(wrap_pyfunction!(get_num_threads, module)?)?;
    module.add_function(wrap_pyfunction!(note_fork, module)?)?;
    module.add_class::<PyStop>()?;
    Ok(())
}
