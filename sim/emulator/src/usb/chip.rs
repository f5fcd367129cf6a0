//! The emulated Falcon behind its FTDI chip, as a USB gadget of full speed: FunctionFS.
//!
//! Three threads serve the gadget. The caller's thread answers the requests on the control pipe, and advances the
//! emulator's time. The second thread takes the bytes of the host. The third thread sends each packet of the chip as
//! soon as the emulator has it, and waits until the host takes it. The second and the third thread wait inside their
//! system calls, because Linux's asynchronous calls end in a worker of ordinary priority.
//!
//! A packet that waits for its host is in the buffer of the chip. If the host empties the buffer, the packet is dropped:
//! a signal (SIGUSR1, which this module reserves) ends the system call of the sending thread.
//!
//! The kernel chooses the addresses of the endpoints. The controller `dummy_hcd` gives the addresses of the real chip.

use super::ftdi::{Answer, answer};
use super::functionfs::{EVENT, Event, HostRequest, Interface, texts};
use super::gadget::{Function, Gadget, GadgetError, Numbers};
use crate::Served;
use devices::found::known::FALCON;
use devices::ftdi::PACKET;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, openat};
use rustix::io::Errno;
use rustix::mount::{
    FsMountFlags, FsOpenFlags, MountAttrFlags, fsconfig_create, fsconfig_set_string, fsmount,
    fsopen,
};
use rustix::thread::{Pid, gettid};
use sim::emulate::{Emulator, Operated};
use std::io;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, sleep};
use std::time::{Duration, Instant};

/// Addresses of the chip's endpoints.
const INTERFACE: Interface = Interface {
    to_host: 0x81,
    from_host: 0x02,
};
/// Release of the device, by which drivers know the type of the chip: FT232B.
const RELEASE: u16 = 0x0400;
/// Longest time between two looks at the emulator, so that its hand moves even without a host.
const LOOK: Duration = Duration::from_millis(10);
/// Time between two signals to the sending thread, until its write has ended.
const AGAIN: Duration = Duration::from_millis(1);
/// Wait after an endpoint has refused a transfer.
const REFUSED: Duration = Duration::from_millis(1);

/// The gadget of a Falcon, which lives as long as this value.
#[derive(Debug)]
pub struct Chip {
    serial: String,
    // Files are closed before the gadget is removed.
    control: OwnedFd,
    to_host: OwnedFd,
    from_host: OwnedFd,
    gadget: Gadget,
}

impl Chip {
    /// Makes a gadget with the numbers of a Falcon and this serial number, and binds it to the first device controller
    /// that is free.
    ///
    /// # Errors
    /// [`GadgetError`], which names what is missing and the remedy.
    pub fn create(serial: &str) -> Result<Self, GadgetError> {
        let numbers = Numbers {
            vid: FALCON.numbers.0,
            pid: FALCON.numbers.1,
            release: RELEASE,
            manufacturer: "palpate".into(),
            product: "Palpate's emulated Falcon".into(),
            serial: serial.to_owned(),
            full_speed: true,
        };
        let gadget = Gadget::new(&numbers, Function::Program, &[])?;
        // A mount without a place in the file system ends with its last file, even if the process is killed.
        let mount = mount(gadget.name()).map_err(failed(&gadget, "mounting FunctionFS for"))?;
        let open = |name: &str| {
            let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC;
            openat(&mount, name, flags, Mode::empty())
        };
        let control = open("ep0").map_err(failed(&gadget, "opening ep0 of"))?;
        for bytes in [INTERFACE.descriptors(), texts("emulated FTDI chip")] {
            rustix::io::write(&control, &bytes)
                .map_err(failed(&gadget, "describing the interface of"))?;
        }
        let chip = Self {
            serial: serial.to_owned(),
            to_host: open("ep1").map_err(failed(&gadget, "opening ep1 of"))?,
            from_host: open("ep2").map_err(failed(&gadget, "opening ep2 of"))?,
            control,
            gadget,
        };
        chip.gadget.bind()?;
        Ok(chip)
    }

    /// The text by which a scene connects to the device.
    pub fn connection(&self) -> String {
        format!("falcon:{}", self.serial)
    }

    /// Serves the device until `stop` is true. After that, the gadget is gone. `device` is locked for single calls. Its
    /// time starts at zero.
    ///
    /// # Errors
    /// [`GadgetError`] if the system gives no thread, or the control pipe ends. `served` has the counts so far in any
    /// case.
    pub fn serve(
        self,
        device: &Mutex<Operated>,
        stop: &AtomicBool,
        served: &mut Served,
    ) -> Result<(), GadgetError> {
        interrupt::prepare().map_err(failed(&self.gadget, "taking a signal for"))?;
        let work = Work {
            chip: &self,
            device,
            start: Instant::now(),
            end: AtomicBool::new(false),
            state: Mutex::default(),
            changed: Condvar::new(),
        };
        let result = std::thread::scope(|scope| {
            let spawned = Builder::new()
                .name("palpate-chip-out".into())
                .spawn_scoped(scope, || work.take_bytes())
                .and_then(|_| {
                    Builder::new()
                        .name("palpate-chip-in".into())
                        .spawn_scoped(scope, || work.send_packets())
                });
            let result = match spawned {
                Ok(_) => work
                    .answer_requests(stop)
                    .map_err(failed(&self.gadget, "serving ep0 of")),
                Err(error) => Err(GadgetError::of(
                    "starting a thread for",
                    Path::new(self.gadget.name()),
                    error,
                )),
            };
            work.end.store(true, Ordering::SeqCst);
            // All transfers end with the gadget, so the threads do.
            self.gadget.unbind();
            result
        });
        *served = work.state().served;
        result
    }
}

/// The error of an action on a gadget.
fn failed(gadget: &Gadget, action: &'static str) -> impl Fn(Errno) -> GadgetError {
    let path = Path::new(gadget.name()).to_owned();
    move |error| GadgetError::of(action, &path, io::Error::from(error))
}

/// Mounts the FunctionFS of a function at no place of the file system.
fn mount(function: &str) -> Result<OwnedFd, Errno> {
    let context = fsopen("functionfs", FsOpenFlags::FSOPEN_CLOEXEC)?;
    fsconfig_set_string(&context, "source", function)?;
    fsconfig_create(&context)?;
    let flags = FsMountFlags::FSMOUNT_CLOEXEC;
    fsmount(&context, flags, MountAttrFlags::empty())
}

/// The state that the threads share.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    /// Whether a host has configured the device.
    enabled: bool,
    /// Number of the thread that sends, while it waits for the host to take a packet.
    sending: Option<Pid>,
    /// Number of calls that may have changed the time of the next packet.
    news: u64,
    /// Number of times that the host has emptied the buffer of the chip.
    purges: u64,
    served: Served,
}

/// The work of the three threads.
struct Work<'a> {
    chip: &'a Chip,
    device: &'a Mutex<Operated>,
    start: Instant,
    end: AtomicBool,
    state: Mutex<State>,
    changed: Condvar,
}

impl Work<'_> {
    fn now_ns(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The device, which stays usable if another thread has panicked.
    fn device(&self) -> MutexGuard<'_, Operated> {
        self.device.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ends(&self) -> bool {
        self.end.load(Ordering::SeqCst)
    }

    /// Changes the state and wakes the other threads.
    fn change(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.state();
        change(&mut state);
        state.news += 1;
        drop(state);
        self.changed.notify_all();
    }

    /// Waits for a change of the state, at most for `wait`.
    fn wait(&self, state: MutexGuard<'_, State>, wait: Duration) {
        drop(self.changed.wait_timeout(state, wait));
    }

    /// Takes events from the control pipe until `stop` is true.
    fn answer_requests(&self, stop: &AtomicBool) -> Result<(), Errno> {
        let control = &self.chip.control;
        let look = Timespec::try_from(LOOK).ok();
        while !stop.load(Ordering::Relaxed) {
            let ready = match poll(&mut [PollFd::new(control, PollFlags::IN)], look.as_ref()) {
                Ok(ready) => ready > 0,
                Err(Errno::INTR) => false,
                Err(error) => return Err(error),
            };
            if !ready {
                let now_ns = self.now_ns();
                self.device().receive(&[], now_ns);
                continue;
            }
            let mut event = [0; EVENT];
            match rustix::io::read(control, &mut event) {
                // The host did not wait for the answer to its last request.
                Err(Errno::AGAIN | Errno::INTR | Errno::IDRM) => continue,
                Err(error) => return Err(error),
                Ok(_) => {}
            }
            match Event::of(&event) {
                Event::Enabled => self.change(|state| state.enabled = true),
                Event::Disabled | Event::Unbound => self.change(|state| state.enabled = false),
                Event::Request(request) => self.answer_request(request),
                Event::Bound | Event::Other => {}
            }
        }
        Ok(())
    }

    fn answer_request(&self, request: HostRequest) {
        let now_ns = self.now_ns();
        let answer = answer(&mut self.device(), request, now_ns);
        if answer == Answer::Purged {
            self.drop_packet();
        }
        self.change(|_| {});
        let control = &self.chip.control;
        // A host may have given up a request, so errors of an answer have no meaning. The call for the other direction
        // is a refusal.
        let _ = match (answer, request.is_to_host()) {
            (Answer::Taken | Answer::Purged, false) | (Answer::Refused, true) => {
                rustix::io::read(control, &mut [0; 0])
            }
            (Answer::Bytes(bytes, count), true) => {
                let count = count.min(usize::from(request.length));
                rustix::io::write(control, bytes.get(..count).unwrap_or_default())
            }
            _ => rustix::io::write(control, &[]),
        };
    }

    /// Drops the packet that waits for the host.
    fn drop_packet(&self) {
        self.change(|state| state.purges += 1);
        while !self.ends() {
            let state = self.state();
            let Some(thread) = state.sending else { return };
            // The thread may be just before its system call. A signal has no effect there, so it is sent again.
            interrupt::send(thread);
            self.wait(state, AGAIN);
        }
    }

    /// Passes bytes from the host to the device.
    fn take_bytes(&self) {
        while !self.ends() {
            let mut bytes = [0; PACKET];
            match rustix::io::read(&self.chip.from_host, &mut bytes) {
                Ok(count) => {
                    let now_ns = self.now_ns();
                    let bytes = bytes.get(..count).unwrap_or(&bytes);
                    self.device().receive(bytes, now_ns);
                    self.change(|state| state.served.received += 1);
                }
                Err(Errno::INTR) => {}
                Err(_) => self.refused(),
            }
        }
    }

    /// Passes packets of the chip to the host.
    fn send_packets(&self) {
        let thread = gettid();
        while !self.ends() {
            let state = self.state();
            if !state.enabled {
                self.wait(state, LOOK);
                continue;
            }
            let before = *state;
            drop(state);
            let mut packet = [0; PACKET];
            let now_ns = self.now_ns();
            let (count, due_ns) = {
                let mut device = self.device();
                (device.send(now_ns, &mut packet), device.falcon().due_ns())
            };
            let mut state = self.state();
            let Some(count) = count else {
                if state.news == before.news {
                    self.wait(state, Duration::from_nanos(due_ns.saturating_sub(now_ns)));
                }
                continue;
            };
            if state.purges != before.purges {
                continue;
            }
            state.sending = Some(thread);
            drop(state);
            let packet = packet.get(..count).unwrap_or(&packet);
            let result = rustix::io::write(&self.chip.to_host, packet);
            self.change(|state| {
                state.sending = None;
                match result {
                    Ok(_) => state.served.sent += 1,
                    Err(_) => state.served.refused += 1,
                }
            });
            if !matches!(result, Ok(_) | Err(Errno::INTR)) {
                self.refused();
            }
        }
    }

    /// Waits after a refusal: the host is gone, or has not come.
    fn refused(&self) {
        if !self.ends() {
            sleep(REFUSED);
        }
    }
}

/// A signal whose only effect is to end the system call of a thread.
#[allow(unsafe_code)]
mod interrupt {
    use rustix::io::Errno;
    use rustix::process::getpid;
    use rustix::thread::Pid;

    const SIGNAL: libc::c_int = libc::SIGUSR1;

    extern "C" fn nothing(_: libc::c_int) {}

    /// Installs the handler of the signal.
    pub(super) fn prepare() -> Result<(), Errno> {
        let handler = nothing as extern "C" fn(libc::c_int);
        // SAFETY: the handler is a function of the type that the call takes. It does nothing, so it is safe in any thread
        // at any time.
        let before = unsafe { libc::signal(SIGNAL, handler as libc::sighandler_t) };
        if before == libc::SIG_ERR {
            let number = io_error();
            return Err(Errno::from_raw_os_error(number));
        }
        Ok(())
    }

    fn io_error() -> i32 {
        let error = std::io::Error::last_os_error();
        error.raw_os_error().unwrap_or(libc::EINVAL)
    }

    /// Sends the signal to a thread of this process. A thread that has ended gets none.
    pub(super) fn send(thread: Pid) {
        let (process, thread) = (
            getpid().as_raw_nonzero().get(),
            thread.as_raw_nonzero().get(),
        );
        // SAFETY: the call takes three numbers and touches no memory of this process. The signal has a handler, which
        // `prepare` has installed before any thread was started.
        let _ = unsafe { libc::syscall(libc::SYS_tgkill, process, thread, SIGNAL) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_ends_a_system_call_of_one_thread() {
        interrupt::prepare().expect("a signal");
        let (reader, writer) = io::pipe().expect("a pipe");
        let (tell, told) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            tell.send(gettid()).expect("the test waits");
            // No byte comes from the pipe. After a signal, the system restarts `read`, and does not restart `poll`.
            poll(&mut [PollFd::new(&reader, PollFlags::IN)], None)
        });
        let number = told.recv().expect("it tells");
        while !thread.is_finished() {
            interrupt::send(number);
            sleep(AGAIN);
        }
        assert_eq!(thread.join().expect("no panic"), Err(Errno::INTR));
        drop(writer);
        // A thread that has ended gets no signal, and nothing else happens.
        interrupt::send(number);
    }
}
