//! The edge tension over the distance.

use super::axis::Axis;
use super::chart::{Chart, INK, Line, Mark, MarkShape, PALETTE, Stroke};
use super::{Figure, FigureError};
use crate::law::EdgeTension;

/// Highest tension shown, over alpha.
const TOP: f64 = 4.0;
/// Farthest distance shown, in units of K beyond delta.
const FAR: f64 = 5.0;
/// Points of the curve.
const POINTS: u32 = 400;

/// The tension V(l) \[m^2/s^2\] of equation (5) over the distance l \[m\], with the barrier at delta and the minimum at d
/// marked.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn tension_curve(tension: &EdgeTension, title: &str) -> Result<Figure, FigureError> {
    let (delta_m, rest_m) = (tension.delta_m(), tension.rest_m());
    let top = TOP * tension.alpha();
    let (near, far) = (tension.push_side_root(top), delta_m + FAR * tension.k_m());
    let points: Vec<_> = (0..=POINTS)
        .map(|k| near + (far - near) * (f64::from(k) / f64::from(POINTS)).powi(2))
        .map(|l| (l, tension.value(l).min(top)))
        .collect();

    let x = Axis::linear("distance l [m]", [0.0, far], false);
    let mut chart = Chart::new(x, Axis::linear("tension V [m²/s²]", [0.0, top], true));
    chart.lines.push(Line { points, stroke: Stroke::solid(PALETTE[0], 1.8), label: Some("V(l)".to_owned()) });
    chart.lines.push(Line {
        points: [chart.y.from, chart.y.to].map(|y| (delta_m, y)).to_vec(),
        stroke: Stroke::solid(INK, 1.6),
        label: Some(format!("barrier δ = {delta_m} m")),
    });
    let minimum = format!("minimum at d = {rest_m:.4} m, Vmin = {:.4} m²/s²", tension.minimum());
    let description = format!("Edge tension over distance: it grows without bound towards {delta_m} m; {minimum}.");
    chart.marks.push(Mark {
        at: (rest_m, 0.0),
        shape: MarkShape::Ring,
        color: PALETTE[1],
        size_px: 4.5,
        text: None,
        label: Some(minimum),
    });
    chart.figure("tension", title, &description)
}
