//! The link between the tick and everything else: wait-free rings of fixed-size records.
//!
//! ```text
//!              TickRecord            Telemetry
//!   HostEnd <--------------- TickEnd ---------> LogEnd
//!     |     ---------------->                     ^
//!     |        LocalModel, one ring a body        |
//!     +-------------------------------------------+
//!              LocalModel, copies for the log
//! ```
//!
//! The log needs every model that the tick used, to replay it. It gets them from the host, so that they
//! cost the tick nothing: a record of a tick names by its sequence number the model in use.
//!
//! Neither side ever waits for the other. What finds its ring full is refused and counted by the writer;
//! the reader sees the gap in the sequence and counts it too. Capacities cover a stall (five seconds by
//! default) at the rate of each ring, and every slot is mapped before use. Where the reader is gone,
//! nothing is written and nothing counted: there is nobody to miss it.
//!
//! On the hot path ([`TickEnd`]): no allocation, no lock, no waiting; the newest model of a body is taken
//! in constant time however many wait.

use crate::memory::MemoryRange;
use crate::ring::{Sequence, drain, drain_up_to, prefaulted, slots_for, take_newest};
use rt_core::{LocalModel, MAX_BODIES, Telemetry, TickRecord};
use rtrb::{Consumer, Producer, RingBuffer};

/// How large the rings of a link are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkConfig {
    /// Ticks a second (Hz).
    pub tick_rate: f64,
    /// Local models that the host publishes a second, for each body (Hz).
    pub publish_rate: f64,
    /// Connected bodies; beyond [`MAX_BODIES`] there are none.
    pub bodies: usize,
    /// How long either side may stall before a record is refused (s).
    pub stall: f64,
}

impl LinkConfig {
    /// What the rings cover by default (s).
    pub const STALL: f64 = 5.0;

    /// One body, with the default stall. Rates in Hz.
    pub fn new(tick_rate: f64, publish_rate: f64) -> Self {
        Self {
            tick_rate,
            publish_rate,
            bodies: 1,
            stall: Self::STALL,
        }
    }
}

/// Makes the rings. Allocates and maps all their memory (at 1 kHz about 10 MB, and for each body 1 MB for
/// every 10 models a second).
///
/// ```
/// use rt_core::{LocalModel, Telemetry};
/// use runner::link::{LinkConfig, link};
///
/// let (mut tick, mut host, mut log) = link(&LinkConfig::new(1000.0, 60.0));
///
/// // The tick leaves a record, the host and the log find it.
/// tick.push(&Telemetry::empty());
/// assert_eq!(host.newest().map(|record| record.tick), Some(0));
/// assert_eq!(log.drain(|telemetry| assert_eq!(telemetry.tick, 0)), 1);
///
/// // The host publishes two models of the first body; the tick takes the newer one.
/// for sequence in 1..=2 {
///     host.publish(0, &LocalModel { sequence, ..LocalModel::empty() })?;
/// }
/// tick.take_models(|body, model| assert_eq!((body, model.sequence), (0, 2)));
/// assert_eq!(tick.counters().superseded_models, 1);
/// # Ok::<(), runner::link::RingFull>(())
/// ```
pub fn link(config: &LinkConfig) -> (TickEnd, HostEnd, LogEnd) {
    let ticks = slots_for(config.tick_rate, config.stall);
    let models = slots_for(config.publish_rate, config.stall);
    let mut memory = Vec::new();
    let (to_host, from_tick, used) = prefaulted(ticks, TickRecord::empty());
    memory.extend(used);
    let (to_log, telemetry, used) = prefaulted(ticks, Telemetry::empty());
    memory.extend(used);
    let mut to_tick = Vec::new();
    let mut inlets = Vec::new();
    let bodies = config.bodies.min(MAX_BODIES);
    for _ in 0..bodies {
        let (producer, ring, used) = prefaulted(models, LocalModel::empty());
        memory.extend(used);
        to_tick.push(producer);
        inlets.push(Inlet {
            ring,
            sequence: Sequence::from(1),
        });
    }
    // Between threads that may wait for a page: not mapped ahead.
    let (copies, to_replay) = RingBuffer::new(models * bodies);
    let tick = TickEnd {
        to_host,
        to_log,
        inlets,
        counters: TickCounters::default(),
        memory,
    };
    let host = HostEnd {
        records: from_tick,
        to_tick,
        copies,
        sequence: Sequence::from(0),
        refused: 0,
        refused_copies: 0,
    };
    let log = LogEnd {
        telemetry,
        models: to_replay,
        sequence: Sequence::from(0),
    };
    (tick, host, log)
}

/// What the tick's end met. Counts only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickCounters {
    /// Records for the host that found the ring full.
    pub refused_records: u64,
    /// Records for the log that found the ring full.
    pub refused_telemetry: u64,
    /// Models that were published but never arrived (gaps in their sequence), over all bodies.
    pub lost_models: u64,
    /// Models that arrived together with a newer one of the same body and were passed over.
    pub superseded_models: u64,
}

/// The tick's end.
#[derive(Debug)]
pub struct TickEnd {
    to_host: Producer<TickRecord>,
    to_log: Producer<Telemetry>,
    inlets: Vec<Inlet>,
    counters: TickCounters,
    memory: Vec<MemoryRange>,
}

/// Where the models of one body come in.
#[derive(Debug)]
struct Inlet {
    ring: Consumer<LocalModel>,
    sequence: Sequence,
}

impl TickEnd {
    /// Hands on what a tick left: the short record to the host, the full one to the log.
    pub fn push(&mut self, telemetry: &Telemetry) {
        if !self.to_host.is_abandoned() && self.to_host.push(telemetry.tick_record()).is_err() {
            self.counters.refused_records += 1;
        }
        if !self.to_log.is_abandoned() && self.to_log.push(*telemetry).is_err() {
            self.counters.refused_telemetry += 1;
        }
    }

    /// Gives `accept` the newest model of each body that has a new one, and lets the older ones go. Takes
    /// the same time whether one model waits or hundreds.
    pub fn take_models(&mut self, mut accept: impl FnMut(usize, &LocalModel)) {
        for (body, inlet) in self.inlets.iter_mut().enumerate() {
            let sequence = &mut inlet.sequence;
            let counters = &mut self.counters;
            take_newest(&mut inlet.ring, |newest, waiting| {
                let before = sequence.lost();
                sequence.see(newest.sequence, waiting);
                counters.lost_models += sequence.lost() - before;
                counters.superseded_models += waiting - 1;
                accept(body, newest);
            });
        }
    }

    /// What it met so far.
    pub fn counters(&self) -> TickCounters {
        self.counters
    }

    /// Bodies that have a ring.
    pub fn bodies(&self) -> usize {
        self.inlets.len()
    }

    /// Whether the host's end is gone: no model will come any more.
    pub fn host_is_gone(&self) -> bool {
        self.to_host.is_abandoned()
    }

    /// Whether the log's end is gone.
    pub fn log_is_gone(&self) -> bool {
        self.to_log.is_abandoned()
    }

    /// The memory of all rings, for locking.
    pub fn memory(&self) -> &[MemoryRange] {
        &self.memory
    }
}

/// A model that could not be published. The tick goes on with the one before; so should the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the local model of body {body} was not published: its ring holds {capacity} models and none is \
     free (a ring of 0 does not exist; otherwise the tick has taken none for a whole stall)"
)]
pub struct RingFull {
    /// Index of the body.
    pub body: usize,
    /// Models that its ring can hold; zero where the link has no such body.
    pub capacity: usize,
}

/// The host's end.
#[derive(Debug)]
pub struct HostEnd {
    records: Consumer<TickRecord>,
    to_tick: Vec<Producer<LocalModel>>,
    copies: Producer<(u8, LocalModel)>,
    sequence: Sequence,
    refused: u64,
    refused_copies: u64,
}

impl HostEnd {
    /// Gives `see` every record that has come, oldest first; returns how many.
    pub fn drain(&mut self, mut see: impl FnMut(&TickRecord)) -> usize {
        let sequence = &mut self.sequence;
        drain(&mut self.records, |record| {
            sequence.see(record.tick, 1);
            see(record);
        })
    }

    /// The newest record that has come since the last look, the older ones let go; `None` where there is
    /// no new one.
    pub fn newest(&mut self) -> Option<TickRecord> {
        let sequence = &mut self.sequence;
        take_newest(&mut self.records, |record, waiting| {
            sequence.see(record.tick, waiting);
            *record
        })
    }

    /// Publishes a local model of a body. Its sequence number should follow the last one's, from one on.
    ///
    /// # Errors
    /// [`RingFull`] where the tick has not taken any for a whole stall, or the body has no ring; counted.
    pub fn publish(&mut self, body: usize, model: &LocalModel) -> Result<(), RingFull> {
        let Some(ring) = self.to_tick.get_mut(body) else {
            self.refused += 1;
            return Err(RingFull { body, capacity: 0 });
        };
        // To the log first: a tick that uses the model then finds it there, whenever the log looks.
        if !self.copies.is_abandoned() && self.copies.push((body as u8, *model)).is_err() {
            self.refused_copies += 1;
        }
        if ring.push(*model).is_err() {
            self.refused += 1;
            return Err(RingFull {
                body,
                capacity: ring.buffer().capacity(),
            });
        }
        Ok(())
    }

    /// Ticks whose record never came.
    pub fn lost_records(&self) -> u64 {
        self.sequence.lost()
    }

    /// Models that were refused.
    pub fn refused_models(&self) -> u64 {
        self.refused
    }

    /// Models whose copy for the log found the ring full.
    pub fn refused_copies(&self) -> u64 {
        self.refused_copies
    }

    /// Whether the tick's end is gone: the loop has ended. Records it left may still wait.
    pub fn tick_is_gone(&self) -> bool {
        self.records.is_abandoned()
    }
}

/// What comes to the log.
#[derive(Clone, Copy, Debug)]
pub enum LogRecord<'a> {
    /// A tick's telemetry.
    Tick(&'a Telemetry),
    /// A model published for the body of this index, whether the tick took it or passed it over.
    Model(u8, &'a LocalModel),
}

/// The log's end.
#[derive(Debug)]
pub struct LogEnd {
    telemetry: Consumer<Telemetry>,
    models: Consumer<(u8, LocalModel)>,
    sequence: Sequence,
}

impl LogEnd {
    /// Gives `see` the telemetry of every tick that has come, oldest first; returns how many. Models are
    /// let go.
    pub fn drain(&mut self, mut see: impl FnMut(&Telemetry)) -> usize {
        self.records(|record| {
            if let LogRecord::Tick(telemetry) = record {
                see(telemetry);
            }
        })
    }

    /// Gives `see` everything that has come: models, then the telemetry of ticks, each oldest first. A
    /// tick never comes before the model that it used. Returns the number of ticks.
    pub fn records(&mut self, mut see: impl FnMut(LogRecord<'_>)) -> usize {
        // Counted before the models are taken: those that these ticks used have come by now.
        let ticks = self.telemetry.slots();
        drain(&mut self.models, |(body, model)| {
            see(LogRecord::Model(*body, model));
        });
        let sequence = &mut self.sequence;
        drain_up_to(ticks, &mut self.telemetry, |record| {
            sequence.see(record.tick, 1);
            see(LogRecord::Tick(record));
        })
    }

    /// Ticks whose record never came.
    pub fn lost_records(&self) -> u64 {
        self.sequence.lost()
    }

    /// Whether the tick's end is gone: the loop has ended. Records it left may still wait.
    pub fn tick_is_gone(&self) -> bool {
        self.telemetry.is_abandoned()
    }
}
