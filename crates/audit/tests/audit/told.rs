//! What a run says of the time between its samples binds, or it is said that nobody knows.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::recorded::{
    Motion, ObjectPair, Outcome, Settings, Told, ToldViolation, TrackAuditor, VehicleSettings,
};
use tautline_core::swarm::{ClosestApproach, Pair};
use tautline_core::track::Item;

use crate::recorded::{names, pass, seen};

/// The closest that the first two came within the first second; straight lines have them far apart then.
fn told(separation_m: f64, time_s: f64) -> Told {
    let closest = ClosestApproach { pair: Pair::new(0, 1), separation_m, time_s };
    Told { from_s: 0.0, to_s: 1.0, closest, drawn_m: 9.0, others_m: 2.0, height_m: [0.0, 0.0] }
}

/// Two that were 1.5 m apart, and all along below 2 m.
fn near(pair: Pair) -> ToldViolation {
    let (least_m, min_m, min_at_s) = (1.5, 1.5, None);
    ToldViolation { pair, from_s: 0.3, to_s: 0.9, least_m, min_m, min_at_s, limit_m: 2.0, height_m: [0.0, 0.0] }
}

fn judged(items: &[Item], told: Told, settings: Settings) -> Outcome {
    let mut auditor = TrackAuditor::new(settings).expect("settings");
    auditor.tell(told);
    auditor.push(&names(2), items).expect("items");
    auditor.finish().expect("an outcome")
}

fn violated(items: &[Item], told: ToldViolation, settings: Settings) -> Outcome {
    let mut auditor = TrackAuditor::new(settings).expect("settings");
    auditor.tell_violation(told);
    auditor.push(&names(2), items).expect("items");
    auditor.finish().expect("an outcome")
}

/// Clocks of the first two that are set right by so much.
fn clocks(delta_m: f64, [alpha_s, bravo_s]: [f64; 2]) -> Settings {
    let set = |offset_s| VehicleSettings { offset_s, ..VehicleSettings::default() };
    let vehicles = BTreeMap::from([("alpha".to_owned(), set(alpha_s)), ("bravo".to_owned(), set(bravo_s))]);
    Settings { vehicles, ..Settings::delta(delta_m) }
}

#[test]
fn what_a_recording_says_of_the_time_between_its_samples_goes_before_what_is_drawn() {
    // Drawn clear, and too close in between.
    let hit = judged(&pass(3.0), told(0.5, 0.25), Settings::delta(2.0));
    let found = hit.violations[0];
    assert_eq!((hit.status, found.min_m, found.min_at_s), (Status::Violation, 0.5, 0.25));
    assert_eq!(hit.closest[0].upper_m, 0.5);
    // Drawn too close, and nobody was.
    let missed = judged(&pass(1.0), told(2.5, 0.25), Settings::delta(2.0));
    assert_eq!((missed.status, missed.closest[0].lower_m), (Status::Clear, 2.5));
    // Of pairs that were not the closest the recording tells when they were too close, once for what is drawn of it too.
    let third = |y| [seen(2, 0.0, [-5.0, 9.0, 0.0]), seen(2, 1.0, [5.0, y, 0.0])];
    for (only, drawn_y, expected) in [(None, 9.0, 1), (Some([1, 2]), 9.0, 1), (Some([0, 1]), 9.0, 0), (None, -4.0, 1)] {
        let only = only.map(|pair: [usize; 2]| pair.iter().map(|k| names(3)[*k].clone()).collect());
        let mut auditor = TrackAuditor::new(Settings { only, ..Settings::delta(2.0) }).expect("settings");
        auditor.tell_violation(near(Pair::new(1, 2)));
        let mut items = [&pass(3.0)[..], &third(drawn_y)].concat();
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        auditor.push(&names(3), &items).expect("items");
        let outcome = auditor.finish().expect("an outcome");
        let found: Vec<_> =
            outcome.violations.iter().filter(|v| v.pair == ObjectPair::Vehicles(Pair::new(1, 2))).collect();
        assert_eq!(found.len(), expected, "{only:?}: {found:?}", only = outcome.vehicles);
        assert!(found.iter().all(|v| (v.from_s, v.to_s, v.min_m) == (0.3, 0.9, 1.5)), "{found:?}");
        assert_eq!(outcome.status == Status::Violation, expected > 0);
    }
    // Of a part of it, and against other limits, no more is said than is known.
    let cases = [
        (2.0, [0.4, 0.6], Status::Violation, Some([0.4, 0.6])),
        (1.8, [0.4, 0.6], Status::Undecided, None),
        (1.4, [0.4, 0.6], Status::Clear, None),
        (1.8, [0.0, 1.0], Status::Violation, Some([0.9, 0.9])),
        (3.0, [0.0, 1.0], Status::Violation, Some([0.3, 0.9])),
        (2.0, [0.92, 0.95], Status::Clear, None),
    ];
    for (delta_m, [from_s, to_s], expected, span) in cases {
        let window = Settings { from_s: Some(from_s), to_s: Some(to_s), ..Settings::delta(delta_m) };
        let mut auditor = TrackAuditor::new(window).expect("settings");
        auditor.tell_violation(near(Pair::new(0, 1)));
        auditor.push(&names(2), &pass(3.5)).expect("items");
        let outcome = auditor.finish().expect("an outcome");
        assert_eq!(outcome.status, expected, "{delta_m} {from_s} {to_s}: {outcome:?}");
        assert_eq!(outcome.violations.first().map(|v| [v.from_s, v.to_s]), span, "{delta_m} {from_s} {to_s}");
        let closest = outcome.closest[0];
        assert_eq!(closest.lower_m, if to_s < 0.92 || from_s == 0.0 { 1.5 } else { closest.upper_m });
    }
    // What is so at a sample no word takes back.
    let mut sampled = pass(3.0);
    sampled.extend([seen(0, 2.0, [0.0; 3]), seen(1, 2.0, [1.0, 0.0, 0.0])]);
    let words = Told { from_s: 1.0, to_s: 2.0, ..told(2.5, 1.5) };
    assert_eq!(judged(&sampled, words, Settings::delta(2.0)).status, Status::Violation);
    // Of a pair that is not asked about, or after the window, nothing is entered.
    let elsewhere = Settings { to_s: Some(0.2), ..Settings::delta(2.0) };
    assert_eq!(judged(&pass(3.0), told(0.5, 0.25), elsewhere).status, Status::Clear);
}

#[test]
fn what_was_told_moves_with_a_clock_that_both_share_and_is_open_where_clocks_differ() {
    // Set right alike: the same, later.
    let hit = judged(&pass(3.0), told(0.5, 0.25), clocks(2.0, [4.0, 4.0]));
    assert_eq!((hit.status, hit.violations[0].min_at_s, hit.closest[0].time_s), (Status::Violation, 4.25, 4.25));
    let missed = judged(&pass(1.0), told(2.5, 0.25), clocks(2.0, [0.1, 0.1]));
    assert_eq!((missed.status, missed.closest[0].lower_m), (Status::Clear, 2.5));
    let of_part = violated(&pass(3.0), near(Pair::new(0, 1)), Settings { to_s: Some(4.5), ..clocks(2.0, [4.0, 4.0]) });
    assert_eq!(of_part.violations.iter().map(|v| (v.from_s, v.to_s)).collect::<Vec<_>>(), [(4.3, 4.5)]);
    // A sample is a sample by any clock.
    for (k, later_s) in (0..20).flat_map(|k| [0.1, 0.3, 1e9 / 3.0, -1e7 / 7.0].map(|later_s| (k, later_s))) {
        let from_s = 0.1 * f64::from(k);
        let at_once = [seen(0, from_s, [0.0; 3]), seen(1, from_s, [1.0, 0.0, 0.0])];
        let parted = [seen(0, from_s + 1.0, [0.0; 3]), seen(1, from_s + 1.0, [9.0, 0.0, 0.0])];
        let words = Told { from_s, to_s: from_s + 1.0, ..told(2.5, from_s + 0.5) };
        let sampled = judged(&[at_once, parted].concat(), words, clocks(2.0, [later_s; 2]));
        assert_eq!((sampled.status, sampled.closest[0].lower_m), (Status::Violation, 1.0), "{from_s} {later_s}");
    }
    // Set right differently: where straight lines are not what was flown nobody knows, whatever they say.
    for offsets_s in [[0.0, 0.01], [-0.01, 0.0]] {
        let open = judged(&pass(3.0), told(0.5, 0.25), clocks(2.0, offsets_s));
        let found = open.undecided[0];
        assert_eq!((open.status, found.lower_m, found.upper_m), (Status::Undecided, 0.0, f64::INFINITY));
        let open = violated(&pass(3.0), near(Pair::new(0, 1)), clocks(2.0, offsets_s));
        assert_eq!(open.status, Status::Undecided, "{offsets_s:?}");
        // Drawn too close as well: a violation under straight lines, which nothing told of other clocks takes back.
        assert_eq!(judged(&pass(1.0), told(2.5, 0.25), clocks(2.0, offsets_s)).status, Status::Violation);
        // Where they agree the lines stand.
        let same = Told { drawn_m: 0.5, ..told(0.5, 0.25) };
        assert_eq!(judged(&pass(3.0), same, clocks(2.0, offsets_s)).status, Status::Clear);
    }
    // Of others than those who are asked about nothing is open.
    let mut items = [&pass(3.0)[..], &[seen(2, 0.0, [0.0, 9.0, 0.0]), seen(2, 1.0, [0.0, 9.0, 0.0])]].concat();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let only = || Some(["alpha", "charlie"].map(str::to_owned).into());
    let others = |told: Told, settings: Settings| {
        let mut auditor = TrackAuditor::new(Settings { only: only(), ..settings }).expect("settings");
        auditor.tell(told);
        auditor.tell_violation(near(Pair::new(0, 1)));
        auditor.push(&names(3), &items).expect("items");
        auditor.finish().expect("an outcome")
    };
    assert_eq!(others(told(0.5, 0.25), clocks(2.0, [0.0, 0.01])).status, Status::Clear);
    // Unless more is asked of them than is told of all who are not told to be too close.
    let open = others(told(0.5, 0.25), Settings::delta(2.5));
    assert_eq!((open.status, open.undecided.len(), open.undecided[0].lower_m), (Status::Undecided, 1, 2.0));
    assert_eq!(others(Told { drawn_m: 0.5, ..told(0.5, 0.25) }, Settings::delta(2.5)).status, Status::Clear);
    for (at_s, expected) in [(0.0, Status::Clear), (0.5, Status::Undecided), (1.0, Status::Clear)] {
        let instant = Settings { from_s: Some(at_s), to_s: Some(at_s), ..Settings::delta(2.5) };
        assert_eq!(others(told(0.5, 0.25), instant).status, expected, "{at_s}: at a sample it is known");
    }
    assert_eq!(others(told(0.5, 0.25), clocks(2.0, [0.01, 0.0])).status, Status::Undecided);
    let bounded = Settings { motion: Some(Motion::Bounded), max_accel_m_s2: Some(1.0), ..Settings::delta(2.5) };
    assert_eq!(others(told(0.5, 0.25), bounded).status, Status::Clear, "how far anybody was from the lines is bounded");
}

#[test]
fn metres_bind_around_ellipsoids_as_far_as_they_bound_scaled_distances() {
    // Half axes of 0.5 m and 1 m: 2.5 m are 2.5 to 5 of them, and 2 is the limit.
    let axes = |z| Settings { ellipsoid_m: Some(Vector3::new(0.5, 0.5, z)), ..Settings::default() };
    for (separation_m, expected) in [(2.5, Status::Clear), (1.5, Status::Undecided), (0.9, Status::Violation)] {
        let outcome = judged(&pass(3.0), told(separation_m, 0.25), axes(1.0));
        assert_eq!(outcome.status, expected, "{separation_m}: {outcome:?}");
        let closest = outcome.closest[0];
        assert_eq!((closest.lower_m, closest.upper_m), (separation_m, 2.0 * separation_m));
    }
    // Lines that agree with what was told say in which direction the two were.
    let same = Told { drawn_m: 1.5, ..told(1.5, 0.25) };
    let agreed = judged(&pass(3.0), same, axes(1.0));
    assert_eq!((agreed.status, agreed.closest[0].lower_m), (Status::Clear, 6.0));
    // Of a ball everything is known.
    for (separation_m, expected) in [(1.0, Status::Clear), (1.0_f64.next_down(), Status::Violation)] {
        assert_eq!(judged(&pass(3.0), told(separation_m, 0.25), axes(0.5)).status, expected, "{separation_m}");
    }
    // Drawn too close, and nobody was near enough for that in any direction.
    assert_eq!(judged(&pass(0.5), told(2.5, 0.25), axes(1.0)).status, Status::Clear);
    assert_eq!(judged(&pass(0.5), told(0.6, 0.25), axes(1.0)).status, Status::Violation);
    // 1.5 m all along below 2 m: 1.5 to 3 of the half axes.
    for (z, delta, expected) in [
        (1.0, None, Status::Undecided),
        (1.0, Some(1.4), Status::Clear),
        (1.0, Some(3.5), Status::Violation),
        (1.0, Some(4.0), Status::Violation),
        (0.5, Some(3.1), Status::Violation),
        (0.5, Some(2.9), Status::Clear),
    ] {
        let outcome = violated(&pass(3.0), near(Pair::new(0, 1)), Settings { delta_m: delta, ..axes(z) });
        assert_eq!(outcome.status, expected, "{z} {delta:?}: {outcome:?}");
    }
}

#[test]
fn what_was_told_near_the_ground_is_open_unless_it_was_above_or_below_all_along() {
    let above = |above_m| Settings { above_m: Some(above_m), ..Settings::delta(2.0) };
    let at = |height_m| Told { height_m, ..told(0.5, 0.25) };
    let violation_at = |height_m| ToldViolation { height_m, ..near(Pair::new(0, 1)) };
    let mut items = pass(3.0);
    for item in &mut items {
        if let Item::Sample(sample) = item {
            sample.position_m.z = 1.0;
        }
    }
    for (height_m, expected) in
        [([1.0, 1.0], Status::Violation), ([0.2, 1.0], Status::Undecided), ([0.2, 0.5], Status::Clear)]
    {
        assert_eq!(judged(&items, at(height_m), above(0.5)).status, expected, "{height_m:?}");
        assert_eq!(violated(&items, violation_at(height_m), above(0.5)).status, expected, "{height_m:?}");
    }
    let agrees = Told { drawn_m: 0.5, ..at([0.2, 1.0]) };
    assert_eq!(judged(&items, agrees, above(0.5)).status, Status::Clear);
}

#[test]
fn a_violation_without_an_end_has_a_smallest_distance_that_only_bounds_are_known_of() {
    let lasting = ToldViolation { least_m: 0.4, min_m: 1.2, ..near(Pair::new(0, 1)) };
    for (delta_m, expected) in
        [(2.0, Status::Violation), (1.3, Status::Violation), (1.0, Status::Undecided), (0.4, Status::Clear)]
    {
        let outcome = violated(&pass(3.0), lasting, Settings::delta(delta_m));
        assert_eq!(outcome.status, expected, "{delta_m}");
        assert_eq!((outcome.closest[0].lower_m, outcome.closest[0].upper_m), (0.4, 1.2));
    }
    // A word that contradicts itself is none.
    let odd = ToldViolation { least_m: 1.3, min_m: 1.2, ..lasting };
    assert_eq!(violated(&pass(3.0), odd, Settings::delta(2.0)).status, Status::Clear);
    let held = Settings { motion: Some(Motion::Hold), ..Settings::delta(2.0) };
    assert_eq!(violated(&pass(3.0), lasting, held).status, Status::Violation);
}

#[test]
fn the_closest_of_all_says_when_and_how_near_two_were_of_whom_a_violation_is_told() {
    let outcome = |window: [f64; 2], pair: Pair| {
        let [from_s, to_s] = window.map(Some);
        let mut auditor = TrackAuditor::new(Settings { from_s, to_s, ..Settings::delta(2.0) }).expect("settings");
        auditor.tell(told(1.5, 0.5));
        auditor.tell_violation(near(pair));
        let third = [seen(2, 0.0, [0.0, 9.0, 0.0]), seen(2, 1.0, [0.0, 9.0, 0.0])];
        let mut items = [&pass(3.5)[..], &third].concat();
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        auditor.push(&names(3), &items).expect("items");
        auditor.finish().expect("an outcome")
    };
    let (own, other) = (Pair::new(0, 1), Pair::new(1, 2));
    let below_m = 2.0_f64.next_down();
    for (window, [from_s, to_s], [min_m, min_at_s]) in [
        ([0.0, 1.0], [0.3, 0.9], [1.5, 0.5]),
        ([0.4, 0.6], [0.4, 0.6], [1.5, 0.5]),
        ([0.4, 0.5], [0.4, 0.5], [1.5, 0.5]),
        ([0.5, 0.6], [0.5, 0.6], [1.5, 0.5]),
        ([0.625, 0.75], [0.625, 0.75], [below_m, 0.625]),
    ] {
        let found = outcome(window, own).violations;
        let [found] = found[..] else { panic!("{window:?}: {found:?}") };
        assert_eq!((found.from_s, found.to_s, found.min_m, found.min_at_s), (from_s, to_s, min_m, min_at_s));
    }
    // Beside a violation of others it is one of its own.
    let both = outcome([0.0, 1.0], other).violations;
    let spans: Vec<_> = both.iter().map(|v| (v.pair, v.from_s, v.to_s)).collect();
    assert_eq!(spans, [(ObjectPair::Vehicles(other), 0.3, 0.9), (ObjectPair::Vehicles(own), 0.5, 0.5)]);
}

/// Vehicles that stand in a row, so far apart, for a second.
fn in_a_row(count: u32, apart_m: f64) -> (Vec<String>, Vec<Item>) {
    let at = |time_s| (0..count).map(move |k| seen(k as usize, time_s, [apart_m * f64::from(k), 0.0, 0.0]));
    ((1..=count).map(|number| number.to_string()).collect(), at(0.0).chain(at(1.0)).collect())
}

#[test]
fn what_is_open_of_others_is_said_of_ten_pairs_and_by_the_limit_of_each() {
    let open = |count: u32, radii_m: &[f64], told: Told, delta_m: Option<f64>| {
        let radius = |radius_m: &f64| VehicleSettings { radius_m: Some(*radius_m), ..VehicleSettings::default() };
        let vehicles = radii_m.iter().zip(1..).map(|(r, number): (_, u32)| (number.to_string(), radius(r))).collect();
        let only = Some((2..=count).map(|number| number.to_string()).collect());
        let (names, items) = in_a_row(count, 9.0);
        let settings = Settings { delta_m, vehicles, only, ..Settings::default() };
        let mut auditor = TrackAuditor::new(settings).expect("settings");
        auditor.tell(told);
        auditor.push(&names, &items).expect("items");
        let outcome = auditor.finish().expect("an outcome");
        (outcome.undecided.len(), outcome.is_else_known)
    };
    // Of seven vehicles six are asked about, which are fifteen pairs; of four three, which are three.
    assert_eq!([7, 4].map(|count| open(count, &[], told(0.5, 0.5), Some(2.5))), [(10, false), (3, true)]);
    // Off by a thousandth of the limits of the small, and by less of those that a large one is in.
    let off = Told { drawn_m: 0.5 + 3e-3, others_m: 1.0, ..told(0.5, 0.5) };
    assert_eq!(open(4, &[1.0, 1.0, 1.0, 3.0], off, None), (1, true));
}

#[test]
fn beside_a_violation_nothing_is_left_open_of_others() {
    let judged = |last_m: f64| {
        let at =
            |time_s| [0.0, 9.0, 18.0, last_m].into_iter().enumerate().map(move |(k, x)| seen(k, time_s, [x, 0.0, 0.0]));
        let only = Some(["bravo", "charlie", "delta"].map(str::to_owned).into());
        let mut auditor = TrackAuditor::new(Settings { only, ..Settings::delta(2.5) }).expect("settings");
        auditor.tell(told(0.5, 0.5));
        auditor.push(&names(4), &at(0.0).chain(at(1.0)).collect::<Vec<_>>()).expect("items");
        let outcome = auditor.finish().expect("an outcome");
        (outcome.status, outcome.violations.len(), outcome.undecided.len())
    };
    assert_eq!(judged(27.0), (Status::Undecided, 0, 3));
    assert_eq!(judged(19.0), (Status::Violation, 1, 0));
}

#[test]
fn a_told_violation_is_of_its_pair_and_time_and_takes_no_other_away() {
    // Charlie is near alpha all along, and bravo near alpha at the begin by what is drawn.
    let mut items = vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [0.0, 1.0, 0.0]), seen(2, 0.0, [1.0, 0.0, 0.0])];
    items.extend([seen(0, 1.0, [0.0; 3]), seen(1, 1.0, [0.0, 21.0, 0.0]), seen(2, 1.0, [1.0, 0.0, 0.0])]);
    let mut auditor = TrackAuditor::new(Settings::delta(2.0)).expect("settings");
    auditor.tell_violation(near(Pair::new(0, 1)));
    auditor.push(&names(3), &items).expect("items");
    let outcome = auditor.finish().expect("an outcome");
    let of = |first, second| ObjectPair::Vehicles(Pair::new(first, second));
    let found: Vec<_> = outcome.violations.iter().map(|v| (v.pair, v.from_s)).collect();
    assert_eq!(found[..3], [(of(0, 1), 0.0), (of(0, 2), 0.0), (of(1, 2), 0.0)]);
    assert_eq!(found[3..], [(of(0, 1), 0.3)]);
}

#[test]
fn the_closest_of_a_slice_is_within_it() {
    // Two pass each other on one line each, while a third is seen every second.
    let end = |vehicle, time_s, x, y| seen(vehicle, time_s, [x, y, 0.0]);
    let mut items =
        vec![end(0, 0.0, -10.0, 0.0), end(1, 0.0, 10.0, 3.0), end(0, 10.0, 10.0, 0.0), end(1, 10.0, -10.0, 3.0)];
    items.extend((0..=10).map(|k| end(2, f64::from(k), 0.0, 90.0)));
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let settings = Settings { max_gap_s: Some(20.0), ..Settings::delta(2.0) };
    let mut auditor = TrackAuditor::new(settings).expect("settings").with_smallest();
    auditor.push(&names(3), &items).expect("items");
    let slices = auditor.finish().expect("an outcome").smallest;
    assert_eq!(slices.len(), 10);
    for slice in slices {
        let nearest_s = 5.0_f64.clamp(slice.from_s, slice.to_s);
        assert!((slice.closest.time_s - nearest_s).abs() < 1e-9, "{slice:?}");
    }
}

#[test]
fn when_two_were_closest_is_as_told_and_known_in_the_end_where_it_is_not() {
    let known = |min_at_s: Option<f64>, window: [f64; 2]| {
        let [from_s, to_s] = window.map(Some);
        let mut auditor = TrackAuditor::new(Settings { from_s, to_s, ..Settings::delta(2.0) }).expect("settings");
        auditor = auditor.with_smallest();
        auditor.tell_violation(ToldViolation { min_at_s, ..near(Pair::new(0, 1)) });
        auditor.push(&names(2), &pass(3.0)).expect("items");
        let outcome = auditor.finish().expect("an outcome");
        let nearest = outcome.smallest.iter().map(|slice| slice.closest);
        let nearest = nearest.min_by(|a, b| a.lower_m.total_cmp(&b.lower_m)).expect("a slice");
        let [found] = outcome.violations[..] else { panic!("{outcome:?}") };
        (found.min_m, found.min_at_s, nearest.upper_m, nearest.time_s)
    };
    let just_below = 2.0_f64.next_down();
    for (min_at_s, window, expected) in [
        (Some(0.4), [0.0, 1.0], (1.5, 0.4, 1.5, 0.4)),
        (Some(0.4), [0.0, 0.5], (1.5, 0.4, 1.5, 0.4)),
        (Some(0.4), [0.5, 1.0], (just_below, 0.5, just_below, 0.5)),
        (None, [0.0, 1.0], (1.5, 0.9, 1.5, 0.9)),
        (None, [0.0, 0.5], (just_below, 0.3, just_below, 0.3)),
    ] {
        assert_eq!(known(min_at_s, window), expected, "{min_at_s:?} {window:?}");
    }
}
