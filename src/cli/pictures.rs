//! What a run leaves for people to look at: figures and a page.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::Failure;
use crate::figures::{self, Criteria, Figure, RunHistory};
use crate::report::page::{Picture, Warning};
use crate::report::{Report, RunPage, write_atomically};
use crate::scenario::Scenario;

/// Everything that the pictures of a run are made of, beside its report.
pub(super) struct Pictures<'a> {
    pub(super) scenario: &'a Scenario,
    /// None where no figures are wanted.
    pub(super) history: Option<&'a RunHistory>,
    pub(super) warnings: &'a [Warning],
    pub(super) command: &'a str,
    /// The run as it looked, for the page.
    pub(super) snapshots: &'a [Picture],
}

impl Pictures<'_> {
    /// Writes `figures/*.svg` and `report.html` into a run's folder and gives the path of the page. Figures of an
    /// earlier run are removed.
    pub(super) fn write(&self, folder: &Path, report: &Report) -> Result<PathBuf, Failure> {
        let figures = self.figures(report);
        let file = |name: &str| format!("{name}.svg");
        let files: Vec<_> =
            figures.iter().map(|figure| (file(&figure.name), figure.svg.clone().into_bytes())).collect();
        write_files(&folder.join("figures"), &figures::NAMES_OF_RUN.map(file), &files)?;
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

    fn figures(&self, report: &Report) -> Vec<Figure> {
        let criteria = Criteria {
            delta_m: self.scenario.delta_m,
            certified_m: report.separation.certified_m,
            shape: Some((self.scenario.formation(), &self.scenario.graph)),
            edge_error_m: Some(self.scenario.arrival.edge_error_m),
            disagreement_m_s: Some(self.scenario.arrival.disagreement_m_s),
        };
        self.history.map_or_else(Vec::new, |history| figures::of_run(history, &criteria))
    }
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
