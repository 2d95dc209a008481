//! Edge tension (5), (6): its minimum and its derivatives.

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated};
use tautline_core::text::bound;
use tautline_laws::law::EdgeTension;

/// Figure 1 plots the tension for alpha = K = 1 and delta = 0.5 m, but prints the constant of delta = 1 m.
const FIGURE_1_DELTA_M: f64 = 0.5;
const FIGURE_1_K_M: f64 = 1.0;
const FIGURE_1_PRINTED: f64 = 3.2956;
const PRINTED_FOR_DELTA_M: f64 = 1.0;

/// Clearances l - delta from 2^-40 m to 2^20 m: powers of two, so that l and both ends of every difference are exact.
const CLEARANCE_EXPONENTS: std::ops::RangeInclusive<i32> = -40..=20;
/// Half width of a difference, divided by the clearance. The fourth-order difference has a truncation error of 4 STEP^4
/// = 4e-12 and a rounding error of 1.5 eps/STEP = 3e-13, relative to its terms. The tolerance is 6 times the sum.
const STEP: f64 = 1.0 / 1024.0;

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    let claims = vec![minimum()?, figure_1()?, slope()?, curvature()?];
    progress.advance(1);
    Ok(claims)
}

/// Returns the tension of these lengths for alpha = 1.
fn unit_tension(delta_m: f64, k_m: f64) -> Result<EdgeTension, MeasureError> {
    Ok(EdgeTension::new(1.0, delta_m, delta_m + k_m * 1.0_f64.asinh())?)
}

/// Returns the tension that Figure 1 plots.
pub(super) fn of_figure_1() -> Result<EdgeTension, MeasureError> {
    unit_tension(FIGURE_1_DELTA_M, FIGURE_1_K_M)
}

fn minimum() -> Result<Claim, MeasureError> {
    let tension = unit_tension(2.0, 1.0 / 1.0_f64.asinh())?;
    let rest_m = tension.rest_m();
    // V' changes sign between the neighbours of d in double precision.
    let bracketed = tension.derivative(rest_m.next_down()) <= 0.0 && tension.derivative(rest_m.next_up()) >= 0.0;
    let literal = 1.0 / (1.0_f64.asinh()).tanh() + rest_m / tension.k_m() - tension.minimum();
    let (value, slope) = (tension.value(rest_m), tension.derivative(rest_m));
    let claim = stated("tension-minimum")?;
    let near_0 = |number| bound(number, claim.limit());
    let words = format!(
        "d = {rest_m} m: V(d) {}, V'(d) {}, equation (5) as printed {}; V' {}",
        near_0(value),
        near_0(slope),
        near_0(literal),
        if bracketed { "changes sign" } else { "does not change sign" }
    );
    let claim = claim.measured(words, [("value_m2_s2", value), ("slope_m_s2", slope), ("literal_m2_s2", literal)]);
    Ok(claim.within_limit().but_only_if(bracketed))
}

fn figure_1() -> Result<Claim, MeasureError> {
    let of_caption = of_figure_1()?.minimum();
    let of_other = unit_tension(PRINTED_FOR_DELTA_M, FIGURE_1_K_M)?.minimum();
    let claim = stated("figure-1-caption")?;
    let printed_of = |number: f64| (number - FIGURE_1_PRINTED).abs() <= claim.limit();
    let pass = printed_of(of_other) && !printed_of(of_caption);
    let words = format!("{of_caption:.9} for delta = 0.5, {of_other:.9} for delta = 1");
    let values = [("minimum_delta_0_5_m2_s2", of_caption), ("minimum_delta_1_m2_s2", of_other)];
    Ok(claim.measured(words, values).pass(pass))
}

/// Returns the derivative of `f` at `x` by the fourth-order difference over x - 2h .. x + 2h.
fn difference(f: impl Fn(f64) -> f64, x: f64, h: f64) -> f64 {
    (8.0 * (f(x + h) - f(x - h)) - (f(x + 2.0 * h) - f(x - 2.0 * h))) / (12.0 * h)
}

/// Returns the largest error of `derivative` against differences of `f` over all clearances, relative to `scale`.
fn largest_difference(
    tension: &EdgeTension,
    f: impl Fn(f64) -> f64,
    derivative: impl Fn(f64) -> f64,
    scale: impl Fn(f64, f64) -> f64,
) -> f64 {
    let delta_m = tension.delta_m();
    CLEARANCE_EXPONENTS
        .map(|exponent| {
            let clearance_m = libm::exp2(f64::from(exponent));
            let distance_m = delta_m + clearance_m;
            let error = difference(&f, distance_m, STEP * clearance_m) - derivative(distance_m);
            error.abs() / scale(distance_m, clearance_m)
        })
        .fold(0.0, f64::max)
}

/// Returns a claim about such an error.
fn of_difference(id: &str, error: f64, more: &str) -> Result<Claim, MeasureError> {
    let decades = f64::from(CLEARANCE_EXPONENTS.end() - CLEARANCE_EXPONENTS.start()) * std::f64::consts::LOG10_2;
    let words = format!("relative error {error:.0e} over {decades:.0} decades of clearance{more}");
    Ok(stated(id)?.measured(words, [("largest_relative_error", error)]).within_limit())
}

fn slope() -> Result<Claim, MeasureError> {
    let tension = unit_tension(2.0, 1.0)?;
    let (alpha, k_m) = (tension.alpha(), tension.k_m());
    // At the zero of V' its two terms are the scale: (alpha/K) (1 + csch^2 s) = 2 alpha/K - V'.
    let error = largest_difference(
        &tension,
        |l| tension.value(l),
        |l| tension.derivative(l),
        |l, _| (2.0 * alpha / k_m - tension.derivative(l)).abs(),
    );
    of_difference("tension-slope", error, "")
}

fn curvature() -> Result<Claim, MeasureError> {
    let tension = unit_tension(2.0, 1.0)?;
    // At large clearances V'' is smaller than the change of V' by rounding.
    let error = largest_difference(
        &tension,
        |l| tension.derivative(l),
        |l| tension.second_derivative(l),
        |l, clearance_m| tension.second_derivative(l) + tension.derivative(l).abs() / clearance_m,
    );
    let positive = CLEARANCE_EXPONENTS.into_iter().all(|e| {
        let curvature = tension.second_derivative(tension.delta_m() + libm::exp2(f64::from(e)));
        // Beyond about 350 K it underflows to 0.
        curvature > 0.0 || (curvature == 0.0 && e > 8)
    });
    let sign = if positive { "; never negative" } else { "; negative somewhere" };
    Ok(of_difference("tension-curvature", error, sign)?.but_only_if(positive))
}
