//! Known truth: delays that are planted at known ticks of a real loop are found at these ticks, by their names.

use devices::scripted::{Scripted, small};
use host::run::observer::Observer;
use host::scene::Scene;
use rt_core::controller::DeviceConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{Controller, ControllerConfig, DeviceState, Freedom, Vec3};
use runner::kernel::KernelWindows;
use runner::link::{LinkConfig, link};
use runner::schedule::{pin, realtime};
use runner::{AnyDevice, CoreChoice, Cores, RunnerConfig, Stop, spawn};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};
use study::latency::gather::{Gathered, Gatherer};
use study::latency::stages::Stage;
use study::latency::worst::Tick;

/// The ticks of the planted delays. Each is far longer than the delays of a busy machine.
const SLOW_READ: u64 = 300;
const FAULTS: u64 = 600;
const SLOW_WRITE: u64 = 800;
const LATE: u64 = 1000;
const TICKS: u64 = 2000;
const PAUSE: Duration = Duration::from_millis(150);
/// Pages that a tick touches first.
const PAGES: usize = 4000;

/// A device that calls `trick` in its read (`true`) or its write of each tick.
fn device(trick: impl Fn(bool, u64) + Send + Sync + 'static) -> AnyDevice {
    let trick = Arc::new(trick);
    let theirs = Arc::clone(&trick);
    let (mut reads, mut writes) = (0, 0);
    let read = move |_| {
        trick(true, reads);
        reads += 1;
        Ok(DeviceState::resting())
    };
    let write = move |_, _: &_| {
        theirs(false, writes);
        writes += 1;
        Ok(())
    };
    Box::new(Scripted::new(small(Freedom::Three), read, write))
}

fn controller() -> Controller {
    let mut config = ControllerConfig::default();
    for _ in 0..2 {
        let frame = DeviceFrame::at(Vec3::zeros());
        let safety = SafetyConfig::unlimited(1e-3);
        let _ = config.devices.push(DeviceConfig { frame, safety });
    }
    Controller::new(&config)
}

/// Runs the loop with the planted delays. Returns what was gathered, and whether another thread could delay a wake-up.
fn run() -> (Gathered, bool) {
    let left = device(|is_read, tick| match (is_read, tick) {
        (true, FAULTS) => {
            // The allocator takes a block of this size from the kernel, page by page as it is touched.
            let block = vec![1_u8; PAGES * 4096];
            std::hint::black_box(&block);
        }
        (false, SLOW_WRITE) => std::thread::sleep(PAUSE),
        _ => {}
    });
    let right = device(|is_read, tick| {
        if is_read && tick == SLOW_READ {
            std::thread::sleep(PAUSE);
        }
    });
    let scene = Scene::embedded_default().expect("the built-in scene");
    let (to, gathered) = channel();
    let mut gatherer = Gatherer::new(&scene.scene, TICKS, to);
    let (tick, mut host, mut log) = link(&LinkConfig::new(1000.0, 60.0));
    let config = RunnerConfig {
        ticks: Some(TICKS),
        core: CoreChoice::Last,
        priority: Some(20),
        ..RunnerConfig::default()
    };
    let devices = vec![left, right];
    let stop = Arc::new(Stop::new());
    let run = spawn(config, controller(), devices, tick, stop).expect("it can run");
    let refused = run
        .degradations()
        .iter()
        .any(|each| each.missing.contains("priority"));
    let core = run.core().filter(|_| !refused);
    let mut kernel = KernelWindows::of(&run).expect("Linux");
    let mut planted = false;
    let mut over = false;
    while !over {
        over = run.is_finished();
        let window = kernel.window();
        log.records(|record| gatherer.take(record));
        if let Some(window) = window {
            gatherer.counted(&window);
        }
        host.drain(|_| {});
        if let Some(core) = core.filter(|_| !planted && run.ticks() >= LATE) {
            planted = true;
            // A busy thread of a higher priority on the tick's core.
            std::thread::spawn(move || {
                let pinned = pin(CoreChoice::Id(core), &Cores::of_this_machine());
                let higher = realtime(30);
                let start = Instant::now();
                while start.elapsed() < PAUSE && pinned.is_ok() && higher.is_ok() {}
            });
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(run.join().is_ok());
    Box::new(gatherer).finish(&mut host::run::observer::Observed::default());
    (gathered.recv().expect("it was sent"), planted)
}

/// The tick of `number` among the worst ones.
fn found(gathered: &Gathered, number: u64) -> &Tick {
    let tick = gathered.worst.ticks.iter().find(|tick| tick.tick == number);
    tick.unwrap_or_else(|| panic!("tick {number} is none of {:?}", gathered.worst.ticks))
}

#[test]
fn delays_are_found_at_their_ticks_and_by_their_names() {
    let (gathered, planted) = run();
    let pause_ns = PAUSE.as_nanos() as u64;
    for (number, stage) in [(SLOW_READ, Stage::Read(1)), (SLOW_WRITE, Stage::Write(0))] {
        let tick = found(&gathered, number);
        assert_eq!(tick.cause(|stage| gathered.usual(stage)), Some(stage));
        let took = tick.stages.iter().find(|(found, _)| *found == stage);
        assert!(took.is_some_and(|(_, ns)| *ns >= pause_ns), "{tick:?}");
        // Each deadline that passed in the pause is skipped, and as late as the next tick.
        let slots = pause_ns / 1_000_000;
        assert!(tick.skipped >= slots - 1, "{tick:?}");
    }
    let deadlines = &gathered.deadlines;
    assert_eq!((deadlines.met, deadlines.unknown), (TICKS, 0));
    assert_eq!(gathered.lateness.count(), TICKS + deadlines.skipped);
    // Half of the deadlines in a pause are later than half of it.
    let late = gathered
        .lateness
        .histogram()
        .range(pause_ns / 2..)
        .map(|(_, count)| count)
        .sum::<u64>();
    assert!(late >= 2 * (pause_ns / 2_000_000 - 1), "{late}");

    let most = gathered
        .windows
        .iter()
        .max_by_key(|window| window.counts.minor_faults);
    let most = most.expect("a window with page faults");
    assert!(most.counts.minor_faults >= PAGES as u64 / 2, "{most:?}");
    // The nominal time of a tick counts the skipped deadlines.
    let skipped = found(&gathered, SLOW_READ).skipped;
    let at_ns = (FAULTS + skipped) * 1_000_000;
    assert!(most.to_ns >= at_ns, "{most:?} {at_ns}");

    if planted {
        let hogged = |tick: &&Tick| tick.tick >= LATE;
        let tick = gathered
            .worst
            .ticks
            .iter()
            .find(hogged)
            .expect("a late tick");
        assert_eq!(tick.cause(|stage| gathered.usual(stage)), Some(Stage::Wake));
        assert!(tick.stages[0].1 >= pause_ns / 2, "{tick:?}");
    } else {
        println!("!! SKIPPED: the delayed wake-up: this account may not raise a thread's priority");
    }
}
