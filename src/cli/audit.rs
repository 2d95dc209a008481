//! `tautline audit`: judge a recording, whoever made it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValue, TypedValueParser};
use nalgebra::Vector3;

use super::Failure;
use super::console::{self, Console};
use super::encounters;
use super::obstacles;
use super::outputs;
use super::own::OwnRecording;
use super::reading::{self, ReadArguments, one_of};
use crate::audit::recorded::{Motion, Outcome, RecordedError, Settings, TrackAuditor, VehicleSettings};
use crate::read::{self, Format, ReadOptions};
use crate::report::recorded::{Basis, Between, Clock, RecordedReport, Source};
use crate::report::write_atomically;
use crate::text::counted;
use crate::track::Item;

/// Items that are read before the first is judged: usual intervals are learnt from them.
const OPENING: usize = 65_536;

/// Arguments of `tautline audit`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Exits with 0 where nothing came too close, proved or as assumed between samples, with 1 where something did or where it \
cannot be told (unless --allow-undecided), with 2 where the input is wrong, and with 3 where the machine failed. A distance strictly \
below its limit is a violation; two vehicles must keep max(delta, r1 + r2).")]
pub(super) struct AuditArguments {
    #[command(flatten)]
    pub(super) reading: ReadArguments,
    /// Format of the recording [default: recognised by its content].
    #[arg(long, value_name = "FORMAT", value_parser = reading::format(), help_heading = "Reading")]
    format: Option<Format>,

    /// Safety distance between two centres [m], by default that of a recording of tautline; with --ellipsoid a scaled
    /// distance, by default 2.
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, help_heading = "Question")]
    delta: Option<f64>,
    /// What happens between samples [default: linear for samples, polynomial for curves].
    #[arg(long, value_name = "MOTION", value_parser = motion(), help_heading = "Question")]
    motion: Option<Motion>,
    /// Largest acceleration [m/s^2] of every vehicle, or of one, for --motion bounded; may be given several times.
    #[arg(long, value_name = "[NAME=]A", value_parser = named, allow_negative_numbers = true, help_heading = "Question")]
    max_accel: Vec<Named>,
    /// Radius [m] of every vehicle, or of one; may be given several times.
    #[arg(long, value_name = "[NAME=]R", value_parser = named, allow_negative_numbers = true, help_heading = "Question")]
    radius: Vec<Named>,
    /// Half axes [m] of an ellipsoid around each vehicle, such as its downwash; two touch at a scaled distance of 2.
    #[arg(long, value_name = "AX,AY,AZ", value_parser = axes, allow_hyphen_values = true, conflicts_with_all = ["radius", "obstacles"], help_heading = "Question")]
    ellipsoid: Option<Vector3<f64>>,
    /// TOML file of obstacles: balls, boxes, capsules, half-spaces; at rest or moving.
    #[arg(long, value_name = "FILE", help_heading = "Question")]
    obstacles: Option<PathBuf>,
    /// Judge from here on [s].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, help_heading = "Question")]
    from: Option<f64>,
    /// Judge up to here [s].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, help_heading = "Question")]
    to: Option<f64>,
    /// Leave out pairs while both are at or below this height [m].
    #[arg(long, value_name = "Z", allow_negative_numbers = true, help_heading = "Question")]
    above: Option<f64>,
    /// Judge these vehicles alone; a name with a comma in quotes. May be given several times.
    #[arg(long, value_name = "NAME,...", value_parser = listed, help_heading = "Question")]
    ids: Vec<Listed>,
    /// Add this to the times of a vehicle whose clock was off [s]; may be given several times.
    #[arg(long, value_name = "NAME=SECONDS", value_parser = offset, help_heading = "Question")]
    offset: Vec<(String, f64)>,
    /// How many vehicles there must be to judge: another number is wrong input.
    #[arg(long, value_name = "N", help_heading = "Question")]
    expect_vehicles: Option<usize>,
    /// Longest time between two samples that is no gap [s] [default: 1.5 of the vehicle's usual interval].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, help_heading = "Question")]
    max_gap: Option<f64>,

    /// Print the report as JSON on standard output, and nothing else there.
    #[arg(long, help_heading = "Answer")]
    pub(super) json: bool,
    /// Print no summary and no progress: the exit code says it.
    #[arg(long, help_heading = "Answer")]
    pub(super) quiet: bool,
    /// Write the verdict as a `JUnit` file.
    #[arg(long, value_name = "FILE", help_heading = "Answer")]
    pub(super) junit: Option<PathBuf>,
    /// Write violations, undecided times and gaps as CSV.
    #[arg(long, value_name = "FILE", help_heading = "Answer")]
    pub(super) events: Option<PathBuf>,
    /// Write a report for people, with figures.
    #[arg(long, value_name = "FILE", help_heading = "Answer")]
    pub(super) html: Option<PathBuf>,
    /// Exit with 0 where it cannot be told, too.
    #[arg(long, help_heading = "Answer")]
    pub(super) allow_undecided: bool,
}

fn motion() -> impl TypedValueParser<Value = Motion> {
    one_of(vec![
        (PossibleValue::new("linear").help("Straight lines"), Motion::Linear),
        (PossibleValue::new("hold").help("Nothing, with a jump at each sample"), Motion::Hold),
        (PossibleValue::new("polynomial").help("The recording's own curves"), Motion::Polynomial),
        (PossibleValue::new("bounded").help("Anything within the largest acceleration"), Motion::Bounded),
    ])
}

/// A number, perhaps of one vehicle alone.
type Named = (Option<String>, f64);

/// Names of vehicles.
#[derive(Clone, Debug)]
struct Listed(Vec<String>);

fn listed(text: &str) -> Result<Listed, String> {
    let mut lines = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes());
    match lines.records().next() {
        Some(Ok(names)) => Ok(Listed(names.iter().map(str::to_owned).collect())),
        Some(Err(error)) => Err(error.to_string()),
        None => Err("name at least one vehicle".to_owned()),
    }
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("`{text}` is not a number")),
    }
}

fn named(text: &str) -> Result<Named, String> {
    match text.rsplit_once('=') {
        Some((name, value)) => Ok((Some(name.to_owned()), number(value)?)),
        None => Ok((None, number(text)?)),
    }
}

fn offset(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("write NAME=SECONDS, such as cf3=-0.12")?;
    Ok((name.to_owned(), number(value)?))
}

fn axes(text: &str) -> Result<Vector3<f64>, String> {
    let numbers = text.split(',').map(number).collect::<Result<Vec<_>, _>>()?;
    let [x, y, z] = numbers[..] else { return Err("write three half axes, such as 0.125,0.125,0.375".to_owned()) };
    Ok(Vector3::new(x, y, z))
}

impl AuditArguments {
    fn settings(&self) -> Result<Settings, Failure> {
        let mut vehicles: BTreeMap<String, VehicleSettings> = BTreeMap::new();
        let (mut radius_m, mut max_accel_m_s2) = (None, None);
        for (name, value) in &self.radius {
            match name {
                Some(name) => vehicles.entry(name.clone()).or_default().radius_m = Some(*value),
                None => radius_m = Some(*value),
            }
        }
        for (name, value) in &self.max_accel {
            match name {
                Some(name) => vehicles.entry(name.clone()).or_default().max_accel_m_s2 = Some(*value),
                None => max_accel_m_s2 = Some(*value),
            }
        }
        for (name, value) in &self.offset {
            vehicles.entry(name.clone()).or_default().offset_s = *value;
        }
        if !self.max_accel.is_empty() && self.motion != Some(Motion::Bounded) {
            let help = "add --motion bounded, or leave --max-accel out";
            return Err(Failure::input("--max-accel says nothing of a motion that is known exactly", help));
        }
        let only: BTreeSet<String> = self.ids.iter().flat_map(|Listed(names)| names.iter().cloned()).collect();
        Ok(Settings {
            delta_m: self.delta,
            motion: self.motion,
            max_accel_m_s2,
            radius_m,
            ellipsoid_m: self.ellipsoid,
            is_told_scaled: false,
            from_s: self.from,
            to_s: self.to,
            above_m: self.above,
            max_gap_s: self.max_gap,
            vehicles,
            only: (!only.is_empty()).then_some(only),
            obstacles: self.obstacles.as_deref().map_or(Ok(Vec::new()), obstacles::read)?,
        })
    }

    pub(super) fn check_outputs(&self) -> Result<(), Failure> {
        let mut inputs: Vec<_> = self.reading.paths().map(|path| ("the recording", path)).collect();
        inputs.extend(self.obstacles.as_deref().map(|path| ("the file of obstacles", path)));
        let outputs = [("--events", &self.events), ("--junit", &self.junit), ("--html", &self.html)];
        let outputs: Vec<_> =
            outputs.into_iter().filter_map(|(option, path)| Some((option, path.as_deref()?))).collect();
        outputs::check(&inputs, &outputs)
    }

    /// Refuses to judge a vehicle alone, and another number of vehicles than is expected.
    fn check_count(&self, outcome: &Outcome, settings: &Settings) -> Result<(), Failure> {
        let path = self.reading.called();
        let judged = outcome.presence.iter().flatten().count();
        if let Some(expected) = self.expect_vehicles
            && judged != expected
        {
            let message = format!("{path}: {} to judge, not {expected}", counted(judged as u64, "vehicle", "vehicles"));
            return Err(Failure::input(
                message,
                "look for who is missing or too many, or give another --expect-vehicles",
            ));
        }
        let asked =
            outcome.vehicles.iter().filter(|&name| settings.only.as_ref().is_none_or(|only| only.contains(name)));
        let asked = asked.count();
        if asked < 2 && settings.obstacles.is_empty() {
            let message =
                format!("{path}: {} to judge, and nothing to keep apart", counted(asked as u64, "vehicle", "vehicles"));
            let help =
                "judge two vehicles or more (--ids, --frame, --column id=NAME say which are there), or --obstacles";
            return Err(Failure::input(message, help));
        }
        if judged == 0 && (self.from.is_some() || self.to.is_some()) {
            let message = format!("{path}: no vehicle is there between --from and --to");
            return Err(Failure::input(message, "give a window in which the recording has vehicles"));
        }
        Ok(())
    }

    /// Refuses what is asked in seconds of times whose unit is a guess: it would be proved of another recording.
    fn refuse_guessed_seconds(&self, unit: &str) -> Result<(), Failure> {
        let asked = [
            (matches!(self.motion, Some(Motion::Bounded)), "--motion bounded"),
            (self.from.is_some(), "--from"),
            (self.to.is_some(), "--to"),
            (self.max_gap.is_some(), "--max-gap"),
            (!self.offset.is_empty(), "--offset"),
        ];
        let Some((_, option)) = asked.into_iter().find(|(is_asked, _)| *is_asked) else { return Ok(()) };
        let path = self.reading.called();
        let message = format!(
            "{path}: only the steps of its whole numbers suggest that times are in {unit}, and {option} depends on it"
        );
        Err(Failure::input(message, format!("say --time-unit {unit}, or --time-unit s")))
    }

    /// What is taken to happen between samples of a recording of curves alone, or that may be ours; nothing is proved where
    /// the samples themselves are assumed.
    fn between(&self, curves: bool, own: Option<&OwnRecording>, assumed: Option<&str>) -> Between {
        let most = |accel: &[Named]| {
            let listed = accel.iter().map(|(name, a)| match name {
                Some(name) => format!("{a:?} m/s^2 for {name}"),
                None => format!("{a:?} m/s^2"),
            });
            listed.collect::<Vec<_>>().join(", ")
        };
        let (motion, basis) = match self.motion {
            Some(Motion::Hold) => ("held between samples, jumps swept".to_owned(), Basis::Assumed),
            Some(Motion::Bounded) => (format!("accelerations of at most {}", most(&self.max_accel)), Basis::Bounded),
            _ if curves => ("on the recording's curves".to_owned(), Basis::Recorded),
            _ if own.is_some_and(|own| own.has_every_step) => ("on every step of the run".to_owned(), Basis::Recorded),
            _ => ("straight between samples".to_owned(), Basis::Assumed),
        };
        match assumed {
            Some(assumed) => Between { motion: format!("{motion}, {assumed}"), basis: Basis::Assumed },
            None => Between { motion, basis },
        }
    }
}

/// Judges one recording and says so, with a page where one is asked for.
pub(super) fn judge(arguments: &AuditArguments, console: Console) -> Result<RecordedReport, Failure> {
    let mut settings = arguments.settings()?;
    let options = arguments.reading.options(arguments.format)?;
    let own = arguments.reading.own(arguments.format, options.scale);
    let is_silent = arguments.delta.is_none() && arguments.radius.is_empty() && arguments.ellipsoid.is_none();
    let own_delta_m =
        own.as_ref().map(|own| own.delta_m).or_else(|| read::own_limit_m(&arguments.reading.recording, &options));
    let own_ellipsoid_m = own.as_ref().and_then(|own| own.ellipsoid_m).filter(|_| is_silent);
    let own_delta_m = own_delta_m.filter(|_| is_silent && own_ellipsoid_m.is_none());
    settings.delta_m = settings.delta_m.or(own_delta_m);
    settings.ellipsoid_m = settings.ellipsoid_m.or(own_ellipsoid_m);
    settings.is_told_scaled = own.as_ref().is_some_and(|own| own.ellipsoid_m.is_some());
    let own_obstacles = own
        .as_ref()
        .map(|own| &own.obstacles)
        .filter(|own| arguments.obstacles.is_none() && settings.ellipsoid_m.is_none() && !own.obstacles.is_empty());
    settings.obstacles.extend(own_obstacles.iter().flat_map(|own| own.obstacles.iter().cloned()));
    let mut auditor = TrackAuditor::new(settings.clone())?;
    if arguments.html.is_some() {
        auditor = auditor.with_smallest();
    }
    own.as_ref().map_or(Ok(()), |own| own.check_told_in(settings.ellipsoid_m))?;
    own.iter().flat_map(|own| &own.told).for_each(|told| auditor.tell(*told));
    own.iter().flat_map(|own| &own.violations).for_each(|told| auditor.tell_violation(*told));
    let Judged { mut outcome, clock, mut notes, assumed, curves } = judged(auditor, arguments, &options, console)?;
    if let Some(own) = own_obstacles {
        own.bind(&mut outcome, &settings);
    }
    arguments.check_count(&outcome, &settings)?;
    let between = arguments.between(curves, own.as_ref(), assumed.as_deref());
    let offset_s = |name: &String| settings.vehicles.get(name).map_or(0.0, |of| of.offset_s);
    let clocks_agree = outcome.vehicles.windows(2).all(|pair| offset_s(&pair[0]) == offset_s(&pair[1]));
    notes.extend(own.iter().flat_map(|own| own.notes(clocks_agree)));
    notes.extend(own_delta_m.map(|m| format!("the safety distance is the recording's own, {m:?} m")));
    notes.extend(own_ellipsoid_m.map(|axes| {
        format!("the ellipsoid is the recording's own, with half axes of {:?}, {:?} and {:?} m", axes.x, axes.y, axes.z)
    }));
    if own_obstacles.is_none() && own.as_ref().is_some_and(|own| !own.obstacles.obstacles.is_empty()) {
        let why = if arguments.obstacles.is_some() {
            "--obstacles names others"
        } else {
            "they have no place among ellipsoids"
        };
        notes.push(format!("the obstacles that were flown past are not judged: {why}"));
    }
    notes.extend(own_obstacles.map(|own| {
        let names: Vec<_> = own.obstacles.iter().map(|obstacle| obstacle.name.as_str()).collect();
        format!("the obstacles are the recording's own: {}", names.join(", "))
    }));
    for note in &notes {
        console.warn(&format!("note: {note}"));
    }
    let source = Source { recording: arguments.reading.called(), clock, notes };
    let report = RecordedReport::new(&outcome, &settings, source, between);

    // The verdict first: a file that cannot be written does not cost it.
    console.say(&format!("{}\n{}", report.headline(), report.text()));
    if let Some(html) = &arguments.html {
        let figures = encounters::figures(&arguments.reading, &options, &settings, &outcome)?;
        write_atomically(html, report.to_html(&figures, &command()).as_bytes())?;
    }
    Ok(report)
}

/// A recording after it was judged.
struct Judged {
    outcome: Outcome,
    clock: Clock,
    notes: Vec<String>,
    /// What was assumed to know its samples.
    assumed: Option<String>,
    /// Whether it has curves and no samples.
    curves: bool,
}

fn judged(
    mut auditor: TrackAuditor,
    arguments: &AuditArguments,
    options: &ReadOptions,
    console: Console,
) -> Result<Judged, Failure> {
    let called = arguments.reading.called();
    let mut recording = arguments.reading.open(options)?;
    let progress = console.counter(called.clone());
    let mut items = Vec::new();
    let (mut more, mut first, mut read, mut curves) = (true, true, 0, true);
    while more {
        items.clear();
        while more && (items.is_empty() || (first && items.len() < OPENING)) {
            more = recording.read(&mut items)?;
        }
        if first && recording.clock().by_steps {
            arguments.refuse_guessed_seconds(recording.clock().unit)?;
        }
        first = false;
        curves &= items.iter().all(|item| matches!(item, Item::Piece(_)));
        auditor.push(recording.vehicles(), &items).map_err(|error| Failure::from(error).of(Path::new(&called)))?;
        read += items.len() as u64;
        progress.set_position(read);
    }
    progress.finish_and_clear();
    let clock = recording.clock();
    let clock = Clock { unit: clock.unit.to_owned(), inferred: clock.inferred, epoch_ns: clock.epoch_ns };
    let outcome = auditor.finish().map_err(|error| Failure::from(error).of(Path::new(&called)))?;
    let (notes, assumed) = (recording.notes().to_vec(), recording.assumed().map(str::to_owned));
    Ok(Judged { outcome, clock, notes, assumed, curves })
}

/// The command as it was given, for a shell.
fn command() -> String {
    let words: Vec<String> = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    console::command_line(words.iter().map(String::as_str))
}

impl From<RecordedError> for Failure {
    fn from(error: RecordedError) -> Self {
        let help = match &error {
            RecordedError::OutOfRange { .. } | RecordedError::EmptyWindow { .. } => "give another number",
            RecordedError::NoBound { .. } => "give the largest acceleration with --max-accel A or --max-accel NAME=A",
            RecordedError::NoLimit { .. } => "give --delta, or --radius NAME=R",
            RecordedError::UnknownVehicle { .. } => "name vehicles as the recording does",
            RecordedError::NotACurve { .. } => "give --motion linear, hold or bounded",
            RecordedError::NotSamples { .. } => "leave --motion out, or give --motion polynomial",
            RecordedError::RadiusChanges { .. } => "give one radius of the vehicle with --radius NAME=R",
            RecordedError::ObstaclesAndEllipsoid => {
                "judge obstacles by --delta or --radius, and ellipsoids without them"
            }
            RecordedError::Obstacle(_) => "mend the file of obstacles",
            RecordedError::Unnamed { .. }
            | RecordedError::TimeNotIncreasing { .. }
            | RecordedError::OutOfOrder { .. }
            | RecordedError::Item { .. } => {
                "mend the recording there, leave the vehicle out with --ids, or look at --offset and --time-scale"
            }
        };
        Self::input(error.to_string(), help)
    }
}
