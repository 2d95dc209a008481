//! A replay as a page holds it.

use std::collections::BTreeSet;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use nalgebra::Vector3;
use serde::Serialize;

use super::chart::Chart;
use super::choice::{MOST_INSTANTS, chosen};
use super::error::NoReplay;
use super::extent::Extent;
use super::film::Film;
use super::mesh;
use super::moment::Moment;
use super::motion::Motion;
use super::stage::Stage;
use super::targets::{self, Targets};
use super::things::{Thing, singles};
use super::words::{LONGEST_NAME, LONGEST_SENTENCE, cut};
use crate::audit::{Obstacle, Shape, Status};
use crate::swarm::row;

/// Most vehicles of a replay: a texture of every graphics card has so many columns, and some for slots.
pub const MOST_VEHICLES: usize = 2000;
/// Fewest instants that vehicles are left out for.
const FEWEST_INSTANTS: usize = 50;
/// Most findings.
const MOST_MOMENTS: usize = 200;
/// Farthest coordinate: beyond, single precision draws nothing well \[m\].
const FARTHEST_M: f64 = 1e9;
/// Version of the data.
const VERSION: u32 = 1;

/// A flight as data of a page.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    json: String,
    chart: Chart,
    rounding_m: f64,
    instants: [usize; 2],
    vehicles: [usize; 2],
    moments: [usize; 2],
}

/// What the script reads. Lists of numbers are base64 of their bytes, the least first.
#[derive(Serialize)]
struct Data<'a> {
    version: u32,
    /// Names of the vehicles that are drawn.
    vehicles: Vec<String>,
    /// Radius of each \[m\]; null where it is not known.
    radius_m: Vec<Option<f64>>,
    shell_m: Option<[f64; 3]>,
    /// First instant \[s\], which the others are counted from, and the others as doubles.
    times_s: String,
    /// What is drawn around, and half of the box around everything \[m\].
    origin_m: [f64; 3],
    half_m: [f64; 3],
    /// Squares on the ground: their side \[m\], and lines from the origin in single precision.
    square_m: f64,
    ground: String,
    /// Corner stones of the grid, and the most that it rounds a coordinate by \[m\].
    middle_m: [f64; 3],
    cell_m: f64,
    rounding_m: f64,
    /// Vehicles first, then the points that carry slots and reference.
    points: usize,
    starts: String,
    steps: String,
    /// Closest approaches over time, by the judge: when \[s\] and how near, as doubles, and the two as 16-bit places in the list of
    /// vehicles, 65535 for one that is not drawn.
    near_s: String,
    near_m: String,
    near_who: String,
    unit: &'a str,
    /// The judge's verdict on all, and whether all findings are here.
    status: Status,
    whole: bool,
    moments: Vec<MomentData<'a>>,
    things: Vec<Thing>,
    #[serde(flatten)]
    targets: Targets,
}

#[derive(Serialize)]
struct MomentData<'a> {
    kind: &'a str,
    /// Places in the list of vehicles; those that are not drawn are left out.
    who: Vec<usize>,
    thing: Option<usize>,
    from_s: f64,
    to_s: f64,
    at_s: f64,
    said: String,
}

/// How it was judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// The verdict.
    pub status: Status,
    /// What any two must keep, where it is one number for all.
    pub limit: Option<f64>,
    /// What distances are counted in: `m`, or `ellipsoids` for lengths over their axes.
    pub unit: &'static str,
}

impl Replay {
    /// Packs a flight into at most `room_bytes` of JSON.
    ///
    /// Of more than [`MOST_VEHICLES`], or of more than there is room for fifty instants of, those of the moments and evenly chosen
    /// others are drawn. At most two thousand instants are kept, as [`chosen`] says; moments come in the order of their
    /// weight, the first two hundred of them count. Names and sentences are cut.
    ///
    /// # Errors
    /// [`NoReplay`] where nobody is ever there, somebody is beyond 1e9 m, or there is no room for two instants.
    pub fn new(
        stage: &Stage,
        film: &Film,
        moments: &[Moment],
        judged: Judged,
        room_bytes: usize,
    ) -> Result<Self, NoReplay> {
        let (all, listed) = (stage.vehicles.len(), &moments[..moments.len().min(MOST_MOMENTS)]);
        check(stage, film)?;
        let shown = shown(film, all, listed, room_bytes);
        let place = |vehicle: usize| shown.binary_search(&vehicle).ok();
        let mut plan = stage.plan.clone();
        if let Some(plan) = &mut plan {
            film.events.iter().for_each(|event| plan.note(event));
        }
        let begin_s = film.times_s.first().copied().unwrap_or(0.0);
        let (targets, guides) = targets::of(plan.as_ref(), &shown, begin_s, room_bytes / 4);
        let near = film.nearest.clone().finish(room_bytes / 5 / base64_bytes(SLICE_BYTES));
        let extent = Extent::of(stage, film, &shown);
        let level_m = stage.obstacles.iter().find_map(ground_m).unwrap_or(extent.low_m.z);
        let (square_m, lines) = mesh::ground(extent.low_m, extent.high_m, level_m);
        let who = |vehicle: usize| place(vehicle).and_then(|at| u16::try_from(at).ok()).unwrap_or(u16::MAX);
        let mut data = Data {
            version: VERSION,
            vehicles: shown.iter().map(|&k| cut(&stage.vehicles[k], LONGEST_NAME)).collect(),
            radius_m: shown.iter().map(|&k| stage.radius_m.get(k).copied().flatten()).collect(),
            shell_m: stage.shell_m,
            times_s: String::new(),
            origin_m: extent.middle_m().into(),
            half_m: extent.half_m().into(),
            square_m,
            ground: singles(&lines.iter().map(|at| at - extent.middle_m()).collect::<Vec<_>>()),
            middle_m: [0.0; 3],
            cell_m: 0.0,
            rounding_m: 0.0,
            points: shown.len() + guides.count(),
            starts: String::new(),
            steps: String::new(),
            near_s: doubles(near.iter().map(|slice| slice.closest.time_s)),
            near_m: doubles(near.iter().map(|slice| slice.closest.separation_m)),
            near_who: BASE64.encode(
                near.iter()
                    .flat_map(|slice| [slice.closest.pair.first(), slice.closest.pair.second()])
                    .flat_map(|vehicle| who(vehicle).to_le_bytes())
                    .collect::<Vec<_>>(),
            ),
            unit: judged.unit,
            status: judged.status,
            whole: listed.len() == moments.len(),
            moments: listed.iter().map(|moment| moment.data(&place)).collect(),
            things: stage.obstacles.iter().map(|obstacle| Thing::of(obstacle, &extent)).collect(),
            targets,
        };
        let no_room = NoReplay::NoRoom { room_bytes };
        let fixed = written(&data).len() + base64_bytes(12 * data.points) + NUMBERS;
        let of_an_instant = base64_bytes(8 + 6 * data.points);
        let most = room_bytes.saturating_sub(fixed) / of_an_instant.max(1);
        if most < 2 {
            return Err(no_room);
        }
        let spans: Vec<_> = listed.iter().map(|moment| moment.span).chain(film.spans.iter().copied()).collect();
        let even = film.even();
        let times_s: Vec<_> = even.iter().map(|&k| film.times_s[k]).collect();
        let kept: Vec<_> = chosen(&times_s, &spans, most.min(MOST_INSTANTS)).into_iter().map(|k| even[k]).collect();
        let instants: Vec<Vec<_>> = kept
            .iter()
            .map(|&k| {
                let (time_s, positions_m) = (film.times_s[k], &film.positions_m[k]);
                let there = |at: Vector3<f64>| at.iter().all(|x| x.is_finite()).then_some(at);
                let vehicles = shown.iter().map(|&vehicle| there(row(positions_m, vehicle)));
                vehicles.chain(guides.at(plan.as_ref(), time_s, positions_m)).collect()
            })
            .collect();
        let motion = Motion::new(&instants);
        data.times_s = doubles(kept.iter().map(|&k| film.times_s[k]));
        (data.middle_m, data.cell_m, data.rounding_m) = (motion.middle_m(), motion.cell_m(), motion.rounding_m());
        data.starts = BASE64.encode(motion.start_bytes());
        data.steps = BASE64.encode(motion.step_bytes());
        let json = written(&data);
        if json.len() > room_bytes {
            return Err(no_room);
        }
        Ok(Self {
            chart: Chart::of(&near, listed, judged.limit, [begin_s, film.times_s.last().copied().unwrap_or(begin_s)]),
            json,
            rounding_m: motion.rounding_m(),
            instants: [kept.len(), film.samples],
            vehicles: [shown.len(), all],
            moments: [listed.len(), moments.len()],
        })
    }

    /// The data as JSON without any `<`, so that it may stand in a page's script element.
    #[must_use]
    pub fn json(&self) -> &str {
        &self.json
    }

    /// How near any two were over time.
    #[must_use]
    pub fn chart(&self) -> &Chart {
        &self.chart
    }

    /// Most that a drawn coordinate is off from what was recorded \[m\].
    #[must_use]
    pub fn rounding_m(&self) -> f64 {
        self.rounding_m
    }

    /// Instants that are kept, and samples that there were.
    #[must_use]
    pub fn instants(&self) -> [usize; 2] {
        self.instants
    }

    /// Vehicles that are drawn, and all.
    #[must_use]
    pub fn vehicles(&self) -> [usize; 2] {
        self.vehicles
    }

    /// Findings that are there to jump to, and all.
    #[must_use]
    pub fn moments(&self) -> [usize; 2] {
        self.moments
    }
}

/// What the numbers of the grid take, which are not known before it is chosen \[bytes\].
const NUMBERS: usize = 200;
/// What a closest approach takes \[bytes\].
const SLICE_BYTES: usize = 20;

impl Moment {
    fn data(&self, place: &impl Fn(usize) -> Option<usize>) -> MomentData<'_> {
        MomentData {
            kind: self.kind.name(),
            who: self.vehicles.iter().filter_map(|&vehicle| place(vehicle)).collect(),
            thing: self.obstacle,
            from_s: self.span.from_s,
            to_s: self.span.to_s,
            at_s: self.span.at_s,
            said: cut(&self.said, LONGEST_SENTENCE),
        }
    }
}

fn check(stage: &Stage, film: &Film) -> Result<(), NoReplay> {
    let mut is_empty = true;
    for (&time_s, positions_m) in std::iter::zip(&film.times_s, &film.positions_m) {
        for vehicle in 0..positions_m.nrows() {
            let at = row(positions_m, vehicle);
            is_empty &= at.iter().any(|x| !x.is_finite());
            if at.iter().any(|x| x.is_finite() && x.abs() > FARTHEST_M) {
                let name = cut(&stage.vehicles[vehicle], LONGEST_NAME);
                return Err(NoReplay::TooFar { name, time_s, farthest_m: FARTHEST_M });
            }
        }
    }
    if is_empty { Err(NoReplay::Empty) } else { Ok(()) }
}

/// The vehicles that are drawn, in order: those of the moments, the weightiest first, and evenly chosen others.
fn shown(film: &Film, all: usize, moments: &[Moment], room_bytes: usize) -> Vec<usize> {
    let instants = film.times_s.len().min(FEWEST_INSTANTS);
    // A share of the room is for everything else.
    let affordable = room_bytes / 2 / base64_bytes(12 + 6 * instants);
    let most = all.min(MOST_VEHICLES).min(affordable.max(2));
    let mut shown = BTreeSet::new();
    let of_moments = moments.iter().flat_map(|moment| moment.vehicles.iter().copied()).filter(|&vehicle| vehicle < all);
    let evenly = (0..most).map(|k| k * all / most.max(1));
    for vehicle in of_moments.chain(evenly).chain(0..all) {
        if shown.len() >= most {
            break;
        }
        shown.insert(vehicle);
    }
    shown.into_iter().collect()
}

/// As JSON that may stand within a page: `<` is written by its number.
fn written(data: &Data<'_>) -> String {
    serde_json::to_string(data).expect("every value has a JSON form").replace('<', "\\u003c")
}

/// The height of an obstacle that is level ground \[m\].
fn ground_m(obstacle: &Obstacle) -> Option<f64> {
    let Shape::HalfSpace { normal } = obstacle.shape else { return None };
    (normal.xy().norm() <= 1e-3 * normal.z).then(|| obstacle.path.first().map(|point| point.1.z)).flatten()
}

fn doubles(numbers: impl Iterator<Item = f64>) -> String {
    BASE64.encode(numbers.flat_map(f64::to_le_bytes).collect::<Vec<_>>())
}

fn base64_bytes(bytes: usize) -> usize {
    4 * bytes.div_ceil(3)
}
