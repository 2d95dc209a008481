//! Flies a scenario into a folder, as `tautline run` does, and audits the recording, as `tautline audit` does.

use std::error::Error;

use tautline_report::request::{
    AuditOptions, AuditRequest, RunRequest, ScenarioRequest, Silent, Subject, audit_files, run_into,
};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::temp_dir().join("tautline-example-report");
    let request = ScenarioRequest::named("pentagon", &["time.duration_s=60".to_owned()])?;
    let scenario = request.read()?;
    let command = request.command("run", [], []);
    let run = RunRequest { out: Some(folder.clone()), force: true, ..RunRequest::new(&scenario, command) };
    // The second argument draws pictures, such as `tautline_render::RunPictures`; `()` draws none.
    let flown = run_into(&run, &(), &Silent::default())?;
    println!("{}", flown.report.headline());

    let subject = Subject::Files { paths: vec![folder.join("run.mcap")], options: Box::default() };
    let audited = audit_files(&AuditRequest::new(subject, AuditOptions::default()), &Silent::default())?;
    println!("{}", audited.report.headline());
    Ok(())
}
