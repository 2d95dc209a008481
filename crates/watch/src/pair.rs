//! Separation of two vehicles ahead of time, from positions, velocities, ages and bounds.
//!
//! # Derivation
//!
//! Vehicle i sent the position `p_i` and the velocity `v_i` of the time `s_i`. The age of both is `a_i = now - s_i`.
//! The true motion `x_i` satisfies three bounds:
//!
//! ```text
//! |x_i(s_i) - p_i| <= eps      |x_i'(s_i) - v_i| <= e_i      |x_i''| <= A
//! ```
//!
//! Taylor's theorem with the remainder of second order gives, for `t >= 0` after now,
//!
//! ```text
//! |x_i(now + t) - (p_i + v_i (a_i + t))| <= eps + e_i (a_i + t) + A (a_i + t)^2 / 2
//! ```
//!
//! With `dp = (p_i + v_i a_i) - (p_j + v_j a_j)` and `dv = v_i - v_j` the triangle inequality gives
//!
//! ```text
//! |x_i - x_j|(now + t) >= |dp + dv t| - U(t)
//! U(t) = u0 + u1 t + u2 t^2
//! u0 = sum over i, j of (eps + e a + A a^2 / 2)      u1 = sum of (e + A a)      u2 = A
//! ```
//!
//! Without ages this is `|dp + dv t| - A t^2 - 2 eps - 2 e t`. The pair is clear until the first `t` at which the right
//! side is below delta.
//!
//! A velocity that is not sent is the difference quotient of two positions, `h` apart. The mean velocity over `h`
//! differs from the velocity at its end by at most `A h / 2`, so `e_i = 2 eps / h + A h / 2`.

use nalgebra::Vector3;

/// Largest number of steps of a search for a root. A search that ends early returns an earlier time.
const MOST_STEPS: usize = 64;
/// Step below which a search has found its root \[s\].
const LEAST_STEP_S: f64 = 1e-9;

/// Expected position of a vehicle at the present, and how its error grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Position at the present by constant velocity since the stamp \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity at the stamp \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Bound on the error of the position at the present \[m\].
    pub error_m: f64,
    /// Growth of the bound per second at the present \[m/s\].
    pub error_m_s: f64,
    /// Half of the bound on acceleration: the quadratic growth \[m/s^2\].
    pub error_m_s2: f64,
}

impl Prediction {
    /// Returns the prediction from a position and a velocity of the age `age_s`, with the errors `position_error_m`
    /// and `velocity_error_m_s` and the bound `accel_m_s2` on the acceleration.
    #[must_use]
    pub fn new(
        position_m: Vector3<f64>,
        velocity_m_s: Vector3<f64>,
        age_s: f64,
        position_error_m: f64,
        velocity_error_m_s: f64,
        accel_m_s2: f64,
    ) -> Self {
        Self {
            position_m: position_m + velocity_m_s * age_s,
            velocity_m_s,
            error_m: position_error_m + velocity_error_m_s * age_s + accel_m_s2 * age_s * age_s / 2.0,
            error_m_s: velocity_error_m_s + accel_m_s2 * age_s,
            error_m_s2: accel_m_s2 / 2.0,
        }
    }
}

/// Relative motion of two vehicles with the bound U on its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeMotion {
    dp: Vector3<f64>,
    dv: Vector3<f64>,
    u: [f64; 3],
}

impl RelativeMotion {
    /// Returns the motion of `a` relative to `b`.
    #[must_use]
    pub fn new(a: &Prediction, b: &Prediction) -> Self {
        // Bound on the rounding of the coordinates and of this computation.
        let rounding_m = 1e-9 + 16.0 * f64::EPSILON * (a.position_m.amax() + b.position_m.amax());
        Self {
            dp: a.position_m - b.position_m,
            dv: a.velocity_m_s - b.velocity_m_s,
            u: [a.error_m + b.error_m + rounding_m, a.error_m_s + b.error_m_s, a.error_m_s2 + b.error_m_s2],
        }
    }

    /// Returns the separation at the present by constant velocity \[m\].
    #[must_use]
    pub fn nominal_m(&self) -> f64 {
        self.dp.norm()
    }

    /// Returns the smallest separation at the present that the bounds allow \[m\]; negative if they allow contact.
    #[must_use]
    pub fn least_m(&self) -> f64 {
        self.nominal_m() - self.u[0]
    }

    /// Returns whether the separation is at least `delta_m` for `time_s`, by a test that needs no search. `false`
    /// decides nothing.
    #[must_use]
    pub fn is_clear_for(&self, time_s: f64, delta_m: f64) -> bool {
        self.nominal_m() - self.dv.norm() * time_s - self.error_at(time_s) >= delta_m
    }

    /// Returns for how long from the present the separation is at least `delta_m` \[s\], at most `horizon_s`; `None`
    /// if the bounds allow a smaller separation at the present. The result is never above the exact time.
    ///
    /// Each step follows the tangent of `|dp + dv t|`, which lies below this convex function, to the root of a
    /// quadratic.
    #[must_use]
    pub fn clear_for_s(&self, delta_m: f64, horizon_s: f64) -> Option<f64> {
        let mut time_s = 0.0;
        if self.least_m() < delta_m {
            return None;
        }
        for _ in 0..MOST_STEPS {
            let at = self.dp + self.dv * time_s;
            let distance_m = at.norm();
            let rate_m_s = if distance_m > 0.0 { at.dot(&self.dv) / distance_m } else { -self.dv.norm() };
            let margin_m = distance_m - self.error_at(time_s) - delta_m;
            let step_s = step_within(margin_m, rate_m_s - self.u[1] - 2.0 * self.u[2] * time_s, self.u[2]);
            time_s += step_s;
            if time_s >= horizon_s {
                return Some(horizon_s);
            }
            if step_s < LEAST_STEP_S {
                break;
            }
        }
        Some(time_s)
    }

    /// Returns the time from the present at which two vehicles with constant velocity are closer than `delta_m` \[s\];
    /// `None` if not within `horizon_s`.
    #[must_use]
    pub fn nominal_violation_s(&self, delta_m: f64, horizon_s: f64) -> Option<f64> {
        let gap = self.dp.norm_squared() - delta_m * delta_m;
        if gap < 0.0 {
            return Some(0.0);
        }
        let (approach, speed2) = (self.dp.dot(&self.dv), self.dv.norm_squared());
        let discriminant = approach * approach - speed2 * gap;
        if approach >= 0.0 || discriminant <= 0.0 {
            return None;
        }
        let time_s = gap / (discriminant.sqrt() - approach);
        (time_s <= horizon_s).then_some(time_s)
    }

    /// Returns the last moment at which braking avoids a separation below `delta_m` \[s\]; `None` without a nominal
    /// violation within `horizon_s`. The result is 0 if this moment has passed.
    ///
    /// Until this moment T both vehicles have constant velocity. From T on each accelerates with `brake_m_s2` (B) away
    /// from the other along the line between them. With the distance d and the closing speed c at T, `d'' >= 2 B`, so
    /// the distance never falls below `d - c^2 / (4 B)`. With the relative speed w and the miss distance m,
    /// `c^2 = w^2 (1 - m^2 / d^2)`, so T is where d falls to the largest root of
    ///
    /// ```text
    /// d^3 - (delta + K) d^2 + K m^2 = 0      K = w^2 / (4 B)
    /// ```
    ///
    /// Newton's method from `delta + K` stays above this root, so the result is never above T.
    #[must_use]
    pub fn last_brake_s(&self, delta_m: f64, brake_m_s2: f64, horizon_s: f64) -> Option<f64> {
        let end_s = self.nominal_violation_s(delta_m, horizon_s)?;
        let (speed2, now_m) = (self.dv.norm_squared(), self.dp.norm());
        if end_s <= 0.0 || speed2 <= 0.0 {
            return Some(0.0);
        }
        let along_m = -self.dp.dot(&self.dv) / speed2.sqrt();
        let miss2 = (self.dp.norm_squared() - along_m * along_m).max(0.0);
        let extra_m = speed2 / (4.0 * brake_m_s2);
        let mut least_m = delta_m + extra_m;
        for _ in 0..MOST_STEPS {
            let value = least_m * least_m * (least_m - delta_m - extra_m) + extra_m * miss2;
            let slope = least_m * (3.0 * least_m - 2.0 * (delta_m + extra_m));
            if value <= 0.0 || slope <= 0.0 {
                break;
            }
            let step_m = value / slope;
            least_m -= step_m;
            if step_m < 1e-12 * least_m {
                break;
            }
        }
        if least_m >= now_m {
            return Some(0.0);
        }
        let left_m = (least_m * least_m - miss2).max(0.0).sqrt();
        Some(((along_m - left_m) / speed2.sqrt()).clamp(0.0, end_s))
    }

    /// Returns the bound U on the error after a time \[m\].
    fn error_at(&self, time_s: f64) -> f64 {
        self.u[0] + time_s * (self.u[1] + time_s * self.u[2])
    }
}

/// Returns the largest s for which `margin + rate x - curve x^2 >= 0` on \[0, s\].
fn step_within(margin: f64, rate: f64, curve: f64) -> f64 {
    if margin <= 0.0 {
        return 0.0;
    }
    let root = (rate * rate + 4.0 * curve * margin).sqrt();
    // Both forms avoid cancellation.
    if rate >= 0.0 {
        if curve > 0.0 { (rate + root) / (2.0 * curve) } else { f64::INFINITY }
    } else {
        2.0 * margin / (root - rate)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{Prediction, RelativeMotion};

    fn head_on(gap_m: f64, speed_m_s: f64, age_s: f64, accel_m_s2: f64) -> RelativeMotion {
        let at =
            |x, v| Prediction::new(Vector3::new(x, 0.0, 0.0), Vector3::new(v, 0.0, 0.0), age_s, 0.0, 0.0, accel_m_s2);
        RelativeMotion::new(&at(0.0, speed_m_s), &at(gap_m, -speed_m_s))
    }

    #[test]
    fn clear_until_is_the_closed_form() {
        // 10 - 2 t - 5 t^2 = 1 without ages.
        let exact_s = (-2.0 + (4.0_f64 + 4.0 * 5.0 * 9.0).sqrt()) / 10.0;
        let clear_s = head_on(10.0, 1.0, 0.0, 5.0).clear_for_s(1.0, 60.0).expect("clear now");
        assert!(clear_s <= exact_s && exact_s - clear_s < 1e-6, "{clear_s} {exact_s}");
        // Without acceleration the nominal violation ends it.
        let straight = head_on(10.0, 1.0, 0.0, 0.0);
        let nominal_s = straight.nominal_violation_s(1.0, 60.0).expect("head on");
        assert!((nominal_s - 4.5).abs() < 1e-12, "{nominal_s}");
        assert!((straight.clear_for_s(1.0, 60.0).expect("clear now") - 4.5).abs() < 1e-6);
        assert_eq!(head_on(10.0, -1.0, 0.0, 0.0).clear_for_s(1.0, 60.0), Some(60.0));
    }

    #[test]
    fn an_age_shortens_the_time_and_too_old_a_position_gives_none() {
        let clear = |age_s| head_on(10.0, 0.0, age_s, 5.0).clear_for_s(1.0, 60.0);
        assert!(clear(0.5) < clear(0.0));
        assert_eq!(clear(2.0), None, "two vehicles may have moved 10 m each");
    }

    #[test]
    fn the_last_moment_to_brake_leaves_exactly_delta() {
        // Closing at 4 m/s with 2 x 2 m/s^2: 2 m are needed, so 3 m of distance at the moment.
        let brake_s = head_on(11.0, 2.0, 0.0, 0.0).last_brake_s(1.0, 2.0, 60.0).expect("head on");
        assert!((brake_s - 2.0).abs() < 1e-3 && brake_s <= 2.0, "{brake_s}");
        assert_eq!(head_on(2.9, 2.0, 0.0, 0.0).last_brake_s(1.0, 2.0, 60.0), Some(0.0));
        assert_eq!(head_on(11.0, -2.0, 0.0, 0.0).last_brake_s(1.0, 2.0, 60.0), None);
    }
}
