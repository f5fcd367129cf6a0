//! A thread that writes to one device in place of the tick.
//!
//! A write of a HID report takes as long as the device needs: the kernel waits for the device, for up to five seconds.
//! The tick pushes its command into a small ring and wakes this thread, which writes the newest command in the ring.
//! The cost for the tick is a copy and, only if the thread sleeps, one futex wake-up: the single named wake-up that
//! a tick may make. The tick never waits.
//!
//! The thread also opens a lost device again. The tick first gives its reading end back through a ring, because closing a
//! file is a system call that the tick does not make. The thread closes both ends of the lost device before it looks for
//! the device: the kernel gives the name of a file to a new device only if no program has the old file open. The new
//! reading end passes to the tick through another ring.

use super::writing::{Step, Writing};
use rt_core::DeviceError;
use rtrb::{Consumer, Producer, PushError, RingBuffer};
use runner::ring::{prefaulted, take_newest};
use runner::schedule::realtime;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::thread::{JoinHandle, park, park_timeout};
use std::time::{Duration, Instant};

/// Number of commands that may wait. A healthy device is never behind by more than one or two.
const SLOTS: usize = 4;

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
    /// its last command, whatever other commands wait. `open` opens a lost device again. The thread takes `priority` under
    /// SCHED_FIFO, if allowed; the tick reports the refusal of its own priority.
    pub(super) fn start(
        write: Write<T>,
        last: T,
        mut open: Open<T, R>,
        priority: u8,
    ) -> std::io::Result<Self> {
        let (producer, mut ring, _) = prefaulted(SLOTS, last);
        let (mut found, fresh) = RingBuffer::new(ENDS);
        let (old, mut closed) = RingBuffer::new(ENDS);
        let failure = Arc::new(AtomicI32::new(0));
        let told = Arc::clone(&failure);
        let lost = Arc::new(AtomicBool::new(false));
        let missing = Arc::clone(&lost);
        let work = move || {
            let _ = realtime(priority);
            let start = Instant::now();
            let now_ns = || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
            let mut writing = Writing::default();
            // None while the device is lost.
            let mut write = Some(write);
            loop {
                // This is read first, so that the commands pushed before the end are still found below.
                let over = ring.is_abandoned();
                // Commands that the tick pushed before the loss are found in the same turn as the loss.
                let lost = missing.load(Ordering::Acquire);
                // The command is removed from the ring before it is written, so its slot is free during the write.
                let newest = take_newest(&mut ring, |command, _| *command);
                if over {
                    for command in [newest.unwrap_or(last), last] {
                        let _ = write.as_mut().map(|write| write(&command));
                    }
                    return;
                }
                match writing.next(now_ns(), lost, newest) {
                    Step::Write(command) => {
                        if let Some(write) = &mut write {
                            let result = write(&command);
                            told.store(result.err().unwrap_or(0), Ordering::Relaxed);
                        }
                    }
                    // If a wake-up came after the ring was read, the call returns at once.
                    Step::Wait(None) => park(),
                    Step::Wait(Some(until_ns)) => {
                        park_timeout(Duration::from_nanos(until_ns.saturating_sub(now_ns())));
                    }
                    Step::Reopen => {
                        // The tick gave its end back before it asked.
                        while closed.pop().is_ok() {}
                        write = None;
                        let ends = open();
                        writing.reopened(now_ns(), ends.is_ok());
                        let Ok((reading, end)) = ends else { continue };
                        write = Some(end);
                        told.store(0, Ordering::Relaxed);
                        missing.store(false, Ordering::Release);
                        // The tick has no end that waits: it lost the device before it asked.
                        let _ = found.push(reading);
                    }
                }
            }
        };
        let thread = std::thread::Builder::new()
            .stack_size(runner::STACK)
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

    /// Gives the reading end of a lost device back, and asks the thread to open the device again. For the hot path.
    pub(super) fn lose(&mut self, reading: &mut Option<R>) {
        // There is room: the thread has closed the end before.
        if let Some(Err(PushError::Full(end))) = reading.take().map(|end| self.old.push(end)) {
            *reading = Some(end);
        }
        self.lost.store(true, Ordering::Release);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }

    /// The new reading end of a lost device, once there is one. For the hot path.
    pub(super) fn found(&mut self) -> Option<R> {
        self.fresh.pop().ok()
    }

    /// Passes a command to the thread. For the hot path.
    ///
    /// # Errors
    /// [`DeviceError::Busy`] if the ring is full, because the device has not taken the last commands yet; the
    /// command is dropped. [`DeviceError::Disconnected`] if the previous write failed; the command is sent
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
    use runner::schedule::DEVICE_PRIORITY;
    use std::sync::mpsc::{channel, sync_channel};

    /// A writer whose device does not come back.
    fn start(
        write: impl FnMut(&u32) -> Result<(), i32> + Send + 'static,
    ) -> std::io::Result<Writer<u32, ()>> {
        Writer::start(Box::new(write), 0, Box::new(|| Err(19)), DEVICE_PRIORITY)
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

    /// Waits for the reading end of a device that is back.
    fn back<R: Send + 'static>(writer: &mut Writer<u32, R>) -> R {
        loop {
            match writer.found() {
                Some(reading) => return reading,
                None => std::thread::yield_now(),
            }
        }
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
        let mut writer = Writer::start(
            Box::new(|_: &u32| Err(19)),
            0,
            Box::new(open),
            DEVICE_PRIORITY,
        )
        .expect("a thread");
        let mut reading = Some(1);
        assert_eq!(writer.found(), None);
        writer.lose(&mut reading);
        assert_eq!(reading, None);
        // The first attempt fails.
        assert!(tell.send(Err(19)).is_ok() && tell.send(Ok(2)).is_ok());
        reading = Some(back(&mut writer));
        assert_eq!(reading, Some(2));
        // The device that is back has refused nothing yet.
        assert_eq!(writer.hand_on(7), Ok(()));
        assert_eq!(seen.recv(), Ok((2, 7)));
        // Lost and found once more.
        writer.lose(&mut reading);
        assert!(tell.send(Ok(3)).is_ok());
        let reading = back(&mut writer);
        drop(writer);
        assert_eq!((reading, seen.iter().last()), (3, Some((3, 0))));
    }

    /// Commands wait while the write of one of them hangs, and the device is lost meanwhile.
    #[test]
    fn a_command_from_before_a_loss_is_not_sent_to_the_device_that_is_back() {
        let (written, seen) = channel();
        let (free, stuck) = sync_channel::<()>(0);
        let again = written.clone();
        let write = move |command: &u32| {
            written.send(("lost", *command)).map_err(|_| 1)?;
            let _ = stuck.recv();
            Err(19)
        };
        let open = move || {
            let written = again.clone();
            let write = move |command: &u32| written.send(("back", *command)).map_err(|_| 1);
            Ok(((), Box::new(write) as Write<u32>))
        };
        let mut writer =
            Writer::start(Box::new(write), 0, Box::new(open), DEVICE_PRIORITY).expect("a thread");
        assert_eq!(writer.hand_on(1), Ok(()));
        assert_eq!(seen.recv(), Ok(("lost", 1)));
        // These wait. Then the device is lost, and the write that hung fails.
        assert_eq!((writer.hand_on(2), writer.hand_on(3)), (Ok(()), Ok(())));
        writer.lose(&mut Some(()));
        drop(free);
        back(&mut writer);
        assert_eq!(writer.hand_on(4), Ok(()));
        assert_eq!(seen.recv(), Ok(("back", 4)));
    }

    /// The kernel gives a device that is plugged in again its old name only if no program has the old file open.
    #[test]
    fn both_ends_of_a_lost_device_are_closed_before_it_is_looked_for() {
        let open_ends = Arc::new(());
        let (near, far) = (Arc::clone(&open_ends), Arc::clone(&open_ends));
        let write = move |_: &u32| {
            std::hint::black_box(&far);
            Ok(())
        };
        let left = Arc::downgrade(&open_ends);
        drop(open_ends);
        let open = move || {
            let count = left.strong_count();
            Ok((
                (Arc::new(()), count),
                Box::new(|_: &u32| Ok(())) as Write<u32>,
            ))
        };
        let mut writer =
            Writer::start(Box::new(write), 0, Box::new(open), DEVICE_PRIORITY).expect("a thread");
        writer.lose(&mut Some((near, usize::MAX)));
        let (_, open_at_the_time) = back(&mut writer);
        assert_eq!(open_at_the_time, 0);
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
