//! One tick: `cargo bench --bench tick`.
//!
//! **Law** (divan): `Controller::tick` alone, per force scheme, for one body with 1, 2 or 4 handles, each
//! held by a device that moves and turns (one that does not turn costs less). Three kinds of tick:
//! between models, in the middle of a blend, and the tick that checks and takes in a new model, which is
//! the dearest.
//!
//! **Whole** (a table): every tick of the first seconds of the built-in scene, two simulated devices
//! behind their firmware reports on one sheet, with the models that its host published. The same ticks
//! run whole, from recorded readings in the place of the devices, as the law alone, and as the devices
//! alone; one after the other in one process, so that the parts can be compared.

#[path = "../common/mod.rs"]
mod common;
mod recording;
mod whole;

use common::tables_wanted;
use divan::{Bencher, black_box};
use nalgebra::UnitQuaternion;
use rt_core::controller::{DeviceConfig, Reading};
use rt_core::coupling::CouplingConfig;
use rt_core::proxy::Proxy;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Controller, ControllerConfig, DeviceState, Freedom, LocalModel, MAX_DEVICES, MAX_HANDLES, Mat6,
    Pose, Scheme, Twist, Vec3,
};

const SCHEMES: [&str; 3] = ["hold", "thesis", "linear"];
const HANDLES: [usize; 3] = [1, 2, 4];
/// Ticks until every smooth start is over.
const SETTLE: usize = 300;
/// When the law's ticks happen (ns); the model is young then.
const NOW_NS: u64 = 2_000_000;

fn main() {
    if tables_wanted() {
        whole::print();
    }
    divan::main();
}

fn scheme(name: &str) -> Scheme {
    match name {
        "hold" => Scheme::Hold,
        "thesis" => Scheme::Thesis {
            stiffness: 200.0,
            damping: 1.0,
        },
        _ => Scheme::Linear,
    }
}

fn law(scheme: Scheme, handles: usize) -> Controller {
    let period = 1e-3;
    let mut config = ControllerConfig::default();
    for _ in 0..handles {
        let device = DeviceConfig {
            proxy: Proxy {
                rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.0, 0.0, 1.0)),
                ..Proxy::at(Vec3::zeros())
            },
            safety: SafetyConfig {
                actuated: Freedom::Six,
                max_force: 100.0,
                max_moment: 10.0,
                patience: 10,
                recovery: 0.2,
                period,
            },
        };
        let _ = config.devices.push(device);
    }
    let _ = config.bodies.push(CouplingConfig {
        scheme,
        period,
        blend: 0.5,
        age_limit: 0.1,
        decay: 0.3,
        recovery: 0.2,
        hold_damping: 2.0,
    });
    Controller::new(&config)
}

/// A model whose every block is full.
fn model(handles: usize, period: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.sequence = 1;
    model.time_ns = 1_000_000;
    model.period = period;
    model.handle_count = handles as u8;
    for i in 0..MAX_HANDLES {
        model.handles[i].device = i as u8;
        for j in 0..MAX_HANDLES {
            let own = if i == j { 100.0 } else { -20.0 };
            model.stiffness[i][j] = Mat6::from_fn(|r, c| own / (1.0 + r.abs_diff(c) as f64));
            model.damping[i][j] = model.stiffness[i][j] * 0.01;
        }
    }
    model
}

/// 64 different sets of readings, to be cycled through.
fn readings() -> Vec<[Reading; MAX_DEVICES]> {
    let reading = |k: usize, device: usize| {
        let s = (k as f64 + 10.0 * device as f64) * 0.1;
        let axis = Vec3::new(s.sin(), s.cos(), 0.5);
        Ok(DeviceState {
            pose: Pose {
                position: axis * 0.01,
                rotation: UnitQuaternion::from_scaled_axis(axis * 0.2),
            },
            twist: Twist {
                linear: axis * 0.1,
                angular: axis,
            },
            ..DeviceState::resting()
        })
    };
    (0..64)
        .map(|k| core::array::from_fn(|device| reading(k, device)))
        .collect()
}

/// Measures ticks that follow a model of this publication period (s).
fn ticks(bencher: Bencher, scheme_name: &str, handles: usize, publication: f64) {
    let mut law = law(scheme(scheme_name), handles);
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

/// A model that is published once in years takes as long to take over.
#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000, sample_size = 16)]
fn law_in_a_blend<const N: usize>(bencher: Bencher, scheme: &str) {
    ticks(bencher, scheme, N, 1e9);
}

#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000, sample_size = 16)]
fn law_taking_a_model<const N: usize>(bencher: Bencher, name: &str) {
    let mut law = law(scheme(name), N);
    let mut model = model(N, 0.004);
    let readings = readings();
    let mut readings = readings.iter().cycle();
    bencher.bench_local(|| {
        model.sequence += 1;
        model.time_ns += 1;
        let accepted = law.accept(0, black_box(&model));
        (
            accepted,
            readings
                .next()
                .map(|r| law.tick(model.time_ns, black_box(r))),
        )
    });
}
