//! The tick's entries with nothing around them: no standard library, no unwinding, opaque devices.
//!
//! What these functions can reach is linked, everything else is dropped. A panic that the compiler could
//! not rule out is left in the object as a call of the handler below, and so of [`law_can_panic`]. In the same way an
//! allocation is left as a call of [`law_can_allocate`].
#![no_std]

use core::alloc::{GlobalAlloc, Layout};
use core::panic::PanicInfo;
use rt_core::local_model::PackedModel;
use rt_core::tool::{PackedPatch, Tool};
use rt_core::velocity::VelocityEstimator;
use rt_core::{
    Capabilities, Controller, Device, DeviceError, DeviceState, LocalModel, Pose, Telemetry,
    TickRecord, Vec3, Wrench, cycle,
};

unsafe extern "Rust" {
    /// Defined nowhere: it stays undefined in the object exactly if a panic is reachable.
    safe fn law_can_panic() -> !;
    /// Defined nowhere: it stays undefined in the object exactly if an allocation is reachable.
    safe fn law_can_allocate(bytes: usize) -> *mut u8;
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

/// The memory of the heap, which the tick must not use. A controller allocates only when it is made.
struct Heap;

// SAFETY: the object is never run, because [`law_can_allocate`] has no definition.
unsafe impl GlobalAlloc for Heap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        law_can_allocate(layout.size())
    }
    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {
        law_can_allocate(0);
    }
}

#[global_allocator]
static HEAP: Heap = Heap;

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
        *law = law.clone();
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

/// A patch of a surface comes in from a ring: for any device. [`law_cycle`] uses it.
#[unsafe(no_mangle)]
pub fn law_accept_patch(law: &mut Controller, device: usize, patch: &PackedPatch<'_>) -> bool {
    law.accept_patch(device, patch).is_ok()
}

/// The same for a tool alone.
#[unsafe(no_mangle)]
pub fn law_tool_accept(tool: &mut Tool, patch: &PackedPatch<'_>) -> bool {
    tool.accept(patch).is_ok()
}

/// A tool in contact: any patch, any pose of the hand.
#[unsafe(no_mangle)]
pub fn law_tool_tick(tool: &mut Tool, hand: &Pose) -> Wrench {
    tool.tick(hand)
}
