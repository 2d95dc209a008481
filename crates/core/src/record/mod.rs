//! Samples and events of a run, and the trait of their receivers.
//!
//! A [`Sink`] receives the states of a swarm and depends on no law, plant or judge. A pair of sinks is a sink: `(first,
//! (second, third))`.

mod beside;
mod error;
mod hash;

pub use beside::record_in_thread;
pub use error::{ReadFault, RecordError};
pub use hash::{MessageHash, StateHash, hex, sha256_hex};

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::swarm::{ClosestApproach, Pair, Rows, Swarm};

/// Additional numbers of every vehicle at one instant, such as its attitude or the wind.
///
/// Its source creates a channel once and writes new values into it before each sample. Recorders treat all channels
/// alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name, used in topic names.
    pub name: Arc<str>,
    /// Names of the columns with their units, such as `wind_x_m_s`.
    pub columns: Arc<[String]>,
    /// Values, row by row: one row per vehicle, one number per column.
    pub values: Vec<f64>,
}

impl Channel {
    /// Returns a channel without values.
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
    /// Number of steps since the start.
    pub step: u64,
    /// Positions \[m\] and velocities \[m/s\].
    pub swarm: &'a Swarm,
    /// Commanded accelerations u \[m/s^2\], N x 3, at this instant; no rows if the law had no solution.
    pub control: &'a Rows,
    /// Closest approach over the steps since the previous sample; at the first sample, of the initial state.
    pub separation: Option<ClosestApproach>,
    /// Energy E of the law \[m^2/s^2\], if the law defines one.
    pub energy: Option<f64>,
    /// Maxima over the steps since the previous sample, including this instant.
    pub peaks: Peaks,
    /// Additional numbers of every vehicle, each channel with its own name.
    pub channels: &'a [Channel],
}

impl<'a> Sample<'a> {
    /// Returns a sample with states and commands only.
    #[must_use]
    pub fn new(time_s: f64, step: u64, swarm: &'a Swarm, control: &'a Rows) -> Self {
        let peaks = Peaks::default();
        Self { time_s, step, swarm, control, separation: None, energy: None, peaks, channels: &[] }
    }
}

/// End of one step, or the initial state; recorded or not.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// Time since the start \[s\].
    pub time_s: f64,
    /// Positions \[m\] and velocities \[m/s\].
    pub swarm: &'a Swarm,
    /// Commanded accelerations u \[m/s^2\], N x 3, from this instant on; no rows if the law had no solution.
    pub control: &'a Rows,
}

/// Maxima over several steps; `None` for unknown values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// Largest commanded acceleration of a vehicle, Euclidean norm \[m/s^2\].
    pub control_m_s2: Option<f64>,
    /// Largest energy E \[m^2/s^2\].
    pub energy: Option<f64>,
}

impl Peaks {
    /// Updates the maxima with the values of one instant.
    pub fn take(&mut self, control_m_s2: f64, energy: Option<f64>) {
        let larger = |known: Option<f64>, new: f64| Some(known.map_or(new, |known| known.max(new)));
        self.control_m_s2 = larger(self.control_m_s2, control_m_s2);
        if let Some(energy) = energy {
            self.energy = larger(self.energy, energy);
        }
    }
}

/// A [`Sample`] that owns its data, as a recording returns it.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedSample {
    /// Time since the start \[s\].
    pub time_s: f64,
    /// Number of steps since the start.
    pub step: u64,
    /// Positions \[m\] and velocities \[m/s\].
    pub swarm: Swarm,
    /// Commanded accelerations u \[m/s^2\], N x 3; no rows if the law had no solution.
    pub control: Rows,
    /// Closest approach over the steps since the previous sample.
    pub separation: Option<ClosestApproach>,
    /// Energy E of the law \[m^2/s^2\], if the law defines one.
    pub energy: Option<f64>,
    /// Maxima over the steps since the previous sample.
    pub peaks: Peaks,
    /// Additional numbers of every vehicle.
    pub channels: Vec<Channel>,
}

impl OwnedSample {
    /// Copies `sample` and reuses the memory of this one.
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

    /// Returns a borrowed view of this sample.
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

/// Event of a run, between samples.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The separation of a pair fell below delta.
    ViolationBegan {
        /// The pair.
        pair: Pair,
        /// Time \[s\].
        time_s: f64,
    },
    /// The separation of a pair is at least delta again. A violation that lasts to the end of the run has no such
    /// event.
    ViolationEnded {
        /// The pair.
        pair: Pair,
        /// Time \[s\].
        time_s: f64,
        /// Smallest separation during the violation \[m\].
        min_m: f64,
    },
    /// Closest approach of a pair during a violation. Precedes the end of the violation, or the end of the run.
    Approach {
        /// The pair.
        pair: Pair,
        /// Time \[s\].
        time_s: f64,
        /// Separation \[m\].
        separation_m: f64,
    },
    /// The distance of a vehicle from an obstacle fell below its clearance.
    ObstacleViolationBegan {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// Time \[s\].
        time_s: f64,
    },
    /// The distance of a vehicle from an obstacle is at least its clearance again.
    ObstacleViolationEnded {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// Time \[s\].
        time_s: f64,
        /// Smallest distance from the surface during the violation \[m\], negative inside the obstacle.
        min_m: f64,
    },
    /// Closest approach of a vehicle to an obstacle: during each violation, before its end, and once over the whole
    /// flight for the smallest margin, at the end of the flight.
    ObstacleApproach {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The obstacle, from 0.
        obstacle: usize,
        /// Time \[s\].
        time_s: f64,
        /// Distance from the surface \[m\], negative inside the obstacle.
        distance_m: f64,
    },
    /// The flight uses another law than the scenario's. Sent at the start of the flight.
    OtherLaw {
        /// Time \[s\].
        time_s: f64,
        /// Name of the law in use.
        name: String,
    },
    /// A leg of the flight began. The first leg has no event.
    LegBegan {
        /// The leg, from 0.
        leg: usize,
        /// Time \[s\].
        time_s: f64,
    },
    /// Slots were spread because vehicles blocked each other. The law's certificate is renewed.
    DeadlockRecovery {
        /// Time \[s\].
        time_s: f64,
        /// Scale factor of the slots about their centre.
        scale: f64,
    },
    /// Interchangeable vehicles exchanged slots because they blocked each other. The law's certificate is renewed.
    Assigned {
        /// Time \[s\].
        time_s: f64,
        /// New slots: vehicle i takes the slot of vehicle `slots[i]`.
        slots: Vec<usize>,
    },
    /// The collision detection of the engine found the first overlap of two keep-out balls.
    EngineContact {
        /// The pair.
        pair: Pair,
        /// Time \[s\].
        time_s: f64,
    },
    /// The hulls of two vehicles collided.
    HullsHit {
        /// The pair.
        pair: Pair,
        /// Start of the step of the collision \[s\].
        time_s: f64,
        /// Closing speed of their centres before the collision \[m/s\].
        closing_m_s: f64,
    },
    /// A step is divided into substeps. Reasons: the step is too long for the law's fastest rate, used more than half
    /// of a clearance, or deviated too far from the straight line of the audit. Sent when the length of substeps
    /// changes.
    StepRefined {
        /// Start of the step \[s\].
        time_s: f64,
        /// Shortest substep \[s\].
        dt_s: f64,
    },
    /// The run ended before its scheduled time.
    EndedEarly {
        /// Time \[s\].
        time_s: f64,
        /// Reason, in a sentence.
        reason: String,
    },
}

/// Record of a spreading of slots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeadlockRecovery {
    /// Time \[s\].
    pub time_s: f64,
    /// Scale factor of the slots about their centre.
    pub scale: f64,
    /// Certified lower bound of the separation over the whole flight, as of this time \[m\].
    pub certified_m: Option<f64>,
}

/// Record of an exchange of slots among interchangeable vehicles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reassignment {
    /// Time \[s\].
    pub time_s: f64,
    /// Number of vehicles with a new slot.
    pub vehicles: usize,
    /// Certified lower bound of the separation over the whole flight, as of this time \[m\].
    pub certified_m: Option<f64>,
}

/// Rise of a law's energy while its target was constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyRise {
    /// Energy at the last change of the target, or at the start \[m^2/s^2\].
    pub from: f64,
    /// Largest energy before the next change of the target \[m^2/s^2\].
    pub to: f64,
}

impl EnergyRise {
    /// Relative bound of the energy error of second-order integration at the stable step.
    pub const INTEGRATION: f64 = 1e-3;

    /// Returns the rise beyond the integration error \[m^2/s^2\]; negative if the error explains all of it.
    #[must_use]
    pub fn unexplained(self) -> f64 {
        self.to - (1.0 + Self::INTEGRATION) * self.from
    }
}

impl Event {
    /// Returns the time of the event \[s\].
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

/// Receiver of a run's samples, events and steps.
pub trait Sink {
    /// Receives one sample.
    ///
    /// # Errors
    /// [`RecordError`] if the sample cannot be recorded.
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError>;

    /// Receives one event.
    ///
    /// # Errors
    /// [`RecordError`] if the event cannot be recorded.
    fn event(&mut self, event: &Event) -> Result<(), RecordError>;

    /// Receives the end of a step, recorded or not. The last step of a flight may arrive twice.
    fn step(&mut self, _step: &Step<'_>) {}

    /// Returns whether [`Sink::step`] has an effect. If not, [`record_in_thread`] may run this sink in another thread.
    fn needs_steps(&self) -> bool {
        true
    }
}

/// Discards everything.
impl Sink for () {
    fn sample(&mut self, _sample: &Sample<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }

    fn needs_steps(&self) -> bool {
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

    fn needs_steps(&self) -> bool {
        (**self).needs_steps()
    }
}

/// Passes everything to the first sink, then to the second; stops at the first error.
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

    fn needs_steps(&self) -> bool {
        self.0.needs_steps() || self.1.needs_steps()
    }
}
