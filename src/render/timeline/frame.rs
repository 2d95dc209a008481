//! A flight at a time of it, as it was recorded and as it is drawn.

use crate::swarm::{ClosestApproach, Pair, Rows, separation};

/// A time at which every position is known.
#[derive(Clone, Debug)]
pub struct Keyframe {
    /// The time \[s\].
    pub time_s: f64,
    /// Positions \[m\], N x 3; NaN for a vehicle that is not there.
    pub positions_m: Rows,
    /// Commanded accelerations \[m/s^2\], where they were recorded.
    pub control_m_s2: Option<Rows>,
    /// Closest approach since the keyframe before.
    pub closest: Option<ClosestApproach>,
    /// Closest approach since the start.
    pub so_far: Option<ClosestApproach>,
}

/// A flight at any time of it.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The time \[s\].
    pub time_s: f64,
    /// Positions \[m\], N x 3; NaN for a vehicle that is not there.
    pub positions_m: Rows,
    /// Commanded accelerations \[m/s^2\] at the last sample, where they were recorded.
    pub control_m_s2: Option<Rows>,
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
    /// Distance of a pair \[m\]; NaN where one of the two is not there.
    ///
    /// It is the recorded one where the closest approach was, and is nowhere below it: curves that are drawn as straight
    /// lines come nearer than they were flown.
    #[must_use]
    pub fn distance_m(&self, pair: Pair) -> f64 {
        let drawn_m = separation(&self.positions_m, pair.first(), pair.second());
        match self.around {
            Some(around) if around.pair == pair && around.time_s == self.time_s => around.separation_m,
            Some(around) if drawn_m < around.separation_m => around.separation_m,
            _ => drawn_m,
        }
    }
}
