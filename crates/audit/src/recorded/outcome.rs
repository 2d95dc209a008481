//! Verdict on a recording, and the presence of vehicles: usual intervals between samples, gaps and absences.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::settings::Settings;
use super::smallest::for_each_run;
use super::vehicle::Vehicle;
use super::well_clear::WellClearOutcome;
use super::window::within;
use crate::envelope::EnvelopeOutcome;
use crate::findings::{Finding, LISTED, Shortlist, Tally};
use crate::obstacle::MovingObstacle;
use crate::outcome::{Approach, ObjectPair, ParryEvidence, Status, Undecided, Violation};
use crate::slices::Slice;
use crate::sweep::Interval;
use tautline_core::track::Item;

/// Time during which a vehicle has no sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// Index of the vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// Last sample before the gap \[s\].
    pub from_s: f64,
    /// First sample after the gap \[s\].
    pub to_s: f64,
    /// Smallest [`max_gap_s`](super::Settings::max_gap_s) that would close the gap \[s\]; longer than the gap if the
    /// window cuts it.
    pub joined_by_s: f64,
}

impl Gap {
    pub(super) fn new(vehicle: usize, from_s: f64, to_s: f64) -> Self {
        Self { vehicle, from_s, to_s, joined_by_s: to_s - from_s }
    }

    /// Returns the part of the gap in a window, if any.
    pub(super) fn within(self, window: Interval) -> Option<Self> {
        let (from_s, to_s) = (self.from_s.max(window.from_s), self.to_s.min(window.to_s));
        (from_s < to_s).then_some(Self { from_s, to_s, ..self })
    }
}

/// Interval from the first to the last sample of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Presence {
    /// First sample \[s\].
    pub from_s: f64,
    /// Last sample \[s\].
    pub to_s: f64,
}

/// Vehicle that is not present over the whole window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Absence {
    /// Index of the vehicle.
    pub vehicle: usize,
    /// Interval in which it is present; `None` if it has no sample in the window.
    pub seen: Option<Presence>,
}

/// Numbers of findings of each kind, and of listed ones. A list holds the worst [`LISTED`](crate::LISTED) findings, and
/// the first finding of each of at most that number of pairs or vehicles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tallies {
    /// Violations.
    pub violations: Tally,
    /// Undecided times.
    pub undecided: Tally,
    /// Gaps; the worst are the longest.
    pub gaps: Tally,
}

impl Tallies {
    /// Returns whether some list is shorter than the number of findings.
    #[must_use]
    pub fn are_shortened(&self) -> bool {
        [self.violations, self.undecided, self.gaps].iter().any(Tally::is_shortened)
    }
}

/// Returns the vehicles that are never present together with another vehicle. No pair of such a vehicle is judged.
pub(super) fn vehicles_without_others(presence: &[Option<Presence>]) -> Vec<usize> {
    let present = presence.iter().enumerate().filter_map(|(vehicle, present)| Some((present.as_ref()?, vehicle)));
    let mut present: Vec<_> = present.collect();
    present.sort_by(|(a, _), (b, _)| a.from_s.total_cmp(&b.from_s));
    let mut last_s = f64::NEG_INFINITY;
    let mut alone = Vec::new();
    for (place, &(index, vehicle)) in present.iter().enumerate() {
        let next_s = present.get(place + 1).map_or(f64::INFINITY, |(next, _)| next.from_s);
        if last_s < index.from_s && index.to_s < next_s {
            alone.push(vehicle);
        }
        last_s = last_s.max(index.to_s);
    }
    alone.sort_unstable();
    alone
}

/// Time in which vehicles are on the ground, at or below [`above_m`](super::Settings::above_m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExemptTime {
    /// Time in which at least two vehicles are on the ground, so that a pair is exempt \[s\].
    pub pairs_s: f64,
    /// Time in which at least one vehicle is on the ground, so that obstacles on which it lands are exempt \[s\].
    pub vehicles_s: f64,
}

impl ExemptTime {
    /// Adds a window of time.
    pub(super) fn add(&mut self, vehicles: &[Vehicle], window: Interval) {
        let mut changes: Vec<(f64, i32)> = Vec::new();
        for vehicle in vehicles {
            let parts = vehicle.segments[within(&vehicle.segments, window)].iter();
            for_each_run(parts.filter(|part| part.grounded == Some(true)), |run| {
                let (from_s, to_s) = (run.from_s.max(window.from_s), run.to_s.min(window.to_s));
                changes.extend([(from_s, 1), (to_s, -1)]);
            });
        }
        changes.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let (mut grounded, mut since_s) = (0, window.from_s);
        for (time_s, change) in changes {
            let passed_s = time_s - since_s;
            self.pairs_s += if grounded > 1 { passed_s } else { 0.0 };
            self.vehicles_s += if grounded > 0 { passed_s } else { 0.0 };
            (grounded, since_s) = (grounded + change, time_s);
        }
    }
}

/// Contradiction between a recording and the assumed bound on acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Contradiction {
    /// Index of the vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// Time \[s\].
    pub time_s: f64,
    /// Smallest acceleration that the samples need there \[m/s^2\].
    pub needs_m_s2: f64,
    /// Assumed bound on the acceleration \[m/s^2\].
    pub assumed_m_s2: f64,
}

/// Verdict on a recording, with its evidence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// Verdict. Clear if everything was judged and every limit was kept. Violation if a separation or a vehicle was
    /// beyond its limit, whatever else was found. Undecided if something could not be decided, or if there never were
    /// two objects to keep apart.
    pub status: Status,
    /// Verdict on separations alone; `None` if only single vehicles were judged.
    pub separation: Option<Status>,
    /// Findings for the limits on single vehicles.
    pub envelope: EnvelopeOutcome,
    /// Findings for well clear, if the settings have its thresholds.
    pub well_clear: Option<WellClearOutcome>,
    /// Names of all vehicles of the recording, including those that are not selected.
    pub vehicles: Vec<String>,
    /// Presence of each vehicle within the window; `None` if it is absent or not selected.
    pub presence: Vec<Option<Presence>>,
    /// Selected vehicles that are not present over the whole window, by index.
    pub absences: Vec<Absence>,
    /// Largest interval between two samples that is not a gap \[s\], for each vehicle: `max_gap_s` of the settings, or
    /// 1.5 times the usual sampling interval.
    pub max_gaps_s: Vec<f64>,
    /// First and last judged instant \[s\]; `None` if nothing was judged.
    pub span_s: Option<(f64, f64)>,
    /// Ten closest pairs, each at its closest approach, the closest first.
    pub closest: Vec<Approach>,
    /// Ten closest approaches to obstacles, likewise.
    pub obstacles: Vec<Approach>,
    /// Closest approach of all pairs of vehicles in consecutive slices of time. A slice is about one sample long;
    /// slices of a long recording are longer. Nothing is known while fewer than two vehicles are present, or while both
    /// are on the ground. Empty unless requested by [`with_smallest`](super::TrackAuditor::with_smallest).
    pub smallest: Vec<Slice>,
    /// Listed violations in order of time; [`Tallies`] counts all.
    pub violations: Vec<Violation<ObjectPair>>,
    /// Listed undecided times in order of time; [`Tallies`] counts all.
    pub undecided: Vec<Undecided<ObjectPair>>,
    /// Sampling rate that would decide all undecided times of pairs \[Hz\]; `None` if no rate would.
    pub deciding_rate_hz: Option<f64>,
    /// Numbers of findings.
    pub tallies: Tallies,
    /// Number of undecided times of obstacles, which [`Tallies::undecided`] counts too; an upper bound if that tally is
    /// not exact.
    pub undecided_of_obstacles: u64,
    /// Listed gaps in order of time; [`Tallies`] counts all. A gap counts if another vehicle or an obstacle is present,
    /// or if limits of single vehicles are judged. The motion in a gap is not known.
    pub gaps: Vec<Gap>,
    /// Vehicles that are never present together with another, if there are no obstacles. A wrong clock has the same
    /// effect.
    pub alone: Vec<usize>,
    /// Time that is not judged because vehicles are on the ground; `None` without a height of the ground, or without
    /// separations.
    pub exempt: Option<ExemptTime>,
    /// Largest contradiction to the assumed bound on acceleration, if any; nothing is proved clear then.
    pub contradiction: Option<Contradiction>,
    /// Whether everything except the lists above is known.
    pub is_else_known: bool,
    /// Number of judged segments of motion of all vehicles.
    pub segments: u64,
    /// Number of swept pairs of segments, including those of vehicles and obstacles. All others were proved, by bounds
    /// on the positions, to be neither below a limit nor among the closest.
    pub swept: u64,
    /// Result of the second detector.
    pub parry: ParryEvidence<ObjectPair>,
}

impl Outcome {
    /// Returns the name of a vehicle, or its number from 1 if it has no name.
    #[must_use]
    pub fn name(&self, vehicle: usize) -> String {
        self.vehicles.get(vehicle).cloned().unwrap_or_else(|| (vehicle + 1).to_string())
    }

    /// Returns the names of a pair, given the judged obstacles.
    #[must_use]
    pub fn names(&self, pair: ObjectPair, obstacles: &[MovingObstacle]) -> [String; 2] {
        match pair {
            ObjectPair::Vehicles(pair) => [self.name(pair.first()), self.name(pair.second())],
            ObjectPair::Obstacle { vehicle, obstacle } => {
                [self.name(vehicle), obstacles.get(obstacle).map_or(String::new(), |obstacle| obstacle.name.clone())]
            }
        }
    }
}

/// Relative rounding of a mean interval.
const ROUNDING: f64 = 1e-6;

/// Returns the window of the verdict \[s\]: that of the settings, completed by the span of all samples.
pub(super) fn window(settings: &Settings, span_s: Option<(f64, f64)>) -> Option<Interval> {
    let (first_s, last_s) = span_s.map_or((None, None), |(from_s, to_s)| (Some(from_s), Some(to_s)));
    Some(Interval { from_s: settings.from_s.or(first_s)?, to_s: settings.until_s.or(last_s)? })
}

/// Returns the selected vehicles that are not present over the whole window, by index. Vehicles have their own sample
/// times, so less than one mean interval of a vehicle at either end is no absence.
pub(super) fn absences(vehicles: &[Vehicle], settings: &Settings, span_s: Option<(f64, f64)>) -> Vec<Absence> {
    let window = window(settings, span_s);
    let is_throughout = |vehicle: &Vehicle| {
        let allowed_s = vehicle.mean_interval_s() * (1.0 - ROUNDING);
        vehicle.presence.zip(window).is_some_and(|(present, Interval { from_s, to_s })| {
            let is_within = |missing_s: f64| missing_s <= 0.0 || missing_s < allowed_s;
            is_within(present.from_s - from_s) && is_within(to_s - present.to_s)
        })
    };
    let selected = vehicles.iter().enumerate().filter(|(_, vehicle)| vehicle.is_selected);
    let absent = selected.filter(|(_, vehicle)| !is_throughout(vehicle));
    absent.map(|(vehicle, state)| Absence { vehicle, seen: state.presence }).collect()
}

/// Largest number of gaps that are held before all but the longest and the first of each vehicle are dropped.
const MAX_HELD: usize = 8 * LISTED;

impl Finding for Gap {
    type Subject = usize;

    fn subject(&self) -> usize {
        self.vehicle
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    fn excess(&self) -> f64 {
        self.joined_by_s
    }
}

/// Gaps of all vehicles so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    held: Vec<Gap>,
    /// Dropped gaps of each vehicle: their number, and the interval from the first to the last.
    dropped: BTreeMap<usize, (u64, Gap)>,
}

impl Gaps {
    pub(super) fn extend(&mut self, gap: Option<Gap>) {
        self.held.extend(gap);
        if self.held.len() > MAX_HELD {
            self.shorten();
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Keeps the longest gaps, and the first of each vehicle.
    fn shorten(&mut self) {
        let mut list = Shortlist::new(LISTED);
        list.extend(self.held.iter().copied());
        let kept = list.into_list();
        let key = |gap: &Gap| (gap.vehicle, gap.from_s.to_bits());
        let is_kept: BTreeSet<_> = kept.iter().map(key).collect();
        for gap in self.held.drain(..).filter(|gap| !is_kept.contains(&key(gap))) {
            let (count, all) = self.dropped.entry(gap.vehicle).or_insert((0, gap));
            *count += 1;
            (all.from_s, all.to_s) = (all.from_s.min(gap.from_s), all.to_s.max(gap.to_s));
        }
        self.held = kept;
    }

    /// Returns the gaps that matter, their number, and whether no gap matters for pairs. A gap does not matter for
    /// pairs if no other vehicle is present during it and there is no obstacle.
    pub(super) fn finish(
        mut self,
        presence: &[Option<Presence>],
        is_obstructed: bool,
        do_all_count: bool,
    ) -> (Vec<Gap>, Tally, bool) {
        let matters = |gap: &Gap| {
            let others = presence.iter().enumerate().filter(|(vehicle, _)| *vehicle != gap.vehicle);
            let meets = |other: &Presence| other.from_s < gap.to_s && gap.from_s < other.to_s;
            is_obstructed || others.filter_map(|(_, present)| present.as_ref()).any(meets)
        };
        let is_gapless = !self.held.iter().chain(self.dropped.values().map(|(_, all)| all)).any(matters);
        if !do_all_count {
            self.held.retain(matters);
            self.dropped.retain(|_, (_, all)| matters(all));
        }
        // The dropped gaps of a vehicle are known to matter if another vehicle is present throughout.
        let is_covered = |gap: &Gap| {
            let others = presence.iter().enumerate().filter(|(vehicle, _)| *vehicle != gap.vehicle);
            others.filter_map(|(_, present)| *present).any(|other| other.from_s <= gap.from_s && gap.to_s <= other.to_s)
        };
        let is_exact = do_all_count || is_obstructed || self.dropped.values().all(|(_, all)| is_covered(all));
        let dropped = if is_exact { self.dropped.values().map(|(count, _)| count).sum() } else { 0 };
        let count = self.held.len() as u64 + dropped;
        let in_order = |a: &Gap, b: &Gap| a.from_s.total_cmp(&b.from_s).then(a.vehicle.cmp(&b.vehicle));
        self.held.sort_by(in_order);
        if self.held.len() > LISTED {
            self.shorten();
        }
        self.held.sort_by(in_order);
        let tally = Tally { count, listed: self.held.len(), is_exact };
        (self.held, tally, is_gapless)
    }
}

/// Number of items from which usual intervals are learnt.
const OPENING: usize = 65_536;
/// Largest number of intervals of one vehicle that are used.
const MAX_INTERVALS: usize = 64;
/// Smallest number of intervals that give a vehicle its own usual interval; with fewer, the intervals of all vehicles
/// are used.
const MIN_INTERVALS: usize = 3;
/// Ratio of an interval to the usual interval above which a sample is missing.
const GAP_OVER_USUAL: f64 = 1.5;

/// Longest interval without a gap, for each vehicle and for vehicles without enough intervals \[s\].
#[derive(Clone, Debug, Default)]
pub(super) struct Rates {
    own_s: Vec<Option<f64>>,
    common_s: Option<f64>,
    curves: Vec<bool>,
}

impl Rates {
    /// Returns the usual intervals in the first items of a recording with `vehicles` vehicles.
    pub(super) fn learn(items: &[Item], vehicles: usize) -> Self {
        let mut last_s: Vec<Option<f64>> = vec![None; vehicles];
        let mut intervals_s: Vec<Vec<f64>> = vec![Vec::new(); vehicles];
        let mut curves = vec![false; vehicles];
        let mut known = 0;
        for item in items.iter().take(OPENING) {
            if known == vehicles {
                break;
            }
            let vehicle = item.vehicle();
            let Some(intervals_s) = intervals_s.get_mut(vehicle) else { continue };
            match item {
                Item::Piece(_) => curves[vehicle] = true,
                Item::Sample(_) if intervals_s.len() == MAX_INTERVALS => {}
                Item::Sample(sample) => {
                    let last_s = last_s[vehicle].replace(sample.time_s);
                    intervals_s.extend(last_s.map(|last_s| sample.time_s - last_s));
                    known += usize::from(intervals_s.len() == MAX_INTERVALS);
                }
            }
        }
        let mut all_s = intervals_s.concat();
        let own_s = intervals_s
            .iter_mut()
            .map(|intervals_s| if intervals_s.len() < MIN_INTERVALS { None } else { median(intervals_s) })
            .collect();
        Self { own_s, common_s: median(&mut all_s), curves }
    }

    /// Adds the vehicles with these names that are not known yet. `learnt` are the usual intervals in the first items,
    /// which are needed if the settings give no longest gap.
    pub(super) fn add_vehicles(
        learnt: &mut Option<Self>,
        vehicles: &mut Vec<Vehicle>,
        settings: &Settings,
        names: &[String],
        items: &[Item],
    ) {
        if learnt.is_none() && !items.is_empty() && settings.max_gap_s.is_none() {
            *learnt = Some(Self::learn(items, names.len()));
        }
        for (index, name) in names.iter().enumerate().skip(vehicles.len()) {
            let usual_s = || learnt.as_ref().map_or(f64::INFINITY, |rates| rates.max_gap_s(index));
            vehicles.push(Vehicle::new(name, settings, settings.max_gap_s.unwrap_or_else(usual_s)));
        }
    }

    /// Returns the longest interval of a vehicle without a gap \[s\].
    pub(super) fn max_gap_s(&self, vehicle: usize) -> f64 {
        if self.curves.get(vehicle).copied().unwrap_or(false) {
            return 0.0;
        }
        let usual_s = self.own_s.get(vehicle).copied().flatten().or(self.common_s);
        usual_s.map_or(f64::INFINITY, |usual_s| GAP_OVER_USUAL * usual_s)
    }
}

/// Returns the lower median.
fn median(numbers: &mut [f64]) -> Option<f64> {
    let middle = numbers.len().checked_sub(1)? / 2;
    Some(*numbers.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaps(count: u32) -> Gaps {
        let mut gaps = Gaps::default();
        for k in 0..count {
            let from_s = f64::from(2 * k);
            gaps.extend(Some(Gap::new(0, from_s, from_s + 1.0 + f64::from(k) / f64::from(count))));
        }
        gaps
    }

    #[test]
    fn many_gaps_are_counted_and_the_longest_and_first_are_listed() {
        let everywhere = Some(Presence { from_s: 0.0, to_s: 1e9 });
        let (listed, tally, is_gapless) = gaps(50_000).finish(&[everywhere; 2], false, false);
        assert_eq!((tally, is_gapless), (Tally { count: 50_000, listed: LISTED + 1, is_exact: true }, false));
        assert_eq!((listed[0].from_s, listed[1].from_s), (0.0, 98_000.0));
        let (few, tally, _) = gaps(3).finish(&[everywhere; 2], false, false);
        assert_eq!((few.len(), tally), (3, Tally::all(3)));
    }

    #[test]
    fn gaps_without_another_vehicle_do_not_matter() {
        let (first, late) = (Presence { from_s: 0.0, to_s: 1e5 }, Presence { from_s: 2e5, to_s: 3e5 });
        let (listed, tally, is_gapless) = gaps(50_000).finish(&[Some(first), Some(late)], false, false);
        assert!(listed.is_empty() && is_gapless && tally.count == 0);
    }
}

#[cfg(test)]
mod rates_tests {
    use nalgebra::Vector3;

    use super::*;
    use tautline_core::track::Sample;

    fn seen(vehicle: usize, time_s: f64) -> Item {
        let position_m = Vector3::zeros();
        Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
    }

    #[test]
    fn every_vehicle_has_its_own_rate_and_one_with_few_samples_the_common_rate() {
        let mut items: Vec<_> = (0..20).map(|k| seen(0, 0.1 * f64::from(k))).collect();
        items.extend((0..5).map(|k| seen(1, f64::from(k))));
        items.extend([seen(2, 0.0), seen(2, 2.0)]);
        let rates = Rates::learn(&items, 3);
        let gaps: Vec<_> = (0..4).map(|vehicle| (rates.max_gap_s(vehicle) * 1e3).round()).collect();
        assert_eq!(gaps, [150.0, 1500.0, 150.0, 150.0]);
        // The first vehicle has all its intervals before the second appears.
        items = (0..100).map(|k| seen(0, 0.1 * f64::from(k))).collect();
        items.extend((0..5).map(|k| seen(1, 10.0 + f64::from(k))));
        assert!((Rates::learn(&items, 2).max_gap_s(1) - 1.5).abs() < 1e-9);
        assert_eq!(Rates::learn(&[], 0).max_gap_s(0), f64::INFINITY);
    }
}
