//! Tests of the program as a process.

#[path = "../support/program.rs"]
mod program;
#[path = "../support/report.rs"]
mod report;

mod archives;
mod attack;
mod audit;
mod campaign;
mod campaign_files;
mod check;
mod compare;
mod determinism;
mod doors;
mod drones;
mod ellipsoids;
mod exports;
mod first_steps;
mod fixes;
mod golden;
mod ground;
mod heights;
mod imperfections;
mod interruption;
mod keys;
mod layouts;
mod limits;
mod margin;
mod obstacles;
mod own_recordings;
mod plans;
mod presence;
mod proofs;
mod reading;
mod reads;
mod references;
mod refuses;
mod rounding;
mod rules;
mod runs;
mod scenarios;
mod shapes;
mod side_files;
mod sweep;
mod watch;

impl program::Ran {
    /// Returns the stable code of the error: the first line on standard error that is `area/problem`, or nothing.
    pub(crate) fn code(&self) -> &str {
        let is_word = |word: &str| !word.is_empty() && word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-');
        let is_code =
            |line: &&str| line.split_once('/').is_some_and(|(area, problem)| is_word(area) && is_word(problem));
        self.err.lines().map(str::trim).find(is_code).unwrap_or_default()
    }
}
