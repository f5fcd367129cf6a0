//! A run that viewers watch: joins the host's snapshots, the observer and the thread of the viewers.

mod observer;

use crate::engine::Engine;
use crate::live::gather::Gatherer;
use crate::live::socket::{Listener, Server, Update};
use crate::live::{Hello, Source};
use crate::record::Surface;
use crate::run::ended::HostSide;
use crate::run::summary::RunSummary;
use crate::run::{RunError, RunOptions, facts};
use crate::snapshot::{Snapshot, Subscriber, Watchers};
use crate::world::World;
use observer::{Frames, Rest, TickTime, ViewObserver, vertices};
use std::path::PathBuf;
use std::sync::{Arc, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// How a run is watched.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewOptions {
    /// Path of the socket. `None` for this process's own path in the folder of the user
    /// ([`address::of_this_process`](crate::live::socket::address::of_this_process)).
    pub socket: Option<PathBuf>,
    /// Seconds of a run in virtual time for each second of the wall clock. Zero: as fast as possible.
    pub pace: f64,
}

/// The part of a watched run that goes with its host.
pub struct HostView {
    /// Receives the reader of the computing times of the ticks when the tick's thread starts.
    pub(crate) tick_time: TickTime,
    /// As [`ViewOptions::pace`].
    pub(crate) pace: f64,
}

/// The thread of the viewers, and what the last frame needs.
pub(crate) struct Session {
    server: Server,
    rest: Rest,
}

impl Session {
    /// Begins to serve viewers of a run at `listener`.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(crate) fn begin(
        view: &ViewOptions,
        listener: Listener,
        world: &World<'_>,
        options: &RunOptions,
        seed: u64,
        engine: &Engine,
    ) -> Result<(Self, HostView, (Subscriber, ViewObserver)), RunError> {
        let mut hello = Hello::new(Source::Run, world, facts(world.loaded, options, seed));
        hello.run = identity();
        hello.duration = options.duration.unwrap_or(hello.duration);
        let mut surfaces: Vec<_> = (0..)
            .zip(&world.bodies)
            .map(|(index, built)| Surface::of_mesh(index, built.body.epoch(), &built.mesh))
            .collect();
        for (surface, body) in surfaces.iter_mut().zip(engine.bodies()) {
            surface.epoch = body.body().epoch() as u32;
        }
        let watchers = Watchers::default();
        let (subscriber, reader) = Subscriber::watched(engine, watchers.clone());
        let epochs: Vec<_> = surfaces.iter().map(|surface| surface.epoch).collect();
        let vertices = vertices(&Snapshot::since(&epochs, engine, 0, 0)).collect();
        let tick_time = TickTime::default();
        let gatherer = Gatherer::new(world.loaded, options.clock).with_obstacles(&world.obstacles);
        let frames = Frames::new(gatherer, surfaces.clone());
        let server = Server::start(listener, hello, surfaces, vertices, watchers.clone())?;
        let rest = Rest::default();
        let sender = server.sender();
        let theirs = (Arc::clone(&tick_time), Arc::clone(&rest));
        let observer = ViewObserver::new(watchers, frames, reader, sender, theirs);
        let host = HostView {
            tick_time,
            pace: view.pace,
        };
        Ok((Self { server, rest }, host, (subscriber, observer)))
    }

    /// Sends the last frame, with the totals of `summary` and the state of `host`, and the summary.
    pub(crate) fn finish(self, host: &HostSide, summary: &RunSummary) {
        let rest = self
            .rest
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        // Without the observer, whose thread panicked, there is no last frame.
        let last = rest.map(|mut frames| {
            let (time_ns, skipped) = (host.pacer.last_ns(), host.pacer.skipped());
            let snapshot = Snapshot::since(&frames.epochs(), &host.engine, time_ns, skipped);
            let (surfaces, mut frame) = frames.last(Some(&snapshot));
            take_totals(&mut frame, summary);
            Update::Frame(surfaces, Box::new(frame))
        });
        let json = serde_json::to_string(summary).unwrap_or_default();
        self.server.finish(last, json);
    }
}

/// A number that no other run has: the process, and the time at which the run began.
fn identity() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    let nanoseconds = since.map_or(0, |since| since.as_nanos() as u64);
    (u64::from(std::process::id()) << 40) ^ nanoseconds
}

/// Gives a frame the totals of the summary. The frame has counted the ticks whose record arrived; the summary counts all
/// ticks.
fn take_totals(frame: &mut crate::live::Frame, summary: &RunSummary) {
    let (totals, tick) = (&mut frame.totals, &summary.tick);
    totals.ticks = tick.count;
    totals.missed = tick.missed_deadlines;
    totals.longest_miss = tick.longest_miss;
    totals.lost = tick.count.saturating_sub(tick.records);
    totals.lateness = tick.lateness;
    totals.duration = tick.duration;
    totals.model_age.clone_from(&tick.model_age);
}
