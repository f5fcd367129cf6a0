//! The server of the page, over TCP: what it serves, and what it refuses with one line.

use fuzz_rules::synthetic::Synthetic;
use host::live::Message;
use proptest::prelude::*;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;
use tungstenite::client::IntoClientRequest;
use tungstenite::protocol::CloseFrame;
use tungstenite::{Message as Packet, WebSocket};
use view::feed::{Command, Feed, FeedError};
use view::web::{Options, Picture, assets, serve};

/// The synthetic feed, at most one frame a millisecond, which writes down its commands.
struct Slow(Synthetic, std::sync::mpsc::Sender<Command>);

impl Feed for Slow {
    fn next(&mut self, wait: Duration) -> Result<Option<Message>, FeedError> {
        std::thread::sleep(wait.min(Duration::from_millis(1)));
        self.0.next(wait)
    }
    fn command(&mut self, command: &Command) {
        let _ = self.1.send(*command);
    }
    fn present(&self) -> Vec<Message> {
        self.0.present()
    }
}

/// A server that ends with the test.
struct Server {
    /// `127.0.0.1:PORT`.
    host: String,
    token: String,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
    commands: std::sync::mpsc::Receiver<Command>,
}

impl Server {
    fn start() -> Self {
        Self::with(Synthetic::new(u64::MAX))
    }

    fn with(feed: Synthetic) -> Self {
        let (sender, receiver) = channel();
        let (command, commands) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let options = Options {
            port: 0,
            say: Arc::new(move |line| {
                // The first line is the address. A test that is over reads no more.
                let _ = sender.send(line.to_owned());
            }),
            draw: Arc::new(|present, picture| match picture {
                Picture::Csv => Ok(format!("messages\n{}\n", present.len()).into_bytes()),
                _ => Err("There is no picture.".into()),
            }),
            stop: Arc::clone(&stop),
        };
        let run = move || serve(Box::new(Slow(feed, command)), &options).unwrap();
        let thread = Some(std::thread::spawn(run));
        let address = receiver.recv().unwrap();
        let (host, token) = address
            .strip_prefix("http://")
            .and_then(|rest| rest.trim_end_matches('/').split_once('/'))
            .unwrap();
        Self {
            host: host.into(),
            token: token.into(),
            stop,
            thread,
            commands,
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.host).unwrap();
        let longest = Some(Duration::from_secs(60));
        stream.set_read_timeout(longest).unwrap();
        stream
    }

    /// Sends bytes, and returns all of the answer.
    fn raw(&self, bytes: &[u8]) -> String {
        let mut stream = self.connect();
        let _ = stream.write_all(bytes);
        answer(&mut stream)
    }

    fn get(&self, path: &str, fields: &str) -> String {
        let host = &self.host;
        self.raw(format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n{fields}\r\n").as_bytes())
    }

    fn page(&self, path: &str) -> String {
        self.get(&format!("/{}/{path}", self.token), "")
    }

    fn view_from(&self, origin: &str) -> Result<WebSocket<TcpStream>, String> {
        let address = format!("ws://{}/{}/socket", self.host, self.token);
        let mut request = address.into_client_request().unwrap();
        let origin = origin.parse().unwrap();
        request.headers_mut().insert("Origin", origin);
        let opened = tungstenite::client::client(request, self.connect());
        opened
            .map(|(socket, _)| socket)
            .map_err(|error| error.to_string())
    }

    fn view(&self) -> WebSocket<TcpStream> {
        self.view_from(&format!("http://{}", self.host)).unwrap()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || std::thread::panicking());
    }
}

fn answer(stream: &mut TcpStream) -> String {
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The next message of a kind; frames are confirmed, as the page does.
fn next(socket: &mut WebSocket<TcpStream>, kind: u8) -> Message {
    loop {
        let Packet::Binary(bytes) = socket.read().unwrap() else {
            continue;
        };
        let message = Message::decode(&bytes).unwrap();
        if message.kind() == 3 {
            socket.send(Packet::text(r#"{"do":"drawn"}"#)).unwrap();
        }
        if message.kind() == kind {
            return message;
        }
    }
}

/// The frame of a close, after any messages.
fn closed(socket: &mut WebSocket<TcpStream>) -> Option<CloseFrame> {
    loop {
        match socket.read() {
            Ok(Packet::Close(frame)) => return frame,
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

fn status(answer: &str, status: &str) {
    let first = answer.lines().next().unwrap_or_default();
    assert!(first.contains(status), "{status} expected: {answer:.300}");
    let (_, body) = answer.split_once("\r\n\r\n").unwrap();
    assert_eq!(body.trim_end().lines().count(), 1, "one line: {body}");
}

#[test]
fn the_page_and_its_files_are_served_with_a_strict_policy() {
    let server = Server::start();
    for asset in assets::ASSETS {
        let answer = server.page(asset.path);
        let (head, _) = answer.split_once("\r\n\r\n").unwrap();
        assert!(head.starts_with("HTTP/1.1 200 OK"), "{head}");
        assert!(head.contains(&format!("Content-Type: {}", asset.media)));
        assert!(head.contains("Content-Security-Policy: default-src 'none'"));
        assert!(head.contains("X-Content-Type-Options: nosniff"));
        assert!(head.contains("Referrer-Policy: no-referrer"));
        assert!(head.contains("Cache-Control: no-store"));
        assert!(head.contains("Cross-Origin-Resource-Policy: same-origin"));
        let length = format!("Content-Length: {}", asset.bytes.len());
        assert!(head.contains(&length), "{}", asset.path);
    }
    assert!(server.page("").contains("<title>Palpate</title>"));
    assert!(server.page("still.csv").contains("\r\n\r\nmessages\n"));
    status(&server.page("still.svg"), "503");
    status(&server.page("nothing.js"), "404");
    status(&server.page("../secret"), "404");
}

#[test]
fn another_page_or_a_foreign_name_is_refused_with_one_line() {
    let server = Server::start();
    status(&server.get("/index.html", ""), "403");
    let Server { host, token, .. } = &server;
    let foreign = format!("GET /{token}/ HTTP/1.1\r\nHost: palpate.example:80\r\n\r\n");
    status(&server.raw(foreign.as_bytes()), "403");
    for origin in [
        "http://page.example",
        "null",
        "https://127.0.0.1",
        "http://127.0.0.1:1",
        "file://",
    ] {
        let error = server.view_from(origin).unwrap_err();
        assert!(error.contains("403"), "{origin}: {error}");
    }
    let here = format!("Origin: http://{host}\r\n");
    assert!(
        server
            .get(&format!("/{token}/"), &here)
            .starts_with("HTTP/1.1 200")
    );
    status(&server.get(&format!("/{token}"), ""), "404");
    status(&server.page("socket"), "426");
}

#[test]
fn a_viewer_receives_the_state_and_then_every_spike() {
    let server = Server::start();
    let mut socket = server.view();
    let Message::Hello(hello) = next(&mut socket, 1) else {
        unreachable!()
    };
    assert!(hello.scene_text.is_empty() && hello.files.is_empty());
    next(&mut socket, 2);
    // The first tick of each frame follows the last tick of the frame before, whatever was merged.
    let mut ticks = None;
    let mut spikes = 0;
    for _ in 0..200 {
        let Message::Frame(frame) = next(&mut socket, 3) else {
            unreachable!()
        };
        if let Some(last) = ticks {
            assert_eq!(frame.folded.first, last + 1);
        }
        assert_eq!(
            frame.folded.ticks,
            frame.folded.last - frame.folded.first + 1
        );
        ticks = Some(frame.folded.last);
        let force = &frame.folded.hands[0].force_norm;
        spikes += u32::from(force.most - force.least > 2.0);
        let positions = &frame.bodies[0].vertices.as_ref().unwrap().positions;
        assert_eq!(positions.len(), 3 * 441);
    }
    assert!(spikes > 0, "a spike of one tick is in every sixtieth frame");
}

#[test]
fn a_viewer_that_confirms_nothing_gets_two_frames_and_slows_nobody() {
    let server = Server::start();
    let (mut idle, mut quick) = (server.view(), server.view());
    for _ in 0..300 {
        next(&mut quick, 3);
    }
    // Everything that was sent to the idle viewer up to the answer to its command.
    idle.send(Packet::text(r#"{"do":"nonsense"}"#)).unwrap();
    let mut frames = Vec::new();
    loop {
        match idle.read().unwrap() {
            Packet::Binary(bytes) => {
                if let Message::Frame(frame) = Message::decode(&bytes).unwrap() {
                    frames.push(frame);
                }
            }
            Packet::Text(_) => break,
            _ => {}
        }
    }
    assert_eq!(frames.len(), 2);
    idle.send(Packet::text(r#"{"do":"drawn"}"#)).unwrap();
    let Message::Frame(merged) = next(&mut idle, 3) else {
        unreachable!()
    };
    // A busy machine may have merged frames before the first was sent.
    let dropped = merged.dropped - frames[1].dropped;
    assert!(dropped > 200, "{dropped} dropped");
    assert_eq!(merged.folded.ticks, 16 * (dropped + 1));
}

#[test]
fn commands_reach_the_feed_and_others_are_answered_with_a_line() {
    let server = Server::start();
    let mut socket = server.view();
    socket
        .send(Packet::text(r#"{"do":"seek","time_ns":5}"#))
        .unwrap();
    assert_eq!(
        server.commands.recv().unwrap(),
        Command::Seek { time_ns: 5 }
    );
    let bad = [
        r#"{"do":"delete"}"#,
        r#"{"do":"seek"}"#,
        r#"{"do":"seek","time_ns":5,"file":"x"}"#,
        r#"{"do":"speed","factor":1e9}"#,
        "[]",
        "",
    ];
    for bad in bad {
        socket.send(Packet::text(bad)).unwrap();
        let line = loop {
            if let Packet::Text(line) = socket.read().unwrap() {
                break line;
            }
        };
        assert!(line.lines().count() == 1 && line.ends_with('.'), "{line}");
    }
    // Two viewers ask for stresses: the feed computes them until the last of them leaves.
    let mut other = server.view();
    socket
        .send(Packet::text(r#"{"do":"stress","on":true}"#))
        .unwrap();
    assert_eq!(
        server.commands.recv().unwrap(),
        Command::Stress { on: true }
    );
    other
        .send(Packet::text(r#"{"do":"stress","on":true}"#))
        .unwrap();
    other.send(Packet::text(r#"{"do":"pause"}"#)).unwrap();
    assert_eq!(server.commands.recv().unwrap(), Command::Pause);
    drop(socket);
    drop(other);
    assert_eq!(
        server.commands.recv().unwrap(),
        Command::Stress { on: false }
    );
}

#[test]
fn the_end_of_a_run_is_told_and_the_last_state_stays() {
    let server = Server::with(Synthetic::new(5));
    for _ in 0..2 {
        let mut socket = server.view();
        let Message::Frame(_) = next(&mut socket, 3) else {
            unreachable!()
        };
        next(&mut socket, 6);
    }
    let mut socket = server.view();
    next(&mut socket, 6);
    server.stop.store(true, Ordering::Release);
    assert_eq!(
        closed(&mut socket).map(|frame| frame.code.into()),
        Some(1001)
    );
}

#[test]
fn any_request_gets_an_answer_or_an_end() {
    let server = Server::start();
    let path = format!("/{}/", server.token);
    let bytes = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..2000),
        "(GET|HEAD|get) (/[a-z/.%?]{0,20}|\\*|http://x/) HTTP/1\\.[01]\r\n(Host: [a-z0-9.:\\[\\]]{0,20}\r\n){0,2}([A-Za-z-]{1,12}: [ -~]{0,30}\r\n){0,5}\r\n"
            .prop_map(String::into_bytes),
        "[ -~]{0,60}".prop_map(move |field| format!("GET {path}socket HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: upgrade\r\nSec-WebSocket-Key: {field}\r\n\r\n").into_bytes()),
    ];
    let config = ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(256)
    };
    proptest!(config, |(bytes in bytes)| {
        let mut stream = server.connect();
        let _ = stream.write_all(&bytes);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let answer = answer(&mut stream);
        prop_assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 "));
        prop_assert!(!answer.starts_with("HTTP/1.1 1"), "no upgrade without a version");
    });
    assert!(server.page("").starts_with("HTTP/1.1 200"));
}
