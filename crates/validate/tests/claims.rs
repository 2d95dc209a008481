//! Claims that are measured in seconds: the paper's figures and the displacement law.

use std::sync::LazyLock;

use tautline_validate::{Claim, Group, judge};

/// Solver error of a flight of tens of seconds with 1e-12 per step, amplified by the growth for a22 > 0.
const SOLVED_M: f64 = 1e-11;

/// Returns a claim about the paper's figures, which are flown once.
fn claim(id: &str) -> &'static Claim {
    static FIGURES: LazyLock<Group> = LazyLock::new(|| judge("figures").expect("a group of claims"));
    FIGURES.claims.iter().find(|claim| claim.id == id).unwrap_or_else(|| panic!("{id} in {FIGURES:?}"))
}

fn assert_holds(id: &str) {
    assert!(claim(id).pass, "{:?}", claim(id));
}

/// Asserts that the formation is reached to working precision.
fn assert_formed(id: &str) {
    assert_holds(id);
    assert!(claim(id).value("final_edge_error_m").is_some_and(|error_m| error_m < SOLVED_M), "{:?}", claim(id));
}

#[test]
fn the_pentagon_flies_as_the_reference_says() {
    assert_formed("figure-2");
    assert_holds("figure-2-reference");
}

#[test]
fn the_circle_flies_as_the_reference_says() {
    assert_formed("figure-3");
    assert_holds("figure-3-reference");
}

#[test]
fn the_baseline_collides_as_the_reference_says() {
    assert_holds("figure-4");
}

#[test]
fn a_straight_line_is_kept_with_the_known_smallest_separation() {
    assert_holds("straight-line");
}

#[test]
fn every_claim_about_the_displacement_law_is_as_expected() {
    let group = judge("displacement").expect("a group of claims");
    assert_eq!(group.claims.len(), 5);
    for claim in &group.claims {
        assert!(claim.pass, "{}: {}", claim.id, claim.measured);
    }
}
