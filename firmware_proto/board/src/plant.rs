//! The simulated mechanism behind the registers. The mechanism is no part of the firmware: delete this file for your
//! own board.
//!
//! Each axis is a mass with damping and friction, which a hand pulls to the origin like a spring. The steps are
//! semi-implicit Euler, and friction takes speed away down to rest. The handle starts away from the origin, and passes
//! the reference marks on its way. The counters start at arbitrary numbers, as real encoders do.
//!
//! A test has a second line, to the mechanism (UART1 of the board). Each byte is a command: `e` and `E` press and
//! release the emergency stop, `b` and `B` the button; `p` and `t` set the switches that ask for a panic and for a
//! trap. `?` asks for the truth: [`Truth`], in little-endian words. `c/plant.c` is the same mechanism in C.

use crate::registers::{AXES, COUNT_NM, MARK, Registers, registers, switches};
use crate::uart::{Block, UART1};

/// Mass (kg).
const MASS: f32 = 0.2;
/// Damping of mechanism and hand (N s/m).
const DAMPING: f32 = 4.0;
/// Friction of an axis (N).
const FRICTION: f32 = 0.05;
/// Stiffness of the hand (N/m).
const STIFFNESS: f32 = 100.0;
/// The distance from the origin at which the handle stops (m).
const REACH: f32 = 0.04;
/// Position at the start on each axis (m).
const START: f32 = 0.005;
/// The counters at the origin.
const ORIGIN: [i32; AXES] = [12_345, -6_789, 424_242];

/// The answer to a test, in words of 32 bits: the number of steps, the time that the processor slept
/// (cycles), the position (nm), the forces on the handle (uN), whether the amplifiers are on.
pub type Truth = [u32; 9];

/// The mechanism.
pub struct Plant {
    position: [f32; AXES],
    velocity: [f32; AXES],
    steps: u32,
}

impl Plant {
    /// A mechanism at rest, in front of the marks.
    pub const fn new() -> Self {
        Self {
            position: [START; AXES],
            velocity: [0.0; AXES],
            steps: 0,
        }
    }

    /// Moves the mechanism by `step` (s), and answers the line of a test. `slept` is for [`Truth`].
    pub fn step(&mut self, step: f32, slept: u32) {
        let registers = registers();
        self.steps = self.steps.wrapping_add(1);
        let mut forces = [0; AXES];
        for axis in 0..AXES {
            if registers.enable.get() != 0 {
                forces[axis] = registers.forces[axis].signed();
            }
            self.move_axis(axis, step, forces[axis] as f32 * 1e-6);
            self.encode(axis, registers);
        }
        self.listen(registers, &forces, slept);
    }

    fn move_axis(&mut self, axis: usize, step: f32, motor: f32) {
        let (position, velocity) = (&mut self.position[axis], &mut self.velocity[axis]);
        let force = motor - DAMPING * *velocity - STIFFNESS * *position;
        let free = *velocity + step / MASS * force;
        let brake = step / MASS * FRICTION;
        *velocity = if free > brake {
            free - brake
        } else if free < -brake {
            free + brake
        } else {
            0.0
        };
        let next = *position + step * *velocity;
        *position = next.clamp(-REACH, REACH);
        if *position != next {
            *velocity = 0.0;
        }
    }

    /// Sets the counter, and keeps the count at the mark once the handle has passed the mark.
    fn encode(&self, axis: usize, registers: &Registers) {
        let count = nm(self.position[axis]).div_euclid(COUNT_NM);
        registers.counts[axis].set_signed(ORIGIN[axis] + count);
        if count <= MARK {
            registers.marks[axis].set_signed(ORIGIN[axis] + MARK);
            registers.marked.set(registers.marked.get() | 1 << axis);
        }
    }

    fn listen(&self, registers: &Registers, forces: &[i32; AXES], slept: u32) {
        let Some(byte) = UART1.take() else { return };
        let set = |bit| registers.switches.set(registers.switches.get() | bit);
        let clear = |bit: u32| registers.switches.set(registers.switches.get() & !bit);
        match byte {
            b'e' => set(switches::STOP),
            b'E' => clear(switches::STOP),
            b'b' => set(switches::BUTTON),
            b'B' => clear(switches::BUTTON),
            b'p' => set(switches::PANIC),
            b't' => set(switches::TRAP),
            b'?' => {
                let [x, y, z] = self.position.map(|at| nm(at).cast_unsigned());
                let [fx, fy, fz] = forces.map(i32::cast_unsigned);
                let truth: Truth = [
                    self.steps,
                    slept,
                    x,
                    y,
                    z,
                    fx,
                    fy,
                    fz,
                    registers.enable.get(),
                ];
                for byte in truth.into_iter().flat_map(u32::to_le_bytes) {
                    UART1.put(byte);
                }
            }
            _ => {}
        }
    }
}

/// Begins to listen to a test.
pub fn start() {
    UART1.start(Block::POLLED);
}

/// Metres as nm; the reach is 40,000,000 nm.
fn nm(metres: f32) -> i32 {
    (metres * 1e9) as i32
}
