//! A run under virtual time: a session, in one thread, with the run's observers.

use super::ended::Ended;
use super::observer::Observers;
use super::pace::Pace;
use super::prepare::Prepared;
use super::session::Session;
use runner::Stop;
use runner::link::LogRecord;
use std::time::{Duration, Instant};

/// Longest time on the wall between two reports of progress, unless a single step takes longer.
const SAID: Duration = Duration::from_millis(100);

/// Runs what is prepared under virtual time, until `stop` is requested. `progress` is given the number of ticks done.
pub(super) fn run(
    prepared: Prepared,
    stop: &Stop,
    mut observers: Observers,
    progress: &mut dyn FnMut(u64),
) -> Ended {
    let view = prepared.view.as_ref();
    let mut pace = view.and_then(|view| Pace::new(view.pace));
    let mut sink = |record: LogRecord<'_>| {
        let time_ns = match &record {
            LogRecord::Tick(telemetry) => Some(telemetry.time_ns),
            LogRecord::Model(..) | LogRecord::Patch(..) => None,
        };
        observers.take(record);
        observers.drained();
        if let (Some(pace), Some(time_ns)) = (&mut pace, time_ns) {
            pace.wait(time_ns, || {
                observers.drained();
                !stop.is_requested()
            });
        }
    };
    let mut session = Session::of(prepared);
    let mut said = Instant::now();
    while session.tick().is_some() {
        session.records(&mut sink);
        let before = session.ticks() - 1;
        // Large bodies take long for a step: a person who waits sees something by the clock on the wall, too.
        if before.is_multiple_of(256) || said.elapsed() > SAID {
            said = Instant::now();
            progress(before);
        }
        if stop.is_requested() {
            break;
        }
    }
    let mut ended = session.end();
    ended.observed = observers.finish();
    ended
}
