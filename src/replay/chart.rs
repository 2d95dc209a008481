//! The smallest distance over time as a chart, in a thousand parts of its width and a hundred of its height.

use std::fmt::Write as _;

use super::moment::{Kind, Moment};
use super::nearest::Slice;

/// Width and height.
const SIZE: [f64; 2] = [1000.0, 100.0];

/// Lines and bands of the chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// The smallest distance, as a path; nothing is drawn across a gap.
    pub distance: String,
    /// Height of the limit, from above.
    pub limit: Option<f64>,
    /// Bands of findings: from where to where, and whether it is a violation (or undecided).
    pub bands: Vec<(f64, f64, bool)>,
    /// Where the closest approach is.
    pub closest: Option<[f64; 2]>,
}

impl Chart {
    pub(super) fn of(near: &[Slice], moments: &[Moment], limit: Option<f64>, [first_s, last_s]: [f64; 2]) -> Self {
        let x = |time_s: f64| ((time_s - first_s) / (last_s - first_s).max(1e-300)).clamp(0.0, 1.0) * SIZE[0];
        let mut sorted: Vec<f64> = near.iter().map(|slice| slice.closest.separation_m).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        // Nine tenths are seen, and the limit always.
        let usual = sorted.get(sorted.len() * 9 / 10).copied().unwrap_or(1.0);
        let most = limit.map_or(usual, |limit| usual.clamp(2.0 * limit, 5.0 * limit)).max(1e-300);
        let y = |distance: f64| SIZE[1] * (1.0 - 0.96 * (distance / most).clamp(0.0, 1.0));
        let mut distance = String::new();
        for (k, Slice { closest, after_gap }) in near.iter().enumerate() {
            let pen = if k == 0 || *after_gap { 'M' } else { 'L' };
            // Writing to a string cannot fail.
            let _ = write!(distance, "{pen}{:.1} {:.1}", x(closest.time_s), y(closest.separation_m));
        }
        let bands = moments.iter().filter(|moment| moment.kind != Kind::Closest);
        let closest = moments.iter().find(|moment| moment.kind == Kind::Closest && moment.obstacle.is_none());
        Self {
            distance,
            limit: limit.map(y),
            bands: bands.map(|of| (x(of.span.from_s), x(of.span.to_s), of.kind == Kind::Violation)).collect(),
            closest: closest.zip(sorted.first()).map(|(of, &least)| [x(of.span.at_s), y(least)]),
        }
    }
}
