//! The driver: an [`Exchange`] over any transport.
//!
//! An exchange sends the currents of a force, then waits for a report, ten milliseconds at most, and takes the newest.
//! Before the exchange sends, it discards the reports that already wait: the device sampled them before the last
//! currents were sent, and a queue would make every state late by its length.
//!
//! **Calibration.** The encoders count from the pose in which the device was switched on. The driver knows the position
//! only after it has set the counters in a known pose ([`WoodenHaptics::calibrate`]), or after the operator has held
//! the handle at the home position and pressed the button for calibration. Before that, states are missing and the
//! currents are zero. The same holds after the connection was lost and after the counters began anew.
//!
//! **Rendering.** The protocol does not report whether the device renders its wrenches. The driver knows when it sent
//! no currents for a wrench. The next state then reports that the device let go.
//!
//! **Time.** The protocol has no time, so the caller gives a clock to the driver. [`counted`] is a clock that counts
//! exchanges.

use super::counters::{Counters, Taken};
use super::geometry::{Geometry, GeometryError, Kinematics};
use super::report::{CurrentReport, EncoderReport, Form, LONG};
use super::velocity::Slope;
use crate::{Exchange, Transport};
use core::time::Duration;
use rt_core::{Corruption, DeviceError, DeviceState, Pose, Rendering, Twist, Vec3, Wrench};

/// Longest time for which an exchange waits for a report.
pub const WAIT: Duration = Duration::from_millis(10);
/// Largest number of reports read in one exchange: as many as the kernel queues.
pub const QUEUE: usize = 64;
/// Largest angle (rad) between a set counter and the first report that confirms it. The hand holds the handle still: at
/// a link of 0.2 m the angle is 10 mm.
const STILL: f64 = 0.05;
/// Error number of a device that is not open (ENODEV).
const NO_DEVICE: i32 = 19;
/// Number of exchanges in which a report must confirm the counters that were set.
const TRIES: u8 = 5;

/// The parameters of a device and its connection.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WoodenHapticsConfig {
    /// The mechanism, the encoders and the motors.
    pub geometry: Geometry,
    /// Length of the reports.
    pub form: Form,
    /// The position of the handle (m, device axes) at which the operator presses the button for calibration; `None`
    /// if the button has no effect.
    pub home: Option<Vec3>,
}

/// Counts of a device's reports. They only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Reports that gave a state, or would have given a state of a calibrated device.
    pub good: u64,
    /// Reports that were discarded because a newer one waited, or because they came before the currents were sent.
    pub superseded: u64,
    /// Reports of a wrong length, or with counters that no hand can cause.
    pub corrupt: u64,
    /// Exchanges without a report.
    pub silent: u64,
    /// Restarts of the device, seen by its counters.
    pub restarts: u64,
}

/// The reason why a device could not be opened.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OpenError {
    /// A parameter is out of its range.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The links do not reach the home position.
    #[error("the home position ({}, {}, {}) m is beyond the reach of the links", .0.x, .0.y, .0.z)]
    Home(Vec3),
    /// The connection was refused.
    #[error(
        "the WoodenHaptics cannot be opened (system error {0}). Check its cable, and your right to its hidraw file"
    )]
    System(i32),
}

/// The reason why a device is not calibrated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// The links do not reach the position.
    #[error("the links do not reach the position ({}, {}, {}) m; give the position of the handle in device axes", .0.x, .0.y, .0.z)]
    OutOfReach(Vec3),
    /// The device did not take the counters.
    #[error(
        "the device did not take the counters within {TRIES} reports: {0}. Hold the handle still, and try again"
    )]
    NotTaken(DeviceError),
}

/// Opens the connection of a device, or returns the error number of the system.
pub type Open<T> = dyn FnMut() -> Result<T, i32> + Send;
/// A clock (ns) that never goes back. The driver calls it once per exchange.
pub type Clock = dyn FnMut() -> u64 + Send;

/// A clock that advances by `period_ns` with each exchange, for a device that answers at a fixed rate.
pub fn counted(period_ns: u64) -> impl FnMut() -> u64 + Send {
    let mut now_ns = 0_u64;
    move || {
        now_ns = now_ns.saturating_add(period_ns);
        now_ns
    }
}

/// The driver's knowledge of the counters.
#[derive(Clone, Copy, Debug)]
enum Calibration {
    /// Nothing. The device keeps the flag of its button for calibration, so a flag counts only after a report without it.
    Missing { released: bool },
    /// Nothing, and an old flag must be cleared. To clear it, the driver sets the counters to their present values.
    Clearing([i16; 3]),
    /// The counters are to be set, or were set and no report has confirmed them yet.
    Setting {
        counts: [i64; 3],
        sent: bool,
        tries: u8,
    },
    /// The counters.
    Known(Counters),
}

impl Calibration {
    const UNKNOWN: Self = Self::Missing { released: false };

    fn setting(counts: [i64; 3], sent: bool, tries: u8) -> Self {
        Self::Setting {
            counts,
            sent,
            tries,
        }
    }
}

/// A WoodenHaptics. It has three degrees of freedom.
pub struct WoodenHaptics<T> {
    /// `None` while the device is lost, so that its name is free for the device that comes back.
    transport: Option<T>,
    open: Box<Open<T>>,
    clock: Box<Clock>,
    kinematics: Kinematics,
    form: Form,
    /// The counters at the home position.
    home: Option<[i64; 3]>,
    calibration: Calibration,
    /// Whether the reports from before the first exchange are discarded.
    begun: bool,
    /// Time of the clock at the first exchange (ns).
    origin_ns: Option<u64>,
    /// Time of the last exchange since the first (ns).
    last_ns: u64,
    slope: Slope,
    /// Whether a wrench was commanded since the last state for which no currents were sent.
    withheld: bool,
    counts: Counts,
}

impl<T: Transport> WoodenHaptics<T> {
    /// Opens a device by `open`, which [`Exchange::reopen`] calls again. `clock` gives the time of each exchange.
    ///
    /// # Errors
    /// [`OpenError`] if a parameter is out of its range, or if `open` fails.
    pub fn open(
        setup: &WoodenHapticsConfig,
        mut open: impl FnMut() -> Result<T, i32> + Send + 'static,
        clock: impl FnMut() -> u64 + Send + 'static,
    ) -> Result<Self, OpenError> {
        let kinematics = Kinematics::new(&setup.geometry)?;
        let home = match setup.home {
            None => None,
            Some(position) => {
                Some(counts_at(&kinematics, &position).ok_or(OpenError::Home(position))?)
            }
        };
        let transport = open().map_err(OpenError::System)?;
        Ok(Self {
            transport: Some(transport),
            open: Box::new(open),
            clock: Box::new(clock),
            kinematics,
            form: setup.form,
            home,
            calibration: Calibration::UNKNOWN,
            begun: false,
            origin_ns: None,
            last_ns: 0,
            slope: Slope::default(),
            withheld: false,
            counts: Counts::default(),
        })
    }

    /// The kinematics of the device.
    pub fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// Counts of the reports so far.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Whether the driver knows the position.
    pub fn is_calibrated(&self) -> bool {
        matches!(self.calibration, Calibration::Known(_))
    }

    /// Sets the counters of the device, whose handle must be held still at `position` (m, device axes). The currents are
    /// zero meanwhile. Takes two to six exchanges.
    ///
    /// # Errors
    /// [`CalibrationError`] if the links do not reach the position, or no report confirms the counters.
    pub fn calibrate(&mut self, position: &Vec3) -> Result<(), CalibrationError> {
        let counts =
            counts_at(&self.kinematics, position).ok_or(CalibrationError::OutOfReach(*position))?;
        // The currents must be zero before the counters change: the command that sets counters leaves them as they are.
        let mut last = self.exchange(&Wrench::zero());
        self.calibration = Calibration::setting(counts, false, TRIES);
        while let Calibration::Setting { .. } = self.calibration {
            if let Err(DeviceError::Disconnected(_)) = last {
                self.calibration = Calibration::UNKNOWN;
            } else {
                last = self.exchange(&Wrench::zero());
            }
        }
        match last {
            Ok(_) => Ok(()),
            Err(error) => Err(CalibrationError::NotTaken(error)),
        }
    }

    /// The report of the next exchange. There is no force unless the position is known.
    fn command(&mut self, force: &Vec3) -> CurrentReport {
        let is_known =
            matches!(&self.calibration, Calibration::Known(counters) if !counters.in_doubt());
        self.withheld |= !is_known && *force != Vec3::zeros();
        match &mut self.calibration {
            Calibration::Known(counters) if !counters.in_doubt() => {
                let angles = self.kinematics.angles(counters.counts());
                let currents = self.kinematics.currents(angles, force);
                CurrentReport {
                    currents: self.kinematics.limited(currents),
                    ..CurrentReport::default()
                }
            }
            Calibration::Setting {
                counts,
                sent,
                tries,
            } => {
                *tries = tries.saturating_sub(1);
                if core::mem::replace(sent, true) {
                    return CurrentReport::default();
                }
                CurrentReport::set_counters(counts.map(|count| count as i16))
            }
            Calibration::Clearing(raw) => {
                let command = CurrentReport::set_counters(*raw);
                self.calibration = Calibration::UNKNOWN;
                command
            }
            _ => CurrentReport::default(),
        }
    }

    fn send(&mut self, report: &CurrentReport) -> Result<(), DeviceError> {
        let bytes = report.encode();
        let bytes = bytes.get(..self.form.length()).unwrap_or(&bytes);
        let written = self.transport()?.write(bytes);
        written.map_err(DeviceError::Disconnected)
    }

    /// The connection, unless the device is lost.
    fn transport(&mut self) -> Result<&mut T, DeviceError> {
        let gone = DeviceError::Disconnected(NO_DEVICE);
        self.transport.as_mut().ok_or(gone)
    }

    /// Discards the reports that wait. At the first exchange, the report that the device sends unasked may still be
    /// under way.
    fn discard(&mut self) -> Result<(), DeviceError> {
        let mut wait = if self.begun { Duration::ZERO } else { WAIT };
        self.begun = true;
        let mut buffer = [0; LONG];
        for _ in 0..QUEUE {
            let length = self.transport()?.read(&mut buffer, wait);
            if length.map_err(DeviceError::Disconnected)? == 0 {
                break;
            }
            self.counts.superseded = self.counts.superseded.saturating_add(1);
            wait = Duration::ZERO;
        }
        Ok(())
    }

    /// Waits for a report, and returns the newest good one.
    fn newest(&mut self) -> Result<EncoderReport, DeviceError> {
        // The buffer is one byte longer than a report, so that a report that is too long can be detected.
        let mut buffer = [0_u8; LONG + 1];
        let mut newest = None;
        let mut fault = DeviceError::NoReport;
        let mut wait = WAIT;
        for _ in 0..QUEUE {
            let length = match self.transport()?.read(&mut buffer, wait) {
                Ok(0) => break,
                Ok(length) => length,
                // A report that arrived before the device disappeared is still good. The next exchange fails.
                Err(_) if newest.is_some() => break,
                Err(number) => return Err(DeviceError::Disconnected(number)),
            };
            wait = Duration::ZERO;
            let bytes = buffer.get(..length).unwrap_or(&buffer);
            if let Ok(report) = EncoderReport::decode(bytes, self.form) {
                let superseded = u64::from(newest.is_some());
                self.counts.superseded = self.counts.superseded.saturating_add(superseded);
                newest = Some(report);
            } else {
                self.counts.corrupt = self.counts.corrupt.saturating_add(1);
                fault = DeviceError::Corrupt(Corruption::Length);
            }
        }
        if newest.is_none() && fault == DeviceError::NoReport {
            self.counts.silent = self.counts.silent.saturating_add(1);
        }
        newest.ok_or(fault)
    }

    /// Time since the first exchange (ns).
    fn now_ns(&mut self) -> u64 {
        let clock_ns = (self.clock)();
        let origin_ns = *self.origin_ns.get_or_insert(clock_ns);
        self.last_ns = self.last_ns.max(clock_ns.saturating_sub(origin_ns));
        self.last_ns
    }

    /// The state in a report that arrived at `now_ns`.
    fn take(&mut self, report: &EncoderReport, now_ns: u64) -> Result<DeviceState, DeviceError> {
        let raw = report.motors();
        let taken = match &mut self.calibration {
            Calibration::Known(counters) => counters.take(raw, now_ns),
            _ => Taken::Counted,
        };
        if taken != Taken::Counted {
            self.counts.corrupt = self.counts.corrupt.saturating_add(1);
            if taken == Taken::Restarted {
                self.counts.restarts = self.counts.restarts.saturating_add(1);
                self.calibration = Calibration::UNKNOWN;
            }
            return Err(DeviceError::Corrupt(Corruption::Range));
        }
        self.counts.good = self.counts.good.saturating_add(1);
        if !self.is_calibrated() {
            // Earlier positions were counted from another pose.
            self.slope = Slope::default();
        }
        self.calibration = self.calibrated(report, now_ns);
        let Calibration::Known(counters) = &self.calibration else {
            return Err(DeviceError::NoReport);
        };
        let withheld = std::mem::take(&mut self.withheld);
        let position = self
            .kinematics
            .forward(self.kinematics.angles(counters.counts()));
        Ok(DeviceState {
            pose: Pose::at(position),
            twist: Twist {
                linear: self.slope.update(now_ns, &position),
                angular: Vec3::zeros(),
            },
            buttons: u32::from(report.is_pressed(self.form)),
            device_time_ns: now_ns,
            rendering: if withheld {
                Rendering::LetGo
            } else {
                Rendering::Commanded
            },
        })
    }

    /// The driver's knowledge of the counters after a good report.
    fn calibrated(&self, report: &EncoderReport, now_ns: u64) -> Calibration {
        let pressed = report.info == EncoderReport::CALIBRATE;
        let raw = report.motors();
        match (self.calibration, self.home) {
            (Calibration::Setting { counts, tries, .. }, _) => {
                let per_count = self.kinematics.angle_per_count();
                match Counters::set_to(counts, raw, STILL, per_count, now_ns) {
                    Some(counters) => Calibration::Known(counters),
                    None => Calibration::setting(counts, true, tries),
                }
            }
            (Calibration::Missing { released: true }, Some(home)) if pressed => {
                Calibration::setting(home, false, TRIES)
            }
            (Calibration::Missing { released: false }, Some(_)) if pressed => {
                Calibration::Clearing(raw)
            }
            (Calibration::Missing { .. }, _) => Calibration::Missing { released: !pressed },
            (other, _) => other,
        }
    }
}

impl<T: Transport> Exchange for WoodenHaptics<T> {
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        let result = self.exchanged(wrench);
        if let Err(DeviceError::Disconnected(_)) = result {
            self.transport = None;
        }
        result
    }

    fn release(&mut self) {
        // The device cuts its motors by itself if the report does not reach it.
        let _ = self.send(&CurrentReport::default());
    }

    fn reopen(&mut self) -> Result<(), DeviceError> {
        self.transport = None;
        let transport = (self.open)().map_err(DeviceError::Disconnected)?;
        self.transport = Some(transport);
        self.calibration = Calibration::UNKNOWN;
        self.begun = false;
        self.origin_ns = None;
        self.last_ns = 0;
        self.slope = Slope::default();
        self.withheld = false;
        let sent = self.send(&CurrentReport::default());
        if sent.is_err() {
            self.transport = None;
        }
        sent
    }
}

impl<T: Transport> WoodenHaptics<T> {
    /// One exchange.
    fn exchanged(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        self.discard()?;
        let command = self.command(&wrench.force);
        self.send(&command)?;
        let report = match self.newest() {
            Err(gone @ DeviceError::Disconnected(_)) => return Err(gone),
            report => report,
        };
        let now_ns = self.now_ns();
        let state = report.and_then(|report| self.take(&report, now_ns));
        if let Calibration::Setting { tries: 0, .. } = self.calibration {
            self.calibration = Calibration::UNKNOWN;
        }
        state
    }
}

/// The counters at `position` (m, device axes), rounded; `None` if the links do not reach it.
fn counts_at(kinematics: &Kinematics, position: &Vec3) -> Option<[i64; 3]> {
    let angles = kinematics.inverse(position)?;
    let counts = kinematics.counts(angles);
    Some(counts.map(|count| libm::round(count) as i64))
}

#[cfg(test)]
mod tests;
