//! Figures and pages, as files and in a browser.

#[path = "../support/browser.rs"]
mod browser;

mod channels;
mod figures;
mod margins;
mod opened;
mod page;
mod scale;
mod validation;
