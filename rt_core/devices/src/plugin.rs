//! Devices of any other kind, through a shared library with a C interface.
//!
//! `plugin/palpate_device.h` is the interface, and `plugin/example.c` an example. Vendors' libraries allocate, lock and
//! block, so the tick never calls a plug-in. Each device of a plug-in has its own thread
//! ([`exchange`](crate::exchange)). Vendors' libraries may also end their process, so each device also has its own
//! process, with which the thread exchanges (`process`). A device that hangs, or whose states are no numbers, is a
//! silent device to the tick. A device whose process has ended is a lost device.

pub mod abi;
mod library;
mod message;
mod process;

use crate::exchange::{Exchange, Exchanged};
use crate::registry::{Driver, Kind, OpenError, Request, file_of};
use crate::stated::{LEAST, Mismatch, Name, Stated};
use nalgebra::{Quaternion, UnitQuaternion};
use process::Process;
use rt_core::{
    Axes, Capabilities, Corruption, DeviceError, DeviceState, Freedom, Pose, Rendering, Twist,
    Vec3, Wrench,
};
use runner::AnyDevice;
use std::error::Error;
use std::path::PathBuf;

pub use library::PluginError;
pub use process::{EXCHANGE, OPEN, served};

/// Tolerance on the unit length of a quaternion: the tolerance of the loop itself.
const SKEW: f64 = 0.01;
/// Error number of a device that is not open (ENODEV).
const NO_DEVICE: i32 = 19;
/// This program.
const THIS: &str = "/proc/self/exe";

/// The driver `plugin`. Addresses: `FILE` or `FILE:ADDRESS`. Only the plug-in reads `ADDRESS`. A relative file is
/// relative to the folder of the driver.
#[derive(Clone, Debug)]
pub struct Plugins {
    folder: PathBuf,
    program: PathBuf,
}

impl Plugins {
    /// A driver that finds relative files in `folder`. The process of a plug-in is this program, which must call [`served`]
    /// first.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
            program: THIS.into(),
        }
    }

    /// The same driver with another program that calls [`served`].
    pub fn served_by(self, program: impl Into<PathBuf>) -> Self {
        Self {
            program: program.into(),
            ..self
        }
    }

    /// The path of the library in an address, and the address of the device that the plug-in reads.
    fn split<'a>(&self, address: &'a str) -> (PathBuf, &'a str) {
        let (file, address) = address.split_once(':').unwrap_or((address, ""));
        (self.folder.join(file), address)
    }

    /// Opens a device, and starts its thread.
    ///
    /// # Errors
    /// [`OpenError`], which names the file and the remedy.
    pub fn connect(&self, request: &Request<'_>) -> Result<Exchanged, OpenError> {
        let (path, address) = self.split(request.address);
        if request.address.split(':').next() == Some("") {
            return Err(OpenError::Address {
                found: "nothing".into(),
                allowed: "plugin:FILE or plugin:FILE:ADDRESS, with the path of the plug-in's library",
            });
        }
        let refused = |source: Box<dyn Error + Send + Sync>| OpenError::Refused {
            source,
            allowed: "a plug-in whose device can be opened",
        };
        let started = Process::start(&self.program, &path, address, request.priority);
        let (process, name, found) = started.map_err(|error| refused(error.into()))?;
        let Some(capabilities) = capabilities(&found) else {
            let found = format!("{found:?}");
            return Err(refused(
                PluginOpenError::Capabilities { path, name, found }.into(),
            ));
        };
        let stated = Stated::new(&name, &capabilities);
        let limits = request.agree(&stated, LEAST).map_err(|source| {
            let path = path.clone();
            refused(PluginOpenError::Profile { path, source }.into())
        })?;
        let plugin = PluginDevice {
            program: self.program.clone(),
            path,
            address: address.to_owned(),
            priority: request.priority,
            process: Some(process),
            name: stated.name,
            limits,
            told: false,
        };
        let device = Exchanged::start(plugin, limits, request.period, request.priority);
        device.map_err(|error| refused(PluginOpenError::Thread(error).into()))
    }
}

impl Driver for Plugins {
    fn name(&self) -> &'static str {
        "plugin"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn reaches(&self, address: &str) -> Vec<String> {
        let (path, address) = self.split(address);
        vec![format!("{} with {address:?}", file_of(&path))]
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        Ok(Box::new(self.connect(request)?))
    }
}

/// The reason why a device that a plug-in has opened is not used.
#[derive(Debug, thiserror::Error)]
pub enum PluginOpenError {
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
    /// The device is not that of its profile.
    #[error("the plug-in {path}: {source}", path = .path.display())]
    Profile {
        /// The file.
        path: PathBuf,
        /// The difference.
        source: Mismatch,
    },
    /// The system gave no thread.
    #[error("the system gave no thread for a device: {0}")]
    Thread(#[source] std::io::Error),
}

/// A device of a plug-in, as the thread of the device sees it.
struct PluginDevice {
    program: PathBuf,
    path: PathBuf,
    address: String,
    /// Priority of the process.
    priority: u8,
    /// `None` while the device is lost.
    process: Option<Process>,
    /// The name that the plug-in gave its device first.
    name: Name,
    /// The limits that hold.
    limits: Capabilities,
    /// Whether the user was told that the process has ended.
    told: bool,
}

impl PluginDevice {
    /// One exchange.
    fn exchanged(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        let gone = DeviceError::Disconnected(NO_DEVICE);
        let process = self.process.as_mut().ok_or(gone)?;
        let wrench = abi::Wrench {
            force: finite(&wrench.force),
            moment: finite(&wrench.moment),
        };
        let answer = process.exchange(&wrench);
        if let Err(number) = answer
            && !std::mem::replace(&mut self.told, true)
        {
            // No other part of the run knows the cause. One message is enough, because the process may end again and
            // again.
            let (path, why) = (self.path.display(), process.why(number));
            eprintln!(
                "the plug-in {path} {why}. Its device is lost until a new process has opened it"
            );
        }
        match answer.map_err(DeviceError::Disconnected)? {
            (abi::OK, state) => {
                let state = state_of(&state, self.limits.sensed);
                state.ok_or(DeviceError::Corrupt(Corruption::Range))
            }
            (code, _) if code < 0 => Err(DeviceError::Disconnected(code.saturating_neg())),
            // There is no new state.
            _ => Err(DeviceError::NoReport),
        }
    }
}

impl Exchange for PluginDevice {
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        let result = self.exchanged(wrench);
        if let Err(DeviceError::Disconnected(_)) = result {
            self.process = None;
        }
        result
    }

    fn release(&mut self) {
        self.process = None;
    }

    fn reopen(&mut self) -> Result<(), DeviceError> {
        // A device is closed before it is opened again.
        self.process = None;
        let gone = DeviceError::Disconnected(NO_DEVICE);
        let started = Process::start(&self.program, &self.path, &self.address, self.priority);
        let (process, name, found) = started.map_err(|_| gone)?;
        let stated = Stated::new(&name, &capabilities(&found).ok_or(gone)?);
        // The device must be the same, and as strong as before.
        if stated.name != self.name || stated.agree(&self.limits, 1.0).is_err() {
            return Err(gone);
        }
        self.process = Some(process);
        Ok(())
    }
}

/// A vector for a plug-in. A plug-in never gets a component that is not finite.
fn finite(vector: &Vec3) -> [f64; 3] {
    let whole = vector.iter().all(|x| x.is_finite());
    if whole { (*vector).into() } else { [0.0; 3] }
}

/// The state that a plug-in filled in; `None` if it is not a valid state.
pub fn state_of(state: &abi::State, sensed: Freedom) -> Option<DeviceState> {
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

/// The rendering that a device of a plug-in reports. A number without a meaning may have one in a later version, so
/// such a number does not count as rendering.
fn rendering(number: u32) -> Rendering {
    let fault = number.checked_sub(abi::FAULT).map(u8::try_from);
    match (number, fault) {
        (abi::RENDERS, _) => Rendering::Commanded,
        (_, Some(Ok(fault))) => Rendering::Fault(fault),
        _ => Rendering::LetGo,
    }
}

/// The capabilities that a plug-in states; `None` if no device has them.
pub fn capabilities(found: &abi::Capabilities) -> Option<Capabilities> {
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
        for (bits, axes) in [
            (2, [false, true, false]),
            (3, [true, true, false]),
            (4, [false, false, true]),
            (5, [true, false, true]),
            (6, [false, true, true]),
        ] {
            assert_eq!(freedom(bits), Axes::new(axes).map(Freedom::Along));
        }
        for bits in [0, 8, 9, 14, 16, u32::MAX] {
            assert_eq!(freedom(bits), None, "{bits}");
        }
    }

    /// Numbers above zero, and a largest moment exactly if a rotation is actuated.
    #[test]
    fn capabilities_are_those_of_a_device() {
        let arm = abi::Capabilities {
            sensed: 15,
            actuated: 7,
            max_force: 5.0,
            max_moment: 0.0,
            workspace_radius: 0.1,
            position_step: 1e-5,
        };
        let expected = Capabilities {
            sensed: Freedom::Six,
            actuated: Freedom::Three,
            max_force: 5.0,
            max_moment: 0.0,
            workspace_radius: 0.1,
            position_step: 1e-5,
        };
        assert_eq!(capabilities(&arm), Some(expected));
        let turning = |max_moment| abi::Capabilities {
            actuated: 15,
            max_moment,
            ..arm
        };
        assert!(capabilities(&turning(0.5)).is_some());
        let wrong = [0.0, -1.0, f64::NAN, f64::INFINITY];
        for number in wrong {
            assert_eq!(capabilities(&turning(number)), None, "{number}");
            for place in 0..3 {
                let mut found = arm;
                let numbers = [
                    &mut found.max_force,
                    &mut found.workspace_radius,
                    &mut found.position_step,
                ];
                *numbers.into_iter().nth(place).expect("three") = number;
                assert_eq!(capabilities(&found), None, "{number} at {place}");
            }
        }
        let found = abi::Capabilities {
            max_moment: 0.5,
            ..arm
        };
        assert_eq!(capabilities(&found), None);
    }

    #[test]
    fn a_plug_in_sees_finite_wrenches_alone() {
        let vector = Vec3::new(1.5, -2.0, 0.25);
        assert_eq!(finite(&vector), [1.5, -2.0, 0.25]);
        for (place, wrong) in [(0, f64::NAN), (1, f64::INFINITY), (2, f64::NEG_INFINITY)] {
            let mut vector = vector;
            vector[place] = wrong;
            assert_eq!(finite(&vector), [0.0; 3]);
        }
    }

    /// A state with this orientation, of a device with six degrees of freedom.
    fn turned(orientation: [f64; 4]) -> Option<DeviceState> {
        let state = abi::State {
            orientation,
            ..abi::State::default()
        };
        state_of(&state, Freedom::Six)
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
    fn an_orientation_that_is_no_unit_quaternion_is_no_state() {
        let half = 0.5_f64.sqrt();
        let whole = turned([half, 0.0, 0.0, half]).expect("a quarter turn");
        let turn = whole.pose.rotation.scaled_axis();
        let quarter = std::f64::consts::FRAC_PI_2;
        assert!(
            (turn - Vec3::new(0.0, 0.0, quarter)).norm() < 1e-12,
            "{turn}"
        );
        for factor in [0.0, 0.5, 0.98, 1.02, 2.0, f64::NAN, f64::INFINITY] {
            assert_eq!(
                turned([factor * half, 0.0, 0.0, factor * half]),
                None,
                "{factor}"
            );
        }
        // Rounding of a library in single precision is no fault.
        for factor in [1.0 - 1e-6, 1.0 + 1e-6] {
            assert!(turned([factor * half, 0.0, 0.0, factor * half]).is_some());
        }
        // A device without a rotation may leave the field as it is.
        assert!(state_of(&abi::State::default(), Freedom::Three).is_some());
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
