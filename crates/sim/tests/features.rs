//! Tests of a build without the feature `drawn`: drawings are refused, with the name of the feature.

#![cfg(not(feature = "drawn"))]

use tautline_sim::scenario::{Scenario, ScenarioError, Source, builtin};

/// Reads the built-in pentagon with another shape.
fn read(shape: &str) -> Result<Scenario, ScenarioError> {
    let pentagon = builtin::find("pentagon").expect("a built-in scenario").toml;
    let other_keys = pentagon.lines().filter(|line| !line.starts_with("side_m"));
    let lines = other_keys.map(|line| if line.starts_with("shape") { shape } else { line });
    let text = lines.collect::<Vec<_>>().join("\n");
    Scenario::read(&Source::Text { name: "test.toml".to_owned(), text }, &[])
}

#[test]
fn drawings_need_the_feature_drawn() {
    for (name, keys) in
        [("text", "text = \"HI\""), ("svg", "path = \"M 0 0 L 9 0 L 4 7 Z\""), ("image", "file = \"picture.png\"")]
    {
        let error = read(&format!("shape = \"{name}\"\n{keys}")).expect_err(name);
        assert_eq!(error.code(), "scenario/shape");
        assert!(error.to_string().contains("feature `drawn`"), "{error}");
        let place = error.place.expect("a place");
        assert_eq!(place.text[place.span.clone()], format!("\"{name}\""));
    }
}

#[test]
fn other_shapes_need_no_feature() {
    assert_eq!(read("shape = \"circle\"\nradius_m = 3.0").expect("a circle").count(), 5);
}
