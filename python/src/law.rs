//! Control laws in Python.

use std::cell::RefCell;
use std::sync::Arc;

use numpy::ndarray::Ix2;
use numpy::{PyArray1, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::intern;
use pyo3::prelude::*;
use tautline::law::{Capabilities, Controls, Law, LawError};
use tautline::observation;
use tautline::scenario::{ExternalLaw, Scenario};
use tautline::swarm::Rows;

use crate::errors::{wrong_input, wrong_type};
use crate::history::Call;
use crate::numbers::{borrowed, shape_text};
use crate::observation::Observation;

/// A law that calls the method `control(obs, out)` of an object.
///
/// Clones share the object: its state belongs to no simulation and is not saved.
#[derive(Clone)]
pub(crate) struct PythonLaw {
    name: String,
    sensing_range_m: Option<f64>,
    controls: Controls,
    control: Arc<Py<PyAny>>,
    /// Commands of a saved flight, which are repeated before the object is called.
    repeated: Arc<Vec<Call>>,
    /// Number of repeated commands.
    next: usize,
}

thread_local! {
    /// Exception of a law within the innermost [`catch_exception`] of this thread.
    static RAISED: RefCell<Option<PyErr>> = const { RefCell::new(None) };
    /// Calls of a law within the innermost [`record_calls`] of this thread.
    static CALLS: RefCell<Option<Vec<Call>>> = const { RefCell::new(None) };
}

/// Runs work that calls laws on this thread. Returns its result and the exception that a law raised.
///
/// A law runs on the calling thread ([`Capabilities::requires_calling_thread`]), so its exception cannot reach another
/// simulation. Calls may be nested, because a law may step another simulation.
pub(crate) fn catch_exception<T>(work: impl FnOnce() -> T) -> (T, Option<PyErr>) {
    let outer = RAISED.take();
    let done = work();
    (done, RAISED.replace(outer))
}

/// Runs work that calls a law on this thread. Returns its result and the calls of the law.
pub(crate) fn record_calls<T>(work: impl FnOnce() -> T) -> (T, Vec<Call>) {
    let outer = CALLS.replace(Some(Vec::new()));
    let done = work();
    (done, CALLS.replace(outer).unwrap_or_default())
}

impl PythonLaw {
    /// Returns the law, which repeats the calls of a saved flight first.
    pub(crate) fn repeating(self, calls: Vec<Call>) -> Self {
        Self { repeated: Arc::new(calls), next: 0, ..self }
    }

    /// Wraps an object with a method `control` and optional attributes `name`, `sensing_range_m` and `reaches`.
    pub(crate) fn new(object: &Bound<'_, PyAny>, scenario: Option<&Scenario>) -> PyResult<Self> {
        let py = object.py();
        let control = object.getattr_opt(intern!(py, "control"))?.filter(PyAnyMethods::is_callable);
        let Some(control) = control else {
            let kind = object.get_type().qualname()?;
            return Err(wrong_type(format!("law: {kind} has no method control(obs, out)")));
        };
        let given = |name: &str| PyResult::Ok(object.getattr_opt(name)?.filter(|value| !value.is_none()));
        let name = match given("name")? {
            Some(name) => name.extract::<String>()?,
            None => object.get_type().qualname()?.to_string(),
        };
        if scenario.is_some_and(|scenario| scenario.law().is_ok_and(|own| own.name() == name)) {
            return Err(wrong_input(format!(
                "law: `{name}` is the name of the scenario's own law; give it another `name`"
            )));
        }
        let sensing_range_m = given("sensing_range_m")?.map(|range| range.extract::<f64>()).transpose()?;
        if let Some(range_m) = sensing_range_m.filter(|range_m| !(range_m.is_finite() && *range_m > 0.0)) {
            return Err(wrong_input(format!(
                "law: sensing_range_m is {range_m}; it must be a positive number of metres"
            )));
        }
        let controls = match given("reaches")?.map(|reaches| reaches.extract::<String>()).transpose()?.as_deref() {
            None | Some("displacements") => Controls::Displacements,
            Some("distances") => Controls::Distances,
            Some("places") => Controls::Places,
            Some(other) => {
                let message = format!("law: reaches is `{other}`; it is `places`, `displacements` or `distances`");
                return Err(wrong_input(message));
            }
        };
        let (control, repeated) = (Arc::new(control.unbind()), Arc::default());
        Ok(Self { name, sensing_range_m, controls, control, repeated, next: 0 })
    }

    fn call(&self, py: Python<'_>, at: &observation::Observation<'_>, command: &mut Rows) -> PyResult<()> {
        let count = at.own.count();
        let out = PyArray1::from_vec(py, vec![f64::NAN; 3 * count]).reshape([count, 3])?;
        let seen = Observation::new(py, at, self.sensing_range_m.is_some())?;
        let returned = self.control.bind(py).call1((seen, &out))?;
        if !returned.is_none() {
            let kind = returned.get_type().qualname()?;
            return Err(wrong_type(format!("control() writes into `out` (out[:] = ...) and returns None, not {kind}")));
        }
        let written = borrowed::<Ix2>(out.as_any(), "out", "(N, 3)")?;
        if written.shape() != [count, 3] {
            return Err(wrong_input(format!(
                "out: must keep its shape ({count}, 3), got {}",
                shape_text(written.shape())
            )));
        }
        let written = written.as_array();
        command.iter_mut().enumerate().for_each(|(k, x)| *x = written[(k % count, k / count)]);
        Ok(())
    }
}

/// Returns the law that a name `MODULE:CLASS` imports. Every flight gets a new object.
pub(crate) fn load_law(py: Python<'_>, name: &str) -> PyResult<ExternalLaw> {
    let (make, sha256) =
        py.import("tautline._law")?.call_method1("import_law", (name,))?.extract::<(Py<PyAny>, String)>()?;
    let named = {
        let name = name.to_owned();
        move |py: Python<'_>| {
            PyResult::Ok(PythonLaw { name: name.clone(), ..PythonLaw::new(&make.call0(py)?.into_bound(py), None)? })
        }
    };
    let first = named(py)?;
    let failing = first.clone();
    let make = move || -> Box<dyn Law> {
        Python::attach(|py| match named(py) {
            Ok(law) => Box::new(law),
            Err(raised) => {
                RAISED.set(Some(raised));
                // Each of its commands fails.
                Box::new(failing.clone().repeating(vec![None]))
            }
        })
    };
    Ok(ExternalLaw::new(first).from_source(sha256, make))
}

impl Law for PythonLaw {
    fn name(&self) -> &str {
        &self.name
    }

    fn command(&mut self, at: &observation::Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        let commanded = match self.repeated.get(self.next) {
            Some(Some(repeated)) => {
                command.copy_from(repeated);
                Ok(())
            }
            Some(None) => Err(LawError::Failed),
            None => {
                // A law in Python may step another simulation, whose calls are not those of this one.
                let outer = CALLS.take();
                let called = Python::attach(|py| self.call(py, at, command));
                CALLS.set(outer);
                called.map_err(|raised| {
                    RAISED.set(Some(raised));
                    LawError::Failed
                })
            }
        };
        self.next = self.next.saturating_add(1);
        CALLS.with_borrow_mut(|calls| {
            if let Some(calls) = calls {
                calls.push(commanded.is_ok().then(|| Arc::new(command.clone())));
            }
        });
        commanded
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            sensing_range_m: self.sensing_range_m,
            requires_calling_thread: true,
            controls: self.controls,
            ..Capabilities::default()
        }
    }
}
