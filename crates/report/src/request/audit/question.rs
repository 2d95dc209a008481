//! The question of an audit: its options, and the checks of their combination.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::super::{Failure, Monitor, outputs};
use super::{
    ConfiguredAudit, Opening, PlanQuestion, RecordedLimits, Rules, Subject, config, recording_in, rules, venue_file,
};
use crate::figures::Format as FigureFormat;
use tautline_audit::recorded::{Interpolation, Outcome, RecordedError, Settings, TimedSetting, VehicleSettings};
use tautline_core::fact::{BOUNDED, CURVES, EVERY_STEP, Fact, FactKind, HELD, RUN_AUDIT, STRAIGHT, Source};
use tautline_core::option::{
    COLUMN, ELLIPSOID, EXPECT_VEHICLES, FENCE, FRAME, FROM, HTML, IDS, LIMIT, MAX_ACCEL, MOTION, OBSTACLES, PLAN,
    PROOF, RADIUS, TIME_UNIT, TO,
};
use tautline_core::text::counted;
use tautline_core::track::{Clock as TrackClock, Item};

/// Choice of the `tautline.toml` that fills options which the request leaves open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ConfigFile {
    /// The nearest file in the recording's folder and its parents, up to the working folder.
    #[default]
    Nearest,
    /// This file.
    File(PathBuf),
    /// No file.
    None,
}

/// A recording and the question about it.
#[derive(Clone)]
pub struct AuditRequest<'a> {
    /// The recording.
    pub subject: Subject<'a>,
    /// Limits, assumed motion, window, clocks and vehicles. Obstacles and a fence from files are added to them.
    pub settings: Settings,
    /// TOML file of obstacles.
    pub obstacles: Option<PathBuf>,
    /// TOML file of a fence.
    pub fence: Option<PathBuf>,
    /// Plan that the recording is compared with.
    pub plan: Option<PlanQuestion>,
    /// Origin of limits that the request leaves open.
    pub rules: Rules,
    /// Number of vehicles that must be present.
    pub expect_vehicles: Option<usize>,
    /// Whether the samples of a recording of `tautline run` are judged without the run's audit.
    pub independent: bool,
    /// Whether an undecided verdict counts as good.
    pub allow_undecided: bool,
    /// Whether the motion is exported for drones, so that a wrong unit of time changes its speed.
    pub for_drones: bool,
    /// Choice of the `tautline.toml`. Motion in memory has no nearest file.
    pub config: ConfigFile,
    /// Command or expression that repeats the audit, for the page.
    pub command: String,
    /// Path of the page with figures.
    pub html: Option<PathBuf>,
    /// Formats of the files of figures, in the folder `NAME-figures` beside the page `NAME.html`.
    pub formats: Vec<FigureFormat>,
    /// Path of the proof, which `check_proof.py` confirms. Available for one CSV table and a safety distance alone.
    pub proof: Option<PathBuf>,
}

impl<'a> AuditRequest<'a> {
    /// Returns a request without limits.
    #[must_use]
    pub fn new(subject: Subject<'a>) -> Self {
        Self {
            subject,
            settings: Settings::default(),
            obstacles: None,
            fence: None,
            plan: None,
            rules: Rules::default(),
            expect_vehicles: None,
            independent: false,
            allow_undecided: false,
            for_drones: false,
            config: ConfigFile::default(),
            command: String::new(),
            html: None,
            formats: Vec::new(),
            proof: None,
        }
    }
}

impl<'a> AuditRequest<'a> {
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
        config::configured(request)
    }

    /// Rejects outputs of the request and `more` outputs of the caller that would overwrite an input or each other.
    ///
    /// # Errors
    /// [`Failure`] that names both files.
    pub fn check_outputs(&self, more: &[outputs::NamedPath<'_>]) -> Result<(), Failure> {
        let Self { subject, obstacles, fence, plan, html, proof, .. } = self;
        let settings = config::file_of(self);
        let mut inputs: Vec<_> =
            subject.paths().iter().map(|path| ("the recording".to_owned(), path.as_path())).collect();
        inputs.extend(obstacles.as_deref().map(|path| ("the file of obstacles".to_owned(), path)));
        inputs.extend(settings.as_deref().map(|path| ("the file of settings".to_owned(), path)));
        inputs.extend(fence.as_deref().map(|path| ("the file of the fence".to_owned(), path)));
        inputs.extend(plan.as_ref().map(|plan| ("the plan".to_owned(), plan.path.as_path())));
        let own = [(HTML, html), (PROOF, proof)];
        let own = own.into_iter().filter_map(|(option, path)| Some((option.to_string(), path.as_deref()?)));
        outputs::check(&inputs, &more.iter().cloned().chain(own).collect::<Vec<_>>())
    }

    /// Returns whether a radius is given, for all vehicles or for one.
    pub(super) fn has_radius(&self) -> bool {
        self.settings.radius_m.is_some() || self.settings.vehicles.values().any(|of| of.radius_m.is_some())
    }

    /// Returns whether a largest acceleration is given, for all vehicles or for one.
    pub(super) fn has_max_accel(&self) -> bool {
        self.settings.max_accel_m_s2.is_some() || self.settings.vehicles.values().any(|of| of.max_accel_m_s2.is_some())
    }

    /// Returns whether no limit on distances is given.
    pub(super) fn is_silent(&self) -> bool {
        let settings = &self.settings;
        let has_shape = settings.ellipsoid_m.is_some() || settings.cylinder.is_some();
        settings.delta_m.is_none() && !self.has_radius() && !has_shape
    }

    /// Returns the settings with the obstacles and the fence of the files.
    pub(super) fn complete_settings(&self) -> Result<Settings, Failure> {
        if self.has_max_accel() && self.settings.motion != Some(Interpolation::Bounded) {
            let bounded = MOTION.set("bounded");
            return Err(Failure::input(
                "audit/unused-acceleration",
                format!("{MAX_ACCEL} has no effect without {bounded}"),
                format!("add {bounded}, or leave {MAX_ACCEL} out"),
            ));
        }
        if self.settings.ellipsoid_m.is_some() && self.has_radius() {
            return Err(Failure::input(
                "audit/radius-and-ellipsoid",
                format!("{RADIUS} and {ELLIPSOID} are both given"),
                "an ellipsoid has its own size: leave one of them out",
            ));
        }
        let jumps = self.settings.motion.filter(|of| matches!(of, Interpolation::Hold | Interpolation::Bounded));
        if let Some(motion) = jumps.filter(|_| self.settings.well_clear.is_some()) {
            return Err(RecordedError::WellClearMotion { motion: motion.name() }.into());
        }
        if self.settings.only.as_ref().is_some_and(BTreeSet::is_empty) {
            let help = format!("name at least one vehicle, or leave {IDS} out to judge all");
            return Err(Failure::input("audit/nothing-to-judge", format!("{IDS} names no vehicle"), help));
        }
        let limits = &self.settings.envelope.limits;
        for (k, limit) in limits.iter().enumerate() {
            if limits[..k].iter().any(|before| before.quantity == limit.quantity) {
                let message = format!("{LIMIT}: {} is given twice", limit.quantity.name());
                return Err(Failure::input("audit/limit-twice", message, "give each limit once"));
            }
        }
        self.plan.as_ref().map_or(Ok(()), PlanQuestion::check)?;
        let mut settings = self.settings.clone();
        settings.obstacles.extend(self.obstacles.as_deref().map_or(Ok(Vec::new()), venue_file::read_obstacles)?);
        if let Some(fence) = self.fence.as_deref() {
            settings.envelope.fence = Some(venue_file::read_fence(fence)?);
        }
        Ok(settings)
    }

    /// Returns the settings with the limits and obstacles of the files and of the recording.
    ///
    /// # Errors
    /// [`Failure`] if the request or a file is wrong, or the recording cannot be read.
    pub fn settings_with_limits(&self, monitor: &dyn Monitor) -> Result<Settings, Failure> {
        let mut settings = self.complete_settings()?;
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
        if let Some(expected) = self.expect_vehicles
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
        if asked < 2 && settings.obstacles.is_empty() && settings.envelope.is_empty() && self.plan.is_none() {
            let message =
                format!("{path}: {} to judge, but no second object", counted(asked as u64, "vehicle", "vehicles"));
            let help = format!(
                "judge two vehicles or more ({IDS}, {FRAME}, {} select them), or {OBSTACLES}, {LIMIT}, {FENCE}",
                COLUMN.set("id=NAME")
            );
            return Err(Failure::input("audit/nothing-to-judge", message, help));
        }
        if judged == 0 && (self.settings.from_s.is_some() || self.settings.to_s.is_some()) {
            let message = format!("{path}: no vehicle is present between {FROM} and {TO}");
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
        // Without `..`, a new part of the question does not compile until it is listed here. The files of obstacles and
        // fence, the rules and the file of settings are contained in the complete settings.
        let Self {
            subject: _,
            settings: _,
            obstacles: _,
            fence: _,
            plan,
            rules: _,
            expect_vehicles: _,
            independent: _,
            allow_undecided: _,
            for_drones,
            config: _,
            command: _,
            html: _,
            formats: _,
            // A proof is about separations, and its checker derives the unit of time itself.
            proof: _,
        } = self;
        let in_words = |TimedSetting { option, of }: TimedSetting| match (option, of) {
            (OBSTACLES, Some(name)) => format!("the path of the obstacle `{name}`"),
            (MOTION, Some(motion)) => MOTION.set(motion).to_string(),
            (option, Some(name)) => option.set(name).to_string(),
            (option, None) => option.to_string(),
        };
        let timed = for_drones.then(|| "an export for drones".to_owned()).into_iter();
        let timed = timed.chain(plan.is_some().then(|| PLAN.to_string()));
        timed.chain(settings.rests_on_seconds().into_iter().map(in_words)).collect()
    }

    /// Returns the motion between samples, for a recording of curves or of `tautline run`, and its bounds.
    fn motion(&self, curves: bool, holds_every_step: bool, is_by_run: bool) -> Vec<Fact> {
        let motion = |source, name| Fact::name(FactKind::Motion, source, name);
        let straight = if self.settings.motion.is_some() { Source::Declared } else { Source::Default };
        let mut facts = vec![match self.settings.motion {
            Some(Interpolation::Hold) => motion(Source::Declared, HELD),
            Some(Interpolation::Bounded) => motion(Source::Declared, BOUNDED),
            _ if curves => motion(Source::Recorded, CURVES),
            _ if is_by_run => motion(Source::Proved, RUN_AUDIT),
            _ if holds_every_step => motion(Source::Recorded, EVERY_STEP),
            _ => motion(straight, STRAIGHT),
        }];
        if self.settings.motion == Some(Interpolation::Bounded) {
            let bound = |most_m_s2| Fact::number(FactKind::Acceleration, Source::Declared, most_m_s2, "m/s^2");
            facts.extend(self.settings.max_accel_m_s2.map(bound));
            let of_vehicle =
                |(name, vehicle): (&String, &VehicleSettings)| Some(bound(vehicle.max_accel_m_s2?).about(name));
            facts.extend(self.settings.vehicles.iter().filter_map(of_vehicle));
        }
        facts
    }

    /// Returns the facts that come from the request: motion, exemptions, file of settings.
    pub(super) fn facts(
        &self,
        [curves, holds_every_step, is_by_run, is_unaltered]: [bool; 4],
        outcome: &Outcome,
        settings_file: Option<&str>,
    ) -> Vec<Fact> {
        let mut facts = self.motion(curves, holds_every_step, is_by_run);
        if is_by_run && (!outcome.envelope.limits.is_empty() || outcome.well_clear.is_some()) {
            facts.push(Fact::name(FactKind::Motion, Source::Default, STRAIGHT).about("limits and well clear"));
        }
        if !curves {
            facts.push(match self.settings.max_gap_s {
                Some(gap_s) if gap_s.is_finite() => Fact::number(FactKind::LongestGap, Source::Declared, gap_s, "s"),
                Some(_) => Fact::name(FactKind::LongestGap, Source::Declared, "all samples are joined"),
                None if is_unaltered => {
                    Fact::name(FactKind::LongestGap, Source::Recorded, "every vehicle in each sample")
                }
                None => Fact::name(FactKind::LongestGap, Source::Default, "1.5 times a vehicle's usual interval"),
            });
        }
        if let Some((above_m, exempt)) = self.settings.above_m.zip(outcome.exempt) {
            facts.push(Fact::number(FactKind::GroundExemption, Source::Declared, above_m, "m"));
            facts.push(Fact::number(FactKind::GroundExemption, Source::Observed, exempt.pairs_s, "s"));
            let landed_on = &self.settings.land_on;
            facts.extend(landed_on.iter().map(|name| Fact::name(FactKind::LandingExemption, Source::Declared, name)));
            let landed_s = (!landed_on.is_empty()).then_some(exempt.vehicles_s);
            facts.extend(landed_s.map(|s| Fact::number(FactKind::LandingExemption, Source::Observed, s, "s")));
        }
        facts.extend(settings_file.map(|file| Fact::name(FactKind::SettingsFile, Source::Declared, file)));
        facts
    }
}
