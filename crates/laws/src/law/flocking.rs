//! Flocking: near vehicles keep a common distance, match velocities and follow a point.

use std::f64::consts::PI;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, VoidReason};
use super::consensus::{check_count, check_observation, check_range};
use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::interface::ReferenceUse;
use super::interface::{Capabilities, Law, RateQuery, Rates};
use crate::formation::Formation;
use crate::observation::Observation;
use crate::target::Target;
use tautline_core::swarm::{Rows, mean_row, row, set_row};

/// epsilon of the sigma-norm \[1/m^2\].
const EPSILON: f64 = 0.1;
/// a = b of the action function.
const ACTION: f64 = 5.0;
/// h of the bump function.
const BUMP: f64 = 0.2;
/// r/d.
const REACH: f64 = 1.2;

/// Keys of `[law]` with `kind = "flocking"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FlockingKeys {
    /// Gain c1 on distances to near vehicles in 1/s^2; velocities are matched with 2 sqrt(c1).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub c1_alpha_per_s2: f64,
    /// Gain c1 on the way to the centre of the slots in 1/s^2; its velocity is matched with 2 sqrt(c1). Zero for a
    /// flock without an objective.
    #[schemars(extend("minimum" = 0))]
    pub c1_gamma_per_s2: f64,
    /// Largest commanded acceleration in m/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: f64,
    /// Distance d of near vehicles in m; by default the smallest slot distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub spacing_m: Option<f64>,
}

impl Default for FlockingKeys {
    fn default() -> Self {
        Self { c1_alpha_per_s2: 1.0, c1_gamma_per_s2: 0.2, max_accel_m_s2: 5.0, spacing_m: None }
    }
}

/// Flocking in free space with a group objective (Olfati-Saber: Flocking for multi-agent dynamic systems: algorithms
/// and theory, 2006, algorithm 2). The pull of the objective is limited to `c1_gamma` times a metre, as in its
/// algorithm 3:
///
/// ```text
/// u_i = c1a sum_j phi_a(|q_ij|_s) n_ij + c2a sum_j a_ij (v_j - v_i)
///       - c1g s(p_i - p_r) - c2g (v_i - v_r) + r'' - a22 v_i,   |u_i| <= a_max
/// |z|_s = (sqrt(1 + eps |z|^2) - 1)/eps,   n_ij = q_ij/sqrt(1 + eps |q_ij|^2),   q_ij = p_j - p_i,   s(z) = z/sqrt(1 + |z|^2)
/// phi_a(z) = rho(z/|r|_s) a s(z - |d|_s),   a_ij = rho(|q_ij|_s/|r|_s),   c2 = 2 sqrt(c1)
/// ```
///
/// with eps = 0.1, a = b = 5, h = 0.2 and r = 1.2 d. rho is 1 up to h and falls as a cosine to 0 at 1. `p_r` is the
/// centre of the slots moved by the reference, and `v_r` is r'. The source does not feed r'' forward. The formation is
/// an alpha-lattice: all pairs nearer than r are d apart. The law does not assign places, so it reaches given slots
/// only by chance.
///
/// # Guarantee
/// None: the force between two vehicles is bounded, so a large enough speed overcomes it.
///
/// # Cost
/// O(near pairs) per step without allocation.
#[derive(Clone, Debug)]
pub struct FlockingLaw {
    keys: FlockingKeys,
    reference_use: ReferenceUse,
    count: usize,
    a22_per_s: f64,
    /// d \[m\].
    spacing_m: f64,
    /// Revision of the target that set d.
    revision: u64,
}

impl FlockingLaw {
    /// Builds the law; links play no part.
    ///
    /// # Errors
    /// [`ParameterError`] if graph and formation have different numbers of vehicles, a slot or a key is not finite, or
    /// some vehicle does not know the reference.
    pub fn new(context: &LawContext<'_>, keys: FlockingKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, a22_per_s, .. } = context;
        let gains = [
            ("c1_alpha_per_s2", keys.c1_alpha_per_s2),
            ("c1_gamma_per_s2", keys.c1_gamma_per_s2),
            ("max_accel_m_s2", keys.max_accel_m_s2),
            ("spacing_m", keys.spacing_m.unwrap_or_default()),
        ];
        ParameterError::check(links, formation, &gains)?;
        let spacing_m = spacing_m(&keys, formation);
        let reference_use = ReferenceUse::new(context)?;
        Ok(Self { keys, reference_use, count: links.count(), a22_per_s, spacing_m, revision: 0 })
    }

    /// Returns the range r \[m\].
    fn range_m(&self) -> f64 {
        REACH * self.spacing_m
    }

    /// Returns the acceleration of a vehicle due to a neighbour at relative position q with a relative velocity.
    fn pull_m_s2(&self, towards_m: Vector3<f64>, relative_m_s: Vector3<f64>) -> Vector3<f64> {
        let c1 = self.keys.c1_alpha_per_s2;
        let stretched = (1.0 + EPSILON * towards_m.norm_squared()).sqrt();
        let (length, range) = ((stretched - 1.0) / EPSILON, sigma_norm(self.range_m()));
        let nearness = bump(length / range);
        let action = nearness * ACTION * saturated(length - sigma_norm(self.spacing_m));
        towards_m * (c1 * action / stretched) + relative_m_s * (2.0 * c1.sqrt() * nearness)
    }

    /// Returns the acceleration of vehicle i towards the objective, with a22 compensated.
    fn objective_m_s2(&self, observation: &Observation<'_>, centre_m: Vector3<f64>, i: usize) -> Vector3<f64> {
        let c1 = self.keys.c1_gamma_per_s2;
        let reference = &observation.target.reference;
        let off_m = row(&observation.own.positions_m, i) - centre_m - reference.position_m;
        let own_m_s = row(&observation.own.velocities_m_s, i);
        let off_m_s = own_m_s - reference.velocity_m_s;
        let drawn_m_s2 = off_m * (-c1 / (1.0 + off_m.norm_squared()).sqrt()) - off_m_s * (2.0 * c1.sqrt());
        self.reference_use.feed_forward_m_s2(reference) + drawn_m_s2 - own_m_s * self.a22_per_s
    }
}

/// Returns d \[m\]; 1 m for a single vehicle.
fn spacing_m(keys: &FlockingKeys, formation: &Formation) -> f64 {
    keys.spacing_m.or_else(|| formation.min_distance().map(|(_, distance_m)| distance_m)).unwrap_or(1.0)
}

/// Returns `|z|_s` of a vector of this length.
fn sigma_norm(length: f64) -> f64 {
    ((1.0 + EPSILON * length * length).sqrt() - 1.0) / EPSILON
}

/// Returns s(z).
fn saturated(z: f64) -> f64 {
    z / (1.0 + z * z).sqrt()
}

/// Returns rho(z).
fn bump(z: f64) -> f64 {
    if z < BUMP {
        1.0
    } else if z < 1.0 {
        0.5 * (1.0 + libm::cos(PI * (z - BUMP) / (1.0 - BUMP)))
    } else {
        0.0
    }
}

impl Law for FlockingLaw {
    fn name(&self) -> &'static str {
        "flocking"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        check_observation(self.count, observation, command)?;
        let centre_m = mean_row(&observation.target.formation.slots_m);
        for i in 0..self.count {
            set_row(command, i, self.objective_m_s2(observation, centre_m, i));
        }
        for &(a, b) in observation.near {
            for (i, j) in [(a, b), (b, a)] {
                let sensed = observation.sensed(i, j);
                let towards_m = sensed.position_m - row(&observation.own.positions_m, i);
                let pull = self.pull_m_s2(towards_m, sensed.velocity_m_s - row(&observation.own.velocities_m_s, i));
                let sum = row(command, i) + pull;
                set_row(command, i, sum);
            }
        }
        for i in 0..self.count {
            let limited = row(command, i).cap_magnitude(self.keys.max_accel_m_s2);
            set_row(command, i, limited);
        }
        check_range(command)
    }

    fn follow(&mut self, target: &Target<'_>) -> Result<(), LawError> {
        if target.revision != self.revision {
            check_count(self.count, target.formation.count())?;
            self.spacing_m = spacing_m(&self.keys, target.formation);
            self.revision = target.revision;
        }
        Ok(())
    }

    fn certificate(&self, _start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        Certificate::void(VoidReason::CommandLimited)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            max_command_m_s2: Some(self.keys.max_accel_m_s2),
            sensing_range_m: Some(self.range_m()),
            ..self.reference_use.capabilities()
        }
    }

    /// A near pair adds at most `c1a a ((1 + pi/(2 (1 - h) |r|_s)) r^2/(1 + eps r^2) + 1)` to the stiffness and c2a to
    /// the damping. The number of near vehicles is at most the number of balls of diameter `nearest_m` that fit around
    /// a vehicle. The eigenvalues of a sum over pairs are at most twice the sum at a vehicle. While velocities differ,
    /// velocity matching also varies with distance. The objective damps the mean velocity, and a22 is compensated.
    fn rates(&self, query: &RateQuery) -> Rates {
        let (alpha, gamma) = (self.keys.c1_alpha_per_s2, self.keys.c1_gamma_per_s2);
        let fastest_per_s = |nearest_m: f64| {
            let range_m = self.range_m();
            let packed = if nearest_m > range_m { 0.0 } else { (1.0 + 2.0 * range_m / nearest_m).powi(3) - 1.0 };
            let near = packed.min(self.count.saturating_sub(1) as f64);
            let steep = 1.0 + PI / (2.0 * (1.0 - BUMP) * sigma_norm(range_m));
            let of_pair = alpha * ACTION * (steep * range_m * range_m / (1.0 + EPSILON * range_m * range_m) + 1.0);
            let half = gamma.sqrt() + 2.0 * near * alpha.sqrt();
            half + (half * half + gamma + 2.0 * near * of_pair).sqrt()
        };
        Rates {
            fastest_per_s: query.nearest_m.map(fastest_per_s),
            common_mode_per_s: -2.0 * gamma.sqrt(),
            ..Rates::unknown(query)
        }
    }
}

#[cfg(test)]
mod tests;
