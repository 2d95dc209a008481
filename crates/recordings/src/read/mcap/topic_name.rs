//! What the name of a topic says of it.

/// Words of topics that tell where somebody is asked to be, and not where a vehicle is: of MAVROS
/// (`setpoint_position/local`), PX4 (`trajectory_setpoint`), Crazyswarm2 (`cmd_full_state`), Aerostack2
/// (`motion_reference/pose`), planners, and what is clicked in a viewer.
const WISHES: [&str; 20] = [
    "clicked",
    "cmd",
    "command",
    "commanded",
    "des",
    "desired",
    "goal",
    "initialpose",
    "plan",
    "planned",
    "planner",
    "planning",
    "predicted",
    "ref",
    "reference",
    "setpoint",
    "sp",
    "target",
    "waypoint",
    "wp",
];

/// Whether a topic holds transforms that never change.
pub(super) fn is_static(topic: &str) -> bool {
    last(topic) == "tf_static"
}

/// The namespace of a topic, without its last part: `/cf1` of `/cf1/pose`.
pub(super) fn namespace(topic: &str) -> &str {
    topic.rsplit_once('/').map_or("", |(before, _)| before)
}

/// The last part of a name.
pub(super) fn last(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or_default()
}

/// The namespace that a topic of transforms speaks of: `/r1` of `/r1/tf`, and the common one of a topic called otherwise.
pub(super) fn space(topic: &str) -> &str {
    if matches!(last(topic), "tf" | "tf_static") { namespace(topic) } else { "" }
}

/// Whether a name says that it is of what somebody is asked to do: it has a word of it, in the singular or the plural.
pub(super) fn is_wish(name: &str) -> bool {
    let is_one = |word: &str| WISHES.contains(&word) || word.strip_suffix('s').is_some_and(|one| WISHES.contains(&one));
    words(name).split(' ').any(is_one)
}

/// The words of a name in small letters, with a blank between two: of `/cf1/goalPose` these are `cf1 goal pose`.
fn words(name: &str) -> String {
    let (mut words, mut before) = (String::new(), ' ');
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_ascii_lowercase() {
            words.push(' ');
        }
        words.push(if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' });
        before = c;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::is_wish;

    #[test]
    fn a_wish_is_no_vehicle_and_a_vehicle_no_wish() {
        let wishes = [
            "/cf1/goal_pose",
            "/cf1/cmd_full_state",
            "/uav/Setpoint",
            "/uav/pose_ref",
            "/uav1/targetPose",
            "/uav1/mavros/setpoint_position/local",
            "/mavros/setpoints_position/local",
            "/uav1/mavros/setpoint_raw/target_local",
            "/fmu/in/trajectory_setpoint",
            "/drone0/motion_reference/pose",
            "/firefly/command/pose",
            "/move_base_simple/goal",
            "/target/pose",
        ];
        for name in wishes {
            assert!(is_wish(name), "{name}");
        }
        let vehicles = [
            "/cf1/pose",
            "/drones/goalkeeper",
            "/target1/pose",
            "/uav1/mavros/local_position/pose",
            "/fmu/out/vehicle_local_position",
            "/drone0/self_localization/pose",
            "/firefly/ground_truth/pose",
            "/airplane/odom",
            "/spot/odometry",
        ];
        for name in vehicles {
            assert!(!is_wish(name), "{name}");
        }
    }
}
