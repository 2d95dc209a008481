//! Runs work without the interpreter's lock, and ends it at Ctrl-C.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
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
    run_in_thread_watched(py, interrupted, &|py| py.check_signals(), work)
}

/// As [`run_in_thread`], but calls `watch` on this thread, with the lock, and ends the work where it raises.
fn run_in_thread_watched<T: Send>(
    py: Python<'_>,
    interrupted: &Arc<AtomicBool>,
    watch: &dyn Fn(Python<'_>) -> PyResult<()>,
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
            if let Err(error) = watch(py) {
                interrupted.store(true, Ordering::Relaxed);
                raised = Some(error);
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

/// As [`run_in_thread`], for a study, which uses rayon and reports its progress. A fork gets a new pool, so that
/// concurrent calls cannot block it.
pub(crate) fn run_study<T: Send>(
    py: Python<'_>,
    monitor: &StudyMonitor,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let with_threads = || if is_original_process() { Ok(work()) } else { new_pool(0).map(|pool| pool.install(work)) };
    let watch = |py: Python<'_>| py.check_signals().and_then(|()| monitor.report(py));
    started(run_in_thread_watched(py, &monitor.interruption, &watch, with_threads)?)
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

/// Monitor of a study, which a function in Python may receive.
pub(crate) struct StudyMonitor {
    interruption: Arc<AtomicBool>,
    /// Units of work that are done, and their expected number; 0 if it is unknown.
    done: AtomicU64,
    total: AtomicU64,
    /// Function that takes both, and the pair that it took last.
    progress: Option<Py<PyAny>>,
    reported: Mutex<(u64, u64)>,
    /// Check for signals, where the work holds the calling thread.
    signals: Option<Mutex<Signals>>,
}

impl StudyMonitor {
    /// Returns the monitor of work in another thread, or of work on the calling thread, which signals interrupt.
    pub(crate) fn new(progress: Option<Py<PyAny>>, on_calling_thread: bool) -> Self {
        let signals = on_calling_thread.then(|| Mutex::new(Signals::new()));
        let (done, total, reported) = (AtomicU64::new(0), AtomicU64::new(0), Mutex::default());
        Self { interruption: Arc::default(), done, total, progress, reported, signals }
    }

    /// Calls the function of the progress if that has changed.
    pub(crate) fn report(&self, py: Python<'_>) -> PyResult<()> {
        let Some(progress) = &self.progress else { return Ok(()) };
        let now = (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed));
        let last = std::mem::replace(&mut *self.reported.lock().unwrap_or_else(PoisonError::into_inner), now);
        if now == last {
            return Ok(());
        }
        let total = (now.1 > 0).then_some(now.1);
        progress.call1(py, (total.map_or(now.0, |total| total.min(now.0)), total)).map(drop)
    }

    /// Takes the exception that a signal or the function of the progress raised on the calling thread.
    pub(crate) fn take_raised(&self) -> Option<PyErr> {
        self.signals.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner).raised.take()
    }
}

impl Monitor for StudyMonitor {
    fn interruption(&self) -> &Arc<AtomicBool> {
        &self.interruption
    }

    fn begin(&self, _task: &str, total: Option<u64>) {
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total.unwrap_or(0), Ordering::Relaxed);
    }

    fn advance(&self, units: u64) {
        self.done.fetch_add(units, Ordering::Relaxed);
    }

    fn is_interrupted(&self) -> bool {
        if let Some(signals) = &self.signals {
            let mut signals = signals.lock().unwrap_or_else(PoisonError::into_inner);
            if !signals.are_silent_after(|py| self.report(py)) {
                self.interruption.store(true, Ordering::Relaxed);
            }
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
        self.are_silent_after(|_| Ok(()))
    }

    /// As [`Signals::are_silent`]. Calls `work` with the lock at each check; its exception counts as well.
    fn are_silent_after(&mut self, work: impl FnOnce(Python<'_>) -> PyResult<()>) -> bool {
        if self.raised.is_none() && self.looked.elapsed() >= SIGNALS_EVERY {
            self.raised = Python::attach(|py| py.check_signals().and_then(|()| work(py)).err());
            self.looked = Instant::now();
        }
        self.raised.is_none()
    }
}
