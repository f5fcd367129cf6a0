//! The messages for all viewers of a run. A message is encoded once for all viewers that need the same bytes.

use super::super::frame::{Frame, Hello, Vertices};
use super::super::message::Message;
use crate::record::Surface;
use std::cell::OnceCell;
use std::rc::Rc;

/// An encoded message, as a stream has it.
pub(super) type Bytes = Rc<Vec<u8>>;

/// The present state of the run.
pub(super) struct Station {
    hello: Bytes,
    /// By body: topology epoch and message.
    surfaces: Vec<(u32, Bytes)>,
    /// By body: the newest vertices.
    vertices: Vec<Vertices>,
    end: Option<Bytes>,
}

/// A frame for all viewers. The vertices are in the station.
pub(super) struct Shared {
    pub(super) frame: Frame,
    /// By body: whether the frame has vertices.
    pub(super) moved: Vec<bool>,
    bytes: OnceCell<Bytes>,
}

impl Station {
    /// A run before its first frame. `surfaces` and `vertices` are by body.
    pub(super) fn new(hello: Hello, surfaces: Vec<Surface>, vertices: Vec<Vertices>) -> Self {
        Self {
            hello: encode(&Message::Hello(Box::new(hello))),
            surfaces: surfaces.into_iter().map(encode_surface).collect(),
            vertices,
            end: None,
        }
    }

    pub(super) fn hello(&self) -> Bytes {
        Rc::clone(&self.hello)
    }

    /// The surface of `body`: its epoch and the message. `None` for a body that does not exist.
    pub(super) fn surface(&self, body: usize) -> Option<(u32, Bytes)> {
        self.surfaces.get(body).cloned()
    }

    /// The end of the run, once the run has ended.
    pub(super) fn end(&self) -> Option<Bytes> {
        self.end.clone()
    }

    pub(super) fn set_end(&mut self, summary: String) {
        self.end = Some(encode(&Message::End(summary)));
    }

    /// Takes the next frame and the surfaces of bodies that begin a topology epoch with it.
    pub(super) fn take(&mut self, surfaces: Vec<Surface>, mut frame: Frame) -> Rc<Shared> {
        for surface in surfaces {
            if let Some(known) = self.surfaces.get_mut(surface.body as usize) {
                *known = encode_surface(surface);
            }
        }
        let bodies = frame.bodies.iter_mut().enumerate();
        let moved = bodies.map(|(index, body)| {
            let newest = body.vertices.take().zip(self.vertices.get_mut(index));
            newest.map(|(vertices, known)| *known = vertices).is_some()
        });
        Rc::new(Shared {
            moved: moved.collect(),
            frame,
            bytes: OnceCell::new(),
        })
    }

    /// The bytes of a frame that is the same for several viewers.
    pub(super) fn shared(&self, shared: &Shared) -> Bytes {
        let encoded = || self.encode(shared.frame.clone(), &shared.moved);
        Rc::clone(shared.bytes.get_or_init(encoded))
    }

    /// The bytes of `frame` with the newest vertices of the bodies that `moved`.
    pub(super) fn encode(&self, mut frame: Frame, moved: &[bool]) -> Bytes {
        let bodies = frame.bodies.iter_mut().zip(moved).zip(&self.vertices);
        for ((body, _), vertices) in bodies.filter(|((_, moved), _)| **moved) {
            body.vertices = Some(vertices.clone());
        }
        encode(&Message::Frame(Box::new(frame)))
    }
}

pub(super) fn encode(message: &Message) -> Bytes {
    let mut bytes = Vec::new();
    message.encode_in_stream(&mut bytes);
    Rc::new(bytes)
}

fn encode_surface(surface: Surface) -> (u32, Bytes) {
    (surface.epoch, encode(&Message::Surface(surface)))
}
