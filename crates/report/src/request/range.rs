//! Ranges of the numbers of a request.

use std::fmt::Display;
use std::ops::RangeInclusive;

use super::Failure;

/// Refuses a number that is out of its range; `option` names it, such as `--runs`.
///
/// # Errors
/// [`Failure`] with the code `request/out-of-range`.
pub fn in_range<T: PartialOrd + Display>(option: &str, value: &T, range: &RangeInclusive<T>) -> Result<(), Failure> {
    if range.contains(value) {
        return Ok(());
    }
    let (least, most) = (range.start(), range.end());
    let message = format!("{option}: {value} is not in {least}..={most}");
    Err(Failure::input("request/out-of-range", message, "give a number in this range"))
}
