//! The driver over a scripted connection. `sim/tests/woodenhaptics.rs` runs it against an emulated device.

use super::super::report::LENGTH;
use super::*;
use proptest::prelude::*;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

const MS: u64 = 1_000_000;

/// The far end of a connection: the replies to come, and the sent reports.
#[derive(Default)]
struct End {
    /// Reports that wait to be read.
    waiting: VecDeque<Vec<u8>>,
    /// The replies to the next reports sent; each reply is a number of reports.
    replies: VecDeque<Vec<Vec<u8>>>,
    sent: Vec<CurrentReport>,
    /// Total time waited.
    waited: Duration,
    gone: Option<i32>,
    /// Whether the device is gone as soon as it has answered.
    is_last: bool,
}

#[derive(Clone, Default)]
struct Link(Arc<Mutex<End>>);

impl Link {
    fn end<R>(&self, f: impl FnOnce(&mut End) -> R) -> R {
        f(&mut self.0.lock().expect("one thread"))
    }

    /// Adds replies of one report each.
    fn reply(&self, reports: impl IntoIterator<Item = EncoderReport>) {
        self.end(|end| {
            let each = reports.into_iter().map(|report| vec![short(&report)]);
            end.replies.extend(each);
        });
    }

    fn last(&self) -> CurrentReport {
        self.end(|end| *end.sent.last().expect("something was sent"))
    }
}

impl Transport for Link {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        self.end(|end| {
            if let Some(report) = end.waiting.pop_front() {
                let length = report.len().min(buffer.len());
                buffer[..length].copy_from_slice(&report[..length]);
                return Ok(length);
            }
            end.waited += wait;
            end.gone.map_or(Ok(0), Err)
        })
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.end(|end| {
            if let Some(number) = end.gone {
                return Err(number);
            }
            end.sent
                .push(CurrentReport::decode(bytes, Form::Short).expect("a report"));
            let reply = end.replies.pop_front().unwrap_or_default();
            end.waiting.extend(reply);
            if end.is_last {
                end.gone = Some(5);
            }
            Ok(())
        })
    }
}

fn short(report: &EncoderReport) -> Vec<u8> {
    report.encode()[..LENGTH].to_vec()
}

fn at(motors: [i16; 3]) -> EncoderReport {
    let [a, b, c] = motors;
    EncoderReport {
        encoders: [a, b, c, 0, 0, 0],
        info: 0,
    }
}

fn pressed(motors: [i16; 3]) -> EncoderReport {
    EncoderReport {
        info: EncoderReport::CALIBRATE,
        ..at(motors)
    }
}

/// The counters at the origin of the default device.
fn origin() -> [i16; 3] {
    let kinematics = Kinematics::new(&Geometry::default()).unwrap();
    counts_at(&kinematics, &Vec3::zeros())
        .unwrap()
        .map(|count| count as i16)
}

fn open(home: Option<Vec3>) -> (WoodenHaptics<Link>, Link) {
    let link = Link::default();
    let keep = link.clone();
    let setup = WoodenHapticsConfig {
        home,
        ..WoodenHapticsConfig::default()
    };
    let driver = WoodenHaptics::open(&setup, move || Ok(keep.clone()), counted(MS)).unwrap();
    (driver, link)
}

/// A device that was calibrated at its origin, at rest there.
fn calibrated() -> (WoodenHaptics<Link>, Link) {
    let (mut driver, link) = open(None);
    link.reply([at(origin()); 4]);
    driver.calibrate(&Vec3::zeros()).unwrap();
    driver.exchange(&push()).unwrap();
    driver.exchange(&push()).unwrap();
    (driver, link)
}

fn push() -> Wrench {
    Wrench {
        force: Vec3::new(0.3, 1.0, -0.4),
        moment: Vec3::new(9.0, 9.0, 9.0),
    }
}

const ZEROS: [i16; 3] = [0; 3];

#[test]
fn there_is_no_force_and_no_state_before_calibration() {
    let (mut driver, link) = open(None);
    link.reply([at([5, 6, 7]); 20]);
    for _ in 0..20 {
        assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    }
    assert!(!driver.is_calibrated());
    assert!(link.end(|end| {
        end.sent
            .iter()
            .all(|sent| *sent == CurrentReport::default())
    }));
    assert_eq!(driver.counts().good, 20);
}

#[test]
fn calibration_sets_the_counters_once_and_waits_for_them() {
    let (mut driver, link) = open(None);
    let [a, b, c] = origin();
    // The first report was sampled before the counters were set. The hand moves by a count meanwhile.
    link.reply([at(ZEROS), at([9000, 0, 0]), at([a, b + 1, c])]);
    driver.calibrate(&Vec3::zeros()).unwrap();
    link.end(|end| {
        let set = CurrentReport::set_counters([a, b, c]);
        let zero = CurrentReport::default();
        assert_eq!(end.sent, [zero, set, zero]);
    });
    assert!(driver.is_calibrated());
    // A force takes effect in the next exchange.
    link.reply([at(origin())]);
    let state = driver.exchange(&push()).unwrap();
    assert!(state.pose.position.norm() < 60e-6, "{state:?}");
    let kinematics = *driver.kinematics();
    let angles = kinematics.angles([a, b + 1, c].map(i64::from));
    let wanted = kinematics.limited(kinematics.currents(angles, &push().force));
    let sent = link.last();
    assert_eq!((sent.currents, sent.command), (wanted, 0));
    assert_ne!(wanted, ZEROS);
}

#[test]
fn counters_that_are_not_taken_are_an_error() {
    let (mut driver, link) = open(None);
    link.reply([at([9000, 0, 0]); 20]);
    let error = driver.calibrate(&Vec3::zeros()).unwrap_err();
    assert_eq!(error, CalibrationError::NotTaken(DeviceError::NoReport));
    assert_eq!(link.end(|end| end.sent.len()), 1 + usize::from(TRIES));
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    assert_eq!(link.last(), CurrentReport::default());
    // A silent device takes none, either.
    let (mut driver, _) = open(None);
    let error = driver.calibrate(&Vec3::zeros()).unwrap_err();
    assert!(error.to_string().contains("5 reports"), "{error}");
    let far = Vec3::new(1.0, 0.0, 0.0);
    let error = driver.calibrate(&far).unwrap_err();
    assert_eq!(error, CalibrationError::OutOfReach(far));
}

#[test]
fn the_button_calibrates_at_home_only_when_it_is_pressed_anew() {
    let (mut driver, link) = open(Some(Vec3::zeros()));
    // The flag is old: to clear it, the driver sets the counters to their present values.
    link.reply([
        pressed([40, 50, 60]),
        at([40, 50, 60]),
        pressed([41, 50, 60]),
    ]);
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    assert_eq!(link.last(), CurrentReport::default());
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    assert_eq!(link.last(), CurrentReport::set_counters([40, 50, 60]));
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    assert_eq!(link.last(), CurrentReport::default());
    // The operator pressed it at home.
    link.reply([at(origin())]);
    let state = driver.exchange(&push()).unwrap();
    assert_eq!(link.last(), CurrentReport::set_counters(origin()));
    assert!(state.pose.position.norm() < 60e-6);
    // On a calibrated device the button has no effect.
    link.reply([pressed(origin()), pressed(origin())]);
    assert!(driver.exchange(&push()).is_ok() && driver.exchange(&push()).is_ok());
    assert_ne!(link.last().currents, ZEROS);
    // Without a home position, the button never has an effect.
    let (mut driver, link) = open(None);
    link.reply([at(ZEROS), pressed(ZEROS), pressed(ZEROS), pressed(ZEROS)]);
    for _ in 0..4 {
        assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
        assert_eq!(link.last(), CurrentReport::default());
    }
}

#[test]
fn the_newest_of_the_reports_is_taken_and_old_ones_are_discarded() {
    let (mut driver, link) = calibrated();
    let [a, b, c] = origin();
    let before = *driver.counts();
    link.end(|end| {
        // Two reports wait before the exchange, three answer it.
        end.waiting.extend([short(&at([a + 9, b, c])), vec![1, 2]]);
        end.replies
            .push_back([1, 2, 3].map(|k| short(&at([a, b, c + k]))).to_vec());
    });
    let state = driver.exchange(&push()).unwrap();
    let kinematics = driver.kinematics();
    let angles = kinematics.angles([a, b, c + 3].map(i64::from));
    assert_eq!(state.pose.position, kinematics.forward(angles));
    let after = driver.counts();
    assert_eq!(after.superseded - before.superseded, 2 + 2);
    assert_eq!((after.good - before.good, after.corrupt), (1, 0));
}

#[test]
fn a_flood_is_read_a_queue_at_a_time() {
    let (mut driver, link) = calibrated();
    let report = short(&at(origin()));
    link.end(|end| {
        end.waiting.extend(std::iter::repeat_n(report.clone(), 100));
        end.replies.push_back(vec![report; 100]);
    });
    driver.exchange(&push()).unwrap();
    assert_eq!(link.end(|end| end.waiting.len()), 200 - 2 * QUEUE);
}

#[test]
fn silence_is_a_missing_state_after_ten_milliseconds() {
    let (mut driver, link) = calibrated();
    link.end(|end| end.waited = Duration::ZERO);
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    assert_eq!(link.end(|end| end.waited), WAIT);
    assert_eq!(driver.counts().silent, 1);
    // The counters still hold.
    link.reply([at(origin())]);
    assert!(driver.exchange(&push()).is_ok());
    // A device that is opened may still have to send its first report.
    let (mut driver, link) = open(None);
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    assert_eq!(link.end(|end| end.waited), 2 * WAIT);
}

#[test]
fn reports_of_a_wrong_length_are_corrupt() {
    let (mut driver, link) = calibrated();
    let good = short(&at(origin()));
    let mut long = good.clone();
    long.push(0);
    for bad in [
        vec![7],
        good[..13].to_vec(),
        long,
        vec![0; 64],
        vec![0; 65],
        vec![0; 100],
    ] {
        link.end(|end| end.replies.push_back(vec![bad.clone()]));
        let found = driver.exchange(&push());
        assert_eq!(found, Err(DeviceError::Corrupt(Corruption::Length)));
        // A good report beside it is taken.
        link.end(|end| end.replies.push_back(vec![good.clone(), bad]));
        assert!(driver.exchange(&push()).is_ok());
    }
    assert_eq!(driver.counts().corrupt, 12);
}

#[test]
fn a_jump_is_corrupt_and_takes_the_force_until_the_counters_are_back() {
    let (mut driver, link) = calibrated();
    let [a, b, c] = origin();
    assert_ne!(link.last().currents, ZEROS);
    link.reply([at([a, b, c + 2000]), at([a, b, c]), at([a, b, c])]);
    let corrupt = Err(DeviceError::Corrupt(Corruption::Range));
    let rendering = |driver: &mut WoodenHaptics<Link>, wrench: &Wrench| {
        driver.exchange(wrench).map(|state| state.rendering)
    };
    assert_eq!(driver.exchange(&push()), corrupt);
    // The state after currents that were left out says so.
    assert_eq!(rendering(&mut driver, &push()), Ok(Rendering::LetGo));
    assert_eq!(link.last().currents, ZEROS);
    assert_eq!(rendering(&mut driver, &push()), Ok(Rendering::Commanded));
    assert_ne!(link.last().currents, ZEROS);
    assert_eq!((driver.counts().corrupt, driver.counts().restarts), (1, 0));
    // No force was asked for, so none was let go. A force that is too small for a current does not count as left out.
    link.reply([at([a, b, c + 2000]), at([a, b, c]), at([a, b, c])]);
    assert_eq!(driver.exchange(&push()), corrupt);
    assert_eq!(
        rendering(&mut driver, &Wrench::zero()),
        Ok(Rendering::Commanded)
    );
    let small = Wrench {
        force: push().force * 1e-6,
        ..push()
    };
    assert_eq!(rendering(&mut driver, &small), Ok(Rendering::Commanded));
    assert_eq!(link.last().currents, ZEROS);
}

#[test]
fn a_restart_loses_the_position_until_the_next_calibration() {
    let (mut driver, link) = calibrated();
    link.reply([at(ZEROS); 12]);
    for k in 0..12 {
        let corrupt = DeviceError::Corrupt(Corruption::Range);
        let expected = if k < 8 {
            corrupt
        } else {
            DeviceError::NoReport
        };
        assert_eq!(driver.exchange(&push()), Err(expected), "{k}");
        // The first report of the restart comes after a force was sent.
        assert_eq!(link.last().currents == ZEROS, k > 0, "{k}");
    }
    assert_eq!(driver.counts().restarts, 1);
    assert!(!driver.is_calibrated());
    link.reply([at(origin()); 3]);
    driver.calibrate(&Vec3::zeros()).unwrap();
    assert!(driver.exchange(&push()).is_ok());
}

#[test]
fn a_lost_device_is_opened_again_and_begins_anew() {
    let (mut driver, link) = calibrated();
    link.end(|end| end.gone = Some(19));
    let gone = Err(DeviceError::Disconnected(19));
    assert_eq!(driver.exchange(&push()), gone);
    driver.release();
    assert_eq!(driver.reopen(), Err(DeviceError::Disconnected(19)));
    link.end(|end| end.gone = None);
    assert_eq!(driver.reopen(), Ok(()));
    assert_eq!(link.last(), CurrentReport::default());
    link.reply([at(origin()); 3]);
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    assert!(!driver.is_calibrated());
    driver.calibrate(&Vec3::zeros()).unwrap();
    link.reply([at(origin())]);
    assert!(driver.exchange(&push()).is_ok());
    driver.release();
    assert_eq!(link.last(), CurrentReport::default());
    // A device that is lost during calibration.
    link.end(|end| end.gone = Some(5));
    let error = driver.calibrate(&Vec3::zeros()).unwrap_err();
    assert_eq!(
        error,
        CalibrationError::NotTaken(DeviceError::Disconnected(5))
    );
}

/// The system gives a device that comes back its old name only if nobody has the old file open.
#[test]
fn a_lost_device_is_closed_before_it_is_looked_for() {
    let (end, alive) = (Link::default(), Arc::new(Mutex::new(Vec::new())));
    let (opened, seen) = (end.clone(), Arc::clone(&alive));
    let open = move || {
        // The test, this closure, and the connection that is open.
        seen.lock().unwrap().push(Arc::strong_count(&opened.0) - 2);
        opened.end(|end| end.gone).map_or(Ok(opened.clone()), Err)
    };
    let mut driver =
        WoodenHaptics::open(&WoodenHapticsConfig::default(), open, counted(MS)).unwrap();
    end.end(|end| end.gone = Some(5));
    assert_eq!(driver.exchange(&push()), Err(DeviceError::Disconnected(5)));
    // The connection is closed at once, not only when the driver looks for the device: the new device may come sooner.
    assert_eq!(Arc::strong_count(&end.0), 2);
    assert!(driver.reopen().is_err());
    end.end(|end| end.gone = None);
    assert_eq!(driver.reopen(), Ok(()));
    // The same holds if the driver has not noticed the loss.
    assert_eq!(driver.reopen(), Ok(()));
    assert_eq!(*alive.lock().unwrap(), [0; 4]);
}

/// A device sends a report unasked when it is opened. The report may still be under way.
#[test]
fn the_report_that_waits_after_a_reconnection_is_discarded() {
    let (mut driver, link) = calibrated();
    link.end(|end| end.gone = Some(19));
    assert!(driver.exchange(&push()).is_err());
    link.end(|end| end.gone = None);
    assert_eq!(driver.reopen(), Ok(()));
    let before = link.end(|end| end.waited);
    link.reply([at(origin())]);
    assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
    // The first exchange after the reconnection waits for that report, and the next does not.
    let first = link.end(|end| end.waited).saturating_sub(before);
    assert_eq!(first, WAIT);
    link.reply([at(origin())]);
    let _ = driver.exchange(&push());
    assert_eq!(link.end(|end| end.waited).saturating_sub(before), WAIT);
}

#[test]
fn the_clock_of_the_states_starts_at_the_first_exchange_and_never_goes_back() {
    let link = Link::default();
    let keep = link.clone();
    let mut times = [500, 600, 700, 600, 900].into_iter();
    let clock = move || times.next().unwrap_or(1000);
    let mut driver = WoodenHaptics::open(
        &WoodenHapticsConfig::default(),
        move || Ok(keep.clone()),
        clock,
    )
    .unwrap();
    link.reply([at(origin()); 5]);
    driver.calibrate(&Vec3::zeros()).unwrap();
    let found = [0; 3].map(|_| driver.exchange(&push()).unwrap().device_time_ns);
    assert_eq!(found, [200, 200, 400]);
}

#[test]
fn a_device_that_cannot_be_opened_says_why() {
    let refused = |setup: &WoodenHapticsConfig| {
        WoodenHaptics::<Link>::open(setup, || Err(13), counted(MS))
            .err()
            .expect("refused")
            .to_string()
    };
    assert!(refused(&WoodenHapticsConfig::default()).contains("system error 13"));
    let far = WoodenHapticsConfig {
        home: Some(Vec3::new(0.0, 0.0, 2.0)),
        ..WoodenHapticsConfig::default()
    };
    assert!(refused(&far).contains("beyond the reach"));
    let mut bad = WoodenHapticsConfig::default();
    bad.geometry.torque_constant = 0.0;
    assert!(refused(&bad).contains("torque constant"));
}

#[test]
fn a_calibration_in_another_pose_is_no_motion() {
    let (mut driver, link) = calibrated();
    let place = Vec3::new(0.02, 0.03, -0.01);
    let there = counts_at(driver.kinematics(), &place).unwrap();
    link.reply([at(there.map(|count| count as i16)); 3]);
    driver.calibrate(&place).unwrap();
    let state = driver.exchange(&push()).unwrap();
    // Half a count of each joint.
    assert!((state.pose.position - place).norm() < 1e-4, "{state:?}");
    assert_eq!(state.twist.linear, Vec3::zeros());
}

#[test]
fn the_velocity_is_that_of_the_handle() {
    let (mut driver, link) = calibrated();
    let [a, b, c] = origin();
    let kinematics = *driver.kinematics();
    let turn = [10, 8, -6];
    let mut state = DeviceState::resting();
    for k in 1..=20 {
        link.reply([at([a + 10 * k, b + 8 * k, c - 6 * k])]);
        state = driver.exchange(&push()).unwrap();
    }
    // The slope over four milliseconds is the velocity two milliseconds ago.
    let then = [a + 10 * 18, b + 8 * 18, c - 6 * 18].map(i64::from);
    let angles = kinematics.angles(then);
    let columns = kinematics.jacobian(angles);
    let rates = kinematics.angles(turn).map(|angle| angle * 1000.0);
    let expected: Vec3 = columns
        .iter()
        .zip(rates)
        .map(|(column, rate)| column * rate)
        .sum();
    // The third derivative: 2 ms, 2 rad/s and 0.5 m make an error of 2e-6 m/s * 8 / 6.
    assert!(
        (state.twist.linear - expected).norm() < 1e-5,
        "{state:?} {expected}"
    );
}

/// The report that arrived before the device disappeared is good. Without a report, the device is lost at once.
#[test]
fn the_last_report_before_the_end_is_good() {
    let gone = Err(DeviceError::Disconnected(5));
    for answers in [1, 0] {
        let (mut driver, link) = calibrated();
        link.reply(vec![at(origin()); answers]);
        link.end(|end| end.is_last = true);
        if answers > 0 {
            assert!(driver.exchange(&push()).is_ok());
        }
        assert_eq!(driver.exchange(&push()), gone);
    }
}

#[test]
fn no_button_is_no_calibration() {
    let (mut driver, link) = open(Some(Vec3::zeros()));
    link.reply([at([40, 50, 60]); 6]);
    for _ in 0..6 {
        assert_eq!(driver.exchange(&push()), Err(DeviceError::NoReport));
        assert_eq!(link.last(), CurrentReport::default());
    }
    assert!(!driver.is_calibrated());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_give_finite_states_and_currents_in_range(
        replies in prop::collection::vec(
            prop::collection::vec(prop::collection::vec(any::<u8>(), 0..70), 0..4), 1..40,
        ),
        force in prop::array::uniform3(any::<f64>()),
        home in any::<bool>(),
    ) {
        let (mut driver, link) = open(home.then(Vec3::zeros));
        link.reply([at(origin()); 2]);
        driver.calibrate(&Vec3::zeros()).unwrap();
        let exchanges = replies.len();
        link.end(|end| end.replies.extend(replies));
        let wrench = Wrench { force: Vec3::from(force), moment: Vec3::zeros() };
        for _ in 0..exchanges {
            let known = driver.is_calibrated();
            if let Ok(state) = driver.exchange(&wrench) {
                prop_assert!(state.is_finite());
            }
            let sent = link.last().currents;
            prop_assert!(sent.iter().all(|current| (-3000..=3000).contains(current)));
            prop_assert!(known || sent == ZEROS);
        }
    }
}
