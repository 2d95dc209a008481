//! Figures and pages, as files and in a browser.

#[path = "../support/browser.rs"]
mod browser;

mod attacks;
mod channels;
mod figures;
mod margins;
mod opened;
mod page;
mod scale;
mod validation;
