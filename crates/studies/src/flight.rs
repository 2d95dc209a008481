//! Summary of a flight, for all studies.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use crate::statistics::{Estimate, Proportion};
use tautline_core::record::{Event, RecordError, Sample, Sink, Step};
use tautline_core::swarm::{Rows, row};
use tautline_core::text::counted;
use tautline_laws::law::LawError;
use tautline_report::report::{Reason, Report, Status};
use tautline_report::run::run_with;
use tautline_sim::plant::FreeSteps;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{ExternalLaw, Scenario};
use tautline_sim::sim::{Breakdown, Components, Ending, SimError};

/// Outcome of a flight: the first variant that applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Two vehicles came closer than delta, or a vehicle came closer to an obstacle than its clearance.
    Violated,
    /// The flight ended early without a violation.
    EndedEarly,
    /// The judge cannot decide, or the two detectors disagree.
    Undecided,
    /// The flight was flown to its end, and both detectors prove it clear.
    Clear,
}

/// Summary of one flight. Every number but `law_s` is the same for any number of threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightSummary {
    /// Seed of start and noise, or of the noise alone if the study keeps the start.
    pub seed: u64,
    /// Outcome of the flight.
    pub outcome: Outcome,
    /// Whether `tautline run` passes the flight.
    pub pass: bool,
    /// Codes by which `tautline check` refuses the scenario. The scenario is flown all the same.
    pub refused: Vec<String>,
    /// Reason why the flight ended early.
    pub ended_early: Option<String>,
    /// Whether the formation of every leg was reached, and the last one kept to the end.
    pub reached: bool,
    /// Time from which the last formation was kept \[s\].
    pub reached_at_s: Option<f64>,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Smallest separation of two centres \[m\].
    pub min_m: Option<f64>,
    /// Time of the smallest separation \[s\].
    pub min_at_s: Option<f64>,
    /// Vehicles of the smallest separation, counted from 1.
    pub min_pair: Option<[usize; 2]>,
    /// Separation that the law certifies \[m\].
    pub certified_m: Option<f64>,
    /// Whether two vehicles came closer than certified, by more than the error of integration: a defect.
    #[serde(default)]
    pub breaks_certificate: bool,
    /// Path length, summed over the vehicles \[m\].
    pub path_length_m: f64,
    /// Largest commanded acceleration of a vehicle \[m/s^2\].
    pub peak_control_m_s2: Option<f64>,
    /// Integral of |u|, summed over the vehicles \[m/s\].
    pub total_control_m_s: f64,
    /// Largest energy, divided by the initial energy.
    pub energy_max_over_initial: Option<f64>,
    /// Number of steps.
    pub steps: u64,
    /// Steps that were flown in parts.
    pub refined_steps: u64,
    /// Steps whose shortest part was longer than the law allows: the motion is not that of the law.
    pub overlong_steps: u64,
    /// SHA-256 of the resolved scenario.
    pub scenario_sha256: String,
    /// Hash of the settings that determine the flight ([`Scenario::flight_sha256`]).
    #[serde(skip)]
    pub flight_sha256: String,
    /// Hash over the bits of every recorded state.
    pub state_hash: String,
    /// Wall-clock time in the law \[s\].
    #[serde(skip)]
    pub law_s: f64,
}

/// Flies a scenario to its end and summarises the flight; memory does not grow with the length of the flight.
///
/// `carry_on` is called after each step with the number of steps. [`ControlFlow::Break`] ends the flight without a
/// summary.
///
/// # Errors
/// [`SimError`] if the law or the judge cannot be built, or an external law fails.
pub fn fly(
    scenario: &Scenario,
    seed: u64,
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Option<FlightSummary>, SimError> {
    let mut effort = Effort::default();
    let (preflight, parts) = (Preflight::of(scenario)?, Components::of(scenario)?);
    let parts = parts.with_free_steps(FreeSteps::Compared);
    let (report, ending) = run_with(scenario, &preflight, parts, &mut effort, carry_on)?;
    if let Ending::BrokeDown(breakdown @ Breakdown::EngineDiffers { .. }) = ending {
        return Err(SimError::EngineDiffers(breakdown));
    }
    if let Some(law) = &scenario.external_law {
        refuse_failed_law(law, &ending, &report)?;
    }
    let is_whole = !report.run.is_interrupted();
    let summary =
        || FlightSummary { flight_sha256: scenario.flight_sha256(), ..FlightSummary::new(report, seed, &effort) };
    Ok(is_whole.then(summary))
}

/// Refuses the flight of an external law that failed: a defect of the law is no result of a study.
fn refuse_failed_law(law: &ExternalLaw, ending: &Ending, report: &Report) -> Result<(), SimError> {
    let is_failed = match ending {
        Ending::LawUndefined(error) => *error == LawError::Failed,
        Ending::BrokeDown(breakdown) => matches!(breakdown, Breakdown::CommandNotFinite { .. }),
        Ending::Completed | Ending::Interrupted => false,
    };
    // A shield brakes where the law fails, and the flight goes on.
    let under_shield = report.shield.as_ref().filter(|shield| shield.law_failed > 0);
    let under_shield = under_shield.map(|shield| {
        let instants = counted(shield.law_failed, "instant", "instants");
        format!("it failed or commanded numbers that are not finite at {instants}, where the shield braked")
    });
    let reason = ending.reason().filter(|_| is_failed).or(under_shield);
    reason.map_or(Ok(()), |reason| Err(SimError::ExternalLaw { law: law.name().to_owned(), reason }))
}

impl FlightSummary {
    /// Returns whether the flight is worse than another. A violation is worse than none; otherwise the smaller
    /// separation is worse.
    #[must_use]
    pub fn is_worse_than(&self, other: &Self) -> bool {
        let rank = |flight: &Self| (flight.outcome != Outcome::Violated, flight.min_m.unwrap_or(f64::INFINITY));
        rank(self) < rank(other)
    }

    /// Returns the smallest separation less delta \[m\].
    #[must_use]
    pub fn clearance_m(&self) -> Option<f64> {
        self.min_m.map(|min_m| min_m - self.delta_m)
    }

    fn new(report: Report, seed: u64, effort: &Effort) -> Self {
        let (closest, breaks_certificate) = (report.closest_pair(), report.breaks_certificate());
        let refused = report.verdict.reasons.iter().find_map(|reason| match reason {
            Reason::Refused { warnings } => Some(warnings.clone()),
            _ => None,
        });
        let refused = refused.unwrap_or_default();
        Self {
            seed,
            outcome: Outcome::of(&report),
            pass: report.verdict.pass,
            ended_early: report.run.early_end(),
            refused,
            reached: report.formation.reached && report.legs.iter().all(|leg| leg.reached_at_s.is_some()),
            reached_at_s: report.formation.reached_at_s,
            delta_m: report.delta_m(),
            min_m: closest.map(|closest| closest.separation_m),
            min_at_s: closest.map(|closest| closest.time_s),
            min_pair: closest.map(|closest| closest.pair.numbers()),
            certified_m: report.certificate.separation_m,
            breaks_certificate,
            path_length_m: effort.path_length_m(),
            peak_control_m_s2: report.control.peak_m_s2,
            total_control_m_s: effort.total_control_m_s(),
            energy_max_over_initial: report.energy.max_over_initial,
            steps: report.run.steps,
            refined_steps: report.run.refined_steps,
            overlong_steps: report.run.overlong_steps,
            scenario_sha256: report.scenario.sha256,
            flight_sha256: String::new(),
            state_hash: report.run.state_hash,
            law_s: report.performance.map_or(0.0, |times| times.law_s),
        }
    }
}

impl Outcome {
    /// Returns the stable name, such as `ended_early`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Violated => "violated",
            Self::EndedEarly => "ended_early",
            Self::Undecided => "undecided",
            Self::Clear => "clear",
        }
    }

    fn of(report: &Report) -> Self {
        match report.answer.status {
            Status::Violation => Self::Violated,
            _ if report.run.ended_early.is_some() => Self::EndedEarly,
            Status::Clear => Self::Clear,
            Status::Undecided => Self::Undecided,
        }
    }
}

/// Flights of one law or of one point: a sample, or one flight repeated.
///
/// Flights of equal scenarios without randomness are one flight. They are no sample, so numbers over them have no
/// interval.
#[derive(Clone, Copy, Debug)]
pub struct FlightSample<'a> {
    flights: &'a [FlightSummary],
    is_repeated: bool,
}

impl<'a> FlightSample<'a> {
    /// Compares the flights.
    #[must_use]
    pub fn new(flights: &'a [FlightSummary]) -> Self {
        // The flights of an external law may differ although their scenarios are equal.
        let identity = |flight: &'a FlightSummary| (&*flight.flight_sha256, &*flight.state_hash);
        let is_repeated = flights.len() > 1 && flights.iter().all(|flight| identity(flight) == identity(&flights[0]));
        Self { flights, is_repeated }
    }

    /// Returns whether several flights are one flight repeated.
    #[must_use]
    pub fn is_repeated(self) -> bool {
        self.is_repeated
    }

    /// Returns the number of flights for which `shows` is true.
    pub fn count(self, shows: impl Fn(&FlightSummary) -> bool) -> u64 {
        self.flights.iter().filter(|flight| shows(flight)).count() as u64
    }

    /// Returns the share of flights for which `shows` is true.
    pub fn share(self, shows: impl Fn(&FlightSummary) -> bool) -> Proportion {
        let share = if self.is_repeated { Proportion::exact } else { Proportion::new };
        share(self.count(shows), self.flights.len() as u64)
    }

    /// Returns a quantile of the known values ([`Estimate::quantile`]).
    pub fn quantile(self, value: impl Fn(&FlightSummary) -> Option<f64>, part: f64) -> Estimate {
        self.of_sample(Estimate::quantile(&self.flights.iter().filter_map(value).collect::<Vec<_>>(), part))
    }

    /// Returns the mean ([`Estimate::mean`]).
    pub fn mean(self, value: impl Fn(&FlightSummary) -> f64) -> Estimate {
        self.of_sample(Estimate::mean(&self.flights.iter().map(value).collect::<Vec<_>>()))
    }

    /// Returns a note if several flights are identical. `which` names them.
    #[must_use]
    pub fn note(self, which: &str) -> Option<String> {
        let [first, others @ ..] = self.flights else { return None };
        let count = self.flights.len();
        if self.is_repeated {
            return Some(format!(
                "the {count} flights {which} are one flight repeated, because nothing in them is random: they are no \
                 sample and have no interval"
            ));
        }
        let is_identical = !others.is_empty() && others.iter().all(|flight| flight.state_hash == first.state_hash);
        is_identical.then(|| format!("the {count} flights {which} are identical: the drawn numbers change nothing"))
    }

    fn of_sample(self, estimate: Estimate) -> Estimate {
        if self.is_repeated { estimate.without_interval() } else { estimate }
    }
}

/// Path length and control effort of a swarm, accumulated over every step of a flight.
///
/// Holds the memory of one state. The path within a step is taken as straight.
#[derive(Clone, Debug, Default)]
pub struct Effort {
    before: Option<Before>,
    path_length_m: f64,
    total_control_m_s: f64,
}

/// State after the previous step.
#[derive(Clone, Debug)]
struct Before {
    time_s: f64,
    positions_m: Rows,
    control_m_s2: f64,
}

impl Effort {
    /// Returns the path length, summed over the vehicles \[m\].
    #[must_use]
    pub fn path_length_m(&self) -> f64 {
        self.path_length_m
    }

    /// Returns the integral of |u| by the trapezoidal rule over the steps, summed over the vehicles \[m/s\].
    #[must_use]
    pub fn total_control_m_s(&self) -> f64 {
        self.total_control_m_s
    }
}

impl Sink for Effort {
    fn sample(&mut self, _sample: &Sample<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }

    fn step(&mut self, step: &Step<'_>) {
        let (time_s, positions_m) = (step.time_s, &step.swarm.positions_m);
        let command = (step.control.nrows() > 0).then(|| sum_of_norms(step.control, None));
        let Some(before) = &mut self.before else {
            let control_m_s2 = command.unwrap_or(0.0);
            self.before = Some(Before { time_s, positions_m: positions_m.clone(), control_m_s2 });
            return;
        };
        // Without a new command the previous command holds.
        let control_m_s2 = command.unwrap_or(before.control_m_s2);
        self.path_length_m += sum_of_norms(positions_m, Some(&before.positions_m));
        self.total_control_m_s += f64::midpoint(before.control_m_s2, control_m_s2) * (time_s - before.time_s);
        before.positions_m.copy_from(positions_m);
        (before.time_s, before.control_m_s2) = (time_s, control_m_s2);
    }
}

/// Sums the norms of all rows, or of their differences from another table, in the order of the rows.
fn sum_of_norms(rows: &Rows, from: Option<&Rows>) -> f64 {
    (0..rows.nrows()).map(|i| from.map_or_else(|| row(rows, i), |from| row(rows, i) - row(from, i)).norm()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Swarm;
    use tautline_laws::law::Law;
    use tautline_laws::observation::Observation;
    use tautline_sim::scenario::{Override, Source};

    /// Returns the effort of two vehicles on circles of 1 m and 2 m with commands of t and 2 t m/s^2.
    fn seen(steps: u32) -> Effort {
        let mut effort = Effort::default();
        for k in 0..=steps {
            let time_s = f64::from(k) / f64::from(steps);
            let (y, x) = (std::f64::consts::TAU * time_s).sin_cos();
            let swarm = Swarm::at_rest(Rows::from_row_slice(&[x, y, 0.0, 2.0 * x, 2.0 * y, 0.0]));
            let control = Rows::from_row_slice(&[0.0, time_s, 0.0, 0.0, 0.0, -2.0 * time_s]);
            effort.step(&Step { time_s, swarm: &swarm, control: &control });
        }
        effort
    }

    /// Law that writes NaN for the first vehicle, or no acceleration for any.
    #[derive(Clone)]
    struct Coasting {
        first_m_s2: f64,
    }

    impl Law for Coasting {
        fn name(&self) -> &'static str {
            "coasting"
        }

        fn command(&mut self, _at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
            command.fill(0.0);
            command[(0, 0)] = self.first_m_s2;
            Ok(())
        }
    }

    #[test]
    fn a_law_that_fails_under_the_shield_does_not_pass_and_is_no_result_of_a_study() {
        let sets = ["shield.enabled=true", "time.duration_s=2"];
        let sets = sets.map(|set| Override::parse(set).expect("an override"));
        let source = Source::Builtin("swap".to_owned());
        let mut scenario = Scenario::read(&source, &sets).expect("a scenario");
        scenario.external_law = Some(ExternalLaw::new(Coasting { first_m_s2: f64::NAN }));
        let report = tautline_report::run::run(&scenario, &mut ()).expect("a report");
        let shield = report.shield.as_ref().expect("a shield");
        assert_eq!((shield.law_undefined, shield.law_failed), (shield.law_failed, 41));
        assert!(report.verdict.reasons.contains(&Reason::LawFailed { instants: 41 }), "{:?}", report.verdict.reasons);
        assert!(report.text().contains("no command at 41 instants"), "{}", report.text());
        let flown = fly(&scenario, 0, &mut |_| ControlFlow::Continue(()));
        assert!(matches!(flown, Err(SimError::ExternalLaw { .. })), "{flown:?}");
        scenario.external_law = Some(ExternalLaw::new(Coasting { first_m_s2: 0.0 }));
        let report = tautline_report::run::run(&scenario, &mut ()).expect("a report");
        assert_eq!(report.shield.as_ref().map(|shield| shield.law_undefined), Some(0));
        assert!(!report.verdict.has("law-failed"));
        assert!(fly(&scenario, 0, &mut |_| ControlFlow::Continue(())).is_ok());
    }

    #[test]
    fn paths_and_commands_are_summed_over_the_vehicles() {
        let effort = seen(1000);
        // The chords of 1000 parts are shorter than the arcs by a relative 1.6e-6.
        assert!((effort.path_length_m() / (3.0 * std::f64::consts::TAU) - 1.0).abs() < 2e-6);
        assert!((effort.total_control_m_s() - 1.5).abs() < 1e-12, "the trapezoidal rule is exact for a line");
        assert!(seen(4).path_length_m() < 0.91 * effort.path_length_m(), "few steps shorten the path");
    }

    #[test]
    fn a_repeated_step_counts_once_and_a_missing_command_keeps_the_last_one() {
        let mut effort = seen(10);
        let (way_m, control_m_s) = (effort.path_length_m(), effort.total_control_m_s());
        let swarm = Swarm::at_rest(Rows::from_row_slice(&[1.0, 0.0, 0.0, 2.0, 0.0, 0.0]));
        let none = Rows::zeros(0);
        effort.step(&Step { time_s: 1.0, swarm: &swarm, control: &none });
        assert!((effort.path_length_m() - way_m).abs() < 1e-12 && effort.total_control_m_s() == control_m_s);
        effort.step(&Step { time_s: 1.5, swarm: &swarm, control: &none });
        assert!((effort.total_control_m_s() - control_m_s - 1.5).abs() < 1e-12);
        assert_eq!(Effort::default().path_length_m(), 0.0);
    }
}
