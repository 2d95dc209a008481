//! Properties of the laws for every swarm, shape and graph.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;
use proptest::test_runner::TestCaseResult;
use tautline_core::swarm::{Rows, Swarm, row, separation, set_row};
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::law::{
    EdgeTension, EdgeTensionKeys, EdgeTensionLaw, LaplacianKeys, LaplacianLaw, Law, LawContext, LawError,
};
use tautline_laws::observation::Observation;
use tautline_laws::space::closest_pair;

const ALPHA: f64 = 1.3;
const DELTA_M: f64 = 0.4;
const F1_PER_S2: f64 = 0.9;

/// Clearance of every start \[m\]. Near the barrier V'' grows as the inverse cube of the clearance, and with it the
/// effect of rounding of positions.
const CLEARANCE_M: f64 = 0.1;
/// Largest coordinate of a start \[m\]: positions are rounded to 1e-15 m.
const EXTENT_M: f64 = 4.0;
/// Rounding of a control relative to its largest terms (see [`Case::scale`]): sums of at most 40 terms.
const ROUNDING: f64 = 1e-13;
/// Relative error of a control after a transformation of positions. Positions are rounded to 1e-15 m; the steep
/// barrier magnifies this by at most 1000 over the clearance.
const MOVED_ROUNDING: f64 = 1e-12 / CLEARANCE_M;
/// Relative error of a central difference of the energy, at the step of [`rate_of_energy`].
const DIFFERENCE: f64 = 1e-6;

/// Swarm with a formation and the a22 of its plant.
#[derive(Clone, Debug)]
struct Case {
    formation: Formation,
    swarm: Swarm,
    a22_per_s: f64,
}

impl Case {
    fn edge_tension(&self, graph: &Graph) -> Result<EdgeTensionLaw, TestCaseError> {
        let context = LawContext::new(graph, &self.formation, DELTA_M, self.a22_per_s);
        EdgeTensionLaw::new(&context, EdgeTensionKeys { alpha: ALPHA }).map_err(fail)
    }

    fn laplacian(&self, graph: &Graph) -> Result<LaplacianLaw, TestCaseError> {
        let context = LawContext::new(graph, &self.formation, DELTA_M, self.a22_per_s);
        LaplacianLaw::new(&context, LaplacianKeys { f1_per_s2: F1_PER_S2, f2_per_s: None }).map_err(fail)
    }

    /// Returns the size of the terms in a control: the largest pull of an edge, the extent and the largest velocity.
    fn scale(&self, graph: &Graph) -> f64 {
        let pull = |(i, j)| {
            let tension = EdgeTension::new(ALPHA, DELTA_M, self.formation.desired_distance(i, j));
            tension.map_or(0.0, |tension| tension.derivative(separation(&self.swarm.positions_m, i, j)).abs())
        };
        graph.edges().map(pull).fold(1.0, f64::max) + EXTENT_M + self.swarm.velocities_m_s.amax()
    }
}

fn fail(error: impl std::fmt::Display) -> TestCaseError {
    TestCaseError::fail(error.to_string())
}

fn table(count: usize, values: &[f64]) -> Rows {
    Rows::from_fn(count, |i, axis| values[3 * i + axis])
}

/// Generates 2 to 40 vehicles, which covers both layouts of the edge sum, with slots and positions clear of delta.
fn cases() -> impl Strategy<Value = Case> {
    let clear = |rows: &Rows| closest_pair(rows).is_none_or(|(_, distance_m)| distance_m > DELTA_M + CLEARANCE_M);
    prop_oneof![2..9_usize, 23..27_usize, Just(40_usize)]
        .prop_flat_map(|count| {
            let numbers = move |size: f64| prop::collection::vec(-size..size, 3 * count);
            // Points near an even distribution are rarely too close, so few cases are rejected.
            let spread = move |jitter_m: f64| {
                let even = Formation::sphere(count, 3.0).slots_m;
                numbers(jitter_m).prop_map(move |noise| &even + table(count, &noise))
            };
            (spread(0.2), spread(0.4), numbers(2.0), -0.5..0.5)
        })
        .prop_map(|(slots_m, positions_m, velocities, a22_per_s)| {
            let velocities_m_s = table(slots_m.nrows(), &velocities);
            let formation = Formation::points(scattered(&slots_m));
            Case { formation, swarm: Swarm { positions_m, velocities_m_s }, a22_per_s }
        })
        .prop_filter("too close", move |case| clear(&case.swarm.positions_m) && clear(&case.formation.slots_m))
}

/// Permutes the slots, so that edges both pull and push.
fn scattered(slots_m: &Rows) -> Rows {
    let count = slots_m.nrows();
    let coprime = |step: &usize| (2..=*step).all(|d| !step.is_multiple_of(d) || !count.is_multiple_of(d));
    let step = (count.div_ceil(2)..count).find(coprime).unwrap_or(1);
    permuted(slots_m, &(0..count).map(|i| i * step % count).collect::<Vec<_>>())
}

/// Returns the complete graph, a star, and the graph of the edges selected by `keep`.
fn graphs(count: usize, keep: &[bool]) -> Result<[Graph; 3], TestCaseError> {
    let complete = Graph::complete(count);
    let kept = complete.edges().zip(keep.iter().cycle()).filter(|(_, keep)| **keep);
    let picked = Graph::from_edges(count, &kept.map(|(edge, _)| edge).collect::<Vec<_>>()).map_err(fail)?;
    Ok([complete, Graph::star(count), picked])
}

fn keep() -> impl Strategy<Value = Vec<bool>> {
    prop::collection::vec(any::<bool>(), 1..97)
}

fn isometries() -> impl Strategy<Value = Matrix3<f64>> {
    ([-TAU..TAU, -TAU..TAU, -TAU..TAU], any::<bool>()).prop_map(|([roll, pitch, yaw], reflect)| {
        let mirror = Vector3::new(1.0, if reflect { -1.0 } else { 1.0 }, 1.0);
        Rotation3::from_euler_angles(roll, pitch, yaw).matrix() * Matrix3::from_diagonal(&mirror)
    })
}

/// Returns an observation without imperfections.
fn exact<'a>(swarm: &'a Swarm, formation: &'a Formation) -> Observation<'a> {
    static NO_LINKS: LazyLock<Graph> = LazyLock::new(|| Graph::complete(0));
    Observation::exact(swarm, &NO_LINKS, formation)
}

fn control_of(law: &mut dyn Law, swarm: &Swarm, formation: &Formation) -> Result<Rows, TestCaseError> {
    let mut control = Rows::from_element(swarm.count(), f64::NAN);
    law.command(&exact(swarm, formation), &mut control).map_err(fail)?;
    Ok(control)
}

fn turned(rows: &Rows, isometry: &Matrix3<f64>) -> Rows {
    rows * isometry.transpose()
}

fn translated(rows: &Rows, by: Vector3<f64>) -> Rows {
    let mut moved = rows.clone();
    for i in 0..rows.nrows() {
        set_row(&mut moved, i, row(rows, i) + by);
    }
    moved
}

/// Permutes rows: row i of the result is row `order[i]` of the table.
fn permuted(rows: &Rows, order: &[usize]) -> Rows {
    Rows::from_fn(rows.nrows(), |i, axis| rows[(order[i], axis)])
}

/// Returns the derivative of the law's energy along p' = v, v' = a22 v + u, by a central difference.
fn rate_of_energy(law: &mut dyn Law, case: &Case) -> Result<f64, TestCaseError> {
    const STEP_S: f64 = 1e-6;
    let Case { formation, swarm, a22_per_s } = case;
    let acceleration = control_of(law, swarm, formation)? + &swarm.velocities_m_s * *a22_per_s;
    let energy_at = |time_s: f64| {
        let positions_m = &swarm.positions_m + &swarm.velocities_m_s * time_s;
        let velocities_m_s = &swarm.velocities_m_s + &acceleration * time_s;
        law.energy(&exact(&Swarm { positions_m, velocities_m_s }, formation)).ok_or_else(|| fail("no energy"))
    };
    Ok((energy_at(STEP_S)? - energy_at(-STEP_S)?) / (2.0 * STEP_S))
}

/// Returns `sum |v_i - mean v|^2`.
fn relative_speeds_squared(swarm: &Swarm) -> f64 {
    let mean = swarm.mean_velocity_m_s();
    (0..swarm.count()).map(|i| (row(&swarm.velocities_m_s, i) - mean).norm_squared()).sum()
}

/// Checks `dE/dt = -sum |v_i - mean v|^2` on the complete graph, for any law with an energy.
fn energy_falls_by_the_relative_speeds_squared(law: &mut dyn Law, case: &Case) -> TestCaseResult {
    let found = rate_of_energy(law, case)?;
    let expected = -relative_speeds_squared(&case.swarm);
    prop_assert!((found - expected).abs() <= allowed_rate_error(case), "{found} and {expected}");
    Ok(())
}

fn allowed_rate_error(case: &Case) -> f64 {
    DIFFERENCE * case.scale(&Graph::complete(case.swarm.count())) * (1.0 + relative_speeds_squared(&case.swarm))
}

/// Negative control: the edge-tension law with the sign of its tension flipped, which the energy check must reject.
#[derive(Clone)]
struct Flipped(EdgeTensionLaw);

impl Law for Flipped {
    fn name(&self) -> &'static str {
        "flipped"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        let mut tension = Rows::zeros(at.own.count());
        let at_rest = Swarm::at_rest(at.own.positions_m.clone());
        self.0.command(&Observation { own: &at_rest, ..*at }, &mut tension)?;
        self.0.command(at, command)?;
        *command -= tension * 2.0;
        Ok(())
    }

    fn energy(&self, at: &Observation<'_>) -> Option<f64> {
        self.0.energy(at)
    }
}

proptest! {
    #[test]
    fn the_control_does_not_accelerate_the_centre_of_mass(case in cases(), keep in keep()) {
        for graph in graphs(case.swarm.count(), &keep)? {
            let allowed = ROUNDING * case.scale(&graph) * case.swarm.count() as f64;
            let laws: [&mut dyn Law; 2] = [&mut case.edge_tension(&graph)?, &mut case.laplacian(&graph)?];
            for law in laws {
                let net = control_of(law, &case.swarm, &case.formation)?.row_sum();
                prop_assert!(net.amax() <= allowed, "{}: {net}", law.name());
            }
        }
    }

    #[test]
    fn the_matrix_form_equals_the_sum_over_the_edges(case in cases(), keep in keep()) {
        for graph in graphs(case.swarm.count(), &keep)? {
            let mut law = case.edge_tension(&graph)?;
            let matrix = law.matrix_form(&case.swarm).map_err(fail)?;
            let difference = (control_of(&mut law, &case.swarm, &case.formation)? - matrix).amax();
            prop_assert!(difference <= ROUNDING * case.scale(&graph), "{difference:e}");
        }
    }

    #[test]
    fn the_control_commutes_with_rotations_and_reflections(case in cases(), keep in keep(), isometry in isometries()) {
        let turned_case = Case {
            formation: Formation::points(turned(&case.formation.slots_m, &isometry)),
            swarm: Swarm {
                positions_m: turned(&case.swarm.positions_m, &isometry),
                velocities_m_s: turned(&case.swarm.velocities_m_s, &isometry),
            },
            ..case.clone()
        };
        for graph in graphs(case.swarm.count(), &keep)? {
            let allowed = MOVED_ROUNDING * case.scale(&graph);
            let control = control_of(&mut case.edge_tension(&graph)?, &case.swarm, &case.formation)?;
            let expected = turned(&control, &isometry);
            // The edge-tension law depends only on distances, so its formation need not be rotated.
            for mut law in [case.edge_tension(&graph)?, turned_case.edge_tension(&graph)?] {
                let difference = (control_of(&mut law, &turned_case.swarm, &turned_case.formation)? - &expected).amax();
                prop_assert!(difference <= allowed, "{difference:e}");
            }
            let expected = turned(&control_of(&mut case.laplacian(&graph)?, &case.swarm, &case.formation)?, &isometry);
            let found = control_of(&mut turned_case.laplacian(&graph)?, &turned_case.swarm, &turned_case.formation)?;
            prop_assert!((found - expected).amax() <= allowed);
        }
    }

    #[test]
    fn the_control_is_invariant_under_translations_and_common_velocities(
        case in cases(), keep in keep(), by in [-9.0..9.0, -9.0..9.0, -9.0..9.0],
    ) {
        let swarm = Swarm {
            positions_m: translated(&case.swarm.positions_m, by.into()),
            velocities_m_s: translated(&case.swarm.velocities_m_s, Vector3::from(by) * -0.5),
        };
        for graph in graphs(case.swarm.count(), &keep)? {
            let laws: [&mut dyn Law; 2] = [&mut case.edge_tension(&graph)?, &mut case.laplacian(&graph)?];
            for law in laws {
                let formation = &case.formation;
                let expected = control_of(law, &case.swarm, formation)?;
                let difference = (control_of(law, &swarm, formation)? - expected).amax();
                prop_assert!(difference <= MOVED_ROUNDING * case.scale(&graph), "{difference:e}");
            }
        }
    }

    #[test]
    fn the_control_commutes_with_permutations_of_vehicles(
        (case, order) in cases().prop_flat_map(|case| {
            let order = Just((0..case.swarm.count()).collect::<Vec<_>>()).prop_shuffle();
            (Just(case), order)
        }),
        keep in keep(),
    ) {
        let relabelled = Case {
            formation: Formation::points(permuted(&case.formation.slots_m, &order)),
            swarm: Swarm {
                positions_m: permuted(&case.swarm.positions_m, &order),
                velocities_m_s: permuted(&case.swarm.velocities_m_s, &order),
            },
            ..case.clone()
        };
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(i, &old)| place[old] = i);
        for graph in graphs(case.swarm.count(), &keep)? {
            let edges: Vec<_> = graph.edges().map(|(i, j)| (place[i], place[j])).collect();
            let relabelled_graph = Graph::from_edges(order.len(), &edges).map_err(fail)?;
            let pairs: [(&mut dyn Law, &mut dyn Law); 2] = [
                (&mut case.edge_tension(&graph)?, &mut relabelled.edge_tension(&relabelled_graph)?),
                (&mut case.laplacian(&graph)?, &mut relabelled.laplacian(&relabelled_graph)?),
            ];
            for (law, relabelled_law) in pairs {
                let expected = permuted(&control_of(law, &case.swarm, &case.formation)?, &order);
                let found = control_of(relabelled_law, &relabelled.swarm, &relabelled.formation)?;
                let difference = (found - expected).amax();
                prop_assert!(difference <= ROUNDING * case.scale(&graph), "{difference:e}");
            }
        }
    }

    #[test]
    fn on_the_complete_graph_the_energy_falls_by_the_relative_speeds_squared(case in cases()) {
        let graph = Graph::complete(case.swarm.count());
        energy_falls_by_the_relative_speeds_squared(&mut case.edge_tension(&graph)?, &case)?;
        // The rate is a22 - f2, which is -1 for the gain f2 = 1 + a22 of the source.
        energy_falls_by_the_relative_speeds_squared(&mut case.laplacian(&graph)?, &case)?;
    }

    #[test]
    fn with_the_sign_of_the_tension_flipped_the_energy_check_fails(case in cases()) {
        let graph = Graph::complete(case.swarm.count());
        let at_rest = Swarm::at_rest(case.swarm.positions_m.clone());
        let tension = control_of(&mut case.edge_tension(&graph)?, &at_rest, &case.formation)?;
        // Flipping the tension changes the rate by twice its power, which must exceed the tolerance of the check.
        prop_assume!(tension.dot(&case.swarm.velocities_m_s).abs() > allowed_rate_error(&case));
        let flipped = &mut Flipped(case.edge_tension(&graph)?);
        prop_assert!(energy_falls_by_the_relative_speeds_squared(flipped, &case).is_err());
    }

    #[test]
    fn on_any_graph_the_energy_falls_at_least_at_the_rate_of_its_connectivity(case in cases(), keep in keep()) {
        for graph in graphs(case.swarm.count(), &keep)? {
            let (count, a22) = (case.swarm.count() as f64, case.a22_per_s);
            let rate = (1.0 + a22) * graph.algebraic_connectivity() / count - a22;
            let found = rate_of_energy(&mut case.edge_tension(&graph)?, &case)?;
            let bound = -rate * relative_speeds_squared(&case.swarm);
            prop_assert!(found <= bound + allowed_rate_error(&case), "{found} above {bound}");
        }
    }

    #[test]
    fn the_certified_separation_lies_between_delta_and_the_start(case in cases()) {
        let law = case.edge_tension(&Graph::complete(case.swarm.count()))?;
        let certificate = law.certificate(&exact(&case.swarm, &case.formation), &[]);
        prop_assert!(certificate.void.is_empty());
        let certified_m = certificate.certified_m.ok_or_else(|| fail("nothing certified"))?;
        let closest_m = closest_pair(&case.swarm.positions_m).map_or(f64::NAN, |(_, distance_m)| distance_m);
        prop_assert!(DELTA_M < certified_m && certified_m <= closest_m, "{certified_m} {closest_m}");
    }
}
