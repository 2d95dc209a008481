//! The smallest distance of all pairs over time, in the intervals in which at least two vehicles are present.

use super::settings::Settings;
use super::vehicle::Vehicle;
use super::window::{Windows, within};
use crate::ledger::Interruption;
use crate::ledger::Results;
use crate::outcome::Approach;
use crate::segment::Segment;
use crate::slices::{Slice, Slices};
use crate::sweep::Interval;

/// Slices that are kept, at most.
const MOST_KEPT: usize = 4096;
/// Most samples of a window between which there are slices, most times of it at which two are there, and most comings and goings.
const MOST_SAMPLES: usize = 256;
const MOST_STRETCHES: usize = 64;
const MOST_CHANGES: usize = 64;
/// Number of samples of a window up to which none is skipped.
const FEWEST_SAMPLES: usize = 32;

/// Follows the closest approach of all pairs, slice of time by slice of time.
#[derive(Clone, Debug)]
pub(super) struct Smallest {
    windows: Windows,
    slices: Slices,
    interruption: Interruption,
}

impl Smallest {
    pub(super) fn new(settings: &Settings) -> Self {
        let interruption = Interruption::default();
        Self { windows: Windows::of_closest(settings.limits()), slices: Slices::new(MOST_KEPT), interruption }
    }

    pub(super) fn set_interruption(&mut self, interruption: Interruption) {
        self.interruption = interruption;
    }

    /// Judges a window in slices between its samples and the instants at which a vehicle appears or leaves.
    pub(super) fn follow(&mut self, vehicles: &[Vehicle], window: Interval) {
        let intervals = PresenceIntervals::over(vehicles, window);
        let mut parts: Option<Vec<Vehicle>> = None;
        for two in ends(vehicles, window, &intervals).windows(2) {
            let over = Interval { from_s: two[0], to_s: two[1] };
            let mut drawn = self.closest(vehicles, over);
            // Straight segments are judged whole: what they come to outside of the slice is of another.
            if drawn.first().is_some_and(|of| of.time_s < over.from_s || over.to_s < of.time_s) {
                let parts = parts.get_or_insert_with(|| vehicles.to_vec());
                for (part, vehicle) in parts.iter_mut().zip(vehicles) {
                    let of_slice = &vehicle.segments[within(&vehicle.segments, over)];
                    part.segments.clear();
                    part.segments.extend(of_slice.iter().map(|segment| segment.within(over)));
                }
                drawn = self.closest(parts, over);
            }
            if let Some(&closest) = drawn.first() {
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
        self.slices.finish(MOST_KEPT)
    }
}

/// Where slices of a window begin and end \[s\].
fn ends(vehicles: &[Vehicle], window: Interval, intervals: &PresenceIntervals) -> Vec<f64> {
    let parts = || vehicles.iter().map(|vehicle| &vehicle.segments[within(&vehicle.segments, window)]);
    let mut samples: Vec<_> = parts().flatten().flat_map(|part| [part.from_s, part.to_s]).collect();
    samples.sort_unstable_by(f64::total_cmp);
    samples.dedup();
    // Vehicles that are seen at instants of their own do not make slices much shorter than what lies between two of them.
    let of_one = parts().map(<[_]>::len).max().unwrap_or(0);
    let most_samples = (2 * of_one).clamp(FEWEST_SAMPLES, MOST_SAMPLES);
    let stretches: Vec<_> = intervals.stretches.iter().flat_map(|stretch| [stretch.from_s, stretch.to_s]).collect();
    let mut ends = vec![window.from_s, window.to_s];
    for (times_s, most) in
        [(&samples, most_samples), (&stretches, 2 * MOST_STRETCHES), (&intervals.changes_s, MOST_CHANGES)]
    {
        ends.extend(times_s.iter().step_by(times_s.len().div_ceil(most).max(1)));
    }
    ends.retain(|time_s| window.from_s <= *time_s && *time_s <= window.to_s);
    ends.sort_unstable_by(f64::total_cmp);
    ends.dedup();
    if ends.len() == 1 { vec![window.from_s, window.to_s] } else { ends }
}

/// Intervals of a window in which at least two vehicles are present, not all of them on the ground.
#[derive(Clone, Debug)]
pub(super) struct PresenceIntervals {
    /// When a vehicle appears, leaves, takes off or lands within the window \[s\].
    pub(super) changes_s: Vec<f64>,
    /// The intervals in order of time; no two of them touch.
    pub(super) stretches: Vec<Interval>,
}

impl PresenceIntervals {
    pub(super) fn over(vehicles: &[Vehicle], window: Interval) -> Self {
        // When how many more are there, and how many more are not on the ground.
        let mut events: Vec<(f64, [i32; 2])> = Vec::new();
        for vehicle in vehicles {
            let parts = &vehicle.segments[within(&vehicle.segments, window)];
            let aloft = parts.iter().filter(|part| part.grounded != Some(true));
            for_each_run(parts.iter(), |run| events.extend([(run.from_s, [1, 0]), (run.to_s, [-1, 0])]));
            for_each_run(aloft, |run| events.extend([(run.from_s, [0, 1]), (run.to_s, [0, -1])]));
        }
        events.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut intervals = Self { changes_s: Vec::new(), stretches: Vec::new() };
        let (mut there, mut aloft, mut since_s) = (0, 0, window.from_s);
        for together in events.chunk_by(|a, b| a.0 == b.0) {
            let now_s = together[0].0;
            intervals.take(Interval { from_s: since_s, to_s: now_s.min(window.to_s) }, there > 1 && aloft > 0);
            if window.from_s < now_s && now_s < window.to_s {
                intervals.changes_s.push(now_s);
            }
            since_s = now_s.max(window.from_s);
            (there, aloft) = together.iter().fold((there, aloft), |(a, b), (_, more)| (a + more[0], b + more[1]));
        }
        intervals
    }

    fn take(&mut self, next: Interval, are_two: bool) {
        if !are_two || next.to_s <= next.from_s {
            return;
        }
        match self.stretches.last_mut() {
            Some(last) if last.to_s == next.from_s => last.to_s = next.to_s,
            _ => self.stretches.push(next),
        }
    }

    /// What the closest approach of a time within the window says of that time: nothing of any part of it at which no two are there.
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
        // All the time there are fewer, and two for no longer than an instant at either end.
        let at_s = closest.time_s.max(from_s).min(to_s);
        Slice { from_s: at_s, to_s: at_s, closest, is_whole: true }
    }
}

/// Calls `f` with each time without a break that segments in order of time take.
fn for_each_run<'a>(mut segments: impl Iterator<Item = &'a Segment>, mut f: impl FnMut(Interval)) {
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

    /// When a vehicle is seen \[s\], and where on a line \[m\].
    type Track = Vec<(f64, f64)>;

    fn slices(settings: Settings, tracks: &[Track]) -> Vec<Slice> {
        let sample = |vehicle: usize, &(time_s, x): &(f64, f64)| {
            let position_m = Vector3::new(x, 0.0, 0.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let mut items: Vec<_> =
            tracks.iter().enumerate().flat_map(|(k, track)| track.iter().map(move |at| sample(k, at))).collect();
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        let names: Vec<_> = (0..tracks.len()).map(|k| k.to_string()).collect();
        let mut auditor = TrackAuditor::new(settings).expect("settings").with_smallest();
        auditor.push(&names, &items).expect("right");
        auditor.finish().expect("judged").smallest
    }

    fn with_gaps(max_gap_s: f64) -> Settings {
        Settings { max_gap_s: Some(max_gap_s), ..Settings::delta(1.0) }
    }

    /// Seen at rest every so often \[s\] from one time to another.
    fn at_rest(x: f64, [from_s, to_s]: [f64; 2], every_s: f64) -> Track {
        let times = std::iter::successors(Some(from_s), |time_s| Some(time_s + every_s));
        times.take_while(|time_s| *time_s <= to_s).map(|time_s| (time_s, x)).collect()
    }

    /// From when to when \[s\] a vehicle is there.
    fn stretches(track: &Track, max_gap_s: f64) -> Vec<[f64; 2]> {
        let runs = track.chunk_by(|a, b| b.0 - a.0 <= max_gap_s);
        runs.map(|run| [run[0].0, run[run.len() - 1].0]).collect()
    }

    /// Holds slices against when each vehicle, that rests, is there: nothing may be said of a time of fewer than two, and no two
    /// that are there together are nearer than is said.
    fn check(tracks: &[Track], max_gap_s: f64, found: &[Slice]) {
        let there: Vec<_> = tracks.iter().map(|track| stretches(track, max_gap_s)).collect();
        let mut changes: Vec<f64> = there.iter().flatten().flatten().copied().collect();
        changes.sort_by(f64::total_cmp);
        changes.dedup();
        let those_there = |time_s: f64| {
            let is_there = |k: &usize| there[*k].iter().any(|[from_s, to_s]| (*from_s..=*to_s).contains(&time_s));
            (0..tracks.len()).filter(is_there).collect::<Vec<_>>()
        };
        let nearest = |time_s: f64| {
            let mut x: Vec<_> = those_there(time_s).into_iter().map(|k| tracks[k][0].1).collect();
            x.sort_by(f64::total_cmp);
            x.windows(2).map(|two| two[1] - two[0]).fold(f64::INFINITY, f64::min)
        };
        for of in found {
            let [from_s, to_s] = of.known_s();
            let between = changes.windows(2).map(|two| f64::midpoint(two[0].max(from_s), two[1].min(to_s)));
            for time_s in between.filter(|time_s| from_s < *time_s && *time_s < to_s) {
                assert!(those_there(time_s).len() > 1, "nobody knows of {time_s} s: {of:?}");
                assert!(of.closest.lower_m <= nearest(time_s), "{time_s} s: {of:?}");
            }
            let [first, second] = of.closest.pair.vehicles().map_or([0; 2], |pair| [pair.first(), pair.second()]);
            let there = those_there(of.closest.time_s);
            assert!(there.contains(&first) && there.contains(&second), "{of:?}");
            assert_eq!(of.closest.lower_m, tracks[second][0].1 - tracks[first][0].1, "{of:?}");
        }
        assert!(found.windows(2).all(|two| two[0].to_s <= two[1].from_s), "{found:?}");
    }

    fn extents(found: &[Slice]) -> Vec<(f64, f64)> {
        found.iter().map(|of| (of.from_s, of.to_s)).collect()
    }

    #[test]
    fn a_slice_knows_nothing_of_what_comes_after_it() {
        let times = || (0..=20).map(f64::from);
        let tracks =
            [times().map(|t| (t, 0.0)).collect(), times().map(|t| (t, if t == 20.0 { 0.25 } else { 20.0 })).collect()];
        let found = slices(Settings::delta(1.0), &tracks);
        assert_eq!(found.iter().map(|of| of.to_s).collect::<Vec<_>>(), times().skip(1).collect::<Vec<_>>());
        assert!(found[..19].iter().all(|of| of.closest.lower_m == 20.0 && of.closest.time_s <= of.to_s), "{found:?}");
        assert_eq!((found[19].closest.lower_m, found[19].closest.time_s), (0.25, 20.0));
    }

    #[test]
    fn of_a_gap_there_is_no_slice() {
        let times = [0.0, 1.0, 2.0, 3.0, 8.0, 9.0, 10.0];
        let found =
            slices(Settings::delta(1.0), &[0.0, 2.0].map(|speed| times.map(|t| (t, speed * (t + 1.0))).to_vec()));
        let wide: Vec<_> = extents(&found).into_iter().filter(|(from_s, to_s)| from_s < to_s).collect();
        assert_eq!(wide, [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (8.0, 9.0), (9.0, 10.0)]);
        assert!(found.iter().all(|of| !(3.1..8.0).contains(&of.to_s)), "{found:?}");
    }

    #[test]
    fn nothing_is_said_of_the_gaps_of_two_while_a_third_is_dense_before_them() {
        let of_two =
            |x: [f64; 2]| [(0.0, x[0]), (2.0, x[0]), (4.0, x[0]), (50.0, x[1]), (52.0, x[1]), (54.0, x[1])].to_vec();
        let tracks = [of_two([0.0; 2]), of_two([5.0, 3.0]), at_rest(100.0, [0.0, 4.0], 0.125)];
        let found = slices(with_gaps(2.0), &tracks);
        assert!(found.iter().all(|of| of.is_whole && (of.to_s <= 4.0 || of.from_s >= 50.0)), "{found:?}");
        let first = found.iter().find(|of| of.closest.lower_m == 3.0).expect("they come to 3 m");
        assert_eq!((first.from_s, first.to_s), (50.0, 50.0), "which is so as soon as both are seen again");
        assert_eq!(found.iter().map(|of| of.to_s).fold(0.0, f64::max), 54.0);
    }

    #[test]
    fn those_who_left_are_not_near_until_another_comes() {
        let (a, b) = (at_rest(0.0, [0.0, 10.0], 1.0), at_rest(5.0, [0.0, 9.5], 0.5));
        let late = at_rest(50.0, [3600.0, 3610.0], 0.25);
        let found = slices(with_gaps(2.0), &[a, b, late]);
        assert_eq!((found[0].from_s, found[found.len() - 1].to_s), (0.0, 9.5));
        assert!(found.iter().all(|of| of.to_s - of.from_s <= 0.5), "{found:?}");
    }

    #[test]
    fn of_two_on_the_ground_nothing_is_said() {
        let at = |vehicle: usize, time_s: f64, z: f64| {
            let position_m = Vector3::new(5.0 * vehicle as f64, 0.0, z);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let heights = [(0.0, 0.0), (10.0, 0.0), (20.0, 10.0), (30.0, 10.0)];
        let mut items: Vec<_> = heights.iter().flat_map(|&(t, z)| [at(0, t, z), at(1, t, z)]).collect();
        // One that stands aside, seen more often at the beginning.
        items.extend((1..=20).map(|k| at(2, 0.25 * f64::from(k), 0.0)));
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        let settings = Settings { above_m: Some(2.0), motion: Some(Interpolation::Linear), ..with_gaps(10.0) };
        let mut auditor = TrackAuditor::new(settings).expect("settings").with_smallest();
        auditor.push(&["a", "b", "c"].map(str::to_owned), &items).expect("right");
        let found = auditor.finish().expect("judged").smallest;
        assert!(found.iter().all(|of| of.from_s >= 12.0), "{found:?}");
        assert_eq!(found.iter().map(|of| of.to_s - of.from_s).sum::<f64>(), 18.0);
    }

    #[test]
    fn of_more_comings_and_goings_than_there_are_slices_no_time_of_fewer_than_two_is_known() {
        // Fifteen pairs in turn, each there for most of a second, a second apart.
        let track = |k: i32| {
            let within_s = if k % 2 == 0 { [0.0, 0.9] } else { [0.1, 1.0] };
            let turns = (0..20).map(|turn| f64::from(30 * turn + k / 2 * 2));
            turns.flat_map(|turn_s| within_s.map(|later_s| (turn_s + later_s, 3.0_f64.powi(k)))).collect()
        };
        let tracks: Vec<Track> = (0..30).map(track).collect();
        let found = slices(with_gaps(0.9), &tracks);
        check(&tracks, 0.9, &found);
        assert!(
            found.len() < 600 && found.iter().any(|of| of.is_whole) && found.iter().any(|of| !of.is_whole),
            "{}",
            found.len()
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn whoever_comes_and_goes_whenever_all_that_is_said_is_so_and_all_that_is_known_is_said(
            tracks in prop::collection::vec(
                (0..40_u32, prop::collection::vec(prop_oneof![4 => 1..20_u32, 1 => 21..400_u32], 0..40)),
                2..6,
            ),
        ) {
            let tracks: Vec<Track> = (0..).zip(tracks).map(|(k, (from, steps)): (i32, _)| {
                let times = std::iter::once(from).chain(steps.into_iter().scan(from, |at, step| { *at += step; Some(*at) }));
                times.map(|eighths| (0.125 * f64::from(eighths), 3.0_f64.powi(k))).collect()
            }).collect();
            let found = slices(with_gaps(2.5), &tracks);
            check(&tracks, 2.5, &found);
            prop_assert!(found.iter().all(|of| of.is_whole));
            let all: Vec<_> = tracks.iter().flat_map(|track| stretches(track, 2.5)).collect();
            for (k, a) in all.iter().enumerate() {
                for b in &all[k + 1..] {
                    let (from_s, to_s) = (a[0].max(b[0]), a[1].min(b[1]));
                    let at_s = f64::midpoint(from_s, to_s);
                    prop_assert!(from_s >= to_s || found.iter().any(|of| of.from_s <= at_s && at_s <= of.to_s), "{at_s} s");
                }
            }
        }
    }
}
