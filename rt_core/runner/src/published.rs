//! Publications of one kind on a link: a ring for each body or tool from the host to the tick, and copies for the log.
//!
//! A link has one [`Outlet`], one [`Inlets`] and one reader for each kind of publication.

use crate::memory::MemoryRange;
use crate::packed_ring::{PackedReader, PackedWriter, packed_ring, prefaulted_packed_ring};
use rt_core::publication::{Extent, Head, Packed, Publication};

/// The error for a publication that found no place. The tick continues with the previous one; so should the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the {kind} {body} was not published: its ring has {capacity} places, and all of them are taken (a ring \
     without places does not exist)"
)]
pub struct RingFull {
    /// The name of the kind of publication, and of what the index is one.
    pub kind: &'static str,
    /// Index of the body, or of the device.
    pub body: usize,
    /// Capacity of the ring in publications; zero if the link has no such body, or no tool for the device.
    pub capacity: usize,
}

/// The ends of the rings of one kind of publication.
#[derive(Debug)]
pub struct Ends<H: Head> {
    /// The end of the host.
    pub host: Outlet<H>,
    /// The end of the tick.
    pub tick: Inlets<H>,
    /// The end of the log.
    pub log: PackedReader<H>,
    /// The memory of the rings that the tick reads.
    pub memory: Vec<MemoryRange>,
}

impl<H: Head> Ends<H> {
    /// A ring for each body or device, with this number of slots for publications of up to `most` parts. A ring without slots
    /// takes no memory and refuses all.
    pub fn new(slots: impl Iterator<Item = usize>, most: Extent) -> Self {
        let (mut to_tick, mut inlets, mut memory) = (Vec::new(), Vec::new(), Vec::new());
        let mut copies = 0;
        for slots in slots {
            copies += slots;
            let most = if slots > 0 { most } else { Extent::default() };
            let ((writer, reader), used) = prefaulted_packed_ring(slots, most);
            memory.extend(used);
            to_tick.push(writer);
            inlets.push(reader);
        }
        // Both threads of this ring may wait for a page, so the ring is not mapped in advance.
        let (copies, log) = packed_ring(copies, most);
        let host = Outlet {
            to_tick,
            copies,
            refused: 0,
            refused_copies: 0,
        };
        Self {
            host,
            tick: Inlets(inlets),
            log,
            memory,
        }
    }
}

/// The host's end.
#[derive(Debug)]
pub struct Outlet<H: Head> {
    to_tick: Vec<PackedWriter<H>>,
    copies: PackedWriter<H>,
    refused: u64,
    refused_copies: u64,
}

impl<H: Head> Outlet<H> {
    /// Publishes for a body. The sequence numbers of a body should start at one and increase by one.
    ///
    /// # Errors
    /// [`RingFull`] if the ring is full (the tick has taken nothing for the time of a stall), or if the body has no ring.
    /// The refused publication is counted.
    pub fn publish(
        &mut self,
        body: usize,
        publication: &impl Publication<Head = H>,
    ) -> Result<(), RingFull> {
        let Some(ring) = self.to_tick.get_mut(body) else {
            self.refused += 1;
            return Err(RingFull {
                kind: H::NAME,
                body,
                capacity: 0,
            });
        };
        // The copy for the log is pushed first. The log then finds it before any tick that used the publication.
        if !self.copies.is_abandoned() && !self.copies.push(body as u8, publication) {
            self.refused_copies += 1;
        }
        if !ring.push(body as u8, publication) {
            self.refused += 1;
            return Err(RingFull {
                kind: H::NAME,
                body,
                capacity: ring.capacity(),
            });
        }
        Ok(())
    }

    /// Number of publications that were refused.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Number of publications whose copy for the log found the ring full.
    pub fn refused_copies(&self) -> u64 {
        self.refused_copies
    }
}

/// The tick's end, by body.
#[derive(Debug)]
pub struct Inlets<H: Head>(Vec<PackedReader<H>>);

impl<H: Head> Inlets<H> {
    /// Calls `accept` with the newest publication for each body that has a new one, and discards the older ones. It stays
    /// in the ring while `accept` reads it. The time does not depend on the number of publications that wait.
    #[inline]
    pub fn take(&mut self, mut accept: impl FnMut(usize, &Packed<'_, H>)) {
        for (body, inlet) in self.0.iter_mut().enumerate() {
            inlet.take_newest(|newest| accept(body, newest));
        }
    }

    /// Number of bodies.
    pub fn bodies(&self) -> usize {
        self.0.len()
    }

    /// Publications that never arrived (gaps in their sequence), over all bodies.
    pub fn lost(&self) -> u64 {
        self.0.iter().map(PackedReader::lost).sum()
    }

    /// Publications that arrived together with a newer one for the same body, and were skipped.
    pub fn superseded(&self) -> u64 {
        self.0.iter().map(PackedReader::superseded).sum()
    }
}
