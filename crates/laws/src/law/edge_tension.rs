//! The edge-tension law (8): edges pull vehicles to their desired distance, with a barrier at delta.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, VoidReason};
use super::consensus::{
    add_laplacian_product, add_received_terms, check_count, check_observation, check_range, check_rows, check_state,
    consensus_margin, of_table, relative_kinetic_energy,
};
use super::energy::PotentialCache;
use super::energy::{BoundedEnergy, EnergyBound, Frame};
use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::interface::{Capabilities, Controls, Law, RateQuery, Rates};
use super::kernel::Kernel;
use super::modes::{Linear, Mode};
use super::tension::{EdgeTension, TensionError};
use crate::formation::Formation;
use crate::graph::Graph;
use crate::observation::Observation;
use crate::target::Target;
use tautline_core::swarm::{Pair, Rows, Swarm, row, separation};

/// Keys of `[law]` with `kind = "edge-tension"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EdgeTensionKeys {
    /// Scale of the tension in m^2/s^2.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub alpha: f64,
}

/// Damping rate of relative velocities on the complete graph, independent of a22 \[1/s\].
const DAMPING_PER_S: f64 = 1.0;

fn one() -> f64 {
    1.0
}

impl Default for EdgeTensionKeys {
    fn default() -> Self {
        Self { alpha: one() }
    }
}

/// The edge-tension law on an undirected graph of N vehicles, equation (8):
///
/// ```text
/// u_i = -(1/N) sum_{j in N_i} [ (1 + a22)(v_i - v_j) + w_ij (p_i - p_j) ],    w_ij = V'_ij(l_ij)/l_ij
/// ```
///
/// The desired distance of an edge is the distance of its two slots. The sum of all `u_i` is zero, so the law cannot
/// move the centre of mass.
///
/// # Energy
/// ```text
/// E = 1/2 sum |v_i - mean v|^2 + (1/N) sum over edges of V_ij(l_ij)
/// dE/dt = -sum |v_i - mean v|^2                                        complete graph, for every a22
/// dE/dt <= -[(1 + a22) lambda2/N - a22] sum |v_i - mean v|^2           graph of algebraic connectivity lambda2
/// ```
///
/// [`Law::certificate`] rests on the second line.
///
/// # Cost
/// O(edges) time per step without allocation; 8 bytes of memory per edge (24 on an incomplete graph).
#[derive(Clone, Debug)]
pub struct EdgeTensionLaw {
    graph: Graph,
    formation: Formation,
    alpha: f64,
    delta_m: f64,
    a22_per_s: f64,
    kernel: Kernel,
    /// Tension of the edge with the smallest desired distance.
    tightest: Option<EdgeTension>,
    /// Revision of the target that set the desired distances.
    revision: u64,
    /// Bound on the energy under wind, if there is wind; `is_unbounded` if the wind has no such bound.
    energy_bound: Option<EnergyBound>,
    is_unbounded: bool,
    /// (1/alpha) times the sum of V over the edges.
    cache: PotentialCache,
}

impl EdgeTensionLaw {
    /// Builds the law for the links and slot distances of the context.
    ///
    /// # Errors
    /// [`ParameterError`] if graph and formation have different numbers of vehicles, an edge has no tension (see
    /// [`EdgeTension::new`]), a22 is not finite, or the edges do not fit in memory.
    #[expect(clippy::needless_pass_by_value, reason = "every law takes its keys by value")]
    pub fn new(context: &LawContext<'_>, keys: EdgeTensionKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, delta_m, a22_per_s, exposure, .. } = context;
        ParameterError::check(links, formation, &[("a22", a22_per_s)])?;
        let kernel = Kernel::new(links, delta_m).map_err(|_| ParameterError::Memory { edges: links.edge_count() })?;
        let mut law = Self {
            graph: links.clone(),
            formation: formation.clone(),
            alpha: keys.alpha,
            delta_m,
            a22_per_s,
            kernel,
            tightest: None,
            revision: 0,
            energy_bound: exposure
                .map(|exposure| EnergyBound::new(&exposure, links.count(), Frame::Mean, DAMPING_PER_S)),
            is_unbounded: exposure.is_some_and(|exposure| exposure.wind.turbulence.is_some() && !exposure.wind.shared),
            cache: PotentialCache::new(links.count()),
        };
        law.set_rest_lengths().map_err(|(pair, source)| ParameterError::Tension { pair, source })?;
        Ok(law)
    }

    /// Sets the tension of each edge from the formation. Returns the first edge without a tension as the error.
    fn set_rest_lengths(&mut self) -> Result<(), (Pair, TensionError)> {
        let Self { alpha, delta_m, .. } = *self;
        self.tightest = None;
        self.cache.clear();
        for ((i, j), inverse_k_per_m) in self.graph.edges().zip(self.kernel.inverse_k_per_m_mut()) {
            let tension = EdgeTension::new(alpha, delta_m, self.formation.desired_distance(i, j))
                .map_err(|source| (Pair::new(i, j), source))?;
            *inverse_k_per_m = 1.0 / tension.k_m();
            if self.tightest.is_none_or(|best| tension.rest_m() < best.rest_m()) {
                self.tightest = Some(tension);
            }
        }
        Ok(())
    }

    /// Adds `w_ij (p_i - p_j) / alpha` for the received states of all neighbours.
    fn add_received_pulls(&self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        let Self { alpha, delta_m, .. } = *self;
        add_received_terms(observation, command, |i, own, j, received| {
            let edge_m = own.position_m - received.position_m;
            let separation_m = edge_m.norm();
            if separation_m <= delta_m {
                return Err(LawError::Collision { pair: Pair::new(i, j), separation_m, delta_m });
            }
            let tension = EdgeTension::new(alpha, delta_m, self.formation.desired_distance(i, j));
            let slope = tension.map_or(f64::NAN, |tension| tension.derivative(separation_m));
            Ok(edge_m * (slope / (alpha * separation_m)))
        })
    }

    /// Returns the same control from the weighted Laplacian, equation (9), N x 3 \[m/s^2\]:
    /// `U = -(1/N) [L_w(P) P + (1 + a22) L_G V]` with `w_ij = V'_ij(l_ij)/l_ij`.
    ///
    /// Equals [`Law::command`] to rounding and serves to check it. Takes O(N^2) memory and O(N^3) time.
    ///
    /// # Errors
    /// As [`Law::command`].
    pub fn matrix_form(&self, swarm: &Swarm) -> Result<Rows, LawError> {
        check_state(self.graph.count(), swarm)?;
        let Self { alpha, delta_m, a22_per_s, .. } = *self;
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

    /// Returns the error of a state in which the kernel found a distance outside (delta, infinity): the first edge that
    /// is too short.
    fn fault(&self, swarm: &Swarm) -> LawError {
        let delta_m = self.delta_m;
        self.graph
            .edges()
            .map(|(i, j)| (Pair::new(i, j), separation(&swarm.positions_m, i, j)))
            .find(|&(_, separation_m)| separation_m <= delta_m)
            .map_or(LawError::OutOfRange, |(pair, separation_m)| LawError::Collision { pair, separation_m, delta_m })
    }

    fn try_energy(&self, swarm: &Swarm) -> Result<f64, LawError> {
        check_rows(self.graph.count(), swarm)?;
        let potential = if let Some(potential) = self.cache.of(&swarm.positions_m) {
            potential
        } else {
            check_state(self.graph.count(), swarm)?;
            self.kernel.potential(&swarm.positions_m).map_err(|_| self.fault(swarm))?
        };
        let energy = relative_kinetic_energy(swarm) + self.alpha * potential / swarm.count().max(1) as f64;
        if energy.is_finite() { Ok(energy) } else { Err(LawError::OutOfRange) }
    }
}

impl Law for EdgeTensionLaw {
    fn name(&self) -> &'static str {
        "edge-tension"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        check_observation(self.graph.count(), observation, command)?;
        command.fill(0.0);
        let per_vehicle = -1.0 / observation.own.count().max(1) as f64;
        let Self { alpha, a22_per_s, .. } = *self;
        let velocity_gain = (1.0 + a22_per_s) * per_vehicle;
        if let Some(swarm) = observation.shared() {
            let potential = self.kernel.add_pulls(&swarm.positions_m, command).map_err(|_| self.fault(swarm))?;
            self.cache.store(&swarm.positions_m, potential);
            *command *= alpha * per_vehicle;
            add_laplacian_product(&self.graph, &of_table(&swarm.velocities_m_s), velocity_gain, command);
        } else {
            self.add_received_pulls(observation, command)?;
            *command *= alpha * per_vehicle;
            add_received_terms(observation, command, |_, own, _, received| {
                Ok(velocity_gain * (own.velocity_m_s - received.velocity_m_s))
            })?;
        }
        check_range(command)
    }

    /// Sets the tension of each edge from the new slots in O(edges); does nothing if the slots are unchanged.
    fn follow(&mut self, target: &Target<'_>) -> Result<(), LawError> {
        if target.revision == self.revision {
            return Ok(());
        }
        check_count(self.graph.count(), target.formation.count())?;
        let Self { alpha, delta_m, .. } = *self;
        for (i, j) in self.graph.edges() {
            let distance_m = target.formation.desired_distance(i, j);
            EdgeTension::new(alpha, delta_m, distance_m).map_err(|_| LawError::Target {
                pair: Pair::new(i, j),
                distance_m,
                delta_m,
            })?;
        }
        self.formation.slots_m.copy_from(&target.formation.slots_m);
        self.revision = target.revision;
        // The loop above has verified that every edge has a tension.
        let _ = self.set_rest_lengths();
        Ok(())
    }

    fn energy(&self, observation: &Observation<'_>) -> Option<f64> {
        self.try_energy(observation.own).ok()
    }

    /// Complete graph only. All relative velocities are damped at 1 + a22. The stiffnesses are the eigenvalues of 1/N
    /// times the sum over edges of V'' along the edge, because V' = 0 at the desired distance. They are 0 for
    /// rotations.
    fn linear(&self, formation: &Formation) -> Option<Linear> {
        /// Largest number of vehicles for the O(N^3) eigenvalue computation.
        const MOST: usize = 130;
        let (count, &Self { alpha, delta_m, a22_per_s, .. }) = (self.graph.count(), self);
        if !self.graph.is_complete() || !(2..=MOST).contains(&count) {
            return None;
        }
        let mut stiffness = DMatrix::zeros(3 * count, 3 * count);
        for (i, j) in self.graph.edges() {
            let distance_m = formation.desired_distance(i, j);
            let along = (row(&formation.slots_m, j) - row(&formation.slots_m, i)) / distance_m;
            let curvature = EdgeTension::new(alpha, delta_m, distance_m).ok()?.second_derivative(distance_m);
            let block = along * along.transpose() * (curvature / count as f64);
            for (a, b, sign) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
                let mut part = stiffness.fixed_view_mut::<3, 3>(3 * a, 3 * b);
                part += block * sign;
            }
        }
        // Rounding may make zero eigenvalues slightly negative.
        let stiffnesses = stiffness.symmetric_eigenvalues().map(|eigenvalue| eigenvalue.max(0.0));
        let mode = |&stiffness_per_s2: &f64| Mode { stiffness_per_s2, damping_per_s: 1.0 + a22_per_s };
        Some(Linear { free: stiffnesses.iter().map(mode).collect(), stiffest_contact_mode: None, received: None })
    }

    /// On the complete graph `V_ij(l_ij(t)) <= N E(0)` for every pair and all time. As functions of s = (l - delta)/K
    /// all tensions are the same, so the pair with the smallest K has the smallest bound. One root
    /// ([`EdgeTension::push_side_root`]) therefore bounds all pairs.
    ///
    /// External accelerations w, such as wind, add at most the time integral of the sum of `|w_i - mean w|^2`/4 to E.
    /// An acceleration that is common to all vehicles adds nothing.
    ///
    /// Assumptions: exact state, no delay, no saturation, no disturbance other than wind, continuous time. Without
    /// pairs there is no bound, and the certificate is not void.
    fn certificate(&self, start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        let energy = self.try_energy(start.own);
        let mut void = Vec::new();
        if !self.graph.is_complete() {
            void.push(VoidReason::GraphNotComplete);
        }
        if let Err(fault) = energy {
            void.push(VoidReason::StartRefused(fault));
        }
        if self.is_unbounded {
            void.push(VoidReason::WindUnbounded);
        }
        let energy_initial = energy.ok();
        let promised = energy_initial.zip(self.tightest).filter(|_| void.is_empty());
        let count = start.own.count() as f64;
        // Only an incomplete graph needs the separate bound for linked pairs.
        let links_alone = energy_initial.zip(self.tightest).filter(|_| !self.graph.is_complete());
        let bounded = promised.map(|(energy, tightest)| match &self.energy_bound {
            None => BoundedEnergy { energy, until_s: None },
            Some(energy_bound) => {
                let borne = tightest.value(tightest.delta_m() + energy_bound.resolution_m()) / count;
                energy_bound.of(energy, start.time_s, borne)
            }
        });
        Certificate {
            certified_m: promised
                .zip(bounded)
                .map(|((_, tightest), most)| tightest.push_side_root(count * most.energy)),
            certified_until_s: bounded.and_then(|bounded| bounded.until_s),
            energy_initial,
            linked_m: links_alone.map(|(energy, potential)| potential.push_side_root(count * energy)),
            void,
            ..Certificate::default()
        }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            controls: Controls::Distances,
            barrier_m: Some(self.delta_m),
            certifies_under_wind: true,
            assumptions: "The certified separation holds for the complete graph, exact states of all vehicles, no \
                          delay, no limit on the control and continuous time. The wind of the scenario is the only \
                          disturbance: it adds a bounded energy, so no pair's tension exceeds N times the sum.",
            ..Capabilities::default()
        }
    }

    /// The law's forces are -(1/N) times the gradient of the sum of `V_ij` over the pairs. The Hessian of one `V_ij` in
    /// the relative position is V'' along the line of the pair and V'/l across it. Both are at most V''max, the largest
    /// V'' of any pair within the query:
    ///
    /// - On the pushing side V'' falls with l, and all tensions are one function of s. V''max is therefore V'' at
    ///   `nearest_m` for the pair with the smallest K.
    /// - On the pulling side V'/l stays below alpha/(K l) < 2 sqrt(2) alpha/K^2 = V''(d).
    ///
    /// Hence the whole Hessian is at most (V''max/N) `L_G`, whose largest eigenvalue is at most V''max, so omega^2 <=
    /// V''max. On the complete graph relative velocities decay at 1/s. The fastest rate is max(omega, 1/s).
    fn rates(&self, query: &RateQuery) -> Rates {
        let fastest = |(tension, nearest_m): (EdgeTension, f64)| tension.second_derivative(nearest_m).sqrt().max(1.0);
        let gain_per_s = 1.0 + self.a22_per_s;
        let margin = consensus_margin(self.graph.count(), gain_per_s, query.connectivity, query.a22_per_s);
        Rates {
            fastest_per_s: self.tightest.zip(query.nearest_m).map(fastest),
            velocity_margin: Some(margin),
            ..Rates::unknown(query)
        }
    }
}

#[cfg(test)]
mod tests;
