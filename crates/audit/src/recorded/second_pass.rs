//! A recording read again after it was judged: positions at given times, distances of one pair over time, and the proof of
//! the smallest separation.

use nalgebra::Vector3;
use serde::Serialize;

use super::outcome::{Gap, Outcome};
use super::settings::{RecordedError, Settings};
use super::vehicle::Vehicle;
use super::window::within;
use crate::enclosure::Target;
use crate::obstacle::Shape;
use crate::outcome::ObjectPair;
use crate::pair_sweep::{Overlap, overlaps};
use crate::segment::Segment;
use crate::sweep::Interval;
use tautline_core::swarm::{Rows, set_row};
use tautline_core::track::Item;

/// The vehicles of a recording that was audited by these settings with this outcome, before their first items.
fn vehicles(settings: &Settings, outcome: &Outcome) -> Vec<Vehicle> {
    let gaps_s = outcome.vehicles.iter().zip(&outcome.max_gaps_s);
    gaps_s.map(|(name, &max_gap_s)| Vehicle::new(name, settings, max_gap_s)).collect()
}

/// Looks where vehicles are at given times, while a recording is read again: by the same clocks, in the same window and on the
/// same motion as they were judged. Where nothing is known of one, such as in a gap, it is not there.
#[derive(Clone, Debug)]
pub struct PositionLookup {
    times_s: Vec<f64>,
    vehicles: Vec<Vehicle>,
    /// For each vehicle, how many of the times are done with.
    done: Vec<usize>,
    /// The axes of the ellipsoid, which motion is counted in.
    scale: Vector3<f64>,
    positions_m: Vec<Rows>,
    gaps: Vec<Gap>,
}

impl PositionLookup {
    /// At these times \[s\], in ascending order, of a recording that was audited by these settings with this outcome.
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

/// Parts of a segment at which a curve is looked at.
const PLACES_ON_A_CURVE: u32 = 8;
/// Samples that are kept, at most; beyond, neighbours become one.
const MOST_SAMPLES: usize = 4096;

/// Two at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairSample {
    /// When \[s\].
    pub time_s: f64,
    /// Their distance as drawn \[m\], scaled with an ellipsoid.
    pub distance_m: f64,
    /// How much smaller or larger it can be \[m\].
    pub deviation_m: f64,
    /// Where both are \[m\].
    pub positions_m: [Vector3<f64>; 2],
    /// Nothing is known of the time since the sample before.
    pub unseen_before: bool,
}

/// Follows two through a recording that is read again.
///
/// Its samples are those of the recording, and the closest between them; of a long recording the closest of several neighbours is kept,
/// so that nothing that comes near is lost.
#[derive(Clone, Debug)]
pub struct PairSeries {
    vehicles: Vec<(usize, Vehicle)>,
    /// The path of the obstacle, if it is one, and its shape.
    obstacle: Option<(Shape, Vec<Segment>)>,
    scale: Vector3<f64>,
    samples: Vec<PairSample>,
    /// Up to when they were followed without a break \[s\].
    known_s: f64,
    /// Samples that one of the kept ones stands for.
    stride: usize,
    skipped: usize,
}

impl PairSeries {
    /// Follows two of those that were audited by these settings, with this outcome.
    ///
    /// # Errors
    /// [`RecordedError::Unnamed`] where there is no such vehicle or obstacle.
    pub fn new(settings: &Settings, outcome: &Outcome, pair: ObjectPair) -> Result<Self, RecordedError> {
        let all = vehicles(settings, outcome);
        let vehicle = |index: usize| -> Result<_, RecordedError> {
            Ok((index, all.get(index).cloned().ok_or(RecordedError::Unnamed { vehicle: index })?))
        };
        let (vehicles, obstacle) = match pair {
            ObjectPair::Vehicles(pair) => (vec![vehicle(pair.first())?, vehicle(pair.second())?], None),
            ObjectPair::Obstacle { vehicle: index, obstacle } => {
                let thing = settings.obstacles.get(obstacle).ok_or(RecordedError::Unnamed { vehicle: index })?;
                (vec![vehicle(index)?], Some((thing.shape, thing.segments())))
            }
        };
        Ok(Self {
            vehicles,
            obstacle,
            scale: settings.ellipsoid_m.unwrap_or(Vector3::repeat(1.0)),
            samples: Vec::new(),
            known_s: f64::INFINITY,
            stride: 1,
            skipped: 0,
        })
    }

    /// Follows them on.
    ///
    /// # Errors
    /// [`RecordedError`] where an item is wrong.
    pub fn push(&mut self, items: &[Item]) -> Result<(), RecordedError> {
        for item in items {
            let of = self.vehicles.iter_mut().find(|(index, _)| *index == item.vehicle());
            if let Some((_, vehicle)) = of {
                vehicle.take(item)?;
            }
        }
        let until_s = self.vehicles.iter().map(|(_, vehicle)| vehicle.known_s()).fold(f64::INFINITY, f64::min);
        self.follow(until_s);
        Ok(())
    }

    /// All samples, in order of time.
    #[must_use]
    pub fn finish(mut self) -> Vec<PairSample> {
        self.follow(f64::INFINITY);
        self.samples
    }

    fn follow(&mut self, until_s: f64) {
        let (mut found, mut known_s) = (Vec::new(), self.known_s);
        let target = self.obstacle.as_ref().map_or(Target::Origin, |(shape, _)| Target::Shape(shape));
        let segments: Vec<&[Segment]> = self.vehicles.iter().map(|(_, vehicle)| &vehicle.segments[..]).collect();
        let (first, second) = match (&self.obstacle, &segments[..]) {
            (Some((_, path)), [vehicle]) => (&path[..], *vehicle),
            (_, [first, second]) => (*first, *second),
            _ => return,
        };
        overlaps(first, second, |overlap| {
            let Interval { from_s, to_s } = overlap.over;
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
            self.keep(PairSample { positions_m: sample.positions_m.map(|at| at.component_mul(&scale)), ..sample });
        }
        for (_, vehicle) in &mut self.vehicles {
            vehicle.forget(until_s);
        }
    }

    fn keep(&mut self, sample: PairSample) {
        if let Some(last) = self.samples.last_mut()
            && self.skipped + 1 < self.stride
        {
            self.skipped += 1;
            *last = last.nearer(sample);
            return;
        }
        self.skipped = 0;
        self.samples.push(sample);
        if self.samples.len() >= MOST_SAMPLES {
            self.stride *= 2;
            let halves = self.samples.chunks(2);
            self.samples = halves.filter_map(|two| two.iter().copied().reduce(PairSample::nearer)).collect();
        }
    }
}

impl PairSample {
    /// The nearer of two neighbours, which stands for both.
    fn nearer(self, later: Self) -> Self {
        let is_later = later.distance_m - later.deviation_m < self.distance_m - self.deviation_m;
        let unseen_before = self.unseen_before || later.unseen_before;
        Self { unseen_before, ..if is_later { later } else { self } }
    }
}

/// The samples of a time that two segments share: its ends and the closest, and places between on a curve. At least one.
fn samples(overlap: &Overlap<'_>, target: Target<'_>, found: &mut Vec<PairSample>) {
    let Overlap { first, second, over: Interval { from_s, to_s } } = *overlap;
    let at = |time_s: f64| {
        let positions_m = [first.position(time_s), second.position(time_s)];
        let deviation_m = first.deviation_at(time_s) + second.deviation_at(time_s);
        let distance_m = target.distance(positions_m[1] - positions_m[0]);
        PairSample { time_s, distance_m, deviation_m, positions_m, unseen_before: false }
    };
    let mut times_s = vec![from_s, to_s];
    if first.curve().is_none() && second.curve().is_none() {
        let motion = overlap.straight();
        let closest = match target {
            Target::Origin => motion.closest().at,
            Target::Shape(shape) => shape.closest(motion.from, motion.to).1,
        };
        times_s.push(from_s + (to_s - from_s) * closest);
    } else {
        let place = |k: u32| from_s + (to_s - from_s) * f64::from(k) / f64::from(PLACES_ON_A_CURVE);
        times_s.extend((1..PLACES_ON_A_CURVE).map(place));
    }
    times_s.sort_unstable_by(f64::total_cmp);
    times_s.dedup();
    found.extend(times_s.into_iter().map(at));
}

/// Segments of the vehicle that has most of them in a window.
const SEGMENTS: usize = 8;

/// The smallest separation of straight lines between samples, and boxes that show that no other pair comes closer.
///
/// `python/tautline/check_proof.py` shares no code with this crate and confirms a proof by exact arithmetic.
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
        Self { vehicles: vehicles(settings, outcome) }
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
        let mut places = PositionLookup::new(&settings, &outcome, asked.clone());
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
