//! The server for other people's viewers, checked with the protocol's JavaScript client.
//!
//! The packages `@foxglove/ws-protocol`, `@foxglove/rosmsg` and `ws` are searched in the folder `PALPATE_NODE_MODULES`:
//!
//! ```sh
//! npm install @foxglove/ws-protocol @foxglove/rosmsg ws
//! PALPATE_NODE_MODULES=$PWD/node_modules cargo test --release -p palpate-view --test foxglove_client
//! ```

mod foxglove_common;

use foxglove_common::{Logged, PATIENCE, Server, hello, messages_of, run_with_log};
use host::live::frame::LogMessage;
use host::live::{BodyState, Frame, Hello, ObstacleInfo, ObstacleState, Vertices};
use host::log::{LogHeader, LogWriter};
use host::record::contact::{ContactPoint, ContactStep};
use host::record::{BodyFrame, Cloud, Group, Kind};
use physics::Vec3;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;

/// The clients, in a process of node.
struct Clients {
    node: Child,
    commands: ChildStdin,
    events: Receiver<Value>,
    /// Events that came and were not asked for yet.
    waiting: VecDeque<Value>,
}

impl Clients {
    /// Starts node; `None` if something is missing.
    fn start() -> Option<Self> {
        let skipped = |why: &str| {
            eprintln!("SKIPPED: the server is not checked with the client of its protocol: {why}");
            None
        };
        let Some(modules) = std::env::var_os("PALPATE_NODE_MODULES") else {
            return skipped("PALPATE_NODE_MODULES names no folder with the packages");
        };
        for package in ["@foxglove/ws-protocol", "@foxglove/rosmsg", "ws"] {
            if !Path::new(&modules).join(package).is_dir() {
                return skipped(&format!("PALPATE_NODE_MODULES has no package {package}"));
            }
        }
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foxglove_client.js");
        let node = Command::new("node")
            .arg(script)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        let Ok(mut node) = node else {
            return skipped("node is missing");
        };
        let output = node.stdout.take().expect("a pipe");
        let (sender, events) = mpsc::channel();
        thread::spawn(move || {
            for line in BufReader::new(output).lines() {
                let line = line.expect("text");
                let event = serde_json::from_str(&line).expect("JSON");
                if sender.send(event).is_err() {
                    return;
                }
            }
        });
        Some(Self {
            commands: node.stdin.take().expect("a pipe"),
            node,
            events,
            waiting: VecDeque::new(),
        })
    }

    fn tell(&mut self, command: &Value) {
        writeln!(self.commands, "{command}").expect("node runs");
    }

    /// Connects a client and subscribes it to topics. Returns the texts of the server.
    fn join(&mut self, client: &str, server: &Server, topics: &[&str]) -> [Value; 2] {
        self.tell(&json!({"do": "connect", "client": client, "url": server.address}));
        let info = self.next(client, &["serverInfo"]);
        let channels = self.next(client, &["advertise"]);
        for topic in topics {
            self.tell(&json!({"do": "subscribe", "client": client, "topic": topic}));
        }
        self.settle(client);
        [info["info"].clone(), channels["channels"].clone()]
    }

    /// Waits until the server has taken everything that a client sent so far: the answer to a message without meaning.
    fn settle(&mut self, client: &str) -> Vec<Value> {
        self.tell(&json!({"do": "text", "client": client, "text": r#"{"op":"settle"}"#}));
        self.until(client, |event| {
            event["event"] == "status"
                && event["message"]
                    .as_str()
                    .is_some_and(|text| text.contains("settle"))
        })
    }

    /// The next event of a client of one of these kinds. Its other events before are left out.
    fn next(&mut self, client: &str, kinds: &[&str]) -> Value {
        let wanted = |event: &Value| {
            event["event"]
                .as_str()
                .is_some_and(|kind| kinds.contains(&kind))
        };
        self.until(client, wanted).pop().expect("an event")
    }

    /// The events of a client up to the first that is `wanted`.
    fn until(&mut self, client: &str, wanted: impl Fn(&Value) -> bool) -> Vec<Value> {
        let mut events = Vec::new();
        let mut others = VecDeque::new();
        loop {
            let event = self.waiting.pop_front().unwrap_or_else(|| {
                let event = self.events.recv_timeout(PATIENCE);
                event.unwrap_or_else(|_| panic!("no event after {:?}", events.last()))
            });
            if event["client"] != client {
                others.push_back(event);
                continue;
            }
            let found = wanted(&event);
            events.push(event);
            if found {
                others.append(&mut self.waiting);
                self.waiting = others;
                return events;
            }
        }
    }
}

impl Drop for Clients {
    fn drop(&mut self) {
        // Node ends by itself when its input ends; this is for a test that failed.
        let _ = self.node.kill();
        let _ = self.node.wait();
    }
}

fn of_kind<'a>(events: &'a [Value], kind: &str) -> Vec<&'a Value> {
    events
        .iter()
        .filter(|event| event["event"] == kind)
        .collect()
}

/// Topic, time and content of the messages among events.
fn messages(events: &[Value]) -> Vec<Logged> {
    let message = |event: &&Value| {
        let hex = event["hex"].as_str().expect("content");
        let byte = |at| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex");
        let data = (0..hex.len()).step_by(2).map(byte).collect();
        let topic = event["topic"].as_str().expect("a topic").to_owned();
        (topic, number(&event["time"]), data)
    };
    of_kind(events, "message").iter().map(message).collect()
}

fn number(text: &Value) -> u64 {
    text.as_str()
        .and_then(|text| text.parse().ok())
        .expect("a number")
}

#[test]
fn a_client_receives_the_messages_of_the_log() {
    let Some(mut clients) = Clients::start() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("run.mcap");
    let frames = run_with_log(0.3, &log);
    let last_ns = frames.last().expect("frames").time_ns;
    let server = Server::start(hello(), None);
    let [info, channels] = clients.join("a", &server, &["/tick", "/model"]);
    assert_eq!(info["name"], "palpate: stretch");
    assert_eq!(info["capabilities"], json!(["time"]));
    assert_eq!(info["sessionId"], "abc");
    assert_eq!(info["metadata"]["clock"], "virtual");

    // The channels are those of the log.
    let bytes = std::fs::read(&log).expect("the log");
    let summary = mcap::Summary::read(&bytes)
        .expect("a log")
        .expect("an index");
    assert_eq!(channels.as_array().expect("a list").len(), 4);
    for logged in summary.channels.values().take(2) {
        let schema = logged.schema.as_ref().expect("a schema");
        let all = channels.as_array().expect("a list");
        let channel = all.iter().find(|channel| channel["topic"] == *logged.topic);
        let channel = channel.expect("advertised");
        assert_eq!(channel["encoding"], *logged.message_encoding);
        assert_eq!(channel["schemaName"], *schema.name);
        assert_eq!(channel["schemaEncoding"], *schema.encoding);
        let text = channel["schema"].as_str().expect("text");
        assert_eq!(text.as_bytes(), &*schema.data);
        assert!(channel["types"].as_u64() > Some(3), "{channel}");
    }
    assert_eq!(
        channels[0]["fields"],
        json!([
            "tick",
            "time_ns",
            "lateness_ns",
            "took_ns",
            "devices",
            "bodies",
            "readings",
            "patches",
            "touch",
            "turn",
            "way",
            "stamps"
        ])
    );

    for frame in frames {
        server.give_frame(frame);
    }
    let events = clients.until("a", |event| {
        event["topic"] == "/tick" && number(&event["time"]) == last_ns
    });
    let received = messages(&events);
    let logged = messages_of(&bytes);
    assert_eq!(received.len(), logged.len());
    for (at, (received, logged)) in received.iter().zip(&logged).enumerate() {
        assert!(
            received == logged,
            "message {at}, {} at {}",
            logged.0,
            logged.1
        );
    }
    assert_eq!(
        received
            .iter()
            .filter(|(topic, ..)| topic == "/tick")
            .count(),
        300
    );
    assert!(
        received
            .iter()
            .filter(|(topic, ..)| topic == "/model")
            .count()
            > 10
    );

    // The time of the client is that of the run, and never goes back.
    let mut time = None;
    let mut ticks = 0;
    for event in &events {
        match event["event"].as_str() {
            Some("time") => {
                let next = number(&event["time"]);
                assert!(time.is_none_or(|time| time < next), "{next} after {time:?}");
                time = Some(next);
            }
            Some("message") if event["topic"] == "/tick" => {
                assert_eq!(Some(number(&event["time"])), time);
                assert_eq!(number(&event["numbers"][0]), ticks);
                assert_eq!(event["numbers"][1], event["time"]);
                ticks += 1;
            }
            _ => {}
        }
    }
    server.end().expect("served");
    let over = clients.next("a", &["status"]);
    assert_eq!(over["message"], "the run is over");
    assert_eq!(clients.next("a", &["close"])["code"], 1001);
}

#[test]
fn the_bodies_arrive_as_the_log_has_them() {
    let Some(mut clients) = Clients::start() else {
        return;
    };
    let positions: Vec<f32> = (0..300).map(|number| number as f32 * 0.1).collect();
    let mut frame = BodyFrame {
        body: 0,
        step: 7,
        time_ns: 90,
        epoch: 2,
    };
    let file = std::io::Cursor::new(Vec::new());
    let mut log = LogWriter::create(file, &LogHeader::default()).expect("a log");
    log.add(Group::Frames, 0, "sheet").expect("channels");
    let stamp = frame.stamp();
    let mut cloud = Cloud {
        time_ns: frame.time_ns,
        positions: positions.clone(),
    };
    log.write_record(stamp, &mut frame).expect("written");
    log.write_record(stamp, &mut cloud).expect("written");
    let bytes = log.finish().expect("written").into_inner();

    let server = Server::start(hello(), None);
    let topics = ["/bodies/sheet", "/bodies/sheet/frame"];
    let [_, channels] = clients.join("a", &server, &topics);
    let vertices = Vertices {
        step: 7,
        time_ns: 90,
        epoch: 2,
        count: 100,
        positions,
        ..Vertices::default()
    };
    server.give_frame(Frame {
        time_ns: 100,
        bodies: vec![BodyState {
            vertices: Some(vertices),
            ..BodyState::default()
        }],
        ..Frame::default()
    });
    let events = clients.until("a", |event| event["topic"] == "/bodies/sheet");
    assert_eq!(messages(&events), messages_of(&bytes));
    let cloud = &channels[2];
    assert_eq!(cloud["topic"], "/bodies/sheet");
    assert_eq!(cloud["schemaName"], "sensor_msgs/msg/PointCloud2");
    assert_eq!(cloud["fields"][3], "fields");
    server.end().expect("served");
}

#[test]
fn contacts_and_obstacles_have_channels_in_a_scene_with_contact_alone() {
    let Some(mut clients) = Clients::start() else {
        return;
    };
    let mut step = ContactStep {
        step: 3,
        time_ns: 90,
        points: vec![ContactPoint {
            sides: [0, 1],
            at: Vec3::new(0.01, 0.02, 0.05),
            force: Vec3::new(0.0, 0.0, 0.2),
            depth: 1e-7,
        }],
        ..ContactStep::default()
    };
    let file = std::io::Cursor::new(Vec::new());
    let mut log = LogWriter::create(file, &LogHeader::default()).expect("a log");
    log.add(Group::Contacts, 0, "").expect("channels");
    log.write_record(step.stamp(), &mut step).expect("written");
    let bytes = log.finish().expect("written").into_inner();

    let touching = Hello {
        touches: true,
        obstacles: vec![ObstacleInfo {
            name: "ball".into(),
            shape: "sphere".into(),
            positions: vec![1.0, 0.0, 0.0, 0.0, 2.0, 0.0],
            triangles: Vec::new(),
        }],
        ..hello()
    };
    let server = Server::start(touching, None);
    let [_, channels] = clients.join("a", &server, &["/contacts", "/obstacles/ball"]);
    let channels = channels.as_array().expect("a list");
    // A scene without contact has four.
    assert_eq!(channels.len(), 6);
    assert_eq!(channels[4]["topic"], "/contacts");
    assert_eq!(
        channels[4]["fields"],
        json!(["step", "time_ns", "tick", "sums", "points"])
    );
    assert_eq!(channels[5]["schemaName"], "sensor_msgs/msg/PointCloud2");
    let [(_, time_ns, data)] = &messages_of(&bytes)[..] else {
        panic!("one message");
    };
    server.give_frame(Frame {
        time_ns: 100,
        log: vec![LogMessage {
            topic: "/contacts".into(),
            time_ns: *time_ns,
            length: data.len() as u32,
            data: data.clone(),
        }],
        // A quarter of a turn about z.
        obstacles: vec![ObstacleState {
            pose: [0.0, 0.0, 0.5, 0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()],
            positions: Vec::new(),
        }],
        ..Frame::default()
    });
    let events = clients.until("a", |event| event["topic"] == "/obstacles/ball");
    let placed: [f32; 6] = [0.0, 1.0, 0.5, -2.0, 0.0, 0.5];
    let received = messages(&events);
    assert_eq!(received[0], ("/contacts".to_owned(), 90, data.clone()));
    let (topic, 100, cloud) = &received[1] else {
        panic!("the cloud has the time of the frame");
    };
    assert_eq!(topic, "/obstacles/ball");
    let found = Cloud::decode(100, cloud).expect("a cloud").positions;
    let near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-6;
    assert!(
        found.len() == 6 && found.iter().zip(&placed).all(near),
        "{found:?}"
    );
    server.end().expect("served");
}

#[test]
fn a_subscription_ends_and_other_clients_keep_theirs() {
    let Some(mut clients) = Clients::start() else {
        return;
    };
    let server = Server::start(hello(), None);
    clients.join("a", &server, &["/tick", "/model"]);
    clients.join("b", &server, &["/tick"]);
    server.give("/model", 1, vec![1; 20]);
    server.give("/tick", 2, vec![2; 20]);
    let topics = |events: &[Value]| {
        let all = messages(events).into_iter();
        all.map(|(topic, time, _)| format!("{topic} {time}"))
            .collect::<Vec<_>>()
    };
    let is_tick = |event: &Value| event["topic"] == "/tick";
    assert_eq!(
        topics(&clients.until("a", is_tick)),
        ["/model 1", "/tick 2"]
    );
    assert_eq!(topics(&clients.until("b", is_tick)), ["/tick 2"]);

    clients.tell(&json!({"do": "unsubscribe", "client": "a", "topic": "/tick"}));
    clients.settle("a");
    server.give("/tick", 3, vec![3; 20]);
    server.give("/model", 4, vec![4; 20]);
    let is_model = |event: &Value| event["topic"] == "/model";
    assert_eq!(topics(&clients.until("a", is_model)), ["/model 4"]);
    assert_eq!(topics(&clients.until("b", is_tick)), ["/tick 3"]);

    clients.tell(&json!({"do": "subscribe", "client": "a", "topic": "/tick"}));
    clients.settle("a");
    server.give("/tick", 5, vec![5; 20]);
    assert_eq!(topics(&clients.until("a", is_tick)), ["/tick 5"]);
    clients.tell(&json!({"do": "close", "client": "a"}));
    clients.next("a", &["close"]);
    server.give("/tick", 6, vec![6; 20]);
    assert_eq!(topics(&clients.until("b", is_tick)), ["/tick 5"]);
    assert_eq!(topics(&clients.until("b", is_tick)), ["/tick 6"]);
    server.end().expect("served");
}

#[test]
fn a_client_that_stops_reading_loses_messages_and_is_told_how_many() {
    const LENGTH: usize = 1 << 20;
    const COUNT: u64 = 60;
    let Some(mut clients) = Clients::start() else {
        return;
    };
    let server = Server::start(hello(), Some(4 * LENGTH));
    clients.join("slow", &server, &["/tick"]);
    clients.join("fast", &server, &["/tick"]);
    clients.tell(&json!({"do": "pause", "client": "slow"}));
    for number in 1..=COUNT {
        server.give("/tick", number, vec![7; LENGTH]);
        // The other client receives every message meanwhile.
        let event = clients.next("fast", &["message", "status"]);
        assert_eq!(event["time"], number.to_string());
    }
    clients.tell(&json!({"do": "resume", "client": "slow"}));
    let last = COUNT.to_string();
    let events = clients.until("slow", |event| {
        event["event"] == "message" && event["time"] == last
    });
    let received: Vec<u64> = messages(&events).iter().map(|(_, time, _)| *time).collect();
    assert!(received.is_sorted());
    assert!(
        received.contains(&(COUNT - 1)),
        "the newest are kept: {received:?}"
    );
    let reports = of_kind(&events, "status");
    let report = reports.last().expect("a status")["message"].as_str();
    let dropped: u64 = report
        .and_then(|text| text.split(' ').next()?.parse().ok())
        .expect("a number");
    assert_eq!(received.len() as u64 + dropped, COUNT, "{report:?}");
    assert!(dropped > 0);
    server.end().expect("served");
}

#[test]
fn what_the_server_does_not_offer_is_answered_and_harms_nobody() {
    let Some(mut clients) = Clients::start() else {
        return;
    };
    let server = Server::start(hello(), None);
    clients.join("a", &server, &["/tick"]);
    clients.tell(&json!({"do": "everything", "client": "a"}));
    clients.tell(&json!({"do": "text", "client": "a", "text": "{\"op\":"}));
    clients.tell(&json!({"do": "binary", "client": "a", "hex": ""}));
    clients.tell(&json!({"do": "binary", "client": "a", "hex": "ff00ff"}));
    let events = clients.settle("a");
    // Nine of the package, three of garbage, and the last.
    assert_eq!(of_kind(&events, "status").len(), 13, "{events:?}");
    assert_eq!(events.len(), 13);
    server.give("/tick", 1, vec![1; 20]);
    assert_eq!(clients.next("a", &["message"])["time"], "1");

    let long = "x".repeat(100_000);
    clients.tell(&json!({"do": "text", "client": "a", "text": long}));
    assert_eq!(clients.next("a", &["close"])["code"], 1009);

    // A newer client offers the protocol under its second name only.
    let connect = json!({"do": "connect", "client": "new", "url": server.address,
        "protocols": ["foxglove.sdk.v1"]});
    clients.tell(&connect);
    assert_eq!(
        clients.next("new", &["open", "error"])["protocol"],
        "foxglove.sdk.v1"
    );
    clients.next("new", &["advertise"]);
    server.end().expect("served");
}
