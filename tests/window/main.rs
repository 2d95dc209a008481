//! The window on a virtual screen: it opens, plays, reacts to keys and mouse, and closes.
//!
//! Needs `Xvfb`, `xdotool` and a driver for windows; `tests/run.sh` installs them.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tautline::render::{Extent, Timeline, View};

/// Longest wait on a slow machine.
const MAX_WAIT: Duration = Duration::from_mins(1);

/// Virtual screen, stopped when dropped.
struct Screen {
    server: Child,
    display: String,
    /// Folder with the frame buffer of the screen.
    memory: tempfile::TempDir,
    /// Lock for one window at a time: playback follows the clock only if pictures are drawn fast enough.
    _turn: MutexGuard<'static, ()>,
}

impl Screen {
    fn new() -> Self {
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let memory = tempfile::tempdir().expect("a folder");
        // Without `-noreset` the server restarts, and drops the window, when the last client disconnects for a moment.
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

    /// Runs `xdotool` and returns its output.
    fn xdotool(&self, arguments: &[&str]) -> String {
        let done = Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &self.display)
            .output()
            .unwrap_or_else(|error| panic!("cannot start xdotool: {error}; `sh tests/run.sh` installs it"));
        String::from_utf8_lossy(&done.stdout).trim().to_owned()
    }

    /// Returns the content of the whole screen.
    fn content(&self) -> Vec<u8> {
        std::fs::read(self.memory.path().join("Xvfb_screen0")).expect("the memory of the screen")
    }

    fn open(&self, folder: &Path, arguments: &[&str]) -> (Child, String) {
        let empty = self.content();
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
            let found = self.xdotool(&["search", "--name", "^tautline: "]);
            found.lines().next().map(str::to_owned)
        });
        // Keys reach the window once it has been drawn and has the focus.
        wait_for("the first picture of the window", || (self.content() != empty).then_some(()));
        self.xdotool(&["windowfocus", "--sync", &window]);
        (program, window)
    }
}

/// Window on a paused flight.
struct OpenWindow<'a> {
    screen: &'a Screen,
    window: String,
    folder: &'a Path,
}

impl<'a> OpenWindow<'a> {
    /// Opens a window at the end of a recording, which is flown first.
    fn at_the_end(screen: &'a Screen, folder: &'a Path) -> (Child, Self) {
        fly(folder);
        let (program, window) = screen.open(folder, &["out/run.mcap"]);
        let window = Self { screen, window, folder };
        window.key("End");
        (program, window)
    }

    /// Presses a key.
    fn key(&self, key: &str) {
        self.screen.xdotool(&["key", "--window", &self.window, key]);
    }

    /// Moves the mouse to a position in the window.
    fn move_mouse(&self, x: u32, y: u32) {
        self.screen.xdotool(&["mousemove", "--window", &self.window, &x.to_string(), &y.to_string()]);
    }

    /// Moves the mouse to a position in the window and acts there, each action in a frame of its own.
    fn mouse(&self, x: u32, y: u32, actions: &[&[&str]]) {
        self.move_mouse(x, y);
        for action in actions {
            self.picture();
            self.screen.xdotool(action);
        }
    }

    /// Returns size and bytes of the picture after all earlier inputs, as the window saves it.
    fn picture(&self) -> ([u32; 2], Vec<u8>) {
        // The first picture may precede an input of the same frame. The wheel moves the camera for several frames.
        self.saved_picture();
        let mut picture = self.saved_picture();
        loop {
            let next = self.saved_picture();
            if next == picture {
                return picture;
            }
            picture = next;
        }
    }

    fn saved_picture(&self) -> ([u32; 2], Vec<u8>) {
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

    /// Returns the content of the whole screen, with panels, when it has been the same for longer than any animation.
    fn screenshot(&self) -> Vec<u8> {
        let (mut content, mut since) = (self.screen.content(), Instant::now());
        wait_for("the end of all animations", || {
            let next = self.screen.content();
            if next != content {
                (content, since) = (next, Instant::now());
            }
            (since.elapsed() > Duration::from_secs(1)).then(|| content.clone())
        })
    }

    /// Waits until the whole screen, with panels, fulfils a condition.
    fn wait_for_screen(&self, what: &str, is_reached: impl Fn(&[u8]) -> bool) {
        wait_for(what, || is_reached(&self.screen.content()).then_some(()));
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
        assert!(began.elapsed() < MAX_WAIT, "waited too long for {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Waits for the program to end with success and without errors.
fn assert_ends_well(program: Child) {
    let began = Instant::now();
    let mut program = program;
    while program.try_wait().expect("the program can be waited for").is_none() {
        if began.elapsed() > MAX_WAIT {
            let _ = program.kill();
            panic!("the window does not close");
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let done = program.wait_with_output().expect("its output");
    let err = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success() && !err.contains("panicked") && !err.contains("error"), "{:?}: {err}", done.status);
}

/// Returns the times in the names of the saved pictures.
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
fn the_window_plays_reacts_to_keys_and_closes() {
    let folder = tempfile::tempdir().expect("a folder");
    let screen = Screen::new();
    let (program, window) = screen.open(folder.path(), &["pentagon", "--set", "time.duration_s=60"]);
    // Pause, closest approach, picture, next sample, picture.
    for key in ["space", "n", "p"] {
        screen.xdotool(&["key", "--window", &window, key]);
    }
    wait_for("a picture", || (pictures(folder.path()).len() == 1).then_some(()));
    let closest_s = pictures(folder.path())[0];
    assert!((2.0..2.3).contains(&closest_s), "the pentagon is closest at 2.15 s, not at {closest_s} s");
    screen.xdotool(&["key", "--window", &window, "Right"]);
    screen.xdotool(&["key", "--window", &window, "p"]);
    wait_for("another picture", || (pictures(folder.path()).len() == 2).then_some(()));
    let next_s = pictures(folder.path())[1];
    assert!(next_s - closest_s < 0.02, "a step is a sample: {closest_s} s to {next_s} s");
    for _ in 0..10 {
        screen.xdotool(&["key", "--window", &window, "Right"]);
    }
    screen.xdotool(&["key", "--window", &window, "p"]);
    wait_for("a picture ten samples on", || (pictures(folder.path()).len() == 3).then_some(()));
    let later_s = pictures(folder.path())[2];
    assert!((0.15..0.18).contains(&(later_s - next_s)), "ten steps at 60 Hz: {next_s} s to {later_s} s");
    // Playback advances the time.
    screen.xdotool(&["key", "--window", &window, "space"]);
    wait_for("a picture half a second later", || {
        screen.xdotool(&["key", "--window", &window, "p"]);
        pictures(folder.path()).last().filter(|&&last_s| last_s > later_s + 0.5).copied()
    });
    screen.xdotool(&["key", "--window", &window, "q"]);
    assert_ends_well(program);
}

/// Flies a recording of two seconds without violations to `out`.
fn fly(folder: &Path) {
    let fly = Command::new(env!("CARGO_BIN_EXE_tautline"))
        .args(["run", "pentagon", "--quiet", "--no-snapshots", "--no-figures", "--out", "out"])
        .args(["--set", "time.duration_s=2"])
        .current_dir(folder)
        .status()
        .expect("the program runs");
    assert!(fly.code() <= Some(1));
}

#[test]
fn keys_and_camera_movements_change_the_picture_reversibly() {
    let (folder, screen) = (tempfile::tempdir().expect("a folder"), Screen::new());
    let (program, window) = OpenWindow::at_the_end(&screen, folder.path());
    // The first picture may precede the final size of the window.
    window.picture();
    let whole = window.picture();
    assert_eq!(window.picture(), whole, "without input the picture is the same; the message takes no room from it");
    // Each key returns to the first picture after this number of presses.
    for (what, key, presses) in [("labels", "l", 2), ("trails", "t", 3), ("colours", "c", 4), ("theme", "m", 2)] {
        for press in 1..=presses {
            window.key(key);
            assert_eq!(window.picture() == whole, press == presses, "{what} after {press}");
        }
    }
    // The flight is planar, so that the first camera is that from the top.
    for (what, key, is_same) in [("perspective", "1", false), ("front", "3", false), ("top", "2", true)] {
        window.key(key);
        assert_eq!(window.picture() == whole, is_same, "{what}");
    }
    // Framing undoes every camera movement.
    for (what, key) in [("A", "a"), ("W", "s"), ("Page Up", "Prior"), ("Page Down", "Next")] {
        window.key(key);
        assert!(window.picture() != whole, "{what}");
        window.key("2");
        assert!(window.picture() == whole, "framed after {what}");
    }
    let drags: [(&str, &[&[&str]]); 4] = [
        ("drag", &[&["mousedown", "1"], &["mousemove_relative", "80", "30"], &["mouseup", "1"]]),
        ("right drag", &[&["mousedown", "3"], &["mousemove_relative", "80", "30"], &["mouseup", "3"]]),
        ("wheel up", &[&["click", "4"]]),
        ("wheel down", &[&["click", "5"]]),
    ];
    for (what, actions) in drags {
        window.mouse(400, 300, actions);
        assert!(window.picture() != whole, "{what}");
        window.key("2");
        assert!(window.picture() == whole, "framed after {what}");
    }
    window.key("f");
    assert!(window.picture() != whole, "the camera follows the swarm");
    window.key("f");
    assert!(window.picture() == whole, "the whole flight again");
    // Another size, then the previous one.
    screen.xdotool(&["windowsize", "--sync", &window.window, "900", "600"]);
    window.picture();
    let ([width, height], _) = window.picture();
    assert!(width < whole.0[0] && height < whole.0[1], "{width} x {height}");
    window.key("q");
    assert_ends_well(program);
}

/// Returns the position of the first vehicle at the end of a recording in a framed picture of this size \[pixels\].
fn first_vehicle(recording: &Path, size_px: [u32; 2]) -> [u32; 2] {
    let timeline = Timeline::read_mcap(recording).expect("a recording");
    let extent = Extent::of(&timeline);
    let frame = timeline.log.at(f64::INFINITY).expect("a frame");
    let camera = extent.camera(&timeline, &frame, &View { size_px, ..View::default() }).expect("a camera");
    let place = frame.positions_m.row(0).transpose().fixed_rows::<3>(0) - extent.origin_m();
    let at = camera.project(place).expect("before the camera");
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels of the picture")]
    let at_px = at.at_px.map(|pixels| pixels.round() as u32);
    at_px
}

#[test]
fn help_and_picked_vehicles_are_shown_and_hidden() {
    let (folder, screen) = (tempfile::tempdir().expect("a folder"), Screen::new());
    let (program, window) = OpenWindow::at_the_end(&screen, folder.path());
    // A pointer here changes nothing.
    window.move_mouse(5, 5);
    window.picture();
    let (size_px, _) = window.picture();
    // The next key clears the message about saved pictures.
    window.key("End");
    let plain = window.screenshot();
    assert!(window.screenshot() == plain, "without input the screen is the same");
    window.key("h");
    window.wait_for_screen("help", |screen| screen != plain);
    window.key("h");
    window.wait_for_screen("a screen without help", |screen| screen == plain);
    window.key("v");
    let first = window.screenshot();
    assert!(first != plain, "the first vehicle is picked");
    window.key("v");
    assert!(![&plain, &first].contains(&&window.screenshot()), "the second one");
    // There are five vehicles: after the last one no vehicle is picked.
    for _ in 0..4 {
        window.key("v");
    }
    window.wait_for_screen("a screen without a picked vehicle", |screen| screen == plain);
    let [x, y] = first_vehicle(&folder.path().join("out/run.mcap"), size_px);
    window.mouse(x, y, &[&["click", "1"]]);
    window.picture();
    window.move_mouse(5, 5);
    window.key("End");
    window.wait_for_screen(&format!("a vehicle picked by a click at {x}, {y}"), |screen| screen == first);
    window.mouse(5, 5, &[&["click", "1"]]);
    window.picture();
    window.key("End");
    window.wait_for_screen("a click on the background that picks no vehicle", |screen| screen == plain);
    window.key("q");
    assert_ends_well(program);
}

#[test]
fn a_closed_display_ends_the_program_without_a_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut screen = Screen::new();
    let (mut program, window) = screen.open(folder.path(), &["pentagon"]);
    screen.xdotool(&["windowsize", &window, "500", "300"]);
    screen.server.kill().expect("a server");
    wait_for("the end", || program.try_wait().expect("the program can be waited for"));
    let done = program.wait_with_output().expect("its output");
    let err = String::from_utf8_lossy(&done.stderr);
    // The X library may notice first and end the program with code 1.
    let code = done.status.code();
    assert!(code == Some(1) || code == Some(3) && err.contains("the display is gone"), "{code:?}: {err}");
    assert!(!err.contains("panicked"), "{err}");
}

#[test]
fn closing_the_window_ends_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    fly(folder.path());
    let screen = Screen::new();
    let (program, window) = screen.open(folder.path(), &["out/run.mcap", "--theme", "light"]);
    screen.xdotool(&["key", "--window", &window, "Escape"]);
    assert_ends_well(program);
}
