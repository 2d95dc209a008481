//! Files that a command writes, before it does: none may be what it reads, or another of them.

use std::fs;
use std::path::{Path, PathBuf};

use super::Failure;

/// A file and what it is called: `--events`, or `the recording`.
pub(super) type Called<'a> = (&'static str, &'a Path);

/// Refuses outputs that would replace an input, become a part of an input that is a folder of CSV files, or replace each
/// other.
pub(super) fn check(inputs: &[Called<'_>], outputs: &[Called<'_>]) -> Result<(), Failure> {
    let mut taken: Vec<_> = inputs.iter().filter_map(|&(called, path)| Some((called, place(path)?))).collect();
    for &(option, path) in outputs {
        let Some(place) = place(path) else { continue };
        let csv = place.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
        let clashes = |other: &Path| place == other || (csv && place.starts_with(other));
        if let Some((called, _)) = taken.iter().find(|(_, other)| clashes(other)) {
            let message = format!("{option} {} would overwrite {called}, or be part of it", path.display());
            return Err(Failure::input(message, "write another file"));
        }
        taken.push((option, place));
    }
    Ok(())
}

/// Where a file is or will be, through links. `None` for what is no file, such as a pipe or a device: nothing is replaced
/// there.
fn place(path: &Path) -> Option<PathBuf> {
    match fs::metadata(path) {
        Ok(there) if there.is_file() || there.is_dir() => fs::canonicalize(path).ok(),
        Ok(_) => None,
        Err(_) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
        }
    }
}
