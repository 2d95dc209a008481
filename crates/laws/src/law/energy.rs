//! Energies of laws: a cache of their potential part, and an upper bound under wind.

use nalgebra::Vector3;

use super::interface::WindExposure;
use crate::wind::Gust;
use tautline_core::swarm::Rows;

/// Number of parts of a rising or falling gust. In each part the bound uses the largest strength.
const PARTS: u32 = 1024;

/// Frame in which velocities and disturbances are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Frame {
    /// Mean of all vehicles: a disturbance common to all vehicles vanishes.
    Mean,
    /// The ground.
    Ground,
}

/// Upper bound on an energy E under external accelerations w. The energy satisfies `E >= 1/2 sum |v~_i|^2`, and its law
/// keeps `dE/dt <= -zeta sum |v~_i|^2` without disturbance. With |w|^2 = sum of `|w_i|^2`, both
///
/// ```text
/// dE/dt <= -zeta |v~|^2 + |v~| |w| <= |w|^2/(4 zeta)          equality for w = 2 zeta v~
/// d sqrt E/dt <= |w|/sqrt 2                                   since |v~| <= sqrt(2 E)
/// ```
///
/// hold. The first is better for long winds, the second for short gusts. Each span of time uses the smaller one.
#[derive(Clone, Debug)]
pub(super) struct EnergyBound {
    /// zeta \[1/s\]; if it is not positive, only the second bound applies.
    damping_per_s: f64,
    spans: Vec<WindSpan>,
    resolution_m: f64,
}

#[derive(Clone, Copy, Debug)]
struct WindSpan {
    from_s: f64,
    to_s: f64,
    /// Upper bound of |w| in the span \[m/s^2\].
    most_m_s2: f64,
}

/// Bound on an energy and the time up to which it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BoundedEnergy {
    /// Upper bound of the energy \[m^2/s^2\].
    pub(super) energy: f64,
    /// End of validity \[s\]; `None` if the bound holds for all time.
    pub(super) until_s: Option<f64>,
}

impl EnergyBound {
    /// Builds the bound for a wind without turbulence from time 0 to the end of the run.
    pub(super) fn new(exposure: &WindExposure<'_>, count: usize, frame: Frame, damping_per_s: f64) -> Self {
        let groups = vehicle_groups(exposure, count);
        let corners_s = corners_s(exposure);
        let mut spans = Vec::new();
        for ends in corners_s.windows(2) {
            let (from_s, length_s) = (ends[0], ends[1] - ends[0]);
            let middle_s = from_s + 0.5 * length_s;
            let is_sloping = exposure.wind.gusts.iter().any(|gust| {
                let [begins_s, full_s, falls_s, ends_s] = gust.corners_s();
                (begins_s..full_s).contains(&middle_s) || (falls_s..ends_s).contains(&middle_s)
            });
            let parts = if is_sloping { PARTS } else { 1 };
            let at_s = |part: u32| from_s + length_s * (f64::from(part) / f64::from(parts));
            spans.extend((0..parts).map(|part| {
                let (from_s, to_s) = (at_s(part), at_s(part + 1));
                WindSpan { from_s, to_s, most_m_s2: most_m_s2(exposure, &groups, frame, (from_s, to_s)) }
            }));
        }
        Self { damping_per_s, spans, resolution_m: exposure.resolution_m }
    }

    /// Returns the resolution of separations above delta \[m\].
    pub(super) fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Returns the bound on an energy from a time on \[s\]. The bound ends when it passes `most`, or with the run.
    pub(super) fn of(&self, energy: f64, from_s: f64, most: f64) -> BoundedEnergy {
        if energy >= most {
            return BoundedEnergy { energy, until_s: Some(from_s) };
        }
        let mut now = energy;
        for &WindSpan { from_s: begins_s, to_s, most_m_s2 } in self.spans.iter().filter(|span| span.to_s > from_s) {
            let begins_s = begins_s.max(from_s);
            let length_s = to_s - begins_s;
            let pushed = (now.sqrt() + most_m_s2 * length_s * std::f64::consts::FRAC_1_SQRT_2).powi(2);
            let fed_per_s = most_m_s2 * most_m_s2 / (4.0 * self.damping_per_s);
            let is_damped = self.damping_per_s > 0.0;
            let next = if is_damped { pushed.min(now + fed_per_s * length_s) } else { pushed };
            if next > most {
                let steady_s = if is_damped { ((most - now) / fed_per_s).max(0.0) } else { 0.0 };
                let short_s = (most.sqrt() - now.sqrt()) * std::f64::consts::SQRT_2 / most_m_s2;
                return BoundedEnergy { energy: most, until_s: Some(begins_s + steady_s.max(short_s).min(length_s)) };
            }
            now = next;
        }
        let blows_on = self.spans.last().is_some_and(|last| last.most_m_s2 > 0.0);
        BoundedEnergy { energy: now, until_s: self.spans.last().filter(|_| blows_on).map(|last| last.to_s) }
    }
}

/// Groups the vehicles by the set of gusts that meet them; returns each set with its number of vehicles.
fn vehicle_groups(exposure: &WindExposure<'_>, count: usize) -> Vec<(Vec<bool>, usize)> {
    let mut groups: Vec<(Vec<bool>, usize)> = Vec::new();
    for vehicle in 0..count {
        let met: Vec<_> = exposure.wind.gusts.iter().map(|gust| gust.affects(vehicle)).collect();
        match groups.iter_mut().find(|(known, _)| *known == met) {
            Some((_, size)) => *size += 1,
            None => groups.push((met, 1)),
        }
    }
    groups
}

/// Returns the sorted times at which a gust begins, reaches full strength, falls or ends, with the ends of the run
/// \[s\].
fn corners_s(exposure: &WindExposure<'_>) -> Vec<f64> {
    let of_gusts = exposure.wind.gusts.iter().flat_map(Gust::corners_s);
    let inside = of_gusts.filter(|&corner_s| corner_s > 0.0 && corner_s < exposure.until_s);
    let mut corners_s: Vec<_> = inside.chain([0.0, exposure.until_s]).collect();
    corners_s.sort_by(f64::total_cmp);
    corners_s.dedup();
    corners_s
}

/// Returns an upper bound of |w| in a span in which each gust rises or falls monotonically: |w| at the mean strengths
/// plus half of the changes of all gusts.
fn most_m_s2(
    exposure: &WindExposure<'_>,
    groups: &[(Vec<bool>, usize)],
    frame: Frame,
    (from_s, to_s): (f64, f64),
) -> f64 {
    let gusts = &exposure.wind.gusts;
    let shares: Vec<_> = gusts.iter().map(|gust| (gust.share(from_s), gust.share(to_s))).collect();
    let count = groups.iter().map(|(_, size)| *size).sum::<usize>().max(1) as f64;
    let air = |met: &[bool]| {
        let blowing = gusts.iter().zip(&shares).zip(met).filter(|(_, met)| **met);
        blowing.fold(exposure.wind.mean_m_s, |sum, ((gust, (a, b)), _)| sum + 0.5 * (a + b) * gust.velocity_m_s)
    };
    let from: Vector3<f64> = match frame {
        Frame::Ground => Vector3::zeros(),
        Frame::Mean => groups.iter().map(|(met, size)| *size as f64 * air(met)).sum::<Vector3<f64>>() / count,
    };
    let alone = groups.len() == 1 && frame == Frame::Mean;
    let square = |(met, size): &(Vec<bool>, usize)| *size as f64 * (air(met) - from).norm_squared();
    let middle = if alone { 0.0 } else { groups.iter().map(square).sum::<f64>().sqrt() };
    let changes = gusts.iter().zip(&shares).enumerate().map(|(k, (gust, (a, b)))| {
        let met = groups.iter().filter(|(met, _)| met[k]).map(|(_, size)| *size).sum::<usize>() as f64;
        let felt = if frame == Frame::Mean { met * (1.0 - met / count) } else { met };
        0.5 * (b - a).abs() * gust.velocity_m_s.norm() * felt.max(0.0).sqrt()
    });
    exposure.drag_per_s * (middle + changes.sum::<f64>())
}

/// Potential part of an energy at the last positions. The command computes it, and the energy of the same instant
/// reuses it.
#[derive(Clone, Debug)]
pub(super) struct PotentialCache {
    positions_m: Rows,
    potential: Option<f64>,
}

impl PotentialCache {
    /// Returns an empty cache for `count` vehicles.
    pub(super) fn new(count: usize) -> Self {
        Self { positions_m: Rows::zeros(count), potential: None }
    }

    /// Stores the potential of these positions, which must have the `count` rows of [`PotentialCache::new`].
    pub(super) fn store(&mut self, positions_m: &Rows, potential: f64) {
        self.positions_m.as_mut_slice().copy_from_slice(positions_m.as_slice());
        self.potential = Some(potential);
    }

    pub(super) fn clear(&mut self) {
        self.potential = None;
    }

    /// Returns the potential if these are exactly the stored positions.
    pub(super) fn of(&self, positions_m: &Rows) -> Option<f64> {
        self.potential.filter(|_| self.positions_m.as_slice() == positions_m.as_slice())
    }
}

#[cfg(test)]
mod tests;
