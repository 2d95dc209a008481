use proptest::prelude::*;

use super::*;
use crate::graph::Graph;
use crate::space::CellList;
use tautline_core::swarm::Swarm;

const SPACING_M: f64 = 7.0;

fn law(count: usize, keys: FlockingKeys) -> FlockingLaw {
    let (links, formation) = (Graph::complete(count), Formation::line(count, SPACING_M));
    let context = LawContext::new(&links, &formation, 2.0, 0.1);
    FlockingLaw::new(&context, keys).expect("finite keys")
}

fn command(law: &mut FlockingLaw, swarm: &Swarm) -> Result<Rows, LawError> {
    let (links, mut near) = (Graph::complete(swarm.count()), CellList::default());
    near.update(&swarm.positions_m, law.range_m());
    let formation = Formation::line(swarm.count(), SPACING_M);
    let observation = Observation { near: near.pairs(), ..Observation::exact(swarm, &links, &formation) };
    let mut command = Rows::zeros(swarm.count());
    law.command(&observation, &mut command).map(|()| command)
}

#[test]
fn the_pair_force_matches_a_hand_calculation() {
    let law = law(2, FlockingKeys::default());
    assert!((sigma_norm(7.0) - 14.289_916).abs() < 1e-6 && (sigma_norm(8.4) - 18.383_094).abs() < 1e-6);
    let pull = |length_m: f64| law.pull_m_s2(Vector3::new(length_m, 0.0, 0.0), Vector3::zeros()).x;
    assert!(pull(7.0).abs() < 1e-12, "at d");
    assert!(pull(6.0) < 0.0 && pull(3.0) < 0.0, "repulsion below d");
    assert!(pull(7.7) > 0.0, "attraction above d");
    assert_eq!((pull(8.4), pull(20.0)), (0.0, 0.0), "no force beyond r");
    // |2|_s = 1.832160: rho = 1, z = -12.457756, phi = -4.983968, n = 1.690309.
    assert!((pull(2.0) + 8.424_445).abs() < 1e-6, "{}", pull(2.0));
}

proptest! {
    #[test]
    fn pair_forces_are_at_most_a_over_root_epsilon(q in prop::array::uniform3(-9.0..9.0_f64)) {
        let law = law(2, FlockingKeys::default());
        prop_assert!(law.pull_m_s2(q.into(), Vector3::zeros()).norm() <= ACTION / EPSILON.sqrt());
    }

    #[test]
    fn a_flock_without_an_objective_keeps_its_mean_velocity(numbers in prop::collection::vec(-1.0..1.0_f64, 42)) {
        let keys = FlockingKeys { c1_gamma_per_s2: 0.0, max_accel_m_s2: 1e9, ..FlockingKeys::default() };
        let swarm = Swarm {
            positions_m: Rows::from_column_slice(&numbers[..21]) * 10.0,
            velocities_m_s: Rows::from_column_slice(&numbers[21..]),
        };
        let found = command(&mut law(7, keys), &swarm)?;
        // Except for a22, which the law compensates.
        let net = found.row_sum() + 0.1 * swarm.velocities_m_s.row_sum();
        prop_assert!(net.norm() < 1e-12 * (1.0 + found.norm()));
    }

    #[test]
    fn planar_swarms_get_planar_commands_within_the_limit(numbers in prop::collection::vec(-1.0..1.0_f64, 28)) {
        let stirred = |from: usize| {
            Rows::from_fn(7, |i, axis| if axis < 2 { 20.0 * numbers[from + 2 * i + axis] } else { 0.0 })
        };
        let swarm = Swarm { positions_m: stirred(0), velocities_m_s: stirred(14) };
        let mut law = law(7, FlockingKeys::default());
        let found = command(&mut law, &swarm)?;
        for i in 0..7 {
            prop_assert_eq!(found[(i, 2)], 0.0);
            prop_assert!(row(&found, i).norm() <= law.keys.max_accel_m_s2 * (1.0 + 1e-12));
        }
    }

    #[test]
    fn the_fastest_rate_bounds_the_stiffness_of_a_pair(length_m in 0.1..8.3_f64) {
        const STEP_M: f64 = 1e-6;
        let law = law(2, FlockingKeys { c1_gamma_per_s2: 0.0, ..FlockingKeys::default() });
        let pull = |along: Vector3<f64>| law.pull_m_s2(Vector3::new(length_m, 0.0, 0.0) + along, Vector3::zeros());
        let slope = |along: Vector3<f64>| (pull(along * STEP_M) - pull(-along * STEP_M)).norm() / (2.0 * STEP_M);
        // For two vehicles the rate bounds the roots of x'' + 2 c2 x' + 2 K x.
        let rate = law.rates(&RateQuery::new(0.0, Some(length_m))).fastest_per_s.expect("a rate");
        for stiff in [slope(Vector3::x()), slope(Vector3::y())] {
            prop_assert!(2.0 + (4.0 + 2.0 * stiff).sqrt() <= rate + 1e-6, "{stiff} {rate}");
        }
    }
}

#[test]
fn the_objective_pulls_to_the_centre_of_the_slots_with_damping() {
    let far = Rows::from_row_slice(&[0.0, 100.0, 0.0, 200.0, 0.0, 0.0]);
    let mut swarm = Swarm::at_rest(far);
    swarm.velocities_m_s[(1, 2)] = 1.0;
    let keys = FlockingKeys { c1_gamma_per_s2: 0.25, ..FlockingKeys::default() };
    let found = command(&mut law(2, keys), &swarm).expect("a command");
    let centre_m = mean_row(&Formation::line(2, SPACING_M).slots_m);
    let to_centre = (centre_m - row(&swarm.positions_m, 0)).normalize() * 0.25;
    assert!((row(&found, 0) - to_centre).norm() < 1e-4, "{found}");
    assert!((found[(1, 2)] + 1.0 + 0.1).abs() < 1e-12, "c2 = 2 sqrt c1: {found}");
}
