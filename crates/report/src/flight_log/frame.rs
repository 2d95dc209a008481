//! State of a flight at any time, also between keyframes.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{FlightLog, closer};
use tautline_core::record::Sample;
use tautline_core::swarm::{ClosestApproach, Pair, Rows, row};
use tautline_laws::space::{Metric, closest_pair};

/// Largest number of vehicles for which each frame searches the closest pair.
const SEARCHED_VEHICLES: usize = 2000;
/// Name and columns of the channel of attitudes: quaternions that turn body into world.
const CHANNEL: &str = "attitude";
const COLUMNS: [&str; 4] = ["qw", "qx", "qy", "qz"];
/// Distances that differ by less, relative to their size, are equal up to rounding.
const ROUNDING: f64 = 1e-9;
/// Smallest norm of a valid quaternion.
const LEAST_NORM: f64 = 1e-6;

/// Attitudes of the vehicles; `None` for a vehicle with unknown attitude. Empty if no attitude is recorded.
pub type Attitudes = Vec<Option<UnitQuaternion<f64>>>;

/// A flight at one time.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The time \[s\].
    pub time_s: f64,
    /// Positions \[m\], N x 3; NaN for an absent vehicle.
    pub positions_m: Rows,
    /// Rotation from the body of each vehicle to the world, if recorded; otherwise empty.
    pub attitudes: Attitudes,
    /// Commanded accelerations \[m/s^2\] at the last sample, if recorded.
    pub control_m_s2: Option<Rows>,
    /// The two nearest vehicles and their distance \[m\].
    pub nearest: Option<(Pair, f64)>,
    /// Closest approach up to this time.
    pub so_far: Option<ClosestApproach>,
    /// Index of the last keyframe at or before this time.
    pub keyframe: usize,
    /// Metric of distances between vehicles.
    metric: Metric,
    /// Closest approach between the keyframes around this time.
    around: Option<ClosestApproach>,
    /// Approaches that the judge measured at exactly this time.
    measured: Vec<ClosestApproach>,
}

impl Frame {
    /// Returns the rotation from the body of a vehicle to the world, if known.
    #[must_use]
    pub fn attitude(&self, vehicle: usize) -> Option<UnitQuaternion<f64>> {
        self.attitudes.get(vehicle).copied().flatten()
    }

    /// Returns the distance of a pair \[m\], scaled with ellipsoids; NaN if a vehicle of the pair is absent.
    ///
    /// If the judge measured the pair at exactly this time, the distance is the smallest one of the judge. Otherwise
    /// it is the distance on straight lines between samples, but at least the closest approach that the judge measured
    /// around this time.
    #[must_use]
    pub fn distance_m(&self, pair: Pair) -> f64 {
        let measured = self.measured.iter().filter(|measured| measured.pair == pair);
        if let Some(measured_m) = measured.map(|measured| measured.separation_m).reduce(f64::min) {
            return measured_m;
        }
        let drawn_m = apart(&self.positions_m, pair, self.metric).norm();
        self.around.map_or(drawn_m, |around| if drawn_m < around.separation_m { around.separation_m } else { drawn_m })
    }
}

impl FlightLog {
    /// Returns the flight at a time \[s\], which is clamped to [`FlightLog::range_s`]; between two keyframes every
    /// vehicle moves on a straight line. None without keyframes.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Frame> {
        let [first_s, last_s] = self.range_s();
        let time_s = if time_s.is_nan() { first_s } else { time_s.clamp(first_s, last_s) };
        let positions_m = self.positions_m(time_s)?;
        let keyframe = self.keyframes.partition_point(|keyframe| keyframe.time_s <= time_s).checked_sub(1)?;
        let before = &self.keyframes[keyframe];
        let (mut so_far, mut around) = (before.so_far, before.closest);
        if let Some(after) = self.keyframes.get(keyframe + 1).filter(|_| time_s > before.time_s) {
            so_far = closer(so_far, after.closest.filter(|approach| approach.time_s <= time_s));
            around = after.closest;
        }
        // With many vehicles, the pair of the last closest approach is taken as the nearest pair.
        let pair = match (around, before.closest) {
            (Some(around), _) if around.time_s == time_s => Some(around.pair),
            (_, Some(before)) if self.count() > SEARCHED_VEHICLES => Some(before.pair),
            _ => nearest_present(&positions_m, self.metric())
                .map(|(pair, _)| first_of_ties(&positions_m, pair, self.metric())),
        };
        let worst = self.violations().of_vehicles().filter(|found| found.min_m.is_finite());
        let worst = worst.map(|v| ClosestApproach { pair: v.pair, separation_m: v.min_m, time_s: v.min_at_s });
        let worst: Vec<_> = worst.filter(|worst| worst.time_s <= time_s).collect();
        so_far = worst.iter().fold(so_far, |so_far, &worst| closer(so_far, Some(worst)));
        let measured = around.into_iter().chain(worst).filter(|measured| measured.time_s == time_s).collect();
        let mut frame = Frame {
            time_s,
            positions_m,
            attitudes: self.attitudes(time_s, keyframe),
            control_m_s2: before.control_m_s2.clone(),
            nearest: None,
            so_far,
            keyframe,
            metric: self.metric(),
            around,
            measured,
        };
        frame.nearest = pair.map(|pair| (pair, frame.distance_m(pair)));
        let now = frame.nearest.filter(|(_, distance_m)| distance_m.is_finite());
        frame.so_far = closer(so_far, now.map(|(pair, separation_m)| ClosestApproach { pair, separation_m, time_s }));
        Some(frame)
    }

    /// Returns the positions at a time \[s\] that is not before the first keyframe: N x 3 \[m\].
    #[must_use]
    pub fn positions_m(&self, time_s: f64) -> Option<Rows> {
        let next = self.keyframes.partition_point(|keyframe| keyframe.time_s <= time_s);
        let before = &self.keyframes[next.checked_sub(1)?];
        let mut positions_m = before.positions_m.clone();
        if let Some(after) = self.keyframes.get(next).filter(|_| time_s > before.time_s) {
            let part = (time_s - before.time_s) / (after.time_s - before.time_s);
            positions_m.zip_apply(&after.positions_m, |here, there| *here += (there - *here) * part);
        }
        Some(positions_m)
    }

    /// Returns the attitudes at a time \[s\] from this keyframe to the next, on the shorter rotation. A vehicle with
    /// unknown attitude at the next keyframe keeps the attitude of this keyframe.
    fn attitudes(&self, time_s: f64, keyframe: usize) -> Attitudes {
        let before = &self.keyframes[keyframe];
        let Some(after) = self.keyframes.get(keyframe + 1).filter(|_| time_s > before.time_s) else {
            return before.attitudes.clone();
        };
        let part = (time_s - before.time_s) / (after.time_s - before.time_s);
        let turned = |(k, from): (usize, &Option<UnitQuaternion<f64>>)| {
            let (from, to) = ((*from)?, after.attitudes.get(k).copied().flatten());
            // Half a turn has no shorter rotation.
            to.and_then(|to| from.try_slerp(&to, part, f64::EPSILON)).or(Some(from))
        };
        before.attitudes.iter().enumerate().map(turned).collect()
    }
}

/// Returns the attitudes of a sample.
#[must_use]
pub fn attitudes_of(sample: &Sample<'_>) -> Attitudes {
    let is_it = |columns: &[String]| columns.iter().eq(&COLUMNS);
    let channel = sample.channels.iter().find(|channel| &*channel.name == CHANNEL && is_it(&channel.columns));
    let rows = channel.map_or(&[][..], |channel| &channel.values).chunks_exact(COLUMNS.len());
    let attitude = |row: &[f64]| {
        let turn = Quaternion::new(row[0], row[1], row[2], row[3]);
        UnitQuaternion::try_new(turn, LEAST_NORM).filter(|turn| turn.coords.iter().all(|x| x.is_finite()))
    };
    if rows.len() == sample.swarm.count() { rows.map(attitude).collect() } else { Attitudes::new() }
}

/// Returns the scaled vector from the first vehicle of a pair to the second.
pub(super) fn apart(positions_m: &Rows, pair: Pair, metric: Metric) -> Vector3<f64> {
    metric.scaled(row(positions_m, pair.second()) - row(positions_m, pair.first()))
}

/// Returns the first pair, in the order of vehicles, whose distance is that of `pair` or smaller, up to rounding. A
/// swarm of more than [`SEARCHED_VEHICLES`] is not searched.
pub(super) fn first_of_ties(positions_m: &Rows, pair: Pair, metric: Metric) -> Pair {
    let count = positions_m.nrows();
    let most_m = apart(positions_m, pair, metric).norm() * (1.0 + ROUNDING);
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| Pair::new(i, j)));
    let mut ties = pairs.take_while(|other| *other < pair && count <= SEARCHED_VEHICLES);
    ties.find(|other| apart(positions_m, *other, metric).norm() <= most_m).unwrap_or(pair)
}

/// Returns the nearest two present vehicles and their scaled distance \[m\].
pub(crate) fn nearest_present(positions_m: &Rows, metric: Metric) -> Option<(Pair, f64)> {
    let is_there = |i: &usize| row(positions_m, *i).iter().all(|x| x.is_finite());
    let there: Vec<usize> = (0..positions_m.nrows()).filter(is_there).collect();
    let (pair, distance_m) = closest_pair(&metric.scaled_rows(&positions_m.select_rows(&there)))?;
    Some((Pair::new(there[pair.first()], there[pair.second()]), distance_m))
}
