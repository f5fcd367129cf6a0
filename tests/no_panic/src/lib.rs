//! The tick's entries with nothing around them: no standard library, no unwinding, opaque devices.
//!
//! What these functions can reach is linked, everything else is dropped. A panic that the compiler could
//! not rule out is left in the object as a call of the handler below, and so of [`law_can_panic`].
#![no_std]

use core::panic::PanicInfo;
use rt_core::local_model::PackedModel;
use rt_core::velocity::VelocityEstimator;
use rt_core::{
    Capabilities, Controller, Device, DeviceError, DeviceState, LocalModel, Telemetry, TickRecord,
    Vec3, Wrench, cycle,
};

unsafe extern "Rust" {
    /// Defined nowhere: it stays undefined in the object exactly if a panic is reachable.
    safe fn law_can_panic() -> !;
    /// Stands for a driver's read.
    safe fn device_read(device: &mut Port, now_ns: u64) -> Result<DeviceState, DeviceError>;
    /// Stands for a driver's write.
    safe fn device_write(
        device: &mut Port,
        now_ns: u64,
        wrench: &Wrench,
    ) -> Result<(), DeviceError>;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    law_can_panic()
}

/// A device of which the compiler knows nothing.
pub struct Port {
    /// What it can do.
    pub capabilities: Capabilities,
}

impl Device for Port {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        device_read(self, now_ns)
    }
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        device_write(self, now_ns, wrench)
    }
}

/// A model comes in: any model, for any body.
#[unsafe(no_mangle)]
pub fn law_accept(law: &mut Controller, body: usize, model: &LocalModel) -> bool {
    law.accept(body, model).is_ok()
}

/// A model comes in from a ring.
#[unsafe(no_mangle)]
pub fn law_accept_packed(law: &mut Controller, body: usize, model: &PackedModel<'_>) -> bool {
    law.accept(body, model).is_ok()
}

/// One whole tick: any controller, any number of devices, any time.
#[unsafe(no_mangle)]
pub fn law_cycle(
    law: &mut Controller,
    devices: &mut [&mut Port],
    now_ns: u64,
    telemetry: &mut Telemetry,
) -> u32 {
    let (record, refused) = cycle(law, devices, now_ns);
    *telemetry = record;
    #[cfg(feature = "planted")]
    {
        telemetry.tick = u64::from(telemetry.devices[refused as usize].buttons);
    }
    refused
}

/// What the tick leaves for the host.
#[unsafe(no_mangle)]
pub fn law_record(telemetry: &Telemetry, record: &mut TickRecord) {
    *record = telemetry.tick_record();
}

/// What drivers run inside the tick.
#[unsafe(no_mangle)]
pub fn law_velocity(estimator: &mut VelocityEstimator, position: &Vec3) -> Vec3 {
    estimator.update(position)
}
