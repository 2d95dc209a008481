//! All flights of a plan, side by side.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::flight::{FlightRow, fly};
use super::parallel::in_parallel;
use super::plan::{CompareError, Plan};
use super::result::Comparison;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::SimError;

/// Steps between two looks at the progress.
const PROGRESS_EVERY: u64 = 64;

/// Who looks on while flights are flown.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Told of steps as they are flown.
    pub flown: &'a (dyn Fn(u64) + Sync),
    /// Set from outside: flights under way end, and no other begins.
    pub interrupted: &'a AtomicBool,
}

impl Plan {
    /// Flies everything on so many threads. The result is the same for any number of them but for
    /// [`Comparison::performance`].
    ///
    /// One that is interrupted is about the starts that were flown under every law, if there are any.
    ///
    /// # Errors
    /// [`CompareError`] for the first flight that does not exist.
    pub fn fly(&self, threads: usize, watch: Watch<'_>) -> Result<Comparison, CompareError> {
        let began = Instant::now();
        // All laws from one start before the next one: an interruption leaves few starts that cannot be compared.
        let flown = in_parallel(self.flights(), threads, &|flight| self.one(flight, watch));
        let flights = by_law(flown, self.laws().len())?;
        Ok(Comparison::new(self, flights, began.elapsed().as_secs_f64()))
    }

    /// A flight by its number; none where it was interrupted.
    fn one(&self, flight: usize, watch: Watch<'_>) -> Result<Option<FlightRow>, CompareError> {
        let count = self.laws().len();
        let (seed, law) = (self.seed((flight / count) as u64), &self.laws()[flight % count]);
        let row = watch.fly(&self.scenario(law, seed)?, seed);
        row.map_err(|error| CompareError::Flight { law: law.name.clone(), seed, error })
    }
}

impl Watch<'_> {
    /// Flies a scenario to its end and keeps its row; none where it was interrupted.
    pub(crate) fn fly(self, scenario: &Scenario, seed: u64) -> Result<Option<FlightRow>, SimError> {
        let stops = || self.interrupted.load(Ordering::Relaxed);
        if stops() {
            return Ok(None);
        }
        let mut told = 0;
        let mut carry_on = |step: u64| {
            if step.is_multiple_of(PROGRESS_EVERY) {
                (self.flown)(step - told);
                told = step;
            }
            if stops() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let row = fly(scenario, seed, &mut carry_on);
        (self.flown)(scenario.time.steps().saturating_sub(told));
        row
    }
}

/// Flights, of all laws from one start after the other, by their law: those from starts that were flown under every law.
fn by_law<T, E>(flown: Vec<Result<Option<T>, E>>, laws: usize) -> Result<Vec<Vec<T>>, E> {
    let mut flights: Vec<Vec<T>> = (0..laws).map(|_| Vec::new()).collect();
    let mut flown = flown.into_iter().peekable();
    while flown.peek().is_some() {
        // All of a start are taken, whether they were flown or not.
        let of_start: Vec<_> = flown.by_ref().take(laws.max(1)).collect();
        let rows = of_start.into_iter().collect::<Result<Option<Vec<_>>, _>>()?;
        for (law, row) in flights.iter_mut().zip(rows.into_iter().flatten()) {
            law.push(row);
        }
    }
    Ok(flights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_that_was_not_flown_under_every_law_is_left_out_and_moves_no_other() {
        let flown = [Some(10), Some(11), None, Some(21), Some(30), Some(31), Some(40), None, None, None];
        let kept = by_law(flown.map(Ok::<_, ()>).to_vec(), 2);
        assert_eq!(kept, Ok(vec![vec![10, 30], vec![11, 31]]));
        assert_eq!(by_law(vec![Ok(Some(1)), Ok(None), Err("first"), Err("second")], 2), Err("first"));
        assert_eq!(by_law(Vec::<Result<Option<u8>, ()>>::new(), 3), Ok(vec![vec![]; 3]));
    }
}
