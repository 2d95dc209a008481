//! Flying one shard: every run of it under every law, kept as they are flown.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use super::error::CampaignError;
use super::folder::{Folder, JOURNAL};
use super::part::{self, Found, Journal};
use super::row::Row;
use crate::compare::{Watch, in_parallel};

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
    /// Flies a shard on so many threads, unless it has been flown; the result is the same for any number of them, and for any
    /// number of interruptions before.
    ///
    /// # Errors
    /// [`CampaignError::Alarm`] where another process flew it meanwhile with different results, [`CampaignError::Flight`] for a
    /// flight that does not exist, [`CampaignError::Machine`] where the disk is full; what was flown is kept.
    pub fn fly(&self, shard: u64, threads: usize, watch: Watch<'_>) -> Result<Shard, CampaignError> {
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
        let made = in_parallel(missing.len(), threads, &|number| {
            let (run, law) = missing[number];
            let row = self.campaign().row(run, law, watch)?;
            if let Some(row) = &row {
                // Whoever panics with the journal in hand ends the flight anyway.
                journal.lock().unwrap_or_else(std::sync::PoisonError::into_inner).add(row)?;
            }
            Ok::<_, CampaignError>(row)
        });
        for row in made {
            match row? {
                Some(row) => rows.push(row),
                None => return Ok(Shard::Interrupted),
            }
        }
        rows.sort_by_key(Row::place);
        self.publish(shard, &rows)?;
        self.sweep(shard)?;
        let seconds = began.elapsed().as_secs_f64();
        let times = format!("{{\"wall_s\": {seconds:.3}, \"threads\": {threads}, \"flights\": {flown}}}\n");
        tautline_report::report::write_atomically(&self.times(shard), times.as_bytes())?;
        Ok(Shard::Flown { rows, flown: flown as u64 })
    }

    /// Rows that processes left which were killed, each once.
    fn flown_before(&self, shard: u64) -> Result<Vec<Row>, CampaignError> {
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
                        return Err(CampaignError::Alarm { shard, kept: there.get().1.clone(), other: path });
                    }
                }
            }
        }
        Ok(rows.into_values().map(|(row, _)| row).collect())
    }

    /// Puts a part in its place, whole, unless there is one: then both must say the same.
    fn publish(&self, shard: u64, rows: &[Row]) -> Result<(), CampaignError> {
        let bytes = part::encode(self.campaign().manifest(), shard, rows)?;
        let (path, own) = (self.part(shard), self.own(shard, "partial"));
        let failed = |error| CampaignError::writing(&own, error);
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
    fn settle(&self, shard: u64, own: &Path, bytes: &[u8]) -> Result<(), CampaignError> {
        let kept = self.part(shard);
        let there = fs::read(&kept).map_err(|error| CampaignError::reading(&kept, error))?;
        if there == bytes {
            return fs::remove_file(own).map_err(|error| CampaignError::writing(own, error));
        }
        let other = self.differs(shard);
        fs::rename(own, &other).map_err(|error| CampaignError::writing(&other, error))?;
        Err(CampaignError::Alarm { shard, kept, other })
    }

    /// Removes what is left of a shard that is whole.
    fn sweep(&self, shard: u64) -> Result<(), CampaignError> {
        for path in self.left(shard, JOURNAL)? {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(CampaignError::writing(&path, error));
                }
                _ => {}
            }
        }
        Ok(())
    }
}
