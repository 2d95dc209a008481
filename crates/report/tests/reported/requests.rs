//! Requests: answers, files and failures with their codes.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use nalgebra::Vector3;
use tautline_audit::envelope::{Limit, Quantity};
use tautline_audit::recorded::Interpolation;
use tautline_core::track::{Item, Metadata, Plan, Sample, Tracks};
use tautline_recordings::read::{ReadError, ReadOptions};
use tautline_report::request::audit::Open;
use tautline_report::request::{
    AuditOptions, AuditRequest, ExportRequest, RECORDING, RunRequest, ScenarioRequest, Silent, Subject, audit_files,
    export_file, run_into,
};

/// Two vehicles that pass each other in one second, with a smallest separation of 1 m.
struct Passing {
    names: [String; 2],
    metadata: Metadata,
    is_read: bool,
}

impl Passing {
    fn new() -> Self {
        let metadata = Metadata::in_seconds(Vec::new());
        Self { names: ["alpha", "bravo"].map(str::to_owned), metadata, is_read: false }
    }
}

impl Tracks for Passing {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        &self.names
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let seen = |vehicle, time_s, x, y| {
            let position_m = Vector3::new(x, y, 0.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        if !self.is_read {
            items.extend([
                seen(0, 0.0, -5.0, 0.0),
                seen(1, 0.0, 5.0, 1.0),
                seen(0, 1.0, 5.0, 0.0),
                seen(1, 1.0, -5.0, 1.0),
            ]);
        }
        Ok(!std::mem::replace(&mut self.is_read, true))
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn plans(&self) -> &[Plan] {
        &[]
    }
}

/// The same motion as a table.
const TABLE: &str = "t,id,x,y,z\n0,alpha,-5,0,0\n0,bravo,5,1,0\n1,alpha,5,0,0\n1,bravo,-5,1,0\n";

fn held() -> &'static Open<'static> {
    &|| Ok(Box::new(Passing::new()))
}

fn file(folder: &Path) -> Subject<'static> {
    let path = folder.join("passing.csv");
    fs::write(&path, TABLE).expect("written");
    Subject::Files { paths: vec![path], options: Box::default() }
}

fn delta(delta_m: f64) -> AuditOptions {
    AuditOptions { delta_m: Some(delta_m), ..AuditOptions::default() }
}

#[test]
fn motion_in_memory_is_judged_like_its_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    let subject = Subject::InMemory { name: "arrays", own: None, open: held() };
    let request = AuditRequest {
        command: "audit(...)".to_owned(),
        html: Some(page.clone()),
        ..AuditRequest::new(subject, delta(2.0))
    };
    let ours = audit_files(&request, &Silent::default()).expect("judged");
    let theirs = audit_files(&AuditRequest::new(file(folder.path()), delta(2.0)), &Silent::default()).expect("judged");
    assert!(!ours.is_good());
    let (ours, theirs) = (ours.report, theirs.report);
    assert_eq!(ours.verdict(), "VIOLATION");
    assert_eq!(ours.answers, theirs.answers);
    assert_eq!(ours.source.recording, "arrays");
    assert!(fs::read_to_string(page).expect("a page").contains("audit(...)"));
}

#[test]
fn wrong_requests_have_error_codes() {
    let folder = tempfile::tempdir().expect("a folder");
    let code = |options: AuditOptions, change: &dyn Fn(&mut AuditRequest<'static>)| {
        let mut request =
            AuditRequest::new(file(folder.path()), AuditOptions { no_config: options.config.is_none(), ..options });
        change(&mut request);
        let failure = audit_files(&request, &Silent::default()).expect_err("refused");
        assert!(!failure.is_machine() && failure.help().is_some(), "{failure}");
        failure.code()
    };
    let (one, same) = (delta(1.0), &|_: &mut AuditRequest<'static>| ());
    let limit = Limit { quantity: Quantity::Speed, allowed: 5.0 };
    let mut twice = one.clone();
    twice.limits = vec![limit, limit];
    assert_eq!(code(AuditOptions::default(), same), "audit/no-limit");
    assert_eq!(code(delta(f64::NAN), same), "audit/out-of-range");
    assert_eq!(code(twice, same), "audit/limit-twice");
    let unused = AuditOptions { max_accel_m_s2: vec![(None, 2.0)], ..one.clone() };
    assert_eq!(code(unused, same), "audit/unused-acceleration");
    let unbound = AuditOptions { motion: Some(Interpolation::Bounded), ..one.clone() };
    assert_eq!(code(unbound, same), "audit/no-acceleration-bound");
    let empty = AuditOptions { from_s: Some(1.0), until_s: Some(0.5), ..one.clone() };
    assert_eq!(code(empty, same), "audit/empty-window");
    let ghost = AuditOptions { ids: vec!["ghost".to_owned().into()], ..one.clone() };
    assert_eq!(code(ghost, same), "audit/unknown-vehicle");
    assert_eq!(code(one.clone(), &|of| of.options.expect_vehicles = Some(3)), "audit/vehicle-count");
    let none = |name: &str| folder.path().join(name);
    assert_eq!(code(one.clone(), &|of| of.options.obstacles = Some(none("none.toml"))), "files/cannot-read");
    assert_eq!(code(AuditOptions { config: Some(none("none.toml")), ..one.clone() }, same), "files/cannot-read");
    assert_eq!(code(one.clone(), &|of| of.html = Some(none("passing.csv"))), "files/overwrites-input");
    let missing = |of: &mut AuditRequest<'static>| {
        of.subject = Subject::Files { paths: vec![none("none.csv")], options: Box::default() };
    };
    assert_eq!(code(one, &missing), "recording/not-found");
}

#[test]
fn rejects_a_radius_beside_an_ellipsoid() {
    let folder = tempfile::tempdir().expect("a folder");
    let both = AuditOptions {
        radius_m: vec![(None, 0.1)],
        ellipsoid_m: Some(Vector3::new(1.0, 1.0, 2.0)),
        ..AuditOptions::default()
    };
    let failure = audit_files(&AuditRequest::new(file(folder.path()), both), &Silent::default()).expect_err("refused");
    assert_eq!(failure.code(), "audit/radius-and-ellipsoid");
}

#[test]
fn monitor_ends_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let monitor = Silent::default();
    monitor.interruption.store(true, Ordering::Relaxed);
    let failure = audit_files(&AuditRequest::new(file(folder.path()), delta(2.0)), &monitor).expect_err("ended");
    assert_eq!((failure.code(), failure.is_machine()), ("interrupted", true));
    let request = ExportRequest {
        paths: vec![folder.path().join("passing.csv")],
        options: ReadOptions::default(),
        output: folder.path().join("out.npz"),
        format: None,
        sample_hz: None,
        force: false,
    };
    assert_eq!(export_file(&request, &monitor).expect_err("ended").code(), "interrupted");
    assert!(!request.output.exists(), "no part of a file is left");
}

#[test]
fn run_writes_its_files_and_is_not_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let short = ScenarioRequest::named("pentagon", &["time.duration_s=1".to_owned()]).expect("a scenario");
    let scenario = short.read().expect("a scenario");
    let out: PathBuf = folder.path().join("run");
    let request = RunRequest { out: Some(out.clone()), ..RunRequest::new(&scenario, short.command("run", [], [])) };
    let left = run_into(&request, &(), &Silent::default()).expect("flown");
    assert_eq!(left.report.run.vehicles, 5);
    for name in [RECORDING, "report.json", "report.html", "figures/distances.svg"] {
        assert!(out.join(name).is_file(), "{name}");
    }
    assert!(
        fs::read_to_string(out.join("report.html"))
            .expect("a page")
            .contains("tautline run pentagon --set 'time.duration_s=1'")
    );
    let failure = run_into(&request, &(), &Silent::default()).map(drop).expect_err("finished");
    assert_eq!(failure.code(), "files/finished");
    let again = RunRequest::reproducible(&scenario, String::new(), out.clone());
    run_into(&again, &(), &Silent::default()).expect("flown");
    let bytes = |name: &str| fs::read(out.join(name)).expect("a file");
    let first = ["report.json", RECORDING].map(bytes);
    run_into(&again, &(), &Silent::default()).expect("flown");
    assert_eq!(first, ["report.json", RECORDING].map(bytes), "the same bytes each time");
}
