//! The registers between the firmware and its mechanism: encoders and switches in, forces of the motors out.
//!
//! On your own board, the registers belong to counters, inputs and amplifiers. Here the simulated mechanism
//! ([`crate::plant`]) replaces the hardware. The firmware proper uses only the registers of this file.

use core::cell::UnsafeCell;

/// The number of axes of the mechanism: x, y, z.
pub const AXES: usize = 3;
/// The length of one count of an encoder (nm).
pub const COUNT_NM: i32 = 10_000;
/// The position of the reference mark on each axis (counts from the origin of the device).
pub const MARK: i32 = 200;
/// The address of the registers, behind the memory that `memory.x` gives to the images.
const ADDRESS: usize = 0x2001_0000;

/// Bits of [`Registers::switches`].
pub mod switches {
    /// The emergency stop is pressed.
    pub const STOP: u32 = 1 << 0;
    /// The button of the handle is pressed.
    pub const BUTTON: u32 = 1 << 1;
    /// Asks the firmware to panic, for a test of the response. Leave the bit out on your own board.
    pub const PANIC: u32 = 1 << 2;
    /// Asks the firmware for an instruction that the processor does not have, for the same test: a hard fault.
    pub const TRAP: u32 = 1 << 3;
}

/// One register of 32 bits. Each access is one access of the processor, in the order of the program.
#[repr(transparent)]
pub struct Register(UnsafeCell<u32>);

// SAFETY: an access to an aligned word is indivisible on a Cortex-M, so no interrupt sees half of a value.
unsafe impl Sync for Register {}

impl Register {
    /// The value.
    pub fn get(&self) -> u32 {
        // SAFETY: the pointer comes from a reference, so the pointer is valid and aligned.
        unsafe { self.0.get().read_volatile() }
    }

    /// Sets the value.
    pub fn set(&self, value: u32) {
        // SAFETY: as in `get`; the cell permits a write through a shared reference.
        unsafe { self.0.get().write_volatile(value) }
    }

    /// The value as a signed number.
    pub fn signed(&self) -> i32 {
        self.get().cast_signed()
    }

    /// Sets the value as a signed number.
    pub fn set_signed(&self, value: i32) {
        self.set(value.cast_unsigned());
    }
}

/// The registers of the mechanism, in their order in memory.
#[repr(C)]
pub struct Registers {
    /// The counters of the encoders. A counter starts at any number, and wraps.
    pub counts: [Register; AXES],
    /// The counts at the reference marks, valid if the bit in `marked` is set.
    pub marks: [Register; AXES],
    /// Bit k: the mark of axis k has passed since the start.
    pub marked: Register,
    /// See [`switches`].
    pub switches: Register,
    /// The forces of the motors (uN, signed).
    pub forces: [Register; AXES],
    /// Not zero: the amplifiers are on.
    pub enable: Register,
}

/// The registers.
pub fn registers() -> &'static Registers {
    // SAFETY: the address is aligned memory of the board, no image places anything there, and every value of a register
    // is valid.
    unsafe { &*core::ptr::with_exposed_provenance(ADDRESS) }
}
