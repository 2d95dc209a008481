//! Tests of figures and pages, as files and in a browser.

#[path = "../support/browser.rs"]
mod browser;
#[path = "../support/replays.rs"]
mod replays_in_browser;
#[path = "../support/report.rs"]
mod report;

mod attacks;
mod channels;
mod figures;
mod live;
mod margins;
mod opened;
mod page;
mod replays;
mod scale;
mod validation;
