//! When two are there, of whom something can be asked.

use super::vehicle::Vehicle;
use super::window::within;
use crate::outcome::Approach;
use crate::segment::Segment;
use crate::slices::Slice;
use crate::sweep::Interval;

/// Times of a window at which two vehicles are there, not both of them on the ground.
#[derive(Clone, Debug)]
pub(super) struct Company {
    /// When somebody comes, goes, takes off or lands, within the window \[s\].
    pub(super) changes_s: Vec<f64>,
    /// When two are there, in order of time; no two touch.
    pub(super) stretches: Vec<Interval>,
}

impl Company {
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
        let mut company = Self { changes_s: Vec::new(), stretches: Vec::new() };
        let (mut there, mut aloft, mut since_s) = (0, 0, window.from_s);
        for together in events.chunk_by(|a, b| a.0 == b.0) {
            let now_s = together[0].0;
            company.take(Interval { from_s: since_s, to_s: now_s.min(window.to_s) }, there > 1 && aloft > 0);
            if window.from_s < now_s && now_s < window.to_s {
                company.changes_s.push(now_s);
            }
            since_s = now_s.max(window.from_s);
            (there, aloft) = together.iter().fold((there, aloft), |(a, b), (_, more)| (a + more[0], b + more[1]));
        }
        company
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
