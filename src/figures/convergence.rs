//! An integrator's error over its step.

use super::axis::Axis;
use super::chart::Chart;
use super::figure::Figure;
use super::svg::{INK, PALETTE, Stroke};

/// The line of order 1 over the first error in double precision: below it, so that neither hides the other.
const ASIDE: f64 = 0.5;

/// One step length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Its length \[s\].
    pub dt_s: f64,
    /// Largest position error in double precision \[m\].
    pub double_m: f64,
    /// Largest position error in single precision \[m\].
    pub single_m: f64,
}

/// Largest position error \[m\] over the step \[s\], both on logarithmic axes, in single and double precision, with a
/// line of order 1 beside them.
#[must_use]
pub fn convergence(steps: &[Step], title: &str) -> Figure {
    let errors = steps.iter().flat_map(|step| [step.double_m, step.single_m]);
    let x = Axis::log("step dt [s]", steps.iter().map(|step| step.dt_s));
    let mut chart = Chart::new(x, Axis::log("largest position error [m]", errors));
    let mut line = |error: fn(&Step) -> f64, stroke: Stroke, label: &str| {
        chart.line(steps.iter().map(|step| (step.dt_s, error(step))).collect(), stroke, label);
    };
    line(|step| step.double_m, Stroke::solid(PALETTE[0], 1.8), "double precision");
    line(|step| step.single_m, Stroke::solid(PALETTE[1], 1.8), "single precision");
    if let [first, .., last] = steps {
        let beside_m = ASIDE * first.double_m;
        let points = [first, last].map(|step| (step.dt_s, beside_m * step.dt_s / first.dt_s)).to_vec();
        chart.line(points, Stroke::dashed(INK, 1.0), "order 1");
    }
    let best = |error: fn(&Step) -> f64| steps.iter().map(error).fold(f64::INFINITY, f64::min);
    let description = format!(
        "Largest position error over the step: at best {:.1e} m in double and {:.1e} m in single precision.",
        best(|step| step.double_m),
        best(|step| step.single_m)
    );
    chart.figure("convergence", title, &description)
}
