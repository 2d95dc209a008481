//! What was found in recordings, for the pages of continuous integration.

use std::fmt::Write as _;

use tautline_core::text::{at_least, counted, fixed};
use tautline_report::report::Status;
use tautline_report::request::{Audited, Failure};

/// A summary in Markdown: a row for each recording, and behind it what was found of each that is not clear.
pub(super) fn markdown(judged: &[Audited], failures: &[(String, Failure)]) -> String {
    let mut text =
        "## tautline audit\n\n| recording | verdict | closest | who | at |\n| --- | --- | --- | --- | --- |\n"
            .to_owned();
    for Audited { report, .. } in judged {
        let closest = report.closest.first();
        let unit = if report.measure == "metres" { "m" } else { "ellipsoids" };
        let cells = [
            plain(&report.source.recording),
            format!("{} {}", mark(report.status), plain(&report.verdict())),
            closest.map_or(String::new(), |of| format!("{} {unit}", at_least(of.finding.lower_m, 3))),
            closest.map_or(String::new(), |of| plain(&of.who.join(" and "))),
            closest.map_or(String::new(), |of| format!("{} s", fixed(of.finding.time_s, 2))),
        ];
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {} |", cells.join(" | "));
    }
    for (recording, failure) in failures {
        let _ = writeln!(text, "| {} | \u{274c} not judged: {} | | | |", plain(recording), plain(&failure.in_words()));
    }
    for Audited { report, .. } in judged {
        let notes = report.source.notes.iter().map(|note| format!("note: {note}\n"));
        let (headline, found) = (report.headline(), report.text() + &notes.collect::<String>());
        let fence = "`".repeat(longest_run(&headline).max(longest_run(&found)).max(2) + 1);
        let open = if report.status == Status::Clear { "" } else { " open" };
        let _ = write!(
            text,
            "\n<details{open}><summary>{}</summary>\n\n{fence}text\n{headline}\n{found}{fence}\n\n</details>\n",
            plain(&report.source.recording)
        );
    }
    text
}

/// A line for each recording, in the words of GitHub Actions.
pub(super) fn github(judged: &[Audited], failures: &[(String, Failure)]) -> String {
    let mut text = String::new();
    let mut line = |level: &str, recording: &str, title: &str, message: &str| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "::{level} file={},title={}::{}", property(recording), property(title), data(message));
    };
    for Audited { report, allows_undecided, asked_by } in judged {
        let level = match report.status {
            Status::Clear => "notice",
            Status::Undecided if *allows_undecided => "warning",
            Status::Undecided | Status::Violation => "error",
        };
        let asked = asked_by.iter().map(|asked| format!("; {asked}"));
        line(level, &report.source.recording, &report.verdict(), &(report.headline() + &asked.collect::<String>()));
    }
    for (recording, failure) in failures {
        line("error", recording, "not judged", &failure.in_words());
    }
    text
}

/// How many recordings got which verdict, in one line.
pub(super) fn counts(judged: &[Audited], failures: usize) -> String {
    let of = |status: Status| judged.iter().filter(|of| of.report.status == status).count() as u64;
    let mut parts = vec![
        counted(of(Status::Clear), "recording clear", "recordings clear"),
        counted(of(Status::Violation), "violation", "violations"),
        format!("{} undecided", of(Status::Undecided)),
    ];
    parts.extend((failures > 0).then(|| format!("{failures} not judged")));
    parts.join(", ")
}

fn mark(status: Status) -> &'static str {
    match status {
        Status::Clear => "\u{2705}",
        Status::Violation => "\u{274c}",
        Status::Undecided => "\u{2753}",
    }
}

/// Foreign text in Markdown, where it means nothing.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => plain.push_str("&amp;"),
            '<' => plain.push_str("&lt;"),
            '>' => plain.push_str("&gt;"),
            c if c.is_control() => plain.push(' '),
            '|' | '`' | '*' | '_' | '[' | ']' | '\\' | '~' | '#' | '!' | '$' | '@' => {
                plain.push('\\');
                plain.push(c);
            }
            c => plain.push(c),
        }
    }
    plain
}

fn longest_run(text: &str) -> usize {
    text.split(|c| c != '`').map(str::len).max().unwrap_or(0)
}

/// Foreign text in a line for the runner: neither an end of the line nor a mark of its older lines, which count anywhere.
fn data(text: &str) -> String {
    let text = text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A").replace("##[", "# #[");
    text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_text_means_nothing() {
        assert_eq!(plain("a|b<script>`x`\n[l](u)"), "a\\|b&lt;script&gt;\\`x\\` \\[l\\](u)");
        assert_eq!(property("a,b:c%\n::error::"), "a%2Cb%3Ac%25%0A%3A%3Aerror%3A%3A");
        assert_eq!(data("\u{1b}[31m##[error]x"), "\u{fffd}[31m# #[error]x");
        assert_eq!((longest_run("a```b``"), longest_run("")), (3, 0));
        let failures =
            [("x\n::error::y.csv".to_owned(), Failure::input("recording/not-found", "no\nsuch file", "look"))];
        assert_eq!(github(&[], &failures).lines().count(), 1);
        assert!(markdown(&[], &failures).contains("not judged: no such file (look)"));
    }
}
