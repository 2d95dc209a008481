//! Segments of kilometres that are nearly parallel, at starts that are accepted with almost no room. All vehicles brake
//! from the start on, and the separation is judged along the whole brake.

use nalgebra::Vector3;

use super::Random;
use super::world::least_separation;
use crate::plane::{Plane, Segment};
use crate::unicycle::{Loiter, Pose, Steering, UnicycleShield};
use crate::{Fleet, Limits, Settings, Shield, State};

const DELTA_M: f64 = 1.0;
/// Unicycle that slows down over 28.8 km.
const FAST_LOITER: Loiter = Loiter {
    delta_m: DELTA_M,
    period_s: 0.1,
    min_speed_m_s: 5.0,
    max_speed_m_s: 240.0,
    accel_m_s2: 1.0,
    turn_rad_s: 2.0,
    tracking_error_m: 0.0,
    is_left: true,
};
/// Room that rounding of long segments may cost a start \[m\].
const LOST_M: f64 = 2e-5;

/// Two vehicles side by side or above each other, whose paths come together at a small angle.
#[derive(Clone, Copy, Debug)]
struct Pair {
    angle_rad: f64,
    /// Distance beyond delta at the place where the paths are closest \[m\].
    room_m: f64,
    /// Paths above each other that cross in the middle, or level ones that come together.
    is_crossing: bool,
    heading_rad: f64,
    origin_m: Vector3<f64>,
    length_m: f64,
}

impl Pair {
    fn random(random: &mut Random, length_m: f64) -> Self {
        let origin_m = Vector3::new(random.between(-1e3, 1e3), random.between(-1e3, 1e3), random.between(0.0, 100.0));
        Self {
            angle_rad: 10.0_f64.powf(random.between(-12.0, -6.0)),
            room_m: 10.0_f64.powf(random.between(-7.0, -3.0)),
            is_crossing: random.chance(0.5),
            heading_rad: if random.chance(0.3) { 0.0 } else { random.between(-3.0, 3.0) },
            origin_m,
            length_m,
        }
    }

    /// Returns places and headings at the start.
    fn places(&self) -> [(Vector3<f64>, f64); 2] {
        let (sin, cos) = self.heading_rad.sin_cos();
        let (ahead, left) = (Vector3::new(cos, sin, 0.0), Vector3::new(-sin, cos, 0.0));
        let apart_m = DELTA_M + self.room_m;
        let beside = if self.is_crossing {
            // The second path crosses from the left to the right, above the first one.
            left * (self.angle_rad * self.length_m / 2.0) + Vector3::z() * apart_m
        } else {
            left * (apart_m + self.angle_rad * self.length_m)
        };
        let second = self.origin_m + beside + ahead * (if self.is_crossing { 0.0 } else { 0.3 });
        [(self.origin_m, self.heading_rad), (second, self.heading_rad - self.angle_rad)]
    }
}

/// Points at 300 m/s, which brake over 15 km.
fn limits() -> Limits {
    let settings = Settings { max_speed_m_s: 300.0, ..Settings::new(DELTA_M, 0.05) };
    settings.limits().expect("within the budget for rounding")
}

fn states(pair: &Pair, speed_m_s: f64) -> [State; 2] {
    pair.places().map(|(position_m, heading_rad)| {
        let (sin, cos) = heading_rad.sin_cos();
        State { position_m, velocity_m_s: Vector3::new(cos, sin, 0.0) * speed_m_s }
    })
}

/// Brakes to rest under a law that is undefined. Returns the least separation.
fn brake(shields: &mut [Shield]) -> f64 {
    let mut closest = f64::INFINITY;
    let invalid = Vector3::x() * f64::NAN;
    while shields.iter().any(|shield| shield.next_reference().velocity_m_s.norm() > 1e-9) {
        for shield in shields.iter_mut() {
            shield.filter(shield.next_reference(), invalid);
        }
        let [one, other] = [&shields[0], &shields[1]];
        let apart = one.reference().position_m - other.reference().position_m;
        let closing = one.reference().velocity_m_s - other.reference().velocity_m_s;
        let bend = one.reference_acceleration_m_s2() - other.reference_acceleration_m_s2();
        closest = closest.min(least_separation(&apart, &closing, &bend, 0.05).0);
    }
    closest
}

#[test]
fn points_that_brake_over_kilometres_at_small_angles_keep_the_safety_distance() {
    let mut random = Random::new(81);
    let limits = limits();
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..300 {
        let pair = Pair::random(&mut random, 15_000.0);
        let states = states(&pair, 299.999);
        let starts = states.map(|state| limits.start(state).expect("slow enough"));
        let shields = [0, 1].map(|i| Shield::new(&limits, i, &starts));
        let fleet = Fleet::new(&[limits; 2], &states);
        assert_eq!(shields[0].is_ok(), shields[1].is_ok(), "{pair:?}");
        assert_eq!(fleet.is_ok(), shields[0].is_ok(), "{pair:?}");
        let Ok(mut fleet) = fleet else {
            assert!(pair.room_m < LOST_M, "{pair:?}: {fleet:?}");
            refused += 1;
            continue;
        };
        accepted += 1;
        let closest = brake(fleet.shields_mut());
        assert!(closest >= DELTA_M, "{pair:?}: {closest}");
        assert_eq!(fleet.report().exceeded(), None);
    }
    assert!(accepted > 100 && refused > 30, "{accepted} {refused}");
}

#[test]
fn the_starts_that_flew_too_near_are_refused_and_ones_with_room_are_not() {
    for (speed_m_s, apart_m) in [(50.0, 1.000_002), (300.0, 1.000_002)] {
        let limits = Settings { max_speed_m_s: speed_m_s, ..Settings::new(DELTA_M, 0.05) }.limits().expect("valid");
        let states = |apart_m: f64| {
            let angle: f64 = 0.99e-7;
            let ahead = [Vector3::x(), Vector3::new(angle.cos(), -angle.sin(), 0.0)];
            [0, 1].map(|i| State {
                position_m: Vector3::y() * (i as f64 * apart_m),
                velocity_m_s: ahead[i] * (speed_m_s * (1.0 - 1e-12)),
            })
        };
        // The closest points alone give a plane that does not contain the segments.
        let [own, other] = states(apart_m).map(|state| limits.start(state).expect("valid").segment);
        let (from, to) = own.closest_points(&other);
        let normal = (to - from).normalize();
        let plane = Plane { normal, offset_m: normal.dot(&from) };
        assert!(!plane.contains(&own) || normal.dot(&other.stop()) < normal.dot(&to));

        let error = Fleet::new(&[limits; 2], &states(apart_m)).expect_err("too near").to_string();
        assert!(error.starts_with("start: vehicles 1 and 2 reserve segments nearer than the 1.000001 m"), "{error}");
        let mut fleet = Fleet::new(&[limits; 2], &states(1.001 + 0.99e-7 * 15_000.0)).expect("far enough");
        let closest = brake(fleet.shields_mut());
        assert!(closest > DELTA_M && closest < 1.003, "{closest}");
    }
}

#[test]
fn unicycles_that_slow_down_over_kilometres_at_small_angles_keep_the_safety_distance() {
    let mut random = Random::new(82);
    let loiter = FAST_LOITER;
    // Both loiter beside each other with the discs 2 r + delta apart.
    let length_m = (240.0_f64 * 240.0 - 25.0) / 2.0;
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..60 {
        let pair = Pair { is_crossing: false, ..Pair::random(&mut random, length_m) };
        let [first, second] = pair.places();
        let (sin, cos) = pair.heading_rad.sin_cos();
        let aside = Vector3::new(-sin, cos, 0.0) * (2.0 * loiter.radius_m());
        let poses = [first, (second.0 + aside, second.1)].map(|(position_m, heading_rad)| Pose {
            position_m,
            heading_rad,
            speed_m_s: 239.999,
        });
        let starts = poses.map(|pose| loiter.start(&pose).expect("valid"));
        let shields = [0, 1].map(|i| UnicycleShield::new(&loiter, i, &poses[i], &starts));
        assert_eq!(shields[0].is_ok(), shields[1].is_ok(), "{pair:?}");
        let [Ok(mut one), Ok(mut other)] = shields else {
            assert!(pair.room_m < LOST_M, "{pair:?}");
            refused += 1;
            continue;
        };
        accepted += 1;
        let mut closest = f64::INFINITY;
        for _ in 0..2_500 {
            let invalid = Steering { accel_m_s2: f64::NAN, turn_rad_s: 0.0 };
            let commands = [one.filter(invalid), other.filter(invalid)];
            let references = [one.reference(), other.reference()];
            for k in 0..4 {
                let after = |i: usize| references[i].after(commands[i], 0.025 * f64::from(k)).position_m;
                closest = closest.min((after(0) - after(1)).norm());
            }
        }
        assert!(closest >= DELTA_M, "{pair:?}: {closest}");
    }
    assert!(accepted > 20 && refused > 5, "{accepted} {refused}");
}

#[test]
fn a_unicycle_loiters_at_its_rest_point_for_ever() {
    let mut random = Random::new(83);
    for _ in 0..20 {
        let loiter = Loiter {
            delta_m: DELTA_M,
            period_s: 0.5,
            min_speed_m_s: 20.0,
            max_speed_m_s: 60.0,
            accel_m_s2: random.between(1.0, 4.0),
            turn_rad_s: random.between(0.01, 0.2),
            tracking_error_m: 0.0,
            is_left: random.chance(0.5),
        };
        // A speed that whole periods reach up to rounding.
        let speed_m_s = 20.0 + loiter.accel_m_s2 * 0.5 * random.index(30) as f64 * (1.0 + 0.9e-9 * random.unit());
        let position_m = Vector3::new(random.between(-9e5, 9e5), random.between(-9e5, 9e5), 0.0);
        let pose = Pose { position_m, heading_rad: random.between(-3.0, 3.0), speed_m_s: speed_m_s.clamp(20.0, 60.0) };
        let start = loiter.start(&pose).expect("valid");
        let mut shield = UnicycleShield::new(&loiter, 0, &pose, &[start]).expect("alone");
        let centre_m = start.segment.stop();
        for period in 0..20_000 {
            shield.loiter();
            assert_eq!(shield.segment().stop(), centre_m);
            if period > 40 {
                let from_m = (shield.next_reference().position_m - centre_m).norm();
                assert!((from_m - loiter.radius_m()).abs() < 1e-9, "{loiter:?}: {from_m}");
            }
        }
    }
}

#[test]
fn starts_of_unicycles_are_limited_like_those_of_points() {
    let loiter = FAST_LOITER;
    let pose_at = |x: f64| Pose { position_m: Vector3::x() * x, heading_rad: 0.0, speed_m_s: 240.0 };
    assert!(loiter.start(&pose_at(900_000.0)).is_ok());
    // The place, and the end of 28.8 km.
    for x in [1e6 + 1.0, 980_000.0] {
        let error = loiter.start(&pose_at(x)).expect_err("far").to_string();
        assert!(error.contains("farther than 1000000 m") && error.ends_with("its origin near the vehicles"), "{error}");
    }
    let refused = |loiter: Loiter| loiter.start(&pose_at(0.0)).expect_err("refused").to_string();
    assert!(
        refused(Loiter { period_s: 0.5, ..loiter })
            .starts_with("max_speed_m_s: must move by at most 100 m in a period")
    );
    assert!(refused(Loiter { delta_m: 3e6, ..loiter }).starts_with("delta_m: margins must be at most 1000000 m"));
}

#[test]
fn the_gap_of_a_normal_is_at_most_the_distance_and_near_it() {
    let mut random = Random::new(84);
    for _ in 0..3_000 {
        let pair = Pair::random(&mut random, 15_000.0);
        let segments = states(&pair, 1.0)
            .map(|state| Segment::new(state.position_m, state.position_m + state.velocity_m_s * 15_000.0));
        let gap = segments[0].gap(&segments[1]).expect("apart");
        let [one, other] =
            segments.map(|segment| [segment.position(), segment.stop()].map(|point| gap.normal.dot(&point)));
        let verified = other[0].min(other[1]) - one[0].max(one[1]);
        assert!((verified - gap.width_m).abs() < 1e-8, "{pair:?}: {verified} {gap:?}");
        assert!((gap.normal.norm() - 1.0).abs() < 1e-12);
        let lost = DELTA_M + pair.room_m - gap.width_m;
        assert!((-1e-6..LOST_M).contains(&lost), "{pair:?}: {lost}");
    }
}
