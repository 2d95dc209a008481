//! The program, run as a user runs it.

use std::path::Path;
use std::time::Duration;

use assert_cmd::Command;

/// Longer than any command of a test takes on a slow machine.
const PATIENCE: Duration = Duration::from_mins(5);

/// The program under test.
pub(crate) const TAUTLINE: &str = env!("CARGO_BIN_EXE_tautline");

/// What a command left behind.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) exit: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

/// Runs a program in a folder, its input closed and its output in pipes.
pub(crate) fn ran_by(program: &str, folder: &Path, arguments: &[&str]) -> Ran {
    let mut command = Command::new(program);
    // Graphics drivers complain where there is no such folder.
    command.args(arguments).current_dir(folder).env("XDG_RUNTIME_DIR", folder).timeout(PATIENCE);
    let done = command.output().expect(program);
    let text = |bytes| String::from_utf8(bytes).expect("the program writes UTF-8");
    Ran { exit: done.status.code(), out: text(done.stdout), err: text(done.stderr) }
}
