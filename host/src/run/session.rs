//! A session: a world under hands, in virtual time, tick by tick.
//!
//! Devices, hands, host and log are on one clock, in one thread. The host's threads share the work of a step only. The host
//! is [`Paced`]. Its stopwatch, which measures the time of a stage, reads the processor time of its thread. The readings
//! never enter the state: two sessions give the same bytes under any load, alone or side by side.

use super::ended::Ended;
use super::late::LateLink;
use super::observer::Observed;
use super::paced::{Host, Paced};
use super::panics;
use super::prepare::{Options, Prepared, Timing};
use crate::engine::Engine;
use crate::scene::SceneError;
use crate::world::World;
use core::convert::Infallible;
use rt_core::{Telemetry, TickTime};
use runner::TickLoop;
use runner::link::{LogEnd, LogRecord};

/// A world under hands. `H` is its host.
///
/// ```
/// use host::run::prepare::Options;
/// use host::run::session::Session;
/// use host::scene::Scene;
/// use host::world::World;
///
/// let scene = Scene::embedded_default()?;
/// let world = World::new(&scene)?;
/// let mut session = Session::new(&world, &Options::new(0.05, 1))?;
/// let mut peak = 0.0_f64;
/// while let Some(telemetry) = session.tick() {
///     peak = peak.max(telemetry.devices[0].wrench.force.norm());
/// }
/// assert_eq!(session.ticks(), 50);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session<H = Paced<LateLink>> {
    tick: TickLoop,
    pub(super) host: H,
    log: LogEnd,
    timing: Timing,
    /// Ticks done.
    ticks: u64,
    /// The text of a panic of the host. The host then does nothing more, as under the real clock, and the ticks continue.
    panicked: Option<String>,
}

impl Session {
    /// A session before its first tick.
    ///
    /// # Errors
    /// [`SceneError`], naming the file, line and field that cannot be built.
    pub fn new(world: &World<'_>, options: &Options) -> Result<Self, SceneError> {
        Ok(Self::of(Prepared::new(world, options)?))
    }

    /// A session of prepared parts.
    pub fn of(prepared: Prepared) -> Self {
        Self::with(prepared, |link| link, |host| host)
    }

    /// Makes the next tick, and before it the host steps that are due. `None` after the last tick.
    pub fn tick(&mut self) -> Option<Telemetry> {
        let Ok(telemetry) = self.try_tick();
        telemetry
    }

    /// The physics; `None` after a panic of the host.
    pub fn engine(&self) -> Option<&Engine> {
        self.panicked.is_none().then(|| self.host.engine())
    }

    /// Makes all remaining ticks, gives `sink` their records ([`records`](Self::records)), and ends.
    pub fn run(mut self, mut sink: impl FnMut(LogRecord<'_>)) -> Ended {
        while self.tick().is_some() {
            self.records(&mut sink);
        }
        self.end()
    }

    /// Ends, and releases the devices.
    pub fn end(mut self) -> Ended {
        self.tick.release(self.ticks * self.timing.period_ns);
        Ended {
            tick: self.tick.into(),
            host: self.host.into_side(),
            panicked: self.panicked,
            stopped: self.ticks < self.timing.ticks,
            observed: Observed::default(),
        }
    }
}

impl<H: Host> Session<H> {
    /// A session with another host: `link` makes the host's link of the link with latency, and `host` the host of the usual
    /// one.
    pub fn with<L>(
        prepared: Prepared,
        link: impl FnOnce(LateLink) -> L,
        host: impl FnOnce(Paced<L>) -> H,
    ) -> Self
    where
        Paced<L>: Host<Error = Infallible>,
        L: super::paced::HostLink,
    {
        let timing = prepared.timing;
        let (tick, log, paced) = Paced::of(prepared, link);
        Self::beside(host(paced), (tick, log), timing)
    }

    /// Makes a tick as [`tick`](Session::tick) does, with a host that can fail.
    ///
    /// # Errors
    /// The error of the host.
    pub fn try_tick(&mut self) -> Result<Option<Telemetry>, H::Error> {
        if self.ticks == self.timing.ticks {
            return Ok(None);
        }
        let now_ns = self.now_ns();
        if self.panicked.is_none() {
            match panics::caught(|| self.host.advance(now_ns)) {
                Ok(advanced) => advanced?,
                Err(panic) => self.panicked = Some(panic),
            }
        }
        Ok(Some(self.tick_at(now_ns.into(), 0)))
    }
}

impl<H> Session<H> {
    /// A session of a `host` and the tick with the log's end of its link.
    pub(super) fn beside(host: H, (tick, log): (TickLoop, LogEnd), timing: Timing) -> Self {
        Self {
            tick,
            host,
            log,
            timing,
            ticks: 0,
            panicked: None,
        }
    }

    /// Makes the tick of `time`, which takes `took_ns`, with what the host has given it.
    pub(super) fn tick_at(&mut self, time: TickTime, took_ns: u64) -> Telemetry {
        self.ticks += 1;
        self.tick.timed(time, || took_ns)
    }

    /// Gives `sink` the telemetry of the ticks since the last call in order, and each model before the ticks that used it.
    pub fn records(&mut self, sink: impl FnMut(LogRecord<'_>)) {
        self.log.records(sink);
    }

    /// The tick with its devices.
    pub fn tick_loop(&self) -> &TickLoop {
        &self.tick
    }

    /// The host.
    pub fn host(&self) -> &H {
        &self.host
    }

    /// The text of the host's panic, if there was one.
    pub fn panicked(&self) -> Option<&str> {
        self.panicked.as_deref()
    }

    /// The time of the next tick (ns).
    pub fn now_ns(&self) -> u64 {
        self.ticks * self.timing.period_ns
    }

    /// The ticks done.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }
}
