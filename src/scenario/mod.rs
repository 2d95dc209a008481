//! What is to be flown: the validated scenario.
//!
//! A [`Scenario`] is plain data, complete and checked: everything downstream may rely on what [`Scenario::validate`]
//! promises. It is read from TOML by [`Scenario::read`], or built in code from [`Scenario::new`]. `file` holds the
//! keys of the TOML and is the only place that knows serde; `builtin` holds the embedded scenarios.

mod build;
pub mod builtin;
mod document;
mod error;
pub mod file;
mod homes;
mod overrides;
mod resolved;
mod source;
mod start;
mod validate;

pub use error::{Field, Place, ScenarioError};
pub use overrides::Override;
pub use source::{MAX_FILE_BYTES, Source};
pub(crate) use start::{offset, random, scatter};
pub use validate::{
    BYTES_PER_EDGE, BYTES_PER_VEHICLE, CONTACT_PREDICTION_M, LARGEST, MAX_HALVINGS, MAX_MEMORY_BYTES, MAX_NAME_CHARS,
    MAX_STEPS, SMALLEST,
};

use crate::formation::Formation;
use crate::graph::Graph;
use crate::law::{EdgeTensionKeys, Law, LawSpec, ParameterError, Setting};
use crate::observation::Observation;
use crate::swarm::Swarm;
use crate::target::{Arrival, Leg};

/// A complete flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Name: letters, digits, `-` and `_`; it names the run's folder.
    pub name: String,
    /// Positions \[m\] and velocities \[m/s\] at time 0.
    pub start: Swarm,
    /// Whether the swarm lives in the plane z = 0 or in space.
    pub space: Space,
    /// Mass of each vehicle \[kg\].
    pub mass_kg: Vec<f64>,
    /// Radius of each vehicle's solid hull \[m\].
    pub hull_radius_m: Vec<f64>,
    /// Velocity coefficient a22 of the plant \[1/s\], equation (1): negative is drag, positive feeds energy in.
    pub a22_per_s: f64,
    /// The formations to be reached, one after the other and at least one, up to a rigid motion for laws that control
    /// distances only.
    pub legs: Vec<Leg>,
    /// Which vehicles sense each other.
    pub graph: Graph,
    /// The control law and its parameters.
    pub law: LawSpec,
    /// Safety distance delta \[m\] that the audit judges by, whatever the law.
    pub delta_m: f64,
    /// The body that carries out the commands.
    pub plant: PlantSpec,
    /// Duration and rates.
    pub time: TimeSpec,
    /// What counts as reached.
    pub arrival: Arrival,
}

/// The space that a swarm lives in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The plane z = 0, kept exactly: translation along z is locked.
    Plane,
    /// All three axes.
    Volume,
}

/// Which plant flies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlantSpec {
    /// Rapier rigid bodies at the given floating-point precision.
    Rapier(Precision),
    /// The equation of motion solved in continuous time with the law inside, in double precision.
    Ideal,
}

/// Floating-point precision of the physics engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits.
    Single,
    /// 64 bits.
    Double,
}

/// Duration and rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSpec {
    /// Length of the flight \[s\].
    pub duration_s: f64,
    /// Control and physics step \[s\].
    pub dt_s: f64,
    /// Samples recorded per second of flight \[Hz\], at most one a step.
    pub record_hz: f64,
    /// How often a step that takes more than half of a clearance may be halved; 0 takes every step as it is.
    pub max_halvings: u32,
}

impl TimeSpec {
    /// Default step \[s\].
    pub const DEFAULT_DT_S: f64 = 1.0 / 240.0;
    /// Default recording rate \[Hz\].
    pub const DEFAULT_RECORD_HZ: f64 = 60.0;
    /// Default number of halvings.
    pub const DEFAULT_MAX_HALVINGS: u32 = 10;

    /// Part of a step, or of a recording period, that is rounding: two products of the same times differ by less.
    const ROUNDING: f64 = 1e-6;

    /// A flight of this length \[s\] with the default rates.
    #[must_use]
    pub fn lasting(duration_s: f64) -> Self {
        Self {
            duration_s,
            dt_s: Self::DEFAULT_DT_S,
            record_hz: Self::DEFAULT_RECORD_HZ,
            max_halvings: Self::DEFAULT_MAX_HALVINGS,
        }
    }

    /// Number of steps: the fewest that cover the duration.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let steps = (self.duration_s / self.dt_s - Self::ROUNDING).ceil().max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1; validation bounds it")]
        let steps = steps as u64;
        steps
    }

    /// Whether step `k` (its end, time k dt) is recorded: the start, the first step at or after each recording
    /// period, and the last step.
    #[must_use]
    pub fn records(&self, step: u64) -> bool {
        let periods_per_step = (self.dt_s * self.record_hz).min(1.0);
        let periods = |k: u64| (k as f64 * periods_per_step + Self::ROUNDING).floor();
        step == 0 || periods(step) > periods(step - 1) || step == self.steps()
    }
}

impl Scenario {
    /// A flight with every default of the scenario file: the edge-tension law on the complete graph, in the plane if
    /// start and formation lie in it. Change the fields as needed, then [`Scenario::validate`].
    #[must_use]
    pub fn new(name: &str, start: Swarm, formation: Formation, delta_m: f64, duration_s: f64) -> Self {
        let count = start.count();
        let flat = |rows: &crate::swarm::Rows| rows.column(2).iter().all(|&z| z == 0.0);
        let is_flat = flat(&start.positions_m) && flat(&start.velocities_m_s) && formation.is_in_plane_z0();
        Self {
            name: name.to_owned(),
            space: if is_flat { Space::Plane } else { Space::Volume },
            mass_kg: vec![file::DEFAULT_MASS_KG; count],
            hull_radius_m: vec![file::DEFAULT_HULL_RADIUS_M; count],
            a22_per_s: 0.0,
            graph: Graph::complete(count),
            law: LawSpec::EdgeTension(EdgeTensionKeys::default()),
            delta_m,
            plant: PlantSpec::Rapier(Precision::Single),
            time: TimeSpec::lasting(duration_s),
            arrival: Arrival::default(),
            start,
            legs: vec![Leg::first(formation)],
        }
    }

    /// Number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.start.count()
    }

    /// The formation of the first leg.
    ///
    /// # Panics
    /// Without a leg, which a validated scenario has.
    #[must_use]
    pub fn formation(&self) -> &Formation {
        &self.legs[0].formation
    }

    /// The law that this scenario asks for, ready to fly.
    ///
    /// # Errors
    /// [`ParameterError`] when the law does not exist for these parameters, which a validated scenario rules out, or
    /// its memory cannot be had.
    pub fn law(&self) -> Result<Box<dyn Law>, ParameterError> {
        let (links, formation) = (&self.graph, self.formation());
        self.law.build(&Setting { links, formation, delta_m: self.delta_m, a22_per_s: self.a22_per_s })
    }

    /// What a law is told of a true state on the first leg, by sensors and radio without fault.
    #[must_use]
    pub fn observation<'a>(&'a self, swarm: &'a Swarm) -> Observation<'a> {
        Observation::exact(swarm, &self.graph, self.formation())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(time: TimeSpec) -> Vec<u64> {
        (0..=time.steps()).filter(|&step| time.records(step)).collect()
    }

    #[test]
    fn the_default_rates_record_every_fourth_step() {
        let time = TimeSpec::lasting(120.0);
        assert_eq!(time.steps(), 28_800);
        assert_eq!(recorded(time), (0..=28_800).step_by(4).collect::<Vec<_>>());
    }

    #[test]
    fn a_rate_that_does_not_divide_the_steps_is_kept_on_average() {
        let time = TimeSpec { dt_s: 0.01, ..TimeSpec::lasting(1.0) };
        assert_eq!(time.steps(), 100);
        assert_eq!(recorded(time)[..7], [0, 2, 4, 5, 7, 9, 10]);
        assert_eq!(recorded(time).len(), 61);
    }

    #[test]
    fn the_last_step_is_always_recorded() {
        let time = TimeSpec { dt_s: 0.3, record_hz: 0.1, ..TimeSpec::lasting(1.0) };
        assert_eq!((time.steps(), recorded(time)), (4, vec![0, 4]));
    }

    #[test]
    fn a_rate_above_the_steps_records_every_step_and_no_more() {
        let time = TimeSpec { dt_s: 0.1, record_hz: 1e9, ..TimeSpec::lasting(1.0) };
        assert_eq!(recorded(time), (0..=10).collect::<Vec<_>>());
    }

    #[test]
    fn rounding_adds_no_step_and_drops_none() {
        for dt_s in [1.0 / 240.0, 1.0 / 60.0, 0.1, 0.001, 1.0 / 3.0] {
            for steps in [1_u32, 3, 10, 999, 1_000_000] {
                let time = TimeSpec { dt_s, ..TimeSpec::lasting(dt_s * f64::from(steps)) };
                assert_eq!(time.steps(), u64::from(steps), "dt = {dt_s}");
            }
        }
    }

    #[test]
    fn every_recording_period_has_one_sample_up_to_the_longest_flight() {
        let time = TimeSpec::lasting(MAX_STEPS * TimeSpec::DEFAULT_DT_S);
        assert_eq!(time.steps(), 1_000_000_000);
        for first in [0, 1_000_000, 999_000_000] {
            let samples = (first + 1..=first + 4000).filter(|&step| time.records(step)).count();
            assert_eq!(samples, 1000, "from step {first}");
        }
    }
}
