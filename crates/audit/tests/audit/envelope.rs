//! Limits on single vehicles: compared with motions that are known in closed form, between samples too.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::envelope::{Envelope, Fence, Limit, LimitOutcome, Quantity};
use tautline_audit::recorded::{Interpolation, RecordedError, Settings, audit};
use tautline_core::fact::FactKind;
use tautline_core::track::{Item, Piece, Sample};

use super::recorded::seen;

const RADIUS_M: f64 = 5.0;
const RATE_PER_S: f64 = 2.0;
/// Speed \[m/s\] and acceleration \[m/s^2\] on the circle.
const SPEED: f64 = RADIUS_M * RATE_PER_S;
const ACCEL: f64 = SPEED * RATE_PER_S;

fn limits(limits: &[(Quantity, f64)]) -> Envelope {
    let limits = limits.iter().map(|&(quantity, allowed)| Limit { quantity, allowed }).collect();
    Envelope { limits, fence: None }
}

fn with_envelope(envelope: Envelope) -> Settings {
    Settings { envelope, ..Settings::default() }
}

fn sample(time_s: f64, position_m: Vector3<f64>, velocity_m_s: Option<Vector3<f64>>) -> Item {
    Item::Sample(Sample { vehicle: 0, time_s, position_m, velocity_m_s, radius_m: None })
}

/// Returns a circle at a height of 10 m, sampled at `hz` for 10 s.
fn circle(hz: u32, with_velocity: bool) -> Vec<Item> {
    let at = |k: u32| {
        let (sin, cos) = (RATE_PER_S * f64::from(k) / f64::from(hz)).sin_cos();
        let velocity = with_velocity.then(|| Vector3::new(-sin, cos, 0.0) * SPEED);
        sample(f64::from(k) / f64::from(hz), Vector3::new(RADIUS_M * cos, RADIUS_M * sin, 10.0), velocity)
    };
    (0..=10 * hz).map(at).collect()
}

fn judged(items: &[Item], settings: Settings) -> (Status, Vec<LimitOutcome>) {
    let outcome = audit(&["one".to_owned()], items, settings).expect("a verdict");
    assert_eq!(outcome.separation, None, "one vehicle has no separation");
    (outcome.status, outcome.envelope.limits)
}

#[test]
fn the_enclosure_of_the_speed_contains_the_true_speed() {
    for (hz, with_velocity) in [(10, false), (10, true), (50, false), (50, true)] {
        let bounded = Settings {
            motion: Some(Interpolation::Bounded),
            max_accel_m_s2: Some(ACCEL * 1.01),
            ..with_envelope(limits(&[(Quantity::Speed, SPEED), (Quantity::HorizontalSpeed, 2.0 * SPEED)]))
        };
        let (_, found) = judged(&circle(hz, with_velocity), bounded);
        let extreme = found[0].extreme.expect("a speed");
        let allowed = 1e-9;
        assert!(extreme.lower <= SPEED + allowed && SPEED <= extreme.upper + allowed, "{hz} Hz: {extreme:?}");
        assert!(extreme.upper <= SPEED + ACCEL * 1.01 / f64::from(hz), "{extreme:?}");
        assert_eq!(found[1].status, Status::Clear);
    }
}

#[test]
fn a_limit_inside_the_enclosure_is_undecided() {
    let settings = |limit| Settings {
        motion: Some(Interpolation::Bounded),
        max_accel_m_s2: Some(ACCEL * 1.01),
        ..with_envelope(limits(&[(Quantity::Speed, limit)]))
    };
    let items = circle(20, false);
    let status = |limit| judged(&items, settings(limit)).0;
    assert_eq!(
        [0.9, 1.0, 1.2].map(|factor| status(factor * SPEED)),
        [Status::Violation, Status::Undecided, Status::Clear]
    );
}

#[test]
fn accelerations_of_samples_come_from_parabolas() {
    let items = circle(100, false);
    let (status, found) = judged(&items, with_envelope(limits(&[(Quantity::Acceleration, 1.001 * ACCEL)])));
    let extreme = found[0].extreme.expect("an acceleration");
    assert!(status == Status::Clear && found[0].assumes.is_some());
    assert!((extreme.upper / ACCEL - 1.0).abs() < 1e-3, "{extreme:?}");
    let (status, found) = judged(&items, with_envelope(limits(&[(Quantity::Acceleration, 0.99 * ACCEL)])));
    assert_eq!(status, Status::Violation);
    let [violation] = found[0].violations[..] else {
        panic!("expected one violation, got {}", found[0].violations.len())
    };
    assert!(violation.from_s == 0.0 && violation.to_s == 10.0);
}

#[test]
fn recorded_velocities_determine_the_needed_acceleration() {
    let along = |x: f64| Vector3::new(x, 0.0, 10.0);
    let speed = |x: f64| Some(Vector3::new(x, 0.0, 0.0));
    // From 0 to 4 m in 2 s. Another velocity at an end needs a mean acceleration of twice the difference over 2 s.
    for ([start_m_s, end_m_s], needed_m_s2) in
        [([2.0, 2.0], 0.0), ([-3.0, 2.0], 5.0), ([2.0, -5.0], 7.0), ([0.0, 4.0], 2.0)]
    {
        let items = [sample(0.0, along(0.0), speed(start_m_s)), sample(2.0, along(4.0), speed(end_m_s))];
        let (_, found) = judged(&items, with_envelope(limits(&[(Quantity::Acceleration, 1.0)])));
        let extreme = found[0].extreme.expect("an acceleration");
        assert!((extreme.upper - needed_m_s2).abs() < 1e-9, "{start_m_s} {end_m_s}: {extreme:?}");
    }
}

#[test]
fn curves_are_judged_between_their_ends() {
    // x = 4 u (1 - u) over 2 s: at rest nowhere, fastest at both ends with 2 m/s, accelerated by 2 m/s^2; z likewise.
    let arc = |vehicle| Piece {
        vehicle,
        from_s: 0.0,
        to_s: 2.0,
        coefficients: vec![Vector3::zeros(), Vector3::new(2.0, 0.0, 2.0), Vector3::new(-1.0, 0.0, -1.0)],
    };
    let items = [Item::Piece(arc(0))];
    let root = 2.0_f64.sqrt();
    let at = |quantity, allowed| judged(&items, with_envelope(limits(&[(quantity, allowed)])));
    for (quantity, reached) in [
        (Quantity::Speed, 2.0 * root),
        (Quantity::HorizontalSpeed, 2.0),
        (Quantity::Climb, 2.0),
        (Quantity::Descent, 2.0),
        (Quantity::Acceleration, 2.0 * root),
        (Quantity::Height, 1.0),
    ] {
        let (status, found) = at(quantity, reached);
        let extreme = found[0].extreme.expect("a value");
        assert_eq!((status, found[0].assumes.as_ref()), (Status::Clear, None), "{quantity:?} {extreme:?}");
        assert!((extreme.lower - reached).abs() < 1e-9 && (extreme.upper - reached).abs() < 1e-9, "{extreme:?}");
        assert_eq!(at(quantity, reached - 1e-6).0, Status::Violation, "{quantity:?}");
    }
    assert_eq!(at(Quantity::Floor, 0.0).0, Status::Clear);
    assert_eq!(at(Quantity::Floor, 1e-6).0, Status::Violation);
}

#[test]
fn corners_of_curves_are_counted_and_jumps_are_undecided() {
    let piece = |from_s: f64, at: [f64; 3], by: [f64; 3]| {
        Item::Piece(Piece {
            vehicle: 0,
            from_s,
            to_s: from_s + 1.0,
            coefficients: vec![Vector3::from(at), Vector3::from(by)],
        })
    };
    let fast = [(Quantity::Speed, 9.0), (Quantity::Acceleration, 9.0)];
    let of = |items: &[Item]| {
        judged(items, with_envelope(limits(&fast))).1.iter().map(|found| found.status).collect::<Vec<_>>()
    };
    let corner = [piece(0.0, [0.0; 3], [1.0, 0.0, 0.0]), piece(1.0, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])];
    assert_eq!(of(&corner), [Status::Clear, Status::Clear]);
    let found = judged(&corner, with_envelope(limits(&fast))).1[1].corners.expect("a corner");
    assert_eq!((found.count, found.largest.vehicle, found.largest.at_s), (1, 0, 1.0));
    assert!((found.largest.by_m_s - 2.0_f64.sqrt()).abs() < 1e-12);
    let jump = [piece(0.0, [0.0; 3], [1.0, 0.0, 0.0]), piece(1.0, [1.5, 0.0, 0.0], [1.0, 0.0, 0.0])];
    assert_eq!(of(&jump), [Status::Undecided, Status::Undecided]);
    let smooth = [piece(0.0, [0.0; 3], [1.0, 0.0, 0.0]), piece(1.0, [1.000_01, 0.0, 0.0], [1.0, 0.0, 0.0])];
    assert_eq!(of(&smooth), [Status::Clear, Status::Clear]);
    assert_eq!(judged(&smooth, with_envelope(limits(&fast))).1[1].corners, None);
}

#[test]
fn a_fence_is_checked_between_samples() {
    let corners = [[0.0, 0.0], [10.0, 0.0], [10.0, 5.0], [5.0, 5.0], [5.0, 10.0], [0.0, 10.0]];
    let fence = |margin_m| Envelope {
        limits: Vec::new(),
        fence: Some(Fence::new(&corners, Some([0.0, 20.0]), margin_m).expect("a fence")),
    };
    let flight = |to: [f64; 3]| [sample(0.0, Vector3::new(9.0, 4.0, 10.0), None), sample(1.0, Vector3::from(to), None)];
    let (status, found) = judged(&flight([4.0, 9.0, 10.0]), with_envelope(fence(0.0)));
    assert_eq!(status, Status::Violation, "the corner is cut");
    assert!((found[0].extreme.expect("a margin").lower + 1.5).abs() < 1e-12);
    assert_eq!(judged(&flight([1.0, 4.0, 10.0]), with_envelope(fence(1.0))).0, Status::Clear);
    assert_eq!(judged(&flight([1.0, 4.0, 10.0]), with_envelope(fence(1.1))).0, Status::Violation);
    // A parabola through the wall between two ends inside.
    let bow = Piece {
        vehicle: 0,
        from_s: 0.0,
        to_s: 1.0,
        coefficients: vec![Vector3::new(9.0, 2.0, 5.0), Vector3::new(6.0, 0.0, 0.0), Vector3::new(-6.0, 0.0, 0.0)],
    };
    let (status, found) = judged(&[Item::Piece(bow)], with_envelope(fence(0.0)));
    let margin = found[0].extreme.expect("a margin");
    assert!(status == Status::Violation && (margin.lower + 0.5).abs() < 1e-8, "{margin:?}");
    assert!((margin.at_s - 0.5).abs() < 1e-3);
}

#[test]
fn unknown_motion_is_undecided() {
    let slow = || limits(&[(Quantity::Speed, 100.0), (Quantity::Height, 100.0)]);
    let place = Vector3::new(0.0, 0.0, 1.0);
    let gap: Vec<_> = [0.0, 1.0, 2.0, 3.0, 9.0, 10.0].map(|t| sample(t, place, None)).into();
    assert_eq!(judged(&gap, with_envelope(slow())).0, Status::Undecided, "a lone vehicle was not seen for 6 s");
    let once = [sample(0.0, place, None)];
    let (status, found) = judged(&once, with_envelope(slow()));
    assert_eq!((status, found[0].status, found[1].status), (Status::Undecided, Status::Undecided, Status::Clear));
    assert_eq!(found[0].unknown, [0]);
    let hold = Settings { motion: Some(Interpolation::Hold), ..with_envelope(slow()) };
    let refused = audit(&["one".to_owned()], &gap, hold).expect_err("jumps have no speed");
    assert_eq!(refused, RecordedError::LimitOfJumps { limit: "speed" });
    // A contradicted bound is undecided.
    let bounded =
        Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(0.5 * ACCEL), ..with_envelope(slow()) };
    assert_eq!(judged(&circle(20, false), bounded).0, Status::Undecided);
}

#[test]
fn only_the_window_is_judged() {
    // At rest for 1 s, then 5 m/s.
    let place = |t: f64| Vector3::new(5.0 * (t - 1.0).max(0.0), 0.0, 0.0);
    let items: Vec<_> = (0..=30).map(|k| f64::from(k) * 0.1).map(|t| sample(t, place(t), None)).collect();
    let window = |from_s, to_s| Settings {
        from_s: Some(from_s),
        until_s: Some(to_s),
        ..with_envelope(limits(&[(Quantity::Speed, 4.0), (Quantity::Acceleration, 4.0)]))
    };
    let of = |from_s, to_s| judged(&items, window(from_s, to_s)).1.iter().map(|found| found.status).collect::<Vec<_>>();
    assert_eq!(of(0.0, 0.85), [Status::Clear, Status::Clear]);
    // The parabola through the samples at 0.9, 1.0 and 1.1 s.
    assert_eq!(of(0.0, 0.95), [Status::Clear, Status::Violation]);
    assert_eq!(of(0.0, 1.05), [Status::Violation, Status::Violation]);
    assert_eq!(of(1.25, 2.0), [Status::Violation, Status::Clear]);
}

#[test]
fn a_window_inside_an_interval_is_interpolated() {
    let items = [(0.0, 10.0), (4.0, 18.0)].map(|(t, z)| sample(t, Vector3::new(0.0, 0.0, z), None));
    let settings =
        Settings { from_s: Some(1.0), until_s: Some(3.0), ..with_envelope(limits(&[(Quantity::Height, 20.0)])) };
    let extreme = judged(&items, settings).1[0].extreme.expect("a height");
    assert_eq!((extreme.lower, extreme.upper, extreme.at_s), (16.0, 16.0, 3.0));
}

#[test]
fn a_gap_has_no_speed_and_counts_only_in_the_window() {
    // 1 m/s for 2 s, and again from 7 s on, 1 km away.
    let from = |start_s: f64, x: f64| {
        let times = (0..=20).map(move |k| 0.1 * f64::from(k));
        times.map(move |t| sample(start_s + t, Vector3::new(x + t, 0.0, 1.0), None))
    };
    let items: Vec<_> = from(0.0, 0.0).chain(from(7.0, 1000.0)).collect();
    let found = |from_s, to_s| {
        let settings = Settings {
            from_s,
            until_s: to_s,
            ..with_envelope(limits(&[(Quantity::Speed, 2.0), (Quantity::Acceleration, 2.0)]))
        };
        let outcome = audit(&["one".to_owned()], &items, settings).expect("a verdict");
        let fastest = outcome.envelope.limits[0].extreme.expect("a speed");
        assert!((fastest.upper - 1.0).abs() < 1e-6, "{fastest:?}");
        (outcome.status, outcome.gaps.len())
    };
    assert_eq!(found(None, None), (Status::Undecided, 1));
    assert_eq!(found(None, Some(1.9)), (Status::Clear, 0));
    assert_eq!(found(Some(7.1), None), (Status::Clear, 0));
}

#[test]
fn an_acceleration_needed_somewhere_is_undecided_in_a_part() {
    let items: Vec<_> = [(0.0, 0.0), (2.0, 0.0), (4.0, 8.0), (6.0, 16.0)]
        .map(|(t, x)| sample(t, Vector3::new(x, 0.0, 1.0), None))
        .into();
    let settings = |from_s, to_s| Settings {
        motion: Some(Interpolation::Bounded),
        max_accel_m_s2: Some(10.0),
        from_s,
        until_s: to_s,
        ..with_envelope(limits(&[(Quantity::Acceleration, 1.0)]))
    };
    assert_eq!(judged(&items, settings(None, None)).0, Status::Violation);
    assert_eq!(judged(&items, settings(Some(1.9), Some(2.1))).0, Status::Undecided);
}

#[test]
fn an_eased_flight_along_a_wall_keeps_its_margin() {
    // A rise at (4, 4), from rest to rest.
    let rise = |from_s: f64| Piece {
        vehicle: 0,
        from_s,
        to_s: from_s + 10.0,
        coefficients: vec![
            Vector3::new(4.0, 4.0, 0.0),
            Vector3::zeros(),
            Vector3::new(0.0, 0.0, 0.9),
            Vector3::new(0.0, 0.0, -0.06),
        ],
    };
    let corners = [[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]];
    let fence = Fence::new(&corners, None, 1.0).expect("a fence");
    let envelope = Envelope { limits: Vec::new(), fence: Some(fence) };
    let (status, found) = judged(&[Item::Piece(rise(0.0))], with_envelope(envelope));
    let margin = found[0].extreme.expect("a margin");
    assert!(
        status == Status::Clear && (margin.lower - 6.0).abs() < 0.01 && (margin.upper - 6.0).abs() < 1e-9,
        "{margin:?}"
    );
}

#[test]
fn rounding_of_positions_is_no_speed_and_no_corner() {
    // 3 m/s at 5400 km from the origin, sampled at 100 Hz.
    let items: Vec<_> = (0..100)
        .map(|k| f64::from(k) / 100.0)
        .map(|t| sample(t, Vector3::new(5e5, 5.4e6 + 3.0 * t, 0.0), None))
        .collect();
    assert_eq!(judged(&items, with_envelope(limits(&[(Quantity::Speed, 3.0)]))).0, Status::Clear);
    assert_eq!(judged(&items, with_envelope(limits(&[(Quantity::Speed, 2.999_999)]))).0, Status::Violation);
    let piece = |from_s: f64, x: f64, speed: f64| {
        Item::Piece(Piece {
            vehicle: 0,
            from_s,
            to_s: from_s + 1.0,
            coefficients: vec![Vector3::new(x, 0.0, 0.0), Vector3::new(speed, 0.0, 0.0)],
        })
    };
    let corner = |by: f64| {
        let (status, found) = judged(
            &[piece(0.0, 0.0, 1.0), piece(1.0, 1.0, 1.0 + by)],
            with_envelope(limits(&[(Quantity::Acceleration, 9.0)])),
        );
        (status, found[0].corners.map_or(0, |corners| corners.count))
    };
    assert_eq!([5e-4, 1e-2].map(corner), [(Status::Clear, 0), (Status::Clear, 1)]);
}

/// Returns straight lines between corners one second apart, as curves or as samples.
fn zigzag(corners: &[[f64; 2]], hz: Option<u32>) -> Vec<Item> {
    let at = |k: usize| Vector3::new(corners[k][0], corners[k][1], 0.0);
    let legs = 0..corners.len() - 1;
    match hz {
        None => legs
            .map(|k| {
                let (from_s, to_s, coefficients) = (k as f64, (k + 1) as f64, vec![at(k), at(k + 1) - at(k)]);
                Item::Piece(Piece { vehicle: 0, from_s, to_s, coefficients })
            })
            .collect(),
        Some(hz) => legs
            .flat_map(|k| {
                (0..hz).map(move |j| {
                    let along = f64::from(j) / f64::from(hz);
                    sample(k as f64 + along, at(k).lerp(&at(k + 1), along), None)
                })
            })
            .collect(),
    }
}

#[test]
fn mean_accelerations_average_corners_over_the_window() {
    // 3 m/s, then a turn, then a stop.
    let corners = [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [3.0, 3.0], [3.0, 3.0]];
    let turn = 3.0 * 2.0_f64.sqrt();
    for items in [zigzag(&corners, None), zigzag(&corners, Some(20))] {
        let of = |window_s, allowed| {
            let settings = Settings {
                accel_window_s: Some(window_s),
                ..with_envelope(limits(&[(Quantity::Acceleration, allowed)]))
            };
            let (status, found) = judged(&items, settings);
            assert!(
                found[0].assumes.as_ref().is_some_and(|fact| fact.kind == FactKind::MeanAcceleration),
                "{:?}",
                found[0].assumes
            );
            assert_eq!(found[0].corners, None, "corners are compared with the limit");
            (status, found[0].extreme.expect("an acceleration").upper, found[0].violations_tally.count)
        };
        for window_s in [0.2, 0.4] {
            let (status, most, _) = of(window_s, turn / window_s * 1.000_001);
            assert!(status == Status::Clear && (most - turn / window_s).abs() < 1e-6, "{window_s}: {most}");
            let (status, _, count) = of(window_s, turn / window_s * 0.999);
            assert_eq!((status, count), (Status::Violation, 1), "the turn alone");
            assert_eq!(of(window_s, 2.9 / window_s).2, 2, "the turn and the stop");
        }
    }
    let short = Settings { accel_window_s: Some(60.0), ..with_envelope(limits(&[(Quantity::Acceleration, 9.0)])) };
    let (status, found) = judged(&zigzag(&corners, None), short);
    assert_eq!((status, &found[0].unknown[..]), (Status::Undecided, &[0][..]), "no window fits");
}

#[test]
fn an_averaging_window_needs_a_limit_and_no_bound() {
    let items = zigzag(&[[0.0, 0.0], [3.0, 0.0], [3.0, 3.0]], Some(10));
    let window = |envelope, motion, accel_window_s| {
        let max_accel_m_s2 = Some(9.0);
        let settings =
            Settings { accel_window_s: Some(accel_window_s), motion, max_accel_m_s2, ..with_envelope(envelope) };
        audit(&["one".to_owned()], &items, settings).map(|outcome| outcome.status)
    };
    let accel = || limits(&[(Quantity::Acceleration, 100.0)]);
    assert_eq!(window(accel(), None, 0.2), Ok(Status::Clear));
    assert_eq!(window(limits(&[(Quantity::Speed, 9.0)]), None, 0.2), Err(RecordedError::NoAccelWindow));
    assert_eq!(window(accel(), Some(Interpolation::Bounded), 0.2), Err(RecordedError::NoAccelWindow));
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(window(accel(), None, wrong), Err(RecordedError::OutOfRange { .. })), "{wrong}");
    }
}

#[test]
fn a_radius_alone_does_not_limit_a_single_vehicle() {
    let with_radius = |vehicle: usize, radius_m| {
        let place = move |t: f64| Vector3::new(t, 9.0 * if vehicle == 0 { 0.0 } else { 1.0 }, 0.0);
        [0.0, 1.0, 2.0]
            .map(|t| Item::Sample(Sample { vehicle, time_s: t, position_m: place(t), velocity_m_s: None, radius_m }))
    };
    let slow = || with_envelope(limits(&[(Quantity::Speed, 5.0)]));
    assert_eq!(judged(&with_radius(0, Some(0.3)), slow()).0, Status::Clear);
    let both = |radius_m| {
        let mut items = [with_radius(0, Some(0.3)), with_radius(1, radius_m)].concat();
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        audit(&["a", "b"].map(str::to_owned), &items, slow()).expect("a verdict")
    };
    assert_eq!(both(Some(0.3)).separation, Some(Status::Clear));
    assert_eq!((both(None).separation, both(None).status), (None, Status::Clear));
}

#[test]
fn limits_and_separation_have_separate_verdicts() {
    let items: Vec<_> = (0..=20)
        .flat_map(|k| {
            let t = f64::from(k) * 0.1;
            [0, 1].map(|vehicle| {
                let position_m = Vector3::new(3.0 * t, 2.0 * f64::from(vehicle), 0.0);
                let (vehicle, velocity_m_s, radius_m) = (usize::from(vehicle == 1), None, None);
                Item::Sample(Sample { vehicle, time_s: t, position_m, velocity_m_s, radius_m })
            })
        })
        .collect();
    let names = ["a", "b"].map(str::to_owned);
    let of = |delta_m, speed| {
        let settings = Settings { delta_m: Some(delta_m), ..with_envelope(limits(&[(Quantity::Speed, speed)])) };
        let outcome = audit(&names, &items, settings).expect("a verdict");
        (outcome.status, outcome.separation.expect("a separation verdict"), outcome.envelope.limits[0].status)
    };
    assert_eq!(of(1.0, 4.0), (Status::Clear, Status::Clear, Status::Clear));
    assert_eq!(of(1.0, 2.0), (Status::Violation, Status::Clear, Status::Violation));
    assert_eq!(of(3.0, 4.0), (Status::Violation, Status::Violation, Status::Clear));
}

#[test]
fn horizontal_motion_below_the_navigation_floor_is_a_violation() {
    let floor = || limits(&[(Quantity::NavigationFloor, 2.5)]);
    // Straight up to 3 m, then along x; and along x from the start of the climb on.
    let at = |points: &[(f64, [f64; 3])]| points.iter().map(|&(t, p)| seen(0, t, p)).collect::<Vec<_>>();
    let up = at(&[(0.0, [0.0; 3]), (1.0, [0.0, 0.0, 3.0]), (2.0, [5.0, 0.0, 3.0])]);
    let slanted = at(&[(0.0, [0.0; 3]), (1.0, [1.0, 0.0, 3.0]), (2.0, [5.0, 0.0, 3.0])]);
    // Slower than the tolerance.
    let drifting = at(&[(0.0, [0.0; 3]), (1.0, [0.009, 0.0, 0.5]), (2.0, [0.018, 0.0, 0.0])]);
    assert_eq!(judged(&up, with_envelope(floor())).0, Status::Clear);
    let (status, found) = judged(&slanted, with_envelope(floor()));
    assert_eq!((status, found[0].violations[0].lower), (Status::Violation, 0.0));
    let (status, found) = judged(&drifting, with_envelope(floor()));
    assert_eq!((status, found[0].extreme), (Status::Clear, None));
    // Bounded motion may move horizontally anywhere.
    let bounded =
        Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(1.0), ..with_envelope(floor()) };
    assert_eq!(judged(&drifting, bounded).0, Status::Undecided);
}

#[test]
fn the_yaw_rate_is_that_of_setpoints_and_unknown_without_them() {
    let limit = || limits(&[(Quantity::YawRate, 30.0)]);
    let items = [seen(0, 0.0, [0.0; 3]), seen(0, 10.0, [1.0, 0.0, 0.0])];
    let with = |setpoints: Option<&[[f64; 2]]>| {
        let yaw = setpoints.map(|of| ("one".to_owned(), of.to_vec())).into_iter().collect();
        judged(&items, Settings { yaw, ..with_envelope(limit()) }).0
    };
    assert_eq!(with(Some(&[[0.0, 0.0], [3.0, 90.0]])), Status::Clear);
    assert_eq!(with(Some(&[[0.0, 0.0], [3.0, 91.0]])), Status::Violation);
    assert_eq!(with(Some(&[])), Status::Clear);
    assert_eq!(with(None), Status::Undecided);
}
