//! Displacement law: reference flights, a leader, and variants with defects.

use nalgebra::Vector3;

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated, try_each};
use super::flights::{builtin, certified_m, continuous, larger, reached_at_s, separation_m, times};
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::graph::{Graph, Pinning};
use tautline_laws::law::{Capabilities, DisplacementKeys, Law, LawError, LawSpec};
use tautline_laws::observation::Observation;
use tautline_laws::target::{Guidance, ReferenceMotion};
use tautline_sim::continuous::{self, Tolerances};
use tautline_sim::scenario::{PlantSpec, Scenario};

/// Number of units of work.
pub(super) const WORK: u64 = 4 + 3;

/// Sampling rate of a flight \[Hz\].
const SAMPLE_HZ: f64 = 200.0;
const DURATION_S: f64 = 20.0;
/// Largest error of any distance between slots in a reached formation \[m\].
const REACHED_M: f64 = 0.01;

/// Flight with the results of an independent integration (DOP853 at a relative tolerance of 1e-11).
struct Reference {
    scenario: &'static str,
    hub: Option<usize>,
    leads: bool,
    energy: f64,
    certified_m: f64,
    closest_m: f64,
    reached_s: f64,
}

const REFERENCES: [Reference; 4] = [
    Reference {
        scenario: "pentagon",
        hub: None,
        leads: false,
        energy: 35.486_384_76,
        certified_m: 2.030_058_1,
        closest_m: 2.435_229_86,
        reached_s: 11.463,
    },
    Reference {
        scenario: "pentagon",
        hub: Some(2),
        leads: false,
        energy: 35.490_384_76,
        certified_m: 2.030_054_91,
        closest_m: 2.419_352_28,
        reached_s: 11.337,
    },
    Reference {
        scenario: "pentagon",
        hub: Some(2),
        leads: true,
        energy: 35.490_384_76,
        certified_m: 2.030_054_91,
        closest_m: 2.419_307_17,
        reached_s: 11.3605,
    },
    Reference {
        scenario: "circle",
        hub: None,
        leads: false,
        energy: 50.751_041_67,
        certified_m: 1.010_699_37,
        closest_m: 1.102_616_43,
        reached_s: 17.5335,
    },
];

/// Differences between a flight and its reference: E(0) relative, lengths \[m\], time of arrival \[s\].
struct Deviation {
    energy: f64,
    certified_m: f64,
    closest_m: f64,
    reached_s: f64,
}

fn star(count: usize, hub: usize) -> Result<Graph, MeasureError> {
    let edges: Vec<_> = (0..count).filter(|&i| i != hub).map(|i| (hub, i)).collect();
    Ok(Graph::from_edges(count, &edges)?)
}

/// Returns a built-in scenario under the displacement law, in continuous time.
fn scenario(name: &str, keys: DisplacementKeys) -> Result<Scenario, MeasureError> {
    let mut scenario = builtin(name)?;
    scenario.law = LawSpec::Displacement(keys);
    scenario.plant = PlantSpec::Ideal;
    scenario.time.duration_s = DURATION_S;
    Ok(scenario)
}

/// Returns the scenario with vehicle `leader`, at its start, on a reference motion.
fn led(mut scenario: Scenario, leader: usize, motion: ReferenceMotion, feed_forward: bool) -> Scenario {
    let begins = motion.at(0.0);
    let slot_m = row(&scenario.formation().slots_m, leader);
    let moved_m = row(&scenario.start.positions_m, leader) - begins.position_m - slot_m;
    scenario.legs[0] = scenario.legs[0].clone().placed(1.0, 0.0, moved_m);
    scenario.reference = Some(Guidance { motion, known_by: Pinning::Leader(leader), feed_forward });
    scenario
}

fn fly(reference: &Reference, progress: &Progress<'_>) -> Result<Deviation, MeasureError> {
    let mut scenario = scenario(reference.scenario, DisplacementKeys::default())?;
    if let Some(hub) = reference.hub {
        scenario.graph = star(scenario.count(), hub)?;
        if reference.leads {
            scenario = led(scenario, hub, ReferenceMotion::Rest { position_m: Vector3::zeros() }, true);
        }
    }
    let times_s = times(DURATION_S, SAMPLE_HZ);
    let solution = continuous(&scenario, &times_s, Tolerances::default(), progress)?;
    let energy = scenario.law()?.energy(&scenario.observation(&scenario.start)).unwrap_or(f64::NAN);
    let complete = Graph::complete(scenario.count());
    let reached_s = reached_at_s(&times_s, &solution.states, scenario.formation(), &complete, REACHED_M);
    Ok(Deviation {
        energy: energy / reference.energy - 1.0,
        certified_m: certified_m(&scenario)? - reference.certified_m,
        closest_m: separation_m(solution.closest) - reference.closest_m,
        reached_s: reached_s.unwrap_or(f64::NAN) - reference.reached_s,
    })
}

fn largest(deviations: &[Deviation], number: impl Fn(&Deviation) -> f64) -> f64 {
    deviations.iter().map(|off| number(off).abs()).fold(0.0, larger)
}

fn flights(deviations: &[Deviation]) -> Result<[Claim; 2], MeasureError> {
    let (energy, certified_m) =
        (largest(deviations, |deviation| deviation.energy), largest(deviations, |deviation| deviation.certified_m));
    let closest_m = largest(deviations, |deviation| deviation.closest_m);
    let lengths = stated("displacement-flights")?.measured(
        format!(
            "E(0) off by {energy:.1e}, certified separation by {certified_m:.1e} m, closest approach by \
             {closest_m:.1e} m"
        ),
        [("energy_relative", energy), ("certified_m", certified_m), ("closest_m", closest_m)],
    );
    let reached_s = largest(deviations, |deviation| deviation.reached_s);
    let arrival = stated("displacement-arrival")?
        .measured(format!("off by at most {reached_s:.4} s"), [("reached_s", reached_s)]);
    Ok([lengths.within_limit(), arrival.within_limit()])
}

/// Measures the largest distance error on a ring \[m\], with lambda2 and with N in the denominator of the gain.
fn on_a_ring(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let error_m = |share: f64| -> Result<f64, MeasureError> {
        let keys = DisplacementKeys { k_per_s2: share, zeta_per_s: share, alpha: 1.0 };
        let mut scenario = scenario("pentagon", keys)?;
        let count = 12;
        let slots = tautline_laws::formation::Formation::circle(count, 6.0);
        let mut start = slots.clone();
        // Slowest mode of the ring: a sine of one period.
        for i in 0..count {
            start.slots_m[(i, 2)] = 3.0 * libm::sin(std::f64::consts::TAU * i as f64 / count as f64);
        }
        let a22_per_s = 0.0;
        let flight = Scenario::new("ring", Swarm::at_rest(start.slots_m), slots, 1.0, DURATION_S);
        scenario =
            Scenario { law: scenario.law, plant: scenario.plant, a22_per_s, graph: Graph::ring(count), ..flight };
        let last = super::flights::end(&scenario, Tolerances::default(), progress)?;
        Ok((0..count).map(|i| last.positions_m[(i, 2)].abs()).fold(0.0, larger))
    };
    let connectivity = Graph::ring(12).algebraic_connectivity();
    let (own_m, weak_m) = (error_m(1.0)?, error_m(connectivity / 12.0)?);
    Ok(stated("displacement-ring")?
        .measured(
            format!("error after {DURATION_S} s: {own_m:.1e} m with sigma = 1/lambda2, {weak_m:.2} m with sigma = 1/N"),
            [("left_m", own_m), ("left_with_1_over_n_m", weak_m)],
        )
        .pass(own_m < REACHED_M && weak_m > 1.0))
}

/// Law whose tension attracts instead of repels.
#[derive(Clone)]
struct Flipped(Box<dyn Law>);

impl Law for Flipped {
    fn name(&self) -> &'static str {
        "flipped"
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        self.0.command(observation, command)?;
        let mut alone = Rows::zeros(command.nrows());
        self.0.command(&Observation { near: &[], ..*observation }, &mut alone)?;
        *command = alone * 2.0 - &*command;
        Ok(())
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { sensing_range_m: self.0.capabilities().sensing_range_m, ..Capabilities::default() }
    }
}

/// Measures the largest energy of the pentagon flight divided by E(0), with the tension as it is and with its sign
/// flipped.
fn energies(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let scenario = scenario("pentagon", DisplacementKeys::default())?;
    let times_s: Vec<f64> = times(3.0, SAMPLE_HZ);
    let mut watching = scenario.clone();
    watching.time.duration_s = 3.0;
    let carries_on = || !progress.is_interrupted();
    let highest = |law: &mut dyn Law| -> f64 {
        let Ok(own) = scenario.law() else { return f64::NAN };
        let energy = |swarm: &Swarm| own.energy(&scenario.observation(swarm));
        let Some(initial) = energy(&scenario.start) else { return f64::NAN };
        // Two vehicles that attract each other fall below delta, where the energy is undefined.
        match continuous::solve_while(&watching, law, &times_s, Tolerances::default(), &carries_on) {
            Ok(flown) => {
                flown.states.iter().map(|state| energy(state).unwrap_or(f64::INFINITY) / initial).fold(0.0, larger)
            }
            Err(_) => f64::INFINITY,
        }
    };
    let own = highest(scenario.law()?.as_mut());
    let flipped = highest(&mut Flipped(scenario.law()?));
    let shown = if flipped.is_finite() { format!("{flipped:.3}") } else { "unbounded".to_owned() };
    Ok(stated("displacement-energy")?
        .measured(
            format!("at most {own:.6} of E(0); flipped: {shown}"),
            [("highest_over_initial", own), ("highest_flipped", flipped)],
        )
        .pass(own <= 1.0 + 1e-9 && flipped > 1.01))
}

/// Measures the lag of the followers of an accelerating leader \[m\], with and without feed-forward.
fn lags(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    const RADIUS_M: f64 = 1e4;
    const PERIOD_S: f64 = 2000.0;
    let lag_m = |fed: bool| -> Result<f64, MeasureError> {
        let mut on_slots = scenario("pentagon", DisplacementKeys::default())?;
        on_slots.a22_per_s = 0.0;
        on_slots.graph = star(5, 0)?;
        on_slots.start = Swarm::at_rest(on_slots.formation().slots_m.clone());
        let circle = ReferenceMotion::Circle { centre_m: Vector3::zeros(), radius_m: RADIUS_M, period_s: PERIOD_S };
        let begins = circle.at(0.0);
        for i in 0..5 {
            tautline_core::swarm::set_row(&mut on_slots.start.velocities_m_s, i, begins.velocity_m_s);
        }
        let scenario = led(on_slots, 0, circle, fed);
        let last = super::flights::end(&scenario, Tolerances::default(), progress)?;
        let slots_m = &scenario.formation().slots_m;
        let offset_m = row(&last.positions_m, 0) - row(slots_m, 0);
        Ok((1..5).map(|i| (row(&last.positions_m, i) - row(slots_m, i) - offset_m).norm()).fold(0.0, larger))
    };
    let (fed_m, late_m) = (lag_m(true)?, lag_m(false)?);
    let rate_per_s = std::f64::consts::TAU / PERIOD_S;
    let expected_m = RADIUS_M * rate_per_s * rate_per_s;
    let claim = stated("displacement-leader")?;
    let limit = claim.limit();
    Ok(claim
        .measured(
            format!("{fed_m:.1e} m; without feed-forward {late_m:.5} m, |r''|/k = {expected_m:.5} m"),
            [("lag_fed_m", fed_m), ("lag_not_fed_m", late_m), ("expected_m", expected_m)],
        )
        .pass(fed_m < 1e-6 && (late_m / expected_m - 1.0).abs() < limit))
}

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    let deviations = try_each(&REFERENCES, progress, |reference| fly(reference, progress))?;
    let mut claims = flights(&deviations)?.to_vec();
    for claim in [on_a_ring, energies, lags] {
        claims.push(claim(progress)?);
        progress.advance(1);
    }
    Ok(claims)
}
