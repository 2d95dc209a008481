//! Folders and archives that hold a file for each vehicle.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::archive::Archive;
use super::error::{Fault, ReadError};
use super::recognise::is_prose;
use super::source::Source;

/// Longest number in a file's name that is put in order by its value \[digits\].
const LONGEST_NUMBER: usize = 20;

/// Ends of the names of tables.
const TABLES: [&str; 12] =
    ["csv", "tsv", "txt", "dat", "tum", "parquet", "npz", "gz", "jsonl", "ndjson", "ulg", "ulog"];

/// Ends of the names of texts, be they tables or not.
const TEXTS: [&str; 2] = ["txt", "dat"];

/// Names of texts that are no tables, whatever numbers they hold.
const NOTES: [&str; 6] = ["readme", "license", "licence", "copying", "changelog", "authors"];

/// Ends of the names of recordings that are given alone, and of archives.
const ALONE: [&str; 9] = ["mcap", "skyc", "zip", "tar", "tgz", "7z", "rar", "bag", "db3"];

/// Most files or folders that are named.
const LISTED: usize = 5;

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
            let source = Source::entry(path, name.clone());
            if !is_table(Path::new(&name)) || is_note(&source) {
                folder.left_out.push(name);
                continue;
            }
            let parent = name.rsplit_once('/').map_or("", |(parent, _)| parent).to_owned();
            match folder.folders.iter_mut().find(|(known, _)| *known == parent) {
                Some((_, files)) => files.push(source),
                None => folder.folders.push((parent, vec![source])),
            }
        }
        let around = |(name, _): &(String, _)| name.is_empty();
        if let Some(top) = folder.folders.iter().position(around).or((folder.folders.len() == 1).then_some(0)) {
            folder.files = folder.folders.swap_remove(top).1;
            folder.left_out.extend(folder.folders.drain(..).map(|(name, _)| name + "/"));
        }
        Ok(folder.sorted())
    }

    /// A file of it, by which all others are read.
    pub(super) fn first(&mut self) -> Option<&mut Source> {
        self.files.first_mut().or_else(|| self.folders.first_mut()?.1.first_mut())
    }

    /// What a person should know about what was not read.
    pub(super) fn note(&self) -> Option<String> {
        (!self.left_out.is_empty()).then(|| format!("not read, being no tables: {}", listed(&self.left_out)))
    }

    /// That there is no table: in `what`.
    pub(super) fn without_tables(&self, what: &str, remedy: &str) -> Fault {
        let holds =
            if self.left_out.is_empty() { String::new() } else { format!(": it holds {}", listed(&self.left_out)) };
        let alone = self.left_out.iter().find(|name| ALONE.contains(&&*extension(Path::new(name))));
        let remedy = match alone {
            Some(name) if what == ARCHIVE => format!("unpack it, and give {name}"),
            Some(name) => format!("give {name}, which lies in it"),
            None => remedy.to_owned(),
        };
        Fault::coded("recording/folder", format!("there is no table in the {what}{holds}"), remedy)
    }

    /// That tables lie in folders, which would be several recordings.
    pub(super) fn of_folders(&self) -> Fault {
        let counted = |(name, files): &(String, Vec<_>)| match files.len() {
            1 => format!("{name}/ (1 table)"),
            count => format!("{name}/ ({count} tables)"),
        };
        let folders: Vec<_> = self.folders.iter().map(counted).collect();
        let file = self.folders.first().and_then(|(_, files)| files.first());
        let folder = file.and_then(|file| Some(file.shown().parent()?.to_owned())).unwrap_or_default();
        let remedy = match (file, self.folders.first()) {
            (Some(Source { entry: Some(_), .. }), Some((name, _))) => {
                format!("unpack it, and give a folder of it: {name}")
            }
            _ => format!("give one of them: {}", folder.display()),
        };
        let beside = if self.files.is_empty() { "" } else { "some of " };
        let problem = format!("{beside}its tables lie in folders: {}", listed(&folders));
        Fault::coded(
            "recording/folder",
            problem,
            format!("{remedy}; the tables of one recording lie side by side, one for each vehicle"),
        )
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

/// What archives are called in errors.
pub(super) const ARCHIVE: &str = "archive";

/// The first of some names, and how many more there are.
fn listed(names: &[String]) -> String {
    let (first, more) = names.split_at(LISTED.min(names.len()));
    let more = if more.is_empty() { String::new() } else { format!(" and {} more", more.len()) };
    first.join(", ") + &more
}

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'))
}

fn is_table(path: &Path) -> bool {
    !is_hidden(path) && TABLES.contains(&&*extension(path))
}

/// Whether a file by the name of a table is a text that says something about others.
fn is_note(source: &Source) -> bool {
    let is_named = NOTES.contains(&&*source.stem().to_lowercase());
    TEXTS.contains(&&*extension(&source.shown())) && (is_named || is_prose(source))
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
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
        let source = Source::file(&path);
        let (is_folder, is_table) = (path.is_dir(), is_table(&path) && !is_note(&source));
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
