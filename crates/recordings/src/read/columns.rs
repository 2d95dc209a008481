//! Columns of a table by their roles: positions, velocities, and one or two columns of time.

use std::collections::{BTreeMap, BTreeSet};

use super::clock::{Stamp, TimeUnit};
use super::earth::Heights;
use super::error::{Fault, list, quoted, refuse};
use super::heading::{EARTH, Heading, ID, POSITION, RADIUS, Role, TIME, VELOCITY, is_angle, is_velocity};
use super::options::{ColumnNames, ReadOptions};
use super::{axes, heading};

/// The columns of a position, and of what else is known of a vehicle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Body {
    /// x, y and z, if there is one; or latitude, longitude and height.
    pub(super) position: [Option<usize>; 3],
    pub(super) velocity: Option<[Option<usize>; 3]>,
    pub(super) radius: Option<usize>,
}

impl Body {
    /// The same without a height.
    pub(super) fn flattened(mut self) -> Self {
        self.position[2] = None;
        self.velocity.iter_mut().for_each(|velocity| velocity[2] = None);
        self
    }
}

const WORDS: [&str; 12] = [
    "time",
    "the vehicle",
    "the position along x",
    "the position along y",
    "the position along z",
    "the velocity along x",
    "the velocity along y",
    "the velocity along z",
    "the radius",
    "the latitude",
    "the longitude",
    "the height",
];

/// The fault that there is no column of a role.
pub(super) fn missing(header: &[String], role: Role, of: &str) -> Fault {
    let problem = format!("there is no column for {}{of}; its columns are {}", WORDS[role], list(header, 12));
    let option = ColumnNames::ROLES[role];
    let remedy = format!("name the column with --column {option}=NAME, or put it into the header");
    Fault::coded(code_of_missing(role), problem, remedy)
}

fn code_of_missing(role: Role) -> &'static str {
    match role {
        TIME => "recording/no-time-column",
        ID => "recording/no-vehicle-column",
        _ if is_velocity(role) || role == RADIUS => "recording/missing-column",
        _ => "recording/no-position-column",
    }
}

/// Columns found so far: of a vehicle by its name, or of all vehicles under no name.
pub(super) struct Columns<'a> {
    pub(super) header: &'a [String],
    pub(super) found: BTreeMap<(String, Role), usize>,
    /// The unit that the name of a column says.
    pub(super) units: BTreeMap<usize, &'a str>,
    pub(super) heights: Heights,
    /// The role of the first axis of positions.
    pub(super) place: Role,
}

impl<'a> Columns<'a> {
    /// Returns the columns that the user names.
    pub(super) fn given(header: &'a [String], options: &'a ReadOptions) -> Result<Self, Fault> {
        let (heights, place) = (Heights::default(), POSITION);
        let mut columns = Self { header, found: BTreeMap::new(), units: BTreeMap::new(), heights, place };
        for (role, name) in options.columns.given() {
            let column = header.iter().position(|column| column == name);
            let column = column.ok_or_else(|| missing(header, role, &format!(" with the name `{name}`")))?;
            columns.found.insert((String::new(), role), column);
            // An unknown unit in the name of a column that the user gives is ignored.
            let ending = || heading::endings(name).find(|(_, _, velocity)| *velocity == is_velocity(role));
            let unit = heading::bracketed(name).1.or_else(|| ending().map(|(_, unit, _)| unit));
            let unit = unit.filter(|unit| is_angle(role) || heading::size_of(unit, is_velocity(role)).is_some());
            columns.units.extend(unit.map(|unit| (column, unit)));
        }
        Ok(columns)
    }

    pub(super) fn get(&self, vehicle: &str, role: Role) -> Option<usize> {
        self.found.get(&(vehicle.to_owned(), role)).copied()
    }

    /// What a person should know of columns that are read because their names are those of heights, which are up whatever
    /// the user says of the other axes.
    pub(super) fn heights_used(&self, bodies: &[Body], options: &ReadOptions) -> Result<Option<String>, Fault> {
        let used = self.heights.among(bodies.iter().filter_map(|body| body.position[2]));
        let Some(&(first, is_turned)) = used.first() else { return Ok(None) };
        if self.place != EARTH {
            axes::refuse_turned_height(options, &self.header[first])?;
        }
        let names: Vec<_> = used.iter().map(|(column, _)| self.header[*column].clone()).collect();
        let turned = if is_turned { ", with the sign turned" } else { "" };
        let scale = options.metres();
        let unit = match self.units.get(&first) {
            None if self.place == EARTH && scale != 1.0 => format!(", in units of {scale} m as --scale says"),
            None if self.place == EARTH => ", in metres: the name says no unit (--scale gives another)".to_owned(),
            _ => String::new(),
        };
        let columns = if used.len() > 1 { "columns" } else { "column" };
        Ok(Some(format!("heights are those of {columns} {}{turned}{unit}", list(&names, 12))))
    }

    pub(super) fn claim(&mut self, vehicle: &str, heading: &Heading<'a>, column: usize) -> Result<(), Fault> {
        let of = if vehicle.is_empty() { String::new() } else { format!(" of `{vehicle}`") };
        self.units.extend(heading.unit.map(|unit| (column, unit)));
        let Some(first) = self.found.insert((vehicle.to_owned(), heading.role), column) else { return Ok(()) };
        let (first, second) = (&self.header[first], &self.header[column]);
        let problem = format!("the columns `{first}` and `{second}` both give {}{of}", WORDS[heading.role]);
        refuse("recording/ambiguous-column", problem, "name the one that is meant with --column, or take the other out")
    }

    /// Finds the vehicles of a wide table, and gives their names in order of appearance.
    pub(super) fn claim_wide(&mut self, headings: &[(usize, Heading<'a>)]) -> Result<Vec<String>, Fault> {
        let named: Vec<_> = headings.iter().filter(|(_, heading)| !heading.vehicle.is_empty()).collect();
        let vehicles: BTreeSet<_> = named.iter().map(|(_, heading)| heading.vehicle).collect();
        // Where all vehicles are called by letters, `a` is one of them; beside none or numbers `a_x` is an acceleration.
        let sure = |heading: &Heading<'_>| !heading.ambiguous && !heading.is_numbered();
        let letters = named.iter().any(|(_, heading)| sure(heading));
        let words = named.iter().find(|(_, heading)| sure(heading) && heading.vehicle.len() > 1);
        let odd = named.iter().find(|(_, heading)| heading.ambiguous);
        if let (Some((odd, _)), Some((word, _))) = (odd, words) {
            let [odd, word] = [*odd, *word].map(|column| quoted(&self.header[column]));
            let problem = format!("column {odd} may be of a vehicle, as {word} is, or of a quantity of another one");
            return refuse("recording/ambiguous-column", problem, "give the column a longer name, or take it out");
        }
        let mut names: Vec<String> = Vec::new();
        // `cf1_v_x` is a velocity where there is a `cf1_x`.
        let of_another = |vehicle: &str| {
            let split = vehicle.rsplit_once(['.', '/', '_']).filter(|(_, letter)| heading::LETTERS.contains(letter));
            split.is_some_and(|(other, _)| vehicles.contains(other))
        };
        let is_vehicle = |heading: &Heading<'_>| (letters || !heading.ambiguous) && !of_another(heading.vehicle);
        for (column, heading) in named.into_iter().filter(|(_, heading)| is_vehicle(heading)) {
            let known = self.found.range((heading.vehicle.to_owned(), 0)..).next();
            if known.is_none_or(|((known, _), _)| known != heading.vehicle) {
                names.push(heading.vehicle.to_owned());
            }
            self.claim(heading.vehicle, heading, *column)?;
        }
        if names.is_empty() {
            let of = " and none for its position (as `id`, `x`, `y`, or as `x1`, `y1`)";
            return Err(missing(self.header, ID, of));
        }
        Ok(names)
    }

    /// The columns of a vehicle: at least x and y of its position, and its velocity along each axis of its position where
    /// it has one along some axis.
    pub(super) fn body(&self, vehicle: &str) -> Result<Body, Fault> {
        let of = if vehicle.is_empty() { String::new() } else { format!(" of vehicle `{vehicle}`") };
        let axes = |role| [0, 1, 2].map(|axis| self.get(vehicle, role + axis));
        let (position, velocity) = (axes(self.place), axes(VELOCITY));
        let moves = velocity.iter().any(Option::is_some);
        for axis in 0..3 {
            let lacks = match (position[axis], velocity[axis]) {
                (None, moving) if axis < 2 || moving.is_some() => self.place,
                (Some(_), None) if moves => VELOCITY,
                _ => continue,
            };
            return Err(missing(self.header, lacks + axis, &of));
        }
        Ok(Body { position, velocity: moves.then_some(velocity), radius: self.get(vehicle, RADIUS) })
    }

    /// What the numbers of each column are multiplied by, going by the units that names say: all names or none, and
    /// nothing beside them.
    pub(super) fn metres(&self, used: &[usize], scale: f64) -> Result<Vec<f64>, Fault> {
        let mut metres = vec![1.0; self.header.len()];
        let (mut other, mut silent) = (None, None);
        let lengths =
            self.found.iter().filter(|((_, role), column)| *role >= POSITION && used.binary_search(column).is_ok());
        for (&(_, role), &column) in lengths {
            let name = quoted(&self.header[column]);
            if is_angle(role) {
                let unit = self.units.get(&column).map_or("deg", |unit| *unit);
                metres[column] = heading::degrees(unit).ok_or_else(|| {
                    let problem = format!("column {name} says a unit of angle that is not known, {}", quoted(unit));
                    Fault::coded(
                        "recording/unknown-unit",
                        problem,
                        "write it in degrees, and name the column without a unit",
                    )
                })?;
                continue;
            }
            let Some(unit) = self.units.get(&column) else {
                silent = Some(name);
                continue;
            };
            let what = if is_velocity(role) { "velocity" } else { "length" };
            let size = heading::size_of(unit, is_velocity(role)).ok_or_else(|| {
                let problem = format!("column {name} says a unit of {what} that is not known, {}", quoted(unit));
                let remedy =
                    "write it in m, cm, mm, km, ft or in, or name the column with --column and its unit with --scale";
                Fault::coded("recording/unknown-unit", problem, remedy)
            })?;
            metres[column] = size;
            if size != 1.0 {
                other = Some(name);
            }
        }
        for column in self.heights.downward() {
            metres[column] = -metres[column];
        }
        let Some(other) = other else {
            if self.place == EARTH {
                let is_length = |(_, role): &&(String, Role)| !is_angle(*role) && *role >= POSITION;
                let lengths: BTreeSet<_> =
                    self.found.iter().filter(|(key, _)| is_length(key)).map(|(_, column)| *column).collect();
                for column in lengths {
                    metres[column] *= scale;
                }
            }
            return Ok(metres);
        };
        if let Some(silent) = silent {
            let problem = format!("column {other} says its unit, and column {silent} none");
            return refuse(
                "recording/unit-conflict",
                problem,
                "write the unit of each column into its name, as in `x [mm]`",
            );
        }
        if scale != 1.0 {
            let problem = format!("column {other} says its unit, and --scale {scale} another");
            return refuse(
                "recording/contradicts-option",
                problem,
                "leave --scale away, or take the units out of the header",
            );
        }
        Ok(metres)
    }
}

/// Words before the unit of a column that gives a part of a time, as in `header.stamp.nanosec`.
const CLOCK_WORDS: [&str; 8] = ["", "t", "time", "timestamp", "stamp", "header", "tv", "unix"];

/// The rest of a time below a unit of its first column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rest {
    pub(super) column: usize,
    /// How many units of this column make one of the first.
    per_unit: i64,
    /// The unit of this column, which is that of the two together.
    pub(super) unit: TimeUnit,
}

impl Rest {
    /// The time of a row, exact.
    pub(super) fn join(self, whole: Stamp, rest: Stamp, header: &[String], first: usize) -> Result<Stamp, Fault> {
        let (first, own) = (quoted(&header[first]), quoted(&header[self.column]));
        let problem = match (whole.whole(), rest.whole()) {
            (Some(units), Some(below)) if (0..self.per_unit).contains(&below) => {
                let joined = units.checked_mul(self.per_unit).and_then(|time| time.checked_add(below));
                return joined.map(Stamp::Whole).ok_or_else(Fault::out_of_range);
            }
            (Some(_), Some(below)) => {
                format!("column {own} holds {below}, which is not the rest below a unit of {first}")
            }
            (None, _) => {
                format!("column {first} holds {}, which is no whole number beside {own}", whole.approximately())
            }
            (_, None) => format!("column {own} holds {}, which is no whole number", rest.approximately()),
        };
        let remedy = "where one of the two is the whole time, name it with --column t=NAME";
        refuse("recording/time-format", problem, remedy)
    }
}

/// A column that gives a time or a part of one.
struct Candidate {
    column: usize,
    /// What stands before the unit; empty where nothing does.
    stem: String,
    unit: Option<TimeUnit>,
}

/// The columns of time of a header: the first, and that of the rest if there is one; none where nothing gives a time.
pub(super) fn find(header: &[String], options: &ReadOptions) -> Result<Option<(usize, Option<Rest>)>, Fault> {
    let mut candidates: Vec<_> =
        header.iter().enumerate().filter_map(|(column, name)| candidate(column, name)).collect();
    let is_whole_time = |candidate: &Candidate| heading::is_time(&header[candidate.column]);
    // A part alone, such as `sec` or `ms`, is no time: what it is a part of is not known.
    if candidates.len() == 1 && !is_whole_time(&candidates[0]) {
        candidates.clear();
    }
    match &candidates[..] {
        [] => Ok(header.iter().position(|name| heading::is_frame(name)).map(|column| (column, None))),
        [only] => Ok(Some((only.column, None))),
        [a, b] => {
            let pair = [(a, b), (b, a)].into_iter().find_map(|(whole, rest)| Some((whole, rest, split(whole, rest)?)));
            let Some((whole, _, rest)) = pair else { return Err(both(header, a, b)) };
            if options.time_unit.is_some() || options.times_per_second.is_some() {
                let (whole, own) = (quoted(&header[whole.column]), quoted(&header[rest.column]));
                let problem = format!("times are split over the columns {whole} and {own}, whose units are known");
                return refuse(
                    "recording/contradicts-option",
                    problem,
                    "leave --time-unit, --fps and --time-scale away",
                );
            }
            Ok(Some((whole.column, Some(rest))))
        }
        [a, b, ..] => Err(both(header, a, b)),
    }
}

/// Whether a column of this name gives a time or a part of one.
pub(super) fn is_part(name: &str) -> bool {
    candidate(0, name).is_some()
}

fn candidate(column: usize, name: &str) -> Option<Candidate> {
    let (stem, unit) = heading::time_and_unit(name);
    let known = unit.as_deref().and_then(TimeUnit::from_name);
    if heading::is_time(name) {
        return Some(Candidate { column, stem, unit: known });
    }
    // `sec`, `tv_usec`, `header.stamp.nanosec`: the last word is a unit of more than one letter.
    let name = name.trim().to_lowercase();
    let (before, word) = name.rsplit_once(['.', '/', '_', ' ']).unwrap_or(("", &name));
    let unit = TimeUnit::from_name(word).filter(|_| word.len() > 1)?;
    let is_clock = before.rsplit(['.', '/', '_', ' ']).next().is_some_and(|word| CLOCK_WORDS.contains(&word));
    // The same words of anything else, such as `flight_sec`, are durations.
    is_clock.then(|| Candidate { column, stem: before.to_owned(), unit: Some(unit) })
}

/// How one column continues another one, where they may be the two parts of a time.
fn split(whole: &Candidate, rest: &Candidate) -> Option<Rest> {
    let unit = rest.unit?;
    let per_unit = unit.per_second() / whole.unit.unwrap_or(TimeUnit::Seconds).per_second();
    let are_of_one = whole.stem == rest.stem || whole.stem.is_empty() || rest.stem.is_empty();
    (are_of_one && per_unit > 1).then_some(Rest { column: rest.column, per_unit, unit })
}

fn both(header: &[String], a: &Candidate, b: &Candidate) -> Fault {
    let (first, second) = (quoted(&header[a.column]), quoted(&header[b.column]));
    let problem = format!("the columns {first} and {second} both give the time");
    Fault::coded(
        "recording/ambiguous-column",
        problem,
        "name the one that is meant with --column t=NAME, or take the other out",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(header: &str) -> Result<Option<(usize, Option<usize>)>, String> {
        let header: Vec<_> = header.split(',').map(str::to_owned).collect();
        let found = find(&header, &ReadOptions::default()).map_err(|fault| fault.to_string())?;
        Ok(found.map(|(time, rest)| (time, rest.map(|rest| rest.column))))
    }

    #[test]
    fn parts_of_a_time_are_joined() {
        for header in [
            "t_sec,t_nsec",
            "time_s,time_ns",
            "timestamp,timestamp_ns",
            "time,usec",
            "sec,nanosec",
            "secs,nsecs",
            "tv_sec,tv_usec",
            "header.stamp.sec,header.stamp.nanosec",
            "Time [s],Time [ns]",
            "time,ms",
        ] {
            assert_eq!(found(header), Ok(Some((0, Some(1)))), "{header}");
            let turned: Vec<_> = header.split(',').rev().collect();
            assert_eq!(found(&turned.join(",")), Ok(Some((1, Some(0)))), "{header}");
        }
    }

    #[test]
    fn of_two_times_none_is_ignored() {
        for header in ["t,time", "time_ms,stamp", "time_s,stamp_ns", "t,ms,us", "sec,nsec,usec", "time_ms,sec,nsec"] {
            assert!(found(header).is_err_and(|said| said.contains("both give the time")), "{header}");
        }
    }

    #[test]
    fn other_columns_are_no_times() {
        for (header, expected) in [
            ("x,y", None),
            ("sec,x", None),
            ("frame,x", Some((0, None))),
            ("frame,t", Some((1, None))),
            ("t,flight_sec,latency_ms,timestamp_sample", Some((0, None))),
        ] {
            assert_eq!(found(header), Ok(expected), "{header}");
        }
    }
}
