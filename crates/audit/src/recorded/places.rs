//! Where the vehicles of a recording were at given times, as they are judged.

use nalgebra::Vector3;

use super::error::RecordedError;
use super::outcome::{Gap, Outcome};
use super::settings::Settings;
use super::vehicle::Vehicle;
use tautline_core::swarm::{Rows, set_row};
use tautline_core::track::Item;

/// Looks where vehicles are at given times, while a recording is read again: by the same clocks, in the same window and on the
/// same motion as they were judged. Where nothing is known of one, such as in a gap, it is not there.
#[derive(Clone, Debug)]
pub struct Places {
    times_s: Vec<f64>,
    vehicles: Vec<Vehicle>,
    /// For each vehicle, how many of the times are done with.
    done: Vec<usize>,
    /// The axes of the ellipsoid, which motion is counted in.
    scale: Vector3<f64>,
    positions_m: Vec<Rows>,
    gaps: Vec<Gap>,
}

impl Places {
    /// At these times \[s\], in ascending order, of a recording that was audited by these settings with this outcome.
    #[must_use]
    pub fn new(settings: &Settings, outcome: &Outcome, times_s: Vec<f64>) -> Self {
        let gaps_s = outcome.vehicles.iter().zip(&outcome.max_gaps_s);
        let vehicles: Vec<_> = gaps_s.map(|(name, &max_gap_s)| Vehicle::new(name, settings, max_gap_s)).collect();
        let nowhere = Rows::repeat(vehicles.len(), f64::NAN);
        Self {
            positions_m: vec![nowhere; times_s.len()],
            done: vec![0; vehicles.len()],
            vehicles,
            times_s,
            gaps: Vec::new(),
            scale: settings.ellipsoid_m.unwrap_or(Vector3::repeat(1.0)),
        }
    }

    /// Looks at what the recording says next.
    ///
    /// # Errors
    /// [`RecordedError`] where an item is wrong.
    pub fn push(&mut self, items: &[Item]) -> Result<(), RecordedError> {
        for item in items {
            let index = item.vehicle();
            let Some(vehicle) = self.vehicles.get_mut(index).filter(|vehicle| vehicle.asked_for) else { continue };
            let gap = vehicle.take(item)?;
            self.gaps.extend(gap);
            for segment in vehicle.segments.drain(..) {
                let done = &mut self.done[index];
                *done += self.times_s[*done..].partition_point(|&time_s| time_s < segment.from_s);
                while let Some(&time_s) = self.times_s.get(*done).filter(|&&time_s| time_s <= segment.to_s) {
                    let at = segment.position(time_s).component_mul(&self.scale);
                    set_row(&mut self.positions_m[*done], index, at);
                    // The next segment begins where this one ends, and may look at that time again.
                    if time_s == segment.to_s {
                        break;
                    }
                    *done += 1;
                }
            }
        }
        Ok(())
    }

    /// When vehicles were not seen for a while.
    #[must_use]
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// Radius of each vehicle \[m\], as it is judged; none where it is not known.
    #[must_use]
    pub fn radius_m(&self) -> Vec<Option<f64>> {
        self.vehicles.iter().map(|vehicle| vehicle.radius_m).collect()
    }

    /// The times \[s\], and positions N x 3 at each \[m\], NaN for a vehicle that is not there.
    #[must_use]
    pub fn finish(self) -> (Vec<f64>, Vec<Rows>) {
        (self.times_s, self.positions_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recorded::audit;
    use tautline_core::track::Sample;

    #[test]
    fn vehicles_are_where_they_are_judged_by_their_clocks_and_nowhere_in_a_gap() {
        let seen = |vehicle: usize, time_s: f64, x: f64| {
            let position_m = Vector3::new(x, 9.0 * vehicle as f64, 0.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let times = [0.0, 1.0, 2.0, 6.0, 7.0, 8.0];
        let items: Vec<_> = times.iter().flat_map(|&t| [seen(0, t, t), seen(1, t, 10.0 * t)]).collect();
        let names = ["a".to_owned(), "b".to_owned()];
        let mut settings = Settings::delta(1.0);
        settings.vehicles.entry("b".to_owned()).or_default().offset_s = 0.25;
        let outcome = audit(&names, &items, settings.clone()).expect("judged");
        let asked = vec![0.0, 0.5, 2.0, 3.0, 6.5, 8.0, 9.0];
        let mut places = Places::new(&settings, &outcome, asked.clone());
        items.chunks(3).for_each(|items| places.push(items).expect("right"));
        let gaps: Vec<_> = places.gaps().iter().map(|gap| (gap.vehicle, gap.from_s, gap.to_s)).collect();
        assert_eq!(gaps, [(0, 2.0, 6.0), (1, 2.25, 6.25)]);
        let (times_s, positions_m) = places.finish();
        assert_eq!(times_s, asked);
        let x = |vehicle: usize| positions_m.iter().map(|at| at[(vehicle, 0)]).collect::<Vec<_>>();
        let is = |found: Vec<f64>, expected: [f64; 7]| {
            let same = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12 || (a.is_nan() && b.is_nan());
            assert!(found.iter().zip(&expected).all(same), "{found:?}");
        };
        is(x(0), [0.0, 0.5, 2.0, f64::NAN, 6.5, 8.0, f64::NAN]);
        is(x(1), [f64::NAN, 2.5, 17.5, f64::NAN, 62.5, 77.5, f64::NAN]);
    }
}
