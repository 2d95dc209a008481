use proptest::prelude::*;

use super::*;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::CellList;
use tautline_core::swarm::Swarm;

const DELTA_M: f64 = 2.0;
const PARTING_S: f64 = 0.25;

fn obstacle(towards_m: Vector3<f64>) -> VelocityObstacle {
    VelocityObstacle { towards_m, diameter_m: DELTA_M, horizon_s: 2.0, parting_s: PARTING_S }
}

fn keys() -> OrcaKeys {
    OrcaKeys { margin_m: Some(0.0), ..OrcaKeys::default() }
}

fn law(formation: &Formation, keys: OrcaKeys) -> OrcaLaw {
    let links = Graph::complete(formation.count());
    let context = LawContext::new(&links, formation, DELTA_M, 0.3);
    OrcaLaw::new(&context, keys).expect("finite keys")
}

/// Returns the chosen velocities and the commanded accelerations.
fn answer(law: &mut OrcaLaw, swarm: &Swarm, formation: &Formation) -> Result<(Rows, Rows), LawError> {
    let (links, mut near) = (Graph::complete(swarm.count()), CellList::default());
    near.update(&swarm.positions_m, law.tracking.range_m);
    let observation = Observation { near: near.pairs(), ..Observation::exact(swarm, &links, formation) };
    let (mut velocities, mut command) = (Rows::zeros(swarm.count()), Rows::zeros(swarm.count()));
    law.velocities(&observation, &mut velocities)?;
    law.command(&observation, &mut command)?;
    Ok((velocities, command))
}

fn vectors(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

/// Returns the least clearance of the two within the horizon.
fn clearance_m(towards_m: Vector3<f64>, relative_m_s: Vector3<f64>) -> f64 {
    let speed_squared = relative_m_s.norm_squared();
    let closest_s = if speed_squared > 0.0 { towards_m.dot(&relative_m_s) / speed_squared } else { 0.0 };
    (towards_m - relative_m_s * closest_s.clamp(0.0, 2.0)).norm() - DELTA_M
}

#[test]
fn the_nearest_exit_matches_a_hand_calculation() {
    let towards = obstacle(Vector3::new(4.0, 0.0, 0.0));
    let check = |relative: [f64; 3], normal: [f64; 3], depth_m_s: f64| {
        let (found, depth) = towards.nearest_exit(relative.into());
        assert!((found - Vector3::from(normal)).norm() < 1e-12 && (depth - depth_m_s).abs() < 1e-12, "{found} {depth}");
    };
    // The tip: the ball of radius 1 about (2, 0), approached from the near side.
    check([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.0);
    check([1.5, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.5);
    check([0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], -1.0);
    // The lateral surface, at 30 degrees from the line of sight.
    let (sine, cosine) = (0.5, 0.75_f64.sqrt());
    check([3.0, 1.0, 0.0], [-sine, cosine, 0.0], 3.0 * sine - cosine);
    check([3.0, 0.0, -1.0], [-sine, 0.0, -cosine], 3.0 * sine - cosine);
    check([-0.5, 5.0, 0.0], [-sine, cosine, 0.0], -0.5 * sine - 5.0 * cosine);
    // Directly towards the other vehicle: turns left.
    check([3.0, 0.0, 0.0], [-sine, cosine, 0.0], 3.0 * sine);
    // Already too near: out of the ball of radius 8 about (4, 0), within a quarter of a second.
    let (normal, depth_m_s) = obstacle(Vector3::new(1.0, 0.0, 0.0)).nearest_exit(Vector3::zeros());
    assert_eq!((normal, depth_m_s), (-Vector3::x(), 4.0));
}

proptest! {
    #[test]
    fn the_velocity_obstacle_is_the_set_of_too_near_passes_and_its_exit_is_shortest(
        towards_m in vectors(5.0), relative in vectors(4.0), turn in vectors(1.0),
    ) {
        prop_assume!(towards_m.norm() > DELTA_M + 0.01 && turn.norm() > 0.01);
        let (normal, depth_m_s) = obstacle(towards_m).nearest_exit(relative);
        prop_assert!((normal.norm() - 1.0).abs() < 1e-12);
        let clearance = clearance_m(towards_m, relative);
        prop_assert!(clearance.abs() < 1e-9 || (clearance < 0.0) == (depth_m_s > 0.0), "{clearance} {depth_m_s}");
        let at_boundary = clearance_m(towards_m, relative + normal * depth_m_s);
        prop_assert!(at_boundary.abs() < 1e-9, "{at_boundary}");
        let elsewhere = clearance_m(towards_m, relative + turn.normalize() * depth_m_s.abs());
        prop_assert!(elsewhere * depth_m_s <= 1e-9, "{elsewhere} {depth_m_s}");
    }

    #[test]
    fn the_half_spaces_of_a_pair_are_opposite(
        towards_m in vectors(4.0), relative in vectors(4.0), straight in any::<bool>(),
    ) {
        prop_assume!(towards_m.norm() > 0.1);
        let relative = if straight { towards_m * relative.x } else { relative };
        let (normal, depth_m_s) = obstacle(towards_m).nearest_exit(relative);
        let (other, other_depth_m_s) = obstacle(-towards_m).nearest_exit(-relative);
        prop_assert!((normal + other).norm() < 1e-6 && (depth_m_s - other_depth_m_s).abs() < 1e-9);
    }

    #[test]
    fn planar_swarms_get_planar_commands_within_the_limits(numbers in prop::collection::vec(-1.0..1.0_f64, 28)) {
        let formation = Formation::grid(7, 2.5);
        let stirred = |from: usize, size: f64| {
            Rows::from_fn(7, |i, axis| if axis < 2 { size * numbers[from + 2 * i + axis] } else { 0.0 })
        };
        let swarm = Swarm { positions_m: stirred(0, 5.0), velocities_m_s: stirred(14, 2.0) };
        let mut law = law(&formation, keys());
        let (velocities, command) = answer(&mut law, &swarm, &formation)?;
        for i in 0..7 {
            prop_assert_eq!((velocities[(i, 2)], command[(i, 2)]), (0.0, 0.0));
            prop_assert!(row(&velocities, i).norm() <= law.keys.max_speed_m_s * (1.0 + 1e-12));
            prop_assert!(row(&command, i).norm() <= law.keys.max_accel_m_s2 * (1.0 + 1e-12));
        }
    }
}

/// Two vehicles on the x axis, 4 m apart, flying towards each other's position.
fn head_on(speed_m_s: f64) -> (Swarm, Formation) {
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[-2.0, 0.0, 0.0, 2.0, 0.0, 0.0]));
    (swarm.velocities_m_s[(0, 0)], swarm.velocities_m_s[(1, 0)]) = (speed_m_s, -speed_m_s);
    (swarm, Formation::points(Rows::from_row_slice(&[20.0, 0.0, 0.0, -20.0, 0.0, 0.0])))
}

#[test]
fn each_vehicle_of_a_closing_pair_gives_way_by_half() {
    let (swarm, formation) = head_on(0.75);
    let (velocities, command) = answer(&mut law(&formation, keys()), &swarm, &formation).expect("answers");
    // 2 m of clearance in 2 s allow at most 0.5 m/s each; 1 m/s is preferred.
    assert!((velocities[(0, 0)] - 0.5).abs() < 1e-12 && (velocities[(1, 0)] + 0.5).abs() < 1e-12, "{velocities}");
    assert!((command[(0, 0)] - (5.0 * (0.5 - 0.75) - 0.3 * 0.75)).abs() < 1e-12, "{command}");
    let (swarm, formation) = head_on(1.9);
    let (velocities, _) = answer(&mut law(&formation, keys()), &swarm, &formation).expect("answers");
    assert!(velocities[(0, 1)] * velocities[(1, 1)] < 0.0, "fast ones turn to different sides: {velocities}");
}

#[test]
fn only_the_nearest_neighbours_are_considered() {
    // Vehicle 1 blocks vehicle 0; vehicle 2 is nearer, behind vehicle 0.
    let positions_m = Rows::from_row_slice(&[0.0, 0.0, 0.0, 3.0, 0.0, 0.0, -2.5, 0.0, 0.0]);
    let formation =
        Formation::points(&positions_m * 4.0 + Rows::from_fn(3, |_, axis| if axis == 0 { 9.0 } else { 0.0 }));
    let chosen = |neighbours_max| {
        let keys = OrcaKeys { neighbours_max, ..keys() };
        answer(&mut law(&formation, keys), &Swarm::at_rest(positions_m.clone()), &formation).expect("answers").0[(0, 0)]
    };
    assert_eq!(chosen(1), 1.0);
    assert!((chosen(2) - 0.25).abs() < 1e-12, "half of 1 m in 2 s: {}", chosen(2));
}

#[test]
fn vehicles_at_the_same_position_collide() {
    let formation = Formation::line(2, 3.0);
    let found = answer(&mut law(&formation, keys()), &Swarm::at_rest(Rows::zeros(2)), &formation);
    assert_eq!(found, Err(LawError::Collision { pair: Pair::new(0, 1), separation_m: 0.0, delta_m: DELTA_M }));
}
