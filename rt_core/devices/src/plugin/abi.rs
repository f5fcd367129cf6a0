//! The C structures of `plugin/palpate_device.h`, version 1.

use std::ffi::{c_char, c_int, c_void};

/// The version of the interface.
pub(super) const ABI: u32 = 1;
/// Done. A negative result is minus an error number, and any other result means that there is no new state.
pub(super) const OK: c_int = 0;
/// The name of the function that a plug-in exports.
pub(super) const ENTRY: &std::ffi::CStr = c"palpate_plugin_entry";

/// `PALPATE_RENDERS`.
pub(super) const RENDERS: u32 = 0;
/// `PALPATE_FAULT`, the number of a device with the fault 0.
pub(super) const FAULT: u32 = 256;

/// `palpate_wrench`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Wrench {
    pub(super) force: [f64; 3],
    pub(super) moment: [f64; 3],
}

/// `palpate_state`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(crate) struct State {
    pub(crate) position: [f64; 3],
    pub(crate) orientation: [f64; 4],
    pub(crate) velocity: [f64; 3],
    pub(crate) angular_velocity: [f64; 3],
    pub(crate) time_ns: u64,
    pub(crate) buttons: u32,
    pub(crate) rendering: u32,
}

/// `palpate_capabilities`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub(crate) struct Capabilities {
    pub(crate) sensed: u32,
    pub(crate) actuated: u32,
    pub(crate) max_force: f64,
    pub(crate) max_moment: f64,
    pub(crate) workspace_radius: f64,
    pub(crate) position_step: f64,
}

/// `palpate_device`, which only the plug-in knows.
pub(super) type Device = *mut c_void;

/// `palpate_plugin`. A function that the plug-in lacks is `None`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Plugin {
    pub(super) abi: u32,
    pub(super) reserved: u32,
    pub(super) name: *const c_char,
    pub(super) open: Option<
        unsafe extern "C" fn(
            *const c_char,
            *mut Device,
            *mut Capabilities,
            *mut c_char,
            usize,
        ) -> c_int,
    >,
    pub(super) exchange: Option<unsafe extern "C" fn(Device, *const Wrench, *mut State) -> c_int>,
    pub(super) close: Option<unsafe extern "C" fn(Device)>,
}
