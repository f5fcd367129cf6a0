//! A device made of two functions: one reads, one writes. Tests tell it what to do, and benchmarks keep what passed.

use rt_core::controller::Reading;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Freedom, Wrench};

/// A device that does what its functions do. What the functions share with whoever watches is theirs.
pub struct Scripted<R, W> {
    capabilities: Capabilities,
    read: R,
    write: W,
}

impl<R, W> Scripted<R, W>
where
    R: FnMut(u64) -> Reading,
    W: FnMut(u64, &Wrench) -> Result<(), DeviceError>,
{
    /// A device whose reads are `read` and whose writes are `write`; both are given the tick's time (ns).
    pub fn new(capabilities: Capabilities, read: R, write: W) -> Self {
        Self {
            capabilities,
            read,
            write,
        }
    }
}

impl<R, W> Device for Scripted<R, W>
where
    R: FnMut(u64) -> Reading,
    W: FnMut(u64, &Wrench) -> Result<(), DeviceError>,
{
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        (self.read)(now_ns)
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        (self.write)(now_ns, wrench)
    }
}

/// What a small desktop device of so many degrees of freedom can do: 8 N within 0.1 m, counts of 10 um; 1 N m where it
/// turns.
pub fn small(freedom: Freedom) -> Capabilities {
    Capabilities {
        sensed: freedom,
        actuated: freedom,
        max_force: 8.0,
        max_moment: if freedom == Freedom::Six { 1.0 } else { 0.0 },
        workspace_radius: 0.1,
        position_step: 1e-5,
    }
}
