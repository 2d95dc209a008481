//! VVIZ shows of Verge Aero and Finale 3D: JSON with a performance for each drone.
//!
//! A drone begins at its home, and each sample says how far it moves from the one before, and in how much time, which is
//! otherwise that of `defaultPositionRate`. The first sample is at time 0 unless it says its time itself. Axes are those of
//! graphics: x right, y up, z forward. Files are thinned out for looking at, so samples are samples and no curve.

use std::collections::BTreeSet;
use std::io::Read as _;

use nalgebra::Vector3;
use serde::Deserialize;

use super::curves::{Curves, from_json};
use super::error::{Fault, Place, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use super::readers::{Packing, Reader, Takes};
use super::source::Source;
use tautline_core::track::{Item, Sample};

/// Keys in front of the long arrays of a show.
const KEYS: [&[u8]; 2] = [b"\"defaultPositionRate\"", b"\"agentTraversal\""];

pub(super) const READER: Reader = Reader {
    name: "vviz",
    title: "a VVIZ show",
    extensions: &["vviz"],
    docs: "VVIZ show of Verge Aero or Finale 3D",
    magic: &[],
    sniff: |head| {
        let holds = |text: &[u8]| KEYS.iter().any(|key| memchr::memmem::find(text, key).is_some());
        head.is_text(|text| text.starts_with(b"{") && holds(text))
    },
    open,
    takes: &[Takes::Rows],
    packing: Packing::Any,
};

/// The only axes that are known, and what is said where none are.
const GRAPHICS: &str = "ogl";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Show {
    coordinate_frame: Option<String>,
    default_position_rate: Option<f64>,
    #[serde(default)]
    time_offset_secs: f64,
    performances: Vec<Performance>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Performance {
    id: serde_json::Value,
    agent_description: Agent,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Agent {
    home_x: f64,
    home_y: f64,
    home_z: f64,
    #[serde(rename = "agentTraversal")]
    steps: Vec<Step>,
}

/// How far a drone moves from one sample to the next, and in how much time \[s\].
#[derive(Deserialize)]
struct Step {
    dx: f64,
    dy: f64,
    dz: f64,
    dt: Option<f64>,
}

/// Opens a show.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let mut bytes = Vec::new();
    source.bytes()?.read_to_end(&mut bytes)?;
    let show: Show = from_json(&bytes, "a VVIZ show", "export the show as VVIZ 1.0")?;
    if let Some(frame) = show.coordinate_frame.as_deref().filter(|frame| *frame != GRAPHICS) {
        let problem = format!("its axes are those of {}, which are not known", quoted(frame));
        return refuse("recording/unusable-frame", problem, "export it with the axes `ogl`: x right, y up, z forward");
    }
    let (mut vehicles, mut names) = (Vec::new(), BTreeSet::new());
    for performance in &show.performances {
        let name = match &performance.id {
            serde_json::Value::String(name) => name.clone(),
            other => other.to_string(),
        };
        let place = |step: Option<usize>| {
            let sample = step.map_or_else(String::new, |step| format!(", sample {}", step + 1));
            Place::Part(format!("drone {}{sample}", quoted(&name)))
        };
        if !names.insert(name.clone()) {
            let fault =
                Fault::coded("recording/vehicle-twice", "two drones have this id", "give each an id of its own");
            return Err(fault.at(place(None)));
        }
        let flown = items(&performance.agent_description, vehicles.len(), &show, options.metres());
        let items = flown.map_err(|(step, fault)| fault.at(place(step)))?;
        vehicles.push((name, items));
    }
    if vehicles.iter().all(|(_, items)| items.is_empty()) {
        return refuse(
            "recording/no-positions",
            "it has no drone with a sample of its way",
            "export it with the ways of its drones",
        );
    }
    let mut notes = vec!["axes of graphics are turned: x right, y forward, z up".to_owned()];
    let still: Vec<_> = vehicles.iter().filter(|(_, items)| items.is_empty()).map(|(name, _)| quoted(name)).collect();
    if !still.is_empty() {
        notes.push(format!("not judged, for the show does not say when they are at their homes: {}", still.join(", ")));
    }
    Ok(Curves::recording(vehicles, notes))
}

/// The samples of a drone, or the number of the step that is wrong.
fn items(agent: &Agent, vehicle: usize, show: &Show, scale: f64) -> Result<Vec<Item>, (Option<usize>, Fault)> {
    let mut at = [agent.home_x, agent.home_y, agent.home_z];
    let mut time_s = show.time_offset_secs;
    let mut items = Vec::new();
    let sample = |at: [f64; 3], time_s: f64| {
        let position_m = Vector3::new(at[0], at[2], at[1]) * scale;
        let finite = time_s.is_finite() && position_m.iter().all(|x| x.is_finite());
        let sample = Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None };
        if finite { Ok(Item::Sample(sample)) } else { Err(Fault::out_of_range()) }
    };
    for (number, step) in agent.steps.iter().enumerate() {
        let fail = |fault| (Some(number), fault);
        if number > 0 || step.dt.is_some() {
            if number == 0 {
                items.push(sample(at, time_s).map_err(fail)?);
            }
            let duration_s = duration(step, show).map_err(fail)?;
            let after_s = time_s + duration_s;
            if after_s <= time_s {
                let problem = format!("it comes {duration_s:?} s after the one before");
                return Err(fail(Fault::coded(
                    "recording/duration",
                    problem,
                    "a drone is in one place at a time: take one of the samples out",
                )));
            }
            time_s = after_s;
        }
        for (at, by) in at.iter_mut().zip([step.dx, step.dy, step.dz]) {
            *at += by;
        }
        items.push(sample(at, time_s).map_err(fail)?);
    }
    Ok(items)
}

/// How long a step lasts \[s\].
fn duration(step: &Step, show: &Show) -> Result<f64, Fault> {
    match (step.dt, show.default_position_rate) {
        (Some(duration_s), _) => Ok(duration_s),
        (None, Some(rate)) if rate > 0.0 => Ok(rate.recip()),
        _ => refuse(
            "recording/frame-rate",
            "neither `dt` nor a positive `defaultPositionRate` says when it is",
            "export the show again",
        ),
    }
}
