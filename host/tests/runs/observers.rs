//! An observer of a run receives every record, whether the run is logged or not.

use host::run::observer::{Observed, Observer, Observers};
use host::run::{Clock, RunOptions, run_watched};
use host::scene::Scene;
use host::world::World;
use runner::link::LogRecord;
use std::error::Error;
use std::sync::{Arc, Mutex};

/// The records that an observer received.
#[derive(Clone, Debug, Default, PartialEq)]
struct Seen {
    /// The numbers of the ticks.
    ticks: Vec<u64>,
    models: u64,
    /// Ticks that used a model before the observer received it.
    early: u64,
}

#[derive(Default)]
struct Watcher(Arc<Mutex<Seen>>);

impl Observer for Watcher {
    fn take(&mut self, record: LogRecord<'_>) {
        let mut seen = self.0.lock().expect("nothing panics");
        match record {
            LogRecord::Tick(telemetry) => {
                seen.ticks.push(telemetry.tick);
                let used = telemetry.bodies().map(|body| body.sequence).max();
                seen.early += u64::from(used > Some(seen.models));
            }
            LogRecord::Model(..) => seen.models += 1,
            LogRecord::Patch(..) => {}
        }
    }

    fn finish(self: Box<Self>, observed: &mut Observed) {
        observed.failures.push("the watcher fell asleep".to_owned());
    }
}

#[test]
fn an_observer_sees_every_tick_and_its_models_before_it() -> Result<(), Box<dyn Error>> {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let mut all = Vec::new();
    for log in [None, Some(folder.path().join("run.mcap"))] {
        let options = RunOptions {
            duration: Some(0.2),
            log,
            ..RunOptions::new(Clock::Virtual)
        };
        let seen = Arc::new(Mutex::new(Seen::default()));
        let others = Observers::new().with(Watcher(Arc::clone(&seen)));
        let summary = run_watched(&World::new(&loaded).unwrap(), &options, others, &mut |_| {})?;
        // The summary is complete, and contains the failure that the observer reported.
        assert_eq!(summary.tick.records, 200);
        assert_eq!(summary.failures, ["the watcher fell asleep"]);
        let seen = seen.lock().expect("nothing panics").clone();
        assert_eq!(seen.ticks, (0..200).collect::<Vec<_>>());
        // Steps at 4, 8, ..., 196 ms publish models that arrive 4 ms later. The last one arrives after the last tick.
        assert_eq!(seen.models, 48);
        assert_eq!(seen.early, 0);
        all.push(seen);
    }
    assert_eq!(all[0], all[1]);
    Ok(())
}
