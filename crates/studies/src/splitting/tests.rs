//! Splitting against plain flights, and replays with the same bits.

mod walk;

use std::ops::ControlFlow;

use super::{Genealogy, Repetitions, Splitting, SplittingSettings, estimate, replay};
use tautline_core::record::{Event, RecordError, Sample, Sink, StateHash, Step};
use tautline_sim::scenario::{Scenario, Source};
use tautline_sim::sim::Simulation;

/// Returns three vehicles that hold their places, each in its own turbulence, with additional keys.
fn windy(law: &str, speed_m_s: f64, more: &str) -> Scenario {
    let text = format!(
        "[start]\npositions_m = [[0.0, 0.0], [3.0, 0.0], [6.0, 0.0]]\n[formation]\nshape = \"line\"\nspacing_m = 3.0\n\
         [law]\nkind = \"{law}\"\ndelta_m = 2.0\n[vehicle]\ndrag_per_s = 0.5\n\
         [wind]\nmean_m_s = [2.0, 0.0]\nshared = false\n\
         dryden = {{ speed_20ft_m_s = {speed_m_s:.1}, height_m = 10.0 }}\n[time]\nduration_s = 3.0\n{more}"
    );
    let mut scenario = Scenario::read(&Source::Text { name: "windy".to_owned(), text }, &[]).expect("a scenario");
    (scenario.time.dt_s, scenario.time.record_hz) = (0.04, 25.0);
    scenario
}

/// Errors of measurement, constant errors included.
const SENSING: &str = "[sensing]\nposition_noise_m = 0.1\nposition_bias_m = 0.1\nvelocity_noise_m_s = 0.1\n\
                       rate_hz = 5.0\nlatency_s = 0.1\n";

/// Losses and delays of messages.
const NETWORK: &str = "[network]\nloss = 0.2\nloss_burst = 2.0\njitter_s = 0.05\nlatency_s = 0.02\nrate_hz = 10.0\n";

/// Returns a law with avoidance and all kinds of randomness of a flight.
fn all_random() -> Scenario {
    windy("displacement", 14.0, &[SENSING, NETWORK].concat())
}

fn split(scenario: &Scenario, settings: &SplittingSettings, repetition: u64) -> Splitting {
    let split = estimate(scenario, settings, [7, repetition], &mut |_| ControlFlow::Continue(()));
    split.expect("an estimate").expect("no interruption")
}

/// Returns whether a flight with this noise violates delta, and the clearance of an obstacle. Asserts that the score of
/// splitting and the judge agree.
fn violations(scenario: &Scenario, noise_seed: u64) -> [bool; 2] {
    let mut simulation = Simulation::new(&Scenario { noise_seed, ..scenario.clone() }).expect("a simulation");
    let mut least_m = f64::INFINITY;
    while simulation.ending().is_none() {
        simulation.step();
        let now_m = simulation.least_clearance_m().expect("pairs");
        assert!(now_m <= least_m, "it never grows");
        least_m = now_m;
    }
    let flight = simulation.finish();
    let is_near = flight.clearance.is_some_and(|clearance| !clearance.violations.is_empty());
    let violations = [!flight.audit.violations.is_empty(), is_near];
    assert_eq!(least_m < 0.0, violations.contains(&true));
    violations
}

/// Both estimators are unbiased. At a few per cent, the mean of estimates and the share of plain flights differ by less
/// than three standard errors.
#[test]
fn splitting_agrees_with_plain_flights() {
    let is_long = std::env::var_os("TAUTLINE_LONG").is_some();
    let (scenario, more) = if is_long { (all_random(), 5) } else { (windy("laplacian", 3.0, SENSING), 1) };
    let (runs, repetitions) = (1500 * more, 20 * more);
    let plain = (0..runs).filter(|&seed| violations(&scenario, seed)[0]).count();
    let share = plain as f64 / runs as f64;
    let settings = SplittingSettings { flights: 30, kill: 3, keep: 0 };
    let estimates: Vec<_> = (0..repetitions).map(|repetition| split(&scenario, &settings, repetition)).collect();
    let mean = Repetitions::new(&estimates).probability.value.expect("estimates");
    let squares = estimates.iter().map(|estimate| (estimate.probability - mean).powi(2)).sum::<f64>();
    let variance = squares / (repetitions - 1) as f64 / repetitions as f64;
    let error = (variance + share * (1.0 - share) / runs as f64).sqrt();
    assert!(estimates.iter().all(|estimate| estimate.iterations > 0), "each estimate ends flights");
    assert!((0.02..0.2).contains(&share) && 4.0 * error < share, "the share is significant");
    assert!((mean - share).abs() < 3.0 * error, "{mean} for {share}, {error}");
}

/// Violations of obstacles count, and the score agrees with the judge.
#[test]
fn obstacles_count_as_violations() {
    let post = "[[obstacle]]\nname = \"post\"\nball = { radius_m = 1.0 }\nat_m = [0.0, -2.1, 0.0]\nclearance_m = 1.0\n";
    let scenario = windy("laplacian", 3.0, post);
    let flown: Vec<_> = (0..60).map(|seed| violations(&scenario, seed)).collect();
    assert!(flown.contains(&[false, true]) && flown.contains(&[false, false]), "{flown:?}");
}

/// State after each step, and everything that was recorded.
#[derive(Default)]
struct Seen {
    after: Vec<String>,
    all: StateHash,
    violated: bool,
}

impl Sink for Seen {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.all.observe(sample);
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.violated |= matches!(event, Event::ViolationBegan { .. });
        Ok(())
    }

    fn step(&mut self, step: &Step<'_>) {
        let mut hash = StateHash::new();
        hash.observe(&Sample::new(step.time_s, 0, step.swarm, step.control));
        self.after.push(hash.finish());
    }
}

fn seen(scenario: &Scenario, genealogy: &Genealogy) -> Seen {
    let mut seen = Seen::default();
    replay(scenario, genealogy, &mut seen).expect("a flight");
    seen
}

/// Violated flights consist of copies of copies, from saved or recomputed states. A replay in one piece has the same
/// bits, and equals its ancestor up to the branch only.
#[test]
fn a_violated_flight_is_replayed_with_the_same_bits() {
    for scenario in [windy("laplacian", 3.0, ""), all_random()] {
        let settings = SplittingSettings { flights: 30, kill: 3, keep: 4 };
        let bad: Vec<_> = (0..2).flat_map(|repetition| split(&scenario, &settings, repetition).bad).collect();
        assert!(bad.iter().any(|bad| bad.genealogy.branches.len() > 1));
        for bad in &bad {
            let flight = seen(&scenario, &bad.genealogy);
            let step = usize::try_from(bad.violated_at_step).expect("few");
            assert_eq!(flight.after[step], bad.state_hash, "{bad:?}");
            assert!(flight.violated && bad.clearance_m < 0.0);
            let again = seen(&scenario, &bad.genealogy);
            assert_eq!((again.all.finish(), again.after.len()), (flight.all.finish(), flight.after.len()));
            if let Some((last, earlier)) = bad.genealogy.branches.split_last() {
                let ancestor = Genealogy { branches: earlier.to_vec(), ..bad.genealogy.clone() };
                let ancestor = seen(&scenario, &ancestor);
                let common = usize::try_from(last.step).expect("few");
                assert_eq!(flight.after[..=common], ancestor.after[..=common]);
                assert_ne!(flight.after.last(), ancestor.after.last());
            }
        }
    }
}

/// Held measurements must not change at the branch.
#[test]
fn fresh_noise_keeps_held_measurements() {
    let mut scenario = windy("displacement", 5.0, SENSING);
    scenario.wind.turbulence = None;
    let mut straight = Simulation::new(&scenario).expect("a simulation");
    // At 1.04 s vehicles hold their measurements of 0.8 s, from 1.1 s on those of 1 s.
    (0..26).for_each(|_| straight.step());
    let mut fresh = straight.clone();
    fresh.load(&straight.save(), Some(9));
    straight.step();
    fresh.step();
    assert_eq!(straight.state(), fresh.state());
    for _ in 0..4 {
        straight.step();
        fresh.step();
    }
    assert_ne!(straight.state(), fresh.state());
}

#[test]
fn an_estimate_is_the_same_for_the_same_seed_and_can_be_ended() {
    let (scenario, settings) = (windy("laplacian", 3.0, ""), SplittingSettings { flights: 6, kill: 1, keep: 2 });
    let first = split(&scenario, &settings, 0);
    assert_eq!(split(&scenario, &settings, 0), first);
    assert_ne!(split(&scenario, &settings, 1).steps, first.steps);
    let broken = estimate(&scenario, &settings, [7, 0], &mut |steps| {
        if steps < first.steps / 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    assert!(matches!(broken, Ok(None)));
}

#[test]
fn scenarios_that_cannot_be_split_are_refused_with_a_remedy() {
    let refused = |scenario: &Scenario, flights: usize, kill: usize| {
        let settings = SplittingSettings { flights, kill, keep: 1 };
        estimate(scenario, &settings, [1, 0], &mut |_| ControlFlow::Break(())).expect_err("refused").to_string()
    };
    let windy = windy("laplacian", 3.0, "");
    assert!(refused(&windy, 1, 1).starts_with("splitting.flights: must be at least 2, got 1 "));
    assert!(refused(&windy, 10, 0).starts_with("splitting.kill: must be from 1 to 9, got 0 "));
    assert!(refused(&windy, 10, 10).starts_with("splitting.kill: must be from 1 to 9, got 10 "));
    // Constant errors are drawn once: two flights from one state are equal.
    let mut still = windy.clone();
    still.wind.turbulence = None;
    for bias_m in [0.0, 0.1] {
        still.sensing.position_bias_m = bias_m;
        let words = refused(&still, 10, 1);
        assert!(words.starts_with("nothing in this flight is random") && words.contains("network.loss"), "{words}");
    }
    assert!(SplittingSettings::default().warning().is_none());
    assert!(
        SplittingSettings { flights: 20, ..SplittingSettings::default() }
            .warning()
            .is_some_and(|words| words.contains("100 or more"))
    );
}
