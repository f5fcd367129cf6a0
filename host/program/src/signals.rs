//! SIGINT (Ctrl-C) and SIGTERM end a run in order: the force becomes zero, the log is finished, the summary is
//! printed.
//!
//! The handler sets the flag of the loop, so that the force becomes zero within one tick. A second signal ends the
//! program at once; the watchdog of the device then removes the force.

use runner::Stop;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The signal that the program received, if any.
pub(super) struct Signal(Arc<AtomicUsize>);

impl Signal {
    /// The number of the signal.
    pub(super) fn number(&self) -> Option<u8> {
        let number = self.0.load(Ordering::SeqCst);
        u8::try_from(number).ok().filter(|number| *number > 0)
    }
}

/// Installs the handlers: the first SIGINT or SIGTERM sets `stop`, and the second ends the program.
pub(super) fn end_in_order(stop: &Stop) -> io::Result<Signal> {
    let received = Arc::new(AtomicUsize::new(0));
    for signal in [SIGINT, SIGTERM] {
        // Handlers run in this order, so the first signal does not find the flag set.
        flag::register_conditional_shutdown(signal, 128 + signal, stop.flag())?;
        flag::register_usize(signal, Arc::clone(&received), signal as usize)?;
        flag::register(signal, stop.flag())?;
    }
    Ok(Signal(received))
}
