//! Distances of pairs over time.

use super::axis::{Axis, Scale};
use super::chart::{Band, Chart, INK, Line, Mark, MarkShape, PALETTE, SOFT_INK, Stroke};
use super::course::{Course, Span, pairs};
use super::{Figure, FigureError};
use crate::swarm::{Pair, Rows, at_least, separation};

/// Distances computed for one figure, at most: some seconds of work for a thousand vehicles would be too many.
pub(super) const DISTANCES: usize = 32_000_000;
/// Fewest instants that a curve is drawn through.
const FEWEST_INSTANTS: usize = 48;
/// Most pairs whose distances are ranked at one instant; of more pairs every k-th is.
const RANKED_PAIRS: usize = 500_000;
/// Pairs of a large swarm that are drawn one by one: those that come closest.
const CLOSEST_PAIRS: usize = 5;
/// With the largest distance beyond this many safety distances the axis is logarithmic, or delta could not be seen.
const LOG_FROM: f64 = 40.0;
/// More pairs than this are not told apart by colour.
const TOLD_APART: usize = 15;

/// Distances of pairs \[m\] over time \[s\], with the safety distance delta and the certified one: every pair of up to
/// 12 vehicles; of more vehicles the smallest distance, bands of quantiles, and the five pairs that come closest.
///
/// The closest approach is marked with what the recording says of the time between samples too.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn distances(course: &Course, delta_m: f64, certified_m: Option<f64>, title: &str) -> Result<Figure, FigureError> {
    let few = course.spans().any(|span| !span.pair_min_m.is_empty());
    let curves = if few { of_all_pairs(course) } else { of_many_pairs(course) };
    let drawn = curves.lines.iter().flat_map(|line| line.points.iter().map(|&(_, y)| y));
    let bands = curves.bands.iter().flat_map(|band| band.points.iter().map(|&(_, _, high)| high));
    let closest = course.closest();
    let numbers: Vec<f64> = drawn.chain(bands).chain(closest.map(|closest| closest.separation_m)).collect();
    let largest = numbers.iter().copied().filter(|y| y.is_finite()).fold(delta_m, f64::max);

    let label = "distance [m]";
    let lines = [Some(delta_m), certified_m].into_iter().flatten();
    let y = if delta_m > 0.0 && largest > LOG_FROM * delta_m {
        Axis::log(label, numbers.iter().copied().chain(lines))
    } else {
        Axis::linear(label, numbers.iter().copied().chain(lines).chain([0.0]), true)
    };
    let mut chart = Chart::new(time_axis(course), y);
    (chart.bands, chart.lines) = (curves.bands, curves.lines);
    chart.level(delta_m, Stroke::solid(INK, 2.0), format!("safety distance δ = {delta_m} m"));
    if let Some(certified_m) = certified_m {
        chart.level(certified_m, Stroke::dashed(INK, 1.3), format!("certified {} m", at_least(certified_m, 3)));
    }
    let mut closest_in_words = String::new();
    if let Some(closest) = closest {
        let metres = at_least(closest.separation_m, 3);
        let words = format!("{metres} m, vehicles {} at {:.2} s", closest.pair, closest.time_s);
        closest_in_words = format!(" Closest: {words}.");
        let at = (closest.time_s, closest.separation_m);
        let label = Some(format!("closest {words}"));
        chart.marks.push(Mark { at, shape: MarkShape::Ring, color: INK, size_px: 4.5, text: None, label });
    }
    let count = course.vehicles();
    let scale = if chart.y.scale == Scale::Log { " on a logarithmic axis" } else { "" };
    let description = format!(
        "Distances between {count} vehicles over time{scale}; the safety distance is {delta_m} m.{closest_in_words}"
    );
    chart.figure("distances", title, &description)
}

/// The axis of time \[s\] of a run.
pub(super) fn time_axis(course: &Course) -> Axis {
    let start_s = course.spans().next().map_or(0.0, |span| span.time_s);
    let (from, to) = (start_s, course.end_s());
    if to > from {
        Axis::spanning("time [s]", from, to, 8.0)
    } else {
        Axis::spanning("time [s]", from, from + 1.0, 5.0)
    }
}

struct Curves {
    bands: Vec<Band>,
    lines: Vec<Line>,
}

fn of_all_pairs(course: &Course) -> Curves {
    let count = pairs(course.vehicles()).count();
    let lines = pairs(course.vehicles()).enumerate().map(|(k, (i, j))| {
        let points = course.spans().map(|span| (span.time_s, span.pair_min_m[k])).collect();
        let (stroke, label) = if count <= TOLD_APART {
            (Stroke::of_line(k), Some(Pair::new(i, j).to_string()))
        } else {
            (Stroke { opacity: 0.55, ..Stroke::solid(PALETTE[0], 0.9) }, (k == 0).then(|| format!("all {count} pairs")))
        };
        Line { points, stroke, label }
    });
    Curves { bands: Vec::new(), lines: lines.collect() }
}

fn of_many_pairs(course: &Course) -> Curves {
    let instants = instants(course);
    let ranked: Vec<Ranks> = instants.iter().map(|span| Ranks::of(&span.positions_m)).collect();
    let band = |low: usize, high: usize, opacity: f64, label: &str| Band {
        points: instants
            .iter()
            .zip(&ranked)
            .map(|(span, ranks)| (span.time_s, ranks.quantiles_m[low], ranks.quantiles_m[high]))
            .collect(),
        color: PALETTE[0],
        opacity,
        label: Some(label.to_owned()),
    };
    let line = |points, stroke, label: String| Line { points, stroke, label: Some(label) };
    let time_and = |number: fn(&Ranks) -> f64| {
        instants.iter().zip(&ranked).map(|(span, ranks)| (span.time_s, number(ranks))).collect::<Vec<_>>()
    };
    // Between samples too, where the recording knows.
    let swept: Vec<_> = course.spans().filter_map(|span| Some((span.time_s, span.closest?.separation_m))).collect();
    let smallest = if swept.is_empty() { time_and(|ranks| ranks.smallest.1) } else { swept };

    let mut lines =
        vec![line(time_and(|ranks| ranks.quantiles_m[2]), Stroke::solid(PALETTE[0], 1.6), "median".to_owned())];
    for (k, pair) in closest_pairs(course, &ranked).into_iter().enumerate() {
        let points = course
            .spans()
            .map(|span| (span.time_s, separation(&span.positions_m, pair.first(), pair.second())))
            .collect();
        lines.push(line(points, Stroke { width_px: 1.0, ..Stroke::solid(PALETTE[k + 1], 1.0) }, pair.to_string()));
    }
    lines.push(line(smallest, Stroke::dashed(SOFT_INK, 1.4), "smallest".to_owned()));
    Curves { bands: vec![band(0, 4, 0.16, "5 to 95 %"), band(1, 3, 0.28, "25 to 75 %")], lines }
}

/// Instants at which all distances of a large swarm are computed.
pub(super) fn instants(course: &Course) -> Vec<&Span> {
    let count = course.vehicles();
    let pairs = (count * count.saturating_sub(1) / 2).max(1);
    course.spread((DISTANCES / pairs).max(FEWEST_INSTANTS))
}

/// Order statistics of the distances at one instant.
struct Ranks {
    /// Quantiles of 5, 25, 50, 75 and 95 % \[m\]; NaN where no distance is finite.
    quantiles_m: [f64; 5],
    smallest: ((usize, usize), f64),
}

impl Ranks {
    fn of(positions_m: &Rows) -> Self {
        let count = positions_m.nrows();
        let stride = (count * count.saturating_sub(1) / 2).div_ceil(RANKED_PAIRS).max(1);
        let mut smallest = ((0, 0), f64::INFINITY);
        let mut ranked = Vec::new();
        for (k, (i, j)) in pairs(count).enumerate() {
            let distance = separation(positions_m, i, j);
            if distance < smallest.1 {
                smallest = ((i, j), distance);
            }
            if k.is_multiple_of(stride) && distance.is_finite() {
                ranked.push(distance);
            }
        }
        let quantiles_m = [0.05, 0.25, 0.5, 0.75, 0.95].map(|share| quantile(&mut ranked, share));
        Self { quantiles_m, smallest }
    }
}

/// The number below which a share of the others lies; NaN for none. Reorders the numbers.
pub(super) fn quantile(numbers: &mut [f64], share: f64) -> f64 {
    let Some(last) = numbers.len().checked_sub(1) else { return f64::NAN };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let place = (share * last as f64).round() as usize;
    *numbers.select_nth_unstable_by(place.min(last), f64::total_cmp).1
}

/// The pairs that come closest, the closest first.
fn closest_pairs(course: &Course, ranked: &[Ranks]) -> Vec<Pair> {
    let swept = course.spans().filter_map(|span| span.closest).map(|closest| (closest.pair, closest.separation_m));
    let sampled = ranked
        .iter()
        .filter(|ranks| ranks.smallest.1.is_finite())
        .map(|ranks| (Pair::new(ranks.smallest.0.0, ranks.smallest.0.1), ranks.smallest.1));
    let mut candidates: Vec<_> = swept.filter(|(_, distance)| distance.is_finite()).chain(sampled).collect();
    candidates.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut closest = Vec::new();
    for (pair, _) in candidates {
        if !closest.contains(&pair) && pair.second() < course.vehicles() {
            closest.push(pair);
        }
        if closest.len() == CLOSEST_PAIRS {
            break;
        }
    }
    closest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_sorted_numbers() {
        let mut numbers: Vec<_> = (0..101).rev().map(f64::from).collect();
        assert_eq!([0.0, 0.05, 0.5, 1.0].map(|share| quantile(&mut numbers, share)), [0.0, 5.0, 50.0, 100.0]);
        assert_eq!(quantile(&mut [7.0], 0.95), 7.0);
        assert!(quantile(&mut [], 0.5).is_nan());
    }

    #[test]
    fn ranks_name_the_closest_pair() {
        let positions_m = Rows::from_row_slice(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 6.0, 0.0, 0.0]);
        let ranks = Ranks::of(&positions_m);
        assert_eq!((ranks.smallest, ranks.quantiles_m[2]), (((1, 2), 1.0), 5.0));
        assert!(Ranks::of(&Rows::zeros(1)).smallest.1.is_infinite());
    }
}
