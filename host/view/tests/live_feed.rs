//! The feed from a run: what it gives, what it keeps, and why it ends.

use host::live::socket::{Listener, Server, Update};
use host::live::{
    BodyState, Folded, Frame, Hello, Message, MessageError, Vertices, frame::PROTOCOL,
};
use host::record::Surface;
use host::snapshot::Watchers;
use std::error::Error;
use std::io::Write;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::time::Duration;
use view::feed::{Feed, FeedError};
use view::live::{LiveError, LiveFeed, LiveOptions};

type Outcome = Result<(), Box<dyn Error>>;

/// Longer than any message takes.
const LONG: Duration = Duration::from_secs(30);

fn options(socket: &Path, wait: bool) -> LiveOptions {
    LiveOptions {
        socket: Some(socket.to_owned()),
        wait,
    }
}

fn hello(run: u64) -> Hello {
    Hello {
        protocol: PROTOCOL.into(),
        run,
        scene: "test".into(),
        ..Hello::default()
    }
}

fn vertices(step: u64) -> Vertices {
    Vertices {
        step,
        count: 3,
        positions: (0..9).map(|x| x as f32 + step as f32 / 8.0).collect(),
        ..Vertices::default()
    }
}

/// A frame of one tick of one body, with vertices or without.
fn frame(number: u64, vertices: Option<Vertices>) -> Update {
    let folded = Folded {
        first: number,
        last: number,
        from_ns: number,
        to_ns: number,
        ticks: 1,
        ..Folded::default()
    };
    let body = BodyState {
        vertices,
        ..BodyState::default()
    };
    Update::Frame(
        Vec::new(),
        Box::new(Frame {
            number,
            folded,
            bodies: vec![body],
            ..Frame::default()
        }),
    )
}

fn surface() -> Surface {
    Surface {
        vertices: 3,
        triangle_count: 1,
        rest: vec![0.0; 9],
        triangles: vec![0, 1, 2],
        ..Surface::default()
    }
}

/// A run that serves viewers at `socket`.
fn serve(socket: &Path, run: u64) -> Result<Server, Box<dyn Error>> {
    let listener = Listener::bind(Some(socket))?;
    let (surfaces, start) = (vec![surface()], vec![vertices(0)]);
    let watchers = Watchers::default();
    Ok(Server::start(
        listener,
        hello(run),
        surfaces,
        start,
        watchers,
    )?)
}

/// The next message, which comes.
fn next(feed: &mut LiveFeed) -> Result<Message, Box<dyn Error>> {
    Ok(feed.next(LONG)?.ok_or("a message")?)
}

fn steps(frame: &Frame) -> Vec<Option<u64>> {
    let bodies = frame.bodies.iter();
    bodies
        .map(|body| body.vertices.as_ref().map(|vertices| vertices.step))
        .collect()
}

#[test]
fn a_feed_gives_the_messages_of_a_run_and_keeps_its_present_state() -> Outcome {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let server = serve(&socket, 7)?;
    let mut feed = LiveFeed::open(&options(&socket, false))?;
    assert!(feed.present().is_empty());
    assert!(matches!(next(&mut feed)?, Message::Hello(hello) if hello.run == 7));
    assert_eq!(next(&mut feed)?, Message::Surface(surface()));
    assert!(feed.next(Duration::ZERO)?.is_none());

    // The first frame has all vertices: those at the start, until the host makes a step.
    for (number, moved, expected) in [(0, None, Some(0)), (1, Some(5), Some(5)), (2, None, None)] {
        let sent = server.sender().try_send(frame(number, moved.map(vertices)));
        assert!(sent.is_none());
        let Message::Frame(frame) = next(&mut feed)? else {
            return Err("a frame".into());
        };
        assert_eq!((frame.number, steps(&frame)), (number, vec![expected]));
    }
    // A display that joins now gets the vertices that are still valid.
    let present = feed.present();
    let kinds: Vec<_> = present.iter().map(Message::kind).collect();
    assert_eq!(kinds, [1, 2, 4, 3]);
    let (Message::History(pieces), Message::Frame(last)) = (&present[2], &present[3]) else {
        return Err("a history and a frame".into());
    };
    assert_eq!(pieces.len(), 3);
    assert_eq!((last.number, steps(last)), (2, vec![Some(5)]));

    server.finish(None, "{}".into());
    assert_eq!(next(&mut feed)?, Message::End("{}".into()));
    assert!(matches!(feed.next(LONG), Err(FeedError::Ended)));
    Ok(())
}

#[test]
fn a_feed_that_waits_shows_one_run_after_the_other() -> Outcome {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let mut feed = LiveFeed::open(&options(&socket, true))?;
    assert!(feed.next(Duration::ZERO)?.is_none());
    let first = serve(&socket, 1)?;
    assert!(matches!(next(&mut feed)?, Message::Hello(hello) if hello.run == 1));
    // The first run is killed.
    drop(first);
    let second = serve(&socket, 2)?;
    loop {
        match next(&mut feed)? {
            Message::Hello(hello) => {
                assert_eq!(hello.run, 2);
                break;
            }
            message => assert_eq!(message.kind(), 2, "the surface of the first run"),
        }
    }
    assert_eq!(feed.present().first().map(Message::kind), Some(1));
    second.finish(None, String::new());
    Ok(())
}

#[test]
fn a_run_that_breaks_off_or_refuses_is_named() -> Outcome {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let no_run = LiveFeed::open(&options(&socket, false));
    assert!(
        matches!(no_run, Err(LiveError::NoRunAt { .. })),
        "{no_run:?}"
    );
    drop(UnixListener::bind(&socket)?);
    let no_run = LiveFeed::open(&options(&socket, false));
    assert!(
        matches!(no_run, Err(LiveError::NoRunAt { .. })),
        "{no_run:?}"
    );
    std::fs::remove_file(&socket)?;

    let server = serve(&socket, 1)?;
    let mut feed = LiveFeed::open(&options(&socket, false))?;
    next(&mut feed)?;
    drop(server);
    let ended = loop {
        match feed.next(LONG) {
            Ok(_) => {}
            Err(error) => break error,
        }
    };
    assert!(matches!(ended, FeedError::Io(_)), "{ended:?}");
    Ok(())
}

/// What a feed gives of a run that sends `bytes` and closes the connection.
fn after(bytes: &[u8]) -> Result<FeedError, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let listener = UnixListener::bind(&socket)?;
    let mut feed = LiveFeed::open(&options(&socket, false))?;
    let (mut stream, _) = listener.accept()?;
    stream.write_all(bytes)?;
    drop(stream);
    match feed.next(LONG) {
        Err(error) => Ok(error),
        Ok(message) => Err(format!("{message:?}").into()),
    }
}

#[test]
fn bytes_that_are_no_message_are_refused() -> Outcome {
    let stream = |message: &Message| {
        let mut bytes = Vec::new();
        message.encode_in_stream(&mut bytes);
        bytes
    };
    let other = Hello {
        protocol: "palpate.view/999".into(),
        ..Hello::default()
    };
    let version = after(&stream(&Message::Hello(Box::new(other))))?;
    let FeedError::Message(MessageError::Version(found)) = &version else {
        return Err(version.into());
    };
    assert_eq!(found, "palpate.view/999");

    let refused = after(&stream(&Message::Refused("full".into())))?;
    assert!(matches!(&refused, FeedError::Refused(why) if why == "full"));

    let garbage = after(b"\x08\0\0\0garbage!")?;
    assert!(matches!(garbage, FeedError::Message(_)), "{garbage:?}");
    let long = after(&u32::MAX.to_le_bytes())?;
    assert!(matches!(long, FeedError::Message(_)), "{long:?}");
    // A length without its bytes takes no memory, and the end is the end of the connection.
    let cut = after(&(1_u32 << 28).to_le_bytes())?;
    assert!(matches!(cut, FeedError::Io(_)), "{cut:?}");
    Ok(())
}
