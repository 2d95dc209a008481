//! The flights of a search.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

use super::plan::{MarginError, Plan};
use super::result::{Flown, Margin, Probe};
use super::search::{Found, search};
use crate::compare::{Watch, fly, in_parallel};

/// Steps between two looks at the progress.
const PROGRESS_EVERY: u64 = 64;

impl Plan {
    /// Flies values until the bracket is found, each value's runs on so many threads; the result is the same for any number
    /// of them. None where it was interrupted before both ends were flown.
    ///
    /// # Errors
    /// [`MarginError`] for the first flight that does not exist.
    pub fn search(&self, threads: usize, watch: Watch<'_>) -> Result<Option<Margin>, MarginError> {
        let mut probes: Vec<Probe> = Vec::new();
        let found = search(self.range(), &mut |value| {
            let probe = self.probe(value, threads, watch)?;
            let holds = probe.as_ref().map(Probe::holds);
            probes.extend(probe);
            Ok::<_, MarginError>(holds)
        })?;
        let interrupted = watch.interrupted.load(Ordering::Relaxed);
        probes.sort_by(|a, b| a.value.total_cmp(&b.value));
        let found = found.filter(|found| !matches!(found, Found::Even(_)) || !interrupted);
        Ok(found.map(|found| Margin::new(self, probes, &found, interrupted)))
    }

    /// All runs of one value; none where they were interrupted.
    fn probe(&self, value: f64, threads: usize, watch: Watch<'_>) -> Result<Option<Probe>, MarginError> {
        let runs = usize::try_from(self.asked().runs).unwrap_or(usize::MAX);
        let flown = in_parallel(runs, threads, &|run| self.one(value, run as u64, watch));
        let flown = flown.into_iter().collect::<Result<Option<Vec<_>>, _>>()?;
        Ok(flown.map(|flights| Probe::new(value, self.asked().question, flights)))
    }

    fn one(&self, value: f64, run: u64, watch: Watch<'_>) -> Result<Option<Flown>, MarginError> {
        let stops = || watch.interrupted.load(Ordering::Relaxed);
        if stops() {
            return Ok(None);
        }
        let scenario = self.scenario(value, run)?;
        let mut told = 0;
        let mut carry_on = |step: u64| {
            if step.is_multiple_of(PROGRESS_EVERY) {
                (watch.flown)(step - told);
                told = step;
            }
            if stops() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let row = fly(&scenario, self.asked().seed.saturating_add(run), &mut carry_on);
        (watch.flown)(scenario.time.steps().saturating_sub(told));
        let row = row.map_err(|error| MarginError::Flight { set: format!("{} = {value}", self.key()), error })?;
        Ok(row.map(|row| Flown::new(&row)))
    }
}
