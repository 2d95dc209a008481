//! Files of one vehicle each as one recording.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::error::{Fault, ReadError, quoted};
use super::identity::spelling;
use super::order::Recording;
use super::source::Source;
use tautline_core::track::{Clock, EarthOrigin, Item, Tracks};

/// Clocks that begin further apart than this are not the same \[ns\]: 30 days.
const APART_NS: i64 = 30 * 86_400 * 1_000_000_000;

/// A file of a vehicle.
struct Part {
    path: PathBuf,
    tracks: Recording,
    /// Where its clock begins after that of the recording \[s\].
    shift_s: f64,
    /// Items that were read and not given out.
    waiting: std::iter::Peekable<std::vec::IntoIter<Item>>,
    /// When the last of them begins \[s\]; infinite behind the end of the file.
    until_s: f64,
}

/// Vehicles from several files, in order of time. A block of each file is in memory.
struct Joined {
    vehicles: Vec<String>,
    parts: Vec<Part>,
    clock: Clock,
    notes: Vec<String>,
    /// Whether some file has no height: then the heights of the others are not used.
    is_planar: bool,
}

/// One recording out of several with a vehicle each, which is called as its file; `left_out` says what else there is.
pub(super) fn join(parts: Vec<(PathBuf, Recording)>, left_out: Option<String>) -> Result<Recording, ReadError> {
    let stem = |path: &PathBuf| Source::file(path).stem();
    let (vehicles, parts): (Vec<_>, Vec<_>) =
        parts.into_iter().map(|(path, tracks)| (stem(&path), (path, tracks))).unzip();
    let (paths, recordings): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    let mut known = BTreeMap::new();
    for (name, path) in vehicles.iter().zip(&paths) {
        if let Some(first) = known.insert(spelling(name), path) {
            let problem = format!("the vehicle of {} is called {} too", first.display(), quoted(name));
            let remedy = "vehicles are called as their files: give each file another name";
            return Err(ReadError::new(path, Fault::coded("recording/vehicle-twice", problem, remedy)));
        }
    }
    check_own_names(&recordings, &paths, &vehicles)?;
    check_frames(&recordings, &paths)?;
    let clocks: Vec<Clock> = recordings.iter().map(|tracks| tracks.clock().clone()).collect();
    let Some(first) = clocks.iter().min_by_key(|clock| clock.epoch_ns) else { return Err(Fault::Empty.into()) };
    for ((name, path), clock) in vehicles.iter().zip(&paths).zip(&clocks) {
        let guessed = clock.inferred || clocks[0].inferred;
        let problem = if clock.unit != clocks[0].unit && guessed {
            let (unit, other) = (clock.unit, clocks[0].unit);
            format!(
                "times of {} would be taken as {unit} and those of {} as {other}",
                quoted(name),
                quoted(&vehicles[0])
            )
        } else if clock.epoch_ns.saturating_sub(first.epoch_ns) > APART_NS {
            format!("the clock of {} begins more than a month after that of another file", quoted(name))
        } else {
            continue;
        };
        let remedy = "say the unit with --time-unit, and write all times by one clock";
        return Err(ReadError::new(path, Fault::coded("recording/several-clocks", problem, remedy)));
    }
    let clock = Clock {
        inferred: clocks.iter().any(|clock| clock.inferred),
        by_steps: clocks.iter().any(|clock| clock.by_steps),
        epoch_ns: first.epoch_ns,
        unit: clocks[0].unit,
    };
    let mut notes = vec![format!("a file is a vehicle: {}", vehicles.join(", "))];
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
    let mut joined = Vec::new();
    for ((path, tracks), own) in paths.into_iter().zip(recordings).zip(&clocks) {
        note_new(&mut notes, tracks.notes());
        let shift_s = own.epoch_ns.saturating_sub(clock.epoch_ns) as f64 / 1e9;
        let waiting = Vec::new().into_iter().peekable();
        joined.push(Part { path, tracks, shift_s, waiting, until_s: f64::NEG_INFINITY });
    }
    Ok(Box::new(Joined { vehicles, parts: joined, clock, notes, is_planar }))
}

/// Refuses two files whose rows name the same vehicle, and a file whose rows name the vehicle of another file.
///
/// A name that all files share is not taken for the name of a vehicle.
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
    // Files that are called by each other's names; numbers of files and of vehicles may begin elsewhere.
    let files: BTreeSet<_> = called.iter().map(|name| spelling(name)).collect();
    let others = own.iter().zip(paths).zip(called).filter_map(|((name, path), file)| Some(((*name)?, path, file)));
    let mut others = others.filter(|(name, _, file)| spelling(name) != spelling(file));
    if let Some((name, path, _)) = others.next().filter(|_| known.keys().eq(&files)) {
        let problem = format!("the rows name vehicle {}, which is the name of another file", quoted(name));
        let remedy = "name each file after its vehicle, or remove the column with the name";
        return Err(ReadError::new(path, Fault::coded("recording/vehicle-twice", problem, remedy)));
    }
    let Some((name, first, path)) = twice else { return Ok(()) };
    let problem = format!("its rows are of the vehicle {}, and so are those of {}", quoted(name), first.display());
    let remedy = "put all rows of a vehicle into one file, or take the column out that names it";
    Err(ReadError::new(path, Fault::coded("recording/vehicle-twice", problem, remedy)))
}

/// Refuses files in different frames: on the Earth and in plain metres, or with and without directions of the axes.
fn check_frames(recordings: &[Recording], paths: &[PathBuf]) -> Result<(), ReadError> {
    let frame = |tracks: &Recording| (tracks.earth_origin().is_some(), tracks.has_directions());
    let words = |(on_earth, has_directions): (bool, bool)| match (on_earth, has_directions) {
        (true, _) => "are latitudes and longitudes",
        (false, true) => "are east, north and up by the names of its columns",
        (false, false) => "are x, y and z without a direction",
    };
    let Some((first, path)) = recordings.first().zip(paths.first()) else { return Ok(()) };
    let other = recordings.iter().zip(paths).find(|(tracks, _)| frame(tracks) != frame(first));
    other.map_or(Ok(()), |(tracks, other)| {
        let [its, those] = [tracks, first].map(|tracks| words(frame(tracks)));
        let problem = format!("its positions {its}, and those of {} {those}", path.display());
        Err(ReadError::new(
            other,
            Fault::coded("recording/several-frames", problem, "use one frame and the same column names in all files"),
        ))
    })
}

/// Appends notes that are not there yet.
fn note_new(notes: &mut Vec<String>, of_part: &[String]) {
    for note in of_part {
        if !notes.contains(note) {
            notes.push(note.clone());
        }
    }
}

impl Part {
    /// Reads the next items where none are waiting.
    fn fill(&mut self, vehicle: usize, is_planar: bool) -> Result<(), ReadError> {
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
                    if is_planar {
                        sample.position_m.z = 0.0;
                        sample.velocity_m_s.iter_mut().for_each(|velocity| velocity.z = 0.0);
                    }
                    continue;
                }
                Item::Sample(_) => "it holds several vehicles: a column of it names those of its rows",
                Item::Piece(_) => "it holds a curve, and the first of its files samples",
            };
            let remedy = "files that are joined hold the samples of one vehicle each: split it, or take the column out";
            return Err(ReadError::new(&self.path, Fault::coded("recording/several-vehicles", problem, remedy)));
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
            part.fill(vehicle, self.is_planar)?;
        }
        // Up to here nothing can come between what is known.
        let until_s = self.parts.iter().map(|part| part.until_s).fold(f64::INFINITY, f64::min);
        for part in &mut self.parts {
            items.extend(std::iter::from_fn(|| part.waiting.next_if(|item| item.time_s() <= until_s)));
        }
        items[before..].sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        if items.len() == before {
            // Some of what a person should know shows at the end.
            for part in &self.parts {
                note_new(&mut self.notes, part.tracks.notes());
            }
        }
        Ok(items.len() > before)
    }

    fn clock(&self) -> &Clock {
        &self.clock
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn assumed(&self) -> Option<&str> {
        self.parts.iter().find_map(|part| part.tracks.assumed())
    }

    fn is_planar(&self) -> bool {
        self.is_planar
    }

    fn earth_origin(&self) -> Option<&EarthOrigin> {
        self.parts.iter().find_map(|part| part.tracks.earth_origin())
    }
}
