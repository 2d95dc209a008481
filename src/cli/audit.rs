//! `tautline audit`: judge a recording, whoever made it.

use std::path::Path;
use std::sync::atomic::Ordering;

use super::Failure;
use super::audit_arguments::AuditArguments;
use super::audit_proof;
use super::caller;
use super::console::{self, Console};
use super::open::Open;
use super::own::OwnRecording;
use super::places;
use super::replays::{self, Instants};
use tautline_audit::recorded::{Outcome, Presence, RecordedError, Settings, TrackAuditor};
use tautline_core::track::Item;
use tautline_recordings::read;
use tautline_report::report::recorded::{Clock, RecordedReport, Source};
use tautline_report::report::write_atomically;

/// Items that are read before the first is judged: usual intervals are learnt from them.
const OPENING: usize = 65_536;

/// Vehicles that are never there with another and have a note of their own, at most.
const MOST_ALONE: usize = 3;

/// Judges one recording and says so, with a page where one is asked for.
pub(super) fn judge(arguments: &AuditArguments, console: Console) -> Result<RecordedReport, Failure> {
    let options = arguments.reading.options(arguments.format)?;
    let recorded = Recorded {
        own: arguments.reading.own(arguments.format, options.scale)?,
        own_limit_m: read::own_limit_m(&arguments.reading.recording, &options),
        command: console::command_line(caller::words().iter().map(String::as_str)),
        open: &|| arguments.reading.open(&options),
    };
    judge_recorded(arguments, recorded, console)
}

/// What is judged.
pub(super) struct Recorded<'a> {
    /// What it says of itself, where it is ours.
    pub(super) own: Option<OwnRecording>,
    /// How close vehicles may come, where it says that itself \[m\].
    pub(super) own_limit_m: Option<f64>,
    /// The command that judges it again, for a person.
    pub(super) command: String,
    /// Opens it, each time from its beginning.
    pub(super) open: &'a Open<'a>,
}

/// As [`judge`], of what is opened by the caller.
pub(super) fn judge_recorded(
    arguments: &AuditArguments,
    recorded: Recorded<'_>,
    console: Console,
) -> Result<RecordedReport, Failure> {
    let mut settings = arguments.settings()?;
    let Recorded { own, own_limit_m, command, open } = recorded;
    let own = if arguments.independent { own.map(OwnRecording::independent) } else { own };
    let is_silent = arguments.delta.is_none() && arguments.radius.is_empty() && arguments.ellipsoid.is_none();
    let own_delta_m = own.as_ref().map(|own| own.delta_m).or(own_limit_m);
    let own_ellipsoid_m = own.as_ref().and_then(|own| own.ellipsoid_m).filter(|_| is_silent);
    let own_delta_m = own_delta_m.filter(|_| is_silent && own_ellipsoid_m.is_none());
    settings.delta_m = settings.delta_m.or(own_delta_m);
    settings.ellipsoid_m = settings.ellipsoid_m.or(own_ellipsoid_m);
    settings.is_own_limit = is_silent && arguments.obstacles.is_none();
    // Every sample of a `tautline run` recording contains all vehicles, so no vehicle is absent between two samples.
    settings.max_gap_s = settings.max_gap_s.or(own.as_ref().filter(|own| own.has_no_gaps()).map(|_| f64::INFINITY));
    settings.is_told_scaled = own.as_ref().is_some_and(|own| own.ellipsoid_m.is_some());
    let own_obstacles = own
        .as_ref()
        .map(|own| &own.obstacles)
        .filter(|own| arguments.obstacles.is_none() && settings.ellipsoid_m.is_none() && !own.obstacles.is_empty());
    settings.obstacles.extend(own_obstacles.iter().flat_map(|own| own.obstacles.iter().cloned()));
    audit_proof::check(arguments, &settings)?;
    let mut auditor = TrackAuditor::new(settings.clone())?;
    if arguments.html.is_some() {
        auditor = auditor.with_smallest();
    }
    if let Some(flag) = caller::interruption() {
        auditor = auditor.with_interruption(flag);
    }
    own.as_ref().map_or(Ok(()), |own| own.check_told_in(settings.ellipsoid_m))?;
    own.iter().flat_map(|own| &own.told).for_each(|told| auditor.tell(*told));
    own.iter().flat_map(|own| &own.violations).for_each(|told| auditor.tell_violation(*told));
    let mut instants = arguments.html.as_ref().map(|_| Instants::default());
    let Judged { mut outcome, clock, mut notes, assumed, curves, is_planar } =
        judged(auditor, arguments, &settings, open, console, &mut |items, names| {
            if let Some(instants) = &mut instants {
                instants.note(items, names, &settings);
            }
        })?;
    if let Some(own) = own_obstacles {
        own.bind(&mut outcome, &settings);
    }
    arguments.check_count(&outcome, &settings)?;
    let own_now = own.as_ref().filter(|_| arguments.motion.is_none());
    let is_judged = own_now.is_some_and(|own| own.settle(&mut outcome, &settings, &mut notes));
    let between = arguments.between(curves, own.as_ref(), is_judged, assumed.as_deref());
    let offset_s = |name: &String| settings.vehicles.get(name).map_or(0.0, |of| of.offset_s);
    let clocks_agree = outcome.vehicles.windows(2).all(|pair| offset_s(&pair[0]) == offset_s(&pair[1]));
    notes.extend(own.iter().flat_map(|own| own.notes(clocks_agree)));
    notes.extend(own.iter().filter_map(|own| own.doubt(outcome.status)));
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
    notes.extend(outcome.alone.iter().take(MOST_ALONE).filter_map(|&vehicle| {
        let Presence { from_s, to_s } = outcome.presence[vehicle]?;
        let name = outcome.name(vehicle);
        Some(format!(
            "{name}, there from {from_s:?} s to {to_s:?} s, is never there with another: nothing is said of it (--offset \
             {name}=SECONDS sets a wrong clock right)"
        ))
    }));
    notes.extend(arguments.asked_by.clone());
    for note in &notes {
        console.warn(&format!("note: {note}"));
    }
    let source = Source { recording: arguments.reading.called(), clock, planar: is_planar, notes };
    let early_end = own.as_ref().and_then(|own| own.early_end.clone());
    // A window that ends before the recording was flown whole.
    let is_beyond = |to_s: f64| outcome.span_s.is_none_or(|(_, end_s)| to_s > end_s);
    let early_end = early_end.filter(|_| settings.to_s.is_none_or(is_beyond));
    let report = RecordedReport::new(&outcome, &settings, source, between);
    let mut report = early_end.into_iter().fold(report, RecordedReport::with_early_end);
    let shortened = report.shortened();
    for note in &shortened {
        console.warn(&format!("note: {note}"));
    }
    report.source.notes.extend(shortened);

    // The verdict first: a file that cannot be written does not cost it.
    console.say(&format!("{}\n{}", report.headline(), report.text()));
    if let Some((html, instants)) = arguments.html.as_ref().zip(instants) {
        let (replay, figures) = replays::of_recording(open, &settings, &outcome, &report, instants)?;
        write_atomically(html, report.to_html(&replay, &figures, &command).as_bytes())?;
    }
    if let Some(file) = &arguments.proof {
        let refused = audit_proof::write(file, arguments, (&settings, &outcome), &report.source.clock, open)?;
        if let Some(why) = refused {
            console.warn(&format!("note: {why}"));
        }
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
    /// Whether some height is not known.
    is_planar: bool,
}

fn judged(
    mut auditor: TrackAuditor,
    arguments: &AuditArguments,
    settings: &Settings,
    open: &Open<'_>,
    console: Console,
    note: &mut dyn FnMut(&[Item], &[String]),
) -> Result<Judged, Failure> {
    let called = arguments.reading.called();
    let mut recording = open()?;
    let is_planar = recording.is_planar();
    let level = places::refuse_unknown(arguments, settings, recording.as_ref())?;
    let interrupted = caller::interruption();
    let progress = console.counter(called.clone());
    let mut items = Vec::new();
    let (mut more, mut first, mut read, mut curves) = (true, true, 0, true);
    while more {
        if interrupted.as_ref().is_some_and(|interrupted| interrupted.load(Ordering::Relaxed)) {
            return Err(Failure::machine("interrupted"));
        }
        items.clear();
        while more && (items.is_empty() || (first && items.len() < OPENING)) {
            more = recording.read(&mut items)?;
        }
        if first && recording.clock().by_steps {
            arguments.refuse_guessed_seconds(recording.clock().unit, &items)?;
        }
        first = false;
        level.check(&called, recording.vehicles(), &items)?;
        curves &= items.iter().all(|item| matches!(item, Item::Piece(_)));
        auditor.push(recording.vehicles(), &items).map_err(|error| Failure::from(error).of(Path::new(&called)))?;
        note(&items, recording.vehicles());
        read += items.len() as u64;
        progress.set_position(read);
    }
    progress.finish_and_clear();
    let clock = recording.clock();
    let clock = Clock { unit: clock.unit.to_owned(), inferred: clock.inferred, epoch_ns: clock.epoch_ns };
    let outcome = auditor.finish().map_err(|error| Failure::from(error).of(Path::new(&called)))?;
    let (notes, assumed) = (recording.notes().to_vec(), recording.assumed().map(str::to_owned));
    Ok(Judged { outcome, clock, notes, assumed, curves, is_planar })
}

impl From<RecordedError> for Failure {
    fn from(error: RecordedError) -> Self {
        let help = match &error {
            RecordedError::Interrupted => return Self::machine("interrupted"),
            RecordedError::OutOfRange { .. } | RecordedError::EmptyWindow { .. } => "give another number",
            RecordedError::NoBound { .. } => "give the largest acceleration with --max-accel A or --max-accel NAME=A",
            RecordedError::NoLimit { .. } => "give --delta, or --radius NAME=R; or ask --limit and --fence alone",
            RecordedError::NoAccelWindow => {
                "add --limit accel=A and leave --motion bounded out, or leave --accel-window out"
            }
            RecordedError::LimitOfJumps { .. } => "give --motion linear, or bounded with --max-accel",
            RecordedError::UnknownVehicle { .. } => "name vehicles as the recording does",
            RecordedError::NotACurve { .. } => "give --motion linear, hold or bounded",
            RecordedError::NotSamples { .. } => "leave --motion out, or give --motion polynomial",
            RecordedError::RadiusChanges { .. } => "give one radius of the vehicle with --radius NAME=R",
            RecordedError::ObstaclesAndEllipsoid => {
                "judge obstacles by --delta or --radius, and ellipsoids without them"
            }
            RecordedError::Obstacle(_) => "mend the file of obstacles",
            RecordedError::TwoClocks { .. } => {
                "set a clock right with --offset NAME=SECONDS, or judge vehicles of one clock with --ids, or a time with --from"
            }
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
