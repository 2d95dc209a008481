//! What a program that shares no code with this one needs to confirm a verdict by exact arithmetic.
//!
//! `python/tautline/check_proof.py` is that program. The claim names the smallest separation, its pair and its time. Each
//! window holds a box around every vehicle, so that only pairs whose boxes are near need a closer look.

use serde::Serialize;

use super::outcome::Outcome;
use super::settings::{RecordedError, Settings};
use super::vehicle::Vehicle;
use super::window::within;
use crate::pair_sweep::overlaps;
use crate::segment::Segment;
use crate::sweep::Interval;
use tautline_core::track::Item;

/// Segments of the vehicle that has most of them in a window.
const SEGMENTS: usize = 8;

/// The smallest separation of straight lines between samples, and boxes that show that no other pair comes closer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proof {
    /// The largest double that the separation of no pair falls below \[m\].
    pub separation_m: f64,
    /// Names of the two vehicles that come as close as that.
    pub pair: [String; 2],
    /// The largest double that the first time of it, between two samples, is not before \[s\].
    pub time_s: f64,
    /// Windows that cover the recording, in order of time.
    #[serde(skip)]
    pub windows: Vec<ProofWindow>,
}

/// Where vehicles are in a window of time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProofWindow {
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
    /// For each vehicle that is there its index, and the least and greatest x, y and z \[m\] of all segments that meet the
    /// window: index, least x, y, z, greatest x, y, z.
    pub boxes: Vec<(usize, f64, f64, f64, f64, f64, f64)>,
}

/// Collects the motion of a recording that is read again after it was judged.
#[derive(Clone, Debug)]
pub struct ProofBuilder {
    vehicles: Vec<Vehicle>,
}

impl ProofBuilder {
    /// Of a recording that was audited by these settings with this outcome.
    #[must_use]
    pub fn new(settings: &Settings, outcome: &Outcome) -> Self {
        let gaps_s = outcome.vehicles.iter().zip(&outcome.max_gaps_s);
        Self { vehicles: gaps_s.map(|(name, &max_gap_s)| Vehicle::new(name, settings, max_gap_s)).collect() }
    }

    /// Takes what the recording holds next.
    ///
    /// # Errors
    /// [`RecordedError`] where an item is wrong.
    pub fn push(&mut self, items: &[Item]) -> Result<(), RecordedError> {
        for item in items {
            if let Some(vehicle) = self.vehicles.get_mut(item.vehicle()) {
                vehicle.take(item)?;
            }
        }
        Ok(())
    }

    /// The proof; `None` where there is none: no pair was judged, a limit is that of radii, or the motion is not straight
    /// between samples.
    #[must_use]
    pub fn finish(self, outcome: &Outcome) -> Option<Proof> {
        let closest = outcome.closest.first()?;
        let (pair, separation_m) = (closest.pair.vehicles()?, closest.lower_m);
        let [first, second] = [pair.first(), pair.second()].map(|of| self.vehicles.get(of));
        let (first, second) = first.zip(second)?;
        let is_sampled = |segment: &Segment| segment.whole.is_none();
        let is_plain = |vehicle: &Vehicle| vehicle.radius_m.is_none() && vehicle.segments.iter().all(is_sampled);
        if !self.vehicles.iter().all(is_plain) {
            return None;
        }
        let mut time_s = None;
        overlaps(&first.segments, &second.segments, |overlap| {
            let motion = overlap.straight();
            if time_s.is_none() && motion.closest().separation_m() - motion.resolution_m() <= separation_m {
                let exact = overlap.exact();
                time_s = exact.is_below(separation_m.next_up()).then(|| exact.closest_s());
            }
        });
        let windows = self.windows();
        Some(Proof { separation_m, pair: [first.name.clone(), second.name.clone()], time_s: time_s?, windows })
    }

    fn windows(&self) -> Vec<ProofWindow> {
        let Some(densest) = self.vehicles.iter().max_by_key(|vehicle| vehicle.segments.len()) else {
            return Vec::new();
        };
        let ends = |end: fn(&Vehicle) -> Option<f64>| self.vehicles.iter().filter_map(end);
        let begin_s = ends(|vehicle| Some(vehicle.segments.first()?.from_s)).fold(f64::INFINITY, f64::min);
        let end_s = ends(|vehicle| Some(vehicle.segments.last()?.to_s)).fold(f64::NEG_INFINITY, f64::max);
        let inner = densest.segments.iter().skip(SEGMENTS).step_by(SEGMENTS).map(|segment| segment.to_s);
        let mut times_s = vec![begin_s];
        times_s.extend(inner.filter(|time_s| begin_s < *time_s && *time_s < end_s));
        times_s.push(end_s);
        times_s.windows(2).map(|two| self.window(Interval { from_s: two[0], to_s: two[1] })).collect()
    }

    fn window(&self, window: Interval) -> ProofWindow {
        let boxes = self.vehicles.iter().enumerate().filter_map(|(index, vehicle)| {
            let parts = &vehicle.segments[within(&vehicle.segments, window)];
            let low = parts.iter().map(|part| part.from.inf(&part.to)).reduce(|a, b| a.inf(&b))?;
            let high = parts.iter().map(|part| part.from.sup(&part.to)).reduce(|a, b| a.sup(&b))?;
            Some((index, low.x, low.y, low.z, high.x, high.y, high.z))
        });
        ProofWindow { from_s: window.from_s, to_s: window.to_s, boxes: boxes.collect() }
    }
}
