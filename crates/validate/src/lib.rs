//! Every claim of ours and of the paper, judged by measurement.
//!
//! [`validate`] flies and computes everything anew and returns [`Claim`]s in a fixed order; [`judge`] does one group of
//! them. Claims and trials run side by side on the threads of the current rayon pool; every random start has a stream of
//! its own and every sum is taken in index order, so the answer does not depend on the number of threads.
//!
//! A statement of the paper that fails is reported as refuted, with our own measurement: what must hold then is the
//! refutation. [`Validation::pass`] asks every claim to be as expected. [`validate_into`] writes result, page and figures
//! to a folder.

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

use claim::{Judged, Progress, Untried};
use tautline_report::report::write_atomically;
use tautline_report::request::{Failure, Monitor, OutFolder, in_range, svg_files, threads, write_files};

/// A file of claims: its name, its subject, the units of work that it counts, and its judgement.
type Part = (&'static str, &'static str, u64, fn(&Progress<'_>) -> Judged);

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
/// Convergence, free motion, and three flights.
const ENGINE_WORK: u64 = convergence::STEPS_HZ.len() as u64 + 1 + 3;

/// Units of work that [`validate`] counts in all.
#[must_use]
pub fn work() -> u64 {
    PARTS.iter().map(|&(_, _, work, _)| work).sum::<u64>() + ENGINE_WORK
}

/// Judges the claims of one group that needs no figure, by its name: `tension`, `law`, `certificate`, `figures`,
/// `equilibria`, `rates`, `displacement` or `margins`. None where there is no such group.
#[must_use]
pub fn judge(id: &str) -> Option<Group> {
    PARTS.iter().find(|part| part.0 == id).map(|&(id, title, _, judge)| group(id, title, judge(&|_| ())))
}

/// Judges every claim. `progress` is told how many further units of [`work`] are done, from any thread.
///
/// Claims that cannot be tried, because a flight of theirs fails, stand as one that fails.
#[must_use]
pub fn validate(progress: &(dyn Fn(u64) + Sync)) -> Validation {
    let began = Instant::now();
    let parts = || PARTS.par_iter().map(|&(id, title, _, judge)| group(id, title, judge(progress))).collect::<Vec<_>>();
    let engine = || -> Result<_, Untried> {
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

fn group(id: &'static str, title: &'static str, judged: Judged) -> Group {
    Group { id, title, claims: judged.unwrap_or_else(|error| vec![Claim::untried(&error)]) }
}

/// The page for people.
const PAGE: &str = "validate.html";
/// Most threads.
const MOST_THREADS: usize = 256;

/// Where a validation leaves its files.
#[derive(Clone, Debug)]
pub struct ValidateRequest {
    /// Folder for `validate.json` and the rest.
    pub out: PathBuf,
    /// Whether a folder that holds a finished validation is overwritten.
    pub force: bool,
    /// Threads to use, by default one a core. The result is the same for any number.
    pub threads: Option<usize>,
}

/// Judges every claim and leaves `validate.json`, `validate.html` and figures in a folder. The result, which marks the
/// folder as finished, comes last.
///
/// # Errors
/// [`Failure`] where the folder holds a finished validation, or the system refuses.
pub fn validate_into(request: &ValidateRequest, monitor: &dyn Monitor) -> Result<Validation, Failure> {
    if let Some(number) = &request.threads {
        in_range("--threads", number, &(1..=MOST_THREADS))?;
    }
    let folder = OutFolder::at(&request.out, "validation", "validate.json");
    let _lock = folder.open(request.force)?;
    let threads = threads(request.threads.unwrap_or(0))?;
    monitor.begin("validate", Some(work()));
    let validation = threads.install(|| validate(&|units| monitor.advance(units)));
    monitor.finish();
    let json = validation
        .to_json()
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the result: {error}")))?;
    write_files(&folder.file("figures"), &[], &svg_files(&validation.figures))?;
    write_atomically(&folder.file(PAGE), validation.to_html().as_bytes())?;
    write_atomically(&folder.report(), json.as_bytes())?;
    monitor.say(&format!("{}{}", validation.text(), validation.headline()));
    monitor.say(&format!("wrote {} and {}", folder.report().display(), folder.file(PAGE).display()));
    Ok(validation)
}
