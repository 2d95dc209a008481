//! Verdict on a recording, and the presence of vehicles: usual intervals between samples, gaps and absences.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::settings::Settings;
use super::vehicle::Vehicle;
use crate::envelope::EnvelopeOutcome;
use crate::findings::{Finding, LISTED, Shortlist, Tally};
use crate::obstacle::Obstacle;
use crate::outcome::{Approach, ObjectPair, ParryEvidence, Status, Undecided, Violation};
use crate::slices::Slice;
use crate::sweep::Interval;
use tautline_core::track::Item;

/// A time during which a vehicle was not seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// When it was last seen before \[s\].
    pub from_s: f64,
    /// When it was seen again \[s\].
    pub to_s: f64,
    /// The [`max_gap_s`](super::Settings::max_gap_s) that would join what is before it to what is after it \[s\]; longer than
    /// the gap where that is cut by the window.
    pub joined_by_s: f64,
}

impl Gap {
    pub(super) fn new(vehicle: usize, from_s: f64, to_s: f64) -> Self {
        Self { vehicle, from_s, to_s, joined_by_s: to_s - from_s }
    }

    /// As far as it lies in a window.
    pub(super) fn within(self, window: Interval) -> Option<Self> {
        let (from_s, to_s) = (self.from_s.max(window.from_s), self.to_s.min(window.to_s));
        (from_s < to_s).then_some(Self { from_s, to_s, ..self })
    }
}

/// When a vehicle is there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Presence {
    /// First seen \[s\].
    pub from_s: f64,
    /// Last seen \[s\].
    pub to_s: f64,
}

/// A vehicle that is not seen over the whole window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Absence {
    /// The vehicle.
    pub vehicle: usize,
    /// When it is seen; `None` where it is not seen in the window at all.
    pub seen: Option<Presence>,
}

/// How many findings of each kind there are, and how many of them are listed: the worst [`LISTED`](crate::LISTED), and the
/// first of each of as many pairs or vehicles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tallies {
    /// Of violations.
    pub violations: Tally,
    /// Of times that could not be decided.
    pub undecided: Tally,
    /// Of gaps; the worst are the longest.
    pub gaps: Tally,
}

impl Tallies {
    /// Whether some list is shorter than what was found.
    #[must_use]
    pub fn are_shortened(&self) -> bool {
        [self.violations, self.undecided, self.gaps].iter().any(Tally::is_shortened)
    }
}

/// Returns the vehicles that are never present together with another vehicle. No pair of such a vehicle is judged.
pub(super) fn alone(presence: &[Option<Presence>]) -> Vec<usize> {
    let there = presence.iter().enumerate().filter_map(|(vehicle, there)| Some((there.as_ref()?, vehicle)));
    let mut there: Vec<_> = there.collect();
    there.sort_by(|(a, _), (b, _)| a.from_s.total_cmp(&b.from_s));
    let mut last_s = f64::NEG_INFINITY;
    let mut alone = Vec::new();
    for (place, &(of, vehicle)) in there.iter().enumerate() {
        let next_s = there.get(place + 1).map_or(f64::INFINITY, |(next, _)| next.from_s);
        if last_s < of.from_s && of.to_s < next_s {
            alone.push(vehicle);
        }
        last_s = last_s.max(of.to_s);
    }
    alone.sort_unstable();
    alone
}

/// Where a recording contradicts the bound on acceleration that it is judged by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Contradiction {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// When \[s\].
    pub time_s: f64,
    /// The samples there need at least this \[m/s^2\].
    pub needs_m_s2: f64,
    /// What was assumed \[m/s^2\].
    pub assumed_m_s2: f64,
}

/// The verdict and its evidence.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Clear where everything asked for was judged and nothing came too close; undecided where something could not be
    /// told, or there never were two to keep apart; a violation, whatever else there was, where two came too close or a
    /// vehicle was beyond a limit.
    pub status: Status,
    /// The verdict on how close any two came alone; none where only single vehicles were asked about.
    pub separation: Option<Status>,
    /// What was found of each vehicle by itself.
    pub envelope: EnvelopeOutcome,
    /// Names of the vehicles, as the recording has them; those that were not asked for are among them.
    pub vehicles: Vec<String>,
    /// When each vehicle is there within what was asked; `None` where it is not, or was not asked for.
    pub presence: Vec<Option<Presence>>,
    /// Vehicles that were asked for and are not seen over the whole window, by their numbers.
    pub absences: Vec<Absence>,
    /// Longest interval between two samples of each vehicle that was no gap \[s\]: as asked, or one and a half of the
    /// usual one.
    pub max_gaps_s: Vec<f64>,
    /// First and last instant judged \[s\]; `None` where there was nothing to judge.
    pub span_s: Option<(f64, f64)>,
    /// The ten pairs that came closest, the closest first, each at its closest.
    pub closest: Vec<Approach>,
    /// The ten closest approaches to obstacles, likewise.
    pub obstacles: Vec<Approach>,
    /// The closest approach of all pairs of vehicles in one slice of time after the other, about a sample long, of a long
    /// recording longer; of times at which no two are there, or both are on the ground, nothing is known. Empty unless it was
    /// asked for.
    pub smallest: Vec<Slice>,
    /// Violations in order of time, as many as [`Tallies`] says.
    pub violations: Vec<Violation<ObjectPair>>,
    /// Times that could not be decided, in order of time, as many as [`Tallies`] says.
    pub undecided: Vec<Undecided<ObjectPair>>,
    /// The sampling rate that would decide everything that is undecided of pairs \[Hz\]; `None` where there is none that would.
    pub deciding_rate_hz: Option<f64>,
    /// How many findings there are.
    pub tallies: Tallies,
    /// Listed gaps in order of time; [`Tallies`] counts all. A gap counts if another vehicle or an obstacle is present, or if
    /// limits of single vehicles are judged. The motion in a gap is not known.
    pub gaps: Vec<Gap>,
    /// Vehicles that are never there together with another, where they are to keep apart from nothing else: a wrong clock would
    /// look like that.
    pub alone: Vec<usize>,
    /// The largest contradiction to the assumed bound on acceleration, if there is one: then nothing is proved clear.
    pub contradiction: Option<Contradiction>,
    /// Whether everything is known but for the lists above.
    pub is_else_known: bool,
    /// Segments of motion that were judged, over all vehicles.
    pub segments: u64,
    /// Segments of pairs (and of vehicles and obstacles) that were swept; all others were proved, by bounds on where
    /// vehicles were, to be neither too close nor among the closest.
    pub swept: u64,
    /// What the second detector says.
    pub parry: ParryEvidence<ObjectPair>,
}

impl Outcome {
    /// The name of a vehicle: its number from 1 where there is no name.
    #[must_use]
    pub fn name(&self, vehicle: usize) -> String {
        self.vehicles.get(vehicle).cloned().unwrap_or_else(|| (vehicle + 1).to_string())
    }

    /// The names of a pair, given the obstacles that were judged.
    #[must_use]
    pub fn names(&self, pair: ObjectPair, obstacles: &[Obstacle]) -> [String; 2] {
        match pair {
            ObjectPair::Vehicles(pair) => [self.name(pair.first()), self.name(pair.second())],
            ObjectPair::Obstacle { vehicle, obstacle } => {
                [self.name(vehicle), obstacles.get(obstacle).map_or(String::new(), |of| of.name.clone())]
            }
        }
    }
}

/// Relative rounding of a mean interval.
const ROUNDING: f64 = 1e-6;

/// The window that a verdict is about \[s\]: what was asked for, or what was seen of any vehicle.
pub(super) fn window(settings: &Settings, span_s: Option<(f64, f64)>) -> Option<Interval> {
    let (first_s, last_s) = span_s.map_or((None, None), |(from_s, to_s)| (Some(from_s), Some(to_s)));
    Some(Interval { from_s: settings.from_s.or(first_s)?, to_s: settings.to_s.or(last_s)? })
}

/// The vehicles that were asked for and are not seen over the whole window, by their numbers. Vehicles are sampled at times of
/// their own: less than one mean interval of a vehicle at either end is no absence.
pub(super) fn absences(vehicles: &[Vehicle], settings: &Settings, span_s: Option<(f64, f64)>) -> Vec<Absence> {
    let window = window(settings, span_s);
    let is_throughout = |vehicle: &Vehicle| {
        let allowed_s = vehicle.mean_interval_s() * (1.0 - ROUNDING);
        vehicle.presence.zip(window).is_some_and(|(there, Interval { from_s, to_s })| {
            let is_within = |missing_s: f64| missing_s <= 0.0 || missing_s < allowed_s;
            is_within(there.from_s - from_s) && is_within(to_s - there.to_s)
        })
    };
    let asked = vehicles.iter().enumerate().filter(|(_, vehicle)| vehicle.asked_for);
    let absent = asked.filter(|(_, vehicle)| !is_throughout(vehicle));
    absent.map(|(vehicle, of)| Absence { vehicle, seen: of.presence }).collect()
}

/// Gaps that are held before the longest and the first of each vehicle alone are kept.
const MOST_HELD: usize = 8 * LISTED;

impl Finding for Gap {
    type On = usize;

    fn on(&self) -> usize {
        self.vehicle
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    fn excess(&self) -> f64 {
        self.joined_by_s
    }
}

/// The gaps of all vehicles, as they are found.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    held: Vec<Gap>,
    /// Those of a vehicle that are no longer held: how many, and from the first of them to the last.
    dropped: BTreeMap<usize, (u64, Gap)>,
}

impl Gaps {
    pub(super) fn extend(&mut self, gap: Option<Gap>) {
        self.held.extend(gap);
        if self.held.len() > MOST_HELD {
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

    /// Those that matter, how many there are, and whether there is none of those that matter for pairs: during a gap in which no
    /// other vehicle is there and no obstacle is in the way nothing can come too close.
    pub(super) fn finish(
        mut self,
        presence: &[Option<Presence>],
        is_obstructed: bool,
        do_all_count: bool,
    ) -> (Vec<Gap>, Tally, bool) {
        let matters = |gap: &Gap| {
            let others = presence.iter().enumerate().filter(|(vehicle, _)| *vehicle != gap.vehicle);
            let meets = |other: &Presence| other.from_s < gap.to_s && gap.from_s < other.to_s;
            is_obstructed || others.filter_map(|(_, there)| there.as_ref()).any(meets)
        };
        let is_gapless = !self.held.iter().chain(self.dropped.values().map(|(_, all)| all)).any(matters);
        if !do_all_count {
            self.held.retain(matters);
            self.dropped.retain(|_, (_, all)| matters(all));
        }
        // Of those that are no longer held it is known that all matter where another vehicle is there throughout.
        let is_covered = |gap: &Gap| {
            let others = presence.iter().enumerate().filter(|(vehicle, _)| *vehicle != gap.vehicle);
            others.filter_map(|(_, there)| *there).any(|other| other.from_s <= gap.from_s && gap.to_s <= other.to_s)
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

/// Items that are looked at.
const OPENING: usize = 65_536;
/// Intervals of one vehicle that are looked at.
const MOST_INTERVALS: usize = 64;
/// Fewest intervals of a vehicle that make a rate of its own; with fewer, all vehicles' intervals do.
const FEWEST_INTERVALS: usize = 3;
/// Ratio of an interval to the usual interval above which a sample is missing.
const GAP_OVER_USUAL: f64 = 1.5;

/// Longest interval without a gap, for each vehicle and for those that are not known yet \[s\].
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
                Item::Sample(_) if intervals_s.len() == MOST_INTERVALS => {}
                Item::Sample(sample) => {
                    let last_s = last_s[vehicle].replace(sample.time_s);
                    intervals_s.extend(last_s.map(|last_s| sample.time_s - last_s));
                    known += usize::from(intervals_s.len() == MOST_INTERVALS);
                }
            }
        }
        let mut all_s = intervals_s.concat();
        let own_s = intervals_s
            .iter_mut()
            .map(|intervals_s| if intervals_s.len() < FEWEST_INTERVALS { None } else { median(intervals_s) })
            .collect();
        Self { own_s, common_s: median(&mut all_s), curves }
    }

    /// Longest interval of a vehicle without a gap \[s\].
    pub(super) fn max_gap_s(&self, vehicle: usize) -> f64 {
        if self.curves.get(vehicle).copied().unwrap_or(false) {
            return 0.0;
        }
        let usual_s = self.own_s.get(vehicle).copied().flatten().or(self.common_s);
        usual_s.map_or(f64::INFINITY, |usual_s| GAP_OVER_USUAL * usual_s)
    }
}

/// The lower median.
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
    fn many_gaps_are_counted_and_the_longest_are_listed_with_the_first() {
        let everywhere = Some(Presence { from_s: 0.0, to_s: 1e9 });
        let (listed, tally, is_gapless) = gaps(50_000).finish(&[everywhere; 2], false, false);
        assert_eq!((tally, is_gapless), (Tally { count: 50_000, listed: LISTED + 1, is_exact: true }, false));
        assert_eq!((listed[0].from_s, listed[1].from_s), (0.0, 98_000.0));
        let (few, tally, _) = gaps(3).finish(&[everywhere; 2], false, false);
        assert_eq!((few.len(), tally), (3, Tally::all(3)));
    }

    #[test]
    fn gaps_while_no_other_is_there_do_not_matter_however_many_they_are() {
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
    fn every_vehicle_has_its_own_rate_and_one_seen_too_seldom_that_of_all() {
        let mut items: Vec<_> = (0..20).map(|k| seen(0, 0.1 * f64::from(k))).collect();
        items.extend((0..5).map(|k| seen(1, f64::from(k))));
        items.extend([seen(2, 0.0), seen(2, 2.0)]);
        let rates = Rates::learn(&items, 3);
        let gaps: Vec<_> = (0..4).map(|vehicle| (rates.max_gap_s(vehicle) * 1e3).round()).collect();
        assert_eq!(gaps, [150.0, 1500.0, 150.0, 150.0]);
        // One that is known well leaves those still to be known.
        items = (0..100).map(|k| seen(0, 0.1 * f64::from(k))).collect();
        items.extend((0..5).map(|k| seen(1, 10.0 + f64::from(k))));
        assert!((Rates::learn(&items, 2).max_gap_s(1) - 1.5).abs() < 1e-9);
        assert_eq!(Rates::learn(&[], 0).max_gap_s(0), f64::INFINITY);
    }
}
