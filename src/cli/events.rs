//! What was found in a recording, for programs: CSV and `JUnit`.

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::Failure;
use crate::report::Status;
use crate::report::recorded::{OfPair, OfVehicle, RecordedReport};

const COLUMNS: [&str; 10] =
    ["kind", "first", "second", "from_s", "to_s", "lower_m", "upper_m", "at_s", "limit_m", "rate_hz"];

/// Violations, undecided times and gaps, a row each, in order of time; where several recordings are asked about `named` puts
/// the recording in front.
pub(super) fn csv(reports: &[RecordedReport], named: bool) -> Result<Vec<u8>, Failure> {
    let failed = |error: csv::Error| Failure::machine(format!("cannot write the events: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(named.then_some("recording").into_iter().chain(COLUMNS)).map_err(failed)?;
    for report in reports {
        let recording = named.then(|| report.source.recording.clone());
        for row in rows(report) {
            writer.write_record(recording.iter().cloned().chain(row)).map_err(failed)?;
        }
    }
    writer.into_inner().map_err(|error| Failure::machine(format!("cannot write the events: {error}")))
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
    let mut rows: Vec<_> = violations.chain(undecided).chain(gaps).collect();
    rows.sort_by(|a, b| a.2[0].total_cmp(&b.2[0]));
    rows.into_iter().map(|(kind, who, span_s, numbers)| {
        let words = [kind].into_iter().chain(who).map(str::to_owned);
        let numbers = span_s.map(Some).into_iter().chain(numbers).map(|x| x.map_or_else(String::new, number));
        words.chain(numbers).collect()
    })
}

/// Every digit of a number, in powers of ten where it is very large or small.
fn number(x: f64) -> String {
    format!("{x:?}")
}

/// A suite for each recording, and an error for each that could not be judged. What is undecided fails, or is skipped where it
/// is allowed.
pub(super) fn junit(
    reports: &[RecordedReport],
    failures: &[(String, Failure)],
    allow_undecided: bool,
) -> Result<String, Failure> {
    let mut junit = Report::new("tautline audit");
    junit.add_test_suites(reports.iter().map(|report| suite(report, allow_undecided)));
    junit.add_test_suites(failures.iter().map(|(recording, failure)| {
        let mut error = TestCaseStatus::non_success(NonSuccessKind::Error);
        error.set_message(failure.said.to_string());
        let mut case = TestCase::new("separation", error);
        case.set_classname("tautline.audit");
        let mut suite = TestSuite::new(recording.as_str());
        suite.add_test_case(case);
        suite
    }));
    junit.to_string().map_err(|error| Failure::machine(format!("cannot write the JUnit report: {error}")))
}

/// A case for the verdict and one for each thing found.
fn suite(report: &RecordedReport, allow_undecided: bool) -> TestSuite {
    let failed = |message: &str| {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
        status.set_message(message);
        status
    };
    let doubtful = |message: &str| {
        if !allow_undecided {
            return failed(message);
        }
        let mut status = TestCaseStatus::skipped();
        status.set_message(message);
        status
    };
    let headline = report.headline();
    let verdict = match report.status {
        Status::Clear => TestCaseStatus::success(),
        Status::Violation => failed(&headline),
        Status::Undecided => doubtful(&headline),
    };
    let mut cases = vec![TestCase::new("separation", verdict)];
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
    for case in &mut cases {
        case.set_classname("tautline.audit");
    }
    let mut suite = TestSuite::new(report.source.recording.as_str());
    suite.add_test_cases(cases);
    suite
}
