//! The server for other people's viewers under hostile, slow and many clients.

mod foxglove_common;

use foxglove_common::{PATIENCE, Server, hello};
use host::live::frame::LogMessage;
use host::live::{Frame, Hello, Message as FeedMessage, ObstacleInfo, ToolInfo};
use std::io::{Read, Write};
use std::net::TcpStream;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};
use view::door::DoorError;
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

/// Opens a WebSocket; the status of the response if the server refuses.
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

#[test]
fn clients_that_may_not_connect_are_refused_and_the_person_is_told() {
    let server = Server::start(hello(), None);
    let status = |fields: &[_]| try_join(&server, fields).err();
    assert_eq!(status(&[("Origin", "https://evil.example")]), Some(403));
    assert_eq!(status(&[("Host", "evil.example")]), Some(403));
    assert_eq!(status(&[("Origin", "http://localhost:8080")]), None);
    // A person who opens the address in a browser is told what it is for.
    let (host, path) = parts(&server.address);
    let get = |path: &str| {
        let mut stream = open(&server);
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("text");
        answer
    };
    assert!(get("/").starts_with("HTTP/1.1 403 "));
    assert!(get(path).starts_with("HTTP/1.1 426 "));
    assert!(get(path).ends_with("such as Foxglove or Lichtblick.\n"));
    assert!(get(&format!("{path}/file")).starts_with("HTTP/1.1 404 "));

    let lines: Vec<String> = server.lines.try_iter().collect();
    let advice = "refused a client: Pages of the origin https://evil.example may not use this server. If you trust \
                  them, start the server with --allow-origin and this origin.";
    assert!(lines.iter().any(|line| line == advice), "{lines:?}");
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
        r#"{"op":"unadvertise","channelIds":[1,2,3,4]}"#
    );
    assert!(text(&mut client).contains(r#""id":5,"topic":"/tick""#));
    // The former subscription is gone, and the former number of the channel, too.
    server.give("/tick", 1, vec![0; 8]);
    let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":9,"channelId":1}]}"#;
    client.send(Message::text(subscribe)).expect("sent");
    assert!(text(&mut client).contains("channel 1 does not exist"));
    client
        .send(Message::text(subscribe.replace(":1}", ":5}")))
        .expect("sent");
    settle(&mut client);
    server.give("/tick", 2, vec![0; 8]);
    assert_eq!(tick(&mut client), 2);
    server.end().expect("served");
}

/// A scene pays for no channel that it does not use: contacts and patches have channels where a log has them.
#[test]
fn a_scene_with_contact_and_tools_has_their_channels() {
    let basic = ["/tick", "/model", "/bodies/sheet", "/bodies/sheet/frame"];
    let ball = ObstacleInfo {
        name: "ball".into(),
        ..ObstacleInfo::default()
    };
    let tools = [
        "/patch",
        "/obstacles/ball",
        "/tools/ball/led",
        "/tools/ball/sites",
    ];
    for (touches, has_tools) in [(false, false), (true, false), (true, true)] {
        let server = Server::start(
            Hello {
                touches,
                tools: vec![ToolInfo::default(); usize::from(has_tools)],
                obstacles: vec![ball.clone(); usize::from(has_tools)],
                ..hello()
            },
            None,
        );
        let mut client = try_join(&server, &[]).expect("admitted");
        assert!(text(&mut client).starts_with(r#"{"op":"serverInfo""#));
        let offer: serde_json::Value = serde_json::from_str(&text(&mut client)).expect("JSON");
        let offered = offer["channels"].as_array().expect("a list").iter();
        let topics: Vec<_> = (offered.map(|channel| channel["topic"].as_str().unwrap())).collect();
        let contacts = touches.then_some("/contacts");
        let tools = tools.into_iter().filter(|_| has_tools);
        let expected: Vec<_> = (basic.into_iter().chain(contacts).chain(tools)).collect();
        assert_eq!(topics, expected);
        server.end().expect("served");
    }
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
    assert!(
        matches!(busy, Err(FoxgloveError::Door(DoorError::Port { .. }))),
        "{busy:?}"
    );
}
