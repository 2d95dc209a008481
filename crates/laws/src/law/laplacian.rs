//! The Laplacian baseline (3): consensus on the formation, without collision avoidance.

use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, VoidReason};
use super::consensus::{
    add_laplacian_product, add_received_terms, check_observation, check_range, check_state, consensus_margin,
    of_errors_m, of_table, relative_kinetic_energy, sum_of_squares_about_mean,
};
use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::interface::{Capabilities, Law, RateQuery, Rates};
use super::modes::{Linear, Mode};
use super::pinned::PinnedConsensus;
use crate::formation::Formation;
use crate::graph::{Graph, Pinning};
use crate::observation::Observation;
use tautline_core::swarm::{Rows, row};

/// Keys of `[law]` with `kind = "laplacian"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LaplacianKeys {
    /// Gain on positions in 1/s^2.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub f1_per_s2: f64,
    /// Gain on velocities in 1/s; by default 1 + `swarm.a22_per_s` - `vehicle.drag_per_s`, at least 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub f2_per_s: Option<f64>,
}

fn one() -> f64 {
    1.0
}

impl Default for LaplacianKeys {
    fn default() -> Self {
        Self { f1_per_s2: one(), f2_per_s: None }
    }
}

impl LaplacianKeys {
    /// Sets keys that are not given to their defaults.
    pub(super) fn complete(self, a22_per_s: f64) -> Self {
        Self { f2_per_s: Some(self.f2_per_s(a22_per_s)), ..self }
    }

    /// Returns the gain on velocities \[1/s\]. The default is not negative: for a22 < -1 the drag alone damps.
    fn f2_per_s(&self, a22_per_s: f64) -> f64 {
        self.f2_per_s.unwrap_or((1.0 + a22_per_s).max(0.0))
    }
}

/// The Laplacian law on an undirected graph of N vehicles, equation (3):
///
/// ```text
/// u_i = -(1/N) sum_{j in N_i} [ f1 ((p_i - h_i) - (p_j - h_j)) + f2 (v_i - v_j) ]
/// ```
///
/// Reaches the slots `h_i` up to a common translation from any start on a connected graph. Does not keep vehicles
/// apart. The source's gains are f1 = 1 and f2 = 1 + a22; below a22 = -1 the default of f2 is 0.
///
/// # Energy
/// On the complete graph, with `e_i = p_i - h_i`,
///
/// ```text
/// E = 1/2 sum |v_i - mean v|^2 + (f1/2) sum |e_i - mean e|^2,    dE/dt = (a22 - f2) sum |v_i - mean v|^2
/// ```
///
/// For f1 > 0 this is a Lyapunov function if f2 >= a22. There is no energy on other graphs or for f1 <= 0.
///
/// # Cost
/// O(N) per step on the complete graph, O(edges) on others, without allocation.
#[derive(Clone, Debug)]
pub struct LaplacianLaw {
    graph: Graph,
    f1_per_s2: f64,
    f2_per_s: f64,
}

impl LaplacianLaw {
    /// Builds the law on the links of the context.
    ///
    /// # Errors
    /// [`ParameterError`] if graph and formation have different numbers of vehicles, or a slot or a gain is not finite.
    #[expect(clippy::needless_pass_by_value, reason = "every law takes its keys by value")]
    pub fn new(context: &LawContext<'_>, keys: LaplacianKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, a22_per_s, .. } = context;
        let (f1_per_s2, f2_per_s) = (keys.f1_per_s2, keys.f2_per_s(a22_per_s));
        ParameterError::check(links, formation, &[("f1", f1_per_s2), ("f2", f2_per_s)])?;
        Ok(Self { graph: links.clone(), f1_per_s2, f2_per_s })
    }
}

impl Law for LaplacianLaw {
    fn name(&self) -> &'static str {
        "laplacian"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        check_observation(self.graph.count(), observation, command)?;
        command.fill(0.0);
        let (per_vehicle, slots_m) =
            (-1.0 / observation.own.count().max(1) as f64, &observation.target.formation.slots_m);
        let (f1, f2) = (self.f1_per_s2 * per_vehicle, self.f2_per_s * per_vehicle);
        if let Some(swarm) = observation.shared() {
            add_laplacian_product(&self.graph, &of_errors_m(&swarm.positions_m, slots_m), f1, command);
            add_laplacian_product(&self.graph, &of_table(&swarm.velocities_m_s), f2, command);
        } else {
            add_received_terms(observation, command, |i, own, j, received| {
                let errors_m = (own.position_m - row(slots_m, i)) - (received.position_m - row(slots_m, j));
                Ok(f1 * errors_m + f2 * (own.velocity_m_s - received.velocity_m_s))
            })?;
        }
        check_range(command)
    }

    fn energy(&self, observation: &Observation<'_>) -> Option<f64> {
        if !self.graph.is_complete() || self.f1_per_s2 <= 0.0 {
            return None;
        }
        let swarm = observation.own;
        check_state(self.graph.count(), swarm).ok()?;
        let error_m = |i| row(&swarm.positions_m, i) - row(&observation.target.formation.slots_m, i);
        let potential = 0.5 * self.f1_per_s2 * sum_of_squares_about_mean(swarm.count(), error_m);
        let energy = relative_kinetic_energy(swarm) + potential;
        energy.is_finite().then_some(energy)
    }

    fn certificate(&self, start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        Certificate { energy_initial: self.energy(start), ..Certificate::void(VoidReason::NoBarrier) }
    }

    fn linear(&self, _formation: &Formation) -> Option<Linear> {
        let count = self.graph.count().max(1) as f64;
        let gain = Mode { stiffness_per_s2: self.f1_per_s2, damping_per_s: self.f2_per_s }.times(1.0 / count);
        Some(PinnedConsensus::new(&self.graph, Pinning::Unpinned).linear(gain, gain))
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { needs: &["a common compass"], ..Capabilities::default() }
    }

    /// The law is linear. With the eigenvalues 0 <= mu <= N of the graph's Laplacian, its modes are
    /// `x'' = -(f1 mu/N) x - (f2 mu/N - a22) x'`. Their rates are at most `max(sqrt(f1), |f2 - a22|, |a22|)`.
    fn rates(&self, query: &RateQuery) -> Rates {
        let fastest = self.f1_per_s2.sqrt().max((self.f2_per_s - query.a22_per_s).abs()).max(query.a22_per_s.abs());
        Rates {
            fastest_per_s: Some(fastest),
            velocity_margin: Some(consensus_margin(
                self.graph.count(),
                self.f2_per_s,
                query.connectivity,
                query.a22_per_s,
            )),
            ..Rates::unknown(query)
        }
    }
}

#[cfg(test)]
mod tests;
