//! One limit, as far as a recording was read.

use super::extremum::Enclosure;
use super::limit::Limit;
use super::outcome::{Corner, Corners, Exceeding, LimitOutcome};
use crate::outcome::Status;
use crate::shortlist::{Finding, LISTED, Shortlist, Tally};
use crate::sweep::Interval;

/// A limit as far as the recording was read.
#[derive(Clone, Debug)]
pub(super) struct Followed {
    pub(super) limit: Limit,
    extreme: Option<Exceeding>,
    violations: Times,
    undecided: Times,
    /// Which vehicles something was told of.
    told: Vec<bool>,
    /// What was taken for granted to tell it.
    pub(super) assumes: Option<String>,
    /// Corners at which a velocity jumps; nothing is held against a limit there.
    corners: Option<Corners>,
}

/// A value over a time of which it is the extreme, turned so that it must not exceed its bound.
pub(super) type Found = (Interval, Enclosure);

impl Followed {
    pub(super) fn new(limit: Limit) -> Self {
        let (violations, undecided) = (Times::default(), Times::default());
        Self { limit, extreme: None, violations, undecided, told: Vec::new(), assumes: None, corners: None }
    }

    /// The worst value that is known.
    pub(super) fn known(&self) -> f64 {
        self.extreme.map_or(f64::NEG_INFINITY, |extreme| extreme.lower)
    }

    pub(super) fn note(&mut self, vehicle: usize, found: Option<Found>) {
        let Some((over, Enclosure { lower, upper, at })) = found else { return };
        if self.told.len() <= vehicle {
            self.told.resize(vehicle + 1, false);
        }
        self.told[vehicle] = true;
        let at_s = over.from_s + at * (over.to_s - over.from_s);
        let found = Exceeding { vehicle, from_s: over.from_s, to_s: over.to_s, lower, upper, at_s };
        let bound = self.limit.bound();
        if lower > bound {
            self.violations.add(found);
        } else if upper > bound {
            self.undecided.add(found);
        }
        let extreme = self.extreme.get_or_insert(found);
        if found.lower > extreme.lower {
            *extreme = Exceeding { upper: extreme.upper.max(upper), ..found };
        } else {
            extreme.upper = extreme.upper.max(upper);
        }
    }

    /// Takes note of a corner at which the velocity jumps \[m/s\].
    pub(super) fn note_corner(&mut self, vehicle: usize, at_s: f64, by_m_s: f64) {
        let corner = Corner { vehicle, at_s, by_m_s };
        let corners = self.corners.get_or_insert(Corners { count: 0, largest: corner });
        corners.count += 1;
        if by_m_s > corners.largest.by_m_s {
            corners.largest = corner;
        }
    }

    pub(super) fn finish(self, judged: &[bool], is_whole: bool) -> LimitOutcome {
        let Self { limit, extreme, violations, undecided, told, assumes, corners } = self;
        let is_told = |vehicle: usize| told.get(vehicle).copied().unwrap_or(false);
        let unknown: Vec<_> =
            judged.iter().enumerate().filter(|&(vehicle, &asked)| asked && !is_told(vehicle)).map(|(k, _)| k).collect();
        let turned = |of: Exceeding| {
            let (lower, upper) = if limit.quantity.is_least() { (-of.upper, -of.lower) } else { (of.lower, of.upper) };
            Exceeding { lower, upper, ..of }
        };
        let listed = |times: Times| {
            let (list, tally) = times.finish();
            (list.into_iter().map(turned).collect::<Vec<_>>(), tally)
        };
        let ((violations, violations_tally), (undecided, undecided_tally)) = (listed(violations), listed(undecided));
        let decided = is_whole && undecided.is_empty() && unknown.is_empty() && extreme.is_some();
        LimitOutcome {
            status: Status::new(!violations.is_empty(), decided),
            extreme: extreme.map(turned),
            violations,
            undecided,
            violations_tally,
            undecided_tally,
            unknown,
            assumes,
            corners,
            limit,
        }
    }
}

/// Times of vehicles, those of one that go on as one. All are counted; the worst and the first of each vehicle are kept.
#[derive(Clone, Debug)]
struct Times {
    /// The last one of each vehicle, which may go on.
    open: Vec<Option<Exceeding>>,
    ended: Shortlist<Exceeding>,
    count: u64,
}

impl Times {
    fn add(&mut self, found: Exceeding) {
        if self.open.len() <= found.vehicle {
            self.open.resize(found.vehicle + 1, None);
        }
        let last = &mut self.open[found.vehicle];
        if let Some(of) = last.as_mut().filter(|of| of.to_s >= found.from_s) {
            of.to_s = of.to_s.max(found.to_s);
            of.upper = of.upper.max(found.upper);
            if found.lower > of.lower {
                (of.lower, of.at_s) = (found.lower, found.at_s);
            }
        } else {
            self.count += 1;
            self.ended.extend(last.replace(found));
        }
    }

    /// Those that are kept, in order of time, and how many there are.
    fn finish(mut self) -> (Vec<Exceeding>, Tally) {
        self.ended.extend(self.open.into_iter().flatten());
        let list = self.ended.into_list();
        let tally = Tally { count: self.count, listed: list.len(), is_exact: true };
        (list, tally)
    }
}

impl Default for Times {
    fn default() -> Self {
        Self { open: Vec::new(), ended: Shortlist::new(LISTED), count: 0 }
    }
}

impl Finding for Exceeding {
    type On = usize;

    fn on(&self) -> usize {
        self.vehicle
    }

    fn start_s(&self) -> f64 {
        self.from_s
    }

    fn end_s(&self) -> f64 {
        self.to_s
    }

    /// What is certain, or else what is possible.
    fn excess(&self) -> f64 {
        if self.lower == f64::NEG_INFINITY { self.upper } else { self.lower }
    }
}
