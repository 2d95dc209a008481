//! Verdicts that depend on motion between steps and samples, or on biased sensors.

use tautline_audit::Status;
use tautline_report::report::Report;
use tautline_report::run::run;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{PlantSpec, Scenario, builtin};

use crate::flight::{builtin as flown, fly, read};

fn report(toml: &str) -> Report {
    run(&read(toml), &mut ()).expect("a report")
}

#[test]
fn a_separation_just_above_delta_is_shown_above_it() {
    // The smallest separation is 1.532715 m.
    let clear = run(&flown("pentagon-laplacian", &["law.delta_m=1.5327"]), &mut ()).expect("a report");
    let expected = "CLEAR: never closer than 1.5327 m (delta 1.5327 m), formation reached at 12.78 s";
    assert_eq!(clear.headline(), expected);
    assert!(clear.text().contains("separation   1.532715 m at 3.63 s, vehicles 4 and 5 (delta 1.5327 m"));
    let violated = run(&flown("pentagon-laplacian", &["law.delta_m=1.53272"]), &mut ()).expect("a report");
    let expected = "VIOLATION: vehicles 4 and 5 came to 1.532715 m (delta 1.53272 m) at 3.63 s";
    assert_eq!(violated.headline(), expected);
}

/// Standard gravity \[m/s^2\].
const GRAVITY_M_S2: f64 = 9.806_65;

#[test]
fn built_ins_stay_below_five_times_gravity() {
    for builtin in builtin::all() {
        let short: &[&str] = if builtin.name == "thousand" { &["time.duration_s=3"] } else { &[] };
        let report = run(&flown(builtin.name, short), &mut ()).expect("a report");
        let peak_m_s2 = report.control.peak_m_s2.expect("a peak");
        assert!(peak_m_s2 < 5.0 * GRAVITY_M_S2, "{}: {peak_m_s2} m/s^2", builtin.name);
        let expected = !["pentagon-laplacian", "pentagon-collinear"].contains(&builtin.name) && short.is_empty();
        assert!(!expected || report.verdict.pass, "{}: {}", builtin.name, report.headline());
    }
}

#[test]
fn the_hexagon_is_an_ordinary_flight() {
    let hexagon = flown("hexagon", &[]);
    assert_eq!(Preflight::of(&hexagon).expect("a law").warnings, []);
    let report = run(&hexagon, &mut ()).expect("a report");
    assert!(report.verdict.pass && report.formation.reached, "{}", report.headline());
    assert!(report.control.peak_m_s2.is_some_and(|peak_m_s2| peak_m_s2 < GRAVITY_M_S2), "{}", report.text());
}

/// Three vehicles on a star, far from the origin. Two of them approach at the end, to 0.995142 m in continuous time.
const SLOW_APPROACH: &str = r#"
start.positions_m = [[100, 100], [103, 100.75], [103, 99.25]]
start.velocities_m_s = [[0, 0], [0, -0.0838], [0, 0.0838]]
formation = { shape = "points", points_m = [[0, 0], [3, 0.501], [3, -0.501]] }
graph.kind = "star"
law = { kind = "edge-tension", delta_m = 1.0 }
time.duration_s = 20
"#;

#[test]
fn slow_approach_far_from_the_origin_is_a_violation_in_both_plants() {
    for plant in [PlantSpec::Rapier, PlantSpec::Ideal] {
        let (flight, _) = fly(&Scenario { plant, ..read(SLOW_APPROACH) });
        let closest = flight.audit.closest.expect("pairs");
        assert_eq!(flight.audit.status, Status::Violation, "{plant:?}: {closest:?}");
        assert!((closest.separation_m - 0.995_142).abs() < 1e-5, "{plant:?}: {closest:?}");
    }
}

/// Two vehicles swap positions in a swarm of 200 m extent and meet after 1,350 s.
#[test]
fn slow_meeting_beside_a_far_vehicle_is_a_violation() {
    if std::env::var_os("TAUTLINE_LONG").is_none() {
        return;
    }
    let report = report(
        r#"
        start.positions_m = [[0, 0], [3, 0.1], [200, 0]]
        formation = { shape = "points", points_m = [[3, 0.1], [0, 0], [200, 0]] }
        law = { kind = "laplacian", delta_m = 1.0, f1_per_s2 = 0.0004 }
        time.duration_s = 4000
        "#,
    );
    assert_eq!(report.answer.status, Status::Violation, "{}", report.headline());
}

/// Returns a scenario of three vehicles with slots 2 m apart and the gain `k_per_s2`.
fn three(k_per_s2: f64, duration_s: f64) -> String {
    format!(
        "start.positions_m = [[0, 0], [3, 0.2], [6, 0]]\nformation = {{ shape = \"line\", spacing_m = 2.0 }}\n\
         law = {{ kind = \"displacement\", delta_m = 1.0, k_per_s2 = {k_per_s2} }}\ntime.duration_s = {duration_s}\n"
    )
}

#[test]
fn slow_vehicles_are_still_moving() {
    let short = report(&three(0.002, 100.0));
    assert!(!short.formation.reached && short.formation.at_rest == Some(false), "{}", short.headline());
    assert!(report(&three(0.002, 4000.0)).formation.reached, "more time helps");
    let trapped = run(&crate::flight::builtin("pentagon-collinear", &[]), &mut ()).expect("a report");
    assert_eq!(trapped.formation.at_rest, Some(true), "{}", trapped.headline());
}

#[test]
fn slow_approach_is_not_a_stall() {
    let slow = report(&three(0.01, 900.0));
    assert!(
        slow.formation.reached && slow.deadlock_recoveries.is_empty(),
        "{}: {:?}",
        slow.headline(),
        slow.deadlock_recoveries
    );
    let off = report(&format!("deadlock.mode = \"off\"\n{}", three(0.01, 900.0)));
    assert_eq!(slow.formation.reached_at_s, off.formation.reached_at_s);
}

#[test]
fn formation_left_between_two_samples_is_not_reached_before() {
    let reached_at_s = |record_hz: f64, gust: &str| {
        let toml = three(1.0, 60.0);
        let wind = format!("vehicle.drag_per_s = 0.5\n{gust}\ntime.record_hz = {record_hz}\n");
        report(&format!("{toml}{wind}")).formation.reached_at_s
    };
    let gust = "wind.gust = [{ at_s = 50.0, rise_s = 1.0, hold_s = 0.5, velocity_m_s = [0.0, 2.0], vehicles = [2] }]";
    let calm_s = reached_at_s(0.2, "wind.mean_m_s = [0.0, 0.0, 0.0]").expect("reached");
    assert!(calm_s < 50.0);
    let [rare_s, often_s] = [0.2, 60.0].map(|record_hz| reached_at_s(record_hz, gust));
    assert_eq!(rare_s, often_s, "the recording rate does not change the arrival");
    assert!(rare_s.is_none_or(|at_s| at_s > 50.0), "{rare_s:?}");
}

#[test]
fn leg_reached_by_biased_sensors_only_is_not_reached() {
    let legs = |bias_m: f64| {
        let toml = three(1.0, 60.0);
        let beside = format!("arrival.edge_error_m = 0.05\nsensing.position_bias_m = {bias_m}\n[[leg]]\nscale = 1.5\n");
        report(&format!("{toml}{beside}"))
    };
    let exact = legs(0.0);
    assert!(exact.legs[0].reached_at_s.is_some(), "{:?}", exact.legs);
    let biased = legs(0.3);
    assert!(biased.legs.iter().all(|leg| leg.reached_at_s.is_none()), "{:?}", biased.legs);
    assert!(!biased.verdict.pass, "{}", biased.headline());
}
