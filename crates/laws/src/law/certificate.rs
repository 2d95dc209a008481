//! What a law promises about separation before the first step.

use super::error::LawError;

/// The separation that a law guarantees from a given start, or why it guarantees none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certificate {
    /// No pair ever comes closer than this \[m\], under the assumptions of the law's proof.
    pub certified_m: Option<f64>,
    /// What is certified holds up to then \[s\], where it does not hold for ever: a wind blows on.
    pub certified_until_s: Option<f64>,
    /// No vehicle ever comes nearer to an obstacle than its clearance and this \[m\], where the law keeps clear of obstacles
    /// and there are some.
    pub certified_room_m: Option<f64>,
    /// Energy E(0) of the start \[m^2/s^2\], where the law has one, whether or not it certifies anything.
    pub energy_initial: Option<f64>,
    /// No pair joined by a link comes closer than this \[m\] for as long as the energy does not exceed that of the start. On a
    /// graph that is not complete it is no certificate: other pairs may come closer.
    pub linked_m: Option<f64>,
    /// Every reason why nothing is certified.
    pub void: Vec<Void>,
    /// The same for each of several formations that are gone through, in their order: `certified_m` is the least of them.
    pub legs: Vec<LegBound>,
}

/// What holds from the beginning of a leg to the beginning of the next, and for ever after the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegBound {
    /// The energy does not exceed this \[m^2/s^2\].
    pub energy: f64,
    /// No pair comes closer than this \[m\].
    pub certified_m: Option<f64>,
    /// No vehicle comes nearer to an obstacle than its clearance and this \[m\].
    pub certified_room_m: Option<f64>,
}

/// Why a certificate is void.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Void {
    /// The law does not push vehicles apart.
    #[error("The law has no barrier: it does not keep vehicles apart.")]
    NoBarrier,
    /// Some pair is not joined by an edge.
    #[error("The graph is not complete: pairs without an edge are not kept apart.")]
    GraphNotComplete,
    /// Each vehicle is fed more than it is braked: the energy may grow.
    #[error("The vehicles are fed more than the law brakes them: the energy may grow.")]
    VelocityUndamped,
    /// What a vehicle may command is limited, and what keeps two apart may be more.
    #[error("The law limits what it commands: what keeps vehicles apart may be more than that.")]
    CommandLimited,
    /// The target changes while the swarm flies.
    #[error("The target changes: what holds for the first leg need not for the next.")]
    TargetChanges,
    /// What the vehicles know is not the true present state, or what they command does not arrive as given.
    #[error("The vehicles do not know the true present state.")]
    InexactLink,
    /// What vehicles know, their own state included, is some time old.
    #[error(
        "The vehicles know what is old: the swarm has moved on since it was measured (sensing.latency_s, sensing.rate_hz)."
    )]
    KnownLate,
    /// What vehicles measure is off the truth.
    #[error(
        "The vehicles measure what is off the truth (sensing.position_noise_m, position_bias_m, velocity_noise_m_s)."
    )]
    KnownWrongly,
    /// What vehicles hear of each other is some time old.
    #[error(
        "The vehicles hear of each other what is old when it arrives, and held until more comes (network.latency_s, network.rate_hz)."
    )]
    HeardLate,
    /// Some of what vehicles send is not heard.
    #[error(
        "The network loses messages, and what was heard before stands for them (network.loss, network.failure, failure)."
    )]
    MessagesLost,
    /// No vehicle is accelerated by more than a limit.
    #[error(
        "The vehicles are not accelerated by more than a limit, and what keeps two apart may be more (actuation.max_accel_m_s2)."
    )]
    AccelerationLimited,
    /// Vehicles are accelerated as they were commanded some time before.
    #[error("The acceleration follows the command with a lag (actuation.lag_s).")]
    AccelerationLate,
    /// A vehicle does not do what the law commands.
    #[error("The flight goes on with a vehicle that fails and does not do what the law commands (failure).")]
    VehicleFails,
    /// Accelerations came from outside in the place of the law's.
    #[error("The vehicles were commanded from outside.")]
    CommandsFromOutside,
    /// Each command is held for a period of its own.
    #[error("The vehicles hold each command while the swarm moves on (time.control_hz).")]
    CommandsHeld,
    /// A wind blows, and the law's proof is of vehicles that nothing pushes.
    #[error("The law's proof is of vehicles that nothing else pushes: the wind does.")]
    Windblown,
    /// The wind is turbulent, and turbulence has no bound.
    #[error("The wind is turbulent (wind.dryden): what it adds to the energy has no bound.")]
    WindUnbounded,
    /// The wind pushes the leader off the reference that its followers are told.
    #[error("The wind pushes the leader off the reference: its followers are told another motion.")]
    LeaderBlown,
    /// Vehicles are bodies that tilt and whose rotors lag: no command is carried out at once.
    #[error("The vehicles are no points: a command is not carried out at once and as it is given (vehicle.model).")]
    NotAPoint,
    /// The vehicles are not told how the reference that they follow moves.
    #[error("The vehicles are not told how their reference moves (reference.feed_forward).")]
    ReferenceNotFed,
    /// There are obstacles, and the law does not keep clear of them.
    #[error("The law does not keep clear of obstacles: what hits one moves in another way than it says.")]
    ObstaclesUnknown,
    /// The swarm is carried past obstacles that stand.
    #[error("The reference moves and obstacles stand: what the swarm is carried by may press it against them.")]
    CarriedPastObstacles,
    /// The law asked for shorter steps than the flight was allowed to take.
    #[error(
        "The law asked for shorter steps than could be flown: what was flown is not the motion that its proof is of."
    )]
    StepsTooLong,
    /// What would be certified is so near delta that the plant's numbers do not tell the two apart.
    #[error(
        "The distance that the law certifies is nearer to delta than positions are told apart: there is too much energy."
    )]
    Unresolved,
    /// The law has no answer for the start, such as a pair at or inside its safety distance.
    #[error("The law has no answer for the start: {0}.")]
    StartRefused(LawError),
}

impl Certificate {
    /// A certificate that promises nothing, for one reason.
    #[must_use]
    pub fn void(reason: Void) -> Self {
        Self { void: vec![reason], ..Self::default() }
    }

    /// What holds of a flight for which this was promised first and another promise was made on a leg, from 0, after its
    /// slots were spread: the least of both, which is nothing where either is nothing. The later promise is of the spread
    /// slots, of those of the leg, and of the legs after it.
    pub fn renew(&mut self, later: &Self, leg: usize) {
        if self.certified_m.is_none() {
            return;
        }
        let least = |before_m: Option<f64>, now_m: Option<f64>| before_m.zip(now_m).map(|(a, b)| a.min(b));
        self.certified_m = least(self.certified_m, later.certified_m);
        self.certified_room_m = least(self.certified_room_m, later.certified_room_m);
        let ends = [self.certified_until_s, later.certified_until_s];
        self.certified_until_s = ends.into_iter().flatten().reduce(f64::min);
        self.void.clone_from(&later.void);
        if self.certified_m.is_none() {
            self.certified_until_s = None;
            self.legs.clear();
        }
        for (bound, now) in self.legs.iter_mut().skip(leg).zip(later.legs.iter().skip(1)) {
            bound.energy = bound.energy.max(now.energy);
            bound.certified_m = least(bound.certified_m, now.certified_m);
            bound.certified_room_m = least(bound.certified_room_m, now.certified_room_m);
        }
    }

    /// The same, promising nothing for one more reason where `breaks` says so.
    #[must_use]
    pub fn void_where(mut self, breaks: bool, reason: Void) -> Self {
        if breaks && !self.void.contains(&reason) {
            (self.certified_m, self.certified_until_s, self.certified_room_m) = (None, None, None);
            self.legs.clear();
            self.void.push(reason);
        }
        self
    }
}

impl Void {
    /// A stable name for files, such as `graph-not-complete`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoBarrier => "no-barrier",
            Self::GraphNotComplete => "graph-not-complete",
            Self::VelocityUndamped => "velocity-undamped",
            Self::CommandLimited => "command-limited",
            Self::TargetChanges => "target-changes",
            Self::InexactLink => "inexact-link",
            Self::KnownLate => "known-late",
            Self::KnownWrongly => "known-wrongly",
            Self::HeardLate => "heard-late",
            Self::MessagesLost => "messages-lost",
            Self::AccelerationLimited => "acceleration-limited",
            Self::AccelerationLate => "acceleration-late",
            Self::VehicleFails => "vehicle-fails",
            Self::CommandsFromOutside => "commands-from-outside",
            Self::CommandsHeld => "commands-held",
            Self::Windblown => "windblown",
            Self::WindUnbounded => "wind-unbounded",
            Self::LeaderBlown => "leader-blown",
            Self::NotAPoint => "not-a-point",
            Self::ReferenceNotFed => "reference-not-fed",
            Self::ObstaclesUnknown => "obstacles-unknown",
            Self::CarriedPastObstacles => "carried-past-obstacles",
            Self::StepsTooLong => "steps-too-long",
            Self::Unresolved => "certificate-unresolved",
            Self::StartRefused(LawError::Collision { .. }) => "start-too-close",
            Self::StartRefused(_) => "start-refused",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Pair;

    #[test]
    fn a_renewed_promise_is_never_more_than_the_one_before() {
        let promised = |certified_m: Option<f64>| Certificate {
            certified_m,
            energy_initial: Some(1.0),
            void: if certified_m.is_some() { Vec::new() } else { vec![Void::NoBarrier] },
            ..Certificate::default()
        };
        for (before, later, expected) in [
            (Some(2.0), Some(1.5), Some(1.5)),
            (Some(1.5), Some(2.0), Some(1.5)),
            (None, Some(2.0), None),
            (Some(2.0), None, None),
        ] {
            let mut certificate = promised(before);
            certificate.renew(&promised(later), 0);
            assert_eq!(certificate.certified_m, expected);
            assert_eq!(certificate.void.is_empty(), expected.is_some());
        }
    }

    #[test]
    fn every_reason_has_its_own_code_and_a_sentence() {
        let collision = LawError::Collision { pair: Pair::new(0, 1), separation_m: 1.5, delta_m: 2.0 };
        let reasons = [
            Void::NoBarrier,
            Void::GraphNotComplete,
            Void::VelocityUndamped,
            Void::CommandLimited,
            Void::TargetChanges,
            Void::InexactLink,
            Void::KnownLate,
            Void::KnownWrongly,
            Void::HeardLate,
            Void::MessagesLost,
            Void::AccelerationLimited,
            Void::AccelerationLate,
            Void::VehicleFails,
            Void::CommandsFromOutside,
            Void::CommandsHeld,
            Void::Windblown,
            Void::WindUnbounded,
            Void::LeaderBlown,
            Void::NotAPoint,
            Void::ReferenceNotFed,
            Void::ObstaclesUnknown,
            Void::CarriedPastObstacles,
            Void::StepsTooLong,
            Void::Unresolved,
            Void::StartRefused(collision),
            Void::StartRefused(LawError::NotFinite { vehicle: 2 }),
        ];
        let codes = reasons.map(|reason| reason.code());
        let expected = [
            "no-barrier",
            "graph-not-complete",
            "velocity-undamped",
            "command-limited",
            "target-changes",
            "inexact-link",
            "known-late",
            "known-wrongly",
            "heard-late",
            "messages-lost",
            "acceleration-limited",
            "acceleration-late",
            "vehicle-fails",
            "commands-from-outside",
            "commands-held",
            "windblown",
            "wind-unbounded",
            "leader-blown",
            "not-a-point",
            "reference-not-fed",
            "obstacles-unknown",
            "carried-past-obstacles",
            "steps-too-long",
            "certificate-unresolved",
            "start-too-close",
            "start-refused",
        ];
        assert_eq!(codes, expected);
        for reason in reasons {
            let sentence = reason.to_string();
            assert!(sentence.starts_with("The ") && sentence.ends_with('.') && !sentence.ends_with(".."));
        }
        assert_eq!(
            reasons[24].to_string(),
            "The law has no answer for the start: vehicles 1-2 are 1.5 m apart, not more than the safety distance 2 m."
        );
    }
}
