//! Opens a page in a real browser: at the width of a phone and of a desktop, in light and in dark.
//!
//! Needs `chromium` (or the program that `CHROMIUM` names); `tests/run.sh` installs it.

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Time limit of a browser; a page loads in a second or two.
const PATIENCE: Duration = Duration::from_mins(2);
/// Flags that draw WebGL on the processor.
pub(crate) const WITH_WEBGL: [&str; 2] = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
/// Flags of a browser without WebGL.
pub(crate) const WITHOUT_WEBGL: [&str; 2] = ["--disable-gpu", "--disable-3d-apis"];
const WIDTHS_PX: [u32; 3] = [320, 390, 1280];
/// Smallest contrast of text for readers with moderately low vision (WCAG 2.2, level AA).
const CONTRAST: f64 = 4.5;

/// Measures the page in the frame and writes the results into the title.
///
/// A headless window is at least 500 pixels wide, so the page is in a frame of the width of a phone.
const PROBE: &str = r#"
const frame = document.querySelector("iframe");
frame.addEventListener("load", () => {
  const page = frame.contentDocument, root = page.documentElement, view = frame.contentWindow;
  const inside = element => element.closest(".scroll, pre, svg") !== null;
  const stickingOut = [...page.body.querySelectorAll("*")].filter(element =>
    !inside(element) && element.getBoundingClientRect().right > view.innerWidth + 0.5);
  const scale = (color, k) => k < 3 && color.startsWith("color(") ? 255 : 1;
  const rgb = color => color.match(/[\d.]+/g).map((part, k) => scale(color, k) * part);
  const luminance = color => {
    const [r, g, b] = rgb(color).map(c => c / 255).map(c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const background = element => {
    for (let at = element; at; at = at.parentElement) {
      const color = view.getComputedStyle(at).backgroundColor, alpha = rgb(color)[3];
      if (alpha === undefined || alpha > 0) return color;
    }
    return "rgb(255, 255, 255)";
  };
  const contrast = (a, b) => {
    const [x, y] = [luminance(a), luminance(b)].sort((p, q) => q - p);
    return (x + 0.05) / (y + 0.05);
  };
  const texts = [...page.body.querySelectorAll("h1,h2,p,li,th,td,caption,small,code,summary,figcaption,.badge")];
  const contrasts = texts.map(text => contrast(view.getComputedStyle(text).color, background(text)));
  const drawings = [...page.querySelectorAll("figure > svg")].map(svg => {
    const paper = svg.querySelector("rect"), words = svg.querySelector("text");
    return contrast(view.getComputedStyle(paper).fill, view.getComputedStyle(words).fill);
  });
  document.title = JSON.stringify({
    width: view.innerWidth, scroll_width: root.scrollWidth,
    sticking_out: stickingOut.map(element => element.outerHTML.slice(0, 80)),
    dark: view.matchMedia("(prefers-color-scheme: dark)").matches,
    paper: luminance(view.getComputedStyle(page.body).backgroundColor),
    contrast: Math.min(...contrasts), drawing_contrast: Math.min(...drawings),
    figures: page.querySelectorAll("figure > svg").length,
    loaded: view.performance.getEntriesByType("resource").length,
    heading: page.querySelector("h1").textContent, verdict: page.querySelector(".verdict").textContent,
  });
});
"#;

/// Page in a running browser, for pages that change with time.
pub(crate) struct LivePage {
    browser: Child,
    socket: tungstenite::WebSocket<tungstenite::stream::MaybeTlsStream<TcpStream>>,
    calls: u64,
}

impl LivePage {
    /// Opens an address in a new browser, which draws on the processor.
    pub(crate) fn open(folder: &Path, url: &str) -> Self {
        let mut browser = Command::new(self::browser())
            .args(["--headless", "--no-sandbox", "--no-first-run", "--remote-debugging-port=0"])
            .args(WITH_WEBGL)
            .args(["--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage"])
            .arg(format!("--user-data-dir={}", folder.join("live-browser").display()))
            .arg(url)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the browser starts");
        let mut lines = BufReader::new(browser.stderr.take().expect("a pipe")).lines();
        let address = lines.find_map(|line| {
            let line = line.expect("a line");
            let (_, rest) = line.split_once("DevTools listening on ws://")?;
            rest.split('/').next().map(str::to_owned)
        });
        let address = address.expect("the browser prints its address");
        // The browser must not wait for a reader of its messages.
        std::thread::spawn(move || lines.for_each(drop));
        let until = Instant::now() + PATIENCE;
        let page = loop {
            let mut stream = TcpStream::connect(&address).expect("connects");
            write!(stream, "GET /json/list HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").expect("sent");
            // The browser keeps the connection open.
            stream.set_read_timeout(Some(Duration::from_millis(500))).expect("a limit");
            let mut bytes = Vec::new();
            let _ = stream.read_to_end(&mut bytes);
            let text = String::from_utf8_lossy(&bytes);
            let found = text.split("\"webSocketDebuggerUrl\": \"").skip(1).filter_map(|rest| rest.split('"').next());
            if let Some(page) = found.map(str::to_owned).find(|page| page.contains("/page/")) {
                break page;
            }
            assert!(Instant::now() < until, "the browser shows no page: {text}");
        };
        let (socket, _) = tungstenite::connect(page).expect("connects");
        Self { browser, socket, calls: 0 }
    }

    /// Returns the value of an expression in the page.
    pub(crate) fn evaluate(&mut self, expression: &str) -> serde_json::Value {
        self.calls += 1;
        let parameters = serde_json::json!({ "expression": expression, "returnByValue": true });
        let call = serde_json::json!({ "id": self.calls, "method": "Runtime.evaluate", "params": parameters });
        self.socket.send(tungstenite::Message::text(call.to_string())).expect("sent");
        loop {
            let text = self.socket.read().expect("an answer").into_text().expect("text");
            let mut answer: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            if answer["id"] == self.calls {
                return answer["result"]["result"]["value"].take();
            }
        }
    }

    /// Waits until an expression is true in the page.
    pub(crate) fn wait_for(&mut self, condition: &str) {
        let until = Instant::now() + PATIENCE;
        while self.evaluate(condition) != true {
            let text = self.evaluate("document.body.innerText");
            assert!(Instant::now() < until, "not true within {PATIENCE:?}: {condition}\n{text}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for LivePage {
    fn drop(&mut self) {
        let _ = self.browser.kill();
        let _ = self.browser.wait();
    }
}

fn browser() -> String {
    std::env::var("CHROMIUM").unwrap_or_else(|_| "chromium".to_owned())
}

/// Runs the headless browser and waits for its end.
pub(crate) fn open(folder: &Path, page: &Path, flags: &[String]) -> Output {
    let mut command = Command::new(browser());
    command
        .args(["--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--hide-scrollbars"])
        .args([
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
        ])
        // Gives a file access to the frame of another file.
        .args(["--allow-file-access-from-files", "--enable-logging=stderr", "--virtual-time-budget=5000"])
        .arg(format!("--user-data-dir={}", folder.join("browser").display()))
        .args(flags)
        .arg(format!("file://{}", page.display()))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap_or_else(|error| {
        panic!("cannot start `{}`: {error}; `sh tests/run.sh` installs the browser that this test needs", browser())
    });
    let (stdout, stderr) = (drain(child.stdout.take()), drain(child.stderr.take()));
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("the browser can be waited for") {
            break status;
        }
        if began.elapsed() > PATIENCE {
            let _ = child.kill();
            panic!("the browser took longer than {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    Output { status, stdout: stdout.join().expect("read"), stderr: stderr.join().expect("read") }
}

fn drain(pipe: Option<impl std::io::Read + Send + 'static>) -> std::thread::JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })
}

/// Returns the results of the probe and the output of the browser's console.
pub(crate) fn probe(folder: &Path, page: &Path, width_px: u32, dark: bool) -> (serde_json::Value, Vec<String>) {
    let wrapper = folder.join(format!("wrapper-{width_px}-{dark}.html"));
    let html = format!(
        "<!doctype html><meta charset=utf-8><title></title><body style=margin:0>\
         <iframe style=\"width:{width_px}px;height:800px;border:0\"></iframe><script>{PROBE}\
         frame.src = \"file://{}\";</script>",
        page.display()
    );
    fs::write(&wrapper, html).expect("written");
    let mut flags: Vec<_> =
        ["--dump-dom", "--window-size=1400,900"].into_iter().chain(WITHOUT_WEBGL).map(str::to_owned).collect();
    flags.extend(scheme(dark));
    let output = open(folder, &wrapper, &flags);
    let (dom, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let found = dom.split("<title>").nth(1).and_then(|rest| rest.split("</title>").next()).unwrap_or_default();
    let found = found.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let found = serde_json::from_str(&found).unwrap_or_else(|error| panic!("{error} in {found:?}\n{dom:.2000}\n{log}"));
    let said = log.lines().filter(|line| line.contains(":CONSOLE")).map(str::to_owned).collect();
    (found, said)
}

fn scheme(dark: bool) -> Option<String> {
    dark.then(|| "--blink-settings=preferredColorScheme=0".to_owned())
}

/// Asserts that no element sticks out, nothing external is loaded, the console is empty and all text has contrast.
pub(crate) fn check(folder: &Path, page: &Path, heading: &str, verdict: &str, figures: u64) {
    for width_px in WIDTHS_PX {
        for dark in [false, true] {
            let (found, said) = probe(folder, page, width_px, dark);
            let case = format!("{width_px} px, dark {dark}: {found}");
            assert_eq!(found["width"], width_px, "{case}");
            assert!(found["scroll_width"].as_u64() <= Some(u64::from(width_px)), "{case}");
            assert_eq!(found["sticking_out"], serde_json::json!([]), "{case}");
            assert_eq!(found["dark"], dark, "{case}");
            assert_eq!(found["paper"].as_f64().is_some_and(|luminance| luminance < 0.1), dark, "{case}");
            for contrast in ["contrast", "drawing_contrast"] {
                assert!(found[contrast].as_f64().is_some_and(|found| found >= CONTRAST), "{case}");
            }
            assert_eq!((found["figures"].as_u64(), found["loaded"].as_u64()), (Some(figures), Some(0)), "{case}");
            assert_eq!(found["heading"], heading, "{case}");
            assert!(found["verdict"].as_str().is_some_and(|found| found.contains(verdict)), "{case}");
            assert!(said.is_empty(), "{case}\n{}", said.join("\n"));
        }
    }
}
