//! An emulated device as a USB gadget of the kernel, behind the host controller that the kernel emulates (`dummy_hcd`).
//!
//! The driver of the device then uses all the layers that it uses for a real device: usbcore, usbhid and hidraw for a
//! HID device ([`hid`]), usbfs for a device behind an FTDI chip ([`chip`]). On a machine with a real device controller,
//! the gadget appears at the other end of its cable.
//!
//! - [`gadget`]: the gadget itself, as a folder of configfs.
//! - [`hid`]: a HID device, by the kernel's function `hid`.
//! - [`functionfs`]: the bytes of FunctionFS, with which a program is a function of a gadget.
//! - [`ftdi`]: the answers of an FTDI chip to requests. [`chip`]: the emulated Falcon behind such a chip.
//!
//! Sources: the kernel's documentation *USB Gadget API*, *Linux USB gadget configured through configfs* and *How
//! FunctionFS works*, and the layouts of `linux/usb/functionfs.h` and `linux/usb/ch9.h`.

pub mod chip;
pub mod ftdi;
pub mod functionfs;
pub mod gadget;
pub mod hid;

pub use chip::Chip;
pub use gadget::{Gadget, GadgetError};
pub use hid::HidGadget;
