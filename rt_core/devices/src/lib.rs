//! Haptic devices behind one door.
//!
//! - [`models`]: devices as data, one file each, with the source of every number. A device's model is its profile,
//!   whichever driver moves it.
//! - [`registry`]: drivers by name. Whoever runs a scene opens its devices through a [`Registry`] and knows of no driver
//!   more than that.
//! - Drivers: [`hid`] (real devices that speak Palpate's firmware protocol), [`replay`] (recorded readings). The driver of
//!   simulated devices is `sim::driver`, beside what it simulates.
//! - [`wire`]: the host's side of the firmware protocol. Device units end there.
//! - [`scripted`]: a device made of two functions, and [`conformance`]: what every [`Device`](rt_core::Device) keeps to,
//!   as one suite that every driver and every wrapper has to pass.
#![forbid(unsafe_code)]

pub mod conformance;
pub mod hid;
pub mod models;
pub mod registry;
pub mod replay;
pub mod scripted;
pub mod wire;

pub use hid::Hid;
pub use models::{DeviceFile, DeviceModel, RotationModel};
pub use registry::{Driver, Kind, OpenError, Registry, Request, Settings};
pub use replay::{Replay, ReplayDevice};
pub use runner::AnyDevice;
pub use scripted::Scripted;
