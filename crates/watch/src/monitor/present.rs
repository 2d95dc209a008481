//! Judgement of the present: CLEAR, UNDECIDED or VIOLATION, with its reason.

use super::{Monitor, Vehicle};
use crate::clock::FALL_RATE;
use crate::event::{Assessment, Event, Fault, Pair, PairTime, Reason, State};
use crate::pair::Prediction;
use crate::settings::{Expected, TimeBase};
use crate::velocity::Ball;

impl Monitor {
    /// Judges the present and the past since the last call. `arrival_s` is the present on the caller's clock \[s\];
    /// it is ignored with [`TimeBase::Stamps`].
    pub fn assess(&mut self, arrival_s: f64) -> Assessment {
        if self.settings.time_base == TimeBase::Arrival {
            self.now_s = self.now_s.max(self.time_of_arrival(arrival_s));
        }
        let now_s = self.now_s;
        self.judge_past();
        let present = self.vehicles.iter().filter(|of| of.signed_off_s.is_none()).count();
        let mut reason = None;
        let mut note = |of: Reason| reason = reason.or(Some(of));
        match &self.settings.expected {
            Expected::Count(count) if self.names.len() < *count => note(Reason::Missing([self.names.len(), *count])),
            Expected::Names(names) if !self.missing.is_empty() => {
                note(Reason::Missing([names.len() - self.missing.len(), names.len()]));
            }
            _ if self.names.len() < 2 => note(Reason::TooFew(self.names.len())),
            _ => {}
        }
        let mut of_two = self.vehicles.iter().zip(0_u32..).filter(|(of, _)| of.has_two_streams);
        if let Some((_, vehicle)) = of_two.find(|(of, _)| of.signed_off_s.is_none()) {
            note(Reason::Fault(Fault::TwoStreams, Some(vehicle)));
        }
        if let Some(doubt) = self.recent_fault() {
            note(doubt);
        }
        if present < 2 && present < self.vehicles.len() {
            note(Reason::SignedOff(present));
        }
        self.ahead.clear();
        for k in 0..self.vehicles.len() {
            let vehicle = u32::try_from(k).unwrap_or(u32::MAX);
            let of = &self.vehicles[k];
            if of.signed_off_s.is_some() {
                continue;
            }
            let was_stale = of.is_stale;
            match self.fresh_prediction(vehicle) {
                Ok(prediction) => {
                    if of.has_conflict {
                        note(Reason::Fault(Fault::Conflict, Some(vehicle)));
                    }
                    self.ahead.push(vehicle, prediction);
                }
                Err(reason) => note(reason),
            }
            let Some(age_s) = self.age_s(of) else { continue };
            let is_stale = age_s > self.settings.max_age_s.value;
            self.vehicles[k].is_stale = is_stale;
            match (was_stale, is_stale) {
                (false, true) => self.emit(Event::Stale { vehicle, age_s, at_s: now_s }),
                (true, false) => self.emit(Event::Back { vehicle, signed_off_s: None, at_s: now_s }),
                _ => {}
            }
        }
        if let Some(conflict) = self.plan_conflict() {
            note(Reason::PlanConflict(conflict));
        }
        self.report_faults();
        let found = self.ahead.search(&self.settings);
        let measured = self.violations.worst();
        let nearest = found.closest.filter(|near| near.nominal_m < self.settings.delta_m);
        let state = match (nearest, measured, reason, found.uncertain) {
            (Some(near), ..) => State::Violation(near.pair, near.nominal_m),
            (None, Some(of), ..) => State::Violation(of.pair, of.min_m),
            (None, None, Some(reason), _) => State::Undecided(reason),
            (None, None, None, Some((pair, least_m))) => State::Undecided(Reason::Uncertain(pair, least_m)),
            (None, None, None, None) => State::Clear,
        };
        let time = |(pair, in_s): (Pair, f64)| PairTime { pair, at_s: now_s + in_s };
        let clear = found.clear.filter(|_| state == State::Clear);
        let deviations = self.vehicles.iter().enumerate().filter(|(_, of)| !of.is_stale && of.signed_off_s.is_none());
        Assessment {
            now_s,
            state,
            heard: self.names.len(),
            signed_off: self.vehicles.len() - present,
            closest: found.closest,
            clear_until: clear.map(time),
            is_clear_to_horizon: clear.is_some_and(|(_, in_s)| in_s >= self.settings.horizon_s),
            nominal_violation: found.nominal_violation.map(time),
            last_brake: found.last_brake.map(time),
            deviation: deviations
                .filter_map(|(k, of)| Some((u32::try_from(k).ok()?, of.deviation_m?)))
                .max_by(|a, b| a.1.total_cmp(&b.1)),
        }
    }

    /// Ends the watch: judges the past and ends the measured violations that are present.
    pub fn finish(&mut self, arrival_s: f64) -> Assessment {
        let last = self.assess(arrival_s);
        while let Some(of) = self.violations.close(|_| true) {
            self.emit(Event::Ended(of));
        }
        for count in &mut self.faults {
            count.reported_s = None;
        }
        self.report_faults();
        last
    }

    /// Returns the last error of the input, if it is less than the largest age ago.
    pub(super) fn recent_fault(&self) -> Option<Reason> {
        let doubt = self.doubt.filter(|(_, at_s)| self.now_s - at_s < self.settings.max_age_s.value);
        doubt.map(|(fault, _)| Reason::Fault(fault, None))
    }

    /// Returns the prediction of a vehicle, unless it is stale, or its clock or velocity is unknown.
    pub(super) fn fresh_prediction(&self, vehicle: u32) -> Result<Prediction, Reason> {
        let of = &self.vehicles[vehicle as usize];
        let age_s = self.age_s(of).ok_or(Reason::Fault(Fault::ClockStep, Some(vehicle)))?;
        if age_s > self.settings.max_age_s.value {
            return Err(Reason::Stale(vehicle, age_s));
        }
        let is_bounded = of.position_error_m.is_some();
        let unknown = if is_bounded { Reason::VelocityUnknown } else { Reason::ErrorUnknown };
        self.prediction(of, age_s).ok_or(unknown(vehicle))
    }

    /// Returns the prediction of a vehicle with an age \[s\]; `None` if its velocity is not known.
    ///
    /// With [`TimeBase::Arrival`] stamps may run faster than arrivals by the rate r = [`FALL_RATE`]. During the age a
    /// the vehicle then moves for up to (1 + r) a, so its distance from `p + v a` is at most
    /// `eps + (e (1 + r) + |v| r) a + A (1 + r)^2 a^2 / 2`. The same holds for the time ahead.
    fn prediction(&self, of: &Vehicle, age_s: f64) -> Option<Prediction> {
        let Ball { centre: velocity, radius: error_m_s } = of.velocity.velocity()?;
        let (fix, eps) = of.history.newest().zip(of.position_error_m)?;
        let accel = self.settings.accel_m_s2.value;
        let rate = match self.settings.time_base {
            TimeBase::Arrival => FALL_RATE,
            TimeBase::Stamps => 0.0,
        };
        let error_m_s = error_m_s * (1.0 + rate) + velocity.norm() * rate;
        let accel = accel * (1.0 + rate) * (1.0 + rate);
        Some(Prediction::new(fix.position_m, velocity, age_s, eps, error_m_s, accel))
    }
}
