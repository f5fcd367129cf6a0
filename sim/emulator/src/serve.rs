//! Passes bytes between an emulator and a transport, in real time.

use devices::Transport;
use sim::emulate::Emulator;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Length of the buffer for bytes from the host: a HID report of 64 bytes with its number, or a part of a stream.
const BUFFER: usize = 256;

/// Counts of the passed bytes and reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Served {
    /// Times that bytes came from the host.
    pub received: u64,
    /// Reports or packets that the emulator sent.
    pub sent: u64,
    /// Reports or packets that the transport did not take.
    pub refused: u64,
}

/// Runs an emulator until `stop` is true or the transport ends. The emulator's time starts at zero. The server asks the
/// emulator for bytes after each arrival, and once every `period` at least.
///
/// # Errors
/// The error number with which the transport ended, with the counts so far in `served`.
pub fn serve(
    emulator: &mut (impl Emulator + ?Sized),
    transport: &mut (impl Transport + ?Sized),
    period: Duration,
    stop: &AtomicBool,
    served: &mut Served,
) -> Result<(), i32> {
    let start = Instant::now();
    let now = || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    let mut due = period;
    while !stop.load(Ordering::Relaxed) {
        let wait = due.saturating_sub(start.elapsed());
        let mut buffer = [0; BUFFER];
        let count = transport.read(&mut buffer, wait)?;
        if count > 0 {
            served.received += 1;
            emulator.receive(buffer.get(..count).unwrap_or(&buffer), now());
        }
        let elapsed = start.elapsed();
        if elapsed >= due {
            // A process that was stopped does not catch up.
            due = (due + period).max(elapsed);
        }
        let mut report = [0; 64];
        while let Some(length) = emulator.send(now(), &mut report) {
            let bytes = report.get(..length).unwrap_or(&report);
            match transport.write(bytes) {
                Ok(()) => served.sent += 1,
                Err(_) => served.refused += 1,
            }
        }
    }
    Ok(())
}
