//! The edge-tension law (8): vehicles joined by an edge are pulled to their desired distance and never let closer than
//! delta.

use super::certificate::{Certificate, Void};
use super::kernel::Kernel;
use super::{
    EdgeTension, Law, LawError, ParameterError, add_laplacian_product, check_count, check_range, check_state,
    relative_kinetic_energy,
};
use crate::formation::Formation;
use crate::graph::Graph;
use crate::swarm::{Pair, Rows, Swarm, separation};

/// Parameters of [`EdgeTensionLaw`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeTensionParameters {
    /// Scale alpha of the tension \[m^2/s^2\], positive.
    pub alpha: f64,
    /// Safety distance delta \[m\], below every desired distance of an edge.
    pub delta_m: f64,
    /// Velocity coefficient a22 of the plant \[1/s\].
    pub a22_per_s: f64,
}

/// The edge-tension law on an undirected graph of N vehicles, equation (8):
///
/// ```text
/// u_i = -(1/N) sum_{j in N_i} [ (1 + a22)(v_i - v_j) + w_ij (p_i - p_j) ],    w_ij = V'_ij(l_ij)/l_ij
/// ```
///
/// The desired distance of an edge is that of the formation's slots. The sum of all `u_i` is zero: the law cannot move
/// the centre of mass.
///
/// # Energy
/// ```text
/// E = 1/2 sum |v_i - mean v|^2 + (1/N) sum over edges of V_ij(l_ij)
/// dE/dt = -sum |v_i - mean v|^2                                        complete graph, whatever a22 is
/// dE/dt <= -[(1 + a22) lambda2/N - a22] sum |v_i - mean v|^2           graph of algebraic connectivity lambda2
/// ```
///
/// [`Law::certificate`] rests on the second line.
///
/// # Cost
/// O(edges) time a step without allocation, and 8 bytes of memory an edge (24 where the graph is not complete).
#[derive(Clone, Debug)]
pub struct EdgeTensionLaw {
    graph: Graph,
    formation: Formation,
    parameters: EdgeTensionParameters,
    kernel: Kernel,
    /// The tension of the edge with the smallest desired distance.
    tightest: Option<EdgeTension>,
}

impl EdgeTensionLaw {
    /// The law for the edges of `graph` and the distances of `formation`.
    ///
    /// # Errors
    /// [`ParameterError`] where graph and formation do not have the same number of vehicles, where an edge has no
    /// tension (see [`EdgeTension::new`]), where a22 is not finite, or where the edges do not fit in memory.
    pub fn new(
        graph: &Graph,
        formation: &Formation,
        parameters: EdgeTensionParameters,
    ) -> Result<Self, ParameterError> {
        ParameterError::check(graph, formation, &[("a22", parameters.a22_per_s)])?;
        let mut inverse_k_per_m = Vec::new();
        let edges = graph.edge_count();
        inverse_k_per_m.try_reserve_exact(edges).map_err(|_| ParameterError::Memory { edges })?;
        let mut tightest: Option<EdgeTension> = None;
        for (i, j) in graph.edges() {
            let tension = EdgeTension::new(parameters.alpha, parameters.delta_m, formation.desired_distance(i, j))
                .map_err(|source| ParameterError::Tension { pair: Pair::new(i, j), source })?;
            inverse_k_per_m.push(1.0 / tension.k_m());
            if tightest.is_none_or(|best| tension.rest_m() < best.rest_m()) {
                tightest = Some(tension);
            }
        }
        let kernel = Kernel::new(graph, parameters.delta_m, inverse_k_per_m);
        Ok(Self { graph: graph.clone(), formation: formation.clone(), parameters, kernel, tightest })
    }

    /// The same control from the weighted Laplacian, equation (9): `U = -(1/N) [L_w(P) P + (1 + a22) L_G V]` with
    /// `w_ij = V'_ij(l_ij)/l_ij`, N x 3 \[m/s^2\].
    ///
    /// Equal to [`Law::control`] to rounding, and there to check it: it takes O(N^2) memory and O(N^3) time.
    ///
    /// # Errors
    /// As [`Law::control`].
    pub fn matrix_form(&self, swarm: &Swarm) -> Result<Rows, LawError> {
        check_state(self.graph.count(), swarm)?;
        let EdgeTensionParameters { alpha, delta_m, a22_per_s } = self.parameters;
        let within = |distance_m: f64| distance_m > delta_m && distance_m.is_finite();
        if !self.graph.edges().all(|(i, j)| within(separation(&swarm.positions_m, i, j))) {
            return Err(self.fault(swarm));
        }
        let weighted = self.graph.weighted_laplacian(|i, j| {
            let distance_m = separation(&swarm.positions_m, i, j);
            EdgeTension::new(alpha, delta_m, self.formation.desired_distance(i, j))
                .map_or(f64::NAN, |tension| tension.derivative(distance_m) / distance_m)
        });
        let sum = weighted * &swarm.positions_m + self.graph.laplacian() * &swarm.velocities_m_s * (1.0 + a22_per_s);
        let control = sum / -(swarm.count() as f64);
        check_range(&control).map(|()| control)
    }

    /// The kernel found a distance that is not in (delta, infinity): names the first edge that is too short.
    fn fault(&self, swarm: &Swarm) -> LawError {
        let delta_m = self.parameters.delta_m;
        self.graph
            .edges()
            .map(|(i, j)| (Pair::new(i, j), separation(&swarm.positions_m, i, j)))
            .find(|&(_, separation_m)| separation_m <= delta_m)
            .map_or(LawError::OutOfRange, |(pair, separation_m)| LawError::Collision { pair, separation_m, delta_m })
    }

    fn try_energy(&self, swarm: &Swarm) -> Result<f64, LawError> {
        check_state(self.graph.count(), swarm)?;
        let potential = self.kernel.potential(&swarm.positions_m).map_err(|_| self.fault(swarm))?;
        let energy = relative_kinetic_energy(swarm) + self.parameters.alpha * potential / swarm.count().max(1) as f64;
        if energy.is_finite() { Ok(energy) } else { Err(LawError::OutOfRange) }
    }
}

impl Law for EdgeTensionLaw {
    fn name(&self) -> &'static str {
        "edge-tension"
    }

    fn control(&mut self, swarm: &Swarm, control: &mut Rows) -> Result<(), LawError> {
        check_state(self.graph.count(), swarm)?;
        check_count(self.graph.count(), control.nrows())?;
        control.fill(0.0);
        self.kernel.add_pulls(&swarm.positions_m, control).map_err(|_| self.fault(swarm))?;
        let per_vehicle = -1.0 / swarm.count().max(1) as f64;
        let EdgeTensionParameters { alpha, a22_per_s, .. } = self.parameters;
        *control *= alpha * per_vehicle;
        add_laplacian_product(&self.graph, &swarm.velocities_m_s, (1.0 + a22_per_s) * per_vehicle, control);
        check_range(control)
    }

    fn energy(&self, swarm: &Swarm) -> Option<f64> {
        self.try_energy(swarm).ok()
    }

    fn barrier_m(&self) -> Option<f64> {
        Some(self.parameters.delta_m)
    }

    /// On the complete graph `V_ij(l_ij(t)) <= N E(0)` for every pair, for ever. In s = (l - delta)/K all tensions are
    /// the same function, so the pair that may come closest is the one with the smallest K, and one root
    /// ([`EdgeTension::push_side_root`]) answers for all pairs.
    ///
    /// The promise is that of the proof: exact state, no delay, no saturation, no disturbance, continuous time.
    /// Without pairs there is nothing to promise, and nothing void either.
    fn certificate(&self, start: &Swarm) -> Certificate {
        let energy = self.try_energy(start);
        let mut void = Vec::new();
        if !self.graph.is_complete() {
            void.push(Void::GraphNotComplete);
        }
        if let Err(fault) = energy {
            void.push(Void::StartRefused(fault));
        }
        let energy_initial = energy.ok();
        let certified_m = match (energy_initial, self.tightest) {
            (Some(energy), Some(tension)) if void.is_empty() => {
                Some(tension.push_side_root(start.count() as f64 * energy))
            }
            _ => None,
        };
        Certificate { certified_m, energy_initial, void }
    }
}

#[cfg(test)]
mod tests;
