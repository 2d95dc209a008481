//! Notices of a watch as text and as JSON.

use serde_json::{Map, Value, json};

use crate::event::{Assessment, Event, Fault, Pair, PairTime, Reason, Refusal, State};
use crate::monitor::Monitor;
use crate::settings::REPORTED_DEVIATIONS;
use tautline_core::fact::{Coded as _, Fact, FactKind, FactValue, Source};
use tautline_core::option::{ACCEL, MAX_VEHICLES, POSITION_ERROR};

/// Notice for the user: a state, or an event.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// Kind: `state`, `heard`, `stale`, `back`, `signed-off`, `violation`, `violation-end`, `plan`, `fault`,
    /// `connected`, `lost` or `summary`.
    pub event: &'static str,
    /// Line of text.
    pub text: String,
    /// The notice as JSON.
    pub json: Value,
}

impl Notice {
    pub(crate) fn new(event: &'static str, at_s: f64, text: String, more: Value) -> Self {
        let mut json = Map::new();
        json.insert("event".to_owned(), event.into());
        json.insert("t_s".to_owned(), number(at_s));
        if let Value::Object(more) = more {
            json.extend(more);
        }
        json.insert("text".to_owned(), text.clone().into());
        let text = if at_s.is_finite() { format!("{} s: {text}", fixed(at_s)) } else { text };
        Self { event, text, json: Value::Object(json) }
    }

    /// Returns the notice of a judgement.
    #[must_use]
    pub fn of_state(of: &Assessment, monitor: &Monitor) -> Self {
        let name = |vehicle: u32| name(monitor, vehicle);
        let two = |pair: Pair| pair.map(name);
        let timed = |of: Option<PairTime>| of.map(|of| json!({ "pair": two(of.pair), "t_s": of.at_s }));
        let closest = of
            .closest
            .map(|near| json!({ "pair": two(near.pair), "nominal_m": near.nominal_m, "least_m": near.least_m }));
        let mut text = state_text(of, monitor);
        if let Some(near) = of.closest {
            text.extend([format!("; closest {} {} m", joined(&two(near.pair)), down(near.nominal_m))]);
            if !matches!(of.state, State::Violation(..)) {
                text.extend([format!(", at least {} m", down(near.least_m.max(0.0)))]);
            }
        }
        if let Some(first) = of.nominal_violation.filter(|_| !matches!(of.state, State::Violation(..))) {
            text.extend([format!("; on course to violate: {} at {} s", joined(&two(first.pair)), fixed(first.at_s))]);
        }
        if let Some(brake) = of.last_brake.filter(|_| !matches!(of.state, State::Violation(..))) {
            let left_s = brake.at_s - of.now_s;
            let moment = if left_s > 0.0 {
                format!("; brake {} by {} s", joined(&two(brake.pair)), down(brake.at_s))
            } else {
                format!("; the last moment to brake {} has passed", joined(&two(brake.pair)))
            };
            text.extend([moment]);
        }
        if of.signed_off > 0 {
            text.extend([format!("; signed off: {} of {}", of.signed_off, of.heard)]);
        }
        let (state, reason, pair, distance) = match of.state {
            State::Clear => ("clear", None, None, None),
            State::NotKnown(reason) => ("not-known", Some(reason_name(reason)), None, None),
            State::Violation(pair, distance_m) => ("violation", None, Some(two(pair)), Some(distance_m)),
        };
        let facts = matches!(of.state, State::Clear).then(|| monitor.facts());
        let deviation = of.deviation.map(|(vehicle, metres)| json!({ "id": name(vehicle), "deviation_m": metres }));
        let more = json!({
            "state": state,
            "reason": reason,
            "pair": pair,
            "distance_m": distance,
            "vehicles": of.heard,
            "signed_off": of.signed_off,
            "closest": closest,
            "clear_until": timed(of.clear_until),
            "clear_to_horizon": of.is_clear_to_horizon,
            "facts": facts,
            "nominal_violation": timed(of.nominal_violation),
            "last_brake": timed(of.last_brake),
            "plan": deviation,
        });
        Self::new("state", of.now_s, text, more)
    }

    /// Returns the notice of an event; `said` is the sentence of the last error of the input.
    #[must_use]
    pub fn of_event(event: &Event, monitor: &Monitor, said: &str) -> Self {
        let name = |vehicle: u32| name(monitor, vehicle);
        let settings = monitor.settings();
        match *event {
            Event::Heard { vehicle, at_s } => {
                Self::new("heard", at_s, format!("heard {}", name(vehicle)), json!({ "id": name(vehicle) }))
            }
            Event::Stale { vehicle, age_s, at_s } => {
                let text = format!("{} is stale: not heard for {} s", name(vehicle), fixed(age_s));
                Self::new("stale", at_s, text, json!({ "id": name(vehicle), "age_s": age_s }))
            }
            Event::SignedOff { vehicle, at_s } => {
                let text = format!("{} signed off", name(vehicle));
                Self::new("signed-off", at_s, text, json!({ "id": name(vehicle) }))
            }
            Event::Back { vehicle, signed_off_s, at_s } => {
                let since = signed_off_s.map_or_else(String::new, |since_s| {
                    format!(" after its sign-off: its separation since {} s is NOT KNOWN", fixed(since_s))
                });
                let text = format!("{} is heard again{since}", name(vehicle));
                Self::new("back", at_s, text, json!({ "id": name(vehicle), "signed_off_s": signed_off_s }))
            }
            Event::Began(of) => {
                let pair = of.pair.map(name);
                let text = format!("violation of {} began", joined(&pair));
                Self::new("violation", of.from_s, text, json!({ "pair": pair, "from_s": of.from_s }))
            }
            Event::Ended(of) => {
                let pair = of.pair.map(name);
                let text = format!(
                    "violation of {} from {} s to {} s, smallest distance {} m at {} s (delta {} m)",
                    joined(&pair),
                    fixed(of.from_s),
                    fixed(of.to_s),
                    down(of.min_m),
                    fixed(of.min_at_s),
                    settings.delta_m
                );
                let more = json!({
                    "pair": pair, "from_s": of.from_s, "to_s": of.to_s, "min_m": of.min_m, "min_at_s": of.min_at_s,
                });
                Self::new("violation-end", of.to_s, text, more)
            }
            Event::Plan { vehicle, deviation_m, is_outside, at_s } => {
                let tube_m = settings.tube_m;
                let text = if is_outside {
                    format!("OFF PLAN {} {deviation_m:.2} m (tube {tube_m} m)", name(vehicle))
                } else {
                    format!("{} is within {tube_m} m of its plan again", name(vehicle))
                };
                let more = json!({ "id": name(vehicle), "deviation_m": deviation_m, "outside": is_outside });
                Self::new("plan", at_s, text, more)
            }
            Event::Fault { fault, count, vehicle, refusal, at_s } => {
                let of = vehicle.map(&name);
                let mut text = fault_text(fault, of.as_deref());
                if let Some(refusal) = refusal {
                    text.extend([refusal_text(refusal, monitor)]);
                }
                if count > 1 {
                    text.extend([format!(" ({count} times)")]);
                }
                if matches!(fault, Fault::Garbage | Fault::Dropped) && !said.is_empty() {
                    text.extend([format!(": {said}")]);
                }
                let cause = refusal.map(refusal_name);
                Self::new(
                    "fault",
                    at_s,
                    text,
                    json!({ "fault": fault.name(), "count": count, "id": of, "cause": cause }),
                )
            }
        }
    }
}

/// Returns the name of a vehicle for a line of text: control characters, such as the end of a line, are replaced.
pub(crate) fn name(monitor: &Monitor, vehicle: u32) -> String {
    monitor.names().get(vehicle as usize).map(|name| on_one_line(name)).unwrap_or_default()
}

/// Replaces control characters, and the other characters that begin a line.
fn on_one_line(text: &str) -> String {
    let is_wrong = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
    text.replace(is_wrong, "\u{fffd}")
}

fn joined([a, b]: &[String; 2]) -> String {
    format!("{a}-{b}")
}

/// Returns the verdict of a judgement.
fn state_text(of: &Assessment, monitor: &Monitor) -> String {
    let name = |vehicle: u32| name(monitor, vehicle);
    match of.state {
        State::Clear => {
            let at_s = of.clear_until.map_or(of.now_s, |until| until.at_s);
            let left_s = at_s - of.now_s;
            let bounds = bounds_text(&monitor.facts());
            format!("CLEAR until {} s ({} s from now){bounds}", down(at_s), down(left_s))
        }
        State::Violation(pair, distance_m) => {
            let delta_m = monitor.settings().delta_m;
            format!("VIOLATION {} {} m (delta {delta_m} m)", joined(&pair.map(name)), down(distance_m))
        }
        State::NotKnown(reason) => {
            let why = match reason {
                Reason::TooFew(0) => "no vehicle is heard".to_owned(),
                Reason::TooFew(_) => "only one vehicle is heard".to_owned(),
                Reason::Missing([heard, expected]) => format!("{heard} of {expected} vehicles are heard"),
                Reason::MissingName(_) => {
                    let missing = monitor.missing();
                    let shown: Vec<_> = missing.iter().take(5).map(|name| on_one_line(name)).collect();
                    let more = if missing.len() > shown.len() { ", ..." } else { "" };
                    format!("not heard yet: {}{more}", shown.join(", "))
                }
                Reason::SignedOff(0) => "every vehicle has signed off".to_owned(),
                Reason::SignedOff(_) => "only one vehicle has not signed off".to_owned(),
                Reason::Stale(vehicle, age_s) => format!("{} not heard for {} s", name(vehicle), fixed(age_s)),
                Reason::SpeedUnknown(vehicle) => format!("the velocity of {} is not known yet", name(vehicle)),
                Reason::ErrorUnknown(vehicle) => {
                    format!("{} reports no accuracy of its positions; give {POSITION_ERROR}", name(vehicle))
                }
                Reason::TwoStreams(vehicle) => fault_text(Fault::TwoStreams, Some(&name(vehicle))),
                Reason::ClockStepped(vehicle) => format!("{} not heard since the step of the clock", name(vehicle)),
                Reason::Conflict(vehicle) => format!("{} has two positions at one time", name(vehicle)),
                Reason::Doubt(fault) => {
                    format!("{} in the last {} s", fault_text(fault, None), monitor.settings().max_age_s.value)
                }
                Reason::Uncertain(pair, least_m) => format!(
                    "{} may be as near as {} m (delta {} m)",
                    joined(&pair.map(name)),
                    down(least_m.max(0.0)),
                    monitor.settings().delta_m
                ),
            };
            format!("NOT KNOWN: {why}")
        }
    }
}

/// Returns the bounds on positions and accelerations as a condition of CLEAR.
pub(crate) fn bounds_text(facts: &[Fact]) -> String {
    let bound = |kind: FactKind| {
        let fact = facts.iter().find(|fact| fact.kind == kind)?;
        let Some(FactValue::Number(value, unit)) = fact.value else { return None };
        let (value, source) = match fact.source {
            Source::Recorded => (up(value), format!("{REPORTED_DEVIATIONS} reported deviations")),
            source => (value.to_string(), source.code().to_owned()),
        };
        Some(format!("within {value} {unit} ({source})"))
    };
    match (bound(FactKind::PositionError), bound(FactKind::Acceleration)) {
        (Some(error), Some(accel)) => format!(" if positions are {error} and accelerations {accel}"),
        _ => String::new(),
    }
}

fn reason_name(reason: Reason) -> &'static str {
    match reason {
        Reason::TooFew(_) => "too-few",
        Reason::Missing(_) | Reason::MissingName(_) => "missing",
        Reason::SignedOff(_) => "signed-off",
        Reason::Stale(..) => "stale",
        Reason::SpeedUnknown(_) => "speed-unknown",
        Reason::ErrorUnknown(_) => "error-unknown",
        Reason::TwoStreams(_) => Fault::TwoStreams.name(),
        Reason::ClockStepped(_) => "clock-step",
        Reason::Conflict(_) => "conflict",
        Reason::Doubt(fault) => fault.name(),
        Reason::Uncertain(..) => "uncertain",
    }
}

fn fault_text(fault: Fault, vehicle: Option<&str>) -> String {
    let of = vehicle.map_or_else(|| "a vehicle".to_owned(), str::to_owned);
    match fault {
        Fault::Garbage => "a message cannot be read".to_owned(),
        Fault::OutOfRange => "a message has a number out of range".to_owned(),
        Fault::TooManyVehicles => format!("a message of a vehicle beyond {MAX_VEHICLES}"),
        Fault::ClockStep => format!("the clock of {of} stepped or is too fast"),
        Fault::Conflict => format!("{of} has two positions at one time"),
        Fault::OutOfBounds => format!("{of} moved farther than {ACCEL} and the errors allow"),
        Fault::VelocityDisagrees => {
            format!("{of} sends velocities that contradict its positions; check their frame, unit and time")
        }
        Fault::Inaccurate => {
            format!("{of} reports an accuracy that is worse than {POSITION_ERROR}; give a larger {POSITION_ERROR}")
        }
        Fault::TwoStreams => format!(
            "the messages of {of} are those of two vehicles; give each vehicle a name or system id of its own and one \
             link, and start again"
        ),
        Fault::Dropped => "messages came faster than they were read".to_owned(),
        Fault::NotJudged => format!("{of} sent more messages than are kept, so a part of the past is not judged"),
        Fault::SignOff => format!("the sign-off of {of} is refused"),
        Fault::Returned => format!("{of} sent a position after its sign-off"),
        Fault::Reordered => format!("{of} sent a message older than its newest one"),
        Fault::Duplicate => format!("{of} sent a message twice"),
    }
}

/// Returns the cause of a refused sign-off and its remedy, to follow the sentence of the fault.
fn refusal_text(refusal: Refusal, monitor: &Monitor) -> String {
    let name = |vehicle: u32| name(monitor, vehicle);
    let max_age_s = monitor.settings().max_age_s.value;
    match refusal {
        Refusal::Late { t_s, newest_s } => format!(
            ": its stamp {} s is older than the newest position ({} s), so it is ignored; \
             send it after the last position",
            fixed(t_s),
            fixed(newest_s)
        ),
        Refusal::Repeated { t_s, newest_s } => format!(
            ": the vehicle has signed off, so the sign-off with the stamp {} s is ignored (newest position {} s); \
             send one sign-off",
            fixed(t_s),
            fixed(newest_s)
        ),
        Refusal::Doubt(fault) => {
            let fault = fault_text(fault, None);
            format!(": {fault} in the last {max_age_s} s; sign off again after {max_age_s} s without an error")
        }
        Refusal::Violation(pair) => {
            let pair = joined(&pair.map(name));
            format!(": {pair} is in a measured violation; sign off again after its end")
        }
        Refusal::Stale(vehicle) => {
            let of = name(vehicle);
            format!(": {of} was not heard for {max_age_s} s; sign off again after a new position of {of}")
        }
        Refusal::TwoStreams(vehicle) => format!(": {}", fault_text(Fault::TwoStreams, Some(&name(vehicle)))),
        Refusal::NoPrediction(vehicle) => {
            let of = name(vehicle);
            format!(": the velocity or position of {of} is not known; sign off again after a new position of {of}")
        }
        Refusal::Uncertain(pair, least_m) => format!(
            ": {} may be as near as {} m (delta {} m); sign off again when this is at least delta",
            joined(&pair.map(name)),
            down(least_m.max(0.0)),
            monitor.settings().delta_m
        ),
    }
}

fn refusal_name(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::Late { .. } => "late",
        Refusal::Repeated { .. } => "repeated",
        Refusal::Doubt(fault) => fault.name(),
        Refusal::Violation(_) => "violation",
        Refusal::Stale(_) => "stale",
        Refusal::TwoStreams(_) => Fault::TwoStreams.name(),
        Refusal::NoPrediction(_) => "speed-unknown",
        Refusal::Uncertain(..) => "uncertain",
    }
}

/// Returns a number of JSON, or null if it is not finite.
fn number(x: f64) -> Value {
    serde_json::Number::from_f64(x).map_or(Value::Null, Value::Number)
}

/// Returns a time with hundredths.
pub(crate) fn fixed(time_s: f64) -> String {
    format!("{time_s:.2}")
}

/// Returns a number with hundredths, rounded down.
pub(crate) fn down(x: f64) -> String {
    // A sum such as 0.3 - 1e-17 stays 0.3.
    format!("{:.2}", ((x + 1e-9) * 100.0).floor() / 100.0)
}

/// Returns a number with hundredths, rounded up.
fn up(x: f64) -> String {
    format!("{:.2}", ((x - 1e-9) * 100.0).ceil() / 100.0)
}
