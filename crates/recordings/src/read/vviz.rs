//! Reads VVIZ shows of Verge Aero and Finale 3D: JSON with one performance per drone.
//!
//! A drone starts at its home. Each sample gives the displacement from the previous sample and the time between them,
//! by default that of `defaultPositionRate`. The first sample is at time 0 unless it gives a time. Axes are those of
//! computer graphics: x right, y up, z forward. Files are decimated for display, so that samples are read as samples,
//! not as curves.

use std::collections::BTreeSet;
use std::io::Read as _;

use nalgebra::Vector3;
use serde::Deserialize;

use super::curves::{Curves, from_json};
use super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use super::source::Source;
use tautline_core::track::{Item, Sample};

/// The only supported axes, also the default.
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

/// Displacement of a drone from the previous sample, and the time between them \[s\].
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
        let problem = format!("unknown axes {}", quoted(frame));
        return refuse(ContentKind::UnusableFrame, problem, "export with the axes `ogl`: x right, y up, z forward");
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
                Fault::content(ContentKind::VehicleTwice, "two drones have this id", "give each drone its own id");
            return Err(fault.at(place(None)));
        }
        let flown = items(&performance.agent_description, vehicles.len(), &show, options.metres());
        let items = flown.map_err(|(step, fault)| fault.at(place(step)))?;
        vehicles.push((name, items));
    }
    if vehicles.iter().all(|(_, items)| items.is_empty()) {
        let remedy = "export the show with the paths of its drones";
        return refuse(ContentKind::NoPositions, "it has no drone with samples", remedy);
    }
    let mut notes = vec!["axes of graphics are mapped to x right, y forward, z up".to_owned()];
    let still: Vec<_> = vehicles.iter().filter(|(_, items)| items.is_empty()).map(|(name, _)| quoted(name)).collect();
    if !still.is_empty() {
        notes
            .push(format!("not judged, because the show has no times for drones at their homes: {}", still.join(", ")));
    }
    Ok(Curves::recording(vehicles, notes))
}

/// Returns the samples of a drone, or the fault and the index of its step.
fn items(agent: &Agent, vehicle: usize, show: &Show, scale: f64) -> Result<Vec<Item>, (Option<usize>, Fault)> {
    let mut position = [agent.home_x, agent.home_y, agent.home_z];
    let mut time_s = show.time_offset_secs;
    let mut items = Vec::new();
    let sample = |point: [f64; 3], time_s: f64| {
        let position_m = Vector3::new(point[0], point[2], point[1]) * scale;
        let finite = time_s.is_finite() && position_m.iter().all(|x| x.is_finite());
        let sample = Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None };
        if finite { Ok(Item::Sample(sample)) } else { Err(Fault::out_of_range()) }
    };
    for (number, step) in agent.steps.iter().enumerate() {
        let fail = |fault| (Some(number), fault);
        if number > 0 || step.dt.is_some() {
            if number == 0 {
                items.push(sample(position, time_s).map_err(fail)?);
            }
            let duration_s = duration(step, show).map_err(fail)?;
            let after_s = time_s + duration_s;
            if after_s <= time_s {
                let problem = format!("it follows the previous sample after {duration_s:?} s");
                return Err(fail(Fault::content(
                    ContentKind::Duration,
                    problem,
                    "remove one of the samples: a drone is in one place at a time",
                )));
            }
            time_s = after_s;
        }
        for (coordinate, by) in position.iter_mut().zip([step.dx, step.dy, step.dz]) {
            *coordinate += by;
        }
        items.push(sample(position, time_s).map_err(fail)?);
    }
    Ok(items)
}

/// Returns the duration of a step \[s\].
fn duration(step: &Step, show: &Show) -> Result<f64, Fault> {
    match (step.dt, show.default_position_rate) {
        (Some(duration_s), _) => Ok(duration_s),
        (None, Some(rate)) if rate > 0.0 => Ok(rate.recip()),
        _ => refuse(
            ContentKind::FrameRate,
            "it has neither `dt` nor a positive `defaultPositionRate`",
            "export the show again",
        ),
    }
}
