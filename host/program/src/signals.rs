//! Ctrl-C and its kin end a run in order: no force, the log finished, the summary printed.
//!
//! The handler sets the loop's own flag, so that the force is gone within one tick. A second signal ends the
//! program at once: then it is the device's watchdog that lets go of the hand.

use runner::Stop;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The signal that came, if one did.
pub(super) struct Signal(Arc<AtomicUsize>);

impl Signal {
    /// Its number.
    pub(super) fn number(&self) -> Option<u8> {
        let number = self.0.load(Ordering::SeqCst);
        u8::try_from(number).ok().filter(|number| *number > 0)
    }
}

/// From here on the first SIGINT or SIGTERM asks `stop`, and the second ends the program.
pub(super) fn end_in_order(stop: &Stop) -> io::Result<Signal> {
    let came = Arc::new(AtomicUsize::new(0));
    for signal in [SIGINT, SIGTERM] {
        // Handlers run in this order, so the first signal does not find the flag set.
        flag::register_conditional_shutdown(signal, 128 + signal, stop.flag())?;
        flag::register_usize(signal, Arc::clone(&came), signal as usize)?;
        flag::register(signal, stop.flag())?;
    }
    Ok(Signal(came))
}
