//! Responses of HTTP, and refusals with one line.

use std::borrow::Cow;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Header fields of every response: no other page can embed the response or read it, and nothing of it stays in a cache
/// or reaches another server.
const GUARDS: &str = "X-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nReferrer-Policy: no-referrer\r\n\
     Cache-Control: no-store\r\nCross-Origin-Opener-Policy: same-origin\r\n\
     Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Embedder-Policy: require-corp\r\n";

/// Why a request is refused: a status, and one line for the person.
#[derive(Debug)]
pub(crate) struct Refusal {
    /// The status, such as `403 Forbidden`.
    pub(crate) status: &'static str,
    /// The line.
    pub(crate) line: String,
}

impl Refusal {
    pub(crate) fn new(status: &'static str, line: impl Into<String>) -> Self {
        let line = line.into();
        Self { status, line }
    }
}

/// A response.
pub(crate) struct Response {
    status: &'static str,
    fields: String,
    body: Cow<'static, [u8]>,
}

impl Response {
    /// A file that the service has. `fields` are header fields with their line ends.
    pub(crate) fn new(fields: String, body: impl Into<Cow<'static, [u8]>>) -> Self {
        let body = body.into();
        Self {
            status: "200 OK",
            fields,
            body,
        }
    }

    fn head(&self) -> String {
        let Self {
            status,
            fields,
            body,
        } = self;
        let length = body.len();
        format!(
            "HTTP/1.1 {status}\r\nConnection: close\r\nContent-Length: {length}\r\n{GUARDS}{fields}\r\n"
        )
    }

    /// All bytes.
    pub(super) fn bytes(&self) -> Vec<u8> {
        [self.head().as_bytes(), &self.body].concat()
    }

    /// Sends the response within a time, and ends the connection. A client that does not take the response loses it.
    pub(super) fn send(&self, stream: &mut TcpStream, within: Duration) {
        let until = Instant::now() + within;
        let head = self.head();
        for part in std::iter::once(head.as_bytes()).chain(self.body.chunks(64 * 1024)) {
            let left = until.saturating_duration_since(Instant::now());
            let left = left.max(Duration::from_millis(1));
            let sent = stream.set_write_timeout(Some(left));
            if sent.and_then(|()| stream.write_all(part)).is_err() {
                return;
            }
        }
        linger(stream);
    }
}

impl From<Refusal> for Response {
    fn from(Refusal { status, line }: Refusal) -> Self {
        Self {
            status,
            fields: "Content-Type: text/plain; charset=utf-8\r\n\
                     Content-Security-Policy: default-src 'none'\r\n"
                .into(),
            body: format!("{line}\n").into_bytes().into(),
        }
    }
}

/// Reads what the other end still sends, for a moment. Otherwise the system would discard the response together with
/// the unread bytes.
fn linger(stream: &mut TcpStream) {
    let ended = stream
        .shutdown(Shutdown::Write)
        .and_then(|()| stream.set_read_timeout(Some(Duration::from_millis(500))));
    if ended.is_err() {
        return;
    }
    let until = Instant::now() + Duration::from_secs(1);
    let mut buffer = [0; 4096];
    while Instant::now() < until && stream.read(&mut buffer).is_ok_and(|count| count > 0) {}
}
