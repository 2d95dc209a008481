//! How late and how seldom the law may be asked near its formation, as linear theory says.

use serde::Serialize;

use super::warning::significant;
use crate::scenario::Scenario;
use tautline_laws::law::{Law, Linear};

/// How much of an imperfection the formation is predicted to bear.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedMargin {
    /// The key of the imperfection.
    pub key: &'static str,
    /// What is near the slots.
    pub state: Near,
    /// Whether `value` is the most or the least that is borne.
    pub bound: Bound,
    /// In the unit that the key names; null where anything is borne.
    pub value: Option<f64>,
}

/// What is near the slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Near {
    /// Vehicles that push nobody: beyond this the smallest disturbance grows. A bound from above on what is borne.
    Free,
    /// The nearest vehicles are on the edge of pushing each other, as they are at the goal: a bound from below.
    InContact,
}

/// Which end of what is borne.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bound {
    /// No more than this.
    AtMost,
    /// No less than this.
    AtLeast,
}

const KNOWN_LATE: &str = "sensing.latency_s";
const HEARD_LATE: &str = "network.latency_s";
const COMMANDED: &str = "time.control_hz";

/// What linear theory predicts for the first formation; nothing where the law's modes are not known, nor for vehicles that are
/// more than points, whose own lag the theory does not know.
pub(super) fn margins(law: &dyn Law, scenario: &Scenario) -> Vec<PredictedMargin> {
    if !scenario.airframe.is_point() {
        return Vec::new();
    }
    let Some(linear) = law.linear(scenario.formation()) else { return Vec::new() };
    let Linear { stiffest_contact_mode, heard, .. } = &linear;
    let a22_per_s = scenario.velocity_coefficient_per_s();
    let at_most = |key, state, value: f64| PredictedMargin { key, state, bound: Bound::AtMost, value: finite(value) };
    let at_least = |state, period_s: f64| PredictedMargin {
        key: COMMANDED,
        state,
        bound: Bound::AtLeast,
        value: finite(1.0 / period_s).filter(|rate_hz| *rate_hz > 0.0),
    };
    let mut margins = vec![at_most(KNOWN_LATE, Near::Free, linear.delay_margin_s(a22_per_s))];
    margins
        .extend(stiffest_contact_mode.map(|mode| at_most(KNOWN_LATE, Near::InContact, mode.delay_margin_s(a22_per_s))));
    let heard_s = heard.as_ref().and_then(|heard| heard.delay_margin_s(a22_per_s));
    margins.extend(heard_s.map(|heard_s| at_most(HEARD_LATE, Near::Free, heard_s)));
    margins.push(at_least(Near::Free, linear.sampling_margin_s(a22_per_s)));
    margins.extend(stiffest_contact_mode.map(|mode| at_least(Near::InContact, mode.sampling_margin_s(a22_per_s))));
    margins
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// What a scenario asks for that is more than free vehicles bear, in words.
pub(super) fn beyond(margins: &[PredictedMargin], scenario: &Scenario) -> Option<String> {
    let asked = |key: &str| match key {
        KNOWN_LATE => Some(scenario.sensing.latency_s),
        HEARD_LATE => Some(scenario.network.latency_s),
        _ => scenario.time.control_hz,
    };
    margins.iter().filter(|margin| margin.state == Near::Free).find_map(|margin| {
        let (asked, value) = (asked(margin.key)?, margin.value?);
        let (is_beyond, most) = match margin.bound {
            Bound::AtMost => (asked > value, "most"),
            Bound::AtLeast => (asked < value, "least"),
        };
        is_beyond.then(|| {
            let what = if margin.key == HEARD_LATE { "of the swarm, its common motion too," } else { "about the formation" };
            format!(
                "{} is {asked}, and the {most} at which a small disturbance {what} decays, with everything else exact, is {}: \
                 beyond it grows.",
                margin.key,
                significant(value)
            )
        })
    })
}

/// The margins in a line.
pub(super) fn line(margins: &[PredictedMargin]) -> Option<String> {
    let of = |key: &str| {
        let mut parts = margins.iter().filter(|margin| margin.key == key).map(|margin| {
            let state = if margin.state == Near::Free { "" } else { " in contact" };
            let bound = if margin.bound == Bound::AtMost { "up to" } else { "from" };
            margin.value.map_or_else(|| format!("any{state}"), |value| format!("{bound} {}{state}", significant(value)))
        });
        let first = parts.next()?;
        Some(parts.fold(format!("{key} {first}"), |line, part| format!("{line}, {part}")))
    };
    let lines: Vec<_> = [KNOWN_LATE, HEARD_LATE, COMMANDED].into_iter().filter_map(of).collect();
    (!lines.is_empty()).then(|| lines.join("; ") + " (each alone, all else exact)")
}
