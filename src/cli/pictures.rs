//! What a run leaves for people to look at: a replay, figures and a page.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::Failure;
use tautline_report::figures::{self, Criteria, Figure, RunHistory};
use tautline_report::replay::{Film, NoReplay, PAGE_BYTES, Replay, Stage};
use tautline_report::report::{Report, RunPage, write_atomically};
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim;

/// A flight and what was found on it, in so many bytes.
pub(super) fn replay(scenario: &Scenario, film: &Film, report: &Report, room_bytes: usize) -> Result<Replay, NoReplay> {
    let names: Vec<_> = scenario.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect();
    let stage = Stage::of(scenario, scenario.obstacles.iter().map(sim::judged).collect());
    Replay::new(&stage, film, &report.moments(&names), report.judgement(), room_bytes)
}

/// A run as charts.
pub(super) fn figures(scenario: &Scenario, history: &RunHistory, report: &Report) -> Vec<Figure> {
    let criteria = Criteria {
        delta_m: scenario.delta_m,
        certified_m: report.separation.certified_m,
        shape: Some((&scenario.legs, &scenario.graph)),
        edge_error_m: Some(scenario.arrival.edge_error_m),
        disagreement_m_s: Some(scenario.arrival.disagreement_m_s),
        most_thrust_n: scenario.airframe.quadrotor().map(|quadrotor| quadrotor.model.max_thrust_n),
    };
    figures::of_run(history, &criteria)
}

/// The page on a flight that a program has flown itself, which `command` flies again; without pictures.
#[must_use]
pub fn flight_page(
    scenario: &Scenario,
    preflight: &Preflight,
    (history, film): &(RunHistory, Film),
    report: &Report,
    command: &str,
) -> String {
    let warnings: Vec<_> =
        preflight.warnings.iter().map(|warning| (warning.code.name().to_owned(), warning.message.clone())).collect();
    let figures = figures(scenario, history, report);
    let replay = replay(scenario, film, report, PAGE_BYTES);
    let page = RunPage { scenario, warnings: &warnings, replay: &replay, figures: &figures, pictures: &[], command };
    report.to_html(&page)
}

/// Writes `figures/*.svg` and `report.html` into a run's folder and gives the path of the page. Figures of an earlier run
/// are removed.
pub(super) fn write(folder: &Path, report: &Report, page: &RunPage<'_>) -> Result<PathBuf, Failure> {
    let names = figures::NAMES_OF_RUN.map(|name| format!("{name}.svg"));
    write_files(&folder.join("figures"), &names, &svg_files(page.figures))?;
    let path = folder.join("report.html");
    write_atomically(&path, report.to_html(page).as_bytes())?;
    Ok(path)
}

/// Figures as files.
pub(super) fn svg_files(figures: &[Figure]) -> Vec<(String, Vec<u8>)> {
    figures.iter().map(|figure| (format!("{}.svg", figure.name), figure.svg.clone().into_bytes())).collect()
}

/// Writes files of a folder whole; of those that could be there by their names, what is not written is removed.
pub(super) fn write_files(folder: &Path, names: &[String], files: &[(String, Vec<u8>)]) -> Result<(), Failure> {
    let failure =
        |path: &Path, error: &io::Error| Failure::machine(format!("cannot write {}: {error}", path.display()));
    if !files.is_empty() {
        fs::create_dir_all(folder).map_err(|error| failure(folder, &error))?;
    }
    for (name, bytes) in files {
        write_atomically(&folder.join(name), bytes)?;
    }
    for name in names.iter().filter(|&name| files.iter().all(|(written, _)| written != name)) {
        let path = folder.join(name);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failure(&path, &error)),
            _ => {}
        }
    }
    Ok(())
}
