//! Recordings whose axes are turned as the user says.

use super::axes::Axes;
use super::error::{Fault, ReadError, quoted};
use super::options::ReadOptions;
use super::order::Recording;
use tautline_core::track::{Clock, EarthOrigin, Item, Tracks};

/// A recording whose axes are turned as the user says.
pub(super) fn turned(recording: Recording, options: &ReadOptions) -> Result<Recording, ReadError> {
    if options.turn().is_identity() {
        return Ok(recording);
    }
    if recording.is_planar() && !options.turn().keeps_plane() {
        let problem = "its third axis would become x or y, and it has none";
        let remedy = "name the column of the third axis with --column z=NAME, or give --axes that leave z in its place";
        return Err(Fault::coded("recording/contradicts-option", problem, remedy).into());
    }
    let notes = [recording.notes(), &[options.turn().note()]].concat();
    Ok(Box::new(Turned { recording, axes: options.turn(), notes }))
}

/// Refuses to turn axes whose directions are known, in what is called so.
pub(super) fn refuse_known(options: &ReadOptions, what: &str) -> Result<(), Fault> {
    if options.turn().is_identity() {
        return Ok(());
    }
    Err(Fault::coded(
        "recording/contradicts-option",
        format!("{what} gives the directions of its axes"),
        "leave --axes and signs of --scale away",
    ))
}

/// Refuses to turn a height over that is up by the name of its column.
pub(super) fn refuse_turned_height(options: &ReadOptions, column: &str) -> Result<(), Fault> {
    if options.turn().keeps_up() {
        return Ok(());
    }
    let problem =
        format!("column {} says by its name which way is up, and --axes or --scale another way", quoted(column));
    let remedy = format!("leave z as it is there, or have the numbers taken as they are with --column z={column}");
    Err(Fault::coded("recording/contradicts-option", problem, remedy))
}

struct Turned {
    recording: Recording,
    axes: Axes,
    notes: Vec<String>,
}

impl Tracks for Turned {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        self.recording.vehicles()
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let before = items.len();
        let more = self.recording.read(items)?;
        for item in &mut items[before..] {
            match item {
                Item::Sample(sample) => {
                    if sample.radius_m.is_some() && !self.axes.keeps_lengths() {
                        let problem = "its axes are scaled by different numbers, and vehicles have a radius";
                        return Err(Fault::coded(
                            "recording/contradicts-option",
                            problem,
                            "give one number of metres with --scale",
                        )
                        .into());
                    }
                    sample.position_m = self.axes.turn(sample.position_m);
                    sample.velocity_m_s = sample.velocity_m_s.map(|velocity| self.axes.turn(velocity));
                }
                Item::Piece(piece) => {
                    piece.coefficients.iter_mut().for_each(|coefficient| *coefficient = self.axes.turn(*coefficient));
                }
            }
        }
        if !more {
            let turned = self.axes.note();
            self.notes = [self.recording.notes(), &[turned]].concat();
        }
        Ok(more)
    }

    fn clock(&self) -> &Clock {
        self.recording.clock()
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn assumed(&self) -> Option<&str> {
        self.recording.assumed()
    }

    fn is_planar(&self) -> bool {
        self.recording.is_planar()
    }

    fn earth_origin(&self) -> Option<&EarthOrigin> {
        self.recording.earth_origin()
    }
}
