//! Tests of keys, null values, reasons, verdict lines, certificates and early ends.

use std::time::Duration;

use nalgebra::Vector3;

use super::*;
use tautline_audit::{AuditOutcome, Auditor, ClearanceAuditor, ClearanceOutcome};
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::record::EnergyRise;
use tautline_core::swarm::{Bounce, Pair, Rows};
use tautline_laws::law::{Certificate, LawError, LegBound, VoidReason};
use tautline_laws::target::Arrival;
use tautline_sim::metrics::{LegSummary, Summary};
use tautline_sim::preflight::{Code, Preflight, Warning};
use tautline_sim::scenario::{Safety, Scenario, Source};
use tautline_sim::sim::{self, Ending, Flight};

const DELTA_M: f64 = 2.0;
const JUDGE: Arrival = Arrival { edge_error_m: 0.01, disagreement_m_s: 0.02, hold_s: 1.0 };

/// Returns the audit of two vehicles that pass each other at `miss_m` between 0 and 1 s.
fn passing(miss_m: f64) -> AuditOutcome {
    let mut auditor = Auditor::new(2, DELTA_M).expect("a judge");
    auditor.start(0.0, &Rows::from_row_slice(&[-5.0, 0.0, 0.0, 5.0, miss_m, 0.0])).expect("judged");
    auditor.step(1.0, &Rows::from_row_slice(&[5.0, 0.0, 0.0, -5.0, miss_m, 0.0])).expect("judged");
    auditor.finish()
}

const REACHED: Summary = Summary {
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

const NOT_REACHED: Summary = Summary { reached_at_s: None, held_s: None, max_edge_error_m: 8.57, ..REACHED };

/// Changes of a test to a run that passes.
struct Case {
    audit: AuditOutcome,
    /// Audit in metres, for ellipsoids.
    in_metres: Option<AuditOutcome>,
    summary: Summary,
    trap_dimension: Option<usize>,
    ending: Ending,
    refused: &'static [Code],
    certificate: Certificate,
    clearance: Option<ClearanceOutcome>,
    energy_falls: bool,
    energy_rise: Option<EnergyRise>,
    legs: usize,
    ended_legs: Vec<LegSummary>,
}

impl Case {
    fn good() -> Self {
        let certificate = Certificate {
            certified_m: Some(2.055_307),
            energy_initial: Some(3.656),
            void: vec![],
            ..Certificate::void(VoidReason::NoBarrier)
        };
        Self {
            audit: passing(2.4607),
            in_metres: None,
            summary: REACHED,
            trap_dimension: None,
            ending: Ending::Completed,
            refused: &[],
            certificate,
            clearance: None,
            energy_falls: true,
            energy_rise: Some(EnergyRise { from: 3.656_742_96, to: 3.656_742_96 }),
            legs: 1,
            ended_legs: Vec::new(),
        }
    }

    fn report(&self) -> Report {
        let mut scenario = Scenario::read(&Source::Builtin("pentagon".to_owned()), &[]).expect("built in");
        scenario.arrival = JUDGE;
        let mut preflight = Preflight::of(&scenario).expect("a law");
        let message = String::new();
        preflight.warnings = self.refused.iter().map(|&code| Warning { code, message: message.clone() }).collect();
        preflight.start_dimension = self.trap_dimension.unwrap_or(preflight.formation_dimension);
        preflight.velocity_margin_per_s = self.energy_falls.then_some(1.0);
        scenario.legs = vec![scenario.legs[0].clone(); self.legs];
        scenario.obstacles = vec![Obstacle {
            name: "tower".to_owned(),
            place_m: Vector3::zeros(),
            shape: Shape::Ball { radius_m: 1.0 },
            clearance_m: 0.5,
        }];
        if self.in_metres.is_some() {
            scenario.safety = Safety::Ellipsoid { half_axes_m: [1.0, 1.0, 3.0] };
        }
        let wall = Duration::from_millis(500);
        let flight = Flight {
            law: "edge-tension".to_owned(),
            ending: self.ending.clone(),
            duration_s: 120.0,
            steps: 28_800,
            refined_steps: 0,
            engine_steps: None,
            overlong_steps: 0,
            certificate: self.certificate.clone(),
            audit: self.audit.clone(),
            in_metres: self.in_metres.clone(),
            clearance: self.clearance.clone(),
            engine_contacts: Vec::new(),
            bounces: Vec::new(),
            energy_rise: self.energy_rise,
            deadlock_recoveries: Vec::new(),
            assignments: Vec::new(),
            traffic: None,
            shield: None,
            last: scenario.start.clone(),
            performance: sim::Performance { wall, ..sim::Performance::default() },
        };
        Report::new(&FlightResult {
            scenario: &scenario,
            preflight: &preflight,
            flight: &flight,
            summary: &self.summary,
            ended_legs: &self.ended_legs,
            quadrotor_peaks: None,
            state_hash: "0123456789abcdef",
        })
    }

    /// Returns the only reason against a pass.
    fn reason(&self) -> String {
        let verdict = self.report().verdict;
        assert!(!verdict.pass);
        assert_eq!(verdict.reasons.len(), 1, "{:?}", verdict.reasons);
        verdict.reasons[0].to_string()
    }
}

/// Returns the keys of an indented JSON text in order, with their indentation relative to the outermost keys.
fn keys(json: &str) -> Vec<String> {
    let key = |line: &str| {
        let name = line.trim_start().strip_prefix('"')?.split_once("\":")?.0;
        Some(format!("{}{name}", &line[2..line.len() - line.trim_start().len()]))
    };
    json.lines().filter_map(key).collect()
}

#[expect(clippy::too_many_lines, reason = "a line for each key")]
#[test]
fn json_has_these_keys_in_this_order() {
    let mut case = Case::good();
    case.audit = passing(1.5);
    let expected = "schema_version
status
pass
proved
question
  delta
  unit
  radius_m
  ellipsoid_m
  cylinder_m
  obstacles
  limits
  well_clear
  require_presence
  plan
  above_m
  from_s
  to_s
answers
    part
    status
    closest
        subjects
        from_s
        to_s
        at_s
        value
          lower
          upper
          unit
        limit
        rate_hz
    violations
      count
      is_exact
      listed
          subjects
          from_s
          to_s
          at_s
          value
            lower
            upper
            unit
          limit
          rate_hz
    undecided
      count
      is_exact
      listed
    detectors
      steps
      segments
      pairs_swept
      parry_contact_s
      parry_disagreements
      rapier_contact_pairs
facts
    fact
    source
    value
    unit
    subject
window_s
vehicles
reasons
    code
    text
    data
      pair
      min_m
      min_at_s
      limit_m
      violations
    code
    text
    data
      pair
      min_m
      min_at_s
      limit_m
      by_shield
certificate
  separation_m
  clearance_margin_m
  until_s
  void
scenario
  name
  sha256
tool
  name
  version
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
  engine_steps
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
fn a_reason_has_a_code_a_sentence_and_data() {
    let mut case = Case::good();
    case.audit = passing(1.5);
    case.ending = Ending::Interrupted;
    let json: serde_json::Value = serde_json::from_str(&case.report().to_json().expect("JSON")).expect("JSON");
    let reasons = &json["reasons"];
    assert_eq!((&reasons[0]["code"], &reasons[0]["data"]["min_m"]), (&"violation".into(), &1.5.into()));
    assert!(reasons[0]["text"].as_str().is_some_and(|text| text.starts_with("Vehicles 1 and 2 came to 1.500 m")));
    assert_eq!((&reasons[2]["code"], &reasons[2]["data"]["ending"]), (&"ended-early".into(), &"interrupted".into()));
    assert_eq!(json["run"]["ended_early"], serde_json::json!({ "code": "interrupted", "text": "interrupted" }));
    let void = Case { certificate: Certificate::void(VoidReason::NoBarrier), ..Case::good() }.report();
    let json: serde_json::Value = serde_json::from_str(&void.to_json().expect("JSON")).expect("JSON");
    assert_eq!(json["certificate"]["void"][0]["code"], "no-barrier");
}

#[test]
fn non_finite_numbers_are_null() {
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
}

#[test]
fn clear_run_that_reached_its_formation_passes() {
    let report = Case::good().report();
    assert!(report.verdict.pass);
    assert_eq!(report.verdict.reasons, Vec::new());
    assert_eq!(report.headline(), "CLEAR: never closer than 2.460 m (delta 2.000 m), formation reached at 36.50 s");
    assert_eq!(
        (report.closest_pair().map(|of| of.pair.numbers()), report.answer.status),
        (Some([1, 2]), Status::Clear)
    );
}

#[test]
fn violation_names_pair_distance_and_time() {
    let case = Case { audit: passing(1.5327), certificate: Certificate::void(VoidReason::NoBarrier), ..Case::good() };
    assert_eq!(case.reason(), "Vehicles 1 and 2 came to 1.532 m at 0.50 s; the safety distance is 2.000 m.");
    assert_eq!(case.report().headline(), "VIOLATION: vehicles 1 and 2 came to 1.532 m (delta 2.000 m) at 0.50 s");
    let violation = &case.report().answer.violations.listed[0];
    assert_eq!((violation.subjects.join(" "), violation.value.upper), ("1 2".to_owned(), Some(1.5327)));
}

#[test]
fn tiny_violation_differs_from_delta_as_printed() {
    let case = Case { audit: passing(DELTA_M - 1e-7), ..Case::good() };
    assert!(case.report().headline().contains("came to 1.9999999 m (delta 2.000 m)"));
}

#[test]
fn rounding_does_not_break_a_certificate() {
    // A swarm that starts in its own formation certifies its own distances.
    let void = Vec::new();
    let certificate = Certificate { certified_m: Some(3.0), void, ..Certificate::void(VoidReason::NoBarrier) };
    let case = Case { audit: passing(2.999_999_88), certificate: certificate.clone(), ..Case::good() };
    assert!(
        case.report().verdict.pass && case.report().headline().starts_with("CLEAR: "),
        "{:?}",
        case.report().verdict
    );
    let case = Case { audit: passing(2.998), certificate, ..Case::good() };
    assert!(!case.report().verdict.pass && case.report().headline().starts_with("CERTIFICATE BROKEN: "));
}

#[test]
fn clear_flight_below_its_certificate_does_not_pass() {
    let case = Case { audit: passing(2.04), ..Case::good() };
    assert_eq!(
        case.reason(),
        "The law certifies 2.055 m in continuous time, but vehicles 1 and 2 came to 2.040 m: the flown motion is not \
         the one that the proof covers. Shorten time.dt_s, and look for positions so large that their differences \
         lose digits."
    );
}

#[test]
fn unreached_formation_is_reported_with_its_largest_error() {
    let case = Case { summary: NOT_REACHED, ..Case::good() };
    assert_eq!(
        case.reason(),
        "The formation was not reached: at the end the largest edge error is 8.570 m (limit 0.01 m). The vehicles \
         have come to rest elsewhere: ten times the duration would not suffice."
    );
    assert_eq!(
        case.report().headline(),
        "NOT REACHED: largest edge error 8.570 m, at rest elsewhere (clear: never closer than 2.460 m, delta 2.000 m)"
    );
}

#[test]
fn headline_names_the_unmet_criterion() {
    let said = |summary| {
        let report = Case { summary, ..Case::good() }.report();
        let headline = report.headline();
        let why = headline.strip_prefix("NOT REACHED: ").and_then(|rest| rest.split_once(" (clear: "));
        (report.formation.fails, why.map(|(why, _)| why.to_owned()).unwrap_or_default())
    };
    let lost = Summary { reached_at_s: None, held_s: None, ..REACHED };
    let cases = [
        (REACHED, None, ""),
        (
            Summary { max_edge_error_m: 0.5, final_control_m_s2: 0.1, ..lost },
            Some(UnmetCriterion::MaxEdgeErrorM),
            "largest edge error 0.500 m, still moving",
        ),
        (
            Summary { max_position_error_m: 0.6, ..lost },
            Some(UnmetCriterion::MaxPositionErrorM),
            "another shape or place, largest position error 0.600 m, at rest elsewhere",
        ),
        (
            Summary { disagreement_m_s: 0.7, ..lost },
            Some(UnmetCriterion::Disagreement),
            "largest relative speed 0.700 m/s, still moving",
        ),
        (Summary { held_s: Some(0.4), ..lost }, Some(UnmetCriterion::HeldS), "kept for the last 0.40 s only"),
        (Summary { max_edge_error_m: f64::NAN, ..lost }, Some(UnmetCriterion::Unknown), "no state at the end is known"),
        (
            Summary { max_edge_error_m: 0.5, final_control_m_s2: f64::NAN, ..lost },
            Some(UnmetCriterion::MaxEdgeErrorM),
            "largest edge error 0.500 m",
        ),
    ];
    for (summary, fails, why) in cases {
        assert_eq!(said(summary), (fails, why.to_owned()));
    }
}

#[test]
fn headline_of_a_refused_flight_begins_with_the_refusal() {
    let case = Case { refused: &[Code::StartOnLine, Code::DriftUnresolved], ..Case::good() };
    assert_eq!(case.reason(), "The check refuses the flight: start-on-line, drift-unresolved.");
    assert_eq!(
        case.report().headline(),
        "REFUSED BY CHECK: start-on-line, drift-unresolved (clear: never closer than 2.460 m, delta 2.000 m, formation \
         reached at 36.50 s)"
    );
    assert!(!Case::good().report().headline().contains("refused"));
}

#[test]
fn reason_names_a_short_hold_or_a_residual_speed() {
    let short = Summary { reached_at_s: None, held_s: Some(0.4), ..REACHED };
    assert!(
        Case { summary: short, ..Case::good() }.reason().contains("kept for the last 0.40 s only; 1.00 s is required")
    );
    let moving = Summary { reached_at_s: None, held_s: None, disagreement_m_s: 0.5, ..REACHED };
    assert!(Case { summary: moving, ..Case::good() }.reason().contains("the reference, is 0.500 m/s (limit 0.02 m/s)"));
}

#[test]
fn flat_start_is_a_reason_only_if_the_formation_is_not_reached() {
    let case = Case { summary: NOT_REACHED, trap_dimension: Some(1), ..Case::good() };
    let reasons = case.report().verdict.reasons;
    assert_eq!(reasons.len(), 2);
    assert_eq!(reasons[1], Reason::StartTooFlat { start_dimension: 1, formation_dimension: 2 });
    let text = reasons[1].to_string();
    assert!(text.starts_with("The start lies on a line, but the formation needs a plane"), "{text}");
    assert!(Case { trap_dimension: Some(1), ..Case::good() }.report().verdict.pass);
}

#[test]
fn disagreement_of_detectors_does_not_pass() {
    let mut case = Case::good();
    case.audit.parry.disagreements = 3;
    case.audit.status = Status::Undecided;
    assert!(case.reason().starts_with("The two detectors of the audit disagree 3 times"));
    assert!(case.report().headline().starts_with("UNDECIDED: the two detectors disagree"));
}

#[test]
fn incomplete_audit_does_not_pass() {
    let mut case = Case::good();
    case.audit.status = Status::Undecided;
    assert!(case.reason().starts_with("The audit could not judge every pair and step"));
    assert!(case.report().headline().starts_with("UNDECIDED: not everything could be judged"));
}

#[test]
fn early_end_is_a_reason() {
    assert_eq!(
        Case { ending: Ending::Interrupted, ..Case::good() }.reason(),
        "The run ended early, at 120.00 s: interrupted."
    );
}

#[test]
fn void_certificate_gives_its_reasons() {
    let report = Case::good().report();
    assert_eq!((report.certificate.separation_m, report.certificate.void.len()), (Some(2.055_307), 0));
    assert!(report.text().contains("certified 2.055307 m"));
    let report = Case { certificate: Certificate::void(VoidReason::NoBarrier), ..Case::good() }.report();
    assert_eq!(report.certificate.separation_m, None);
    assert_eq!(report.certificate.void, [VoidReason::NoBarrier]);
    assert!(report.text().contains("not certified"));
}

#[test]
fn table_has_a_line_for_every_part() {
    let text = Case::good().report().text();
    let names: Vec<_> = text.lines().map(|line| line.split(' ').next().unwrap_or_default()).collect();
    let parts = ["separation", "audit", "formation", "energy", "control", "velocity", "run", "performance"];
    assert_eq!(names, parts);
    assert!(text.contains("2.460700 m at 0.50 s, vehicles 1 and 2 (delta 2.000 m"), "{text}");
    assert!(!text.contains("NaN"));
}

#[test]
fn report_file_contains_the_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("report.json");
    let report = Case::good().report();
    report.write(&path).expect("writes");
    let text = std::fs::read_to_string(&path).expect("reads");
    assert!(text.ends_with("}\n"));
    assert_eq!(text, report.to_json().expect("JSON"));
    assert!(report.write(&folder.path().join("missing/report.json")).is_err());
}

#[test]
fn every_leg_must_be_reached_and_the_first_miss_is_named() {
    let ended = |ended_at_s: f64, reached_at_s: Option<f64>| LegSummary { ended_at_s, reached_at_s };
    let report = |legs: usize, ended_legs: Vec<LegSummary>, summary: Summary| {
        let bound = |energy: f64, certified_m: f64| LegBound {
            energy,
            certified_m: Some(certified_m),
            certified_clearance_margin_m: None,
        };
        let certificate = Certificate { legs: vec![bound(3.0, 2.1), bound(4.0, 2.06)], ..Case::good().certificate };
        Case { summary, certificate, legs, ended_legs, ..Case::good() }.report()
    };
    assert!(report(1, Vec::new(), REACHED).legs.is_empty());
    let good = report(2, vec![ended(20.0, Some(12.0))], REACHED);
    assert!(good.verdict.pass && good.headline().contains("; 2 of 2 legs reached"), "{}", good.headline());
    let numbers = |leg: usize| {
        let LegNumbers { from_s, to_s, reached_at_s, certified_m, .. } = good.legs[leg];
        [from_s, to_s, reached_at_s, certified_m]
    };
    assert_eq!(numbers(0), [Some(0.0), Some(20.0), Some(12.0), Some(2.1)]);
    assert_eq!(numbers(1), [Some(20.0), Some(120.0), Some(36.5), Some(2.06)]);
    assert!(
        good.text().contains("leg 2        from 20.00 s, reached at 36.50 s, certified 2.060000 m\n"),
        "{}",
        good.text()
    );

    let hurried = report(2, vec![ended(20.0, None)], REACHED);
    assert!(!hurried.verdict.pass && hurried.headline().ends_with("; 1 of 2 legs reached"));
    assert!(hurried.headline().starts_with("NOT REACHED: leg 1 until 20.00 s (clear: "), "{}", hurried.headline());
    assert_eq!(hurried.verdict.reasons, [Reason::LegNotReached { leg: 1, until_s: Some(20.0) }]);
    assert_eq!(hurried.verdict.reasons[0].to_string(), "Leg 1 was not reached before leg 2 began at 20.00 s.");
    let stuck = report(3, vec![ended(20.0, Some(12.0))], NOT_REACHED);
    let last = stuck.verdict.reasons.last().map(ToString::to_string);
    assert_eq!(last.as_deref(), Some("Leg 3 never began: leg 2 was not reached."));
    assert_eq!((stuck.legs[2].from_s, stuck.legs[1].reached_at_s), (None, None));
}

#[test]
fn certificate_tolerance_is_relative_to_its_clearance() {
    let report = |certified_m: f64, closest_m: f64| {
        let certificate = Certificate {
            certified_m: Some(certified_m),
            certified_until_s: None,
            certified_clearance_margin_m: None,
            energy_initial: Some(3.656),
            linked_m: None,
            void: vec![],
            legs: vec![],
        };
        Case { audit: passing(closest_m), certificate, ..Case::good() }.report().verdict
    };
    // The clearance is 1.451 mm: first a tenth of it is missing, then only rounding.
    assert!(!report(2.001_451, 2.001_314).pass);
    assert!(report(2.001_451, 2.001_450_5).pass);
}

#[test]
fn energy_rise_is_a_reason_if_the_energy_is_proved_never_to_grow() {
    let risen = |share: f64, energy_falls: bool| {
        let energy_rise = Some(EnergyRise { from: 3.656_742_96, to: 3.656_742_96 * (1.0 + share) });
        let case = Case { energy_falls, energy_rise, ..Case::good() };
        case.report()
    };
    assert!(risen(0.9e-3, true).verdict.pass, "the error of integration");
    let report = risen(0.77, true);
    let reasons = &report.verdict.reasons;
    assert!(!report.verdict.pass && reasons[0].to_string().contains("rose from 3.6567e0 to 6.4724e0"), "{reasons:?}");
    assert!(report.headline().starts_with("ENERGY ROSE: to 1.770 of its start (clear: "), "{}", report.headline());
    assert!(risen(0.77, false).verdict.pass, "without a proof a rise is allowed");
}

/// Returns the audit of a vehicle that passes a ball of radius 1 m and clearance 0.5 m, at this distance from its
/// centre.
fn passing_a_ball(miss_m: f64) -> ClearanceOutcome {
    let ball = Obstacle {
        name: "tower".to_owned(),
        place_m: Vector3::zeros(),
        shape: Shape::Ball { radius_m: 1.0 },
        clearance_m: 0.5,
    };
    let mut auditor = ClearanceAuditor::new(2, &[ball]).expect("a judge");
    for (time_s, x) in [(0.0, -9.0), (1.0, 9.0)] {
        auditor.step(time_s, &Rows::from_row_slice(&[x, miss_m, 0.0, x, 50.0, 0.0])).expect("judged");
    }
    auditor.finish()
}

#[test]
fn violated_clearance_or_certificate_of_an_obstacle_does_not_pass() {
    let report = |miss_m: f64, certified_clearance_margin_m: Option<f64>| {
        let certificate = Certificate { certified_clearance_margin_m, ..Case::good().certificate };
        Case { clearance: Some(passing_a_ball(miss_m)), certificate, ..Case::good() }.report()
    };
    let clear = report(2.0, Some(0.4));
    assert!(clear.verdict.pass, "{:?}", clear.verdict);
    assert!(clear.headline().contains("0.500 m beyond every obstacle's clearance"), "{}", clear.headline());
    let broken = report(2.0, Some(0.6));
    assert!(!broken.verdict.pass && broken.verdict.has("obstacle-certificate-broken"));
    assert!(broken.verdict.reasons[0].to_string().contains("certifies 0.600 m beyond every clearance"));
    let said = "CERTIFICATE BROKEN: vehicle 1 came to 1.000 m from obstacle tower at 0.50 s (clearance 0.500 m), \
         certified 0.600 m beyond";
    assert!(broken.headline().starts_with(said), "{}", broken.headline());
    let violated = report(1.25, None);
    assert_eq!((violated.answer.status, violated.answer.violations.count), (Status::Violation, 1));
    let said = "VIOLATION: vehicle 1 came to 0.250 m from obstacle tower at 0.50 s (clearance 0.500 m)";
    assert_eq!(violated.headline(), said);
    assert!(report(0.25, None).headline().contains("0.750 m inside obstacle tower"));
}

#[test]
fn undecided_times_count_beside_a_violation() {
    let is_all_known = |change: fn(&mut AuditOutcome, &mut ClearanceOutcome)| {
        let (mut audit, mut clearance) = (passing(1.5), passing_a_ball(1.25));
        change(&mut audit, &mut clearance);
        let report = Case { audit, clearance: Some(clearance), ..Case::good() }.report();
        assert_eq!(report.answer.status, Status::Violation);
        report.judgement().is_else_known
    };
    assert!(is_all_known(|_, _| {}));
    assert!(!is_all_known(|audit, _| audit.unresolved = 1));
    assert!(!is_all_known(|audit, _| audit.refused = 1));
    assert!(!is_all_known(|_, clearance| clearance.unresolved = 1));
    assert!(!is_all_known(|_, clearance| clearance.refused = 1));
}

#[test]
fn ellipsoids_report_scaled_and_unscaled_distances() {
    let case = Case { in_metres: Some(passing(1.25)), ..Case::good() };
    let report = case.report();
    assert!(report.headline().starts_with("CLEAR: never closer than 2.460 m scaled to ellipsoids (delta 2.000 m)"));
    let ellipsoid = report.ellipsoid.as_ref().expect("an ellipsoid");
    assert_eq!((report.min_separation_m(), ellipsoid.min_distance_m), (Some(2.4607), Some(1.25)));
    assert!(report.text().contains(
        "ellipsoids   half axes 1.000, 1.000, 3.000 m; unscaled, centres never closer than 1.250000 m at 0.50 s, \
         vehicles 1 and 2\n"
    ));
    assert_eq!(Case::good().report().ellipsoid, None);
}

fn early() -> Case {
    Case { ending: Ending::LawUndefined(LawError::Failed), summary: NOT_REACHED, ..Case::good() }
}

#[test]
fn early_end_of_a_clear_flight_is_undecided() {
    let report = early().report();
    assert_eq!((report.answer.status, report.answer.undecided.count), (Status::Undecided, 0));
    assert!(!report.verdict.pass);
    assert_eq!(
        report.headline(),
        "UNDECIDED: the flight ended early at 120.00 s; until then never closer than 2.460 m (delta 2.000 m); not \
         reached: largest edge error 8.570 m"
    );
    assert!(report.judgement().is_else_known, "everything flown was judged");
    assert_eq!(report.formation.at_rest, None, "more time may help");
    // The same flight, flown to its end.
    let whole = Case { ending: Ending::Completed, ..early() }.report();
    assert_eq!(whole.formation.at_rest, Some(true));
    assert_eq!(whole.answer.status, Status::Clear);
    assert!(whole.headline().ends_with(" (clear: never closer than 2.460 m, delta 2.000 m)"), "{}", whole.headline());
}

#[test]
fn early_end_keeps_violations_and_other_undecided_times() {
    let violated = Case { audit: passing(1.5), ..early() }.report();
    assert_eq!(violated.answer.status, Status::Violation);
    let headline = violated.headline();
    assert!(
        headline.starts_with("VIOLATION: ") && headline.ends_with("; the flight ended early at 120.00 s"),
        "{headline}"
    );
    let mut doubtful = early();
    doubtful.audit.status = Status::Undecided;
    doubtful.audit.unresolved = 1;
    let doubtful = doubtful.report();
    assert!(doubtful.headline().starts_with("UNDECIDED: not everything could be judged"), "{}", doubtful.headline());
    assert!(!doubtful.judgement().is_else_known);
}

#[test]
fn formation_kept_up_to_an_early_end_is_not_reached() {
    let report = Case { summary: REACHED, ..early() }.report();
    let formation = &report.formation;
    assert_eq!((formation.reached, formation.reached_at_s), (false, None));
    assert_eq!(formation.fails, Some(UnmetCriterion::EndedEarly));
    let headline = report.headline();
    assert!(headline.starts_with("UNDECIDED: the flight ended early ") && !headline.contains("reached"), "{headline}");
    assert_eq!(report.verdict.reasons.len(), 1, "the early end: {:?}", report.verdict.reasons);
    let whole = Case { ending: Ending::Completed, summary: REACHED, ..early() }.report();
    assert_eq!((whole.formation.reached, whole.formation.fails), (true, None));
}

#[test]
fn report_without_wall_clock_times_has_no_performance() {
    let report = Report { performance: None, ..early().report() };
    let json = report.to_json().expect("JSON");
    assert!(!json.contains("performance") && !report.text().contains("wall"), "{json}");
    assert!(early().report().to_json().expect("JSON").contains("\"performance\""));
}

#[test]
fn collisions_of_hulls_are_counted_and_the_first_is_named() {
    let first = Bounce { pair: Pair::new(1, 2), time_s: 3.625, closing_m_s: 1.25 };
    let text = |collisions: usize| Reason::HullsHit { first, collisions }.to_string();
    assert!(text(1).starts_with("Hulls hit once: vehicles 2 and 3 at 3.62 s with 1.250 m/s. After"), "{}", text(1));
    assert!(text(2).starts_with("Hulls hit 2 times: first vehicles 2 and 3 at 3.62 s with"), "{}", text(2));
    let through = PassedThrough { pair: Pair::new(0, 1), min_at_s: 1.25, min_m: 0.7, touching_m: 0.75 };
    let text = |are_points: bool| Reason::PassedThrough { through, are_points }.to_string();
    let begin = "Vehicles 1 and 2 passed through each other: their hulls touch at 0.750 m";
    assert!(text(true).starts_with(begin) && text(false).contains("A step skipped the collision"), "{}", text(true));
}
