//! Data of a replay in a page.

use nalgebra::Vector3;
use serde::Serialize;

use super::chart::Chart;
use super::decimate::{MOST_INSTANTS, Span, around_worst, breaks, chosen, place_of_weightiest, present, shown};
use super::motion::PackedMotion;
use super::obstacle_meshes::{POINT_BYTES, Thing};
use super::stage::{Targets, swarm_m, targets_of, turn_bytes};
use super::statements::{self, Statement, Words};
use super::{Kind, LONGEST_NAME, LONGEST_SENTENCE, Moment, NoReplay, Stage, base64_bytes, base64_of, cut, doubles};
use crate::drawing::rotors::Airframe;
use crate::drawing::{LIGHT, LIMITS, Limits, Surroundings, TAN_HALF_VIEW, Viewpoint, max_clearance_m};
use crate::figures::{Figure, at_closest};
use crate::flight_log::FlightLog;
use tautline_audit::MovingObstacle;
use tautline_core::swarm::{Rows, row};
use tautline_sim::plan::Plan;

/// Largest number of findings.
const MOST_MOMENTS: usize = 200;
/// Largest number of time slices of the chart.
const MOST_SLICES: usize = 1000;
/// Largest number of statements on the closest pair so far, and on the verdict, and the size of one \[bytes\].
const MOST_SAID: [usize; 2] = [1000, 1000];
const SAID_BYTES: usize = 100;
/// Largest number of points on the path of an obstacle.
const MOST_POINTS: usize = 5000;
/// Relative rounding error of a number in single precision.
const SINGLE: f64 = 0.5 * f32::EPSILON as f64;

/// A flight as data of a page.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Replay {
    /// Data as JSON without any `<`, so that a script element of the page can hold it.
    pub json: String,
    /// Smallest separation of all pairs over time.
    pub chart: Chart,
    /// Picture of the closest approach, for browsers that cannot draw the replay.
    pub still: Figure,
    /// Largest error of a drawn coordinate \[m\].
    pub rounding_m: f64,
    /// Number of kept instants, and number of samples.
    pub instants: [usize; 2],
    /// Number of drawn vehicles, and number of vehicles that are ever present.
    pub vehicles: [usize; 2],
    /// Number of findings to jump to, and number of all findings.
    pub moments: [usize; 2],
    /// Whether vehicles rest between two instants.
    pub holds: bool,
    /// Number of findings whose instant, or one of whose vehicles, is not drawn.
    pub inexact: usize,
    /// Number of vehicles without a known radius, if there are any, and the radius that they are drawn with \[m\].
    pub unknown_radius: Option<(usize, f64)>,
    /// Largest distance of a drawn moving obstacle from its path \[m\].
    pub obstacles_off_m: f64,
}

/// Input of the script. Lists of numbers are base64 of their little-endian bytes.
#[derive(Default, Serialize)]
struct Data<'a> {
    limits: Limits,
    /// Tangent of half the vertical angle of view, and the direction of the light in the axes of the camera.
    tangent: f64,
    light: [f64; 3],
    /// Names of the drawn vehicles.
    vehicles: Vec<String>,
    /// Drawn radius of each vehicle \[m\].
    radius_m: Vec<f64>,
    shell_m: Option<[f64; 3]>,
    /// First instant \[s\], and the other instants relative to it, as doubles.
    times_s: String,
    /// Number of decimals of a time.
    decimals: usize,
    /// Whether vehicles rest between two instants.
    holds: bool,
    /// Origin of all drawn positions, and half of the box around everything \[m\].
    origin_m: [f64; 3],
    half_m: [f64; 3],
    /// Half of the box around all vehicles at any instant and their mean \[m\].
    swarm_m: [f64; 3],
    /// First view, whether it follows the swarm, and whether it shows vehicles as lights.
    viewpoint: Viewpoint,
    follows: bool,
    lights: bool,
    /// Clearance with the last colour \[m\].
    clearance_m: f64,
    /// Side of the squares on the ground, and two corners of the ground relative to the origin \[m\].
    square_m: f64,
    ground: [[f64; 3]; 2],
    /// Origin of the grid of positions, and its largest rounding error \[m\].
    middle_m: [f64; 3],
    cell_m: f64,
    rounding_m: f64,
    /// Number of points: the vehicles, then the points that carry slots and reference.
    points: usize,
    starts: String,
    steps: String,
    /// Rotors of every vehicle. Attitudes are three signed bytes for each vehicle, instant by instant.
    rotors: Option<Airframe>,
    turns: String,
    /// Instants and vehicles, as 16-bit indices: vehicles that were absent at some time since the previous instant.
    breaks: String,
    /// Times \[s\], as doubles, from which a pair is the closest by the audit. The pairs are 16-bit indices in the list
    /// of vehicles, with 65535 for a vehicle that is not drawn.
    near_s: String,
    near_who: String,
    /// Statements and the times \[s\] from which they hold: on the closest pair so far, and on the verdict.
    nearest: Vec<Statement>,
    verdicts: Vec<Verdict>,
    /// Findings in order of time.
    moments: Vec<MomentData<'a>>,
    things: Vec<Thing>,
    #[serde(flatten)]
    targets: Targets,
}

/// Start \[s\], whether a violation is present, the statement, and the vehicles and the obstacle of a violation that
/// has no entry to jump to.
type Verdict = (f64, bool, String, Vec<usize>, Option<usize>);

#[derive(Serialize)]
struct MomentData<'a> {
    kind: &'a str,
    /// Indices in the list of vehicles, without vehicles that are not drawn.
    who: Vec<usize>,
    thing: Option<usize>,
    from_s: f64,
    to_s: f64,
    at_s: f64,
    said: String,
}

impl Data<'_> {
    /// Returns the data without a flight.
    fn blank() -> Self {
        Self { limits: LIMITS, tangent: TAN_HALF_VIEW, light: LIGHT, ..Self::default() }
    }
}

/// Properties of the judgement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgementContext {
    /// Whether the audit decided everything besides the findings.
    pub is_else_known: bool,
    /// Limit of separations, if it is the same for all pairs.
    pub limit: Option<f64>,
    /// Unit of distances: `m`, or `ellipsoids` for lengths over their axes.
    pub unit: &'static str,
}

impl Replay {
    /// Returns the JSON of a live view without vehicles, which its page fills.
    pub(crate) fn empty_json() -> String {
        let viewpoint = Viewpoint { azimuth_deg: -60.0, elevation_deg: 30.0, across: None };
        written(&Data { decimals: 1, viewpoint, ..Data::blank() })
    }

    /// Packs a flight into at most `room_bytes` of JSON.
    ///
    /// If there are more than [`MOST_VEHICLES`](super::MOST_VEHICLES), or too many for the room, the vehicles of the
    /// findings and evenly chosen others are drawn. The room must suffice for fifty instants and those of the findings.
    /// At most two thousand instants are kept, see [`chosen`]. `moments` are in order of gravity. All of them count for
    /// the statements over time, and the first two hundred can be jumped to. Names and sentences are cut.
    ///
    /// # Errors
    /// [`NoReplay`] if no vehicle is ever present, a vehicle is beyond 1e9 m, or two instants do not fit.
    pub fn new(
        stage: &Stage,
        log: &FlightLog,
        moments: &[Moment],
        judged: JudgementContext,
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
        let nearest = log.nearest();
        let near = nearest.clone().finish(MOST_SLICES.min(room_bytes / 10 / base64_bytes(SLICE_BYTES)));
        let [near_s, near_who] = statements::pairs(&near, log, place);
        let around = stage.surroundings(log, &shown);
        let origin_m = place_of_weightiest(log, listed).unwrap_or(around.middle_m());
        let swarm_m = swarm_m(log, &shown).add_scalar(around.around_m);
        let most_said = MOST_SAID.map(|most| (room_bytes / 10 / SAID_BYTES).clamp(8, most));
        let has_gaps =
            !judged.is_else_known || moments.iter().any(|of| matches!(of.kind, Kind::Undecided | Kind::Unseen));
        let name = |vehicle: usize| stage.vehicles.get(vehicle).map(|name| cut(name, LONGEST_NAME));
        let words = Words { unit: judged.unit, limit: judged.limit, has_gaps, name };
        let things = obstacle_meshes(stage, &around, listed, room_bytes);
        let mut data = Data {
            vehicles: shown.iter().map(|&k| cut(&stage.vehicles[k], LONGEST_NAME)).collect(),
            radius_m: shown.iter().map(|&k| stage.drawn_radius_m(k)).collect(),
            shell_m: stage.shell_m,
            decimals: decimals(end_s - begin_s),
            holds: log.holds,
            origin_m: origin_m.into(),
            half_m: around.half_m().into(),
            swarm_m: swarm_m.into(),
            follows: around.is_far_for(swarm_m.norm()),
            viewpoint: stage.viewpoint(log),
            lights: plan.as_ref().is_some_and(Plan::is_show),
            clearance_m: max_clearance_m(stage.delta_m(), shown.iter().map(|&k| stage.drawn_radius_m(k))),
            square_m: around.ground.step_m,
            ground: around.ground.corners_m.map(|corner| (corner - origin_m).into()),
            points: shown.len() + guides.count(),
            rotors: stage.rotors.map(|rotors| rotors.airframe()),
            near_s,
            near_who,
            nearest: statements::so_far(&nearest, &words, most_said[0]),
            verdicts: verdicts(&moments, judged.is_else_known, begin_s, most_said[1], &place),
            moments: in_order(listed).map(|moment| moment.data(&place)).collect(),
            things,
            targets,
            ..Data::blank()
        };
        // Breaks take a bounded share of the room. Beyond it, a vehicle that was absent in between is drawn at neither
        // end.
        let most_breaks = log.gaps.len().min(room_bytes / 10 / BREAK_BYTES);
        let fixed = written(&data).len() + base64_bytes(12 * data.points) + BREAK_BYTES * most_breaks + NUMBERS;
        let turns = if stage.rotors.is_some() { 3 * shown.len() } else { 0 };
        let of_an_instant = base64_bytes(8 + 6 * data.points + turns);
        let most = room_bytes.saturating_sub(fixed) / of_an_instant.max(1);
        if most < 2 {
            return Err(NoReplay::NoRoom { room_bytes });
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
        let single_m = SINGLE * ((around.middle_m() - origin_m).abs() + around.half_m()).max();
        let rounding_m = motion.rounding_m() + single_m;
        data.times_s = doubles(kept_s.into_iter());
        data.breaks =
            base64_of(breaks.iter().flatten().flat_map(|&at| u16::try_from(at).unwrap_or(u16::MAX).to_le_bytes()));
        (data.middle_m, data.cell_m, data.rounding_m) = (motion.middle_m, motion.cell_m, rounding_m);
        (data.starts, data.steps) =
            (base64_of(motion.start_bytes().into_iter()), base64_of(motion.step_bytes().into_iter()));
        let turned = kept.iter().flat_map(|&k| turn_bytes(&log.keyframes()[k].attitudes, &shown));
        data.turns = base64_of(turned.take(turns * kept.len()));
        let json = written(&data);
        if json.len() > room_bytes {
            return Err(NoReplay::NoRoom { room_bytes });
        }
        let is_drawn =
            |of: &Moment| is_kept(log, &times_s, &kept, &of.span) && of.vehicles.iter().all(|&k| place(k).is_some());
        let is_exact = |of: &&Moment| of.kind == Kind::Unseen || is_drawn(of);
        Ok(Self {
            chart: Chart::of(&near, &moments, judged, [begin_s, end_s]),
            still: still(stage, log, &moments),
            json,
            rounding_m,
            instants: [kept.len(), log.samples()],
            vehicles: [shown.len(), present.len()],
            moments: [listed.len(), moments.len()],
            holds: log.holds,
            inexact: moments.len() - moments.iter().filter(is_exact).count(),
            unknown_radius: stage.unknown_radii(&shown),
            obstacles_off_m: data.things.iter().map(|thing| thing.off_m).fold(0.0, f64::max),
        })
    }
}

/// Returns a picture of the closest approach of two vehicles, or of the start.
fn still(stage: &Stage, log: &FlightLog, moments: &[Moment]) -> Figure {
    let closest = moments.iter().find(|of| of.kind == Kind::Closest && of.vehicles.len() == 2);
    let closest = closest.map(|of| ([of.vehicles[0], of.vehicles[1]], of.span.at_s));
    at_closest("", log, &stage.obstacles, closest, &[])
}

/// Size of the numbers of the grid, which is chosen later \[bytes\].
const NUMBERS: usize = 200;
/// Size of a closest approach \[bytes\].
const SLICE_BYTES: usize = 24;
/// Size of a break \[bytes\].
const BREAK_BYTES: usize = 8;

impl Moment {
    /// Returns the finding, cut to the shown time.
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

/// Returns the statements on the verdict, at most [`MOST_SAID`].
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

/// Returns the obstacles, with their positions at the findings that involve them.
fn obstacle_meshes(stage: &Stage, around: &Surroundings, moments: &[Moment], room_bytes: usize) -> Vec<Thing> {
    let most = (room_bytes / 4 / POINT_BYTES / stage.obstacles.len().max(1)).clamp(4, MOST_POINTS);
    let thing = |(k, obstacle): (usize, &MovingObstacle)| {
        let own = moments.iter().filter(|moment| moment.obstacle == Some(k));
        let times_s: Vec<_> = own.map(|moment| moment.span.at_s).collect();
        Thing::of(obstacle, around, &times_s, most)
    };
    stage.obstacles.iter().enumerate().map(thing).collect()
}

/// Returns the positions of the drawn vehicles and of the guides at the kept instants \[m\]; `None` for an absent one.
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

/// Returns whether the worst instant of a span is kept, or else the two samples around it.
fn is_kept(log: &FlightLog, times_s: &[f64], kept: &[usize], span: &Span) -> bool {
    let (around, number) = (around_worst(times_s, span), |k: usize| log.keyframes()[k].number);
    let follow = around.clone().zip(around.clone().skip(1)).all(|(a, b)| number(b) - number(a) == 1);
    follow && around.into_iter().all(|k| kept.binary_search(&k).is_ok())
}

/// Returns the decimals of times that distinguish hundredths of a flight, at least two.
fn decimals(span_s: f64) -> usize {
    (2..9_u8).find(|&decimals| span_s * 10_f64.powi(i32::from(decimals)) >= 100.0).map_or(9, usize::from)
}

/// Returns JSON that a page can hold: `<` is escaped.
fn written(data: &Data<'_>) -> String {
    serde_json::to_string(data).expect("every value has a JSON form").replace('<', "\\u003c")
}
