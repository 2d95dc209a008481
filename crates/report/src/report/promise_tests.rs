//! Tests of what was promised before the first step, for one leg and several.

use super::tests::{Case, NOT_REACHED, REACHED, passing};
use super::*;
use tautline_audit::{ClearanceAuditor, ClearanceOutcome, Obstacle, Shape};
use tautline_core::record::EnergyRise;
use tautline_core::swarm::Rows;
use tautline_laws::law::Certificate;
use tautline_sim::metrics::{LegSummary, Summary};

#[test]
fn every_leg_is_to_be_reached_and_the_first_that_is_not_is_named() {
    let ended = |ended_at_s: f64, reached_at_s: Option<f64>| LegSummary { ended_at_s, reached_at_s };
    let report = |legs: usize, ended_legs: Vec<LegSummary>, summary: Summary| {
        let bound = |energy: f64, certified_m: f64| tautline_laws::law::LegBound {
            energy,
            certified_m: Some(certified_m),
            certified_room_m: None,
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
    assert!(!hurried.verdict.pass && hurried.headline().contains("1 of 2 legs reached"));
    assert_eq!(hurried.verdict.reasons, ["Leg 1 was not reached before leg 2 began at 20.00 s."]);
    let stuck = report(3, vec![ended(20.0, Some(12.0))], NOT_REACHED);
    assert_eq!(stuck.verdict.reasons.last().map(String::as_str), Some("Leg 3 never began: leg 2 was not reached."));
    assert_eq!((stuck.legs[2].from_s, stuck.legs[1].reached_at_s), (None, None));
}

#[test]
fn a_certificate_is_broken_by_a_share_of_its_clearance() {
    let report = |certified_m: f64, closest_m: f64| {
        let certificate = Certificate {
            certified_m: Some(certified_m),
            certified_until_s: None,
            certified_room_m: None,
            energy_initial: Some(3.656),
            linked_m: None,
            void: vec![],
            legs: vec![],
        };
        Case { audit: passing(closest_m), certificate, ..Case::good() }.report().verdict
    };
    // A clearance of 1.451 mm of which a tenth is missing, and one of which nothing is but rounding.
    assert!(!report(2.001_451, 2.001_314).pass);
    assert!(report(2.001_451, 2.001_450_5).pass);
}

#[test]
fn energy_above_its_start_is_a_reason_where_the_proof_says_that_it_never_grows() {
    let risen = |share: f64, energy_falls: bool| {
        let energy_rise = Some(EnergyRise { from: 3.656_742_96, to: 3.656_742_96 * (1.0 + share) });
        let case = Case { energy_falls, energy_rise, ..Case::good() };
        case.report().verdict
    };
    assert!(risen(0.9e-3, true).pass, "the error of integration");
    let verdict = risen(0.77, true);
    assert!(!verdict.pass && verdict.reasons[0].contains("rose from 3.6567e0 to 6.4724e0"), "{verdict:?}");
    assert!(risen(0.77, false).pass, "nothing is proved there");
}

/// A vehicle passes a ball of 1 m, whose clearance is 0.5 m, at this distance from its middle.
fn passing_a_ball(miss_m: f64) -> ClearanceOutcome {
    let ball = Obstacle {
        name: "tower".to_owned(),
        shape: Shape::Ball { radius_m: 1.0 },
        clearance_m: Some(0.5),
        path: vec![(0.0, nalgebra::Vector3::zeros())],
    };
    let mut auditor = ClearanceAuditor::new(2, &[ball]).expect("a judge");
    for (time_s, x) in [(0.0, -9.0), (1.0, 9.0)] {
        auditor.step(time_s, &Rows::from_row_slice(&[x, miss_m, 0.0, x, 50.0, 0.0])).expect("judged");
    }
    auditor.finish()
}

#[test]
fn who_is_too_near_to_an_obstacle_or_nearer_than_certified_does_not_pass() {
    let report = |miss_m: f64, certified_room_m: Option<f64>| {
        let certificate = Certificate { certified_room_m, ..Case::good().certificate };
        Case { clearance: Some(passing_a_ball(miss_m)), certificate, ..Case::good() }.report()
    };
    let clear = report(2.0, Some(0.4));
    assert!(clear.verdict.pass, "{:?}", clear.verdict);
    assert!(clear.headline().contains("0.500 m beyond every obstacle's clearance"), "{}", clear.headline());
    let broken = report(2.0, Some(0.6));
    assert!(!broken.verdict.pass && broken.verdict.reasons[0].contains("certifies 0.600 m beyond every clearance"));
    let violated = report(1.25, None);
    assert_eq!((violated.audit.status, violated.audit.violations.len()), (Status::Violation, 0));
    assert_eq!(violated.headline(), "VIOLATION: vehicle 1 came to 0.250 m from `tower` at 0.50 s (clearance 0.500 m)");
    assert!(report(0.25, None).headline().contains("0.750 m inside `tower`"));
}

#[test]
fn beside_a_violation_it_counts_what_could_not_be_told() {
    let is_all_known = |change: fn(&mut tautline_audit::AuditOutcome, &mut ClearanceOutcome)| {
        let (mut audit, mut clearance) = (passing(1.5), passing_a_ball(1.25));
        change(&mut audit, &mut clearance);
        let report = Case { audit, clearance: Some(clearance), ..Case::good() }.report();
        assert_eq!(report.audit.status, Status::Violation);
        report.judgement().is_else_known
    };
    assert!(is_all_known(|_, _| {}));
    assert!(!is_all_known(|audit, _| audit.unresolved = 1));
    assert!(!is_all_known(|audit, _| audit.refused = 1));
    assert!(!is_all_known(|_, clearance| clearance.unresolved = 1));
    assert!(!is_all_known(|_, clearance| clearance.refused = 1));
}

#[test]
fn around_ellipsoids_both_lengths_are_told_and_the_scaled_one_is_judged() {
    let case = Case { in_metres: Some(([1.0, 1.0, 3.0], passing(1.25))), ..Case::good() };
    let report = case.report();
    assert!(report.headline().starts_with("CLEAR: never closer than 2.460 m scaled to ellipsoids (delta 2.000 m)"));
    let ellipsoid = report.separation.ellipsoid.as_ref().expect("an ellipsoid");
    assert_eq!((report.separation.min_m, ellipsoid.min_distance_m), (Some(2.4607), Some(1.25)));
    assert!(report.text().contains(
        "ellipsoids   half axes 1.000, 1.000, 3.000 m; unscaled, centres never closer than 1.250000 m at 0.50 s, vehicles 1-2\n"
    ));
    let read: Report = serde_json::from_str(&report.to_json().expect("JSON")).expect("a report");
    assert_eq!(read, report);
    assert_eq!(Case::good().report().separation.ellipsoid, None);
}
