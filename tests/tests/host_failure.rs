//! The host may fail: the tick continues, the force fades, and the run ends in order.

use host::engine::pacer::Due;
use host::engine::stats::WallStopwatch;
use host::run::prepare::{Options, Prepared};
use host::scene::spec::SchemeName;
use host::world::World;
use rt_core::coupling::HostState::{self, Fading, Held, Live, Waiting};
use runner::{RunnerConfig, Stop, spawn};
use std::sync::Arc;

#[test]
fn a_silent_host_lets_the_force_fade_and_return_without_a_jump() {
    // One encoder count changes the force of the linear model by K delta + B delta g / T: 180 N/m and 2 N s/m of the
    // sheet and 2 N s/m of the hold give 0.07 N with both hands. Fading adds 1.5 x 2 N / 200 ticks. The hand moved
    // while the force was gone, so the cap dissipates energy that the hand did not supply: 15 N s/m, 0.14 N a count.
    for (scheme, largest) in [(SchemeName::Linear, 0.12), (SchemeName::Capped, 0.26)] {
        let found = largest_step_under_a_silent_host(scheme);
        assert!(
            found < largest,
            "{scheme:?}: the force stepped by {found} N"
        );
    }
}

/// The largest change of force from one tick to the next (N), under virtual time. The host becomes silent after 1.5 s,
/// and publishes again half a second later.
fn largest_step_under_a_silent_host(scheme: SchemeName) -> f64 {
    let mut scene = palpate_tests::default_scene();
    scene.scene.realtime.age_limit = Some(0.1);
    scene.scene.realtime.scheme = scheme;
    let setup = Prepared::new(&World::new(&scene).unwrap(), &Options::new(3.0, 1))
        .expect("the built-in scene can be built");
    let (mut tick, mut host, mut engine) = (setup.tick, setup.host, setup.engine);
    let watch = WallStopwatch::start();
    let mut last: Option<[f64; 3]> = None;
    let mut largest_step: f64 = 0.0;
    let mut states: Vec<HostState> = Vec::new();
    let mut held_force: f64 = 0.0;
    for k in 0..3000_u64 {
        if k % 4 == 0 {
            host.drain(|record| engine.follow(record));
            let silent = (1500..2000).contains(&k);
            let due = Due {
                time_ns: 0,
                publishes: true,
            };
            engine.step(due, &watch, &mut |body, model| {
                if !silent {
                    host.publish(body, model).expect("the tick takes models");
                }
            });
        }
        let telemetry = tick.tick(k * setup.timing.period_ns);
        let device = &telemetry.devices[0];
        let state = telemetry.bodies[0].state;
        if states.last() != Some(&state) {
            states.push(state);
        }
        if state == Held {
            // Only the safe hold is left: 2 N s/m times the velocity of the hand.
            let expected = 2.0 * device.twist.linear.norm();
            held_force = held_force.max((device.wrench.force.norm() - expected).abs());
        }
        let force: [f64; 3] = device.wrench.force.into();
        if let Some(last) = last {
            let step = force
                .iter()
                .zip(last)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt();
            largest_step = largest_step.max(step);
        }
        last = Some(force);
    }
    assert_eq!(states, [Waiting, Live, Fading, Held, Live]);
    assert!(held_force < 1e-12, "{held_force}");
    largest_step
}

/// Real time: the host's thread panics at once while it owns its end of the rings.
#[test]
fn a_panicking_host_leaves_the_tick_running() {
    let setup = palpate_tests::default_session(0.3);
    let config = RunnerConfig {
        period_ns: setup.timing.period_ns,
        ticks: Some(300),
        ..RunnerConfig::default()
    };
    let tick = setup.tick;
    let thread = spawn(
        config,
        tick.controller,
        tick.devices,
        tick.end,
        Arc::new(Stop::new()),
    )
    .expect("the loop starts");
    let host = setup.host;
    let panicked = std::thread::Builder::new()
        .name("a host that fails".into())
        .spawn(move || {
            let _held = host;
            panic!("on purpose");
        })
        .expect("a thread")
        .join();
    assert!(panicked.is_err());
    let report = thread.join().expect("the loop ends in order");
    assert_eq!(report.ticks, 300);
    assert_eq!(report.ticks + report.missed_deadlines, report.slots);
}
