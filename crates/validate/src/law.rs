//! Edge-tension law (8) at single instants: matrix form, sum of controls, and energy rate.

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated};
use super::flights::{DELTA_M, random_starts};
use super::flights::{larger, relative_speed_squared, relative_velocities};
use tautline_core::swarm::{Rows, Swarm, mean_row, row, set_row};
use tautline_core::text::bound;
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::law::{
    EdgeTension, EdgeTensionKeys, EdgeTensionLaw, LaplacianKeys, LaplacianLaw, Law as _, LawContext,
};
use tautline_laws::observation::Observation;

/// Number of random states of each claim, each with every kind of graph.
const STATES: usize = 200;
const SEED: u64 = 1;
/// Scale of the edge tension \[m^2/s^2\].
const ALPHA: f64 = 1.0;
/// Values of a22 \[1/s\] of each state.
const A22_PER_S: [f64; 3] = [-0.5, 0.0, 0.1];

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    let states = states()?;
    let claims = vec![
        matrix_form(&states)?,
        zero_sum(&states)?,
        energy_rate(&states)?,
        energy_rate_on_graphs(&states)?,
        literal_baseline()?,
    ];
    progress.advance(1);
    Ok(claims)
}

/// State with its law.
struct State {
    swarm: Swarm,
    graph: Graph,
    formation: Formation,
    a22_per_s: f64,
}

impl State {
    fn law(&self) -> Result<EdgeTensionLaw, MeasureError> {
        let context = LawContext::new(&self.graph, &self.formation, DELTA_M, self.a22_per_s);
        Ok(EdgeTensionLaw::new(&context, EdgeTensionKeys { alpha: ALPHA })?)
    }

    fn control(&self) -> Result<Rows, MeasureError> {
        let mut control = Rows::zeros(self.swarm.count());
        self.law()?.command(&Observation::exact(&self.swarm, &self.graph, &self.formation), &mut control)?;
        Ok(control)
    }

    /// Returns dE/dt at this state from E, and the sum of the magnitudes of its terms.
    ///
    /// `dE/dt = sum v~ v~' + (1/N) grad V v`, with the gradient from [`EdgeTension`] edge by edge.
    fn energy_rate(&self) -> Result<(f64, f64), MeasureError> {
        let (swarm, count) = (&self.swarm, self.swarm.count() as f64);
        let control = self.control()?;
        let accelerations = swarm.velocities_m_s.clone() * self.a22_per_s + control;
        let mut terms: Vec<f64> =
            relative_velocities(swarm).enumerate().map(|(i, v)| v.dot(&row(&accelerations, i))).collect();
        for (i, j) in self.graph.edges() {
            let tension = EdgeTension::new(ALPHA, DELTA_M, self.formation.desired_distance(i, j))?;
            let offset = row(&swarm.positions_m, i) - row(&swarm.positions_m, j);
            let closing = row(&swarm.velocities_m_s, i) - row(&swarm.velocities_m_s, j);
            let distance_m = offset.norm();
            terms.push(tension.derivative(distance_m) * offset.dot(&closing) / distance_m / count);
        }
        Ok((terms.iter().sum(), terms.iter().map(|term| term.abs()).sum()))
    }
}

/// Returns random swarms of 3 to 8 vehicles in plane and space, on the complete graph, a ring and a star, each with
/// random slots.
fn states() -> Result<Vec<State>, MeasureError> {
    let mut states = Vec::new();
    for (k, scenario) in random_starts(SEED, STATES, 1.0)?.into_iter().enumerate() {
        let count = scenario.count();
        for graph in [Graph::complete(count), Graph::ring(count), Graph::star(count)] {
            states.push(State {
                swarm: scenario.start.clone(),
                graph,
                formation: scenario.formation().clone(),
                a22_per_s: A22_PER_S[k % A22_PER_S.len()],
            });
        }
    }
    Ok(states)
}

/// Returns the claim that a ratio is within rounding at every state. `words` describes the bound of the largest ratio,
/// whose name is `name`.
fn within_rounding(
    states: &[State],
    id: &str,
    name: &'static str,
    words: impl Fn(&str) -> String,
    ratio: impl Fn(&State) -> Result<f64, MeasureError>,
) -> Result<Claim, MeasureError> {
    let claim = stated(id)?;
    let largest =
        states.iter().try_fold(0.0, |largest, state| Ok::<_, MeasureError>(larger(largest, ratio(state)?)))?;
    let words = words(&bound(largest, claim.limit()));
    Ok(claim.measured(words, [(name, largest)]).within_limit())
}

fn matrix_form(states: &[State]) -> Result<Claim, MeasureError> {
    let words = |bound: &str| format!("difference {bound} of the largest component, {} states", states.len());
    within_rounding(states, "matrix-form", "largest_relative_difference", words, |state| {
        let control = state.control()?;
        Ok((state.law()?.matrix_form(&state.swarm)? - &control).amax() / control.amax())
    })
}

fn zero_sum(states: &[State]) -> Result<Claim, MeasureError> {
    let words = |bound: &str| format!("mean {bound} of the largest component, {} states", states.len());
    within_rounding(states, "zero-net-control", "largest_relative_mean", words, |state| {
        let control = state.control()?;
        Ok(mean_row(&control).norm() / control.amax())
    })
}

/// Returns a number relative to the magnitude of its terms; 0 for a swarm at rest.
fn of_scale(number: f64, scale: f64) -> f64 {
    if scale == 0.0 && number == 0.0 { 0.0 } else { number / scale }
}

fn energy_rate(states: &[State]) -> Result<Claim, MeasureError> {
    let words = |bound: &str| format!("relative error {bound}, {STATES} states, a22 = {A22_PER_S:?} 1/s");
    within_rounding(states, "energy-rate", "largest_relative_error", words, |state| {
        if !state.graph.is_complete() {
            return Ok(0.0);
        }
        let (rate, scale) = state.energy_rate()?;
        Ok(of_scale((rate + relative_speed_squared(&state.swarm)).abs(), scale))
    })
}

fn energy_rate_on_graphs(states: &[State]) -> Result<Claim, MeasureError> {
    let words = |bound: &str| format!("relative excess {bound}, {} states", states.len());
    within_rounding(states, "energy-rate-on-graphs", "largest_relative_excess", words, |state| {
        let (rate, scale) = state.energy_rate()?;
        let (a22, connectivity) = (state.a22_per_s, state.graph.algebraic_connectivity());
        let margin = (1.0 + a22) * connectivity / state.swarm.count() as f64 - a22;
        Ok(of_scale((rate + margin * relative_speed_squared(&state.swarm)).max(0.0), scale))
    })
}

/// Equation (3) with h as in section 4, zeros over `h_p`: the goal is then a velocity.
fn literal_baseline() -> Result<Claim, MeasureError> {
    const A22_PER_S: f64 = 0.1;
    let goal = Formation::pentagon(3.0);
    let count = goal.count();
    let (f1_per_s2, f2_per_s) = (1.0, 1.0 + A22_PER_S);
    let origin = Formation::points(Rows::zeros(count));
    let links = Graph::complete(count);
    let keys = LaplacianKeys { f1_per_s2, f2_per_s: Some(f2_per_s) };
    let mut law = LaplacianLaw::new(&LawContext::new(&links, &origin, DELTA_M, A22_PER_S), keys)?;
    let mut control_at = |scale: f64| {
        let mut swarm = Swarm::at_rest(goal.slots_m.clone() * scale);
        for i in 0..count {
            set_row(&mut swarm.velocities_m_s, i, -row(&goal.slots_m, i));
        }
        let mut control = Rows::zeros(count);
        let observation = Observation::exact(&swarm, &links, &origin);
        law.command(&observation, &mut control)
            .map(|()| (0..count).map(|i| row(&control, i).norm()).fold(0.0, f64::max))
    };
    let (at_goal, at_scaled) = (control_at(1.0)?, control_at(f2_per_s / f1_per_s2)?);
    let claim = stated("goal-as-printed")?;
    let words =
        format!("command at rest: {at_goal:.4} m/s^2 at h_p, {} at {f2_per_s} h_p", bound(at_scaled, claim.limit()));
    let pass = at_goal > 0.1 && at_scaled <= claim.limit();
    let values = [("control_at_goal_m_s2", at_goal), ("control_at_scaled_goal_m_s2", at_scaled)];
    Ok(claim.measured(words, values).pass(pass))
}
