//! `[reference]` of the scenario file: its keys, and the motion that they describe.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::{All, Point, Vehicles};
use super::error::{ErrorKind, ScenarioError, entry_key};
use super::limits::SMALLEST;
use tautline_laws::graph::Pinning;
use tautline_laws::target::{Guidance, ReferenceMotion, Spline};

/// Ratio of the largest to the mean speed of a motion from rest to rest.
const PEAK_OVER_MEAN: f64 = 15.0 / 8.0;

/// Ratio of the speed between two points to the neighbouring speeds above which the motion counts as a jump.
const JUMP: f64 = 10.0;

/// Motion of the reference, which carries the formations, and the vehicles that know it.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ReferenceTable {
    /// Vehicles that know the reference: `"all"`, or a list of vehicles; all unless this or `leader` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Vehicles")]
    pub(super) known_by: Option<Vehicles>,
    /// Vehicle that follows only the reference; the other vehicles follow the leader.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) leader: Option<u64>,
    /// Whether all vehicles receive the acceleration of the reference.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    #[schemars(extend("default" = true))]
    pub(super) feed_forward: bool,
    #[schemars(flatten)]
    pub(super) kind: ReferenceKind,
}

fn yes() -> bool {
    true
}

/// Motion of the reference.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(tag = "kind")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) enum ReferenceKind {
    /// A constant position, relative to which slots are absolute.
    Rest {
        /// Position in m; the origin unless given.
        #[serde(default = "origin")]
        position_m: Point,
    },
    /// A constant velocity.
    Velocity {
        /// Position at time 0 in m; the origin unless given.
        #[serde(default = "origin")]
        position_m: Point,
        /// Velocity in m/s.
        velocity_m_s: Point,
    },
    /// Around a circle at constant z, counterclockwise seen from above, from the point of largest x.
    Circle {
        /// Centre in m; the origin unless given.
        #[serde(default = "origin")]
        centre_m: Point,
        /// Radius in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_m: f64,
        /// Time of one turn in s; clockwise if negative.
        period_s: f64,
    },
    /// Straight lines between points, from rest to rest.
    WayPoints {
        /// Points in m.
        points_m: Vec<Point>,
        /// Time at each point in s. Without it, the motion starts at time 0, and each line takes the time that
        /// `speed_m_s` requires.
        times_s: Option<Vec<f64>>,
        /// Largest speed between points in m/s, instead of `times_s`.
        #[schemars(extend("exclusiveMinimum" = 0))]
        speed_m_s: Option<f64>,
    },
    /// A natural cubic spline in time through points, without stops. The times must cover the flight.
    Spline {
        /// Points in m.
        points_m: Vec<Point>,
        /// Time at each point in s.
        times_s: Vec<f64>,
    },
    /// The spline through the points of a file.
    File {
        /// Text file with one line per point: t in s, x, y and optionally z in m, separated by commas, semicolons, tabs
        /// or blanks. A first line may name the columns. Relative to the folder of the scenario file.
        file: PathBuf,
    },
}

fn origin() -> Point {
    Point::Space([0.0; 3])
}

impl ReferenceTable {
    /// Returns the motion and the vehicles that know it, for the number of vehicles and the duration of the flight.
    pub(super) fn guidance(&self, count: usize, duration_s: f64) -> Result<Guidance, ScenarioError> {
        Ok(Guidance {
            motion: self.kind.motion(duration_s)?,
            known_by: self.pinning(count)?,
            feed_forward: self.feed_forward,
        })
    }

    /// Replaces a file, named relative to a folder, by its points.
    pub(super) fn resolve_path(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        if let ReferenceKind::File { file } = &self.kind {
            self.kind = ReferenceKind::of_file(&folder.join(file))?;
        }
        Ok(())
    }

    /// Returns whether the motion stays in the plane z = 0.
    pub(super) fn is_flat(&self) -> bool {
        let flat = |points: &[Point]| points.iter().all(|point| point.coordinates()[2] == 0.0);
        match &self.kind {
            ReferenceKind::Rest { position_m } => flat(&[*position_m]),
            ReferenceKind::Velocity { position_m, velocity_m_s } => flat(&[*position_m, *velocity_m_s]),
            ReferenceKind::Circle { centre_m, .. } => flat(&[*centre_m]),
            ReferenceKind::WayPoints { points_m, .. } | ReferenceKind::Spline { points_m, .. } => flat(points_m),
            ReferenceKind::File { .. } => true,
        }
    }

    fn pinning(&self, count: usize) -> Result<Pinning, ScenarioError> {
        let index = |number: u64, key: &'static str| {
            let index = usize::try_from(number).ok().and_then(|number| number.checked_sub(1));
            index.filter(|&index| index < count).ok_or_else(|| {
                let problem = format!("the vehicle must be from 1 to {count}, got {number}");
                ErrorKind::UnknownVehicle.at(&[key], problem, "vehicles are counted from 1")
            })
        };
        match (&self.known_by, self.leader) {
            (Some(_), Some(_)) => {
                let problem = "both `known_by` and `leader` are given";
                let help = "keep one of them: only the leader knows its reference";
                Err(ErrorKind::ExclusiveKeys.at(&["reference.leader", "reference.known_by"], problem, help))
            }
            (None, Some(leader)) => Ok(Pinning::Leader(index(leader, "reference.leader")?)),
            (None | Some(Vehicles::All(All::All)), None) => Ok(Pinning::All),
            (Some(Vehicles::Listed(listed)), None) => {
                let listed = listed.iter().map(|&number| index(number, "reference.known_by"));
                let mut listed = listed.collect::<Result<Vec<_>, _>>()?;
                listed.sort_unstable();
                listed.dedup();
                if listed.is_empty() {
                    let problem = "no vehicle knows the reference";
                    let help = "list at least one vehicle, or leave out `known_by`: then all vehicles know it";
                    return Err(ErrorKind::Inconsistent.at(&["reference.known_by"], problem, help));
                }
                Ok(if listed.len() == count { Pinning::All } else { Pinning::Listed(listed) })
            }
        }
    }
}

impl ReferenceKind {
    fn of_file(file: &Path) -> Result<Self, ScenarioError> {
        let (times_s, points_m) = super::files::timed_positions(file)?;
        Ok(Self::Spline { points_m, times_s })
    }

    fn motion(&self, duration_s: f64) -> Result<ReferenceMotion, ScenarioError> {
        Ok(match self {
            &Self::Rest { position_m } => ReferenceMotion::Rest { position_m: position_m.coordinates().into() },
            &Self::Velocity { position_m, velocity_m_s } => ReferenceMotion::Velocity {
                from_m: position_m.coordinates().into(),
                velocity_m_s: velocity_m_s.coordinates().into(),
            },
            &Self::Circle { centre_m, radius_m, period_s } => {
                if period_s.abs() < SMALLEST {
                    let message = format!("the period must be at least {SMALLEST:e} s in magnitude, got {period_s} s");
                    let help = "give a longer period; a negative one turns clockwise";
                    return Err(ErrorKind::OutOfRange.at(&["reference.period_s"], message, help));
                }
                ReferenceMotion::Circle { centre_m: centre_m.coordinates().into(), radius_m, period_s }
            }
            Self::WayPoints { points_m, times_s, speed_m_s } => {
                let mut points_m = places(points_m)?;
                if times_s.is_none() {
                    // A repeated point would take no time.
                    points_m.dedup();
                }
                let times_s = match (times_s, speed_m_s) {
                    (Some(times_s), None) => times_s.clone(),
                    (None, Some(speed_m_s)) => timed(&points_m, *speed_m_s),
                    _ => {
                        let problem = "way points need either `times_s` or `speed_m_s`";
                        let help = "give the time at each point, or the largest speed between them";
                        let keys = ["reference.times_s", "reference.speed_m_s", "reference.points_m"];
                        return Err(ErrorKind::MissingKey.at(&keys, problem, help));
                    }
                };
                ReferenceMotion::WayPoints { points: in_time(&points_m, &times_s)? }
            }
            Self::Spline { points_m, times_s } => {
                let points = in_time(&places(points_m)?, times_s)?;
                check_span(&points, duration_s)?;
                check_steady(&points)?;
                let spline = Spline::through(&points).ok_or_else(|| {
                    let problem = "no curve goes through the points";
                    let help = "give finite points, and times that increase";
                    ErrorKind::Reference.at(&["reference.points_m"], problem, help)
                })?;
                ReferenceMotion::Table(spline)
            }
            Self::File { file } => Self::of_file(file)?.motion(duration_s)?,
        })
    }
}

fn places(points_m: &[Point]) -> Result<Vec<Vector3<f64>>, ScenarioError> {
    if points_m.is_empty() {
        let problem = "the reference has no points";
        let help = "give points_m = [[x, y], ...]";
        return Err(ErrorKind::MissingKey.at(&["reference.points_m"], problem, help));
    }
    Ok(points_m.iter().map(|point| point.coordinates().into()).collect())
}

/// Returns the time at each point for a largest speed \[s\]; consecutive points must differ.
fn timed(points_m: &[Vector3<f64>], speed_m_s: f64) -> Vec<f64> {
    let mut time_s = 0.0;
    let ways = points_m.windows(2).map(|way| PEAK_OVER_MEAN * (way[1] - way[0]).norm() / speed_m_s);
    std::iter::once(0.0)
        .chain(ways.map(|length_s| {
            time_s += length_s;
            time_s
        }))
        .collect()
}

/// Pairs points with their times, which must increase.
fn in_time(points_m: &[Vector3<f64>], times_s: &[f64]) -> Result<Vec<(f64, Vector3<f64>)>, ScenarioError> {
    if points_m.len() != times_s.len() {
        let problem = format!("{} points and {} times", points_m.len(), times_s.len());
        let help = "give a time for each point";
        return Err(ErrorKind::CountMismatch.at(&["reference.times_s", "reference.points_m"], problem, help));
    }
    for (k, &time_s) in times_s.iter().enumerate() {
        if k > 0 && time_s <= times_s[k - 1] {
            let (before_s, moves) = (times_s[k - 1], points_m[k] != points_m[k - 1]);
            let said = if time_s == before_s && moves {
                format!("the reference jumps at {time_s} s from point {k} to point {}", k + 1)
            } else {
                format!("time {} of the reference must be more than {before_s} s, got {time_s} s", k + 1)
            };
            let help = "times must increase; for a jump of the formation use a [[leg]]";
            return Err(ErrorKind::Reference.at(&[&entry_key("reference.times_s", k)], said, help));
        }
    }
    Ok(times_s.iter().copied().zip(points_m.iter().copied()).collect())
}

/// Refuses a curve that does not cover the flight.
fn check_span(points: &[(f64, Vector3<f64>)], duration_s: f64) -> Result<(), ScenarioError> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Ok(()) };
    if first.0 > 0.0 || last.0 < duration_s {
        let problem =
            format!("the reference must cover the flight from 0 to {duration_s} s, got {} to {} s", first.0, last.0);
        let help = "give points from time 0 to the end of the flight, or shorten time.duration_s";
        return Err(ErrorKind::OutsideFlight.at(&["reference.times_s", "time.duration_s"], problem, help));
    }
    Ok(())
}

/// Refuses a speed far above the neighbouring speeds: a jump, around which a spline would oscillate.
fn check_steady(points: &[(f64, Vector3<f64>)]) -> Result<(), ScenarioError> {
    let speeds_m_s: Vec<f64> =
        points.windows(2).map(|way| (way[1].1 - way[0].1).norm() / (way[1].0 - way[0].0)).collect();
    let is_jump = |k: &usize| {
        let before = k.checked_sub(1).map(|before| speeds_m_s[before]);
        let around = before.into_iter().chain(speeds_m_s.get(k + 1).copied()).reduce(f64::max);
        around.is_some_and(|around| speeds_m_s[*k] > JUMP * around)
    };
    let Some(k) = (0..speeds_m_s.len()).find(is_jump) else { return Ok(()) };
    let problem = format!(
        "the reference jumps between {} and {} s: its speed of {:.3e} m/s is more than {JUMP} times the speeds before \
         and after",
        points[k].0,
        points[k + 1].0,
        speeds_m_s[k]
    );
    let help = "add points in between, or set reference.kind to \"way-points\", which rests at each point";
    Err(ErrorKind::Reference.at(&[&entry_key("reference.points_m", k + 1)], problem, help))
}

impl From<&Guidance> for ReferenceTable {
    fn from(guidance: &Guidance) -> Self {
        let point = |v: Vector3<f64>| Point::Space([v.x, v.y, v.z]);
        let split = |points: &mut dyn Iterator<Item = (f64, Vector3<f64>)>| -> (Vec<f64>, Vec<Point>) {
            points.map(|(time_s, place_m)| (time_s, point(place_m))).unzip()
        };
        let kind = match &guidance.motion {
            &ReferenceMotion::Rest { position_m } => ReferenceKind::Rest { position_m: point(position_m) },
            &ReferenceMotion::Velocity { from_m, velocity_m_s } => {
                ReferenceKind::Velocity { position_m: point(from_m), velocity_m_s: point(velocity_m_s) }
            }
            &ReferenceMotion::Circle { centre_m, radius_m, period_s } => {
                ReferenceKind::Circle { centre_m: point(centre_m), radius_m, period_s }
            }
            ReferenceMotion::WayPoints { points } => {
                let (times_s, points_m) = split(&mut points.iter().copied());
                ReferenceKind::WayPoints { points_m, times_s: Some(times_s), speed_m_s: None }
            }
            ReferenceMotion::Table(spline) => {
                let (times_s, points_m) = split(&mut spline.points());
                ReferenceKind::Spline { points_m, times_s }
            }
        };
        let (known_by, leader) = match &guidance.known_by {
            Pinning::Unpinned => (Some(Vehicles::Listed(Vec::new())), None),
            Pinning::All => (None, None),
            Pinning::Listed(listed) => {
                (Some(Vehicles::Listed(listed.iter().map(|&vehicle| vehicle as u64 + 1).collect())), None)
            }
            &Pinning::Leader(leader) => (None, Some(leader as u64 + 1)),
        };
        Self { known_by, leader, feed_forward: guidance.feed_forward, kind }
    }
}
