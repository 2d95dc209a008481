//! Flights on several threads, with progress. The results are the same for any number of threads.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use crate::THREADS;
use crate::flight::{FlightSummary, fly};
use tautline_core::failure::{Failure, in_range};
use tautline_core::monitor::Monitor;
use tautline_core::option;
use tautline_sim::scenario::{ExternalLaw, Scenario};
use tautline_sim::sim::SimError;

/// Steps between two reports of progress.
const PROGRESS_STEPS: u64 = 64;

/// Flies scenarios on several threads. A [`Monitor`] receives the progress in steps and may interrupt the flights.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    threads: usize,
    monitor: &'a dyn Monitor,
    finishes_flights: bool,
    /// Whether everything runs on the calling thread.
    on_calling_thread: bool,
}

impl<'a> Batch<'a> {
    /// Returns a batch on a number of threads, by default one for each core.
    ///
    /// # Errors
    /// [`Failure`] for a number of threads outside [`THREADS`].
    pub fn new(threads: Option<usize>, monitor: &'a dyn Monitor) -> Result<Self, Failure> {
        let threads = threads.unwrap_or_else(|| rayon::current_num_threads().min(*THREADS.end()));
        in_range(option::THREADS, &threads, &THREADS)?;
        Ok(Self { threads, monitor, finishes_flights: false, on_calling_thread: false })
    }

    /// Returns a batch for flights with these external laws: on the calling thread if a law requires it.
    ///
    /// # Errors
    /// As [`Batch::new`], and [`Failure`] for several threads that a law does not allow.
    pub fn for_laws<'b>(
        threads: Option<usize>,
        monitor: &'a dyn Monitor,
        laws: impl IntoIterator<Item = &'b ExternalLaw>,
    ) -> Result<Self, Failure> {
        let batch = Self::new(threads, monitor)?;
        let Some(law) = laws.into_iter().find(|law| law.requires_calling_thread()) else { return Ok(batch) };
        if let Some(threads) = threads.filter(|&threads| threads != 1) {
            let name = law.name();
            let given = option::THREADS.set(threads);
            let message = format!("{given}: must be 1 for the law `{name}`, which runs on one thread");
            return Err(Failure::input("request/one-thread", message, format!("leave {} out", option::THREADS)));
        }
        Ok(Self { threads: 1, on_calling_thread: true, ..batch })
    }

    /// Returns the same batch, whose flights under way end normally after an interruption.
    #[must_use]
    pub fn finishing_flights(self) -> Self {
        Self { finishes_flights: true, ..self }
    }

    /// Returns the number of threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Returns the receiver of progress.
    #[must_use]
    pub fn monitor(&self) -> &'a dyn Monitor {
        self.monitor
    }

    /// Returns whether the monitor has interrupted the batch.
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.monitor.is_interrupted()
    }

    /// Calls `make` for 0, 1, ... below `count` on all threads and returns the results in this order. A result is
    /// `None` if the batch was interrupted before or during the call.
    ///
    /// Within `make`, rayon has one thread. Each thread holds the memory of one flight, because parts of a flight do
    /// not run on several threads.
    ///
    /// # Errors
    /// The error of the smallest number that failed.
    pub fn run<T: Send, E: Send>(
        &self,
        count: usize,
        make: impl Fn(usize) -> Result<Option<T>, E> + Sync,
    ) -> Result<Vec<Option<T>>, E> {
        let next = AtomicUsize::new(0);
        let take = || {
            let number = next.fetch_add(1, Ordering::Relaxed);
            (number < count).then(|| (number, if self.is_interrupted() { Ok(None) } else { make(number) }))
        };
        let work = || {
            // If the pool of one thread cannot be built, the global pool runs the parts of a flight: slower, with equal
            // bits.
            let _single = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
            std::iter::from_fn(take).collect::<Vec<_>>()
        };
        let mut made: Vec<_> = thread::scope(|scope| {
            let spawned = if self.on_calling_thread { 0 } else { self.threads.min(count) };
            let started = (0..spawned).map_while(|_| thread::Builder::new().spawn_scoped(scope, work).ok());
            let started: Vec<_> = started.collect();
            let join = |thread: thread::ScopedJoinHandle<'_, Vec<_>>| {
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            started.into_iter().flat_map(join).collect()
        });
        // This thread does the work if a law requires it, or if the system starts no thread.
        made.extend(std::iter::from_fn(take));
        made.sort_by_key(|&(number, _)| number);
        made.into_iter().map(|(_, made)| made).collect()
    }

    /// Calls `make` for each member of `count` groups of `size`, group after group, as [`Batch::run`] does. A group is
    /// `None` if a result is missing.
    ///
    /// # Errors
    /// As [`Batch::run`].
    pub fn run_groups<T: Send, E: Send>(
        &self,
        count: usize,
        size: usize,
        make: impl Fn(usize, usize) -> Result<Option<T>, E> + Sync,
    ) -> Result<Vec<Option<Vec<T>>>, E> {
        let mut made = self.run(count.saturating_mul(size), |number| make(number / size, number % size))?.into_iter();
        // All members are taken before they are collected, which stops at the first missing result.
        let mut group = || made.by_ref().take(size).collect::<Vec<_>>().into_iter().collect();
        Ok((0..count).map(|_| group()).collect())
    }

    /// Flies a scenario to its end. Returns `None` if the batch was interrupted.
    ///
    /// # Errors
    /// As [`fly`].
    pub fn fly(&self, scenario: &Scenario, seed: u64) -> Result<Option<FlightSummary>, SimError> {
        if self.is_interrupted() {
            return Ok(None);
        }
        let mut reported = 0;
        let flight = fly(scenario, seed, &mut self.carry_on(&mut reported, self.finishes_flights));
        self.monitor.advance(scenario.time.steps().saturating_sub(reported));
        flight
    }

    /// Returns a function that takes a number of steps and reports the progress. The function breaks after an
    /// interruption, unless `finishes` is set.
    pub fn carry_on<'b>(
        &'b self,
        reported: &'b mut u64,
        finishes: bool,
    ) -> impl FnMut(u64) -> ControlFlow<()> + use<'a, 'b> {
        move |steps| {
            if steps - *reported >= PROGRESS_STEPS {
                self.monitor.advance(steps - *reported);
                *reported = steps;
            }
            if !finishes && self.is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::monitor::Silent;

    #[test]
    fn results_come_in_order_once_each_for_any_number_of_threads() {
        let monitor = Silent::default();
        for threads in [1, 2, 7, 100] {
            let batch = Batch::new(Some(threads), &monitor).expect("a batch");
            let squares = batch.run(50, |number| Ok::<_, ()>(Some(number * number))).expect("squares");
            assert_eq!(squares, (0..50).map(|number| Some(number * number)).collect::<Vec<_>>(), "{threads}");
            assert_eq!(batch.run(0, |number| Ok::<_, ()>(Some(number))), Ok(Vec::new()));
            let failed = batch.run(50, |number| if number % 20 == 9 { Err(number) } else { Ok(Some(())) });
            assert_eq!(failed, Err(9));
        }
        assert!(Batch::new(Some(0), &monitor).is_err() && Batch::new(Some(257), &monitor).is_err());
    }

    #[test]
    fn a_group_without_all_its_results_is_missing() {
        let monitor = Silent::default();
        let batch = Batch::new(Some(2), &monitor).expect("a batch");
        let groups = batch.run_groups(3, 2, |group, member| Ok::<_, ()>((group != 1 || member > 0).then_some(member)));
        assert_eq!(groups, Ok(vec![Some(vec![0, 1]), None, Some(vec![0, 1])]));
        assert_eq!(batch.run_groups(0, 3, |_, member| Ok::<_, ()>(Some(member))), Ok(Vec::new()));
    }

    #[test]
    fn within_a_flight_there_is_one_thread() {
        let monitor = Silent::default();
        let batch = Batch::new(Some(2), &monitor).expect("a batch");
        let threads = batch.run(8, |_| Ok::<_, ()>(Some(rayon::current_num_threads())));
        assert_eq!(threads, Ok(vec![Some(1); 8]));
    }

    #[test]
    fn an_interruption_ends_the_batch() {
        let monitor = Silent::default();
        let batch = Batch::new(Some(1), &monitor).expect("a batch");
        let made = batch.run(5, |number| {
            monitor.interruption.store(number == 1, Ordering::Relaxed);
            Ok::<_, ()>(Some(number))
        });
        assert_eq!(made, Ok(vec![Some(0), Some(1), None, None, None]));
    }
}
