//! Reads the files that a scenario names: points, pictures, drawings, models.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

use super::document::Point;
use super::error::{ErrorKind, ScenarioError};
use super::limits::LARGEST;

/// Key of the file of a formation.
pub(super) const KEY: &str = "formation.file";

/// Size limit of a file \[bytes\].
const MAX_BYTES: u64 = 128 << 20;

/// Reads a file of at most [`MAX_BYTES`]; `key` is the key that names it.
pub(super) fn bytes(path: &Path, key: &'static str) -> Result<Vec<u8>, ScenarioError> {
    let shown = path.display();
    let refused = |said: String, help: &str| ErrorKind::File.at(&[key], said, help);
    let unreadable = |error: std::io::Error| {
        let help = "give the path of a readable file, relative to the folder of the scenario file or to the working \
                    directory";
        refused(format!("cannot read {shown}: {error}"), help)
    };
    let file = File::open(path).map_err(unreadable)?;
    if path.is_dir() {
        return Err(refused(format!("{shown} is a directory"), "give the path of a file within it"));
    }
    let mut bytes = Vec::new();
    // The size of a device or a pipe is unknown in advance.
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(refused(format!("{shown} has more than {} MiB", MAX_BYTES >> 20), "name a smaller file"));
    }
    Ok(bytes)
}

/// Characters of a wrong field that a message quotes.
const SHOWN_CHARS: usize = 40;

/// Columns of a text file, and words for its errors.
pub(super) struct Columns {
    /// Key that names the file.
    pub(super) key: &'static str,
    /// Names of each column, in lower case and without unit, in the default order of the columns.
    pub(super) names: &'static [&'static [&'static str]],
    /// Number of required columns, the first ones.
    pub(super) needed: usize,
    /// Description of a row: `a slot has x, y and optionally z`.
    pub(super) row: &'static str,
    /// Remedy: the format of a line.
    pub(super) help: &'static str,
}

impl Columns {
    /// Reads the rows of a text file, each with its line number. Columns are in the default order, or as a first line
    /// names them (`x`, `y_m`, ...), separated by commas, semicolons, tabs or blanks. Empty lines and lines that begin
    /// with `#` are skipped.
    pub(super) fn read(&self, path: &Path) -> Result<Vec<(u64, Vec<f64>)>, ScenarioError> {
        let refused = |line: u64, said: &str| self.refused(path, line, said);
        let bytes = bytes(path, self.key)?;
        let text =
            std::str::from_utf8(&bytes).map_err(|error| refused(1, &format!("the file is not UTF-8: {error}")))?;
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
                (columns, is_named) = self.column_indices(&fields).map_err(|said| refused(line, &said))?;
                if is_named {
                    continue;
                }
            }
            if !is_named && fields.len() > columns.len() {
                let said = format!("the line has {} columns, but the first line has {}", fields.len(), columns.len());
                return Err(refused(line, &said));
            }
            let numbers = numbers(&fields, &columns).map_err(|said| refused(line, &said))?;
            if let Some(number) = numbers.iter().find(|number| !(-LARGEST..=LARGEST).contains(*number)) {
                return Err(refused(line, &format!("{number:e} must be finite and at most {LARGEST:e} in magnitude")));
            }
            rows.push((line, numbers));
        }
        if rows.is_empty() { Err(refused(1, "the file has no points")) } else { Ok(rows) }
    }

    /// Returns an error about a line of the file.
    pub(super) fn refused(&self, path: &Path, line: u64, said: &str) -> ScenarioError {
        ErrorKind::File.at(&[self.key], format!("{}:{line}: {said}", path.display()), self.help)
    }

    /// Returns the position of each column, and whether the first line is a heading.
    fn column_indices(&self, fields: &[&str]) -> Result<(Vec<usize>, bool), String> {
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

    /// Returns the position of each column if the line is a heading with all required columns.
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

/// Joins names: `x and y`, `t, x and y`.
fn needed(names: impl Iterator<Item = &'static str>) -> String {
    let names: Vec<_> = names.collect();
    match &names[..] {
        [before @ .., last] if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        names => names.concat(),
    }
}

/// Returns the delimiter of the columns, from the first line that is not a comment.
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
    row: "a slot has x, y and optionally z",
    help: "write a slot in m per line, such as 1.5,2.0 or 1.5,2.0,3.0; a first line may name the columns x, y, z",
};

const PLACES: Columns = Columns {
    key: "reference.file",
    names: &[&["t", "time"], &["x"], &["y"], &["z"]],
    needed: 3,
    row: "a point has t, x, y and optionally z",
    help: "write a time in s and a position in m per line, in order of time, such as 0.5,1.0,2.0. A first line may \
           name the columns t, x, y, z",
};

/// Reads slots from a file with the columns x, y and optionally z in m.
pub(super) fn slots(path: &Path) -> Result<Vec<Point>, ScenarioError> {
    Ok(SLOTS.read(path)?.iter().map(|(_, coordinates)| point(coordinates)).collect())
}

/// Reads times \[s\], which must increase, and positions \[m\] from a file with the columns t, x, y and optionally z;
/// at least two rows.
pub(super) fn timed_positions(path: &Path) -> Result<(Vec<f64>, Vec<Point>), ScenarioError> {
    let rows = PLACES.read(path)?;
    let mut before_s = f64::NEG_INFINITY;
    for (line, numbers) in &rows {
        let refused = |said: &str| Err(PLACES.refused(path, *line, said));
        if numbers[0] <= before_s {
            return refused(&format!("the time must be more than {before_s} s, got {} s", numbers[0]));
        }
        before_s = numbers[0];
    }
    if let [(line, _)] = &rows[..] {
        return Err(PLACES.refused(path, *line, "a motion needs at least 2 points, got 1"));
    }
    Ok(rows.iter().map(|(_, numbers)| (numbers[0], point(&numbers[1..]))).unzip())
}

fn point(coordinates: &[f64]) -> Point {
    match *coordinates {
        [x, y, z, ..] => Point::Space([x, y, z]),
        _ => Point::Plane([coordinates[0], coordinates[1]]),
    }
}
