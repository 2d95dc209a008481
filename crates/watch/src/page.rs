//! Live page: an HTTP server with one page and one WebSocket, on the loopback device unless another address is given.
//!
//! The page is a string of the caller. The WebSocket `/live` sends [frames](Page::assessed) and notices as JSON. On an
//! address other than loopback both need the token of [`Page::url`]. A request whose `Host` is a name, or whose
//! `Origin` is another page, is refused, so that no other site can read the positions through a browser.
//!
//! Connections without a valid request have places of their own, and a second each to send one. If all places are
//! taken, a new connection takes the oldest place of the address that has most of them. So a host with idle
//! connections does not keep out other hosts, or requests that come at once.

use std::collections::VecDeque;
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, Read as _, Write as _};
use std::net::{IpAddr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::Message;

use crate::event::Assessment;
use crate::monitor::Monitor;
use crate::notice::{Notice, Statement, names};
use tautline_core::fact::Coded as _;

/// Time between two frames \[s\].
pub const FRAME_PERIOD_S: f64 = 0.1;
/// Number of pairs in the table of the page.
const LISTED_PAIRS: usize = 8;
/// Longest time in which the last messages are sent at the end of a watch.
const FAREWELL: Duration = Duration::from_secs(1);
/// Largest number of viewers.
pub const MOST_VIEWERS: usize = 16;
/// Largest number of connections with a valid request, viewers included.
const MOST_ADMITTED: usize = 64;
/// Largest number of connections without a valid request.
const MOST_PENDING: usize = 64;
/// Time limit of a request. A browser sends it at once.
const REQUEST_PATIENCE: Duration = Duration::from_secs(1);
/// Largest number of bytes of the head of a request.
const LARGEST_HEAD: usize = 8192;
/// Largest number of messages that wait for a viewer. A slower viewer is disconnected, so that its page does not show
/// an old state.
const MOST_WAITING: usize = 256;
/// Time limit of a write.
const PATIENCE: Duration = Duration::from_secs(5);

/// Server of the live page. It ends with the process.
pub struct Page {
    shared: Arc<Shared>,
    /// Start of the server, from which the times of sent frames count.
    began: Instant,
    /// Time of the last frame \[s\].
    framed_s: f64,
    names: usize,
}

struct Shared {
    html: String,
    address: SocketAddr,
    token: Option<String>,
    viewers: Mutex<Vec<SyncSender<Arc<str>>>>,
    /// Names of the vehicles, sent first to every viewer.
    roster: Mutex<Arc<str>>,
    connections: Mutex<Connections>,
}

/// Connections that are being answered.
#[derive(Default)]
struct Connections {
    /// Connections without a valid request, the oldest first.
    pending: VecDeque<Pending>,
    /// Number of connections with one.
    admitted: usize,
    /// Number of the next connection.
    next: u64,
}

/// Connection without a valid request.
struct Pending {
    number: u64,
    address: IpAddr,
    /// Handle that ends the connection.
    stream: TcpStream,
}

impl Connections {
    /// Adds a connection and returns its number. Without a place, the oldest connection of the address with most
    /// places ends.
    fn add(&mut self, address: IpAddr, stream: TcpStream) -> u64 {
        if self.pending.len() >= MOST_PENDING {
            let places = |one: &Pending| self.pending.iter().filter(|other| other.address == one.address).count();
            // Of equal counts, `max_by_key` takes the last one.
            let ended = (0..self.pending.len()).rev().max_by_key(|&k| places(&self.pending[k]));
            if let Some(pending) = ended.and_then(|k| self.pending.remove(k)) {
                // A connection that has ended is no error.
                let _ = pending.stream.shutdown(Shutdown::Both);
            }
        }
        self.next += 1;
        self.pending.push_back(Pending { number: self.next, address, stream });
        self.next
    }

    /// Removes a connection from those without a valid request. Returns whether it was among them.
    fn remove(&mut self, number: u64) -> bool {
        let place = self.pending.iter().position(|pending| pending.number == number);
        place.is_some_and(|k| self.pending.remove(k).is_some())
    }

    /// Moves a connection to those with a valid request, if there is a place.
    fn admit(&mut self, number: u64) -> bool {
        let is_admitted = self.remove(number) && self.admitted < MOST_ADMITTED;
        self.admitted += usize::from(is_admitted);
        is_admitted
    }
}

impl Page {
    /// Serves a page.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn serve(address: SocketAddr, html: String) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let token = (!address.ip().is_loopback()).then(|| {
            let word = || RandomState::new().hash_one(0_u8);
            format!("{:016x}{:016x}", word(), word())
        });
        let shared = Arc::new(Shared {
            html,
            address,
            token,
            viewers: Mutex::default(),
            roster: Mutex::new(Arc::from("{\"op\":\"roster\",\"vehicles\":[]}")),
            connections: Mutex::default(),
        });
        let server = Arc::clone(&shared);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let Ok(stream) = stream else {
                    std::thread::sleep(Duration::from_millis(50));
                    continue;
                };
                let (Ok(address), Ok(handle)) = (stream.peer_addr(), stream.try_clone()) else { continue };
                let number = lock(&server.connections).add(address.ip(), handle);
                let server = Arc::clone(&server);
                std::thread::spawn(move || {
                    // A viewer that leaves is no error.
                    let _ = answer(stream, number, &server);
                    lock(&server.connections).remove(number);
                });
            }
        });
        Ok(Self { shared, began: Instant::now(), framed_s: f64::NEG_INFINITY, names: 0 })
    }

    /// Returns the address of the page, with its token.
    #[must_use]
    pub fn url(&self) -> String {
        let token = self.shared.token.as_ref().map_or(String::new(), |token| format!("?token={token}"));
        format!("http://{}/{token}", self.shared.address)
    }

    /// Sends a notice to the viewers.
    pub fn notice(&mut self, notice: &Notice) {
        if !lock(&self.shared.viewers).is_empty() {
            self.send(&json!({ "op": "notice", "notice": notice.json }));
        }
    }

    /// Sends the positions and the state of a judgement to the viewers, at most each [`FRAME_PERIOD_S`].
    pub fn assessed(&mut self, of: &Assessment, monitor: &Monitor) {
        // Not a difference of times: times may be infinite before the first pose.
        if !of.now_s.is_finite() || (self.framed_s..self.framed_s + FRAME_PERIOD_S).contains(&of.now_s) {
            return;
        }
        self.framed_s = of.now_s;
        if monitor.names().len() != self.names {
            self.names = monitor.names().len();
            let roster =
                json!({ "op": "roster", "vehicles": names(monitor, |_| true), "delta_m": monitor.settings().delta_m });
            *lock(&self.shared.roster) = Arc::from(roster.to_string());
            self.send(&roster);
        }
        if lock(&self.shared.viewers).is_empty() {
            return;
        }
        let places: Vec<Value> = (0..self.names)
            .map(|k| match monitor.newest(k).filter(|_| !monitor.has_signed_off(k)) {
                Some((at, velocity, _)) => {
                    json!([at.x, at.y, at.z, !monitor.is_stale(k), velocity.map(|velocity| velocity.norm())])
                }
                None => Value::Null,
            })
            .collect();
        let state = Notice::new(Statement::State(of), monitor).json;
        let near = of.closest.map(|near| near.pair);
        let pairs: Vec<Value> = monitor
            .closest_pairs(LISTED_PAIRS)
            .iter()
            .map(|near| json!([near.pair[0], near.pair[1], near.nominal_m, near.least_m]))
            .collect();
        let off_plan = of.deviation.is_some_and(|(_, deviation_m)| deviation_m > monitor.settings().tube_m);
        let facts = monitor.facts();
        let facts: Vec<String> = facts.iter().map(|fact| format!("{fact} ({})", fact.source.code())).collect();
        self.send(&json!({
            "op": "frame", "state": state, "near": near, "violated": of.state.violated(), "places": places,
            "pairs": pairs, "facts": facts, "off_plan": off_plan, "sent_s": self.began.elapsed().as_secs_f64(),
        }));
    }

    /// Ends the connections of the viewers after all messages are sent, at most a second later.
    pub fn finish(self) {
        lock(&self.shared.viewers).clear();
        let until = Instant::now() + FAREWELL;
        while lock(&self.shared.connections).admitted > 0 && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn send(&self, message: &Value) {
        let text: Arc<str> = Arc::from(message.to_string());
        lock(&self.shared.viewers).retain(|viewer| viewer.try_send(Arc::clone(&text)).is_ok());
    }
}

fn lock<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Kind of a request.
enum Request {
    Page,
    Live,
}

/// Answers one connection: the page, or the WebSocket until the viewer leaves.
fn answer(mut stream: TcpStream, number: u64, shared: &Shared) -> io::Result<()> {
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    // The handshake of the WebSocket reads the same bytes again.
    let head = peek_head(&stream)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    match request(&head, shared) {
        Ok(request) => {
            if !lock(&shared.connections).admit(number) {
                return Ok(());
            }
            let answered = answer_valid(stream, &request, head.len(), shared);
            lock(&shared.connections).admitted -= 1;
            answered
        }
        Err(status) => {
            read_head(&mut stream, head.len())?;
            respond(&mut stream, status, "text/plain", status.as_bytes())
        }
    }
}

/// Answers a valid request.
fn answer_valid(mut stream: TcpStream, request: &Request, head: usize, shared: &Shared) -> io::Result<()> {
    match request {
        Request::Page => {
            read_head(&mut stream, head)?;
            let kind = "text/html; charset=utf-8";
            respond(&mut stream, "200 OK", kind, shared.html.as_bytes())
        }
        Request::Live => {
            let Ok(mut socket) = tungstenite::accept(stream) else { return Ok(()) };
            let receiver = {
                let mut viewers = lock(&shared.viewers);
                if viewers.len() >= MOST_VIEWERS {
                    return Ok(());
                }
                let (sender, receiver) = sync_channel(MOST_WAITING);
                let _ = sender.try_send(Arc::clone(&lock(&shared.roster)));
                viewers.push(sender);
                receiver
            };
            view(&mut socket, &receiver);
            Ok(())
        }
    }
}

/// Sends messages to a viewer until it leaves.
fn view(socket: &mut tungstenite::WebSocket<TcpStream>, receiver: &Receiver<Arc<str>>) {
    while let Ok(text) = receiver.recv() {
        if socket.send(Message::text(&*text)).is_err() {
            return;
        }
    }
    // A viewer that has left is no error.
    let _ = socket.close(None);
    let _ = socket.flush();
}

/// Returns the head of a request without taking it from the stream.
fn peek_head(stream: &TcpStream) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; LARGEST_HEAD];
    let until = Instant::now() + REQUEST_PATIENCE;
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        stream.set_read_timeout(Some(left))?;
        let length = stream.peek(&mut bytes)?;
        if let Some(end) = bytes[..length].windows(4).position(|four| four == b"\r\n\r\n") {
            bytes.truncate(end + 4);
            return Ok(bytes);
        }
        if length == 0 || length == LARGEST_HEAD {
            return Err(io::ErrorKind::InvalidData.into());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Takes a head from the stream.
fn read_head(stream: &mut TcpStream, length: usize) -> io::Result<()> {
    let mut bytes = vec![0; length];
    stream.read_exact(&mut bytes)
}

/// Returns the kind of a request, or the status of a refusal.
fn request(head: &[u8], shared: &Shared) -> Result<Request, &'static str> {
    let text = std::str::from_utf8(head).map_err(|_| "400 Bad Request")?;
    let mut lines = text.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let header = |name: &str| {
        let fields = text.split("\r\n").skip(1).filter_map(|line| line.split_once(':'));
        fields.filter(|(own, _)| own.eq_ignore_ascii_case(name)).map(|(_, value)| value.trim()).next()
    };
    if method != "GET" {
        return Err("405 Method Not Allowed");
    }
    let host = header("host").ok_or("400 Bad Request")?;
    if !is_address(host) || header("origin").is_some_and(|origin| origin != format!("http://{host}")) {
        return Err("403 Forbidden");
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let given = query.split('&').find_map(|part| part.strip_prefix("token="));
    if let Some(token) = &shared.token
        && !given.is_some_and(|given| is_equal(given.as_bytes(), token.as_bytes()))
    {
        return Err("403 Forbidden");
    }
    match (path, header("upgrade").is_some_and(|of| of.eq_ignore_ascii_case("websocket"))) {
        ("/", false) => Ok(Request::Page),
        ("/live", true) => Ok(Request::Live),
        _ => Err("404 Not Found"),
    }
}

/// Returns whether a host is `localhost` or an address of numbers, with or without a port.
fn is_address(host: &str) -> bool {
    let is_local = |host: &str| host.eq_ignore_ascii_case("localhost");
    let without_port = host.rsplit_once(':').map_or(host, |(host, _)| host);
    host.parse::<SocketAddr>().is_ok()
        || host.trim_matches(['[', ']']).parse::<IpAddr>().is_ok()
        || is_local(host)
        || is_local(without_port)
}

/// Compares in constant time, so that the time does not reveal how many bytes are equal.
fn is_equal(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |different, (a, b)| different | (a ^ b)) == 0
}

fn respond(stream: &mut TcpStream, status: &str, kind: &str, body: &[u8]) -> io::Result<()> {
    let length = body.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nCache-Control: no-store\r\n\
         Referrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n"
    )?;
    stream.write_all(body)?;
    stream.flush()
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::{TcpListener, TcpStream};
    use std::time::Instant;

    use nalgebra::Vector3;
    use serde_json::Value;

    use super::{Connections, MOST_PENDING, MOST_WAITING, Page, REQUEST_PATIENCE, lock};
    use crate::monitor::{Monitor, Pose};
    use crate::plan::Plan;
    use crate::settings::Settings;

    fn get(page: &Page, target: &str, more: &str) -> String {
        let mut stream = TcpStream::connect(("127.0.0.1", page.shared.address.port())).expect("connects");
        let host = page.shared.address.port();
        write!(stream, "GET {target} HTTP/1.1\r\n{}\r\n\r\n", more.replace("PORT", &host.to_string())).expect("sends");
        let mut text = String::new();
        let _ = stream.read_to_string(&mut text);
        text
    }

    #[test]
    fn the_page_is_served_to_this_machine_only_as_itself() {
        let page = Page::serve("127.0.0.1:0".parse().expect("an address"), "<p>live".to_owned()).expect("serves");
        let good = get(&page, "/", "Host: 127.0.0.1:PORT");
        assert!(good.starts_with("HTTP/1.1 200 OK") && good.ends_with("<p>live"), "{good}");
        for (target, more, status) in [
            ("/", "Host: evil.example:PORT", "403"),
            ("/", "Host: 127.0.0.1:PORT\r\nOrigin: http://evil.example", "403"),
            ("/live", "Host: 127.0.0.1:PORT", "404"),
            ("/other", "Host: localhost:PORT", "404"),
            ("/", "A: b", "400"),
        ] {
            let text = get(&page, target, more);
            assert!(text.starts_with(&format!("HTTP/1.1 {status}")), "{more}: {text}");
        }
    }

    #[test]
    fn another_address_needs_the_token() {
        let page = Page::serve("0.0.0.0:0".parse().expect("an address"), "<p>live".to_owned()).expect("serves");
        let host = "Host: 127.0.0.1:PORT";
        assert!(get(&page, "/", host).starts_with("HTTP/1.1 403"));
        assert!(get(&page, "/?token=0", host).starts_with("HTTP/1.1 403"));
        let (_, query) = page.url().split_once('?').map(|(a, b)| (a.to_owned(), b.to_owned())).expect("a token");
        assert!(get(&page, &format!("/?{query}"), host).starts_with("HTTP/1.1 200"));
    }

    #[test]
    fn idle_connections_keep_out_no_request() {
        let page = Page::serve("0.0.0.0:0".parse().expect("an address"), "<p>live".to_owned()).expect("serves");
        let port = page.shared.address.port();
        let (_, query) = page.url().split_once('?').map(|(a, b)| (a.to_owned(), b.to_owned())).expect("a token");
        let is_served = || get(&page, &format!("/?{query}"), "Host: 127.0.0.1:PORT").starts_with("HTTP/1.1 200");
        let mut idle = Vec::new();
        // Idle connections, and connections that sent a part of a request.
        for k in 0..3 * MOST_PENDING {
            let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("connects");
            if k % 2 == 0 {
                stream.write_all(b"GET / HTTP/1.1\r\nHost: ").expect("sends");
            }
            idle.push(stream);
        }
        assert!(is_served());
        // Connections with a valid request have places of their own.
        let url = format!("ws://127.0.0.1:{port}/live?{query}");
        let (mut viewer, _) = tungstenite::connect(url).expect("a WebSocket");
        viewer.read().expect("the roster");
        for _ in 0..2 * MOST_PENDING {
            idle.push(TcpStream::connect(("127.0.0.1", port)).expect("connects"));
        }
        // The page is served while the newest idle connections are still open.
        assert!(is_served() && !lock(&page.shared.connections).pending.is_empty());
        page.send(&Value::from("still here"));
        assert!(viewer.read().is_ok_and(|message| message.to_text().is_ok_and(|text| text.contains("still here"))));
        // An idle connection ends after its time.
        let mut last = idle.pop().expect("a connection");
        last.set_read_timeout(Some(3 * REQUEST_PATIENCE)).expect("a limit");
        assert!(last.read(&mut [0]).is_ok_and(|length| length == 0));
        let is_empty = || lock(&page.shared.connections).pending.is_empty();
        let end = Instant::now() + 30 * REQUEST_PATIENCE;
        while !is_empty() && Instant::now() < end {
            std::thread::yield_now();
        }
        assert!(is_empty());
    }

    #[test]
    fn an_address_with_most_places_loses_its_oldest_one() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let stream = || TcpStream::connect(listener.local_addr().expect("an address")).expect("connects");
        let mut connections = Connections::default();
        let few: std::net::IpAddr = "10.0.0.1".parse().expect("an address");
        let many: std::net::IpAddr = "10.0.0.2".parse().expect("an address");
        let first = connections.add(few, stream());
        let second = connections.add(many, stream());
        for _ in 0..MOST_PENDING {
            connections.add(many, stream());
        }
        assert_eq!(connections.pending.len(), MOST_PENDING);
        assert!(!connections.admit(second) && connections.admit(first) && connections.admitted == 1);
    }

    #[test]
    fn a_viewer_gets_the_roster_and_frames() {
        let mut page = Page::serve("127.0.0.1:0".parse().expect("an address"), String::new()).expect("serves");
        let url = format!("ws://{}/live", page.shared.address);
        let (mut socket, _) = tungstenite::connect(url).expect("a WebSocket");
        let mut read = || -> Value {
            let text = socket.read().expect("a message").into_text().expect("text");
            serde_json::from_str(&text).expect("JSON")
        };
        assert_eq!(read()["op"], "roster");
        let mut monitor = Monitor::new(Settings::default(), Plan::default()).expect("settings");
        for (id, x) in [("a", 0.0), ("b", 0.5)] {
            let position_m = Vector3::x() * x;
            monitor.take(&Pose { t_s: 0.0, id, position_m, velocity_m_s: None, accuracy_m: None }, 0.0);
        }
        page.assessed(&monitor.assess(0.0), &monitor);
        assert_eq!(read()["vehicles"], serde_json::json!(["a", "b"]));
        let frame = read();
        assert_eq!(frame["op"], "frame");
        assert_eq!(frame["places"][1], serde_json::json!([0.5, 0.0, 0.0, true, null]));
        assert_eq!(frame["off_plan"], false);
        assert!(
            frame["facts"].as_array().expect("a list").contains(&"position-error: 0.05 m (default)".into()),
            "{frame}"
        );
    }

    #[test]
    fn a_viewer_that_does_not_read_is_disconnected() {
        let page = Page::serve("127.0.0.1:0".parse().expect("an address"), String::new()).expect("serves");
        let url = format!("ws://{}/live", page.shared.address);
        let (mut socket, _) = tungstenite::connect(url).expect("a WebSocket");
        socket.read().expect("the roster");
        assert_eq!(lock(&page.shared.viewers).len(), 1);
        // Far more than the buffers of a connection hold.
        let long = Value::from("x".repeat(1 << 20));
        for _ in 0..2 * MOST_WAITING {
            page.send(&long);
        }
        assert_eq!(lock(&page.shared.viewers).len(), 0);
    }
}
