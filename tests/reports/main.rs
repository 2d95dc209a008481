//! Figures and pages, as files and in a browser.

#[path = "../support/browser.rs"]
mod browser;
#[path = "../support/release.rs"]
mod release;

mod figures;
mod opened;
mod page;
mod validation;
