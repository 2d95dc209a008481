//! A number of each vehicle over time.

use super::chart::{Band, Chart};
use super::distances::quantile;
use super::history::{FEW_VEHICLES, RunHistory, Span};
use super::svg::{PALETTE, Stroke};

/// Draws a line for each of up to 12 vehicles; of more vehicles the largest number, the median and the band that holds nine
/// tenths of them. A span without numbers breaks the lines.
pub(super) fn of_each(chart: &mut Chart, history: &RunHistory, numbers: impl Fn(&Span) -> &[f64]) {
    let count = history.vehicles();
    if count <= FEW_VEHICLES {
        for i in 0..count {
            let number = |span| numbers(span).get(i).copied().unwrap_or(f64::NAN);
            let points = history.spans().map(|span| (span.time_s, number(span))).collect();
            chart.line(points, Stroke::of_line(i), format!("vehicle {}", i + 1));
        }
    } else {
        let ranks = history.spans().map(|span| {
            let mut finite: Vec<_> = numbers(span).iter().copied().filter(|number| number.is_finite()).collect();
            (span.time_s, [0.05, 0.5, 0.95, 1.0].map(|share| quantile(&mut finite, share)))
        });
        let ranks: Vec<_> = ranks.collect();
        let points = |k: usize| ranks.iter().map(|(time_s, ranks)| (*time_s, ranks[k])).collect();
        chart.line(points(3), Stroke::solid(PALETTE[1], 1.5), "largest");
        chart.line(points(1), Stroke::solid(PALETTE[0], 1.5), "median");
        let points = ranks.iter().map(|&(time_s, [low, _, high, _])| (time_s, low, high)).collect();
        chart.bands.push(Band { points, colour: PALETTE[0], opacity: 0.2, label: Some("5 to 95 %".to_owned()) });
    }
}
