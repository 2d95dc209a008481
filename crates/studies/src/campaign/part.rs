//! The rows of a shard as a file, whole and with a seal, and the journal of a shard that is under way.
//!
//! A part is lines of JSON: a heading, a row a line in the order of runs and laws, and a seal with the SHA-256 of all before
//! it. A part whose seal does not fit is damaged (truncated or altered), and its shard is flown again.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::error::CampaignError;
use super::manifest::{Manifest, SCHEMA_VERSION, base16};
use super::row::Row;

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
/// [`CampaignError::Machine`] in no case that is known: every row has a JSON form.
pub(super) fn encode(manifest: &Manifest, shard: u64, rows: &[Row]) -> Result<Vec<u8>, CampaignError> {
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

fn line(value: &impl Serialize) -> Result<Vec<u8>, CampaignError> {
    let written = serde_json::to_vec(value).map_err(|error| CampaignError::writing(Path::new("a row"), error.into()));
    written.map(|mut bytes| {
        bytes.push(b'\n');
        bytes
    })
}

/// Reads the part of a shard.
///
/// # Errors
/// [`CampaignError::Foreign`] for a part of another campaign, [`CampaignError::Machine`] where the file cannot be read.
pub(super) fn read(path: &Path, manifest: &Manifest, shard: u64, laws: usize) -> Result<Found, CampaignError> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Nothing),
        Err(error) => return Err(CampaignError::reading(path, error)),
    };
    decode(&bytes, manifest, shard, laws, path)
}

fn decode(bytes: &[u8], manifest: &Manifest, shard: u64, laws: usize, path: &Path) -> Result<Found, CampaignError> {
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
        return Err(CampaignError::Foreign {
            path: path.to_owned(),
            why: format!(
                "this is shard {} of {} of campaign {}, not shard {shard} of {} of campaign {}",
                heading.shard, heading.shards, heading.campaign, manifest.shards, manifest.campaign
            ),
            help: "remove it, or merge in the folder that it belongs to".to_owned(),
        });
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
    /// [`CampaignError::Machine`] where the file cannot be made.
    pub(super) fn create(path: PathBuf, manifest: &Manifest) -> Result<Self, CampaignError> {
        let file = File::create(&path).map_err(|error| CampaignError::writing(&path, error))?;
        Ok(Self { path, file, campaign: manifest.campaign.clone() })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// [`CampaignError::Machine`] where the disk is full; what was written before stays.
    pub(super) fn add(&mut self, row: &Row) -> Result<(), CampaignError> {
        let row = line(row)?;
        let written = [seal_of(&self.campaign, &row).as_bytes(), b" ", &row].concat();
        self.file.write_all(&written).map_err(|error| CampaignError::writing(&self.path, error))
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
