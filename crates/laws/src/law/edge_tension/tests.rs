use std::sync::LazyLock;

use nalgebra::Vector3;

use super::*;
use tautline_core::swarm::{row, set_row};

/// Precision of E(0) in the reference cases.
const ENERGY_TOLERANCE: f64 = 1e-7;
/// Precision of the certified separation in the reference cases \[m\].
const CERTIFIED_TOLERANCE_M: f64 = 1e-6;
/// Precision of the control at the start in the reference cases \[m/s^2\].
const CONTROL_TOLERANCE_M_S2: f64 = 1e-9;

const A22_PER_S: f64 = 0.1;

/// Returns the pentagon start: from left to right vehicles 4, 1, 3, 2, 5 at a spacing of 3 m, with a zigzag of 0.05 m.
fn pentagon_start() -> Swarm {
    let mut positions_m = Rows::zeros(5);
    for (place, vehicle) in [3, 0, 2, 1, 4].into_iter().enumerate() {
        let y = if place % 2 == 0 { 0.05 } else { -0.05 };
        set_row(&mut positions_m, vehicle, Vector3::new(3.0 * place as f64, y, 0.0));
    }
    Swarm::at_rest(positions_m)
}

/// Returns an exact observation. The law uses its own graph and formation, so those given here are empty.
fn exact(swarm: &Swarm) -> Observation<'_> {
    static NO_GRAPH: LazyLock<Graph> = LazyLock::new(|| Graph::complete(0));
    static NO_FORMATION: LazyLock<Formation> = LazyLock::new(|| Formation::line(0, 1.0));
    Observation::exact(swarm, &NO_GRAPH, &NO_FORMATION)
}

fn law(graph: &Graph, formation: &Formation, delta_m: f64) -> EdgeTensionLaw {
    let context = LawContext::new(graph, formation, delta_m, A22_PER_S);
    EdgeTensionLaw::new(&context, EdgeTensionKeys::default()).expect("slots farther apart than delta")
}

fn pentagon_law() -> EdgeTensionLaw {
    law(&Graph::complete(5), &Formation::pentagon(3.0), 2.0)
}

#[test]
fn the_pentagon_start_has_the_reference_energy_certificate_and_control() -> Result<(), LawError> {
    let (mut law, start) = (pentagon_law(), pentagon_start());
    let certificate = law.certificate(&exact(&start), &[]);
    assert_eq!(certificate.void, []);
    assert!((certificate.energy_initial.unwrap_or(f64::NAN) - 3.656_742_96).abs() < ENERGY_TOLERANCE);
    assert!((certificate.certified_m.unwrap_or(f64::NAN) - 2.055_307).abs() < CERTIFIED_TOLERANCE_M);
    let mut control = Rows::zeros(5);
    law.command(&exact(&start), &mut control)?;
    let error = row(&control, 0) - Vector3::new(0.860_843_123, -0.021_225_585, 0.0);
    assert!(error.amax() < CONTROL_TOLERANCE_M_S2, "{error}");
    assert!(control.column(2).iter().all(|&z| z == 0.0));
    Ok(())
}

#[test]
fn the_circle_start_has_the_reference_energy_and_certificate() {
    let positions_m = Rows::from_fn(6, |i, axis| [2.0 * i as f64, if i == 0 { 0.05 } else { 0.0 }, 0.0][axis]);
    let certificate = law(&Graph::complete(6), &Formation::circle(6, 1.5), 1.0)
        .certificate(&exact(&Swarm::at_rest(positions_m)), &[]);
    assert_eq!(certificate.void, []);
    assert!((certificate.energy_initial.unwrap_or(f64::NAN) - 4.479_772_16).abs() < ENERGY_TOLERANCE);
    assert!((certificate.certified_m.unwrap_or(f64::NAN) - 1.019_476).abs() < CERTIFIED_TOLERANCE_M);
}

#[test]
fn the_certificate_is_the_smallest_root_over_all_pairs() {
    let (law, mut start, formation) = (pentagon_law(), pentagon_start(), Formation::pentagon(3.0));
    start.velocities_m_s[(2, 1)] = 1.5;
    let certificate = law.certificate(&exact(&start), &[]);
    let bound = 5.0 * certificate.energy_initial.unwrap_or(f64::NAN);
    let smallest = Graph::complete(5)
        .edges()
        .filter_map(|(i, j)| EdgeTension::new(1.0, 2.0, formation.desired_distance(i, j)).ok())
        .map(|tension| tension.push_side_root(bound))
        .fold(f64::INFINITY, f64::min);
    assert_eq!(certificate.certified_m, Some(smallest));
    let at_rest = law.certificate(&exact(&pentagon_start()), &[]);
    assert!(certificate.certified_m < at_rest.certified_m);
}

#[test]
fn a_void_certificate_lists_its_reasons() {
    let (graph, formation) = (Graph::ring(5), Formation::pentagon(3.0));
    let on_ring = law(&graph, &formation, 2.0).certificate(&exact(&pentagon_start()), &[]);
    assert_eq!((on_ring.certified_m, on_ring.void), (None, vec![VoidReason::GraphNotComplete]));
    assert!(on_ring.energy_initial.is_some());

    let mut touching = pentagon_start();
    touching.positions_m[(1, 0)] -= 1.5;
    let certificate = law(&graph, &formation, 2.0).certificate(&exact(&touching), &[]);
    assert_eq!(certificate.void.len(), 2);
    let certificate = pentagon_law().certificate(&exact(&touching), &[]);
    assert_eq!((certificate.certified_m, certificate.energy_initial), (None, None));
    assert!(matches!(certificate.void[..], [VoidReason::StartRefused(LawError::Collision { .. })]));
}

#[test]
fn at_the_formation_the_command_is_zero_up_to_rounding() -> Result<(), LawError> {
    let formation = Formation::sphere(40, 5.0);
    let mut law = law(&Graph::complete(40), &formation, 0.5);
    let mut control = Rows::zeros(40);
    let swarm = Swarm::at_rest(formation.slots_m.clone());
    law.command(&exact(&swarm), &mut control)?;
    assert!(control.amax() < 1e-14, "{:e}", control.amax());
    assert!(law.energy(&exact(&swarm)).unwrap_or(f64::NAN).abs() < 1e-14);
    Ok(())
}

#[test]
fn a_pair_at_delta_collides_and_one_ulp_farther_does_not() {
    let mut law = law(&Graph::complete(2), &Formation::line(2, 3.0), 2.0);
    let mut control = Rows::zeros(2);
    for (distance, collides) in [(2.0_f64.next_down(), true), (2.0, true), (2.0_f64.next_up(), false)] {
        let swarm = Swarm::at_rest(Formation::line(2, distance).slots_m);
        let expected = LawError::Collision { pair: Pair::new(0, 1), separation_m: distance, delta_m: 2.0 };
        assert_eq!(law.command(&exact(&swarm), &mut control), if collides { Err(expected) } else { Ok(()) });
        assert_eq!(law.matrix_form(&swarm).err(), collides.then_some(expected));
        assert_eq!(law.energy(&exact(&swarm)).is_none(), collides);
    }
}

#[test]
fn the_first_of_several_collisions_is_reported() {
    for count in [8, 40] {
        let formation = Formation::line(count, 3.0);
        let mut swarm = Swarm::at_rest(formation.slots_m.clone());
        swarm.positions_m[(4, 0)] = swarm.positions_m[(6, 0)] - 0.5;
        swarm.positions_m[(2, 0)] = swarm.positions_m[(7, 0)] + 0.75;
        let error = law(&Graph::complete(count), &formation, 2.0).command(&exact(&swarm), &mut Rows::zeros(count));
        assert_eq!(error, Err(LawError::Collision { pair: Pair::new(2, 7), separation_m: 0.75, delta_m: 2.0 }));
    }
}

#[test]
fn states_that_are_not_finite_or_of_another_swarm_are_refused() {
    let (mut law, start) = (pentagon_law(), pentagon_start());
    let mut control = Rows::zeros(5);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for vehicle in 0..5 {
            for axis in 0..3 {
                let (mut lost, mut fast) = (start.clone(), start.clone());
                lost.positions_m[(vehicle, axis)] = bad;
                fast.velocities_m_s[(vehicle, axis)] = bad;
                for swarm in [lost, fast] {
                    assert_eq!(law.command(&exact(&swarm), &mut control), Err(LawError::NotFinite { vehicle }));
                    assert_eq!(law.matrix_form(&swarm), Err(LawError::NotFinite { vehicle }));
                    assert_eq!(law.energy(&exact(&swarm)), None);
                    assert_eq!(
                        law.certificate(&exact(&swarm), &[]).void,
                        [VoidReason::StartRefused(LawError::NotFinite { vehicle })]
                    );
                }
            }
        }
    }
    let wrong = LawError::WrongCount { expected: 5, found: 4 };
    assert_eq!(law.command(&exact(&Swarm::at_rest(Rows::zeros(4))), &mut control), Err(wrong));
    assert_eq!(law.command(&exact(&start), &mut Rows::zeros(4)), Err(wrong));
    let ragged = Swarm { velocities_m_s: Rows::zeros(4), ..start };
    assert_eq!(law.command(&exact(&ragged), &mut control), Err(wrong));
}

#[test]
fn states_beyond_double_precision_are_refused() {
    let (mut law, mut control) = (pentagon_law(), Rows::zeros(5));
    for (position, velocity) in [(1e200, 0.0), (1e308, 0.0), (0.0, 1.7e308)] {
        let mut swarm = pentagon_start();
        swarm.positions_m[(0, 0)] += position;
        swarm.positions_m[(1, 0)] -= position;
        swarm.velocities_m_s[(0, 0)] = velocity;
        swarm.velocities_m_s[(1, 0)] = -velocity;
        assert_eq!(law.command(&exact(&swarm), &mut control), Err(LawError::OutOfRange), "{position:e} {velocity:e}");
        assert_eq!(law.matrix_form(&swarm), Err(LawError::OutOfRange), "{position:e} {velocity:e}");
        assert_eq!(law.energy(&exact(&swarm)), None);
    }
}

#[test]
fn parameters_without_a_law_are_refused() {
    let refusal = |graph: &Graph, formation: &Formation, a22_per_s| {
        EdgeTensionLaw::new(&LawContext::new(graph, formation, 2.0, a22_per_s), EdgeTensionKeys::default()).err()
    };
    let (complete, line) = (Graph::complete(4), Formation::line(4, 1.5));
    let rest = TensionError::Rest { rest_m: 1.5, delta_m: 2.0 };
    assert_eq!(refusal(&complete, &line, 0.0), Some(ParameterError::Tension { pair: Pair::new(0, 1), source: rest }));
    let apart = Graph::from_edges(4, &[(0, 2), (1, 3)]).expect("a simple graph");
    assert_eq!(refusal(&apart, &line, 0.0), None);
    assert_eq!(refusal(&Graph::complete(5), &line, 0.0), Some(ParameterError::Counts { graph: 5, formation: 4 }));
    assert_eq!(
        refusal(&apart, &line, f64::INFINITY),
        Some(ParameterError::NotFinite { name: "a22", value: f64::INFINITY })
    );
    let lost = Formation::points(Rows::from_element(4, f64::NAN));
    assert_eq!(refusal(&apart, &lost, 0.0), Some(ParameterError::Slot { vehicle: 0 }));
}

#[test]
fn a_swarm_without_pairs_gets_zero_commands() -> Result<(), LawError> {
    for count in 0..2 {
        let mut law = law(&Graph::complete(count), &Formation::line(count, 3.0), 2.0);
        let mut swarm = Swarm::at_rest(Rows::zeros(count));
        swarm.velocities_m_s.fill(3.0);
        let mut control = Rows::from_element(count, 1.0);
        law.command(&exact(&swarm), &mut control)?;
        assert_eq!((control.amax(), law.energy(&exact(&swarm))), (0.0, Some(0.0)));
        let expected = Certificate { energy_initial: Some(0.0), ..Certificate::default() };
        assert_eq!(law.certificate(&exact(&swarm), &[]), expected);
    }
    Ok(())
}
