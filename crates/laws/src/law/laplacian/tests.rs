use std::sync::LazyLock;

use nalgebra::Vector3;

use super::*;
use tautline_core::swarm::{Swarm, row, set_row};

/// Relative rounding of sums over a few dozen edges.
const ROUNDING: f64 = 1e-13;

/// Returns an exact observation. The law uses its own graph, so the graph given here is empty.
fn exact<'a>(swarm: &'a Swarm, formation: &'a Formation) -> Observation<'a> {
    static NO_GRAPH: LazyLock<Graph> = LazyLock::new(|| Graph::complete(0));
    Observation::exact(swarm, &NO_GRAPH, formation)
}

fn laplacian(graph: &Graph, formation: &Formation, f1: f64, f2: f64) -> Result<LaplacianLaw, ParameterError> {
    let keys = LaplacianKeys { f1_per_s2: f1, f2_per_s: Some(f2) };
    LaplacianLaw::new(&LawContext::new(graph, formation, 1.0, 0.1), keys)
}

fn swarm(count: usize) -> Swarm {
    let wave = |phase: f64| Rows::from_fn(count, |i, axis| (1.7 * i as f64 + 0.6 * axis as f64 + phase).sin() * 4.0);
    Swarm { positions_m: wave(0.0), velocities_m_s: wave(1.0) }
}

#[test]
fn the_control_is_the_sum_over_the_neighbours() -> Result<(), Box<dyn std::error::Error>> {
    let (f1, f2) = (0.8, 1.3);
    for graph in [Graph::complete(9), Graph::star(9), Graph::ring(9), Graph::path(9)] {
        let (formation, swarm) = (Formation::grid(9, 2.0), swarm(9));
        let mut expected = Rows::zeros(9);
        for (i, j) in graph.edges() {
            for (i, j) in [(i, j), (j, i)] {
                let error = |i| row(&swarm.positions_m, i) - row(&formation.slots_m, i);
                let velocity = |i| row(&swarm.velocities_m_s, i);
                let pull: Vector3<f64> = (error(i) - error(j)) * f1 + (velocity(i) - velocity(j)) * f2;
                let sum = row(&expected, i) - pull / 9.0;
                set_row(&mut expected, i, sum);
            }
        }
        let mut control = Rows::from_element(9, f64::NAN);
        laplacian(&graph, &formation, f1, f2)?.command(&exact(&swarm, &formation), &mut control)?;
        assert!((control - &expected).amax() <= ROUNDING * expected.amax(), "{graph:?}");
    }
    Ok(())
}

#[test]
fn the_default_gain_on_velocities_is_not_negative() {
    let default = |a22_per_s: f64| LaplacianKeys::default().complete(a22_per_s).f2_per_s;
    assert_eq!([0.1, -1.0, -1.5].map(default), [Some(1.1), Some(0.0), Some(0.0)]);
    assert_eq!(LaplacianKeys { f2_per_s: Some(2.0), ..LaplacianKeys::default() }.complete(-9.0).f2_per_s, Some(2.0));
}

#[test]
fn at_the_slots_with_a_common_velocity_the_command_is_zero() -> Result<(), Box<dyn std::error::Error>> {
    let formation = Formation::pentagon(3.0);
    let mut swarm = Swarm::at_rest(formation.slots_m.clone());
    swarm.velocities_m_s.fill(2.5);
    swarm.positions_m.add_scalar_mut(8.0);
    let mut control = Rows::zeros(5);
    let mut law = laplacian(&Graph::complete(5), &formation, 1.0, 1.1)?;
    law.command(&exact(&swarm, &formation), &mut control)?;
    assert!(control.amax() < ROUNDING);
    assert!(law.energy(&exact(&swarm, &formation)).unwrap_or(f64::NAN) < ROUNDING);
    Ok(())
}

#[test]
fn the_certificate_is_void_and_the_energy_exists_on_the_complete_graph() -> Result<(), ParameterError> {
    let (formation, swarm) = (Formation::grid(6, 2.0), swarm(6));
    let law = |graph: &Graph, f1| laplacian(graph, &formation, f1, 1.1);
    let certificate = law(&Graph::complete(6), 1.0)?.certificate(&exact(&swarm, &formation), &[]);
    assert_eq!((certificate.certified_m, certificate.void), (None, vec![VoidReason::NoBarrier]));
    assert!(certificate.energy_initial.is_some_and(|energy| energy > 0.0));
    assert_eq!(law(&Graph::complete(6), -1.0)?.energy(&exact(&swarm, &formation)), None);
    assert_eq!(law(&Graph::ring(6), 1.0)?.energy(&exact(&swarm, &formation)), None);
    assert_eq!(law(&Graph::complete(6), 1.0)?.capabilities().barrier_m, None);
    Ok(())
}

#[test]
fn wrong_input_is_refused() -> Result<(), ParameterError> {
    let formation = Formation::pentagon(3.0);
    let complete = Graph::complete(5);
    let refusal = |graph: &Graph, f1, f2| laplacian(graph, &formation, f1, f2).err();
    assert_eq!(refusal(&Graph::complete(4), 1.0, 1.0), Some(ParameterError::Counts { graph: 4, formation: 5 }));
    assert!(matches!(refusal(&complete, f64::NAN, 1.0), Some(ParameterError::NotFinite { name: "f1", .. })));
    assert!(matches!(refusal(&complete, 1.0, f64::INFINITY), Some(ParameterError::NotFinite { name: "f2", .. })));
    let mut law = laplacian(&complete, &formation, 10.0, 1.0)?;
    let mut control = Rows::zeros(5);
    let mut swarm = swarm(5);
    assert_eq!(
        law.command(&exact(&swarm, &formation), &mut Rows::zeros(3)),
        Err(LawError::WrongCount { expected: 5, found: 3 })
    );
    swarm.positions_m[(0, 0)] = 1e308;
    swarm.positions_m[(1, 0)] = -1e308;
    swarm.positions_m[(2, 0)] = 1e308;
    assert_eq!(law.command(&exact(&swarm, &formation), &mut control), Err(LawError::OutOfRange));
    assert_eq!(law.energy(&exact(&swarm, &formation)), None);
    swarm.velocities_m_s[(3, 1)] = f64::NAN;
    assert_eq!(law.command(&exact(&swarm, &formation), &mut control), Err(LawError::NotFinite { vehicle: 3 }));
    Ok(())
}
