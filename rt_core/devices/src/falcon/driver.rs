//! A Falcon as an [`Exchange`]: one packet out, and one packet in.
//!
//! The Falcon answers each packet, and sends none by itself. An exchange writes the torques for a wrench at the last
//! known position, and waits for the answer for a bounded time. An exchange takes about a millisecond, because of the
//! chip's latency timer and USB's frames, so it runs in a thread of its own.
//!
//! **Homing.** The counters of the encoders are relative to the references of the axes, which the device finds while a
//! person moves the grip once out and in. Until all three axes are homed, there is no state and no torque. The lights
//! show the state: red while an axis is not homed, green if the device is ready, blue while a force acts.
//!
//! **Axes.** Positions are relative to [`CENTRE`], in the axes of libnifalcon: x to the right, y up, z towards the
//! user.
//!
//! **Force.** The documented limit of the torques is 0.41 N m an arm, which is about 6 N sideways in the middle of the
//! workspace, and 5 N at 30 mm from it. A larger force is shortened, and keeps its direction.
//!
//! **Trouble.** Packets have no numbers. If an answer did not come, the driver waits for it once more before the next
//! packet, so that a late answer is not taken for the next one. An answer that comes before the device can have
//! received the packet belongs to an earlier packet. The driver discards it, because one answer too many would make
//! every later state late. A packet that is missing, cut or out of reach counts as one missing state. After [`STALE`]
//! missing states in a row the driver sends no torque, because the position is not known. After [`LOST`] in a row the
//! device counts as disconnected, so that [`Exchange::reopen`] uploads the firmware again: a Falcon that lost its power
//! supply stays on USB.

use super::boot::{self, BootError, Firmware, Tries};
use super::geometry::{CENTRE, Jacobian, STEP, WORKSPACE, angle_of, forward, torque_counts};
use super::packet::{Command, END, Framer, Lights, Report};
use crate::exchange::Exchange;
use crate::ftdi::{Buffer, Control, Ftdi, PACKET};
use rt_core::velocity::VelocityEstimator;
use rt_core::{Corruption, DeviceError, DeviceState, Pose, Rendering, Twist, Vec3, Wrench};
use std::time::Duration;

/// Longest wait for an answer.
pub const WAIT: Duration = Duration::from_millis(5);
/// Longest wait for an answer that did not come in time, before the next packet is sent.
pub const LATE: Duration = Duration::from_millis(10);
/// Number of exchanges in a row without a state after which no torque is sent.
pub const STALE: u32 = 3;
/// Number of exchanges in a row without an answer after which the device counts as disconnected.
pub const LOST: u32 = 50;
/// Shortest time (ns) from the write of a packet to its answer: sixteen bytes each way take 213 us at 1.5 Mbaud.
const SOONEST_NS: u64 = 200_000;
/// Most reads in one exchange, so that a stopped clock cannot prolong it.
const READS: u32 = 1000;
/// Most periods between two samples of the velocity.
const GAP: f64 = 100.0;
/// Distance from [`CENTRE`] beyond which no grip can be (m).
const FARTHEST: f64 = 2.0 * WORKSPACE;
/// Error number of a device that is not open (ENODEV).
const NO_DEVICE: i32 = 19;
/// Error number of a device that does not answer (ETIMEDOUT).
const SILENT: i32 = 110;

/// The settings of the driver.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The user's firmware.
    pub firmware: Firmware,
    /// Numbers of tries to upload it.
    pub tries: Tries,
    /// Usual period of the exchanges (s), for the estimate of the velocity.
    pub period: f64,
}

/// The reason why a Falcon could not be connected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FalconError {
    /// The USB device could not be opened.
    #[error(
        "the Falcon cannot be opened (system error {0}); check its USB cable, and that no other program uses it"
    )]
    Open(i32),
    /// The device does not run its firmware.
    #[error(transparent)]
    Boot(#[from] BootError),
}

impl FalconError {
    /// The error number of the system; that of a silent device if there is none.
    fn number(&self) -> i32 {
        match self {
            Self::Open(number) => *number,
            Self::Boot(error) => error.number().unwrap_or(SILENT),
        }
    }
}

/// Counts of the exchanges since the device was connected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Answers that could be used.
    pub good: u64,
    /// Exchanges without an answer in time.
    pub silent: u64,
    /// Answers that could not be used.
    pub corrupt: u64,
    /// Reads with answers to earlier packets, which were discarded.
    pub early: u64,
}

/// Opens the USB device; the error is the error number of the system.
pub type Open<T> = Box<dyn FnMut() -> Result<T, i32> + Send>;
/// A monotonic clock (ns).
pub type Clock = Box<dyn FnMut() -> u64 + Send>;

/// A Falcon behind an FTDI chip.
pub struct Falcon<T> {
    link: Option<T>,
    open: Open<T>,
    clock: Clock,
    settings: Settings,
    framer: Framer,
    estimator: VelocityEstimator,
    /// Time of the start of the device's clock (ns).
    started_ns: u64,
    /// Time of the packet that the last state answered (ns), and its position (m, from the centre).
    last: Option<(u64, Vec3)>,
    jacobian: Option<Jacobian>,
    homed: bool,
    /// Whether a wrench was commanded since the last state for which no torques were sent.
    withheld: bool,
    /// Time of the last packet to the device (ns).
    written_ns: u64,
    /// Whether the answer to the last packet has not come.
    owed: bool,
    /// Number of exchanges in a row without a state, and without an answer.
    stateless: u32,
    silent: u32,
    counts: Counts,
    trouble: Option<FalconError>,
}

impl<T: Ftdi> Falcon<T> {
    /// Opens the device with `open`, and makes it run its firmware. The driver calls `open` again whenever the device
    /// was lost. `clock` measures the waits and the device's time.
    ///
    /// # Errors
    /// [`FalconError`], which names the failure and its remedy.
    pub fn connect(
        open: impl FnMut() -> Result<T, i32> + Send + 'static,
        clock: impl FnMut() -> u64 + Send + 'static,
        settings: Settings,
    ) -> Result<Self, FalconError> {
        let mut falcon = Self::unopened(open, clock, settings);
        falcon.begin(falcon.settings.tries.uploads)?;
        Ok(falcon)
    }

    fn unopened(
        open: impl FnMut() -> Result<T, i32> + Send + 'static,
        clock: impl FnMut() -> u64 + Send + 'static,
        settings: Settings,
    ) -> Self {
        Self {
            link: None,
            open: Box::new(open),
            clock: Box::new(clock),
            framer: Framer::new(),
            estimator: VelocityEstimator::for_encoder(settings.period, STEP),
            settings,
            started_ns: 0,
            last: None,
            jacobian: None,
            homed: false,
            withheld: false,
            written_ns: 0,
            owed: false,
            stateless: 0,
            silent: 0,
            counts: Counts::default(),
            trouble: None,
        }
    }

    /// Forgets all state of the device, opens the device, and boots it with at most `uploads` uploads.
    fn begin(&mut self, uploads: u32) -> Result<(), FalconError> {
        self.link = None;
        self.forget();
        let mut link = (self.open)().map_err(FalconError::Open)?;
        let Settings {
            firmware, tries, ..
        } = &self.settings;
        let tries = Tries { uploads, ..*tries };
        boot::boot(&mut link, firmware, &tries, &mut self.clock)?;
        self.link = Some(link);
        self.started_ns = (self.clock)();
        Ok(())
    }

    fn forget(&mut self) {
        self.framer = Framer::new();
        self.estimator = VelocityEstimator::for_encoder(self.settings.period, STEP);
        self.last = None;
        self.jacobian = None;
        self.homed = false;
        self.withheld = false;
        self.owed = false;
        (self.stateless, self.silent) = (0, 0);
        self.counts = Counts::default();
    }

    /// Whether all axes have found their references.
    pub fn is_homed(&self) -> bool {
        self.homed
    }

    /// Counts of the exchanges.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The reason why the last [`reopen`](Exchange::reopen) failed.
    pub fn trouble(&self) -> Option<&FalconError> {
        self.trouble.as_ref()
    }

    /// The packet that commands `wrench` if the state of the device allows it.
    fn command(&mut self, wrench: &Wrench) -> Command {
        let jacobian = self
            .jacobian
            .filter(|_| self.homed && self.stateless < STALE);
        self.withheld |= jacobian.is_none() && wrench.force != Vec3::zeros();
        let torques = jacobian.map_or([0; 3], |jacobian| {
            torque_counts(&jacobian.torques(&wrench.force))
        });
        let acts = torques != [0; 3];
        Command {
            torques,
            lights: Lights {
                red: !self.homed,
                green: self.homed && !acts,
                blue: acts,
            },
            homing: !self.homed,
        }
    }

    /// Writes a packet and waits for the answer.
    fn answer(&mut self, command: &Command) -> Result<Report, DeviceError> {
        let link = self
            .link
            .as_mut()
            .ok_or(DeviceError::Disconnected(NO_DEVICE))?;
        if self.owed {
            // A late answer would count as the answer to this packet, and each later answer would be one packet late,
            // too.
            let _ = read(link, &mut self.framer, &mut self.clock, LATE, 0)?;
            for buffer in [Buffer::One, Buffer::Two] {
                link.control(Control::Purge(buffer)).map_err(failed)?;
            }
            self.framer.restart();
        }
        self.written_ns = (self.clock)();
        link.write(&command.encode()).map_err(failed)?;
        self.owed = true;
        let soonest_ns = self.written_ns.saturating_add(SOONEST_NS);
        let (answer, early) = read(link, &mut self.framer, &mut self.clock, WAIT, soonest_ns)?;
        self.counts.early = self.counts.early.saturating_add(early);
        self.owed = answer.is_none();
        answer.unwrap_or(Err(DeviceError::NoReport))
    }

    /// The state in a report.
    fn state(&mut self, report: &Report) -> Result<DeviceState, DeviceError> {
        self.homed = report.is_homed();
        if !self.homed {
            self.last = None;
            self.jacobian = None;
            return Err(DeviceError::NoReport);
        }
        let now_ns = (self.clock)();
        let angles = report.encoders.map(angle_of);
        let out_of_reach = DeviceError::Corrupt(Corruption::Range);
        let place = forward(&angles).ok_or(out_of_reach)?;
        let position = place - CENTRE;
        if position.norm() > FARTHEST {
            return Err(out_of_reach);
        }
        // If the mechanism is singular, the state is good, and there is no torque.
        self.jacobian = Jacobian::at(&place, &angles);
        let velocity = self.velocity(&position);
        self.last = Some((self.written_ns, position));
        let withheld = std::mem::take(&mut self.withheld);
        Ok(DeviceState {
            pose: Pose::at(position),
            twist: Twist {
                linear: velocity,
                angular: Vec3::zeros(),
            },
            buttons: u32::from(report.buttons),
            device_time_ns: now_ns.saturating_sub(self.started_ns),
            rendering: if withheld {
                Rendering::LetGo
            } else {
                Rendering::Commanded
            },
        })
    }

    /// The velocity (m/s) at a new position. The estimator takes one position per period. After missing states it
    /// therefore gets evenly interpolated positions, and after a longer silence it begins anew. The device reads its
    /// counters when a packet has come, so the time of the packet is that of the position. An answer that is read late
    /// thus makes no velocity.
    fn velocity(&mut self, position: &Vec3) -> Vec3 {
        let (last_ns, mut from) = self.last.unwrap_or((self.written_ns, *position));
        let gap = self.written_ns.saturating_sub(last_ns) as f64 * 1e-9;
        let mut periods = (gap / self.settings.period).round().max(1.0);
        if periods > GAP {
            self.estimator = VelocityEstimator::for_encoder(self.settings.period, STEP);
            (from, periods) = (*position, 1.0);
        }
        let mut velocity = Vec3::zeros();
        for k in 1..=periods as u32 {
            let between = from + (position - from) * (f64::from(k) / periods);
            velocity = self.estimator.update(&between);
        }
        velocity
    }
}

/// The error of the device for an error number of the system.
fn failed(number: i32) -> DeviceError {
    if boot::is_gone(number) {
        DeviceError::Disconnected(number)
    } else {
        DeviceError::NoReport
    }
}

/// Waits for an answer, at most for `wait`, and discards the answers that come before `soonest_ns`. Returns the newest
/// answer or the reason why it cannot be used, `None` if no answer came in time, and the number of reads with discarded
/// answers.
fn read<T: Ftdi>(
    link: &mut T,
    framer: &mut Framer,
    clock: &mut Clock,
    wait: Duration,
    soonest_ns: u64,
) -> Result<(Option<Result<Report, DeviceError>>, u64), DeviceError> {
    let start_ns = clock();
    let mut buffer = [0; PACKET];
    let mut early: u64 = 0;
    for _ in 0..READS {
        let passed_ns = clock().saturating_sub(start_ns);
        let left = wait.saturating_sub(Duration::from_nanos(passed_ns));
        if left.is_zero() {
            break;
        }
        let count = link.read(&mut buffer, left).map_err(failed)?;
        let mut newest = None;
        for byte in buffer.iter().take(count) {
            let refused = framer.refused;
            if let Some(packet) = framer.push(*byte) {
                let report = Report::decode(&packet);
                newest = Some(report.map_err(|_| DeviceError::Corrupt(Corruption::Range)));
            } else if *byte == END && framer.refused > refused {
                newest = Some(Err(DeviceError::Corrupt(Corruption::Length)));
            }
        }
        if newest.is_some() && clock() < soonest_ns {
            early = early.saturating_add(1);
        } else if newest.is_some() {
            return Ok((newest, early));
        }
    }
    Ok((None, early))
}

impl<T: Ftdi> Exchange for Falcon<T> {
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        let command = self.command(wrench);
        let answer = self.answer(&command);
        let count = match &answer {
            Ok(_) => &mut self.counts.good,
            Err(DeviceError::Corrupt(_)) => &mut self.counts.corrupt,
            Err(_) => &mut self.counts.silent,
        };
        *count = count.saturating_add(1);
        self.silent = match answer {
            Ok(_) => 0,
            Err(_) => self.silent.saturating_add(1),
        };
        let state = match answer {
            Err(DeviceError::NoReport) if self.silent >= LOST => {
                Err(DeviceError::Disconnected(SILENT))
            }
            answer => answer.and_then(|report| self.state(&report)),
        };
        self.stateless = match state {
            Ok(_) => 0,
            Err(_) => self.stateless.saturating_add(1),
        };
        if let Err(DeviceError::Disconnected(_)) = state {
            // The next device must not get a torque for this one's position.
            self.link = None;
            self.jacobian = None;
        }
        state
    }

    fn release(&mut self) {
        if let Some(link) = &mut self.link {
            let zero = Command::default().encode();
            // Only a second try can help after a failure.
            let _ = link.write(&zero).or_else(|_| link.write(&zero));
        }
    }

    /// Opens the device again and makes it run its firmware. One upload at most suffices, because the caller repeats
    /// the call. A call may take ten seconds. If it fails, [`trouble`](Falcon::trouble) has the reason.
    fn reopen(&mut self) -> Result<(), DeviceError> {
        let result = self.begin(1);
        self.trouble = result.err();
        match &self.trouble {
            None => Ok(()),
            Some(error) => Err(DeviceError::Disconnected(error.number())),
        }
    }
}

#[cfg(test)]
mod tests;
