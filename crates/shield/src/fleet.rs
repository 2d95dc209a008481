//! Shields of all vehicles of a simulation, and the condition on their starts.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::brake::State;
use crate::contract::{Broadcast, Message};
use crate::obstacle::Obstacle;
use crate::report::{Assumption, Counters, SharedStarts, assumptions};
use crate::saved::SavedShield;
use crate::settings::{Limits, ShieldError, ShieldFault};
use crate::shield::Shield;
use crate::start::Start;

/// Two vehicles and the distance of their reserved segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairRoom {
    /// The two vehicles, counted from 0.
    pub pair: (usize, usize),
    /// Distance of their segments \[m\], in the scaled lengths of ellipsoids, see [`Metric::distance_m`].
    ///
    /// [`Metric::distance_m`]: crate::plane::Metric::distance_m
    pub distance_m: f64,
    /// Smallest distance with a certificate \[m\]: the sum of the two margins.
    pub required_m: f64,
}

impl PairRoom {
    /// Returns the distance of two starts.
    #[must_use]
    pub(crate) fn of(starts: &[Start], i: usize, j: usize) -> Self {
        let (one, other) = (&starts[i], &starts[j]);
        let distance_m = one.metric.distance_m(&one.segment, &other.segment);
        Self { pair: (i, j), distance_m, required_m: one.margin_m + other.margin_m }
    }

    /// Distance beyond the required one \[m\]; negative without a certificate.
    #[must_use]
    pub fn room_m(&self) -> f64 {
        self.distance_m - self.required_m
    }

    /// Returns the error for a pair that starts too near.
    #[must_use]
    pub fn too_near(&self) -> ShieldError {
        let (i, j) = (self.pair.0 + 1, self.pair.1 + 1);
        let problem =
            format!("vehicles {i} and {j} reserve segments nearer than the {:.6} m of their margins", self.required_m);
        ShieldError::new(
            ShieldFault::TooNear,
            "start",
            problem,
            self.distance_m,
            "move them apart, start slower or lower the errors",
        )
    }
}

/// Returns the pair of starts with the least room. `None` for fewer than two starts.
///
/// For starts, room 0 is required. For slots ([`Limits::slot`]) it is required too, because vehicles never come nearer;
/// with less room than the ease, vehicles may not reach them.
#[must_use]
pub fn closest_starts(starts: &[Start]) -> Option<PairRoom> {
    let pairs = (0..starts.len()).flat_map(|i| (i + 1..starts.len()).map(move |j| (i, j)));
    pairs.map(|(i, j)| PairRoom::of(starts, i, j)).min_by(|a, b| a.room_m().total_cmp(&b.room_m()))
}

/// Shields of all vehicles of a simulation.
///
/// ```
/// use nalgebra::Vector3;
/// use tautline_shield::{Fleet, Settings, State};
///
/// let limits = [Settings::new(1.0, 0.05).limits()?; 2];
/// let mut states = [-3.0, 3.0].map(|x| State::at_rest(Vector3::new(x, 0.0, 0.0)));
/// let mut fleet = Fleet::new(&limits, &states)?;
/// let mut commands = [Vector3::zeros(); 2];
/// let mut sent = vec![];
/// for _ in 0..400 {
///     // Each vehicle flies to the start of the other one.
///     let wanted = [3.0, -3.0].map(|x| Vector3::new(x, 0.0, 0.0));
///     let wanted = [0, 1].map(|i| wanted[i] - states[i].position_m - states[i].velocity_m_s * 2.0);
///     fleet.filter(&states, &wanted, &mut commands);
///     sent.clear();
///     sent.extend(fleet.messages());
///     sent.iter().for_each(|message| fleet.hear(message));
///     for (state, command) in states.iter_mut().zip(commands) {
///         *state = state.after(command, 0.05);
///     }
/// }
/// assert!((states[0].position_m.x - 3.0).abs() < 0.1);
/// assert_eq!(fleet.report().exceeded(), None);
/// # Ok::<(), tautline_shield::ShieldError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Fleet {
    shields: Vec<Shield>,
}

impl Fleet {
    /// Returns the shields of vehicles with these limits and announced states.
    ///
    /// # Errors
    /// If the two lists have different lengths, a start is invalid, or two vehicles start too near to each other. The
    /// error names the pair with the least room.
    pub fn new(limits: &[Limits], starts: &[State]) -> Result<Self, ShieldError> {
        if limits.len() != starts.len() {
            let problem = format!("{} states for {} vehicles", starts.len(), limits.len());
            return Err(ShieldError::new(
                ShieldFault::Mismatch,
                "start",
                problem,
                starts.len() as f64,
                "give one state per vehicle",
            ));
        }
        let starts: Vec<_> =
            limits.iter().zip(starts).map(|(limits, state)| limits.start(*state)).collect::<Result<_, _>>()?;
        limits.iter().try_for_each(|limits| limits.check_bodies(&starts))?;
        if let Some(worst) = closest_starts(&starts).filter(|worst| worst.room_m() < 0.0) {
            return Err(worst.too_near());
        }
        let starts: Arc<[Start]> = starts.into();
        let shields = limits.iter().enumerate();
        let shields = shields.map(|(index, limits)| Shield::of_checked(limits, index, &starts));
        Ok(Self { shields: shields.collect::<Result<_, _>>()? })
    }

    /// Returns these shields with planes before these obstacles, see [`Shield::with_obstacles`].
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use tautline_shield::obstacle::{Ball, SolidHalfSpace};
    /// use tautline_shield::{Fleet, Obstacle, Settings, State};
    ///
    /// let limits = [Settings::new(1.0, 0.05).limits()?; 2];
    /// let states = [-3.0, 3.0].map(|x| State::at_rest(Vector3::new(x, 0.0, 2.0)));
    /// let obstacles = [
    ///     Obstacle::new(Ball { centre_m: Vector3::zeros(), radius_m: 1.0 }, 0.5),
    ///     Obstacle::new(SolidHalfSpace { normal: Vector3::z_axis(), offset_m: 0.0 }, 0.5),
    /// ];
    /// let fleet = Fleet::new(&limits, &states)?.with_obstacles(&obstacles)?;
    /// # assert_eq!(fleet.shields().len(), 2);
    /// # Ok::<(), tautline_shield::ShieldError>(())
    /// ```
    ///
    /// # Errors
    /// If a clearance is invalid, or a vehicle is too near to an obstacle. The error names the vehicle, the obstacle
    /// and the room.
    pub fn with_obstacles(self, obstacles: &[Obstacle]) -> Result<Self, ShieldError> {
        let shields = self.shields.into_iter().map(|shield| shield.with_obstacles(obstacles));
        Ok(Self { shields: shields.collect::<Result<_, _>>()? })
    }

    /// Returns shields that were saved together, which continue with the same bits.
    ///
    /// # Errors
    /// If the data are not those of shields of this version, or the shields have different starts.
    pub fn load(saved: &[SavedShield]) -> Result<Self, ShieldError> {
        if saved.iter().any(|one| one.starts != saved[0].starts) {
            let problem = "the saved shields have different starts".into();
            return Err(ShieldError::new(
                ShieldFault::Altered,
                "saved",
                problem,
                saved.len() as f64,
                "save them at one instant",
            ));
        }
        Ok(Self { shields: saved.iter().map(SavedShield::load).collect::<Result<_, _>>()? })
    }

    /// Stores a message for its receiver.
    pub fn hear(&mut self, message: &Message) {
        if let Some(shield) = self.shields.get_mut(message.to as usize) {
            shield.hear(message);
        }
    }

    /// Stores the messages of a broadcast for their receivers.
    pub fn hear_broadcast(&mut self, broadcast: &Broadcast) {
        broadcast.messages().for_each(|message| self.hear(&message));
    }

    /// Writes the commands of all vehicles at a common instant \[m/s^2\]. Lists that are too short leave the other
    /// vehicles out; these must [`brake`](Shield::brake).
    pub fn filter(&mut self, measured: &[State], wanted: &[Vector3<f64>], commands: &mut [Vector3<f64>]) {
        let inputs = measured.iter().zip(wanted).zip(commands);
        for (shield, ((measured, wanted), command)) in self.shields.iter_mut().zip(inputs) {
            *command = shield.filter(*measured, *wanted);
        }
    }

    /// Takes the messages of all vehicles, by sender and then by receiver. See [`Shield::messages`].
    pub fn messages(&mut self) -> impl Iterator<Item = Message> + '_ {
        self.shields.iter_mut().flat_map(Shield::messages)
    }

    /// Shields, in the order of the vehicles.
    #[must_use]
    pub fn shields(&self) -> &[Shield] {
        &self.shields
    }

    /// Shields, in the order of the vehicles.
    pub fn shields_mut(&mut self) -> &mut [Shield] {
        &mut self.shields
    }

    /// Returns the numbers of all vehicles together.
    #[must_use]
    pub fn report(&self) -> Counters {
        let mut report = Counters::default();
        self.shields.iter().for_each(|shield| report.merge(shield.counters()));
        report
    }

    /// Returns the assumptions of the certificate with the limits of the first vehicle and the numbers of all, see
    /// [`Shield::assumptions`]. One program computes all shields from one list of starts.
    #[must_use]
    pub fn assumptions(&self) -> Vec<Assumption> {
        let Some(first) = self.shields.first() else { return vec![] };
        let agreed = self.shields.iter().map(|shield| shield.shared_starts().agreed).min().unwrap_or_default();
        let starts = SharedStarts { partners: self.shields.len() - 1, agreed, is_one_list: true };
        assumptions(first.limits(), &self.report(), starts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    #[test]
    fn the_worst_pair_of_starts_is_named_with_its_room() {
        let limits = [Settings::new(1.0, 0.05).limits().expect("defaults"); 3];
        let mut states = [0.0, 4.0, 5.5].map(|x| State::at_rest(Vector3::new(x, 0.0, 0.0)));
        assert!(Fleet::new(&limits, &states).is_ok());
        // 2 m/s stop within 0.6675 m.
        states[2].velocity_m_s = Vector3::new(-2.0, 0.0, 0.0);
        assert_eq!(
            Fleet::new(&limits, &states).expect_err("too near").to_string(),
            "start: vehicles 2 and 3 reserve segments nearer than the 1.000001 m of their margins (0.8325); \
             move them apart, start slower or lower the errors"
        );
        let starts: Vec<_> = states.iter().map(|state| limits[0].start(*state).expect("slow enough")).collect();
        let error = Shield::new(&limits[0], 1, &starts).expect_err("too near").to_string();
        assert!(error.starts_with("start: vehicles 2 and 3 reserve"), "{error}");
        assert!(Shield::new(&limits[0], 0, &starts).is_ok());
        assert!(Shield::new(&limits[0], 3, &starts).expect_err("no such vehicle").to_string().starts_with("index: "));
        assert!(
            Fleet::new(&limits, &states[..2]).expect_err("lengths").to_string().starts_with("start: 2 states for 3")
        );
        assert_eq!(closest_starts(&starts[..1]), None);
        let slots = [limits[0].slot(Vector3::zeros()), limits[0].slot(Vector3::x() * 1.1)];
        let closest = closest_starts(&slots).expect("two");
        assert!((closest.room_m() - 0.099_999).abs() < 1e-12 && closest.room_m() < limits[0].ease_m());
    }
}
