//! Second pass over a judged recording: positions at given times, and distances of one pair over time.

use nalgebra::Vector3;

use super::outcome::{Gap, Outcome};
use super::settings::{RecordedError, Settings};
use super::vehicle::Vehicle;
use crate::enclosure::Target;
use crate::obstacle;
use crate::outcome::ObjectPair;
use crate::pair_sweep::{Overlap, overlaps};
use crate::segment::Segment;
use crate::sweep::Interval;
use tautline_core::obstacle::Shape;
use tautline_core::swarm::{Rows, set_row};
use tautline_core::track::Item;

/// Returns the vehicles of a recording with this outcome, before their first items.
fn vehicles(settings: &Settings, outcome: &Outcome) -> Vec<Vehicle> {
    let gaps_s = outcome.vehicles.iter().zip(&outcome.max_gaps_s);
    gaps_s.map(|(name, &max_gap_s)| Vehicle::new(name, settings, max_gap_s)).collect()
}

/// Looks up the positions of vehicles at given times while a recording is read again. It uses the same clocks, window
/// and motion as the audit. A vehicle whose motion is unknown, for example in a gap, has no position.
#[derive(Clone, Debug)]
pub struct PositionLookup {
    times_s: Vec<f64>,
    vehicles: Vec<Vehicle>,
    /// Number of times already done for each vehicle.
    done: Vec<usize>,
    /// Axes of the ellipsoid, by which the motion is divided.
    scale: Vector3<f64>,
    positions_m: Vec<Rows>,
    gaps: Vec<Gap>,
}

impl PositionLookup {
    /// Creates a lookup at these times \[s\], in ascending order, for a recording that was audited with these settings
    /// and this outcome.
    #[must_use]
    pub fn new(settings: &Settings, outcome: &Outcome, times_s: Vec<f64>) -> Self {
        let vehicles = vehicles(settings, outcome);
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

    /// Adds the next items of the recording.
    ///
    /// # Errors
    /// [`RecordedError`] if an item is invalid.
    pub fn push(&mut self, items: &[Item]) -> Result<(), RecordedError> {
        for item in items {
            let index = item.vehicle();
            let Some(vehicle) = self.vehicles.get_mut(index).filter(|vehicle| vehicle.is_selected) else { continue };
            let gap = vehicle.take(item)?;
            self.gaps.extend(gap);
            for segment in vehicle.segments.drain(..) {
                let done = &mut self.done[index];
                *done += self.times_s[*done..].partition_point(|&time_s| time_s < segment.from_s);
                while let Some(&time_s) = self.times_s.get(*done).filter(|&&time_s| time_s <= segment.to_s) {
                    let position = segment.position(time_s).component_mul(&self.scale);
                    set_row(&mut self.positions_m[*done], index, position);
                    // The next segment begins where this one ends, and may use that time again.
                    if time_s == segment.to_s {
                        break;
                    }
                    *done += 1;
                }
            }
        }
        Ok(())
    }

    /// Returns the gaps of the vehicles.
    #[must_use]
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// Returns the judged radius of each vehicle \[m\]; `None` if unknown.
    #[must_use]
    pub fn radius_m(&self) -> Vec<Option<f64>> {
        self.vehicles.iter().map(|vehicle| vehicle.radius_m).collect()
    }

    /// Returns the times \[s\], and the N x 3 positions at each time \[m\], NaN for an absent vehicle.
    #[must_use]
    pub fn finish(self) -> (Vec<f64>, Vec<Rows>) {
        (self.times_s, self.positions_m)
    }
}

/// Number of parts between which the common time of two segments is sampled.
const PARTS: u32 = 8;
/// Largest number of kept samples; beyond, neighbours are merged.
const MAX_SAMPLES: usize = 4096;

/// Pair at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairSample {
    /// Time \[s\].
    pub time_s: f64,
    /// Distance of the interpolated positions \[m\], scaled with an ellipsoid.
    pub distance_m: f64,
    /// Bound on the error of the distance \[m\].
    pub deviation_m: f64,
    /// Interpolated positions of both \[m\].
    pub positions_m: [Vector3<f64>; 2],
    /// Whether the motion since the previous sample is unknown.
    pub unseen_before: bool,
}

/// Distance of one pair over time, computed while a recording is read again.
///
/// Samples lie at the ends of segments, at the closest approach and between them: a line through few samples would lie
/// above the distance. In a long recording only the closest of several neighbours is kept, so no approach is lost.
#[derive(Clone, Debug)]
pub struct PairSeries {
    vehicles: Vec<(usize, Vehicle)>,
    /// Shape and path of the obstacle, if one of the pair is an obstacle.
    obstacle: Option<(Shape, Vec<Segment>)>,
    scale: Vector3<f64>,
    /// Target of the distance of two vehicles.
    target: Target<'static>,
    samples: Vec<PairSample>,
    /// Time up to which the pair was followed without a gap \[s\].
    known_s: f64,
    /// Number of samples that each kept sample represents.
    stride: usize,
    skipped: usize,
}

impl PairSeries {
    /// Creates the series of a pair for a recording that was audited with these settings and this outcome.
    ///
    /// # Errors
    /// [`RecordedError::Unnamed`] if there is no such vehicle or obstacle.
    pub fn new(settings: &Settings, outcome: &Outcome, pair: ObjectPair) -> Result<Self, RecordedError> {
        let all = vehicles(settings, outcome);
        let vehicle = |index: usize| -> Result<_, RecordedError> {
            Ok((index, all.get(index).cloned().ok_or(RecordedError::Unnamed { vehicle: index })?))
        };
        let (vehicles, obstacle) = match pair {
            ObjectPair::Vehicles(pair) => (vec![vehicle(pair.first())?, vehicle(pair.second())?], None),
            ObjectPair::Obstacle { vehicle: index, obstacle } => {
                let obstacle_settings =
                    settings.obstacles.get(obstacle).ok_or(RecordedError::Unnamed { vehicle: index })?;
                (vec![vehicle(index)?], Some((obstacle_settings.shape, obstacle_settings.segments())))
            }
        };
        Ok(Self {
            vehicles,
            obstacle,
            scale: settings.ellipsoid_m.unwrap_or(Vector3::repeat(1.0)),
            target: settings.limits().target(),
            samples: Vec::new(),
            known_s: f64::INFINITY,
            stride: 1,
            skipped: 0,
        })
    }

    /// Adds the next items of the recording.
    ///
    /// # Errors
    /// [`RecordedError`] if an item is invalid.
    pub fn push(&mut self, items: &[Item]) -> Result<(), RecordedError> {
        for item in items {
            let found = self.vehicles.iter_mut().find(|(index, _)| *index == item.vehicle());
            if let Some((_, vehicle)) = found {
                vehicle.take(item)?;
            }
        }
        let until_s = self.vehicles.iter().map(|(_, vehicle)| vehicle.known_s()).fold(f64::INFINITY, f64::min);
        self.follow(until_s);
        Ok(())
    }

    /// Returns all samples, in order of time.
    #[must_use]
    pub fn finish(mut self) -> Vec<PairSample> {
        self.follow(f64::INFINITY);
        self.samples
    }

    fn follow(&mut self, until_s: f64) {
        let (mut found, mut known_s) = (Vec::new(), self.known_s);
        let target = self.obstacle.as_ref().map_or(self.target, |(shape, _)| Target::Shape(shape));
        let segments: Vec<&[Segment]> = self.vehicles.iter().map(|(_, vehicle)| &vehicle.segments[..]).collect();
        let (first, second) = match (&self.obstacle, &segments[..]) {
            (Some((_, path)), [vehicle]) => (&path[..], *vehicle),
            (_, [first, second]) => (*first, *second),
            _ => return,
        };
        overlaps(first, second, |overlap| {
            let Interval { from_s, to_s } = overlap.interval;
            if to_s <= until_s {
                let next = found.len();
                samples(&overlap, target, &mut found);
                found[next].unseen_before = from_s > known_s;
                known_s = to_s;
            }
        });
        self.known_s = known_s;
        let scale = self.scale;
        for sample in found {
            self.keep(PairSample {
                positions_m: sample.positions_m.map(|position_m| position_m.component_mul(&scale)),
                ..sample
            });
        }
        for (_, vehicle) in &mut self.vehicles {
            vehicle.discard_until(until_s);
        }
    }

    fn keep(&mut self, sample: PairSample) {
        if let Some(last) = self.samples.last_mut()
            && self.skipped + 1 < self.stride
        {
            self.skipped += 1;
            *last = last.closer(sample);
            return;
        }
        self.skipped = 0;
        self.samples.push(sample);
        if self.samples.len() >= MAX_SAMPLES {
            self.stride *= 2;
            let halves = self.samples.chunks(2);
            self.samples = halves.filter_map(|two| two.iter().copied().reduce(PairSample::closer)).collect();
        }
    }
}

impl PairSample {
    /// Returns the closer of two neighbours, which represents both.
    fn closer(self, later: Self) -> Self {
        let is_later = later.distance_m - later.deviation_m < self.distance_m - self.deviation_m;
        let unseen_before = self.unseen_before || later.unseen_before;
        Self { unseen_before, ..if is_later { later } else { self } }
    }
}

/// Samples the time that two segments share: its ends, points in between, and the closest approach of straight
/// segments. Adds at least one sample.
fn samples(overlap: &Overlap<'_>, target: Target<'_>, found: &mut Vec<PairSample>) {
    let Overlap { first, second, interval: Interval { from_s, to_s } } = *overlap;
    let sample_at = |time_s: f64| {
        let positions_m = [first.position(time_s), second.position(time_s)];
        let deviation_m = (first.deviation_at(time_s) + second.deviation_at(time_s)) * target.per_metre();
        let distance_m = target.distance(positions_m[1] - positions_m[0]);
        PairSample { time_s, distance_m, deviation_m, positions_m, unseen_before: false }
    };
    let place = |k: u32| from_s + (to_s - from_s) * f64::from(k) / f64::from(PARTS);
    let mut times_s: Vec<f64> = [from_s, to_s].into_iter().chain((1..PARTS).map(place)).collect();
    if first.curve().is_none() && second.curve().is_none() {
        let motion = overlap.straight();
        let closest = match target {
            Target::Origin => motion.closest().at,
            Target::Cylinder(cylinder) => cylinder.closest(&motion).1,
            Target::Shape(shape) => obstacle::closest(shape, motion.from, motion.to).1,
        };
        times_s.push(from_s + (to_s - from_s) * closest);
    }
    times_s.sort_unstable_by(f64::total_cmp);
    times_s.dedup();
    found.extend(times_s.into_iter().map(sample_at));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recorded::audit;
    use tautline_core::track::Sample;

    #[test]
    fn positions_use_the_clock_offsets_and_are_unknown_in_gaps() {
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
        let times_to_look_up = vec![0.0, 0.5, 2.0, 3.0, 6.5, 8.0, 9.0];
        let mut lookup = PositionLookup::new(&settings, &outcome, times_to_look_up.clone());
        items.chunks(3).for_each(|items| lookup.push(items).expect("valid items"));
        let gaps: Vec<_> = lookup.gaps().iter().map(|gap| (gap.vehicle, gap.from_s, gap.to_s)).collect();
        assert_eq!(gaps, [(0, 2.0, 6.0), (1, 2.25, 6.25)]);
        let (times_s, positions_m) = lookup.finish();
        assert_eq!(times_s, times_to_look_up);
        let x = |vehicle: usize| positions_m.iter().map(|rows| rows[(vehicle, 0)]).collect::<Vec<_>>();
        let check = |found: Vec<f64>, expected: [f64; 7]| {
            let same = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12 || (a.is_nan() && b.is_nan());
            assert!(found.iter().zip(&expected).all(same), "{found:?}");
        };
        check(x(0), [0.0, 0.5, 2.0, f64::NAN, 6.5, 8.0, f64::NAN]);
        check(x(1), [f64::NAN, 2.5, 17.5, f64::NAN, 62.5, 77.5, f64::NAN]);
    }
}
