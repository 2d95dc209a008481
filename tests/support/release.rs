//! The release build of the program, for what takes too long in a debug build.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The program built for release, and kept up to date.
pub(crate) fn program() -> PathBuf {
    let under_test = Path::new(env!("CARGO_BIN_EXE_tautline"));
    let folder = under_test.parent().expect("a folder");
    if folder.ends_with("release") {
        return under_test.to_owned();
    }
    let target = folder.parent().expect("the target folder");
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--release", "--bin", "tautline", "--target-dir"])
        .arg(target)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status();
    assert!(built.expect("cargo").success(), "the release build of the program");
    target.join("release").join("tautline").with_extension(std::env::consts::EXE_EXTENSION)
}
