//! Files that a scenario names.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

use super::document::Point;
use super::error::ScenarioError;
use super::limits::LARGEST;

/// The key that names the file of a formation.
pub(super) const KEY: &str = "formation.file";

/// Largest file that is read \[bytes\].
const MAX_BYTES: u64 = 128 << 20;

/// All bytes of a file that is not too long, which a key names.
pub(super) fn bytes(path: &Path, key: &'static str) -> Result<Vec<u8>, ScenarioError> {
    let shown = path.display();
    let refused = |said: String, help: &str| ScenarioError::new(said).coded("scenario/file").with_help(help).at(key);
    let unreadable = |error: std::io::Error| {
        let help = "give the path of a file that can be read; it counts from the folder of the scenario file, or from the \
                    working directory where there is none";
        refused(format!("cannot read {shown}: {error}"), help)
    };
    let file = File::open(path).map_err(unreadable)?;
    if path.is_dir() {
        return Err(refused(format!("{shown} is a directory"), "give the path of a file within it"));
    }
    let mut bytes = Vec::new();
    // A device or a pipe does not say how long it is.
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(refused(
            format!("{shown} has more than {} MiB", MAX_BYTES >> 20),
            "nothing that a scenario names is that long: is it the right file?",
        ));
    }
    Ok(bytes)
}

/// Characters of a wrong field that a message shows.
const SHOWN_CHARS: usize = 40;

/// What the columns of a file are, and what is said where they are not.
pub(super) struct Columns {
    /// The key that names the file.
    pub(super) key: &'static str,
    /// What each may be called, in small letters and without its unit, in the order that they have where they are not named.
    pub(super) names: &'static [&'static [&'static str]],
    /// So many of them, the first, are needed.
    pub(super) needed: usize,
    /// What a row has: `a slot has x, y and perhaps z`.
    pub(super) row: &'static str,
    /// How a file is written.
    pub(super) help: &'static str,
}

impl Columns {
    /// The rows of a file of text, each with its line: columns in the order of their names, or as a first line names them
    /// (`x`, `y_m`, ...), with commas, semicolons, tabs or blanks between. Empty lines, and those that begin with `#`, do
    /// not count.
    pub(super) fn read(&self, path: &Path) -> Result<Vec<(u64, Vec<f64>)>, ScenarioError> {
        let refused = |line: u64, said: &str| self.refused(path, line, said);
        let bytes = bytes(path, self.key)?;
        let text = std::str::from_utf8(&bytes).map_err(|error| refused(1, &format!("this is no text: {error}")))?;
        let text = text.trim_start_matches('\u{feff}');
        let delimiter = delimiter(text);
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(Trim::All)
            .comment(Some(b'#'))
            .delimiter(delimiter)
            .from_reader(text.as_bytes());
        let (mut columns, mut is_named): (Vec<usize>, _) = (Vec::new(), false);
        let mut rows = Vec::new();
        for record in reader.records() {
            let record =
                record.map_err(|error| refused(error.position().map_or(1, csv::Position::line), &error.to_string()))?;
            let line = record.position().map_or(1, csv::Position::line);
            let fields = fields(&record, delimiter);
            if fields.is_empty() {
                continue;
            }
            if columns.is_empty() {
                (columns, is_named) = self.places(&fields).map_err(|said| refused(line, &said))?;
                if is_named {
                    continue;
                }
            }
            if !is_named && fields.len() > columns.len() {
                let said = format!("{} columns where the first line has {}", fields.len(), columns.len());
                return Err(refused(line, &said));
            }
            let numbers = numbers(&fields, &columns).map_err(|said| refused(line, &said))?;
            if let Some(number) = numbers.iter().find(|number| !(-LARGEST..=LARGEST).contains(*number)) {
                return Err(refused(line, &format!("{number:e} must be finite and at most {LARGEST:e} in magnitude")));
            }
            rows.push((line, numbers));
        }
        if rows.is_empty() { Err(refused(1, "there is no point")) } else { Ok(rows) }
    }

    /// What is wrong in a line of the file.
    pub(super) fn refused(&self, path: &Path, line: u64, said: &str) -> ScenarioError {
        ScenarioError::new(format!("{}:{line}: {said}", path.display()))
            .coded("scenario/file")
            .with_help(self.help)
            .at(self.key)
    }

    /// Where each column is, by the first line, and whether that line is a heading.
    fn places(&self, fields: &[&str]) -> Result<(Vec<usize>, bool), String> {
        if let Some(places) = self.named(fields) {
            return Ok((places, true));
        }
        let needed = needed(self.names.iter().take(self.needed).filter_map(|names| names.first()).copied());
        if fields.len() > self.names.len() {
            return Err(format!("{} columns without the names {needed}", fields.len()));
        }
        if fields.iter().all(|field| field.parse::<f64>().is_err()) {
            return Err(format!("the first line does not name the columns {needed}"));
        }
        if fields.len() < self.needed {
            return Err(format!("{} columns; {}", fields.len(), self.row));
        }
        Ok(((0..fields.len()).collect(), false))
    }

    /// Where each column is, where a heading names all that are needed.
    fn named(&self, fields: &[&str]) -> Option<Vec<usize>> {
        let headings: Vec<String> = fields.iter().map(|field| field.to_ascii_lowercase()).collect();
        let bare = |heading: &str| {
            let unit = ["_m", "_s"].into_iter().find(|unit| heading.ends_with(unit)).unwrap_or_default();
            heading.len() - unit.len()
        };
        let place = |names: &&[&str]| headings.iter().position(|heading| names.contains(&&heading[..bare(heading)]));
        let (needed, more) = self.names.split_at(self.needed);
        let mut places = needed.iter().map(place).collect::<Option<Vec<usize>>>()?;
        places.extend(more.iter().filter_map(place));
        Some(places)
    }
}

/// `x and y`, `t, x and y`.
fn needed(names: impl Iterator<Item = &'static str>) -> String {
    let names: Vec<_> = names.collect();
    match &names[..] {
        [before @ .., last] if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        names => names.concat(),
    }
}

/// What stands between columns: the first line with a number or a name tells.
fn delimiter(text: &str) -> u8 {
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or_default();
    [b',', b';', b'\t'].into_iter().find(|&mark| first.as_bytes().contains(&mark)).unwrap_or(b' ')
}

fn fields(record: &StringRecord, delimiter: u8) -> Vec<&str> {
    record.iter().filter(|field| delimiter != b' ' || !field.is_empty()).collect()
}

fn numbers(fields: &[&str], columns: &[usize]) -> Result<Vec<f64>, String> {
    let number = |&column: &usize| {
        let field = fields.get(column).ok_or_else(|| format!("{} columns, not {}", fields.len(), columns.len()))?;
        let shown = || field.chars().take(SHOWN_CHARS).collect::<String>();
        field.parse::<f64>().map_err(|_| format!("`{}` is not a number", shown()))
    };
    columns.iter().map(number).collect()
}

const SLOTS: Columns = Columns {
    key: KEY,
    names: &[&["x"], &["y"], &["z"]],
    needed: 2,
    row: "a slot has x, y and perhaps z",
    help: "a line has the coordinates of a slot in m, such as 1.5,2.0 or 1.5,2.0,3.0; a first line may name the columns x, y, z",
};

const PLACES: Columns = Columns {
    key: "reference.file",
    names: &[&["t", "time"], &["x"], &["y"], &["z"]],
    needed: 3,
    row: "a place in time has t, x, y and perhaps z",
    help: "a line has a time in s, later than that of the line before, and the place there in m, such as 0.5,1.0,2.0 or \
           0.5,1.0,2.0,3.0; a first line may name the columns t, x, y, z",
};

/// The slots in a file of columns x, y and perhaps z in m.
pub(super) fn slots(path: &Path) -> Result<Vec<Point>, ScenarioError> {
    Ok(SLOTS.read(path)?.iter().map(|(_, coordinates)| point(coordinates)).collect())
}

/// When a motion is where \[s\] \[m\], at least twice: a file of columns t, x, y and perhaps z, whose times grow.
pub(super) fn places(path: &Path) -> Result<(Vec<f64>, Vec<Point>), ScenarioError> {
    let rows = PLACES.read(path)?;
    let mut before_s = f64::NEG_INFINITY;
    for (line, numbers) in &rows {
        let refused = |said: &str| Err(PLACES.refused(path, *line, said));
        if numbers[0] <= before_s {
            return refused(&format!("the time {} s is not after {before_s} s", numbers[0]));
        }
        before_s = numbers[0];
    }
    if let [(line, _)] = &rows[..] {
        return Err(PLACES.refused(path, *line, "there is one point, and a motion has at least two"));
    }
    Ok(rows.iter().map(|(_, numbers)| (numbers[0], point(&numbers[1..]))).unzip())
}

fn point(coordinates: &[f64]) -> Point {
    match *coordinates {
        [x, y, z, ..] => Point::Space([x, y, z]),
        _ => Point::Plane([coordinates[0], coordinates[1]]),
    }
}
