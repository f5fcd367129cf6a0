//! The states of the driver: the velocity at any times of the packets, and the report on the torques. `sim/tests` runs
//! the driver against an emulated Falcon.

use super::super::geometry::{count_of, inverse};
use super::*;
use crate::Transport;
use proptest::prelude::*;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

const PERIOD: f64 = 1e-3;
const PERIOD_NS: u64 = 1_000_000;

/// No chip.
struct Nothing;

impl Transport for Nothing {
    fn read(&mut self, _: &mut [u8], _: Duration) -> Result<usize, i32> {
        Err(NO_DEVICE)
    }
    fn write(&mut self, _: &[u8]) -> Result<(), i32> {
        Err(NO_DEVICE)
    }
}

impl Ftdi for Nothing {
    fn control(&mut self, _: Control) -> Result<(), i32> {
        Err(NO_DEVICE)
    }
}

fn falcon() -> Falcon<Nothing> {
    let firmware = Firmware::new(std::path::Path::new("none"), vec![0]).expect("an image");
    let settings = Settings {
        firmware,
        tries: Tries::default(),
        period: PERIOD,
    };
    Falcon::unopened(|| Err(NO_DEVICE), || 0, settings)
}

/// The report of a homed Falcon with the grip at `x` to the right of the centre (m), and its position in counts.
fn report(x: f64) -> Report {
    let angles = inverse(&(CENTRE + Vec3::new(x, 0.0, 0.0))).expect("in reach");
    Report {
        encoders: angles.map(|angle| count_of(angle).round() as i16),
        homed: [true; 3],
        ..Report::default()
    }
}

/// The state of the grip at `x` (m), asked for at `at_ns`.
fn state(falcon: &mut Falcon<Nothing>, at_ns: u64, x: f64) -> DeviceState {
    falcon.written_ns = at_ns;
    falcon.state(&report(x)).expect("a state")
}

/// A grip that moves steadily keeps its velocity across any number of missing states: the interpolated positions reach
/// the new one.
#[test]
fn a_steady_motion_keeps_its_velocity_across_missing_states() {
    // 0.05 m/s for the longest time of a gap.
    for missing in [0, 1, 2, 3, 7, 20, 99] {
        let mut falcon = falcon();
        let mut at_ns = 0;
        let mut x = -0.02;
        let mut move_on = |periods: u64| {
            at_ns += periods * PERIOD_NS;
            x += 0.2 * PERIOD * periods as f64;
            state(&mut falcon, at_ns, x).twist.linear.x
        };
        for _ in 0..20 {
            move_on(1);
        }
        let steady = move_on(1);
        let after = move_on(missing + 1);
        let next = move_on(1);
        // A count over the window of four periods, at each of its ends.
        let most = 2.0 * STEP / (4.0 * PERIOD);
        for found in [steady, after, next] {
            assert!(
                (found - 0.2).abs() <= most,
                "{missing}: {steady}, {after}, {next}"
            );
        }
    }
}

/// The velocity includes the newest position: a grip that rests and then moves has a velocity in the first state of the
/// motion, and none as soon as the window contains no motion.
#[test]
fn a_motion_shows_in_the_state_that_has_it() {
    for missing in [0, 1, 4] {
        let mut falcon = falcon();
        for k in 0..20 {
            state(&mut falcon, k * PERIOD_NS, 0.0);
        }
        let moved_ns = (20 + missing) * PERIOD_NS;
        let way = PERIOD * (missing + 1) as f64;
        let moves = state(&mut falcon, moved_ns, way).twist.linear.x;
        // A count at each end of the motion.
        let most = 2.0 * STEP / way;
        assert!((moves - 1.0).abs() <= most, "{missing}: {moves}");
        let mut rests = moves;
        for k in 1..=5 {
            rests = state(&mut falcon, moved_ns + k * PERIOD_NS, way)
                .twist
                .linear
                .x;
        }
        assert_eq!(rests, 0.0, "{missing}");
    }
}

/// After a longer silence the velocity begins anew.
#[test]
fn a_long_silence_makes_no_velocity() {
    let mut falcon = falcon();
    for k in 0..20 {
        state(&mut falcon, k * PERIOD_NS, 0.0);
    }
    let back = state(&mut falcon, 3000 * PERIOD_NS, 0.02);
    assert_eq!(back.twist.linear, Vec3::zeros());
}

/// A wrench without torques is reported once.
#[test]
fn a_wrench_without_torques_is_a_device_that_let_go() {
    let push = Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    };
    let mut falcon = falcon();
    let mut rendering = |wrench: &Wrench, stateless: u32, at: u64| {
        falcon.stateless = stateless;
        let acts = falcon.command(wrench).torques != [0; 3];
        let state = state(&mut falcon, at * PERIOD_NS, 0.0);
        falcon.stateless = 0;
        (acts, state.rendering)
    };
    // The first state comes for no force.
    assert_eq!(
        rendering(&Wrench::zero(), 0, 0),
        (false, Rendering::Commanded)
    );
    assert_eq!(rendering(&push, 0, 1), (true, Rendering::Commanded));
    // The answers stay away for so long that no torque is sent.
    assert_eq!(rendering(&push, STALE - 1, 2), (true, Rendering::Commanded));
    assert_eq!(rendering(&push, STALE, 3), (false, Rendering::LetGo));
    assert_eq!(rendering(&push, 0, 4), (true, Rendering::Commanded));
    // No force was asked for, so none was let go.
    assert_eq!(
        rendering(&Wrench::zero(), STALE, 5),
        (false, Rendering::Commanded)
    );
}

/// The far end of a chip, under virtual time.
#[derive(Default)]
struct End {
    now_ns: u64,
    sent: Vec<Command>,
    /// The answers to the next packets: each has its bytes, with the time that they take (ns).
    answers: VecDeque<Vec<(u64, Vec<u8>)>>,
    /// Bytes on their way, with the time of their arrival (ns).
    coming: VecDeque<(u64, Vec<u8>)>,
    purged: u32,
    fails: Option<i32>,
}

#[derive(Clone, Default)]
struct Chip(Arc<Mutex<End>>);

impl Chip {
    fn end<R>(&self, f: impl FnOnce(&mut End) -> R) -> R {
        f(&mut self.0.lock().expect("one thread"))
    }

    /// Answers the next packet with `bytes`, which come half a millisecond later.
    fn answer(&self, bytes: &[u8]) {
        self.end(|end| end.answers.push_back(vec![(500_000, bytes.to_vec())]));
    }

    fn last(&self) -> Command {
        self.end(|end| *end.sent.last().expect("a packet"))
    }
}

impl Transport for Chip {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        self.end(|end| {
            let until_ns = end.now_ns + wait.as_nanos() as u64;
            match end.coming.pop_front() {
                Some((at_ns, bytes)) if at_ns <= until_ns => {
                    end.now_ns = end.now_ns.max(at_ns);
                    buffer[..bytes.len()].copy_from_slice(&bytes);
                    Ok(bytes.len())
                }
                later => {
                    end.now_ns = until_ns;
                    if let Some(bytes) = later {
                        end.coming.push_front(bytes);
                    }
                    end.fails.map_or(Ok(0), Err)
                }
            }
        })
    }
    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.end(|end| {
            if let Some(number) = end.fails {
                return Err(number);
            }
            // The bytes that boot the device are no packet.
            if let Ok(bytes) = bytes.try_into() {
                end.sent.extend(Command::decode(bytes));
            }
            for (late_ns, bytes) in end.answers.pop_front().unwrap_or_default() {
                end.coming.push_back((end.now_ns + late_ns, bytes));
            }
            Ok(())
        })
    }
}

impl Ftdi for Chip {
    fn control(&mut self, control: Control) -> Result<(), i32> {
        self.end(|end| {
            if let Control::Purge(_) = control {
                end.purged += 1;
                end.coming.clear();
            }
        });
        Ok(())
    }
}

/// A device that runs its firmware.
fn running() -> (Falcon<Chip>, Chip) {
    let chip = Chip::default();
    let (clock, again) = (chip.clone(), chip.clone());
    let settings = falcon().settings;
    let open = move || again.end(|end| end.fails).map_or(Ok(again.clone()), Err);
    let mut falcon = Falcon::unopened(open, move || clock.end(|end| end.now_ns), settings);
    falcon.link = Some(chip.clone());
    (falcon, chip)
}

fn push() -> Wrench {
    Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    }
}

/// Two Falcons: one is homed and gets torques, the other is not.
#[test]
fn a_force_and_its_lights_come_after_homing_alone() {
    let lights = |red, green, blue| Lights { red, green, blue };
    let ((mut homed, chip), (mut lost, other)) = (running(), running());
    for _ in 0..3 {
        chip.answer(&report(0.0).encode());
        other.answer(
            &Report {
                homed: [true, false, true],
                ..report(0.0)
            }
            .encode(),
        );
    }
    assert!(homed.exchange(&push()).is_ok());
    assert_eq!((chip.last().torques, chip.last().homing), ([0; 3], true));
    assert_eq!(chip.last().lights, lights(true, false, false));
    assert!(homed.exchange(&push()).is_ok());
    assert!(chip.last().torques != [0; 3] && !chip.last().homing);
    assert_eq!(chip.last().lights, lights(false, false, true));
    assert!(homed.exchange(&Wrench::zero()).is_ok());
    assert_eq!(chip.last().torques, [0; 3]);
    assert_eq!(chip.last().lights, lights(false, true, false));
    for _ in 0..3 {
        assert_eq!(lost.exchange(&push()), Err(DeviceError::NoReport));
        assert_eq!((other.last().torques, other.last().homing), ([0; 3], true));
        assert_eq!(other.last().lights, lights(true, false, false));
    }
    assert!(homed.is_homed() && !lost.is_homed());
    for falcon in [homed.counts(), lost.counts()] {
        let good = Counts {
            good: 3,
            ..Counts::default()
        };
        assert_eq!(falcon, good);
    }
    // A device that is opened again must be homed again.
    homed.forget();
    assert!(!homed.is_homed() && homed.counts() == Counts::default());
    assert_eq!(homed.command(&push()).torques, [0; 3]);
}

/// An answer that comes before the device can have received the packet answers the packet before it.
#[test]
fn an_answer_that_comes_too_early_is_discarded() {
    for (early_ns, early) in [(0, 1), (SOONEST_NS - 1, 1), (SOONEST_NS, 0)] {
        let (mut falcon, chip) = running();
        let answers = [(early_ns, 0.01), (SOONEST_NS + 1, 0.02)];
        let answers = answers.map(|(late_ns, x)| (late_ns, report(x).encode().to_vec()));
        chip.end(|end| end.answers.push_back(answers.to_vec()));
        let x = falcon.exchange(&push()).expect("a state").pose.position.x;
        let wanted = if early == 0 { 0.01 } else { 0.02 };
        assert!((x - wanted).abs() < 1e-3, "{early_ns}: {x}");
        assert_eq!(falcon.counts().early, early, "{early_ns}");
        assert_eq!(falcon.counts().good, 1);
    }
}

/// An answer that is late is not taken for the answer to the next packet.
#[test]
fn a_late_answer_is_waited_for_and_discarded() {
    let (mut falcon, chip) = running();
    chip.answer(&report(0.0).encode());
    assert!(falcon.exchange(&push()).is_ok());
    let start_ns = chip.end(|end| {
        end.answers
            .push_back(vec![(7_000_000, report(0.01).encode().to_vec())]);
        end.now_ns
    });
    assert_eq!(falcon.exchange(&push()), Err(DeviceError::NoReport));
    let waited = chip.end(|end| end.now_ns) - start_ns;
    assert_eq!(
        (waited, chip.end(|end| end.purged)),
        (WAIT.as_nanos() as u64, 0)
    );
    chip.answer(&report(0.02).encode());
    let x = falcon.exchange(&push()).expect("a state").pose.position.x;
    assert!((x - 0.02).abs() < 1e-3, "{x}");
    assert_eq!(chip.end(|end| end.purged), 2);
    assert_eq!((falcon.counts().silent, falcon.counts().good), (1, 2));
    // The next exchange owes nothing.
    chip.answer(&report(0.02).encode());
    assert!(falcon.exchange(&push()).is_ok());
    assert_eq!(chip.end(|end| end.purged), 2);
}

#[test]
fn an_answer_that_is_cut_or_has_wrong_letters_is_corrupt() {
    let (mut falcon, chip) = running();
    let good = report(0.0).encode();
    let mut cut = good.to_vec();
    cut.remove(5);
    let mut wrong = good;
    wrong[5] = b'~';
    for (answer, corruption) in [
        (cut, Corruption::Length),
        (wrong.to_vec(), Corruption::Range),
    ] {
        chip.answer(&answer);
        let corrupt = Err(DeviceError::Corrupt(corruption));
        assert_eq!(falcon.exchange(&push()), corrupt);
        // Bytes that are no packet do not spoil the packet behind them.
        chip.answer(&good);
        assert!(falcon.exchange(&push()).is_ok());
    }
    assert_eq!((falcon.counts().corrupt, falcon.counts().good), (2, 2));
}

/// The torques end before the device counts as lost.
#[test]
fn a_device_that_stays_silent_gets_no_torque_and_is_lost_after_a_time() {
    let (mut falcon, chip) = running();
    chip.answer(&report(0.0).encode());
    assert!(falcon.exchange(&push()).is_ok());
    for silent in 1..LOST {
        assert_eq!(falcon.exchange(&push()), Err(DeviceError::NoReport));
        assert_eq!(chip.last().torques != [0; 3], silent <= STALE, "{silent}");
    }
    let lost = |number| Err(DeviceError::Disconnected(number));
    assert_eq!(falcon.exchange(&push()), lost(SILENT));
    assert_eq!(falcon.exchange(&push()), lost(NO_DEVICE));
    chip.end(|end| end.fails = Some(7));
    assert_eq!(falcon.reopen(), lost(7).map(drop));
    assert_eq!(falcon.trouble(), Some(&FalconError::Open(7)));
    // A device that is silent while it boots has no error of the system.
    chip.end(|end| end.fails = None);
    assert_eq!(falcon.reopen(), lost(SILENT).map(drop));
    // The thread of the device tries again, so one upload is enough.
    assert!(
        matches!(falcon.trouble(), Some(FalconError::Boot(error)) if error.uploads == 1),
        "{:?}",
        falcon.trouble()
    );
    assert_eq!(falcon.exchange(&push()), lost(NO_DEVICE));
}

/// The end of a connection is a loss at once, and another error of the system is one missing state.
#[test]
fn a_device_that_is_unplugged_is_lost_and_one_that_stumbles_is_not() {
    for (number, result) in [
        (NO_DEVICE, DeviceError::Disconnected(NO_DEVICE)),
        (11, DeviceError::NoReport),
    ] {
        let (mut falcon, chip) = running();
        chip.answer(&report(0.0).encode());
        assert!(falcon.exchange(&push()).is_ok());
        chip.end(|end| end.fails = Some(number));
        assert_eq!(falcon.exchange(&push()), Err(result));
        assert_eq!(falcon.link.is_some(), result == DeviceError::NoReport);
    }
    let refused = Falcon::<Chip>::connect(|| Err(13), || 0, falcon().settings);
    assert_eq!(refused.err(), Some(FalconError::Open(13)));
}

#[test]
fn the_end_sends_no_torque() {
    let (mut falcon, chip) = running();
    for _ in 0..2 {
        chip.answer(&report(0.0).encode());
        assert!(falcon.exchange(&push()).is_ok());
    }
    assert_ne!(chip.last().torques, [0; 3]);
    falcon.release();
    assert_eq!(chip.last(), Command::default());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// At any times of the packets (early, late, lost), the estimate for a hand with a bounded speed is at most one and
    /// a half times this speed, plus two counts in a period. A gap of up to one and a half periods counts as one
    /// period.
    #[test]
    fn no_time_of_a_packet_makes_a_fast_hand(
        fastest in 0.0..1.0_f64,
        steps in prop::collection::vec((200_000..6_000_000_u64, -1.0..1.0_f64, 0..6_u8, 0..400_u64), 1..200),
    ) {
        let mut falcon = falcon();
        let (mut at_ns, mut x) = (0, 0.0_f64);
        let most = 1.5 * fastest + 2.0 * STEP / PERIOD;
        for (late_ns, speed, kind, silent) in steps {
            let gap_ns = match kind {
                0 => late_ns,
                1 => silent * PERIOD_NS,
                _ => PERIOD_NS,
            };
            // The hand turns back at the end of the workspace.
            let way = fastest * speed * gap_ns as f64 * 1e-9;
            x = if (x + way).abs() < 0.03 { x + way } else { x };
            at_ns += gap_ns;
            let found = state(&mut falcon, at_ns, x).twist.linear;
            prop_assert!(found.norm() <= most, "{} m/s of {}", found, fastest);
        }
    }
}

/// Somebody may move the grip while its connection is lost.
#[test]
fn a_grip_that_is_elsewhere_after_a_loss_has_no_velocity() {
    let mut falcon = falcon();
    for k in 0..20 {
        state(&mut falcon, k * PERIOD_NS, 0.0);
    }
    falcon.forget();
    assert!(!falcon.homed);
    let back = state(&mut falcon, 21 * PERIOD_NS, 0.02);
    assert_eq!(back.twist.linear, Vec3::zeros());
}

/// The last command of a run is worth a second try.
#[test]
fn the_end_tries_twice_to_send_no_torque() {
    /// A chip whose first write fails.
    #[derive(Clone, Default)]
    struct Stumbles(Arc<Mutex<Vec<Vec<u8>>>>);

    impl Transport for Stumbles {
        fn read(&mut self, _: &mut [u8], _: Duration) -> Result<usize, i32> {
            Ok(0)
        }
        fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
            let mut writes = self.0.lock().expect("ours");
            writes.push(bytes.to_vec());
            if writes.len() == 1 { Err(71) } else { Ok(()) }
        }
    }

    impl Ftdi for Stumbles {
        fn control(&mut self, _: Control) -> Result<(), i32> {
            Ok(())
        }
    }

    let chip = Stumbles::default();
    let mut falcon = Falcon::unopened(|| Err(NO_DEVICE), || 0, falcon().settings);
    falcon.link = Some(chip.clone());
    falcon.release();
    let zero = Command::default().encode().to_vec();
    assert_eq!(*chip.0.lock().expect("ours"), [zero.clone(), zero]);
}

/// The rest of a packet whose beginning was lost comes before the answer.
#[test]
fn the_end_of_a_packet_is_no_answer() {
    let (mut falcon, chip) = running();
    let whole = report(0.0).encode().to_vec();
    let rest = whole[10..].to_vec();
    chip.end(|end| {
        let coming = vec![(500_000, rest), (600_000, whole)];
        end.answers.push_back(coming);
    });
    assert!(falcon.exchange(&push()).is_ok());
}
