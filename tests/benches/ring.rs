//! The rings between the tick and the rest: `cargo bench --bench ring`.
//!
//! **divan**: both ends of a link of 1 kHz ticks and 60 Hz models of two handles in one thread. It measures the cost to
//! push a record and to take it out again, without the transfer between two cores. Records are read in place. The
//! benchmark of the tick includes the acceptance of a model.
//!
//! A **line** adds the transfer: one thread pushes a tick's record; another thread sees the record and publishes a
//! model; the first thread waits until it has copied the model. Both threads spin. The line needs two free cores, and
//! its upper percentiles show the other load on these cores.

mod common;

use common::{Spread, tables_wanted};
use divan::{Bencher, black_box};
use palpate_tests::law::model;
use rt_core::{LocalModel, Telemetry, TickRecord};
use runner::link::{HostEnd, LinkConfig, LogEnd, TickEnd, link};
use std::cell::RefCell;
use std::time::{Duration, Instant};

/// Number of handles of the models.
const HANDLES: usize = 2;

fn main() {
    if tables_wanted() {
        println!(
            "Sizes in bytes: TickRecord {}, Telemetry {}, LocalModel {}.\n",
            size_of::<TickRecord>(),
            size_of::<Telemetry>(),
            size_of::<LocalModel>()
        );
        between_threads();
    }
    divan::main();
}

fn ends() -> (TickEnd, HostEnd, LogEnd) {
    link(&LinkConfig::new(1000.0, 60.0))
}

/// No record is written for an end that is gone, so each ring can be measured alone.
#[divan::bench(sample_count = 1000)]
fn tick_record_there_and_back(bencher: Bencher) {
    let (mut tick, mut host, _) = ends();
    let telemetry = Telemetry::empty();
    bencher.bench_local(|| {
        tick.push(black_box(&telemetry));
        host.drain(|record| {
            black_box(record);
        })
    });
}

#[divan::bench(sample_count = 1000)]
fn telemetry_there_and_back(bencher: Bencher) {
    let (mut tick, _, mut log) = ends();
    let telemetry = Telemetry::empty();
    bencher.bench_local(|| {
        tick.push(black_box(&telemetry));
        log.drain(|record| {
            black_box(record);
        })
    });
}

/// The pushes of one sample fit into the ring, which is emptied between samples.
#[divan::bench(sample_count = 1000, sample_size = 64)]
fn telemetry_push(bencher: Bencher) {
    let (mut tick, _, mut log) = ends();
    let telemetry = Telemetry::empty();
    bencher
        .with_inputs(|| log.drain(|_| {}))
        .bench_local_values(|_| tick.push(black_box(&telemetry)));
}

/// The pushes of a tick: both records.
#[divan::bench(sample_count = 1000, sample_size = 64)]
fn both_pushes(bencher: Bencher) {
    let (mut tick, mut host, mut log) = ends();
    let telemetry = Telemetry::empty();
    bencher
        .with_inputs(|| host.drain(|_| {}) + log.drain(|_| {}))
        .bench_local_values(|_| tick.push(black_box(&telemetry)));
}

/// The end of the host, with a model that is published repeatedly.
struct Publisher {
    host: HostEnd,
    model: LocalModel,
}

impl Publisher {
    fn publish(&mut self) {
        self.model.head.sequence += 1;
        // A full ring would refuse the model; no ring is full here.
        let _ = self.host.publish(0, black_box(&self.model));
    }
}

fn publisher() -> (TickEnd, RefCell<Publisher>) {
    let (tick, host, _) = ends();
    let model = model(HANDLES, 1.0 / 60.0);
    (tick, RefCell::new(Publisher { host, model }))
}

fn take(tick: &mut TickEnd) {
    tick.take_models(|body, model| {
        black_box((body, model));
    });
}

/// Publishes the last of `waiting` models, and then takes the newest of them.
#[divan::bench(args = [1, 300], sample_count = 2000, sample_size = 1)]
fn local_model_there_and_back(bencher: Bencher, waiting: usize) {
    let (mut tick, publisher) = publisher();
    bencher
        .with_inputs(|| (1..waiting).for_each(|_| publisher.borrow_mut().publish()))
        .bench_local_values(|()| {
            publisher.borrow_mut().publish();
            take(&mut tick);
        });
}

#[divan::bench(args = [0, 1, 300], sample_count = 2000, sample_size = 1)]
fn take_models(bencher: Bencher, waiting: usize) {
    let (mut tick, publisher) = publisher();
    bencher
        .with_inputs(|| (0..waiting).for_each(|_| publisher.borrow_mut().publish()))
        .bench_local_values(|()| take(&mut tick));
}

/// Prints the time of a record to another thread and a model back.
fn between_threads() {
    const ROUNDS: u64 = 20_000;
    const LONGEST: Duration = Duration::from_secs(5);
    if std::thread::available_parallelism().map_or(1, usize::from) < 2 {
        println!("A record to another thread and a model back: needs two cores.\n");
        return;
    }
    let (mut tick, host, _) = ends();
    let model = model(HANDLES, 1.0 / 60.0);
    let mut other = Publisher { host, model };
    let times = std::thread::scope(|scope| {
        scope.spawn(move || {
            while !other.host.tick_is_gone() {
                if let Some(record) = other.host.newest() {
                    other.model.head.time_ns = record.time_ns;
                    other.publish();
                }
                std::hint::spin_loop();
            }
        });
        let mut telemetry = Telemetry::empty();
        let mut newest = LocalModel::empty();
        let mut times = Vec::new();
        let begin = Instant::now();
        while telemetry.tick < ROUNDS && begin.elapsed() < LONGEST {
            telemetry.time_ns += 1;
            let start = Instant::now();
            tick.push(&telemetry);
            let mut returned = false;
            while !returned {
                tick.take_models(|_, model| {
                    newest.copy_used_from(black_box(model));
                    returned = newest.head.time_ns == telemetry.time_ns;
                });
                std::hint::spin_loop();
            }
            times.push(start.elapsed().as_secs_f64());
            black_box(&newest);
            telemetry.tick += 1;
        }
        drop(tick);
        times
    });
    let count = times.len();
    let spread = Spread::of(times).times(1e6);
    println!("A TickRecord to another thread and a LocalModel back, both spinning, {count} times:");
    println!("{spread:.2} us, median (10th to 90th percentile), wall time.\n");
}
