//! Studies, exports and the validation.

use std::path::PathBuf;

use pyo3::prelude::*;
use tautline::attack::Bound;
use tautline::campaign::CampaignRequest;
use tautline::export::WRITTEN;
use tautline::export::drones::{Dialect, DroneOptions};
use tautline::margin::Range;
use tautline::request::{DroneExportRequest, ExportRequest, Failure, Monitor as _, Silent, export_drones, export_file};
use tautline::scenario::builtin;
use tautline::statistics::Proportion;
use tautline::studies::{Criterion, Experiment, Study as _, StudyFiles, StudyRequest};
use tautline::sweep::SweptKey;
use tautline::validate::{ValidateRequest, validate_into};

use crate::errors::{IntoException as _, internal_error};
use crate::request::{ReadOptions, choice};
use crate::scenario::Scenario;
use crate::work::run_in_thread_with_pool;

/// Whether a result is good, and the result as JSON.
type Answer = (bool, String);

/// Runs a request without the interpreter's lock.
fn answered<T: Send>(py: Python<'_>, work: impl FnOnce(&Silent) -> Result<T, Failure> + Send) -> PyResult<T> {
    let monitor = Silent::default();
    run_in_thread_with_pool(py, monitor.interruption(), || work(&monitor))?.map_err(Failure::into_exception)
}

/// Returns the result of a study that was not interrupted.
fn whole<T>(answer: Option<T>) -> PyResult<T> {
    answer.ok_or_else(|| internal_error("the work was interrupted"))
}

fn json<E: std::fmt::Display>(text: Result<String, E>) -> PyResult<String> {
    text.map_err(|error| internal_error(&error.to_string()))
}

/// Returns the names of the built-in scenarios.
#[pyfunction]
pub(crate) fn scenarios() -> Vec<&'static str> {
    builtin::all().iter().map(|builtin| builtin.name).collect()
}

/// Options of an export for drones.
#[derive(FromPyObject)]
pub(crate) struct DroneKeywords {
    #[pyo3(item)]
    tolerance: Option<f64>,
    #[pyo3(item)]
    delta: Option<f64>,
    #[pyo3(item)]
    ellipsoid: Option<[f64; 3]>,
    #[pyo3(item)]
    obstacles: Option<PathBuf>,
    #[pyo3(item)]
    from_s: Option<f64>,
    #[pyo3(item)]
    until_s: Option<f64>,
    #[pyo3(item)]
    compressed: bool,
    #[pyo3(item)]
    skyb_version: u8,
}

/// Writes a recording in another format, or for drones. Returns the answer of an export for drones.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
pub(crate) fn export(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    options: &ReadOptions,
    output: PathBuf,
    to: Option<String>,
    sample_hz: Option<f64>,
    force: bool,
    drones: DroneKeywords,
) -> PyResult<Option<Answer>> {
    let options = options.0.clone();
    let lossless = WRITTEN.iter().map(|format| (format.name, (Some(*format), None)));
    let of_drones = Dialect::ALL.map(|dialect| (dialect.name(), (None, Some(dialect))));
    let (format, dialect) = choice("to", to, &lossless.chain(of_drones).collect::<Vec<_>>())?.unwrap_or_default();
    let Some(dialect) = dialect else {
        let request = ExportRequest { paths, options, output, format, sample_hz, force };
        return answered(py, |monitor| export_file(&request, monitor)).map(|()| None);
    };
    let usual = DroneOptions::new(dialect);
    let request = DroneExportRequest {
        paths,
        options,
        output,
        drones: DroneOptions {
            tolerance_m: drones.tolerance.or(usual.tolerance_m),
            is_compressed: drones.compressed,
            skyb_version: drones.skyb_version,
            sample_hz,
            ..usual
        },
        delta_m: drones.delta,
        ellipsoid_m: drones.ellipsoid.map(Into::into),
        obstacles: drones.obstacles,
        from_s: drones.from_s,
        until_s: drones.until_s,
        force,
    };
    let exported = answered(py, |monitor| export_drones(&request, monitor))?;
    Ok(Some((exported.is_good(), exported.to_json())))
}

/// Files and threads of a study.
#[derive(FromPyObject)]
pub(crate) struct Outputs {
    #[pyo3(item)]
    csv: Option<PathBuf>,
    #[pyo3(item)]
    latex: Option<PathBuf>,
    #[pyo3(item)]
    html: Option<PathBuf>,
    #[pyo3(item)]
    force: bool,
    #[pyo3(item)]
    threads: Option<usize>,
}

/// Flies a study and writes its files.
fn study<E>(py: Python<'_>, scenario: &Scenario, options: E, outputs: Outputs) -> PyResult<Answer>
where
    E: Experiment<Study: Send> + Sync,
{
    let Outputs { csv, latex, html, force, threads } = outputs;
    let files = StudyFiles { json: None, csv, latex, html, force };
    let request = StudyRequest { scenario: scenario.request.clone(), options, files, threads };
    let study = whole(answered(py, |monitor| tautline::studies::answer(&request, &(), monitor))?)?;
    Ok((study.is_good(), json(study.to_json())?))
}

fn question(verdict: String) -> PyResult<Criterion> {
    let questions = Criterion::ALL.map(|question| (question.name(), question));
    Ok(choice("verdict", Some(verdict), &questions)?.unwrap_or_default())
}

/// Flies laws from the same starts.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    scenario: &Scenario,
    laws: Option<Vec<String>>,
    shield: bool,
    runs: u64,
    seed: u64,
    outputs: Outputs,
) -> PyResult<Answer> {
    study(py, scenario, tautline::compare::Options { laws, shield, runs, seed }, outputs)
}

/// Searches for the two values of a key between which a verdict turns.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
pub(crate) fn margin(
    py: Python<'_>,
    scenario: &Scenario,
    key: String,
    start: f64,
    stop: f64,
    runs: u64,
    seed: u64,
    verdict: String,
    scan: usize,
    halvings: u64,
    logarithmic: bool,
    outputs: Outputs,
) -> PyResult<Answer> {
    let halvings = u32::try_from(halvings).unwrap_or(u32::MAX);
    let range = Range { from: start, to: stop, scan, halvings, logarithmic };
    let options = tautline::margin::Options { key, range, question: question(verdict)?, runs, seed };
    study(py, scenario, options, outputs)
}

/// Flies a grid over one key or two.
#[pyfunction]
pub(crate) fn sweep(
    py: Python<'_>,
    scenario: &Scenario,
    keys: Vec<(String, Vec<f64>)>,
    runs: u64,
    seed: u64,
    verdict: String,
    outputs: Outputs,
) -> PyResult<Answer> {
    let keys = keys.into_iter().map(|(key, values)| SweptKey::new(&key, values)).collect::<Result<_, _>>();
    let (keys, question) = (keys.map_err(Failure::into_exception)?, question(verdict)?);
    study(py, scenario, tautline::sweep::Options { keys, question, runs, seed }, outputs)
}

/// Searches for the worst flight within bounds.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
pub(crate) fn attack(
    py: Python<'_>,
    scenario: &Scenario,
    start: Option<f64>,
    velocity: Option<f64>,
    apart: Option<f64>,
    vary: Vec<(String, f64, f64)>,
    flights: u64,
    seeds: u64,
    seed: u64,
    out: Option<PathBuf>,
    outputs: Outputs,
) -> PyResult<Answer> {
    let vary = vary.iter().map(|(key, low, high)| Bound::new(key, *low, *high)).collect::<Result<_, _>>();
    let vary = vary.map_err(Failure::into_exception)?;
    let (start_m, velocity_m_s, apart_m) = (start, velocity, apart);
    let options = tautline::attack::Options { vary, start_m, velocity_m_s, apart_m, flights, seeds, seed, out };
    study(py, scenario, options, outputs)
}

/// Measures the claims of the paper and of tautline.
#[pyfunction]
pub(crate) fn validate(py: Python<'_>, out: PathBuf, force: bool, threads: Option<usize>) -> PyResult<Answer> {
    let request = ValidateRequest { out, force, threads };
    let validation = answered(py, |monitor| validate_into(&request, monitor))?;
    Ok((validation.pass, json(validation.to_json())?))
}

/// Flies a campaign. Returns whether no flight had a violation, the result as JSON, and the folder.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
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
    Ok((answer.summary.is_good(), json(serde_json::to_string(&answer.summary))?, answer.folder))
}

/// Returns share, lower and upper bound of `count` of `of` (Clopper and Pearson, 95 %).
#[pyfunction]
pub(crate) fn proportion(count: u64, of: u64) -> (Option<f64>, f64, f64) {
    let Proportion { share, low, high, .. } = Proportion::new(count, of);
    (share, low, high)
}
