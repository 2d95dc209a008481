//! Shards of a campaign: rows of flights, parts of finished shards, and journals of running processes.
//!
//! A part has lines of JSON: a heading, a row for each flight in the order of runs and laws, and a seal with the
//! SHA-256 of the preceding lines. A part with a wrong seal is damaged (truncated or altered), and its shard is flown
//! again.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::flights::Campaign;
use super::folder::{Folder, JOURNAL, Manifest, different_results, file_failure, other_campaign, remove_if_present};
use crate::SCHEMA_VERSION;
use crate::batch::Batch;
use crate::flight::FlightSummary;
use crate::splitting::Splitting;
use crate::table::{Cell, Column, Kind};
use tautline_core::failure::Failure;
use tautline_core::files::write_beside;
use tautline_core::record::{hex, sha256_hex};

/// Flights of a finished shard.
#[derive(Clone, Debug, PartialEq)]
pub struct Shard {
    /// The flights, in the order of runs and laws.
    pub rows: Vec<Row>,
    /// Number of flights of this call; 0 if the shard was finished before.
    pub flown: u64,
}

impl Folder {
    /// Flies a shard that is not finished. Returns `None` after an interruption; finished flights are kept. The rows
    /// are the same for any number of threads and interruptions.
    ///
    /// # Errors
    /// [`Failure`] if another process flew the shard with different results, a law cannot be built, or the disk is
    /// full. Finished flights are kept.
    pub fn fly(&self, shard: u64, batch: &Batch<'_>) -> Result<Option<Shard>, Failure> {
        if let PartState::Whole(rows) = self.read(shard)? {
            return Ok(Some(Shard { rows, flown: 0 }));
        }
        self.create_parts()?;
        let began = Instant::now();
        let laws = self.campaign().laws().len();
        let places = self.campaign().manifest().range(shard).flat_map(|run| (0..laws).map(move |law| (run, law)));
        let mut rows = self.flown_before(shard)?;
        let there: BTreeSet<_> = rows.iter().map(Row::place).collect();
        let missing: Vec<_> = places.filter(|place| !there.contains(place)).collect();
        let flown = missing.len();
        let journal = Mutex::new(Journal::create(self.unique_path(shard, JOURNAL), self.campaign().manifest())?);
        let made = batch.run(missing.len(), |number| {
            let (run, law) = missing[number];
            let row = self.campaign().row(run, law, batch)?;
            if let Some(row) = &row {
                journal.lock().unwrap_or_else(PoisonError::into_inner).add(row)?;
            }
            Ok::<_, Failure>(row)
        })?;
        let Some(made) = made.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
        rows.extend(made);
        rows.sort_by_key(Row::place);
        self.publish(shard, &rows)?;
        self.remove_journals(shard)?;
        let (seconds, threads) = (began.elapsed().as_secs_f64(), batch.threads());
        let times = format!("{{\"wall_s\": {seconds:.3}, \"threads\": {threads}, \"flights\": {flown}}}\n");
        tautline_core::files::write_atomically(&self.times_path(shard), times.as_bytes())?;
        Ok(Some(Shard { rows, flown: flown as u64 }))
    }

    /// Returns the rows in journals of killed processes, without repetition.
    pub(super) fn flown_before(&self, shard: u64) -> Result<Vec<Row>, Failure> {
        let (range, laws) = (self.campaign().manifest().range(shard), self.campaign().laws().len());
        let manifest = self.campaign().manifest();
        let mut rows: BTreeMap<(u64, usize), (Row, PathBuf)> = BTreeMap::new();
        for path in self.leftovers(shard, JOURNAL)? {
            for row in Journal::rows(&path, manifest) {
                if !range.contains(&row.run) || row.law >= laws {
                    continue;
                }
                match rows.entry(row.place()) {
                    Entry::Vacant(place) => drop(place.insert((row, path.clone()))),
                    Entry::Occupied(there) if there.get().0 == row => {}
                    Entry::Occupied(there) => {
                        return Err(different_results(shard, &there.get().1, &path));
                    }
                }
            }
        }
        Ok(rows.into_values().map(|(row, _)| row).collect())
    }

    /// Publishes a complete part in one step. If another process has published the part, both must be equal.
    fn publish(&self, shard: u64, rows: &[Row]) -> Result<(), Failure> {
        let bytes = encode(self.campaign().manifest(), shard, rows)?;
        let path = self.part_path(shard);
        let failed = |error| file_failure("write", &path)(error);
        let (own, ()) = write_beside(&path, |file| file.write_all(&bytes).map_err(failed))?;
        if matches!(self.read(shard), Ok(PartState::Damaged(_))) {
            return fs::rename(&own, &path).map_err(failed);
        }
        // Only one process can create the link. On a file system without links the last rename wins.
        match fs::hard_link(&own, &path) {
            Ok(()) => fs::remove_file(&own).map_err(failed),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                self.compare_with_published(shard, &own, &bytes)
            }
            Err(_) => fs::rename(&own, &path).map_err(failed),
        }
    }

    /// Compares this process's part with the published one: equal bytes are dropped, different bytes are a failure.
    fn compare_with_published(&self, shard: u64, own: &Path, bytes: &[u8]) -> Result<(), Failure> {
        let kept = self.part_path(shard);
        let there = fs::read(&kept).map_err(file_failure("read", &kept))?;
        if there == bytes {
            return fs::remove_file(own).map_err(file_failure("write", own));
        }
        let other = self.conflict_path(shard);
        fs::rename(own, &other).map_err(file_failure("write", &other))?;
        Err(different_results(shard, &kept, &other))
    }

    /// Removes the journals of a finished shard.
    fn remove_journals(&self, shard: u64) -> Result<(), Failure> {
        for path in self.leftovers(shard, JOURNAL)? {
            remove_if_present(&path)?;
        }
        Ok(())
    }
}

/// First line of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartHeader {
    schema_version: u32,
    campaign: String,
    shard: u64,
    shards: u64,
}

/// Last line of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartTrailer {
    rows: usize,
    sha256: String,
}

/// State of the part of a shard.
#[derive(Clone, Debug, PartialEq)]
pub enum PartState {
    /// No file.
    Missing,
    /// Truncated or altered, with the reason; to be flown again.
    Damaged(&'static str),
    /// All rows of the shard.
    Whole(Vec<Row>),
}

/// Returns the part of a shard as bytes.
///
/// # Errors
/// None in practice: every row has a JSON form.
pub(super) fn encode(manifest: &Manifest, shard: u64, rows: &[Row]) -> Result<Vec<u8>, Failure> {
    let heading = PartHeader {
        schema_version: SCHEMA_VERSION,
        campaign: manifest.campaign.clone(),
        shard,
        shards: manifest.shards,
    };
    let mut bytes = line(&heading)?;
    for row in rows {
        bytes.extend(line(row)?);
    }
    let seal = PartTrailer { rows: rows.len(), sha256: sha256_hex(&bytes) };
    bytes.extend(line(&seal)?);
    Ok(bytes)
}

fn line(value: &impl Serialize) -> Result<Vec<u8>, Failure> {
    let written = serde_json::to_vec(value).map_err(|error| file_failure("write", Path::new("a row"))(error.into()));
    written.map(|mut bytes| {
        bytes.push(b'\n');
        bytes
    })
}

/// Reads the part of a shard.
///
/// # Errors
/// [`Failure`] for a part of another campaign, and for a file that cannot be read.
pub(super) fn read(path: &Path, manifest: &Manifest, shard: u64, laws: usize) -> Result<PartState, Failure> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(PartState::Missing),
        Err(error) => return Err(file_failure("read", path)(error)),
    };
    decode(&bytes, manifest, shard, laws, path)
}

fn decode(bytes: &[u8], manifest: &Manifest, shard: u64, laws: usize, path: &Path) -> Result<PartState, Failure> {
    const TRUNCATED: &str = "it is truncated: the SHA-256 of its rows is missing";
    const ALTERED: &str = "it was altered: its rows do not have the SHA-256 at its end";
    let Some(body) = bytes.strip_suffix(b"\n") else { return Ok(PartState::Damaged(TRUNCATED)) };
    let Some(end) = body.iter().rposition(|&byte| byte == b'\n') else { return Ok(PartState::Damaged(TRUNCATED)) };
    let (sealed, seal) = (&bytes[..=end], &body[end + 1..]);
    let Ok(seal) = serde_json::from_slice::<PartTrailer>(seal) else { return Ok(PartState::Damaged(TRUNCATED)) };
    if seal.sha256 != sha256_hex(sealed) {
        return Ok(PartState::Damaged(ALTERED));
    }
    let mut lines = sealed.split_inclusive(|&byte| byte == b'\n');
    let Some(heading) = lines.next().and_then(|line| serde_json::from_slice::<PartHeader>(line).ok()) else {
        return Ok(PartState::Damaged(ALTERED));
    };
    let is_ours = heading.campaign == manifest.campaign && heading.shards == manifest.shards && heading.shard == shard;
    if !is_ours {
        let problem = format!(
            "shard {} of {} of campaign {}, not shard {shard} of {} of campaign {}",
            heading.shard, heading.shards, heading.campaign, manifest.shards, manifest.campaign
        );
        return Err(other_campaign(path, problem, "remove the file, or move it to the folder of its campaign"));
    }
    let rows: Vec<Row> = lines.map_while(|line| serde_json::from_slice(line).ok()).collect();
    let places = manifest.range(shard).flat_map(|run| (0..laws).map(move |law| (run, law)));
    let is_whole = seal.rows == rows.len() && rows.iter().map(Row::place).eq(places);
    Ok(if is_whole { PartState::Whole(rows) } else { PartState::Damaged(ALTERED) })
}

/// Journal of a process: its finished rows, so that a killed process loses no finished flight.
///
/// A line is a row with a hash over campaign and row. Lines of other campaigns, and torn or altered lines, are ignored.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    file: File,
    campaign: String,
}

impl Journal {
    /// Creates a journal.
    ///
    /// # Errors
    /// [`Failure`] if the file cannot be created.
    pub(super) fn create(path: PathBuf, manifest: &Manifest) -> Result<Self, Failure> {
        let file = File::create(&path).map_err(file_failure("write", &path))?;
        Ok(Self { path, file, campaign: manifest.campaign.clone() })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// [`Failure`] if the disk is full. Earlier rows stay.
    pub(super) fn add(&mut self, row: &Row) -> Result<(), Failure> {
        let row = line(row)?;
        let written = [seal_of(&self.campaign, &row).as_bytes(), b" ", &row].concat();
        self.file.write_all(&written).map_err(file_failure("write", &self.path))
    }

    /// Waits until the disk holds all rows.
    ///
    /// # Errors
    /// [`Failure`] if the file cannot be written.
    pub(super) fn sync(self) -> Result<(), Failure> {
        self.file.sync_all().map_err(file_failure("write", &self.path))
    }

    /// Returns the rows of a campaign in a journal.
    #[must_use]
    pub(super) fn rows(path: &Path, manifest: &Manifest) -> Vec<Row> {
        let bytes = fs::read(path).unwrap_or_default();
        let row = |written: &[u8]| {
            let space = written.iter().position(|&byte| byte == b' ')?;
            let (seal, row) = (&written[..space], &written[space + 1..]);
            let is_ours = seal == seal_of(&manifest.campaign, row).as_bytes();
            if is_ours { serde_json::from_slice(row).ok() } else { None }
        };
        bytes.split_inclusive(|&byte| byte == b'\n').filter_map(row).collect()
    }
}

/// Returns the hash over a campaign and the line of a row.
fn seal_of(campaign: &str, row: &[u8]) -> String {
    hex(&Sha256::new().chain_update(campaign).chain_update(row).finalize())
}

/// Result of a run under a law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Number of the run, from 0.
    pub run: u64,
    /// Index of the law in the campaign, from 0.
    pub law: usize,
    /// Drawn values, in the order of the keys.
    pub drawn: Vec<Value>,
    /// Reason why the drawn values cannot be flown, such as a start of two vehicles within delta.
    pub not_flown: Option<String>,
    /// Summary of the flight.
    pub flight: Option<FlightSummary>,
    /// Estimate, if runs are estimates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splitting: Option<Splitting>,
}

impl Row {
    /// Returns the smallest separation less delta \[m\].
    #[must_use]
    pub fn clearance_m(&self) -> Option<f64> {
        self.flight.as_ref()?.clearance_m()
    }

    /// Returns the position in the order of all rows: run and law.
    #[must_use]
    pub fn place(&self) -> (u64, usize) {
        (self.run, self.law)
    }
}

/// Column of `results.parquet`, with its cell of each row.
pub(super) type Field<'a> = (Column, Box<dyn Fn(&Row) -> Cell + 'a>);

fn field<'a, C: Into<Cell>>(name: &str, kind: Kind, cell: impl Fn(&Row) -> C + 'a) -> Field<'a> {
    (Column::new(name, "", kind), Box::new(move |row| cell(row).into()))
}

/// Returns a column of flights, which is empty for a row without a flight.
fn of_flight<'a, C: Into<Cell>>(name: &str, kind: Kind, cell: impl Fn(&FlightSummary) -> C + 'a) -> Field<'a> {
    field(name, kind, move |row| row.flight.as_ref().map(&cell))
}

/// Returns a column of estimates.
fn of_estimate<'a, C: Into<Cell>>(name: &str, kind: Kind, cell: impl Fn(&Splitting) -> C + 'a) -> Field<'a> {
    field(name, kind, move |row| row.splitting.as_ref().map(&cell))
}

/// Returns the column of a varied key: numbers if all its values are numbers, else texts.
fn drawn<'a>(place: usize, key: &str, samples: &[toml::Value]) -> Field<'a> {
    // The fixed columns have no dots in their names.
    let name = if key.contains('.') { key.to_owned() } else { format!("vary.{key}") };
    let drawn_value = move |row: &Row| row.drawn.get(place).cloned();
    if samples.iter().all(toml::Value::is_integer) {
        field(&name, Kind::Integer, move |row| drawn_value(row).and_then(|value| value.as_i64()))
    } else if samples.iter().all(|value| value.is_float() || value.is_integer()) {
        field(&name, Kind::Exact, move |row| drawn_value(row).and_then(|value| value.as_f64()))
    } else {
        let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        field(&name, Kind::Text, move |row| drawn_value(row).map(text))
    }
}

/// Returns the columns of `results.parquet`.
pub(super) fn fields(campaign: &Campaign) -> Vec<Field<'_>> {
    let law = |row: &Row| campaign.laws().get(row.law).map(|law| law.name.clone());
    let mut fields = vec![field("run", Kind::Count, |row| row.run), field("law", Kind::Text, law)];
    let keys = campaign.variations().iter().enumerate();
    fields.extend(keys.map(|(place, (key, variation))| drawn(place, key, &variation.samples())));
    let not_flown = field("not_flown_because", Kind::Text, |row| row.not_flown.clone());
    if campaign.splitting().is_some() {
        fields.extend([
            of_estimate("probability", Kind::Exact, |estimate| estimate.probability),
            of_estimate("iterations", Kind::Count, |estimate| estimate.iterations),
            of_estimate("extinct", Kind::Flag, |estimate| estimate.extinct),
            of_estimate("steps", Kind::Count, |estimate| estimate.steps),
            not_flown,
        ]);
        return fields;
    }
    let outcome = |row: &Row| row.flight.as_ref().map_or("not_flown", |flight| flight.outcome.name());
    let refused = |flight: &FlightSummary| Some(flight.refused.join(" ")).filter(|codes| !codes.is_empty());
    fields.extend([
        field("outcome", Kind::Text, outcome),
        of_flight("pass", Kind::Flag, |flight| flight.pass),
        of_flight("refused", Kind::Text, refused),
        of_flight("ended_early", Kind::Text, |flight| flight.ended_early.clone()),
        not_flown,
        of_flight("delta_m", Kind::Exact, |flight| flight.delta_m),
        of_flight("min_m", Kind::Exact, |flight| flight.min_m),
        of_flight("min_at_s", Kind::Exact, |flight| flight.min_at_s),
        of_flight("min_vehicle_a", Kind::Integer, |flight| flight.min_pair.map(|pair| pair[0])),
        of_flight("min_vehicle_b", Kind::Integer, |flight| flight.min_pair.map(|pair| pair[1])),
        of_flight("certified_m", Kind::Exact, |flight| flight.certified_m),
        of_flight("breaks_certificate", Kind::Flag, |flight| flight.breaks_certificate),
        of_flight("reached", Kind::Flag, |flight| flight.reached),
        of_flight("reached_at_s", Kind::Exact, |flight| flight.reached_at_s),
        of_flight("peak_control_m_s2", Kind::Exact, |flight| flight.peak_control_m_s2),
        of_flight("total_control_m_s", Kind::Exact, |flight| flight.total_control_m_s),
        of_flight("path_length_m", Kind::Exact, |flight| flight.path_length_m),
        of_flight("energy_max_over_initial", Kind::Exact, |flight| flight.energy_max_over_initial),
        of_flight("steps", Kind::Count, |flight| flight.steps),
        of_flight("refined_steps", Kind::Count, |flight| flight.refined_steps),
        of_flight("overlong_steps", Kind::Count, |flight| flight.overlong_steps),
        of_flight("scenario_sha256", Kind::Text, |flight| flight.scenario_sha256.clone()),
        of_flight("state_hash", Kind::Text, |flight| flight.state_hash.clone()),
    ]);
    fields
}
