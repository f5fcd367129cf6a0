//! The rings: order, refusals, gaps, the newest of many, peers that leave, and capacities.

use proptest::prelude::*;
use rt_core::tool::{Patch, Triangle};
use rt_core::{LocalModel, MAX_BODIES, MAX_DEVICES, MAX_HANDLES, Mat6, Telemetry, Vec3};
use runner::link::{HostEnd, LinkConfig, LogEnd, LogRecord, RingFull, TickEnd, link};
use runner::ring::slots_for;

/// Room for five records and three models.
fn small() -> (TickEnd, HostEnd, LogEnd) {
    let rates = LinkConfig {
        bodies: 2,
        stall: 1.0,
        ..LinkConfig::new(4.0, 2.0)
    };
    assert_eq!((slots_for(4.0, 1.0), slots_for(2.0, 1.0)), (5, 3));
    link(&rates)
}

fn telemetry(tick: u64) -> Telemetry {
    Telemetry {
        tick,
        time_ns: tick * 1_000_000,
        ..Telemetry::empty()
    }
}

fn model(sequence: u64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = sequence;
    model
}

#[test]
fn records_arrive_in_order_on_both_sides() {
    let (mut tick, mut host, mut log) = small();
    for k in 0..5 {
        tick.push(&telemetry(k));
    }
    let mut seen = Vec::new();
    assert_eq!(
        host.drain(|record| seen.push((record.tick, record.time_ns))),
        5
    );
    assert_eq!(seen, (0..5).map(|k| (k, k * 1_000_000)).collect::<Vec<_>>());
    let mut logged = Vec::new();
    assert_eq!(log.drain(|record| logged.push(record.tick)), 5);
    assert_eq!(logged, [0, 1, 2, 3, 4]);
    assert_eq!((host.lost_records(), log.lost_records()), (0, 0));
    assert_eq!(host.drain(|_| panic!("the ring is empty")), 0);
    assert!(host.newest().is_none());
}

#[test]
fn a_full_ring_refuses_and_both_ends_count() {
    let (mut tick, mut host, mut log) = small();
    for k in 0..8 {
        tick.push(&telemetry(k));
    }
    assert_eq!(
        (
            tick.counters().refused_records,
            tick.counters().refused_telemetry
        ),
        (3, 3)
    );
    // The first records stay. The gap shows with the next record that gets in.
    assert_eq!(host.newest().map(|record| record.tick), Some(4));
    assert_eq!(host.lost_records(), 0);
    tick.push(&telemetry(8));
    assert_eq!(host.drain(|record| assert_eq!(record.tick, 8)), 1);
    assert_eq!(host.lost_records(), 3);
    // The log has not been read meanwhile, so the ninth was refused there as well.
    assert_eq!(tick.counters().refused_telemetry, 4);
    assert_eq!(log.drain(|_| ()), 5);
    tick.push(&telemetry(9));
    assert_eq!(log.drain(|_| ()), 1);
    assert_eq!(log.lost_records(), 4);
}

#[test]
fn one_take_gives_the_newest_model_of_each_body() {
    let (mut tick, mut host, _log) = small();
    for sequence in 1..=3 {
        assert_eq!(host.publish(0, &model(sequence)), Ok(()));
    }
    assert_eq!(host.publish(1, &model(1)), Ok(()));
    let mut taken = Vec::new();
    tick.take_models(|body, model| taken.push((body, model.head.sequence)));
    assert_eq!(taken, [(0, 3), (1, 1)]);
    assert_eq!(
        (
            tick.counters().superseded_models,
            tick.counters().lost_models
        ),
        (2, 0)
    );
    tick.take_models(|_, _| panic!("all have been let go"));
    // Beyond the end of the ring's memory, the newest model is still the newest.
    for sequence in 4..=20 {
        assert_eq!(host.publish(0, &model(sequence)), Ok(()));
        if sequence % 3 == 0 || sequence == 20 {
            let mut newest = 0;
            tick.take_models(|_, model| newest = model.head.sequence);
            assert_eq!(newest, sequence);
        }
    }
    assert_eq!(tick.counters().lost_models, 0);
}

/// A model of this number of handles. Each of its parts tells the model and the place of the part.
fn sized(sequence: u64, handles: u8) -> LocalModel {
    let mut model = model(sequence);
    model.head.handle_count = handles;
    let tell = |place: usize| sequence as f64 + 0.01 * place as f64;
    for (i, handle) in model.handles.iter_mut().enumerate() {
        handle.pose.position = Vec3::repeat(tell(i));
        for j in 0..MAX_HANDLES {
            model.stiffness[i][j] = Mat6::repeat(tell(10 * i + j));
            model.damping[i][j] = Mat6::repeat(-tell(10 * i + j));
        }
    }
    model
}

/// Whether the used part of a model is that of [`sized`].
fn is_sized(model: &LocalModel) -> bool {
    let mut expected = LocalModel::empty();
    expected.copy_used_from(&sized(model.head.sequence, model.head.handle_count));
    let mut found = LocalModel::empty();
    found.copy_used_from(model);
    found == expected
}

proptest! {
    /// A ring of three models, and the copies of six for the log, under any order of writing and reading: the number of
    /// waiting models alone decides whether a model finds room, whatever the number of handles of each.
    #[test]
    fn models_of_any_size_pass_whole_and_in_order(
        deeds in proptest::collection::vec((0..4_u8, 0..7_u8), 1..300),
    ) {
        let (mut tick, mut host, mut log) = small();
        let (mut sequence, mut waiting, mut newest) = (0, 0, 0);
        let mut copies = Vec::new();
        for (deed, handles) in deeds {
            match deed {
                0 => {
                    let mut taken = None;
                    tick.take_models(|body, packed| {
                        let mut model = LocalModel::empty();
                        model.copy_used_from(packed);
                        assert!(body == 0 && is_sized(&model));
                        taken = Some(model.head.sequence);
                    });
                    prop_assert_eq!(taken, (waiting > 0).then_some(newest));
                    waiting = 0;
                }
                1 => {
                    let mut read = Vec::new();
                    log.records(|record| if let LogRecord::Model(0, model) = record {
                        assert!(is_sized(model));
                        read.push(model.head.sequence);
                    });
                    prop_assert_eq!(&read, &copies);
                    copies.clear();
                }
                _ => {
                    sequence += 1;
                    if copies.len() < 6 {
                        copies.push(sequence);
                    }
                    // Six stands for a number of handles that no model can have.
                    let handles = if handles == 6 { u8::MAX } else { handles };
                    let refused = host.publish(0, &sized(sequence, handles)).is_err();
                    prop_assert_eq!(refused, waiting == 3);
                    if !refused {
                        (waiting, newest) = (waiting + 1, sequence);
                    }
                }
            }
        }
    }
}

#[test]
fn models_cross_threads_whole() {
    const MODELS: u64 = 20_000;
    let (mut tick, mut host, log) = small();
    drop(log);
    let writer = std::thread::spawn(move || {
        for sequence in 1..=MODELS {
            // A full ring refuses the model.
            let _ = host.publish(0, &sized(sequence, (sequence % 5) as u8));
        }
        host.refused_models()
    });
    let (mut taken, mut last) = (0, 0);
    loop {
        let over = tick.host_is_gone();
        tick.take_models(|_, packed| {
            let mut model = LocalModel::empty();
            model.copy_used_from(packed);
            assert!(is_sized(&model) && model.head.sequence > last);
            last = model.head.sequence;
            taken += 1;
        });
        if over {
            break;
        }
        std::thread::yield_now();
    }
    let refused = writer.join().expect("the writer does not panic");
    assert_eq!(taken + tick.counters().superseded_models + refused, MODELS);
}

#[test]
fn a_refused_model_is_named_counted_and_missed() {
    let (mut tick, mut host, _log) = small();
    for sequence in 1..=3 {
        assert_eq!(host.publish(0, &model(sequence)), Ok(()));
    }
    for sequence in 4..=5 {
        assert_eq!(
            host.publish(0, &model(sequence)),
            Err(RingFull {
                kind: "local model of body",
                body: 0,
                capacity: 3
            })
        );
    }
    assert_eq!(
        host.publish(7, &model(1)),
        Err(RingFull {
            kind: "local model of body",
            body: 7,
            capacity: 0
        })
    );
    assert_eq!(host.refused_models(), 3);
    tick.take_models(|_, _| ());
    assert_eq!(host.publish(0, &model(6)), Ok(()));
    tick.take_models(|_, model| assert_eq!(model.head.sequence, 6));
    // A gap counts once, however many models follow.
    assert_eq!(host.publish(0, &model(7)), Ok(()));
    tick.take_models(|_, model| assert_eq!(model.head.sequence, 7));
    assert_eq!(
        (
            tick.counters().lost_models,
            tick.counters().superseded_models
        ),
        (2, 2)
    );
}

#[test]
fn each_end_sees_that_the_other_is_gone() {
    let (mut tick, host, log) = small();
    assert!(!tick.host_is_gone() && !tick.log_is_gone());
    drop(log);
    drop(host);
    assert!(tick.host_is_gone() && tick.log_is_gone());
    // Refusals no longer count, because there is no reader.
    for k in 0..20 {
        tick.push(&telemetry(k));
    }
    assert_eq!(
        tick.counters().refused_records + tick.counters().refused_telemetry,
        0
    );

    let (mut tick, mut host, mut log) = small();
    tick.push(&telemetry(0));
    assert!(!host.tick_is_gone() && !log.tick_is_gone());
    drop(tick);
    assert!(host.tick_is_gone() && log.tick_is_gone());
    // The records that were left in the rings are still there.
    assert_eq!((host.drain(|_| ()), log.drain(|_| ())), (1, 1));
}

#[test]
fn five_seconds_of_stall_fit() {
    let (mut tick, mut host, mut log) = link(&LinkConfig::new(1000.0, 60.0));
    for k in 0..5000 {
        tick.push(&telemetry(k));
    }
    for sequence in 1..=300 {
        assert_eq!(host.publish(0, &model(sequence)), Ok(()));
    }
    let counters = tick.counters();
    assert_eq!(
        (counters.refused_records, counters.refused_telemetry),
        (0, 0)
    );
    let mut next = 0;
    let read = host.drain(|record| {
        assert_eq!(record.tick, next);
        next += 1;
    });
    assert_eq!((read, log.drain(|_| ())), (5000, 5000));
    let mut taken = 0;
    tick.take_models(|_, model| taken = model.head.sequence);
    assert_eq!((taken, tick.counters().superseded_models), (300, 299));
    let bytes: usize = tick
        .memory()
        .iter()
        .map(runner::memory::MemoryRange::bytes)
        .sum();
    let records = 5001 * (size_of::<Telemetry>() + size_of::<rt_core::TickRecord>());
    assert!(bytes >= records + 301 * size_of::<LocalModel>());
}

#[test]
fn senseless_sizes_give_small_rings_and_no_panic() {
    for rate in [f64::NAN, -1.0, 0.0] {
        let (mut tick, mut host, _log) = link(&LinkConfig {
            bodies: 99,
            ..LinkConfig::new(rate, rate)
        });
        assert_eq!(tick.bodies(), MAX_BODIES);
        tick.push(&telemetry(0));
        assert_eq!(host.drain(|_| ()), 1);
    }
    assert_eq!(slots_for(f64::INFINITY, 5.0), runner::ring::MOST_SLOTS);
}

#[test]
fn records_cross_threads_whole_and_in_order() {
    const RECORDS: u64 = 20_000;
    let (mut tick, mut host, log) = small();
    drop(log);
    let writer = std::thread::spawn(move || {
        for k in 0..RECORDS {
            tick.push(&telemetry(k));
        }
        tick.counters().refused_records
    });
    let (mut seen, mut last) = (0, None);
    loop {
        let over = host.tick_is_gone();
        host.drain(|record| {
            assert!(last.is_none_or(|last| record.tick > last));
            assert_eq!(record.time_ns, record.tick * 1_000_000);
            last = Some(record.tick);
            seen += 1;
        });
        if over {
            break;
        }
        std::thread::yield_now();
    }
    let refused = writer.join().expect("the writer does not panic");
    assert_eq!(seen + refused, RECORDS);
    // Records refused after the last arrival leave no gap.
    let tail = last.map_or(RECORDS, |last| RECORDS - 1 - last);
    assert_eq!(host.lost_records(), refused - tail);
}

/// A number for each record; models and patches have negative numbers.
fn numbers(log: &mut LogEnd) -> Vec<i64> {
    let mut seen = Vec::new();
    log.records(|record| {
        seen.push(match record {
            LogRecord::Model(body, model) => {
                -((100 * u64::from(body) + model.head.sequence) as i64)
            }
            LogRecord::Patch(device, patch) => {
                -((1000 + 100 * u64::from(device) + patch.head.sequence) as i64)
            }
            LogRecord::Tick(telemetry) => telemetry.tick as i64,
        });
    });
    seen
}

#[test]
fn the_log_gets_each_model_before_the_tick_that_used_it() {
    let (mut tick, mut host, mut log) = small();
    tick.push(&telemetry(0));
    host.publish(0, &model(1)).expect("room");
    host.publish(1, &model(1)).expect("room");
    tick.take_models(|_, _| ());
    tick.push(&telemetry(1));
    assert_eq!(numbers(&mut log), [-1, -101, 0, 1]);
    // A reader of ticks alone discards the models.
    host.publish(0, &model(2)).expect("room");
    tick.push(&telemetry(2));
    assert_eq!(log.drain(|record| assert_eq!(record.tick, 2)), 1);
    assert_eq!(numbers(&mut log), Vec::<i64>::new());
}

#[test]
fn copies_of_models_that_the_log_has_no_room_for_are_counted_and_cost_the_tick_nothing() {
    let (mut tick, mut host, log) = small();
    // The rings of two bodies hold three models each: the seventh copy finds no room.
    for sequence in 1..=9 {
        host.publish(0, &model(sequence))
            .expect("the tick takes them");
        let mut taken = 0;
        tick.take_models(|_, model| taken = model.head.sequence);
        assert_eq!(taken, sequence);
    }
    assert_eq!((host.refused_copies(), host.refused_models()), (3, 0));
    // Refusals no longer count once the log is gone.
    drop(log);
    host.publish(0, &model(10)).expect("the tick takes it");
    assert_eq!(host.refused_copies(), 3);
}

#[test]
fn the_log_has_room_for_as_many_copies_however_many_handles_they_have() {
    // A small model at the start shifts the places of the others, so that one of them skips the end of the ring.
    for first in 1..=MAX_HANDLES as u8 {
        let (mut tick, mut host, mut log) = small();
        let mut publish = |sequence, handles| {
            host.publish(0, &sized(sequence, handles))
                .expect("the tick takes them");
            tick.take_models(|_, _| ());
            host.refused_copies()
        };
        assert_eq!(publish(1, first), 0);
        assert_eq!(numbers(&mut log), [-1]);
        for sequence in 2..=7 {
            assert_eq!(publish(sequence, MAX_HANDLES as u8), 0, "{first}");
        }
        assert_eq!(numbers(&mut log), [-2, -3, -4, -5, -6, -7]);
    }
}

/// The host sends a model of more handles than the link was made for.
#[test]
fn a_model_that_is_larger_than_the_rings_is_taken_whole_or_refused() {
    let rates = LinkConfig {
        handles: 1,
        stall: 1.0,
        ..LinkConfig::new(4.0, 2.0)
    };
    let (mut tick, mut host, _log) = link(&rates);
    let mut taken = |host: &mut HostEnd, sequence, handles| {
        let sent = host.publish(0, &sized(sequence, handles));
        let mut whole = None;
        tick.take_models(|_, model| {
            let mut found = LocalModel::empty();
            found.copy_used_from(model);
            whole = Some(is_sized(&found) && found.head.sequence == sequence);
        });
        (sent.is_ok(), whole)
    };
    // Eight blocks fill their ring; eighteen have no room.
    assert_eq!(taken(&mut host, 1, 2), (true, Some(true)));
    assert_eq!(taken(&mut host, 2, 3), (false, None));
    assert_eq!(taken(&mut host, 3, 1), (true, Some(true)));
}

/// Room for three patches for each of the tools on devices 1 and 3.
fn with_tools() -> (TickEnd, HostEnd, LogEnd) {
    let mut rates = LinkConfig {
        stall: 1.0,
        ..LinkConfig::new(4.0, 2.0)
    };
    (rates.tools[1], rates.tools[3]) = (true, true);
    link(&rates)
}

/// A patch of this number of sites. Each of its parts tells the patch and the place of the part.
fn patch(sequence: u64, sites: u8) -> Patch {
    let mut patch = Patch::empty();
    patch.head.sequence = sequence;
    (patch.head.site_count, patch.head.triangle_count) = (sites, 1);
    patch.head.triangles[0] = Triangle {
        corners: [0, 1, 2],
        friction: sequence as f64,
    };
    let tell = |place: usize| sequence as f64 + 0.001 * place as f64;
    for (i, site) in patch.sites.iter_mut().enumerate().take(sites.into()) {
        site.place = Vec3::repeat(tell(i));
        for (j, block) in patch.compliance[i]
            .iter_mut()
            .enumerate()
            .take(sites.into())
        {
            block.fill(tell(20 * i + j));
        }
    }
    patch
}

#[test]
fn one_take_gives_the_newest_patch_of_each_tool_whole() {
    let (mut tick, mut host, mut log) = with_tools();
    for (sequence, sites) in [(1, 16), (2, 3), (3, 7)] {
        assert_eq!(host.publish_patch(1, &patch(sequence, sites)), Ok(()));
    }
    assert_eq!(host.publish_patch(3, &patch(1, 16)), Ok(()));
    let mut taken = Vec::new();
    tick.take_patches(|device, packed| {
        let mut found = Patch::empty();
        found.copy_used_from(packed);
        taken.push((device, found));
    });
    let expected =
        Vec::from_iter([(1, 3, 7), (3, 1, 16)].map(|(device, k, n)| (device, patch(k, n))));
    assert!(taken == expected);
    let counters = tick.counters();
    assert_eq!((counters.superseded_patches, counters.lost_patches), (2, 0));
    assert_eq!((counters.superseded_models, counters.lost_models), (0, 0));
    tick.take_patches(|_, _| panic!("all have been let go"));
    // A gap in the numbers shows, of this tool alone.
    assert_eq!(host.publish_patch(1, &patch(6, 0)), Ok(()));
    tick.take_patches(|device, packed| assert_eq!((device, packed.head.sequence), (1, 6)));
    assert_eq!(tick.counters().lost_patches, 2);
    tick.push(&telemetry(0));
    assert_eq!(numbers(&mut log), [-1101, -1102, -1103, -1301, -1106, 0]);
}

#[test]
fn a_patch_without_a_place_is_refused_and_counted() {
    let (mut tick, mut host, log) = with_tools();
    for sequence in 1..=3 {
        assert_eq!(host.publish_patch(1, &patch(sequence, 16)), Ok(()));
    }
    for (device, capacity) in [(1, 3), (0, 0), (2, 0), (MAX_DEVICES, 0)] {
        let full = RingFull {
            kind: "patch of device",
            body: device,
            capacity,
        };
        assert_eq!(host.publish_patch(device, &patch(4, 16)), Err(full));
    }
    assert_eq!((host.refused_patches(), host.refused_models()), (4, 0));
    // The other tool has its own ring.
    assert_eq!(host.publish_patch(3, &patch(1, 16)), Ok(()));
    let mut taken = Vec::new();
    tick.take_patches(|device, packed| taken.push((device, packed.head.sequence)));
    assert_eq!(taken, [(1, 3), (3, 1)]);
    drop(log);
    assert_eq!(host.publish_patch(1, &patch(5, 16)), Ok(()));
    // A link without tools refuses all patches.
    let (mut tick, mut host, _log) = small();
    assert!(host.publish_patch(0, &patch(1, 1)).is_err());
    tick.take_patches(|_, _| panic!("there is none"));
}
