//! Optimal reciprocal collision avoidance: each vehicle takes the velocity nearest to the one it prefers that no other, doing
//! the same, needs to collide with.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, Void};
use super::consensus::{check_observation, check_range};
use super::error::{LawError, ParameterError};
use super::half_spaces::{HalfSpace, HalfSpaces};
use super::interface::LawContext;
use super::interface::ReferenceUse;
use super::interface::{Capabilities, Law, RateQuery, Rates};
use crate::formation::Formation;
use crate::observation::Observation;
use crate::space::NearLists;
use tautline_core::swarm::{Pair, Rows, row, set_row};

/// Part of a speed below which it has no direction across the line of sight.
const STRAIGHT: f64 = 1e-9;

/// The margin unless given, as a part of delta.
const MARGIN: f64 = 0.01;

/// Keys of `[law]` with `kind = "orca"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OrcaKeys {
    /// Preferred velocity towards the slot for each metre that it is away, in 1/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub k_per_s: f64,
    /// Highest speed that a vehicle prefers in m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed_m_s: f64,
    /// Highest speed that it may take in m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_speed_m_s: f64,
    /// For how long a velocity must be free of collisions in s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub horizon_s: f64,
    /// Rate at which the chosen velocity is taken on in 1/s; vehicles that are too near each other part within its inverse.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracking_per_s: f64,
    /// Highest acceleration that is commanded in m/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: f64,
    /// How many others a vehicle minds at most, the nearest ones.
    #[schemars(range(min = 1))]
    pub neighbours_max: usize,
    /// How near others must be to be minded in m; unless given, as far as two vehicles at their highest speeds come towards
    /// each other within the horizon, and what they keep apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub range_m: Option<f64>,
    /// How much more than delta vehicles mean to keep apart in m; a hundredth of delta unless given.
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

/// Optimal reciprocal collision avoidance (van den Berg, Guy, Lin, Manocha: Reciprocal n-body collision avoidance, 2011), with
/// half-spaces, for vehicles of diameter D = delta + margin that track the velocities it chooses:
///
/// ```text
/// V_i   = in |v| <= v_max and all half-spaces of i, the velocity nearest to r' + min(k |d_i|, speed) d_i/|d_i|,   d_i = h_i + r - p_i
/// u_i   = r'' + tracking (V_i - v_i) - a22 v_i,    |u_i| <= max_accel
/// ```
///
/// The velocity obstacle of a pair is the set of relative velocities that bring the two nearer than D within the horizon: a
/// cone with a round tip. Where w takes `v_i - v_j` to the boundary of that set the shortest way, with its outward normal n there,
/// the half-space of i is `n . (V - v_i - w/2) >= 0`: each of the two does half. Where not all half-spaces have a point in
/// common, the velocity that violates least is taken. Two that are nearer than D part within 1/tracking.
///
/// # Guarantee
/// None. Velocities that are taken on at once, chosen anew all the time and free of conflicts, keep delta. Accelerations that are
/// limited, velocities that are tracked, and crowds in which no velocity is free void that; without a margin, vehicles that pass come to D exactly, and rounding decides.
///
/// # Cost
/// O(near pairs) a step without allocation.
#[derive(Clone, Debug)]
pub struct OrcaLaw {
    keys: OrcaKeys,
    reference_use: ReferenceUse,
    count: usize,
    delta_m: f64,
    /// D \[m\].
    diameter_m: f64,
    a22_per_s: f64,
    range_m: f64,
    near: NearLists,
    /// Scratch: the nearest of a vehicle's near ones \[m^2\], the first `neighbours_max` of them.
    nearest: Vec<(f64, usize)>,
    half_spaces: HalfSpaces,
}

impl OrcaLaw {
    /// The law of so many vehicles; links play no part.
    ///
    /// # Errors
    /// [`ParameterError`] where graph and formation do not have the same number of vehicles, where a slot or a key is not
    /// finite, or where there is a reference that some do not know.
    pub fn new(context: &LawContext<'_>, keys: OrcaKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, delta_m, a22_per_s, .. } = context;
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
        Ok(Self {
            keys,
            reference_use: ReferenceUse::new(context)?,
            count: links.count(),
            delta_m,
            diameter_m,
            a22_per_s,
            range_m,
            near: NearLists::default(),
            nearest: Vec::new(),
            half_spaces: HalfSpaces::default(),
        })
    }

    /// Writes the velocities V \[m/s\], N x 3, that vehicles choose into `velocities`: what ORCA is before vehicles have a limit
    /// to their acceleration.
    ///
    /// # Errors
    /// [`LawError`] where a state is not finite or two vehicles are in the same place.
    pub fn velocities(&mut self, at: &Observation<'_>, velocities: &mut Rows) -> Result<(), LawError> {
        check_observation(self.count, at, velocities)?;
        self.near.update(self.count, at.near);
        for i in 0..self.count {
            self.find_nearest(at, i);
            self.half_spaces.clear();
            for place in 0..self.nearest.len() {
                let half_space = self.half_space(at, i, self.nearest[place].1)?;
                self.half_spaces.push(half_space);
            }
            let preferred = self.preferred_m_s(at, i);
            set_row(velocities, i, self.half_spaces.nearest(preferred, self.keys.max_speed_m_s).point);
        }
        check_range(velocities)
    }

    /// Where vehicle i would fly if it were alone.
    fn preferred_m_s(&self, at: &Observation<'_>, i: usize) -> Vector3<f64> {
        let reference = &at.target.reference;
        let missing_m = row(&at.target.formation.slots_m, i) + reference.position_m - row(&at.own.positions_m, i);
        reference.velocity_m_s + (self.keys.k_per_s * missing_m).cap_magnitude(self.keys.speed_m_s)
    }

    /// Keeps the nearest of those whom vehicle i sees within the range, the nearest first and of equals the lower index.
    fn find_nearest(&mut self, at: &Observation<'_>, i: usize) {
        self.nearest.clear();
        let own_m = row(&at.own.positions_m, i);
        for &j in self.near.of(i) {
            let apart = (at.seen(i, j).position_m - own_m).norm_squared();
            if apart > self.range_m * self.range_m {
                continue;
            }
            let place = self.nearest.partition_point(|&(nearer, _)| nearer <= apart);
            if place < self.keys.neighbours_max {
                self.nearest.truncate(self.keys.neighbours_max - 1);
                self.nearest.insert(place, (apart, j));
            }
        }
    }

    /// What vehicle j leaves of vehicle i's velocities.
    fn half_space(&self, at: &Observation<'_>, i: usize, j: usize) -> Result<HalfSpace, LawError> {
        let seen = at.seen(i, j);
        let own_m_s = row(&at.own.velocities_m_s, i);
        let towards_m = seen.position_m - row(&at.own.positions_m, i);
        if towards_m.norm_squared() == 0.0 {
            return Err(LawError::Collision { pair: Pair::new(i, j), separation_m: 0.0, delta_m: self.delta_m });
        }
        let (diameter_m, horizon_s) = (self.diameter_m, self.keys.horizon_s);
        let obstacle = VelocityObstacle { towards_m, diameter_m, horizon_s, parting_s: 1.0 / self.keys.tracking_per_s };
        let (normal, depth_m_s) = obstacle.way_out(own_m_s - seen.velocity_m_s);
        Ok(HalfSpace { normal, offset: normal.dot(&own_m_s) + 0.5 * depth_m_s })
    }
}

impl Law for OrcaLaw {
    fn name(&self) -> &'static str {
        "orca"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        self.velocities(at, command)?;
        let fed_m_s2 = self.reference_use.fed_m_s2(&at.target.reference);
        for i in 0..self.count {
            let own_m_s = row(&at.own.velocities_m_s, i);
            let tracked_m_s2 = (row(command, i) - own_m_s) * self.keys.tracking_per_s;
            let wanted = fed_m_s2 + tracked_m_s2 - own_m_s * self.a22_per_s;
            set_row(command, i, wanted.cap_magnitude(self.keys.max_accel_m_s2));
        }
        check_range(command)
    }

    fn certificate(&self, _start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        Certificate::void(Void::CommandLimited)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            max_command_m_s2: Some(self.keys.max_accel_m_s2),
            sensing_range_m: Some(self.range_m),
            ..self.reference_use.capabilities()
        }
    }

    /// A vehicle alone follows x'' = -tracking (x' + k x). Nothing is known where others are within the range: the velocity that
    /// is chosen may turn as fast as two of them pass. Vehicles track velocities of their own, and a22 is made up for.
    fn rates(&self, at: &RateQuery) -> Rates {
        let OrcaKeys { tracking_per_s, k_per_s, .. } = self.keys;
        let alone_per_s = tracking_per_s.max((tracking_per_s * k_per_s).sqrt());
        let is_alone = at.nearest_m.is_some_and(|nearest_m| nearest_m > self.range_m);
        Rates { fastest_per_s: is_alone.then_some(alone_per_s), common_mode_per_s: 0.0, ..Rates::unknown(at) }
    }
}

/// The relative velocities of vehicle i against vehicle j with which i comes nearer to j than a diameter within the horizon.
struct VelocityObstacle {
    /// From i to j \[m\], not zero.
    towards_m: Vector3<f64>,
    diameter_m: f64,
    horizon_s: f64,
    /// In place of the horizon where the two are too near already: the time in which they part.
    parting_s: f64,
}

impl VelocityObstacle {
    /// The outward normal where a relative velocity is nearest to the boundary, and how deep inside it lies \[m/s\]; negative
    /// outside.
    ///
    /// The set is the ball of radius diameter/horizon about `towards_m`/horizon, and its shadow away from the origin: a cone whose
    /// half-angle has the sine diameter/distance. The nearest point is on the ball where the way from its centre to the velocity
    /// leads off the cone's mantle, and on the mantle elsewhere.
    fn way_out(&self, relative_m_s: Vector3<f64>) -> (Vector3<f64>, f64) {
        let Self { towards_m, diameter_m, horizon_s, parting_s } = self;
        let distance_m = towards_m.norm();
        let sight = towards_m / distance_m;
        if distance_m <= *diameter_m {
            return self.out_of_ball(relative_m_s, *parting_s);
        }
        let from_centre = relative_m_s - towards_m / *horizon_s;
        let sine = diameter_m / distance_m;
        if -from_centre.dot(&sight) > sine * from_centre.norm() {
            return self.out_of_ball(relative_m_s, *horizon_s);
        }
        let cosine = ((distance_m - diameter_m) * (distance_m + diameter_m)).sqrt() / distance_m;
        let normal = across(relative_m_s, sight) * cosine - sight * sine;
        (normal, -normal.dot(&relative_m_s))
    }

    fn out_of_ball(&self, relative_m_s: Vector3<f64>, within_s: f64) -> (Vector3<f64>, f64) {
        let from_centre = relative_m_s - self.towards_m / within_s;
        let length = from_centre.norm();
        let normal = if length > 0.0 { from_centre / length } else { -self.towards_m.normalize() };
        (normal, self.diameter_m / within_s - length)
    }
}

/// The direction of a velocity across a line of sight. Where it has none, to the left as seen from above, so that the two of a
/// pair turn to different sides; along a vertical line of sight, to x.
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
