//! Grids of one key and two, refused points, and wrong input.

use super::{MOST_POINTS, Options, Sweep, SweptKey};
use crate::Criterion;
use crate::batch::Batch;
use crate::study::{Experiment as _, Study as _, StudyPage};
use crate::tests::{InterruptAfter, base, batch, pair};

fn options(keys: &[&str], runs: u64) -> Options {
    let keys = keys.iter().map(|key| SweptKey::parse(key).expect("a key")).collect();
    Options { keys, question: Criterion::Clear, runs, seed: 7 }
}

fn swept(options: &Options) -> Sweep {
    swept_from(&[], options)
}

/// Sweeps the pair with some keys set.
fn swept_from(sets: &[&str], options: &Options) -> Sweep {
    options.check().expect("a grid");
    let base = base(pair(), sets);
    let [one, two] =
        [1, 2].map(|threads| batch(threads, &mut |batch| options.fly(&base, batch)).expect("flown").expect("points"));
    assert_eq!(one.to_json().expect("JSON"), two.to_json().expect("JSON"), "the number of threads changes nothing");
    one
}

#[test]
fn values_are_spaced_or_listed() {
    let values = |text: &str| SweptKey::parse(text).expect(text).values;
    assert_eq!(values("law.alpha=0..1:5"), [0.0, 0.25, 0.5, 0.75, 1.0]);
    assert_eq!(values("law.alpha=1..0:3"), [1.0, 0.5, 0.0]);
    assert_eq!(values("law.alpha=0..0.4:5"), [0.0, 0.1, 0.2, 0.3, 0.4], "few digits");
    assert_eq!(values("law.alpha=1, 2,5"), [1.0, 2.0, 5.0]);
    assert_eq!(values("law.alpha=3"), vec![3.0]);
    for (text, why) in [
        ("law.alpha", "is not KEY=VALUES"),
        ("law.alpha=", "`` is not a number"),
        ("law.alpha=1,x", "`x` is not a number"),
        ("law.alpha=0..1", "is neither KEY=FROM..TO:COUNT nor a list"),
        ("law.alpha=0...1:3", "is neither KEY=FROM..TO:COUNT nor a list"),
        ("law.alpha=0..1:0", "got `0`"),
        ("law.alpha=0..1:2.5", "got `2.5`"),
        ("law.alpha=0..1:999999", "got `999999`"),
        ("law.alpha=1..1:3", "two different finite numbers"),
        ("law.alpha=0..1:1", "the count must be from 2 to 2500, got `1`"),
        ("law.alpha=0..inf:3", "two different finite numbers"),
        ("law.alpha=0,inf", "is not finite"),
        ("law.alpha=nan,1", "NaN is not finite"),
        ("law.alpha=1,2,1", "1 is given twice"),
        ("law.alpha=1e300,2,1e300", "law.alpha: 1e300 is given twice"),
        ("=1,2", "the grid is empty"),
    ] {
        let failure = SweptKey::parse(text).expect_err(text);
        assert!(failure.code() == "sweep/key" && failure.message().contains(why), "{text}: {failure}");
    }
    assert!(SweptKey::new("law.alpha", Vec::new()).is_err());
}

#[test]
fn every_point_has_its_flights_and_a_curve() {
    let sweep = swept(&options(&["law.alpha=0.5,1"], 3));
    assert_eq!(sweep.points.iter().map(|point| point.values[0]).collect::<Vec<_>>(), [0.5, 1.0]);
    for point in &sweep.points {
        assert_eq!(point.flights.iter().map(|flight| flight.seed).collect::<Vec<_>>(), [7, 8, 9]);
        assert_eq!((point.held.count, point.held.of, point.refused), (3, 3, 0));
    }
    assert!(sweep.runs.jitter_m == Some(0.1) && sweep.notes().len() == 1, "{:?}", sweep.notes());
    assert!(sweep.headline().starts_with("pair stays clear in each of 3 runs at 2 of 2 points; the smallest"));
    let csv = String::from_utf8(sweep.to_csv().expect("csv")).expect("text");
    assert!(csv.starts_with("law.alpha,held_count,held_share,held_low,held_high,violated_count,"), "{csv}");
    let html = sweep.to_html(&StudyPage::default());
    for part in
        ["<svg", "Share that stays clear over law.alpha", "Smallest separation over law.alpha", "delta = 2.000 m"]
    {
        assert!(html.contains(part), "{part}");
    }
}

#[test]
fn two_keys_make_a_heat_map_and_refused_points_are_shown_with_their_reason() {
    let sweep = swept(&options(&["start.positions_m.2.x=1,3,5", "law.alpha=0.5,1"], 1));
    let points: Vec<_> = sweep.points.iter().map(|point| (point.values.clone(), point.refused)).collect();
    assert_eq!(
        points[..3],
        [(vec![1.0, 0.5], 1), (vec![1.0, 1.0], 1), (vec![3.0, 0.5], 0)],
        "the last key changes fastest"
    );
    assert!(sweep.points[0].first_refusal.as_ref().is_some_and(|why| why.contains("start")));
    assert!(sweep.points[0].held.share.is_none() && sweep.points[2].flights.len() == 1);
    assert!(sweep.notes()[0].starts_with("2 runs could not be flown and count in no share, the first with"));
    let html = sweep.to_html(&StudyPage::default());
    for part in [
        "Share that stays clear over two keys",
        "Smallest separation [m] over two keys",
        "<th scope=\"col\">Why</th>",
        "Refused points",
    ] {
        assert!(html.contains(part), "{part}");
    }
    let json = serde_json::to_value(&sweep).expect("JSON");
    assert_eq!(json["points"][0]["refused"], 1);
}

#[test]
fn swept_seeds_and_jitters_override_the_defaults() {
    let sweep = swept(&options(&["start.jitter_m=0,0.2"], 2));
    let [still, moved] = &sweep.points[..] else { panic!("two points") };
    assert_eq!(still.flights[0].state_hash, still.flights[1].state_hash, "a jitter of 0 moves nothing");
    assert_ne!(moved.flights[0].state_hash, moved.flights[1].state_hash);
    assert!(sweep.runs.jitter_m.is_none());
    assert!(still.repeated && !moved.repeated);
    assert_eq!((still.held.low, still.held.high, still.held.confidence), (1.0, 1.0, 1.0), "no sample");
    assert!(moved.held.low < 1.0, "two flights of a sample");
    assert_eq!((still.min_median_m.low, still.min_median_m.high), (None, None));
    let notes = sweep.notes().join("; ");
    assert!(notes.contains("the 2 flights with start.jitter_m=0 are one flight repeated"), "{notes}");
    assert!(!notes.contains("start.jitter_m=0.2"), "{notes}");
    let text = sweep.records().text();
    assert!(
        text.contains("2 of 2 [") && text.lines().any(|line| line.starts_with("0 ") && !line.contains('[')),
        "{text}"
    );
    let seeds = swept(&options(&["start.seed=1,2", "start.jitter_m=0.2"], 1));
    assert_ne!(seeds.points[0].flights[0].state_hash, seeds.points[1].flights[0].state_hash);
    // Two runs of one seed are the same flight, which must not count twice.
    let equal = options(&["start.seed=1,2", "start.jitter_m=0.2"], 2);
    let refused = batch(1, &mut |batch| equal.fly(&base(pair(), &[]), batch)).expect_err("equal runs");
    assert_eq!(refused.code(), "request/equal-runs");
}

#[test]
fn flights_without_noise_are_one_flight_at_the_points_without_noise() {
    let noise = ["sensing.rate_hz=60", "sensing.position_noise_m=0.01"];
    let sweep = swept_from(&noise, &options(&["sensing.position_noise_m=0,0.001"], 6));
    let [exact, noisy] = &sweep.points[..] else { panic!("two points") };
    assert!(exact.repeated && !noisy.repeated, "{:?}", sweep.runs.jitter_m);
    assert_eq!((exact.min_median_m.low, noisy.min_median_m.low.is_some()), (None, true), "{noisy:?}");
}

#[test]
fn a_seed_that_changes_no_flight_has_a_note() {
    let notes = |keys: &[&str]| swept(&options(keys, 1)).notes().join("; ");
    assert!(notes(&["start.seed=1,2,3"]).starts_with("start.seed changes no flight"));
    assert!(notes(&["start.seed=1,2", "law.alpha=0.5,1"]).starts_with("start.seed changes no flight"));
    assert_eq!(notes(&["start.seed=1,2", "start.jitter_m=0.2"]), "");
    assert_eq!(notes(&["law.alpha=0.5,1"]), "");
}

#[test]
fn wrong_grids_are_refused() {
    let refused = |options: &Options| {
        let flown = options.check().and_then(|()| batch(1, &mut |batch| options.fly(&base(pair(), &[]), batch)));
        let failure = flown.expect_err("refused");
        (failure.code(), failure.to_string())
    };
    let key = |text: &str| options(&[text], 1);
    assert_eq!(refused(&Options { keys: Vec::new(), ..key("law.alpha=1") }).0, "sweep/grid");
    assert_eq!(refused(&options(&["law.alpha=1", "law.delta_m=1", "time.dt_s=1"], 1)).0, "sweep/grid");
    assert_eq!(refused(&options(&["law.alpha=1,2", "law.alpha=3"], 1)).0, "sweep/grid");
    let axes = ["start.positions_m.2.x=1,2", "start.positions_m.2.1=3"];
    assert_eq!(refused(&options(&axes, 1)).0, "sweep/grid", "the name and the number of one axis");
    assert_eq!(refused(&Options { runs: 0, ..key("law.alpha=1") }).0, "request/out-of-range");
    let (code, said) = refused(&options(&["law.alpha=0..1:51", "law.delta_m=0..1:50"], 1));
    assert!(
        code == "sweep/grid" && said.contains("points, got 2550") && said.contains(&MOST_POINTS.to_string()),
        "{said}"
    );
    assert!(
        refused(&options(&["law.alpha=0..1:50"], 1_000_000))
            .1
            .contains("runs=1000000: 50 points must have at most 10000000 flights, got 50000000")
    );
    let (code, said) = refused(&key("time.max_halvings=0..5:3"));
    assert!(code == "sweep/grid" && said.contains("takes integers only, got 2.5"), "{said}");
    assert_eq!(refused(&key("law.alfa=1,2")).0, "scenario/unknown-key");
    assert_eq!(refused(&key("law.kind=1,2")).0, "scenario/wrong-type");
    let (code, said) = refused(&key("law.alpha=-1,-2"));
    assert!(code == "scenario/out-of-range" && said.contains("with law.alpha=-1"), "{said}");
}

#[test]
fn an_interrupted_sweep_keeps_the_flown_points() {
    let options = options(&["law.alpha=0.5,1,2"], 2);
    let fly = |steps: u64| {
        let monitor = InterruptAfter::new(steps);
        options.fly(&base(pair(), &[]), &Batch::new(Some(1), &monitor).expect("a batch")).expect("no failure")
    };
    assert!(fly(0).is_none());
    let steps = base(pair(), &[]).own().time.steps();
    let sweep = fly(3 * steps).expect("a point");
    assert!(sweep.interrupted && !sweep.is_good() && sweep.points.len() == 1, "{}", sweep.points.len());
    let headline = sweep.headline();
    assert!(headline.starts_with("INTERRUPTED after 1 of 3 points, 2 flights: "), "{headline}");
}
