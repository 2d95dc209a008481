//! An integrator's error over its step.

use super::axis::Axis;
use super::chart::Chart;
use super::figure::Figure;
use super::svg::{INK, PALETTE, Stroke};

/// The line of order 1 over the first error: below it, so that neither hides the other.
const ASIDE: f64 = 0.5;

/// One step length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Its length \[s\].
    pub dt_s: f64,
    /// Largest position error \[m\].
    pub error_m: f64,
}

/// Largest position error \[m\] over the step \[s\], both on logarithmic axes, with a line
/// of order 1 beside it.
#[must_use]
pub fn convergence(steps: &[Step], title: &str) -> Figure {
    let x = Axis::log("step dt [s]", steps.iter().map(|step| step.dt_s));
    let mut chart = Chart::new(x, Axis::log("largest position error [m]", steps.iter().map(|step| step.error_m)));
    let errors = steps.iter().map(|step| (step.dt_s, step.error_m)).collect();
    chart.line(errors, Stroke::solid(PALETTE[0], 1.8), "position error");
    if let [first, .., last] = steps {
        let beside_m = ASIDE * first.error_m;
        let points = [first, last].map(|step| (step.dt_s, beside_m * step.dt_s / first.dt_s)).to_vec();
        chart.line(points, Stroke::dashed(INK, 1.0), "order 1");
    }
    let best_m = steps.iter().map(|step| step.error_m).fold(f64::INFINITY, f64::min);
    let description = format!("Largest position error over the step: at best {best_m:.1e} m.");
    chart.figure("convergence", title, &description)
}
