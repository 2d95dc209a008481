//! A complete flight as plain data.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::time::TimeSpec;
use crate::link::{ActuationSpec, Failure, NetworkSpec, SensingSpec};
use crate::vehicle::Airframe;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::law::{EdgeTensionKeys, Law, LawContext, LawSpec, ParameterError, WindExposure};
use tautline_laws::observation::Observation;
use tautline_laws::space::{Metric, Obstacle};
use tautline_laws::target::{Arrival, DeadlockOptions, Guidance, Leg, Reference, Target};
use tautline_laws::wind::{Wind, WindSpec};

/// Default mass of a vehicle \[kg\].
pub const DEFAULT_MASS_KG: f64 = 1.0;
/// Default radius of a vehicle's solid hull \[m\].
pub const DEFAULT_HULL_RADIUS_M: f64 = 0.25;

/// A complete flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Name: letters, digits, `-` and `_`; it names the run's folder.
    pub name: String,
    /// Positions \[m\] and velocities \[m/s\] at time 0.
    pub start: Swarm,
    /// What kind of body each vehicle is; [`Scenario::set_airframe`] changes what depends on it too.
    pub airframe: Airframe,
    /// Whether the swarm lives in the plane z = 0 or in space.
    pub space: Space,
    /// Mass of each vehicle \[kg\].
    pub mass_kg: Vec<f64>,
    /// Radius of each vehicle's solid hull \[m\].
    pub hull_radius_m: Vec<f64>,
    /// Velocity coefficient a22 of the plant \[1/s\], equation (1): negative is drag, positive feeds energy in.
    pub a22_per_s: f64,
    /// Drag of a point over its mass, linear in the velocity of the air past it \[1/s\].
    pub drag_per_s: f64,
    /// What blows.
    pub wind: WindSpec,
    /// The formations to be reached, one after the other and at least one, up to a rigid motion for laws that control
    /// distances only.
    pub legs: Vec<Leg>,
    /// Solids at rest that are in the way.
    pub obstacles: Vec<Obstacle>,
    /// The motion that formations are carried along with, and who knows it; a formation without one is reached wherever it
    /// comes to be.
    pub reference: Option<Guidance>,
    /// Which vehicles sense each other.
    pub graph: Graph,
    /// The control law and its parameters.
    pub law: LawSpec,
    /// Safety distance delta \[m\] that the audit judges by, whatever the law: the width of what must stay empty around a vehicle.
    pub delta_m: f64,
    /// The shape of that.
    pub safety: Safety,
    /// The body that carries out the commands.
    pub plant: PlantSpec,
    /// Duration and rates.
    pub time: TimeSpec,
    /// What counts as reached.
    pub arrival: Arrival,
    /// When slots are spread to let vehicles past each other, under laws that allow it.
    pub deadlock: DeadlockOptions,
    /// What vehicles measure.
    pub sensing: SensingSpec,
    /// What they hear of each other.
    pub network: NetworkSpec,
    /// How commands become accelerations.
    pub actuation: ActuationSpec,
    /// Vehicles of which a part fails.
    pub failures: Vec<Failure>,
    /// Seed of every random number that is drawn in flight.
    pub noise_seed: u64,
}

/// What must stay empty around a vehicle, delta wide.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[schemars(tag = "shape")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Safety {
    /// A ball of half of `law.delta_m`.
    #[default]
    Ball,
    /// An upright ellipsoid. Separation above and below counts for more, for example because of downwash.
    Ellipsoid {
        /// Half axes in m. The two level ones are the same, and `law.delta_m`, if given, is twice that.
        #[schemars(extend("items" = { "type": "number", "exclusiveMinimum": 0 }))]
        half_axes_m: [f64; 3],
    },
}

/// The space that a swarm lives in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The plane z = 0, kept exactly: translation along z is locked.
    Plane,
    /// All three axes.
    Volume,
}

impl Space {
    /// Number of its axes.
    #[must_use]
    pub fn dimensions(self) -> usize {
        match self {
            Self::Plane => 2,
            Self::Volume => 3,
        }
    }
}

/// Which plant flies.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PlantSpec {
    /// Rapier rigid bodies, the command held over each step.
    #[default]
    Rapier,
    /// The equation p'' = a22 v + u solved to 12 digits in continuous time: what Rapier is measured against.
    Ideal,
}

impl Scenario {
    /// A flight with the defaults of the scenario file: the edge-tension law on the complete graph, in the plane if start
    /// and formation lie in it. Change the fields as needed, then [`Scenario::validate`].
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
            delta_m,
            safety: Safety::Ball,
            plant: PlantSpec::Rapier,
            time: TimeSpec::lasting(duration_s),
            arrival: Arrival::default(),
            deadlock: DeadlockOptions::default(),
            sensing: SensingSpec::default(),
            network: NetworkSpec::default(),
            actuation: ActuationSpec::default(),
            failures: Vec::new(),
            noise_seed: 0,
            start,
            legs: vec![Leg::first(formation)],
            obstacles: Vec::new(),
            reference: None,
        }
    }

    /// Whether the physics engine moves the vehicles: on straight lines within steps, and off what they hit.
    #[must_use]
    pub fn has_engine(&self) -> bool {
        matches!((&self.airframe, self.plant), (Airframe::Point | Airframe::Quadrotor(_), PlantSpec::Rapier))
    }

    /// Number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.start.count()
    }

    /// The formation of the first leg; one without slots where there is no leg, which a validated scenario has.
    #[must_use]
    pub fn formation(&self) -> &Formation {
        static NOWHERE: LazyLock<Formation> = LazyLock::new(|| Formation::line(0, 1.0));
        self.legs.first().map_or(&NOWHERE, |leg| &leg.formation)
    }

    /// The law that this scenario asks for, ready to fly.
    ///
    /// # Errors
    /// [`ParameterError`] when the law does not exist for these parameters, which a validated scenario rules out, or
    /// its memory cannot be had.
    pub fn law(&self) -> Result<Box<dyn Law>, ParameterError> {
        let guidance = self.reference.as_ref();
        let later = self.legs.get(1..).unwrap_or_default();
        let context = LawContext::new(&self.graph, self.formation(), self.delta_m, self.velocity_coefficient_per_s());
        let exposure = (!self.wind.is_still()).then(|| WindExposure {
            wind: &self.wind,
            drag_per_s: self.drag_per_s,
            until_s: self.time.duration_s,
            resolution_m: self.told_apart_m(),
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

    /// What a vehicle's own velocity accelerates it by, a22 less the drag of the air \[1/s\]: with the wind W,
    /// p'' = (a22 - drag) v + u + drag W.
    #[must_use]
    pub fn velocity_coefficient_per_s(&self) -> f64 {
        self.a22_per_s - self.drag_per_s
    }

    /// The lengths that distances between vehicles are judged in, of which delta is one: metres for balls.
    #[must_use]
    pub fn metric(&self) -> Metric {
        match self.safety {
            Safety::Ball => Metric::default(),
            Safety::Ellipsoid { half_axes_m: [.., half_height_m] } => {
                Metric::of_ratio(half_height_m / (0.5 * self.delta_m))
            }
        }
    }

    /// Half axes of the ellipsoid that must stay empty around a vehicle \[m\]; none for a ball.
    #[must_use]
    pub fn half_axes_m(&self) -> Option<[f64; 3]> {
        match self.safety {
            Safety::Ball => None,
            Safety::Ellipsoid { half_axes_m: [.., half_height_m] } => {
                Some([0.5 * self.delta_m, 0.5 * self.delta_m, half_height_m])
            }
        }
    }

    /// The wind at time 0, as it blows in flight.
    #[must_use]
    pub fn air(&self) -> Wind {
        Wind::new(&self.wind, self.count(), self.noise_seed)
    }

    /// Where the reference is at a time of the flight \[s\]; at rest at the origin where there is none.
    #[must_use]
    pub fn reference_at(&self, time_s: f64) -> Reference {
        self.reference.as_ref().map_or_else(Reference::at_rest, |guidance| guidance.motion.at(time_s))
    }

    /// What a law is told of a true state at the beginning of the first leg, by sensors and radio without fault.
    #[must_use]
    pub fn observation<'a>(&'a self, swarm: &'a Swarm) -> Observation<'a> {
        self.observation_at(swarm, 0.0)
    }

    /// The same at a time of the first leg \[s\].
    #[must_use]
    pub fn observation_at<'a>(&'a self, swarm: &'a Swarm, time_s: f64) -> Observation<'a> {
        let exact = Observation::exact(swarm, &self.graph, self.formation());
        let target = Target { reference: self.reference_at(time_s), ..exact.target };
        Observation { time_s, target, obstacles: &self.obstacles, ..exact }
    }
}
