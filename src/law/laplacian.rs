//! The Laplacian baseline (3): consensus on the formation, without avoidance.

use super::certificate::{Certificate, Void};
use super::{
    Law, LawError, ParameterError, add_laplacian_product, check_count, check_range, check_state,
    relative_kinetic_energy, sum_of_squares_about_mean,
};
use crate::formation::Formation;
use crate::graph::Graph;
use crate::swarm::{Rows, Swarm, row};

/// The Laplacian law on an undirected graph of N vehicles, equation (3):
///
/// ```text
/// u_i = -(1/N) sum_{j in N_i} [ f1 ((p_i - h_i) - (p_j - h_j)) + f2 (v_i - v_j) ]
/// ```
///
/// It reaches the slots `h_i` up to a common translation from any start on a connected graph, and does not keep
/// vehicles apart. The source's gains are f1 = 1 and f2 = 1 + a22.
///
/// # Energy
/// On the complete graph, with `e_i = p_i - h_i`,
///
/// ```text
/// E = 1/2 sum |v_i - mean v|^2 + (f1/2) sum |e_i - mean e|^2,    dE/dt = (a22 - f2) sum |v_i - mean v|^2
/// ```
///
/// For f1 > 0 this is a Lyapunov function wherever f2 >= a22. On other graphs, and for f1 <= 0, none is given.
///
/// # Cost
/// O(N) a step on the complete graph, O(edges) on others, without allocation.
#[derive(Clone, Debug)]
pub struct LaplacianLaw {
    graph: Graph,
    formation: Formation,
    f1_per_s2: f64,
    f2_per_s: f64,
    /// Scratch: `p_i - h_i`.
    errors_m: Rows,
}

impl LaplacianLaw {
    /// The law with position gain f1 \[1/s^2\] and velocity gain f2 \[1/s\].
    ///
    /// # Errors
    /// [`ParameterError`] where graph and formation do not have the same number of vehicles, or where a slot or a gain
    /// is not finite.
    pub fn new(graph: &Graph, formation: &Formation, f1_per_s2: f64, f2_per_s: f64) -> Result<Self, ParameterError> {
        ParameterError::check(graph, formation, &[("f1", f1_per_s2), ("f2", f2_per_s)])?;
        let errors_m = Rows::zeros(graph.count());
        Ok(Self { graph: graph.clone(), formation: formation.clone(), f1_per_s2, f2_per_s, errors_m })
    }
}

impl Law for LaplacianLaw {
    fn name(&self) -> &'static str {
        "laplacian"
    }

    fn control(&mut self, swarm: &Swarm, control: &mut Rows) -> Result<(), LawError> {
        check_state(self.graph.count(), swarm)?;
        check_count(self.graph.count(), control.nrows())?;
        self.errors_m.copy_from(&swarm.positions_m);
        self.errors_m -= &self.formation.slots_m;
        control.fill(0.0);
        let per_vehicle = -1.0 / swarm.count().max(1) as f64;
        add_laplacian_product(&self.graph, &self.errors_m, self.f1_per_s2 * per_vehicle, control);
        add_laplacian_product(&self.graph, &swarm.velocities_m_s, self.f2_per_s * per_vehicle, control);
        check_range(control)
    }

    fn energy(&self, swarm: &Swarm) -> Option<f64> {
        if !self.graph.is_complete() || self.f1_per_s2 <= 0.0 {
            return None;
        }
        check_state(self.graph.count(), swarm).ok()?;
        let error_m = |i| row(&swarm.positions_m, i) - row(&self.formation.slots_m, i);
        let potential = 0.5 * self.f1_per_s2 * sum_of_squares_about_mean(swarm.count(), error_m);
        let energy = relative_kinetic_energy(swarm) + potential;
        energy.is_finite().then_some(energy)
    }

    fn certificate(&self, start: &Swarm) -> Certificate {
        Certificate { energy_initial: self.energy(start), ..Certificate::void(Void::NoBarrier) }
    }
}

#[cfg(test)]
mod tests;
