//! CSV exports of Vicon Nexus and Tracker: sections, each with a rate, names, axes and units above its rows.
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
//! Objects have translations (`TX`, `TY`, `TZ`) beside their rotations; where some section has these, it is read, else the
//! trajectories of markers.

use super::capture::{Capture, When, by_subject, note_of_markers, note_of_others};
use super::error::{Fault, Place, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use super::readers::{Packing, Reader, Takes};
use super::source::{Lines, Source};
use super::{capture, heading};

pub(super) const READER: Reader = Reader {
    name: "vicon",
    title: "an export of Vicon",
    extensions: &["csv"],
    docs: "Export of Vicon Nexus or Tracker as CSV",
    magic: &[],
    sniff: |head| head.is_text(is_export),
    open,
    takes: &[Takes::Rows, Takes::Axes],
    packing: Packing::Any,
};

/// Names that a first section has.
const SECTIONS: [&str; 9] =
    ["Trajectories", "Objects", "Object", "Segments", "Model Outputs", "Devices", "Events", "Joints", "Global Angle"];

/// The section of markers.
const MARKERS: &str = "Trajectories";

/// Whether a text begins as an export does: a section, and its rate.
fn is_export(text: &[u8]) -> bool {
    let mut lines = text.split(|&byte| byte == b'\n').map(cells);
    let (first, second) = (lines.next().unwrap_or_default(), lines.next().unwrap_or_default());
    let rate = second.first().and_then(|rate| rate.parse::<f64>().ok());
    first.first().is_some_and(|name| SECTIONS.contains(&name.as_str())) && rate.is_some()
}

/// The cells of a line without empty ones at its end.
fn cells(line: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(line);
    let mut cells: Vec<_> = text.split(',').map(|cell| cell.trim().trim_matches('"').to_owned()).collect();
    while cells.pop_if(|cell| cell.is_empty()).is_some() {}
    cells
}

/// The lines above the rows of a section.
struct Head {
    section: String,
    rate: String,
    names: Vec<String>,
    axes: Vec<String>,
    units: Vec<String>,
    first_line: u64,
}

/// Opens an export.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let heads = heads(source)?;
    let objects = heads.iter().find(|head| head.axes.iter().any(|axis| axis == "TX"));
    let Some(head) = objects.or_else(|| heads.iter().find(|head| head.section == MARKERS)) else {
        let sections: Vec<_> = heads.iter().map(|head| head.section.as_str()).collect();
        let problem = format!("it has neither objects nor trajectories, but {}", sections.join(", "));
        return refuse(
            "recording/no-positions",
            problem,
            "export the trajectories of markers, or the objects of Tracker",
        );
    };
    let mut capture = head.capture().map_err(|fault| fault.at(Place::Line(head.first_line - 1)))?;
    let read = |name: &str| capture.vehicles.iter().any(|(vehicle, _)| vehicle == subject(name));
    let others = heads.iter().filter(|other| other.first_line != head.first_line).flat_map(|other| &other.names);
    let others =
        others.map(|name| subject(name)).filter(|name| !name.is_empty() && !name.starts_with('*') && !read(name));
    let note = note_of_others(&format!("beside those of the section {}", head.section), others);
    capture.notes.extend(note);
    capture::open(source, capture, options)
}

/// Whose a marker is.
fn subject(name: &str) -> &str {
    name.split(':').next().unwrap_or_default()
}

/// The heads of all sections: behind a blank line, or at the begin.
fn heads(source: &Source) -> Result<Vec<Head>, ReadError> {
    let mut lines = Lines::new(source)?;
    let (mut heads, mut blank) = (Vec::new(), true);
    while lines.advance()? {
        let is_first =
            std::mem::replace(&mut blank, lines.line().iter().all(|byte| matches!(byte, b',' | b' ' | b'\t')));
        let section = if is_first && !blank { cells(lines.line()) } else { continue };
        if section.len() != 1 {
            continue;
        }
        let mut head = Vec::new();
        while head.len() < 4 && !blank && lines.advance()? {
            head.push(cells(lines.line()));
            blank = head.last().is_some_and(Vec::is_empty);
        }
        let Ok([rate, names, axes, units]) = <[Vec<String>; 4]>::try_from(head) else { continue };
        if axes.first().is_some_and(|cell| cell == "Frame") {
            let [section, rate] = [section, rate].map(|cells| cells.into_iter().next().unwrap_or_default());
            heads.push(Head { section, rate, names, axes, units, first_line: lines.number() + 1 });
        }
    }
    if heads.is_empty() {
        return Err(Fault::Truncated("the lines that name the columns are missing".to_owned()).into());
    }
    Ok(heads)
}

impl Head {
    fn capture(&self) -> Result<Capture, Fault> {
        let rate = self.rate.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
        let rate = rate.ok_or_else(|| {
            let problem = format!("the rate of {} is {}", self.section, quoted(&self.rate));
            Fault::coded(
                "recording/frame-rate",
                problem,
                "export it again: the second line of a section says how many frames a second has",
            )
        })?;
        let is_objects = self.axes.iter().any(|axis| axis == "TX");
        let markers = self.markers(if is_objects { ["TX", "TY", "TZ"] } else { ["X", "Y", "Z"] });
        let metres = self.metres(&markers)?;
        let parts = markers.len();
        let vehicles = by_subject(markers)?;
        if vehicles.is_empty() {
            return refuse(
                "recording/no-positions",
                "it names no marker and no object",
                "export it again, with labelled trajectories",
            );
        }
        if is_objects && vehicles.len() < parts {
            let several = vehicles.iter().find(|(_, of)| of.len() > 1).map_or("", |(name, _)| name);
            let problem = format!("{} has several segments", quoted(several));
            return refuse(
                "recording/ambiguous-column",
                problem,
                "export objects of one segment each, or the trajectories of markers",
            );
        }
        let notes = note_of_markers(&vehicles).into_iter().collect();
        let when = When::Frames(rate);
        Ok(Capture { first_line: self.first_line, when, vehicles, metres, y_up: false, notes })
    }

    /// The columns of each name that has these axes.
    fn markers(&self, axes: [&str; 3]) -> Vec<(String, [usize; 3])> {
        let named: Vec<_> = (2..self.names.len()).filter(|&column| !self.names[column].is_empty()).collect();
        let ends = named.iter().skip(1).copied().chain([self.axes.len()]);
        let columns = |(&from, to): (&usize, usize)| {
            let of = |axis: &str| (from..to.min(self.axes.len())).find(|&column| self.axes[column] == axis);
            Some((self.names[from].clone(), [of(axes[0])?, of(axes[1])?, of(axes[2])?]))
        };
        named.iter().zip(ends).filter_map(columns).filter(|(name, _)| !name.starts_with('*')).collect()
    }

    /// The length of the unit that all columns of places have.
    fn metres(&self, markers: &[(String, [usize; 3])]) -> Result<f64, Fault> {
        let mut units = markers.iter().flat_map(|(_, columns)| columns).map(|&column| self.units.get(column));
        let first = units.next().flatten().map_or("", String::as_str);
        if let Some(other) = units.find(|unit| unit.map_or("", |unit| unit.as_str()) != first) {
            let problem =
                format!("some of its places are in {} and some in {}", quoted(first), quoted(other.map_or("", |u| u)));
            return refuse("recording/unit-conflict", problem, "export all in millimetres");
        }
        heading::size_of(first, false).ok_or_else(|| {
            Fault::coded(
                "recording/unknown-unit",
                format!("its unit of length is not known: {}", quoted(first)),
                "export it in millimetres",
            )
        })
    }
}
