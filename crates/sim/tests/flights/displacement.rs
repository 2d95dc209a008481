//! The displacement law against an independent integration (DOP853 at relative tolerance 1e-11): k = zeta = alpha = 1,
//! a22 = 0.1, starts at rest.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_core::swarm::{Pair, row};

use crate::flight::{Log, builtin, fly};

const HUB_3: &str = "graph={kind=\"edges\", edges=[[3, 1], [3, 2], [3, 4], [3, 5]]}";
/// A leader at rest.
const LEADER_3: &str = "reference={kind=\"rest\", leader=3}";
const DISPLACEMENT: &str = "law.kind=displacement";

struct Reference {
    sets: &'static [&'static str],
    scenario: &'static str,
    energy: f64,
    certified_m: f64,
    closest_m: f64,
    closest_s: f64,
    pair: Pair,
    /// Time from which all distances of pairs are within 0.01 m of those of the slots.
    within_s: f64,
}

fn references() -> [Reference; 4] {
    [
        Reference {
            sets: &[DISPLACEMENT],
            scenario: "pentagon",
            energy: 35.486_384_76,
            certified_m: 2.030_058_1,
            closest_m: 2.435_229_86,
            closest_s: 2.9705,
            pair: Pair::new(3, 4),
            within_s: 11.463,
        },
        Reference {
            sets: &[DISPLACEMENT, HUB_3],
            scenario: "pentagon",
            energy: 35.490_384_76,
            certified_m: 2.030_054_91,
            closest_m: 2.419_352_28,
            closest_s: 2.9605,
            pair: Pair::new(3, 4),
            within_s: 11.337,
        },
        Reference {
            sets: &[DISPLACEMENT, HUB_3, LEADER_3],
            scenario: "pentagon",
            energy: 35.490_384_76,
            certified_m: 2.030_054_91,
            closest_m: 2.419_307_17,
            closest_s: 2.9605,
            pair: Pair::new(3, 4),
            within_s: 11.3605,
        },
        Reference {
            sets: &[DISPLACEMENT],
            scenario: "circle",
            energy: 50.751_041_67,
            certified_m: 1.010_699_37,
            closest_m: 1.102_616_43,
            closest_s: 1.8095,
            pair: Pair::new(0, 3),
            within_s: 17.5335,
        },
    ]
}

/// Returns the first recorded instant from which every distance of a pair is within 0.01 m of that of the slots \[s\].
fn within_s(log: &Log, scenario: &tautline_sim::scenario::Scenario) -> f64 {
    let formation = scenario.formation();
    let is_off = |sample: &&tautline_core::record::OwnedSample| {
        let positions_m = &sample.swarm.positions_m;
        (0..formation.count()).any(|i| {
            (i + 1..formation.count()).any(|j| {
                let apart_m = (row(positions_m, i) - row(positions_m, j)).norm();
                (apart_m - formation.desired_distance(i, j)).abs() >= 0.01
            })
        })
    };
    log.samples.iter().rev().find(is_off).map_or(0.0, |sample| sample.time_s)
}

#[test]
fn pentagon_and_circle_match_the_reference_in_both_plants() {
    for reference in references() {
        for (plant, exact_m) in [("plant.kind=ideal", 1e-5), ("plant.kind=rapier", 1e-4)] {
            let scenario = builtin(reference.scenario, &[reference.sets, &[plant, "time.duration_s=40"]].concat());
            let (flight, log) = fly(&scenario);
            let case = format!("{} {:?} {plant}", reference.scenario, reference.sets);
            let near = |found: f64, expected: f64, by: f64, what: &str| {
                assert!((found - expected).abs() <= by, "{case}: {what} is {found} instead of {expected}");
            };
            let certificate = &flight.certificate;
            near(certificate.energy_initial.expect("an energy"), reference.energy, 1e-6 * reference.energy, "E(0)");
            near(
                certificate.certified_m.expect("a certificate"),
                reference.certified_m,
                1e-6,
                "the certified distance",
            );
            assert_eq!(flight.audit.status, Status::Clear, "{case}");
            let closest = flight.audit.closest.expect("a closest pair");
            near(closest.separation_m, reference.closest_m, exact_m, "the smallest separation");
            near(closest.time_s, reference.closest_s, 0.01, "its time");
            assert_eq!(closest.pair, reference.pair, "{case}");
            // Samples are 1/60 s apart.
            near(within_s(&log, &scenario), reference.within_s, 0.03, "the time of arrival");
            let initial = log.samples[0].energy.expect("an energy");
            assert!(log.samples.iter().all(|s| s.peaks.energy.unwrap_or(0.0) <= initial * (1.0 + 1e-3)), "{case}");
        }
    }
}

#[test]
fn the_first_command_and_the_position_at_ten_seconds_match_the_reference() {
    let scenario = builtin("pentagon", &[DISPLACEMENT, "plant.kind=ideal", "time.duration_s=11"]);
    let (_, log) = fly(&scenario);
    let off_m_s2 = (row(&log.samples[0].control, 0) - Vector3::new(1.5, -2.538_076_21, 0.0)).norm();
    assert!(off_m_s2 < 1e-8, "{off_m_s2} m/s^2");
    let at = log.samples.iter().find(|sample| sample.time_s >= 10.0 - 1e-9).expect("a sample");
    let off_m = (row(&at.swarm.positions_m, 0) - Vector3::new(4.497_956_83, -2.618_949_08, 0.0)).norm();
    assert!(off_m < 1e-7, "{off_m} m");
}

/// Random starts keep the certified separations on every graph and reach the formation.
#[test]
fn the_certificate_holds_for_every_pair_on_every_connected_graph() {
    for graph in ["complete", "star", "ring", "path"] {
        let scenario = builtin("pentagon", &[DISPLACEMENT, &format!("graph.kind={graph}"), "time.duration_s=40"]);
        let (flight, log) = fly(&scenario);
        let closest_m = flight.audit.closest.expect("a closest pair").separation_m;
        let certified_m = flight.certificate.certified_m.expect("a certificate");
        assert!(closest_m > certified_m && certified_m > scenario.delta_m, "{graph}: {closest_m} {certified_m}");
        assert!(within_s(&log, &scenario) < 20.0, "{graph}");
    }
}
