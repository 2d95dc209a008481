//! The edge tension over the distance.

use super::axis::Axis;
use super::chart::{Chart, Mark};
use super::figure::Figure;
use super::svg::{INK, PALETTE, Stroke};
use tautline_laws::law::EdgeTension;

/// Highest tension shown, over alpha.
const TOP: f64 = 4.0;
/// Farthest distance shown, in units of K beyond delta.
const FAR: f64 = 5.0;
/// Points of the curve.
const POINTS: u32 = 400;

/// The tension V(l) \[m^2/s^2\] of equation (5) over the distance l \[m\], with the barrier at delta and the minimum at d
/// marked.
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
    let mut chart = Chart::new(x, Axis::linear("tension V [m²/s²]", [0.0, top], true));
    chart.line(points, Stroke::solid(PALETTE[0], 1.8), "V(l)");
    let barrier = [chart.y.from, chart.y.to].map(|y| (delta_m, y)).to_vec();
    chart.line(barrier, Stroke::solid(INK, 1.6), format!("barrier δ = {delta_m} m"));
    let minimum = format!("minimum at d = {rest_m:.4} m, Vmin = {:.4} m²/s²", tension.minimum());
    let description = format!("Edge tension over distance: it grows without bound towards {delta_m} m; {minimum}.");
    chart.marks.push(Mark::ring((rest_m, 0.0), PALETTE[1], Some(minimum)));
    chart.figure("tension", title, &description)
}
