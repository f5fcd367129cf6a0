//! Emulated devices on USB and on uhid, through the whole kernel: usbcore, usbhid and hidraw, or usbfs.
//!
//! The tests need root, and the modules `dummy_hcd`, `libcomposite`, `usb_f_hid`, `usb_f_fs`, `usbhid` and `uhid` of the
//! kernel. Without root or a module, the tests are skipped with a loud line; if the variable `PALPATE_NEEDS_KERNEL` is
//! set, they fail. `tests/vm` boots a machine that has all of these. The tests run in real time, and end by events.

use devices::conformance::Suite;
use devices::falcon::{Falcon, FalconDriver, Firmware as Image};
use devices::found::Which;
use devices::found::known::FALCON;
use devices::ftdi::{Buffer, Chip as FtdiChip, Control, Ftdi};
use devices::transport::Hidraw;
use devices::usbfs::{Selector, UsbDevice};
use devices::woodenhaptics::{Form, Geometry, WoodenHapticsDriver};
use devices::{
    AnyDevice, Connection, DeviceModel, Exchange, Hid, Registry, Request, Transport, falcon, found,
};
use emulator::uhid::Identity;
use emulator::usb::Chip;
use emulator::{Listener, ListenerError, Served, serve};
use rt_core::{Device, DeviceError, DeviceState, Vec3, Wrench};
use sim::emulate::falcon::{Falcon as EmulatedFalcon, Faults, Settings, UploadFault};
use sim::emulate::{Emulator, Firmware, Framing, Operated, WoodenHaptics};
use sim::{Arm, Hand, SimDevice, Trajectory};
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

/// Longest time between two requests for bytes of an emulator.
const PERIOD: Duration = Duration::from_micros(500);
/// Time after which a test has failed. An emulated processor is slow.
const PATIENCE: Duration = Duration::from_secs(120);
/// Period of the ticks.
const TICK: Duration = Duration::from_millis(1);
/// Number of states, and of exchanges, of a loop.
const STATES: u32 = 300;
/// The numbers that pid.codes leaves for tests.
const NUMBERS: (u16, u16) = (0x1209, 0x0001);
/// The kernel's folder of gadgets.
const GADGETS: &str = "/sys/kernel/config/usb_gadget";

/// The tests share the controllers of the machine.
static MACHINE: Mutex<()> = Mutex::new(());

fn machine() -> MutexGuard<'static, ()> {
    MACHINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The value, or `None` with a loud line if the machine cannot make it.
fn made<T, E: std::fmt::Display>(result: Result<T, E>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(error) => {
            let needed = std::env::var_os("PALPATE_NEEDS_KERNEL").is_some();
            assert!(!needed, "{error}");
            // Not to the test's own output, which is hidden if the test passes.
            let _ = writeln!(
                std::io::stderr(),
                "\n!! SKIPPED: devices behind the kernel: {error}"
            );
            None
        }
    }
}

/// Calls `look` every millisecond until it has a value.
fn until<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(value) = look() {
            return value;
        }
        assert!(start.elapsed() < PATIENCE, "{what}: not in {PATIENCE:?}");
        sleep(TICK);
    }
}

/// An emulator that its server and the test use.
struct Shared<E>(Arc<Mutex<E>>);

impl<E> Shared<E> {
    fn lock(&self) -> MutexGuard<'_, E> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<E: Emulator> Emulator for Shared<E> {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.lock().receive(bytes, now_ns);
    }
    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        self.lock().send(now_ns, report)
    }
}

/// An emulator, served by a thread.
struct Server<E> {
    emulator: Shared<E>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Served>>,
}

impl<E: Send + 'static> Server<E> {
    fn new(
        emulator: E,
        serve: impl FnOnce(&Arc<Mutex<E>>, &AtomicBool, &mut Served) + Send + 'static,
    ) -> Self {
        let emulator = Arc::new(Mutex::new(emulator));
        let stop = Arc::new(AtomicBool::new(false));
        let (shared, end) = (Arc::clone(&emulator), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            // The emulated hardware waits for no other program, if the system allows the priority.
            let _ = runner::schedule::realtime(40);
            let mut served = Served::default();
            serve(&shared, &end, &mut served);
            served
        });
        Self {
            emulator: Shared(emulator),
            stop,
            thread: Some(thread),
        }
    }

    /// Ends the device.
    fn end(mut self) -> Served {
        self.stop.store(true, Ordering::SeqCst);
        let thread = self.thread.take().expect("it was started");
        thread.join().expect("the server ends in order")
    }
}

impl<E: Emulator + Send + 'static> Server<E> {
    fn on(mut listener: Listener, emulator: E) -> Self {
        Self::new(emulator, move |shared, stop, served| {
            let mut shared = Shared(Arc::clone(shared));
            let host = listener.host(PERIOD).expect("a HID device needs no host");
            let mut host = host.expect("a HID device needs no host");
            serve(&mut shared, &mut host, PERIOD, stop, served).expect("the transport goes on");
        })
    }
}

impl<E> Drop for Server<E> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Opens a device as soon as the kernel has it.
fn open(connection: &str, model: &DeviceModel, firmware: Option<&Path>) -> AnyDevice {
    let registry = Registry::new()
        .with(Hid)
        .with(WoodenHapticsDriver)
        .with(FalconDriver);
    let parsed = Connection::parse(connection);
    let mut last = String::new();
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        let request = Request {
            period: TICK.as_secs_f64(),
            firmware,
            ..Request::new(model, &parsed.address)
        };
        match registry.open(&parsed.driver, &request) {
            Ok(device) => return device,
            Err(error) => last = error.to_string(),
        }
        sleep(Duration::from_millis(20));
    }
    panic!("{connection}: {last}");
}

/// One tick a millisecond until `done` has no next wrench.
fn run(
    device: &mut dyn Device,
    what: &str,
    mut done: impl FnMut(&Result<DeviceState, DeviceError>) -> Option<Wrench>,
) {
    let start = Instant::now();
    until(what, || {
        let now = start.elapsed().as_nanos() as u64;
        let state = device.read(now);
        let Some(wrench) = done(&state) else {
            return Some(());
        };
        let _ = device.write(now, &wrench);
        None
    });
}

/// Ticks of a device that works, until it has given many states.
fn ticks(what: &str, device: &mut dyn Device) {
    let mut states = 0;
    run(device, what, |state| {
        match state {
            Ok(_) => states += 1,
            Err(DeviceError::NoReport) => {}
            Err(error) => panic!("{what}: {error}"),
        }
        (states < STATES).then_some(Wrench::zero())
    });
}

fn push(force: Vec3) -> Wrench {
    Wrench {
        force,
        moment: Vec3::zeros(),
    }
}

fn identity((vid, pid): (u16, u16), report: u8) -> Identity {
    Identity {
        name: "Palpate's emulated device".into(),
        serial: "kernel".into(),
        vid,
        pid,
        report,
    }
}

type MakeListener = fn(Identity) -> Result<Listener, ListenerError>;
const LISTENERS: [(&str, MakeListener); 2] = [("usb", Listener::usb), ("uhid", Listener::uhid)];

/// Checks that the machine has none of our gadgets.
fn no_gadget() {
    let left = std::fs::read_dir(GADGETS).into_iter().flatten();
    let left = left.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let left: Vec<_> = left.filter(|name| name.starts_with("palpate-")).collect();
    assert!(left.is_empty(), "{left:?}");
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
    Firmware::new(device.expect("a sound model"), "omega3", Framing::Report)
}

/// Ticks until a state has the pushed position and the device has the force of the host.
fn works(device: &mut dyn Device, emulator: &Shared<Firmware>) {
    let force = Vec3::new(0.3, -0.2, 0.25);
    let (mut moved, mut felt) = (false, false);
    run(device, "position and force", |state| {
        // A firm arm gives way to less than a newton by less than 5 mm.
        moved |= state.is_ok_and(|state| (state.pose.position.x - 0.02).abs() < 0.005);
        // Half a unit of force in a report, and rounding.
        felt |= (emulator.lock().device().force() - force).amax() <= 0.5e-6 * (1.0 + 1e-6);
        (!moved || !felt).then_some(push(force))
    });
}

#[test]
fn a_device_of_the_firmware_protocol_works_and_comes_back() {
    let _machine = machine();
    for (name, listener) in LISTENERS {
        let Some(made) = made(listener(identity(NUMBERS, 64))) else {
            continue;
        };
        let connection = made.connection();
        let server = Server::on(made, pushed());
        let mut device = open(&connection, &omega(), None);
        works(&mut *device, &server.emulator);
        ticks(&format!("firmware on {name}"), &mut *device);
        let listed = found::list(Path::new("/"));
        assert!(
            listed.iter().any(|device| device.connect == connection),
            "{connection} is not in {listed:?}"
        );
        // Unplugged in the middle of a push, and plugged in again.
        let served = server.end();
        println!("firmware on {name}: {served:?}");
        run(&mut *device, "the loss", |state| {
            (!matches!(state, Err(DeviceError::Disconnected(_)))).then_some(Wrench::zero())
        });
        no_gadget();
        let again = listener(identity(NUMBERS, 64)).expect("it was made before");
        let server = Server::on(again, pushed());
        works(&mut *device, &server.emulator);
        drop(device);
        // The suite does not wait for states.
        let suite = Suite::new(&connection).states(0);
        suite.check(|| open(&connection, &omega(), None));
    }
    no_gadget();
}

fn wooden_model() -> DeviceModel {
    DeviceModel::named("woodenhaptics").expect("a built-in device")
}

fn wooden() -> WoodenHaptics {
    let device = SimDevice::new(wooden_model(), None, 1e-3).expect("a sound model");
    WoodenHaptics::new(device, &Geometry::default(), Form::Short).expect("a sound geometry")
}

#[test]
fn a_woodenhaptics_is_calibrated_and_has_force() {
    let _machine = machine();
    let numbers = (0x1234, 0x0006);
    for (name, listener) in LISTENERS {
        let Some(made) = made(listener(identity(numbers, 14))) else {
            continue;
        };
        let server = Server::on(made, wooden());
        let connection = "woodenhaptics:kernel";
        let mut device = open(connection, &wooden_model(), None);
        let mut seen = 0_u32;
        run(&mut *device, "the calibration", |state| {
            // The operator holds the handle at the origin, and presses the button until it works.
            seen += 1;
            if seen.is_multiple_of(20) && state.is_err() {
                server.emulator.lock().press_calibration();
            }
            state.is_err().then_some(Wrench::zero())
        });
        let (mut felt, mut moved) = (false, false);
        run(&mut *device, "force and motion", |state| {
            let emulator = server.emulator.lock();
            let truth = emulator.device();
            felt |= truth.force().x > 0.5;
            moved |= state.is_ok_and(|state| state.pose.position.x > 0.01);
            (!felt || !moved).then_some(push(Vec3::new(1.0, 0.0, 0.0)))
        });
        ticks(&format!("woodenhaptics on {name}"), &mut *device);
        drop(device);
        round_trips(&format!("woodenhaptics on {name}"), numbers);
        let suite = Suite::new(connection).states(0);
        suite.check(|| open(connection, &wooden_model(), None));
        println!("woodenhaptics on {name}: {:?}", server.end());
    }
    no_gadget();
}

/// A report out for each report back, without a driver.
fn round_trips(what: &str, numbers: (u16, u16)) {
    let listed = found::list(Path::new("/"));
    let device = listed.iter().find(|device| device.numbers == Some(numbers));
    let path = &device.expect("it is connected").file;
    let mut hidraw = Hidraw::open(path).expect("root may open it");
    let mut buffer = [0; 64];
    // Earlier reports.
    while hidraw.read(&mut buffer, TICK * 20) != Ok(0) {}
    for _ in 0..STATES {
        hidraw.write(&[0; 14]).expect("it is connected");
        assert_eq!(hidraw.read(&mut buffer, PATIENCE), Ok(14), "{what}");
    }
}

/// An image of the size of the Falcon's own.
fn image() -> Vec<u8> {
    (0..19_000_u32).map(|k| (k * 37 + k / 256) as u8).collect()
}

/// The image in a file.
struct ImageFile(PathBuf);

impl ImageFile {
    fn new() -> Self {
        let path = std::env::temp_dir().join(format!("palpate-image-{}", std::process::id()));
        std::fs::write(&path, image()).expect("room for a file");
        Self(path)
    }
}

impl Drop for ImageFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn falcon_model() -> DeviceModel {
    DeviceModel::named("falcon").expect("a built-in device")
}

fn emulated_falcon(faults: Faults) -> Operated {
    let hand = Hand::new(Trajectory::still()).with_arm(Arm::FIRM);
    let device = SimDevice::new(falcon_model(), Some(hand), 1e-3).expect("a sound model");
    let settings = Settings {
        faults,
        ..Settings::default()
    };
    Operated::new(EmulatedFalcon::new(device, &image(), settings))
}

fn falcon_on_usb(faults: Faults) -> Option<Server<Operated>> {
    let chip = made(Chip::create("kernel"))?;
    Some(Server::new(
        emulated_falcon(faults),
        move |device, stop, served| {
            chip.serve(device, stop, served)
                .expect("the chip is served");
        },
    ))
}

#[test]
fn a_falcon_boots_homes_and_has_force() {
    let _machine = machine();
    let file = ImageFile::new();
    // Two uploads fail at first, as users report.
    let faults = Faults {
        failing_uploads: 2,
        upload: UploadFault::Changed { at: 5000 },
        split_every: 17,
        bare_every: 13,
        short_every: 501,
        ..Faults::default()
    };
    let Some(server) = falcon_on_usb(faults) else {
        return;
    };
    let mut device = open("falcon:kernel", &falcon_model(), Some(&file.0));
    assert!(server.emulator.lock().falcon().is_running());
    assert_eq!(server.emulator.lock().falcon().uploads(), 3);
    run(&mut *device, "homing", |state| {
        state.is_err().then_some(Wrench::zero())
    });
    assert_eq!(server.emulator.lock().falcon().homed(), [true; 3]);
    server.emulator.lock().falcon_mut().fail(Faults::default());
    let force = Vec3::new(1.0, -2.0, 1.5);
    run(&mut *device, "position and force", |state| {
        let emulator = server.emulator.lock();
        let truth = emulator.falcon().device();
        let felt = (truth.force() - force).norm() < 0.05;
        // The device is held by a firm arm, and a count is less than 0.1 mm.
        let seen = state.is_ok_and(|state| (state.pose.position - truth.position()).norm() < 2e-4);
        (!felt || !seen).then_some(push(force))
    });
    ticks("falcon on usb", &mut *device);
    drop(device);
    // The driver lets the device go.
    assert_eq!(server.emulator.lock().falcon().torques(), [0; 3]);
    a_purge_drops_what_waits();
    exchanges();
    let suite = Suite::new("falcon").states(0);
    suite.check(|| open("falcon:kernel", &falcon_model(), Some(&file.0)));

    // Unplugged and plugged in again: other firmware, so it is uploaded and homed again.
    let mut device = open("falcon:kernel", &falcon_model(), Some(&file.0));
    run(&mut *device, "a state", |state| {
        state.is_err().then_some(Wrench::zero())
    });
    println!("falcon on usb: {:?}", server.end());
    no_gadget();
    run(&mut *device, "the loss", |state| {
        (!matches!(state, Err(DeviceError::Disconnected(_)))).then_some(Wrench::zero())
    });
    let server = falcon_on_usb(Faults::default()).expect("it was made before");
    run(&mut *device, "the return", |state| {
        state.is_err().then_some(Wrench::zero())
    });
    assert_eq!(server.emulator.lock().falcon().homed(), [true; 3]);
    drop(device);
    drop(server);
    no_gadget();
}

/// The Falcon that is connected.
fn selector() -> Selector {
    Selector {
        kind: "falcon",
        numbers: FALCON.numbers,
        which: Which::Only,
    }
}

/// When the host empties the chip's buffer, an answer that waits in the chip is lost.
fn a_purge_drops_what_waits() {
    let mut chip = FtdiChip::new(UsbDevice::open(&selector()).expect("it is connected"));
    falcon::boot::packet_mode(&mut chip).expect("the chip takes requests");
    // No packets of status alone.
    chip.control(Control::Latency(255)).expect("it is taken");
    let read_all = |chip: &mut FtdiChip<UsbDevice>| {
        let mut buffer = [0; 64];
        let mut count = 0;
        for _ in 0..20 {
            count += chip.read(&mut buffer, TICK).expect("it is connected");
        }
        count
    };
    read_all(&mut chip);
    // The emulated host controller takes one packet before its host asks, and gives it away later in any case.
    for (purges, expected) in [(true, 1), (false, 2)] {
        for _ in 0..2 {
            let command = falcon::packet::Command::default().encode();
            chip.write(&command).expect("the chip takes bytes");
            // The answer comes 0.4 ms later; a slow machine has 50 ms for it.
            sleep(TICK * 50);
        }
        if purges {
            for buffer in [Buffer::One, Buffer::Two] {
                chip.control(Control::Purge(buffer)).expect("it is taken");
            }
        }
        assert_eq!(read_all(&mut chip), expected * falcon::packet::LENGTH);
    }
}

/// Exchanges without a tick.
fn exchanges() {
    let selector = selector();
    let firmware = Image::new(Path::new("image"), image()).expect("a sound image");
    let settings = falcon::Settings {
        firmware,
        tries: falcon::Tries::default(),
        period: 1e-3,
    };
    let open = move || match UsbDevice::open(&selector) {
        Ok(usb) => Ok(FtdiChip::new(usb)),
        Err(error) => Err(error.number()),
    };
    let start = Instant::now();
    let clock = move || start.elapsed().as_nanos() as u64;
    let mut falcon = Falcon::connect(open, clock, settings).expect("it runs its firmware");
    for _ in 0..STATES {
        let _ = falcon.exchange(&Wrench::zero());
    }
    let counts = falcon.counts();
    assert!(counts.good > 0, "{counts:?}");
}

/// Name of the test that a test runs in a process of its own.
const KILLED: &str = "a_process_with_gadgets_is_killed";
/// Selects what that test makes.
const MAKES: &str = "PALPATE_MAKES";

#[test]
#[ignore = "another test runs it in a process of its own"]
fn a_process_with_gadgets_is_killed() {
    let hid = std::env::var_os(MAKES).is_some_and(|what| what == "hid");
    let _gadgets = (
        hid.then(|| Listener::usb(identity(NUMBERS, 64)).expect("the test before made it")),
        (!hid).then(|| Chip::create("kernel").expect("the test before made it")),
    );
    let process = rustix::process::getpid();
    let _ = rustix::process::kill_process(process, rustix::process::Signal::KILL);
    sleep(PATIENCE);
}

#[test]
fn gadgets_of_a_killed_process_are_removed_by_the_next() {
    let _machine = machine();
    let Some(first) = made(Listener::usb(identity(NUMBERS, 64))) else {
        return;
    };
    drop(first);
    for what in ["hid", "falcon"] {
        let this = std::env::current_exe().expect("a path");
        let status = std::process::Command::new(this)
            .args(["--exact", KILLED, "--include-ignored"])
            .env(MAKES, what)
            .stdout(std::process::Stdio::null())
            .status();
        let status = status.expect("it runs");
        assert_eq!(status.signal(), Some(9), "{status}");
        let left = std::fs::read_dir(GADGETS).expect("the kernel has gadgets");
        assert_eq!(left.count(), 1, "{what}");
        drop(Listener::usb(identity(NUMBERS, 64)).expect("the controller is free again"));
        no_gadget();
    }
}

#[test]
fn gadgets_take_all_controllers_and_no_more() {
    let _machine = machine();
    let Some(first) = made(Listener::usb(identity(NUMBERS, 64))) else {
        return;
    };
    let controllers = std::fs::read_dir("/sys/class/udc").expect("there is one");
    let mut gadgets = vec![first];
    let error = loop {
        match Listener::usb(identity(NUMBERS, 64)) {
            Ok(gadget) => gadgets.push(gadget),
            Err(error) => break error.to_string(),
        }
    };
    assert_eq!(gadgets.len(), controllers.count());
    for part in ["no USB device controller is free", "in use: ", "num=2"] {
        assert!(error.contains(part), "{part} in {error}");
    }
    drop(gadgets);
    no_gadget();
}
