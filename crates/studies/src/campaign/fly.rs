//! Flying runs of a campaign.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use super::error::CampaignError;
use super::plan::Campaign;
use super::result::{Gathered, Summary};
use super::row::Row;
use crate::compare::{Watch, in_parallel};
use crate::splitting::{self, Settings, Splitting, SplittingError};
use tautline_sim::scenario::Scenario;

/// Steps of an estimate between two looks at the progress.
const TOLD_EVERY: u64 = 1024;

/// Flights that are flown before it is asked whether enough has been: memory is that of so many rows.
const AT_ONCE: u64 = 1024;

impl Campaign {
    /// Flies a run under one of its laws, counted from 0; none where flying was interrupted before it. One that has begun is
    /// flown to its end.
    ///
    /// # Errors
    /// [`CampaignError::Flight`] for a flight that does not exist, and a law that is not one of the campaign's.
    pub fn row(&self, run: u64, law: usize, watch: Watch<'_>) -> Result<Option<Row>, CampaignError> {
        let Some(named) = self.laws().get(law) else {
            return Err(CampaignError::plan(format!("law {law} of {}", self.laws().len()), "laws are counted from 0"));
        };
        if watch.interrupted.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let row =
            |not_flown, flight, splitting| Row { run, law, drawn: self.values(run), not_flown, flight, splitting };
        let scenario = match self.scenario(run, named) {
            Ok(scenario) => scenario,
            Err(error) => {
                (watch.flown)(self.own().time.steps());
                return Ok(Some(row(Some(error.message().to_owned()), None, None)));
            }
        };
        if let Some(settings) = self.splitting() {
            let split = self.estimate(&scenario, settings, run, watch);
            let named = |error| CampaignError::Splitting { run, law: named.name.clone(), error: Box::new(error) };
            return Ok(split.map_err(named)?.map(|splitting| row(None, None, Some(splitting))));
        }
        let never = AtomicBool::new(false);
        let flown = Watch { interrupted: &never, ..watch }.fly(&scenario, run);
        let flown =
            flown.map_err(|error| CampaignError::Flight { run, law: named.name.clone(), error: Box::new(error) })?;
        Ok(flown.map(|flight| row(None, Some(flight), None)))
    }

    /// One estimate; none where it was interrupted, for it may take long.
    fn estimate(
        &self,
        scenario: &Scenario,
        settings: &Settings,
        run: u64,
        watch: Watch<'_>,
    ) -> Result<Option<Splitting>, SplittingError> {
        let mut told = 0;
        let mut carry_on = |steps: u64| {
            if steps - told >= TOLD_EVERY {
                (watch.flown)(steps - told);
                told = steps;
            }
            if watch.interrupted.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        splitting::estimate(scenario, settings, [self.seed(), run], &mut carry_on)
    }

    /// Flies everything on so many threads and keeps no file: the answer that [`super::Folder::merge`] gives, or none where it
    /// was interrupted.
    ///
    /// # Errors
    /// As [`Campaign::row`].
    pub fn fly(&self, threads: usize, watch: Watch<'_>) -> Result<Option<Summary>, CampaignError> {
        let (laws, runs) = (self.laws().len(), self.manifest().runs);
        let mut gathered = Gathered::new(self);
        let mut from = 0;
        while from < runs && !gathered.is_enough() {
            let to = runs.min(from + AT_ONCE);
            let places: Vec<_> = (from..to).flat_map(|run| (0..laws).map(move |law| (run, law))).collect();
            let made = in_parallel(places.len(), threads, &|number| {
                let (run, law) = places[number];
                self.row(run, law, watch)
            });
            for row in made {
                let Some(row) = row? else { return Ok(None) };
                gathered.take(&row);
            }
            from = to;
        }
        Ok(Some(gathered.finish(self)))
    }
}
