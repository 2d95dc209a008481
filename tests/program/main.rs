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
    /// Returns the stable code of the error: the rest of the first line `= code:` on standard error, or nothing.
    pub(crate) fn code(&self) -> &str {
        self.err.lines().find_map(|line| line.trim_start().strip_prefix("= code: ")).unwrap_or_default()
    }
}
