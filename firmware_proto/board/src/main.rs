//! Firmware of a haptic device on a Cortex-M4, in Rust.
//!
//! The protocol, the modes and the watchdog come from `firmware_proto`. The rest is the board: a line to the host
//! ([`uart`]), the time ([`clock`]), the handle and the registers ([`handle`], [`registers`]), and the response to a
//! failure ([`failure`]). The mechanism ([`plant`]) is simulated, and replaces the hardware. `c/` contains the same
//! firmware in C99. The book explains how to start from this example (`docs/src/devices.md`, "Firmware").
//!
//! The loop sleeps until a packet or a tick of 250 us has come. The loop then takes the packet, sets the amplifiers
//! and, in each fourth tick, sends a state. A wrench comes into force on arrival, and does not wait for the next state.
#![no_std]
#![no_main]

mod clock;
mod failure;
mod handle;
mod plant;
mod registers;
mod ring;
mod uart;

use clock::{Clock, TICK_US};
use core::num::NonZeroU8;
use cortex_m::peripheral::Peripherals;
use cortex_m_rt::{entry, exception};
use firmware_proto::device::{Device, Geometry};
use firmware_proto::report::{FirmwareVersion, Mode, Model, Sends, axes, fault};
use firmware_proto::stream::{Decoder, packet};
use handle::{Handle, STATE_US};
use plant::Plant;
use registers::{registers, switches};
use uart::{Interrupt, LINE};

/// Ticks from one state to the next.
const TICKS_A_STATE: u32 = STATE_US / TICK_US;
/// The search for the reference fails after this number of ticks: ten seconds.
const SEARCH_TICKS: u32 = 10_000_000 / TICK_US;

/// The capabilities of the device.
const MODEL: Model = Model {
    sensed: axes::TRANSLATIONS,
    actuated: axes::TRANSLATIONS,
    firmware: FirmwareVersion {
        major: 1,
        minor: 0,
        patch: 0,
    },
    max_force: 8_000_000,
    max_moment: 0,
    workspace_radius: 400_000,
    position_step_nm: registers::COUNT_NM.cast_unsigned(),
    rate: [1000; 2],
    sends: Sends::Poses,
    name: *b"board rust\0\0\0\0\0\0",
};

#[entry]
fn main() -> ! {
    let Some(core) = Peripherals::take() else {
        failure::halt()
    };
    let mut handle = Handle::new(registers());
    let mut device = Device::new(MODEL, Geometry::default());
    let mut decoder = Decoder::new();
    plant::start();
    let mut clock = Clock::start(core.SYST);
    LINE.start();
    // The zero ends all earlier bytes.
    LINE.send(&[0]);
    device.home();
    let (mut ticks, mut ends) = (clock::ticks(), LINE.ends());
    let (mut due, mut search, mut stopped) = (TICKS_A_STATE, 0, false);
    loop {
        clock::sleep_until(|| clock::ticks() != ticks || LINE.ends() != ends);
        ends = LINE.ends();
        while let Some(byte) = LINE.take() {
            if let Some(report) = decoder.push(byte) {
                // The device counts refused reports.
                let _ = device.receive(report, clock.now_us());
            }
        }
        let ticked = clock::ticks() != ticks;
        ticks = clock::ticks();
        if device.mode() == Mode::Homing && ticked {
            search += 1;
            if handle.find() {
                device.homed();
            } else if search > SEARCH_TICKS {
                device.fault(fault::HOMING);
            }
        }
        let switches = handle.switches();
        assert!(
            switches & switches::PANIC == 0,
            "the switch asks for a panic"
        );
        if switches & switches::TRAP != 0 {
            cortex_m::asm::udf();
        }
        if switches & switches::STOP != 0 {
            device.fault(fault::EMERGENCY_STOP);
            stopped = true;
        } else if stopped {
            // The stop was released: begin anew.
            device.reset();
            device.home();
            (stopped, search) = (false, 0);
        }
        let now_us = clock.now_us();
        let wrench = device.actuate(now_us);
        match device.mode() {
            Mode::Idle | Mode::Active => handle.drive(&wrench),
            Mode::Boot | Mode::Homing | Mode::Fault => handle.let_go(),
        }
        if ticks.wrapping_sub(due) < u32::MAX / 2 {
            // After a delay, the loop does not catch up.
            due = ticks.wrapping_add(TICKS_A_STATE);
            let report = device.report(now_us, handle.inputs(), &handle.measure());
            LINE.send(&packet(&report));
        }
    }
}

/// The tick: the hardware moves on.
#[exception]
fn SysTick() {
    static mut PLANT: Plant = Plant::new();
    clock::tick();
    PLANT.step(TICK_US as f32 * 1e-6, clock::slept());
}

/// The interrupts of the board, by their numbers.
#[exception]
unsafe fn DefaultHandler(number: i16) {
    const RECEIVED: i16 = Interrupt::Received as i16;
    const SENT: i16 = Interrupt::Sent as i16;
    match number {
        RECEIVED => LINE.received(),
        SENT => LINE.sent(),
        // No other interrupt is enabled.
        _ => failure::halt(),
    }
}

/// The number of the fault of a failed firmware: the first of the device's own numbers.
const FAILED: NonZeroU8 = NonZeroU8::MIN.saturating_add(127);
