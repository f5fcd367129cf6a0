//! The clutch between a device and its proxy. It opens when the device goes away, says that it renders no force, or is
//! disengaged, and closes as the force comes back.
//!
//! While a device is away, its hand moves without the scene. If the proxy followed at once when the device came back,
//! the body would store energy that no hand supplied, and the other hands would feel a blow. The proxy therefore
//! continues from where the device left it.
//!
//! While the force comes back, the hand feels a fraction `s` of the force `F`. If the proxy followed the whole
//! displacement `D` of its device, the body would store `F . D` while the hand supplied `s F . D`. A cap on the energy
//! gives back only what a hand supplied, so the hold that follows would be too soft. The proxy therefore follows by the
//! same fraction: its displacement is `s D`, and its rotation is the fraction `s` of the device's. The clutch is then a
//! transformer: it neither makes nor dissipates energy.

use crate::device::DeviceState;
use crate::device_frame::DeviceFrame;
use crate::safety::Limiter;

/// The state of the clutch between one device and its proxy.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clutch {
    slips: bool,
}

impl Clutch {
    /// A closed clutch: the proxy follows its device.
    pub fn new() -> Self {
        Self::default()
    }

    /// The clutch before the first tick: open if the force of `limiter` has yet to come in. The proxy then waits
    /// until the device is engaged, wherever the hand holds the device.
    pub fn before(limiter: &Limiter) -> Self {
        Self {
            slips: limiter.fraction() < 1.0,
        }
    }

    /// Whether the proxy does not follow the whole motion of its device.
    pub fn is_open(&self) -> bool {
        self.slips
    }

    /// Follows the device from its state `before` to its state `now`. `limiter` knows the fraction of the force that
    /// passed last. `frame` slips by the rest of the displacement.
    pub fn follow(
        &mut self,
        limiter: &Limiter,
        frame: &mut DeviceFrame,
        before: &DeviceState,
        now: &DeviceState,
    ) {
        self.slips |= limiter.is_apart();
        if self.slips {
            let fraction = limiter.fraction();
            frame.slip(1.0 - fraction, before, now);
            self.slips = fraction < 1.0;
        }
    }

    /// Fraction of the device's motion that its proxy follows at present.
    pub fn fraction(&self, limiter: &Limiter) -> f64 {
        if self.slips { limiter.fraction() } else { 1.0 }
    }
}

#[cfg(test)]
mod tests;
