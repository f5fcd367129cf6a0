//! Devices of any other kind, by a shared library with a C interface.
//!
//! `plugin/palpate_device.h` is the interface, and `plugin/example.c` an example. Vendors' libraries allocate, lock and
//! block, so a plug-in is never called by the tick: each of its devices has a thread of its own
//! ([`exchange`](crate::exchange)). A device that hangs, or whose states are no numbers, is a silent device to the tick.

pub(crate) mod abi;
mod library;

use crate::exchange::{Exchange, Exchanged};
use crate::registry::{Driver, Kind, OpenError, Request};
use library::{Library, Opened};
use nalgebra::{Quaternion, UnitQuaternion};
use rt_core::{
    Axes, Capabilities, Corruption, DeviceError, DeviceState, Freedom, Pose, Rendering, Twist,
    Vec3, Wrench,
};
use runner::AnyDevice;
use std::path::{Path, PathBuf};

pub use library::PluginError;

/// Tolerance on the unit length of a quaternion: the tolerance of the loop itself.
const SKEW: f64 = 0.01;
/// Error number of a device that is not open (ENODEV).
const NO_DEVICE: i32 = 19;

/// The driver `plugin`. Addresses: `FILE` or `FILE:ADDRESS`, where only the plug-in reads `ADDRESS`. A relative file is
/// relative to the folder of the driver.
#[derive(Clone, Debug, Default)]
pub struct Plugins {
    folder: PathBuf,
}

impl Plugins {
    /// A driver that finds relative files in `folder`.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
        }
    }
}

impl Driver for Plugins {
    fn name(&self) -> &'static str {
        "plugin"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        let (file, address) = request
            .address
            .split_once(':')
            .unwrap_or((request.address, ""));
        if file.is_empty() {
            return Err(OpenError::Address {
                found: "nothing".into(),
                allowed: "plugin:FILE or plugin:FILE:ADDRESS, with the path of the plug-in's library",
            });
        }
        let device =
            open(&self.folder.join(file), address).map_err(|error| OpenError::Refused {
                source: Box::new(error),
                allowed: "a plug-in whose device can be opened",
            })?;
        Ok(Box::new(device.for_loop(request.period)))
    }
}

/// Opens a device of the plug-in in a file, and starts its thread.
///
/// # Errors
/// [`PluginOpenError`], which names the file and what to do.
pub fn open(path: &Path, address: &str) -> Result<Exchanged, PluginOpenError> {
    let library = Library::load(path)?;
    let (device, found) = library.open(address)?;
    let capabilities = capabilities(&found).ok_or_else(|| PluginOpenError::Capabilities {
        path: path.to_owned(),
        name: library.name().to_owned(),
        found: format!("{found:?}"),
    })?;
    let plugin = PluginDevice {
        library,
        address: address.to_owned(),
        device: Some(device),
        sensed: capabilities.sensed,
    };
    Exchanged::start(plugin, capabilities).map_err(PluginOpenError::Thread)
}

/// Why a device of a plug-in could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum PluginOpenError {
    /// The plug-in or its device.
    #[error(transparent)]
    Plugin(#[from] PluginError),
    /// The capabilities that the plug-in states are not those of a device.
    #[error(
        "the plug-in {path} ({name}) states capabilities that no device has: {found}; allowed: degrees of freedom x, y \
         or z, or x, y, z and the rotation; numbers above zero, and a largest moment exactly where a rotation is actuated",
        path = .path.display()
    )]
    Capabilities {
        /// The file.
        path: PathBuf,
        /// The name of the device.
        name: String,
        /// The capabilities that were found.
        found: String,
    },
    /// The system gave no thread.
    #[error("the system gave no thread for a device: {0}")]
    Thread(#[source] std::io::Error),
}

/// A device of a plug-in, as the thread of the device sees it.
struct PluginDevice {
    library: Library,
    address: String,
    /// `None` while the device is lost.
    device: Option<Opened>,
    sensed: Freedom,
}

impl Exchange for PluginDevice {
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        let Some(device) = &mut self.device else {
            return Err(DeviceError::Disconnected(NO_DEVICE));
        };
        let wrench = abi::Wrench {
            force: finite(&wrench.force),
            moment: finite(&wrench.moment),
        };
        match device.exchange(&wrench) {
            (abi::OK, state) => {
                state_of(&state, self.sensed).ok_or(DeviceError::Corrupt(Corruption::Range))
            }
            (code, _) if code < 0 => Err(DeviceError::Disconnected(code.saturating_neg())),
            // There is no new state.
            _ => Err(DeviceError::NoReport),
        }
    }

    fn release(&mut self) {
        self.device = None;
    }

    fn reopen(&mut self) -> Result<(), DeviceError> {
        // A device is closed before it is opened again.
        self.device = None;
        let gone = DeviceError::Disconnected(NO_DEVICE);
        let (device, found) = self.library.open(&self.address).map_err(|_| gone)?;
        if capabilities(&found).map(|found| found.sensed) != Some(self.sensed) {
            return Err(gone);
        }
        self.device = Some(device);
        Ok(())
    }
}

/// A vector for a plug-in, which never sees a component that is not finite.
fn finite(vector: &Vec3) -> [f64; 3] {
    let whole = vector.iter().all(|x| x.is_finite());
    if whole { (*vector).into() } else { [0.0; 3] }
}

/// The state that a plug-in filled in; `None` where it is no state.
pub(crate) fn state_of(state: &abi::State, sensed: Freedom) -> Option<DeviceState> {
    let mut pose = Pose::at(sensed.part(&Vec3::from(state.position)));
    let mut twist = Twist {
        linear: sensed.part(&Vec3::from(state.velocity)),
        angular: Vec3::zeros(),
    };
    if sensed.turns() {
        let [w, x, y, z] = state.orientation;
        let quaternion = Quaternion::new(w, x, y, z);
        if (quaternion.norm() - 1.0).abs() > SKEW || !quaternion.norm().is_finite() {
            return None;
        }
        pose.rotation = UnitQuaternion::from_quaternion(quaternion);
        twist.angular = Vec3::from(state.angular_velocity);
    }
    let state = DeviceState {
        pose,
        twist,
        buttons: state.buttons,
        device_time_ns: state.time_ns,
        rendering: rendering(state.rendering),
    };
    state.is_finite().then_some(state)
}

/// What a device of a plug-in renders. A number without a meaning may have one in a later version, so it does not count as
/// rendering.
fn rendering(number: u32) -> Rendering {
    let fault = number.checked_sub(abi::FAULT).map(u8::try_from);
    match (number, fault) {
        (abi::RENDERS, _) => Rendering::Commanded,
        (_, Some(Ok(fault))) => Rendering::Fault(fault),
        _ => Rendering::LetGo,
    }
}

/// The capabilities that a plug-in states; `None` where no device has them.
pub(crate) fn capabilities(found: &abi::Capabilities) -> Option<Capabilities> {
    let (sensed, actuated) = (freedom(found.sensed)?, freedom(found.actuated)?);
    let positive = |x: f64| x.is_finite() && x > 0.0;
    let numbers = [found.max_force, found.workspace_radius, found.position_step];
    let moment = if actuated.turns() {
        positive(found.max_moment)
    } else {
        found.max_moment == 0.0
    };
    (numbers.into_iter().all(positive) && moment).then_some(Capabilities {
        sensed,
        actuated,
        max_force: found.max_force,
        max_moment: found.max_moment,
        workspace_radius: found.workspace_radius,
        position_step: found.position_step,
    })
}

/// The degrees of freedom with these bits.
fn freedom(bits: u32) -> Option<Freedom> {
    match bits {
        0b1111 => Some(Freedom::Six),
        0b0111 => Some(Freedom::Three),
        1..=6 => Axes::new([bits & 1 != 0, bits & 2 != 0, bits & 4 != 0]).map(Freedom::Along),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn degrees_of_freedom_are_those_of_a_device() {
        assert_eq!(freedom(7), Some(Freedom::Three));
        assert_eq!(freedom(15), Some(Freedom::Six));
        let x = Axes::new([true, false, false]).map(Freedom::Along);
        assert_eq!(freedom(1), x);
        for bits in [0, 8, 9, 14, 16, u32::MAX] {
            assert_eq!(freedom(bits), None, "{bits}");
        }
    }

    #[test]
    fn a_plug_in_tells_what_its_device_renders() {
        for (number, expected) in [
            (0, Rendering::Commanded),
            (1, Rendering::LetGo),
            (2, Rendering::LetGo),
            (255, Rendering::LetGo),
            (256, Rendering::Fault(0)),
            (257, Rendering::Fault(1)),
            (511, Rendering::Fault(255)),
            (512, Rendering::LetGo),
            (u32::MAX, Rendering::LetGo),
        ] {
            let told = abi::State {
                rendering: number,
                ..abi::State::default()
            };
            let state = state_of(&told, Freedom::Three);
            assert_eq!(
                state.map(|state| state.rendering),
                Some(expected),
                "{number}"
            );
        }
    }

    #[test]
    fn a_missing_library_is_named() {
        let error = open(Path::new("no/such/library.so"), "").expect_err("no such file");
        assert!(error.to_string().contains("no/such/library.so"), "{error}");
    }

    proptest! {
        #[test]
        fn no_state_of_a_plug_in_reaches_the_tick_unless_it_is_valid(
            position in any::<[f64; 3]>(), orientation in any::<[f64; 4]>(), velocity in any::<[f64; 3]>(),
        ) {
            let state = abi::State { position, orientation, velocity, ..abi::State::default() };
            for sensed in [Freedom::Three, Freedom::Six] {
                if let Some(state) = state_of(&state, sensed) {
                    prop_assert!(state.is_finite());
                    prop_assert!((state.pose.rotation.coords.norm() - 1.0).abs() < 1e-9);
                }
            }
        }
    }
}
