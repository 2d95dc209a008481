//! Optimal reciprocal collision avoidance (ORCA): each vehicle takes the velocity nearest to its preferred one that
//! avoids collisions if all vehicles do the same.

use nalgebra::Vector3;
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

/// Fraction of a speed below which its component across the line of sight has no direction.
const STRAIGHT: f64 = 1e-9;

/// Default margin, as a fraction of delta.
const MARGIN: f64 = 0.01;

/// Keys of `[law]` with `kind = "orca"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OrcaKeys {
    /// Preferred velocity towards the slot per metre of distance from it, in 1/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub k_per_s: f64,
    /// Largest preferred speed in m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed_m_s: f64,
    /// Largest speed in m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_speed_m_s: f64,
    /// Time for which a velocity must be free of collisions in s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub horizon_s: f64,
    /// Rate at which the chosen velocity is tracked in 1/s; vehicles that are too near each other part within its
    /// inverse.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracking_per_s: f64,
    /// Largest commanded acceleration in m/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: f64,
    /// Largest number of neighbours that a vehicle considers, the nearest ones.
    #[schemars(range(min = 1))]
    pub neighbours_max: usize,
    /// Largest distance of a neighbour that a vehicle considers in m. By default delta + margin plus the distance that
    /// two vehicles at their highest speeds approach each other within the horizon.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub range_m: Option<f64>,
    /// Distance that vehicles keep beyond delta in m; by default a hundredth of delta.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub margin_m: Option<f64>,
}

impl Default for OrcaKeys {
    fn default() -> Self {
        Self {
            k_per_s: 1.0,
            speed_m_s: 1.0,
            max_speed_m_s: 2.0,
            horizon_s: 2.0,
            tracking_per_s: 5.0,
            max_accel_m_s2: 5.0,
            neighbours_max: 10,
            range_m: None,
            margin_m: None,
        }
    }
}

/// Optimal reciprocal collision avoidance (van den Berg, Guy, Lin, Manocha: Reciprocal n-body collision avoidance,
/// 2011) with half-spaces. Vehicles have diameter D = delta + margin and track the velocities V:
///
/// ```text
/// V_i   = velocity nearest to r' + min(k |d_i|, speed) d_i/|d_i| with |v| <= v_max in all half-spaces of i
/// d_i   = h_i + r - p_i
/// u_i   = r'' + tracking (V_i - v_i) - a22 v_i,    |u_i| <= max_accel
/// ```
///
/// The velocity obstacle of a pair is the set of relative velocities with a separation below D within the horizon: a
/// cone with a round tip. Let w be the shortest vector from `v_i - v_j` to the boundary of that set, and n the outward
/// normal there. The half-space of i is `n . (V - v_i - w/2) >= 0`, so each vehicle of the pair contributes half of w.
/// If the half-spaces have no common point, the velocity with the least largest violation is taken. Two vehicles nearer
/// than D part within 1/tracking.
///
/// # Guarantee
/// None. Velocities that are free of conflicts, chosen continuously and taken on at once keep delta. Acceleration
/// limits, velocity tracking and crowds without a free velocity break this. Without a margin, passing vehicles come to
/// exactly D, and rounding decides.
///
/// # Cost
/// O(near pairs) per step without allocation.
#[derive(Clone, Debug)]
pub struct OrcaLaw {
    keys: OrcaKeys,
    tracking: VelocityTracking,
    count: usize,
    delta_m: f64,
    /// D \[m\].
    diameter_m: f64,
    near: NearLists,
    /// Scratch: squared distances \[m^2\] and indices of the nearest near vehicles, at most `neighbours_max`.
    nearest: Vec<(f64, usize)>,
    half_spaces: HalfSpaces,
}

impl OrcaLaw {
    /// Builds the law; links play no part.
    ///
    /// # Errors
    /// [`ParameterError`] if graph and formation have different numbers of vehicles, a slot or a key is not finite, or
    /// some vehicle does not know the reference.
    pub fn new(context: &LawContext<'_>, keys: OrcaKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, delta_m, .. } = context;
        let gains = [
            ("k_per_s", keys.k_per_s),
            ("speed_m_s", keys.speed_m_s),
            ("max_speed_m_s", keys.max_speed_m_s),
            ("horizon_s", keys.horizon_s),
            ("tracking_per_s", keys.tracking_per_s),
            ("max_accel_m_s2", keys.max_accel_m_s2),
            ("range_m", keys.range_m.unwrap_or_default()),
            ("margin_m", keys.margin_m.unwrap_or_default()),
        ];
        ParameterError::check(links, formation, &gains)?;
        let diameter_m = delta_m + keys.margin_m.unwrap_or(MARGIN * delta_m);
        let range_m = keys.range_m.unwrap_or(diameter_m + 2.0 * keys.max_speed_m_s * keys.horizon_s);
        let rates = [keys.k_per_s, keys.tracking_per_s];
        let tracking = VelocityTracking::new(context, rates, keys.max_accel_m_s2, range_m)?;
        Ok(Self {
            keys,
            tracking,
            count: links.count(),
            delta_m,
            diameter_m,
            near: NearLists::default(),
            nearest: Vec::new(),
            half_spaces: HalfSpaces::default(),
        })
    }

    /// Writes the chosen velocities V \[m/s\], N x 3, into `velocities`: pure ORCA without acceleration limits.
    ///
    /// # Errors
    /// [`LawError`] if a state is not finite or two vehicles are at the same position.
    pub fn velocities(&mut self, observation: &Observation<'_>, velocities: &mut Rows) -> Result<(), LawError> {
        check_observation(self.count, observation, velocities)?;
        self.near.update(self.count, observation.near);
        for i in 0..self.count {
            self.find_nearest(observation, i);
            self.half_spaces.clear();
            for place in 0..self.nearest.len() {
                let half_space = self.half_space(observation, i, self.nearest[place].1)?;
                self.half_spaces.push(half_space);
            }
            let preferred = self.preferred_m_s(observation, i);
            set_row(velocities, i, self.half_spaces.nearest(preferred, self.keys.max_speed_m_s).point);
        }
        check_range(velocities)
    }

    /// Returns the preferred velocity of vehicle i without neighbours \[m/s\].
    fn preferred_m_s(&self, observation: &Observation<'_>, i: usize) -> Vector3<f64> {
        let reference = &observation.target.reference;
        let missing_m =
            row(&observation.target.formation.slots_m, i) + reference.position_m - row(&observation.own.positions_m, i);
        reference.velocity_m_s + (self.keys.k_per_s * missing_m).cap_magnitude(self.keys.speed_m_s)
    }

    /// Finds the nearest vehicles that vehicle i senses within the range, in order of distance and then of index.
    fn find_nearest(&mut self, observation: &Observation<'_>, i: usize) {
        self.nearest.clear();
        let own_m = row(&observation.own.positions_m, i);
        for &j in self.near.of(i) {
            let apart = (observation.sensed(i, j).position_m - own_m).norm_squared();
            if apart > self.tracking.range_m * self.tracking.range_m {
                continue;
            }
            let place = self.nearest.partition_point(|&(nearer, _)| nearer <= apart);
            if place < self.keys.neighbours_max {
                self.nearest.truncate(self.keys.neighbours_max - 1);
                self.nearest.insert(place, (apart, j));
            }
        }
    }

    /// Returns the half-space of velocities of vehicle i that vehicle j allows.
    fn half_space(&self, observation: &Observation<'_>, i: usize, j: usize) -> Result<HalfSpace, LawError> {
        let sensed = observation.sensed(i, j);
        let own_m_s = row(&observation.own.velocities_m_s, i);
        let towards_m = sensed.position_m - row(&observation.own.positions_m, i);
        if towards_m.norm_squared() == 0.0 {
            return Err(LawError::Collision { pair: Pair::new(i, j), separation_m: 0.0, delta_m: self.delta_m });
        }
        let (diameter_m, horizon_s) = (self.diameter_m, self.keys.horizon_s);
        let obstacle = VelocityObstacle { towards_m, diameter_m, horizon_s, parting_s: 1.0 / self.keys.tracking_per_s };
        let (normal, depth_m_s) = obstacle.nearest_exit(own_m_s - sensed.velocity_m_s);
        Ok(HalfSpace { normal, offset: normal.dot(&own_m_s) + 0.5 * depth_m_s })
    }
}

impl Law for OrcaLaw {
    fn name(&self) -> &'static str {
        "orca"
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

    /// With neighbours in range no bound is known: the chosen velocity may turn as fast as two vehicles pass.
    fn rates(&self, query: &RateQuery) -> Rates {
        self.tracking.rates(query)
    }
}

/// Relative velocities of vehicle i with respect to vehicle j that bring the pair nearer than a diameter within the
/// horizon.
struct VelocityObstacle {
    /// Vector from i to j \[m\], not zero.
    towards_m: Vector3<f64>,
    diameter_m: f64,
    horizon_s: f64,
    /// Time to part, used in place of the horizon if the pair is already too near.
    parting_s: f64,
}

impl VelocityObstacle {
    /// Returns the outward normal at the boundary point nearest to a relative velocity, and the depth of the velocity
    /// inside the set \[m/s\]; negative outside.
    ///
    /// The set is the ball of radius diameter/horizon about `towards_m`/horizon and its shadow away from the origin.
    /// The shadow is a cone whose half-angle has the sine diameter/distance. The nearest point is on the ball if the
    /// vector from the centre to the velocity points off the cone's lateral surface, and on that surface otherwise.
    fn nearest_exit(&self, relative_m_s: Vector3<f64>) -> (Vector3<f64>, f64) {
        let Self { towards_m, diameter_m, horizon_s, parting_s } = self;
        let distance_m = towards_m.norm();
        let sight = towards_m / distance_m;
        if distance_m <= *diameter_m {
            return self.exit_ball(relative_m_s, *parting_s);
        }
        let from_centre = relative_m_s - towards_m / *horizon_s;
        let sine = diameter_m / distance_m;
        if -from_centre.dot(&sight) > sine * from_centre.norm() {
            return self.exit_ball(relative_m_s, *horizon_s);
        }
        let cosine = ((distance_m - diameter_m) * (distance_m + diameter_m)).sqrt() / distance_m;
        let normal = across(relative_m_s, sight) * cosine - sight * sine;
        (normal, -normal.dot(&relative_m_s))
    }

    fn exit_ball(&self, relative_m_s: Vector3<f64>, within_s: f64) -> (Vector3<f64>, f64) {
        let from_centre = relative_m_s - self.towards_m / within_s;
        let length = from_centre.norm();
        let normal = if length > 0.0 { from_centre / length } else { -self.towards_m.normalize() };
        (normal, self.diameter_m / within_s - length)
    }
}

/// Returns the unit direction of a velocity across a line of sight. If it has none, returns left as seen from above, so
/// that the two vehicles turn to different sides; along a vertical line of sight, x.
fn across(velocity_m_s: Vector3<f64>, sight: Vector3<f64>) -> Vector3<f64> {
    let rest = velocity_m_s - sight * sight.dot(&velocity_m_s);
    let rest = rest - sight * sight.dot(&rest);
    let length = rest.norm();
    if length > STRAIGHT * velocity_m_s.norm() {
        return rest / length;
    }
    let left = Vector3::new(-sight.y, sight.x, 0.0);
    let length = left.norm();
    if length > STRAIGHT { left / length } else { Vector3::x() * sight.z.signum() }
}

#[cfg(test)]
mod tests;
