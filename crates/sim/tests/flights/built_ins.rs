//! The built-in scenarios match their reference cases.

use tautline_core::swarm::{Rows, Swarm, separation};
use tautline_sim::scenario::{Scenario, builtin};

use super::scenario_files::read_builtin;

/// Integrates p'' = a22 v + u to `time_s` with the classical Runge-Kutta method. Returns the state and the smallest
/// separation at the steps.
fn integrate(scenario: &Scenario, time_s: f64, steps: u32) -> (Swarm, f64) {
    let mut law = scenario.law().expect("a validated scenario has a law");
    let mut control = Rows::zeros(scenario.count());
    let mut slope = |swarm: &Swarm| {
        law.command(&scenario.observation(swarm), &mut control).expect("no collision");
        Swarm {
            positions_m: swarm.velocities_m_s.clone(),
            velocities_m_s: &control + &swarm.velocities_m_s * scenario.a22_per_s,
        }
    };
    let along = |from: &Swarm, slope: &Swarm, by: f64| Swarm {
        positions_m: &from.positions_m + &slope.positions_m * by,
        velocities_m_s: &from.velocities_m_s + &slope.velocities_m_s * by,
    };
    let h = time_s / f64::from(steps);
    let mut swarm = scenario.start.clone();
    let mut smallest_m = f64::INFINITY;
    for _ in 0..steps {
        let k1 = slope(&swarm);
        let k2 = slope(&along(&swarm, &k1, h / 2.0));
        let k3 = slope(&along(&swarm, &k2, h / 2.0));
        let k4 = slope(&along(&swarm, &k3, h));
        for (k, by) in [(k1, h / 6.0), (k2, h / 3.0), (k3, h / 3.0), (k4, h / 6.0)] {
            swarm = along(&swarm, &k, by);
        }
        for j in 1..swarm.count() {
            smallest_m = (0..j).map(|i| separation(&swarm.positions_m, i, j)).fold(smallest_m, f64::min);
        }
    }
    (swarm, smallest_m)
}

/// Digits of the reference table.
const TABLE_TOLERANCE: f64 = 1e-7;

#[test]
fn the_built_in_pentagon_is_the_reference_pentagon() {
    let scenario = read_builtin("pentagon", &[]).expect("a built-in");
    let mut law = scenario.law().expect("a law");
    let mut control = Rows::zeros(5);
    law.command(&scenario.observation(&scenario.start), &mut control).expect("no collision");
    assert!((control[(0, 0)] - 0.860_843_123).abs() < TABLE_TOLERANCE);
    assert!((control[(0, 1)] + 0.021_225_585).abs() < TABLE_TOLERANCE);
    assert!((law.energy(&scenario.observation(&scenario.start)).unwrap_or(0.0) - 3.656_742_96).abs() < TABLE_TOLERANCE);

    let (swarm, smallest_m) = integrate(&scenario, 10.0, 4000);
    assert!((swarm.positions_m[(0, 0)] - 4.318_055_1).abs() < TABLE_TOLERANCE, "{}", swarm.positions_m);
    assert!((swarm.positions_m[(0, 1)] + 1.043_487_6).abs() < TABLE_TOLERANCE, "{}", swarm.positions_m);
    // The smallest separation lies between two steps: the error is up to 1e-5 m.
    assert!((smallest_m - 2.460_353).abs() < 1e-5, "{smallest_m}");
}

#[test]
fn the_other_built_ins_are_their_reference_cases() {
    let circle = read_builtin("circle", &[]).expect("a built-in");
    let energy = circle.law().expect("a law").energy(&circle.observation(&circle.start)).unwrap_or(0.0);
    assert!((energy - 4.479_772_16).abs() < TABLE_TOLERANCE, "{energy}");
    let (_, smallest_m) = integrate(&circle, 10.0, 4000);
    assert!((smallest_m - 1.238_135).abs() < 1e-5, "{smallest_m}");

    let laplacian = read_builtin("pentagon-laplacian", &[]).expect("a built-in");
    let (_, smallest_m) = integrate(&laplacian, 10.0, 4000);
    assert!((smallest_m - 1.5327).abs() < 1e-4, "{smallest_m}");

    let collinear = read_builtin("pentagon-collinear", &[]).expect("a built-in");
    let (swarm, smallest_m) = integrate(&collinear, 10.0, 4000);
    assert!((smallest_m - 2.458_145).abs() < 1e-5, "{smallest_m}");
    assert!(swarm.positions_m.column(1).iter().all(|&y| y == 0.0), "no vehicle leaves the line");
}

#[test]
fn every_built_in_is_valid_and_has_a_summary_and_its_name() {
    for builtin in builtin::all() {
        let scenario = read_builtin(builtin.name, &[]).expect(builtin.name);
        assert_eq!(scenario.name, builtin.name);
        assert!(builtin.toml.starts_with("# "), "{}", builtin.name);
        assert!(!builtin.summary.is_empty() && !builtin.summary.contains('\n'));
    }
    assert_eq!(builtin::all()[0].name, "pentagon", "the default is first");
}
