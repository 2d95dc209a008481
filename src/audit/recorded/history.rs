//! Two vehicles over time: what a figure shows of them.

use nalgebra::Vector3;

use super::Rates;
use super::meeting::{Shared, shared};
use super::outcome::RecordedError;
use super::question::Question;
use super::vehicle::Vehicle;
use crate::track::Item;

/// Parts of a stretch at which a curve is looked at.
const PLACES_ON_A_CURVE: u32 = 8;
/// Moments that are kept, at most; beyond, neighbours become one.
const MOST_MOMENTS: usize = 4096;

/// Two vehicles at a moment.
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
}

/// Follows two vehicles through a recording that is read again.
///
/// Moments are the samples, and the closest between them; of a long recording the closest of several neighbours is kept,
/// so that nothing that comes near is lost.
#[derive(Clone, Debug)]
pub struct History {
    vehicles: [Vehicle; 2],
    indices: [usize; 2],
    scale: Vector3<f64>,
    moments: Vec<Moment>,
    /// Moments that one of the kept ones stands for.
    stride: usize,
    skipped: usize,
}

impl History {
    /// Follows the vehicles `first` and `second` of a recording whose vehicles have these names, under a question that was
    /// judged before. Intervals longer than its `max_gap_s` are left out; without one none are.
    ///
    /// # Errors
    /// [`RecordedError::Unnamed`] where there is no such vehicle.
    pub fn new(question: &Question, names: &[String], [first, second]: [usize; 2]) -> Result<Self, RecordedError> {
        let vehicle = |index: usize| -> Result<Vehicle, RecordedError> {
            let name = names.get(index).ok_or(RecordedError::Unnamed { vehicle: index })?;
            Ok(question.vehicle(name, index, Some(&Rates::default())))
        };
        Ok(Self {
            vehicles: [vehicle(first)?, vehicle(second)?],
            indices: [first, second],
            scale: question.ellipsoid_m.unwrap_or(Vector3::repeat(1.0)),
            moments: Vec::new(),
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
            let Some(which) = self.indices.iter().position(|index| *index == item.vehicle()) else { continue };
            let vehicle = &mut self.vehicles[which];
            match item {
                Item::Sample(sample) => vehicle.sample(item.vehicle(), sample)?,
                Item::Piece(piece) => vehicle.piece(item.vehicle(), piece)?,
            };
        }
        let until_s = self.vehicles[0].known_s.min(self.vehicles[1].known_s);
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
        let mut found = Vec::new();
        shared(&self.vehicles[0].segments, &self.vehicles[1].segments, |shared| {
            if shared.to_s <= until_s {
                moments(&shared, &mut found);
            }
        });
        let scale = self.scale;
        for moment in found {
            self.keep(Moment { positions_m: moment.positions_m.map(|at| at.component_mul(&scale)), ..moment });
        }
        for vehicle in &mut self.vehicles {
            vehicle.forget(until_s);
        }
    }

    fn keep(&mut self, moment: Moment) {
        if let Some(last) = self.moments.last_mut()
            && self.skipped + 1 < self.stride
        {
            self.skipped += 1;
            if moment.distance_m - moment.slack_m < last.distance_m - last.slack_m {
                *last = moment;
            }
            return;
        }
        self.skipped = 0;
        self.moments.push(moment);
        if self.moments.len() >= MOST_MOMENTS {
            self.stride *= 2;
            let nearer = |a: &Moment, b: &Moment| a.distance_m - a.slack_m <= b.distance_m - b.slack_m;
            self.moments = self
                .moments
                .chunks(2)
                .filter_map(|two| two.iter().copied().reduce(|a, b| if nearer(&a, &b) { a } else { b }))
                .collect();
        }
    }
}

/// The moments of a stretch: its ends and its closest, and places between on a curve.
fn moments(shared: &Shared<'_>, found: &mut Vec<Moment>) {
    let (a, b) = (shared.first, shared.second);
    let at = |time_s: f64| {
        let positions_m = [a.position(time_s), b.position(time_s)];
        let slack_m = a.slack_at(time_s) + b.slack_at(time_s);
        Moment { time_s, distance_m: (positions_m[1] - positions_m[0]).norm(), slack_m, positions_m }
    };
    let mut times_s = vec![shared.from_s, shared.to_s];
    if a.curve.is_none() && b.curve.is_none() {
        let closest = shared.straight().closest();
        times_s.push(shared.from_s + (shared.to_s - shared.from_s) * closest.at);
    } else {
        let place =
            |k: u32| shared.from_s + (shared.to_s - shared.from_s) * f64::from(k) / f64::from(PLACES_ON_A_CURVE);
        times_s.extend((1..PLACES_ON_A_CURVE).map(place));
    }
    times_s.sort_unstable_by(f64::total_cmp);
    times_s.dedup();
    found.extend(times_s.into_iter().map(at));
}
