//! Who came nearer to an obstacle than its clearance, and when, by the judge of the flight.

use super::history::Timeline;
use crate::record::Event;

/// A time during which a vehicle was nearer to an obstacle than its clearance; one that lasts still has no end (infinity).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TooNear {
    /// The vehicle, from 0.
    pub vehicle: usize,
    /// The obstacle, from 0.
    pub obstacle: usize,
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
}

impl Timeline {
    pub(super) fn note_obstacles(&mut self, event: &Event) {
        match *event {
            Event::ObstacleViolationBegan { vehicle, obstacle, time_s } if vehicle < self.count() => {
                self.too_near.push(TooNear { vehicle, obstacle, from_s: time_s, to_s: f64::INFINITY });
            }
            Event::ObstacleViolationEnded { vehicle, obstacle, time_s, .. } => {
                let is_it = |near: &&mut TooNear| (near.vehicle, near.obstacle) == (vehicle, obstacle);
                if let Some(near) = self.too_near.iter_mut().rev().find(is_it) {
                    near.to_s = time_s;
                }
            }
            _ => {}
        }
    }

    /// Every time that a vehicle was nearer to an obstacle than its clearance, in order of its beginning.
    #[must_use]
    pub fn too_near(&self) -> &[TooNear] {
        &self.too_near
    }

    /// Those that have begun by a time \[s\]; at the end of the flight all of them.
    pub(in crate::render) fn too_near_by(&self, time_s: f64) -> impl Iterator<Item = &TooNear> {
        let until_s = if time_s < self.range_s()[1] { time_s } else { f64::INFINITY };
        self.too_near.iter().filter(move |near| near.from_s <= until_s)
    }

    /// Name of an obstacle, in quotes; its number where it is not known.
    pub(in crate::render) fn obstacle(&self, k: usize) -> String {
        let known = self.plan.as_ref().and_then(|plan| plan.obstacles.get(k));
        known.map_or_else(|| format!("obstacle {}", k + 1), |obstacle| format!("`{}`", obstacle.name))
    }
}
