//! Client of a WebSocket that connects again after a loss.

use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::Uri;
use tungstenite::{ClientRequestBuilder, Error, Message, WebSocket};

use super::{Feed, Input};
use crate::event::Loss;

/// Time limit of a connection and of its handshake.
const PATIENCE: Duration = Duration::from_secs(5);
/// Silence after which the client sends a ping.
const SILENCE: Duration = Duration::from_secs(5);
/// Time between two checks for the end of the watch.
const POLL: Duration = Duration::from_millis(100);

/// Message of a server.
#[derive(Clone, Copy, Debug)]
pub(super) enum Incoming<'a> {
    Text(&'a str),
    Binary(&'a [u8]),
}

/// Protocol over a WebSocket.
pub(super) trait Protocol: Send + 'static {
    /// Names of the protocol in the handshake.
    fn names(&self) -> &'static [&'static str];

    /// Starts a connection; returns the first messages to send.
    fn start(&mut self) -> Vec<String>;

    /// Takes a message, appends its inputs, and returns messages to send.
    fn take(&mut self, message: Incoming<'_>, arrival_s: f64, inputs: &mut Vec<Input>) -> Vec<String>;
}

/// Connects to a server in a thread of its own.
///
/// # Errors
/// A sentence if the address is not `ws://HOST:PORT`.
pub(super) fn websocket(url: &str, feed: Feed, mut protocol: impl Protocol) -> Result<(), String> {
    let uri: Uri = url.parse().map_err(|error| format!("not an address: {error} ({url:?}); write ws://HOST:PORT"))?;
    if uri.scheme_str() != Some("ws") || uri.host().is_none() {
        return Err(format!("must be a WebSocket without TLS ({url:?}); write ws://HOST:PORT"));
    }
    let name = url.to_owned();
    std::thread::spawn(move || {
        let read = feed.clone();
        feed.reconnect(&name, |connected| match connect(&uri, &protocol) {
            Ok(mut socket) => {
                connected();
                converse(&mut socket, &mut protocol, &read).unwrap_or_else(|error| Loss::Failed(error.to_string()))
            }
            Err(why) => Loss::Failed(why),
        });
    });
    Ok(())
}

fn connect(uri: &Uri, protocol: &impl Protocol) -> Result<WebSocket<TcpStream>, String> {
    let host = uri.host().unwrap_or_default().trim_matches(['[', ']']);
    let port = uri.port_u16().unwrap_or(80);
    let addresses = (host, port).to_socket_addrs().map_err(|error| format!("{host}: {error}"))?;
    let mut why = format!("{host} has no address");
    for address in addresses {
        let stream = match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => stream,
            Err(error) => {
                why = error.to_string();
                continue;
            }
        };
        let ready = || -> io::Result<()> {
            stream.set_nodelay(true)?;
            stream.set_write_timeout(Some(PATIENCE))?;
            stream.set_read_timeout(Some(PATIENCE))
        };
        ready().map_err(|error| error.to_string())?;
        let mut request = ClientRequestBuilder::new(uri.clone());
        for name in protocol.names() {
            request = request.with_sub_protocol(*name);
        }
        let request = request.into_client_request().map_err(|error| error.to_string())?;
        let (socket, _) = tungstenite::client(request, stream).map_err(|error| error.to_string())?;
        socket.get_ref().set_read_timeout(Some(POLL)).map_err(|error| error.to_string())?;
        return Ok(socket);
    }
    Err(why)
}

/// Reads until the end of the watch or of the connection.
fn converse(socket: &mut WebSocket<TcpStream>, protocol: &mut impl Protocol, feed: &Feed) -> Result<Loss, Error> {
    for text in protocol.start() {
        socket.send(Message::text(text))?;
    }
    let mut inputs = Vec::new();
    let (mut heard, mut asked) = (Instant::now(), false);
    while !feed.is_over() {
        let message = match socket.read() {
            Ok(message) => message,
            Err(Error::Io(error)) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                if heard.elapsed() > 3 * SILENCE {
                    return Ok(Loss::Silent);
                }
                if heard.elapsed() > SILENCE && !asked {
                    asked = true;
                    socket.send(Message::Ping(tungstenite::Bytes::new()))?;
                }
                continue;
            }
            Err(error) => return Err(error),
        };
        (heard, asked) = (Instant::now(), false);
        let replies = match &message {
            Message::Text(text) => protocol.take(Incoming::Text(text), feed.now_s(), &mut inputs),
            Message::Binary(bytes) => protocol.take(Incoming::Binary(bytes), feed.now_s(), &mut inputs),
            Message::Close(_) => return Ok(Loss::Closed),
            _ => Vec::new(),
        };
        for text in replies {
            socket.send(Message::text(text))?;
        }
        if !inputs.drain(..).all(|input| feed.offer(input)) {
            break;
        }
    }
    let _ = socket.close(None);
    Ok(Loss::Closed)
}
