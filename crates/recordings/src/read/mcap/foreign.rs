//! Recordings of others.

use super::super::clock::TimeUnit;
use super::super::error::{Place, ReadError};
use super::super::options::{Duplicates, ReadOptions};
use super::super::order::{About, Ordered, Recording};
use super::super::rows::{BATCH, Row, Rows};
use super::super::source::Source;
use super::plan::Plan;
use super::poses::Poses;
use super::schemas::{is_list, reader_of_topic};
use super::splits::Splits;
use crate::mcap::topic::Part;

/// Opens a recording in some files that follow each other; `whole` is what is called so.
pub(super) fn open(whole: &Source, mut splits: Splits, options: &ReadOptions) -> Result<Recording, ReadError> {
    let plan = Plan::of(&mut splits, options)?;
    let none = plan.none();
    let mut about = About::new(whole, options, Some(TimeUnit::Nanoseconds), splits.notes.clone(), none);
    about.frame.earth_origin = plan.local().map(|local| local.measured_from(options.origin));
    // Messages that are there twice are those of a bag that is.
    about.duplicates = about.duplicates.or(Some(Duplicates::Refuse));
    let foreign = Foreign { splits, poses: Poses::new(plan), listed: true, shown: Vec::new(), starts: Vec::new() };
    Ok(Box::new(Ordered::open(foreign, about)?))
}

/// A recording of others.
struct Foreign {
    splits: Splits,
    poses: Poses,
    /// Whether all topics hold lists of poses.
    listed: bool,
    /// The names of the vehicles as they are shown.
    shown: Vec<String>,
    /// Messages before each file.
    starts: Vec<u64>,
}

impl Rows for Foreign {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let (before, poses, listed) = (rows.len(), &mut self.poses, &mut self.listed);
        let mut more = true;
        while more && rows.len() < before + BATCH {
            let (files, messages) = (self.splits.opened_files(), poses.messages);
            more = self.splits.visit(|part| {
                match part {
                    Part::Message(message) => poses.take(&message, rows)?,
                    Part::Topic(topic) => *listed &= is_list(&topic.schema) || reader_of_topic(topic).is_none(),
                    Part::Schema(_) | Part::Other => {}
                }
                Ok(())
            })?;
            if self.splits.opened_files() > files {
                self.starts.push(messages);
            }
        }
        Ok(rows.len() > before)
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

    /// Poses of a single topic are called by their numbers alone.
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

    fn notes(&self) -> Vec<String> {
        self.poses.notes()
    }

    fn assumed(&self) -> Option<String> {
        self.poses.assumed()
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
