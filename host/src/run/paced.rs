//! The host of a run under virtual time: the steps that a pacer asks for, and a link on which models are late.
//!
//! A host step starts when it is due and the host is free. The step sees the records of the ticks before its due time,
//! and its model arrives after the scene's latency. Until then the host is busy. A run of a scene and the runs of the
//! stress studies have this host; a study gives it a link that loses messages, or wraps it in changes of the body.

use super::ended::HostSide;
use super::late::LateLink;
use super::prepare::Prepared;
use super::slow_host::SlowWatch;
use super::subscribers::Subscribers;
use crate::engine::Engine;
use crate::engine::faults::Failing;
use crate::engine::pacer::Pacer;
use crate::engine::records::Records;
use crate::engine::stats::ProcessorStopwatch;
use core::convert::Infallible;
use rt_core::tool::Patch;
use rt_core::{LocalModel, TickRecord};
use runner::TickLoop;
use runner::link::{HostEnd, LogEnd};

/// A host that steps between the ticks, with its end of the link.
pub trait Host {
    /// The reason why a step cannot be taken.
    type Error;

    /// The time at which the next step starts (ns).
    fn next_ns(&self) -> u64;

    /// Takes the next step.
    ///
    /// # Errors
    /// The step cannot be taken, which ends the session.
    fn step(&mut self) -> Result<(), Self::Error>;

    /// Gives the tick the models that have arrived by `now_ns`.
    fn deliver(&mut self, now_ns: u64);

    /// Takes the steps that start by `now_ns`, and gives the tick the models that have arrived by then.
    ///
    /// # Errors
    /// The first error of a step.
    fn advance(&mut self, now_ns: u64) -> Result<(), Self::Error> {
        loop {
            self.deliver(now_ns);
            if self.next_ns() > now_ns {
                return Ok(());
            }
            self.step()?;
        }
    }
}

/// The host's end of a link, under virtual time.
pub trait HostLink: Send {
    /// Gives `see` every tick record that has arrived, oldest first.
    fn drain(&mut self, see: impl FnMut(&TickRecord));

    /// Sends a model of `body`, which arrives at `arrival_ns` unless the link is worse than that.
    fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel);

    /// Sends a patch for the tool of a device, as a model is sent.
    fn send_patch(&mut self, arrival_ns: u64, device: usize, patch: &Patch);

    /// Gives the tick the messages that have arrived by `now_ns`.
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

    fn send_patch(&mut self, arrival_ns: u64, device: usize, patch: &Patch) {
        Self::send_patch(self, arrival_ns, device, patch);
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
    subscribers: Subscribers,
    pacer: Pacer,
    slow: SlowWatch,
    link: L,
    records: Records,
    latency_ns: u64,
    /// The time until which the host is busy (ns).
    free_at: u64,
}

impl<L: HostLink> Paced<L> {
    /// Takes what is prepared apart: into the tick's side, the log's end of the link, and the host. `wrap` makes the host's link
    /// of the link with latency.
    pub fn of(prepared: Prepared, wrap: impl FnOnce(LateLink) -> L) -> (TickLoop, LogEnd, Self) {
        let bodies = prepared.engine.bodies().len();
        let host = Self {
            engine: Failing::new(prepared.engine, prepared.faults),
            subscribers: prepared.subscribers,
            pacer: prepared.pacer,
            slow: prepared.slow,
            link: wrap(LateLink::new(prepared.host, bodies)),
            records: Records::new(prepared.timing.period_ns),
            latency_ns: prepared.timing.latency_ns,
            free_at: 0,
        };
        (prepared.tick, prepared.log, host)
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

    fn take_records(&mut self) {
        let (link, records) = (&mut self.link, &mut self.records);
        link.drain(|record| records.take(record));
    }
}

impl<L: HostLink> Host for Paced<L> {
    type Error = Infallible;

    fn next_ns(&self) -> u64 {
        self.pacer.next_ns().max(self.free_at)
    }

    fn step(&mut self) -> Result<(), Infallible> {
        let start = self.next_ns();
        if let Some(until_ns) = self.engine.stall(start) {
            self.free_at = until_ns;
            return Ok(());
        }
        let due = self.pacer.begin(start);
        self.take_records();
        let (engine, link, records) = (&mut self.engine, &mut self.link, &mut self.records);
        records.see(start - due.time_ns, |record| engine.follow(record));
        let arrival_ns = start + self.latency_ns;
        engine.step(due, &ProcessorStopwatch, &mut |body, model| {
            link.send(arrival_ns, body, model);
        });
        for (device, patch) in self.engine.patches() {
            self.link.send_patch(arrival_ns, device, patch);
        }
        self.slow.look(self.engine.stats());
        let skipped = self.pacer.skipped();
        let engine = self.engine.engine();
        (self.subscribers).after_step(due.time_ns, skipped, engine);
        if due.publishes {
            self.free_at = arrival_ns;
        }
        Ok(())
    }

    fn deliver(&mut self, now_ns: u64) {
        self.link.deliver(now_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A host that steps every 3 ns. A model arrives 2 ns after the start of its step.
    #[derive(Default)]
    struct Diary {
        next: u64,
        under_way: Vec<u64>,
        seen: Vec<(&'static str, u64)>,
    }

    impl Host for Diary {
        type Error = &'static str;

        fn next_ns(&self) -> u64 {
            if self.next < 9 { self.next } else { u64::MAX }
        }

        fn step(&mut self) -> Result<(), &'static str> {
            self.seen.push(("step", self.next));
            self.under_way.push(self.next + 2);
            self.next += 3;
            Ok(())
        }

        fn deliver(&mut self, now_ns: u64) {
            for arrival in self.under_way.extract_if(.., |arrival| *arrival <= now_ns) {
                self.seen.push(("arrival", arrival));
            }
        }
    }

    #[test]
    fn steps_and_arrivals_come_in_order_before_their_tick() {
        let mut diary = Diary::default();
        for now_ns in [0, 4, 8] {
            assert_eq!(diary.advance(now_ns), Ok(()));
            diary.seen.push(("tick", now_ns));
        }
        let expected = [
            ("step", 0),
            ("tick", 0),
            ("arrival", 2),
            ("step", 3),
            ("tick", 4),
            ("arrival", 5),
            ("step", 6),
            ("arrival", 8),
            ("tick", 8),
        ];
        assert_eq!(diary.seen, expected);
    }
}
