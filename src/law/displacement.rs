//! The displacement law: consensus on the slots over any connected graph, and a one-sided edge tension between all who are
//! near.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, Void};
use super::consensus::{
    add_heard, add_laplacian_product, add_pushes, check_count, check_observation, check_range, check_state,
    relative_kinetic_energy, sum_of_squares_about_mean,
};
use super::error::{LawError, ParameterError};
use super::interface::{Law, VelocityMargin};
use super::memo::Memo;
use super::setting::{Gain, Setting};
use super::tension::{EdgeTension, TensionError};
use crate::formation::Formation;
use crate::graph::Graph;
use crate::observation::Observation;
use crate::space::NearPairs;
use crate::swarm::{Pair, Rows, row};
use crate::target::Target;

/// Keys of `[law]` with `kind = "displacement"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DisplacementKeys {
    /// Gain on positions over links in 1/s^2, before it is divided by the graph's algebraic connectivity.
    pub k_per_s2: f64,
    /// Rate at which relative velocities are damped at least in 1/s, whatever a22 is.
    pub zeta_per_s: f64,
    /// Scale of the tension between vehicles that are nearer than slots are, in m^2/s^2.
    pub alpha: f64,
}

impl Default for DisplacementKeys {
    fn default() -> Self {
        Self { k_per_s2: 1.0, zeta_per_s: 1.0, alpha: 1.0 }
    }
}

impl DisplacementKeys {
    /// No key follows from others.
    pub(super) fn complete(self, _a22_per_s: f64) -> Self {
        self
    }

    pub(super) fn gains(&self) -> Vec<Gain> {
        vec![
            Gain::positive("law.k_per_s2", "the gain k", self.k_per_s2),
            Gain::positive("law.zeta_per_s", "the damping zeta", self.zeta_per_s),
            Gain::positive("law.alpha", "alpha", self.alpha),
        ]
    }

    pub(super) fn build(&self, setting: &Setting<'_>) -> Result<DisplacementLaw, ParameterError> {
        DisplacementLaw::new(setting, self.clone())
    }
}

/// The displacement law on a connected undirected graph of N vehicles that share a compass: with `e_i = p_i - h_i`,
///
/// ```text
/// u_i = -sigma sum_{j in N_i} [ k (e_i - e_j) + c (v_i - v_j) ] - sum_{j : l_ij < R} grad_i V_R(l_ij)
/// sigma = 1/lambda2(L),   c = max(0, zeta + a22),   R = smallest distance of two slots
/// ```
///
/// where `V_R` is the [`EdgeTension`] with rest length R, used only while it pushes: its slope is continuous at R. The first
/// sum goes over links, the second over near pairs, linked or not. The sum of all `u_i` is zero.
///
/// On the complete graph sigma = 1/N, and the first sum is `N [k (e_i - mean e) + c (v_i - mean v)]`.
///
/// # Energy
/// ```text
/// E = 1/2 sum |v_i - mean v|^2 + (sigma k/2) sum over links of |e_i - e_j|^2 + sum over near pairs of V_R
/// dE/dt = a22 sum |v~_i|^2 - sigma c sum over links of |v_i - v_j|^2 <= -zeta sum |v~_i|^2
/// ```
///
/// because the sum over links of `|v_i - v_j|^2` is at least lambda2 times the sum of `|v~_i|^2`.
///
/// # Certificate
/// `V_R(l_ij(t)) <= E(0)` for *every* pair, for ever, on *every* connected graph. It assumes exact knowledge of links and near
/// pairs, a common compass, no delay, no saturation, no disturbance and continuous time.
///
/// # Cost
/// O(links + near pairs) a step without allocation; O(N + near pairs) on the complete graph.
#[derive(Clone, Debug)]
pub struct DisplacementLaw {
    graph: Graph,
    keys: DisplacementKeys,
    delta_m: f64,
    a22_per_s: f64,
    /// lambda2, and a bound on the largest eigenvalue, of the graph's Laplacian.
    connectivity: f64,
    largest: f64,
    /// `V_R`.
    tension: EdgeTension,
    /// Whether there are two vehicles at all.
    has_pairs: bool,
    /// That of the target that R is taken from.
    revision: u64,
    /// Scratch: `k e_i + c v_i`.
    pulls: Rows,
    /// Sum of `V_R` over the near pairs.
    memo: Memo,
}

impl DisplacementLaw {
    /// The law on these links, with the smallest distance of two slots as the range of its tension.
    ///
    /// # Errors
    /// [`ParameterError`] where graph and formation do not have the same number of vehicles, the graph is not connected, a
    /// slot or a gain is not finite, or two slots are not more than delta apart.
    pub fn new(setting: &Setting<'_>, keys: DisplacementKeys) -> Result<Self, ParameterError> {
        let &Setting { links, formation, delta_m, a22_per_s } = setting;
        let gains = [("k", keys.k_per_s2), ("zeta", keys.zeta_per_s), ("a22", a22_per_s)];
        ParameterError::check(links, formation, &gains)?;
        if let Some(&vehicle) = links.unreachable().first() {
            return Err(ParameterError::Disconnected { vehicle });
        }
        let (pair, rest_m) = nearest_slots(formation, delta_m);
        let tension =
            EdgeTension::new(keys.alpha, delta_m, rest_m).map_err(|source| ParameterError::Tension { pair, source })?;
        let count = links.count();
        Ok(Self {
            graph: links.clone(),
            keys,
            delta_m,
            a22_per_s,
            // A vehicle alone has no neighbour to be pulled by.
            connectivity: if count > 1 { links.algebraic_connectivity() } else { 1.0 },
            largest: links.largest_eigenvalue_bound(),
            tension,
            has_pairs: count > 1,
            revision: 0,
            pulls: Rows::zeros(count),
            memo: Memo::new(count),
        })
    }

    /// sigma.
    fn scale(&self) -> f64 {
        1.0 / self.connectivity
    }

    /// c \[1/s\].
    fn damping_per_s(&self) -> f64 {
        (self.keys.zeta_per_s + self.a22_per_s).max(0.0)
    }

    /// What vehicle `i` makes of vehicle `j` from whom it sees itself so far apart \[m\], and `V_R`.
    fn push(&self, i: usize, j: usize, apart_m: Vector3<f64>) -> Result<(Vector3<f64>, f64), LawError> {
        let separation_m = apart_m.norm();
        if separation_m >= self.tension.rest_m() {
            return Ok((Vector3::zeros(), 0.0));
        }
        if separation_m <= self.delta_m {
            return Err(LawError::Collision { pair: Pair::new(i, j), separation_m, delta_m: self.delta_m });
        }
        let slope_m_s2 = self.tension.derivative(separation_m);
        Ok((apart_m * (-slope_m_s2 / separation_m), self.tension.value(separation_m)))
    }

    /// Sum of `V_R` over all near pairs of a state that the law was not asked about \[m^2/s^2\].
    fn potential(&self, positions_m: &Rows) -> Result<f64, LawError> {
        let mut near = NearPairs::default();
        near.update(positions_m, self.tension.rest_m());
        let of_pair = |&(i, j): &(usize, usize)| Ok(self.push(i, j, row(positions_m, i) - row(positions_m, j))?.1);
        near.pairs().iter().map(of_pair).sum()
    }

    /// Sum over links of `|e_i - e_j|^2` \[m^2\].
    fn stretch_m2(&self, positions_m: &Rows, formation: &Formation) -> f64 {
        let error_m = |i: usize| row(positions_m, i) - row(&formation.slots_m, i);
        if self.graph.is_complete() {
            return self.graph.count() as f64 * sum_of_squares_about_mean(self.graph.count(), error_m);
        }
        self.graph.edges().map(|(i, j)| (error_m(i) - error_m(j)).norm_squared()).sum()
    }

    fn try_energy(&self, at: &Observation<'_>) -> Result<f64, LawError> {
        check_state(self.graph.count(), at.own)?;
        let positions_m = &at.own.positions_m;
        let stretch_m2 = self.stretch_m2(positions_m, at.target.formation);
        let pushes = self.memo.of(positions_m).map_or_else(|| self.potential(positions_m), Ok)?;
        let energy = relative_kinetic_energy(at.own) + 0.5 * self.scale() * self.keys.k_per_s2 * stretch_m2 + pushes;
        if energy.is_finite() { Ok(energy) } else { Err(LawError::OutOfRange) }
    }
}

/// The two slots that are nearest to each other, and how near \[m\]; a vehicle alone keeps any distance.
fn nearest_slots(formation: &Formation, delta_m: f64) -> (Pair, f64) {
    formation.min_distance().unwrap_or((Pair::new(0, 1), 2.0 * delta_m + 1.0))
}

impl Law for DisplacementLaw {
    fn name(&self) -> &'static str {
        "displacement"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        check_observation(self.graph.count(), at, command)?;
        command.fill(0.0);
        let (slots_m, k, c) = (&at.target.formation.slots_m, self.keys.k_per_s2, self.damping_per_s());
        let gain = -self.scale();
        if let Some(swarm) = at.shared() {
            self.pulls.copy_from(&swarm.positions_m);
            self.pulls -= slots_m;
            let pulls = self.pulls.as_mut_slice().iter_mut();
            pulls.zip(swarm.velocities_m_s.as_slice()).for_each(|(pull, v)| *pull = k * *pull + c * v);
            add_laplacian_product(&self.graph, &self.pulls, gain, command);
        } else {
            add_heard(at, command, |i, own, j, heard| {
                let error_m = (own.position_m - row(slots_m, i)) - (heard.position_m - row(slots_m, j));
                Ok(gain * (k * error_m + c * (own.velocity_m_s - heard.velocity_m_s)))
            })?;
        }
        let potential = add_pushes(at, command, |i, j, apart_m| self.push(i, j, apart_m))?;
        if let Some(swarm) = at.shared() {
            self.memo.keep(&swarm.positions_m, potential);
        }
        check_range(command)
    }

    fn follow(&mut self, target: &Target<'_>) -> Result<(), LawError> {
        if target.revision != self.revision {
            check_count(self.graph.count(), target.formation.count())?;
            let delta_m = self.delta_m;
            let (pair, distance_m) = nearest_slots(target.formation, delta_m);
            self.tension = EdgeTension::new(self.keys.alpha, delta_m, distance_m)
                .map_err(|_: TensionError| LawError::Target { pair, distance_m, delta_m })?;
            self.revision = target.revision;
            self.memo.forget();
        }
        Ok(())
    }

    fn energy(&self, at: &Observation<'_>) -> Option<f64> {
        self.try_energy(at).ok()
    }

    fn certificate(&self, start: &Observation<'_>) -> Certificate {
        match self.try_energy(start) {
            Ok(energy) => Certificate {
                certified_m: self.has_pairs.then(|| self.tension.push_side_root(energy)),
                energy_initial: Some(energy),
                void: Vec::new(),
            },
            Err(fault) => Certificate::void(Void::StartRefused(fault)),
        }
    }

    fn barrier_m(&self) -> Option<f64> {
        Some(self.delta_m)
    }

    fn sensing_range_m(&self) -> Option<f64> {
        Some(self.tension.rest_m())
    }

    fn needs(&self) -> &'static [&'static str] {
        &["all share a compass", "each sees who is nearer than slots are"]
    }

    /// With mu, the largest eigenvalue of the graph's Laplacian: a near pair adds 2 `V_R''` at `nearest_m` to omega^2 and the
    /// links sigma k mu. Damping is followed while sigma c mu dt is at most 0.5, which `max_rate_dt` = 0.3 keeps. In a crowd
    /// several near pairs may add up to 3.6 times as much to omega^2, which the step still follows.
    fn fastest_rate_per_s(&self, nearest_m: Option<f64>, _a22_per_s: f64) -> Option<f64> {
        const DAMPED: f64 = 0.3 / 0.5;
        let contact = match nearest_m? {
            nearest_m if nearest_m < self.tension.rest_m() => 2.0 * self.tension.second_derivative(nearest_m),
            _ => 0.0,
        };
        let links = self.scale() * self.largest;
        let omega = (contact + links * self.keys.k_per_s2).sqrt();
        Some(omega.max(DAMPED * links * self.damping_per_s()))
    }

    fn velocity_margin(&self, connectivity: f64, a22_per_s: f64) -> Option<VelocityMargin> {
        let damping_per_s = self.damping_per_s() * (connectivity / self.connectivity);
        Some(VelocityMargin {
            per_s: damping_per_s - a22_per_s,
            terms_per_s: damping_per_s + a22_per_s.abs(),
            remedy: "Raise law.zeta_per_s.",
        })
    }
}

#[cfg(test)]
mod tests;
