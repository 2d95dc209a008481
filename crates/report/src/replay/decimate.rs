//! Which vehicles and instants of a flight are drawn, and when each vehicle is absent.

use std::collections::BTreeSet;
use std::ops::Range;

use nalgebra::Vector3;

use super::{LONGEST_NAME, Moment, NoReplay, Stage, base64_bytes, cut};
use crate::flight_log::FlightLog;
use tautline_core::swarm::row;

/// Largest number of instants of a replay, because every graphics card supports a texture of that many rows.
pub const MOST_INSTANTS: usize = 2000;
/// Number of kept instants on either side of a finding.
const BESIDE: usize = 2;
/// Share of all instants for spans.
const SHARE: f64 = 0.75;

/// Time of a finding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Worst instant \[s\].
    pub at_s: f64,
}

/// Returns the indices of at most `most` (at least 2) of the instants `times_s` in ascending order.
///
/// Instants are kept in this order, with spans up to three quarters of `most`:
///
/// - the first and the last instant,
/// - the worst instant of each span, or the two around it,
/// - two on either side of these,
/// - all instants in a span and two on either side, span by span,
/// - every k-th of all instants.
#[must_use]
pub fn chosen(times_s: &[f64], spans: &[Span], most: usize) -> Vec<usize> {
    let (count, most) = (times_s.len(), most.max(2));
    if count <= most {
        return (0..count).collect();
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
    let mut kept = around(times_s, spans, (SHARE * most as f64) as usize);
    // Smallest stride whose instants fit.
    let free = most - kept.len();
    let stride = count.div_ceil(free.max(1)).max(1);
    kept.extend((0..count).step_by(stride));
    kept.into_iter().collect()
}

/// Returns the indices of the first and the last instant and of those in spans, at most `room`.
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

/// Returns the worst instant of a span, or the two around it.
pub(super) fn around_worst(times_s: &[f64], span: &Span) -> Range<usize> {
    let first = times_s.partition_point(|&time_s| time_s < span.at_s);
    let end = times_s.partition_point(|&time_s| time_s <= span.at_s);
    if first < end { first..end } else { first.saturating_sub(1)..(end + 1).min(times_s.len()) }
}

/// Largest number of vehicles of a replay, because every graphics card supports a texture of that many columns, and
/// some for slots.
pub const MOST_VEHICLES: usize = 2000;
/// Number of instants below which vehicles are omitted.
const FEWEST_INSTANTS: usize = 50;
/// Largest coordinate \[m\]. Single precision is too coarse beyond it.
const FARTHEST_M: f64 = 1e9;

/// Returns the vehicles that are ever present.
pub(super) fn present(stage: &Stage, log: &FlightLog) -> Result<Vec<usize>, NoReplay> {
    let mut seen = BTreeSet::new();
    for keyframe in log.keyframes() {
        for vehicle in 0..keyframe.positions_m.nrows() {
            let (at, time_s) = (row(&keyframe.positions_m, vehicle), keyframe.time_s);
            if at.iter().any(|x| x.is_finite() && x.abs() > FARTHEST_M) {
                let name = cut(&stage.vehicles[vehicle], LONGEST_NAME);
                return Err(NoReplay::TooFar { name, time_s, farthest_m: FARTHEST_M });
            }
            if at.iter().all(|x| x.is_finite()) {
                seen.insert(vehicle);
            }
        }
    }
    if seen.is_empty() { Err(NoReplay::Empty) } else { Ok(seen.into_iter().collect()) }
}

/// Returns the drawn vehicles in order: those of the findings, the gravest first, and evenly chosen others, up to the
/// number that fits beside an instant of each finding.
pub(super) fn shown(times_s: &[f64], present: &[usize], moments: &[Moment], room_bytes: usize) -> Vec<usize> {
    // Findings take three quarters of the instants.
    let worst: BTreeSet<_> = moments.iter().flat_map(|moment| around_worst(times_s, &moment.span)).collect();
    let instants = times_s.len().min((worst.len() * 3 / 2).max(FEWEST_INSTANTS));
    // A share of the room is for everything else.
    let affordable = room_bytes / 4 * 3 / base64_bytes(12 + 6 * instants);
    let (all, most) = (present.len(), present.len().min(MOST_VEHICLES).min(affordable.max(2)));
    let mut shown = BTreeSet::new();
    let of_moments = moments.iter().flat_map(|moment| moment.vehicles.iter().copied());
    let there = of_moments.filter(|vehicle| present.binary_search(vehicle).is_ok());
    let evenly = (0..most).map(|k| present[k * all / most.max(1)]);
    for vehicle in there.chain(evenly).chain(present.iter().copied()) {
        if shown.len() >= most {
            break;
        }
        shown.insert(vehicle);
    }
    shown.into_iter().collect()
}

/// Returns the instants and vehicles, as indices in order, of vehicles that are present at an instant and at the
/// previous one, but were absent in between.
pub(super) fn breaks(log: &FlightLog, times_s: &[f64], place: impl Fn(usize) -> Option<usize>) -> Vec<[usize; 2]> {
    let found: BTreeSet<_> = log
        .gaps
        .iter()
        .filter_map(|&(vehicle, [from_s, to_s])| {
            let after = times_s.partition_point(|&time_s| time_s < to_s);
            let is_between = after < times_s.len() && after > 0 && times_s[after - 1] <= from_s;
            Some([after, place(vehicle).filter(|_| is_between)?])
        })
        .collect();
    found.into_iter().collect()
}

/// Returns the position of a vehicle of the gravest finding at its time \[m\], where the drawing is most precise.
pub(super) fn place_of_weightiest(log: &FlightLog, moments: &[Moment]) -> Option<Vector3<f64>> {
    let weightiest = moments.iter().find(|moment| !moment.vehicles.is_empty())?;
    let keyframes = log.keyframes();
    let at = keyframes.partition_point(|keyframe| keyframe.time_s < weightiest.span.at_s);
    let positions_m = &keyframes.get(at.min(keyframes.len().checked_sub(1)?))?.positions_m;
    let places = weightiest.vehicles.iter().map(|&vehicle| row(positions_m, vehicle));
    places.into_iter().find(|at| at.iter().all(|x| x.is_finite()))
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
            // At least a quarter of the kept instants are evenly spaced.
            let widest = kept.windows(2).map(|two| two[1] - two[0]).max().unwrap_or(1);
            prop_assert!(widest <= 1 + count.div_ceil((most / 4).max(1)));
        }
    }

    #[test]
    fn worst_instants_come_before_neighbours() {
        let times: Vec<f64> = (0..10_000).map(f64::from).collect();
        let at = |k: u32| f64::from(60 * k) + f64::from(k % 2) * 0.5;
        let spans: Vec<_> = (0..150).map(|k| span(at(k) - 20.0, at(k) + 20.0)).collect();
        let kept = chosen(&times, &spans, 320);
        let missing = spans.iter().filter(|span| around_worst(&times, span).any(|k| !kept.contains(&k))).count();
        assert_eq!(missing, 0, "one or two for each of 150 fit into three quarters of 320");
    }

    #[test]
    fn keeps_all_instants_of_a_span_and_two_beside_it() {
        let times: Vec<f64> = (0..100_000).map(f64::from).collect();
        let kept = chosen(&times, &[span(5000.5, 5100.5), span(70_000.0, 70_000.0)], 500);
        assert!((4999..=5102).chain(69_998..=70_002).all(|k| kept.contains(&k)), "{kept:?}");
        assert!(kept.len() > 250, "the rest of the room is used: {}", kept.len());
        // A span that does not fit keeps its worst instant.
        let kept = chosen(&times, &[span(5000.0, 9000.0)], 500);
        assert!((6998..=7002).all(|k| kept.contains(&k)) && kept.len() <= 500);
    }
}
