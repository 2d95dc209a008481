//! Worlds that advance together have the bits of single simulations.

use tautline_core::swarm::Rows;
use tautline_sim::scenario::{Draw, Override, Source, Template};
use tautline_sim::sim::{Ending, GivenStarts, SeedChoice, Simulation, States, Threads, VectorError, VectorSimulation};

/// Steps of a call: enough for two helping threads.
const STEPS_OF_A_CALL: u64 = 80;

fn template(name: &str, sets: &[&str]) -> Template {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    Template::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario")
}

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")
}

/// Accelerations of E x N x 3 that differ between worlds and steps.
fn commands(worlds: usize, vehicles: usize, step: usize) -> Vec<f64> {
    (0..3 * worlds * vehicles).map(|k| 2.0 * libm::sin(0.7 * k as f64 + 0.9 * step as f64)).collect()
}

/// Asserts that worlds have the bits of single simulations with the same seeds and commands, for any thread count.
fn assert_bits(template: &Template, steps: usize, given: bool) {
    let (seeds, vehicles) = ([3, 14, 15, 92, 65], template.own().count());
    let law = template.own_law();
    let singles: Vec<_> = seeds
        .iter()
        .enumerate()
        .map(|(k, &seed)| {
            let scenario = template.scenario(&law, Draw { seed, jitter_m: None }).expect("a start");
            let mut single = Simulation::new(&scenario).expect("a simulation");
            for step in 0..steps {
                let all = commands(seeds.len(), vehicles, step);
                let own = Rows::from_row_slice(&all[3 * k * vehicles..3 * (k + 1) * vehicles]);
                for _ in 0..STEPS_OF_A_CALL {
                    if given {
                        single.step_with(&own).expect("finite commands");
                    } else {
                        single.step();
                    }
                }
            }
            single
        })
        .collect();
    for threads in [1, 2, 3] {
        let mut worlds = VectorSimulation::new(template.clone(), &seeds, Threads::Current).expect("worlds");
        let mut states = States::of(&worlds);
        pool(threads).install(|| {
            for step in 0..steps {
                let commands = commands(seeds.len(), vehicles, step);
                worlds.step(given.then_some(&commands[..]), STEPS_OF_A_CALL, &mut states.borrow()).expect("flown");
            }
        });
        for (k, single) in singles.iter().enumerate() {
            assert_eq!(worlds.world(k).state(), single.state(), "world {k}, {threads} threads");
            assert_eq!(worlds.world(k).ending(), single.ending());
            assert_eq!(Some(states.least_clearance_m[k]), single.least_clearance_m());
            let rows = |numbers: &[f64]| Rows::from_row_slice(&numbers[3 * k * vehicles..3 * (k + 1) * vehicles]);
            assert_eq!(&rows(&states.positions_m), &single.state().positions_m);
            assert_eq!(&rows(&states.velocities_m_s), &single.state().velocities_m_s);
        }
        assert_ne!(worlds.world(0).state(), worlds.world(1).state(), "seeds give different worlds");
    }
}

#[test]
fn worlds_of_points_have_the_bits_of_single_simulations() {
    assert_bits(&template("pentagon", &["start.jitter_m=0.1"]), 8, true);
    assert_bits(&template("pentagon", &["start.jitter_m=0.1"]), 4, false);
}

#[test]
fn worlds_of_quadrotors_and_of_noise_have_the_bits_of_single_simulations() {
    assert_bits(&template("crazyflies", &["start.jitter_m=0.02"]), 4, true);
    assert_bits(&template("pentagon-laplacian", &["sensing={position_noise_m=0.05, rate_hz=100}"]), 4, false);
}

#[test]
fn an_ended_world_stops_no_other_and_resets_to_its_next_seed() {
    let template = template("pentagon", &["start.jitter_m=0.1", "time.duration_s=0.5", "arrival.hold_s=0"]);
    let mut worlds = VectorSimulation::new(template.clone(), &[7, 8, 9], Threads::Current).expect("worlds");
    let mut states = States::of(&worlds);
    worlds.step(None, 100, &mut states.borrow()).expect("flown");
    worlds
        .reset(
            &[false, true, false],
            Some(&[SeedChoice::Exactly(0), SeedChoice::Exactly(40), SeedChoice::Next]),
            &mut states.borrow(),
        )
        .expect("reset");
    assert_eq!(worlds.seeds().collect::<Vec<_>>(), [7, 40, 9]);
    worlds.step(None, 100, &mut states.borrow()).expect("flown");
    assert_eq!(states.is_over, [true, false, true]);
    assert_eq!(worlds.world(0).ending(), Some(&Ending::Completed));
    assert_eq!((worlds.world(1).steps(), worlds.world(2).steps()), (100, 120));

    let before = worlds.world(0).state().clone();
    worlds.step(None, 5, &mut states.borrow()).expect("flown");
    assert_eq!(worlds.world(0).state(), &before, "an ended world keeps its state");
    worlds.set_autoreset(true);
    worlds.step(None, 5, &mut states.borrow()).expect("flown");
    assert_eq!(worlds.seeds().collect::<Vec<_>>(), [10, 40, 12]);
    assert_eq!((worlds.world(0).steps(), worlds.world(1).steps()), (0, 110));
    let drawn = template.scenario(&template.own_law(), Draw { seed: 10, jitter_m: None }).expect("a start");
    assert_eq!(worlds.world(0).state(), Simulation::new(&drawn).expect("a simulation").state());
    assert!(!states.is_over[0]);
}

#[test]
fn a_law_that_fails_ends_its_world_alone() {
    // Under noise, the law of one world measures a collision.
    let template = template("pentagon", &["sensing={position_noise_m=0.35, rate_hz=100}", "time.duration_s=2"]);
    let seeds: Vec<_> = (0..12).collect();
    let mut worlds = VectorSimulation::new(template, &seeds, Threads::Current).expect("worlds");
    let mut states = States::of(&worlds);
    worlds.step(None, 480, &mut states.borrow()).expect("flown");
    let failed = |k: &usize| matches!(worlds.world(*k).ending(), Some(Ending::LawUndefined(_)));
    let failed = (0..12).filter(failed).count();
    let completed = (0..12).filter(|&k| worlds.world(k).ending() == Some(&Ending::Completed)).count();
    assert!(failed > 0 && completed > 0, "{failed} failed, {completed} completed");
}

#[test]
fn wrong_input_is_refused_before_anything_is_flown() {
    let mut worlds = VectorSimulation::new(template("pentagon", &[]), &[0, 1], Threads::Current).expect("worlds");
    let mut states = States::of(&worlds);
    let mut wrong = vec![0.0; 30];
    for value in [f64::NAN, f64::INFINITY, -1e31] {
        wrong[15 + 7] = value;
        let refused = worlds.step(Some(&wrong), 1, &mut states.borrow()).expect_err("not finite");
        assert!(refused.to_string().starts_with("u[1, 2, 1]: must be a finite number"), "{refused}");
    }
    let refused = worlds.step(Some(&wrong[..29]), 1, &mut states.borrow()).expect_err("too short");
    assert!(matches!(refused, VectorError::Length { what: "u", expected: 30, found: 29 }));
    states.is_over.pop();
    assert!(worlds.step(None, 1, &mut states.borrow()).is_err());
    assert_eq!(worlds.world(0).steps() + worlds.world(1).steps(), 0);
    assert!(matches!(
        VectorSimulation::new(template("pentagon", &[]), &[], Threads::Current),
        Err(VectorError::NoWorlds)
    ));

    let (pentagon, many) = (template("pentagon", &[]), vec![0; 200_000]);
    let most = VectorSimulation::most_worlds(pentagon.own());
    assert!((50_000..200_000).contains(&most));
    let refused = VectorSimulation::new(pentagon, &many, Threads::Current).err().expect("too many");
    assert_eq!(
        refused.to_string(),
        format!("seeds: at most {most} worlds of this scenario fit into 8 GiB, got 200000")
    );
}

#[test]
fn a_seed_without_a_valid_start_is_named_and_resets_nothing() {
    // A jitter of 0.9 m puts some starts within delta = 2 m.
    let template = template("pentagon", &["start.jitter_m=0.9"]);
    let law = template.own_law();
    let is_valid = |&seed: &u64| template.scenario(&law, Draw { seed, jitter_m: None }).is_ok();
    let (good, bad): (Vec<u64>, Vec<u64>) = (0..40).partition(is_valid);
    let refused =
        VectorSimulation::new(template.clone(), &[good[0], bad[0]], Threads::Current).err().expect("an invalid start");
    assert!(refused.to_string().starts_with(&format!("seeds[1]: seed {} gives no valid", bad[0])), "{refused}");
    let mut worlds = VectorSimulation::new(template, &good[..2], Threads::Current).expect("worlds");
    let mut states = States::of(&worlds);
    worlds.step(None, 3, &mut states.borrow()).expect("flown");
    let seeds = [good[2], bad[0]].map(SeedChoice::Exactly);
    worlds.reset(&[true, true], Some(&seeds), &mut states.borrow()).expect_err("an invalid start");
    assert_eq!((worlds.world(0).steps(), worlds.world(1).steps()), (3, 3));
}

#[test]
fn a_search_takes_the_first_seed_with_a_valid_start() {
    let template = template("pentagon", &["start.jitter_m=0.9", "time.duration_s=1"]);
    let law = template.own_law();
    let is_valid = |seed: u64| template.scenario(&law, Draw { seed, jitter_m: None }).is_ok();
    let first = |seed: u64, by: usize| (seed..).step_by(by).find(|&seed| is_valid(seed)).expect("a seed");
    // The two seeds after `good` are invalid.
    let good = (0..1000_u64).find(|&seed| is_valid(seed) && !is_valid(seed + 2) && is_valid(seed + 1)).expect("a seed");
    let mut worlds = VectorSimulation::new(template.clone(), &[good, good + 1], Threads::Current).expect("worlds");
    let mut states = States::of(&worlds);
    worlds.set_autoreset(true);
    // The call returns when all worlds have ended.
    worlds.step(None, u64::MAX, &mut states.borrow()).expect("flown");
    assert_eq!(states.is_over, [true, true]);
    worlds.step(None, u64::MAX, &mut states.borrow()).expect("reset");
    assert_eq!(worlds.seeds().collect::<Vec<_>>(), [first(good + 2, 2), first(good + 3, 2)]);
    assert_eq!((worlds.world(0).steps(), worlds.world(1).steps()), (0, 0));
    let seeds = [SeedChoice::From(good + 2), SeedChoice::From(good)];
    worlds.reset(&[true, true], Some(&seeds), &mut states.borrow()).expect("reset");
    assert_eq!(worlds.seeds().collect::<Vec<_>>(), [first(good + 2, 1), good]);
}

#[test]
fn a_world_without_a_valid_start_costs_the_others_no_step() {
    // Hardly any seed gives a valid start.
    let sets = ["start.jitter_m=0.5", "law.delta_m=1.55", "start.seed=347", "time.duration_s=1"];
    let (template, seeds) = (template("swap", &sets), [347, 347]);
    let mut worlds = VectorSimulation::new(template, &seeds, Threads::Current).expect("worlds");
    let mut states = States::of(&worlds);
    worlds.step(None, 200, &mut states.borrow()).expect("flown");
    worlds.reset(&[false, true], Some(&[SeedChoice::Exactly(seeds[1]); 2]), &mut states.borrow()).expect("reset");
    worlds.set_autoreset(true);
    worlds.step(None, 100, &mut states.borrow()).expect("flown");
    let refused = worlds.step(None, 30, &mut states.borrow()).expect_err("no valid start");
    assert!(matches!(refused, VectorError::NoSeed { world: 0, .. }), "{refused}");
    assert_eq!((states.is_over[0], worlds.world(1).steps()), (true, 130));
}

#[test]
fn an_interrupted_search_makes_and_resets_no_world() {
    // Some seeds have no valid start, so that a search may go on for long.
    let template = template("pentagon", &["start.jitter_m=0.1"]);
    let seeds: Vec<_> = (0..40).map(SeedChoice::From).collect();
    let make = |carries_on: &mut dyn FnMut() -> bool| {
        VectorSimulation::with_seeds_while(template.clone(), &seeds, Threads::One, carries_on)
    };
    assert!(matches!(make(&mut || false), Err(VectorError::Interrupted)));
    let mut worlds = make(&mut || true).expect("worlds");
    let mut states = States::of(&worlds);
    let all = vec![true; worlds.count()];
    let refused = worlds.reset_while(&all, None, None, &mut states.borrow(), &mut || false);
    assert!(matches!(refused, Err(VectorError::Interrupted)));
    assert_eq!(worlds.seeds().collect::<Vec<_>>(), (0..40).collect::<Vec<_>>());
    worlds.reset_while(&all, None, None, &mut states.borrow(), &mut || true).expect("reset");
    assert_eq!(worlds.seeds().collect::<Vec<_>>(), (40..80).collect::<Vec<_>>());
}

/// Returns the accelerations that push each vehicle of the worlds through the centre.
fn to_the_centre(states: &States) -> Vec<f64> {
    states.positions_m.iter().zip(&states.velocities_m_s).map(|(p_m, v_m_s)| -p_m - 0.5 * v_m_s).collect()
}

#[test]
fn a_shield_filters_commands_from_outside() {
    for (sets, is_safe) in
        [(&["time.duration_s=20"][..], true), (&["time.duration_s=20", "shield.enabled=false"], false)]
    {
        let template = template("shielded-crazyflies", sets);
        let mut worlds = VectorSimulation::new(template, &[5, 6], Threads::Current).expect("worlds");
        let mut states = States::of(&worlds);
        worlds.write(&mut states.borrow()).expect("states");
        let mut least_m = f64::INFINITY;
        while states.is_over.contains(&false) {
            let commands = to_the_centre(&states);
            worlds.step(Some(&commands), 12, &mut states.borrow()).expect("flown");
            least_m = states.least_clearance_m.iter().copied().fold(least_m, f64::min);
        }
        assert_eq!(least_m > 0.0, is_safe, "{sets:?}: {least_m}");
        let flight = worlds.world(0).clone().finish();
        let shield = flight.shield;
        assert_eq!(shield.is_some(), is_safe);
        if let Some(shield) = shield {
            assert!(shield.counters.changed > 0 && shield.breach.is_none(), "{shield:?}");
            assert!(flight.certificate.certified_m.is_some() && flight.certificate.void.is_empty());
        }
    }
}

#[test]
fn given_states_are_starts() {
    for sets in [&[][..], &["start.jitter_m=0.1"]] {
        let mut worlds = VectorSimulation::new(template("pentagon", sets), &[1, 2], Threads::Current).expect("worlds");
        let mut states = States::of(&worlds);
        worlds.write(&mut states.borrow()).expect("states");
        let drawn = states.clone();
        let mut positions_m = vec![0.0; 30];
        (0..10).for_each(|k| positions_m[3 * k] = 3.0 * k as f64);
        let velocities_m_s: Vec<_> = (0..30).map(|k| if k % 3 == 2 { 0.0 } else { 0.01 * f64::from(k) }).collect();
        let mut reset = |positions_m: &[f64], states: &mut States| {
            let given = GivenStarts { positions_m, velocities_m_s: &velocities_m_s };
            worlds.reset_while(&[false, true], None, Some(given), &mut states.borrow(), &mut || true)
        };
        reset(&positions_m, &mut states).expect("a start");
        assert_eq!(
            (&states.positions_m[..15], &states.positions_m[15..]),
            (&drawn.positions_m[..15], &positions_m[15..])
        );
        assert_eq!(states.velocities_m_s[15..], velocities_m_s[15..]);
        positions_m[15] = positions_m[18];
        let before = states.clone();
        let refused = reset(&positions_m, &mut states).expect_err("two vehicles in one place");
        assert!(matches!(refused, VectorError::Start { world: 1, .. }), "{refused}");
        positions_m[15] = f64::NAN;
        assert!(reset(&positions_m, &mut states).is_err());
        assert!(matches!(
            reset(&positions_m[..29], &mut states),
            Err(VectorError::Length { expected: 30, found: 29, .. })
        ));
        assert_eq!(states, before, "a refused reset changes nothing");
    }
}

#[test]
fn slots_follow_the_reference_and_measurements_have_noise() {
    let noise = "sensing={position_noise_m=0.1, rate_hz=100}";
    let sets = [noise, "start.jitter_m=0.1", "reference={kind=\"velocity\", velocity_m_s=[1, 0]}"];
    let mut worlds = VectorSimulation::new(template("swap", &sets), &[1, 2], Threads::One).expect("worlds");
    let mut states = States::of(&worlds);
    let numbers = states.positions_m.len();
    let [mut first, mut later, mut measured_m, mut measured_m_s] = [(); 4].map(|()| vec![0.0; numbers]);
    worlds.write_slots(&mut first).expect("slots");
    worlds.step(Some(&vec![0.0; numbers]), 240, &mut states.borrow()).expect("flown");
    worlds.write_slots(&mut later).expect("slots");
    let moved: Vec<_> = later.iter().zip(&first).map(|(later, first)| later - first).collect();
    // The reference moves at 1 m/s for 1 s.
    assert!(moved.chunks(3).all(|by| (nalgebra::Vector3::from_row_slice(by) - nalgebra::Vector3::x()).norm() < 1e-9));
    worlds.write_measured(&mut measured_m, &mut measured_m_s).expect("measured");
    let in_plane = measured_m.iter().zip(&states.positions_m).enumerate().filter(|(k, _)| k % 3 != 2);
    let off_m = in_plane.map(|(_, (found, truth))| (found - truth).abs());
    let (least, most) = off_m.fold((f64::INFINITY, 0.0_f64), |(least, most), off| (least.min(off), most.max(off)));
    assert!(least > 0.0 && most < 1.0, "{least} {most}");
    assert!(
        worlds.write_slots(&mut first[1..]).is_err() && worlds.write_measured(&mut first, &mut later[1..]).is_err()
    );
}
