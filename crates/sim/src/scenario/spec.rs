//! [`Scenario`]: a complete flight as plain data.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::external::ExternalLaw;
use super::time::TimeSpec;
use crate::link::{ActuationSpec, Failure, NetworkSpec, SensingSpec};
use crate::shield::ShieldSpec;
use crate::vehicle::Airframe;
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::law::{EdgeTensionKeys, Law, LawContext, LawSpec, ParameterError, WindExposure};
use tautline_laws::observation::Observation;
use tautline_laws::space::Metric;
use tautline_laws::target::{Arrival, DeadlockOptions, Guidance, Leg, Reference, Target};
use tautline_laws::wind::{Wind, WindSpec};

/// Default mass of a vehicle \[kg\].
pub const DEFAULT_MASS_KG: f64 = 1.0;
/// Default radius of a vehicle's solid hull \[m\].
pub const DEFAULT_HULL_RADIUS_M: f64 = 0.25;

/// A complete flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Name of the scenario and of the folder of its runs: letters, digits, `-` and `_`.
    pub name: String,
    /// Positions \[m\] and velocities \[m/s\] at time 0.
    pub start: Swarm,
    /// Model of the vehicles; [`Scenario::set_airframe`] also changes the fields that depend on it.
    pub airframe: Airframe,
    /// Plane z = 0, or all three axes.
    pub space: Space,
    /// Mass of each vehicle \[kg\].
    pub mass_kg: Vec<f64>,
    /// Radius of each vehicle's solid hull \[m\].
    pub hull_radius_m: Vec<f64>,
    /// Velocity coefficient a22 of the plant \[1/s\], equation (1): negative is drag, positive feeds energy in.
    pub a22_per_s: f64,
    /// Drag of a point over its mass, linear in the velocity of the air past it \[1/s\].
    pub drag_per_s: f64,
    /// Wind.
    pub wind: WindSpec,
    /// Formations of the flight, in order, at least one. Laws that control distances reach them up to a rigid motion.
    pub legs: Vec<Leg>,
    /// Obstacles at rest.
    pub obstacles: Vec<Obstacle>,
    /// Motion that carries the formations, and the vehicles that know it. A formation without a reference may be
    /// reached anywhere.
    pub reference: Option<Guidance>,
    /// Pairs of vehicles that sense each other.
    pub graph: Graph,
    /// The control law and its parameters.
    pub law: LawSpec,
    /// Law from outside that flies in place of `law`. The TOML and the hash of the scenario do not contain it.
    pub external_law: Option<ExternalLaw>,
    /// Safety distance delta \[m\] of the audit: the width of the space around a vehicle that must stay empty.
    pub delta_m: f64,
    /// Shape of that space.
    pub safety: Safety,
    /// Equations of motion that are solved.
    pub plant: PlantSpec,
    /// Duration and rates.
    pub time: TimeSpec,
    /// Criteria of a reached formation.
    pub arrival: Arrival,
    /// Deadlock recovery, under laws that support it.
    pub deadlock: DeadlockOptions,
    /// Measurements by the vehicles.
    pub sensing: SensingSpec,
    /// Messages between the vehicles.
    pub network: NetworkSpec,
    /// Conversion of commands into accelerations.
    pub actuation: ActuationSpec,
    /// Stage between law and vehicles that certifies separations under any law.
    pub shield: Option<ShieldSpec>,
    /// Vehicles with a failed part.
    pub failures: Vec<Failure>,
    /// Seed of all random numbers in flight.
    pub noise_seed: u64,
}

/// Space around a vehicle that must stay empty, delta wide.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[schemars(tag = "shape")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Safety {
    /// A ball with the diameter `law.delta_m`.
    #[default]
    Ball,
    /// An upright ellipsoid. Separation above and below counts for more, for example because of downwash.
    Ellipsoid {
        /// Half axes in m. The two horizontal ones are equal; `law.delta_m`, if given, is twice that.
        #[schemars(extend("items" = { "type": "number", "exclusiveMinimum": 0 }))]
        half_axes_m: [f64; 3],
    },
}

/// Space of a swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The plane z = 0, kept exactly: translation along z is locked.
    Plane,
    /// All three axes.
    Volume,
}

impl Space {
    /// Returns the number of axes.
    #[must_use]
    pub fn dimensions(self) -> usize {
        match self {
            Self::Plane => 2,
            Self::Volume => 3,
        }
    }
}

/// Plant that moves the vehicles.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PlantSpec {
    /// Rigid bodies of the physics engine Rapier, under a command that is held over each step.
    #[default]
    Rapier,
    /// The equation p'' = a22 v + u, solved to 12 digits in continuous time; a reference for Rapier.
    Ideal,
}

impl Scenario {
    /// Returns a flight with the defaults of the scenario file: the edge-tension law on the complete graph, in the
    /// plane if start and formation lie in it. Call [`Scenario::validate`] after changing fields.
    #[must_use]
    pub fn new(name: &str, start: Swarm, formation: Formation, delta_m: f64, duration_s: f64) -> Self {
        let count = start.count();
        let flat = |rows: &Rows| rows.column(2).iter().all(|&z| z == 0.0);
        let is_flat = flat(&start.positions_m) && flat(&start.velocities_m_s) && formation.is_in_plane_z0();
        Self {
            name: name.to_owned(),
            airframe: Airframe::Point,
            space: if is_flat { Space::Plane } else { Space::Volume },
            mass_kg: vec![DEFAULT_MASS_KG; count],
            hull_radius_m: vec![DEFAULT_HULL_RADIUS_M; count],
            a22_per_s: 0.0,
            drag_per_s: 0.0,
            wind: WindSpec::default(),
            graph: Graph::complete(count),
            law: LawSpec::EdgeTension(EdgeTensionKeys::default()),
            external_law: None,
            delta_m,
            safety: Safety::Ball,
            plant: PlantSpec::Rapier,
            time: TimeSpec::lasting(duration_s),
            arrival: Arrival::default(),
            deadlock: DeadlockOptions::default(),
            sensing: SensingSpec::default(),
            network: NetworkSpec::default(),
            actuation: ActuationSpec::default(),
            shield: None,
            failures: Vec::new(),
            noise_seed: 0,
            start,
            legs: vec![Leg::first(formation)],
            obstacles: Vec::new(),
            reference: None,
        }
    }

    /// Returns whether the physics engine moves the vehicles: along straight lines within a step, with contacts.
    #[must_use]
    pub fn has_engine(&self) -> bool {
        matches!((&self.airframe, self.plant), (Airframe::Point | Airframe::Quadrotor(_), PlantSpec::Rapier))
    }

    /// Returns the number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.start.count()
    }

    /// Returns the formation of the first leg; without legs, which validation refuses, a formation without slots.
    #[must_use]
    pub fn formation(&self) -> &Formation {
        static NOWHERE: LazyLock<Formation> = LazyLock::new(|| Formation::line(0, 1.0));
        self.legs.first().map_or(&NOWHERE, |leg| &leg.formation)
    }

    /// Returns the scenario's own law, ready to fly; [`Scenario::flown_law`] considers an external law.
    ///
    /// # Errors
    /// [`ParameterError`] if the parameters give no law, which validation rules out, or if memory cannot be allocated.
    pub fn law(&self) -> Result<Box<dyn Law>, ParameterError> {
        let guidance = self.reference.as_ref();
        let later = self.legs.get(1..).unwrap_or_default();
        let context = LawContext::new(&self.graph, self.formation(), self.delta_m, self.velocity_coefficient_per_s());
        let exposure = (!self.wind.is_still()).then(|| WindExposure {
            wind: &self.wind,
            drag_per_s: self.drag_per_s,
            until_s: self.time.duration_s,
            resolution_m: self.smallest_resolved_m(),
        });
        self.law.build(&LawContext {
            later,
            guidance,
            obstacles: &self.obstacles,
            exposure,
            metric: self.metric(),
            ..context
        })
    }

    /// Returns a22 less the drag of the air \[1/s\]: in the wind W, p'' = (a22 - drag) v + u + drag W.
    #[must_use]
    pub fn velocity_coefficient_per_s(&self) -> f64 {
        self.a22_per_s - self.drag_per_s
    }

    /// Returns the metric of separations, in which the safety distance is delta: Euclidean for balls.
    #[must_use]
    pub fn metric(&self) -> Metric {
        match self.safety {
            Safety::Ball => Metric::default(),
            Safety::Ellipsoid { half_axes_m: [.., half_height_m] } => {
                Metric::of_ratio(half_height_m / (0.5 * self.delta_m))
            }
        }
    }

    /// Returns the half axes of the ellipsoid that must stay empty around a vehicle \[m\]; `None` for a ball.
    #[must_use]
    pub fn half_axes_m(&self) -> Option<[f64; 3]> {
        match self.safety {
            Safety::Ball => None,
            Safety::Ellipsoid { half_axes_m: [.., half_height_m] } => {
                Some([0.5 * self.delta_m, 0.5 * self.delta_m, half_height_m])
            }
        }
    }

    /// Returns an upper bound of the speed of the air at any vehicle during the flight \[m/s\]
    /// ([`WindSpec::fastest_m_s`]).
    #[must_use]
    pub fn fastest_wind_m_s(&self) -> f64 {
        self.wind.fastest_m_s(self.count(), self.time.duration_s)
    }

    /// Returns the wind at time 0.
    #[must_use]
    pub fn air(&self) -> Wind {
        Wind::new(&self.wind, self.count(), self.noise_seed)
    }

    /// Returns the reference at a time of the flight \[s\]; at rest at the origin without one.
    #[must_use]
    pub fn reference_at(&self, time_s: f64) -> Reference {
        self.reference.as_ref().map_or_else(Reference::at_rest, |guidance| guidance.motion.at(time_s))
    }

    /// Returns the observation of a true state at the beginning of the first leg, without imperfections.
    #[must_use]
    pub fn observation<'a>(&'a self, swarm: &'a Swarm) -> Observation<'a> {
        self.observation_at(swarm, 0.0)
    }

    /// Returns the observation of a true state at a time of the first leg \[s\], without imperfections.
    #[must_use]
    pub fn observation_at<'a>(&'a self, swarm: &'a Swarm, time_s: f64) -> Observation<'a> {
        let exact = Observation::exact(swarm, &self.graph, self.formation());
        let target = Target { reference: self.reference_at(time_s), ..exact.target };
        Observation { time_s, target, obstacles: &self.obstacles, ..exact }
    }
}
