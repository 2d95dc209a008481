//! The window on a screen that nobody sees: it opens, plays, answers keys and mouse, and closes.
//!
//! Needs `Xvfb`, `xdotool` and a driver for windows; `tests/run.sh` installs them.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tautline::render::Timeline;
use tautline::render::scene::{Camera, Extent};

/// Longest wait for anything on a slow machine.
const PATIENCE: Duration = Duration::from_mins(1);

/// A screen, ended when dropped.
struct Screen {
    server: Child,
    display: String,
    /// Holds what is seen, in a file.
    memory: tempfile::TempDir,
    /// One window at a time: time in a window is that of the clock only where it is drawn fast enough.
    _turn: MutexGuard<'static, ()>,
}

impl Screen {
    fn new() -> Self {
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let memory = tempfile::tempdir().expect("a folder");
        // Without `-noreset` the server begins anew, and drops the window, when a client was the last one for a frame.
        let mut server = Command::new("Xvfb")
            .args(["-noreset", "-displayfd", "1", "-screen", "0", "1400x900x24", "-nolisten", "tcp", "-fbdir"])
            .arg(memory.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start Xvfb: {error}; `sh tests/run.sh` installs it"));
        let mut number = String::new();
        let out = server.stdout.take().expect("a pipe");
        BufReader::new(out).read_line(&mut number).expect("the number of the display");
        Self { server, display: format!(":{}", number.trim()), memory, _turn: turn }
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

/// A window on a flight that stands still.
struct Watched<'a> {
    screen: &'a Screen,
    window: String,
    folder: &'a Path,
}

impl<'a> Watched<'a> {
    /// A window on the end of a recording that is flown first.
    fn at_the_end(screen: &'a Screen, folder: &'a Path) -> (Child, Self) {
        flown(folder);
        let (program, window) = screen.open(folder, &["out/run.mcap"]);
        let watched = Self { screen, window, folder };
        watched.key("End");
        (program, watched)
    }

    /// Presses a key.
    fn key(&self, key: &str) {
        self.screen.tell(&["key", "--window", &self.window, key]);
    }

    /// Works the mouse over a place of the window.
    fn mouse(&self, x: u32, y: u32, more: &[&str]) {
        let [x, y] = [x, y].map(|at| at.to_string());
        self.screen.tell(&[&["mousemove", "--window", &self.window, &x, &y][..], more].concat());
    }

    /// The picture as it is now: its size and its bytes, as the window writes them.
    fn picture(&self) -> ([u32; 2], Vec<u8>) {
        // What was done before is drawn by then.
        std::thread::sleep(Duration::from_millis(500));
        self.key("p");
        let bytes = wait_for("a picture", || {
            let path = std::fs::read_dir(self.folder).ok()?.flatten().map(|entry| entry.path());
            let path = path.into_iter().find(|path| path.extension().is_some_and(|extension| extension == "png"))?;
            let bytes = std::fs::read(&path).ok().filter(|bytes| bytes.ends_with(b"IEND\xaeB`\x82"))?;
            std::fs::remove_file(path).ok()?;
            Some(bytes)
        });
        ([16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four bytes"))), bytes)
    }

    /// What the whole screen shows, panels and all.
    fn screenshot(&self) -> Vec<u8> {
        // Longer than anything fades in.
        std::thread::sleep(Duration::from_secs(1));
        std::fs::read(self.screen.memory.path().join("Xvfb_screen0")).expect("the memory of the screen")
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
    screen.tell(&["key", "--window", &window, "q"]);
    ends_well(program);
}

/// A recording of two seconds in `out`, in which nothing is violated.
fn flown(folder: &Path) {
    let flown = Command::new(env!("CARGO_BIN_EXE_tautline"))
        .args(["run", "pentagon", "--quiet", "--no-snapshots", "--no-figures", "--out", "out"])
        .args(["--set", "time.duration_s=2"])
        .current_dir(folder)
        .status()
        .expect("the program runs");
    assert!(flown.code() <= Some(1));
}

#[test]
fn every_layer_theme_and_turn_changes_the_picture_and_back_again() {
    let (folder, screen) = (tempfile::tempdir().expect("a folder"), Screen::new());
    let (program, watched) = Watched::at_the_end(&screen, folder.path());
    // The first picture may be of a window that is not as large as it will be.
    watched.picture();
    let whole = watched.picture();
    assert_eq!(watched.picture(), whole, "nothing was done, and the words on its writing take no room from it");
    for layer in ["1", "2", "3", "4", "5", "6", "7", "8"] {
        watched.key(layer);
        assert!(watched.picture() != whole, "layer {layer} off");
        watched.key(layer);
        assert!(watched.picture() == whole, "layer {layer} on again");
    }
    for theme in ["light", "paper"] {
        watched.key("t");
        assert!(watched.picture() != whole, "{theme}");
    }
    watched.key("t");
    assert!(watched.picture() == whole, "dark again");
    // Whatever turns, moves or approaches is undone by framing.
    for (what, key) in [("A", "a"), ("W", "w"), ("Page Up", "Prior"), ("Page Down", "Next")] {
        watched.key(key);
        assert!(watched.picture() != whole, "{what}");
        watched.key("f");
        assert!(watched.picture() == whole, "framed after {what}");
    }
    let drags: [(&str, &[&str]); 4] = [
        ("drag", &["mousedown", "1", "sleep", "0.3", "mousemove_relative", "80", "30", "sleep", "0.3", "mouseup", "1"]),
        (
            "right drag",
            &["mousedown", "3", "sleep", "0.3", "mousemove_relative", "80", "30", "sleep", "0.3", "mouseup", "3"],
        ),
        ("wheel up", &["click", "4"]),
        ("wheel down", &["click", "5"]),
    ];
    for (what, act) in drags {
        watched.mouse(400, 300, act);
        assert!(watched.picture() != whole, "{what}");
        watched.key("f");
        assert!(watched.picture() == whole, "framed after {what}");
    }
    // Another size, and the one before.
    screen.tell(&["windowsize", "--sync", &watched.window, "900", "600"]);
    watched.picture();
    let ([width, height], _) = watched.picture();
    assert!(width < whole.0[0] && height < whole.0[1], "{width} x {height}");
    watched.key("q");
    ends_well(program);
}

/// Where the first vehicle is at the end of a recording in a framed picture of this size \[pixels\].
fn first_vehicle(recording: &Path, size_px: [u32; 2]) -> [u32; 2] {
    let timeline = Timeline::read_mcap(recording).expect("a recording");
    let extent = Extent::of(&timeline);
    let (orbit, target_m) = extent.orbit(size_px);
    let frame = timeline.log.at(f64::INFINITY).expect("a frame");
    let place = frame.positions_m.row(0).transpose().fixed_rows::<3>(0) - extent.origin_m();
    let at = Camera::orbiting(orbit, target_m, size_px).project(place).expect("before the camera");
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels of the picture")]
    let at_px = at.at_px.map(|pixels| pixels.round() as u32);
    at_px
}

#[test]
fn help_and_what_is_picked_are_shown_and_taken_away() {
    let (folder, screen) = (tempfile::tempdir().expect("a folder"), Screen::new());
    let (program, watched) = Watched::at_the_end(&screen, folder.path());
    // Where nothing is that a pointer would change.
    watched.mouse(5, 5, &[]);
    watched.picture();
    let (size_px, _) = watched.picture();
    // What was said of the pictures goes with the next key.
    watched.key("End");
    let plain = watched.screenshot();
    assert!(watched.screenshot() == plain, "nothing was done");
    watched.key("h");
    assert!(watched.screenshot() != plain, "help");
    watched.key("h");
    assert!(watched.screenshot() == plain, "no help");
    watched.key("v");
    let first = watched.screenshot();
    assert!(first != plain, "the first vehicle is picked");
    watched.key("v");
    assert!(![&plain, &first].contains(&&watched.screenshot()), "the second one");
    // There are five: after the last one comes none.
    for _ in 0..4 {
        watched.key("v");
    }
    assert!(watched.screenshot() == plain, "none is picked");
    let [x, y] = first_vehicle(&folder.path().join("out/run.mcap"), size_px);
    watched.mouse(x, y, &["sleep", "0.3", "click", "1", "sleep", "0.3"]);
    watched.mouse(5, 5, &[]);
    assert!(watched.screenshot() == first, "the first vehicle is picked by a click at {x}, {y}");
    watched.mouse(5, 5, &["click", "1"]);
    assert!(watched.screenshot() == plain, "a click on nothing picks none");
    watched.key("q");
    ends_well(program);
}

#[test]
fn a_display_that_goes_ends_the_program_without_a_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut screen = Screen::new();
    let (mut program, window) = screen.open(folder.path(), &["pentagon"]);
    screen.tell(&["windowsize", &window, "500", "300"]);
    screen.server.kill().expect("a server");
    wait_for("the end", || program.try_wait().expect("the program can be waited for"));
    let done = program.wait_with_output().expect("its output");
    let err = String::from_utf8_lossy(&done.stderr);
    // The library of X may notice first, and ends programs by itself, with 1.
    let code = done.status.code();
    assert!(code == Some(1) || code == Some(3) && err.contains("the display is gone"), "{code:?}: {err}");
    assert!(!err.contains("panicked"), "{err}");
}

#[test]
fn a_recording_opens_and_a_window_that_is_closed_ends_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    flown(folder.path());
    let screen = Screen::new();
    let (program, window) = screen.open(folder.path(), &["out/run.mcap", "--theme", "light"]);
    screen.tell(&["key", "--window", &window, "Escape"]);
    ends_well(program);
}
