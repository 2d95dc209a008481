//! Runs work without the interpreter's lock, and ends it at Ctrl-C.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tautline::request::Monitor;

use crate::errors::internal_error;

/// Time between two checks for Ctrl-C.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);
/// Stack of a worker thread \[bytes\]: that of a main thread on most systems.
const STACK: usize = 8 << 20;

static ORIGINAL_PROCESS: OnceLock<u32> = OnceLock::new();
/// Threads of a fork.
static POOL: ProcessPool = ProcessPool::new(0);

/// Thread pool that is created again in a fork, which has no threads of its parent.
pub(crate) struct ProcessPool {
    /// Number of threads; 0 for the default of rayon.
    threads: usize,
    /// Pool, and the process that created it.
    pool: Mutex<Option<(u32, Arc<ThreadPool>)>>,
}

impl ProcessPool {
    pub(crate) const fn new(threads: usize) -> Self {
        Self { threads, pool: Mutex::new(None) }
    }

    /// Returns the number of threads.
    pub(crate) fn threads(&self) -> usize {
        self.threads
    }

    /// Returns the pool of this process.
    pub(crate) fn get(&self) -> Result<Arc<ThreadPool>, ThreadPoolBuildError> {
        let mut pools = self.pool.lock().unwrap_or_else(PoisonError::into_inner);
        match &*pools {
            Some((process, pool)) if *process == process::id() => Ok(Arc::clone(pool)),
            _ => {
                let pool = Arc::new(new_pool(self.threads)?);
                // The pool of the parent process has no threads here: its destructor would wait for ever.
                std::mem::forget(pools.replace((process::id(), Arc::clone(&pool))));
                Ok(pool)
            }
        }
    }
}

impl Drop for ProcessPool {
    fn drop(&mut self) {
        let pool = self.pool.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if pool.as_ref().is_some_and(|(process, _)| *process != process::id()) {
            std::mem::forget(pool);
        }
    }
}

/// Runs work in a new thread, without the interpreter's lock.
///
/// Ctrl-C sets `interrupted`, which the work polls, and is raised once the work has ended.
pub(crate) fn run_in_thread<T: Send>(
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

/// Runs work on this thread, without the interpreter's lock.
///
/// A fork has no threads of rayon's global pool: there the work runs in a pool that the process shares.
pub(crate) fn run_detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let with_threads = || if is_original_process() { Ok(work()) } else { POOL.get().map(|pool| pool.install(work)) };
    started(finished(py.detach(|| catch_unwind(AssertUnwindSafe(with_threads))))?)
}

/// As [`run_in_thread`], for work that uses rayon. A fork gets a new pool, so that concurrent calls cannot block it.
pub(crate) fn run_in_thread_with_pool<T: Send>(
    py: Python<'_>,
    interrupted: &Arc<AtomicBool>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let with_threads = || if is_original_process() { Ok(work()) } else { new_pool(0).map(|pool| pool.install(work)) };
    started(run_in_thread(py, interrupted, with_threads)?)
}

/// Whether this process imported the package, instead of being a fork of that process.
fn is_original_process() -> bool {
    *ORIGINAL_PROCESS.get_or_init(process::id) == process::id()
}

fn new_pool(threads: usize) -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build()
}

fn finished<T>(done: thread::Result<T>) -> PyResult<T> {
    done.map_err(|panic| internal_error(&words(panic.as_ref())))
}

fn started<T>(done: Result<T, ThreadPoolBuildError>) -> PyResult<T> {
    done.map_err(|error| internal_error(&error.to_string()))
}

/// Stores the process that imports the package.
pub(crate) fn remember_process() {
    ORIGINAL_PROCESS.get_or_init(process::id);
}

/// Returns the message of a panic.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "it panicked".to_owned())
}

/// Monitor of work on the calling thread: signals interrupt the work.
pub(crate) struct SignalMonitor {
    interruption: Arc<AtomicBool>,
    signals: Mutex<Signals>,
}

impl SignalMonitor {
    pub(crate) fn new() -> Self {
        Self { interruption: Arc::default(), signals: Mutex::new(Signals::new()) }
    }

    /// Returns the exception that a signal raised.
    pub(crate) fn raised(self) -> Option<PyErr> {
        self.signals.into_inner().unwrap_or_else(PoisonError::into_inner).raised
    }
}

impl Monitor for SignalMonitor {
    fn interruption(&self) -> &Arc<AtomicBool> {
        &self.interruption
    }

    fn is_interrupted(&self) -> bool {
        let mut signals = self.signals.lock().unwrap_or_else(PoisonError::into_inner);
        if !signals.are_silent() {
            self.interruption.store(true, Ordering::Relaxed);
        }
        self.interruption.load(Ordering::Relaxed)
    }
}

/// Periodic check for signals, on a thread without the lock.
pub(crate) struct Signals {
    looked: Instant,
    /// Exception that a signal raised.
    pub(crate) raised: Option<PyErr>,
}

impl Signals {
    pub(crate) fn new() -> Self {
        Self { looked: Instant::now(), raised: None }
    }

    /// Whether no signal has raised an exception.
    pub(crate) fn are_silent(&mut self) -> bool {
        if self.raised.is_none() && self.looked.elapsed() >= SIGNALS_EVERY {
            self.raised = Python::attach(|py| py.check_signals().err());
            self.looked = Instant::now();
        }
        self.raised.is_none()
    }
}
