//! RealtimeSanitizer watches the tick: memory, files, contended locks, waiting. `tests/rtsan` runs this test.
//!
//! A violation ends the process with a stack trace, so a run that returns has none. A child process that must not
//! return shows that the sanitizer works.

use host::engine::pacer::Due;
use host::engine::stats::WallStopwatch;
use host::run::prepare::{Options, Prepared};
use host::scene::spec::SchemeName;
use std::process::Command;

const CHILD: &str = "PALPATE_RTSAN_CHILD";

#[rtsan_standalone::nonblocking]
fn allocates() -> usize {
    std::hint::black_box(Box::new([0_u8; 64])).len()
}

#[test]
fn the_sanitizer_is_there_and_ends_a_process_that_allocates() {
    if std::env::var_os(CHILD).is_some() {
        allocates();
        return;
    }
    let this = std::env::current_exe().expect("a test has a program");
    let output = Command::new(this)
        .args([
            "--exact",
            "the_sanitizer_is_there_and_ends_a_process_that_allocates",
        ])
        .env(CHILD, "1")
        .output()
        .expect("it runs again");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success(),
        "the child allocated and came back"
    );
    assert!(said.contains("RealtimeSanitizer"), "{said}");
}

#[test]
fn every_scheme_ticks_under_the_sanitizer() {
    for scheme in [
        SchemeName::Hold,
        SchemeName::Thesis,
        SchemeName::Linear,
        SchemeName::Proxy,
        SchemeName::Classic,
        SchemeName::Capped,
    ] {
        let mut scene = palpate_tests::default_scene();
        scene.scene.realtime.scheme = scheme;
        let built =
            Prepared::new(&scene, &Options::new(1.0, 1)).expect("the built-in scene can be built");
        let (mut tick, mut host, mut engine) = (built.tick, built.host, built.engine);
        let watch = WallStopwatch::start();
        for k in 0..1000_u64 {
            tick.tick(k * built.timing.period_ns);
            host.drain(|record| engine.follow(record));
            if k % 4 == 0 {
                let due = Due {
                    time_ns: 0,
                    publishes: true,
                };
                engine.step(due, &watch, |body, model| {
                    host.publish(body, model).expect("the tick takes models");
                });
            }
        }
        let accepted: u64 = tick
            .controller
            .coupling_counters()
            .map(|c| c.accepted)
            .sum();
        assert_eq!((tick.ticks, accepted), (1000, 250), "{scheme:?}");
    }
}
