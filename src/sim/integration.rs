//! How far the flown motion may be from the law's motion, once a step was too long for the law.

/// Bound of the error of integration in the separation of a pair, from the first overlong part of a step on.
///
/// While the fastest rate of the law is `omega` and no vehicle moves farther than `s`, the acceleration of a vehicle changes by at
/// most `omega^2 s`. A part of length h that is held to the accelerations at its ends errs by at most that change over all of it:
///
/// ```text
/// velocity of a pair    2 h omega^2 s
/// position of a pair      h^2 omega^2 s
/// ```
///
/// From part to part errors grow as those of `x'' = omega^2 x`, the fastest growth of two motions of the same law apart. Parts that
/// are short enough for the law add nothing: their own error is of second order in the step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct IntegrationError {
    position_m: f64,
    velocity_m_s: f64,
}

impl IntegrationError {
    /// Bound of the error of a separation \[m\]; infinite where nothing is known.
    pub(super) fn position_m(self) -> f64 {
        self.position_m
    }

    /// Error after a part of a step, for which the law has a fastest rate and vehicles moved by at most `moved_m`.
    #[must_use]
    pub(super) fn after(self, length_s: f64, rate_per_s: f64, moved_m: f64, is_overlong: bool) -> Self {
        let stiffness_per_s2 = rate_per_s * rate_per_s;
        let change_m_s = if is_overlong { length_s * stiffness_per_s2 * moved_m } else { 0.0 };
        let position_m = self.position_m + length_s * (self.velocity_m_s + change_m_s);
        let velocity_m_s = self.velocity_m_s + length_s * stiffness_per_s2 * position_m + 2.0 * change_m_s;
        // No product of an infinite rate and a motion of zero is a bound.
        let bound = |number: f64| if number.is_nan() { f64::INFINITY } else { number };
        Self { position_m: bound(position_m), velocity_m_s: bound(velocity_m_s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_holds_for_a_spring_that_is_stepped_too_coarsely() {
        // x'' = omega^2 x, the fastest growth, from x = 1 in steps of omega h = 0.5: the error of one step of kick, drift, kick
        // against cosh(omega t) is within the bound, and so is what becomes of it.
        let (omega, h) = (2.0_f64, 0.25_f64);
        let kick = |x: f64| 0.5 * h * omega * omega * x;
        let (mut x, mut v, mut error) = (1.0, 0.0, IntegrationError::default());
        for step in 1..=8_u32 {
            let before = x;
            v += kick(x);
            x += h * v;
            v += kick(x);
            error = error.after(h, omega, x - before, true);
            let exact = (omega * h * f64::from(step)).cosh();
            assert!((x - exact).abs() <= error.position_m(), "step {step}: {x} for {exact}, {error:?}");
        }
    }

    #[test]
    fn an_error_is_zero_until_a_part_is_too_long_and_nothing_is_known_at_a_barrier() {
        let none = IntegrationError::default();
        assert_eq!(none.after(0.1, 3.0, 0.5, false), none);
        for moved_m in [0.5, 0.0] {
            let error = none.after(0.1, f64::INFINITY, moved_m, true);
            assert_eq!(error.position_m(), f64::INFINITY, "moved by {moved_m} m");
            assert_eq!(error.after(0.1, 0.0, 0.5, false).position_m(), f64::INFINITY);
        }
    }
}
