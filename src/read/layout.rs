//! What the columns of a table mean, going by their names.
//!
//! A *long* table has a row for each vehicle and time, a *wide* one a row for each time. Names are compared without
//! regard to case, and a unit in brackets is left out.

use std::collections::{BTreeMap, BTreeSet};

use super::clock::TimeUnit;
use super::error::{Fault, quoted};
use super::options::ColumnNames;

/// The columns of a position, and of what else is known of a vehicle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Body {
    /// x, y and z, if there is one.
    pub(super) position: [Option<usize>; 3],
    pub(super) velocity: Option<[Option<usize>; 3]>,
    pub(super) radius: Option<usize>,
}

/// The columns of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) time: usize,
    /// The unit in the name of the column of time.
    pub(super) unit: Option<TimeUnit>,
    /// The column of the vehicle in a long table.
    pub(super) id: Option<usize>,
    /// The vehicles of a wide table by name; none of a long one.
    pub(super) names: Vec<String>,
    /// The columns of each vehicle of a wide table, or of every row of a long one.
    pub(super) bodies: Vec<Body>,
    /// Names of columns that mean nothing here.
    pub(super) unused: Vec<String>,
}

/// What a column gives: its place among [`ColumnNames::ROLES`]. Axes follow each other.
type Role = usize;
const TIME: Role = 0;
const ID: Role = 1;
const POSITION: Role = 2;
const VELOCITY: Role = 5;
const RADIUS: Role = 8;

const WORDS: [&str; 9] = [
    "time",
    "the vehicle",
    "the position along x",
    "the position along y",
    "the position along z",
    "the velocity along x",
    "the velocity along y",
    "the velocity along z",
    "the radius",
];

/// The quantity of a plain name like `x`, `pos_x`, `vy` or `radius_m`.
fn quantity(name: &str) -> Option<Role> {
    if matches!(name, "radius" | "radius_m") {
        return Some(RADIUS);
    }
    let is = |starts: &[&str], axis: &str, ends: &[&str]| {
        let after = |start: &&str| name.strip_prefix(start)?.strip_prefix(axis);
        starts.iter().filter_map(after).any(|end| ends.contains(&end))
    };
    ["x", "y", "z"].into_iter().enumerate().find_map(|(place, axis)| {
        if is(&["", "p", "pos_", "pos.", "position_", "position."], axis, &["", "_m"]) {
            Some(POSITION + place)
        } else {
            is(&["v", "vel_", "velocity_"], axis, &["", "_m_s"]).then_some(VELOCITY + place)
        }
    })
}

fn missing(header: &[String], role: Role, of: &str) -> Fault {
    let problem = format!("there is no column for {}{of}; its columns are {}", WORDS[role], list(header));
    let option = ColumnNames::ROLES[role];
    Fault::content(problem, format!("name the column with --column {option}=NAME, or put it into the header"))
}

impl Layout {
    /// What the columns of this header mean.
    pub(super) fn of(header: &[String], given: &ColumnNames) -> Result<Self, Fault> {
        let plain: Vec<String> = header.iter().map(|name| plain(name)).collect();
        let mut columns = Columns { header, found: BTreeMap::new() };
        for (role, name) in given.given() {
            let column = header.iter().position(|column| column == name);
            let column = column.ok_or_else(|| missing(header, role, &format!(" with the name `{name}`")))?;
            columns.found.insert((String::new(), role), column);
        }
        let first = |is: fn(&str) -> bool| plain.iter().position(|name| is(name));
        let time = columns.get("", TIME).or_else(|| first(is_time)).ok_or_else(|| missing(header, TIME, ""))?;
        let unit = plain[time].rsplit_once('_').and_then(|(_, unit)| TimeUnit::from_name(unit));
        let unit = unit.or_else(|| bracketed(&header[time]).and_then(TimeUnit::from_name));
        let id = columns.get("", ID).or_else(|| first(is_id));
        for (column, name) in plain.iter().enumerate().filter(|&(column, _)| column != time) {
            if let Some(role) = quantity(name).filter(|&role| given.given().all(|(known, _)| known != role)) {
                columns.claim(String::new(), role, column)?;
            }
        }
        let names = match id {
            Some(_) => Vec::new(),
            None if columns.get("", POSITION).is_some() => return Err(missing(header, ID, "")),
            None => columns.claim_wide(&plain, time)?,
        };
        let everyone = [String::new()];
        let bodies = if id.is_some() { &everyone[..] } else { &names };
        let bodies = bodies.iter().map(|vehicle| columns.body(vehicle)).collect::<Result<_, _>>()?;
        let used: BTreeSet<usize> = columns.found.values().copied().chain([time]).chain(id).collect();
        let unused = (0..header.len()).filter(|column| !used.contains(column) && !header[*column].is_empty());
        let unused = unused.map(|column| header[column].clone()).collect();
        Ok(Self { time, unit, id, names, bodies, unused })
    }

    /// Time and then x, y and z of each vehicle; none where the columns do not come out even.
    pub(super) fn without_header(columns: usize) -> Option<Self> {
        if columns < 4 || !(columns - 1).is_multiple_of(3) {
            return None;
        }
        let body = |x| Body { position: [Some(x), Some(x + 1), Some(x + 2)], velocity: None, radius: None };
        let bodies = (1..columns).step_by(3).map(body).collect();
        let names = (1..=(columns - 1) / 3).map(|number| number.to_string()).collect();
        Some(Self { time: 0, unit: None, id: None, names, bodies, unused: Vec::new() })
    }

    /// The columns that are read, each once, in rising order.
    pub(super) fn columns(&self) -> Vec<usize> {
        let of = |body: &Body| {
            let velocity = body.velocity.unwrap_or_default();
            body.position.into_iter().chain(velocity).chain([body.radius]).flatten()
        };
        let columns: BTreeSet<_> = self.bodies.iter().flat_map(of).chain([self.time]).chain(self.id).collect();
        columns.into_iter().collect()
    }

    /// What a person should know about the columns.
    pub(super) fn notes(&self) -> Vec<String> {
        let flat = self.bodies.iter().any(|body| body.position[2].is_none());
        let flat = flat.then(|| "there is no column for z: it is taken as 0".to_owned());
        let unused = (!self.unused.is_empty()).then(|| format!("columns not used: {}", self.unused.join(", ")));
        flat.into_iter().chain(unused).collect()
    }
}

/// Columns found so far: of a vehicle by its name, or of all vehicles under no name.
struct Columns<'a> {
    header: &'a [String],
    found: BTreeMap<(String, Role), usize>,
}

impl Columns<'_> {
    fn get(&self, vehicle: &str, role: Role) -> Option<usize> {
        self.found.get(&(vehicle.to_owned(), role)).copied()
    }

    fn claim(&mut self, vehicle: String, role: Role, column: usize) -> Result<(), Fault> {
        let of = if vehicle.is_empty() { String::new() } else { format!(" of `{vehicle}`") };
        let Some(first) = self.found.insert((vehicle, role), column) else { return Ok(()) };
        let (first, second) = (&self.header[first], &self.header[column]);
        let problem = format!("the columns `{first}` and `{second}` both give {}{of}", WORDS[role]);
        Err(Fault::content(problem, "name the one that is meant with --column, or take the other out"))
    }

    /// Finds the vehicles of a wide table, and gives their names in order of appearance.
    fn claim_wide(&mut self, plain: &[String], time: usize) -> Result<Vec<String>, Fault> {
        let mut names: Vec<String> = Vec::new();
        for (column, (name, plain)) in self.header.iter().zip(plain).enumerate().filter(|&(column, _)| column != time) {
            let Some((vehicle, role)) = vehicle_and_quantity(name, plain) else { continue };
            let known = self.found.range((vehicle.clone(), 0)..).next();
            if known.is_none_or(|((known, _), _)| *known != vehicle) {
                names.push(vehicle.clone());
            }
            self.claim(vehicle, role, column)?;
        }
        if names.is_empty() {
            let of = " and none for its position (as `id`, `x`, `y`, or as `x1`, `y1`)";
            return Err(missing(self.header, ID, of));
        }
        Ok(names)
    }

    /// The columns of a vehicle: at least x and y of its position, and its velocity along each axis of its position where
    /// it has one along some axis.
    fn body(&self, vehicle: &str) -> Result<Body, Fault> {
        let of = if vehicle.is_empty() { String::new() } else { format!(" of vehicle `{vehicle}`") };
        let axes = |role| [0, 1, 2].map(|axis| self.get(vehicle, role + axis));
        let (position, velocity) = (axes(POSITION), axes(VELOCITY));
        let moves = velocity.iter().any(Option::is_some);
        for axis in 0..3 {
            let lacks = match (position[axis], velocity[axis]) {
                (None, moving) if axis < 2 || moving.is_some() => POSITION,
                (Some(_), None) if moves => VELOCITY,
                _ => continue,
            };
            return Err(missing(self.header, lacks + axis, &of));
        }
        Ok(Body { position, velocity: moves.then_some(velocity), radius: self.get(vehicle, RADIUS) })
    }
}

/// The first dozen of some columns.
fn list(names: &[String]) -> String {
    const SHOWN: usize = 12;
    let names: Vec<_> = names.iter().filter(|name| !name.is_empty()).map(|name| quoted(name)).collect();
    match names.len() {
        0 => "none".to_owned(),
        count if count > SHOWN => format!("{} and {} more", names[..SHOWN].join(", "), count - SHOWN),
        _ => names.join(", "),
    }
}

/// Splits `x1`, `vx_2`, `cf1.x`, `leader/vy` or `drone3_z` into vehicle and quantity.
fn vehicle_and_quantity(name: &str, plain: &str) -> Option<(String, Role)> {
    let stem = plain.trim_end_matches(|c: char| c.is_ascii_digit());
    if stem.len() < plain.len() {
        return Some((plain[stem.len()..].to_owned(), quantity(stem.strip_suffix('_').unwrap_or(stem))?));
    }
    // The name of the vehicle keeps its case.
    let name = name.split(['[', '(']).next()?.trim();
    name.char_indices().filter(|&(_, c)| matches!(c, '.' | '/' | '_')).find_map(|(at, _)| {
        let role = quantity(&name[at + 1..].to_lowercase())?;
        (at > 0).then(|| (name[..at].to_owned(), role))
    })
}

/// The name in lower case, without blanks around it and without a unit in brackets.
fn plain(name: &str) -> String {
    name.split(['[', '(']).next().unwrap_or_default().trim().to_lowercase()
}

/// What stands in brackets.
fn bracketed(name: &str) -> Option<&str> {
    let (_, rest) = name.split_once(['[', '('])?;
    rest.split([']', ')']).next().map(str::trim)
}

fn is_time(name: &str) -> bool {
    let stem = match name.rsplit_once('_') {
        Some((stem, unit)) if TimeUnit::from_name(unit).is_some() => stem,
        _ => name,
    };
    matches!(stem, "t" | "time" | "timestamp" | "stamp")
}

fn is_id(name: &str) -> bool {
    matches!(name, "id" | "name" | "vehicle" | "vehicle_id" | "drone" | "drone_id" | "uav" | "agent" | "robot")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(header: &str) -> Result<Layout, Fault> {
        let header: Vec<_> = header.split(',').map(str::to_owned).collect();
        Layout::of(&header, &ColumnNames::default())
    }

    fn at(columns: [usize; 3]) -> [Option<usize>; 3] {
        columns.map(Some)
    }

    #[test]
    fn a_long_header_is_read_in_any_order() {
        let layout = layout("z,Y [m],id,x,time_ms,vx,vy,vz,battery").expect("a layout");
        let body = Body { position: at([3, 1, 0]), velocity: Some(at([5, 6, 7])), radius: None };
        assert_eq!((layout.time, layout.unit), (4, Some(TimeUnit::Milliseconds)));
        assert_eq!((layout.id, layout.bodies), (Some(2), vec![body]));
        assert_eq!(layout.unused, ["battery"]);
    }

    #[test]
    fn what_moves_in_a_plane_needs_no_velocity_along_z() {
        let body = layout("t,id,x,y,vx,vy").expect("a layout").bodies.remove(0);
        assert_eq!((body.position[2], body.velocity), (None, Some([Some(4), Some(5), None])));
    }

    #[test]
    fn wide_headers_are_read_by_number_and_by_name() {
        for (header, vehicles) in [
            ("t,x1,y1,z1,x2,y2,z2", ["1", "2"]),
            ("t (s),cf1.x,cf1.y,cf1.z,Leader.x,Leader.y,Leader.z", ["cf1", "Leader"]),
            ("t,a_b_x,a_b_y,a_b_z,c/x,c/y,c/z", ["a_b", "c"]),
        ] {
            let Layout { id: None, names, bodies, .. } = layout(header).expect("a layout") else { panic!("{header}") };
            assert_eq!(names, vehicles, "{header}");
            assert_eq!([bodies[0].position, bodies[1].position], [at([1, 2, 3]), at([4, 5, 6])], "{header}");
        }
    }

    #[test]
    fn what_is_missing_or_double_is_named() {
        let fault = |header: &str| layout(header).expect_err("refused").to_string();
        assert!(fault("id,x,y,z").contains("for time"));
        assert!(fault("t,x,y,z").contains("for the vehicle"));
        assert!(fault("t,id,x,z").contains("along y"));
        assert!(fault("t,x1,y1,z1,x2,z2").contains("along y of vehicle `2`"));
        assert!(fault("t,id,x,y,z,vx,vy").contains("velocity along z"));
        assert!(fault("t,id,x,y,z,vz").contains("velocity along x"));
        assert!(fault("t,id,x,y,vx,vy,vz").contains("position along z"));
        assert!(fault("t,a.x,a.y,a.z,a.vx,a.vy").contains("velocity along z of vehicle `a`"));
        assert!(fault("t,id,x,y,pos_x").contains("`x` and `pos_x` both give the position along x"));
    }
}
