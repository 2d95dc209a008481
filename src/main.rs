//! Executable of tautline; `tautline --help` lists its commands.

use std::process::ExitCode;

fn main() -> ExitCode {
    tautline::cli::main()
}
