//! Large numbers of findings: all are counted, the worst and the first of each pair are listed, and memory is bounded.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use tautline_audit::envelope::{Envelope, Fence, Limit, Quantity};
use tautline_audit::recorded::{Interpolation, Outcome, RecordedError, Settings, TrackAuditor, audit};
use tautline_audit::{LISTED, MovingObstacle, Status};
use tautline_core::obstacle::Shape;
use tautline_core::track::{Item, Piece, Sample};

use crate::recorded::{obstacle_at, seen};

fn numbered(count: usize) -> Vec<String> {
    (1..=count).map(|k| k.to_string()).collect()
}

/// Returns vehicles that fly through one point between two samples, on lines of different directions.
fn through_one_point(count: usize) -> Vec<Item> {
    let at = |vehicle: usize, along: f64| {
        let angle = std::f64::consts::PI * vehicle as f64 / count as f64;
        [50.0 * along * angle.cos(), 50.0 * along * angle.sin(), 0.0]
    };
    let instants = [(0.0, -1.0), (0.75, -1.0 / 3.0), (1.5, 1.0 / 3.0), (2.25, 1.0)];
    instants.iter().flat_map(|&(time_s, along)| (0..count).map(move |k| seen(k, time_s, at(k, along)))).collect()
}

/// Returns vehicles that jitter in a box, so that every pair is often too close. The result is deterministic.
fn noise(count: usize, instants: u32, of: impl Fn(usize) -> bool) -> Vec<Item> {
    let mut state = 7_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    let mut items = Vec::new();
    for k in 0..instants {
        for vehicle in 0..count {
            let at = [4.0 * next(), 4.0 * next(), 0.0];
            if of(vehicle) {
                items.push(seen(vehicle, f64::from(k) * 0.1, at));
            }
        }
    }
    items
}

fn judge(count: usize, items: &[Item], settings: Settings) -> Outcome {
    // Pushed in parts, as a file is read.
    let mut auditor = TrackAuditor::new(settings).expect("settings");
    for part in items.chunks(1024.max(count)) {
        auditor.push(&numbered(count), part).expect("items");
    }
    auditor.finish().expect("an outcome")
}

#[test]
fn all_pairs_through_one_point_are_counted_and_few_are_listed() {
    let count = 200;
    let pairs = count * (count - 1) / 2;
    let outcome = judge(count, &through_one_point(count), Settings::delta(1.0));
    let tally = outcome.tallies.violations;
    assert_eq!((outcome.status, tally.count, tally.is_exact), (Status::Violation, pairs as u64, true));
    assert_eq!(tally.listed, outcome.violations.len());
    assert!((LISTED..=2 * LISTED).contains(&tally.listed), "{tally:?}");
    assert!(outcome.violations.windows(2).all(|two| two[0].from_s <= two[1].from_s));
}

#[test]
fn a_few_findings_are_all_listed() {
    let outcome = judge(40, &through_one_point(40), Settings::delta(1.0));
    assert_eq!((outcome.tallies.violations.count, outcome.violations.len()), (780, 780));
    assert!(!outcome.tallies.are_shortened());
}

#[test]
fn the_count_and_the_list_match_those_of_single_pairs() {
    let (count, instants) = (14, 1500);
    let settings = || Settings::delta(1.5);
    let whole = judge(count, &noise(count, instants, |_| true), settings());
    // Findings of each pair alone, with the indices of the whole swarm.
    let mut pair_findings: BTreeMap<(usize, usize), Vec<_>> = BTreeMap::new();
    for first in 0..count {
        for second in first + 1..count {
            let items = noise(count, instants, |vehicle| vehicle == first || vehicle == second);
            let items: Vec<_> = items
                .into_iter()
                .map(|item| {
                    let Item::Sample(sample) = item else { panic!("samples") };
                    Item::Sample(Sample { vehicle: usize::from(sample.vehicle == second), ..sample })
                })
                .collect();
            let found = audit(&numbered(2), &items, settings()).expect("an outcome");
            assert!(!found.tallies.are_shortened(), "a single pair is listed completely");
            pair_findings
                .insert((first, second), found.violations.iter().map(|v| (v.min_m, v.from_s, v.to_s)).collect());
        }
    }
    let all: usize = pair_findings.values().map(Vec::len).sum();
    assert!(all > 20_000, "too few to settle findings early: {all}");
    assert_eq!(whole.tallies.violations.count, all as u64);
    // The list holds the worst of all, and the first of each pair.
    let mut depths: Vec<f64> = pair_findings.values().flatten().map(|(min_m, ..)| *min_m).collect();
    depths.sort_by(f64::total_cmp);
    let listed = |min_m: f64| whole.violations.iter().any(|v| v.min_m == min_m);
    assert!(depths[..LISTED].iter().all(|min_m| listed(*min_m)));
    let pair_of = |v: &tautline_audit::Violation<_>| {
        let pair: tautline_audit::ObjectPair = v.pair;
        pair.vehicles().map(|pair| (pair.first(), pair.second())).expect("vehicles")
    };
    for (pair, found) in &pair_findings {
        let first = whole.violations.iter().find(|v| pair_of(v) == *pair).expect("the first of each pair");
        assert_eq!((first.min_m, first.from_s, first.to_s), found[0], "{pair:?}");
    }
    // The size of the parts does not change the result.
    let at_once = audit(&numbered(count), &noise(count, instants, |_| true), settings()).expect("an outcome");
    assert_eq!((at_once.violations, at_once.tallies), (whole.violations, whole.tallies));
}

#[test]
fn undecided_times_are_bounded_and_share_one_deciding_rate() {
    let count = 200;
    let settings = |max_accel_m_s2| Settings {
        motion: Some(Interpolation::Bounded),
        max_accel_m_s2: Some(max_accel_m_s2),
        ..Settings::delta(1e-3)
    };
    let outcome = judge(count, &through_one_point(count), settings(1.0));
    let tally = outcome.tallies.undecided;
    assert_eq!((outcome.status, tally.count), (Status::Undecided, (count * (count - 1) / 2) as u64));
    assert!(tally.listed == outcome.undecided.len() && tally.listed <= 2 * LISTED, "{tally:?}");
    let of_listed = outcome.undecided.iter().filter_map(|of| of.rate_hz).fold(0.0, f64::max);
    assert!(outcome.deciding_rate_hz.is_none_or(|hz| hz >= of_listed));
}

#[test]
fn times_beyond_a_limit_are_counted_and_the_worst_and_first_are_listed() {
    // A saw of 5000 teeth of one vehicle, with a second on the ground between two; the last is the highest. Another
    // vehicle exceeds the limit once.
    let teeth = 5000_u32;
    let saw = (0..=3 * teeth).map(|k| {
        let z = if k % 3 == 1 { 10.0 + f64::from(k) * 1e-3 } else { 0.0 };
        seen(0, f64::from(k), [0.0, 0.0, z])
    });
    let other = (0..=3 * teeth).map(|k| seen(1, f64::from(k), [50.0, 0.0, if k == 9999 { 5.1 } else { 0.0 }]));
    let mut items: Vec<_> = saw.chain(other).collect();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let limits = vec![Limit { quantity: Quantity::Height, allowed: 5.0 }];
    let settings = Settings { envelope: Envelope { limits, fence: None }, ..Settings::default() };
    let found = &judge(2, &items, settings).envelope.limits[0];
    assert_eq!((found.status, found.violations_tally.count), (Status::Violation, u64::from(teeth) + 1));
    assert!(found.violations.len() <= 2 * LISTED && found.violations_tally.listed == found.violations.len());
    assert!(found.violations.iter().any(|of| of.vehicle == 1), "the first of the other vehicle");
    assert!((found.extreme.expect("a height").lower - (10.0 + f64::from(3 * teeth - 2) * 1e-3)).abs() < 1e-9);
    assert_eq!(found.violations[0].from_s, 0.0);
}

/// Returns the time that an audit takes to stop after its flag is set.
fn time_to_stop(names: &[String], items: &[Item], settings: Settings) -> Duration {
    let flag = Arc::new(AtomicBool::new(false));
    let mut auditor = TrackAuditor::new(settings).expect("settings").with_interruption(Arc::clone(&flag));
    let set = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(200));
        flag.store(true, Ordering::Relaxed);
        Instant::now()
    });
    let ended = auditor.push(names, items).and_then(|()| auditor.finish().map(drop));
    let now = Instant::now();
    let set = set.join().expect("a time");
    assert_eq!(ended, Err(RecordedError::Interrupted), "the audit ended before the flag was set");
    now.duration_since(set)
}

#[test]
fn an_interruption_stops_any_sweep_soon() {
    // Whole sweeps take minutes; the flag is checked many times a second.
    let max_delay = Duration::from_secs(10);
    let of_pairs = time_to_stop(&numbered(2500), &through_one_point(2500), Settings::delta(1.0));
    assert!(of_pairs < max_delay, "pairs: {of_pairs:?}");
    // Curves of a high degree with nearly equal distances.
    let curve = |vehicle: usize, k: u32| {
        let coefficients =
            (0..40).map(|d| Vector3::repeat(if (d + vehicle).is_multiple_of(2) { 1e-3 } else { -1e-3 })).collect();
        let (from_s, to_s) = (f64::from(k), f64::from(k + 1));
        Item::Piece(Piece { vehicle, from_s, to_s, coefficients })
    };
    let curves: Vec<_> = (0..40).flat_map(|k| (0..60).map(move |vehicle| curve(vehicle, k))).collect();
    let of_curves = time_to_stop(&numbered(60), &curves, Settings::delta(1e-3));
    assert!(of_curves < max_delay, "curves: {of_curves:?}");
    // Two vehicles with many intervals.
    let two: Vec<_> = (0..400_000_u32).flat_map(|k| [0, 1].map(|v| seen(v, f64::from(k) * 1e-3, [0.0; 3]))).collect();
    let of_two = time_to_stop(&numbered(2), &two, Settings { above_m: Some(-1.0), ..Settings::delta(1.0) });
    assert!(of_two < max_delay, "one pair: {of_two:?}");
    // A fence with many corners, which a flight crosses repeatedly.
    let comb = (0..2000).map(|k| [f64::from(k), if k % 2 == 0 { 0.0 } else { 1.0 }]);
    let corners: Vec<_> = comb.chain([[1999.0, 9.0], [0.0, 9.0]]).collect();
    let fence = Some(Fence::new(&corners, None, 0.0).expect("a fence"));
    let along: Vec<_> =
        (0..2000).map(|k| seen(0, f64::from(k), [if k % 2 == 0 { -1.0 } else { 2001.0 }, 0.5, 0.0])).collect();
    let settings = Settings { envelope: Envelope { limits: Vec::new(), fence }, ..Settings::default() };
    let of_fence = time_to_stop(&numbered(1), &along, settings);
    assert!(of_fence < max_delay, "a fence: {of_fence:?}");
}

#[test]
fn undecided_times_of_obstacles_are_counted_apart() {
    // Vehicles far from each other, whose bounded motion may take them below the clearance above the ground.
    let count = 2600;
    let at = |k: usize, t_s: f64| seen(k, t_s, [50.0 * k as f64, 0.0, 1.001]);
    let items: Vec<_> = [0.0, 1.0].iter().flat_map(|&t_s| (0..count).map(move |k| at(k, t_s))).collect();
    let ground = obstacle_at(Shape::HalfSpace { normal: Vector3::z() }, [0.0; 3]);
    let settings = Settings {
        motion: Some(Interpolation::Bounded),
        max_accel_m_s2: Some(1.0),
        obstacles: vec![MovingObstacle { clearance_m: Some(1.0), ..ground }],
        ..Settings::delta(1.0)
    };
    let outcome = judge(count, &items, settings);
    let tally = outcome.tallies.undecided;
    assert!(outcome.status == Status::Undecided && tally.listed < count, "{tally:?}");
    assert_eq!((tally.count, outcome.undecided_of_obstacles), (count as u64, count as u64));
}
