//! A shard: its part, which is whole and sealed, the journal of a process under way, and its flights.
//!
//! A part is lines of JSON: a heading, a row a line in the order of runs and laws, and a seal with the SHA-256 of all before
//! it. A part whose seal does not fit is damaged (truncated or altered), and its shard is flown again.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::folder::{Folder, JOURNAL, different_results};
use super::manifest::{Manifest, base16, cannot, other_campaign};
use super::row::Row;
use crate::SCHEMA_VERSION;
use crate::batch::Batch;
use tautline_report::request::Failure;

/// What became of a shard.
#[derive(Clone, Debug, PartialEq)]
pub enum Shard {
    /// It had been flown.
    Kept(Vec<Row>),
    /// It was flown.
    Flown {
        /// All of it.
        rows: Vec<Row>,
        /// How many of them now.
        flown: u64,
    },
    /// It was interrupted; what was flown of it is kept for the next time.
    Interrupted,
}

impl Folder {
    /// Flies a shard, unless it has been flown; the result is the same for any number of threads, and for any number of
    /// interruptions before.
    ///
    /// # Errors
    /// [`Failure`] if another process flew the shard with different results, a law cannot be built, or the disk is full. Finished
    /// flights are kept.
    pub fn fly(&self, shard: u64, batch: &Batch<'_>) -> Result<Shard, Failure> {
        if let Found::Whole(rows) = self.read(shard)? {
            return Ok(Shard::Kept(rows));
        }
        self.make()?;
        let began = Instant::now();
        let laws = self.campaign().laws().len();
        let places = self.campaign().manifest().range(shard).flat_map(|run| (0..laws).map(move |law| (run, law)));
        let mut rows = self.flown_before(shard)?;
        let there: BTreeSet<_> = rows.iter().map(Row::place).collect();
        let missing: Vec<_> = places.filter(|place| !there.contains(place)).collect();
        let flown = missing.len();
        let journal = Mutex::new(Journal::create(self.own(shard, JOURNAL), self.campaign().manifest())?);
        let made = batch.run(missing.len(), |number| {
            let (run, law) = missing[number];
            let row = self.campaign().row(run, law, batch)?;
            if let Some(row) = &row {
                journal.lock().unwrap_or_else(PoisonError::into_inner).add(row)?;
            }
            Ok::<_, Failure>(row)
        })?;
        let Some(made) = made.into_iter().collect::<Option<Vec<_>>>() else { return Ok(Shard::Interrupted) };
        rows.extend(made);
        rows.sort_by_key(Row::place);
        self.publish(shard, &rows)?;
        self.sweep(shard)?;
        let (seconds, threads) = (began.elapsed().as_secs_f64(), batch.threads());
        let times = format!("{{\"wall_s\": {seconds:.3}, \"threads\": {threads}, \"flights\": {flown}}}\n");
        tautline_report::report::write_atomically(&self.times(shard), times.as_bytes())?;
        Ok(Shard::Flown { rows, flown: flown as u64 })
    }

    /// Rows that processes left which were killed, each once.
    fn flown_before(&self, shard: u64) -> Result<Vec<Row>, Failure> {
        let (range, laws) = (self.campaign().manifest().range(shard), self.campaign().laws().len());
        let manifest = self.campaign().manifest();
        let mut rows: BTreeMap<(u64, usize), (Row, PathBuf)> = BTreeMap::new();
        for path in self.left(shard, JOURNAL)? {
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

    /// Puts a part in its place, whole, unless there is one: then both must say the same.
    fn publish(&self, shard: u64, rows: &[Row]) -> Result<(), Failure> {
        let bytes = encode(self.campaign().manifest(), shard, rows)?;
        let (path, own) = (self.part(shard), self.own(shard, "partial"));
        let failed = |error| cannot("write", &own)(error);
        let written = File::create(&own).and_then(|mut file| file.write_all(&bytes).and_then(|()| file.sync_all()));
        if let Err(error) = written {
            let _ = fs::remove_file(&own);
            return Err(failed(error));
        }
        if matches!(self.read(shard), Ok(Found::Damaged(_))) {
            return fs::rename(&own, &path).map_err(failed);
        }
        // A link is made by one process alone; where a file system has none, the last one wins.
        match fs::hard_link(&own, &path) {
            Ok(()) => fs::remove_file(&own).map_err(failed),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => self.settle(shard, &own, &bytes),
            Err(_) => fs::rename(&own, &path).map_err(failed),
        }
    }

    /// Another process was faster: the same bytes are one part, others are an alarm.
    fn settle(&self, shard: u64, own: &Path, bytes: &[u8]) -> Result<(), Failure> {
        let kept = self.part(shard);
        let there = fs::read(&kept).map_err(cannot("read", &kept))?;
        if there == bytes {
            return fs::remove_file(own).map_err(cannot("write", own));
        }
        let other = self.differs(shard);
        fs::rename(own, &other).map_err(cannot("write", &other))?;
        Err(different_results(shard, &kept, &other))
    }

    /// Removes what is left of a shard that is whole.
    fn sweep(&self, shard: u64) -> Result<(), Failure> {
        for path in self.left(shard, JOURNAL)? {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(cannot("write", &path)(error));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// First line of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Heading {
    schema_version: u32,
    campaign: String,
    shard: u64,
    shards: u64,
}

/// Last line of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Seal {
    rows: usize,
    sha256: String,
}

/// What a file is found to be.
#[derive(Clone, Debug, PartialEq)]
pub enum Found {
    /// There is none.
    Nothing,
    /// Truncated or altered, and to be flown again: what shows it.
    Damaged(&'static str),
    /// All rows of the shard.
    Whole(Vec<Row>),
}

/// The part of a shard as bytes.
///
/// # Errors
/// None in practice: every row has a JSON form.
pub(super) fn encode(manifest: &Manifest, shard: u64, rows: &[Row]) -> Result<Vec<u8>, Failure> {
    let heading =
        Heading { schema_version: SCHEMA_VERSION, campaign: manifest.campaign.clone(), shard, shards: manifest.shards };
    let mut bytes = line(&heading)?;
    for row in rows {
        bytes.extend(line(row)?);
    }
    let seal = Seal { rows: rows.len(), sha256: base16(&Sha256::digest(&bytes)) };
    bytes.extend(line(&seal)?);
    Ok(bytes)
}

fn line(value: &impl Serialize) -> Result<Vec<u8>, Failure> {
    let written = serde_json::to_vec(value).map_err(|error| cannot("write", Path::new("a row"))(error.into()));
    written.map(|mut bytes| {
        bytes.push(b'\n');
        bytes
    })
}

/// Reads the part of a shard.
///
/// # Errors
/// [`Failure`] for a part of another campaign, and for a file that cannot be read.
pub(super) fn read(path: &Path, manifest: &Manifest, shard: u64, laws: usize) -> Result<Found, Failure> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Nothing),
        Err(error) => return Err(cannot("read", path)(error)),
    };
    decode(&bytes, manifest, shard, laws, path)
}

fn decode(bytes: &[u8], manifest: &Manifest, shard: u64, laws: usize, path: &Path) -> Result<Found, Failure> {
    const TRUNCATED: &str = "it is truncated: the SHA-256 of its rows is missing";
    const ALTERED: &str = "it was altered: its rows do not have the SHA-256 at its end";
    let Some(body) = bytes.strip_suffix(b"\n") else { return Ok(Found::Damaged(TRUNCATED)) };
    let Some(end) = body.iter().rposition(|&byte| byte == b'\n') else { return Ok(Found::Damaged(TRUNCATED)) };
    let (sealed, seal) = (&bytes[..=end], &body[end + 1..]);
    let Ok(seal) = serde_json::from_slice::<Seal>(seal) else { return Ok(Found::Damaged(TRUNCATED)) };
    if seal.sha256 != base16(&Sha256::digest(sealed)) {
        return Ok(Found::Damaged(ALTERED));
    }
    let mut lines = sealed.split_inclusive(|&byte| byte == b'\n');
    let Some(heading) = lines.next().and_then(|line| serde_json::from_slice::<Heading>(line).ok()) else {
        return Ok(Found::Damaged(ALTERED));
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
    Ok(if is_whole { Found::Whole(rows) } else { Found::Damaged(ALTERED) })
}

/// Rows as they are flown, of one process: what it flew before it was killed is not flown again.
///
/// A line is a hash over the campaign and the row, and the row: one of another campaign, torn or changed, is no row.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    file: File,
    campaign: String,
}

impl Journal {
    /// Begins a journal.
    ///
    /// # Errors
    /// [`Failure`] if the file cannot be made.
    pub(super) fn create(path: PathBuf, manifest: &Manifest) -> Result<Self, Failure> {
        let file = File::create(&path).map_err(cannot("write", &path))?;
        Ok(Self { path, file, campaign: manifest.campaign.clone() })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// [`Failure`] if the disk is full. Earlier rows stay.
    pub(super) fn add(&mut self, row: &Row) -> Result<(), Failure> {
        let row = line(row)?;
        let written = [seal_of(&self.campaign, &row).as_bytes(), b" ", &row].concat();
        self.file.write_all(&written).map_err(cannot("write", &self.path))
    }

    /// Rows of a campaign in a journal that was left behind.
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

/// Hash over a campaign and the line of a row.
fn seal_of(campaign: &str, row: &[u8]) -> String {
    base16(&Sha256::new().chain_update(campaign).chain_update(row).finalize())
}
