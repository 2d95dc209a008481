//! Which vehicles are not seen over the whole window.

use super::outcome::Absence;
use super::settings::Settings;
use super::vehicle::Vehicle;
use crate::sweep::Interval;

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
