//! What was found in a recording, for programs: CSV and `JUnit`.

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::Failure;
use crate::report::Status;
use crate::report::recorded::RecordedReport;

const COLUMNS: [&str; 10] =
    ["kind", "first", "second", "from_s", "to_s", "lower_m", "upper_m", "at_s", "limit_m", "rate_hz"];

/// Violations, undecided times and gaps, a row each, in order of time.
pub(super) fn csv(report: &RecordedReport) -> Result<Vec<u8>, Failure> {
    let none = String::new;
    let mut rows: Vec<(f64, [String; 10])> = Vec::new();
    for b in &report.violations {
        let [first, second] = b.who.clone();
        let [from, to, min, at, limit] = [b.from_s, b.to_s, b.min_m, b.min_at_s, b.limit_m].map(number);
        rows.push((b.from_s, ["violation".to_owned(), first, second, from, to, min.clone(), min, at, limit, none()]));
    }
    for u in &report.undecided {
        let [first, second] = u.who.clone();
        let [from, to, lower, upper, limit] = [u.from_s, u.to_s, u.lower_m, u.upper_m, u.limit_m].map(number);
        let rate = u.rate_hz.map_or_else(none, number);
        rows.push((u.from_s, ["undecided".to_owned(), first, second, from, to, lower, upper, none(), limit, rate]));
    }
    for gap in &report.gaps {
        let [from, to] = [gap.from_s, gap.to_s].map(number);
        let [second, lower, upper, at, limit, rate] = std::array::from_fn(|_| none());
        rows.push((
            gap.from_s,
            ["gap".to_owned(), gap.vehicle.clone(), second, from, to, lower, upper, at, limit, rate],
        ));
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let failed = |error: csv::Error| Failure::machine(format!("cannot write the events: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS).map_err(failed)?;
    for (_, row) in &rows {
        writer.write_record(row).map_err(failed)?;
    }
    writer.into_inner().map_err(|error| Failure::machine(format!("cannot write the events: {error}")))
}

/// Every digit of a number, in powers of ten where it is very large or small.
fn number(x: f64) -> String {
    format!("{x:?}")
}

/// A suite with a case for the verdict and one for each thing found. What is undecided fails, or is skipped where it is
/// allowed.
pub(super) fn junit(report: &RecordedReport, allow_undecided: bool) -> Result<String, Failure> {
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
    for b in &report.violations {
        let [first, second] = &b.who;
        let words = format!("{:?} below {:?} from {:?} s to {:?} s", b.min_m, b.limit_m, b.from_s, b.to_s);
        cases.push(TestCase::new(format!("{first} and {second} at {:.3} s", b.min_at_s), failed(&words)));
    }
    for u in &report.undecided {
        let [first, second] = &u.who;
        let words = format!("between {:?} and {:?} against {:?} by {:?} s", u.lower_m, u.upper_m, u.limit_m, u.to_s);
        cases.push(TestCase::new(format!("{first} and {second} from {:.3} s", u.from_s), doubtful(&words)));
    }
    for gap in &report.gaps {
        let words = format!("not seen from {:?} s to {:?} s", gap.from_s, gap.to_s);
        cases.push(TestCase::new(format!("{} from {:.3} s", gap.vehicle, gap.from_s), doubtful(&words)));
    }
    for case in &mut cases {
        case.set_classname("tautline.audit");
    }
    let mut suite = TestSuite::new(report.source.recording.as_str());
    suite.add_test_cases(cases);
    let mut junit = Report::new("tautline audit");
    junit.add_test_suite(suite);
    junit.to_string().map_err(|error| Failure::machine(format!("cannot write the JUnit report: {error}")))
}
