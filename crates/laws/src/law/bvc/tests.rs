use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::{CellList, closest_pair};
use tautline_core::swarm::Swarm;

const DELTA_M: f64 = 2.0;

fn keys() -> BvcKeys {
    BvcKeys { margin_m: Some(0.0), ..BvcKeys::default() }
}

fn law(formation: &Formation, keys: BvcKeys) -> BvcLaw {
    let links = Graph::complete(formation.count());
    BvcLaw::new(&LawContext::new(&links, formation, DELTA_M, 0.3), keys).expect("finite keys")
}

/// Returns the chosen velocities and the commanded accelerations.
fn answer(law: &mut BvcLaw, swarm: &Swarm, formation: &Formation) -> Result<(Rows, Rows), LawError> {
    let (links, mut near) = (Graph::complete(swarm.count()), CellList::default());
    near.update(&swarm.positions_m, law.tracking.range_m);
    let observation = Observation { near: near.pairs(), ..Observation::exact(swarm, &links, formation) };
    let (mut velocities, mut command) = (Rows::zeros(swarm.count()), Rows::zeros(swarm.count()));
    law.velocities(&observation, &mut velocities)?;
    law.command(&observation, &mut command)?;
    Ok((velocities, command))
}

fn pair(apart_m: f64) -> Rows {
    Rows::from_row_slice(&[0.0, 0.0, 0.0, apart_m, 0.0, 0.0])
}

/// Returns positions from numbers in (0, 1), in the plane or in space.
fn scattered(numbers: &[f64], extent_m: f64, is_planar: bool) -> Rows {
    let position = |i: usize, axis: usize| extent_m * (numbers[3 * i + axis] - 0.5);
    Rows::from_fn(numbers.len() / 3, |i, axis| if is_planar && axis == 2 { 0.0 } else { position(i, axis) })
}

#[test]
fn velocities_match_a_hand_calculation() {
    // The cells of two vehicles 3 m apart end 0.5 m in front of each.
    let formation = Formation::points(Rows::from_row_slice(&[9.0, 0.0, 0.0, -9.0, 0.0, 0.0]));
    let (velocities, _) = answer(&mut law(&formation, keys()), &Swarm::at_rest(pair(3.0)), &formation).expect("a cell");
    assert!((velocities - Rows::from_row_slice(&[0.5, 0.0, 0.0, -0.5, 0.0, 0.0])).amax() < 1e-12);
    // At the boundary both stop, and nearer than delta they part.
    let (velocities, _) = answer(&mut law(&formation, keys()), &Swarm::at_rest(pair(2.0)), &formation).expect("a cell");
    assert!(velocities.amax() < 1e-12, "{velocities}");
    let (velocities, command) =
        answer(&mut law(&formation, keys()), &Swarm::at_rest(pair(1.5)), &formation).expect("a cell");
    assert!((velocities - Rows::from_row_slice(&[-0.25, 0.0, 0.0, 0.25, 0.0, 0.0])).amax() < 1e-12);
    assert!((command - Rows::from_row_slice(&[-1.25, 0.0, 0.0, 1.25, 0.0, 0.0])).amax() < 1e-12);
    let same = Swarm::at_rest(Rows::zeros(2));
    assert!(matches!(answer(&mut law(&formation, keys()), &same, &formation), Err(LawError::Collision { .. })));
}

#[test]
fn a_vehicle_alone_flies_straight_to_its_slot() {
    let formation = Formation::points(Rows::from_row_slice(&[0.0, 0.4, 0.0, 0.0, 70.0, 0.0]));
    let mut swarm = Swarm::at_rest(pair(60.0));
    swarm.velocities_m_s[(0, 0)] = 0.25;
    let (velocities, command) = answer(&mut law(&formation, keys()), &swarm, &formation).expect("a cell");
    assert!((row(&velocities, 0) - Vector3::new(0.0, 0.4, 0.0)).norm() < 1e-12);
    assert!((row(&velocities, 1).norm() - 1.0).abs() < 1e-12, "the second vehicle flies at the largest speed");
    // tracking (V - v) - a22 v.
    assert!((row(&command, 0) - Vector3::new(-5.0 * 0.25 - 0.3 * 0.25, 2.0, 0.0)).norm() < 1e-12);
}

/// Flies velocities that are taken on at once and held for a step. Returns the smallest separation at the steps \[m\].
fn least_m(law: &mut BvcLaw, start_m: Rows, formation: &Formation, step_s: f64) -> f64 {
    let mut swarm = Swarm::at_rest(start_m);
    let mut least_m = f64::INFINITY;
    for _ in 0..60 {
        let Ok((velocities, _)) = answer(law, &swarm, formation) else { return 0.0 };
        swarm.positions_m += velocities * step_s;
        least_m = least_m.min(closest_pair(&swarm.positions_m).map_or(f64::INFINITY, |(_, apart_m)| apart_m));
    }
    least_m
}

proptest! {
    #[test]
    fn velocities_taken_on_at_once_keep_delta_for_any_step_up_to_the_inverse_gain(
        from in prop::collection::vec(0.0..1.0_f64, 24), to in prop::collection::vec(0.0..1.0_f64, 24),
        step_s in 0.05..1.0_f64, is_planar in any::<bool>(),
    ) {
        let start_m = scattered(&from, 14.0, is_planar);
        prop_assume!(closest_pair(&start_m).is_some_and(|(_, apart_m)| apart_m > DELTA_M));
        let formation = Formation::points(scattered(&to, 8.0, is_planar));
        let found_m = least_m(&mut law(&formation, keys()), start_m, &formation, step_s);
        prop_assert!(found_m > DELTA_M - 1e-9, "{found_m}");
    }

    #[test]
    fn planar_swarms_get_planar_commands_within_the_limit(numbers in prop::collection::vec(0.0..1.0_f64, 42)) {
        let formation = Formation::grid(7, 2.5);
        let mut velocities_m_s = scattered(&numbers[21..], 4.0, true);
        velocities_m_s *= 2.0;
        let swarm = Swarm { positions_m: scattered(&numbers[..21], 8.0, true), velocities_m_s };
        let (_, command) = answer(&mut law(&formation, keys()), &swarm, &formation)?;
        for i in 0..7 {
            prop_assert_eq!(command[(i, 2)], 0.0);
            prop_assert!(row(&command, i).norm() <= 5.0 * (1.0 + 1e-12));
        }
    }
}

/// Without the buffer cells touch, and vehicles meet at the common boundary.
#[test]
fn cells_without_a_buffer_do_not_keep_delta() {
    let formation = Formation::points(-pair(6.0));
    let start_m = || Rows::from_row_slice(&[-3.0, 0.0, 0.0, 3.0, 0.1, 0.0]);
    let mut buffered = law(&formation, keys());
    assert!(least_m(&mut buffered, start_m(), &formation, 0.1) > DELTA_M - 1e-9);
    let mut bare = law(&formation, BvcKeys { margin_m: Some(-DELTA_M), ..keys() });
    assert!(least_m(&mut bare, start_m(), &formation, 0.1) < 0.5 * DELTA_M);
}
