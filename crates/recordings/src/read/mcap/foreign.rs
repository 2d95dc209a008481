//! Reads MCAP recordings of other programs: consecutive files, and poses transformed to one frame.

use nalgebra::{Point3, Vector3};
use tautline_core::fact::{self, Fact, FactKind};
use tautline_core::option::{FRAME, PLAN_END, TOPIC};

use super::super::clock::Stamp;
use super::super::earth::{is_no_fix, no_fixes};
use super::super::error::{ContentKind, Fault, Place, ReadError, UNSEEN, quoted, refuse};
use super::super::identity::Names;
use super::super::options::{Duplicates, MessageClock, ReadOptions};
use super::super::order::{Findings, Ordered, Recording, RecordingInfo, Row, Rows};
use super::super::source::Source;
use super::super::time_unit::TimeUnit;
use super::messages::{EARTH, Observation, PoseKind, VehicleKey, is_list, reader_of_topic};
use super::outline::{Outline, is_static, place, space};
use super::plan::{Conversion, ReadPlan};
use super::planned::PlannerCurves;
use super::split::SplitFiles;
use super::tree::{FramePose, TransformAt};
use crate::mcap::topic::{Message, Part};

/// Opens a recording in consecutive files; `whole` is the source named in errors.
pub(super) fn open(whole: &Source, mut splits: SplitFiles, options: &ReadOptions) -> Result<Recording, ReadError> {
    let outline = Outline::of(&mut splits, &options.topics)?;
    let has_poses = outline.pose_topics().any(|topic| options.topics.is_empty() || options.topics.contains(topic));
    let curves = match PlannerCurves::read(&outline, &mut splits)? {
        Some(curves) if !has_poses => return curves.flown(options, splits.notes.clone()),
        curves => curves,
    };
    if options.plan_end.is_some() && curves.is_none() {
        return refuse(ContentKind::UnusedOption, "it has no plans of a planner", format!("omit {PLAN_END}"));
    }
    let plan = ReadPlan::of(outline, &mut splits, options)?;
    let none = plan.none();
    let mut info = RecordingInfo::new(whole, options, Some(TimeUnit::Nanoseconds), splits.notes.clone(), none);
    info.metadata.earth_origin = plan.local().map(|local| local.measured_from(options.origin));
    // Duplicates of messages indicate overlapping files and are refused by default.
    info.options.duplicates = options.duplicates.or(Some(Duplicates::Refuse));
    let foreign = ForeignRows { splits, poses: Poses::new(plan), listed: true, shown: Vec::new(), starts: Vec::new() };
    let positions = Box::new(Ordered::open(foreign, info)?);
    match curves {
        Some(curves) => curves.beside(positions, options),
        None => Ok(positions),
    }
}

/// Rows of a foreign recording.
struct ForeignRows {
    splits: SplitFiles,
    poses: Poses,
    /// Whether all topics hold lists of poses.
    listed: bool,
    /// Displayed names of the vehicles.
    shown: Vec<String>,
    /// Number of messages before each file.
    starts: Vec<u64>,
}

impl Rows for ForeignRows {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let (poses, listed) = (&mut self.poses, &mut self.listed);
        let (files, messages) = (self.splits.opened_files(), poses.messages);
        let more = self.splits.visit(|part| {
            match part {
                Part::Message(message) => poses.take(&message, rows)?,
                Part::Topic(topic) => *listed &= is_list(&topic.schema) || reader_of_topic(topic).is_none(),
                Part::Schema(..) | Part::Other => {}
            }
            Ok(())
        })?;
        if self.splits.opened_files() > files {
            self.starts.push(messages);
        }
        Ok(more)
    }

    fn rewind(&mut self) -> Result<(), ReadError> {
        self.splits.rewind();
        self.poses.rewind();
        self.starts.clear();
        Ok(())
    }

    fn vehicles(&self) -> &[String] {
        &self.shown
    }

    /// Names the poses of a single topic by their numbers alone.
    fn settle_names(&mut self) {
        let names = &mut self.poses.names;
        let plain: Option<Vec<(&str, u64)>> = names
            .all()
            .iter()
            .map(|name| name.rsplit_once('/').and_then(|(topic, number)| Some((topic, number.parse().ok()?))))
            .collect();
        match plain {
            Some(plain) if plain.windows(2).all(|pair| pair[0].0 == pair[1].0) && self.listed => {
                self.shown = plain.iter().map(|(_, number)| number.to_string()).collect();
            }
            _ => {
                names.settle();
                self.shown = names.all().to_vec();
            }
        }
    }

    fn findings(&self) -> Findings {
        (self.poses.notes(), self.poses.facts())
    }

    fn place(&self, number: u64) -> Place {
        Place::Part(format!("message {number} with positions"))
    }

    fn file(&self, number: u64) -> usize {
        self.starts.partition_point(|start| *start < number)
    }

    fn is_wide(&self) -> bool {
        false
    }
}

/// Converter of messages to positions.
pub(super) struct Poses {
    plan: ReadPlan,
    /// Frame of all positions so far, and the topic of its first occurrence.
    frame: Option<(String, String)>,
    /// Name of each vehicle: topic and index, or frame.
    pub(super) names: Names,
    /// Vehicle of the last row.
    vehicle: usize,
    pub(super) messages: u64,
    /// Number of positions without a fix.
    no_fixes: u64,
    conversions: ConversionCounts,
}

/// Number of positions transformed to the requested frame, by accuracy.
#[derive(Clone, Copy, Default)]
struct ConversionCounts {
    /// By transforms at the time of the position.
    exact: u64,
    /// By a transform interpolated between two samples.
    interpolated: u64,
    /// Omitted, because a transform is unknown at that time.
    unknown: u64,
}

impl Poses {
    pub(super) fn new(plan: ReadPlan) -> Self {
        let conversions = ConversionCounts::default();
        Self { plan, frame: None, names: Names::default(), vehicle: 0, messages: 0, no_fixes: 0, conversions }
    }

    /// Restarts at the first message.
    pub(super) fn rewind(&mut self) {
        (self.messages, self.no_fixes, self.conversions) = (0, 0, ConversionCounts::default());
    }

    /// Appends the rows of a message.
    pub(super) fn take(&mut self, message: &Message<'_>, rows: &mut Vec<Row>) -> Result<(), ReadError> {
        for observation in self.plan.outline.observations_in(message, &mut self.messages)? {
            self.append(observation, message, rows).map_err(|fault| fault.at(place(self.messages, message)))?;
        }
        Ok(())
    }

    fn append(&mut self, observation: Observation, message: &Message<'_>, rows: &mut Vec<Row>) -> Result<(), Fault> {
        let topic = &message.of.topic;
        let time_ns = self.plan.time_of(observation.stamp_ns, message.log_ns);
        if let PoseKind::Transform(turn) = observation.kind {
            return if is_static(topic) {
                Ok(())
            } else {
                self.append_bodies(&observation, turn, topic, time_ns, rows)
            };
        }
        check_finite(&observation.position)?;
        if observation.frame == EARTH && is_no_fix(&observation.position) {
            self.no_fixes += 1;
            return Ok(());
        }
        let Some(position) = self.position(&observation, topic, time_ns)? else { return Ok(()) };
        let name = match observation.vehicle {
            VehicleKey::Topic => topic.clone(),
            VehicleKey::Listed(number) => format!("{topic}/{number}"),
            VehicleKey::Named(name) => name,
        };
        self.push(&name, time_ns, position, rows)
    }

    /// Returns a pose in the requested frame; `None` if it cannot be transformed.
    fn position(
        &mut self,
        observation: &Observation,
        topic: &str,
        time_ns: i64,
    ) -> Result<Option<Vector3<f64>>, Fault> {
        let Some(target_frame) = &self.plan.target_frame else {
            self.check_frame(&observation.frame, topic)?;
            let local = self.plan.earth.filter(|_| observation.frame == EARTH);
            return local.map_or(Ok(observation.position), |local| local.place(observation.position)).map(Some);
        };
        if target_frame == EARTH {
            let problem = format!("{EARTH} is not a metric frame: its positions are latitudes and longitudes");
            let remedy = format!("omit {FRAME}, or name a frame of poses; choose topics with {TOPIC}");
            return refuse(ContentKind::UnusableFrame, problem, remedy);
        }
        if *target_frame == observation.frame {
            return Ok(Some(observation.position));
        }
        let way = self.plan.conversion_of(topic, &observation.frame, time_ns)?;
        let known = self.conversions.count(&way);
        Ok(known.map(|known| known.transform.transform_point(&Point3::from(observation.position)).coords))
    }

    /// Appends the vehicles whose poses follow from a transform.
    fn append_bodies(
        &mut self,
        observation: &Observation,
        turn: [f64; 4],
        topic: &str,
        time_ns: i64,
        rows: &mut Vec<Row>,
    ) -> Result<(), Fault> {
        let space = space(topic);
        let VehicleKey::Named(driver) = &observation.vehicle else { return Ok(()) };
        let Some(bodies) = self.plan.bodies_of(space, driver).cloned() else { return Ok(()) };
        check_finite(&observation.position)?;
        if self.plan.target_frame.is_none() {
            self.check_frame(&observation.frame, topic)?;
        }
        for body in bodies {
            let is_there = body.frame == *driver
                && self.plan.target_frame.as_ref().is_none_or(|target_frame| *target_frame == observation.frame);
            let position = if is_there {
                Some(observation.position)
            } else {
                let placed = FramePose { position: observation.position, turn }.rigid()?;
                let way = self.plan.conversion_of_vehicle(space, &body, placed, time_ns)?;
                self.conversions.count(&way).map(|known| known.transform.translation.vector)
            };
            let Some(position) = position else { continue };
            let several = self.plan.outline.trees.len() > 1;
            let name = if several && !space.is_empty() { format!("{space}/{}", body.frame) } else { body.frame };
            self.push(&name, time_ns, position, rows)?;
        }
        Ok(())
    }

    fn push(&mut self, name: &str, time_ns: i64, position: Vector3<f64>, rows: &mut Vec<Row>) -> Result<(), Fault> {
        self.vehicle = self.names.index(name)?;
        let (stamp, vehicle) = (Stamp::Whole(time_ns), self.vehicle);
        rows.push(Row { stamp, place: self.messages, vehicle, position, velocity: None, radius: None });
        Ok(())
    }

    /// Refuses a position in another frame than the earlier ones.
    fn check_frame(&mut self, frame: &str, topic: &str) -> Result<(), Fault> {
        match &self.frame {
            None => self.frame = Some((frame.to_owned(), topic.to_owned())),
            Some((known, _)) if known == frame => {}
            Some((known, first)) => {
                let (known, first, frame) = (quoted(known), quoted(first), quoted(frame));
                let problem =
                    format!("positions are in the frame {known} on topic {first}, but in the frame {frame} here");
                let remedy =
                    format!("name the frame to which all are transformed, or the only one to read, with {FRAME}");
                return refuse(ContentKind::SeveralFrames, problem, remedy);
            }
        }
        Ok(())
    }

    /// Returns the facts on clock, vehicles, frame and transforms.
    pub(super) fn facts(&self) -> Vec<Fact> {
        let mut facts = self.plan.facts();
        if let Some((frame, _)) = &self.frame
            && frame != EARTH
        {
            facts.push(Fact::name(FactKind::Frame, fact::Source::Recorded, frame));
        }
        if self.plan.clock == MessageClock::Log {
            facts.push(Fact::new(FactKind::LogTimes, fact::Source::Default));
        }
        if self.conversions.interpolated > 0 {
            facts.push(Fact::new(FactKind::UniformTransforms, fact::Source::Default));
        }
        facts
    }

    /// Returns the notes for the user.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = self.plan.notes();
        notes.extend(no_fixes(self.no_fixes, ""));
        let ConversionCounts { exact, interpolated, unknown } = self.conversions;
        if exact + interpolated + unknown > 0 {
            let into =
                self.plan.target_frame.as_deref().map_or_else(String::new, |frame| format!(" into {}", quoted(frame)));
            notes.push(format!(
                "positions transformed{into}: {exact} by transforms at their time, {interpolated} by interpolation \
                 between two samples at most 1 s apart; {unknown} omitted because a transform is unknown"
            ));
        }
        notes
    }
}

impl ConversionCounts {
    /// Counts a position; returns its transform.
    fn count(&mut self, way: &Conversion) -> Option<TransformAt> {
        match way {
            Conversion::None => return None,
            Conversion::Unknown => self.unknown += 1,
            Conversion::By(TransformAt { interpolated: true, .. }) => self.interpolated += 1,
            Conversion::By(_) => self.exact += 1,
        }
        if let Conversion::By(known) = way { Some(*known) } else { None }
    }
}

fn check_finite(position: &Vector3<f64>) -> Result<(), Fault> {
    match position.iter().find(|x| !x.is_finite()) {
        Some(odd) => Err(Fault::not_finite("position", &odd.to_string(), UNSEEN)),
        None => Ok(()),
    }
}
