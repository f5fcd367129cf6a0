//! A thread that writes to one device in place of the tick.
//!
//! A write of a HID report takes as long as the device needs: the kernel waits for the device, for up to five seconds.
//! The tick pushes its command into a small ring and wakes this thread, which writes the newest command in the ring.
//! The cost for the tick is a copy and, only where the thread sleeps, one futex wake-up: the single named wake-up that
//! a tick may make. The tick never waits.
//!
//! The thread also opens a lost device again. It passes the new reading end to the tick through a ring, and takes the old
//! one back through another, because closing a file is a system call that the tick does not make.

use rt_core::DeviceError;
use rtrb::{Consumer, Producer, RingBuffer};
use runner::ring::{prefaulted, take_newest};
use runner::schedule::realtime;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::thread::{JoinHandle, park, park_timeout};
use std::time::Duration;

/// Number of commands that may wait. A healthy device is never behind by more than one or two.
const SLOTS: usize = 4;

/// Priority of the thread under SCHED_FIFO, where allowed: above ordinary threads, below the tick. A refusal is not
/// reported here, because the tick requests a higher priority and reports its own refusal.
const PRIORITY: u8 = 45;

/// Time between two attempts to open a lost device again.
const RETRY: Duration = Duration::from_millis(100);
/// Number of reading ends that may wait for the tick, or for the thread.
const ENDS: usize = 2;

/// Writes one command, or returns the error number of the system. May block.
pub(super) type Write<T> = Box<dyn FnMut(&T) -> Result<(), i32> + Send>;
/// Opens a lost device again: its reading end of type `R`, and its writing end.
pub(super) type Open<T, R> = Box<dyn FnMut() -> Result<(R, Write<T>), i32> + Send>;

/// The tick's end of the writing thread. Dropping it writes a last command and waits for the end of the thread, for as
/// long as the device needs. It must not be dropped inside the tick.
#[derive(Debug)]
pub(super) struct Writer<T, R> {
    ring: Option<Producer<T>>,
    thread: Option<JoinHandle<()>>,
    /// The system's error number of the last write; zero if the write succeeded.
    failure: Arc<AtomicI32>,
    /// Whether the tick has lost the device, and waits for another reading end.
    lost: Arc<AtomicBool>,
    /// Reading ends of the device that is open again.
    fresh: Consumer<R>,
    /// Reading ends to be closed.
    old: Producer<R>,
}

impl<T: Copy + Send + 'static, R: Send + 'static> Writer<T, R> {
    /// Starts the thread. `write` sends one command, or returns the system's error number. The thread sends `last` as
    /// its last command, whatever other commands wait. `open` opens a lost device again.
    pub(super) fn start(
        mut write: Write<T>,
        last: T,
        mut open: Open<T, R>,
    ) -> std::io::Result<Self> {
        let (producer, mut ring, _) = prefaulted(SLOTS, last);
        let (mut found, fresh) = RingBuffer::new(ENDS);
        let (old, mut closed) = RingBuffer::new(ENDS);
        let failure = Arc::new(AtomicI32::new(0));
        let told = Arc::clone(&failure);
        let lost = Arc::new(AtomicBool::new(false));
        let missing = Arc::clone(&lost);
        let work = move || {
            let _ = realtime(PRIORITY);
            loop {
                // This is read first, so that the commands pushed before the end are still found below.
                let over = ring.is_abandoned();
                while closed.pop().is_ok() {}
                if missing.load(Ordering::Acquire) && !over {
                    let Ok((reading, writing)) = open() else {
                        park_timeout(RETRY);
                        continue;
                    };
                    write = writing;
                    // Commands from before the loss are not sent.
                    let _ = take_newest(&mut ring, |_, _| ());
                    missing.store(false, Ordering::Release);
                    // The tick has no end that waits: it lost the device before it asked.
                    let _ = found.push(reading);
                }
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
            lost,
            fresh,
            old,
        })
    }

    /// Asks the thread to open the device again. For the hot path.
    pub(super) fn lose(&mut self) {
        self.lost.store(true, Ordering::Release);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }

    /// Takes the new reading end of a lost device in exchange for the old one, once there is one. For the hot path.
    pub(super) fn found(&mut self, reading: &mut R) -> bool {
        let Ok(fresh) = self.fresh.pop() else {
            return false;
        };
        let old = std::mem::replace(reading, fresh);
        // The thread empties the ring before it finds another end, so there is room.
        let _ = self.old.push(old);
        true
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

impl<T, R> Drop for Writer<T, R> {
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

    /// A writer whose device does not come back.
    fn start(
        write: impl FnMut(&u32) -> Result<(), i32> + Send + 'static,
    ) -> std::io::Result<Writer<u32, ()>> {
        Writer::start(Box::new(write), 0, Box::new(|| Err(19)))
    }

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
        let mut writer = start(write).expect("a thread");
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
    fn a_lost_device_comes_back_with_new_ends() {
        let (written, seen) = channel();
        let (tell, told) = channel();
        let open = move || {
            // A test that has ended finds no device.
            let reading: u32 = told.recv().unwrap_or(Err(19))?;
            let written = written.clone();
            let write = move |command: &u32| written.send((reading, *command)).map_err(|_| 1);
            Ok((reading, Box::new(write) as Write<u32>))
        };
        let mut writer =
            Writer::start(Box::new(|_: &u32| Err(19)), 0, Box::new(open)).expect("a thread");
        let mut reading = 1;
        assert!(!writer.found(&mut reading));
        writer.lose();
        // The first attempt fails.
        assert!(tell.send(Err(19)).is_ok() && tell.send(Ok(2)).is_ok());
        while !writer.found(&mut reading) {
            std::thread::yield_now();
        }
        assert_eq!(reading, 2);
        let _ = writer.hand_on(7);
        assert_eq!(seen.recv(), Ok((2, 7)));
        // Lost and found once more.
        writer.lose();
        assert!(tell.send(Ok(3)).is_ok());
        while !writer.found(&mut reading) {
            std::thread::yield_now();
        }
        drop(writer);
        assert_eq!((reading, seen.iter().last()), (3, Some((3, 0))));
    }

    #[test]
    fn a_failed_write_is_reported_with_the_next_command() {
        let (written, seen) = channel();
        let write = move |command: &u32| {
            let _ = written.send(*command);
            if *command == 1 { Err(19) } else { Ok(()) }
        };
        let mut writer = start(write).expect("a thread");
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
