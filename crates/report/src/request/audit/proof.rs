//! `tautline audit --proof`: a verdict that `check_proof.py` confirms without this program.
//!
//! The file holds the verdict and the extreme of each limit, and the facts that the recording does not contain. The
//! checker derives everything else.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::fs;
use std::fs::File;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::Failure;
use super::{AuditRequest, OwnRecording, Subject};
use crate::report::recorded::Clock;
use tautline_audit::envelope::{LimitOutcome, Quantity};
use tautline_audit::recorded::{Approach, Interpolation, ObjectPair, Outcome, Settings, TOUCHING_ELLIPSOIDS};
use tautline_audit::{MovingObstacle, Status};
use tautline_core::files::write_atomically;
use tautline_core::obstacle::Shape;
use tautline_core::option::{
    ABOVE, CYLINDER, DELTA, ELLIPSOID, FENCE, FROM, IDS, LAND_ON, LIMIT, MAX_GAP, MOTION, OBSTACLES, OFFSET, PLAN,
    PROOF, RADIUS, UNTIL, WELL_CLEAR,
};
use tautline_core::record::sha256_hex;
use tautline_recordings::read::{ColumnNames, ReadOptions, TimeUnit};

/// Names of the time column that the checker accepts, and the unit that a name gives.
const TIMES: [(&str, Option<TimeUnit>); 4] =
    [("t_s", Some(TimeUnit::Seconds)), ("time_s", Some(TimeUnit::Seconds)), ("t", None), ("time", None)];
/// Names of the other columns that the checker needs.
const COLUMNS: [&str; 4] = ["id", "x", "y", "z"];
/// Names of columns that do not change the reading; those of the exports of a run, besides velocities.
const UNUSED: [&str; 18] = [
    "vx",
    "vy",
    "vz",
    "qw",
    "qx",
    "qy",
    "qz",
    "thrust_1_n",
    "thrust_2_n",
    "thrust_3_n",
    "thrust_4_n",
    "heading_rad",
    "speed_m_s",
    "wind_x_m_s",
    "wind_y_m_s",
    "wind_z_m_s",
    "oldest_s",
    "mean_s",
];

/// Version of the file. A new motion, limit or format of data is a new name within this version.
const VERSION: u32 = 3;

/// Way to a recording with a proof.
const EXPORT: &str = "write it as a table with `tautline export RECORDING -o FILE.csv`, and audit that";

/// Content of the file.
#[derive(Serialize)]
struct ProofFile<'a> {
    format: &'static str,
    version: u32,
    data: Data<'a>,
    claim: Claim<'a>,
    assumed: Assumed<'a>,
}

/// The recording of the claim.
#[derive(Serialize)]
struct Data<'a> {
    /// `csv` for a table, `run` for the `run.mcap` of `tautline run`, `crazyflie` and `bezier` for files of curves.
    format: &'static str,
    recording: &'a str,
    sha256: Hashes,
}

/// SHA-256 of the file, or of the file of each vehicle.
#[derive(Serialize)]
#[serde(untagged)]
enum Hashes {
    Of(String),
    ByVehicle(BTreeMap<String, String>),
}

/// Files that the checker reads.
enum Files {
    /// A long table.
    Table(PathBuf),
    /// Recording of `tautline run`.
    Run(PathBuf),
    /// Curves, with a file for each vehicle.
    Curves { format: &'static str, by_vehicle: BTreeMap<String, PathBuf> },
}

/// A part of a question without a proof, and the remedy.
type Unproved = (String, String);

/// The verdict, which the checker computes and compares.
#[derive(Serialize)]
struct Claim<'a> {
    status: Status,
    motion: &'static str,
    limits: Vec<ClaimedLimit<'a>>,
}

/// A limit with its verdict.
#[derive(Serialize)]
struct ClaimedLimit<'a> {
    kind: &'static str,
    status: Status,
    #[serde(flatten)]
    content: Content<'a>,
}

/// Numbers of a limit, and the extreme that the checker computes and compares.
#[derive(Serialize)]
#[serde(untagged)]
enum Content<'a> {
    /// Smallest allowed separation of two vehicles.
    Pairs {
        #[serde(flatten)]
        lengths: PairLengths<'a>,
        /// Largest double at or below the smallest separation: in metres, half axes, or relative to the cylinder.
        smallest: f64,
        /// Names of the two vehicles with the smallest separation.
        pair: [&'a str; 2],
        /// Height at or below which pairs are not judged \[m\].
        above_m: Option<f64>,
    },
    /// Smallest allowed distance from obstacles.
    Obstacles {
        /// Smallest distance of a vehicle from a surface, negative inside \[m\].
        smallest: f64,
        vehicle: &'a str,
        obstacle: &'a str,
        obstacles: Vec<ClaimedObstacle<'a>>,
    },
    /// Allowed value of a quantity of each vehicle.
    Vehicle { limit: f64, extreme: f64, vehicle: &'a str },
    /// Fence around each vehicle.
    Fence {
        /// Smallest distance inside the fence \[m\]; `None` if a vehicle is outside.
        smallest: Option<f64>,
        vehicle: &'a str,
        corners_m: Vec<[f64; 2]>,
        height_m: Option<[f64; 2]>,
        margin_m: f64,
    },
}

/// Lengths of a limit of two vehicles.
#[derive(Serialize)]
#[serde(untagged)]
enum PairLengths<'a> {
    Distance { delta_m: Option<f64>, radii_m: BTreeMap<&'a str, f64> },
    Ellipsoid { half_axes_m: [f64; 3], scaled: f64 },
    Cylinder { horizontal_m: f64, vertical_m: f64 },
}

/// Obstacle at rest.
#[derive(Serialize)]
struct ClaimedObstacle<'a> {
    name: &'a str,
    at_m: [f64; 3],
    clearance_m: f64,
    shape: ClaimedShape,
}

/// Shape of an obstacle; a box has the directions of the axes.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
enum ClaimedShape {
    Ball { radius_m: f64 },
    Box { half_m: [f64; 3] },
    Capsule { from_m: [f64; 3], to_m: [f64; 3], radius_m: f64 },
    HalfSpace { normal: [f64; 3] },
}

/// Facts that the recording does not contain.
#[derive(Serialize)]
struct Assumed<'a> {
    time_unit: &'a str,
    /// Largest gap that is joined, by vehicle \[s\]; null if every gap is joined.
    max_gaps_s: BTreeMap<&'a str, f64>,
    /// Shifts of clocks, by vehicle \[s\].
    offsets_s: BTreeMap<&'a str, f64>,
}

/// Rejects requests without a proof, before the work begins.
pub(super) fn check(
    request: &AuditRequest<'_>,
    settings: &Settings,
    own: Option<&OwnRecording>,
) -> Result<(), Failure> {
    if request.proof.is_none() {
        return Ok(());
    }
    let files = unproved_option(request, settings).map_or_else(|| files(request, settings, own), Err);
    let unproved = files.map(|files| match files {
        Files::Table(_) | Files::Run(_) => unproved_limit(settings),
        Files::Curves { .. } => unproved_of_curves(settings),
    });
    let (what, remedy) = match unproved {
        Ok(None) => return Ok(()),
        Ok(Some(unproved)) | Err(unproved) => unproved,
    };
    Err(Failure::input("audit/no-proof", format!("{PROOF}: no proof of {what}"), remedy))
}

/// Returns the files of a recording that the checker reads.
fn files(request: &AuditRequest<'_>, settings: &Settings, own: Option<&OwnRecording>) -> Result<Files, Unproved> {
    let refuse = |what: &str, remedy: &str| Err((what.to_owned(), remedy.to_owned()));
    let Subject::Files { paths, options } = &request.subject else {
        return refuse("motion in memory", "write it to a file");
    };
    let is_plain = is_read_plainly(options);
    if let ([path], Some(own)) = (&paths[..], own) {
        if !is_plain || !own.is_read_as_written() {
            return refuse("a changed reading of a run", "read the run without options of reading");
        }
        if !own.holds_every_step() && settings.motion != Some(Interpolation::Linear) {
            let what = "a recording without every step of its run, or with curved steps";
            let rate = "fly with a `time.record_hz` of at least 1 / `time.dt_s`";
            return refuse(what, &format!("{rate}, or assume straight lines with {}", MOTION.set("linear")));
        }
        return Ok(Files::Run(path.clone()));
    }
    if let Some(curves) = curves(paths) {
        return if is_plain {
            Ok(curves)
        } else {
            refuse("a changed reading of curves", "read the files without options")
        };
    }
    let [path] = &paths[..] else { return refuse("a recording that is not one file", EXPORT) };
    let Some(time) = time_of_table(path).filter(|_| is_plain) else {
        let what = "a file that is no table with the columns t_s (t, time, time_s), id, x, y, z and those of exports";
        return refuse(what, EXPORT);
    };
    if time.is_some_and(|unit| options.time_unit.is_some_and(|given| given != unit)) {
        return refuse("times in another unit than the name of their column", "rename the column to t");
    }
    Ok(Files::Table(path.clone()))
}

/// Returns the files of curves that the checker reads: CSV files of one format, with a vehicle each; `None` for other
/// recordings.
fn curves(paths: &[PathBuf]) -> Option<Files> {
    let files: Vec<PathBuf> = match paths {
        [folder] if folder.is_dir() => {
            let entries = fs::read_dir(folder).ok()?.map(|entry| entry.map(|entry| entry.path()));
            let files = entries.collect::<Result<Vec<_>, _>>().ok()?;
            files.into_iter().filter(|file| file.extension().is_some_and(|end| end == "csv")).collect()
        }
        files => files.to_vec(),
    };
    let mut formats = files.iter().map(|file| curve_format(file));
    let format = formats.next()??;
    let is_same = formats.all(|other| other == Some(format));
    let name = |file: &Path| Some(file.file_stem()?.to_str()?.to_owned());
    let by_vehicle = files.iter().map(|file| Some((name(file)?, file.clone()))).collect::<Option<BTreeMap<_, _>>>()?;
    (is_same && by_vehicle.len() == files.len()).then_some(Files::Curves { format, by_vehicle })
}

/// Returns the format of a file of curves by its header.
fn curve_format(path: &Path) -> Option<&'static str> {
    let mut lines = csv::ReaderBuilder::new().comment(Some(b'#')).flexible(true).from_reader(File::open(path).ok()?);
    let names: Vec<_> = lines.headers().ok()?.iter().map(|name| name.trim().to_ascii_lowercase()).collect();
    let (duration, columns) = names.split_first()?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_power = |name: &String| {
        name.split_once('^').is_some_and(|(axis, power)| ["x", "y", "z", "yaw"].contains(&axis) && is_number(power))
    };
    let is_point = |name: &String| {
        name.strip_prefix('p')
            .is_some_and(|point| ["x", "y", "z"].iter().any(|axis| point.strip_suffix(axis).is_some_and(is_number)))
    };
    if duration.trim_start_matches('\u{feff}') != "duration" || columns.is_empty() {
        return None;
    }
    if columns.iter().all(is_power) {
        return Some("crazyflie");
    }
    // A planar curve has no proof.
    (columns.iter().all(is_point) && columns.iter().any(|name| name == "p0z")).then_some("bezier")
}

/// Returns the first option whose effect the checker does not compute for any motion.
fn unproved_option(request: &AuditRequest<'_>, settings: &Settings) -> Option<Unproved> {
    let is_other = [
        (
            settings.motion.is_some_and(|motion| matches!(motion, Interpolation::Hold | Interpolation::Bounded)),
            "a motion that is neither linear nor polynomial".to_owned(),
            format!("leave out {MOTION}"),
        ),
        (settings.well_clear.is_some(), WELL_CLEAR.to_string(), leave_out(&WELL_CLEAR)),
        (request.options.plan.is_some(), PLAN.to_string(), leave_out(&PLAN)),
        (!settings.land_on.is_empty(), LAND_ON.to_string(), leave_out(&LAND_ON)),
        (
            settings.from_s.is_some() || settings.until_s.is_some(),
            format!("a part of a recording ({FROM}, {UNTIL})"),
            format!("audit the whole recording, with {OFFSET} and {MAX_GAP} as needed"),
        ),
        (settings.only.is_some(), format!("some of the vehicles ({IDS})"), leave_out(&IDS)),
    ];
    is_other.into_iter().find(|(is_asked, ..)| *is_asked).map(|(_, what, remedy)| (what, remedy))
}

fn leave_out(option: &dyn Display) -> String {
    format!("leave out {option}, or audit it without {PROOF}")
}

/// Returns the first limit that the checker does not compute for straight lines.
fn unproved_limit(settings: &Settings) -> Option<Unproved> {
    if let Some(limit) = settings.envelope.limits.iter().find(|limit| !is_proved(limit.quantity)) {
        let option = LIMIT.set(limit.quantity.name());
        return Some((option.to_string(), leave_out(&option)));
    }
    if settings.envelope.fence.as_ref().is_some_and(|fence| !fence.is_single_inclusion()) {
        return Some(("several polygons of a fence".to_owned(), "give one polygon".to_owned()));
    }
    let has_radii = settings.vehicles.values().any(|vehicle| vehicle.radius_m.is_some());
    settings.obstacles.iter().find_map(|obstacle| {
        let refuse =
            |what: &str, remedy: &str| Some((format!("the obstacle `{}`, {what}", obstacle.name), remedy.to_owned()));
        match obstacle.shape {
            _ if obstacle.path.len() != 1 => refuse("which moves", &format!("give {OBSTACLES} at rest")),
            Shape::Box { yaw_deg, .. } if yaw_deg.rem_euclid(90.0) != 0.0 => {
                refuse("a box with a yaw that is no multiple of 90 degrees", "give a ball or a capsule around it")
            }
            _ if has_radii && obstacle.clearance_m.is_none() => refuse(
                "whose clearance differs by vehicle",
                &format!("give its `clearance_m`, or one {RADIUS} for all"),
            ),
            _ => None,
        }
    })
}

/// Returns the first part of a question that the checker does not compute for curves.
fn unproved_of_curves(settings: &Settings) -> Option<Unproved> {
    let is_other = [
        (settings.cylinder.is_some(), CYLINDER),
        (settings.above_m.is_some(), ABOVE),
        (!settings.obstacles.is_empty(), OBSTACLES),
        (!settings.envelope.limits.is_empty(), LIMIT),
        (settings.envelope.fence.is_some(), FENCE),
        (settings.vehicles.values().any(|own| own.offset_s != 0.0), OFFSET),
    ];
    let (_, option) = is_other.into_iter().find(|(is_asked, _)| *is_asked)?;
    let remedy = format!("ask for {DELTA}, {RADIUS} or {ELLIPSOID} alone");
    Some((format!("{option} for curves"), remedy))
}

/// Returns whether the checker computes the extreme of a quantity on straight lines.
fn is_proved(quantity: Quantity) -> bool {
    match quantity {
        Quantity::Speed
        | Quantity::HorizontalSpeed
        | Quantity::Climb
        | Quantity::Descent
        | Quantity::Height
        | Quantity::Floor
        | Quantity::Fence => true,
        Quantity::Acceleration | Quantity::NavigationFloor | Quantity::YawRate => false,
    }
}

/// Returns whether a file is read unchanged, in metres.
fn is_read_plainly(options: &ReadOptions) -> bool {
    let is_moved = options.scale.is_some() || options.axes.is_some() || options.times_per_second.is_some();
    let is_chosen = options.sort || options.one_vehicle || options.skip_incomplete || options.duplicates.is_some();
    options.starts.is_empty() && options.columns == ColumnNames::default() && !is_moved && !is_chosen
}

/// Returns the unit that the time column of a table gives; `None` if the checker does not read the table.
#[expect(clippy::option_option, reason = "a table may have no unit")]
fn time_of_table(path: &Path) -> Option<Option<TimeUnit>> {
    let mut lines = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(File::open(path).ok()?);
    let header = lines.headers().ok()?;
    let names: Vec<&str> = header.iter().map(|name| name.trim().trim_start_matches('\u{feff}')).collect();
    let mut times = TIMES.iter().filter(|(time, _)| names.contains(time));
    let (time, unit) = times.next().filter(|_| times.next().is_none())?;
    let is_known = |name: &&str| name == time || COLUMNS.contains(name) || UNUSED.contains(name);
    let is_once = |wanted: &&str| names.iter().filter(|name| *name == wanted).count() == 1;
    let is_plain = names.iter().all(is_known) && names.iter().all(is_once) && COLUMNS.iter().all(is_once);
    // A row of units below the header has no digit in the time column.
    let place = names.iter().position(|name| name == time)?;
    let first = lines.records().next().and_then(Result::ok);
    let has_units =
        first.is_some_and(|row| row.get(place).is_some_and(|cell| !cell.bytes().any(|byte| byte.is_ascii_digit())));
    (is_plain && !has_units).then_some(*unit)
}

/// Writes the proof. Returns a note if there is no proof.
pub(super) fn write(
    file: &Path,
    request: &AuditRequest<'_>,
    recording: &str,
    (settings, own, outcome, is_decimal_tie): (&Settings, Option<&OwnRecording>, &Outcome, bool),
    clock: &Clock,
) -> Result<Option<String>, Failure> {
    let none = |why: &str| Ok(Some(format!("no proof is written: {why}")));
    if outcome.status == Status::Undecided {
        return none("the verdict is undecided");
    }
    if is_decimal_tie {
        return none("the checker computes with the written decimals, which are exactly at the limit");
    }
    let limits = match claimed_limits(settings, outcome) {
        Ok(limits) => limits,
        Err(why) => return none(&why),
    };
    let files = match files(request, settings, own) {
        Ok(files) => files,
        Err((what, _)) => return none(&format!("no proof of {what}")),
    };
    let (format, motion) = match &files {
        Files::Table(_) => ("csv", "linear"),
        Files::Run(_) => ("run", "linear"),
        Files::Curves { format, .. } => (*format, "polynomial"),
    };
    let sha256 = match &files {
        Files::Table(path) | Files::Run(path) => Hashes::Of(hash(path)?),
        Files::Curves { by_vehicle, .. } => {
            if !by_vehicle.keys().eq(outcome.vehicles.iter().collect::<BTreeSet<_>>()) {
                return none("the vehicles are not those of the names of the files");
            }
            let hashed = |(name, path): (&String, &PathBuf)| Ok((name.clone(), hash(path)?));
            Hashes::ByVehicle(by_vehicle.iter().map(hashed).collect::<Result<_, Failure>>()?)
        }
    };
    let is_sampled = motion == "linear";
    let names = outcome.vehicles.iter().map(String::as_str).filter(|_| is_sampled);
    let offsets_s = settings.vehicles.iter().filter(|(_, own)| own.offset_s != 0.0);
    let content = ProofFile {
        format: "tautline proof",
        version: VERSION,
        data: Data { format, recording, sha256 },
        claim: Claim { status: outcome.status, motion, limits },
        assumed: Assumed {
            time_unit: &clock.unit,
            max_gaps_s: names.zip(outcome.max_gaps_s.iter().copied()).collect(),
            offsets_s: offsets_s.map(|(name, own)| (name.as_str(), own.offset_s)).collect(),
        },
    };
    let text = serde_json::to_string(&content)
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write a proof: {error}")))?;
    write_atomically(file, (text + "\n").as_bytes())?;
    Ok(None)
}

fn hash(path: &Path) -> Result<String, Failure> {
    let bytes = fs::read(path).map_err(|error| {
        Failure::machine("recording/cannot-read", format!("cannot read {}: {error}", path.display()))
    })?;
    Ok(sha256_hex(&bytes))
}

/// Returns the limits of a question with their verdicts, or the reason why there is no proof.
fn claimed_limits<'a>(settings: &'a Settings, outcome: &'a Outcome) -> Result<Vec<ClaimedLimit<'a>>, String> {
    let has_gaps = !outcome.gaps.is_empty();
    let verdict = |is_violated: bool, is_undecided: bool| match (is_violated, is_undecided) {
        (true, _) => Ok(Status::Violation),
        (false, false) => Ok(Status::Clear),
        (false, true) => Err("a limit is violated, and another one is undecided".to_owned()),
    };
    let is_beyond = |of_pairs: bool| outcome.violations.iter().any(|found| found.pair.vehicles().is_some() == of_pairs);
    let is_open = |of_pairs: bool| {
        let mut undecided = outcome.undecided.iter();
        has_gaps
            || outcome.tallies.violations.is_shortened()
            || outcome.tallies.undecided.is_shortened()
            || undecided.any(|found| found.pair.vehicles().is_some() == of_pairs)
    };
    let mut limits = Vec::new();
    if let Some((kind, lengths)) = pair_lengths(settings, outcome) {
        match outcome.closest.first().and_then(|closest| Some((closest, closest.pair.vehicles()?))) {
            Some((closest, pair)) => {
                let status = verdict(is_beyond(true), is_open(true))?;
                let pair = [pair.first(), pair.second()].map(|vehicle| outcome.vehicles[vehicle].as_str());
                let (smallest, above_m) = (closest.lower_m, settings.above_m);
                limits.push(ClaimedLimit {
                    kind,
                    status,
                    content: Content::Pairs { lengths, smallest, pair, above_m },
                });
            }
            // A single vehicle has no pair.
            None if outcome.presence.iter().flatten().count() < 2 => {}
            None => return Err("no two vehicles are present at one time".to_owned()),
        }
    }
    if !settings.obstacles.is_empty() {
        let status = verdict(is_beyond(false), is_open(false))?;
        let content = outcome.obstacles.first().and_then(|closest| obstacles(settings, outcome, closest));
        limits.push(ClaimedLimit { kind: "obstacles", status, content: content.ok_or("no vehicle is present")? });
    }
    for limit in &outcome.envelope.limits {
        let is_undecided = has_gaps || limit.status == Status::Undecided;
        let status = verdict(limit.status == Status::Violation, is_undecided)?;
        limits.push(ClaimedLimit {
            kind: limit.limit.quantity.name(),
            status,
            content: vehicle(settings, outcome, limit)?,
        });
    }
    if limits.is_empty() { Err("the question has no limit".to_owned()) } else { Ok(limits) }
}

/// Returns the kind and the lengths of the limit of two vehicles, if there is one.
fn pair_lengths<'a>(settings: &Settings, outcome: &'a Outcome) -> Option<(&'static str, PairLengths<'a>)> {
    if let Some(axes) = settings.ellipsoid_m {
        let scaled = settings.delta_m.unwrap_or(TOUCHING_ELLIPSOIDS);
        return Some(("ellipsoid", PairLengths::Ellipsoid { half_axes_m: axes.into(), scaled }));
    }
    if let Some(cylinder) = settings.cylinder {
        let lengths = PairLengths::Cylinder { horizontal_m: cylinder.horizontal_m, vertical_m: cylinder.vertical_m };
        return Some(("cylinder", lengths));
    }
    let radius_m = |name: &str| settings.vehicles.get(name).and_then(|own| own.radius_m).or(settings.radius_m);
    let has_radii = outcome.vehicles.iter().any(|name| radius_m(name).is_some());
    let named = outcome.vehicles.iter().filter(|_| has_radii);
    let radii_m: BTreeMap<_, _> = named.map(|name| (name.as_str(), radius_m(name).unwrap_or(0.0))).collect();
    (settings.delta_m.is_some() || has_radii)
        .then_some(("distance", PairLengths::Distance { delta_m: settings.delta_m, radii_m }))
}

/// Returns the content of the limit of obstacles; `None` for an approach of two vehicles.
fn obstacles<'a>(settings: &'a Settings, outcome: &'a Outcome, closest: &Approach) -> Option<Content<'a>> {
    let ObjectPair::Obstacle { vehicle, obstacle } = closest.pair else { return None };
    let default_m = (0.5 * settings.delta_m.unwrap_or(0.0)).max(settings.radius_m.unwrap_or(0.0));
    let claimed = |obstacle: &'a MovingObstacle| ClaimedObstacle {
        name: &obstacle.name,
        at_m: obstacle.path[0].1.into(),
        clearance_m: obstacle.clearance_m.unwrap_or(default_m),
        shape: match obstacle.shape {
            Shape::Ball { radius_m } => ClaimedShape::Ball { radius_m },
            Shape::Box { half_m, yaw_deg } => {
                let [x, y, z]: [f64; 3] = half_m.into();
                ClaimedShape::Box { half_m: if yaw_deg.rem_euclid(180.0) == 0.0 { [x, y, z] } else { [y, x, z] } }
            }
            Shape::Capsule { from_m, to_m, radius_m } => {
                ClaimedShape::Capsule { from_m: from_m.into(), to_m: to_m.into(), radius_m }
            }
            Shape::HalfSpace { normal } => ClaimedShape::HalfSpace { normal: normal.into() },
        },
    };
    Some(Content::Obstacles {
        smallest: closest.lower_m,
        vehicle: &outcome.vehicles[vehicle],
        obstacle: &settings.obstacles[obstacle].name,
        obstacles: settings.obstacles.iter().map(claimed).collect(),
    })
}

/// Returns the content of a limit of single vehicles, or the reason why there is no proof.
fn vehicle<'a>(settings: &Settings, outcome: &'a Outcome, found: &LimitOutcome) -> Result<Content<'a>, String> {
    let (name, limit) = (found.limit.quantity.name(), found.limit.allowed);
    let extreme = found.extreme.ok_or_else(|| format!("no {name} is known"))?;
    let vehicle = outcome.vehicles[extreme.vehicle].as_str();
    let is_least = found.limit.quantity.is_least();
    let extreme = if is_least { extreme.upper } else { extreme.lower };
    if found.status == Status::Clear && if is_least { extreme < limit } else { extreme > limit } {
        return Err(format!(
            "the {name} is beyond its limit by less than the audit's tolerance; widen the limit slightly"
        ));
    }
    Ok(match settings.envelope.fence.as_ref().filter(|_| found.limit.quantity == Quantity::Fence) {
        Some(fence) => Content::Fence {
            smallest: (extreme >= 0.0).then_some(extreme),
            vehicle,
            corners_m: fence.corners_m().iter().map(|corner| [corner.x, corner.y]).collect(),
            height_m: fence.height_m(),
            margin_m: limit,
        },
        None => Content::Vehicle { limit, extreme, vehicle },
    })
}
