//! Reads motion capture takes in CSV: `OptiTrack` Motive, and Vicon Nexus and Tracker. Rows follow a head of several
//! lines; a vehicle has one or several markers.
//!
//! A Vicon export has sections, each with a rate, names, axes and units above its rows:
//!
//! ```text
//! Trajectories
//! 100
//! ,,cf1:front,,,cf1:back,,
//! Frame,Sub Frame,X,Y,Z,X,Y,Z
//! ,,mm,mm,mm,mm,mm,mm
//! 1,0,102.5,-3.1,955.0,82.5,-3.0,955.1
//! ```
//!
//! Objects have translations (`TX`, `TY`, `TZ`) and rotations. A section with translations is read if there is one,
//! else the trajectories of markers.
//!
//! The first line of a Motive take gives the unit of length. About five lines name the columns: type, name, ID,
//! optionally the parent, the quantity (`Position`) and its axis. The y axis is up. Rigid bodies are read, or markers
//! otherwise.

use std::collections::{BTreeMap, BTreeSet};
use std::str;

use nalgebra::Vector3;

use super::cells::parse_number;
use super::clock::Stamp;
use super::error::{ContentKind, Fault, Place, ReadError, UNSEEN, first_few, quoted, refuse};
use super::heading;
use super::options::ReadOptions;
use super::order::{Ordered, Recording, RecordingInfo, Row, Rows};
use super::source::{Lines, Source};
use super::time_unit::TimeUnit;
use tautline_core::option::SCALE;

/// Source of the time of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
enum TimeSource {
    /// A column \[s\].
    Column(usize),
    /// Frame numbers in the first column, at this rate \[Hz\]; the second column counts subframes.
    Frames(f64),
}

/// Vehicle with the columns x, y and z of its markers.
type MarkerColumns = (String, Vec<[usize; 3]>);

/// Columns of a take.
struct Capture {
    /// First line with a row, from 1.
    first_line: u64,
    when: TimeSource,
    /// Vehicles with their marker columns; the position of a vehicle is the mean of its markers.
    vehicles: Vec<MarkerColumns>,
    /// Length of a unit \[m\].
    metres: f64,
    /// Whether y is up, x right and z backwards.
    y_up: bool,
    notes: Vec<String>,
}

/// Groups markers into vehicles by the name before the colon. Two markers with one name are refused, because their mean
/// has no meaning.
fn by_subject(markers: Vec<(String, [usize; 3])>) -> Result<Vec<MarkerColumns>, Fault> {
    let mut vehicles: Vec<MarkerColumns> = Vec::new();
    let (mut known, mut names) = (BTreeMap::new(), BTreeSet::new());
    for (name, columns) in markers {
        if !names.insert(name.clone()) {
            let problem = format!("two markers have the name {}", quoted(&name));
            return refuse(ContentKind::VehicleTwice, problem, "give each marker its own name, and export again");
        }
        let subject = subject(&name).to_owned();
        let index = *known.entry(subject.clone()).or_insert(vehicles.len());
        if index == vehicles.len() {
            vehicles.push((subject, Vec::new()));
        }
        vehicles[index].1.push(columns);
    }
    Ok(vehicles)
}

/// Returns the length of a unit \[m\]; `remedy` is the remedy for an unknown one.
fn unit_m(unit: &str, remedy: &str) -> Result<f64, Fault> {
    let unknown = || format!("unknown unit of length {}", quoted(unit));
    heading::size_of(unit, false).ok_or_else(|| Fault::content(ContentKind::UnknownUnit, unknown(), remedy))
}

/// Returns the note on names that are not read, with the first few names.
fn note_of_others<'a>(why: &str, others: impl Iterator<Item = &'a str>) -> Option<String> {
    const LISTED: usize = 8;
    let others: Vec<_> = others.collect::<BTreeSet<_>>().into_iter().collect();
    (!others.is_empty()).then(|| format!("not read, as {why}: {}", first_few(&others, LISTED)))
}

/// Returns the note on vehicles with several markers.
fn note_of_markers(vehicles: &[MarkerColumns]) -> Option<String> {
    let several = vehicles.iter().filter(|(_, markers)| markers.len() > 1);
    let several: Vec<_> = several.map(|(name, markers)| format!("{name} ({})", markers.len())).collect();
    let what = "the position is the mean of the markers, if all of them are seen, for";
    (!several.is_empty()).then(|| format!("{what} {}", several.join(", ")))
}

/// Opens a take with these columns.
fn open(source: &Source, capture: Capture, options: &ReadOptions) -> Result<Recording, ReadError> {
    if options.metres() != 1.0 {
        let problem = format!("it has a unit of length, which contradicts {}", SCALE.set(options.metres()));
        return refuse(ContentKind::ContradictsOption, problem, format!("omit {SCALE}"));
    }
    let names = capture.vehicles.iter().map(|(name, _)| name.clone()).collect();
    let (unit, notes) = (Some(TimeUnit::Seconds), capture.notes.clone());
    let info = RecordingInfo::new(source, options, unit, notes, Fault::header_only());
    let mut lines = Lines::new(source)?;
    while lines.number() + 1 < capture.first_line && lines.advance()? {}
    Ok(Box::new(Ordered::open(Table { capture, names, lines, ended: false }, info)?))
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
        let needed = |column| number(cells, column)?.ok_or_else(|| Fault::empty_cell(column + 1));
        match self.capture.when {
            TimeSource::Column(column) => needed(column).map(Stamp::Real),
            TimeSource::Frames(rate) => {
                if let Some(part) = number(cells, 1)?.filter(|part| *part != 0.0) {
                    let problem = format!("it is subframe {part}");
                    return refuse(ContentKind::FrameRate, problem, "export trajectories at the camera rate");
                }
                Ok(Stamp::Real(needed(0)? / rate))
            }
        }
    }
}

/// Returns the mean of the markers; `None` if one of them is not seen.
fn middle(cells: &[&[u8]], markers: &[[usize; 3]]) -> Result<Option<Vector3<f64>>, Fault> {
    let mut sum = Vector3::zeros();
    for columns in markers {
        let [x, y, z] = columns.map(|column| number(cells, column));
        match (x?, y?, z?) {
            (Some(x), Some(y), Some(z)) => sum += Vector3::new(x, y, z),
            (None, None, None) => return Ok(None),
            _ => {
                let column = columns.iter().find(|column| cells.get(**column).is_some_and(|cell| cell.is_empty()));
                return Err(Fault::empty_cell(column.map_or(0, |column| column + 1)));
            }
        }
    }
    Ok(Some(if markers.len() > 1 { sum / markers.len() as f64 } else { sum }))
}

/// Returns the number in a cell; `None` for an empty cell.
fn number(cells: &[&[u8]], column: usize) -> Result<Option<f64>, Fault> {
    let Some(cell) = cells.get(column) else {
        let problem = format!("it has {} fields, but field {} belongs to a vehicle", cells.len(), column + 1);
        let remedy = "every line needs one field per column; the fields of a lost marker are empty";
        return refuse(ContentKind::FieldCount, problem, remedy);
    };
    parse_number(column + 1, str::from_utf8(cell).map_err(|_| Fault::not_utf8())?, UNSEEN)
}

impl Rows for Table {
    /// The table ends with the file, or at a blank line.
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        self.ended = self.ended || !self.lines.advance()? || is_blank(self.lines.line());
        if !self.ended {
            self.append(rows).map_err(|fault| fault.at(self.lines.place()))?;
        }
        Ok(!self.ended)
    }

    fn vehicles(&self) -> &[String] {
        &self.names
    }

    fn place(&self, number: u64) -> Place {
        Place::Line(number)
    }
}

/// First bytes of a Motive take.
pub(super) const MOTIVE: &[u8] = b"Format Version,";

/// Number of lines in which the column names must occur.
const HEAD_LINES: u64 = 20;

const EXPORT: &str = "export the take again as CSV, with header information and positions";

/// Lines with the column names.
#[derive(Default)]
struct MotiveHead {
    /// First line: alternating names and values.
    header: Vec<String>,
    types: Vec<String>,
    names: Vec<String>,
    measures: Vec<String>,
    axes: Vec<String>,
    first_line: u64,
}

/// Opens a Motive take.
pub(super) fn open_motive(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let head = MotiveHead::read(source)?;
    let capture = head.capture().map_err(|fault| fault.at(Place::Line(head.first_line - 1)))?;
    open(source, capture, options)
}

impl MotiveHead {
    fn read(source: &Source) -> Result<Self, ReadError> {
        let mut head = Self::default();
        let mut lines = Lines::new(source)?;
        let mut before = Vec::new();
        while lines.number() < HEAD_LINES && lines.advance()? {
            let cells = cells(str::from_utf8(lines.line()).map_err(|_| Fault::not_utf8().at(lines.place()))?);
            match (lines.number(), cells.first().map(String::as_str), cells.get(1).map(String::as_str)) {
                (1, ..) => head.header = cells,
                (_, Some("Frame"), _) => {
                    (head.axes, head.measures, head.first_line) = (cells, before, lines.number() + 1);
                    return Ok(head);
                }
                (_, _, Some("Type")) => head.types = cells,
                (_, _, Some("Name")) => head.names = cells,
                _ => before = cells,
            }
        }
        Err(Fault::truncated("the lines with the column names are missing").into())
    }

    /// Returns the value of a name in the first line.
    fn header_value(&self, what: &str) -> Option<&str> {
        self.header
            .iter()
            .position(|name| name == what)
            .and_then(|index| self.header.get(index + 1))
            .map(String::as_str)
    }

    fn capture(&self) -> Result<Capture, Fault> {
        let unit = self.header_value("Length Units").unwrap_or_default();
        let metres = unit_m(unit, "export it in metres")?;
        if let Some(space) = self.header_value("Coordinate Space").filter(|space| *space != "Global") {
            let problem = format!("its coordinate space is {}", quoted(space));
            return refuse(ContentKind::UnusableFrame, problem, "export it in global coordinates");
        }
        let time = self.axes.iter().position(|name| name.starts_with("Time"));
        let time = time.ok_or_else(|| Fault::content(ContentKind::NoTimeColumn, "no column gives the time", EXPORT))?;
        let bodies = self.positions("Rigid Body");
        let has_bodies = !bodies.is_empty();
        let vehicles = if has_bodies {
            bodies.into_iter().map(|(name, columns)| (name, vec![columns])).collect()
        } else {
            by_subject(self.positions("Marker"))?
        };
        if vehicles.is_empty() {
            return refuse(
                ContentKind::NoPositions,
                "it has neither a rigid body nor a labelled marker with positions",
                EXPORT,
            );
        }
        let mut known = BTreeSet::new();
        if let Some((name, _)) = vehicles.iter().find(|(name, _)| !known.insert(name.as_str())) {
            let problem = format!("two rigid bodies have the name {}", quoted(name));
            return refuse(ContentKind::VehicleTwice, problem, "give each rigid body its own name, and export again");
        }
        let mut notes = vec!["Motive has y up: its x, -z and y are read as x, y and z".to_owned()];
        notes.extend(note_of_markers(&vehicles));
        let is_read = |name: &str| known.contains(subject(name));
        let others = self.names.iter().skip(2).map(String::as_str).filter(|name| !name.is_empty() && !is_read(name));
        let why = if has_bodies { "they are not rigid bodies" } else { "they are not labelled markers" };
        notes.extend(note_of_others(why, others));
        Ok(Capture { first_line: self.first_line, when: TimeSource::Column(time), vehicles, metres, y_up: true, notes })
    }

    /// Returns the position columns of all items of a type.
    fn positions(&self, wanted: &str) -> Vec<(String, [usize; 3])> {
        let holds = |row: &[String], column: usize, what: &str| row.get(column).is_some_and(|cell| cell == what);
        let starts = (2..self.axes.len()).filter(|&column| {
            holds(&self.types, column, wanted)
                && ["X", "Y", "Z"].iter().enumerate().all(|(axis, name)| {
                    holds(&self.measures, column + axis, "Position") && holds(&self.axes, column + axis, name)
                })
        });
        let named =
            starts.filter_map(|column| Some((self.names.get(column)?.clone(), [column, column + 1, column + 2])));
        named.filter(|(name, _)| !name.is_empty() && !name.starts_with("Unlabeled")).collect()
    }
}

/// Names of the first section of an export.
const SECTIONS: [&str; 9] =
    ["Trajectories", "Objects", "Object", "Segments", "Model Outputs", "Devices", "Events", "Joints", "Global Angle"];

/// Name of the section with markers.
const MARKERS: &str = "Trajectories";

/// Returns whether a text is a Vicon export: it begins with a section name and a rate.
pub(super) fn is_vicon(text: &[u8]) -> bool {
    let mut lines = text.split(|&byte| byte == b'\n').map(|line| cells(&String::from_utf8_lossy(line)));
    let (first, second) = (lines.next().unwrap_or_default(), lines.next().unwrap_or_default());
    let rate = second.first().and_then(|rate| rate.parse::<f64>().ok());
    first.first().is_some_and(|name| SECTIONS.contains(&name.as_str())) && rate.is_some()
}

fn is_blank(line: &[u8]) -> bool {
    line.iter().all(|byte| matches!(byte, b',' | b' ' | b'\t'))
}

/// Splits a line into cells, without empty ones at its end.
fn cells(text: &str) -> Vec<String> {
    let mut cells: Vec<_> = text.split(',').map(|cell| cell.trim().trim_matches('"').to_owned()).collect();
    while cells.pop_if(|cell| cell.is_empty()).is_some() {}
    cells
}

/// Head of a section.
struct ViconSection {
    section: String,
    rate: String,
    names: Vec<String>,
    axes: Vec<String>,
    units: Vec<String>,
    first_line: u64,
}

/// Opens a Vicon export.
pub(super) fn open_vicon(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let heads = heads(source)?;
    let objects = heads.iter().find(|head| head.axes.iter().any(|axis| axis == "TX"));
    let Some(head) = objects.or_else(|| heads.iter().find(|head| head.section == MARKERS)) else {
        let sections: Vec<_> = heads.iter().map(|head| head.section.as_str()).collect();
        let problem = format!("it has neither objects nor trajectories; its sections are {}", sections.join(", "));
        let remedy = "export the trajectories of markers, or the objects of Tracker";
        return refuse(ContentKind::NoPositions, problem, remedy);
    };
    let mut capture = head.capture().map_err(|fault| fault.at(Place::Line(head.first_line - 1)))?;
    let read = |name: &str| capture.vehicles.iter().any(|(vehicle, _)| vehicle == subject(name));
    let others = heads.iter().filter(|other| other.first_line != head.first_line).flat_map(|other| &other.names);
    let others =
        others.map(|name| subject(name)).filter(|name| !name.is_empty() && !name.starts_with('*') && !read(name));
    let note = note_of_others(&format!("they are outside the section {}", head.section), others);
    capture.notes.extend(note);
    open(source, capture, options)
}

/// Returns the vehicle of a marker.
fn subject(name: &str) -> &str {
    name.split(':').next().unwrap_or_default()
}

/// Reads the heads of all sections, which follow a blank line or begin the file.
fn heads(source: &Source) -> Result<Vec<ViconSection>, ReadError> {
    let mut lines = Lines::new(source)?;
    let (mut heads, mut blank) = (Vec::new(), true);
    while lines.advance()? {
        let is_first = std::mem::replace(&mut blank, is_blank(lines.line()));
        let section = if is_first && !blank { cells(&String::from_utf8_lossy(lines.line())) } else { continue };
        if section.len() != 1 {
            continue;
        }
        let mut head = Vec::new();
        while head.len() < 4 && !blank && lines.advance()? {
            head.push(cells(&String::from_utf8_lossy(lines.line())));
            blank = head.last().is_some_and(Vec::is_empty);
        }
        let Ok([rate, names, axes, units]) = <[Vec<String>; 4]>::try_from(head) else { continue };
        if axes.first().is_some_and(|cell| cell == "Frame") {
            let [section, rate] = [section, rate].map(|cells| cells.into_iter().next().unwrap_or_default());
            heads.push(ViconSection { section, rate, names, axes, units, first_line: lines.number() + 1 });
        }
    }
    if heads.is_empty() {
        return Err(Fault::truncated("the lines with the column names are missing").into());
    }
    Ok(heads)
}

impl ViconSection {
    fn capture(&self) -> Result<Capture, Fault> {
        let rate = self.rate.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
        let rate = rate.ok_or_else(|| {
            let problem = format!("the rate of {} must be a positive number, got {}", self.section, quoted(&self.rate));
            let remedy = "export again: the second line of a section gives the number of frames per second";
            Fault::content(ContentKind::FrameRate, problem, remedy)
        })?;
        let is_objects = self.axes.iter().any(|axis| axis == "TX");
        let markers = self.markers(if is_objects { ["TX", "TY", "TZ"] } else { ["X", "Y", "Z"] });
        let metres = self.metres(&markers)?;
        let parts = markers.len();
        let vehicles = by_subject(markers)?;
        if vehicles.is_empty() {
            let remedy = "export again, with labelled trajectories";
            return refuse(ContentKind::NoPositions, "it has no named marker and no object", remedy);
        }
        if is_objects && vehicles.len() < parts {
            let several = vehicles.iter().find(|(_, columns)| columns.len() > 1).map_or("", |(name, _)| name);
            let problem = format!("{} has several segments", quoted(several));
            let remedy = "export objects with one segment each, or the trajectories of markers";
            return refuse(ContentKind::AmbiguousColumn, problem, remedy);
        }
        let notes = note_of_markers(&vehicles).into_iter().collect();
        let when = TimeSource::Frames(rate);
        Ok(Capture { first_line: self.first_line, when, vehicles, metres, y_up: false, notes })
    }

    /// Returns the columns of each name that has these axes.
    fn markers(&self, axes: [&str; 3]) -> Vec<(String, [usize; 3])> {
        let named: Vec<_> = (2..self.names.len()).filter(|&column| !self.names[column].is_empty()).collect();
        let ends = named.iter().skip(1).copied().chain([self.axes.len()]);
        let columns = |(&from, to): (&usize, usize)| {
            let column_of = |axis: &str| (from..to.min(self.axes.len())).find(|&column| self.axes[column] == axis);
            Some((self.names[from].clone(), [column_of(axes[0])?, column_of(axes[1])?, column_of(axes[2])?]))
        };
        named.iter().zip(ends).filter_map(columns).filter(|(name, _)| !name.starts_with('*')).collect()
    }

    /// Returns the length of the unit of all position columns \[m\].
    fn metres(&self, markers: &[(String, [usize; 3])]) -> Result<f64, Fault> {
        let mut units = markers.iter().flat_map(|(_, columns)| columns).map(|&column| self.units.get(column));
        let first = units.next().flatten().map_or("", String::as_str);
        if let Some(other) = units.find(|unit| unit.map_or("", |unit| unit.as_str()) != first) {
            let problem =
                format!("positions have different units: {} and {}", quoted(first), quoted(other.map_or("", |u| u)));
            return refuse(ContentKind::UnitConflict, problem, "export all positions in millimetres");
        }
        unit_m(first, "export it in millimetres")
    }
}
