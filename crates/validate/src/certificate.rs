//! Energy and certificate on random starts, in continuous time and in Rapier.

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated, try_each};
use super::flights::{COUNTS, DELTA_M, random_starts};
use super::flights::{certified_m, continuous, engine_to_any_end, larger, separation_m, times, with_step};
use tautline_core::swarm::Swarm;
use tautline_core::text::bound;
use tautline_laws::formation::Formation;
use tautline_laws::law::{EdgeTension, EdgeTensionKeys, Law, LawSpec, ParameterError};
use tautline_sim::continuous::{self, IdealError, Tolerances};
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::Ending;

/// Number of random starts.
pub(super) const STARTS: usize = 500;
const SEED: u64 = 2;
/// Duration of each flight \[s\]; the closest approach is within the first seconds.
const DURATION_S: f64 = 10.0;
/// Sampling rate of the energy \[Hz\].
const SAMPLE_HZ: f64 = 8.0;
/// Largest omega dt of a step, with the fastest oscillation at the certified separation.
const STIFF_SHARE: f64 = 0.3;
/// Longest step of Rapier \[s\].
const LONGEST_STEP_S: f64 = 1.0 / 240.0;

/// Speeds of each of two vehicles head on \[m/s\].
const HEAD_ON_M_S: [f64; 3] = [1.0, 4.0, 16.0];
const HEAD_ON_NAMES: [&str; 3] = ["ratio_at_1_m_s", "ratio_at_4_m_s", "ratio_at_16_m_s"];

/// Results of one start.
#[derive(Clone, Copy, Debug)]
struct Trial {
    certified_m: f64,
    /// Smallest separation in continuous time and in Rapier \[m\].
    continuous_m: f64,
    engine_m: f64,
    dt_s: f64,
    /// Largest rise of E between samples, divided by E(0), in continuous time.
    energy_rise: f64,
    /// Largest rise of E above its lowest value so far, divided by E(0), in Rapier.
    engine_energy_rise: f64,
    /// Largest excess of E over E(0), divided by E(0), in Rapier.
    engine_energy_excess: f64,
}

/// Returns the longest step that resolves the tension at the certified separation.
fn resolving_step_s(scenario: &Scenario, certified_m: f64) -> Result<f64, MeasureError> {
    let LawSpec::EdgeTension(EdgeTensionKeys { alpha }) = scenario.law else { return Ok(LONGEST_STEP_S) };
    let Some((_, rest_m)) = scenario.formation().min_distance() else { return Ok(LONGEST_STEP_S) };
    let stiffness = EdgeTension::new(alpha, scenario.delta_m, rest_m)?.second_derivative(certified_m);
    Ok(LONGEST_STEP_S.min(STIFF_SHARE / stiffness.sqrt()))
}

/// Constructor of the law of a scenario.
type MakeLaw = fn(&Scenario) -> Result<Box<dyn Law>, ParameterError>;

/// Flies a start under a law, against the certificate of the scenario's own law. A flight whose law or solver fails has
/// the smallest separation NaN, which breaks the certificate.
fn fly(start: &Scenario, make_law: MakeLaw, progress: &Progress<'_>) -> Result<Trial, MeasureError> {
    // The certificate does not depend on a22; the motion of the centre of mass does.
    let scenario = Scenario { a22_per_s: 0.1, ..start.clone() };
    let certificate = scenario.law()?.certificate(&scenario.observation(&scenario.start), &[]);
    let certified_m = certificate.certified_m.unwrap_or(f64::NAN);
    let energy_initial = certificate.energy_initial.unwrap_or(f64::NAN);
    let mut law = make_law(&scenario)?;
    let times_s = times(DURATION_S, SAMPLE_HZ);
    let carries_on = || !progress.is_interrupted();
    let tolerances = Tolerances::default();
    let solved = continuous::solve_while(&scenario, law.as_mut(), &times_s, tolerances, &carries_on);
    let (continuous_m, energy_rise) = match solved {
        Ok(solution) => {
            let energy = |state: &Swarm| law.energy(&scenario.observation(state)).unwrap_or(f64::NAN);
            let energies: Vec<f64> = solution.states.iter().map(energy).collect();
            let rises = energies.windows(2).map(|pair| (pair[1] - pair[0]) / energy_initial);
            (separation_m(solution.closest), rises.fold(0.0, larger))
        }
        Err(IdealError::Law { .. } | IdealError::Stalled { .. }) => (f64::NAN, f64::NAN),
        Err(error) => return Err(error.into()),
    };

    let dt_s = resolving_step_s(&scenario, certified_m)?;
    let (mut lowest, mut engine_energy_rise, mut engine_energy_excess) = (energy_initial, 0.0, 0.0);
    let flight = engine_to_any_end(&with_step(&scenario, dt_s), law, progress, |sample| {
        let energy = sample.energy.unwrap_or(f64::NAN);
        engine_energy_rise = larger(engine_energy_rise, (energy - lowest) / energy_initial);
        engine_energy_excess = larger(engine_energy_excess, (energy - energy_initial) / energy_initial);
        lowest = lowest.min(energy);
    })?;
    let engine_m = if flight.ending == Ending::Completed { separation_m(flight.audit.closest) } else { f64::NAN };
    Ok(Trial { certified_m, continuous_m, engine_m, dt_s, energy_rise, engine_energy_rise, engine_energy_excess })
}

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    let trials =
        try_each(&random_starts(SEED, STARTS, DURATION_S)?, progress, |start| fly(start, Scenario::law, progress))?;
    let tight = tight(progress)?;
    progress.advance(1);
    let [energy, in_engine, certificate, certificate_in_engine] = claims(&trials)?;
    Ok(vec![energy, in_engine, certificate, tight, certificate_in_engine])
}

/// Returns the smallest clearance divided by the certified one, for two vehicles head on from 2 delta with these speeds
/// \[m/s\].
fn head_on(speed_m_s: f64, progress: &Progress<'_>) -> Result<f64, MeasureError> {
    let mut swarm = Swarm::at_rest(Formation::line(2, 2.0 * DELTA_M).slots_m);
    (swarm.velocities_m_s[(0, 0)], swarm.velocities_m_s[(1, 0)]) = (speed_m_s, -speed_m_s);
    let scenario = Scenario::new("head-on", swarm, Formation::line(2, 2.0 * DELTA_M), DELTA_M, 1.0);
    let closest = continuous(&scenario, &[scenario.time.duration_s], Tolerances::default(), progress)?.closest;
    Ok((separation_m(closest) - DELTA_M) / (certified_m(&scenario)? - DELTA_M))
}

fn tight(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let ratios = HEAD_ON_M_S.iter().map(|&speed_m_s| head_on(speed_m_s, progress)).collect::<Result<Vec<_>, _>>()?;
    let list = HEAD_ON_M_S.iter().zip(&ratios).map(|(speed_m_s, ratio)| format!("{ratio:.3} at {speed_m_s} m/s"));
    let last = ratios.last().copied().unwrap_or(f64::NAN);
    let claim = stated("certificate-is-tight")?;
    let pass = ratios.is_sorted_by(|a, b| a > b) && (1.0..1.0 + claim.limit()).contains(&last);
    let words = list.collect::<Vec<_>>().join(", ");
    Ok(claim.measured(words, HEAD_ON_NAMES.into_iter().zip(ratios)).pass(pass))
}

/// Returns the claims about energy and certificate, in continuous time and in Rapier.
fn claims(trials: &[Trial]) -> Result<[Claim; 4], MeasureError> {
    Ok([energy(trials)?, energy_in_the_engine(trials)?, in_continuous_time(trials)?, in_the_engine(trials)?])
}

fn energy(trials: &[Trial]) -> Result<Claim, MeasureError> {
    let claim = stated("energy-never-increases")?;
    let rise = trials.iter().map(|trial| trial.energy_rise).fold(0.0, larger);
    let words = format!(
        "largest rise {} of E(0), {STARTS} random starts, {DURATION_S} s, {SAMPLE_HZ} samples a second",
        bound(rise, claim.limit())
    );
    Ok(claim.measured(words, [("largest_rise_over_initial", rise)]).within_limit())
}

fn energy_in_the_engine(trials: &[Trial]) -> Result<Claim, MeasureError> {
    let claim = stated("energy-in-the-engine")?;
    let excess = trials.iter().map(|trial| trial.engine_energy_excess).fold(0.0, larger);
    let rise = trials.iter().map(|trial| trial.engine_energy_rise).fold(0.0, larger);
    let words = format!(
        "largest excess {} of E(0), {}. With oscillating modes E rises above its lowest value by up to \
         {rise:.1e} of E(0)",
        bound(excess, claim.limit()),
        population()
    );
    let pass = excess <= claim.limit();
    let values = [("largest_excess_over_initial", excess), ("largest_rise_over_initial", rise)];
    Ok(claim.measured(words, values).pass(pass))
}

fn population() -> String {
    format!("{STARTS} random starts of {} to {} vehicles in plane and space", COUNTS.start(), COUNTS.end())
}

/// Returns the number of trials that broke the certificate, the smallest margin \[m\], and the smallest clearance
/// divided by the certified one.
fn kept(trials: &[Trial], closest_m: fn(&Trial) -> f64) -> (usize, f64, f64) {
    let margins_m = trials.iter().map(|trial| closest_m(trial) - trial.certified_m);
    let ratios = trials.iter().map(|trial| (closest_m(trial) - DELTA_M) / (trial.certified_m - DELTA_M));
    // NaN counts as broken.
    let broken = trials.len() - margins_m.clone().filter(|&margin_m| margin_m >= 0.0).count();
    (broken, margins_m.fold(f64::INFINITY, f64::min), ratios.fold(f64::INFINITY, f64::min))
}

fn in_continuous_time(trials: &[Trial]) -> Result<Claim, MeasureError> {
    let (broken, margin_m, ratio) = kept(trials, |trial| trial.continuous_m);
    let words = format!(
        "broken {broken} times in {STARTS} starts; smallest margin {margin_m:.4} m; clearance at least {ratio:.2} \
         times the certified one"
    );
    let values = [("broken", broken as f64), ("smallest_margin_m", margin_m), ("smallest_clearance_ratio", ratio)];
    Ok(stated("certificate")?.measured(words, values).pass(broken == 0))
}

fn in_the_engine(trials: &[Trial]) -> Result<Claim, MeasureError> {
    let (broken, margin_m, _) = kept(trials, |trial| trial.engine_m);
    let differences_m = trials.iter().map(|trial| (trial.engine_m - trial.continuous_m).abs());
    let difference_m = differences_m.fold(0.0, larger);
    let shortest_s = trials.iter().map(|trial| trial.dt_s).fold(f64::INFINITY, f64::min);
    let words = format!(
        "broken {broken} times in {STARTS} starts; smallest margin {margin_m:.4} m; closest approaches within \
         {difference_m:.4} m of continuous time; steps of {:.2} to {:.2} ms",
        shortest_s * 1e3,
        LONGEST_STEP_S * 1e3
    );
    let values = [
        ("broken", broken as f64),
        ("smallest_margin_m", margin_m),
        ("largest_difference_m", difference_m),
        ("shortest_dt_s", shortest_s),
    ];
    Ok(stated("certificate-in-the-engine")?.measured(words, values).pass(broken == 0))
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;
    use tautline_core::monitor::Silent;
    use tautline_core::swarm::Rows;
    use tautline_laws::law::LawError;

    /// Number of starts of a short form of the claim.
    const FEW: usize = 24;
    const GOOD: Trial = Trial {
        certified_m: 1.1,
        continuous_m: 1.2,
        engine_m: 1.2,
        dt_s: 0.01,
        energy_rise: 0.0,
        engine_energy_rise: 0.0,
        engine_energy_excess: 0.0,
    };

    fn fly_few() -> Vec<Trial> {
        let starts = random_starts(SEED, FEW, DURATION_S).expect("starts");
        starts.par_iter().map(|start| fly(start, Scenario::law, &Silent::default()).expect("a flight")).collect()
    }

    #[test]
    fn trials_have_the_same_bits_on_any_number_of_threads() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(fly_few)
        };
        let bits = |trials: &[Trial]| -> Vec<[u64; 5]> {
            let numbers = |t: &Trial| [t.certified_m, t.continuous_m, t.engine_m, t.dt_s, t.energy_rise];
            trials.iter().map(|trial| numbers(trial).map(f64::to_bits)).collect()
        };
        assert_eq!(bits(&on(1)), bits(&on(3)));
    }

    #[test]
    fn a_step_across_the_barrier_breaks_the_certificate_and_fails_the_claim() {
        // Head on at 5 m/s each from a separation of 3 m, with steps of 0.5 s without refinement.
        let mut swarm = Swarm::at_rest(Formation::line(2, 3.0).slots_m);
        (swarm.velocities_m_s[(0, 0)], swarm.velocities_m_s[(1, 0)]) = (5.0, -5.0);
        let mut scenario = Scenario::new("jump", swarm, Formation::line(2, 2.0), DELTA_M, 1.0);
        scenario.time.max_halvings = 0;
        let certified_m = scenario
            .law()
            .expect("a law")
            .certificate(&scenario.observation(&scenario.start), &[])
            .certified_m
            .expect("a promise");
        let trial = |dt_s: f64| {
            let law = scenario.law().expect("a law");
            let scenario = with_step(&scenario, dt_s);
            let flight = engine_to_any_end(&scenario, law, &Silent::default(), |_| ()).expect("a flight");
            let engine_m = flight.audit.closest.expect("two vehicles").separation_m;
            Trial { certified_m, engine_m, dt_s, ..GOOD }
        };
        let honest = trial(resolving_step_s(&scenario, certified_m).expect("a tension"));
        let judge = |trials: &[Trial]| in_the_engine(trials).expect("a claim");
        assert!(judge(&[honest]).pass, "{honest:?}");
        let jumped = trial(0.5);
        assert!(!judge(&[honest, jumped]).pass, "{jumped:?}");
        assert_eq!(judge(&[honest, jumped]).value("broken"), Some(1.0));
    }

    #[test]
    fn a_rising_energy_and_nan_fail_the_claims() {
        let passes = |second: Trial| claims(&[GOOD, second]).expect("claims").map(|claim| claim.pass);
        assert_eq!(passes(GOOD), [true; 4]);
        for rise in [1e-3, f64::NAN] {
            assert_eq!(passes(Trial { energy_rise: rise, ..GOOD }), [false, true, true, true]);
            assert_eq!(passes(Trial { engine_energy_excess: rise, ..GOOD }), [true, false, true, true]);
        }
        let lost = Trial { continuous_m: f64::NAN, ..GOOD };
        assert_eq!(passes(lost), [true, true, false, true], "a separation that is no number keeps no promise");
    }

    use tautline_laws::observation::Observation;

    /// Edge-tension law with the sign of the tension flipped; the damping is unchanged.
    #[derive(Clone)]
    struct Flipped(Box<dyn Law>, Swarm);

    impl Law for Flipped {
        fn name(&self) -> &'static str {
            "flipped"
        }

        fn command(&mut self, observation: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
            self.1.positions_m.copy_from(&-&observation.own.positions_m);
            self.1.velocities_m_s.copy_from(&observation.own.velocities_m_s);
            self.0.command(&Observation { own: &self.1, ..*observation }, command)
        }

        fn energy(&self, observation: &Observation<'_>) -> Option<f64> {
            self.0.energy(observation)
        }
    }

    #[test]
    fn a_flipped_tension_fails_the_claims_about_energy_and_certificate() {
        let starts = random_starts(SEED, FEW, DURATION_S).expect("starts");
        let flipped: MakeLaw = |scenario| Ok(Box::new(Flipped(scenario.law()?, scenario.start.clone())));
        let trials: Vec<Trial> =
            starts.par_iter().map(|start| fly(start, flipped, &Silent::default()).expect("a trial")).collect();
        for claim in claims(&trials).expect("claims") {
            assert!(!claim.pass, "{claim:?}");
        }
    }
}
