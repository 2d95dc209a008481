//! Smallest distance of all pairs over time, in the intervals in which at least two vehicles are present.

use super::settings::Settings;
use super::vehicle::Vehicle;
use super::window::{Windows, within};
use crate::ledger::Interruption;
use crate::ledger::Results;
use crate::outcome::Approach;
use crate::segment::Segment;
use crate::slices::{Slice, Slices};
use crate::sweep::Interval;

/// Largest number of kept slices.
const MAX_KEPT: usize = 4096;
/// Per window: largest number of sample times, of presence intervals, and of changes of presence at which slices end.
const MAX_SAMPLES: usize = 256;
const MAX_INTERVALS: usize = 64;
const MAX_CHANGES: usize = 64;
/// Number of sample times in a window up to which none is skipped.
const MIN_SAMPLES: usize = 32;

/// Closest approach of all pairs in consecutive slices of time.
#[derive(Clone, Debug)]
pub(super) struct SmallestDistances {
    windows: Windows,
    slices: Slices,
    interruption: Interruption,
}

impl SmallestDistances {
    pub(super) fn new(settings: &Settings) -> Self {
        let interruption = Interruption::default();
        Self { windows: Windows::of_closest(settings.limits()), slices: Slices::new(MAX_KEPT), interruption }
    }

    pub(super) fn set_interruption(&mut self, interruption: Interruption) {
        self.interruption = interruption;
    }

    /// Judges a window in slices between its samples and the instants at which a vehicle appears or leaves.
    pub(super) fn follow(&mut self, vehicles: &[Vehicle], window: Interval) {
        let intervals = PresenceIntervals::of_window(vehicles, window);
        let mut parts: Option<Vec<Vehicle>> = None;
        for two in ends(vehicles, window, &intervals).windows(2) {
            let over = Interval { from_s: two[0], to_s: two[1] };
            let mut found = self.closest(vehicles, over);
            // Straight segments are judged whole. An approach outside the slice belongs to another slice.
            if found.first().is_some_and(|approach| approach.time_s < over.from_s || over.to_s < approach.time_s) {
                let parts = parts.get_or_insert_with(|| vehicles.to_vec());
                for (part, vehicle) in parts.iter_mut().zip(vehicles) {
                    let of_slice = &vehicle.segments[within(&vehicle.segments, over)];
                    part.segments.clear();
                    part.segments.extend(of_slice.iter().map(|segment| segment.within(over)));
                }
                found = self.closest(parts, over);
            }
            if let Some(&closest) = found.first() {
                self.slices.take(intervals.slice(over, closest));
            }
        }
    }

    fn closest(&mut self, vehicles: &[Vehicle], over: Interval) -> Vec<Approach> {
        let mut results = Results { interruption: self.interruption.clone(), ..Results::default() };
        self.windows.judge(vehicles, over, &mut results);
        results.closest.kept
    }

    pub(super) fn finish(self) -> Vec<Slice> {
        self.slices.finish(MAX_KEPT)
    }
}

/// Returns the ends of the slices of a window \[s\].
fn ends(vehicles: &[Vehicle], window: Interval, intervals: &PresenceIntervals) -> Vec<f64> {
    let parts = || vehicles.iter().map(|vehicle| &vehicle.segments[within(&vehicle.segments, window)]);
    let mut samples: Vec<_> = parts().flatten().flat_map(|part| [part.from_s, part.to_s]).collect();
    samples.sort_unstable_by(f64::total_cmp);
    samples.dedup();
    // Vehicles with different sample times must not make slices much shorter than the interval between two samples.
    let samples_of_one_vehicle = parts().map(<[_]>::len).max().unwrap_or(0);
    let max_samples = (2 * samples_of_one_vehicle).clamp(MIN_SAMPLES, MAX_SAMPLES);
    let stretches: Vec<_> = intervals.stretches.iter().flat_map(|stretch| [stretch.from_s, stretch.to_s]).collect();
    let mut ends = vec![window.from_s, window.to_s];
    for (times_s, max) in
        [(&samples, max_samples), (&stretches, 2 * MAX_INTERVALS), (&intervals.changes_s, MAX_CHANGES)]
    {
        ends.extend(times_s.iter().step_by(times_s.len().div_ceil(max).max(1)));
    }
    ends.retain(|time_s| window.from_s <= *time_s && *time_s <= window.to_s);
    ends.sort_unstable_by(f64::total_cmp);
    ends.dedup();
    if ends.len() == 1 { vec![window.from_s, window.to_s] } else { ends }
}

/// Intervals of a window in which at least two vehicles are present, not all of them on the ground.
#[derive(Clone, Debug)]
pub(super) struct PresenceIntervals {
    /// Times at which a vehicle appears, leaves, takes off or lands within the window \[s\].
    pub(super) changes_s: Vec<f64>,
    /// Intervals in order of time; no two of them touch.
    pub(super) stretches: Vec<Interval>,
}

impl PresenceIntervals {
    pub(super) fn of_window(vehicles: &[Vehicle], window: Interval) -> Self {
        // Time, change of the number of present vehicles, and change of the number of vehicles in the air.
        let mut events: Vec<(f64, [i32; 2])> = Vec::new();
        for vehicle in vehicles {
            let parts = &vehicle.segments[within(&vehicle.segments, window)];
            let aloft = parts.iter().filter(|part| part.grounded != Some(true));
            for_each_run(parts.iter(), |run| events.extend([(run.from_s, [1, 0]), (run.to_s, [-1, 0])]));
            for_each_run(aloft, |run| events.extend([(run.from_s, [0, 1]), (run.to_s, [0, -1])]));
        }
        events.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut intervals = Self { changes_s: Vec::new(), stretches: Vec::new() };
        let (mut present, mut aloft, mut since_s) = (0, 0, window.from_s);
        for together in events.chunk_by(|a, b| a.0 == b.0) {
            let now_s = together[0].0;
            intervals.take(Interval { from_s: since_s, to_s: now_s.min(window.to_s) }, present > 1 && aloft > 0);
            if window.from_s < now_s && now_s < window.to_s {
                intervals.changes_s.push(now_s);
            }
            since_s = now_s.max(window.from_s);
            (present, aloft) = together.iter().fold((present, aloft), |(a, b), (_, more)| (a + more[0], b + more[1]));
        }
        intervals
    }

    fn take(&mut self, next: Interval, is_pair_present: bool) {
        if !is_pair_present || next.to_s <= next.from_s {
            return;
        }
        match self.stretches.last_mut() {
            Some(last) if last.to_s == next.from_s => last.to_s = next.to_s,
            _ => self.stretches.push(next),
        }
    }

    /// Returns the slice of a time within the window with its closest approach. It excludes times at which fewer than
    /// two vehicles are present.
    pub(super) fn slice(&self, over: Interval, closest: Approach) -> Slice {
        let Interval { from_s, to_s } = over;
        let stretch = self.stretches.get(self.stretches.partition_point(|stretch| stretch.to_s < to_s));
        if stretch.is_some_and(|stretch| stretch.from_s <= from_s && from_s < to_s) {
            return Slice { from_s, to_s, closest, is_whole: true };
        }
        let change = self.changes_s.get(self.changes_s.partition_point(|change_s| *change_s <= from_s));
        if change.is_some_and(|change_s| *change_s < to_s) {
            return Slice { from_s, to_s, closest, is_whole: false };
        }
        // Fewer than two vehicles are present, except at an instant at either end.
        let at_s = closest.time_s.max(from_s).min(to_s);
        Slice { from_s: at_s, to_s: at_s, closest, is_whole: true }
    }
}

/// Calls `f` with each uninterrupted interval covered by segments, which are in order of time.
pub(super) fn for_each_run<'a>(mut segments: impl Iterator<Item = &'a Segment>, mut f: impl FnMut(Interval)) {
    let Some(Segment { from_s, to_s, .. }) = segments.next() else { return };
    let mut run = Interval { from_s: *from_s, to_s: *to_s };
    for next in segments {
        if next.from_s > run.to_s {
            f(run);
            run.from_s = next.from_s;
        }
        run.to_s = next.to_s.max(run.to_s);
    }
    f(run);
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::recorded::{Interpolation, TrackAuditor};
    use tautline_core::track::{Item, Sample};

    /// Samples of a vehicle: times \[s\] and positions on a line \[m\].
    type Track = Vec<(f64, f64)>;

    fn slices(settings: Settings, tracks: &[Track]) -> Vec<Slice> {
        let sample = |vehicle: usize, &(time_s, x): &(f64, f64)| {
            let position_m = Vector3::new(x, 0.0, 0.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let mut items: Vec<_> =
            tracks.iter().enumerate().flat_map(|(k, track)| track.iter().map(move |point| sample(k, point))).collect();
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        let names: Vec<_> = (0..tracks.len()).map(|k| k.to_string()).collect();
        let mut auditor = TrackAuditor::new(settings).expect("settings").with_smallest();
        auditor.push(&names, &items).expect("valid items");
        auditor.finish().expect("judged").smallest
    }

    fn with_gaps(max_gap_s: f64) -> Settings {
        Settings { max_gap_s: Some(max_gap_s), ..Settings::delta(1.0) }
    }

    /// Returns the samples of a vehicle at rest, at a constant interval \[s\].
    fn at_rest(x: f64, [from_s, to_s]: [f64; 2], every_s: f64) -> Track {
        let times = std::iter::successors(Some(from_s), |time_s| Some(time_s + every_s));
        times.take_while(|time_s| *time_s <= to_s).map(|time_s| (time_s, x)).collect()
    }

    /// Returns the intervals in which a vehicle is present \[s\].
    fn stretches(track: &Track, max_gap_s: f64) -> Vec<[f64; 2]> {
        let runs = track.chunk_by(|a, b| b.0 - a.0 <= max_gap_s);
        runs.map(|run| [run[0].0, run[run.len() - 1].0]).collect()
    }

    /// Compares slices with the presence of vehicles at rest. No slice may cover a time with fewer than two vehicles,
    /// and no two present vehicles may be closer than the slice states.
    fn check(tracks: &[Track], max_gap_s: f64, found: &[Slice]) {
        let present: Vec<_> = tracks.iter().map(|track| stretches(track, max_gap_s)).collect();
        let mut changes: Vec<f64> = present.iter().flatten().flatten().copied().collect();
        changes.sort_by(f64::total_cmp);
        changes.dedup();
        let present_at = |time_s: f64| {
            let is_present = |k: &usize| present[*k].iter().any(|[from_s, to_s]| (*from_s..=*to_s).contains(&time_s));
            (0..tracks.len()).filter(is_present).collect::<Vec<_>>()
        };
        let nearest = |time_s: f64| {
            let mut x: Vec<_> = present_at(time_s).into_iter().map(|k| tracks[k][0].1).collect();
            x.sort_by(f64::total_cmp);
            x.windows(2).map(|two| two[1] - two[0]).fold(f64::INFINITY, f64::min)
        };
        for slice in found {
            let [from_s, to_s] = slice.known_s();
            let between = changes.windows(2).map(|two| f64::midpoint(two[0].max(from_s), two[1].min(to_s)));
            for time_s in between.filter(|time_s| from_s < *time_s && *time_s < to_s) {
                assert!(present_at(time_s).len() > 1, "fewer than two vehicles at {time_s} s: {slice:?}");
                assert!(slice.closest.lower_m <= nearest(time_s), "{time_s} s: {slice:?}");
            }
            let [first, second] = slice.closest.pair.vehicles().map_or([0; 2], |pair| [pair.first(), pair.second()]);
            let present = present_at(slice.closest.time_s);
            assert!(present.contains(&first) && present.contains(&second), "{slice:?}");
            assert_eq!(slice.closest.lower_m, tracks[second][0].1 - tracks[first][0].1, "{slice:?}");
        }
        assert!(found.windows(2).all(|two| two[0].to_s <= two[1].from_s), "{found:?}");
    }

    fn extents(found: &[Slice]) -> Vec<(f64, f64)> {
        found.iter().map(|slice| (slice.from_s, slice.to_s)).collect()
    }

    #[test]
    fn a_slice_excludes_later_approaches() {
        let times = || (0..=20).map(f64::from);
        let tracks =
            [times().map(|t| (t, 0.0)).collect(), times().map(|t| (t, if t == 20.0 { 0.25 } else { 20.0 })).collect()];
        let found = slices(Settings::delta(1.0), &tracks);
        assert_eq!(found.iter().map(|slice| slice.to_s).collect::<Vec<_>>(), times().skip(1).collect::<Vec<_>>());
        assert!(
            found[..19].iter().all(|slice| slice.closest.lower_m == 20.0 && slice.closest.time_s <= slice.to_s),
            "{found:?}"
        );
        assert_eq!((found[19].closest.lower_m, found[19].closest.time_s), (0.25, 20.0));
    }

    #[test]
    fn a_gap_has_no_slice() {
        let times = [0.0, 1.0, 2.0, 3.0, 8.0, 9.0, 10.0];
        let found =
            slices(Settings::delta(1.0), &[0.0, 2.0].map(|speed| times.map(|t| (t, speed * (t + 1.0))).to_vec()));
        let wide: Vec<_> = extents(&found).into_iter().filter(|(from_s, to_s)| from_s < to_s).collect();
        assert_eq!(wide, [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (8.0, 9.0), (9.0, 10.0)]);
        assert!(found.iter().all(|slice| !(3.1..8.0).contains(&slice.to_s)), "{found:?}");
    }

    #[test]
    fn gaps_of_two_vehicles_have_no_slice_beside_a_third_with_dense_samples() {
        let of_two =
            |x: [f64; 2]| [(0.0, x[0]), (2.0, x[0]), (4.0, x[0]), (50.0, x[1]), (52.0, x[1]), (54.0, x[1])].to_vec();
        let tracks = [of_two([0.0; 2]), of_two([5.0, 3.0]), at_rest(100.0, [0.0, 4.0], 0.125)];
        let found = slices(with_gaps(2.0), &tracks);
        assert!(found.iter().all(|slice| slice.is_whole && (slice.to_s <= 4.0 || slice.from_s >= 50.0)), "{found:?}");
        let first =
            found.iter().find(|slice| slice.closest.lower_m == 3.0).expect("the separation is 3 m after the gap");
        assert_eq!((first.from_s, first.to_s), (50.0, 50.0), "the instant at which both are present again");
        assert_eq!(found.iter().map(|slice| slice.to_s).fold(0.0, f64::max), 54.0);
    }

    #[test]
    fn vehicles_that_left_have_no_slice_until_another_appears() {
        let (a, b) = (at_rest(0.0, [0.0, 10.0], 1.0), at_rest(5.0, [0.0, 9.5], 0.5));
        let late = at_rest(50.0, [3600.0, 3610.0], 0.25);
        let found = slices(with_gaps(2.0), &[a, b, late]);
        assert_eq!((found[0].from_s, found[found.len() - 1].to_s), (0.0, 9.5));
        assert!(found.iter().all(|slice| slice.to_s - slice.from_s <= 0.5), "{found:?}");
    }

    #[test]
    fn vehicles_on_the_ground_have_no_slice() {
        let sample_at = |vehicle: usize, time_s: f64, z: f64| {
            let position_m = Vector3::new(5.0 * vehicle as f64, 0.0, z);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let heights = [(0.0, 0.0), (10.0, 0.0), (20.0, 10.0), (30.0, 10.0)];
        let mut items: Vec<_> = heights.iter().flat_map(|&(t, z)| [sample_at(0, t, z), sample_at(1, t, z)]).collect();
        // A third vehicle aside, with more samples at the beginning.
        items.extend((1..=20).map(|k| sample_at(2, 0.25 * f64::from(k), 0.0)));
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        let settings = Settings { above_m: Some(2.0), motion: Some(Interpolation::Linear), ..with_gaps(10.0) };
        let mut auditor = TrackAuditor::new(settings).expect("settings").with_smallest();
        auditor.push(&["a", "b", "c"].map(str::to_owned), &items).expect("valid items");
        let found = auditor.finish().expect("judged").smallest;
        assert!(found.iter().all(|slice| slice.from_s >= 12.0), "{found:?}");
        assert_eq!(found.iter().map(|slice| slice.to_s - slice.from_s).sum::<f64>(), 18.0);
    }

    #[test]
    fn many_presence_changes_cover_no_time_with_fewer_than_two_vehicles() {
        // Fifteen pairs in turn, each present for most of a second, one second apart.
        let track = |k: i32| {
            let within_s = if k % 2 == 0 { [0.0, 0.9] } else { [0.1, 1.0] };
            let turns = (0..20).map(|turn| f64::from(30 * turn + k / 2 * 2));
            turns.flat_map(|turn_s| within_s.map(|later_s| (turn_s + later_s, 3.0_f64.powi(k)))).collect()
        };
        let tracks: Vec<Track> = (0..30).map(track).collect();
        let found = slices(with_gaps(0.9), &tracks);
        check(&tracks, 0.9, &found);
        assert!(
            found.len() < 600 && found.iter().any(|slice| slice.is_whole) && found.iter().any(|slice| !slice.is_whole),
            "{}",
            found.len()
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn slices_match_the_presence_of_vehicles_at_random_times(
            tracks in prop::collection::vec(
                (0..40_u32, prop::collection::vec(prop_oneof![4 => 1..20_u32, 1 => 21..400_u32], 0..40)),
                2..6,
            ),
        ) {
            let tracks: Vec<Track> = (0..).zip(tracks).map(|(k, (from, steps)): (i32, _)| {
                let later = steps.into_iter().scan(from, |time_s, step| { *time_s += step; Some(*time_s) });
                let times = std::iter::once(from).chain(later);
                times.map(|eighths| (0.125 * f64::from(eighths), 3.0_f64.powi(k))).collect()
            }).collect();
            let found = slices(with_gaps(2.5), &tracks);
            check(&tracks, 2.5, &found);
            prop_assert!(found.iter().all(|slice| slice.is_whole));
            let all: Vec<_> = tracks.iter().flat_map(|track| stretches(track, 2.5)).collect();
            for (k, a) in all.iter().enumerate() {
                for b in &all[k + 1..] {
                    let (from_s, to_s) = (a[0].max(b[0]), a[1].min(b[1]));
                    let at_s = f64::midpoint(from_s, to_s);
                    let is_covered = found.iter().any(|slice| slice.from_s <= at_s && at_s <= slice.to_s);
                    prop_assert!(from_s >= to_s || is_covered, "{at_s} s");
                }
            }
        }
    }
}
