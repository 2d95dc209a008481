//! Columns of a wide table that are not read but may give the name, the time or the position of a vehicle.

use std::collections::BTreeMap;

use super::error::{Fault, quoted};
use super::heading::{self, Heading};
use super::units;

/// Separators between the name of a vehicle and the name of a quantity.
const SEPARATORS: [char; 6] = ['.', '/', '_', '-', ':', ' '];

/// Names of the first two axes of a position.
const AXES: [[&str; 2]; 4] = [["x", "y"], ["east", "north"], ["lat", "lon"], ["e", "n"]];

/// Names of arrays that hold a position.
const ARRAYS: [&str; 7] = ["p", "pos", "position", "xyz", "location", "coord", "coords"];

/// Columns of a wide table that say which vehicle a group of columns is of.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Slots {
    /// The column with the name of the vehicle, for each group; empty if there are no such columns.
    pub(super) ids: Vec<usize>,
    /// Columns of one quantity, such as `a.track` and `b.track`, whose values may be names too.
    pub(super) watched: Vec<Vec<usize>>,
}

/// Returns what the columns that are not read say of the `vehicles` of a wide table.
///
/// # Errors
/// - A column gives the time of one vehicle.
/// - Some vehicles have a column for their name and others do not.
/// - Two columns may be the position of a further vehicle.
pub(super) fn examine(header: &[String], unused: &[usize], vehicles: &[String]) -> Result<Slots, Fault> {
    let mut names: BTreeMap<usize, (u8, usize)> = BTreeMap::new();
    let mut quantities: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    let mut others = Vec::new();
    for &column in unused {
        let found = of_vehicles(&header[column], vehicles);
        if found.is_empty() && Heading::of(&header[column]).is_none() {
            others.push(header[column].as_str());
        }
        for (vehicle, rest) in found {
            if rest.split(['.', '/']).any(heading::is_time) {
                let (called, vehicle) = (quoted(&header[column]), quoted(&vehicles[vehicle]));
                let problem = format!("column {called} gives a time of vehicle {vehicle} alone");
                let remedy =
                    "write one row for each vehicle and time, or remove the column if it repeats the time of the row";
                return Err(Fault::coded("recording/several-clocks", problem, remedy));
            }
            let Some(last) = rest.rsplit(['.', '/']).next().filter(|last| heading::is_id(last)) else { continue };
            quantities.entry(rest).or_default().push(column);
            if let Some(rank) = heading::rank_of_name(last) {
                let best = names.entry(vehicle).or_insert((rank, column));
                *best = (*best).min((rank, column));
            }
        }
    }
    let ids = names.values().map(|(_, column)| *column);
    if let Some((first, vehicle)) = ids.clone().next().zip((0..vehicles.len()).find(|of| !names.contains_key(of))) {
        let [column, vehicle] = [&header[first], &vehicles[vehicle]].map(|name| quoted(name));
        let problem = format!("column {column} may name a vehicle, but there is no such column for {vehicle}");
        return Err(Fault::coded(
            "recording/ambiguous-vehicle",
            problem,
            "add such a column for each vehicle, or remove these columns",
        ));
    }
    if let Some([x, y]) = further(&others) {
        let problem = format!("the columns {} and {} may be the position of a further vehicle", quoted(x), quoted(y));
        let remedy = "rename these columns like those of the other vehicles, or remove them";
        return Err(Fault::coded("recording/ambiguous-column", problem, remedy));
    }
    let ids: Vec<_> = ids.collect();
    let is_watched = |columns: &Vec<usize>| columns.len() > 1 && !columns.iter().all(|column| ids.contains(column));
    Ok(Slots { watched: quantities.into_values().filter(is_watched).collect(), ids })
}

/// Values of one quantity of all vehicles in the last row.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    pub(super) columns: Vec<usize>,
    last: Vec<String>,
}

impl Watch {
    pub(super) fn new(columns: Vec<usize>) -> Self {
        Self { columns, last: Vec::new() }
    }

    /// Refuses different values that change places from one row to the next: the columns may name vehicles.
    pub(super) fn see(&mut self, now: Vec<String>, header: &[String]) -> Result<(), Fault> {
        let sorted = |values: &[String]| {
            let mut values = values.to_vec();
            values.sort_unstable();
            values
        };
        if !self.last.is_empty() && now != self.last {
            let values = sorted(&now);
            let are_names =
                values.windows(2).all(|two| two[0] != two[1]) && values.iter().all(|value| !value.is_empty());
            if are_names && values == sorted(&self.last) {
                let called = quoted(&header[self.columns[0]]);
                let problem =
                    format!("the values of column {called} and of its like change places, as names of vehicles do");
                let remedy = "name these columns like `a.id`, or remove them if their values are no names";
                return Err(Fault::coded("recording/ambiguous-vehicle", problem, remedy));
            }
        }
        self.last = now;
        Ok(())
    }
}

/// Returns the vehicles that `column` is of, with the rest of `column`: the name of the vehicle is a prefix, a suffix or a bracketed
/// part, or begins with the path of the column as that of no other vehicle does (`drones.0.id` beside `drones.0.pose`).
fn of_vehicles<'a>(column: &'a str, vehicles: &[String]) -> Vec<(usize, &'a str)> {
    let (stem, unit) = units::bracketed(column);
    let rest = |vehicle: &String| {
        let ends_in_digit = |name: &str| name.ends_with(|c: char| c.is_ascii_digit());
        if unit == Some(vehicle) && !ends_in_digit(stem) {
            return Some(stem);
        }
        let is_number = vehicle.bytes().all(|byte| byte.is_ascii_digit());
        let behind = stem.strip_prefix(vehicle.as_str()).and_then(|rest| rest.strip_prefix(SEPARATORS));
        behind.or_else(|| {
            let before = stem.strip_suffix(vehicle.as_str())?;
            let ends_alone = |before: &&str| is_number && !ends_in_digit(before);
            before.strip_suffix(SEPARATORS).or_else(|| Some(before).filter(ends_alone))
        })
    };
    let found = vehicles.iter().enumerate().filter_map(|(index, vehicle)| Some((index, rest(vehicle)?)));
    let found: Vec<_> = found.filter(|(_, rest)| !rest.is_empty()).collect();
    if !found.is_empty() {
        return found;
    }
    let path_of_one = stem.match_indices(['.', '/']).find_map(|(at, _)| {
        let is_below =
            |vehicle: &&String| vehicle.strip_prefix(&stem[..at]).is_some_and(|rest| rest.starts_with(['.', '/']));
        let mut below = vehicles.iter().enumerate().filter(|(_, vehicle)| is_below(vehicle));
        let first = below.next()?;
        below.next().is_none().then_some((first.0, &stem[at + 1..]))
    });
    path_of_one.into_iter().filter(|_| vehicles.len() > 1).collect()
}

/// Returns two names that differ only in the axis, unless the rest of the names is a quantity with axes.
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
