//! The operator's panel: orders to arm and to stop the devices of a run, an order to simulated hands, and the wrapper that passes
//! the orders to the tick.
//!
//! An order is a bit of the device's buttons ([`rt_core::engage`]). The log of the readings then holds the orders, and a
//! replay needs no other record of them. An order may come from any thread and from a signal handler, because the panel
//! consists of atomic values. Of two orders that come between two ticks, the later one decides. Orders at given times
//! serve rehearsals: the device passes each of them on in the tick at or after its time, under either clock.
//!
//! A simulated hand may press a button by order ([`Operated::with_take`]), so that a person takes hold with a tool without a device.
//! The button comes in addition to those that the hand presses by itself. The button of a real device is never touched.

use rt_core::engage::{ARM_ORDER, OWN_BUTTONS, STOP_ORDER};
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Probe, Wrench};
use runner::AnyDevice;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The operator's panel of a run. Clones are the same panel.
///
/// ```
/// use devices::panel::{Operated, Panel};
/// use devices::scripted::{Scripted, small};
/// use rt_core::engage::{ARM_ORDER, STOP_ORDER};
/// use rt_core::{Device, DeviceState, Freedom};
///
/// let panel = Panel::default();
/// let capabilities = small(Freedom::Three);
/// let device = Scripted::new(capabilities, |_| Ok(DeviceState::resting()), |_, _| Ok(()));
/// let mut device = Operated::new(Box::new(device), panel.clone(), &[]);
/// panel.arm();
/// assert_eq!(device.read(0)?.buttons, ARM_ORDER);
/// panel.stop();
/// assert_eq!(device.read(1_000_000)?.buttons, ARM_ORDER | STOP_ORDER);
/// # Ok::<(), rt_core::DeviceError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Whether the last order was a stop: 1, else 0.
    stopped: Arc<AtomicUsize>,
    /// Whether an order to arm waits for the next tick.
    arms: Arc<AtomicBool>,
    /// The bit of the orders to arm, which changes with each order.
    armed: Arc<AtomicBool>,
    /// Whether an order to take hold, or to let go, waits for the next tick.
    takes: Arc<AtomicBool>,
    /// Whether simulated hands take hold, which changes with each order.
    taken: Arc<AtomicBool>,
}

impl Panel {
    /// Arms the devices, and takes back an order to stop.
    pub fn arm(&self) {
        self.stopped.store(0, Ordering::Relaxed);
        self.arms.store(true, Ordering::Relaxed);
    }

    /// Stops the devices, until they are armed again.
    pub fn stop(&self) {
        self.stopped.store(1, Ordering::Relaxed);
    }

    /// Lets the simulated hands take hold of what their tools touch, and with the next of these orders let go.
    pub fn take(&self) {
        self.takes.store(true, Ordering::Relaxed);
    }

    /// The value that the handler of a signal sets to give the order [`Self::take`].
    pub fn for_take(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.takes)
    }

    /// The values that the handlers of two signals set. The first value is 1 after an order to stop, and 0 after an
    /// order to arm. An order to arm also sets the second value.
    pub fn for_handlers(&self) -> (Arc<AtomicUsize>, Arc<AtomicBool>) {
        (Arc::clone(&self.stopped), Arc::clone(&self.arms))
    }

    /// Whether simulated hands take hold, read by the tick.
    fn takes_hold(&self) -> bool {
        if self.takes.swap(false, Ordering::Relaxed) {
            self.taken.fetch_xor(true, Ordering::Relaxed);
        }
        self.taken.load(Ordering::Relaxed)
    }

    /// The orders as bits of buttons, read by the tick.
    fn bits(&self) -> u32 {
        if self.arms.swap(false, Ordering::Relaxed) {
            self.armed.fetch_xor(true, Ordering::Relaxed);
        }
        orders(
            self.armed.load(Ordering::Relaxed),
            self.stopped.load(Ordering::Relaxed) != 0,
        )
    }
}

/// The bits of the orders.
fn orders(armed: bool, stopped: bool) -> u32 {
    let arm = if armed { ARM_ORDER } else { 0 };
    let stop = if stopped { STOP_ORDER } else { 0 };
    arm | stop
}

/// An order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Arm the devices.
    Arm,
    /// Stop the devices.
    Stop,
    /// Let the simulated hands take hold, and the next time let go.
    Take,
}

impl Order {
    /// All orders.
    pub const ALL: [Self; 3] = [Self::Arm, Self::Stop, Self::Take];

    /// The order, in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Arm => "arm",
            Self::Stop => "stop",
            Self::Take => "take",
        }
    }
}

/// An order at a time of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedOrder {
    /// The order.
    pub order: Order,
    /// Its time (s).
    pub at: f64,
}

/// A device with an operator: its own buttons, and the orders of the panel and of a schedule.
pub struct Operated {
    device: AnyDevice,
    panel: Panel,
    /// The orders to come, the next one last.
    schedule: Vec<(u64, Order)>,
    armed: bool,
    stopped: bool,
    taken: bool,
    /// The buttons that the hand presses by order, as a mask.
    take: u32,
}

impl Operated {
    /// The `device` with the orders of the `panel`, and with those of a `schedule`.
    pub fn new(device: AnyDevice, panel: Panel, schedule: &[TimedOrder]) -> Self {
        let orders = schedule.iter();
        let mut schedule: Vec<_> = orders
            .map(|timed| ((timed.at.max(0.0) * 1e9) as u64, timed.order))
            .collect();
        // Orders of one time are obeyed as they are listed.
        schedule.sort_by_key(|(at, _)| *at);
        schedule.reverse();
        Self {
            device,
            panel,
            schedule,
            armed: false,
            stopped: false,
            taken: false,
            take: 0,
        }
    }

    /// The same device in a simulated hand, which presses these buttons (a mask) by order.
    #[must_use]
    pub fn with_take(self, buttons: u32) -> Self {
        Self {
            take: buttons,
            ..self
        }
    }

    /// Takes the orders of the schedule until `now_ns`.
    fn follow_schedule(&mut self, now_ns: u64) {
        while let Some((_, order)) = self.schedule.pop_if(|(at, _)| *at <= now_ns) {
            match order {
                Order::Arm => {
                    self.armed = !self.armed;
                    self.stopped = false;
                }
                Order::Stop => self.stopped = true,
                Order::Take => self.taken = !self.taken,
            }
        }
    }
}

impl Device for Operated {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.follow_schedule(now_ns);
        let mut state = self.device.read(now_ns)?;
        let scheduled = orders(self.armed, self.stopped);
        let panel = self.panel.bits();
        // An order to arm is a change of its bit, so two sources of orders are joined by their sum.
        let arm = (scheduled ^ panel) & ARM_ORDER;
        let stop = (scheduled | panel) & STOP_ORDER;
        if self.taken != self.panel.takes_hold() {
            state.buttons |= self.take;
        }
        state.buttons = state.buttons & OWN_BUTTONS | arm | stop;
        Ok(state)
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.device.write(now_ns, wrench)
    }

    fn probe(&self) -> Option<Probe> {
        self.device.probe()
    }

    fn motion_to_force_ns(&self) -> Option<u64> {
        self.device.motion_to_force_ns()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        self.device.refused_wrenches()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scripted::{Scripted, small};
    use rt_core::Freedom;

    fn pressed(buttons: u32) -> AnyDevice {
        let state = DeviceState {
            buttons,
            ..DeviceState::resting()
        };
        let capabilities = small(Freedom::Three);
        Box::new(Scripted::new(
            capabilities,
            move |_| Ok(state),
            |_, _| Ok(()),
        ))
    }

    #[test]
    fn no_device_gives_an_order_by_its_own_buttons() {
        let mut device = Operated::new(pressed(u32::MAX), Panel::default(), &[]);
        assert_eq!(device.read(0).expect("a state").buttons, OWN_BUTTONS);
    }

    #[test]
    fn scheduled_orders_come_in_the_tick_at_or_after_their_time_whatever_their_order() {
        let at = |order, at| TimedOrder { order, at };
        let schedule = [
            at(Order::Stop, 2e-3),
            at(Order::Arm, 1e-3),
            at(Order::Arm, 3.5e-3),
        ];
        let panel = Panel::default();
        let mut device = Operated::new(pressed(1), panel.clone(), &schedule);
        let mut read = |ms: u64| device.read(ms * 1_000_000).expect("a state").buttons;
        assert_eq!(read(0), 1);
        assert_eq!(read(1), 1 | ARM_ORDER);
        assert_eq!(read(2), 1 | ARM_ORDER | STOP_ORDER);
        assert_eq!(read(3), 1 | ARM_ORDER | STOP_ORDER);
        assert_eq!(read(4), 1);
        // An order of the panel is a change, too.
        panel.arm();
        assert_eq!(read(5), 1 | ARM_ORDER);
        panel.stop();
        assert_eq!(read(6), 1 | ARM_ORDER | STOP_ORDER);
        panel.arm();
        assert_eq!(read(7), 1);
        panel.stop();
        assert_eq!(read(8), 1 | STOP_ORDER);
    }

    #[test]
    fn an_order_of_the_panel_and_one_of_the_schedule_are_both_obeyed() {
        let at = |order| TimedOrder { order, at: 1e-3 };
        let panel = Panel::default();
        let schedule = [at(Order::Arm), at(Order::Stop)];
        let mut device = Operated::new(pressed(0), panel.clone(), &schedule);
        let mut read = |ms: u64| device.read(ms * 1_000_000).expect("a state").buttons;
        panel.arm();
        panel.stop();
        assert_eq!(read(0), ARM_ORDER | STOP_ORDER);
        // The second order to arm changes the bit again, and a second stop is a stop.
        assert_eq!(read(1), STOP_ORDER);
        panel.arm();
        // The stop of the schedule is not taken back by the panel.
        assert_eq!(read(2), ARM_ORDER | STOP_ORDER);
        assert_eq!(Order::ALL.map(Order::name), ["arm", "stop", "take"]);
    }

    #[test]
    fn an_order_to_take_presses_the_button_of_simulated_hands_alone_and_the_next_one_releases_it() {
        let panel = Panel::default();
        let operated = |own: u32| Operated::new(pressed(own), panel.clone(), &[]);
        // Two hands with tools of their own buttons, one of which presses the button by itself, and a real device.
        let mut devices = [
            operated(0).with_take(1),
            operated(2).with_take(2),
            operated(4),
        ];
        let mut read = || {
            devices
                .each_mut()
                .map(|device| device.read(0).expect("a state").buttons)
        };
        assert_eq!(read(), [0, 2, 4]);
        panel.take();
        assert_eq!(read(), [1, 2, 4]);
        assert_eq!(read(), [1, 2, 4]);
        panel.take();
        assert_eq!(read(), [0, 2, 4]);
    }

    #[test]
    fn a_scheduled_take_and_one_of_the_panel_take_turns() {
        let at = |at| TimedOrder {
            order: Order::Take,
            at,
        };
        let panel = Panel::default();
        let schedule = [at(1e-3), at(3e-3)];
        let mut device = Operated::new(pressed(0), panel.clone(), &schedule).with_take(1);
        let mut read = |ms: u64| device.read(ms * 1_000_000).expect("a state").buttons;
        assert_eq!([read(0), read(1)], [0, 1]);
        panel.take();
        assert_eq!([read(2), read(3)], [0, 1]);
    }

    #[test]
    fn all_but_the_orders_is_that_of_the_device() {
        /// A device that has every optional report.
        struct Talkative(Option<Wrench>);
        impl Device for Talkative {
            fn capabilities(&self) -> Capabilities {
                small(Freedom::Six)
            }
            fn read(&mut self, _: u64) -> Result<DeviceState, DeviceError> {
                Err(DeviceError::NoReport)
            }
            fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
                let is_new = self.0.replace(*wrench) != Some(*wrench);
                if now_ns == 7 && is_new {
                    Err(DeviceError::Busy)
                } else {
                    Ok(())
                }
            }
            fn probe(&self) -> Option<Probe> {
                let held = self.0?;
                Some(Probe {
                    pose: rt_core::Pose::identity(),
                    twist: rt_core::Twist::zero(),
                    held,
                    motor_work: 1.0,
                    on_hand: 2.0,
                })
            }
            fn motion_to_force_ns(&self) -> Option<u64> {
                Some(300)
            }
            fn refused_wrenches(&self) -> Option<u64> {
                Some(5)
            }
        }
        let mut device = Operated::new(Box::new(Talkative(None)), Panel::default(), &[]);
        let push = Wrench {
            force: rt_core::Vec3::x(),
            moment: rt_core::Vec3::zeros(),
        };
        assert_eq!(device.capabilities(), small(Freedom::Six));
        assert_eq!(device.read(0), Err(DeviceError::NoReport));
        assert_eq!(device.write(7, &push), Err(DeviceError::Busy));
        assert_eq!(device.probe().map(|probe| probe.held), Some(push));
        assert_eq!(device.motion_to_force_ns(), Some(300));
        assert_eq!(device.refused_wrenches(), Some(5));
    }

    #[test]
    fn of_two_orders_between_two_ticks_the_later_one_decides_for_every_device() {
        let panel = Panel::default();
        let mut devices =
            [pressed(1), pressed(1)].map(|device| Operated::new(device, panel.clone(), &[]));
        let mut read = |orders: &[fn(&Panel)]| {
            for order in orders {
                order(&panel);
            }
            let [left, right] = &mut devices;
            let states = [left, right].map(|device| device.read(0).expect("a state").buttons);
            assert_eq!(states[0], states[1]);
            states[0]
        };
        assert_eq!(read(&[Panel::arm, Panel::stop]), 1 | ARM_ORDER | STOP_ORDER);
        assert_eq!(read(&[]), 1 | ARM_ORDER | STOP_ORDER);
        assert_eq!(read(&[Panel::stop, Panel::arm]), 1);
        // Two orders to arm are an order to arm.
        assert_eq!(read(&[Panel::arm, Panel::arm]), 1 | ARM_ORDER);
    }
}
