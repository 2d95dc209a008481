//! `tautline audit --proof`: a verdict that `check_proof.py` confirms without this program.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::fs::File;
use std::path::Path;

use serde::Serialize;
use sha2::{Digest as _, Sha256};

use super::super::Failure;
use super::{AuditRequest, Open};
use crate::report::recorded::Clock;
use crate::report::write_atomically;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, Outcome, Proof, ProofBuilder, ProofWindow, Settings};
use tautline_recordings::read;
use tautline_recordings::read::{ColumnNames, ReadOptions};

/// Names of the time column that the checker accepts.
const TIMES: [&str; 4] = ["t_s", "t", "time", "time_s"];
/// Names of the other columns that it reads.
const COLUMNS: [&str; 4] = ["id", "x", "y", "z"];
/// Names of columns that straight motion between samples does not need.
const VELOCITIES: [&str; 3] = ["vx", "vy", "vz"];

/// Content of the file.
#[derive(Serialize)]
struct ProofFile<'a> {
    format: &'static str,
    version: u32,
    data: Data<'a>,
    claim: Claim<'a>,
    windows: &'a [ProofWindow],
}

/// The recording of the claim.
#[derive(Serialize)]
struct Data<'a> {
    recording: &'a str,
    sha256: String,
}

/// The claim.
#[derive(Serialize)]
struct Claim<'a> {
    status: Status,
    motion: &'static str,
    limit_m: f64,
    #[serde(flatten)]
    proof: &'a Proof,
    vehicles: &'a [String],
    /// Largest gap that is joined \[s\]; null if every gap is joined.
    max_gaps_s: &'a [f64],
    offsets_s: BTreeMap<&'a str, f64>,
    clock: &'a Clock,
}

/// Rejects requests without a proof, before the work begins.
pub(super) fn check(request: &AuditRequest<'_>, settings: &Settings) -> Result<(), Failure> {
    if request.proof.is_none() {
        return Ok(());
    }
    let no_proof = |what: &str, remedy: &str| {
        Err(Failure::input("audit/no-proof", format!("--proof: no proof of {what}"), remedy))
    };
    let is_other = [
        (settings.delta_m.is_none(), "a limit that is not --delta"),
        (settings.motion.is_some_and(|motion| motion != Interpolation::Linear), "a motion that is not linear"),
        (settings.radius_m.is_some() || settings.vehicles.values().any(|of| of.radius_m.is_some()), "--radius"),
        (settings.ellipsoid_m.is_some(), "--ellipsoid"),
        (settings.cylinder.is_some(), "--cylinder"),
        (settings.well_clear.is_some(), "--well-clear"),
        (!settings.obstacles.is_empty(), "obstacles"),
        (!settings.envelope.is_empty(), "--limit and --fence"),
        (settings.above_m.is_some(), "--above"),
        (settings.from_s.is_some() || settings.to_s.is_some(), "a part of a recording (--from, --to)"),
        (settings.only.is_some(), "some of the vehicles (--ids)"),
    ];
    if let Some((_, what)) = is_other.iter().find(|(is_asked, _)| *is_asked) {
        return no_proof(what, "ask for --delta alone, with --offset and --max-gap as needed");
    }
    let is_plain =
        request.subject.only_file().is_some_and(|(path, options)| is_table(path) && is_read_plainly(options));
    if !is_plain {
        let called = request.subject.name();
        let help = "write it as a table with `tautline export RECORDING -o FILE.csv`, and audit that";
        return no_proof(
            &format!("{called}: it is not one CSV file with the columns t_s, id, x, y and z in metres"),
            help,
        );
    }
    Ok(())
}

/// Returns whether a file is read unchanged, in metres.
fn is_read_plainly(options: &ReadOptions) -> bool {
    let is_moved = options.scale.is_some() || options.axes.is_some() || options.times_per_second.is_some();
    let is_chosen = options.sort || options.one_vehicle || options.skip_incomplete || options.duplicates.is_some();
    options.columns == ColumnNames::default() && !is_moved && !is_chosen
}

/// Returns whether the file is a table that the checker reads.
fn is_table(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let mut lines = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(file);
    let Ok(header) = lines.headers() else { return false };
    let names: Vec<&str> = header.iter().map(|name| name.trim().trim_start_matches('\u{feff}')).collect();
    let count = |wanted: &[&str]| names.iter().filter(|name| wanted.contains(name)).count();
    let is_known = |name: &str| TIMES.contains(&name) || COLUMNS.contains(&name) || VELOCITIES.contains(&name);
    let are_others_unread = names.iter().all(|name| is_known(name) || !read::is_read(name));
    let is_plain = count(&TIMES) == 1 && COLUMNS.iter().all(|column| count(&[column]) == 1) && are_others_unread;
    // A row of units below the header has no digit in the time column.
    let time = names.iter().position(|name| TIMES.contains(name));
    let first = lines.records().next().and_then(Result::ok);
    let has_units = time
        .zip(first)
        .is_some_and(|(time, row)| row.get(time).is_some_and(|cell| !cell.bytes().any(|byte| byte.is_ascii_digit())));
    is_plain && !has_units
}

/// Reads the recording again and writes the proof. Returns a note if there is no proof.
pub(super) fn write(
    file: &Path,
    path: &Path,
    recording: &str,
    (settings, outcome): (&Settings, &Outcome),
    clock: &Clock,
    open: &Open<'_>,
) -> Result<Option<String>, Failure> {
    let none = |why: &str| Ok(Some(format!("no proof is written: {why}")));
    if outcome.status == Status::Undecided {
        return none("the verdict is undecided");
    }
    let mut builder = ProofBuilder::new(settings, outcome);
    let mut tracks = open()?;
    let (mut items, mut more) = (Vec::new(), true);
    while more {
        items.clear();
        more = tracks.read(&mut items)?;
        builder.push(&items)?;
    }
    let Some(proof) = builder.finish(outcome) else {
        return none("the recording gives radii, or it does not hold samples");
    };
    let bytes = fs::read(path).map_err(|error| {
        Failure::machine("recording/cannot-read", format!("cannot read {}: {error}", path.display()))
    })?;
    let sha256 = Sha256::digest(&bytes).iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    });
    let offsets_s = settings.vehicles.iter().map(|(name, of)| (name.as_str(), of.offset_s)).collect();
    let content = ProofFile {
        format: "tautline proof",
        version: 1,
        data: Data { recording, sha256 },
        claim: Claim {
            status: outcome.status,
            motion: "linear",
            limit_m: settings.delta_m.unwrap_or(f64::NAN),
            proof: &proof,
            vehicles: &outcome.vehicles,
            max_gaps_s: &outcome.max_gaps_s,
            offsets_s,
            clock,
        },
        windows: &proof.windows,
    };
    let text = serde_json::to_string(&content)
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write a proof: {error}")))?;
    write_atomically(file, (text + "\n").as_bytes())?;
    Ok(None)
}
