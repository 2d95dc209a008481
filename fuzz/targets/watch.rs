//! Judges arbitrary bytes as live input: lines, a MAVLink datagram or a message of rosbridge, named by the target.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tautline_watch::source::{
    Input, MavlinkFrame, Naming, NamingOptions, OwnedPose, pose_of_line, poses_of_datagram, poses_of_message,
};
use tautline_watch::{ClockScope, Monitor, Plan, Pose, Settings, State};

fuzz_target!(|bytes: &[u8]| {
    let mut poses: Vec<OwnedPose> = Vec::new();
    match env!("CARGO_BIN_NAME") {
        "watch_lines" => poses.extend(bytes.split(|&byte| byte == b'\n').filter_map(|line| pose_of_line(line).ok())),
        "watch_mavlink" => {
            let mut inputs = Vec::new();
            poses_of_datagram(bytes, &MavlinkFrame::Local, 0.0, &mut inputs);
            poses.extend(inputs.into_iter().filter_map(|input| match input {
                Input::Pose(pose, _) => Some(pose),
                _ => None,
            }));
        }
        "watch_rosbridge" => {
            let text = String::from_utf8_lossy(bytes);
            let mut naming = Naming::new(NamingOptions::default());
            poses.extend(poses_of_message(&text, &mut naming).into_iter().flatten().flatten());
        }
        other => panic!("{other}: no such source"),
    }
    judge(&poses);
});

/// Judges the poses as they arrive, and checks that no assessment is clear while two vehicles are too near.
fn judge(poses: &[OwnedPose]) {
    let settings = Settings { clocks: ClockScope::PerVehicle, ..Settings::default() };
    let delta_m = settings.delta_m;
    let mut monitor = Monitor::new(settings, Plan::default()).expect("the default settings are valid");
    for (number, pose) in poses.iter().enumerate() {
        let arrival_s = 0.01 * number as f64;
        let pose = Pose { t_s: pose.t_s, id: &pose.id, position_m: pose.position_m, velocity_m_s: pose.velocity_m_s };
        monitor.take(&pose, arrival_s);
        let assessment = monitor.assess(arrival_s);
        let newest: Vec<_> = (0..monitor.names().len()).filter_map(|vehicle| monitor.newest(vehicle)).collect();
        let is_near = newest
            .iter()
            .enumerate()
            .any(|(index, (p, ..))| newest[..index].iter().any(|(q, ..)| (p - q).norm() < delta_m));
        assert!(!(is_near && assessment.state == State::Clear), "clear, but two vehicles are too near");
    }
    monitor.finish(0.01 * poses.len() as f64);
}
