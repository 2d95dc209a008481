//! The edge tension (5), (6): a potential of one pair with a barrier at delta and its minimum at the desired distance.
#![expect(clippy::inline_always, reason = "the vectorised sums of the kernel inline these functions")]

use std::hint::select_unpredictable;

use tautline_core::text::{beside_limit, exact};

/// asinh(1) = ln(1 + sqrt 2): the scaled clearance s = (l - delta)/K at the minimum.
pub(super) const REST: f64 = 0.881_373_587_019_543;
/// exp(-2 asinh(1)) = (sqrt 2 - 1)^2.
const REST_DECAY: f64 = 0.171_572_875_253_809_9;
/// exp(-asinh(1)) = sqrt 2 - 1.
const REST_DECAY_ROOT: f64 = 0.414_213_562_373_095_05;

/// The edge tension V of a pair with rest length d and safety distance delta < d:
///
/// ```text
/// V(l)   = alpha [ coth(s) + l/K ] - Vmin,   s = (l - delta)/K,   l > delta,   K = (d - delta)/asinh(1)
/// V'(l)  = (alpha/K) [ 1 - csch^2(s) ]
/// V''(l) = (2 alpha/K^2) coth(s) csch^2(s)
/// ```
///
/// V is strictly convex, 0 at its minimum l = d, infinite at delta, and tends to a line of slope alpha/K for large l.
///
/// # Accuracy
/// With h = s - asinh(1) these forms hold exactly:
///
/// ```text
/// V  = alpha [ h - (sqrt 2 - 1) (1 - e^(-2h))/(1 - e^(-2s)) ]
/// V' = (alpha/K) (1 - e^(-2h)) (1 - e^(-2(s + asinh 1)))/(1 - e^(-2s))^2
/// ```
///
/// Neither subtracts nearly equal numbers at the barrier, and V' does not do so at the minimum either. The error of V'
/// is a few units in its last place everywhere; the error of V is a few units in the last place of alpha h.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeTension {
    alpha: f64,
    delta_m: f64,
    rest_m: f64,
    k_m: f64,
}

/// Reason why the edge tension does not exist for some parameters.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TensionError {
    /// alpha is not a positive finite number.
    #[error("alpha is {alpha}; it must be a positive finite number")]
    Alpha {
        /// Given value \[m^2/s^2\].
        alpha: f64,
    },
    /// delta is negative or not finite.
    #[error("the safety distance delta is {delta_m} m; it must be a finite number of at least 0")]
    Delta {
        /// Given value \[m\].
        delta_m: f64,
    },
    /// The rest length does not exceed delta: K = (d - delta)/asinh(1) would not be positive.
    #[error(
        "the desired distance is {} m; it must be finite and greater than the safety distance {} m",
        beside_limit(*rest_m, *delta_m, 3),
        exact(*delta_m)
    )]
    Rest {
        /// Given value \[m\].
        rest_m: f64,
        /// Safety distance \[m\].
        delta_m: f64,
    },
}

impl EdgeTension {
    /// Builds the tension of scale `alpha` \[m^2/s^2\] with its barrier at `delta_m` and its minimum at `rest_m`.
    ///
    /// # Errors
    /// [`TensionError`] unless alpha > 0, delta >= 0, d > delta and all are finite.
    pub fn new(alpha: f64, delta_m: f64, rest_m: f64) -> Result<Self, TensionError> {
        if !(alpha > 0.0 && alpha.is_finite()) {
            return Err(TensionError::Alpha { alpha });
        }
        if !(delta_m >= 0.0 && delta_m.is_finite()) {
            return Err(TensionError::Delta { delta_m });
        }
        let k_m = (rest_m - delta_m) / REST;
        // A subnormal K has no finite inverse.
        if !(k_m >= f64::MIN_POSITIVE && k_m.is_finite()) {
            return Err(TensionError::Rest { rest_m, delta_m });
        }
        Ok(Self { alpha, delta_m, rest_m, k_m })
    }

    /// Scale alpha \[m^2/s^2\].
    #[must_use]
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// Safety distance delta \[m\].
    #[must_use]
    pub fn delta_m(&self) -> f64 {
        self.delta_m
    }

    /// Rest length d \[m\].
    #[must_use]
    pub fn rest_m(&self) -> f64 {
        self.rest_m
    }

    /// Length scale K \[m\].
    #[must_use]
    pub fn k_m(&self) -> f64 {
        self.k_m
    }

    /// Vmin = alpha \[sqrt 2 + d/K\] \[m^2/s^2\], the constant in (5) that makes the minimum 0.
    #[must_use]
    pub fn minimum(&self) -> f64 {
        self.alpha * (std::f64::consts::SQRT_2 + self.rest_m / self.k_m)
    }

    /// V(l) \[m^2/s^2\] at a distance \[m\]; infinite at or inside delta.
    #[must_use]
    pub fn value(&self, distance_m: f64) -> f64 {
        if distance_m <= self.delta_m {
            return f64::INFINITY;
        }
        let (s, h) = self.scaled(distance_m);
        self.alpha * value(s, h)
    }

    /// V'(l) \[m/s^2\] at a distance \[m\]: positive pulls, negative pushes; minus infinity at or inside delta.
    #[must_use]
    pub fn derivative(&self, distance_m: f64) -> f64 {
        if distance_m <= self.delta_m {
            return f64::NEG_INFINITY;
        }
        let (s, h) = self.scaled(distance_m);
        self.alpha / self.k_m * slope(s, h)
    }

    /// V''(l) \[1/s^2\] at a distance \[m\], positive; infinite at or inside delta.
    #[must_use]
    pub fn second_derivative(&self, distance_m: f64) -> f64 {
        if distance_m <= self.delta_m {
            return f64::INFINITY;
        }
        let (s, _) = self.scaled(distance_m);
        let decay = libm::exp(-2.0 * s);
        let complement = -libm::expm1(-2.0 * s);
        let (coth, csch_squared) = ((1.0 + decay) / complement, 4.0 * decay / (complement * complement));
        2.0 * self.alpha / (self.k_m * self.k_m) * coth * csch_squared
    }

    /// Returns the distance l in (delta, d] on the pushing side of the minimum with V(l) = `value` \[m^2/s^2\].
    ///
    /// Returns d for a value at or below 0, delta for an infinite value, NaN for NaN. If the clearance l - delta is
    /// below the resolution of l, the result rounds to delta.
    ///
    /// # Method
    /// In s the equation coth(s) = V/alpha + sqrt 2 + asinh(1) - s has one root in (0, asinh(1)]. The inverse
    /// hyperbolic cotangents of the right-hand side at both ends bracket the root; they differ by less than a factor of
    /// 2. Newton's method runs on sqrt(V), which unlike V has a simple zero at the minimum. The square root is convex
    /// too, so the steps from the lower end climb to the root without passing it. A step that rounding takes out of the
    /// bracket is replaced by bisection.
    ///
    /// # Guarantee
    /// Every iteration keeps the root in the bracket. Iteration stops when a step falls below the resolution of s: in
    /// fewer than 10 iterations in practice, and in 64 at most (54 bisections alone would give every digit).
    #[must_use]
    pub fn push_side_root(&self, value: f64) -> f64 {
        if value.is_nan() {
            return f64::NAN;
        }
        if value <= 0.0 {
            return self.rest_m;
        }
        self.delta_m + self.k_m * push_side_root(value / self.alpha).0
    }

    fn scaled(&self, distance_m: f64) -> (f64, f64) {
        ((distance_m - self.delta_m) / self.k_m, (distance_m - self.rest_m) / self.k_m)
    }
}

/// A distance is outside (delta, infinity), or so short or long that V is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OutOfDomain;

/// Returns the scaled clearance s in (0, asinh(1)] with V/alpha = `value` > 0, and the number of iterations.
fn push_side_root(value: f64) -> (f64, u32) {
    const MOST_ITERATIONS: u32 = 64;
    if value == f64::INFINITY {
        return (0.0, 0);
    }
    let area_coth = |y: f64| 0.5 * libm::log1p(2.0 / (y - 1.0));
    let mut low = area_coth(value + std::f64::consts::SQRT_2 + REST);
    let mut high = area_coth(value + std::f64::consts::SQRT_2).min(REST);
    let target = value.sqrt();
    let mut s = low;
    for iteration in 1..=MOST_ITERATIONS {
        let h = s - REST;
        let root = self::value(s, h).max(0.0).sqrt();
        if root >= target {
            low = s;
        } else {
            high = s;
        }
        let newton = s - (root - target) * 2.0 * root / slope(s, h);
        if (newton - s).abs() <= f64::EPSILON * s {
            return (s, iteration);
        }
        let next = if newton > low && newton < high { newton } else { low + 0.5 * (high - low) };
        if next == s {
            return (s, iteration);
        }
        s = next;
    }
    (s, MOST_ITERATIONS)
}

/// Returns V/alpha at the scaled clearance s > 0, with h = s - asinh(1).
#[inline(always)]
pub(super) fn value(s: f64, h: f64) -> f64 {
    let (of_s, of_h) = decay_complements(s, h);
    h - REST_DECAY_ROOT * of_h / of_s
}

/// Returns V' K/alpha = 1 - csch^2(s) at the scaled clearance s > 0, with h = s - asinh(1).
#[inline(always)]
pub(super) fn slope(s: f64, h: f64) -> f64 {
    let (of_s, of_h) = decay_complements(s, h);
    of_h * (1.0 - REST_DECAY * (1.0 - of_s)) / (of_s * of_s)
}

/// Returns [`slope`] divided by `length`, and [`value`], with a single division. `power` is [`expm1`] of [`exponent`].
#[inline(always)]
pub(super) fn slope_and_value_over(length: f64, s: f64, h: f64, power: f64) -> (f64, f64) {
    let (of_s, of_h) = complements_from(s, power);
    let ratio = of_h / (of_s * of_s * length);
    let slope = ratio * (1.0 - REST_DECAY * (1.0 - of_s));
    (slope, h - REST_DECAY_ROOT * (ratio * (of_s * length)))
}

/// Returns 1 - e^(-2s) and 1 - e^(-2h) for s > 0 and h = s - asinh(1), both to a few units in the last place.
///
/// One exponential serves both: it is evaluated about the nearer zero, and the other follows from it without
/// cancellation.
#[inline(always)]
fn decay_complements(s: f64, h: f64) -> (f64, f64) {
    complements_from(s, expm1(exponent(s, h)))
}

/// Returns the exponent of the exponential that serves both complements of s > 0 and h = s - asinh(1).
#[inline(always)]
pub(super) fn exponent(s: f64, h: f64) -> f64 {
    // A selection in place of a branch lets the compiler vectorise loops over edges.
    -2.0 * select_unpredictable(is_near_barrier(s), s, h)
}

#[inline(always)]
fn complements_from(s: f64, power: f64) -> (f64, f64) {
    let near_barrier = is_near_barrier(s);
    let of_s = select_unpredictable(near_barrier, -power, (1.0 - REST_DECAY) - REST_DECAY * power);
    let of_h = select_unpredictable(near_barrier, 1.0 - (1.0 + power) * (1.0 / REST_DECAY), -power);
    (of_s, of_h)
}

#[inline(always)]
fn is_near_barrier(s: f64) -> bool {
    s < 0.5 * REST
}

/// Returns e^x - 1 for x <= 1, to two units in the last place.
///
/// Consists of additions and multiplications without branches. The compiler can vectorise it for any width, and its
/// bits are the same on every machine. The kernel calls the three parts in separate loops, so that the constants of
/// each loop fit the vector registers.
#[inline(always)]
fn expm1(x: f64) -> f64 {
    let (r, power) = reduce(x);
    scale(power, expm1_reduced(r))
}

/// Returns r and a power of 2 with `e^x = power e^r` and |r| <= ln(2)/2.
#[inline(always)]
pub(super) fn reduce(x: f64) -> (f64, f64) {
    /// Adding this constant to a small number rounds it to an integer, held in the lowest bits of the sum.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    /// ln 2 in two parts; products of the first with integers of up to 11 bits are exact.
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    /// Below this e^x - 1 rounds to -1.
    const LOWEST: f64 = -64.0;

    let x = if x < LOWEST { LOWEST } else { x };
    let rounded = x * std::f64::consts::LOG2_E + ROUND;
    let exponent = rounded - ROUND;
    let r = (x - exponent * LN_2_HIGH) - exponent * LN_2_LOW;
    (r, f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52))
}

/// Returns e^r - 1 for |r| <= ln(2)/2.
#[inline(always)]
pub(super) fn expm1_reduced(r: f64) -> f64 {
    // e^r - 1 = r + r^2 (c2 + c3 r + ... + c13 r^11), cn = 1/n!. The truncation error is below 2e-17 of the sum.
    let r2 = r * r;
    let r4 = r2 * r2;
    let r8 = r4 * r4;
    let c2_5 = (C[0] + C[1] * r) + (C[2] + C[3] * r) * r2;
    let c6_9 = (C[4] + C[5] * r) + (C[6] + C[7] * r) * r2;
    let c10_13 = (C[8] + C[9] * r) + (C[10] + C[11] * r) * r2;
    r + r2 * (c2_5 + c6_9 * r4 + c10_13 * r8)
}

/// Returns `power e^r - 1`, given `e^r - 1`.
#[inline(always)]
pub(super) fn scale(power: f64, expm1_reduced: f64) -> f64 {
    (power - 1.0) + power * expm1_reduced
}

/// 1/n! for n from 2 to 13.
const C: [f64; 12] = {
    let mut c = [0.5; 12];
    let mut n = 1;
    while n < 12 {
        c[n] = c[n - 1] / (n + 2) as f64;
        n += 1;
    }
    c
};

#[cfg(test)]
mod tests;
