//! Files that are written whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {path}: {source}")]
pub struct ArtefactError {
    /// The file.
    pub path: String,
    /// What the system said.
    pub source: io::Error,
}

impl ArtefactError {
    pub(super) fn new(path: &Path, source: io::Error) -> Self {
        Self { path: path.display().to_string(), source }
    }
}

/// Writes a file so that nobody ever sees a part of it: the bytes go to a temporary name in the same folder, down to the
/// disk, and the file is then renamed over `path`. An error leaves `path` as it was and no temporary file behind.
///
/// # Errors
/// [`ArtefactError`] when the system refuses.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), ArtefactError> {
    write_atomically_with(path, |file| file.write_all(bytes).map_err(|source| ArtefactError::new(path, source)))
}

/// Like [`write_atomically`] for what is written piece by piece.
///
/// # Errors
/// The error of `write`, or [`ArtefactError`] when the system refuses.
pub fn write_atomically_with<T, E: From<ArtefactError>>(
    path: &Path,
    write: impl FnOnce(&mut File) -> Result<T, E>,
) -> Result<T, E> {
    let error = |source| E::from(ArtefactError::new(path, source));
    let no_name = || error(io::Error::new(io::ErrorKind::InvalidInput, "it names no file"));
    let mut temporary = OsString::from(".");
    temporary.push(path.file_name().ok_or_else(no_name)?);
    // Two processes may write the same file; the later one wins, whole.
    temporary.push(format!(".{}.partial", std::process::id()));
    let temporary = path.with_file_name(temporary);
    let written = File::create(&temporary).map_err(error).and_then(|mut file| {
        let written = write(&mut file)?;
        file.sync_all().map_err(error)?;
        Ok(written)
    });
    let renamed = written.and_then(|written| fs::rename(&temporary, path).map(|()| written).map_err(error));
    renamed.inspect_err(|_| {
        // The first error is the one to report.
        let _ = fs::remove_file(&temporary);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<OsString> {
        let entries = fs::read_dir(folder).expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name()).collect()
    }

    #[test]
    fn a_file_is_replaced_as_a_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("report.json");
        write_atomically(&path, b"the first, longer one").expect("writes");
        write_atomically(&path, b"the second").expect("writes");
        assert_eq!(fs::read(&path).expect("reads"), b"the second");
        assert_eq!(names(folder.path()), ["report.json"]);
    }

    #[test]
    fn a_refusal_leaves_the_file_as_it_was_and_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("report.json");
        // A folder of that name with something in it cannot be replaced by a file.
        fs::create_dir(&path).expect("a folder");
        fs::write(path.join("inside"), b"kept").expect("writes");
        let error = write_atomically(&path, b"new").expect_err("refused");
        assert!(error.to_string().contains("report.json"), "{error}");
        assert_eq!(fs::read(path.join("inside")).expect("reads"), b"kept");
        assert_eq!(names(folder.path()), ["report.json"]);
    }

    #[test]
    fn a_folder_that_does_not_exist_and_a_path_without_a_name_are_errors() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(write_atomically(&folder.path().join("missing/report.json"), b"").is_err());
        assert!(write_atomically(Path::new("/"), b"").is_err());
        assert!(write_atomically(Path::new(""), b"").is_err());
    }
}
