//! The handle: the registers of the mechanism in the units of a report.
//!
//! Change this file for your own mechanism: the kinematics turns the counts of the encoders into a pose, and a wrench
//! into the forces of the motors. The mechanism of this file is the simplest: each motor drives one axis.

use crate::registers::{AXES, COUNT_NM, MARK, Registers, switches};
use firmware_proto::device::{Inputs, Measured, Wrench};

/// Number of states over which the velocity is a mean. A single count in one state would be 10 mm/s.
const MEAN: usize = 4;
/// The period of the states (us).
pub const STATE_US: u32 = 1000;
/// A count in units of a report (0.1 um).
const COUNT: i32 = COUNT_NM / 100;
/// All axes in [`Registers::marked`].
const ALL: u32 = (1 << AXES) - 1;

/// The handle of the device.
pub struct Handle {
    registers: &'static Registers,
    /// The counts at the origin, once the marks have passed.
    origin: [i32; AXES],
    /// The last positions (0.1 um), the newest first.
    past: [[i32; AXES]; MEAN],
}

impl Handle {
    /// A handle, with the amplifiers off.
    pub fn new(registers: &'static Registers) -> Self {
        let new = Self {
            registers,
            origin: [0; AXES],
            past: [[0; AXES]; MEAN],
        };
        new.let_go();
        new
    }

    /// Searches the reference. Returns true once the marks of all axes have passed.
    pub fn find(&mut self) -> bool {
        let found = self.registers.marked.get() & ALL == ALL;
        if found {
            for (origin, mark) in self.origin.iter_mut().zip(&self.registers.marks) {
                *origin = mark.signed().wrapping_sub(MARK);
            }
            self.past = [self.position(); MEAN];
        }
        found
    }

    /// The position (0.1 um). The counters wrap, and so does the difference of two counts.
    fn position(&self) -> [i32; AXES] {
        let mut position = [0; AXES];
        for axis in 0..AXES {
            let count = self.registers.counts[axis]
                .signed()
                .wrapping_sub(self.origin[axis]);
            position[axis] = count.saturating_mul(COUNT);
        }
        position
    }

    /// The measurement for a state. Call this function once a state, because the velocity is the mean over the last
    /// states.
    pub fn measure(&mut self) -> Measured {
        let position = self.position();
        let [.., oldest] = self.past;
        let mut velocity = [0; AXES];
        for axis in 0..AXES {
            let step = position[axis].saturating_sub(oldest[axis]);
            // From 0.1 um over this number of states to um/s.
            velocity[axis] = step.saturating_mul(100_000 / STATE_US.cast_signed()) / MEAN as i32;
        }
        self.past.rotate_right(1);
        self.past[0] = position;
        Measured::Pose {
            position,
            orientation: [i16::MAX, 0, 0, 0],
            velocity,
            angular_velocity: [0; 3],
        }
    }

    /// The button, and whether the amplifiers are on.
    pub fn inputs(&self) -> Inputs {
        Inputs {
            buttons: u16::from(self.switches() & switches::BUTTON != 0),
            powered: self.registers.enable.get() != 0,
            limited: false,
        }
    }

    /// See [`switches`].
    pub fn switches(&self) -> u32 {
        self.registers.switches.get()
    }

    /// Sets the amplifiers.
    pub fn drive(&self, wrench: &Wrench) {
        for (register, &force) in self.registers.forces.iter().zip(&wrench.force) {
            register.set_signed(force);
        }
        self.registers.enable.set(1);
    }

    /// Switches the amplifiers off.
    pub fn let_go(&self) {
        self.registers.enable.set(0);
        for register in &self.registers.forces {
            register.set(0);
        }
    }
}
