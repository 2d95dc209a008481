//! Folders and archives with one file per vehicle, and joining of several files to one recording.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::str;

use super::error::{ContentKind, Fault, ReadError, first_few, quoted};
use super::heading;
use super::identity::spelling;
use super::order::Recording;
use super::recognition::head_of;
use super::source::{Archive, Source, VehicleFiles};
use tautline_core::fact::{self, Fact, FactKind};
use tautline_core::option::TIME_UNIT;
use tautline_core::track::{Clock, Item, Metadata, Plan, Tracks};

/// Longest number in a file name that is sorted by value \[digits\].
const LONGEST_NUMBER: usize = 20;

/// Extensions of tables.
const TABLES: [&str; 14] =
    ["csv", "tsv", "txt", "dat", "tum", "parquet", "npz", "gz", "jsonl", "ndjson", "ulg", "ulog", "skyb", "traj"];

/// Extensions of texts that may be tables or prose.
const TEXTS: [&str; 2] = ["txt", "dat"];

/// Names of texts that are never tables.
const NOTES: [&str; 6] = ["readme", "license", "licence", "copying", "changelog", "authors"];

/// Extensions of recordings that are opened separately, and of archives.
const ALONE: [&str; 9] = ["mcap", "skyc", "zip", "tar", "tgz", "7z", "rar", "bag", "db3"];

/// Largest number of files or folders listed in a message.
const LISTED: usize = 5;

/// Tables of a folder or archive, and tables of its subfolders by the subfolder's name; in natural order.
#[derive(Default)]
pub(super) struct Folder {
    pub(super) files: Vec<Source>,
    pub(super) folders: VehicleFiles,
    /// Names of files that are not tables, and of deeper folders.
    pub(super) left_out: Vec<String>,
}

impl Folder {
    /// Lists a folder. Its subfolders are read if it has no tables.
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let (mut folder, below) = Self::list(path)?;
        for source in below {
            if folder.files.is_empty() {
                folder.folders.push((source.stem(), Self::list(&source.path)?.0.files));
            } else {
                folder.left_out.push(source.stem() + "/");
            }
        }
        Ok(folder.sorted())
    }

    /// Lists the tables of a folder, and its subfolders.
    fn list(path: &Path) -> Result<(Self, Vec<Source>), ReadError> {
        let error = |source| ReadError::new(path, Fault::System(source));
        let (mut folder, mut below) = (Self::default(), Vec::new());
        for entry in fs::read_dir(path).map_err(error)? {
            let path = entry.map_err(error)?.path();
            let source = Source::file(&path);
            if path.is_dir() {
                below.push(source);
            } else if is_table(&path) && !is_note(&source) {
                folder.files.push(source);
            } else if !is_hidden(&path) {
                folder.left_out.push(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
            }
        }
        Ok((folder, below))
    }

    /// Lists an archive. A single folder around all files is skipped.
    pub(super) fn of_archive(path: &Path) -> Result<Self, ReadError> {
        let mut folder = Self::default();
        let mut archive = Archive::open(path)?;
        archive.check_entries()?;
        let names = archive.names();
        let mut folders: BTreeMap<String, Vec<Source>> = BTreeMap::new();
        let is_file =
            |name: &String| !(name.ends_with('/') || name.starts_with("__MACOSX") || is_hidden(Path::new(name)));
        for name in names.into_iter().filter(is_file) {
            let source = Source::entry(path, name.clone());
            if !is_table(Path::new(&name)) || is_note(&source) {
                folder.left_out.push(name);
                continue;
            }
            let parent = name.rsplit_once('/').map_or("", |(parent, _)| parent).to_owned();
            folders.entry(parent).or_default().push(source);
        }
        folder.folders = folders.into_iter().collect();
        let around = |(name, _): &(String, _)| name.is_empty();
        if let Some(top) = folder.folders.iter().position(around).or((folder.folders.len() == 1).then_some(0)) {
            folder.files = folder.folders.swap_remove(top).1;
            folder.left_out.extend(folder.folders.drain(..).map(|(name, _)| name + "/"));
        }
        Ok(folder.sorted())
    }

    /// Returns one of its files, whose format applies to all.
    pub(super) fn first(&mut self) -> Option<&mut Source> {
        self.files.first_mut().or_else(|| self.folders.first_mut()?.1.first_mut())
    }

    /// Returns the note on files that are not read.
    pub(super) fn note(&self) -> Option<String> {
        (!self.left_out.is_empty())
            .then(|| format!("not read, as they are not tables: {}", first_few(&self.left_out, LISTED)))
    }

    /// Returns the fault of a folder or archive (`what`) without tables.
    pub(super) fn without_tables(&self, what: &str, remedy: &str) -> Fault {
        let holds = if self.left_out.is_empty() {
            String::new()
        } else {
            format!("; it contains {}", first_few(&self.left_out, LISTED))
        };
        let alone = self.left_out.iter().find(|name| ALONE.contains(&&*extension(Path::new(name))));
        let remedy = match alone {
            Some(name) if what == ARCHIVE => format!("unpack it, and give {name}"),
            Some(name) => format!("give {name} inside it"),
            None => remedy.to_owned(),
        };
        Fault::content(ContentKind::Folder, format!("there is no table in the {what}{holds}"), remedy)
    }

    /// Returns the fault of tables in several folders, which would be several recordings.
    pub(super) fn of_folders(&self) -> Fault {
        let counted = |(name, files): &(String, Vec<_>)| match files.len() {
            1 => format!("{name}/ (1 table)"),
            count => format!("{name}/ ({count} tables)"),
        };
        let folders: Vec<_> = self.folders.iter().map(counted).collect();
        let file = self.folders.first().and_then(|(_, files)| files.first());
        let folder = file.and_then(|file| Some(file.display_path().parent()?.to_owned())).unwrap_or_default();
        let remedy = match (file, self.folders.first()) {
            (Some(Source { entry: Some(_), .. }), Some((name, _))) => {
                format!("unpack it, and give one of its folders: {name}")
            }
            _ => format!("give one of them: {}", folder.display()),
        };
        let part = if self.files.is_empty() { "" } else { "some of " };
        let problem = format!("{part}its tables are in folders: {}", first_few(&folders, LISTED));
        let remedy = format!("{remedy}; the tables of one recording must be in one folder, one per vehicle");
        Fault::content(ContentKind::Folder, problem, remedy)
    }

    fn sorted(mut self) -> Self {
        self.left_out.sort();
        self.folders.retain(|(_, files)| !files.is_empty());
        self.folders.sort_by_cached_key(|(name, _)| (natural(name), name.clone()));
        for files in self.folders.iter_mut().map(|(_, files)| files).chain([&mut self.files]) {
            files.sort_by_cached_key(|file| (natural(&file.stem()), file.display_path()));
        }
        self
    }

    pub(super) fn is_empty(&self) -> bool {
        self.files.is_empty() && self.folders.is_empty()
    }
}

/// Word for archives in errors.
pub(super) const ARCHIVE: &str = "archive";

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'))
}

fn is_table(path: &Path) -> bool {
    !is_hidden(path) && TABLES.contains(&&*extension(path))
}

/// Returns whether a file with the extension of a table is prose.
fn is_note(source: &Source) -> bool {
    let is_named = NOTES.contains(&&*source.stem().to_lowercase());
    TEXTS.contains(&&*extension(&source.display_path())) && (is_named || is_prose(source))
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Returns a sort key that orders `cf9` before `cf10`: numbers are padded to one length.
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

/// Largest difference of the epochs of joined files \[ns\]: 30 days.
const APART_NS: i64 = 30 * 86_400 * 1_000_000_000;

/// File of one vehicle.
struct JoinedFile {
    path: PathBuf,
    tracks: Recording,
    /// Offset of its clock from the clock of the recording \[s\].
    shift_s: f64,
    /// Items read but not yet returned.
    waiting: std::iter::Peekable<std::vec::IntoIter<Item>>,
    /// Start of the last of them \[s\]; infinite at the end of the file.
    until_s: f64,
}

/// Vehicles of several files, merged in order of time. One block of each file is in memory.
struct Joined {
    vehicles: Vec<String>,
    parts: Vec<JoinedFile>,
    /// Planar if a file has no heights; then the heights of the other files are ignored.
    metadata: Metadata,
}

/// Joins files with one vehicle each, named after the file, to one recording; `left_out` is the note on other files.
pub(super) fn join(parts: Vec<(PathBuf, Recording)>, left_out: Option<String>) -> Result<Recording, ReadError> {
    let stem = |path: &PathBuf| Source::file(path).stem();
    let (vehicles, parts): (Vec<_>, Vec<_>) =
        parts.into_iter().map(|(path, tracks)| (stem(&path), (path, tracks))).unzip();
    let (paths, recordings): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    let mut known = BTreeMap::new();
    for (name, path) in vehicles.iter().zip(&paths) {
        if let Some(first) = known.insert(spelling(name), path) {
            let problem = format!("the vehicle of {} has the same name {}", first.display(), quoted(name));
            let remedy = "rename one of the files: vehicles are named after their files";
            return Err(ReadError::new(path, Fault::content(ContentKind::VehicleTwice, problem, remedy)));
        }
    }
    check_own_names(&recordings, &paths, &vehicles)?;
    check_frames(&recordings, &paths)?;
    let clocks: Vec<Clock> = recordings.iter().map(|tracks| tracks.clock().clone()).collect();
    let Some(first) = clocks.iter().min_by_key(|clock| clock.epoch_ns) else { return Err(Fault::empty().into()) };
    for ((name, path), clock) in vehicles.iter().zip(&paths).zip(&clocks) {
        let guessed = clock.inferred || clocks[0].inferred;
        let problem = if clock.unit != clocks[0].unit && guessed {
            let (unit, other) = (clock.unit, clocks[0].unit);
            format!("the times of {} are read as {unit}, those of {} as {other}", quoted(name), quoted(&vehicles[0]))
        } else if clock.epoch_ns.saturating_sub(first.epoch_ns) > APART_NS {
            format!("the clock of {} begins more than a month after that of another file", quoted(name))
        } else {
            continue;
        };
        let remedy = format!("set the unit with {TIME_UNIT}, and record all files with one clock");
        return Err(ReadError::new(path, Fault::content(ContentKind::SeveralClocks, problem, remedy)));
    }
    let clock = Clock {
        inferred: clocks.iter().any(|clock| clock.inferred),
        other_unit: clocks.iter().find_map(|clock| clock.other_unit),
        epoch_ns: first.epoch_ns,
        unit: clocks[0].unit,
    };
    let mut notes = vec![format!("each file is one vehicle: {}", vehicles.join(", "))];
    notes.extend(left_out);
    let without: Vec<_> = vehicles
        .iter()
        .zip(&recordings)
        .filter(|(_, tracks)| tracks.is_planar())
        .map(|(name, _)| quoted(name))
        .collect();
    let is_planar = !without.is_empty();
    if is_planar && without.len() < vehicles.len() {
        let without = without.join(", ");
        notes.push(format!("no height is known of {without}: the heights of the other files are not used"));
    }
    let facts = vec![
        Fact::name(FactKind::Identity, fact::Source::Convention, "each file is one vehicle"),
        Fact::name(FactKind::Clock, fact::Source::Default, "one clock for all files"),
    ];
    let mut joined = Vec::new();
    for ((path, tracks), own) in paths.into_iter().zip(recordings).zip(&clocks) {
        let shift_s = own.epoch_ns.saturating_sub(clock.epoch_ns) as f64 / 1e9;
        let waiting = Vec::new().into_iter().peekable();
        joined.push(JoinedFile { path, tracks, shift_s, waiting, until_s: f64::NEG_INFINITY });
    }
    let earth_origin = joined.iter().find_map(|part| part.tracks.earth_origin()).copied();
    let mut metadata = Metadata { clock, notes, facts, is_planar, earth_origin, ..Metadata::default() };
    for part in &joined {
        learn(&mut metadata, part.tracks.metadata());
    }
    Ok(Box::new(Joined { vehicles, parts: joined, metadata }))
}

/// Refuses two files whose rows name the same vehicle, and a file whose rows name the vehicle of another file.
///
/// A name shared by all files is not the name of a vehicle.
fn check_own_names(recordings: &[Recording], paths: &[PathBuf], called: &[String]) -> Result<(), ReadError> {
    let own = recordings.iter().map(|tracks| match tracks.vehicles() {
        [only] => Some(only.as_str()),
        _ => None,
    });
    let own: Vec<_> = own.collect();
    let (mut known, mut twice) = (BTreeMap::new(), None);
    for (name, path) in own.iter().zip(paths) {
        let Some(name) = name else { return Ok(()) };
        if let Some(first) = known.insert(spelling(name), path) {
            twice = twice.or(Some((*name, first, path)));
        }
    }
    if known.len() < 2 {
        return Ok(());
    }
    // Check for exchanged file names. Numbers of files and vehicles may start at different values.
    let files: BTreeSet<_> = called.iter().map(|name| spelling(name)).collect();
    let others = own.iter().zip(paths).zip(called).filter_map(|((name, path), file)| Some(((*name)?, path, file)));
    let mut others = others.filter(|(name, _, file)| spelling(name) != spelling(file));
    if let Some((name, path, _)) = others.next().filter(|_| known.keys().eq(&files)) {
        let problem = format!("the rows name vehicle {}, but another file has this name", quoted(name));
        let remedy = "name each file after its vehicle, or remove the column with the name";
        return Err(ReadError::new(path, Fault::content(ContentKind::VehicleTwice, problem, remedy)));
    }
    let Some((name, first, path)) = twice else { return Ok(()) };
    let problem = format!("its rows name the vehicle {}, as do those of {}", quoted(name), first.display());
    let remedy = "put all rows of a vehicle into one file, or remove the vehicle column";
    Err(ReadError::new(path, Fault::content(ContentKind::VehicleTwice, problem, remedy)))
}

/// Refuses files in different frames: Earth or metric coordinates, with or without directions of the axes.
fn check_frames(recordings: &[Recording], paths: &[PathBuf]) -> Result<(), ReadError> {
    let frame = |tracks: &Recording| {
        let on_earth = tracks.earth_origin().is_some();
        (on_earth, on_earth || tracks.metadata().has_directions)
    };
    let words = |(on_earth, has_directions): (bool, bool)| match (on_earth, has_directions) {
        (true, _) => "are latitudes and longitudes",
        (false, true) => "are east, north and up by column names",
        (false, false) => "are x, y and z without a direction",
    };
    let Some((first, path)) = recordings.first().zip(paths.first()) else { return Ok(()) };
    let other = recordings.iter().zip(paths).find(|(tracks, _)| frame(tracks) != frame(first));
    other.map_or(Ok(()), |(tracks, other)| {
        let [its, those] = [tracks, first].map(|tracks| words(frame(tracks)));
        let problem = format!("its positions {its}, but those of {} {those}", path.display());
        Err(ReadError::new(
            other,
            Fault::content(ContentKind::SeveralFrames, problem, "use one frame and the same column names in all files"),
        ))
    })
}

/// Appends notes of a file, and its facts except on names, that are not yet present.
fn learn(metadata: &mut Metadata, of_part: &Metadata) {
    for note in &of_part.notes {
        if !metadata.notes.contains(note) {
            metadata.notes.push(note.clone());
        }
    }
    for fact in &of_part.facts {
        if fact.kind != FactKind::Identity && !metadata.facts.contains(fact) {
            metadata.facts.push(fact.clone());
        }
    }
}

impl JoinedFile {
    /// Reads the next items if none are waiting.
    fn fill(&mut self, vehicle: usize) -> Result<(), ReadError> {
        if self.until_s == f64::INFINITY || self.waiting.peek().is_some() {
            return Ok(());
        }
        let mut items = Vec::new();
        if !self.tracks.read(&mut items)? {
            self.until_s = f64::INFINITY;
            return Ok(());
        }
        for item in &mut items {
            let problem = match item {
                Item::Sample(sample) if sample.vehicle == 0 => {
                    (sample.vehicle, sample.time_s) = (vehicle, sample.time_s + self.shift_s);
                    continue;
                }
                Item::Sample(_) => "it holds several vehicles, named by one of its columns",
                Item::Piece(_) => "it holds a curve, but the first file holds samples",
            };
            let remedy = "split it, or remove the vehicle column: joined files hold the samples of one vehicle each";
            return Err(ReadError::new(&self.path, Fault::content(ContentKind::SeveralVehicles, problem, remedy)));
        }
        self.until_s = items.last().map_or(self.until_s, Item::time_s);
        self.waiting = items.into_iter().peekable();
        Ok(())
    }
}

impl Tracks for Joined {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        &self.vehicles
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let before = items.len();
        for (vehicle, part) in self.parts.iter_mut().enumerate() {
            part.fill(vehicle)?;
        }
        // No unread item of any file is earlier than this.
        let until_s = self.parts.iter().map(|part| part.until_s).fold(f64::INFINITY, f64::min);
        for part in &mut self.parts {
            items.extend(std::iter::from_fn(|| part.waiting.next_if(|item| item.time_s() <= until_s)));
        }
        items[before..].sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        if items.len() == before {
            // Some notes and facts appear only at the end.
            for part in &self.parts {
                learn(&mut self.metadata, part.tracks.metadata());
            }
        }
        Ok(items.len() > before)
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn plans(&self) -> &[Plan] {
        &[]
    }
}

/// Returns whether a file is text without a row of numbers or a time column, such as a note beside tables.
fn is_prose(source: &Source) -> bool {
    let Ok(head) = head_of(source) else { return false };
    // The examined bytes may end inside a character.
    let text = match str::from_utf8(&head) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default(),
        Err(_) => return false,
    };
    let between = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '(' | ')' | '#');
    let is_of_a_table = |line: &str| {
        let words: Vec<_> = line.split(between).filter(|word| !word.is_empty()).collect();
        let numbers = words.iter().filter(|word| word.parse::<f64>().is_ok()).count();
        (numbers > 1 && 2 * numbers > words.len()) || words.iter().any(|word| heading::is_clock(word))
    };
    !text.contains('\0') && !text.lines().any(is_of_a_table)
}

#[cfg(test)]
mod tests {
    use super::natural;

    #[test]
    fn names_are_sorted_by_their_numbers() {
        let mut names = ["cf10", "cf9", "a2_10", "a2_9", "cf1"];
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, ["a2_9", "a2_10", "cf1", "cf9", "cf10"]);
    }
}
