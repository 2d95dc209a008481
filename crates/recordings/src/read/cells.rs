//! The cells of a row of a table, whatever they are written as.

use std::borrow::Cow;

use nalgebra::Vector3;

use super::clock::Stamp;
use super::error::{Fault, Place, ReadError, UNSEEN, quoted};

/// The cells of the current row of a table.
pub(super) trait Cells {
    /// Names of the columns.
    fn header(&self) -> &[String];

    /// Goes before the first row. Of each row these columns are asked, in rising order; where not `all` that a table
    /// needs are among them, no more is looked at.
    fn restart(&mut self, columns: &[usize], all: bool) -> Result<(), ReadError>;

    /// Goes to the next row; `false` behind the last one.
    fn advance(&mut self) -> Result<bool, ReadError>;

    /// Number of the current row.
    fn row(&self) -> u64;

    /// Where a row of this number is.
    fn place(row: u64) -> Place;

    /// A cell as it is written; nothing where it is empty.
    fn text(&self, column: usize) -> Result<Cow<'_, str>, Fault>;

    /// The number in a cell that plainly holds one.
    fn number(&self, column: usize) -> Option<f64>;

    /// The time in a cell that plainly holds one.
    fn stamp(&mut self, column: usize) -> Option<Stamp>;

    /// A cell as the name of a vehicle; nothing where it is empty.
    fn name(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        self.text(column)
    }
}

/// The fault of an empty cell.
pub(super) fn empty(cells: &impl Cells, column: usize) -> Fault {
    Fault::empty_cell(&cells.header()[column])
}

/// The finite number in a cell; none where it is empty.
#[inline]
pub(super) fn number(cells: &impl Cells, column: usize) -> Result<Option<f64>, Fault> {
    match cells.number(column) {
        Some(number) if number.is_finite() => Ok(Some(number)),
        _ => odd_number(cells, column, UNSEEN),
    }
}

/// The number in a cell that does not plainly hold a finite one; `unseen` helps where it is not finite.
#[cold]
pub(super) fn odd_number(cells: &impl Cells, column: usize, unseen: &str) -> Result<Option<f64>, Fault> {
    let (text, column) = (cells.text(column)?, &cells.header()[column]);
    let text = text.trim();
    let holds = |code, what: &str, remedy| {
        let problem = format!("column `{column}` holds {}, {what}", quoted(text));
        Err(Fault::coded(code, problem, remedy))
    };
    match text.parse::<f64>() {
        _ if text.is_empty() => Ok(None),
        Ok(number) if number.is_finite() => Ok(Some(number)),
        Ok(_) => Err(Fault::not_finite(column, text, unseen)),
        Err(_) if text.replacen(',', ".", 1).parse::<f64>().is_ok() => {
            holds("recording/decimal-comma", "a number with a decimal comma", "write numbers with a decimal point")
        }
        Err(_) => holds("recording/not-a-number", "which is not a number", "write a number with a decimal point"),
    }
}

/// Three numbers, none where all cells are empty.
#[inline]
pub(super) fn vector(
    cells: &impl Cells,
    columns: &[Option<usize>; 3],
    metres: &[f64],
) -> Result<Option<Vector3<f64>>, Fault> {
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
        Some(column) => Err(empty(cells, column)),
    }
}
