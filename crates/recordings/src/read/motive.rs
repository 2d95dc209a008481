//! Takes of `OptiTrack` Motive as CSV: rigid bodies, or markers where there are none.
//!
//! The first line says the unit of length. Five lines or so name the columns: type, name, ID, perhaps the parent, what is
//! measured (`Position`) and its axis. Axes are those of Motive: y up.

use std::collections::BTreeSet;

use super::capture::{Capture, When, by_subject, note_of_markers, note_of_others};
use super::error::{Fault, Place, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use super::readers::{Packing, Reader, Takes};
use super::source::{Lines, Source};
use super::{capture, heading};

pub(super) const READER: Reader = Reader {
    name: "motive",
    title: "a take of OptiTrack Motive",
    extensions: &["csv"],
    docs: "Take of OptiTrack Motive as CSV",
    magic: &[],
    sniff: |head| head.is_text(|text| text.starts_with(b"Format Version,")),
    open,
    takes: &[Takes::Rows],
    packing: Packing::Any,
};

/// Lines among which those that name the columns are.
const HEAD_LINES: u64 = 20;

const EXPORT: &str = "export the take again as CSV, with header information and positions";

/// The lines that name the columns.
#[derive(Default)]
struct Head {
    /// What the first line says: names and values by turns.
    said: Vec<String>,
    types: Vec<String>,
    names: Vec<String>,
    measures: Vec<String>,
    axes: Vec<String>,
    first_line: u64,
}

/// Opens a take.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let head = Head::read(source)?;
    let capture = head.capture().map_err(|fault| fault.at(Place::Line(head.first_line - 1)))?;
    capture::open(source, capture, options)
}

impl Head {
    fn read(source: &Source) -> Result<Self, ReadError> {
        let mut head = Self::default();
        let mut lines = Lines::new(source)?;
        let mut before = Vec::new();
        while lines.number() < HEAD_LINES && lines.advance()? {
            let text = std::str::from_utf8(lines.line()).map_err(|_| Fault::NotUtf8.at(Place::Line(lines.number())))?;
            let cells: Vec<String> = text.split(',').map(|cell| cell.trim().trim_matches('"').to_owned()).collect();
            match (lines.number(), cells.first().map(String::as_str), cells.get(1).map(String::as_str)) {
                (1, ..) => head.said = cells,
                (_, Some("Frame"), _) => {
                    (head.axes, head.measures, head.first_line) = (cells, before, lines.number() + 1);
                    return Ok(head);
                }
                (_, _, Some("Type")) => head.types = cells,
                (_, _, Some("Name")) => head.names = cells,
                _ => before = cells,
            }
        }
        Err(Fault::Truncated("the lines that name the columns are missing".to_owned()).into())
    }

    /// What the first line says of something.
    fn said(&self, what: &str) -> Option<&str> {
        self.said.iter().position(|said| said == what).and_then(|at| self.said.get(at + 1)).map(String::as_str)
    }

    fn capture(&self) -> Result<Capture, Fault> {
        let unit = self.said("Length Units").unwrap_or_default();
        let metres = heading::size_of(unit, false).ok_or_else(|| {
            Fault::coded(
                "recording/unknown-unit",
                format!("its unit of length is not known: {}", quoted(unit)),
                "export it in metres",
            )
        })?;
        if let Some(space) = self.said("Coordinate Space").filter(|space| *space != "Global") {
            let problem = format!("its places are given in the space {}", quoted(space));
            return refuse("recording/unusable-frame", problem, "export it in global coordinates");
        }
        let time = self.axes.iter().position(|name| name.starts_with("Time"));
        let time =
            time.ok_or_else(|| Fault::coded("recording/no-time-column", "there is no column of time", EXPORT))?;
        let bodies = self.positions("Rigid Body");
        let has_bodies = !bodies.is_empty();
        let vehicles = if has_bodies {
            bodies.into_iter().map(|(name, columns)| (name, vec![columns])).collect()
        } else {
            by_subject(self.positions("Marker"))?
        };
        if vehicles.is_empty() {
            return refuse(
                "recording/no-positions",
                "it has neither the position of a rigid body nor of a labelled marker",
                EXPORT,
            );
        }
        let mut known = BTreeSet::new();
        if let Some((name, _)) = vehicles.iter().find(|(name, _)| !known.insert(name.as_str())) {
            let problem = format!("two rigid bodies are called {}", quoted(name));
            return refuse(
                "recording/vehicle-twice",
                problem,
                "give each a name of its own, and export the take again",
            );
        }
        let mut notes = vec!["axes of Motive, y up, are turned: x, -z, y".to_owned()];
        notes.extend(note_of_markers(&vehicles));
        let is_read = |name: &str| known.contains(name.split(':').next().unwrap_or_default());
        let others = self.names.iter().skip(2).map(String::as_str).filter(|name| !name.is_empty() && !is_read(name));
        let why = if has_bodies { "being no rigid bodies" } else { "being no labelled markers" };
        notes.extend(note_of_others(why, others));
        Ok(Capture { first_line: self.first_line, when: When::Column(time), vehicles, metres, y_up: true, notes })
    }

    /// The columns of the positions of things of a type.
    fn positions(&self, wanted: &str) -> Vec<(String, [usize; 3])> {
        let is = |row: &[String], column: usize, what: &str| row.get(column).is_some_and(|cell| cell == what);
        let starts = (2..self.axes.len()).filter(|&column| {
            is(&self.types, column, wanted)
                && ["X", "Y", "Z"].iter().enumerate().all(|(axis, name)| {
                    is(&self.measures, column + axis, "Position") && is(&self.axes, column + axis, name)
                })
        });
        let named =
            starts.filter_map(|column| Some((self.names.get(column)?.clone(), [column, column + 1, column + 2])));
        named.filter(|(name, _)| !name.is_empty() && !name.starts_with("Unlabeled")).collect()
    }
}
