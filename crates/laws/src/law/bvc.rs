//! Buffered Voronoi cells: each vehicle flies to the point of its own cell that is nearest to its slot.

use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, VoidReason};
use super::consensus::{check_observation, check_range};
use super::error::{LawError, ParameterError};
use super::interface::{Capabilities, Law, LawContext, RateQuery, Rates};
use super::velocity_tracking::VelocityTracking;
use crate::formation::Formation;
use crate::observation::Observation;
use crate::space::NearLists;
use tautline_core::half_spaces::{HalfSpace, HalfSpaces};
use tautline_core::swarm::{Pair, Rows, row, set_row};

/// Default margin, as a fraction of delta.
const MARGIN: f64 = 0.01;

/// Keys of `[law]` with `kind = "bvc"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BvcKeys {
    /// Velocity per metre of distance from the target point in the cell, in 1/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub k_per_s: f64,
    /// Largest chosen speed in m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed_m_s: f64,
    /// Rate at which the chosen velocity is tracked in 1/s; from four times `k_per_s` on, without overshoot.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracking_per_s: f64,
    /// Largest commanded acceleration in m/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: f64,
    /// Distance that vehicles keep beyond delta in m; by default a hundredth of delta.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub margin_m: Option<f64>,
}

impl Default for BvcKeys {
    fn default() -> Self {
        Self { k_per_s: 1.0, speed_m_s: 1.0, tracking_per_s: 5.0, max_accel_m_s2: 5.0, margin_m: None }
    }
}

/// Buffered Voronoi cells (Zhou, Wang, Bandyopadhyay, Schwager: Fast, on-line collision avoidance for dynamic vehicles
/// using buffered Voronoi cells, 2017). Vehicles have diameter D = delta + margin and track the velocities V:
///
/// ```text
/// cell of i = all x with n . (x - p_i) >= -(l - D)/2 for every j,   n = (p_i - p_j)/l,   l = |p_i - p_j|
/// y_i   = point of the cell within speed/k of p_i that is nearest to h_i + r
/// V_i   = r' + k (y_i - p_i)
/// u_i   = r'' + tracking (V_i - v_i) - a22 v_i,    |u_i| <= max_accel
/// ```
///
/// Two points in the cells of two vehicles are at least D apart. If the cell has no point near the vehicle, the point
/// with the least largest violation is taken.
///
/// # Guarantee
/// None. Velocities V that are taken on at once and held for at most 1/k keep D: vehicles stay in their cells, which
/// are convex. Velocity tracking and acceleration limits break this. Vehicles may deadlock at the boundaries of their
/// cells; the rules of the source against deadlocks are not a part of this law.
///
/// # Cost
/// O(near pairs) per step without allocation.
#[derive(Clone, Debug)]
pub struct BvcLaw {
    keys: BvcKeys,
    tracking: VelocityTracking,
    count: usize,
    delta_m: f64,
    /// D \[m\].
    diameter_m: f64,
    /// Largest distance of the target point from the vehicle \[m\].
    reach_m: f64,
    near: NearLists,
    half_spaces: HalfSpaces,
}

impl BvcLaw {
    /// Builds the law; links play no part.
    ///
    /// # Errors
    /// [`ParameterError`] if graph and formation have different numbers of vehicles, a slot or a key is not finite, or
    /// some vehicle does not know the reference.
    pub fn new(context: &LawContext<'_>, keys: BvcKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, delta_m, .. } = context;
        let gains = [
            ("k_per_s", keys.k_per_s),
            ("speed_m_s", keys.speed_m_s),
            ("tracking_per_s", keys.tracking_per_s),
            ("max_accel_m_s2", keys.max_accel_m_s2),
            ("margin_m", keys.margin_m.unwrap_or_default()),
        ];
        ParameterError::check(links, formation, &gains)?;
        let diameter_m = delta_m + keys.margin_m.unwrap_or(MARGIN * delta_m);
        let reach_m = keys.speed_m_s / keys.k_per_s;
        let rates = [keys.k_per_s, keys.tracking_per_s];
        // The half-space of a vehicle at this distance contains the ball of all target points.
        let range_m = diameter_m + 2.0 * reach_m;
        let tracking = VelocityTracking::new(context, rates, keys.max_accel_m_s2, range_m)?;
        Ok(Self {
            keys,
            tracking,
            count: links.count(),
            delta_m,
            diameter_m,
            reach_m,
            near: NearLists::default(),
            half_spaces: HalfSpaces::default(),
        })
    }

    /// Writes the chosen velocities V \[m/s\], N x 3, into `velocities`.
    fn velocities(&mut self, observation: &Observation<'_>, velocities: &mut Rows) -> Result<(), LawError> {
        check_observation(self.count, observation, velocities)?;
        self.near.update(self.count, observation.near);
        let reference = &observation.target.reference;
        for i in 0..self.count {
            self.half_spaces.clear();
            for &j in self.near.of(i) {
                if let Some(half_space) = self.half_space(observation, i, j)? {
                    self.half_spaces.push(half_space);
                }
            }
            let missing_m = row(&observation.target.formation.slots_m, i) + reference.position_m
                - row(&observation.own.positions_m, i);
            let towards_m = self.half_spaces.nearest(missing_m, self.reach_m).point;
            set_row(velocities, i, reference.velocity_m_s + towards_m * self.keys.k_per_s);
        }
        check_range(velocities)
    }

    /// Returns the half-space of the cell of vehicle i that vehicle j bounds, relative to the position of i; `None` out
    /// of range.
    fn half_space(&self, observation: &Observation<'_>, i: usize, j: usize) -> Result<Option<HalfSpace>, LawError> {
        let apart_m = row(&observation.own.positions_m, i) - observation.sensed(i, j).position_m;
        let distance_m = apart_m.norm();
        if distance_m == 0.0 {
            return Err(LawError::Collision { pair: Pair::new(i, j), separation_m: 0.0, delta_m: self.delta_m });
        }
        let offset = 0.5 * (self.diameter_m - distance_m);
        Ok((distance_m <= self.tracking.range_m).then(|| HalfSpace { normal: apart_m / distance_m, offset }))
    }
}

impl Law for BvcLaw {
    fn name(&self) -> &'static str {
        "bvc"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        self.velocities(observation, command)?;
        self.tracking.command(observation, command)
    }

    fn certificate(&self, _start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        Certificate::void(VoidReason::CommandLimited)
    }

    fn capabilities(&self) -> Capabilities {
        self.tracking.capabilities()
    }

    /// With neighbours in range no bound is known: a corner of the cell may move faster than its planes.
    fn rates(&self, query: &RateQuery) -> Rates {
        self.tracking.rates(query)
    }
}

#[cfg(test)]
mod tests;
