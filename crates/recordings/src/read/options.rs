//! What the user says of a recording.

use std::collections::BTreeMap;
use std::str::FromStr;

use super::axes::Axes;
use super::clock::TimeUnit;
use super::error::{Fault, quoted, refuse};
use super::readers::{Format, Takes};

/// What an axis of an array of positions counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArrayAxis {
    /// Instants.
    Time,
    /// Vehicles.
    Vehicle,
    /// x and y, or x, y and z.
    Axis,
}

/// What the three axes of an array of positions count, in their order.
pub type ArrayLayout = [ArrayAxis; 3];

impl ArrayAxis {
    /// All layouts, the usual one first.
    pub const LAYOUTS: [ArrayLayout; 6] = [
        [Self::Time, Self::Vehicle, Self::Axis],
        [Self::Vehicle, Self::Time, Self::Axis],
        [Self::Time, Self::Axis, Self::Vehicle],
        [Self::Vehicle, Self::Axis, Self::Time],
        [Self::Axis, Self::Time, Self::Vehicle],
        [Self::Axis, Self::Vehicle, Self::Time],
    ];

    /// What `--layout` calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Vehicle => "vehicle",
            Self::Axis => "axis",
        }
    }

    /// What `--layout` calls a layout, such as `time,vehicle,axis`.
    #[must_use]
    pub fn layout_name(layout: ArrayLayout) -> String {
        layout.map(Self::name).join(",")
    }

    /// The layout of such a name.
    ///
    /// # Errors
    /// The names of all layouts, where it is the name of none.
    pub fn layout_of(name: &str) -> Result<ArrayLayout, String> {
        let layout = Self::LAYOUTS.into_iter().find(|layout| Self::layout_name(*layout) == name);
        layout.ok_or_else(|| format!("`{name}` is none of {}", Self::LAYOUTS.map(Self::layout_name).join(" ")))
    }
}

/// Metres per unit of length of a recording, for all axes or for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The part that all axes have in common.
    metres: f64,
    /// What each axis is multiplied by beside it, with its sign.
    each: [f64; 3],
}

impl Default for Scale {
    /// Lengths are in metres.
    fn default() -> Self {
        Self::from(1.0)
    }
}

impl From<f64> for Scale {
    /// The same for all axes, without a check: an option out of range is an error when a recording is opened.
    fn from(metres: f64) -> Self {
        Self { metres, each: [1.0; 3] }
    }
}

impl From<[f64; 3]> for Scale {
    /// One number for each axis, with signs. Axes of one length share it.
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

    /// Reads a number, or three between commas, as `--scale` takes them.
    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(metres) = text.trim().parse::<f64>() {
            return Ok(metres.into());
        }
        let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        match <[f64; 3]>::try_from(numbers.unwrap_or_default()) {
            Ok(each) if each.contains(&0.0) => Err("a scale of 0 makes all places the same".to_owned()),
            Ok(each) if each.iter().all(|x| x.is_finite()) => Ok(each.into()),
            _ => Err(format!("`{text}` is neither a number nor three, such as 1,1,-1")),
        }
    }
}

/// The numbers of a vehicle at a time.
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
    /// All that are known.
    pub const ALL: [Self; 4] = [Self::Plane, Self::Space, Self::PlaneVelocity, Self::SpaceVelocity];

    /// What `--dimensions` calls it: `2`, `3`, `2+2` or `3+3`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plane => "2",
            Self::Space => "3",
            Self::PlaneVelocity => "2+2",
            Self::SpaceVelocity => "3+3",
        }
    }

    /// Number of axes, and of numbers.
    pub(super) fn counts(self) -> (usize, usize) {
        match self {
            Self::Plane => (2, 2),
            Self::Space => (3, 3),
            Self::PlaneVelocity => (2, 4),
            Self::SpaceVelocity => (3, 6),
        }
    }
}

/// Which of several rows of a vehicle at one time is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Duplicates {
    /// The first in the file.
    First,
    /// The last in the file.
    Last,
    /// None: such a recording is refused, even where the rows say the same.
    Refuse,
}

impl Duplicates {
    /// All that are known.
    pub const ALL: [Self; 3] = [Self::First, Self::Last, Self::Refuse];

    /// What `--duplicates` calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Last => "last",
            Self::Refuse => "refuse",
        }
    }
}

/// Names of columns, where they are not the usual ones: one for each of [`ColumnNames::ROLES`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnNames([Option<String>; 12]);

impl ColumnNames {
    /// Roles that a column can have: time, vehicle, position \[m\], velocity \[m/s\] and radius \[m\] of the vehicle, or its
    /// latitude and longitude \[degrees\] and height \[m\].
    pub const ROLES: [&str; 12] = ["t", "id", "x", "y", "z", "vx", "vy", "vz", "radius", "lat", "lon", "alt"];

    /// Gives the column of a role a name; `false` where there is no such role.
    pub fn set(&mut self, role: &str, name: &str) -> bool {
        let slot = self.0.iter_mut().zip(Self::ROLES).find(|(_, known)| *known == role);
        slot.map(|(slot, _)| *slot = Some(name.to_owned())).is_some()
    }

    /// The name given for a role.
    pub(super) fn get(&self, role: &str) -> Option<&String> {
        self.0.iter().zip(Self::ROLES).find(|(_, known)| *known == role)?.0.as_ref()
    }

    /// Places of roles, and the names given for them.
    pub(super) fn given(&self) -> impl Iterator<Item = (usize, &String)> {
        self.0.iter().enumerate().filter_map(|(role, name)| Some((role, name.as_ref()?)))
    }
}

/// What the user knows about a recording that its file does not say.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct ReadOptions {
    /// The format, instead of recognising it by the content.
    pub format: Option<Format>,
    /// The unit of time, instead of what the file says or its numbers suggest.
    pub time_unit: Option<TimeUnit>,
    /// How many units of time there are in a second, where they are those of no clock: frames, steps, minutes.
    pub times_per_second: Option<f64>,
    /// Whether rows that go back in time are sorted; such a recording is refused otherwise.
    pub sort: bool,
    /// Which of several rows of a vehicle at one time is read. Where nothing is said, rows that say the same are read once
    /// and others are refused.
    pub duplicates: Option<Duplicates>,
    /// Metres per unit of length of the file, by default 1; velocities and radii are scaled too.
    pub scale: Option<Scale>,
    /// Which axes of the file become x, y and z; by default they stay as they are.
    pub axes: Option<Axes>,
    /// The numbers of a vehicle in a table without a header, where their count does not tell.
    pub dimensions: Option<Dimensions>,
    /// Whether a table whose rows name no vehicle is of one, whatever other columns it has.
    pub one_vehicle: bool,
    /// Whether the file is one of several of a recording, which share an origin and a clock; [`open_joined`](super::open_joined)
    /// sets it.
    pub is_joined: bool,
    /// Names of columns of a table.
    pub columns: ColumnNames,
    /// Where the curves of vehicles start, if they are relative to that \[m\].
    pub starts: BTreeMap<String, [f64; 3]>,
    /// What the axes of an array of positions count, where its shape has several meanings.
    pub layout: Option<ArrayLayout>,
    /// The same for arrays of which nothing else says it; it may be given for recordings of any format.
    pub usual_layout: Option<ArrayLayout>,
    /// The frame that all poses are brought into, where messages have several; those that no transforms lead from are left
    /// out.
    pub frame: Option<String>,
    /// The topics of messages that are read; all with positions where none is named.
    pub topics: Vec<String>,
    /// What places on the Earth are measured from: latitude and longitude \[degrees\] and height above the ellipsoid
    /// \[m\]; the first place where nothing is said.
    pub origin: Option<[f64; 3]>,
    /// Whether to accept an MCAP file or a log of PX4 that was not closed, for what it holds.
    pub allow_unfinished: bool,
}

impl ReadOptions {
    /// Metres per unit of length that all axes have in common.
    #[must_use]
    pub fn metres(&self) -> f64 {
        self.scale.unwrap_or_default().metres
    }

    /// How axes are turned and stretched, lengths apart from [`Self::metres`].
    pub(super) fn turn(&self) -> Axes {
        self.axes.unwrap_or_default().scaled(self.scale.unwrap_or_default().each)
    }

    /// Refuses numbers out of range.
    pub(super) fn check(&self) -> Result<(), Fault> {
        let metres = self.metres();
        if !(metres.is_finite() && metres > 0.0) {
            let problem = format!("its lengths cannot be scaled by {metres}");
            return refuse(
                "recording/option-out-of-range",
                problem,
                "give a positive number of metres per unit of length with --scale",
            );
        }
        if let Some(rate) = self.times_per_second.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            let problem = format!("its times cannot be counted with {rate} in a second");
            return refuse(
                "recording/option-out-of-range",
                problem,
                "give a positive number with --fps or --time-scale",
            );
        }
        if let Some(unit) = self.time_unit.filter(|_| self.times_per_second.is_some()) {
            let problem = format!("its times are in {} and in parts of a second of your own", unit.name());
            let remedy = "leave --time-unit out, or --fps and --time-scale";
            return refuse("recording/two-time-units", problem, remedy);
        }
        if let Some([latitude, longitude, height_m]) = self.origin {
            let is_on_earth = latitude.abs() <= 90.0 && longitude.abs() <= 360.0 && height_m.is_finite();
            if !is_on_earth {
                let problem = format!("no place on the Earth is at {latitude}, {longitude}, {height_m} m");
                let remedy = "a latitude is within 90 degrees, and a longitude within 360";
                return refuse("recording/option-out-of-range", problem, remedy);
            }
        }
        if let Some((name, _)) = self.starts.iter().find(|(_, start)| !start.iter().all(|x| x.is_finite())) {
            let problem = format!("the start of {} is not finite", quoted(name));
            return refuse("recording/option-out-of-range", problem, "give three finite numbers of metres");
        }
        if !self.turn().are_finite() {
            let problem = "the lengths of its axes cannot be multiplied by 0, nor by what is not finite";
            return refuse(
                "recording/option-out-of-range",
                problem,
                "give three numbers with --scale that are not 0, such as 1,1,-1",
            );
        }
        Ok(())
    }

    /// Refuses an option that means nothing for a format.
    pub(super) fn refuse_needless(&self, format: Format) -> Result<(), Fault> {
        let (is_turned, has_columns) = (!self.turn().is_identity(), self.columns != ColumnNames::default());
        let is_one_vehicle = self.one_vehicle && !self.is_joined;
        let given = [
            (self.time_unit.is_some(), Takes::TimeUnit, "--time-unit", "has a unit of time of its own"),
            (
                self.times_per_second.is_some(),
                Takes::TimeUnit,
                "--fps and --time-scale",
                "has a unit of time of its own",
            ),
            (self.sort, Takes::Rows, "--sort", "holds curves in order of time"),
            (self.duplicates.is_some(), Takes::Rows, "--duplicates", "holds curves, and no rows"),
            (self.dimensions.is_some(), Takes::Dimensions, "--dimensions", "says which numbers are a vehicle's"),
            (!self.starts.is_empty(), Takes::Starts, "--start", "does not hold curves that are relative"),
            (has_columns, Takes::Columns, "--column", "has no columns that could be named"),
            (self.layout.is_some(), Takes::Layout, "--layout", "has no arrays"),
            (self.origin.is_some(), Takes::Origin, "--origin", "has no latitudes and longitudes"),
            (self.frame.is_some(), Takes::Frame, "--frame", "names no frames"),
            (!self.topics.is_empty(), Takes::Topics, "--topic", "has no topics"),
            (is_turned, Takes::Axes, "--axes", "gives the directions of its axes"),
            (is_one_vehicle, Takes::OneVehicle, "--one-vehicle", "names its vehicles"),
            (self.allow_unfinished, Takes::Unfinished, "--allow-unfinished", "cannot be read before it is closed"),
        ];
        match given.into_iter().find(|(is_given, of, ..)| *is_given && !format.takes.contains(of)) {
            Some((.., option, why)) => {
                refuse("recording/unused-option", format!("{} {why}", format.title), format!("leave {option} away"))
            }
            None => Ok(()),
        }
    }

    /// What is to be said of a file that was not closed, or the fault that it is.
    pub(super) fn accept_unfinished(&self, complete: bool) -> Result<Vec<String>, Fault> {
        let note = "the recording was not closed: it is read up to the last part that was written";
        match (complete, self.allow_unfinished) {
            (true, _) => Ok(Vec::new()),
            (false, true) => Ok(vec![note.to_owned()]),
            (false, false) => Err(Fault::Unfinished),
        }
    }
}
