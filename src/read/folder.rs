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
    /// Names of what is no table, or is deeper.
    pub(super) left_out: Vec<String>,
}

impl Folder {
    /// Looks into a folder.
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let Entries { files, folders, mut left_out } = entries(path)?;
        if !files.is_empty() {
            left_out.extend(folders.iter().map(|folder| folder.stem() + "/"));
            return Ok(Self { files, folders: Vec::new(), left_out }.sorted());
        }
        let folders = folders.iter().map(|folder| Ok((folder.stem(), entries(&folder.path)?.files)));
        Ok(Self { files, folders: folders.collect::<Result<_, ReadError>>()?, left_out }.sorted())
    }

    /// Looks into an archive. One folder around everything is no folder.
    pub(super) fn of_archive(path: &Path) -> Result<Self, ReadError> {
        let mut folder = Self::default();
        let names = Archive::open(path)?.names();
        let is_file =
            |name: &String| !(name.ends_with('/') || name.starts_with("__MACOSX") || is_hidden(Path::new(name)));
        for name in names.into_iter().filter(is_file) {
            if !is_table(Path::new(&name)) {
                folder.left_out.push(name);
                continue;
            }
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
        self.left_out.sort();
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

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'))
}

fn is_table(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    !is_hidden(path) && TABLES.contains(&&*extension)
}

/// What is in a folder.
struct Entries {
    files: Vec<Source>,
    folders: Vec<Source>,
    left_out: Vec<String>,
}

/// Tables and folders of a folder.
fn entries(folder: &Path) -> Result<Entries, ReadError> {
    let error = |source| ReadError::new(folder, Fault::System(source));
    let (mut files, mut folders, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    for entry in fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let (is_folder, is_table) = (path.is_dir(), is_table(&path));
        let source = Source::file(&path);
        if is_folder {
            folders.push(source);
        } else if is_table {
            files.push(source);
        } else if !is_hidden(&path) {
            left_out.push(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        }
    }
    Ok(Entries { files, folders, left_out })
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
