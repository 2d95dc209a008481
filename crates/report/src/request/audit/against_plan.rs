//! Comparison of a recording with its plan, for `--plan`.

use std::path::Path;

use super::super::{Failure, Monitor};
use super::side_files::ItemSpan;
use super::{AuditOptions, AuditRequest, Open, Subject, recording_in};
use crate::figures::{self, Figure};
use crate::report::recorded::{PlanReport, RecordedReport, THE_PLAN};
use tautline_audit::recorded::{Outcome, PlanComparison, PlanFindings, Settings, audit};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::{IDS, PLAN_DELAY};
use tautline_core::text::seconds;
use tautline_core::track::Item;
use tautline_recordings::open_plan;

/// Largest number of names in a message.
const NAMES_LISTED: usize = 12;

/// Refuses options that turn or scale the positions of the flight alone.
pub(super) fn refuse_changed_positions(request: &AuditRequest<'_>) -> Result<(), Failure> {
    let (Some(plan), Subject::Files { options, .. }) = (&request.options.plan, &request.subject) else { return Ok(()) };
    if !options.changes_positions() {
        return Ok(());
    }
    let message =
        format!("{}: other axes or another scale would change only the positions of the flight", plan.display());
    let help = "export flight and plan with these options, and compare the exported files";
    Err(Failure::input("audit/plan-frame", message, help))
}

/// A flight that was audited.
pub(super) struct AuditedFlight<'a> {
    pub(super) open: &'a Open<'a>,
    pub(super) name: String,
    pub(super) settings: &'a Settings,
    pub(super) outcome: &'a Outcome,
    /// Epoch of the clock of the flight \[ns\].
    pub(super) epoch_ns: i64,
    pub(super) is_planar: bool,
}

/// A flight that was compared with its plan.
pub(super) struct ComparedPlan {
    report: PlanReport,
    notes: Vec<String>,
    facts: Vec<Fact>,
    figure: Figure,
}

/// Compares a flight with the plan of the options, if they have one.
pub(super) fn compare(
    options: &AuditOptions,
    flight: &AuditedFlight<'_>,
    monitor: &dyn Monitor,
) -> Result<Option<ComparedPlan>, Failure> {
    let Some(path) = options.plan.as_deref().map(recording_in) else { return Ok(None) };
    let flown = (flight.open)()?;
    let origin = flown.earth_origin().copied();
    let mut plan = open_plan(&path, origin.as_ref())?;
    let are_heights_assumed = compare_heights(flown.facts(), plan.facts(), &path)?;
    let (mut items, mut more) = (Vec::new(), true);
    while more {
        if monitor.is_interrupted() {
            return Err(Failure::interrupted());
        }
        more = plan.read(&mut items)?;
    }
    if let Some(other) = plan.clock().doubt(&items) {
        let unit = plan.clock().unit;
        let message = format!("{}: the times of the plan may be in {unit} or {other}", path.display());
        let help = "name the column of the times of the plan by their unit, such as t_s or t_ms";
        return Err(Failure::input("audit/guessed-time-unit", message, help));
    }
    let is_planar = flight.is_planar || plan.is_planar();
    if is_planar {
        items.iter_mut().for_each(flatten);
    }
    let wrong = |error| Failure::from(error).of(&path);
    let mut comparison = PlanComparison::new(flight.settings, flight.outcome);
    comparison.push_plan(plan.vehicles(), items.clone());
    check_names(&comparison, &flight.name, &path)?;
    let mut recording = (flight.open)()?;
    let (mut flown, mut more) = (Vec::new(), true);
    while more {
        if monitor.is_interrupted() {
            return Err(Failure::interrupted());
        }
        flown.clear();
        more = recording.read(&mut flown)?;
        if is_planar {
            flown.iter_mut().for_each(flatten);
        }
        let pushed = comparison.push_flight(&flown);
        pushed.map_err(|error| Failure::from(error).of(Path::new(&flight.name)))?;
    }
    let shift = EpochShift::new(plan.clock().epoch_ns, flight.epoch_ns);
    let shift_s = shift.seconds();
    let found = comparison.finish(shift_s, options.plan_delay_s, options.tube_m).map_err(wrong)?;
    check_common_time(&found, &items, shift_s, flight, &path)?;
    let asked = found.settings_of_plan(flight.settings, &flight.outcome.vehicles, shift_s + found.delay_s);
    let asked = asked.filter(|_| found.deviations.len() > 1);
    let audited = asked.map(|settings| audit(plan.vehicles(), &items, settings)).transpose().map_err(wrong)?;
    let mut report = PlanReport::new(path.display().to_string(), &found, flight.outcome, audited.as_ref());
    report.planar = is_planar;
    let notes = plan.notes().iter().map(|note| format!("{}: {note}", path.display())).collect();
    let axes = if is_planar { "x and y" } else { "x, y and z" };
    let clock = match (shift, options.plan_delay_s) {
        (EpochShift::Known(_), _) => Fact::name(FactKind::SideFileClock, Source::Deduced, "plan by its epoch"),
        (EpochShift::Unknown, Some(s)) => Fact::number(FactKind::SideFileClock, Source::Declared, s, "s"),
        (EpochShift::Unknown, None) => Fact::number(FactKind::SideFileClock, Source::Inferred, found.delay_s, "s"),
    };
    let of_origin =
        |source, origin| Fact::name(FactKind::SideFileFrame, source, format!("east, north and up of {origin}"));
    let frame = match (plan.earth_origin(), origin) {
        (_, None) => Fact::name(FactKind::SideFileFrame, Source::Default, "the frame of the flight"),
        (Some(_), Some(origin)) => of_origin(Source::Deduced, origin),
        (None, Some(origin)) => of_origin(Source::Declared, origin),
    };
    let assumed = |kind| Fact::new(kind, Source::Default);
    let mut facts = vec![clock, Fact::name(FactKind::SideFileAxes, Source::Deduced, axes), frame];
    facts.extend((!found.has_curves).then(|| assumed(FactKind::PlanMotion)));
    facts.extend(plan.facts().iter().filter(|fact| fact.is_assumption()).map(|fact| fact.clone().about(THE_PLAN)));
    facts.extend((is_planar && !flight.is_planar).then(|| assumed(FactKind::PlanPlane)));
    facts.extend((!is_planar && are_heights_assumed).then(|| assumed(FactKind::PlanHeights)));
    let figure = figure(&found, flight.outcome);
    Ok(Some(ComparedPlan { report, notes, facts, figure }))
}

/// Refuses heights of different references. Returns whether only one of both is known, so that one is assumed.
fn compare_heights(flown: &[Fact], planned: &[Fact], path: &Path) -> Result<bool, Failure> {
    let reference = |facts: &[Fact]| {
        let known = facts.iter().find(|fact| fact.kind == FactKind::HeightReference);
        known.filter(|fact| fact.source != Source::Default).and_then(|fact| fact.value.clone())
    };
    let (flight, plan) = match (reference(flown), reference(planned)) {
        (None, None) => return Ok(false),
        (Some(flight), Some(plan)) if flight == plan => return Ok(false),
        (Some(flight), Some(plan)) => (flight, plan),
        (Some(_), None) | (None, Some(_)) => return Ok(true),
    };
    let message =
        format!("{}: heights of the plan are above {plan}, those of the flight above {flight}", path.display());
    Err(Failure::input("audit/plan-frame", message, "give a plan with the heights of the flight"))
}

/// Refuses a plan that shares no time with the judged flight.
fn check_common_time(
    found: &PlanFindings,
    plan: &[Item],
    shift_s: f64,
    flight: &AuditedFlight<'_>,
    path: &Path,
) -> Result<(), Failure> {
    let mut span = ItemSpan::default();
    span.add(plan);
    let Some((planned, (from_s, to_s))) = span.ends_s().zip(flight.outcome.span_s) else { return Ok(()) };
    if !found.deviations.is_empty() {
        return Ok(());
    }
    let [start, end] = planned.map(|time_s| seconds(time_s + shift_s + found.delay_s));
    let message = format!(
        "{}: the plan is from {start} to {end} on the clock of the flight, with a delay of {}, and the judged flight \
         from {} to {}",
        path.display(),
        seconds(found.delay_s),
        seconds(from_s),
        seconds(to_s)
    );
    let help = format!("give the time of the flight at which the plan begins with {PLAN_DELAY}, or another plan");
    Err(Failure::input("audit/side-file-clock", message, help))
}

/// Adds the findings to a report; also returns the figure. The run's audit does not cover distances from a plan
/// between two samples (`is_by_run`).
pub(super) fn attach(
    report: RecordedReport,
    compared: Option<ComparedPlan>,
    is_by_run: bool,
    monitor: &dyn Monitor,
) -> (RecordedReport, Option<Figure>) {
    let Some(ComparedPlan { report: plan, notes, mut facts, figure }) = compared else { return (report, None) };
    for note in &notes {
        monitor.warn(&format!("note: {note}"));
    }
    if is_by_run {
        facts.insert(0, Fact::new(FactKind::PlanMotion, Source::Default).about("the flight"));
    }
    let mut report = report.with_plan(plan, facts);
    report.source.notes.extend(notes);
    (report, Some(figure))
}

/// Difference of the epochs of a plan and a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
enum EpochShift {
    /// Time from the epoch of the flight to that of the plan \[s\].
    Known(f64),
    /// One of the two clocks has no epoch.
    Unknown,
}

impl EpochShift {
    fn new(plan_ns: i64, flight_ns: i64) -> Self {
        let is_known = plan_ns != 0 && flight_ns != 0;
        if is_known { Self::Known(plan_ns.saturating_sub(flight_ns) as f64 * 1e-9) } else { Self::Unknown }
    }

    /// Returns the time that is added to the times of the plan \[s\].
    fn seconds(self) -> f64 {
        match self {
            Self::Known(shift_s) => shift_s,
            Self::Unknown => 0.0,
        }
    }
}

/// Moves an item to the plane of x and y.
fn flatten(item: &mut Item) {
    match item {
        Item::Sample(sample) => {
            sample.position_m.z = 0.0;
            sample.velocity_m_s.iter_mut().for_each(|velocity| velocity.z = 0.0);
        }
        Item::Piece(piece) => piece.coefficients.iter_mut().for_each(|coefficient| coefficient.z = 0.0),
    }
}

/// Refuses a plan of other vehicles.
fn check_names(comparison: &PlanComparison, flight: &str, path: &Path) -> Result<(), Failure> {
    let [mut flown, mut planned] = comparison.names();
    flown.sort_unstable();
    planned.sort_unstable();
    if flown == planned {
        return Ok(());
    }
    let listed = |names: &[&str]| {
        let more = if names.len() > NAMES_LISTED { ", ..." } else { "" };
        if names.is_empty() { "none".to_owned() } else { names[..names.len().min(NAMES_LISTED)].join(", ") + more }
    };
    let (flown, planned) = (listed(&flown), listed(&planned));
    let message = format!("{}: the vehicles of the plan are {planned}, those of {flight} are {flown}", path.display());
    let help = format!("give the plan of these vehicles, with the same names, or select common vehicles with {IDS}");
    Err(Failure::input("audit/plan-vehicles", message, help))
}

fn figure(found: &PlanFindings, outcome: &Outcome) -> Figure {
    let mut order: Vec<_> = found.deviations.iter().collect();
    order.sort_by(|a, b| b.upper_m.total_cmp(&a.upper_m));
    let lines = order.into_iter().map(|of| (outcome.name(of.vehicle), &of.series[..])).collect::<Vec<_>>();
    figures::plan_distances(&lines, found.tube_m, "Distance from the plan")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_joined_by_their_epochs() {
        assert_eq!(EpochShift::new(5_000_000_000, 2_000_000_000), EpochShift::Known(3.0));
        let unknown = EpochShift::new(0, 2_000_000_000);
        assert_eq!((unknown, unknown.seconds()), (EpochShift::Unknown, 0.0), "a plan without an epoch begins at 0");
    }
}
