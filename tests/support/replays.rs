//! Pages with replays, steered and looked at in the browser.

use std::fs;
use std::path::Path;

use crate::browser::open;

/// Puts a page into a frame so wide, runs a script there once it is loaded, and gives what the script returns and what the
/// browser's console said. The script knows the page's `win` and `doc`, its first replay `root`, the `player` in it, and
/// `key(name)`, which presses a key and draws at once.
pub(crate) fn steer(folder: &Path, page: &Path, look: (u32, bool), script: &str) -> (serde_json::Value, Vec<String>) {
    // The graphics card in software.
    steer_with(folder, page, look, &["--use-angle=swiftshader", "--enable-unsafe-swiftshader"], script)
}

/// The same in a browser that is started so.
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
           const win = frame.contentWindow, doc = frame.contentDocument, root = doc.querySelector('.replay'), player = root.player;\
           const key = (name, shiftKey = false) => {{\
             doc.querySelector('.replay-view').dispatchEvent(new win.KeyboardEvent('keydown', {{ key: name, shiftKey, bubbles: true }}));\
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
    // What the driver says of its own speed is about reading pictures back.
    let is_said = |line: &&str| line.contains(":CONSOLE") && !line.contains("GL Driver Message (OpenGL, Performance");
    (found, log.lines().filter(is_said).map(str::to_owned).collect())
}
