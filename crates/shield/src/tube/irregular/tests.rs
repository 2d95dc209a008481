use super::*;
use crate::tests::Random;
use crate::tube::tests::BASE;

fn times(shortest_s: f64, longest_s: f64) -> Intervals {
    Intervals { shortest_s, longest_s, jumps: [0.0; 2] }
}

/// Steps of the integrator between two instants.
const STEPS: usize = 16;

/// Moves a state by a feedback and a push for a step, by a series of its own.
fn moved([e, d]: [f64; 2], force: f64, a22: f64, seconds: f64) -> [f64; 2] {
    // Taylor series of the acceleration a22 d + force.
    let mut rate = a22 * d + force;
    let (mut position, mut velocity) = (e + d * seconds, d);
    let mut power = seconds;
    for k in 1..9 {
        velocity += rate * power;
        power *= seconds / f64::from(k + 1);
        position += rate * power;
        rate *= a22;
    }
    [position, velocity]
}

/// Returns the largest value of an output after a sequence of times, with the worst signs of all inputs. The output is
/// the error of position `last_s` after the last instant, or the feedback at the last instant.
fn worst_signs(tracker: &TrackerLoop, intervals: &Intervals, sequence: &[f64], last_s: Option<f64>) -> f64 {
    let [kp, kd, a22] = [tracker.tracker_per_s2, tracker.tracker_per_s, tracker.a22_per_s];
    let noise = kp * tracker.position_error_m + kd * tracker.velocity_error_m_s;
    let start = [tracker.position_error_m, tracker.velocity_error_m_s];
    // Output as a function of the state at an instant, from the last instant backwards.
    let mut output = if last_s.is_some() { [1.0, 0.0] } else { [kp, kd] };
    let mut sum = if last_s.is_some() { 0.0 } else { noise };
    for seconds in last_s.iter().chain(sequence.iter().rev()) {
        let of_state = |state: [f64; 2]| output[0] * state[0] + output[1] * state[1];
        let step_s = seconds / STEPS as f64;
        for step in 0..STEPS {
            // Responses to a push at the middle of a step: at most the integral, up to the second order.
            let left_s = (step as f64 + 0.5) * step_s;
            let push = tracker.disturbance_m_s2 + a22.abs() * tracker.accel_m_s2 * (seconds - left_s);
            sum += of_state(moved([0.0, 1.0], 0.0, a22, left_s)).abs() * step_s * push;
        }
        sum += of_state(moved([0.0; 2], 1.0, a22, *seconds)).abs() * noise;
        output = [[1.0, 0.0], [0.0, 1.0]].map(|state| {
            let feedback = -kp * state[0] - kd * state[1];
            of_state(moved(state, feedback, a22, *seconds))
        });
        sum += output[0].abs() * intervals.jumps[0] + output[1].abs() * intervals.jumps[1];
    }
    sum + output[0].abs() * start[0] + output[1].abs() * start[1]
}

/// Returns the largest error and feedback that a search over sequences of times finds.
fn searched(tracker: &TrackerLoop, intervals: &Intervals, random: &mut Random) -> [f64; 2] {
    let spread = intervals.longest_s - intervals.shortest_s;
    let choices = [0.0, 0.3, 0.7, 1.0].map(|share| intervals.shortest_s + share * spread);
    let mut largest = [0.0_f64; 2];
    for (output, largest) in largest.iter_mut().enumerate() {
        for count in [2, 12, 100] {
            let last_s = (output == 0).then_some(intervals.longest_s);
            let mut sequence: Vec<_> = (0..count).map(|_| choices[random.index(choices.len())]).collect();
            let mut best = worst_signs(tracker, intervals, &sequence, last_s);
            for _ in 0..3 {
                for place in (0..count).rev() {
                    for choice in choices {
                        let before = std::mem::replace(&mut sequence[place], choice);
                        let found = worst_signs(tracker, intervals, &sequence, last_s);
                        if found > best {
                            best = found;
                        } else {
                            sequence[place] = before;
                        }
                    }
                }
            }
            *largest = largest.max(best);
        }
    }
    largest
}

#[test]
fn regular_instants_have_the_regular_tube_within_three_thousandths() {
    for tracker in [
        BASE,
        TrackerLoop { a22_per_s: -0.3, ..BASE },
        TrackerLoop { a22_per_s: 0.1, ..BASE },
        TrackerLoop { tracker_per_s2: 9.0, tracker_per_s: 3.0, ..BASE },
        TrackerLoop { tracker_per_s2: 1.0, tracker_per_s: 5.0, period_s: 0.02, ..BASE },
    ] {
        let regular = tracker.tube().expect("stable");
        let found = tracker.irregular_tube(&times(tracker.period_s, tracker.period_s)).expect("stable");
        for (found, regular) in [(found.error_m, regular.error_m), (found.feedback_m_s2, regular.feedback_m_s2)] {
            assert!((0.9999..1.003).contains(&(found / regular)), "{tracker:?}: {found} {regular}");
        }
        assert!((0.5..2.0).contains(&(found.jumps / regular.jumps)), "{found:?} {regular:?}");
    }
}

#[test]
fn the_worst_sequences_of_times_come_near_the_bound_and_do_not_exceed_it() {
    let mut random = Random::new(301);
    let mut tightest = [f64::INFINITY; 2];
    for round in 0..24 {
        let tracker = TrackerLoop {
            tracker_per_s2: random.between(3.0, 9.0),
            tracker_per_s: random.between(2.0, 5.0),
            a22_per_s: if round % 2 == 0 { 0.0 } else { random.between(-0.3, 0.1) },
            ..BASE
        };
        let tolerance = random.between(0.0, 0.5);
        let hang = random.index(4);
        let mut intervals = times(0.05 * (1.0 - tolerance), 0.05 * (1 + hang) as f64 * (1.0 + tolerance));
        if round % 3 == 0 {
            intervals.jumps = [0.002, 0.005];
        }
        let Ok(tube) = tracker.irregular_tube(&intervals) else { continue };
        let found = searched(&tracker, &intervals, &mut random);
        for (k, bound) in [tube.error_m, tube.feedback_m_s2].into_iter().enumerate() {
            // The midpoint rule of the search has an error of some 1e-3 of its own where a response changes its sign.
            assert!(found[k] <= bound * 1.001, "{tracker:?} {intervals:?}: {found:?} {tube:?}");
            tightest[k] = tightest[k].min(found[k] / bound);
        }
    }
    assert!(tightest[0] > 0.9 && tightest[1] > 0.9, "{tightest:?}");
}

#[test]
fn loops_without_a_bound_for_all_times_are_refused() {
    let tube = |tracker: TrackerLoop, longest_s: f64| tracker.irregular_tube(&times(0.05, longest_s));
    assert_eq!(tube(TrackerLoop { tracker_per_s: 50.0, ..BASE }, 0.05), Err(TubeError::Unstable));
    // kd T beyond 2 amplifies a velocity.
    assert_eq!(tube(BASE, 0.6), Err(TubeError::Unstable));
    assert_eq!(tube(TrackerLoop { actuator_lag_s: 0.1, ..BASE }, 0.1), Err(TubeError::IrregularLag));
    assert_eq!(tube(TrackerLoop { a22_per_s: -30.0, ..BASE }, 0.1), Err(TubeError::LargeDrag));
    for value in [f64::NAN, f64::INFINITY, 1e300] {
        for tracker in [
            TrackerLoop { tracker_per_s2: value, ..BASE },
            TrackerLoop { tracker_per_s: value, ..BASE },
            TrackerLoop { disturbance_m_s2: value * 1e10, ..BASE },
            TrackerLoop { position_error_m: value * 1e10, ..BASE },
        ] {
            assert!(tube(tracker, 0.1).is_err(), "{tracker:?}");
        }
    }
    let exact = TrackerLoop { position_error_m: 0.0, velocity_error_m_s: 0.0, disturbance_m_s2: 0.0, ..BASE };
    let tube = tube(exact, 0.1).expect("stable");
    assert_eq!((tube.error_m, tube.feedback_m_s2), (0.0, 0.0));
}
