//! The driver of the Falcon against the emulated device, in virtual time: boot, homing, positions, forces, faults.

use devices::falcon::boot::{Problem, Step, boot, packet_mode};
use devices::falcon::geometry::{CENTRE, Jacobian, STEP, inverse};
use devices::falcon::packet::Report;
use devices::falcon::{BootError, Falcon, FalconError, Firmware, Settings, Tries};
use devices::ftdi::{Chip, Control, Ftdi, PACKET, STATUS, SetupPacket, Usb};
use devices::{DeviceModel, Exchange, Transport};
use proptest::prelude::*;
use rt_core::{Corruption, DeviceError, DeviceState, Vec3, Wrench};
use sim::emulate::Emulator;
use sim::emulate::falcon::{
    Falcon as Emulated, Faults, MODEM, Settings as EmulatedSettings, UploadFault,
};
use sim::{Arm, Hand, SimDevice, Trajectory};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

/// Time of a USB transfer that goes out (ns): a frame at full speed has room for several.
const OUT_NS: u64 = 125_000;
/// Time between two looks of the host for a packet (ns).
const LOOK_NS: u64 = 25_000;

/// The emulated device, its clock, and the error that its USB transfers end with.
struct World {
    emulated: Emulated,
    now_ns: u64,
    transfers: u64,
    /// Error number of a transfer, by its index.
    error: Option<(u64, i32)>,
    /// The error of all later transfers.
    gone: Option<i32>,
    /// A packet in a buffer of the host controller, which no request to the chip empties.
    stale: Option<Vec<u8>>,
}

/// A connection to the world.
#[derive(Clone)]
struct Pipe(Arc<Mutex<World>>);

impl Pipe {
    fn new(emulated: Emulated) -> Self {
        Self(Arc::new(Mutex::new(World {
            emulated,
            now_ns: 0,
            transfers: 0,
            error: None,
            gone: None,
            stale: None,
        })))
    }

    fn world(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap()
    }

    /// The world, for the next transfer.
    fn transfer(&self) -> Result<MutexGuard<'_, World>, i32> {
        let mut world = self.world();
        let index = world.transfers;
        world.transfers += 1;
        if let Some(number) = world.gone {
            return Err(number);
        }
        match world.error {
            Some((at, number)) if at == index => Err(number),
            _ => Ok(world),
        }
    }

    fn clock(&self) -> impl FnMut() -> u64 + Send + 'static {
        let pipe = self.clone();
        move || pipe.world().now_ns
    }

    /// Lets time pass without an exchange with the device.
    fn wait(&self, ns: u64) {
        let mut world = self.world();
        world.now_ns += ns;
        let now_ns = world.now_ns;
        world.emulated.receive(&[], now_ns);
    }
}

impl Usb for Pipe {
    fn request(&mut self, setup: SetupPacket) -> Result<(), i32> {
        let mut world = self.transfer()?;
        world.now_ns += OUT_NS;
        let now_ns = world.now_ns;
        world.emulated.control(setup, now_ns)
    }

    fn bulk_in(&mut self, packet: &mut [u8; PACKET], wait: Duration) -> Result<usize, i32> {
        let mut world = self.transfer()?;
        let end_ns = world.now_ns + wait.as_nanos() as u64;
        if let Some(stale) = world.stale.take() {
            packet[..stale.len()].copy_from_slice(&stale);
            return Ok(stale.len());
        }
        loop {
            let now_ns = world.now_ns;
            if let Some(count) = world.emulated.send(now_ns, packet) {
                return Ok(count);
            }
            if now_ns >= end_ns {
                return Ok(0);
            }
            world.now_ns = end_ns.min(now_ns + LOOK_NS);
        }
    }

    fn bulk_out(&mut self, bytes: &[u8]) -> Result<(), i32> {
        let mut world = self.transfer()?;
        world.now_ns += OUT_NS;
        let now_ns = world.now_ns;
        world.emulated.receive(bytes, now_ns);
        Ok(())
    }
}

/// An image of some pieces, with all bytes.
fn image() -> Vec<u8> {
    (0..700_u32).map(|k| (k * 37 + k / 256) as u8).collect()
}

fn firmware() -> Firmware {
    Firmware::new(Path::new("novint.bin"), image()).unwrap()
}

/// The arm of a hand that holds the grip firmly.
const HOLD: Arm = Arm::RIGID;

/// A device with a hand that moves it along `path` (s, m).
fn emulated(path: &[(f64, Vec3)], faults: Faults) -> Pipe {
    let hand = Hand::new(Trajectory::new_waypoints(path).unwrap()).with_arm(HOLD);
    let model = DeviceModel::named("falcon").unwrap();
    let device = SimDevice::new(model, Some(hand), 1e-3).unwrap();
    let settings = EmulatedSettings {
        faults,
        ..EmulatedSettings::default()
    };
    Pipe::new(Emulated::new(device, &image(), settings))
}

fn connect(pipe: &Pipe) -> Result<Falcon<Chip<Pipe>>, FalconError> {
    let link = pipe.clone();
    let settings = Settings {
        firmware: firmware(),
        tries: Tries::default(),
        period: 1e-3,
    };
    Falcon::connect(move || Ok(Chip::new(link.clone())), pipe.clock(), settings)
}

fn z(z: f64) -> Vec3 {
    Vec3::new(0.0, 0.0, z)
}

/// A hand that waits for the boot, and homes the device: the references are 10 mm out of the middle.
fn homing(then: &[(f64, Vec3)]) -> Vec<(f64, Vec3)> {
    let mut path = vec![(3.0, z(0.0)), (3.5, z(0.025)), (4.0, z(0.0))];
    path.extend(then);
    path
}

fn force(x: f64, y: f64, z: f64) -> Wrench {
    Wrench {
        force: Vec3::new(x, y, z),
        moment: Vec3::zeros(),
    }
}

/// Exchanges until `seconds` of the world, one a millisecond at most, and gives each result to `check`.
fn run(
    falcon: &mut Falcon<Chip<Pipe>>,
    pipe: &Pipe,
    seconds: f64,
    wrench: &Wrench,
    mut check: impl FnMut(Result<DeviceState, DeviceError>, &Emulated),
) {
    loop {
        let before_ns = pipe.world().now_ns;
        if before_ns as f64 >= seconds * 1e9 {
            return;
        }
        let state = falcon.exchange(wrench);
        check(state, &pipe.world().emulated);
        let passed_ns = pipe.world().now_ns - before_ns;
        pipe.wait(1_000_000_u64.saturating_sub(passed_ns));
    }
}

/// The largest distance of two positions whose arms differ by one count: at each arm, half for the encoder's rounding
/// and half for the motion while the packet is on its way.
fn one_count(position: &Vec3) -> f64 {
    let place = CENTRE + position;
    let jacobian = Jacobian::at(&place, &inverse(&place).unwrap()).unwrap();
    let count = devices::falcon::geometry::angle_of(1) - devices::falcon::geometry::angle_of(0);
    // The largest over the signs of the three arms.
    [
        [1.0, 1.0, 1.0],
        [1.0, 1.0, -1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
    ]
    .map(|signs| {
        jacobian
            .velocity(&signs.map(|sign: f64| sign * count))
            .norm()
    })
    .into_iter()
    .fold(0.0, f64::max)
}

#[test]
fn boot_homing_positions_and_forces() {
    let aside = Vec3::new(0.02, -0.015, -0.01);
    let pipe = emulated(&homing(&[(4.5, z(0.0)), (5.0, aside)]), Faults::default());
    let mut falcon = connect(&pipe).unwrap();
    {
        let world = pipe.world();
        assert!(world.emulated.is_running() && world.emulated.uploads() == 1);
        assert!(world.now_ns < 2_900_000_000, "the hand waits for 3 s");
    }
    // No state and no torque before all axes are homed, whatever is commanded.
    let pull = force(1.0, -2.0, 1.5);
    run(&mut falcon, &pipe, 3.1, &pull, |state, emulated| {
        assert_eq!(state, Err(DeviceError::NoReport));
        assert_eq!(emulated.torques(), [0; 3]);
        assert!(emulated.lights().red && !emulated.lights().blue);
    });
    assert!(!falcon.is_homed());
    let mut states = 0;
    run(
        &mut falcon,
        &pipe,
        4.0,
        &Wrench::zero(),
        |state, emulated| {
            states += u32::from(state.is_ok());
            assert!(state.is_ok() || emulated.homed() != [true; 3] || states == 0);
        },
    );
    assert!(falcon.is_homed() && states > 500, "{states}");
    assert!(pipe.world().emulated.lights().green);

    // Positions while the hand moves by 27 mm in half a second, and at rest.
    let (mut fastest, mut last_ns) = (0.0_f64, 0);
    run(
        &mut falcon,
        &pipe,
        5.2,
        &Wrench::zero(),
        |state, emulated| {
            let state = state.expect("a state each time");
            let device = emulated.device();
            let truth = device.position();
            let speed = device.velocity().norm();
            fastest = fastest.max(speed);
            // Half a count, and the way since the packet reached the board: not a millisecond.
            let error = (state.pose.position - truth).norm();
            assert!(error <= 0.5 * one_count(&truth) + 1e-3 * speed, "{error}");
            // Least squares over five positions a millisecond apart sum errors of half a step by 0.6 at most. The
            // middle of the window is 2 ms old, the packet up to 1 ms, and the hand accelerates by 0.7 m/s^2 at most.
            let error = (state.twist.linear - device.velocity()).amax();
            assert!(error < 0.6 * 0.5 * STEP / 1e-3 + 3e-3 * 0.7, "{error}");
            assert!(state.device_time_ns > last_ns);
            last_ns = state.device_time_ns;
            assert_eq!(state.buttons, 0);
        },
    );
    assert!(fastest > 0.09, "{fastest}");

    // Forces that a Falcon can hold.
    pipe.world().emulated.press(0b1001);
    for command in [
        force(1.0, -2.0, 1.5),
        force(-3.0, 0.5, -2.0),
        force(0.0, 4.0, 4.0),
        force(0.0, 0.0, 0.0),
    ] {
        let until = pipe.world().now_ns as f64 * 1e-9 + 0.3;
        run(&mut falcon, &pipe, until, &command, |state, _| {
            assert_eq!(state.expect("a state").buttons, 0b1001);
        });
        let world = pipe.world();
        let (device, wanted) = (world.emulated.device(), command.force);
        let place = CENTRE + device.position();
        let jacobian = Jacobian::at(&place, &inverse(&place).unwrap()).unwrap();
        // Half a torque count at each arm.
        let half = [
            [0.5e-4; 3],
            [-0.5e-4, 0.5e-4, 0.5e-4],
            [0.5e-4, -0.5e-4, 0.5e-4],
            [0.5e-4, 0.5e-4, -0.5e-4],
        ]
        .map(|torques| jacobian.force(&torques).norm());
        let quantum = half.into_iter().fold(0.0, f64::max);
        // Half an encoder count, 0.03 mm, turns the shins by 0.03 / 100, and changes the levers by 0.03 / 30 at most.
        let error = (device.force() - wanted).norm();
        assert!(
            error <= quantum + 1e-3 * wanted.norm(),
            "{error} for {wanted}, {quantum}"
        );
        assert_eq!(world.emulated.lights().blue, wanted.norm() > 0.0);
    }

    // A force beyond the motors keeps its direction.
    let until = pipe.world().now_ns as f64 * 1e-9 + 0.3;
    run(
        &mut falcon,
        &pipe,
        until,
        &force(30.0, 30.0, -60.0),
        |_, _| {},
    );
    {
        let world = pipe.world();
        let most = world
            .emulated
            .torques()
            .map(i16::unsigned_abs)
            .into_iter()
            .max();
        assert_eq!(most, Some(4096));
        let direction = world.emulated.device().force().normalize();
        let wanted = Vec3::new(1.0, 1.0, -2.0).normalize();
        assert!((direction - wanted).norm() < 2e-3, "{direction}");
    }
    // A wrench that is no number is no torque.
    falcon.exchange(&force(f64::NAN, 1.0, 1.0)).unwrap();
    pipe.wait(1_000_000);
    assert_eq!(pipe.world().emulated.torques(), [0; 3]);

    // Let go: the torques end at once.
    falcon.exchange(&pull).unwrap();
    assert_ne!(pipe.world().emulated.torques(), [0; 3]);
    falcon.release();
    pipe.wait(1_000_000);
    assert_eq!(pipe.world().emulated.torques(), [0; 3]);
    assert_eq!(pipe.world().emulated.device().force(), Vec3::zeros());
}

#[test]
fn a_force_ends_some_time_after_the_last_packet() {
    let pipe = emulated(&homing(&[]), Faults::default());
    let mut falcon = connect(&pipe).unwrap();
    run(&mut falcon, &pipe, 4.2, &force(0.0, 0.0, 2.0), |_, _| {});
    let held = pipe.world().emulated.torques();
    assert_ne!(held, [0; 3]);
    // The default is 0.1 s, less what has passed since the last packet reached the board.
    pipe.wait(98_000_000);
    assert_eq!(pipe.world().emulated.torques(), held);
    pipe.wait(2_000_000);
    assert_eq!(pipe.world().emulated.torques(), [0; 3]);
    // The device still answers.
    assert!(falcon.exchange(&Wrench::zero()).is_ok());
}

#[test]
fn a_device_that_does_not_answer_gets_no_torque() {
    let pipe = emulated(&homing(&[]), Faults::default());
    let mut falcon = connect(&pipe).unwrap();
    let pull = force(0.0, 0.0, 2.0);
    run(&mut falcon, &pipe, 4.2, &pull, |_, _| {});
    pipe.world().emulated.fail(Faults {
        lost_every: 1,
        ..Faults::default()
    });
    // The board still takes packets. The position of the last answer serves for the first three.
    let torques: Vec<_> = (0..5)
        .map(|_| {
            assert_eq!(falcon.exchange(&pull), Err(DeviceError::NoReport));
            pipe.world().emulated.torques() != [0; 3]
        })
        .collect();
    assert_eq!(torques, [true, true, true, false, false]);
    // The torque acts again with the second answer. The first answer gives the position of the grip.
    pipe.world().emulated.fail(Faults::default());
    assert!(falcon.exchange(&pull).is_ok());
    assert_eq!(pipe.world().emulated.torques(), [0; 3]);
    assert!(falcon.exchange(&pull).is_ok());
    assert_ne!(pipe.world().emulated.torques(), [0; 3]);
}

#[test]
fn firmware_that_runs_already_is_kept() {
    let pipe = emulated(&homing(&[]), Faults::default());
    let mut falcon = connect(&pipe).unwrap();
    run(&mut falcon, &pipe, 4.2, &Wrench::zero(), |_, _| {});
    drop(falcon);
    let mut falcon = connect(&pipe).unwrap();
    assert_eq!(pipe.world().emulated.uploads(), 1);
    // It is still homed, so the first exchange has a state.
    assert!(falcon.exchange(&Wrench::zero()).is_ok());
}

#[test]
fn an_answer_to_an_earlier_host_is_not_taken_for_a_later_one() {
    let pipe = emulated(&homing(&[]), Faults::default());
    let mut falcon = connect(&pipe).unwrap();
    run(&mut falcon, &pipe, 4.2, &Wrench::zero(), |_, _| {});
    drop(falcon);
    let old = Report {
        encoders: [100; 3],
        buttons: 0b0101,
        homed: [true; 3],
    };
    pipe.world().stale = Some([&MODEM[..], &old.encode()].concat());
    let mut falcon = connect(&pipe).unwrap();
    for _ in 0..3 {
        let state = falcon.exchange(&Wrench::zero()).expect("it is homed");
        assert_eq!(state.buttons, 0);
        // Nothing is on its way after an exchange: each answer was that of its own packet.
        pipe.wait(2_000_000);
        let mut world = pipe.world();
        let now_ns = world.now_ns;
        assert_eq!(world.emulated.send(now_ns, &mut [0; PACKET]), Some(STATUS));
    }
}

/// The upload faults, with the step and the problem of the error if no upload succeeds.
fn upload_faults() -> Vec<(UploadFault, Step, Problem)> {
    let sent = |at: usize| image()[at];
    let mut faults = vec![
        (
            UploadFault::NoHandshake,
            Step::Handshake,
            Problem::Silent { tries: 100 },
        ),
        (
            UploadFault::NoStart,
            Step::Start,
            Problem::Silent { tries: 1 },
        ),
        (
            UploadFault::NoAnswer,
            Step::Answer,
            Problem::Silent { tries: 50 },
        ),
    ];
    // The first and the last byte, and the ends of a piece.
    for at in [0, 1, 61, 62, 63, 350, 699] {
        let (sent, found) = (sent(at), sent(at) ^ 0x10);
        faults.push((
            UploadFault::Changed { at },
            Step::Image,
            Problem::Changed { at, sent, found },
        ));
        faults.push((
            UploadFault::Missing { at },
            Step::Image,
            Problem::Missing { at },
        ));
    }
    faults
}

#[test]
fn uploads_that_fail_at_first_are_repeated_and_the_last_failure_is_named() {
    for (upload, step, problem) in upload_faults() {
        for failing_uploads in [1, 9] {
            let faults = Faults {
                failing_uploads,
                upload,
                ..Faults::default()
            };
            let pipe = emulated(&homing(&[]), faults);
            connect(&pipe).unwrap_or_else(|error| panic!("{upload:?}: {error}"));
            assert_eq!(pipe.world().emulated.uploads(), failing_uploads + 1);
        }
        let faults = Faults {
            failing_uploads: 10,
            upload,
            ..Faults::default()
        };
        let pipe = emulated(&homing(&[]), faults);
        let FalconError::Boot(error) = connect(&pipe).map(drop).unwrap_err() else {
            panic!("no error of the boot");
        };
        let BootError {
            uploads,
            step: found_step,
            problem: found,
            ..
        } = error.clone();
        assert_eq!((uploads, found_step, found), (10, step, problem));
        let text = error.to_string();
        assert!(
            text.contains("novint.bin") && text.contains(error.remedy()),
            "{text}"
        );
    }
    // A boot loader that is slow to answer needs one upload only.
    let faults = Faults {
        deaf_handshakes: 99,
        ..Faults::default()
    };
    let pipe = emulated(&homing(&[]), faults);
    assert!(connect(&pipe).is_ok());
    assert_eq!(pipe.world().emulated.uploads(), 1);
}

#[test]
fn an_error_of_the_system_in_any_transfer_is_repeated_or_named() {
    let tries = Tries::default();
    let start = |error: Option<(u64, i32)>| {
        let pipe = emulated(&homing(&[]), Faults::default());
        pipe.world().error = error;
        let mut link = Chip::new(pipe.clone());
        let result = boot(&mut link, &firmware(), &tries, &mut pipe.clock());
        let world = pipe.world();
        (result, world.transfers, world.emulated.is_running())
    };
    let (result, transfers, _) = start(None);
    assert_eq!(result, Ok(1));
    assert!(transfers > 60, "{transfers}");
    for at in 0..transfers {
        // A transfer that fails (EPROTO) costs one upload at most.
        let (result, _, running) = start(Some((at, 71)));
        assert!(matches!(result, Ok(1 | 2)) && running, "{at}: {result:?}");
        // A device that is gone (ENODEV) ends the boot at once.
        let (result, used, _) = start(Some((at, 19)));
        let error = result.unwrap_err();
        assert_eq!((error.number(), used), (Some(19), at + 1));
    }
}

#[test]
fn an_answer_too_many_makes_no_later_state_late() {
    let sway = [(4.5, z(0.0)), (5.0, Vec3::new(0.03, 0.0, 0.0))];
    let pipe = emulated(&homing(&sway), Faults::default());
    let mut falcon = connect(&pipe).unwrap();
    run(&mut falcon, &pipe, 4.7, &Wrench::zero(), |_, _| {});
    // A packet of another program is answered, too.
    let now_ns = pipe.world().now_ns;
    let packet = devices::falcon::packet::Command::default().encode();
    pipe.world().emulated.receive(&packet, now_ns);
    pipe.wait(2_000_000);
    let mut fastest = 0.0_f64;
    run(
        &mut falcon,
        &pipe,
        4.9,
        &Wrench::zero(),
        |state, emulated| {
            let state = state.expect("a state each time");
            let device = emulated.device();
            let (truth, speed) = (device.position(), device.velocity().norm());
            fastest = fastest.max(speed);
            // Half a count, and the way since the packet reached the board: not a millisecond. A late answer is 1 ms older.
            let error = (state.pose.position - truth).norm();
            assert!(error <= 0.5 * one_count(&truth) + 0.5e-3 * speed, "{error}");
        },
    );
    assert!(fastest > 0.09, "{fastest}");
    assert_eq!(falcon.counts().early, 1);
}

#[test]
fn faults_of_the_packets_cost_states_and_never_give_wrong_ones() {
    let every = Faults {
        short_every: 7,
        split_every: 5,
        bare_every: 3,
        lost_every: 31,
        late_every: 43,
        late_ns: 8_000_000,
        ..Faults::default()
    };
    let one = Faults::default;
    for (faults, least) in [
        // One of seven answers is refused.
        (
            Faults {
                short_every: 7,
                ..one()
            },
            0.85,
        ),
        // Parts and bare status bytes cost time, but no state.
        (
            Faults {
                split_every: 1,
                ..one()
            },
            1.0,
        ),
        (
            Faults {
                bare_every: 1,
                ..one()
            },
            1.0,
        ),
        (
            Faults {
                split_every: 2,
                bare_every: 3,
                ..one()
            },
            1.0,
        ),
        (
            Faults {
                lost_every: 10,
                ..one()
            },
            0.85,
        ),
        // The late answer must not be taken for the next one.
        (
            Faults {
                late_every: 10,
                late_ns: 8_000_000,
                ..one()
            },
            0.85,
        ),
        (every, 0.7),
    ] {
        let sway = [
            (4.5, z(0.0)),
            (5.0, Vec3::new(0.03, 0.0, 0.0)),
            (5.5, z(0.0)),
        ];
        let pipe = emulated(&homing(&sway), Faults::default());
        let mut falcon = connect(&pipe).unwrap();
        run(&mut falcon, &pipe, 4.3, &Wrench::zero(), |_, _| {});
        assert!(falcon.is_homed());
        pipe.world().emulated.press(0b0010);
        pipe.world().emulated.fail(faults);
        // Answers to packets before the fault, and before the press.
        run(&mut falcon, &pipe, 4.35, &Wrench::zero(), |_, _| {});
        let (mut good, mut all) = (0, 0);
        run(
            &mut falcon,
            &pipe,
            5.5,
            &Wrench::zero(),
            |state, emulated| {
                all += 1;
                match state {
                    Ok(state) => {
                        good += 1;
                        let device = emulated.device();
                        let error = (state.pose.position - device.position()).norm();
                        // An answer in parts takes two or three latency timers.
                        let most =
                            0.5 * one_count(&device.position()) + 4e-3 * device.velocity().norm();
                        assert!(error <= most + 1e-5, "{error} of {most} with {faults:?}");
                        assert_eq!(state.buttons, 0b0010, "{faults:?}");
                    }
                    Err(DeviceError::NoReport | DeviceError::Corrupt(Corruption::Length)) => {}
                    Err(other) => panic!("{other} with {faults:?}"),
                }
            },
        );
        let rate = f64::from(good) / f64::from(all);
        assert!(
            all > 200 && rate >= least,
            "{good} of {all} with {faults:?}"
        );
        assert!(falcon.is_homed());
    }
}

#[test]
fn a_device_without_power_is_disconnected_and_comes_back_unhomed() {
    let pipe = emulated(
        &homing(&[(8.0, z(0.0)), (8.5, z(0.025)), (9.0, z(0.0))]),
        Faults::default(),
    );
    let mut falcon = connect(&pipe).unwrap();
    run(&mut falcon, &pipe, 4.2, &Wrench::zero(), |_, _| {});
    let off_ns = pipe.world().now_ns;
    pipe.world().emulated.power(false, off_ns);
    // The chip has its power from USB: it answers, and the board does not.
    let missing = (0..200)
        .take_while(|_| falcon.exchange(&force(0.0, 0.0, 1.0)) == Err(DeviceError::NoReport))
        .count();
    assert_eq!(missing, 49);
    assert_eq!(
        falcon.exchange(&Wrench::zero()),
        Err(DeviceError::Disconnected(19))
    );
    let on_ns = pipe.world().now_ns;
    pipe.world().emulated.power(true, on_ns);
    assert_eq!(falcon.reopen(), Ok(()));
    assert!(falcon.trouble().is_none() && !falcon.is_homed());
    assert_eq!(pipe.world().emulated.uploads(), 2);
    run(
        &mut falcon,
        &pipe,
        8.0,
        &force(0.0, 0.0, 1.0),
        |state, emulated| {
            assert_eq!(state, Err(DeviceError::NoReport));
            assert_eq!(emulated.torques(), [0; 3]);
        },
    );
    run(&mut falcon, &pipe, 9.0, &Wrench::zero(), |_, _| {});
    assert!(falcon.exchange(&Wrench::zero()).is_ok());

    // Unplugged: the error is the system's, and reopening fails with it until the device is back.
    pipe.world().gone = Some(19);
    assert_eq!(
        falcon.exchange(&Wrench::zero()),
        Err(DeviceError::Disconnected(19))
    );
    assert_eq!(falcon.reopen(), Err(DeviceError::Disconnected(19)));
    let text = falcon
        .trouble()
        .map(ToString::to_string)
        .unwrap_or_default();
    assert!(text.contains("USB cable"), "{text}");
    falcon.release();
    pipe.world().gone = None;
    assert_eq!(falcon.reopen(), Ok(()));
    assert!(falcon.exchange(&Wrench::zero()).is_ok());
}

#[test]
fn the_event_character_saves_the_latency_timer() {
    let pipe = emulated(&homing(&[]), Faults::default());
    drop(connect(&pipe).unwrap());
    let mut link = Chip::new(pipe.clone());
    packet_mode(&mut link).unwrap();
    let command = devices::falcon::packet::Command::default().encode();
    let answer_ns = |link: &mut Chip<Pipe>| {
        let mut total = 0;
        for k in 0..100 {
            let start_ns = pipe.world().now_ns;
            link.write(&command).unwrap();
            let mut buffer = [0; PACKET];
            let mut count = 0;
            while count < command.len() {
                count += link.read(&mut buffer, Duration::from_millis(5)).unwrap();
            }
            total += pipe.world().now_ns - start_ns;
            // Not in step with the timer.
            pipe.wait(k * 370_000 % 1_000_000);
        }
        total / 100
    };
    let with = answer_ns(&mut link);
    link.control(Control::EventCharacter(None)).unwrap();
    let without = answer_ns(&mut link);
    // 125 us out, two packets of 107 us, the answer after 100 us, and a look of the host.
    assert!((439_000..=500_000).contains(&with), "{with} ns");
    // The timer ends after half a millisecond in the mean.
    assert!(without > with + 200_000, "{without} ns, {with} ns");
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        cases: 32,
        ..ProptestConfig::default()
    })]

    /// The emulator takes any bytes and any requests, and its packets are never longer than a USB packet.
    #[test]
    fn any_bytes_and_requests_are_taken(
        calls in proptest::collection::vec(
            (0..3_u8, 0..11_u8, any::<u16>(), proptest::collection::vec(any::<u8>(), 0..80)), 0..60),
    ) {
        let pipe = emulated(&homing(&[]), Faults::default());
        let mut now_ns = 0;
        for (kind, request, value, bytes) in calls {
            now_ns += u64::from(value) * 1000;
            let mut world = pipe.world();
            let emulated = &mut world.emulated;
            match kind {
                0 => {
                    let setup = SetupPacket { kind: 0x40, request, value: value & 0x3ff, index: 0 };
                    let _ = emulated.control(setup, now_ns);
                }
                1 => emulated.receive(&bytes, now_ns),
                _ => {
                    let count = emulated.send(now_ns, &mut [0; PACKET]);
                    prop_assert!(count.is_none_or(|count| (2..=PACKET).contains(&count)));
                }
            }
        }
        prop_assert!(!pipe.world().emulated.is_running());
    }
}
