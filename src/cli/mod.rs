//! Command line: one file for each command or group of commands. Only this module prints.
//!
//! All commands have the same exit codes: 0 good, 1 bad, 2 wrong input, 3 failure of the machine, 130 interrupted. An
//! interrupted flight or study is bad. Text goes to standard output, or to standard error if standard output carries
//! data.

mod audit;
mod audit_formats;
mod campaign;
mod completions;
mod console;
mod doctor;
#[cfg(feature = "viewer")]
mod drawing;
mod export;
mod hints;
mod json;
mod list;
mod new;
mod reading;
#[cfg(feature = "viewer")]
mod render;
mod run;
mod studies;
mod validate;
#[cfg(feature = "viewer")]
mod view;
mod watch;

use std::ffi::OsString;
use std::fmt::{self, Formatter};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Once;

use clap::{ColorChoice, CommandFactory as _, Parser, Subcommand};

use console::Exit;
use tautline_core::option::{Opt, spell_with};
use tautline_recordings::read;
use tautline_report::request::{Failure, command_line};
use tautline_studies::campaign::LoadLaw;

/// Runs the program with the arguments of the process.
#[must_use]
pub fn main() -> ExitCode {
    entry(&std::env::args_os().collect::<Vec<_>>()).into()
}

/// Runs the program with arguments, beginning with its own name, and returns the exit code.
#[must_use]
pub fn entry(arguments: &[OsString]) -> u8 {
    entry_with(arguments, &|_| None)
}

/// Runs the program as [`entry`]. `load` loads external laws of campaigns by their names.
#[must_use]
pub fn entry_with(arguments: &[OsString], load: &LoadLaw<'_>) -> u8 {
    quiet_guarded_panics();
    spell_with(as_argument);
    if completions::answer(arguments) {
        return Exit::Good as u8;
    }
    let words: Vec<_> = arguments.iter().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    let line = command_line(words.iter().map(String::as_str));
    console::set_colours(&words);
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(usage) => {
            let usage = hints::with_hints(usage, &Arguments::command(), &words);
            console::usage(&usage);
            return if usage.use_stderr() { Exit::WrongInput } else { Exit::Good } as u8;
        }
    };
    let Some(command) = arguments.command else {
        console::help(&Arguments::command().render_help());
        return Exit::Good as u8;
    };
    if let (Command::Audit(_), Some(file)) = (&command, hints::behind_json(&words))
        && !Path::new(file).exists()
    {
        let message = format!("--json: `{file}` is read as a recording, and does not exist");
        return console::show(&Failure::input("usage/json-file", message, hints::equals_sign_before(file))) as u8;
    }
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    if match &command {
        Command::Run(run) => run.draws(),
        Command::Compare(compare) => compare.draws(),
        Command::Attack(attack) => attack.draws(),
        other => {
            matches!(other, Command::Campaign(_) | Command::Render(_) | Command::View(_) | Command::Doctor(_))
        }
    } {
        drawing::silence_driver();
    }
    dispatch(command, &line, load).unwrap_or_else(|failure| console::show(&failure)) as u8
}

/// Fly formations of vehicles in a rigid-body engine and prove that no two come too close.
///
/// Begin with `tautline run`, which flies a built-in scenario, or with `tautline audit RECORDING --delta METRES`.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "\
Exit codes:
  0    Good.
  1    Bad, such as a violation, or an interrupted flight or study.
  2    Wrong input.
  3    Failure of the machine.
  130  Ctrl-C in any other command.

Environment:
  NO_COLOR=1        No colours, also on a terminal.
  CLICOLOR_FORCE=1  Colours, also in files and pipes; 0 is the default."
)]
struct Arguments {
    /// Colours: auto (on a terminal), always or never.
    // `console::set_colours` reads it before the arguments are parsed.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto", hide_default_value = true)]
    #[arg(hide_possible_values = true)]
    color: ColorChoice,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
#[expect(clippy::large_enum_variant, reason = "one value per process")]
enum Command {
    /// Fly a scenario, audit every step, and write a recording and a report.
    Run(run::RunArguments),
    /// Judge a recording of any source: clear, violation, or undecided.
    Audit(audit::AuditArguments),
    /// Watch live positions: the separation now, the time until which it is proved, and alarms.
    Watch(watch::WatchArguments),
    /// Analyse a scenario without flying it: stability, certified separation, step, traps.
    Check(run::CheckArguments),
    /// Measure every claim of tautline and of its source paper.
    Validate(validate::ValidateArguments),
    /// Compare laws on the same starts.
    Compare(studies::CompareArguments),
    /// Find the two values of a key between which a verdict turns.
    Margin(studies::MarginArguments),
    /// Fly a grid over one or two keys and show how shares and separations depend on them.
    Sweep(studies::SweepArguments),
    /// Fly many runs, on one machine or a cluster, and report shares with confidence intervals.
    Campaign(campaign::CampaignArguments),
    /// Search for the worst start, wind or loss within bounds; a search is not a proof.
    Attack(studies::AttackArguments),
    /// Convert a recording to CSV, Parquet, NPZ or MCAP without loss, or write a flight for drones and judge it.
    Export(export::ExportArguments),
    /// Draw a recording without a screen: pictures, films and contact sheets.
    #[cfg(feature = "viewer")]
    Render(render::RenderArguments),
    /// Show a recording, or a running flight of a scenario, in a window.
    #[cfg(feature = "viewer")]
    View(view::ViewArguments),
    /// List the built-in scenarios, or print one as TOML.
    List(list::ListArguments),
    /// Write a commented scenario file to start from.
    New(new::NewArguments),
    /// Print the JSON Schema of the scenario file.
    Schema,
    /// Say what this machine can do, with remedies.
    Doctor(doctor::DoctorArguments),
    /// Print a script that completes commands, scenarios and keys in a shell.
    Completions(completions::CompletionsArguments),
}

/// Writes an option as on the command line, such as `--time-unit ms`.
fn as_argument(option: Opt, value: Option<&str>, out: &mut Formatter<'_>) -> fmt::Result {
    write!(out, "--{}", option.name)?;
    value.map_or(Ok(()), |value| write!(out, " {value}"))
}

/// Silences the panic hook for panics that become errors.
fn quiet_guarded_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let speak = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            #[cfg(feature = "viewer")]
            if tautline_render::is_in_window_library() {
                std::process::exit(view::lose_display() as i32);
            }
            if !read::is_guarded() {
                speak(panic);
            }
        }));
    });
}

/// Runs a command. `line` is the whole command line, and `load` loads external laws.
fn dispatch(command: Command, line: &str, load: &LoadLaw<'_>) -> Result<Exit, Failure> {
    match command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Audit(arguments) => audit::audits(&arguments, line),
        Command::Watch(arguments) => watch::watch(&arguments),
        Command::Check(arguments) => run::check(&arguments),
        Command::Validate(arguments) => validate::validate(&arguments),
        Command::Compare(arguments) => arguments.run(),
        Command::Margin(arguments) => arguments.run(),
        Command::Sweep(arguments) => arguments.run(),
        Command::Campaign(arguments) => campaign::campaign(&arguments, load),
        Command::Attack(arguments) => arguments.run(),
        Command::Export(arguments) => export::export(&arguments),
        #[cfg(feature = "viewer")]
        Command::Render(arguments) => render::render(&arguments),
        #[cfg(feature = "viewer")]
        Command::View(arguments) => view::view(&arguments),
        Command::List(arguments) => list::list(&arguments),
        Command::Schema => list::schema(),
        Command::New(arguments) => new::new(&arguments),
        Command::Doctor(arguments) => doctor::doctor(&arguments),
        Command::Completions(arguments) => completions::completions(&arguments),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use clap::CommandFactory as _;
    use tautline_core::option;

    use super::Arguments;

    #[test]
    fn the_arguments_are_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn every_option_of_a_message_is_an_option_of_a_command() {
        fn add(command: &clap::Command, names: &mut BTreeSet<String>) {
            names.extend(command.get_arguments().filter_map(|argument| argument.get_long()).map(str::to_owned));
            command.get_subcommands().for_each(|command| add(command, names));
        }
        let mut names = BTreeSet::new();
        add(&Arguments::command(), &mut names);
        let unknown: Vec<_> = option::ALL.iter().filter(|option| !names.contains(option.name)).collect();
        assert!(unknown.is_empty(), "{unknown:?}");
    }

    #[test]
    fn options_of_readers_are_those_of_each_command_that_reads() {
        let program = Arguments::command();
        for name in ["audit", "export", "render", "view"] {
            let Some(command) = program.find_subcommand(name) else { continue };
            let names: BTreeSet<_> = command.get_arguments().filter_map(|argument| argument.get_long()).collect();
            for option in [option::FPS, option::FORMAT, option::TIME_UNIT, option::COLUMN, option::SCALE] {
                assert!(names.contains(option.name), "{name}: {option:?}");
            }
        }
    }

    #[test]
    fn an_option_means_the_same_in_all_commands() {
        fn add<'a>(
            command: &'a clap::Command,
            parent: &str,
            seen: &mut BTreeMap<&'a str, BTreeMap<String, Vec<String>>>,
        ) {
            for argument in command.get_arguments() {
                let Some(name) = argument.get_long() else { continue };
                let values = argument.get_value_names().unwrap_or_default().first().map_or("", |value| value.as_str());
                // What is written depends on the command, and so do the values of a key.
                let value = match values {
                    "DIR" | "FILE" if name == "out" => "PATH",
                    values if name == "key" => values.split_once("=FROM..TO").map_or(values, |(key, _)| key),
                    values => values,
                };
                let form = format!("{:?} {value}", argument.get_short());
                seen.entry(name).or_default().entry(form).or_default().push(format!("{parent} {}", command.get_name()));
            }
            command.get_subcommands().for_each(|below| add(below, command.get_name(), seen));
        }
        let mut command = Arguments::command();
        command.build();
        let mut seen = BTreeMap::new();
        add(&command, "", &mut seen);
        let differ: Vec<_> = seen.iter().filter(|(_, forms)| forms.len() > 1).collect();
        assert!(differ.is_empty(), "{differ:#?}");
    }
}
