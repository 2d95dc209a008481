use super::*;
use crate::swarm::Swarm;

fn sample(footage: &mut Footage, time_s: f64, x: f64, separation_m: f64) {
    let swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, x, 0.0, 0.0]));
    let separation = Some(ClosestApproach { pair: Pair::new(0, 1), separation_m, time_s: time_s - 0.5 });
    let control = Rows::zeros(2);
    footage.take(&Sample { time_s, step: 0, swarm: &swarm, control: &control, separation, energy: None });
}

#[test]
fn between_two_instants_vehicles_are_on_a_straight_line() {
    let mut footage = Footage::new("pair", 2);
    sample(&mut footage, 0.0, 4.0, 4.0);
    sample(&mut footage, 1.0, 2.0, 2.0);
    let moment = footage.at(0.25).expect("a moment");
    assert_eq!((moment.positions_m[(1, 0)], moment.nearest), (3.5, Some((Pair::new(0, 1), 3.5))));
    let beyond = footage.at(9.0).expect("a moment");
    assert_eq!((beyond.time_s, beyond.positions_m[(1, 0)]), (1.0, 2.0));
}

#[test]
fn an_approach_counts_from_its_own_time_and_not_from_its_sample() {
    let mut footage = Footage::new("pair", 2);
    sample(&mut footage, 0.0, 4.0, 4.0);
    sample(&mut footage, 1.0, 4.0, 1.0);
    let so_far = |time_s| footage.at(time_s).and_then(|moment| moment.so_far).map(|approach| approach.separation_m);
    assert_eq!([0.0, 0.4, 0.5, 1.0].map(so_far), [Some(4.0), Some(4.0), Some(1.0), Some(1.0)]);
}

#[test]
fn a_long_flight_is_thinned_and_keeps_its_ends_and_its_closest_approach() {
    let mut footage = Footage { budget_bytes: 20_000, ..Footage::new("pair", 2) };
    for k in 0..10_000_u32 {
        let separation_m = if k == 7777 { 0.5 } else { 3.0 };
        sample(&mut footage, f64::from(k), f64::from(k), separation_m);
    }
    assert!(footage.instants() < 100 && footage.every() >= 64, "{} of every {}", footage.instants(), footage.every());
    assert_eq!(footage.range_s(), [0.0, 9999.0]);
    assert_eq!(footage.closest().map(|closest| closest.separation_m), Some(0.5));
    let smallest = footage.separations().map(|[_, separation_m]| separation_m).fold(f64::INFINITY, f64::min);
    assert_eq!(smallest, 0.5, "the curve of separations keeps its minimum");
    let times: Vec<f64> = footage.positions().map(|(time_s, _)| time_s).collect();
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
    // Straight motion is the same from fewer instants.
    assert_eq!(footage.at(4321.0).map(|moment| moment.positions_m[(1, 0)]), Some(4321.0));
}

#[test]
fn nothing_recorded_is_nothing_to_draw() {
    assert!(Footage::new("pair", 2).at(0.0).is_none());
    assert!(matches!(Footage::new("pair", 2).complete("x.mcap"), Err(FootageError::Empty { .. })));
}
