//! What is read of a recording of others, and how it comes into one frame.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Vector3};

use super::super::axes;
use super::super::earth::Local;
use super::super::error::{Fault, ReadError, quoted, refuse};
use super::super::options::ReadOptions;
use super::foreign::Splits;
use super::messages::{EARTH, What, Who};
use super::outline::{Outline, is_static, place, refuse_own_frames, space};
use super::tree::{Body, Chain, Known, Placed, Tree};
use crate::mcap::topic::Part;

/// What is read, and how.
pub(super) struct Plan {
    pub(super) outline: Outline,
    /// The frame that all is brought into.
    pub(super) wanted: Option<String>,
    /// The frame of places on the Earth, where there are some.
    pub(super) earth: Option<Local>,
    /// The transforms from each frame that is read, by namespace and frame; none where they do not lead to the frame
    /// that is asked for.
    chains: BTreeMap<String, BTreeMap<String, Option<Chain>>>,
    /// Vehicles of the transforms, by namespace and driver.
    bodies: BTreeMap<String, BTreeMap<String, Vec<Body>>>,
    notes: Vec<String>,
}

/// What brings a position into the frame that is asked for.
pub(super) enum Way {
    /// No transforms lead there.
    None,
    /// Transforms lead there, and one of them is not known then.
    NotThen,
    By(Known),
}

impl Way {
    fn of(known: Option<Known>) -> Self {
        known.map_or(Self::NotThen, Self::By)
    }
}

impl Plan {
    /// Looks at all messages and decides what is read of them.
    pub(super) fn of(splits: &mut Splits, options: &ReadOptions) -> Result<Self, ReadError> {
        let outline = Outline::of(splits, &options.topics)?;
        let first_fix = outline.first_fix;
        let origin = options.origin.map(Vector3::from).or(first_fix).filter(|_| first_fix.is_some());
        let mut plan = Self {
            wanted: options.frame.clone(),
            earth: origin.map(Local::at).transpose()?,
            chains: BTreeMap::new(),
            bodies: BTreeMap::new(),
            notes: Vec::new(),
            outline,
        };
        if first_fix.is_some() {
            axes::refuse_known(options, "a recording with places on the Earth")?;
        }
        if options.origin.is_some() && first_fix.is_none() {
            return refuse("recording/unused-option", "it has no place on the Earth", "leave --origin away");
        }
        plan.check()?;
        plan.find_bodies()?;
        if plan.wanted.is_none() {
            let bodies = plan
                .bodies
                .iter()
                .flat_map(|(space, of)| of.values().flatten().map(|body| (space.as_str(), body.carrier.as_str())));
            refuse_own_frames(plan.outline.given_in().chain(bodies))?;
        }
        let needed = plan.find_chains()?;
        plan.gather(&needed, splits)?;
        Ok(plan)
    }

    fn check(&self) -> Result<(), Fault> {
        let known = self.outline.names();
        if let Some(name) = self.outline.named.iter().find(|topic| !known.contains(topic)) {
            let problem =
                format!("it has no topic {} with positions; those that it has are {}", quoted(name), known.join(", "));
            return refuse("recording/unknown-topic", problem, "name one of these with --topic");
        }
        self.outline.refuse_twice()?;
        self.outline.refuse_wishes()
    }

    /// Finds the vehicles of the transforms, unless topics of poses tell of them.
    fn find_bodies(&mut self) -> Result<(), Fault> {
        let is_chosen = !self.outline.named.is_empty();
        let beside_poses = !is_chosen && !self.outline.topics.is_empty();
        let (cover, mut covered, mut uncovered) = (self.outline.cover(), Vec::new(), Vec::new());
        for (space, tree) in &self.outline.trees {
            if is_chosen && !self.outline.is_told_by_named(space) {
                continue;
            }
            let bodies = tree.bodies()?;
            if beside_poses {
                for body in bodies {
                    let of = if cover.holds(space, tree, &body) { &mut covered } else { &mut uncovered };
                    of.push(body.frame);
                }
                continue;
            }
            let vehicles: BTreeSet<_> = bodies.iter().map(|body| body.frame.as_str()).collect();
            let others: Vec<_> = tree.frames().filter(|frame| tree.moves(frame) && !vehicles.contains(frame)).collect();
            self.notes.extend(note_of(&bodies, &others));
            let of = self.bodies.entry(space.clone()).or_default();
            for body in bodies {
                of.entry(body.driver.clone()).or_default().push(body);
            }
        }
        if let Some(name) = uncovered.first() {
            let problem = format!("transforms tell of {}, and topics of poses tell of other vehicles", quoted(name));
            let known = self.outline.names().join(", ");
            let remedy = format!("say which topics are read with --topic NAME, once for each; it has {known}");
            return refuse("recording/ambiguous-topics", problem, remedy);
        }
        if !covered.is_empty() {
            let covered = covered.join(", ");
            self.notes.push(format!(
                "topics of poses tell of these vehicles, and transforms too, which are not read: {covered}"
            ));
        }
        Ok(())
    }

    /// Finds the transforms from all frames into the one that is asked for, and says which moving ones have to be known
    /// at all times: by namespace.
    fn find_chains(&mut self) -> Result<BTreeMap<String, BTreeSet<String>>, Fault> {
        let mut ways: Vec<(String, String, String, Option<String>)> = Vec::new();
        for (space, drivers) in &self.bodies {
            for body in drivers.values().flatten() {
                let into = self.wanted.as_ref().unwrap_or(&body.carrier);
                ways.push((space.clone(), body.frame.clone(), into.clone(), Some(body.driver.clone())));
            }
        }
        if let Some(wanted) = &self.wanted {
            for (topic, told) in &self.outline.topics {
                let Some((space, _)) = self.outline.tree_of(topic) else { continue };
                let others = told.frames.iter().filter(|frame| *frame != wanted && *frame != EARTH);
                ways.extend(others.map(|frame| (space.to_owned(), frame.clone(), wanted.clone(), None)));
            }
        }
        let mut needed: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (space, frame, into, driver) in ways {
            let tree = &self.outline.trees[&space];
            let chain = tree.chain(&frame, &into)?;
            // A vehicle is seen with each sample of its driver, which need not be known in between.
            let moving = chain
                .iter()
                .flat_map(Chain::frames)
                .filter(|child| tree.moves(child) && Some(*child) != driver.as_ref());
            needed.entry(space.clone()).or_default().extend(moving.cloned());
            self.chains.entry(space).or_default().insert(frame, chain);
        }
        Ok(needed)
    }

    /// Remembers the moving transforms that have to be known at all times.
    fn gather(&mut self, needed: &BTreeMap<String, BTreeSet<String>>, splits: &mut Splits) -> Result<(), ReadError> {
        if needed.values().all(BTreeSet::is_empty) {
            return Ok(());
        }
        let mut number = 0;
        splits.visit_all(|part| {
            let Part::Message(message) = part else { return Ok(()) };
            let topic = &message.of.topic;
            let space = space(topic);
            for seen in self.outline.seen_in(&message, &mut number)? {
                let (What::Transform(turn), Who::Named(child)) = (seen.what, seen.who) else { continue };
                if is_static(topic) || !needed.get(space).is_some_and(|frames| frames.contains(&child)) {
                    continue;
                }
                let time_ns = self.time_of(topic, seen.stamp_ns, message.log_ns);
                let placed = Placed { position: seen.position, turn };
                let tree = self.outline.trees.entry(space.to_owned()).or_default();
                tree.remember(&child, time_ns, &placed).map_err(|fault| fault.at(place(number, &message)))?;
            }
            Ok(())
        })?;
        for tree in self.outline.trees.values_mut() {
            tree.settle()?;
        }
        Ok(())
    }

    /// When a message speaks of \[ns\]. A stamp of 0 is a time like any other on a topic with other stamps.
    pub(super) fn time_of(&self, topic: &str, stamp_ns: i64, log_ns: u64) -> i64 {
        if self.outline.stamped.contains(topic) { stamp_ns } else { i64::try_from(log_ns).unwrap_or(i64::MAX) }
    }

    /// The vehicles that are seen with the transforms of a frame.
    pub(super) fn bodies_of(&self, space: &str, driver: &str) -> Option<&Vec<Body>> {
        self.bodies.get(space)?.get(driver)
    }

    /// The transforms that lead from a frame to where all is brought.
    fn chain(&self, space: &str, frame: &str) -> Option<&Chain> {
        self.chains.get(space)?.get(frame)?.as_ref()
    }

    /// What brings poses of a topic from a frame into the one that is asked for.
    pub(super) fn bring(&self, topic: &str, frame: &str, time_ns: i64) -> Result<Way, Fault> {
        let Some((space, tree)) = self.outline.tree_of(topic) else { return Ok(Way::None) };
        self.chain(space, frame).map_or(Ok(Way::None), |chain| Ok(Way::of(tree.along(chain, time_ns, None)?)))
    }

    /// The same for a vehicle of the transforms, of whose driver it is known where it is then. Of a vehicle that carries the
    /// frame that is asked for nothing is known there.
    pub(super) fn bring_body(
        &self,
        space: &str,
        body: &Body,
        driver: Isometry3<f64>,
        time_ns: i64,
    ) -> Result<Way, Fault> {
        let chain = self.chain(space, &body.frame).filter(|chain| chain.leads_up_over(&body.driver));
        let along = |chain| self.outline.trees[space].along(chain, time_ns, Some((&body.driver, driver)));
        chain.map_or(Ok(Way::None), |chain| Ok(Way::of(along(chain)?)))
    }

    /// The fault of a recording without a position.
    pub(super) fn none(&self) -> Fault {
        let trees = || self.outline.trees.values();
        match &self.wanted {
            Some(frame) => {
                let problem =
                    format!("no position is given in the frame {}, nor brought there by transforms", quoted(frame));
                Fault::coded(
                    "recording/unusable-frame",
                    problem,
                    "name another frame, or record /tf and /tf_static from before the first position on",
                )
            }
            None if trees().any(|tree| tree.frames().any(|frame| tree.moves(frame))) => {
                let frames: Vec<_> = trees().flat_map(Tree::frames).map(quoted).collect();
                let problem = format!("its transforms are of no vehicle: its frames are {}", frames.join(", "));
                Fault::coded(
                    "recording/no-positions",
                    problem,
                    "record the transforms of the vehicles' own frames as well",
                )
            }
            None => Fault::coded(
                "recording/no-positions",
                "no message of its topics with positions has one",
                "record again",
            ),
        }
    }

    /// The frame of places on the Earth, where these are read.
    pub(super) fn local(&self) -> Option<Local> {
        self.earth.filter(|_| self.wanted.is_none())
    }

    /// What a person should know.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = self.notes.clone();
        notes.extend(self.local().map(|local| local.note()));
        if self.outline.topics.values().any(|told| told.schema == "nav_msgs/msg/Odometry") {
            let why = "publishers differ on the frame that they are given in";
            notes.push(format!("velocities of odometry are not used: {why}"));
        }
        let bodies: BTreeSet<_> =
            self.bodies.values().flat_map(|of| of.values().flatten()).map(|body| &*body.frame).collect();
        let fixed = self.outline.trees.values().flat_map(Tree::still);
        let fixed: BTreeSet<_> = fixed.filter(|frame| !bodies.contains(frame)).collect();
        if !fixed.is_empty() {
            let fixed: Vec<_> = fixed.into_iter().collect();
            notes.push(format!("frames of tf_static stand still and are no vehicles: {}", fixed.join(", ")));
        }
        let wishes: Vec<_> = self.outline.wishes().collect();
        if !wishes.is_empty() {
            let wishes = wishes.join(", ");
            notes.push(format!(
                "these topics tell by their names where somebody is asked to be, not where a vehicle is: {wishes}"
            ));
        }
        notes.extend(self.left_out());
        notes
    }

    /// What is not read because nothing leads into the frame that is asked for.
    fn left_out(&self) -> Option<String> {
        let wanted = self.wanted.as_ref()?;
        let mut left_out = Vec::new();
        for (topic, told) in &self.outline.topics {
            let leads =
                |frame: &str| self.outline.tree_of(topic).is_some_and(|(space, _)| self.chain(space, frame).is_some());
            let strays = told.frames.iter().filter(|frame| *frame != wanted && !leads(frame));
            left_out.extend(strays.map(|frame| format!("{topic} in {frame}")));
        }
        for (space, body) in
            self.bodies.iter().flat_map(|(space, of)| of.values().flatten().map(move |body| (space, body)))
        {
            if !self.chain(space, &body.frame).is_some_and(|chain| chain.leads_up_over(&body.driver)) {
                left_out.push(body.frame.clone());
            }
        }
        let (wanted, list) = (quoted(wanted), left_out.join(", "));
        (!left_out.is_empty()).then(|| format!("not read, since no transforms lead from there into {wanted}: {list}"))
    }
}

/// Which frames are vehicles, where some that move are none.
fn note_of(bodies: &[Body], others: &[&str]) -> Option<String> {
    let vehicles: Vec<_> = bodies.iter().map(|body| body.frame.as_str()).collect();
    let (vehicles, carriers) = (vehicles.join(", "), others.join(", "));
    (!others.is_empty())
        .then(|| format!("vehicles, going by transforms: {vehicles}; what carries them or hangs on them: {carriers}"))
}
