//! What the positions of a table are measured from: a place on the Earth.

use nalgebra::Vector3;

use super::cells::{Cells, number, vector};
use super::conventions::GLOBAL;
use super::earth::{Geodetic, Local, is_no_fix};
use super::error::{Fault, ReadError};
use super::layout::Layout;
use super::options::ReadOptions;
use super::rows::Row;
use super::turned;

/// The frame of places on the Earth, where a table gives such: where the user says, or at the first place of the table.
pub(super) fn origin<C: Cells>(
    cells: &mut C,
    layout: &Layout,
    options: &ReadOptions,
) -> Result<Option<Local>, ReadError> {
    let reference = layout.convention.reference;
    if !layout.on_earth && reference.is_none() {
        let needless = Fault::coded(
            "recording/unused-option",
            "it has no columns of latitude and longitude",
            "leave --origin away",
        );
        return if options.origin.is_some() { Err(needless.into()) } else { Ok(None) };
    }
    turned::refuse_known(options, "a table of latitudes and longitudes")?;
    cells.restart(&layout.columns(), true)?;
    let mut unfixed = false;
    while cells.advance()? {
        let place = match reference {
            Some(columns) => measured_from(cells, columns),
            None => fix(cells, layout, &mut unfixed),
        };
        let at_row = |fault: Fault| fault.at(C::place(cells.row()));
        if let Some(place) = place.map_err(at_row)? {
            return Ok(Some(Local::first(place, options).map_err(at_row)?));
        }
    }
    if reference.is_some() {
        let problem = "the place that its positions are measured from is not known in any row (`ref_lat`, `ref_lon`)";
        return Err(Fault::coded("recording/no-fix", problem, GLOBAL).into());
    }
    if unfixed {
        let problem = "no row has a fix: every latitude and longitude is exactly 0";
        return Err(Fault::coded(
            "recording/no-fix",
            problem,
            "record again once the receiver has a fix, or give another file",
        )
        .into());
    }
    Ok(None)
}

/// The place that the positions of a row are measured from; none where it is not known: empty, NaN, or where latitude and
/// longitude are 0.
fn measured_from(cells: &impl Cells, columns: [usize; 3]) -> Result<Option<Geodetic>, Fault> {
    let mut place = Vector3::zeros();
    for (slot, column) in place.iter_mut().zip(columns) {
        match cells.number(column) {
            Some(number) if number.is_nan() => return Ok(None),
            _ => match number(cells, column)? {
                Some(number) => *slot = number,
                None => return Ok(None),
            },
        }
    }
    Ok(Some(place).filter(|place| !is_no_fix(place)))
}

/// The first place on the Earth of a row; none where it has none. Sets `unfixed` where it has no fix.
fn fix(cells: &impl Cells, layout: &Layout, unfixed: &mut bool) -> Result<Option<Geodetic>, Fault> {
    for body in &layout.bodies {
        match vector(cells, &body.position, &layout.metres)? {
            Some(place) if is_no_fix(&place) => *unfixed = true,
            None => {}
            place => return Ok(place),
        }
    }
    Ok(None)
}

/// Brings a position that is measured from a place in some columns into the frame `local`; `false` where it is not known, as
/// other columns may say by a 0. The frame of the place is kept in `there`.
pub(super) fn bring(
    cells: &impl Cells,
    row: &mut Row,
    (columns, valid): ([usize; 3], &[usize]),
    local: Option<Local>,
    there: &mut Option<Local>,
) -> Result<bool, Fault> {
    for &column in valid {
        if matches!(cells.text(column)?.trim(), "0" | "0.0" | "false" | "False") {
            return Ok(false);
        }
    }
    let (Some(place), Some(local)) = (measured_from(cells, columns)?, local) else { return Ok(false) };
    let there = match there.filter(|there| there.is_at(place)) {
        Some(there) => there,
        None => *there.insert(Local::at(place)?),
    };
    row.position = local.place_from(&there, row.position);
    row.velocity = row.velocity.map(|velocity| local.turn_from(&there, velocity));
    Ok(true)
}
