//! Rotations, translations and permutations of a scenario change no result.

use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_sim::scenario::Scenario;

use crate::flight::{builtin, fly};

/// Returns the state after the flight of a scenario.
fn end(scenario: &Scenario) -> Swarm {
    scenario.validate().unwrap_or_else(|error| panic!("{error}"));
    fly(scenario).0.last
}

fn moved(rows: &Rows, by: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Rows {
    let mut moved = rows.clone();
    (0..rows.nrows()).for_each(|i| set_row(&mut moved, i, by(row(rows, i))));
    moved
}

fn relabelled(rows: &Rows, order: &[usize]) -> Rows {
    Rows::from_fn(rows.nrows(), |i, axis| rows[(order[i], axis)])
}

fn small_flight() -> Scenario {
    builtin("pentagon", &["time.duration_s=4", "swarm.dimensions=3"])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rotating_translating_and_relabelling_a_scenario_changes_nothing(
        axis in prop::array::uniform3(-3.0..3.0_f64),
        offset in prop::array::uniform3(-100.0..100.0_f64),
        order in Just((0..5).collect::<Vec<_>>()).prop_shuffle(),
    ) {
        // Coordinates up to 100 m are rounded to 1e-14 m; the flight amplifies a difference by less than 1e4 in 4 s.
        const TOLERANCE: f64 = 1e-10;
        let plain = small_flight();
        let rotation = Rotation3::new(Vector3::from(axis));
        let offset = Vector3::from(offset);
        let mut changed = plain.clone();
        changed.start.positions_m = relabelled(&moved(&plain.start.positions_m, |p| rotation * p + offset), &order);
        changed.start.velocities_m_s = relabelled(&moved(&plain.start.velocities_m_s, |v| rotation * v), &order);
        changed.legs[0].formation.slots_m = relabelled(&plain.formation().slots_m, &order);
        let (expected, found) = (end(&plain), end(&changed));
        let positions_m = relabelled(&moved(&expected.positions_m, |p| rotation * p + offset), &order);
        let velocities_m_s = relabelled(&moved(&expected.velocities_m_s, |v| rotation * v), &order);
        let off = (found.positions_m - positions_m).amax().max((found.velocities_m_s - velocities_m_s).amax());
        prop_assert!(off <= TOLERANCE, "off by {off}");
    }
}

#[test]
fn a_different_start_gives_a_different_end() {
    let mut other = small_flight();
    other.start.positions_m[(0, 0)] += 1e-6;
    assert!((end(&other).positions_m - end(&small_flight()).positions_m).amax() > 1e-8);
}
