//! Tests of the energy bound under wind: attained by the worst wind, never exceeded.

use super::*;
use crate::wind::WindSpec;

fn gust(velocity_m_s: Vector3<f64>, vehicles: Option<Vec<usize>>) -> Gust {
    Gust { at_s: 1.0, rise_s: 2.0, hold_s: 1.0, fall_s: Some(2.0), velocity_m_s, vehicles }
}

fn exposure(wind: &WindSpec) -> WindExposure<'_> {
    WindExposure { wind, drag_per_s: 0.5, until_s: 10.0, resolution_m: 1e-9 }
}

fn bounded(wind: &WindSpec, frame: Frame, energy: f64) -> BoundedEnergy {
    EnergyBound::new(&exposure(wind), 4, frame, 0.8).of(energy, 0.0, f64::INFINITY)
}

#[test]
fn a_steady_wind_adds_energy_relative_to_the_ground_and_not_to_the_mean() {
    let wind = WindSpec { mean_m_s: Vector3::new(3.0, 0.0, 4.0), ..WindSpec::default() };
    let ground = bounded(&wind, Frame::Ground, 100.0);
    // |w|^2 = 4 (0.5 5)^2 = 25 over 10 s.
    assert!((ground.energy - (100.0 + 25.0 * 10.0 / 3.2)).abs() < 1e-12, "{ground:?}");
    assert_eq!(ground.until_s, Some(10.0));
    assert_eq!(bounded(&wind, Frame::Mean, 100.0), BoundedEnergy { energy: 100.0, until_s: None });
}

#[test]
fn a_short_gust_adds_to_the_root_of_the_energy() {
    let wind = WindSpec { gusts: vec![gust(Vector3::x(), Some(vec![2]))], ..WindSpec::default() };
    // From energy 0: sqrt E is at most the integral of |w|/sqrt 2 for one vehicle, 0.5 (1 + 1 + 1) s.
    let felt = 0.5 * 3.0 * std::f64::consts::FRAC_1_SQRT_2;
    let ground = bounded(&wind, Frame::Ground, 0.0);
    assert!(ground.energy <= felt * felt && ground.energy > 0.1 * felt * felt, "{ground:?}");
    assert_eq!(ground.until_s, None, "the gust ends before the run");
    // Relative to the mean of four vehicles, a push on one has 3/4 of its square.
    let (large, mean) = (bounded(&wind, Frame::Ground, 1e6), bounded(&wind, Frame::Mean, 1e6));
    assert!(((mean.energy - 1e6) / (large.energy - 1e6) - 0.75).abs() < 1e-3);
    // The integral of the square over a slope is 3/8 of its length, and the whole is divided by 4 zeta. Splitting a
    // slope into parts adds less than 0.3 %.
    let exact = 0.25 * (2.0 * 2.0 * 0.375 + 1.0) / 3.2;
    let ratio = (large.energy - 1e6) / exact;
    assert!((1.0..1.003).contains(&ratio), "{ratio}");
}

#[test]
fn gusts_on_different_vehicles_are_grouped() {
    let gusts = vec![gust(Vector3::x(), Some(vec![0])), gust(-Vector3::x(), Some(vec![1])), gust(Vector3::y(), None)];
    let wind = WindSpec { gusts, ..WindSpec::default() };
    let held = |frame: Frame| most_m_s2(&exposure(&wind), &vehicle_groups(&exposure(&wind), 4), frame, (3.0, 4.0));
    assert!((held(Frame::Mean) - 0.5 * 2.0_f64.sqrt()).abs() < 1e-15);
    assert!((held(Frame::Ground) - 0.5 * 6.0_f64.sqrt()).abs() < 1e-15);
}

#[test]
fn the_bound_ends_when_the_energy_may_exceed_its_limit() {
    let wind = WindSpec { mean_m_s: Vector3::new(3.0, 0.0, 4.0), ..WindSpec::default() };
    let energy_bound = EnergyBound::new(&exposure(&wind), 4, Frame::Ground, 0.8);
    let BoundedEnergy { energy, until_s } = energy_bound.of(100.0, 2.0, 139.062_5);
    assert_eq!((energy, until_s.map(|until_s| (until_s * 1e6).round())), (139.062_5, Some(7e6)));
    assert_eq!(energy_bound.of(100.0, 2.0, 90.0).until_s, Some(2.0), "at once");
    let undamped = EnergyBound::new(&exposure(&wind), 4, Frame::Ground, 0.0).of(4.0, 0.0, f64::INFINITY);
    assert!((undamped.energy - (2.0 + 50.0 * std::f64::consts::FRAC_1_SQRT_2).powi(2)).abs() < 1e-9);
}

/// One velocity under dE/dt = -zeta v^2 + v w. The push 2 zeta v attains the bound, others stay below it.
#[test]
fn the_bound_is_attained_by_the_worst_push_and_never_exceeded() {
    let (zeta, dt_s) = (0.8, 1e-4);
    let end = |push: &dyn Fn(f64, f64) -> f64| {
        let (mut v, mut allowed) = (1.0_f64, 0.5_f64);
        for step in 0..20_000 {
            let w = push(v, f64::from(step) * dt_s);
            allowed += dt_s * w * w / (4.0 * zeta);
            v += dt_s * (w - zeta * v);
        }
        0.5 * v * v / allowed
    };
    // E = v^2/2 grows by (w - zeta v) v; for w = 2 zeta v this is zeta v^2 = w^2/(4 zeta).
    assert!((end(&|v, _| 2.0 * zeta * v) - 1.0).abs() < 1e-3);
    for other in [&(|_, _| 1.0) as &dyn Fn(f64, f64) -> f64, &|v, _| zeta * v, &|_, t| (3.0 * t).sin(), &|v, _| 4.0 * v]
    {
        assert!(end(other) < 0.98, "{}", end(other));
    }
}
