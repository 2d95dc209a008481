//! The schema of the scenario file agrees with its reader.

use tautline_sim::scenario::{self, Override, Scenario, Source};

use super::scenario_files::RIGHT;

#[test]
fn the_schema_describes_every_key_and_refuses_null() {
    let schema = scenario::schema();
    let text = schema.to_string();
    for key in ["delta_m", "hull_radius_m", "max_halvings", "min_separation_m", "points_m", "disagreement_m_s", "edges"]
    {
        assert!(text.contains(&format!("\"{key}\":")), "{key}");
    }
    assert!(text.contains("\"default\":0.004166666666666667") && text.contains("\"const\":\"edge-tension\""));
    let default = |of: &str| &schema.pointer(of).expect("a key")["default"];
    assert_eq!(default("/$defs/TimeSpec/properties/max_rate_dt"), 0.3);
    assert_eq!(default("/$defs/NetworkSpec/properties/missing"), "hold");
    assert_eq!(default("/$defs/NetworkSpec/properties/near"), "sensed");
    assert!(!text.contains("null") && !text.contains("\\["), "{schema:#}");
    assert_eq!(schema["required"], serde_json::json!(["start", "formation", "law", "time"]));
    assert!(described(&schema["properties"]));
    assert!(schema["$defs"].as_object().is_some_and(|defs| defs.values().all(|def| described(&def["properties"]))));
}

/// The reader checks every bound of the schema.
#[test]
fn a_number_beyond_a_bound_of_the_schema_is_refused_at_its_key() {
    let bounded = [
        ("time.dt_s", "0"),
        ("time.max_halvings", "21"),
        ("law.alpha", "-1"),
        ("law={kind=\"orca\", delta_m=2, neighbours_max=0}", ""),
        ("law={kind=\"orca\", delta_m=2, margin_m=-1}", ""),
        ("law={kind=\"flocking\", delta_m=2, c1_gamma_per_s2=-0.1}", ""),
        ("swarm.mass_kg", "0"),
        ("swarm.mass_kg", "[1, -1]"),
        ("swarm.dimensions", "4"),
        ("start.jitter_m", "-1"),
        ("formation.scale", "0"),
        ("deadlock.scale", "0.5"),
        ("arrival.edge_error_m", "0"),
        ("network.loss", "1.5"),
        ("sensing.rate_hz", "0"),
        ("formation={shape=\"v\", angle_deg=59}", ""),
        ("safety={shape=\"ellipsoid\", half_axes_m=[1, 1, 0]}", ""),
        ("wind={dryden={speed_20ft_m_s=5, height_m=1}}", ""),
        ("vehicle={model=\"unicycle\", min_speed_m_s=0}", ""),
        ("failure=[{vehicle=0, at_s=1, kind=\"dead\"}]", ""),
        ("failure=[{vehicle=1, at_s=1, kind=\"rotor\", rotor=5}]", ""),
        ("graph={kind=\"edges\", edges=[[0, 1]]}", ""),
        ("law.delta_m", "2e9"),
        ("law.delta_m", "1e-10"),
        ("start.positions_m.1.x", "inf"),
    ];
    for (key, number) in bounded {
        let set = if number.is_empty() { key.to_owned() } else { format!("{key}={number}") };
        let overrides = [Override::parse(&set).expect("TOML")];
        let source = Source::Text { name: "f".to_owned(), text: RIGHT.to_owned() };
        let error = Scenario::read(&source, &overrides).expect_err(&set);
        assert_eq!(error.code(), "scenario/out-of-range", "{set}: {error}");
        assert!(error.message.contains(" must be "), "{error}");
        assert_eq!(error.place.as_ref().map(|place| place.source.as_str()), Some("set"), "{error}");
    }
    let schema = scenario::schema();
    assert_eq!(schema["$defs"]["PerVehicle"]["anyOf"][0]["exclusiveMinimum"], 0);
}

/// Returns whether every key of a table has a description.
fn described(properties: &serde_json::Value) -> bool {
    properties.as_object().is_none_or(|keys| keys.values().all(|key| key["description"].is_string()))
}
