//! The link between the tick and the host and log: wait-free rings of records of fixed size, and rings of models and patches that
//! pass the part in use ([`crate::packed_ring`]).
//!
//! ```text
//!              TickRecord            Telemetry
//!   HostEnd <--------------- TickEnd ---------> LogEnd
//!     |     ---------------->                     ^
//!     |        LocalModel, one ring a body        |
//!     |        Patch, one ring a device           |
//!     +-------------------------------------------+
//!              LocalModel and Patch, copies for the log
//! ```
//!
//! The log needs every model and every patch that the tick used, for a replay. The host sends these to the log, so they cost the
//! tick nothing. A tick's record names the model or patch in use by its sequence number.
//!
//! Neither side ever waits for the other. The writer refuses and counts a record that finds the ring full. The reader
//! finds the gap in the sequence and counts the gap, too. The capacity of each ring covers a stall (five seconds by
//! default) at the rate of that ring, and every slot is mapped before use. If the reader is gone, the writer neither
//! writes nor counts, because no reader misses the record.
//!
//! On the hot path ([`TickEnd`]) there is no allocation, no lock and no waiting. The tick takes the newest model of a
//! body in constant time, however many models wait.

use crate::memory::MemoryRange;
use crate::packed_ring::PackedReader;
pub use crate::published::RingFull;
use crate::published::{Ends, Inlets, Outlet};
use crate::ring::{Sequence, drain, drain_up_to, prefaulted, slots_for, take_newest};
use rt_core::local_model::{ModelHead, PackedModel};
use rt_core::publication::Publication;
use rt_core::tool::{MAX_SITES, PackedPatch, Patch, PatchHead};
use rt_core::{LocalModel, MAX_BODIES, MAX_DEVICES, MAX_HANDLES, Telemetry, TickRecord};
use rtrb::{Consumer, Producer};

/// Sizes of the rings of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkConfig {
    /// Rate of the tick (Hz).
    pub tick_rate: f64,
    /// Rate at which the host publishes local models of one body, and patches of one tool (Hz).
    pub publish_rate: f64,
    /// Number of connected bodies, of which at most [`MAX_BODIES`] get a ring.
    pub bodies: usize,
    /// Largest number of handles of a body for which the rings have room in every slot, at most [`MAX_HANDLES`]. A body
    /// has at most one handle for each device of its scene.
    pub handles: usize,
    /// The devices that have a tool, and so get a ring of patches.
    pub tools: [bool; MAX_DEVICES],
    /// Duration of a stall of either side before a record is refused (s).
    pub stall: f64,
}

impl LinkConfig {
    /// Stall that the rings cover by default (s).
    pub const STALL: f64 = 5.0;

    /// The configuration for one body and no tool, with the default stall. Rates in Hz.
    pub fn new(tick_rate: f64, publish_rate: f64) -> Self {
        Self {
            tick_rate,
            publish_rate,
            bodies: 1,
            handles: MAX_HANDLES,
            tools: [false; MAX_DEVICES],
            stall: Self::STALL,
        }
    }
}

/// Makes the rings. Allocates and maps all their memory: at 1 kHz about 28 MB, and for each body per 10 Hz of publication
/// rate 0.03 MB with one handle, 0.1 MB with two, 0.5 MB with four and 2 MB with eight; for each tool 1 MB.
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
///     let mut model = LocalModel::empty();
///     model.head.sequence = sequence;
///     host.publish(0, &model)?;
/// }
/// tick.take_models(|body, model| assert_eq!((body, model.head.sequence), (0, 2)));
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
    let most = ModelHead::extent_of(config.handles.clamp(1, MAX_HANDLES));
    let tools = config
        .tools
        .map(|has_tool| if has_tool { models } else { 0 });
    let patches = Ends::new(tools.into_iter(), PatchHead::extent_of(MAX_SITES));
    memory.extend(patches.memory);
    let bodies = std::iter::repeat_n(models, config.bodies.min(MAX_BODIES));
    let models = Ends::new(bodies, most);
    memory.extend(models.memory);
    let tick = TickEnd {
        to_host,
        to_log,
        models: models.tick,
        patches: patches.tick,
        counters: TickCounters::default(),
        memory,
    };
    let host = HostEnd {
        records: from_tick,
        models: models.host,
        patches: patches.host,
        sequence: Sequence::from(0),
    };
    let log = LogEnd {
        telemetry,
        models: models.log,
        patches: patches.log,
        model: Box::new(LocalModel::empty()),
        patch: Box::new(Patch::empty()),
        sequence: Sequence::from(0),
    };
    (tick, host, log)
}

/// Counts at the tick's end. They only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickCounters {
    /// Records for the host that found the ring full.
    pub refused_records: u64,
    /// Records for the log that found the ring full.
    pub refused_telemetry: u64,
    /// Published models that never arrived (gaps in their sequence), over all bodies.
    pub lost_models: u64,
    /// Models that arrived together with a newer model of the same body, and were skipped.
    pub superseded_models: u64,
    /// Published patches that never arrived (gaps in their sequence), over all tools.
    pub lost_patches: u64,
    /// Patches that arrived together with a newer patch of the same tool, and were skipped.
    pub superseded_patches: u64,
}

/// The tick's end.
#[derive(Debug)]
pub struct TickEnd {
    to_host: Producer<TickRecord>,
    to_log: Producer<Telemetry>,
    models: Inlets<ModelHead>,
    patches: Inlets<PatchHead>,
    counters: TickCounters,
    memory: Vec<MemoryRange>,
}

impl TickEnd {
    /// Sends the record of a tick: the short record to the host, the full telemetry to the log.
    pub fn push(&mut self, telemetry: &Telemetry) {
        if !self.to_host.is_abandoned() && self.to_host.push(telemetry.tick_record()).is_err() {
            self.counters.refused_records += 1;
        }
        if !self.to_log.is_abandoned() && self.to_log.push(*telemetry).is_err() {
            self.counters.refused_telemetry += 1;
        }
    }

    /// Calls `accept` with the newest model of each body that has a new model, and discards the older models. The model
    /// stays in the ring while `accept` reads it. The time does not depend on the number of models that wait.
    pub fn take_models(&mut self, accept: impl FnMut(usize, &PackedModel<'_>)) {
        self.models.take(accept);
    }

    /// Calls `accept` with the index of each device whose tool has a new patch, and with the newest one, as
    /// [`Self::take_models`] does.
    pub fn take_patches(&mut self, accept: impl FnMut(usize, &PackedPatch<'_>)) {
        self.patches.take(accept);
    }

    /// The counts since the start.
    pub fn counters(&self) -> TickCounters {
        TickCounters {
            lost_patches: self.patches.lost(),
            superseded_patches: self.patches.superseded(),
            lost_models: self.models.lost(),
            superseded_models: self.models.superseded(),
            ..self.counters
        }
    }

    /// Number of bodies that have a ring.
    pub fn bodies(&self) -> usize {
        self.models.bodies()
    }

    /// Whether the host's end is gone. No more models will then arrive.
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

/// The host's end.
#[derive(Debug)]
pub struct HostEnd {
    records: Consumer<TickRecord>,
    models: Outlet<ModelHead>,
    patches: Outlet<PatchHead>,
    sequence: Sequence,
}

impl HostEnd {
    /// Calls `see` with every record that has arrived, oldest first; returns their number.
    pub fn drain(&mut self, mut see: impl FnMut(&TickRecord)) -> usize {
        let sequence = &mut self.sequence;
        drain(&mut self.records, |record| {
            sequence.see(record.tick, 1);
            see(record);
        })
    }

    /// The newest record that has arrived since the last call; `None` if there is no new record. Older records are
    /// discarded.
    pub fn newest(&mut self) -> Option<TickRecord> {
        let sequence = &mut self.sequence;
        take_newest(&mut self.records, |record, waiting| {
            sequence.see(record.tick, waiting);
            *record
        })
    }

    /// Publishes a local model of a body, as [`Outlet::publish`] says.
    ///
    /// # Errors
    /// [`RingFull`] if the model finds no place.
    pub fn publish(
        &mut self,
        body: usize,
        model: &impl Publication<Head = ModelHead>,
    ) -> Result<(), RingFull> {
        self.models.publish(body, model)
    }

    /// Publishes a patch for the tool of a device, as [`Outlet::publish`] says.
    ///
    /// # Errors
    /// [`RingFull`] if the patch finds no place.
    pub fn publish_patch(
        &mut self,
        device: usize,
        patch: &impl Publication<Head = PatchHead>,
    ) -> Result<(), RingFull> {
        self.patches.publish(device, patch)
    }

    /// Number of ticks whose record never arrived.
    pub fn lost_records(&self) -> u64 {
        self.sequence.lost()
    }

    /// Number of patches that were refused.
    pub fn refused_patches(&self) -> u64 {
        self.patches.refused()
    }

    /// Number of models that were refused.
    pub fn refused_models(&self) -> u64 {
        self.models.refused()
    }

    /// Number of models and patches whose copy for the log found the ring full.
    pub fn refused_copies(&self) -> u64 {
        self.models.refused_copies() + self.patches.refused_copies()
    }

    /// Whether the tick's end is gone, because the loop has ended. Its last records may still wait.
    pub fn tick_is_gone(&self) -> bool {
        self.records.is_abandoned()
    }
}

/// A record as the log receives it.
#[derive(Clone, Copy, Debug)]
pub enum LogRecord<'a> {
    /// The telemetry of a tick.
    Tick(&'a Telemetry),
    /// A model that was published for the body of this index, whether the tick used or skipped the model. Only its used
    /// part is that of the published model.
    Model(u8, &'a LocalModel),
    /// A patch that was published for the tool of the device of this index. Only its used part is that of the published patch.
    Patch(u8, &'a Patch),
}

/// The log's end.
#[derive(Debug)]
pub struct LogEnd {
    telemetry: Consumer<Telemetry>,
    models: PackedReader<ModelHead>,
    patches: PackedReader<PatchHead>,
    /// The model and the patch that are being read.
    model: Box<LocalModel>,
    patch: Box<Patch>,
    sequence: Sequence,
}

impl LogEnd {
    /// Calls `see` with the telemetry of every tick that has arrived, oldest first; returns the number of ticks. Models
    /// and patches are discarded.
    pub fn drain(&mut self, mut see: impl FnMut(&Telemetry)) -> usize {
        self.records(|record| {
            if let LogRecord::Tick(telemetry) = record {
                see(telemetry);
            }
        })
    }

    /// Calls `see` with every record that has arrived: first the models, then the patches, then the telemetry of the ticks, each
    /// oldest first. A model or patch always precedes the ticks that used it. Returns the number of ticks.
    pub fn records(&mut self, mut see: impl FnMut(LogRecord<'_>)) -> usize {
        // The ticks are counted before the models and patches are read, so those that these ticks used have arrived by then.
        let ticks = self.telemetry.slots();
        let model = &mut *self.model;
        self.models.drain(|body, packed| {
            model.copy_used_from(packed);
            see(LogRecord::Model(body, model));
        });
        let patch = &mut *self.patch;
        self.patches.drain(|device, packed| {
            patch.copy_used_from(packed);
            see(LogRecord::Patch(device, patch));
        });
        let sequence = &mut self.sequence;
        drain_up_to(ticks, &mut self.telemetry, |record| {
            sequence.see(record.tick, 1);
            see(LogRecord::Tick(record));
        })
    }

    /// Number of ticks whose record never arrived.
    pub fn lost_records(&self) -> u64 {
        self.sequence.lost()
    }

    /// Whether the tick's end is gone, because the loop has ended. Its last records may still wait.
    pub fn tick_is_gone(&self) -> bool {
        self.telemetry.is_abandoned()
    }
}
