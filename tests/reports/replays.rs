//! Replays in a real browser: drawing, texts, and the restrictions of the page.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use tautline::render::{Extent, Timeline, View};

use crate::browser::WITHOUT_WEBGL;
use crate::replays_in_browser::{steer, steer_with};
use crate::report::{closest, number};

const DESKTOP: (u32, bool) = (1000, false);

/// Runs the program in a folder and returns the path of a file that it writes.
fn run_program(folder: &Path, arguments: &[&str], file: &str) -> PathBuf {
    let program = Command::new(env!("CARGO_BIN_EXE_tautline")).args(arguments).current_dir(folder).output();
    let program = program.expect("the program runs");
    assert!(program.status.code() <= Some(1), "{}", String::from_utf8_lossy(&program.stderr));
    folder.join(file)
}

fn fly(folder: &Path, arguments: &[&str]) -> PathBuf {
    run_program(folder, &[&["run", "--quiet", "--out", "run"], arguments].concat(), "run/report.html")
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

#[test]
fn the_scripts_pass_the_type_check() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let check = |file: &Path| {
        let compiler = root.join("target/typescript/node_modules/.bin/tsc");
        let output = Command::new(&compiler)
            .args(["--noEmit", "--strict", "--checkJs", "--allowJs", "--target", "es2023"])
            .args(["--lib", "es2023,dom,dom.iterable"])
            .arg(file)
            .output()
            .unwrap_or_else(|error| {
                panic!("cannot start {}: {error}; `sh tests/setup.sh` installs it", compiler.display())
            });
        (output.status.success(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let folder = tempfile::tempdir().expect("a folder");
    let wrong = folder.path().join("wrong.js");
    for (name, right_part, wrong_part) in [
        ("replay.js", "const first = times[0]", "const first = `${times[0]}`"),
        ("live.js", "let waits = 500", "let waits = `500`"),
    ] {
        let script = root.join("assets").join(name);
        let (is_right, said) = check(&script);
        assert!(is_right, "{said}");
        let source = fs::read_to_string(&script).expect("a script");
        fs::write(&wrong, source.replacen(right_part, wrong_part, 1)).expect("written");
        assert!(!check(&wrong).0, "a wrong type in {name} is detected");
    }
}

#[test]
fn a_replay_draws_and_jumps_to_the_findings_of_the_audit() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["pentagon-laplacian", "--set", "time.duration_s=10"]);
    let report = fs::read_to_string(folder.path().join("run/report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let (found, said) = steer(
        folder.path(),
        &page,
        DESKTOP,
        "const words = name => doc.querySelector('.replay-' + name).textContent;
         const view = doc.querySelector('.replay-view'), pen = doc.createElement('canvas').getContext('2d', {
           willReadFrequently: true });
         [pen.canvas.width, pen.canvas.height] = [view.width, view.height];
         const colours = () => {
           root.player.draw(); pen.drawImage(view, 0, 0);
           const all = pen.getImageData(0, 0, view.width, view.height).data, seen = new Set();
           for (let k = 0; k < all.length; k += 4) seen.add(all[k] << 16 | all[k + 1] << 8 | all[k + 2]);
           return [...seen];
         };
         const start = { state: words('state'), clock: words('clock'), colours: colours().length };
         key('n'); const closest = { said: words('said'), state: words('state'), clock: words('clock') };
         const reds = colours().filter(colour => (colour >> 16) > 180 && (colour >> 8 & 255) < 60).length;
         key('Home'); key('b'); const violation = { said: words('said') };
         key('End'); const end = { state: words('state'), clock: words('clock'), said: words('said') };
         key('Home'); key('ArrowRight'); key('ArrowRight'); const steps = words('clock');
         return { start, closest, reds, violation, end, steps, state: root.dataset.state,
           loaded: win.performance.getEntriesByType('resource').length };",
    );
    assert!(said.is_empty(), "{said:?}");
    assert_eq!((text(&found["state"]), &found["loaded"]), ("ready", &Value::from(0)), "{found}");
    assert!(text(&found["start"]["state"]).starts_with("no violation so far"), "{found}");
    assert!(found["start"]["colours"].as_u64() > Some(100), "{found}");
    let [min_m, at_s] = ["/value/lower", "/at_s"].map(|path| number(closest(&report), path));
    let at = format!("{at_s:.2} s");
    let least = format!("{:.6}", (min_m * 1e6).floor() / 1e6);
    let said = text(&found["closest"]["said"]);
    assert!(said.contains(&least) && said.ends_with(&format!("4 and 5 at {at_s:.3} s")), "{said}: {least}");
    assert_eq!(found["closest"]["clock"], at.as_str());
    assert!(
        text(&found["closest"]["state"])
            .starts_with("violation: 4 and 5 come to 1.532 m (limit 2.000) · closest so far"),
        "{found}"
    );
    assert!(found["reds"].as_u64() > Some(20), "vehicles in violation are red: {found}");
    assert!(text(&found["violation"]["said"]).starts_with("Violation: 4 and 5 came to 1.532 m (limit 2.000) at"));
    assert!(text(&found["end"]["state"]) == "1 violation so far · closest so far 1.532 m, 4 and 5", "{found}");
    assert_eq!((text(&found["end"]["clock"]), text(&found["end"]["said"])), ("10.00 s", ""));
    assert_eq!(found["steps"], "0.03 s", "two samples of 60 a second");
}

/// The outline of a ball at a corner of the picture is an ellipse in perspective and a circle in a parallel view. Every
/// pixel off its edge is compared with the ray through it.
#[test]
fn a_ball_is_exact_to_the_pixel_anywhere_in_the_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    // Two vehicles that are never present together: one ball of 0.5 m is drawn, and no pair.
    let table = "t,id,x,y,z\n0,a,0,0,0\n1,a,0,0,0\n5,b,4,0,0\n6,b,4,0,0\n";
    fs::write(folder.path().join("two.csv"), table).expect("written");
    let page = run_program(
        folder.path(),
        &["audit", "two.csv", "--radius", "0.5", "--quiet", "--html", "two.html"],
        "two.html",
    );
    let script = "for (const box of doc.querySelectorAll('input[type=checkbox]')) { box.checked = false;
      box.dispatchEvent(new win.Event('change')); }
         const view = doc.querySelector('.replay-view'), pen = doc.createElement('canvas').getContext('2d', {
           willReadFrequently: true });
         [pen.canvas.width, pen.canvas.height] = [view.width, view.height];
         const shots = [];
         for (const [yaw, pitch, distance, target, parallel] of [[0, 0, 5, [0, 0, 0]], [0.4, 0.3, 6, [1, 1.5, 0.9]],
           [2, 0.5, 4, [-0.5, 0.7, 0.8]], [2, 0.5, 4, [-0.5, 0.7, 0.8], true]]) {
           const camera = root.player.look({ yaw, pitch, distance, target, t: 0.5, parallel });
           pen.drawImage(view, 0, 0);
           const all = pen.getImageData(0, 0, view.width, view.height).data, corner = all.slice(0, 3);
           let wrong = 0, inside = 0, edge = 0;
           for (let y = 0; y < view.height; y++) for (let x = 0; x < view.width; x++) {
             // Four rays half a pixel around the centre, with a margin for the shading of the edge.
             const hits = new Set();
             for (const [dx, dy] of [[0.5, 0.5], [-0.4, -0.4], [1.4, -0.4], [-0.4, 1.4], [1.4, 1.4]]) {
               const u = ((x + dx) / view.width * 2 - 1) * camera.tangent * view.width / view.height,
                 v = (1 - (y + dy) / view.height * 2) * camera.tangent;
               const across = [0, 1, 2].map(k => camera.right[k] * u + camera.up[k] * v);
               const ray = [0, 1, 2].map(k => (parallel ? 0 : across[k]) - camera.back[k]);
               const eye = [0, 1, 2].map(k => camera.eye[k] + (parallel ? across[k] * distance : 0));
               hits.add([0].some(ball => {
                 const at = camera.place(ball), to = [0, 1, 2].map(k => at[k] - eye[k]);
                 const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2], along = dot(to, ray) / dot(ray, ray);
                 return along > 0 && dot(to, to) - along * along * dot(ray, ray) < RADIUS * RADIUS;
               }));
             }
             if (hits.size > 1) { edge++; continue; }
             const k = 4 * (y * view.width + x), drawn = [0, 1, 2].some(c => Math.abs(all[k + c] - corner[c]) > 40);
             if (hits.has(true)) inside++;
             if (drawn !== hits.has(true)) wrong++;
           }
           shots.push({ wrong, inside, edge });
         }
         return shots;";
    let (found, _) = steer(folder.path(), &page, (800, false), &script.replace("RADIUS", "0.5"));
    assert_eq!(found.as_array().map(Vec::len), Some(4), "{found}");
    for shot in found.as_array().expect("pictures") {
        assert!(shot["inside"].as_u64() > Some(1500) && shot["edge"].as_u64() < Some(1500), "{found}");
        assert_eq!(shot["wrong"], 0, "{found}");
    }
    let (twin, _) = steer(folder.path(), &page, (800, false), &script.replace("RADIUS", "0.53"));
    assert!(twin[0]["wrong"].as_u64() > Some(50), "a ball of another size is detected: {twin}");
}

#[test]
fn a_replay_fits_a_phone_in_light_and_dark_and_runs_in_a_sandbox() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["pentagon", "--set", "time.duration_s=3"]);
    for dark in [false, true] {
        let (found, said) = steer(
            folder.path(),
            &page,
            (360, dark),
            "const view = doc.querySelector('.replay-view'), pen = doc.createElement('canvas').getContext('2d', {
              willReadFrequently: true });
             root.player.draw(); pen.drawImage(view, 0, 0);
             const sticking = [...doc.querySelectorAll('.replay *')].filter(e =>
               e.getBoundingClientRect().right > win.innerWidth + 8.5).length;
             return { wide: doc.documentElement.scrollWidth, sticking, paper: pen.getImageData(3, 60, 1, 1).data[0],
               named: [...doc.querySelectorAll(
                 '.replay button, .replay select, .replay input, .replay-view')].every(e =>
                 e.textContent.trim() || e.getAttribute('aria-label') || e.closest('label')) };",
        );
        assert!(said.is_empty(), "{said:?}");
        assert_eq!((&found["wide"], &found["sticking"]), (&Value::from(360), &Value::from(0)), "{found}");
        assert_eq!(found["paper"].as_u64() < Some(60), dark, "{found}");
        assert_eq!(found["named"], true, "everything has a name");
    }
    // In a sandbox the script needs neither the origin of the page nor its frame.
    let html = fs::read_to_string(&page).expect("a page");
    let outer = folder.path().join("outer.html");
    let inner = html.replace('&', "&amp;").replace('"', "&quot;");
    fs::write(
        &outer,
        format!(
            "<!doctype html><iframe sandbox=\"allow-scripts\" srcdoc=\"{inner}\"></iframe><div class=replay></div>"
        ),
    )
    .expect("written");
    let (_, said) = steer(folder.path(), &outer, DESKTOP, "return {};");
    assert!(said.is_empty(), "{said:?}");
    let without = fs::read_to_string(&outer).expect("a page").replace("allow-scripts", "allow-forms");
    fs::write(&outer, without).expect("written");
    let (_, said) = steer(folder.path(), &outer, DESKTOP, "return {};");
    assert!(
        said.iter().any(|line| line.contains("Blocked script execution")),
        "a blocked script is detected: {said:?}"
    );
}

#[test]
fn only_the_replay_script_runs_and_missing_webgl_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["pentagon", "--set", "time.duration_s=1"]);
    let html = fs::read_to_string(&page).expect("a page");
    assert_eq!(html.matches("script-src 'sha256-").count() + html.matches("script-src &#39;sha256-").count(), 1);
    let state = "return { state: root.dataset.state ?? 'none yet',
      none: doc.querySelector('.replay-none')?.textContent ?? '', ran: win.ran ?? false };";
    let (found, said) = steer(folder.path(), &page, DESKTOP, state);
    assert!(said.is_empty() && found["state"] == "ready" && found["ran"] == false, "{found} {said:?}");
    fs::write(&page, html.replace("<footer>", "<script>window.ran = true;</script><footer>")).expect("written");
    let (found, said) = steer(folder.path(), &page, DESKTOP, state);
    assert!(
        found["ran"] == false && said.iter().any(|line| line.contains("Content Security Policy")),
        "{found} {said:?}"
    );
    fs::write(&page, &html).expect("written");
    let (found, said) = steer_with(folder.path(), &page, DESKTOP, &WITHOUT_WEBGL, state);
    assert!(found["state"] == "none" && said.is_empty(), "{found} {said:?}");
    assert!(text(&found["none"]).contains("does not draw WebGL 2: a still picture replaces the replay"), "{found}");
    // A changed script does not run.
    fs::write(&page, html.replace("const ABSENT", "const  ABSENT")).expect("written");
    let (found, _) = steer(folder.path(), &page, DESKTOP, state);
    assert_eq!(found["state"], "none yet");
}

#[test]
fn names_are_escaped_and_absent_vehicles_are_not_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut table = "t,id,x,y,z\n".to_owned();
    for t in 0..=20 {
        let _ = writeln!(table, "{t},<img src=x onerror=ran=1>,{t},0,0");
        if !(6..=14).contains(&t) {
            let _ = writeln!(table, "{t},</script><b>b,{t},5,0");
        }
    }
    fs::write(folder.path().join("names.csv"), table).expect("written");
    let page = run_program(
        folder.path(),
        &["audit", "names.csv", "--delta", "1", "--quiet", "--html", "names.html"],
        "names.html",
    );
    let (found, said) = steer(
        folder.path(),
        &page,
        DESKTOP,
        "const there = t => { const { place } = root.player.look({
          yaw: 0, pitch: 0.5, distance: 30, target: [0, 0, 0], t }); return [0, 1].map(k => place(k)[3]); };
         return { there: [2, 5.5, 10, 16].map(there), state: doc.querySelector('.replay-state').textContent,
           images: doc.querySelectorAll('img, b').length, ran: win.ran ?? 0 };",
    );
    assert!(said.is_empty(), "{said:?}");
    assert_eq!(found["there"], serde_json::json!([[1, 1], [1, 0], [1, 0], [1, 1]]), "{found}");
    assert_eq!((&found["images"], &found["ran"]), (&Value::from(0), &Value::from(0)));
    assert!(
        text(&found["state"]).starts_with("undecided so far · closest known so far 5.000 m, <img src=x"),
        "{found}"
    );
}

/// Moves the replay of an audit to some times, and returns the state text at each.
fn states(folder: &Path, page: &Path, times_s: &[f64]) -> Vec<String> {
    let script = format!(
        "const scrub = doc.querySelector('input[type=range]');
         return {times_s:?}.map(t => {{ scrub.value = t; scrub.oninput(); root.player.draw();
           return doc.querySelector('.replay-state').textContent; }});"
    );
    let (found, said) = steer(folder, page, DESKTOP, &script);
    assert!(said.is_empty(), "{said:?}");
    found.as_array().expect("states").iter().map(|state| text(state).to_owned()).collect()
}

fn audited(folder: &Path, table: &str, more: &[&str]) -> PathBuf {
    fs::write(folder.join("said.csv"), table).expect("written");
    run_program(folder, &[&["audit", "said.csv", "--quiet", "--html", "said.html"], more].concat(), "said.html")
}

#[test]
fn the_state_shows_only_findings_up_to_the_current_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut gap, mut leap) = ("t_s,id,x,y,z\n".to_owned(), "t_s,id,x,y,z\n".to_owned());
    for t in 0..=20_i32 {
        let _ = writeln!(gap, "{t},a,0,0,0\n{t},c,{},0,0", f64::from((t - 14).abs()) + 0.25);
        let _ = if (4..8).contains(&t) { Ok(()) } else { writeln!(gap, "{t},b,0,50,0") };
        let _ = writeln!(leap, "{t},a,0,0,0\n{t},b,{},0,0", if t == 20 { 0.25 } else { 20.0 });
    }
    let page = audited(folder.path(), &gap, &["--delta", "1"]);
    let found = states(folder.path(), &page, &[2.0, 5.0, 10.0, 14.0, 20.0]);
    let expected = [
        "no violation so far",
        "undecided: b is not seen",
        "undecided so far",
        "violation: a and c come to 0.250 m (limit 1.000) · closest known so far 0.250 m, a and c",
        "1 violation so far, some times undecided · closest known so far 0.250 m, a and c",
    ];
    assert_eq!(found, expected);
    let page = audited(folder.path(), &leap, &["--delta", "1"]);
    let found = states(folder.path(), &page, &[19.0, 19.5, 19.98, 20.0]);
    let expected = [
        "no violation so far",
        "no violation so far",
        "violation: a and b come to 0.250 m (limit 1.000)",
        "violation: a and b come to 0.250 m (limit 1.000) · closest so far 0.250 m, a and b",
    ];
    assert_eq!(found, expected);
    // Under a bounded acceleration the separation between two samples has a lower bound.
    let bounds = ["--delta", "1", "--motion", "bounded", "--max-accel", "300"];
    let found = states(folder.path(), &audited(folder.path(), &leap, &bounds), &[10.5]);
    assert!(
        found[0].starts_with("undecided: a and b may come too close · closest known so far at least 0.000 m"),
        "{found:?}"
    );
    // With limits on single vehicles only, no separation is shown.
    let found = states(folder.path(), &audited(folder.path(), &leap, &["--limit", "speed=5"]), &[5.0, 19.5]);
    assert_eq!(found, ["no violation so far", "violation: b: speed 19.750 m/s (limit 5.000 m/s)"]);
}

#[test]
fn an_audit_opens_at_its_violation_and_a_clear_one_at_the_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = "t_s,id,x,y,z\n0,a,0,0,0\n0,b,8,1,0\n8,a,8,0,0\n8,b,0,1,0\n";
    for (delta, state, time) in [("2", "violation: a and b come to ", "4.0"), ("0.5", "no violation so far", "0.0")] {
        let page = audited(folder.path(), table, &["--delta", delta]);
        let script = "root.player.draw(); return ['state', 'clock', 'said'].map(name =>
             doc.querySelector('.replay-' + name).textContent);";
        let (found, said) = steer(folder.path(), &page, DESKTOP, script);
        assert!(said.is_empty() && text(&found[0]).starts_with(state), "{found} {said:?}");
        assert!(text(&found[1]).starts_with(time), "{found}");
        assert_eq!(text(&found[2]).is_empty(), delta == "0.5", "{found}");
    }
}

/// The audit of a run uses the separations that the run recorded between samples.
#[test]
fn the_smallest_separation_of_an_audited_run_matches_the_verdict() {
    let folder = tempfile::tempdir().expect("a folder");
    let sets = ["--set", "time.duration_s=10", "--set", "time.record_hz=1", "--set", "arrival.hold_s=2"];
    fly(folder.path(), &[&["pentagon-laplacian"], &sets[..]].concat());
    let page = run_program(folder.path(), &["audit", "run", "--quiet", "--html", "run.html"], "run.html");
    let found = states(folder.path(), &page, &[10.0]);
    let (said, verdict) = (&found[0], fs::read_to_string(&page).expect("a page"));
    assert!(verdict.contains("came to 1.533 m (limit 2.000 m)") || verdict.contains("came to 1.532"), "the verdict");
    assert!(said.contains("so far 1.532 m, 4 and 5"), "{said}");
}

#[test]
fn a_replay_recovers_from_lost_graphics_hidden_pages_and_scrolling() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["pentagon", "--set", "time.duration_s=9"]);
    let (found, said) = steer(
        folder.path(),
        &page,
        DESKTOP,
        "const view = doc.querySelector('.replay-view'), picture = () => { root.player.draw();
          return view.toDataURL(); };
         const point = (name, at) => view.dispatchEvent(new win.PointerEvent('pointer' + name, {
           pointerId: 1, clientX: at, clientY: at }));
         view.setPointerCapture = () => {};
         const still = picture(); point('down', 100); point('move', 160); const turned = picture();
           point('cancel', 160);
         const touch = [still !== turned, still === picture()];
         view.dispatchEvent(new win.Event('webglcontextlost'));
         const lost = { state: root.dataset.state, none: doc.querySelector('.replay-none').textContent,
           panel: doc.querySelectorAll('.replay-panel').length };
         const start = doc.querySelector('.replay-start'); lost.label = start.getAttribute('aria-label');
         let next = () => {}; win.requestAnimationFrame = draw => { next = draw; return 1; };
         start.click();
         doc.querySelector('.replay-play').click();
         [1000, 1020, 9020].forEach(now => next(now));
         const clock = doc.querySelector('.replay-clock').textContent;
         return { touch, clock, lost, again: root.dataset.state,
           left: doc.querySelectorAll('.replay-none, .replay-start').length };",
    );
    assert!(said.is_empty(), "{said:?}");
    assert_eq!(found["touch"], serde_json::json!([true, true]), "{found}");
    assert_eq!(found["clock"], "0.06 s", "at half speed; eight hidden seconds are a tenth of one");
    let lost = &found["lost"];
    assert_eq!((text(&lost["state"]), &lost["panel"]), ("none", &Value::from(0)), "{found}");
    assert!(text(&lost["none"]).starts_with("The graphics were lost") && text(&lost["label"]).ends_with("pentagon"));
    assert_eq!((text(&found["again"]), &found["left"]), ("ready", &Value::from(0)), "{found}");
}

#[test]
fn views_fit_the_vehicles_and_the_camera_follows() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["crazyflies", "--set", "time.duration_s=6"]);
    let (found, said) = steer(
        folder.path(),
        &page,
        DESKTOP,
        "const press = name => { [...doc.querySelectorAll('.replay button')].find(b => b.textContent === name).click();
           player.draw(); };
         const lists = [...doc.querySelectorAll('.replay select')];
         const choose = (k, value) => { lists[k].value = value; lists[k].onchange(); player.draw(); };
         const scrub = doc.querySelector('input[type=range]'), view = doc.querySelector('.replay-view');
         const outside = () => [0, 2, 4, 6].map(t => { scrub.value = t; scrub.oninput(); player.draw();
           return player.seen().places.filter(([x, y]) =>
             x < 0 || y < 0 || x > view.clientWidth || y > view.clientHeight).length; });
         const views = {};
         for (const name of ['Top', 'Front', 'Perspective']) {
           press(name); const { pitch, parallel } = player.seen();
           views[name] = [pitch.toFixed(3), outside().join(), parallel]; }
         scrub.value = 0; scrub.oninput();
         key('Home'); key('v'); const first = player.seen().picked; key('v');
         choose(0, 'picked'); scrub.value = 5; scrub.oninput(); player.draw();
         const seen = player.seen(), [x, y] = seen.places[1];
         const off = Math.hypot(x - view.clientWidth / 2, y - view.clientHeight / 2);
         const picked = doc.querySelector('.replay-picked').textContent;
         choose(1, 'clearance'); const scale = doc.querySelector('.replay-scale').textContent;
         choose(1, ''); const none = doc.querySelector('.replay-scale').textContent;
         const help = doc.querySelector('.replay-help'), hidden = [help.hidden]; key('h'); hidden.push(help.hidden);
         key('m'); const theme = win.getComputedStyle(doc.documentElement).colorScheme;
         key('l'); const names = player.seen().names;
         const values = () => lists.slice(0, 3).map(list => list.value).join();
         const walked = ['f', 'f', 'c', 't', 't', 't'].map(name => { key(name); return values(); });
         const angles = ['1', '2', '3'].map(name => { key(name); return player.seen().pitch.toFixed(2); });
         return { walked, angles, views, first, off, picked, scale, none, hidden, theme, names };",
    );
    assert!(said.is_empty(), "{said:?}");
    for (view, pitch) in [("Top", "1.571"), ("Front", "0.000")] {
        assert_eq!(found["views"][view], serde_json::json!([pitch, "0,0,0,0", true]), "{found}");
    }
    assert_eq!(found["views"]["Perspective"][1], "0,0,0,0", "{found}");
    assert_eq!(found["views"]["Perspective"][2], false, "{found}");
    let [perspective, top, front] = [0, 1, 2].map(|k| text(&found["angles"][k]));
    assert!(top == "1.57" && front == "0.00" && perspective != top && perspective != front, "{found}");
    let walked: Vec<_> = found["walked"].as_array().expect("a list").iter().map(text).collect();
    assert_eq!(
        walked,
        [
            ",,Infinity",
            "picked,,Infinity",
            "picked,speed,Infinity",
            "picked,speed,1",
            "picked,speed,1",
            "picked,speed,Infinity"
        ],
        "the camera follows, and F again shows the whole flight: {found}"
    );
    assert_eq!(found["first"], 0, "{found}");
    assert!(found["off"].as_f64() < Some(1.0), "the picked vehicle is in the middle: {found}");
    assert!(text(&found["picked"]).starts_with("vehicle 2 · ") && text(&found["picked"]).ends_with(" m/s"), "{found}");
    assert!(text(&found["scale"]).starts_with("clearance 0.0") && found["none"] == "", "{found}");
    assert_eq!(found["hidden"], serde_json::json!([true, false]), "{found}");
    assert_eq!((&found["theme"], &found["names"]), (&Value::from("light"), &Value::from(false)), "{found}");
}

/// A replay opens on the view of the pictures, names the same closest pair, and lists only keys of what it has.
#[test]
fn a_replay_opens_like_the_pictures_and_lists_its_own_keys() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = "const seen = player.seen();
         return { ...seen, help: doc.querySelector('.replay-help').textContent,
           plays: [...doc.querySelectorAll('button')].filter(one => /play/i.test(one.className + one.ariaLabel)).length,
           legend: doc.querySelectorAll('.replay-diamond').length };";
    let page = fly(folder.path(), &["obstacles", "--set", "time.duration_s=6"]);
    let (found, said) = steer(folder.path(), &page, DESKTOP, script);
    assert!(said.is_empty(), "{said:?}");
    let timeline = Timeline::read_mcap(&folder.path().join("run/run.mcap")).expect("a recording");
    let camera = Extent::of(&timeline)
        .camera(&timeline, &timeline.log.at(0.0).expect("a frame"), &View::default())
        .expect("a camera");
    let azimuth_rad = camera.back.y.atan2(camera.back.x);
    let [yaw, pitch] = ["yaw", "pitch"].map(|key| found[key].as_f64().expect("an angle"));
    assert!((yaw - azimuth_rad).sin().abs() < 1e-9 && (pitch - camera.back.z.asin()).abs() < 1e-9, "{found}");
    assert_eq!((&found["closest"], &found["legend"]), (&serde_json::json!([0, 1]), &Value::from(1)), "{found}");
    assert_eq!(found["plays"], 1, "there is one button that plays: {found}");
    let help = text(&found["help"]);
    assert!(help.contains("closest approach") && !help.contains("violation") && !help.contains("undecided"), "{help}");
    let page = fly(folder.path(), &["pentagon-laplacian", "--force", "--set", "time.duration_s=5"]);
    let (found, _) = steer(folder.path(), &page, DESKTOP, script);
    assert_eq!((&found["parallel"], &found["legend"]), (&Value::from(true), &Value::from(0)), "{found}");
    assert!(text(&found["help"]).contains("next, previous violation"), "{found}");
}

/// Of a trail only the part within a violation is red, names do not cover each other, and quadrotors have rotors.
#[test]
fn trails_names_and_quadrotors_are_drawn_as_described() {
    let folder = tempfile::tempdir().expect("a folder");
    let red = "const view = doc.querySelector('.replay-view'), pen = doc.createElement('canvas').getContext('2d', {
           willReadFrequently: true });
         [pen.canvas.width, pen.canvas.height] = [view.width, view.height];
         const scrub = doc.querySelector('input[type=range]'), count = (t, is) => {
           scrub.value = t; scrub.oninput(); player.draw(); pen.drawImage(view, 0, 0);
           const all = pen.getImageData(0, 0, view.width, view.height).data; let found = 0;
           for (let k = 0; k < all.length; k += 4) if (is(all[k], all[k + 1], all[k + 2])) found++;
           return found; };
         const alarm = (r, g, b) => r > 150 && g < 70 && b < 80;";
    let page = fly(folder.path(), &["pentagon-laplacian", "--set", "time.duration_s=10"]);
    let script = format!(
        "{red} const names = player.seen().boxes, apart = (a, b) => Math.abs(a[0] - b[0]) >= a[2] + b[2]
           || Math.abs(a[1] - b[1]) >= a[3] + b[3];
         return {{ before: count(2, alarm), after: count(9, alarm),
           named: names.length, apart: names.every((a, k) => names.slice(k + 1).every(b => apart(a, b))) }};"
    );
    let (found, said) = steer(folder.path(), &page, DESKTOP, &script);
    assert!(said.is_empty(), "{said:?}");
    assert_eq!(found["before"], 0, "nothing is red before the violation: {found}");
    assert!((20..4000).contains(&found["after"].as_u64().unwrap_or_default()), "a part of two trails is red: {found}");
    assert_eq!((&found["named"], &found["apart"]), (&Value::from(5), &Value::from(true)), "{found}");

    let page = fly(folder.path(), &["crazyflies", "--force", "--set", "time.duration_s=2"]);
    let script = format!(
        "{red} for (const box of doc.querySelectorAll('.replay input[type=checkbox]')) if (box.checked) box.click();
         const drawn = t => count(t, (r, g, b) => Math.max(r, g, b) - Math.min(r, g, b) > 60);
         const few = drawn(1), seen = player.seen();
         player.look({{ yaw: 0, pitch: 0.8, distance: 0.5, target: player.look({{ yaw: 0, pitch: 0.8, distance: 0.5,
           target: [0, 0, 0], t: 1 }}).place(0).slice(0, 3), t: 1 }});
         pen.drawImage(view, 0, 0);
         return {{ few, arm: seen.arm }};"
    );
    let (found, said) = steer(folder.path(), &page, DESKTOP, &script);
    assert!(said.is_empty(), "{said:?}");
    // Five bodies with four rotors of 8 pixels each; dots of the true size would have a tenth of that.
    assert!(found["few"].as_u64() > Some(700), "{found}");
    assert!(found["arm"].as_f64().is_some_and(|arm| (0.03..0.06).contains(&arm)), "{found}");
}
