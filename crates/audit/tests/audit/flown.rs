//! Audit of a flight: one test per claim.

use nalgebra::Vector3;
use proptest::prelude::*;
use tautline_audit::{AuditError, AuditOutcome, Auditor, Status, Violation};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, row, separation, set_row};

use crate::fractions::exact;
use crate::scenes::exact_squared;

const DELTA_M: f64 = 2.0;

fn rows(positions: &[[f64; 3]]) -> Rows {
    Rows::from_row_slice(positions.as_flattened())
}

fn judge(delta_m: f64, flight: &[(f64, Rows)]) -> AuditOutcome {
    let mut auditor = Auditor::new(flight[0].1.nrows(), delta_m).unwrap();
    auditor.start(flight[0].0, &flight[0].1).unwrap();
    for (time_s, positions) in &flight[1..] {
        auditor.step(*time_s, positions).unwrap();
    }
    auditor.finish()
}

/// Returns a step in which vehicle 2 flies along x past vehicle 1, which stands at `origin`; `miss_m` is the smallest
/// separation.
fn pass(origin: [f64; 3], miss_m: f64, half_way_m: f64) -> [(f64, Rows); 2] {
    let [x, y, z] = origin;
    let at = |along: f64| rows(&[origin, [x + along, y + miss_m, z]]);
    [(0.0, at(-half_way_m)), (1.0 / 60.0, at(half_way_m))]
}

#[test]
fn a_pass_within_one_step_is_found_by_both_detectors() {
    const SPEED_M_S: f64 = 1000.0;
    const DT_S: f64 = 1.0 / 60.0;
    let outcome = judge(DELTA_M, &pass([0.0; 3], 0.3, SPEED_M_S * DT_S / 2.0));
    assert_eq!(outcome.status, Status::Violation);
    let [violation] = outcome.violations[..] else { panic!("one violation") };
    let half_chord_s = (DELTA_M * DELTA_M - 0.09_f64).sqrt() / SPEED_M_S;
    assert!((violation.from_s - (DT_S / 2.0 - half_chord_s)).abs() < 1e-12);
    assert!((violation.to_s - (DT_S / 2.0 + half_chord_s)).abs() < 1e-12);
    assert!((violation.min_m - 0.3).abs() < 1e-12);
    assert!((violation.min_at_s - DT_S / 2.0).abs() < 1e-12);
    let toi_s = outcome.parry.min_toi_s.expect("parry sees the contact");
    assert!((toi_s - violation.from_s).abs() < 1e-12);
    assert_eq!(outcome.parry.disagreements, 0);
}

/// The samples of the same flight alone are clear.
#[test]
fn samples_alone_miss_a_pass_within_one_step() {
    let flight = pass([0.0; 3], 0.3, 1000.0 / 60.0 / 2.0);
    let sampled = flight.iter().map(|(_, positions)| separation(positions, 0, 1)).fold(f64::INFINITY, f64::min);
    assert!(sampled > DELTA_M, "samples alone call this clear");
}

#[test]
fn a_graze_is_resolved_to_a_nanometre() {
    for half_way_m in [1e-3, 1.0, 10.0, 100.0] {
        for (miss_m, status) in [(DELTA_M - 1e-9, Status::Violation), (DELTA_M + 1e-9, Status::Clear)] {
            let outcome = judge(DELTA_M, &pass([0.0; 3], miss_m, half_way_m));
            assert_eq!((outcome.status, outcome.parry.disagreements), (status, 0), "{miss_m} {half_way_m}");
            assert_eq!(outcome.parry.min_toi_s.is_some(), status == Status::Violation);
        }
    }
}

#[test]
fn a_graze_far_from_the_origin_is_resolved_to_a_micrometre() {
    let far = [3.0e6, -3.0e6, 2.645_751e6];
    for (miss_m, status) in [(DELTA_M - 1e-6, Status::Violation), (DELTA_M + 1e-6, Status::Clear)] {
        let outcome = judge(DELTA_M, &pass(far, miss_m, 8.3));
        assert_eq!((outcome.status, outcome.parry.disagreements), (status, 0));
        assert_eq!(outcome.parry.min_toi_s.is_some(), status == Status::Violation);
    }
}

#[test]
fn touching_at_exactly_delta_is_no_violation() {
    let outcome = judge(DELTA_M, &pass([0.0; 3], DELTA_M, 8.0));
    assert_eq!((outcome.status, outcome.violations.len()), (Status::Clear, 0));
    assert_eq!(outcome.closest.map(|closest| closest.separation_m), Some(DELTA_M));
}

#[test]
fn a_start_below_delta_is_a_violation() {
    let outcome = judge(DELTA_M, &[(3.0, rows(&[[0.0; 3], [1.5, 0.0, 0.0]]))]);
    assert_eq!(outcome.status, Status::Violation);
    let pair = Pair::new(0, 1);
    let expected = Violation { pair, from_s: 3.0, to_s: 3.0, min_m: 1.5, min_at_s: 3.0, limit_m: DELTA_M };
    assert_eq!(outcome.violations, [expected]);
    assert_eq!((outcome.parry.min_toi_s, outcome.steps, outcome.pairs_checked), (Some(3.0), 0, 1));
}

#[test]
fn a_violation_over_several_steps_is_one_interval_with_its_minimum() {
    // 4 m, 0.5 m to the left, 0.5 m to the right, 4 m: below 2 m from x = -2 to 2, at 1 m/s.
    let line = [-4.0, -0.5, 0.5, 4.0];
    let flight: Vec<_> = line.iter().map(|&x| (x + 4.0, rows(&[[0.0; 3], [x, 0.0, 0.0]]))).collect();
    let mut auditor = Auditor::new(2, DELTA_M).unwrap();
    assert!(auditor.start(flight[0].0, &flight[0].1).unwrap().began.is_empty());
    let first = auditor.step(flight[1].0, &flight[1].1).unwrap();
    assert_eq!((first.began.len(), first.ended.len()), (1, 0));
    assert_eq!((first.began[0].from_s, first.began[0].to_s, first.began[0].min_m), (2.0, 3.5, 0.5));
    let second = auditor.step(flight[2].0, &flight[2].1).unwrap();
    assert_eq!((second.began.len(), second.ended.len()), (0, 0));
    let third = auditor.step(flight[3].0, &flight[3].1).unwrap();
    let pair = Pair::new(0, 1);
    let whole = Violation { pair, from_s: 2.0, to_s: 6.0, min_m: 0.0, min_at_s: 4.0, limit_m: DELTA_M };
    assert_eq!((third.began.len(), third.ended), (0, &[whole][..]));
    assert_eq!(auditor.violations(), [whole]);
    assert_eq!(
        auditor.finish().closest,
        Some(ClosestApproach { pair: Pair::new(0, 1), separation_m: 0.0, time_s: 4.0 })
    );
}

#[test]
fn two_separate_approaches_are_two_violations() {
    let flight: Vec<_> =
        (0..=4).map(|k| (f64::from(k), rows(&[[0.0; 3], [if k % 2 == 0 { 5.0 } else { 1.0 }, 0.0, 0.0]]))).collect();
    let outcome = judge(DELTA_M, &flight);
    let spans: Vec<_> = outcome.violations.iter().map(|v| (v.from_s, v.to_s, v.min_at_s)).collect();
    assert_eq!(spans, [(0.75, 1.25, 1.0), (2.75, 3.25, 3.0)]);
}

#[test]
fn equal_separations_report_the_lowest_pair_and_the_earliest_time() {
    let square = rows(&[[0.0; 3], [3.0, 0.0, 0.0], [3.0, 3.0, 0.0], [0.0, 3.0, 0.0]]);
    let flight: Vec<_> = (0..4).map(|k| (f64::from(k), square.clone())).collect();
    let closest = judge(DELTA_M, &flight).closest;
    assert_eq!(closest, Some(ClosestApproach { pair: Pair::new(0, 1), separation_m: 3.0, time_s: 0.0 }));
}

#[test]
fn fewer_than_two_vehicles_are_clear_and_have_no_closest_pair() {
    for n in [0, 1] {
        let outcome = judge(DELTA_M, &[(0.0, Rows::zeros(n)), (1.0, Rows::zeros(n))]);
        assert_eq!((outcome.status, outcome.closest, outcome.steps), (Status::Clear, None, 1));
    }
}

#[test]
fn invalid_input_is_refused_and_the_outcome_is_undecided() {
    let apart = rows(&[[0.0; 3], [5.0, 0.0, 0.0]]);
    let with = |x: f64| rows(&[[0.0; 3], [5.0, x, 0.0]]);
    let refusals: [(f64, Rows, &str); 7] = [
        (2.0, with(f64::NAN), "the position of vehicle 2 at 2 s is not a finite number"),
        (2.0, with(f64::NEG_INFINITY), "the position of vehicle 2 at 2 s is not a finite number"),
        (2.0, with(1e300), "the position of vehicle 2 at 2 s is beyond 1e70 m, too far to judge"),
        (2.0, Rows::zeros(3), "expected the positions of 2 vehicles, found 3"),
        (1.0, apart.clone(), "the time 1 s is not later than the time before, 1 s"),
        (0.5, apart.clone(), "the time 0.5 s is not later than the time before, 1 s"),
        (f64::NAN, apart.clone(), "the time NaN s is not a finite number"),
    ];
    for (time_s, positions, message) in refusals {
        let mut auditor = Auditor::new(2, DELTA_M).unwrap();
        auditor.start(1.0, &apart).unwrap();
        assert_eq!(auditor.step(time_s, &positions).unwrap_err().to_string(), message);
        auditor.step(3.0, &apart).unwrap();
        let outcome = auditor.finish();
        assert_eq!((outcome.status, outcome.refused, outcome.steps), (Status::Undecided, 1, 1), "{message}");
    }
    let mut auditor = Auditor::new(2, DELTA_M).unwrap();
    assert_eq!(auditor.step(0.0, &apart), Err(AuditError::NotStarted));
    auditor.start(0.0, &apart).unwrap();
    assert_eq!(auditor.start(0.0, &apart), Err(AuditError::AlreadyStarted));
    assert_eq!(Auditor::new(2, DELTA_M).unwrap().finish().status, Status::Undecided);
    for delta_m in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
        assert!(matches!(Auditor::new(2, delta_m), Err(AuditError::Delta { .. })), "{delta_m}");
    }
    assert!(matches!(Auditor::new(usize::MAX, DELTA_M), Err(AuditError::TooManyVehicles { .. })));
}

#[test]
fn a_pass_from_far_away_is_judged_exactly() {
    let mut stream = Stream(1);
    let mut counts = [0; 2];
    for case in 0..1000 {
        // Past the origin on a slanted line. The miss comes from rounding: some metres, or kilometres.
        let there = stream.vector(if case % 10 == 0 { 1e20 } else { 2e16 });
        let ends = [there, there * -0.37];
        let flight = ends.map(|at| rows(&[[0.0; 3], [at.x, at.y, at.z]]));
        let outcome = judge(DELTA_M, &[(0.0, flight[0].clone()), (1.0, flight[1].clone())]);
        let [from, to] = ends.map(|at| [exact(at.x), exact(at.y), exact(at.z)]);
        let is_below = exact_squared(&from, &to) < exact(DELTA_M) * exact(DELTA_M);
        let expected = if is_below { Status::Violation } else { Status::Clear };
        assert_eq!((outcome.status, outcome.unresolved), (expected, 0), "{there:?}");
        counts[usize::from(is_below)] += 1;
    }
    assert!(counts.iter().all(|&count| count > 50), "{counts:?}");
}

/// Deterministic random numbers (`SplitMix64`), so that a failing case is reproduced by its seed.
struct Stream(u64);

impl Stream {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self, half_width: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| (2.0 * self.unit() - 1.0) * half_width)
    }
}

#[derive(Clone, Copy, Debug)]
enum Motion {
    Rest,
    RandomWalk {
        step_m: f64,
    },
    Scaling {
        factor: f64,
    },
    Teleports,
    OneFast {
        step_m: f64,
    },
    SamePosition,
    Lattice {
        step_m: f64,
    },
    /// Couples on a line part, while neighbouring couples approach each other until vehicles of two couples are
    /// closest.
    Couples {
        gap_m: f64,
        step_m: f64,
    },
}

fn motions() -> impl Strategy<Value = Motion> {
    prop_oneof![
        Just(Motion::Rest),
        (-3.0..1.5_f64).prop_map(|exponent| Motion::RandomWalk { step_m: 10_f64.powf(exponent) }),
        (0.8..1.3_f64).prop_map(|factor| Motion::Scaling { factor }),
        Just(Motion::Teleports),
        (0.0..40.0_f64).prop_map(|step_m| Motion::OneFast { step_m }),
        Just(Motion::SamePosition),
        (-3.0..0.0_f64).prop_map(|exponent| Motion::Lattice { step_m: 10_f64.powf(exponent) }),
        (3.3..3.6_f64, 0.02..0.06_f64).prop_map(|(gap_m, step_m)| Motion::Couples { gap_m, step_m }),
    ]
}

/// Separation of a couple at the start \[m\].
const COUPLE_M: f64 = 2.2;

fn random_flight(n: usize, steps: usize, motion: Motion, seed: u64) -> Vec<(f64, Rows)> {
    let mut stream = Stream(seed);
    // About one vehicle per ball of 4 m, so that few pairs come below 2 m.
    let half_width = 3.0 * (n as f64).cbrt();
    let mut positions = Rows::zeros(n);
    for i in 0..n {
        let place = match motion {
            Motion::SamePosition => Vector3::new(1.0, 2.0, 3.0),
            Motion::Lattice { .. } => Vector3::new((i % 10) as f64, (i / 10) as f64, 0.0) * 3.0,
            Motion::Couples { gap_m, .. } => {
                Vector3::x() * ((i / 2) as f64 * (COUPLE_M + gap_m) + (i % 2) as f64 * COUPLE_M)
            }
            _ => stream.vector(half_width),
        };
        set_row(&mut positions, i, place);
    }
    let heading = stream.vector(1.0);
    let mut flight = vec![(0.0, positions.clone())];
    for k in 1..=steps {
        for i in 0..n {
            let here = row(&positions, i);
            let next = match motion {
                Motion::RandomWalk { step_m } | Motion::Lattice { step_m } => here + stream.vector(step_m),
                Motion::Scaling { factor } => here * factor,
                Motion::Couples { step_m, .. } => here + Vector3::x() * if i % 2 == 0 { -step_m } else { step_m },
                Motion::Teleports if stream.unit() < 0.1 => stream.vector(4.0 * half_width),
                Motion::OneFast { step_m } if i == n / 2 => here + heading * step_m,
                Motion::OneFast { .. } => here + stream.vector(0.01),
                Motion::Rest | Motion::SamePosition | Motion::Teleports => here,
            };
            set_row(&mut positions, i, next);
        }
        flight.push((k as f64 * 0.1, positions.clone()));
    }
    flight
}

/// Full sweep: each pair is judged by its own auditor, which cannot leave pairs out.
struct FullSweep {
    closest_by_step: Vec<Option<ClosestApproach>>,
    violations: Vec<Violation>,
    min_toi_s: Option<f64>,
}

fn full_sweep(flight: &[(f64, Rows)]) -> FullSweep {
    let n = flight[0].1.nrows();
    let mut full = FullSweep { closest_by_step: vec![None; flight.len()], violations: vec![], min_toi_s: None };
    for i in 0..n {
        for j in i + 1..n {
            let pair = Pair::new(i, j);
            let mut auditor = Auditor::new(2, DELTA_M).unwrap();
            for (k, (time_s, positions)) in flight.iter().enumerate() {
                let two = Rows::from_fn(2, |which, axis| positions[([i, j][which], axis)]);
                let finding = if k == 0 { auditor.start(*time_s, &two) } else { auditor.step(*time_s, &two) }.unwrap();
                let found = finding.closest.map(|closest| ClosestApproach { pair, ..closest });
                let best = &mut full.closest_by_step[k];
                if best.is_none_or(|best| found.is_some_and(|found| found.separation_m < best.separation_m)) {
                    *best = found;
                }
            }
            let outcome = auditor.finish();
            full.violations.extend(outcome.violations.iter().map(|violation| Violation { pair, ..*violation }));
            full.min_toi_s = full.min_toi_s.into_iter().chain(outcome.parry.min_toi_s).reduce(f64::min);
        }
    }
    full.violations.sort_by(|a, b| a.from_s.total_cmp(&b.from_s).then(a.pair.cmp(&b.pair)));
    full
}

/// Returns the smallest separation of a step by golden-section search on the distance, which is convex.
fn searched_separation(from: &Rows, to: &Rows, i: usize, j: usize) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let distance = |s: f64| {
        let at = |i: usize| row(from, i) * (1.0 - s) + row(to, i) * s;
        (at(j) - at(i)).norm()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if distance(a) <= distance(b) { high = b } else { low = a }
    }
    distance(0.0).min(distance(1.0)).min(distance(f64::midpoint(low, high)))
}

#[test]
fn an_approach_of_pairs_outside_the_list_is_found() {
    // After 17 steps couples are 2.88 m apart, and vehicles of two couples 2.78 m, from 3.46 m at the start. The motion
    // is so small that only the growing separation of the closest pair forces a new list.
    let flight = random_flight(64, 17, Motion::Couples { gap_m: 3.46, step_m: 0.02 }, 0);
    let mut auditor = Auditor::new(64, DELTA_M).unwrap();
    auditor.start(flight[0].0, &flight[0].1).unwrap();
    let by_step: Vec<_> =
        flight[1..].iter().map(|(time_s, positions)| auditor.step(*time_s, positions).unwrap().closest).collect();
    assert_eq!(by_step, full_sweep(&flight).closest_by_step[1..]);
    // The first vehicle of a couple has an even index.
    let mixed_pairs = by_step.iter().map(|closest| closest.is_some_and(|closest| closest.pair.first() % 2 == 1));
    assert_eq!(mixed_pairs.collect::<Vec<_>>()[14..], [false, false, true]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn excluding_pairs_does_not_change_the_result(
        n in prop_oneof![2..60_usize, 60..200_usize],
        steps in 1..20_usize,
        motion in motions(),
        seed: u64,
    ) {
        let flight = random_flight(n, steps, motion, seed);
        let full = full_sweep(&flight);
        let mut auditor = Auditor::new(n, DELTA_M).unwrap();
        for (k, (time_s, positions)) in flight.iter().enumerate() {
            let finding = if k == 0 { auditor.start(*time_s, positions) } else { auditor.step(*time_s, positions) };
            prop_assert_eq!(finding.unwrap().closest, full.closest_by_step[k]);
        }
        let outcome = auditor.finish();
        prop_assert_eq!(outcome.parry.disagreements, 0, "{:?}", outcome.parry.first_disagreement);
        prop_assert_eq!(&outcome.violations, &full.violations);
        prop_assert_eq!(outcome.parry.min_toi_s, full.min_toi_s);
        prop_assert_eq!(outcome.status == Status::Clear, full.violations.is_empty());
        let pairs = (n * (n - 1) / 2 * (steps + 1)) as u64;
        prop_assert_eq!(outcome.pairs_checked + outcome.pairs_excluded, pairs);
    }

    #[test]
    fn the_closest_approach_matches_a_numerical_search(
        n in 2..40_usize,
        motion in motions(),
        seed: u64,
    ) {
        // A search on the distance places the minimum only to the square root of rounding. The rounding of coordinates
        // is 1e-13 m here, and near zero the position matters to first order.
        const SEARCH_TOLERANCE_M: f64 = 1e-9;
        let flight = random_flight(n, 3, motion, seed);
        let mut auditor = Auditor::new(n, DELTA_M).unwrap();
        auditor.start(flight[0].0, &flight[0].1).unwrap();
        for two in flight.windows(2) {
            let found = auditor.step(two[1].0, &two[1].1).unwrap().closest.expect("there is a pair");
            let searched = (0..n)
                .flat_map(|i| (i + 1..n).map(move |j| (i, j)))
                .map(|(i, j)| searched_separation(&two[0].1, &two[1].1, i, j))
                .fold(f64::INFINITY, f64::min);
            prop_assert!((found.separation_m - searched).abs() < SEARCH_TOLERANCE_M);
            prop_assert!((two[0].0..=two[1].0).contains(&found.time_s));
        }
    }

    #[test]
    fn no_input_makes_the_auditor_panic_or_hide_an_overlap(
        n in 0..40_usize,
        delta_m in prop_oneof![Just(DELTA_M), any::<f64>()],
        numbers in proptest::collection::vec(
            prop_oneof![any::<f64>(), -10.0..10.0_f64, Just(1e300), Just(-1e300), Just(9e69), Just(0.0)],
            1..200,
        ),
        times in proptest::collection::vec(prop_oneof![any::<f64>(), 0.0..1.0_f64], 1..6),
    ) {
        let Ok(mut auditor) = Auditor::new(n, delta_m) else { return Ok(()) };
        let mut refused = 0;
        let mut overlapped = false;
        for (k, time_s) in times.iter().enumerate() {
            let positions = Rows::from_fn(n, |i, axis| numbers[(7 * k + 3 * i + axis) % numbers.len()]);
            let finding = if k == 0 { auditor.start(*time_s, &positions) } else { auditor.step(*time_s, &positions) };
            match finding {
                Ok(_) => {
                    overlapped |= (1..n).any(|i| separation(&positions, 0, i) < delta_m);
                }
                Err(error) => {
                    refused += 1;
                    prop_assert!(!error.to_string().is_empty());
                }
            }
        }
        let outcome = auditor.finish();
        prop_assert_eq!(outcome.refused, refused);
        prop_assert!(!(outcome.status == Status::Clear && (refused > 0 || overlapped)));
        prop_assert_eq!(outcome.status == Status::Violation, !outcome.violations.is_empty());
        for violation in &outcome.violations {
            prop_assert!(violation.min_m < delta_m);
            prop_assert!(violation.from_s <= violation.min_at_s && violation.min_at_s <= violation.to_s);
        }
    }
}

#[test]
fn a_slow_large_swarm_sweeps_few_pairs() {
    let n = 1000;
    let flight: Vec<_> = (0..20)
        .map(|k| {
            let displacement = 0.01 * f64::from(k);
            let place = |i: usize| {
                let heading = i as f64 * 2.4;
                [
                    (i % 32) as f64 * 5.0 + displacement * heading.cos(),
                    (i / 32) as f64 * 5.0 + displacement * heading.sin(),
                    0.0,
                ]
            };
            (f64::from(k), Rows::from_fn(n, |i, axis| place(i)[axis]))
        })
        .collect();
    let outcome = judge(DELTA_M, &flight);
    assert_eq!(outcome.status, Status::Clear);
    assert!(outcome.pairs_checked * 50 < outcome.pairs_excluded, "{} checked", outcome.pairs_checked);
}
