//! Margins of delays and of held commands: growth of a disturbance of 1 mm against linear theory.

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated, try_each};
use super::flights::{builtin, go_on, larger};
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_core::swarm::{Swarm, mean_row, row, set_row};
use tautline_laws::graph::Graph;
use tautline_laws::law::{DisplacementKeys, LawSpec, Linear};
use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::sim::{self, Components, Ending};

/// Number of units of work.
pub(super) const WORK: u64 = 3 * GRAPHS.len() as u64 + 2;

const GRAPHS: [&str; 3] = ["complete", "star", "ring"];
/// Tension so small that no pair pushes during a flight.
const NO_TENSION: f64 = 1e-8;
/// Size of the disturbance \[m\].
const DISTURBANCE_M: f64 = 1e-3;
/// Sampling rate and step rate of a flight \[Hz\].
const SAMPLE_HZ: f64 = 10.0;
/// Duration of a flight in margins for delays of messages, which change slowly, and for other kinds \[s\].
const LONG_MARGINS: f64 = 25.0;
const SHORT_S: f64 = 40.0;
/// Number of commands in a flight with held commands.
const COMMANDS: f64 = 80.0;
/// Number of halvings of the range of a margin with tension, by its logarithm.
const HALVINGS: u32 = 6;
/// Duration of a flight with tension \[s\]; the solver slows down at every onset of a push.
const PUSHED_S: f64 = 40.0;

/// Kind of margin.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Delay of all known states.
    SensingDelayed,
    /// Delay of the states of others.
    MessagesDelayed,
    /// Period between commands.
    Held,
}

impl Kind {
    fn predicted_s(self, linear: &Linear) -> f64 {
        match self {
            Self::SensingDelayed => linear.delay_margin_s(0.0),
            Self::MessagesDelayed => {
                linear.received.as_ref().and_then(|received| received.delay_margin_s(0.0)).unwrap_or(f64::NAN)
            }
            Self::Held => linear.sampling_margin_s(0.0),
        }
    }

    fn set(self, scenario: &mut Scenario, value_s: f64) {
        match self {
            Self::SensingDelayed => scenario.sensing.latency_s = value_s,
            Self::MessagesDelayed => {
                scenario.network.latency_s = value_s;
                scenario.time.duration_s = LONG_MARGINS * value_s;
            }
            Self::Held => {
                scenario.time.dt_s = value_s;
                scenario.time.record_hz = 1.0 / value_s;
                scenario.time.control_hz = Some(1.0 / value_s);
                scenario.time.duration_s = COMMANDS * value_s;
            }
        }
    }
}

/// Returns the pentagon in continuous time, displaced from its slots by 1 mm, with a common drift of 1 mm/s. No message
/// arrives before the start.
fn disturbed(graph: &str, alpha: f64) -> Result<Scenario, MeasureError> {
    let mut scenario = builtin("pentagon")?;
    let count = scenario.count();
    scenario.law = LawSpec::Displacement(DisplacementKeys { alpha, ..DisplacementKeys::default() });
    scenario.graph = match graph {
        "star" => Graph::star(count),
        "ring" => Graph::ring(count),
        _ => Graph::complete(count),
    };
    let mut start = Swarm::at_rest(scenario.formation().slots_m.clone());
    for i in 0..count {
        let turn = 4.0 * i as f64;
        let off_m = nalgebra::Vector3::new(libm::sin(turn), libm::cos(1.7 * turn), 0.0) * DISTURBANCE_M;
        let place_m = row(&start.positions_m, i) + off_m;
        set_row(&mut start.positions_m, i, place_m);
        set_row(&mut start.velocities_m_s, i, nalgebra::Vector3::new(DISTURBANCE_M, 0.0, 0.0));
    }
    scenario.start = start;
    (scenario.a22_per_s, scenario.plant) = (0.0, PlantSpec::Ideal);
    scenario.time.duration_s = SHORT_S;
    (scenario.time.dt_s, scenario.time.record_hz) = (1.0 / SAMPLE_HZ, SAMPLE_HZ);
    scenario.arrival.hold_s = 0.0;
    scenario.deadlock.mode = tautline_laws::target::DeadlockMode::Off;
    Ok(scenario)
}

/// Sink that keeps the size of the disturbance at each sample: relative motion, and optionally the common velocity.
struct DisturbanceSink<'a> {
    scenario: &'a Scenario,
    counts_common: bool,
    sizes: Vec<(f64, f64)>,
}

impl Sink for DisturbanceSink<'_> {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        let errors_m = &sample.swarm.positions_m - &self.scenario.formation().slots_m;
        let (mean_m, mean_m_s) = (mean_row(&errors_m), mean_row(&sample.swarm.velocities_m_s));
        let value_of = |i: usize| {
            let common = if self.counts_common { nalgebra::Vector3::zeros() } else { mean_m_s };
            (row(&errors_m, i) - mean_m).norm_squared() + (row(&sample.swarm.velocities_m_s, i) - common).norm_squared()
        };
        self.sizes.push((sample.time_s, (0..errors_m.nrows()).map(value_of).sum()));
        Ok(())
    }

    fn event(&mut self, _: &Event) -> Result<(), RecordError> {
        Ok(())
    }
}

/// Returns the growth rate of the disturbance from the second quarter of a flight to the last \[1/s\]; infinite if the
/// flight ended early.
fn growth_per_s(scenario: &Scenario, counts_common: bool, progress: &Progress<'_>) -> Result<f64, MeasureError> {
    scenario.validate()?;
    let mut sink = DisturbanceSink { scenario, counts_common, sizes: Vec::new() };
    let flight = sim::fly(scenario, Components::of(scenario)?, &mut sink, &mut |_| go_on(progress))?;
    if flight.ending != Ending::Completed {
        return Ok(f64::INFINITY);
    }
    let mean = |from: f64, to: f64| {
        let within = sink.sizes.iter().filter(|(time_s, _)| (from..to).contains(&(time_s / scenario.time.duration_s)));
        let (sum, number) = within.fold((0.0, 0.0), |(sum, number), (_, size)| (sum + size, number + 1.0));
        sum / number
    };
    Ok(0.5 * libm::log(mean(0.75, 1.0) / mean(0.25, 0.5)) / (0.5 * scenario.time.duration_s))
}

/// Returns the measured and the predicted period between commands \[s\], by bisection within 4 % of the prediction. Two
/// conditions of the prediction may coincide, so the growth rate is not linear there.
fn period_s(graph: &str, progress: &Progress<'_>) -> Result<(f64, f64), MeasureError> {
    const ASIDE: f64 = 0.04;
    let plain = disturbed(graph, NO_TENSION)?;
    let predicted_s = Kind::Held.predicted_s(&plain.law()?.linear(plain.formation()).ok_or("no modes")?);
    let grows = |share: f64| -> Result<bool, MeasureError> {
        let mut scenario = plain.clone();
        Kind::Held.set(&mut scenario, share * predicted_s);
        Ok(growth_per_s(&scenario, false, progress)? > 0.0)
    };
    let (mut low, mut high) = (1.0 - ASIDE, 1.0 + ASIDE);
    if grows(low)? || !grows(high)? {
        return Ok((f64::NAN, predicted_s));
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if grows(middle)? { high = middle } else { low = middle }
    }
    Ok((0.5 * (low + high) * predicted_s, predicted_s))
}

/// Returns the measured and the predicted margin \[s\]. The measured margin is the zero of the line through the growth
/// rates a little below and above the prediction.
fn margin_s(kind: Kind, graph: &str, progress: &Progress<'_>) -> Result<(f64, f64), MeasureError> {
    const ASIDE: f64 = 0.03;
    if kind == Kind::Held {
        return period_s(graph, progress);
    }
    let plain = disturbed(graph, NO_TENSION)?;
    let predicted_s = kind.predicted_s(&plain.law()?.linear(plain.formation()).ok_or("no modes")?);
    let rate = |share: f64| {
        let mut scenario = plain.clone();
        kind.set(&mut scenario, share * predicted_s);
        growth_per_s(&scenario, kind == Kind::MessagesDelayed, progress)
    };
    let (below, above) = (rate(1.0 - ASIDE)?, rate(1.0 + ASIDE)?);
    if !(below < 0.0 && above > 0.0) {
        return Ok((f64::NAN, predicted_s));
    }
    let share = 1.0 - ASIDE + 2.0 * ASIDE * below / (below - above);
    Ok((share * predicted_s, predicted_s))
}

fn free(id: &str, kind: Kind, progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let margins = try_each(&GRAPHS, progress, |graph| margin_s(kind, graph, progress))?;
    let off = |&(measured_s, predicted_s): &(f64, f64)| (measured_s / predicted_s - 1.0).abs();
    let worst = margins.iter().map(off).fold(0.0, larger);
    let words: Vec<_> = GRAPHS
        .iter()
        .zip(&margins)
        .map(|(graph, (measured_s, predicted_s))| format!("{graph} {measured_s:.3} ({predicted_s:.3})"))
        .collect();
    Ok(stated(id)?
        .measured(format!("{} s (predicted)", words.join(", ")), [("largest_relative_difference", worst)])
        .within_limit())
}

/// Returns the delay at which a disturbance of the pentagon in contact begins to grow, the contact formula and the
/// formula without contact \[s\], by bisection between the two formulas.
fn in_contact_s(near_is_late: bool, progress: &Progress<'_>) -> Result<[f64; 3], MeasureError> {
    let mut plain = disturbed("complete", 1.0)?;
    plain.time.duration_s = PUSHED_S;
    let linear = plain.law()?.linear(plain.formation()).ok_or("no modes")?;
    let contact_s = linear.stiffest_contact_mode.map_or(f64::NAN, |mode| mode.delay_margin_s(0.0));
    let free_s = linear.delay_margin_s(0.0);
    let grows = |latency_s: f64| -> Result<bool, MeasureError> {
        let mut scenario = plain.clone();
        scenario.sensing.latency_s = latency_s;
        scenario.sensing.near_latency_s = (!near_is_late).then_some(0.0);
        Ok(growth_per_s(&scenario, false, progress)? > 0.0)
    };
    if grows(contact_s)? || !grows(1.05 * free_s)? {
        return Ok([f64::NAN, contact_s, free_s]);
    }
    let (mut low_s, mut high_s) = (contact_s, 1.05 * free_s);
    for _ in 0..HALVINGS {
        let middle_s = (low_s * high_s).sqrt();
        if grows(middle_s)? { high_s = middle_s } else { low_s = middle_s }
    }
    Ok([(low_s * high_s).sqrt(), contact_s, free_s])
}

fn with_tension(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let measured = try_each(&[true, false], progress, |&near_is_late| in_contact_s(near_is_late, progress))?;
    let [[late_s, contact_s, free_s], [at_once_s, ..]] = measured[..] else { return Err("no margins".into()) };
    Ok(stated("margin-in-contact")?
        .measured(
            format!(
                "contact {contact_s:.3} s, near late {late_s:.2} s, near at once {at_once_s:.2} s, free {free_s:.3} s"
            ),
            [("near_late_s", late_s), ("near_at_once_s", at_once_s), ("contact_s", contact_s), ("free_s", free_s)],
        )
        .pass(contact_s < late_s && late_s < at_once_s && at_once_s < free_s))
}

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    Ok(vec![
        free("margin-sensing-delayed", Kind::SensingDelayed, progress)?,
        free("margin-messages-delayed", Kind::MessagesDelayed, progress)?,
        free("margin-commands-held", Kind::Held, progress)?,
        with_tension(progress)?,
    ])
}
