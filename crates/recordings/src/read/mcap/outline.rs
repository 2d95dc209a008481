//! Outline of a foreign MCAP recording: topics with positions, their frames, and vehicles described by several topics.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::super::earth::is_no_fix;
use super::super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::super::heading::Words;
use super::clocks::Clocks;
use super::definition::is_curve;
use super::messages::{EARTH, FIXES, Observation, PoseKind, VehicleKey, is_of_transforms, reader_of_topic};
use super::split::SplitFiles;
use super::tree::{FramePose, Tree, VehicleFrame};
use crate::mcap::topic::{DeclaredTopic, Message, Part};
use tautline_core::option::{FRAME, TOPIC};

/// Largest number of topic parts searched for a namespace of transforms.
const DEEPEST: usize = 16;

/// Returns the remedy for an ambiguous choice of topics.
pub(super) fn choose_topics() -> String {
    format!("choose the topics to read with {}, once per topic", TOPIC.set("NAME"))
}

/// Topic with positions.
#[derive(Debug, Default)]
pub(super) struct PoseTopic {
    pub(super) schema: String,
    /// Frames of its positions.
    pub(super) frames: BTreeSet<String>,
    /// Names of vehicles in its messages.
    names: BTreeSet<String>,
    /// Robot frame of odometry.
    child: Option<String>,
    /// Whether the topic is a vehicle.
    is_vehicle: bool,
    /// Number of poses in its lists, whose vehicles are identified by index.
    listed: usize,
}

/// Result of a first pass over all messages.
#[derive(Debug, Default)]
pub(super) struct Outline {
    /// Topics named by the user; if empty, all are read.
    pub(super) named: Vec<String>,
    /// Frames, by the namespace of their transform topics.
    pub(super) trees: BTreeMap<String, Tree>,
    /// Topics with positions that are read, except transforms.
    pub(super) topics: BTreeMap<String, PoseTopic>,
    /// Topics with positions that are not read, because the user names others.
    unread: BTreeSet<String>,
    /// Topics of moving transforms.
    transforms: BTreeSet<String>,
    /// Stamps and log times of all sources of positions.
    pub(super) clocks: Clocks,
    /// Topics with curves of planners that are read.
    pub(super) curves: BTreeSet<String>,
    /// First position on the Earth \[degrees, m\].
    pub(super) first_fix: Option<Vector3<f64>>,
}

/// Returns the place of a message.
pub(super) fn place(number: u64, message: &Message<'_>) -> Place {
    Place::Part(format!("message {number} on topic `{}`", message.of.topic))
}

impl Outline {
    /// Reads all messages of the topics in `named`, or of all topics if it is empty, and all transforms.
    pub(super) fn of(splits: &mut SplitFiles, named: &[String]) -> Result<Self, ReadError> {
        let (mut outline, mut number) = (Self { named: named.to_vec(), ..Self::default() }, 0);
        splits.visit_all(|part| {
            let Part::Message(message) = part else { return Ok(()) };
            if is_curve(message.of) {
                let list = if outline.reads(message.of) { &mut outline.curves } else { &mut outline.unread };
                if !list.contains(&message.of.topic) {
                    list.insert(message.of.topic.clone());
                }
                return Ok(());
            }
            if !outline.reads(message.of) && reader_of_topic(message.of).is_some() {
                outline.unread.insert(message.of.topic.clone());
            }
            let all = outline.observations_in(&message, &mut number)?;
            outline.observe_stamps(&message, &all);
            let listed = all.iter().filter(|observation| matches!(observation.vehicle, VehicleKey::Listed(_))).count();
            let learnt = outline
                .count(&message, listed)
                .and_then(|()| all.into_iter().try_for_each(|observation| outline.learn(&message, observation)));
            learnt.map_err(|fault| fault.at(place(number, &message)))
        })?;
        outline.clocks.close();
        Ok(outline)
    }

    /// Records the stamps of a message. All poses of one message have one stamp, unless they are transforms.
    fn observe_stamps(&mut self, message: &Message<'_>, all: &[Observation]) {
        let topic = &message.of.topic;
        if is_static(topic) {
            return;
        }
        for observation in all {
            match (&observation.kind, &observation.vehicle) {
                (PoseKind::Transform(_), VehicleKey::Named(child)) => {
                    self.clocks.observe(topic, child, message.log_ns, observation.stamp_ns);
                }
                _ => return self.clocks.observe(topic, "", message.log_ns, observation.stamp_ns),
            }
        }
    }

    /// Returns whether the messages of a topic are read: transforms are always read, because frames may require them.
    fn reads(&self, topic: &DeclaredTopic) -> bool {
        self.named.is_empty() || self.named.contains(&topic.topic) || is_of_transforms(&topic.schema)
    }

    /// Decodes the positions of a message; `number` counts the messages that can have some.
    pub(super) fn observations_in(
        &self,
        message: &Message<'_>,
        number: &mut u64,
    ) -> Result<Vec<Observation>, ReadError> {
        let Some(reader) = reader_of_topic(message.of) else { return Ok(Vec::new()) };
        *number += 1;
        if !self.reads(message.of) {
            return Ok(Vec::new());
        }
        reader(&message.of.encoding, message.bytes).map_err(|reason| Fault::damaged(reason).at(place(*number, message)))
    }

    /// Records the number of poses in a list. Lists of different lengths do not identify vehicles and are refused. An
    /// empty list contains no vehicle.
    fn count(&mut self, message: &Message<'_>, listed: usize) -> Result<(), Fault> {
        if listed == 0 {
            return Ok(());
        }
        let described = self.topics.entry(message.of.topic.clone()).or_default();
        if described.listed != 0 && described.listed != listed {
            let problem = format!(
                "it lists {listed} poses, but earlier messages {}: indices then do not identify vehicles",
                described.listed
            );
            let remedy = format!(
                "record a pose of every vehicle in every list, or messages with names; if the list contains no \
                 vehicles, choose other topics with {TOPIC}"
            );
            return refuse(ContentKind::ListLength, problem, remedy);
        }
        described.listed = listed;
        Ok(())
    }

    fn learn(&mut self, message: &Message<'_>, observation: Observation) -> Result<(), Fault> {
        let topic = &message.of.topic;
        if let (PoseKind::Transform(turn), VehicleKey::Named(child)) = (&observation.kind, &observation.vehicle) {
            let fixed_pose = is_static(topic).then_some(FramePose { position: observation.position, turn: *turn });
            if fixed_pose.is_none() && !self.transforms.contains(topic) {
                self.transforms.insert(topic.clone());
            }
            self.trees.entry(space(topic).to_owned()).or_default().learn(child, &observation.frame, fixed_pose);
            return Ok(());
        }
        if observation.frame == EARTH && message.of.schema != FIXES {
            let problem = format!("its frame has the reserved name {}", quoted(EARTH));
            return refuse(ContentKind::UnusableFrame, problem, "rename the frame");
        }
        let described = self.topics.entry(topic.clone()).or_default();
        described.schema.clone_from(&message.of.schema);
        if observation.frame == EARTH && self.first_fix.is_none() && !is_no_fix(&observation.position) {
            self.first_fix = Some(observation.position);
        }
        if !described.frames.contains(&observation.frame) {
            described.frames.insert(observation.frame);
        }
        match observation.vehicle {
            VehicleKey::Topic => described.is_vehicle = true,
            VehicleKey::Named(name) => drop(described.names.insert(name)),
            VehicleKey::Listed(_) => {}
        }
        let PoseKind::Odometry(child) = observation.kind else { return Ok(()) };
        if let Some(known) = described.child.as_ref().filter(|known| **known != child) {
            let problem =
                format!("it is the odometry of {}, but earlier messages of {}", quoted(&child), quoted(known));
            return refuse(ContentKind::SeveralVehicles, problem, "record each robot on its own topic");
        }
        described.child = Some(child);
        Ok(())
    }

    /// Returns the transform tree for a topic, and its namespace: the innermost one that contains the topic.
    pub(super) fn tree_of(&self, topic: &str) -> Option<(&str, &Tree)> {
        let around = topic.rmatch_indices('/').map(|(index, _)| &topic[..index]).take(DEEPEST).chain([""]);
        let mut nearest = around.filter_map(|space| self.trees.get_key_value(space));
        nearest.next().map(|(space, tree)| (space.as_str(), tree))
    }

    /// Returns the names of all topics with positions, transforms last.
    pub(super) fn names(&self) -> Vec<String> {
        self.topics.keys().chain(&self.curves).chain(&self.unread).chain(&self.transforms).cloned().collect()
    }

    /// Returns the topics with positions that are read, transforms last.
    pub(super) fn pose_topics(&self) -> impl Iterator<Item = &String> {
        self.topics.keys().chain(&self.transforms)
    }

    /// Refuses a topic named by the user that the recording does not have.
    pub(super) fn refuse_unknown(&self) -> Result<(), Fault> {
        let known = self.names();
        let Some(name) = self.named.iter().find(|topic| !known.contains(topic)) else { return Ok(()) };
        let problem = format!("it has no topic {} with positions; such topics are {}", quoted(name), known.join(", "));
        refuse(ContentKind::UnknownTopic, problem, format!("choose one of these with {TOPIC}"))
    }

    /// Returns whether a topic named by the user has transforms of a namespace.
    pub(super) fn is_read_from_named(&self, target_frame: &str) -> bool {
        self.transforms.iter().any(|topic| space(topic) == target_frame && self.named.contains(topic))
    }

    /// Refuses two topics with one vehicle. Vehicles inferred from topic names are not compared if the user names the
    /// topics.
    pub(super) fn refuse_twice(&self) -> Result<(), Fault> {
        let is_chosen = !self.named.is_empty();
        let twice = |first: &str, second: &str, vehicle: &str| {
            let problem = format!("topics {} and {} both describe {vehicle}", quoted(first), quoted(second));
            let remedy = if is_chosen { format!("name only one of the two with {TOPIC}") } else { choose_topics() };
            Fault::content(ContentKind::AmbiguousTopics, problem, remedy)
        };
        let called = |space: &str| if space.is_empty() { "the same robot".to_owned() } else { quoted(space) };
        let (mut named, mut robots) = (BTreeMap::new(), BTreeMap::new());
        for (topic, described) in &self.topics {
            for name in &described.names {
                if let Some(first) = named.insert(name.as_str(), topic) {
                    return Err(twice(first, topic, &quoted(name)));
                }
            }
        }
        let mut lists = BTreeMap::new();
        for (topic, described) in self.topics.iter().filter(|_| !is_chosen) {
            if described.listed > 0
                && let Some(first) = lists.insert(robot_of(topic), topic)
            {
                return Err(twice(first, topic, "the same vehicles"));
            }
        }
        let mut whole_names: Vec<(Vec<String>, &String)> = Vec::new();
        for (topic, described) in self.topics.iter().filter(|(_, described)| described.is_vehicle) {
            if let Some((name, first)) = topic.rsplit('/').take(2).find_map(|part| named.get_key_value(part)) {
                return Err(twice(first, topic, &quoted(name)));
            }
            if is_chosen {
                continue;
            }
            let (robot, own_namespace) = (robot_of(topic), namespace(topic));
            let is_same = |(other, first): &&(Vec<String>, &String)| {
                let is_part = other.starts_with(&robot) || robot.starts_with(other);
                // In a namespace with a name, `/a/pose` is the robot `a`, and `/a/camera` belongs to it.
                *other == robot || (is_part && namespace(first) == own_namespace)
            };
            if let Some((_, first)) = whole_names.iter().find(is_same) {
                return Err(twice(first, topic, &called(own_namespace)));
            }
            whole_names.push((robot, topic));
            let (first, schema) = *robots.entry(own_namespace).or_insert((topic, &described.schema));
            if *schema != described.schema
                || (first != topic && [first, topic].iter().any(|topic| is_setpoint(last(topic))))
            {
                return Err(twice(first, topic, &called(own_namespace)));
            }
        }
        Ok(())
    }

    /// Refuses setpoint topics beside topics of measured positions, unless the user names the topics. Setpoints must
    /// not replace measured positions.
    pub(super) fn refuse_setpoints(&self) -> Result<(), Fault> {
        let mut others = self.topics.keys().chain(&self.transforms).filter(|topic| !is_setpoint(topic));
        let Some((setpoint, other)) = self.setpoints().next().zip(others.next()) else { return Ok(()) };
        let (setpoint, other) = (quoted(setpoint), quoted(other));
        let problem = format!("topic {setpoint} has the name of a setpoint, but {other} beside it does not");
        refuse(ContentKind::AmbiguousTopics, problem, choose_topics())
    }

    /// Returns the topics with names of setpoints, unless the user names the topics.
    pub(super) fn setpoints(&self) -> impl Iterator<Item = &str> {
        let interpolated = self.topics.keys().chain(&self.transforms).filter(|_| self.named.is_empty());
        interpolated.map(String::as_str).filter(|topic| is_setpoint(topic))
    }

    /// Returns the topics that are vehicles, with each frame of their positions.
    pub(super) fn given_in(&self) -> impl Iterator<Item = (&str, &str)> {
        let vehicles = self.topics.iter().filter(|(_, described)| described.is_vehicle);
        vehicles
            .flat_map(|(topic, described)| described.frames.iter().map(move |frame| (topic.as_str(), frame.as_str())))
    }

    /// Returns the vehicles that pose topics describe, for comparison with transforms.
    pub(super) fn coverage(&self) -> Coverage<'_> {
        let mut coverage = Coverage::default();
        for (topic, described) in &self.topics {
            coverage.names.extend(described.names.iter().map(String::as_str));
            coverage.names.extend(Some(last(namespace(topic))).filter(|name| described.is_vehicle && !name.is_empty()));
            let Some((child, (space, tree))) = described.child.as_deref().zip(self.tree_of(topic)) else { continue };
            coverage.children.insert((space, child));
            coverage.carriers.extend(tree.ancestry(child).into_iter().flatten().map(|frame| (space, frame)));
        }
        coverage
    }
}

/// Vehicles that pose topics describe.
#[derive(Default)]
pub(super) struct Coverage<'a> {
    /// Names in messages, and names of the namespaces of topics.
    names: BTreeSet<&'a str>,
    /// Odometry frames with their namespaces, and these frames with all frames above them.
    children: BTreeSet<(&'a str, &'a str)>,
    carriers: BTreeSet<(&'a str, &'a str)>,
}

impl Coverage<'_> {
    /// Returns whether a vehicle of the transforms in a namespace is among these.
    pub(super) fn holds(&self, space: &str, tree: &Tree, body: &VehicleFrame) -> bool {
        let robot = body.frame.rsplit_once('/').map_or("", |(robot, _)| last(robot));
        let is_named = [robot, &body.frame, last(space)].iter().any(|name| self.names.contains(name));
        let way = tree.ancestry(&body.frame);
        is_named
            || self.carriers.contains(&(space, &body.frame))
            || way.is_ok_and(|way| way.iter().any(|frame| self.children.contains(&(space, frame))))
    }
}

/// Refuses positions of several robots in frames that are usually local to each robot, such as `odom`. `given` holds
/// topics or frames with the frames of their positions.
pub(super) fn refuse_local_frames<'a>(given: impl Iterator<Item = (&'a str, &'a str)>) -> Result<(), Fault> {
    let has_odom = |frame: &str| frame.to_lowercase().split(|c: char| !c.is_alphanumeric()).any(|word| word == "odom");
    // Autopilots count local positions from the place of their start, and name the frame `map`.
    let is_own = |source_name: &str, frame: &str| has_odom(frame) || source_name.contains("local_position");
    let mut known: BTreeMap<&str, &str> = BTreeMap::new();
    for (source_name, frame) in given.filter(|(source_name, frame)| is_own(source_name, frame)) {
        let Some(first) = known.insert(frame, source_name).filter(|first| *first != source_name) else { continue };
        let (first, source_name, shown) = (quoted(first), quoted(source_name), quoted(frame));
        let problem = format!(
            "{first} and {source_name} give positions in a frame {shown}, which is usually local to each robot"
        );
        let common = FRAME.set(frame);
        let remedy = format!("confirm a common frame with {common}, or name a frame that transforms lead to");
        return refuse(ContentKind::SeveralFrames, problem, remedy);
    }
    Ok(())
}

/// Words in names of setpoint topics, which hold commanded instead of measured positions. Sources: MAVROS
/// (`setpoint_position/local`), PX4 (`trajectory_setpoint`), Crazyswarm2 (`cmd_full_state`), Aerostack2
/// (`motion_reference/pose`), planners, and clicks in viewers.
const SETPOINT_WORDS: Words = Words(
    "clicked cmd command commanded des desired goal initialpose plan planned planner planning predicted ref \
     reference setpoint sp target waypoint wp",
);

/// Words in names of topics that describe a measurement and no vehicle: quantities, their processing, sensors and
/// programs.
const MEASUREMENT_WORDS: Words = Words(concat!(
    "pose poses odom odometry pos position positions loc location locations coord coordinates point ",
    "points state states transform transforms fix fixes gps gnss navsat rtk global local ",
    "raw unfiltered filter filtered fused fusion estimate estimated estimates estimator est estimation measured ",
    "measurement measurements smooth smoothed corrected interpolated cov covariance with stamped current latest truth ",
    "ground gt true data msg msgs message info topic out output mavros fmu ",
    "px4 vicon mocap optitrack qualisys motive natnet vrpn ekf ekf2 ukf kf amcl ",
    "slam vio vins mapping localization localizer localisation self sensor enu ned ",
    "left right front rear primary secondary backup",
));

/// Returns the words of a topic that may name a robot: `cf1` of `/cf1/pose_raw` and of `/mocap/cf1`.
fn robot_of(topic: &str) -> Vec<String> {
    let words = words(topic);
    words.split(' ').filter(|word| !word.is_empty() && !MEASUREMENT_WORDS.contains(word)).map(str::to_owned).collect()
}

/// Returns whether a topic holds constant transforms.
pub(super) fn is_static(topic: &str) -> bool {
    last(topic) == "tf_static"
}

/// Returns the namespace of a topic, without its last part: `/cf1` of `/cf1/pose`.
pub(super) fn namespace(topic: &str) -> &str {
    topic.rsplit_once('/').map_or("", |(before, _)| before)
}

/// Returns the last part of a name.
pub(super) fn last(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or_default()
}

/// Returns the namespace of a transform topic: `/r1` of `/r1/tf`, and the root for other names.
pub(super) fn space(topic: &str) -> &str {
    if matches!(last(topic), "tf" | "tf_static") { namespace(topic) } else { "" }
}

/// Returns whether a name contains a word for setpoints, in the singular or the plural.
pub(super) fn is_setpoint(name: &str) -> bool {
    let is_one = |word: &str| {
        SETPOINT_WORDS.contains(word) || word.strip_suffix('s').is_some_and(|one| SETPOINT_WORDS.contains(one))
    };
    words(name).split(' ').any(is_one)
}

/// Splits a name into words in lower case, separated by blanks: `cf1 goal pose` for `/cf1/goalPose`.
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
    use super::*;

    #[test]
    fn local_frames_of_several_robots_are_refused() {
        let refused = |given: &[(&'static str, &'static str)]| refuse_local_frames(given.iter().copied()).is_err();
        assert!(refused(&[("/r1/pose", "odom"), ("/r2/pose", "odom")]));
        assert!(refused(&[("/uav1/mavros/local_position/pose", "map"), ("/uav2/mavros/local_position/pose", "map")]));
        assert!(!refused(&[("/r1/pose", "map"), ("/r2/pose", "map")]));
        assert!(!refused(&[("/r1/pose", "r1/odom"), ("/r2/pose", "r2/odom")]));
    }
}

#[cfg(test)]
mod topic_name_tests {
    use super::{is_setpoint, robot_of};

    #[test]
    fn robots_are_recognised_in_the_names_of_topics() {
        for (topic, robot) in [
            ("/a/pose", "a"),
            ("/a/pose_raw", "a"),
            ("/uav1/mavros/local_position/pose", "uav1"),
            ("/uav1/ground_truth/pose", "uav1"),
            ("/mocap/cf1", "cf1"),
            ("/swarm/alphaPose", "swarm alpha"),
            ("/swarm/pose1", "swarm pose1"),
            ("/amcl_pose", ""),
        ] {
            assert_eq!(robot_of(topic).join(" "), robot, "{topic}");
        }
    }

    #[test]
    fn setpoint_topics_are_recognised_by_name() {
        let setpoints = [
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
        for name in setpoints {
            assert!(is_setpoint(name), "{name}");
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
            assert!(!is_setpoint(name), "{name}");
        }
    }
}
