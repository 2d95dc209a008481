//! Reads curves of planners: `traj_utils/msg/Bspline` and `traj_utils/msg/MultiBsplines` of EGO-Planner, and
//! `traj_utils/msg/MINCOTraj` and `traj_utils/msg/PolyTraj` of its version 2. The definitions in the bag decide. In the
//! JSON of a live source, which has no definitions, the fields decide.
//!
//! A curve of a drone is flown from its start until the next one of that drone starts. The whole curve is a published
//! plan ([`Published`]). The trajectory server of the first version holds the last point of a curve. That of the second
//! version sends nothing after the end: that the drone holds the last point is a default there.
//!
//! A B-spline has its degree in `order`, and its time 0 at the knot with this index. A MINCO trajectory of order 5 is
//! the curve of least jerk through its points. A polynomial trajectory of order 5 has six coefficients of each piece,
//! the highest power of the time since its start first.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::super::curves::{Curves, HIGHEST_DEGREE, VehicleItems, piece, value};
use super::super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::super::options::ReadOptions;
use super::super::order::Recording;
use super::super::spline::{Part, b_spline, minimum_jerk};
use super::definition::{CurveKind, curve_kind, fields};
use super::messages::nanoseconds;
use super::outline::Outline;
use super::split::SplitFiles;
use crate::mcap::topic::{CDR, DeclaredTopic, Part as FilePart, decode};
use tautline_core::fact::{self, Fact, FactKind};
use tautline_core::option::{CLOCK, DUPLICATES, FRAME, ORIGIN, PLAN_END, SORT, TOPIC};
use tautline_core::text::counted;
use tautline_core::track::{Clock, Item, Metadata, Piece, Plan as Published, PlanEnd};

/// Degree of the curves of EGO-Planner v2.
const DEGREE: u8 = 5;

const NS_PER_S: i64 = 1_000_000_000;
/// Largest time between the publication of a curve and its start, by which log times and starts have one clock \[ns\].
const ONE_CLOCK_NS: i64 = 60 * NS_PER_S;

/// Returns the remedy for a curve that contradicts itself.
fn replan() -> String {
    format!("check the planner and its version, and record again; or choose other topics with {TOPIC}")
}

/// Opens the curves of planners; `None` if the recording has none, or the user names other topics.
pub(super) fn open(
    outline: &Outline,
    splits: &mut SplitFiles,
    options: &ReadOptions,
) -> Result<Option<Recording>, ReadError> {
    let Some(topic) = outline.curves.first() else { return Ok(None) };
    outline.refuse_unknown()?;
    if let Some(other) = outline.pose_topics().find(|other| options.topics.is_empty() || options.topics.contains(other))
    {
        let problem = format!("topic {} holds curves of a planner, but {} positions", quoted(topic), quoted(other));
        let remedy = format!("choose the topics of one kind with {TOPIC}");
        return refuse(ContentKind::AmbiguousTopics, problem, remedy);
    }
    let unused = [
        (options.frame.is_some(), FRAME, "curves of planners name no frame"),
        (options.origin.is_some(), ORIGIN, "curves of planners have no place on the Earth"),
        (options.clock.is_some(), CLOCK, "curves of planners have their own times of start"),
        (options.sort, SORT, "curves of planners are sorted by their starts"),
        (options.duplicates.is_some(), DUPLICATES, "curves of planners are no rows"),
    ];
    if let Some((_, option, why)) = unused.into_iter().find(|(is_given, ..)| *is_given) {
        return refuse(ContentKind::UnusedOption, why, format!("omit {option}"));
    }
    let (mut drones, mut number) = (BTreeMap::<i32, BTreeMap<i64, Plan>>::new(), 0);
    let (mut repeated, mut published, mut undefined) = (0, Vec::new(), BTreeSet::new());
    splits.visit_all(|part| {
        let FilePart::Message(message) = part else { return Ok(()) };
        let Some(kind) = curve_kind(&message.of.schema, &message.of.definition) else { return Ok(()) };
        if !outline.curves.contains(&message.of.topic) {
            return Ok(());
        }
        number += 1;
        let place = || Place::Part(format!("curve {number} on topic `{}`", message.of.topic));
        if message.of.definition.is_empty() {
            undefined.insert(message.of.topic.clone());
        }
        let plans = Message::in_cdr(kind, message.of, message.bytes).and_then(Message::plans);
        let plans = plans.map_err(|fault| fault.at(place()))?;
        for (drone, plan) in plans {
            let start_ns = plan.start_ns;
            match drones.entry(drone).or_default().insert(start_ns, plan.clone()) {
                None => published.push((i64::try_from(message.log_ns).unwrap_or(i64::MAX), drone, start_ns)),
                Some(known) if known == plan => repeated += 1,
                Some(_) => {
                    let problem = format!("another curve of drone {drone} starts at {start_ns} ns");
                    let remedy =
                        format!("record each planner on a topic of its own, and choose the topics with {TOPIC}");
                    return Err(Fault::content(ContentKind::DuplicateRow, problem, remedy).at(place()));
                }
            }
        }
        Ok(())
    })?;
    let first_ns = drones.values().flat_map(BTreeMap::keys).min().copied().unwrap_or(0);
    let epoch_ns = first_ns.div_euclid(NS_PER_S).saturating_mul(NS_PER_S);
    let mut notes = splits.notes.clone();
    notes.push(format!(
        "{} of planners of {}: each is judged until the next one of its drone starts",
        counted(drones.values().map(|curves| curves.len() as u64).sum(), "curve", "curves"),
        counted(drones.len() as u64, "drone", "drones")
    ));
    if !undefined.is_empty() {
        let topics = undefined.iter().map(|topic| quoted(topic)).collect::<Vec<_>>().join(", ");
        notes.push(format!("without definitions of messages, the names of schemas decide how they are read: {topics}"));
    }
    if repeated > 0 {
        notes.push(format!(
            "{} repeated with the same content, and read once",
            counted(repeated, "curve is", "curves are")
        ));
    }
    let end = options.plan_end.unwrap_or(PlanEnd::Hold);
    let vehicles = vehicles(&drones, end, epoch_ns, options.metres(), &mut notes)?;
    let clock = Clock { unit: "ns", epoch_ns, ..Clock::default() };
    let mut facts = vec![
        Fact::name(FactKind::Clock, fact::Source::Recorded, "times of start in messages"),
        Fact::name(FactKind::Identity, fact::Source::Deduced, "numbers of drones in messages"),
    ];
    // Recorders write log times by their own clock, planners in simulations start by the simulated one.
    let is_one_clock = published.iter().all(|(log_ns, _, start_ns)| log_ns.abs_diff(*start_ns) <= ONE_CLOCK_NS as u64);
    facts.push(if is_one_clock {
        Fact::name(FactKind::PlanPublication, fact::Source::Recorded, "their log times")
    } else {
        for (log_ns, _, start_ns) in &mut published {
            *log_ns = *start_ns;
        }
        Fact::name(FactKind::PlanPublication, fact::Source::Default, "their starts")
    });
    let is_rule = drones.values().flat_map(BTreeMap::values).all(|plan| plan.is_held);
    let source = match options.plan_end {
        Some(_) => fact::Source::Declared,
        None if is_rule => fact::Source::Convention,
        None => fact::Source::Default,
    };
    facts.push(Fact::name(FactKind::PlanEnd, source, end.name()));
    let plans = published_plans(&drones, published, epoch_ns, options.metres())?;
    Ok(Some(Curves::with_plans(vehicles, Metadata { clock, facts, ..Metadata::in_seconds(notes) }, plans)))
}

/// Returns the whole curves in order of publication, given as instants of publication, drones and starts \[ns\].
fn published_plans(
    drones: &BTreeMap<i32, BTreeMap<i64, Plan>>,
    mut published: Vec<(i64, i32, i64)>,
    epoch_ns: i64,
    scale: f64,
) -> Result<Vec<Published>, Fault> {
    published.sort_unstable();
    let indices: BTreeMap<i32, usize> = drones.keys().enumerate().map(|(vehicle, drone)| (*drone, vehicle)).collect();
    let plan = |(published_ns, drone, start_ns): (i64, i32, i64)| {
        let (vehicle, start_s) = (indices[&drone], seconds_since(epoch_ns, start_ns));
        let pieces = drones[&drone][&start_ns].parts.iter().map(|(from_s, to_s, coefficients)| {
            let (from_s, to_s) = (start_s + from_s, start_s + to_s);
            piece(vehicle, from_s, to_s, coefficients.iter().copied(), scale).ok_or_else(Fault::out_of_range)
        });
        let published_s = seconds_since(epoch_ns, published_ns);
        Ok(Published { vehicle, published_s, pieces: pieces.collect::<Result<_, Fault>>()? })
    };
    published.into_iter().map(plan).collect()
}

/// Returns the time since the epoch \[s\]. Both times are close, so that the difference in nanoseconds is exact.
fn seconds_since(epoch_ns: i64, time_ns: i64) -> f64 {
    time_ns.saturating_sub(epoch_ns) as f64 / NS_PER_S as f64
}

/// Returns the names and the pieces of all drones, and adds notes on the ends of curves.
fn vehicles(
    drones: &BTreeMap<i32, BTreeMap<i64, Plan>>,
    end: PlanEnd,
    epoch_ns: i64,
    scale: f64,
    notes: &mut Vec<String>,
) -> Result<VehicleItems, Fault> {
    let seconds = |ns: i64| seconds_since(epoch_ns, ns);
    let ends_s = drones.values().flatten().map(|(start_ns, plan)| seconds(*start_ns) + plan.duration_s());
    let end_s = ends_s.fold(f64::NEG_INFINITY, f64::max);
    let mut ended = 0;
    let mut vehicles = Vec::new();
    for (vehicle, (drone, plans)) in drones.iter().enumerate() {
        let mut items = Vec::new();
        for (start_ns, plan) in plans {
            let start_s = seconds(*start_ns);
            let next = plans.range(start_ns.saturating_add(1)..).next();
            let until_s = next.map_or(f64::INFINITY, |(next_ns, _)| seconds(*next_ns));
            let mut push = |from_s: f64, to_s: f64, coefficients: Vec<Vector3<f64>>| {
                let piece = piece(vehicle, from_s, to_s, coefficients, scale).ok_or_else(Fault::out_of_range)?;
                items.push(Item::Piece(piece));
                Ok::<_, Fault>(())
            };
            for (from_s, to_s, coefficients) in &plan.parts {
                let (from_s, to_s) = (start_s + from_s, (start_s + to_s).min(until_s));
                if from_s < until_s {
                    push(from_s, to_s, coefficients.clone())?;
                }
            }
            let (stop_s, until_s) = (start_s + plan.duration_s(), until_s.min(end_s));
            if stop_s < until_s {
                ended += 1;
                let [position, velocity] = plan.last();
                match end {
                    PlanEnd::Hold => push(stop_s, until_s, vec![position])?,
                    PlanEnd::Continue => push(stop_s, until_s, vec![position, velocity])?,
                    PlanEnd::Unknown => {}
                }
            }
        }
        vehicles.push((drone.to_string(), items));
    }
    if ended > 0 {
        let ends = counted(ended, "curve ends", "curves end");
        let then = match end {
            PlanEnd::Hold => "the drone holds the last point",
            PlanEnd::Continue => "the drone flies on with its last velocity",
            PlanEnd::Unknown => "the motion after the end is not known",
        };
        notes.push(format!("{ends} before the next one or the recording: {then} ({PLAN_END})"));
    }
    Ok(vehicles)
}

/// Curve of a planner.
#[derive(Clone, Debug, PartialEq)]
struct Plan {
    start_ns: i64,
    /// Parts in order, at least one.
    parts: Vec<Part>,
    /// Whether the drone holds the last point after the end by the rule of the planner.
    is_held: bool,
}

impl Plan {
    fn duration_s(&self) -> f64 {
        self.parts.last().map_or(0.0, |part| part.1)
    }

    /// Returns position and velocity at the end.
    fn last(&self) -> [Vector3<f64>; 2] {
        let Some((from_s, to_s, coefficients)) = self.parts.last() else { return [Vector3::zeros(); 2] };
        let powers: Vec<_> = (1..coefficients.len()).map(|k| coefficients[k] * k as f64).collect();
        [&coefficients[..], &powers].map(|coefficients| value(coefficients, to_s - from_s))
    }

    /// Returns the drone and the curve of a B-spline.
    fn of_b_spline(message: Bspline) -> Result<(i32, Self), Fault> {
        let Bspline { drone, degree, start, knots, points, .. } = message;
        let points: Vec<[f64; 3]> = points.into_iter().map(|Point { x, y, z }| [x, y, z]).collect();
        let Some(degree) = usize::try_from(degree).ok().filter(|degree| (1..=HIGHEST_DEGREE).contains(degree)) else {
            let problem = format!("order: must be 1 to {HIGHEST_DEGREE}, got {degree}");
            return refuse(ContentKind::Degree, problem, replan());
        };
        refuse_not_finite("knots", &knots)?;
        refuse_not_finite("pos_pts", points.as_flattened())?;
        if points.len() <= degree {
            let least = counted(degree as u64, "point", "points");
            let problem = format!("pos_pts: a curve of order {degree} needs more than {least}, got {}", points.len());
            return refuse(ContentKind::Knots, problem, replan());
        }
        let expected = points.len() + degree + 1;
        if knots.len() != expected {
            let problem =
                format!("knots: {} points of order {degree} need {expected} knots, got {}", points.len(), knots.len());
            return refuse(ContentKind::Knots, problem, replan());
        }
        if let Some(k) = (1..knots.len()).find(|&k| knots[k] < knots[k - 1]) {
            let problem =
                format!("knots[{k}]: must not be below the knot before it, {}, got {}", knots[k - 1], knots[k]);
            return refuse(ContentKind::Knots, problem, replan());
        }
        let (first, last) = (knots[degree], knots[points.len()]);
        if first >= last {
            let problem = format!("knots: the curve must end after it starts, got {first} and {last}");
            return refuse(ContentKind::Duration, problem, replan());
        }
        let points: Vec<_> = points.into_iter().map(Vector3::from).collect();
        let parts = b_spline(degree, &knots, &points);
        Ok((drone, Self { start_ns: start_ns(&start)?, parts, is_held: true }))
    }

    /// Returns the drone and the curve of a message.
    fn of_minco(minco: &MincoTraj) -> Result<(i32, Self), Fault> {
        refuse_degree(minco.order)?;
        let durations = durations(&minco.durations)?;
        let pieces = durations.len();
        let [x, y, z] = [("inner_x", &minco.inner_x), ("inner_y", &minco.inner_y), ("inner_z", &minco.inner_z)]
            .map(|(name, numbers)| (name, wide(numbers)));
        for (name, numbers) in [&x, &y, &z] {
            refuse_not_finite(name, numbers)?;
            if numbers.len() + 1 != pieces {
                let problem = format!("{name}: {} one number less, got {}", need(pieces), numbers.len());
                return refuse(ContentKind::FieldCount, problem, replan());
            }
        }
        let start = [("start_p", minco.start_p), ("start_v", minco.start_v), ("start_a", minco.start_a)];
        let end = [("end_p", minco.end_p), ("end_v", minco.end_v), ("end_a", minco.end_a)];
        for (name, numbers) in start.iter().chain(&end) {
            refuse_not_finite(name, &wide(numbers))?;
        }
        let state = |rows: [(&str, [f32; 3]); 3]| rows.map(|(_, numbers)| Vector3::from(numbers.map(f64::from)));
        let inner: Vec<_> = x.1.iter().zip(&y.1).zip(&z.1).map(|((x, y), z)| Vector3::new(*x, *y, *z)).collect();
        let parts = minimum_jerk(state(start), &inner, state(end), &durations);
        let start_ns = start_ns(&minco.start_time)?;
        Ok((minco.drone.into(), Self { start_ns, parts, is_held: false }))
    }

    /// Returns the drone and the curve of a message.
    fn of_polynomials(message: &PolyTraj) -> Result<(i32, Self), Fault> {
        let PolyTraj { drone, start, order, x, y, z, durations: lengths, .. } = message;
        refuse_degree(*order)?;
        let durations = durations(lengths)?;
        let (pieces, terms) = (durations.len(), usize::from(DEGREE) + 1);
        let axes = [("coef_x", wide(x)), ("coef_y", wide(y)), ("coef_z", wide(z))];
        for (name, numbers) in &axes {
            refuse_not_finite(name, numbers)?;
            if numbers.len() != terms * pieces {
                let needed = need(pieces);
                let problem = format!("{name}: {needed} {} numbers, got {}", terms * pieces, numbers.len());
                return refuse(ContentKind::FieldCount, problem, replan());
            }
        }
        let (mut parts, mut from_s) = (Vec::with_capacity(pieces), 0.0);
        for (piece, duration_s) in durations.iter().enumerate() {
            let highest = terms * piece + usize::from(DEGREE);
            let coefficient = |power: usize| Vector3::from_fn(|axis, _| axes[axis].1[highest - power]);
            parts.push((from_s, from_s + duration_s, (0..terms).map(coefficient).collect()));
            from_s += duration_s;
        }
        let start_ns = start_ns(start)?;
        Ok(((*drone).into(), Self { start_ns, parts, is_held: false }))
    }
}

/// Returns the start of a curve \[ns\].
fn start_ns(&Time { sec, nanosec }: &Time) -> Result<i64, Fault> {
    if i64::from(nanosec) < NS_PER_S {
        return Ok(nanoseconds(sec.into(), nanosec.into()));
    }
    let problem = format!("start_time.nanosec: must be below {NS_PER_S}, got {nanosec}");
    refuse(ContentKind::TimeFormat, problem, replan())
}

fn wide(numbers: &[f32]) -> Vec<f64> {
    numbers.iter().map(|&number| f64::from(number)).collect()
}

/// Returns the start of a message on the numbers that durations need.
fn need(durations: usize) -> String {
    counted(durations as u64, "duration needs", "durations need")
}

fn refuse_degree(order: u8) -> Result<(), Fault> {
    if order == DEGREE {
        return Ok(());
    }
    refuse(ContentKind::Degree, format!("order: must be {DEGREE}, got {order}"), replan())
}

/// Returns the durations of the pieces \[s\], at least one.
fn durations(lengths: &[f32]) -> Result<Vec<f64>, Fault> {
    let durations = wide(lengths);
    refuse_not_finite("duration", &durations)?;
    if durations.is_empty() {
        return refuse(ContentKind::FieldCount, "duration: a curve needs at least one piece, got none", replan());
    }
    match durations.iter().position(|duration_s| *duration_s <= 0.0) {
        Some(k) => {
            let problem = format!("duration[{k}]: must be positive, got {} s", durations[k]);
            refuse(ContentKind::Duration, problem, replan())
        }
        None => Ok(durations),
    }
}

fn decoded<T: DeserializeOwned>(encoding: &str, bytes: &[u8]) -> Result<T, Fault> {
    if encoding != CDR {
        return Err(Fault::damaged("ROS 2 messages are supported in CDR only".to_owned()));
    }
    decode(bytes).map_err(Fault::damaged)
}

fn refuse_not_finite(name: &str, numbers: &[f64]) -> Result<(), Fault> {
    match numbers.iter().position(|number| !number.is_finite()) {
        Some(k) => {
            let problem = format!("{name}[{k}]: must be a finite number, got {}", numbers[k]);
            refuse(ContentKind::NotFinite, problem, replan())
        }
        None => Ok(()),
    }
}

/// Message of a planner.
enum Message {
    BSpline(Bspline),
    BSplines(MultiBsplines),
    Minco(MincoTraj),
    Polynomials(PolyTraj),
}

impl Message {
    /// Reads a message of a bag.
    fn in_cdr(kind: CurveKind, topic: &DeclaredTopic, bytes: &[u8]) -> Result<Self, Fault> {
        let encoding = &*topic.encoding;
        match kind {
            CurveKind::BSpline => decoded(encoding, bytes).map(Self::BSpline),
            CurveKind::BSplines => decoded(encoding, bytes).map(Self::BSplines),
            CurveKind::Minco => decoded(encoding, bytes).map(Self::Minco),
            CurveKind::Polynomials => decoded(encoding, bytes).map(Self::Polynomials),
            CurveKind::Unsupported => {
                let found = fields(&topic.definition).replace('\n', ", ");
                let problem = format!("the definition of {} has other fields: {found}", quoted(&topic.schema));
                refuse(ContentKind::UnsupportedFormat, problem, replan())
            }
        }
    }

    /// Reads a message in JSON; `None` if its fields are those of no planner.
    fn in_json(message: &Value) -> Option<serde_json::Result<Self>> {
        let has = |field: &str| message.get(field).is_some();
        if has("traj") && has("drone_id_from") {
            Some(MultiBsplines::deserialize(message).map(Self::BSplines))
        } else if has("knots") || has("pos_pts") {
            Some(Bspline::deserialize(message).map(Self::BSpline))
        } else if has("inner_x") || has("start_p") {
            Some(MincoTraj::deserialize(message).map(Self::Minco))
        } else if has("coef_x") {
            Some(PolyTraj::deserialize(message).map(Self::Polynomials))
        } else {
            None
        }
    }

    /// Returns the drones and their curves. A list of B-splines has elements without points for drones that have
    /// published nothing.
    fn plans(self) -> Result<Vec<(i32, Plan)>, Fault> {
        match self {
            Self::BSpline(message) => Ok(vec![Plan::of_b_spline(message)?]),
            Self::BSplines(MultiBsplines { list, .. }) => {
                let published =
                    list.into_iter().filter(|spline| !(spline.points.is_empty() && spline.knots.is_empty()));
                published.map(Plan::of_b_spline).collect()
            }
            Self::Minco(message) => Ok(vec![Plan::of_minco(&message)?]),
            Self::Polynomials(message) => Ok(vec![Plan::of_polynomials(&message)?]),
        }
    }
}

/// Plan in a message of a live source.
#[derive(Clone, Debug, PartialEq)]
pub struct LivePlan {
    /// Number of the drone.
    pub drone: i32,
    /// Start since the epoch of the planner's clock \[ns\].
    pub start_ns: i64,
    /// Pieces in order of time, at least one. Their times count from the start of the plan, their vehicle is 0.
    pub pieces: Vec<Piece>,
    /// Whether the planner holds the last point after the end of the plan.
    pub is_held: bool,
}

/// Returns the plans of a planner's message in JSON; `None` if its fields are those of no planner.
///
/// # Errors
/// A sentence if a field is missing or wrong.
#[must_use]
pub fn live_plans(message: &Value) -> Option<Result<Vec<LivePlan>, String>> {
    let plans = match Message::in_json(message)? {
        Ok(message) => message.plans().map_err(|fault| fault.to_string()),
        Err(error) => Err(error.to_string()),
    };
    let live = |(drone, Plan { start_ns, parts, is_held }): (i32, Plan)| {
        let pieces = parts.into_iter().map(|(from_s, to_s, coefficients)| piece(0, from_s, to_s, coefficients, 1.0));
        let pieces = pieces.collect::<Option<_>>().ok_or("a value exceeds the range of numbers")?;
        Ok(LivePlan { drone, start_ns, pieces, is_held })
    };
    Some(plans.and_then(|plans| plans.into_iter().map(live).collect()))
}

/// Time since the epoch of a clock. ROS 1 has other names of the fields.
#[derive(Deserialize)]
struct Time {
    #[serde(alias = "secs")]
    sec: i32,
    #[serde(alias = "nsecs")]
    nanosec: u32,
}

#[derive(Deserialize)]
struct Point {
    x: f64,
    y: f64,
    z: f64,
}

/// Message of EGO-Planner. The angles are not used.
#[derive(Deserialize)]
struct Bspline {
    #[serde(rename = "drone_id")]
    drone: i32,
    #[serde(rename = "order")]
    degree: i32,
    #[serde(rename = "traj_id")]
    _traj_id: i64,
    #[serde(rename = "start_time")]
    start: Time,
    knots: Vec<f64>,
    #[serde(rename = "pos_pts")]
    points: Vec<Point>,
    #[serde(rename = "yaw_pts")]
    _yaw_points: Vec<f64>,
    #[serde(rename = "yaw_dt")]
    _yaw_interval_s: f64,
}

/// List of messages of EGO-Planner.
#[derive(Deserialize)]
struct MultiBsplines {
    #[serde(rename = "drone_id_from")]
    _from: i32,
    #[serde(rename = "traj")]
    list: Vec<Bspline>,
}

/// Message of EGO-Planner v2: positions, velocities and accelerations at both ends, inner points and durations.
#[derive(Deserialize)]
struct MincoTraj {
    #[serde(rename = "drone_id")]
    drone: i16,
    #[serde(rename = "traj_id")]
    _traj_id: i32,
    start_time: Time,
    #[serde(rename = "des_clearance")]
    _clearance_m: f32,
    order: u8,
    start_p: [f32; 3],
    start_v: [f32; 3],
    start_a: [f32; 3],
    end_p: [f32; 3],
    end_v: [f32; 3],
    end_a: [f32; 3],
    inner_x: Vec<f32>,
    inner_y: Vec<f32>,
    inner_z: Vec<f32>,
    #[serde(rename = "duration")]
    durations: Vec<f32>,
}

/// Message of EGO-Planner v2: six coefficients of each piece, and durations.
#[derive(Deserialize)]
struct PolyTraj {
    #[serde(rename = "drone_id")]
    drone: i16,
    #[serde(rename = "traj_id")]
    _traj_id: i32,
    #[serde(rename = "start_time")]
    start: Time,
    order: u8,
    #[serde(rename = "coef_x")]
    x: Vec<f32>,
    #[serde(rename = "coef_y")]
    y: Vec<f32>,
    #[serde(rename = "coef_z")]
    z: Vec<f32>,
    #[serde(rename = "duration")]
    durations: Vec<f32>,
}
