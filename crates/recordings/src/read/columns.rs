//! Which column of a table gives what, as far as it is found.

use std::collections::{BTreeMap, BTreeSet};

use super::error::{Fault, list, quoted};
use super::heading::{self, EARTH, Heading, ID, POSITION, RADIUS, Role, TIME, VELOCITY, is_angle, is_velocity};
use super::heights::Heights;
use super::options::{ColumnNames, ReadOptions};
use super::turned;
use super::units;

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
            let ending = || units::endings(name).find(|(_, _, velocity)| *velocity == is_velocity(role));
            let unit = units::bracketed(name).1.or_else(|| ending().map(|(_, unit, _)| unit));
            let unit = unit.filter(|unit| is_angle(role) || units::size_of(unit, is_velocity(role)).is_some());
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
            turned::refuse_turned_height(options, &self.header[first])?;
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
        Err(Fault::coded(
            "recording/ambiguous-column",
            problem,
            "name the one that is meant with --column, or take the other out",
        ))
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
            return Err(Fault::coded(
                "recording/ambiguous-column",
                problem,
                "give the column a longer name, or take it out",
            ));
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
                metres[column] = units::degrees(unit).ok_or_else(|| {
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
            let size = units::size_of(unit, is_velocity(role)).ok_or_else(|| {
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
            return Err(Fault::coded(
                "recording/unit-conflict",
                problem,
                "write the unit of each column into its name, as in `x [mm]`",
            ));
        }
        if scale != 1.0 {
            let problem = format!("column {other} says its unit, and --scale {scale} another");
            return Err(Fault::coded(
                "recording/contradicts-option",
                problem,
                "leave --scale away, or take the units out of the header",
            ));
        }
        Ok(metres)
    }
}
