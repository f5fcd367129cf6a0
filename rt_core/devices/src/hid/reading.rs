//! Decodes a queue of reports to the newest state, and encodes a wrench as a report.
//!
//! The bytes come from a closure rather than from HID, so a test can supply byte arrays. The module never allocates. It
//! reads at most [`QUEUE`] reports per tick, so a device that sends too many reports cannot stall the tick.
//!
//! **Rendering.** The [`Rendering`] of a tick is the worst in the states of this tick, so that a short pause of a fast
//! device is not missed. A device without a wrench in force has let go, except at the start: from the first wrench of a
//! session on, the device has the time of a watchdog to take a wrench. A fault is reported even if the device has lost
//! its reference. The state then has the last pose that is known, because no force may follow from it.

use crate::wire::{corrupt, rendering_of, si_of, state_of};
use firmware_proto::host::{DeviceClock, Event, Host, HostError, MotionToForce};
use firmware_proto::report::{self, Condition, Mode, StateReport, WATCHDOG_US, status};
use rt_core::{Corruption, DeviceError, DeviceState, Freedom, Pose, Rendering, Twist, Wrench};
use std::num::NonZeroU32;

/// Largest number of reports read in one tick: as many as the kernel queues.
pub const QUEUE: usize = 64;

/// Counts of a device's reports, and its status. The counts only grow.
#[derive(Clone, Copy, Debug)]
pub struct Reports {
    host: Host,
    clock: DeviceClock,
    /// Good reports.
    pub good: u64,
    /// Good states that a newer one in the same tick superseded.
    pub superseded: u64,
    /// Reports that could not be used.
    pub corrupt: u64,
    /// Intact reports of another session: before the device was greeted, or because it serves another host.
    pub other_session: u64,
    /// Reports that were not newer than the last.
    pub old: u64,
    /// The device's last report of its own status; see [`status`](firmware_proto::report::status).
    pub status: u8,
    /// The device's last report of its mode.
    pub mode: Mode,
    /// The device's last report of its fault; see [`fault`](firmware_proto::report::fault).
    pub fault: u8,
    /// The last motion to force that the device's reports show.
    pub motion_to_force: Option<MotionToForce>,
    /// The motion to force that the last read showed; `None` if it showed none.
    shown: Option<MotionToForce>,
    /// The reason why the newest of the refused reports was refused.
    pub refused: Option<HostError>,
    /// Reports that the device refused since it has its reference. The device's own count wraps at 256.
    pub refused_by_device: u64,
    /// The device's own count at its last state.
    refused_last: Option<u8>,
    /// Whether a wrench has been in force.
    was_in_force: bool,
    /// When the first wrench was sent (ns).
    first_wrench_ns: Option<u64>,
    /// The last pose of a device with its reference.
    pose: Pose,
}

impl Reports {
    /// The counts before the first report of a session, in which the device is asked for a watchdog of `watchdog_us`.
    pub fn new(session: NonZeroU32, watchdog_us: u32) -> Self {
        Self {
            host: Host::new(session, watchdog_us),
            clock: DeviceClock::default(),
            good: 0,
            superseded: 0,
            corrupt: 0,
            other_session: 0,
            old: 0,
            status: 0,
            mode: Mode::Boot,
            fault: 0,
            motion_to_force: None,
            shown: None,
            refused: None,
            refused_by_device: 0,
            refused_last: None,
            was_in_force: false,
            first_wrench_ns: None,
            pose: Pose::identity(),
        }
    }

    /// Begins another session, with a device that was connected again. The counts begin anew, but for the reports that
    /// the device refused.
    pub(crate) fn begin_session(&mut self, session: NonZeroU32, watchdog_us: u32) {
        *self = Self {
            refused_by_device: self.refused_by_device,
            pose: self.pose,
            ..Self::new(session, watchdog_us)
        };
    }

    /// The host's side of the protocol: the device's own capabilities, its lost reports. The offset between the clocks
    /// is that of the times of the ticks, which are a little earlier than the times at which reports are read.
    pub fn host(&self) -> &Host {
        &self.host
    }

    /// Calls `next` until no report waits, and returns the newest good state of the tick at `now_ns`. `next` fills the
    /// buffer and returns the length of the report, or zero for none.
    ///
    /// # Errors
    /// The error of `next`, if it comes before a state. Otherwise the reason why no state came.
    ///
    /// The position of a device that has not found its reference cannot be trusted: the states of such a device count
    /// as missing, unless they tell of a fault.
    pub fn newest(
        &mut self,
        sensed: Freedom,
        now_ns: u64,
        mut next: impl FnMut(&mut [u8]) -> Result<usize, DeviceError>,
    ) -> Result<DeviceState, DeviceError> {
        // The buffer is one byte longer than a report, so that a report that is too long can be detected.
        let mut buffer = [0_u8; report::LENGTH + 1];
        let mut newest = self.begin();
        for _ in 0..QUEUE {
            let length = match next(&mut buffer) {
                Ok(0) => break,
                Ok(length) => length,
                // A report that arrived before the device disappeared is still good. The next read returns the error.
                Err(_) if newest.is_state() => break,
                Err(error) => return Err(error),
            };
            let bytes = buffer.get(..length).unwrap_or(&buffer);
            self.receive(&mut newest, bytes, now_ns);
        }
        self.state(newest, sensed)
    }

    /// Takes one report, which came at `now_ns`, among those of which the newest state is wanted.
    pub(crate) fn receive(&mut self, newest: &mut Newest, bytes: &[u8], now_ns: u64) {
        let result = self.host.receive(bytes, now_ns);
        self.refused = result.err().or(self.refused);
        match result {
            Ok(Event::State {
                report,
                motion_to_force,
            }) => {
                self.good += 1;
                self.superseded += u64::from(newest.is_state());
                let rendering = self.take(&report, motion_to_force, now_ns);
                newest.rendering = worse(newest.rendering, rendering);
                newest.state = Some(report);
            }
            // No driver has the kinematics of such a device.
            Ok(Event::Encoders { .. }) => {
                self.corrupt += 1;
                newest.fault = Some(DeviceError::Corrupt(Corruption::Kind));
            }
            Ok(Event::Capabilities(_) | Event::Geometry(_) | Event::Joint(_)) => self.good += 1,
            Err(HostError::Session { .. }) => {
                self.other_session += 1;
                // A device that was restarted counts anew.
                self.refused_last = None;
            }
            Err(HostError::Sequence) => self.old += 1,
            Err(HostError::Report(error)) => {
                self.corrupt += 1;
                newest.fault = Some(corrupt(error));
            }
        }
    }

    /// The newest state of the reports that came.
    pub(crate) fn state(
        &mut self,
        newest: Newest,
        sensed: Freedom,
    ) -> Result<DeviceState, DeviceError> {
        let Some(report) = newest.state else {
            return Err(newest.fault.unwrap_or(DeviceError::NoReport));
        };
        let device_time_ns = self.clock.advance(report.condition.time_us);
        let state = DeviceState {
            rendering: newest.rendering,
            ..state_of(&report, sensed, device_time_ns)
        };
        if report.condition.status & status::CALIBRATED != 0 {
            self.pose = state.pose;
            return Ok(state);
        }
        match state.rendering {
            Rendering::Fault(_) => Ok(DeviceState {
                pose: self.pose,
                twist: Twist::zero(),
                ..state
            }),
            _ => Err(DeviceError::NoReport),
        }
    }

    /// The hello to write before the first tick.
    pub fn greet(&mut self) -> [u8; report::LENGTH] {
        self.host.greet()
    }

    /// The report to write in the tick of `now_ns`, if any; see [`Host::command`]. `wrench` is in device axes.
    pub fn command(&mut self, wrench: &Wrench, now_ns: u64) -> Option<[u8; report::LENGTH]> {
        let command = self.host.command(&si_of(wrench), now_ns)?;
        if self.host.ready() {
            self.first_wrench_ns.get_or_insert(now_ns);
        }
        Some(command)
    }

    /// Begins a read.
    pub(crate) fn begin(&mut self) -> Newest {
        self.shown = None;
        Newest::default()
    }

    /// The motion to force (ns) that the last read showed; `None` if it showed none.
    pub(crate) fn shown_ns(&self) -> Option<u64> {
        let shown = self.shown?;
        Some(u64::from(shown.delay_us).saturating_mul(1000))
    }

    /// The report that lets the device go.
    pub fn release(&mut self) -> [u8; report::LENGTH] {
        self.host.release()
    }

    /// Takes the condition in a state that came at `now_ns`. Returns the rendering of the device.
    fn take(
        &mut self,
        report: &StateReport,
        motion_to_force: Option<MotionToForce>,
        now_ns: u64,
    ) -> Rendering {
        let condition = &report.condition;
        self.status = condition.status;
        self.mode = condition.mode;
        self.fault = condition.fault;
        self.motion_to_force = motion_to_force.or(self.motion_to_force);
        self.shown = motion_to_force.or(self.shown);
        let refused = condition.refused;
        // A device that searches its reference refuses every wrench, as it must: these do not count.
        let starts = matches!(condition.mode, Mode::Boot | Mode::Homing);
        let last = self.refused_last.filter(|_| !starts).unwrap_or(refused);
        let more = refused.wrapping_sub(last);
        self.refused_by_device = self.refused_by_device.saturating_add(more.into());
        self.refused_last = (!starts).then_some(refused);
        self.rendering(condition, now_ns)
    }

    /// The rendering of a device in this condition at `now_ns`.
    fn rendering(&mut self, condition: &Condition, now_ns: u64) -> Rendering {
        let in_force = condition.in_force().is_some();
        self.was_in_force |= in_force;
        let watchdog_us = self.host.capabilities().map(|report| report.watchdog_us);
        let watchdog_ns = u64::from(watchdog_us.unwrap_or(WATCHDOG_US)).saturating_mul(1000);
        let waits = self
            .first_wrench_ns
            .is_none_or(|first_ns| now_ns.saturating_sub(first_ns) <= watchdog_ns);
        let starts = !in_force && !self.was_in_force && waits;
        let taken = if starts { status::IN_FORCE } else { 0 };
        rendering_of(&Condition {
            status: condition.status | taken,
            ..*condition
        })
    }
}

/// The worse rendering of two states.
fn worse(a: Rendering, b: Rendering) -> Rendering {
    match (a, b) {
        (_, fault @ Rendering::Fault(_)) | (fault @ Rendering::Fault(_), _) => fault,
        (Rendering::LetGo, _) | (_, Rendering::LetGo) => Rendering::LetGo,
        _ => Rendering::Commanded,
    }
}

/// The newest state of some reports with the worst rendering in them, or the last fault among them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Newest {
    state: Option<StateReport>,
    rendering: Rendering,
    fault: Option<DeviceError>,
}

impl Newest {
    /// Whether a state has come.
    pub(crate) fn is_state(&self) -> bool {
        self.state.is_some()
    }

    /// Notes bytes that are no report, unless a state or another fault has come.
    pub(crate) fn garbage(&mut self) {
        let garbage = DeviceError::Corrupt(Corruption::Length);
        self.fault.get_or_insert(garbage);
    }
}

/// A report to write, after the report number 0 of unnumbered reports.
pub type Command = [u8; report::LENGTH + 1];

/// The command that writes `report`.
pub(super) fn numbered(report: &[u8; report::LENGTH]) -> Command {
    let mut command = [0; report::LENGTH + 1];
    for (byte, from) in command.iter_mut().skip(1).zip(report) {
        *byte = *from;
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_proto::host::release;
    use firmware_proto::report::{
        CapabilitiesReport, Condition, EncodersReport, HelloReport, Model,
    };
    use firmware_proto::report::{WrenchReport, flags};
    use rt_core::{Pose, Vec3};
    use std::collections::VecDeque;

    const SESSION: NonZeroU32 = NonZeroU32::new(0xCAFE).unwrap();

    fn sent(sequence: u16, time_us: u32) -> StateReport {
        StateReport {
            sequence,
            session: SESSION.get(),
            condition: Condition {
                time_us,
                buttons: 0b101,
                status: status::CALIBRATED | status::POWERED,
                mode: Mode::Idle,
                ..Condition::default()
            },
            // 10 mm, -20 mm, 0.1 um.
            position: [100_000, -200_000, 1],
            // A quarter turn about z: cosine and sine of 45 degrees.
            orientation: [23170, 0, 0, 23170],
            velocity: [50_000, 0, -1],
            angular_velocity: [0, 0, 1500],
        }
    }

    /// Returns byte strings one by one, as the kernel's queue does.
    fn queue(
        mut waiting: VecDeque<Vec<u8>>,
    ) -> impl FnMut(&mut [u8]) -> Result<usize, DeviceError> {
        move |buffer| {
            let Some(bytes) = waiting.pop_front() else {
                return Ok(0);
            };
            let length = bytes.len().min(buffer.len());
            buffer[..length].copy_from_slice(&bytes[..length]);
            Ok(length)
        }
    }

    fn bytes(reports: &[StateReport]) -> VecDeque<Vec<u8>> {
        reports
            .iter()
            .map(|report| report.encode().to_vec())
            .collect()
    }

    #[test]
    fn a_report_becomes_a_state_in_si() {
        let mut reports = Reports::new(SESSION, 0);
        let state = reports
            .newest(Freedom::Six, 0, queue(bytes(&[sent(7, 1234)])))
            .expect("good");
        assert_eq!(state.pose.position, Vec3::new(0.01, -0.02, 1e-7));
        assert_eq!(state.twist.linear, Vec3::new(0.05, 0.0, -1e-6));
        assert_eq!(state.twist.angular, Vec3::new(0.0, 0.0, 1.5));
        // The quaternion's integers are equal, so the angle is exact up to rounding.
        let axis = state.pose.rotation.scaled_axis();
        let quarter = std::f64::consts::FRAC_PI_2;
        assert!(
            (axis - Vec3::new(0.0, 0.0, quarter)).norm() < 1e-15,
            "{axis}"
        );
        assert_eq!((state.buttons, state.device_time_ns), (0b101, 1_234_000));
        assert_eq!(reports.status, status::CALIBRATED | status::POWERED);
        // A device that senses no rotation reports the identity, whatever it sends.
        let state = reports
            .newest(Freedom::Three, 0, queue(bytes(&[sent(8, 2234)])))
            .expect("good");
        assert_eq!(
            (state.pose.rotation, state.twist.angular),
            (Pose::identity().rotation, Vec3::zeros())
        );
    }

    #[test]
    fn the_newest_of_many_is_taken_and_gaps_are_counted() {
        let mut reports = Reports::new(SESSION, 0);
        let many = [sent(65534, 1000), sent(65535, 2000), sent(2, 5000)];
        let state = reports
            .newest(Freedom::Three, 0, queue(bytes(&many)))
            .expect("good");
        assert_eq!(state.device_time_ns, 5_000_000);
        // The numbers 0 and 1 never arrived.
        assert_eq!(
            (reports.good, reports.superseded, reports.host().lost()),
            (3, 2, 2)
        );
        let none = reports.newest(Freedom::Three, 0, queue(VecDeque::new()));
        assert_eq!(none, Err(DeviceError::NoReport));
    }

    #[test]
    fn corrupt_reports_are_reported_unless_a_valid_one_came_too() {
        let mut broken = sent(1, 1000).encode().to_vec();
        broken[20] ^= 4;
        let mut long = sent(1, 1000).encode().to_vec();
        long.push(0);
        let mut reports = Reports::new(SESSION, 0);
        let result = reports.newest(Freedom::Three, 0, queue([broken.clone()].into()));
        assert!(
            matches!(result, Err(DeviceError::Corrupt(Corruption::CheckSum))),
            "{result:?}"
        );
        let result = reports.newest(Freedom::Three, 0, queue([long].into()));
        assert_eq!(result, Err(DeviceError::Corrupt(Corruption::Length)));
        let mixed = [sent(1, 1000).encode().to_vec(), broken].into();
        assert!(reports.newest(Freedom::Three, 0, queue(mixed)).is_ok());
        assert_eq!((reports.good, reports.corrupt), (1, 3));
    }

    #[test]
    fn a_device_without_its_reference_has_no_state() {
        let mut lost = sent(1, 1000);
        lost.condition.status = status::POWERED;
        let mut reports = Reports::new(SESSION, 0);
        let result = reports.newest(Freedom::Three, 0, queue(bytes(&[lost])));
        assert_eq!(
            (result, reports.status),
            (Err(DeviceError::NoReport), status::POWERED)
        );
    }

    /// The state `sequence` at `sequence` ms, with a wrench in force or none.
    fn condition(sequence: u16, change: impl FnOnce(&mut Condition)) -> StateReport {
        let mut report = sent(sequence, u32::from(sequence) * 1000);
        change(&mut report.condition);
        report
    }

    fn in_force(condition: &mut Condition) {
        condition.mode = Mode::Active;
        condition.status |= status::IN_FORCE;
    }

    /// A host that the device has answered, and that has sent its first wrench at 2 ms. The watchdog is 10 ms.
    fn ready() -> Reports {
        let mut reports = Reports::new(SESSION, 0);
        let hello = reports.command(&Wrench::zero(), 0).expect("a hello");
        let hello = HelloReport::decode(&hello).expect("a hello");
        let answer = CapabilitiesReport {
            sequence: 1,
            session: SESSION.get(),
            hello: hello.sequence,
            hello_time_us: 500,
            watchdog_us: 10_000,
            model: Model {
                sensed: 7,
                rate: [1, 1000],
                name: [b'x'; 16],
                ..Model::default()
            },
        };
        let first = [
            answer.encode().to_vec(),
            condition(2, |_| ()).encode().to_vec(),
        ];
        let state = reports.newest(Freedom::Three, 2 * MS, queue(first.into()));
        assert_eq!(state.map(|state| state.rendering), Ok(Rendering::Commanded));
        assert!(reports.command(&Wrench::zero(), 2 * MS).is_some());
        reports
    }

    const MS: u64 = 1_000_000;

    /// The rendering from some states that come at once.
    fn rendering(reports: &mut Reports, states: &[StateReport]) -> Rendering {
        let at = states.last().map_or(0, |state| u64::from(state.sequence)) * MS;
        let state = reports.newest(Freedom::Three, at, queue(bytes(states)));
        state.expect("a state").rendering
    }

    #[test]
    fn a_device_renders_while_a_wrench_is_in_force_and_its_amplifiers_are_on() {
        let mut reports = ready();
        // It may take a watchdog until the first wrench is in force.
        for sequence in 3..=12 {
            let waits = condition(sequence, |_| ());
            assert_eq!(rendering(&mut reports, &[waits]), Rendering::Commanded);
        }
        let late = condition(13, |_| ());
        assert_eq!(rendering(&mut reports, &[late]), Rendering::LetGo);
        let taken = condition(14, in_force);
        assert_eq!(rendering(&mut reports, &[taken]), Rendering::Commanded);
        let watchdog = condition(15, |condition| condition.status |= status::WATCHDOG);
        assert_eq!(rendering(&mut reports, &[watchdog]), Rendering::LetGo);
        let unpowered = condition(16, |condition| {
            in_force(condition);
            condition.status &= !status::POWERED;
        });
        assert_eq!(rendering(&mut reports, &[unpowered]), Rendering::LetGo);
        let again = condition(17, in_force);
        assert_eq!(rendering(&mut reports, &[again]), Rendering::Commanded);
    }

    #[test]
    fn a_force_that_was_there_is_missed_at_once() {
        let mut reports = ready();
        assert_eq!(
            rendering(&mut reports, &[condition(3, in_force)]),
            Rendering::Commanded
        );
        assert_eq!(
            rendering(&mut reports, &[condition(4, |_| ())]),
            Rendering::LetGo
        );
    }

    #[test]
    fn a_pause_between_two_ticks_is_not_missed() {
        let fault = |condition: &mut Condition| {
            condition.mode = Mode::Fault;
            condition.fault = 3;
        };
        let mut reports = ready();
        let pause = [
            condition(3, in_force),
            condition(4, |_| ()),
            condition(5, in_force),
        ];
        assert_eq!(rendering(&mut reports, &pause), Rendering::LetGo);
        assert_eq!(
            rendering(&mut reports, &[condition(6, in_force)]),
            Rendering::Commanded
        );
        // A fault is worse than a pause, whatever the order.
        let both = [condition(7, fault), condition(8, |_| ())];
        assert_eq!(rendering(&mut reports, &both), Rendering::Fault(3));
        let both = [
            condition(9, |_| ()),
            condition(10, fault),
            condition(11, in_force),
        ];
        assert_eq!(rendering(&mut reports, &both), Rendering::Fault(3));
    }

    /// A fault is reported even if the device has lost its reference. No force may follow from the pose, which is the
    /// last that is known.
    #[test]
    fn a_fault_is_told_without_a_reference() {
        let fault = |sequence| {
            let mut report = condition(sequence, |condition| {
                condition.mode = Mode::Fault;
                condition.fault = 1;
                condition.status = 0;
            });
            report.position = [7_000_000; 3];
            report
        };
        let mut reports = Reports::new(SESSION, 0);
        let first = reports.newest(Freedom::Three, MS, queue(bytes(&[fault(1)])));
        let first = first.expect("a state");
        assert_eq!(
            (first.rendering, first.pose),
            (Rendering::Fault(1), Pose::identity())
        );
        let known = reports.newest(Freedom::Three, 2 * MS, queue(bytes(&[sent(2, 2000)])));
        let known = known.expect("a state").pose;
        assert_ne!(known, Pose::identity());
        let again = reports.newest(Freedom::Three, 3 * MS, queue(bytes(&[fault(3)])));
        let again = again.expect("a state");
        assert_eq!((again.rendering, again.pose), (Rendering::Fault(1), known));
        assert_eq!(again.twist, Twist::zero());
    }

    #[test]
    fn the_refusals_of_the_device_are_counted_beyond_its_own_count() {
        let refused = |sequence, refused| {
            condition(sequence, |condition| {
                in_force(condition);
                condition.refused = refused;
            })
        };
        let mut reports = ready();
        // The count before the first state belongs to no wrenches of this host: it is zero in the state 2.
        for (sequence, count, all) in [
            (3, 3, 3),
            (4, 3, 3),
            (5, 255, 255),
            (6, 2, 258),
            (7, 1, 513),
        ] {
            rendering(&mut reports, &[refused(sequence, count)]);
            assert_eq!(reports.refused_by_device, all);
        }
        // Refusals while the device searches its reference do not count.
        let searches = condition(8, |condition| {
            condition.mode = Mode::Homing;
            condition.refused = 40;
        });
        rendering(&mut reports, &[searches, refused(9, 41)]);
        rendering(&mut reports, &[refused(10, 42)]);
        assert_eq!(reports.refused_by_device, 514);
        // A device that was restarted counts from zero, and has no session.
        let restarted = StateReport {
            session: 0,
            ..refused(0, 0)
        };
        let none = reports.newest(Freedom::Three, 11 * MS, queue(bytes(&[restarted])));
        assert_eq!(none, Err(DeviceError::NoReport));
        let session = NonZeroU32::MIN;
        reports.begin_session(session, 0);
        let mut first = refused(1, 9);
        first.session = session.get();
        rendering(&mut reports, &[first]);
        assert_eq!(reports.refused_by_device, 514);
        let mut next = refused(2, 10);
        next.session = session.get();
        rendering(&mut reports, &[next]);
        assert_eq!(reports.refused_by_device, 515);
    }

    #[test]
    fn a_flood_is_read_a_queue_at_a_time() {
        let mut asked = 0;
        let flood = |buffer: &mut [u8]| {
            asked += 1;
            buffer[..report::LENGTH].copy_from_slice(&sent(asked as u16, 1000).encode());
            Ok(report::LENGTH)
        };
        assert!(
            Reports::new(SESSION, 0)
                .newest(Freedom::Three, 0, flood)
                .is_ok()
        );
        assert_eq!(asked, QUEUE);
    }

    #[test]
    fn a_disconnection_is_reported_after_the_last_report() {
        let mut reads = [Ok(()), Err(DeviceError::Disconnected(19))]
            .into_iter()
            .cycle();
        let mut next = |buffer: &mut [u8]| {
            reads.next().unwrap_or(Ok(()))?;
            buffer[..report::LENGTH].copy_from_slice(&sent(1, 1000).encode());
            Ok(report::LENGTH)
        };
        let mut reports = Reports::new(SESSION, 0);
        assert!(reports.newest(Freedom::Three, 0, &mut next).is_ok());
        let mut gone = |_: &mut [u8]| Err(DeviceError::Disconnected(19));
        let result = reports.newest(Freedom::Three, 0, &mut gone);
        assert_eq!(result, Err(DeviceError::Disconnected(19)));
    }

    #[test]
    fn reports_of_another_session_and_old_ones_are_no_states() {
        let mut reports = Reports::new(SESSION, 0);
        let other = StateReport {
            session: 0,
            ..sent(9, 1000)
        };
        let result = reports.newest(Freedom::Three, 0, queue(bytes(&[other])));
        assert_eq!(result, Err(DeviceError::NoReport));
        let first = queue(bytes(&[sent(2, 2000), sent(1, 1000)]));
        let state = reports.newest(Freedom::Three, 0, first).expect("good");
        assert_eq!(state.device_time_ns, 2_000_000);
        let counts = (reports.good, reports.other_session, reports.old);
        assert_eq!(counts, (1, 1, 1));
    }

    #[test]
    fn a_wrench_follows_the_greeting_and_names_the_newest_state() {
        let wrench = Wrench {
            force: Vec3::new(1.5, -0.25, 0.0),
            moment: Vec3::new(0.0, 0.0, 0.01),
        };
        let mut reports = Reports::new(SESSION, 0);
        let command = reports.command(&wrench, 0).expect("a hello");
        let hello = HelloReport::decode(&command).expect("a hello");
        assert_eq!(hello.session, SESSION.get());
        assert!(reports.command(&wrench, 1).is_none());
        let answer = CapabilitiesReport {
            sequence: 6,
            session: SESSION.get(),
            hello: hello.sequence,
            hello_time_us: 500,
            watchdog_us: 10_000,
            model: Model {
                sensed: 7,
                rate: [1, 1000],
                name: [b'x'; 16],
                ..Model::default()
            },
        };
        let mut waiting = bytes(&[sent(7, 1000)]);
        waiting.push_front(answer.encode().to_vec());
        let state = reports.newest(Freedom::Three, 0, queue(waiting));
        assert!(state.is_ok(), "{state:?}");
        // The report number 0 comes before the report.
        let command = numbered(&reports.command(&wrench, 0).expect("a wrench"));
        let sent = WrenchReport::decode(&command[1..]).expect("a wrench");
        assert_eq!(
            (command[0], sent.answers, sent.flags),
            (0, 7, flags::ENABLE)
        );
        assert_eq!(
            (sent.force, sent.moment),
            ([1_500_000, -250_000, 0], [0, 0, 10_000])
        );
        let bytes = numbered(&release(SESSION.get(), 0));
        let sent = WrenchReport::decode(&bytes[1..]).expect("a wrench");
        assert_eq!((sent.force, sent.moment, sent.flags), ([0; 3], [0; 3], 0));
    }

    /// A device that is plugged in again during a fault: the last pose that is known is from before.
    #[test]
    fn another_session_keeps_the_pose_that_a_fault_needs() {
        let mut reports = Reports::new(SESSION, 0);
        let known = reports.newest(Freedom::Three, 0, queue(bytes(&[sent(1, 1000)])));
        let known = known.expect("a state").pose;
        let session = NonZeroU32::MIN;
        reports.begin_session(session, 0);
        let mut fault = condition(1, |condition| {
            condition.mode = Mode::Fault;
            condition.fault = 1;
            condition.status = 0;
        });
        (fault.session, fault.position) = (session.get(), [0; 3]);
        let state = reports.newest(Freedom::Three, MS, queue(bytes(&[fault])));
        assert_eq!(state.map(|state| state.pose), Ok(known));
    }

    #[test]
    fn motion_to_force_is_that_of_the_last_read_alone() {
        let mut reports = ready();
        assert_eq!(reports.shown_ns(), None);
        // The wrench answers the state 2, which was measured at 2 ms. It is in force 150 us later.
        let command = reports.command(&Wrench::zero(), 2 * MS).expect("a wrench");
        let wrench = WrenchReport::decode(&command).expect("a wrench");
        assert_eq!(wrench.answers, 2);
        let shows = condition(3, |condition| {
            in_force(condition);
            (condition.wrench, condition.since_us) = (wrench.sequence, 2150);
        });
        rendering(&mut reports, &[shows]);
        assert_eq!(reports.shown_ns(), Some(150_000));
        let none = reports.newest(Freedom::Three, 4 * MS, queue(VecDeque::new()));
        assert_eq!(
            (none, reports.shown_ns()),
            (Err(DeviceError::NoReport), None)
        );
        assert_eq!(
            reports.motion_to_force.map(|shown| shown.delay_us),
            Some(150)
        );
    }

    #[test]
    fn the_first_and_the_last_report_of_a_session_are_a_hello_and_a_release() {
        let mut reports = ready();
        let released = WrenchReport::decode(&reports.release()).expect("a wrench");
        assert_eq!((released.session, released.flags), (SESSION.get(), 0));
        assert_eq!((released.force, released.moment), ([0; 3], [0; 3]));
        let hello = Reports::new(SESSION, 20_000).greet();
        let hello = HelloReport::decode(&hello).expect("a hello");
        assert_eq!((hello.session, hello.watchdog_us), (SESSION.get(), 20_000));
    }

    #[test]
    fn counts_of_encoders_are_no_state() {
        let counts = |sequence| {
            let report = EncodersReport {
                sequence,
                session: SESSION.get(),
                condition: sent(0, 0).condition,
                counts: [0; 8],
                number: 3,
            };
            report.encode().to_vec()
        };
        // The answer and the state of a device that sends poses are good.
        let mut reports = ready();
        assert_eq!((reports.good, reports.corrupt), (2, 0));
        let kind = Err(DeviceError::Corrupt(Corruption::Kind));
        for corrupt in [1, 2] {
            let read = queue([counts(2 + corrupt)].into());
            let found = reports.newest(Freedom::Three, 3 * MS, read);
            assert_eq!((found, reports.corrupt), (kind, corrupt.into()));
        }
        // Bytes that are no report are reported, unless more is known.
        let mut newest = reports.begin();
        newest.garbage();
        let length = Err(DeviceError::Corrupt(Corruption::Length));
        assert_eq!(reports.state(newest, Freedom::Three), length);
        let mut newest = reports.begin();
        reports.receive(&mut newest, &counts(5), 4 * MS);
        newest.garbage();
        assert_eq!(reports.state(newest, Freedom::Three), kind);
    }
}
