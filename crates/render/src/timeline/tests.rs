use std::convert::Infallible;

use nalgebra::Vector3;

use super::*;
use crate::error::FARTHEST_M;
use tautline_audit::Violation;
use tautline_core::swarm::{ClosestApproach, Pair};
use tautline_core::track::{Item, Metadata, Plan, Tracks};

/// Recorded motion: vehicle, time, x and y of every sample; names; one radius for all; metadata.
struct Seen(Vec<(usize, f64, f64, f64)>, Vec<String>, Option<f64>, Metadata);

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

    fn metadata(&self) -> &Metadata {
        &self.3
    }

    fn plans(&self) -> &[Plan] {
        &[]
    }
}

fn violations(timeline: &Timeline) -> Vec<Violation> {
    timeline.log.violations().of_vehicles().collect()
}

fn recorded_timeline(samples: &[(usize, f64, f64, f64)], delta_m: f64) -> Timeline {
    let mut tracks = Seen(
        samples.to_vec(),
        ["a", "b", "c", "d"].map(str::to_owned).to_vec(),
        None,
        Metadata::in_seconds(Vec::new()),
    );
    Timeline::from_tracks("recorded_timeline", &mut tracks, Some(delta_m)).expect("a timeline")
}

#[test]
fn radii_of_the_recording_are_the_limits_without_delta() {
    let samples = vec![(0, 0.0, 0.0, 0.0), (1, 0.0, 5.0, 0.0), (0, 1.0, 0.0, 0.0), (1, 1.0, 1.5, 0.0)];
    let drawn = |radius_m| {
        let mut tracks =
            Seen(samples.clone(), ["a", "b"].map(str::to_owned).to_vec(), radius_m, Metadata::in_seconds(Vec::new()));
        Timeline::from_tracks("recorded_timeline", &mut tracks, None).expect("a timeline")
    };
    let [touching, apart, unknown] = [Some(1.0), Some(0.5), None].map(drawn);
    assert_eq!([&touching, &apart, &unknown].map(Timeline::unjudged), [None, None, Some("no delta")]);
    assert_eq!([&touching, &apart, &unknown].map(|drawn| violations(drawn).len()), [1, 0, 0]);
    assert_eq!((violations(&touching)[0].limit_m, touching.assumes_straight), (2.0, true));
}

#[test]
fn too_large_coordinates_are_refused_with_vehicle_value_and_time() {
    let near = recorded_timeline(&[(0, 0.0, -FARTHEST_M, 0.0), (1, 0.0, FARTHEST_M, 0.0)], 1.0);
    assert_eq!(near.log.closest().map(|closest| closest.separation_m), Some(2.0 * FARTHEST_M));
    let samples = vec![(0, 0.0, 0.0, 0.0), (1, 0.0, 1.0, 0.0), (1, 0.5, 1.0, -1e300)];
    let mut tracks = Seen(samples, ["a", "b"].map(str::to_owned).to_vec(), None, Metadata::in_seconds(Vec::new()));
    let error = Timeline::from_tracks("far", &mut tracks, None).expect_err("too far");
    assert_eq!(
        error.to_string(),
        "vehicle b has a coordinate of -1e300 m at 0.5 s; coordinates and radii must be at most 1e9 m"
    );
}

#[test]
fn a_violation_between_samples_is_found() {
    let timeline =
        recorded_timeline(&[(0, 0.0, -2.0, 0.0), (1, 0.0, 2.0, 0.0), (0, 1.0, 2.0, 0.0), (1, 1.0, -2.0, 0.0)], 1.0);
    let pair = Pair::new(0, 1);
    assert_eq!(timeline.log.closest(), Some(ClosestApproach { pair, separation_m: 0.0, time_s: 0.5 }));
    let violation = Violation { pair, from_s: 0.375, to_s: 0.625, min_m: 0.0, min_at_s: 0.5, limit_m: 1.0 };
    assert_eq!(violations(&timeline), [violation]);
    assert_eq!(timeline.log.at(0.4).and_then(|frame| frame.so_far).map(|so_far| so_far.time_s), Some(0.4));
}

#[test]
fn the_closest_approach_at_different_sample_times_is_drawn() {
    // Sampled alternately, so that no sample time is common. They pass 0.5 m apart between two drawn times.
    let by_turns = |k: u32| {
        let (one, other) = (f64::from(k), f64::from(k) + 0.37);
        [(0, one, one - 20.3, 0.0), (1, other, 20.3 - other, 0.5)]
    };
    let samples: Vec<_> = (0..=40).flat_map(by_turns).collect();
    let timeline = recorded_timeline(&samples, 1.0);
    let closest = timeline.log.closest().expect("an approach");
    assert!((closest.separation_m - 0.5).abs() < 1e-9 && (closest.time_s - 20.3).abs() < 1e-9, "{closest:?}");
    let frame = timeline.log.at(closest.time_s).expect("a frame");
    let drawn_m = tautline_core::swarm::separation(&frame.positions_m, 0, 1);
    assert!((drawn_m - 0.5).abs() < 1e-9, "{drawn_m} m");
    assert!(
        timeline
            .log
            .at(closest.time_s - 0.2)
            .expect("a frame")
            .so_far
            .is_some_and(|approach| approach.separation_m > 0.6)
    );
}

#[test]
fn every_pair_in_violation_is_kept() {
    let still = [(0, 0.0, 0.0), (1, 0.5, 0.0), (2, 9.0, 0.0), (3, 9.8, 0.0)];
    let samples: Vec<_> =
        [0.0, 1.0, 2.0].iter().flat_map(|&time_s| still.map(|(vehicle, x, y)| (vehicle, time_s, x, y))).collect();
    let timeline = recorded_timeline(&samples, 1.0);
    let whole = |violation: &Violation| (violation.pair, violation.from_s, violation.to_s);
    let found: Vec<_> = violations(&timeline).iter().map(whole).collect();
    assert_eq!(found, [(Pair::new(0, 1), 0.0, 2.0), (Pair::new(2, 3), 0.0, 2.0)]);
    assert_eq!(violations(&recorded_timeline(&samples, 0.5)), [], "a separation of delta is no violation");
}

#[test]
fn the_smallest_separation_of_a_violation_is_that_of_its_pair() {
    // 0 and 1 are always closest; 2 and 3 have their smallest separation at 2 s.
    let far = [9.0, 1.0, 0.5, 1.0, 9.0];
    let samples: Vec<_> = far
        .iter()
        .enumerate()
        .flat_map(|(k, &y)| {
            let time_s = k as f64;
            [(0, time_s, 0.0, 0.0), (1, time_s, 0.2, 0.0), (2, time_s, 20.0, 0.0), (3, time_s, 20.0, y)]
        })
        .collect();
    let timeline = recorded_timeline(&samples, 2.0);
    let other = violations(&timeline).into_iter().find(|span| span.pair == Pair::new(2, 3)).expect("a violation");
    assert_eq!(other.min_at_s, 2.0);
}
