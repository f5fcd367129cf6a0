//! The loop that ticks with nothing around it but its thread: the rings, the histograms, the clock, opaque devices.
//!
//! `tests/tests/no_lock.rs` reads the assembly from `runner::thread::body::run` on. This crate only makes sure that the
//! function is there, for a device of which the compiler knows nothing.

use rt_core::{Capabilities, Controller, Device, DeviceError, DeviceState, Wrench};
use runner::link::TickEnd;
use runner::{AnyDevice, RunnerConfig, Stop, spawn};
use std::sync::Arc;

unsafe extern "Rust" {
    /// Stands for a driver's read.
    safe fn device_read(device: &mut Port, now_ns: u64) -> Result<DeviceState, DeviceError>;
    /// Stands for a driver's write.
    safe fn device_write(
        device: &mut Port,
        now_ns: u64,
        wrench: &Wrench,
    ) -> Result<(), DeviceError>;
}

/// A device of which the compiler knows nothing.
pub struct Port {
    /// What it can do.
    pub capabilities: Capabilities,
}

#[cfg(feature = "planted_spin")]
static HELD: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);

impl Device for Port {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        #[cfg(feature = "planted_spin")]
        while HELD.swap(true, std::sync::atomic::Ordering::Acquire) {}
        let state = device_read(self, now_ns);
        #[cfg(feature = "planted_spin")]
        HELD.store(false, std::sync::atomic::Ordering::Release);
        state
    }
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        device_write(self, now_ns, wrench)
    }
}

/// A device as the loop holds it, with the table of its functions.
#[unsafe(no_mangle)]
pub fn boxed(port: Port) -> AnyDevice {
    Box::new(port)
}

/// Starts a loop: any controller, any devices, any configuration.
#[unsafe(no_mangle)]
pub fn start(
    config: RunnerConfig,
    controller: Controller,
    devices: Vec<AnyDevice>,
    end: TickEnd,
    stop: Arc<Stop>,
) -> bool {
    spawn(config, controller, devices, end, stop).is_ok_and(|run| run.join().is_ok())
}
