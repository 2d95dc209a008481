//! The smallest distance of all pairs over time.

use super::settings::Settings;
use super::vehicle::Vehicle;
use super::window::Windows;
use crate::audit::outcome::Approach;
use crate::audit::results::Results;
use crate::audit::slices::{Slice, Slices};
use crate::audit::sweep::Interval;

/// Slices that are kept, at most.
const MOST_KEPT: usize = 4096;
/// Slices of a window, at most.
const MOST_SLICES: usize = 256;

/// Follows the closest approach of all pairs, slice of time by slice of time.
#[derive(Clone, Debug)]
pub(super) struct Smallest {
    windows: Windows,
    slices: Slices,
}

impl Smallest {
    pub(super) fn new(settings: &Settings) -> Self {
        Self { windows: Windows::new(settings.limits(), &[]), slices: Slices::new(MOST_KEPT) }
    }

    /// Looks at a window, in slices between the samples of a vehicle that has many in it. `nearest` says which of those that were
    /// drawn closest, the closest first, counts.
    pub(super) fn follow(
        &mut self,
        vehicles: &[Vehicle],
        window: Interval,
        nearest: impl Fn(&[Approach]) -> Option<Approach>,
    ) {
        let mut parts: Option<Vec<Vehicle>> = None;
        for two in ends(vehicles, window).windows(2) {
            let over = Interval { from_s: two[0], to_s: two[1] };
            let mut drawn = self.closest(vehicles, over);
            // Straight segments are judged whole: what they come to outside of the slice is of another.
            if drawn.first().is_some_and(|of| of.time_s < over.from_s || over.to_s < of.time_s) {
                let parts = parts.get_or_insert_with(|| vehicles.to_vec());
                for (part, vehicle) in parts.iter_mut().zip(vehicles) {
                    let begin = vehicle.segments.partition_point(|segment| segment.to_s < over.from_s);
                    let rest = vehicle.segments[begin..].iter().take_while(|segment| segment.from_s <= over.to_s);
                    part.segments = rest.map(|segment| segment.within(over)).collect();
                }
                drawn = self.closest(parts, over);
            }
            if let Some(closest) = nearest(&drawn) {
                // Where no two are there for longer it is known of an instant.
                let known = vehicles.iter().filter(|vehicle| is_there(vehicle, over)).nth(1).is_some();
                let [from_s, to_s] = if known { [over.from_s, over.to_s] } else { [closest.time_s; 2] };
                self.slices.take(Slice { from_s, to_s, closest });
            }
        }
    }

    fn closest(&mut self, vehicles: &[Vehicle], over: Interval) -> Vec<Approach> {
        let mut results = Results::default();
        self.windows.judge(vehicles, over, &mut results);
        results.closest.kept
    }

    /// The slices, with what the recording itself told.
    pub(super) fn finish(mut self, told: &[Approach]) -> Vec<Slice> {
        for closest in told {
            self.slices.enter(*closest);
        }
        self.slices.finish(MOST_KEPT)
    }
}

/// Where slices of a window begin and end \[s\].
fn ends(vehicles: &[Vehicle], window: Interval) -> Vec<f64> {
    let segments = vehicles.iter().map(|vehicle| &vehicle.segments[..]).max_by_key(|segments| segments.len());
    let within = |time_s: &f64| window.from_s < *time_s && *time_s < window.to_s;
    let all = segments.unwrap_or_default().iter().flat_map(|segment| [segment.from_s, segment.to_s]);
    let mut samples: Vec<_> = all.filter(within).collect();
    samples.dedup();
    let stride = samples.len().div_ceil(MOST_SLICES).max(1);
    let inner = samples.into_iter().step_by(stride);
    [window.from_s].into_iter().chain(inner).chain([window.to_s]).collect()
}

/// Whether a vehicle is there within a time, and not at its ends alone.
fn is_there(vehicle: &Vehicle, over: Interval) -> bool {
    let begin = vehicle.segments.partition_point(|segment| segment.to_s <= over.from_s);
    vehicle.segments[begin..].first().is_some_and(|segment| segment.from_s < over.to_s)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::audit::recorded::TrackAuditor;
    use crate::track::{Item, Sample};

    /// The slices of two on a line at these times \[s\], so far apart \[m\].
    fn slices(times_s: &[u32], apart_m: impl Fn(u32) -> f64) -> Vec<Slice> {
        let at = |vehicle: usize, time_s: f64, x: f64| {
            let position_m = Vector3::new(x, 0.0, 0.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let both = |&k: &u32| [at(0, f64::from(k), 0.0), at(1, f64::from(k), apart_m(k))];
        let items: Vec<_> = times_s.iter().flat_map(both).collect();
        let mut auditor = TrackAuditor::new(Settings::delta(1.0)).expect("settings").with_smallest();
        auditor.push(&["a".to_owned(), "b".to_owned()], &items).expect("right");
        auditor.finish().expect("judged").smallest
    }

    #[test]
    fn a_slice_knows_nothing_of_what_comes_after_it() {
        let found = slices(&(0..=20).collect::<Vec<_>>(), |k| if k == 20 { 0.25 } else { 20.0 });
        let ends: Vec<_> = found.iter().map(|of| of.to_s).collect();
        assert_eq!(ends, (1..=20).map(f64::from).collect::<Vec<_>>());
        assert!(found[..19].iter().all(|of| of.closest.lower_m == 20.0 && of.closest.time_s <= of.to_s), "{found:?}");
        assert_eq!((found[19].closest.lower_m, found[19].closest.time_s), (0.25, 20.0));
    }

    #[test]
    fn of_a_gap_there_is_no_slice() {
        let found = slices(&[0, 1, 2, 3, 8, 9, 10], |k| f64::from(k) + 2.0);
        let wide: Vec<_> = found.iter().filter(|of| of.from_s < of.to_s).map(|of| (of.from_s, of.to_s)).collect();
        assert_eq!(wide, [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (8.0, 9.0), (9.0, 10.0)]);
        assert!(found.iter().all(|of| !(3.1..8.0).contains(&of.to_s)), "{found:?}");
    }
}
