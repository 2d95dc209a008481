//! Local frame of a table with places on the Earth.

use nalgebra::Vector3;

use super::cells::{Cells, number, vector};
use super::convention;
use super::convention::GLOBAL;
use super::earth::{EarthFrame, Geodetic, is_no_fix};
use super::error::{ContentKind, Fault, ReadError, refuse};
use super::layout::Layout;
use super::options::ReadOptions;
use super::order::Row;
use tautline_core::option::ORIGIN;

/// Returns the frame of a table with places on the Earth: of the user's origin, or of the first place of the table.
pub(super) fn origin(
    cells: &mut impl Cells,
    layout: &Layout,
    options: &ReadOptions,
) -> Result<Option<EarthFrame>, ReadError> {
    let reference = layout.convention.reference;
    if !layout.on_earth && reference.is_none() {
        let needless = Fault::content(
            ContentKind::UnusedOption,
            "it has no columns of latitude and longitude",
            format!("omit {ORIGIN}"),
        );
        return if options.origin.is_some() { Err(needless.into()) } else { Ok(None) };
    }
    convention::refuse_known(options, "a table of latitudes and longitudes")?;
    cells.restart(&layout.columns(), true)?;
    let mut unfixed = false;
    while cells.advance()? {
        let place = match reference {
            Some(columns) => measured_from(cells, columns),
            None => fix(cells, layout, &mut unfixed),
        };
        let at_row = |fault| cells.fault(fault);
        if let Some(place) = place.map_err(at_row)? {
            return Ok(Some(EarthFrame::first(place, options).map_err(at_row)?));
        }
    }
    if reference.is_some() {
        let problem = "no row has the origin of its positions (`ref_lat`, `ref_lon`)";
        return refuse(ContentKind::NoFix, problem, GLOBAL);
    }
    if unfixed {
        let problem = "no row has a fix: all latitudes and longitudes are exactly 0";
        return refuse(ContentKind::NoFix, problem, "record again with a fix, or give another file");
    }
    Ok(None)
}

/// Returns the origin of the positions in a row; `None` if a cell is empty or NaN, or latitude and longitude are 0.
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

/// Returns the first place on the Earth in a row, if there is one. Sets `unfixed` for a place without a fix.
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

/// Converts a position with an origin in its row to the frame `local`; returns `false` if the origin is unknown or a
/// validity column is 0. `row_frame` caches the frame of the origin.
pub(super) fn convert_to_local(
    cells: &impl Cells,
    row: &mut Row,
    (columns, valid): ([usize; 3], &[usize]),
    local: Option<EarthFrame>,
    row_frame: &mut Option<EarthFrame>,
) -> Result<bool, Fault> {
    for &column in valid {
        if matches!(cells.text(column)?.trim(), "0" | "0.0" | "false" | "False") {
            return Ok(false);
        }
    }
    let (Some(place), Some(local)) = (measured_from(cells, columns)?, local) else { return Ok(false) };
    let row_frame = match row_frame.filter(|row_frame| row_frame.is_at(place)) {
        Some(row_frame) => row_frame,
        None => *row_frame.insert(EarthFrame::at(place)?),
    };
    row.position = local.position_from(&row_frame, row.position);
    row.velocity = row.velocity.map(|velocity| local.direction_from(&row_frame, velocity));
    Ok(true)
}
