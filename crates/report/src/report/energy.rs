//! How far above its start the energy may be by nothing but the integrator's error and rounding.

use tautline_core::record::EnergyRise;
use tautline_sim::metrics::Summary;

/// Part of an energy, and of what it keeps apart, that the error of integration stays below.
pub(super) const INTEGRATION: f64 = EnergyRise::INTEGRATION;

/// The largest energy \[m^2/s^2\] that a motion without gain may show, from an energy `initial` on:
///
/// ```text
/// (1 + 1e-3) E(0) + N [ u r + (epsilon v)^2 ],    r = epsilon x,    epsilon = 2^-52
/// ```
///
/// with the largest command u, the fastest vehicle v and the largest distance x from where the swarm began. Rounding moves a
/// vehicle by r against a force of u, and changes its velocity by epsilon v.
pub(super) fn highest_honest(initial: f64, summary: &Summary, vehicles: usize) -> f64 {
    let resolution_m = f64::EPSILON * summary.extent_m;
    let rounding = summary.peak_control_m_s2 * resolution_m + (f64::EPSILON * summary.fastest_m_s).powi(2);
    (1.0 + INTEGRATION) * initial + vehicles as f64 * rounding
}
