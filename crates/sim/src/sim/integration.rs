//! How far the flown motion may be from the law's motion, once a step was too long for the law.

/// Bound of the error of integration in the separation of a pair, from the first overlong part of a step on.
///
/// While the fastest rate of the law is `omega` and no vehicle moves farther than `s`, the acceleration of a vehicle changes by at
/// most `omega^2 s`, and by at most `2 a` where a limit `a` of accelerations holds. A part of length h that is held to the
/// accelerations at its ends errs by at most that change over all of it:
///
/// ```text
/// c = min(omega^2 s, 2 a)
/// velocity of a pair    2 h c
/// position of a pair      h^2 c
/// ```
///
/// From part to part errors grow as those of `x'' = min(omega^2 x, 4 a)`, the fastest growth of two motions of the same law apart.
/// Parts that are short enough for the law add nothing: their own error is of second order in the step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct IntegrationError {
    position_m: f64,
    velocity_m_s: f64,
}

/// A part of a step, as far as its error depends on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    /// Length \[s\].
    pub(super) length_s: f64,
    /// Fastest rate of the law over it \[1/s\].
    pub(super) rate_per_s: f64,
    /// The farthest that a vehicle moved \[m\].
    pub(super) moved_m: f64,
    /// Limit of commanded accelerations \[m/s^2\]; infinite where there is none.
    pub(super) limit_m_s2: f64,
    /// Whether it is too long for the law.
    pub(super) is_overlong: bool,
}

impl IntegrationError {
    /// Bound of the error of a separation \[m\]; infinite where nothing is known.
    pub(super) fn position_m(self) -> f64 {
        self.position_m
    }

    /// Error after one more part of a step.
    #[must_use]
    pub(super) fn after(self, part: Part) -> Self {
        let Part { length_s, rate_per_s, moved_m, limit_m_s2, is_overlong } = part;
        // `min` gives the limit for the product of an infinite rate and no way, which is not a number.
        let change_m_s2 = |way_m: f64, most_m_s2: f64| (rate_per_s * rate_per_s * way_m).min(most_m_s2);
        let own_m_s = if is_overlong { length_s * change_m_s2(moved_m, 2.0 * limit_m_s2) } else { 0.0 };
        let position_m = self.position_m + length_s * (self.velocity_m_s + own_m_s);
        let grown_m_s = if position_m > 0.0 { length_s * change_m_s2(position_m, 4.0 * limit_m_s2) } else { 0.0 };
        Self { position_m, velocity_m_s: self.velocity_m_s + grown_m_s + 2.0 * own_m_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OVERLONG: Part =
        Part { length_s: 0.25, rate_per_s: 2.0, moved_m: 0.5, limit_m_s2: f64::INFINITY, is_overlong: true };

    /// x'' = omega^2 x, the fastest growth, from x = 1 in kicks and drifts of omega h = 0.5, against cosh(omega t).
    #[test]
    fn the_bound_holds_for_a_motion_that_is_stepped_too_coarsely() {
        let Part { length_s: h, rate_per_s: omega, .. } = OVERLONG;
        let kick = |x: f64| 0.5 * h * omega * omega * x;
        let (mut x, mut v, mut error) = (1.0, 0.0, IntegrationError::default());
        for step in 1..=8_u32 {
            let before: f64 = x;
            v += kick(x);
            x += h * v;
            v += kick(x);
            error = error.after(Part { moved_m: x - before, ..OVERLONG });
            let exact = libm::cosh(omega * h * f64::from(step));
            assert!((x - exact).abs() <= error.position_m(), "step {step}: {x} for {exact}, {error:?}");
        }
    }

    #[test]
    fn an_error_is_zero_until_a_part_is_too_long_and_unbounded_at_a_barrier_without_a_limit() {
        let none = IntegrationError::default();
        assert_eq!(none.after(Part { is_overlong: false, ..OVERLONG }), none);
        for moved_m in [0.5, 0.0] {
            let at_barrier = Part { rate_per_s: f64::INFINITY, moved_m, ..OVERLONG };
            let error = none.after(at_barrier);
            assert_eq!(error.position_m(), f64::INFINITY, "moved by {moved_m} m");
            let later = error.after(Part { rate_per_s: 0.0, is_overlong: false, ..OVERLONG });
            assert_eq!(later.position_m(), f64::INFINITY);
            // A limit of 3 m/s^2 bounds the change by 6 m/s^2.
            let limited = none.after(Part { limit_m_s2: 3.0, ..at_barrier });
            assert_eq!(limited, IntegrationError { position_m: 0.375, velocity_m_s: 6.0 });
        }
    }
}
