//! All parts of a campaign as one table and one answer.

use std::fs;

use sha2::{Digest as _, Sha256};

use super::error::CampaignError;
use super::folder::{Folder, listed};
use super::manifest::base16;
use super::part::Found;
use super::result::{Gathered, Summary};
use super::table::Table;
use tautline_report::report::{write_atomically, write_atomically_with};

/// The table's name in the folder of a campaign.
pub const RESULTS: &str = "results.parquet";
/// The answer's name in the folder of a campaign.
pub const ANSWER: &str = "campaign.json";

/// What a merge left.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// The answer.
    pub summary: Summary,
    /// SHA-256 of the table.
    pub sha256: String,
}

impl Folder {
    /// Writes `results.parquet` and `campaign.json`: the same bytes for any number of shards and threads, in whatever order and
    /// however often interrupted they were flown. Runs after which enough was known are left out, whether they were flown or not.
    ///
    /// # Errors
    /// [`CampaignError::Holes`] where shards are missing or damaged, [`CampaignError::Foreign`] where one is of another campaign,
    /// [`CampaignError::Alarm`] where one was flown twice with different results, [`CampaignError::Machine`].
    pub fn merge(&self) -> Result<Merged, CampaignError> {
        let path = self.file(RESULTS);
        let summary = write_atomically_with(&path, |file| {
            let failed =
                |error: parquet::errors::ParquetError| CampaignError::writing(&path, std::io::Error::other(error));
            let copy = file.try_clone().map_err(|error| CampaignError::writing(&path, error))?;
            let mut table = Table::create(self.campaign(), copy).map_err(failed)?;
            let mut gathered = Gathered::new(self.campaign());
            for shard in 0..self.campaign().manifest().shards {
                if gathered.is_enough() {
                    break;
                }
                let Found::Whole(rows) = self.read(shard)? else { return Err(self.holes(shard)?) };
                for row in rows {
                    if gathered.take(&row) {
                        table.add(row).map_err(failed)?;
                    }
                }
            }
            table.close().map_err(failed)?;
            Ok::<_, CampaignError>(gathered.finish(self.campaign()))
        })?;
        let answer = self.file(ANSWER);
        let json = summary.to_json().map_err(|error| CampaignError::writing(&answer, error.into()))?;
        write_atomically(&answer, json.as_bytes())?;
        let bytes = fs::read(&path).map_err(|error| CampaignError::reading(&path, error))?;
        Ok(Merged { summary, sha256: base16(&Sha256::digest(&bytes)) })
    }

    /// The answer of what was flown, without writing it.
    ///
    /// # Errors
    /// As [`Folder::merge`].
    pub fn summary(&self) -> Result<Summary, CampaignError> {
        let mut gathered = Gathered::new(self.campaign());
        for shard in 0..self.campaign().manifest().shards {
            if gathered.is_enough() {
                break;
            }
            let Found::Whole(rows) = self.read(shard)? else { return Err(self.holes(shard)?) };
            for row in &rows {
                gathered.take(row);
            }
        }
        Ok(gathered.finish(self.campaign()))
    }

    fn holes(&self, from: u64) -> Result<CampaignError, CampaignError> {
        let missing: Vec<_> = self.missing()?.into_iter().filter(|&shard| shard >= from).collect();
        let damaged = missing.iter().filter_map(|&shard| self.damaged(shard).transpose()).collect::<Result<_, _>>()?;
        Ok(CampaignError::Holes { list: listed(&missing), shards: self.campaign().manifest().shards, damaged })
    }
}
