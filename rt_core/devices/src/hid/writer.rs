//! A thread that writes to one device in place of the tick.
//!
//! A write of a HID report takes as long as the device needs: the kernel waits for the device, for up to five seconds.
//! The tick pushes its command into a small ring and wakes this thread, which writes the newest command in the ring.
//! The cost for the tick is a copy and, only where the thread sleeps, one futex wake-up: the single named wake-up that
//! a tick may make. The tick never waits.

use rt_core::DeviceError;
use rtrb::Producer;
use runner::ring::{prefaulted, take_newest};
use runner::schedule::realtime;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::thread::{JoinHandle, park};

/// Number of commands that may wait. A healthy device is never behind by more than one or two.
const SLOTS: usize = 4;

/// Priority of the thread under SCHED_FIFO, where allowed: above ordinary threads, below the tick. A refusal is not
/// reported here, because the tick requests a higher priority and reports its own refusal.
const PRIORITY: u8 = 45;

/// The tick's end of the writing thread. Dropping it writes a last command and waits for the end of the thread, for as
/// long as the device needs. It must not be dropped inside the tick.
#[derive(Debug)]
pub(super) struct Writer<T> {
    ring: Option<Producer<T>>,
    thread: Option<JoinHandle<()>>,
    /// The system's error number of the last write; zero if the write succeeded.
    failure: Arc<AtomicI32>,
}

impl<T: Copy + Send + 'static> Writer<T> {
    /// Starts the thread. `write` sends one command, or returns the system's error number. The thread sends `last` as
    /// its last command, whatever other commands wait.
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
                // This is read first, so that the commands pushed before the end are still found below.
                let over = ring.is_abandoned();
                // The command is removed from the ring before it is written, so its slot is free during the write.
                let command = match take_newest(&mut ring, |command, _| *command) {
                    None if over => last,
                    None => {
                        // If a wake-up came after the ring was read, this call returns at once.
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

    /// Passes a command to the thread. For the hot path.
    ///
    /// # Errors
    /// [`DeviceError::Busy`] where the ring is full, because the device has not taken the last commands yet; the
    /// command is dropped. [`DeviceError::Disconnected`] where the previous write failed; the command is sent
    /// nevertheless.
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
            // The device is stuck until it is freed. It is never stuck again once the other side is gone.
            let _ = stuck.recv();
            Ok(())
        };
        let mut writer = Writer::start(write, 0).expect("a thread");
        assert_eq!(writer.hand_on(1), Ok(()));
        assert_eq!(seen.recv(), Ok(1));
        // The device holds the first command. Four commands may wait, and every call returns at once.
        for command in 2..=5 {
            assert_eq!(writer.hand_on(command), Ok(()));
        }
        assert_eq!(writer.hand_on(6), Err(DeviceError::Busy));
        assert!(free.send(()).is_ok());
        assert_eq!(seen.recv(), Ok(5));
        drop(free);
        drop(writer);
        // The last command is zero force.
        assert_eq!(seen.iter().last(), Some(0));
    }

    #[test]
    fn a_failed_write_is_reported_with_the_next_command() {
        let (written, seen) = channel();
        let write = move |command: &u32| {
            let _ = written.send(*command);
            if *command == 1 { Err(19) } else { Ok(()) }
        };
        let mut writer = Writer::start(write, 0).expect("a thread");
        assert_eq!(writer.hand_on(1), Ok(()));
        assert_eq!(seen.recv(), Ok(1));
        // The result is stored after the write, so the loop repeats until it is visible.
        while writer.hand_on(1) != Err(DeviceError::Disconnected(19)) {
            std::thread::yield_now();
        }
        while writer.hand_on(2) != Ok(()) {
            std::thread::yield_now();
        }
    }
}
