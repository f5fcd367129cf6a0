//! What the tests of the server share: a feed whose messages a test gives, a server on it, and the messages of a short
//! run.

#![allow(dead_code)] // Each test uses a part.

use host::live::frame::{LogMessage, PROTOCOL};
use host::live::{BodyInfo, Frame, Hello, Message};
use host::record::{Kind, ModelRow, TickRow};
use host::run::observer::{Observed, Observer, Observers};
use host::run::{Clock, RunOptions, run_watched};
use host::scene::Scene;
use host::world::World;
use runner::link::LogRecord;
use std::path::Path;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use view::feed::{Command, Feed, FeedError};
use view::foxglove::{FoxgloveError, Options, serve};

/// How long a test waits for what must come.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);
/// Ticks in a frame.
const TICKS: usize = 16;

/// A feed whose messages a test gives. It ends when the test drops the sender.
struct Given(Receiver<Message>);

impl Feed for Given {
    fn next(&mut self, wait: Duration) -> Result<Option<Message>, FeedError> {
        match self.0.recv_timeout(wait) {
            Ok(message) => Ok(Some(message)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Ok(Some(Message::End(String::new()))),
        }
    }

    fn command(&mut self, _command: &Command) {}

    fn present(&self) -> Vec<Message> {
        Vec::new()
    }
}

/// A server, and the end of its feed that gives the messages.
pub(crate) struct Server {
    pub(crate) feed: Sender<Message>,
    /// The address, with the token.
    pub(crate) address: String,
    /// The lines for the person who started the server.
    pub(crate) lines: Receiver<String>,
    thread: JoinHandle<Result<(), FoxgloveError>>,
}

impl Server {
    /// A server on a free port, to which the test gave `hello`.
    pub(crate) fn start(hello: Hello, queue_limit: Option<usize>) -> Self {
        let (feed, given) = mpsc::channel();
        let (say, lines) = mpsc::channel();
        let say = Mutex::new(say);
        let mut options = Options {
            port: 0,
            say: Arc::new(move |line| {
                // A test that is over reads no lines.
                let _ = say.lock().expect("a sender").send(line.to_owned());
            }),
            ..Options::default()
        };
        options.queue_limit = queue_limit.unwrap_or(options.queue_limit);
        feed.send(Message::Hello(Box::new(hello))).expect("a feed");
        let thread = thread::spawn(move || serve(Box::new(Given(given)), &options));
        let first = lines.recv_timeout(PATIENCE).expect("the address");
        let address = first.split(' ').next().expect("the address").to_owned();
        Self {
            feed,
            address,
            lines,
            thread,
        }
    }

    /// Gives a message of the log in a frame of its own.
    pub(crate) fn give(&self, topic: &str, time_ns: u64, data: Vec<u8>) {
        self.give_frame(Frame {
            time_ns,
            log: vec![LogMessage {
                topic: topic.to_owned(),
                time_ns,
                length: data.len() as u32,
                data,
            }],
            ..Frame::default()
        });
    }

    /// Gives a frame.
    pub(crate) fn give_frame(&self, frame: Frame) {
        self.feed
            .send(Message::Frame(Box::new(frame)))
            .expect("a feed");
    }

    /// Ends the source and returns the result of the server.
    pub(crate) fn end(self) -> Result<(), FoxgloveError> {
        drop(self.feed);
        self.thread.join().expect("the server does not panic")
    }
}

/// The facts of the run that the tests have.
pub(crate) fn hello() -> Hello {
    Hello {
        protocol: PROTOCOL.into(),
        run: 0xabc,
        scene: "stretch".into(),
        clock: "virtual".into(),
        scheme: "capped".into(),
        bodies: vec![BodyInfo {
            name: "sheet".into(),
            ..BodyInfo::default()
        }],
        ..Hello::default()
    }
}

/// Keeps the messages of a run.
struct Keep(Arc<Mutex<Vec<(bool, LogMessage)>>>);

impl Observer for Keep {
    fn take(&mut self, record: LogRecord<'_>) {
        let (topic, time_ns, data) = match record {
            LogRecord::Tick(tick) => ("/tick", tick.time_ns, TickRow::from(tick).message()),
            LogRecord::Model(body, model) => (
                "/model",
                model.head.time_ns,
                ModelRow::new(body, model).message(),
            ),
            LogRecord::Patch(..) => return,
        };
        let message = LogMessage {
            topic: topic.into(),
            time_ns,
            length: data.len() as u32,
            data,
        };
        let mut kept = self.0.lock().expect("no panic");
        kept.push((topic == "/tick", message));
    }

    fn finish(self: Box<Self>, _observed: &mut Observed) {}
}

/// Runs the built-in scene for `seconds` under virtual time with a log, and returns the frames of the run.
pub(crate) fn run_with_log(seconds: f64, log: &Path) -> Vec<Frame> {
    let kept = Arc::new(Mutex::new(Vec::new()));
    let mut options = RunOptions::new(Clock::Virtual);
    options.duration = Some(seconds);
    options.log = Some(log.to_owned());
    let observers = Observers::new().with(Keep(Arc::clone(&kept)));
    let scene = Scene::embedded_default().expect("the built-in scene");
    run_watched(
        &World::new(&scene).unwrap(),
        &options,
        observers,
        &mut |_| (),
    )
    .expect("a run");

    let mut frames = vec![Frame::default()];
    let mut ticks = 0;
    for (is_tick, message) in kept.lock().expect("no panic").drain(..) {
        if is_tick && ticks == TICKS {
            frames.push(Frame::default());
            ticks = 0;
        }
        let number = frames.len() as u64 - 1;
        let frame = frames.last_mut().expect("a frame");
        frame.number = number;
        if is_tick {
            ticks += 1;
            frame.time_ns = message.time_ns;
        }
        frame.log.push(message);
    }
    frames
}

/// A message of a log: topic, time and content.
pub(crate) type Logged = (String, u64, Vec<u8>);

/// The messages of a log, in the order of the file.
pub(crate) fn messages_of(log: &[u8]) -> Vec<Logged> {
    let stream = mcap::MessageStream::new(log).expect("a log");
    stream
        .map(|message| {
            let message = message.expect("a message");
            let topic = message.channel.topic.clone();
            (topic, message.log_time, message.data.into_owned())
        })
        .collect()
}
