//! A solver that needs too many steps ends.

use super::*;
use tautline_laws::formation::Formation;

/// A command that changes its sign so many times a second.
struct Switching(f64);

impl Feedback for Switching {
    fn command(&mut self, time_s: f64, _truth: &Swarm, command: &mut Rows) -> Result<(), LawError> {
        command.fill(if (time_s * self.0).rem_euclid(2.0) < 1.0 { 1.0 } else { -1.0 });
        Ok(())
    }
}

#[test]
fn a_physics_step_that_needs_too_many_solver_steps_ends() {
    let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]));
    let scenario = Scenario::new("switching", start, Formation::line(2, 3.0), 2.0, 1.0);
    let mut end = scenario.start.clone();
    let mut advance = |rate_hz: f64| {
        let mut path = Path::default();
        Continuous::new(&scenario).advance((0.0, 0.1), &mut Switching(rate_hz), &mut end, &mut path)
    };
    assert_eq!(advance(20.0), Ok(None));
    assert!(matches!(advance(1e6), Err(IdealError::Stalled { .. })));
}
