//! What was found in a recording, for programs: CSV and `JUnit`.

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use tautline_core::text::counted;
use tautline_report::report::Status;
use tautline_report::report::recorded::{OfLimit, OfPair, OfVehicle, RecordedReport};
use tautline_report::request::{Audited, Failure};

const COLUMNS: [&str; 10] =
    ["kind", "first", "second", "from_s", "to_s", "lower_m", "upper_m", "at_s", "limit_m", "rate_hz"];

/// Violations, undecided times and gaps of pairs and of single vehicles, and the rest of a flight that ended early, a row each, in
/// order of time; where several recordings are asked about `named` puts
/// the recording in front.
pub(super) fn csv(judged: &[Audited], named: bool) -> Result<Vec<u8>, Failure> {
    let failed =
        |error: csv::Error| Failure::machine("files/cannot-write", format!("cannot write the events: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(named.then_some("recording").into_iter().chain(COLUMNS)).map_err(failed)?;
    for Audited { report, .. } in judged {
        let recording = named.then(|| report.source.recording.clone());
        for row in rows(report) {
            writer.write_record(recording.iter().cloned().chain(row)).map_err(failed)?;
        }
    }
    writer
        .into_inner()
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the events: {error}")))
}

/// The rows of one recording.
fn rows(report: &RecordedReport) -> impl Iterator<Item = Vec<String>> {
    let violations = report.violations.iter().map(|OfPair { who: [first, second], finding: v }| {
        let numbers = [Some(v.min_m), Some(v.min_m), Some(v.min_at_s), Some(v.limit_m), None];
        ("violation", [first.as_str(), second], [v.from_s, v.to_s], numbers)
    });
    let undecided = report.undecided.iter().map(|OfPair { who: [first, second], finding: u }| {
        let numbers = [Some(u.lower_m), Some(u.upper_m), None, Some(u.limit_m), u.rate_hz];
        ("undecided", [first.as_str(), second], [u.from_s, u.to_s], numbers)
    });
    let gaps = report
        .gaps
        .iter()
        .map(|OfVehicle { vehicle, finding: gap }| ("gap", [vehicle.as_str(), ""], [gap.from_s, gap.to_s], [None; 5]));
    let early_end =
        report.ended_early.iter().map(|end| ("ended-early", ["", ""], [end.at_s, end.duration_s], [None; 5]));
    let rows = violations.chain(undecided).chain(gaps).chain(early_end).map(|(kind, who, span_s, numbers)| {
        let words = [kind].into_iter().chain(who).map(str::to_owned);
        (span_s, words.collect::<Vec<_>>(), numbers)
    });
    let mut rows: Vec<_> = rows.chain(report.limits.iter().flat_map(beyond)).collect();
    rows.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    rows.into_iter().map(|(span_s, words, numbers)| {
        let numbers = span_s.map(Some).into_iter().chain(numbers).map(|x| x.map_or_else(String::new, number));
        words.into_iter().chain(numbers).collect()
    })
}

/// A time, what is said of it, and its numbers.
type Row = ([f64; 2], Vec<String>, [Option<f64>; 5]);

/// The rows of one limit on each vehicle by itself: its name stands in the place of a second vehicle.
fn beyond(limit: &OfLimit) -> impl Iterator<Item = Row> + '_ {
    let violations = limit.violations.iter().map(|of| ("violation", of));
    let undecided = limit.undecided.iter().map(|of| ("undecided", of));
    violations.chain(undecided).map(|(kind, OfVehicle { vehicle, finding })| {
        let words = vec![kind.to_owned(), vehicle.clone(), limit.quantity.to_owned()];
        let numbers = [Some(finding.lower), Some(finding.upper), Some(finding.at_s), Some(limit.allowed), None];
        ([finding.from_s, finding.to_s], words, numbers)
    })
}

/// Every digit of a number, in powers of ten where it is very large or small.
fn number(x: f64) -> String {
    format!("{x:?}")
}

/// A suite for each recording, and an error for each that could not be judged. What is undecided fails, or is skipped where it
/// is allowed.
pub(super) fn junit(judged: &[Audited], failures: &[(String, Failure)]) -> Result<String, Failure> {
    let mut junit = Report::new("tautline audit");
    junit.add_test_suites(judged.iter().map(suite));
    junit.add_test_suites(failures.iter().map(|(recording, failure)| {
        let mut error = TestCaseStatus::non_success(NonSuccessKind::Error);
        error.set_message(failure.message());
        let mut case = TestCase::new("separation", error);
        case.set_classname("tautline.audit");
        let mut suite = TestSuite::new(recording.as_str());
        suite.add_test_case(case);
        suite
    }));
    junit
        .to_string()
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the JUnit report: {error}")))
}

/// A case for the verdict and one for each thing found.
fn suite(Audited { report, allows_undecided, .. }: &Audited) -> TestSuite {
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
    if report.presence.required {
        let partly = report.presence.partly as u64;
        let status = if partly == 0 { Status::Clear } else { Status::Undecided };
        let words = format!("{} not seen throughout", counted(partly, "vehicle is", "vehicles are"));
        cases.push(TestCase::new("presence", verdict(status, &words)));
    }
    for OfPair { who: [first, second], finding: v } in &report.violations {
        let words = format!("{:?} below {:?} from {:?} s to {:?} s", v.min_m, v.limit_m, v.from_s, v.to_s);
        cases.push(TestCase::new(format!("{first} and {second} at {:.3} s", v.min_at_s), failed(&words)));
    }
    for OfPair { who: [first, second], finding: u } in &report.undecided {
        let words = format!("between {:?} and {:?} against {:?} by {:?} s", u.lower_m, u.upper_m, u.limit_m, u.to_s);
        cases.push(TestCase::new(format!("{first} and {second} from {:.3} s", u.from_s), doubtful(&words)));
    }
    for OfVehicle { vehicle, finding: gap } in &report.gaps {
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
