use std::convert::Infallible;

use nalgebra::Vector3;

use super::*;
use crate::error::FARTHEST_M;
use tautline_audit::Violation;
use tautline_core::record::{Channel, Event, Sample};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, Swarm};
use tautline_core::track::{Clock, Item, Tracks};

fn sample(timeline: &mut Timeline, time_s: f64, x: f64, separation_m: f64) {
    let swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, x, 0.0, 0.0]));
    let separation = Some(ClosestApproach { pair: Pair::new(0, 1), separation_m, time_s: time_s - 0.5 });
    let control = Rows::zeros(2);
    timeline.take(&Sample { separation, ..Sample::new(time_s, 0, &swarm, &control) });
}

#[test]
fn between_two_instants_vehicles_are_on_a_straight_line() {
    let mut timeline = Timeline::new("pair", 2);
    sample(&mut timeline, 0.0, 4.0, 4.0);
    sample(&mut timeline, 1.0, 2.0, 2.0);
    let frame = timeline.at(0.25).expect("a frame");
    assert_eq!((frame.positions_m[(1, 0)], frame.nearest), (3.5, Some((Pair::new(0, 1), 3.5))));
    let beyond = timeline.at(9.0).expect("a frame");
    assert_eq!((beyond.time_s, beyond.positions_m[(1, 0)]), (1.0, 2.0));
}

/// A flight of one vehicle with these attitudes (w, x, y, z), a second apart; none where there is no number.
fn turning(attitudes: &[[f64; 4]]) -> Timeline {
    let mut timeline = Timeline::new("one", 1);
    for (k, attitude) in attitudes.iter().enumerate() {
        let channel = Channel { values: attitude.to_vec(), ..Channel::new("attitude", &["qw", "qx", "qy", "qz"]) };
        let (swarm, control, channels) = (Swarm::at_rest(Rows::zeros(1)), Rows::zeros(1), [channel]);
        timeline.take(&Sample { channels: &channels, ..Sample::new(k as f64, k as u64, &swarm, &control) });
    }
    timeline
}

fn heading_deg(timeline: &Timeline, time_s: f64) -> f64 {
    let attitude = timeline.at(time_s).and_then(|frame| frame.attitude(0)).expect("an attitude");
    attitude.angle().to_degrees()
}

#[test]
fn between_two_instants_vehicles_turn_evenly_and_the_shorter_way() {
    let quarter = [std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];
    let level = [1.0, 0.0, 0.0, 0.0];
    for sign in [1.0, -1.0] {
        let timeline = turning(&[level, quarter.map(|x| sign * x)]);
        for (time_s, degrees) in [(-1.0, 0.0), (0.0, 0.0), (1.0 / 3.0, 30.0), (0.5, 45.0), (1.0, 90.0), (9.0, 90.0)] {
            let found = heading_deg(&timeline, time_s);
            assert!((found - degrees).abs() < 1e-6, "{found} instead of {degrees} degrees at {time_s} s, {sign}");
        }
    }
}

#[test]
fn an_attitude_that_is_none_is_not_known_and_the_one_before_stays() {
    let level = [1.0, 0.0, 0.0, 0.0];
    for none in [[0.0; 4], [f64::NAN; 4]] {
        let timeline = turning(&[level, none, level]);
        assert_eq!(heading_deg(&timeline, 0.5), 0.0);
        assert!([1.0, 1.5].iter().all(|&time_s| timeline.at(time_s).expect("a frame").attitude(0).is_none()));
    }
    let mut other = turning(&[level]);
    let (swarm, control) = (Swarm::at_rest(Rows::zeros(1)), Rows::zeros(1));
    let channels = [Channel { values: level.to_vec(), ..Channel::new("attitude", &["qx", "qy", "qz", "qw"]) }];
    other.take(&Sample { channels: &channels, ..Sample::new(1.0, 1, &swarm, &control) });
    assert!(other.at(1.0).expect("a frame").attitude(0).is_none(), "columns in another order are something else");
}

#[test]
fn an_approach_counts_from_its_own_time_and_not_from_its_sample() {
    let mut timeline = Timeline::new("pair", 2);
    sample(&mut timeline, 0.0, 4.0, 4.0);
    sample(&mut timeline, 1.0, 4.0, 1.0);
    let so_far = |time_s| timeline.at(time_s).and_then(|frame| frame.so_far).map(|approach| approach.separation_m);
    assert_eq!([0.0, 0.4, 0.5, 1.0].map(so_far), [Some(4.0), Some(4.0), Some(1.0), Some(1.0)]);
}

#[test]
fn a_long_flight_is_thinned_and_keeps_its_ends_and_its_closest_approach() {
    let mut timeline = Timeline::new("pair", 2);
    timeline.budget_bytes = 20_000;
    for k in 0..10_000_u32 {
        let separation_m = if k == 7777 { 0.5 } else { 3.0 };
        sample(&mut timeline, f64::from(k), f64::from(k), separation_m);
    }
    assert!(
        timeline.keyframes().len() < 100 && timeline.every() >= 64,
        "{} of every {}",
        timeline.keyframes().len(),
        timeline.every()
    );
    assert_eq!(timeline.range_s(), [0.0, 9999.0]);
    assert_eq!(timeline.closest().map(|closest| closest.separation_m), Some(0.5));
    let separations = timeline.keyframes().iter().filter_map(|keyframe| Some(keyframe.closest?.separation_m));
    let smallest = separations.fold(f64::INFINITY, f64::min);
    assert_eq!(smallest, 0.5, "the curve of separations keeps its minimum");
    let times: Vec<f64> = timeline.keyframes().iter().map(|keyframe| keyframe.time_s).collect();
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
    // Straight motion is the same from fewer instants.
    assert_eq!(timeline.at(4321.0).map(|frame| frame.positions_m[(1, 0)]), Some(4321.0));
}

#[test]
fn the_moments_that_are_looked_at_are_never_thinned_out() {
    let mut timeline = Timeline::new("three", 3);
    (timeline.budget_bytes, timeline.delta_m) = (20_000, Some(1.0));
    let others = Pair::new(1, 2);
    for k in 0..10_000_u32 {
        let time_s = f64::from(k);
        // For a sample, 0 and 1 are nearly at one place; some time later 1 and 2 are near each other.
        let (first, third) = (if k == 7777 { 9.9 } else { 0.0 }, if (8100..8103).contains(&k) { 10.5 } else { 30.0 });
        let swarm = Swarm::at_rest(Rows::from_row_slice(&[first, 0.0, 0.0, 10.0, 0.0, 0.0, third, 0.0, 0.0]));
        if k == 8100 {
            timeline.note(&Event::ViolationBegan { pair: others, time_s: time_s - 0.1 });
        }
        if k == 8103 {
            timeline.note(&Event::ViolationEnded { pair: others, time_s: time_s - 0.1, min_m: 0.5 });
        }
        let (pair, separation_m) = if third < 30.0 { (others, 0.5) } else { (Pair::new(0, 1), 10.0 - first) };
        let separation = Some(ClosestApproach { pair, separation_m, time_s });
        let control = Rows::zeros(3);
        let (energy, channels) = (None, &[][..]);
        let peaks = tautline_core::record::Peaks::default();
        timeline.take(&Sample {
            time_s,
            step: 0,
            swarm: &swarm,
            control: &control,
            separation,
            energy,
            peaks,
            channels,
        });
    }
    assert!(timeline.keyframes().len() < 100 && timeline.every() >= 64, "{}", timeline.keyframes().len());
    let closest = timeline.at(7777.0).expect("a frame");
    assert_eq!((closest.positions_m[(0, 0)], closest.nearest.map(|(pair, _)| pair)), (9.9, Some(Pair::new(0, 1))));
    let violation = timeline.violations()[0];
    assert_eq!((violation.min_m, violation.min_at_s), (0.5, 8100.0));
    let worst = timeline.at(violation.min_at_s).expect("a frame");
    assert_eq!(worst.distance_m(others), 0.5, "as it is drawn");
    // Where nothing is looked at, samples are gone.
    assert!(timeline.keyframes().iter().all(|keyframe| keyframe.time_s != 7779.0));
}

#[test]
fn what_is_written_between_two_is_what_is_drawn() {
    let mut timeline = Timeline::new("pair", 2);
    sample(&mut timeline, 0.0, 4.0, 4.0);
    // The two met halfway between samples; nobody can draw that.
    sample(&mut timeline, 1.0, 4.0, 0.5);
    let frame = timeline.at(0.5).expect("a frame");
    assert_eq!(frame.nearest, Some((Pair::new(0, 1), 4.0)));
    assert_eq!(frame.so_far.map(|so_far| (so_far.separation_m, so_far.time_s)), Some((0.5, 0.5)));
}

#[test]
fn nothing_recorded_is_nothing_to_draw() {
    assert!(Timeline::new("pair", 2).at(0.0).is_none());
}

#[test]
fn no_distance_is_shown_below_the_closest_so_far() {
    let mut timeline = Timeline::new("pair", 2);
    sample(&mut timeline, 0.0, 4.0, 4.0);
    // Drawn straight, the two are 3 m apart at 0.5 s; they were flown along a curve and never nearer than 3.2 m.
    sample(&mut timeline, 1.0, 2.0, 2.0);
    let between = Some(ClosestApproach { pair: Pair::new(0, 1), separation_m: 3.2, time_s: 0.5 });
    timeline.keyframes[1].closest = between;
    for time_s in [0.3, 0.5, 0.7] {
        let frame = timeline.at(time_s).expect("a frame");
        let (_, distance_m) = frame.nearest.expect("a pair");
        let so_far_m = frame.so_far.expect("an approach").separation_m;
        assert!(so_far_m <= distance_m && distance_m >= 3.2, "{time_s} s: {so_far_m} m, {distance_m} m");
    }
    assert_eq!(timeline.at(0.5).expect("a frame").so_far, between);
}

/// Recorded motion: vehicle, time and place of every sample; names; a radius of all.
struct Seen(Vec<(usize, f64, f64, f64)>, Vec<String>, Option<f64>);

impl Tracks for Seen {
    type Error = Infallible;

    fn vehicles(&self) -> &[String] {
        &self.1
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, Infallible> {
        let position = |x, y| Vector3::new(x, y, 0.0);
        let radius_m = self.2;
        items.extend(self.0.drain(..).map(|(vehicle, time_s, x, y)| {
            let position_m = position(x, y);
            Item::Sample(tautline_core::track::Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m })
        }));
        Ok(false)
    }

    fn clock(&self) -> &Clock {
        const CLOCK: Clock = Clock { unit: "s", inferred: false, by_steps: false, epoch_ns: 0 };
        &CLOCK
    }

    fn notes(&self) -> &[String] {
        &[]
    }
}

fn seen(samples: &[(usize, f64, f64, f64)], delta_m: f64) -> Timeline {
    let mut tracks = Seen(samples.to_vec(), ["a", "b", "c", "d"].map(str::to_owned).to_vec(), None);
    Timeline::from_tracks("seen", &mut tracks, Some(delta_m)).expect("it can be drawn")
}

#[test]
fn radii_of_the_recording_are_judged_by_where_there_is_no_delta() {
    let samples = vec![(0, 0.0, 0.0, 0.0), (1, 0.0, 5.0, 0.0), (0, 1.0, 0.0, 0.0), (1, 1.0, 1.5, 0.0)];
    let drawn = |radius_m| {
        let mut tracks = Seen(samples.clone(), ["a", "b"].map(str::to_owned).to_vec(), radius_m);
        Timeline::from_tracks("seen", &mut tracks, None).expect("it can be drawn")
    };
    let [touching, apart, unknown] = [Some(1.0), Some(0.5), None].map(drawn);
    assert_eq!([&touching, &apart, &unknown].map(Timeline::unjudged), [None, None, Some("no delta")]);
    assert_eq!([&touching, &apart, &unknown].map(|drawn| drawn.violations().len()), [1, 0, 0]);
    assert_eq!((touching.violations()[0].limit_m, touching.assumes_straight), (2.0, true));
}

#[test]
fn what_single_precision_cannot_draw_is_refused_with_vehicle_value_and_time() {
    let near = seen(&[(0, 0.0, -FARTHEST_M, 0.0), (1, 0.0, FARTHEST_M, 0.0)], 1.0);
    assert_eq!(near.closest().map(|closest| closest.separation_m), Some(2.0 * FARTHEST_M));
    let samples = vec![(0, 0.0, 0.0, 0.0), (1, 0.0, 1.0, 0.0), (1, 0.5, 1.0, -1e300)];
    let mut tracks = Seen(samples, ["a", "b"].map(str::to_owned).to_vec(), None);
    let error = Timeline::from_tracks("far", &mut tracks, None).expect_err("too far");
    assert_eq!(
        error.to_string(),
        "vehicle b has a coordinate of -1e300 m at 0.5 s; what is beyond 1e9 m cannot be drawn"
    );
}

#[test]
fn two_that_meet_between_their_samples_have_met() {
    let timeline = seen(&[(0, 0.0, -2.0, 0.0), (1, 0.0, 2.0, 0.0), (0, 1.0, 2.0, 0.0), (1, 1.0, -2.0, 0.0)], 1.0);
    let pair = Pair::new(0, 1);
    assert_eq!(timeline.closest(), Some(ClosestApproach { pair, separation_m: 0.0, time_s: 0.5 }));
    let violation = Violation { pair, from_s: 0.375, to_s: 0.625, min_m: 0.0, min_at_s: 0.5, limit_m: 1.0 };
    assert_eq!(timeline.violations(), [violation]);
    assert_eq!(timeline.at(0.4).and_then(|frame| frame.so_far).map(|so_far| so_far.time_s), Some(0.4));
}

#[test]
fn the_closest_approach_of_vehicles_seen_at_times_of_their_own_is_drawn_as_it_was() {
    // Seen by turns, so that no time is common; they pass each other 0.5 m apart between two times that are drawn.
    let by_turns = |k: u32| {
        let (one, other) = (f64::from(k), f64::from(k) + 0.37);
        [(0, one, one - 20.3, 0.0), (1, other, 20.3 - other, 0.5)]
    };
    let samples: Vec<_> = (0..=40).flat_map(by_turns).collect();
    let timeline = seen(&samples, 1.0);
    let closest = timeline.closest().expect("an approach");
    assert!((closest.separation_m - 0.5).abs() < 1e-9 && (closest.time_s - 20.3).abs() < 1e-9, "{closest:?}");
    let frame = timeline.at(closest.time_s).expect("a frame");
    let drawn_m = tautline_core::swarm::separation(&frame.positions_m, 0, 1);
    assert!((drawn_m - 0.5).abs() < 1e-9, "{drawn_m} m");
    assert!(timeline.at(closest.time_s - 0.2).expect("a frame").so_far.is_some_and(|at| at.separation_m > 0.6));
}

#[test]
fn every_pair_that_is_too_close_is_kept_and_not_the_nearest_alone() {
    let still = [(0, 0.0, 0.0), (1, 0.5, 0.0), (2, 9.0, 0.0), (3, 9.8, 0.0)];
    let samples: Vec<_> =
        [0.0, 1.0, 2.0].iter().flat_map(|&time_s| still.map(|(vehicle, x, y)| (vehicle, time_s, x, y))).collect();
    let timeline = seen(&samples, 1.0);
    let whole = |violation: &Violation| (violation.pair, violation.from_s, violation.to_s);
    let found: Vec<_> = timeline.violations().iter().map(whole).collect();
    assert_eq!(found, [(Pair::new(0, 1), 0.0, 2.0), (Pair::new(2, 3), 0.0, 2.0)]);
    assert_eq!(seen(&samples, 0.5).violations(), [], "at delta is not below it");
}

#[test]
fn the_worst_of_a_violation_is_that_of_its_own_pair() {
    // 0 and 1 are nearest all the time; 2 and 3 come closest to each other at 2 s.
    let far = [9.0, 1.0, 0.5, 1.0, 9.0];
    let samples: Vec<_> = far
        .iter()
        .enumerate()
        .flat_map(|(k, &y)| {
            let time_s = k as f64;
            [(0, time_s, 0.0, 0.0), (1, time_s, 0.2, 0.0), (2, time_s, 20.0, 0.0), (3, time_s, 20.0, y)]
        })
        .collect();
    let timeline = seen(&samples, 2.0);
    let other = timeline.violations().iter().find(|span| span.pair == Pair::new(2, 3)).expect("a violation");
    assert_eq!(other.min_at_s, 2.0);
}

#[test]
fn pairs_that_the_flight_does_not_have_are_passed_over() {
    let mut timeline = Timeline::new("one", 1);
    let swarm = Swarm::at_rest(Rows::zeros(1));
    let (pair, time_s) = (Pair::new(3, 9), 0.0);
    let separation = Some(ClosestApproach { pair, separation_m: 1.0, time_s });
    timeline.take(&Sample { separation, ..Sample::new(time_s, 0, &swarm, &Rows::zeros(1)) });
    timeline.note(&Event::ViolationBegan { pair, time_s });
    assert_eq!((timeline.closest(), timeline.violations().len()), (None, 0));
    assert!(timeline.at(0.0).expect("a frame").nearest.is_none());
}
