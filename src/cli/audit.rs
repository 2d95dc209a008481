//! `tautline audit`: arguments, and reports on one or several recordings.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::console::{Console, Terminal};
use super::json::JsonArgument;
use super::reading::ReadArguments;
use super::run::figure_formats;
use super::{Exit, audit_formats, console};
use tautline_core::files::write_atomically;
use tautline_report::report::recorded::RecordedReport;
use tautline_report::request::outputs::NamedPath;
use tautline_report::request::{AuditOptions, AuditRequest, AuditedRecording, Failure, Monitor as _, Subject};

/// A recording of the command, with its audit or the failure.
pub(super) struct Answer {
    pub(super) recording: String,
    pub(super) audited: Result<AuditedRecording, Failure>,
}

/// Judges each recording. The exit code is the worst of all. A failure does not stop the other recordings. `command` is
/// the whole command line.
pub(super) fn audits(arguments: &AuditArguments, command: &str) -> Result<Exit, Failure> {
    let recordings = arguments.reading.recordings();
    let is_one = recordings.len() == 1;
    let refuse = |message: &str, help: &str| Err(Failure::input("usage/several-recordings", message, help));
    if !is_one && arguments.html.is_some() {
        let help = "give --join if each file holds a vehicle of one recording, or audit one at a time";
        return refuse("--html: must be given with one recording only", help);
    }
    if !is_one && arguments.proof.is_some() {
        return refuse("--proof: must be given with one recording only", "audit one at a time");
    }
    let mut asked = Vec::new();
    for paths in recordings {
        let request = arguments.request(paths, command);
        // No output may replace an input of any recording, even if the settings of a recording are wrong.
        request.check_outputs(&arguments.outputs())?;
        arguments.json.check("", true)?;
        asked.push((request.subject.name(), request.configured()));
    }
    let mut complete = asked.iter().filter_map(|(_, asked)| asked.as_ref().ok());
    complete.try_for_each(|asked| asked.check_outputs(&arguments.outputs()))?;
    // A log that the system searches for annotations contains no other lines with untrusted names.
    let quiet = arguments.quiet || arguments.annotations.is_some();
    let console = Console { data_on_stdout: arguments.json.is_piped(), quiet };
    let monitor = Terminal::that_abandons(console, "interrupted: the audit is incomplete; give the command again")?;
    let mut answers = Vec::new();
    for (recording, asked) in asked {
        if !is_one {
            monitor.say(&format!("{recording}:"));
        }
        let audited = asked.and_then(|asked| asked.judge(&monitor));
        if let (false, Err(failure)) = (is_one, &audited) {
            monitor.say(&format!("not judged: {}", failure.message()));
        }
        answers.push(Answer { recording, audited });
    }
    if !is_one {
        monitor.say(&audit_formats::counts(&answers));
    }
    write_answers(arguments, &answers, is_one, console)?;
    if let ([Answer { audited: Ok(_), .. }], Some(page), true) = (&answers[..], &arguments.html, arguments.open) {
        monitor.open_page(page);
    }
    let (judged, failures): (Vec<_>, Vec<_>) = answers.into_iter().map(|one| one.audited).partition(Result::is_ok);
    let worst = judged.iter().flatten().map(|audit| Exit::good_if(audit.is_good())).max_by_key(|exit| *exit as u8);
    match failures.into_iter().filter_map(Result::err).max_by_key(|failure| Exit::of(failure) as u8) {
        // The annotation reports the failure.
        Some(failure) if arguments.annotations.is_some() => Ok(Exit::of(&failure)),
        Some(failure) => Err(failure),
        None => Ok(worst.unwrap_or(Exit::Good)),
    }
}

/// Writes the machine-readable outputs: one report for one recording, a list with all failures for several. Every list
/// is in the order of the arguments.
fn write_answers(
    arguments: &AuditArguments,
    answers: &[Answer],
    is_one: bool,
    console: Console,
) -> Result<(), Failure> {
    match answers {
        [Answer { audited: Ok(audited), .. }] if is_one => arguments.json.write(&audited.report, console)?,
        _ if is_one => {}
        answers => arguments.json.write(&answers.iter().map(JsonAnswer::new).collect::<Vec<_>>(), console)?,
    }
    if let Some(Annotations::Github) = arguments.annotations {
        let lines = audit_formats::github(answers);
        if arguments.json.is_piped() { console::beside(&lines) } else { console::data(&lines)? }
    }
    let write = |file: &Path, bytes: &[u8]| -> Result<(), Failure> {
        write_atomically(file, bytes)?;
        console.say(&format!("wrote {}", file.display()));
        Ok(())
    };
    if let Some(file) = &arguments.events {
        write(file, &audit_formats::csv(answers, !is_one)?)?;
    }
    if let Some(file) = &arguments.junit {
        write(file, audit_formats::junit(answers)?.as_bytes())?;
    }
    if let Some(file) = &arguments.summary {
        // The steps of a job append to the same page.
        let before = if file.is_file() { std::fs::read(file).unwrap_or_default() } else { Vec::new() };
        write(file, &[before, audit_formats::markdown(answers).into_bytes()].concat())?;
    }
    Ok(())
}

/// Element of the list of several recordings.
#[derive(Serialize)]
#[serde(untagged)]
enum JsonAnswer<'a> {
    Judged(&'a RecordedReport),
    NotJudged { recording: &'a str, error: &'a str },
}

impl<'a> JsonAnswer<'a> {
    fn new(Answer { recording, audited }: &'a Answer) -> Self {
        match audited {
            Ok(audited) => Self::Judged(&audited.report),
            Err(failure) => Self::NotJudged { recording, error: failure.message() },
        }
    }
}

/// Arguments of `tautline audit`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Exit codes: 0 clear, by proof or with the assumed motion between samples; 1 violation or undecided (0 for undecided \
with --allow-undecided); 2 wrong input; 3 failure of the machine. A separation strictly below its limit is a \
violation. The limit of two vehicles is max(delta, r1 + r2).")]
pub(super) struct AuditArguments {
    #[command(flatten)]
    reading: ReadArguments,
    #[command(flatten)]
    options: AuditOptions,

    #[command(flatten, next_help_heading = "Output")]
    json: JsonArgument,
    /// Print no summary and no progress.
    #[arg(long, short)]
    quiet: bool,
    /// Write the verdict as a `JUnit` file.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write violations, undecided times and gaps as CSV.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Write a report page with figures.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Open the page in a browser.
    #[arg(long, requires = "html")]
    open: bool,
    /// Write the figures of the page into the folder NAME-figures beside NAME.html, in these formats; PDF and PNG have
    /// the width of a paper's column, 85 mm.
    #[arg(long, value_name = "FORMAT,...", value_delimiter = ',', requires = "html")]
    #[arg(value_parser = ["svg", "pdf", "png"])]
    figures: Vec<String>,
    /// Write a proof of the verdict that `check_proof.py` checks in exact arithmetic without this program; for a CSV
    /// table, a flight with each step, or curves, and most limits.
    #[arg(long, value_name = "FILE")]
    proof: Option<PathBuf>,
    /// Write a summary in Markdown, for example for the page of a job.
    #[arg(long, value_name = "FILE")]
    summary: Option<PathBuf>,
    /// Print an annotation for each recording, in the format of this CI system.
    #[arg(long, value_name = "SYSTEM")]
    annotations: Option<Annotations>,
}

/// CI system whose annotations are printed.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Annotations {
    /// GitHub Actions
    Github,
}

impl AuditArguments {
    /// Returns the request for the recording in these files. `command` repeats the request.
    fn request(&self, paths: Vec<PathBuf>, command: &str) -> AuditRequest<'static> {
        let subject = Subject::Files { paths, options: Box::new(self.reading.options()) };
        AuditRequest {
            command: command.to_owned(),
            html: self.html.clone(),
            formats: figure_formats(&self.figures),
            proof: self.proof.clone(),
            ..AuditRequest::new(subject, self.options.clone())
        }
    }

    /// Returns the output files that cover all recordings, with their options.
    fn outputs(&self) -> Vec<NamedPath<'_>> {
        let outputs = [("--events", &self.events), ("--junit", &self.junit), ("--summary", &self.summary)];
        let outputs = outputs.into_iter().filter_map(|(option, path)| Some((option.to_owned(), path.as_deref()?)));
        outputs.chain(self.json.file()).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use clap::{CommandFactory as _, FromArgMatches as _, Parser};

    use super::*;
    use tautline_audit::envelope::Quantity;
    use tautline_report::request::Silent;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        arguments: AuditArguments,
    }

    /// Files beside a recording whose times 0, 10 and 20 may be seconds or milliseconds.
    fn folder_of_guessed_times() -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        let rows = [0, 10, 20].map(|t| format!("{t},a,{t},0,5\n{t},b,{t},20,5\n"));
        for (name, content) in [
            ("guessed.csv", format!("t,id,x,y,z\n{}", rows.concat())),
            ("planned.csv", format!("t_s,id,x,y,z\n{}", rows.concat())),
            ("rest.toml", "[[obstacle]]\nname = \"o\"\nball = { radius_m = 1.0 }\nat_m = [0, 90, 0]\n".to_owned()),
            (
                "moving.toml",
                "[[obstacle]]\nname = \"o\"\nball = { radius_m = 1.0 }\npath = [[0, 0, 90, 0], [20, 9, 90, 0]]\n"
                    .to_owned(),
            ),
            ("fence.toml", "[fence]\npolygon_m = [[-99, -99], [99, -99], [99, 99], [-99, 99]]\n".to_owned()),
            ("lengths.toml", "[audit]\ndelta_m = 1.0\n".to_owned()),
            ("times.toml", "[audit]\ndelta_m = 1.0\nmax_gap_s = 20.0\n".to_owned()),
        ] {
            std::fs::write(folder.path().join(name), content).expect("written");
        }
        folder
    }

    /// Judges the recording with these arguments, in which `@` stands for the folder. Returns the code of the failure.
    fn code(folder: &Path, arguments: &[&str]) -> Result<(), String> {
        let at = folder.display().to_string();
        let recording = format!("{at}/guessed.csv");
        let arguments = arguments.iter().map(|argument| argument.replace('@', &at));
        let words = ["audit".to_owned(), recording.clone()].into_iter().chain(arguments);
        let matches = Command::command().get_matches_from(words);
        let parsed = Command::from_arg_matches(&matches).expect("valid arguments").arguments;
        let request = parsed.request(vec![PathBuf::from(recording)], "");
        let asked = request.configured().and_then(|asked| asked.judge(&Silent::default()));
        asked.map(drop).map_err(|failure| failure.code().to_owned())
    }

    /// Every option, with arguments, and whether the answer changes with the unit of time.
    const OPTIONS: &[(&str, &[&str], bool)] = &[
        ("delta", &["--delta", "1"], false),
        ("motion", &["--delta", "1", "--motion", "hold"], false),
        ("motion", &["--delta", "1", "--motion", "bounded", "--max-accel", "1"], true),
        ("max-accel", &["--delta", "1", "--motion", "bounded", "--max-accel", "a=1", "--max-accel", "b=1"], true),
        ("radius", &["--radius", "1"], false),
        ("ellipsoid", &["--ellipsoid", "1,1,2"], false),
        ("cylinder", &["--cylinder", "1,2"], false),
        ("well-clear", &["--well-clear", "do-365"], true),
        ("well-clear", &["--well-clear", "5,5,0"], false),
        ("rules", &["--delta", "1", "--rules", "none"], false),
        ("rules", &["--delta", "1", "--rules", "skybrush"], true),
        ("obstacles", &["--delta", "1", "--obstacles", "@/rest.toml"], false),
        ("obstacles", &["--delta", "1", "--obstacles", "@/moving.toml"], true),
        ("limit", &["--limit", "height=9,floor=1"], false),
        ("limit", &["--limit", "speed=2"], true),
        ("limit", &["--limit", "horizontal=2"], true),
        ("limit", &["--limit", "climb=2"], true),
        ("limit", &["--limit", "descent=2"], true),
        ("limit", &["--limit", "accel=2"], true),
        ("limit", &["--limit", "navigation-floor=2"], true),
        ("limit", &["--limit", "yaw-rate=2"], true),
        ("accel-window", &["--limit", "accel=2", "--accel-window", "1"], true),
        ("fence", &["--fence", "@/fence.toml"], false),
        ("plan", &["--plan", "@/planned.csv"], true),
        ("plan-delay", &["--plan", "@/planned.csv", "--plan-delay", "0"], true),
        ("tube", &["--plan", "@/planned.csv", "--tube", "1"], true),
        ("from", &["--delta", "1", "--from", "0"], true),
        ("until", &["--delta", "1", "--until", "20"], true),
        ("above", &["--delta", "1", "--above", "1"], false),
        ("land-on", &["--delta", "1", "--above", "1", "--land-on", "o", "--obstacles", "@/rest.toml"], false),
        ("ids", &["--delta", "1", "--ids", "a,b"], false),
        ("offset", &["--delta", "1", "--offset", "a=0.005"], true),
        ("expect-vehicles", &["--delta", "1", "--expect-vehicles", "2"], false),
        ("independent", &["--delta", "1", "--independent"], false),
        ("require-presence", &["--delta", "1", "--require-presence"], false),
        ("max-gap", &["--delta", "1", "--max-gap", "20"], true),
        ("config", &["--config", "@/lengths.toml"], false),
        ("config", &["--config", "@/times.toml"], true),
        ("no-config", &["--delta", "1", "--no-config"], false),
        ("json", &["--delta", "1", "--json"], false),
        ("quiet", &["--delta", "1", "--quiet"], false),
        ("junit", &["--delta", "1", "--junit", "@/o.xml"], false),
        ("events", &["--delta", "1", "--events", "@/o.csv"], false),
        ("html", &["--delta", "1", "--html", "@/o.html"], false),
        ("open", &["--delta", "1", "--html", "@/o.html", "--open"], false),
        ("figures", &["--delta", "1", "--html", "@/o.html", "--figures", "svg"], false),
        ("proof", &["--delta", "1", "--proof", "@/o.json"], false),
        ("summary", &["--delta", "1", "--summary", "@/o.md"], false),
        ("annotations", &["--delta", "1", "--annotations", "github"], false),
        ("allow-undecided", &["--delta", "1", "--allow-undecided"], false),
        // A given unit is no guess.
        ("time-unit", &["--limit", "speed=2", "--time-unit", "s"], false),
        ("time-scale", &["--limit", "speed=2", "--time-scale", "1"], false),
        ("fps", &["--limit", "speed=99", "--fps", "25"], false),
        ("input-format", &["--delta", "1", "--input-format", "csv"], false),
        ("join", &["--delta", "1", "--join"], false),
        ("sort", &["--delta", "1", "--sort"], false),
        ("duplicates", &["--delta", "1", "--duplicates", "first"], false),
        ("distinct", &["--delta", "1", "--distinct"], false),
        ("skip-incomplete", &["--delta", "1", "--skip-incomplete"], false),
        ("scale", &["--delta", "1", "--scale", "1"], false),
        ("axes", &["--delta", "1", "--axes", "enu"], false),
        ("column", &["--delta", "1", "--column", "t=t"], false),
    ];

    /// Options of readers that the recording of the test does not allow. None of them is a part of the question.
    const READING: [&str; 10] = [
        "one-vehicle",
        "dimensions",
        "start",
        "layout",
        "frame",
        "topic",
        "origin",
        "plan-end",
        "allow-unfinished",
        "clock",
    ];

    #[test]
    fn every_option_that_depends_on_seconds_is_refused_with_a_guessed_unit() {
        let folder = folder_of_guessed_times();
        for (option, arguments, is_timed) in OPTIONS {
            let expected = if *is_timed { Err("audit/guessed-time-unit".to_owned()) } else { Ok(()) };
            assert_eq!(code(folder.path(), arguments), expected, "--{option}: {arguments:?}");
            if *is_timed {
                let with_unit = code(folder.path(), &[*arguments, &["--time-unit", "s"]].concat());
                assert_eq!(with_unit, Ok(()), "--{option} with a unit: {arguments:?}");
            }
        }
        let listed: BTreeSet<_> = OPTIONS.iter().map(|(option, ..)| *option).chain(READING).collect();
        let command = Command::command();
        let options: BTreeSet<_> = command.get_arguments().filter_map(|argument| argument.get_long()).collect();
        let options: BTreeSet<_> = options.into_iter().filter(|option| *option != "help").collect();
        assert_eq!(listed, options, "an option without a row in OPTIONS");
        for quantity in Quantity::NUMBERS {
            let row = OPTIONS.iter().find(|(_, arguments, _)| arguments.iter().any(|of| of.contains(quantity.name())));
            assert_eq!(row.map(|(.., is_timed)| *is_timed), Some(quantity.rests_on_seconds()), "{}", quantity.name());
        }
    }
}
