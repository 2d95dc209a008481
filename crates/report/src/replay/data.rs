//! A replay as a page holds it.

use nalgebra::Vector3;
use serde::Serialize;

use super::chart::Chart;
use super::decimate::{MOST_INSTANTS, Span, around_worst, breaks, chosen, place_of_weightiest, present, shown};
use super::motion::PackedMotion;
use super::obstacle_meshes::{POINT_BYTES, Thing, ground};
use super::stage::{Extent, Targets, targets_of};
use super::statements::{self, Statement, Words};
use super::{
    Kind, LONGEST_NAME, LONGEST_SENTENCE, Moment, NoReplay, Stage, base64_bytes, base64_of, cut, doubles, singles,
};
use crate::flight_log::FlightLog;
use tautline_audit::{Obstacle, Shape};
use tautline_core::swarm::{Rows, row};

/// Most findings.
const MOST_MOMENTS: usize = 200;
/// Most slices of time of the chart.
const MOST_SLICES: usize = 1000;
/// Most sentences on the nearest so far, and on the verdict, and what one takes \[bytes\].
const MOST_SAID: [usize; 2] = [1000, 1000];
const SAID_BYTES: usize = 100;
/// Most points of the way of an obstacle.
const MOST_POINTS: usize = 5000;
/// Rounding of a number in single precision, relative to it.
const SINGLE: f64 = 0.5 * f32::EPSILON as f64;
/// Version of the data.
const VERSION: u32 = 2;

/// A flight as data of a page.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Replay {
    /// The data as JSON without any `<`, so that it may stand in a page's script element.
    pub json: String,
    /// Smallest distance of any two over time.
    pub chart: Chart,
    /// Largest error of a drawn coordinate \[m\].
    pub rounding_m: f64,
    /// Number of instants that are kept, and number of samples.
    pub instants: [usize; 2],
    /// Number of vehicles that are drawn, and number of all that are ever there.
    pub vehicles: [usize; 2],
    /// Number of findings that can be jumped to, and number of all.
    pub moments: [usize; 2],
    /// Whether vehicles are drawn at rest between two instants.
    pub holds: bool,
    /// Number of findings whose very instant, or one of whose vehicles, is not drawn.
    pub inexact: usize,
    /// Number of vehicles without a known radius, where there are any, and the radius that they are drawn with \[m\].
    pub unknown_radius: Option<(usize, f64)>,
    /// Largest distance of a drawn moving obstacle from its way \[m\].
    pub obstacles_off_m: f64,
}

/// What the script reads. Lists of numbers are base64 of their bytes, the least first.
#[derive(Serialize)]
struct Data<'a> {
    version: u32,
    /// Names of the vehicles that are drawn.
    vehicles: Vec<String>,
    /// Radius that each is drawn with \[m\].
    radius_m: Vec<f64>,
    shell_m: Option<[f64; 3]>,
    /// First instant \[s\], which the others are counted from, and the others as doubles.
    times_s: String,
    /// Decimals of a time.
    decimals: usize,
    /// Whether vehicles rest between two instants.
    holds: bool,
    /// What places are drawn from, and from there the middle and half of the box around everything \[m\].
    origin_m: [f64; 3],
    look_m: [f64; 3],
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
    /// Instants and vehicles, as 16-bit places: who was not there all the time since the instant before.
    breaks: String,
    /// From when \[s\] on, as doubles, which two are the nearest by the judge, as 16-bit places in the list of vehicles; 65535
    /// for one that is not drawn.
    near_s: String,
    near_who: String,
    /// What is said from when on \[s\]: of the nearest so far, and of the verdict.
    nearest: Vec<Statement>,
    verdicts: Vec<Verdict>,
    /// In order of time.
    moments: Vec<MomentData<'a>>,
    things: Vec<Thing>,
    #[serde(flatten)]
    targets: Targets,
}

/// From when on \[s\], whether there is a violation, what is said, and who and which obstacle are too near in a violation that cannot
/// be jumped to.
type Verdict = (f64, bool, String, Vec<usize>, Option<usize>);

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
    /// Whether everything is known but for what the moments say.
    pub is_else_known: bool,
    /// What any two must keep, where it is one number for all.
    pub limit: Option<f64>,
    /// What distances are counted in: `m`, or `ellipsoids` for lengths over their axes.
    pub unit: &'static str,
}

impl Replay {
    /// Packs a flight into at most `room_bytes` of JSON.
    ///
    /// Of more than [`MOST_VEHICLES`](super::MOST_VEHICLES), or of more than there is room for fifty instants and those of the
    /// moments of, those of the moments and evenly chosen others are drawn. At most two thousand instants are kept, as [`chosen`]
    /// says. Moments come in the order of their weight: all count for what is said over time, and the first two hundred can be
    /// jumped to. Names and sentences are cut.
    ///
    /// # Errors
    /// [`NoReplay`] where nobody is ever there, somebody is beyond 1e9 m, or there is no room for two instants.
    pub fn new(
        stage: &Stage,
        log: &FlightLog,
        moments: &[Moment],
        judged: Judged,
        room_bytes: usize,
    ) -> Result<Self, NoReplay> {
        let present = present(stage, log)?;
        let [begin_s, end_s] = log.range_s();
        let times_s: Vec<_> = log.keyframes().iter().map(|keyframe| keyframe.time_s).collect();
        let moments: Vec<_> = moments.iter().map(|moment| moment.within(begin_s, end_s)).collect();
        let listed = &moments[..moments.len().min(MOST_MOMENTS)];
        let shown = shown(&times_s, &present, listed, room_bytes);
        let place = |vehicle: usize| shown.binary_search(&vehicle).ok();
        let plan = stage.plan_of(log);
        let (targets, guides) = targets_of(plan.as_ref(), &shown, begin_s, room_bytes / 4);
        let (nearest, holds) = (log.nearest(), log.holds);
        let near = nearest.clone().finish(MOST_SLICES.min(room_bytes / 10 / base64_bytes(SLICE_BYTES)));
        let [near_s, near_who] = statements::pairs(&near, end_s, place);
        let extent = Extent::of(stage, log, &shown);
        let origin_m = place_of_weightiest(log, listed).unwrap_or(extent.middle_m());
        let level_m = stage.obstacles.iter().find_map(ground_m).unwrap_or(extent.low_m.z);
        let (square_m, lines) = ground(extent.low_m, extent.high_m, level_m);
        let most_said = MOST_SAID.map(|most| (room_bytes / 10 / SAID_BYTES).clamp(8, most));
        let has_gaps =
            !judged.is_else_known || moments.iter().any(|of| matches!(of.kind, Kind::Undecided | Kind::Unseen));
        let name = |vehicle: usize| stage.vehicles.get(vehicle).map(|name| cut(name, LONGEST_NAME));
        let words = Words { unit: judged.unit, has_gaps, name };
        let things = obstacle_meshes(stage, &extent, listed, room_bytes);
        let obstacles_off_m = things.iter().map(|thing| thing.off_m).fold(0.0, f64::max);
        let mut data = Data {
            version: VERSION,
            vehicles: shown.iter().map(|&k| cut(&stage.vehicles[k], LONGEST_NAME)).collect(),
            radius_m: shown.iter().map(|&k| stage.drawn_radius_m(k)).collect(),
            shell_m: stage.shell_m,
            times_s: String::new(),
            decimals: decimals(end_s - begin_s),
            holds,
            origin_m: origin_m.into(),
            look_m: (extent.middle_m() - origin_m).into(),
            half_m: extent.half_m().into(),
            square_m,
            ground: singles(&lines.iter().map(|at| at - origin_m).collect::<Vec<_>>()),
            middle_m: [0.0; 3],
            cell_m: 0.0,
            rounding_m: 0.0,
            points: shown.len() + guides.count(),
            starts: String::new(),
            steps: String::new(),
            breaks: String::new(),
            near_s,
            near_who,
            nearest: statements::so_far(&nearest, &words, most_said[0]),
            verdicts: verdicts(&moments, judged.is_else_known, begin_s, most_said[1], &place),
            moments: in_order(listed).map(|moment| moment.data(&place)).collect(),
            things,
            targets,
        };
        let no_room = NoReplay::NoRoom { room_bytes };
        // Beyond a share of the room who was away in between is drawn at neither end.
        let most_breaks = log.gaps.len().min(room_bytes / 10 / BREAK_BYTES);
        let fixed = written(&data).len() + base64_bytes(12 * data.points) + BREAK_BYTES * most_breaks + NUMBERS;
        let of_an_instant = base64_bytes(8 + 6 * data.points);
        let most = room_bytes.saturating_sub(fixed) / of_an_instant.max(1);
        if most < 2 {
            return Err(no_room);
        }
        let spans: Vec<_> = moments.iter().filter(|of| of.kind != Kind::Unseen).map(|moment| moment.span).collect();
        let kept = chosen(&times_s, &spans, most.min(MOST_INSTANTS));
        let mut instants = instants(log, &kept, &shown, |time_s, at_m| guides.at(plan.as_ref(), time_s, at_m));
        let kept_s: Vec<_> = kept.iter().map(|&k| times_s[k]).collect();
        let mut breaks = breaks(log, &kept_s, place);
        for [instant, vehicle] in breaks.split_off(breaks.len().min(most_breaks)) {
            instants[instant][vehicle] = None;
        }
        let motion = PackedMotion::new(&instants);
        let single_m = SINGLE * (extent.low_m - origin_m).amax().max((extent.high_m - origin_m).amax());
        let rounding_m = motion.rounding_m() + single_m;
        data.times_s = doubles(kept_s.into_iter());
        data.breaks =
            base64_of(breaks.iter().flatten().flat_map(|&at| u16::try_from(at).unwrap_or(u16::MAX).to_le_bytes()));
        (data.middle_m, data.cell_m, data.rounding_m) = (motion.middle_m, motion.cell_m, rounding_m);
        data.starts = base64_of(motion.start_bytes().into_iter());
        data.steps = base64_of(motion.step_bytes().into_iter());
        let json = written(&data);
        if json.len() > room_bytes {
            return Err(no_room);
        }
        let is_drawn =
            |of: &Moment| is_kept(log, &times_s, &kept, &of.span) && of.vehicles.iter().all(|&k| place(k).is_some());
        let is_exact = |of: &&Moment| of.kind == Kind::Unseen || is_drawn(of);
        Ok(Self {
            chart: Chart::of(&near, &moments, judged.limit, [begin_s, end_s]),
            json,
            rounding_m,
            instants: [kept.len(), log.samples()],
            vehicles: [shown.len(), present.len()],
            moments: [listed.len(), moments.len()],
            holds,
            inexact: moments.len() - moments.iter().filter(is_exact).count(),
            unknown_radius: stage.unknown_radii(&shown),
            obstacles_off_m,
        })
    }
}

/// What the numbers of the grid take, which are not known before it is chosen \[bytes\].
const NUMBERS: usize = 200;
/// What a closest approach takes \[bytes\].
const SLICE_BYTES: usize = 24;
/// What a break takes \[bytes\].
const BREAK_BYTES: usize = 8;

impl Moment {
    /// The part of it that is shown.
    fn within(&self, begin_s: f64, end_s: f64) -> Self {
        let [from_s, to_s, at_s] =
            [self.span.from_s, self.span.to_s, self.span.at_s].map(|time_s| time_s.max(begin_s).min(end_s));
        Self { span: Span { from_s, to_s, at_s }, ..self.clone() }
    }

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

/// What is said of the verdict, no more than so often.
fn verdicts(
    moments: &[Moment],
    is_else_known: bool,
    begin_s: f64,
    most: usize,
    place: &impl Fn(usize) -> Option<usize>,
) -> Vec<Verdict> {
    let all = statements::over_time(moments, is_else_known, begin_s, most).into_iter();
    let with_unlisted = |(from_s, alarm, said, of): statements::VerdictStatement| {
        let unlisted = of.filter(|&k| k >= MOST_MOMENTS).map(|k| moments[k].data(place));
        let thing = unlisted.as_ref().and_then(|of| of.thing);
        (from_s, alarm, said, unlisted.map_or_else(Vec::new, |of| of.who), thing)
    };
    all.map(with_unlisted).collect()
}

fn in_order(moments: &[Moment]) -> impl Iterator<Item = &Moment> {
    let mut moments: Vec<_> = moments.iter().collect();
    moments.sort_by(|a, b| a.span.at_s.total_cmp(&b.span.at_s));
    moments.into_iter()
}

/// Obstacles, with where they were at the moments that they have a part in.
fn obstacle_meshes(stage: &Stage, extent: &Extent, moments: &[Moment], room_bytes: usize) -> Vec<Thing> {
    let most = (room_bytes / 4 / POINT_BYTES / stage.obstacles.len().max(1)).clamp(4, MOST_POINTS);
    let thing = |(k, obstacle): (usize, &Obstacle)| {
        let own = moments.iter().filter(|moment| moment.obstacle == Some(k));
        let times_s: Vec<_> = own.map(|moment| moment.span.at_s).collect();
        Thing::of(obstacle, extent, &times_s, most)
    };
    stage.obstacles.iter().enumerate().map(thing).collect()
}

/// Places of the vehicles that are drawn, and of guides, at the instants that are kept \[m\]; none where one is not there.
fn instants<G: IntoIterator<Item = Option<Vector3<f64>>>>(
    log: &FlightLog,
    kept: &[usize],
    shown: &[usize],
    guides: impl Fn(f64, &Rows) -> G,
) -> Vec<Vec<Option<Vector3<f64>>>> {
    let there = |at: Vector3<f64>| at.iter().all(|x| x.is_finite()).then_some(at);
    let instant = |&k: &usize| {
        let keyframe = &log.keyframes()[k];
        let vehicles = shown.iter().map(|&vehicle| there(row(&keyframe.positions_m, vehicle)));
        vehicles.chain(guides(keyframe.time_s, &keyframe.positions_m)).collect()
    };
    kept.iter().map(instant).collect()
}

/// Whether the instant at which a span is at its worst is kept, or the two samples on either side.
fn is_kept(log: &FlightLog, times_s: &[f64], kept: &[usize], span: &Span) -> bool {
    let (around, number) = (around_worst(times_s, span), |k: usize| log.keyframes()[k].number);
    let follow = around.clone().zip(around.clone().skip(1)).all(|(a, b)| number(b) - number(a) == 1);
    follow && around.into_iter().all(|k| kept.binary_search(&k).is_ok())
}

/// Decimals of times that tell a hundredth of a flight from the next, at least two.
fn decimals(span_s: f64) -> usize {
    (2..9_u8).find(|&decimals| span_s * 10_f64.powi(i32::from(decimals)) >= 100.0).map_or(9, usize::from)
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
