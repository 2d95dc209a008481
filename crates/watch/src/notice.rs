//! Statements of a watch, and notices: their sentences and JSON.

use serde_json::{Map, Value, json};

use crate::event::{Assessment, Event, Fault, Loss, MessageError, Pair, PairTime, Problem, Reason, State};
use crate::monitor::Monitor;
use crate::session::Summary;
use crate::words::{self, Subject, name, sentence};
use tautline_audit::recorded::Counterpart;
use tautline_audit::{Status, Violation};
use tautline_core::fact::Coded;
use tautline_core::impl_coded;

/// Statement of a watch.
#[derive(Clone, Copy, Debug)]
pub enum Statement<'a> {
    /// Judgement of the present.
    State(&'a Assessment),
    /// Event of the monitor, with the last message that cannot be read.
    Event(&'a Event, Option<&'a MessageError>),
    /// A source is connected.
    Connected(&'a str),
    /// A source is lost, and connects again.
    Lost(&'a str, &'a Loss),
    /// Result of the watch.
    Summary(&'a Summary),
}

impl_coded! { Statement<'_> {
    Self::State(_) => "state",
    Self::Event(Event::Heard { .. }, _) => "heard",
    Self::Event(Event::Stale { .. }, _) => "stale",
    Self::Event(Event::SignedOff { .. }, _) => "signed-off",
    Self::Event(Event::Back { .. }, _) => "back",
    Self::Event(Event::Began(_), _) => "violation",
    Self::Event(Event::Ended(_), _) => "violation-end",
    Self::Event(Event::Plan { .. }, _) => "plan",
    Self::Event(Event::PlanConflict { .. }, _) => "plan-conflict",
    Self::Event(Event::Fault { .. }, _) => "fault",
    Self::Connected(_) => "connected",
    Self::Lost(..) => "lost",
    Self::Summary(_) => "summary",
} }

impl<'a> Statement<'a> {
    /// Returns the time of the statement \[s\].
    fn at_s(&self, monitor: &Monitor) -> f64 {
        match *self {
            Self::State(of) => of.now_s,
            Self::Event(event, _) => match *event {
                Event::Began(of) => of.from_s,
                Event::Ended(of) => of.to_s,
                Event::Heard { at_s, .. }
                | Event::Stale { at_s, .. }
                | Event::SignedOff { at_s, .. }
                | Event::Back { at_s, .. }
                | Event::Plan { at_s, .. }
                | Event::PlanConflict { at_s, .. }
                | Event::Fault { at_s, .. } => at_s,
            },
            Self::Connected(_) | Self::Lost(..) | Self::Summary(_) => monitor.now_s(),
        }
    }

    /// Returns the worst status that the statement establishes; clear for one without influence on the status.
    fn status(&self) -> Status {
        match *self {
            Self::State(of) => of.state.status(),
            Self::Event(Event::Began(_) | Event::Ended(_) | Event::Plan { is_outside: true, .. }, _) => {
                Status::Violation
            }
            Self::Event(Event::Stale { .. } | Event::PlanConflict { .. } | Event::Fault { .. }, _) | Self::Lost(..) => {
                Status::Undecided
            }
            Self::Event(..) | Self::Connected(_) => Status::Clear,
            Self::Summary(of) if of.was_off_plan => Status::Violation,
            Self::Summary(of) => of.status(),
        }
    }

    /// Returns the part of a fault that explains it.
    pub(crate) fn cause(&self) -> Option<Subject<'a>> {
        match *self {
            Self::State(&Assessment { state: State::Undecided(reason), .. })
            | Self::Event(&Event::Fault { refusal: Some(reason), .. }, _) => Some(Subject::Reason(reason)),
            Self::Event(Event::Fault { fault: Fault::Garbage, .. }, error) => error.map(Subject::Message),
            Self::Lost(_, loss) => Some(Subject::Loss(loss)),
            _ => None,
        }
    }

    /// Returns the keys of the statement in JSON.
    fn data(&self, monitor: &Monitor) -> Value {
        let name = |vehicle: u32| name(monitor, vehicle);
        match *self {
            Self::State(of) => state_data(of, monitor),
            Self::Event(event, _) => match *event {
                Event::Heard { vehicle, .. } | Event::SignedOff { vehicle, .. } => json!({ "vehicle": name(vehicle) }),
                Event::Stale { vehicle, age_s, .. } => json!({ "vehicle": name(vehicle), "age_s": age_s }),
                Event::Back { vehicle, signed_off_s, .. } => {
                    json!({ "vehicle": name(vehicle), "signed_off_s": signed_off_s })
                }
                Event::Began(of) | Event::Ended(of) => finding(&of, monitor),
                Event::Plan { vehicle, deviation_m, is_outside, .. } => {
                    json!({ "vehicle": name(vehicle), "deviation_m": deviation_m, "outside": is_outside })
                }
                Event::PlanConflict { conflict, left_s, .. } => json!({
                    "plan": planned(Counterpart::Plan(conflict.plan), monitor),
                    "other": planned(conflict.other, monitor),
                    "from_s": conflict.from_s,
                    "to_s": conflict.to_s,
                    "min_m": conflict.lower_m,
                    "min_at_s": conflict.min_at_s,
                    "limit": conflict.limit_m,
                    "left_s": left_s,
                    "facts": monitor.plan_facts(),
                }),
                Event::Fault { fault, count, vehicle, .. } => {
                    json!({ "fault": fault, "count": count, "vehicle": vehicle.map(name) })
                }
            },
            Self::Connected(source) | Self::Lost(source, _) => json!({ "source": source }),
            Self::Summary(of) => json!({
                "status": of.status(),
                "pass": of.passes(),
                "facts": (of.status() == Status::Clear && of.passes()).then(|| monitor.facts()),
                "vehicles": names(monitor, |_| true),
                "started": of.has_started,
                "signed_off": names(monitor, |k| monitor.has_signed_off(k)),
                "returned": of.returned,
                "clear_s": of.clear_s,
                "undecided_s": of.undecided_s,
                "violation_s": of.violation_s,
                "violations": of.violations,
                "off_plan": of.was_off_plan,
                "compared_with_plan": of.compared,
                "closest": of.closest.as_ref().map(|(min_m, pair)| json!({ "subjects": pair, "min_m": min_m })),
            }),
        }
    }
}

/// Notice for the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// Code of the [`Statement`].
    pub event: &'static str,
    /// Worst status that the statement establishes: a violation is an alarm.
    pub status: Status,
    /// Line of text.
    pub text: String,
    /// The notice as JSON.
    pub json: Value,
}

impl Notice {
    /// Returns the notice of a statement.
    #[must_use]
    pub fn new(of: Statement<'_>, monitor: &Monitor) -> Self {
        let (event, at_s) = (of.code(), of.at_s(monitor));
        let text = sentence(Subject::Statement(of), monitor);
        let mut json = Map::from_iter([("event".to_owned(), event.into()), ("t_s".to_owned(), json!(at_s))]);
        if let Value::Object(data) = of.data(monitor) {
            json.extend(data);
        }
        if let Statement::Summary(Summary { plans: Some([count, conflicts]), .. }) = of {
            json.insert("plans".to_owned(), json!({ "count": count, "conflicts": conflicts }));
        }
        if matches!(of, Statement::State(_) | Statement::Lost(..) | Statement::Event(Event::Fault { .. }, _)) {
            let reason = of.cause().map(|cause| {
                json!({ "code": cause.code(), "text": sentence(cause, monitor), "data": cause_data(cause, monitor) })
            });
            json.insert("reason".to_owned(), reason.into());
        }
        json.insert("text".to_owned(), text.clone().into());
        let has_time = at_s.is_finite() && !matches!(of, Statement::Summary(_));
        let text = if has_time { format!("{at_s:.2} s: {text}") } else { text };
        Self { event, status: of.status(), text, json: Value::Object(json) }
    }
}

/// Returns the names of vehicles for lines of text.
pub(crate) fn names(monitor: &Monitor, keep: impl Fn(usize) -> bool) -> Vec<String> {
    (0..monitor.names().len()).zip(0..).filter(|(k, _)| keep(*k)).map(|(_, vehicle)| name(monitor, vehicle)).collect()
}

fn state_data(of: &Assessment, monitor: &Monitor) -> Value {
    let two = |pair: Pair| pair.map(|vehicle| name(monitor, vehicle));
    let timed = |of: Option<PairTime>| of.map(|of| json!({ "subjects": two(of.pair), "at_s": of.at_s }));
    let violation = match of.state {
        State::Violation(pair, distance_m) => json!({ "subjects": two(pair), "distance_m": distance_m }),
        _ => Value::Null,
    };
    let closest = of
        .closest
        .map(|near| json!({ "subjects": two(near.pair), "nominal_m": near.nominal_m, "least_m": near.least_m }));
    let plan =
        of.deviation.map(|(vehicle, metres)| json!({ "vehicle": name(monitor, vehicle), "deviation_m": metres }));
    json!({
        "status": of.state.status(),
        "facts": (of.state == State::Clear).then(|| monitor.facts()),
        "heard": of.heard,
        "stale": names(monitor, |k| monitor.is_stale(k)),
        "signed_off": names(monitor, |k| monitor.has_signed_off(k)),
        "violation": violation,
        "closest": closest,
        "clear_until": timed(of.clear_until),
        "clear_to_horizon": of.is_clear_to_horizon,
        "nominal_violation": timed(of.nominal_violation),
        "last_brake": timed(of.last_brake),
        "plan": plan,
    })
}

/// Returns a measured violation with the keys of a finding of an audit.
fn finding(of: &Violation<Pair>, monitor: &Monitor) -> Value {
    json!({
        "subjects": of.pair.map(|vehicle| name(monitor, vehicle)),
        "from_s": of.from_s,
        "to_s": of.to_s,
        "at_s": of.min_at_s,
        "value": { "lower": of.min_m, "upper": of.min_m, "unit": "m" },
        "limit": of.limit_m,
    })
}

/// Returns a plan of a planner, or a flight, whose number is null.
fn planned(motion: Counterpart, monitor: &Monitor) -> Value {
    let plan = motion.plan();
    let (number, published_s) = (plan.map(|plan| plan.number), plan.map(|plan| plan.published_s));
    json!({ "vehicle": monitor.drone(motion.vehicle()), "number": number, "published_s": published_s })
}

/// Returns the data of a cause, whose keys depend on its code.
fn cause_data(cause: Subject<'_>, monitor: &Monitor) -> Value {
    let name = |vehicle: u32| name(monitor, vehicle);
    match cause {
        Subject::Reason(reason) => match reason {
            Reason::TooFew(heard) => json!({ "heard": heard }),
            Reason::Missing([heard, expected]) => {
                json!({ "heard": heard, "expected": expected, "missing": monitor.missing() })
            }
            Reason::SignedOff(present) => json!({ "present": present }),
            Reason::Stale(vehicle, age_s) => json!({ "vehicle": name(vehicle), "age_s": age_s }),
            Reason::VelocityUnknown(vehicle) | Reason::ErrorUnknown(vehicle) => json!({ "vehicle": name(vehicle) }),
            Reason::Fault(fault, vehicle) => json!({ "fault": fault, "vehicle": vehicle.map(name) }),
            Reason::Uncertain(pair, least_m) => json!({ "subjects": pair.map(name), "least_m": least_m }),
            Reason::PlanConflict(conflict) => json!({
                "plan": planned(Counterpart::Plan(conflict.plan), monitor),
                "other": planned(conflict.other, monitor),
                "from_s": conflict.from_s,
                "to_s": conflict.to_s,
            }),
            Reason::Violation(pair) => json!({ "subjects": pair.map(name) }),
            Reason::Late([stamp_s, newest_s]) | Reason::Repeated([stamp_s, newest_s]) => {
                json!({ "stamp_s": stamp_s, "newest_s": newest_s })
            }
        },
        Subject::Message(error) => {
            let (detail, other) = match &error.problem {
                Problem::NotPose(why, line) => (json!(why), json!(line)),
                Problem::OtherFrame([a, b]) | Problem::OtherTopic([a, b]) => (json!(a), json!(b)),
                Problem::UnknownEvent(text)
                | Problem::NotHeard(text)
                | Problem::NotDecoded(text)
                | Problem::ServerError(text)
                | Problem::NoPosition(text)
                | Problem::WrongPlan(text) => (json!(text), Value::Null),
                Problem::OtherPlanClock(lead_s, clock) => (json!(lead_s), json!(words::clock_of_plans(*clock))),
                Problem::UnknownFlags(byte) | Problem::NoFrameStart(byte) => (json!(byte), Value::Null),
                Problem::WrongChecksum([message, system]) => (json!(message), json!(system)),
                _ => (Value::Null, Value::Null),
            };
            json!({ "place": error.place, "detail": detail, "other": other })
        }
        Subject::Loss(Loss::Failed(detail)) => json!({ "detail": detail }),
        Subject::Loss(_) | Subject::Statement(_) => json!({}),
    }
}
