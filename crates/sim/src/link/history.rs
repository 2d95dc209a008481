//! Interpolated past of a swarm, for delayed measurements and messages.

use std::collections::VecDeque;

use tautline_core::swarm::Swarm;

/// States of the last `span_s` seconds.
///
/// Between two states, each coordinate is the Hermite cubic of their positions and velocities. Its error is at most
/// h^4/384 times the fourth derivative over a step h; the error of its velocity is of order h^3.
#[derive(Clone, Debug)]
pub struct History {
    span_s: f64,
    states: VecDeque<(f64, Swarm)>,
    /// Memory of dropped states, for reuse.
    spare: Vec<Swarm>,
}

impl History {
    /// Returns an empty history that keeps at least the last `span_s` seconds.
    #[must_use]
    pub fn new(span_s: f64) -> Self {
        Self { span_s, states: VecDeque::new(), spare: Vec::new() }
    }

    /// Adds the latest state, or replaces it at the same time.
    pub fn push(&mut self, time_s: f64, swarm: &Swarm) {
        self.forget_after(time_s.next_down());
        let state = match self.spare.pop() {
            Some(mut state) => {
                state.copy_from(swarm);
                state
            }
            None => swarm.clone(),
        };
        self.states.push_back((time_s, state));
    }

    /// Drops states older than the span before this time. Time must not go back before it later.
    pub fn settle(&mut self, time_s: f64) {
        // The state before the span begins is needed to interpolate up to it.
        let oldest_s = time_s - self.span_s;
        while self.states.get(1).is_some_and(|(second_s, _)| *second_s <= oldest_s) {
            self.spare.extend(self.states.pop_front().map(|(_, state)| state));
        }
    }

    /// Drops every state after this time.
    pub fn forget_after(&mut self, time_s: f64) {
        while self.states.back().is_some_and(|(last_s, _)| *last_s > time_s) {
            self.spare.extend(self.states.pop_back().map(|(_, state)| state));
        }
    }

    /// Writes the state at a time \[s\]; before the first state that state, after the last state that one.
    pub fn at(&self, time_s: f64, swarm: &mut Swarm) {
        let later = self.states.partition_point(|(state_s, _)| *state_s <= time_s);
        let (before, after) = (later.checked_sub(1).and_then(|index| self.states.get(index)), self.states.get(later));
        match (before, after) {
            (Some((from_s, from)), Some((to_s, to))) => {
                interpolate(from, to, to_s - from_s, (time_s - from_s) / (to_s - from_s), swarm);
            }
            (Some((_, only)), None) | (None, Some((_, only))) => swarm.copy_from(only),
            (None, None) => {}
        }
    }
}

/// Evaluates the Hermite cubic of two states `h_s` apart at s = (t - t0)/h, in \[0, 1\].
fn interpolate(from: &Swarm, to: &Swarm, h_s: f64, s: f64, swarm: &mut Swarm) {
    let positions = from.positions_m.iter().zip(to.positions_m.iter());
    let velocities = from.velocities_m_s.iter().zip(to.velocities_m_s.iter());
    let written = swarm.positions_m.iter_mut().zip(swarm.velocities_m_s.iter_mut());
    for (((p0, p1), (v0, v1)), (p, v)) in positions.zip(velocities).zip(written) {
        let (rise, m0, m1) = (p1 - p0, h_s * v0, h_s * v1);
        let (c2, c3) = (3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise);
        *p = p0 + s * (m0 + s * (c2 + s * c3));
        *v = (m0 + s * (2.0 * c2 + 3.0 * s * c3)) / h_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Rows;

    /// One coordinate 1 + 2 t - 3 t^2 + t^3.
    fn cubic(t: f64) -> Swarm {
        let (p, v) = (1.0 + t * (2.0 + t * (t - 3.0)), 2.0 + t * (3.0 * t - 6.0));
        Swarm { positions_m: Rows::from_element(1, p), velocities_m_s: Rows::from_element(1, v) }
    }

    #[test]
    fn a_cubic_motion_is_exact_within_the_history_and_constant_beyond_it() {
        let mut history = History::new(1.0);
        for t in [0.0, 0.3, 0.5, 1.0] {
            history.push(t, &cubic(t));
        }
        let mut point = cubic(0.0);
        for t in [0.0, 0.1, 0.3, 0.42, 0.77, 1.0] {
            history.at(t, &mut point);
            let exact = cubic(t);
            assert!((&point.positions_m - &exact.positions_m).amax() < 1e-14, "{t}");
            assert!((&point.velocities_m_s - &exact.velocities_m_s).amax() < 1e-13, "{t}");
        }
        history.at(7.0, &mut point);
        assert_eq!(point, cubic(1.0));
        history.at(-7.0, &mut point);
        assert_eq!(point, cubic(0.0));
    }

    #[test]
    fn states_before_the_span_and_refused_states_are_dropped() {
        let mut history = History::new(0.5);
        (0..=8).for_each(|k| history.push(0.25 * f64::from(k), &cubic(0.25 * f64::from(k))));
        assert_eq!(history.states.len(), 9, "a step that may be refused drops nothing");
        history.settle(2.0);
        assert_eq!(history.states.front().map(|(time_s, _)| *time_s), Some(1.5));
        history.forget_after(1.6);
        history.push(1.6, &cubic(0.0));
        history.push(1.6, &cubic(3.0));
        let mut point = cubic(1.0);
        history.at(1.6, &mut point);
        assert_eq!((point, history.states.len()), (cubic(3.0), 2));
    }
}
