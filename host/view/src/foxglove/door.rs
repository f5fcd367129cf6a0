//! Who may connect: the check of the request with which a client opens its WebSocket (RFC 6455, section 4.2).
//!
//! A page of any web site can ask the browser to connect to a port of this machine. Four checks keep such pages out:
//! the path of the address must be the token of this server; the name in `Host` must be a name of this machine, so that
//! no foreign name that was redirected to this machine is served; the `Origin`, which every browser sends and no page
//! can change, must belong to this machine or to the list of the person who started the server; and the client must ask
//! for the protocol.

use super::protocol::SUBPROTOCOLS;
use std::fmt::Write as _;
use tungstenite::handshake::derive_accept_key;

/// Longest request (bytes).
pub(super) const LONGEST_REQUEST: usize = 8192;
/// Most fields of a request.
const MOST_FIELDS: usize = 64;

/// Whom the server admits.
#[derive(Clone, Debug)]
pub(super) struct Door {
    /// The path of the address, without the slash.
    pub(super) token: String,
    /// Origins that are admitted beside those of this machine.
    pub(super) origins: Vec<String>,
}

/// The verdict on the bytes that came so far.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The request has not arrived whole.
    Incomplete,
    /// The client may connect, after this response.
    Admitted {
        /// The response.
        response: String,
    },
    /// The client may not connect.
    Refused(Refusal),
}

/// Why a client may not connect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    /// Status of the response, such as `403 Forbidden`.
    pub(super) status: &'static str,
    /// The reason in words.
    pub(super) reason: String,
}

impl Refusal {
    fn new(status: &'static str, reason: impl Into<String>) -> Self {
        Self {
            status,
            reason: reason.into(),
        }
    }

    /// The response to the client.
    pub(super) fn response(&self) -> String {
        let Self { status, reason } = self;
        let length = reason.len() + 1;
        format!(
            "HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {length}\r\n\
             X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n{reason}\n"
        )
    }
}

impl Door {
    /// Judges a request, or its beginning.
    pub(super) fn judge(&self, bytes: &[u8]) -> Verdict {
        let mut fields = [httparse::EMPTY_HEADER; MOST_FIELDS];
        let mut request = httparse::Request::new(&mut fields);
        let bad = |reason: &str| Verdict::Refused(Refusal::new("400 Bad Request", reason));
        match request.parse(bytes) {
            Ok(httparse::Status::Partial) if bytes.len() < LONGEST_REQUEST => Verdict::Incomplete,
            Ok(httparse::Status::Partial) => bad("the request is too long"),
            // A client waits for the response before it sends more.
            Ok(httparse::Status::Complete(length)) if length < bytes.len() => {
                bad("bytes follow the request")
            }
            Ok(httparse::Status::Complete(_)) => match self.admit(&request) {
                Ok(response) => Verdict::Admitted { response },
                Err(refusal) => Verdict::Refused(refusal),
            },
            Err(_) => bad("this is no request of HTTP"),
        }
    }

    /// The response to a request that is in order.
    fn admit(&self, request: &httparse::Request<'_, '_>) -> Result<String, Refusal> {
        let forbidden = |reason: String| Refusal::new("403 Forbidden", reason);
        let bad = |reason: &str| Refusal::new("400 Bad Request", reason);
        if request.method != Some("GET") || request.version != Some(1) {
            return Err(bad("only GET of HTTP/1.1 is served"));
        }
        let host = one_field(request, "Host")?.ok_or_else(|| bad("Host is missing"))?;
        if !is_loopback_authority(host) {
            let host = printable(host);
            return Err(forbidden(format!(
                "the name {host} in Host is no name of this machine; use 127.0.0.1 or localhost"
            )));
        }
        if let Some(origin) = one_field(request, "Origin")?
            && !self.admits_origin(origin)
        {
            let origin = printable(origin);
            return Err(forbidden(format!(
                "the origin {origin} is not admitted; if you trust it, start with --allow-origin {origin}"
            )));
        }
        let token = request.path.and_then(|path| path.strip_prefix('/'));
        let token = token.map(|token| token.strip_suffix('/').unwrap_or(token));
        if !token.is_some_and(|token| same(token.as_bytes(), self.token.as_bytes())) {
            return Err(forbidden(
                "the token in the address is wrong or missing; use the address that palpate printed".to_owned(),
            ));
        }
        let upgrades =
            contains(request, "Connection", "upgrade") && contains(request, "Upgrade", "websocket");
        if !upgrades {
            return Err(Refusal::new(
                "426 Upgrade Required",
                "this address is for a program that speaks foxglove.websocket.v1, such as Foxglove or Lichtblick",
            ));
        }
        if one_field(request, "Sec-WebSocket-Version")? != Some(b"13") {
            return Err(bad("Sec-WebSocket-Version is not 13"));
        }
        let key = one_field(request, "Sec-WebSocket-Key")?
            .ok_or_else(|| bad("Sec-WebSocket-Key is missing"))?;
        let protocol = SUBPROTOCOLS
            .into_iter()
            .find(|protocol| contains(request, "Sec-WebSocket-Protocol", protocol))
            .ok_or_else(|| {
                bad("the client does not offer foxglove.websocket.v1 in Sec-WebSocket-Protocol")
            })?;
        let accept = derive_accept_key(key);
        Ok(format!(
            "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Accept: {accept}\r\nSec-WebSocket-Protocol: {protocol}\r\n\r\n"
        ))
    }

    /// Whether an origin may connect. `null` is the origin of every page in a sandbox, so only the list can admit it.
    /// Chromium sends `null` for a page that is a file, too. It sends `file://` where the program around it grants the
    /// page access to files, as desktop programs such as Lichtblick do; no page of a web site has this origin.
    fn admits_origin(&self, origin: &[u8]) -> bool {
        let Ok(origin) = std::str::from_utf8(origin) else {
            return false;
        };
        let listed = |allowed: &String| {
            allowed
                .trim_end_matches('/')
                .eq_ignore_ascii_case(origin.trim_end_matches('/'))
        };
        origin == "file://"
            || self.origins.iter().any(listed)
            || ["http://", "https://"].iter().any(|scheme| {
                origin
                    .strip_prefix(scheme)
                    .is_some_and(|authority| is_loopback_authority(authority.as_bytes()))
            })
    }
}

/// The value of a field; `None` where the field is missing.
fn one_field<'a>(
    request: &'a httparse::Request<'_, '_>,
    name: &str,
) -> Result<Option<&'a [u8]>, Refusal> {
    let mut values = values(request, name);
    match (values.next(), values.next()) {
        (value, None) => Ok(value.map(<[u8]>::trim_ascii)),
        (_, Some(_)) => Err(Refusal::new(
            "400 Bad Request",
            format!("the field {name} occurs twice"),
        )),
    }
}

fn values<'a>(
    request: &'a httparse::Request<'_, '_>,
    name: &str,
) -> impl Iterator<Item = &'a [u8]> {
    request
        .headers
        .iter()
        .filter(move |field| field.name.eq_ignore_ascii_case(name))
        .map(|field| field.value)
}

/// Whether a list in a field has an entry.
fn contains(request: &httparse::Request<'_, '_>, name: &str, entry: &str) -> bool {
    values(request, name)
        .flat_map(|value| value.split(|byte| *byte == b','))
        .any(|value| value.trim_ascii().eq_ignore_ascii_case(entry.as_bytes()))
}

/// Whether `name` or `name:port` is this machine.
fn is_loopback_authority(authority: &[u8]) -> bool {
    ["127.0.0.1", "localhost", "[::1]"].iter().any(|name| {
        let head = authority.get(..name.len()).unwrap_or_default();
        let rest = authority.get(name.len()..).unwrap_or_default();
        head.eq_ignore_ascii_case(name.as_bytes())
            && match rest.split_first() {
                None => true,
                Some((b':', port)) => {
                    !port.is_empty() && port.len() <= 5 && port.iter().all(u8::is_ascii_digit)
                }
                Some(_) => false,
            }
    })
}

/// Whether two texts are equal, in a time that does not depend on where they differ.
fn same(given: &[u8], expected: &[u8]) -> bool {
    let difference = given
        .iter()
        .zip(expected)
        .fold(0, |sum, (a, b)| sum | (a ^ b));
    given.len() == expected.len() && difference == 0
}

/// A client's text for a message to a person: at most 100 characters, none of which could control a terminal.
fn printable(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in bytes.iter().take(100) {
        match byte {
            0x21..=0x7e => text.push(char::from(*byte)),
            other => {
                let _ = write!(text, "\\x{other:02x}");
            }
        }
    }
    text
}

#[cfg(test)]
mod tests;
