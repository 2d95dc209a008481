//! Distances of pairs over time.

use super::Figure;
use super::axis::{Axis, Scale};
use super::chart::{Chart, LEGEND, Line, Mark, Panel, Shape};
use super::spans::{Span, Spans};
use super::svg::Stroke;
use crate::drawing::colours::{INK, SOFT_INK, VEHICLES};
use crate::flight_log::{FEW_VEHICLES, FlightLog, nearest_present, pairs};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, separation};
use tautline_core::text::{beside_limit, counted};

/// Largest number of pairs whose distances are ranked at an instant.
const RANKED_PAIRS: usize = 20_000;
/// Largest number of instants with ranked distances: one for each pixel.
const RANKED_INSTANTS: usize = 400;
/// Number of pairs of a large swarm that are drawn one by one, the closest.
const CLOSEST_PAIRS: usize = 5;
/// Palette indices of the colours of collisions and of the certified distance.
const HIT: usize = 1;
const CERTIFIED: usize = 2;

/// Draws distances of pairs \[m\] over time \[s\], with the safety distance delta and the certified one, and below the
/// clearance: the distances less delta, near delta. Up to 12 vehicles, every pair has a line; the closest ones have
/// colours. For more vehicles the figure shows the smallest distance, bands of quantiles, and
/// the five closest pairs. Quantiles are those of at most 20 000 pairs, spread evenly over all.
///
/// The closest approach includes the time between samples.
#[must_use]
pub fn distances(log: &FlightLog, delta_m: f64, certified_m: Option<f64>, title: &str) -> Figure {
    let (spans, closest) = (Spans::of(log), log.closest());
    let mut chart = Chart::new(spans.time_axis(), Axis::distances("m", &[], delta_m));
    let note = if spans.vehicles() <= FEW_VEHICLES {
        let others =
            1 + usize::from(certified_m.is_some()) + usize::from(closest.is_some()) + usize::from(log.hits().1 > 0);
        chart.lines = of_all_pairs(&spans, LEGEND.saturating_sub(others));
        String::new()
    } else {
        of_many_pairs(&spans, &mut chart)
    };
    let drawn = chart.lines.iter().flat_map(|line| line.points.iter().map(|&(_, y)| y));
    let bands = chart.shapes.iter().flat_map(|band| band.corners.iter().map(|&(_, y)| y));
    let marked = closest.map(|closest| closest.separation_m);
    let numbers: Vec<f64> = drawn.chain(bands).chain(marked).chain([delta_m]).chain(certified_m).collect();
    chart.y = Axis::distances("m", &numbers, delta_m);
    let least_m = closest.map_or(f64::NAN, |closest| closest.separation_m);
    let median_m = |line: &Line| {
        let mut known: Vec<_> = line.points.iter().map(|&(_, y)| y).filter(|y| y.is_finite()).collect();
        quantile(&mut known, 0.5)
    };
    let typical_m = chart.lines.iter().map(median_m).fold(f64::NAN, f64::min);
    chart.panel = panel(&chart.y, [least_m, typical_m], delta_m);
    if spans.vehicles() <= FEW_VEHICLES {
        chart.merge_equal_lines();
    }
    let is_equal = certified_m == Some(delta_m);
    let both = if is_equal { " = certified" } else { "" };
    chart.level(delta_m, Stroke::solid(INK, 2.0), format!("safety distance δ{both} = {delta_m} m"));
    if let Some(certified_m) = certified_m.filter(|_| !is_equal) {
        // Its dashes remain visible on the line of delta.
        let stroke = Stroke::dashed(VEHICLES[CERTIFIED], 1.6);
        chart.level(certified_m, stroke, format!("certified {} m", beside_limit(certified_m, delta_m, 3)));
    }
    let scale = if chart.y.scale == Scale::Log { " on a logarithmic axis" } else { "" };
    let of = if log.metric().is_metres() { "" } else { ", scaled to the ellipsoids that must stay empty," };
    let mut description = format!(
        "Distances between {} vehicles{of} over time{scale}; the safety distance is {delta_m} m.",
        spans.vehicles()
    );
    if let Some(closest) = closest {
        let metres = beside_limit(closest.separation_m, delta_m, 3);
        let [first, second] = closest.pair.numbers();
        let words = format!("{metres} m, vehicles {first} and {second} at {:.2} s", closest.time_s);
        description.extend([" Closest: ", &words, "."]);
        let at = (closest.time_s, closest.separation_m);
        chart.marks.push(Mark::ring(at, INK, Some(format!("closest {words}"))));
    }
    let (hits, hit_count) = log.hits();
    let in_words = counted(hit_count as u64, "time", "times");
    let places = hits.iter().filter_map(|hit| Some((hit.time_s, log.hit_distance_m(hit)?)));
    for (k, at) in places.enumerate() {
        let label = (k == 0).then(|| format!("hulls hit, {in_words}"));
        chart.marks.push(Mark::cross(at, VEHICLES[HIT], label));
    }
    if hit_count > 0 {
        description.extend([" Hulls hit ", &in_words, "."]);
    }
    chart.figure("distances", title, &(description + &note))
}

/// Returns the short label of a pair beside its line, such as `1-2`.
fn pair_label(pair: Pair) -> String {
    let [first, second] = pair.numbers();
    format!("{first}-{second}")
}

/// Returns the plot of the clearance \[m\], unless the chart shows it as well. `typical_m` is the median over time of
/// the closest pair's distance. The plot shows it besides the smallest distance, which may be a short spike.
fn panel(y: &Axis, [least_m, typical_m]: [f64; 2], delta_m: f64) -> Option<Panel> {
    /// Smallest enlargement.
    const LEAST: f64 = 2.5;
    /// Height of the plot relative to the typical clearance.
    const SPACE: f64 = 1.15;
    /// Largest height relative to the smallest clearance, which must remain visible.
    const MOST: f64 = 10.0;
    let clearance_m = least_m - delta_m;
    let top_m = if clearance_m > 0.0 { 2.0 * clearance_m } else { -clearance_m };
    let top_m = top_m.max(0.25 * delta_m);
    let to = |top_m: f64| Axis::linear("clearance [m]", [clearance_m.min(0.0), top_m], true);
    let is_enlarged = |near: &Axis| y.scale == Scale::Log || (near.to - near.from) * LEAST < y.to - y.from;
    let whole = to(top_m.max((SPACE * (typical_m - delta_m)).min(MOST * clearance_m.abs())));
    let near = if is_enlarged(&whole) { whole } else { to(top_m) };
    let is_enlarged = is_enlarged(&near);
    (delta_m > 0.0 && clearance_m.is_finite() && is_enlarged).then_some(Panel { y: near, limit: delta_m })
}

/// Returns a line for each pair. At most `most` entries of the legend are used: the closest pairs have colours, and the
/// others are grey.
fn of_all_pairs(spans: &Spans<'_>, most: usize) -> Vec<Line> {
    let all: Vec<_> = pairs(spans.vehicles()).collect();
    let least_m = |k: usize| spans.iter().map(|span| span.extremes.pair_min_m[k]).fold(f64::INFINITY, f64::min);
    let mut order: Vec<_> = (0..all.len()).map(|k| (least_m(k), k)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let coloured = if all.len() <= most { all.len() } else { most.saturating_sub(1) };
    let points = |k: usize| spans.iter().map(|span| (span.time_s, span.extremes.pair_min_m[k])).collect();
    let (near, others) = order.split_at(coloured);
    let grey = |points, label| Line { points, stroke: Stroke::of_others(), label };
    let mut lines: Vec<_> = others.iter().map(|&(_, k)| grey(points(k), None)).collect();
    // The closest pair is drawn last, above the others.
    lines.extend(near.iter().enumerate().rev().map(|(rank, &(_, k))| {
        let (i, j) = all[k];
        Line { points: points(k), stroke: Stroke::of_line(rank), label: Some(pair_label(Pair::new(i, j))) }
    }));
    if !others.is_empty() {
        lines.push(grey(Vec::new(), Some(format!("{} other pairs", others.len()))));
    }
    lines
}

/// Draws the pairs of a large swarm. Returns a sentence, after a blank, on the pairs that are drawn.
fn of_many_pairs(spans: &Spans<'_>, chart: &mut Chart) -> String {
    let (ranked_pairs, all) = ranked_pairs(spans.vehicles());
    let instants = spans.spread(RANKED_INSTANTS);
    let mut scratch = Vec::new();
    let scaled = |span: &Span<'_>| spans.log.metric().scaled_rows(span.positions_m);
    let ranks: Vec<_> = instants.iter().map(|span| quantiles_m(&scaled(span), &ranked_pairs, &mut scratch)).collect();
    let times_s = || instants.iter().map(|span| span.time_s);
    let band = |low: usize, high: usize, opacity: f64, label: &str| {
        let points = times_s().zip(&ranks).map(|(time_s, ranks)| (time_s, ranks[low], ranks[high]));
        Shape::band(&points.collect::<Vec<_>>(), VEHICLES[0], opacity, label.to_owned())
    };
    chart.shapes = vec![band(0, 4, 0.16, "5 to 95 %"), band(1, 3, 0.28, "25 to 75 %")];
    let median = times_s().zip(&ranks).map(|(time_s, ranks)| (time_s, ranks[2])).collect();
    chart.line(median, Stroke::solid(VEHICLES[0], 1.6), "median");

    // Includes the time between samples, if the recording covers it.
    let swept: Vec<_> = spans.iter().filter_map(|span| Some((span.time_s, span.closest?))).collect();
    let nearest = |span: &Span<'_>| {
        let (pair, separation_m) = nearest_present(span.positions_m, spans.log.metric())?;
        Some(ClosestApproach { pair, separation_m, time_s: span.time_s })
    };
    let is_swept = !swept.is_empty();
    let closest: Vec<_> = if !is_swept && ranked_pairs.len() == all {
        instants.iter().filter_map(|span| Some((span.time_s, nearest(span)?))).collect()
    } else {
        swept
    };
    for (k, pair) in closest_pairs(&closest, spans.vehicles()).into_iter().enumerate() {
        let apart_m = |span: &Span<'_>| separation(&scaled(span), pair.first(), pair.second());
        let apart = spans.iter().map(|span| (span.time_s, apart_m(span))).collect();
        chart.line(apart, Stroke::solid(VEHICLES[k + 1], 1.0), pair_label(pair));
    }
    let at_ends = || closest.iter().map(|&(time_s, closest)| (time_s, closest.separation_m)).collect();
    let smallest = if is_swept { steps(&closest) } else { at_ends() };
    chart.line(smallest, Stroke::dashed(SOFT_INK, 1.4), "smallest");
    match (ranked_pairs.len(), ranks.len()) {
        (ranked, instants) if ranked < all => {
            format!(" Median and bands are those of {ranked} of the {all} pairs, evenly chosen at {instants} instants.")
        }
        _ => String::new(),
    }
}

/// Returns the corners of steps: a line through the closest approaches of spans that end at these times would lie above
/// the distance in between.
fn steps(closest: &[(f64, ClosestApproach)]) -> Vec<(f64, f64)> {
    let starts = closest.iter().take(1).chain(closest).map(|&(start_s, _)| start_s);
    let corners = starts
        .zip(closest)
        .flat_map(|(start_s, &(end_s, closest))| [(start_s, closest.separation_m), (end_s, closest.separation_m)]);
    corners.collect()
}

/// Returns the pairs whose distances are ranked, and the number of all pairs.
fn ranked_pairs(count: usize) -> (Vec<(usize, usize)>, usize) {
    let all = count * count.saturating_sub(1) / 2;
    if all <= RANKED_PAIRS {
        return (pairs(count).collect(), all);
    }
    // Each vehicle has about the same number of pairs, with partners spread over all others.
    let pair = |k: usize| (k % count, (k % count + 1 + evenly(k, count - 1)) % count);
    ((0..RANKED_PAIRS).map(pair).collect(), all)
}

/// Returns the `k`-th term of a sequence that fills the numbers below `count` evenly in a scattered order: multiples of
/// the golden ratio, modulo 1, scaled.
pub(super) fn evenly(k: usize, count: usize) -> usize {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
    let number = ((golden * k as f64).fract() * count as f64) as usize;
    number.min(count - 1)
}

/// Returns the quantiles of 5, 25, 50, 75 and 95 % of the distances of pairs \[m\]; NaN without a finite distance.
fn quantiles_m(positions_m: &Rows, pairs: &[(usize, usize)], scratch: &mut Vec<f64>) -> [f64; 5] {
    scratch.clear();
    scratch.extend(pairs.iter().map(|&(i, j)| separation(positions_m, i, j)).filter(|distance| distance.is_finite()));
    [0.05, 0.25, 0.5, 0.75, 0.95].map(|share| quantile(scratch, share))
}

/// Returns the number below which a share of the numbers lies; NaN without numbers. Reorders the numbers.
pub(super) fn quantile(numbers: &mut [f64], share: f64) -> f64 {
    let Some(last) = numbers.len().checked_sub(1) else { return f64::NAN };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let place = (share * last as f64).round() as usize;
    *numbers.select_nth_unstable_by(place.min(last), f64::total_cmp).1
}

/// Returns the closest pairs, the closest first.
fn closest_pairs(closest: &[(f64, ClosestApproach)], vehicles: usize) -> Vec<Pair> {
    let known = closest.iter().map(|(_, closest)| (closest.pair, closest.separation_m));
    let mut known: Vec<_> = known.filter(|(pair, apart_m)| apart_m.is_finite() && pair.second() < vehicles).collect();
    known.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut closest = Vec::new();
    for (pair, _) in known {
        if closest.len() < CLOSEST_PAIRS && !closest.contains(&pair) {
            closest.push(pair);
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
    fn quantiles_of_an_even_sample_are_those_of_all_pairs() {
        let count = 600;
        let line = Rows::from_fn(count, |i, axis| if axis == 0 { i as f64 } else { 0.0 });
        let (sample, all) = ranked_pairs(count);
        assert!(sample.len() < all && sample.iter().all(|&(i, j)| i != j && i < count && j < count));
        let every: Vec<_> = pairs(count).collect();
        let of = |pairs: &[(usize, usize)]| quantiles_m(&line, pairs, &mut Vec::new());
        for (found, expected) in of(&sample).into_iter().zip(of(&every)) {
            assert!((found - expected).abs() < 0.01 * count as f64, "{found} instead of {expected}");
        }
    }
}
