//! The operator of a run under the real clock: what arms and stops the devices, and lets simulated hands take hold.
//!
//! SIGUSR1 stops the force of all devices, SIGUSR2 arms them, and SIGURG lets simulated hands take hold or let go. In a terminal,
//! Enter stops the force, the word `arm` with Enter arms the devices, and `take` takes hold; in a display of the run (`--view`),
//! Enter or space stops the force, `a` arms, and `t` takes hold. The handlers of the signals set values that the tick reads, so that an order acts within one tick, whatever the other threads do.
//!
//! A thread reads the terminal for as long as there is one: after bytes that are no text, after Ctrl-D, after the display has
//! ended, and again when the run comes back from the background. A lost terminal ends the run ([`super::signals`]).

use super::CommandError;
use super::signals::{ORDERS, TAKE_ORDER, is_lost};
use devices::panel::Panel;
use host::scene::Scene;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use signal_hook::flag;
use std::io::{self, IsTerminal};
use std::os::fd::AsFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time after which the terminal is looked at again if it cannot be read now.
const PAUSE: Duration = Duration::from_millis(50);
/// Largest length of a line (bytes). A longer line counts as a line of its own.
const LONGEST: usize = 4096;

/// Who reads the terminal: the thread of the operator, or the display of the run while it has the terminal.
#[derive(Clone, Debug, Default)]
pub(super) struct Keyboard(Arc<Mutex<bool>>);

impl Keyboard {
    /// Gives the terminal to the display, or takes it back. The operator's thread does not read meanwhile.
    #[cfg(feature = "view")]
    pub(super) fn give_to_display(&self, given: bool) {
        *self.lock() = given;
    }

    /// Whether the display has the terminal. Nobody begins to read while the guard lives.
    fn lock(&self) -> MutexGuard<'_, bool> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Installs the handlers of the orders to the `panel`, before the scene is built and the devices are opened. If there is
/// a terminal, a thread reads the operator's lines. Returns who reads the terminal.
///
/// # Errors
/// [`CommandError::Signals`] if the system refuses a handler or the thread.
pub(super) fn begin(panel: &Panel) -> Result<Keyboard, CommandError> {
    install(panel).map_err(CommandError::Signals)
}

fn install(panel: &Panel) -> io::Result<Keyboard> {
    let [stop_order, arm_order] = ORDERS;
    let (stopped, arms) = panel.for_handlers();
    flag::register_usize(stop_order, Arc::clone(&stopped), 1)?;
    flag::register_usize(arm_order, stopped, 0)?;
    flag::register(arm_order, arms)?;
    flag::register(TAKE_ORDER, panel.for_take())?;
    let keyboard = Keyboard::default();
    if io::stdin().is_terminal() {
        let (panel, keyboard) = (panel.clone(), keyboard.clone());
        // The thread ends with its terminal, or with the program.
        std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("operator".into())
            .spawn(move || follow(&io::stdin(), &panel, &keyboard))?;
    }
    Ok(keyboard)
}

/// The result of a look at the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Found {
    /// This many bytes. Ctrl-D alone gives none.
    Bytes(usize),
    /// Nothing that can be read now: another program has the terminal, or the display.
    Nothing,
    /// The terminal is lost.
    Lost,
}

/// Obeys each line of the terminal until the terminal is lost.
fn follow(terminal: &impl AsFd, panel: &Panel, keyboard: &Keyboard) {
    let mut lines = Lines::default();
    let mut bytes = [0; 256];
    loop {
        match look(terminal, keyboard, &mut bytes) {
            Found::Bytes(count) => {
                for &byte in bytes.get(..count).unwrap_or_default() {
                    if let Some(line) = lines.take(byte) {
                        obey(&line, panel);
                    }
                }
            }
            Found::Nothing => std::thread::sleep(PAUSE),
            Found::Lost => return,
        }
    }
}

/// Waits until the terminal has something, and reads it unless the display has the terminal.
fn look(terminal: &impl AsFd, keyboard: &Keyboard, bytes: &mut [u8]) -> Found {
    match events(terminal, None) {
        Ok(events) if is_lost(events) => return Found::Lost,
        Ok(_) => {}
        Err(Errno::INTR) => return Found::Nothing,
        Err(_) => return Found::Lost,
    }
    let with_display = keyboard.lock();
    // The display may have read meanwhile what there was, and a read must not wait for more.
    let now = Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    if *with_display || !events(terminal, Some(&now)).is_ok_and(|is| is.contains(PollFlags::IN)) {
        return Found::Nothing;
    }
    match rustix::io::read(terminal, bytes) {
        Ok(count) => Found::Bytes(count),
        // EIO: the run is in the background. A lost terminal shows in the next look.
        Err(_) => Found::Nothing,
    }
}

/// Waits for input of the terminal, or for its loss.
fn events(terminal: &impl AsFd, wait: Option<&Timespec>) -> rustix::io::Result<PollFlags> {
    let mut polled = [PollFd::new(terminal, PollFlags::IN)];
    poll(&mut polled, wait)?;
    Ok(polled[0].revents())
}

/// Puts the bytes of a terminal together to lines.
#[derive(Debug, Default)]
struct Lines(Vec<u8>);

impl Lines {
    /// Takes a byte. Returns the line that the byte ends. A terminal that another program left in raw mode ends its lines by
    /// a carriage return.
    fn take(&mut self, byte: u8) -> Option<String> {
        let ends = matches!(byte, b'\n' | b'\r');
        if !ends {
            self.0.push(byte);
        }
        (ends || self.0.len() >= LONGEST).then(|| {
            let line = String::from_utf8_lossy(&self.0).into_owned();
            self.0.clear();
            line
        })
    }
}

/// What an order to take does.
const TAKEN: &str = "the simulated hands press their take_button, or release it";

/// Obeys a line, and says so. The tick takes the order within a period, once the run ticks.
fn obey(line: &str, panel: &Panel) {
    match line.trim() {
        "" => {
            panel.stop();
            errln!("stopped: no device renders force; type \"arm\" and Enter to arm them");
        }
        "arm" => {
            panel.arm();
            errln!("armed: all devices that can be; Enter stops their forces");
        }
        "take" => {
            panel.take();
            errln!("{TAKEN}");
        }
        other => {
            // A person who types in a hurry wants the force to end.
            panel.stop();
            errln!("stopped: found {other:?}, allowed: \"arm\", \"take\", an empty line to stop");
        }
    }
}

/// Passes the orders of a display on to the run in the process `run`.
#[cfg(feature = "view")]
pub(super) fn by_signals(run: u32) -> view::terminal::Operate {
    use rustix::process::{Pid, Signal, getppid, kill_process};
    use view::terminal::keys::Order;
    let run = i32::try_from(run).ok().and_then(Pid::from_raw);
    Box::new(move |order| {
        // The number of a run that has ended may belong to another process, which is not the parent of this one.
        let Some(run) = run.filter(|run| getppid() == Some(*run)) else {
            return "the run has ended".to_owned();
        };
        let (signal, done) = match order {
            Order::Stop => (
                Signal::USR1,
                "STOPPED: no device renders force; a arms them",
            ),
            Order::Arm => (Signal::USR2, "the devices are armed; Enter stops them"),
            Order::Take => (Signal::URG, TAKEN),
        };
        match kill_process(run, signal) {
            Ok(()) => done.to_owned(),
            Err(error) => format!("the order did not reach the run: {error}"),
        }
    })
}

/// The effect of a line of the operator.
#[cfg(feature = "view")]
pub(super) const LINES: &str =
    "Enter stops the force of all devices, and \"arm\" with Enter arms them";

/// How to arm the devices of a `scene` that wait for it; `None` if none waits. `real` tells whether the run follows the
/// real clock, and `lines` whether lines of the terminal are read: the display of a run reads keys.
pub(super) fn waiting(scene: &Scene, real: bool, lines: bool) -> Option<String> {
    let devices = scene.devices.iter();
    let waiting: Vec<_> = devices
        .filter(|device| !device.is_armed_at_start())
        .map(|device| match device.engage.arm_button {
            Some(button) => format!("{} (or press its button {button})", device.name),
            None => device.name.clone(),
        })
        .collect();
    if waiting.is_empty() {
        return None;
    }
    let how = if !real {
        "give --order arm@TIME, or --armed"
    } else if !lines && io::stdin().is_terminal() {
        "press a in the display, or send SIGUSR2; Enter, or SIGUSR1, stops the force of all devices"
    } else if io::stdin().is_terminal() {
        "type \"arm\" and Enter, or send SIGUSR2; Enter alone, or SIGUSR1, stops the force of all devices"
    } else {
        "send SIGUSR2; SIGUSR1 stops the force of all devices"
    };
    Some(format!(
        "waiting to be armed: {}: {how}",
        waiting.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use devices::panel::Operated;
    use devices::scripted::{Scripted, small};
    use rt_core::engage::{ARM_ORDER, STOP_ORDER};
    use rt_core::{Device, DeviceState, Freedom};

    /// The buttons of a device after these bytes of a terminal.
    fn after(bytes: &[u8]) -> u32 {
        let panel = Panel::default();
        let mut lines = Lines::default();
        for &byte in bytes {
            if let Some(line) = lines.take(byte) {
                obey(&line, &panel);
            }
        }
        let rest = Scripted::new(
            small(Freedom::Three),
            |_| Ok(DeviceState::resting()),
            |_, _| Ok(()),
        );
        let mut device = Operated::new(Box::new(rest), panel, &[]);
        device.read(0).expect("a state").buttons
    }

    #[test]
    fn every_line_but_the_words_of_other_orders_stops() {
        let both = ARM_ORDER | STOP_ORDER;
        for (bytes, expected) in [
            (&b"arm\n"[..], ARM_ORDER),
            (b"arm\n\n", both),
            (b"arm\nstop!\n", both),
            (b"\narm\n", ARM_ORDER),
            // Two orders to arm before a tick are one.
            (b"\narm\narm\n", ARM_ORDER),
            // A line that is not ended yet.
            (b"arm\narm", ARM_ORDER),
            // Bytes that are no UTF-8, alone, before a line, and beside the word.
            (b"arm\n\xe9\n", both),
            (b"\xe9\narm\n", ARM_ORDER),
            (b"arm\n\xff\xfe\n\n", both),
            (b"arm\narm\xff\n", both),
            (b"arm\n\0\n", both),
            // An order to take is neither to arm nor to stop.
            (b"take\n", 0),
            (b"arm\ntake\n", ARM_ORDER),
            // A terminal in raw mode.
            (b"arm\r\r", both),
        ] {
            assert_eq!(after(bytes), expected, "{bytes:?}");
        }
    }

    #[test]
    fn bytes_without_end_stop_and_take_no_memory_without_end() {
        let mut lines = Lines::default();
        let ended = (0..10 * LONGEST).filter_map(|_| lines.take(b'x')).count();
        assert_eq!(ended, 10);
        assert!(lines.0.capacity() <= 2 * LONGEST);
    }
}
