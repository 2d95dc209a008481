//! Certificates: the separation that a law guarantees before the first step, or the reasons why it guarantees none.

use super::error::LawError;
use tautline_core::impl_coded;

/// Separation that a law guarantees from a given start, or the reasons why the certificate is void.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certificate {
    /// Lower bound of the separation of every pair \[m\], under the assumptions of the law's proof.
    pub certified_m: Option<f64>,
    /// End of validity \[s\] of the certified bounds; `None` if they hold for all time. Persistent wind limits it.
    pub certified_until_s: Option<f64>,
    /// Lower bound of the clearance margin of every vehicle at every obstacle \[m\]: distance from the surface less the
    /// obstacle's clearance. `None` without obstacles, or if the law does not avoid them.
    pub certified_clearance_margin_m: Option<f64>,
    /// Energy E(0) of the start \[m^2/s^2\], if the law has an energy; also given when the certificate is void.
    pub energy_initial: Option<f64>,
    /// Lower bound of the separation of linked pairs \[m\] while the energy does not exceed E(0). On an incomplete
    /// graph this is no certificate, because unlinked pairs may come closer.
    pub linked_m: Option<f64>,
    /// Every reason why the certificate is void.
    pub void: Vec<VoidReason>,
    /// Bounds per leg, in order, for a mission of several formations; `certified_m` is the least of them.
    pub legs: Vec<LegBound>,
}

/// Bounds from the beginning of a leg to the beginning of the next leg, or for all time after the last leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegBound {
    /// Upper bound of the energy \[m^2/s^2\].
    pub energy: f64,
    /// Lower bound of the separation of every pair \[m\].
    pub certified_m: Option<f64>,
    /// Lower bound of the clearance margin of every vehicle at every obstacle \[m\].
    pub certified_clearance_margin_m: Option<f64>,
}

/// Reason why a certificate is void.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VoidReason {
    /// The law does not push vehicles apart.
    #[error("The law has no barrier: it does not keep vehicles apart.")]
    NoBarrier,
    /// Some pair has no edge in the graph.
    #[error("The graph is not complete: pairs without an edge are not kept apart.")]
    GraphNotComplete,
    /// The velocity gain a22 of the vehicles exceeds the damping of the law, so the energy may grow.
    #[error("The velocity gain a22 of the vehicles exceeds the damping of the law: the energy may grow.")]
    VelocityUndamped,
    /// The law limits its command, and the acceleration that keeps vehicles apart may be larger.
    #[error("The law limits its command: the acceleration that keeps vehicles apart may exceed the limit.")]
    CommandLimited,
    /// The law has a proof, but no bound for a scenario is computed from it.
    #[error("The law has a proof, but no bound for a scenario is computed from it.")]
    NoBoundComputed,
    /// The target changes during the run.
    #[error("The target changes during the run: the law's proof does not cover the change.")]
    TargetChanges,
    /// The law receives inexact states, or its commands arrive changed.
    #[error("The states that the law receives, or the commands that arrive, are not exact.")]
    InexactLink,
    /// Sensed states, the vehicle's own included, are late.
    #[error(
        "The sensed states are late: vehicles have moved since the measurement \
         (sensing.latency_s, sensing.near_latency_s, sensing.rate_hz)."
    )]
    SensingDelayed,
    /// Sensed states have errors.
    #[error("The sensed states have errors (sensing.position_noise_m, position_bias_m, velocity_noise_m_s).")]
    SensingInexact,
    /// Received states of other vehicles are late.
    #[error(
        "The received states are late: each message has a latency and is used until the next one arrives \
         (network.latency_s, network.rate_hz)."
    )]
    MessagesDelayed,
    /// Some messages are lost.
    #[error(
        "The network loses messages: vehicles use the last state that arrived (network.loss, network.failure, failure)."
    )]
    MessagesLost,
    /// The acceleration of each vehicle is limited.
    #[error(
        "The acceleration is limited: the one that keeps vehicles apart may exceed the limit \
         (actuation.max_accel_m_s2)."
    )]
    AccelerationLimited,
    /// Accelerations follow the commands with a lag.
    #[error("The acceleration follows the command with a lag (actuation.lag_s).")]
    AccelerationLagged,
    /// A vehicle fails and no longer carries out the law's commands.
    #[error("The run continues with a failed vehicle that does not carry out the law's commands (failure).")]
    VehicleFails,
    /// The caller supplied commands in place of the law's.
    #[error("The commands came from the caller in place of the law.")]
    ExternalCommands,
    /// Commands are held constant over control periods.
    #[error("The commands are held constant over each control period (time.control_hz).")]
    CommandsHeld,
    /// The scenario has wind, and the law's proof excludes wind.
    #[error("The wind acts on the vehicles: the law's proof covers still air only.")]
    WindNotCovered,
    /// The wind is turbulent, and its contribution to the energy has no bound.
    #[error("The wind is turbulent (wind.dryden): its contribution to the energy has no bound.")]
    WindUnbounded,
    /// The wind pushes the leader off the reference, and the law's proof assumes that the leader flies it exactly.
    #[error("The wind pushes the leader off the reference: the law's proof assumes a leader exactly on it.")]
    LeaderInWind,
    /// Vehicles have dynamics of their own, so they carry out commands with delay and error.
    #[error("The vehicles are not points: they carry out a command with delay and error (vehicle.model).")]
    VehicleNotPoint,
    /// The motion of the reference is not fed forward to the vehicles.
    #[error("The motion of the reference is not fed forward to the vehicles (reference.feed_forward).")]
    NoFeedForward,
    /// The scenario has obstacles, and the law does not avoid them.
    #[error("The law does not keep clear of obstacles: its proof does not cover vehicles that hit one.")]
    ObstaclesNotAvoided,
    /// The reference moves the swarm among fixed obstacles.
    #[error("The reference moves among fixed obstacles: it may press the swarm against them.")]
    ReferenceAmongObstacles,
    /// The law needs shorter time steps than the run was allowed to take.
    #[error("The law needs shorter time steps than the run could take: the motion flown is outside the law's proof.")]
    StepsTooLong,
    /// A bound that the shield assumes was exceeded in flight.
    #[error("The flight exceeded a bound that the shield assumes: its proof does not cover this flight.")]
    ShieldExceeded,
    /// The certified separation exceeds delta by less than the resolution of positions.
    #[error("The certified separation exceeds delta by less than the position resolution: the energy is too high.")]
    Unresolved,
    /// The law is undefined at the start, for example with a pair at or inside its safety distance.
    #[error("The law is undefined at the start: {0}.")]
    StartRefused(LawError),
}

impl_coded! { VoidReason {
    Self::NoBarrier => "no-barrier",
    Self::GraphNotComplete => "graph-not-complete",
    Self::VelocityUndamped => "velocity-undamped",
    Self::CommandLimited => "command-limited",
    Self::NoBoundComputed => "no-bound-computed",
    Self::TargetChanges => "target-changes",
    Self::InexactLink => "inexact-link",
    Self::SensingDelayed => "sensing-delayed",
    Self::SensingInexact => "sensing-inexact",
    Self::MessagesDelayed => "messages-delayed",
    Self::MessagesLost => "messages-lost",
    Self::AccelerationLimited => "acceleration-limited",
    Self::AccelerationLagged => "acceleration-lagged",
    Self::VehicleFails => "vehicle-fails",
    Self::ExternalCommands => "external-commands",
    Self::CommandsHeld => "commands-held",
    Self::WindNotCovered => "wind-not-covered",
    Self::WindUnbounded => "wind-unbounded",
    Self::LeaderInWind => "leader-in-wind",
    Self::VehicleNotPoint => "vehicle-not-point",
    Self::NoFeedForward => "no-feed-forward",
    Self::ObstaclesNotAvoided => "obstacles-not-avoided",
    Self::ReferenceAmongObstacles => "reference-among-obstacles",
    Self::StepsTooLong => "steps-too-long",
    Self::ShieldExceeded => "shield-exceeded",
    Self::Unresolved => "unresolved",
    Self::StartRefused(LawError::Collision { .. }) => "start-too-close",
    Self::StartRefused(_) => "start-refused",
} }

impl Certificate {
    /// Returns a void certificate with one reason.
    #[must_use]
    pub fn void(reason: VoidReason) -> Self {
        Self { void: vec![reason], ..Self::default() }
    }

    /// Combines this certificate with a `later` one that was computed on leg `leg` (from 0) after its slots were
    /// spread.
    ///
    /// Keeps the smaller of each bound, and no bound if either certificate has none. The legs of `later` are the spread
    /// slots, the slots of leg `leg`, and the legs after it.
    pub fn renew(&mut self, later: &Self, leg: usize) {
        if self.certified_m.is_none() {
            return;
        }
        let least = |before_m: Option<f64>, now_m: Option<f64>| before_m.zip(now_m).map(|(a, b)| a.min(b));
        self.certified_m = least(self.certified_m, later.certified_m);
        self.certified_clearance_margin_m =
            least(self.certified_clearance_margin_m, later.certified_clearance_margin_m);
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
            bound.certified_clearance_margin_m =
                least(bound.certified_clearance_margin_m, now.certified_clearance_margin_m);
        }
    }

    /// Adds a reason, and removes all bounds, if `breaks` is true.
    #[must_use]
    pub fn void_where(mut self, breaks: bool, reason: VoidReason) -> Self {
        if breaks && !self.void.contains(&reason) {
            (self.certified_m, self.certified_until_s, self.certified_clearance_margin_m) = (None, None, None);
            self.legs.clear();
            self.void.push(reason);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::fact::Coded as _;
    use tautline_core::swarm::Pair;

    #[test]
    fn renewing_a_certificate_never_raises_its_bound() {
        let promised = |certified_m: Option<f64>| Certificate {
            certified_m,
            energy_initial: Some(1.0),
            void: if certified_m.is_some() { Vec::new() } else { vec![VoidReason::NoBarrier] },
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
    fn every_void_reason_has_a_unique_code_and_a_sentence() {
        let collision = LawError::Collision { pair: Pair::new(0, 1), separation_m: 1.5, delta_m: 2.0 };
        let reasons = [
            VoidReason::NoBarrier,
            VoidReason::GraphNotComplete,
            VoidReason::VelocityUndamped,
            VoidReason::CommandLimited,
            VoidReason::NoBoundComputed,
            VoidReason::TargetChanges,
            VoidReason::InexactLink,
            VoidReason::SensingDelayed,
            VoidReason::SensingInexact,
            VoidReason::MessagesDelayed,
            VoidReason::MessagesLost,
            VoidReason::AccelerationLimited,
            VoidReason::AccelerationLagged,
            VoidReason::VehicleFails,
            VoidReason::ExternalCommands,
            VoidReason::CommandsHeld,
            VoidReason::WindNotCovered,
            VoidReason::WindUnbounded,
            VoidReason::LeaderInWind,
            VoidReason::VehicleNotPoint,
            VoidReason::NoFeedForward,
            VoidReason::ObstaclesNotAvoided,
            VoidReason::ReferenceAmongObstacles,
            VoidReason::StepsTooLong,
            VoidReason::ShieldExceeded,
            VoidReason::Unresolved,
            VoidReason::StartRefused(collision),
            VoidReason::StartRefused(LawError::NotFinite { vehicle: 2 }),
        ];
        let codes = reasons.map(|reason| reason.code());
        let expected = [
            "no-barrier",
            "graph-not-complete",
            "velocity-undamped",
            "command-limited",
            "no-bound-computed",
            "target-changes",
            "inexact-link",
            "sensing-delayed",
            "sensing-inexact",
            "messages-delayed",
            "messages-lost",
            "acceleration-limited",
            "acceleration-lagged",
            "vehicle-fails",
            "external-commands",
            "commands-held",
            "wind-not-covered",
            "wind-unbounded",
            "leader-in-wind",
            "vehicle-not-point",
            "no-feed-forward",
            "obstacles-not-avoided",
            "reference-among-obstacles",
            "steps-too-long",
            "shield-exceeded",
            "unresolved",
            "start-too-close",
            "start-refused",
        ];
        assert_eq!(codes, expected);
        for reason in reasons {
            let sentence = reason.to_string();
            assert!(sentence.starts_with("The ") && sentence.ends_with('.') && !sentence.ends_with(".."));
        }
        assert_eq!(
            reasons[26].to_string(),
            "The law is undefined at the start: vehicles 1 and 2 are 1.500 m apart, not more than the safety distance \
             2.000 m."
        );
    }
}
