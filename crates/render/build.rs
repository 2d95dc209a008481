//! Finds the embedded files: in this package, or at the top of the repository. The packaging script copies them.
//!
//! The variables hold paths relative to the package, so that the folder of the build can be shared and moved.

use std::env;
use std::path::PathBuf;

fn main() {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let place = if package.join("shaders").is_dir() { "" } else { "../../" };
    println!("cargo::rustc-env=TAUTLINE_SHADERS={place}shaders");
    println!("cargo::rerun-if-changed=build.rs");
}
