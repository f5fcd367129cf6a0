//! Decodes a queue of reports to the newest state, and encodes a wrench as a report.
//!
//! The bytes come from a closure rather than from HID, so a test can supply byte arrays. The module never allocates. It
//! reads at most [`QUEUE`] reports per tick, so a device that sends too many reports cannot stall the tick.

use crate::wire::{DeviceClock, corrupt, report_of, state_of};
use firmware_proto::report::{self, ReportError, StateReport, WrenchReport, status};
use rt_core::{DeviceError, DeviceState, Freedom, Wrench};

/// Largest number of reports read in one tick: as many as the kernel queues.
pub const QUEUE: usize = 64;

/// Counts of a device's reports, and its status. The counts only grow.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reports {
    clock: DeviceClock,
    /// Sequence number of the last good report.
    last: Option<u16>,
    /// Good reports.
    pub good: u64,
    /// Good reports that a newer one in the same tick superseded.
    pub superseded: u64,
    /// Reports that were sent but never arrived (gaps in their sequence), including corrupt ones.
    pub lost: u64,
    /// Reports that could not be used.
    pub corrupt: u64,
    /// The device's last report of its own status; see [`status`](firmware_proto::report::status).
    pub status: u8,
}

impl Reports {
    /// The counts before the first report.
    pub fn new() -> Self {
        Self::default()
    }

    /// Calls `next` until no report waits, and returns the newest good state. `next` fills the buffer and returns the
    /// length of the report, or zero for none.
    ///
    /// The position of a device that has not found its reference cannot be trusted: the states of such a device count
    /// as missing.
    pub(super) fn newest(
        &mut self,
        sensed: Freedom,
        mut next: impl FnMut(&mut [u8]) -> Result<usize, DeviceError>,
    ) -> Result<DeviceState, DeviceError> {
        // The buffer is one byte longer than a report, so that a report that is too long can be detected.
        let mut buffer = [0_u8; report::LENGTH + 1];
        let mut newest: Option<StateReport> = None;
        let mut fault: Option<ReportError> = None;
        for _ in 0..QUEUE {
            let length = match next(&mut buffer) {
                Ok(0) => break,
                Ok(length) => length,
                // A report that arrived before the device disappeared is still good. The next read returns the error.
                Err(_) if newest.is_some() => break,
                Err(error) => return Err(error),
            };
            match StateReport::decode(buffer.get(..length).unwrap_or(&buffer)) {
                Ok(report) => {
                    self.superseded += u64::from(newest.is_some());
                    self.take(&report);
                    newest = Some(report);
                }
                Err(error) => {
                    self.corrupt += 1;
                    fault = Some(error);
                }
            }
        }
        match (newest, fault) {
            (Some(report), _) => {
                let device_time_ns = self.clock.advance(report.time_us);
                if report.status & status::CALIBRATED == 0 {
                    return Err(DeviceError::NoReport);
                }
                Ok(state_of(&report, sensed, device_time_ns))
            }
            (None, Some(fault)) => Err(corrupt(fault)),
            (None, None) => Err(DeviceError::NoReport),
        }
    }

    fn take(&mut self, report: &StateReport) {
        self.good += 1;
        self.status = report.status;
        if let Some(last) = self.last {
            let step = report.sequence.wrapping_sub(last);
            // A step of more than half the range is a restart of the device, not a loss.
            if step <= u16::MAX / 2 {
                self.lost += u64::from(step.saturating_sub(1));
            }
        }
        self.last = Some(report.sequence);
    }
}

/// A report to write, after the report number 0 of unnumbered reports.
pub type Command = [u8; report::LENGTH + 1];

/// The report that commands `wrench` (device axes).
pub(super) fn command(wrench: &Wrench, sequence: u16) -> Command {
    numbered(&report_of(wrench, sequence))
}

/// The report that commands zero force, with the wrench disabled.
pub(super) fn let_go() -> Command {
    numbered(&WrenchReport {
        sequence: 0,
        force: [0; 3],
        moment: [0; 3],
        flags: 0,
    })
}

fn numbered(report: &WrenchReport) -> Command {
    let mut command = [0; report::LENGTH + 1];
    for (byte, from) in command.iter_mut().skip(1).zip(report.encode()) {
        *byte = from;
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_proto::report::flags;
    use rt_core::{Corruption, Pose, Vec3};
    use std::collections::VecDeque;

    fn sent(sequence: u16, time_us: u32) -> StateReport {
        StateReport {
            sequence,
            time_us,
            // 10 mm, -20 mm, 0.1 um.
            position: [100_000, -200_000, 1],
            // A quarter turn about z: cosine and sine of 45 degrees.
            orientation: [23170, 0, 0, 23170],
            velocity: [50_000, 0, -1],
            angular_velocity: [0, 0, 1500],
            buttons: 0b101,
            status: status::CALIBRATED | status::POWERED,
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
        let mut reports = Reports::new();
        let state = reports
            .newest(Freedom::Six, queue(bytes(&[sent(7, 1234)])))
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
            .newest(Freedom::Three, queue(bytes(&[sent(8, 2234)])))
            .expect("good");
        assert_eq!(
            (state.pose.rotation, state.twist.angular),
            (Pose::identity().rotation, Vec3::zeros())
        );
    }

    #[test]
    fn the_newest_of_many_is_taken_and_gaps_are_counted() {
        let mut reports = Reports::new();
        let many = [sent(65534, 1000), sent(65535, 2000), sent(2, 5000)];
        let state = reports
            .newest(Freedom::Three, queue(bytes(&many)))
            .expect("good");
        assert_eq!(state.device_time_ns, 5_000_000);
        // The numbers 0 and 1 never arrived.
        assert_eq!((reports.good, reports.superseded, reports.lost), (3, 2, 2));
        let none = reports.newest(Freedom::Three, queue(VecDeque::new()));
        assert_eq!(none, Err(DeviceError::NoReport));
    }

    #[test]
    fn corrupt_reports_are_reported_unless_a_valid_one_came_too() {
        let mut broken = sent(1, 1000).encode().to_vec();
        broken[20] ^= 4;
        let mut long = sent(1, 1000).encode().to_vec();
        long.push(0);
        let mut reports = Reports::new();
        let result = reports.newest(Freedom::Three, queue([broken.clone()].into()));
        assert!(
            matches!(result, Err(DeviceError::Corrupt(Corruption::CheckSum))),
            "{result:?}"
        );
        let result = reports.newest(Freedom::Three, queue([long].into()));
        assert_eq!(result, Err(DeviceError::Corrupt(Corruption::Length)));
        let mixed = [sent(1, 1000).encode().to_vec(), broken].into();
        assert!(reports.newest(Freedom::Three, queue(mixed)).is_ok());
        assert_eq!((reports.good, reports.corrupt), (1, 3));
    }

    #[test]
    fn a_device_without_its_reference_has_no_state() {
        let lost = StateReport {
            status: status::POWERED,
            ..sent(1, 1000)
        };
        let mut reports = Reports::new();
        let result = reports.newest(Freedom::Three, queue(bytes(&[lost])));
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
            buffer[..report::LENGTH].copy_from_slice(&sent(1, 1000).encode());
            Ok(report::LENGTH)
        };
        assert!(Reports::new().newest(Freedom::Three, flood).is_ok());
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
        let mut reports = Reports::new();
        assert!(reports.newest(Freedom::Three, &mut next).is_ok());
        let mut gone = |_: &mut [u8]| Err(DeviceError::Disconnected(19));
        let result = reports.newest(Freedom::Three, &mut gone);
        assert_eq!(result, Err(DeviceError::Disconnected(19)));
    }

    #[test]
    fn device_time_counts_on_over_wraps_and_restarts() {
        let mut clock = DeviceClock::default();
        assert_eq!(clock.advance(4_294_000_000), 4_294_000_000_000);
        assert_eq!(clock.advance(32_704), 4_295_000_000_000);
        assert_eq!(clock.advance(33_704), 4_295_001_000_000);
        // A restarted device sets its counter back by a little: the time continues from there.
        assert_eq!(clock.advance(100), 4_295_001_000_000);
        assert_eq!(clock.advance(1_100), 4_295_002_000_000);
    }

    #[test]
    fn a_wrench_is_sent_after_its_report_number() {
        let wrench = Wrench {
            force: Vec3::new(1.5, -0.25, 0.0),
            moment: Vec3::new(0.0, 0.0, 0.01),
        };
        let bytes = command(&wrench, 9);
        let sent = WrenchReport::decode(&bytes[1..]).expect("what is encoded is decoded");
        assert_eq!((bytes[0], sent.sequence, sent.flags), (0, 9, flags::ENABLE));
        assert_eq!(
            (sent.force, sent.moment),
            ([1_500_000, -250_000, 0], [0, 0, 10_000])
        );
        let sent = WrenchReport::decode(&let_go()[1..]).expect("what is encoded is decoded");
        assert_eq!((sent.force, sent.moment, sent.flags), ([0; 3], [0; 3], 0));
    }
}
