//! The displacement law: consensus on slots over any connected graph, plus a one-sided edge tension between near
//! vehicles.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::certificate::{Certificate, LegBound, VoidReason};
use super::clearance::{ClearanceTension, slot_clearance_margin_m};
use super::consensus::{add_pushes, check_count, check_range, check_state, check_tables};
use super::energy::PotentialCache;
use super::energy::{BoundedEnergy, EnergyBound, Frame};
use super::error::{LawError, ParameterError};
use super::interface::LawContext;
use super::interface::{Capabilities, Controls, Law, RateQuery, Rates, VelocityMargin};
use super::modes::{Linear, Mode, stiffest_contact_mode};
use super::pinned::{Gains, PinnedConsensus, error_m, feed_forward_acceleration};
use super::tension::{EdgeTension, TensionError};
use crate::formation::Formation;
use crate::graph::Pinning;
use crate::observation::Observation;
use crate::space::{CellList, Metric};
use crate::target::{Guidance, ReferenceMotion, SettlingMode, Target};
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::{Pair, Rows, row, set_row};

/// Keys of `[law]` with `kind = "displacement"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DisplacementKeys {
    /// Gain on positions over links in 1/s^2, before the division by the graph's algebraic connectivity.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub k_per_s2: f64,
    /// Lower bound of the damping rate of relative velocities in 1/s, independent of a22.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub zeta_per_s: f64,
    /// Scale of the tension between vehicles whose separation is below the smallest slot distance, in m^2/s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub alpha: f64,
}

impl Default for DisplacementKeys {
    fn default() -> Self {
        Self { k_per_s2: 1.0, zeta_per_s: 1.0, alpha: 1.0 }
    }
}

/// The displacement law on a connected undirected graph of N vehicles with a common compass. With `e_i = p_i - h_i`,
///
/// ```text
/// u_i = -sigma sum_{j in N_i} [ k (e_i - e_j) + c (v_i - v_j) ] - sum_{j : l_ij < R} grad_i V_R(l_ij)
/// sigma = 1/lambda2(L),   c = max(0, zeta + a22),   R = smallest distance of two slots on any leg
/// ```
///
/// where `V_R` is the [`EdgeTension`] with rest length R for l < R, and 0 beyond; its slope is continuous at R. The
/// first sum is over links. The second is over near pairs, which are closer than R, linked or not. The sum of all
/// `u_i` is zero.
///
/// On the complete graph sigma = 1/N, and the first sum is `N [k (e_i - mean e) + c (v_i - mean v)]`.
///
/// # Reference
/// If some vehicles know a [reference](crate::target::Guidance) r(t), the pinned Laplacian M replaces L
/// ([`crate::graph::Pinning`]), and sigma is the inverse of its least eigenvalue. `k (e_i - r) + c (v_i - r')` is added
/// to the sum of each vehicle that knows r, and `r'' - a22 r'` is fed forward to all vehicles. A leader follows the
/// reference independent of other vehicles:
///
/// ```text
/// u = r'' - a22 r' - k (e - r) - c (v - r')
/// ```
///
/// Energy and certificate are as below with v~ = v - r' and M for L. With a leader, its position and velocity replace
/// the reference.
///
/// # Energy
/// ```text
/// E = 1/2 sum |v_i - mean v|^2 + (sigma k/2) sum over links of |e_i - e_j|^2 + sum over near pairs of V_R
/// dE/dt = a22 sum |v~_i|^2 - sigma c sum over links of |v_i - v_j|^2 <= -zeta sum |v~_i|^2
/// ```
///
/// because the sum over links of `|v_i - v_j|^2` is at least lambda2 times the sum of `|v~_i|^2`, v~ = v - mean v.
///
/// # Certificate
/// `V_R(l_ij(t)) <= E(0)` for *every* pair and all time, on *every* connected graph. Assumptions: exact states over
/// links and of near pairs, a common compass, no delay, no saturation, continuous time.
///
/// External accelerations w, such as wind, add at most the time integral of the sum of `|w~_i|^2`/(4 zeta) to E, with
/// zeta = `c - a22`. They add at most the integral of |w~|/sqrt 2 to sqrt E. The certificate then holds to the end of
/// the run. w~ is relative to the same frame as v~: without a reference, an acceleration common to all vehicles adds
/// nothing.
///
/// A change X of the slots, at once or along straight lines, raises `sqrt E` by at most
/// `q(X) = sqrt(sigma k/2 tr(X^T M X))`. The bound through all legs is therefore known before the first step.
///
/// # Ellipsoids
/// If the keep-out region of a vehicle is an ellipsoid, `l_ij` is the scaled length of the [`Metric`], and so are R and
/// delta. A near pair is pushed by `-V_R'(l) S^2 (p_i - p_j)/l`. Nothing else changes; the certificate bounds scaled
/// lengths.
///
/// # Obstacles
/// The same one-sided tension acts between vehicles and fixed obstacles, on the distance from the surface less the
/// clearance. Its range is R - delta; if slots have fixed positions, it is at most the smallest clearance margin of a
/// slot. E then includes these tensions, and its kinetic part uses absolute velocities. The certificate for pairs and
/// obstacles therefore needs a reference at rest, or no reference and a22 <= 0. A leader follows only its reference,
/// which must keep clear of obstacles.
///
/// # Cost
/// O(links + near pairs) per step without allocation; O(N + near pairs) on the complete graph. Each obstacle adds O(N).
#[derive(Clone, Debug)]
pub struct DisplacementLaw {
    pulls: PinnedConsensus,
    keys: DisplacementKeys,
    delta_m: f64,
    /// Metric of separations.
    metric: Metric,
    a22_per_s: f64,
    /// Whether `r'' - a22 r'` is fed forward to the followers.
    has_feed_forward: bool,
    /// Reasons that void the certificate from any start.
    voids: Vec<VoidReason>,
    /// Bound on the energy under wind, if there is wind.
    energy_bound: Option<EnergyBound>,
    /// Least eigenvalue of the pinned Laplacian, and an upper bound on its largest.
    connectivity: f64,
    largest: f64,
    /// `V_R`.
    tension: EdgeTension,
    /// Upper bound of R from later legs \[m\].
    rest_at_most_m: f64,
    /// Tension between vehicles and obstacles, if there are obstacles.
    clearance: Option<ClearanceTension>,
    /// Whether there are at least two vehicles.
    has_pairs: bool,
    /// Revision of the target that set R.
    revision: u64,
    /// Sum of `V_R` over the near pairs and of the tensions at obstacles.
    cache: PotentialCache,
}

impl DisplacementLaw {
    /// Builds the law on the links of the context. The smallest slot distance of any leg is the range of its tension.
    ///
    /// # Errors
    /// [`ParameterError`] in one of these cases:
    ///
    /// - graph and formation have different numbers of vehicles, or the graph is not connected;
    /// - no vehicle knows the reference;
    /// - a slot or a gain is not finite, or two slots are at most delta apart.
    pub fn new(context: &LawContext<'_>, keys: DisplacementKeys) -> Result<Self, ParameterError> {
        let &LawContext { links, formation, later, guidance, obstacles, delta_m, a22_per_s, metric, .. } = context;
        let gains = [("k", keys.k_per_s2), ("zeta", keys.zeta_per_s), ("a22", a22_per_s)];
        for formation in std::iter::once(formation).chain(later.iter().map(|leg| &leg.formation)) {
            ParameterError::check(links, formation, &gains)?;
        }
        if let Some(&vehicle) = links.unreachable().first() {
            return Err(ParameterError::Disconnected { vehicle });
        }
        let pulls = PinnedConsensus::new(links, context.pinning());
        let connectivity = pulls.connectivity();
        if connectivity <= 0.0 {
            return Err(ParameterError::ReferenceUnknown);
        }
        let (mut tension, mut rest_at_most_m) = (tension_between(formation, &keys, (delta_m, metric))?, f64::INFINITY);
        for leg in later {
            let of_leg = tension_between(&leg.formation, &keys, (delta_m, metric))?;
            if of_leg.rest_m() < tension.rest_m() {
                tension = of_leg;
            }
            rest_at_most_m = tension.rest_m();
        }
        let clearance = if obstacles.is_empty() {
            None
        } else {
            let range_m = slot_clearance_margin_m(context)?.min(tension.rest_m() - delta_m);
            let tension = ClearanceTension::new(keys.alpha, range_m);
            Some(tension.map_err(|source| ParameterError::Tension { pair: Pair::new(0, 1), source })?)
        };
        let energy_bound = energy_bound(context, (keys.zeta_per_s + a22_per_s).max(0.0) - a22_per_s);
        Ok(Self {
            clearance,
            largest: links.largest_eigenvalue_bound(&pulls.pinning),
            pulls,
            keys,
            delta_m,
            metric,
            a22_per_s,
            has_feed_forward: guidance.is_none_or(|guidance| guidance.feed_forward),
            energy_bound,
            voids: voids(context),
            connectivity,
            tension,
            rest_at_most_m,
            has_pairs: links.count() > 1,
            revision: 0,
            cache: PotentialCache::new(links.count()),
        })
    }

    /// Returns the scale sigma.
    fn scale(&self) -> f64 {
        1.0 / self.connectivity
    }

    /// Returns the damping gain c \[1/s\].
    fn damping_per_s(&self) -> f64 {
        (self.keys.zeta_per_s + self.a22_per_s).max(0.0)
    }

    /// Whether some vehicle knows a reference.
    fn is_guided(&self) -> bool {
        self.pulls.pinning != Pinning::Unpinned
    }

    /// Returns the push of vehicle `j` on vehicle `i` at relative position `apart_m`, and `V_R`; `None` out of range.
    fn push(&self, i: usize, j: usize, apart_m: Vector3<f64>) -> Result<Option<(Vector3<f64>, f64)>, LawError> {
        let scaled_m = self.metric.scaled(apart_m);
        let separation_m = scaled_m.norm();
        if separation_m >= self.tension.rest_m() {
            return Ok(None);
        }
        if separation_m <= self.delta_m {
            return Err(LawError::Collision { pair: Pair::new(i, j), separation_m, delta_m: self.delta_m });
        }
        let slope_m_s2 = self.tension.derivative(separation_m);
        let pushed = self.metric.scaled(scaled_m) * (-slope_m_s2 / separation_m);
        Ok(Some((pushed, self.tension.value(separation_m))))
    }

    /// Returns the sum of all tensions of a state that is not in the cache \[m^2/s^2\].
    fn potential(&self, positions_m: &Rows, obstacles: &[Obstacle]) -> Result<f64, LawError> {
        let of_obstacles = match &self.clearance {
            Some(clearance) => clearance.potential(obstacles, positions_m)?,
            None => 0.0,
        };
        let mut near = CellList::default();
        near.update(positions_m, self.metric.longest_m(self.tension.rest_m()));
        let of_pair = |&(i, j): &(usize, usize)| {
            let pushed = self.push(i, j, row(positions_m, i) - row(positions_m, j));
            pushed.map(|pushed| pushed.map_or(0.0, |(_, of_pair)| of_pair))
        };
        Ok(of_obstacles + near.pairs().iter().map(of_pair).sum::<Result<f64, LawError>>()?)
    }

    /// `(sigma k/2) e' M e` \[m^2/s^2\].
    fn consensus_energy(&self, error_m: impl Fn(usize) -> Vector3<f64>) -> f64 {
        0.5 * self.scale() * self.keys.k_per_s2 * self.pulls.stretch_m2(error_m)
    }

    fn try_energy(&self, observation: &Observation<'_>) -> Result<f64, LawError> {
        check_state(self.pulls.graph.count(), observation.own)?;
        let (positions_m, Target { formation, reference, .. }) = (&observation.own.positions_m, observation.target);
        let stretch = self.consensus_energy(|i| error_m(positions_m, formation, reference.position_m, i));
        let pushes =
            self.cache.of(positions_m).map_or_else(|| self.potential(positions_m, observation.obstacles), Ok)?;
        let is_absolute = self.clearance.is_some() && !self.is_guided();
        let kinetic = if is_absolute {
            0.5 * observation.own.velocities_m_s.norm_squared()
        } else {
            self.pulls.kinetic_energy(observation.own, &reference)
        };
        let energy = kinetic + stretch + pushes;
        if energy.is_finite() { Ok(energy) } else { Err(LawError::OutOfRange) }
    }

    fn try_command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        command.fill(0.0);
        let gains = Gains { position: self.keys.k_per_s2, velocity: self.damping_per_s() };
        self.pulls.add_pulls(observation, gains, -self.scale(), command)?;
        let of_pairs = add_pushes(observation, command, |i, j, apart_m| self.push(i, j, apart_m))?;
        let of_obstacles =
            self.clearance.as_ref().map_or(Ok(0.0), |clearance| clearance.add_pushes(observation, command))?;
        if let Some(of_pairs) = of_pairs {
            self.cache.store(&observation.own.positions_m, of_pairs + of_obstacles);
        }
        if self.is_guided() {
            if self.has_feed_forward {
                let fed = feed_forward_acceleration(&observation.target.reference, self.a22_per_s);
                (0..command.nrows()).for_each(|i| {
                    let sum = row(command, i) + fed;
                    set_row(command, i, sum);
                });
            }
            self.pulls.lead(observation, gains, self.a22_per_s, command);
        }
        check_range(command)
    }

    /// Returns the nearest pair of slots, and R for these slots \[m\].
    fn rest_length_for(&self, formation: &Formation) -> (Pair, f64) {
        let (pair, distance_m) = nearest_slots(formation, self.delta_m, self.metric);
        (pair, distance_m.min(self.rest_at_most_m))
    }
}

/// Returns the nearest pair of slots and its distance \[m\]; an arbitrary distance above delta for a single vehicle.
fn nearest_slots(formation: &Formation, delta_m: f64, metric: Metric) -> (Pair, f64) {
    let slots = Formation::points(metric.scaled_rows(&formation.slots_m));
    slots.min_distance().unwrap_or((Pair::new(0, 1), 2.0 * delta_m + 1.0))
}

fn tension_between(
    formation: &Formation,
    keys: &DisplacementKeys,
    (delta_m, metric): (f64, Metric),
) -> Result<EdgeTension, ParameterError> {
    let (pair, rest_m) = nearest_slots(formation, delta_m, metric);
    EdgeTension::new(keys.alpha, delta_m, rest_m).map_err(|source| ParameterError::Tension { pair, source })
}

impl DisplacementLaw {
    /// Returns the fastest rate omega of the law \[1/s\], which bounds the time step.
    ///
    /// With mu the largest eigenvalue of the graph's Laplacian, the links add sigma k mu to omega^2, and a near pair
    /// adds 2 `V_R''` at `nearest_m`. The integrator is accurate for damping while sigma c mu dt <= 0.5, which
    /// `max_rate_dt` = 0.3 ensures. Several near pairs of one vehicle may add 3.6 times the amount of one pair; the
    /// step is still short enough.
    fn fastest_per_s(&self, nearest_m: f64) -> f64 {
        const DAMPED: f64 = 0.3 / 0.5;
        let contact = if nearest_m < self.tension.rest_m() {
            2.0 * self.tension.second_derivative(nearest_m) / self.metric.shortest_m(1.0).powi(2)
        } else {
            0.0
        };
        let links = self.scale() * self.largest;
        let omega = (contact + links * self.keys.k_per_s2).sqrt();
        omega.max(DAMPED * links * self.damping_per_s())
    }

    /// Returns the slowest decay rate of the linear modes.
    ///
    /// A mode with eigenvalue m >= 1 of sigma M obeys e'' + (c m - a22) e' + k m e = 0. Its rate is smallest at m = 1,
    /// or in the limit of large m, where it tends to k/c.
    fn settling(&self) -> SettlingMode {
        let (k, c) = (self.keys.k_per_s2, self.damping_per_s());
        let half = 0.5 * (c - self.a22_per_s);
        let first_per_s = if half * half > k { k / (half + (half * half - k).sqrt()) } else { half };
        let rate_per_s = if c > 0.0 { first_per_s.min(k / c) } else { first_per_s };
        SettlingMode { rate_per_s, response_s: rate_per_s / k }
    }
}

impl Law for DisplacementLaw {
    fn name(&self) -> &'static str {
        "displacement"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        let count = self.pulls.graph.count();
        check_tables(count, observation, command)?;
        // A shared state that is not finite never gives a finite command, so the state is checked only after an error.
        self.try_command(observation, command)
            .map_err(|fault| check_state(count, observation.own).err().unwrap_or(fault))
    }

    fn follow(&mut self, target: &Target<'_>) -> Result<(), LawError> {
        if target.revision != self.revision {
            check_count(self.pulls.graph.count(), target.formation.count())?;
            // Spread slots are farther apart than the leg's own, so R stays.
            if target.spread <= 1.0 {
                let (delta_m, (pair, distance_m)) = (self.delta_m, self.rest_length_for(target.formation));
                self.tension = EdgeTension::new(self.keys.alpha, delta_m, distance_m)
                    .map_err(|_: TensionError| LawError::Target { pair, distance_m, delta_m })?;
                self.cache.clear();
            }
            self.revision = target.revision;
        }
        Ok(())
    }

    fn energy(&self, observation: &Observation<'_>) -> Option<f64> {
        self.try_energy(observation).ok()
    }

    /// The contact mode is given for the complete graph without a reference.
    fn linear(&self, formation: &Formation) -> Option<Linear> {
        let (k, c) = (self.keys.k_per_s2, self.damping_per_s());
        let lead = Mode { stiffness_per_s2: k, damping_per_s: c };
        let mut linear = self.pulls.linear(lead.times(self.scale()), lead);
        if self.pulls.graph.is_complete() && !self.is_guided() && self.has_pairs {
            linear.stiffest_contact_mode = stiffest_contact_mode(lead, &self.tension, formation);
        }
        Some(linear)
    }

    fn capabilities(&self) -> Capabilities {
        let needs: &[&str] = if self.clearance.is_some() {
            &["a common compass", "each vehicle senses vehicles and obstacles nearer than the slot distance"]
        } else {
            &["a common compass", "each vehicle senses vehicles nearer than the slot distance"]
        };
        Capabilities {
            needs,
            controls: if self.is_guided() { Controls::Places } else { Controls::Displacements },
            barrier_m: Some(self.delta_m),
            sensing_range_m: Some(self.metric.longest_m(self.tension.rest_m())),
            uses_ellipsoid_metric: true,
            certifies_under_wind: true,
            certifies_target_changes: true,
            avoids_obstacles: self.clearance.is_some(),
            settling: Some(self.settling()),
            ..Capabilities::default()
        }
    }

    fn certificate(&self, start: &Observation<'_>, ahead: &[&Formation]) -> Certificate {
        self.certificate_through(start, ahead)
    }

    fn rates(&self, query: &RateQuery) -> Rates {
        let of_graph = if self.is_guided() { 1.0 } else { query.connectivity / self.connectivity };
        let damping_per_s = self.damping_per_s() * of_graph;
        Rates {
            fastest_per_s: query.nearest_m.map(|nearest_m| self.fastest_per_s(nearest_m)),
            obstacles_per_s2: (self.clearance.zip(query.obstacle_margin_m))
                .map_or(0.0, |(clearance, clearance_margin_m)| clearance.rate_squared(clearance_margin_m)),
            velocity_margin: Some(VelocityMargin {
                per_s: damping_per_s - query.a22_per_s,
                terms_per_s: damping_per_s + query.a22_per_s.abs(),
                remedy: "Raise law.zeta_per_s.",
            }),
            common_mode_per_s: if self.is_guided() { query.a22_per_s - self.damping_per_s() } else { query.a22_per_s },
        }
    }
}

impl DisplacementLaw {
    /// Returns the certificate from a state through these formations.
    fn certificate_through(&self, start: &Observation<'_>, ahead: &[&Formation]) -> Certificate {
        let energy = match self.try_energy(start) {
            Ok(energy) => energy,
            Err(fault) => return Certificate::void(VoidReason::StartRefused(fault)),
        };
        let BoundedEnergy { energy: most, until_s } = self.bound_under_wind(energy, start, ahead);
        let legs = self.bounds(most, start.target.formation, ahead);
        let last = legs.last();
        let (certified_m, certified_clearance_margin_m) =
            (last.and_then(|last| last.certified_m), last.and_then(|last| last.certified_clearance_margin_m));
        let legs = if ahead.is_empty() { Vec::new() } else { legs };
        let closes_in = ahead.iter().any(|formation| self.rest_length_for(formation).1 < self.tension.rest_m());
        let promised = Certificate {
            certified_m,
            certified_until_s: until_s,
            certified_clearance_margin_m,
            energy_initial: Some(energy),
            legs,
            ..Certificate::default()
        }
        .void_where(closes_in, VoidReason::TargetChanges);
        self.voids.iter().fold(promised, |promised, &void| promised.void_where(true, void))
    }

    /// Returns the bounds from a state of this energy, and from each change to the next formation.
    fn bounds(&self, energy: f64, now: &Formation, ahead: &[&Formation]) -> Vec<LegBound> {
        let bound = |energy: f64| LegBound {
            energy,
            certified_m: self.has_pairs.then(|| self.tension.push_side_root(energy)),
            certified_clearance_margin_m: self.clearance.map(|clearance| clearance.smallest_clearance_margin_m(energy)),
        };
        let mut root = energy.sqrt();
        let mut bounds = vec![bound(energy)];
        for step in self.energy_root_increases(now, ahead) {
            root += step;
            bounds.push(bound(root * root));
        }
        bounds
    }

    /// Returns the largest growth of sqrt E at each change of slots \[m/s\].
    fn energy_root_increases<'a>(
        &'a self,
        now: &'a Formation,
        ahead: &'a [&Formation],
    ) -> impl Iterator<Item = f64> + 'a {
        std::iter::once(now)
            .chain(ahead.iter().copied())
            .zip(ahead)
            .map(|(before, next)| self.consensus_energy(|i| row(&next.slots_m, i) - row(&before.slots_m, i)).sqrt())
    }

    /// Returns a bound on the energy under wind up to the first change of slots, and the time until which the
    /// certificate holds. The bound also covers later wind, because wind adds less to sqrt E at larger E. The
    /// certificate ends when the certified separation exceeds delta by less than the position resolution.
    fn bound_under_wind(&self, energy: f64, start: &Observation<'_>, ahead: &[&Formation]) -> BoundedEnergy {
        let Some(energy_bound) = &self.energy_bound else { return BoundedEnergy { energy, until_s: None } };
        let borne = self.tension.value(self.delta_m + energy_bound.resolution_m()).sqrt();
        let left = borne - self.energy_root_increases(start.target.formation, ahead).sum::<f64>();
        energy_bound.of(energy, start.time_s, left.max(0.0).powi(2))
    }
}

/// Returns the reasons that void the certificate from any start:
///
/// - the motion of the reference is not fed forward,
/// - the reference moves among fixed obstacles,
/// - a22 > 0 among obstacles, where absolute velocities count,
/// - the wind's contribution has no bound, or the wind moves a leader.
fn voids(context: &LawContext<'_>) -> Vec<VoidReason> {
    let &LawContext { guidance, obstacles, a22_per_s, exposure, .. } = context;
    let is_unfed = |guidance: &Guidance| !guidance.feed_forward && !needs_no_feed_forward(&guidance.motion, a22_per_s);
    let is_carried = guidance.is_some_and(|guidance| !guidance.motion.is_at_rest());
    let is_driven = guidance.is_none() && a22_per_s > 0.0;
    let is_turbulent = exposure.is_some_and(|exposure| exposure.wind.turbulence.is_some());
    let is_led = guidance.is_some_and(|guidance| matches!(guidance.known_by, Pinning::Leader(_)));
    let reasons = [
        (guidance.is_some_and(is_unfed), VoidReason::NoFeedForward),
        (!obstacles.is_empty() && is_carried, VoidReason::ReferenceAmongObstacles),
        (!obstacles.is_empty() && is_driven, VoidReason::VelocityUndamped),
        (
            is_turbulent && (frame(context) == Frame::Ground || exposure.is_some_and(|b| !b.wind.shared)),
            VoidReason::WindUnbounded,
        ),
        (is_led && exposure.is_some(), VoidReason::LeaderInWind),
    ];
    reasons.into_iter().filter(|(holds, _)| *holds).map(|(_, void)| void).collect()
}

/// Whether a vehicle stays on the reference without feed-forward.
fn needs_no_feed_forward(motion: &ReferenceMotion, a22_per_s: f64) -> bool {
    motion.is_at_rest() || (motion.is_uniform() && a22_per_s == 0.0)
}

/// Returns the frame of the law's velocities: the mean if there is no reference and no obstacle, else the ground.
fn frame(context: &LawContext<'_>) -> Frame {
    if context.guidance.is_none() && context.obstacles.is_empty() { Frame::Mean } else { Frame::Ground }
}

/// Returns the bound on the energy under wind, where relative velocities are damped at `margin_per_s` \[1/s\]. Among
/// obstacles without a reference absolute velocities count, and only drag (a22 < 0) damps them.
fn energy_bound(context: &LawContext<'_>, margin_per_s: f64) -> Option<EnergyBound> {
    let exposure = context.exposure?;
    let damping_per_s = match (context.guidance, frame(context)) {
        (None, Frame::Ground) => margin_per_s.min(-context.a22_per_s),
        _ => margin_per_s,
    };
    Some(EnergyBound::new(&exposure, context.links.count(), frame(context), damping_per_s))
}

#[cfg(test)]
mod guided_tests;
#[cfg(test)]
mod tests;
