//! Reads recordings of many formats as a stream of [`Item`](tautline_core::track::Item)s.
//!
//! [`open`] recognises the format by the content of the file and returns a [`Tracks`](tautline_core::track::Tracks):
//! items in order of time, a clock, and notes for the user. Each format has a module that converts its content to rows
//! or pieces of curves. Order, clocks and limits are handled in common.
//!
//! Memory is bounded by the block being read, not by the file: a recording in order of time is streamed. An unordered
//! recording is sorted in memory, with a note in [`Tracks::notes`](tautline_core::track::Tracks::notes).
//!
//! # Errors
//! Readers refuse numbers that are not finite, cells that are not numbers and truncated files. They refuse a vehicle
//! with two positions at one time or with decreasing time, and two unrelated time columns. Each [`ReadError`] names the
//! file, the place, the value and the remedy. Inferences such as the unit of time appear in the notes.

mod agreement;
mod aviation;
mod axes;
mod bezier;
mod capture;
mod cells;
mod clock;
#[cfg(feature = "shows")]
mod compressed;
mod convention;
mod crazyflie;
mod csv;
pub(crate) mod curves;
mod earth;
pub(crate) mod error;
mod evidence;
mod folder;
mod format;
mod heading;
mod identity;
mod layout;
#[cfg(feature = "mcap")]
pub(crate) mod mcap;
mod npy;
mod npz;
mod objects;
mod options;
mod order;
#[cfg(feature = "arrow")]
pub(crate) mod parquet;
mod recognition;
#[cfg(feature = "shows")]
mod show_rules;
#[cfg(feature = "shows")]
mod skybrush;
mod source;
#[cfg(feature = "mcap")]
mod spline;
mod stated;
mod table;
mod time_unit;
mod ulog;

#[cfg(feature = "arrow")]
pub use self::parquet::is_guarded;
pub use axes::Axes;
pub use earth::EarthFrame;
pub use error::{ContentKind, Fault, Place, ReadError};
pub use format::{Format, FormatInfo};
pub use heading::is_read;
#[cfg(feature = "mcap")]
pub use mcap::{Channels, LivePlan, LivePose, has_live_poses, live_plans, live_poses};
pub use options::{ArrayAxis, ArrayLayout, ColumnNames, Dimensions, Duplicates, MessageClock, ReadOptions, Scale};
pub use order::Recording;
#[cfg(feature = "shows")]
pub use show_rules::{ShowPolygon, ShowRules};
pub use time_unit::TimeUnit;

use std::fs;
use std::path::Path;

#[cfg(feature = "mcap")]
use crate::mcap::McapRecording;
use error::refuse;
use folder::{ARCHIVE, Folder};
use format::Reader;
#[cfg(feature = "mcap")]
use mcap::bag;
use recognition::recognise;
use source::Source;
use tautline_core::option::JOIN;
use tautline_core::track::EarthOrigin;

/// Opens a recording: a file, the folder of a ROS 2 bag, or a folder or archive with one file per vehicle.
///
/// # Errors
/// [`ReadError`] if the file cannot be read, has an unknown format, or its beginning is invalid.
pub fn open(path: &Path, options: &ReadOptions) -> Result<Recording, ReadError> {
    let opened = match folder_of(path) {
        _ if recognition::is_bag(path) => open_bag(path, options),
        Ok(Some(folder)) => open_folder(folder, options),
        Ok(None) => open_one(Source::file(path), options),
        Err(error) => Err(error),
    };
    opened.and_then(|recording| stated::stated(recording, options, path)).map_err(|error| error.of(path))
}

/// Opens the plan of a flight, with its positions in the frame of the flight.
///
/// `of_flight` is the origin of the flight if the flight has places on the Earth.
///
/// # Errors
/// As [`open`]. Also if one of flight and plan has places on the Earth, and the other is in metres from an unknown
/// origin.
pub fn open_plan(path: &Path, of_flight: Option<&EarthOrigin>) -> Result<Recording, ReadError> {
    let from_place = |place: [f64; 3]| open(path, &ReadOptions { origin: Some(place), ..ReadOptions::default() });
    let (problem, remedy) = match (open(path, &ReadOptions::default()), of_flight) {
        // Several files of places on the Earth need an origin.
        (Err(error), Some(origin)) if lacks_origin(&error) => return from_place(origin.place),
        (Err(error), _) if !lacks_origin(&error) => return Err(error),
        (Ok(plan), _) => match (plan.earth_origin(), of_flight) {
            (Some(own), Some(origin)) if own.place != origin.place => return from_place(origin.place),
            (Some(_), None) => ON_EARTH,
            (None, Some(origin)) if origin.is_inferred => (
                "the plan is in metres, but the flight has places on the Earth and no origin is given",
                "give the origin of plan and flight: latitude, longitude and height",
            ),
            _ => return Ok(plan),
        },
        (Err(_), _) => ON_EARTH,
    };
    Err(ReadError::new(path, Fault::content(ContentKind::SeveralFrames, problem, remedy)))
}

/// Returns whether several files have places on the Earth and no origin.
fn lacks_origin(error: &ReadError) -> bool {
    matches!(error.fault, Fault::Content { kind: ContentKind::NoOrigin, .. })
}

/// Problem and remedy of a plan on the Earth of a flight in metres.
const ON_EARTH: (&str, &str) = (
    "the plan has places on the Earth, but the flight is in metres from an unknown origin",
    "give a plan in the metres of the flight",
);

/// Opens several files as one recording, with one vehicle per file, named after the file. Folders and archives
/// contribute all their files.
///
/// # Errors
/// As [`open`], and if a file holds several vehicles or the clocks of the files do not match.
pub fn open_joined(paths: &[&Path], options: &ReadOptions) -> Result<Recording, ReadError> {
    let mut all = Folder::default();
    for &path in paths {
        match folder_of(path).map_err(|error| error.of(path))? {
            Some(folder) => {
                all.files.extend(folder.files);
                all.folders.extend(folder.folders);
                all.left_out.extend(folder.left_out);
            }
            None => all.files.push(Source::file(path)),
        }
    }
    let name = recording_name(paths);
    let opened = open_folder(all, options);
    opened.and_then(|all| stated::stated(all, options, name.as_ref())).map_err(|error| error.of(name.as_ref()))
}

/// Opens the channels of a run recording or of an MCAP export; `None` without channels, and for any other recording.
///
/// # Errors
/// [`ReadError`] if the recording is damaged before its first instant.
#[cfg(feature = "mcap")]
pub fn open_channels(path: &Path) -> Result<Option<Channels>, ReadError> {
    let is_mcap = || recognise(&mut Source::file(path), None).is_ok_and(|format| format == Format::MCAP);
    if path.is_file() && is_mcap() { Channels::open(path).map_err(|error| error.of(path)) } else { Ok(None) }
}

/// Opens a recording of `tautline run` with all its data; `None` for any other file.
#[cfg(feature = "mcap")]
#[must_use]
pub fn open_run(path: &Path) -> Option<McapRecording> {
    if path.is_file() { mcap::open_run(path) } else { None }
}

/// Returns the name of several files that form one recording.
#[must_use]
pub fn recording_name(paths: &[&Path]) -> String {
    error::first_few(&paths.iter().map(|path| path.to_string_lossy()).collect::<Vec<_>>(), 3)
}

/// Returns the rules that the recording itself states, as Skybrush shows do; `None` for any other recording.
///
/// # Errors
/// [`ReadError`] if the file is a show that cannot be read.
#[cfg(feature = "shows")]
pub fn show_rules(path: &Path, options: &ReadOptions) -> Result<Option<ShowRules>, ReadError> {
    let mut source = Source::file(path);
    let is_show =
        path.is_file() && recognise(&mut source, options.format).is_ok_and(|format| format == Format::SKYBRUSH);
    if is_show { skybrush::rules(&source, options) } else { Ok(None) }
}

/// Returns the files of a folder or archive; `None` if the path is itself a recording.
fn folder_of(path: &Path) -> Result<Option<Folder>, ReadError> {
    let data = fs::metadata(path)?;
    if data.is_dir() {
        if recognition::is_bag(path) {
            let remedy = format!("open it without {JOIN}; its topics are the vehicles");
            return refuse(ContentKind::SeveralVehicles, "it is a ROS 2 bag, not a file with one vehicle", remedy);
        }
        let folder = Folder::open(path)?;
        let remedy =
            "give a folder with one table or polynomial file (.csv) per vehicle, or with one folder per vehicle";
        return if folder.is_empty() { Err(folder.without_tables("folder", remedy).into()) } else { Ok(Some(folder)) };
    }
    if !data.is_file() {
        let problem = "it is a pipe or a device, but a recording is read more than once";
        return refuse(ContentKind::NotAFile, problem, "save it to a file first");
    }
    if !recognition::is_archive(path)? {
        return Ok(None);
    }
    let folder = Folder::of_archive(path)?;
    let remedy = "give a .skyc or .npz file, or pack one table per vehicle";
    if folder.is_empty() { Err(folder.without_tables(ARCHIVE, remedy).into()) } else { Ok(Some(folder)) }
}

/// Opens files with one vehicle each.
fn open_folder(mut folder: Folder, options: &ReadOptions) -> Result<Recording, ReadError> {
    let several = folder.files.len() > 1;
    let with_file = |error: ReadError, shown: &Path| {
        let error = error.of(shown);
        if several { error.among_others() } else { error }
    };
    let format =
        folder.first().map(|first| recognise(first, options.format).map_err(|e| with_file(e, &first.display_path())));
    let left_out = folder.note();
    let format = format.transpose()?;
    let is_sequence = format.is_some_and(|format| matches!(format.reader, Reader::Sequences(_)));
    if !folder.folders.is_empty() && !is_sequence {
        return Err(folder.of_folders().into());
    }
    if let Some(format) = format
        && let Reader::Curves(open) | Reader::Sequences(open) = format.reader
    {
        options.refuse_unsupported_options(format)?;
        let alone = folder.files.into_iter().map(|file| (file.stem(), vec![file]));
        return open(alone.chain(folder.folders).collect(), left_out, options);
    }
    let options = ReadOptions { is_joined: true, ..options.clone() };
    let open = |file: Source| {
        let shown = file.display_path();
        Ok((shown.clone(), open_one(file, &options).map_err(|error| with_file(error, &shown))?))
    };
    folder::join(folder.files.into_iter().map(open).collect::<Result<_, ReadError>>()?, left_out)
}

fn open_bag(path: &Path, options: &ReadOptions) -> Result<Recording, ReadError> {
    options.check()?;
    if let Some(format) = options.format.filter(|format| *format != Format::MCAP) {
        return Err(Fault::wrong_format(format).into());
    }
    options.refuse_unsupported_options(Format::MCAP)?;
    #[cfg(feature = "mcap")]
    {
        bag::open(path, options)
    }
    #[cfg(not(feature = "mcap"))]
    {
        Err(ReadError::new(path, Fault::without_feature("mcap")))
    }
}

fn open_one(mut source: Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    options.check()?;
    let format = recognise(&mut source, options.format)?;
    options.refuse_unsupported_options(format)?;
    recognition::open(format, &source, options)
}

/// Channels of a recording of tautline: this build reads none, because it lacks the feature `mcap`.
#[cfg(not(feature = "mcap"))]
pub enum Channels {}

#[cfg(not(feature = "mcap"))]
impl Channels {
    /// Returns the channels of the next instant, one row per vehicle.
    ///
    /// # Errors
    /// [`ReadError`] if the recording is damaged.
    pub fn next(&mut self, _vehicles: usize) -> Result<Vec<tautline_core::record::Channel>, ReadError> {
        match *self {}
    }
}
