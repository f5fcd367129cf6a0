//! A thread that writes to one device, so that the tick does not.
//!
//! Writing a HID report may take as long as the device likes (the kernel waits for it, up to five seconds).
//! The tick puts its command into a small ring and wakes this thread, which writes the newest command that
//! waits. The tick's part is a copy and, only where the thread sleeps, one futex wake-up: the single named
//! wake-up that a tick may make. It never waits.

use rt_core::DeviceError;
use rtrb::Producer;
use runner::ring::{prefaulted, take_newest};
use runner::schedule::realtime;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::thread::{JoinHandle, park};

/// Commands that may wait. A healthy device is never behind by more than one or two.
const SLOTS: usize = 4;

/// Priority of the thread under SCHED_FIFO, where allowed: above everything ordinary, below the tick. A
/// refusal is not reported; the tick, which asks for more, reports it.
const PRIORITY: u8 = 45;

/// The tick's end of the writing thread. Dropping it writes a last command and waits for the thread to
/// end, which takes as long as the device takes; never drop it inside the tick.
#[derive(Debug)]
pub(super) struct Writer<T> {
    ring: Option<Producer<T>>,
    thread: Option<JoinHandle<()>>,
    /// The system's error number of the last write; zero where it went well.
    failure: Arc<AtomicI32>,
}

impl<T: Copy + Send + 'static> Writer<T> {
    /// Starts the thread. `write` sends one command or gives the system's error number; `last` is what it
    /// sends at the end, whatever else waits.
    pub(super) fn start(
        mut write: impl FnMut(&T) -> Result<(), i32> + Send + 'static,
        last: T,
    ) -> std::io::Result<Self> {
        let (producer, mut ring, _) = prefaulted(SLOTS, last);
        let failure = Arc::new(AtomicI32::new(0));
        let told = Arc::clone(&failure);
        let work = move || {
            let _ = realtime(PRIORITY);
            loop {
                // Asked first: what was put in before the end is still found below.
                let over = ring.is_abandoned();
                // Out of the ring before it is written, so that its slot is free while the device dawdles.
                let command = match take_newest(&mut ring, |command, _| *command) {
                    None if over => last,
                    None => {
                        // A wake-up that came since the look into the ring makes this return at once.
                        park();
                        continue;
                    }
                    Some(command) => command,
                };
                let result = write(&command);
                told.store(result.err().unwrap_or(0), Ordering::Relaxed);
                if over {
                    let _ = write(&last);
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("palpate-write".into())
            .spawn(work)?;
        Ok(Self {
            ring: Some(producer),
            thread: Some(thread),
            failure,
        })
    }

    /// Hands a command to the thread. For the hot path.
    ///
    /// # Errors
    /// [`DeviceError::Busy`] where the device has not taken the last ones yet; the command is dropped.
    /// [`DeviceError::Disconnected`] where the last write before this failed; the command is tried all
    /// the same.
    pub(super) fn hand_on(&mut self, command: T) -> Result<(), DeviceError> {
        let (Some(ring), Some(thread)) = (&mut self.ring, &self.thread) else {
            return Err(DeviceError::Busy);
        };
        let failure = self.failure.load(Ordering::Relaxed);
        ring.push(command).map_err(|_| DeviceError::Busy)?;
        thread.thread().unpark();
        match failure {
            0 => Ok(()),
            number => Err(DeviceError::Disconnected(number)),
        }
    }
}

impl<T> Drop for Writer<T> {
    fn drop(&mut self) {
        self.ring = None;
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A writer that panicked has nothing left to write.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{channel, sync_channel};

    #[test]
    fn a_stuck_device_makes_the_tick_busy_and_then_gets_the_newest() {
        let (written, seen) = channel();
        let (free, stuck) = sync_channel::<()>(0);
        let write = move |command: &u32| {
            written.send(*command).map_err(|_| 1)?;
            // Stuck until freed; free for good once the other side is gone.
            let _ = stuck.recv();
            Ok(())
        };
        let mut writer = Writer::start(write, 0).expect("a thread");
        assert_eq!(writer.hand_on(1), Ok(()));
        assert_eq!(seen.recv(), Ok(1));
        // The device holds the first; four may wait, and the tick gets every answer at once.
        for command in 2..=5 {
            assert_eq!(writer.hand_on(command), Ok(()));
        }
        assert_eq!(writer.hand_on(6), Err(DeviceError::Busy));
        assert!(free.send(()).is_ok());
        assert_eq!(seen.recv(), Ok(5));
        drop(free);
        drop(writer);
        // The last word is no force.
        assert_eq!(seen.iter().last(), Some(0));
    }

    #[test]
    fn a_failed_write_is_told_with_the_next_command() {
        let (written, seen) = channel();
        let write = move |command: &u32| {
            let _ = written.send(*command);
            if *command == 1 { Err(19) } else { Ok(()) }
        };
        let mut writer = Writer::start(write, 0).expect("a thread");
        assert_eq!(writer.hand_on(1), Ok(()));
        assert_eq!(seen.recv(), Ok(1));
        // The answer is stored after the write; ask until it is there.
        while writer.hand_on(1) != Err(DeviceError::Disconnected(19)) {
            std::thread::yield_now();
        }
        while writer.hand_on(2) != Ok(()) {
            std::thread::yield_now();
        }
    }
}
