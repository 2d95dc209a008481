//! Runs the program as a user does.

use std::path::Path;
use std::time::Duration;

use assert_cmd::Command;

/// Time limit of a command, generous for slow machines.
pub(crate) const PATIENCE: Duration = Duration::from_mins(5);

/// Path of the program under test.
pub(crate) const TAUTLINE: &str = env!("CARGO_BIN_EXE_tautline");

/// Result of a command.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) exit: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

/// Runs a program in a folder, with closed input and captured output.
pub(crate) fn ran_by(program: &str, folder: &Path, arguments: &[&str]) -> Ran {
    let mut command = Command::new(program);
    // Graphics drivers warn if this folder does not exist.
    command.args(arguments).current_dir(folder).env("XDG_RUNTIME_DIR", folder).timeout(PATIENCE);
    let done = command.output().expect(program);
    let text = |bytes| String::from_utf8(bytes).expect("the program writes UTF-8");
    Ran { exit: done.status.code(), out: text(done.stdout), err: text(done.stderr) }
}
