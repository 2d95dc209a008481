//! What the columns of a table mean, going by their names.
//!
//! A *long* table has a row for each vehicle and time, a *wide* one a row for each time. Names are compared without
//! regard to case, and a unit in brackets is left out.

use std::collections::BTreeMap;

use super::clock::TimeUnit;
use super::error::Fault;
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
    pub(super) shape: Shape,
    /// Names of columns that mean nothing here.
    pub(super) unused: Vec<String>,
}

/// Long or wide.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Long { id: usize, body: Body },
    Wide { names: Vec<String>, bodies: Vec<Body> },
}

/// What a column gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Quantity {
    Position(usize),
    Velocity(usize),
    Radius,
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl Quantity {
    fn words(self) -> String {
        match self {
            Self::Position(axis) => format!("the position along {}", AXES[axis]),
            Self::Velocity(axis) => format!("the velocity along {}", AXES[axis]),
            Self::Radius => "the radius".to_owned(),
        }
    }

    fn option(self) -> &'static str {
        match self {
            Self::Position(axis) => AXES[axis],
            Self::Velocity(axis) => ["vx", "vy", "vz"][axis],
            Self::Radius => "radius",
        }
    }

    /// The quantity of a plain name like `x`, `pos_x`, `vy` or `radius_m`.
    fn from_name(name: &str) -> Option<Self> {
        if matches!(name, "radius" | "radius_m") {
            return Some(Self::Radius);
        }
        AXES.iter().enumerate().find_map(|(axis, letter)| {
            let (position, velocity) =
                (["", "p", "pos_", "pos.", "position_", "position."], ["v", "vel_", "velocity_"]);
            let is = |starts: &[&str], ends: &[&str]| {
                starts.iter().any(|start| {
                    name.strip_prefix(start)
                        .and_then(|rest| rest.strip_prefix(letter))
                        .is_some_and(|end| ends.contains(&end))
                })
            };
            if is(&position, &["", "_m"]) {
                Some(Self::Position(axis))
            } else {
                is(&velocity, &["", "_m_s"]).then_some(Self::Velocity(axis))
            }
        })
    }
}

impl Layout {
    /// What the columns of this header mean.
    pub(super) fn of(header: &[String], given: &ColumnNames) -> Result<Self, Fault> {
        let plain: Vec<String> = header.iter().map(|name| plain(name)).collect();
        let missing = |role: &str, option| Fault::MissingColumn {
            role: role.to_owned(),
            option,
            columns: header.iter().filter(|name| !name.is_empty()).cloned().collect(),
        };
        let named = |name: &Option<String>, role: &str, option| match name {
            None => Ok(None),
            Some(name) => match header.iter().position(|column| column == name) {
                Some(column) => Ok(Some(column)),
                None => Err(missing(&format!("{role} with the name `{name}`"), option)),
            },
        };
        let first = |is: fn(&str) -> bool| plain.iter().position(|name| is(name));
        let time = named(&given.time, "time", "t")?.or_else(|| first(is_time)).ok_or_else(|| missing("time", "t"))?;
        let unit = plain[time].rsplit_once('_').and_then(|(_, unit)| TimeUnit::from_name(unit));
        let unit = unit.or_else(|| bracketed(&header[time]).and_then(TimeUnit::from_name));

        let mut columns = Columns { header, found: BTreeMap::new() };
        for (quantity, name) in given.quantities() {
            if let Some(column) = named(name, &quantity.words(), quantity.option())? {
                columns.found.insert((String::new(), quantity), column);
            }
        }
        let is_given = |quantity| given.quantities().iter().any(|(q, name)| *q == quantity && name.is_some());
        for (column, name) in plain.iter().enumerate().filter(|&(column, _)| column != time) {
            if let Some(quantity) = Quantity::from_name(name).filter(|&quantity| !is_given(quantity)) {
                columns.claim(String::new(), quantity, column)?;
            }
        }
        let id = named(&given.id, "the vehicle", "id")?.or_else(|| first(is_id));
        let mut used = vec![time];
        let shape = if let Some(id) = id {
            let body = columns.body("").map_err(|quantity| missing(&quantity.words(), quantity.option()))?;
            used.push(id);
            Shape::Long { id, body }
        } else {
            if columns.found.contains_key(&(String::new(), Quantity::Position(0))) {
                return Err(missing("the vehicle", "id"));
            }
            wide(&mut columns, &plain, time, &missing)?
        };
        used.extend(columns.found.values());
        let unused = |&(column, name): &(usize, &String)| !used.contains(&column) && !name.is_empty();
        let unused = header.iter().enumerate().filter(unused).map(|(_, name)| name.clone()).collect();
        Ok(Self { time, unit, shape, unused })
    }

    /// Time and then x, y and z of each vehicle; none where the columns do not come out even.
    pub(super) fn without_header(columns: usize) -> Option<Self> {
        if columns < 4 || !(columns - 1).is_multiple_of(3) {
            return None;
        }
        let bodies = (1..columns).step_by(3).map(|x| Body {
            position: [Some(x), Some(x + 1), Some(x + 2)],
            velocity: None,
            radius: None,
        });
        let names = (1..=(columns - 1) / 3).map(|number| number.to_string()).collect();
        let shape = Shape::Wide { names, bodies: bodies.collect() };
        Some(Self { time: 0, unit: None, shape, unused: Vec::new() })
    }

    /// The columns that are read, each once, in rising order.
    pub(super) fn columns(&self) -> Vec<usize> {
        let of = |body: &Body| {
            let velocity = body.velocity.unwrap_or_default();
            body.position.into_iter().chain(velocity).chain([body.radius]).flatten().collect::<Vec<_>>()
        };
        let mut columns = vec![self.time];
        match &self.shape {
            Shape::Long { id, body } => {
                columns.push(*id);
                columns.extend(of(body));
            }
            Shape::Wide { bodies, .. } => columns.extend(bodies.iter().flat_map(of)),
        }
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    /// What a person should know about the columns.
    pub(super) fn notes(&self) -> Vec<String> {
        let flat = match &self.shape {
            Shape::Long { body, .. } => body.position[2].is_none(),
            Shape::Wide { bodies, .. } => bodies.iter().any(|body| body.position[2].is_none()),
        };
        let flat = flat.then(|| "there is no column for z: it is taken as 0".to_owned());
        let unused = (!self.unused.is_empty()).then(|| format!("columns not used: {}", self.unused.join(", ")));
        flat.into_iter().chain(unused).collect()
    }
}

/// Columns found so far: of a vehicle by its name, or of all vehicles under no name.
struct Columns<'a> {
    header: &'a [String],
    found: BTreeMap<(String, Quantity), usize>,
}

impl Columns<'_> {
    fn claim(&mut self, vehicle: String, quantity: Quantity, column: usize) -> Result<(), Fault> {
        let of = if vehicle.is_empty() { String::new() } else { format!(" of `{vehicle}`") };
        match self.found.insert((vehicle, quantity), column) {
            None => Ok(()),
            Some(first) => Err(Fault::TwoColumns {
                role: quantity.words() + &of,
                first: self.header[first].clone(),
                second: self.header[column].clone(),
            }),
        }
    }

    /// The columns of a vehicle, or the quantity that is missing: x and y of its position, and its velocity along each
    /// axis of its position where it has one along some axis.
    fn body(&self, vehicle: &str) -> Result<Body, Quantity> {
        let get = |quantity| self.found.get(&(vehicle.to_owned(), quantity)).copied();
        let position = [0, 1, 2].map(|axis| get(Quantity::Position(axis)));
        if let Some(axis) = position[..2].iter().position(Option::is_none) {
            return Err(Quantity::Position(axis));
        }
        let velocity = [0, 1, 2].map(|axis| get(Quantity::Velocity(axis)));
        let moves = velocity.iter().any(Option::is_some);
        for axis in (0..3).filter(|_| moves) {
            match (position[axis], velocity[axis]) {
                (Some(_), None) => return Err(Quantity::Velocity(axis)),
                (None, Some(_)) => return Err(Quantity::Position(axis)),
                _ => {}
            }
        }
        Ok(Body { position, velocity: moves.then_some(velocity), radius: get(Quantity::Radius) })
    }
}

fn wide(
    columns: &mut Columns<'_>,
    plain: &[String],
    time: usize,
    missing: &dyn Fn(&str, &'static str) -> Fault,
) -> Result<Shape, Fault> {
    let mut names: Vec<String> = Vec::new();
    for (column, (name, plain)) in columns.header.iter().zip(plain).enumerate().filter(|&(column, _)| column != time) {
        if let Some((vehicle, quantity)) = vehicle_and_quantity(name, plain) {
            if !columns.found.keys().any(|(known, _)| *known == vehicle) {
                names.push(vehicle.clone());
            }
            columns.claim(vehicle, quantity, column)?;
        }
    }
    if names.is_empty() {
        return Err(missing("the vehicle and none for its position (as `id`, `x`, `y`, or as `x1`, `y1`)", "id"));
    }
    let body = |vehicle: &String| {
        columns
            .body(vehicle)
            .map_err(|quantity| missing(&format!("{} of vehicle `{vehicle}`", quantity.words()), quantity.option()))
    };
    let bodies = names.iter().map(body).collect::<Result<_, _>>()?;
    Ok(Shape::Wide { names, bodies })
}

/// Splits `x1`, `vx_2`, `cf1.x`, `leader/vy` or `drone3_z` into vehicle and quantity.
fn vehicle_and_quantity(name: &str, plain: &str) -> Option<(String, Quantity)> {
    let stem = plain.trim_end_matches(|c: char| c.is_ascii_digit());
    if stem.len() < plain.len() {
        let quantity = Quantity::from_name(stem.strip_suffix('_').unwrap_or(stem));
        return quantity.map(|quantity| (plain[stem.len()..].to_owned(), quantity));
    }
    // The name of the vehicle keeps its case.
    let name = name.split(['[', '(']).next()?.trim();
    name.char_indices().filter(|&(_, c)| matches!(c, '.' | '/' | '_')).find_map(|(at, _)| {
        let quantity = Quantity::from_name(&name[at + 1..].to_lowercase())?;
        (at > 0).then(|| (name[..at].to_owned(), quantity))
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

impl ColumnNames {
    fn quantities(&self) -> [(Quantity, &Option<String>); 7] {
        let [x, y, z] = &self.position;
        let [vx, vy, vz] = &self.velocity;
        [
            (Quantity::Position(0), x),
            (Quantity::Position(1), y),
            (Quantity::Position(2), z),
            (Quantity::Velocity(0), vx),
            (Quantity::Velocity(1), vy),
            (Quantity::Velocity(2), vz),
            (Quantity::Radius, &self.radius),
        ]
    }
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
        assert_eq!(layout.shape, Shape::Long { id: 2, body });
        assert_eq!(layout.unused, ["battery"]);
    }

    #[test]
    fn what_moves_in_a_plane_needs_no_velocity_along_z() {
        let Shape::Long { body, .. } = layout("t,id,x,y,vx,vy").expect("a layout").shape else { panic!("wide") };
        assert_eq!((body.position[2], body.velocity), (None, Some([Some(4), Some(5), None])));
    }

    #[test]
    fn wide_headers_are_read_by_number_and_by_name() {
        for (header, vehicles) in [
            ("t,x1,y1,z1,x2,y2,z2", ["1", "2"]),
            ("t (s),cf1.x,cf1.y,cf1.z,Leader.x,Leader.y,Leader.z", ["cf1", "Leader"]),
            ("t,a_b_x,a_b_y,a_b_z,c/x,c/y,c/z", ["a_b", "c"]),
        ] {
            let Shape::Wide { names, bodies } = layout(header).expect("a layout").shape else { panic!("{header}") };
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
