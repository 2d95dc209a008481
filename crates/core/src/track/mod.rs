//! Recorded motion as plain data: output of readers, input of the judge.
//!
//! A recording is a stream of [`Item`]s in order of time: positions of vehicles at instants, or pieces of their curves.
//! The motion between two instants is an assumption of the judge and not part of this data.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use nalgebra::Vector3;

use crate::fact::Fact;

/// State of a vehicle at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Index into [`Tracks::vehicles`].
    pub vehicle: usize,
    /// Time since the recording's epoch \[s\].
    pub time_s: f64,
    /// Position \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity \[m/s\], if recorded.
    pub velocity_m_s: Option<Vector3<f64>>,
    /// Radius of the vehicle \[m\], if recorded.
    pub radius_m: Option<f64>,
}

/// Piece of a vehicle's curve: the position at time t is the sum of `coefficients[k] (t - from_s)^k`.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Index into [`Tracks::vehicles`].
    pub vehicle: usize,
    /// Start of the piece \[s\], since the recording's epoch.
    pub from_s: f64,
    /// End of the piece \[s\]; after `from_s`.
    pub to_s: f64,
    /// Coefficients \[m/s^k\] from degree 0 on; at least one.
    pub coefficients: Vec<Vector3<f64>>,
}

/// Curve that a planner published for a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Index into [`Tracks::vehicles`].
    pub vehicle: usize,
    /// Instant of publication, since the recording's epoch \[s\].
    pub published_s: f64,
    /// Pieces in order of time, at least one. The plan replaces earlier plans of the vehicle from its start on.
    pub pieces: Vec<Piece>,
}

/// Motion of a vehicle after the end of its published plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanEnd {
    /// The vehicle holds the last point.
    Hold,
    /// The vehicle flies on with its last velocity.
    Continue,
    /// The motion is unknown and is not judged.
    Unknown,
}

impl PlanEnd {
    /// Returns the name of the choice.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Continue => "continue",
            Self::Unknown => "unknown",
        }
    }
}

/// Reads the name of the choice.
impl FromStr for PlanEnd {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let all = [Self::Hold, Self::Continue, Self::Unknown];
        let known = all.into_iter().find(|end| end.name() == name);
        known.ok_or_else(|| format!("unknown end `{name}`; give hold, continue or unknown"))
    }
}

/// Origin of local east, north and up coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarthOrigin {
    /// Latitude and longitude \[degrees\], and height above the ellipsoid \[m\].
    pub place: [f64; 3],
    /// Whether the origin is the first place of the recording because the user gave none. Then only differences of
    /// positions can be judged, not heights or places.
    pub is_inferred: bool,
}

/// Formats the place: latitude, longitude and height, separated by commas.
impl fmt::Display for EarthOrigin {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [latitude, longitude, height_m] = self.place;
        write!(out, "{latitude:?},{longitude:?},{height_m:?}")
    }
}

/// Element of a recording's stream.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// Position of a vehicle at one instant.
    Sample(Sample),
    /// Curve of a vehicle over a time interval.
    Piece(Piece),
}

impl Item {
    /// Returns the start of the item \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        match self {
            Self::Sample(sample) => sample.time_s,
            Self::Piece(piece) => piece.from_s,
        }
    }

    /// Returns the index of the vehicle.
    #[must_use]
    pub fn vehicle(&self) -> usize {
        match self {
            Self::Sample(sample) => sample.vehicle,
            Self::Piece(piece) => piece.vehicle,
        }
    }
}

/// Time scale of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clock {
    /// Unit of the recorded times: `s`, `ms`, `us` or `ns`; `given` if the user gives its length.
    pub unit: &'static str,
    /// Whether the unit was inferred from the values, as neither the format nor the user gives it.
    pub inferred: bool,
    /// Another unit that fits as well. Then the unit was inferred from integral values, or from steps of two seconds or
    /// more. Limits in seconds must not rest on such a unit.
    pub other_unit: Option<&'static str>,
    /// Offset that was subtracted from every time \[ns\], so that times in nanoseconds lose no digit.
    pub epoch_ns: i64,
}

impl Clock {
    /// Units from the longest to the shortest.
    const UNITS: [&'static str; 4] = ["s", "ms", "us", "ns"];
    /// Speed of sound, which vehicles do not usually exceed \[m/s\].
    const FASTEST_M_S: f64 = 340.0;

    /// Returns the other unit in which the times of these items may be. A shorter one is excluded if it would make the
    /// vehicles faster than sound.
    #[must_use]
    pub fn doubt(&self, items: &[Item]) -> Option<&'static str> {
        let other = self.other_unit?;
        let place = |unit| Self::UNITS.iter().position(|known| *known == unit);
        let is_shorter = place(other) > place(self.unit);
        let is_excluded = is_shorter && 1000.0 * usual_speed_m_s(items) > Self::FASTEST_M_S;
        (!is_excluded).then_some(other)
    }
}

/// Returns the upper quartile of the speeds between two samples of a vehicle \[m/s\]; 0 for curves. Single jumps do not
/// change the quartile.
fn usual_speed_m_s(items: &[Item]) -> f64 {
    let mut last: BTreeMap<usize, (f64, Vector3<f64>)> = BTreeMap::new();
    let samples = items.iter().filter_map(|item| match item {
        Item::Sample(sample) => Some((sample.vehicle, (sample.time_s, sample.position_m))),
        Item::Piece(_) => None,
    });
    let speeds = samples.filter_map(|(vehicle, (time_s, position_m))| {
        let (before_s, before_m) = last.insert(vehicle, (time_s, position_m))?;
        Some((position_m - before_m).norm() / (time_s - before_s))
    });
    let mut speeds: Vec<f64> = speeds.filter(|speed| speed.is_finite()).collect();
    speeds.sort_unstable_by(f64::total_cmp);
    speeds.get(speeds.len() * 3 / 4).copied().unwrap_or_default()
}

/// Properties of a recording as a whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// Time scale.
    pub clock: Clock,
    /// Notes for the user on how the recording was read, one sentence each, such as: rows were sorted.
    pub notes: Vec<String>,
    /// Facts behind times, positions and names of vehicles, each with its source. Facts may be added as the recording
    /// is read. Nothing is proved of a recording with a fact that is an assumption ([`Fact::is_assumption`]).
    pub facts: Vec<Fact>,
    /// Whether the height of a vehicle is unknown. Then z is 0 in every item, and only distances in the plane of x and
    /// y can be judged.
    pub is_planar: bool,
    /// Whether the recording gives the directions of its axes. The axes are then east, north and up.
    pub has_directions: bool,
    /// Origin from which positions are measured, if the recording has latitudes and longitudes.
    pub earth_origin: Option<EarthOrigin>,
}

impl Metadata {
    /// Metadata of a recording whose times are in seconds.
    #[must_use]
    pub fn in_seconds(notes: Vec<String>) -> Self {
        Self { clock: Clock { unit: "s", ..Clock::default() }, notes, ..Self::default() }
    }
}

/// Recording being read.
///
/// Items come in order of time ([`Item::time_s`]). The items of one vehicle have strictly increasing times, and its
/// pieces do not overlap. A reader sorts a source in another order and adds a note.
pub trait Tracks {
    /// Error type: names file, place, value and remedy.
    type Error;

    /// Returns the names of the vehicles known so far, in order of first appearance, or in numeric order if all are
    /// numbers. The list may grow as the recording is read; an index keeps its meaning.
    fn vehicles(&self) -> &[String];

    /// Appends the next items to `items`, some ten thousand at a time; returns `false` at the end of the recording.
    ///
    /// # Errors
    /// If the recording cannot be read further; items appended before the error remain valid.
    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, Self::Error>;

    /// Properties of the recording as a whole. Notes may grow as the recording is read.
    fn metadata(&self) -> &Metadata;

    /// Returns the plans of a recording of planners, in order of publication. The items of such a recording are the
    /// recorded positions. If the recording has none, the items are the parts of the plans that the vehicles fly: each
    /// until the next one of its vehicle starts. All other recordings have no plans. The method has no default, so that
    /// a recording around another one cannot lose its plans.
    fn plans(&self) -> &[Plan];

    /// [`Metadata::clock`].
    fn clock(&self) -> &Clock {
        &self.metadata().clock
    }

    /// [`Metadata::notes`].
    fn notes(&self) -> &[String] {
        &self.metadata().notes
    }

    /// [`Metadata::facts`].
    fn facts(&self) -> &[Fact] {
        &self.metadata().facts
    }

    /// [`Metadata::is_planar`].
    fn is_planar(&self) -> bool {
        self.metadata().is_planar
    }

    /// [`Metadata::earth_origin`].
    fn earth_origin(&self) -> Option<&EarthOrigin> {
        self.metadata().earth_origin.as_ref()
    }
}
