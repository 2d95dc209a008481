//! Finds the embedded files: in this package, or at the top of the repository. `.github/embed.sh` copies them.
//!
//! The variable holds a path relative to the package, so that the folder of the build can be shared and moved. Cargo
//! runs this again if the folder that it found is missing or has changed.

use std::env;
use std::path::PathBuf;

fn main() {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let folder = if package.join("shaders").is_dir() { "shaders" } else { "../../shaders" };
    println!("cargo::rustc-env=TAUTLINE_SHADERS={folder}");
    println!("cargo::rerun-if-changed={folder}");
    println!("cargo::rerun-if-changed=build.rs");
}
