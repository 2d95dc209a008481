//! What blows: the mean wind and gusts as functions of time, and whose turbulence it is.

use std::f64::consts::PI;

use nalgebra::Vector3;

use super::dryden::Dryden;

/// Standard deviations of turbulence that are taken for the most of it where an estimate must do.
const SIGMAS: f64 = 4.0;

/// What blows.
#[derive(Clone, Debug, PartialEq)]
pub struct WindSpec {
    /// Velocity of the air that never changes \[m/s\].
    pub mean_m_s: Vector3<f64>,
    /// What is added to it for a time.
    pub gusts: Vec<Gust>,
    /// Random air about that.
    pub turbulence: Option<Dryden>,
    /// Whether all vehicles are in the same turbulence, and not each in its own.
    pub shared: bool,
}

impl Default for WindSpec {
    /// Still air.
    fn default() -> Self {
        Self { mean_m_s: Vector3::zeros(), gusts: Vec::new(), turbulence: None, shared: true }
    }
}

/// Air that rises to a velocity, holds it and falls back, each slope half a period of 1 - cos:
///
/// ```text
/// V/2 (1 - cos(pi (t - at)/rise))          at <= t < at + rise
/// V                                        for hold seconds from there
/// V/2 (1 + cos(pi (t - t_fall)/fall))      for fall seconds from there, t_fall = at + rise + hold
/// ```
///
/// Without a hold and with equal slopes it is the gust of airworthiness rules, a whole period of 1 - cos; one that holds to
/// the end of the flight is that of MIL-F-8785C, which rises and stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Gust {
    /// When it begins \[s\].
    pub at_s: f64,
    /// How long it rises \[s\].
    pub rise_s: f64,
    /// How long it stays \[s\].
    pub hold_s: f64,
    /// How long it falls \[s\].
    pub fall_s: f64,
    /// At its height \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Whom it meets, from 0 and in order; all without a list.
    pub vehicles: Option<Vec<usize>>,
}

impl Gust {
    /// The instants at which it begins to rise, to hold, to fall, and ends \[s\].
    #[must_use]
    pub fn corners_s(&self) -> [f64; 4] {
        let full_s = self.at_s + self.rise_s;
        let falls_s = full_s + self.hold_s;
        [self.at_s, full_s, falls_s, falls_s + self.fall_s]
    }

    /// What part of its velocity blows at a time \[s\].
    #[must_use]
    pub fn share(&self, time_s: f64) -> f64 {
        let [begins_s, full_s, falls_s, ends_s] = self.corners_s();
        let slope = |phase: f64| 0.5 * (1.0 - libm::cos(PI * phase));
        if time_s <= begins_s || time_s >= ends_s {
            0.0
        } else if time_s < full_s {
            slope((time_s - begins_s) / self.rise_s)
        } else if time_s <= falls_s {
            1.0
        } else {
            1.0 - slope((time_s - falls_s) / self.fall_s)
        }
    }

    /// Whether it meets a vehicle.
    #[must_use]
    pub fn meets(&self, vehicle: usize) -> bool {
        self.vehicles.as_ref().is_none_or(|met| met.binary_search(&vehicle).is_ok())
    }
}

impl WindSpec {
    /// Whether nothing ever blows.
    #[must_use]
    pub fn is_still(&self) -> bool {
        *self == Self { shared: self.shared, ..Self::default() }
    }

    /// Mean and gusts that a vehicle meets at a time \[m/s\].
    #[must_use]
    pub fn steady_m_s(&self, vehicle: usize, time_s: f64) -> Vector3<f64> {
        let met = self.gusts.iter().filter(|gust| gust.meets(vehicle));
        met.fold(self.mean_m_s, |sum, gust| sum + gust.share(time_s) * gust.velocity_m_s)
    }

    /// No vehicle meets faster air than this \[m/s\]; with turbulence, which has no bound, hardly ever.
    #[must_use]
    pub fn fastest_m_s(&self) -> f64 {
        let gusts: f64 = self.gusts.iter().map(|gust| gust.velocity_m_s.norm()).sum();
        let turbulence = self.turbulence.map_or(0.0, |dryden| SIGMAS * dryden.intensity_m_s().norm());
        self.mean_m_s.norm() + gusts + turbulence
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gust() -> Gust {
        let velocity_m_s = Vector3::new(3.0, -4.0, 0.0);
        Gust { at_s: 2.0, rise_s: 1.0, hold_s: 0.5, fall_s: 2.0, velocity_m_s, vehicles: None }
    }

    #[test]
    fn a_gust_rises_holds_and_falls_as_one_minus_cosine() {
        let at = |time_s: f64| gust().share(time_s);
        for (time_s, share) in [(0.0, 0.0), (2.0, 0.0), (2.5, 0.5), (3.0, 1.0), (3.4, 1.0), (3.5, 1.0), (4.5, 0.5)] {
            assert!((at(time_s) - share).abs() < 1e-15, "{time_s}");
        }
        assert_eq!((at(5.5), at(1e9)), (0.0, 0.0));
        assert!((at(2.0 + 1.0 / 3.0) - 0.25).abs() < 1e-15, "1/2 (1 - cos 60 deg)");
        // Slopes begin and end flat: a triangle of the same height does not.
        for corner_s in gust().corners_s() {
            let bend = |h: f64| (at(corner_s + h) - at(corner_s - h)).abs() / h;
            assert!(bend(1e-4) < 1e-3, "{corner_s}");
        }
        let triangle = |time_s: f64| (time_s - 2.0).clamp(0.0, 1.0);
        assert!((triangle(2.0 + 1e-4) - triangle(2.0 - 1e-4)).abs() / 1e-4 > 0.9);
    }

    #[test]
    fn a_gust_is_added_to_the_mean_for_those_whom_it_meets() {
        let gusts = vec![Gust { vehicles: Some(vec![1, 3]), ..gust() }];
        let wind = WindSpec { mean_m_s: Vector3::x(), gusts, ..WindSpec::default() };
        assert!(!wind.is_still() && WindSpec::default().is_still());
        assert_eq!(wind.steady_m_s(0, 3.2), Vector3::x());
        assert_eq!(wind.steady_m_s(3, 3.2), Vector3::new(4.0, -4.0, 0.0));
        assert_eq!(wind.fastest_m_s(), 6.0);
    }
}
