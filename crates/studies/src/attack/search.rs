//! The flights of a search.

use std::sync::atomic::Ordering;

use super::method::{Searcher, within};
use super::plan::{AttackError, Plan};
use super::result::{Attack, Candidate, Flown, Found};
use crate::compare::{Watch, in_parallel};
use tautline_sim::scenario::Scenario;

/// Candidates in a row that cannot be flown before a search looks elsewhere.
const MOST_REFUSED: usize = 1000;
/// Places in a row where it does so before it gives up.
const MOST_PLACES: usize = 4;

/// A candidate that is to be flown.
struct Next {
    /// Where the searcher has it.
    drawn: Vec<f64>,
    values: Vec<f64>,
    /// A flight for each seed.
    flights: Vec<Scenario>,
}

/// A search under way.
struct Search<'a> {
    plan: &'a Plan,
    threads: usize,
    watch: Watch<'a>,
    searcher: Searcher,
    found: Found,
}

impl Plan {
    /// Flies candidates until the flights are spent, those of a generation on so many threads; the result is the same for any
    /// number of them. None where it was interrupted before the scenario itself and one candidate were flown.
    ///
    /// # Errors
    /// [`AttackError`] for the first flight that does not exist.
    pub fn search(&self, threads: usize, watch: Watch<'_>) -> Result<Option<Attack>, AttackError> {
        let as_it_is = |error| AttackError::Flight { set: "the keys as they are".to_owned(), error };
        let Some(own) = watch.fly(self.own(), self.noise_seed(0)).map_err(as_it_is)? else { return Ok(None) };
        let asked = self.asked();
        let searcher = Searcher::new(asked.method, self.bounds().len(), self.own().delta_m, asked.seed);
        let mut search = Search { plan: self, threads, watch, searcher, found: Found::default() };
        search.fly()?;
        let restarts = search.searcher.restarts();
        let interrupted = watch.interrupted.load(Ordering::Relaxed);
        let is_empty = interrupted && search.found.flights == 0;
        Ok((!is_empty).then(|| Attack::new(self, Flown::new(&own), search.found, restarts, interrupted)))
    }
}

impl Search<'_> {
    fn fly(&mut self) -> Result<(), AttackError> {
        let (flights, seeds) = (self.plan.asked().flights, self.plan.asked().seeds);
        while let Some(left) = (flights - self.found.flights).checked_div(seeds).filter(|&left| left > 0) {
            let whole = self.searcher.generation();
            let count = usize::try_from(left).map_or(whole, |left| left.min(whole));
            let Some(next) = self.next(count) else {
                self.found.exhausted = !self.watch.interrupted.load(Ordering::Relaxed);
                return Ok(());
            };
            let Some(values) = self.values(&next)? else { return Ok(()) };
            if count == whole {
                let drawn: Vec<_> = next.into_iter().map(|next| next.drawn).collect();
                self.searcher.learn(&drawn, &values);
            }
        }
        Ok(())
    }

    /// So many candidates that can be flown; none where there are hardly any.
    fn next(&mut self, count: usize) -> Option<Vec<Next>> {
        for _ in 0..MOST_PLACES {
            let next: Option<Vec<_>> = std::iter::repeat_with(|| self.flyable()).take(count).collect();
            if next.is_some() || self.watch.interrupted.load(Ordering::Relaxed) {
                return next;
            }
            self.searcher.move_elsewhere();
        }
        None
    }

    /// A candidate that can be flown.
    fn flyable(&mut self) -> Option<Next> {
        for _ in 0..MOST_REFUSED {
            if self.watch.interrupted.load(Ordering::Relaxed) {
                return None;
            }
            let drawn = self.searcher.draw();
            let values = self.plan.values(&within(self.plan.asked().method, &drawn));
            match self.plan.candidate(&values) {
                Ok(flights) => return Some(Next { drawn, values, flights }),
                Err(why) => {
                    self.found.refused += 1;
                    self.found.first_refusal.get_or_insert(why);
                }
            }
        }
        None
    }

    /// Flies candidates, takes note of them and gives the value of each; none where it was interrupted.
    fn values(&mut self, next: &[Next]) -> Result<Option<Vec<f64>>, AttackError> {
        let flights: Vec<_> = next
            .iter()
            .flat_map(|next| next.flights.iter().enumerate().map(move |(k, flight)| (next, k as u64, flight)))
            .collect();
        let (plan, watch) = (self.plan, self.watch);
        let flown = in_parallel(flights.len(), self.threads, &|number| {
            let (next, k, scenario) = flights[number];
            let row = watch.fly(scenario, plan.noise_seed(k));
            row.map_err(|error| AttackError::Flight { set: plan.sets(&next.values, k).join(", "), error })
        });
        let flown = flown.into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut values = vec![f64::INFINITY; next.len()];
        let seeds = flights.len() / next.len().max(1);
        for (number, row) in flown.into_iter().enumerate() {
            // What was broken off, and what came after it, counts for nothing.
            let Some(row) = row else { return Ok(None) };
            let (candidate, k) = (number / seeds, (number % seeds) as u64);
            let flown = Flown::new(&row);
            let clearance_m = flown.min_m.map_or(f64::INFINITY, |min_m| min_m - plan.own().delta_m);
            values[candidate] = values[candidate].min(clearance_m);
            let values = next[candidate].values.clone();
            self.found.take(&row, |flight| Candidate { flight, run: k, values, flown });
        }
        Ok(Some(values))
    }
}
