use super::*;
use crate::scripted::small;
use rt_core::{Freedom, Rendering, Vec3};
use std::sync::mpsc::{Receiver, Sender, channel};

/// What the thread did.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Done {
    Exchanged(f64),
    Reopened,
    Released,
}

/// A device that reports what is done with it, and answers as a test tells it.
struct Told {
    done: Sender<Done>,
    answers: Receiver<Answer>,
}

impl Exchange for Told {
    fn exchange(&mut self, wrench: &Wrench) -> Answer {
        let _ = self.done.send(Done::Exchanged(wrench.force.x));
        // A test that has ended lets everything fail.
        self.answers.recv().unwrap_or(Err(DeviceError::NoReport))
    }
    fn release(&mut self) {
        let _ = self.done.send(Done::Released);
    }
    fn reopen(&mut self) -> Result<(), DeviceError> {
        let _ = self.done.send(Done::Reopened);
        self.answers
            .recv()
            .map_or(Ok(()), |answer| answer.map(drop))
    }
}

fn told() -> (Exchanged, Receiver<Done>, Sender<Answer>) {
    let (done, seen) = channel();
    let (tell, answers) = channel();
    let device = Exchanged::start(Told { done, answers }, small(Freedom::Three));
    (device.expect("a thread"), seen, tell)
}

/// The thread of this device never lets go by itself: however busy the machine is, a test meets each exchange once.
fn patient() -> (Exchanged, Receiver<Done>, Sender<Answer>) {
    let (device, seen, tell) = told();
    let minute = Duration::from_secs(60).as_nanos() as u64;
    device.let_go_ns.store(minute, Ordering::Relaxed);
    (device, seen, tell)
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

/// Hands `force` over, and waits until the thread of a [`patient`] device has exchanged it.
#[track_caller]
fn exchanged(device: &mut Exchanged, seen: &Receiver<Done>, force: f64) {
    assert_eq!(device.write(0, &push(force)), Ok(()));
    assert_eq!(seen.recv(), Ok(Done::Exchanged(force)));
}

/// Hands the first force over, and waits until the thread has exchanged it. On a busy machine the thread may look so late
/// that it lets go. The wrench is then handed over again, while the thread waits for the answer to its zero.
fn first(device: &mut Exchanged, seen: &Receiver<Done>, tell: &Sender<Answer>, force: f64) {
    assert_eq!(device.write(0, &push(force)), Ok(()));
    while seen.recv() != Ok(Done::Exchanged(force)) {
        let _ = device.write(0, &push(force));
        tell.send(Err(DeviceError::NoReport)).expect("it listens");
    }
}

fn let_go(state: DeviceState) -> DeviceState {
    DeviceState {
        rendering: Rendering::LetGo,
        ..state
    }
}

/// Reads until the answer is `wanted`.
fn read(device: &mut Exchanged, wanted: Answer) {
    while device.read(0) != wanted {
        std::thread::yield_now();
    }
}

#[test]
fn a_wrench_is_exchanged_for_a_state() {
    let (mut device, seen, tell) = patient();
    assert_eq!(device.read(0), Err(DeviceError::NoReport));
    exchanged(&mut device, &seen, 1.5);
    tell.send(Ok(at(7))).expect("it listens");
    read(&mut device, Ok(at(7)));
    assert!(device.counts().states() == 1 && device.counts().losses() == 0);
    drop(tell);
    drop(device);
    assert_eq!(seen.iter().last(), Some(Done::Released));
}

#[test]
fn motion_to_force_is_the_time_between_the_requests_for_the_state_and_for_its_force() {
    let (mut device, seen, tell) = patient();
    let pause = Duration::from_millis(3);
    // The first wrench answers no state.
    exchanged(&mut device, &seen, 1.0);
    tell.send(Ok(at(1))).expect("it listens");
    read(&mut device, Ok(at(1)));
    assert_eq!(device.motion_to_force_ns(), None);
    std::thread::sleep(pause);
    // The wrench that is handed over after the read answers that state. Its exchange begins after the pause.
    exchanged(&mut device, &seen, 2.0);
    tell.send(Ok(at(2))).expect("it listens");
    read(&mut device, Ok(at(2)));
    let shown = device.motion_to_force_ns().map(Duration::from_nanos);
    assert!(shown.is_some_and(|shown| shown >= pause), "{shown:?}");
    // A wrench without a new state answers none.
    assert_eq!(device.read(0), Err(DeviceError::NoReport));
    assert_eq!(device.motion_to_force_ns(), None);
    exchanged(&mut device, &seen, 3.0);
    tell.send(Ok(at(3))).expect("it listens");
    read(&mut device, Ok(at(3)));
    assert_eq!(device.motion_to_force_ns(), None);
    drop(tell);
}

#[test]
fn a_device_that_blocks_makes_the_tick_busy_and_then_gets_the_newest_wrench() {
    let (mut device, seen, tell) = patient();
    exchanged(&mut device, &seen, 1.0);
    // The device is in its first exchange. Four wrenches may wait.
    for force in [2.0, 3.0, 4.0, 5.0] {
        assert_eq!(device.write(0, &push(force)), Ok(()));
    }
    assert_eq!(device.write(0, &push(6.0)), Err(DeviceError::Busy));
    tell.send(Ok(at(1))).expect("it listens");
    assert_eq!(seen.recv(), Ok(Done::Exchanged(5.0)));
}

#[test]
fn a_wrench_that_waited_while_the_process_was_stopped_is_not_commanded() {
    let (mut device, seen, tell) = told();
    first(&mut device, &seen, &tell, 1.0);
    // The thread is in its exchange, and the tick hands one more wrench over before everything stands still.
    assert_eq!(device.write(0, &push(2.0)), Ok(()));
    std::thread::sleep(3 * LET_GO);
    tell.send(Ok(at(1))).expect("it listens");
    assert_eq!(seen.recv(), Ok(Done::Exchanged(0.0)));
    tell.send(Ok(at(2))).expect("it listens");
    read(&mut device, Ok(let_go(at(2))));
    // A new wrench of the tick that was told is commanded again.
    first(&mut device, &seen, &tell, 3.0);
    drop(tell);
}

#[test]
fn a_tick_that_stops_lets_the_device_go() {
    let (mut device, seen, tell) = told();
    first(&mut device, &seen, &tell, 1.0);
    tell.send(Ok(at(1))).expect("it listens");
    // No further wrench comes.
    assert_eq!(seen.recv(), Ok(Done::Exchanged(0.0)));
    assert!(device.counts().let_go() >= 1);
}

#[test]
fn a_lost_device_comes_back_and_its_clock_goes_on() {
    let (mut device, seen, tell) = patient();
    let gone = DeviceError::Disconnected(19);
    exchanged(&mut device, &seen, 1.0);
    tell.send(Ok(at(50))).expect("it listens");
    read(&mut device, Ok(at(50)));
    exchanged(&mut device, &seen, 2.0);
    assert_eq!(device.write(0, &push(3.0)), Ok(()));
    tell.send(Err(gone)).expect("it listens");
    read(&mut device, Err(gone));
    // The error stays until the device is back.
    assert_eq!(device.read(0), Err(gone));
    assert_eq!(device.write(0, &push(4.0)), Err(gone));
    // The first attempt fails, the second succeeds. The device that is back gets zero first, and no older wrench.
    assert_eq!(seen.recv(), Ok(Done::Reopened));
    tell.send(Err(gone)).expect("it listens");
    assert_eq!(seen.recv(), Ok(Done::Reopened));
    tell.send(Ok(at(0))).expect("it listens");
    assert_eq!(seen.recv(), Ok(Done::Exchanged(0.0)));
    // Its clock starts at 3 ns, and continues from 50 ns. The force before the loss was let go.
    tell.send(Ok(at(3))).expect("it listens");
    read(&mut device, Ok(let_go(at(50))));
    exchanged(&mut device, &seen, 5.0);
    tell.send(Ok(at(10))).expect("it listens");
    read(&mut device, Ok(at(57)));
    let counts = device.counts();
    assert_eq!((counts.losses(), counts.returns()), (1, 1));
}

#[test]
fn a_lost_device_can_be_dropped() {
    let (mut device, seen, tell) = patient();
    exchanged(&mut device, &seen, 1.0);
    tell.send(Err(DeviceError::Disconnected(19)))
        .expect("it listens");
    read(&mut device, Err(DeviceError::Disconnected(19)));
    drop(tell);
    drop(device);
    assert_eq!(seen.iter().last(), Some(Done::Released));
}

#[test]
fn a_driver_that_panics_is_a_lost_device_and_is_released() {
    struct Broken(Sender<Done>);
    impl Exchange for Broken {
        fn exchange(&mut self, _: &Wrench) -> Answer {
            panic!("a defect of the driver");
        }
        fn release(&mut self) {
            let _ = self.0.send(Done::Released);
        }
        fn reopen(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
    }
    let (done, seen) = channel();
    let mut device = Exchanged::start(Broken(done), small(Freedom::Three)).expect("a thread");
    assert_eq!(device.write(0, &push(1.0)), Ok(()));
    read(&mut device, Err(DeviceError::Disconnected(ENDED)));
    assert_eq!(seen.recv(), Ok(Done::Released));
}

/// The thread lets go while the tick hands a wrench over that it computed before: the wrench is not commanded, and the
/// force returns with a wrench of a tick that has read the let-go.
#[test]
fn a_force_that_was_let_go_returns_after_the_tick_was_told() {
    let (mut device, seen, tell) = told();
    first(&mut device, &seen, &tell, 1.0);
    tell.send(Ok(at(1))).expect("it listens");
    // No further wrench comes in time.
    assert_eq!(seen.recv(), Ok(Done::Exchanged(0.0)));
    assert_eq!(device.write(0, &push(2.0)), Ok(()));
    tell.send(Ok(at(2))).expect("it listens");
    assert_eq!(seen.recv(), Ok(Done::Exchanged(0.0)));
    // The tick reads the state that says so, and its next wrench is commanded.
    read(&mut device, Ok(let_go(at(2))));
    assert_eq!(device.write(0, &push(3.0)), Ok(()));
    tell.send(Ok(at(3))).expect("it listens");
    loop {
        match seen.recv().expect("the thread lives") {
            Done::Exchanged(3.0) => break,
            // On a busy machine the wrench came too late, and the thread has let go of nothing.
            other => {
                assert_eq!(other, Done::Exchanged(0.0));
                assert_eq!(device.write(0, &push(3.0)), Ok(()));
                tell.send(Ok(at(3))).expect("it listens");
            }
        }
    }
    tell.send(Ok(at(4))).expect("it listens");
    read(&mut device, Ok(at(4)));
}

#[test]
fn a_device_that_let_go_gets_no_wrench_from_before() {
    let (mut device, seen, tell) = patient();
    exchanged(&mut device, &seen, 1.0);
    // The tick computes another wrench before the state comes.
    assert_eq!(device.write(0, &push(2.0)), Ok(()));
    tell.send(Ok(let_go(at(1)))).expect("it listens");
    assert_eq!(seen.recv(), Ok(Done::Exchanged(0.0)));
    tell.send(Ok(at(2))).expect("it listens");
    // The device renders again, but nothing was commanded in this exchange.
    read(&mut device, Ok(let_go(at(2))));
    exchanged(&mut device, &seen, 3.0);
}

#[test]
fn the_refusals_of_the_device_are_passed_on() {
    struct Refusing(u64);
    impl Exchange for Refusing {
        fn exchange(&mut self, _: &Wrench) -> Answer {
            self.0 += 5;
            Ok(at(self.0))
        }
        fn release(&mut self) {}
        fn reopen(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
        fn refused_wrenches(&self) -> Option<u64> {
            Some(self.0)
        }
    }
    let mut device = Exchanged::start(Refusing(0), small(Freedom::Three)).expect("a thread");
    assert_eq!(device.refused_wrenches(), None);
    // Each state has the count as its time.
    let mut told = || {
        loop {
            let _ = device.write(0, &push(1.0));
            if let (Ok(state), Some(refused)) = (device.read(0), device.refused_wrenches())
                && refused > 0
            {
                break (state.device_time_ns, refused);
            }
        }
    };
    // What the device refused up to the first wrench of the tick does not count.
    let (time, refused) = told();
    assert!(time - refused >= 5, "{refused} of {time}");
    let (later, more) = told();
    assert_eq!(more - refused, later - time);
}

#[test]
fn a_slow_loop_has_more_time_between_two_wrenches() {
    let times = [1e-3, 1.0 / 150.0, 1.0 / 100.0, 1.0 / 50.0, 1.0];
    let times = times.map(|period| let_go_after(period).as_millis());
    assert_eq!(times, [10, 26, 40, 80, 100]);
    let (device, _seen, _tell) = told();
    let let_go_ns = Arc::clone(&device.let_go_ns);
    assert_eq!(let_go_ns.load(Ordering::Relaxed), 10_000_000);
    let _device = device.for_loop(1.0 / 50.0);
    assert_eq!(let_go_ns.load(Ordering::Relaxed), 80_000_000);
}

/// A person may hold the device when the run ends.
#[test]
fn the_end_waits_until_the_device_is_released() {
    struct Slow(Arc<AtomicU64>);
    impl Exchange for Slow {
        fn exchange(&mut self, _: &Wrench) -> Answer {
            Ok(at(1))
        }
        fn release(&mut self) {
            std::thread::sleep(Duration::from_millis(50));
            self.0.fetch_add(1, Ordering::Relaxed);
        }
        fn reopen(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
    }
    // Two devices: each is released.
    let released = Arc::new(AtomicU64::new(0));
    let devices = [(); 2].map(|()| {
        let device = Exchanged::start(Slow(Arc::clone(&released)), small(Freedom::Three));
        device.expect("a thread")
    });
    for (done, device) in (1..).zip(devices) {
        drop(device);
        assert_eq!(released.load(Ordering::Relaxed), done);
    }
}

/// A vendor's library may block without end. The end of the run leaves its thread behind.
#[test]
fn the_end_does_not_wait_for_a_device_that_blocks() {
    let (mut device, seen, tell) = patient();
    assert_eq!(device.write(0, &push(1.0)), Ok(()));
    assert!(seen.recv().is_ok());
    drop(device);
    // The device still blocks. It is released as soon as it does not.
    assert_eq!(seen.try_recv(), Err(std::sync::mpsc::TryRecvError::Empty));
    drop(tell);
    assert_eq!(seen.iter().last(), Some(Done::Released));
}

#[test]
fn a_device_that_does_not_tell_its_refusals_has_none() {
    let (mut device, seen, tell) = patient();
    exchanged(&mut device, &seen, 1.0);
    tell.send(Ok(at(1))).expect("it listens");
    read(&mut device, Ok(at(1)));
    assert_eq!(device.refused_wrenches(), None);
    assert!(device.counts().states() == 1 && device.counts().returns() == 0);
}
