//! Finds the embedded files: in this package, or at the top of the repository. `.github/embed.sh` copies them.
//!
//! The variables hold paths relative to the package, so that the folder of the build can be shared and moved. Cargo
//! runs this again if a folder that it found is missing or has changed.

use std::env;
use std::path::PathBuf;

fn main() {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    for (name, variable) in [("assets", "TAUTLINE_ASSETS"), ("shaders", "TAUTLINE_SHADERS")] {
        let place = if package.join(name).is_dir() { "" } else { "../../" };
        println!("cargo::rustc-env={variable}={place}{name}");
        println!("cargo::rerun-if-changed={place}{name}");
    }
    println!("cargo::rerun-if-changed=build.rs");
}
