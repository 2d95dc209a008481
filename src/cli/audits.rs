//! `tautline audit` of several recordings, one after the other.

use super::audit::{AuditArguments, audit};
use super::console::Console;
use super::{Exit, Failure};

/// Judges each recording; bad where one is.
pub(super) fn audits(arguments: &AuditArguments) -> Result<Exit, Failure> {
    let recordings = arguments.reading.recordings();
    if recordings.len() == 1 {
        return audit(arguments);
    }
    let of_one = [
        ("--json", arguments.json),
        ("--junit", arguments.junit.is_some()),
        ("--events", arguments.events.is_some()),
        ("--html", arguments.html.is_some()),
    ];
    if let Some((option, _)) = of_one.into_iter().find(|(_, given)| *given) {
        let help = "give --join if each file holds a vehicle of one recording, or audit one at a time";
        return Err(Failure::input(format!("{option} is of one recording, and several are given"), help));
    }
    let mut worst = Exit::Good;
    for reading in recordings {
        let console = Console { data_on_stdout: false, quiet: arguments.quiet };
        console.say(&format!("{}:", reading.recording.display()));
        let mut one = arguments.clone();
        one.reading = reading;
        if audit(&one)? != Exit::Good {
            worst = Exit::Bad;
        }
    }
    Ok(worst)
}
