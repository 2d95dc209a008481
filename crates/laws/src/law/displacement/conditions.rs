//! What the proof of the displacement law asks of a setting.

use super::super::certificate::Void;
use super::super::growth::{Frame, Growth};
use super::super::setting::Setting;
use crate::graph::Pinning;
use crate::target::{Guidance, ReferenceMotion};

/// Why nothing is certified from any start: followers are not told how their reference moves, a swarm is carried past obstacles
/// that stand, its absolute velocity, which counts among them, is fed, or what the wind does has no bound.
pub(super) fn voids(setting: &Setting<'_>) -> Vec<Void> {
    let &Setting { guidance, obstacles, a22_per_s, blown, .. } = setting;
    let is_unfed = |of: &Guidance| !of.feed_forward && !needs_no_feed(&of.motion, a22_per_s);
    let is_carried = guidance.is_some_and(|of| !of.motion.is_at_rest());
    let is_driven = guidance.is_none() && a22_per_s > 0.0;
    let is_turbulent = blown.is_some_and(|blown| blown.wind.turbulence.is_some());
    let is_led = guidance.is_some_and(|of| matches!(of.known_by, Pinning::Leader(_)));
    let reasons = [
        (guidance.is_some_and(is_unfed), Void::ReferenceNotFed),
        (!obstacles.is_empty() && is_carried, Void::CarriedPastObstacles),
        (!obstacles.is_empty() && is_driven, Void::VelocityUndamped),
        (
            is_turbulent && (frame(setting) == Frame::Ground || blown.is_some_and(|b| !b.wind.shared)),
            Void::WindUnbounded,
        ),
        (is_led && blown.is_some(), Void::LeaderBlown),
    ];
    reasons.into_iter().filter(|(holds, _)| *holds).map(|(_, void)| void).collect()
}

/// Whether a vehicle on the reference stays on it by itself.
fn needs_no_feed(motion: &ReferenceMotion, a22_per_s: f64) -> bool {
    motion.is_at_rest() || (motion.is_uniform() && a22_per_s == 0.0)
}

/// What the law's velocities are counted from: the mean where nobody knows a reference and nothing stands in the way.
fn frame(setting: &Setting<'_>) -> Frame {
    if setting.guidance.is_none() && setting.obstacles.is_empty() { Frame::Mean } else { Frame::Ground }
}

/// What the wind may add to the energy, of which relative velocities lose `margin_per_s` \[1/s\]. Among obstacles, without a
/// reference, absolute ones count, which nothing brakes but the air.
pub(super) fn growth(setting: &Setting<'_>, margin_per_s: f64) -> Option<Growth> {
    let blown = setting.blown?;
    let damping_per_s = match (setting.guidance, frame(setting)) {
        (None, Frame::Ground) => margin_per_s.min(-setting.a22_per_s),
        _ => margin_per_s,
    };
    Some(Growth::new(&blown, setting.links.count(), frame(setting), damping_per_s))
}
