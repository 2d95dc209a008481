//! Studies, exports and the validation.

use std::path::PathBuf;

use pyo3::conversion::FromPyObjectOwned;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tautline::attack::Bound as Bounds;
use tautline::campaign::{CampaignRequest, Folder, Program};
use tautline::export::WRITTEN;
use tautline::export::drones::Dialect;
use tautline::margin::Range;
use tautline::report::recorded::RecordedReport;
use tautline::request::{
    DroneExportOptions, DroneExportRequest, ExportRequest, Failure, Monitor, ScenarioRequest, export_drones,
    export_file,
};
use tautline::scenario::{ExternalLaw, builtin};
use tautline::statistics::Proportion;
use tautline::studies::{Criterion, Experiment, Study, StudyFiles, StudyRequest};
use tautline::sweep::SweptKey;
use tautline::validate::{ValidateRequest, validate_into};

use crate::errors::{IntoException as _, internal_error};
use crate::law::{PythonLaw, catch_exception, load_law};
use crate::request::{ReadOptions, choice};
use crate::scenario::Scenario;
use crate::work::{StudyMonitor, run_detached, run_study};

/// Whether a result is good, its headline, its summary, and the result as JSON.
type Answer = (bool, String, String, String);

/// Runs a request without the interpreter's lock: on all threads, or on this one for laws in Python.
fn answered<T: Send>(
    py: Python<'_>,
    has_law: bool,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&dyn Monitor) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let monitor = StudyMonitor::new(progress, has_law);
    let answer = if has_law {
        let (answer, raised) = run_detached(py, || catch_exception(|| work(&monitor)))?;
        if let Some(raised) = monitor.take_raised().or(raised) {
            return Err(raised);
        }
        monitor.report(py)?;
        answer
    } else {
        let answer = run_study(py, &monitor, || work(&monitor))?;
        monitor.report(py)?;
        answer
    };
    answer.map_err(Failure::into_exception)
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

/// Returns the value of a keyword argument.
fn keyword<'py, T: FromPyObjectOwned<'py>>(keywords: &Bound<'py, PyDict>, name: &str) -> PyResult<T> {
    keywords.as_any().get_item(name)?.extract().map_err(Into::into)
}

/// Returns the options of an export for drones.
fn drone_options(keywords: &Bound<'_, PyDict>) -> PyResult<DroneExportOptions> {
    Ok(DroneExportOptions {
        tolerance_m: keyword(keywords, "tolerance")?,
        delta_m: keyword(keywords, "delta")?,
        ellipsoid_m: keyword::<Option<[f64; 3]>>(keywords, "ellipsoid")?.map(Into::into),
        obstacles: keyword(keywords, "obstacles")?,
        from_s: keyword(keywords, "from_s")?,
        until_s: keyword(keywords, "until_s")?,
        is_compressed: keyword(keywords, "compressed")?,
        skyb_version: Some(keyword(keywords, "skyb_version")?),
    })
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
    drones: &Bound<'_, PyDict>,
) -> PyResult<Option<Answer>> {
    let options = options.0.clone();
    let lossless = WRITTEN.iter().map(|format| (format.name, (Some(*format), None)));
    let of_drones = Dialect::ALL.map(|dialect| (dialect.name(), (None, Some(dialect))));
    let (format, dialect) = choice("to", to, &lossless.chain(of_drones).collect::<Vec<_>>())?.unwrap_or_default();
    let file = ExportRequest { paths, options, output, format, sample_hz, force };
    let Some(dialect) = dialect else {
        return answered(py, false, None, |monitor| export_file(&file, monitor)).map(|()| None);
    };
    let request = DroneExportRequest { file, dialect, options: drone_options(drones)? };
    let exported = answered(py, false, None, |monitor| export_drones(&request, monitor))?;
    let refusal = exported.refusal.as_ref().map(Failure::in_words);
    let headline = refusal.or_else(|| exported.audit.as_ref().map(RecordedReport::headline));
    let headline = headline.unwrap_or_else(|| "not judged: there is one vehicle and no obstacle".to_owned());
    Ok(Some((exported.is_good(), headline, String::new(), exported.to_json())))
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
    #[pyo3(item)]
    progress: Option<Py<PyAny>>,
}

/// Returns a law in Python as an external law.
fn external(law: &Bound<'_, PyAny>, scenario: Option<&Scenario>) -> PyResult<ExternalLaw> {
    Ok(ExternalLaw::new(PythonLaw::new(law, scenario.map(|scenario| &scenario.scenario))?))
}

/// Flies a study and writes its files.
fn study<E>(
    py: Python<'_>,
    scenario: &Scenario,
    law: Option<&Bound<'_, PyAny>>,
    options: E,
    outputs: Outputs,
) -> PyResult<Answer>
where
    E: Experiment<Study: Send> + Send + Sync,
{
    let external_law = law.map(|law| external(law, Some(scenario))).transpose()?;
    let has_law = external_law.is_some() || !options.external_laws().is_empty();
    let Outputs { csv, latex, html, force, threads, progress } = outputs;
    let files = StudyFiles { json: None, csv, latex, html, force };
    let scenario = ScenarioRequest { external_law, ..scenario.request.clone() };
    let request = StudyRequest { scenario, options, files, threads };
    let study = whole(answered(py, has_law, progress, |monitor| tautline::studies::answer(&request, &(), monitor))?)?;
    answer_of(&study)
}

fn answer_of(study: &impl Study) -> PyResult<Answer> {
    Ok((study.is_good(), study.headline(), study.text(), json(study.to_json())?))
}

fn question(verdict: String) -> PyResult<Criterion> {
    let questions = Criterion::ALL.map(|question| (question.name(), question));
    Ok(choice("verdict", Some(verdict), &questions)?.unwrap_or_default())
}

/// Flies laws from the same starts: names, and laws in Python.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    scenario: &Scenario,
    laws: Option<Vec<Bound<'_, PyAny>>>,
    shield: bool,
    runs: u64,
    seed: u64,
    outputs: Outputs,
) -> PyResult<Answer> {
    let mut in_python = Vec::new();
    let mut name = |law: Bound<'_, PyAny>| {
        if let Ok(name) = law.extract::<String>() {
            return Ok(name);
        }
        let law = external(&law, Some(scenario))?;
        let name = law.name().to_owned();
        in_python.push(law);
        PyResult::Ok(name)
    };
    let laws = laws.map(|laws| laws.into_iter().map(&mut name).collect::<PyResult<Vec<_>>>()).transpose()?;
    let options = tautline::compare::Options { laws, shield, runs, seed, external: in_python };
    study(py, scenario, None, options, outputs)
}

/// Searches for the two values of a key between which a verdict turns.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
pub(crate) fn margin(
    py: Python<'_>,
    scenario: &Scenario,
    law: Option<&Bound<'_, PyAny>>,
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
    study(py, scenario, law, options, outputs)
}

/// Flies a grid over one key or two.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
pub(crate) fn sweep(
    py: Python<'_>,
    scenario: &Scenario,
    law: Option<&Bound<'_, PyAny>>,
    keys: Vec<(String, Vec<f64>)>,
    runs: u64,
    seed: u64,
    verdict: String,
    outputs: Outputs,
) -> PyResult<Answer> {
    let keys = keys.into_iter().map(|(key, values)| SweptKey::new(&key, values)).collect::<Result<_, _>>();
    let (keys, question) = (keys.map_err(Failure::into_exception)?, question(verdict)?);
    study(py, scenario, law, tautline::sweep::Options { keys, question, runs, seed }, outputs)
}

/// Searches for the worst flight within bounds.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
pub(crate) fn attack(
    py: Python<'_>,
    scenario: &Scenario,
    law: Option<&Bound<'_, PyAny>>,
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
    let vary = vary.iter().map(|(key, low, high)| Bounds::new(key, *low, *high)).collect::<Result<_, _>>();
    let vary = vary.map_err(Failure::into_exception)?;
    let (start_m, velocity_m_s, apart_m) = (start, velocity, apart);
    let options = tautline::attack::Options { vary, start_m, velocity_m_s, apart_m, flights, seeds, seed, out };
    study(py, scenario, law, options, outputs)
}

/// Measures the claims of the paper and of tautline.
#[pyfunction]
pub(crate) fn validate(
    py: Python<'_>,
    out: PathBuf,
    force: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Answer> {
    let request = ValidateRequest { out, force, threads };
    let validation = answered(py, false, progress, |monitor| validate_into(&request, monitor))?;
    Ok((validation.pass, validation.headline(), validation.text(), json(validation.to_json())?))
}

/// Specification, folder and early end of a campaign, and the law in Python that flies every run.
#[derive(FromPyObject)]
pub(crate) struct CampaignPlan<'py> {
    #[pyo3(item)]
    spec: PathBuf,
    /// Text of the specification, in the place of that of the file.
    #[pyo3(item)]
    text: Option<String>,
    /// An object, or `MODULE:CLASS`.
    #[pyo3(item)]
    law: Option<Bound<'py, PyAny>>,
    #[pyo3(item)]
    out: Option<PathBuf>,
    #[pyo3(item)]
    shards: Option<u64>,
    #[pyo3(item)]
    until_width: Option<f64>,
    #[pyo3(item)]
    until_decided: Option<f64>,
}

impl CampaignPlan<'_> {
    fn request(self) -> PyResult<CampaignRequest> {
        let Self { spec, text, law, out, shards, until_width, until_decided } = self;
        let external_law = law.map(|law| match law.extract::<String>() {
            Ok(name) => load_law(law.py(), &name),
            Err(_) => external(&law, None),
        });
        Ok(CampaignRequest {
            text,
            out,
            shards,
            until_width,
            until_decided,
            external_law: external_law.transpose()?,
            ..CampaignRequest::new(spec)
        })
    }
}

/// Flies a campaign. Returns its answer and its folder.
#[pyfunction]
pub(crate) fn campaign(
    py: Python<'_>,
    plan: CampaignPlan<'_>,
    threads: Option<usize>,
    worst: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Answer, PathBuf)> {
    let request = CampaignRequest { threads, worst, ..plan.request()? };
    let has_law = request.external_law.is_some();
    let flown = answered(py, has_law, progress, |monitor| tautline::campaign::campaign(&request, &(), monitor));
    Ok((answer_of(&whole(flown?)?)?, request.folder()))
}

/// A planned campaign in a folder, with shards that any process can fly.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct CampaignFolder(Folder);

#[pymethods]
impl CampaignFolder {
    /// Opens the campaign of a folder.
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let program = Program::running().map_err(Failure::into_exception)?;
        let mut raised = None;
        // `Folder::open` calls this at most once.
        let law = std::cell::RefCell::new(&mut raised);
        let load = |name: &str| {
            name.contains(':').then(|| {
                load_law(py, name).map_err(|error| {
                    let failure = Failure::input("request/python-law", error.to_string(), "correct the module");
                    **law.borrow_mut() = Some(error);
                    failure
                })
            })
        };
        let opened = Folder::open(&path, &program, &load);
        match raised {
            Some(raised) => Err(raised),
            None => opened.map(Self).map_err(Failure::into_exception),
        }
    }

    /// Plans a campaign into its folder, or opens the campaign that is there.
    #[staticmethod]
    fn plan(plan: CampaignPlan<'_>) -> PyResult<Self> {
        plan.request()?.plan().map(Self).map_err(Failure::into_exception)
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }

    /// Name, number of runs, number of shards, and name of the external law.
    #[getter]
    fn manifest(&self) -> (&str, u64, u64, Option<&str>) {
        let manifest = self.0.campaign().manifest();
        (&manifest.name, manifest.runs, manifest.shards, manifest.external_law.as_deref())
    }

    /// Returns the shards that are not flown, in order.
    fn missing(&self, py: Python<'_>) -> PyResult<Vec<u64>> {
        let missing = py.detach(|| self.0.missing()).map_err(Failure::into_exception)?;
        Ok(missing.into_iter().map(|(shard, _)| shard).collect())
    }

    /// Returns whether the flown shards give the answer.
    fn has_answer(&self, py: Python<'_>) -> bool {
        py.detach(|| self.0.summary().is_ok())
    }

    /// Flies shards.
    fn fly(&self, py: Python<'_>, shards: Vec<u64>, threads: usize, progress: Option<Py<PyAny>>) -> PyResult<()> {
        let has_law = self.0.campaign().external_law().is_some();
        let fly = |monitor: &dyn Monitor| tautline::campaign::fly_shards(&self.0, &shards, threads, monitor);
        if answered(py, has_law, progress, fly)? { Ok(()) } else { Err(internal_error("the work was interrupted")) }
    }

    /// Merges all shards into the answer.
    fn merge(&self, py: Python<'_>, worst: usize, progress: Option<Py<PyAny>>) -> PyResult<Answer> {
        let has_law = self.0.campaign().external_law().is_some();
        let merge = |monitor: &dyn Monitor| tautline::campaign::merge(&self.0, worst, &(), monitor);
        answer_of(&whole(answered(py, has_law, progress, merge)?)?)
    }
}

/// Returns share, lower and upper bound of `count` of `of` (Clopper and Pearson, 95 %).
#[pyfunction]
pub(crate) fn proportion(count: u64, of: u64) -> (Option<f64>, f64, f64) {
    let Proportion { share, low, high, .. } = Proportion::new(count, of);
    (share, low, high)
}
