//! Names of vehicles, and detection of columns that identify vehicles, by header and by values.

use std::collections::{BTreeMap, HashMap, HashSet};

use nalgebra::Vector3;

use super::error::{ContentKind, Fault, quoted, refuse};
use super::heading;
use super::heading::Heading;
use tautline_core::option::{COLUMN, ONE_VEHICLE};

/// Number of distinct values above which a column does not name vehicles.
const MOST_VALUES: usize = 1000;

/// Minimum number of compared positions for a decision by smoothness.
const ENOUGH: u64 = 8;

/// Largest ratio of the deviations from straight lines between neighbours, within equal values to all rows, for which
/// the values separate vehicles.
const APART: f64 = 0.5;

/// Returns the comparison key of a vehicle name. Names of the same number have one key. So have names that differ only
/// in case, in zeros before a number, or in marks and blanks that are not between two digits.
pub(super) fn spelling(name: &str) -> String {
    let unsigned = name.strip_prefix('+').unwrap_or(name);
    let unsigned =
        if unsigned.trim_matches(['-', '0', '.']).is_empty() && unsigned.contains('0') { "0" } else { unsigned };
    let (whole, fraction) = unsigned.split_once('.').unwrap_or((unsigned, "0"));
    if heading::is_number(whole) && fraction.bytes().all(|byte| byte == b'0') {
        return whole.trim_start_matches('0').to_owned() + "#";
    }
    let letters: Vec<char> = name.trim().chars().collect();
    let is_digit = |k: usize| letters.get(k).is_some_and(char::is_ascii_digit);
    // Whether zeros count here: after a digit of the same number, and after its decimal point.
    let (mut key, mut in_number) = (String::new(), false);
    for (k, &letter) in letters.iter().enumerate() {
        let is_kept = if letter == '0' {
            in_number || !is_digit(k + 1)
        } else {
            letter.is_alphanumeric() || (k.checked_sub(1).is_none_or(is_digit) && is_digit(k + 1))
        };
        if is_kept {
            key.extend(letter.to_lowercase());
        }
        in_number = if letter.is_ascii_digit() { in_number || is_kept } else { is_kept && letter == '.' };
    }
    if key.is_empty() { name.trim().to_lowercase() } else { key }
}

/// Vehicle names by index, and their indices.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    in_order: Vec<String>,
    indices: HashMap<Box<str>, usize>,
    /// Indices by [`spelling`].
    spellings: HashMap<String, usize>,
}

impl Names {
    /// Returns these names in their order.
    ///
    /// # Errors
    /// If two names differ only in spelling.
    pub(super) fn from_list(names: Vec<String>) -> Result<Self, Fault> {
        let mut all = Self::default();
        for name in names {
            all.add(name)?;
        }
        Ok(all)
    }

    /// Returns these names in their order, also if some differ only in spelling.
    ///
    /// # Errors
    /// If two names are equal.
    pub(super) fn distinct(names: Vec<String>) -> Result<Self, Fault> {
        let mut first = HashSet::new();
        match names.iter().find(|name| !first.insert(name.as_str())) {
            Some(twice) => refuse_twice(twice, twice),
            None => Ok(Self::ordered(names)),
        }
    }

    /// Returns the names `1`, `2`, ... up to `count`.
    pub(super) fn numbered(count: usize) -> Self {
        Self::ordered((1..=count).map(|number| number.to_string()).collect())
    }

    /// Returns names that are known to differ.
    fn ordered(names: Vec<String>) -> Self {
        let spellings = names.iter().enumerate().map(|(index, name)| (spelling(name), index)).collect();
        let indices = names.iter().enumerate().map(|(index, name)| (name.as_str().into(), index)).collect();
        Self { in_order: names, indices, spellings }
    }

    /// Adds a name and returns its index.
    fn add(&mut self, name: String) -> Result<usize, Fault> {
        let index = self.in_order.len();
        if let Some(&first) = self.spellings.get(&spelling(&name)) {
            return refuse_twice(&self.in_order[first], &name);
        }
        self.spellings.insert(spelling(&name), index);
        self.indices.insert(name.as_str().into(), index);
        self.in_order.push(name);
        Ok(index)
    }

    pub(super) fn all(&self) -> &[String] {
        &self.in_order
    }

    /// Returns index and name of the vehicle after this one, cyclically; an empty name if there are no vehicles.
    #[inline]
    pub(super) fn after(&self, vehicle: usize) -> (usize, &str) {
        let next = if vehicle + 1 < self.in_order.len() { vehicle + 1 } else { 0 };
        (next, self.in_order.get(next).map_or("", String::as_str))
    }

    /// Returns the index of a name, adding a new one.
    ///
    /// # Errors
    /// If a new name differs from another only in spelling.
    #[inline]
    pub(super) fn index(&mut self, name: &str) -> Result<usize, Fault> {
        if let Some(&index) = self.indices.get(name) {
            return Ok(index);
        }
        self.add(name.to_owned())
    }

    /// Sorts the names by value if all are numbers. Invalidates earlier indices.
    pub(super) fn settle(&mut self) {
        let numbers: Option<Vec<u64>> = self.in_order.iter().map(|name| name.parse().ok()).collect();
        let Some(numbers) = numbers else { return };
        let mut order: Vec<usize> = (0..self.in_order.len()).collect();
        order.sort_by_key(|&index| numbers[index]);
        *self = Self::ordered(order.iter().map(|&index| self.in_order[index].clone()).collect());
    }
}

fn refuse_twice<T>(first: &str, second: &str) -> Result<T, Fault> {
    let [first, second] = [first, second].map(quoted);
    let problem = if first == second {
        format!("two vehicles have the name {first}")
    } else {
        format!("the vehicles {first} and {second} differ only in how they are spelled")
    };
    let remedy = "use one name per vehicle, and names that differ in more than spelling";
    refuse(ContentKind::VehicleTwice, problem, remedy)
}

/// Alternative vehicle column of a table, compared with the one in use.
#[derive(Clone, Debug, Default)]
pub(super) struct AlternativeId {
    pub(super) column: usize,
    /// Its value for each vehicle, and the vehicle of each value.
    of: Vec<Option<Box<str>>>,
    vehicles: BTreeMap<Box<str>, usize>,
    contradicts: bool,
}

impl AlternativeId {
    pub(super) fn new(column: usize) -> Self {
        Self { column, ..Self::default() }
    }

    /// Records the value in a row of a vehicle.
    pub(super) fn observe(&mut self, vehicle: usize, value: &str) {
        if value.is_empty() || (self.contradicts && self.vehicles.len() > 1) {
            return;
        }
        if vehicle >= self.of.len() {
            self.of.resize(vehicle + 1, None);
        }
        let known = self.of[vehicle].get_or_insert_with(|| value.into());
        self.contradicts |= **known != *value;
        match self.vehicles.get(value) {
            Some(&first) => self.contradicts |= first != vehicle,
            None => {
                self.vehicles.insert(value.into(), vehicle);
            }
        }
    }

    /// Returns whether it distinguishes vehicles differently from the column in use. A constant column distinguishes
    /// none.
    pub(super) fn is_one(&self) -> bool {
        self.contradicts && self.vehicles.len() > 1
    }
}

/// Unused column, examined over the rows of one vehicle: its values may distinguish several vehicles.
#[derive(Clone, Debug, Default)]
pub(super) struct SuspectColumn {
    pub(super) column: usize,
    /// Last two rows of each value.
    values: HashMap<Box<str>, Track>,
    last: Option<Box<str>>,
    /// Last two rows, of any value.
    track: Track,
    rows: u64,
    changes: u64,
    /// Number of changes to an earlier value.
    returns: u64,
    /// Number of steps back in time, and of those with a change of the value.
    backwards: [u64; 2],
    /// Number of positions compared with their neighbours, and the sum of their deviations: among rows of the same
    /// value, and among all rows.
    compared: u64,
    off: [f64; 2],
    /// Whether a value has decimals: a measurement, or an unusual vehicle number.
    has_decimals: bool,
    /// Whether it cannot name vehicles.
    pub(super) cleared: bool,
}

/// Last two rows, each with its time.
#[derive(Clone, Copy, Debug, Default)]
struct Track([Option<(f64, Vector3<f64>)>; 2]);

impl Track {
    /// Adds a row; returns the deviation of the row before from the straight line between its neighbours.
    fn push(&mut self, time: f64, position: Vector3<f64>) -> Option<f64> {
        let [first, middle] = self.0;
        self.0 = [middle, Some((time, position))];
        let ((from, start), (between, place)) = (first?, middle?);
        let part = (between - from) / (time - from);
        part.is_finite().then(|| (place - start.lerp(&position, part)).norm())
    }
}

impl SuspectColumn {
    pub(super) fn new(column: usize) -> Self {
        Self { column, ..Self::default() }
    }

    /// Records the value in the next row.
    pub(super) fn observe(&mut self, value: &str, time: f64, position: Vector3<f64>) {
        self.has_decimals |= value.parse::<f64>().is_ok_and(|number| number.fract() != 0.0 || !number.is_finite());
        if self.values.len() > MOST_VALUES {
            (self.cleared, self.values) = (true, HashMap::new());
        }
        if self.cleared || value.is_empty() {
            return;
        }
        let changes = self.last.as_deref().is_some_and(|last| last != value);
        let went_back = self.track.0[1].is_some_and(|(before, _)| time < before);
        self.backwards[0] += u64::from(went_back);
        self.backwards[1] += u64::from(went_back && changes);
        self.rows += 1;
        if changes || self.last.is_none() {
            self.changes += u64::from(changes);
            self.returns += u64::from(changes && self.values.contains_key(value));
            self.last = Some(value.into());
        }
        let among_all = self.track.push(time, position);
        let own = match self.values.get_mut(value) {
            Some(own) => own,
            None => self.values.entry(value.into()).or_default(),
        };
        let among_own = own.push(time, position);
        if let (Some(all), Some(own)) = (among_all, among_own) {
            self.compared += 1;
            self.off[0] += own;
            self.off[1] += all;
        }
    }

    /// Returns whether the values distinguish vehicles. Candidates are few values that recur as time increases. They
    /// must alternate as words, or their rows must form smoother paths than all rows. For numbers with decimals, and if
    /// `names_others` is set, only the paths decide.
    fn names_vehicles(&self, names_others: bool) -> bool {
        let values = self.values.len() as u64;
        if self.cleared || values < 2 || 2 * values > self.rows + 1 {
            return false;
        }
        let is_sequence = self.backwards[0] > 0 && self.backwards == [self.changes; 2];
        let alternates = 3 * self.changes >= self.rows - 1;
        let is_smoother = self.off[0] < APART * self.off[1];
        if names_others || self.has_decimals {
            return self.returns > 0 && self.compared >= ENOUGH && is_smoother;
        }
        // Measured text, such as a flight mode, rarely changes.
        let is_text = self.values.keys().all(|value| value.parse::<f64>().is_err());
        let is_distinctive = if is_text || self.compared < ENOUGH { alternates || is_smoother } else { is_smoother };
        is_sequence || (self.returns > 0 && is_distinctive)
    }

    /// Returns the fault of rows in which the column `called` seems to name several vehicles. `named` holds the vehicle
    /// name of all these rows, and the name of the column that gives it.
    pub(super) fn fault(&self, called: &str, named: Option<(&str, &str)>) -> Option<Fault> {
        if !self.names_vehicles(named.is_some()) {
            return None;
        }
        let count = self.values.len();
        let (whose, otherwise) = match named {
            None => ("its rows".to_owned(), format!("if all rows are of one vehicle, use {ONE_VEHICLE}")),
            Some((name, id)) => {
                let confirmed = COLUMN.set(format!("id={id}"));
                let otherwise = format!("if column {id} does name the vehicles, confirm it with {confirmed}");
                (format!("the rows of vehicle {}", quoted(name)), otherwise)
            }
        };
        let problem = format!(
            "{whose} look like those of several vehicles: column {} has {count} values that alternate",
            quoted(called)
        );
        let column = COLUMN.set(format!("id={called}"));
        let remedy = format!("name the column of the vehicle with {column}; {otherwise}");
        Some(Fault::content(ContentKind::SeveralVehicles, problem, remedy))
    }
}

/// Separators between the name of a vehicle and the name of a quantity.
const SEPARATORS: [char; 6] = ['.', '/', '_', '-', ':', ' '];

/// Names of the first two axes of a position.
const AXES: [[&str; 2]; 4] = [["x", "y"], ["east", "north"], ["lat", "lon"], ["e", "n"]];

/// Names of position arrays.
const ARRAYS: [&str; 7] = ["p", "pos", "position", "xyz", "location", "coord", "coords"];

/// Columns of a wide table with the vehicle names of its column groups.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Slots {
    /// Column with the name of the vehicle, for each group; empty without such columns.
    pub(super) ids: Vec<usize>,
    /// Columns of one quantity, such as `a.track` and `b.track`, whose values may also be vehicle names.
    pub(super) watched: Vec<Vec<usize>>,
}

/// Finds name columns among the unused columns of a wide table with these `vehicles`.
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
                let problem = format!("column {called} gives the time of vehicle {vehicle} only");
                let remedy =
                    "write one row for each vehicle and time, or remove the column if it repeats the time of the row";
                return refuse(ContentKind::SeveralClocks, problem, remedy);
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
    if let Some((first, vehicle)) =
        ids.clone().next().zip((0..vehicles.len()).find(|vehicle| !names.contains_key(vehicle)))
    {
        let [column, vehicle] = [&header[first], &vehicles[vehicle]].map(|name| quoted(name));
        let problem = format!("column {column} may name a vehicle, but there is no such column for {vehicle}");
        let remedy = "add such a column for each vehicle, or remove these columns";
        return refuse(ContentKind::AmbiguousVehicle, problem, remedy);
    }
    if let Some([x, y]) = further(&others) {
        let problem = format!("the columns {} and {} may be the position of a further vehicle", quoted(x), quoted(y));
        let remedy = "rename these columns like those of the other vehicles, or remove them";
        return refuse(ContentKind::AmbiguousColumn, problem, remedy);
    }
    let ids: Vec<_> = ids.collect();
    let is_watched = |columns: &Vec<usize>| columns.len() > 1 && !columns.iter().all(|column| ids.contains(column));
    Ok(Slots { watched: quantities.into_values().filter(is_watched).collect(), ids })
}

/// Values of one quantity of all vehicles, compared from row to row.
#[derive(Clone, Debug)]
pub(super) struct SwapMonitor {
    pub(super) columns: Vec<usize>,
    last: Vec<String>,
}

impl SwapMonitor {
    pub(super) fn new(columns: Vec<usize>) -> Self {
        Self { columns, last: Vec::new() }
    }

    /// Refuses distinct values that are permuted from one row to the next: the columns may name vehicles.
    pub(super) fn observe(&mut self, now: Vec<String>, header: &[String]) -> Result<(), Fault> {
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
                let problem = format!(
                    "the values of column {called} and its counterparts are exchanged, as names of vehicles are"
                );
                let remedy = "name these columns like `a.id`, or remove them if their values are not names";
                return refuse(ContentKind::AmbiguousVehicle, problem, remedy);
            }
        }
        self.last = now;
        Ok(())
    }
}

/// Returns the vehicles of `column`, each with the rest of its name. The name of the vehicle is a prefix, a suffix or a
/// bracketed part. Alternatively only this vehicle shares a path prefix with the column (`drones.0.id` beside
/// `drones.0.pose`).
fn of_vehicles<'a>(column: &'a str, vehicles: &[String]) -> Vec<(usize, &'a str)> {
    let (stem, unit) = heading::bracketed(column);
    let rest = |vehicle: &String| {
        let ends_in_digit = |name: &str| name.ends_with(|c: char| c.is_ascii_digit());
        if unit == Some(vehicle) && !ends_in_digit(stem) {
            return Some(stem);
        }
        let is_number = heading::is_number(vehicle);
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
    let path_of_one = stem.match_indices(['.', '/']).find_map(|(index, _)| {
        let is_below =
            |vehicle: &&String| vehicle.strip_prefix(&stem[..index]).is_some_and(|rest| rest.starts_with(['.', '/']));
        let mut below = vehicles.iter().enumerate().filter(|(_, vehicle)| is_below(vehicle));
        let first = below.next()?;
        below.next().is_none().then_some((first.0, &stem[index + 1..]))
    });
    path_of_one.into_iter().filter(|_| vehicles.len() > 1).collect()
}

/// Returns two names that differ only in the axis, unless the rest of the names is another quantity with axes.
fn further<'a>(names: &[&'a str]) -> Option<[&'a str; 2]> {
    let lower = |name: &str| {
        let (stem, unit) = heading::bracketed(name);
        match unit {
            Some(number) if heading::is_number(number) => name.to_lowercase(),
            _ => stem.to_lowercase(),
        }
    };
    let known: BTreeMap<String, &str> = names.iter().map(|name| (lower(name), *name)).collect();
    let is_position = |rest: &str, [first, _]: [&str; 2]| {
        let letters: String = rest.chars().filter(char::is_ascii_alphabetic).collect();
        let is_bare = letters.is_empty();
        is_bare || (first != "e" && !heading::LETTERS.contains(&&*letters) && !heading::is_quantity_name(rest))
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
                name.match_indices(axes[0]).find_map(|(index, token)| {
                    let (before, behind) = (&name[..index], &name[index + token.len()..]);
                    let second = known.get(&format!("{before}{}{behind}", axes[1]))?;
                    is_position(&format!("{before}{behind}"), *axes).then_some([*original, *second])
                })
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equivalent_spellings_have_one_key() {
        for (name, other) in [
            ("1", "1.0"),
            ("1", "+1"),
            ("1", "001"),
            ("0", "-0"),
            ("Cf1", "cf1"),
            ("cf1", "cf01"),
            ("cf1", "cf001"),
            ("cf-1", "cf_1"),
            ("cf 1", "cf1"),
            ("cf1", "cf1."),
            ("a\u{200b}", "a"),
        ] {
            assert_eq!(spelling(name), spelling(other), "{name} {other}");
        }
        for (name, other) in [
            ("1", "-1"),
            ("1", "10"),
            ("1.5", "15"),
            ("1.05", "1.5"),
            ("v1.10", "v11.0"),
            ("10-4", "104"),
            ("cf10", "cf1"),
            ("cf0", "cf"),
            ("a", "b"),
            ("--", "__"),
            ("", "-"),
        ] {
            assert_ne!(spelling(name), spelling(other), "{name} {other}");
        }
    }
}
