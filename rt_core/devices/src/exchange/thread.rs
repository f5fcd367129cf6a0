//! The thread that exchanges with one device.

use super::{Counts, Exchange, Gate, Handed, MotionSource, RETRY, Reply, SLOTS};
use rt_core::DeviceError;
use rtrb::{Consumer, Producer};
use runner::ring::take_newest;
use runner::schedule::realtime;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{JoinHandle, park_timeout};
use std::time::{Duration, Instant};

/// Priority of the thread under SCHED_FIFO, where allowed: above ordinary threads, below the tick. A refusal is not
/// reported here, because the tick requests a higher priority and reports its own refusal.
const PRIORITY: u8 = 45;

/// Number of exchanges whose beginning is remembered: more than can wait for the tick.
const BEGUN: usize = 2 * SLOTS;

/// Starts the thread, which ends after `commands` has lost its writer.
pub(super) fn start(
    exchange: impl Exchange + 'static,
    commands: Consumer<Handed>,
    replies: Producer<Reply>,
    (counts, let_go_ns): (Arc<Counts>, Arc<AtomicU64>),
) -> std::io::Result<JoinHandle<()>> {
    let mut work = Work {
        exchange,
        commands,
        replies,
        counts,
        let_go_ns,
        looked: Instant::now(),
        gate: Gate::default(),
        refused_before: None,
        begun: [(0, Instant::now()); BEGUN],
    };
    std::thread::Builder::new()
        .stack_size(runner::STACK)
        .name("palpate-exchange".into())
        .spawn(move || {
            let _ = realtime(PRIORITY);
            // The device is released even after a panic of its driver. Neither panic may end the process.
            let _ = catch_unwind(AssertUnwindSafe(|| work.run()));
            let _ = catch_unwind(AssertUnwindSafe(|| work.exchange.release()));
        })
}

/// What the thread works with.
struct Work<E> {
    exchange: E,
    commands: Consumer<Handed>,
    replies: Producer<Reply>,
    counts: Arc<Counts>,
    /// Time without a wrench after which the thread commands zero (ns).
    let_go_ns: Arc<AtomicU64>,
    gate: Gate,
    /// Wrenches that the device had refused when the tick began. What it refuses while it idles before is no news.
    refused_before: Option<u64>,
    /// The last exchanges, by number, and when each began.
    begun: [(u64, Instant); BEGUN],
    /// When the thread last looked for a wrench.
    looked: Instant,
}

/// What the thread is to do next.
enum Next {
    /// Command a wrench of the tick.
    Command(Handed),
    /// Command zero: the tick has handed over no wrench.
    LetGo,
    /// End.
    End,
}

impl<E: Exchange> Work<E> {
    /// Exchanges until the end.
    fn run(&mut self) {
        self.looked = Instant::now();
        loop {
            let handed = match self.next() {
                Next::Command(handed) => Some(handed),
                Next::LetGo => None,
                Next::End => break,
            };
            if self.once(handed) {
                continue;
            }
            if !self.back() {
                break;
            }
            // The tick hands over no wrench before it has seen a state.
            self.once(None);
        }
    }

    /// Waits for the newest wrench, for a bounded time.
    fn next(&mut self) -> Next {
        let start = Instant::now();
        loop {
            if self.commands.is_abandoned() {
                return Next::End;
            }
            let let_go = Duration::from_nanos(self.let_go_ns.load(Ordering::Relaxed));
            let away = self.looked.elapsed();
            self.looked = Instant::now();
            // After a longer time between two looks, the process was stopped or the device blocked, and the wrench may be
            // as old. A late wake-up does not count as such a case.
            if let Some(handed) = take_newest(&mut self.commands, |handed, _| *handed)
                && away <= let_go.saturating_mul(2)
            {
                return Next::Command(handed);
            }
            let Some(left) = let_go.checked_sub(start.elapsed()) else {
                Counts::add(&self.counts.let_go);
                return Next::LetGo;
            };
            // If a wake-up came after the ring was read, this call returns at once.
            park_timeout(left);
        }
    }

    /// One exchange, with zero where the tick has handed over no wrench. Returns false where the device is lost.
    fn once(&mut self, handed: Option<Handed>) -> bool {
        let begun = Instant::now();
        let wrench = match handed {
            Some(handed) => self.gate.pass(&handed.wrench, handed.seen),
            None => self.gate.let_go(),
        };
        let number = self.gate.number();
        self.begun[number as usize % BEGUN] = (number, begun);
        let mut answer = self.exchange.exchange(&wrench);
        self.gate.end(&mut answer);
        let answers = handed.map_or(0, |handed| handed.answers);
        let motion_to_force_ns = match self.exchange.motion_to_force() {
            MotionSource::Device(time_ns) => time_ns,
            MotionSource::Thread => {
                let (answered, asked) = self.begun[answers as usize % BEGUN];
                let is_known = answers > 0 && answered == answers;
                let passed = begun.saturating_duration_since(asked).as_nanos();
                is_known.then(|| u64::try_from(passed).unwrap_or(u64::MAX))
            }
        };
        let lost = matches!(answer, Err(DeviceError::Disconnected(_)));
        Counts::add(match answer {
            Ok(_) => &self.counts.states,
            Err(_) if lost => &self.counts.losses,
            Err(_) => &self.counts.failures,
        });
        let refused = self.exchange.refused_wrenches();
        if handed.is_some() && self.refused_before.is_none() {
            self.refused_before = refused;
        }
        let before = self.refused_before;
        let reply = Reply {
            answer,
            number,
            motion_to_force_ns,
            refused_wrenches: refused.map(|count| count.saturating_sub(before.unwrap_or(count))),
        };
        if self.replies.push(reply).is_err() {
            Counts::add(&self.counts.unread);
        }
        !lost
    }

    /// Reopens a lost device. Returns false where the end comes first.
    fn back(&mut self) -> bool {
        loop {
            let start = Instant::now();
            while let Some(left) = RETRY.checked_sub(start.elapsed()) {
                if self.commands.is_abandoned() {
                    return false;
                }
                park_timeout(left);
            }
            if self.exchange.reopen().is_ok() {
                // Wrenches from before the loss are not applied.
                let _ = take_newest(&mut self.commands, |_, _| ());
                Counts::add(&self.counts.returns);
                return true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Single exchanges, without a thread, so that no time of a busy machine matters.

    use super::*;
    use rt_core::{DeviceState, Wrench};
    use runner::ring::prefaulted;

    /// A device that gives the answers of a test, one after the other.
    struct Answers {
        answers: Vec<Result<DeviceState, DeviceError>>,
        refused: Option<u64>,
    }

    impl Exchange for Answers {
        fn exchange(&mut self, _: &Wrench) -> Result<DeviceState, DeviceError> {
            self.answers.pop().unwrap_or(Ok(DeviceState::resting()))
        }
        fn release(&mut self) {}
        fn reopen(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
        fn refused_wrenches(&self) -> Option<u64> {
            self.refused
        }
    }

    fn work(
        answers: &[Result<DeviceState, DeviceError>],
    ) -> (Work<Answers>, Producer<Handed>, Consumer<Reply>) {
        let (hand, commands, _) = prefaulted(SLOTS, Handed::default());
        let (replies, read, _) = prefaulted(SLOTS, Reply::default());
        let work = Work {
            exchange: Answers {
                answers: answers.iter().rev().copied().collect(),
                refused: None,
            },
            commands,
            replies,
            counts: Arc::default(),
            let_go_ns: Arc::default(),
            looked: Instant::now(),
            gate: Gate::default(),
            refused_before: None,
            begun: [(0, Instant::now()); BEGUN],
        };
        (work, hand, read)
    }

    fn answering(answers: u64) -> Handed {
        Handed {
            answers,
            ..Handed::default()
        }
    }

    /// A wrench answers the state of one of the last exchanges. The time of an older exchange is no longer known, and the
    /// time of another exchange is never taken for it.
    #[test]
    fn motion_to_force_is_that_of_the_exchange_that_the_wrench_answers() {
        let (mut work, _hand, mut read) = work(&[]);
        let mut began = vec![Instant::now()];
        for number in 1..=200 {
            let behind = number % 12;
            let answers = u64::saturating_sub(number, behind);
            let earliest = Instant::now();
            assert!(work.once(Some(answering(answers))));
            began.push(earliest);
            let reply = read.pop().expect("a reply");
            assert_eq!(reply.number, number);
            let is_known = answers > 0 && behind > 0 && behind < BEGUN as u64;
            if !is_known && behind > 0 {
                assert_eq!(reply.motion_to_force_ns, None, "{number} answers {answers}");
            }
            if is_known {
                // The exchange that is answered began after the time that was taken before it, and before the next one.
                let shown = Duration::from_nanos(reply.motion_to_force_ns.expect("it is known"));
                let now = Instant::now();
                assert!(
                    shown <= now - began[answers as usize],
                    "{number} answers {answers}"
                );
                assert!(
                    shown >= earliest - began[answers as usize + 1],
                    "{number} answers {answers}"
                );
            }
        }
    }

    #[test]
    fn each_exchange_is_counted_once_as_what_it_is() {
        let silent = Err(DeviceError::NoReport);
        let gone = Err(DeviceError::Disconnected(19));
        let state = Ok(DeviceState::resting());
        let (mut work, _hand, mut read) = work(&[state, silent, silent, state, gone, state]);
        let mut all = || {
            let stays = work.once(None);
            let counts = &work.counts;
            (stays, counts.states(), counts.failures(), counts.losses())
        };
        assert_eq!(
            [all(), all(), all()],
            [(true, 1, 0, 0), (true, 1, 1, 0), (true, 1, 2, 0)]
        );
        assert_eq!([all(), all()], [(true, 2, 2, 0), (false, 2, 2, 1)]);
        // The ring has room for four answers that the tick has not read.
        assert_eq!(work.counts.unread(), 1);
        assert!(read.pop().is_ok() && work.once(None));
        assert_eq!((work.counts.unread(), work.counts.states()), (1, 3));
        assert!(work.once(None) && work.once(None));
        assert_eq!(work.counts.unread(), 3);
        assert_eq!((work.counts.returns(), work.counts.let_go()), (0, 0));
    }

    /// What a device refuses while it idles before the first wrench is no refusal of a wrench of this run.
    #[test]
    fn refusals_count_from_the_first_wrench_of_the_tick() {
        let (mut work, _hand, mut read) = work(&[]);
        let mut told = |refused, handed| {
            work.exchange.refused = refused;
            assert!(work.once(handed));
            read.pop().expect("a reply").refused_wrenches
        };
        assert_eq!(told(None, None), None);
        assert_eq!(told(Some(3), None), Some(0));
        assert_eq!(told(Some(5), Some(answering(0))), Some(0));
        assert_eq!(told(Some(6), None), Some(1));
        assert_eq!(told(Some(9), Some(answering(0))), Some(4));
    }

    /// What waits when a device comes back was computed for the device before its loss.
    #[test]
    fn a_device_that_is_back_finds_no_wrench_that_waits() {
        let (mut work, mut hand, _read) = work(&[]);
        for _ in 0..SLOTS {
            assert!(hand.push(Handed::default()).is_ok());
        }
        assert!(work.back());
        assert!(work.commands.is_empty());
        assert_eq!((work.counts.returns(), work.counts.losses()), (1, 0));
        drop(hand);
        // The end of the run ends the attempts.
        assert!(!work.back());
        assert_eq!(work.counts.returns(), 1);
    }
}
