//! Tests of bounded memory, exact extremes and interpolation.

use super::*;
use tautline_core::record::{Channel, Peaks};
use tautline_core::swarm::{Pair, Swarm};

fn approach(separation_m: f64, time_s: f64) -> ClosestApproach {
    ClosestApproach { pair: Pair::new(0, 1), separation_m, time_s }
}

/// Takes two vehicles on the x axis, with an approach half a second before the sample.
fn sample(log: &mut FlightLog, time_s: f64, x: f64, separation_m: f64) {
    let swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, x, 0.0, 0.0]));
    let separation = Some(approach(separation_m, time_s - 0.5));
    log.take(&Sample { separation, ..Sample::new(time_s, 0, &swarm, &Rows::zeros(2)) });
}

/// Two vehicles on the x axis, sampled every 0.01 s in little memory; sample `k` has distance, energy and effort of
/// `f(k)`.
fn log(samples: u64, f: impl Fn(u64) -> f64) -> FlightLog {
    let mut log = FlightLog::default().within(100_000);
    for k in 0..samples {
        let (value, time_s) = (f(k), k as f64 * 0.01);
        let swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, value, 0.0, 0.0]));
        let control = Rows::from_row_slice(&[value, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let (separation, energy) = (Some(approach(value, time_s)), Some(value));
        log.take(&Sample { separation, energy, ..Sample::new(time_s, k, &swarm, &control) });
    }
    log
}

#[test]
fn long_flights_keep_bounded_keyframes_and_both_ends() {
    for samples in [1, 2, 200, 2049, 100_000] {
        let log = log(samples, |_| 3.0);
        let keyframes = log.keyframes();
        assert!(keyframes.len() * keyframes[0].bytes() <= 100_000, "{} of {samples} samples", keyframes.len());
        assert_eq!(log.range_s(), [0.0, (samples - 1) as f64 * 0.01]);
        assert!(keyframes.is_sorted_by(|a, b| a.time_s < b.time_s));
    }
}

#[test]
fn extremes_survive_thinning() {
    let samples = 20_000;
    for at in [1, 777, 12_345, samples - 1] {
        let low = log(samples, |k| if k == at { 0.5 } else { 3.0 });
        let smallest = low.keyframes().iter().map(|keyframe| keyframe.extremes.pair_min_m[0]);
        assert_eq!(smallest.fold(f64::INFINITY, f64::min), 0.5);
        assert_eq!(low.closest(), Some(approach(0.5, at as f64 * 0.01)));
        let high = log(samples, |k| if k == at { 9.0 } else { 3.0 });
        let extremes = || high.keyframes().iter().map(|keyframe| &keyframe.extremes);
        assert_eq!(extremes().map(|of| of.control_m_s2[0]).fold(0.0, f64::max), 9.0);
        assert_eq!(extremes().filter_map(|of| of.energy).fold(0.0, f64::max), 9.0);
        assert_eq!(high.peak_control(), Some([9.0, at as f64 * 0.01]));
    }
}

#[test]
fn peaks_between_samples_count() {
    let mut log = FlightLog::default();
    let (swarm, control) = (Swarm::at_rest(Rows::zeros(1)), Rows::from_element(1, 1.0));
    for (k, peak) in [1.0, 7.5, 3.0].into_iter().enumerate() {
        let peaks = Peaks { control_m_s2: Some(peak), energy: Some(peak) };
        log.take(&Sample { peaks, energy: Some(1.0), ..Sample::new(k as f64, 0, &swarm, &control) });
    }
    assert_eq!(log.peak_control(), Some([7.5, 1.0]));
    assert_eq!(log.keyframes()[1].extremes.energy, Some(7.5));
}

#[test]
fn empty_log_has_no_findings() {
    let log = FlightLog::default();
    assert_eq!((log.count(), log.samples(), log.range_s()), (0, 0, [0.0; 2]));
    assert!(log.keyframes().is_empty() && log.at(0.0).is_none() && log.closest().is_none());
}

#[test]
fn ignores_samples_of_another_swarm_and_non_finite_distances() {
    let mut log = log(3, |k| if k == 1 { f64::NAN } else { 3.0 });
    log.take(&Sample::new(9.0, 9, &Swarm::at_rest(Rows::zeros(5)), &Rows::zeros(0)));
    assert_eq!((log.samples(), log.range_s()), (3, [0.0, 0.02]));
    assert_eq!(log.closest().map(|closest| closest.separation_m), Some(3.0));
}

#[test]
fn interpolates_positions_linearly() {
    let mut log = FlightLog::default();
    sample(&mut log, 0.0, 4.0, 4.0);
    sample(&mut log, 1.0, 2.0, 2.0);
    let frame = log.at(0.25).expect("a frame");
    assert_eq!((frame.positions_m[(1, 0)], frame.nearest), (3.5, Some((Pair::new(0, 1), 3.5))));
    let beyond = log.at(9.0).expect("a frame");
    assert_eq!((beyond.time_s, beyond.positions_m[(1, 0)]), (1.0, 2.0));
}

/// The sides of a square are equal up to rounding. The first pair in the order of vehicles is the closest.
#[test]
fn the_first_of_several_closest_pairs_is_the_closest() {
    let mut log = FlightLog::default();
    let square = Rows::from_row_slice(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0 - 1e-15, 0.0, 0.0, 1.0, 0.0]);
    let separation = Some(ClosestApproach { pair: Pair::new(1, 2), separation_m: 1.0 - 1e-15, time_s: 0.0 });
    for time_s in [0.0, 1.0] {
        let swarm = Swarm::at_rest(square.clone());
        log.take(&Sample { separation, ..Sample::new(time_s, 0, &swarm, &Rows::zeros(0)) });
    }
    let pair = |time_s| {
        let frame = log.at(time_s).expect("a frame");
        [frame.nearest.map(|nearest| nearest.0), frame.so_far.map(|closest| closest.pair)]
    };
    assert_eq!([0.0, 0.5].map(pair), [[Some(Pair::new(0, 1)); 2]; 2]);
}

/// A flight of one vehicle with these attitudes (w, x, y, z), a second apart.
fn turning(attitudes: &[[f64; 4]]) -> FlightLog {
    let mut log = FlightLog::default();
    for (k, attitude) in attitudes.iter().enumerate() {
        let channel = Channel { values: attitude.to_vec(), ..Channel::new("attitude", &["qw", "qx", "qy", "qz"]) };
        let (swarm, control, channels) = (Swarm::at_rest(Rows::zeros(1)), Rows::zeros(1), [channel]);
        log.take(&Sample { channels: &channels, ..Sample::new(k as f64, k as u64, &swarm, &control) });
    }
    log
}

fn heading_deg(log: &FlightLog, time_s: f64) -> f64 {
    log.at(time_s).and_then(|frame| frame.attitude(0)).expect("an attitude").angle().to_degrees()
}

#[test]
fn interpolates_attitudes_evenly_on_the_shorter_rotation() {
    let quarter = [std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];
    for sign in [1.0, -1.0] {
        let log = turning(&[[1.0, 0.0, 0.0, 0.0], quarter.map(|x| sign * x)]);
        for (time_s, degrees) in [(-1.0, 0.0), (0.0, 0.0), (1.0 / 3.0, 30.0), (0.5, 45.0), (1.0, 90.0), (9.0, 90.0)] {
            let found = heading_deg(&log, time_s);
            assert!((found - degrees).abs() < 1e-6, "{found} instead of {degrees} degrees at {time_s} s, {sign}");
        }
    }
}

#[test]
fn invalid_attitudes_are_unknown_and_keep_the_previous_one() {
    let level = [1.0, 0.0, 0.0, 0.0];
    for none in [[0.0; 4], [f64::NAN; 4]] {
        let log = turning(&[level, none, level]);
        assert_eq!(heading_deg(&log, 0.5), 0.0);
        assert!([1.0, 1.5].iter().all(|&time_s| log.at(time_s).expect("a frame").attitude(0).is_none()));
    }
    let mut other = turning(&[level]);
    let (swarm, control) = (Swarm::at_rest(Rows::zeros(1)), Rows::zeros(1));
    let channels = [Channel { values: level.to_vec(), ..Channel::new("attitude", &["qx", "qy", "qz", "qw"]) }];
    other.take(&Sample { channels: &channels, ..Sample::new(1.0, 1, &swarm, &control) });
    assert!(other.at(1.0).expect("a frame").attitude(0).is_none(), "columns in another order are ignored");
}

#[test]
fn approaches_count_from_their_own_time() {
    let mut log = FlightLog::default();
    sample(&mut log, 0.0, 4.0, 4.0);
    sample(&mut log, 1.0, 4.0, 1.0);
    let so_far = |time_s| log.at(time_s).and_then(|frame| frame.so_far).map(|approach| approach.separation_m);
    assert_eq!([0.0, 0.4, 0.5, 1.0].map(so_far), [Some(4.0), Some(4.0), Some(1.0), Some(1.0)]);
}

#[test]
fn distance_at_the_closest_approach_is_that_of_the_audit() {
    let mut log = FlightLog::default();
    sample(&mut log, 0.0, 4.0, 4.0);
    // The audit measured 0.5 m halfway between two samples with a distance of 4 m.
    sample(&mut log, 1.0, 4.0, 0.5);
    let frame = log.at(0.5).expect("a frame");
    assert_eq!((frame.nearest, frame.so_far), (Some((Pair::new(0, 1), 0.5)), Some(approach(0.5, 0.5))));
}

#[test]
fn no_distance_is_below_the_closest_so_far() {
    let mut log = FlightLog::default();
    sample(&mut log, 0.0, 4.0, 4.0);
    // On straight lines the two are 3 m apart at 0.5 s; they flew a curve and were never nearer than 3.2 m.
    sample(&mut log, 1.0, 2.0, 3.2);
    for time_s in [0.3, 0.5, 0.7] {
        let frame = log.at(time_s).expect("a frame");
        let (_, distance_m) = frame.nearest.expect("a pair");
        let so_far_m = frame.so_far.expect("an approach").separation_m;
        assert!(so_far_m <= distance_m && distance_m >= 3.2, "{time_s} s: {so_far_m} m, {distance_m} m");
    }
}

#[test]
fn keeps_the_worst_moment_of_a_violation() {
    let mut log = FlightLog::new(Metric::default(), 1.0).within(40_000);
    let others = Pair::new(1, 2);
    for k in 0..10_000_u32 {
        let time_s = f64::from(k);
        // Vehicles 0 and 1 nearly coincide for one sample; later vehicles 1 and 2 come close.
        let (first, third) = (if k == 7777 { 9.9 } else { 0.0 }, if (8100..8103).contains(&k) { 10.5 } else { 30.0 });
        let swarm = Swarm::at_rest(Rows::from_row_slice(&[first, 0.0, 0.0, 10.0, 0.0, 0.0, third, 0.0, 0.0]));
        if k == 8100 {
            log.note(&Event::ViolationBegan { pair: others, time_s: time_s - 0.1 });
        }
        if k == 8103 {
            log.note(&Event::ViolationEnded { pair: others, time_s: time_s - 0.1, min_m: 0.5 });
        }
        let (pair, separation_m) = if third < 30.0 { (others, 0.5) } else { (Pair::new(0, 1), 10.0 - first) };
        let separation = Some(ClosestApproach { pair, separation_m, time_s });
        log.take(&Sample { separation, ..Sample::new(time_s, 0, &swarm, &Rows::zeros(3)) });
    }
    assert!(log.keyframes().len() < 100 && log.every() >= 64, "{}", log.keyframes().len());
    let closest = log.at(7777.0).expect("a frame");
    assert_eq!((closest.positions_m[(0, 0)], closest.nearest.map(|(pair, _)| pair)), (9.9, Some(Pair::new(0, 1))));
    let violation = log.violations().of_vehicles().next().expect("a violation");
    assert_eq!((violation.min_m, violation.min_at_s), (0.5, 8100.0));
    assert_eq!(log.at(violation.min_at_s).expect("a frame").distance_m(others), 0.5);
    // Samples without a finding are dropped.
    assert!(log.keyframes().iter().all(|keyframe| keyframe.time_s != 7779.0));
    assert_eq!(log.at(4321.0).map(|frame| frame.positions_m[(1, 0)]), Some(10.0));
}

#[test]
fn keeps_samples_of_violations_and_thins_the_rest_evenly() {
    let mut log = FlightLog::default().within(200_000);
    let pair = Pair::new(0, 1);
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]));
    for k in 0..50_000_u32 {
        let time_s = f64::from(k) / 100.0;
        match k {
            20_000 => log.note(&Event::ViolationBegan { pair, time_s }),
            20_050 => log.note(&Event::ViolationEnded { pair, time_s, min_m: 0.5 }),
            _ => {}
        }
        swarm.positions_m[(0, 1)] = time_s;
        log.take(&Sample::new(time_s, k.into(), &swarm, &Rows::zeros(0)));
    }
    let times_s: Vec<_> = log.keyframes().iter().map(|keyframe| keyframe.time_s).collect();
    let widest_s = times_s.windows(2).map(|two| two[1] - two[0]).fold(0.0, f64::max);
    assert!(log.samples() == 50_000 && times_s.len() > 300 && widest_s < 2.0, "{} and {widest_s} s", times_s.len());
    assert!((20_000..20_050_u32).all(|k| times_s.contains(&(f64::from(k) / 100.0))));
}

#[test]
fn ignores_violations_of_unknown_vehicles() {
    let mut log = FlightLog::default();
    let (pair, time_s) = (Pair::new(3, 9), 0.0);
    log.note(&Event::ViolationBegan { pair, time_s });
    let separation = Some(ClosestApproach { pair, separation_m: 1.0, time_s });
    log.take(&Sample { separation, ..Sample::new(time_s, 0, &Swarm::at_rest(Rows::zeros(1)), &Rows::zeros(1)) });
    log.note(&Event::ViolationBegan { pair, time_s });
    log.note(&Event::ObstacleViolationBegan { vehicle: 1, obstacle: 0, time_s });
    assert_eq!((log.closest(), log.violations().all().len()), (None, 0));
    assert!(log.at(0.0).expect("a frame").nearest.is_none());
}

#[test]
fn endless_violation_keeps_memory_bounded() {
    let mut log = FlightLog::new(Metric::default(), 1.0).within(100_000);
    log.note(&Event::ViolationBegan { pair: Pair::new(0, 1), time_s: 0.0 });
    (0..10_000_u32).for_each(|k| sample(&mut log, f64::from(k), 0.5, 0.5));
    let keyframes = log.keyframes();
    assert!(keyframes.len() * keyframes[0].bytes() <= 100_000 && log.range_s() == [0.0, 9999.0], "{}", keyframes.len());
}

#[test]
fn conclusion_replaces_the_closest_approach_within_rounding() {
    let mut log = log(100, |k| if k == 50 { 1.5 } else { 3.0 });
    let less_m = 1.5_f64.next_down();
    log.conclude(less_m, 0.25);
    log.conclude(1.4, 0.5);
    log.conclude(f64::NAN, 0.5);
    assert_eq!(log.closest(), Some(approach(1.5, 0.5)), "another time, another distance, no number");
    log.conclude(less_m, 0.5);
    assert_eq!(log.closest(), Some(approach(less_m, 0.5)));
    let frame = log.at(0.5).expect("a frame");
    assert_eq!(frame.distance_m(Pair::new(0, 1)), less_m);
}
