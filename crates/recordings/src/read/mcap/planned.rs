//! Reads curves of planners: `traj_utils/msg/Bspline` and `traj_utils/msg/MultiBsplines` of EGO-Planner, and
//! `traj_utils/msg/MINCOTraj` and `traj_utils/msg/PolyTraj` of its version 2. The definitions in the bag decide
//! how messages are read. A live source in JSON has no definitions; there the fields decide.
//!
//! A curve of a drone is flown from its start until the next one of that drone starts. The whole curve is a published
//! plan ([`Published`]). In a recording with positions, the positions are the flight and the curves are plans. The
//! trajectory server of the first version holds the last point of a curve. The server of the second version sends
//! nothing after the end; by default the drone holds the last point.
//!
//! A B-spline has its degree in `order`, and its time 0 at the knot with this index. A MINCO trajectory of order 5 is
//! the curve of least jerk through its points. A polynomial trajectory of order 5 has six coefficients of each piece,
//! the highest power of the time since its start first.

use std::collections::btree_map::Entry;
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
use crate::mcap::topic::{CDR, DeclaredTopic, Part as FilePart, decode_whole};
use tautline_core::fact::{self, Fact, FactKind};
use tautline_core::option::{CLOCK, DUPLICATES, FRAME, ORIGIN, PLAN_END, SORT, TOPIC};
use tautline_core::text::counted;
use tautline_core::track::{Clock, Item, Metadata, Piece, Plan as Published, PlanEnd, Tracks};

/// Degree of the curves of EGO-Planner v2.
const DEGREE: u8 = 5;

const NS_PER_S: i64 = 1_000_000_000;
/// Largest time between the publication of a curve and its start, by which log times and starts have one clock \[ns\].
const ONE_CLOCK_NS: i64 = 60 * NS_PER_S;
/// Largest time from the start of a curve to its publication, if planners are in time \[ns\].
const LATEST_NS: i64 = NS_PER_S;
/// Largest time between two starts of one clock: 30 days \[ns\].
const FARTHEST_STARTS_NS: u64 = 30 * 86_400 * NS_PER_S as u64;

/// Returns the remedy for a curve that contradicts itself.
fn replan() -> String {
    format!("check the planner and its version, and record again; or choose other topics with {TOPIC}")
}

/// Curves of planners in a recording.
pub(super) struct PlannerCurves {
    /// Curves of each drone, by start \[ns\].
    drones: BTreeMap<i32, BTreeMap<i64, Curve>>,
    repeated: u64,
    /// Topics without a definition of their messages.
    undefined: BTreeSet<String>,
}

/// Curve, with its first publication.
struct Curve {
    plan: Plan,
    /// Smallest log time of its messages \[ns\].
    log_ns: i64,
    /// Number of this message in the recording, from 1.
    number: u64,
}

impl PlannerCurves {
    /// Reads the curves; `None` if the recording has none, or the user names other topics.
    pub(super) fn read(outline: &Outline, splits: &mut SplitFiles) -> Result<Option<Self>, ReadError> {
        if outline.curves.is_empty() {
            return Ok(None);
        }
        outline.refuse_unknown()?;
        let (mut drones, mut number) = (BTreeMap::<i32, BTreeMap<i64, Curve>>::new(), 0);
        let (mut repeated, mut undefined) = (0, BTreeSet::new());
        splits.visit_all(|part| {
            let FilePart::Message(message) = part else { return Ok(()) };
            if !outline.curves.contains(&message.of.topic) {
                return Ok(());
            }
            let Some(kind) = curve_kind(&message.of.schema, &message.of.definition) else { return Ok(()) };
            number += 1;
            let place = || Place::Part(format!("curve {number} on topic `{}`", message.of.topic));
            if message.of.definition.is_empty() {
                undefined.insert(message.of.topic.clone());
            }
            let plans = Message::in_cdr(kind, message.of, message.bytes).and_then(Message::plans);
            let plans = plans.map_err(|fault| fault.at(place()))?;
            let log_ns = i64::try_from(message.log_ns).unwrap_or(i64::MAX);
            for (drone, plan) in plans {
                let start_ns = plan.start_ns;
                match drones.entry(drone).or_default().entry(start_ns) {
                    Entry::Vacant(place) => drop(place.insert(Curve { plan, log_ns, number })),
                    Entry::Occupied(mut known) if known.get().plan == plan => {
                        repeated += 1;
                        // The messages of a file may be in any order.
                        if log_ns < known.get().log_ns {
                            known.insert(Curve { plan, log_ns, number });
                        }
                    }
                    Entry::Occupied(_) => {
                        let problem = format!("another curve of drone {drone} starts at {start_ns} ns");
                        let remedy =
                            format!("record each planner on a topic of its own, and choose the topics with {TOPIC}");
                        return Err(Fault::content(ContentKind::DuplicateRow, problem, remedy).at(place()));
                    }
                }
            }
            Ok(())
        })?;
        let starts =
            || drones.iter().flat_map(|(drone, curves)| curves.keys().map(move |start_ns| (*start_ns, *drone)));
        if let Some(((first_ns, first), (last_ns, last))) = starts().min().zip(starts().max())
            && first_ns.abs_diff(last_ns) > FARTHEST_STARTS_NS
        {
            let problem = format!(
                "a curve of drone {first} starts at {first_ns} ns and one of drone {last} at {last_ns} ns, more than \
                 30 days apart: the starts are of several clocks"
            );
            return refuse(ContentKind::SeveralClocks, problem, replan());
        }
        Ok(Some(Self { drones, repeated, undefined }))
    }

    /// Returns the recording of the curves, each flown until the next one of its drone starts.
    pub(super) fn flown(self, options: &ReadOptions, mut notes: Vec<String>) -> Result<Recording, ReadError> {
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
        let first_ns = self.drones.values().flat_map(BTreeMap::keys).min().copied().unwrap_or(0);
        let epoch_ns = first_ns.div_euclid(NS_PER_S).saturating_mul(NS_PER_S);
        notes.push(format!("{}: each is judged until the next one of its drone starts", self.counts()));
        notes.extend(self.notes());
        let end = options.plan_end.unwrap_or(PlanEnd::Hold);
        let vehicles = self.vehicles(end, epoch_ns, options.metres(), &mut notes)?;
        let clock = Clock { unit: "ns", epoch_ns, ..Clock::default() };
        let mut facts = vec![
            Fact::name(FactKind::Clock, fact::Source::Recorded, "times of start in messages"),
            Fact::name(FactKind::Identity, fact::Source::Deduced, "numbers of drones in messages"),
        ];
        facts.extend(self.facts(options));
        if let Some(late_s) = self.late_s() {
            let published =
                format!("their log times, up to {late_s:.3} s after their starts, from which they are flown");
            facts.retain(|fact| fact.kind != FactKind::PlanPublication);
            facts.push(Fact::name(FactKind::PlanPublication, fact::Source::Default, published));
        }
        let indices = self.drones.keys().enumerate().map(|(vehicle, drone)| (*drone, vehicle)).collect();
        let plans = self.published_plans(&indices, epoch_ns, options.metres())?;
        Ok(Curves::with_plans(vehicles, Metadata { clock, facts, ..Metadata::in_seconds(notes) }, plans))
    }

    /// Returns the recording of positions with the curves as plans of its vehicles.
    pub(super) fn beside(self, positions: Recording, options: &ReadOptions) -> Result<Recording, ReadError> {
        if positions.earth_origin().is_some() {
            let problem = "its positions are places on the Earth, curves of planners are not";
            return refuse(ContentKind::AmbiguousTopics, problem, one_kind());
        }
        let drones: Vec<_> = self.drones.keys().copied().collect();
        let indices = vehicles_of(&drones, positions.vehicles())?;
        let plans = self.published_plans(&indices, positions.clock().epoch_ns, options.metres())?;
        let mut notes = vec![format!("{}, beside positions", self.counts())];
        notes.extend(self.notes());
        let mut facts = self.facts(options);
        let of_numbers = "belong to the vehicles with their numbers in the names";
        facts.push(Fact::name(FactKind::FlownPlans, fact::Source::Inferred, of_numbers));
        let mut recording = PlannedFlights { positions, plans, notes, facts, metadata: Metadata::default() };
        recording.refresh();
        Ok(Box::new(recording))
    }

    /// Returns the numbers of curves and drones in words.
    fn counts(&self) -> String {
        let curves = self.drones.values().map(|curves| curves.len() as u64).sum();
        let drones = counted(self.drones.len() as u64, "drone", "drones");
        format!("{} of planners of {drones}", counted(curves, "curve", "curves"))
    }

    fn notes(&self) -> impl Iterator<Item = String> {
        let topics = self.undefined.iter().map(|topic| quoted(topic)).collect::<Vec<_>>().join(", ");
        let undefined =
            format!("without definitions of messages, the names of schemas decide how they are read: {topics}");
        let curves = counted(self.repeated, "curve is", "curves are");
        let repeated = format!("{curves} repeated with the same content, and read once");
        let undefined = (!self.undefined.is_empty()).then_some(undefined);
        undefined.into_iter().chain((self.repeated > 0).then_some(repeated))
    }

    /// Returns whether log times and starts have one clock. Recorders write log times by their own clock. Planners in
    /// simulations start by the simulated clock.
    ///
    /// One clock needs a curve that starts within a minute of its log time, and a curve that is logged at most a second
    /// after its start.
    fn is_one_clock(&self) -> bool {
        let leads = || self.drones.values().flatten().map(|(start_ns, curve)| start_ns.saturating_sub(curve.log_ns));
        leads().any(|lead_ns| lead_ns.abs() <= ONE_CLOCK_NS) && leads().any(|lead_ns| lead_ns >= -LATEST_NS)
    }

    /// Returns the longest time from a start to its publication, if this is no delay of planners in time \[s\].
    fn late_s(&self) -> Option<f64> {
        let late = self.drones.values().flatten().map(|(start_ns, curve)| curve.log_ns.saturating_sub(*start_ns));
        let late_ns = late.max().filter(|late_ns| *late_ns > LATEST_NS && self.is_one_clock())?;
        Some(late_ns as f64 / NS_PER_S as f64)
    }

    /// Returns the curves with instants of publication \[ns\] and drones, in order of publication.
    fn in_order(&self) -> Vec<(i64, i32, &Plan)> {
        let is_one_clock = self.is_one_clock();
        let curves = self.drones.iter().flat_map(|(drone, curves)| curves.values().map(move |curve| (*drone, curve)));
        let published = curves.map(|(drone, curve)| {
            let published_ns = if is_one_clock { curve.log_ns } else { curve.plan.start_ns };
            (published_ns, curve.number, drone, &curve.plan)
        });
        let mut published: Vec<_> = published.collect();
        published.sort_by_key(|(published_ns, number, drone, _)| (*published_ns, *number, *drone));
        published.into_iter().map(|(published_ns, _, drone, plan)| (published_ns, drone, plan)).collect()
    }

    /// Returns the facts on the publication and on the ends of curves.
    fn facts(&self, options: &ReadOptions) -> Vec<Fact> {
        let (source, published) = if self.is_one_clock() {
            (fact::Source::Recorded, "their log times")
        } else {
            (fact::Source::Default, "their starts")
        };
        let is_rule = self.drones.values().flat_map(BTreeMap::values).all(|curve| curve.plan.is_held);
        let source_of_end = match options.plan_end {
            Some(_) => fact::Source::Declared,
            None if is_rule => fact::Source::Convention,
            None => fact::Source::Default,
        };
        let end = options.plan_end.unwrap_or(PlanEnd::Hold);
        vec![
            Fact::name(FactKind::PlanPublication, source, published),
            Fact::name(FactKind::PlanEnd, source_of_end, end.name()),
        ]
    }

    /// Returns the published plans in order. `indices` are those of the vehicles of drones.
    fn published_plans(
        &self,
        indices: &BTreeMap<i32, usize>,
        epoch_ns: i64,
        scale: f64,
    ) -> Result<Vec<Published>, ReadError> {
        let plan = |(published_ns, drone, plan): (i64, i32, &Plan)| {
            let vehicle = indices[&drone];
            let pieces = plan.pieces(drone, vehicle, epoch_ns, scale, f64::INFINITY)?;
            Ok(Published { vehicle, published_s: seconds_since(epoch_ns, published_ns), pieces })
        };
        self.in_order().into_iter().map(plan).collect()
    }

    /// Returns the names and the flown pieces of all drones, and adds a note on the ends of curves.
    ///
    /// In order of publication, a curve replaces the earlier curves of its drone from its start on. Earlier ones that
    /// would start then or later are not flown.
    fn vehicles(
        &self,
        end: PlanEnd,
        epoch_ns: i64,
        scale: f64,
        notes: &mut Vec<String>,
    ) -> Result<VehicleItems, ReadError> {
        let mut flown: BTreeMap<i32, BTreeMap<i64, &Plan>> = BTreeMap::new();
        for (_, drone, plan) in self.in_order() {
            let plans = flown.entry(drone).or_default();
            plans.split_off(&plan.start_ns);
            plans.insert(plan.start_ns, plan);
        }
        let curves = || flown.values().flat_map(BTreeMap::values);
        let end_s = |plan: &Plan| seconds_since(epoch_ns, plan.start_ns) + plan.duration_s();
        let last_s = curves().map(|plan| end_s(plan)).fold(f64::NEG_INFINITY, f64::max);
        let (mut ended, mut vehicles) = (0, Vec::new());
        for (vehicle, (drone, plans)) in flown.iter().enumerate() {
            let mut items = Vec::new();
            for (start_ns, plan) in plans {
                let next = plans.range(start_ns.saturating_add(1)..).next();
                let until_s = next.map_or(f64::INFINITY, |(next_ns, _)| seconds_since(epoch_ns, *next_ns));
                items.extend(plan.pieces(*drone, vehicle, epoch_ns, scale, until_s)?.into_iter().map(Item::Piece));
                let (stop_s, until_s) = (end_s(plan), until_s.min(last_s));
                if stop_s < until_s {
                    ended += 1;
                    let [position, velocity] = plan.last();
                    let coefficients = match end {
                        PlanEnd::Hold => vec![position],
                        PlanEnd::Continue => vec![position, velocity],
                        PlanEnd::Unknown => continue,
                    };
                    let after = piece(vehicle, stop_s, until_s, coefficients, scale);
                    items.push(Item::Piece(after.ok_or_else(|| Fault::out_of_range().at(plan.place(*drone)))?));
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
        let dropped = self.drones.values().map(BTreeMap::len).sum::<usize>() - curves().count();
        if dropped > 0 {
            let dropped = counted(dropped as u64, "curve is", "curves are");
            notes.push(format!("{dropped} not flown: a later message has an earlier start"));
        }
        Ok(vehicles)
    }
}

/// Returns the remedy for curves and positions that do not belong together.
fn one_kind() -> String {
    format!("choose the topics of curves or those of positions with {TOPIC}")
}

/// Returns the vehicles of drones by the numbers in their names.
///
/// Names are compared number by number. Of the names with a number, all must have a number at the same position, such
/// as the first, and these must differ. Each drone must have one of them. All such positions must give the same
/// vehicles.
fn vehicles_of(drones: &[i32], names: &[String]) -> Result<BTreeMap<i32, usize>, Fault> {
    let numbers = |(index, name): (usize, &String)| {
        let numbers = name.split(|c: char| !c.is_ascii_digit()).filter(|digits| !digits.is_empty());
        let numbers: Vec<Option<i32>> = numbers.map(|digits| digits.parse().ok()).collect();
        (!numbers.is_empty()).then_some((index, numbers))
    };
    let numbered: Vec<_> = names.iter().enumerate().filter_map(numbers).collect();
    let length = numbered.iter().map(|(_, numbers)| numbers.len()).min().unwrap_or(0);
    let at = |position: usize| -> Option<BTreeMap<i32, usize>> {
        let vehicles = numbered.iter().map(|(index, numbers)| Some((numbers[position]?, *index)));
        let vehicles: BTreeMap<_, _> = vehicles.collect::<Option<_>>()?;
        let all = (vehicles.len() == numbered.len()).then_some(vehicles)?;
        drones.iter().map(|drone| Some((*drone, *all.get(drone)?))).collect()
    };
    let mut found: Vec<_> = (0..length).filter_map(at).collect();
    found.dedup();
    let how = match &mut found[..] {
        [one] => return Ok(std::mem::take(one)),
        [] => "do not fit",
        _ => "fit in several ways",
    };
    let drones = drones.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let names = names.join(", ");
    let problem = format!("the numbers of the drones with curves ({drones}) {how} the names of positions: {names}");
    refuse(ContentKind::AmbiguousTopics, problem, one_kind())
}

/// Positions of vehicles, and their published plans.
struct PlannedFlights {
    positions: Recording,
    plans: Vec<Published>,
    notes: Vec<String>,
    facts: Vec<Fact>,
    /// Metadata of the positions so far, with the notes and the facts above.
    metadata: Metadata,
}

impl PlannedFlights {
    fn refresh(&mut self) {
        self.metadata = self.positions.metadata().clone();
        self.metadata.notes.extend_from_slice(&self.notes);
        self.metadata.facts.extend_from_slice(&self.facts);
    }
}

impl Tracks for PlannedFlights {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        self.positions.vehicles()
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let more = self.positions.read(items);
        self.refresh();
        more
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn plans(&self) -> &[Published] {
        &self.plans
    }
}

/// Returns the time since the epoch \[s\]. Both times are close, so that the difference in nanoseconds is exact.
fn seconds_since(epoch_ns: i64, time_ns: i64) -> f64 {
    time_ns.saturating_sub(epoch_ns) as f64 / NS_PER_S as f64
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

    /// Returns the pieces up to an instant \[s\]. A part that vanishes in the rounding of times is left out.
    fn pieces(
        &self,
        drone: i32,
        vehicle: usize,
        epoch_ns: i64,
        scale: f64,
        until_s: f64,
    ) -> Result<Vec<Piece>, ReadError> {
        let start_s = seconds_since(epoch_ns, self.start_ns);
        let parts =
            self.parts.iter().map(|(from_s, to_s, coefficients)| (start_s + from_s, start_s + to_s, coefficients));
        let parts = parts.filter(|(from_s, to_s, _)| *from_s < until_s && from_s != to_s);
        let pieces = parts.map(|(from_s, to_s, coefficients)| {
            piece(vehicle, from_s, to_s.min(until_s), coefficients.iter().copied(), scale)
                .ok_or_else(Fault::out_of_range)
        });
        pieces.collect::<Result<_, Fault>>().map_err(|fault| fault.at(self.place(drone)))
    }

    fn place(&self, drone: i32) -> Place {
        Place::Part(format!("the curve of drone {drone} that starts at {} ns", self.start_ns))
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
    decode_whole(bytes).map_err(Fault::damaged)
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
                let found = fields(&topic.schema, &topic.definition).replace('\n', ", ");
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
