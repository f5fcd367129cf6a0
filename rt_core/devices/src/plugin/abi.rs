//! The C structures of `plugin/palpate_device.h`, version 1.

use std::ffi::{c_char, c_int, c_void};

/// The version of the interface.
pub(super) const ABI: u32 = 1;
/// Success. A negative result is minus an error number, and any other result means that there is no new state.
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
pub struct State {
    /// Position (m).
    pub position: [f64; 3],
    /// Orientation: a unit quaternion, real part first.
    pub orientation: [f64; 4],
    /// Velocity (m/s).
    pub velocity: [f64; 3],
    /// Angular velocity (rad/s), world axes.
    pub angular_velocity: [f64; 3],
    /// Time of the device (ns).
    pub time_ns: u64,
    /// Buttons, a bit each.
    pub buttons: u32,
    /// `PALPATE_RENDERS`, or the reason why the device renders nothing.
    pub rendering: u32,
}

/// `palpate_capabilities`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Capabilities {
    /// Sensed axes, a bit each: x, y, z, and all rotations.
    pub sensed: u32,
    /// Actuated axes, as in `sensed`.
    pub actuated: u32,
    /// Largest force (N).
    pub max_force: f64,
    /// Largest moment (N m).
    pub max_moment: f64,
    /// Radius of the workspace (m).
    pub workspace_radius: f64,
    /// Smallest step of the position (m).
    pub position_step: f64,
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
