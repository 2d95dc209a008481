//! The question of an audit: its parts, and the facts that come from it.

use std::path::PathBuf;

use super::super::{Failure, Monitor, outputs};
use super::{AuditOptions, ConfiguredAudit, Opening, RecordedLimits, Subject, config, recording_in, rules};
use crate::figures::Format as FigureFormat;
use tautline_audit::recorded::{Interpolation, Outcome, Settings, TimedSetting, VehicleSettings};
use tautline_core::fact::{BOUNDED, CURVES, EVERY_STEP, Fact, FactKind, HELD, RUN_AUDIT, STRAIGHT, Source};
use tautline_core::option::{
    COLUMN, EXPECT_VEHICLES, FENCE, FRAME, FROM, HTML, IDS, LIMIT, MOTION, OBSTACLES, PLAN, PROOF, TIME_UNIT, UNTIL,
};
use tautline_core::text::counted;
use tautline_core::track::{Clock as TrackClock, Item};

/// A recording and the question about it.
#[derive(Clone)]
pub struct AuditRequest<'a> {
    /// The recording.
    pub subject: Subject<'a>,
    /// Limits, assumed motion, window, clocks and vehicles.
    pub options: AuditOptions,
    /// Whether the motion is exported for drones, so that a wrong unit of time changes its speed.
    pub for_drones: bool,
    /// Command or expression that repeats the audit, for the page.
    pub command: String,
    /// Path of the page with figures.
    pub html: Option<PathBuf>,
    /// Formats of the files of figures, in the folder `NAME-figures` beside the page `NAME.html`.
    pub formats: Vec<FigureFormat>,
    /// Path of the proof, which `check_proof.py` confirms. Available for a CSV table, a flight with each step and
    /// curves, and for most limits.
    pub proof: Option<PathBuf>,
}

impl<'a> AuditRequest<'a> {
    /// Returns a request without outputs.
    #[must_use]
    pub fn new(subject: Subject<'a>, options: AuditOptions) -> Self {
        Self {
            subject,
            options,
            for_drones: false,
            command: String::new(),
            html: None,
            formats: Vec::new(),
            proof: None,
        }
    }

    /// Fills options that are left open from the `tautline.toml`.
    ///
    /// # Errors
    /// [`Failure`] if that file is wrong.
    pub fn configured(&self) -> Result<ConfiguredAudit<'a>, Failure> {
        let mut request = self.clone();
        if let Subject::Files { paths, .. } = &mut request.subject {
            for path in paths {
                *path = recording_in(path);
            }
        }
        let mut audit = config::configured(request)?;
        if let Subject::Files { options, .. } = &mut audit.request.subject {
            let AuditOptions { axes, scale, layout, .. } = &audit.request.options;
            options.axes = options.axes.or(*axes);
            options.scale = options.scale.or(*scale);
            options.usual_layout = options.usual_layout.or(*layout);
        }
        Ok(audit)
    }

    /// Rejects outputs of the request and `more` outputs of the caller that would overwrite an input or each other, or
    /// that cannot be written.
    ///
    /// # Errors
    /// [`Failure`] that names the file, and the one that it would overwrite.
    pub fn check_outputs(&self, more: &[outputs::NamedPath<'_>]) -> Result<(), Failure> {
        let Self { subject, options: AuditOptions { obstacles, fence, plan, .. }, html, proof, .. } = self;
        let settings = config::file_of(self);
        let mut inputs: Vec<_> =
            subject.paths().iter().map(|path| ("the recording".to_owned(), path.as_path())).collect();
        inputs.extend(obstacles.as_deref().map(|path| ("the file of obstacles".to_owned(), path)));
        inputs.extend(settings.as_deref().map(|path| ("the file of settings".to_owned(), path)));
        inputs.extend(fence.as_deref().map(|path| ("the file of the fence".to_owned(), path)));
        inputs.extend(plan.as_deref().map(|path| ("the plan".to_owned(), path)));
        let own = [(HTML, html), (PROOF, proof)];
        let own = own.into_iter().filter_map(|(option, path)| Some((option.to_string(), path.as_deref()?)));
        let outputs: Vec<_> = more.iter().cloned().chain(own).collect();
        outputs::check(&inputs, &outputs)?;
        outputs.iter().try_for_each(|(option, file)| outputs::check_in_folder(option, file))
    }

    /// Returns the settings with the limits and obstacles of the files and of the recording.
    ///
    /// # Errors
    /// [`Failure`] if the request or a file is wrong, or the recording cannot be read.
    pub fn settings_with_limits(&self, monitor: &dyn Monitor) -> Result<Settings, Failure> {
        let mut settings = self.options.settings()?;
        let (own, show) = self.subject.own(monitor)?;
        rules::fill(&mut settings, self, show.as_ref())?;
        let side_obstacles = settings.obstacles.len();
        RecordedLimits::fill(&mut settings, self, own.as_ref());
        if side_obstacles > 0 {
            Opening::read(&|| self.subject.open(), monitor)?.align(&mut settings, side_obstacles)?;
        }
        Ok(settings)
    }

    /// Rejects a single vehicle without other limits, and a number of vehicles other than the expected one.
    pub(super) fn check_count(&self, outcome: &Outcome, settings: &Settings) -> Result<(), Failure> {
        let path = self.subject.name();
        let judged = outcome.presence.iter().flatten().count();
        if let Some(expected) = self.options.expect_vehicles
            && judged != expected
        {
            let message = format!("{path}: {} to judge, not {expected}", counted(judged as u64, "vehicle", "vehicles"));
            return Err(Failure::input(
                "audit/vehicle-count",
                message,
                format!("look for missing or additional vehicles, or give another {EXPECT_VEHICLES}"),
            ));
        }
        let asked =
            outcome.vehicles.iter().filter(|&name| settings.only.as_ref().is_none_or(|only| only.contains(name)));
        let asked = asked.count();
        if asked < 2 && settings.obstacles.is_empty() && settings.envelope.is_empty() && self.options.plan.is_none() {
            let message =
                format!("{path}: {} to judge, but no second object", counted(asked as u64, "vehicle", "vehicles"));
            let help = format!(
                "judge two vehicles or more ({IDS}, {FRAME}, {} select them), or {OBSTACLES}, {LIMIT}, {FENCE}",
                COLUMN.set("id=NAME")
            );
            return Err(Failure::input("audit/nothing-to-judge", message, help));
        }
        if judged == 0 && (settings.from_s.is_some() || settings.until_s.is_some()) {
            let message = format!("{path}: no vehicle is present between {FROM} and {UNTIL}");
            return Err(Failure::input(
                "audit/empty-window",
                message,
                "give a window in which the recording has vehicles",
            ));
        }
        Ok(())
    }

    /// Rejects a question that depends on seconds if the unit of time is a guess that these first items leave open.
    /// `settings` are complete.
    pub(super) fn refuse_guessed_seconds(
        &self,
        settings: &Settings,
        clock: &TrackClock,
        items: &[Item],
    ) -> Result<(), Failure> {
        let Some(other) = clock.doubt(items) else { return Ok(()) };
        let Some(timed) = self.rests_on_seconds(settings).into_iter().next() else { return Ok(()) };
        let (path, unit) = (self.subject.name(), clock.unit);
        let message = format!("{path}: the times may be in {unit} or {other}, and {timed} depends on it");
        Err(Failure::input(
            "audit/guessed-time-unit",
            message,
            format!("give {}, or {}", TIME_UNIT.set(unit), TIME_UNIT.set(other)),
        ))
    }

    /// Returns the parts of the question whose answer changes with the unit of time, in words.
    fn rests_on_seconds(&self, settings: &Settings) -> Vec<String> {
        let in_words = |TimedSetting { option, of }: TimedSetting| match (option, of) {
            (OBSTACLES, Some(name)) => format!("the path of the obstacle `{name}`"),
            (MOTION, Some(motion)) => MOTION.set(motion).to_string(),
            (option, Some(name)) => option.set(name).to_string(),
            (option, None) => option.to_string(),
        };
        let timed = self.for_drones.then(|| "an export for drones".to_owned()).into_iter();
        let timed = timed.chain(self.options.plan.as_ref().map(|_| PLAN.to_string()));
        timed.chain(settings.rests_on_seconds().into_iter().map(in_words)).collect()
    }

    /// Returns the motion between samples, for a recording of curves or of `tautline run`, and its bounds.
    fn motion(settings: &Settings, curves: bool, holds_every_step: bool, is_by_run: bool) -> Vec<Fact> {
        let motion = |source, name| Fact::name(FactKind::Motion, source, name);
        let straight = if settings.motion.is_some() { Source::Declared } else { Source::Default };
        let mut facts = vec![match settings.motion {
            Some(Interpolation::Hold) => motion(Source::Declared, HELD),
            Some(Interpolation::Bounded) => motion(Source::Declared, BOUNDED),
            _ if curves => motion(Source::Recorded, CURVES),
            _ if is_by_run => motion(Source::Proved, RUN_AUDIT),
            _ if holds_every_step => motion(Source::Recorded, EVERY_STEP),
            _ => motion(straight, STRAIGHT),
        }];
        if settings.motion == Some(Interpolation::Bounded) {
            let bound = |most_m_s2| Fact::number(FactKind::Acceleration, Source::Declared, most_m_s2, "m/s^2");
            facts.extend(settings.max_accel_m_s2.map(bound));
            let of_vehicle =
                |(name, vehicle): (&String, &VehicleSettings)| Some(bound(vehicle.max_accel_m_s2?).about(name));
            facts.extend(settings.vehicles.iter().filter_map(of_vehicle));
        }
        facts
    }

    /// Returns the facts that come from the request: motion, exemptions, file of settings.
    pub(super) fn facts(
        &self,
        settings: &Settings,
        [curves, holds_every_step, is_by_run, is_unaltered]: [bool; 4],
        outcome: &Outcome,
        settings_file: Option<&str>,
    ) -> Vec<Fact> {
        let mut facts = Self::motion(settings, curves, holds_every_step, is_by_run);
        if is_by_run && (!outcome.envelope.limits.is_empty() || outcome.well_clear.is_some()) {
            facts.push(Fact::name(FactKind::Motion, Source::Default, STRAIGHT).about("limits and well clear"));
        }
        if !curves {
            facts.push(match settings.max_gap_s {
                Some(gap_s) if gap_s.is_finite() => Fact::number(FactKind::LongestGap, Source::Declared, gap_s, "s"),
                Some(_) if is_unaltered && self.options.max_gap_s.is_none() => {
                    Fact::name(FactKind::LongestGap, Source::Recorded, "every vehicle in each sample")
                }
                Some(_) => Fact::name(FactKind::LongestGap, Source::Declared, "all samples are joined"),
                None => Fact::name(FactKind::LongestGap, Source::Default, "1.5 times a vehicle's usual interval"),
            });
        }
        if let Some((above_m, exempt)) = settings.above_m.zip(outcome.exempt) {
            facts.push(Fact::number(FactKind::GroundExemption, Source::Declared, above_m, "m"));
            facts.push(Fact::number(FactKind::GroundExemption, Source::Observed, exempt.pairs_s, "s"));
            let landed_on = &settings.land_on;
            facts.extend(landed_on.iter().map(|name| Fact::name(FactKind::LandingExemption, Source::Declared, name)));
            let landed_s = (!landed_on.is_empty()).then_some(exempt.vehicles_s);
            facts.extend(landed_s.map(|s| Fact::number(FactKind::LandingExemption, Source::Observed, s, "s")));
        }
        facts.extend(settings_file.map(|file| Fact::name(FactKind::SettingsFile, Source::Declared, file)));
        facts
    }
}
