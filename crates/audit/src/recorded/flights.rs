//! Recorded flights beside published plans: their segments, and the distance of each flight from its plans.

use nalgebra::Vector3;

use super::outcome::Rates;
use super::plan_sweep::Chord;
use super::settings::{Interpolation, RecordedError, Settings};
use super::vehicle::Vehicle;
use crate::segment::Segment;
use crate::sweep::Interval;
use tautline_core::track::Item;

/// Recorded flights of all vehicles, in memory.
#[derive(Clone, Debug)]
pub(super) struct Flights {
    settings: Settings,
    rates: Option<Rates>,
    vehicles: Vec<Vehicle>,
}

/// Part of a flight in a window.
pub(super) struct FlightPart {
    pub(super) segments: Vec<Segment>,
    pub(super) chords: Vec<Chord>,
    /// Whether the motion is unknown during a part of the window in which the vehicle is present.
    pub(super) has_gap: bool,
}

impl Flights {
    /// Creates flights with these settings, without the ends of the judged time.
    pub(super) fn new(settings: &Settings) -> Self {
        let settings = Settings { from_s: None, until_s: None, ..settings.clone() };
        Self { settings, rates: None, vehicles: Vec::new() }
    }

    /// Returns whether the smallest distance of a violation is known, not only an upper bound of it.
    pub(super) fn are_exact(&self) -> bool {
        self.settings.motion != Some(Interpolation::Bounded)
    }

    /// Adds the next items of vehicles with these names.
    pub(super) fn push(&mut self, names: &[String], items: &[Item]) -> Result<(), RecordedError> {
        Rates::add_vehicles(&mut self.rates, &mut self.vehicles, &self.settings, names, items);
        for item in items {
            let index = item.vehicle();
            let vehicle = self.vehicles.get_mut(index).ok_or(RecordedError::Unnamed { vehicle: index })?;
            if vehicle.is_selected {
                vehicle.take(item)?;
            }
        }
        Ok(())
    }

    pub(super) fn count(&self) -> usize {
        self.vehicles.len()
    }

    /// Returns whether samples of a vehicle contradict the assumed bounds on its acceleration.
    pub(super) fn has_contradiction(&self) -> bool {
        self.vehicles.iter().any(|vehicle| vehicle.contradiction.is_some())
    }

    pub(super) fn radius_m(&self, vehicle: usize) -> f64 {
        self.vehicles[vehicle].radius_m.unwrap_or(0.0)
    }

    pub(super) fn name(&self, vehicle: usize) -> String {
        self.vehicles.get(vehicle).map(|vehicle| vehicle.name.clone()).unwrap_or_default()
    }

    /// Returns the last instant of a flight \[s\]; `None` if the vehicle is not seen.
    pub(super) fn end_s(&self, vehicle: usize) -> Option<f64> {
        self.vehicles.get(vehicle)?.segments.last().map(|last| last.to_s)
    }

    /// Returns the position at an instant, after a jump; `None` if it is not known.
    pub(super) fn position(&self, vehicle: usize, time_s: f64) -> Option<Vector3<f64>> {
        let segments = &self.vehicles.get(vehicle)?.segments;
        let begun = segments.partition_point(|segment| segment.from_s <= time_s);
        let segment = segments.get(begun.checked_sub(1)?).filter(|segment| time_s <= segment.to_s)?;
        Some(if time_s < segment.to_s { segment.position(time_s) } else { segment.to })
    }

    /// Returns the part of a flight in a window; `None` if the vehicle is not present.
    pub(super) fn part(&self, vehicle: usize, window: Interval) -> Option<FlightPart> {
        let all = &self.vehicles.get(vehicle)?.segments;
        let start = all.partition_point(|segment| segment.to_s < window.from_s);
        let end = all.partition_point(|segment| segment.from_s <= window.to_s).max(start);
        let (before, within, after) = (&all[..start], &all[start..end], &all[end..]);
        if window.from_s > window.to_s || within.is_empty() && (before.is_empty() || after.is_empty()) {
            return None;
        }
        let from_s = within.first().map_or(f64::INFINITY, |first| first.from_s);
        let to_s = within.last().map_or(f64::NEG_INFINITY, |last| last.to_s);
        let has_gap = !before.is_empty() && from_s > window.from_s
            || !after.is_empty() && to_s < window.to_s
            || within.windows(2).any(|pair| pair[1].from_s > pair[0].to_s);
        let segments: Vec<_> = within.iter().filter_map(|segment| segment.clipped(window)).collect();
        let chords = segments.iter().map(Chord::new).collect();
        Some(FlightPart { segments, chords, has_gap })
    }

    /// Returns the instants of the recorded positions of a vehicle in a window \[s\].
    pub(super) fn instants_s(&self, vehicle: usize, window: Interval) -> impl Iterator<Item = f64> + '_ {
        let all = self.vehicles.get(vehicle).map_or(&[][..], |vehicle| &vehicle.segments);
        let start = all.partition_point(|segment| segment.to_s < window.from_s);
        let segments = all[start..].iter().take_while(move |segment| segment.from_s <= window.to_s);
        // The ground may split the motion between two positions.
        let ends = segments.flat_map(|segment| match segment.curve() {
            Some(curve) => [curve.from_s, curve.to_s],
            None => [segment.line().from_s, segment.line().to_s],
        });
        ends.filter(move |time_s| (window.from_s..=window.to_s).contains(time_s))
    }

    /// Returns the distance of two positions \[m\].
    pub(super) fn distance_m(&self, first: Vector3<f64>, second: Vector3<f64>) -> f64 {
        let apart = first - second;
        // With an ellipsoid, positions are divided by its axes.
        self.settings.ellipsoid_m.map_or(apart, |axes| apart.component_mul(&axes)).norm()
    }
}
