//! Braking variant: barriers between braking segments.
//!
//! A vehicle at p with velocity v reserves its braking segment, from p to its stop point s = p + L(|v|) v/|v|. A
//! vehicle that brakes moves along its segment to s, and its segment only shrinks.
//!
//! # Barrier of a pair
//! Let d be the distance of the two segments and D the distance to keep. The barrier is h = d - D. Let n be the unit
//! vector between the closest points, from vehicle j to vehicle i, and let the mid-plane lie halfway between them.
//! Vehicle i ensures, with the clearance c of its stop point beyond D/2 from the mid-plane,
//!
//! ```text
//! n . s_i' >= -kappa c,   c = n . s_i - n . (x_i + x_j)/2 - D/2
//! ```
//!
//! and vehicle j the same with -n. The distance of the segments is at least their gap along a constant n. The end of
//! the segment of i with the smaller extent along n bounds this gap. If this end is s, then c = h/2. If it is p, then
//! n . v >= 0, and p does not approach the plane. Hence h' >= -kappa h, also where the closest points are not unique.
//!
//! # Feasibility
//! With the deceleration |v|/L'(|v|) against the velocity, s' = 0: this command is in all half-spaces while h >= 0. It
//! is at most A unless drag alone decelerates by more than 2 A. Then no command may be feasible, and the brake, which
//! keeps h from falling, is commanded.

use nalgebra::Vector3;

use super::super::error::ParameterError;
use tautline_core::half_spaces::HalfSpace;

/// Ratio of the braking rate at low speed to the rate coefficient kappa.
const BRAKING_RATIO: f64 = 4.0;
/// Smallest deceleration as a fraction of the largest acceleration, for states faster than the law allows.
const LEAST_DECELERATION: f64 = 1e-3;
/// Distance of two segments, as a fraction of D, below which the direction between them is rounding.
const TOUCHING: f64 = 1e-9;
/// Squared sine of the angle below which two segments count as parallel.
const PARALLEL: f64 = 1e-12;
/// Fraction of the largest speed below which the limit of the speed is inactive.
const SLOW: f64 = 0.5;

/// Position \[m\] and velocity \[m/s\] of a vehicle.
pub(super) type State = (Vector3<f64>, Vector3<f64>);

/// Brake of a vehicle, and the half-spaces of accelerations that keep its braking segment clear of others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Braking {
    /// Largest acceleration A \[m/s^2\].
    pub(super) max_accel_m_s2: f64,
    /// Largest speed V \[m/s\].
    pub(super) max_speed_m_s: f64,
    /// Velocity coefficient a22 of the vehicles \[1/s\].
    pub(super) a22_per_s: f64,
    /// Distance D that vehicles keep \[m\].
    pub(super) apart_m: f64,
    /// Rate coefficient kappa \[1/s\].
    pub(super) approach_per_s: f64,
}

impl Braking {
    /// Checks that a vehicle can brake from its largest speed.
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        let &Self { max_accel_m_s2, max_speed_m_s, a22_per_s, .. } = self;
        if a22_per_s * max_speed_m_s < (1.0 - LEAST_DECELERATION) * max_accel_m_s2 {
            return Ok(());
        }
        Err(ParameterError::CannotBrake { max_speed_m_s, max_accel_m_s2, a22_per_s })
    }

    /// Rate r at which velocities decay under the brake at low speed \[1/s\].
    fn braking_per_s(&self) -> f64 {
        BRAKING_RATIO * self.approach_per_s
    }

    /// Returns the speed below which the brake is proportional to the velocity \[m/s\].
    fn slow_m_s(&self) -> f64 {
        self.max_accel_m_s2 / (self.braking_per_s() + self.a22_per_s.max(0.0))
    }

    /// Returns the deceleration that the brake always reaches \[m/s^2\]: A - a22 v, or A where drag helps.
    fn deceleration_m_s2(&self, speed_m_s: f64) -> f64 {
        (self.max_accel_m_s2 - self.a22_per_s.max(0.0) * speed_m_s).max(LEAST_DECELERATION * self.max_accel_m_s2)
    }

    /// Returns an upper bound L of the braking path \[m\]: v/r at low speed, and beyond it the path at constant
    /// deceleration.
    pub(super) fn path_m(&self, speed_m_s: f64) -> f64 {
        let slow_m_s = speed_m_s.min(self.slow_m_s());
        slow_m_s / self.braking_per_s()
            + (speed_m_s - slow_m_s) * (speed_m_s + slow_m_s) / (2.0 * self.deceleration_m_s2(speed_m_s))
    }

    /// Returns the derivative L' of the braking path by the speed \[s\]; at least the speed over the deceleration.
    pub(super) fn slope_s(&self, speed_m_s: f64) -> f64 {
        let slow_m_s = self.slow_m_s();
        if speed_m_s <= slow_m_s {
            return 1.0 / self.braking_per_s();
        }
        let deceleration_m_s2 = self.deceleration_m_s2(speed_m_s);
        let shrinking_m_s2 = 0.5 * self.a22_per_s.max(0.0) * (speed_m_s - slow_m_s) * (speed_m_s + slow_m_s);
        (speed_m_s + shrinking_m_s2 / deceleration_m_s2) / deceleration_m_s2
    }

    /// Returns the braking segment of a vehicle: its position and its stop point \[m\].
    pub(super) fn segment(&self, (position_m, velocity_m_s): State) -> [Vector3<f64>; 2] {
        let speed_m_s = velocity_m_s.norm();
        let per_speed_s = if speed_m_s > 0.0 { self.path_m(speed_m_s) / speed_m_s } else { 0.0 };
        [position_m, position_m + velocity_m_s * per_speed_s]
    }

    /// Returns the command of the brake \[m/s^2\]. Its deceleration is at least the speed over L'.
    pub(super) fn command_m_s2(&self, velocity_m_s: Vector3<f64>) -> Vector3<f64> {
        let gain_per_s = (self.braking_per_s() + self.a22_per_s).max(0.0);
        (velocity_m_s * -gain_per_s).cap_magnitude(self.max_accel_m_s2)
    }

    /// Returns the distance beyond which the half-spaces of a pair contain every allowed acceleration, for speeds of
    /// at most V \[m\].
    ///
    /// The stop point moves with at most V + L' (A + |a22| V). Its clearance is at least half of the distance less D
    /// and two braking paths.
    pub(super) fn range_m(&self) -> f64 {
        let &Self { max_speed_m_s, approach_per_s, .. } = self;
        let accel_m_s2 = self.max_accel_m_s2 + self.a22_per_s.abs() * max_speed_m_s;
        let stop_m_s = max_speed_m_s + self.slope_s(max_speed_m_s) * accel_m_s2;
        self.apart_m + 2.0 * self.path_m(max_speed_m_s) + 2.0 * stop_m_s / approach_per_s
    }

    /// Returns the half-space of accelerations of a vehicle that keeps its stop point on its side of the mid-plane to
    /// another vehicle. `None` if both are at the same position.
    ///
    /// With the acceleration a = u + a22 v and e = v/|v|, s' = v + (L/|v|) (a - e (e . a)) + L' e (e . a).
    pub(super) fn half_space(&self, own: State, other: State) -> Option<HalfSpace> {
        let [own_segment, other_segment] = [self.segment(own), self.segment(other)];
        let (normal, middle_m) = self.mid_plane(own_segment, other_segment)?;
        let clearance_m = normal.dot(&(own_segment[1] - middle_m)) - 0.5 * self.apart_m;
        let velocity_m_s = own.1;
        let speed_m_s = velocity_m_s.norm();
        let slope_s = self.slope_s(speed_m_s);
        let gradient_s = if speed_m_s > self.slow_m_s() {
            let (forward, across_s) = (velocity_m_s / speed_m_s, self.path_m(speed_m_s) / speed_m_s);
            normal * across_s + forward * ((slope_s - across_s) * forward.dot(&normal))
        } else {
            normal * slope_s
        };
        let unforced_m_s = normal.dot(&velocity_m_s) + self.a22_per_s * gradient_s.dot(&velocity_m_s);
        let length_s = gradient_s.norm();
        let offset = (-self.approach_per_s * clearance_m - unforced_m_s) / length_s;
        Some(HalfSpace { normal: gradient_s / length_s, offset })
    }

    /// Returns the unit vector from the closest point of the other segment to that of the own one, and the point
    /// halfway between them \[m\]. Segments that touch have no such vector; those of their positions stand in.
    fn mid_plane(&self, own: [Vector3<f64>; 2], other: [Vector3<f64>; 2]) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let between = |own_m: Vector3<f64>, other_m: Vector3<f64>| {
            let apart_m = own_m - other_m;
            let distance_m = apart_m.norm();
            (distance_m, apart_m / distance_m, (own_m + other_m) * 0.5)
        };
        let (own_m, other_m) = closest_points(own, other);
        let (distance_m, normal, middle_m) = between(own_m, other_m);
        if distance_m > TOUCHING * self.apart_m {
            return Some((normal, middle_m));
        }
        let (distance_m, normal, middle_m) = between(own[0], other[0]);
        (distance_m > 0.0).then_some((normal, middle_m))
    }

    /// Returns the half-space of accelerations of a vehicle that keeps its speed below V, with the rate of the barrier:
    /// |v|' <= kappa (V - |v|). `None` for a slow vehicle.
    pub(super) fn speed_limit(&self, velocity_m_s: Vector3<f64>) -> Option<HalfSpace> {
        let speed_m_s = velocity_m_s.norm();
        let spare_m_s = self.max_speed_m_s - speed_m_s;
        (speed_m_s > SLOW * self.max_speed_m_s).then(|| HalfSpace {
            normal: velocity_m_s / -speed_m_s,
            offset: self.a22_per_s * speed_m_s - self.approach_per_s * spare_m_s,
        })
    }
}

/// Returns the closest points of two segments \[m\].
///
/// They include an end of a segment, or lie inside two segments that are not parallel. Rounding of nearly parallel
/// segments therefore only selects among points whose distances differ by rounding.
pub(super) fn closest_points(one: [Vector3<f64>; 2], other: [Vector3<f64>; 2]) -> (Vector3<f64>, Vector3<f64>) {
    let [along_one, along_other] = [one[1] - one[0], other[1] - other[0]];
    let on = |segment: [Vector3<f64>; 2], along: Vector3<f64>, point: Vector3<f64>| {
        let length_squared = along.norm_squared();
        let share = if length_squared > 0.0 { along.dot(&(point - segment[0])) / length_squared } else { 0.0 };
        segment[0] + along * share.clamp(0.0, 1.0)
    };
    let mut best = (one[0], on(other, along_other, one[0]));
    let mut least = (best.0 - best.1).norm_squared();
    let mut offer = |points: (Vector3<f64>, Vector3<f64>)| {
        let squared = (points.0 - points.1).norm_squared();
        if squared < least {
            (best, least) = (points, squared);
        }
    };
    offer((one[1], on(other, along_other, one[1])));
    offer((on(one, along_one, other[0]), other[0]));
    offer((on(one, along_one, other[1]), other[1]));
    let across = along_one.cross(&along_other);
    let sine_squared = across.norm_squared();
    if sine_squared > PARALLEL * along_one.norm_squared() * along_other.norm_squared() {
        let share = (other[0] - one[0]).cross(&along_other).dot(&across) / sine_squared;
        let inside = one[0] + along_one * share.clamp(0.0, 1.0);
        offer((inside, on(other, along_other, inside)));
    }
    best
}

#[cfg(test)]
mod tests;
