//! The time until which a pair is clear holds for every motion within the bounds.

use nalgebra::Vector3;
use proptest::prelude::*;

use crate::{clear_for_s, monitor, rest, settings};
use tautline_watch::pair::{Prediction, RelativeMotion};
use tautline_watch::{Bound, Pose, Settings, State};

/// Motion with an acceleration that is constant on pieces of equal length.
#[derive(Clone, Debug)]
struct Motion {
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    accel_m_s2: Vec<Vector3<f64>>,
    piece_s: f64,
}

impl Motion {
    fn at(&self, t_s: f64) -> Vector3<f64> {
        let (mut position, mut velocity, mut left_s) = (self.position_m, self.velocity_m_s, t_s);
        for accel in &self.accel_m_s2 {
            let h_s = left_s.min(self.piece_s);
            position += velocity * h_s + accel * (h_s * h_s / 2.0);
            velocity += accel * h_s;
            left_s -= h_s;
        }
        position + velocity * left_s
    }
}

fn ball(radius: f64) -> impl Strategy<Value = Vector3<f64>> {
    // Many samples have full length: the bounds are reached there.
    let direction =
        [-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64].prop_filter("a direction", |of| Vector3::from(*of).norm() > 0.1);
    (direction, prop_oneof![Just(1.0), 0.0..1.0_f64])
        .prop_map(move |(of, length)| Vector3::from(of).normalize() * (radius * length))
}

const ACCEL: f64 = 4.0;
const POSITION_ERROR_M: f64 = 0.05;
const VELOCITY_ERROR: f64 = 0.2;
const DELTA_M: f64 = 0.7;
const PIECES: usize = 8;

fn motion(start: f64) -> impl Strategy<Value = Motion> {
    let accel = prop::collection::vec(ball(ACCEL), PIECES);
    (ball(3.0), ball(5.0), accel, 0.05..0.5_f64).prop_map(move |(offset, velocity_m_s, accel_m_s2, piece_s)| Motion {
        position_m: Vector3::x() * start + offset,
        velocity_m_s,
        accel_m_s2,
        piece_s,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// The separation of random motions within the bounds is at least delta before the time.
    #[test]
    fn no_motion_within_the_bounds_is_closer_before_the_time(
        a in motion(0.0), b in motion(5.0), ages_s in [0.0..0.6_f64, 0.0..0.6_f64],
        errors in [ball(POSITION_ERROR_M), ball(POSITION_ERROR_M)],
        speed_errors in [ball(VELOCITY_ERROR), ball(VELOCITY_ERROR)],
    ) {
        // Motion `k` has its time 0 at its stamp, `ages_s[k]` before the present.
        let of = [&a, &b];
        let seen = [0, 1].map(|k| Prediction::new(
            of[k].position_m + errors[k], of[k].velocity_m_s + speed_errors[k], ages_s[k], POSITION_ERROR_M,
            VELOCITY_ERROR, ACCEL,
        ));
        let relative = RelativeMotion::new(&seen[0], &seen[1]);
        if let Some(clear_s) = relative.clear_for_s(DELTA_M, 3.0) {
            for step in 0..=200 {
                let t_s = clear_s * f64::from(step) / 200.0;
                let apart_m = (a.at(ages_s[0] + t_s) - b.at(ages_s[1] + t_s)).norm();
                prop_assert!(apart_m >= DELTA_M, "{apart_m} m after {t_s} s of {clear_s} s");
            }
        }
    }
}

/// Two vehicles at rest accelerate towards each other from their stamps on, with the worst errors.
fn worst_case(age_s: f64) -> [Motion; 2] {
    [(0.0, 1.0), (6.0, -1.0)].map(|(x, towards)| Motion {
        position_m: Vector3::new(x + towards * POSITION_ERROR_M, 0.0, 0.0),
        velocity_m_s: Vector3::x() * (towards * VELOCITY_ERROR),
        accel_m_s2: vec![Vector3::x() * (towards * ACCEL)],
        piece_s: age_s + 10.0,
    })
}

#[test]
fn the_worst_case_reaches_delta_exactly_at_the_time() {
    let age_s = 0.4;
    let of = worst_case(age_s);
    let clear = |counted_s: f64| {
        let seen = [0.0, 6.0].map(|x| {
            let at = Vector3::new(x, 0.0, 0.0);
            Prediction::new(at, Vector3::zeros(), counted_s, POSITION_ERROR_M, VELOCITY_ERROR, ACCEL)
        });
        RelativeMotion::new(&seen[0], &seen[1]).clear_for_s(DELTA_M, 10.0).expect("clear now")
    };
    let apart_m = |t_s: f64| (of[0].at(age_s + t_s) - of[1].at(age_s + t_s)).norm();
    let until_s = clear(age_s);
    assert!((apart_m(until_s) - DELTA_M).abs() < 1e-6, "{}", apart_m(until_s));
    // Negative twin: without the age the same motion violates before the time.
    let nearest_m = (0..100).map(|k| apart_m(clear(0.0) * f64::from(k) / 100.0)).fold(f64::INFINITY, f64::min);
    assert!(nearest_m < 0.9 * DELTA_M, "{nearest_m}");
}

#[test]
fn the_monitor_counts_the_delay_of_each_message() {
    let clear = |delay_s: f64| {
        let mut monitor = monitor(settings());
        // The first message sets the offset of the clock.
        rest(&mut monitor, "a", 0.0, 0.0, 100.0);
        rest(&mut monitor, "b", 0.0, 6.0, 100.0);
        rest(&mut monitor, "a", 1.0, 0.0, 101.0);
        rest(&mut monitor, "b", 1.0, 6.0, 101.0 + delay_s);
        let of = monitor.assess(101.0 + delay_s);
        assert_eq!(of.state, State::Clear);
        clear_for_s(&of).expect("clear")
    };
    let exact = |age_s: f64| {
        let at =
            |x: f64| Prediction::new(Vector3::x() * x, Vector3::zeros(), age_s, 0.01, 0.02 * 1.01, 5.0 * 1.01 * 1.01);
        RelativeMotion::new(&at(0.0), &at(6.0)).clear_for_s(1.0, 10.0).expect("clear")
    };
    for age_s in [0.0, 0.3] {
        assert!((clear(age_s) - exact(age_s)).abs() < 1e-3, "{} {}", clear(age_s), exact(age_s));
    }
}

#[test]
fn clear_holds_with_stamps_that_are_too_fast_by_less_than_their_limit() {
    // A simulator that runs faster than its arrivals: in time of the stamps each vehicle has 10 m/s.
    let (rate, speed, gap_m, delta_m, accel) = (1.0099, 10.0, 200.0, 1.0, 1e-3);
    let apart_m = |arrival_s: f64| gap_m - 2.0 * speed * rate * arrival_s;
    let exact = Settings {
        accel_m_s2: Bound::declared(accel),
        position_error_m: Some(Bound::declared(0.0)),
        velocity_error_m_s: Bound::declared(0.0),
        ..settings()
    };
    let mut monitor = monitor(exact);
    let (mut judged, mut broken) = (0, 0);
    for k in 0..180 {
        let arrival_s = f64::from(k) / 20.0;
        for (id, from_m, towards) in [("a", 0.0, 1.0), ("b", gap_m, -1.0)] {
            let velocity = Vector3::x() * (towards * speed);
            let position_m = Vector3::x() * from_m + velocity * (rate * arrival_s);
            let pose = Pose { t_s: rate * arrival_s, id, position_m, velocity_m_s: Some(velocity), accuracy_m: None };
            monitor.take(&pose, arrival_s);
        }
        // The age of both is 0.03 s.
        let of = monitor.assess(arrival_s + 0.03);
        let Some(clear_s) = clear_for_s(&of) else { continue };
        judged += 1;
        assert!(apart_m(arrival_s + 0.03 + clear_s) >= delta_m, "{arrival_s} {clear_s}");
        // Negative twin: without the rate the bounds prove too much.
        let seen = [1.0, -1.0].map(|towards| {
            let velocity = Vector3::x() * (towards * speed);
            let at = Vector3::x() * (-towards * apart_m(arrival_s) / 2.0);
            Prediction::new(at, velocity, 0.03, 0.0, 0.0, accel)
        });
        let without_s = RelativeMotion::new(&seen[0], &seen[1]).clear_for_s(delta_m, 10.0).expect("clear");
        broken += u32::from(apart_m(arrival_s + 0.03 + without_s) < delta_m);
    }
    assert_eq!(monitor.faults(tautline_watch::Fault::ClockStep), 0);
    assert!(judged > 150 && broken > 100, "{judged} {broken}");
}

#[test]
fn the_latency_of_the_settings_is_part_of_every_age() {
    let clear = |latency_s: f64| {
        let mut monitor = monitor(Settings { latency_s: Bound::declared(latency_s), ..settings() });
        rest(&mut monitor, "a", 0.0, 0.0, 0.0);
        rest(&mut monitor, "b", 0.0, 6.0, 0.0);
        clear_for_s(&monitor.assess(0.0)).expect("clear")
    };
    assert!(clear(0.2) < clear(0.0) - 0.19);
}

#[test]
fn the_search_of_all_pairs_equals_the_pairs_one_by_one() {
    let mut rng = 1_u64;
    let mut random = || {
        rng = rng.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (rng >> 11) as f64 / (1_u64 << 53) as f64
    };
    for _ in 0..50 {
        let mut monitor = monitor(settings());
        let mut all = Vec::new();
        for k in 0..40 {
            let position_m = Vector3::new(random() * 60.0, random() * 30.0, random() * 20.0);
            let velocity = Vector3::new(random() - 0.5, random() - 0.5, random() - 0.5) * 4.0;
            let id = format!("v{k}");
            monitor.take(&Pose { t_s: 0.0, id: &id, position_m, velocity_m_s: Some(velocity), accuracy_m: None }, 0.0);
            // Stamps may be too fast by 1 %.
            let error_m_s = 0.02 * 1.01 + velocity.norm() * 0.01;
            all.push(Prediction::new(position_m, velocity, 0.0, 0.01, error_m_s, 5.0 * 1.01 * 1.01));
        }
        let of = monitor.assess(0.0);
        let (mut nearest_m, mut clear_s, mut nominal_s, mut brake_s) = (f64::INFINITY, 10.0_f64, None, None);
        let least = |best: Option<f64>, time: Option<f64>| match (best, time) {
            (Some(a), Some(b)) => Some(f64::min(a, b)),
            (a, b) => a.or(b),
        };
        for (k, a) in all.iter().enumerate() {
            for b in &all[..k] {
                let pair = RelativeMotion::new(a, b);
                nearest_m = nearest_m.min(pair.nominal_m());
                clear_s = clear_s.min(pair.clear_for_s(1.0, 10.0).unwrap_or(0.0));
                nominal_s = least(nominal_s, pair.nominal_violation_s(1.0, 10.0));
                brake_s = least(brake_s, pair.last_brake_s(1.0, 3.0, 10.0));
            }
        }
        assert!((of.closest.expect("a pair").nominal_m - nearest_m).abs() < 1e-12);
        assert_eq!(of.nominal_violation.map(|of| of.at_s), nominal_s);
        assert_eq!(of.last_brake.map(|of| of.at_s), brake_s);
        match of.state {
            State::Clear => assert!((clear_for_s(&of).expect("clear") - clear_s).abs() < 1e-6),
            State::Violation(..) => assert!(nearest_m < 1.0),
            State::Undecided(_) => assert_eq!(clear_s, 0.0),
        }
    }
}
