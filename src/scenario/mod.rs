//! What is to be flown: the validated scenario.
//!
//! A [`Scenario`] is plain data, complete and checked: everything downstream may rely on what [`Scenario::validate`]
//! promises. `file` reads and writes it as TOML and is the only place that knows serde; `builtin` holds the embedded
//! scenarios.

pub mod builtin;
mod error;
pub mod file;
mod start;
mod validate;

pub use error::{Place, ScenarioError};
pub use file::{Override, Source};

use crate::formation::Formation;
use crate::graph::Graph;
use crate::law::{EdgeTensionLaw, EdgeTensionParameters, LaplacianLaw, Law};
use crate::swarm::Swarm;

/// A complete, validated flight.
#[derive(Clone, Debug)]
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
    /// The slots to be reached, up to a rigid motion for laws that control distances only.
    pub formation: Formation,
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
    pub judge: JudgeSpec,
    /// The scenario as TOML with every default written out; reading it gives this scenario again.
    pub resolved_toml: String,
}

/// The space that a swarm lives in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The plane z = 0, kept exactly: translation along z is locked.
    Plane,
    /// All three axes.
    Volume,
}

/// Which law flies, with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum LawSpec {
    /// The edge-tension law (8).
    EdgeTension {
        /// Scale alpha of the tension \[m^2/s^2\].
        alpha: f64,
    },
    /// The Laplacian baseline (3).
    Laplacian {
        /// Position gain f1 \[1/s^2\].
        f1_per_s2: f64,
        /// Velocity gain f2 \[1/s\].
        f2_per_s: f64,
    },
}

/// Which plant flies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlantSpec {
    /// Rapier rigid bodies at the given floating-point precision.
    Rapier(Precision),
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
    /// Number of steps: the fewest that cover the duration.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let steps = (self.duration_s / self.dt_s - 1e-6).ceil().max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1; validation bounds it")]
        let steps = steps as u64;
        steps
    }

    /// Whether step `k` (its end, time k dt) is recorded.
    #[must_use]
    pub fn records(&self, step: u64) -> bool {
        let periods = |k: u64| (k as f64 * self.dt_s * self.record_hz + 1e-6).floor();
        step == 0 || periods(step) > periods(step - 1) || step == self.steps()
    }
}

/// What counts as a reached formation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgeSpec {
    /// Largest error of a desired distance over the graph's edges \[m\].
    pub edge_error_m: f64,
    /// Largest speed relative to the swarm's mean velocity \[m/s\].
    pub disagreement_m_s: f64,
    /// Shortest time for which both must hold, up to the end of the run \[s\].
    pub hold_s: f64,
}

impl Scenario {
    /// Number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.start.count()
    }

    /// The law that this scenario asks for, ready to fly.
    #[must_use]
    pub fn law(&self) -> Box<dyn Law> {
        match self.law {
            LawSpec::EdgeTension { alpha } => Box::new(EdgeTensionLaw::new(
                &self.graph,
                &self.formation,
                EdgeTensionParameters { alpha, delta_m: self.delta_m, a22_per_s: self.a22_per_s },
            )),
            LawSpec::Laplacian { f1_per_s2, f2_per_s } => {
                Box::new(LaplacianLaw::new(&self.graph, &self.formation, f1_per_s2, f2_per_s))
            }
        }
    }
}
