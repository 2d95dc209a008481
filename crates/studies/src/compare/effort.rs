//! What a flight costs: ways flown and commands given.

use tautline_core::record::{Event, RecordError, Sample, Sink, Step};
use tautline_core::swarm::{Rows, row};

/// Path length and control of a whole swarm, folded over every step of a flight, recorded or not. Its memory is that of one
/// state.
///
/// Where a step is flown in parts, the way between its ends counts as straight.
#[derive(Clone, Debug)]
pub struct Effort {
    before: Option<Before>,
    path_length_m: f64,
    total_control_m_s: f64,
}

/// The end of the step before.
#[derive(Clone, Debug)]
struct Before {
    time_s: f64,
    positions_m: Rows,
    control_m_s2: f64,
}

impl Effort {
    /// Nothing flown yet.
    #[must_use]
    pub fn new() -> Self {
        Self { before: None, path_length_m: 0.0, total_control_m_s: 0.0 }
    }

    /// Ways flown, summed over the vehicles \[m\].
    #[must_use]
    pub fn path_length_m(&self) -> f64 {
        self.path_length_m
    }

    /// Integral of |u| over the flight, by the trapezoidal rule over its steps, summed over the vehicles \[m/s\].
    #[must_use]
    pub fn total_control_m_s(&self) -> f64 {
        self.total_control_m_s
    }
}

impl Default for Effort {
    fn default() -> Self {
        Self::new()
    }
}

impl Sink for Effort {
    fn sample(&mut self, _sample: &Sample<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }

    fn step(&mut self, step: &Step<'_>) {
        let (time_s, positions_m) = (step.time_s, &step.swarm.positions_m);
        let command = (step.control.nrows() > 0).then(|| sum_of_norms(step.control, None));
        let Some(before) = &mut self.before else {
            let control_m_s2 = command.unwrap_or(0.0);
            self.before = Some(Before { time_s, positions_m: positions_m.clone(), control_m_s2 });
            return;
        };
        // What was commanded before is held where the law has no answer.
        let control_m_s2 = command.unwrap_or(before.control_m_s2);
        self.path_length_m += sum_of_norms(positions_m, Some(&before.positions_m));
        self.total_control_m_s += f64::midpoint(before.control_m_s2, control_m_s2) * (time_s - before.time_s);
        before.positions_m.copy_from(positions_m);
        (before.time_s, before.control_m_s2) = (time_s, control_m_s2);
    }
}

/// Sum of the lengths of all rows, or of their differences to those of another table, in the order of the rows.
fn sum_of_norms(rows: &Rows, from: Option<&Rows>) -> f64 {
    (0..rows.nrows()).map(|i| from.map_or_else(|| row(rows, i), |from| row(rows, i) - row(from, i)).norm()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Swarm;

    /// Two vehicles on circles of 1 m and 2 m, commanded t and 2 t m/s^2.
    fn seen(steps: u32) -> Effort {
        let mut effort = Effort::new();
        for k in 0..=steps {
            let time_s = f64::from(k) / f64::from(steps);
            let (y, x) = (std::f64::consts::TAU * time_s).sin_cos();
            let swarm = Swarm::at_rest(Rows::from_row_slice(&[x, y, 0.0, 2.0 * x, 2.0 * y, 0.0]));
            let control = Rows::from_row_slice(&[0.0, time_s, 0.0, 0.0, 0.0, -2.0 * time_s]);
            effort.step(&Step { time_s, swarm: &swarm, control: &control });
        }
        effort
    }

    #[test]
    fn ways_and_commands_of_all_vehicles_are_summed() {
        let effort = seen(1000);
        // Chords of 1000 parts are shorter than their arcs by a part of 1.6e-6.
        assert!((effort.path_length_m() / (3.0 * std::f64::consts::TAU) - 1.0).abs() < 2e-6);
        assert!((effort.total_control_m_s() - 1.5).abs() < 1e-12, "the trapezoidal rule is exact for a line");
        assert!(seen(4).path_length_m() < 0.91 * effort.path_length_m(), "few looks see less of a way");
    }

    #[test]
    fn an_end_that_is_told_twice_counts_once_and_a_law_without_an_answer_leaves_the_last_command() {
        let mut effort = seen(10);
        let (way_m, control_m_s) = (effort.path_length_m(), effort.total_control_m_s());
        let swarm = Swarm::at_rest(Rows::from_row_slice(&[1.0, 0.0, 0.0, 2.0, 0.0, 0.0]));
        let none = Rows::zeros(0);
        effort.step(&Step { time_s: 1.0, swarm: &swarm, control: &none });
        assert!((effort.path_length_m() - way_m).abs() < 1e-12 && effort.total_control_m_s() == control_m_s);
        effort.step(&Step { time_s: 1.5, swarm: &swarm, control: &none });
        assert!((effort.total_control_m_s() - control_m_s - 1.5).abs() < 1e-12);
        assert_eq!(Effort::default().path_length_m(), 0.0);
    }
}
