//! What a run leaves for people to look at: figures and a page.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::Failure;
use crate::figures::{self, Course, Figure, Yardsticks};
use crate::report::page::{Picture, Warning};
use crate::report::{Report, RunPage, write_atomically};
use crate::scenario::Scenario;

/// Everything that the pictures of a run are made of, beside its report.
pub(super) struct Pictures<'a> {
    pub(super) scenario: &'a Scenario,
    /// None where no figures are wanted.
    pub(super) course: Option<&'a Course>,
    pub(super) warnings: &'a [Warning],
    pub(super) command: &'a str,
    /// The run as it looked, for the page.
    pub(super) snapshots: &'a [Picture],
}

impl Pictures<'_> {
    /// Writes `figures/*.svg` and `report.html` into a run's folder and gives the path of the page. Figures of an
    /// earlier run are removed.
    pub(super) fn write(&self, folder: &Path, report: &Report) -> Result<PathBuf, Failure> {
        let figures = self.figures(report)?;
        write_figures(&folder.join("figures"), &figures)?;
        let page = RunPage {
            scenario: self.scenario,
            warnings: self.warnings,
            figures: &figures,
            pictures: self.snapshots,
            command: self.command,
        };
        let path = folder.join("report.html");
        write_atomically(&path, report.to_html(&page).as_bytes())?;
        Ok(path)
    }

    fn figures(&self, report: &Report) -> Result<Vec<Figure>, Failure> {
        let Some(course) = self.course else { return Ok(Vec::new()) };
        let yardsticks = Yardsticks {
            delta_m: self.scenario.delta_m,
            certified_m: report.separation.certified_m,
            shape: Some((&self.scenario.formation(), &self.scenario.graph)),
            edge_error_m: Some(self.scenario.arrival.edge_error_m),
            disagreement_m_s: Some(self.scenario.arrival.disagreement_m_s),
        };
        figures::of_run(course, &yardsticks).map_err(|error| Failure::machine(error.to_string()))
    }
}

fn write_figures(folder: &Path, figures: &[Figure]) -> Result<(), Failure> {
    let failure =
        |path: &Path, error: &io::Error| Failure::machine(format!("cannot write {}: {error}", path.display()));
    if !figures.is_empty() {
        fs::create_dir_all(folder).map_err(|error| failure(folder, &error))?;
    }
    for figure in figures {
        write_atomically(&folder.join(format!("{}.svg", figure.name)), figure.svg.as_bytes())?;
    }
    for name in figures::NAMES_OF_RUN.iter().filter(|&&name| figures.iter().all(|figure| figure.name != name)) {
        let path = folder.join(format!("{name}.svg"));
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failure(&path, &error)),
            _ => {}
        }
    }
    Ok(())
}
