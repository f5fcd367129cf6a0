//! Emulated devices on the transports of the kernel, so that a real driver finds them as it finds a real device.
//!
//! The emulators themselves (`sim::emulate`) are computation: bytes and a time in, bytes out. This crate gives them a
//! clock and a listener: a [`Listener`] is a pty, a TCP port, a HID device of the kernel's uhid or a USB gadget, and [`serve()`]
//! passes bytes between the listener and an emulator until it is told to stop. [`usb::Chip`] serves a Falcon, which also
//! answers requests, as a USB gadget. An [`Attended`] device is calibrated by a person, and serves one host after the other.
#![deny(unsafe_code)]

pub mod attended;
pub mod listener;
pub mod serve;
pub mod uhid;
pub mod usb;

pub use attended::{Attended, ServeError};
pub use listener::{Listener, ListenerError};
pub use serve::{Served, serve};
