//! Sets `TAUTLINE_SOURCES` to a SHA-256 of the sources and of the versions of all dependencies.
//!
//! Programs of equal sources fly the same bits, so they can share the folder of a campaign: the command line, and the
//! library of the Python package. A crate outside of its workspace does not know the versions of its dependencies. The
//! variable is then empty, and the file of the program identifies it.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

use sha2::{Digest as _, Sha256};

/// Crates of the workspace that affect flights, verdicts and rows.
const CRATES: [&str; 7] = ["audit", "core", "laws", "report", "shield", "sim", "studies"];

fn main() -> io::Result<()> {
    let own = PathBuf::from(env::var("CARGO_MANIFEST_DIR").map_err(io::Error::other)?);
    let crates = own.parent().unwrap_or(Path::new(""));
    let root = crates.parent().unwrap_or(Path::new(""));
    let is_workspace = CRATES.iter().all(|name| crates.join(name).join("src").is_dir());
    let lock = root.join("Cargo.lock");
    println!("cargo::rerun-if-changed=build.rs");
    if !(is_workspace && lock.is_file()) {
        println!("cargo::rustc-env=TAUTLINE_SOURCES=");
        return Ok(());
    }
    let mut files = vec![lock];
    for name in CRATES {
        println!("cargo::rerun-if-changed={}", crates.join(name).join("src").display());
        files.push(crates.join(name).join("Cargo.toml"));
        collect(&crates.join(name).join("src"), &mut files)?;
    }
    // The order of a folder's entries differs between file systems.
    files.sort();
    let mut hash = Sha256::new();
    for file in &files {
        // Git may write other line ends on other systems.
        let text: Vec<u8> = fs::read(file)?.into_iter().filter(|&byte| byte != b'\r').collect();
        let name = file.strip_prefix(root).unwrap_or(file).to_string_lossy().replace('\\', "/");
        hash.update((name.len() as u64).to_le_bytes());
        hash.update(name);
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text);
    }
    for file in files.iter().filter(|file| file.extension().is_some_and(|end| end == "toml" || end == "lock")) {
        println!("cargo::rerun-if-changed={}", file.display());
    }
    let digits = hash.finalize().iter().fold(String::new(), |digits, byte| format!("{digits}{byte:02x}"));
    println!("cargo::rustc-env=TAUTLINE_SOURCES={digits}");
    Ok(())
}

/// Appends the files below a folder.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
