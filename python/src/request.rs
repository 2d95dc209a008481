//! Converts keyword arguments of Python into parts of requests.

use std::path::PathBuf;

use pyo3::prelude::*;
use tautline::audit::envelope::{Envelope, Limit, Quantity};
use tautline::audit::recorded::{self, Interpolation, VehicleSettings};
use tautline::read::{self, ArrayAxis, ColumnNames, Dimensions, Duplicates, Format, MessageClock, TimeUnit};
use tautline::request::audit::PlanQuestion;
use tautline::request::audit::rules::{self, Rules};
use tautline::request::{AuditRequest, ConfigFile, Subject};

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
                        allow_unfinished))]
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
            allow_unfinished,
            ..read::ReadOptions::default()
        }))
    }
}

/// Options of an audit.
#[pyclass(frozen, module = "tautline._native")]
pub(crate) struct AuditOptions {
    settings: recorded::Settings,
    obstacles: Option<PathBuf>,
    fence: Option<PathBuf>,
    plan: Option<PlanQuestion>,
    rules: Rules,
    config: ConfigFile,
    expect_vehicles: Option<usize>,
    independent: bool,
}

/// Value of a quantity for all vehicles, and values by name.
type PerVehicleValues = (Option<f64>, Vec<(String, f64)>);

#[pymethods]
impl AuditOptions {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "one for each keyword of Python")]
    #[pyo3(signature = (*, delta, motion, max_accel, radius, ellipsoid, obstacles, limit, fence, plan, plan_delay, tube,
                        accel_window, config, cylinder, well_clear, rules, has_config, from_s, to_s, above, land_on,
                        ids, offset, expect_vehicles, max_gap, require_presence, independent))]
    fn new(
        delta: Option<f64>,
        motion: Option<String>,
        max_accel: PerVehicleValues,
        radius: PerVehicleValues,
        ellipsoid: Option<String>,
        obstacles: Option<PathBuf>,
        limit: Vec<(String, f64)>,
        fence: Option<PathBuf>,
        plan: Option<PathBuf>,
        plan_delay: Option<f64>,
        tube: Option<f64>,
        accel_window: Option<f64>,
        config: Option<PathBuf>,
        cylinder: Option<String>,
        well_clear: Option<String>,
        rules: Option<String>,
        has_config: bool,
        from_s: Option<f64>,
        to_s: Option<f64>,
        above: Option<f64>,
        land_on: Vec<String>,
        ids: Option<Vec<String>>,
        offset: Vec<(String, f64)>,
        expect_vehicles: Option<usize>,
        max_gap: Option<f64>,
        require_presence: bool,
        independent: bool,
    ) -> PyResult<Self> {
        let motions = Interpolation::ALL.map(|motion| (motion.name(), motion));
        let mut settings = recorded::Settings {
            delta_m: delta,
            motion: choice("motion", motion, &motions)?,
            max_accel_m_s2: max_accel.0,
            radius_m: radius.0,
            ellipsoid_m: parsed_by("ellipsoid", ellipsoid, rules::ellipsoid)?,
            cylinder: parsed_by("cylinder", cylinder, rules::cylinder)?,
            well_clear: parsed_by("well_clear", well_clear, rules::well_clear)?,
            from_s,
            to_s,
            above_m: above,
            land_on: land_on.into_iter().collect(),
            max_gap_s: max_gap,
            require_presence,
            accel_window_s: accel_window,
            only: ids.map(|names| names.into_iter().collect()),
            ..recorded::Settings::default()
        };
        let mut of = |name: String, set: &dyn Fn(&mut VehicleSettings)| set(settings.vehicles.entry(name).or_default());
        for (name, value) in max_accel.1 {
            of(name, &|of| of.max_accel_m_s2 = Some(value));
        }
        for (name, value) in radius.1 {
            of(name, &|of| of.radius_m = Some(value));
        }
        for (name, value) in offset {
            of(name, &|of| of.offset_s = value);
        }
        let quantities = Quantity::NUMBERS.map(|quantity| (quantity.name(), quantity));
        let mut limits = Vec::new();
        for (name, allowed) in limit {
            let quantity = choice("limit", Some(name), &quantities)?;
            limits.extend(quantity.map(|quantity| Limit { quantity, allowed }));
        }
        settings.envelope = Envelope { limits, fence: None };
        let config = match (config, has_config) {
            (Some(path), _) => ConfigFile::File(path),
            (None, true) => ConfigFile::Nearest,
            (None, false) => ConfigFile::None,
        };
        let plan = plan.map(|path| PlanQuestion { path, delay_s: plan_delay, tube_m: tube });
        let rules = parsed::<Rules>("rules", rules)?.unwrap_or_default();
        Ok(Self { settings, obstacles, fence, plan, rules, config, expect_vehicles, independent })
    }
}

/// Parses an argument with a function; the error names the argument.
fn parsed_by<T>(name: &str, text: Option<String>, parse: fn(&str) -> Result<T, String>) -> PyResult<Option<T>> {
    text.map(|text| parse(&text)).transpose().map_err(|error| wrong_input(format!("{name}: {error}")))
}

impl AuditOptions {
    /// Returns the request for an audit. `command` is the call that repeats it.
    pub(crate) fn request<'a>(&self, subject: Subject<'a>, command: &str, html: Option<PathBuf>) -> AuditRequest<'a> {
        AuditRequest {
            settings: self.settings.clone(),
            obstacles: self.obstacles.clone(),
            fence: self.fence.clone(),
            plan: self.plan.clone(),
            rules: self.rules,
            expect_vehicles: self.expect_vehicles,
            independent: self.independent,
            config: self.config.clone(),
            command: command.to_owned(),
            html,
            ..AuditRequest::new(subject)
        }
    }
}
