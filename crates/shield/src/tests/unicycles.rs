//! Flights of shielded unicycles and points on exact plants, and their negative twin.

use nalgebra::Vector3;

use super::Random;
use super::flights::long;
use crate::fleet::closest_starts;
use crate::obstacle::{Obstacle, SolidHalfSpace};
use crate::unicycle::{Loiter, Pose, Steering, UnicycleShield};
use crate::{Message, Settings, Shield, State};

const PERIOD_S: f64 = 0.1;
/// Samples of the separation in a period.
const SAMPLES: usize = 20;

fn loiter(random: &mut Random) -> Loiter {
    Loiter {
        delta_m: 1.0,
        period_s: PERIOD_S,
        min_speed_m_s: random.between(0.3, 1.0),
        max_speed_m_s: random.between(1.5, 3.0),
        accel_m_s2: random.between(0.5, 3.0),
        turn_rad_s: random.between(0.8, 3.0),
        tracking_error_m: 0.0,
        is_left: random.chance(0.5),
    }
}

fn pose(random: &mut Random, loiter: &Loiter, half_m: f64) -> Pose {
    Pose {
        position_m: Vector3::new(random.between(-half_m, half_m), random.between(-half_m, half_m), 0.0),
        heading_rad: random.between(-3.2, 3.2),
        speed_m_s: random.between(loiter.min_speed_m_s, loiter.max_speed_m_s),
    }
}

#[test]
fn a_pose_after_a_period_is_that_of_many_short_steps() {
    let mut random = Random::new(41);
    for round in 0..300 {
        let own_loiter = loiter(&mut random);
        let start = pose(&mut random, &own_loiter, 2.0);
        let turn_rad_s = random.between(-3.0, 3.0) * [1.0, 1e-5, 0.0][round % 3];
        let command = Steering { accel_m_s2: random.between(-3.0, 3.0), turn_rad_s };
        let (steps, end) = (2_000, start.after(command, 0.5));
        let step_s = 0.5 / f64::from(steps);
        let (mut place, mut now) = (start.position_m, start);
        for k in 0..steps {
            // Midpoint rule on the heading and speed of the model.
            let middle = (f64::from(k) + 0.5) * step_s;
            now.heading_rad = start.heading_rad + turn_rad_s * middle;
            now.speed_m_s = start.speed_m_s + command.accel_m_s2 * middle;
            place += now.state().velocity_m_s * step_s;
        }
        assert!((place - end.position_m).norm() < 1e-6, "{start:?} {command:?}: {place} {}", end.position_m);
    }
}

#[test]
fn the_pivot_stays_in_the_triangle_of_its_period() {
    let mut random = Random::new(42);
    for _ in 0..50_000 {
        let own_loiter = loiter(&mut random);
        let start = pose(&mut random, &own_loiter, 2.0);
        let most = |speed: f64| (speed - start.speed_m_s) / PERIOD_S;
        let accel_m_s2 = random.between(most(own_loiter.min_speed_m_s), most(own_loiter.max_speed_m_s));
        let turn_rad_s = own_loiter.turn_rad_s * [random.between(-1.0, 1.0), 1.0, -1.0, 0.0][random.index(4)];
        let command = Steering { accel_m_s2, turn_rad_s };
        let end = start.after(command, PERIOD_S);
        let corners = [own_loiter.pivot_m(&start), own_loiter.corner_m(&start, &end), own_loiter.pivot_m(&end)];
        let within = start.after(command, PERIOD_S * random.unit());
        let pivot = own_loiter.pivot_m(&within);
        assert!(((pivot - within.position_m).norm() - own_loiter.radius_m()).abs() < 1e-12);
        for _ in 0..10 {
            let normal = random.direction();
            let largest = corners.iter().map(|corner| normal.dot(corner)).fold(f64::NEG_INFINITY, f64::max);
            assert!(normal.dot(&pivot) <= largest + 1e-8, "{own_loiter:?} {start:?} {command:?}");
        }
    }
}

#[test]
fn the_fallback_runs_to_the_centre_of_its_circle_and_stays() {
    let mut random = Random::new(43);
    for _ in 0..300 {
        let own_loiter = loiter(&mut random);
        let start = pose(&mut random, &own_loiter, 2.0);
        let announced = own_loiter.start(&start).expect("valid");
        let mut shield = UnicycleShield::new(&own_loiter, 0, &start, &[announced]).expect("alone");
        let centre = announced.segment.stop();
        let mut last = (centre - announced.segment.position()).norm();
        for _ in 0..300 {
            shield.loiter();
            let left = centre - own_loiter.pivot_m(&shield.next_reference());
            assert!(left.norm() <= last + 1e-9, "{own_loiter:?} {start:?}: {left}");
            last = left.norm();
        }
        assert!(last < 1e-9, "{own_loiter:?} {start:?}: {last}");
        assert!((shield.next_reference().speed_m_s - own_loiter.min_speed_m_s).abs() < 1e-9);
    }
}

/// One vehicle of a flight.
enum Vehicle {
    Unicycle(Box<UnicycleShield>, Steering),
    Point(Box<Shield>, Vector3<f64>),
}

impl Vehicle {
    fn at(&self, seconds: f64) -> Vector3<f64> {
        match self {
            Self::Unicycle(shield, command) => shield.reference().after(*command, seconds).position_m,
            Self::Point(shield, command) => shield.reference().after(*command, seconds).position_m,
        }
    }

    /// Takes a period, towards a point.
    fn fly(&mut self, towards: &Vector3<f64>) {
        match self {
            Self::Unicycle(shield, command) => {
                let pose = shield.next_reference();
                let to = towards - pose.position_m;
                let turn = (to.y.atan2(to.x) - pose.heading_rad).sin_cos();
                *command = shield.filter(Steering { accel_m_s2: 9.0, turn_rad_s: 4.0 * turn.0.atan2(turn.1) });
            }
            Self::Point(shield, command) => {
                let state = shield.next_reference();
                *command = shield.filter(state, (towards - state.position_m) * 9.0);
            }
        }
    }

    fn messages(&mut self) -> Vec<Message> {
        match self {
            Self::Unicycle(shield, _) => shield.messages().collect(),
            Self::Point(shield, _) => shield.messages().collect(),
        }
    }

    fn hear(&mut self, message: &Message) {
        match self {
            Self::Unicycle(shield, _) => shield.hear(message),
            Self::Point(shield, _) => shield.hear(message),
        }
    }
}

/// Flies unicycles and points at each other, with lost and late messages. Returns the least separation \[m\].
fn dive(seed: u64, has_defect: bool) -> f64 {
    let mut random = Random::new(seed);
    let count = 2 + random.index(5);
    let point = Settings::new(1.0, PERIOD_S).limits().expect("valid");
    let loiters: Vec<_> = (0..count).map(|_| loiter(&mut random)).collect();
    let is_point: Vec<_> = (0..count).map(|_| random.chance(0.2)).collect();
    let (poses, starts) = loop {
        let poses: Vec<_> = loiters.iter().map(|loiter| pose(&mut random, loiter, 8.0)).collect();
        let starts = poses.iter().zip(&loiters).zip(&is_point).map(|((pose, loiter), is_point)| {
            if *is_point { point.slot(pose.position_m) } else { loiter.start(pose).expect("valid") }
        });
        let starts: Vec<_> = starts.collect();
        if closest_starts(&starts).is_some_and(|worst| worst.room_m() >= 0.0) {
            break (poses, starts);
        }
    };
    let mut vehicles: Vec<_> = (0..count)
        .map(|i| {
            if is_point[i] {
                let shield = Shield::new(&point, i, &starts).expect("apart");
                return Vehicle::Point(Box::new(shield), Vector3::zeros());
            }
            let mut shield = UnicycleShield::new(&loiters[i], i, &poses[i], &starts).expect("apart");
            if has_defect {
                shield.leave_out_radius();
            }
            Vehicle::Unicycle(Box::new(shield), Steering::default())
        })
        .collect();
    let (loss, latency) = (random.between(0.0, 0.6), random.index(4));
    let mut flying: Vec<(usize, Message)> = vec![];
    let mut closest = f64::INFINITY;
    for period in 0..200 {
        let places: Vec<_> = vehicles.iter().map(|vehicle| vehicle.at(PERIOD_S)).collect();
        for (i, vehicle) in vehicles.iter_mut().enumerate() {
            let others = (0..count).filter(|j| *j != i).map(|j| places[j]);
            let apart = |place: &Vector3<f64>| (place - places[i]).norm();
            let nearest = others.min_by(|a, b| apart(a).total_cmp(&apart(b))).expect("two");
            vehicle.fly(&nearest);
        }
        for message in vehicles.iter_mut().flat_map(Vehicle::messages) {
            if !random.chance(loss) {
                flying.push((period + random.index(latency + 1), message));
            }
        }
        let (now, later) = flying.into_iter().partition(|(due, _)| *due <= period);
        let now: Vec<(usize, Message)> = now;
        flying = later;
        for (_, message) in &now {
            vehicles[message.to as usize].hear(message);
        }
        for k in 0..SAMPLES {
            let poses: Vec<_> =
                vehicles.iter().map(|vehicle| vehicle.at(PERIOD_S * k as f64 / SAMPLES as f64)).collect();
            let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
            closest = pairs.map(|(i, j)| (poses[i] - poses[j]).norm()).fold(closest, f64::min);
        }
    }
    closest
}

#[test]
fn unicycles_and_points_that_dive_at_each_other_keep_the_safety_distance() {
    let separations: Vec<_> = (0..if long() { 10_000 } else { 150 }).map(|seed| dive(seed, false)).collect();
    let closest = separations.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(closest >= 1.0, "{closest}");
    assert!(closest < 1.05, "{closest}");
}

#[test]
fn with_the_radius_of_the_loiter_circle_left_out() {
    let found = (0..60).filter(|seed| dive(*seed, true) < 1.0).count();
    assert!(found > 15, "{found}");
}

#[test]
fn a_unicycle_that_flies_at_a_wall_keeps_its_clearance() {
    let wall = SolidHalfSpace { normal: Vector3::x_axis(), offset_m: 0.0 };
    let mut closest = f64::INFINITY;
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let own_loiter = loiter(&mut random);
        let mut start = pose(&mut random, &own_loiter, 2.0);
        start.position_m.x += 8.0;
        let announced = own_loiter.start(&start).expect("valid");
        let alone = || UnicycleShield::new(&own_loiter, 0, &start, &[announced]).expect("alone");
        let mut shield = alone().with_obstacles(&[Obstacle::new(wall, 0.5)]).expect("far");
        let error = alone().with_obstacles(&[Obstacle::new(wall, 20.0)]).expect_err("near").to_string();
        assert!(error.starts_with("start: vehicle 1 reserves a segment"), "{error}");
        for _ in 0..300 {
            let turn_rad_s = (std::f64::consts::PI - shield.next_reference().heading_rad).sin() * 4.0;
            let command = shield.filter(Steering { accel_m_s2: 9.0, turn_rad_s });
            for k in 0..SAMPLES {
                let after = shield.reference().after(command, PERIOD_S * k as f64 / SAMPLES as f64);
                closest = closest.min(after.position_m.x);
            }
        }
    }
    assert!((0.5..0.6).contains(&closest), "{closest}");
}

#[test]
fn invalid_unicycles_are_refused_and_a_wish_that_is_not_finite_falls_back() {
    let mut random = Random::new(44);
    let own_loiter = loiter(&mut random);
    let start = pose(&mut random, &own_loiter, 1.0);
    let refused = |loiter: Loiter, pose: Pose| loiter.start(&pose).expect_err("refused").to_string();
    assert!(
        refused(Loiter { min_speed_m_s: 0.0, ..own_loiter }, start).starts_with("min_speed_m_s: must be above 0 (0)")
    );
    assert!(
        refused(Loiter { turn_rad_s: 20.0, ..own_loiter }, start)
            .starts_with("turn_rad_s: must turn by at most 1.5 rad")
    );
    assert!(
        refused(Loiter { accel_m_s2: 1e-9, ..own_loiter }, start)
            .starts_with("accel_m_s2: slowing down must take at most")
    );
    assert!(
        refused(Loiter { tracking_error_m: -1.0, ..own_loiter }, start)
            .starts_with("tracking_error_m: must not be neg")
    );
    assert!(refused(own_loiter, Pose { speed_m_s: 9.0, ..start }).starts_with("start: the speed must be from"));
    assert!(refused(own_loiter, Pose { heading_rad: f64::NAN, ..start }).starts_with("start: must be finite"));
    let announced = own_loiter.start(&start).expect("valid");
    let slot =
        Settings { delta_m: 2.0, ..Settings::new(1.0, PERIOD_S) }.limits().expect("valid").slot(Vector3::x() * 99.0);
    let error = UnicycleShield::new(&own_loiter, 0, &start, &[announced, slot]).expect_err("another delta").to_string();
    assert!(error.starts_with("delta_m: vehicle 2 has another value"), "{error}");
    let other = Pose { speed_m_s: own_loiter.min_speed_m_s, ..start };
    let error = UnicycleShield::new(&own_loiter, 0, &other, &[announced]).expect_err("another start").to_string();
    assert!(error.starts_with("start: the announced start differs"), "{error}");
    assert!(UnicycleShield::new(&own_loiter, 3, &start, &[announced]).is_err());
    let mut shield = UnicycleShield::new(&own_loiter, 0, &start, &[announced]).expect("alone");
    let command = shield.filter(Steering { accel_m_s2: f64::NAN, turn_rad_s: 0.0 });
    assert!(command.accel_m_s2 < 0.0 && command.turn_rad_s == 0.0, "{command:?}");
    assert_eq!(shield.counters().brakes, 1);
    // Alone, every wish within the limits is taken.
    let wish = Steering { accel_m_s2: 0.0, turn_rad_s: 0.1 };
    assert_eq!(shield.filter(wish), wish);
    let state: State = shield.reference().state();
    assert!((state.velocity_m_s.norm() - shield.reference().speed_m_s).abs() < 1e-12);
}
