//! The device's side: the wrench that the amplifiers apply, and its duration.
//!
//! [`Device`] is pure: it reads no clock and no port. The firmware passes each received report to
//! [`receive`](Device::receive), asks [`actuate`](Device::actuate) for the wrench each time it sets its amplifiers, and
//! sends the report of [`report`](Device::report) at its rate. All times are the device's own clock, in µs, and wrap. The
//! firmware calls `actuate` at least every 35 minutes.
//!
//! | mode       | force            | leaves for                                                       |
//! |------------|------------------|------------------------------------------------------------------|
//! | `Boot`     | none             | `Homing` ([`home`](Device::home))                                |
//! | `Homing`   | none of the host | `Idle` ([`homed`](Device::homed))                                |
//! | `Idle`     | none             | `Active` (an accepted wrench), `Homing` ([`home`](Device::home)) |
//! | `Active`   | the host's       | `Idle` (the watchdog, or a wrench without `ENABLE`)              |
//! | `Fault`    | none             | `Boot` ([`reset`](Device::reset), which ends the session)        |
//!
//! Every mode leaves for `Fault` by [`fault`](Device::fault).
//!
//! A wrench is applied only if its report is intact and of this version, in range and of the session; if its sequence
//! number is newer than that of the last wrench; if it answers a state that is not older than the watchdog, and that was
//! sent after the watchdog last let go; if it does not exceed the largest force and moment; and if `ENABLE` is set. The
//! device refuses and counts any other wrench, and never shortens a wrench to fit. A wrench without `ENABLE` only lets
//! go, and needs only the session.
//!
//! A host may compute a wrench before it can know that the watchdog let go. Such a wrench cannot bring the force back:
//! the first wrench that the device accepts afterwards answers a state that reports the let-go.
//!
//! The answer to a hello replaces states: the capabilities and, for a device that sends counts, the geometry and the
//! joints, in one report each. A repetition of the hello during its answer changes nothing.
//!
//! A hello of another session opens that session, unless the device is active, so a second host cannot take a device
//! from the first. The session of a host that has gone ends with the watchdog of that session.

use crate::report::{
    CapabilitiesReport, Condition, ENCODERS, EncodersReport, GeometryReport, HelloReport,
    JointReport, Kind, LENGTH, Mode, Model, PARAMETERS, Quantity, Report, ReportError, Sends,
    StateReport, WATCHDOG_US, WrenchReport, flags, status,
};
use core::fmt;
use core::num::NonZeroU8;

/// The number of runs of states that a device remembers.
const RUNS: usize = 32;
/// A run lasts at most the watchdog divided by this number, so that the runs together span a watchdog.
const PARTS: u32 = RUNS as u32 - 1;

/// The conversion of the counts of one encoder to an angle or a length; see [`JointReport`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joint {
    /// See [`JointReport::quantity`].
    pub quantity: Quantity,
    /// See [`JointReport::scale`].
    pub scale: i64,
    /// See [`JointReport::offset`].
    pub offset: i32,
}

/// The conversion of the counts of a device to its pose; see [`GeometryReport`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// See [`GeometryReport::kinematics`].
    pub kinematics: u16,
    /// See [`GeometryReport::number`].
    pub number: u8,
    /// See [`GeometryReport::parameters`].
    pub parameters: [i32; PARAMETERS],
    /// The joints. Joints behind the number of encoders are not sent.
    pub joints: [Joint; ENCODERS],
}

impl Default for Geometry {
    fn default() -> Self {
        Self {
            kinematics: 0,
            number: 0,
            parameters: [0; PARAMETERS],
            joints: [Joint {
                quantity: Quantity::Angle,
                scale: 1,
                offset: 0,
            }; ENCODERS],
        }
    }
}

/// The measurement of the device, in the units of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// A pose; see [`StateReport`].
    Pose {
        /// Position (0.1 µm).
        position: [i32; 3],
        /// Orientation: quaternion w, x, y, z of length 32767.
        orientation: [i16; 4],
        /// Linear velocity (µm/s).
        velocity: [i32; 3],
        /// Angular velocity (mrad/s).
        angular_velocity: [i16; 3],
    },
    /// The counts of the encoders; see [`EncodersReport`].
    Counts {
        /// The counts; zero behind the last encoder.
        counts: [i32; ENCODERS],
        /// The number of encoders, 1 to 8.
        number: u8,
    },
}

/// The inputs of the device at the time of a state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// Pressed buttons; bit 0 is the first button.
    pub buttons: u16,
    /// The amplifiers are on.
    pub powered: bool,
    /// The wrench in force exceeds the present limit of the device.
    pub limited: bool,
}

/// A wrench in the units of a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wrench {
    /// Force (µN).
    pub force: [i32; 3],
    /// Moment about the handle's origin (µN·m).
    pub moment: [i32; 3],
}

/// The effect of a report that the device accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepted {
    /// A hello: the next report is the device's capabilities.
    Hello,
    /// A wrench, which the next call of [`Device::actuate`] applies.
    Wrench,
    /// A wrench without `ENABLE`: the next call of [`Device::actuate`] lets go.
    Release,
}

/// The reason why the device does not use a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The bytes are not a valid report to a device.
    Report(ReportError),
    /// A hello of another session, while the device is active.
    Busy,
    /// A wrench of another session, or before the first hello.
    Session,
    /// A wrench with `ENABLE` in a mode in which the device gives no force.
    Mode,
    /// A wrench that is not newer than the last.
    Sequence,
    /// A wrench that answers no state of the session, a state that is too old, or a state from before the watchdog let
    /// go.
    Age,
    /// A wrench that exceeds the largest force or moment of the device.
    Limit,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Report(error) => error.fmt(f),
            Self::Busy => f.write_str("the device is in use by another session"),
            Self::Session => f.write_str("the wrench is of another session; send a hello first"),
            Self::Mode => f.write_str("the device gives no force in its mode"),
            Self::Sequence => f.write_str("the wrench is not newer than the last"),
            Self::Age => f.write_str("the wrench answers a state that is unknown or too old"),
            Self::Limit => f.write_str("the wrench exceeds the largest of the device"),
        }
    }
}

impl core::error::Error for Refusal {}

/// Counts of received reports by outcome. The counts saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Reports that were used.
    pub accepted: u32,
    /// Reports of another length.
    pub length: u32,
    /// Reports that were changed in transit.
    pub check_sum: u32,
    /// Reports of another version.
    pub version: u32,
    /// Reports of another kind.
    pub kind: u32,
    /// Reports with a field out of range.
    pub range: u32,
    /// Hellos of another session while the device was active.
    pub busy: u32,
    /// Wrenches of another session.
    pub session: u32,
    /// Wrenches in a mode without force.
    pub mode: u32,
    /// Wrenches that were not newer than the last.
    pub sequence: u32,
    /// Wrenches that answered no state, an old state, or a state from before the watchdog let go.
    pub age: u32,
    /// Wrenches that were too large.
    pub limit: u32,
    /// Times that the watchdog let go.
    pub watchdog: u32,
}

impl Counters {
    fn count(&mut self, result: Result<Accepted, Refusal>) {
        let counter = match result {
            Ok(_) => &mut self.accepted,
            Err(Refusal::Report(ReportError::Length { .. })) => &mut self.length,
            Err(Refusal::Report(ReportError::Crc { .. })) => &mut self.check_sum,
            Err(Refusal::Report(ReportError::Version { .. })) => &mut self.version,
            Err(Refusal::Report(ReportError::Kind { .. } | ReportError::UnexpectedKind { .. })) => {
                &mut self.kind
            }
            Err(Refusal::Report(ReportError::OutOfRange { .. })) => &mut self.range,
            Err(Refusal::Busy) => &mut self.busy,
            Err(Refusal::Session) => &mut self.session,
            Err(Refusal::Mode) => &mut self.mode,
            Err(Refusal::Sequence) => &mut self.sequence,
            Err(Refusal::Age) => &mut self.age,
            Err(Refusal::Limit) => &mut self.limit,
        };
        *counter = counter.saturating_add(1);
    }
}

/// The last accepted wrench.
#[derive(Clone, Copy, Debug)]
struct Commanded {
    sequence: u16,
    wrench: Wrench,
    received_us: u32,
    /// Not yet applied.
    fresh: bool,
}

/// The part of the answer to a hello that has not been sent.
#[derive(Clone, Copy, Debug)]
struct Answer {
    hello: u16,
    hello_time_us: u32,
    /// The next part: capabilities, geometry, then one joint each.
    next: u8,
}

/// States that were sent one after another within a small part of the watchdog. Each state of a run counts as old as
/// the first. A device of any rate therefore needs the memory of only [`RUNS`] times, and no state counts as younger
/// than it is.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Sequence number of the first state.
    first: u16,
    /// Number of states; zero in a place that is not used.
    count: u16,
    /// Time of the first state.
    begun_us: u32,
}

impl Run {
    const NONE: Self = Self {
        first: 0,
        count: 0,
        begun_us: 0,
    };
}

/// The device's side of the protocol.
#[derive(Clone, Copy, Debug)]
pub struct Device {
    model: Model,
    geometry: Geometry,
    mode: Mode,
    calibrated: bool,
    fault: u8,
    session: u32,
    watchdog_us: u32,
    /// Sequence number of the next report.
    sequence: u16,
    /// States sent in this session, and since the watchdog last let go.
    runs: [Run; RUNS],
    /// The place of the newest run.
    newest: usize,
    /// Sequence number of the last wrench of this session.
    last: Option<u16>,
    commanded: Option<Commanded>,
    /// Sequence number of the wrench that the amplifiers apply.
    in_force: Option<u16>,
    since_us: u32,
    watchdog: bool,
    answer: Option<Answer>,
    refused: u8,
    counters: Counters,
}

impl Device {
    /// A device that starts, in the mode `Boot`. `geometry` is sent only by a device that sends counts.
    pub fn new(model: Model, geometry: Geometry) -> Self {
        Self {
            model,
            geometry,
            mode: Mode::Boot,
            calibrated: false,
            fault: 0,
            session: 0,
            watchdog_us: WATCHDOG_US,
            sequence: 0,
            runs: [Run::NONE; RUNS],
            newest: 0,
            last: None,
            commanded: None,
            in_force: None,
            since_us: 0,
            watchdog: false,
            answer: None,
            refused: 0,
            counters: Counters::default(),
        }
    }

    /// The mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Counts of the reports so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The session; zero before the first hello.
    pub fn session(&self) -> u32 {
        self.session
    }

    /// Begins the search for the encoders' reference. Returns false, and does nothing, unless the mode is `Boot` or
    /// `Idle`.
    pub fn home(&mut self) -> bool {
        let may = matches!(self.mode, Mode::Boot | Mode::Idle);
        if may {
            self.mode = Mode::Homing;
            self.calibrated = false;
        }
        may
    }

    /// The encoders have found their reference. Returns false, and does nothing, unless the mode is `Homing`.
    pub fn homed(&mut self) -> bool {
        let may = self.mode == Mode::Homing;
        if may {
            self.mode = Mode::Idle;
            self.calibrated = true;
        }
        may
    }

    /// The device has found a fault, or its emergency stop was pressed. The firmware cuts the amplifiers itself. Of
    /// several faults, the first is reported.
    pub fn fault(&mut self, fault: NonZeroU8) {
        if self.mode != Mode::Fault {
            self.mode = Mode::Fault;
            self.fault = fault.get();
            self.commanded = None;
        }
    }

    /// Leaves the mode `Fault` for `Boot`, and ends the session: the host must greet the device again. Returns false,
    /// and does nothing, in any other mode.
    pub fn reset(&mut self) -> bool {
        let may = self.mode == Mode::Fault;
        if may {
            self.mode = Mode::Boot;
            self.fault = 0;
            self.calibrated = false;
            self.begin(0);
        }
        may
    }

    /// Takes a report that came at `now_us`.
    ///
    /// # Errors
    /// The [`Refusal`] if the report is not used. The device counts refusals.
    pub fn receive(&mut self, bytes: &[u8], now_us: u32) -> Result<Accepted, Refusal> {
        self.expire(now_us);
        let result = match Report::decode(bytes) {
            Ok(Report::Hello(hello)) => self.hello(&hello, now_us),
            Ok(Report::Wrench(wrench)) => self.wrench(&wrench, now_us),
            Ok(Report::State(_)) => Err(unexpected(Kind::State)),
            Ok(Report::Encoders(_)) => Err(unexpected(Kind::Encoders)),
            Ok(Report::Capabilities(_)) => Err(unexpected(Kind::Capabilities)),
            Ok(Report::Geometry(_)) => Err(unexpected(Kind::Geometry)),
            Ok(Report::Joint(_)) => Err(unexpected(Kind::Joint)),
            Err(error) => Err(Refusal::Report(error)),
        };
        self.counters.count(result);
        self.refused = self.refused.wrapping_add(u8::from(result.is_err()));
        result
    }

    /// The wrench that the amplifiers apply from `now_us` on; zero in every mode but `Active`.
    pub fn actuate(&mut self, now_us: u32) -> Wrench {
        self.expire(now_us);
        let Some(commanded) = &mut self.commanded else {
            if self.in_force.take().is_some() {
                self.since_us = now_us;
            }
            return Wrench::default();
        };
        if commanded.fresh {
            commanded.fresh = false;
            self.in_force = Some(commanded.sequence);
            self.since_us = now_us;
            self.watchdog = false;
        }
        commanded.wrench
    }

    /// The next report to send: the answer to a hello, as long as a part of it is left, otherwise the state that the
    /// device measured at `now_us`. `measured` is of the form that the [`Model`] names.
    pub fn report(&mut self, now_us: u32, inputs: Inputs, measured: &Measured) -> [u8; LENGTH] {
        self.expire(now_us);
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        if let Some(answer) = self.answer {
            return self.answer(answer, sequence);
        }
        self.note(sequence, now_us);
        let condition = self.condition(now_us, inputs);
        let session = self.session;
        match *measured {
            Measured::Pose {
                position,
                orientation,
                velocity,
                angular_velocity,
            } => StateReport {
                sequence,
                session,
                condition,
                position,
                orientation,
                velocity,
                angular_velocity,
            }
            .encode(),
            Measured::Counts { counts, number } => EncodersReport {
                sequence,
                session,
                condition,
                counts,
                number,
            }
            .encode(),
        }
    }

    fn condition(&self, now_us: u32, inputs: Inputs) -> Condition {
        let bits = [
            (status::CALIBRATED, self.calibrated),
            (status::POWERED, inputs.powered),
            (status::WATCHDOG, self.watchdog),
            (status::LIMITED, inputs.limited),
            (status::IN_FORCE, self.in_force.is_some()),
        ];
        let set = bits.iter().filter(|(_, set)| *set);
        Condition {
            time_us: now_us,
            since_us: self.since_us,
            wrench: self.in_force.unwrap_or(0),
            buttons: inputs.buttons,
            status: set.fold(0, |status, (bit, _)| status | bit),
            mode: self.mode,
            refused: self.refused,
            fault: self.fault,
        }
    }

    /// The next part of the answer to a hello.
    fn answer(&mut self, answer: Answer, sequence: u16) -> [u8; LENGTH] {
        let session = self.session;
        let parts = match self.model.sends {
            Sends::Poses => 1,
            Sends::Counts { encoders } => encoders.saturating_add(2),
        };
        let next = answer.next.saturating_add(1);
        self.answer = (next < parts).then_some(Answer { next, ..answer });
        let encoder = match answer.next {
            0 => {
                return CapabilitiesReport {
                    sequence,
                    session,
                    hello: answer.hello,
                    hello_time_us: answer.hello_time_us,
                    watchdog_us: self.watchdog_us,
                    model: self.model,
                }
                .encode();
            }
            1 => {
                return GeometryReport {
                    sequence,
                    session,
                    kinematics: self.geometry.kinematics,
                    number: self.geometry.number,
                    parameters: self.geometry.parameters,
                }
                .encode();
            }
            part => part.saturating_sub(2),
        };
        let joints = self.geometry.joints;
        let [first, ..] = joints;
        let joint = joints.get(usize::from(encoder)).unwrap_or(&first);
        JointReport {
            sequence,
            session,
            encoder,
            quantity: joint.quantity,
            scale: joint.scale,
            offset: joint.offset,
        }
        .encode()
    }

    fn hello(&mut self, hello: &HelloReport, now_us: u32) -> Result<Accepted, Refusal> {
        if hello.session != self.session {
            if self.mode == Mode::Active {
                return Err(Refusal::Busy);
            }
            self.begin(hello.session);
        }
        let watchdog_us = match hello.watchdog_us {
            0 => WATCHDOG_US,
            wanted => wanted,
        };
        let begun = self.answer.is_some_and(|answer| answer.next > 0);
        if begun && watchdog_us == self.watchdog_us {
            // A repeated hello must not begin a long answer anew each time.
            return Ok(Accepted::Hello);
        }
        self.watchdog_us = watchdog_us;
        self.answer = Some(Answer {
            hello: hello.sequence,
            hello_time_us: now_us,
            next: 0,
        });
        Ok(Accepted::Hello)
    }

    /// Begins a session, or none, without a wrench and without states.
    fn begin(&mut self, session: u32) {
        self.session = session;
        self.runs = [Run::NONE; RUNS];
        self.last = None;
        self.commanded = None;
        self.watchdog = false;
        self.answer = None;
    }

    fn wrench(&mut self, report: &WrenchReport, now_us: u32) -> Result<Accepted, Refusal> {
        if report.session != self.session {
            return Err(Refusal::Session);
        }
        // The first wrench of a session counts as newer.
        let step = self
            .last
            .map_or(1, |last| report.sequence.wrapping_sub(last));
        let newer = (1..=u16::MAX / 2).contains(&step);
        if report.flags & flags::ENABLE == 0 {
            if newer {
                self.last = Some(report.sequence);
            }
            self.let_go();
            return Ok(Accepted::Release);
        }
        if !matches!(self.mode, Mode::Idle | Mode::Active) {
            return Err(Refusal::Mode);
        }
        if !newer {
            return Err(Refusal::Sequence);
        }
        if !self.recent(report.answers, now_us) {
            return Err(Refusal::Age);
        }
        let within = within(report.force, self.model.max_force)
            && within(report.moment, self.model.max_moment);
        if !within {
            return Err(Refusal::Limit);
        }
        self.last = Some(report.sequence);
        self.mode = Mode::Active;
        self.commanded = Some(Commanded {
            sequence: report.sequence,
            wrench: Wrench {
                force: report.force,
                moment: report.moment,
            },
            received_us: now_us,
            fresh: true,
        });
        Ok(Accepted::Wrench)
    }

    /// Notes a sent state in the newest run, or in a new one. The beginnings of the first and the last run are at least
    /// a watchdog apart.
    fn note(&mut self, sequence: u16, now_us: u32) {
        let longest_us = self.watchdog_us / PARTS;
        if let Some(run) = self.runs.get_mut(self.newest) {
            let follows =
                (1..u16::MAX).contains(&run.count) && sequence == run.first.wrapping_add(run.count);
            if follows && now_us.wrapping_sub(run.begun_us) <= longest_us {
                run.count = run.count.saturating_add(1);
                return;
            }
        }
        self.newest = self.newest.wrapping_add(1) % RUNS;
        if let Some(run) = self.runs.get_mut(self.newest) {
            *run = Run {
                first: sequence,
                count: 1,
                begun_us: now_us,
            };
        }
    }

    /// Whether a sequence number is that of a noted state that is not older than the watchdog.
    fn recent(&self, state: u16, now_us: u32) -> bool {
        self.runs.iter().any(|run| {
            state.wrapping_sub(run.first) < run.count
                && now_us.wrapping_sub(run.begun_us) <= self.watchdog_us
        })
    }

    /// Lets go if the last wrench came too long ago. Wrenches that answer an earlier state are refused from now on.
    fn expire(&mut self, now_us: u32) {
        let Some(commanded) = self.commanded else {
            return;
        };
        if now_us.wrapping_sub(commanded.received_us) >= self.watchdog_us {
            self.let_go();
            self.runs = [Run::NONE; RUNS];
            self.watchdog = true;
            self.counters.watchdog = self.counters.watchdog.saturating_add(1);
        }
    }

    fn let_go(&mut self) {
        self.commanded = None;
        if self.mode == Mode::Active {
            self.mode = Mode::Idle;
        }
    }
}

fn unexpected(kind: Kind) -> Refusal {
    Refusal::Report(ReportError::UnexpectedKind { found: kind as u8 })
}

/// Whether a vector is at most `most` long. One unit is added to `most` for the rounding of the three components, half
/// a unit each.
fn within(vector: [i32; 3], most: u32) -> bool {
    // Three squares of at most 2^62 are below 2^64, and the square of 2^32 saturates.
    let squares = vector.map(|x| u64::from(x.unsigned_abs()).pow(2));
    let length: u64 = squares.iter().sum();
    let most = u64::from(most).saturating_add(1);
    length <= most.saturating_mul(most)
}

#[cfg(test)]
mod tests;
