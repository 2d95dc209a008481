//! Unicycles: vehicles in the plane that move along their heading and cannot stop; at constant speed, Dubins vehicles.

use nalgebra::Vector3;

/// Limits of a unicycle: p' = s (cos psi, sin psi), s' = a, psi' = omega.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unicycle {
    /// Smallest speed \[m/s\], more than 0.
    pub min_speed_m_s: f64,
    /// Largest speed \[m/s\]; equal to the smallest for a Dubins vehicle.
    pub max_speed_m_s: f64,
    /// Largest turn rate \[rad/s\].
    pub max_turn_rad_s: f64,
    /// Largest acceleration along the heading \[m/s^2\].
    pub max_accel_m_s2: f64,
}

impl Default for Unicycle {
    fn default() -> Self {
        Self { min_speed_m_s: 0.2, max_speed_m_s: 3.0, max_turn_rad_s: 2.0, max_accel_m_s2: 2.0 }
    }
}

/// Heading and speed of a unicycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    /// Heading psi, counterclockwise from x \[rad\].
    pub psi_rad: f64,
    /// Speed s \[m/s\].
    pub speed_m_s: f64,
}

/// Rates of change of heading and speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steering {
    /// Acceleration a along the heading \[m/s^2\].
    pub accel_m_s2: f64,
    /// Turn rate omega \[rad/s\].
    pub turn_rad_s: f64,
}

impl Unicycle {
    /// Returns the steering for a commanded acceleration u \[m/s^2\]: a = u . e and omega = u . n/s within the limits.
    /// Unit vector e is along the heading, n to its left. The speed stays within its limits over `dt_s` seconds.
    #[must_use]
    pub fn steering(&self, heading: Heading, command_m_s2: Vector3<f64>, dt_s: f64) -> Steering {
        let (sin, cos) = libm::sincos(heading.psi_rad);
        let along = command_m_s2.x * cos + command_m_s2.y * sin;
        let across = command_m_s2.y * cos - command_m_s2.x * sin;
        let brakes = (self.min_speed_m_s - heading.speed_m_s) / dt_s;
        let gains = (self.max_speed_m_s - heading.speed_m_s) / dt_s;
        Steering {
            accel_m_s2: along.clamp(-self.max_accel_m_s2, self.max_accel_m_s2).max(brakes).min(gains),
            turn_rad_s: (across / heading.speed_m_s).clamp(-self.max_turn_rad_s, self.max_turn_rad_s),
        }
    }

    /// Returns heading and speed after `dt_s` seconds, within the limits.
    #[must_use]
    pub fn after(&self, heading: Heading, by: Steering, dt_s: f64) -> Heading {
        let speed_m_s = heading.speed_m_s + by.accel_m_s2 * dt_s;
        Heading {
            psi_rad: heading.psi_rad + by.turn_rad_s * dt_s,
            speed_m_s: speed_m_s.clamp(self.min_speed_m_s, self.max_speed_m_s),
        }
    }
}

impl Heading {
    /// Returns the heading and speed of a velocity \[m/s\] in the plane.
    #[must_use]
    pub fn of(velocity_m_s: Vector3<f64>) -> Self {
        let speed_m_s = libm::hypot(velocity_m_s.x, velocity_m_s.y);
        Self { psi_rad: libm::atan2(velocity_m_s.y, velocity_m_s.x), speed_m_s }
    }

    /// Returns the velocity \[m/s\].
    #[must_use]
    pub fn velocity_m_s(&self) -> Vector3<f64> {
        let (sin, cos) = libm::sincos(self.psi_rad);
        self.speed_m_s * Vector3::new(cos, sin, 0.0)
    }

    /// Returns the displacement over `dt_s` seconds \[m\]: the chord of the arc. Exact at constant speed; otherwise the
    /// error is at most a omega dt^3/12.
    #[must_use]
    pub fn way_m(&self, by: Steering, dt_s: f64) -> Vector3<f64> {
        let half_turn = 0.5 * by.turn_rad_s * dt_s;
        let (sin, cos) = libm::sincos(self.psi_rad + half_turn);
        (self.speed_m_s + 0.5 * by.accel_m_s2 * dt_s) * dt_s * sinc(half_turn) * Vector3::new(cos, sin, 0.0)
    }

    /// Returns a bound of the deviation of the arc from its chord \[m\]: |p''| dt^2/8.
    #[must_use]
    pub fn bend_m(&self, by: Steering, dt_s: f64) -> f64 {
        let fastest_m_s = self.speed_m_s + (by.accel_m_s2 * dt_s).max(0.0);
        libm::hypot(by.accel_m_s2, fastest_m_s * by.turn_rad_s) * dt_s * dt_s / 8.0
    }
}

/// sin(x)/x.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { libm::sin(x) / x }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: Heading = Heading { psi_rad: 0.7, speed_m_s: 0.5 };

    #[test]
    fn a_command_along_the_heading_accelerates_and_one_across_turns_within_limits() {
        let unicycle = Unicycle::default();
        let ahead = SLOW.velocity_m_s() / SLOW.speed_m_s;
        let left = Vector3::new(-ahead.y, ahead.x, 0.0);
        let steering_of = |u: Vector3<f64>| unicycle.steering(SLOW, u, 0.01);
        let both = steering_of(0.3 * ahead + 0.4 * left);
        assert!((both.accel_m_s2 - 0.3).abs() < 1e-15 && (both.turn_rad_s - 0.8).abs() < 1e-15, "{both:?}");
        assert_eq!(steering_of(99.0 * ahead).accel_m_s2, 2.0);
        assert_eq!(steering_of(-99.0 * left).turn_rad_s, -2.0);
        let (mut heading, dt_s) = (SLOW, 0.01);
        for _ in 0..1000 {
            heading = unicycle.after(heading, unicycle.steering(heading, -ahead, dt_s), dt_s);
        }
        assert_eq!(heading.speed_m_s, 0.2, "it cannot stop");
    }

    #[test]
    fn at_constant_speed_the_displacement_is_the_chord_of_a_circle() {
        let by = Steering { accel_m_s2: 0.0, turn_rad_s: 1.3 };
        let heading = Heading { psi_rad: 0.4, speed_m_s: 2.0 };
        let dt_s = 0.8;
        let radius_m = heading.speed_m_s / by.turn_rad_s;
        let centre_m = radius_m * Vector3::new(-libm::sin(heading.psi_rad), libm::cos(heading.psi_rad), 0.0);
        let way_m = heading.way_m(by, dt_s);
        assert!(((way_m - centre_m).norm() - radius_m).abs() < 1e-15, "its end is on the circle");
        let sagitta_m = radius_m * (1.0 - libm::cos(0.5 * by.turn_rad_s * dt_s));
        let bend_m = heading.bend_m(by, dt_s);
        assert!(sagitta_m <= bend_m && bend_m < 1.1 * sagitta_m, "{sagitta_m} {bend_m}");
        let straight = Steering { turn_rad_s: 0.0, ..by };
        assert_eq!(heading.bend_m(straight, dt_s), 0.0);
        assert!((heading.way_m(straight, dt_s) - heading.velocity_m_s() * dt_s).norm() < 1e-15);
    }
}
