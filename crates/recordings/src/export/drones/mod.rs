//! Exports to formats that drones fly: Crazyflie trajectories and Skybrush shows.
//!
//! These formats hold less than a recording. A flight is fitted by polynomials ([`fit`]), rounded to the numbers of the
//! format, and encoded. The encoded curves are decoded again and compared with the flight: the largest
//! distance at any instant is proved ([`motion::deviation`]), not sampled.
//!
//! [`encode`] returns files in memory. A caller that writes them reads the files back and judges what the files hold.

mod crazyflie;
mod evaluation;
pub mod fit;
pub mod motion;
pub(crate) mod skybrush;

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use rayon::prelude::*;

use self::fit::{FitError, Piece};
use self::motion::{Arc, Deviation, Motion, deviation};
use crate::read::error::ReadError;
use crate::segments::Trajectory;
use tautline_core::failure::Failure;
use tautline_core::option::{COMPRESSED, FROM, SKYB_VERSION, TOLERANCE, UNTIL};
use tautline_core::track::{Item, Sample, Tracks};

/// Format that drones fly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// Folder with a CSV of polynomials, or compressed segments, for each Crazyflie.
    Crazyflie,
    /// Folder with a compiled Skybrush trajectory for each drone.
    Skyb,
    /// Skybrush show.
    Skyc,
}

impl Dialect {
    /// All dialects.
    pub const ALL: [Self; 3] = [Self::Crazyflie, Self::Skyb, Self::Skyc];

    /// Returns the name for `--format`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Crazyflie => "crazyflie",
            Self::Skyb => "skyb",
            Self::Skyc => "skyc",
        }
    }

    /// Returns the name for messages.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Crazyflie => "Crazyflie trajectories",
            Self::Skyb => "Skybrush trajectories",
            Self::Skyc => "a Skybrush show",
        }
    }

    /// Returns whether the output is a folder with a file for each vehicle.
    #[must_use]
    pub fn is_folder(self) -> bool {
        matches!(self, Self::Crazyflie | Self::Skyb)
    }
}

/// Options of an export for drones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DroneOptions {
    /// Format.
    pub dialect: Dialect,
    /// Largest distance of a curve from the flight \[m\].
    pub tolerance_m: f64,
    /// Whether Crazyflie trajectories are compressed.
    pub is_compressed: bool,
    /// Version of `.skyb` files: 1, or 2 with a checksum.
    pub skyb_version: u8,
    /// Safety distance \[m\] that a show states.
    pub delta_m: Option<f64>,
}

impl DroneOptions {
    /// Default tolerance of fitted curves \[m\].
    pub const TOLERANCE_M: f64 = 0.01;

    /// Returns the options of a format with their defaults.
    #[must_use]
    pub fn new(dialect: Dialect) -> Self {
        Self { dialect, tolerance_m: Self::TOLERANCE_M, is_compressed: false, skyb_version: 2, delta_m: None }
    }
}

/// Encoded flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoded {
    /// Files in the order of the vehicles, or one file.
    pub files: Vec<DroneFile>,
    /// Vehicles in the order of the flight.
    pub vehicles: Vec<EncodedVehicle>,
}

/// Encoded file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DroneFile {
    /// Name in the folder of the output; empty if the output is this file.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Vehicle of an encoded flight.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedVehicle {
    /// Name in the flight.
    pub name: String,
    /// Name in the output.
    pub label: String,
    /// Number of polynomials.
    pub parts: usize,
    /// Size of its motion in the memory of a drone, or in the file \[bytes\].
    pub bytes: usize,
    /// Bound on the error of each polynomial that a drone computes in single precision \[m\].
    pub evaluation_m: Vec<f64>,
}

impl EncodedVehicle {
    /// Adds the error of single precision to the arcs of the motion that its file holds. Returns the largest error
    /// \[m\].
    pub fn add_evaluation(&self, motion: &mut Motion) -> f64 {
        let largest_m = self.evaluation_m.iter().copied().fold(0.0, f64::max);
        let is_each = self.evaluation_m.len() == motion.arcs.len();
        for (index, arc) in motion.arcs.iter_mut().enumerate() {
            arc.rounding_m += if is_each { self.evaluation_m[index] } else { largest_m };
        }
        largest_m
    }
}

/// Vehicle of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlownVehicle {
    /// Name.
    pub name: String,
    /// Motion.
    pub motion: Motion,
    /// Radius \[m\], if recorded.
    pub radius_m: Option<f64>,
}

/// Reads all motions of a recording. Samples are joined by straight lines. Gaps are joined too, so the caller must
/// refuse gaps before.
///
/// # Errors
/// [`ReadError`] if the recording cannot be read.
pub fn motions(recording: &mut dyn Tracks<Error = ReadError>) -> Result<Vec<FlownVehicle>, ReadError> {
    let (mut items, mut flown, mut last) = (Vec::new(), Vec::<FlownVehicle>::new(), Vec::<Option<Sample>>::new());
    while recording.read(&mut items)? {
        for item in items.drain(..) {
            let vehicle = item.vehicle();
            if flown.len() <= vehicle {
                flown.resize_with(vehicle + 1, FlownVehicle::default);
                last.resize(vehicle + 1, None);
            }
            let FlownVehicle { motion: Motion { arcs }, radius_m, .. } = &mut flown[vehicle];
            match item {
                Item::Sample(sample) => {
                    *radius_m = sample.radius_m;
                    if let Some(before) = last[vehicle].replace(sample) {
                        arcs.push(Arc::straight(before.time_s, sample.time_s, before.position_m, sample.position_m));
                    }
                }
                Item::Piece(piece) => {
                    if let Some(before) = arcs.last().filter(|before| before.to_s < piece.from_s) {
                        let (from_s, from) = (before.to_s, before.points[before.points.len() - 1]);
                        arcs.push(Arc::straight(from_s, piece.from_s, from, from));
                    }
                    arcs.push(Arc::of_powers(piece.from_s, piece.to_s, &piece.coefficients));
                }
            }
        }
    }
    flown.resize_with(recording.vehicles().len(), FlownVehicle::default);
    for (vehicle, name) in flown.iter_mut().zip(recording.vehicles()) {
        vehicle.name.clone_from(name);
    }
    Ok(flown)
}

/// Encodes vehicles with their motions, which begin at 0 s.
///
/// # Errors
/// [`DroneError`] if the format cannot hold a motion within the tolerance, or `is_interrupted` returns true.
pub fn encode(
    flight: &[(String, Motion)],
    options: &DroneOptions,
    is_interrupted: &(dyn Fn() -> bool + Sync),
) -> Result<Encoded, DroneError> {
    let tolerance_m = options.tolerance_m;
    if !(tolerance_m > 0.0 && tolerance_m.is_finite()) {
        return Err(DroneError::Tolerance(tolerance_m));
    }
    if !matches!(options.skyb_version, 1 | 2) {
        return Err(DroneError::SkybVersion(options.skyb_version));
    }
    let end_s = |motion: &Motion| motion.span_s().map_or(0.0, |span| span.1);
    if let Some((name, motion)) = flight.iter().find(|(_, motion)| end_s(motion) > LONGEST_S) {
        return Err(DroneError::Duration { vehicle: name.clone(), duration_s: end_s(motion) });
    }
    let labels = labels(flight, options.dialect)?;
    let work = Work { options, is_interrupted };
    let vehicles: Vec<_> = flight.iter().zip(labels).map(|((name, motion), label)| (name, label, motion)).collect();
    if options.dialect == Dialect::Skyc {
        return skybrush::show(&work, &vehicles);
    }
    let encoded = vehicles.par_iter().map(|(name, label, motion)| match options.dialect {
        Dialect::Crazyflie if options.is_compressed => crazyflie::compressed(&work, name, label, motion),
        Dialect::Crazyflie => crazyflie::polynomials(&work, name, label, motion),
        _ => skybrush::trajectory(&work, name, label, motion),
    });
    let (files, vehicles) = first_error(encoded)?.into_iter().unzip();
    Ok(Encoded { files, vehicles })
}

/// Returns whether the content of a file is that of an export to a folder.
///
/// # Errors
/// The error of the system.
pub fn is_exported(path: &Path) -> io::Result<bool> {
    let mut bytes = Vec::new();
    File::open(path)?.take(crazyflie::MEMORY_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    Ok(match path.extension().and_then(|extension| extension.to_str()) {
        Some("csv") => bytes.starts_with(b"duration,x^0"),
        Some("skyb") => bytes.starts_with(skybrush::MAGIC),
        Some("traj") => Trajectory::decode(&bytes, true).is_ok_and(|(_, length)| length == bytes.len()),
        _ => false,
    })
}

/// Returns all results in order, or the error of the first vehicle that has one, for any number of threads.
fn first_error<T: Send>(
    results: impl IndexedParallelIterator<Item = Result<T, DroneError>>,
) -> Result<Vec<T>, DroneError> {
    results.collect::<Vec<_>>().into_iter().collect()
}

/// Longest flight \[s\]: a day.
const LONGEST_S: f64 = 86_400.0;

/// Vehicle with its name, its name in the output and its motion.
type Vehicle<'a> = (&'a String, String, &'a Motion);

/// Options of the work on each vehicle.
struct Work<'a> {
    options: &'a DroneOptions,
    is_interrupted: &'a (dyn Fn() -> bool + Sync),
}

/// Number of fits, each within a smaller tolerance, until the rounded curve is within the requested one.
const MOST_FITS: u32 = 5;
/// Share of the tolerance of the first fit that a later one keeps.
const FIT_SHARE: f64 = 0.8;
/// Share of the tolerance that is left for the width of proved bounds.
const BOUND_SHARE: f64 = 0.02;

impl Work<'_> {
    /// Fits and encodes a motion such that the decoded curve is within the tolerance.
    ///
    /// `encode` rounds pieces, and returns the result with its decoded curve, or `None` if other pieces are needed.
    /// `reserve_m` bounds the distance that its rounding adds.
    fn within<T>(
        &self,
        name: &str,
        motion: &Motion,
        reserve_m: f64,
        is_allowed: fn(u64) -> bool,
        encode: impl Fn(&[Piece]) -> Result<Option<(T, Motion)>, DroneError>,
    ) -> Result<T, DroneError> {
        let tolerance_m = self.options.tolerance_m;
        let mut aim_m = tolerance_m * (1.0 - BOUND_SHARE) - reserve_m;
        if aim_m <= 0.0 {
            return Err(DroneError::Resolution { tolerance_m, rounding_m: reserve_m });
        }
        let mut nearest: Option<Deviation> = None;
        for _ in 0..MOST_FITS {
            let pieces =
                fit::fit(motion, aim_m, is_allowed, &|| (self.is_interrupted)()).map_err(|error| match error {
                    FitError::Interrupted => DroneError::Interrupted,
                    FitError::TooFast(time_s) => DroneError::TooFast { vehicle: name.to_owned(), time_s, tolerance_m },
                })?;
            if let Some((encoded, curve)) = encode(&pieces)? {
                let found = deviation_with_rests(motion, &curve);
                if found.bound_m <= tolerance_m {
                    return Ok(encoded);
                }
                nearest = Some(found);
            }
            aim_m *= FIT_SHARE;
        }
        let time_s = nearest.map_or(0.0, |found| found.time_s);
        Err(DroneError::TooFast { vehicle: name.to_owned(), time_s, tolerance_m })
    }
}

/// Refuses a motion larger than the memory `what` of `most` bytes. `compresses`: a compressed form exists.
fn check_size(
    name: &str,
    [pieces, bytes]: [usize; 2],
    (what, most, compresses): (&'static str, usize, bool),
) -> Result<(), DroneError> {
    let vehicle = name.to_owned();
    if bytes > most { Err(DroneError::TooLong { vehicle, pieces, bytes, what, most, compresses }) } else { Ok(()) }
}

/// Returns the deviation of two motions from 0 s on. Each rests after its end.
#[must_use]
pub fn deviation_with_rests(flight: &Motion, curve: &Motion) -> Deviation {
    let end_s = [flight, curve].iter().filter_map(|motion| motion.span_s()).map(|span| span.1).fold(0.0, f64::max);
    let [flight, curve] = [flight, curve].map(|motion| motion.clone().resting_until(end_s));
    let unknown = Deviation { bound_m: f64::INFINITY, found_m: f64::INFINITY, time_s: 0.0 };
    deviation(&flight, &curve).unwrap_or(unknown)
}

/// Longest label \[bytes\].
const LONGEST_LABEL: usize = 120;

/// Returns the names of the vehicles in the output. Other characters than letters, digits, `_`, `-` and `.` become `_`
/// in the names of files.
fn labels(flight: &[(String, Motion)], dialect: Dialect) -> Result<Vec<String>, DroneError> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    let label = |name: &String| {
        if !dialect.is_folder() {
            return name.clone();
        }
        let label: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
        label.trim_matches(['.', '_']).chars().take(LONGEST_LABEL).collect()
    };
    let labels: Vec<String> = flight.iter().map(|(name, _)| label(name)).collect();
    let mut sorted: Vec<_> = labels.iter().map(|label| label.to_lowercase()).zip(flight).collect();
    sorted.sort_by(|a, b| a.0.cmp(&b.0));
    if let Some((_, (name, _))) = sorted.iter().find(|(label, _)| label.is_empty()) {
        return Err(DroneError::Name { name: name.clone(), other: None });
    }
    match sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => Err(DroneError::Name { name: pair[1].1.0.clone(), other: Some(pair[0].1.0.clone()) }),
        None => Ok(labels),
    }
}

/// Reason why a flight cannot be exported to a format of drones.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DroneError {
    /// The tolerance is not a positive number.
    #[error("{TOLERANCE}: must be a positive number of metres, got {0:?}")]
    Tolerance(f64),
    /// The tolerance is below the rounding of the format.
    #[error(
        "{TOLERANCE}: the format rounds positions by up to {rounding_m:.6} m, got a tolerance of {tolerance_m:?} m"
    )]
    Resolution {
        /// Tolerance \[m\].
        tolerance_m: f64,
        /// Bound on the rounding \[m\].
        rounding_m: f64,
    },
    /// The version of `.skyb` is unknown.
    #[error("{SKYB_VERSION}: must be 1 or 2, got {0}")]
    SkybVersion(u8),
    /// A vehicle moves too fast for the tolerance.
    #[error("vehicle {vehicle} at {time_s:.3} s: no curve of the format is within {tolerance_m:?} m of the flight")]
    TooFast {
        /// Name of the vehicle.
        vehicle: String,
        /// Time \[s\], from the start of the export until [`Self::later`] shifts it.
        time_s: f64,
        /// Tolerance \[m\].
        tolerance_m: f64,
    },
    /// The motion of a vehicle does not fit into the memory.
    #[error(
        "vehicle {vehicle}: its flight needs {pieces} pieces of {bytes} bytes in total, and {what} holds {most} bytes"
    )]
    TooLong {
        /// Name of the vehicle.
        vehicle: String,
        /// Number of pieces.
        pieces: usize,
        /// Size of all pieces \[bytes\].
        bytes: usize,
        /// Name of the memory.
        what: &'static str,
        /// Size of the memory \[bytes\].
        most: usize,
        /// Whether a compressed form exists.
        compresses: bool,
    },
    /// The flight is too long for any drone.
    #[error("vehicle {vehicle}: its flight lasts {duration_s:?} s, and at most 86400 s are written")]
    Duration {
        /// Name of the vehicle.
        vehicle: String,
        /// Duration \[s\].
        duration_s: f64,
    },
    /// A position exceeds the numbers of the format.
    #[error(
        "vehicle {vehicle} at {time_s:.3} s: a coordinate of its curve is {coordinate_m:.3} m, and the format holds up \
         to {largest_m:?} m"
    )]
    TooFar {
        /// Name of the vehicle.
        vehicle: String,
        /// Time \[s\], from the start of the export until [`Self::later`] shifts it.
        time_s: f64,
        /// Coordinate \[m\].
        coordinate_m: f64,
        /// Largest coordinate \[m\].
        largest_m: f64,
    },
    /// The name of a vehicle gives no file name of its own.
    #[error(
        "vehicle {name:?}: its name gives {}",
        other.as_ref().map_or_else(|| "no file name".to_owned(), |other| format!("the file name of vehicle {other:?}"))
    )]
    Name {
        /// Name of the vehicle.
        name: String,
        /// Vehicle with the same file name.
        other: Option<String>,
    },
    /// The file cannot be made.
    #[error("cannot make the file: {0}")]
    Write(String),
    /// The caller has ended the work.
    #[error("interrupted")]
    Interrupted,
}

impl DroneError {
    /// Returns the error with its time counted from an earlier instant \[s\].
    #[must_use]
    pub fn later(mut self, by_s: f64) -> Self {
        if let Self::TooFast { time_s, .. } | Self::TooFar { time_s, .. } = &mut self {
            *time_s += by_s;
        }
        self
    }

    /// Returns the remedy, as a sentence without a full stop.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Tolerance(_) => "give a tolerance in metres, such as 0.01".to_owned(),
            Self::Resolution { .. } => format!("give a larger {TOLERANCE}, or move the origin nearer to the flight"),
            Self::SkybVersion(_) => format!("leave {SKYB_VERSION} out, or give 1 or 2"),
            Self::TooFast { .. } => {
                format!("give a larger {TOLERANCE}, or leave a jump of the recording out by {FROM} and {UNTIL}")
            }
            Self::TooLong { compresses: true, .. } => {
                format!("give a larger {TOLERANCE}, a shorter flight by {FROM} and {UNTIL}, or {COMPRESSED}")
            }
            Self::Duration { .. } => format!("check the unit of time, or give a shorter flight by {FROM} and {UNTIL}"),
            Self::TooLong { .. } => format!("give a larger {TOLERANCE}, or a shorter flight by {FROM} and {UNTIL}"),
            Self::TooFar { .. } => "move the origin nearer to the flight, or export to skyc".to_owned(),
            Self::Name { .. } => "rename the vehicle in the recording".to_owned(),
            Self::Write(_) => "free some space or write to another folder".to_owned(),
            Self::Interrupted => "run the command again".to_owned(),
        }
    }

    /// Returns the stable code of the error, such as `export/too-long`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Tolerance(_) | Self::Resolution { .. } => "export/tolerance",
            Self::SkybVersion(_) => "export/skyb-version",
            Self::TooFast { .. } => "export/too-fast",
            Self::TooLong { .. } | Self::Duration { .. } => "export/too-long",
            Self::TooFar { .. } => "export/too-far",
            Self::Name { .. } => "export/name",
            Self::Write(_) => "files/cannot-write",
            Self::Interrupted => "interrupted",
        }
    }

    /// Returns whether the operating system failed, or the caller ended the work.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        matches!(self, Self::Write(_) | Self::Interrupted)
    }
}

impl From<DroneError> for Failure {
    fn from(error: DroneError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}
