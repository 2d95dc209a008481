//! The page of a live watch in a real browser.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::browser::LivePage;

/// Closing speed of the two vehicles \[m/s\], and their first distance \[m\].
const SPEED_M_S: f64 = 2.0;
const FIRST_M: f64 = 9.0;
/// Time until which a third vehicle sends \[s\].
const LAST_OF_THIRD_S: f64 = 3.5;

#[test]
fn the_page_of_a_watch_shows_its_states_and_its_result() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut watch = Command::new(env!("CARGO_BIN_EXE_tautline"))
        .args(["watch", "-", "--delta", "0.6", "--accel", "1", "--horizon", "1.5", "--page=127.0.0.1:0", "--quiet"])
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut line = String::new();
    BufReader::new(watch.stderr.take().expect("a pipe")).read_line(&mut line).expect("a line");
    let url = line.trim().trim_start_matches("live page: ").to_owned();
    let mut page = LivePage::open(folder.path(), &url);
    let level = |level: &str| format!("document.querySelector('#band').dataset.level === '{level}'");
    page.wait_for(&level("undecided"));

    // Two vehicles approach each other in real time, a third one falls silent.
    let mut input = watch.stdin.take().expect("a pipe");
    let feed = std::thread::spawn(move || {
        let began = Instant::now();
        loop {
            let t_s = began.elapsed().as_secs_f64();
            let apart_m = FIRST_M - SPEED_M_S * t_s;
            if apart_m < -0.4 {
                return;
            }
            let mut poses = vec![("a", 0.0, 0.0, 0.0), ("b", apart_m, 0.0, -SPEED_M_S)];
            if t_s < LAST_OF_THIRD_S {
                poses.push(("c", 0.0, 8.0, 0.0));
            }
            for (id, x, y, vx) in poses {
                let pose = format!(r#"{{"t":{t_s},"id":"{id}","x":{x},"y":{y},"z":2,"vx":{vx},"vy":0,"vz":0}}"#);
                writeln!(input, "{pose}").expect("written");
            }
            std::thread::sleep(Duration::from_millis(40));
        }
    });
    page.wait_for(&level("clear"));
    assert_eq!(page.evaluate("document.title"), "\u{2713} CLEAR - tautline watch");
    assert_eq!(page.evaluate("document.querySelectorAll('#pairs tr').length"), 3);
    page.evaluate("document.querySelector('#sound').click()");
    assert_eq!(page.evaluate("document.querySelector('#sound').getAttribute('aria-pressed')"), "true");

    page.wait_for(&level("warning"));
    page.wait_for("/^brake a-b (by [0-9.]+ s|now)$/.test(document.querySelector('#brake').textContent)");
    assert_eq!(page.evaluate("document.querySelector('#word').textContent"), "CLEAR, on course to violate");

    page.wait_for(&level("violation"));
    page.wait_for("document.querySelector('#absent').textContent.includes('Stale: c.')");
    page.wait_for("document.title.startsWith('\u{2716} VIOLATION')");
    assert_eq!(page.evaluate("document.querySelector('#pairs tr').className"), "reasons");

    feed.join().expect("fed");
    assert_eq!(watch.wait().expect("ends").code(), Some(1));
    page.wait_for("document.querySelector('#verdict').textContent.startsWith('the watch has ended')");
    // The page tries to connect again, and still shows the result.
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(page.evaluate(&level("violation")), true);
    assert_eq!(page.evaluate("document.querySelector('#word').textContent"), "VIOLATION");
}
