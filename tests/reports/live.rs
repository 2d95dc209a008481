//! The page of a live watch in a real browser.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::browser::LivePage;

/// Name, position along x and y \[m\], and velocity along x \[m/s\] of a vehicle.
type Pose = (&'static str, f64, f64, f64);

/// A watch with its page, which reads poses from a thread.
struct Watch {
    program: Child,
    page: LivePage,
    has_input: Arc<AtomicBool>,
    feed: JoinHandle<()>,
}

impl Watch {
    /// Starts a watch in a folder. `poses` gives the vehicles at a time \[s\]; stamps run `rate` times as fast as the
    /// time.
    fn start(folder: &Path, arguments: &[&str], rate: f64, poses: impl Fn(f64) -> Vec<Pose> + Send + 'static) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_tautline"))
            .args(["watch", "-", "--delta", "0.6", "--page=127.0.0.1:0", "--quiet"])
            .args(arguments)
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program runs");
        let mut line = String::new();
        BufReader::new(program.stderr.take().expect("a pipe")).read_line(&mut line).expect("a line");
        let mut page = LivePage::open(folder, line.trim().trim_start_matches("live page: "));
        page.wait_for(&level("undecided"));
        let mut input = program.stdin.take().expect("a pipe");
        let has_input = Arc::new(AtomicBool::new(true));
        let more = Arc::clone(&has_input);
        let feed = std::thread::spawn(move || {
            let began = Instant::now();
            while more.load(Ordering::Relaxed) {
                let t_s = rate * began.elapsed().as_secs_f64();
                for (id, x, y, vx) in poses(t_s) {
                    let pose = format!(r#"{{"t":{t_s},"id":"{id}","x":{x},"y":{y},"z":2,"vx":{vx},"vy":0,"vz":0}}"#);
                    writeln!(input, "{pose}").expect("written");
                }
                std::thread::sleep(Duration::from_millis(40));
            }
        });
        Self { program, page, has_input, feed }
    }

    /// Ends the input. Returns the page after the end of the program, and its exit code.
    fn end(mut self) -> (LivePage, Option<i32>) {
        // Counts the attempts of the page to connect again.
        self.page.evaluate(
            "window.attempts = 0; window.WebSocket = class extends WebSocket {
               constructor(...given) { super(...given); window.attempts++; }
             }; 0",
        );
        self.has_input.store(false, Ordering::Relaxed);
        self.feed.join().expect("fed");
        let exit = self.program.wait().expect("ends").code();
        self.page.wait_for(&begins("#verdict", "the watch has ended"));
        // The page still shows the result while it tries to connect.
        self.page.wait_for("window.attempts >= 2");
        (self.page, exit)
    }
}

fn level(level: &str) -> String {
    format!("document.querySelector('#band').dataset.level === '{level}'")
}

/// Returns the condition that the text of an element begins with these characters.
fn begins(element: &str, text: &str) -> String {
    format!("document.querySelector('{element}').textContent.startsWith('{text}')")
}

#[test]
fn the_page_of_a_watch_shows_its_states_and_its_result() {
    // Distance of `a` and `b` over time: from 5.7 m to 0.3 m, again and again.
    const MEAN_M: f64 = 3.0;
    const SWING_M: f64 = 2.7;
    const RATE_PER_S: f64 = 0.7;
    let folder = tempfile::tempdir().expect("a folder");
    let has_third = Arc::new(AtomicBool::new(true));
    let third = Arc::clone(&has_third);
    let mut watch = Watch::start(folder.path(), &["--accel", "2", "--horizon", "1.5"], 1.0, move |t_s| {
        let apart_m = MEAN_M + SWING_M * (RATE_PER_S * t_s).cos();
        let speed_m_s = -SWING_M * RATE_PER_S * (RATE_PER_S * t_s).sin();
        let third = third.load(Ordering::Relaxed).then_some(("c", 0.0, 8.0, 0.0));
        [("a", 0.0, 0.0, 0.0), ("b", apart_m, 0.0, speed_m_s)].into_iter().chain(third).collect()
    });
    let page = &mut watch.page;
    page.wait_for(&level("clear"));
    page.wait_for("document.title === '\u{2713} CLEAR - tautline watch'");
    page.wait_for("document.querySelectorAll('#pairs tr').length === 3");
    page.wait_for(&begins("#absent", "3 of 3 vehicles are drawn."));
    page.evaluate("document.querySelector('#sound').click()");
    assert_eq!(page.evaluate("document.querySelector('#sound').getAttribute('aria-pressed')"), "true");

    page.wait_for(&level("warning"));
    page.wait_for("/^brake a and b (within [0-9.]+ s|now)$/.test(document.querySelector('#brake').textContent)");
    page.wait_for(&begins("#word", "CLEAR, on course to violate"));

    page.wait_for(&level("violation"));
    page.wait_for("document.title.startsWith('\u{2716} VIOLATION')");
    page.wait_for("document.querySelector('#pairs tr').className === 'reasons'");
    has_third.store(false, Ordering::Relaxed);
    page.wait_for("document.querySelector('#absent').textContent.includes('Stale: c.')");

    let (mut page, exit) = watch.end();
    assert_eq!(exit, Some(1));
    assert_eq!(page.evaluate(&level("violation")), true);
    assert_eq!(page.evaluate("document.querySelector('#word').textContent"), "ENDED: VIOLATION");
}

#[test]
fn the_page_shows_a_vehicle_off_its_plan_with_slow_stamps() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = "time_s,id,x,y,z\n0,A B,0,0,2\n0,b,4,0,2\n1000,A B,0,0,2\n1000,b,4,0,2\n";
    std::fs::write(folder.path().join("plan.csv"), plan).expect("written");
    let arguments = ["--accel", "2", "--time", "stamps", "--plan", "plan.csv", "--tube", "0.5"];
    // Stamps run at half of the speed of the clock.
    let poses = |t_s| vec![("A B", 0.0, 0.0, 0.0), ("b", 5.0 + 0.25 * t_s, 0.0, 0.25)];
    let mut watch = Watch::start(folder.path(), &arguments, 0.5, poses);
    watch.page.wait_for(&level("warning"));
    watch.page.wait_for(&begins("#word", "CLEAR, OFF PLAN"));
    watch.page.wait_for("document.querySelector('#pairs td').textContent === 'A B and b'");
    for (vehicle, speed) in [("A B", "0.00"), ("b", "0.25")] {
        watch.page.evaluate(
            "document.querySelector('.replay-view').dispatchEvent(new KeyboardEvent('keydown',
               { key: 'v', bubbles: true })); 0",
        );
        watch.page.wait_for(&begins(".replay-picked", &format!("vehicle {vehicle} \u{b7} {speed} m/s")));
    }
    // After seconds the page is not behind, although its stamps are.
    watch.page.wait_for("/^[3-9]/.test(document.querySelector('#verdict').textContent)");
    assert_eq!(watch.page.evaluate(&level("warning")), true);

    let (mut page, exit) = watch.end();
    assert_eq!(exit, Some(1));
    assert_eq!(page.evaluate("document.querySelector('#word').textContent"), "ENDED: OFF PLAN");
    assert_eq!(page.evaluate(&level("violation")), true);
}
