//! Delays and command rates that the formation tolerates in linear theory.

use serde::Serialize;

use super::warning::significant;
use crate::scenario::Scenario;
use crate::vehicle::Model;
use tautline_laws::law::{Law, LawSpec, Linear, Mode};

/// Predicted tolerance of the formation to an imperfection.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedMargin {
    /// Key of the imperfection.
    pub key: &'static str,
    /// Contact of the vehicles near their slots.
    pub state: ContactState,
    /// Whether `value` is an upper or a lower limit.
    pub bound: Bound,
    /// Limit in the unit of the key; null if every value is tolerated.
    pub value: Option<f64>,
}

/// Contact of the vehicles near their slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactState {
    /// No pair in contact: beyond the limit the smallest disturbance grows. An upper bound on the tolerance.
    Free,
    /// The nearest pairs at the edge of contact, as they are at the goal: a lower bound on the tolerance.
    InContact,
}

/// Direction of a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bound {
    /// Upper limit.
    AtMost,
    /// Lower limit.
    AtLeast,
}

const SENSING_LATENCY: &str = "sensing.latency_s";
const NETWORK_LATENCY: &str = "network.latency_s";
const CONTROL_RATE: &str = "time.control_hz";

/// Returns the margins of linear theory for the first formation. Empty if the modes of the law are unknown, and for
/// vehicles that are not points, whose own lag the theory does not include.
pub(super) fn margins(law: &dyn Law, scenario: &Scenario) -> Vec<PredictedMargin> {
    if !scenario.airframe.is_point() {
        return Vec::new();
    }
    let Some(linear) = law.linear(scenario.formation()) else { return Vec::new() };
    let Linear { stiffest_contact_mode, received, .. } = &linear;
    let a22_per_s = scenario.velocity_coefficient_per_s();
    let at_most = |key, state, value: f64| PredictedMargin { key, state, bound: Bound::AtMost, value: finite(value) };
    let at_least = |state, period_s: f64| PredictedMargin {
        key: CONTROL_RATE,
        state,
        bound: Bound::AtLeast,
        value: finite(1.0 / period_s).filter(|rate_hz| *rate_hz > 0.0),
    };
    let mut margins = vec![at_most(SENSING_LATENCY, ContactState::Free, linear.delay_margin_s(a22_per_s))];
    margins.extend(
        stiffest_contact_mode
            .map(|mode| at_most(SENSING_LATENCY, ContactState::InContact, mode.delay_margin_s(a22_per_s))),
    );
    let received_s = received.as_ref().and_then(|received| received.delay_margin_s(a22_per_s));
    margins.extend(received_s.map(|received_s| at_most(NETWORK_LATENCY, ContactState::Free, received_s)));
    margins.push(at_least(ContactState::Free, linear.sampling_margin_s(a22_per_s)));
    margins
        .extend(stiffest_contact_mode.map(|mode| at_least(ContactState::InContact, mode.sampling_margin_s(a22_per_s))));
    margins
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Returns a message if a scenario exceeds a margin of free vehicles.
pub(super) fn exceeded_margin(margins: &[PredictedMargin], scenario: &Scenario) -> Option<String> {
    let given = |key: &str| match key {
        SENSING_LATENCY => Some(scenario.sensing.latency_s),
        NETWORK_LATENCY => Some(scenario.network.latency_s),
        _ => scenario.time.control_hz,
    };
    margins.iter().filter(|margin| margin.state == ContactState::Free).find_map(|margin| {
        let (given, value) = (given(margin.key)?, margin.value?);
        let (is_beyond, limit) = match margin.bound {
            Bound::AtMost => (given > value, "upper"),
            Bound::AtLeast => (given < value, "lower"),
        };
        is_beyond.then(|| {
            // With a22 > 0 the common motion grows at any delay, and the margin leaves it out.
            let has_common = margin.key == NETWORK_LATENCY && scenario.velocity_coefficient_per_s() <= 0.0;
            let common = if has_common { " of the swarm, common motion included," } else { "" };
            format!(
                "{} = {given} is beyond the {limit} limit {}: a small disturbance{common} grows, even without other \
                 imperfections.",
                margin.key,
                significant(value),
            )
        })
    })
}

/// Returns a message if the lag of quadrotors makes the formation oscillate with its nearest slots in contact.
///
/// A mode has the stiffness K, the damping C, and the drag d and the response G of a quadrotor:
///
/// ```text
/// s (s + d) + G (K + C s) = 0        G = w^2/(tau s^3 + s^2 + 2 zeta w s + w^2)
/// ```
///
/// A repulsion acts only below its rest length, so its mean stiffness over an oscillation is half.
pub(super) fn lag_in_contact(law: &dyn Law, scenario: &Scenario) -> Option<String> {
    let model = &scenario.airframe.quadrotor()?.model;
    let LawSpec::Displacement(keys) = &scenario.law else { return None };
    let linear = law.linear(scenario.formation())?;
    let stiffest = linear.free.iter().max_by(|a, b| a.stiffness_per_s2.total_cmp(&b.stiffness_per_s2))?;
    let contact = linear.stiffest_contact_mode?;
    let mode = Mode { stiffness_per_s2: f64::midpoint(stiffest.stiffness_per_s2, contact.stiffness_per_s2), ..contact };
    let drag_per_s = model.hover_drag_per_s();
    let is_stable = |damping_per_s: f64| is_damped(Mode { damping_per_s, ..mode }, model, drag_per_s);
    if is_stable(mode.damping_per_s) {
        return None;
    }
    let factors = (1..=MOST_DAMPING).map(|step| 1.0 + 0.1 * f64::from(step));
    let remedy = match factors.into_iter().find(|factor| is_stable(factor * mode.damping_per_s)) {
        Some(factor) => format!("Raise law.zeta_per_s to {}", significant(factor * keys.zeta_per_s)),
        None => "Lower law.k_per_s2".to_owned(),
    };
    Some(format!(
        "The vehicles lag, and near the slots they push each other: a mode of stiffness {} 1/s^2 and damping {} 1/s \
         may keep oscillating. {remedy}, or lower law.alpha.",
        significant(mode.stiffness_per_s2),
        significant(mode.damping_per_s)
    ))
}

/// Largest damping that is tried, in tenths of that of the law.
const MOST_DAMPING: u32 = 60;

/// Returns whether all roots of a mode under the lag of a quadrotor have negative real parts, by the criterion of
/// Routh.
fn is_damped(mode: Mode, model: &Model, drag_per_s: f64) -> bool {
    let (lag_s, omega) = (model.lag_s(), model.attitude_rad_s);
    let (twice, square) = (2.0 * model.attitude_damping * omega, omega * omega);
    let mut above = [lag_s, twice + drag_per_s, square * (drag_per_s + mode.damping_per_s)];
    let mut row = [1.0 + lag_s * drag_per_s, square + twice * drag_per_s, square * mode.stiffness_per_s2];
    for _ in 0..5 {
        if row[0] <= 0.0 {
            return false;
        }
        let ratio = above[0] / row[0];
        let next = [above[1] - ratio * row[1], above[2] - ratio * row[2], 0.0];
        (above, row) = (row, next);
    }
    true
}

/// Returns the margins in one line.
pub(super) fn line(margins: &[PredictedMargin]) -> Option<String> {
    let margin_of = |key: &str| {
        let mut parts = margins.iter().filter(|margin| margin.key == key).map(|margin| {
            let state = if margin.state == ContactState::Free { "" } else { " in contact" };
            let bound = if margin.bound == Bound::AtMost { "up to" } else { "from" };
            margin.value.map_or_else(|| format!("any{state}"), |value| format!("{bound} {}{state}", significant(value)))
        });
        let first = parts.next()?;
        Some(parts.fold(format!("{key} {first}"), |line, part| format!("{line}, {part}")))
    };
    let lines: Vec<_> = [SENSING_LATENCY, NETWORK_LATENCY, CONTROL_RATE].into_iter().filter_map(margin_of).collect();
    (!lines.is_empty()).then(|| lines.join("; ") + " (each without other imperfections)")
}
