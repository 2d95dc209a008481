//! NPZ archives of `NumPy` arrays.
//!
//! | array | shape | holds |
//! | --- | --- | --- |
//! | `t` | T | times, as numbers or `datetime64` |
//! | `positions` | T x N x 3, or N x T x 3 | positions; two columns instead of three are a plane |
//! | `velocities` | as `positions` | velocities, if there are any |
//! | `radii` | N, or T x N | radii, if there are any; NaN where unknown |
//! | `names` | N | names, if there are any |
//! | `seen` | T x N | whether a vehicle was seen; where it was not, its position means nothing |
//! | `axes` | 1 to 3 | names of the axes: `time` first or `vehicle` first, if it is said |
//! | `epoch_ns` | 1 or no axis | what `t` counts from |
//!
//! Arrays whose first axis is time are streamed; others are in memory.

use nalgebra::Vector3;

use super::archive::Archive;
use super::clock::Stamp;
use super::error::{Fault, Place, ReadError};
use super::names::Names;
use super::npy::Array;
use super::order::{BATCH, Ordered, Row, Rows};
use super::source::Source;
use super::{AxisOrder, ReadOptions, Recording, TimeUnit};

const TIMES: [&str; 4] = ["t", "time", "times", "timestamps"];
const POSITIONS: [&str; 4] = ["positions", "position", "pos", "xyz"];

/// Opens an archive.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let mut arrays = Arrays::open(source)?;
    let time = options.columns.time.clone().or_else(|| arrays.first_of(&TIMES));
    let time = time.filter(|name| arrays.holds(name)).ok_or_else(|| arrays.missing("times", "t"))?;
    let positions = options.columns.position[0].clone().or_else(|| arrays.first_of(&POSITIONS));
    let positions =
        positions.filter(|name| arrays.holds(name)).ok_or_else(|| arrays.missing("positions", "positions"))?;

    let mut stamps = arrays.array(&time)?;
    let unit = stamps.unit().or_else(|| time.rsplit_once('_').and_then(|(_, unit)| TimeUnit::from_name(unit)));
    let mut times = Vec::new();
    for k in 0..stamps.count() {
        let stamp = stamps.next_stamp().and_then(|stamp| match stamp {
            Stamp::Real(time) if !time.is_finite() => {
                Err(Fault::content(format!("it is {time}"), "times are finite: take the instant out"))
            }
            stamp => Ok(stamp),
        });
        times.push(stamp.map_err(|fault| source.error(fault).at(Place::Part(format!("{time}[{k}]"))))?);
    }
    let axes = arrays.optional("axes", |arrays| arrays.texts("axes"))?;
    let order = options.axis_order.or_else(|| match axes?.first()?.as_str() {
        "time" => Some(AxisOrder::TimeFirst),
        "vehicle" => Some(AxisOrder::VehicleFirst),
        _ => None,
    });
    let table = arrays.table(&positions, times.len(), order)?;
    let velocities = arrays.optional("velocities", |arrays| arrays.table("velocities", times.len(), order))?;
    let seen = arrays.optional("seen", |arrays| arrays.array("seen"))?;
    let radii = arrays.optional("radii", |arrays| arrays.radii(times.len(), table.vehicles))?;
    let names = arrays.optional("names", |arrays| arrays.texts("names"))?;
    let epoch_ns = arrays
        .optional("epoch_ns", |arrays| arrays.array("epoch_ns")?.next_stamp().map_err(|fault| source.error(fault)))?;

    let (vehicles, axes) = (table.vehicles, table.axes);
    let fits = |name: &str, found: usize, expected: usize| {
        let problem = format!("`{name}` has {found} elements where {expected} belong to `{positions}`");
        let fault = Fault::content(problem, "save arrays of one recording together");
        if found == expected { Ok(()) } else { Err(source.error(fault)) }
    };
    fits("seen", seen.as_ref().map_or(times.len() * vehicles, Array::count), times.len() * vehicles)?;
    fits("names", names.as_ref().map_or(vehicles, Vec::len), vehicles)?;
    if let Some(table) = &velocities {
        fits("velocities", table.vehicles * table.axes, vehicles * axes)?;
    }
    let names = names.map_or_else(Names::default, Names::from_list);
    let mut notes = Vec::new();
    if axes == 2 {
        notes.push("positions have two columns: z is taken as 0".to_owned());
    }
    let rows =
        Instants { source: source.clone(), name: positions, times, at: 0, table, velocities, seen, radii, names };
    let none = Fault::content("it holds no position", "save at least one instant of one vehicle");
    let mut about = options.about(unit, notes, none);
    if let Some(Stamp::Whole(epoch)) = epoch_ns {
        about.epoch_ns = epoch;
    }
    Ok(Box::new(Ordered::open(rows, about)?))
}

/// The arrays of an archive.
struct Arrays {
    source: Source,
    archive: Archive,
}

impl Arrays {
    fn open(source: &Source) -> Result<Self, ReadError> {
        Ok(Self { source: source.clone(), archive: Archive::open(source)? })
    }

    fn holds(&self, name: &str) -> bool {
        self.archive.holds(&format!("{name}.npy"))
    }

    fn first_of(&self, names: &[&str]) -> Option<String> {
        let units = TimeUnit::ALL.map(|unit| format!("_{}", unit.name()));
        let ends = std::iter::once("").chain(units.iter().map(String::as_str));
        let mut candidates = ends.flat_map(|end| names.iter().map(move |name| format!("{name}{end}")));
        candidates.find(|name| self.holds(name))
    }

    fn missing(&self, role: &str, usual: &str) -> ReadError {
        let names = self.archive.names();
        let names: Vec<_> =
            names.iter().filter_map(|name| name.strip_suffix(".npy")).map(super::error::quoted).collect();
        let option = if usual == "t" { "t" } else { "x" };
        let problem = format!("there is no array of {role}; its arrays are {}", names.join(", "));
        let remedy = format!("save it as `{usual}`, or name it with --column {option}=NAME");
        self.source.error(Fault::content(problem, remedy))
    }

    fn at<'a>(&'a self, name: &'a str) -> impl Fn(Fault) -> ReadError + 'a {
        move |fault| self.source.error(fault).at(Place::Part(format!("array `{name}`")))
    }

    fn array(&mut self, name: &str) -> Result<Array, ReadError> {
        let bytes = self.archive.entry(&format!("{name}.npy"))?;
        Array::open(bytes).map_err(self.at(name))
    }

    fn optional<T>(
        &mut self,
        name: &str,
        read: impl FnOnce(&mut Self) -> Result<T, ReadError>,
    ) -> Result<Option<T>, ReadError> {
        if self.holds(name) { read(self).map(Some) } else { Ok(None) }
    }

    fn radii(&mut self, times: usize, vehicles: usize) -> Result<Radii, ReadError> {
        let mut array = self.array("radii")?;
        if array.shape == [times, vehicles] && !array.fortran_order {
            return Ok(Radii::Each(array));
        }
        if array.shape != [vehicles] {
            let problem = format!("it is of shape {:?}", array.shape);
            let fault = Fault::content(problem, "save a radius for each vehicle, or for each time and vehicle");
            return Err(self.at("radii")(fault));
        }
        let radii = (0..vehicles).map(|_| array.next_number()).collect::<Result<_, _>>();
        radii.map(Radii::Same).map_err(self.at("radii"))
    }

    fn texts(&mut self, name: &str) -> Result<Vec<String>, ReadError> {
        let mut array = self.array(name)?;
        let mut texts = Vec::new();
        for _ in 0..array.count() {
            texts.push(array.next_text().map_err(self.at(name))?);
        }
        Ok(texts)
    }

    /// An array of vectors with `times` instants.
    fn table(&mut self, name: &str, times: usize, order: Option<AxisOrder>) -> Result<Table, ReadError> {
        let mut array = self.array(name)?;
        let at = self.at(name);
        let &[first, second, axes @ (2 | 3)] = array.shape.as_slice() else {
            let problem = format!("it is of shape {:?}", array.shape);
            return Err(at(Fault::content(problem, "save positions as T x N x 3 or N x T x 3")));
        };
        if array.count() == 0 {
            let problem = format!("it is of shape {:?}, which holds nothing", array.shape);
            return Err(at(Fault::content(problem, "save at least one instant of one vehicle")));
        }
        let order = match (order, first == times, second == times) {
            (Some(AxisOrder::TimeFirst), true, _) | (None, true, false) => AxisOrder::TimeFirst,
            (Some(AxisOrder::VehicleFirst), _, true) | (None, false, true) => AxisOrder::VehicleFirst,
            (None, true, true) => {
                let problem =
                    format!("it is of shape {:?}, and there are {times} times: either axis may be time", array.shape);
                let remedy = "name the first axis with --axis-order time-first or --axis-order vehicle-first";
                return Err(at(Fault::content(problem, remedy)));
            }
            _ => {
                let problem = format!("it is of shape {:?}, and there are {times} times", array.shape);
                return Err(at(Fault::content(problem, "save as many instants as times")));
            }
        };
        let vehicles = if order == AxisOrder::TimeFirst { second } else { first };
        if order == AxisOrder::TimeFirst && !array.fortran_order {
            return Ok(Table { vehicles, axes, numbers: Numbers::Streamed(array) });
        }
        let count = array.count();
        let mut stored = Vec::new();
        for _ in 0..count {
            stored.push(array.next_number().map_err(&at)?);
        }
        let index = |k: usize, i: usize, axis: usize| {
            let (a, b) = if order == AxisOrder::TimeFirst { (k, i) } else { (i, k) };
            if array.fortran_order { a + first * (b + second * axis) } else { (a * second + b) * axes + axis }
        };
        let instants =
            (0..times).flat_map(|k| (0..vehicles).flat_map(move |i| (0..axes).map(move |axis| (k, i, axis))));
        let sorted: Vec<f64> = instants.map(|(k, i, axis)| stored[index(k, i, axis)]).collect();
        Ok(Table { vehicles, axes, numbers: Numbers::Sorted(sorted.into_iter()) })
    }
}

/// Vectors of all vehicles, instant by instant.
struct Table {
    vehicles: usize,
    axes: usize,
    numbers: Numbers,
}

enum Numbers {
    Streamed(Array),
    Sorted(std::vec::IntoIter<f64>),
}

impl Table {
    fn next_vector(&mut self) -> Result<Vector3<f64>, Fault> {
        let mut vector = Vector3::zeros();
        for axis in 0..self.axes {
            vector[axis] = match &mut self.numbers {
                Numbers::Streamed(array) => array.next_number()?,
                Numbers::Sorted(numbers) => numbers.next().unwrap_or(f64::NAN),
            };
        }
        Ok(vector)
    }
}

/// Radii of the vehicles, NaN where unknown.
enum Radii {
    /// The same at all times.
    Same(Vec<f64>),
    /// Of each time and vehicle.
    Each(Array),
}

impl Radii {
    fn next(&mut self, vehicle: usize) -> Result<Option<f64>, Fault> {
        let radius = match self {
            Self::Same(radii) => radii[vehicle],
            Self::Each(array) => array.next_number()?,
        };
        if radius.is_nan() || (radius >= 0.0 && radius.is_finite()) {
            return Ok(Some(radius).filter(|radius| !radius.is_nan()));
        }
        Err(Fault::content(format!("the radius is {radius}"), "radii are finite and 0 or more, or NaN where unknown"))
    }
}

/// The rows of an archive.
struct Instants {
    source: Source,
    /// Name of the array of positions.
    name: String,
    times: Vec<Stamp>,
    /// Number of the next instant.
    at: usize,
    table: Table,
    velocities: Option<Table>,
    seen: Option<Array>,
    radii: Option<Radii>,
    names: Names,
}

impl Instants {
    fn row(&mut self, stamp: Stamp, vehicle: usize) -> Result<Option<Row>, Fault> {
        let position = self.table.next_vector()?;
        let velocity = self.velocities.as_mut().map(Table::next_vector).transpose()?;
        let radius = self.radii.as_mut().map(|radii| radii.next(vehicle)).transpose()?.flatten();
        let seen = self.seen.as_mut().map(Array::next_number).transpose()?.is_none_or(|seen| seen != 0.0);
        if !seen {
            return Ok(None);
        }
        if let Some(odd) = position.iter().find(|x| !x.is_finite()) {
            let remedy = "save an array `seen` of T x N booleans that is false where a vehicle was not seen";
            return Err(Fault::content(format!("the position holds {odd}"), remedy));
        }
        // A vehicle without a velocity has NaN among those with one.
        let velocity = velocity.filter(|velocity| !velocity.iter().all(|x| x.is_nan()));
        if velocity.is_some_and(|velocity| velocity.iter().any(|x| !x.is_finite())) {
            return Err(Fault::content(
                "the velocity is not finite",
                "velocities are finite, or all NaN where unknown",
            ));
        }
        let place = (self.at * self.table.vehicles + vehicle) as u64;
        Ok(Some(Row { stamp, place, vehicle, position, velocity, radius }))
    }
}

impl Rows for Instants {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH {
            let Some(&stamp) = self.times.get(self.at) else { break };
            for vehicle in 0..self.table.vehicles {
                let row = self.row(stamp, vehicle).map_err(|fault| {
                    let place = self.place((self.at * self.table.vehicles + vehicle) as u64);
                    self.source.error(fault).at(place)
                })?;
                rows.extend(row);
            }
            if self.names.all().is_empty() {
                // So many have really been read: the shape is no longer a claim.
                self.names = Names::numbered(self.table.vehicles);
            }
            self.at += 1;
        }
        Ok(rows.len() > before)
    }

    /// Time only runs forwards here, so that the rows are read once.
    fn rewind(&mut self) -> Result<(), ReadError> {
        Ok(())
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn settle_names(&mut self) {}

    fn error(&self, fault: Fault) -> ReadError {
        self.source.error(fault)
    }

    fn place(&self, number: u64) -> Place {
        let vehicles = self.table.vehicles.max(1) as u64;
        Place::Part(format!("{}[{}, {}]", self.name, number / vehicles, number % vehicles))
    }

    fn is_wide(&self) -> bool {
        true
    }
}
