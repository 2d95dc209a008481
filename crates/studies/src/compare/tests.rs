//! What is left of a comparison that is interrupted.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::{CompareError, Plan, Watch};
use tautline_sim::scenario::{Override, Source, Template};

fn plan(laws: &[&str], runs: u64) -> Result<Plan, CompareError> {
    let short = Override::parse("time.duration_s=1.5").expect("an override");
    let template = Template::read(&Source::Builtin("pentagon".to_owned()), &[short]).expect("a built-in");
    Plan::new(template, laws, runs, 3)
}

/// The comparison that is interrupted once so many steps have been flown.
fn interrupted_after(steps: u64, threads: usize) -> super::Comparison {
    let (interrupted, flown) = (AtomicBool::new(false), AtomicU64::new(0));
    let count = |more: u64| {
        let now = flown.fetch_add(more, Ordering::Relaxed) + more;
        interrupted.store(now >= steps, Ordering::Relaxed);
    };
    let plan = plan(&["edge-tension", "laplacian"], 3).expect("a plan");
    plan.fly(threads, Watch { flown: &count, interrupted: &interrupted }).expect("a comparison")
}

#[test]
fn an_interrupted_comparison_is_about_the_starts_that_were_flown_under_every_law() {
    // 360 steps a flight: the third, of the second start, is under way.
    let found = interrupted_after(360 * 2 + 100, 1);
    assert_eq!((found.runs, found.runs_asked), (1, 3));
    assert!(found.laws.iter().all(|law| law.flights.len() == 1 && law.flights[0].seed == 3));
    assert!(found.laws.iter().all(|law| law.flights[0].steps == 360), "whole flights");
    assert!(found.notes()[0].starts_with("interrupted: of 3 starts, 1 were flown"), "{:?}", found.notes());
    let nothing = interrupted_after(100, 1);
    assert!(nothing.runs == 0 && nothing.laws.iter().all(|law| law.flights.is_empty() && law.clear.share.is_none()));
    // Two threads, each with a law of the second start: the law that is through with it stays with its start.
    let paired = interrupted_after(360 * 3 + 200, 2);
    assert!(paired.laws[0].flights.iter().zip(&paired.laws[1].flights).all(|(one, other)| one.seed == other.seed));
    assert!(paired.laws.iter().all(|law| law.flights.len() as u64 == paired.runs && law.name == law.kind));
    let whole = interrupted_after(u64::MAX, 2);
    assert_eq!((whole.runs, whole.laws[1].flights.len()), (3, 3));
    assert!(!whole.notes().iter().any(|note| note.starts_with("interrupted")));
}

#[test]
fn a_plan_needs_laws_that_it_knows_once_each() {
    assert!(matches!(plan(&[], 1), Err(CompareError::NoLaw)));
    assert!(matches!(plan(&["laplacian", "laplacian"], 1), Err(CompareError::Twice(name)) if name == "laplacian"));
    assert!(matches!(plan(&["none"], 1), Err(CompareError::Law(_))));
    assert_eq!(plan(&["laplacian"], 4).expect("a plan").steps(), 4 * 360);
}

/// A mission whose first leg is cut off, and whose second is reached.
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
fn times_to_reach_are_of_flights_that_reached_alone() {
    let of = |start_s: &str| {
        let text = CUT_SHORT.replace("START_S", start_s);
        let template = Template::read(&Source::Text { name: "t".to_owned(), text }, &[]).expect("a scenario");
        let plan = Plan::new(template, &["displacement"], 1, 0).expect("a plan");
        let never = AtomicBool::new(false);
        plan.fly(1, Watch { flown: &|_| {}, interrupted: &never }).expect("a comparison").laws.remove(0)
    };
    let [cut, whole] = [of("1"), of("\"reached\"")];
    assert!(!cut.flights[0].reached && cut.flights[0].reached_at_s.is_some(), "its last leg was");
    assert_eq!((cut.reached_median_s.value, cut.reached_p95_s.value), (None, None));
    assert!(whole.flights[0].reached);
    assert_eq!(whole.reached_median_s.value, whole.flights[0].reached_at_s);
}
