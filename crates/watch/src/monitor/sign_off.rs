//! Sign-off: a vehicle ends its part in a watch.
//!
//! A sign-off could hide a violation: the vehicle is not awaited any more, and nothing is known about it afterwards. So
//! it is accepted only if the bounds prove that the vehicle keeps delta from every other one at this moment, and no
//! error of the input gives doubt. A refused sign-off changes nothing, and the vehicle becomes stale. The positions up
//! to a sign-off are judged as all others.
//!
//! A pose after a sign-off shows that the vehicle had not left. Its motion since the sign-off was not judged, so this
//! pose is [`Fault::Returned`], and the time since the sign-off is UNDECIDED.

use super::{Monitor, Vehicle, kept};
use crate::clock::STEP_S;
use crate::event::{Event, Fault, Reason};
use crate::pair::RelativeMotion;
use crate::settings::{LARGEST_TIME_S, TimeBase};

impl Monitor {
    /// Takes the sign-off of a vehicle with a stamp of its clock \[s\], which arrived at `arrival_s` on the caller's
    /// clock \[s\]. Returns whether the sign-off is accepted. A later pose ends it and is [`Fault::Returned`].
    ///
    /// A sign-off of a vehicle that was not heard is [`Fault::Garbage`]. One that is older than the newest position,
    /// repeated or without a proof of delta is [`Fault::SignOff`] with its [`Reason`]. A stamp with which a pose would
    /// be a step of the clock, or too fast, is [`Fault::ClockStep`]; the clock stays as it is.
    pub fn sign_off(&mut self, id: &str, t_s: f64, arrival_s: f64) -> bool {
        if t_s.is_nan() || t_s.abs() > LARGEST_TIME_S {
            self.fault(Fault::OutOfRange, None, arrival_s);
            return false;
        }
        let Ok(vehicle) = self.find(kept(id)) else {
            self.fault(Fault::Garbage, None, arrival_s);
            return false;
        };
        if self.settings.time_base == TimeBase::Arrival {
            self.now_s = self.now_s.max(self.time_of_arrival(arrival_s));
        } else {
            self.advance(t_s);
        }
        let now_s = self.now_s;
        let of = &self.vehicles[vehicle as usize];
        if self.steps_clock(of, t_s) {
            self.fault_at(Fault::ClockStep, Some(vehicle), now_s);
            return false;
        }
        let newest_s = of.history.newest().map(|fix| fix.t_s);
        let refusal = match (of.signed_off_s, newest_s, self.clock_of(of)) {
            (Some(_), Some(newest_s), _) => Some(Reason::Repeated([t_s, newest_s])),
            (_, Some(newest_s), Some(_)) if t_s < newest_s => Some(Reason::Late([t_s, newest_s])),
            (_, Some(_), Some(_)) => {
                self.judge_past();
                self.unproved(vehicle)
            }
            _ => Some(Reason::Fault(Fault::ClockStep, Some(vehicle))),
        };
        if refusal.is_some() {
            self.refusal = refusal;
            self.fault_at(Fault::SignOff, Some(vehicle), now_s);
            return false;
        }
        let of = &mut self.vehicles[vehicle as usize];
        (of.signed_off_s, of.is_stale, of.deviation_m) = (Some(now_s), false, None);
        self.emit(Event::SignedOff { vehicle, at_s: now_s });
        true
    }

    /// Returns whether a pose of a vehicle with this stamp \[s\] would be a step of its clock, or too fast, at present.
    fn steps_clock(&self, of: &Vehicle, t_s: f64) -> bool {
        let (Some(mut clock), Some(newest)) = (self.clock_of(of), of.history.newest()) else { return false };
        let is_ahead = self.settings.time_base == TimeBase::Arrival
            && (clock.is_ahead(t_s, self.now_s, self.settings.largest_step_s()) || clock.take(t_s, self.now_s));
        is_ahead || newest.t_s - t_s > STEP_S
    }

    /// Returns why the bounds do not prove that a vehicle keeps delta from all present vehicles at the present; `None`
    /// if they do.
    fn unproved(&self, vehicle: u32) -> Option<Reason> {
        if let Some(doubt) = self.recent_fault() {
            return Some(doubt);
        }
        if let Some(of) = self.open_violations().find(|of| of.pair.contains(&vehicle)) {
            return Some(Reason::Violation(of.pair));
        }
        let certain = |k: u32| {
            let of = &self.vehicles[k as usize];
            let fault = |fault| Err(Reason::Fault(fault, Some(k)));
            match () {
                () if of.has_two_streams => fault(Fault::TwoStreams),
                () if of.has_conflict => fault(Fault::Conflict),
                () => self.fresh_prediction(k),
            }
        };
        let own = match certain(vehicle) {
            Ok(own) => own,
            Err(reason) => return Some(reason),
        };
        let others = self.vehicles.iter().zip(0_u32..).filter(|(of, k)| *k != vehicle && of.signed_off_s.is_none());
        others.into_iter().find_map(|(_, k)| match certain(k) {
            Err(reason) => Some(reason),
            Ok(other) => {
                let least_m = RelativeMotion::new(&own, &other).least_m();
                let keeps_delta = least_m >= self.settings.delta_m;
                (!keeps_delta).then(|| Reason::Uncertain([vehicle.min(k), vehicle.max(k)], least_m))
            }
        })
    }
}
