//! Reads NPZ archives of `NumPy` arrays.
//!
//! | array | shape | holds |
//! | --- | --- | --- |
//! | `t` | T | times, as numbers or `datetime64` |
//! | `positions` | T x N x 3, or its axes in another order | positions; two axes instead of three are a plane |
//! | `velocities` | as `positions` | velocities, optional |
//! | `radii` | N, or `positions` without its axis of x, y, z | radii, optional; NaN if unknown |
//! | `names` | N | distinct names, optional |
//! | `seen` | `positions` without its axis of x, y, z | whether a vehicle was seen; if not, its position is ignored |
//! | `axes` | 1 to 3 | meaning of the axes, optional: `time`, `vehicle`, and `axis` (or `xyz`) |
//! | `epoch_ns` | 1 or no axis | epoch of `t` \[ns\] |
//!
//! If the shape is ambiguous (3 x 3 x 3, or T x 3 x 2), neither `--layout` nor `axes` decides, the archive is refused.
//! Arrays in the usual order are streamed; others are read into memory.

use nalgebra::Vector3;

use super::clock::Stamp;
use super::error::{ContentKind, Fault, Place, ReadError, one_of, quoted, refuse};
use super::identity::Names;
use super::npy::Array;
use super::options::{ArrayAxis, ArrayLayout, ReadOptions};
use super::order::{Ordered, PLANAR, Recording, RecordingInfo, Row, Rows};
use super::source::{Archive, Source};
use super::time_unit::TimeUnit;
use tautline_core::option::{COLUMN, LAYOUT};

const TIMES: [&str; 4] = ["t", "time", "times", "timestamps"];
const POSITIONS: [&str; 4] = ["positions", "position", "pos", "xyz"];

/// Opens an archive.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let source = &source.clone().seekable()?;
    let mut arrays = Arrays { archive: Archive::open(&source.path)? };
    let time = arrays.of_role(options, "t", &TIMES, ContentKind::NoTimeColumn)?;
    let positions = arrays.of_role(options, "x", &POSITIONS, ContentKind::NoPositionColumn)?;
    let mut stamps = arrays.array(&time)?;
    let unit = stamps.unit().or_else(|| time.rsplit_once('_').and_then(|(_, unit)| TimeUnit::from_name(unit)));
    let mut times = Vec::new();
    for k in 0..stamps.count() {
        let stamp = stamps.next_stamp().and_then(|stamp| match stamp {
            Stamp::Real(time) if !time.is_finite() => refuse(
                ContentKind::NotFinite,
                format!("the time is {time}"),
                "remove the instant: times must be finite",
            ),
            stamp => Ok(stamp),
        });
        times.push(stamp.map_err(|fault| fault.at(Place::Part(format!("{time}[{k}]"))))?);
    }
    let axes = arrays.optional("axes", |arrays| arrays.texts("axes"))?.unwrap_or_default();
    let mut known_axes = options.layout.map_or_else(|| axes.iter().map_while(|name| axis(name)).collect(), Vec::from);
    if known_axes.is_empty() {
        known_axes.extend(options.usual_layout.iter().flatten());
    }
    let table = arrays.table(&positions, times.len(), &known_axes)?;
    let velocities = arrays.optional("velocities", |arrays| arrays.like(&table, "velocities", true))?;
    let seen = arrays.optional("seen", |arrays| arrays.like(&table, "seen", false))?;
    let radii = arrays.optional("radii", |arrays| arrays.radii(&table))?;
    let names = arrays.optional("names", |arrays| arrays.names(table.vehicles()))?;
    let epoch_ns = arrays.optional("epoch_ns", |arrays| Ok(arrays.array("epoch_ns")?.next_stamp()?))?;

    let is_planar = table.axes() == 2;
    let notes = is_planar.then(|| format!("positions have two axes and no height: {PLANAR}")).into_iter().collect();
    let names = names.unwrap_or_default();
    let rows = Instants { name: positions, times, at: 0, table, velocities, seen, radii, names };
    let none = Fault::content(ContentKind::Empty, "it holds no position", "save at least one instant of one vehicle");
    let mut info = RecordingInfo::new(source, options, unit, notes, none);
    info.metadata.is_planar = is_planar;
    if let Some(Stamp::Whole(epoch)) = epoch_ns {
        info.epoch_ns = epoch;
    }
    Ok(Box::new(Ordered::open(rows, info)?))
}

/// Returns the meaning of an axis by its name in the archive.
fn axis(name: &str) -> Option<ArrayAxis> {
    match name {
        "time" => Some(ArrayAxis::Time),
        "vehicle" => Some(ArrayAxis::Vehicle),
        "axis" | "xyz" | "xy" => Some(ArrayAxis::Axis),
        _ => None,
    }
}

/// Returns the layout of an array of positions with this shape and number of times; `known_axes` holds the known
/// leading axes. Only lengths distinguish the axes, so that several layouts may fit: then the array is refused.
fn layout(shape: [usize; 3], times: usize, known_axes: &[ArrayAxis]) -> Result<ArrayLayout, Fault> {
    let fits = |layout: &ArrayLayout| {
        layout.starts_with(known_axes)
            && layout.iter().zip(shape).all(|(axis, length)| match axis {
                ArrayAxis::Time => length == times,
                ArrayAxis::Axis => matches!(length, 2 | 3),
                ArrayAxis::Vehicle => true,
            })
    };
    let fitting: Vec<_> = ArrayAxis::LAYOUTS.into_iter().filter(fits).collect();
    let problem = |what: &str| format!("its shape is {shape:?}, and there are {times} times{what}");
    match fitting[..] {
        // If the last axis is not x, y, z, an axis of two or three vehicles could be it.
        [only] if only[2] == ArrayAxis::Axis || !known_axes.is_empty() => Ok(only),
        [] => {
            let remedy = format!(
                "save T x N x 3 positions, with T the number of times, or name the axes with {LAYOUT}, such as {}",
                LAYOUT.set("time,vehicle,axis")
            );
            refuse(ContentKind::ArrayShape, problem(""), remedy)
        }
        _ => {
            let ways: Vec<_> = fitting.iter().map(|layout| ArrayAxis::layout_name(*layout)).collect();
            let remedy = format!("name its axes with {}", one_of(LAYOUT, &ways));
            refuse(ContentKind::AmbiguousLayout, problem("; several layouts fit"), remedy)
        }
    }
}

/// Arrays of an archive.
struct Arrays {
    archive: Archive,
}

/// Returns a function that adds the name of an array to a fault.
fn in_array(name: &str) -> impl Fn(Fault) -> ReadError {
    move |fault| fault.at(Place::Part(format!("array `{name}`")))
}

impl Arrays {
    fn holds(&self, name: &str) -> bool {
        self.archive.holds(&format!("{name}.npy"))
    }

    /// Returns the array of a role: the one that the user names, else the only one with one of these names, optionally
    /// with a unit of time as suffix. Refuses two such arrays; `kind` is the fault if no such array exists.
    fn of_role(&self, options: &ReadOptions, role: &str, names: &[&str], kind: ContentKind) -> Result<String, Fault> {
        let units = TimeUnit::ALL.map(|unit| format!("_{}", unit.name()));
        let ends = std::iter::once("").chain(units.iter().map(String::as_str));
        let usual = ends.flat_map(|end| names.iter().map(move |name| format!("{name}{end}")));
        let known = options.columns.get(role).map_or_else(|| usual.collect(), |given| vec![given.clone()]);
        let mut found = known.into_iter().filter(|name| self.holds(name));
        let named = COLUMN.set(format!("{role}=NAME"));
        match (found.next(), found.next()) {
            (Some(only), None) => Ok(only),
            (Some(first), Some(second)) => {
                let problem = format!("the arrays `{first}` and `{second}` both give the {}", names[1]);
                refuse(ContentKind::AmbiguousColumn, problem, format!("name one of them with {named}"))
            }
            (None, _) => {
                let all = self.archive.names();
                let all: Vec<_> = all.iter().filter_map(|name| name.strip_suffix(".npy")).map(quoted).collect();
                let problem = format!("no array gives the {}s; its arrays are {}", names[1], all.join(", "));
                refuse(kind, problem, format!("save it as `{}`, or name it with {named}", names[0]))
            }
        }
    }

    fn array(&mut self, name: &str) -> Result<Array, ReadError> {
        Array::open(self.archive.entry(&format!("{name}.npy"))?).map_err(in_array(name))
    }

    fn optional<T>(
        &mut self,
        name: &str,
        read: impl FnOnce(&mut Self) -> Result<T, ReadError>,
    ) -> Result<Option<T>, ReadError> {
        if self.holds(name) { read(self).map(Some) } else { Ok(None) }
    }

    /// Returns the radii of all vehicles, instant by instant. The array holds them once or for each time.
    fn radii(&mut self, positions: &Table) -> Result<Numbers, ReadError> {
        let mut array = self.array("radii")?;
        if array.shape != [positions.vehicles()] {
            return self.like(positions, "radii", false);
        }
        let radii = (0..array.count()).map(|_| array.next_number()).collect::<Result<Vec<_>, _>>();
        Ok(Box::new(radii.map_err(in_array("radii"))?.into_iter().cycle().map(Ok)))
    }

    /// Returns the numbers of an array with the layout of the positions, with or without the axis of x, y and z.
    fn like(&mut self, positions: &Table, name: &str, with_axes: bool) -> Result<Numbers, ReadError> {
        let array = self.array(name)?;
        let axes = positions.layout.into_iter().zip(positions.shape);
        let axes: Vec<_> = axes.filter(|(axis, _)| with_axes || *axis != ArrayAxis::Axis).collect();
        let (order, expected): (Vec<_>, Vec<_>) = axes.into_iter().unzip();
        if array.shape != expected {
            let problem = format!("its shape is {:?}, but the positions require {expected:?}", array.shape);
            return Err(in_array(name)(Fault::content(
                ContentKind::ArrayShape,
                problem,
                "save arrays of one recording together",
            )));
        }
        numbers(array, &order).map_err(in_array(name))
    }

    /// Returns the names of the vehicles; their number must be `vehicles`.
    fn names(&mut self, vehicles: usize) -> Result<Names, ReadError> {
        let names = self.texts("names")?;
        let count = names.len();
        let names = Names::from_list(names).map_err(in_array("names"))?;
        if count == vehicles {
            return Ok(names);
        }
        let problem = format!("it has {count} elements for {vehicles} vehicles");
        let remedy = "save a distinct name for each vehicle, or omit `names`";
        Err(in_array("names")(Fault::content(ContentKind::ArrayShape, problem, remedy)))
    }

    fn texts(&mut self, name: &str) -> Result<Vec<String>, ReadError> {
        let mut array = self.array(name)?;
        let mut texts = Vec::new();
        for _ in 0..array.count() {
            texts.push(array.next_text().map_err(in_array(name))?);
        }
        Ok(texts)
    }

    /// Returns an array of vectors with `times` instants.
    fn table(&mut self, name: &str, times: usize, known_axes: &[ArrayAxis]) -> Result<Table, ReadError> {
        let array = self.array(name)?;
        let fail = in_array(name);
        let &[first, second, third] = array.shape.as_slice() else {
            let problem = format!("its shape is {:?}, expected three axes", array.shape);
            return Err(fail(Fault::content(
                ContentKind::ArrayShape,
                problem,
                "save positions as T x N x 3 or N x T x 3",
            )));
        };
        if array.count() == 0 {
            let problem = format!("its shape is {:?}, which has no elements", array.shape);
            return Err(fail(Fault::content(ContentKind::Empty, problem, "save at least one instant of one vehicle")));
        }
        let shape = [first, second, third];
        let layout = layout(shape, times, known_axes).map_err(&fail)?;
        Ok(Table { shape, layout, numbers: numbers(array, &layout).map_err(fail)? })
    }
}

/// Positions of all vehicles, instant by instant.
struct Table {
    /// Shape in the archive.
    shape: [usize; 3],
    layout: ArrayLayout,
    numbers: Numbers,
}

impl Table {
    fn length(&self, axis: ArrayAxis) -> usize {
        self.layout.into_iter().zip(self.shape).find(|(own, _)| *own == axis).map_or(1, |(_, length)| length)
    }

    fn vehicles(&self) -> usize {
        self.length(ArrayAxis::Vehicle)
    }

    fn axes(&self) -> usize {
        self.length(ArrayAxis::Axis)
    }
}

/// Numbers of an array over times and vehicles, instant by instant.
type Numbers = Box<dyn Iterator<Item = Result<f64, Fault>>>;

/// Returns the numbers of an array with this order of axes, in the usual order.
fn numbers(mut array: Array, order: &[ArrayAxis]) -> Result<Numbers, Fault> {
    const USUAL: ArrayLayout = ArrayAxis::LAYOUTS[0];
    if USUAL.starts_with(order) && !array.fortran_order {
        return Ok(Box::new(std::iter::repeat_with(move || array.next_number())));
    }
    let stored = (0..array.count()).map(|_| array.next_number()).collect::<Result<Vec<_>, _>>()?;
    let shape = array.shape.clone();
    let stride = |place: usize| {
        let inner = if array.fortran_order { &shape[..place] } else { &shape[place + 1..] };
        inner.iter().product::<usize>()
    };
    let along = USUAL.map(|axis| {
        let place = order.iter().position(|own| *own == axis);
        place.map_or((1, 0), |place| (shape[place], stride(place)))
    });
    let steps = |(length, stride): (usize, usize)| (0..length).map(move |k| k * stride);
    let [times, vehicles, axes] = along;
    let places = steps(times).flat_map(move |time| steps(vehicles).map(move |vehicle| time + vehicle));
    let places = places.flat_map(move |place| steps(axes).map(move |axis| place + axis));
    Ok(Box::new(places.map(move |place| Ok(stored[place]))))
}

fn next(numbers: &mut Numbers) -> Result<f64, Fault> {
    numbers.next().unwrap_or(Ok(f64::NAN))
}

/// Returns the next vector of `axes` axes. The other axes are 0.
fn next_vector(numbers: &mut Numbers, axes: usize) -> Result<Vector3<f64>, Fault> {
    let mut vector = Vector3::zeros();
    for x in vector.iter_mut().take(axes) {
        *x = next(numbers)?;
    }
    Ok(vector)
}

/// Returns the next radius; `None` if unknown.
fn next_radius(numbers: &mut Numbers) -> Result<Option<f64>, Fault> {
    let radius = next(numbers)?;
    if radius.is_nan() || (radius >= 0.0 && radius.is_finite()) {
        return Ok(Some(radius).filter(|radius| !radius.is_nan()));
    }
    let remedy = "radii must be finite and not negative, or NaN if unknown";
    refuse(ContentKind::Radius, format!("the radius is {radius}"), remedy)
}

/// Rows of an archive.
struct Instants {
    /// Name of the array of positions.
    name: String,
    times: Vec<Stamp>,
    /// Index of the next instant.
    at: usize,
    table: Table,
    velocities: Option<Numbers>,
    seen: Option<Numbers>,
    radii: Option<Numbers>,
    names: Names,
}

impl Instants {
    fn row(&mut self, stamp: Stamp, vehicle: usize) -> Result<Option<Row>, Fault> {
        let axes = self.table.axes();
        let position = next_vector(&mut self.table.numbers, axes)?;
        let velocity = self.velocities.as_mut().map(|numbers| next_vector(numbers, axes)).transpose()?;
        let radius = self.radii.as_mut().map(next_radius).transpose()?.flatten();
        let seen = self.seen.as_mut().map(next).transpose()?.is_none_or(|seen| seen != 0.0);
        if !seen {
            return Ok(None);
        }
        if let Some(odd) = position.iter().find(|x| !x.is_finite()) {
            let remedy = "save an array `seen` of T x N booleans that is false if a vehicle was not seen";
            return refuse(ContentKind::NotFinite, format!("the position contains {odd}"), remedy);
        }
        // NaN marks vehicles without a velocity.
        let velocity = velocity.filter(|velocity| !velocity.iter().all(|x| x.is_nan()));
        if velocity.is_some_and(|velocity| velocity.iter().any(|x| !x.is_finite())) {
            let remedy = "velocities must be finite, or all NaN if unknown";
            return refuse(ContentKind::NotFinite, "the velocity is not finite", remedy);
        }
        let place = (self.at * self.table.vehicles() + vehicle) as u64;
        Ok(Some(Row { stamp, place, vehicle, position, velocity, radius }))
    }
}

impl Rows for Instants {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let Some(&stamp) = self.times.get(self.at) else { return Ok(false) };
        for vehicle in 0..self.table.vehicles() {
            let place = (self.at * self.table.vehicles() + vehicle) as u64;
            let row = self.row(stamp, vehicle).map_err(|fault| fault.at(self.place(place)))?;
            rows.extend(row);
        }
        if self.names.all().is_empty() {
            // Reading an instant has confirmed the number of vehicles in the header.
            self.names = Names::numbered(self.table.vehicles());
        }
        self.at += 1;
        Ok(true)
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn place(&self, number: u64) -> Place {
        let vehicles = self.table.vehicles().max(1) as u64;
        Place::Part(format!("{}[{}, {}]", self.name, number / vehicles, number % vehicles))
    }
}
