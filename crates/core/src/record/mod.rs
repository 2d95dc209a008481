//! Samples of a run, and the traits that receive them.
//!
//! A recorder knows the state of a swarm and nothing of laws, plants or judges.
//! Several recorders of one run are joined as a pair: `(first, (second, third))` is a recorder again.

mod beside;
mod error;
mod hash;

pub use beside::record_beside;
pub use error::{ReadFault, RecordError};
pub use hash::{MessageHash, StateHash, sha256_hex};

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::swarm::{ClosestApproach, Pair, Rows, Swarm};

/// Numbers of every vehicle beside its position and velocity at one instant, such as its attitude or the wind.
///
/// Its source makes it once, writes new values into it before each sample, and names it nowhere else: what receives
/// samples takes every channel alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// What it is called; one word of the letters that topics are made of.
    pub name: Arc<str>,
    /// What each column holds, with its unit, such as `wind_x_m_s`.
    pub columns: Arc<[String]>,
    /// A row for each vehicle, one after the other, with a number for each column.
    pub values: Vec<f64>,
}

impl Channel {
    /// A channel without values yet.
    #[must_use]
    pub fn new(name: &str, columns: &[&str]) -> Self {
        Self {
            name: name.into(),
            columns: columns.iter().map(|&column| column.to_owned()).collect(),
            values: Vec::new(),
        }
    }
}

/// One recorded instant.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Time since the start \[s\].
    pub time_s: f64,
    /// Steps taken so far.
    pub step: u64,
    /// Positions \[m\] and velocities \[m/s\].
    pub swarm: &'a Swarm,
    /// Commanded accelerations u \[m/s^2\], N x 3, at this instant; no rows where the law had no answer.
    pub control: &'a Rows,
    /// Closest approach over the steps since the sample before (at the first sample: of the start itself).
    pub separation: Option<ClosestApproach>,
    /// The law's energy E \[m^2/s^2\] where it has one.
    pub energy: Option<f64>,
    /// What was largest over the steps since the sample before, its end included.
    pub peaks: Peaks,
    /// What else is known of every vehicle, each under another name.
    pub channels: &'a [Channel],
}

impl<'a> Sample<'a> {
    /// An instant of which nothing is known but states and commands.
    #[must_use]
    pub fn new(time_s: f64, step: u64, swarm: &'a Swarm, control: &'a Rows) -> Self {
        let peaks = Peaks::default();
        Self { time_s, step, swarm, control, separation: None, energy: None, peaks, channels: &[] }
    }
}

/// The end of one step, recorded or not; at first the start.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// Time since the start \[s\].
    pub time_s: f64,
    /// Positions \[m\] and velocities \[m/s\].
    pub swarm: &'a Swarm,
    /// Commanded accelerations u \[m/s^2\], N x 3, from here on; no rows where the law had no answer.
    pub control: &'a Rows,
}

/// What was largest over some steps; nothing where nothing is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// Largest commanded acceleration of a vehicle, Euclidean norm \[m/s^2\].
    pub control_m_s2: Option<f64>,
    /// Largest energy E \[m^2/s^2\].
    pub energy: Option<f64>,
}

impl Peaks {
    /// Takes one more instant.
    pub fn take(&mut self, control_m_s2: f64, energy: Option<f64>) {
        let larger = |known: Option<f64>, new: f64| Some(known.map_or(new, |known| known.max(new)));
        self.control_m_s2 = larger(self.control_m_s2, control_m_s2);
        if let Some(energy) = energy {
            self.energy = larger(self.energy, energy);
        }
    }
}

/// A [`Sample`] that owns its state, as a recording gives it back.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedSample {
    /// Time since the start \[s\].
    pub time_s: f64,
    /// Steps taken so far.
    pub step: u64,
    /// Positions \[m\] and velocities \[m/s\].
    pub swarm: Swarm,
    /// Commanded accelerations u \[m/s^2\], N x 3; no rows where the law had no answer.
    pub control: Rows,
    /// Closest approach over the steps since the sample before.
    pub separation: Option<ClosestApproach>,
    /// The law's energy E \[m^2/s^2\] where it has one.
    pub energy: Option<f64>,
    /// What was largest over the steps since the sample before.
    pub peaks: Peaks,
    /// What else is known of every vehicle.
    pub channels: Vec<Channel>,
}

impl OwnedSample {
    /// Becomes a copy of another sample, in the memory that it has.
    pub fn copy_from(&mut self, sample: &Sample<'_>) {
        let copy = |to: &mut Rows, from: &Rows| {
            if to.nrows() == from.nrows() {
                to.copy_from(from);
            } else {
                to.clone_from(from);
            }
        };
        copy(&mut self.swarm.positions_m, &sample.swarm.positions_m);
        copy(&mut self.swarm.velocities_m_s, &sample.swarm.velocities_m_s);
        copy(&mut self.control, sample.control);
        let &Sample { time_s, step, separation, energy, peaks, .. } = sample;
        (self.time_s, self.step, self.separation) = (time_s, step, separation);
        (self.energy, self.peaks) = (energy, peaks);
        sample.channels.clone_into(&mut self.channels);
    }

    /// The same sample by reference.
    #[must_use]
    pub fn as_sample(&self) -> Sample<'_> {
        Sample {
            time_s: self.time_s,
            step: self.step,
            swarm: &self.swarm,
            control: &self.control,
            separation: self.separation,
            energy: self.energy,
            peaks: self.peaks,
            channels: &self.channels,
        }
    }
}

impl From<&Sample<'_>> for OwnedSample {
    fn from(sample: &Sample<'_>) -> Self {
        Self {
            time_s: sample.time_s,
            step: sample.step,
            swarm: sample.swarm.clone(),
            control: sample.control.clone(),
            separation: sample.separation,
            energy: sample.energy,
            peaks: sample.peaks,
            channels: sample.channels.to_vec(),
        }
    }
}

/// Something that happened between samples.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A pair came closer than delta.
    ViolationBegan {
        /// The pair.
        pair: Pair,
        /// When \[s\].
        time_s: f64,
    },
    /// A pair that was closer than delta is clear again. One that still is closer at the end of the run has no such event.
    ViolationEnded {
        /// The pair.
        pair: Pair,
        /// When \[s\].
        time_s: f64,
        /// Smallest separation within \[m\].
        min_m: f64,
    },
    /// The closest that two came while they were closer than delta. Told before that ends, and at the end of the run where it
    /// has not.
    Approach {
        /// The pair.
        pair: Pair,
        /// When \[s\].
        time_s: f64,
        /// How close \[m\].
        separation_m: f64,
    },
    /// A vehicle came nearer to an obstacle than its clearance.
    ObstacleViolationBegan {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// When \[s\].
        time_s: f64,
    },
    /// A vehicle that was nearer to an obstacle than its clearance no longer is.
    ObstacleViolationEnded {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// When \[s\].
        time_s: f64,
        /// Smallest distance from its surface within \[m\], below zero within.
        min_m: f64,
    },
    /// The closest that a vehicle came to an obstacle: while it was nearer than its clearance, told before that ends, and of those
    /// with the least room in the whole flight, told at its end.
    ObstacleApproach {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// When \[s\].
        time_s: f64,
        /// Distance from its surface \[m\], below zero within.
        distance_m: f64,
    },
    /// The flight is under another law than the scenario's. Told at its start.
    OtherLaw {
        /// When \[s\].
        time_s: f64,
        /// Name of the law that is flown.
        name: String,
    },
    /// A leg of the flight began; the first begins with the flight and is not told.
    LegBegan {
        /// The leg, from 0.
        leg: usize,
        /// When \[s\].
        time_s: f64,
    },
    /// Slots were spread, since vehicles stood in each other's way; what the law promised is renewed.
    DeadlockRecovery {
        /// When \[s\].
        time_s: f64,
        /// They are scaled by this about their centre.
        scale: f64,
    },
    /// Interchangeable vehicles were given other slots, since they stood in each other's way; what the law promised is renewed.
    Assigned {
        /// When \[s\].
        time_s: f64,
        /// From now on vehicle i goes to the slot that was vehicle `slots[i]`'s.
        slots: Vec<usize>,
    },
    /// The engine's own collision detection saw two keep-out balls overlap for the first time.
    EngineContact {
        /// The pair.
        pair: Pair,
        /// When \[s\].
        time_s: f64,
    },
    /// The hulls of two vehicles hit.
    HullsHit {
        /// The pair.
        pair: Pair,
        /// When the step began in which they did \[s\].
        time_s: f64,
        /// How fast their centres neared each other before \[m/s\].
        closing_m_s: f64,
    },
    /// A step is flown in shorter ones, because it is too long for the law's fastest rate, took more than half of a
    /// clearance, or bent too far from the straight line that is audited. Told where their length changes.
    StepRefined {
        /// When the step began \[s\].
        time_s: f64,
        /// Shortest step used instead \[s\].
        dt_s: f64,
    },
    /// The run ended before its time.
    EndedEarly {
        /// When \[s\].
        time_s: f64,
        /// Why, in a sentence.
        reason: String,
    },
}

/// A time at which slots were spread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeadlockRecovery {
    /// When \[s\].
    pub time_s: f64,
    /// They were scaled by this about their centre.
    pub scale: f64,
    /// No pair comes closer than this in the whole flight, as far as that was certified up to then \[m\].
    pub certified_m: Option<f64>,
}

/// A time at which interchangeable vehicles were given other slots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reassignment {
    /// When \[s\].
    pub time_s: f64,
    /// How many of them.
    pub vehicles: usize,
    /// No pair comes closer than this in the whole flight, as far as that was certified up to then \[m\].
    pub certified_m: Option<f64>,
}

/// How far a law's energy rose while its target stayed as it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyRise {
    /// Energy when the target was last changed, or at the start \[m^2/s^2\].
    pub from: f64,
    /// The largest one from then until it changed again \[m^2/s^2\].
    pub to: f64,
}

impl EnergyRise {
    /// Part of the energy that the error of second-order integration at the honest step stays below.
    pub const INTEGRATION: f64 = 1e-3;

    /// What integration does not explain \[m^2/s^2\], negative where it explains all.
    #[must_use]
    pub fn unexplained(self) -> f64 {
        self.to - (1.0 + Self::INTEGRATION) * self.from
    }
}

impl Event {
    /// When it happened \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        match *self {
            Self::ViolationBegan { time_s, .. }
            | Self::ViolationEnded { time_s, .. }
            | Self::Approach { time_s, .. }
            | Self::ObstacleViolationBegan { time_s, .. }
            | Self::ObstacleViolationEnded { time_s, .. }
            | Self::ObstacleApproach { time_s, .. }
            | Self::OtherLaw { time_s, .. }
            | Self::LegBegan { time_s, .. }
            | Self::DeadlockRecovery { time_s, .. }
            | Self::Assigned { time_s, .. }
            | Self::EngineContact { time_s, .. }
            | Self::HullsHit { time_s, .. }
            | Self::StepRefined { time_s, .. }
            | Self::EndedEarly { time_s, .. } => time_s,
        }
    }
}

/// Receives a run as it is made.
pub trait Sink {
    /// Takes one sample.
    ///
    /// # Errors
    /// [`RecordError`] when it cannot be kept.
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError>;

    /// Takes one event.
    ///
    /// # Errors
    /// [`RecordError`] when it cannot be kept.
    fn event(&mut self, event: &Event) -> Result<(), RecordError>;

    /// Looks at the end of a step, for what is folded over all of them. One that ends a flight may be told twice.
    fn step(&mut self, _step: &Step<'_>) {}

    /// Whether it looks at steps. One that says no is not told of them where it records beside the flight ([`record_beside`]).
    fn looks_at_steps(&self) -> bool {
        true
    }
}

/// Keeps nothing.
impl Sink for () {
    fn sample(&mut self, _sample: &Sample<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }

    fn looks_at_steps(&self) -> bool {
        false
    }
}

impl<R: Sink + ?Sized> Sink for &mut R {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        (**self).sample(sample)
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        (**self).event(event)
    }

    fn step(&mut self, step: &Step<'_>) {
        (**self).step(step);
    }

    fn looks_at_steps(&self) -> bool {
        (**self).looks_at_steps()
    }
}

/// Gives everything to the first, then to the second; stops at the first error.
impl<A: Sink, B: Sink> Sink for (A, B) {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.0.sample(sample)?;
        self.1.sample(sample)
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.0.event(event)?;
        self.1.event(event)
    }

    fn step(&mut self, step: &Step<'_>) {
        self.0.step(step);
        self.1.step(step);
    }

    fn looks_at_steps(&self) -> bool {
        self.0.looks_at_steps() || self.1.looks_at_steps()
    }
}
