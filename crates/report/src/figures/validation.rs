//! Curves for the comparison with formulas: edge tension, and error of an integrator.

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, Mark};
use super::svg::Stroke;
use crate::drawing::colours::{INK, VEHICLES};
use tautline_laws::law::EdgeTension;

/// Largest tension in the chart, over alpha.
const TOP: f64 = 4.0;
/// Largest distance in the chart, in units of K beyond delta.
const FAR: f64 = 5.0;
/// Number of points of the curve.
const POINTS: u32 = 400;

/// Draws the tension V(l) \[m^2/s^2\] of equation (5) over the distance l \[m\], with the barrier at delta and the
/// minimum at d.
#[must_use]
pub fn tension_curve(tension: &EdgeTension, title: &str) -> Figure {
    let (delta_m, rest_m) = (tension.delta_m(), tension.rest_m());
    let top = TOP * tension.alpha();
    let (near, far) = (tension.push_side_root(top), delta_m + FAR * tension.k_m());
    let points: Vec<_> = (0..=POINTS)
        .map(|k| near + (far - near) * (f64::from(k) / f64::from(POINTS)).powi(2))
        .map(|l| (l, tension.value(l).min(top)))
        .collect();

    let x = Axis::linear("distance l [m]", [0.0, far], false);
    let mut chart = Chart::new(x, Axis::linear("tension V [m^2/s^2]", [0.0, top], true));
    chart.line(points, Stroke::solid(VEHICLES[0], 1.8), "V(l)");
    chart.upright(delta_m, Stroke::solid(INK, 1.6), Some(format!("barrier δ = {delta_m} m")));
    let minimum = format!("minimum at d = {rest_m:.4} m, Vmin = {:.4} m^2/s^2", tension.minimum());
    let description = format!("Edge tension over distance: unbounded towards {delta_m} m; {minimum}.");
    chart.marks.push(Mark::ring((rest_m, 0.0), VEHICLES[1], Some(minimum)));
    chart.figure("tension", title, &description)
}

/// Offset factor of the line of order 1 from the first error, so that the lines do not overlap.
const ASIDE: f64 = 0.5;

/// Error of an integrator at one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Length of the step \[s\].
    pub dt_s: f64,
    /// Largest position error \[m\].
    pub error_m: f64,
}

/// Draws the largest position error \[m\] over the step \[s\] on logarithmic axes, with a line of order 1 beside it.
#[must_use]
pub fn convergence(steps: &[Step], title: &str) -> Figure {
    let x = Axis::log("step dt [s]", steps.iter().map(|step| step.dt_s));
    let mut chart = Chart::new(x, Axis::log("largest position error [m]", steps.iter().map(|step| step.error_m)));
    let errors = steps.iter().map(|step| (step.dt_s, step.error_m)).collect();
    chart.line(errors, Stroke::solid(VEHICLES[0], 1.8), "position error");
    if let [first, .., last] = steps {
        let beside_m = ASIDE * first.error_m;
        let points = [first, last].map(|step| (step.dt_s, beside_m * step.dt_s / first.dt_s)).to_vec();
        chart.line(points, Stroke::dashed(INK, 1.0), "order 1");
    }
    let best_m = steps.iter().map(|step| step.error_m).fold(f64::INFINITY, f64::min);
    let description = format!("Largest position error over the step: at best {best_m:.1e} m.");
    chart.figure("convergence", title, &description)
}
