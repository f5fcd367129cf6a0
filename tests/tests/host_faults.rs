//! Every fault of the host, under both clocks: the force stays finite and within the limits of the device, it fades and
//! returns without a jump, and the summary names the fault.

use host::engine::faults::FaultKind::{self, NotANumber, Panic, Stall, Topology};
use host::engine::faults::HostFault;
use host::log::{Log, read_log};
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::spec::SchemeName;
use host::world::World;
use rt_core::coupling::HostState;

/// Age above which a model is not trusted (s). The age is short, so that the tests wait little.
const AGE_LIMIT: f64 = 0.1;

/// A fault: its kind, its start and its duration (s).
type Fault = (FaultKind, f64, f64);

/// Runs the built-in scene for 3 s with faults. Returns its summary and its log.
fn with(clock: Clock, faults: &[Fault]) -> (RunSummary, Log) {
    under(SchemeName::Capped, clock, faults)
}

/// The same under another scheme.
fn under(scheme: SchemeName, clock: Clock, faults: &[Fault]) -> (RunSummary, Log) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(3.0),
        log: Some(path.clone()),
        faults: faults
            .iter()
            .map(|&(kind, at, duration)| HostFault { kind, at, duration })
            .collect(),
        ..RunOptions::new(clock)
    };
    let mut scene = palpate_tests::default_scene();
    scene.scene.realtime.age_limit = Some(AGE_LIMIT);
    scene.scene.realtime.scheme = scheme;
    let summary =
        run(&World::new(&scene).unwrap(), &options, &mut |_| {}).expect("the run succeeds");
    let bytes = std::fs::read(&path).expect("the log was written");
    assert!(!read_log(&bytes).expect("it can be read").is_empty());
    (summary, Log::parse(&bytes).expect("it can be read"))
}

/// The largest change of force from one tick to the next without a failure (N). One encoder count changes the linear
/// model by its stiffness and damping, 0.07 N with both hands. Fading and returning add 3.5 N x 1.5 / 200 ticks. Where
/// the body stores more than the hands supplied, the cap damps with 15 N s/m (a quarter of 0.15 kg over 2.5 ms), which
/// is 0.14 N for a count, spread over 4 ms. Each skipped tick (`slots`) allows as much again.
const LARGEST_STEP: f64 = 0.26;
/// The same without the damper of the cap.
const LARGEST_UNCAPPED: f64 = 0.12;
/// The same where the machine decides when a tick comes. Counts of all three axes may fall into one tick, and a late
/// tick may have two counts and the next none. No line fits those, so the window of the velocity shrinks to a tick. In
/// that window a count (of 0.038 mm) is 38 mm/s, and the damper changes by 0.57 N at 15 N s/m. The model adds 0.07 N an
/// axis, fading 0.026 N.
const LARGEST_REAL: f64 = 0.72;

fn check_forces(log: &Log) {
    check_steps(log, LARGEST_STEP);
}

fn check_steps(log: &Log, largest: f64) {
    let mut last: Option<(u64, [f64; 3])> = None;
    for row in &log.rows {
        let device = &row.devices[0];
        let force: [f64; 3] = device.wrench.force.into();
        assert!(force.iter().all(|f| f.is_finite()), "tick {}", row.tick);
        assert!(
            device.wrench.force.norm() <= 8.0 * (1.0 + 1e-12),
            "tick {}",
            row.tick
        );
        if let Some((time_ns, before)) = last {
            let step = force
                .iter()
                .zip(before)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt();
            let slots = ((row.time_ns - time_ns) / 1_000_000) as f64;
            assert!(
                step < largest * slots,
                "tick {}: a step of {step} N",
                row.tick
            );
        }
        last = Some((row.time_ns, force));
    }
}

fn states(log: &Log) -> Vec<HostState> {
    let mut states: Vec<HostState> = log.rows.iter().map(|row| row.bodies[0].state).collect();
    states.dedup();
    states
}

fn names(summary: &RunSummary, part: &str) -> bool {
    summary.to_string().contains(part)
}

#[test]
fn a_stalling_host_under_virtual_time() {
    use HostState::{Fading, Held, Live, Waiting};
    // A stall shorter than the age limit (0.1 s) has no effect on the state. A longer one fades the force; a much
    // longer one ends in the safe hold.
    for (fault, expected) in [
        ((Stall, 1.5, 0.05), vec![Waiting, Live]),
        ((Stall, 1.5, 0.25), vec![Waiting, Live, Fading, Live]),
        ((Stall, 1.5, 0.8), vec![Waiting, Live, Fading, Held, Live]),
        ((Stall, 1.5, 5.0), vec![Waiting, Live, Fading, Held]),
    ] {
        let (_, log) = under(SchemeName::Linear, Clock::Virtual, &[fault]);
        check_steps(&log, LARGEST_UNCAPPED);
        assert_eq!(states(&log), expected, "{fault:?}");
        let (summary, log) = with(Clock::Virtual, &[fault]);
        check_forces(&log);
        assert_eq!(states(&log), expected, "{fault:?}");
        assert!(names(&summary, "on purpose: the host stalls"));
        assert_eq!(
            names(&summary, "model too old"),
            expected.len() > 2,
            "{fault:?}"
        );
        assert_eq!(summary.tick.count, 3000);
    }
}

#[test]
fn bad_models_under_virtual_time_are_refused_named_and_survived() {
    for (fault, reason) in [
        ((NotANumber, 1.5, 0.8), "a number is not finite"),
        ((Topology, 1.5, 0.8), "wrong handles"),
    ] {
        let (summary, log) = with(Clock::Virtual, &[fault]);
        check_forces(&log);
        assert_eq!(states(&log).last(), Some(&HostState::Live), "{fault:?}");
        // 0.8 s at 250 Hz, all refused.
        assert_eq!(summary.tick.refused_models, 200, "{fault:?}");
        assert!(names(&summary, reason), "{summary}");
        assert!(names(&summary, "model too old"), "{summary}");
    }
}

#[test]
fn a_panicking_host_under_virtual_time() {
    let (summary, log) = with(Clock::Virtual, &[(Panic, 1.5, 0.0)]);
    check_forces(&log);
    assert_eq!(states(&log).last(), Some(&HostState::Held));
    assert_eq!(summary.tick.count, 3000);
    assert_eq!(summary.failures.len(), 1);
    assert!(
        names(&summary, "the host panicked, and the tick continued"),
        "{summary}"
    );
}

#[test]
fn every_fault_under_the_real_clock() {
    // The test takes one run. It checks the force at every tick. The counts depend on the load of the machine.
    let faults = [
        (Stall, 0.5, 0.4),
        (NotANumber, 1.2, 0.4),
        (Topology, 1.9, 0.3),
        (Panic, 2.5, 0.0),
    ];
    let (summary, log) = with(Clock::Real, &faults);
    check_steps(&log, LARGEST_REAL);
    assert!(summary.tick.faded >= 1, "{summary}");
    assert!(summary.tick.refused_models >= 1, "{summary}");
    for part in [
        "not finite",
        "wrong handles",
        "the host panicked",
        "model too old",
    ] {
        assert!(names(&summary, part), "{part} is missing from:\n{summary}");
    }
}
