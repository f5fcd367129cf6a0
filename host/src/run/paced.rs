//! The host of a run under virtual time: the steps that a pacer asks for, and a link on which models are late.
//!
//! A host step starts when it is due and the host is free. The step sees the records of the ticks before its due time,
//! and its model arrives after the scene's latency. Until then the host is busy. A run of a scene and the runs of the
//! stress studies have this host; a study gives it a link that loses messages, or wraps it in changes of the body.

use super::late::LateLink;
use super::setup::{HostSide, Setup};
use super::slow_host::SlowWatch;
use super::taps::Taps;
use super::timeline::Host;
use crate::engine::Engine;
use crate::engine::faults::Failing;
use crate::engine::pacer::Pacer;
use crate::engine::records::Records;
use crate::engine::stats::ProcessorStopwatch;
use crate::engine::threads::{Threads, awake};
use core::convert::Infallible;
use rt_core::{LocalModel, TickRecord};
use runner::TickLoop;
use runner::link::{HostEnd, LogEnd};

/// The host's end of a link, under virtual time.
pub trait HostLink: Send {
    /// Gives `see` every tick record that has arrived, oldest first.
    fn drain(&mut self, see: impl FnMut(&TickRecord));

    /// Sends a model of `body`, which arrives at `arrival_ns` unless the link is worse than that.
    fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel);

    /// Gives the tick the models that have arrived by `now_ns`.
    fn deliver(&mut self, now_ns: u64);

    /// The host's end alone. Models that have not arrived are lost.
    fn into_end(self) -> HostEnd;
}

impl HostLink for LateLink {
    fn drain(&mut self, see: impl FnMut(&TickRecord)) {
        Self::drain(self, see);
    }

    fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel) {
        Self::send(self, arrival_ns, body, model);
    }

    fn deliver(&mut self, now_ns: u64) {
        Self::deliver(self, now_ns, |_, _| {});
    }

    fn into_end(self) -> HostEnd {
        Self::into_end(self)
    }
}

/// A host that is busy from the start of a publishing step until the arrival of its model.
pub struct Paced<L> {
    engine: Failing,
    taps: Taps,
    threads: Threads,
    pacer: Pacer,
    slow: SlowWatch,
    link: L,
    records: Records,
    latency_ns: u64,
    /// The time until which the host is busy (ns).
    free_at: u64,
}

impl<L: HostLink> Paced<L> {
    /// Takes a set-up apart: into the tick's side, the log's end of the link, and the host. `wrap` makes the host's link
    /// of the link with latency.
    pub fn of(setup: Setup, wrap: impl FnOnce(LateLink) -> L) -> (TickLoop, LogEnd, Self) {
        let bodies = setup.engine.bodies().len();
        let host = Self {
            engine: Failing::new(setup.engine, setup.faults),
            taps: setup.taps,
            threads: setup.threads,
            pacer: setup.pacer,
            slow: setup.slow,
            link: wrap(LateLink::new(setup.host, bodies)),
            records: Records::new(setup.timing.period_ns),
            latency_ns: setup.timing.latency_ns,
            free_at: 0,
        };
        (setup.tick, setup.log, host)
    }

    /// The physics.
    pub fn engine(&self) -> &Engine {
        self.engine.engine()
    }

    /// The link.
    pub fn link(&self) -> &L {
        &self.link
    }

    /// Lets `change` change the physics between two steps, with the handles where the records that have arrived leave
    /// them.
    pub fn change<R>(&mut self, change: impl FnOnce(&mut Engine) -> R) -> R {
        self.take_records();
        let engine = &mut self.engine;
        self.records.see(0, |record| engine.follow(record));
        change(self.engine.engine_mut())
    }

    /// The host's side of the run after its end.
    pub(super) fn into_side(self) -> HostSide {
        HostSide {
            engine: self.engine.into_engine(),
            pacer: self.pacer,
            end: self.link.into_end(),
        }
    }

    fn start_ns(&self) -> u64 {
        self.pacer.next_ns().max(self.free_at)
    }

    fn take_records(&mut self) {
        let (link, records) = (&mut self.link, &mut self.records);
        link.drain(|record| records.take(record));
    }
}

impl<L: HostLink> Host for Paced<L> {
    type Error = Infallible;

    fn next_ns(&self) -> Option<u64> {
        Some(self.start_ns())
    }

    fn step(&mut self) -> Result<(), Infallible> {
        let start = self.start_ns();
        if let Some(until_ns) = self.engine.stall(start) {
            self.free_at = until_ns;
            return Ok(());
        }
        let due = self.pacer.begin(start);
        self.take_records();
        let (engine, link, records) = (&mut self.engine, &mut self.link, &mut self.records);
        records.see(start - due.time_ns, |record| engine.follow(record));
        let arrival_ns = start + self.latency_ns;
        self.threads.run(|| {
            awake(|| {
                engine.step(due, &ProcessorStopwatch, &mut |body, model| {
                    link.send(arrival_ns, body, model);
                });
            });
        });
        self.slow.look(self.engine.stats());
        let skipped = self.pacer.skipped();
        (self.taps).after_step(due.time_ns, skipped, self.engine.engine());
        if due.publishes {
            self.free_at = arrival_ns;
        }
        Ok(())
    }

    fn deliver(&mut self, now_ns: u64) {
        self.link.deliver(now_ns);
    }
}
