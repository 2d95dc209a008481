//! Errors of the input, counted by kind, and the queue of events.

use super::{MOST_EVENTS, Monitor};
use crate::event::{Event, Fault};
use crate::settings::TimeBase;

/// Smallest time between two events of one fault \[s\].
const FAULT_PERIOD_S: f64 = 1.0;

/// Number of faults of one kind.
#[derive(Clone, Copy, Default)]
pub(super) struct FaultCount {
    pub(super) total: u64,
    /// Number since the last event.
    waiting: u64,
    /// Vehicle of the last fault.
    vehicle: Option<u32>,
    /// Time of the last event \[s\].
    pub(super) reported_s: Option<f64>,
}

impl Monitor {
    /// Counts an error of the input at an arrival time \[s\].
    pub fn fault(&mut self, fault: Fault, vehicle: Option<u32>, arrival_s: f64) {
        let at_s = match self.settings.time_base {
            TimeBase::Arrival => self.time_of_arrival(arrival_s),
            TimeBase::Stamps if self.now_s.is_finite() => self.now_s,
            TimeBase::Stamps => 0.0,
        };
        self.fault_at(fault, vehicle, at_s.max(self.now_s));
    }

    /// Counts messages that were dropped up to an arrival time \[s\].
    pub(crate) fn dropped(&mut self, messages: u64, arrival_s: f64) {
        let count = &mut self.faults[Fault::Dropped as usize];
        // `fault` counts the last one.
        count.total += messages - 1;
        count.waiting += messages - 1;
        self.fault(Fault::Dropped, None, arrival_s);
    }

    pub(super) fn fault_at(&mut self, fault: Fault, vehicle: Option<u32>, at_s: f64) {
        let count = &mut self.faults[fault as usize];
        count.total += 1;
        count.waiting += 1;
        count.vehicle = vehicle;
        if fault.gives_doubt() {
            self.doubt = Some((fault, at_s));
        }
        if count.reported_s.is_none() {
            self.report_faults_at(at_s);
        }
    }

    pub(super) fn report_faults(&mut self) {
        self.report_faults_at(self.now_s);
    }

    /// Emits an event for each kind of fault that occurred, at most one in each period.
    fn report_faults_at(&mut self, at_s: f64) {
        for fault in Fault::ALL {
            let count = &mut self.faults[fault as usize];
            let is_due = count.reported_s.is_none_or(|last_s| at_s - last_s >= FAULT_PERIOD_S);
            if count.waiting > 0 && is_due {
                let refusal = self.refusal.filter(|_| fault == Fault::SignOff);
                let event = Event::Fault { fault, count: count.waiting, vehicle: count.vehicle, refusal, at_s };
                (count.waiting, count.reported_s) = (0, Some(at_s));
                self.emit(event);
            }
        }
    }

    pub(super) fn emit(&mut self, event: Event) {
        if self.events.len() < MOST_EVENTS {
            self.events.push(event);
        } else {
            self.suppressed += 1;
        }
    }
}
