use super::*;
use tautline_laws::formation::Formation;
use tautline_laws::target::LegTrigger;

/// Rounding of sums of a few numbers of order 1.
const ROUNDING: f64 = 1e-12;
const JUDGE: Arrival = Arrival { edge_error_m: 0.01, disagreement_m_s: 0.02, hold_s: 1.0 };

fn pair_of_vehicles() -> (Vec<Leg>, Graph) {
    (vec![Leg::first(Formation::line(2, 3.0))], Graph::complete(2))
}

/// Summary of two vehicles with an edge error `error_m` and a relative speed `relative_m_s`, sampled every 0.25 s.
fn summary(course: &[(f64, f64)], judge: Arrival) -> Summary {
    let (legs, graph) = pair_of_vehicles();
    let mut metrics = Metrics::new(&legs, &graph, judge);
    let control = Rows::zeros(2);
    for (k, (error_m, relative_m_s)) in course.iter().enumerate() {
        let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 3.0 + error_m, 0.0, 0.0]));
        swarm.velocities_m_s[(1, 0)] = *relative_m_s;
        let time_s = 0.25 * k as f64;
        metrics.observe(&Sample::new(time_s, k as u64, &swarm, &control));
    }
    metrics.finish()
}

const GOOD: (f64, f64) = (0.005, 0.0);
const FAR: (f64, f64) = (0.5, 0.0);
/// Disagreement 0.03 m/s: half of the relative speed.
const FAST: (f64, f64) = (0.005, 0.06);

#[test]
fn reached_is_the_first_instant_from_which_both_tolerances_hold_to_the_end() {
    let s = summary(&[FAR, FAST, GOOD, GOOD, GOOD, GOOD, GOOD], JUDGE);
    assert_eq!((s.reached_at_s, s.held_s, s.end_s), (Some(0.5), Some(1.0), 1.5));
}

#[test]
fn a_formation_held_for_less_than_hold_s_is_not_reached() {
    let s = summary(&[FAR, FAR, FAR, GOOD, GOOD, GOOD, GOOD], JUDGE);
    assert_eq!((s.reached_at_s, s.held_s), (None, Some(0.75)));
    let patient = Arrival { hold_s: 0.75, ..JUDGE };
    assert_eq!(summary(&[FAR, FAR, FAR, GOOD, GOOD, GOOD, GOOD], patient).reached_at_s, Some(0.75));
}

#[test]
fn a_formation_that_is_lost_again_is_not_reached() {
    for lost in [FAR, FAST] {
        let mut course = vec![GOOD; 100];
        course.push(lost);
        let s = summary(&course, JUDGE);
        assert_eq!((s.reached_at_s, s.held_s), (None, None));
        course.extend([GOOD; 5]);
        assert_eq!(summary(&course, JUDGE).reached_at_s, Some(25.25), "regained counts from then on");
    }
}

#[test]
fn a_leg_is_held_up_to_the_time_at_which_the_next_begins() {
    let (mut legs, graph) = pair_of_vehicles();
    legs.push(Leg { begins: LegTrigger::At(1.0), ..legs[0].clone() });
    let swarm = Swarm::at_rest(legs[0].formation.slots_m.clone());
    let control = Rows::zeros(2);
    for (next_s, reached_at_s) in [(1.0, Some(0.0)), (0.99, None)] {
        let mut metrics = Metrics::new(&legs, &graph, JUDGE);
        for (step, time_s) in [0.0, 0.5, 0.98].into_iter().enumerate() {
            metrics.observe(&Sample::new(time_s, step as u64, &swarm, &control));
        }
        metrics.event(&Event::LegBegan { leg: 1, time_s: next_s }).expect("kept");
        assert_eq!(metrics.ended_legs(), [LegSummary { ended_at_s: next_s, reached_at_s }]);
    }
}

#[test]
fn a_reassigned_vehicle_is_compared_with_its_new_slot() {
    let (mut legs, graph) = pair_of_vehicles();
    legs[0].interchangeable = true;
    let swapped = Swarm::at_rest(legs[0].formation.reordered(&[1, 0]).slots_m);
    let mut metrics = Metrics::new(&legs, &graph, JUDGE).with_freedom(Freedom::Translation);
    let look = |metrics: &mut Metrics<'_>| {
        metrics.observe(&Sample::new(0.0, 0, &swapped, &Rows::zeros(2)));
        metrics.finish().rms_position_error_m
    };
    assert!((look(&mut metrics) - 3.0).abs() < ROUNDING);
    metrics.event(&Event::Assigned { time_s: 0.0, slots: vec![1, 0] }).expect("kept");
    assert_eq!(look(&mut metrics), 0.0);
}

#[test]
fn rounding_of_times_does_not_shorten_the_hold() {
    let (legs, graph) = pair_of_vehicles();
    let mut metrics = Metrics::new(&legs, &graph, JUDGE);
    let swarm = Swarm::at_rest(legs[0].formation.slots_m.clone());
    for time_s in [9.0_f64.next_up(), 10.0] {
        let control = Rows::zeros(2);
        metrics.observe(&Sample::new(time_s, 0, &swarm, &control));
    }
    assert_eq!(metrics.finish().reached_at_s, Some(9.0_f64.next_up()));
}

#[test]
fn a_state_that_is_not_a_number_is_never_within_tolerance() {
    let s = summary(&[GOOD, GOOD, GOOD, GOOD, GOOD, (f64::NAN, 0.0)], JUDGE);
    assert_eq!(s.reached_at_s, None);
    assert!(s.max_edge_error_m.is_nan());
    let s = summary(&[GOOD, GOOD, GOOD, GOOD, GOOD, (0.0, f64::NAN)], JUDGE);
    assert_eq!(s.reached_at_s, None);
}

#[test]
fn a_flight_without_samples_reaches_no_formation() {
    let s = summary(&[], JUDGE);
    assert_eq!((s.samples, s.reached_at_s, s.energy_initial), (0, None, None));
    assert_eq!(summary(&[], Arrival { hold_s: 0.0, ..JUDGE }).reached_at_s, None);
}

#[test]
fn metrics_match_the_samples() {
    let (legs, graph) = pair_of_vehicles();
    let mut metrics = Metrics::new(&legs, &graph, JUDGE);
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 3.5, 0.0, 0.0]));
    swarm.velocities_m_s = Rows::from_row_slice(&[3.0, 4.0, 0.0, 3.0, 4.2, 0.0]);
    for (k, (energy, u)) in [(2.0, 0.5), (3.0, 2.0), (1.0, 1.0)].into_iter().enumerate() {
        let control = Rows::from_row_slice(&[0.6 * u, 0.8 * u, 0.0, 0.0, 0.0, -0.1]);
        metrics.observe(&Sample { energy: Some(energy), ..Sample::new(k as f64, k as u64, &swarm, &control) });
    }
    assert!((metrics.edge_error_m() - 0.5).abs() < ROUNDING);
    let s = metrics.finish();
    assert_eq!((s.samples, s.end_s), (3, 2.0));
    for (found, expected) in [
        (s.max_edge_error_m, 0.5),
        // Each of the two vehicles is a quarter of a metre from its slot in the best fit.
        (s.rms_position_error_m, 0.25),
        (s.max_position_error_m, 0.25),
        (s.disagreement_m_s, 0.1),
        (s.common_m_s, 3.0_f64.hypot(4.1)),
        (s.peak_control_m_s2, 2.0),
        (s.final_control_m_s2, 1.0),
    ] {
        assert!((found - expected).abs() < ROUNDING, "{found} instead of {expected}");
    }
    assert_eq!((s.energy_initial, s.energy_final, s.energy_max), (Some(2.0), Some(1.0), Some(3.0)));
    assert_eq!(s.energy_max_over_initial, Some(1.5));
}

#[test]
fn a_start_without_energy_has_no_ratio() {
    let (legs, graph) = pair_of_vehicles();
    let mut metrics = Metrics::new(&legs, &graph, JUDGE);
    let (swarm, control) = (Swarm::at_rest(legs[0].formation.slots_m.clone()), Rows::zeros(2));
    metrics.observe(&Sample { energy: Some(0.0), ..Sample::new(0.0, 0, &swarm, &control) });
    assert_eq!(metrics.finish().energy_max_over_initial, None);
}
