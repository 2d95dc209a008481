//! Positions out of messages, all in one frame.

use nalgebra::{Point3, Vector3};

use super::super::clock::Stamp;
use super::super::earth::{is_no_fix, no_fixes};
use super::super::error::{Fault, ReadError, UNSEEN, quoted};
use super::super::names::Names;
use super::super::rows::Row;
use super::messages::{EARTH, Seen, What, Who};
use super::outline::place;
use super::plan::{Plan, Way};
use super::rigid::{Known, Placed};
use super::topic_name::{is_static, space};
use crate::mcap::topic::Message;

/// Positions out of messages.
pub(super) struct Poses {
    plan: Plan,
    /// The frame of all positions so far, and the topic that it was met on.
    frame: Option<(String, String)>,
    /// Topic and place, or frame, of each vehicle.
    pub(super) names: Names,
    /// Vehicle of the last row.
    vehicle: usize,
    pub(super) messages: u64,
    /// Fixes that are none.
    no_fixes: u64,
    brought: Brought,
}

/// How many positions were brought into the frame that is asked for, and how.
#[derive(Clone, Copy, Default)]
struct Brought {
    /// By transforms of their very time.
    exactly: u64,
    /// By a transform between two of its samples.
    guessed: u64,
    /// Not at all, because a transform is not known then.
    unknown: u64,
}

impl Poses {
    pub(super) fn new(plan: Plan) -> Self {
        let brought = Brought::default();
        Self { plan, frame: None, names: Names::default(), vehicle: 0, messages: 0, no_fixes: 0, brought }
    }

    /// Starts again with the first message.
    pub(super) fn rewind(&mut self) {
        (self.messages, self.no_fixes, self.brought) = (0, 0, Brought::default());
    }

    /// Appends the rows of a message.
    pub(super) fn take(&mut self, message: &Message<'_>, rows: &mut Vec<Row>) -> Result<(), ReadError> {
        for seen in self.plan.outline.seen_in(message, &mut self.messages)? {
            self.append(seen, message, rows).map_err(|fault| fault.at(place(self.messages, message)))?;
        }
        Ok(())
    }

    fn append(&mut self, seen: Seen, message: &Message<'_>, rows: &mut Vec<Row>) -> Result<(), Fault> {
        let topic = &message.of.topic;
        let time_ns = self.plan.time_of(topic, seen.stamp_ns, message.log_ns);
        if let What::Transform(turn) = seen.what {
            return if is_static(topic) { Ok(()) } else { self.append_bodies(&seen, turn, topic, time_ns, rows) };
        }
        check_finite(&seen.position)?;
        if seen.frame == EARTH && is_no_fix(&seen.position) {
            self.no_fixes += 1;
            return Ok(());
        }
        let Some(position) = self.position(&seen, topic, time_ns)? else { return Ok(()) };
        let name = match seen.who {
            Who::Topic => topic.clone(),
            Who::Listed(number) => format!("{topic}/{number}"),
            Who::Named(name) => name,
        };
        self.push(&name, time_ns, position, rows)
    }

    /// A pose in the frame that all is brought into; none where it cannot be brought there.
    fn position(&mut self, seen: &Seen, topic: &str, time_ns: i64) -> Result<Option<Vector3<f64>>, Fault> {
        let Some(wanted) = &self.plan.wanted else {
            self.check_frame(&seen.frame, topic)?;
            let local = self.plan.earth.filter(|_| seen.frame == EARTH);
            return local.map_or(Ok(seen.position), |local| local.place(seen.position)).map(Some);
        };
        if wanted == EARTH {
            let problem = format!("{EARTH} is no frame of metres: places in it are latitudes and longitudes");
            return Err(Fault::coded(
                "recording/unusable-frame",
                problem,
                "leave --frame out, or name a frame of poses; --topic says which topics are read",
            ));
        }
        if *wanted == seen.frame {
            return Ok(Some(seen.position));
        }
        let way = self.plan.bring(topic, &seen.frame, time_ns)?;
        let known = self.brought.count(&way);
        Ok(known.map(|known| known.transform.transform_point(&Point3::from(seen.position)).coords))
    }

    /// Appends the vehicles that are seen with a transform.
    fn append_bodies(
        &mut self,
        seen: &Seen,
        turn: [f64; 4],
        topic: &str,
        time_ns: i64,
        rows: &mut Vec<Row>,
    ) -> Result<(), Fault> {
        let space = space(topic);
        let Who::Named(driver) = &seen.who else { return Ok(()) };
        let Some(bodies) = self.plan.bodies_of(space, driver).cloned() else { return Ok(()) };
        check_finite(&seen.position)?;
        if self.plan.wanted.is_none() {
            self.check_frame(&seen.frame, topic)?;
        }
        for body in bodies {
            let is_there =
                body.frame == *driver && self.plan.wanted.as_ref().is_none_or(|wanted| *wanted == seen.frame);
            let position = if is_there {
                Some(seen.position)
            } else {
                let placed = Placed { position: seen.position, turn }.rigid()?;
                let way = self.plan.bring_body(space, &body, placed, time_ns)?;
                self.brought.count(&way).map(|known| known.transform.translation.vector)
            };
            let Some(position) = position else { continue };
            let several = self.plan.outline.trees.len() > 1;
            let name = if several && !space.is_empty() { format!("{space}/{}", body.frame) } else { body.frame };
            self.push(&name, time_ns, position, rows)?;
        }
        Ok(())
    }

    fn push(&mut self, name: &str, time_ns: i64, position: Vector3<f64>, rows: &mut Vec<Row>) -> Result<(), Fault> {
        self.vehicle = self.names.index(name, self.vehicle)?;
        let (stamp, vehicle) = (Stamp::Whole(time_ns), self.vehicle);
        rows.push(Row { stamp, place: self.messages, vehicle, position, velocity: None, radius: None });
        Ok(())
    }

    /// Refuses a position in another frame than those before.
    fn check_frame(&mut self, frame: &str, topic: &str) -> Result<(), Fault> {
        match &self.frame {
            None => self.frame = Some((frame.to_owned(), topic.to_owned())),
            Some((known, _)) if known == frame => {}
            Some((known, first)) => {
                let (known, first, frame) = (quoted(known), quoted(first), quoted(frame));
                let problem =
                    format!("positions are given in the frame {known} on topic {first} and in the frame {frame} here");
                let remedy = "name the frame that transforms bring all into, or that alone is meant, with --frame";
                return Err(Fault::coded("recording/several-frames", problem, remedy));
            }
        }
        Ok(())
    }

    /// What was assumed to know positions, if anything was.
    pub(super) fn assumed(&self) -> Option<String> {
        (self.brought.guessed > 0).then(|| "transforms even between their samples".to_owned())
    }

    /// What a person should know.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = self.plan.notes();
        notes.extend(no_fixes(self.no_fixes, ""));
        let Brought { exactly, guessed, unknown } = self.brought;
        if exactly + guessed + unknown > 0 {
            let into = self.plan.wanted.as_deref().map_or_else(String::new, |frame| format!(" into {}", quoted(frame)));
            notes.push(format!(
                "positions brought{into} by transforms: {exactly} by those of their very time, {guessed} by some between \
                 two samples at most 1 s apart; {unknown} left out where a transform is not known"
            ));
        }
        notes
    }
}

impl Brought {
    /// Counts a position, and gives what brings it.
    fn count(&mut self, way: &Way) -> Option<Known> {
        match way {
            Way::None => return None,
            Way::NotThen => self.unknown += 1,
            Way::By(Known { guessed: true, .. }) => self.guessed += 1,
            Way::By(_) => self.exactly += 1,
        }
        if let Way::By(known) = way { Some(*known) } else { None }
    }
}

fn check_finite(position: &Vector3<f64>) -> Result<(), Fault> {
    match position.iter().find(|x| !x.is_finite()) {
        Some(odd) => Err(Fault::not_finite("position", &odd.to_string(), UNSEEN)),
        None => Ok(()),
    }
}
