//! Decodes a queue of reports to the newest state, and encodes a wrench as a report.
//!
//! The bytes come from a closure rather than from HID, so a test can supply byte arrays. The module never allocates. It
//! reads at most [`QUEUE`] reports per tick, so a device that sends too many reports cannot stall the tick.

use crate::wire::{corrupt, si_of, state_of};
use firmware_proto::host::{DeviceClock, Event, Host, HostError, MotionToForce};
use firmware_proto::report::{self, Mode, StateReport, status};
use rt_core::{Corruption, DeviceError, DeviceState, Freedom, Wrench};
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
    /// The same, where the last read showed it.
    shown: Option<MotionToForce>,
    /// Why the last report that was not used was not.
    pub refused: Option<HostError>,
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
        }
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
    /// That of `next`, where it comes before a state; otherwise why no state came.
    ///
    /// The position of a device that has not found its reference cannot be trusted: the states of such a device count
    /// as missing.
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
                self.take(&report, motion_to_force);
                newest.state = Some(report);
            }
            // No driver has the kinematics of such a device.
            Ok(Event::Encoders { .. }) => {
                self.corrupt += 1;
                newest.fault = Some(DeviceError::Corrupt(Corruption::Kind));
            }
            Ok(Event::Capabilities(_) | Event::Geometry(_) | Event::Joint(_)) => self.good += 1,
            Err(HostError::Session { .. }) => self.other_session += 1,
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
        if report.condition.status & status::CALIBRATED == 0 {
            return Err(DeviceError::NoReport);
        }
        Ok(state_of(&report, sensed, device_time_ns))
    }

    /// The hello to write before the first tick.
    pub fn greet(&mut self) -> [u8; report::LENGTH] {
        self.host.greet()
    }

    /// The report to write in the tick of `now_ns`, if any; see [`Host::command`]. `wrench` is in device axes.
    pub fn command(&mut self, wrench: &Wrench, now_ns: u64) -> Option<[u8; report::LENGTH]> {
        self.host.command(&si_of(wrench), now_ns)
    }

    /// Begins a read.
    pub(crate) fn begin(&mut self) -> Newest {
        self.shown = None;
        Newest::default()
    }

    /// Motion to force (ns), where the last read showed it.
    pub(crate) fn shown_ns(&self) -> Option<u64> {
        let shown = self.shown?;
        Some(u64::from(shown.delay_us).saturating_mul(1000))
    }

    /// The report that lets the device go.
    pub fn release(&mut self) -> [u8; report::LENGTH] {
        self.host.release()
    }

    fn take(&mut self, report: &StateReport, motion_to_force: Option<MotionToForce>) {
        self.status = report.condition.status;
        self.mode = report.condition.mode;
        self.fault = report.condition.fault;
        self.motion_to_force = motion_to_force.or(self.motion_to_force);
        self.shown = motion_to_force.or(self.shown);
    }
}

/// The newest state of some reports, or the last fault among them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Newest {
    state: Option<StateReport>,
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
    use firmware_proto::report::{CapabilitiesReport, Condition, HelloReport, Model};
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
}
