use super::super::frame::{BodyState, Vertices};
use super::*;

fn frame() -> Frame {
    Frame {
        number: 3,
        time_ns: 5_000_000,
        bodies: vec![BodyState {
            state: "live".into(),
            vertices: Some(Vertices {
                step: 2,
                count: 2,
                stressed: true,
                positions: vec![0.0, 1.5, -2.0, 3.25, 0.1, 1e-30],
                stress: vec![7.0, 8.0],
                ..Vertices::default()
            }),
            ..BodyState::default()
        }],
        log: vec![LogMessage {
            topic: "/tick".into(),
            time_ns: 4,
            length: 3,
            data: vec![1, 2, 3],
        }],
        ..Frame::default()
    }
}

fn all() -> Vec<Message> {
    let hello = Hello {
        protocol: PROTOCOL.into(),
        scene: "stretch".into(),
        files: BTreeMap::from([("a.msh".to_owned(), vec![9; 5]), ("b".to_owned(), vec![])]),
        ..Hello::default()
    };
    let surface = Surface {
        vertices: 3,
        triangle_count: 1,
        line_count: 1,
        rest: vec![0.5; 9],
        triangles: vec![0, 2, 1],
        lines: vec![1, 2],
        ..Surface::default()
    };
    vec![
        Message::Hello(Box::new(hello)),
        Message::Surface(surface),
        Message::Frame(Box::new(frame())),
        Message::History(vec![Folded::default(); 2]),
        Message::Playback(Box::default()),
        Message::End("{}".into()),
        Message::Refused("no".into()),
    ]
}

#[test]
fn a_message_is_read_as_it_was_written() {
    for message in all() {
        let mut bytes = Vec::new();
        message.encode(&mut bytes);
        assert_eq!(Message::decode(&bytes).unwrap(), message);
    }
}

#[test]
fn a_message_that_is_cut_anywhere_is_refused() {
    for message in all() {
        let mut bytes = Vec::new();
        message.encode(&mut bytes);
        for length in 0..bytes.len() {
            assert!(
                Message::decode(&bytes[..length]).is_err(),
                "{length} of {message:?}"
            );
        }
        bytes.push(0);
        assert!(matches!(
            Message::decode(&bytes),
            Err(MessageError::Long(1))
        ));
    }
}

#[test]
fn a_triangle_of_no_vertex_is_refused() {
    let surface = Surface {
        vertices: 3,
        triangle_count: 1,
        rest: vec![0.0; 9],
        triangles: vec![0, 1, 3],
        ..Surface::default()
    };
    let mut bytes = Vec::new();
    Message::Surface(surface).encode(&mut bytes);
    let refused = Message::decode(&bytes);
    assert!(matches!(refused, Err(MessageError::Contradiction(_))));
}

#[test]
fn a_stream_of_another_version_is_named_even_if_its_fields_differ() {
    let mut bytes = vec![1, 0, 0, 0];
    put_json(
        &BTreeMap::from([("protocol", "palpate.view 9"), ("new", "")]),
        &mut bytes,
    );
    let refused = Message::decode(&bytes).expect_err("another version");
    assert!(matches!(&refused, MessageError::Version(found) if found == "palpate.view 9"));
}
