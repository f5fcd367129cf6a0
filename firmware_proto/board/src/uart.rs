//! The UARTs of the board: CMSDK APB UART (Arm DDI 0479), each with room for one byte in each direction.
//!
//! Interrupts drive the line to the host ([`LINE`]), with a ring of bytes each way. The firmware of a faster board
//! would let a DMA controller move the bytes.

use crate::ring::Ring;
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

use crate::registers::Register;

/// Length of the ring of each direction: room for three packets.
const BYTES: usize = 256;
/// Cycles of the processor for one bit: 25 MHz by 16 is 1.56 Mbaud, the fastest that the UART can.
const CYCLES_A_BIT: u32 = 16;

/// Bits of `state`.
mod state {
    pub(super) const CANNOT_PUT: u32 = 1 << 0;
    pub(super) const CAN_TAKE: u32 = 1 << 1;
}

/// Bits of `control`: the directions, and their interrupts.
mod control {
    pub(super) const DIRECTIONS: u32 = 0b11;
    pub(super) const INTERRUPTS: u32 = 0b1100;
}

/// Bits of `interrupts`.
mod interrupts {
    pub(super) const SENT: u32 = 1 << 0;
    pub(super) const RECEIVED: u32 = 1 << 1;
}

/// The registers of a UART, in their order in memory.
#[repr(C)]
struct Layout {
    data: Register,
    state: Register,
    control: Register,
    interrupts: Register,
    divider: Register,
}

/// The registers of one UART.
pub struct Block {
    address: usize,
}

/// The UART of the line between a test and the simulated mechanism.
pub const UART1: Block = Block {
    address: 0x4000_5000,
};

impl Block {
    /// Starts without interrupts.
    pub const POLLED: u32 = control::DIRECTIONS;

    fn layout(&self) -> &Layout {
        // SAFETY: only this file makes blocks, and their addresses are the UARTs of the board.
        unsafe { &*core::ptr::with_exposed_provenance(self.address) }
    }

    /// Starts the UART; `control` has the directions and the interrupts.
    pub fn start(&self, control: u32) {
        self.layout().divider.set(CYCLES_A_BIT);
        self.layout().control.set(control);
    }

    /// Takes the byte that has come.
    pub fn take(&self) -> Option<u8> {
        let registers = self.layout();
        let come = registers.state.get() & state::CAN_TAKE != 0;
        come.then(|| registers.data.get() as u8)
    }

    /// Puts a byte on the line. Returns false, and does nothing, if the last byte has not gone yet.
    pub fn put(&self, byte: u8) -> bool {
        let registers = self.layout();
        let can = registers.state.get() & state::CANNOT_PUT == 0;
        if can {
            registers.data.set(byte.into());
        }
        can
    }
}

/// The interrupts that the firmware uses, with their numbers on the board.
#[derive(Clone, Copy)]
#[repr(u16)]
pub enum Interrupt {
    /// A byte has come on the line.
    Received = 0,
    /// A byte has left, or the firmware has put bytes into the ring.
    Sent = 1,
}

// SAFETY: the numbers are those of the board, and the enumeration does not change.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// The line to the host.
pub struct Line {
    uart: Block,
    incoming: Ring<BYTES>,
    outgoing: Ring<BYTES>,
    /// Number of zeros that have come: ends of packets.
    ends: AtomicU32,
}

/// The line to the host.
pub static LINE: Line = Line {
    uart: Block {
        address: 0x4000_4000,
    },
    incoming: Ring::new(),
    outgoing: Ring::new(),
    ends: AtomicU32::new(0),
};

impl Line {
    /// Starts the line.
    pub fn start(&self) {
        self.uart.start(control::DIRECTIONS | control::INTERRUPTS);
        for interrupt in [Interrupt::Received, Interrupt::Sent] {
            // SAFETY: no code relies on the absence of this interrupt.
            unsafe { NVIC::unmask(interrupt) };
        }
    }

    /// The number of ends of packets that have come; wraps.
    pub fn ends(&self) -> u32 {
        self.ends.load(Ordering::Acquire)
    }

    /// Takes the oldest byte from the host.
    pub fn take(&self) -> Option<u8> {
        self.incoming.take()
    }

    /// Sends all bytes, or no byte if room is missing: the host sees a gap in the sequence, never half a packet.
    pub fn send(&self, bytes: &[u8]) {
        if self.outgoing.room() >= bytes.len() {
            for &byte in bytes {
                self.outgoing.put(byte);
            }
            // Only the interrupt touches the UART, so the loop and the interrupt need no lock.
            NVIC::pend(Interrupt::Sent);
        }
    }

    /// Sends bytes without interrupts, for a firmware that has failed. Waits a bounded time for each byte.
    pub fn send_failed(&self, bytes: &[u8]) {
        for &byte in bytes {
            let mut patience = 16 * 10 * CYCLES_A_BIT;
            while !self.uart.put(byte) && patience > 0 {
                patience -= 1;
            }
        }
    }

    /// The interrupt [`Interrupt::Received`].
    pub fn received(&self) {
        self.uart.layout().interrupts.set(interrupts::RECEIVED);
        while let Some(byte) = self.uart.take() {
            // If the ring is full the byte is lost, and the check sum of the packet is wrong.
            self.incoming.put(byte);
            if byte == 0 {
                self.ends.fetch_add(1, Ordering::Release);
            }
        }
    }

    /// The interrupt [`Interrupt::Sent`].
    pub fn sent(&self) {
        self.uart.layout().interrupts.set(interrupts::SENT);
        while self.uart.layout().state.get() & state::CANNOT_PUT == 0 {
            let Some(byte) = self.outgoing.take() else {
                break;
            };
            self.uart.put(byte);
        }
    }
}
