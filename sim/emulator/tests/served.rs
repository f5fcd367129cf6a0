//! Emulated devices behind the kernel: a driver opens each by its address, over a pty and over TCP of this machine.
//!
//! The tests run in real time and end by events: each passage of bytes is an event, and a test continues until it has
//! seen the awaited event. Only a test that fails waits until its time is over.

use devices::conformance::Suite;
use devices::transport::Packets;
use devices::woodenhaptics::{Form, Geometry, WoodenHapticsDriver};
use devices::{AnyDevice, Connection, DeviceModel, Registry, Request, Tcp, Tty};
use emulator::{Listener, Served, serve};
use firmware_proto::report::WATCHDOG_US;
use rt_core::{Device, DeviceError, DeviceState, Vec3, Wrench};
use sim::emulate::firmware::LOOP_NS;
use sim::emulate::{Emulator, Firmware, Framing, WoodenHaptics};
use sim::{Arm, Hand, SimDevice, Trajectory};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest time between two requests for bytes of an emulator.
const PERIOD: Duration = Duration::from_micros(500);
/// Time after which a test has failed.
const PATIENCE: Duration = Duration::from_secs(60);
/// Half a unit of force in a report (N), and a margin for rounding.
const HALF_UNIT: f64 = 0.5e-6 * (1.0 + 1e-6);

/// An emulator, and the number of times that bytes passed.
struct Inside<E> {
    emulator: E,
    passed: u64,
}

/// An emulator that two threads use: its server, and the test that looks at it. Its clock continues between two hosts.
struct Shared<E> {
    inside: Mutex<Inside<E>>,
    event: Condvar,
    start: Instant,
}

impl<E> Shared<E> {
    fn lock(&self) -> MutexGuard<'_, Inside<E>> {
        self.inside.lock().expect("no thread panics with it")
    }

    fn now_ns(&self) -> u64 {
        self.start.elapsed().as_nanos() as u64
    }
}

struct Behind<E>(Arc<Shared<E>>);

impl<E: Emulator> Emulator for Behind<E> {
    fn receive(&mut self, bytes: &[u8], _: u64) {
        let mut inside = self.0.lock();
        inside.emulator.receive(bytes, self.0.now_ns());
        inside.passed += 1;
        self.0.event.notify_all();
    }

    fn send(&mut self, _: u64, report: &mut [u8; 64]) -> Option<usize> {
        let mut inside = self.0.lock();
        let sent = inside.emulator.send(self.0.now_ns(), report);
        if sent.is_some() {
            inside.passed += 1;
            self.0.event.notify_all();
        }
        sent
    }
}

/// A listener with an emulator, served by a thread.
struct Server<E> {
    shared: Arc<Shared<E>>,
    connection: String,
    stop: Arc<AtomicBool>,
    /// Whether the connection of the present host has to end.
    interrupted: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl<E: Emulator + Send + 'static> Server<E> {
    /// Serves `emulator`. If the bytes of the host have no framing of their own, they come in packets of `length`.
    fn start(mut listener: Listener, emulator: E, length: Option<usize>) -> Self {
        let connection = listener.connection();
        let shared = Arc::new(Shared {
            inside: Mutex::new(Inside {
                emulator,
                passed: 0,
            }),
            event: Condvar::new(),
            start: Instant::now(),
        });
        let mut behind = Behind(Arc::clone(&shared));
        let (stop, interrupted) = (
            Arc::new(AtomicBool::new(false)),
            Arc::new(AtomicBool::new(false)),
        );
        let (end, interrupt) = (Arc::clone(&stop), Arc::clone(&interrupted));
        let thread = std::thread::spawn(move || {
            loop {
                interrupt.store(false, Ordering::SeqCst);
                if end.load(Ordering::SeqCst) {
                    break;
                }
                let host = listener.host(Duration::from_millis(1)).expect("a listener");
                let Some(mut host) = host else { continue };
                let mut served = Served::default();
                // An error is the end of a host. The next one may come.
                let _ = match length {
                    None => serve(&mut behind, &mut host, PERIOD, &interrupt, &mut served),
                    Some(length) => {
                        let mut packets = Packets::new(&mut *host, length);
                        serve(&mut behind, &mut packets, PERIOD, &interrupt, &mut served)
                    }
                };
            }
        });
        Self {
            shared,
            connection,
            stop,
            interrupted,
            thread: Some(thread),
        }
    }

    /// Ends the connection of the present host.
    fn hang_up(&self) {
        self.interrupted.store(true, Ordering::SeqCst);
    }

    /// Opens the device by its address.
    fn open(&self, model: &DeviceModel, driver: Option<&str>) -> AnyDevice {
        let connection = match driver {
            Some(driver) => Connection::parse(&format!("{driver}:{}", self.connection)),
            None => Connection::parse(&self.connection),
        };
        let registry = Registry::new()
            .with(Tty)
            .with(Tcp)
            .with(WoodenHapticsDriver);
        let request = Request::new(model, &connection.address);
        let device = registry.open(&connection.driver, &request);
        device.unwrap_or_else(|error| panic!("{connection}: {error}"))
    }

    /// Reads and writes once for each passage of bytes, until `done`. `done` sees the emulator and the result of the
    /// read, and gives the next wrench.
    fn run(
        &self,
        device: &mut dyn Device,
        mut done: impl FnMut(&mut E, &Result<DeviceState, DeviceError>) -> Option<Wrench>,
    ) {
        let start = Instant::now();
        let mut seen = 0;
        loop {
            let state = device.read(self.shared.now_ns());
            let next = done(&mut self.shared.lock().emulator, &state);
            let Some(wrench) = next else { return };
            // A lost device takes none.
            let _ = device.write(self.shared.now_ns(), &wrench);
            let left = PATIENCE.saturating_sub(start.elapsed());
            let waited = self
                .shared
                .event
                .wait_timeout_while(self.shared.lock(), left, |inside| inside.passed == seen);
            let (inside, timeout) = waited.expect("no thread panics with it");
            assert!(!timeout.timed_out(), "{}: {state:?}", self.connection);
            seen = inside.passed;
        }
    }
}

impl<E> Drop for Server<E> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        self.interrupted.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking());
        }
    }
}

fn push(force: Vec3) -> Wrench {
    Wrench {
        force,
        moment: Vec3::zeros(),
    }
}

fn listeners() -> [Listener; 2] {
    [
        Listener::pty().expect("a pty"),
        Listener::tcp(0).expect("a port"),
    ]
}

fn omega() -> DeviceModel {
    DeviceModel {
        rate_hz: 1000,
        ..DeviceModel::named("omega3").expect("a built-in device")
    }
}

/// A device that speaks the firmware protocol, which its hand pushes to 20 mm along x and holds there.
fn pushed() -> Firmware {
    let path = [(0.0, Vec3::zeros()), (0.3, Vec3::new(0.02, 0.0, 0.0))];
    let hand = Hand::new(Trajectory::new_waypoints(&path).expect("a slow motion"));
    let device = SimDevice::new(omega(), Some(hand.with_arm(Arm::FIRM)), 1e-3);
    Firmware::new(device.expect("a sound model"), "omega3", Framing::Stream)
}

/// Continues until a state has the pushed position and the device has the force of the host.
fn works(server: &Server<Firmware>, device: &mut dyn Device) {
    let force = Vec3::new(0.3, -0.2, 0.25);
    let (mut moved, mut felt) = (false, false);
    server.run(device, |emulator, state| {
        // A firm arm gives way to less than a newton by less than 5 mm.
        moved |= state.is_ok_and(|state| (state.pose.position.x - 0.02).abs() < 0.005);
        felt |= (emulator.device().force() - force).amax() <= HALF_UNIT;
        (!moved || !felt).then_some(push(force))
    });
}

#[test]
fn a_device_over_a_stream_has_states_and_force() {
    for listener in listeners() {
        let server = Server::start(listener, pushed(), None);
        let mut device = server.open(&omega(), None);
        works(&server, &mut *device);
        // A restarted device comes back by itself.
        let shared = &server.shared;
        let now_ns = shared.now_ns();
        shared.lock().emulator.restart(now_ns);
        works(&server, &mut *device);
        // A driver that ends lets the device go: by its last report, or ten milliseconds later by the watchdog.
        drop(device);
        let end_ns = shared.now_ns() + u64::from(WATCHDOG_US) * 1000 + LOOP_NS;
        let mut inside = shared.lock();
        inside.emulator.run(end_ns);
        assert_eq!(inside.emulator.device().force(), Vec3::zeros());
    }
}

#[test]
fn a_device_over_tcp_comes_back_after_its_connection_ended() {
    let server = Server::start(Listener::tcp(0).expect("a port"), pushed(), None);
    let mut device = server.open(&omega(), None);
    works(&server, &mut *device);
    server.hang_up();
    let mut lost = false;
    server.run(&mut *device, |_, state| {
        lost |= matches!(state, Err(DeviceError::Disconnected(_)));
        (!lost).then_some(Wrench::zero())
    });
    works(&server, &mut *device);
}

#[test]
fn another_devices_profile_is_refused_over_the_line() {
    let server = Server::start(Listener::pty().expect("a pty"), pushed(), None);
    let connection = Connection::parse(&server.connection);
    let hapkit = DeviceModel::named("hapkit").expect("a built-in device");
    let request = Request::new(&hapkit, &connection.address);
    let refused = Registry::new().with(Tty).open("tty", &request);
    let error = refused.err().expect("it is another device").to_string();
    assert!(error.contains("another device's profile"), "{error}");
    // The right profile is taken, after the wrong one.
    drop(server.open(&omega(), None));
}

fn wooden_model() -> DeviceModel {
    DeviceModel::named("woodenhaptics").expect("a built-in device")
}

fn wooden() -> WoodenHaptics {
    let device = SimDevice::new(wooden_model(), None, 1e-3).expect("a sound model");
    WoodenHaptics::new(device, &Geometry::default(), Form::Short).expect("a sound geometry")
}

#[test]
fn a_woodenhaptics_over_a_stream_is_calibrated_and_has_force() {
    for listener in listeners() {
        let server = Server::start(listener, wooden(), Some(Form::Short.length()));
        let mut device = server.open(&wooden_model(), Some("woodenhaptics"));
        let mut events = 0_u32;
        server.run(&mut *device, |emulator, state| {
            // The operator holds the handle at the origin, and presses the button until it works.
            events += 1;
            if events.is_multiple_of(20) && state.is_err() {
                emulator.press_calibration();
            }
            state.is_err().then_some(Wrench::zero())
        });
        let (mut felt, mut moved) = (false, false);
        server.run(&mut *device, |emulator, state| {
            let truth = emulator.device();
            felt |= truth.force().x > 0.5;
            // It is in no hand and moves ahead of its state. A millimetre is five counts.
            moved |= state.is_ok_and(|state| {
                let x = state.pose.position.x;
                x > 0.01 && truth.position().x > x - 1e-3
            });
            (!felt || !moved).then_some(push(Vec3::new(1.0, 0.0, 0.0)))
        });
    }
}

#[test]
fn every_device_over_a_stream_conforms() {
    for listener in listeners() {
        let server = Server::start(listener, pushed(), None);
        // The suite does not wait for states.
        Suite::new(&server.connection)
            .states(0)
            .check(|| server.open(&omega(), None));
    }
    for listener in listeners() {
        let server = Server::start(listener, wooden(), Some(Form::Short.length()));
        Suite::new(&server.connection)
            .states(0)
            .check(|| server.open(&wooden_model(), Some("woodenhaptics")));
    }
}
