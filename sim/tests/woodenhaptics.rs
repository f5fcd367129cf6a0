//! The driver of WoodenHaptics against an emulated device, over a connection in memory and under virtual time.

use devices::woodenhaptics::driver::WAIT;
use devices::woodenhaptics::{Form, Geometry, Kinematics, WoodenHaptics, WoodenHapticsConfig};
use devices::{Exchange, Transport};
use proptest::prelude::*;
use rt_core::{Corruption, DeviceError, Vec3, Wrench};
use sim::emulate::{self, Emulator};
use sim::{DeviceFile, DeviceModel, Hand, SimDevice, Trajectory};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const MS: u64 = 1_000_000;
/// Time of a report on its way (ns), so an exchange takes a millisecond.
const WAY_NS: u64 = MS / 2;
/// Error number of a disconnected device (ENODEV).
const NO_DEVICE: i32 = 19;

/// The device and its connection.
struct World {
    device: emulate::WoodenHaptics,
    now_ns: u64,
    /// True position (m) and velocity (m/s) when the device last sent a report.
    sampled: (Vec3, Vec3),
    /// The last report that the host read.
    last: Option<Vec<u8>>,
    /// The bytes that every report of the device has in place of its own.
    replaced: Option<Vec<u8>>,
    /// Whether reports are lost, both ways.
    silent: bool,
    gone: bool,
}

#[derive(Clone)]
struct Link(Arc<Mutex<World>>);

impl Link {
    fn new(device: SimDevice, setup: &WoodenHapticsConfig) -> Self {
        let device = emulate::WoodenHaptics::new(device, &setup.geometry, setup.form);
        Self(Arc::new(Mutex::new(World {
            device: device.expect("a sound geometry"),
            now_ns: 5 * MS,
            sampled: (Vec3::zeros(), Vec3::zeros()),
            last: None,
            replaced: None,
            silent: false,
            gone: false,
        })))
    }

    fn world<R>(&self, f: impl FnOnce(&mut World) -> R) -> R {
        f(&mut self.0.lock().expect("one thread"))
    }

    /// True position of the handle (m).
    fn position(&self) -> Vec3 {
        self.world(|world| world.device.device().position())
    }

    /// True position (m) and velocity (m/s) when the device last sent a report.
    fn sampled(&self) -> (Vec3, Vec3) {
        self.world(|world| world.sampled)
    }

    /// The force that the motors hold (N).
    fn force(&self) -> Vec3 {
        self.world(|world| world.device.device().force())
    }

    fn open(&self, setup: &WoodenHapticsConfig) -> WoodenHaptics<Self> {
        let (link, clock) = (self.clone(), self.clone());
        let open = move || {
            if link.world(|world| world.gone) {
                Err(NO_DEVICE)
            } else {
                Ok(link.clone())
            }
        };
        let clock = move || clock.world(|world| world.now_ns);
        WoodenHaptics::open(setup, open, clock).expect("it is there")
    }
}

impl Transport for Link {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        self.world(|world| {
            if world.gone {
                return Err(NO_DEVICE);
            }
            let mut report = [0; 64];
            let sent = world.device.send(world.now_ns, &mut report);
            let Some(length) = sent.filter(|_| !world.silent) else {
                world.now_ns += wait.as_nanos() as u64;
                return Ok(0);
            };
            world.now_ns += WAY_NS;
            let device = world.device.device();
            world.sampled = (device.position(), device.velocity());
            let own = report[..length].to_vec();
            let sent = world.replaced.clone().unwrap_or(own);
            world.last = Some(sent.clone());
            let length = sent.len().min(buffer.len());
            buffer[..length].copy_from_slice(&sent[..length]);
            Ok(length)
        })
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.world(|world| {
            if world.gone {
                return Err(NO_DEVICE);
            }
            world.now_ns += WAY_NS;
            if !world.silent {
                world.device.receive(bytes, world.now_ns);
            }
            Ok(())
        })
    }
}

/// The device model, with motors that make every force of the largest currents.
fn model() -> DeviceModel {
    let file = DeviceFile::named("woodenhaptics").expect("a built-in device");
    DeviceModel {
        max_force: 100.0,
        ..file.model
    }
}

/// A device at `start` that is free or held by a hand.
fn device(hand: Option<Hand>, start: Vec3) -> SimDevice {
    let device = SimDevice::new(model(), hand, 1e-3).expect("a sound model");
    device.starting_at(start).expect("a place")
}

/// A hand that is still for 0.1 s, while the device is calibrated, and then moves from place to place at up to 0.5 m/s.
fn moving() -> Hand {
    let places = [
        Vec3::new(0.06, 0.02, -0.03),
        Vec3::new(-0.01, 0.06, 0.02),
        Vec3::new(-0.06, -0.05, 0.04),
        Vec3::new(0.02, 0.01, -0.05),
    ];
    let still = [(0.0, Vec3::zeros()), (0.1, Vec3::zeros())];
    let along = (0..12_u8).zip(places.into_iter().cycle());
    let moves = along.map(|(k, place)| (0.5 + 0.4 * f64::from(k), place));
    let path: Vec<_> = still.into_iter().chain(moves).collect();
    Hand::new(Trajectory::new_waypoints(&path).expect("a slow motion"))
}

fn kinematics(setup: &WoodenHapticsConfig) -> Kinematics {
    Kinematics::new(&setup.geometry).expect("a sound geometry")
}

/// The position (m) nearest to `near` at which every encoder is on a count, and the counts.
fn on_counts(setup: &WoodenHapticsConfig, near: &Vec3) -> (Vec3, [i64; 3]) {
    let kinematics = kinematics(setup);
    let angles = kinematics.inverse(near).expect("in the workspace");
    let counts = kinematics.counts(angles).map(|n| n.round() as i64);
    (kinematics.forward(kinematics.angles(counts)), counts)
}

/// Half a count of every joint, as a displacement of the handle at `position` (m), with a margin of two per cent for the
/// change of the Jacobian across a count.
fn half_a_count(setup: &WoodenHapticsConfig, position: &Vec3) -> f64 {
    let kinematics = kinematics(setup);
    let angles = kinematics.inverse(position).expect("in the workspace");
    let columns = kinematics.jacobian(angles);
    let each = columns.iter().zip(kinematics.angle_per_count());
    let sum: f64 = each.map(|(column, angle)| column.norm() * angle).sum();
    0.51 * sum
}

fn push(force: Vec3) -> Wrench {
    Wrench {
        force,
        moment: Vec3::zeros(),
    }
}

fn calibrated(hand: Option<Hand>, setup: &WoodenHapticsConfig) -> (WoodenHaptics<Link>, Link) {
    let (start, _) = on_counts(setup, &Vec3::zeros());
    let link = Link::new(device(hand, start), setup);
    let mut driver = link.open(setup);
    driver.calibrate(&start).expect("the device takes it");
    (driver, link)
}

#[test]
fn positions_are_within_half_a_count_of_each_joint() {
    for form in [Form::Short, Form::Long] {
        let setup = WoodenHapticsConfig {
            form,
            ..WoodenHapticsConfig::default()
        };
        let (mut driver, link) = calibrated(Some(moving()), &setup);
        let (mut farthest, mut fastest): (f64, f64) = (0.0, 0.0);
        let mut before = MS;
        for _ in 0..3000 {
            let state = driver.exchange(&Wrench::zero()).expect("a report came");
            let (exact, velocity) = link.sampled();
            let error = (state.pose.position - exact).norm();
            assert!(
                error <= half_a_count(&setup, &exact),
                "{error} m at {exact}"
            );
            farthest = farthest.max(exact.norm());
            // Half a count of every joint at each end of four milliseconds is 0.04 m/s. The hand accelerates by 6 m/s^2,
            // and the estimate lags by two milliseconds.
            let error = (state.twist.linear - velocity).norm();
            assert!(error < 0.06, "{error} m/s");
            fastest = fastest.max(velocity.norm());
            // An exchange takes a millisecond. The calibration took two, and the clock starts at the end of the first.
            before += MS;
            assert_eq!(state.device_time_ns, before);
        }
        assert!(
            farthest > 0.05 && fastest > 0.3,
            "{farthest} m, {fastest} m/s"
        );
        assert_eq!(driver.counts().corrupt + driver.counts().silent, 0);
    }
}

#[test]
fn fine_counters_wrap_again_and_again() {
    // 64,000 counts a turn: a radian of joint a is 163,000 counts, two and a half ranges.
    let geometry = Geometry {
        counts_per_turn: [64_000.0; 3],
        ..Geometry::default()
    };
    let setup = WoodenHapticsConfig {
        geometry,
        ..WoodenHapticsConfig::default()
    };
    let (mut driver, link) = calibrated(Some(moving()), &setup);
    let kinematics = kinematics(&setup);
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for _ in 0..3000 {
        let state = driver.exchange(&Wrench::zero()).expect("a report came");
        let (exact, _) = link.sampled();
        let error = (state.pose.position - exact).norm();
        assert!(
            error <= half_a_count(&setup, &exact),
            "{error} m at {exact}"
        );
        let [a, _, _] = kinematics.counts(kinematics.inverse(&exact).expect("in reach"));
        (least, most) = (least.min(a), most.max(a));
    }
    assert!(most - least > 65_536.0, "{least} to {most}: it wraps");
}

#[test]
fn a_silence_loses_nothing() {
    let setup = WoodenHapticsConfig::default();
    let (mut driver, link) = calibrated(Some(moving()), &setup);
    for k in 0..1500 {
        // 30 exchanges without a report are 0.3 s, in which the hand moves on.
        let silent = (500..530).contains(&k);
        link.world(|world| world.silent = silent);
        let before = link.world(|world| world.now_ns);
        let state = driver.exchange(&Wrench::zero());
        if silent {
            assert_eq!(state, Err(DeviceError::NoReport), "{k}");
            let waited = link.world(|world| world.now_ns) - before;
            assert_eq!(waited, WAY_NS + WAIT.as_nanos() as u64);
            continue;
        }
        let (exact, _) = link.sampled();
        let error = (state.expect("a report came").pose.position - exact).norm();
        assert!(
            error <= half_a_count(&setup, &exact),
            "{error} m at {exact}"
        );
    }
    assert_eq!((driver.counts().silent, driver.counts().corrupt), (30, 0));
}

#[test]
fn repeated_reports_are_a_handle_at_rest() {
    let (mut driver, link) = calibrated(Some(moving()), &WoodenHapticsConfig::default());
    for _ in 0..1000 {
        driver.exchange(&Wrench::zero()).expect("a report came");
    }
    link.world(|world| world.replaced = world.last.clone());
    let mut first = None;
    for k in 0..10 {
        let state = driver.exchange(&Wrench::zero()).expect("a report came");
        let place = *first.get_or_insert(state.pose.position);
        assert_eq!(state.pose.position, place);
        // The velocity is zero once the window holds repeats alone.
        let moving = state.twist.linear != Vec3::zeros();
        assert_eq!(moving, k < 3, "{k}: {state:?}");
    }
    assert_eq!(driver.counts().corrupt, 0);
}

#[test]
fn the_motors_make_the_commanded_force() {
    let setup = WoodenHapticsConfig::default();
    let kinematics = kinematics(&setup);
    let mut saturated = 0;
    for k in 0..200 {
        let t = f64::from(k);
        let direction =
            |p: f64| Vec3::new(libm::sin(p), libm::cos(1.7 * p), libm::sin(2.3 * p + 1.0));
        let (start, counts) = on_counts(&setup, &(direction(t).normalize() * 0.0005 * t));
        let link = Link::new(device(None, start), &setup);
        let mut driver = link.open(&setup);
        driver.calibrate(&start).expect("the device takes it");
        let force = direction(0.37 * t + 2.0).normalize() * 0.04 * t;
        driver.exchange(&push(force)).expect("a report came");
        // The force that the largest currents leave.
        let angles = kinematics.angles(counts);
        let currents = kinematics.currents(angles, &force);
        let largest = currents.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let left = force * (3000.0 / largest).min(1.0);
        saturated += i32::from(largest > 3000.0);
        // The device has moved by some micrometres under the currents since then, and the force with it.
        let now = kinematics.inverse(&link.position()).expect("in reach");
        let held = kinematics.currents(now, &link.force());
        for (held, wanted) in held.iter().zip(kinematics.currents(angles, &left)) {
            let error = held - wanted;
            assert!(
                error.abs() <= 0.5 + 1e-6,
                "{error} mA of {force} N at {start}"
            );
        }
        let error = link.force() - left;
        // In the workspace, half a milliampere of each motor makes less than 5 mN.
        assert!(error.norm() < 5e-3, "{error} N of {force} N at {start}");
    }
    assert!((20..150).contains(&saturated), "{saturated} of 200");
}

#[test]
fn the_motors_make_the_commanded_force_in_motion() {
    let (mut driver, link) = calibrated(Some(moving()), &WoodenHapticsConfig::default());
    for k in 0..3000 {
        let t = f64::from(k) * 0.01;
        let force = Vec3::new(libm::sin(t), libm::cos(1.7 * t), libm::sin(2.3 * t)) * 1.5;
        driver.exchange(&push(force)).expect("a report came");
        // The currents are those of the last report, a millisecond and 0.5 mm ago: 0.4 % of an arm of 0.12 m, twice for
        // the two links. The currents are rounded to 1 mA.
        let error = (link.force() - force).norm();
        assert!(error < 0.01 * force.norm() + 5e-3, "{error} N of {force} N");
    }
}

#[test]
fn a_jump_is_refused_and_a_restart_asks_for_calibration() {
    let setup = WoodenHapticsConfig::default();
    let (mut driver, link) = calibrated(None, &setup);
    let force = push(Vec3::new(0.0, 0.0, 0.3));
    driver.exchange(&force).expect("a report came");
    assert!((link.force() - force.force).norm() < 5e-3);
    let corrupt = Err(DeviceError::Corrupt(Corruption::Range));
    // One wild report: the force is off for an exchange.
    link.world(|world| {
        let mut wild = world.last.clone().expect("one came");
        wild[5] ^= 0x10;
        world.replaced = Some(wild);
    });
    assert_eq!(driver.exchange(&force), corrupt);
    link.world(|world| world.replaced = None);
    assert!(driver.exchange(&force).is_ok());
    assert_eq!(link.force(), Vec3::zeros());
    assert!(driver.exchange(&force).is_ok());
    assert!(link.force() != Vec3::zeros());
    // The device begins to count anew.
    link.world(|world| world.device.restart(world.now_ns));
    for k in 0..20 {
        let expected = if k < 8 {
            corrupt
        } else {
            Err(DeviceError::NoReport)
        };
        assert_eq!(driver.exchange(&force), expected, "{k}");
        assert!(k == 0 || link.force() == Vec3::zeros(), "{k}");
    }
    assert_eq!(
        (driver.counts().restarts, driver.is_calibrated()),
        (1, false)
    );
    let here = link.position();
    driver.calibrate(&here).expect("the device takes it");
    let state = driver.exchange(&force).expect("a report came");
    assert!((state.pose.position - here).norm() <= 2.0 * half_a_count(&setup, &here));
}

#[test]
fn the_button_calibrates_at_home() {
    let (home, _) = on_counts(
        &WoodenHapticsConfig::default(),
        &Vec3::new(-0.03, 0.02, 0.04),
    );
    let setup = WoodenHapticsConfig {
        home: Some(home),
        form: Form::Long,
        ..WoodenHapticsConfig::default()
    };
    let link = Link::new(device(None, home), &setup);
    let mut driver = link.open(&setup);
    for _ in 0..10 {
        assert!(driver.exchange(&push(Vec3::x())).is_err());
        assert_eq!(link.force(), Vec3::zeros());
    }
    link.world(|world| {
        world.device.press_calibration();
        world.device.press_handle(true);
    });
    let states: Vec<_> = (0..3).map(|_| driver.exchange(&push(Vec3::x()))).collect();
    // The first report has the flag, the second has the counters that the driver set.
    assert_eq!(states[0], Err(DeviceError::NoReport));
    let state = states[1].expect("calibrated");
    assert!((state.pose.position - home).norm() < 1e-12);
    assert_eq!(state.buttons, 1);
    assert!(states[2].is_ok() && link.force() != Vec3::zeros());
}

#[test]
fn a_wrong_length_is_corrupt_and_no_sign_of_life() {
    let (mut driver, link) = calibrated(None, &WoodenHapticsConfig::default());
    let force = push(Vec3::new(0.0, 0.2, 0.0));
    for bad in [vec![0; 13], vec![0; 15], vec![0; 64], vec![1]] {
        link.world(|world| world.replaced = Some(bad));
        let found = driver.exchange(&force);
        assert_eq!(found, Err(DeviceError::Corrupt(Corruption::Length)));
    }
    link.world(|world| world.replaced = None);
    assert!(driver.exchange(&force).is_ok());
    // A report of a wrong length to the device does not keep its motors on.
    link.world(|world| {
        assert!(world.device.device().force() != Vec3::zeros());
        let last = world.now_ns;
        for k in 1..=50 {
            world.device.receive(&[1; 64], last + k * 10 * MS);
        }
        assert!(!world.device.is_powered());
        assert_eq!(world.device.device().force(), Vec3::zeros());
    });
}

#[test]
fn the_motors_are_off_half_a_second_after_the_driver_stops() {
    let (mut driver, link) = calibrated(None, &WoodenHapticsConfig::default());
    let force = push(Vec3::new(0.0, 0.2, 0.0));
    driver.exchange(&force).expect("a report came");
    // The last report arrived half a millisecond before the reply did.
    let last = link.world(|world| world.now_ns) - WAY_NS;
    link.world(|world| {
        world.device.run(last + 500 * MS - 1);
        assert!(world.device.device().force() != Vec3::zeros());
        world.device.run(last + 500 * MS);
        assert_eq!(world.device.device().force(), Vec3::zeros());
        world.now_ns = last + 500 * MS;
    });
    // A driver that is let go switches them off at once.
    driver.exchange(&force).expect("a report came");
    assert!(link.force() != Vec3::zeros());
    driver.release();
    assert_eq!(link.force(), Vec3::zeros());
}

#[test]
fn a_device_that_is_plugged_in_again_has_no_force_until_it_is_calibrated() {
    let setup = WoodenHapticsConfig::default();
    let (mut driver, link) = calibrated(None, &setup);
    let force = push(Vec3::new(0.0, 0.2, 0.0));
    driver.exchange(&force).expect("a report came");
    let gone = Err(DeviceError::Disconnected(NO_DEVICE));
    link.world(|world| world.gone = true);
    assert_eq!(driver.exchange(&force), gone);
    assert_eq!(driver.reopen(), Err(DeviceError::Disconnected(NO_DEVICE)));
    link.world(|world| {
        world.gone = false;
        world.device.restart(world.now_ns);
    });
    driver.reopen().expect("it is back");
    for _ in 0..20 {
        assert_eq!(driver.exchange(&force), Err(DeviceError::NoReport));
        assert_eq!(link.force(), Vec3::zeros());
    }
    driver
        .calibrate(&link.position())
        .expect("the device takes it");
    let state = driver.exchange(&force).expect("a report came");
    assert!(link.force() != Vec3::zeros());
    // Its clock began anew.
    assert_eq!(state.device_time_ns, 22 * MS);
}

/// One event of a run.
#[derive(Clone, Debug)]
enum Event {
    Push([f64; 3]),
    /// The next reports have these bytes.
    Replace(Option<Vec<u8>>),
    Silence(bool),
    Restart,
    Button,
    Reopen,
    Calibrate([f64; 3]),
}

fn event() -> impl Strategy<Value = Event> {
    let push = || prop::array::uniform3(-20.0..20.0_f64).prop_map(Event::Push);
    prop_oneof![
        push(),
        push(),
        push(),
        push(),
        prop::array::uniform3(any::<f64>()).prop_map(Event::Push),
        prop::option::of(prop::collection::vec(any::<u8>(), 14)).prop_map(Event::Replace),
        prop::option::of(prop::collection::vec(any::<u8>(), 0..70)).prop_map(Event::Replace),
        any::<bool>().prop_map(Event::Silence),
        Just(Event::Restart),
        Just(Event::Button),
        Just(Event::Reopen),
        prop::array::uniform3(-0.2..0.2_f64).prop_map(Event::Calibrate),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100) })]

    #[test]
    fn a_device_that_is_not_calibrated_has_no_force_whatever_happens(
        events in prop::collection::vec(event(), 1..100), homed in any::<bool>(),
    ) {
        let setup = WoodenHapticsConfig { home: homed.then(Vec3::zeros), ..WoodenHapticsConfig::default() };
        let (mut driver, link) = calibrated(Some(moving()), &setup);
        for event in events {
            match event {
                Event::Push(force) => {
                    let known = driver.is_calibrated();
                    if let Ok(state) = driver.exchange(&push(Vec3::from(force))) {
                        prop_assert!(state.is_finite() && driver.is_calibrated());
                    }
                    let held = link.force();
                    prop_assert!(held.iter().all(|x| x.is_finite()), "{held}");
                    let heard = link.world(|world| !world.silent);
                    prop_assert!(known || !heard || held == Vec3::zeros(), "{held}");
                }
                Event::Replace(report) => link.world(|world| world.replaced = report),
                Event::Silence(silent) => link.world(|world| world.silent = silent),
                Event::Restart => link.world(|world| world.device.restart(world.now_ns)),
                Event::Button => link.world(|world| world.device.press_calibration()),
                Event::Reopen => prop_assert_eq!(driver.reopen(), Ok(())),
                Event::Calibrate(place) => {
                    let _ = driver.calibrate(&Vec3::from(place));
                }
            }
        }
    }
}
