//! What the tables of motion capture share: rows below a head of several lines, a vehicle in several markers.

use std::collections::{BTreeMap, BTreeSet};
use std::str;

use nalgebra::Vector3;

use super::clock::{Stamp, TimeUnit};
use super::error::{Fault, Place, ReadError, UNSEEN, quoted, refuse};
use super::options::ReadOptions;
use super::order::{About, BATCH, Ordered, Recording, Row, Rows};
use super::source::{Lines, Source};

/// When a row is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum When {
    /// In a column \[s\].
    Column(usize),
    /// The first column counts frames, of which there are so many in a second; the second one parts of frames, if any.
    Frames(f64),
}

/// A vehicle, with the columns x, y and z of its markers.
pub(super) type Marked = (String, Vec<[usize; 3]>);

/// What stands in the columns of a table.
pub(super) struct Capture {
    /// The line of the first row, from 1.
    pub(super) first_line: u64,
    pub(super) when: When,
    /// Vehicles, each with the columns x, y and z of its markers: its place is the middle of these.
    pub(super) vehicles: Vec<Marked>,
    /// The length of a unit \[m\].
    pub(super) metres: f64,
    /// Whether y is up, and z towards the one who looks along it.
    pub(super) y_up: bool,
    pub(super) notes: Vec<String>,
}

/// Groups the columns of markers by what is before the colon of their names: these are on one vehicle. Two markers of one
/// name are refused: their middle would be where neither is.
pub(super) fn by_subject(markers: Vec<(String, [usize; 3])>) -> Result<Vec<Marked>, Fault> {
    let mut vehicles: Vec<Marked> = Vec::new();
    let (mut known, mut names) = (BTreeMap::new(), BTreeSet::new());
    for (name, columns) in markers {
        if !names.insert(name.clone()) {
            let problem = format!("two markers are called {}", quoted(&name));
            return refuse("recording/vehicle-twice", problem, "give each a name of its own, and export it again");
        }
        let subject = name.split(':').next().unwrap_or_default().to_owned();
        let at = *known.entry(subject.clone()).or_insert(vehicles.len());
        if at == vehicles.len() {
            vehicles.push((subject, Vec::new()));
        }
        vehicles[at].1.push(columns);
    }
    Ok(vehicles)
}

/// Names that are not read, a few of them by name.
pub(super) fn note_of_others<'a>(why: &str, others: impl Iterator<Item = &'a str>) -> Option<String> {
    const LISTED: usize = 8;
    let others: BTreeSet<_> = others.collect();
    let more = others.len().saturating_sub(LISTED);
    let listed = others.iter().take(LISTED).copied().collect::<Vec<_>>().join(", ");
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!others.is_empty()).then(|| format!("not read, {why}: {listed}{more}"))
}

/// Which vehicles are the middle of several markers.
pub(super) fn note_of_markers(vehicles: &[Marked]) -> Option<String> {
    let several = vehicles.iter().filter(|(_, markers)| markers.len() > 1);
    let several: Vec<_> = several.map(|(name, markers)| format!("{name} ({})", markers.len())).collect();
    let what = "the middle of markers, where all of them are seen, is the place of";
    (!several.is_empty()).then(|| format!("{what} {}", several.join(", ")))
}

/// Opens a table with these columns.
pub(super) fn open(source: &Source, capture: Capture, options: &ReadOptions) -> Result<Recording, ReadError> {
    if options.metres() != 1.0 {
        let problem = format!("it says its unit of length, and --scale {} another", options.metres());
        return refuse("recording/contradicts-option", problem, "leave --scale away");
    }
    let names = capture.vehicles.iter().map(|(name, _)| name.clone()).collect();
    let (said, notes) = (Some(TimeUnit::Seconds), capture.notes.clone());
    let about = About::new(source, options, said, notes, Fault::header_only());
    let mut lines = Lines::new(source)?;
    while lines.number() + 1 < capture.first_line && lines.advance()? {}
    Ok(Box::new(Ordered::open(Table { capture, names, lines, ended: false }, about)?))
}

struct Table {
    capture: Capture,
    names: Vec<String>,
    lines: Lines,
    ended: bool,
}

impl Table {
    /// Appends the vehicles of the current line.
    fn append(&self, rows: &mut Vec<Row>) -> Result<(), Fault> {
        let cells: Vec<&[u8]> = self.lines.line().split(|&byte| byte == b',').map(<[u8]>::trim_ascii).collect();
        let stamp = self.stamp(&cells)?;
        for (vehicle, (_, markers)) in self.capture.vehicles.iter().enumerate() {
            let Some(middle) = middle(&cells, markers)? else { continue };
            let turned = if self.capture.y_up { Vector3::new(middle.x, -middle.z, middle.y) } else { middle };
            let position = turned * self.capture.metres;
            rows.push(Row { stamp, place: self.lines.number(), vehicle, position, velocity: None, radius: None });
        }
        Ok(())
    }

    fn stamp(&self, cells: &[&[u8]]) -> Result<Stamp, Fault> {
        let needed = |column| number(cells, column)?.ok_or_else(|| Fault::empty_cell(&(column + 1).to_string()));
        match self.capture.when {
            When::Column(column) => needed(column).map(Stamp::Real),
            When::Frames(rate) => {
                if let Some(part) = number(cells, 1)?.filter(|part| *part != 0.0) {
                    let problem = format!("it is part {part} of a frame");
                    return refuse("recording/frame-rate", problem, "export trajectories at the rate of the cameras");
                }
                Ok(Stamp::Real(needed(0)? / rate))
            }
        }
    }
}

/// The middle of some markers; none where one of them is not seen.
fn middle(cells: &[&[u8]], markers: &[[usize; 3]]) -> Result<Option<Vector3<f64>>, Fault> {
    let mut sum = Vector3::zeros();
    for columns in markers {
        let [x, y, z] = columns.map(|column| number(cells, column));
        match (x?, y?, z?) {
            (Some(x), Some(y), Some(z)) => sum += Vector3::new(x, y, z),
            (None, None, None) => return Ok(None),
            _ => {
                let column = columns.iter().find(|column| cells.get(**column).is_some_and(|cell| cell.is_empty()));
                return Err(Fault::empty_cell(&column.map_or(0, |column| column + 1).to_string()));
            }
        }
    }
    Ok(Some(if markers.len() > 1 { sum / markers.len() as f64 } else { sum }))
}

/// The number in a cell; none where it is empty.
fn number(cells: &[&[u8]], column: usize) -> Result<Option<f64>, Fault> {
    let Some(cell) = cells.get(column) else {
        let problem = format!("it has {} fields, and field {} belongs to a vehicle", cells.len(), column + 1);
        return refuse(
            "recording/field-count",
            problem,
            "every line needs a field for each column; a marker that is lost has empty ones",
        );
    };
    let text = str::from_utf8(cell).map_err(|_| Fault::NotUtf8)?;
    match text.parse::<f64>() {
        _ if text.is_empty() => Ok(None),
        Ok(number) if number.is_finite() => Ok(Some(number)),
        Ok(_) => Err(Fault::not_finite(&(column + 1).to_string(), text, UNSEEN)),
        Err(_) => {
            let problem = format!("column `{}` holds {}, which is not a number", column + 1, quoted(text));
            refuse("recording/not-a-number", problem, "export it again, with numbers that have a decimal point")
        }
    }
}

impl Rows for Table {
    /// A table ends with the file, or with a line that is blank.
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH && !self.ended {
            let is_blank = |line: &[u8]| line.iter().all(|byte| matches!(byte, b',' | b' ' | b'\t'));
            self.ended = !self.lines.advance()? || is_blank(self.lines.line());
            if self.ended {
                break;
            }
            self.append(rows).map_err(|fault| fault.at(Place::Line(self.lines.number())))?;
        }
        Ok(rows.len() > before)
    }

    fn vehicles(&self) -> &[String] {
        &self.names
    }

    fn place(&self, number: u64) -> Place {
        Place::Line(number)
    }
}
