//! Options for reading a recording, shared by all commands that read one.

#[cfg(feature = "viewer")]
use std::path::Path;
use std::path::PathBuf;

use clap::Args;
use clap::builder::{PathBufValueParser, PossibleValue, TypedValueParser};

use tautline_core::track::PlanEnd;
use tautline_recordings::read::{
    ArrayAxis, ArrayLayout, Axes, ColumnNames, Dimensions, Duplicates, Format, MessageClock, ReadOptions, Scale,
    TimeUnit,
};
#[cfg(feature = "viewer")]
use tautline_report::request::Failure;
use tautline_report::request::audit::recording_in;
use tautline_report::request::one_of;

/// Options for reading a recording.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Reading")]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(super) struct ReadArguments {
    /// Recording: a file, the folder of a run or of a ROS 2 bag, or a folder or archive with a file for each vehicle.
    #[arg(index = 1, value_name = "RECORDING", value_parser = recording())]
    recording: PathBuf,
    /// More recordings, or with --join more files of the same recording.
    #[arg(index = 2, value_name = "MORE", value_parser = recording())]
    more: Vec<PathBuf>,
    /// Read several files, one for each vehicle, as one recording.
    #[arg(long)]
    join: bool,
    /// Format of the recording [default: detected from its content].
    #[arg(long, value_name = "FORMAT", value_parser = format())]
    input_format: Option<Format>,
    /// Unit of time [default: as stated in the recording, or estimated from its numbers].
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    time_unit: Option<TimeUnit>,
    /// Frames per second, for times in frames.
    #[arg(
        long = "fps",
        value_name = "HZ",
        conflicts_with_all = ["time_unit", "time_scale"],
        allow_negative_numbers = true
    )]
    frames_per_s: Option<f64>,
    /// Seconds per unit of time.
    #[arg(long, value_name = "SECONDS", conflicts_with = "time_unit", allow_negative_numbers = true)]
    time_scale: Option<f64>,
    /// Sort rows that go back in time.
    #[arg(long)]
    sort: bool,
    /// Row to read of several rows of a vehicle at one time [default: refuse, unless they are equal].
    #[arg(long, value_name = "WHICH", value_parser = duplicates())]
    duplicates: Option<Duplicates>,
    /// Read all rows of a table as one vehicle, whatever its other columns.
    #[arg(long)]
    one_vehicle: bool,
    /// Read a row that lacks a coordinate as a row without a position.
    #[arg(long)]
    skip_incomplete: bool,
    /// Confirm that vehicles with equal positions are different vehicles.
    #[arg(long)]
    distinct: bool,
    /// Times of messages: their stamps, or the times at which they were logged [default: stamps, if all have one].
    #[arg(long, value_name = "CLOCK", value_parser = clock())]
    clock: Option<MessageClock>,
    /// Numbers of a vehicle in a table without a header: x and y, x to z, or these with their velocities.
    #[arg(long, value_name = "NUMBERS", value_parser = dimensions())]
    dimensions: Option<Dimensions>,
    /// Metres per unit of length; three numbers, with signs, apply to x, y and z [default: 1].
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    scale: Option<Scale>,
    /// Directions of the axes: enu, ned, nwu and similar, or the source of x, y and z, such as y,x,-z.
    #[arg(long, value_name = "AXES", allow_hyphen_values = true)]
    axes: Option<Axes>,
    /// Name of the column of a role: t, id, x, y, z, vx, vy, vz, radius, or lat, lon, alt. In NPZ, t and x name arrays.
    #[arg(long = "column", value_name = "ROLE=NAME", value_parser = column)]
    columns: Vec<(String, String)>,
    /// Start of a vehicle's curve [m], for relative polynomials; repeatable.
    #[arg(long = "start", value_name = "NAME=X,Y,Z", value_parser = start, allow_hyphen_values = true)]
    starts: Vec<(String, [f64; 3])>,
    /// Order of the axes of the position array in an NPZ archive, if it is ambiguous: time, vehicle and axis (of x, y,
    /// z), such as time,vehicle,axis.
    #[arg(long, value_name = "AXES", value_parser = ArrayAxis::layout_of)]
    layout: Option<ArrayLayout>,
    /// Frame into which transforms of the recording bring all positions, if messages have several frames.
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Topic to read, if several topics describe the same vehicles; repeatable.
    #[arg(long = "topic", value_name = "NAME")]
    topics: Vec<String>,
    /// Origin of geographic positions: degrees, and metres above the ellipsoid [default: the first position].
    #[arg(long, value_name = "LAT,LON,HEIGHT", value_parser = origin, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Motion after the end of a planner's plan: hold the last point, continue with the last velocity, or unknown,
    /// which is not judged [default: hold].
    #[arg(long, value_name = "END")]
    plan_end: Option<PlanEnd>,
    /// Accept an MCAP file that was not closed, and read its contents.
    #[arg(long)]
    allow_unfinished: bool,
}

impl ReadArguments {
    /// Returns the only file or folder, for a command that is `done` with one.
    #[cfg(feature = "viewer")]
    pub(super) fn only(&self, done: &str) -> Result<&Path, Failure> {
        if self.more.is_empty() {
            return Ok(&self.recording);
        }
        let message = format!("RECORDING: must be one recording to be {done}, got several");
        let help = "if each file holds a vehicle of one recording, give a folder with the files";
        Err(Failure::input("usage/several-recordings", message, help))
    }

    /// Returns the files of each recording; with --join all files are one recording.
    pub(super) fn recordings(&self) -> Vec<Vec<PathBuf>> {
        let paths = std::iter::once(&self.recording).chain(&self.more).cloned();
        if self.join { vec![paths.collect()] } else { paths.map(|path| vec![path]).collect() }
    }

    /// Returns the options for reading each recording.
    pub(super) fn options(&self) -> ReadOptions {
        let mut columns = ColumnNames::default();
        for (role, name) in &self.columns {
            columns.set(role, name);
        }
        ReadOptions {
            format: self.input_format,
            time_unit: self.time_unit,
            times_per_second: self.frames_per_s.or(self.time_scale.map(f64::recip)),
            sort: self.sort,
            duplicates: self.duplicates,
            scale: self.scale,
            axes: self.axes,
            dimensions: self.dimensions,
            one_vehicle: self.one_vehicle,
            skip_incomplete: self.skip_incomplete,
            distinct: self.distinct,
            clock: self.clock,
            starts: self.starts.iter().cloned().collect(),
            columns,
            layout: self.layout,
            frame: self.frame.clone(),
            topics: self.topics.clone(),
            origin: self.origin,
            plan_end: self.plan_end,
            allow_unfinished: self.allow_unfinished,
            ..ReadOptions::default()
        }
    }
}

fn clock() -> impl TypedValueParser<Value = MessageClock> {
    one_of(MessageClock::ALL.map(|clock| (clock.name().into(), clock)).into())
}

fn duplicates() -> impl TypedValueParser<Value = Duplicates> {
    one_of(Duplicates::ALL.map(|which| (which.name().into(), which)).into())
}

/// Returns a parser of paths; for the folder of a run it returns the recording in it.
fn recording() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|path| recording_in(&path))
}

fn column(text: &str) -> Result<(String, String), String> {
    let roles = ColumnNames::ROLES;
    match text.split_once('=') {
        Some((role, name)) if roles.contains(&role) && !name.is_empty() => Ok((role.to_owned(), name.to_owned())),
        Some((role, _)) if !roles.contains(&role) => {
            Err(format!("unknown role `{role}`; the roles are {}", roles.join(", ")))
        }
        _ => Err("write ROLE=NAME, such as x=pos_east".to_owned()),
    }
}

fn start(text: &str) -> Result<(String, [f64; 3]), String> {
    let (name, place) = text.rsplit_once('=').ok_or("write NAME=X,Y,Z, such as cf3=0,1.5,0")?;
    Ok((name.to_owned(), three(place)?))
}

pub(super) fn origin(text: &str) -> Result<[f64; 3], String> {
    match three(text)? {
        [latitude, longitude, _] if latitude.abs() > 90.0 || longitude.abs() > 360.0 => {
            Err("the latitude must be within 90 degrees, the longitude within 360".to_owned())
        }
        place => Ok(place),
    }
}

pub(super) fn three(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match <[f64; 3]>::try_from(numbers.unwrap_or_default()) {
        Ok(numbers) if numbers.iter().all(|x| x.is_finite()) => Ok(numbers),
        _ => Err(format!("`{text}` is not three numbers")),
    }
}

fn unit() -> impl TypedValueParser<Value = TimeUnit> {
    one_of(TimeUnit::ALL.map(|unit| (unit.name().into(), unit)).into())
}

fn dimensions() -> impl TypedValueParser<Value = Dimensions> {
    one_of(Dimensions::ALL.map(|dimensions| (dimensions.name().into(), dimensions)).into())
}

/// Returns a parser of readable formats.
fn format() -> impl TypedValueParser<Value = Format> {
    one_of(
        Format::all()
            .map(|format| (PossibleValue::new(format.name).help(format.docs.replace('`', "")), format))
            .collect(),
    )
}
