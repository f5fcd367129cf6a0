//! The engine with hands that a test moves, tick by tick.

use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::contact::Contact;
use host::engine::pacer::Due;
use host::engine::stats::Stopwatch;
use host::scene::LoadedScene;
use host::world::World;
use rt_core::{LocalModel, Pose, TickRecord};

/// The tick's period (ns).
pub const MS: u64 = 1_000_000;

/// A clock that stands still, because no state depends on it.
pub struct Still;

impl Stopwatch for Still {
    fn now_ns(&self) -> u64 {
        0
    }
}

/// The engine of a scene, and the hands of its devices.
pub struct Rig {
    /// The engine of one body.
    pub engine: Engine,
    /// The pose of each hand while nothing moves it, by device. At first, device `i` holds handle `i`.
    pub rest: Vec<Pose>,
    /// Number of the next tick.
    pub tick: u64,
    /// The models so far.
    pub published: Vec<LocalModel>,
}

impl Rig {
    /// The rig of a scene with one body, at rest. It has published nothing.
    pub fn new(loaded: &LoadedScene, how: BuildOptions) -> Self {
        let world = World::new(loaded).unwrap();
        let bodies = bodies(&world, how).expect("it can be built");
        let contact = Contact::new(&world, &bodies).expect("contacts");
        let body = bodies[0].body();
        let handles = (0..).map_while(|index| body.handle_report(index));
        let rest: Vec<_> = handles
            .map(|report| Pose {
                position: report.pose.position,
                rotation: report.pose.rotation,
            })
            .collect();
        Self {
            engine: Engine::new(bodies).touching(contact),
            rest,
            tick: 0,
            published: Vec::new(),
        }
    }

    /// Runs `count` ticks. `place` moves the hands from their rest in the tick of a number.
    pub fn follow(&mut self, count: u64, place: impl Fn(u64, &mut [Pose])) {
        for _ in 0..count {
            let mut record = TickRecord::empty();
            record.tick = self.tick;
            record.time_ns = self.tick * MS;
            record.device_count = self.rest.len() as u8;
            let mut hands = self.rest.clone();
            place(self.tick, &mut hands);
            for (proxy, hand) in record.proxies.iter_mut().zip(hands) {
                proxy.0 = hand;
            }
            self.engine.follow(&record);
            self.tick += 1;
        }
    }

    /// Takes a step that is due to publish. Returns the number of published models.
    pub fn step(&mut self) -> usize {
        let before = self.published.len();
        let due = Due {
            time_ns: self.tick * MS,
            publishes: true,
        };
        let published = &mut self.published;
        self.engine
            .step(due, &Still, &mut |_, model| published.push(*model));
        self.published.len() - before
    }
}
