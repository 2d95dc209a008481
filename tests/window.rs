//! The window on a screen that nobody sees: it opens, plays, answers keys and mouse, and closes.
//!
//! Needs `Xvfb`, `xdotool` and a driver for windows; `tests/run.sh` installs them.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for anything on a slow machine.
const PATIENCE: Duration = Duration::from_mins(1);

/// A screen, ended when dropped.
struct Screen {
    server: Child,
    display: String,
}

impl Screen {
    fn new() -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1400x900x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start Xvfb: {error}; `sh tests/run.sh` installs it"));
        let mut number = String::new();
        let out = server.stdout.take().expect("a pipe");
        BufReader::new(out).read_line(&mut number).expect("the number of the display");
        Self { server, display: format!(":{}", number.trim()) }
    }

    /// Runs `xdotool` and gives what it says.
    fn tell(&self, arguments: &[&str]) -> String {
        let done = Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &self.display)
            .output()
            .unwrap_or_else(|error| panic!("cannot start xdotool: {error}; `sh tests/run.sh` installs it"));
        String::from_utf8_lossy(&done.stdout).trim().to_owned()
    }

    fn open(&self, folder: &Path, arguments: &[&str]) -> (Child, String) {
        let program = Command::new(env!("CARGO_BIN_EXE_tautline"))
            .arg("view")
            .args(arguments)
            .current_dir(folder)
            .env("DISPLAY", &self.display)
            .env_remove("WAYLAND_DISPLAY")
            .env("XDG_RUNTIME_DIR", folder)
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program runs");
        let window = wait_for("a window", || {
            let found = self.tell(&["search", "--name", "^tautline: "]);
            found.lines().next().map(str::to_owned)
        });
        // Keys go to the window once it has been drawn and has the focus.
        std::thread::sleep(Duration::from_secs(2));
        self.tell(&["windowfocus", "--sync", &window]);
        (program, window)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(began.elapsed() < PATIENCE, "waited too long for {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Waits for the program to end well and quietly.
fn ends_well(program: Child) {
    let began = Instant::now();
    let mut program = program;
    while program.try_wait().expect("the program can be waited for").is_none() {
        if began.elapsed() > PATIENCE {
            let _ = program.kill();
            panic!("the window does not close");
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let done = program.wait_with_output().expect("its output");
    let err = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success() && !err.contains("panicked") && !err.contains("error"), "{:?}: {err}", done.status);
}

/// Times in the names of the pictures that were written.
fn pictures(folder: &Path) -> Vec<f64> {
    let entries = std::fs::read_dir(folder).expect("the folder");
    let mut times: Vec<f64> = entries
        .filter_map(|entry| entry.expect("an entry").file_name().into_string().ok())
        .filter_map(|name| name.strip_prefix("pentagon-")?.strip_suffix("s.png")?.parse().ok())
        .collect();
    times.sort_by(f64::total_cmp);
    times
}

#[test]
fn the_window_plays_answers_keys_and_mouse_and_closes() {
    let folder = tempfile::tempdir().expect("a folder");
    let screen = Screen::new();
    let (program, window) = screen.open(folder.path(), &["pentagon", "--set", "time.duration_s=60"]);
    // Pause, to the closest approach, a picture of it, a sample on, another picture.
    for key in ["space", "n", "p"] {
        screen.tell(&["key", "--window", &window, key]);
        std::thread::sleep(Duration::from_millis(300));
    }
    wait_for("a picture", || (pictures(folder.path()).len() == 1).then_some(()));
    let closest_s = pictures(folder.path())[0];
    assert!((2.0..2.3).contains(&closest_s), "the pentagon is closest at 2.15 s, not at {closest_s} s");
    screen.tell(&["key", "--window", &window, "Right"]);
    screen.tell(&["key", "--window", &window, "p"]);
    wait_for("another picture", || (pictures(folder.path()).len() == 2).then_some(()));
    let next_s = pictures(folder.path())[1];
    assert!(next_s - closest_s < 0.02, "a step is a sample: {closest_s} s to {next_s} s");
    for _ in 0..10 {
        screen.tell(&["key", "--window", &window, "Right"]);
    }
    screen.tell(&["key", "--window", &window, "p"]);
    wait_for("a picture ten samples on", || (pictures(folder.path()).len() == 3).then_some(()));
    let later_s = pictures(folder.path())[2];
    assert!((0.15..0.18).contains(&(later_s - next_s)), "ten steps at 60 Hz: {next_s} s to {later_s} s");
    // Play: time goes on.
    screen.tell(&["key", "--window", &window, "space"]);
    std::thread::sleep(Duration::from_secs(1));
    screen.tell(&["key", "--window", &window, "p"]);
    wait_for("a picture later on", || (pictures(folder.path()).len() == 4).then_some(()));
    assert!(pictures(folder.path())[3] > later_s + 0.5, "a second was played: {:?}", pictures(folder.path()));
    // Drag, wheel, click, every layer, help, themes, another size: nothing breaks.
    screen.tell(&["mousemove", "--window", &window, "400", "300", "mousedown", "1"]);
    screen.tell(&["mousemove", "--window", &window, "520", "340", "mouseup", "1"]);
    screen.tell(&["click", "4", "click", "5", "click", "1"]);
    for key in ["1", "2", "3", "4", "5", "6", "7", "8", "v", "t", "h", "Tab", "Tab", "f", "w", "d", "Home", "End"] {
        screen.tell(&["key", "--window", &window, key]);
    }
    screen.tell(&["windowsize", "--sync", &window, "700", "500"]);
    std::thread::sleep(Duration::from_millis(500));
    screen.tell(&["key", "--window", &window, "q"]);
    ends_well(program);
}

#[test]
fn a_recording_opens_and_a_window_that_is_closed_ends_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let flown = Command::new(env!("CARGO_BIN_EXE_tautline"))
        .args(["run", "pentagon", "--quiet", "--no-snapshots", "--no-figures", "--out", "out"])
        .args(["--set", "time.duration_s=2"])
        .current_dir(folder.path())
        .status()
        .expect("the program runs");
    assert!(flown.code() <= Some(1));
    let screen = Screen::new();
    let (program, window) = screen.open(folder.path(), &["out/run.mcap", "--theme", "light"]);
    screen.tell(&["key", "--window", &window, "Escape"]);
    ends_well(program);
}
