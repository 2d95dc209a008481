//! Machine-readable reports of `tautline audit`: Markdown and annotations for GitHub, CSV, and `JUnit`.

use std::fmt::Write as _;

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::audit::Answer;
use tautline_core::text::{beside_limit, counted, fixed};
use tautline_report::report::Status;
use tautline_report::report::recorded::{
    LimitFindings, PairFinding, RecordedReport, VehicleFinding, WellClearFindings,
};
use tautline_report::request::{AuditedRecording, Failure};

const COLUMNS: [&str; 10] =
    ["kind", "first", "second", "from_s", "to_s", "lower_m", "upper_m", "at_s", "limit_m", "rate_hz"];

/// Returns one row for each violation, undecided time, gap and early end, in order of time. With `named`, the first
/// column is the recording.
pub(super) fn csv(answers: &[Answer], named: bool) -> Result<Vec<u8>, Failure> {
    let failed =
        |error: csv::Error| Failure::machine("files/cannot-write", format!("cannot write the events: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(named.then_some("recording").into_iter().chain(COLUMNS)).map_err(failed)?;
    for AuditedRecording { report, .. } in judged(answers) {
        let recording = named.then(|| report.source.recording.clone());
        for row in rows(report) {
            writer.write_record(recording.iter().cloned().chain(row)).map_err(failed)?;
        }
    }
    writer
        .into_inner()
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the events: {error}")))
}

/// Returns the rows of one recording.
fn rows(report: &RecordedReport) -> impl Iterator<Item = Vec<String>> {
    let violations = report.violations.iter().map(|PairFinding { who: [first, second], finding: v }| {
        let numbers = [Some(v.min_m), Some(v.min_m), Some(v.min_at_s), Some(v.limit_m), None];
        ("violation", [first.as_str(), second], [v.from_s, v.to_s], numbers)
    });
    let undecided = report.undecided.iter().map(|PairFinding { who: [first, second], finding: u }| {
        let numbers = [Some(u.lower_m), Some(u.upper_m), None, Some(u.limit_m), u.rate_hz];
        ("undecided", [first.as_str(), second], [u.from_s, u.to_s], numbers)
    });
    let gaps = report.gaps.iter().map(|VehicleFinding { vehicle, finding: gap }| {
        ("gap", [vehicle.as_str(), ""], [gap.from_s, gap.to_s], [None; 5])
    });
    let early_end =
        report.ended_early.iter().map(|end| ("ended-early", ["", ""], [end.at_s, end.duration_s], [None; 5]));
    let rows = violations.chain(undecided).chain(gaps).chain(early_end).map(|(kind, who, span_s, numbers)| {
        let words = [kind].into_iter().chain(who).map(str::to_owned);
        (span_s, words.collect::<Vec<_>>(), numbers)
    });
    let rows = rows.chain(report.limits.iter().flat_map(beyond)).chain(from_plan(report));
    let mut rows: Vec<_> = rows.chain(report.well_clear.iter().flat_map(not_well_clear)).collect();
    rows.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    rows.into_iter().map(|(span_s, words, numbers)| {
        let numbers = span_s.map(Some).into_iter().chain(numbers).map(|x| x.map_or_else(String::new, number));
        words.into_iter().chain(numbers).collect()
    })
}

/// Time span, words and numbers of a row.
type Row = ([f64; 2], Vec<String>, [Option<f64>; 5]);

/// Returns the rows of a limit of single vehicles; the name of the limit is in the column of the second vehicle.
fn beyond(limit: &LimitFindings) -> impl Iterator<Item = Row> + '_ {
    let violations = limit.violations.iter().map(|of| ("violation", of));
    let undecided = limit.undecided.iter().map(|of| ("undecided", of));
    violations.chain(undecided).map(|(kind, VehicleFinding { vehicle, finding })| {
        let words = vec![kind.to_owned(), vehicle.clone(), limit.quantity.to_owned()];
        let numbers = [Some(finding.lower), Some(finding.upper), Some(finding.at_s), Some(limit.allowed), None];
        ([finding.from_s, finding.to_s], words, numbers)
    })
}

/// Returns the rows of distances beyond the tube around the plan, and of times in which a distance is not known. The
/// second name is `plan`.
fn from_plan(report: &RecordedReport) -> impl Iterator<Item = Row> + '_ {
    report.plan.iter().flat_map(|plan| {
        let words = |kind: &str, vehicle: &str| [kind, vehicle, "plan"].map(str::to_owned).to_vec();
        let beyond = plan.vehicles.iter().filter_map(move |VehicleFinding { vehicle, finding }| {
            let kind =
                if plan.tube_m.is_some_and(|tube_m| finding.lower_m > tube_m) { "violation" } else { "undecided" };
            let numbers = [Some(finding.lower_m), Some(finding.upper_m), Some(finding.at_s), plan.tube_m, None];
            let is_beyond = plan.tube_m.is_some_and(|tube_m| finding.upper_m > tube_m);
            is_beyond.then(|| ([finding.at_s; 2], words(kind, vehicle), numbers))
        });
        let unknown = plan.unknown.iter().map(move |VehicleFinding { vehicle, finding }| {
            ([finding.from_s, finding.to_s], words("undecided", vehicle), [None, None, None, plan.tube_m, None])
        });
        beyond.chain(unknown)
    })
}

/// Returns the rows of losses of well clear, with horizontal distances.
fn not_well_clear(found: &WellClearFindings) -> impl Iterator<Item = Row> + '_ {
    let violations = found.violations.iter().map(|of| ("not-well-clear", of));
    let undecided = found.undecided.iter().map(|of| ("undecided", of));
    violations.chain(undecided).map(|(kind, PairFinding { who: [first, second], finding })| {
        let words = vec![kind.to_owned(), first.clone(), second.clone()];
        let (distance, limit) = (Some(finding.horizontal_m), Some(found.horizontal_m));
        ([finding.from_s, finding.to_s], words, [distance, distance, None, limit, None])
    })
}

/// Returns all digits of a number, with a power of ten if it is very large or small.
fn number(x: f64) -> String {
    format!("{x:?}")
}

/// Returns a suite for each recording, which is an error for a failure. Undecided results fail, or are skipped if
/// allowed.
pub(super) fn junit(answers: &[Answer]) -> Result<String, Failure> {
    let mut junit = Report::new("tautline audit");
    junit.add_test_suites(answers.iter().map(|Answer { recording, audited }| match audited {
        Ok(audited) => suite(audited),
        Err(failure) => suite_of_failure(recording, failure),
    }));
    junit
        .to_string()
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the JUnit report: {error}")))
}

fn suite_of_failure(recording: &str, failure: &Failure) -> TestSuite {
    let mut error = TestCaseStatus::non_success(NonSuccessKind::Error);
    error.set_message(failure.message());
    let mut case = TestCase::new("separation", error);
    case.set_classname("tautline.audit");
    let mut suite = TestSuite::new(recording);
    suite.add_test_case(case);
    suite
}

/// Returns a case for the verdict and a case for each finding.
fn suite(AuditedRecording { report, allows_undecided, .. }: &AuditedRecording) -> TestSuite {
    let failed = |message: &str| {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
        status.set_message(message);
        status
    };
    let doubtful = |message: &str| {
        if !allows_undecided {
            return failed(message);
        }
        let mut status = TestCaseStatus::skipped();
        status.set_message(message);
        status
    };
    let headline = report.headline();
    let verdict = |status: Status, words: &str| match status {
        Status::Clear => TestCaseStatus::success(),
        Status::Violation => failed(words),
        Status::Undecided => doubtful(words),
    };
    let mut cases: Vec<_> =
        report.separation().map(|status| TestCase::new("separation", verdict(status, &headline))).into_iter().collect();
    cases
        .extend(report.limits.iter().map(|limit| TestCase::new(limit.quantity, verdict(limit.status, &limit.brief()))));
    cases.extend(report.plan.iter().map(|plan| TestCase::new("plan", verdict(plan.status, &plan.brief()))));
    cases.extend(
        report.well_clear.iter().map(|found| TestCase::new("well_clear", verdict(found.status, &found.brief()))),
    );
    if report.presence.required {
        let partly = report.presence.partly as u64;
        let status = if partly == 0 { Status::Clear } else { Status::Undecided };
        let words = format!("{} not seen throughout", counted(partly, "vehicle is", "vehicles are"));
        cases.push(TestCase::new("presence", verdict(status, &words)));
    }
    for PairFinding { who: [first, second], finding: v } in &report.violations {
        let words = format!("{:?} below {:?} from {:?} s to {:?} s", v.min_m, v.limit_m, v.from_s, v.to_s);
        cases.push(TestCase::new(format!("{first} and {second} at {:.3} s", v.min_at_s), failed(&words)));
    }
    for PairFinding { who: [first, second], finding: u } in &report.undecided {
        let words = format!("between {:?} and {:?} against {:?} by {:?} s", u.lower_m, u.upper_m, u.limit_m, u.to_s);
        cases.push(TestCase::new(format!("{first} and {second} from {:.3} s", u.from_s), doubtful(&words)));
    }
    for VehicleFinding { vehicle, finding: gap } in &report.gaps {
        let words = format!("not seen from {:?} s to {:?} s", gap.from_s, gap.to_s);
        cases.push(TestCase::new(format!("{vehicle} from {:.3} s", gap.from_s), doubtful(&words)));
    }
    let rest = report.ended_early.iter();
    cases.extend(rest.map(|end| TestCase::new(format!("the rest from {:.3} s", end.at_s), doubtful(&end.words()))));
    for case in &mut cases {
        case.set_classname("tautline.audit");
    }
    let mut suite = TestSuite::new(report.source.recording.as_str());
    suite.add_test_cases(cases);
    suite
}

/// Returns a summary in Markdown: a row for each recording, then the findings of each recording that is not clear.
pub(super) fn markdown(answers: &[Answer]) -> String {
    let mut text =
        "## tautline audit\n\n| recording | verdict | closest | vehicles | at |\n| --- | --- | --- | --- | --- |\n"
            .to_owned();
    for Answer { recording, audited } in answers {
        let report = match audited {
            Ok(AuditedRecording { report, .. }) => report,
            Err(failure) => {
                let [recording, failure] = [recording, &failure.in_words()].map(|text| escape_markdown(text));
                // Writing to a string cannot fail.
                let _ = writeln!(text, "| {recording} | \u{274c} not judged: {failure} | | | |");
                continue;
            }
        };
        let closest = report.closest.first();
        let unit = report.unit();
        let cells = [
            escape_markdown(&report.source.recording),
            format!("{} {}", mark(report.status), escape_markdown(&report.verdict())),
            closest.map_or(String::new(), |of| {
                let finding = &of.finding;
                format!("{} {unit}", beside_limit(finding.lower_m, finding.limit_m, 3))
            }),
            closest.map_or(String::new(), |of| escape_markdown(&of.who.join(" and "))),
            closest.map_or(String::new(), |of| format!("{} s", fixed(of.finding.time_s, 2))),
        ];
        let _ = writeln!(text, "| {} |", cells.join(" | "));
    }
    for AuditedRecording { report, .. } in judged(answers) {
        let notes = report.source.notes.iter().map(|note| format!("note: {note}\n"));
        let (headline, found) = (report.headline(), report.text() + &notes.collect::<String>());
        let fence = "`".repeat(longest_run(&headline).max(longest_run(&found)).max(2) + 1);
        let open = if report.status == Status::Clear { "" } else { " open" };
        let _ = write!(
            text,
            "\n<details{open}><summary>{}</summary>\n\n{fence}text\n{headline}\n{found}{fence}\n\n</details>\n",
            escape_markdown(&report.source.recording)
        );
    }
    text
}

/// Returns an annotation of GitHub Actions for each recording.
pub(super) fn github(answers: &[Answer]) -> String {
    let mut text = String::new();
    let mut line = |level: &str, recording: &str, title: &str, message: &str| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "::{level} file={},title={}::{}", property(recording), property(title), data(message));
    };
    for Answer { recording, audited } in answers {
        let AuditedRecording { report, allows_undecided, asked_by } = match audited {
            Ok(audited) => audited,
            Err(failure) => {
                line("error", recording, "not judged", &failure.in_words());
                continue;
            }
        };
        let level = match report.status {
            Status::Clear => "notice",
            Status::Undecided if *allows_undecided => "warning",
            Status::Undecided | Status::Violation => "error",
        };
        let asked = asked_by.iter().map(|asked| format!("; {asked}"));
        line(level, &report.source.recording, &report.verdict(), &(report.headline() + &asked.collect::<String>()));
    }
    text
}

/// Returns the audits of the recordings that were judged.
fn judged(answers: &[Answer]) -> impl Iterator<Item = &AuditedRecording> {
    answers.iter().filter_map(|answer| answer.audited.as_ref().ok())
}

/// Returns the numbers of recordings with each verdict in one line.
pub(super) fn counts(answers: &[Answer]) -> String {
    let of = |status: Status| judged(answers).filter(|answer| answer.report.status == status).count() as u64;
    let failures = answers.len() - judged(answers).count();
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

/// Escapes untrusted text for Markdown.
fn escape_markdown(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            c if c.is_control() => escaped.push(' '),
            '|' | '`' | '*' | '_' | '[' | ']' | '\\' | '~' | '#' | '!' | '$' | '@' => {
                escaped.push('\\');
                escaped.push(c);
            }
            c => escaped.push(c),
        }
    }
    escaped
}

fn longest_run(text: &str) -> usize {
    text.split(|c| c != '`').map(str::len).max().unwrap_or(0)
}

/// Escapes untrusted text for a line of GitHub Actions: line ends, and the prefix of old-style commands.
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
    fn untrusted_text_is_escaped() {
        assert_eq!(escape_markdown("a|b<script>`x`\n[l](u)"), "a\\|b&lt;script&gt;\\`x\\` \\[l\\](u)");
        assert_eq!(property("a,b:c%\n::error::"), "a%2Cb%3Ac%25%0A%3A%3Aerror%3A%3A");
        assert_eq!(data("\u{1b}[31m##[error]x"), "\u{fffd}[31m# #[error]x");
        assert_eq!((longest_run("a```b``"), longest_run("")), (3, 0));
        let audited = Err(Failure::input("recording/not-found", "no\nsuch file", "look"));
        let failed = [Answer { recording: "x\n::error::y.csv".to_owned(), audited }];
        assert_eq!(github(&failed).lines().count(), 1);
        assert!(markdown(&failed).contains("not judged: no such file (look)"));
    }
}
