//! The server for other people's viewers under hostile, slow and many clients.

mod foxglove_common;

use foxglove_common::{PATIENCE, Server, hello};
use host::live::frame::LogMessage;
use host::live::{Frame, Hello, Message as FeedMessage};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};
use view::feed::{Command, Feed, FeedError};
use view::foxglove::{FoxgloveError, Options, serve};

/// `host:port` and path of an address.
fn parts(address: &str) -> (&str, &str) {
    let rest = address.strip_prefix("ws://").expect("an address");
    rest.split_at(rest.find('/').expect("a path"))
}

fn open(server: &Server) -> TcpStream {
    let stream = TcpStream::connect(parts(&server.address).0).expect("a connection");
    stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
    stream
}

type Client = WebSocket<TcpStream>;

/// Opens a WebSocket; the status of the response where the server refuses.
fn try_join(server: &Server, fields: &[(&'static str, &str)]) -> Result<Client, u16> {
    let mut request = server
        .address
        .as_str()
        .into_client_request()
        .expect("a request");
    let protocol = ("Sec-WebSocket-Protocol", "foxglove.websocket.v1");
    for (name, value) in [protocol].iter().chain(fields) {
        let value = value.parse().expect("a value");
        request.headers_mut().insert(*name, value);
    }
    match tungstenite::client(request, open(server)) {
        Ok((client, _)) => Ok(client),
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
            Err(response.status().as_u16())
        }
        Err(other) => panic!("{other}"),
    }
}

/// A client that is greeted and has a subscription to the ticks.
fn join(server: &Server) -> Client {
    let mut client = try_join(server, &[]).expect("admitted");
    assert!(text(&mut client).starts_with(r#"{"op":"serverInfo""#));
    assert!(text(&mut client).starts_with(r#"{"op":"advertise""#));
    let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":9,"channelId":1}]}"#;
    client.send(Message::text(subscribe)).expect("sent");
    settle(&mut client);
    client
}

/// Waits until the server has taken everything that the client sent.
fn settle(client: &mut Client) {
    client
        .send(Message::text(r#"{"op":"settle"}"#))
        .expect("sent");
    while !text(client).contains("settle") {}
}

/// The next text.
fn text(client: &mut Client) -> String {
    loop {
        if let Message::Text(text) = client.read().expect("a message") {
            return text.as_str().to_owned();
        }
    }
}

/// The time of the next message of a channel.
fn tick(client: &mut Client) -> u64 {
    loop {
        if let Message::Binary(bytes) = client.read().expect("a message")
            && let [1, 9, 0, 0, 0, rest @ ..] = &bytes[..]
        {
            return u64::from_le_bytes(*rest.first_chunk().expect("a time"));
        }
    }
}

/// The whole response of the server to some bytes, until the server ends the connection.
fn response(server: &Server, bytes: &[u8]) -> String {
    let mut stream = open(server);
    stream.write_all(bytes).expect("sent");
    let mut answer = Vec::new();
    // A connection that the server resets has ended, too.
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

#[test]
fn four_clients_are_served_and_a_fifth_is_refused() {
    let server = Server::start(hello(), None);
    let mut clients: Vec<Client> = (0..4).map(|_| join(&server)).collect();
    assert_eq!(try_join(&server, &[]).err(), Some(503));
    let line = server.lines.recv_timeout(PATIENCE).expect("a line");
    assert_eq!(
        line,
        "refused a client: 4 clients are connected, and no more are served"
    );
    server.give("/tick", 5, vec![0; 8]);
    for client in &mut clients {
        assert_eq!(tick(client), 5);
    }
    // A client that leaves makes room, whether it says so or not.
    let mut polite = clients.pop().expect("a client");
    polite.close(None).expect("sent");
    while polite.read().is_ok() {}
    let rude = clients.pop().expect("a client");
    rude.get_ref().shutdown(Shutdown::Both).expect("ended");
    for _ in 0..2 {
        // The server notices the end of a connection in its own time.
        let joined = loop {
            match try_join(&server, &[]) {
                Ok(client) => break client,
                Err(status) => assert_eq!(status, 503),
            }
        };
        clients.push(joined);
    }
    server.end().expect("served");
}

#[test]
fn clients_that_may_not_connect_are_refused_with_one_line_each() {
    let server = Server::start(hello(), None);
    let evil = [("Origin", "https://evil.example")];
    for _ in 0..3 {
        assert_eq!(try_join(&server, &evil).err(), Some(403));
        assert_eq!(
            try_join(&server, &[("Host", "evil.example")]).err(),
            Some(403)
        );
    }
    assert!(try_join(&server, &[("Origin", "http://localhost:8080")]).is_ok());
    let (host, path) = parts(&server.address);
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n");
    let wrong = response(&server, get("/").as_bytes());
    assert!(wrong.starts_with("HTTP/1.1 403 "), "{wrong}");
    assert!(!wrong.contains(&path[1..]), "the token is told");
    assert!(response(&server, get(path).as_bytes()).starts_with("HTTP/1.1 426 "));
    assert!(response(&server, &[0x16; 100]).starts_with("HTTP/1.1 400 "));
    assert!(response(&server, &[b'G'; 9000]).starts_with("HTTP/1.1 400 "));

    let lines: Vec<String> = server.lines.try_iter().collect();
    let count = |part: &str| lines.iter().filter(|line| line.contains(part)).count();
    assert_eq!(count("https://evil.example"), 1, "{lines:?}");
    assert_eq!(count("Host"), 1);
    assert_eq!(count("token"), 1);
    server.end().expect("served");
}

#[test]
fn a_hundred_connections_do_not_disturb_a_client() {
    let server = Server::start(hello(), None);
    let mut client = join(&server);
    // Connections that say nothing, or half a request.
    let idle: Vec<TcpStream> = (0..100)
        .map(|number| {
            let mut stream = open(&server);
            if number % 2 == 0 {
                // The server ends connections beyond its limit.
                let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: ");
            }
            stream
        })
        .collect();
    for time in 1..100 {
        server.give("/tick", time, vec![0; 100]);
        assert_eq!(tick(&mut client), time);
    }
    drop(idle);
    server.end().expect("served");
}

#[test]
fn garbage_on_an_open_connection_ends_that_connection_alone() {
    let server = Server::start(hello(), None);
    let mut client = join(&server);
    for garbage in [
        &[0xff; 64][..],
        // A frame without a mask, one that claims 2^62 bytes, text that is no UTF-8, half a frame.
        &[0x81, 2, b'{', b'}'],
        &[0x82, 0xff, 0x40, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4],
        &[0x81, 0x82, 0, 0, 0, 0, 0xc3, 0x28],
        &[0x81, 0xfe, 1, 0, 0, 0, 0, 0, 1],
    ] {
        let mut hostile = join(&server);
        hostile.get_mut().write_all(garbage).expect("sent");
        hostile.get_mut().shutdown(Shutdown::Write).expect("ended");
        let mut rest = Vec::new();
        // A connection that the server resets has ended, too.
        let _ = hostile.get_mut().read_to_end(&mut rest);
        server.give("/tick", 1, vec![0; 8]);
        assert_eq!(tick(&mut client), 1);
    }
    // A ping is answered while the messages go on.
    client.send(Message::Ping(vec![1, 2].into())).expect("sent");
    while !matches!(client.read().expect("a message"), Message::Pong(_)) {}
    server.end().expect("served");
}

#[test]
fn a_client_that_sends_without_reading_waits_for_itself() {
    const MESSAGES: usize = 1_000_000;
    let server = Server::start(hello(), None);
    let mut client = join(&server);
    let flood = join(&server);
    let sending = std::thread::spawn(move || {
        let mut flood = flood;
        // Without this limit the test would wait here forever when the server stops reading, as it should.
        let limit = Some(std::time::Duration::from_millis(500));
        flood.get_mut().set_write_timeout(limit).expect("a timeout");
        (0..MESSAGES)
            .take_while(|_| flood.write(Message::text(r#"{"op":"x"}"#)).is_ok())
            .count()
    });
    for time in 1..100 {
        server.give("/tick", time, vec![0; 100]);
        assert_eq!(tick(&mut client), time);
    }
    // The answers fill the buffers of the connection, and then the server reads no further.
    assert!(sending.join().expect("no panic") < MESSAGES);
    server.end().expect("served");
}

#[test]
fn another_run_replaces_the_channels() {
    let server = Server::start(hello(), None);
    let mut client = join(&server);
    let other = Hello {
        run: 0xdef,
        ..hello()
    };
    server
        .feed
        .send(FeedMessage::Hello(Box::new(other)))
        .expect("a feed");
    let info = text(&mut client);
    assert!(info.contains(r#""sessionId":"def""#), "{info}");
    assert_eq!(
        text(&mut client),
        r#"{"op":"unadvertise","channelIds":[1,2]}"#
    );
    assert!(text(&mut client).contains(r#""id":3,"topic":"/tick""#));
    // The former subscription is gone, and the former number of the channel, too.
    server.give("/tick", 1, vec![0; 8]);
    let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":9,"channelId":1}]}"#;
    client.send(Message::text(subscribe)).expect("sent");
    assert!(text(&mut client).contains("channel 1 does not exist"));
    client
        .send(Message::text(subscribe.replace(":1}", ":3}")))
        .expect("sent");
    settle(&mut client);
    server.give("/tick", 2, vec![0; 8]);
    assert_eq!(tick(&mut client), 2);
    server.end().expect("served");
}

#[test]
fn a_jump_back_in_a_log_moves_the_time_back_and_a_model_does_not() {
    let server = Server::start(hello(), None);
    let mut client = join(&server);
    let mut times = Vec::new();
    for time in [100, 200, 50, 60] {
        // A model that is older than the ticks around it.
        let model = LogMessage {
            topic: "/model".into(),
            time_ns: 10,
            ..LogMessage::default()
        };
        server.give_frame(Frame {
            time_ns: time,
            log: vec![model],
            ..Frame::default()
        });
        server.give("/tick", time, vec![0; 8]);
        loop {
            match client.read().expect("a message") {
                Message::Binary(bytes) if bytes[0] == 2 => {
                    times.push(u64::from_le_bytes(
                        *bytes[1..].first_chunk().expect("a time"),
                    ));
                }
                Message::Binary(_) => break,
                _ => {}
            }
        }
    }
    times.dedup();
    let backwards = times.windows(2).filter(|pair| pair[1] < pair[0]).count();
    assert!(times.ends_with(&[60]), "{times:?}");
    assert_eq!(backwards, 1, "{times:?}");
    server.end().expect("served");
}

/// A feed that gives the facts of a run and then breaks off.
struct Broken(Option<Hello>);

impl Feed for Broken {
    fn next(&mut self, _wait: std::time::Duration) -> Result<Option<FeedMessage>, FeedError> {
        match self.0.take() {
            Some(hello) => Ok(Some(FeedMessage::Hello(Box::new(hello)))),
            None => Err(FeedError::Refused("no more".into())),
        }
    }

    fn command(&mut self, _command: &Command) {}

    fn present(&self) -> Vec<FeedMessage> {
        Vec::new()
    }
}

#[test]
fn the_server_says_why_it_cannot_serve() {
    let quiet = || Options {
        port: 0,
        say: std::sync::Arc::new(|_| ()),
        ..Options::default()
    };
    let error = |feed: Broken, options: &Options| {
        let ended = serve(Box::new(feed), options);
        ended.expect_err("an error").to_string()
    };
    assert_eq!(error(Broken(Some(hello())), &quiet()), "no more");
    assert_eq!(error(Broken(None), &quiet()), "no more");
    for origin in [
        "viewer.example",
        "https://a/b",
        "*",
        "https://*.example",
        "",
    ] {
        let options = Options {
            origins: vec![origin.to_owned()],
            ..quiet()
        };
        let wrong = error(Broken(None), &options);
        assert!(wrong.contains("is not allowed; write scheme"), "{wrong}");
    }
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("an address").port();
    let busy = serve(Box::new(Broken(None)), &Options { port, ..quiet() });
    assert!(matches!(busy, Err(FoxgloveError::Port { .. })), "{busy:?}");

    let (say, lines) = mpsc::channel();
    let say = std::sync::Mutex::new(say);
    let options = Options {
        token: Some("secret7".into()),
        say: std::sync::Arc::new(move |line| {
            let _ = say.lock().expect("a sender").send(line.to_owned());
        }),
        ..quiet()
    };
    error(Broken(Some(hello())), &options);
    assert!(lines.recv().expect("a line").contains("/secret7 "));
}
