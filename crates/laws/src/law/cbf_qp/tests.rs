use proptest::prelude::*;

use super::*;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::CellList;
use tautline_core::swarm::Swarm;

const DELTA_M: f64 = 2.0;
const A22_PER_S: f64 = -0.2;

fn law(formation: &Formation) -> CbfQpLaw {
    let links = Graph::complete(formation.count());
    let context = LawContext::new(&links, formation, DELTA_M, A22_PER_S);
    CbfQpLaw::new(&context, CbfQpKeys::default()).expect("finite keys")
}

fn command(law: &mut CbfQpLaw, swarm: &Swarm, formation: &Formation) -> Result<Rows, LawError> {
    let (links, mut near) = (Graph::complete(swarm.count()), CellList::default());
    near.update(&swarm.positions_m, law.range_m);
    let observation = Observation { near: near.pairs(), ..Observation::exact(swarm, &links, formation) };
    let mut command = Rows::zeros(swarm.count());
    law.command(&observation, &mut command).map(|()| command)
}

fn vectors(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

/// Returns h of a pair under the default keys, where A = 10 m/s^2.
fn barrier_m_s(apart_m: Vector3<f64>, relative_m_s: Vector3<f64>) -> f64 {
    (20.0 * (apart_m.norm() - DELTA_M)).sqrt() + apart_m.dot(&relative_m_s) / apart_m.norm()
}

#[test]
fn the_bound_of_a_closing_pair_matches_a_hand_calculation() {
    // l = 4, n . w = -2: sqrt(2 A (l - delta)) = sqrt 40, h = sqrt 40 - 2.
    let law = law(&Formation::line(2, 3.0));
    let found = law.bound_m_s2(-Vector3::x(), 4.0, Vector3::new(2.0, 0.0, 0.0));
    assert!((found - (80.876_877 - 3.162_278 + 0.4)).abs() < 2e-6, "{found}");
    // A relative velocity of 3 m/s across the line of sight adds a centrifugal 9/4 m/s^2.
    let turning = law.bound_m_s2(-Vector3::x(), 4.0, Vector3::new(2.0, 3.0, 0.0));
    assert!((turning - found - 2.25).abs() < 1e-12, "{turning}");
}

proptest! {
    #[test]
    fn a_pair_at_its_bound_approaches_the_barrier_at_the_allowed_rate(
        direction in vectors(1.0), clearance_m in 0.05..4.0_f64, relative in vectors(3.0), push in vectors(5.0),
    ) {
        const STEP_S: f64 = 1e-6;
        prop_assume!(direction.norm() > 0.1);
        let normal = direction.normalize();
        let apart_m = normal * (DELTA_M + clearance_m);
        let bound = law(&Formation::line(2, 3.0)).bound_m_s2(normal, apart_m.norm(), relative);
        // Along the line of sight the two use the whole bound.
        let commanded = push - normal * (normal.dot(&push) + bound);
        let acceleration = commanded + A22_PER_S * relative;
        let barrier_at = |time_s: f64| barrier_m_s(apart_m + relative * time_s, relative + acceleration * time_s);
        let rate = (barrier_at(STEP_S) - barrier_at(-STEP_S)) / (2.0 * STEP_S);
        let allowed = -barrier_m_s(apart_m, relative).powi(3);
        prop_assert!((rate - allowed).abs() < 1e-5 * (1.0 + allowed.abs() + bound.abs()), "{rate} {allowed}");
    }

    #[test]
    fn beyond_the_range_half_spaces_are_inactive_below_the_highest_speed(
        relative in vectors(1.0), beyond in 1.0..3.0_f64,
    ) {
        let law = law(&Formation::line(2, 3.0));
        prop_assume!(relative.norm() <= 1.0);
        let bound = law.bound_m_s2(Vector3::x(), law.range_m * beyond, 4.0 * relative);
        prop_assert!(0.5 * bound >= law.keys.max_accel_m_s2 - 1e-9, "{bound}");
    }

    #[test]
    fn planar_swarms_get_planar_commands_within_the_limits(numbers in prop::collection::vec(-1.0..1.0_f64, 28)) {
        let formation = Formation::grid(7, 2.5);
        let stirred = |from: usize, size: f64| {
            Rows::from_fn(7, |i, axis| if axis < 2 { size * numbers[from + 2 * i + axis] } else { 0.0 })
        };
        let swarm = Swarm { positions_m: stirred(0, 5.0), velocities_m_s: stirred(14, 2.0) };
        let mut law = law(&formation);
        let command = command(&mut law, &swarm, &formation)?;
        for i in 0..7 {
            prop_assert_eq!(command[(i, 2)], 0.0);
            prop_assert!(row(&command, i).norm() <= law.keys.max_accel_m_s2 * (1.0 + 1e-12));
        }
    }
}

#[test]
fn a_vehicle_out_of_range_follows_the_nominal_controller() {
    let positions_m = Rows::from_row_slice(&[0.0, 0.0, 0.0, 60.0, 0.0, 0.0]);
    let formation = Formation::points(Rows::from_row_slice(&[0.5, 0.0, 0.0, 70.0, 0.0, 0.0]));
    let mut swarm = Swarm::at_rest(positions_m);
    swarm.velocities_m_s[(0, 1)] = 0.25;
    let found = command(&mut law(&formation), &swarm, &formation).expect("a command");
    // k d - c v - a22 v for the first vehicle, c v_max for the second.
    assert!((row(&found, 0) - Vector3::new(0.5, -0.45, 0.0)).norm() < 1e-12, "{found}");
    assert!((row(&found, 1) - Vector3::new(4.0, 0.0, 0.0)).norm() < 1e-12, "{found}");
}

#[test]
fn the_fastest_rate_is_known_only_beyond_the_range() {
    let law = law(&Formation::grid(2, 9.0));
    let rate_per_s = |nearest_m: f64| law.rates(&RateQuery::new(0.1, Some(nearest_m))).fastest_per_s;
    assert_eq!(rate_per_s(law.range_m.next_up()), Some(law.keys.c_per_s.max(law.keys.k_per_s2.sqrt())));
    assert_eq!((rate_per_s(law.range_m), law.rates(&RateQuery::new(0.1, None)).fastest_per_s), (None, None));
}

#[test]
fn vehicles_at_the_barrier_brake_with_full_acceleration() {
    // h = 0: closing at sqrt(2 A clearance).
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[-1.5, 0.0, 0.0, 1.5, 0.0, 0.0]));
    let formation = Formation::points(Rows::from_row_slice(&[20.0, 0.0, 0.0, -20.0, 0.0, 0.0]));
    let closing_m_s = 20.0_f64.sqrt();
    (swarm.velocities_m_s[(0, 0)], swarm.velocities_m_s[(1, 0)]) = (0.5 * closing_m_s, -0.5 * closing_m_s);
    let mut law = law(&formation);
    law.a22_per_s = 0.0;
    let found = command(&mut law, &swarm, &formation).expect("a command");
    assert!((found[(0, 0)] + 5.0).abs() < 1e-9 && (found[(1, 0)] - 5.0).abs() < 1e-9, "{found}");
    // Below delta the law separates the pair. At equal positions the direction of separation is undefined.
    let touching = Swarm::at_rest(&swarm.positions_m * 0.5);
    let found = command(&mut law, &touching, &formation).expect("a command");
    // gamma (2 A 0.5 m)^(3/2) exceeds the acceleration limits.
    assert!((found[(0, 0)] + 5.0).abs() < 1e-9 && (found[(1, 0)] - 5.0).abs() < 1e-9, "{found}");
    let same = Swarm::at_rest(Rows::zeros(2));
    assert!(matches!(command(&mut law, &same, &formation), Err(LawError::Collision { .. })));
}
