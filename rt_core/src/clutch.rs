//! The clutch between a device and its proxy: it opens when the device is gone, and closes as its force comes back.
//!
//! A device that was away took its hand along without the scene. Were its proxy to follow at once, the body would store
//! what no hand has put in, and the other hands would feel the blow: so the proxy goes on from where it was left.
//!
//! Were it then to follow whole while its hand feels a fraction `s` of the force, the hand would store `F . D` for
//! `s F . D`; a cap on the energy does not give back what nobody paid, and the hold that follows would be too soft. So
//! the proxy follows by the same fraction, `s D`, and turns by it: a transformer, which neither makes nor loses energy.

use crate::device::DeviceState;
use crate::device_frame::DeviceFrame;
use crate::safety::Limiter;

/// Between one device and its proxy.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clutch {
    slips: bool,
}

impl Clutch {
    /// Closed: the proxy follows its device.
    pub fn new() -> Self {
        Self::default()
    }

    /// The device has come from `before` to `now`, and felt meanwhile what `limiter` let pass last; what the clutch
    /// leaves behind of that is left out of `frame`.
    pub fn follow(
        &mut self,
        limiter: &Limiter,
        frame: &mut DeviceFrame,
        before: &DeviceState,
        now: &DeviceState,
    ) {
        self.slips |= limiter.is_stale();
        if self.slips {
            let fraction = limiter.fraction();
            frame.slip(1.0 - fraction, before, now);
            self.slips = fraction < 1.0;
        }
    }

    /// Fraction of the device's motion that its proxy follows now.
    pub fn fraction(&self, limiter: &Limiter) -> f64 {
        if self.slips { limiter.fraction() } else { 1.0 }
    }
}
