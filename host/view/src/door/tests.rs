use super::request::{Admitted, admitted};
use super::*;
use std::collections::VecDeque;
use std::io::Read;
use std::sync::mpsc::{Receiver, Sender, channel};
use tungstenite::client::IntoClientRequest;
use tungstenite::{HandshakeError, WebSocket};

/// Longest wait for what must come. It turns a hang into a failure.
const PATIENCE: Duration = Duration::from_secs(60);
const TOKEN: &str = "abc";

/// Packets in order, without a limit.
#[derive(Default)]
struct Packets(VecDeque<Packet>);

impl Queue for Packets {
    type Item = Packet;

    fn pop(&mut self, _closing: bool) -> Option<Packet> {
        self.0.pop_front()
    }
}

/// A service that sends every text back, and has one file.
struct Echo {
    joined: Mutex<Sender<Arc<Client<Packets>>>>,
    left: Mutex<Sender<u64>>,
}

impl Service for Echo {
    type Queue = Packets;
    const SOCKET: &'static str = "socket";
    const FOR: &'static str = "the test";
    const PROTOCOLS: &'static [&'static str] = &["new", "old"];
    const TRUST: &'static str = " Trust them.";

    fn admits(&self, origin: &str, host: &str) -> bool {
        admits(origin, host)
    }

    fn file(&self, path: &str) -> Result<Response, Refusal> {
        match path {
            "/" => Ok(Response::new(String::new(), &b"file"[..])),
            other => Err(Refusal::new("404 Not Found", format!("no {other}"))),
        }
    }

    fn queue(&self) -> Packets {
        Packets::default()
    }

    fn join(&self, client: &Arc<Client<Packets>>) {
        let joined = self.joined.lock().expect("a sender");
        let _ = joined.send(Arc::clone(client));
    }

    fn leave(&self, client: &Client<Packets>) {
        let left = self.left.lock().expect("a sender");
        let _ = left.send(client.number);
    }

    fn take(&self, client: &Client<Packets>, message: &Packet) {
        client.tell(message.to_text().expect("a text"));
    }
}

fn admits(origin: &str, host: &str) -> bool {
    origin == "https://viewer.example" || origin.strip_prefix("http://") == Some(host)
}

const USUAL: [(&str, &str); 7] = [
    ("Host", "127.0.0.1:8765"),
    ("Origin", "http://127.0.0.1:8765"),
    ("Connection", "keep-alive, Upgrade"),
    ("Upgrade", "websocket"),
    ("Sec-WebSocket-Version", "13"),
    // The example of RFC 6455, section 1.3.
    ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ("Sec-WebSocket-Protocol", "old"),
];

/// A request with the usual fields, in which `change` has another value or, if empty, is missing.
fn request(target: &str, change: (&str, &str)) -> String {
    let value = |(name, value)| if name == change.0 { change.1 } else { value };
    let fields = USUAL.into_iter().map(|field| (field.0, value(field)));
    let fields = fields.filter(|(_, value)| !value.is_empty());
    let mut text = format!("GET {target} HTTP/1.1\r\n");
    for (name, value) in fields {
        text += &[name, ": ", value, "\r\n"].concat();
    }
    text + "\r\n"
}

/// What the door makes of bytes; `None` if the request is not whole.
fn judged(bytes: &[u8]) -> Option<Result<Admitted, Refusal>> {
    let judged = judge(bytes, TOKEN, Echo::TRUST, &admits).transpose()?;
    Some(judged.and_then(|(request, path)| admitted::<Echo>(&request, path)))
}

/// The response that opens a WebSocket.
fn opened(change: (&str, &str)) -> Result<String, Refusal> {
    match judged(request("/abc/socket", change).as_bytes()).expect("a whole request")? {
        Admitted::Socket(response) => Ok(String::from_utf8(response).expect("text")),
        Admitted::File(path) => panic!("a file: {path}"),
    }
}

fn refused(bytes: &[u8]) -> Refusal {
    match judged(bytes).expect("a whole request") {
        Err(refusal) => refusal,
        Ok(_) => panic!("admitted: {}", String::from_utf8_lossy(bytes)),
    }
}

#[test]
fn a_client_with_the_token_is_admitted_to_files_and_to_the_socket() {
    let path = |target: &str| match judged(request(target, ("", "")).as_bytes()) {
        Some(Ok(Admitted::File(path))) => path,
        _ => panic!("{target}"),
    };
    assert_eq!(path("/abc"), "");
    assert_eq!(path("/abc/?x=1"), "/");
    assert_eq!(path("/abc/a/b"), "/a/b");
    let response = opened(("Origin", "")).expect("admitted");
    assert!(response.starts_with("HTTP/1.1 101 "));
    let lower = response.to_lowercase();
    assert!(lower.contains("\r\nsec-websocket-accept: s3pplmbitxaq9kygzzhzrbk+xoo=\r\n"));
    assert!(lower.contains("\r\nsec-websocket-protocol: old\r\n"));
}

#[test]
fn the_protocol_is_one_that_the_client_offers() {
    let both = opened(("Sec-WebSocket-Protocol", "old, new")).expect("admitted");
    assert!(both.contains(": new\r\n"), "{both}");
    let wrong = [
        ("Sec-WebSocket-Protocol", ""),
        ("Sec-WebSocket-Protocol", "mqtt"),
        ("Upgrade", ""),
        ("Connection", "close"),
        ("Sec-WebSocket-Key", ""),
        ("Sec-WebSocket-Version", "12"),
    ];
    for change in wrong {
        let refusal = opened(change).expect_err("refused");
        assert_eq!(refusal.status, "426 Upgrade Required", "{change:?}");
        assert_eq!(refusal.line, "This address is for the test.");
    }
}

#[test]
fn a_wrong_token_is_refused() {
    for target in [
        "/",
        "/ab",
        "/abd",
        "/abcd",
        "/ABC",
        "//abc",
        "/x/abc",
        "*",
        "http://127.0.0.1/abc/",
    ] {
        let refusal = refused(request(target, ("", "")).as_bytes());
        assert_eq!(refusal.status, "403 Forbidden", "{target}");
        assert!(
            !refusal.line.contains(TOKEN),
            "the token is told: {refusal:?}"
        );
    }
}

#[test]
fn only_names_of_this_machine_are_served() {
    for host in [
        "localhost",
        "LocalHost:1",
        "[::1]",
        "[::1]:8765",
        "127.0.0.1:65535",
    ] {
        let bytes = request("/abc/", ("Host", host)).replace("Origin", "X");
        assert!(
            judged(bytes.as_bytes()).is_some_and(|judged| judged.is_ok()),
            "{host}"
        );
    }
    let foreign = "evil.example 127.0.0.1.evil.example localhost.evil.example:8765 localhost: localhost:123456 \
                   localhost:70000 localhost:+8 localhost:80:80 127.0.0.2 127.0.0.1@evil.example [::2]:80 [::1]x :80";
    for host in foreign.split(' ').filter(|host| !host.is_empty()) {
        let refusal = refused(request("/abc/", ("Host", host)).as_bytes());
        assert_eq!(refusal.status, "403 Forbidden", "{host}");
        assert!(
            refusal.line.contains(&format!("The name {host} in")),
            "{refusal:?}"
        );
    }
    assert_eq!(
        refused(request("/abc/", ("Host", "")).as_bytes()).status,
        "400 Bad Request"
    );
}

#[test]
fn an_origin_that_the_service_does_not_admit_is_refused() {
    for origin in ["", "https://viewer.example"] {
        assert!(opened(("Origin", origin)).is_ok(), "{origin}");
    }
    for origin in ["null", "https://evil.example", "http://127.0.0.1:1"] {
        let refusal = opened(("Origin", origin)).expect_err("refused");
        assert_eq!(refusal.status, "403 Forbidden");
        let line = format!("Pages of the origin {origin} may not use this server. Trust them.");
        assert_eq!(refusal.line, line);
    }
    let control = opened(("Origin", "http://\u{9b}2J")).expect_err("refused");
    assert!(control.line.contains("http://\\xc2\\x9b2J"), "{control:?}");
}

#[test]
fn a_field_that_the_door_reads_may_not_occur_twice() {
    let whole = request("/abc/socket", ("", ""));
    for name in [
        "Host",
        "Origin",
        "Upgrade",
        "Sec-WebSocket-Key",
        "Sec-WebSocket-Version",
    ] {
        let (_, value) = USUAL.iter().find(|field| field.0 == name).expect("a field");
        let twice = whole.replace(
            &format!("\r\n{name}:"),
            &format!("\r\n{name}: {value}\r\n{name}:"),
        );
        assert_eq!(
            refused(twice.as_bytes()).line,
            format!("The field {name} occurs twice.")
        );
    }
}

#[test]
fn a_request_is_judged_when_it_is_whole_and_within_limits() {
    let whole = request("/abc/", ("", ""));
    for length in 0..whole.len() {
        assert!(judged(&whole.as_bytes()[..length]).is_none(), "{length}");
    }
    let status = |bytes: &[u8]| refused(bytes).status;
    let long = |length| {
        whole.replace(
            "\r\n\r\n",
            &format!("\r\nX: {}\r\n\r\n", "x".repeat(length)),
        )
    };
    let room = 8 * 1024 - whole.len() - "X: \r\n".len();
    assert!(judged(long(room).as_bytes()).is_some_and(|judged| judged.is_ok()));
    assert_eq!(
        status(long(room + 1).as_bytes()),
        "431 Request Header Fields Too Large"
    );
    assert_eq!(
        status(&[b'G'; 8 * 1024]),
        "431 Request Header Fields Too Large"
    );
    let many = whole.replace("\r\n\r\n", &format!("\r\n{}\r\n", "X: y\r\n".repeat(200)));
    for bad in [
        many,
        format!("{whole}x"),
        whole.replace("HTTP/1.1", "HTTP/1.0"),
        "\x16\x03\x01\x02\x00\x01\x00".into(),
    ] {
        assert_eq!(status(bad.as_bytes()), "400 Bad Request", "{bad}");
    }
    assert_eq!(
        status(whole.replace("GET", "POST").as_bytes()),
        "405 Method Not Allowed"
    );
}

/// A server that ends with the test.
struct Server {
    door: Option<Door<Echo>>,
    address: String,
    joined: Receiver<Arc<Client<Packets>>>,
    left: Receiver<u64>,
    lines: Receiver<String>,
}

type Socket = WebSocket<TcpStream>;

impl Server {
    fn start() -> Self {
        Self::with(TIMES)
    }

    fn with(times: Times) -> Self {
        let mut bound = Bound::new(0).expect("a port");
        bound.times = times;
        let address = bound.address();
        let (say, lines) = channel();
        let say = Mutex::new(say);
        let (joined, joins) = channel();
        let (left, leaves) = channel();
        let echo = Echo {
            joined: Mutex::new(joined),
            left: Mutex::new(left),
        };
        let say = move |line: &str| {
            let _ = say.lock().expect("a sender").send(line.to_owned());
        };
        Self {
            door: Some(bound.open(echo, Arc::new(say)).expect("a thread")),
            address,
            joined: joins,
            left: leaves,
            lines,
        }
    }

    fn connect(&self) -> TcpStream {
        let (host, _) = self.address.split_once('/').expect("an address");
        let stream = TcpStream::connect(host).expect("a connection");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        stream
    }

    /// The answer to a request for the file.
    fn file(&self) -> String {
        let (host, token) = self.address.split_once('/').expect("an address");
        let mut stream = self.connect();
        let _ = write!(stream, "GET /{token}/ HTTP/1.1\r\nHost: {host}\r\n\r\n");
        answer(&mut stream)
    }

    /// Opens a WebSocket.
    fn open(&self) -> Socket {
        let mut request = format!("ws://{}/socket", self.address)
            .into_client_request()
            .expect("a request");
        let old = "old".parse().expect("a value");
        request.headers_mut().insert("Sec-WebSocket-Protocol", old);
        match tungstenite::client(request, self.connect()) {
            Ok((socket, _)) => socket,
            Err(HandshakeError::Failure(error)) => panic!("{error}"),
            Err(HandshakeError::Interrupted(_)) => panic!("no answer"),
        }
    }

    /// Opens the WebSocket of a client that is served.
    fn join(&self) -> (Socket, Arc<Client<Packets>>) {
        let socket = self.open();
        (
            socket,
            self.joined.recv_timeout(PATIENCE).expect("a client"),
        )
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(door) = self.door.take() {
            door.close("over");
        }
    }
}

fn answer(stream: &mut TcpStream) -> String {
    let mut bytes = Vec::new();
    // A connection that the server resets has ended, too.
    let _ = stream.read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The code and the reason with which the server ends a connection, after other packets.
fn closed(socket: &mut Socket) -> Option<(u16, String)> {
    loop {
        match socket.read() {
            Ok(Packet::Close(frame)) => {
                return frame.map(|frame| (frame.code.into(), frame.reason.to_string()));
            }
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

/// Whether the server sends a text back.
fn echoes(socket: &mut Socket, text: &str) -> bool {
    socket.send(Packet::text(text)).is_ok()
        && matches!(socket.read(), Ok(Packet::Text(back)) if back.as_str() == text)
}

#[test]
fn a_client_beyond_the_limit_is_told_so_and_may_come_later() {
    let server = Server::start();
    let mut clients: Vec<_> = (0..CLIENTS).map(|_| server.join()).collect();
    let (code, reason) = closed(&mut server.open()).expect("a reason");
    assert_eq!(code, 1013);
    assert_eq!(
        reason,
        "4 viewers are connected already, the most that are served."
    );
    let line = server.lines.recv_timeout(PATIENCE).expect("a line");
    assert_eq!(line, format!("refused a client: {reason}"));
    // A client that leaves makes room, whether it says so or not.
    let (mut polite, first) = clients.remove(0);
    polite.close(None).expect("sent");
    while polite.read().is_ok() {}
    assert_eq!(server.left.recv_timeout(PATIENCE), Ok(first.number));
    let (rude, second) = clients.remove(0);
    drop(rude);
    assert_eq!(server.left.recv_timeout(PATIENCE), Ok(second.number));
    for _ in 0..2 {
        // The place is free a moment after the service knows of the leave.
        let (mut socket, client) = loop {
            let socket = server.open();
            match server.joined.recv_timeout(Duration::from_millis(100)) {
                Ok(client) => break (socket, client),
                Err(_) => drop(socket),
            }
        };
        assert!(echoes(&mut socket, "again"));
        clients.push((socket, client));
    }
    for (socket, _) in &mut clients {
        assert!(echoes(socket, "still"));
    }
}

#[test]
fn a_connection_beyond_the_limit_is_refused_and_disturbs_no_client() {
    let server = Server::start();
    let (mut client, _) = server.join();
    let mut held: Vec<_> = (0..3 * CONNECTIONS).map(|_| server.connect()).collect();
    let last = held.last_mut().expect("a connection");
    let mut start = [0; 12];
    last.read_exact(&mut start).expect("an answer");
    assert_eq!(&start, b"HTTP/1.1 503");
    assert!(echoes(&mut client, "still"));
    drop(held);
    // The places are free once the server has noticed.
    while !server.file().ends_with("\r\n\r\nfile") {}
}

#[test]
fn a_slow_request_is_ended() {
    let server = Server::with(Times {
        request: Duration::from_millis(200),
        ..TIMES
    });
    let mut silent = server.connect();
    let mut slow = server.connect();
    slow.write_all(b"GET / HTTP/1.1\r\n").expect("sent");
    // A byte now and then does not prolong the time.
    let mut drips = server.connect();
    let mut drop_by_drop = drips.try_clone().expect("a socket");
    let dripping = thread::spawn(move || {
        while drop_by_drop.write_all(b"G").is_ok() {
            thread::sleep(Duration::from_millis(10));
        }
    });
    assert!(answer(&mut slow).starts_with("HTTP/1.1 408 "));
    assert!(answer(&mut drips).starts_with("HTTP/1.1 408 "));
    assert_eq!(answer(&mut silent), "");
    dripping.join().expect("no panic");
}

#[test]
fn a_client_that_takes_nothing_is_disconnected() {
    let server = Server::with(Times {
        taking: Duration::from_millis(200),
        ..TIMES
    });
    let (idle, slow) = server.join();
    let (mut quick, _) = server.join();
    // More than the buffers of a connection hold.
    let large = Packet::binary(vec![0; 64 << 20]);
    slow.with(|queue| queue.0.push_back(large));
    assert!(echoes(&mut quick, "meanwhile"));
    assert_eq!(server.left.recv_timeout(PATIENCE), Ok(slow.number));
    assert!(echoes(&mut quick, "after"));
    drop(idle);
}

#[test]
fn a_client_that_sends_without_reading_waits_for_itself() {
    const MESSAGES: usize = 1_000_000;
    let server = Server::start();
    let (mut flood, _) = server.join();
    let (mut client, _) = server.join();
    // Without this limit the test would wait here forever when the server stops reading, as it should.
    let limit = Some(Duration::from_millis(500));
    flood.get_mut().set_write_timeout(limit).expect("a timeout");
    let ping = || Packet::Ping(vec![0; 100].into());
    let sent = (0..MESSAGES).take_while(|_| flood.write(ping()).is_ok());
    assert!(sent.count() < MESSAGES);
    assert!(echoes(&mut client, "still"));
}

#[test]
fn a_long_message_or_garbage_ends_the_connection_of_its_sender_alone() {
    let server = Server::start();
    let (mut good, _) = server.join();
    let code = |socket: &mut Socket| closed(socket).map(|(code, _)| code);
    let (mut long, _) = server.join();
    long.send(Packet::text("x".repeat((64 << 10) + 1)))
        .expect("sent");
    assert_eq!(code(&mut long), Some(1009));
    for garbage in [
        &[0xff; 64][..],
        // A frame without a mask, one that claims 2^62 bytes, text that is no UTF-8.
        &[0x81, 2, b'{', b'}'],
        &[0x82, 0xff, 0x40, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4],
        &[0x81, 0x82, 0, 0, 0, 0, 0xc3, 0x28],
    ] {
        let (mut bad, client) = server.join();
        bad.get_mut().write_all(garbage).expect("sent");
        assert!(
            [Some(1002), Some(1009)].contains(&code(&mut bad)),
            "{garbage:?}"
        );
        while server.left.recv_timeout(PATIENCE).expect("a leave") != client.number {}
    }
    assert!(echoes(&mut good, &"x".repeat(64 << 10)));
    good.send(Packet::Ping(vec![1, 2].into())).expect("sent");
    assert_eq!(
        good.read().expect("a pong"),
        Packet::Pong(vec![1, 2].into())
    );
}

#[test]
fn the_end_comes_after_everything_that_waits_and_waits_for_nobody() {
    let mut server = Server::with(Times {
        parting: Duration::from_millis(500),
        ..TIMES
    });
    let (mut reads, client) = server.join();
    let (idle, slow) = server.join();
    slow.with(|queue| queue.0.push_back(Packet::binary(vec![0; 64 << 20])));
    client.with(|queue| {
        queue
            .0
            .extend((0..1000).map(|number| Packet::text(number.to_string())));
    });
    let reading = thread::spawn(move || {
        let texts: Vec<_> = std::iter::from_fn(|| match reads.read() {
            Ok(Packet::Text(text)) => Some(text.as_str().to_owned()),
            Ok(Packet::Close(frame)) => frame.map(|frame| frame.reason.to_string()),
            _ => None,
        })
        .collect();
        texts
    });
    server.door.take().expect("a door").close("over");
    let texts = reading.join().expect("no panic");
    assert_eq!(texts.len(), 1001);
    assert_eq!(texts.last().map(String::as_str), Some("over"));
    drop(idle);
}

#[test]
fn the_reason_of_a_refusal_is_told_once() {
    let server = Server::start();
    for _ in 0..3 {
        let mut stream = server.connect();
        stream
            .write_all(b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n")
            .expect("sent");
        assert!(answer(&mut stream).starts_with("HTTP/1.1 403 "));
    }
    let lines: Vec<_> = server.lines.try_iter().collect();
    assert_eq!(lines.len(), 1, "{lines:?}");
    assert!(
        lines[0].starts_with("refused a client: The name evil.example"),
        "{lines:?}"
    );
}
