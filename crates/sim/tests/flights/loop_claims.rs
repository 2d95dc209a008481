//! Properties of the simulation loop: no step jumps a barrier or hides a violation, energy is conserved, and symmetries
//! hold. A flight that cannot continue ends with a reason and keeps its recording.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

use crate::flight::{Log, builtin, duel, fly, fly_with};
use tautline_audit::Status;
use tautline_core::record::{Event, OwnedSample};
use tautline_core::swarm::{Rows, Swarm, row, separation};
use tautline_laws::formation::Formation;
use tautline_laws::law::{Capabilities, Certificate, LaplacianKeys, Law, LawError, LawSpec, VoidReason};
use tautline_laws::observation::Observation;
use tautline_sim::plant::{self, Plant, PlantError, StepPath, rapier};
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{self, Breakdown, Components, Ending, Flight, SimError};

/// Rounding of a sum of ten tensions and five squares relative to that sum.
const ENERGY_ROUNDING: f64 = 1e-12;
/// Measured order of a second-order method from two steps: 2 up to terms of the order of dt.
const ORDER: std::ops::RangeInclusive<f64> = 1.9..=2.1;

/// Law with modified commands.
#[derive(Clone)]
struct Bent<F> {
    inner: Box<dyn Law>,
    /// Arguments: number of earlier evaluations, state, and command.
    bend: F,
    asked: u64,
}

impl<F> Bent<F> {
    fn new(scenario: &Scenario, bend: F) -> Self {
        Self { inner: scenario.law().expect("a law"), bend, asked: 0 }
    }
}

impl<F: FnMut(u64, &Swarm, &mut Rows) -> Result<(), LawError> + Clone + Send> Law for Bent<F> {
    fn name(&self) -> &'static str {
        "bent"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        self.inner.command(at, command)?;
        self.asked += 1;
        (self.bend)(self.asked - 1, at.own, command)
    }

    fn energy(&self, at: &Observation<'_>) -> Option<f64> {
        self.inner.energy(at)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { barrier_m: self.inner.capabilities().barrier_m, ..Capabilities::default() }
    }
}

/// Plant that fails after some steps: with an error, or with a state that is not finite.
#[derive(Clone)]
struct Lost {
    inner: Box<dyn Plant>,
    steps_left: u32,
    vehicle: usize,
    says_so: bool,
}

impl Plant for Lost {
    fn count(&self) -> usize {
        self.inner.count()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, path: &mut StepPath) -> Result<(), PlantError> {
        self.inner.advance(dt_s, predicted, path)?;
        self.steps_left = self.steps_left.saturating_sub(1);
        self.observe(predicted);
        let lost = self.steps_left == 0 && self.says_so;
        if lost { Err(PlantError::NotFinite { vehicle: self.vehicle }) } else { Ok(()) }
    }

    fn apply(&mut self, command: &Rows, state: &mut Swarm) {
        self.inner.apply(command, state);
    }

    fn observe(&self, swarm: &mut Swarm) {
        self.inner.observe(swarm);
        if self.steps_left == 0 {
            swarm.velocities_m_s[(self.vehicle, 1)] = f64::NAN;
        }
    }

    fn restore(&mut self, swarm: &Swarm) {
        self.inner.restore(swarm);
    }
}

// Energy

/// Returns the largest rise of the energy above its minimum so far, relative to E(0).
fn energy_rise(log: &Log) -> f64 {
    let energies: Vec<f64> = log.samples.iter().filter_map(|sample| sample.energy).collect();
    let mut least = energies[0];
    energies.iter().fold(0.0, |rise: f64, &energy| {
        least = least.min(energy);
        rise.max((energy - least) / energies[0])
    })
}

/// Returns the largest difference between E(0) - E(t) and the integral of `sum |v_i - mean v|^2` up to t, relative to
/// E(0).
fn energy_imbalance(log: &Log) -> f64 {
    let loss = |sample: &OwnedSample| {
        let mean = sample.swarm.mean_velocity_m_s();
        (0..sample.swarm.count()).map(|i| (row(&sample.swarm.velocities_m_s, i) - mean).norm_squared()).sum::<f64>()
    };
    let initial = log.samples[0].energy.expect("the law has an energy");
    let (mut lost, mut worst) = (0.0, 0.0_f64);
    for pair in log.samples.windows(2) {
        lost += 0.5 * (loss(&pair[0]) + loss(&pair[1])) * (pair[1].time_s - pair[0].time_s);
        // A flight that ends in a collision has no energy there.
        let Some(energy) = pair[1].energy else { break };
        worst = worst.max((initial - energy - lost).abs() / initial);
    }
    worst
}

/// Returns 40 s of a built-in scenario in steps of 1/`steps_per_s`, all of them recorded.
fn stepwise(name: &str, steps_per_s: u32) -> Scenario {
    let mut scenario = builtin(name, &["time.duration_s=40"]);
    scenario.time.dt_s = 1.0 / f64::from(steps_per_s);
    scenario.time.record_hz = f64::from(steps_per_s);
    scenario
}

/// Returns the law with the sign of its tension flipped: close pairs pull, distant pairs push.
fn flipped(scenario: &Scenario) -> impl Law + use<> {
    let (mut tension, flown) = (scenario.law().expect("a law"), scenario.clone());
    Bent::new(scenario, move |_, swarm: &Swarm, control: &mut Rows| {
        let (mut pull, at_rest) = (Rows::zeros(swarm.count()), Swarm::at_rest(swarm.positions_m.clone()));
        tension.command(&flown.observation(&at_rest), &mut pull)?;
        *control -= pull * 2.0;
        Ok(())
    })
}

#[test]
fn energy_decreases_at_the_theoretical_rate_up_to_the_step() {
    for name in ["pentagon", "circle"] {
        let flights = [60, 120, 240, 480].map(|steps_per_s| fly(&stepwise(name, steps_per_s)).1);
        for log in &flights {
            assert!(energy_rise(log) <= ENERGY_ROUNDING, "{name}: {}", energy_rise(log));
        }
        let imbalances = flights.each_ref().map(energy_imbalance);
        for pair in imbalances.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!(ORDER.contains(&order), "{name}: order {order} in {imbalances:?}");
        }
    }
}

#[test]
fn with_the_sign_of_the_tension_flipped_both_energy_checks_fail() {
    let scenario = stepwise("pentagon", 240);
    let (_, log) = fly_with(&scenario, Box::new(flipped(&scenario)), plant::of(&scenario));
    assert!(energy_rise(&log) > 1.0, "{}", energy_rise(&log));
    assert!(energy_imbalance(&log) > 1.0, "{}", energy_imbalance(&log));
}

// Passing through

/// Returns a vehicle that passes one at rest at 1000 m/s: 16.7 m per step, from 8.4 m before it to 8.3 m behind it.
fn thrown() -> Scenario {
    let mut scenario = duel([-41.7, 0.0], [1000.0, 0.0], 2.0, 1.0 / 60.0, 0.1);
    scenario.law = LawSpec::Laplacian(LaplacianKeys { f1_per_s2: 1.0, f2_per_s: Some(1.0) });
    scenario.time.record_hz = 60.0;
    scenario
}

#[test]
fn a_violation_between_samples_is_reported_although_the_engine_misses_it() {
    let scenario = thrown();
    let (flight, log) = fly(&scenario);
    assert_eq!((&flight.ending, flight.audit.status), (&Ending::Completed, Status::Violation));
    let [violation] = flight.audit.violations[..] else { panic!("{:?}", flight.audit.violations) };
    assert!(log.events.contains(&Event::ViolationBegan { pair: violation.pair, time_s: violation.from_s }));
    assert_eq!(log.samples.len() as u64, flight.steps + 1, "every step is a sample");
    let apart_m = |sample: &OwnedSample| separation(&sample.swarm.positions_m, 0, 1);
    let nearest_m = log.samples.iter().map(apart_m).fold(f64::INFINITY, f64::min);
    assert!(nearest_m > scenario.delta_m && violation.min_m < 0.5, "{nearest_m} m");
    assert!(flight.engine_contacts.is_empty(), "{:?}", flight.engine_contacts);
}

// Endings

/// Returns the reason why a motion could not be continued.
fn breakdown(flown: Result<Flight, SimError>) -> Breakdown {
    match flown.expect("an early end is not an error").ending {
        Ending::BrokeDown(why) => why,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_invalid_command_is_reported_with_vehicle_and_step() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    for (bad, at) in [(f64::NAN, 0), (f64::INFINITY, 7), (f64::NEG_INFINITY, 239), (1e300, 0), (-1.1e30, 5)] {
        let law = Bent::new(&scenario, move |asked, _: &Swarm, control: &mut Rows| {
            if asked == at {
                control[(3, 1)] = bad;
            }
            Ok(())
        });
        let (flown, log) = fly_with(&scenario, Box::new(law), plant::of(&scenario));
        let error = breakdown(flown);
        let not_finite = Breakdown::CommandNotFinite { step: at, vehicle: 3 };
        let expected = if bad.is_finite() { Breakdown::CommandOutOfRange { step: at, vehicle: 3 } } else { not_finite };
        assert_eq!(error, expected);
        assert_eq!(log.samples.last().map(|last| (last.step, last.control.nrows())), Some((at, 0)));
        assert!(error.to_string().starts_with(&format!("step {at}: ")) && error.to_string().contains("vehicle 4"));
        assert!(log.samples.iter().all(|sample| sample.control.iter().all(|u| u.is_finite())));
        let Some(Event::EndedEarly { reason, .. }) = log.events.last() else { panic!("{:?}", log.events) };
        assert_eq!(*reason, error.to_string());
    }
}

#[test]
fn a_state_that_is_not_finite_is_reported_with_vehicle_and_step() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    for (says_so, lost_at) in [(true, 1), (true, 9), (false, 0), (false, 1), (false, 9)] {
        let inner = rapier::plant(&scenario);
        let plant = Lost { inner, steps_left: lost_at, vehicle: 2, says_so };
        let (flown, log) = fly_with(&scenario, scenario.law().expect("a law"), Box::new(plant));
        let error = breakdown(flown);
        assert_eq!(error, Breakdown::StateNotFinite { step: u64::from(lost_at), vehicle: 2 });
        assert!(error.to_string().contains("vehicle 3"), "{error}");
        assert!(log.samples.iter().all(|sample| sample.swarm.first_not_finite().is_none()));
    }
}

#[test]
fn the_engine_reports_a_state_that_is_not_finite() {
    let scenario = builtin("pentagon", &["time.duration_s=1", "swarm.mass_kg=100"]);
    let (mut plant, mut state, mut path) = (rapier::plant(&scenario), scenario.start.clone(), StepPath::default());
    let mut control = Rows::zeros(5);
    plant.apply(&control, &mut state);
    assert_eq!(plant.advance(0.01, &mut state, &mut path), Ok(()));
    // A force of 1e308 m/s^2 times 100 kg overflows.
    control[(1, 0)] = 1e308;
    plant.apply(&control, &mut state);
    assert_eq!(plant.advance(0.01, &mut state, &mut path), Err(PlantError::NotFinite { vehicle: 1 }));
}

#[test]
fn an_undefined_law_ends_the_run_and_keeps_the_recording() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    for undefined_at in [0, 1, 101] {
        let law = Bent::new(
            &scenario,
            move |asked, _: &Swarm, _: &mut Rows| {
                if asked == undefined_at { Err(LawError::OutOfRange) } else { Ok(()) }
            },
        );
        let (flown, log) = fly_with(&scenario, Box::new(law), plant::of(&scenario));
        let flight = flown.expect("an early end is not an error");
        assert_eq!(flight.ending, Ending::LawUndefined(LawError::OutOfRange));
        assert_eq!((flight.steps, flight.audit.steps), (undefined_at, undefined_at));
        let (_, undisturbed) = fly(&scenario);
        let last = log.samples.last().expect("samples");
        let before = &log.samples[..log.samples.len() - 1];
        assert_eq!(before, &undisturbed.samples[..before.len()]);
        assert_eq!((last.step, last.time_s), (undefined_at, flight.duration_s));
        let Some(Event::EndedEarly { time_s, reason }) = log.events.last() else { panic!("{:?}", log.events) };
        assert!(*time_s == flight.duration_s && reason.contains("too large for double precision"), "{reason}");
    }
}

/// The scenario's law with a name that is created at run time.
#[derive(Clone)]
struct Named {
    inner: Box<dyn Law>,
    name: String,
}

impl Law for Named {
    fn name(&self) -> &str {
        &self.name
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        self.inner.command(at, command)
    }
}

#[test]
fn a_custom_law_is_recorded_by_its_name() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    let inner = scenario.law().expect("a law");
    let law = Named { name: format!("{} of my own", inner.name()), inner };
    let (flown, log) = fly_with(&scenario, Box::new(law), plant::of(&scenario));
    assert_eq!(flown.expect("a flight").law, "edge-tension of my own");
    let told = Event::OtherLaw { time_s: 0.0, name: "edge-tension of my own".to_owned() };
    assert_eq!(log.events, [told]);
    // The scenario's own law needs no event.
    let (flight, log) = fly(&scenario);
    assert_eq!((flight.law.as_str(), &log.events[..]), ("edge-tension", &[][..]));
}

/// Law that records the names of its threads.
#[derive(Clone)]
struct Asked {
    stays: bool,
    by: Arc<Mutex<BTreeSet<String>>>,
}

impl Law for Asked {
    fn name(&self) -> &'static str {
        "asked"
    }

    fn command(&mut self, _: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        self.by.lock().expect("no thread panicked").insert(format!("{:?}", std::thread::current().id()));
        command.fill(0.0);
        Ok(())
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { requires_calling_thread: self.stays, ..Capabilities::default() }
    }
}

#[test]
fn a_law_that_requires_the_calling_thread_runs_on_no_other() {
    let grid = Formation::grid(600, 4.0);
    let scenario = Scenario::new("grid", Swarm::at_rest(grid.slots_m.clone()), grid, 2.0, 60.0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    let asked_by = |stays: bool| {
        let by = Arc::new(Mutex::new(BTreeSet::new()));
        let parts = Components {
            law: Box::new(Asked { stays, by: Arc::clone(&by) }),
            ..Components::of(&scenario).expect("parts")
        };
        let many = || by.lock().expect("no thread panicked").len();
        let enough = |step: u64| stays && step == 300 || many() > 1;
        let mut go_on = |step| if enough(step) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        pool.install(|| sim::fly(&scenario, parts, &mut (), &mut go_on)).expect("a flight");
        many()
    };
    assert_eq!([true, false].map(asked_by), [1, 2]);
}

#[test]
fn an_interrupted_flight_is_complete_up_to_the_interruption() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    for (break_at, last_sample) in [(1, 1), (100, 100), (101, 101)] {
        let mut log = Log::default();
        let mut asked = Vec::new();
        let flight = sim::fly(&scenario, Components::of(&scenario).expect("parts"), &mut log, &mut |step| {
            asked.push(step);
            if step == break_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .expect("an interruption is not an error");
        assert_eq!((flight.ending, flight.steps), (Ending::Interrupted, break_at));
        assert_eq!(asked, (1..=break_at).collect::<Vec<_>>());
        assert_eq!(log.samples.last().map(|sample| sample.step), Some(last_sample));
        let steps: Vec<_> = log.samples.iter().map(|sample| sample.step).collect();
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1]), "no instant is recorded twice: {steps:?}");
        assert!(matches!(log.events.last(), Some(Event::EndedEarly { reason, .. }) if reason == "interrupted"));
    }
}

#[test]
fn an_interruption_at_the_last_step_completes_the_flight() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    let flight = sim::fly(&scenario, Components::of(&scenario).expect("parts"), &mut (), &mut |step| {
        if step == 240 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(flight.expect("a flight").ending, Ending::Completed);
}

#[test]
fn samples_are_recorded_at_the_recording_rate() {
    for (record_hz, samples) in [(60, 61), (1, 2), (240, 241), (1000, 241), (7, 8)] {
        let scenario = builtin("pentagon", &["time.duration_s=1", &format!("time.record_hz={record_hz}")]);
        let (_, log) = fly(&scenario);
        assert_eq!(log.samples.len(), samples, "{record_hz} Hz");
        assert_eq!(log.samples[0].time_s, 0.0);
        assert_eq!(log.samples.last().map(|sample| sample.time_s), Some(1.0));
        for sample in &log.samples {
            assert_eq!(sample.time_s, sample.step as f64 * scenario.time.dt_s);
        }
    }
}

#[test]
fn the_closest_approach_of_a_sample_covers_all_steps_since_the_last() {
    let fine = fly(&builtin("pentagon", &["time.duration_s=5", "time.record_hz=240"])).1;
    let coarse = fly(&builtin("pentagon", &["time.duration_s=5", "time.record_hz=2"])).1;
    let mut from = 0;
    for sample in &coarse.samples {
        let since = fine.samples.iter().filter(|step| step.step == 0 || (from..=sample.step).contains(&step.step));
        let since = since.filter(|step| sample.step == 0 || step.step > 0);
        let least = since.filter_map(|step| step.separation).min_by(|a, b| a.separation_m.total_cmp(&b.separation_m));
        assert_eq!(sample.separation, least, "at {} s", sample.time_s);
        from = sample.step + 1;
    }
}

/// Law that certifies 3 m for any formations ahead.
#[derive(Clone)]
struct Careless;

impl Law for Careless {
    fn name(&self) -> &'static str {
        "careless"
    }

    fn command(&mut self, _: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        command.fill(0.0);
        Ok(())
    }

    fn certificate(&self, _: &Observation<'_>, _: &[&Formation]) -> Certificate {
        Certificate { certified_m: Some(3.0), void: Vec::new(), ..Certificate::void(VoidReason::NoBarrier) }
    }
}

#[test]
fn a_law_that_ignores_later_formations_certifies_no_flight_through_them() {
    let still = builtin("pentagon", &["time.duration_s=1"]);
    assert_eq!(still.certificate(&Careless).certified_m, Some(3.0));
    let mut legs = still.clone();
    legs.legs.push(legs.legs[0].clone());
    let certificate = legs.certificate(&Careless);
    assert_eq!((certificate.certified_m, &certificate.void[..]), (None, &[VoidReason::TargetChanges][..]));
}
