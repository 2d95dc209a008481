//! Requests of studies: answers, files, interruptions and codes of failures.

use std::fs;
use std::sync::atomic::Ordering;

use tautline_core::failure::Failure;
use tautline_core::monitor::{Monitor, Silent};
use tautline_report::request::ScenarioRequest;
use tautline_studies::campaign::{CampaignRequest, campaign};
use tautline_studies::{Experiment, StudyFiles, StudyRequest, answer, attack, compare, margin, sweep};

fn short() -> ScenarioRequest {
    ScenarioRequest::named("pentagon", &["time.duration_s=1".to_owned()]).expect("a scenario")
}

fn options() -> attack::Options {
    attack::Options { start_m: Some(0.2), flights: 2, ..attack::Options::default() }
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
    let laws = Some(vec!["edge-tension".to_owned(), "laplacian".to_owned()]);
    let options = compare::Options { laws, runs: 2, ..compare::Options::default() };
    let files = StudyFiles { csv: Some(csv.clone()), ..StudyFiles::default() };
    let request = StudyRequest { files, ..StudyRequest::new(short(), options) };
    let comparison = answer(&request, &(), &Silent::default()).expect("compared").expect("an answer");
    assert_eq!((comparison.runs, comparison.laws.len()), (2, 2));
    assert_eq!(fs::read_to_string(&csv).expect("a table").lines().count(), 3, "a header and a row a law");
    let again = answer(&request, &(), &Silent::default()).expect_err("the file is there");
    assert_eq!(again.code(), "files/exists");
}

#[test]
fn an_interruption_leaves_no_answer_and_no_file() {
    fn leaves_nothing<E: Experiment>(options: E) -> bool {
        let folder = tempfile::tempdir().expect("a folder");
        let files = StudyFiles { html: Some(folder.path().join("page.html")), ..StudyFiles::default() };
        let request = StudyRequest { files, ..StudyRequest::new(short(), options) };
        let is_none = answer(&request, &(), &interrupted()).expect("no failure").is_none();
        is_none && fs::read_dir(folder.path()).expect("a folder").count() == 0
    }
    assert!(leaves_nothing(compare::Options::default()));
    assert!(leaves_nothing(margin::Options::new("time.control_hz", 5.0, 50.0)));
    assert!(leaves_nothing(options()));
    let key = sweep::SweptKey::parse("law.alpha=0.5,1").expect("a key");
    assert!(leaves_nothing(sweep::Options { keys: vec![key], runs: 1, ..sweep::Options::default() }));
}

/// The code of the failure of a study.
fn refused<E: Experiment>(options: E) -> &'static str {
    answer(&StudyRequest::new(short(), options), &(), &Silent::default()).err().expect("refused").code()
}

#[test]
fn wrong_requests_have_codes() {
    let silent = Silent::default();
    let code = |failure: Failure| failure.code();
    let options_of = compare::Options::default;
    assert_eq!(refused(compare::Options { runs: 0, ..options_of() }), "request/out-of-range");
    assert_eq!(refused(compare::Options { seed: u64::MAX, ..options_of() }), "request/out-of-range");
    assert_eq!(refused(compare::Options { laws: Some(Vec::new()), ..options_of() }), "compare/no-law");
    let no_threads = StudyRequest { threads: Some(0), ..StudyRequest::new(short(), options_of()) };
    assert_eq!(code(answer(&no_threads, &(), &silent).expect_err("refused")), "request/out-of-range");

    assert_eq!(refused(margin::Options::new("time.control_hz", 5.0, 5.0)), "margin/range");
    assert_eq!(refused(margin::Options::new("time.control_hz", f64::NAN, 5.0)), "margin/range");
    assert_eq!(refused(margin::Options::new("law.nope", 1.0, 5.0)), "scenario/unknown-key");

    assert_eq!(refused(attack::Options { start_m: None, ..options() }), "attack/nothing-varied");
    assert_eq!(refused(attack::Options { start_m: Some(-1.0), ..options() }), "attack/out-of-range");
    assert_eq!(refused(attack::Options { flights: 0, ..options() }), "request/out-of-range");
    assert_eq!(refused(attack::Options { seeds: 3, ..options() }), "attack/too-few-flights");
    let seed = attack::Bound::new("noise.seed", 0.0, 9.0).expect("a range");
    assert_eq!(refused(attack::Options { vary: vec![seed], ..options() }), "attack/seed-varied");

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
