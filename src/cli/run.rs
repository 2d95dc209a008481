//! `tautline run`: fly a scenario and leave a recording, figures and a report.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;

use super::console::{self, Console};
use super::folder::OutFolder;
use super::pictures::Pictures;
use super::snapshots::Watched;
use super::{Exit, Failure};
use crate::figures::RunHistory;
