//! A device for a command to hold, of which this process sees the force that it renders.

use super::Held;
use emulator::{Attended, Listener, ServeError, Served};
use host::scene::NamedDevice;
use runner::schedule::realtime;
use sim::emulate::Framing;
use sim::{Hand, SimDevice, Trajectory};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Force below which a device renders none (N): less than any person feels, and less than a current of 1 mA makes.
pub(super) const NONE: f64 = 1e-3;
/// Priority of an emulated device under SCHED_FIFO, if allowed.
const PRIORITY: u8 = 40;
/// Period at which the file of the plug-in is read.
const PERIOD: Duration = Duration::from_micros(500);
/// The plug-in and its interface.
const PLUGIN: [(&str, &str); 2] = [
    ("held.c", include_str!("held.c")),
    (
        "palpate_device.h",
        include_str!("../../../../../rt_core/devices/plugin/palpate_device.h"),
    ),
];

/// What is seen of a device. The numbers are bits of `f64`.
#[derive(Debug, Default)]
struct Seen {
    /// The force now (N).
    force: AtomicU64,
    /// The force after the last bytes of the host (N).
    left: AtomicU64,
    /// The last time with a force since the start (ns).
    last_ns: AtomicU64,
}

/// A device that a command may hold. It lives on in a thread until this value is dropped.
pub(super) struct Watched {
    seen: Arc<Seen>,
    begun: Instant,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), ServeError>>>,
    /// How a scene connects to the device.
    pub(super) connect: String,
    /// The built-in device whose model the device has.
    pub(super) model: &'static str,
}

impl Watched {
    /// Makes the device that a command of this kind holds; `None` for a command that holds none. The plug-in is built in
    /// `folder`.
    ///
    /// # Errors
    /// What the person must be told.
    pub(super) fn begin(held: Held, folder: &Path) -> Result<Option<Self>, String> {
        let seen = Arc::new(Seen::default());
        let begun = Instant::now();
        let stop = Arc::new(AtomicBool::new(false));
        let see = {
            let seen = Arc::clone(&seen);
            move |force: f64, after_bytes: bool| {
                seen.force.store(force.to_bits(), Ordering::SeqCst);
                if after_bytes {
                    seen.left.store(force.to_bits(), Ordering::SeqCst);
                }
                if force > NONE {
                    let now_ns = u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX);
                    seen.last_ns.store(now_ns, Ordering::SeqCst);
                }
            }
        };
        let theirs = Arc::clone(&stop);
        let (model, free) = match held {
            Held::Virtual | Held::Simulated => return Ok(None),
            Held::Firmware => ("omega3", false),
            Held::WoodenHaptics => ("woodenhaptics", false),
            // Commands that move a device which nobody holds.
            Held::Probe | Held::Identify => ("omega3", true),
            Held::Plugin => {
                let connect = plugin(folder)?;
                let file = folder.join("force");
                let follow = move || {
                    while !theirs.load(Ordering::SeqCst) {
                        let bytes = std::fs::read(&file).unwrap_or_default();
                        if let Ok(bytes) = <[u8; 8]>::try_from(bytes) {
                            see(f64::from_le_bytes(bytes), true);
                        }
                        std::thread::sleep(PERIOD);
                    }
                    Ok(())
                };
                return Ok(Some(Self {
                    seen,
                    begun,
                    stop,
                    thread: Some(std::thread::spawn(follow)),
                    connect,
                    model: "omega3",
                }));
            }
        };
        let text = |error: &dyn std::fmt::Display| error.to_string();
        let file = NamedDevice::load(model).map_err(|error| text(&error))?;
        let hand = (!free).then(|| Hand::new(Trajectory::still()));
        let device = SimDevice::new(file.file.model, hand, 1e-3).map_err(|error| text(&error))?;
        let mut attended = if held == Held::WoodenHaptics {
            Attended::woodenhaptics(device, Framing::Stream).map_err(|error| text(&error))?
        } else {
            Attended::firmware(device, model, Framing::Stream)
        };
        let mut listener = Listener::pty().map_err(|error| text(&error))?;
        let connect = attended.connection(&listener);
        let serve = move || {
            // As `palpate device emulate`.
            let _ = realtime(PRIORITY);
            let mut see = |device: &Attended, after_bytes| see(device.force(), after_bytes);
            attended.serve(&mut listener, &theirs, &mut Served::default(), &mut see)
        };
        Ok(Some(Self {
            seen,
            begun,
            stop,
            thread: Some(std::thread::spawn(serve)),
            connect,
            model,
        }))
    }

    /// The force that the device renders now (N).
    pub(super) fn force(&self) -> f64 {
        f64::from_bits(self.seen.force.load(Ordering::SeqCst))
    }

    /// The force that the last bytes of the host left to the device (N).
    pub(super) fn left(&self) -> f64 {
        f64::from_bits(self.seen.left.load(Ordering::SeqCst))
    }

    /// Time from `moment` until the device rendered no force any more.
    pub(super) fn released_after(&self, moment: Instant) -> Duration {
        let last = Duration::from_nanos(self.seen.last_ns.load(Ordering::SeqCst));
        (self.begun + last).saturating_duration_since(moment)
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            // The loss of a pty is no error of the study.
            let _ = thread.join();
        }
    }
}

/// Builds the plug-in in `folder`, and returns how a scene connects to it.
fn plugin(folder: &Path) -> Result<String, String> {
    let failed = |problem: String| format!("the plug-in cannot be built: {problem}");
    for (name, text) in PLUGIN {
        std::fs::write(folder.join(name), text).map_err(|error| failed(error.to_string()))?;
    }
    std::fs::write(folder.join("force"), 0.0_f64.to_le_bytes())
        .map_err(|error| failed(error.to_string()))?;
    let built = Command::new("cc")
        .args([
            "-std=c99", "-O1", "-shared", "-fPIC", "-o", "held.so", "held.c", "-lm",
        ])
        .current_dir(folder)
        .output()
        .map_err(|error| failed(format!("no C compiler `cc` ({error})")))?;
    if !built.status.success() {
        return Err(failed(String::from_utf8_lossy(&built.stderr).into_owned()));
    }
    let folder = folder.display();
    Ok(format!("plugin:{folder}/held.so:{folder}/force"))
}
