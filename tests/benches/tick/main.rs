//! One tick: `cargo bench --bench tick`.
//!
//! **Law** (divan): `Controller::tick` alone, for each scheme, for one body with 1, 2 or 4 handles. Each handle is held
//! by a device that moves and turns; a device that does not turn costs less. There are three kinds of tick: between
//! models, in the middle of a blend, and the tick that checks and accepts a new model, which is the most expensive.
//!
//! **Whole** (a table): every tick of the first seconds of the built-in scene, with two simulated devices behind their
//! firmware reports on one sheet, and the models that its host published. The same ticks run whole, with recorded
//! readings instead of the devices, as the law alone, and as the devices alone. They run one after the other in one
//! process, so that the parts can be compared.

#[path = "../common/mod.rs"]
mod common;
mod recording;
mod whole;

use common::tables_wanted;
use divan::{Bencher, black_box};
use palpate_tests::law::{HANDLES, Limits, SCHEMES, law, model, reading, scheme};
use rt_core::MAX_DEVICES;
use rt_core::Reading;

/// Ticks until every smooth start has ended.
const SETTLE: usize = 300;
/// Time of the measured ticks (ns), at which the model is young.
const NOW_NS: u64 = 2_000_000;

fn main() {
    if tables_wanted() {
        whole::print();
    }
    divan::main();
}

/// 64 different sets of readings, which are used in turn.
fn readings() -> Vec<[Reading; MAX_DEVICES]> {
    (0..64).map(|k| reading(0.1 * f64::from(k))).collect()
}

/// Measures ticks that follow a model of this publication period (s).
fn ticks(bencher: Bencher, scheme_name: &str, handles: usize, publication: f64) {
    let mut law = law(scheme(scheme_name), handles, Limits::WIDE);
    assert_eq!(law.accept(0, &model(handles, publication)), Ok(()));
    let readings = readings();
    let mut readings = readings.iter().cycle();
    let mut tick = move || readings.next().map(|r| law.tick(NOW_NS, black_box(r)));
    for _ in 0..SETTLE {
        tick();
    }
    bencher.bench_local(tick);
}

#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000, sample_size = 16)]
fn law_between_models<const N: usize>(bencher: Bencher, scheme: &str) {
    ticks(bencher, scheme, N, 0.004);
}

/// A model with a publication period of years blends in equally slowly.
#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000, sample_size = 16)]
fn law_in_a_blend<const N: usize>(bencher: Bencher, scheme: &str) {
    ticks(bencher, scheme, N, 1e9);
}

#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000, sample_size = 16)]
fn law_taking_a_model<const N: usize>(bencher: Bencher, name: &str) {
    let mut law = law(scheme(name), N, Limits::WIDE);
    let mut model = model(N, 0.004);
    let readings = readings();
    let mut readings = readings.iter().cycle();
    bencher.bench_local(|| {
        model.head.sequence += 1;
        model.head.time_ns += 1;
        let accepted = law.accept(0, black_box(&model));
        (
            accepted,
            readings
                .next()
                .map(|r| law.tick(model.head.time_ns, black_box(r))),
        )
    });
}
