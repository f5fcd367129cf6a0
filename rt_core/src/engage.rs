//! Engagement: whether a device may render force at all.
//!
//! A device starts **disarmed** if its configuration asks for that. An order of the operator, or a button of the
//! device, arms the device. A device with a **dead-man button** renders force only while the hand holds the button. An
//! **emergency stop**, by an order or by a button of any device, stops every device at once. Each device must then be
//! armed again. The last stage ([`crate::safety`]) lets the force fade or return accordingly.
//!
//! Buttons and orders arrive as bits of [`DeviceState::buttons`](crate::DeviceState). A log of the readings therefore
//! contains them, and a replay engages at the same ticks. The orders use the two highest bits, which no device may set.

use crate::geometry::Vec3;

/// The bit of an order to arm. Each change of the bit is one order.
pub const ARM_ORDER: u32 = 1 << 30;
/// The bit of an order to stop. The order holds while the bit is set.
pub const STOP_ORDER: u32 = 1 << 31;
/// The bits that a device's own buttons may use.
pub const OWN_BUTTONS: u32 = !(ARM_ORDER | STOP_ORDER);

/// How a device is engaged. The buttons are masks of [`OWN_BUTTONS`]; an empty mask names no button.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EngageConfig {
    /// Whether the device is armed from the start.
    pub armed: bool,
    /// Buttons that arm the device when the hand presses one of them.
    pub arm: u32,
    /// Dead-man buttons: the device renders force only while the hand holds one of them.
    pub dead_man: u32,
    /// Buttons that stop every device.
    pub stop: u32,
    /// Time in which the force comes in after the device was engaged (s). Zero gives the whole force at once to a device
    /// that is engaged from the start, and [`SafetyConfig::recovery`](crate::safety::SafetyConfig::recovery) to every
    /// later engagement.
    pub ramp: f64,
    /// The force that carries the weight of the grip while the device is engaged (N, device axes). The weight takes the
    /// force up, so the force does no work on the hand, and no account counts it.
    pub grip_force: Vec3,
    /// Position of the device (m) at which the proxy waits until the device is engaged for the first time.
    pub waits_at: Vec3,
}

impl Default for EngageConfig {
    /// Engaged from the start, with the whole force, and without buttons.
    fn default() -> Self {
        Self {
            armed: true,
            arm: 0,
            dead_man: 0,
            stop: 0,
            ramp: 0.0,
            grip_force: Vec3::zeros(),
            waits_at: Vec3::zeros(),
        }
    }
}

impl EngageConfig {
    /// Whether the whole force passes in the first tick.
    pub fn is_whole_at_start(&self) -> bool {
        self.armed && self.dead_man == 0 && self.ramp <= 0.0
    }
}

/// Whether a device may render force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engaged {
    /// The device renders force.
    Yes,
    /// The device waits to be armed.
    Disarmed,
    /// The hand does not hold the dead-man button.
    HandsOff,
    /// The emergency stop acts, and the device waits to be armed again.
    Stopped,
}

/// The engagement of one device.
///
/// ```
/// use rt_core::engage::{ARM_ORDER, EngageConfig, Engaged, Engagement, STOP_ORDER};
///
/// // The first button is the dead-man button.
/// let config = EngageConfig { armed: false, dead_man: 1, ramp: 1.0, ..EngageConfig::default() };
/// let mut engagement = Engagement::new(config);
/// assert_eq!(engagement.see(0), Engaged::Disarmed);
/// // The operator arms the device, and the hand holds the button.
/// assert_eq!(engagement.see(ARM_ORDER), Engaged::HandsOff);
/// assert_eq!(engagement.see(ARM_ORDER | 1), Engaged::Yes);
/// // After an emergency stop, the device waits for another order.
/// assert_eq!(engagement.see(ARM_ORDER | STOP_ORDER | 1), Engaged::Stopped);
/// assert_eq!(engagement.see(ARM_ORDER | 1), Engaged::Stopped);
/// assert_eq!(engagement.see(1), Engaged::Yes);
/// ```
#[derive(Clone, Debug)]
pub struct Engagement {
    config: EngageConfig,
    armed: bool,
    stopped: bool,
    held: bool,
    /// The buttons of the last state; `None` before the first.
    before: Option<u32>,
}

impl Engagement {
    /// The engagement of a device before its first state.
    pub fn new(config: EngageConfig) -> Self {
        Self {
            config,
            armed: config.armed,
            stopped: false,
            held: config.dead_man == 0,
            before: None,
        }
    }

    /// Takes the buttons and orders of a state of the device.
    pub fn see(&mut self, buttons: u32) -> Engaged {
        let config = self.config;
        // A button that is down in the first state was not pressed for this run. An order may be older than that state.
        let before = self.before.replace(buttons);
        let before = before.unwrap_or(buttons & OWN_BUTTONS);
        let pressed = buttons & !before & config.arm != 0;
        let ordered = (buttons ^ before) & ARM_ORDER != 0;
        self.held = config.dead_man == 0 || buttons & config.dead_man != 0;
        if self.asks_to_stop() {
            self.stop();
        } else if pressed || ordered {
            self.armed = true;
            self.stopped = false;
        }
        self.engaged()
    }

    /// Whether the last state asks to stop every device.
    pub fn asks_to_stop(&self) -> bool {
        self.before.unwrap_or(0) & (self.config.stop | STOP_ORDER) != 0
    }

    /// Stops the device, until it is armed again.
    pub fn stop(&mut self) {
        self.stopped = true;
        self.armed = false;
    }

    /// Whether the device may render force.
    pub fn engaged(&self) -> Engaged {
        if self.stopped {
            Engaged::Stopped
        } else if !self.armed {
            Engaged::Disarmed
        } else if !self.held {
            Engaged::HandsOff
        } else {
            Engaged::Yes
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_device_without_a_configuration_is_engaged_from_the_start() {
        let mut engagement = Engagement::new(EngageConfig::default());
        assert_eq!(engagement.engaged(), Engaged::Yes);
        assert_eq!(engagement.see(0xffff), Engaged::Yes);
    }

    #[test]
    fn a_device_has_its_whole_force_at_once_only_if_nothing_has_to_happen_first() {
        for (armed, dead_man, ramp, whole) in [
            (true, 0, 0.0, true),
            (false, 0, 0.0, false),
            (true, 1, 0.0, false),
            (true, 0, 0.1, false),
            (false, 1, 0.1, false),
        ] {
            let config = EngageConfig {
                armed,
                dead_man,
                ramp,
                ..EngageConfig::default()
            };
            assert_eq!(config.is_whole_at_start(), whole, "{config:?}");
        }
    }

    #[test]
    fn a_button_arms_when_it_is_pressed_and_not_because_it_is_down() {
        let mut engagement = Engagement::new(EngageConfig {
            armed: false,
            arm: 0b10,
            ..EngageConfig::default()
        });
        for (buttons, engaged) in [
            (0b10, Engaged::Disarmed),
            (0b00, Engaged::Disarmed),
            (0b01, Engaged::Disarmed),
            (0b11, Engaged::Yes),
            (0b00, Engaged::Yes),
        ] {
            assert_eq!(engagement.see(buttons), engaged, "{buttons:b}");
        }
    }

    #[test]
    fn an_order_before_the_first_state_arms() {
        let mut engagement = Engagement::new(EngageConfig {
            armed: false,
            ..EngageConfig::default()
        });
        assert_eq!(engagement.see(ARM_ORDER), Engaged::Yes);
    }

    proptest! {
        /// For any actions of a device and an operator, force needs an order or a press after the last stop, and the
        /// dead-man button.
        #[test]
        fn force_needs_an_order_after_the_last_stop_and_the_dead_man_button(
            states in prop::collection::vec(any::<u32>(), 1..60),
            elsewhere in prop::collection::vec(any::<bool>(), 60),
            (arm, dead_man, stop) in (0..4_u32, 0..4_u32, 0..4_u32),
        ) {
            let config = EngageConfig { armed: false, arm, dead_man, stop, ..EngageConfig::default() };
            let mut engagement = Engagement::new(config);
            let (mut before, mut allowed) = (states[0] & OWN_BUTTONS, false);
            for (buttons, elsewhere) in states.iter().zip(elsewhere) {
                let ordered = (buttons ^ before) & ARM_ORDER != 0 || buttons & !before & arm != 0;
                allowed = (allowed || ordered) && buttons & (stop | STOP_ORDER) == 0;
                let holds = dead_man == 0 || buttons & dead_man != 0;
                prop_assert_eq!(engagement.see(*buttons) == Engaged::Yes, allowed && holds);
                if elsewhere {
                    engagement.stop();
                    prop_assert_eq!(engagement.engaged(), Engaged::Stopped);
                    allowed = false;
                }
                before = *buttons;
            }
        }
    }
}
