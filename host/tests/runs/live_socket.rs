//! A run that viewers watch over its Unix socket: what they receive, and that the run does not depend on them.

use host::live::message::LONGEST;
use host::live::socket::SocketError;
use host::live::{Frame, Hello, Message, Vertices};
use host::record::Surface;
use host::run::observer::{Observed, Observer, Observers};
use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::run::summary::RunSummary;
use host::run::view::ViewOptions;
use host::run::{Clock, RunError, RunOptions, run, run_watched};
use host::scene::Scene;
use host::world::World;
use runner::link::LogRecord;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{JoinHandle, spawn};

/// The force of a hand by tick.
type Forces = Vec<(u64, f64)>;

type Outcome = Result<(), Box<dyn Error>>;

/// Ticks of a run of the tests.
const TICKS: u64 = 1000;

/// Holds a run at given ticks until the test lets it go on, and keeps the largest force of the first hand.
struct Gate {
    ticks: Vec<u64>,
    reached: Sender<u64>,
    go_on: Receiver<()>,
    forces: Sender<(u64, f64)>,
}

impl Observer for Gate {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            if self.ticks.contains(&telemetry.tick) {
                // A test that has failed neither listens nor lets the run go on.
                let _ = self.reached.send(telemetry.tick);
                let _ = self.go_on.recv();
            }
            let force = telemetry
                .devices()
                .next()
                .map(|device| device.wrench.force.norm());
            let _ = self.forces.send((telemetry.tick, force.unwrap_or(0.0)));
        }
    }

    fn finish(self: Box<Self>, _: &mut Observed) {}
}

/// A run of the built-in scene on a thread of its own.
struct Running {
    reached: Receiver<u64>,
    go_on: Sender<()>,
    forces: Receiver<(u64, f64)>,
    thread: JoinHandle<Result<RunSummary, RunError>>,
}

impl Running {
    /// A run under virtual time at `pace` that stops at `ticks`, with its socket at `socket`.
    fn begin(socket: &Path, pace: f64, ticks: &[u64]) -> Self {
        let (reached, at) = channel();
        let (go_on, wait) = channel();
        let (forces, seen) = channel();
        let gate = Gate {
            ticks: ticks.to_vec(),
            reached,
            go_on: wait,
            forces,
        };
        let options = options(Some(socket), pace);
        let thread = spawn(move || {
            let loaded = Scene::embedded_default()?;
            run_watched(
                &World::new(&loaded).unwrap(),
                &options,
                Observers::new().with(gate),
                &mut |_| (),
            )
        });
        Self {
            reached: at,
            go_on,
            forces: seen,
            thread,
        }
    }

    /// Waits until the run stops at `tick`.
    fn wait_for(&self, tick: u64) -> Outcome {
        assert_eq!(self.reached.recv()?, tick);
        Ok(())
    }

    fn go_on(&self) -> Outcome {
        Ok(self.go_on.send(())?)
    }

    /// Waits for the end. The summary, and the force of the first hand by tick.
    fn end(self) -> Result<(RunSummary, Forces), Box<dyn Error>> {
        let summary = self.thread.join().map_err(|_| "the run panicked")??;
        Ok((summary, self.forces.try_iter().collect()))
    }
}

fn options(socket: Option<&Path>, pace: f64) -> RunOptions {
    RunOptions {
        duration: Some(TICKS as f64 / 1000.0),
        view: socket.map(|socket| ViewOptions {
            socket: Some(socket.to_owned()),
            pace,
        }),
        ..RunOptions::new(Clock::Virtual)
    }
}

/// The next message of a stream; `None` at its end.
fn read(stream: &mut UnixStream) -> Result<Option<Message>, Box<dyn Error>> {
    let mut length = [0; 4];
    match stream.read_exact(&mut length) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        other => other?,
    }
    let length = u32::from_le_bytes(length) as usize;
    assert!(length <= LONGEST);
    let mut bytes = vec![0; length];
    stream.read_exact(&mut bytes)?;
    Ok(Some(Message::decode(&bytes)?))
}

/// All that a viewer receives.
#[derive(Default)]
struct Received {
    hello: Option<Hello>,
    surfaces: Vec<Surface>,
    frames: Vec<Frame>,
    end: Option<String>,
}

fn read_all(stream: &mut UnixStream) -> Result<Received, Box<dyn Error>> {
    let mut all = Received::default();
    while let Some(message) = read(stream)? {
        assert!(all.end.is_none(), "the end is the last message");
        match message {
            Message::Hello(hello) => {
                assert!(all.hello.is_none() && all.surfaces.is_empty());
                all.hello = Some(*hello);
            }
            Message::Surface(surface) => all.surfaces.push(surface),
            Message::Frame(frame) => all.frames.push(*frame),
            Message::End(summary) => all.end = Some(summary),
            other => return Err(format!("an unexpected message: {other:?}").into()),
        }
    }
    Ok(all)
}

fn bits(vertices: &Vertices) -> Vec<u32> {
    vertices.positions.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn a_viewer_that_comes_late_receives_everything_and_vertices_are_those_of_their_step() -> Outcome {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let running = Running::begin(&socket, 2.0, &[300]);
    running.wait_for(300)?;
    assert_eq!(socket.metadata()?.mode() & 0o777, 0o660);
    let mut viewer = UnixStream::connect(&socket)?;
    assert!(matches!(read(&mut viewer)?, Some(Message::Hello(_))));
    let mut second = UnixStream::connect(&socket)?;
    running.go_on()?;
    let all = read_all(&mut viewer)?;
    let other = read_all(&mut second)?;
    let (summary, forces) = running.end()?;
    assert!(!socket.exists());

    let hello = other.hello.as_ref().ok_or("a hello")?;
    assert_eq!((hello.clock.as_str(), hello.bodies.len()), ("virtual", 1));
    assert_eq!(hello.duration, 1.0);
    let vertices = hello.bodies[0].vertices;
    for all in [&all.surfaces, &other.surfaces] {
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].vertices, vertices);
        assert!(all[0].triangle_count > 0);
    }

    // The positions after each step of an equal run that nobody watches.
    let mut expected: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
    let prepared = Prepared::new(
        &World::new(&Scene::embedded_default()?).unwrap(),
        &Options::new(1.0, 1),
    )?;
    let mut session = Session::of(prepared);
    while session.tick().is_some() {
        let engine = session.engine().expect("the host does not panic");
        let positions = engine.bodies()[0].body().positions();
        let rounded = positions.flat_map(|x| [x.x, x.y, x.z].map(|x| (x as f32).to_bits()));
        expected
            .entry(engine.stats().steps)
            .or_insert_with(|| rounded.collect());
    }

    for received in [&all, &other] {
        let mut steps = Vec::new();
        let first = received.frames.first().ok_or("a frame")?;
        assert!(
            first.bodies[0].vertices.is_some(),
            "the first has all vertices"
        );
        for frame in &received.frames {
            for vertices in frame
                .bodies
                .iter()
                .filter_map(|body| body.vertices.as_ref())
            {
                assert_eq!(
                    bits(vertices),
                    expected[&vertices.step],
                    "{}",
                    vertices.step
                );
                assert_eq!(vertices.time_ns, vertices.step * 4_000_000);
                assert_eq!(vertices.epoch, received.surfaces[0].epoch);
                steps.push(vertices.step);
            }
        }
        // A second at twice the pace has thirty frames, of which a busy machine may leave some out.
        assert!(steps.len() > 3, "{steps:?}");
        assert!(steps.is_sorted());

        let last = received.frames.last().ok_or("a frame")?;
        assert!(last.last && received.frames.iter().filter(|frame| frame.last).count() == 1);
        assert_eq!(steps.last(), Some(&249), "the last step of the run");
        let json: serde_json::Value = serde_json::from_str(received.end.as_ref().ok_or("an end")?)?;
        assert_eq!(json, serde_json::to_value(&summary)?);
        let tick = &json["tick"];
        assert_eq!(last.totals.ticks, TICKS);
        assert_eq!(Some(last.totals.ticks), tick["count"].as_u64());
        assert_eq!(Some(last.totals.missed), tick["missed_deadlines"].as_u64());
        assert_eq!(
            serde_json::to_value(&last.totals.model_age)?,
            tick["model_age"]
        );
        for (hand, device) in last.hands.iter().zip(&summary.devices) {
            assert_eq!(hand.peak_force, device.peak_force);
            assert_eq!((hand.work, hand.reach), (device.work, device.reach));
        }
        let host = last.host.as_ref().ok_or("the host's counts")?;
        assert_eq!(host.steps, summary.host.steps);
        assert_eq!(host.publications, summary.host.publications);
    }
    assert_eq!(forces.len() as u64, TICKS);
    Ok(())
}

#[test]
fn a_slow_viewer_loses_frames_but_no_tick_and_no_spike() -> Outcome {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let running = Running::begin(&socket, 1.0, &[0, TICKS - 1]);
    running.wait_for(0)?;
    let mut viewer = UnixStream::connect(&socket)?;
    assert!(matches!(read(&mut viewer)?, Some(Message::Hello(_))));
    running.go_on()?;
    // The viewer takes nothing until the last tick. The frames of a second do not fit in the buffer of a socket.
    running.wait_for(TICKS - 1)?;
    running.go_on()?;
    let received = read_all(&mut viewer)?;
    let (_, forces) = running.end()?;

    let frames = &received.frames;
    let (first, last) = (&frames[0], frames.last().ok_or("a frame")?);
    assert!(
        last.dropped > 0,
        "{} frames, {}",
        frames.len(),
        last.dropped
    );
    let made = last.number - first.number + 1;
    let before = first.dropped;
    assert_eq!(frames.len() as u64 + last.dropped - before, made);
    assert!(frames.is_sorted_by_key(|frame| frame.dropped));
    // The last frame may have no tick of its own.
    let folded: Vec<_> = (frames.iter().map(|frame| &frame.folded))
        .filter(|folded| folded.ticks > 0)
        .collect();
    for pair in folded.windows(2) {
        assert_eq!(pair[0].last + 1, pair[1].first);
    }
    assert_eq!(folded.last().map(|folded| folded.last), Some(TICKS - 1));
    for folded in folded {
        assert_eq!(folded.ticks, folded.last - folded.first + 1);
        let within = forces
            .iter()
            .filter(|(tick, _)| (folded.first..=folded.last).contains(tick));
        let most = within.map(|(_, force)| *force).fold(0.0, f64::max);
        assert_eq!(folded.hands[0].force_norm.most, most);
    }
    let spike = forces.iter().map(|(_, force)| *force).fold(0.0, f64::max);
    // A frame without a tick has no hands.
    let hands = frames.iter().filter_map(|frame| frame.folded.hands.first());
    let seen = hands.map(|hand| hand.force_norm.most);
    assert_eq!(seen.fold(0.0, f64::max), spike);
    Ok(())
}

#[test]
fn a_run_has_the_same_log_whatever_its_viewers_do() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let plain = RunOptions {
        log: Some(at("plain.mcap")),
        ..options(None, 0.0)
    };
    run(&World::new(&loaded).unwrap(), &plain, &mut |_| ())?;

    let socket = at("run.sock");
    let (reached, at_tick) = channel();
    let (go_on, wait) = channel();
    let (forces, _seen) = channel();
    let gate = Gate {
        ticks: vec![100, 400],
        reached,
        go_on: wait,
        forces,
    };
    let watched = RunOptions {
        log: Some(at("watched.mcap")),
        ..options(Some(&socket), 3.0)
    };
    let thread = spawn(move || {
        let loaded = Scene::embedded_default()?;
        run_watched(
            &World::new(&loaded).unwrap(),
            &watched,
            Observers::new().with(gate),
            &mut |_| (),
        )
    });
    at_tick.recv()?;
    let mut reads = UnixStream::connect(&socket)?;
    let mut stopped = UnixStream::connect(&socket)?;
    let mut killed = UnixStream::connect(&socket)?;
    let mut shouts = UnixStream::connect(&socket)?;
    for stream in [&mut reads, &mut stopped, &mut killed, &mut shouts] {
        assert!(matches!(read(stream)?, Some(Message::Hello(_))));
    }
    // Nothing that a viewer sends is read: the pipe is closed.
    let sent = shouts.write(b"GET / HTTP/1.1\r\n\r\n");
    assert_eq!(
        sent.map_err(|error| error.kind()),
        Err(io::ErrorKind::BrokenPipe)
    );
    go_on.send(())?;
    let reader = spawn(move || read_all(&mut reads).map_err(|error| error.to_string()));
    at_tick.recv()?;
    drop(killed);
    go_on.send(())?;
    let summary = thread.join().map_err(|_| "the run panicked")??;
    assert!(summary.failures.is_empty() && summary.degradations.is_empty());
    let received = reader.join().map_err(|_| "the reader panicked")??;
    assert!(received.end.is_some());
    drop(stopped);
    assert!(fs::read(at("plain.mcap"))? == fs::read(at("watched.mcap"))?);

    // The frames have the messages of the log.
    let messages = |topic: &str| {
        let frames = received.frames.iter();
        let messages = frames.flat_map(|frame| &frame.log);
        messages.filter(|message| message.topic == topic).count()
    };
    let omitted: u64 = received.frames.iter().map(|frame| frame.more_log).sum();
    assert!(
        messages("/tick") > 500 && messages("/model") > 100,
        "{omitted}"
    );
    Ok(())
}

#[test]
fn eight_of_a_hundred_viewers_are_served_and_the_others_told_why_not() -> Outcome {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let running = Running::begin(&socket, 0.0, &[100]);
    running.wait_for(100)?;
    let mut viewers = Vec::new();
    for _ in 0..100 {
        viewers.push(UnixStream::connect(&socket)?);
    }
    let (mut served, mut refused) = (0, 0);
    for (number, viewer) in viewers.iter_mut().enumerate() {
        match read(viewer)? {
            Some(Message::Hello(_)) => served += 1,
            Some(Message::Refused(why)) => {
                refused += 1;
                let expected =
                    "8 viewers watch this run already, and a run has no more; close one of them";
                assert_eq!(why, expected);
                assert!(
                    read(viewer)?.is_none(),
                    "viewer {number} hears nothing more"
                );
            }
            other => return Err(format!("viewer {number}: {other:?}").into()),
        }
    }
    assert_eq!((served, refused), (8, 92));
    // A place that becomes free is given again, as soon as the server has seen that the viewer left.
    viewers.remove(0);
    loop {
        let mut next = UnixStream::connect(&socket)?;
        if let Some(Message::Hello(_)) = read(&mut next)? {
            break;
        }
    }
    drop(viewers);
    running.go_on()?;
    running.end()?;
    Ok(())
}

#[test]
fn a_run_takes_no_socket_of_another_run_and_no_file() -> Outcome {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let running = Running::begin(&socket, 0.0, &[10]);
    running.wait_for(10)?;
    let loaded = Scene::embedded_default()?;
    let second = run(
        &World::new(&loaded).unwrap(),
        &options(Some(&socket), 0.0),
        &mut |_| (),
    );
    let Err(RunError::View(error @ SocketError::Live { .. })) = second else {
        return Err(format!("{second:?}").into());
    };
    assert_eq!(
        error.to_string(),
        format!(
            "the socket {} belongs to another run that goes on; give this run another path with --view=SOCKET",
            socket.display()
        )
    );
    running.go_on()?;
    running.end()?;

    let file = folder.path().join("file");
    fs::write(&file, "text")?;
    let refused = run(
        &World::new(&loaded).unwrap(),
        &options(Some(&file), 0.0),
        &mut |_| (),
    );
    assert!(matches!(
        refused,
        Err(RunError::View(SocketError::NoSocket { .. }))
    ));
    let missing = folder.path().join("missing/run.sock");
    let refused = run(
        &World::new(&loaded).unwrap(),
        &options(Some(&missing), 0.0),
        &mut |_| (),
    );
    assert!(matches!(
        refused,
        Err(RunError::View(SocketError::Bind { .. }))
    ));

    // The socket of a process that was killed is replaced.
    drop(std::os::unix::net::UnixListener::bind(&socket)?);
    fs::set_permissions(&socket, fs::Permissions::from_mode(0o600))?;
    run(
        &World::new(&loaded).unwrap(),
        &options(Some(&socket), 0.0),
        &mut |_| (),
    )?;
    assert!(!socket.exists());
    Ok(())
}
