//! Time: the tick of the hardware, the clock in us, and sleep until there is work.
//!
//! The clock counts the ticks of SysTick, and measures the part of the present tick by the counter of SysTick. A tick
//! that the processor misses is missing in the clock, too. The time and the simulated mechanism therefore always agree,
//! whatever delays an emulator has.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::asm;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};

/// Cycles of the processor in one us: 25 MHz.
pub const CYCLES_A_US: u32 = 25;
/// The period of the tick (us): the amplifiers are set 4,000 times a second.
pub const TICK_US: u32 = 250;
const CYCLES: u32 = TICK_US * CYCLES_A_US;

static TICKS: AtomicU32 = AtomicU32::new(0);
static SLEPT: AtomicU32 = AtomicU32::new(0);

/// The clock of the device.
pub struct Clock {
    last_us: u32,
}

impl Clock {
    /// Starts the tick.
    pub fn start(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(CYCLES - 1);
        timer.clear_current();
        timer.enable_counter();
        timer.enable_interrupt();
        Self { last_us: 0 }
    }

    /// The time (us). The time wraps, and never goes back.
    pub fn now_us(&mut self) -> u32 {
        loop {
            let ticks = ticks();
            let part = (CYCLES - 1).saturating_sub(SYST::get_current()) / CYCLES_A_US;
            // The next tick may begin between the two readings. In that case, read again.
            if ticks == TICKS.load(Ordering::Acquire) {
                let now_us = ticks.wrapping_mul(TICK_US).wrapping_add(part);
                // The counter may start over just before its interrupt comes.
                if now_us.wrapping_sub(self.last_us) < u32::MAX / 2 {
                    self.last_us = now_us;
                }
                return self.last_us;
            }
        }
    }
}

/// The number of ticks; wraps.
pub fn ticks() -> u32 {
    TICKS.load(Ordering::Acquire)
}

/// Counts a tick. The interrupt of SysTick calls it.
pub fn tick() {
    TICKS.fetch_add(1, Ordering::Release);
}

/// Sleeps until an interrupt has made `work` true.
pub fn sleep_until(work: impl Fn() -> bool) {
    let mut asleep = true;
    while asleep {
        // Interrupts wait here, so no interrupt comes between the check and the sleep. An interrupt still wakes the
        // processor, and runs after this section: the measured time is the time of the sleep alone.
        asleep = cortex_m::interrupt::free(|_| {
            if work() {
                return false;
            }
            let from = SYST::get_current();
            asm::wfi();
            // The counter counts down, and starts over after zero, when the next tick begins.
            let ticked = SCB::is_pendst_pending();
            let to = SYST::get_current();
            let start = if ticked || to > from {
                from + CYCLES
            } else {
                from
            };
            let slept = start - to;
            SLEPT.fetch_add(slept, Ordering::Relaxed);
            true
        });
    }
}

/// The time that the processor slept (cycles); wraps.
pub fn slept() -> u32 {
    SLEPT.load(Ordering::Relaxed)
}
