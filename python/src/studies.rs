//! Requests of studies, exports and the validation.

use std::path::PathBuf;

use pyo3::prelude::*;
use tautline::attack::{AttackRequest, Method, Variation};
use tautline::campaign::CampaignRequest;
use tautline::compare::CompareRequest;
use tautline::export::WRITTEN;
use tautline::margin::{MarginRequest, Question, Range};
use tautline::request::{ExportRequest, Failure, Monitor as _, Silent, export_file};
use tautline::scenario::builtin;
use tautline::validate::{ValidateRequest, validate_into};

use crate::errors::{Raised as _, broken, wrong_by};
use crate::request::{ReadOptions, choice};
use crate::scenario::Scenario;
use crate::work::away_with_threads;

/// Whether an answer is good, and the answer as JSON.
type Answer = (bool, String);

/// Works on a request without the interpreter's lock.
fn answered<T: Send>(py: Python<'_>, work: impl FnOnce(&Silent) -> Result<T, Failure> + Send) -> PyResult<T> {
    let monitor = Silent::default();
    away_with_threads(py, monitor.interruption(), || work(&monitor))?.map_err(Failure::raised)
}

/// The answer of a study that was not interrupted.
fn whole<T>(answer: Option<T>) -> PyResult<T> {
    answer.ok_or_else(|| broken("the work was interrupted"))
}

fn json<E: std::fmt::Display>(text: Result<String, E>) -> PyResult<String> {
    text.map_err(|error| broken(&error.to_string()))
}

/// Names of the built-in scenarios.
#[pyfunction]
pub(crate) fn scenarios() -> Vec<&'static str> {
    builtin::all().iter().map(|builtin| builtin.name).collect()
}

/// Writes a recording in another format.
#[pyfunction]
pub(crate) fn export(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    options: &ReadOptions,
    output: PathBuf,
    to: Option<String>,
    sample_hz: Option<f64>,
    force: bool,
) -> PyResult<()> {
    let written: Vec<_> = WRITTEN.iter().map(|format| (format.name, *format)).collect();
    let format = choice("to", to, &written)?;
    let request = ExportRequest { paths, options: options.0.clone(), output, format, sample_hz, force };
    answered(py, |monitor| export_file(&request, monitor))
}

/// Flies laws from the same starts.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is one that Python gives")]
pub(crate) fn compare(
    py: Python<'_>,
    scenario: &Scenario,
    laws: Option<Vec<String>>,
    runs: u64,
    seed: u64,
    csv: Option<PathBuf>,
    latex: Option<PathBuf>,
    html: Option<PathBuf>,
    force: bool,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let request = CompareRequest {
        laws,
        runs,
        seed,
        csv,
        latex,
        html,
        force,
        threads,
        ..CompareRequest::new(scenario.request.clone())
    };
    let comparison = whole(answered(py, |monitor| tautline::compare::compare(&request, &(), monitor))?)?;
    Ok((comparison.runs == comparison.runs_asked, json(comparison.to_json())?))
}

/// Searches for the values of a key between which a verdict turns.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is one that Python gives")]
pub(crate) fn margin(
    py: Python<'_>,
    scenario: &Scenario,
    key: &str,
    start: f64,
    stop: f64,
    runs: u64,
    seed: u64,
    verdict: String,
    scan: usize,
    halvings: u64,
    logarithmic: bool,
    csv: Option<PathBuf>,
    html: Option<PathBuf>,
    force: bool,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let questions = Question::ALL.map(|question| (question.name(), question));
    let question = choice("verdict", Some(verdict), &questions)?.unwrap_or(Question::Pass);
    let request = MarginRequest {
        range: Range {
            from: start,
            to: stop,
            scan,
            halvings: u32::try_from(halvings).unwrap_or(u32::MAX),
            logarithmic,
        },
        asked: tautline::margin::Asked { question, runs, seed },
        csv,
        html,
        force,
        threads,
        ..MarginRequest::new(scenario.request.clone(), key, start, stop)
    };
    let margin = whole(answered(py, |monitor| tautline::margin::margin(&request, monitor))?)?;
    Ok((margin.is_known(), json(margin.to_json())?))
}

/// Searches for the worst flight within bounds.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is one that Python gives")]
pub(crate) fn attack(
    py: Python<'_>,
    scenario: &Scenario,
    start: Option<f64>,
    velocity: Option<f64>,
    apart: Option<f64>,
    vary: Vec<(String, f64, f64)>,
    flights: u64,
    seeds: u64,
    method: String,
    seed: u64,
    out: Option<PathBuf>,
    csv: Option<PathBuf>,
    html: Option<PathBuf>,
    force: bool,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let methods = Method::ALL.map(|method| (method.name(), method));
    let vary = vary.iter().map(|(key, low, high)| Variation::new(key, *low, *high)).collect::<Result<Vec<_>, _>>();
    let asked = tautline::attack::Asked {
        vary: vary.map_err(|error| wrong_by("attack/variation", format!("vary: {error}")))?,
        start_m: start,
        velocity_m_s: velocity,
        apart_m: apart,
        method: choice("method", Some(method), &methods)?.unwrap_or(Method::CmaEs),
        flights,
        seeds,
        seed,
    };
    let request =
        AttackRequest { out, csv, html, force, threads, ..AttackRequest::new(scenario.request.clone(), asked) };
    let attack = whole(answered(py, |monitor| tautline::attack::attack(&request, &(), monitor))?)?;
    Ok((!attack.is_bad() && !attack.interrupted, json(attack.to_json())?))
}

/// Judges the claims of the paper and ours.
#[pyfunction]
pub(crate) fn validate(py: Python<'_>, out: PathBuf, force: bool, threads: Option<usize>) -> PyResult<Answer> {
    let request = ValidateRequest { out, force, threads };
    let validation = answered(py, |monitor| validate_into(&request, monitor))?;
    Ok((validation.pass, json(validation.to_json())?))
}

/// Flies a campaign: whether no flight violated, its answer as JSON, and its folder.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is one that Python gives")]
pub(crate) fn campaign(
    py: Python<'_>,
    spec: PathBuf,
    out: Option<PathBuf>,
    shards: Option<u64>,
    threads: Option<usize>,
    until_width: Option<f64>,
    until_decided: Option<f64>,
    worst: usize,
) -> PyResult<(bool, String, PathBuf)> {
    let request =
        CampaignRequest { out, shards, threads, until_width, until_decided, worst, ..CampaignRequest::new(spec) };
    let answer = whole(answered(py, |monitor| tautline::campaign::campaign(&request, &(), monitor))?)?;
    Ok((answer.summary.is_clear(), json(serde_json::to_string(&answer.summary))?, answer.folder))
}
