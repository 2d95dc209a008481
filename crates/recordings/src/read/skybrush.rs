//! Reads Skybrush shows: `show.json`, alone or inside a `.skyc` archive.
//!
//! Each drone has a trajectory of keyed points `[t, [x, y, z], [control points]]`. Times count from the take-off of the
//! drone; before it, the drone stands at its first point. A drone with a single point stands there throughout. The
//! control points belong to the segment that ends at the point: n of them give a Bezier curve of degree n + 1, none a
//! straight line.

use std::io::Read;

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::Value;
use serde_json::value::RawValue;

use super::axes::Axes;
use super::curves::{Curves, HIGHEST_DEGREE, distinct, from_json, piece, powers, stand_throughout};
use super::error::{ContentKind, Fault, Place, ReadError, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use super::recognition::{SHOW, TABLE};
use super::show_rules::ShowRules;
use super::source::{Archive, Source};
use tautline_core::track::{Item, Sample};

#[derive(Deserialize)]
struct Show {
    swarm: Option<Swarm>,
    settings: Option<Box<RawValue>>,
}

#[derive(Deserialize)]
struct Swarm {
    #[serde(default)]
    drones: Vec<Drone>,
}

#[derive(Deserialize)]
struct Drone {
    settings: Option<Box<Settings>>,
}

#[derive(Default, Deserialize)]
struct Settings {
    #[serde(rename = "$ref")]
    elsewhere: Option<String>,
    name: Option<String>,
    trajectory: Option<Trajectory>,
    #[serde(rename = "yawControl")]
    yaw: Option<Box<RawValue>>,
}

#[derive(Default, Deserialize)]
struct Trajectory {
    #[serde(rename = "$ref")]
    elsewhere: Option<String>,
    version: Option<f64>,
    #[serde(default)]
    points: Vec<Point>,
    #[serde(default, rename = "takeoffTime")]
    takeoff_s: f64,
}

/// Longest text of the rules of a show, and of the yaw control of a drone \[bytes\]. In memory, a value may take ninety
/// times its text.
const RULES_LIMIT_BYTES: usize = 4 * 1024 * 1024;

/// Time \[s\], position, optional control points, and an ignored field.
#[derive(Deserialize)]
#[serde(expecting = "a keyed point [t, [x, y, z], [control points]]")]
struct Point(f64, [f64; 3], #[serde(default)] Vec<[f64; 3]>, #[serde(default)] IgnoredAny);

/// Reads the show of a file; also returns the archive, if it is one.
fn show(source: &Source) -> Result<(Show, Option<Archive>), ReadError> {
    let mut head = [0; 2];
    let is_archive = source.bytes()?.read(&mut head).is_ok_and(|bytes| bytes == 2 && head == *b"PK");
    let mut archive = is_archive.then(|| Archive::open(&source.path)).transpose()?;
    archive.as_mut().map_or(Ok(()), Archive::check_entries)?;
    let show = match &mut archive {
        Some(archive) if archive.holds(SHOW) => parse(&archive.document(SHOW)?, Some(SHOW))?,
        Some(_) => {
            let problem = format!("it is an archive with neither `{SHOW}` nor NumPy arrays nor tables");
            let remedy = "give a .skyc or .npz file, or pack one table per vehicle";
            return refuse(ContentKind::UnknownFormat, problem, remedy);
        }
        None => {
            let mut bytes = Vec::new();
            source.bytes()?.read_to_end(&mut bytes)?;
            parse(&bytes, None)?
        }
    };
    Ok((show, archive))
}

/// Returns the rules that the show states itself; `None` for a file without a readable show, which [`open`] refuses.
pub(super) fn rules(source: &Source, options: &ReadOptions) -> Result<Option<ShowRules>, ReadError> {
    let Ok((show, mut archive)) = show(source) else { return Ok(None) };
    let are_axes_kept = options.turn() == Axes::default();
    let settings = value(show.settings.as_deref(), "its `settings`")?;
    let mut rules = ShowRules::read(&settings, options.metres(), are_axes_kept);
    let Some(swarm) = show.swarm else { return Ok(Some(rules)) };
    let drones = swarm.drones.into_iter().enumerate();
    let drones = drones.map(|(index, drone)| resolved(index, drone, archive.as_mut()));
    let (names, drones): (Vec<_>, Vec<_>) = drones.collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    for (name, (trajectory, yaw)) in distinct(names).into_iter().zip(drones) {
        let mut yaw = value(yaw.as_deref(), &format!("`yawControl` of drone `{name}`"))?;
        if let Some(elsewhere) = yaw.get("$ref").and_then(Value::as_str).map(str::to_owned) {
            let found = referenced::<Box<RawValue>>(archive.as_mut(), &elsewhere);
            match found.and_then(|found| Ok(value(Some(&found), "the yaw control")?)) {
                Ok(found) => yaw = found,
                Err(error) => {
                    rules.unreadable_yaw.push(format!("yaw of `{name}`: {error}"));
                    continue;
                }
            }
        }
        rules.read_yaw(&name, &yaw, trajectory.takeoff_s);
    }
    Ok(Some(rules))
}

/// Returns the value of a text, which `what` names. A missing text is null.
fn value(text: Option<&RawValue>, what: &str) -> Result<Value, Fault> {
    let text = text.map_or("null", RawValue::get);
    if text.len() > RULES_LIMIT_BYTES {
        let problem = format!("{what} has {} bytes, at most {RULES_LIMIT_BYTES} are read", text.len());
        return refuse(ContentKind::Malformed, problem, "export the show from Skybrush again");
    }
    serde_json::from_str(text).map_err(Fault::damaged)
}

/// Trajectory of a drone, and the text of its yaw control.
type Motion = (Trajectory, Option<Box<RawValue>>);

/// Returns the name of a drone, its trajectory and its yaw control.
fn resolved(index: usize, drone: Drone, mut archive: Option<&mut Archive>) -> Result<(String, Motion), ReadError> {
    let mut settings = drone.settings.unwrap_or_default();
    if let Some(elsewhere) = &settings.elsewhere {
        settings = referenced(archive.as_deref_mut(), elsewhere)?;
    }
    let mut trajectory = settings.trajectory.unwrap_or_default();
    if let Some(elsewhere) = &trajectory.elsewhere {
        trajectory = referenced(archive, elsewhere)?;
    }
    Ok((settings.name.unwrap_or_else(|| (index + 1).to_string()), (trajectory, settings.yaw)))
}

/// Opens a show.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let (show, mut archive) = show(source)?;
    let Some(swarm) = show.swarm else {
        return refuse(ContentKind::UnsupportedFormat, "it is JSON, but not a Skybrush show: it has no `swarm`", TABLE);
    };
    let mut names = Vec::new();
    let mut curves = Vec::new();
    for (index, drone) in swarm.drones.into_iter().enumerate() {
        let (name, (trajectory, _)) = resolved(index, drone, archive.as_mut())?;
        let items = items(&trajectory, index, options.metres()).map_err(|(point, fault)| {
            let place = point.map_or(format!("drone `{name}`"), |point| format!("drone `{name}`, point {}", point + 1));
            fault.at(Place::Part(place))
        })?;
        names.push(name);
        curves.push(items);
    }
    stand_throughout(curves.iter_mut());
    if curves.iter().all(Vec::is_empty) {
        let remedy = "export the show with its trajectories";
        return refuse(ContentKind::NoPositions, "the show has no drone with a trajectory", remedy);
    }
    Ok(Curves::recording(distinct(names).into_iter().zip(curves).collect(), Vec::new()))
}

/// Returns the document behind `$ref`.
fn referenced<T: DeserializeOwned>(archive: Option<&mut Archive>, reference: &str) -> Result<T, ReadError> {
    let name = reference.split('#').next().unwrap_or_default();
    let name = name.trim_start_matches("./");
    let Some(archive) = archive.filter(|archive| archive.holds(name)) else {
        let problem = format!("it refers to `{reference}`, which is missing");
        return refuse(ContentKind::ArchiveEntry, problem, "give the .skyc file that holds all parts of the show");
    };
    parse(&archive.document(name)?, Some(name))
}

fn parse<T: DeserializeOwned>(bytes: &[u8], entry: Option<&str>) -> Result<T, ReadError> {
    from_json(bytes, "a Skybrush show", "export the show from Skybrush again").map_err(|error| match entry {
        Some(entry) => {
            let line = error.place.as_ref().map_or_else(String::new, Place::to_string);
            ReadError { place: Some(Place::Part(format!("entry `{entry}`, {line}"))), ..error }
        }
        None => error,
    })
}

/// Returns the curve of a drone, or the fault and the index of its point.
fn items(trajectory: &Trajectory, vehicle: usize, scale: f64) -> Result<Vec<Item>, (Option<usize>, Fault)> {
    if let Some(version) = trajectory.version.filter(|&version| version != 1.0) {
        let problem = format!("the version of the trajectory is {version}, expected 1");
        return Err((
            None,
            Fault::content(ContentKind::UnsupportedFormat, problem, "export the show with trajectories of version 1"),
        ));
    }
    let Some(Point(first_s, first, ..)) = &trajectory.points.first() else { return Ok(Vec::new()) };
    let (begin_s, first) = (trajectory.takeoff_s + first_s, Vector3::from(*first));
    if trajectory.points.len() == 1 {
        let (time_s, position_m) = (begin_s.min(0.0), first * scale);
        return Ok(vec![Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })]);
    }
    let mut items = Vec::new();
    if begin_s > 0.0 {
        let standing = piece(vehicle, 0.0, begin_s, [first], scale);
        items.push(Item::Piece(standing.ok_or_else(|| (Some(0), Fault::out_of_range()))?));
    }
    for (index, pair) in trajectory.points.windows(2).enumerate() {
        let span = [&pair[0], &pair[1]].map(|point| trajectory.takeoff_s + point.0);
        let segment = segment(&pair[0], &pair[1], span).and_then(|coefficients| {
            piece(vehicle, span[0], span[1], coefficients, scale).ok_or_else(Fault::out_of_range)
        });
        items.push(Item::Piece(segment.map_err(|fault| (Some(index + 1), fault))?));
    }
    Ok(items)
}

/// Returns the coefficients of a segment between two points at these times.
fn segment(before: &Point, point: &Point, [from_s, to_s]: [f64; 2]) -> Result<Vec<Vector3<f64>>, Fault> {
    if to_s == from_s {
        let problem = format!("two points are at the same time, {to_s} s");
        return refuse(ContentKind::DuplicateRow, problem, "remove one of them: a drone is in one place at a time");
    }
    if to_s < from_s {
        let problem = format!("time runs backwards: {to_s} s comes after {from_s} s");
        return refuse(ContentKind::TimeBackwards, problem, "check the order of the points, and export the show again");
    }
    let degree = point.2.len() + 1;
    if degree > HIGHEST_DEGREE {
        let problem = format!("the degree of the segment is {degree}, at most {HIGHEST_DEGREE} is supported");
        return refuse(ContentKind::Degree, problem, "use fewer control points");
    }
    let points = std::iter::once(&before.1).chain(&point.2).chain([&point.1]);
    Ok(powers(&points.map(|&point| point.into()).collect::<Vec<_>>(), to_s - from_s))
}
