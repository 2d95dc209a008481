//! Sign-off: a vehicle ends its part in a watch.
//!
//! A sign-off could hide a violation: the vehicle is not awaited any more, and nothing is known about it afterwards. So
//! it is accepted only if the bounds prove that the vehicle keeps delta from every other one at this moment, and no
//! error of the input gives doubt. A refused sign-off changes nothing, and the vehicle becomes stale. The positions up
//! to a sign-off are judged as all others.
//!
//! A pose after a sign-off shows that the vehicle had not left. Its motion since the sign-off was not judged, so this
//! pose is [`Fault::Returned`], and the time since the sign-off is NOT KNOWN.

use super::{Monitor, Vehicle, kept};
use crate::clock::STEP_S;
use crate::event::{Event, Fault};
use crate::pair::{Prediction, RelativeMotion};
use crate::settings::{LARGEST_TIME_S, TimeBase};

impl Monitor {
    /// Takes the sign-off of a vehicle with a stamp of its clock \[s\], which arrived at `arrival_s` on the caller's
    /// clock \[s\]. Returns whether the sign-off is accepted. A later pose ends it and is [`Fault::Returned`].
    ///
    /// A sign-off of a vehicle that was not heard is [`Fault::Garbage`], one that is older than the newest position
    /// is [`Fault::Reordered`], and one without a proof of delta is [`Fault::SignOff`]. A stamp with which a pose would
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
        let ignored = match (of.signed_off_s.is_some(), of.history.newest(), self.clock_of(of)) {
            (true, ..) => Some(Fault::Duplicate),
            (_, Some(fix), Some(_)) if t_s < fix.t_s => Some(Fault::Reordered),
            (_, Some(_), Some(_)) => None,
            _ => Some(Fault::SignOff),
        };
        if let Some(fault) = ignored {
            self.fault_at(fault, Some(vehicle), now_s);
            return false;
        }
        self.judge_past();
        let is_doubted = self.doubt.is_some_and(|(_, at_s)| now_s - at_s < self.settings.max_age_s);
        if is_doubted || !self.is_apart(vehicle) {
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

    /// Returns whether the bounds prove that a vehicle keeps delta from all present vehicles at the present, and it
    /// has no measured violation.
    fn is_apart(&self, vehicle: u32) -> bool {
        let Some(own) = self.fresh_prediction(vehicle as usize) else { return false };
        let others =
            (0..self.vehicles.len()).filter(|&k| k != vehicle as usize && self.vehicles[k].signed_off_s.is_none());
        self.open_violations().all(|of| !of.pair.contains(&vehicle))
            && others.into_iter().all(|k| {
                self.fresh_prediction(k)
                    .is_some_and(|other| RelativeMotion::new(&own, &other).least_m() >= self.settings.delta_m)
            })
    }

    /// Returns the prediction of a vehicle; `None` if it is stale, has a conflict, or its clock or velocity is unknown.
    fn fresh_prediction(&self, k: usize) -> Option<Prediction> {
        let of = &self.vehicles[k];
        let age_s = self.age_s(of).filter(|&age_s| age_s <= self.settings.max_age_s)?;
        self.prediction(of, age_s).filter(|_| !of.has_conflict)
    }
}
