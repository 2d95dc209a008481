//! Crazyflie polynomials: a CSV a vehicle, a row a piece of its curve.
//!
//! ```text
//! duration,x^0,x^1,...,x^7,y^0,...,y^7,z^0,...,z^7,yaw^0,...,yaw^7
//! ```
//!
//! A piece begins where the one before it ends, and its coefficients are of the time since its own begin. A folder
//! holds a file for each vehicle, or a folder for each vehicle whose files follow each other. Files come in the order of
//! the numbers in their names.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::curves::{Curves, piece};
use super::error::{Fault, FaultAt, Place};
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{Lines, Source};
use crate::track::Item;

/// Highest power that is read.
const HIGHEST_POWER: usize = 15;

/// Opens a folder of polynomials, or the file of a single vehicle.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Recording, FaultAt> {
    let mut notes = Vec::new();
    let mut vehicles = Vec::new();
    for (name, files) in vehicles_of(path)? {
        let mut curve = Curve { vehicle: vehicles.len(), time_s: 0.0, scale: options.scale, items: Vec::new() };
        for file in &files {
            curve.append(file).map_err(|fault| fault.in_file(file))?;
        }
        if files.len() > 1 && notes.is_empty() {
            notes.push(format!("`{name}` and others fly the files of their folders one after the other"));
        }
        vehicles.push((name, curve.items));
    }
    Ok(Curves::recording(vehicles, notes))
}

/// Names and files of the vehicles, in order.
fn vehicles_of(path: &Path) -> Result<Vec<(String, Vec<PathBuf>)>, FaultAt> {
    if path.is_file() {
        return Ok(vec![(stem(path), vec![path.to_owned()])]);
    }
    let (files, folders) = entries(path)?;
    if !files.is_empty() {
        return Ok(files.into_iter().map(|file| (stem(&file), vec![file])).collect());
    }
    let mut vehicles = Vec::new();
    for folder in folders {
        let (files, _) = entries(&folder)?;
        if !files.is_empty() {
            vehicles.push((stem(&folder), files));
        }
    }
    if vehicles.is_empty() {
        let remedy = "give a folder with a polynomial file (.csv) for each vehicle, or one with a folder for each";
        return Err(Fault::content("there is no .csv file in the folder", remedy).into());
    }
    Ok(vehicles)
}

/// CSV files and folders of a folder, each in natural order.
fn entries(folder: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>), FaultAt> {
    let error = |source| FaultAt::from(Fault::System(source)).in_file(folder);
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        if path.is_dir() {
            folders.push(path);
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
            files.push(path);
        }
    }
    files.sort_by_cached_key(|path| natural(&stem(path)));
    folders.sort_by_cached_key(|path| natural(&stem(path)));
    Ok((files, folders))
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// A key that puts `cf9` before `cf10`: text and numbers in turn.
fn natural(name: &str) -> Vec<(String, u64)> {
    let mut key = vec![(String::new(), 0_u64)];
    let mut in_number = false;
    for c in name.chars() {
        if c.is_ascii_digit() != in_number {
            in_number = !in_number;
            if !in_number {
                key.push((String::new(), 0));
            }
        }
        if let Some((text, number)) = key.last_mut() {
            match c.to_digit(10) {
                Some(digit) => *number = number.saturating_mul(10).saturating_add(digit.into()),
                None => text.push(c),
            }
        }
    }
    key
}

/// Columns of the powers of x, y and z.
struct Columns {
    count: usize,
    duration: usize,
    /// Column of each power and axis.
    powers: Vec<[usize; 3]>,
    names: Vec<String>,
}

impl Columns {
    fn of(header: &str) -> Result<Self, Fault> {
        let names: Vec<String> = header.split(',').map(|name| name.trim().trim_matches('"').to_lowercase()).collect();
        let missing = |role: &str| {
            let problem = format!("there is no column `{role}`");
            Fault::content(problem, "the header of a polynomial file is duration,x^0,...,x^7,y^0,...,z^0,...")
        };
        let duration = names.iter().position(|name| name == "duration").ok_or_else(|| missing("duration"))?;
        let mut powers: Vec<[Option<usize>; 3]> = Vec::new();
        for (column, name) in names.iter().enumerate() {
            let Some((axis, power)) = name.split_once('^') else { continue };
            let Some(axis) = ["x", "y", "z"].iter().position(|known| *known == axis) else { continue };
            let power = power.parse::<usize>().ok().filter(|&power| power <= HIGHEST_POWER).ok_or_else(|| {
                let problem = format!("column `{name}` is of a power that is not a number up to {HIGHEST_POWER}");
                Fault::content(problem, "pieces of Crazyflie trajectories are of degree 7")
            })?;
            if power >= powers.len() {
                powers.resize(power + 1, [None; 3]);
            }
            powers[power][axis] = Some(column);
        }
        let mut whole = Vec::new();
        for (power, columns) in powers.iter().enumerate() {
            let [x, y, z] = *columns;
            let column = |axis: &str, column: Option<usize>| column.ok_or_else(|| missing(&format!("{axis}^{power}")));
            whole.push([column("x", x)?, column("y", y)?, column("z", z)?]);
        }
        if whole.is_empty() {
            return Err(missing("x^0"));
        }
        let count = names.len() - usize::from(names.last().is_some_and(String::is_empty));
        Ok(Self { count, duration, powers: whole, names })
    }
}

/// The curve of a vehicle as far as it has been read.
struct Curve {
    vehicle: usize,
    /// Where the next piece begins \[s\].
    time_s: f64,
    scale: f64,
    items: Vec<Item>,
}

impl Curve {
    fn append(&mut self, path: &Path) -> Result<(), FaultAt> {
        let mut lines = Lines::new(&Source { path: path.to_owned(), gzip: false })?;
        let mut columns = None;
        let before = self.items.len();
        while lines.advance()? {
            let at = |fault: Fault| fault.at(Place::Line(lines.number()));
            let line = std::str::from_utf8(lines.line()).map_err(|_| at(Fault::NotUtf8))?;
            match &columns {
                _ if line.trim().is_empty() || line.starts_with('#') => {}
                None => columns = Some(Columns::of(line).map_err(at)?),
                Some(columns) => self.piece(line, columns).map_err(at)?,
            }
        }
        if self.items.len() == before {
            return Err(if columns.is_some() { Fault::HeaderOnly } else { Fault::Empty }.into());
        }
        Ok(())
    }

    fn piece(&mut self, line: &str, columns: &Columns) -> Result<(), Fault> {
        let mut cells: Vec<_> = line.split(',').map(str::trim).collect();
        if cells.len() == columns.count + 1 && cells.last().is_some_and(|cell| cell.is_empty()) {
            cells.pop();
        }
        if cells.len() != columns.count {
            return Err(Fault::FieldCount { expected: columns.count, found: cells.len(), commas: true });
        }
        let number = |column: usize| {
            let (name, value) = (columns.names[column].clone(), cells[column].to_owned());
            match value.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(number),
                Ok(_) => Err(Fault::NotFinite { column: name, value }),
                Err(_) if value.is_empty() => Err(Fault::EmptyCell { column: name }),
                Err(_) => Err(Fault::NotANumber { column: name, value }),
            }
        };
        let duration_s = number(columns.duration)?;
        let to_s = self.time_s + duration_s;
        if duration_s <= 0.0 || to_s <= self.time_s {
            let problem = format!("the piece lasts {duration_s} s");
            return Err(Fault::content(problem, "take pieces without a duration out"));
        }
        let mut coefficients = Vec::with_capacity(columns.powers.len());
        for &[x, y, z] in &columns.powers {
            coefficients.push(Vector3::new(number(x)?, number(y)?, number(z)?));
        }
        let piece = piece(self.vehicle, self.time_s, to_s, coefficients, self.scale).ok_or_else(out_of_range)?;
        self.items.push(Item::Piece(piece));
        self.time_s = to_s;
        Ok(())
    }
}

fn out_of_range() -> Fault {
    Fault::content("its numbers leave the range of numbers", "look at --scale and at the numbers themselves")
}

#[cfg(test)]
mod tests {
    use super::natural;

    #[test]
    fn names_are_ordered_by_their_numbers() {
        let mut names = ["cf10", "cf9", "a2_10", "a2_9", "cf1"];
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, ["a2_9", "a2_10", "cf1", "cf9", "cf10"]);
    }
}
