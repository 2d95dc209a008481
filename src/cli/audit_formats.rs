//! Machine-readable reports of `tautline audit`: Markdown and annotations for GitHub, CSV, and `JUnit`.

use std::fmt::Write as _;

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::audit::Answer;
use tautline_core::text::{beside_limit, counted, fixed};
use tautline_report::report::recorded::{RecordedReport, VehicleFinding};
use tautline_report::report::{Answer as PartAnswer, Enclosure, Finding, Part, Status};
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

/// Time span, words and numbers of a row.
type Row = ([f64; 2], [String; 3], [Option<f64>; 5]);

/// Returns the rows of one recording.
fn rows(report: &RecordedReport) -> impl Iterator<Item = Vec<String>> {
    let gaps = report.gaps.iter().map(|VehicleFinding { vehicle, finding: gap }| {
        ([gap.from_s, gap.to_s], ["gap".to_owned(), vehicle.clone(), String::new()], [None; 5])
    });
    let early_end = report
        .ended_early
        .iter()
        .map(|end| ([end.at_s, end.duration_s], ["ended-early", "", ""].map(str::to_owned), [None; 5]));
    let mut rows: Vec<Row> = report.answers.iter().flat_map(rows_of_part).chain(gaps).chain(early_end).collect();
    rows.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    rows.into_iter().map(|(span_s, words, numbers)| {
        let numbers = span_s.map(Some).into_iter().chain(numbers).map(|x| x.map_or_else(String::new, number));
        words.into_iter().chain(numbers).collect()
    })
}

/// Returns the rows of violations and undecided times of a part. A finding on one vehicle has the name of the part in
/// the column of the second vehicle.
fn rows_of_part(answer: &PartAnswer) -> Vec<Row> {
    let beyond = if matches!(answer.part, Part::WellClear(_)) { "not-well-clear" } else { "violation" };
    let violations = answer.violations.listed.iter().map(|finding| (beyond, finding));
    let undecided = answer.undecided.listed.iter().map(|finding| ("undecided", finding));
    let row = |(kind, finding): (&str, &Finding)| {
        let span_s = finding.from_s.zip(finding.to_s).or(finding.at_s.map(|at_s| (at_s, at_s)))?;
        let mut subjects = finding.subjects.iter().cloned();
        let first = subjects.next().unwrap_or_default();
        let second = subjects.next().unwrap_or_else(|| answer.part.name().to_owned());
        let Enclosure { lower, upper, .. } = finding.value;
        let numbers = [lower, upper, finding.at_s, finding.limit, finding.rate_hz];
        Some((span_s.into(), [kind.to_owned(), first, second], numbers))
    };
    violations.chain(undecided).filter_map(row).collect()
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
    let verdict = |status: Status, words: &str| match status {
        Status::Clear => TestCaseStatus::success(),
        Status::Violation => failed(words),
        Status::Undecided => doubtful(words),
    };
    let answers = &report.answers;
    let parts = answers
        .iter()
        .map(|answer| TestCase::new(answer.part.name(), verdict(answer.status, &report.brief(answer.part))));
    let mut cases: Vec<_> = parts.collect();
    let of_pairs = answers.iter().filter(|answer| answer.part == Part::Separation);
    let value = |bound: Option<f64>| bound.map_or_else(|| "unknown".to_owned(), number);
    for finding in of_pairs.clone().flat_map(|answer| &answer.violations.listed) {
        let [limit, from, to] = [finding.limit, finding.from_s, finding.to_s].map(value);
        let words = format!("{} below {limit} from {from} s to {to} s", value(finding.value.upper));
        let time = fixed(finding.at_s.unwrap_or(f64::NAN), 3);
        cases.push(TestCase::new(format!("{} at {time} s", finding.subjects.join(" and ")), failed(&words)));
    }
    for finding in of_pairs.flat_map(|answer| &answer.undecided.listed) {
        let [lower, upper, limit, to] =
            [finding.value.lower, finding.value.upper, finding.limit, finding.to_s].map(value);
        let words = format!("between {lower} and {upper} against {limit} by {to} s");
        let from = fixed(finding.from_s.unwrap_or(f64::NAN), 3);
        cases.push(TestCase::new(format!("{} from {from} s", finding.subjects.join(" and ")), doubtful(&words)));
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
        let closest = report.separation().and_then(|answer| answer.closest.first());
        let unit = report.unit();
        let cells = [
            escape_markdown(&report.source.recording),
            format!("{} {}", mark(report.status), escape_markdown(&report.verdict())),
            closest.map_or(String::new(), |finding| {
                format!("{} {unit}", beside_limit(finding.value.lower_bound(), finding.limit.unwrap_or_default(), 3))
            }),
            closest.map_or(String::new(), |finding| escape_markdown(&finding.subjects.join(" and "))),
            closest.and_then(|finding| finding.at_s).map_or(String::new(), |at_s| format!("{} s", fixed(at_s, 2))),
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
