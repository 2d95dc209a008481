//! Columns of a wide table that are not read, and what they may say of its vehicles all the same.

use std::collections::BTreeMap;

use super::error::{Fault, quoted};
use super::heading::{self, Heading};
use super::units;

/// What stands between the name of a vehicle and that of a quantity.
const SEPARATORS: [char; 6] = ['.', '/', '_', '-', ':', ' '];

/// Names of the first two axes of a position.
const AXES: [[&str; 2]; 4] = [["x", "y"], ["east", "north"], ["lat", "lon"], ["e", "n"]];

/// Names of arrays that hold a position.
const ARRAYS: [&str; 7] = ["p", "pos", "position", "xyz", "location", "coord", "coords"];

/// Returns the columns that name the vehicle of each group of columns, in the order of the vehicles; none where there is no such
/// column.
///
/// # Errors
/// Where a vehicle has a time of its own, where some vehicles have such a column and others do not, and where columns look like those
/// of a further vehicle.
pub(super) fn examine(header: &[String], unused: &[usize], vehicles: &[String]) -> Result<Vec<usize>, Fault> {
    let mut names = BTreeMap::new();
    for &column in unused {
        let called = quoted(&header[column]);
        for (vehicle, rest) in of_vehicles(&header[column], vehicles) {
            if rest.split(['.', '/']).any(heading::is_time) {
                let problem = format!("column {called} gives a time of vehicle {} alone", quoted(&vehicles[vehicle]));
                let remedy = "write a row for each vehicle and time, or take the column out where it repeats the time of the row";
                return Err(Fault::content(problem, remedy));
            }
            if rest.rsplit(['.', '/']).next().is_some_and(heading::is_id) {
                names.entry(vehicle).or_insert(column);
            }
        }
    }
    if let Some((&first, vehicle)) = names.values().next().zip((0..vehicles.len()).find(|of| !names.contains_key(of))) {
        let [column, vehicle] = [&header[first], &vehicles[vehicle]].map(|name| quoted(name));
        let problem = format!("column {column} may name a vehicle, and there is no such column for {vehicle}");
        return Err(Fault::content(problem, "name each vehicle by a column, or take these columns out"));
    }
    let others = unused.iter().map(|&column| header[column].as_str()).filter(|name| Heading::of(name).is_none());
    let others: Vec<_> = others.collect();
    if let Some([x, y]) = further(&others) {
        let problem = format!("the columns {} and {} may be the position of a further vehicle", quoted(x), quoted(y));
        let remedy = "name columns as those of the other vehicles are named, or take these out";
        return Err(Fault::content(problem, remedy));
    }
    Ok(names.into_values().collect())
}

/// Vehicles in whose name a column begins or ends, and the rest of its name.
fn of_vehicles<'a>(column: &'a str, vehicles: &[String]) -> Vec<(usize, &'a str)> {
    let (stem, unit) = units::bracketed(column);
    let rest = |vehicle: &String| {
        if unit == Some(vehicle) {
            return Some(stem);
        }
        let is_number = vehicle.bytes().all(|byte| byte.is_ascii_digit());
        let behind = stem.strip_prefix(vehicle.as_str()).and_then(|rest| rest.strip_prefix(SEPARATORS));
        behind.or_else(|| {
            let before = stem.strip_suffix(vehicle.as_str())?;
            before.strip_suffix(SEPARATORS).or_else(|| is_number.then_some(before))
        })
    };
    let found = vehicles.iter().enumerate().filter_map(|(index, vehicle)| Some((index, rest(vehicle)?)));
    found.filter(|(_, rest)| !rest.is_empty()).collect()
}

/// Two names that differ in the axis alone, where the rest of them is no quantity with axes.
fn further<'a>(names: &[&'a str]) -> Option<[&'a str; 2]> {
    let lower = |name: &str| {
        let (stem, unit) = units::bracketed(name);
        match unit {
            Some(number) if number.bytes().all(|byte| byte.is_ascii_digit()) => name.to_lowercase(),
            _ => stem.to_lowercase(),
        }
    };
    let known: BTreeMap<String, &str> = names.iter().map(|name| (lower(name), *name)).collect();
    let is_position = |rest: &str, [first, _]: [&str; 2]| {
        let letters: String = rest.chars().filter(char::is_ascii_alphabetic).collect();
        let is_bare = letters.is_empty();
        is_bare || (first != "e" && !heading::LETTERS.contains(&&*letters) && !heading::says_a_quantity(rest))
    };
    let array = known.iter().find_map(|(name, original)| {
        let stem = name.strip_suffix("[0]")?;
        let letters = stem.trim_end_matches(|c: char| c.is_ascii_digit() || SEPARATORS.contains(&c));
        let second = known.get(&format!("{stem}[1]"))?;
        ARRAYS.contains(&letters).then_some([*original, *second])
    });
    array.or_else(|| {
        known.iter().find_map(|(name, original)| {
            AXES.iter().find_map(|axes| {
                name.match_indices(axes[0]).find_map(|(at, token)| {
                    let (before, behind) = (&name[..at], &name[at + token.len()..]);
                    let second = known.get(&format!("{before}{}{behind}", axes[1]))?;
                    is_position(&format!("{before}{behind}"), *axes).then_some([*original, *second])
                })
            })
        })
    })
}
