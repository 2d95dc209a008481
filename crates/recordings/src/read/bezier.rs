//! Reads pieces of Bezier curves: one CSV file per vehicle, one row per piece.
//!
//! ```text
//! #duration,p0x,p0y,p0z,p1x,p1y,p1z,...
//! ```
//!
//! A piece starts at the end of the previous one. Its n + 1 control points give a curve of degree n over its duration.
//! Without z the recording is planar. A header may end with `...` after the first point; after `p0x,p0y,...` the points
//! are those of degree 7: 16 numbers in the plane, 24 in space.

use std::str;

use nalgebra::Vector3;

use super::cells::parse_number;
use super::curves::{Curve, Curves, HIGHEST_DEGREE, curves_of, note_of_starts, powers};
use super::error::{ContentKind, Fault, ReadError, UNSEEN, quoted, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{Lines, Source, VehicleFiles};
use tautline_core::track::Metadata;

/// Degree of the pieces if the header does not give the axes.
const USUAL_DEGREE: usize = 7;

const HEADER: &str = "write the header duration,p0x,p0y,p0z,p1x,..., with the axes of every point, or without z";

/// Opens the curves of these vehicles; the files of a vehicle are flown in sequence. `left_out` is the note on other
/// files.
pub(super) fn open(
    vehicles: VehicleFiles,
    left_out: Option<String>,
    options: &ReadOptions,
) -> Result<Recording, ReadError> {
    let mut is_planar = false;
    let append = |curve: &mut Curve, file: &Source| {
        is_planar |= append(curve, file)?;
        Ok(())
    };
    let (curves, mut notes) = curves_of(vehicles, left_out, options, append)?;
    notes.extend(note_of_starts(&curves));
    if is_planar {
        notes.push("points without z: the recording is judged in the plane of x and y".to_owned());
    }
    Ok(Curves::with_metadata(curves, Metadata { is_planar, ..Metadata::in_seconds(notes) }))
}

/// Returns whether the first line of a text is the header of a table of Bezier curves.
pub(super) fn has_header(text: &[u8]) -> bool {
    let line = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let Ok(line) = str::from_utf8(line) else { return false };
    let mut names = names(line);
    ["duration", "p0x", "p0y"].iter().all(|name| names.next().is_some_and(|found| found.eq_ignore_ascii_case(name)))
}

fn names(header: &str) -> impl Iterator<Item = &str> {
    header.trim().trim_start_matches('#').split(',').map(str::trim)
}

/// Adds the pieces of a file to a curve; returns whether its points have no z.
fn append(curve: &mut Curve, file: &Source) -> Result<bool, ReadError> {
    let mut lines = Lines::new(file)?;
    let (mut columns, mut pieces) = (None, 0_u64);
    while lines.advance()? {
        let place = lines.place();
        let line = str::from_utf8(lines.line()).map_err(|_| Fault::not_utf8().at(place.clone()))?.trim();
        let columns = match &mut columns {
            _ if line.is_empty() => continue,
            None => {
                columns = Some(Columns::of(line).map_err(|fault| fault.at(place))?);
                continue;
            }
            Some(_) if line.starts_with('#') => continue,
            Some(columns) => columns,
        };
        columns.append(curve, line).map_err(|fault| fault.at(place))?;
        pieces += 1;
    }
    match columns {
        None => Err(Fault::empty().into()),
        Some(_) if pieces == 0 => Err(Fault::header_only().into()),
        Some(columns) => Ok(columns.axes == Some(2)),
    }
}

/// Columns of a table: the duration, then the axes of each point.
struct Columns {
    /// Number of axes; `None` until the first row of a header that ends after y of the first point.
    axes: Option<usize>,
    /// Number of fields; `None` if the header ends with `...`.
    fields: Option<usize>,
}

impl Columns {
    fn of(header: &str) -> Result<Self, Fault> {
        if !has_header(header.as_bytes()) {
            let problem = format!("{} is not a header of Bezier curves", quoted(header));
            return refuse(ContentKind::NoHeader, problem, HEADER);
        }
        let mut found: Vec<_> = names(header).collect();
        found.pop_if(|name| name.is_empty());
        let is_short = found.pop_if(|name| matches!(*name, "..." | "…")).is_some();
        let axes = match found.get(3) {
            Some(name) if name.eq_ignore_ascii_case("p0z") => Some(3),
            None if is_short => None,
            _ => Some(2),
        };
        let of_axes = &["x", "y", "z"][..axes.unwrap_or(2)];
        let expected = (0..).flat_map(|point| of_axes.iter().map(move |axis| format!("p{point}{axis}")));
        if let Some((odd, expected)) = found[1..].iter().zip(expected).find(|(a, b)| !a.eq_ignore_ascii_case(b)) {
            let problem = format!("a column has the name {}, expected `{expected}`", quoted(odd));
            return refuse(ContentKind::MissingColumn, problem, HEADER);
        }
        if !is_short && (found.len() - 1) % of_axes.len() != 0 {
            let problem = format!("the last point has fewer than {} columns", of_axes.len());
            return refuse(ContentKind::MissingColumn, problem, HEADER);
        }
        Ok(Self { axes, fields: (!is_short).then_some(found.len()) })
    }

    fn append(&mut self, curve: &mut Curve, line: &str) -> Result<(), Fault> {
        let mut fields: Vec<_> = line.split(',').map(str::trim).collect();
        fields.pop_if(|field| field.is_empty());
        let numbers = fields.len().saturating_sub(1);
        if let Some(expected) = self.fields.filter(|expected| *expected != fields.len()) {
            let problem = format!("it has {} fields, expected {expected}", fields.len());
            return refuse(ContentKind::FieldCount, problem, "every line needs one field per column");
        }
        let axes = match self.axes {
            Some(axes) => axes,
            None => [2, 3].into_iter().find(|axes| axes * (USUAL_DEGREE + 1) == numbers).ok_or_else(|| {
                let problem = format!("the header does not give the axes of {numbers} numbers");
                Fault::content(ContentKind::AmbiguousLayout, problem, HEADER)
            })?,
        };
        self.axes = Some(axes);
        if numbers == 0 || !numbers.is_multiple_of(axes) {
            let problem = format!("it has {numbers} numbers after the duration, expected a multiple of {axes}");
            return refuse(ContentKind::FieldCount, problem, "every point needs all its axes");
        }
        if numbers / axes > HIGHEST_DEGREE + 1 {
            let problem =
                format!("the degree of the piece is {}, at most {HIGHEST_DEGREE} is supported", numbers / axes - 1);
            return refuse(ContentKind::Degree, problem, "use fewer control points");
        }
        let number = |(index, field): (usize, &&str)| {
            parse_number(index + 1, field, UNSEEN)?.ok_or_else(|| Fault::empty_cell(index + 1))
        };
        let values = fields.iter().enumerate().map(number).collect::<Result<Vec<_>, _>>()?;
        let point = |numbers: &[f64]| Vector3::new(numbers[0], numbers[1], numbers.get(2).copied().unwrap_or(0.0));
        let points: Vec<_> = values[1..].chunks_exact(axes).map(point).collect();
        curve.push(values[0], powers(&points, values[0]))
    }
}
