//! Judges arbitrary bytes as live input.
//!
//! The variable `TAUTLINE_FUZZ` names the source: `watch-lines`, `watch-mavlink` (a datagram) or `watch-rosbridge` (a
//! message).

#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tautline_watch::source::{
    Input, MavlinkFrame, MavlinkReader, Naming, NamingOptions, input_of_line, inputs_of_message,
};
use tautline_watch::{ClockScope, Monitor, Plan, Settings, State};

static SOURCE: LazyLock<String> =
    LazyLock::new(|| std::env::var("TAUTLINE_FUZZ").expect("TAUTLINE_FUZZ: the name of a source, such as watch-lines"));

fuzz_target!(|bytes: &[u8]| {
    let mut inputs = Vec::new();
    match SOURCE.as_str() {
        "watch-lines" => {
            let lines = bytes.split(|&byte| byte == b'\n');
            inputs.extend(lines.filter_map(|line| input_of_line(line, 0.0).ok()));
        }
        "watch-mavlink" => MavlinkReader::new(MavlinkFrame::Local).take(bytes, 0.0, &mut inputs),
        "watch-rosbridge" => {
            let text = String::from_utf8_lossy(bytes);
            let mut naming = Naming::new(NamingOptions::default());
            // A message without a position adds none.
            let _ = inputs_of_message(&text, &mut naming, 0.0, &mut inputs);
        }
        other => panic!("{other}: no such source"),
    }
    judge(&inputs);
});

/// Judges the inputs, which arrive 10 ms apart. Checks that no assessment is clear while two vehicles are too near.
fn judge(inputs: &[Input]) {
    let settings = Settings { clocks: Some(ClockScope::PerVehicle), ..Settings::default() };
    let delta_m = settings.delta_m;
    let mut monitor = Monitor::new(settings, Plan::default()).expect("the default settings are valid");
    // Vehicles that signed off are no longer judged.
    let mut has_sign_off = false;
    for (number, input) in inputs.iter().enumerate() {
        let arrival_s = 0.01 * number as f64;
        match input {
            Input::Pose(pose, _) => {
                monitor.take(&pose.borrowed(), arrival_s);
            }
            Input::TwoStreams(id, _) => monitor.two_streams(id, arrival_s),
            Input::Plan(message) => {
                // A plan that cannot be used changes nothing.
                let _ = monitor.take_plan(message);
            }
            Input::SignOff(id, t_s, _) => has_sign_off |= monitor.sign_off(id, *t_s, arrival_s),
            _ => {}
        }
        let assessment = monitor.assess(arrival_s);
        let newest: Vec<_> = (0..monitor.names().len()).filter_map(|vehicle| monitor.newest(vehicle)).collect();
        let is_near = newest
            .iter()
            .enumerate()
            .any(|(index, (p, ..))| newest[..index].iter().any(|(q, ..)| (p - q).norm() < delta_m));
        assert!(has_sign_off || !(is_near && assessment.state == State::Clear), "clear, but two vehicles are too near");
    }
    monitor.finish(0.01 * inputs.len() as f64);
}
