//! A recording that was judged, and what its verdict means to who asked.

use super::Exit;
use tautline_report::report::Status;
use tautline_report::report::recorded::RecordedReport;

/// A recording that was judged.
pub(super) struct Judgement {
    pub(super) report: RecordedReport,
    /// Whether it is good that it cannot be told.
    pub(super) allows_undecided: bool,
    /// What was asked by a file of settings.
    pub(super) asked_by: Option<String>,
}

impl Judgement {
    pub(super) fn exit(&self) -> Exit {
        match self.report.status {
            Status::Clear => Exit::Good,
            Status::Undecided if self.allows_undecided => Exit::Good,
            Status::Undecided | Status::Violation => Exit::Bad,
        }
    }
}
