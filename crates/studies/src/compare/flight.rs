//! One flight of a comparison as one row of numbers.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::effort::Effort;
use tautline_report::report::{INTERRUPTED, Report, Status};
use tautline_report::run::run_while;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::SimError;

/// How a flight went, in a word; the first that applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Two vehicles came closer than delta.
    Violated,
    /// No violation was found, and it was not flown to its end.
    EndedEarly,
    /// The judge cannot tell, or its two detectors disagree.
    Undecided,
    /// Flown to its end and proved clear, both detectors agreeing.
    Clear,
}

/// One flight. Every number but `law_s` is the same for any number of threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightRow {
    /// What stood in the place of `start.seed`.
    pub seed: u64,
    /// How it went.
    pub outcome: Outcome,
    /// Whether `tautline run` would say pass.
    pub pass: bool,
    /// Codes by which `tautline check` refuses it; it was flown all the same.
    pub refused: Vec<String>,
    /// Why it ended before its time.
    pub ended_early: Option<String>,
    /// Whether the formation was reached and kept to the end; on a flight of several legs each of them.
    pub reached: bool,
    /// From when on \[s\].
    pub reached_at_s: Option<f64>,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Smallest distance of two centres \[m\].
    pub min_m: Option<f64>,
    /// When that was \[s\].
    pub min_at_s: Option<f64>,
    /// Which two.
    pub min_pair: Option<[usize; 2]>,
    /// What the law's certificate promised \[m\].
    pub certified_m: Option<f64>,
    /// Whether two came closer than that, by more than integration may cost.
    #[serde(default)]
    pub breaks_certificate: bool,
    /// Ways flown, summed over the vehicles \[m\].
    pub path_length_m: f64,
    /// Largest commanded acceleration of a vehicle \[m/s^2\].
    pub peak_control_m_s2: Option<f64>,
    /// Integral of |u|, summed over the vehicles \[m/s\].
    pub total_control_m_s: f64,
    /// Largest energy over the initial one.
    pub energy_max_over_initial: Option<f64>,
    /// Steps flown.
    pub steps: u64,
    /// Those of them that were flown in parts.
    pub refined_steps: u64,
    /// Those of which even the shortest part was longer than the law allows: what was flown is not the law's motion.
    pub overlong_steps: u64,
    /// SHA-256 of the resolved scenario.
    pub scenario_sha256: String,
    /// Hash over the bits of every recorded state.
    pub state_hash: String,
    /// Wall-clock time in the law \[s\].
    #[serde(skip)]
    pub law_s: f64,
}

/// Flies a scenario to its end and keeps its row; memory does not grow with the length of the flight.
///
/// `carry_on` is asked after each step and ends the flight with [`ControlFlow::Break`], which leaves no row.
///
/// # Errors
/// [`SimError`] where law or judge do not exist.
pub fn fly(
    scenario: &Scenario,
    seed: u64,
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Option<FlightRow>, SimError> {
    let mut effort = Effort::new();
    let report = run_while(scenario, &Preflight::of(scenario)?, &mut effort, carry_on)?;
    let is_whole = report.run.ended_early.as_deref() != Some(INTERRUPTED);
    Ok(is_whole.then(|| FlightRow::new(report, seed, &effort)))
}

impl FlightRow {
    fn new(report: Report, seed: u64, effort: &Effort) -> Self {
        let breaks_certificate = report.breaks_certificate();
        Self {
            seed,
            outcome: Outcome::of(&report),
            pass: report.verdict.pass,
            refused: report.verdict.refused,
            ended_early: report.run.ended_early,
            reached: report.formation.reached && report.legs.iter().all(|leg| leg.reached_at_s.is_some()),
            reached_at_s: report.formation.reached_at_s,
            delta_m: report.separation.delta_m,
            min_m: report.separation.min_m,
            min_at_s: report.separation.min_at_s,
            min_pair: report.separation.min_pair,
            certified_m: report.separation.certified_m,
            breaks_certificate,
            path_length_m: effort.path_length_m(),
            peak_control_m_s2: report.control.peak_m_s2,
            total_control_m_s: effort.total_control_m_s(),
            energy_max_over_initial: report.energy.max_over_initial,
            steps: report.run.steps,
            refined_steps: report.run.refined_steps,
            overlong_steps: report.run.overlong_steps,
            scenario_sha256: report.scenario.sha256,
            state_hash: report.run.state_hash,
            law_s: report.performance.map_or(0.0, |times| times.law_s),
        }
    }
}

impl Outcome {
    /// Its stable name.
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
        match report.audit.status {
            Status::Violation => Self::Violated,
            _ if report.run.ended_early.is_some() => Self::EndedEarly,
            Status::Clear if report.audit.parry.disagreements == 0 => Self::Clear,
            Status::Clear | Status::Undecided => Self::Undecided,
        }
    }
}
