//! Passes the messages of a feed to all clients.

use super::protocol::{Channel, Level, advertise, server_info, status, unadvertise};
use super::queue::Queue;
use crate::door::Client;
use host::live::{Frame, Hello, ObstacleState, ToolState, Vertices};
use host::record::{BodyFrame, ChannelInfo, Cloud, Group, Kind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The clients, and what a client that joins is told.
#[derive(Default)]
pub(super) struct Hub {
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    clients: Vec<Arc<Client<Queue>>>,
    channels: Arc<[Channel]>,
    /// The first texts to a client: the server, and its channels.
    greeting: [String; 2],
    hello: Option<Hello>,
    /// The number of the next channel.
    next: u32,
    /// The time of the source (ns).
    clock_ns: u64,
    /// Messages that the run left out.
    missing: u64,
    /// The number of missing messages that the clients know of.
    reported: u64,
}

impl State {
    /// Sends a message on the channel of this name. The message is made only if a client wants it.
    fn send(&self, topic: &str, time_ns: u64, message: impl FnOnce() -> Vec<u8>) {
        let Some(channel) = self.channel(topic) else {
            return;
        };
        let wants = |client: &Arc<Client<Queue>>| {
            client.with(|queue| queue.wants(channel.id)) == Some(true)
        };
        if self.clients.iter().any(wants) {
            let data: Arc<[u8]> = message().into();
            for client in &self.clients {
                client.with(|queue| queue.deliver(channel.id, time_ns, self.clock_ns, &data));
            }
        }
    }

    /// Gives a client the channels in place of its former ones, and tells it the texts.
    fn replace_channels(&self, client: &Client<Queue>, texts: &[&str]) {
        client.with(|queue| queue.replace_channels(&self.channels));
        for text in texts {
            client.tell(*text);
        }
    }

    fn channel(&self, topic: &str) -> Option<&Channel> {
        self.channels.iter().find(|channel| channel.topic == topic)
    }

    /// Sends where the vertices of an obstacle are.
    fn send_obstacle(&self, index: usize, placed: &ObstacleState, time_ns: u64) {
        let hello = self.hello.as_ref();
        let Some(info) = hello.and_then(|hello| hello.obstacles.get(index)) else {
            return;
        };
        self.send(&obstacle_topic(&info.name), time_ns, || {
            Cloud::message_of(time_ns, info.placed(placed).as_flattened())
        });
    }

    /// Sends where the device of a tool would lead the vertices of the tool, and the points of the surface that the tool may touch.
    fn send_tool(&self, tool: &ToolState, time_ns: u64) {
        let hello = self.hello.as_ref();
        let info = hello.and_then(|hello| {
            let obstacle = hello.obstacle_of(tool.device)?;
            hello.obstacles.get(obstacle)
        });
        let Some(info) = info else {
            return;
        };
        let [led, sites] = tool_topics(&info.name);
        self.send(&led, time_ns, || {
            let state = ObstacleState {
                pose: tool.led,
                ..ObstacleState::default()
            };
            Cloud::message_of(time_ns, info.placed(&state).as_flattened())
        });
        self.send(&sites, time_ns, || {
            Cloud::message_of(time_ns, tool.sites.as_flattened())
        });
    }

    /// Sends a deformed body as the log has it.
    fn send_body(&self, index: usize, vertices: &Vertices) {
        let body = self
            .hello
            .as_ref()
            .and_then(|hello| hello.bodies.get(index));
        let Some(name) = body.map(|body| body.name.as_str()) else {
            return;
        };
        let time_ns = vertices.time_ns;
        let frame = BodyFrame {
            body: index as u32,
            step: vertices.step,
            time_ns,
            epoch: vertices.epoch,
        };
        self.send(&BodyFrame::topic(name), time_ns, || frame.message());
        self.send(&Cloud::topic(name), time_ns, || {
            Cloud::message_of(time_ns, &vertices.positions)
        });
    }
}

/// The channel of an obstacle.
fn obstacle_topic(name: &str) -> String {
    format!("/obstacles/{name}")
}

/// The channels of a tool: where its device would lead it, and the points that it may touch.
fn tool_topics(name: &str) -> [String; 2] {
    ["led", "sites"].map(|part| format!("/tools/{name}/{part}"))
}

impl Hub {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a client and greets it.
    pub(super) fn join(&self, client: &Arc<Client<Queue>>) {
        let mut state = self.lock();
        let [server, channels] = &state.greeting;
        state.replace_channels(client, &[server, channels]);
        state.clients.push(Arc::clone(client));
    }

    /// Removes a client.
    pub(super) fn leave(&self, client: &Client<Queue>) {
        let mut state = self.lock();
        state.clients.retain(|other| other.number != client.number);
    }

    /// Takes the facts of a source. The channels of an earlier source end. `server` identifies this server to clients
    /// that connect again; a run identifies itself.
    pub(super) fn begin(&self, hello: Hello, server: &str) {
        let mut state = self.lock();
        if state.hello.as_ref() == Some(&hello) {
            return;
        }
        let gone: Vec<u32> = state.channels.iter().map(|channel| channel.id).collect();
        let first = state.next + 1;
        state.channels = channels(&hello, first).into();
        state.next += state.channels.len() as u32;
        let session = match hello.run {
            0 => server.to_owned(),
            run => format!("{run:x}"),
        };
        state.greeting = [server_info(&hello, &session), advertise(&state.channels)];
        state.hello = Some(hello);
        state.clock_ns = 0;
        let [server, channels] = &state.greeting;
        for client in &state.clients {
            let texts = [server.as_str(), &unadvertise(&gone), channels];
            state.replace_channels(client, &texts);
        }
    }

    /// Sends the messages of a frame.
    ///
    /// The time that clients are told never precedes the time of a message before, because a client takes a step back
    /// of the time for a jump in a log, and forgets what it has. A model has the time of its reference, before the
    /// ticks around it. Only a frame that precedes the frame before is a jump.
    pub(super) fn publish(&self, frame: Frame) {
        let mut state = self.lock();
        if frame.time_ns < state.clock_ns {
            let times = frame.log.iter().map(|message| message.time_ns);
            state.clock_ns = times.min().unwrap_or(frame.time_ns).min(frame.time_ns);
        }
        for message in frame.log {
            if state.channel(&message.topic).is_some() {
                state.clock_ns = message.time_ns.min(frame.time_ns).max(state.clock_ns);
                state.send(&message.topic, message.time_ns, || message.data);
            }
        }
        for (index, body) in frame.bodies.iter().enumerate() {
            if let Some(vertices) = &body.vertices {
                state.send_body(index, vertices);
            }
        }
        for (index, placed) in frame.obstacles.iter().enumerate() {
            state.send_obstacle(index, placed, frame.time_ns);
        }
        for tool in &frame.tools {
            state.send_tool(tool, frame.time_ns);
        }
        state.clock_ns = frame.time_ns;
        let clock_ns = state.clock_ns;
        let clients = state.clients.iter();
        clients.for_each(|client| {
            client.with(|queue| queue.push_time(clock_ns));
        });

        state.missing += frame.more_log;
        if state.missing > 0 && state.missing >= 2 * state.reported {
            state.reported = state.missing;
            let text = format!(
                "{} messages of the run did not reach the viewer so far, because the viewer was too slow",
                state.missing
            );
            drop(state);
            self.say(Level::Warning, &text);
        }
    }

    /// Tells all clients something that a person should read.
    pub(super) fn say(&self, level: Level, text: &str) {
        let text = status(level, text);
        for client in &self.lock().clients {
            client.tell(text.as_str());
        }
    }
}

/// The channels of a source: those of the log, without the surfaces, which only this project's programs can show, and a
/// cloud of each obstacle, which a log has in its scene, and two of each tool. The numbers of the channels begin with `first`.
fn channels(hello: &Hello, first: u32) -> Vec<Channel> {
    let bodies = hello.bodies.iter();
    let frames =
        bodies.flat_map(|body| [Cloud::channel(&body.name), BodyFrame::channel(&body.name)]);
    let contacts = hello.touches.then(|| Group::Contacts.channels(""));
    let patches = (!hello.tools.is_empty()).then(|| Group::Tools.channels(""));
    let obstacles = (hello.obstacles.iter()).map(|obstacle| obstacle_topic(&obstacle.name));
    let tools = hello.tools.iter().filter_map(|tool| {
        let info = hello.obstacles.get(tool.obstacle as usize)?;
        Some(tool_topics(&info.name))
    });
    let clouds = obstacles.chain(tools.flatten());
    let clouds = clouds.map(|topic| ChannelInfo {
        topic,
        ..Cloud::channel("")
    });
    let all = Group::Run.channels("").chain(frames);
    let all = all.chain(contacts.into_iter().flatten());
    let all = all.chain(patches.into_iter().flatten()).chain(clouds);
    let channel = |(id, info): (u32, ChannelInfo)| Channel {
        id,
        topic: info.topic,
        encoding: info.encoding,
        schema_name: info.schema_name,
        schema: info.schema_text,
        schema_encoding: info.schema_encoding,
    };
    (first..).zip(all).map(channel).collect()
}
