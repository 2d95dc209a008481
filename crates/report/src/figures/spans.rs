//! A flight log at the resolution of a figure.

use std::borrow::Cow;

use super::axis::{Axis, extent};
use crate::flight_log::{Extremes, FlightLog, Keyframe, closer};
use tautline_core::swarm::{ClosestApproach, Rows};

/// Largest number of spans of a figure: about four for each pixel of its width.
const MOST_SPANS: usize = 2048;

/// A flight in at most [`MOST_SPANS`] spans of time. If there are more keyframes, adjacent ones are merged and keep
/// their extremes.
pub(super) struct Spans<'a> {
    pub(super) log: &'a FlightLog,
    all: Vec<Span<'a>>,
}

/// A span of time: the state at its end, and the extremes in it.
pub(super) struct Span<'a> {
    /// End \[s\].
    pub(super) time_s: f64,
    /// Positions at the end \[m\].
    pub(super) positions_m: &'a Rows,
    /// Closest approach in the span.
    pub(super) closest: Option<ClosestApproach>,
    pub(super) extremes: Cow<'a, Extremes>,
}

impl<'a> Spans<'a> {
    pub(super) fn of(log: &'a FlightLog) -> Self {
        let Some((first, rest)) = log.keyframes().split_first() else { return Self { log, all: Vec::new() } };
        let together = rest.len().div_ceil(MOST_SPANS - 1).max(1);
        let spans = rest.chunks(together).filter_map(Span::of);
        Self { log, all: Span::of(std::slice::from_ref(first)).into_iter().chain(spans).collect() }
    }

    /// Returns all spans in order of time. The first span is the first instant.
    pub(super) fn iter(&self) -> std::slice::Iter<'_, Span<'a>> {
        self.all.iter()
    }

    /// Returns the number of vehicles N.
    pub(super) fn vehicles(&self) -> usize {
        self.log.count()
    }

    /// Returns the axis of time \[s\].
    pub(super) fn time_axis(&self) -> Axis {
        let [from_s, to_s] = self.log.range_s();
        Axis::time(from_s, to_s)
    }

    /// Returns at most `most` spans (at least two), evenly spread, with the first and the last.
    pub(super) fn spread(&self, most: usize) -> Vec<&Span<'a>> {
        let most = most.max(2);
        if self.all.len() <= most {
            return self.all.iter().collect();
        }
        (0..most).map(|k| &self.all[k * (self.all.len() - 1) / (most - 1)]).collect()
    }

    /// Returns whether heights differ by at most a hundredth of the horizontal extent.
    pub(super) fn is_level(&self) -> bool {
        const FLATNESS: f64 = 0.01;
        let [x, y, z] = [0, 1, 2].map(|axis| self.extent(axis).map_or(0.0, |(low, high)| high - low));
        z <= FLATNESS * x.max(y)
    }

    /// Returns the smallest and the largest coordinate along an axis \[m\], if one is finite.
    pub(super) fn extent(&self, axis: usize) -> Option<(f64, f64)> {
        extent(self.iter().flat_map(|span| span.positions_m.column(axis).iter().copied().collect::<Vec<_>>()))
    }
}

impl<'a> Span<'a> {
    fn of(keyframes: &'a [Keyframe]) -> Option<Self> {
        let (last, before) = keyframes.split_last()?;
        let mut span = Self {
            time_s: last.time_s,
            positions_m: &last.positions_m,
            closest: last.closest,
            extremes: Cow::Borrowed(&last.extremes),
        };
        for keyframe in before.iter().rev() {
            span.closest = closer(keyframe.closest, span.closest);
            span.extremes.to_mut().absorb(&keyframe.extremes);
        }
        Some(span)
    }
}
