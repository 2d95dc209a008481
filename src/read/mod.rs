//! Recordings of any origin as a stream of [`Item`](crate::track::Item)s.
//!
//! [`open`] recognises the format by the content of the file and gives a [`Tracks`]: items in order of time, a clock, and
//! what a person should know. A format is a file of this room that turns its content into rows or into pieces of curves;
//! order, clocks and limits are the same for all.
//!
//! Memory is bounded by what is read at a time, not by the file: a recording in order of time is streamed. One that is
//! not is sorted, in memory, and says so in [`Tracks::notes`].
//!
//! # What is refused
//! Numbers that are not finite, a vehicle that is in two places at a time, time that runs backwards where each time is a
//! row, cells that are not numbers, files that break off. Every [`ReadError`] names the file, the place, the value and
//! the remedy. Nothing is guessed silently: an inferred unit of time is said in the notes.

mod archive;
mod clock;
mod crazyflie;
mod csv;
mod curves;
mod error;
mod layout;
pub(crate) mod mcap;
mod names;
mod npy;
mod npz;
mod order;
pub(crate) mod parquet;
mod recognise;
mod skybrush;
mod source;
mod table;

pub use self::parquet::is_guarded;
pub use clock::TimeUnit;
pub use error::{Fault, Place, ReadError};

use std::path::Path;

use crate::track::Tracks;
use clock::KnownUnit;
use error::FaultAt;
use order::About;
use recognise::{Recognised, recognise};
use source::Source;

/// A recording being read.
pub type Recording = Box<dyn Tracks<Error = ReadError>>;

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A table in text with a header: long (`t,id,x,y,z`) or wide (`t,x1,y1,z1,x2,...`).
    Csv,
    /// Numbers between blanks: `t x y z x y z ...`.
    Text,
    /// A table in Parquet, long or wide.
    Parquet,
    /// `NumPy` arrays `t` and `positions`.
    Npz,
    /// MCAP: our own, Foxglove or ROS 2 messages.
    Mcap,
    /// A folder of Crazyflie polynomials, a CSV a vehicle.
    Crazyflie,
    /// A Skybrush show: `.skyc` or its JSON.
    Skybrush,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 7] =
        [Self::Csv, Self::Text, Self::Parquet, Self::Npz, Self::Mcap, Self::Crazyflie, Self::Skybrush];

    /// What `--format` calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Text => "text",
            Self::Parquet => "parquet",
            Self::Npz => "npz",
            Self::Mcap => "mcap",
            Self::Crazyflie => "crazyflie",
            Self::Skybrush => "skybrush",
        }
    }

    /// The format of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// What a sentence calls it.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Csv => "a table in CSV",
            Self::Text => "a table in plain text",
            Self::Parquet => "a Parquet file",
            Self::Npz => "an NPZ archive",
            Self::Mcap => "an MCAP file",
            Self::Crazyflie => "a folder of Crazyflie polynomials",
            Self::Skybrush => "a Skybrush show",
        }
    }
}

/// Which axis of an array comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisOrder {
    /// T x N x 3.
    TimeFirst,
    /// N x T x 3.
    VehicleFirst,
}

/// Names of columns, where they are not the usual ones.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnNames {
    /// Time.
    pub time: Option<String>,
    /// The vehicle.
    pub id: Option<String>,
    /// Position along x, y and z \[m\].
    pub position: [Option<String>; 3],
    /// Velocity along x, y and z \[m/s\].
    pub velocity: [Option<String>; 3],
    /// Radius of the vehicle \[m\].
    pub radius: Option<String>,
}

impl ColumnNames {
    /// Roles that a column can have, as [`ColumnNames::set`] calls them.
    pub const ROLES: [&str; 9] = ["t", "id", "x", "y", "z", "vx", "vy", "vz", "radius"];

    /// Gives the column of a role a name; `false` where there is no such role.
    pub fn set(&mut self, role: &str, name: &str) -> bool {
        let ([x, y, z], [vx, vy, vz]) = (&mut self.position, &mut self.velocity);
        let slots = [&mut self.time, &mut self.id, x, y, z, vx, vy, vz, &mut self.radius];
        let slot = slots.into_iter().zip(Self::ROLES).find(|(_, known)| *known == role);
        slot.map(|(slot, _)| *slot = Some(name.to_owned())).is_some()
    }
}

/// What the user knows about a recording that its file does not say.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// The format, instead of recognising it by the content.
    pub format: Option<Format>,
    /// The unit of time, instead of what the file says or its numbers suggest.
    pub time_unit: Option<TimeUnit>,
    /// Metres per unit of length of the file; velocities and radii are scaled too.
    pub scale: f64,
    /// Names of columns of a table.
    pub columns: ColumnNames,
    /// Which axis of an array comes first, where its shape does not tell.
    pub axis_order: Option<AxisOrder>,
    /// The frame whose poses are read, where messages have several.
    pub frame: Option<String>,
    /// Whether to accept an MCAP file that was not closed, for what it holds.
    pub allow_unfinished: bool,
}

impl Default for ReadOptions {
    /// Everything recognised, lengths in metres.
    fn default() -> Self {
        Self {
            format: None,
            time_unit: None,
            scale: 1.0,
            columns: ColumnNames::default(),
            axis_order: None,
            frame: None,
            allow_unfinished: false,
        }
    }
}

impl ReadOptions {
    /// An option that means nothing for a format, and why.
    fn needless_for(&self, format: Format) -> Option<(&'static str, &'static str)> {
        let is_table = matches!(format, Format::Csv | Format::Text | Format::Parquet | Format::Npz);
        let (is_npz, is_mcap) = (format == Format::Npz, format == Format::Mcap);
        let given = [
            (self.time_unit.is_some() && !is_table, "--time-unit", "has a unit of time of its own"),
            (self.columns != ColumnNames::default() && !is_table, "--column", "has no columns that could be named"),
            (self.axis_order.is_some() && !is_npz, "--axis-order", "has no arrays"),
            (self.frame.is_some() && !is_mcap, "--frame", "names no frames"),
            (self.allow_unfinished && !is_mcap, "--allow-unfinished", "cannot be read before it is closed"),
        ];
        given.into_iter().find_map(|(needless, option, why)| needless.then_some((option, why)))
    }

    /// What is known of a recording: what the user says of the unit of time goes before what the file says.
    fn about(&self, source: &Source, said: Option<TimeUnit>, notes: Vec<String>, none: Fault) -> About {
        let unit = self.time_unit.or(said).map_or(KnownUnit::Unsaid, KnownUnit::Given);
        About { path: source.path.clone(), unit, epoch_ns: 0, scale: self.scale, notes, none }
    }
}

/// Opens a recording.
///
/// # Errors
/// [`ReadError`] when the file cannot be read, is of no known format, or is wrong where it was looked at so far.
pub fn open(path: &Path, options: &ReadOptions) -> Result<Recording, ReadError> {
    try_open(path, options).map_err(|fault| fault.of(path))
}

fn try_open(path: &Path, options: &ReadOptions) -> Result<Recording, FaultAt> {
    if !(options.scale.is_finite() && options.scale > 0.0) {
        let problem = format!("its lengths cannot be scaled by {}", options.scale);
        return Err(Fault::content(problem, "give a positive number of metres per unit of length").into());
    }
    let Recognised { format, gzip } = recognise(path, options.format)?;
    if let Some((option, why)) = options.needless_for(format) {
        let problem = format!("{} {why}", format.title());
        return Err(Fault::content(problem, format!("leave {option} away")).into());
    }
    let source = &Source { path: path.to_owned(), gzip };
    match format {
        Format::Csv | Format::Text => csv::open(source, format, options),
        Format::Crazyflie => crazyflie::open(path, options),
        Format::Mcap => mcap::open(source, options),
        Format::Npz => npz::open(source, options),
        Format::Parquet => parquet::open(source, options),
        Format::Skybrush => skybrush::open(source, options),
    }
}
