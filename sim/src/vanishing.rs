//! A device that is gone for a while: a wrapper around any device.

use core::ops::Range;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};

/// A device that gives no states and renders no forces for a while. What it wraps moves on all the same.
#[derive(Clone, Debug)]
pub struct Vanishing<D> {
    device: D,
    /// When it is gone (s).
    gone: Option<Range<f64>>,
}

impl<D> Vanishing<D> {
    /// `device`, gone from the start of `gone` until its end (s).
    pub fn new(device: D, gone: Option<Range<f64>>) -> Self {
        Self { device, gone }
    }

    /// The device itself.
    pub fn device(&self) -> &D {
        &self.device
    }

    fn is_gone(&self, now_ns: u64) -> bool {
        let time = now_ns as f64 * 1e-9;
        self.gone.as_ref().is_some_and(|gone| gone.contains(&time))
    }
}

impl<D: Device> Device for Vanishing<D> {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        let state = self.device.read(now_ns);
        if self.is_gone(now_ns) {
            return Err(DeviceError::NoReport);
        }
        state
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        let none = Wrench::zero();
        let rendered = if self.is_gone(now_ns) { &none } else { wrench };
        self.device.write(now_ns, rendered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DeviceModel, SimDevice};
    use rt_core::Vec3;

    #[test]
    fn it_says_and_renders_nothing_while_it_is_gone() {
        let (_, model) = DeviceModel::all().next().expect("there are devices");
        let device = SimDevice::new(model, None, 1e-3).expect("a sound device");
        let mut device = Vanishing::new(device, Some(1.0..2.0));
        let push = Wrench {
            force: Vec3::x(),
            ..Wrench::zero()
        };
        for (now_ns, there) in [
            (999_999_999, true),
            (1_000_000_000, false),
            (1_999_999_999, false),
            (2_000_000_000, true),
        ] {
            assert_eq!(device.read(now_ns).is_ok(), there, "{now_ns} ns");
            assert_eq!(device.write(now_ns, &push), Ok(()));
            let rendered = if there { 1.0 } else { 0.0 };
            assert_eq!(device.device().force().x, rendered, "{now_ns} ns");
        }
    }
}
