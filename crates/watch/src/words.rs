//! Sentences of a watch. No state, code or exit code depends on them.

use crate::event::{Assessment, Event, Fault, Loss, MessageError, Pair, PlanClock, Problem, Reason, State};
use crate::monitor::Monitor;
use crate::notice::Statement;
use crate::session::Summary;
use crate::settings::REPORTED_DEVIATIONS;
use tautline_audit::Status;
use tautline_audit::recorded::{Counterpart, PlanConflict};
use tautline_core::fact::{Coded as _, Fact, FactKind, FactValue, Source};
use tautline_core::option::{ACCEL, FRAME, MAX_VEHICLES, ORIGIN, POSITION_ERROR, TOPIC};
use tautline_core::text::{at_least, at_most, counted, in_order, seconds};

/// Subject of a sentence.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Subject<'a> {
    Statement(Statement<'a>),
    Reason(Reason),
    Message(&'a MessageError),
    Loss(&'a Loss),
}

impl Subject<'_> {
    pub(crate) fn code(&self) -> &'static str {
        match self {
            Self::Statement(of) => of.code(),
            Self::Reason(of) => of.code(),
            Self::Message(of) => of.problem.code(),
            Self::Loss(of) => of.code(),
        }
    }
}

/// Returns the sentence of a subject, without a full stop.
pub(crate) fn sentence(subject: Subject<'_>, monitor: &Monitor) -> String {
    match subject {
        Subject::Statement(Statement::State(of)) => state(of, monitor),
        Subject::Statement(of @ Statement::Event(event, _)) => self::event(event, of.cause(), monitor),
        Subject::Statement(Statement::Connected(source)) => format!("connected to {source}"),
        Subject::Statement(Statement::Lost(source, why)) => format!("lost {source}: {}; trying again", loss(why)),
        Subject::Statement(Statement::Summary(of)) => summary(of, monitor),
        Subject::Reason(of) => reason(of, monitor),
        Subject::Message(of) => message(of),
        Subject::Loss(of) => loss(of),
    }
}

/// Returns the name of a vehicle for a line of text: control characters, such as the end of a line, are replaced.
pub(crate) fn name(monitor: &Monitor, vehicle: u32) -> String {
    monitor.names().get(vehicle as usize).map(|name| on_one_line(name)).unwrap_or_default()
}

/// Replaces control characters, also those of direction, and the other characters that begin a line.
fn on_one_line(text: &str) -> String {
    let is_wrong = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
    in_order(text).replace(is_wrong, "\u{fffd}")
}

fn joined(pair: Pair, monitor: &Monitor) -> String {
    pair.map(|vehicle| name(monitor, vehicle)).join(" and ")
}

fn state(of: &Assessment, monitor: &Monitor) -> String {
    let pair = |pair: Pair| joined(pair, monitor);
    let delta_m = monitor.settings().delta_m;
    let (mut text, is_violation) = match of.state {
        State::Clear => {
            let at_s = of.clear_until.map_or(of.now_s, |until| until.at_s);
            let left_s = at_least(at_s - of.now_s, 2);
            (format!("CLEAR until {} s ({left_s} s from now){}", at_least(at_s, 2), bounds(&monitor.facts())), false)
        }
        State::Violation(two, distance_m) => {
            (format!("VIOLATION {} {} m (delta {delta_m} m)", pair(two), at_least(distance_m, 2)), true)
        }
        State::Undecided(why) => (format!("UNDECIDED: {}", reason(why, monitor)), false),
    };
    if let Some(near) = of.closest {
        text.extend([format!("; closest {} {} m", pair(near.pair), at_least(near.nominal_m, 2))]);
        if !is_violation {
            text.extend([format!(", at least {} m", at_least(near.least_m.max(0.0), 2))]);
        }
    }
    if let Some(first) = of.nominal_violation.filter(|_| !is_violation) {
        text.extend([format!("; on course to violate: {} at {}", pair(first.pair), seconds(first.at_s))]);
    }
    if let Some(brake) = of.last_brake.filter(|_| !is_violation) {
        text.extend([if brake.at_s > of.now_s {
            format!("; brake {} by {} s", pair(brake.pair), at_least(brake.at_s, 2))
        } else {
            format!("; the last moment to brake {} has passed", pair(brake.pair))
        }]);
    }
    if of.signed_off > 0 {
        text.extend([format!("; signed off: {} of {}", of.signed_off, of.heard)]);
    }
    text
}

/// Returns the bounds on positions and accelerations as a condition of CLEAR.
fn bounds(facts: &[Fact]) -> String {
    let bound = |kind: FactKind| {
        let fact = facts.iter().find(|fact| fact.kind == kind)?;
        let Some(FactValue::Number(value, unit)) = fact.value else { return None };
        let (value, source) = match fact.source {
            Source::Recorded => (at_most(value, 2), format!("{REPORTED_DEVIATIONS} reported deviations")),
            source => (value.to_string(), source.code().to_owned()),
        };
        Some(format!("within {value} {unit} ({source})"))
    };
    match (bound(FactKind::PositionError), bound(FactKind::Acceleration)) {
        (Some(error), Some(accel)) => format!(" if positions are {error} and accelerations {accel}"),
        _ => String::new(),
    }
}

fn event(event: &Event, cause: Option<Subject<'_>>, monitor: &Monitor) -> String {
    let name = |vehicle: u32| name(monitor, vehicle);
    let settings = monitor.settings();
    match *event {
        Event::Heard { vehicle, .. } => format!("heard {}", name(vehicle)),
        Event::Stale { vehicle, age_s, .. } => {
            format!("{} is stale: not heard for {}", name(vehicle), seconds(age_s))
        }
        Event::SignedOff { vehicle, .. } => format!("{} signed off", name(vehicle)),
        Event::Back { vehicle, signed_off_s, .. } => {
            let since = signed_off_s.map_or_else(String::new, |since_s| {
                format!(" after its sign-off: its separation since {} is UNDECIDED", seconds(since_s))
            });
            format!("{} is heard again{since}", name(vehicle))
        }
        Event::Began(of) => format!("violation of {} began", joined(of.pair, monitor)),
        Event::Ended(of) => format!(
            "violation of {} from {} to {}, smallest distance {} m at {} (delta {} m)",
            joined(of.pair, monitor),
            seconds(of.from_s),
            seconds(of.to_s),
            at_least(of.min_m, 2),
            seconds(of.min_at_s),
            of.limit_m
        ),
        Event::Plan { vehicle, deviation_m, is_outside: true, .. } => {
            format!("OFF PLAN {} {} m (tube {} m)", name(vehicle), at_most(deviation_m, 2), settings.tube_m)
        }
        Event::Plan { vehicle, .. } => format!("{} is within {} m of its plan again", name(vehicle), settings.tube_m),
        Event::PlanConflict { conflict, left_s, .. } => plan_conflict(&conflict, left_s, monitor),
        Event::Fault { fault, count, vehicle, .. } => {
            let times = if count > 1 { format!(" ({count} times)") } else { String::new() };
            let cause = match cause {
                Some(Subject::Reason(why)) => format!(": {}{}", reason(why, monitor), remedy_of_sign_off(why, monitor)),
                Some(Subject::Message(error)) => format!(": {}", message(error)),
                _ => String::new(),
            };
            format!("{}{times}{cause}", self::fault(fault, vehicle.map(name).as_deref()))
        }
    }
}

/// Returns the sentence of a conflict of two plans that begins in `left_s` \[s\].
fn plan_conflict(conflict: &PlanConflict, left_s: f64, monitor: &Monitor) -> String {
    let [plan, other] = [Counterpart::Plan(conflict.plan), conflict.other].map(|motion| {
        let published = motion.plan().map(|plan| format!(" (published at {})", seconds(plan.published_s)));
        planned(motion, monitor) + &published.unwrap_or_default()
    });
    let min_at = conflict.min_at_s.map_or_else(String::new, |at_s| format!(" at {}", seconds(at_s)));
    let min_m = at_least(conflict.lower_m, 2);
    let facts = monitor.plan_facts();
    let end = facts.iter().find(|fact| fact.kind == FactKind::PlanEnd);
    let end = end.map_or_else(String::new, |end| format!("; {end} ({})", end.source.code()));
    let [may, possibly] = if conflict.min_at_s.is_none() { ["may ", "possibly "] } else { [""; 2] };
    format!(
        "{plan} and {other} {may}come to {min_m} m{min_at} (delta {} m): {possibly}closer than delta from {} to {}, in \
         {} s{end}",
        conflict.limit_m,
        seconds(conflict.from_s),
        seconds(conflict.to_s),
        at_least(left_s, 2)
    )
}

fn planned(motion: Counterpart, monitor: &Monitor) -> String {
    let drone = monitor.drone(motion.vehicle());
    motion
        .plan()
        .map_or_else(|| format!("the flight of drone {drone}"), |plan| format!("plan {} of drone {drone}", plan.number))
}

/// Returns the clock of the starts of plans.
pub(crate) fn clock_of_plans(clock: PlanClock) -> &'static str {
    match clock {
        PlanClock::Positions => "the clock of the positions",
        PlanClock::Machine => "the clock of this machine",
    }
}

fn reason(reason: Reason, monitor: &Monitor) -> String {
    let name = |vehicle: u32| name(monitor, vehicle);
    match reason {
        Reason::TooFew(0) => "no vehicle is heard".to_owned(),
        Reason::TooFew(_) => "only one vehicle is heard".to_owned(),
        Reason::Missing([heard, expected]) if monitor.missing().is_empty() => {
            format!("{heard} of {expected} vehicles are heard")
        }
        Reason::Missing(_) => {
            let missing = monitor.missing();
            let shown: Vec<_> = missing.iter().take(5).map(|name| on_one_line(name)).collect();
            let more = if missing.len() > shown.len() { ", ..." } else { "" };
            format!("not heard yet: {}{more}", shown.join(", "))
        }
        Reason::SignedOff(0) => "every vehicle has signed off".to_owned(),
        Reason::SignedOff(_) => "only one vehicle has not signed off".to_owned(),
        Reason::Stale(vehicle, age_s) => format!("{} not heard for {}", name(vehicle), seconds(age_s)),
        Reason::VelocityUnknown(vehicle) => format!("the velocity of {} is not known yet", name(vehicle)),
        Reason::ErrorUnknown(vehicle) => {
            format!("{} reports no accuracy of its positions; give {POSITION_ERROR}", name(vehicle))
        }
        Reason::Fault(Fault::ClockStep, Some(vehicle)) => {
            format!("{} not heard since the step of the clock", name(vehicle))
        }
        Reason::Fault(of, Some(vehicle)) => fault(of, Some(&name(vehicle))),
        Reason::Fault(of, None) => format!("{} in the last {} s", fault(of, None), monitor.settings().max_age_s.value),
        Reason::Uncertain(pair, least_m) => format!(
            "{} may be as near as {} m (delta {} m)",
            joined(pair, monitor),
            at_least(least_m.max(0.0), 2),
            monitor.settings().delta_m
        ),
        Reason::PlanConflict(of) => format!(
            "{} and {} {} closer than delta from {} to {}",
            planned(Counterpart::Plan(of.plan), monitor),
            planned(of.other, monitor),
            if of.min_at_s.is_none() { "may be" } else { "are" },
            seconds(of.from_s),
            seconds(of.to_s)
        ),
        Reason::Violation(pair) => format!("{} are in a measured violation", joined(pair, monitor)),
        Reason::Late([stamp_s, newest_s]) => format!(
            "its stamp {} is older than the newest position ({}), so it is ignored",
            seconds(stamp_s),
            seconds(newest_s)
        ),
        Reason::Repeated([stamp_s, newest_s]) => format!(
            "the vehicle has signed off, so the sign-off with the stamp {} is ignored (newest position {})",
            seconds(stamp_s),
            seconds(newest_s)
        ),
    }
}

/// Returns the remedy for a sign-off that is refused for a reason.
fn remedy_of_sign_off(reason: Reason, monitor: &Monitor) -> String {
    let again = match reason {
        Reason::Late(_) => return "; send it after the last position".to_owned(),
        Reason::Repeated(_) => return "; send one sign-off".to_owned(),
        Reason::Violation(_) => "after its end".to_owned(),
        Reason::Uncertain(..) => "when this is at least delta".to_owned(),
        Reason::Fault(_, None) => format!("after {} s without an error", monitor.settings().max_age_s.value),
        Reason::Stale(vehicle, _)
        | Reason::VelocityUnknown(vehicle)
        | Reason::Fault(Fault::ClockStep | Fault::Conflict, Some(vehicle)) => {
            format!("after a new position of {}", name(monitor, vehicle))
        }
        _ => return String::new(),
    };
    format!("; sign off again {again}")
}

fn fault(fault: Fault, vehicle: Option<&str>) -> String {
    let of = vehicle.unwrap_or("a vehicle");
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
        Fault::Dropped => "messages came faster than they were read and were dropped".to_owned(),
        Fault::NotJudged => format!("{of} sent more messages than are kept, so a part of the past is not judged"),
        Fault::SignOff => format!("the sign-off of {of} is refused"),
        Fault::Returned => format!("{of} sent a position after its sign-off"),
        Fault::Reordered => format!("{of} sent a message older than its newest one"),
        Fault::Duplicate => format!("{of} sent a message twice"),
    }
}

fn message(MessageError { place, problem }: &MessageError) -> String {
    let problem = match problem {
        Problem::TooLong => "the line is too long; write one pose per line".to_owned(),
        Problem::NotPose(why, line) => {
            let remedy = r#"write {"t":0,"id":"a","x":0,"y":0,"z":0}"#;
            format!("not a pose: {why} ({line:?}); {remedy}")
        }
        Problem::VelocityIncomplete => {
            "a part of the velocity is missing; write vx, vy and vz, or none of them".to_owned()
        }
        Problem::NoName => "the id is empty; write the name of the vehicle".to_owned(),
        Problem::SignOffWithPosition => {
            "a sign-off with a position; write the last pose in a line before it".to_owned()
        }
        Problem::UnknownEvent(event) => format!("unknown event ({event:?}); write \"off\" for a sign-off"),
        Problem::NotHeard(id) => {
            format!("the sign-off of {id:?} is ignored: the vehicle was not heard; send its position first")
        }
        Problem::NotDecoded(why) => format!("cannot be decoded: {why}"),
        Problem::ServerError(why) => format!("the server reports an error: {why}"),
        Problem::NoStamp => "the message has no stamp, so its age is unknown; set header.stamp".to_owned(),
        Problem::NoOrigin => format!("the positions are on the Earth; set {}", ORIGIN.set("LAT,LON,HEIGHT")),
        Problem::NoFrame => {
            format!("transforms have several frames; set {FRAME}, such as {}", FRAME.set("world"))
        }
        Problem::OtherFrame([own, others]) => {
            format!("the position is in frame {own:?}, others in {others:?}; give the topics of one frame with {TOPIC}")
        }
        Problem::OtherTopic([id, topic]) => {
            format!("vehicle {id:?} has the topic {topic}, too; give one of them with {TOPIC}")
        }
        Problem::TooManyTopics => format!("too many topics; give fewer with {TOPIC}"),
        Problem::CutFrame => "ends within a frame of MAVLink".to_owned(),
        Problem::UnknownFlags(flags) => {
            format!("a frame of MAVLink 2 has unknown incompatible flags ({flags:#04x})")
        }
        Problem::NoFrameStart(byte) => format!("a frame of MAVLink must begin with fe or fd, got {byte:02x}"),
        Problem::WrongChecksum([message, system]) => {
            format!("the checksum of message {message} of system {system} is wrong")
        }
        Problem::NotOfTopic => "not a message of a topic".to_owned(),
        Problem::NoPosition(topic) => format!("the message of {topic} has no position that is read"),
        Problem::NoSubscription => "a message has no subscription".to_owned(),
        Problem::WrongPlan(why) => {
            format!("the plan cannot be used: {why}; check the planner and its version, or omit the topic from {TOPIC}")
        }
        Problem::OtherPlanClock(lead_s, clock) => format!(
            "the plan starts {} s from its arrival by {}; set one clock for planner, positions and this machine",
            at_most(lead_s.abs(), 0),
            clock_of_plans(*clock)
        ),
    };
    if place.is_empty() { problem } else { format!("{place}: {problem}") }
}

fn loss(loss: &Loss) -> String {
    match loss {
        Loss::Failed(why) => why.clone(),
        Loss::Silent => "the server is silent".to_owned(),
        Loss::Closed => "the server closed the connection".to_owned(),
    }
}

fn summary(of: &Summary, monitor: &Monitor) -> String {
    let verdict = match of.status() {
        Status::Violation => "VIOLATION".to_owned(),
        Status::Undecided => "UNDECIDED".to_owned(),
        Status::Clear if of.was_off_plan => "OFF PLAN".to_owned(),
        Status::Clear => format!("CLEAR{}", bounds(&monitor.facts())),
    };
    let signed_off = if of.signed_off > 0 { format!(" ({} signed off)", of.signed_off) } else { String::new() };
    let mut text = format!(
        "{verdict}: {}{signed_off}, {} CLEAR, {} UNDECIDED, {} VIOLATION, measured violations: {}",
        counted(of.vehicles as u64, "vehicle", "vehicles"),
        seconds(of.clear_s),
        seconds(of.undecided_s),
        seconds(of.violation_s),
        of.violations
    );
    if of.returned > 0 {
        text.extend([format!("; heard again after a sign-off: {}", of.returned)]);
    }
    if let Some((distance_m, pair)) = &of.closest {
        text.extend([format!("; closest {} {} m", pair.join(" and "), at_least(*distance_m, 2))]);
    }
    if let Some([count, conflicts]) = of.plans {
        text.extend([format!("; plans: {count}, conflicts: {conflicts}")]);
    }
    if let Some(count) = of.compared {
        text.extend([format!("; positions compared with the plan: {count}")]);
    }
    if of.was_off_plan && of.status() != Status::Clear {
        text.push_str("; OFF PLAN");
    }
    text
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{Subject, sentence};
    use crate::event::{Fault, Reason};
    use crate::monitor::{Monitor, Pose};
    use crate::notice::{Notice, Statement};
    use crate::plan::Plan;
    use crate::settings::Settings;

    #[test]
    fn sentences_have_names_numbers_and_sources_of_bounds() {
        let mut monitor = Monitor::new(Settings::default(), Plan::default()).expect("settings");
        for (id, x) in [("a", 0.0), ("b\n", 4.0)] {
            let (position_m, velocity_m_s) = (Vector3::x() * x, Some(Vector3::zeros()));
            monitor.take(&Pose { t_s: 0.0, id, position_m, velocity_m_s, accuracy_m: None }, 0.0);
        }
        let text = Notice::new(Statement::State(&monitor.assess(0.0)), &monitor).text;
        let bounds = "if positions are within 0.05 m (default) and accelerations within 9.81 m/s^2 (default)";
        assert!(text.starts_with("0.00 s: CLEAR until 0.5") && text.contains(bounds), "{text}");
        assert!(text.ends_with("; closest a and b\u{fffd} 4.00 m, at least 3.89 m"), "{text}");
        for (reason, expected) in [
            (Reason::Stale(0, 1.5), "a not heard for 1.50 s"),
            (Reason::Uncertain([0, 1], 0.999), "a and b\u{fffd} may be as near as 0.99 m (delta 1 m)"),
            (Reason::Fault(Fault::Conflict, Some(0)), "a has two positions at one time"),
            (Reason::Fault(Fault::Conflict, None), "a vehicle has two positions at one time in the last 1 s"),
        ] {
            assert_eq!(sentence(Subject::Reason(reason), &monitor), expected);
        }
    }
}
