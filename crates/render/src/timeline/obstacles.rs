//! Who came nearer to an obstacle than its clearance, and when, by the judge of the flight.

use tautline_core::record::Event;

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

/// All of them, in order of their beginning.
#[derive(Clone, Debug, Default)]
pub(super) struct AllTooNear(pub(super) Vec<TooNear>);

impl AllTooNear {
    /// Takes note of what the judge of a flight of so many vehicles says.
    pub(super) fn note(&mut self, event: &Event, vehicles: usize) {
        match *event {
            Event::ObstacleViolationBegan { vehicle, obstacle, time_s } if vehicle < vehicles => {
                self.0.push(TooNear { vehicle, obstacle, from_s: time_s, to_s: f64::INFINITY });
            }
            Event::ObstacleViolationEnded { vehicle, obstacle, time_s, .. } => {
                let is_it = |near: &&mut TooNear| (near.vehicle, near.obstacle) == (vehicle, obstacle);
                if let Some(near) = self.0.iter_mut().rev().find(is_it) {
                    near.to_s = time_s;
                }
            }
            _ => {}
        }
    }
}
