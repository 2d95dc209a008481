//! Negative twins: flights with one assumption or step of the certificate left out. Each must violate.

use super::flights::{Ranges, random_flight};
use super::world::{Defect, Flight, Law, Radio};
use crate::brake::Brake;
use crate::settings::ROUNDING_M;
use crate::{Fleet, Settings};

const FLIGHTS: u64 = 40;

/// Returns the number of flights that violate, and the smallest separation of all \[m\].
fn fly(laws: &'static [Law], imperfect: bool, change: impl Fn(&mut Flight)) -> (usize, f64) {
    let ranges = Ranges { most_vehicles: 8, laws, imperfect };
    let mut closest = vec![];
    for seed in 0..FLIGHTS {
        let mut flight = random_flight(seed, ranges);
        change(&mut flight);
        // A twin may need more room at the start than the flight without a defect.
        if Fleet::new(&flight.limits, &flight.starts).is_ok() {
            closest.push(flight.fly().closest_m);
        }
    }
    let least = closest.iter().copied().fold(f64::INFINITY, f64::min);
    (closest.iter().filter(|separation| **separation < 1.0).count(), least)
}

/// Replaces the settings of all vehicles.
pub(super) fn with_settings(flight: &mut Flight, change: impl Fn(&mut Settings)) {
    let mut last = None;
    for limits in &mut flight.limits {
        let mut settings = *limits.settings();
        change(&mut settings);
        // Vehicles with equal settings have equal limits.
        let found = last
            .filter(|(known, _)| *known == settings)
            .unwrap_or_else(|| (settings, settings.limits().expect("settings are valid")));
        (*limits, last) = (found.1, Some(found));
    }
}

fn assert_violates((violations, least): (usize, f64), at_least: usize) {
    assert!(violations >= at_least, "{violations} of {FLIGHTS} violate, least {least}");
}

const DIVE: &[Law] = &[Law::DiveAtNearest];
const RANDOM: &[Law] = &[Law::Random];

#[test]
fn without_the_tube_in_the_margin() {
    let found = fly(DIVE, true, |flight| {
        flight.adversarial = true;
        with_settings(flight, |settings| settings.tracking_error_m = Some(0.0));
    });
    assert_violates(found, 30);
}

#[test]
fn with_planes_of_the_segments_heard_last_under_latency() {
    let radio = Radio { latency_s: 0.1, ..Radio::default() };
    let found = fly(DIVE, false, |flight| (flight.radio, flight.defect) = (radio, Defect::PlanesAsHeard));
    assert_violates(found, 10);
}

#[test]
fn with_planes_of_the_segments_heard_last_under_loss() {
    let radio = Radio { loss: 0.3, ..Radio::default() };
    let found = fly(RANDOM, false, |flight| (flight.radio, flight.defect) = (radio, Defect::PlanesAsHeard));
    assert_violates(found, 3);
}

#[test]
fn with_an_owner_that_drops_its_old_plane_on_proposing() {
    let radio = Radio { latency_s: 0.3, loss: 0.3, ..Radio::default() };
    for (laws, at_least) in [(RANDOM, 2), (DIVE, 10)] {
        let found = fly(laws, false, |flight| (flight.radio, flight.defect) = (radio, Defect::OwnerDropsOldPlane));
        assert_violates(found, at_least);
    }
}

#[test]
fn with_a_stop_point_after_half_a_period() {
    let found = fly(DIVE, false, |flight| {
        for limits in &mut flight.limits {
            limits.envelope.brake = Brake::new(1e9, limits.settings().period_s);
        }
        flight.plant_m_s2 = flight.limits[0].settings().accel_m_s2;
    });
    assert_violates(found, 10);
}

#[test]
fn with_a_safety_distance_5_per_cent_too_small() {
    let found = fly(DIVE, false, |flight| with_settings(flight, |settings| settings.delta_m = 0.95 - ROUNDING_M));
    assert_violates(found, 10);
}

#[test]
fn with_a_plant_that_brakes_at_half_of_what_was_promised() {
    let found = fly(DIVE, false, |flight| flight.plant_m_s2 = 1.5);
    assert_violates(found, 20);
}
