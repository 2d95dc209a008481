//! Linear motion about the slots, and how late or how seldom it may be controlled.
//!
//! Where a law's vehicles are near their slots, their errors are sums of modes, each of which moves by itself. With all that a
//! vehicle knows, its own state too, late by tau, a mode of stiffness K and damping C obeys
//!
//! ```text
//! s^2 - a22 s + (K + C s) e^(-s tau) = 0
//! ```
//!
//! With the own state known at once and others heard late, own terms and others' part: see [`Heard`]. docs/margins.md derives
//! all of this.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::tension::EdgeTension;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::NearPairs;

/// Linear motion about the slots under a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Modes of relative motion with nobody pushing anybody.
    pub free: Vec<Mode>,
    /// The stiffest that a mode can be with the nearest slots' vehicles on the edge of pushing each other; none where that is
    /// not known, or nobody pushes.
    pub stiffest_contact_mode: Option<Mode>,
    /// What is heard of others, where the modes are known with that late and a vehicle's own state not.
    pub heard: Option<Heard>,
}

/// A mode x'' = a22 x' - K x - C x'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// K \[1/s^2\].
    pub stiffness_per_s2: f64,
    /// C \[1/s\].
    pub damping_per_s: f64,
}

/// The loop over what vehicles hear of each other: with gains k and c on each link, u = -(k + c s) (D - A e^(-s tau)) x, where D
/// has for each vehicle the number of those whom it hears and one more where it knows a reference, and A who hears whom.
#[derive(Clone, Debug, PartialEq)]
pub struct Heard {
    /// k \[1/s^2\] and c \[1/s\].
    pub gain: Mode,
    /// D and A.
    pub links: HeardLinks,
}

/// Links for which the modes are known though own and others' parts are not late alike.
#[derive(Clone, Debug, PartialEq)]
pub enum HeardLinks {
    /// D is the same for all: D and A have the same modes.
    Alike {
        /// That of each vehicle.
        own: f64,
        /// Eigenvalues of A.
        others: Vec<f64>,
    },
    /// A star, on which all who hear the hub alone move alike, or without the hub.
    Star {
        /// D of the hub.
        hub: f64,
        /// D of the others.
        leaf: f64,
        /// Their number.
        leaves: f64,
    },
}

impl Linear {
    /// Longest delay \[s\] of all that vehicles know, own states too, below which every free mode is stable; infinite where any
    /// is short enough.
    #[must_use]
    pub fn delay_margin_s(&self, a22_per_s: f64) -> f64 {
        self.free.iter().map(|mode| mode.delay_margin_s(a22_per_s)).fold(f64::INFINITY, f64::min)
    }

    /// Longest time \[s\] between commands that are held below which every free mode is stable.
    #[must_use]
    pub fn sampling_margin_s(&self, a22_per_s: f64) -> f64 {
        self.free.iter().map(|mode| mode.sampling_margin_s(a22_per_s)).fold(f64::INFINITY, f64::min)
    }
}

impl Mode {
    /// With so many times the gains.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self { stiffness_per_s2: factor * self.stiffness_per_s2, damping_per_s: factor * self.damping_per_s }
    }

    fn is_stable(self, a22_per_s: f64) -> bool {
        self.damping_per_s > a22_per_s && self.stiffness_per_s2 >= 0.0
    }

    /// Longest delay \[s\] below which the mode is stable; 0 where it is not stable without, infinite where it is with any.
    ///
    /// On the edge s = i omega, and |K + i C omega| = |omega^2 + i a22 omega| gives omega^4 - (C^2 - a22^2) omega^2 - K^2 = 0, the
    /// angles tau omega = atan(C omega/K) - atan(a22/omega).
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

    /// Longest time \[s\] between commands that are held (zero-order hold) below which the mode is stable: min(2/C, 2 C/K) for a22
    /// = 0.
    ///
    /// From one command to the next the state is multiplied by a matrix; both of its eigenvalues are within the unit circle where
    /// its determinant is below 1 and the sum 1 + trace + determinant is positive (Jury).
    #[must_use]
    pub fn sampling_margin_s(self, a22_per_s: f64) -> f64 {
        /// Parts of the time scale that are looked at, and how far beyond it.
        const LOOKS: u32 = 4000;
        const SCALES: f64 = 20.0;
        let Self { stiffness_per_s2: k, damping_per_s: c } = self;
        if !self.is_stable(a22_per_s) {
            return 0.0;
        }
        if c == 0.0 && k == 0.0 {
            return f64::INFINITY;
        }
        let is_stable = |period_s: f64| {
            let (bounded, moved_s, pushed_s2) = held(a22_per_s, period_s);
            let trace = 1.0 + bounded - k * pushed_s2 - c * moved_s;
            let determinant = bounded - c * moved_s + k * (moved_s * moved_s - bounded * pushed_s2);
            determinant < 1.0 && 1.0 + trace + determinant > 0.0
        };
        let scale_s = if k > 0.0 { (2.0 / c.abs()).min(2.0 * c.abs() / k) } else { 2.0 / c.abs() };
        let look_s = |look: u32| SCALES * scale_s * f64::from(look) / f64::from(LOOKS);
        let Some(beyond) = (1..=LOOKS).find(|&look| !is_stable(look_s(look))) else { return f64::INFINITY };
        bisect(look_s(beyond - 1), look_s(beyond), is_stable)
    }
}

/// Over a period T: by how much a velocity has grown, e^(a22 T), how far a unit of it has gone \[s\], and how far a unit of
/// acceleration \[s^2\].
fn held(a22_per_s: f64, period_s: f64) -> (f64, f64, f64) {
    let x = a22_per_s * period_s;
    let ratio = if x == 0.0 { 1.0 } else { libm::expm1(x) / x };
    // (e^x - 1 - x)/x^2, as a series where that cancels.
    let second = if x.abs() < 1e-3 { 0.5 + x * (1.0 / 6.0 + x / 24.0) } else { (ratio - 1.0) / x };
    (libm::exp(x), period_s * ratio, period_s * period_s * second)
}

/// Where what holds below no longer holds.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = low + 0.5 * (high - low);
        if middle <= low || middle >= high {
            return middle;
        }
        if holds(middle) { low = middle } else { high = middle }
    }
}

impl Heard {
    /// Longest delay \[s\] of what is heard of others, own states known at once, below which all modes are stable; infinite where
    /// any is short enough. None where common motion grows by itself (a22 > 0) and no part of it can be told apart.
    ///
    /// Common motion counts where a22 <= 0: a delay ties it to where the swarm was.
    #[must_use]
    pub fn delay_margin_s(&self, a22_per_s: f64) -> Option<f64> {
        match &self.links {
            HeardLinks::Alike { own, others } => {
                let is_common = |alpha: f64| (own - alpha).abs() <= 1e-9 * own.abs();
                let counted = others.iter().filter(|&&alpha| !(a22_per_s > 0.0 && is_common(alpha)));
                Some(counted.map(|&alpha| self.alike_s(*own, alpha, a22_per_s)).fold(f64::INFINITY, f64::min))
            }
            &HeardLinks::Star { hub, leaf, leaves } => {
                let is_free = hub * leaf <= leaves * (1.0 + 1e-9);
                (!is_free || a22_per_s <= 0.0).then(|| self.star_s(hub, leaf, leaves, a22_per_s))
            }
        }
    }

    /// q(i omega) of s^2 - a22 s = -(k + c s) q.
    fn turned(&self, omega: f64, a22_per_s: f64) -> Complex<f64> {
        let Mode { stiffness_per_s2: k, damping_per_s: c } = self.gain;
        Complex::new(omega * omega, a22_per_s * omega) / Complex::new(k, c * omega)
    }

    /// Of s^2 - a22 s + (k + c s) (d - alpha e^(-s tau)) = 0: at s = i omega the moduli give a quadratic in omega^2, and the angles
    /// the delay.
    fn alike_s(&self, d: f64, alpha: f64, a22_per_s: f64) -> f64 {
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
                let turned = (Complex::new(d, 0.0) - self.turned(omega, a22_per_s)) / alpha;
                (-turned.arg()).rem_euclid(TAU) / omega
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Of hub and the others' mean: (hub - q)(leaf - q) = leaves e^(-2 s tau). The moduli are searched for where they agree.
    fn star_s(&self, hub: f64, leaf: f64, leaves: f64, a22_per_s: f64) -> f64 {
        const LOOKS: u32 = 4000;
        // Those who hear the hub alone, without it.
        if !self.gain.times(leaf).is_stable(a22_per_s) {
            return 0.0;
        }
        let ratio = |omega: f64| {
            let q = self.turned(omega, a22_per_s);
            (Complex::new(hub, 0.0) - q) * (Complex::new(leaf, 0.0) - q) / leaves
        };
        let Mode { stiffness_per_s2: k, damping_per_s: c } = self.gain;
        // Beyond this the left side is the larger one.
        let fastest = 4.0 * (hub + leaf + leaves) * (c + k.sqrt()) + 4.0 * a22_per_s.abs();
        let look = |step: u32| fastest * libm::pow(10.0, 6.0 * (f64::from(step) / f64::from(LOOKS) - 1.0));
        let is_below = |omega: f64| ratio(omega).norm() < 1.0;
        let crossings = (1..=LOOKS).filter(|&step| is_below(look(step - 1)) != is_below(look(step)));
        crossings
            .map(|step| {
                let below = is_below(look(step - 1));
                let omega = bisect(look(step - 1), look(step), |omega| is_below(omega) == below);
                (-ratio(omega).arg()).rem_euclid(TAU) / (2.0 * omega)
            })
            .fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests;

/// Distances of slots that differ by less, relatively, are the same one.
const SAME: f64 = 1e-6;

/// The stiffest mode there: those at the nearest slots push each other with `V_R''` at R, which adds at most its product with the
/// largest eigenvalue of the Laplacian of who is nearest. None for fewer than two vehicles.
pub(super) fn stiffest_contact_mode(free: Mode, tension: &EdgeTension, formation: &Formation) -> Option<Mode> {
    let (_, nearest_m) = formation.min_distance()?;
    let mut near = NearPairs::default();
    near.update(&formation.slots_m, nearest_m * (1.0 + SAME));
    let nearest = Graph::from_edges(formation.count(), near.pairs()).ok()?;
    let pushes_per_s2 = tension.second_derivative(tension.rest_m()) * nearest.largest_eigenvalue();
    Some(Mode { stiffness_per_s2: free.stiffness_per_s2 + pushes_per_s2, ..free })
}
