//! Snapshots of a step: the positions of the bodies, for viewers, logs and files.
//!
//! After a step, the host copies the state of the bodies into a buffer for each subscriber that is due: the frames on
//! disk, the log, the viewers. A [`Subscriber`] has its own times ([`When`]), its own ring of buffers with a rule for a
//! step that finds none free ([`Policy`]), and copies only what its reader needs ([`Contents`]). Nothing of this enters the
//! state of the run.

mod due;
mod host;
mod mesh;
mod ring;
mod subscriber;
mod torn;

pub use due::{Schedule, Watchers, When};
pub use host::HostCounts;
pub use ring::{Missing, Policy, Reader};
pub use subscriber::Subscriber;
pub use torn::TornSurface;

pub(crate) use due::Rate;
pub(crate) use mesh::after_change;

use crate::engine::Engine;
use crate::engine::body::HostBody;
use crate::engine::contact::Contact;
use physics::Vec3;
use physics::mesh::Mesh;
use physics::motion::contacts::Pressed;
use physics::topology::Edit;

/// The state of the bodies and of the host after a step.
#[derive(Debug, Default)]
pub struct Snapshot {
    /// Number in the series of its subscriber, from zero. Subscribers without a series leave it at zero.
    pub number: usize,
    /// Number of the step, from one; zero before the first step.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// The bodies, in the scene's order.
    pub bodies: Vec<BodySnapshot>,
    /// The counts of the host. The rate of the steps is left at zero.
    pub host: HostCounts,
}

/// The state of one body after a step.
#[derive(Debug, Default)]
pub struct BodySnapshot {
    /// Topology epoch.
    pub epoch: u32,
    /// Positions (m).
    pub positions: Vec<Vec3>,
    /// Velocities (m/s), for [`Contents::Motion`].
    pub velocities: Vec<Vec3>,
    /// What presses on each vertex of its surface, for [`Contents::Motion`]; empty if nothing touches in the scene.
    pub pressed: Vec<Pressed>,
    /// The edits by which the body has torn since the snapshot before, for [`Contents::Motion`].
    pub edits: Vec<Edit>,
    /// The surface, if a tear has grown since the snapshot before, for [`Contents::Surfaces`].
    pub torn: TornSurface,
    /// The mesh at its present positions, if the epoch has changed since the snapshot before and no tear is the reason, for
    /// [`Contents::Surfaces`].
    pub changed: Option<Box<Mesh>>,
}

/// The data that a subscriber needs in addition to the positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// Velocities and edits, for bodies of the subscriber's own that follow.
    Motion,
    /// The surface of each topology epoch, for a picture.
    Surfaces,
}

/// The facts about a body that a subscriber has.
#[derive(Clone, Copy, Debug)]
struct Known {
    epoch: u32,
    /// Number of edits.
    edits: usize,
}

impl Snapshot {
    /// A snapshot with room for `bodies`, and for all that tears may add to them.
    fn with_room(bodies: &[HostBody], contents: Contents) -> Self {
        let bodies = bodies.iter().enumerate().map(|(index, body)| {
            let body = body.body();
            let room = vertex_room(body);
            let mut copy = BodySnapshot {
                positions: Vec::with_capacity(room),
                ..BodySnapshot::default()
            };
            match contents {
                Contents::Motion => {
                    copy.velocities.reserve(room);
                    copy.pressed.reserve(room);
                    // Every edit adds a vertex.
                    copy.edits.reserve(room - body.vertex_count());
                }
                Contents::Surfaces => copy.torn = TornSurface::new(index, body),
            }
            copy
        });
        Self {
            bodies: bodies.collect(),
            ..Self::default()
        }
    }

    /// The present state of `engine`, after the step that was due at `time_ns`, with the surfaces of the bodies whose epoch
    /// is not that of `epochs`. `skipped` is the number of steps left out.
    pub fn since(epochs: &[u32], engine: &Engine, time_ns: u64, skipped: u64) -> Self {
        let known = epochs.iter().map(|&epoch| Known { epoch, edits: 0 });
        let mut known: Vec<_> = known.collect();
        let mut snapshot = Self::with_room(engine.bodies(), Contents::Surfaces);
        snapshot.take(engine, (time_ns, skipped), Contents::Surfaces, &mut known);
        snapshot.host.medians = host::medians(engine.stats());
        snapshot
    }

    /// Takes the state of `engine` after the step that was due at a time (ns), with the number of steps left out. The
    /// medians of the host stay as they are. A snapshot with room allocates nothing, but for the mesh of a body that
    /// changed without a tear.
    fn take(
        &mut self,
        engine: &Engine,
        (time_ns, skipped): (u64, u64),
        contents: Contents,
        known: &mut [Known],
    ) {
        self.step = engine.stats().steps;
        self.time_ns = time_ns;
        let bodies = engine.bodies();
        self.bodies.resize_with(bodies.len(), Default::default);
        let copies = self.bodies.iter_mut().zip(known);
        for (index, ((copy, known), body)) in copies.zip(bodies).enumerate() {
            copy.take((index, body), engine.contact(), contents, known);
        }
        self.host.count(engine, skipped);
    }
}

impl BodySnapshot {
    fn take(
        &mut self,
        (index, host): (usize, &HostBody),
        contact: Option<&Contact>,
        contents: Contents,
        known: &mut Known,
    ) {
        let body = host.body();
        self.epoch = body.epoch() as u32;
        self.positions.clear();
        self.positions.extend(body.positions());
        match contents {
            Contents::Motion => {
                self.velocities.clear();
                self.velocities.extend(body.velocities());
                self.pressed.clear();
                if let Some(contact) = contact {
                    contact.contacts().press(index, &mut self.pressed);
                }
                self.edits.clear();
                let journal = host.tears().map(|tears| tears.tearing().journal());
                let newer = journal.and_then(|journal| journal.get(known.edits..));
                self.edits.extend(newer.unwrap_or_default());
                known.edits += self.edits.len();
            }
            Contents::Surfaces => {
                self.torn.clear();
                self.changed = None;
                if known.epoch != self.epoch && !self.torn.copy(index, body) {
                    self.changed = body.mesh().map(Box::new);
                }
            }
        }
        known.epoch = self.epoch;
    }

    /// The positions (m) as pictures have them, three numbers a vertex.
    pub fn rounded(&self) -> impl Iterator<Item = f32> {
        let positions = self.positions.iter();
        positions.flat_map(|p| [p.x as f32, p.y as f32, p.z as f32])
    }
}

/// The numbers of vertices that `body` may have: those that it has, and those that tears may add.
fn vertex_room(body: &physics::Body) -> usize {
    let surface = body.surface();
    surface.map_or(body.vertex_count(), |surface| surface.limits().vertices)
}

#[cfg(test)]
mod tests;
