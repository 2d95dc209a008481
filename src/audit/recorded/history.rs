//! Two vehicles, or a vehicle and an obstacle, over time: what a figure shows of them.

use nalgebra::Vector3;

use super::enclosure::Target;
use super::meeting::{Shared, shared};
use super::obstacle::Shape;
use super::outcome::{Outcome, RecordedError, Who};
use super::question::Question;
use super::segment::Segment;
use super::vehicle::Vehicle;
use crate::track::Item;

/// Parts of a stretch at which a curve is looked at.
const PLACES_ON_A_CURVE: u32 = 8;
/// Moments that are kept, at most; beyond, neighbours become one.
const MOST_MOMENTS: usize = 4096;

/// Two at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// When \[s\].
    pub time_s: f64,
    /// Their distance as drawn \[m\], scaled with an ellipsoid.
    pub distance_m: f64,
    /// How much smaller or larger it can be \[m\].
    pub slack_m: f64,
    /// Where both are \[m\].
    pub positions_m: [Vector3<f64>; 2],
    /// Nothing is known of the time since the moment before.
    pub unseen_before: bool,
}

/// Follows two through a recording that is read again.
///
/// Moments are the samples, and the closest between them; of a long recording the closest of several neighbours is kept,
/// so that nothing that comes near is lost.
#[derive(Clone, Debug)]
pub struct History {
    vehicles: Vec<(usize, Vehicle)>,
    /// The way of the obstacle, if it is one, and its shape.
    obstacle: Option<(Shape, Vec<Segment>)>,
    scale: Vector3<f64>,
    moments: Vec<Moment>,
    /// Up to when they were followed without a break \[s\].
    known_s: f64,
    /// Moments that one of the kept ones stands for.
    stride: usize,
    skipped: usize,
}

impl History {
    /// Follows two of those that a question was asked about, and this was the outcome.
    ///
    /// # Errors
    /// [`RecordedError::Unnamed`] where there is no such vehicle or obstacle.
    pub fn new(question: &Question, outcome: &Outcome, who: Who) -> Result<Self, RecordedError> {
        let vehicle = |index: usize| -> Result<_, RecordedError> {
            let known = outcome.vehicles.get(index).zip(outcome.max_gaps_s.get(index));
            let (name, max_gap_s) = known.ok_or(RecordedError::Unnamed { vehicle: index })?;
            Ok((index, question.vehicle(name, *max_gap_s)))
        };
        let (vehicles, obstacle) = match who {
            Who::Pair(pair) => (vec![vehicle(pair.first())?, vehicle(pair.second())?], None),
            Who::Obstacle { vehicle: index, obstacle } => {
                let thing = question.obstacles.get(obstacle).ok_or(RecordedError::Unnamed { vehicle: index })?;
                (vec![vehicle(index)?], Some((thing.shape, thing.segments())))
            }
        };
        Ok(Self {
            vehicles,
            obstacle,
            scale: question.ellipsoid_m.unwrap_or(Vector3::repeat(1.0)),
            moments: Vec::new(),
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
            let Some((_, vehicle)) = of else { continue };
            match item {
                Item::Sample(sample) => vehicle.sample(sample)?,
                Item::Piece(piece) => vehicle.piece(piece)?,
            };
        }
        let until_s = self.vehicles.iter().map(|(_, vehicle)| vehicle.known_s()).fold(f64::INFINITY, f64::min);
        self.follow(until_s);
        Ok(())
    }

    /// All moments, in order of time.
    #[must_use]
    pub fn finish(mut self) -> Vec<Moment> {
        self.follow(f64::INFINITY);
        self.moments
    }

    fn follow(&mut self, until_s: f64) {
        let (mut found, mut known_s) = (Vec::new(), self.known_s);
        let target = self.obstacle.as_ref().map_or(Target::Origin, |(shape, _)| Target::Shape(shape));
        let segments: Vec<&[Segment]> = self.vehicles.iter().map(|(_, vehicle)| &vehicle.segments[..]).collect();
        let (first, second) = match (&self.obstacle, &segments[..]) {
            (Some((_, way)), [course]) => (&way[..], *course),
            (_, [first, second]) => (*first, *second),
            _ => return,
        };
        shared(first, second, |shared| {
            if shared.to_s <= until_s {
                let next = found.len();
                moments(&shared, target, &mut found);
                found[next].unseen_before = shared.from_s > known_s;
                known_s = shared.to_s;
            }
        });
        self.known_s = known_s;
        let scale = self.scale;
        for moment in found {
            self.keep(Moment { positions_m: moment.positions_m.map(|at| at.component_mul(&scale)), ..moment });
        }
        for (_, vehicle) in &mut self.vehicles {
            vehicle.forget(until_s);
        }
    }

    fn keep(&mut self, moment: Moment) {
        if let Some(last) = self.moments.last_mut()
            && self.skipped + 1 < self.stride
        {
            self.skipped += 1;
            *last = last.nearer(moment);
            return;
        }
        self.skipped = 0;
        self.moments.push(moment);
        if self.moments.len() >= MOST_MOMENTS {
            self.stride *= 2;
            let halves = self.moments.chunks(2);
            self.moments = halves.filter_map(|two| two.iter().copied().reduce(Moment::nearer)).collect();
        }
    }
}

impl Moment {
    /// The nearer of two neighbours, which stands for both.
    fn nearer(self, later: Self) -> Self {
        let is_later = later.distance_m - later.slack_m < self.distance_m - self.slack_m;
        let unseen_before = self.unseen_before || later.unseen_before;
        Self { unseen_before, ..if is_later { later } else { self } }
    }
}

/// The moments of a stretch: its ends and its closest, and places between on a curve. At least one.
fn moments(shared: &Shared<'_>, target: Target<'_>, found: &mut Vec<Moment>) {
    let (a, b) = (shared.first, shared.second);
    let at = |time_s: f64| {
        let positions_m = [a.position(time_s), b.position(time_s)];
        let slack_m = a.slack_at(time_s) + b.slack_at(time_s);
        let distance_m = target.distance(positions_m[1] - positions_m[0]);
        Moment { time_s, distance_m, slack_m, positions_m, unseen_before: false }
    };
    let mut times_s = vec![shared.from_s, shared.to_s];
    if a.curve.is_none() && b.curve.is_none() {
        let motion = shared.straight();
        let closest = match target {
            Target::Origin => motion.closest().at,
            Target::Shape(shape) => shape.closest(motion.from, motion.to).1,
        };
        times_s.push(shared.from_s + (shared.to_s - shared.from_s) * closest);
    } else {
        let place =
            |k: u32| shared.from_s + (shared.to_s - shared.from_s) * f64::from(k) / f64::from(PLACES_ON_A_CURVE);
        times_s.extend((1..PLACES_ON_A_CURVE).map(place));
    }
    times_s.sort_unstable_by(f64::total_cmp);
    times_s.dedup();
    found.extend(times_s.into_iter().map(at));
}
