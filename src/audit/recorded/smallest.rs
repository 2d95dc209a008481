//! The smallest distance of all pairs over time.

use super::settings::Settings;
use super::vehicle::Vehicle;
use super::window::Windows;
use crate::audit::outcome::Approach;
use crate::audit::results::Results;
use crate::audit::sweep::Interval;

/// Approaches that are kept, at most; beyond, neighbours become one.
const MOST_APPROACHES: usize = 4096;
/// Slices of a window, at most.
const MOST_SLICES: usize = 256;

/// Follows the closest approach of all pairs, slice of time by slice of time.
#[derive(Clone, Debug)]
pub(super) struct Smallest {
    windows: Windows,
    pub(super) approaches: Vec<Option<Approach>>,
}

impl Smallest {
    pub(super) fn new(settings: &Settings) -> Self {
        Self { windows: Windows::new(settings.limits(), &[]), approaches: Vec::new() }
    }

    /// Looks at a window, in as many slices as a vehicle has segments in it.
    pub(super) fn follow(&mut self, vehicles: &[Vehicle], window: Interval) {
        let segments = vehicles.iter().map(|vehicle| vehicle.segments.len()).max().unwrap_or(0);
        let slices = segments.clamp(1, MOST_SLICES);
        let at = |slice: usize| window.at(slice as f64 / slices as f64);
        for slice in 0..slices {
            let mut results = Results::default();
            let over = Interval { from_s: at(slice), to_s: at(slice + 1) };
            self.windows.judge(vehicles, over, &mut results);
            self.approaches.push(results.closest.kept.first().copied());
        }
        while self.approaches.len() > MOST_APPROACHES {
            let nearest = |few: &[Option<Approach>]| {
                few.iter().copied().flatten().reduce(|a, b| if b.lower_m < a.lower_m { b } else { a })
            };
            self.approaches = self.approaches.chunks(2).map(nearest).collect();
        }
    }
}
