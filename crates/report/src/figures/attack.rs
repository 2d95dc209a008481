//! The worst of a search over its flights.

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, Mark};
use super::svg::{INK, PALETTE, SOFT_INK, Stroke};
use tautline_core::text::metres;

/// The smallest separation \[m\] that a search had found after so many of `flights`, with delta and the separation of the flight
/// that it began from. `found` has each flight, numbered from 1, that was worse than all before it.
#[must_use]
pub fn attack(found: &[(u64, f64)], flights: u64, delta_m: f64, own_m: Option<f64>) -> Figure {
    let last = flights.max(1) as f64;
    let lengths = found.iter().map(|&(_, min_m)| min_m).chain([delta_m]).chain(own_m);
    let mut chart =
        Chart::new(Axis::spanning("flights", 0.0, last, 6.0), Axis::linear("smallest separation [m]", lengths, true));
    let mut points = Vec::with_capacity(2 * found.len() + 1);
    for &(flight, min_m) in found {
        points.extend(points.last().map(|&(_, before_m): &(f64, f64)| (flight as f64, before_m)));
        points.push((flight as f64, min_m));
    }
    points.extend(points.last().map(|&(_, worst_m)| (last, worst_m)));
    chart.line(points, Stroke::solid(PALETTE[0], 1.8), "the worst found");
    chart.level(delta_m, Stroke::dashed(INK, 1.3), format!("delta = {} m", metres(delta_m)));
    if let Some(own_m) = own_m {
        chart.level(own_m, Stroke::dashed(SOFT_INK, 1.0), "the scenario as it is".to_owned());
    }
    let worst = found.last();
    let at = worst.map(|&(flight, min_m)| Mark::ring((flight as f64, min_m), PALETTE[0], None));
    chart.marks.extend(at);
    let description = match worst {
        Some((flight, min_m)) => {
            format!(
                "The smallest separation found over the flights of the search: {} m in flight {flight}.",
                metres(*min_m)
            )
        }
        None => "The smallest separation found over the flights of the search: nothing could be flown.".to_owned(),
    };
    chart.figure("attack", "The worst found", &description)
}
