//! Poses and stamps of the monitor: clocks, bounds, streams and the plan.

use nalgebra::Vector3;

use super::{Monitor, Pose, Taken, kept};
use crate::clock::{STEP_S, SourceClock};
use crate::event::{Event, Fault};
use crate::history::Fix;
use crate::settings::{ClockScope, LARGEST_POSITION_M, LARGEST_SPEED_M_S, LARGEST_TIME_S, TimeBase};
use crate::velocity::{Bounds, Reading};

impl Monitor {
    /// Takes a pose that arrived at `arrival_s` on the caller's clock \[s\], which must not go back. Returns the
    /// vehicle and the time of the monitor of a used pose, `None` for an ignored pose.
    pub fn take(&mut self, pose: &Pose<'_>, arrival_s: f64) -> Option<Taken> {
        let within = |of: &Vector3<f64>, most: f64| of.iter().all(|x| x.abs() <= most);
        let is_readable = pose.t_s.abs() <= LARGEST_TIME_S
            && within(&pose.position_m, LARGEST_POSITION_M)
            && pose.accuracy_m.is_none_or(|accuracy_m| (0.0..=LARGEST_POSITION_M).contains(&accuracy_m))
            && pose.velocity_m_s.is_none_or(|velocity| within(&velocity, LARGEST_SPEED_M_S));
        if !is_readable {
            self.fault(Fault::OutOfRange, None, arrival_s);
            return None;
        }
        let scope = self.settings.clock_scope();
        let is_first = self.vehicles.is_empty() && scope == ClockScope::Common;
        if is_first {
            // Times of the monitor are those of the first source from here on.
            self.shift_s = pose.t_s - arrival_s;
            self.now_s = f64::NEG_INFINITY;
        }
        let Some(vehicle) = self.vehicle(pose.id) else {
            self.fault(Fault::TooManyVehicles, None, arrival_s);
            return None;
        };
        let (k, of) = (vehicle as usize, &self.vehicles[vehicle as usize]);
        let own = if scope == ClockScope::Common { self.clock } else { of.clock };
        let newest = of.history.newest();
        let arrival_s = match (self.settings.time_base, own) {
            (TimeBase::Arrival, _) => arrival_s + self.shift_s,
            (TimeBase::Stamps, Some(clock)) => clock.time_of(pose.t_s),
            (TimeBase::Stamps, None) => pose.t_s,
        };
        self.now_s = self.now_s.max(arrival_s);
        let now_s = self.now_s;
        if is_first {
            self.faults.iter_mut().for_each(|count| count.reported_s = None);
            self.doubt = self.doubt.map(|(fault, _)| (fault, now_s));
        }
        let mut clock = own.unwrap_or_else(|| SourceClock::new(pose.t_s, now_s, scope == ClockScope::Common));
        let is_same_clock = of.epoch == clock.epoch();
        let back_s = newest.filter(|_| is_same_clock).map_or(0.0, |fix| fix.t_s - pose.t_s);
        let jumps = self.settings.time_base == TimeBase::Arrival
            && own.is_some()
            && clock.is_ahead(pose.t_s, now_s, self.settings.largest_step_s());
        let steps = back_s > STEP_S || jumps;
        if steps {
            clock.step(pose.t_s, now_s);
        }
        if !steps
            && back_s >= 0.0
            && is_same_clock
            && let Some(fix) = newest
        {
            if back_s > 0.0 {
                self.take_late(vehicle, pose);
            } else if fix.position_m == pose.position_m {
                self.fault_at(Fault::Duplicate, Some(vehicle), now_s);
            } else {
                self.vehicles[k].has_conflict = true;
                self.fault_at(Fault::Conflict, Some(vehicle), now_s);
            }
            return None;
        }
        let is_fast = clock.take(pose.t_s, now_s);
        if steps || is_fast {
            self.fault_at(Fault::ClockStep, Some(vehicle), now_s);
        }
        if scope == ClockScope::Common {
            self.clock = Some(clock);
        } else {
            clock.settle();
            self.vehicles[k].clock = Some(clock);
        }
        if newest.is_none() {
            self.emit(Event::Heard { vehicle, at_s: now_s });
        }
        if self.vehicles[k].epoch != clock.epoch() {
            self.forget(vehicle, clock.epoch());
        }
        if self.vehicles[k].streams.take(pose.t_s) {
            self.find_two_streams(vehicle);
        }
        self.enclose_velocity(vehicle, pose);
        let of = &mut self.vehicles[k];
        of.history.push(Fix { t_s: pose.t_s, position_m: pose.position_m });
        of.has_conflict = false;
        let signed_off_s = of.signed_off_s.take();
        let at_s = clock.time_of(pose.t_s);
        // The offset of a clock may shrink by more than the time between two stamps.
        let time_s = of.taken_s.map_or(at_s, |last_s| at_s.max(last_s.next_up()));
        of.taken_s = Some(time_s);
        self.compare_with_plan(vehicle, at_s, pose.position_m);
        if signed_off_s.is_some() {
            self.fault_at(Fault::Returned, Some(vehicle), now_s);
            self.emit(Event::Back { vehicle, signed_off_s, at_s: now_s });
        }
        Some(Taken { vehicle, time_s })
    }

    /// Moves the present to a stamp of the common clock \[s\], with [`TimeBase::Stamps`]. Returns the time by which it
    /// moves \[s\]; a stamp of the past moves nothing.
    pub fn advance(&mut self, t_s: f64) -> f64 {
        let Some(clock) = self.clock.filter(|_| t_s.abs() <= LARGEST_TIME_S) else { return 0.0 };
        let (before_s, now_s) = (self.now_s, self.now_s.max(clock.time_of(t_s)));
        self.now_s = now_s;
        now_s - before_s
    }

    /// Returns how far a stamp of the common clock lies after the present \[s\]; `None` before the first pose.
    #[must_use]
    pub fn is_ahead_s(&self, t_s: f64) -> Option<f64> {
        let clock = self.clock.filter(|_| t_s.abs() <= LARGEST_TIME_S)?;
        Some(clock.time_of(t_s) - self.now_s)
    }

    /// Drops the history of a vehicle after a step of its clock.
    fn forget(&mut self, vehicle: u32, epoch: u32) {
        let of = &mut self.vehicles[vehicle as usize];
        of.history.clear();
        of.velocity.clear();
        (of.epoch, of.judged_t_s) = (epoch, None);
        while let Some(of) = self.violations.close(|pair| pair.contains(&vehicle)) {
            self.emit(Event::Ended(of));
        }
    }

    /// Takes a pose that is older than the newest one of its vehicle.
    fn take_late(&mut self, vehicle: u32, pose: &Pose<'_>) {
        let now_s = self.now_s;
        self.fault_at(Fault::Reordered, Some(vehicle), now_s);
        let own = &mut self.vehicles[vehicle as usize];
        let late = own.history.late(pose.t_s);
        // A copy by another link is no evidence of a second vehicle.
        let is_copy = late.position_m == Some(pose.position_m);
        if !is_copy && own.streams.take_late(late.gap_s, late.least_gap_s, now_s) {
            self.find_two_streams(vehicle);
        }
    }

    /// Notes that a name carries two streams, which arrived at a time on the caller's clock \[s\]. A name that was not
    /// heard is ignored.
    pub fn two_streams(&mut self, id: &str, arrival_s: f64) {
        if let Ok(vehicle) = self.find(kept(id)) {
            if self.settings.time_base == TimeBase::Arrival {
                self.now_s = self.now_s.max(self.time_of_arrival(arrival_s));
            }
            self.find_two_streams(vehicle);
        }
    }

    fn find_two_streams(&mut self, vehicle: u32) {
        let own = &mut self.vehicles[vehicle as usize];
        if !std::mem::replace(&mut own.has_two_streams, true) {
            self.fault_at(Fault::TwoStreams, Some(vehicle), self.now_s);
        }
    }

    /// Encloses the velocity of a vehicle at a pose, and reports a contradiction to the bounds.
    fn enclose_velocity(&mut self, vehicle: u32, pose: &Pose<'_>) {
        let error_m = self.settings.error_of_position_m(pose.accuracy_m);
        let bounds = Bounds {
            accel_m_s2: self.settings.accel_m_s2.value,
            velocity_error_m_s: self.settings.velocity_error_m_s.value,
        };
        let own = &mut self.vehicles[vehicle as usize];
        own.position_error_m = error_m;
        let fault = if let Some(position_error_m) = error_m {
            let Pose { t_s, position_m, velocity_m_s, .. } = *pose;
            own.velocity.take(Reading { t_s, position_m, position_error_m, velocity_m_s }, bounds)
        } else {
            own.velocity.clear();
            None
        };
        if let Some(fault) = fault {
            self.fault_at(fault, Some(vehicle), self.now_s);
        }
        if pose.accuracy_m.zip(error_m).is_some_and(|(accuracy_m, error_m)| error_m < accuracy_m) {
            self.fault_at(Fault::Inaccurate, Some(vehicle), self.now_s);
        }
    }

    fn compare_with_plan(&mut self, vehicle: u32, time_s: f64, position_m: Vector3<f64>) {
        let of = &mut self.vehicles[vehicle as usize];
        let planned = of.planned.and_then(|k| self.plan.position_m(k, time_s));
        of.deviation_m = planned.map(|planned| (position_m - planned).norm());
        self.compared += u64::from(planned.is_some());
        let was_outside = of.is_off_plan;
        of.is_off_plan = of.deviation_m.is_some_and(|deviation| deviation > self.settings.tube_m);
        let (is_outside, deviation_m) = (of.is_off_plan, of.deviation_m.unwrap_or(0.0));
        if is_outside != was_outside {
            self.emit(Event::Plan { vehicle, deviation_m, is_outside, at_s: self.now_s });
        }
    }
}
