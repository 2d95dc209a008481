//! What a recording of others holds: its topics with positions, its frames, and who is told of twice.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::super::error::{Fault, Place, ReadError, quoted};
use super::messages::{EARTH, Seen, What, Who};
use super::rigid::Placed;
use super::schemas::reader_of_topic;
use super::splits::Splits;
use super::tree::{Body, Tree, is_carrier};
use crate::record::mcap::topic::{Message, Part};

/// A topic with positions.
#[derive(Debug, Default)]
pub(super) struct Told {
    pub(super) schema: String,
    /// Frames that its positions are given in.
    pub(super) frames: BTreeSet<String>,
    /// The vehicles that its messages name.
    names: BTreeSet<String>,
    /// The robot's own frame, in odometry.
    child: Option<String>,
    /// Whether the topic itself is a vehicle.
    is_vehicle: bool,
}

/// What a first look at all messages finds.
#[derive(Debug, Default)]
pub(super) struct Outline {
    /// Frames, by the namespace of the topics that tell of them.
    pub(super) trees: BTreeMap<String, Tree>,
    /// Topics with positions, without those of transforms.
    pub(super) topics: BTreeMap<String, Told>,
    /// Topics of transforms that move.
    transforms: BTreeSet<String>,
    /// Topics with a message that says its time.
    pub(super) stamped: BTreeSet<String>,
    /// The first position on the Earth, in degrees and metres.
    pub(super) first_fix: Option<Vector3<f64>>,
}

/// Whether a topic holds transforms that never change.
pub(super) fn is_static(topic: &str) -> bool {
    topic.rsplit('/').next() == Some("tf_static")
}

/// The namespace of a topic, without its last part: `/cf1` of `/cf1/pose`.
pub(super) fn namespace(topic: &str) -> &str {
    topic.rsplit_once('/').map_or("", |(before, _)| before)
}

/// What is read of a message, and where the message is.
pub(super) fn seen_in(message: &Message<'_>, number: &mut u64) -> Result<Vec<Seen>, ReadError> {
    let Some(reader) = reader_of_topic(message.of) else { return Ok(Vec::new()) };
    *number += 1;
    reader(&message.of.encoding, message.bytes).map_err(|reason| Fault::Damaged(reason).at(place(*number, message)))
}

/// Where a message is.
pub(super) fn place(number: u64, message: &Message<'_>) -> Place {
    Place::Part(format!("message {number} on topic `{}`", message.of.topic))
}

impl Outline {
    /// Looks at all messages.
    pub(super) fn of(splits: &mut Splits) -> Result<Self, ReadError> {
        let (mut outline, mut number) = (Self::default(), 0);
        splits.visit_all(|part| {
            let Part::Message(message) = part else { return Ok(()) };
            for seen in seen_in(&message, &mut number)? {
                outline.learn(&message, seen).map_err(|fault| fault.at(place(number, &message)))?;
            }
            Ok(())
        })?;
        Ok(outline)
    }

    fn learn(&mut self, message: &Message<'_>, seen: Seen) -> Result<(), Fault> {
        let topic = &message.of.topic;
        if seen.stamp_ns != 0 && !self.stamped.contains(topic) {
            self.stamped.insert(topic.clone());
        }
        if let (What::Transform(turn), Who::Named(child)) = (&seen.what, &seen.who) {
            let still = is_static(topic).then_some(Placed { position: seen.position, turn: *turn });
            if still.is_none() && !self.transforms.contains(topic) {
                self.transforms.insert(topic.clone());
            }
            return self.trees.entry(namespace(topic).to_owned()).or_default().learn(child, &seen.frame, still);
        }
        if seen.frame == EARTH && self.first_fix.is_none() {
            self.first_fix = Some(seen.position);
        }
        let told = self.topics.entry(topic.clone()).or_default();
        told.schema.clone_from(&message.of.schema);
        if !told.frames.contains(&seen.frame) {
            told.frames.insert(seen.frame);
        }
        match seen.who {
            Who::Topic => told.is_vehicle = true,
            Who::Named(name) => drop(told.names.insert(name)),
            Who::Listed(_) => {}
        }
        let What::Odometry(child) = seen.what else { return Ok(()) };
        if let Some(known) = told.child.as_ref().filter(|known| **known != child) {
            let problem = format!("it is the odometry of {}, and of {} before", quoted(&child), quoted(known));
            return Err(Fault::content(problem, "record each robot on a topic of its own"));
        }
        told.child = Some(child);
        Ok(())
    }

    /// The frames that a topic speaks of, and their namespace: the nearest one that is around the topic.
    pub(super) fn tree_of(&self, topic: &str) -> Option<(&str, &Tree)> {
        let around =
            |space: &str| topic.strip_prefix(space).is_some_and(|rest| rest.starts_with('/') || space.is_empty());
        let nearest = self.trees.iter().filter(|(space, _)| around(space)).max_by_key(|(space, _)| space.len());
        nearest.map(|(space, tree)| (space.as_str(), tree))
    }

    /// Names of all topics with positions, those of transforms last.
    pub(super) fn names(&self) -> Vec<String> {
        self.topics.keys().chain(&self.transforms).cloned().collect()
    }

    /// Whether some of these topics tell of the frames of a namespace.
    pub(super) fn is_told_by(&self, space: &str, topics: &[String]) -> bool {
        self.transforms.iter().any(|topic| namespace(topic) == space && topics.contains(topic))
    }

    /// Refuses topics that tell of one vehicle twice, of those that are read.
    pub(super) fn refuse_twice(&self, reads: impl Fn(&str) -> bool) -> Result<(), Fault> {
        let read: Vec<_> = self.topics.iter().filter(|(topic, _)| reads(topic)).collect();
        for (k, (first, one)) in read.iter().enumerate() {
            for (second, other) in &read[k + 1..] {
                if let Some(who) = told_twice((first, one), (second, other)) {
                    let problem = format!("topics {} and {} both tell of {who}", quoted(first), quoted(second));
                    let remedy = "say which is read with --topic NAME, once for each topic that is";
                    return Err(Fault::content(problem, remedy));
                }
            }
        }
        Ok(())
    }

    /// Refuses positions of several robots in frames of the same name that each robot has of its own, as a rule.
    pub(super) fn refuse_own_frames(&self, reads: impl Fn(&str) -> bool) -> Result<(), Fault> {
        let mut known: BTreeMap<&str, &str> = BTreeMap::new();
        for (topic, told) in self.topics.iter().filter(|(topic, told)| told.is_vehicle && reads(topic)) {
            for frame in told.frames.iter().filter(|frame| is_own(frame)) {
                let Some(first) = known.insert(frame, topic) else { continue };
                let problem = format!(
                    "topics {} and {} give positions in a frame {}, of which each robot has one of its own as a rule",
                    quoted(first),
                    quoted(topic),
                    quoted(frame)
                );
                let remedy = format!("say --frame {frame} if it is one frame, or name one that transforms lead into");
                return Err(Fault::content(problem, remedy));
            }
        }
        Ok(())
    }

    /// Whether topics of poses tell of a vehicle of the transforms in a namespace.
    pub(super) fn is_covered(&self, space: &str, body: &Body) -> bool {
        let last = |path: &str| path.rsplit('/').next().unwrap_or_default().to_owned();
        let robot = body.frame.rsplit_once('/').map(|(robot, _)| last(robot));
        let mut called: Vec<String> = robot.into_iter().chain([body.frame.clone(), last(space)]).collect();
        called.retain(|name| !name.is_empty());
        let is_same = |tree: &Tree, child: &str| {
            let above = |low: &str, high: &str| tree.way_up(low).is_ok_and(|way| way.contains(&high));
            above(child, &body.frame) || above(&body.frame, child)
        };
        self.topics.iter().any(|(topic, told)| {
            let names_it = called.iter().any(|name| told.names.contains(name));
            let in_its_name = told.is_vehicle && called.contains(&last(namespace(topic)));
            let odometry = told
                .child
                .as_ref()
                .is_some_and(|child| self.tree_of(topic).is_some_and(|(of, tree)| of == space && is_same(tree, child)));
            names_it || in_its_name || odometry
        })
    }
}

/// Whether each robot has a frame of this name of its own.
fn is_own(frame: &str) -> bool {
    let frame = frame.to_lowercase();
    is_carrier(&frame) && frame.split(|c: char| !c.is_alphanumeric()).any(|word| word == "odom")
}

/// Whom two topics both tell of.
fn told_twice((first, one): (&str, &Told), (second, other): (&str, &Told)) -> Option<String> {
    if let Some(name) = one.names.intersection(&other.names).next() {
        return Some(quoted(name));
    }
    for ((topic, alone), many) in [((first, one), other), ((second, other), one)] {
        let parts = topic.rsplit('/').take(2);
        if let Some(name) = parts.filter(|_| alone.is_vehicle).find(|part| many.names.contains(*part)) {
            return Some(quoted(name));
        }
    }
    let both = one.is_vehicle && other.is_vehicle && one.schema != other.schema;
    let (space, same) = (namespace(first), namespace(first) == namespace(second));
    (both && same).then(|| if space.is_empty() { "the same robot".to_owned() } else { quoted(space) })
}
