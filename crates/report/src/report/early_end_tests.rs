//! Flights that ended early: what was judged is said of what was flown, and never of the rest.

use super::tests::{Case, NOT_REACHED, REACHED, passing};
use super::*;

fn early() -> Case {
    Case { ended_early: Some("the law is undefined: it failed"), summary: NOT_REACHED, ..Case::good() }
}

#[test]
fn a_flight_that_ended_early_is_undecided_however_clear_it_was_up_to_there() {
    let report = early().report();
    assert_eq!((report.audit.status, report.audit.undecided), (Status::Undecided, 0));
    assert!(!report.verdict.pass);
    let headline = report.headline();
    let expected = "UNDECIDED from 120.00 s on: never closer than 2.460 m (delta 2.000 m), formation NOT reached";
    assert!(headline.starts_with(expected) && headline.ends_with("; ended early at 120.00 s"), "{headline}");
    assert!(report.judgement().is_else_known, "what was flown was judged");
    assert_eq!(report.formation.at_rest, None, "more time may help");
    // The same flight, flown to its end.
    let whole = Case { ended_early: None, ..early() }.report();
    assert_eq!(whole.formation.at_rest, Some(true));
    assert_eq!(whole.audit.status, Status::Clear);
    assert!(whole.headline().starts_with("CLEAR: never closer than 2.460 m"), "{}", whole.headline());
}

#[test]
fn a_violation_stays_one_and_a_doubt_of_the_judge_is_not_laid_on_the_end() {
    let violated = Case { audit: passing(1.5), ..early() }.report();
    assert_eq!(violated.audit.status, Status::Violation);
    assert!(violated.headline().starts_with("VIOLATION: "), "{}", violated.headline());
    let mut doubtful = early();
    doubtful.audit.status = Status::Undecided;
    doubtful.audit.unresolved = 1;
    let doubtful = doubtful.report();
    assert!(doubtful.headline().starts_with("UNDECIDED: not everything could be judged"), "{}", doubtful.headline());
    assert!(!doubtful.judgement().is_else_known);
}

#[test]
fn a_formation_that_was_kept_up_to_an_early_end_is_not_reached() {
    let report = Case { summary: REACHED, ..early() }.report();
    let formation = &report.formation;
    assert_eq!((formation.reached, formation.reached_at_s), (false, None));
    assert_eq!(formation.fails, Some(Fails::EndedEarly));
    assert!(report.headline().contains("formation NOT reached (the flight ended early)"), "{}", report.headline());
    assert_eq!(report.verdict.reasons.len(), 1, "the early end: {:?}", report.verdict.reasons);
    let whole = Case { ended_early: None, summary: REACHED, ..early() }.report();
    assert_eq!((whole.formation.reached, whole.formation.fails), (true, None));
}

#[test]
fn a_report_without_wall_clock_times_reads_back_without() {
    let report = Report { performance: None, ..early().report() };
    let json = report.to_json().expect("JSON");
    assert!(!json.contains("performance") && !report.text().contains("wall"), "{json}");
    assert_eq!(serde_json::from_str::<Report>(&json).expect("reads back"), report);
    assert!(early().report().to_json().expect("JSON").contains("\"performance\""));
}
