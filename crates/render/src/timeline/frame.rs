//! A flight at a time of it, as it was recorded and as it is drawn.

use nalgebra::UnitQuaternion;

use tautline_core::swarm::{ClosestApproach, Pair, Rows, row};
use tautline_laws::space::{Metric, closest_pair};

/// Most that a closest approach may be drawn too far apart: what is written between two vehicles is what is seen.
const AS_DRAWN: f64 = 1.01;

/// A time at which every position is known.
#[derive(Clone, Debug)]
pub struct Keyframe {
    /// The time \[s\].
    pub time_s: f64,
    /// Positions \[m\], N x 3; NaN for a vehicle that is not there.
    pub positions_m: Rows,
    /// What turns the body of each vehicle into the world, where it was recorded; empty where none was.
    pub attitudes: Vec<Option<UnitQuaternion<f64>>>,
    /// Commanded accelerations \[m/s^2\], where they were recorded.
    pub control_m_s2: Option<Rows>,
    /// Closest approach since the keyframe before.
    pub closest: Option<ClosestApproach>,
    /// Closest approach since the start.
    pub so_far: Option<ClosestApproach>,
    /// Number of the sample, from 0.
    pub(super) number: usize,
}

/// A flight at any time of it.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The time \[s\].
    pub time_s: f64,
    /// Positions \[m\], N x 3; NaN for a vehicle that is not there.
    pub positions_m: Rows,
    /// What turns the body of each vehicle into the world, where it was recorded; empty where none was.
    pub attitudes: Vec<Option<UnitQuaternion<f64>>>,
    /// Commanded accelerations \[m/s^2\] at the last sample, where they were recorded.
    pub control_m_s2: Option<Rows>,
    /// What distances between vehicles are drawn in.
    pub(super) metric: Metric,
    /// The two nearest vehicles and their distance \[m\].
    pub nearest: Option<(Pair, f64)>,
    /// Closest approach up to this time.
    pub so_far: Option<ClosestApproach>,
    /// Closest approach between the keyframes around this time.
    pub(super) around: Option<ClosestApproach>,
    /// Index of the last keyframe at or before this time.
    pub keyframe: usize,
}

impl Frame {
    /// What turns the body of a vehicle into the world, where it is known.
    #[must_use]
    pub fn attitude(&self, vehicle: usize) -> Option<UnitQuaternion<f64>> {
        self.attitudes.get(vehicle).copied().flatten()
    }

    /// Distance of a pair \[m\] as it is drawn, scaled where ellipsoids stay empty; NaN where one of the two is not there.
    ///
    /// It is nowhere below the recorded closest approach, since curves that are drawn as straight lines come nearer than
    /// they were flown, and the recorded one where that was, unless samples are too far apart to draw it.
    #[must_use]
    pub fn distance_m(&self, pair: Pair) -> f64 {
        let apart_m = row(&self.positions_m, pair.second()) - row(&self.positions_m, pair.first());
        let drawn_m = self.metric.scaled(apart_m).norm();
        let Some(around) = self.around else { return drawn_m };
        let is_it = around.pair == pair && around.time_s == self.time_s;
        if drawn_m < around.separation_m || is_it && drawn_m < AS_DRAWN * around.separation_m {
            around.separation_m
        } else {
            drawn_m
        }
    }
}

/// The nearest two of the vehicles that are there.
pub(super) fn nearest_present(positions_m: &Rows, metric: Metric) -> Option<Pair> {
    let is_there = |i: &usize| row(positions_m, *i).iter().all(|x| x.is_finite());
    let there: Vec<usize> = (0..positions_m.nrows()).filter(is_there).collect();
    let (pair, _) = closest_pair(&metric.scaled_rows(&positions_m.select_rows(&there)))?;
    Some(Pair::new(there[pair.first()], there[pair.second()]))
}
