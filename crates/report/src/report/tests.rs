//! Tests of the report as a whole: keys, null for what is no number, reasons, headlines.

use super::*;
use tautline_audit::{self as audit, AuditOutcome, Auditor};
use tautline_core::record::EnergyRise;
use tautline_core::swarm::{Pair, Rows};
use tautline_laws::law::{Certificate, Void};
use tautline_laws::target::Arrival;
use tautline_sim::metrics::{LegSummary, Summary};

const DELTA_M: f64 = 2.0;
const JUDGE: Arrival = Arrival { edge_error_m: 0.01, disagreement_m_s: 0.02, hold_s: 1.0 };

/// Two vehicles that pass each other at `miss_m` between 0 and 1 s, as the judge sees it.
pub(super) fn passing(miss_m: f64) -> AuditOutcome {
    let mut auditor = Auditor::new(2, DELTA_M).expect("a judge");
    auditor.start(0.0, &Rows::from_row_slice(&[-5.0, 0.0, 0.0, 5.0, miss_m, 0.0])).expect("judged");
    auditor.step(1.0, &Rows::from_row_slice(&[5.0, 0.0, 0.0, -5.0, miss_m, 0.0])).expect("judged");
    auditor.finish()
}

pub(super) const REACHED: Summary = Summary {
    extent_m: 6.0,
    fastest_m_s: 1.0,
    samples: 7201,
    end_s: 120.0,
    reached_at_s: Some(36.5),
    held_s: Some(83.5),
    max_edge_error_m: 4.5e-14,
    rms_position_error_m: 1e-14,
    max_position_error_m: 2e-14,
    disagreement_m_s: 1e-13,
    common_m_s: 0.0,
    peak_control_m_s2: 1.03,
    final_control_m_s2: 0.0,
    energy_initial: Some(3.656_742_96),
    energy_final: Some(0.0),
    energy_max: Some(3.656_742_96),
    energy_max_over_initial: Some(1.0),
};

pub(super) const NOT_REACHED: Summary = Summary { reached_at_s: None, held_s: None, max_edge_error_m: 8.57, ..REACHED };

/// What a test changes about an otherwise good run.
pub(super) struct Case {
    pub(super) audit: AuditOutcome,
    /// Half axes of ellipsoids, and what the judge saw in metres.
    pub(super) in_metres: Option<([f64; 3], AuditOutcome)>,
    pub(super) summary: Summary,
    pub(super) trap_dimension: Option<usize>,
    pub(super) ended_early: Option<&'static str>,
    pub(super) refused: &'static [&'static str],
    pub(super) certificate: Certificate,
    pub(super) clearance: Option<tautline_audit::ClearanceOutcome>,
    pub(super) energy_falls: bool,
    pub(super) energy_rise: Option<EnergyRise>,
    pub(super) legs: usize,
    pub(super) ended_legs: Vec<LegSummary>,
}

impl Case {
    pub(super) fn good() -> Self {
        let certificate = Certificate {
            certified_m: Some(2.055_307),
            energy_initial: Some(3.656),
            void: vec![],
            ..Certificate::void(Void::NoBarrier)
        };
        Self {
            audit: passing(2.4607),
            in_metres: None,
            summary: REACHED,
            trap_dimension: None,
            ended_early: None,
            refused: &[],
            certificate,
            clearance: None,
            energy_falls: true,
            energy_rise: Some(EnergyRise { from: 3.656_742_96, to: 3.656_742_96 }),
            legs: 1,
            ended_legs: Vec::new(),
        }
    }

    pub(super) fn report(&self) -> Report {
        Report::new(&Findings {
            scenario_name: "pentagon",
            scenario_sha256: "00ff",
            delta_m: DELTA_M,
            half_axes_m: self.in_metres.as_ref().map(|(axes, _)| *axes),
            judge: JUDGE,
            trap_dimension: self.trap_dimension,
            formation_dimension: 2,
            refused: self.refused,
            certificate: &self.certificate,
            audit: &self.audit,
            in_metres: self.in_metres.as_ref().map(|(_, audit)| audit),
            clearance: self.clearance.as_ref(),
            obstacles: &["tower".to_owned()],
            vehicle: None,
            engine_contact_pairs: Some(0),
            hulls: &Hulls { bounces: Some(Vec::new()), passed_through: None },
            summary: &self.summary,
            legs: self.legs,
            ended_legs: &self.ended_legs,
            breaths: &[],
            assignments: &[],
            network: None,
            failures: &[],
            is_disturbed: false,
            energy_rise: self.energy_rise,
            energy_falls: self.energy_falls,
            run: &Run {
                duration_s: 120.0,
                dt_s: 1.0 / 240.0,
                steps: 28_800,
                refined_steps: 0,
                overlong_steps: 0,
                ended_early: self.ended_early.map(str::to_owned),
                vehicles: 5,
                state_hash: "0123456789abcdef".to_owned(),
            },
            performance: Performance { wall_s: 0.5, real_time_factor: Some(240.0), ..Performance::default() },
        })
    }

    /// The only reason why this run does not pass.
    fn reason(&self) -> String {
        let verdict = self.report().verdict;
        assert!(!verdict.pass);
        assert_eq!(verdict.reasons.len(), 1, "{:?}", verdict.reasons);
        verdict.reasons[0].clone()
    }
}

/// Every key of an indented JSON text in order, with its indentation less that of the outermost keys.
fn keys(json: &str) -> Vec<String> {
    let key = |line: &str| {
        let name = line.trim_start().strip_prefix('"')?.split_once("\":")?.0;
        Some(format!("{}{name}", &line[2..line.len() - line.trim_start().len()]))
    };
    json.lines().filter_map(key).collect()
}

#[test]
fn the_keys_of_the_json_are_these_in_this_order() {
    let mut case = Case::good();
    case.audit = passing(1.5);
    let expected = "schema_version
scenario
  name
  sha256
tool
  name
  version
verdict
  pass
  refused
  reasons
separation
  delta_m
  min_m
  min_at_s
  min_pair
  certified_m
  certified_until_s
  certificate_void
audit
  status
  violations
      pair
      from_s
      to_s
      min_m
      min_at_s
  undecided
  steps
  pairs_checked
  closed_form
    min_m
  parry
    min_toi_s
    disagreements
  rapier
    contact_pairs
hulls
  bounces
  passed_through
formation
  reached
  reached_at_s
  held_s
  fails
  at_rest
  max_edge_error_m
  rms_position_error_m
  max_position_error_m
energy
  initial
  final
  max_over_initial
  max_over_leg_start
  rose
control
  peak_m_s2
  final_m_s2
velocity
  disagreement_m_s
  common_m_s
run
  duration_s
  dt_s
  steps
  refined_steps
  overlong_steps
  ended_early
  vehicles
  state_hash
performance
  wall_s
  real_time_factor
  law_s
  energy_s
  physics_s
  airframe_s
  audit_s
  record_s";
    let json = case.report().to_json().expect("JSON");
    assert_eq!(keys(&json), expected.lines().collect::<Vec<_>>());
}

#[test]
fn a_report_read_back_from_its_json_is_the_same_to_the_last_bit() {
    let mut case = Case::good();
    case.audit = passing(1.5);
    let report = case.report();
    let back: Report = serde_json::from_str(&report.to_json().expect("JSON")).expect("reads back");
    assert_eq!(back, report);
    let extended = report.to_json().expect("JSON").replacen("{\n", "{\n  \"extra\": 1,\n", 1);
    let back: Report = serde_json::from_str(&extended).expect("keys of a later program of this version are no error");
    assert_eq!(back, report);
}

#[test]
fn what_is_no_finite_number_is_null_and_reads_back() {
    let mut case = Case::good();
    case.summary = Summary {
        max_edge_error_m: f64::NAN,
        rms_position_error_m: f64::INFINITY,
        disagreement_m_s: f64::NAN,
        common_m_s: f64::NEG_INFINITY,
        peak_control_m_s2: f64::NAN,
        final_control_m_s2: f64::NAN,
        energy_final: Some(f64::NAN),
        ..NOT_REACHED
    };
    let report = case.report();
    let json = report.to_json().expect("JSON");
    assert!(!json.contains("NaN") && !json.contains("inf"), "{json}");
    let value: serde_json::Value = serde_json::from_str(&json).expect("valid JSON");
    assert!(value["formation"]["max_edge_error_m"].is_null() && value["energy"]["final"].is_null());
    assert_eq!(serde_json::from_str::<Report>(&json).expect("reads back"), report);
}

#[test]
fn a_clear_run_that_reached_its_formation_passes_without_reasons() {
    let report = Case::good().report();
    assert!(report.verdict.pass);
    assert_eq!(report.verdict.reasons, Vec::<String>::new());
    assert_eq!(report.headline(), "CLEAR: never closer than 2.460 m (delta 2.000 m), formation reached at 36.5 s");
    assert_eq!((report.separation.min_pair, report.audit.status), (Some([1, 2]), Status::Clear));
}

#[test]
fn a_violation_is_told_with_its_pair_distance_and_time() {
    let case = Case { audit: passing(1.5327), certificate: Certificate::void(Void::NoBarrier), ..Case::good() };
    assert_eq!(
        case.reason(),
        "Vehicles 1 and 2 came to 1.533 m of each other at 0.50 s; the safety distance is 2.000 m."
    );
    assert_eq!(case.report().headline(), "VIOLATION: vehicles 1-2 came to 1.533 m (delta 2.000 m) at 0.50 s");
    let violation = &case.report().audit.violations[0];
    assert_eq!((violation.pair, violation.min_m), (Pair::new(0, 1), 1.5327));
}

#[test]
fn a_violation_by_a_hair_does_not_look_like_the_safety_distance() {
    let case = Case { audit: passing(DELTA_M - 1e-7), ..Case::good() };
    assert!(case.report().headline().contains("came to 1.9999999 m (delta 2.000 m)"));
}

#[test]
fn rounding_breaks_no_certificate() {
    // A swarm that starts in its own formation certifies its own distances.
    let void = Vec::new();
    let certificate = Certificate { certified_m: Some(3.0), void, ..Certificate::void(Void::NoBarrier) };
    let case = Case { audit: passing(2.999_999_88), certificate: certificate.clone(), ..Case::good() };
    assert!(case.report().verdict.pass && !case.report().headline().contains("breaks"), "{:?}", case.report().verdict);
    let case = Case { audit: passing(2.998), certificate, ..Case::good() };
    assert!(!case.report().verdict.pass && case.report().headline().contains("breaks the certificate"));
}

#[test]
fn a_flight_below_its_certificate_does_not_pass_even_where_it_is_clear() {
    let case = Case { audit: passing(2.04), ..Case::good() };
    assert_eq!(
        case.reason(),
        "The law certifies 2.055 m in continuous time, and vehicles 1-2 came to 2.040 m: what was flown is not the motion \
         that the proof is about. Shorten time.dt_s, and look for positions so large that their differences lose digits."
    );
}

#[test]
fn a_formation_that_is_not_reached_is_told_with_its_largest_error() {
    let case = Case { summary: NOT_REACHED, ..Case::good() };
    assert_eq!(
        case.reason(),
        "The formation was not reached: at the end a distance is still wrong by 8.570 m, and 0.01 m are allowed. The \
         vehicles have come to rest elsewhere: ten times the duration would not be enough."
    );
    assert_eq!(
        case.report().headline(),
        "CLEAR: never closer than 2.460 m (delta 2.000 m), formation NOT reached (largest edge error 8.57 m, at rest \
         elsewhere)"
    );
}

#[test]
fn the_headline_names_the_number_that_fails() {
    let said = |summary| {
        let report = Case { summary, ..Case::good() }.report();
        let headline = report.headline();
        (report.formation.fails, headline.split_once("NOT reached").map(|(_, why)| why.to_owned()).unwrap_or_default())
    };
    let lost = Summary { reached_at_s: None, held_s: None, ..REACHED };
    let cases = [
        (REACHED, None, ""),
        (
            Summary { max_edge_error_m: 0.5, final_control_m_s2: 0.1, ..lost },
            Some(Fails::MaxEdgeErrorM),
            " (largest edge error 0.50 m, still moving)",
        ),
        (
            Summary { max_position_error_m: 0.6, ..lost },
            Some(Fails::MaxPositionErrorM),
            " (another shape or place, largest position error 0.60 m, at rest elsewhere)",
        ),
        (
            Summary { disagreement_m_s: 0.7, ..lost },
            Some(Fails::Disagreement),
            " (largest relative speed 0.70 m/s, still moving)",
        ),
        (Summary { held_s: Some(0.4), ..lost }, Some(Fails::HeldS), " (kept for the last 0.40 s only)"),
        (Summary { max_edge_error_m: f64::NAN, ..lost }, Some(Fails::Unknown), ""),
        (
            Summary { max_edge_error_m: 0.5, final_control_m_s2: f64::NAN, ..lost },
            Some(Fails::MaxEdgeErrorM),
            " (largest edge error 0.50 m)",
        ),
    ];
    for (summary, fails, why) in cases {
        assert_eq!(said(summary), (fails, why.to_owned()));
    }
}

#[test]
fn a_flight_that_was_refused_never_passes_and_says_so_in_its_headline() {
    let case = Case { refused: &["start-on-line", "drift-unresolved"], ..Case::good() };
    assert_eq!(case.reason(), "The flight was refused before its first step: start-on-line, drift-unresolved.");
    let headline = case.report().headline();
    assert!(
        headline.starts_with("CLEAR: ")
            && headline.ends_with("; refused before the first step: start-on-line, drift-unresolved")
    );
    assert!(!Case::good().report().headline().contains("refused"));
}

#[test]
fn a_formation_kept_too_short_or_still_moving_says_so() {
    let short = Summary { reached_at_s: None, held_s: Some(0.4), ..REACHED };
    assert!(Case { summary: short, ..Case::good() }.reason().contains("kept for the last 0.40 s only, and 1.00 s"));
    let moving = Summary { reached_at_s: None, held_s: None, disagreement_m_s: 0.5, ..REACHED };
    assert!(Case { summary: moving, ..Case::good() }.reason().contains("differ by 0.500 m/s"));
}

#[test]
fn a_start_flatter_than_the_formation_is_named_only_where_it_was_not_left() {
    let case = Case { summary: NOT_REACHED, trap_dimension: Some(1), ..Case::good() };
    let reasons = case.report().verdict.reasons;
    assert_eq!(reasons.len(), 2);
    assert!(reasons[1].starts_with("The start lies on a line and the formation needs a plane"), "{}", reasons[1]);
    assert!(Case { trap_dimension: Some(1), ..Case::good() }.report().verdict.pass);
}

#[test]
fn detectors_that_disagree_never_pass() {
    let mut case = Case::good();
    case.audit.parry.disagreements = 3;
    case.audit.status = audit::Status::Undecided;
    assert!(case.reason().starts_with("The two detectors of the audit disagree 3 times"));
    assert!(case.report().headline().starts_with("UNDECIDED: the two detectors disagree"));
}

#[test]
fn what_was_not_judged_whole_never_passes() {
    let mut case = Case::good();
    case.audit.status = audit::Status::Undecided;
    assert!(case.reason().starts_with("The audit could not judge everything"));
    assert!(case.report().headline().starts_with("UNDECIDED: not everything could be judged"));
}

#[test]
fn a_run_that_ended_early_never_passes_and_says_why() {
    let ended_early = Some("interrupted");
    assert_eq!(Case { ended_early, ..Case::good() }.reason(), "The run ended early, at 120.00 s: interrupted.");
}

#[test]
fn a_void_certificate_says_why_in_sentences() {
    let report = Case::good().report();
    assert_eq!((report.separation.certified_m, report.separation.certificate_void.len()), (Some(2.055_307), 0));
    assert!(report.text().contains("certified 2.055307 m"));
    let report = Case { certificate: Certificate::void(Void::NoBarrier), ..Case::good() }.report();
    assert_eq!(report.separation.certified_m, None);
    assert_eq!(report.separation.certificate_void, [Void::NoBarrier.to_string()]);
    assert!(report.text().contains("not certified"));
}

#[test]
fn the_table_has_a_line_for_every_part() {
    let text = Case::good().report().text();
    let names: Vec<_> = text.lines().map(|line| line.split(' ').next().unwrap_or_default()).collect();
    let parts = ["separation", "audit", "formation", "energy", "control", "velocity", "run", "performance"];
    assert_eq!(names, parts);
    assert!(text.contains("2.460700 m at 0.50 s, vehicles 1-2 (delta 2.000 m"), "{text}");
    assert!(!text.contains("NaN"));
}

#[test]
fn a_report_on_disk_is_the_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("report.json");
    let report = Case::good().report();
    report.write(&path).expect("writes");
    let text = std::fs::read_to_string(&path).expect("reads");
    assert!(text.ends_with("}\n"));
    assert_eq!(serde_json::from_str::<Report>(&text).expect("reads back"), report);
    assert!(report.write(&folder.path().join("missing/report.json")).is_err());
}
