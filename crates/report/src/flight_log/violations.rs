//! Violations of a flight, from its events.

use std::collections::BTreeMap;

use tautline_audit::{ObjectPair, Violation};
use tautline_core::record::Event;

/// Every violation that the judge of a flight has reported, in order of its beginning.
///
/// The end of a violation that still lasts is infinity. The limit of an obstacle is NaN, because events do not have it.
#[derive(Clone, Debug, Default)]
pub struct Violations {
    all: Vec<Violation<ObjectPair>>,
    /// Index of the present violation of each pair.
    open: BTreeMap<ObjectPair, usize>,
}

impl Violations {
    /// Returns violations from the audit of a whole recording.
    #[must_use]
    pub fn judged(all: Vec<Violation<ObjectPair>>) -> Self {
        Self { all, open: BTreeMap::new() }
    }

    /// Returns all violations.
    #[must_use]
    pub fn all(&self) -> &[Violation<ObjectPair>] {
        &self.all
    }

    /// Returns the violations of two vehicles.
    pub fn of_vehicles(&self) -> impl Iterator<Item = Violation> {
        self.all.iter().filter_map(|found| {
            let &Violation { pair, from_s, to_s, min_m, min_at_s, limit_m } = found;
            Some(Violation { pair: pair.vehicles()?, from_s, to_s, min_m, min_at_s, limit_m })
        })
    }

    /// Returns the violations of an obstacle's clearance, each with its vehicle and its obstacle, from 0.
    pub fn of_obstacles(&self) -> impl Iterator<Item = (&Violation<ObjectPair>, [usize; 2])> {
        self.all.iter().filter_map(|found| match found.pair {
            ObjectPair::Obstacle { vehicle, obstacle } => Some((found, [vehicle, obstacle])),
            ObjectPair::Vehicles(_) => None,
        })
    }

    /// Returns the pairs with a present violation.
    pub fn open(&self) -> impl Iterator<Item = ObjectPair> {
        self.open.keys().copied()
    }

    /// Takes an event of a flight of `vehicles`; `delta_m` is the limit of two vehicles. Ignores events of other
    /// vehicles, which a damaged file may contain.
    pub fn note(&mut self, event: &Event, delta_m: f64, vehicles: usize) {
        match *event {
            Event::ViolationBegan { pair, .. } if pair.second() >= vehicles => {}
            Event::ObstacleViolationBegan { vehicle, .. } if vehicle >= vehicles => {}
            Event::ViolationBegan { pair, time_s } => self.begin(ObjectPair::Vehicles(pair), time_s, delta_m),
            Event::Approach { pair, time_s, separation_m } => {
                self.approach(ObjectPair::Vehicles(pair), time_s, separation_m);
            }
            Event::ViolationEnded { pair, time_s, min_m } => self.end(ObjectPair::Vehicles(pair), time_s, min_m),
            Event::ObstacleViolationBegan { vehicle, obstacle, time_s } => {
                self.begin(ObjectPair::Obstacle { vehicle, obstacle }, time_s, f64::NAN);
            }
            Event::ObstacleApproach { vehicle, obstacle, time_s, distance_m } => {
                self.approach(ObjectPair::Obstacle { vehicle, obstacle }, time_s, distance_m);
            }
            Event::ObstacleViolationEnded { vehicle, obstacle, time_s, min_m } => {
                self.end(ObjectPair::Obstacle { vehicle, obstacle }, time_s, min_m);
            }
            _ => {}
        }
    }

    /// Removes the violations of vehicles that the flight does not have.
    pub(super) fn keep_within(&mut self, vehicles: usize) {
        let has = |pair: &ObjectPair| match *pair {
            ObjectPair::Vehicles(pair) => pair.second() < vehicles,
            ObjectPair::Obstacle { vehicle, .. } => vehicle < vehicles,
        };
        if !self.all.iter().all(|found| has(&found.pair)) {
            self.all.retain(|found| has(&found.pair));
            let lasts = self.all.iter().enumerate().filter(|(_, found)| found.to_s.is_infinite());
            self.open = lasts.map(|(k, found)| (found.pair, k)).collect();
        }
    }

    /// Lowers the smallest distance of each pair of vehicles in a violation to the distance `nearest` of a sample.
    /// Returns the indices of the violations that became worse.
    pub(super) fn lower(&mut self, nearest: impl Fn(&Violation<ObjectPair>) -> Option<(f64, f64)>) -> Vec<usize> {
        let mut worse = Vec::new();
        for &k in self.open.values() {
            let found = &mut self.all[k];
            if let Some((distance_m, time_s)) = nearest(found).filter(|near| near.0 < found.min_m) {
                (found.min_m, found.min_at_s) = (distance_m, time_s);
                worse.push(k);
            }
        }
        worse
    }

    fn begin(&mut self, pair: ObjectPair, time_s: f64, limit_m: f64) {
        self.open.insert(pair, self.all.len());
        let (min_m, to_s) = (f64::INFINITY, f64::INFINITY);
        self.all.push(Violation { pair, from_s: time_s, to_s, min_m, min_at_s: time_s, limit_m });
    }

    fn approach(&mut self, pair: ObjectPair, time_s: f64, distance_m: f64) {
        if let Some(&k) = self.open.get(&pair) {
            (self.all[k].min_m, self.all[k].min_at_s) = (distance_m, time_s);
        }
    }

    fn end(&mut self, pair: ObjectPair, time_s: f64, min_m: f64) {
        let Some(k) = self.open.remove(&pair) else { return };
        let found = &mut self.all[k];
        if found.min_m.is_infinite() {
            // The violation contains no sample and no reported approach.
            found.min_at_s = f64::midpoint(found.from_s, time_s);
        }
        (found.to_s, found.min_m) = (time_s, min_m);
    }
}
