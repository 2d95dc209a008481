//! Helpers of the tests of studies.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::base::BaseScenario;
use crate::batch::Batch;
use tautline_core::monitor::{Monitor, Silent};
use tautline_sim::scenario::{Override, Source};

/// Scenario of two vehicles that approach each other.
const PAIR: &str = r#"name = "pair"
[start]
positions_m = [[0.0, 0.0], [4.0, 0.0]]
[formation]
shape = "line"
spacing_m = 3.0
[law]
delta_m = 2.0
alpha = 0.5
[time]
duration_s = 2.0
record_hz = 10
"#;

/// Returns the scenario of two vehicles that approach each other.
pub(crate) fn pair() -> Source {
    Source::Text { name: "pair".to_owned(), text: PAIR.to_owned() }
}

/// Returns a scenario with overrides.
pub(crate) fn base(source: Source, sets: &[&str]) -> BaseScenario {
    let sets = sets.iter().map(|set| Override::parse(set).expect("an override")).collect();
    BaseScenario::read(source, sets).expect("a scenario")
}

/// Calls `fly` with a batch without a monitor.
pub(crate) fn batch<T>(threads: usize, fly: &mut dyn FnMut(&Batch<'_>) -> T) -> T {
    let monitor = Silent::default();
    fly(&Batch::new(Some(threads), &monitor).expect("a batch"))
}

/// Monitor that interrupts after a number of steps.
pub(crate) struct InterruptAfter {
    steps: u64,
    flown: AtomicU64,
    interruption: Arc<AtomicBool>,
}

impl InterruptAfter {
    pub(crate) fn new(steps: u64) -> Self {
        Self { steps, flown: AtomicU64::new(0), interruption: Arc::new(AtomicBool::new(steps == 0)) }
    }
}

impl Monitor for InterruptAfter {
    fn interruption(&self) -> &Arc<AtomicBool> {
        &self.interruption
    }

    fn advance(&self, units: u64) {
        let flown = self.flown.fetch_add(units, Ordering::Relaxed) + units;
        self.interruption.store(flown >= self.steps, Ordering::Relaxed);
    }
}
