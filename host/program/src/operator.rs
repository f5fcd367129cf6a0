//! The operator of a run under the real clock: what arms and stops the devices.
//!
//! SIGUSR1 stops the force of all devices, and SIGUSR2 arms them. In a terminal, Enter stops the force, and the word `arm`
//! with Enter arms the devices; in a display of the run (`--view`), Enter or space stops the force, and `a` arms. The handler of SIGUSR1 sets the flag that the tick reads, so that the force ends within one
//! tick, whatever the other threads do.

use devices::panel::Panel;
use host::scene::Scene;
use signal_hook::consts::{SIGUSR1, SIGUSR2};
use signal_hook::flag;
use std::io::{self, BufRead, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The operator's means during a run.
pub(super) struct Operator {
    panel: Panel,
    /// Whether SIGUSR2 has arrived.
    arm: Arc<AtomicBool>,
}

impl Operator {
    /// Installs the handlers. With `lines`, a thread reads the operator's lines from the terminal.
    pub(super) fn begin(panel: &Panel, lines: bool) -> io::Result<Self> {
        flag::register(SIGUSR1, panel.stop_flag())?;
        let arm = Arc::new(AtomicBool::new(false));
        flag::register(SIGUSR2, Arc::clone(&arm))?;
        if lines && io::stdin().is_terminal() {
            let panel = panel.clone();
            // The thread ends with the program: nothing else ends a read from a terminal.
            std::thread::Builder::new()
                .name("operator".into())
                .spawn(move || read_lines(io::stdin().lock(), &panel))?;
        }
        let panel = panel.clone();
        Ok(Self { panel, arm })
    }

    /// Passes an order to arm on to the devices. Called from time to time.
    pub(super) fn look(&self) {
        if self.arm.swap(false, Ordering::Relaxed) {
            self.panel.arm();
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
        };
        match kill_process(run, signal) {
            Ok(()) => done.to_owned(),
            Err(error) => format!("the order did not reach the run: {error}"),
        }
    })
}

/// Obeys each line until the end of the input.
fn read_lines(input: impl BufRead, panel: &Panel) {
    for line in input.lines().map_while(Result::ok) {
        match line.trim() {
            "" => panel.stop(),
            "arm" => panel.arm(),
            other => {
                // A person who types in a hurry wants the force to end.
                panel.stop();
                errln!("stopped: found {other:?}, allowed: \"arm\" to arm, an empty line to stop");
            }
        }
    }
}

/// How to arm the devices of a `scene` that wait for it; `None` where none waits. `real` tells whether the run follows the
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

    #[test]
    fn every_line_but_the_word_arm_stops() {
        for (lines, expected) in [
            ("arm\n", ARM_ORDER),
            ("arm\n\n", ARM_ORDER | STOP_ORDER),
            ("arm\nstop!\n", ARM_ORDER | STOP_ORDER),
            ("\narm\n", ARM_ORDER),
            ("\narm\narm", 0),
        ] {
            let panel = Panel::default();
            read_lines(lines.as_bytes(), &panel);
            let rest = Scripted::new(
                small(Freedom::Three),
                |_| Ok(DeviceState::resting()),
                |_, _| Ok(()),
            );
            let mut device = Operated::new(Box::new(rest), panel, &[]);
            assert_eq!(
                device.read(0).expect("a state").buttons,
                expected,
                "{lines:?}"
            );
        }
    }
}
