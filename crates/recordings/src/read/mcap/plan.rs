//! Decides which data of a foreign recording are read, and how they are transformed to one frame.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Vector3};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::ORIGIN;

use super::super::convention;
use super::super::earth::EarthFrame;
use super::super::error::{ContentKind, Fault, ReadError, quoted, refuse};
use super::super::options::{MessageClock, ReadOptions};
use super::messages::{EARTH, PoseKind, VehicleKey};
use super::outline::{Outline, choose_topics, is_static, place, refuse_local_frames, space};
use super::split::SplitFiles;
use super::tree::{Chain, FramePose, TransformAt, Tree, VehicleFrame};
use crate::mcap::topic::Part;

/// Data to read, and their transforms.
pub(super) struct ReadPlan {
    pub(super) outline: Outline,
    /// Frame to which all positions are transformed.
    pub(super) target_frame: Option<String>,
    /// Local frame of places on the Earth, if there are any.
    pub(super) earth: Option<EarthFrame>,
    /// Transforms from each frame in use to the requested frame, by namespace and frame; `None` without a
    /// connection.
    chains: BTreeMap<String, BTreeMap<String, Option<Chain>>>,
    /// Vehicles of the transforms, by namespace and driver.
    bodies: BTreeMap<String, BTreeMap<String, Vec<VehicleFrame>>>,
    /// Clock of all positions.
    pub(super) clock: MessageClock,
    is_clock_given: bool,
    notes: Vec<String>,
}

/// Transform of a position to the requested frame.
pub(super) enum Conversion {
    /// No transforms connect the frames.
    None,
    /// A transform is unknown at that time.
    Unknown,
    By(TransformAt),
}

impl Conversion {
    fn of(known: Option<TransformAt>) -> Self {
        known.map_or(Self::Unknown, Self::By)
    }
}

impl ReadPlan {
    /// Decides which messages are used, by the outline of all.
    pub(super) fn of(outline: Outline, splits: &mut SplitFiles, options: &ReadOptions) -> Result<Self, ReadError> {
        let first_fix = outline.first_fix;
        let origin = options.origin.map(Vector3::from).or(first_fix).filter(|_| first_fix.is_some());
        let mut plan = Self {
            target_frame: options.frame.clone(),
            earth: origin.map(EarthFrame::at).transpose()?,
            chains: BTreeMap::new(),
            bodies: BTreeMap::new(),
            clock: MessageClock::Stamp,
            is_clock_given: options.clock.is_some(),
            notes: Vec::new(),
            outline,
        };
        if first_fix.is_some() {
            convention::refuse_known(options, "a recording with places on the Earth")?;
        }
        if options.origin.is_some() && first_fix.is_none() {
            return refuse(ContentKind::UnusedOption, "it has no place on the Earth", format!("omit {ORIGIN}"));
        }
        plan.check()?;
        plan.find_bodies()?;
        if plan.target_frame.is_none() {
            let bodies = plan.bodies.iter().flat_map(|(space, bodies)| {
                bodies.values().flatten().map(|body| (space.as_str(), body.carrier.as_str()))
            });
            refuse_local_frames(plan.outline.given_in().chain(bodies))?;
        }
        let needed = plan.find_chains()?;
        plan.clock = plan.decide_clock(&needed, options.clock)?;
        plan.gather(&needed, splits)?;
        Ok(plan)
    }

    fn check(&self) -> Result<(), Fault> {
        self.outline.refuse_unknown()?;
        self.outline.refuse_twice()?;
        self.outline.refuse_setpoints()
    }

    /// Finds the vehicles of the transforms, unless pose topics describe them.
    fn find_bodies(&mut self) -> Result<(), Fault> {
        let is_chosen = !self.outline.named.is_empty();
        let beside_poses = !is_chosen && !self.outline.topics.is_empty();
        let (coverage, mut covered, mut uncovered) = (self.outline.coverage(), Vec::new(), Vec::new());
        for (space, tree) in &self.outline.trees {
            if is_chosen && !self.outline.is_read_from_named(space) {
                continue;
            }
            let bodies = tree.bodies()?;
            if beside_poses {
                for body in bodies {
                    let group = if coverage.holds(space, tree, &body) { &mut covered } else { &mut uncovered };
                    group.push(body.frame);
                }
                continue;
            }
            let vehicles: BTreeSet<_> = bodies.iter().map(|body| body.frame.as_str()).collect();
            let others: Vec<_> = tree.frames().filter(|frame| tree.moves(frame) && !vehicles.contains(frame)).collect();
            self.notes.extend(note_of(&bodies, &others));
            let in_space = self.bodies.entry(space.clone()).or_default();
            for body in bodies {
                in_space.entry(body.driver.clone()).or_default().push(body);
            }
        }
        if let Some(name) = uncovered.first() {
            let problem = format!("transforms describe {}, but topics of poses describe other vehicles", quoted(name));
            let known = self.outline.names().join(", ");
            let remedy = format!("{}; it has {known}", choose_topics());
            return refuse(ContentKind::AmbiguousTopics, problem, remedy);
        }
        if !covered.is_empty() {
            let covered = covered.join(", ");
            self.notes.push(format!(
                "transforms of these vehicles are not read, because topics of poses describe them: {covered}"
            ));
        }
        Ok(())
    }

    /// Finds the transforms from all frames to the requested one. Returns the moving ones that must be known at all
    /// times, by namespace.
    fn find_chains(&mut self) -> Result<BTreeMap<String, BTreeSet<String>>, Fault> {
        let mut ways: Vec<(String, String, String, Option<String>)> = Vec::new();
        for (space, drivers) in &self.bodies {
            for body in drivers.values().flatten() {
                let into = self.target_frame.as_ref().unwrap_or(&body.carrier);
                ways.push((space.clone(), body.frame.clone(), into.clone(), Some(body.driver.clone())));
            }
        }
        if let Some(target_frame) = &self.target_frame {
            for (topic, described) in &self.outline.topics {
                let Some((space, _)) = self.outline.tree_of(topic) else { continue };
                let others = described.frames.iter().filter(|frame| *frame != target_frame && *frame != EARTH);
                ways.extend(others.map(|frame| (space.to_owned(), frame.clone(), target_frame.clone(), None)));
            }
        }
        let mut needed: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (space, frame, into, driver) in ways {
            let tree = &self.outline.trees[&space];
            let chain = tree.chain(&frame, &into)?;
            // A vehicle has one pose per sample of its driver, which need not be interpolated.
            let moving = chain
                .iter()
                .flat_map(Chain::frames)
                .filter(|child| tree.moves(child) && Some(*child) != driver.as_ref());
            needed.entry(space.clone()).or_default().extend(moving.cloned());
            self.chains.entry(space).or_default().insert(frame, chain);
        }
        Ok(needed)
    }

    /// Decides which clock gives the times of all positions.
    fn decide_clock(
        &self,
        needed: &BTreeMap<String, BTreeSet<String>>,
        given: Option<MessageClock>,
    ) -> Result<MessageClock, Fault> {
        self.outline.clocks.decide(given, |topic, frame| {
            if frame.is_empty() {
                return self.outline.topics.contains_key(topic).then_some(true);
            }
            let space = space(topic);
            if self.bodies_of(space, frame).is_some() {
                return Some(true);
            }
            // Publishers of other frames may date their transforms forward.
            needed.get(space).filter(|frames| frames.contains(frame)).map(|_| false)
        })
    }

    /// Stores the moving transforms that must be known at all times.
    fn gather(
        &mut self,
        needed: &BTreeMap<String, BTreeSet<String>>,
        splits: &mut SplitFiles,
    ) -> Result<(), ReadError> {
        if needed.values().all(BTreeSet::is_empty) {
            return Ok(());
        }
        let mut number = 0;
        splits.visit_all(|part| {
            let Part::Message(message) = part else { return Ok(()) };
            let topic = &message.of.topic;
            let space = space(topic);
            for observation in self.outline.observations_in(&message, &mut number)? {
                let (PoseKind::Transform(turn), VehicleKey::Named(child)) = (observation.kind, observation.vehicle)
                else {
                    continue;
                };
                if is_static(topic) || !needed.get(space).is_some_and(|frames| frames.contains(&child)) {
                    continue;
                }
                let time_ns = self.time_of(observation.stamp_ns, message.log_ns);
                let placed = FramePose { position: observation.position, turn };
                let tree = self.outline.trees.entry(space.to_owned()).or_default();
                tree.store(&child, time_ns, &placed).map_err(|fault| fault.at(place(number, &message)))?;
            }
            Ok(())
        })?;
        for tree in self.outline.trees.values_mut() {
            tree.settle()?;
        }
        Ok(())
    }

    /// Returns the time of a message \[ns\].
    pub(super) fn time_of(&self, stamp_ns: i64, log_ns: u64) -> i64 {
        match self.clock {
            MessageClock::Stamp => stamp_ns,
            MessageClock::Log => i64::try_from(log_ns).unwrap_or(i64::MAX),
        }
    }

    /// Returns the vehicles whose poses follow from the transforms of a frame.
    pub(super) fn bodies_of(&self, space: &str, driver: &str) -> Option<&Vec<VehicleFrame>> {
        self.bodies.get(space)?.get(driver)
    }

    /// Returns the transforms from a frame to the requested one.
    fn chain(&self, space: &str, frame: &str) -> Option<&Chain> {
        self.chains.get(space)?.get(frame)?.as_ref()
    }

    /// Returns the transform of poses of a topic from a frame to the requested one.
    pub(super) fn conversion_of(&self, topic: &str, frame: &str, time_ns: i64) -> Result<Conversion, Fault> {
        let Some((space, tree)) = self.outline.tree_of(topic) else { return Ok(Conversion::None) };
        self.chain(space, frame)
            .map_or(Ok(Conversion::None), |chain| Ok(Conversion::of(tree.transform_along(chain, time_ns, None)?)))
    }

    /// Returns the transform of a vehicle of the transforms, given the pose of its driver. A vehicle that carries the
    /// requested frame has none.
    pub(super) fn conversion_of_vehicle(
        &self,
        space: &str,
        body: &VehicleFrame,
        driver: Isometry3<f64>,
        time_ns: i64,
    ) -> Result<Conversion, Fault> {
        let chain = self.chain(space, &body.frame).filter(|chain| chain.contains_upward(&body.driver));
        let transform_along =
            |chain| self.outline.trees[space].transform_along(chain, time_ns, Some((&body.driver, driver)));
        chain.map_or(Ok(Conversion::None), |chain| Ok(Conversion::of(transform_along(chain)?)))
    }

    /// Returns the fault of a recording without positions.
    pub(super) fn none(&self) -> Fault {
        let trees = || self.outline.trees.values();
        match &self.target_frame {
            Some(frame) => {
                let problem = format!("no position is in the frame {}, nor can be transformed to it", quoted(frame));
                let remedy = "name another frame, or record /tf and /tf_static from before the first position";
                Fault::content(ContentKind::UnusableFrame, problem, remedy)
            }
            None if trees().any(|tree| tree.frames().any(|frame| tree.moves(frame))) => {
                let frames: Vec<_> = trees().flat_map(Tree::frames).map(quoted).collect();
                let problem = format!("its transforms describe no vehicle; its frames are {}", frames.join(", "));
                let remedy = "record the transforms of the vehicles' own frames too";
                Fault::content(ContentKind::NoPositions, problem, remedy)
            }
            None => Fault::content(
                ContentKind::NoPositions,
                "its topics with positions have no messages with one",
                "record again",
            ),
        }
    }

    /// Returns the local frame of places on the Earth, if these are read.
    pub(super) fn local(&self) -> Option<EarthFrame> {
        self.earth.filter(|_| self.target_frame.is_none())
    }

    /// Returns the facts on clock, vehicles, heights and the requested frame.
    pub(super) fn facts(&self) -> Vec<Fact> {
        let (clock, source) = match (self.clock, self.is_clock_given) {
            (MessageClock::Stamp, false) => ("stamps of messages", Source::Recorded),
            (MessageClock::Log, false) => ("log times, because no message has a stamp", Source::Deduced),
            (MessageClock::Stamp, true) => ("stamps of messages", Source::Declared),
            (MessageClock::Log, true) => ("log times", Source::Declared),
        };
        let source_of_names = if self.outline.named.is_empty() { Source::Deduced } else { Source::Declared };
        let mut facts = vec![
            Fact::name(FactKind::Clock, source, clock),
            Fact::name(FactKind::Identity, source_of_names, "topics, and names in messages"),
        ];
        facts.extend(self.target_frame.as_ref().map(|frame| Fact::name(FactKind::Frame, Source::Declared, frame)));
        if self.local().is_some() {
            facts.push(Fact::name(FactKind::HeightUnit, Source::Convention, "m"));
            facts.push(Fact::name(FactKind::HeightReference, Source::Convention, "ellipsoid"));
        }
        facts
    }

    /// Returns the notes for the user.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = self.notes.clone();
        notes.extend(self.local().map(|local| local.note()));
        if self.outline.topics.values().any(|described| described.schema == "nav_msgs/msg/Odometry") {
            let why = "publishers differ on their frame";
            notes.push(format!("velocities of odometry are not used: {why}"));
        }
        let bodies: BTreeSet<_> =
            self.bodies.values().flat_map(|bodies| bodies.values().flatten()).map(|body| &*body.frame).collect();
        let fixed = self.outline.trees.values().flat_map(Tree::fixed_frames);
        let fixed: BTreeSet<_> = fixed.filter(|frame| !bodies.contains(frame)).collect();
        if !fixed.is_empty() {
            let fixed: Vec<_> = fixed.into_iter().collect();
            notes.push(format!("constant frames of tf_static are not vehicles: {}", fixed.join(", ")));
        }
        let setpoints: Vec<_> = self.outline.setpoints().collect();
        if !setpoints.is_empty() {
            let setpoints = setpoints.join(", ");
            notes.push(format!("these topics have names of setpoints, not of measured positions: {setpoints}"));
        }
        notes.extend(self.left_out());
        notes
    }

    /// Returns the note on data without a transform to the requested frame.
    fn left_out(&self) -> Option<String> {
        let target_frame = self.target_frame.as_ref()?;
        let mut left_out = Vec::new();
        for (topic, described) in &self.outline.topics {
            let leads =
                |frame: &str| self.outline.tree_of(topic).is_some_and(|(space, _)| self.chain(space, frame).is_some());
            let unconnected = described.frames.iter().filter(|frame| *frame != target_frame && !leads(frame));
            left_out.extend(unconnected.map(|frame| format!("{topic} in {frame}")));
        }
        for (space, body) in
            self.bodies.iter().flat_map(|(space, bodies)| bodies.values().flatten().map(move |body| (space, body)))
        {
            if !self.chain(space, &body.frame).is_some_and(|chain| chain.contains_upward(&body.driver)) {
                left_out.push(body.frame.clone());
            }
        }
        let (target_frame, list) = (quoted(target_frame), left_out.join(", "));
        (!left_out.is_empty()).then(|| format!("not read, because no transforms lead to {target_frame}: {list}"))
    }
}

/// Returns the note on vehicles among the moving frames, if other frames move too.
fn note_of(bodies: &[VehicleFrame], others: &[&str]) -> Option<String> {
    let vehicles: Vec<_> = bodies.iter().map(|body| body.frame.as_str()).collect();
    let (vehicles, carriers) = (vehicles.join(", "), others.join(", "));
    (!others.is_empty())
        .then(|| format!("vehicles by transforms: {vehicles}; frames that carry them or belong to them: {carriers}"))
}
