//! Recorded motion as plain data: what a reader gives and the judge takes.
//!
//! A recording is a stream of [`Item`]s in order of time, whoever wrote it: instants of vehicles, or pieces of their
//! curves. Nothing here says what happens between two instants; the judge is told that.

use nalgebra::Vector3;

/// A vehicle at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Which vehicle: an index into [`Tracks::vehicles`].
    pub vehicle: usize,
    /// Time since the recording's epoch \[s\].
    pub time_s: f64,
    /// Position \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity \[m/s\], where the recording has one.
    pub velocity_m_s: Option<Vector3<f64>>,
    /// Radius of the vehicle \[m\], where the recording has one.
    pub radius_m: Option<f64>,
}

/// A piece of a vehicle's curve: its position at time t is the sum of `coefficients[k] (t - from_s)^k`.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Which vehicle: an index into [`Tracks::vehicles`].
    pub vehicle: usize,
    /// Where the piece begins \[s\] since the recording's epoch.
    pub from_s: f64,
    /// Where it ends \[s\]; after `from_s`.
    pub to_s: f64,
    /// Coefficients \[m/s^k\], the constant one first; at least one.
    pub coefficients: Vec<Vector3<f64>>,
}

/// What places on the Earth are measured from, east, north and up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EarthOrigin {
    /// Latitude and longitude \[degrees\] and height above the ellipsoid \[m\], between commas.
    pub place: String,
    /// Whether it is the first place of the recording, because the user names none: only differences of positions can be judged
    /// then, and not heights or places.
    pub is_inferred: bool,
}

/// What a recording says next.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// A vehicle was seen.
    Sample(Sample),
    /// A vehicle flies a known curve.
    Piece(Piece),
}

impl Item {
    /// When the item begins \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        match self {
            Self::Sample(sample) => sample.time_s,
            Self::Piece(piece) => piece.from_s,
        }
    }

    /// Whose it is.
    #[must_use]
    pub fn vehicle(&self) -> usize {
        match self {
            Self::Sample(sample) => sample.vehicle,
            Self::Piece(piece) => piece.vehicle,
        }
    }
}

/// How a recording counts time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clock {
    /// The unit that the recording writes: `s`, `ms`, `us` or `ns`; `given` where the user says how long one lasts.
    pub unit: &'static str,
    /// Whether the unit was inferred from the numbers and not given by the format or by the user.
    pub inferred: bool,
    /// Whether another unit fits as well. The unit was then inferred from whole numbers, or from steps of two units or more.
    /// The numbers are not of the size of times since 1970. Questions in seconds should not rest on that unit.
    pub by_steps: bool,
    /// What was taken from every time so that no digit of a clock in nanoseconds is lost \[ns\].
    pub epoch_ns: i64,
}

/// Properties of a recording as a whole.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// How time is counted.
    pub clock: Clock,
    /// Notes for the user about how the recording was read, a sentence each: rows were sorted, the unit of time was inferred.
    pub notes: Vec<String>,
    /// Assumption that the positions at the times of items rest on, in words that follow "if"; none if the recording holds
    /// these positions. A recording with an assumption proves nothing.
    pub assumed: Option<String>,
    /// Whether the height of some vehicle is unknown. Then z is 0 in every item and has no meaning: only distances in the
    /// plane of x and y can be judged.
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

/// A recording being read.
///
/// Items come in order of time ([`Item::time_s`]), and those of one vehicle at strictly increasing times; pieces of one
/// vehicle do not overlap. A reader whose source is in another order sorts it and says so in its notes.
pub trait Tracks {
    /// Why reading failed: names file, place, value and remedy.
    type Error;

    /// Names of the vehicles known so far, in order of first appearance (numbers in order of value where all are
    /// numbers). It may grow as the recording is read; an index keeps its meaning.
    fn vehicles(&self) -> &[String];

    /// Appends the next items to `items`, some ten thousand at a time; `false` when there was none to append.
    ///
    /// # Errors
    /// When the recording cannot be read further; what was appended before stays true.
    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, Self::Error>;

    /// Properties of the recording as a whole. Notes may grow as the recording is read.
    fn metadata(&self) -> &Metadata;

    /// [`Metadata::clock`].
    fn clock(&self) -> &Clock {
        &self.metadata().clock
    }

    /// [`Metadata::notes`].
    fn notes(&self) -> &[String] {
        &self.metadata().notes
    }

    /// [`Metadata::assumed`].
    fn assumed(&self) -> Option<&str> {
        self.metadata().assumed.as_deref()
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
