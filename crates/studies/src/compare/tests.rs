//! An interrupted comparison, wrong laws, and times to reach.

use super::{Comparison, Options};
use crate::base::BaseScenario;
use crate::batch::Batch;
use crate::study::{Experiment as _, Study as _};
use crate::tests::{InterruptAfter, base, batch};
use tautline_core::failure::Failure;
use tautline_sim::scenario::Source;

fn pentagon() -> BaseScenario {
    base(Source::Builtin("pentagon".to_owned()), &["time.duration_s=1.5"])
}

fn options(laws: &[&str], runs: u64) -> Options {
    Options { laws: Some(laws.iter().map(|&law| law.to_owned()).collect()), runs, seed: 3, ..Options::default() }
}

fn interrupted_after(steps: u64, threads: usize) -> Option<Comparison> {
    let monitor = InterruptAfter::new(steps);
    let batch = Batch::new(Some(threads), &monitor).expect("a batch");
    options(&["edge-tension", "laplacian"], 3).fly(&pentagon(), &batch).expect("no failure")
}

#[test]
fn an_interrupted_comparison_keeps_complete_starts() {
    // 360 steps per flight: the third flight, of the second start, is interrupted.
    let found = interrupted_after(360 * 2 + 100, 1).expect("a comparison");
    assert_eq!((found.runs, found.runs_asked), (1, 3));
    assert!(found.laws.iter().all(|law| law.flights.len() == 1 && law.flights[0].seed == 3));
    assert!(found.laws.iter().all(|law| law.flights[0].steps == 360), "whole flights");
    assert!(found.notes()[0].starts_with("interrupted: the comparison has 1 of 3 starts"), "{:?}", found.notes());
    assert!(interrupted_after(100, 1).is_none());
    // Two threads, each with a law of the second start: a law that has finished the start keeps it.
    let paired = interrupted_after(360 * 3 + 200, 2).expect("a comparison");
    assert!(paired.laws[0].flights.iter().zip(&paired.laws[1].flights).all(|(one, other)| one.seed == other.seed));
    assert!(paired.laws.iter().all(|law| law.flights.len() as u64 == paired.runs && law.name == law.kind));
    let whole = interrupted_after(u64::MAX, 2).expect("a comparison");
    assert_eq!((whole.runs, whole.laws[1].flights.len()), (3, 3));
    assert!(!whole.notes().iter().any(|note| note.starts_with("interrupted")));
}

#[test]
fn unknown_and_repeated_laws_are_refused() {
    let refused = |laws: &[&str]| {
        let flown = batch(1, &mut |batch| options(laws, 1).fly(&pentagon(), batch));
        flown.map_err(|failure: Failure| failure.code()).expect_err("refused")
    };
    assert_eq!(refused(&[]), "compare/no-law");
    assert_eq!(refused(&["laplacian", "laplacian"]), "compare/law-twice");
    assert_eq!(refused(&["none"]), "scenario/unknown-choice");
}

/// Mission whose first leg is cut off and whose second leg is reached.
const CUT_SHORT: &str = r#"
[start]
positions_m = [[0.0, 0.0], [4.0, 0.1], [8.0, 0.0]]
[formation]
shape = "points"
points_m = [[0.0, 0.0], [3.0, 0.0], [1.5, 2.6]]
[law]
kind = "displacement"
delta_m = 1.0
[time]
duration_s = 30
[[leg]]
shape = "line"
spacing_m = 3
start_s = START_S
"#;

#[test]
fn times_to_reach_exclude_flights_that_did_not_reach() {
    let compared = |start_s: &str| {
        let text = CUT_SHORT.replace("START_S", start_s);
        let base = base(Source::Text { name: "t".to_owned(), text }, &[]);
        let flown = batch(1, &mut |batch| options(&["displacement"], 1).fly(&base, batch));
        flown.expect("no failure").expect("a comparison").laws.remove(0)
    };
    let [cut, whole] = [compared("1"), compared("\"reached\"")];
    assert!(!cut.flights[0].reached && cut.flights[0].reached_at_s.is_some(), "its last leg was");
    assert_eq!((cut.reached_median_s.value, cut.reached_p95_s.value), (None, None));
    assert!(whole.flights[0].reached);
    assert_eq!(whole.reached_median_s.value, whole.flights[0].reached_at_s);
}
