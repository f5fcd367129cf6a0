//! The thread that exchanges with one device: it drives the [`Poller`] by the real clock.

use super::{Exchange, Handed, Poller, Reply, Step, clock};
use rtrb::{Consumer, Producer};
use runner::ring::take_newest;
use runner::schedule::realtime;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::{JoinHandle, park_timeout};
use std::time::Duration;

/// Starts the thread, which ends after `commands` has lost its writer. The thread takes `priority` under SCHED_FIFO, if
/// allowed. This module does not report a refusal, because the tick reports the refusal of its own priority.
pub(super) fn start(
    mut exchange: impl Exchange + 'static,
    mut commands: Consumer<Handed>,
    mut replies: Producer<Reply>,
    let_go: Duration,
    priority: u8,
) -> std::io::Result<JoinHandle<()>> {
    std::thread::Builder::new()
        .stack_size(runner::STACK)
        .name("palpate-exchange".into())
        .spawn(move || {
            let _ = realtime(priority);
            // The device is released even after a panic of its driver. Neither panic may end the process.
            let _ = catch_unwind(AssertUnwindSafe(|| {
                poll(&mut exchange, &mut commands, &mut replies, let_go);
            }));
            let _ = catch_unwind(AssertUnwindSafe(|| exchange.release()));
        })
}

/// Exchanges until the end.
fn poll(
    exchange: &mut impl Exchange,
    commands: &mut Consumer<Handed>,
    replies: &mut Producer<Reply>,
    let_go: Duration,
) {
    let mut now_ns = clock();
    let mut poller = Poller::new(now_ns(), let_go);
    while !commands.is_abandoned() {
        let newest = take_newest(commands, |handed, _| *handed);
        match poller.next(now_ns(), newest) {
            // If a wake-up came after the ring was read, this call returns at once.
            Step::Wait(until_ns) => {
                park_timeout(Duration::from_nanos(until_ns.saturating_sub(now_ns())));
            }
            Step::Exchange(wrench) => {
                let answer = exchange.exchange(&wrench);
                let (motion, refused) = (exchange.motion_to_force(), exchange.refused_wrenches());
                // If the ring is full, the tick has not read for a while, and finds the oldest answers first.
                let _ = replies.push(poller.answered(now_ns(), answer, motion, refused));
            }
            Step::Reopen => {
                let result = exchange.reopen();
                poller.reopened(now_ns(), result);
            }
        }
    }
}
