//! `tautline list`: the built-in scenarios.

use clap::Args;

use super::console;
use super::{Exit, Failure};
use crate::scenario::builtin;

/// Arguments of `tautline list`.
#[derive(Debug, Args)]
pub(super) struct ListArguments {
    /// Print this scenario as TOML instead.
    #[arg(long, value_name = "NAME")]
    show: Option<String>,
}

pub(super) fn list(arguments: &ListArguments) -> Result<Exit, Failure> {
    let text = match &arguments.show {
        Some(name) => builtin::find(name).map(|builtin| builtin.toml.to_owned()).ok_or_else(|| {
            Failure::input(format!("there is no built-in scenario `{name}`"), "`tautline list` shows their names")
        })?,
        None => table(),
    };
    console::data(&text)?;
    Ok(Exit::Good)
}

fn table() -> String {
    let width = builtin::all().iter().map(|builtin| builtin.name.len()).max().unwrap_or(0);
    let lines: Vec<_> = builtin::all().iter().map(|b| format!("{:width$}  {}\n", b.name, b.summary)).collect();
    lines.concat()
}
