//! Controls pages with replays in the browser and reads their state.

use std::fs;
use std::path::Path;

use crate::browser::{WITH_WEBGL, open};

/// Opens a page in a frame of the given width and runs a script in it. Returns the value of the script and the output
/// of the browser's console.
///
/// The script has the variables `win` and `doc` of the page, its first replay `root`, the `player` of this replay, and
/// `key(name)`, which presses a key and draws at once.
pub(crate) fn steer(folder: &Path, page: &Path, look: (u32, bool), script: &str) -> (serde_json::Value, Vec<String>) {
    steer_with(folder, page, look, &WITH_WEBGL, script)
}

/// Does the same as [`steer`] in a browser with these flags.
pub(crate) fn steer_with(
    folder: &Path,
    page: &Path,
    (width_px, dark): (u32, bool),
    started: &[&str],
    script: &str,
) -> (serde_json::Value, Vec<String>) {
    let wrapper = folder.join("steered.html");
    let html = format!(
        "<!doctype html><meta charset=utf-8><title></title><body style=margin:0>\
         <iframe style=\"width:{width_px}px;height:800px;border:0\"></iframe><script>\
         const frame = document.querySelector('iframe');\
         frame.addEventListener('load', () => {{\
           const win = frame.contentWindow, doc = frame.contentDocument;\
           const root = doc.querySelector('.replay'), player = root.player;\
           const key = (name, shiftKey = false) => {{\
             const event = new win.KeyboardEvent('keydown', {{ key: name, shiftKey, bubbles: true }});\
             doc.querySelector('.replay-view').dispatchEvent(event);\
             root.player.draw();\
           }};\
           let found;\
           try {{ found = (() => {{ {script} }})(); }} catch (error) {{ found = {{ error: String(error) }}; }}\
           document.title = JSON.stringify(found);\
         }});\
         frame.src = 'file://{}';</script>",
        page.display()
    );
    fs::write(&wrapper, html).expect("written");
    let mut flags = vec!["--dump-dom".to_owned(), "--window-size=1400,900".to_owned()];
    flags.extend(started.iter().map(|&flag| flag.to_owned()));
    flags.extend(dark.then(|| "--blink-settings=preferredColorScheme=0".to_owned()));
    let output = open(folder, &wrapper, &flags);
    let (dom, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let found = dom.split("<title>").nth(1).and_then(|rest| rest.split("</title>").next()).unwrap_or_default();
    let found = found.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let found: serde_json::Value =
        serde_json::from_str(&found).unwrap_or_else(|error| panic!("{error} in {found:?}\n{dom:.1000}\n{log}"));
    assert!(found.get("error").is_none(), "{found}\n{log}");
    // The driver warns about its own speed, because pictures are read back.
    let is_said = |line: &&str| line.contains(":CONSOLE") && !line.contains("GL Driver Message (OpenGL, Performance");
    (found, log.lines().filter(is_said).map(str::to_owned).collect())
}
