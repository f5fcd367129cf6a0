//! The service of the page: its files, its pictures, and its WebSocket.

use super::hub::Ask;
use super::mailbox::Mailbox;
use super::{Draw, Picture, assets};
use crate::door::{Client, Refusal, Response, Service};
use crate::feed::Command;
use serde::Deserialize;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::time::Duration;
use tungstenite::Message as Packet;

/// Requests to the hub that wait at most; a connection beyond that waits.
const ASKS: usize = 64;
/// Time within which the hub answers.
const ANSWERED_WITHIN: Duration = Duration::from_secs(5);

/// The service.
pub(super) struct Page {
    asks: SyncSender<Ask>,
    draw: Arc<Draw>,
}

impl Page {
    /// The service, and the requests of its connections to the hub.
    pub(super) fn new(draw: Arc<Draw>) -> (Self, Receiver<Ask>) {
        let (asks, receiver) = sync_channel(ASKS);
        (Self { asks, draw }, receiver)
    }

    /// Asks the hub. A hub that has ended closes the connection of the client.
    fn ask(&self, client: &Client<Mailbox>, ask: Ask) {
        if self.asks.send(ask).is_err() {
            client.close(1001, "The server ends.");
        }
    }

    fn still(&self, picture: Picture, name: &str, media: &str) -> Result<Response, Refusal> {
        let (sender, receiver) = channel();
        let _ = self.asks.send(Ask::Present(sender));
        let seconds = ANSWERED_WITHIN.as_secs();
        let present = receiver
            .recv_timeout(ANSWERED_WITHIN)
            .map_err(|_| format!("The source gave no state within {seconds} s."));
        let bytes = present
            .and_then(|present| (self.draw)(&present, picture))
            .map_err(|line| Refusal::new("503 Service Unavailable", line))?;
        let name = format!("Content-Disposition: attachment; filename=\"{name}\"\r\n");
        Ok(response(media, &name, bytes))
    }
}

fn response(
    media: &str,
    fields: &str,
    body: impl Into<std::borrow::Cow<'static, [u8]>>,
) -> Response {
    let policy = assets::POLICY;
    let fields = format!("Content-Type: {media}\r\nContent-Security-Policy: {policy}\r\n{fields}");
    Response::new(fields, body)
}

/// A page may connect to its own server alone.
pub(super) fn admits(origin: &str, host: &str) -> bool {
    origin.strip_prefix("http://") == Some(host)
}

impl Service for Page {
    type Queue = Mailbox;
    const SOCKET: &'static str = "socket";
    const FOR: &'static str = "a WebSocket of version 13 from the page";
    const PROTOCOLS: &'static [&'static str] = &[];
    const TRUST: &'static str = "";

    fn admits(&self, origin: &str, host: &str) -> bool {
        admits(origin, host)
    }

    fn file(&self, path: &str) -> Result<Response, Refusal> {
        let missing = |line: &str| Refusal::new("404 Not Found", line);
        let path = path
            .strip_prefix('/')
            .ok_or_else(|| missing("The address of the page ends with a slash."))?;
        match path {
            "still.svg" => self.still(Picture::Svg, path, "image/svg+xml"),
            "still.png" => self.still(Picture::Png, path, "image/png"),
            "still.csv" => self.still(Picture::Csv, path, "text/csv"),
            path => {
                let asset = assets::find(path);
                let asset = asset.ok_or_else(|| missing("The page has no file of this name."))?;
                let media = format!("{}; charset=utf-8", asset.media);
                Ok(response(&media, "", asset.bytes))
            }
        }
    }

    fn queue(&self) -> Mailbox {
        Mailbox::default()
    }

    fn join(&self, client: &Arc<Client<Mailbox>>) {
        self.ask(client, Ask::Join(Arc::clone(client)));
    }

    fn leave(&self, client: &Client<Mailbox>) {
        self.ask(client, Ask::Leave(client.number));
    }

    fn take(&self, client: &Client<Mailbox>, message: &Packet) {
        let Packet::Text(text) = message else {
            return client.tell("A command is text, not bytes.");
        };
        match understand(text) {
            Ok(None) => drop(client.with(Mailbox::confirm)),
            Ok(Some(command)) => self.ask(client, Ask::Command(client.number, command)),
            Err(line) => client.tell(line),
        }
    }
}

/// A message of a page that is no command for the feed.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
enum Own {
    /// The page has drawn a frame.
    Drawn,
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
