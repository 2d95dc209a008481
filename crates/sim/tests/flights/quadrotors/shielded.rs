//! Quadrotors under a shield: the measured tracking error of their models, its conditions, and a built-in flight.
//!
//! `TAUTLINE_LONG=1` repeats the measurements of the built-in models.

use tautline_audit::Status;
use tautline_core::fact::{FactKind, FactValue, Source};
use tautline_laws::formation::largest_edge_error_m;
use tautline_shield::report::Exceeded;
use tautline_sim::preflight::{Code, Preflight};
use tautline_sim::scenario::{self, Override, Scenario, ScenarioError};
use tautline_sim::sim::Flight;
use tautline_sim::vehicle::{self, Airframe, MODELS, Model, TrackingSearch};

use super::model;
use crate::flight::{builtin, fly};

const SHIELDED: &str = "shielded-crazyflies";

fn refused(sets: &[&str]) -> ScenarioError {
    let sets: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("a key")).collect();
    Scenario::read(&scenario::Source::Builtin(SHIELDED.to_owned()), &sets).expect_err("refused")
}

fn tube_share(flight: &Flight) -> f64 {
    flight.shield.as_ref().expect("a shield").counters.tracking_share.expect("observed")
}

#[test]
fn crazyflies_change_places_below_a_shield_and_collide_without_it() {
    let scenario = builtin(SHIELDED, &[]);
    let tracking = model("crazyflie").tracking.expect("a measured table");
    assert!(scenario.fastest_wind_m_s() > 0.0 && scenario.network.loss > 0.0);
    let (flight, _) = fly(&scenario);
    assert_eq!((flight.audit.status, flight.certificate.certified_m), (Status::Clear, Some(0.4)));
    let shield = flight.shield.as_ref().expect("a shield");
    assert_eq!((shield.breach, shield.tube_m >= tracking.error_m), (None, true));
    assert!(shield.counters.changed > 0 && shield.lost > 0);
    assert!((0.05..0.8).contains(&tube_share(&flight)), "{} of the tube", tube_share(&flight));
    let error_m = largest_edge_error_m(&flight.last.positions_m, scenario.formation(), &scenario.graph);
    assert!(error_m < scenario.arrival.edge_error_m, "{error_m} m");
    let bare = Scenario { shield: None, ..scenario };
    assert_eq!(fly(&bare).0.audit.status, Status::Violation);
}

#[test]
fn a_flight_beyond_its_tube_or_its_commands_says_so() {
    let exceeded = |sets: &[&str]| {
        let sets = [&["time.duration_s=10"], sets].concat();
        fly(&builtin(SHIELDED, &sets)).0.shield.expect("a shield").breach.map(|breach| breach.exceeded)
    };
    assert!(matches!(exceeded(&["shield.tracking_error_m=0.01"]), Some(Exceeded::Tube(share)) if share > 1.0));
    // Without room for the feedback, commands exceed what the vehicle is assumed to carry out.
    let no_room = ["shield.tracking_error_m=0.6", "shield.disturbance_m_s2=0", "shield.accel_m_s2=0.6"];
    assert!(matches!(exceeded(&no_room), Some(Exceeded::Command(share) | Exceeded::Tube(share)) if share > 1.0));
}

#[test]
fn conditions_of_a_measured_table_are_checked() {
    let tracking = model("crazyflie").tracking.expect("a measured table");
    let limits = builtin(SHIELDED, &[]).shield_limits().expect("limits").expect("a shield");
    let settings = limits.settings();
    assert_eq!(settings.tracking_error_m, Some(tracking.error_m));
    let keys = [settings.accel_m_s2, settings.tracker_per_s2, settings.tracker_per_s, settings.max_speed_m_s];
    let table = [tracking.accel_m_s2, tracking.tracker_per_s2, tracking.tracker_per_s, tracking.max_speed_m_s];
    assert_eq!(keys, table);
    for (set, says) in [
        ("wind.mean_m_s=[3,0]", "the fastest wind in m/s must be at most"),
        ("shield.max_speed_m_s=2", "shield.max_speed_m_s must be at most"),
        ("shield.tracker_per_s=3", "shield.tracker_per_s must be"),
        ("shield.disturbance_m_s2=0.5", "shield.disturbance_m_s2 must be at least"),
        ("time.control_hz=50", "time.control_hz must be 100"),
        ("vehicle.downwash=true", "vehicle.downwash must be false"),
        ("vehicle.attitude_hz=250", "vehicle.attitude_hz must be 500, got 250"),
        // Another frequency or damping drops the table.
        ("vehicle.attitude_rad_s=5", "vehicle.attitude_rad_s must be"),
        ("vehicle.attitude_damping=0.8", "vehicle.attitude_damping must be"),
    ] {
        let error = refused(&[set]);
        let help = &error.help;
        assert!(error.to_string().contains(says) && help.contains("--identify"), "{set}: {error}");
    }
    let error = refused(&["shield.accel_m_s2=9"]);
    assert!(error.to_string().contains("which thrust and lift allow (9)"), "{error}");
    // An own assumption needs no table.
    assert!(builtin(SHIELDED, &["wind.mean_m_s=[1,0]", "shield.tracking_error_m=0.5"]).shield.is_some());
    let again = Scenario::read(
        &scenario::Source::Text { name: "again".to_owned(), text: builtin(SHIELDED, &[]).resolved().toml },
        &[],
    );
    assert_eq!(again.expect("the same").shield_limits().expect("limits").expect("a shield").tube(), limits.tube());
}

/// Returns the headline of the check, and source and value of the fact on the tracking error.
fn checked(scenario: &Scenario) -> (String, Source, Option<FactValue>) {
    let found = Preflight::of(scenario).expect("a law");
    let shield = found.shield.as_ref().expect("a shield");
    let fact = shield.facts.iter().find(|fact| fact.kind == FactKind::TrackingError).expect("a fact");
    let is_certified = shield.certificate.starts_with("certified");
    assert_eq!(is_certified, found.headline().contains("certified"), "{} {}", found.headline(), shield.certificate);
    (found.headline(), fact.source, fact.value.clone())
}

#[test]
fn a_separation_is_certified_with_a_searched_tracking_error_and_assumed_with_any_other() {
    for (name, _) in MODELS {
        let sets = [format!("vehicle.model={name}"), "law.delta_m=0.6".to_owned()];
        let scenario = builtin(SHIELDED, &sets.each_ref().map(String::as_str));
        let (headline, source, value) = checked(&scenario);
        assert!(headline.contains("READY: certified never closer than 0.600 m by the shield within"), "{headline}");
        assert!(headline.contains("measured by a search of"), "{headline}");
        let Some(FactValue::Number(error_m, "m")) = value else { panic!("{value:?}") };
        assert_eq!(source, Source::Observed);
        assert!(error_m >= model(name).tracking.expect("a table").error_m, "{error_m}");
    }
    // The table of a model whose keys changed after the measurement is an assumption. So is one without a search, or
    // with a search in other dimensions.
    let changed = |change: &dyn Fn(&mut Model)| {
        let mut scenario = builtin(SHIELDED, &[]);
        let mut quadrotor = scenario.airframe.quadrotor().expect("a quadrotor").clone();
        change(&mut quadrotor.model);
        scenario.set_airframe(Airframe::Quadrotor(Box::new(quadrotor)));
        checked(&scenario)
    };
    let heavier = |model: &mut Model| model.mass_kg *= 1.02;
    let unsearched = |model: &mut Model| model.tracking.as_mut().expect("a table").search = None;
    let in_space = |model: &mut Model| {
        let search = model.tracking.as_mut().and_then(|tracking| tracking.search.as_mut());
        search.expect("a search").dimensions = vec![3];
    };
    // So is a table with an edited number, and one with less than a full search or its margin.
    let windier = |model: &mut Model| model.tracking.as_mut().expect("a table").wind_m_s = 9.0;
    let search = |model: &mut Model, change: &dyn Fn(&mut TrackingSearch)| {
        change(model.tracking.as_mut().and_then(|tracking| tracking.search.as_mut()).expect("a search"));
    };
    let signed = |model: &mut Model, change: &dyn Fn(&mut TrackingSearch)| {
        search(model, change);
        let fingerprint = model.fingerprint();
        search(model, &|found| found.model.clone_from(&fingerprint));
        assert!(model.tracking_search().is_some());
    };
    let few = |model: &mut Model| signed(model, &|search| search.flights = 12);
    let tight = |model: &mut Model| signed(model, &|search| search.margin = 1.1);
    for change in [&heavier as &dyn Fn(&mut Model), &unsearched, &in_space, &windier, &few, &tight] {
        let (headline, source, _) = changed(change);
        assert_eq!(source, Source::Declared, "{headline}");
        assert!(
            headline.contains("READY: never closer than 0.400 m by the shield if the assumed tracking"),
            "{headline}"
        );
        let (_, error_m) = headline.split_once("tracking error of ").expect("an error");
        assert!(error_m.split(' ').next().is_some_and(|error_m| error_m.len() == 5), "{headline}");
    }
    let more = |model: &mut Model| signed(model, &|search| search.flights = 5000);
    assert_eq!(changed(&more).1, Source::Observed);
    assert_eq!(changed(&|model: &mut Model| "renamed".clone_into(&mut model.name)).1, Source::Observed);
    let (headline, source, _) = checked(&builtin(SHIELDED, &["shield.tracking_error_m=0.36"]));
    assert!(source == Source::Declared && headline.contains("if the assumed tracking error"), "{headline}");
    // Searches do not cover the ideal plant.
    let (headline, source, _) = checked(&builtin(SHIELDED, &["plant.kind=ideal"]));
    assert!(source == Source::Declared && headline.contains("if the assumed tracking error"), "{headline}");
    // A slower reference may accelerate more than the search did; with smaller commands it does not.
    let slower = checked(&builtin(SHIELDED, &["shield.max_speed_m_s=0.3"]));
    assert_eq!(slower.1, Source::Declared, "{}", slower.0);
    let weaker = checked(&builtin(SHIELDED, &["shield.max_speed_m_s=0.3", "shield.accel_m_s2=2.3"]));
    assert_eq!(weaker.1, Source::Observed, "{}", weaker.0);
    // The bound of points is computed.
    let sets =
        ["vehicle.model=point", "vehicle.drag_per_s=0.1", "shield.disturbance_m_s2=0.1", "swarm.hull_radius_m=0.1"];
    let points = checked(&builtin(SHIELDED, &sets));
    assert!(points.1 == Source::Proved && points.0.contains("certified never closer than 0.400 m by the shield"));
}

#[test]
fn the_report_of_a_flight_has_the_basis_of_the_tracking_error() {
    for (set, certified, source) in
        [("law.delta_m=0.4", true, Source::Observed), ("shield.tracking_error_m=0.36", false, Source::Declared)]
    {
        let shield = fly(&builtin(SHIELDED, &["time.duration_s=1", set])).0.shield.expect("a shield");
        assert_eq!(shield.certificate.starts_with("certified "), certified, "{}", shield.certificate);
        assert_eq!((shield.facts[0].kind, shield.facts[0].source), (FactKind::TrackingError, source));
    }
}

#[test]
fn a_table_that_its_search_contradicts_is_refused() {
    let (_, text) = MODELS[0];
    let error_m = model("crazyflie").tracking.expect("a table").error_m;
    for (key, value, says) in [
        ("error_m", "0.2", "not at least 1.25 times the largest error"),
        ("flights", "0", "`flights` must be at least 1, got 0"),
        ("margin", "0.9", "`margin` must be at least 1, got 0.9"),
        ("largest_error_m", "nan", "`largest_error_m` must be a finite number, got nan"),
    ] {
        let lines = text.lines().map(|line| match line.split_once(" = ") {
            Some((name, _)) if name == key => format!("{key} = {value}"),
            _ => line.to_owned(),
        });
        let error = vehicle::read("model.toml", &lines.collect::<Vec<_>>().join("\n")).expect_err(key);
        assert!(error.message.contains(says), "{key} of {error_m}: {}", error.message);
    }
}

/// Each table covers the measured error times the stated factor, and is not far above it.
#[test]
fn tables_of_built_in_models_repeat_their_measurement() {
    if std::env::var_os("TAUTLINE_LONG").is_none() {
        return;
    }
    for name in ["crazyflie", "crazyflie-brushless", "hummingbird"] {
        let tracking = model(name).tracking.expect("a measured table");
        let conditions = [
            format!("vehicle.model={name}"),
            format!("wind={{mean_m_s=[{},0,0]}}", tracking.wind_m_s),
            "law.delta_m=0.6".to_owned(),
        ];
        for more in [&["swarm.dimensions=2"][..], &["start={shape=\"circle\",radius_m=2.5,jitter_m=0.05}"]] {
            let sets: Vec<_> = conditions.iter().map(String::as_str).chain(more.iter().copied()).collect();
            let found = builtin(SHIELDED, &sets).identify().expect("a measurement");
            assert!(found.largest_error_m * found.factor <= tracking.error_m + 1e-3, "{name}: {found}");
            assert!(found.largest_command_m_s2 <= tracking.accel_m_s2 && found.thrust_share < 1.0, "{name}: {found}");
        }
    }
}

/// With the paper's gains the lag of Crazyflies feeds an oscillation of the one-sided pushes, a limit cycle of
/// centimetres. More damping ends it; the check predicts both.
#[test]
fn five_crazyflies_settle_under_the_displacement_law_with_enough_damping() {
    let sets = ["law.kind=displacement", "time.duration_s=14", "law.zeta_per_s=2"];
    let error_m = |scenario: &Scenario| {
        largest_edge_error_m(&fly(scenario).0.last.positions_m, scenario.formation(), &scenario.graph)
    };
    let warned = |scenario: &Scenario| {
        let found = Preflight::of(scenario).expect("a law");
        found.warnings.into_iter().find(|warning| warning.code == Code::BeyondMargin)
    };
    let damped = builtin("crazyflies", &sets);
    assert!(error_m(&damped) < 0.01, "{} m", error_m(&damped));
    assert_eq!(warned(&damped), None);
    let cycling = builtin("crazyflies", &sets[..2]);
    assert!(error_m(&cycling) > 0.01, "{} m", error_m(&cycling));
    let warning = warned(&cycling).expect("a warning");
    assert!(warning.message.contains("Raise law.zeta_per_s to 1.9"), "{}", warning.message);
}
