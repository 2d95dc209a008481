//! What a law is.

use dyn_clone::DynClone;

use super::certificate::{Certificate, Void};
use super::error::LawError;
use super::modes::Linear;
use crate::formation::{Formation, Freedom};
use crate::observation::Observation;
use crate::target::{Settling, Target};
use tautline_core::swarm::Rows;

/// A control law: a function from what the vehicles know to an acceleration for each.
///
/// A law of your own implements [`Law::name`] and [`Law::command`] and is flown like the built-in ones. Its memory, if it
/// has any, is saved with a simulation, so it must be [`Clone`].
pub trait Law: DynClone + Send {
    /// Short name for reports, such as `edge-tension`.
    fn name(&self) -> &str;

    /// Writes the commanded accelerations u \[m/s^2\], N x 3, into `command`. Row i is to rest on nothing but what
    /// vehicle i knows.
    ///
    /// Called once a step; implementations keep their scratch memory so that nothing is allocated here.
    ///
    /// # Errors
    /// [`LawError`] where the law is not defined, such as a pair at or inside the keep-out distance of a barrier.
    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError>;

    /// Takes note of a target whose slots have changed, before it is asked about it.
    ///
    /// # Errors
    /// [`LawError`] where the law is not defined for that target; it then goes on for the one before.
    fn follow(&mut self, _target: &Target<'_>) -> Result<(), LawError> {
        Ok(())
    }

    /// The law's Lyapunov function E \[m^2/s^2\] where it has one.
    fn energy(&self, _at: &Observation<'_>) -> Option<f64> {
        None
    }

    /// What the law promises about separation from this start on, before the first step.
    fn certificate(&self, _start: &Observation<'_>) -> Certificate {
        Certificate::void(Void::NoBarrier)
    }

    /// What the law promises from this state on if its target then goes through these formations, each taken up at once or
    /// along the straight lines between slots, at any time.
    fn certificate_through(&self, start: &Observation<'_>, ahead: &[&Formation]) -> Certificate {
        self.certificate(start).void_where(!ahead.is_empty(), Void::TargetChanges)
    }

    /// What the certified distance rests on, a sentence.
    fn promise(&self) -> &'static str {
        "The certified distance holds for exact states of all whom a vehicle hears and sees, no delay, no limit on the control, no \
         disturbance but the wind of the scenario and continuous time: the law's energy grows by no more than that wind can add, and \
         no pair can hold more than all of it."
    }

    /// Distance below which no pair joined by a link comes for as long as the energy does not exceed that of this start
    /// \[m\], where the law knows one. On a graph that is not complete it is no certificate: other pairs may come closer.
    fn linked_separation_m(&self, _start: &Observation<'_>) -> Option<f64> {
        None
    }

    /// Distance at which the law's barrier is infinite \[m\], where it has a barrier. The loop refuses a step that
    /// takes more than half of the clearance above it from a linked pair, or from any pair where the law has a
    /// [sensing range](Law::sensing_range_m).
    fn barrier_m(&self) -> Option<f64> {
        None
    }

    /// How near of each other vehicles must be for the law to ask what they *see* of each other \[m\]; a law that lives
    /// on links alone asks nothing.
    fn sensing_range_m(&self) -> Option<f64> {
        None
    }

    /// Whether it is asked by the thread that flies and by no other. A large swarm's law is asked beside the audit unless this
    /// is `true`.
    fn stays_in_its_thread(&self) -> bool {
        false
    }

    /// Begins its random numbers anew.
    fn reseed(&mut self, _seed: u64) {}

    /// What the law needs beside states over the links, in a few words each: a common compass, a sensor.
    fn needs(&self) -> &'static [&'static str] {
        &[]
    }

    /// What the law holds vehicles to.
    fn controls(&self) -> Controls {
        Controls::Displacements
    }

    /// Upper bound on the rates of the closed loop \[1/s\] while no pair is nearer than `nearest_m`, for vehicles with
    /// velocity coefficient a22. `None` where none is known, or where it depends on a distance that is not given.
    fn fastest_rate_per_s(&self, _nearest_m: Option<f64>, _a22_per_s: f64) -> Option<f64> {
        None
    }

    /// Largest acceleration that the law commands of a vehicle \[m/s^2\], where it has a limit.
    fn max_command_m_s2(&self) -> Option<f64> {
        None
    }

    /// Whether the law keeps vehicles apart in the lengths of its [`Setting`](super::Setting), of which distances between them are then
    /// told, and not in metres alone.
    fn keeps_ellipsoids(&self) -> bool {
        false
    }

    /// Whether what the law certifies counts a wind in. What any other certifies is void where one blows.
    fn reckons_with_wind(&self) -> bool {
        false
    }

    /// Whether the law keeps vehicles clear of the obstacles that it is told of. What any other certifies is void where there
    /// are some: it is certified of vehicles that hit nothing.
    fn keeps_clear_of_obstacles(&self) -> bool {
        false
    }

    /// What obstacles add to the square of [`Law::fastest_rate_per_s`] \[1/s^2\] while no vehicle has less than `room_m` from
    /// any of them beyond its clearance.
    fn obstacle_rate_squared(&self, _room_m: f64) -> f64 {
        0.0
    }

    /// How errors of position settle where nothing stands in their way, for a law that may be given slots that are spread for a
    /// while ([`crate::target::Breathing`]) and renews its promise then. `None` for any other.
    fn settling(&self) -> Option<Settling> {
        None
    }

    /// How fast relative velocities are damped at least, on a graph of this algebraic connectivity.
    fn velocity_margin(&self, _connectivity: f64, _a22_per_s: f64) -> Option<VelocityMargin> {
        None
    }

    /// Linear motion about the slots of a formation, where it is known.
    fn linear(&self, _formation: &Formation) -> Option<Linear> {
        None
    }

    /// Rate at which the swarm's mean velocity grows by itself \[1/s\]; negative where it decays.
    fn common_mode_rate_per_s(&self, a22_per_s: f64) -> f64 {
        a22_per_s
    }
}

dyn_clone::clone_trait_object!(Law);

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
