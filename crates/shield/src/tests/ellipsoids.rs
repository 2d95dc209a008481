//! Flights with ellipsoids, judged in their scaled lengths, and negative twins.

use nalgebra::Vector3;

use super::flights::{Ranges, long, random_flight};
use super::twins::with_settings;
use super::world::{Flight, Law};
use crate::plane::Metric;
use crate::{Fleet, Settings, State, fleet::closest_starts};

const TALL_M: f64 = 1.5;
const FLAT_M: f64 = 0.2;

/// Returns a random flight in space with ellipsoids of this half height and delta = 1 m. `None` if starts are too near.
fn with_ellipsoids(seed: u64, half_height_m: f64, laws: &'static [Law], imperfect: bool) -> Option<Flight> {
    let mut flight = random_flight(seed, Ranges { most_vehicles: 8, laws, imperfect });
    flight.planar = false;
    flight.judge_vertical = 1.0 / (2.0 * half_height_m);
    // Tall ellipsoids need more height.
    let height = (2.0 * half_height_m).max(1.0);
    for (k, start) in flight.starts.iter_mut().enumerate() {
        start.position_m.z = (start.position_m.z + 0.1 * k as f64) * height;
    }
    with_settings(&mut flight, |settings| settings.half_height_m = Some(half_height_m));
    Fleet::new(&flight.limits, &flight.starts).is_ok().then_some(flight)
}

#[test]
fn random_flights_with_ellipsoids_keep_the_safety_distance_in_scaled_lengths() {
    let laws = &[Law::Slot, Law::DiveAtNearest, Law::DiveAtCentre, Law::Random];
    for half_height in [TALL_M, FLAT_M] {
        let flights = (0..if long() { 800 } else { 80 })
            .filter_map(|seed| with_ellipsoids(seed, half_height, laws, seed % 2 == 0));
        let (mut flown, mut closest) = (0, f64::INFINITY);
        for flight in flights {
            let world = flight.fly();
            assert!(world.closest_m >= 1.0, "{half_height} {}: {}", flight.seed, world.closest_m);
            assert_eq!(world.report().exceeded(), None);
            (flown, closest) = (flown + 1, closest.min(world.closest_m));
        }
        assert!(flown > 30 && closest < 1.001, "{half_height}: {flown} {closest}");
    }
}

/// Returns the numbers of flights that violate and of all flights.
fn violations(half_height_m: f64, imperfect: bool, change: impl Fn(&mut Flight)) -> (usize, usize) {
    let flights = (0..40).filter_map(|seed| with_ellipsoids(seed, half_height_m, &[Law::DiveAtNearest], imperfect));
    let violates = flights.map(|mut flight| {
        change(&mut flight);
        flight.fly().closest_m < 1.0
    });
    violates.fold((0, 0), |(found, all), violates| (found + usize::from(violates), all + 1))
}

#[test]
fn with_a_tube_that_is_not_scaled() {
    // The tube of a flat ellipsoid counts 2.5 times.
    let (found, all) = violations(FLAT_M, true, |flight| {
        flight.adversarial = true;
        for limits in &mut flight.limits {
            let error = limits.tube().error_m;
            let unscaled = Settings { tracking_error_m: Some(error / limits.metric().stretch()), ..*limits.settings() };
            *limits = unscaled.limits().expect("valid");
        }
    });
    assert!(found > 10, "{found} of {all}");
}

#[test]
fn with_vertical_distances_of_a_ball() {
    let (found, all) = violations(TALL_M, false, |flight| {
        with_settings(flight, |settings| settings.half_height_m = None);
    });
    assert!(found > 15, "{found} of {all}");
}

#[test]
fn two_vehicles_that_only_stop_end_above_each_other_at_the_height_of_two_ellipsoids() {
    let settings = Settings { stop_only: true, half_height_m: Some(TALL_M), ..Settings::new(1.0, 0.05) };
    let starts = [-5.0, 5.0].map(|z| State::at_rest(Vector3::z() * z)).to_vec();
    let slots = [5.0, -5.0].map(|z| Vector3::z() * z).to_vec();
    let flight = Flight::new(&settings.limits().expect("valid"), starts, slots);
    let world = Flight { duration_s: 20.0, judge_vertical: 1.0 / 3.0, ..flight }.fly();
    let apart = world.states[1].position_m.z - world.states[0].position_m.z;
    assert!((0.0..1e-4).contains(&(apart - 3.0).abs()), "{apart}");
    assert!(world.closest_m >= 1.0, "{}", world.closest_m);
}

#[test]
fn rooms_are_in_scaled_lengths_and_all_vehicles_have_one_ellipsoid() {
    let ball = Settings::new(1.0, 0.05);
    let tall = Settings { half_height_m: Some(TALL_M), ..ball }.limits().expect("valid");
    assert_eq!(tall.metric(), Metric::ellipsoid(1.0, TALL_M));
    assert!(tall.certificate().starts_with(
        "certified never closer than 1.000 m on a level and 3.000 m in the vertical, outside the ellipsoid of these \
         half axes under any law"
    ));
    let slots = [0.0, 2.4].map(|z| tall.slot(Vector3::z() * z));
    let closest = closest_starts(&slots).expect("two");
    assert!((closest.distance_m - 0.8).abs() < 1e-12 && closest.room_m() < 0.0, "{closest:?}");
    let flat = Settings { half_height_m: Some(FLAT_M), tracking_error_m: Some(0.1), ..ball }.limits().expect("valid");
    // Half of delta, and 0.1 m times 2.5.
    assert!((flat.margin_m() - 0.75).abs() < 2e-6, "{}", flat.margin_m());

    let states = [0.0, 9.0].map(|x| State::at_rest(Vector3::x() * x));
    let refused =
        |other: Settings| Fleet::new(&[tall, other.limits().expect("valid")], &states).expect_err("differ").to_string();
    assert_eq!(refused(ball), "half_height_m: vehicle 2 has another value (1.5); give all vehicles the same");
    let wide = Settings { delta_m: 2.0, ..*tall.settings() };
    assert_eq!(refused(wide), "delta_m: vehicle 2 has another value (1); give all vehicles the same");
    let zero = Settings { half_height_m: Some(0.0), ..ball };
    assert!(zero.limits().expect_err("zero").to_string().starts_with("half_height_m: must be above 0 (0)"));
    // Extreme heights are refused at the start or fly.
    for half_height_m in [1e-300, 1e300] {
        let extreme = Settings { half_height_m: Some(half_height_m), ..ball }.limits();
        let _ = extreme.and_then(|extreme| Fleet::new(&[extreme; 2], &states));
    }
}
