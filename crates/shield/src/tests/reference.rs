//! Reference cases: flights whose numbers two independent implementations agree on.

use nalgebra::Vector3;

use super::world::{Flight, Radio, World};
use crate::settings::ROUNDING_M;
use crate::{Limits, Settings, State};

/// Period 0.1 s, commands up to 4, brake 2, speed up to 2, ease 0.2, no margin for rounding.
fn limits(stop_only: bool) -> Limits {
    let settings = Settings {
        accel_m_s2: 4.0,
        brake_m_s2: Some(2.0),
        ease_m: Some(0.2),
        stop_only,
        ..Settings::new(1.0 - ROUNDING_M, 0.1)
    };
    let mut limits = settings.limits().expect("settings are valid");
    // The reference implementations renew all planes in each period.
    limits.lead_m = 1e9;
    limits
}

fn flight(stop_only: bool, starts: &[[f64; 6]], slots: &[[f64; 3]], duration_s: f64) -> Flight {
    let starts = starts.iter().map(|[x, y, z, vx, vy, vz]| State {
        position_m: Vector3::new(*x, *y, *z),
        velocity_m_s: Vector3::new(*vx, *vy, *vz),
    });
    let slots = slots.iter().map(|slot| Vector3::from(*slot)).collect();
    Flight { duration_s, ..Flight::new(&limits(stop_only), starts.collect(), slots) }
}

fn check(world: &World, closest: (f64, f64), ends: &[[f64; 3]], [changed, answered, refused]: [u64; 3]) {
    assert!((world.closest_m - closest.0).abs() < 1e-8, "{} {}", world.closest_m, closest.0);
    assert!((world.closest_s - closest.1).abs() < 1e-5 || closest.1.is_nan(), "{} {}", world.closest_s, closest.1);
    for (state, end) in world.states.iter().zip(ends) {
        assert!((state.position_m - Vector3::from(*end)).amax() < 1e-8, "{} {end:?}", state.position_m);
    }
    let report = world.report();
    // The implementations compare with the law's command after its cut to the limits.
    let beyond_limits = report.changed - report.limited;
    assert_eq!((beyond_limits, report.accepted + report.refused, report.refused), (changed, answered, refused));
    assert_eq!(report.exceeded(), None);
}

#[test]
fn case_a_stops_head_on_at_the_safety_distance() {
    let starts = [[-4.0, 0.0, 0.0, 1.0, 0.0, 0.0], [4.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    let world = flight(true, &starts, &[[4.0, 0.0, 0.0], [-4.0, 0.0, 0.0]], 4.0).fly();
    let report = world.report();
    check(
        &world,
        (1.0, f64::NAN),
        &[[-0.315, 0.0, 0.0], [0.685, 0.0, 0.0]],
        [52, report.accepted + report.refused, report.refused],
    );
}

#[test]
fn case_b_crosses_in_the_plane() {
    let starts = [[-3.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.2, -3.0, 0.0, 0.0, 0.0, 0.0]];
    let world = flight(false, &starts, &[[3.0, 0.0, 0.0], [0.0, 3.0, 0.0]], 4.0).fly();
    let ends = [[1.514_066_33, -0.592_541_65, 0.0], [0.220_824_23, 2.406_256_74, 0.0]];
    check(&world, (1.277_945_92, 1.697_93), &ends, [17, 20, 0]);
}

#[test]
fn case_d_crosses_in_space_and_loses_every_third_broadcast() {
    let starts = [[0.0, 0.0, 0.0, 0.5, 0.0, 0.0], [3.0, 0.0, 0.5, 0.0, 0.5, 0.0], [1.0, 2.5, -0.5, 0.0, -0.4, 0.3]];
    let slots = [[3.0, 0.3, 0.0], [0.0, 0.0, 0.0], [1.0, -2.0, 0.0]];
    let mut flight = flight(false, &starts, &slots, 2.6);
    flight.radio = Radio { every_third: true, ..Radio::default() };
    let ends = [
        [1.902_930_12, -0.462_780_21, -0.205_317_13],
        [1.445_665_58, 0.738_633_27, 0.416_597_33],
        [-0.002_279_64, 0.126_231_73, -0.276_720_98],
    ];
    check(&flight.fly(), (1.201_658_32, 1.212_37), &ends, [29, 25, 0]);
}

#[test]
fn case_e_swaps_six_on_a_circle() {
    let place = |i: u32, radius: f64| {
        let (half, high) = (0.5 * radius, 0.75_f64.sqrt() * radius);
        let corners = [[radius, 0.0], [half, high], [-half, high], [-radius, 0.0], [-half, -high], [half, -high]];
        corners[i as usize]
    };
    let starts: Vec<_> = (0..6)
        .map(|i| {
            let ([x, y], i) = (place(i, 4.0), f64::from(i));
            [x + 0.01 * i, y + 0.02 * i, 0.0, 0.0, 0.0, 0.0]
        })
        .collect();
    let slots: Vec<_> = (0..6).map(|i| place(i, -4.0)).map(|[x, y]| [x, y, 0.0]).collect();
    let world = flight(false, &starts, &slots, 5.0).fly();
    check(&world, (1.134_482_26, 3.637_48), &[[1.060_571_04, 1.915_650_14, 0.0]], [179, 375, 1]);
}
