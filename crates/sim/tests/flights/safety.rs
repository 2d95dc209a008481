//! Ellipsoids instead of balls: the empty space around a vehicle extends farther vertically than horizontally.

use tautline_audit::{Auditor, Status};
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::Formation;
use tautline_laws::space::{Metric, closest_pair};
use tautline_sim::scenario::{Override, Safety, Scenario, ScenarioError, Source};

use crate::flight::{Log, fly, read};

/// Returns two vehicles that swap sides, the second 0.5 m above the first.
fn above_each_other(safety: &str) -> Scenario {
    read(&format!(
        "[start]\npositions_m = [[-2.0, 0.1, 0.0], [2.0, 0.0, 0.5]]\n\
         [formation]\nshape = \"points\"\npoints_m = [[0.35, 0.0, 0.0], [-0.35, 0.0, 0.5]]\n\
         [swarm]\nhull_radius_m = 0.1\n[law]\nkind = \"displacement\"\n{safety}\n[time]\nduration_s = 12.0\n"
    ))
}

/// Returns the status of a flight audited with ellipsoids of a ratio of height to width.
fn judged(log: &Log, width_m: f64, ratio: f64) -> Status {
    let metric = Metric::of_ratio(ratio);
    let mut auditor = Auditor::new(2, width_m).expect("a judge");
    for (k, sample) in log.samples.iter().enumerate() {
        let scaled = metric.scaled_rows(&sample.swarm.positions_m);
        let judged = if k == 0 { auditor.start(0.0, &scaled) } else { auditor.step(sample.time_s, &scaled) };
        judged.expect("judged");
    }
    auditor.finish().status
}

#[test]
fn vehicles_that_pass_above_each_other_as_balls_go_around_as_ellipsoids() {
    let ellipsoid = "delta_m = 0.4\n[safety]\nshape = \"ellipsoid\"\nhalf_axes_m = [0.2, 0.2, 0.6]";
    let (balls, ellipsoids) = (fly(&above_each_other("delta_m = 0.4")), fly(&above_each_other(ellipsoid)));
    assert_eq!((balls.0.audit.status, ellipsoids.0.audit.status), (Status::Clear, Status::Clear));
    assert_eq!((judged(&balls.1, 0.4, 3.0), judged(&ellipsoids.1, 0.4, 3.0)), (Status::Violation, Status::Clear));

    let flight = &ellipsoids.0;
    let closest_m = flight.audit.closest.expect("a closest approach").separation_m;
    assert!(closest_m > flight.certificate.certified_m.expect("a promise"));
    let metres = flight.in_metres.as_ref().and_then(|audit| audit.closest).expect("in metres too").separation_m;
    assert!(metres >= closest_m && balls.0.in_metres.is_none());
    let last = &flight.last.positions_m;
    let apart = last.row(0) - last.row(1);
    assert!((apart[0] - 0.7).abs() < 0.05 && (apart[2] + 0.5).abs() < 0.05, "on the other side: {apart}");
}

/// A hundred flights from random starts to random slots over ellipsoids of many shapes: scaled separations keep the
/// certificate, and the energy never exceeds its initial value.
#[test]
fn a_hundred_random_flights_keep_the_scaled_certificate() {
    let mut unlike = 0;
    for flight in 0..100 {
        let random = |k: usize| ((flight * 7919 + k * 104_729 + 31) % 4099) as f64 / 4099.0;
        let ratio = [3.0, 2.0, 0.5, 5.0][flight % 4];
        // Points of a lattice in scaled lengths, 1.5 apart, each moved by less than 0.2.
        let cloud = |seed: usize| {
            let place = |i: usize, axis: usize| 1.5 * [i % 2, (i / 2) % 2, i / 4][axis] as f64;
            let off = |i: usize, axis: usize| 0.4 * (random(seed + 3 * i + axis) - 0.5);
            Rows::from_fn(6, |i, axis| (place(i, axis) + off(i, axis)) * if axis == 2 { ratio } else { 1.0 })
        };
        let mut slots = cloud(200);
        slots.swap_rows(0, 5);
        slots.swap_rows(1, 4);
        let start =
            Swarm { positions_m: cloud(0), velocities_m_s: Rows::from_fn(6, |i, k| random(400 + 3 * i + k) - 0.5) };
        let mut scenario = Scenario {
            safety: Safety::Ellipsoid { half_axes_m: [0.5, 0.5, 0.5 * ratio] },
            ..five_seconds(start, slots)
        };
        scenario.hull_radius_m.fill(0.1);
        scenario.validate().expect("a valid scenario");
        let (flight, log) = fly(&scenario);
        let certified_m = flight.certificate.certified_m.expect("a promise");
        let closest_m = flight.audit.closest.expect("a closest approach").separation_m;
        assert!(closest_m - 1.0 > (certified_m - 1.0) * 0.999, "{closest_m} {certified_m}");
        let rise = flight.energy_rise.expect("an energy");
        assert!(rise.to <= 1.001 * rise.from, "{rise:?}");
        let in_metres =
            |sample: &tautline_core::record::OwnedSample| closest_pair(&sample.swarm.positions_m).map(|(_, m)| m);
        let nearest_m = log.samples.iter().filter_map(in_metres).fold(f64::INFINITY, f64::min);
        unlike += u32::from((nearest_m - closest_m).abs() > 0.1);
    }
    assert!(unlike > 20, "scaled and metric separations differ in only {unlike} flights");
}

fn five_seconds(start: Swarm, slots: Rows) -> Scenario {
    let mut scenario = Scenario::new("ellipsoids", start, Formation::points(slots), 1.0, 5.0);
    scenario.law = tautline_laws::law::LawSpec::Displacement(tautline_laws::law::DisplacementKeys::default());
    scenario.plant = tautline_sim::scenario::PlantSpec::Rapier;
    scenario.time.dt_s = 1.0 / 60.0;
    scenario
}

#[test]
fn an_ellipsoid_is_written_back_and_its_width_is_delta() {
    let scenario = above_each_other("[safety]\nshape = \"ellipsoid\"\nhalf_axes_m = [0.125, 0.125, 0.375]");
    assert_eq!((scenario.delta_m, scenario.metric().ratio()), (0.25, 3.0));
    assert_eq!(scenario.half_axes_m(), Some([0.125, 0.125, 0.375]));
    assert_eq!(read(&scenario.resolved().toml), scenario);
    let ball = above_each_other("delta_m = 0.4");
    assert!(ball.metric().is_metres() && !ball.resolved().toml.contains("[safety]"));
}

#[test]
fn wrong_ellipsoids_are_refused_with_a_remedy() {
    let wrong = |sets: &[&str]| -> ScenarioError {
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
        let refused: Result<Scenario, ScenarioError> =
            Scenario::read(&Source::Builtin("obstacles".to_owned()), &overrides);
        let error = refused.expect_err(sets[0]);
        assert!(!error.help.is_empty(), "{error}");
        error
    };
    let axes = "safety.half_axes_m=[0.5, 0.5, 1.0]";
    for (sets, code) in [
        (&["safety.shape=egg"][..], "scenario/unknown-choice"),
        (&["safety.shape=ellipsoid"], "scenario/missing-key"),
        (&[axes], "scenario/unknown-key"),
        (&["safety.shape=ellipsoid", "safety.half_axes_m=[0.5, 0.4, 1.0]"], "scenario/inconsistent"),
        (&["safety.shape=ellipsoid", "safety.half_axes_m=[0.5, 0.5, -1.0]"], "scenario/out-of-range"),
        (&["safety.shape=ellipsoid", "safety.half_axes_m=[0.6, 0.6, 1.0]"], "scenario/inconsistent"),
        (&["safety.shape=ellipsoid", axes, "law.kind=orca"], "scenario/unsupported-by-law"),
    ] {
        let error = wrong(sets);
        assert_eq!(error.code(), code, "{error}");
    }
    let mut above = above_each_other("[safety]\nshape = \"ellipsoid\"\nhalf_axes_m = [0.2, 0.2, 0.6]");
    above.start.positions_m = Rows::from_row_slice(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.9]);
    let refused = above.validate().expect_err("0.3 m apart in scaled lengths");
    assert_eq!(refused.code(), "scenario/within-delta", "{refused}");
    above.start.positions_m[(1, 2)] = 1.3;
    above.validate().expect("0.43 m apart in scaled lengths");
    above.hull_radius_m.fill(0.195);
    assert!(above.validate().is_err(), "hulls must fit between ellipsoids side by side");
}
