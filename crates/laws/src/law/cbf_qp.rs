//! Control barrier functions: the acceleration nearest to that of a nominal controller that keeps every pair able to
//! brake.
//!
//! The nominal variant has the pairwise barriers of L. Wang, A. D. Ames and M. Egerstedt (IEEE Transactions on Robotics
//! 33, 661, 2017). Their program may be infeasible. Section VI of the paper therefore adds barriers of braking (15) and
//! a braking controller (17). The braking variant follows this idea; its equations are derived in [`braking`].

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use self::braking::Braking;
use super::certificate::{Certificate, VoidReason};
use super::consensus::{check_observation, check_range};
use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::interface::ReferenceUse;
use super::interface::{Capabilities, Law, RateQuery, Rates};
use crate::formation::Formation;
use crate::observation::Observation;
use crate::space::NearLists;
use tautline_core::half_spaces::{HalfSpace, HalfSpaces};
use tautline_core::swarm::{Pair, Rows, row, set_row};

mod braking;

/// Smallest clearance used for a pair, as a fraction of delta: the slope of the barrier is infinite at clearance 0.
const LEAST_CLEARANCE: f64 = 1e-6;

/// Default margin of the braking variant, as a fraction of delta.
const MARGIN: f64 = 0.01;
/// Default rate coefficient kappa of the braking variant \[1/s\].
const APPROACH_PER_S: f64 = 5.0;

/// Barrier of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CbfQpVariant {
    /// Braking of both vehicles along their line of sight. Several pairs can be infeasible together.
    #[default]
    Nominal,
    /// Distance of the braking segments of both vehicles. Braking stays feasible, and replaces an infeasible command.
    Braking,
}

/// Keys of `[law]` with `kind = "cbf-qp"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CbfQpKeys {
    /// Barrier of a pair.
    pub variant: CbfQpVariant,
    /// Gain of the nominal controller on the way to the slot in 1/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub k_per_s2: f64,
    /// Gain of the nominal controller on velocity in 1/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub c_per_s: f64,
    /// Largest speed of the nominal controller in m/s; in the braking variant of the vehicle, with the reference.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_speed_m_s: f64,
    /// Largest commanded acceleration in m/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: f64,
    /// Rate coefficient gamma of the nominal barrier in s/m^2: h' >= -gamma h^3. The braking variant does not use it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub gamma_s_per_m2: f64,
    /// Rate coefficient kappa of the braking barrier in 1/s: h' >= -kappa h; by default 5. A quarter of the rate at
    /// which a slow vehicle brakes. Only with `variant = "braking"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub approach_per_s: Option<f64>,
    /// Distance that vehicles keep beyond delta in m; by default a hundredth of delta. Only with
    /// `variant = "braking"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub margin_m: Option<f64>,
}

impl Default for CbfQpKeys {
    fn default() -> Self {
        Self {
            variant: CbfQpVariant::Nominal,
            k_per_s2: 1.0,
            c_per_s: 2.0,
            max_speed_m_s: 2.0,
            max_accel_m_s2: 5.0,
            gamma_s_per_m2: 1.0,
            approach_per_s: None,
            margin_m: None,
        }
    }
}

impl CbfQpKeys {
    /// Returns the brake of the braking variant; `None` for the nominal variant.
    fn braking(&self, delta_m: f64, a22_per_s: f64) -> Result<Option<Braking>, ParameterError> {
        if self.variant == CbfQpVariant::Nominal {
            let given = [("approach_per_s", self.approach_per_s), ("margin_m", self.margin_m)];
            return match given.into_iter().find_map(|(name, value)| Some((name, value?))) {
                Some((name, value)) => Err(ParameterError::OnlyBraking { name, value }),
                None => Ok(None),
            };
        }
        let braking = Braking {
            max_accel_m_s2: self.max_accel_m_s2,
            max_speed_m_s: self.max_speed_m_s,
            a22_per_s,
            apart_m: delta_m + self.margin_m.unwrap_or(MARGIN * delta_m),
            approach_per_s: self.approach_per_s.unwrap_or(APPROACH_PER_S),
        };
        braking.check().map(|()| Some(braking))
    }
}

/// Safety barrier certificates (Wang, Ames, Egerstedt: Safety barrier certificates for collisions-free multirobot
/// systems, 2017) around a proportional-derivative controller to the slot. Decentralised, with the same limit for all
/// vehicles:
///
/// ```text
/// U_i = r'' - c (v_i - V_i) - a22 v_i,   V_i = r' + min((k/c) |d_i|, v_max) d_i/|d_i|,   d_i = h_i + r - p_i
/// u_i = acceleration nearest to U_i with |u| <= a_max in all half-spaces of i
/// ```
///
/// # Nominal variant
/// A = 2 `a_max` is the joint braking of two vehicles. The unit vector n points from vehicle j to vehicle i, l is
/// their separation, and w = `v_i - v_j` their relative velocity. A pair is safe while
///
/// ```text
/// h = sqrt(2 A (l - delta)) + n . w >= 0
/// ```
///
/// and stays safe while h' >= -gamma h^3, that is, while
///
/// ```text
/// -n . (u_i - u_j) <= B,   B = gamma h^3 + (|w|^2 - (n . w)^2)/l + A n . w / sqrt(2 A (l - delta)) + a22 n . w
/// ```
///
/// Each vehicle of the pair ensures half of it: `n . u_i >= -B/2`. For a separation below delta the root in h is that
/// of delta - l with a negative sign, which parts the pair. If the half-spaces have no common point, the acceleration
/// with the least largest violation is commanded.
///
/// # Braking variant
/// The barrier of a pair is the distance of the two braking segments less D = delta + margin. Vehicle i keeps its stop
/// point on its side of the mid-plane between the segments, and its speed below `v_max` (`cbf_qp/braking.rs`). If no
/// acceleration is in all half-spaces, it brakes with up to `a_max` against its velocity.
///
/// # Guarantee
/// Nominal: none for a swarm. A single pair that starts with h >= 0 keeps delta, in continuous time with a22 = 0. A
/// vehicle with several neighbours may have no acceleration in all of its half-spaces.
///
/// Braking: a swarm keeps D if the segments of all pairs are D apart at the start and no speed exceeds `v_max` then.
/// States must be exact, commands carried out and time continuous. Drag shortens brakes, and the segments cover
/// a22 > 0. With commands that are held for long, distances fall below D.
///
/// # Cost
/// O(near pairs) per step without allocation.
#[derive(Clone, Debug)]
pub struct CbfQpLaw {
    keys: CbfQpKeys,
    reference_use: ReferenceUse,
    count: usize,
    delta_m: f64,
    a22_per_s: f64,
    range_m: f64,
    /// Brake of the braking variant.
    braking: Option<Braking>,
    near: NearLists,
    half_spaces: HalfSpaces,
}

impl CbfQpLaw {
    /// Builds the law; links play no part.
    ///
    /// # Errors
    /// [`ParameterError`] if graph and formation have different numbers of vehicles, a slot or a key is not finite, or
    /// some vehicle does not know the reference. In the nominal variant, if a key of the braking variant is given. In
    /// the braking variant, if a22 exceeds the brake at the largest speed.
    pub fn new(context: &LawContext<'_>, keys: CbfQpKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, delta_m, a22_per_s, .. } = context;
        let gains = [
            ("k_per_s2", keys.k_per_s2),
            ("c_per_s", keys.c_per_s),
            ("max_speed_m_s", keys.max_speed_m_s),
            ("max_accel_m_s2", keys.max_accel_m_s2),
            ("gamma_s_per_m2", keys.gamma_s_per_m2),
            ("approach_per_s", keys.approach_per_s.unwrap_or_default()),
            ("margin_m", keys.margin_m.unwrap_or_default()),
        ];
        ParameterError::check(links, formation, &gains)?;
        let braking = keys.braking(delta_m, a22_per_s)?;
        Ok(Self {
            range_m: braking.map_or_else(|| range_m(&keys, delta_m, a22_per_s), |braking| braking.range_m()),
            braking,
            keys,
            reference_use: ReferenceUse::new(context)?,
            count: links.count(),
            delta_m,
            a22_per_s,
            near: NearLists::default(),
            half_spaces: HalfSpaces::default(),
        })
    }

    /// Returns the acceleration of the nominal controller for vehicle i \[m/s^2\].
    fn nominal_m_s2(&self, observation: &Observation<'_>, i: usize) -> Vector3<f64> {
        let CbfQpKeys { k_per_s2, c_per_s, max_speed_m_s, .. } = self.keys;
        let reference = &observation.target.reference;
        let missing_m =
            row(&observation.target.formation.slots_m, i) + reference.position_m - row(&observation.own.positions_m, i);
        let wanted_m_s = reference.velocity_m_s + (missing_m * (k_per_s2 / c_per_s)).cap_magnitude(max_speed_m_s);
        let own_m_s = row(&observation.own.velocities_m_s, i);
        self.reference_use.feed_forward_m_s2(reference) + c_per_s * (wanted_m_s - own_m_s) - self.a22_per_s * own_m_s
    }

    /// Returns the half-space of accelerations of vehicle i that vehicle j allows; `None` out of range.
    fn half_space(&self, observation: &Observation<'_>, i: usize, j: usize) -> Result<Option<HalfSpace>, LawError> {
        let sensed = observation.sensed(i, j);
        let own_m_s = row(&observation.own.velocities_m_s, i);
        let apart_m = row(&observation.own.positions_m, i) - sensed.position_m;
        let distance_m = apart_m.norm();
        let collision = LawError::Collision { pair: Pair::new(i, j), separation_m: 0.0, delta_m: self.delta_m };
        if distance_m == 0.0 {
            return Err(collision);
        }
        if distance_m > self.range_m {
            return Ok(None);
        }
        if let Some(braking) = &self.braking {
            let own = (row(&observation.own.positions_m, i), own_m_s);
            return braking.half_space(own, (sensed.position_m, sensed.velocity_m_s)).map(Some).ok_or(collision);
        }
        let normal = apart_m / distance_m;
        let bound = self.bound_m_s2(normal, distance_m, own_m_s - sensed.velocity_m_s);
        Ok(Some(HalfSpace { normal, offset: -0.5 * bound }))
    }

    /// Returns the acceleration of vehicle i that is nearest to that of the nominal controller \[m/s^2\], in the
    /// half-spaces of its pairs.
    fn chosen_m_s2(&mut self, observation: &Observation<'_>, i: usize) -> Vector3<f64> {
        let nominal_m_s2 = self.nominal_m_s2(observation, i);
        let Some(braking) = &self.braking else {
            return self.half_spaces.nearest(nominal_m_s2, self.keys.max_accel_m_s2).point;
        };
        let own_m_s = row(&observation.own.velocities_m_s, i);
        if let Some(limit) = braking.speed_limit(own_m_s) {
            self.half_spaces.push(limit);
        }
        let chosen_m_s2 = self.half_spaces.nearest_inside(nominal_m_s2, self.keys.max_accel_m_s2);
        chosen_m_s2.unwrap_or_else(|| braking.command_m_s2(own_m_s))
    }

    /// Returns B of a pair \[m/s^2\].
    fn bound_m_s2(&self, normal: Vector3<f64>, distance_m: f64, relative_m_s: Vector3<f64>) -> f64 {
        let both_m_s2 = 2.0 * self.keys.max_accel_m_s2;
        let clearance_m = distance_m - self.delta_m;
        let root_m_s = (2.0 * both_m_s2 * clearance_m.abs().max(LEAST_CLEARANCE * self.delta_m)).sqrt();
        let braked_m_s = root_m_s.copysign(clearance_m);
        let parting_m_s = normal.dot(&relative_m_s);
        let barrier_m_s = braked_m_s + parting_m_s;
        self.keys.gamma_s_per_m2 * barrier_m_s.powi(3)
            + (relative_m_s.norm_squared() - parting_m_s * parting_m_s) / distance_m
            + both_m_s2 * parting_m_s / root_m_s
            + self.a22_per_s * parting_m_s
    }
}

/// Returns the distance beyond which the half-spaces of a pair below the highest speed contain every allowed
/// acceleration \[m\].
///
/// With s = sqrt(2 A (l - delta)) at least the relative speed V, B is at least `gamma (s - V)^3 - A - a22 V`. The
/// closing acceleration `-n . (u_i - u_j)` is at most A.
fn range_m(keys: &CbfQpKeys, delta_m: f64, a22_per_s: f64) -> f64 {
    let (both_m_s2, closing_m_s) = (2.0 * keys.max_accel_m_s2, 2.0 * keys.max_speed_m_s);
    let spare_m_s2 = 2.0 * both_m_s2 + a22_per_s.max(0.0) * closing_m_s;
    let braked_m_s = closing_m_s + libm::cbrt(spare_m_s2 / keys.gamma_s_per_m2);
    delta_m + braked_m_s * braked_m_s / (2.0 * both_m_s2)
}

impl Law for CbfQpLaw {
    fn name(&self) -> &'static str {
        "cbf-qp"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        check_observation(self.count, observation, command)?;
        self.near.update(self.count, observation.near);
        for i in 0..self.count {
            self.half_spaces.clear();
            for &j in self.near.of(i) {
                if let Some(half_space) = self.half_space(observation, i, j)? {
                    self.half_spaces.push(half_space);
                }
            }
            let chosen_m_s2 = self.chosen_m_s2(observation, i);
            set_row(command, i, chosen_m_s2);
        }
        check_range(command)
    }

    fn certificate(&self, _start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        let is_braking = self.braking.is_some();
        Certificate::void(if is_braking { VoidReason::NoBoundComputed } else { VoidReason::CommandLimited })
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            max_command_m_s2: Some(self.keys.max_accel_m_s2),
            sensing_range_m: Some(self.range_m),
            ..self.reference_use.capabilities()
        }
    }

    /// A vehicle without neighbours follows x'' = -c x' - k x; in the braking variant its speed approaches the largest
    /// one at most at the rate kappa. With neighbours in range no bound is known: a corner of
    /// several half-spaces may move as fast as two of their planes close. The law controls absolute positions, and a22
    /// is compensated.
    fn rates(&self, query: &RateQuery) -> Rates {
        let speed_limit_per_s = self.braking.map_or(0.0, |braking| braking.approach_per_s);
        let alone_per_s = self.keys.c_per_s.max(self.keys.k_per_s2.sqrt()).max(speed_limit_per_s);
        let is_alone = query.nearest_m.is_some_and(|nearest_m| nearest_m > self.range_m);
        Rates { fastest_per_s: is_alone.then_some(alone_per_s), common_mode_per_s: 0.0, ..Rates::unknown(query) }
    }
}

#[cfg(test)]
mod tests;
