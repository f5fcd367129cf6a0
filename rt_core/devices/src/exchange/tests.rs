//! The state machines of both ends in virtual time, and the thread that drives them.

use super::*;
use crate::scripted::small;
use poller::BEGUN;
use proptest::prelude::*;
use rt_core::{Freedom, Reading, Rendering, Vec3};
use runner::schedule::DEVICE_PRIORITY;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

const MS: u64 = 1_000_000;
const GONE: DeviceError = DeviceError::Disconnected(19);

/// Both ends of a device, in virtual time.
struct Ends {
    now_ns: u64,
    poller: Poller,
    tick: TickEnd,
    /// The wrench that waits for the poller.
    handed: Option<Handed>,
    refused: Option<u64>,
}

impl Ends {
    /// The ends of a device of a loop at 1 kHz. The clock begins at any time.
    fn new() -> Self {
        let now_ns = 7 * MS;
        Self {
            now_ns,
            poller: Poller::new(now_ns, let_go_after(1e-3)),
            tick: TickEnd::default(),
            handed: None,
            refused: None,
        }
    }

    /// The tick hands `force` over.
    fn hand(&mut self, force: f64) {
        self.handed = Some(self.tick.hand(&push(force)).expect("it is there"));
    }

    fn next(&mut self) -> Step {
        self.poller.next(self.now_ns, self.handed.take())
    }

    /// An exchange, in which the device is commanded `force`, and takes `took_ns` for its `answer`.
    #[track_caller]
    fn exchange(&mut self, force: f64, took_ns: u64, answer: Reading) -> Reply {
        assert_eq!(self.next(), Step::Exchange(push(force)));
        self.now_ns += took_ns;
        let motion = MotionSource::Thread;
        self.poller
            .answered(self.now_ns, answer, motion, self.refused)
    }

    /// The tick hands `force` over, the device is commanded it, and the tick reads the state.
    #[track_caller]
    fn turn(&mut self, force: f64, answer: Reading) -> Reading {
        self.hand(force);
        let reply = self.exchange(force, MS / 2, answer);
        self.now_ns += MS / 2;
        self.tick.read(Some(reply))
    }

    /// The poller waits until this time, and that time comes.
    #[track_caller]
    fn wait(&mut self, until_ns: u64) {
        assert_eq!(self.next(), Step::Wait(until_ns));
        self.now_ns = until_ns;
    }
}

fn push(force: f64) -> Wrench {
    Wrench {
        force: Vec3::new(force, 0.0, 0.0),
        moment: Vec3::zeros(),
    }
}

fn at(device_time_ns: u64) -> DeviceState {
    DeviceState {
        device_time_ns,
        ..DeviceState::resting()
    }
}

fn let_go(device_time_ns: u64) -> DeviceState {
    DeviceState {
        rendering: Rendering::LetGo,
        ..at(device_time_ns)
    }
}

#[test]
fn a_wrench_is_exchanged_for_a_state() {
    let mut ends = Ends::new();
    assert_eq!(ends.tick.read(None), Err(DeviceError::NoReport));
    ends.wait(17 * MS);
    assert_eq!(ends.turn(1.5, Ok(at(7))), Ok(at(7)));
    let silent = Err(DeviceError::NoReport);
    assert_eq!(ends.turn(1.5, silent), silent);
    // A device that does not report its refusals has none.
    assert_eq!(ends.tick.refused_wrenches(), None);
}

#[test]
fn a_tick_that_stops_lets_the_device_go_and_is_told() {
    let mut ends = Ends::new();
    assert_eq!(ends.turn(1.0, Ok(at(1))), Ok(at(1)));
    // The time counts from the answer.
    ends.wait(ends.now_ns - MS / 2 + 10 * MS);
    // The tick hands over a wrench that it computed before it read the let-go.
    let reply = ends.exchange(0.0, MS, Ok(at(2)));
    ends.hand(2.0);
    ends.exchange(0.0, MS, Ok(at(3)));
    // The force returns with a wrench of a tick that has read the let-go.
    assert_eq!(ends.tick.read(Some(reply)), Ok(let_go(2)));
    assert_eq!(ends.turn(3.0, Ok(at(4))), Ok(at(4)));
}

#[test]
fn a_device_that_let_go_gets_no_wrench_from_before() {
    let mut ends = Ends::new();
    ends.hand(1.0);
    let reply = ends.exchange(1.0, MS, Ok(let_go(1)));
    ends.hand(2.0);
    assert_eq!(ends.tick.read(Some(reply)), Ok(let_go(1)));
    // The device renders again, but nothing is commanded in this exchange.
    let reply = ends.exchange(0.0, MS, Ok(at(2)));
    assert_eq!(ends.tick.read(Some(reply)), Ok(let_go(2)));
    assert_eq!(ends.turn(3.0, Ok(at(3))), Ok(at(3)));
}

/// A wrench that waited while the process was stopped is not commanded. A wake-up that is late by less than the time of a
/// let-go is no stop.
#[test]
fn a_wrench_may_wait_for_two_let_goes() {
    for (away_ns, is_commanded) in [(20 * MS, true), (20 * MS + 1, false)] {
        let mut ends = Ends::new();
        assert_eq!(ends.turn(1.0, Ok(at(1))), Ok(at(1)));
        ends.now_ns -= MS;
        ends.hand(2.0);
        ends.now_ns += away_ns;
        ends.exchange(if is_commanded { 2.0 } else { 0.0 }, 0, Ok(at(2)));
    }
}

#[test]
fn a_slow_loop_has_more_time_between_two_wrenches() {
    let periods = [1e-3, 1.0 / 150.0, 1.0 / 100.0, 1.0 / 50.0, 1.0];
    for (period, ms) in periods.into_iter().zip([10, 26, 40, 80, 100]) {
        let let_go = let_go_after(period);
        assert_eq!(let_go.as_millis(), ms);
        let step = Poller::new(5, let_go).next(5, None);
        assert_eq!(step, Step::Wait(5 + let_go.as_nanos() as u64));
    }
}

#[test]
fn a_lost_device_comes_back_and_its_clock_goes_on() {
    let mut ends = Ends::new();
    assert_eq!(ends.turn(1.0, Ok(at(50))), Ok(at(50)));
    assert_eq!(ends.turn(2.0, Err(GONE)), Err(GONE));
    let lost_ns = ends.now_ns - MS / 2;
    // The error stays until the device is back, and the tick hands nothing over.
    assert_eq!(ends.tick.read(None), Err(GONE));
    assert_eq!(ends.tick.hand(&push(3.0)).err(), Some(GONE));
    // The first attempt fails after a while, the second succeeds.
    ends.wait(lost_ns + RETRY_NS);
    assert_eq!(ends.next(), Step::Reopen);
    ends.now_ns += MS;
    ends.poller.reopened(ends.now_ns, Err(GONE));
    ends.wait(ends.now_ns + RETRY_NS);
    assert_eq!(ends.next(), Step::Reopen);
    ends.poller.reopened(ends.now_ns, Ok(()));
    // The device that is back gets zero first, and no wrench from before its loss.
    ends.handed = Some(Handed {
        wrench: push(3.0),
        ..Handed::default()
    });
    // Its clock starts at 3 ns, and continues from 50 ns. The force before the loss was let go.
    let reply = ends.exchange(0.0, MS, Ok(at(3)));
    assert_eq!(ends.tick.read(Some(reply)), Ok(let_go(50)));
    // The thread has not looked for long: the first wrench may be old.
    ends.hand(4.0);
    ends.wait(ends.now_ns + 10 * MS);
    assert_eq!(ends.turn(5.0, Ok(at(10))), Ok(at(57)));
}

/// A wrench answers the state of one of the last exchanges. The time of an older exchange is no longer known, and the time
/// of another exchange is never taken for it.
#[test]
fn motion_to_force_is_the_time_between_the_requests_for_the_state_and_for_its_force() {
    let mut ends = Ends::new();
    let mut begun_ns = vec![0];
    for number in 1..=200 {
        let behind = 1 + number % 12;
        let answers = u64::saturating_sub(number, behind);
        ends.handed = Some(Handed {
            answers,
            ..Handed::default()
        });
        ends.now_ns += number * 1000;
        begun_ns.push(ends.now_ns);
        let reply = ends.exchange(0.0, 10 * number, Ok(at(number)));
        assert_eq!(reply.number, number);
        let asked_ns = begun_ns[answers as usize];
        let is_known = answers > 0 && behind < BEGUN as u64;
        let exact_ns = is_known.then(|| begun_ns[number as usize] - asked_ns);
        assert_eq!(reply.motion_to_force_ns, exact_ns, "{number}");
    }
    // The tick reports the time of the reply that it has just read.
    let mut ends = Ends::new();
    assert!(ends.turn(1.0, Ok(at(1))).is_ok());
    assert_eq!(ends.tick.motion_to_force_ns(), None);
    assert!(ends.turn(2.0, Ok(at(2))).is_ok());
    assert_eq!(ends.tick.motion_to_force_ns(), Some(MS));
    // A wrench without a new state answers no state.
    assert!(ends.tick.read(None).is_err());
    assert_eq!(ends.tick.motion_to_force_ns(), None);
    assert!(ends.turn(3.0, Ok(at(3))).is_ok());
    assert_eq!(ends.tick.motion_to_force_ns(), None);
}

#[test]
fn a_device_that_states_its_motion_to_force_is_believed() {
    let mut ends = Ends::new();
    for stated in [None, Some(7)] {
        ends.hand(1.0);
        assert_eq!(ends.next(), Step::Exchange(push(1.0)));
        let motion = MotionSource::Device(stated);
        let reply = ends.poller.answered(ends.now_ns, Ok(at(1)), motion, None);
        assert!(ends.tick.read(Some(reply)).is_ok());
        assert_eq!(ends.tick.motion_to_force_ns(), stated);
    }
}

/// Refusals of a device that idles before the first wrench do not count as refusals of this run.
#[test]
fn refusals_count_from_the_first_wrench_of_the_tick() {
    let mut ends = Ends::new();
    let mut told = |refused, hands| {
        ends.refused = refused;
        ends.now_ns += 10 * MS;
        ends.handed = None;
        if hands {
            ends.hand(0.0);
        }
        let reply = ends.exchange(0.0, 0, Ok(at(1)));
        let _ = ends.tick.read(Some(reply));
        // The count stays until another reply.
        let _ = ends.tick.read(None);
        ends.tick.refused_wrenches()
    };
    assert_eq!(told(None, false), None);
    assert_eq!(told(Some(3), false), Some(0));
    assert_eq!(told(Some(5), true), Some(0));
    assert_eq!(told(Some(6), false), Some(1));
    assert_eq!(told(Some(9), true), Some(4));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// In no case is a force commanded that is older than twice the time of a let-go.
    #[test]
    fn no_force_outlives_the_tick(
        events in prop::collection::vec((0..15 * MS, 0..3_u8, 0..3_u8, 0..4_u8), 1..200),
    ) {
        let mut ends = Ends::new();
        let mut handed_ns = 0;
        for (passed_ns, hands, looks, answer) in events {
            ends.now_ns += passed_ns;
            if hands > 0 && let Ok(handed) = ends.tick.hand(&push(1.0)) {
                ends.handed = Some(handed);
                handed_ns = ends.now_ns;
            }
            if looks == 0 {
                continue;
            }
            match ends.next() {
                Step::Wait(until_ns) => prop_assert!(until_ns > ends.now_ns),
                Step::Reopen => {
                    ends.poller.reopened(ends.now_ns, if answer == 0 { Err(GONE) } else { Ok(()) });
                }
                Step::Exchange(wrench) => {
                    let age_ns = ends.now_ns - handed_ns;
                    prop_assert!(wrench == push(0.0) || age_ns <= 20 * MS, "{age_ns}");
                    let answer = match answer {
                        0 => Err(GONE),
                        1 => Err(DeviceError::NoReport),
                        _ => Ok(at(1)),
                    };
                    let motion = MotionSource::Thread;
                    let reply = ends.poller.answered(ends.now_ns, answer, motion, None);
                    let _ = ends.tick.read(Some(reply));
                }
            }
        }
    }
}

/// A device for the tests of the thread. Each force selects an action of the device.
struct Obeys {
    released: Arc<AtomicBool>,
}

const ANSWERS: f64 = 1.0;
const VANISHES: f64 = 2.0;
const PANICS: f64 = 3.0;

impl Exchange for Obeys {
    fn exchange(&mut self, wrench: &Wrench) -> Reading {
        match wrench.force.x {
            ANSWERS => Ok(at(7)),
            VANISHES => Err(GONE),
            PANICS => panic!("a defect of the driver"),
            _ => Err(DeviceError::NoReport),
        }
    }
    fn release(&mut self) {
        // A person may hold the device when the run ends: the end waits for this.
        std::thread::sleep(Duration::from_millis(50));
        self.released.store(true, Ordering::Relaxed);
    }
    fn reopen(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// The thread drives the machines until the end, also after the device was lost or its driver has panicked.
#[test]
fn a_thread_exchanges_and_releases_the_device() {
    for (force, error) in [(VANISHES, GONE), (PANICS, DeviceError::Disconnected(ENDED))] {
        let released = Arc::new(AtomicBool::new(false));
        let obeys = Obeys {
            released: Arc::clone(&released),
        };
        let device = Exchanged::start(obeys, small(Freedom::Three), 1e-3, DEVICE_PRIORITY);
        let mut device = device.expect("a thread");
        for (force, reading) in [(ANSWERS, Ok(at(7))), (force, Err(error))] {
            while device.read(0).map(|state| at(state.device_time_ns)) != reading {
                let _ = device.write(0, &push(force));
                std::thread::yield_now();
            }
        }
        drop(device);
        assert!(released.load(Ordering::Relaxed));
    }
}

/// A vendor's library may block without end: the tick is busy as soon as the ring is full, and the end of the run leaves
/// the thread behind.
#[test]
fn neither_the_tick_nor_the_end_waits_for_a_device_that_blocks() {
    struct Blocks(Sender<&'static str>, Receiver<()>);
    impl Exchange for Blocks {
        fn exchange(&mut self, _: &Wrench) -> Reading {
            let _ = self.0.send("exchanged");
            let _ = self.1.recv();
            Err(DeviceError::NoReport)
        }
        fn release(&mut self) {
            let _ = self.0.send("released");
        }
        fn reopen(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
    }
    let (done, seen) = channel();
    let (goes_on, waits) = channel();
    let device = Exchanged::start(
        Blocks(done, waits),
        small(Freedom::Three),
        1e-3,
        DEVICE_PRIORITY,
    );
    let mut device = device.expect("a thread");
    assert_eq!(seen.recv(), Ok("exchanged"));
    for _ in 0..SLOTS {
        assert_eq!(device.write(0, &push(1.0)), Ok(()));
    }
    assert_eq!(device.write(0, &push(1.0)), Err(DeviceError::Busy));
    drop(device);
    // The device still blocks. It is released as soon as it does not.
    assert_eq!(seen.try_recv(), Err(std::sync::mpsc::TryRecvError::Empty));
    drop(goes_on);
    assert_eq!(seen.iter().last(), Some("released"));
}
