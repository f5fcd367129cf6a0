//! Simulated devices, and the simulated hands that hold them.
//!
//! This crate is pure computation, without threads, files, wall clocks or printing. Two runs from the same inputs give
//! the same bits on every platform: sine, exponential and tangent come from `libm`, and all other operations are
//! exactly rounded. Only the [`emulated`] devices allocate after they are built, because a simulated device also runs
//! inside the real-time tick.
//!
//! Read [`device`] first. A hand ([`hand`], [`arm`]) with an aim ([`tasks`], [`trajectory`], [`trace`], [`tremor`]) holds a device
//! (its model is one of `devices::models`). `dynamics` integrates the motion of both between ticks, and [`energy`]
//! accounts for the energy of this motion. [`firmware`] puts a device behind the bytes of its reports, and [`delayed`]
//! behind the delay of its output. [`emulate`] contains whole devices behind a protocol, published or our own.
//! [`faulty`] makes a device fail at given times. [`driver`] and [`emulated`] open the devices of a scene.
#![forbid(unsafe_code)]

pub mod arm;
mod curve;
pub mod delayed;
pub mod device;
pub mod driver;
mod dynamics;
pub mod emulate;
pub mod emulated;
mod encoder;
pub mod energy;
pub mod faulty;
pub mod firmware;
pub mod hand;
pub mod protocol;
pub mod tasks;
pub mod trace;
pub mod trajectory;
pub mod tremor;

pub use devices::models::{self, DeviceFile, DeviceModel, RotationModel};

pub use arm::{Arm, Wrist};
pub use curve::minimum_jerk;
pub use delayed::Delayed;
pub use device::{SimDevice, SimError};
pub use driver::{Held, Simulated};
pub use emulated::EmulatedDriver;
pub use energy::{MechanicalEnergy, NetEnergy};
pub use faulty::{Fault, Faulty};
pub use firmware::Wired;
pub use hand::Hand;
pub use tasks::{Task, TaskError, TaskKind};
pub use trace::Trace;
pub use trajectory::{Sine, Trajectory, TrajectoryError};
pub use tremor::{Tremor, TremorError};
