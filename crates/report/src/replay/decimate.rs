//! Which instants of a flight are kept.

use std::collections::BTreeSet;
use std::ops::Range;

/// Most instants of a replay: a texture of every graphics card has so many rows.
pub const MOST_INSTANTS: usize = 2000;
/// Instants that are kept on either side of what happened.
const BESIDE: usize = 2;
/// Part of all instants that spans may take.
const SHARE: f64 = 0.75;

/// A time in which something happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
    /// When it was at its worst \[s\].
    pub at_s: f64,
}

/// Indices of at most `most` (at least 2) instants, given in order of time \[s\], in ascending order.
///
/// Kept are the first and the last; those at or on either side of the worst time of each span; two on either side of it; all
/// within spans and two on either side, one span after the other as long as they take no more than three quarters; and every
/// k-th of all.
#[must_use]
pub fn chosen(times_s: &[f64], spans: &[Span], most: usize) -> Vec<usize> {
    let (count, most) = (times_s.len(), most.max(2));
    if count <= most {
        return (0..count).collect();
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
    let mut kept = around(times_s, spans, (SHARE * most as f64) as usize);
    // The smallest stride that leaves no more than there is room for.
    let free = most - kept.len();
    let stride = count.div_ceil(free.max(1)).max(1);
    kept.extend((0..count).step_by(stride));
    kept.into_iter().collect()
}

/// Indices of the first and the last instant and of those in which something happened, as long as they are no more than `room`.
pub(super) fn around(times_s: &[f64], spans: &[Span], room: usize) -> BTreeSet<usize> {
    let count = times_s.len();
    let mut kept: BTreeSet<_> = count.checked_sub(1).into_iter().flat_map(|last| [0, last]).collect();
    let within = |from_s: f64, to_s: f64, beside: usize| {
        let first = times_s.partition_point(|&time_s| time_s < from_s);
        let end = times_s.partition_point(|&time_s| time_s <= to_s);
        first.saturating_sub(beside)..(end + beside).min(count)
    };
    let at = spans.iter().map(|span| around_worst(times_s, span));
    let beside = spans.iter().map(|span| within(span.at_s, span.at_s, BESIDE));
    let whole = spans.iter().map(|span| within(span.from_s, span.to_s, BESIDE));
    for instants in at.chain(beside).chain(whole) {
        let more = instants.clone().filter(|k| !kept.contains(k)).count();
        if kept.len() + more <= room {
            kept.extend(instants);
        }
    }
    kept
}

/// The instant at which a span is at its worst, or those on either side of it.
pub(super) fn around_worst(times_s: &[f64], span: &Span) -> Range<usize> {
    let first = times_s.partition_point(|&time_s| time_s < span.at_s);
    let end = times_s.partition_point(|&time_s| time_s <= span.at_s);
    if first < end { first..end } else { first.saturating_sub(1)..(end + 1).min(times_s.len()) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn span(from_s: f64, to_s: f64) -> Span {
        Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) }
    }

    proptest! {
        #[test]
        fn no_more_than_asked_are_kept_in_order_with_the_first_and_the_last(
            count in 0..5000_usize,
            most in 2..800_usize,
            spans in prop::collection::vec((0.0..5000.0_f64, 0.0..200.0_f64), 0..40),
        ) {
            let times: Vec<f64> = (0..count).map(|k| k as f64).collect();
            let spans: Vec<_> = spans.into_iter().map(|(from_s, length_s)| span(from_s, from_s + length_s)).collect();
            let kept = chosen(&times, &spans, most);
            prop_assert!(kept.len() <= most && kept.len() <= count && kept.is_sorted_by(|a, b| a < b));
            prop_assert!(count == 0 || (kept.first() == Some(&0) && kept.last() == Some(&(count - 1))));
            // Evenly, too: a quarter of the room is for that.
            let widest = kept.windows(2).map(|two| two[1] - two[0]).max().unwrap_or(1);
            prop_assert!(widest <= 1 + count.div_ceil((most / 4).max(1)));
        }
    }

    #[test]
    fn the_worst_time_of_each_comes_before_the_neighbours_of_any() {
        let times: Vec<f64> = (0..10_000).map(f64::from).collect();
        let at = |k: u32| f64::from(60 * k) + f64::from(k % 2) * 0.5;
        let spans: Vec<_> = (0..150).map(|k| span(at(k) - 20.0, at(k) + 20.0)).collect();
        let kept = chosen(&times, &spans, 320);
        let missing = spans.iter().filter(|span| around_worst(&times, span).any(|k| !kept.contains(&k))).count();
        assert_eq!(missing, 0, "one or two for each of 150 fit into three quarters of 320");
    }

    #[test]
    fn every_instant_of_a_span_is_kept_and_two_beside_it() {
        let times: Vec<f64> = (0..100_000).map(f64::from).collect();
        let kept = chosen(&times, &[span(5000.5, 5100.5), span(70_000.0, 70_000.0)], 500);
        assert!((4999..=5102).chain(69_998..=70_002).all(|k| kept.contains(&k)), "{kept:?}");
        assert!(kept.len() > 250, "the rest of the room is used: {}", kept.len());
        // One that does not fit is kept where it is worst.
        let kept = chosen(&times, &[span(5000.0, 9000.0)], 500);
        assert!((6998..=7002).all(|k| kept.contains(&k)) && kept.len() <= 500);
    }
}
