//! Converts keyword arguments of Python into parts of requests.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use tautline::audit::envelope::Quantity;
use tautline::audit::recorded::Interpolation;
use tautline::read::{self, ArrayAxis, ColumnNames, Dimensions, Duplicates, Format, MessageClock, TimeUnit};
use tautline::request::audit;

use crate::errors::{wrong_input, wrong_input_with_code};

/// Returns the value with this name. The error for an unknown name lists all names.
pub(crate) fn choice<T: Copy>(what: &str, name: Option<String>, all: &[(&str, T)]) -> PyResult<Option<T>> {
    let Some(name) = name else { return Ok(None) };
    let found = all.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    let known = || all.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", ");
    let message = || format!("{what}: unknown value '{name}' [possible values: {}]", known());
    found.map(Some).ok_or_else(|| wrong_input_with_code("request/unknown-choice", message()))
}

/// Returns all formats with their names.
fn formats() -> Vec<(&'static str, Format)> {
    Format::all().map(|format| (format.name, format)).collect()
}

fn parsed<T: std::str::FromStr<Err = String>>(what: &str, text: Option<String>) -> PyResult<Option<T>> {
    text.map(|text| text.parse()).transpose().map_err(|error| wrong_input(format!("{what}: {error}")))
}

/// Options of reading.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct ReadOptions(pub(crate) read::ReadOptions);

#[pymethods]
impl ReadOptions {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
    #[pyo3(signature = (*, format, time_unit, fps, time_scale, sort, duplicates, one_vehicle, skip_incomplete,
                        distinct, clock, scale, axes, dimensions, column, start, layout, frame, topic, origin,
                        plan_end, allow_unfinished))]
    #[allow(clippy::fn_params_excessive_bools)]
    fn new(
        format: Option<String>,
        time_unit: Option<String>,
        fps: Option<f64>,
        time_scale: Option<f64>,
        sort: bool,
        duplicates: Option<String>,
        one_vehicle: bool,
        skip_incomplete: bool,
        distinct: bool,
        clock: Option<String>,
        scale: Option<Vec<f64>>,
        axes: Option<String>,
        dimensions: Option<String>,
        column: Vec<(String, String)>,
        start: Vec<(String, [f64; 3])>,
        layout: Option<String>,
        frame: Option<String>,
        topic: Vec<String>,
        origin: Option<[f64; 3]>,
        plan_end: Option<String>,
        allow_unfinished: bool,
    ) -> PyResult<Self> {
        if [fps.is_some(), time_scale.is_some(), time_unit.is_some()].iter().filter(|is_given| **is_given).count() > 1 {
            return Err(wrong_input("time_unit, fps and time_scale: one of them is enough"));
        }
        let mut columns = ColumnNames::default();
        for (role, name) in &column {
            if !columns.set(role, name) {
                let roles = ColumnNames::ROLES.join(", ");
                return Err(wrong_input(format!("column: must be one of {roles}, got `{role}`")));
            }
        }
        let scale = match scale.as_deref() {
            None => None,
            Some(&[metres]) => Some(metres.into()),
            Some(&[x, y, z]) => Some([x, y, z].into()),
            Some(numbers) => {
                return Err(wrong_input(format!("scale: one number or three are needed, not {}", numbers.len())));
            }
        };
        let given = layout.clone().unwrap_or_default();
        let layout = layout.map(|layout| ArrayAxis::layout_of(&layout)).transpose();
        Ok(Self(read::ReadOptions {
            format: choice("format", format, &formats())?,
            time_unit: choice("time_unit", time_unit, &TimeUnit::ALL.map(|unit| (unit.name(), unit)))?,
            times_per_second: fps.or(time_scale.map(f64::recip)),
            sort,
            duplicates: choice("duplicates", duplicates, &Duplicates::ALL.map(|which| (which.name(), which)))?,
            scale,
            axes: parsed("axes", axes)?,
            dimensions: choice("dimensions", dimensions, &Dimensions::ALL.map(|of| (of.name(), of)))?,
            one_vehicle,
            skip_incomplete,
            distinct,
            clock: choice("clock", clock, &MessageClock::ALL.map(|clock| (clock.name(), clock)))?,
            starts: start.into_iter().collect(),
            columns,
            layout: layout.map_err(|error| wrong_input(format!("layout: {error}, got `{given}`")))?,
            frame,
            topics: topic,
            origin,
            plan_end: parsed("plan_end", plan_end)?,
            allow_unfinished,
            ..read::ReadOptions::default()
        }))
    }
}

/// Options of an audit.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct AuditOptions(pub(crate) audit::AuditOptions);

#[pymethods]
impl AuditOptions {
    /// Reads the keyword arguments as `tautline.toml` is read; None is an argument that is not given.
    #[new]
    #[pyo3(signature = (**options))]
    fn new(options: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut given = toml::Table::new();
        let mut files: BTreeMap<String, PathBuf> = BTreeMap::new();
        for (name, argument) in options.into_iter().flatten().filter(|(_, argument)| !argument.is_none()) {
            let name: String = name.extract()?;
            // A path need not be text.
            if ["obstacles", "fence", "plan", "config"].contains(&name.as_str()) {
                files.insert(name, argument.extract()?);
            } else {
                given.insert(name, value(&argument)?);
            }
        }
        let motion = given.get("motion").and_then(toml::Value::as_str).map(str::to_owned);
        choice("motion", motion, &Interpolation::ALL.map(|motion| (motion.name(), motion)))?;
        if let Some(toml::Value::Table(limits)) = given.get_mut("limit") {
            let keys = Quantity::NUMBERS.map(|quantity| (quantity.name(), quantity.key()));
            let by_key = std::mem::take(limits).into_iter().map(|(name, allowed)| {
                Ok((choice("limit", Some(name), &keys)?.unwrap_or_default().to_owned(), allowed))
            });
            *limits = by_key.collect::<PyResult<_>>()?;
        }
        let read = |given: toml::Table| given.try_into::<audit::AuditOptions>();
        let with_files = |options| {
            let [obstacles, fence, plan, config] =
                ["obstacles", "fence", "plan", "config"].map(|name| files.get(name).cloned());
            Self(audit::AuditOptions { obstacles, fence, plan, config, ..options })
        };
        read(given.clone()).map(with_files).map_err(|error| {
            let is_wrong = |(name, argument)| read(toml::Table::from_iter([(name, argument)])).is_err();
            let wrong = given.into_iter().find(|argument| is_wrong(argument.clone()));
            wrong_input(format!("{}: {}", wrong.unwrap_or_else(|| (String::new(), false.into())).0, error.message()))
        })
    }
}

/// Returns the value of a keyword argument.
fn value(argument: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    if let Ok(by_name) = argument.cast::<PyDict>() {
        let entries = by_name.iter().map(|(name, argument)| Ok((name.extract::<String>()?, value(&argument)?)));
        entries.collect::<PyResult<toml::Table>>().map(toml::Value::from)
    } else if let Ok(list) = argument.cast::<PyList>() {
        list.iter().map(|argument| value(&argument)).collect::<PyResult<Vec<_>>>().map(toml::Value::from)
    } else if let Ok(is_set) = argument.extract::<bool>() {
        Ok(is_set.into())
    } else if let Ok(count) = argument.extract::<i64>() {
        Ok(count.into())
    } else if let Ok(number) = argument.extract::<f64>() {
        Ok(number.into())
    } else {
        argument.extract::<String>().map(toml::Value::from)
    }
}
