//! The law (8) at single instants: its matrix form, its sum, and what it does to the energy.

use super::claim::{Claim, Kind};
use super::flights::{relative_speed_squared, relative_velocities};
use super::interface::{Judged, Progress, Untried};
use super::starts::{DELTA_M, random_starts};
use crate::formation::Formation;
use crate::graph::Graph;
use crate::law::{EdgeTension, EdgeTensionLaw, EdgeTensionParameters, LaplacianLaw, Law as _};
use crate::observation::Observation;
use crate::swarm::{Rows, Swarm, mean_row, row, set_row};
use crate::text::bound;

/// Random states that each claim is tried on; every one with each kind of graph.
const STATES: usize = 200;
const SEED: u64 = 1;
/// Sums of up to 8 vectors, each rounded a few times.
const ROUNDING: f64 = 1e-13;
const SUM: &str = "rounding of sums of up to 8 terms, relative to the largest";
/// Values of a22 \[1/s\] that a state is tried with.
const A22_PER_S: [f64; 3] = [-0.5, 0.0, 0.1];

pub(super) fn judge(progress: &Progress<'_>) -> Judged {
    let states = states()?;
    let claims = vec![
        matrix_form(&states)?,
        zero_sum(&states)?,
        energy_rate(&states)?,
        energy_rate_on_graphs(&states)?,
        literal_baseline()?,
    ];
    progress(1);
    Ok(claims)
}

/// A state, and the law for it.
struct State {
    swarm: Swarm,
    graph: Graph,
    formation: Formation,
    parameters: EdgeTensionParameters,
}

impl State {
    fn law(&self) -> Result<EdgeTensionLaw, Untried> {
        Ok(EdgeTensionLaw::new(&self.graph, &self.formation, self.parameters)?)
    }

    fn control(&self) -> Result<Rows, Untried> {
        let mut control = Rows::zeros(self.swarm.count());
        self.law()?.command(&Observation::exact(&self.swarm, &self.graph, &self.formation), &mut control)?;
        Ok(control)
    }

    /// dE/dt at this state, from E alone: the sum of v~ v~' + (1/N) grad V v, with the gradient taken edge by edge from
    /// [`EdgeTension`]; and the sum of the sizes of its terms.
    fn energy_rate(&self) -> Result<(f64, f64), Untried> {
        let (swarm, count) = (&self.swarm, self.swarm.count() as f64);
        let control = self.control()?;
        let accelerations = swarm.velocities_m_s.clone() * self.parameters.a22_per_s + control;
        let mut terms: Vec<f64> =
            relative_velocities(swarm).enumerate().map(|(i, v)| v.dot(&row(&accelerations, i))).collect();
        for (i, j) in self.graph.edges() {
            let EdgeTensionParameters { alpha, delta_m, .. } = self.parameters;
            let tension = EdgeTension::new(alpha, delta_m, self.formation.desired_distance(i, j))?;
            let offset = row(&swarm.positions_m, i) - row(&swarm.positions_m, j);
            let closing = row(&swarm.velocities_m_s, i) - row(&swarm.velocities_m_s, j);
            let distance_m = offset.norm();
            terms.push(tension.derivative(distance_m) * offset.dot(&closing) / distance_m / count);
        }
        Ok((terms.iter().sum(), terms.iter().map(|term| term.abs()).sum()))
    }
}

/// Random swarms of 3 to 8 vehicles in plane and space, each on the complete graph, a ring and a star, and each with a
/// shape of random slots.
fn states() -> Result<Vec<State>, Untried> {
    let mut states = Vec::new();
    for (k, scenario) in random_starts(SEED, STATES, 1.0)?.into_iter().enumerate() {
        let count = scenario.count();
        for graph in [Graph::complete(count), Graph::ring(count), Graph::star(count)] {
            let parameters =
                EdgeTensionParameters { alpha: 1.0, delta_m: DELTA_M, a22_per_s: A22_PER_S[k % A22_PER_S.len()] };
            states.push(State {
                swarm: scenario.start.clone(),
                graph,
                formation: scenario.formation().clone(),
                parameters,
            });
        }
    }
    Ok(states)
}

/// The largest of a number over the states.
fn largest(states: &[State], of: impl Fn(&State) -> Result<f64, Untried>) -> Result<f64, Untried> {
    states.iter().try_fold(0.0, |largest, state| Ok(f64::max(largest, of(state)?)))
}

fn matrix_form(states: &[State]) -> Result<Claim, Untried> {
    let error = largest(states, |state| {
        let control = state.control()?;
        Ok((state.law()?.matrix_form(&state.swarm)? - &control).amax() / control.amax())
    })?;
    Ok(Claim::new(Kind::PaperHolds, "matrix-form", "equations (8), (9)")
        .statement("The sum over neighbours (8) and the weighted Laplacian (9) are the same law.")
        .expected("equal to rounding")
        .measured(format!(
            "largest difference {} of the largest component, {} states",
            bound(error, ROUNDING),
            states.len()
        ))
        .at_most("largest_relative_difference", error, ROUNDING)
        .reason(SUM))
}

fn zero_sum(states: &[State]) -> Result<Claim, Untried> {
    let error = largest(states, |state| {
        let control = state.control()?;
        Ok(mean_row(&control).norm() / control.amax())
    })?;
    Ok(Claim::new(Kind::Ours, "zero-net-control", "equation (8)")
        .statement("The controls sum to zero: the law cannot move the centre of mass.")
        .expected("a zero mean")
        .measured(format!("largest mean {} of the largest component, {} states", bound(error, ROUNDING), states.len()))
        .at_most("largest_relative_mean", error, ROUNDING)
        .reason(SUM))
}

fn energy_rate(states: &[State]) -> Result<Claim, Untried> {
    let error = largest(states, |state| {
        if !state.graph.is_complete() {
            return Ok(0.0);
        }
        let (rate, scale) = state.energy_rate()?;
        Ok((rate + relative_speed_squared(&state.swarm)).abs() / scale)
    })?;
    Ok(Claim::new(Kind::Ours, "energy-rate", "the stability theorem, complete graph")
        .statement("On the complete graph dE/dt = -sum |v_i - mean v|^2, whatever a22 is.")
        .expected("equal at every state")
        .measured(format!(
            "largest relative error {} over {STATES} states with a22 of {A22_PER_S:?} 1/s",
            bound(error, ROUNDING)
        ))
        .at_most("largest_relative_error", error, ROUNDING)
        .reason("rounding, relative to the terms that are summed"))
}

fn energy_rate_on_graphs(states: &[State]) -> Result<Claim, Untried> {
    let excess = largest(states, |state| {
        let (rate, scale) = state.energy_rate()?;
        let (a22, connectivity) = (state.parameters.a22_per_s, state.graph.algebraic_connectivity());
        let margin = (1.0 + a22) * connectivity / state.swarm.count() as f64 - a22;
        Ok(((rate + margin * relative_speed_squared(&state.swarm)) / scale).max(0.0))
    })?;
    Ok(Claim::new(Kind::Ours, "energy-rate-on-graphs", "theory of the general graph")
        .statement("On any graph dE/dt <= -[(1 + a22) lambda2/N - a22] sum |v_i - mean v|^2.")
        .expected("never more")
        .measured(format!("largest relative excess {} over {} states", bound(excess, ROUNDING), states.len()))
        .at_most("largest_relative_excess", excess, ROUNDING)
        .reason("rounding, relative to the terms that are summed"))
}

/// Equation (3) with h as section 4 writes it, zeros over `h_p`: the goal is then a velocity.
fn literal_baseline() -> Result<Claim, Untried> {
    const A22_PER_S: f64 = 0.1;
    let goal = Formation::pentagon(3.0);
    let count = goal.count();
    let (f1_per_s2, f2_per_s) = (1.0, 1.0 + A22_PER_S);
    let origin = Formation::points(Rows::zeros(count));
    let links = Graph::complete(count);
    let mut law = LaplacianLaw::new(&links, &origin, f1_per_s2, f2_per_s)?;
    let mut control_at = |scale: f64| {
        let mut swarm = Swarm::at_rest(goal.slots_m.clone() * scale);
        for i in 0..count {
            set_row(&mut swarm.velocities_m_s, i, -row(&goal.slots_m, i));
        }
        let mut control = Rows::zeros(count);
        let at = Observation::exact(&swarm, &links, &origin);
        law.command(&at, &mut control).map(|()| (0..count).map(|i| row(&control, i).norm()).fold(0.0, f64::max))
    };
    let (at_goal, at_scaled) = (control_at(1.0)?, control_at(f2_per_s / f1_per_s2)?);
    Ok(Claim::new(Kind::PaperRefuted, "goal-as-printed", "section 4, equation (3)")
        .finding("F7")
        .statement("With h = [0; 1] (x) h_p the law (3) comes to rest at the goal h_p.")
        .expected("rest at (1 + a22) h_p instead: read h as goal positions h_p and goal velocities 0")
        .measured(format!(
            "at rest at h_p the law still commands {at_goal:.4} m/s^2, at {f2_per_s} h_p {}",
            bound(at_scaled, ROUNDING)
        ))
        .values([("control_at_goal_m_s2", at_goal), ("control_at_scaled_goal_m_s2", at_scaled)])
        .tolerance(format!("{ROUNDING:e} m/s^2"))
        .reason("rounding; the pentagon of side 3 m, a22 = 0.1 1/s")
        .pass(at_goal > 0.1 && at_scaled <= ROUNDING))
}
