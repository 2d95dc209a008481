//! Judgement of the past: measured violations between the positions that were sent.

use nalgebra::Vector3;

use super::Monitor;
use crate::ahead;
use crate::event::{Event, Fault, Pair};
use crate::history::Fix;
use tautline_audit::sweep;

/// Box around the motion of a vehicle since the last judgement \[m\].
#[derive(Clone, Copy)]
pub(super) struct SweptBox {
    vehicle: u32,
    low_m: Vector3<f64>,
    high_m: Vector3<f64>,
}

impl Monitor {
    /// Judges all pairs over the time between the last judgement and the newest positions.
    ///
    /// The motion between two positions of a vehicle is straight. A gap longer than the largest age is not judged,
    /// because the vehicle was stale or had signed off within the gap. Both make the time of the gap UNDECIDED.
    pub(super) fn judge_past(&mut self) {
        // Time until which every vehicle with a new position was judged.
        let mut floor_s = f64::INFINITY;
        for of in &self.vehicles {
            let (Some(newest), Some(clock)) = (of.history.newest(), self.clock_of(of)) else { continue };
            let mut judged_t_s = of.judged_t_s.unwrap_or(of.history.at(0).t_s);
            // A gap is not judged.
            let next = (of.history.up_to(judged_t_s) + 1).min(of.history.len() - 1);
            if of.history.at(next).t_s - judged_t_s > self.settings.max_age_s.value {
                judged_t_s = of.history.at(next).t_s;
            }
            if newest.t_s > judged_t_s {
                floor_s = floor_s.min(clock.time_of(judged_t_s));
            }
        }
        if floor_s == f64::INFINITY {
            return;
        }
        self.judgement += 1;
        self.boxes.clear();
        let mut lost = None;
        for (k, of) in self.vehicles.iter().enumerate() {
            let (Some(newest), Some(clock)) = (of.history.newest(), self.clock_of(of)) else { continue };
            if of.signed_off_s.is_some() && clock.time_of(newest.t_s) <= floor_s {
                continue;
            }
            let (mut low_m, mut high_m) = (newest.position_m, newest.position_m);
            for step in (0..of.history.len()).rev() {
                let fix = of.history.at(step);
                (low_m, high_m) = (low_m.inf(&fix.position_m), high_m.sup(&fix.position_m));
                if clock.time_of(fix.t_s) <= floor_s {
                    break;
                }
            }
            if of.history.is_wrapped() && clock.time_of(of.history.at(0).t_s) > floor_s {
                lost = lost.or(u32::try_from(k).ok());
            }
            // The box of each vehicle is wider by half of the limit.
            let room_m = Vector3::repeat(self.settings.delta_m / 2.0 * (1.0 + 1e-9) + 1e-6);
            let vehicle = u32::try_from(k).unwrap_or(u32::MAX);
            self.boxes.push(SweptBox { vehicle, low_m: low_m - room_m, high_m: high_m + room_m });
        }
        if let Some(vehicle) = lost {
            self.fault_at(Fault::NotJudged, Some(vehicle), self.now_s);
        }
        let axis = ahead::widest_axis(self.boxes.iter().map(|of| of.low_m));
        self.boxes.sort_unstable_by(|a, b| a.low_m[axis].total_cmp(&b.low_m[axis]));
        for a in 0..self.boxes.len() {
            let first = self.boxes[a];
            for b in a + 1..self.boxes.len() {
                let second = self.boxes[b];
                if second.low_m[axis] > first.high_m[axis] {
                    break;
                }
                if (0..3).all(|k| first.low_m[k] <= second.high_m[k] && second.low_m[k] <= first.high_m[k]) {
                    let (i, j) = (first.vehicle.min(second.vehicle), first.vehicle.max(second.vehicle));
                    self.judge_pair([i, j]);
                }
            }
        }
        while let Some(pair) = self.violations.unexamined(self.judgement) {
            self.judge_pair(pair);
            self.violations.examined(pair, self.judgement);
        }
        while let Some(pair) = self.past_pair() {
            if let Some(of) = self.violations.close(|of| of == pair) {
                self.emit(Event::Ended(of));
            }
        }
        for of in &mut self.vehicles {
            of.judged_t_s = of.history.newest().map(|fix| fix.t_s);
        }
    }

    /// Returns the pair of a present violation that has no more time to judge.
    fn past_pair(&self) -> Option<Pair> {
        self.violations.open().map(|of| of.pair).find(|&pair| self.is_past(pair))
    }

    /// Returns whether a vehicle of a pair signed off and the other one has positions up to this moment, so that the
    /// pair has no more time to judge.
    fn is_past(&self, pair: Pair) -> bool {
        let of = pair.map(|k| &self.vehicles[k as usize]);
        let newest_s = of.map(|of| Some(self.clock_of(of)?.time_of(of.history.newest()?.t_s)));
        let [Some(first_s), Some(second_s)] = newest_s else { return false };
        (of[0].signed_off_s.is_some() && first_s <= second_s) || (of[1].signed_off_s.is_some() && second_s <= first_s)
    }

    /// Judges a pair over its time since the last judgement.
    fn judge_pair(&mut self, pair: Pair) {
        let number = self.judgement;
        self.violations.examined(pair, number);
        let of = pair.map(|k| &self.vehicles[k as usize]);
        let [Some(clock_a), Some(clock_b)] = of.map(|of| self.clock_of(of)) else { return };
        let clocks = [clock_a, clock_b];
        let first_s = [0, 1].map(|k| clocks[k].time_of(of[k].history.at(0).t_s));
        let newest_s = [0, 1].map(|k| clocks[k].time_of(of[k].history.at(of[k].history.len() - 1).t_s));
        let judged_s = [0, 1].map(|k| of[k].judged_t_s.map_or(first_s[k], |t_s| clocks[k].time_of(t_s)));
        let from_s = judged_s[0].min(judged_s[1]).max(first_s[0]).max(first_s[1]);
        let to_s = newest_s[0].min(newest_s[1]);
        let mut at = [0, 1].map(|k| of[k].history.up_to(from_s - clocks[k].time_of(0.0)));
        let mut time_s = from_s;
        while time_s < to_s {
            let of = pair.map(|k| &self.vehicles[k as usize].history);
            let mut ends = [(Fix::default(), Fix::default()); 2];
            for k in 0..2 {
                while at[k] + 2 < of[k].len() && clocks[k].time_of(of[k].at(at[k] + 1).t_s) <= time_s {
                    at[k] += 1;
                }
                ends[k] = (of[k].at(at[k]), of[k].at(at[k] + 1));
            }
            let end_s = [0, 1].into_iter().fold(to_s, |end_s, k| end_s.min(clocks[k].time_of(ends[k].1.t_s)));
            if end_s <= time_s {
                break;
            }
            let is_gap = ends.iter().any(|(from, to)| to.t_s - from.t_s > self.settings.max_age_s.value);
            if !is_gap {
                let apart = |at_s: f64| {
                    let place = |k: usize| {
                        let (from, to) = ends[k];
                        let (from_s, to_s) = (clocks[k].time_of(from.t_s), clocks[k].time_of(to.t_s));
                        let share = ((at_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
                        from.position_m + (to.position_m - from.position_m) * share
                    };
                    place(0) - place(1)
                };
                let limit_m = self.settings.delta_m;
                let found = sweep(apart(time_s), apart(end_s), limit_m);
                let events = self.violations.take(pair, [time_s, end_s], &found, limit_m, number);
                events.into_iter().flatten().for_each(|event| self.emit(event));
            }
            time_s = end_s;
        }
    }
}
