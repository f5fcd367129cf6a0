//! Passes the messages of a feed to all clients.

use super::client::Client;
use super::protocol::{Channel, Level, advertise, server_info, status, unadvertise};
use host::live::{Frame, Hello};
use host::log::{BodyFrame, ChannelInfo, cloud_message, frame_message};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Most clients at a time.
pub(super) const MOST_CLIENTS: usize = 4;

/// How long the server waits for the leave of clients that have received everything.
const LEAVE: Duration = Duration::from_millis(300);

/// The clients, and what a client that joins is told.
#[derive(Default)]
pub(super) struct Hub {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    clients: Vec<Arc<Client>>,
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
    /// The number of missing messages of which the clients know.
    reported: u64,
    closed: bool,
}

impl Hub {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a client and greets it. Returns false if there are enough clients.
    pub(super) fn join(&self, client: &Arc<Client>) -> bool {
        let mut state = self.lock();
        if state.closed || state.clients.len() >= MOST_CLIENTS {
            return false;
        }
        let [server, channels] = &state.greeting;
        client.replace_channels(&state.channels, &[server, channels]);
        state.clients.push(Arc::clone(client));
        true
    }

    /// Removes a client.
    pub(super) fn leave(&self, client: &Arc<Client>) {
        let mut state = self.lock();
        state.clients.retain(|other| !Arc::ptr_eq(other, client));
        self.changed.notify_all();
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
            client.replace_channels(&state.channels, &texts);
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
            let Some(channel) = state.channels.iter().find(|c| c.topic == message.topic) else {
                continue;
            };
            let channel = channel.id;
            state.clock_ns = message.time_ns.min(frame.time_ns).max(state.clock_ns);
            if !state.clients.iter().any(|client| client.wants(channel)) {
                continue;
            }
            let data: Arc<[u8]> = message.data.into();
            for client in &state.clients {
                client.deliver(channel, message.time_ns, state.clock_ns, &data);
            }
        }
        state.clock_ns = frame.time_ns;
        let clock_ns = state.clock_ns;
        let clients = state.clients.iter();
        clients.for_each(|client| client.tell_time(clock_ns));

        state.missing += frame.more_log;
        if state.missing > 0 && state.missing >= 2 * state.reported {
            state.reported = state.missing;
            let text = format!(
                "{} messages of the run did not reach the viewer so far, because the viewer was too slow",
                state.missing
            );
            let text = status(Level::Warning, &text);
            state
                .clients
                .iter()
                .for_each(|client| client.tell(&[&text]));
        }
    }

    /// Sends all clients away when they have what waits for them, or after `wait`. No further client is admitted.
    pub(super) fn end(&self, level: Level, reason: &str, wait: Duration) {
        let mut state = self.lock();
        state.closed = true;
        let clients = state.clients.clone();
        drop(state);
        let until = Instant::now() + wait;
        for client in &clients {
            client.tell(&[&status(level, reason)]);
            client.end(1001, "the source has ended");
        }
        for client in &clients {
            client.wait_until_written(until);
        }
        // A client that reads takes its leave.
        let until = Instant::now() + LEAVE;
        state = self.lock();
        while !state.clients.is_empty() {
            let Some(left) = until.checked_duration_since(Instant::now()) else {
                break;
            };
            let waited = self.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state.clients.iter().for_each(|client| client.cut());
    }
}

/// The channels of a source: those of the log, without the surfaces, which only this project's programs can show. The
/// numbers of the channels begin with `first`.
fn channels(hello: &Hello, first: u32) -> Vec<Channel> {
    let bodies = hello.bodies.iter();
    let frames = bodies.flat_map(|body| {
        let [cloud, frame, _] = host::log::body_channels(&body.name);
        [cloud, frame]
    });
    let all = host::log::channels().into_iter().chain(frames);
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

/// The messages of the log for the deformed bodies of a frame, where the frame has them. Each body has two channels after
/// the first two.
fn body_messages(frame: &Frame) -> impl Iterator<Item = (usize, u64, Vec<u8>)> {
    let bodies = frame.bodies.iter().enumerate();
    let deformed = bodies.filter_map(|(index, body)| Some((index, body.vertices.as_ref()?)));
    deformed.flat_map(|(index, vertices)| {
        let time_ns = vertices.time_ns;
        let facts = BodyFrame {
            body: index as u32,
            step: vertices.step,
            time_ns,
            epoch: vertices.epoch,
        };
        let place = 2 + 2 * index;
        [
            (place, time_ns, cloud_message(time_ns, &vertices.positions)),
            (place + 1, time_ns, frame_message(&facts)),
        ]
    })
}
