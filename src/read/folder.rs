//! Folders and archives that hold a file for each vehicle.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::archive::Archive;
use super::error::{Fault, ReadError};
use super::source::Source;

/// Longest number in a file's name that is put in order by its value \[digits\].
const LONGEST_NUMBER: usize = 20;

/// Ends of the names of tables.
const TABLES: [&str; 8] = ["csv", "tsv", "txt", "dat", "tum", "parquet", "npz", "gz"];

/// The tables of a folder or of an archive, and those of the folders in it by the names of these; in natural order.
#[derive(Default)]
pub(super) struct Folder {
    pub(super) files: Vec<Source>,
    pub(super) folders: Vec<(String, Vec<Source>)>,
}

impl Folder {
    /// Looks into a folder.
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let (files, folders) = entries(path)?;
        let folders = folders.iter().map(|folder| Ok((folder.stem(), entries(&folder.path)?.0)));
        let folders = if files.is_empty() { folders.collect::<Result<_, ReadError>>()? } else { Vec::new() };
        Ok(Self { files, folders }.sorted())
    }

    /// Looks into an archive. One folder around everything is no folder.
    pub(super) fn of_archive(path: &Path) -> Result<Self, ReadError> {
        let mut folder = Self::default();
        let names = Archive::open(path)?.names();
        for name in names.into_iter().filter(|name| is_table(Path::new(name)) && !name.starts_with("__MACOSX")) {
            let parent = name.rsplit_once('/').map_or("", |(parent, _)| parent).to_owned();
            let source = Source::entry(path, name);
            match folder.folders.iter_mut().find(|(known, _)| *known == parent) {
                Some((_, files)) => files.push(source),
                None => folder.folders.push((parent, vec![source])),
            }
        }
        if let [(_, files)] = &mut folder.folders[..] {
            folder.files = std::mem::take(files);
            folder.folders.clear();
        }
        Ok(folder.sorted())
    }

    fn sorted(mut self) -> Self {
        self.folders.retain(|(_, files)| !files.is_empty());
        self.folders.sort_by_cached_key(|(name, _)| (natural(name), name.clone()));
        for files in self.folders.iter_mut().map(|(_, files)| files).chain([&mut self.files]) {
            files.sort_by_cached_key(|file| (natural(&file.stem()), file.shown()));
        }
        self
    }

    pub(super) fn is_empty(&self) -> bool {
        self.files.is_empty() && self.folders.is_empty()
    }
}

fn is_table(path: &Path) -> bool {
    let hidden = path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'));
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    !hidden && TABLES.contains(&&*extension)
}

/// Tables and folders of a folder.
fn entries(folder: &Path) -> Result<(Vec<Source>, Vec<Source>), ReadError> {
    let error = |source| ReadError::new(folder, Fault::System(source));
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let (is_folder, is_table) = (path.is_dir(), is_table(&path));
        let source = Source::file(&path);
        if is_folder {
            folders.push(source);
        } else if is_table {
            files.push(source);
        }
    }
    Ok((files, folders))
}

/// A key that puts `cf9` before `cf10`: all numbers are as long.
fn natural(name: &str) -> String {
    let mut key = String::new();
    for part in name.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()) {
        let part = String::from_utf8_lossy(part);
        let width = if part.starts_with(|c: char| c.is_ascii_digit()) { LONGEST_NUMBER } else { 0 };
        // Writing to a string cannot fail.
        let _ = write!(key, "{part:0>width$}");
    }
    key
}

#[cfg(test)]
mod tests {
    use super::natural;

    #[test]
    fn names_are_ordered_by_their_numbers() {
        let mut names = ["cf10", "cf9", "a2_10", "a2_9", "cf1"];
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, ["a2_9", "a2_10", "cf1", "cf9", "cf10"]);
    }
}
