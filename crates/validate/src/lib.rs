//! Measurement of every claim of tautline and of its source paper.
//!
//! [`validate`] measures all claims and returns them as [`Claim`]s in a fixed order; [`judge`] measures one group.
//! Claims and trials run in parallel on the current rayon pool. Every random start has its own stream and every sum has
//! a fixed order, so the result does not depend on the number of threads.
//!
//! A wrong statement of the paper is expected to be refuted. [`Validation::pass`] requires every claim to be as
//! expected. [`validate_into`] writes result, page and figures to a folder.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod certificate;
mod claim;
mod convergence;
mod detectors;
mod displacement;
mod equilibria;
mod experiments;
mod flights;
mod law;
mod margins;
mod page;
mod rates;
mod tension;

pub use claim::{Claim, Group, Kind, Performance, SCHEMA_VERSION, Validation};
pub use convergence::Refinement;

use std::path::PathBuf;
use std::time::Instant;

use rayon::prelude::*;

use claim::{ClaimsResult, MeasureError, Progress};
use tautline_core::failure::{Failure, in_range};
use tautline_core::files::write_atomically;
use tautline_core::monitor::{Monitor, Silent};
use tautline_core::option::THREADS;
use tautline_report::figures::Format;
use tautline_report::request::{OutFolder, figure_files, threads, write_files};

/// Group of claims: name, subject, units of work, and measurement.
type Part = (&'static str, &'static str, u64, fn(&Progress<'_>) -> ClaimsResult);

const PARTS: [Part; 8] = [
    ("tension", "The edge tension", 1, tension::judge),
    ("law", "The law at single instants", 1, law::judge),
    ("certificate", "Energy and certificate", certificate::STARTS as u64 + 1, certificate::judge),
    ("figures", "The paper's figures", 6, experiments::judge),
    ("equilibria", "Where the law comes to rest", equilibria::FLIGHTS, equilibria::judge),
    ("rates", "Rates near the formation", 5, rates::judge),
    ("displacement", "The displacement law", displacement::WORK, displacement::judge),
    ("margins", "Margins of delay and of held commands", margins::WORK, margins::judge),
];
/// Units of work of convergence, free motion, and three flights.
const ENGINE_WORK: u64 = convergence::STEPS_HZ.len() as u64 + 1 + 3;

/// Returns the units of work of [`validate`].
#[must_use]
pub fn work() -> u64 {
    PARTS.iter().map(|&(_, _, work, _)| work).sum::<u64>() + ENGINE_WORK
}

/// Measures the claims of one group without figures: `tension`, `law`, `certificate`, `figures`, `equilibria`, `rates`,
/// `displacement` or `margins`. Returns `None` for another name.
#[must_use]
pub fn judge(id: &str) -> Option<Group> {
    PARTS.iter().find(|part| part.0 == id).map(|&(id, title, _, judge)| group(id, title, judge(&Silent::default())))
}

/// Measures every claim. `progress` receives the finished units of [`work`], from any thread. Its interruption ends all
/// flights.
///
/// If a flight fails or is interrupted, its group has a single claim, which fails.
#[must_use]
pub fn validate(progress: &dyn Monitor) -> Validation {
    let began = Instant::now();
    let parts = || PARTS.par_iter().map(|&(id, title, _, judge)| group(id, title, judge(progress))).collect::<Vec<_>>();
    let engine = || -> Result<_, MeasureError> {
        let convergence = convergence::measure(progress)?;
        let mut claims = convergence::claims(&convergence)?;
        claims.push(convergence::free_decay(progress)?);
        let flights = detectors::flights(progress)?;
        let figures = page::draw(&flights, &convergence)?;
        Ok((claims, detectors::claims(&flights)?, convergence, figures))
    };
    let (mut groups, engine) = rayon::join(parts, engine);
    let engine_group = |judged| group("engine", "The engine against continuous time", judged);
    let (convergence, figures) = match engine {
        Ok((engine, detectors, convergence, figures)) => {
            groups.extend([engine_group(Ok(engine)), group("detectors", "The engine and the judges", Ok(detectors))]);
            (convergence, figures)
        }
        Err(error) => {
            groups.push(engine_group(Err(error)));
            (Vec::new(), Vec::new())
        }
    };
    Validation::new(groups, convergence, figures, began.elapsed().as_secs_f64())
}

fn group(id: &'static str, title: &'static str, judged: ClaimsResult) -> Group {
    Group { id, title, claims: judged.unwrap_or_else(|error| vec![Claim::failed_group(&error)]) }
}

/// File name of the page.
const PAGE: &str = "validate.html";
/// Largest number of threads.
const MOST_THREADS: usize = 256;

/// Request for a validation with files.
#[derive(Clone, Debug)]
pub struct ValidateRequest {
    /// Folder for `validate.json`, the page and figures.
    pub out: PathBuf,
    /// Whether a folder with a finished validation is overwritten.
    pub force: bool,
    /// Number of threads, by default one for each core. The result is the same for any number.
    pub threads: Option<usize>,
}

/// Measures every claim and writes `validate.json`, `validate.html` and figures to a folder. `validate.json` marks the
/// folder as finished and is written last.
///
/// # Errors
/// [`Failure`] if the folder holds a finished validation, the monitor interrupts the work, or a file cannot be written.
pub fn validate_into(request: &ValidateRequest, monitor: &dyn Monitor) -> Result<Validation, Failure> {
    if let Some(number) = &request.threads {
        in_range(THREADS, number, &(1..=MOST_THREADS))?;
    }
    let folder = OutFolder::at(&request.out, "validation", "validate.json");
    let _lock = folder.open(request.force)?;
    let threads = threads(request.threads.unwrap_or(0))?;
    monitor.begin("validate", Some(work()));
    let validation = threads.install(|| validate(monitor));
    monitor.finish();
    if monitor.is_interrupted() {
        return Err(Failure::machine(Failure::INTERRUPTED, "interrupted: nothing was written"));
    }
    let json = validation
        .to_json()
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the result: {error}")))?;
    write_files(&folder.file("figures"), &[], &figure_files(&validation.figures, &[Format::Svg]))?;
    write_atomically(&folder.file(PAGE), validation.to_html().as_bytes())?;
    write_atomically(&folder.report(), json.as_bytes())?;
    monitor.say(&format!("{}{}", validation.text(), validation.headline()));
    monitor.say(&format!("wrote {} and {}", folder.report().display(), folder.file(PAGE).display()));
    Ok(validation)
}
