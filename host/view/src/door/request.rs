//! The head of a request, read within limits and judged by the rule of the door.
//!
//! `tungstenite` reads HTTP and the fields of a WebSocket (RFC 6455, section 4.2).

use super::{Refusal, Service};
use std::fmt::Write as _;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::error::{Error, ProtocolError};
use tungstenite::handshake::machine::TryParse;
use tungstenite::handshake::server::{Request, create_response, write_response};
use tungstenite::http::HeaderValue;

/// Longest head of a request (bytes).
const LONGEST: usize = 8 * 1024;

/// What a request that the door admits asks for.
pub(super) enum Admitted {
    /// A file, by its path below the token.
    File(String),
    /// A WebSocket, which this response opens.
    Socket(Vec<u8>),
}

/// Reads from a connection until `judge` has judged the bytes. `None` if the connection ends before.
///
/// # Errors
/// The refusal of `judge`, or that the request came too slowly.
pub(super) fn read<T>(
    stream: &mut TcpStream,
    within: Duration,
    judge: impl Fn(&[u8]) -> Result<Option<T>, Refusal>,
) -> Result<Option<T>, Refusal> {
    let until = Instant::now() + within;
    let mut bytes = Vec::new();
    let mut buffer = [0; 2048];
    loop {
        let left = until.saturating_duration_since(Instant::now());
        let read = if left.is_zero() {
            Err(ErrorKind::TimedOut.into())
        } else {
            let set = stream.set_read_timeout(Some(left));
            set.and_then(|()| stream.read(&mut buffer))
        };
        match read {
            Ok(0) => return Ok(None),
            Ok(count) => bytes.extend(buffer.iter().take(count)),
            Err(error) => match error.kind() {
                ErrorKind::Interrupted => continue,
                ErrorKind::WouldBlock | ErrorKind::TimedOut if !bytes.is_empty() => {
                    let seconds = within.as_secs_f64();
                    let line = format!("The request did not arrive within {seconds} s.");
                    return Err(Refusal::new("408 Request Timeout", line));
                }
                _ => return Ok(None),
            },
        }
        if let Some(judged) = judge(&bytes)? {
            return Ok(Some(judged));
        }
    }
}

/// Judges a request, or its beginning. Gives the request and its path below the token; `None` if the request is not
/// whole. `admits` decides about an origin under the name of a host, and `trust` is told to an origin that is refused.
///
/// # Errors
/// [`Refusal`] for a request that is malformed or may not pass.
pub(crate) fn judge(
    bytes: &[u8],
    token: &str,
    trust: &str,
    admits: &dyn Fn(&str, &str) -> bool,
) -> Result<Option<(Request, String)>, Refusal> {
    let forbidden = |line: String| Refusal::new("403 Forbidden", line);
    let Some(request) = parse(bytes)? else {
        return Ok(None);
    };
    let host =
        one(&request, "Host")?.ok_or_else(|| bad("The request has no field Host.".into()))?;
    let Some(name) = host.to_str().ok().filter(|name| is_loopback(name)) else {
        let host = printable(host);
        return Err(forbidden(format!(
            "The name {host} in the field Host is no name of this machine; use 127.0.0.1 or localhost."
        )));
    };
    if let Some(origin) = one(&request, "Origin")?
        && !origin.to_str().is_ok_and(|origin| admits(origin, name))
    {
        let origin = printable(origin);
        return Err(forbidden(format!(
            "Pages of the origin {origin} may not use this server.{trust}"
        )));
    }
    let whole = request.uri().path().strip_prefix('/').unwrap_or_default();
    let (first, path) = whole.split_at(whole.find('/').unwrap_or(whole.len()));
    if request.uri().authority().is_some() || !same(first.as_bytes(), token.as_bytes()) {
        let line =
            "The address has no valid token. Open the whole address that the command printed.";
        return Err(forbidden(line.into()));
    }
    let path = path.to_owned();
    Ok(Some((request, path)))
}

/// What an admitted request asks for: the WebSocket at the place of the service, or a file.
pub(super) fn admitted<S: Service>(request: &Request, path: String) -> Result<Admitted, Refusal> {
    if path.strip_prefix('/').unwrap_or(&path) != S::SOCKET {
        return Ok(Admitted::File(path));
    }
    let other = || {
        let line = format!("This address is for {}.", S::FOR);
        Refusal::new("426 Upgrade Required", line)
    };
    for name in ["Upgrade", "Sec-WebSocket-Key", "Sec-WebSocket-Version"] {
        one(request, name)?;
    }
    let mut response = create_response(request).map_err(|_| other())?;
    let offered = |protocol: &&&str| {
        let lists = request.headers().get_all("Sec-WebSocket-Protocol");
        let mut offers = lists.iter().filter_map(|list| list.to_str().ok());
        offers.any(|list| list.split(',').any(|offer| offer.trim() == **protocol))
    };
    if !S::PROTOCOLS.is_empty() {
        let chosen = S::PROTOCOLS.iter().find(offered).ok_or_else(other)?;
        let chosen = HeaderValue::from_static(chosen);
        let fields = response.headers_mut();
        fields.insert("Sec-WebSocket-Protocol", chosen);
    }
    let mut bytes = Vec::new();
    write_response(&mut bytes, &response).map_err(|_| other())?;
    Ok(Admitted::Socket(bytes))
}

fn bad(line: String) -> Refusal {
    Refusal::new("400 Bad Request", line)
}

/// The request; `None` if it is not whole.
fn parse(bytes: &[u8]) -> Result<Option<Request>, Refusal> {
    match Request::try_parse(bytes) {
        Ok(None) if bytes.len() < LONGEST => Ok(None),
        Ok(Some((length, request))) if length <= LONGEST => {
            // A client waits for the response before it sends more.
            let is_alone = length == bytes.len();
            let request = is_alone.then_some(request);
            request
                .map(Some)
                .ok_or_else(|| bad("Bytes follow the request.".into()))
        }
        Ok(_) => {
            let line = format!("The request is longer than {LONGEST} bytes.");
            Err(Refusal::new("431 Request Header Fields Too Large", line))
        }
        Err(Error::Protocol(ProtocolError::WrongHttpMethod)) => {
            let line = "This server answers GET requests only.";
            Err(Refusal::new("405 Method Not Allowed", line))
        }
        Err(error) => Err(bad(format!("The request is no HTTP request: {error}."))),
    }
}

/// The value of a field; `None` if the request has no such field.
fn one<'a>(request: &'a Request, name: &str) -> Result<Option<&'a HeaderValue>, Refusal> {
    let mut values = request.headers().get_all(name).iter();
    match (values.next(), values.next()) {
        (value, None) => Ok(value),
        _ => Err(bad(format!("The field {name} occurs twice."))),
    }
}

/// Whether `name` or `name:port` is this machine.
pub(crate) fn is_loopback(authority: &str) -> bool {
    let (name, port) = match authority.rsplit_once(':') {
        Some((name, port)) if !port.ends_with(']') => (name, port),
        _ => (authority, "80"),
    };
    let names = ["127.0.0.1", "localhost", "[::1]"];
    names.iter().any(|own| own.eq_ignore_ascii_case(name))
        && port.bytes().all(|b| b.is_ascii_digit())
        && port.parse::<u16>().is_ok()
}

/// Compares in a time that does not depend on where the texts differ.
fn same(given: &[u8], expected: &[u8]) -> bool {
    let differences = given.iter().zip(expected);
    let difference = differences.fold(0, |bits, (a, b)| bits | (a ^ b));
    std::hint::black_box(difference) == 0 && given.len() == expected.len()
}

/// A client's text for a message to a person: at most 100 characters, none of which could control a terminal.
fn printable(value: &HeaderValue) -> String {
    let mut text = String::new();
    for byte in value.as_bytes().iter().take(100) {
        match byte {
            0x21..=0x7e => text.push(char::from(*byte)),
            other => {
                let _ = write!(text, "\\x{other:02x}");
            }
        }
    }
    text
}
