//! Options of readers: facts about a recording that its file does not contain.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::str::FromStr;

use super::axes::Axes;
use super::error::{ContentKind, Fault, quoted, refuse};
use super::format::{Format, FormatOption};
use super::time_unit::TimeUnit;
use tautline_core::option::{
    ALLOW_UNFINISHED, AXES, CLOCK, COLUMN, DIMENSIONS, DUPLICATES, FPS, FRAME, LAYOUT, ONE_VEHICLE, ORIGIN, PLAN_END,
    SCALE, SKIP_INCOMPLETE, SORT, START, TIME_SCALE, TIME_UNIT, TOPIC,
};
use tautline_core::track::PlanEnd;

/// Defines all variants of an option, and their names.
macro_rules! named {
    ($kind:ident, $($variant:ident = $name:literal),+) => {
        impl $kind {
            /// All variants.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// Returns the name for the command line.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),+
                }
            }
        }
    };
}

named!(ArrayAxis, Time = "time", Vehicle = "vehicle", Axis = "axis");
named!(Dimensions, Plane = "2", Space = "3", PlaneVelocity = "2+2", SpaceVelocity = "3+3");
named!(Duplicates, First = "first", Last = "last", Refuse = "refuse");
named!(MessageClock, Stamp = "stamp", Log = "log");

/// Meaning of an axis of an array of positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArrayAxis {
    /// Instants.
    Time,
    /// Vehicles.
    Vehicle,
    /// x and y, or x, y and z.
    Axis,
}

/// Meaning of the three axes of an array of positions, in order.
pub type ArrayLayout = [ArrayAxis; 3];

impl ArrayAxis {
    /// All layouts, the most common one first.
    pub const LAYOUTS: [ArrayLayout; 6] = [
        [Self::Time, Self::Vehicle, Self::Axis],
        [Self::Vehicle, Self::Time, Self::Axis],
        [Self::Time, Self::Axis, Self::Vehicle],
        [Self::Vehicle, Self::Axis, Self::Time],
        [Self::Axis, Self::Time, Self::Vehicle],
        [Self::Axis, Self::Vehicle, Self::Time],
    ];

    /// Returns the name of a layout for `--layout`, such as `time,vehicle,axis`.
    #[must_use]
    pub fn layout_name(layout: ArrayLayout) -> String {
        layout.map(Self::name).join(",")
    }

    /// Returns the layout with this name.
    ///
    /// # Errors
    /// A message with the names of all layouts, if the name is unknown.
    pub fn layout_of(name: &str) -> Result<ArrayLayout, String> {
        let layout = Self::LAYOUTS.into_iter().find(|layout| Self::layout_name(*layout) == name);
        layout.ok_or_else(|| {
            let names = Self::LAYOUTS.map(|layout| format!("`{}`", Self::layout_name(layout))).join(", ");
            format!("must be one of {names}, got `{name}`")
        })
    }
}

/// Metres per unit of length of a recording, common to all axes or per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Common factor of all axes.
    metres: f64,
    /// Additional factor of each axis, with its sign.
    each: [f64; 3],
}

impl Default for Scale {
    /// Returns the scale of lengths in metres.
    fn default() -> Self {
        Self::from(1.0)
    }
}

impl From<f64> for Scale {
    /// Returns one factor for all axes, unchecked: `ReadOptions::check` refuses values out of range.
    fn from(metres: f64) -> Self {
        Self { metres, each: [1.0; 3] }
    }
}

impl From<[f64; 3]> for Scale {
    /// Returns one signed factor per axis. Axes with the same absolute value share the common factor.
    fn from(each: [f64; 3]) -> Self {
        let metres = each[0].abs();
        if metres > 0.0 && each.iter().all(|x| x.abs() == metres) {
            return Self { metres, each: each.map(f64::signum) };
        }
        Self { metres: 1.0, each }
    }
}

impl FromStr for Scale {
    type Err = String;

    /// Parses one number, or three numbers separated by commas, as in `--scale`.
    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(metres) = text.trim().parse::<f64>() {
            return Ok(metres.into());
        }
        let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        match <[f64; 3]>::try_from(numbers.unwrap_or_default()) {
            Ok(each) if each.contains(&0.0) => Err(format!("a scale must not be 0, got {text}")),
            Ok(each) if each.iter().all(|x| x.is_finite()) => Ok(each.into()),
            _ => Err(format!("`{text}` is not one number or three, such as 1,1,-1")),
        }
    }
}

/// Numbers per vehicle and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimensions {
    /// x, y.
    Plane,
    /// x, y, z.
    Space,
    /// x, y, vx, vy.
    PlaneVelocity,
    /// x, y, z, vx, vy, vz.
    SpaceVelocity,
}

impl Dimensions {
    /// Returns the number of axes, and the number of numbers.
    pub(super) fn counts(self) -> (usize, usize) {
        match self {
            Self::Plane => (2, 2),
            Self::Space => (3, 3),
            Self::PlaneVelocity => (2, 4),
            Self::SpaceVelocity => (3, 6),
        }
    }
}

/// Choice among several rows of a vehicle at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Duplicates {
    /// First row in the file.
    First,
    /// Last row in the file.
    Last,
    /// Refuse the recording, even if the rows are equal.
    Refuse,
}

/// Clock of the messages of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageClock {
    /// Stamps in the messages.
    Stamp,
    /// Times at which the recorder logged the messages.
    Log,
}

/// Names of columns given by the user, one per role of [`ColumnNames::ROLES`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnNames([Option<String>; 12]);

impl ColumnNames {
    /// Roles of columns: time, vehicle, position \[m\], velocity \[m/s\], radius \[m\], and latitude, longitude
    /// \[degrees\] and height \[m\].
    pub const ROLES: [&str; 12] = ["t", "id", "x", "y", "z", "vx", "vy", "vz", "radius", "lat", "lon", "alt"];

    /// Sets the column name of a role; returns `false` for an unknown role.
    pub fn set(&mut self, role: &str, name: &str) -> bool {
        let slot = self.0.iter_mut().zip(Self::ROLES).find(|(_, known)| *known == role);
        slot.map(|(slot, _)| *slot = Some(name.to_owned())).is_some()
    }

    /// Returns the name given for a role.
    pub(super) fn get(&self, role: &str) -> Option<&String> {
        self.0.iter().zip(Self::ROLES).find(|(_, known)| *known == role)?.0.as_ref()
    }

    /// Returns the indices of roles with a given name, and the names.
    pub(super) fn given(&self) -> impl Iterator<Item = (usize, &String)> {
        self.0.iter().enumerate().filter_map(|(role, name)| Some((role, name.as_ref()?)))
    }
}

/// Options of a reader, given by the user.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct ReadOptions {
    /// Format; recognised by content if absent.
    pub format: Option<Format>,
    /// Unit of time; read from the file or inferred if absent.
    pub time_unit: Option<TimeUnit>,
    /// Number of time units per second for units without a name: frames, steps, minutes.
    pub times_per_second: Option<f64>,
    /// Whether to sort rows with decreasing time, which are refused otherwise.
    pub sort: bool,
    /// Choice among several rows of a vehicle at one time. If absent, equal rows are read once and others are refused.
    pub duplicates: Option<Duplicates>,
    /// Metres per unit of length, by default 1; also applies to velocities and radii.
    pub scale: Option<Scale>,
    /// Mapping of the axes of the file to x, y and z, by default the identity.
    pub axes: Option<Axes>,
    /// Numbers per vehicle in a table without a header, if the column count is ambiguous.
    pub dimensions: Option<Dimensions>,
    /// Whether all rows of a table belong to one vehicle, whatever other columns it has.
    pub one_vehicle: bool,
    /// Whether a row that lacks a coordinate is a row without a position; refused otherwise.
    pub skip_incomplete: bool,
    /// Whether vehicles with equal positions are different vehicles; refused otherwise.
    pub distinct: bool,
    /// Clock of messages; by default their stamps, or the log times if no message has a stamp.
    pub clock: Option<MessageClock>,
    /// Whether the file is one of several of a recording, with a common origin and clock; set by
    /// [`open_joined`](super::open_joined).
    pub is_joined: bool,
    /// Names of columns of a table.
    pub columns: ColumnNames,
    /// Origins of relative curves, by vehicle \[m\].
    pub starts: BTreeMap<String, [f64; 3]>,
    /// Meaning of the axes of an array of positions, if its shape is ambiguous.
    pub layout: Option<ArrayLayout>,
    /// Default for `layout`, which the user may set for recordings of any format.
    pub usual_layout: Option<ArrayLayout>,
    /// Frame to which all poses are transformed, if messages use several frames; poses without a transform to it are
    /// omitted.
    pub frame: Option<String>,
    /// Topics to read; if empty, all topics with positions.
    pub topics: Vec<String>,
    /// Origin of places on the Earth: latitude and longitude \[degrees\], height above the ellipsoid \[m\]; by default
    /// the first place.
    pub origin: Option<[f64; 3]>,
    /// Motion of a vehicle after the end of its published plan; by default it holds the last point.
    pub plan_end: Option<PlanEnd>,
    /// Whether to read the complete part of an MCAP file or PX4 log that was not closed.
    pub allow_unfinished: bool,
}

impl ReadOptions {
    /// Returns the metres per unit of length that all axes have in common.
    #[must_use]
    pub fn metres(&self) -> f64 {
        self.scale.unwrap_or_default().metres
    }

    /// Returns the mapping of axes, including the factors of [`Scale`] beyond [`Self::metres`].
    pub(super) fn turn(&self) -> Axes {
        self.axes.unwrap_or_default().scaled(self.scale.unwrap_or_default().each)
    }

    /// Returns whether positions are turned or scaled as they are read.
    #[must_use]
    pub fn changes_positions(&self) -> bool {
        self.metres() != 1.0 || !self.turn().is_identity()
    }

    /// Refuses values out of range.
    pub(super) fn check(&self) -> Result<(), Fault> {
        let metres = self.metres();
        if !(metres.is_finite() && metres > 0.0) {
            let problem = format!("{SCALE} must be positive, got {metres}");
            let remedy = "give a positive number of metres per unit of length";
            return refuse(ContentKind::OptionOutOfRange, problem, remedy);
        }
        if let Some(rate) = self.times_per_second.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            let problem = format!("the number of time units per second must be positive, got {rate}");
            let remedy = format!("give a positive number with {FPS} or {TIME_SCALE}");
            return refuse(ContentKind::OptionOutOfRange, problem, remedy);
        }
        if let Some(unit) = self.time_unit.filter(|_| self.times_per_second.is_some()) {
            let given = TIME_UNIT.set(unit.name());
            let problem = format!("the unit of time is given twice: {given}, and {FPS} or {TIME_SCALE}");
            let remedy = format!("omit {TIME_UNIT}, or {FPS} and {TIME_SCALE}");
            return refuse(ContentKind::TwoTimeUnits, problem, remedy);
        }
        if let Some([latitude, longitude, height_m]) = self.origin {
            let is_on_earth = latitude.abs() <= 90.0 && longitude.abs() <= 360.0 && height_m.is_finite();
            if !is_on_earth {
                let given = ORIGIN.set(format!("{latitude},{longitude},{height_m}"));
                let problem = format!("{given} is not on the Earth");
                let remedy = "give a latitude within 90 degrees and a longitude within 360 degrees";
                return refuse(ContentKind::OptionOutOfRange, problem, remedy);
            }
        }
        if let Some((name, _)) = self.starts.iter().find(|(_, start)| !start.iter().all(|x| x.is_finite())) {
            let problem = format!("the start of {} is not finite", quoted(name));
            return refuse(ContentKind::OptionOutOfRange, problem, "give three finite numbers in metres");
        }
        if !self.turn().are_finite() {
            let problem = format!("a factor of {SCALE} is 0 or not finite");
            let remedy = "give three finite numbers other than 0, such as 1,1,-1";
            return refuse(ContentKind::OptionOutOfRange, problem, remedy);
        }
        Ok(())
    }

    /// Refuses an option without a meaning for the format.
    pub(super) fn refuse_unsupported_options(&self, format: Format) -> Result<(), Fault> {
        let (is_turned, has_columns) = (!self.turn().is_identity(), self.columns != ColumnNames::default());
        let is_one_vehicle = self.one_vehicle && !self.is_joined;
        let rate = format!("{FPS} and {TIME_SCALE}");
        let given: [(_, _, &dyn Display, _); 17] = [
            (self.time_unit.is_some(), FormatOption::TimeUnit, &TIME_UNIT, "has a fixed unit of time"),
            (self.times_per_second.is_some(), FormatOption::TimeUnit, &rate, "has a fixed unit of time"),
            (self.clock.is_some(), FormatOption::Clock, &CLOCK, "has no messages with log times"),
            (self.skip_incomplete, FormatOption::Incomplete, &SKIP_INCOMPLETE, "has no rows with empty cells"),
            (self.sort, FormatOption::Rows, &SORT, "holds curves in order of time"),
            (self.duplicates.is_some(), FormatOption::Rows, &DUPLICATES, "holds curves, not rows"),
            (self.dimensions.is_some(), FormatOption::Dimensions, &DIMENSIONS, "defines the numbers of a vehicle"),
            (!self.starts.is_empty(), FormatOption::Starts, &START, "does not hold relative curves"),
            (has_columns, FormatOption::Columns, &COLUMN, "has no columns"),
            (self.layout.is_some(), FormatOption::Layout, &LAYOUT, "has no arrays"),
            (self.origin.is_some(), FormatOption::Origin, &ORIGIN, "has no latitudes and longitudes"),
            (self.frame.is_some(), FormatOption::Frame, &FRAME, "has no frames"),
            (!self.topics.is_empty(), FormatOption::Topics, &TOPIC, "has no topics"),
            (self.plan_end.is_some(), FormatOption::Plans, &PLAN_END, "has no plans of a planner"),
            (is_turned, FormatOption::Axes, &AXES, "gives the directions of its axes"),
            (is_one_vehicle, FormatOption::OneVehicle, &ONE_VEHICLE, "names its vehicles"),
            (self.allow_unfinished, FormatOption::Unfinished, &ALLOW_UNFINISHED, "cannot be read before it is closed"),
        ];
        match given.into_iter().find(|(is_given, option, ..)| *is_given && !format.supports.contains(option)) {
            Some((.., option, why)) => {
                refuse(ContentKind::UnusedOption, format!("{} {why}", format.title), format!("omit {option}"))
            }
            None => Ok(()),
        }
    }

    /// Returns the note on an unclosed file if the user accepts it, else the fault.
    pub(super) fn accept_unfinished(&self, complete: bool) -> Result<Vec<String>, Fault> {
        if complete {
            return Ok(Vec::new());
        }
        if self.allow_unfinished {
            return Ok(vec!["the recording was not closed: it is read up to its last complete part".to_owned()]);
        }
        let problem = "the recorder did not close the file, so the end may be missing";
        let remedy = format!("copy or record it again, or accept the complete part with {ALLOW_UNFINISHED}");
        refuse(ContentKind::Unfinished, problem, remedy)
    }
}
