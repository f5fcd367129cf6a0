//! The table of a run: a row for each tick, the same bytes from the run, from a second run and from a replay of its log.

use host::log::Log;
use host::run::observer::{Observed, Observer, Observers};
use host::run::replay::{ReplayError, replay_watched};
use host::run::{Clock, RunOptions, TickOutputs, run, run_watched};
use host::scene::Scene;
use host::world::World;
use rt_core::Telemetry;
use runner::link::LogRecord;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::sync::{Arc, Mutex};

type Outcome = Result<(), Box<dyn Error>>;

/// A table that was read: a list of numbers for each column.
fn read(text: &str) -> BTreeMap<&str, Vec<f64>> {
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().unwrap_or_default().split(',').collect();
    let mut table: BTreeMap<_, Vec<f64>> = names.iter().map(|name| (*name, Vec::new())).collect();
    assert_eq!(table.len(), names.len(), "a column occurs once");
    for line in lines {
        let numbers: Vec<f64> = line.split(',').map(|x| x.parse().expect(x)).collect();
        assert_eq!(numbers.len(), names.len(), "{line}");
        for (name, number) in names.iter().zip(numbers) {
            table.entry(name).or_default().push(number);
        }
    }
    table
}

/// Keeps every tick.
struct Keep(Arc<Mutex<Vec<Telemetry>>>);

impl Observer for Keep {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            self.0.lock().expect("nothing panics").push(*telemetry);
        }
    }

    fn finish(self: Box<Self>, _: &mut Observed) {}
}

#[test]
fn the_table_holds_what_the_ticks_held() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.csv");
    fs::write(&path, "an older and longer table ".repeat(100_000))?;
    let ticks = Arc::new(Mutex::new(Vec::new()));
    let mut options = RunOptions::new(Clock::Virtual);
    options.duration = Some(0.7);
    options.ticks.csv = Some(path.clone());
    let others = Observers::new().with(Keep(Arc::clone(&ticks)));
    run_watched(&World::new(&loaded).unwrap(), &options, others, &mut |_| ())?;
    let text = fs::read_to_string(&path)?;
    let table = read(&text);
    let ticks = ticks.lock().expect("nothing panics");
    assert_eq!(ticks.len(), 700);
    let equal = |column: &str, of: &dyn Fn(&Telemetry) -> f64| {
        let expected: Vec<_> = ticks.iter().map(|tick| of(tick).to_bits()).collect();
        let found: Vec<_> = table[column].iter().map(|x| x.to_bits()).collect();
        assert_eq!(found, expected, "{column}");
    };
    equal("tick", &|t| t.tick as f64);
    equal("time_s", &|t| t.time_ns as f64 / 1e9);
    equal("left_position_x_m", &|t| t.devices[0].pose.position.x);
    equal("left_orientation_w", &|t| t.devices[0].pose.rotation.w);
    equal("left_velocity_y_m_per_s", &|t| t.devices[0].twist.linear.y);
    equal("right_force_x_N", &|t| t.devices[1].wrench.force.x);
    equal("right_moment_z_Nm", &|t| t.devices[1].wrench.moment.z);
    equal("right_missed", &|t| {
        f64::from(u8::from(!t.devices[1].fresh))
    });
    equal("sheet_model", &|t| t.bodies[0].sequence as f64);
    equal("sheet_trust", &|t| t.bodies[0].trust);
    equal("sheet_supplied_J", &|t| t.bodies[0].energy.supplied);
    // No model, no age; then an age of at least the latency of 4 ms.
    let ages = table["sheet_model"].iter().zip(&table["sheet_model_age_s"]);
    let (mut before, mut after) = (0, 0);
    for (model, age) in ages {
        if *model == 0.0 {
            assert!(age.is_nan());
            before += 1;
        } else {
            assert!((0.004..0.013).contains(age), "{age}");
            after += 1;
        }
    }
    assert!(before > 0 && after > 600, "{before} {after}");
    // Each tick in which the cap acts is counted once.
    let capped: f64 = table["sheet_capped"].iter().sum();
    let counted = ticks.last().map(|tick| tick.bodies[0].energy.capped);
    assert_eq!(Some(capped as u64), counted);
    // Times are those that a person would write.
    assert!(text.contains("\n3,0.003,0.0,"), "the third tick");
    Ok(())
}

#[test]
fn a_second_run_and_a_replay_give_the_same_bytes() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let outputs = |name: &str| TickOutputs {
        csv: Some(at(&format!("{name}.csv"))),
        force_displacement: Some(at(&format!("{name}.svg"))),
    };
    for name in ["first", "second"] {
        let options = RunOptions {
            duration: Some(0.3),
            log: Some(at(&format!("{name}.mcap"))),
            ticks: outputs(name),
            ..RunOptions::new(Clock::Virtual)
        };
        let summary = run(&World::new(&loaded).unwrap(), &options, &mut |_| ())?;
        assert!(summary.failures.is_empty(), "{:?}", summary.failures);
    }
    let mut log = Log::parse(&fs::read(at("first.mcap"))?)?;
    let begin = || outputs("replay").observe(&loaded.scene, Observers::new());
    let (report, observed) = replay_watched(&log, &loaded, &begin, &mut |_| ())?;
    assert!(report.is_exact());
    assert!(observed.failures.is_empty());
    for ending in ["csv", "svg"] {
        let first = fs::read(at(&format!("first.{ending}")))?;
        for other in ["second", "replay"] {
            let other = fs::read(at(&format!("{other}.{ending}")))?;
            assert!(first == other, "{ending}");
        }
    }
    // A log that cannot be replayed leaves the files of another replay as they are.
    log.rows.remove(7);
    let refused = replay_watched(&log, &loaded, &begin, &mut |_| ());
    assert!(matches!(refused, Err(ReplayError::MissingTick { .. })));
    assert!(fs::read(at("replay.csv"))? == fs::read(at("first.csv"))?);
    Ok(())
}

/// A table that cannot be begun stops the run before it starts; one that cannot be continued is one of the failures.
#[cfg(target_os = "linux")]
#[test]
fn a_table_that_cannot_be_written_is_reported() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let mut options = RunOptions::new(Clock::Virtual);
    options.duration = Some(0.3);
    options.ticks.csv = Some("missing/run.csv".into());
    let error = run(&World::new(&loaded).unwrap(), &options, &mut |_| ())
        .err()
        .map(|e| e.to_string());
    let error = error.unwrap_or_default();
    assert!(
        error.starts_with("cannot write missing/run.csv: "),
        "{error}"
    );
    options.ticks.csv = Some("/dev/full".into());
    let summary = run(&World::new(&loaded).unwrap(), &options, &mut |_| ())?;
    let [failure] = &summary.failures[..] else {
        return Err(format!("{:?}", summary.failures).into());
    };
    assert!(
        failure.starts_with("the table /dev/full ended early: "),
        "{failure}"
    );
    Ok(())
}
