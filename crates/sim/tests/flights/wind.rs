//! Points in wind: their drift, the effect of wind on separations, and certificates.

use tautline_core::record::StateHash;
use tautline_core::swarm::{Rows, Swarm, row, separation};
use tautline_laws::formation::Formation;
use tautline_laws::law::VoidReason;
use tautline_laws::wind::{Gust, WindSpec};
use tautline_sim::continuous::{self, Tolerances};
use tautline_sim::plant::{StepPath, rapier};
use tautline_sim::scenario::{Override, PlantSpec, Scenario, Source, TimeSpec};
use tautline_sim::sim::Simulation;

use crate::flight::{Log, builtin, fly, read};

type Vector = nalgebra::Vector3<f64>;

/// Returns five vehicles on their way to a line under the displacement law.
fn five(more: &str) -> Scenario {
    read(&format!(
        "[swarm]\ndimensions = 3\n[start]\n\
         positions_m = [[0.0, 0.1], [2.0, 0.0, 0.2], [4.0, -0.1], [6.0, 0.2], [8.0, 0.0]]\n\
         [formation]\nshape = \"circle\"\nradius_m = 2.0\n[law]\nkind = \"displacement\"\ndelta_m = 1.0\n\
         {more}"
    ))
}

/// Returns five vehicles near their slots, under the same law.
fn settled(more: &str) -> Scenario {
    let start = Formation::circle(5, 2.05).slots_m;
    Scenario { start: Swarm::at_rest(start), ..five(more) }
}

fn gust(at_s: f64, velocity_m_s: Vector, vehicles: Option<Vec<usize>>) -> Gust {
    Gust { at_s, rise_s: 1.0, hold_s: 0.5, fall_s: Some(1.5), velocity_m_s, vehicles }
}

/// Returns the distances of all pairs at all samples.
fn distances(log: &Log) -> Vec<f64> {
    let pairs = |rows: &Rows| {
        let count = rows.nrows();
        (0..count).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| separation(rows, i, j)).collect::<Vec<_>>()
    };
    log.samples.iter().flat_map(|sample| pairs(&sample.swarm.positions_m)).collect()
}

/// v' = a22 v + d (W - v): from rest to d W/(d - a22), as 1 - exp(-(d - a22) t).
#[test]
fn a_point_drifts_with_the_wind_up_to_its_other_drag() {
    for (a22_per_s, plant) in [(0.0, "rapier"), (-0.2, "rapier"), (-0.2, "ideal")] {
        let toml = format!(
            "[swarm]\na22_per_s = {a22_per_s}\n[vehicle]\ndrag_per_s = 0.5\n[wind]\nmean_m_s = [3.0, -1.0]\n\
             [start]\npositions_m = [[0.0, 0.0], [3.0, 0.0]]\n[formation]\nshape = \"line\"\nspacing_m = 3.0\n\
             [law]\nkind = \"displacement\"\ndelta_m = 1.0\n[plant]\nkind = \"{plant}\"\n[time]\nduration_s = 30.0\n"
        );
        let (_, log) = fly(&read(&toml));
        for sample in &log.samples {
            let rate_per_s = 0.5 - a22_per_s;
            let share = 1.0 - (-rate_per_s * sample.time_s).exp();
            let expected = Vector::new(3.0, -1.0, 0.0) * (0.5 / rate_per_s * share);
            // The relative error of the engine's step is (rate dt)^2/12.
            assert!((row(&sample.swarm.velocities_m_s, 1) - expected).norm() < 3e-6, "{plant} at {} s", sample.time_s);
        }
        assert_eq!(log.samples[3].channels[0].name.as_ref(), "wind");
        assert_eq!(log.samples[3].channels[0].values, [3.0, -1.0, 0.0, 3.0, -1.0, 0.0]);
    }
}

#[test]
fn drag_in_still_air_is_the_flight_of_a_negative_a22_bit_for_bit() {
    let hash = |sets: &[&str]| {
        let mut hash = StateHash::new();
        let (_, log) = fly(&builtin("pentagon", &[&["time.duration_s=5"], sets].concat()));
        log.samples.iter().for_each(|sample| hash.observe(&sample.as_sample()));
        (hash.finish(), log.samples[0].channels.len())
    };
    assert_eq!(hash(&["swarm.a22_per_s=-0.25"]), hash(&["swarm.a22_per_s=0", "vehicle.drag_per_s=0.25"]));
    let windy = hash(&["swarm.a22_per_s=0", "vehicle.drag_per_s=0.25", "wind.mean_m_s=[0.1, 0.0]"]);
    assert_eq!(windy.1, 1, "the wind is recorded");
}

/// In gusts, turbulence and the law's own motion the error falls with the square of the step.
#[test]
fn the_engine_is_of_second_order_in_a_wind() {
    let errors: Vec<_> = [60.0, 120.0, 240.0, 480.0]
        .map(|hz: f64| {
            let mut scenario = five("[vehicle]\ndrag_per_s = 0.8\n[time]\nduration_s = 4.0\nmax_halvings = 0");
            scenario.time.dt_s = 1.0 / hz;
            let gusts = vec![
                gust(0.3, Vector::new(4.0, 0.0, 1.0), Some(vec![1, 3])),
                gust(1.0, Vector::new(0.0, -3.0, 0.0), None),
            ];
            scenario.wind = WindSpec { mean_m_s: Vector::new(0.5, 1.0, 0.0), gusts, ..WindSpec::default() };
            let mut law = scenario.law().expect("a law");
            let exact = continuous::solve(&scenario, law.as_mut(), &[4.0], Tolerances::default()).expect("a solution");
            let (flight, _) = fly(&scenario);
            (&flight.last.positions_m - &exact.states[0].positions_m).norm()
        })
        .into();
    for errors in errors.windows(2) {
        let order = (errors[0] / errors[1]).log2();
        assert!((1.9..2.1).contains(&order), "{errors:?}");
    }
}

#[test]
fn only_individual_turbulence_changes_separations() {
    let flown = |wind: &str| distances(&fly(&five(&format!("{wind}\n[time]\nduration_s = 20.0"))).1);
    let still = flown("[vehicle]\ndrag_per_s = 0.4");
    let windy = |shared: bool| {
        let wind = "mean_m_s = [5.0, 0.0]\ndryden = { speed_20ft_m_s = 10.0, height_m = 10.0 }";
        let flown = flown(&format!("[vehicle]\ndrag_per_s = 0.4\n[wind]\n{wind}\nshared = {shared}"));
        flown.iter().zip(&still).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert!(windy(true) < 1e-9, "{}", windy(true));
    assert!(windy(false) > 0.1, "{}", windy(false));
}

/// Both plants have the same turbulence: it is a function of time and seed.
#[test]
fn the_ideal_plant_has_the_same_turbulence() {
    let wind = "[vehicle]\ndrag_per_s = 0.4\n[wind]\nshared = false\n\
     dryden = { speed_20ft_m_s = 10.0, height_m = 10.0 }\n\
                [time]\nduration_s = 3.0";
    let mut scenario = five(wind);
    scenario.time = TimeSpec { dt_s: 1.0 / 1024.0, record_hz: 64.0, ..scenario.time };
    let (sampled, engine) = fly(&scenario);
    scenario.plant = PlantSpec::Ideal;
    scenario.time.dt_s = 1.0 / 64.0;
    let (exact, ideal) = fly(&scenario);
    for (one, other) in engine.samples.iter().zip(&ideal.samples) {
        let apart = one.channels[0].values.iter().zip(&other.channels[0].values).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-9, "{} s", one.time_s);
    }
    let off_m = (&sampled.last.positions_m - &exact.last.positions_m).amax();
    assert!(off_m < 1e-5, "{off_m}");
    scenario.noise_seed = 1;
    let (other, _) = fly(&scenario);
    assert!((&other.last.positions_m - &exact.last.positions_m).amax() > 1e-3);
}

#[test]
fn a_saved_flight_in_turbulence_goes_on_with_the_same_bits_and_another_seed_with_others() {
    let wind = "[vehicle]\ndrag_per_s = 0.4\n[wind]\nshared = false\n\
     dryden = { speed_20ft_m_s = 10.0, height_m = 10.0 }\n\
                [time]\nduration_s = 4.0";
    for plant in [PlantSpec::Rapier, PlantSpec::Ideal] {
        let scenario = Scenario { plant, ..five(wind) };
        let end = |mut simulation: Simulation| {
            while simulation.ending().is_none() {
                simulation.step();
            }
            simulation.finish().last
        };
        let mut simulation = Simulation::new(&scenario).expect("a simulation");
        (0..333).for_each(|_| simulation.step());
        let saved = simulation.save();
        let whole = end(simulation.clone());
        simulation.load(&saved, None);
        assert_eq!(end(simulation.clone()), whole);
        simulation.load(&saved, Some(99));
        assert!((end(simulation).positions_m - whole.positions_m).amax() > 1e-4);
    }
}

/// A step that is undone and halved has the same wind.
#[test]
fn an_undone_step_is_repeated_in_the_same_wind() {
    let scenario = five(
        "[vehicle]\ndrag_per_s = 0.4\n[wind]\nshared = false\ndryden = { speed_20ft_m_s = 10.0, height_m = 10.0 }\n\
         [time]\nduration_s = 4.0",
    );
    let mut straight = rapier::plant(&scenario);
    let mut halting = straight.clone();
    let (mut state, mut path, command) = (scenario.start.clone(), StepPath::default(), Rows::zeros(5));
    let mut other: Swarm = state.clone();
    straight.apply(&command, &mut state);
    halting.apply(&command, &mut other);
    for _ in 0..100 {
        let before = other.clone();
        halting.advance(0.02, &mut other, &mut path).expect("a step");
        halting.restore(&before);
        for (plant, state) in [(&mut straight, &mut state), (&mut halting, &mut other)] {
            for _ in 0..2 {
                plant.advance(0.01, state, &mut path).expect("a step");
                plant.apply(&command, state);
            }
        }
    }
    // Undoing rounds positions relative to the origin.
    assert!((&state.positions_m - &other.positions_m).amax() < 1e-12);
    assert!((&state.velocities_m_s - &other.velocities_m_s).amax() < 1e-12);
    assert!(state.velocities_m_s.amax() > 0.1);
}

/// Random gusts on random vehicles over three graphs: separations keep the certificate, and the energy stays below its
/// bound, which often exceeds the initial energy.
#[test]
fn no_flight_in_gusts_violates_its_certificate() {
    let mut rises = 0;
    for flight in 0..15_u32 {
        let random = |k: u32| f64::from((flight * 7919 + k * 104_729 + 13) % 1009) / 1009.0 - 0.5;
        let graph = ["complete", "star", "ring"][flight as usize % 3];
        let mut scenario =
            settled(&format!("[graph]\nkind = \"{graph}\"\n[vehicle]\ndrag_per_s = 0.8\n[time]\nduration_s = 8.0"));
        let gusts = (0..4).map(|k| {
            let met = (0..5).filter(|i| random(20 + 5 * k + i) > 0.0).map(|i| i as usize).collect();
            let velocity_m_s = 12.0 * Vector::new(random(k), random(k + 5), random(k + 10));
            gust(5.0 * (0.5 + random(k + 15)), velocity_m_s, Some(met))
        });
        let gusts = gusts.filter(|gust| gust.vehicles.as_ref().is_some_and(|met| !met.is_empty())).collect();
        scenario.wind = WindSpec { mean_m_s: Vector::x(), gusts, ..WindSpec::default() };
        scenario.validate().expect("a valid scenario");
        let (flight, log) = fly(&scenario);
        let certified_m = flight.certificate.certified_m.expect("a promise");
        let closest_m = flight.audit.closest.expect("a closest approach").separation_m;
        assert!(closest_m > certified_m, "{closest_m} {certified_m}");
        let energies = log.samples.iter().filter_map(|sample| sample.peaks.energy);
        rises +=
            u32::from(energies.fold(0.0, f64::max) > 1.001 * flight.certificate.energy_initial.unwrap_or_default());
    }
    assert!(rises >= 6, "only {rises} flights gained energy");
}

#[test]
fn a_certificate_in_wind_ends_at_its_time() {
    let certificate = |more: &str| {
        let scenario = five(&format!("[vehicle]\ndrag_per_s = 0.4\n{more}\n[time]\nduration_s = 30.0"));
        scenario.certificate(scenario.law().expect("a law").as_ref())
    };
    let (rest, mean) = ("[reference]\nkind = \"rest\"\n", "[wind]\nmean_m_s = [2.0, 0.0]\n");
    let still = certificate("");
    let carried = certificate(mean);
    assert_eq!(
        (carried.certified_m, carried.certified_until_s),
        (still.certified_m, None),
        "the push is common to all vehicles"
    );
    let held = certificate(&format!("{rest}{mean}"));
    assert_eq!(held.certified_until_s, Some(30.0));
    assert!(held.certified_m < certificate(rest).certified_m);
    let passing =
        certificate(&format!("{rest}[wind]\ngust = [{{ at_s = 3.0, rise_s = 1.0, velocity_m_s = [2.0, 0.0] }}]\n"));
    assert!(passing.certified_until_s.is_none() && passing.certified_m < certificate(rest).certified_m);

    let turbulent = |shared: bool| format!("dryden = {{ speed_20ft_m_s = 5.0, height_m = 10.0 }}\nshared = {shared}\n");
    let shared = certificate(&format!("{mean}{}", turbulent(true)));
    assert_eq!((shared.certified_m, &shared.void[..]), (still.certified_m, &[][..]));
    assert_eq!(certificate(&format!("{mean}{}", turbulent(false))).void, [VoidReason::WindUnbounded]);
    assert_eq!(certificate(&format!("{rest}{mean}{}", turbulent(true))).void, [VoidReason::WindUnbounded]);
    let mut led = five("[vehicle]\ndrag_per_s = 0.4\n[wind]\nmean_m_s = [2.0, 0.0]\n[time]\nduration_s = 30.0");
    led.law = tautline_laws::law::LawSpec::Potential(tautline_laws::law::PotentialKeys::default());
    assert!(led.certificate(led.law().expect("a law").as_ref()).void.contains(&VoidReason::WindNotCovered));
}

#[test]
fn a_leader_blown_off_its_reference_voids_the_certificate() {
    let scenario = builtin("pentagon-leader", &["vehicle.drag_per_s=0.3", "wind.mean_m_s=[1.0, 0.0]"]);
    assert!(scenario.certificate(scenario.law().expect("a law").as_ref()).void.contains(&VoidReason::LeaderInWind));
}

#[test]
fn a_scenario_with_wind_is_written_and_read_back_bit_for_bit() {
    let scenario = builtin("gusts", &[]);
    let again = read(&scenario.resolved().toml);
    assert_eq!(again, scenario);
    assert_eq!(again.wind.gusts[0].fall_s(), 1.5, "the fall time defaults to the rise time");
    let own = read(&builtin("gusts", &["wind.shared=false"]).resolved().toml);
    assert!(!own.wind.shared);
}

#[test]
fn the_show_in_gusts_is_clear_reached_and_certified_to_its_end() {
    let scenario = builtin("gusts", &["time.record_hz=5"]);
    let (flight, log) = fly(&scenario);
    let certificate = &flight.certificate;
    let closest_m = flight.audit.closest.expect("a closest approach").separation_m;
    assert!(closest_m > certificate.certified_m.expect("a promise") && certificate.certified_until_s.is_none());
    let moved_m = (row(&flight.last.positions_m, 0) - row(&scenario.start.positions_m, 0)).norm();
    assert!(moved_m > 100.0, "carried away: {moved_m}");
    let formation: &Formation = scenario.formation();
    let error_m = tautline_laws::formation::largest_edge_error_m(&flight.last.positions_m, formation, &scenario.graph);
    assert!(error_m < scenario.arrival.edge_error_m, "{error_m} after {} samples", log.samples.len());
}

#[test]
fn a_wrong_wind_is_refused_at_its_place_with_a_remedy() {
    let wrong = |sets: &[&str]| {
        let sets = [&["vehicle.drag_per_s=0.3", "time.duration_s=10"], sets].concat();
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
        let error = Scenario::read(&Source::Builtin("pentagon".to_owned()), &overrides).expect_err(sets[2]);
        assert!(!error.help.is_empty() && (error.place.is_some() || !error.keys.is_empty()), "{error}");
        error
    };
    let gust = |keys: &str| format!("wind.gust=[{{at_s = 1.0, rise_s = 1.0, velocity_m_s = [1.0, 0.0], {keys}}}]");
    let gust_of = |at_s: f64, rise_s: f64| {
        format!("wind.gust=[{{at_s = {at_s:?}, rise_s = {rise_s:?}, velocity_m_s = [1.0, 0.0]}}]")
    };
    for (set, code) in [
        ("vehicle.drag_per_s=-0.1", "scenario/out-of-range"),
        ("vehicle.drag_per_s=1e3", "scenario/step-too-long"),
        ("wind.mean_m_s=[1.0, nan]", "scenario/out-of-range"),
        ("wind.mean_m_s=[1.0, 0.0, 2.0]", "scenario/plane"),
        ("wind.dryden={speed_20ft_m_s = 5.0, height_m = 1.0}", "scenario/out-of-range"),
        ("wind.dryden={speed_20ft_m_s = -5.0, height_m = 10.0}", "scenario/out-of-range"),
        ("wind.dryden={speed_20ft_m_s = 5.0}", "scenario/missing-key"),
        ("wind.gusts=[]", "scenario/unknown-key"),
        ("wind.gust=3", "scenario/wrong-type"),
        (&gust("hold = 1.0"), "scenario/unknown-key"),
        (&gust("hold_s = -1.0"), "scenario/out-of-range"),
        (&gust("fall_s = 0.0"), "scenario/out-of-range"),
        (&gust("vehicles = [6]"), "scenario/unknown-vehicle"),
        (&gust("vehicles = []"), "scenario/inconsistent"),
        (&gust_of(20.0, 1.0), "scenario/outside-flight"),
        (&gust_of(1.0, 0.01), "scenario/step-too-long"),
    ] {
        let error = wrong(&[set]);
        assert_eq!(error.code(), code, "{error}");
    }
    assert!(wrong(&[&gust("vehicles = [2, 6]")]).to_string().contains("a gust acts on vehicle 6, but the swarm has 5"));
    let unfelt = wrong(&["vehicle.drag_per_s=0", "wind.mean_m_s=[1.0, 0.0]"]);
    assert_eq!(unfelt.code(), "scenario/unsupported-by-vehicle", "{unfelt}");
    let rigid = wrong(&["vehicle.model=crazyflie", "swarm.a22_per_s=0"]);
    assert_eq!(rigid.code(), "scenario/unsupported-by-vehicle", "{rigid}");
}
