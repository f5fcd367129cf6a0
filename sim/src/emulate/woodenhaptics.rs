//! An emulated WoodenHaptics: its firmware and its mechanism over a simulated device.
//!
//! The emulator has the kinematics of [`devices::woodenhaptics`]. Its encoders show the joint angles of the true
//! position, rounded to counts, in 16 bits. Its motors hold currents, and the force on the hand follows from the
//! currents and the pose by virtual work. The emulator sends one report when it is switched on, and one report for each
//! report that it receives. If several reports come before it can send, it answers only the newest. It cuts the motors
//! half a second after the last report.
//!
//! The mechanics are those of the simulated device: a point mass without end stops. The motors make the force of their
//! currents up to the largest force of the device model. A pose that the links do not reach has the angles of the last
//! pose that they reached, and no force.

use super::Emulator;
use crate::SimDevice;
use devices::woodenhaptics::{
    CurrentReport, EncoderReport, Form, Geometry, GeometryError, Kinematics,
};
use rt_core::{Device, Vec3, Wrench};

/// Time from the last report of the host until the amplifiers are cut (ns).
pub const CUT_NS: u64 = 500_000_000;

/// An emulated WoodenHaptics.
#[derive(Clone, Debug)]
pub struct WoodenHaptics {
    device: SimDevice,
    kinematics: Kinematics,
    form: Form,
    now_ns: u64,
    /// Counts of the joints at the true position, rounded.
    counts: [i64; 3],
    /// The difference of each counter from the counts of its joint.
    offsets: [i64; 3],
    /// Counters d, e, f, whose encoders do not turn.
    wrist: [i16; 3],
    info: i16,
    pressed: bool,
    /// The currents that the motors hold (mA).
    currents: [f64; 3],
    /// Whether an emergency stop keeps the motors without power.
    stopped: bool,
    /// Time at which the amplifiers are cut (ns); `None` while they are off.
    cut_ns: Option<u64>,
    owes_report: bool,
}

impl WoodenHaptics {
    /// A device that is switched on now, in the pose of `device`: the counters are zero there.
    ///
    /// # Errors
    /// [`GeometryError`] if a parameter is out of its range.
    pub fn new(device: SimDevice, geometry: &Geometry, form: Form) -> Result<Self, GeometryError> {
        let mut new = Self {
            device,
            kinematics: Kinematics::new(geometry)?,
            form,
            now_ns: 0,
            counts: [0; 3],
            offsets: [0; 3],
            wrist: [0; 3],
            info: 0,
            pressed: false,
            currents: [0.0; 3],
            stopped: false,
            cut_ns: None,
            owes_report: true,
        };
        new.switch_on();
        Ok(new)
    }

    /// Switches the device off and on: the counters are zero in the present pose, and the motors are off.
    pub fn restart(&mut self, now_ns: u64) {
        self.run(now_ns);
        self.cut_ns = None;
        self.currents = [0.0; 3];
        self.wrist = [0; 3];
        self.info = 0;
        self.owes_report = true;
        self.switch_on();
        self.actuate();
    }

    /// Presses or releases an emergency stop in the supply of the motors. No report shows the stop.
    pub fn stop(&mut self, stopped: bool, now_ns: u64) {
        self.run(now_ns);
        self.stopped = stopped;
        self.actuate();
    }

    /// The operator presses the button for calibration. Its flag stays until counters are set.
    pub fn press_calibration(&mut self) {
        self.info = EncoderReport::CALIBRATE;
    }

    /// The operator presses or releases the button of the handle, which only a long report has.
    pub fn press_handle(&mut self, pressed: bool) {
        self.pressed = pressed;
    }

    /// Whether the button for calibration was pressed and no counters were set since.
    pub fn awaits_counters(&self) -> bool {
        self.info == EncoderReport::CALIBRATE
    }

    /// The simulated device.
    pub fn device(&self) -> &SimDevice {
        &self.device
    }

    /// The simulated device, for code that guides its hand.
    pub fn device_mut(&mut self) -> &mut SimDevice {
        &mut self.device
    }

    /// Whether the amplifiers are on.
    pub fn is_powered(&self) -> bool {
        self.cut_ns.is_some()
    }

    /// Moves the device to `now_ns`. The amplifiers are cut at their time on the way.
    pub fn run(&mut self, now_ns: u64) {
        self.now_ns = self.now_ns.max(now_ns);
        if let Some(cut_ns) = self.cut_ns
            && cut_ns <= self.now_ns
        {
            self.cut_ns = None;
            self.currents = [0.0; 3];
            // Neither a read nor a write of a simulated device fails.
            let _ = self.device.write(cut_ns, &Wrench::zero());
        }
        let _ = self.device.read(self.now_ns);
        self.sense();
        self.actuate();
    }

    /// Makes the counters zero in the present pose.
    fn switch_on(&mut self) {
        self.sense();
        self.offsets = self.counts.map(i64::wrapping_neg);
    }

    /// The angles of the joints at the true position (rad); `None` if the links do not reach it.
    fn angles(&self) -> Option<[f64; 3]> {
        self.kinematics.inverse(&self.device.position())
    }

    fn sense(&mut self) {
        if let Some(angles) = self.angles() {
            let counts = self.kinematics.counts(angles);
            self.counts = counts.map(|count| libm::round(count) as i64);
        }
    }

    /// Lets the motors make the force of their currents in the present pose.
    fn actuate(&mut self) {
        let force = self
            .angles()
            .filter(|_| !self.stopped)
            .and_then(|angles| self.kinematics.force(angles, self.currents))
            .unwrap_or_else(Vec3::zeros);
        let wrench = Wrench {
            force,
            moment: Vec3::zeros(),
        };
        let _ = self.device.write(self.now_ns, &wrench);
    }

    /// The counters of the motors, in 16 bits.
    fn counters(&self) -> [i16; 3] {
        let mut counters = [0; 3];
        let each = self.counts.iter().zip(self.offsets);
        for (counter, (count, offset)) in counters.iter_mut().zip(each) {
            *counter = count.wrapping_add(offset) as i16;
        }
        counters
    }

    fn set_counters(&mut self, counters: [i16; 3]) {
        let each = self.counts.iter().zip(counters);
        for (offset, (count, counter)) in self.offsets.iter_mut().zip(each) {
            *offset = i64::from(counter).wrapping_sub(*count);
        }
    }
}

impl Emulator for WoodenHaptics {
    /// A report of a wrong length or with an unknown command has no effect; it does not keep the amplifiers on.
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.run(now_ns);
        let Ok(report) = CurrentReport::decode(bytes, self.form) else {
            return;
        };
        match report.command {
            CurrentReport::CURRENTS => {
                let most = self.kinematics.most_current();
                self.currents = report
                    .currents
                    .map(|current| f64::from(current).clamp(-most, most));
            }
            CurrentReport::SET_COUNTERS => {
                self.set_counters(report.attributes);
                self.wrist = report.currents;
                self.info = 0;
            }
            _ => return,
        }
        self.owes_report = true;
        self.cut_ns = Some(self.now_ns.saturating_add(CUT_NS));
        self.actuate();
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        self.run(now_ns);
        if !std::mem::take(&mut self.owes_report) {
            return None;
        }
        let [a, b, c] = self.counters();
        let [d, e, f] = self.wrist;
        let handle = if self.pressed && self.form == Form::Long {
            EncoderReport::PRESSED
        } else {
            0
        };
        let sent = EncoderReport {
            encoders: [a, b, c, d.wrapping_add(handle), e, f],
            info: self.info,
        };
        *report = sent.encode();
        Some(self.form.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DeviceFile, DeviceModel, Hand, Sine, Trajectory};
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;

    fn model() -> DeviceModel {
        DeviceFile::named("woodenhaptics")
            .expect("a built-in device")
            .model
    }

    fn emulated(hand: Option<Hand>) -> WoodenHaptics {
        let device = SimDevice::new(model(), hand, 1e-3).unwrap();
        WoodenHaptics::new(device, &Geometry::default(), Form::Short).unwrap()
    }

    fn currents(currents: [i16; 3]) -> CurrentReport {
        CurrentReport {
            currents,
            ..CurrentReport::default()
        }
    }

    fn receive(device: &mut WoodenHaptics, report: &CurrentReport, now_ns: u64) {
        let bytes = report.encode();
        device.receive(&bytes[..Form::Short.length()], now_ns);
    }

    fn send(device: &mut WoodenHaptics, now_ns: u64) -> Option<EncoderReport> {
        let mut report = [0; 64];
        let length = device.send(now_ns, &mut report)?;
        Some(EncoderReport::decode(&report[..length], Form::Short).expect("a report"))
    }

    #[test]
    fn the_profile_names_the_protocol_and_the_estimates() {
        let file = DeviceFile::named("woodenhaptics").expect("a built-in device");
        assert_eq!(file.protocol.as_deref(), Some("woodenhaptics"));
        assert_eq!(file.model.max_force, 5.0);
        assert_eq!(file.estimated, ["rate", "mass", "damping", "friction"]);
    }

    #[test]
    fn one_report_is_sent_for_each_received() {
        let mut device = emulated(None);
        // The report at the start.
        assert!(send(&mut device, 0).is_some() && send(&mut device, 0).is_none());
        receive(&mut device, &currents([0; 3]), MS);
        assert_eq!(send(&mut device, MS), Some(EncoderReport::default()));
        assert_eq!(send(&mut device, 2 * MS), None);
        // Two reports before it could send are drained to the newest.
        receive(&mut device, &currents([1000, 0, 0]), 3 * MS);
        receive(&mut device, &currents([0; 3]), 3 * MS);
        assert!(send(&mut device, 3 * MS).is_some() && send(&mut device, 3 * MS).is_none());
        assert_eq!(device.device().force(), Vec3::zeros());
    }

    #[test]
    fn currents_make_the_force_of_virtual_work() {
        // 1 A of motor a is 0.0259 N m, sixteen times that at the joint, over an arm of 0.22 m across y.
        let mut device = emulated(None);
        receive(&mut device, &currents([1000, 0, 0]), MS);
        let expected = Vec3::new(0.0, 0.0259 * 16.0 / 0.22, 0.0);
        let force = device.device().force();
        assert!((force - expected).norm() < 1e-12, "{force}");
        // The current saturates at 3 A, the force at that of the model.
        receive(&mut device, &currents([2600, 0, 0]), MS);
        assert!((device.device().force() - expected * 2.6).norm() < 1e-12);
        receive(&mut device, &currents([i16::MAX, 0, 0]), MS);
        assert!((device.device().force().norm() - 5.0).abs() < 1e-12);
        let strong = DeviceModel {
            max_force: 100.0,
            ..model()
        };
        let strong = SimDevice::new(strong, None, 1e-3).unwrap();
        let mut device = WoodenHaptics::new(strong, &Geometry::default(), Form::Short).unwrap();
        receive(&mut device, &currents([i16::MIN, 0, 0]), MS);
        assert!((device.device().force() + expected * 3.0).norm() < 1e-12);
    }

    #[test]
    fn the_force_follows_the_pose_between_two_reports() {
        let mut device = emulated(None);
        receive(&mut device, &currents([2000, 0, 0]), 0);
        for k in 1..=100 {
            device.run(k * MS);
        }
        // The motor pulls along the circle about the vertical axis.
        let arm = device.device().position() + Geometry::default().origin;
        let force = device.device().force();
        assert!(arm.y > 0.03, "it moved: {arm}");
        assert!((force.x * arm.x + force.y * arm.y).abs() < 1e-12, "{force}");
    }

    #[test]
    fn the_amplifiers_are_cut_half_a_second_after_the_last_report() {
        let start = 7 * MS;
        let mut device = emulated(None);
        receive(&mut device, &currents([500, 0, 0]), start);
        let last = start + 100 * MS;
        receive(&mut device, &currents([500, 0, 0]), last);
        device.run(last + CUT_NS - 1);
        assert!(device.is_powered() && device.device().force() != Vec3::zeros());
        let mut late = device.clone();
        device.run(last + CUT_NS);
        assert!(!device.is_powered());
        assert_eq!(device.device().force(), Vec3::zeros());
        // If the next call is late, the cut is at its time all the same.
        let work = device.device().energy().motor_work;
        late.run(last + CUT_NS + 50 * MS);
        let moved = late.device().energy().motor_work - work;
        assert!(moved.abs() < 1e-15, "{moved} J");
        // Counters that are set are a command, too. The currents stay off.
        receive(
            &mut late,
            &CurrentReport::set_counters([0; 3]),
            last + CUT_NS + 60 * MS,
        );
        assert!(late.is_powered());
        assert_eq!(late.device().force(), Vec3::zeros());
    }

    #[test]
    fn a_force_takes_no_harm_from_counters_that_are_set() {
        let mut device = emulated(None);
        device.press_calibration();
        receive(&mut device, &currents([100, 0, 0]), MS);
        assert_eq!(
            send(&mut device, MS).unwrap().info,
            EncoderReport::CALIBRATE
        );
        let force = device.device().force();
        let set = CurrentReport {
            currents: [7, -8, 9],
            command: CurrentReport::SET_COUNTERS,
            attributes: [i16::MAX, 2, i16::MIN],
        };
        receive(&mut device, &set, MS);
        let sent = send(&mut device, MS).unwrap();
        assert_eq!(sent.encoders, [i16::MAX, 2, i16::MIN, 7, -8, 9]);
        assert_eq!((sent.info, device.device().force()), (0, force));
    }

    #[test]
    fn counters_wrap_and_restart() {
        // A hand that swings across the arm by 0.05 m: 0.22 rad, 1,140 counts of joint a.
        let swing = Sine {
            amplitude: Vec3::y() * 0.05,
            frequency: 1.0,
            phase: 0.0,
        };
        let path = Trajectory::new_sines(&[swing], 0.1).unwrap();
        let mut device = emulated(Some(Hand::new(path)));
        receive(&mut device, &CurrentReport::set_counters([i16::MAX; 3]), 0);
        let before = send(&mut device, 0).unwrap();
        assert_eq!(before.motors(), [i16::MAX; 3]);
        for k in 1..=250 {
            device.run(k * MS);
        }
        receive(&mut device, &currents([0; 3]), 250 * MS);
        let after = send(&mut device, 250 * MS).unwrap();
        let [turned, ..] = after.motors().map(|counter| counter.wrapping_sub(i16::MAX));
        let kinematics = Kinematics::new(&Geometry::default()).unwrap();
        let angles = kinematics.inverse(&device.device().position()).unwrap();
        let [exact, ..] = kinematics.counts(angles);
        assert!(after.motors()[0] < 0 && turned > 100, "{turned}");
        assert!((f64::from(turned) - exact).abs() <= 0.5, "{turned} {exact}");
        device.restart(251 * MS);
        assert_eq!(send(&mut device, 251 * MS).unwrap().encoders, [0; 6]);
        assert!(!device.is_powered());
    }

    #[test]
    fn a_long_report_has_the_button_of_the_handle() {
        let device = SimDevice::new(model(), None, 1e-3).unwrap();
        let mut device = WoodenHaptics::new(device, &Geometry::default(), Form::Long).unwrap();
        device.press_handle(true);
        let mut report = [0; 64];
        assert_eq!(device.send(0, &mut report), Some(64));
        let sent = EncoderReport::decode(&report, Form::Long).unwrap();
        assert!(sent.is_pressed(Form::Long));
        // The first fourteen bytes of a long report are the same.
        device.receive(&currents([100, 0, 0]).encode(), MS);
        assert_ne!(device.device().force(), Vec3::zeros());
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_bytes_leave_a_sound_device(
            reports in prop::collection::vec(
                (prop::collection::vec(any::<u8>(), 0..70), 0..2_000_000_000_u64, 0..8_u8), 1..40,
            ),
            start in any::<u64>(),
        ) {
            let mut device = emulated(Some(Hand::new(Trajectory::still())));
            let mut now = start;
            for (mut bytes, gap, kind) in reports {
                // Most reports have the right length, and some of these a known command.
                if kind > 0 {
                    bytes.resize(14, 1);
                }
                if kind > 2 {
                    bytes[6..8].copy_from_slice(&[kind & 1, 0]);
                }
                now = now.wrapping_add(gap);
                let was = device.is_powered();
                let before = device.clone();
                device.receive(&bytes, now);
                let force = device.device().force();
                prop_assert!(force.iter().all(|x| x.is_finite()));
                prop_assert!(force.norm() <= 5.0 * (1.0 + 1e-9));
                prop_assert!(device.device().position().iter().all(|x| x.is_finite()));
                if bytes.len() != 14 {
                    // A report of a wrong length switches nothing on and changes no current.
                    prop_assert!(was || !device.is_powered());
                    prop_assert!(device.currents == before.currents || device.currents == [0.0; 3]);
                }
                let mut report = [0; 64];
                if let Some(length) = device.send(now, &mut report) {
                    prop_assert_eq!(length, 14);
                }
            }
        }
    }
}
