//! A device that follows a script, and a controller for it.

// Each test file uses a part of this module.
#![allow(dead_code)]

use devices::scripted::{Scripted, small};
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Controller, ControllerConfig, DeviceState, Freedom, HandleReference, LocalModel, MAX_DEVICES,
    PassivityConfig, Scheme, Vec3, Wrench,
};
use runner::AnyDevice;
use std::sync::{Arc, Mutex, MutexGuard};

/// The action of a [`puppet`] in one of its reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trick {
    None,
    /// Spins for this time (ns) in the read with this number.
    Spin(u64, u64),
    /// Panics in the read with this number.
    Panic(u64),
    /// Makes a needless system call in the read with this number.
    Call(u64),
    /// Allocates more memory than the heap has in the read with this number.
    Allocate(u64),
}

/// The calls that a puppet received, for the test that watches it.
#[derive(Debug)]
pub(crate) struct Seen {
    pub(crate) reads: u64,
    pub(crate) writes: u64,
    pub(crate) last: Option<Wrench>,
    pub(crate) times_ns: Vec<u64>,
}

/// A device that stands still but for its trick, and what it meets: to be seen after a panic as well.
pub(crate) fn puppet(trick: Trick) -> (AnyDevice, Arc<Mutex<Seen>>) {
    let seen = Arc::new(Mutex::new(Seen {
        reads: 0,
        writes: 0,
        last: None,
        times_ns: Vec::with_capacity(10_000),
    }));
    let (by_read, by_write) = (Arc::clone(&seen), Arc::clone(&seen));
    let read = move |now_ns| {
        let reads = {
            let mut seen = lock(&by_read);
            seen.reads += 1;
            seen.times_ns.push(now_ns);
            seen.reads
        };
        do_trick(trick, reads);
        Ok(DeviceState {
            device_time_ns: now_ns,
            ..DeviceState::resting()
        })
    };
    let write = move |_, wrench: &Wrench| {
        let mut seen = lock(&by_write);
        seen.writes += 1;
        seen.last = Some(*wrench);
        Ok(())
    };
    let device = Scripted::new(small(Freedom::Three), read, write);
    (Box::new(device), seen)
}

pub(crate) fn lock(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().expect("nothing panics while it is held")
}

fn do_trick(trick: Trick, reads: u64) {
    match trick {
        Trick::Spin(read, ns) if read == reads => {
            let end = runner::clock::now_ns() + ns;
            while runner::clock::now_ns() < end {}
        }
        Trick::Panic(read) if read == reads => panic!("the cable was cut"),
        Trick::Call(read) if read == reads => {
            std::hint::black_box(rustix::process::getppid());
        }
        Trick::Allocate(read) if read == reads => {
            let taken = vec![1_u8; 64 << 20];
            assert_eq!(std::hint::black_box(&taken)[1 << 20], 1);
        }
        _ => {}
    }
}

/// A controller for `devices` devices and one body, at 1 kHz.
pub(crate) fn controller(devices: usize) -> Controller {
    let mut config = ControllerConfig::default();
    for _ in 0..devices {
        let safety = SafetyConfig {
            actuated: Freedom::Three,
            max_force: 8.0,
            max_moment: 0.0,
            patience: 3,
            decay: 0.1,
            recovery: 0.1,
            ..SafetyConfig::unlimited(1e-3)
        };
        let device = DeviceConfig {
            frame: DeviceFrame::at(Vec3::zeros()),
            safety,
        };
        assert!(config.devices.push(device).is_ok());
    }
    let body = CouplingConfig {
        scheme: Scheme::Linear,
        period: 1e-3,
        blend: 0.5,
        age_limit: 1000.0,
        decay: 0.1,
        recovery: 0.01,
        hold_damping: [1.0; MAX_DEVICES],
        passivity: PassivityConfig::new(1e-3),
    };
    assert!(config.bodies.push(body).is_ok());
    Controller::new(&config)
}

/// A model of one handle that pushes with one newton along x at every pose.
pub(crate) fn pushing(sequence: u64, time_ns: u64) -> LocalModel {
    let mut model = LocalModel {
        sequence,
        time_ns,
        period: 0.01,
        ..LocalModel::empty()
    };
    model.handle_count = 1;
    model.handles[0] = HandleReference {
        wrench: Wrench {
            force: Vec3::new(1.0, 0.0, 0.0),
            moment: Vec3::zeros(),
        },
        ..HandleReference::zero()
    };
    model
}
