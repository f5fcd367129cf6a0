//! What stands in for the world: simulated devices, the hands that hold them, and clocks.
//!
//! Everything here is pure computation: no threads, files, wall clocks or printing, and two runs from the
//! same inputs give the same bits on every platform (sine, exponential and tangent come from `libm`; what
//! else is used is exactly rounded). Nothing but the [`adversary`] allocates once it is built, because a
//! simulated device also runs inside the real-time tick.
//!
//! Read [`device`] first: a hand ([`hand`], [`arm`]) that wants to be somewhere ([`tasks`], [`trajectory`], [`tremor`])
//! holds a device (its model is of `devices::models`); their motion is integrated between ticks (`dynamics`), and where its energy
//! goes is accounted for ([`energy`]). [`firmware`] puts a device behind the bytes of its real wire, [`faulty`] lets one
//! fail on time; [`driver`] opens what a scene asks for; [`clock`] says when periodic events are due; [`adversary`] searches for the
//! motion of a hand that gets most energy out of a controller.
#![forbid(unsafe_code)]

pub mod adversary;
pub mod arm;
pub mod clock;
mod curve;
pub mod device;
pub mod driver;
mod dynamics;
mod encoder;
pub mod energy;
pub mod faulty;
pub mod firmware;
pub mod hand;
pub mod tasks;
pub mod trajectory;
pub mod tremor;

pub use devices::models::{self, DeviceFile, DeviceModel, RotationModel};

pub use arm::{Arm, Wrist};
pub use clock::{Periodic, Ticks};
pub use device::{SimDevice, SimError};
pub use driver::{Held, Simulated};
pub use energy::{EnergyAccount, NetEnergy};
pub use faulty::{Fault, Faulty};
pub use firmware::Wired;
pub use hand::Hand;
pub use tasks::{Task, TaskError, TaskKind};
pub use trajectory::{Sine, Trajectory, TrajectoryError};
pub use tremor::{Tremor, TremorError};
