//! Searches that find violations, searches that find none, refused candidates, and wrong input.

use std::ops::ControlFlow;

use super::{Attack, Bound, Options, SearchSpace};
use crate::base::BaseScenario;
use crate::batch::Batch;
use crate::flight::{Outcome, fly};
use crate::study::{Experiment as _, Study as _, StudyPage};
use crate::tests::{InterruptAfter, base, batch};
use tautline_core::failure::Failure;
use tautline_sim::scenario::Source;

/// Two vehicles that exchange their places, one offset to the side, under a law without avoidance.
const BLIND: &str = r#"name = "blind"
[start]
positions_m = [[0.0, 0.0], [4.0, 3.0]]
[formation]
shape = "points"
points_m = [[4.0, 0.5], [0.0, 0.0]]
[law]
kind = "laplacian"
delta_m = 1.0
[time]
duration_s = 6.0
dt_s = 0.01
record_hz = 10
"#;

fn start_options(flights: u64) -> Options {
    Options { start_m: Some(1.5), flights, ..Options::default() }
}

fn varied(vary: &[&str], flights: u64) -> Options {
    let vary = vary.iter().map(|text| Bound::parse(text).expect("a variation")).collect();
    Options { vary, flights, ..Options::default() }
}

fn blind(sets: &[&str]) -> BaseScenario {
    base(Source::Text { name: "blind".to_owned(), text: BLIND.to_owned() }, sets)
}

fn space(sets: &[&str], options: &Options) -> Result<SearchSpace, Failure> {
    SearchSpace::new(&blind(sets), options)
}

fn searched_on(base: &BaseScenario, options: &Options, threads: usize) -> Attack {
    batch(threads, &mut |batch| options.fly(base, batch)).expect("flown").expect("not interrupted")
}

fn searched(sets: &[&str], options: &Options) -> Attack {
    searched_on(&blind(sets), options, 2)
}

fn worst_m(attack: &Attack) -> f64 {
    attack.worst().and_then(|worst| worst.flown.min_m).expect("a separation")
}

#[test]
fn a_search_finds_a_collision_and_its_overrides_repeat_it() {
    let (base, options) = (blind(&[]), start_options(60));
    let [attack, other] = [1, 3].map(|threads| searched_on(&base, &options, threads));
    assert_eq!(
        attack.to_json().expect("JSON"),
        other.to_json().expect("JSON"),
        "the number of threads changes nothing"
    );
    assert_eq!(attack.flights, 60);
    assert_eq!(attack.own.outcome, Outcome::Clear);
    let worst = attack.worst().expect("a worst");
    assert_eq!(worst.flown.outcome, Outcome::Violated);
    assert!(attack.violated > 0 && worst_m(&attack) < 1.0, "{}", attack.headline());
    assert!(attack.headline().starts_with("VIOLATION found: "), "{}", attack.headline());
    for (bound, &value) in attack.bounds.iter().zip(&worst.values) {
        assert!((bound.low..=bound.high).contains(&value) && bound.high - bound.low == 3.0, "{bound:?} {value}");
    }
    assert_eq!(attack.bounds.len(), 4, "a plane has no z: {:?}", attack.bounds);
    let falls = attack.progress.windows(2).all(|pair| pair[1].flown.min_m < pair[0].flown.min_m);
    assert!(falls && attack.progress.windows(2).all(|pair| pair[0].flight < pair[1].flight));

    let again = base.with(&attack.sets).expect("the worst");
    assert_eq!(again.resolved().sha256, worst.flown.scenario_sha256);
    let flight = fly(&again, 0, &mut |_| ControlFlow::Continue(())).expect("flown").expect("whole");
    assert_eq!((flight.state_hash.as_str(), flight.min_m), (worst.flown.state_hash.as_str(), worst.flown.min_m));
}

#[test]
fn a_search_without_a_violation_states_that_it_is_no_proof() {
    let sets = ["law.kind=displacement"];
    let attack = searched(&sets, &start_options(40));
    assert_eq!((attack.violated, attack.certificates_broken), (0, 0));
    let said = attack.headline();
    assert!(said.starts_with("no violation found in 40 flights: smallest separation 1."), "{said}");
    assert!(said.contains("a search, not a proof"), "{said}");
    assert!(
        attack.certified == 40 && attack.notes().iter().any(|note| note.contains("certificate")),
        "{:?}",
        attack.notes()
    );
    let html = attack.to_html(&StudyPage { commands: vec!["tautline attack".to_owned()], ..StudyPage::default() });
    for part in ["a search, not a proof", "<svg", "tautline attack", "start.positions_m.2.y"] {
        assert!(html.contains(part), "{part}");
    }
    let csv = String::from_utf8(attack.to_csv().expect("csv")).expect("text");
    assert_eq!(csv.lines().count(), attack.progress.len() + 1);
}

#[test]
fn a_broken_certificate_comes_first_in_the_headline() {
    let attack = searched(&["law.kind=displacement"], &start_options(4));
    let says_so = |attack: &Attack| {
        let noted = attack.notes().iter().any(|note| note.starts_with("defect: in 1 flight two vehicles came closer"));
        (attack.headline().starts_with("CERTIFICATE BROKEN, "), noted, attack.is_bad())
    };
    assert_eq!(says_so(&attack), (false, false, false));
    assert_eq!(says_so(&Attack { certificates_broken: 1, ..attack }), (true, true, true));
}

#[test]
fn refused_candidates_cost_no_flight_and_are_never_the_worst() {
    // The second vehicle may start anywhere around the first, also within delta.
    let near = ["start.positions_m.2.x=-1.2..1.2", "start.positions_m.2.y=-1.2..1.2"];
    let attack = searched(&["law.kind=displacement"], &varied(&near, 30));
    assert!(attack.refused > 0 && attack.flights == 30, "{attack:?}");
    assert!(attack.first_refusal.as_ref().is_some_and(|why| why.contains("start")), "{:?}", attack.first_refusal);
    assert!(worst_m(&attack) >= 1.0, "{}", attack.headline());
    assert!(attack.notes().iter().any(|note| note.contains("could not be flown and cost no flight")));

    let within = ["start.positions_m.2.x=-0.6..0.6", "start.positions_m.2.y=-0.6..0.6"];
    let nowhere = searched(&[], &varied(&within, 30));
    assert!(nowhere.exhausted && nowhere.flights == 0 && nowhere.worst().is_none(), "{nowhere:?}");
    assert!(nowhere.headline().starts_with("no flight was flown"), "{}", nowhere.headline());
    assert!(nowhere.notes().iter().any(|note| note.starts_with("hardly any candidate")), "{:?}", nowhere.notes());
}

#[test]
fn starts_keep_the_separation_of_apart() {
    let sets = ["law.kind=displacement"];
    let nearest = |options: &Options| {
        let attack = searched(&sets, options);
        let apart_m = |values: &[f64]| libm::hypot(values[2] - values[0], values[3] - values[1]);
        let nearest_m = attack.progress.iter().map(|worst| apart_m(&worst.values)).fold(f64::INFINITY, f64::min);
        (nearest_m, attack)
    };
    let wide = Options { start_m: Some(2.4), ..start_options(60) };
    let (_, anywhere) = nearest(&wide);
    let (near_m, attack) = nearest(&Options { apart_m: Some(4.0), ..wide.clone() });
    assert!(near_m >= 4.0 && attack.refused > anywhere.refused, "{near_m}");
    let why = attack.first_refusal.expect("a reason");
    assert!(why.contains("less than apart=4 m"), "{why}");
    for apart_m in [1.0, 5.1, f64::NAN] {
        let refused =
            space(&sets, &Options { apart_m: Some(apart_m), ..wide.clone() }).expect_err("refused").to_string();
        assert!(refused.contains(&format!("apart={apart_m}: must be more than delta (1 m)")), "{refused}");
        assert!(refused.contains("at most 5.000 m, the smallest separation of the scenario's start"), "{refused}");
    }
}

#[test]
fn integer_keys_get_integer_values() {
    let whole = varied(&["time.max_halvings=0..4", "law.f1_per_s2=0.5..2"], 1);
    let space = space(&[], &whole).expect("a space");
    assert_eq!(space.bounds().iter().map(|bound| bound.whole).collect::<Vec<_>>(), [true, false]);
    assert_eq!(space.sets(&space.values(&[0.5, 0.5]), 0), ["time.max_halvings=2", "law.f1_per_s2=1.25"]);
}

#[test]
fn a_key_whose_fractions_are_only_out_of_range_is_not_an_integer_key() {
    let scale = space(&["law.delta_m=3.5"], &varied(&["formation.scale=0..2"], 1)).expect("a space");
    assert_eq!(scale.bounds().iter().map(|bound| bound.whole).collect::<Vec<_>>(), [false]);
    // Refused from 21 on; below, the key takes integers only.
    let halvings = space(&[], &varied(&["time.max_halvings=0..100"], 1)).expect("a space");
    assert_eq!(halvings.bounds().iter().map(|bound| bound.whole).collect::<Vec<_>>(), [true]);
}

#[test]
fn each_seed_is_a_flight_and_the_worst_seed_counts() {
    let radio = ["network={rate_hz=20, loss=0.3}", "noise.seed=5"];
    let seeds = Options { seeds: 3, ..varied(&["network.loss=0.1..0.6"], 20) };
    let attack = searched(&radio, &seeds);
    assert_eq!(attack.flights, 18, "six candidates with three flights each");
    let worst = attack.worst().expect("a worst");
    assert_eq!(worst.flown.seed, 5 + worst.run);
    assert!(attack.sets.contains(&format!("noise.seed={}", worst.flown.seed)), "{:?}", attack.sets);
}

#[test]
fn an_interrupted_search_has_a_note_or_no_answer() {
    let fly = |most: u64| {
        let monitor = InterruptAfter::new(most);
        let batch = Batch::new(Some(1), &monitor).expect("a batch");
        start_options(60).fly(&blind(&[]), &batch).expect("no failure")
    };
    assert!(fly(0).is_none());
    let attack = fly(20 * 600).expect("flights");
    assert!(attack.interrupted && attack.flights > 0 && attack.flights < 60, "{}", attack.flights);
    assert!(attack.notes().iter().any(|note| note.starts_with("interrupted")));
}

#[test]
fn wrong_options_are_refused() {
    let refused = |options: Options| space(&[], &options).expect_err("refused").to_string();
    let start = || start_options(10);
    assert!(refused(varied(&[], 10)).contains("nothing is varied"));
    assert!(refused(Options { start_m: Some(0.0), ..start() }).contains("start=0: must be a finite number above 0"));
    assert!(refused(Options { velocity_m_s: Some(f64::NAN), ..start() }).contains("velocity"));
    assert!(refused(Options { flights: 0, ..start() }).contains("flights=0: must be at least 1, the number of seeds"));
    assert!(refused(Options { seeds: 11, ..start() }).contains("flights=10: must be at least 11, the number of seeds"));
    assert!(refused(Options { seeds: 2, ..start() }).contains("nothing in the flight is random"));
    assert!(refused(varied(&["law.f1=0..1"], 10)).contains("f1"));
    assert!(refused(varied(&["law.kind=0..1"], 10)).contains("law.kind = 0"));
    assert!(refused(varied(&["name=0..1"], 10)).contains("name = 0"));
    assert!(refused(varied(&["noise.seed=0..9"], 10)).contains("is a seed"));
    assert!(refused(varied(&["law.f1_per_s2=1..2", "law.f1_per_s2=1..3"], 10)).contains("varied twice"));
    let x = ["start.positions_m.1.x=0..1", "start.positions_m.1.1=0..1"];
    assert!(refused(varied(&x, 10)).contains("varied twice"));
    let both = Options { start_m: Some(1.0), ..varied(&["start.positions_m.1.x=0..1"], 10) };
    assert!(refused(both).contains("vary=start.positions_m.1.x: the key is varied twice"));
}

#[test]
fn whether_a_key_takes_integers_does_not_depend_on_its_bounds() {
    let bound = |key: &str| {
        let base = base(Source::Builtin("crazyflies".to_owned()), &[]);
        SearchSpace::new(&base, &varied(&[key], 2)).map(|space| space.bounds()[0].whole)
    };
    assert!(!bound("sensing.latency_s=0..1").expect("a plan"));
    assert!(bound("time.max_halvings=0..4").expect("a plan"));
    let refused = bound("time.max_halvings=0..2.5").expect_err("no whole number").to_string();
    assert!(refused.contains("time.max_halvings = 2.5") && refused.contains("whole number"), "{refused}");
}
