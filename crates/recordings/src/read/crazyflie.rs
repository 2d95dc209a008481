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
use super::curves::{Curve, Curves, HIGHEST_DEGREE, curves_of, note_of_starts};
use super::error::{ContentKind, Fault, ReadError};
use super::format::Format;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{Source, VehicleFiles};

/// Opens the polynomials of these vehicles; the files of a vehicle are flown in sequence. `left_out` is the note on
/// other files.
pub(super) fn open(
    vehicles: VehicleFiles,
    left_out: Option<String>,
    options: &ReadOptions,
) -> Result<Recording, ReadError> {
    let (curves, mut notes) = curves_of(vehicles, left_out, options, append)?;
    notes.extend(note_of_starts(&curves));
    Ok(Curves::recording(curves, notes))
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

/// Adds the pieces of a file to a curve.
fn append(curve: &mut Curve, file: &Source) -> Result<(), ReadError> {
    let mut table = TextTable::open(file, Format::CRAZYFLIE)?;
    let columns = Columns::of(table.header()).map_err(|fault| table.fault(fault))?;
    let before = curve.items.len();
    while table.advance()? {
        piece(curve, &table, &columns).map_err(|fault| table.fault(fault))?;
    }
    if curve.items.len() == before { Err(Fault::header_only().into()) } else { Ok(()) }
}

/// Adds the piece of the current row to a curve.
fn piece(curve: &mut Curve, table: &TextTable, columns: &Columns) -> Result<(), Fault> {
    let number = |column: usize| number(table, column)?.ok_or_else(|| Fault::empty_cell(&table.header()[column]));
    let duration_s = number(columns.duration)?;
    let mut coefficients = Vec::with_capacity(columns.powers.len());
    for &[x, y, z] in &columns.powers {
        coefficients.push(Vector3::new(number(x)?, number(y)?, number(z)?));
    }
    curve.push(duration_s, coefficients)
}
