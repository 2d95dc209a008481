//! Measured violations between the positions that were sent.

use nalgebra::Vector3;

use crate::{monitor, settings};
use tautline_watch::{Bound, Event, Monitor, Pair, Pose, Settings, State, TimeBase, Violation};

fn replay(monitor: &mut Monitor, poses: &[(f64, &str, f64, f64)]) -> Vec<Violation<Pair>> {
    let mut ended = Vec::new();
    let mut note = |monitor: &mut Monitor| {
        ended.extend(monitor.drain_events().filter_map(|event| match event {
            Event::Ended(of) => Some(of),
            _ => None,
        }));
    };
    for &(t_s, id, x, y) in poses {
        monitor.take(&Pose { t_s, id, position_m: Vector3::new(x, y, 0.0), velocity_m_s: None, accuracy_m: None }, t_s);
        monitor.assess(t_s);
        note(monitor);
    }
    monitor.finish(f64::NAN);
    note(monitor);
    ended
}

fn stamps() -> Settings {
    Settings {
        time_base: TimeBase::Stamps,
        accel_m_s2: Bound::declared(100.0),
        max_age_s: Bound::declared(2.0),
        ..settings()
    }
}

#[test]
fn a_violation_between_two_positions_is_found() {
    // They pass at 0.6 m at 0.5 s, 6.03 m apart at both samples.
    let poses = [(0.0, "a", -3.0, 0.0), (0.0, "b", 3.0, 0.6), (1.0, "a", 3.0, 0.0), (1.0, "b", -3.0, 0.6)];
    let found = replay(&mut monitor(stamps()), &poses);
    let [of] = found[..] else { panic!("{found:?}") };
    assert!((of.min_m - 0.6).abs() < 1e-12 && (of.min_at_s - 0.5).abs() < 1e-12, "{of:?}");
    assert!((of.from_s - (0.5 - 0.8 / 12.0)).abs() < 1e-12, "{of:?}");
    // Negative twin: 1.1 m is no violation.
    let apart = poses.map(|(t_s, id, x, y)| (t_s, id, x, y * 1.1 / 0.6));
    assert_eq!(replay(&mut monitor(stamps()), &apart), []);
}

#[test]
fn stamps_of_different_rates_are_judged_at_common_times() {
    // `b` sends each second, `a` ten times as often; they pass at 0.2 m at 0.55 s.
    let mut poses = vec![(0.0, "b", 0.0, 0.2)];
    for k in 0..=20 {
        let t_s = f64::from(k) / 10.0;
        poses.push((t_s, "a", 20.0 * (t_s - 0.55), 0.0));
        if k % 10 == 0 && k > 0 {
            poses.push((t_s, "b", 0.0, 0.2));
        }
    }
    let found = replay(&mut monitor(stamps()), &poses);
    let [of] = found[..] else { panic!("{found:?}") };
    assert!((of.min_m - 0.2).abs() < 1e-9 && (of.min_at_s - 0.55).abs() < 1e-9, "{of:?}");
}

#[test]
fn a_gap_beyond_the_largest_age_is_not_judged_and_not_clear() {
    let mut monitor = monitor(Settings { max_age_s: Bound::declared(0.5), ..stamps() });
    let poses = [(0.0, "a", -3.0, 0.0), (0.0, "b", 3.0, 0.6), (1.0, "a", 3.0, 0.0), (1.0, "b", -3.0, 0.6)];
    let mut states = Vec::new();
    for (t_s, id, x, y) in poses {
        monitor.take(&Pose { t_s, id, position_m: Vector3::new(x, y, 0.0), velocity_m_s: None, accuracy_m: None }, t_s);
        states.push(monitor.assess(t_s).state);
    }
    assert!(states[..3].iter().all(|state| matches!(state, State::Undecided(_))), "{states:?}");
    assert_eq!(monitor.violations(), 0);
}
