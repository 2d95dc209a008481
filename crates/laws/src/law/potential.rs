//! Artificial potential field: consensus on the formation, repulsion from near vehicles, damping of each own velocity.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, VoidReason};
use super::consensus::{
    add_laplacian_product, add_pushes, add_received_terms, check_count, check_observation, check_range, check_state,
    of_errors_m,
};
use super::energy::PotentialCache;
use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::interface::{Capabilities, Law, RateQuery, Rates, VelocityMargin};
use super::tension::TensionError;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::observation::Observation;
use crate::target::Target;
use tautline_core::swarm::{Pair, Rows, row, set_row};

/// Keys of `[law]` with `kind = "potential"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PotentialKeys {
    /// Gain on positions over links in 1/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub k_per_s2: f64,
    /// Damping of each vehicle's own velocity in 1/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub c_per_s: f64,
    /// Scale of the repulsion in m^4/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub eta_m4_per_s2: f64,
    /// Largest commanded acceleration in m/s^2; no limit by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: Option<f64>,
}

impl Default for PotentialKeys {
    fn default() -> Self {
        Self { k_per_s2: 1.0, c_per_s: 2.0, eta_m4_per_s2: 1.0, max_accel_m_s2: None }
    }
}

/// The potential field of Khatib (1986) between vehicles, on an undirected graph of N vehicles. With `e_i = p_i - h_i`
/// and the clearance rho = l - delta,
///
/// ```text
/// u_i = -(k/N) sum_{j in N_i} (e_i - e_j) - c v_i - sum_{j : l_ij < R} grad_i U(l_ij)
/// U(l) = (eta/2) (1/rho - 1/rho_R)^2,    R = smallest distance of two slots,    rho_R = R - delta
/// ```
///
/// Pairs nearer than the smallest slot distance repel each other, linked or not. With an acceleration limit, longer
/// accelerations are shortened to it, and the certificate is void.
///
/// # Energy
/// ```text
/// E = 1/2 sum |v_i|^2 + (k/2N) sum over links of |e_i - e_j|^2 + sum over near pairs of U
/// dE/dt = (a22 - c) sum |v_i|^2
/// ```
///
/// # Certificate
/// For c >= a22 the energy never grows, so U(l) <= E(0) for *every* pair, on every graph. Assumptions: exact states
/// over links and of near pairs, no limit on the acceleration, no disturbance, continuous time.
///
/// # Cost
/// O(links + near pairs) per step without allocation, energy included. The energy of any other state compares all
/// pairs.
#[derive(Clone, Debug)]
pub struct PotentialLaw {
    graph: Graph,
    keys: PotentialKeys,
    delta_m: f64,
    a22_per_s: f64,
    /// R \[m\].
    range_m: f64,
    /// Revision of the target that set R.
    revision: u64,
    /// Sum of U over the near pairs.
    cache: PotentialCache,
}

impl PotentialLaw {
    /// Builds the law on the links of the context, with the smallest slot distance as its range.
    ///
    /// # Errors
    /// [`ParameterError`] if graph and formation have different numbers of vehicles, a slot or a gain is not finite, or
    /// two slots are at most delta apart.
    pub fn new(context: &LawContext<'_>, keys: PotentialKeys) -> Result<Self, ParameterError> {
        let gains = [("k", keys.k_per_s2), ("c", keys.c_per_s), ("eta", keys.eta_m4_per_s2)];
        ParameterError::check(context.links, context.formation, &gains)?;
        let range_m = range(context.formation, context.delta_m).map_err(|(pair, rest_m)| ParameterError::Tension {
            pair,
            source: TensionError::Rest { rest_m, delta_m: context.delta_m },
        })?;
        Ok(Self {
            graph: context.links.clone(),
            keys,
            delta_m: context.delta_m,
            a22_per_s: context.a22_per_s,
            range_m,
            revision: 0,
            cache: PotentialCache::new(context.links.count()),
        })
    }

    /// Returns `1/rho - 1/rho_R` and 1/rho \[1/m\] at a distance within the range.
    fn steepness(&self, pair: Pair, separation_m: f64) -> Result<(f64, f64), LawError> {
        if separation_m <= self.delta_m {
            return Err(LawError::Collision { pair, separation_m, delta_m: self.delta_m });
        }
        let inverse = 1.0 / (separation_m - self.delta_m);
        Ok((inverse - 1.0 / (self.range_m - self.delta_m), inverse))
    }

    /// Returns the push of vehicle `j` on vehicle `i` at relative position `apart_m`, and U; `None` out of range.
    fn repulsion(&self, i: usize, j: usize, apart_m: Vector3<f64>) -> Result<Option<(Vector3<f64>, f64)>, LawError> {
        let separation_m = apart_m.norm();
        if separation_m >= self.range_m {
            return Ok(None);
        }
        let (steep, inverse) = self.steepness(Pair::new(i, j), separation_m)?;
        let eta_m4_per_s2 = self.keys.eta_m4_per_s2;
        let push_m_s2 = apart_m * (eta_m4_per_s2 * steep * inverse * inverse / separation_m);
        Ok(Some((push_m_s2, 0.5 * eta_m4_per_s2 * steep * steep)))
    }

    /// Sum of U over all pairs \[m^2/s^2\].
    fn repulsive_potential(&self, positions_m: &Rows) -> Result<f64, LawError> {
        let mut sum = 0.0;
        for i in 0..positions_m.nrows() {
            for j in i + 1..positions_m.nrows() {
                let repulsion = self.repulsion(i, j, row(positions_m, i) - row(positions_m, j))?;
                sum += repulsion.map_or(0.0, |(_, of_pair)| of_pair);
            }
        }
        Ok(sum)
    }

    fn try_energy(&self, observation: &Observation<'_>) -> Result<f64, LawError> {
        check_state(self.graph.count(), observation.own)?;
        let (positions_m, slots_m) = (&observation.own.positions_m, &observation.target.formation.slots_m);
        let error_m = |i| row(positions_m, i) - row(slots_m, i);
        let attraction: f64 = self.graph.edges().map(|(i, j)| (error_m(i) - error_m(j)).norm_squared()).sum();
        let repulsion = self.cache.of(positions_m).map_or_else(|| self.repulsive_potential(positions_m), Ok)?;
        let kinetic = 0.5 * observation.own.velocities_m_s.norm_squared();
        let energy =
            kinetic + 0.5 * self.keys.k_per_s2 / observation.own.count().max(1) as f64 * attraction + repulsion;
        if energy.is_finite() { Ok(energy) } else { Err(LawError::OutOfRange) }
    }
}

/// Returns R of a formation \[m\]: the smallest slot distance, which must exceed delta. Otherwise returns the pair and
/// its distance as the error.
fn range(formation: &Formation, delta_m: f64) -> Result<f64, (Pair, f64)> {
    match formation.min_distance() {
        Some((pair, distance_m)) if distance_m <= delta_m => Err((pair, distance_m)),
        nearest => Ok(nearest.map_or(f64::INFINITY, |(_, distance_m)| distance_m)),
    }
}

impl PotentialLaw {
    /// The links add at most k to omega^2. A near pair adds at most `U'' = eta (1/rho + 2 (1/rho - 1/rho_R)) / rho^3`
    /// at `nearest_m` along its line, and less across it. The number of near vehicles is at most the number of balls of
    /// diameter `nearest_m` that fit around a vehicle within R + `nearest_m`/2. The eigenvalues of a sum over pairs are
    /// at most twice the sum at a vehicle.
    fn fastest_per_s(&self, nearest_m: f64, a22_per_s: f64) -> Option<f64> {
        let nearest_m = nearest_m.min(self.range_m);
        let (steep, inverse) = self.steepness(Pair::new(0, 1), nearest_m).ok()?;
        let curvature = self.keys.eta_m4_per_s2 * inverse.powi(3) * (2.0 * steep + inverse);
        let packed = (1.0 + 2.0 * self.range_m / nearest_m).powi(3) - 1.0;
        let near = packed.min(self.graph.count().saturating_sub(1) as f64);
        let omega = (self.keys.k_per_s2 + 2.0 * near * curvature).sqrt();
        let half = 0.5 * (self.keys.c_per_s - a22_per_s).abs();
        // A mode that the repulsion destabilizes grows at up to this rate, and no other mode is faster.
        Some(half + half.hypot(omega))
    }
}

impl Law for PotentialLaw {
    fn name(&self) -> &'static str {
        "potential"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        check_observation(self.graph.count(), observation, command)?;
        command.copy_from(&observation.own.velocities_m_s);
        *command *= -self.keys.c_per_s;
        let (slots_m, gain) =
            (&observation.target.formation.slots_m, -self.keys.k_per_s2 / observation.own.count().max(1) as f64);
        if let Some(swarm) = observation.shared() {
            add_laplacian_product(&self.graph, &of_errors_m(&swarm.positions_m, slots_m), gain, command);
        } else {
            add_received_terms(observation, command, |i, own, j, received| {
                Ok(gain * ((own.position_m - row(slots_m, i)) - (received.position_m - row(slots_m, j))))
            })?;
        }
        let potential = add_pushes(observation, command, |i, j, apart_m| self.repulsion(i, j, apart_m))?;
        if let Some(potential) = potential {
            self.cache.store(&observation.own.positions_m, potential);
        }
        if let Some(limit) = self.keys.max_accel_m_s2 {
            (0..command.nrows()).for_each(|i| set_row(command, i, row(command, i).cap_magnitude(limit)));
        }
        check_range(command)
    }

    fn follow(&mut self, target: &Target<'_>) -> Result<(), LawError> {
        if target.revision != self.revision {
            check_count(self.graph.count(), target.formation.count())?;
            let delta_m = self.delta_m;
            self.range_m = range(target.formation, delta_m).map_err(|(pair, distance_m)| LawError::Target {
                pair,
                distance_m,
                delta_m,
            })?;
            self.revision = target.revision;
            self.cache.clear();
        }
        Ok(())
    }

    fn energy(&self, observation: &Observation<'_>) -> Option<f64> {
        self.try_energy(observation).ok()
    }

    fn certificate(&self, start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        let mut void = Vec::new();
        if self.keys.c_per_s < self.a22_per_s {
            void.push(VoidReason::VelocityUndamped);
        }
        if self.keys.max_accel_m_s2.is_some() {
            void.push(VoidReason::CommandLimited);
        }
        let energy = self.try_energy(start).map_err(|fault| void.push(VoidReason::StartRefused(fault))).ok();
        let certified_m = energy.filter(|_| void.is_empty() && start.own.count() > 1).map(|energy| {
            // U(l) = E(0) for the clearance rho.
            let steep = (2.0 * energy / self.keys.eta_m4_per_s2).sqrt();
            self.delta_m + 1.0 / (steep + 1.0 / (self.range_m - self.delta_m))
        });
        Certificate { certified_m, energy_initial: energy, void, ..Certificate::default() }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            needs: &[
                "a common compass",
                "each vehicle senses vehicles nearer than the slot distance",
                "each vehicle knows its own velocity",
            ],
            barrier_m: Some(self.delta_m),
            sensing_range_m: Some(self.range_m),
            max_command_m_s2: self.keys.max_accel_m_s2,
            ..Capabilities::default()
        }
    }

    fn rates(&self, query: &RateQuery) -> Rates {
        let a22_per_s = query.a22_per_s;
        Rates {
            fastest_per_s: query.nearest_m.and_then(|nearest_m| self.fastest_per_s(nearest_m, a22_per_s)),
            velocity_margin: Some(VelocityMargin {
                per_s: self.keys.c_per_s - a22_per_s,
                terms_per_s: self.keys.c_per_s + a22_per_s.abs(),
                remedy: "Raise law.c_per_s, or reduce swarm.a22_per_s.",
            }),
            common_mode_per_s: a22_per_s - self.keys.c_per_s,
            ..Rates::unknown(query)
        }
    }
}

#[cfg(test)]
mod tests;
