//! `tautline audit --proof`: a verdict that `check_proof.py` confirms without this program.
//!
//! The file holds the verdict and the facts that the table does not contain. The checker derives everything else.

use std::collections::BTreeMap;
use std::fs;
use std::fs::File;
use std::path::Path;

use serde::Serialize;

use super::super::Failure;
use super::AuditRequest;
use crate::report::recorded::Clock;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, Outcome, Settings};
use tautline_core::files::write_atomically;
use tautline_core::option::{
    ABOVE, CYLINDER, DELTA, ELLIPSOID, FENCE, FROM, IDS, LIMIT, MAX_GAP, OFFSET, PROOF, RADIUS, UNTIL, WELL_CLEAR,
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
const VERSION: u32 = 2;

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
    format: &'static str,
    recording: &'a str,
    sha256: String,
}

/// The verdict, which the checker computes and compares.
#[derive(Serialize)]
struct Claim<'a> {
    status: Status,
    motion: &'static str,
    limit: Limit,
    /// Largest double that is at most the smallest separation \[m\].
    separation_m: f64,
    /// Names of the two vehicles with the smallest separation.
    pair: [&'a str; 2],
}

/// Limit of the separation.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
enum Limit {
    /// Smallest allowed distance of two vehicles \[m\].
    Distance { distance_m: f64 },
}

/// Facts that the table does not contain.
#[derive(Serialize)]
struct Assumed<'a> {
    time_unit: &'a str,
    /// Largest gap that is joined, by vehicle \[s\]; null if every gap is joined.
    max_gaps_s: BTreeMap<&'a str, f64>,
    /// Shifts of clocks, by vehicle \[s\].
    offsets_s: BTreeMap<&'a str, f64>,
}

/// Rejects requests without a proof, before the work begins.
pub(super) fn check(request: &AuditRequest<'_>, settings: &Settings) -> Result<(), Failure> {
    if request.proof.is_none() {
        return Ok(());
    }
    let no_proof = |what: &str, remedy: &str| {
        Err(Failure::input("audit/no-proof", format!("{PROOF}: no proof of {what}"), remedy))
    };
    let is_other = [
        (settings.delta_m.is_none(), format!("a limit that is not {DELTA}")),
        (
            settings.motion.is_some_and(|motion| motion != Interpolation::Linear),
            "a motion that is not linear".to_owned(),
        ),
        (
            settings.radius_m.is_some() || settings.vehicles.values().any(|vehicle| vehicle.radius_m.is_some()),
            RADIUS.to_string(),
        ),
        (settings.ellipsoid_m.is_some(), ELLIPSOID.to_string()),
        (settings.cylinder.is_some(), CYLINDER.to_string()),
        (settings.well_clear.is_some(), WELL_CLEAR.to_string()),
        (!settings.obstacles.is_empty(), "obstacles".to_owned()),
        (!settings.envelope.is_empty(), format!("{LIMIT} and {FENCE}")),
        (settings.above_m.is_some(), ABOVE.to_string()),
        (settings.from_s.is_some() || settings.until_s.is_some(), format!("a part of a recording ({FROM}, {UNTIL})")),
        (settings.only.is_some(), format!("some of the vehicles ({IDS})")),
    ];
    if let Some((_, what)) = is_other.iter().find(|(is_asked, _)| *is_asked) {
        return no_proof(what, &format!("ask for {DELTA} alone, with {OFFSET} and {MAX_GAP} as needed"));
    }
    let Some((path, options)) = request.subject.only_file() else {
        return no_proof("a recording that is not one file", EXPORT);
    };
    let Some(time) = time_of_table(path).filter(|_| is_read_plainly(options)) else {
        let what = "a file that is not a table with the columns t_s (t, time, time_s), id, x, y and z in metres, and \
                    at most those of an export besides";
        return no_proof(what, EXPORT);
    };
    let contradicts = |unit: TimeUnit| options.time_unit.is_some_and(|given| given != unit);
    if time.is_some_and(contradicts) {
        return no_proof("times in another unit than the name of their column", "rename the column to t");
    }
    Ok(())
}

/// Returns whether a file is read unchanged, in metres.
fn is_read_plainly(options: &ReadOptions) -> bool {
    let is_moved = options.scale.is_some() || options.axes.is_some() || options.times_per_second.is_some();
    let is_chosen = options.sort || options.one_vehicle || options.skip_incomplete || options.duplicates.is_some();
    options.columns == ColumnNames::default() && !is_moved && !is_chosen
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
    path: &Path,
    recording: &str,
    (settings, outcome, is_decimal_tie): (&Settings, &Outcome, bool),
    clock: &Clock,
) -> Result<Option<String>, Failure> {
    let none = |why: &str| Ok(Some(format!("no proof is written: {why}")));
    if outcome.status == Status::Undecided {
        return none("the verdict is undecided");
    }
    if is_decimal_tie {
        return none("the checker computes with the written decimals, which are exactly at the limit");
    }
    let closest = outcome.closest.first().and_then(|closest| Some((closest, closest.pair.vehicles()?)));
    let (Some((closest, pair)), Some(distance_m)) = (closest, settings.delta_m) else {
        return none("no two vehicles are present at one time");
    };
    let bytes = fs::read(path).map_err(|error| {
        Failure::machine("recording/cannot-read", format!("cannot read {}: {error}", path.display()))
    })?;
    let sha256 = sha256_hex(&bytes);
    let names = outcome.vehicles.iter().map(String::as_str);
    let offsets_s = settings.vehicles.iter().filter(|(_, own)| own.offset_s != 0.0);
    let content = ProofFile {
        format: "tautline proof",
        version: VERSION,
        data: Data { format: "csv", recording, sha256 },
        claim: Claim {
            status: outcome.status,
            motion: "linear",
            limit: Limit::Distance { distance_m },
            separation_m: closest.lower_m,
            pair: [pair.first(), pair.second()].map(|vehicle| outcome.vehicles[vehicle].as_str()),
        },
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
