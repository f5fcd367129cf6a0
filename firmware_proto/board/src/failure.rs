//! The response to a failure of the firmware itself: no force, and a fault that the host sees.
//!
//! A panic and a hard fault both end here. The amplifiers are switched off first. The state of the old device may be
//! broken, so a new device, without a session, reports the fault until the power is switched off.

use crate::clock::CYCLES_A_US;
use crate::handle::{Handle, STATE_US};
use crate::registers::registers;
use crate::uart::LINE;
use crate::{FAILED, MODEL};
use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};
use firmware_proto::device::{Device, Geometry};
use firmware_proto::stream::packet;

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    halt()
}

#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    halt()
}

/// Lets go permanently, and reports the fault.
pub fn halt() -> ! {
    let mut handle = Handle::new(registers());
    let mut device = Device::new(MODEL, Geometry::default());
    device.fault(FAILED);
    let mut now_us = 0_u32;
    // The zero ends the packet that the failure cut off.
    LINE.send_failed(&[0]);
    loop {
        handle.let_go();
        let report = device.report(now_us, handle.inputs(), &handle.measure());
        LINE.send_failed(&packet(&report));
        // A fault may have stopped the clock: count cycles.
        cortex_m::asm::delay(STATE_US * CYCLES_A_US);
        now_us = now_us.wrapping_add(STATE_US);
    }
}
