//! Linearized motion about the slots, and its stability margins under delay and sampling.
//!
//! Near the slots the errors are sums of independent modes. If all states that a vehicle uses, its own included, are
//! late by tau, a mode of stiffness K and damping C has the characteristic equation
//!
//! ```text
//! s^2 - a22 s + (K + C s) e^(-s tau) = 0
//! ```
//!
//! If only the received states are late, own and received terms separate: see [`ReceivedStateLoop`]. docs/studies.md
//! lists the modes of each law.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::tension::EdgeTension;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::CellList;

/// Linearized motion about the slots under a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Modes of relative motion without contact (no pair within the range of the barrier).
    pub free: Vec<Mode>,
    /// Upper bound of the stiffest mode with the vehicles of the nearest slots at the edge of contact; `None` if it is
    /// unknown or the law has no contact forces.
    pub stiffest_contact_mode: Option<Mode>,
    /// Loop over received states, if its modes with late received and present own states are known.
    pub received: Option<ReceivedStateLoop>,
}

/// Mode x'' = a22 x' - K x - C x'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// K \[1/s^2\].
    pub stiffness_per_s2: f64,
    /// C \[1/s\].
    pub damping_per_s: f64,
}

/// Loop over received states: u = -(k + c s) (D - A e^(-s tau)) x with gains k and c on each link. D is diagonal: the
/// number of neighbours of each vehicle, plus one if it knows a reference. A is the adjacency matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedStateLoop {
    /// k \[1/s^2\] and c \[1/s\].
    pub gain: Mode,
    /// D and A.
    pub links: DelayedLinks,
}

/// Links whose modes are known with different delays of own and received terms.
#[derive(Clone, Debug, PartialEq)]
pub enum DelayedLinks {
    /// D is a multiple of the identity, so D and A have the same modes.
    EqualDegree {
        /// Diagonal entry of D.
        own: f64,
        /// Eigenvalues of A.
        others: Vec<f64>,
    },
    /// Star: its modes involve the hub and the mean of the leaves, or the leaves alone.
    Star {
        /// Entry of D for the hub.
        hub: f64,
        /// Entry of D for each leaf.
        leaf: f64,
        /// Number of leaves.
        leaves: f64,
    },
}

impl Linear {
    /// Returns the longest delay \[s\] of all states, own included, below which every free mode is stable; infinite if
    /// every delay is stable.
    #[must_use]
    pub fn delay_margin_s(&self, a22_per_s: f64) -> f64 {
        self.free.iter().map(|mode| mode.delay_margin_s(a22_per_s)).fold(f64::INFINITY, f64::min)
    }

    /// Returns the longest sampling period \[s\] of held commands below which every free mode is stable.
    #[must_use]
    pub fn sampling_margin_s(&self, a22_per_s: f64) -> f64 {
        self.free.iter().map(|mode| mode.sampling_margin_s(a22_per_s)).fold(f64::INFINITY, f64::min)
    }
}

impl Mode {
    /// Returns the mode with both gains multiplied by `factor`.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self { stiffness_per_s2: factor * self.stiffness_per_s2, damping_per_s: factor * self.damping_per_s }
    }

    fn is_stable(self, a22_per_s: f64) -> bool {
        self.damping_per_s > a22_per_s && self.stiffness_per_s2 >= 0.0
    }

    /// Returns the longest delay \[s\] below which the mode is stable; 0 if it is unstable without delay, infinite if
    /// it is stable with every delay.
    ///
    /// At the stability limit s = i omega, |K + i C omega| = |omega^2 + i a22 omega| gives
    /// omega^4 - (C^2 - a22^2) omega^2 - K^2 = 0. The angles give tau omega = atan(C omega/K) - atan(a22/omega).
    #[must_use]
    pub fn delay_margin_s(self, a22_per_s: f64) -> f64 {
        let Self { stiffness_per_s2: k, damping_per_s: c } = self;
        if !self.is_stable(a22_per_s) {
            return 0.0;
        }
        let difference = c * c - a22_per_s * a22_per_s;
        let omega = (0.5 * (difference + difference.hypot(2.0 * k))).max(0.0).sqrt();
        if omega == 0.0 {
            return f64::INFINITY;
        }
        (libm::atan2(c * omega, k) - libm::atan(a22_per_s / omega)) / omega
    }

    /// Returns the longest sampling period \[s\] of held commands (zero-order hold) below which the mode is stable:
    /// min(2/C, 2 C/K) for a22 = 0.
    ///
    /// From one command to the next the state is multiplied by a 2 x 2 matrix. Both eigenvalues lie within the unit
    /// circle if its determinant is below 1 and 1 + trace + determinant is positive (Jury).
    #[must_use]
    pub fn sampling_margin_s(self, a22_per_s: f64) -> f64 {
        /// Number of periods scanned, and the end of the scan in units of the time scale.
        const SCAN_STEPS: u32 = 4000;
        const SCAN_END: f64 = 20.0;
        let Self { stiffness_per_s2: k, damping_per_s: c } = self;
        if !self.is_stable(a22_per_s) {
            return 0.0;
        }
        if c == 0.0 && k == 0.0 {
            return f64::INFINITY;
        }
        let is_stable = |period_s: f64| {
            let (bounded, moved_s, pushed_s2) = zero_order_hold(a22_per_s, period_s);
            let trace = 1.0 + bounded - k * pushed_s2 - c * moved_s;
            let determinant = bounded - c * moved_s + k * (moved_s * moved_s - bounded * pushed_s2);
            determinant < 1.0 && 1.0 + trace + determinant > 0.0
        };
        let scale_s = if k > 0.0 { (2.0 / c.abs()).min(2.0 * c.abs() / k) } else { 2.0 / c.abs() };
        let period_at_s = |step: u32| SCAN_END * scale_s * f64::from(step) / f64::from(SCAN_STEPS);
        let Some(beyond) = (1..=SCAN_STEPS).find(|&step| !is_stable(period_at_s(step))) else { return f64::INFINITY };
        bisect(period_at_s(beyond - 1), period_at_s(beyond), is_stable)
    }
}

/// Returns the response over a period T: the growth `e^(a22 T)` of a velocity, and the distances per unit of velocity
/// \[s\] and per unit of acceleration \[s^2\].
fn zero_order_hold(a22_per_s: f64, period_s: f64) -> (f64, f64, f64) {
    let x = a22_per_s * period_s;
    let ratio = if x == 0.0 { 1.0 } else { libm::expm1(x) / x };
    // (e^x - 1 - x)/x^2, as a series where the difference cancels.
    let second = if x.abs() < 1e-3 { 0.5 + x * (1.0 / 6.0 + x / 24.0) } else { (ratio - 1.0) / x };
    (libm::exp(x), period_s * ratio, period_s * period_s * second)
}

/// Returns the boundary between `low`, where the predicate holds, and `high`, where it does not.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = low + 0.5 * (high - low);
        if middle <= low || middle >= high {
            return middle;
        }
        if holds(middle) { low = middle } else { high = middle }
    }
}

impl ReceivedStateLoop {
    /// Returns the longest delay \[s\] of received states, with present own states, below which all modes are stable;
    /// infinite if every delay is stable. `None` if the common motion is unstable (a22 > 0) and cannot be separated.
    ///
    /// The common motion counts if a22 <= 0: with a delay it is tied to past positions of the swarm.
    #[must_use]
    pub fn delay_margin_s(&self, a22_per_s: f64) -> Option<f64> {
        match &self.links {
            DelayedLinks::EqualDegree { own, others } => {
                let is_common = |alpha: f64| (own - alpha).abs() <= 1e-9 * own.abs();
                let counted = others.iter().filter(|&&alpha| !(a22_per_s > 0.0 && is_common(alpha)));
                Some(counted.map(|&alpha| self.equal_degree_s(*own, alpha, a22_per_s)).fold(f64::INFINITY, f64::min))
            }
            &DelayedLinks::Star { hub, leaf, leaves } => {
                let is_free = hub * leaf <= leaves * (1.0 + 1e-9);
                (!is_free || a22_per_s <= 0.0).then(|| self.star_s(hub, leaf, leaves, a22_per_s))
            }
        }
    }

    /// Returns q(i omega) for s^2 - a22 s = -(k + c s) q.
    fn link_ratio(&self, omega: f64, a22_per_s: f64) -> Complex<f64> {
        let Mode { stiffness_per_s2: k, damping_per_s: c } = self.gain;
        Complex::new(omega * omega, a22_per_s * omega) / Complex::new(k, c * omega)
    }

    /// Returns the delay margin of s^2 - a22 s + (k + c s) (d - alpha e^(-s tau)) = 0. At s = i omega the moduli give a
    /// quadratic in omega^2, and the angles give the delay.
    fn equal_degree_s(&self, d: f64, alpha: f64, a22_per_s: f64) -> f64 {
        let Mode { stiffness_per_s2: k, damping_per_s: c } = self.gain;
        let relative = d - alpha;
        if relative.abs() > 1e-9 * d.abs() && !self.gain.times(relative).is_stable(a22_per_s) {
            return 0.0;
        }
        if alpha.abs() <= 1e-9 * d.abs() {
            return f64::INFINITY;
        }
        let half = 0.5 * ((c * d - a22_per_s).powi(2) - 2.0 * k * d - (alpha * c).powi(2));
        let last = k * k * (d - alpha) * (d + alpha);
        let root = (half * half - last).max(0.0).sqrt();
        let crosses = half * half >= last;
        [-half - root, -half + root]
            .into_iter()
            .filter(|&squared| crosses && squared > 1e-12 * half.abs())
            .map(|squared| {
                let omega = squared.sqrt();
                let link_ratio = (Complex::new(d, 0.0) - self.link_ratio(omega, a22_per_s)) / alpha;
                (-link_ratio.arg()).rem_euclid(TAU) / omega
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns the delay margin of hub and leaf mean: (hub - q)(leaf - q) = leaves e^(-2 s tau). Scans omega for equal
    /// moduli.
    fn star_s(&self, hub: f64, leaf: f64, leaves: f64, a22_per_s: f64) -> f64 {
        const SCAN_STEPS: u32 = 4000;
        // Modes of the leaves alone have no received terms.
        if !self.gain.times(leaf).is_stable(a22_per_s) {
            return 0.0;
        }
        let ratio = |omega: f64| {
            let q = self.link_ratio(omega, a22_per_s);
            (Complex::new(hub, 0.0) - q) * (Complex::new(leaf, 0.0) - q) / leaves
        };
        let Mode { stiffness_per_s2: k, damping_per_s: c } = self.gain;
        // Above this frequency the left side is larger.
        let fastest = 4.0 * (hub + leaf + leaves) * (c + k.sqrt()) + 4.0 * a22_per_s.abs();
        let omega_at = |step: u32| fastest * libm::pow(10.0, 6.0 * (f64::from(step) / f64::from(SCAN_STEPS) - 1.0));
        let is_below = |omega: f64| ratio(omega).norm() < 1.0;
        let crossings = (1..=SCAN_STEPS).filter(|&step| is_below(omega_at(step - 1)) != is_below(omega_at(step)));
        crossings
            .map(|step| {
                let below = is_below(omega_at(step - 1));
                let omega = bisect(omega_at(step - 1), omega_at(step), |omega| is_below(omega) == below);
                (-ratio(omega).arg()).rem_euclid(TAU) / (2.0 * omega)
            })
            .fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests;

/// Relative difference below which two slot distances count as equal.
const SAME: f64 = 1e-6;

/// Returns an upper bound of the stiffest mode with the nearest slots in contact. Contact adds at most `V_R''` at R
/// times the largest Laplacian eigenvalue of the graph of nearest slots. `None` for fewer than two vehicles.
pub(super) fn stiffest_contact_mode(free: Mode, tension: &EdgeTension, formation: &Formation) -> Option<Mode> {
    let (_, nearest_m) = formation.min_distance()?;
    let mut near = CellList::default();
    near.update(&formation.slots_m, nearest_m * (1.0 + SAME));
    let nearest = Graph::from_edges(formation.count(), near.pairs()).ok()?;
    let pushes_per_s2 = tension.second_derivative(tension.rest_m()) * nearest.largest_eigenvalue();
    Some(Mode { stiffness_per_s2: free.stiffness_per_s2 + pushes_per_s2, ..free })
}
