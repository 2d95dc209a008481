//! Tests of the monitor and its sources.

mod bounds;
mod foxglove;
mod input;
mod past;
mod plans;
mod session;
mod sign_off;
mod simulation;
mod streams;

use nalgebra::Vector3;
use tautline_watch::{Assessment, Bound, Monitor, Plan, Pose, Settings};

/// Settings of most tests: delta 1 m, and small errors.
fn settings() -> Settings {
    Settings {
        delta_m: 1.0,
        accel_m_s2: Bound::declared(5.0),
        position_error_m: Some(Bound::declared(0.01)),
        velocity_error_m_s: Bound::declared(0.02),
        ..Settings::default()
    }
}

fn monitor(settings: Settings) -> Monitor {
    Monitor::new(settings, Plan::default()).expect("valid settings")
}

/// Takes the pose of a vehicle at rest.
fn rest(monitor: &mut Monitor, id: &str, t_s: f64, x_m: f64, arrival_s: f64) {
    let pose = Pose {
        t_s,
        id,
        position_m: Vector3::new(x_m, 0.0, 2.0),
        velocity_m_s: Some(Vector3::zeros()),
        accuracy_m: None,
    };
    monitor.take(&pose, arrival_s);
}

/// Returns the seconds from the present until which everything is clear.
fn clear_for_s(of: &Assessment) -> Option<f64> {
    of.clear_until.map(|until| until.at_s - of.now_s)
}
