//! What a law is, and what it is built from.

use dyn_clone::DynClone;
use nalgebra::Vector3;

use super::certificate::{Certificate, Void};
use super::error::{LawError, ParameterError};
use super::modes::Linear;
use crate::formation::{Formation, Freedom};
use crate::graph::{Graph, Pinning};
use crate::observation::Observation;
use crate::space::{Metric, Obstacle};
use crate::target::{Guidance, Leg, Reference, Settling, Target};
use crate::wind::WindSpec;
use tautline_core::swarm::Rows;

/// A control law: a function from what the vehicles know to an acceleration for each.
///
/// A law of your own implements [`Law::name`] and [`Law::command`] and is flown like the built-in ones. The other methods have
/// defaults: [`Law::capabilities`] states what the law senses and controls, [`Law::certificate`] and [`Law::energy`] what it
/// proves, [`Law::rates`] and [`Law::linear`] how fast its closed loop is. Its memory, if it has any, is saved with a
/// simulation, so it must be [`Clone`].
pub trait Law: DynClone + Send {
    /// Short name for reports, such as `edge-tension`.
    fn name(&self) -> &str;

    /// Writes the commanded accelerations u \[m/s^2\], N x 3, into `command`. Row i depends only on what vehicle i knows.
    ///
    /// Called once a step; implementations keep their scratch memory so that nothing is allocated here.
    ///
    /// # Errors
    /// [`LawError`] where the law is not defined, such as a pair at or inside the keep-out distance of a barrier.
    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError>;

    /// Takes over a target whose slots have changed, before the next command.
    ///
    /// # Errors
    /// [`LawError`] where the law is not defined for that target; it then goes on for the one before.
    fn follow(&mut self, _target: &Target<'_>) -> Result<(), LawError> {
        Ok(())
    }

    /// Restarts the random numbers of the law.
    fn reseed(&mut self, _seed: u64) {}

    /// What the law senses, limits, controls and assumes. May change with the target.
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    /// The law's Lyapunov function E \[m^2/s^2\] where it has one.
    fn energy(&self, _at: &Observation<'_>) -> Option<f64> {
        None
    }

    /// Separation that the law guarantees from a start on. A law with [`Capabilities::certifies_target_changes`] accounts for
    /// a target that then goes through the formations `ahead`, each taken up at once or along the straight lines between
    /// slots, at any time. Any other law may ignore them: [`certificate_through`] voids its certificate.
    fn certificate(&self, _start: &Observation<'_>, _ahead: &[&Formation]) -> Certificate {
        Certificate::void(Void::NoBarrier)
    }

    /// Bounds on the rates of the closed loop.
    fn rates(&self, at: &RateQuery) -> Rates {
        Rates::unknown(at)
    }

    /// Linear motion about the slots of a formation, where it is known.
    fn linear(&self, _formation: &Formation) -> Option<Linear> {
        None
    }
}

dyn_clone::clone_trait_object!(Law);

/// The certificate of a law from a start on through the formations `ahead`, void where the law does not account for them.
#[must_use]
pub fn certificate_through(law: &dyn Law, start: &Observation<'_>, ahead: &[&Formation]) -> Certificate {
    let is_ignored = !ahead.is_empty() && !law.capabilities().certifies_target_changes;
    law.certificate(start, ahead).void_where(is_ignored, Void::TargetChanges)
}

/// What a law senses, limits, controls and assumes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a property of its own")]
pub struct Capabilities {
    /// What a vehicle needs beside states over the links, in a few words each: a common compass, a sensor.
    pub needs: &'static [&'static str],
    /// What the law holds vehicles to.
    pub controls: Controls,
    /// Distance at which the law's barrier is infinite \[m\]. The loop refuses a step that takes more than half of the
    /// clearance above it from a linked pair, or from any pair where the law has a sensing range.
    pub barrier_m: Option<f64>,
    /// Distance from which on vehicles see each other \[m\]; `None` for a law that uses links alone.
    pub sensing_range_m: Option<f64>,
    /// Largest acceleration that the law commands of a vehicle \[m/s^2\].
    pub max_command_m_s2: Option<f64>,
    /// Whether the law measures distances between vehicles in the ellipsoid of its [`LawContext`].
    pub uses_ellipsoid_metric: bool,
    /// Whether the certificate of the law accounts for wind. Any other certificate is void in wind.
    pub certifies_under_wind: bool,
    /// Whether the certificate of the law accounts for formations ahead. Any other certificate is void where slots change.
    pub certifies_target_changes: bool,
    /// Whether the law keeps vehicles clear of obstacles. Any other certificate is void among obstacles.
    pub avoids_obstacles: bool,
    /// Whether the law runs on the calling thread alone. The law of a large swarm runs beside the audit otherwise.
    pub requires_calling_thread: bool,
    /// How errors of position settle where nothing stands in their way, for a law that can follow slots that are spread for
    /// a while ([`crate::target::DeadlockOptions`]) and certifies anew then.
    pub settling: Option<Settling>,
    /// The assumptions of the certified distance, a sentence.
    pub assumptions: &'static str,
}

impl Default for Capabilities {
    /// A law on links alone, without a barrier, that controls displacements.
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
            assumptions: "The certified distance holds for exact states of all vehicles that a vehicle hears and sees, no delay, no limit \
                          on the control, no disturbance but the wind of the scenario and continuous time: the law's energy grows \
                          by no more than that wind can add, and no pair can hold more than all of it.",
        }
    }
}

/// The situation for which rates are bounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateQuery {
    /// Velocity coefficient of the vehicles \[1/s\].
    pub a22_per_s: f64,
    /// No pair is nearer than this \[m\]; `None` where no bound is known.
    pub nearest_m: Option<f64>,
    /// No vehicle has less than this from an obstacle beyond its clearance \[m\]; `None` without obstacles.
    pub obstacle_room_m: Option<f64>,
    /// Algebraic connectivity of the graph.
    pub connectivity: f64,
}

impl RateQuery {
    /// Vehicles with velocity coefficient a22 \[1/s\] that come no nearer to each other than `nearest_m`, without obstacles, on a
    /// graph that is not connected.
    #[must_use]
    pub fn new(a22_per_s: f64, nearest_m: Option<f64>) -> Self {
        Self { a22_per_s, nearest_m, obstacle_room_m: None, connectivity: 0.0 }
    }
}

/// Bounds on the rates of the closed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Upper bound on the rates \[1/s\] without obstacles. `None` where none is known, or where it depends on a distance that
    /// is not given.
    pub fastest_per_s: Option<f64>,
    /// What obstacles add to the square of the fastest rate \[1/s^2\].
    pub obstacles_per_s2: f64,
    /// How fast relative velocities are damped at least.
    pub velocity_margin: Option<VelocityMargin>,
    /// Rate at which the mean velocity of the swarm grows by itself \[1/s\]; negative where it decays.
    pub common_mode_per_s: f64,
}

impl Rates {
    /// No bound; the mean velocity of the swarm grows with a22.
    #[must_use]
    pub fn unknown(at: &RateQuery) -> Self {
        Self { fastest_per_s: None, obstacles_per_s2: 0.0, velocity_margin: None, common_mode_per_s: at.a22_per_s }
    }
}

/// What a law holds vehicles to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Controls {
    /// Distances alone: it pushes and pulls along the lines between vehicles, and a formation is reached up to rotation,
    /// reflection and translation.
    Distances,
    /// Differences of positions, in the directions of the common frame: a formation is reached up to translation.
    Displacements,
    /// Places: slots are reached where the reference has carried them.
    Places,
}

impl Controls {
    /// What a formation may be moved by and count as reached.
    #[must_use]
    pub fn freedom(self) -> Freedom {
        match self {
            Self::Distances => Freedom::RigidMotion,
            Self::Displacements => Freedom::Translation,
            Self::Places => Freedom::Fixed,
        }
    }
}

/// How fast relative velocities are damped: at least at this rate where it is positive, and perhaps growing where it is
/// negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityMargin {
    /// The margin \[1/s\].
    pub per_s: f64,
    /// The size of the terms that it is the difference of \[1/s\]: a margin of a 1e-12th of that is rounding.
    pub terms_per_s: f64,
    /// What to do where it is not positive, a sentence.
    pub remedy: &'static str,
}

/// What a law is built from beside its own keys.
#[derive(Clone, Copy, Debug)]
pub struct LawContext<'a> {
    /// Who talks to whom.
    pub links: &'a Graph,
    /// The formation of the first leg.
    pub formation: &'a Formation,
    /// The legs after it.
    pub later: &'a [Leg],
    /// The motion that formations are carried along with, and which vehicles know it.
    pub guidance: Option<&'a Guidance>,
    /// What stands in the way.
    pub obstacles: &'a [Obstacle],
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Velocity coefficient a22 of the vehicles \[1/s\], drag of the air included.
    pub a22_per_s: f64,
    /// The lengths that delta is one of, and that vehicles are kept apart in.
    pub metric: Metric,
    /// What pushes them beside their commands, where anything does.
    pub exposure: Option<WindExposure<'a>>,
}

/// A wind, and how it is felt.
#[derive(Clone, Copy, Debug)]
pub struct WindExposure<'a> {
    /// What blows.
    pub wind: &'a WindSpec,
    /// Acceleration of a vehicle over the velocity of the air past it \[1/s\].
    pub drag_per_s: f64,
    /// End of the flight \[s\].
    pub until_s: f64,
    /// A distance that exceeds delta by no more than this is not told from it \[m\].
    pub resolution_m: f64,
}

impl<'a> LawContext<'a> {
    /// One formation, wherever it comes to be.
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

    /// Who knows the reference.
    pub(super) fn pinning(&self) -> Pinning {
        self.guidance.map_or(Pinning::Nobody, |guidance| guidance.known_by.clone())
    }
}

/// What vehicles know of a reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReferenceUse {
    /// Whether there is one.
    is_guided: bool,
    /// Whether they are told how it accelerates.
    is_fed: bool,
}

impl ReferenceUse {
    /// Of a scenario.
    ///
    /// # Errors
    /// [`ParameterError::ReferenceNotHeard`] where some do not know the reference.
    pub(super) fn new(context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let Some(guidance) = context.guidance else { return Ok(Self { is_guided: false, is_fed: false }) };
        match guidance.known_by {
            Pinning::All => Ok(Self { is_guided: true, is_fed: guidance.feed_forward }),
            Pinning::Nobody | Pinning::Listed(_) | Pinning::Leader(_) => Err(ParameterError::ReferenceNotHeard),
        }
    }

    /// r'' as far as it is told \[m/s^2\].
    pub(super) fn fed_m_s2(self, reference: &Reference) -> Vector3<f64> {
        if self.is_fed { reference.acceleration_m_s2 } else { Vector3::zeros() }
    }

    /// What a law with such a reference controls and needs.
    pub(super) fn capabilities(self) -> Capabilities {
        const SEES: &str = "each sees who is near and how fast it moves";
        let needs: &[&str] = if self.is_guided {
            &["all share a compass, know where they are and know the reference", SEES]
        } else {
            &["all share a compass and know where they are", SEES]
        };
        let controls = if self.is_guided { Controls::Places } else { Controls::Displacements };
        Capabilities { needs, controls, ..Capabilities::default() }
    }
}
