//! The table `[vehicle]`: what it means, how it is written back, and what it refuses.

use std::fs;

use tautline_sim::scenario::{Override, Scenario, Source};
use tautline_sim::vehicle::MODELS;

use crate::flight::{builtin, read};

fn refused(sets: &[&str]) -> String {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    let refused = Scenario::read(&Source::Builtin("crazyflies".to_owned()), &overrides);
    refused.expect_err("refused").to_string()
}

#[test]
fn what_cannot_be_flown_is_told_with_its_place_and_remedy() {
    for (sets, said) in [
        (
            &["vehicle.model=\"crazyfly\""][..],
            ["there is no model `crazyfly`", "did you mean `crazyflie`?", "--set:1:"],
        ),
        (
            &["vehicle.attitude_hz=1000"],
            [
                "an attitude loop of 1000 Hz runs more than once in a step of 0.002 s",
                "time.dt_s to at most 0.001",
                "--set:1:",
            ],
        ),
        (&["vehicle.attitude_rad_s=31"], ["2 zeta > omega tau is needed", "0.4/tau", "--set:1:"]),
        (&["vehicle.attitude_damping=0.15"], ["2 zeta > omega tau is needed", "attitude_damping to 1", "--set:1:"]),
        (
            &["vehicle.attitude_hz=2", "vehicle.attitude_rad_s=8"],
            ["2 zeta > omega tau is needed", "half of a period of the loop", "--set:1:"],
        ),
        (&["vehicle.attitude_hz=0"], ["the rate of the attitude loop is 0", "more than 0", "--set:1:"]),
        (
            &["vehicle.model=point", "vehicle.downwash=true"],
            ["a point has neither attitude nor rotors", "leave this key out", "--set:1:"],
        ),
        (&["law.delta_m=0.15"], ["the hulls of vehicles 1-2 touch at 0.14 m", "enlarge law.delta_m", "--set:1:"]),
        (&["failure=[{vehicle=1, at_s=1, kind=\"rotor\", rotor=5}]"], ["rotor 5", "rotors 1 to 4", "--set:1:"]),
        (
            &["failure=[{vehicle=1, at_s=1, kind=\"rotor\", rotor=1, share=1.5}]"],
            ["a share of 1.5", "from 0 to less than 1", "--set:1:"],
        ),
        (&["vehicle.model=3"], ["invalid type", "`tautline schema`", "--set:1:"]),
        (&["vehicle.model={name=\"x\"}"], ["missing key `mass_kg`", "`tautline schema`", "--set:1:"]),
    ] {
        let error = refused(sets);
        assert!(said.iter().all(|part| error.contains(part)), "{sets:?}: {error}");
    }
}

#[test]
fn a_model_of_ones_own_is_a_file_beside_the_scenario() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = format!("{}\n", builtin_text().replace("\"crazyflie\"", "\"mine.toml\""));
    fs::write(folder.path().join("own.toml"), scenario).expect("written");
    let model = MODELS[0].1.replace("name = \"crazyflie\"", "name = \"mine\"").replace("0.0328", "0.03");
    let read = || Scenario::read(&Source::File(folder.path().join("own.toml")), &[]);
    fs::write(folder.path().join("mine.toml"), &model).expect("written");
    let own = read().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(own.mass_kg, [0.03; 5]);
    // What was read is in the scenario, whatever becomes of the file.
    let again = Source::Text { name: "again".to_owned(), text: own.resolved_toml() };
    fs::remove_file(folder.path().join("mine.toml")).expect("removed");
    assert_eq!(Scenario::read(&again, &[]).unwrap_or_else(|error| panic!("{error}")), own);
    let missing = read().expect_err("no file").to_string();
    assert!(missing.contains("mine.toml") && missing.contains("own.toml:10:9"), "{missing}");
    fs::write(folder.path().join("mine.toml"), model.replace("mass_kg = 0.03", "mass_kg = -0.03")).expect("written");
    let wrong = read().expect_err("a negative mass").to_string();
    assert!(wrong.contains("mine.toml:3:11: mass_kg is -0.03") && wrong.contains("it must be from"), "{wrong}");
}

fn builtin_text() -> &'static str {
    include_str!("../../../../../assets/crazyflies.toml")
}

#[test]
fn a_scenario_of_quadrotors_is_written_back_bit_for_bit() {
    for sets in
        [&[][..], &["vehicle.attitude_rad_s=5.5", "vehicle.downwash=true"], &["time.control_hz=250", "time.dt_s=0.001"]]
    {
        let scenario = builtin("crazyflies", sets);
        assert_eq!(read(&scenario.resolved_toml()), Scenario { name: scenario.name.clone(), ..scenario });
    }
}

#[test]
fn rates_mass_hull_and_drag_are_those_of_the_kind_of_vehicle() {
    let sets = ["swarm.mass_kg=7", "swarm.hull_radius_m=0.15", "swarm.a22_per_s=0.1"];
    let flown = builtin("crazyflies", &sets);
    assert_eq!((flown.mass_kg[0], flown.hull_radius_m[0], flown.a22_per_s), (0.0328, 0.07, 0.0));
    assert_eq!((flown.time.dt_s, flown.time.control_hz), (1.0 / 500.0, Some(100.0)));
    let points = builtin("crazyflies", &[&sets[..], &["vehicle.model=point"]].concat());
    assert_eq!((points.mass_kg[0], points.hull_radius_m[0], points.a22_per_s), (7.0, 0.15, 0.1));
    assert_eq!((points.time.dt_s, points.time.control_hz), (1.0 / 240.0, None));
    assert!(!points.resolved_toml().contains("[vehicle]"), "a scenario of points is written as ever");
}
