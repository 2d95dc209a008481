//! Bisection, and margins of flights.

use super::{Bisection, Margin, Options, Range, search};
use crate::Criterion;
use crate::study::{Experiment as _, Study as _};
use crate::tests::{base, batch, pair};

fn range(from: f64, to: f64, scan: usize, halvings: u32) -> Range {
    Range { from, to, scan, halvings, logarithmic: false }
}

fn found(range: Range, answer: &dyn Fn(f64) -> bool) -> (Option<Bisection>, usize) {
    let mut asked = 0;
    let found = search(range, false, &mut |value| {
        asked += 1;
        Ok::<_, ()>(Some(answer(value)))
    });
    (found.expect("no error"), asked)
}

#[test]
fn the_bracket_contains_the_turn_and_each_halving_halves_it() {
    for (from, to) in [(0.0, 4.0), (4.0, 0.0)] {
        let (turn, asked) = found(range(from, to, 5, 10), &|value| value < 1.2345);
        let Some(Bisection::VerdictChange { before, after, was, turns }) = turn else { panic!("{turn:?}") };
        assert_eq!((was, turns, asked), (from < to, 1, 15));
        assert!((before - 1.2345) * (after - 1.2345) <= 0.0, "{before} {after}");
        // Each value is rounded by at most 1 % of its distance to the next.
        assert!(((after - before).abs() * 2.0_f64.powi(10) - 1.0).abs() < 0.1, "{before} {after}");
    }
}

#[test]
fn values_of_a_logarithmic_range_are_spaced_by_their_ratio() {
    let range = Range { logarithmic: true, ..range(1e-6, 1.0, 4, 0) };
    let mut asked = Vec::new();
    let found = search(range, false, &mut |value: f64| {
        asked.push(value);
        Ok::<_, ()>(Some(value < 1e-3))
    });
    for (value, exact) in asked.iter().zip([1e-6, 1e-4, 1e-2, 1.0]) {
        assert!((value / exact - 1.0).abs() < 1e-12, "{value} {exact}");
    }
    assert!(matches!(found, Ok(Some(Bisection::VerdictChange { was: true, .. }))), "{found:?}");
}

#[test]
fn integers_are_probed_at_most_once_and_bracketed_by_neighbours() {
    for (from, to, logarithmic) in [(1.0, 40.0, false), (40.0, 1.0, false), (1.0, 40.0, true), (5.0, 7.0, false)] {
        let mut asked = Vec::new();
        let found = search(Range { logarithmic, ..range(from, to, 9, 60) }, true, &mut |value: f64| {
            asked.push(value);
            Ok::<_, ()>(Some(value < 6.5))
        });
        let Ok(Some(Bisection::VerdictChange { before, after, .. })) = found else { panic!("{found:?}") };
        assert_eq!((before.min(after), before.max(after)), (6.0, 7.0));
        assert!(asked.iter().all(|value| value.fract() == 0.0), "{asked:?}");
        asked.sort_by(f64::total_cmp);
        assert!(asked.windows(2).all(|pair| pair[0] < pair[1]), "{asked:?}");
    }
}

#[test]
fn constant_answers_are_even_and_two_turns_are_counted() {
    assert_eq!(found(range(0.0, 1.0, 5, 8), &|_| true), (Some(Bisection::Even(true)), 5));
    let (twice, _) = found(range(0.0, 1.0, 11, 20), &|value| !(0.33..0.77).contains(&value));
    let Some(Bisection::VerdictChange { before, after, turns: 2, .. }) = twice else { panic!("{twice:?}") };
    assert!(before < 0.33 && after >= 0.33 && after - before < 1e-6, "{before} {after}");
}

#[test]
fn an_interrupted_search_returns_only_known_brackets() {
    let broken = |after: usize| {
        let mut asked = 0;
        search(range(0.0, 1.0, 3, 8), false, &mut |value| {
            asked += 1;
            Ok::<_, ()>((asked <= after).then_some(value < 0.3))
        })
    };
    assert_eq!(broken(0), Ok(None));
    assert_eq!(broken(1), Ok(None), "one value is no bracket");
    let Ok(Some(Bisection::VerdictChange { before, after, .. })) = broken(2) else { panic!("two values are one") };
    assert_eq!((before, after), (0.0, 0.5));
}

#[test]
fn values_have_few_digits() {
    let mut asked = Vec::new();
    let found = search(range(0.0, 0.3, 4, 6), false, &mut |value: f64| {
        asked.push(value);
        Ok::<_, ()>(Some(value < 0.123_456_789))
    });
    assert!(matches!(found, Ok(Some(Bisection::VerdictChange { .. }))), "{found:?}");
    assert_eq!(asked[..4], [0.0, 0.1, 0.2, 0.3]);
    assert!(asked.iter().all(|value| value.to_string().len() <= 8), "{asked:?}");
    for (value, step, short) in [(0.075_000_000_000_000_01, 1e-3, 0.075), (12_345.0, 150.0, 12_300.0), (0.1, 0.0, 0.1)]
    {
        assert_eq!(super::shortened(value, step), short);
    }
}

fn options(key: &str, range: Range, question: Criterion, runs: u64, seed: u64) -> Options {
    Options { key: key.to_owned(), range, question, runs, seed }
}

fn margin_of(options: &Options) -> Margin {
    let base = base(pair(), &[]);
    let [one, two] =
        [1, 2].map(|threads| batch(threads, &mut |batch| options.fly(&base, batch)).expect("flown").expect("found"));
    let timeless = |margin: &Margin| margin.to_json().expect("JSON");
    assert_eq!(timeless(&one), timeless(&two), "the number of threads changes nothing");
    one
}

#[test]
fn a_formation_is_reached_if_the_duration_suffices() {
    let margin = margin_of(&options("time.duration_s", range(1.5, 40.0, 3, 6), Criterion::Reached, 1, 0));
    let turn = margin.turn.expect("it takes time to arrive");
    assert!(!turn.holds_below, "{turn:?}");
    let [holds, fails] = margin.sides().expect("both sides");
    assert!(holds.holds() && !fails.holds() && holds.value > fails.value);
    assert!(margin.headline().contains("reaches its formation with time.duration_s from"), "{}", margin.headline());
    let csv = String::from_utf8(margin.to_csv().expect("csv")).expect("text");
    assert_eq!(csv.lines().count(), margin.probes.len() + 1);
    assert!(csv.starts_with("time.duration_s,runs,held_count"), "{csv}");
}

#[test]
fn an_integer_key_is_halved_at_integers() {
    let margin = |key| margin_of(&options(key, range(1.0, 8.0, 3, 2), Criterion::Clear, 1, 0));
    let any = margin("time.record_hz");
    assert!(any.probes.iter().any(|probe| probe.value.fract() != 0.0), "record_hz takes any number");
    let whole = margin("start.seed");
    let values: Vec<_> = whole.probes.iter().map(|probe| probe.value).collect();
    assert_eq!(values, [1.0, 5.0, 8.0]);
}

#[test]
fn several_runs_have_seeds_and_jitter() {
    let margin = margin_of(&options("law.alpha", range(0.5, 1.0, 2, 1), Criterion::Clear, 3, 7));
    assert!(margin.turn.is_none() && margin.holds_everywhere() && margin.jittered);
    for probe in &margin.probes {
        let seeds: Vec<_> = probe.flights.iter().map(|flown| flown.seed).collect();
        assert_eq!(seeds, [7, 8, 9]);
        assert!(probe.flights.windows(2).all(|pair| pair[0].state_hash != pair[1].state_hash));
        assert_eq!((probe.held.count, probe.held.of), (3, 3));
    }
    assert!(margin.notes().iter().any(|note| note.contains("start.seed moves")), "{:?}", margin.notes());
}

#[test]
fn wrong_ranges_and_refused_values_are_refused() {
    let refused = |key: &str, range: Range| {
        let options = options(key, range, Criterion::Pass, 1, 0);
        let flown = options.check().and_then(|()| batch(1, &mut |batch| options.fly(&base(pair(), &[]), batch)));
        flown.expect_err("refused").to_string()
    };
    assert!(refused("law.alpha", range(1.0, 1.0, 2, 1)).contains("both ends"));
    assert!(refused("law.alpha", range(f64::NAN, 1.0, 2, 1)).contains("NaN"));
    let logarithmic = Range { logarithmic: true, ..range(0.0, 1.0, 2, 1) };
    assert!(
        refused("law.alpha", logarithmic)
            .contains("law.alpha from 0.0 to 1.0: the range is not positive, as log requires")
    );
    assert!(refused("law.alpha", range(-1.0, 1.0, 2, 1)).contains("with law.alpha = -1"));
    assert!(refused("law.alfa", range(0.5, 1.0, 2, 1)).contains("alfa"));
}
