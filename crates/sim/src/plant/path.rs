//! The way of a swarm over a step, as straight segments.

use tautline_core::swarm::Rows;

/// The way of a swarm over a step: straight segments through the instants that were passed, and how far at most the true
/// paths bend away from them.
///
/// A plant that moves on one straight line within a step adds nothing. One that takes steps of its own passes through
/// their ends; one that moves on curves says how far they bend.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Reused from step to step; the first `passed` are of this one.
    instants: Vec<(f64, Rows)>,
    passed: usize,
    bend_m: f64,
}

impl Path {
    /// A straight line from the state before the step.
    pub fn begin(&mut self) {
        (self.passed, self.bend_m) = (0, 0.0);
    }

    /// Passes through these positions \[m\], N x 3, `after_s` seconds from the beginning of the step, in increasing
    /// order and before its end.
    pub fn pass(&mut self, after_s: f64, positions_m: &Rows) {
        if self.passed == self.instants.len() {
            self.instants.push((after_s, positions_m.clone()));
        } else {
            let (time_s, rows) = &mut self.instants[self.passed];
            *time_s = after_s;
            rows.clone_from(positions_m);
        }
        self.passed += 1;
    }

    /// No vehicle's true path leaves its segments by more than this \[m\], or by more than what was said before.
    pub fn bend(&mut self, bend_m: f64) {
        self.bend_m = self.bend_m.max(bend_m);
    }

    /// How far at most a true path leaves its segments \[m\].
    #[must_use]
    pub fn bend_m(&self) -> f64 {
        self.bend_m
    }

    /// The instants between the ends of the step: seconds from its beginning, and positions \[m\].
    pub fn passed(&self) -> impl Iterator<Item = (f64, &Rows)> {
        self.instants[..self.passed].iter().map(|(after_s, positions_m)| (*after_s, positions_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_holds_what_was_passed_in_this_step_and_the_largest_bend() {
        let at = |x: f64| Rows::from_element(2, x);
        let mut path = Path::default();
        path.pass(0.1, &at(1.0));
        path.pass(0.2, &at(2.0));
        path.bend(0.5);
        path.bend(0.25);
        assert_eq!(path.bend_m(), 0.5);
        path.begin();
        path.pass(0.3, &at(3.0));
        assert_eq!(path.passed().collect::<Vec<_>>(), [(0.3, &at(3.0))]);
        assert_eq!(path.bend_m(), 0.0);
    }
}
