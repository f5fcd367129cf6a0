//! The head of an HTTP request, read within limits, and responses.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longest head of a request (bytes).
pub(super) const LONGEST: usize = 8 * 1024;
/// Time within which the head of a request must arrive.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time within which a browser must take a response.
const TAKEN_WITHIN: Duration = Duration::from_secs(30);
/// Most header fields of a request.
const FIELDS: usize = 64;

/// A request.
pub(super) struct Request {
    /// The path and the query.
    pub(super) target: String,
    /// The header fields, with names in lower case.
    fields: Vec<(String, String)>,
    /// Bytes that follow the head.
    pub(super) rest: Vec<u8>,
}

impl Request {
    /// The value of a field; `None` if the request has no such field or several.
    pub(super) fn field(&self, name: &str) -> Option<&str> {
        let mut values = self.fields.iter().filter(|(field, _)| field == name);
        let value = values.next();
        value
            .filter(|_| values.next().is_none())
            .map(|(_, value)| value.as_str())
    }

    /// Whether the request has the field.
    pub(super) fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|(field, _)| field == name)
    }

    /// Whether the field, a list with commas, contains the word.
    pub(super) fn lists(&self, name: &str, word: &str) -> bool {
        self.field(name).is_some_and(|value| {
            value
                .split(',')
                .any(|part| part.trim().eq_ignore_ascii_case(word))
        })
    }
}

/// Why a request is refused: a status, and one line for the person.
#[derive(Debug)]
pub(super) struct Refusal {
    /// The status, such as `403 Forbidden`.
    pub(super) status: &'static str,
    /// The line.
    pub(super) line: String,
}

impl Refusal {
    pub(super) fn new(status: &'static str, line: impl Into<String>) -> Self {
        let line = line.into();
        Self { status, line }
    }
}

/// Reads the head of a request. `None` if the connection ends before anything came.
///
/// # Errors
/// [`Refusal`] for a head that is too long, too slow, no HTTP, or no GET.
pub(super) fn read(stream: &mut TcpStream) -> Result<Option<Request>, Refusal> {
    let deadline = Instant::now() + PATIENCE;
    let slow = || {
        let seconds = PATIENCE.as_secs();
        let line = format!("The request did not arrive within {seconds} s.");
        Refusal::new("408 Request Timeout", line)
    };
    let mut bytes = Vec::new();
    let mut buffer = [0; 2048];
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
            return Err(slow());
        }
        let count = match stream.read(&mut buffer) {
            Ok(0) => return Ok(None),
            Ok(count) => count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(error) => {
                use std::io::ErrorKind::{TimedOut, WouldBlock};
                return match error.kind() {
                    WouldBlock | TimedOut if !bytes.is_empty() => Err(slow()),
                    _ => Ok(None),
                };
            }
        };
        bytes.extend(buffer.iter().take(count));
        if let Some(request) = parse(&bytes)? {
            return Ok(Some(request));
        }
        if bytes.len() >= LONGEST {
            let line = format!("The head of the request is longer than {LONGEST} bytes.");
            return Err(Refusal::new("431 Request Header Fields Too Large", line));
        }
    }
}

/// The request at the start of `bytes`; `None` if its head is not complete.
pub(super) fn parse(bytes: &[u8]) -> Result<Option<Request>, Refusal> {
    let bad = |line: String| Refusal::new("400 Bad Request", line);
    let mut fields = [httparse::EMPTY_HEADER; FIELDS];
    let mut parsed = httparse::Request::new(&mut fields);
    let length = match parsed.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(error) => return Err(bad(format!("The request is no HTTP request: {error}."))),
    };
    if length > LONGEST {
        let line = format!("The head of the request is longer than {LONGEST} bytes.");
        return Err(Refusal::new("431 Request Header Fields Too Large", line));
    }
    if parsed.method != Some("GET") {
        let line = "This server answers GET requests only.";
        return Err(Refusal::new("405 Method Not Allowed", line));
    }
    let text = |field: &httparse::Header<'_>| {
        let value = std::str::from_utf8(field.value).ok()?;
        Some((field.name.to_ascii_lowercase(), value.trim().to_owned()))
    };
    let fields: Option<Vec<_>> = parsed.headers.iter().map(text).collect();
    let fields = fields.ok_or_else(|| bad("A field of the request is no text.".into()))?;
    Ok(Some(Request {
        target: parsed.path.unwrap_or_default().to_owned(),
        fields,
        rest: bytes.get(length..).unwrap_or_default().to_vec(),
    }))
}

/// Header fields of every response. The page loads nothing but its own files, no other page can embed it or read it,
/// and nothing of it stays in a cache or reaches another server.
const GUARDS: &str = "X-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nReferrer-Policy: no-referrer\r\n\
     Cache-Control: no-store\r\nCross-Origin-Opener-Policy: same-origin\r\n\
     Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Embedder-Policy: require-corp\r\n";

/// Sends a response, and ends the connection. A browser that does not take the response loses it.
pub(super) fn respond(stream: &mut TcpStream, status: &str, fields: &str, body: &[u8]) {
    let length = body.len();
    let policy = super::assets::POLICY;
    let head = format!(
        "HTTP/1.1 {status}\r\nConnection: close\r\nContent-Length: {length}\r\n\
         Content-Security-Policy: {policy}\r\n{GUARDS}{fields}\r\n"
    );
    let deadline = Instant::now() + TAKEN_WITHIN;
    for part in std::iter::once(head.as_bytes()).chain(body.chunks(64 * 1024)) {
        let left = deadline.saturating_duration_since(Instant::now());
        let left = left.max(Duration::from_millis(1));
        let sent = stream.set_write_timeout(Some(left));
        if sent.and_then(|()| stream.write_all(part)).is_err() {
            return;
        }
    }
    linger(stream);
}

/// Sends the refusal as one line of text.
pub(super) fn refuse(stream: &mut TcpStream, refusal: &Refusal) {
    let body = format!("{}\n", refusal.line);
    let fields = "Content-Type: text/plain; charset=utf-8\r\n";
    respond(stream, refusal.status, fields, body.as_bytes());
}

/// Reads what the other end still sends, for a moment. Otherwise the system would discard the response together with
/// the unread bytes.
fn linger(stream: &mut TcpStream) {
    let ended = stream
        .shutdown(std::net::Shutdown::Write)
        .and_then(|()| stream.set_read_timeout(Some(Duration::from_millis(500))));
    if ended.is_err() {
        return;
    }
    let deadline = Instant::now() + Duration::from_secs(1);
    let mut buffer = [0; 4096];
    while Instant::now() < deadline && stream.read(&mut buffer).is_ok_and(|count| count > 0) {}
}
