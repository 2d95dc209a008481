//! Crazyflie polynomials: a CSV a vehicle, a row a piece of its curve.
//!
//! ```text
//! duration,x^0,x^1,...,x^7,y^0,...,y^7,z^0,...,z^7,yaw^0,...,yaw^7
//! ```
//!
//! A piece begins where the one before it ends, and its coefficients are of the time since its own begin. A folder
//! holds a file for each vehicle, or a folder for each vehicle whose files follow each other. Files come in the order of
//! the numbers in their names.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::csv::Text;
use super::curves::{Curves, piece};
use super::error::{Fault, ReadError};
use super::format::Format;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::Source;
use super::table::{Cells as _, number};
use crate::track::Item;

/// Highest power that is read.
const HIGHEST_POWER: usize = 15;

/// Longest number in a file's name that is put in order by its value \[digits\].
const LONGEST_NUMBER: usize = 20;

/// Opens a folder of polynomials, or the file of a single vehicle.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Recording, ReadError> {
    let mut notes = Vec::new();
    let mut vehicles = Vec::new();
    for (name, files) in vehicles_of(path)? {
        let mut curve = Curve { vehicle: vehicles.len(), time_s: 0.0, scale: options.scale, items: Vec::new() };
        for file in &files {
            curve.append(file).map_err(|fault| fault.of(file))?;
        }
        if files.len() > 1 && notes.is_empty() {
            notes.push(format!("`{name}` and others fly the files of their folders one after the other"));
        }
        vehicles.push((name, curve.items));
    }
    Ok(Curves::recording(vehicles, notes))
}

/// Names and files of the vehicles, in order.
fn vehicles_of(path: &Path) -> Result<Vec<(String, Vec<PathBuf>)>, ReadError> {
    if path.is_file() {
        return Ok(vec![(stem(path), vec![path.to_owned()])]);
    }
    let (files, folders) = entries(path)?;
    if !files.is_empty() {
        return Ok(files.into_iter().map(|file| (stem(&file), vec![file])).collect());
    }
    let mut vehicles = Vec::new();
    for folder in folders {
        vehicles.push((stem(&folder), entries(&folder)?.0));
    }
    vehicles.retain(|(_, files)| !files.is_empty());
    if vehicles.is_empty() {
        let remedy = "give a folder with a polynomial file (.csv) for each vehicle, or one with a folder for each";
        return Err(Fault::content("there is no .csv file in the folder", remedy).into());
    }
    Ok(vehicles)
}

/// CSV files and folders of a folder, each in natural order.
fn entries(folder: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>), ReadError> {
    let error = |source| ReadError::new(folder, Fault::System(source));
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        if path.is_dir() {
            folders.push(path);
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
            files.push(path);
        }
    }
    for paths in [&mut files, &mut folders] {
        paths.sort();
        paths.sort_by_cached_key(|path| natural(&stem(path)));
    }
    Ok((files, folders))
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// A key that puts `cf9` before `cf10`: all numbers are as long.
fn natural(name: &str) -> String {
    let mut key = String::new();
    for part in name.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()) {
        let part = String::from_utf8_lossy(part);
        let width = if part.starts_with(|c: char| c.is_ascii_digit()) { LONGEST_NUMBER } else { 0 };
        // Writing to a string cannot fail.
        let _ = write!(key, "{part:0>width$}");
    }
    key
}

/// Columns of the duration, and of x, y and z of each power.
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
                Fault::content(format!("there is no column `{name}`"), remedy)
            })
        };
        let mut highest = 0;
        for name in header {
            let Some(("x" | "y" | "z" | "X" | "Y" | "Z", power)) = name.split_once('^') else { continue };
            let power = power.parse::<usize>().ok().filter(|&power| power <= HIGHEST_POWER).ok_or_else(|| {
                let problem = format!("column `{name}` is of a power that is not a number up to {HIGHEST_POWER}");
                Fault::content(problem, "pieces of Crazyflie trajectories are of degree 7")
            })?;
            highest = highest.max(power);
        }
        let power = |power| {
            Ok([column(&format!("x^{power}"))?, column(&format!("y^{power}"))?, column(&format!("z^{power}"))?])
        };
        Ok(Self { duration: column("duration")?, powers: (0..=highest).map(power).collect::<Result<_, Fault>>()? })
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
    fn append(&mut self, path: &Path) -> Result<(), ReadError> {
        let mut table = Text::open(&Source { path: path.to_owned(), gzip: false }, Format::Crazyflie)?;
        let columns = Columns::of(table.header()).map_err(|fault| fault.at(Text::place(table.row())))?;
        let before = self.items.len();
        while table.advance()? {
            self.piece(&table, &columns).map_err(|fault| fault.at(Text::place(table.row())))?;
        }
        if self.items.len() == before { Err(Fault::header_only().into()) } else { Ok(()) }
    }

    fn piece(&mut self, table: &Text, columns: &Columns) -> Result<(), Fault> {
        let number = |column: usize| number(table, column)?.ok_or_else(|| Fault::empty_cell(&table.header()[column]));
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
        let piece = piece(self.vehicle, self.time_s, to_s, coefficients, self.scale);
        self.items.push(Item::Piece(piece.ok_or_else(Fault::out_of_range)?));
        self.time_s = to_s;
        Ok(())
    }
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
