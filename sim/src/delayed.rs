//! A simulated device that renders each wrench a given time after its command, as a real device does
//! ([`DeviceModel::output_delay`](devices::DeviceModel)).

use rt_core::{Capabilities, Device, DeviceError, DeviceState, Probe, Wrench};

/// Most wrenches that wait. At a rate of 10 kHz, they cover 6.4 ms.
const MOST: usize = 64;

/// A device whose wrenches arrive late.
#[derive(Clone, Debug)]
pub struct Delayed<D> {
    device: D,
    delay_ns: u64,
    /// The wrenches on their way, each with the time of its arrival (ns), the oldest first.
    waiting: heapless::Deque<(u64, Wrench), MOST>,
}

impl<D: Device> Delayed<D> {
    /// The `device`, with wrenches that arrive `delay` (s) after their command. A negative delay counts as none.
    pub fn new(device: D, delay: f64) -> Self {
        Self {
            device,
            delay_ns: (delay.max(0.0) * 1e9).round() as u64,
            waiting: heapless::Deque::new(),
        }
    }

    /// Gives the device the wrenches that have arrived by `now_ns`, each at its own time.
    fn arrive(&mut self, now_ns: u64) -> Result<(), DeviceError> {
        while let Some((at_ns, wrench)) = self.waiting.front().copied()
            && at_ns <= now_ns
        {
            let _ = self.waiting.pop_front();
            self.device.write(at_ns, &wrench)?;
        }
        Ok(())
    }
}

impl<D: Device> Device for Delayed<D> {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.arrive(now_ns)?;
        self.device.read(now_ns)
    }

    /// # Errors
    /// [`DeviceError::Busy`] if too many wrenches are on their way.
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.arrive(now_ns)?;
        let at_ns = now_ns.saturating_add(self.delay_ns);
        let pushed = self.waiting.push_back((at_ns, *wrench));
        pushed.map_err(|_| DeviceError::Busy)
    }

    fn probe(&self) -> Option<Probe> {
        self.device.probe()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        self.device.refused_wrenches()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DeviceModel, SimDevice};
    use rt_core::Vec3;

    #[test]
    fn a_force_acts_from_its_delay_on() {
        let model = DeviceModel {
            friction: 0.0,
            damping: 0.0,
            ..DeviceModel::named("omega3").expect("a built-in device")
        };
        let device = SimDevice::new(model, None, 1e-3).expect("a sound model");
        let mut device = Delayed::new(device, 2.5e-3);
        let wrench = Wrench {
            force: Vec3::new(1.0, 0.0, 0.0),
            moment: Vec3::zeros(),
        };
        for tick in 0..=10 {
            let now_ns = tick * 1_000_000;
            device.read(now_ns).expect("a state");
            let moved = device.probe().expect("it is simulated").pose.position.x;
            let acted = (now_ns as f64 * 1e-9 - 2.5e-3).max(0.0);
            let exact = 0.5 * acted * acted / model.mass;
            // Rounding of the substeps' sums.
            assert!((moved - exact).abs() < 1e-12, "{moved} {exact}");
            device.write(now_ns, &wrench).expect("there is room");
        }
    }
}
