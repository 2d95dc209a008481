use super::*;
use crate::tests::Random;

/// Loop of the docs.
pub(super) const BASE: TrackerLoop = TrackerLoop {
    period_s: 0.05,
    tracker_per_s2: 4.0,
    tracker_per_s: 4.0,
    position_error_m: 0.03,
    velocity_error_m_s: 0.05,
    disturbance_m_s2: 0.3,
    a22_per_s: 0.0,
    accel_m_s2: 5.0,
    measurement_delay_periods: 0,
    actuator_lag_s: 0.0,
};

/// Steps of the integrator in a period.
const STEPS: usize = 20;

/// Inputs of a simulated loop, each as a function of the step or of the period.
struct Inputs {
    start: [f64; 2],
    noise: Vec<f64>,
    held: Vec<f64>,
    push: Vec<f64>,
}

impl Inputs {
    fn zero(periods: usize) -> Self {
        Self { start: [0.0; 2], noise: vec![0.0; periods], held: vec![0.0; periods], push: vec![0.0; periods * STEPS] }
    }
}

/// Integrates the loop by the midpoint rule, independently of the exponential. Returns the error of position after each
/// step, and the feedback of each period.
fn simulate(tracker: &TrackerLoop, inputs: &Inputs) -> (Vec<f64>, Vec<f64>) {
    let step_s = tracker.period_s / STEPS as f64;
    let (mut errors, mut feedbacks) = (vec![], vec![]);
    let mut state = [inputs.start[0], inputs.start[1], 0.0];
    let mut measured = vec![];
    for (period, noise) in inputs.noise.iter().enumerate() {
        measured.push(tracker.tracker_per_s2 * state[0] + tracker.tracker_per_s * state[1]);
        let delayed = period.checked_sub(tracker.measurement_delay_periods).map_or(0.0, |index| measured[index]);
        let (feedback, held) = (-delayed + noise, inputs.held[period]);
        feedbacks.push(feedback);
        for push in &inputs.push[period * STEPS..(period + 1) * STEPS] {
            let rates = |state: [f64; 3]| {
                let lag = tracker.actuator_lag_s;
                let thrust = if lag > 0.0 { state[2] - held } else { feedback };
                let actuator = if lag > 0.0 { (feedback + held - state[2]) / lag } else { 0.0 };
                [state[1], tracker.a22_per_s * state[1] + thrust + push, actuator]
            };
            let moved = |by: [f64; 3], seconds: f64| std::array::from_fn(|k| state[k] + by[k] * seconds);
            state = moved(rates(moved(rates(state), step_s / 2.0)), step_s);
            errors.push(state[0]);
        }
    }
    (errors, feedbacks)
}

/// Returns the largest error of position and the largest feedback at the end under the worst sequence of signs. The
/// signs are those of the impulse responses, which are simulated one by one.
fn worst_sequence(tracker: &TrackerLoop, periods: usize) -> (f64, f64) {
    let noise_bound =
        tracker.tracker_per_s2 * tracker.position_error_m + tracker.tracker_per_s * tracker.velocity_error_m_s;
    let held_bound = if tracker.actuator_lag_s > 0.0 { tracker.accel_m_s2 } else { 0.0 };
    let push_bound = |step: usize| {
        let since = (step % STEPS) as f64 + 0.5;
        tracker.disturbance_m_s2
            + tracker.a22_per_s.abs() * tracker.accel_m_s2 * since * tracker.period_s / STEPS as f64
    };
    // The largest of some steps of the last period, and the feedback of the last period.
    let mut largest = [0.0_f64; 2];
    for (kind, ends) in [(0, (0..STEPS).step_by(10).collect::<Vec<_>>()), (1, vec![0])] {
        for end in ends {
            let answer = |inputs: &Inputs| {
                let (errors, feedbacks) = simulate(tracker, inputs);
                if kind == 0 { errors[errors.len() - 1 - end] } else { feedbacks[feedbacks.len() - 1] }
            };
            let mut worst = Inputs::zero(periods);
            for period in 0..periods {
                let mut impulse = Inputs::zero(periods);
                impulse.noise[period] = 1.0;
                worst.noise[period] = noise_bound * answer(&impulse).signum();
                impulse = Inputs::zero(periods);
                impulse.held[period] = 1.0;
                worst.held[period] = held_bound * answer(&impulse).signum();
            }
            for step in 0..periods * STEPS {
                let mut impulse = Inputs::zero(periods);
                impulse.push[step] = 1.0;
                worst.push[step] = push_bound(step) * answer(&impulse).signum();
            }
            for (k, bound) in [tracker.position_error_m, tracker.velocity_error_m_s].into_iter().enumerate() {
                let mut impulse = Inputs::zero(periods);
                impulse.start[k] = 1.0;
                worst.start[k] = bound * answer(&impulse).signum();
            }
            largest[kind] = largest[kind].max(answer(&worst));
        }
    }
    (largest[0], largest[1])
}

fn close(value: f64, expected: f64, digit: f64) {
    assert!((value - expected).abs() <= 0.5 * digit, "{value} is not {expected}");
}

#[test]
fn quadrature_with_the_worst_start_after_the_sum_gives_the_numbers_of_the_page() {
    let tube = |tracker: TrackerLoop| tracker.tube().expect("stable");
    // Push alone: W / kp.
    close(tube(TrackerLoop { position_error_m: 0.0, velocity_error_m_s: 0.0, ..BASE }).error_m, 0.075, 1e-5);
    // A simpler bound adds the largest start term to the whole sum and 0.1 %.
    let sampled = Sampled::new(&BASE).expect("a lag");
    let mut sums = Sums::own_period(&sampled);
    let (mut inputs, mut starts, mut start) = (sampled.inputs.clone(), sampled.starts.clone(), [0.0_f64; 2]);
    for _ in 0..2_000 {
        let of_start = Sums::of_start(&sampled, &starts);
        start = [start[0].max(of_start.positions.max()), start[1].max(of_start.feedback)];
        sums.add(&sampled, &inputs);
        (inputs, starts) = (&sampled.step * inputs, &sampled.step * starts);
    }
    close(1.001 * (sums.positions.max() + start[0]), 0.1897, 1e-4);
    close(1.001 * (sums.feedback + start[1]), 1.4416, 1e-4);
    // The start term decays while the sum grows.
    let tight = tube(BASE);
    assert!(tight.error_m < 0.1551 && tight.feedback_m_s2 < 1.13, "{tight:?}");
}

#[test]
fn the_worst_sequence_of_signs_comes_within_a_per_cent_of_the_bound() {
    let oscillating = TrackerLoop { tracker_per_s2: 9.0, tracker_per_s: 3.0, ..BASE };
    let loops = [
        BASE,
        TrackerLoop { a22_per_s: -0.3, ..BASE },
        TrackerLoop { a22_per_s: 0.1, period_s: 0.1, ..BASE },
        oscillating,
        TrackerLoop { measurement_delay_periods: 2, ..oscillating },
        TrackerLoop { actuator_lag_s: 0.08, ..BASE },
        TrackerLoop { measurement_delay_periods: 1, actuator_lag_s: 0.02, a22_per_s: -0.2, ..BASE },
    ];
    for tracker in loops {
        let tube = tracker.tube().expect("stable");
        // The largest over the first periods, because a start error decays.
        let found: Vec<_> = [1, 3, 8, 21, 100].into_iter().map(|periods| worst_sequence(&tracker, periods)).collect();
        let error = found.iter().map(|found| found.0).fold(0.0, f64::max);
        let feedback = found.iter().map(|found| found.1).fold(0.0, f64::max);
        // The integrator has an error of some 1e-4 of its own.
        assert!(error <= tube.error_m * 1.0005 && error >= 0.99 * tube.error_m, "{tracker:?}: {error} {tube:?}");
        assert!(feedback <= tube.feedback_m_s2 * 1.0005, "{tracker:?}: {feedback} {tube:?}");
        assert!(feedback >= 0.99 * tube.feedback_m_s2, "{tracker:?}: {feedback} {tube:?}");
    }
}

#[test]
fn random_inputs_at_their_bounds_stay_within_the_tube() {
    let mut random = Random::new(5);
    for _ in 0..40 {
        let tracker = TrackerLoop {
            tracker_per_s2: random.between(1.0, 9.0),
            tracker_per_s: random.between(1.5, 6.0),
            period_s: random.between(0.02, 0.1),
            a22_per_s: random.between(-0.3, 0.1),
            measurement_delay_periods: random.index(3),
            actuator_lag_s: if random.chance(0.5) { random.between(0.02, 0.1) } else { 0.0 },
            ..BASE
        };
        let Ok(tube) = tracker.tube() else { continue };
        let mut sign = |bound: f64| if random.chance(0.5) { bound } else { -bound };
        let mut inputs = Inputs::zero(60);
        inputs.start = [sign(tracker.position_error_m), sign(tracker.velocity_error_m_s)];
        let noise =
            tracker.tracker_per_s2 * tracker.position_error_m + tracker.tracker_per_s * tracker.velocity_error_m_s;
        inputs.noise.fill_with(|| sign(noise));
        inputs.held.fill_with(|| sign(if tracker.actuator_lag_s > 0.0 { tracker.accel_m_s2 } else { 0.0 }));
        inputs.push.fill_with(|| sign(tracker.disturbance_m_s2));
        let (errors, feedbacks) = simulate(&tracker, &inputs);
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        assert!(largest(&errors) <= tube.error_m, "{tracker:?}");
        assert!(largest(&feedbacks) <= tube.feedback_m_s2, "{tracker:?}");
    }
}

#[test]
fn loops_that_do_not_contract_are_refused() {
    let tracker_of = |tracker_per_s2, tracker_per_s, delay| {
        TrackerLoop { tracker_per_s2, tracker_per_s, measurement_delay_periods: delay, ..BASE }.tube()
    };
    // The product of the eigenvalues is 1 - kd h + kp h^2 / 2, here -1.5.
    assert_eq!(tracker_of(4.0, 50.0, 0), Err(TubeError::Unstable));
    assert_eq!(tracker_of(4.0, 4.0, 12), Err(TubeError::Unstable));
    assert_eq!(tracker_of(f64::NAN, 4.0, 0), Err(TubeError::Unstable));
    assert_eq!(TrackerLoop { actuator_lag_s: 1e-6, ..BASE }.tube(), Err(TubeError::ShortLag));
    assert_eq!(TrackerLoop { period_s: 1000.0, ..BASE }.tube(), Err(TubeError::LongPeriod));
    assert_eq!(TrackerLoop { a22_per_s: -1e5, ..BASE }.tube(), Err(TubeError::LargeDrag));
    // Slow but stable: poles near 0.05 and 1 per second.
    let slow = tracker_of(0.05, 1.0, 0).expect("stable");
    assert!(slow.error_m >= 0.3 / 0.05, "{slow:?}");
}

/// Sum of two doubles without rounding: the first one plus a small second one.
#[derive(Clone, Copy)]
struct Double(f64, f64);

impl Double {
    fn plus(self, other: Self) -> Self {
        let sum = self.0 + other.0;
        let part = sum - self.0;
        let error = (self.0 - (sum - part)) + (other.0 - part) + self.1 + other.1;
        let high = sum + error;
        Self(high, error - (high - sum))
    }

    fn times(self, other: Self) -> Self {
        let product = self.0 * other.0;
        let error = self.0.mul_add(other.0, -product) + self.0 * other.1 + self.1 * other.0;
        let high = product + error;
        Self(high, error - (high - product))
    }

    fn abs(self) -> Self {
        if self.0 < 0.0 { Self(-self.0, -self.1) } else { self }
    }
}

/// Returns the sum of the absolute responses of the error of position and of the feedback at the instants to noise and
/// the start, with 106 bits. Without drag, lag and delay the map from instant to instant is known in closed form.
fn precise(tracker: &TrackerLoop, periods: usize) -> [f64; 2] {
    let exact = |value: f64| Double(value, 0.0);
    let (h, kp, kd) = (exact(tracker.period_s), exact(tracker.tracker_per_s2), exact(tracker.tracker_per_s));
    let half = h.times(h).times(exact(0.5));
    let minus = |value: Double| Double(-value.0, -value.1);
    let step = |[p, v]: [Double; 2]| {
        let feedback = minus(kp.times(p).plus(kd.times(v)));
        [p.plus(h.times(v)).plus(half.times(feedback)), v.plus(h.times(feedback))]
    };
    let feedback = |[p, v]: [Double; 2]| kp.times(p).plus(kd.times(v)).abs();
    let noise = kp.times(exact(tracker.position_error_m)).plus(kd.times(exact(tracker.velocity_error_m_s)));
    let mut sums = [Double(0.0, 0.0), noise];
    let (mut state, mut starts) = ([half, h], [[exact(1.0), exact(0.0)], [exact(0.0), exact(1.0)]]);
    let mut largest = [0.0_f64; 2];
    for _ in 0..periods {
        let errors = [exact(tracker.position_error_m), exact(tracker.velocity_error_m_s)];
        let start = |entry_of: fn([Double; 2]) -> Double| {
            starts.iter().zip(errors).fold(exact(0.0), |sum, (state, error)| sum.plus(entry_of(*state).times(error)))
        };
        let position = sums[0].plus(start(|[p, _]| p.abs()));
        let all =
            starts.iter().zip(errors).fold(exact(0.0), |sum, (state, error)| sum.plus(feedback(*state).times(error)));
        largest = [largest[0].max(position.0), largest[1].max(sums[1].plus(all).0)];
        sums = [sums[0].plus(state[0].abs().times(noise)), sums[1].plus(feedback(state).times(noise))];
        state = step(state);
        starts = starts.map(step);
    }
    largest
}

#[test]
fn the_tube_contains_the_sums_with_106_bits_and_rounding_costs_little() {
    let mut random = Random::new(91);
    let mut tightest = f64::INFINITY;
    for round in 0..60 {
        let slow = round % 3 == 0;
        let tracker = TrackerLoop {
            tracker_per_s2: if slow { random.between(0.3, 1.0) } else { random.between(1.0, 9.0) },
            tracker_per_s: random.between(1.5, if slow { 2.0 } else { 6.0 }),
            period_s: random.between(0.02, 0.1),
            disturbance_m_s2: 0.0,
            ..BASE
        };
        let tube = tracker.tube().expect("stable");
        let [error, feedback] = precise(&tracker, 20_000);
        assert!(tube.error_m >= error && tube.feedback_m_s2 >= feedback, "{tracker:?}: {tube:?} {error} {feedback}");
        // The feedback has no bound between grid points, so what is left is rounding and the tail.
        let excess = tube.feedback_m_s2 / feedback - 1.0;
        assert!(excess < 1e-4, "{tracker:?}: {excess}");
        tightest = tightest.min(excess);
    }
    assert!(tightest < 1e-6, "{tightest}");
}
