//! Files of points: the slots of a formation, and a motion as places in time.

use std::path::Path;

use super::columns::Columns;
use super::error::ScenarioError;
use super::files::KEY;
use super::values::Point;

const SLOTS: Columns = Columns {
    key: KEY,
    names: &[&["x"], &["y"], &["z"]],
    needed: 2,
    row: "a slot has x, y and perhaps z",
    help: "a line has the coordinates of a slot in m, such as 1.5,2.0 or 1.5,2.0,3.0; a first line may name the columns x, y, z",
};

const PLACES: Columns = Columns {
    key: "reference.file",
    names: &[&["t", "time"], &["x"], &["y"], &["z"]],
    needed: 3,
    row: "a place in time has t, x, y and perhaps z",
    help: "a line has a time in s, later than that of the line before, and the place there in m, such as 0.5,1.0,2.0 or \
           0.5,1.0,2.0,3.0; a first line may name the columns t, x, y, z",
};

/// The slots in a file of columns x, y and perhaps z in m.
pub(super) fn slots(path: &Path) -> Result<Vec<Point>, ScenarioError> {
    Ok(SLOTS.read(path)?.iter().map(|(_, coordinates)| point(coordinates)).collect())
}

/// When a motion is where \[s\] \[m\], at least twice: a file of columns t, x, y and perhaps z, whose times grow.
pub(super) fn places(path: &Path) -> Result<(Vec<f64>, Vec<Point>), ScenarioError> {
    let rows = PLACES.read(path)?;
    let mut before_s = f64::NEG_INFINITY;
    for (line, numbers) in &rows {
        let refused = |said: &str| Err(PLACES.refused(path, *line, said));
        if numbers[0] <= before_s {
            return refused(&format!("the time {} s is not after {before_s} s", numbers[0]));
        }
        before_s = numbers[0];
    }
    if let [(line, _)] = &rows[..] {
        return Err(PLACES.refused(path, *line, "there is one point, and a motion has at least two"));
    }
    Ok(rows.iter().map(|(_, numbers)| (numbers[0], point(&numbers[1..]))).unzip())
}

fn point(coordinates: &[f64]) -> Point {
    match *coordinates {
        [x, y, z, ..] => Point::Space([x, y, z]),
        _ => Point::Plane([coordinates[0], coordinates[1]]),
    }
}
