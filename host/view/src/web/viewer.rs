//! The WebSocket of a browser: one thread reads it, another writes it.
//!
//! Both threads use the same socket. Only the second thread writes to the socket: what the protocol answers by itself
//! while it reads, such as the answer to a ping, goes through the mailbox.

use super::hub::Ask;
use super::mailbox::{Mailbox, Outgoing};
use super::request::{self, Refusal, Request};
use super::server::Place;
use crate::feed::Command;
use host::live::Message;
use serde::Deserialize;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::time::Duration;
use tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tungstenite::{Message as Packet, WebSocket};

/// Longest message from a page (bytes).
const LONGEST: usize = 1024;
/// Number of the next browser.
static NUMBER: AtomicU64 = AtomicU64::new(0);
/// Time after which a browser that takes nothing is disconnected.
const TAKEN_WITHIN: Duration = Duration::from_secs(30);

/// What a page sends beside the commands for the feed.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
enum Own {
    /// The page has drawn a frame.
    Drawn,
}

/// Serves a browser until it leaves. Without a place the browser is told that there are too many, and is disconnected.
pub(super) fn serve(
    mut stream: TcpStream,
    request: &Request,
    asks: &SyncSender<Ask>,
    place: Option<Place>,
) {
    let Some(key) = asked(request) else {
        let line = "This path is for a WebSocket of version 13 from the page.";
        let refusal = Refusal::new("426 Upgrade Required", line);
        return request::refuse(&mut stream, &refusal);
    };
    let accept = tungstenite::handshake::derive_accept_key(key.as_bytes());
    let head = format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Accept: {accept}\r\n\r\n"
    );
    let begun = stream
        .set_write_timeout(Some(TAKEN_WITHIN))
        .and_then(|()| stream.write_all(head.as_bytes()))
        .and_then(|()| stream.try_clone());
    let Ok(write_half) = begun else {
        return;
    };
    let mailbox = Arc::new(Mailbox::default());
    if place.is_none() {
        let line = format!(
            "{} browsers view already, the most that are served. Close one of them.",
            super::VIEWERS
        );
        mailbox.deliver(&Message::Refused(line));
        mailbox.close(1013, "Too many viewers.");
        return write(write_half, &mailbox);
    }
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let written = Arc::clone(&mailbox);
    let writer = std::thread::Builder::new()
        .stack_size(runner::STACK)
        .name("view-web-write".into())
        .spawn(move || write(write_half, &written));
    let Ok(writer) = writer else {
        return;
    };
    if asks.send(Ask::Join(number, Arc::clone(&mailbox))).is_ok() {
        read(stream, request, number, &mailbox, asks);
        let _ = asks.send(Ask::Leave(number));
    } else {
        mailbox.close(1001, "The server ends.");
    }
    let _ = writer.join();
    drop(place);
}

/// The key of a request for a WebSocket.
pub(super) fn asked(request: &Request) -> Option<&str> {
    let valid = request.lists("upgrade", "websocket")
        && request.lists("connection", "upgrade")
        && request.field("sec-websocket-version") == Some("13")
        && request.has("origin");
    request.field("sec-websocket-key").filter(|_| valid)
}

/// The half of the socket that is read. What is written to it goes through the mailbox.
struct ReadHalf<'a> {
    stream: TcpStream,
    mailbox: &'a Mailbox,
}

impl Read for ReadHalf<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.stream.read(buffer)
    }
}

impl Write for ReadHalf<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.mailbox.control(bytes) {
            Ok(bytes.len())
        } else {
            Err(std::io::ErrorKind::OutOfMemory.into())
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Reads commands until the connection ends.
fn read(
    stream: TcpStream,
    request: &Request,
    number: u64,
    mailbox: &Mailbox,
    asks: &SyncSender<Ask>,
) {
    if stream.set_read_timeout(None).is_err() {
        return mailbox.close(1011, "The socket failed.");
    }
    let config = WebSocketConfig::default()
        .read_buffer_size(4 * LONGEST)
        .max_message_size(Some(LONGEST))
        .max_frame_size(Some(LONGEST));
    let half = ReadHalf { stream, mailbox };
    let rest = request.rest.clone();
    let mut socket = WebSocket::from_partially_read(half, rest, Role::Server, Some(config));
    loop {
        match socket.read() {
            Ok(Packet::Text(text)) => match understand(&text) {
                Ok(None) => mailbox.confirm(),
                Ok(Some(command)) => {
                    if asks.send(Ask::Command(number, command)).is_err() {
                        return mailbox.close(1001, "The server ends.");
                    }
                }
                Err(line) => mailbox.say(line),
            },
            Ok(Packet::Binary(_)) => mailbox.say("A command is text, not bytes.".into()),
            Ok(_) => {}
            Err(tungstenite::Error::Capacity(_)) => {
                return mailbox.close(1009, "A message from a page is longer than 1024 bytes.");
            }
            Err(tungstenite::Error::Protocol(_) | tungstenite::Error::Utf8(_)) => {
                return mailbox.close(1002, "The bytes are no message of a WebSocket.");
            }
            Err(_) => return mailbox.close(1000, ""),
        }
    }
}

/// A command for the feed; `None` for the confirmation of a frame; or a line for the person.
pub(super) fn understand(text: &str) -> Result<Option<Command>, String> {
    if serde_json::from_str::<Own>(text).is_ok() {
        return Ok(None);
    }
    let unknown = |error| format!("The command is not understood: {error}.");
    let command: Command = serde_json::from_str(text).map_err(unknown)?;
    match command {
        Command::Speed { factor } if !(0.001..=100.0).contains(&factor) => Err(format!(
            "The speed {factor} is outside the allowed range, 0.001 to 100."
        )),
        command => Ok(Some(command)),
    }
}

/// Writes what the mailbox has until the connection ends.
fn write(stream: TcpStream, mailbox: &Mailbox) {
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, None);
    let mut bytes = Vec::new();
    while let Some(next) = mailbox.next() {
        let sent = match next {
            Outgoing::Control(bytes) => {
                let sent = socket.get_mut().write_all(&bytes);
                sent.map_err(tungstenite::Error::Io)
            }
            Outgoing::Line(line) => socket.send(Packet::text(line)),
            Outgoing::Message(message) => {
                bytes.clear();
                message.encode(&mut bytes);
                socket.send(Packet::binary(bytes.clone()))
            }
            Outgoing::Close(code, reason) => {
                let reason = reason.into();
                let code = code.into();
                // The answer to a close frame of the browser was sent before, as control bytes.
                let _ = socket.close(Some(CloseFrame { code, reason }));
                let _ = socket.flush();
                break;
            }
        };
        if sent.is_err() {
            break;
        }
    }
    mailbox.has_closed();
    // Ends the thread that reads, too.
    let _ = socket.get_ref().shutdown(Shutdown::Both);
}
