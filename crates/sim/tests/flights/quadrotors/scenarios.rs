//! The table `[vehicle]`: its meaning, its round trip, and its errors.

use std::fs;

use tautline_sim::scenario::{Override, Scenario, ScenarioError, Source};
use tautline_sim::vehicle::MODELS;

use crate::flight::{builtin, read};

fn refused(sets: &[&str]) -> ScenarioError {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    let refused = Scenario::read(&Source::Builtin("crazyflies".to_owned()), &overrides);
    refused.expect_err("refused")
}

#[test]
fn wrong_vehicles_are_refused_at_their_place_with_a_remedy() {
    let rotor = |keys: &str| format!("failure=[{{vehicle=1, at_s=1, kind=\"rotor\", {keys}}}]");
    for (sets, code, remedy) in [
        (&["vehicle.model=\"crazyfly\""][..], "scenario/unknown-choice", "did you mean `crazyflie`?"),
        (&["vehicle.attitude_hz=1000"], "scenario/step-too-long", "time.dt_s to at most 0.001"),
        (&["vehicle.attitude_rad_s=31"], "scenario/inconsistent", "0.4/tau"),
        (&["vehicle.attitude_damping=0.15"], "scenario/inconsistent", "attitude_damping to 1"),
        (&["vehicle.attitude_hz=2", "vehicle.attitude_rad_s=8"], "scenario/inconsistent", ""),
        (&["vehicle.attitude_hz=0"], "scenario/out-of-range", ""),
        (&["vehicle.model=point", "vehicle.downwash=true"], "scenario/unsupported-by-vehicle", ""),
        (&["law.delta_m=0.15"], "scenario/hulls-touch", ""),
        (&[&*rotor("rotor=5")], "scenario/out-of-range", ""),
        (&[&*rotor("rotor=1, share=1.5")], "scenario/out-of-range", ""),
        (&["vehicle.model=3"], "scenario/wrong-type", ""),
        (&["vehicle.model={name=\"x\"}"], "scenario/missing-key", ""),
    ] {
        let error = refused(sets);
        assert_eq!(error.code(), code, "{sets:?}: {error}");
        assert!(error.help.contains(remedy), "{sets:?}: {error}");
        assert!(error.place.as_ref().is_some_and(|place| place.source == "set"), "{sets:?}: {error}");
    }
}

#[test]
fn a_custom_model_is_a_file_relative_to_the_scenario() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = format!("{}\n", builtin_text().replace("\"crazyflie\"", "\"mine.toml\""));
    let line = 1 + scenario.lines().position(|line| line.contains("mine.toml")).expect("a model");
    fs::write(folder.path().join("own.toml"), scenario).expect("written");
    let model = MODELS[0].1.replace("name = \"crazyflie\"", "name = \"mine\"").replace("0.0328", "0.03");
    let read = || Scenario::read(&Source::File(folder.path().join("own.toml")), &[]);
    fs::write(folder.path().join("mine.toml"), &model).expect("written");
    let own = read().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(own.mass_kg, [0.03; 5]);
    // The scenario contains the model and no longer needs the file.
    let again = Source::Text { name: "again".to_owned(), text: own.resolved().toml };
    fs::remove_file(folder.path().join("mine.toml")).expect("removed");
    assert_eq!(Scenario::read(&again, &[]).unwrap_or_else(|error| panic!("{error}")), own);
    let missing = read().expect_err("no file");
    assert_eq!(missing.code(), "scenario/file", "{missing}");
    assert!(missing.to_string().contains(&format!("own.toml:{line}:9")), "{missing}");
    fs::write(folder.path().join("mine.toml"), model.replace("mass_kg = 0.03", "mass_kg = -0.03")).expect("written");
    let wrong = read().expect_err("a negative mass");
    assert_eq!(wrong.code(), "scenario/file", "{wrong}");
    assert!(wrong.to_string().contains("mine.toml:3:11: mass_kg is -0.03"), "{wrong}");
}

fn builtin_text() -> &'static str {
    tautline_sim::scenario::builtin::find("crazyflies").expect("a built-in scenario").toml
}

#[test]
fn a_scenario_of_quadrotors_is_written_and_read_back_bit_for_bit() {
    for sets in
        [&[][..], &["vehicle.attitude_rad_s=5.5", "vehicle.downwash=true"], &["time.control_hz=250", "time.dt_s=0.001"]]
    {
        let scenario = builtin("crazyflies", sets);
        assert_eq!(read(&scenario.resolved().toml), Scenario { name: scenario.name.clone(), ..scenario });
    }
}

#[test]
fn rates_mass_hull_and_drag_depend_on_the_model() {
    let sets = ["swarm.mass_kg=7", "swarm.hull_radius_m=0.15", "swarm.a22_per_s=0.1"];
    let flown = builtin("crazyflies", &sets);
    assert_eq!((flown.mass_kg[0], flown.hull_radius_m[0], flown.a22_per_s), (0.0328, 0.07, 0.0));
    assert_eq!((flown.time.dt_s, flown.time.control_hz), (1.0 / 500.0, Some(100.0)));
    let points = builtin("crazyflies", &[&sets[..], &["vehicle.model=point"]].concat());
    assert_eq!((points.mass_kg[0], points.hull_radius_m[0], points.a22_per_s), (7.0, 0.15, 0.1));
    assert_eq!((points.time.dt_s, points.time.control_hz), (1.0 / 240.0, None));
    assert!(!points.resolved().toml.contains("[vehicle]"), "a scenario of points is written as ever");
}
