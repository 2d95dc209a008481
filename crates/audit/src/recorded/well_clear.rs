//! Monitor of well clear: judges all pairs of a recording, window after window.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Serialize;

use super::vehicle::Vehicle;
use super::window::within;
use crate::findings::{Finding, LISTED, Shortlist, Tally};
use crate::ledger::Interruption;
use crate::outcome::Status;
use crate::pair_sweep::{Overlap, overlaps};
use crate::polynomial::BernsteinBasis;
use crate::segment::Segment;
use crate::sweep::Interval;
use crate::well_clear::WellClear;
use tautline_core::swarm::Pair;

/// Longest uncertain time at an end of a certain loss \[s\] that counts as a part of it.
const AT_AN_END_S: f64 = 1e-3;
/// Relative rounding of bounds on positions.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Time during which a pair was not well clear, or during which rounding could change the result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WellClearLoss {
    /// The two vehicles.
    #[serde(skip)]
    pub pair: Pair,
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Smallest horizontal distance within this time \[m\].
    pub horizontal_m: f64,
    /// Smallest vertical distance within this time \[m\].
    pub vertical_m: f64,
}

/// Findings for the thresholds of well clear.
#[derive(Clone, Debug, PartialEq)]
pub struct WellClearOutcome {
    /// Thresholds.
    pub thresholds: WellClear,
    /// Verdict.
    pub status: Status,
    /// Losses in order of time; of a long list the closest and the first of each pair.
    pub violations: Vec<WellClearLoss>,
    /// Undecided times, shortened likewise.
    pub undecided: Vec<WellClearLoss>,
    /// Number of losses.
    pub violations_tally: Tally,
    /// Number of undecided times.
    pub undecided_tally: Tally,
}

impl Finding for WellClearLoss {
    type Subject = Pair;

    fn subject(&self) -> Pair {
        self.pair
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    fn excess(&self) -> f64 {
        -self.horizontal_m
    }
}

/// Losses of one kind: those that may go on, and a bounded list of the others.
#[derive(Clone, Debug)]
struct Losses {
    open: BTreeMap<Pair, WellClearLoss>,
    ended: Shortlist<WellClearLoss>,
    count: u64,
}

impl Losses {
    fn new() -> Self {
        Self { open: BTreeMap::new(), ended: Shortlist::new(LISTED), count: 0 }
    }

    fn end(&mut self, loss: WellClearLoss) {
        self.ended.offer(loss);
        self.count += 1;
    }

    /// Adds a loss, or extends the last one of the pair if both touch.
    fn add(&mut self, new: WellClearLoss) {
        match self.open.get_mut(&new.pair) {
            Some(last) if new.from_s <= last.to_s => {
                last.to_s = last.to_s.max(new.to_s);
                last.horizontal_m = last.horizontal_m.min(new.horizontal_m);
                last.vertical_m = last.vertical_m.min(new.vertical_m);
            }
            _ => {
                if let Some(last) = self.open.insert(new.pair, new) {
                    self.end(last);
                }
            }
        }
    }

    /// Ends the losses that ended before an instant.
    fn settle(&mut self, before_s: f64) {
        let (open, ended) =
            std::mem::take(&mut self.open).into_iter().partition(|(_, loss)| loss.to_s >= before_s - AT_AN_END_S);
        self.open = open;
        let ended: BTreeMap<_, _> = ended;
        for loss in ended.into_values() {
            self.end(loss);
        }
    }

    fn finish(mut self) -> (Vec<WellClearLoss>, Tally) {
        self.settle(f64::INFINITY);
        let list = self.ended.into_list();
        let tally = Tally { count: self.count, listed: list.len(), is_exact: true };
        (list, tally)
    }
}

/// Judges well clear while a recording is read.
#[derive(Clone, Debug)]
pub(super) struct WellClearMonitor {
    thresholds: WellClear,
    violations: Losses,
    undecided: Losses,
    has_judged: bool,
    interruption: Interruption,
}

/// Bounds on the positions and the speed of a vehicle over a window.
struct Reach {
    vehicle: usize,
    low: Vector3<f64>,
    high: Vector3<f64>,
    speed_m_s: f64,
}

impl Reach {
    fn of(vehicle: usize, segments: &[Segment]) -> Option<Self> {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        let mut speed_m_s = 0.0_f64;
        for segment in segments {
            (low, high) = (low.inf(&segment.from).inf(&segment.to), high.sup(&segment.from).sup(&segment.to));
            let duration_s = segment.to_s - segment.from_s;
            if let Some(curve) = segment.curve() {
                let whole = segment.local(Interval { from_s: segment.from_s, to_s: segment.to_s });
                let basis = BernsteinBasis::of_degree(whole.len() - 1);
                for point in basis.points(&whole) {
                    (low, high) = (low.inf(&point), high.sup(&point));
                }
                let bound: f64 = whole.iter().enumerate().skip(1).map(|(k, c)| k as f64 * c.xy().norm()).sum();
                let aside = Vector3::repeat(curve.rounding());
                (low, high) = (low - aside, high + aside);
                speed_m_s = speed_m_s.max(bound / duration_s);
            } else if duration_s > 0.0 {
                let line = segment.line();
                speed_m_s = speed_m_s.max((line.to - line.from).xy().norm() / (line.to_s - line.from_s));
            }
        }
        let aside = Vector3::repeat(ROUNDING * (low.amax() + high.amax()));
        (!segments.is_empty()).then(|| Self { vehicle, low: low - aside, high: high + aside, speed_m_s })
    }
}

impl WellClearMonitor {
    pub(super) fn new(thresholds: WellClear) -> Self {
        let interruption = Interruption::default();
        Self { thresholds, violations: Losses::new(), undecided: Losses::new(), has_judged: false, interruption }
    }

    pub(super) fn set_interruption(&mut self, interruption: Interruption) {
        self.interruption = interruption;
    }

    /// Judges all pairs in a window.
    pub(super) fn judge(&mut self, vehicles: &[Vehicle], window: Interval) {
        let segments = |vehicle: usize| {
            let all = &vehicles[vehicle].segments;
            &all[within(all, window)]
        };
        let mut reaches: Vec<_> = (0..vehicles.len()).filter_map(|k| Reach::of(k, segments(k))).collect();
        reaches.sort_by(|a, b| a.low.x.total_cmp(&b.low.x).then(a.vehicle.cmp(&b.vehicle)));
        let is_in_air = |reach: &Reach| segments(reach.vehicle).iter().any(|part| part.grounded != Some(true));
        self.has_judged |= reaches.len() > 1 && reaches.iter().any(is_in_air);
        let fastest_m_s = reaches.iter().map(|reach| reach.speed_m_s).fold(0.0, f64::max);
        for (k, a) in reaches.iter().enumerate() {
            if self.interruption.is_set() {
                return;
            }
            let until = a.high.x + self.thresholds.reach_m(a.speed_m_s + fastest_m_s);
            for b in reaches[k + 1..].iter().take_while(|b| b.low.x <= until) {
                let gap = |axis: usize| (a.low[axis] - b.high[axis]).max(b.low[axis] - a.high[axis]).max(0.0);
                let reach_m = self.thresholds.reach_m(a.speed_m_s + b.speed_m_s);
                if gap(2) <= self.thresholds.vertical_m && gap(0).hypot(gap(1)) <= reach_m {
                    let pair = Pair::new(a.vehicle, b.vehicle);
                    self.judge_pair(pair, segments(pair.first()), segments(pair.second()), window);
                }
            }
        }
        self.violations.settle(window.to_s);
        self.undecided.settle(window.to_s);
    }

    fn judge_pair(&mut self, pair: Pair, first: &[Segment], second: &[Segment], window: Interval) {
        overlaps(first, second, |overlap| {
            let interval = Interval {
                from_s: overlap.interval.from_s.max(window.from_s),
                to_s: overlap.interval.to_s.min(window.to_s),
            };
            let is_on_ground = overlap.first.grounded == Some(true) && overlap.second.grounded == Some(true);
            if interval.from_s >= interval.to_s || is_on_ground {
                return;
            }
            let overlap = Overlap { interval, ..overlap };
            for loss in self.thresholds.losses(&overlap) {
                let [from_s, to_s] = loss.span_s;
                let [horizontal_m, vertical_m] = WellClear::smallest_m(&overlap, loss.span_s);
                self.add(WellClearLoss { pair, from_s, to_s, horizontal_m, vertical_m }, loss.is_certain);
            }
        });
    }

    /// Adds a loss. A short uncertain time that touches a certain loss of the pair is the rounding of its end.
    fn add(&mut self, new: WellClearLoss, is_certain: bool) {
        let touches = |last: &WellClearLoss| new.from_s <= last.to_s && last.from_s <= new.to_s;
        let is_short = |loss: &WellClearLoss| loss.to_s - loss.from_s < AT_AN_END_S;
        if is_certain {
            if self.undecided.open.get(&new.pair).is_some_and(|last| touches(last) && is_short(last)) {
                self.undecided.open.remove(&new.pair);
            }
            self.violations.add(new);
        } else if !(is_short(&new) && self.violations.open.get(&new.pair).is_some_and(touches)) {
            self.undecided.add(new);
        }
    }

    /// Returns the verdict. `is_whole` states that no motion was missed.
    pub(super) fn finish(self, is_whole: bool) -> WellClearOutcome {
        let (violations, violations_tally) = self.violations.finish();
        let (undecided, undecided_tally) = self.undecided.finish();
        let is_decided = is_whole && self.has_judged && undecided.is_empty();
        WellClearOutcome {
            thresholds: self.thresholds,
            status: Status::new(!violations.is_empty(), is_decided),
            violations,
            undecided,
            violations_tally,
            undecided_tally,
        }
    }
}
