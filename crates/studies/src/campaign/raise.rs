//! More runs of a campaign in the same folder. Flights that were flown are kept.

use std::path::Path;

use super::flights::Campaign;
use super::folder::{Folder, JOURNAL, Manifest, other_campaign, remove_if_present};
use super::shard::{Journal, PartState};
use super::spec::Spec;
use tautline_core::failure::Failure;

impl Manifest {
    /// Returns whether this is the campaign `there` with another number of runs.
    pub(super) fn differs_in_runs_alone(&self, there: &Self) -> Result<bool, Failure> {
        let identity = |manifest: &Self| {
            let mut spec = Spec::read("the specification in the manifest", &manifest.spec)?;
            spec.runs = None;
            let spec = spec.to_toml()?;
            let (campaign, folder) = (String::new(), Path::new("").to_owned());
            Ok::<_, Failure>(Self {
                campaign,
                folder,
                spec,
                runs: 0,
                shards: 0,
                runs_raised: false,
                ..manifest.clone()
            })
        };
        Ok(self.runs != there.runs && identity(self)? == identity(there)?)
    }
}

impl Folder {
    /// Replaces the campaign `there` of a folder by `campaign`, which has more runs. A row depends on the number of its
    /// run alone, so every row that was flown is kept, in journals of the new shards.
    ///
    /// # Errors
    /// [`Failure`] for fewer runs, for estimates, and for a file that cannot be read or written. A repeated call
    /// continues.
    pub(super) fn raise(path: &Path, campaign: Campaign, there: Manifest) -> Result<Self, Failure> {
        let (runs, before) = (campaign.manifest().runs, there.runs);
        if runs < before {
            let problem = format!("the folder holds this campaign with {before} runs, and this is {runs}");
            return Err(other_campaign(path, problem, "give the same number of runs or more, or another folder"));
        }
        if campaign.splitting().is_some() {
            let problem = format!("the folder holds this campaign with {before} estimates, and this is {runs}");
            let remedy = "their interval needs a number of runs that was fixed beforehand: give another folder";
            return Err(other_campaign(path, problem, remedy));
        }
        let old = Self::at(path, Campaign::of(there, path, campaign.external_law())?);
        let new = Self::at(path, campaign.raised());
        new.create_parts()?;
        let manifest = new.campaign().manifest();
        let mut open: Option<(u64, Journal)> = None;
        for shard in 0..old.campaign().manifest().shards {
            let rows = match old.read(shard)? {
                PartState::Whole(rows) => rows,
                PartState::Missing | PartState::Damaged(_) => old.flown_before(shard)?,
            };
            for row in rows {
                // Rows come in the order of their runs.
                let from = open.as_ref().map_or(0, |(shard, _)| *shard);
                let Some(shard) = (from..manifest.shards).find(|&shard| manifest.range(shard).contains(&row.run))
                else {
                    continue;
                };
                if open.as_ref().is_none_or(|(open_shard, _)| *open_shard != shard) {
                    open.take().map_or(Ok(()), |(_, journal)| journal.sync())?;
                    open = Some((shard, Journal::create(new.unique_path(shard, JOURNAL), manifest)?));
                }
                open.as_mut().map_or(Ok(()), |(_, journal)| journal.add(&row))?;
            }
        }
        open.map_or(Ok(()), |(_, journal)| journal.sync())?;
        for shard in 0..old.campaign().manifest().shards {
            for part in [old.part_path(shard), old.times_path(shard)] {
                remove_if_present(&part)?;
            }
        }
        manifest.write(&path.join("manifest.json"))?;
        Ok(new)
    }
}
