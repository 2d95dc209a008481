//! Work that the interpreter does not wait for, and that Ctrl-C ends.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::errors::broken;

/// How often it is looked whether somebody pressed Ctrl-C.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);
/// Stack of a thread that works: as much as a program's own has on most systems \[bytes\].
const STACK: usize = 8 << 20;

static HOME: OnceLock<u32> = OnceLock::new();
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Does work in a thread of its own, without the interpreter's lock. Ctrl-C sets `interrupted`, which the work is to look at,
/// and is raised once it has come to its end.
pub(crate) fn away<T: Send>(
    py: Python<'_>,
    interrupted: &Arc<AtomicBool>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let is_done = AtomicBool::new(false);
    let mut raised = None;
    let done = thread::scope(|scope| {
        let (caller, flag) = (thread::current(), &is_done);
        let guarded = move || {
            let done = catch_unwind(AssertUnwindSafe(work));
            flag.store(true, Ordering::Release);
            caller.unpark();
            done
        };
        let worker = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, guarded)?;
        while !is_done.load(Ordering::Acquire) {
            py.detach(|| thread::park_timeout(SIGNALS_EVERY));
            if let Err(signal) = py.check_signals() {
                interrupted.store(true, Ordering::Relaxed);
                raised = Some(signal);
            }
        }
        PyResult::Ok(py.detach(|| worker.join()).unwrap_or_else(Err))
    })?;
    match raised {
        Some(signal) => Err(signal),
        None => finished(done),
    }
}

/// Does work while this thread waits, without the interpreter's lock. Threads that large swarms share are gone in a process that
/// was forked: there it gets some that all of it share.
pub(crate) fn here<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let with_threads = || if is_at_home() { Ok(work()) } else { own_pool().map(|pool| pool.install(work)) };
    started(finished(py.detach(|| catch_unwind(AssertUnwindSafe(with_threads))))?)
}

/// As [`away`], for work that shares threads. In a process that was forked it gets some that nobody else waits for.
pub(crate) fn away_with_threads<T: Send>(
    py: Python<'_>,
    interrupted: &Arc<AtomicBool>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let with_threads = || if is_at_home() { Ok(work()) } else { new_pool().map(|pool| pool.install(work)) };
    started(away(py, interrupted, with_threads)?)
}

/// Whether this process is the one that the package was imported in, and not one that it was forked into.
fn is_at_home() -> bool {
    *HOME.get_or_init(process::id) == process::id()
}

fn new_pool() -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new().stack_size(STACK).build()
}

fn finished<T>(done: thread::Result<T>) -> PyResult<T> {
    done.map_err(|panic| broken(&words(panic.as_ref())))
}

fn started<T>(done: Result<T, ThreadPoolBuildError>) -> PyResult<T> {
    done.map_err(|error| broken(&error.to_string()))
}

/// Takes note of the process that the package was imported in.
pub(crate) fn at_home() {
    HOME.get_or_init(process::id);
}

/// The threads of this process, which was forked.
fn own_pool() -> Result<Arc<ThreadPool>, ThreadPoolBuildError> {
    let mut pools = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match &*pools {
        Some((process, pool)) if *process == process::id() => Ok(Arc::clone(pool)),
        _ => {
            let pool = Arc::new(new_pool()?);
            // That of the process before has no threads here that could be waited for.
            std::mem::forget(pools.replace((process::id(), Arc::clone(&pool))));
            Ok(pool)
        }
    }
}

/// What a panic said.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "it panicked".to_owned())
}

/// Looks for signals now and then, from a thread that does not hold the lock.
pub(crate) struct Signals {
    looked: Instant,
    /// What a signal raised.
    pub(crate) raised: Option<PyErr>,
}

impl Signals {
    pub(crate) fn new() -> Self {
        Self { looked: Instant::now(), raised: None }
    }

    /// Whether none has been raised.
    pub(crate) fn are_silent(&mut self) -> bool {
        if self.looked.elapsed() >= SIGNALS_EVERY {
            self.raised = Python::attach(|py| py.check_signals().err());
            self.looked = Instant::now();
        }
        self.raised.is_none()
    }
}
