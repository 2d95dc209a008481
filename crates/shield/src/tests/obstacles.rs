//! Flights between convex obstacles, and their negative twins.

use nalgebra::{Isometry3, Vector3};

use super::flights::{Ranges, long, random_flight};
use super::twins::with_settings;
use super::world::{Flight, Law};
use super::{Random, random_body};
use crate::brake::Brake;
use crate::obstacle::{Ball, Cuboid, SolidHalfSpace};
use crate::{Fleet, Obstacle, Settings, Shield, State};

/// Returns a random flight between random bodies with clearances, in which each start has its room.
fn among_bodies(seed: u64, laws: &'static [Law], imperfect: bool) -> Flight {
    let mut flight = random_flight(seed, Ranges { most_vehicles: 6, laws, imperfect });
    let mut random = Random::new(seed ^ 0xB0D1);
    let fleet = Fleet::new(&flight.limits, &flight.starts).expect("starts are apart");
    let count = 1 + random.index(4);
    let mut within = 4.0;
    while flight.obstacles.len() < count {
        let clearance = random.between(0.0, 0.6);
        let found = random_body(&mut random, within, clearance);
        within += 0.05;
        if fleet.clone().with_obstacles(std::slice::from_ref(&found)).is_ok() {
            flight.obstacles.push(found);
        }
    }
    flight
}

#[test]
fn random_flights_between_bodies_keep_their_clearance() {
    let laws = &[Law::Slot, Law::DiveAtNearest, Law::DiveAtCentre, Law::Random];
    let (mut least, mut near) = (f64::INFINITY, 0);
    for seed in 0..if long() { 1_000 } else { 100 } {
        let world = among_bodies(seed, laws, seed % 2 == 0).fly();
        assert!(world.closest_m >= 1.0, "flight {seed}: {}", world.closest_m);
        assert!(world.obstacle_room_m >= 0.0, "flight {seed}: {}", world.obstacle_room_m);
        assert_eq!(world.report().exceeded(), None, "flight {seed}");
        least = least.min(world.obstacle_room_m);
        near += usize::from(world.obstacle_room_m < 0.3);
    }
    assert!(least < 1e-4 && near > 50, "{least} {near}");
}

/// Returns the number of flights that violate a clearance, of 40.
fn violations(imperfect: bool, change: impl Fn(&mut Flight)) -> usize {
    let violates = |seed: &u64| {
        let mut flight = among_bodies(*seed, &[Law::DiveAtNearest], imperfect);
        change(&mut flight);
        flight.fly().obstacle_room_m < 0.0
    };
    (0..40).filter(violates).count()
}

#[test]
fn without_the_tube_before_an_obstacle() {
    assert_eq!(violations(true, |flight| flight.adversarial = true), 0);
    let found = violations(true, |flight| {
        flight.adversarial = true;
        with_settings(flight, |settings| settings.tracking_error_m = Some(0.0));
    });
    assert!(found > 15, "{found}");
}

#[test]
fn with_a_stop_point_that_is_not_tested_against_the_obstacle() {
    let found = violations(false, |flight| {
        for limits in &mut flight.limits {
            limits.envelope.brake = Brake::new(1e9, limits.settings().period_s);
        }
        flight.plant_m_s2 = flight.limits[0].settings().accel_m_s2;
    });
    assert!(found > 10, "{found}");
}

fn box_at(x: f64, half: [f64; 3]) -> Cuboid {
    Cuboid { pose: Isometry3::translation(x, 0.0, 0.0), half_extents_m: half.into() }
}

#[test]
fn a_vehicle_flies_around_a_ball_and_a_wall_to_its_slot() {
    let limits = Settings::new(1.0, 0.05).limits().expect("valid");
    let bodies = [
        Obstacle::new(Ball { centre_m: Vector3::zeros(), radius_m: 1.0 }, 0.5),
        Obstacle::new(box_at(0.0, [0.2, 2.0, 9.0]), 0.5),
    ];
    for obstacle in bodies {
        let start = State::at_rest(Vector3::new(-4.0, 0.0, 0.0));
        let flight = Flight::new(&limits, vec![start], vec![Vector3::new(4.0, 0.0, 0.0)]);
        let flight = Flight { obstacles: vec![obstacle], duration_s: 60.0, planar: true, ..flight };
        let world = flight.fly();
        let left = (world.states[0].position_m - flight.slots[0]).norm();
        assert!(left < 0.1 && world.obstacle_room_m >= 0.0, "{:?}: {}", flight.obstacles, world.states[0].position_m);
        // Ease is kept by choice.
        assert!(world.obstacle_room_m < 0.3, "{}", world.obstacle_room_m);
    }
}

#[test]
fn a_vehicle_stops_before_the_ground_at_its_clearance() {
    let settings = Settings { stop_only: true, tracking_error_m: Some(0.25), ..Settings::new(1.0, 0.05) };
    let start = State::at_rest(Vector3::z() * 5.0);
    let flight = Flight::new(&settings.limits().expect("valid"), vec![start], vec![Vector3::z() * -5.0]);
    let ground = SolidHalfSpace { normal: Vector3::z_axis(), offset_m: 0.0 };
    let world = Flight { obstacles: vec![Obstacle::new(ground, 0.5)], duration_s: 20.0, ..flight }.fly();
    assert!((0.25..0.2501).contains(&world.obstacle_room_m), "{}", world.obstacle_room_m);
}

#[test]
fn a_start_without_room_is_refused_with_vehicle_obstacle_and_room() {
    let limits = [Settings::new(1.0, 0.05).limits().expect("valid"); 2];
    let mut states = [0.0, 4.0].map(|x| State::at_rest(Vector3::new(x, 0.0, 0.0)));
    let bodies = [Obstacle::new(box_at(-9.0, [1.0; 3]), 0.5), Obstacle::new(box_at(7.0, [1.0; 3]), 0.5)];
    let fleet = |states: &[State]| Fleet::new(&limits, states).expect("apart");
    assert!(fleet(&states).with_obstacles(&bodies).is_ok());
    // 2 m/s stop within 0.6675 m.
    states[1] = State { position_m: Vector3::x() * 5.0, velocity_m_s: Vector3::x() * 2.0 };
    assert_eq!(
        fleet(&states).with_obstacles(&bodies).expect_err("too near").to_string(),
        "start: vehicle 2 reserves a segment nearer to obstacle 2 than the 0.500000 m of its margin (0.3325); move it \
         away, start slower or lower the errors"
    );
    states[1].position_m.x = 5.5;
    let error = fleet(&states).with_obstacles(&bodies).expect_err("meets").to_string();
    assert!(
        error.starts_with("start: vehicle 2 reserves a segment that meets obstacle 2 (0); move it away"),
        "{error}"
    );
    let start = limits[0].start(states[0]).expect("slow");
    let negative = [Obstacle::new(box_at(9.0, [1.0; 3]), -0.5)];
    let alone = || Shield::new(&limits[0], 0, &[start]).expect("one vehicle is apart from all");
    assert!(alone().with_obstacles(&bodies).is_ok());
    assert_eq!(
        alone().with_obstacles(&negative).expect_err("negative").to_string(),
        "clearance_m: the clearance of obstacle 1 must not be negative (-0.5); give 0 or a positive number"
    );
}
