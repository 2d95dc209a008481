//! A graphics driver that keeps its complaints to itself.

use std::env::{args_os, current_exe, var_os};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::Command;

/// Switches off the layer of Mesa that chooses among devices: see its manifest.
const NO_LAYER: &str = "NODEVICE_SELECT";
/// What a person chooses by that layer.
const CHOICE: &str = "MESA_VK_DEVICE_SELECT";

/// Starts the program again, once, where the driver would complain on standard error that there is no desktop to ask for
/// its device. It stays the same process: with its number, signals, input, output and exit code. Where it cannot be
/// started again, it goes on as it is.
pub(super) fn silence() {
    let has_desktop = var_os("XDG_RUNTIME_DIR").is_some_and(|folder| Path::new(&folder).is_absolute());
    if has_desktop || var_os(NO_LAYER).is_some() || var_os(CHOICE).is_some() {
        return;
    }
    let (Ok(program), mut arguments) = (current_exe(), args_os()) else { return };
    let called = arguments.next().unwrap_or_else(|| program.clone().into());
    // It comes back only where it fails.
    let _ = Command::new(program).arg0(called).args(arguments).env(NO_LAYER, "1").exec();
}
