//! A device made of two functions: one reads, and the other writes. Tests script the device, and benchmarks record the
//! calls.

use rt_core::Reading;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Freedom, Wrench};

/// A device whose calls run two functions. The functions own any data that an observer also reads.
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
    /// A device whose reads call `read` and whose writes call `write`. Both receive the time of the tick (ns).
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

/// The capabilities of a small desktop device: 8 N within 0.1 m, counts of 10 um, and 1 N m if it has six degrees of
/// freedom.
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
