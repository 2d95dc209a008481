//! Reads Crazyflie polynomials: one CSV file per vehicle, one row per piece of its curve.
//!
//! ```text
//! duration,x^0,x^1,...,x^7,y^0,...,y^7,z^0,...,z^7,yaw^0,...,yaw^7
//! ```
//!
//! A piece starts at the end of the previous one; its coefficients apply to the time since its own start. A folder
//! holds one file per vehicle, or one folder per vehicle whose files are flown in sequence. Files are sorted by the
//! numbers in their names.

use nalgebra::Vector3;

use super::cells::{Cells as _, number};
use super::csv::TextTable;
use super::curves::{Curves, HIGHEST_DEGREE, VehicleItems, piece};
use super::error::{ContentKind, Fault, ReadError, quoted, refuse};
use super::format::Format;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::Source;
use tautline_core::option::START;
use tautline_core::track::Item;

/// Opens the polynomials of these vehicles; the files of a vehicle are flown in sequence. `left_out` is the note on
/// other files.
pub(super) fn open(
    vehicles: Vec<(String, Vec<Source>)>,
    left_out: Option<String>,
    options: &ReadOptions,
) -> Result<Recording, ReadError> {
    let append = |curve: &mut Curve, file: &Source| curve.append(file);
    let (curves, notes) = curves_of(vehicles, left_out, options, append)?;
    Ok(Curves::recording(curves, notes))
}

/// Reads the curves of these vehicles with notes; `append` adds the pieces of a file to the curve of its vehicle.
pub(super) fn curves_of(
    vehicles: Vec<(String, Vec<Source>)>,
    left_out: Option<String>,
    options: &ReadOptions,
    mut append: impl FnMut(&mut Curve, &Source) -> Result<(), ReadError>,
) -> Result<(VehicleItems, Vec<String>), ReadError> {
    let mut notes: Vec<String> = left_out.into_iter().collect();
    let (several, mut has_sequence_note) = (vehicles.len() > 1, false);
    let mut curves = VehicleItems::new();
    if let Some(name) = options.starts.keys().find(|name| vehicles.iter().all(|(known, _)| known != *name)) {
        let problem = format!("{START} names the unknown vehicle {}", quoted(name));
        return refuse(ContentKind::UnknownVehicle, problem, "use the names of the files without their extension");
    }
    for (name, files) in vehicles {
        let mut curve = Curve { vehicle: curves.len(), time_s: 0.0, scale: options.metres(), items: Vec::new() };
        for file in &files {
            let appended = append(&mut curve, file).map_err(|fault| fault.of(&file.display_path()));
            appended.map_err(|fault| if several { fault.among_others() } else { fault })?;
        }
        if files.len() > 1 && !has_sequence_note {
            notes.push(format!("`{name}` and others fly the files of their folders in sequence"));
            has_sequence_note = true;
        }
        let start = options.starts.get(&name).copied().unwrap_or_default();
        for item in &mut curve.items {
            if let Item::Piece(piece) = item {
                piece.coefficients[0] += Vector3::from(start);
            }
        }
        curves.push((name, curve.items));
    }
    let first = |items: &[Item]| match items {
        [Item::Piece(piece), ..] => Some(piece.coefficients[0]),
        _ => None,
    };
    if curves.windows(2).any(|pair| first(&pair[0].1) == first(&pair[1].1)) {
        let start = START.set("NAME=X,Y,Z");
        notes.push(format!("curves start at one position: if they are relative, set each origin with {start}"));
    }
    Ok((curves, notes))
}

/// Columns of the duration, and of x, y and z for each power.
struct Columns {
    duration: usize,
    powers: Vec<[usize; 3]>,
}

impl Columns {
    fn of(header: &[String]) -> Result<Self, Fault> {
        let column = |name: &str| {
            let found = header.iter().position(|known| known.eq_ignore_ascii_case(name));
            found.ok_or_else(|| {
                let remedy = "the header of a polynomial file is duration,x^0,...,x^7,y^0,...,z^0,...";
                Fault::content(ContentKind::MissingColumn, format!("no column has the name `{name}`"), remedy)
            })
        };
        let mut highest = 0;
        for name in header {
            let Some(("x" | "y" | "z" | "X" | "Y" | "Z", power)) = name.split_once('^') else { continue };
            let power = power.parse::<usize>().ok().filter(|&power| power <= HIGHEST_DEGREE).ok_or_else(|| {
                let problem = format!("the power of column `{name}` is not a number up to {HIGHEST_DEGREE}");
                Fault::content(ContentKind::Degree, problem, "use pieces of degree 7, as Crazyflie trajectories have")
            })?;
            highest = highest.max(power);
        }
        let power = |power| {
            Ok([column(&format!("x^{power}"))?, column(&format!("y^{power}"))?, column(&format!("z^{power}"))?])
        };
        Ok(Self { duration: column("duration")?, powers: (0..=highest).map(power).collect::<Result<_, Fault>>()? })
    }
}

/// Curve of a vehicle, as read so far.
pub(super) struct Curve {
    vehicle: usize,
    /// Start of the next piece \[s\].
    time_s: f64,
    scale: f64,
    items: Vec<Item>,
}

impl Curve {
    fn append(&mut self, file: &Source) -> Result<(), ReadError> {
        let mut table = TextTable::open(file, Format::CRAZYFLIE)?;
        let columns = Columns::of(table.header()).map_err(|fault| table.fault(fault))?;
        let before = self.items.len();
        while table.advance()? {
            self.piece(&table, &columns).map_err(|fault| table.fault(fault))?;
        }
        if self.items.len() == before { Err(Fault::header_only().into()) } else { Ok(()) }
    }

    fn piece(&mut self, table: &TextTable, columns: &Columns) -> Result<(), Fault> {
        let number = |column: usize| number(table, column)?.ok_or_else(|| Fault::empty_cell(&table.header()[column]));
        let duration_s = number(columns.duration)?;
        let mut coefficients = Vec::with_capacity(columns.powers.len());
        for &[x, y, z] in &columns.powers {
            coefficients.push(Vector3::new(number(x)?, number(y)?, number(z)?));
        }
        self.push(duration_s, coefficients)
    }

    /// Adds a piece of this duration \[s\] with these coefficients of the powers of time.
    pub(super) fn push(&mut self, duration_s: f64, coefficients: Vec<Vector3<f64>>) -> Result<(), Fault> {
        let to_s = self.time_s + duration_s;
        // A duration that is not a number compares false.
        if !(duration_s > 0.0 && to_s > self.time_s) {
            let problem = format!("the duration of the piece must be positive, got {duration_s} s");
            return refuse(ContentKind::Duration, problem, "remove the piece");
        }
        let piece = piece(self.vehicle, self.time_s, to_s, coefficients, self.scale);
        self.items.push(Item::Piece(piece.ok_or_else(Fault::out_of_range)?));
        self.time_s = to_s;
        Ok(())
    }
}
