//! The flights of a search.

use std::sync::atomic::Ordering;

use super::plan::{MarginError, Plan};
use super::result::{Flown, Margin, Probe};
use super::search::{Found, search};
use crate::compare::{Watch, in_parallel};

impl Plan {
    /// Flies values until the bracket is found, each value's runs on so many threads; the result is the same for any number
    /// of them. None where it was interrupted before both ends were flown.
    ///
    /// # Errors
    /// [`MarginError`] for the first flight that does not exist.
    pub fn search(&self, threads: usize, watch: Watch<'_>) -> Result<Option<Margin>, MarginError> {
        let mut probes: Vec<Probe> = Vec::new();
        let found = search(self.range(), self.is_whole(), &mut |value| {
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
        let row = watch.fly(&self.scenario(value, run)?, self.asked().seed.saturating_add(run));
        let row = row.map_err(|error| MarginError::Flight { set: format!("{} = {value}", self.key()), error })?;
        Ok(row.map(|row| Flown::new(&row)))
    }
}
