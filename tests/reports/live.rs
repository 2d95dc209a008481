//! The page of a live watch in a real browser.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::browser::LivePage;

/// Distance of the two vehicles over time: `MEAN_M + SWING_M cos(RATE_PER_S t)`, from 5.7 m to 0.3 m.
const MEAN_M: f64 = 3.0;
const SWING_M: f64 = 2.7;
const RATE_PER_S: f64 = 0.7;

#[test]
fn the_page_of_a_watch_shows_its_states_and_its_result() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut watch = Command::new(env!("CARGO_BIN_EXE_tautline"))
        .args(["watch", "-", "--delta", "0.6", "--accel", "2", "--horizon", "1.5", "--page=127.0.0.1:0", "--quiet"])
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

    // Two vehicles approach each other again and again in real time, and a third one rests.
    let mut input = watch.stdin.take().expect("a pipe");
    let (has_third, has_input) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicBool::new(true)));
    let (third, more) = (Arc::clone(&has_third), Arc::clone(&has_input));
    let feed = std::thread::spawn(move || {
        let began = Instant::now();
        while more.load(Ordering::Relaxed) {
            let t_s = began.elapsed().as_secs_f64();
            let apart_m = MEAN_M + SWING_M * (RATE_PER_S * t_s).cos();
            let speed_m_s = -SWING_M * RATE_PER_S * (RATE_PER_S * t_s).sin();
            let mut poses = vec![("a", 0.0, 0.0, 0.0), ("b", apart_m, 0.0, speed_m_s)];
            if third.load(Ordering::Relaxed) {
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
    page.wait_for("document.title === '\u{2713} CLEAR - tautline watch'");
    page.wait_for("document.querySelectorAll('#pairs tr').length === 3");
    page.wait_for("document.querySelector('#absent').textContent === '3 of 3 vehicles are drawn.'");
    page.evaluate("document.querySelector('#sound').click()");
    assert_eq!(page.evaluate("document.querySelector('#sound').getAttribute('aria-pressed')"), "true");

    page.wait_for(&level("warning"));
    page.wait_for("/^brake a-b (by [0-9.]+ s|now)$/.test(document.querySelector('#brake').textContent)");
    page.wait_for("document.querySelector('#word').textContent === 'CLEAR, on course to violate'");

    page.wait_for(&level("violation"));
    page.wait_for("document.title.startsWith('\u{2716} VIOLATION')");
    page.wait_for("document.querySelector('#pairs tr').className === 'reasons'");
    has_third.store(false, Ordering::Relaxed);
    page.wait_for("document.querySelector('#absent').textContent.includes('Stale: c.')");

    has_input.store(false, Ordering::Relaxed);
    feed.join().expect("fed");
    assert_eq!(watch.wait().expect("ends").code(), Some(1));
    page.wait_for("document.querySelector('#verdict').textContent.startsWith('the watch has ended')");
    // The page tries to connect again, and still shows the result.
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(page.evaluate(&level("violation")), true);
    assert_eq!(page.evaluate("document.querySelector('#word').textContent"), "ENDED: VIOLATION");
}
