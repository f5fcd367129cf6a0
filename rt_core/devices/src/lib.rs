//! Haptic devices behind one interface.
//!
//! - [`models`]: devices as data, one file each, with the source of every number. A device has the same model under
//!   every driver.
//! - [`registry`]: drivers by name. The program that runs a scene opens its devices through a [`Registry`] and needs no
//!   other knowledge of a driver.
//! - Drivers: [`hid`] and [`serial`] (real devices that use Palpate's firmware protocol), [`woodenhaptics`] and [`falcon`] (devices with
//!   published protocols), [`replay`] (recorded readings). The driver of simulated devices is `sim::driver`, beside the
//!   simulation.
//! - [`transport`]: the connections that carry bytes. [`ftdi`]: FTDI's USB serial chips. [`usbfs`]: USB devices through
//!   the kernel. [`exchange`]: devices that may block, in a thread of their own.
//! - [`stated`]: the statements of a device about itself, compared with its profile.
//! - [`plugin`]: any other device, by a shared library with a C interface.
//! - [`wire`]: the host's side of the firmware protocol, which converts the units of the device to SI.
//! - [`panel`]: the operator's orders to arm and to stop the devices.
//! - [`found`]: the connected devices, and the reasons why a device cannot be used.
//! - [`identify`]: mass, damping and friction of a device, from a limited motion that its motors guide.
//! - [`response`]: the delay from a force to the motion that the device reports.
//! - [`scripted`]: a device made of two functions. [`conformance`]: the properties of every
//!   [`Device`](rt_core::Device), as one suite that every driver and every wrapper must pass.
#![deny(unsafe_code)]

pub mod conformance;
pub mod exchange;
pub mod falcon;
pub mod firmware;
pub mod found;
pub mod ftdi;
pub mod hid;
pub mod identify;
pub mod input;
pub mod models;
pub mod panel;
pub mod plugin;
pub mod registry;
pub mod replay;
pub mod response;
pub mod scripted;
pub mod serial;
pub mod stated;
pub mod transport;
pub mod usbfs;
pub mod wire;
pub mod woodenhaptics;

pub use exchange::{Exchange, Exchanged};
pub use hid::Hid;
pub use models::{DeviceFile, DeviceModel, RotationModel};
pub use registry::{Connection, Driver, Kind, OpenError, Registry, Request};
pub use replay::ReplayDevice;
pub use runner::AnyDevice;
pub use scripted::Scripted;
pub use serial::{Tcp, Tty};
pub use transport::Transport;
