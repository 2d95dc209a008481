//! Checks of output files: no output may overwrite an input, another output or a finished folder.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use serde_json::Value;
use tautline_core::fact::Coded;
use tautline_core::option::{FORCE, OUT};
use tautline_sim::sim::Ending;

use super::{Failure, Monitor};
use tautline_core::files::{FileError, write_atomically};

/// Name that stands for standard output.
const STANDARD_OUTPUT: &str = "-";

/// File with its name in messages: an option, or words such as `the recording`.
pub type NamedPath<'a> = (String, &'a Path);

/// Rejects `-`, and outputs that would overwrite an input or each other, or become part of an input folder of CSVs.
///
/// # Errors
/// [`Failure`] that names both files.
pub fn check(inputs: &[NamedPath<'_>], outputs: &[NamedPath<'_>]) -> Result<(), Failure> {
    let mut taken: BTreeMap<_, _> = inputs.iter().filter_map(|(called, path)| Some((place(path)?, called))).collect();
    for (option, path) in outputs {
        refuse_standard_output(option, path)?;
        let Some(place) = place(path) else { continue };
        let csv = place.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
        let within = if csv { usize::MAX } else { 1 };
        if let Some(called) = place.ancestors().take(within).find_map(|place| taken.get(place)) {
            let message = format!("{option} {} would overwrite {called}, or be part of it", path.display());
            return Err(Failure::input(
                "files/overwrites-input",
                message,
                "write another file, or into another folder",
            ));
        }
        taken.insert(place, option);
    }
    Ok(())
}

/// Rejects outputs of a command about a scenario that would overwrite the scenario, each other or, without `--force`,
/// an existing file, and places that are not writable. This check precedes hours of flights.
///
/// # Errors
/// [`Failure`] that names the file.
pub fn check_new<'a>(scenario: &str, outputs: impl Iterator<Item = NamedPath<'a>>, force: bool) -> Result<(), Failure> {
    let (piped, files): (Vec<_>, Vec<_>) = outputs.partition(|(_, file)| is_standard_output(file));
    if let [(first, _), (second, _), ..] = &piped[..] {
        let message = format!("{first} and {second} are both to go to standard output");
        return Err(Failure::input("files/one-standard-output", message, "write one of them into a file"));
    }
    let scenario = Path::new(scenario);
    let inputs: Vec<_> = scenario.is_file().then_some(("the scenario".to_owned(), scenario)).into_iter().collect();
    check(&inputs, &files)?;
    for (option, file) in files {
        if file.is_file() && !force {
            return Err(Failure::input(
                "files/exists",
                format!("{} exists", file.display()),
                format!("overwrite it with {FORCE}, or write another file"),
            ));
        }
        check_writable(&option, file)?;
    }
    Ok(())
}

/// Rejects a file whose folder is missing, and one that cannot be written.
///
/// # Errors
/// [`Failure`] that names the file.
pub fn check_in_folder(option: &str, file: &Path) -> Result<(), Failure> {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            Err(FileError::new(file, io::ErrorKind::NotFound.into()).into())
        }
        _ => check_writable(option, file),
    }
}

/// Rejects a directory in the place of a file, and a file that cannot be written. Creates a missing folder of the file.
fn check_writable(option: &str, file: &Path) -> Result<(), Failure> {
    let shown = file.display();
    if file.is_dir() {
        let help = format!("give {option} a file in this directory");
        return Err(Failure::input("files/is-directory", format!("{shown} is a directory"), help));
    }
    let is_new_or_plain = file.metadata().map_or(true, |there| there.is_file());
    let folder = file.parent().unwrap_or(Path::new(""));
    if is_new_or_plain && let Err(error) = try_to_write_in(folder) {
        let message = format!("cannot write {shown}: {error}");
        let help = format!("give {option} a file that can be written");
        return Err(Failure::machine("files/cannot-write", message).with_help(help));
    }
    Ok(())
}

/// Returns whether the name of an output stands for standard output.
#[must_use]
pub fn is_standard_output(file: &Path) -> bool {
    file == Path::new(STANDARD_OUTPUT)
}

/// Rejects `-`: the name would be taken for standard output, which this output cannot go to.
///
/// # Errors
/// [`Failure`] that names the output.
pub fn refuse_standard_output(option: &str, path: &Path) -> Result<(), Failure> {
    if !is_standard_output(path) {
        return Ok(());
    }
    let message = format!("{option}: cannot go to standard output");
    let help = format!("give a file or folder; for a file named {STANDARD_OUTPUT} write ./{STANDARD_OUTPUT}");
    Err(Failure::input("files/no-standard-output", message, help))
}

/// Writes a file atomically, or to standard output.
///
/// # Errors
/// [`Failure`] if the file cannot be written.
pub fn write(file: &Path, bytes: &[u8], monitor: &dyn Monitor) -> Result<(), Failure> {
    if is_standard_output(file) {
        return monitor.data(&String::from_utf8_lossy(bytes));
    }
    Ok(write_atomically(file, bytes)?)
}

/// Returns the resolved path of a file, which may not exist yet. Returns `None` for a path that is not a regular file,
/// such as a pipe or a device: nothing is overwritten there.
fn place(path: &Path) -> Option<PathBuf> {
    match fs::metadata(path) {
        Ok(there) if there.is_file() || there.is_dir() => fs::canonicalize(path).ok(),
        Ok(_) => None,
        // The target of a dangling link is the file that will be made.
        Err(_) => yet_to_be(&fs::read_link(path).map_or_else(|_| path.to_owned(), |next| path.with_file_name(next))),
    }
}

/// Returns the resolved path of a file that does not exist.
fn yet_to_be(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = match fs::canonicalize(folder) {
        Ok(folder) => folder,
        // The working folder was removed.
        Err(_) if folder == Path::new(".") => return None,
        Err(_) => yet_to_be(folder)?,
    };
    match path.components().next_back()? {
        Component::Normal(name) => Some(folder.join(name)),
        Component::ParentDir => folder.parent().map(Path::to_owned),
        _ => Some(folder),
    }
}

/// An output folder. It is finished once it holds its report.
pub struct OutFolder {
    path: PathBuf,
    what: &'static str,
    report: &'static str,
}

impl OutFolder {
    /// Returns the folder at `path` of a `what`, such as `run`, whose report is named `report`.
    #[must_use]
    pub fn at(path: impl Into<PathBuf>, what: &'static str, report: &'static str) -> Self {
        Self { path: path.into(), what, report }
    }

    /// Returns the path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of a file in the folder.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Returns the path of the report.
    #[must_use]
    pub fn report(&self) -> PathBuf {
        self.file(self.report)
    }

    /// Makes the folder ready. A finished folder is kept without `force`, except one of an interrupted run. The lock
    /// excludes other writers until it is dropped, if the system supports locks of folders.
    ///
    /// # Errors
    /// [`Failure`] if the folder holds a finished result, another process writes to it, or it is not writable.
    pub fn open(&self, force: bool) -> Result<Option<File>, Failure> {
        refuse_standard_output(&OUT.to_string(), &self.path)?;
        let report = self.report();
        if report.exists() && !force && !was_interrupted(&report) {
            return Err(Failure::input(
                "files/finished",
                format!("{} holds a finished {}", self.path.display(), self.what),
                format!("give another folder with {OUT}, or overwrite the {} with {FORCE}", self.what),
            ));
        }
        let machine = |path: &Path, error: &io::Error| {
            Failure::machine("files/cannot-write", format!("cannot write {}: {error}", path.display()))
                .with_help(format!("give a writable folder with {OUT}"))
        };
        fs::create_dir_all(&self.path).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => {
                let message = format!("{OUT}: {} is a file", self.path.display());
                Failure::input("files/no-folder", message, format!("give a folder with {OUT}"))
            }
            _ => machine(&self.path, &error),
        })?;
        let lock = File::open(&self.path).ok();
        if let Some(Err(TryLockError::WouldBlock)) = lock.as_ref().map(File::try_lock) {
            return Err(Failure::input(
                "files/busy",
                format!("another {} is writing to {}", self.what, self.path.display()),
                format!("wait for it, or give another folder with {OUT}"),
            ));
        }
        // Checked before the work begins and before old files are removed.
        try_to_write_in(&self.path).map_err(|error| machine(&self.path, &error))?;
        // The old report and its page would describe another result from here on.
        for old in [&report, &report.with_extension("html")] {
            match fs::remove_file(old) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(machine(old, &error)),
                _ => {}
            }
        }
        Ok(lock)
    }
}

/// Returns whether a report is that of an interrupted run.
fn was_interrupted(report: &Path) -> bool {
    let text = fs::read_to_string(report).unwrap_or_default();
    let interrupted = Ending::Interrupted.code();
    serde_json::from_str::<Value>(&text).is_ok_and(|report| {
        // In reports of schema 2 the code is the value itself.
        let end = &report["run"]["ended_early"];
        end["code"] == interrupted || *end == interrupted
    })
}

/// Makes a folder, and makes and removes a file in it.
///
/// # Errors
/// The error of the system.
pub fn try_to_write_in(folder: &Path) -> io::Result<()> {
    // Threads of a program may write into one folder.
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let probe = folder.join(format!(".tautline-{}-{number}", std::process::id()));
    fs::create_dir_all(folder).and_then(|()| File::create(&probe)).and_then(|_| fs::remove_file(&probe))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clash(inputs: &[(&str, &Path)], outputs: &[(&str, &Path)]) -> Option<String> {
        let [inputs, outputs] = [inputs, outputs]
            .map(|files| files.iter().map(|&(called, path)| (called.to_owned(), path)).collect::<Vec<NamedPath<'_>>>());
        check(&inputs, &outputs).err().map(|failure| failure.message().to_owned())
    }

    #[test]
    fn two_names_of_one_place_clash_even_if_it_does_not_exist() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::write(at("flight.csv"), "").expect("written");
        for (one, other) in [
            ("flight.csv", "./flight.csv"),
            ("new/end.png", "new/end.png"),
            ("new/end.png", "new/../new/end.png"),
            ("new/deep/end.png", "new/./deep//end.png"),
        ] {
            let (one, other) = (at(one), at(other));
            let said = clash(&[], &[("the picture", &one), ("film", &other)]).expect("they clash");
            assert!(
                said.starts_with("film ") && said.ends_with("would overwrite the picture, or be part of it"),
                "{said}"
            );
        }
        assert_eq!(clash(&[], &[("the picture", &at("new/end.png")), ("film", &at("end.png"))]), None);
    }

    #[test]
    fn standard_output_is_refused_where_a_file_or_folder_is_written() {
        let dash = Path::new("-");
        assert_eq!(clash(&[], &[("film", dash)]).as_deref(), Some("film: cannot go to standard output"));
        assert_eq!(clash(&[], &[("film", Path::new("./-"))]), None);
        let refused = OutFolder::at("-", "run", "report.json").open(true).expect_err("no folder");
        assert_eq!(refused.message(), format!("{OUT}: cannot go to standard output"));
        assert!(!dash.exists());
    }

    #[test]
    fn csv_files_in_an_input_folder_clash_and_pictures_do_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let [csv, png] = ["flights/new.csv", "flights/new.png"].map(|name| folder.path().join(name));
        let read = [("the recording", folder.path())];
        assert!(clash(&read, &[("output", &csv)]).is_some());
        assert_eq!(clash(&read, &[("output", &png)]), None);
    }

    #[cfg(unix)]
    #[test]
    fn follows_dangling_links() {
        let folder = tempfile::tempdir().expect("a folder");
        let [link, end, round] = ["link.png", "end.png", "round.png"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink("end.png", &link).expect("a link");
        std::os::unix::fs::symlink("round.png", &round).expect("a link");
        assert!(clash(&[], &[("the picture", &end), ("film", &link)]).is_some());
        assert_eq!(clash(&[], &[("the picture", &end), ("film", &round)]), None);
    }
}
