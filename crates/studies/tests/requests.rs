//! Requests of studies: answers, files, interruptions and codes of failures.

use std::fs;
use std::sync::atomic::Ordering;

use tautline_report::request::{Failure, Monitor, ScenarioRequest, Silent};
use tautline_studies::attack::{Asked, AttackRequest, Method, Variation, attack};
use tautline_studies::campaign::{CampaignRequest, campaign};
use tautline_studies::compare::{CompareRequest, compare};
use tautline_studies::margin::{MarginRequest, margin};

fn short() -> ScenarioRequest {
    ScenarioRequest::named("pentagon", &["time.duration_s=1".to_owned()]).expect("a scenario")
}

fn asked() -> Asked {
    Asked {
        vary: Vec::new(),
        start_m: Some(0.2),
        velocity_m_s: None,
        apart_m: None,
        method: Method::Random,
        flights: 2,
        seeds: 1,
        seed: 0,
    }
}

fn interrupted() -> Silent {
    let monitor = Silent::default();
    monitor.interruption().store(true, Ordering::Relaxed);
    monitor
}

#[test]
fn a_comparison_is_answered_and_its_files_are_written_and_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let csv = folder.path().join("laws.csv");
    let request = CompareRequest {
        laws: Some(vec!["edge-tension".to_owned(), "laplacian".to_owned()]),
        runs: 2,
        csv: Some(csv.clone()),
        ..CompareRequest::new(short())
    };
    let comparison = compare(&request, &(), &Silent::default()).expect("compared").expect("an answer");
    assert_eq!((comparison.runs, comparison.laws.len()), (2, 2));
    assert_eq!(fs::read_to_string(&csv).expect("a table").lines().count(), 3, "a header and a row a law");
    let again = compare(&request, &(), &Silent::default()).expect_err("the file is there");
    assert_eq!(again.code(), "files/exists");
}

#[test]
fn an_interruption_leaves_no_answer_and_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let html = folder.path().join("page.html");
    let compared = CompareRequest { html: Some(html.clone()), ..CompareRequest::new(short()) };
    assert!(compare(&compared, &(), &interrupted()).expect("no failure").is_none());
    let request =
        MarginRequest { html: Some(html.clone()), ..MarginRequest::new(short(), "time.control_hz", 5.0, 50.0) };
    assert!(margin(&request, &interrupted()).expect("no failure").is_none());
    let request = AttackRequest { html: Some(html.clone()), ..AttackRequest::new(short(), asked()) };
    assert!(attack(&request, &(), &interrupted()).expect("no failure").is_none());
    assert!(!html.exists());
}

#[test]
fn wrong_requests_have_codes() {
    let silent = Silent::default();
    let code = |failure: Failure| failure.code();
    let of = |request: CompareRequest| code(compare(&request, &(), &silent).expect_err("refused"));
    assert_eq!(of(CompareRequest { runs: 0, ..CompareRequest::new(short()) }), "request/out-of-range");
    assert_eq!(of(CompareRequest { seed: u64::MAX, ..CompareRequest::new(short()) }), "request/out-of-range");
    assert_eq!(of(CompareRequest { threads: Some(0), ..CompareRequest::new(short()) }), "request/out-of-range");
    assert_eq!(of(CompareRequest { laws: Some(Vec::new()), ..CompareRequest::new(short()) }), "compare/no-law");

    let of = |request: MarginRequest| code(margin(&request, &silent).expect_err("refused"));
    assert_eq!(of(MarginRequest::new(short(), "time.control_hz", 5.0, 5.0)), "margin/range");
    assert_eq!(of(MarginRequest::new(short(), "time.control_hz", f64::NAN, 5.0)), "margin/range");
    assert_eq!(of(MarginRequest::new(short(), "law.nope", 1.0, 5.0)), "scenario/unknown-key");

    let of = |asked: Asked| code(attack(&AttackRequest::new(short(), asked), &(), &silent).expect_err("refused"));
    assert_eq!(of(Asked { start_m: None, ..asked() }), "attack/nothing-varied");
    assert_eq!(of(Asked { start_m: Some(-1.0), ..asked() }), "attack/out-of-range");
    assert_eq!(of(Asked { flights: 0, ..asked() }), "request/out-of-range");
    assert_eq!(of(Asked { seeds: 3, ..asked() }), "attack/too-few-flights");
    let seed = Variation::new("noise.seed", 0.0, 9.0).expect("a range");
    assert_eq!(of(Asked { vary: vec![seed], ..asked() }), "attack/seed-varied");

    let missing = CampaignRequest::new("none.toml".into());
    assert_eq!(code(campaign(&missing, &(), &silent).expect_err("refused")), "campaign/cannot-read");
    let many = CampaignRequest { worst: 11, ..missing };
    assert_eq!(code(campaign(&many, &(), &silent).expect_err("refused")), "request/out-of-range");
}

#[test]
fn a_wrong_specification_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let vary = |keys: &str| format!("scenario = \"pentagon\"\nruns = 10\n[vary]\n{keys}\n");
    let jitter = "uniform = [0.0, 0.1]";
    let grid = "grid = { from = 0.1, to = 1.0, count = 1000000 }";
    for (spec, code) in [
        (vary("start.jitter_m = { uniform = [0.0, -1.0] }"), "campaign/variation"),
        (
            format!("scenario = \"pentagon\"\n[vary]\nlaw.alpha = {{ {grid} }}\nlaw.delta_m = {{ {grid} }}\n"),
            "campaign/plan",
        ),
        (vary("law = { list = [{ kind = \"edge-tension\" }] }\n[set]\nlaw.alpha = 3.0"), "campaign/plan"),
        (
            vary(&format!("\"start.positions_m.2.x\" = {{ {jitter} }}\n\"start.positions_m.2.1\" = {{ {jitter} }}")),
            "campaign/plan",
        ),
        (vary(&format!("\" start.jitter_m\" = {{ {jitter} }}")), "campaign/plan"),
    ] {
        let (file, out) = (folder.path().join("spec.toml"), folder.path().join("camp"));
        fs::write(&file, &spec).expect("written");
        let request = CampaignRequest { out: Some(out.clone()), ..CampaignRequest::new(file) };
        let failure = campaign(&request, &(), &Silent::default()).expect_err(&spec);
        assert_eq!(failure.code(), code, "{spec}: {failure}");
        assert!(!out.exists(), "{spec}");
    }
}
