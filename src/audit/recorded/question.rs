//! What is asked of a recording.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::obstacle::Obstacle;

/// How vehicles are taken to move between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// On a straight line at constant speed. The sweep is exact.
    Linear,
    /// Not at all, with a jump at each sample. The jump is swept like a straight flight that takes no time; vehicles that
    /// jump at the same instant are swept together.
    Hold,
    /// On the curves that the recording holds; each minimum is enclosed to [`super::WIDTH_M`].
    Polynomial,
    /// On any path whose acceleration stays within a bound: true distances lie within an interval around those of the
    /// line, or of the cubic where the recording has velocities.
    Bounded,
}

/// What is said of one vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// Radius \[m\]; where the recording has one, this one counts.
    pub radius_m: Option<f64>,
    /// Added to the vehicle's times \[s\].
    pub offset_s: f64,
    /// Largest acceleration \[m/s^2\]; without it, that of the [`Question`].
    pub max_accel_m_s2: Option<f64>,
}

/// What is asked.
///
/// Two vehicles i and j must stay `max(delta, r_i + r_j)` apart, centre to centre, where each part counts that is given.
/// A separation **strictly** below that is a violation. With an ellipsoid lengths are divided by its axes first, so two
/// equal ellipsoids touch at a scaled distance of 2, and delta, if given, is a scaled distance too.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Question {
    /// Safety distance delta \[m\].
    pub delta_m: Option<f64>,
    /// What happens between samples. `None` asks for straight lines between samples, and curves where the recording has
    /// curves.
    pub motion: Option<Motion>,
    /// Largest acceleration \[m/s^2\] of every vehicle, for [`Motion::Bounded`].
    pub max_accel_m_s2: Option<f64>,
    /// Radius \[m\] of every vehicle of which nothing else is said; it goes before those of the recording.
    pub radius_m: Option<f64>,
    /// Half axes \[m\] of the ellipsoid around each vehicle, such as a downwash that reaches far down.
    pub ellipsoid_m: Option<Vector3<f64>>,
    /// Judge from here on \[s\].
    pub from_s: Option<f64>,
    /// Judge up to here \[s\].
    pub to_s: Option<f64>,
    /// Pairs are not judged while both vehicles are at or below this height \[m\], and obstacles not while the vehicle is.
    pub above_m: Option<f64>,
    /// Samples farther apart in time than this \[s\] have a gap between them, which nothing is known of. `None` lets each
    /// vehicle's usual interval decide: a gap is more than one and a half of it.
    pub max_gap_s: Option<f64>,
    /// What is said of single vehicles, by name.
    pub vehicles: BTreeMap<String, Terms>,
    /// The vehicles to judge, by name; `None` for all.
    pub only: Option<BTreeSet<String>>,
    /// What else is in the way.
    pub obstacles: Vec<Obstacle>,
}

impl Question {
    /// Whether any two vehicles came closer than delta \[m\].
    #[must_use]
    pub fn delta(delta_m: f64) -> Self {
        Self { delta_m: Some(delta_m), ..Self::default() }
    }
}
