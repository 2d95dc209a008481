//! Smallest separation over time as a chart, in coordinates of 1000 by 100.

use std::fmt::Write as _;

use super::{JudgementContext, Kind, Moment};
use crate::figures::time_ticks;
use tautline_audit::Slice;
use tautline_core::text::significant;

/// Width and height.
const SIZE: [f64; 2] = [1000.0, 100.0];
/// Amount by which a band is widened on either side, so that it stays visible.
const MARGIN: f64 = 1.5;

/// Largest distance, relative to the limit, up to which heights are proportional to distances.
const LOW: f64 = 6.0;

/// Smallest distance of two labels.
const LABEL: f64 = 30.0;

/// Lines and bands of the chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Smallest distance of each slice of time, as an SVG path. The path breaks at gaps, and a partial slice is a dot.
    pub distance: String,
    /// Height of the limit, from above.
    pub limit: Option<f64>,
    /// Heights with their distances in words: the largest distance, and the limit.
    pub levels: Vec<(f64, String)>,
    /// Ticks of the axis of time: place and label.
    pub ticks: Vec<(f64, String)>,
    /// Bands of findings: start, end, and whether the finding is a violation (otherwise undecided). Bands of one kind
    /// do not overlap.
    pub bands: Vec<(f64, f64, bool)>,
    /// Position of the closest approach.
    pub closest: Option<[f64; 2]>,
}

impl Chart {
    /// Returns the chart of a flight with these slices and findings. Heights grow with the distance, or with its square
    /// root if the limit would be low beside the largest distance.
    pub(super) fn of(
        near: &[Slice],
        moments: &[Moment],
        judged: JudgementContext,
        [first_s, last_s]: [f64; 2],
    ) -> Self {
        let JudgementContext { limit, unit, .. } = judged;
        let x = |time_s: f64| ((time_s - first_s) / (last_s - first_s).max(1e-300)).clamp(0.0, 1.0) * SIZE[0];
        let mut sorted: Vec<f64> = near.iter().map(|slice| slice.closest.certain_m()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let largest = sorted.last().copied().filter(|largest| largest.is_finite());
        let most = largest.unwrap_or(1.0).max(limit.map_or(0.0, |limit| 1.25 * limit)).max(1e-300);
        let is_low = limit.is_some_and(|limit| limit > 0.0 && most > LOW * limit);
        let share = |distance: f64| (distance / most).clamp(0.0, 1.0);
        let y = |distance: f64| SIZE[1] * (1.0 - 0.96 * if is_low { share(distance).sqrt() } else { share(distance) });
        let mut distance = String::new();
        let mut end_s = f64::NEG_INFINITY;
        for slice in near {
            let ([from_s, to_s], height) = (slice.known_s(), y(slice.closest.certain_m()));
            // Writing to a string cannot fail.
            let _ = if from_s > end_s {
                write!(distance, "M{:.1} {height:.1}", x(from_s))
            } else {
                write!(distance, "V{height:.1}")
            };
            let _ = write!(distance, "H{:.1}", x(to_s));
            end_s = to_s;
        }
        let unit = if unit == "m" { " m" } else { "" };
        let limit_label = limit.map(|limit| (y(limit), format!("{limit}{unit}")));
        // The label stands at the height of the number that it shows.
        let largest = largest.map(|most| significant(most, 3));
        let largest = largest.and_then(|shown| Some((y(shown.parse().ok()?), format!("{shown}{unit}"))));
        let levels = [largest.filter(|at| limit_label.as_ref().is_none_or(|of| of.0 - at.0 > LABEL)), limit_label];
        let of_pairs = moments.iter().find(|moment| moment.kind == Kind::Closest && moment.obstacle.is_none());
        let mut bands = Vec::new();
        for violation in [false, true] {
            let some =
                moments.iter().filter(|of| of.kind != Kind::Closest && (of.kind == Kind::Violation) == violation);
            let some = some.map(|of| (x(of.span.from_s) - MARGIN, x(of.span.to_s) + MARGIN));
            bands.extend(joined(some.collect()).into_iter().map(|(from, to)| (from, to, violation)));
        }
        Self {
            distance,
            limit: limit.map(y),
            levels: levels.into_iter().flatten().collect(),
            ticks: time_ticks(first_s, last_s).into_iter().map(|(time_s, label)| (x(time_s), label)).collect(),
            bands,
            closest: of_pairs.zip(sorted.first()).map(|(of, &least)| [x(of.span.at_s), y(least)]),
        }
    }
}

/// Merges stretches that touch each other.
fn joined(mut all: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut joined: Vec<(f64, f64)> = Vec::new();
    for (from, to) in all {
        match joined.last_mut() {
            Some(last) if from <= last.1 => last.1 = last.1.max(to),
            _ => joined.push((from, to)),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::super::Span;
    use super::*;
    use tautline_audit::{Approach, ObjectPair};
    use tautline_core::swarm::Pair;

    #[test]
    fn bands_do_not_overlap_and_gaps_break_the_line() {
        let slice = |from_s: f64| {
            let pair = ObjectPair::Vehicles(Pair::new(0, 1));
            let closest = Approach { pair, lower_m: 2.0, upper_m: 2.0, time_s: from_s, limit_m: 1.0 };
            Slice { from_s, to_s: from_s + 1.0, closest, is_whole: true }
        };
        let moment = |kind: Kind, from_s: f64, to_s: f64| {
            let span = Span { from_s, to_s, at_s: from_s };
            Moment { kind, vehicles: Vec::new(), obstacle: None, span, brief: String::new(), said: String::new() }
        };
        let moments = [
            moment(Kind::Violation, 4.0, 5.0),
            moment(Kind::Violation, 1.0, 2.0),
            moment(Kind::Violation, 1.5, 3.0),
            moment(Kind::Unseen, 2.0, 4.0),
        ];
        let judged = JudgementContext { is_else_known: true, limit: None, unit: "m" };
        let in_parts = Slice { to_s: 7.0, is_whole: false, ..slice(5.0) };
        let chart = Chart::of(&[slice(0.0), slice(1.0), in_parts, slice(8.0)], &moments, judged, [0.0, 10.0]);
        assert_eq!(chart.bands, [(198.5, 401.5, false), (98.5, 301.5, true), (398.5, 501.5, true)]);
        assert_eq!(chart.distance, "M0.0 4.0H100.0V4.0H200.0M500.0 4.0H500.0M800.0 4.0H900.0");
        let labels: Vec<_> = chart.levels.iter().map(|(_, label)| label.as_str()).collect();
        assert_eq!((labels, chart.ticks.len()), (vec!["2.00 m"], 6));
    }
}
