//! The [`Law`] trait, its capabilities and rates, and the context from which laws are built.

use dyn_clone::DynClone;
use nalgebra::Vector3;

use super::certificate::{Certificate, VoidReason};
use super::error::{LawError, ParameterError};
use super::modes::Linear;
use crate::formation::{Formation, Freedom};
use crate::graph::{Graph, Pinning};
use crate::observation::Observation;
use crate::space::Metric;
use crate::target::{Guidance, Leg, Reference, SettlingMode, Target};
use crate::wind::WindSpec;
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::Rows;

/// Control law: maps the states that the vehicles know to one acceleration per vehicle.
///
/// A custom law implements [`Law::name`] and [`Law::command`] and runs like the built-in ones. The other methods have
/// defaults. [`Law::capabilities`] states what the law senses and controls. [`Law::certificate`] and [`Law::energy`]
/// give what is proved about it, [`Law::rates`] and [`Law::linear`] the rates of its closed loop. The internal state of
/// a law is saved with a simulation, so it must be [`Clone`].
pub trait Law: DynClone + Send {
    /// Short name for reports, such as `edge-tension`.
    fn name(&self) -> &str;

    /// Writes the commanded accelerations u \[m/s^2\], N x 3, into `command`. Row i depends only on the states
    /// that vehicle i knows.
    ///
    /// Called once a step; implementations keep their scratch memory so that nothing is allocated here.
    ///
    /// # Errors
    /// [`LawError`] where the law is not defined, such as a pair at or inside the safety distance of a barrier.
    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError>;

    /// Adopts a target whose slots have changed, before the next command.
    ///
    /// # Errors
    /// [`LawError`] where the law is not defined for that target; the law then keeps the previous one.
    fn follow(&mut self, _target: &Target<'_>) -> Result<(), LawError> {
        Ok(())
    }

    /// Seeds the random numbers of the law anew.
    fn reseed(&mut self, _seed: u64) {}

    /// Returns the needs, limits, controlled quantities and assumptions of the law. May change with the target.
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    /// Returns the law's Lyapunov function E \[m^2/s^2\], if it has one.
    fn energy(&self, _at: &Observation<'_>) -> Option<f64> {
        None
    }

    /// Returns the separation that the law guarantees from a start. A law with
    /// [`Capabilities::certifies_target_changes`] accounts for a target that goes through the formations `ahead` at any
    /// times. Each change is immediate or moves slots along straight lines. Other laws may ignore `ahead`:
    /// [`certificate_through`] voids their certificate.
    fn certificate(&self, _start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        Certificate::void(VoidReason::NoBarrier)
    }

    /// Returns bounds on the rates of the closed loop.
    fn rates(&self, query: &RateQuery) -> Rates {
        Rates::unknown(query)
    }

    /// Returns the linearized motion about the slots of a formation, if it is known.
    fn linear(&self, _formation: &Formation) -> Option<Linear> {
        None
    }
}

dyn_clone::clone_trait_object!(Law);

/// Returns the certificate of a law from a start through the formations `ahead`; void if the law does not certify
/// target changes.
#[must_use]
pub fn certificate_through(law: &dyn Law, start: &Observation<'_>, ahead: &[&Formation]) -> Certificate {
    let is_ignored = !ahead.is_empty() && !law.capabilities().certifies_target_changes;
    law.certificate(start, ahead).void_where(is_ignored, VoidReason::TargetChanges)
}

/// Needs, limits, controlled quantities and assumptions of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "the properties are independent")]
pub struct Capabilities {
    /// Needs of a vehicle besides states received over links, as short phrases: a common compass, a sensor.
    pub needs: &'static [&'static str],
    /// Quantities that the law controls.
    pub controls: Controls,
    /// Distance at which the law's barrier is infinite \[m\].
    ///
    /// The simulation refuses a step that removes more than half of a pair's clearance above this distance. It checks
    /// all pairs if the law has a sensing range, and otherwise linked pairs.
    pub barrier_m: Option<f64>,
    /// Distance up to which vehicles sense each other \[m\]; `None` for a law that uses links alone.
    pub sensing_range_m: Option<f64>,
    /// Largest acceleration that the law commands \[m/s^2\].
    pub max_command_m_s2: Option<f64>,
    /// Whether the law measures separations in the ellipsoid metric of its [`LawContext`].
    pub uses_ellipsoid_metric: bool,
    /// Whether the certificate of the law accounts for wind; otherwise wind voids it.
    pub certifies_under_wind: bool,
    /// Whether the certificate of the law accounts for formations ahead; otherwise a change of slots voids it.
    pub certifies_target_changes: bool,
    /// Whether the law keeps vehicles clear of obstacles; otherwise obstacles void its certificate.
    pub avoids_obstacles: bool,
    /// Whether the law must run on the calling thread. Otherwise the law of a large swarm runs in parallel with the
    /// audit.
    pub requires_calling_thread: bool,
    /// Settling of position errors of an undisturbed swarm. Set for a law that can follow slots that are spread for a
    /// while ([`crate::target::DeadlockOptions`]) and certifies again then.
    pub settling: Option<SettlingMode>,
    /// Assumptions of the certified separation, as a sentence.
    pub assumptions: &'static str,
}

impl Default for Capabilities {
    /// A law that uses links alone, has no barrier and controls displacements.
    fn default() -> Self {
        Self {
            needs: &[],
            controls: Controls::Displacements,
            barrier_m: None,
            sensing_range_m: None,
            max_command_m_s2: None,
            uses_ellipsoid_metric: false,
            certifies_under_wind: false,
            certifies_target_changes: false,
            avoids_obstacles: false,
            requires_calling_thread: false,
            settling: None,
            assumptions: "The certified separation holds for exact received and sensed states, no delay, no limit on \
                          the control and continuous time. The wind of the scenario is the only disturbance: it adds \
                          a bounded energy, and the tension of no pair exceeds the sum.",
        }
    }
}

/// Situation for which rates are bounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateQuery {
    /// Velocity coefficient of the vehicles \[1/s\].
    pub a22_per_s: f64,
    /// Lower bound of every separation \[m\]; `None` if no bound is known.
    pub nearest_m: Option<f64>,
    /// Lower bound of the clearance margin of every vehicle at every obstacle \[m\]; `None` without obstacles.
    pub obstacle_margin_m: Option<f64>,
    /// Algebraic connectivity of the graph.
    pub connectivity: f64,
}

impl RateQuery {
    /// Query for vehicles with velocity coefficient a22 \[1/s\] and separations of at least `nearest_m`, without
    /// obstacles, on a disconnected graph (connectivity 0).
    #[must_use]
    pub fn new(a22_per_s: f64, nearest_m: Option<f64>) -> Self {
        Self { a22_per_s, nearest_m, obstacle_margin_m: None, connectivity: 0.0 }
    }
}

/// Bounds on the rates of the closed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Upper bound on the rates \[1/s\] without obstacles. `None` if no bound is known, or if it depends on a distance
    /// that the query lacks.
    pub fastest_per_s: Option<f64>,
    /// Contribution of obstacles to the square of the fastest rate \[1/s^2\].
    pub obstacles_per_s2: f64,
    /// Lower bound of the damping rate of relative velocities.
    pub velocity_margin: Option<VelocityMargin>,
    /// Growth rate of the swarm's mean velocity \[1/s\]; negative where it decays.
    pub common_mode_per_s: f64,
}

impl Rates {
    /// Returns rates without bounds; the mean velocity of the swarm grows at rate a22.
    #[must_use]
    pub fn unknown(query: &RateQuery) -> Self {
        Self { fastest_per_s: None, obstacles_per_s2: 0.0, velocity_margin: None, common_mode_per_s: query.a22_per_s }
    }
}

/// Quantities that a law controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Controls {
    /// Distances alone: forces act along the lines between vehicles, and a formation is reached up to rotation,
    /// reflection and translation.
    Distances,
    /// Relative positions in a common frame: a formation is reached up to translation.
    Displacements,
    /// Absolute positions: slots are reached where the reference has moved them.
    Places,
}

impl Controls {
    /// Returns the motions by which a reached formation may differ from its slots.
    #[must_use]
    pub fn freedom(self) -> Freedom {
        match self {
            Self::Distances => Freedom::RigidMotion,
            Self::Displacements => Freedom::Translation,
            Self::Places => Freedom::Fixed,
        }
    }
}

/// Lower bound of the damping rate of relative velocities. Where it is negative, relative velocities may grow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityMargin {
    /// Margin \[1/s\].
    pub per_s: f64,
    /// Magnitude of the terms whose difference the margin is \[1/s\]: a margin below 1e-12 of it is rounding error.
    pub terms_per_s: f64,
    /// Remedy for a margin that is not positive, as a sentence.
    pub remedy: &'static str,
}

/// Input from which a law is built, besides its own keys.
#[derive(Clone, Copy, Debug)]
pub struct LawContext<'a> {
    /// Communication links.
    pub links: &'a Graph,
    /// Formation of the first leg.
    pub formation: &'a Formation,
    /// Legs after the first.
    pub later: &'a [Leg],
    /// Reference motion of the formations and the vehicles that know it.
    pub guidance: Option<&'a Guidance>,
    /// Obstacles in the world.
    pub obstacles: &'a [Obstacle],
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Velocity coefficient a22 of the vehicles \[1/s\], drag of the air included.
    pub a22_per_s: f64,
    /// Metric of delta and of all separations.
    pub metric: Metric,
    /// Wind on the vehicles, if there is any.
    pub exposure: Option<WindExposure<'a>>,
}

/// Wind and its effect on the vehicles.
#[derive(Clone, Copy, Debug)]
pub struct WindExposure<'a> {
    /// Wind of the scenario.
    pub wind: &'a WindSpec,
    /// Drag coefficient \[1/s\]: acceleration of a vehicle per velocity of the air relative to it.
    pub drag_per_s: f64,
    /// End of the run \[s\].
    pub until_s: f64,
    /// Resolution of positions \[m\]: a separation within this of delta cannot be distinguished from delta.
    pub resolution_m: f64,
}

impl<'a> LawContext<'a> {
    /// Context with one formation and no reference, obstacles or wind.
    #[must_use]
    pub fn new(links: &'a Graph, formation: &'a Formation, delta_m: f64, a22_per_s: f64) -> Self {
        Self {
            links,
            formation,
            later: &[],
            guidance: None,
            obstacles: &[],
            delta_m,
            a22_per_s,
            metric: Metric::default(),
            exposure: None,
        }
    }

    /// Returns the vehicles that know the reference.
    pub(super) fn pinning(&self) -> Pinning {
        self.guidance.map_or(Pinning::Unpinned, |guidance| guidance.known_by.clone())
    }
}

/// Use of the reference by a law whose vehicles must all know it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReferenceUse {
    /// Whether the scenario has a reference.
    is_guided: bool,
    /// Whether the vehicles know the acceleration of the reference.
    has_feed_forward: bool,
}

impl ReferenceUse {
    /// Reads the reference of the context.
    ///
    /// # Errors
    /// [`ParameterError::ReferenceNotHeard`] if some vehicle does not know the reference.
    pub(super) fn new(context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let Some(guidance) = context.guidance else { return Ok(Self { is_guided: false, has_feed_forward: false }) };
        match guidance.known_by {
            Pinning::All => Ok(Self { is_guided: true, has_feed_forward: guidance.feed_forward }),
            Pinning::Unpinned | Pinning::Listed(_) | Pinning::Leader(_) => Err(ParameterError::ReferenceNotHeard),
        }
    }

    /// Returns the feed-forward acceleration r'' of the reference \[m/s^2\], or zero without feed-forward.
    pub(super) fn feed_forward_m_s2(self, reference: &Reference) -> Vector3<f64> {
        if self.has_feed_forward { reference.acceleration_m_s2 } else { Vector3::zeros() }
    }

    /// Returns the controls and needs of a law that uses the reference in this way.
    pub(super) fn capabilities(self) -> Capabilities {
        const SENSING: &str = "each vehicle senses positions and velocities of near vehicles";
        let needs: &[&str] = if self.is_guided {
            &["a common compass, own position and the reference", SENSING]
        } else {
            &["a common compass and own position", SENSING]
        };
        let controls = if self.is_guided { Controls::Places } else { Controls::Displacements };
        Capabilities { needs, controls, ..Capabilities::default() }
    }
}
