//! The folder that a command leaves behind.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::Failure;
use crate::report::INTERRUPTED;

/// A folder that is finished once it holds its report.
pub struct OutFolder {
    path: PathBuf,
    what: &'static str,
    report: &'static str,
}

impl OutFolder {
    /// The folder at `path` of a `what`, such as `run`, whose report has that name.
    #[must_use]
    pub fn at(path: impl Into<PathBuf>, what: &'static str, report: &'static str) -> Self {
        Self { path: path.into(), what, report }
    }

    /// The path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A file in the folder.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The report.
    #[must_use]
    pub fn report(&self) -> PathBuf {
        self.file(self.report)
    }

    /// Makes the folder ready. A finished one is kept unless `force` says otherwise; a run that its user stopped is not.
    /// The lock keeps another writer out until it is dropped, where the system can lock a folder.
    ///
    /// # Errors
    /// [`Failure`] where the folder holds a finished result, another process writes to it, or the system refuses.
    pub fn open(&self, force: bool) -> Result<Option<File>, Failure> {
        let report = self.report();
        if report.exists() && !force && !was_interrupted(&report) {
            return Err(Failure::input(
                "files/finished",
                format!("{} holds a finished {}", self.path.display(), self.what),
                format!("give another folder with --out, or overwrite the {} with --force", self.what),
            ));
        }
        let machine = |path: &Path, error: &io::Error| {
            Failure::machine("files/cannot-write", format!("cannot write {}: {error}", path.display()))
                .with_help("give a folder that can be written to with --out")
        };
        fs::create_dir_all(&self.path).map_err(|error| machine(&self.path, &error))?;
        let lock = File::open(&self.path).ok();
        if let Some(Err(TryLockError::WouldBlock)) = lock.as_ref().map(File::try_lock) {
            return Err(Failure::input(
                "files/busy",
                format!("another {} is writing to {}", self.what, self.path.display()),
                "wait for it, or give another folder with --out",
            ));
        }
        // Known before the work begins, and before anything old is taken away.
        try_to_write_in(&self.path).map_err(|error| machine(&self.path, &error))?;
        // From here on the old report and its page would describe something else.
        for old in [&report, &report.with_extension("html")] {
            match fs::remove_file(old) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(machine(old, &error)),
                _ => {}
            }
        }
        Ok(lock)
    }
}

/// Whether a report is of a run that its user stopped.
fn was_interrupted(report: &Path) -> bool {
    let text = fs::read_to_string(report).unwrap_or_default();
    serde_json::from_str::<Value>(&text).is_ok_and(|report| report["run"]["ended_early"] == INTERRUPTED)
}

/// Makes a folder and a file in it, and takes the file away again.
///
/// # Errors
/// What the system says.
pub fn try_to_write_in(folder: &Path) -> io::Result<()> {
    let probe = folder.join(format!(".tautline-{}", std::process::id()));
    fs::create_dir_all(folder).and_then(|()| File::create(&probe)).and_then(|_| fs::remove_file(&probe))
}
