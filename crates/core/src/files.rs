//! Atomic writes of files.
//!
//! The crate `tempfile` would replace five lines here, the temporary name and its removal, and cost 5 core-seconds of a
//! cold build. Links, pipes and the sync to the disk need the code of this module in any case.

use std::collections::hash_map::RandomState;
use std::ffi::OsString;
use std::fs::{self, File};
use std::hash::BuildHasher as _;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Error of a file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {path}: {source}")]
pub struct FileError {
    /// Path of the file.
    pub path: String,
    /// Error of the operating system.
    pub source: io::Error,
}

impl FileError {
    /// Error of a path.
    #[must_use]
    pub fn new(path: &Path, source: io::Error) -> Self {
        Self { path: path.display().to_string(), source }
    }
}

/// Writes a file as a whole: the bytes go to a temporary file in the same folder, are synced to the disk, and the file
/// is then renamed to `path`. A reader never sees a part of the file. An error leaves `path` unchanged and no temporary
/// file behind.
///
/// The target of a symbolic link is replaced, and the link stays. A path that is not a regular file, such as a pipe or
/// a device, is written into directly.
///
/// # Errors
/// [`FileError`] when the system refuses.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_atomically_with(path, |file| file.write_all(bytes).map_err(|source| FileError::new(path, source)))
}

/// Writes a file like [`write_atomically`], piece by piece.
///
/// # Errors
/// The error of `write`, or [`FileError`] when the system refuses.
pub fn write_atomically_with<T, E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut File) -> Result<T, E>,
) -> Result<T, E> {
    let error = |source| E::from(FileError::new(path, source));
    if fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        return write(&mut File::options().write(true).open(path).map_err(error)?);
    }
    let target = behind_links(path);
    let (temporary, written) = write_beside(&target, write)?;
    // Two processes or threads may write the same file; the later one wins, as a whole.
    fs::rename(&temporary, &target).map(|()| written).map_err(error).inspect_err(|_| remove(&temporary))
}

/// Writes a complete file beside `target`, under a name that no other process or thread uses. Returns its path and the
/// value of `write`. The caller renames, links or removes the file.
///
/// # Errors
/// As [`write_atomically_with`]; the file is removed.
pub fn write_beside<T, E: From<FileError>>(
    target: &Path,
    write: impl FnOnce(&mut File) -> Result<T, E>,
) -> Result<(PathBuf, T), E> {
    let error = |source| E::from(FileError::new(target, source));
    let no_name = || error(io::Error::new(io::ErrorKind::InvalidInput, "the path has no file name"));
    let mut name = OsString::from(".");
    name.push(target.file_name().ok_or_else(no_name)?);
    // Several machines may write into one folder, so the number of the process is not enough.
    name.push(format!(".{:016x}.partial", RandomState::new().hash_one(std::process::id())));
    let temporary = target.with_file_name(name);
    let written = File::create(&temporary).map_err(error).and_then(|mut file| {
        let written = write(&mut file)?;
        file.sync_all().map_err(error)?;
        Ok(written)
    });
    match written {
        Ok(written) => Ok((temporary, written)),
        Err(error) => {
            remove(&temporary);
            Err(error)
        }
    }
}

/// Removes a temporary file. The first error is reported; an error of the removal is ignored.
fn remove(temporary: &Path) {
    let _ = fs::remove_file(temporary);
}

/// Returns the file that a path leads to through symbolic links, whether or not it exists.
fn behind_links(path: &Path) -> PathBuf {
    match fs::read_link(path) {
        Ok(next) => fs::canonicalize(path).unwrap_or_else(|_| path.with_file_name(next)),
        Err(_) => path.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<OsString> {
        let entries = fs::read_dir(folder).expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name()).collect()
    }

    #[test]
    fn replaces_the_whole_file_and_leaves_no_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("report.json");
        write_atomically(&path, b"the first, longer one").expect("writes");
        write_atomically(&path, b"the second").expect("writes");
        assert_eq!(fs::read(&path).expect("reads"), b"the second");
        assert_eq!(names(folder.path()), ["report.json"]);
    }

    #[test]
    fn error_leaves_the_file_unchanged_and_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("report.json");
        // A folder that is not empty cannot be replaced by a file.
        fs::create_dir(&path).expect("a folder");
        fs::write(path.join("inside"), b"kept").expect("writes");
        let error = write_atomically(&path, b"new").expect_err("refused");
        assert!(error.to_string().contains("report.json"), "{error}");
        assert_eq!(fs::read(path.join("inside")).expect("reads"), b"kept");
        assert_eq!(names(folder.path()), ["report.json"]);
    }

    #[test]
    fn rejects_missing_folders_and_paths_without_a_name() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(write_atomically(&folder.path().join("missing/report.json"), b"").is_err());
        assert!(write_atomically(Path::new("/"), b"").is_err());
        assert!(write_atomically(Path::new(""), b"").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn keeps_links_and_writes_into_pipes() {
        use std::io::Read as _;
        use std::os::unix::{fs::FileTypeExt as _, fs::symlink};

        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str| folder.path().join(name);
        fs::create_dir(file("runs")).expect("a folder");
        fs::write(file("runs/3.html"), b"old").expect("writes");
        for target in ["runs/3.html", "runs/4.html"] {
            let _ = fs::remove_file(file("latest.html"));
            symlink(target, file("latest.html")).expect("a link");
            write_atomically(&file("latest.html"), b"new").expect("writes");
            assert_eq!(fs::read_link(file("latest.html")).expect("still a link"), Path::new(target));
            assert_eq!(fs::read(file(target)).expect("reads"), b"new");
        }
        assert!(std::process::Command::new("mkfifo").arg(file("pipe")).status().expect("runs").success());
        // Opened for reading and writing, so that neither end blocks.
        let mut pipe = File::options().read(true).write(true).open(file("pipe")).expect("a pipe");
        write_atomically(&file("pipe"), b"through").expect("writes");
        let mut through = [0; 7];
        pipe.read_exact(&mut through).expect("reads");
        assert_eq!(&through, b"through");
        assert!(fs::metadata(file("pipe")).expect("there").file_type().is_fifo());
        assert_eq!(names(folder.path()).len(), 3, "nothing else is left");
    }
}
