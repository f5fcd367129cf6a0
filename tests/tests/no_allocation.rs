//! The tick allocates nothing: 100,000 ticks of the built-in scene, on a thread of their own under an allocator that
//! counts the allocations of that thread. The steady step of the host allocates nothing, either.

use alloc_count::calls::{Counting, count};
use host::engine::pacer::Due;
use host::engine::stats::WallStopwatch;
use host::run::prepare::{Options, Prepared};
use host::scene::spec::SchemeName;
use host::world::World;
use rt_core::LocalModel;
use runner::link::HostEnd;
use std::sync::atomic::{AtomicBool, Ordering};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn the_counter_counts() {
    let found = count(|| drop(std::hint::black_box(Box::new([0_u8; 64]))));
    assert_eq!(found, 2, "one allocation and its release");
}

/// Publishes newer and newer models while the tick runs, and drains the records of the tick.
fn host_beside(mut host: HostEnd, mut model: LocalModel, over: &AtomicBool) -> u64 {
    let mut now = 0;
    let mut published = 0;
    while !over.load(Ordering::Relaxed) {
        host.drain(|record| now = record.time_ns);
        if now > model.head.time_ns {
            model.head.sequence += 1;
            model.head.time_ns = now;
            published += u64::from(host.publish(0, &model).is_ok());
        }
        std::thread::yield_now();
    }
    published
}

#[test]
fn a_hundred_thousand_ticks_allocate_nothing() {
    const TICKS: u64 = 100_000;
    let setup = palpate_tests::default_session(1.0);
    let (mut tick, host, mut log, mut engine) = (setup.tick, setup.host, setup.log, setup.engine);
    let period = setup.timing.period_ns;

    // A real model of the scene's sheet, published repeatedly with new times.
    let mut model = LocalModel::empty();
    let first = tick.tick(0);
    engine.follow(&first.tick_record());
    let due = Due {
        time_ns: 0,
        publishes: true,
    };
    engine.step(due, &WallStopwatch::start(), &mut |_, published| {
        model = *published;
    });
    assert_eq!(model.head.handle_count, 2);

    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let beside = scope.spawn(|| host_beside(host, model, &over));
        let ticking = scope.spawn(|| {
            let found = count(|| {
                for k in 1..=TICKS {
                    tick.tick(k * period);
                }
            });
            (found, tick)
        });
        let drained = scope.spawn(|| {
            let mut records = 0;
            while !over.load(Ordering::Relaxed) {
                records += log.drain(|_| {});
                std::thread::yield_now();
            }
            records
        });
        let (found, tick) = ticking.join().expect("the tick does not panic");
        over.store(true, Ordering::Relaxed);
        let published = beside.join().expect("the host does not panic");
        let records = drained.join().expect("the log does not panic");
        assert_eq!(found, 0, "allocations on the tick's thread");
        assert_eq!(tick.ticks, TICKS + 1);
        // The ticks had models and left records, so the relevant paths were taken.
        let accepted: u64 = tick
            .controller
            .coupling_counters()
            .map(|c| c.accepted)
            .sum();
        assert!(
            accepted > 0 && published >= accepted,
            "{accepted} of {published}"
        );
        assert!(records > 0);
    });
}

#[test]
fn a_steady_host_step_allocates_nothing() {
    // The schemes for which the host does the most work.
    for scheme in [
        SchemeName::Linear,
        SchemeName::Proxy,
        SchemeName::Classic,
        SchemeName::Capped,
    ] {
        steady_steps(scheme);
    }
}

fn steady_steps(scheme: SchemeName) {
    let mut scene = palpate_tests::default_scene();
    scene.scene.realtime.scheme = scheme;
    let setup = Prepared::new(&World::new(&scene).unwrap(), &Options::new(1.0, 1))
        .expect("the built-in scene can be built");
    let (mut tick, mut engine) = (setup.tick, setup.engine);
    let watch = WallStopwatch::start();
    let due = Due {
        time_ns: 0,
        publishes: true,
    };
    let mut published = 0;
    let mut run = |ticks: std::ops::Range<u64>| {
        for k in ticks {
            let telemetry = tick.tick(k * setup.timing.period_ns);
            engine.follow(&telemetry.tick_record());
            if k % 4 == 0 {
                engine.step(due, &watch, &mut |_, _| published += 1);
            }
        }
    };
    run(0..100);
    let found = count(|| run(100..500));
    assert_eq!(found, 0, "allocations in 100 host steps, {scheme:?}");
    assert_eq!(published, 125);
}
