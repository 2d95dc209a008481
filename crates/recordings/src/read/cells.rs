//! Access to the cells of a table, as numbers, times and names.

use std::borrow::Cow;
use std::{fmt, str};

use nalgebra::Vector3;

use super::clock::Stamp;
use super::error::{ContentKind, Fault, Place, ReadError, UNSEEN, quoted, refuse};

/// Access to the cells of the current row of a table.
pub(super) trait Cells {
    /// Returns the names of the columns.
    fn header(&self) -> &[String];

    /// Moves before the first row. Only these columns are requested afterwards, in ascending order. Unless `all`
    /// required columns are among them, other cells are not checked.
    fn restart(&mut self, columns: &[usize], all: bool) -> Result<(), ReadError>;

    /// Moves to the next row; returns `false` after the last one.
    fn advance(&mut self) -> Result<bool, ReadError>;

    /// Returns the number of the current row.
    fn row(&self) -> u64;

    /// Returns the place of the row with this number.
    fn place(&self, row: u64) -> Place;

    /// Returns a fault in the current row.
    fn fault(&self, fault: Fault) -> ReadError {
        fault.at(self.place(self.row()))
    }

    /// Returns a cell as written; an empty string for an empty cell.
    fn text(&self, column: usize) -> Result<Cow<'_, str>, Fault>;

    /// Returns the number in a cell of plain numeric form.
    fn number(&self, column: usize) -> Option<f64>;

    /// Returns the time in a cell of plain numeric form.
    fn stamp(&mut self, column: usize) -> Option<Stamp>;

    /// Returns a cell as the name of a vehicle; an empty string for an empty cell.
    fn name(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        self.text(column)
    }

    /// Returns whether a cell is written exactly as this name; `false` if that is not known without parsing it.
    fn has_name(&self, _column: usize, _name: &str) -> bool {
        false
    }
}

/// Cell of a file whose cells have types.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum Cell<T = String> {
    #[default]
    Empty,
    /// Wide enough for signed and unsigned integers of 64 bits.
    Whole(i128),
    Real(f64),
    Text(T),
}

impl<T: AsRef<[u8]>> Cell<T> {
    /// Returns the cell as text; an empty string for an empty cell.
    pub(super) fn text(&self) -> Result<Cow<'_, str>, Fault> {
        Ok(match self {
            Self::Empty => "".into(),
            Self::Whole(whole) => whole.to_string().into(),
            Self::Real(real) => format!("{real:?}").into(),
            Self::Text(text) => str::from_utf8(text.as_ref()).map_err(|_| Fault::not_utf8())?.into(),
        })
    }

    /// Returns the number in a cell, which may be written as text; `None` for an integer that would be rounded.
    #[expect(clippy::cast_possible_truncation, reason = "a number of at most 2^64")]
    pub(super) fn number(&self) -> Option<f64> {
        match self {
            Self::Empty => None,
            Self::Whole(whole) => Some(*whole as f64).filter(|number| *number as i128 == *whole),
            Self::Real(real) => Some(*real),
            Self::Text(text) => str::from_utf8(text.as_ref()).ok()?.trim().parse().ok(),
        }
    }

    /// Returns the time in a cell, which may be written as text.
    pub(super) fn stamp(&self) -> Option<Stamp> {
        match self {
            Self::Empty => None,
            Self::Whole(whole) => Some(i64::try_from(*whole).map_or(Stamp::Real(*whole as f64), Stamp::Whole)),
            Self::Real(real) => Some(Stamp::Real(*real)),
            Self::Text(text) => Stamp::parse(str::from_utf8(text.as_ref()).ok()?.trim()),
        }
    }
}

/// Returns the finite number in a cell; `None` for an empty cell.
#[inline]
pub(super) fn number(cells: &impl Cells, column: usize) -> Result<Option<f64>, Fault> {
    match cells.number(column) {
        Some(number) if number.is_finite() => Ok(Some(number)),
        _ => odd_number(cells, column, UNSEEN),
    }
}

/// Parses a cell without a plain finite number; `unseen` is the remedy for a number that is not finite.
#[cold]
pub(super) fn odd_number(cells: &impl Cells, column: usize, unseen: &str) -> Result<Option<f64>, Fault> {
    parse_number(&cells.header()[column], cells.text(column)?.trim(), unseen)
}

/// Parses the finite number of a column; `None` for an empty text. `unseen` is the remedy for a number that is not
/// finite.
pub(super) fn parse_number(column: impl fmt::Display, text: &str, unseen: &str) -> Result<Option<f64>, Fault> {
    let holds = |kind, what: &str, remedy| {
        let problem = format!("column `{column}` holds {}, {what}", quoted(text));
        refuse(kind, problem, remedy)
    };
    match text.parse::<f64>() {
        _ if text.is_empty() => Ok(None),
        Ok(_) if is_rounded(text) => {
            holds(ContentKind::Overflow, "an integer beyond 2^53 that would be rounded", "subtract an offset first")
        }
        Ok(number) if number.is_finite() => Ok(Some(number)),
        Ok(_) => Err(Fault::not_finite(column, text, unseen)),
        Err(_) if text.replacen(',', ".", 1).parse::<f64>().is_ok() => {
            holds(ContentKind::DecimalComma, "a number with a decimal comma", "write numbers with a decimal point")
        }
        Err(_) => holds(ContentKind::NotANumber, "which is not a number", "write a number with a decimal point"),
    }
}

/// Returns whether a text is an integer that a number of 64 bits rounds.
#[expect(clippy::cast_possible_truncation, reason = "a larger number is not equal")]
fn is_rounded(text: &str) -> bool {
    text.parse::<i128>().is_ok_and(|whole| whole as f64 as i128 != whole)
}

/// Returns three numbers; `None` if all cells are empty.
#[inline]
pub(super) fn vector(
    cells: &impl Cells,
    columns: &[Option<usize>; 3],
    metres: &[f64],
) -> Result<Option<Vector3<f64>>, Fault> {
    if let [Some(x), Some(y), Some(z)] = *columns
        && let [Some(along_x), Some(along_y), Some(along_z)] = [x, y, z].map(|column| cells.number(column))
        && (along_x + along_y + along_z).is_finite()
    {
        return Ok(Some(Vector3::new(along_x * metres[x], along_y * metres[y], along_z * metres[z])));
    }
    let mut vector = Vector3::zeros();
    let (mut filled, mut missing) = (false, None);
    for (axis, column) in columns.iter().enumerate() {
        let Some(column) = *column else { continue };
        match number(cells, column)? {
            Some(x) => (vector[axis], filled) = (x * metres[column], true),
            None => missing = missing.or(Some(column)),
        }
    }
    match missing {
        None => Ok(Some(vector)),
        Some(_) if !filled => Ok(None),
        Some(column) => Err(Fault::empty_coordinate(&cells.header()[column])),
    }
}
