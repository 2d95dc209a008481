//! The judgement and its reasons.

use serde::{Deserialize, Serialize};

use super::findings::Findings;
use crate::audit::Status;
use crate::text::{metres, metres_below, seconds};

/// The judgement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// Clear, reached, and flown to its end.
    pub pass: bool,
    /// Why it did not pass, a sentence each; empty where it did.
    pub reasons: Vec<String>,
}

impl Verdict {
    /// Passes where the audit is clear, both detectors agree, the formation is reached and the run was flown to its end.
    pub(super) fn of(findings: &Findings<'_>) -> Self {
        let reasons: Vec<_> = [
            violation(findings),
            disagreement(findings),
            undecided(findings),
            broken_certificate(findings),
            ended_early(findings),
            not_reached(findings),
            too_flat(findings),
        ]
        .into_iter()
        .flatten()
        .collect();
        Self { pass: reasons.is_empty(), reasons }
    }
}

fn violation(findings: &Findings<'_>) -> Option<String> {
    if findings.audit.status != Status::Violation {
        return None;
    }
    let delta_m = findings.delta_m;
    let violations = &findings.audit.violations;
    let Some(deepest) = violations.iter().min_by(|a, b| a.min_m.total_cmp(&b.min_m)) else {
        return Some(format!("Two vehicles came closer than {} m.", metres(delta_m)));
    };
    let [first, second] = deepest.pair.numbers();
    let others = match violations.len() - 1 {
        0 => String::new(),
        1 => " There is 1 other violation.".to_owned(),
        n => format!(" There are {n} other violations."),
    };
    Some(format!(
        "Vehicles {first} and {second} came to {} m of each other at {}; the safety distance is {} m.{others}",
        metres_below(deepest.min_m, delta_m),
        seconds(deepest.min_at_s),
        metres(delta_m),
    ))
}

fn disagreement(findings: &Findings<'_>) -> Option<String> {
    let parry = &findings.audit.parry;
    let first = parry.first_disagreement.as_ref().map(|first| format!(" First: {first}.")).unwrap_or_default();
    let count = parry.disagreements;
    let times = if count == 1 { "once".to_owned() } else { format!("{count} times") };
    (count > 0).then(|| format!("The two detectors of the audit disagree {times}, so one of them is wrong.{first}"))
}

fn undecided(findings: &Findings<'_>) -> Option<String> {
    (findings.audit.status == Status::Undecided && findings.audit.parry.disagreements == 0).then(|| {
        "The audit could not judge everything it was shown, so it cannot say that no two vehicles came too close."
            .to_owned()
    })
}

fn ended_early(findings: &Findings<'_>) -> Option<String> {
    let why = findings.ended_early?.trim_end_matches('.');
    Some(format!("The run ended early, at {}: {why}.", seconds(findings.run.duration_s)))
}

/// How far below the certified separation rounding explains, relative to it: the engine's 24 bits at coordinates of some
/// hundred separations, over many steps. A swarm that starts in its own formation certifies its own distances.
const ROUNDING: f64 = 1e-4;

/// Whether a separation is below what was certified, by more than rounding.
pub(super) fn breaks_certificate(separation_m: f64, certified_m: f64) -> bool {
    separation_m < certified_m * (1.0 - ROUNDING)
}

/// The proof is of continuous time: a separation below what it certifies shows a step too long for the law's barrier, or
/// numbers that ran out of digits.
fn broken_certificate(findings: &Findings<'_>) -> Option<String> {
    let (certified_m, closest) = (findings.certificate.certified_m?, findings.audit.closest?);
    breaks_certificate(closest.separation_m, certified_m).then(|| {
        format!(
            "The law certifies {} m in continuous time, and vehicles {} came to {} m: what was flown is not the motion that \
             the proof is about. Shorten time.dt_s, and look for positions so large that their differences lose digits.",
            metres(certified_m),
            closest.pair,
            metres_below(closest.separation_m, certified_m),
        )
    })
}

fn not_reached(findings: &Findings<'_>) -> Option<String> {
    let (summary, judge) = (findings.summary, findings.judge);
    if summary.reached_at_s.is_some() {
        return None;
    }
    let why = if let Some(held_s) = summary.held_s {
        format!("it was kept for the last {} only, and {} are asked for", seconds(held_s), seconds(judge.hold_s))
    } else if !summary.max_edge_error_m.is_finite() {
        "no state at the end is known".to_owned()
    } else if summary.max_edge_error_m > judge.edge_error_m {
        format!(
            "at the end a distance is still wrong by {} m, and {} m are allowed",
            metres(summary.max_edge_error_m),
            judge.edge_error_m
        )
    } else if summary.rms_position_error_m > judge.edge_error_m {
        format!(
            "at the end every edge has its length and the shape is another one: vehicles are {} m (root mean square) \
             from the formation, and {} m are allowed",
            metres(summary.rms_position_error_m),
            judge.edge_error_m
        )
    } else {
        format!(
            "at the end vehicles still differ by {} m/s from their mean velocity, and {} m/s are allowed",
            metres(summary.disagreement_m_s),
            judge.disagreement_m_s
        )
    };
    Some(format!("The formation was not reached: {why}."))
}

/// A start flatter than the formation: forces along the lines between vehicles never leave it.
fn too_flat(findings: &Findings<'_>) -> Option<String> {
    if findings.summary.reached_at_s.is_some() {
        return None;
    }
    let (start, trap) = match findings.trap_dimension? {
        0 => ("at one point", "point"),
        1 => ("on a line", "line"),
        _ => ("in a plane", "plane"),
    };
    let formation = match findings.formation_dimension {
        1 => "a line",
        2 => "a plane",
        _ => "space",
    };
    Some(format!(
        "The start lies {start} and the formation needs {formation}: a law that acts along the lines between vehicles \
         never leaves that {trap}."
    ))
}
