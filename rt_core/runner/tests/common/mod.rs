//! A device that follows a script, and a controller for it.

// Each test file uses a part of this module.
#![allow(dead_code)]

use devices::scripted::{Scripted, small};
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::hull::Hull;
use rt_core::local_model::ModelHead;
use rt_core::safety::SafetyConfig;
use rt_core::tool::{Patch, ToolConfig, ToolCouplingConfig};
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, Freedom, HandleReference, LocalModel,
    MAX_DEVICES, PassivityConfig, Scheme, Vec3, Wrench,
};
use runner::AnyDevice;
use runner::clock::now_ns;
use rustix::io::Errno;
use std::sync::{Arc, Mutex, MutexGuard};

/// A system call, and its outcome.
pub(crate) type Call = fn() -> Result<(), Errno>;

/// The action of a [`puppet`] in some of its reads or writes. Their numbers begin with one.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Trick {
    None,
    /// Spins for this time (ns) in the read with this number.
    Spin(u64, u64),
    /// Panics in the read with this number.
    Panic(u64),
    /// Makes a system call in the read with this number.
    Call(u64, Call),
    /// Allocates more memory than the heap has in the read with this number.
    Allocate(u64),
    /// Panics in the writes from this number on.
    PanicInWrites(u64),
    /// Refuses the writes from this number on.
    RefuseWrites(u64),
}

/// The calls that a puppet received, for the test that watches the puppet.
#[derive(Debug)]
pub(crate) struct Seen {
    pub(crate) reads: u64,
    pub(crate) writes: u64,
    pub(crate) last: Option<Wrench>,
    /// The time that each read was given (ns).
    pub(crate) times_ns: Vec<u64>,
    /// The wrench of each write.
    pub(crate) wrenches: Vec<Wrench>,
    /// The clock at each read, and at each write (ns).
    pub(crate) read_at: Vec<u64>,
    pub(crate) written_at: Vec<u64>,
    /// The outcome of the call of [`Trick::Call`].
    pub(crate) called: Option<Result<(), Errno>>,
}

/// A device that stands still except for its trick, and the calls that it received, which outlive a panic.
pub(crate) fn puppet(trick: Trick) -> (AnyDevice, Arc<Mutex<Seen>>) {
    // No tick allocates.
    const ROOM: usize = 10_000;
    let seen = Arc::new(Mutex::new(Seen {
        reads: 0,
        writes: 0,
        last: None,
        times_ns: Vec::with_capacity(ROOM),
        wrenches: Vec::with_capacity(ROOM),
        read_at: Vec::with_capacity(ROOM),
        written_at: Vec::with_capacity(ROOM),
        called: None,
    }));
    let (by_read, by_write) = (Arc::clone(&seen), Arc::clone(&seen));
    let read = move |time_ns| {
        let reads = {
            let mut seen = lock(&by_read);
            seen.reads += 1;
            seen.times_ns.push(time_ns);
            seen.read_at.push(now_ns());
            seen.reads
        };
        if let Some(outcome) = do_trick(trick, reads) {
            lock(&by_read).called = Some(outcome);
        }
        Ok(DeviceState {
            device_time_ns: time_ns,
            ..DeviceState::resting()
        })
    };
    let write = move |_, wrench: &Wrench| {
        let writes = {
            let mut seen = lock(&by_write);
            seen.writes += 1;
            seen.last = Some(*wrench);
            seen.wrenches.push(*wrench);
            seen.written_at.push(now_ns());
            seen.writes
        };
        match trick {
            Trick::PanicInWrites(from) if writes >= from => panic!("the motor was cut"),
            Trick::RefuseWrites(from) if writes >= from => Err(DeviceError::Busy),
            _ => Ok(()),
        }
    };
    let device = Scripted::new(small(Freedom::Three), read, write);
    (Box::new(device), seen)
}

pub(crate) fn lock(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().expect("nothing panics while it is held")
}

/// The outcome is that of a system call, if the trick makes one.
fn do_trick(trick: Trick, reads: u64) -> Option<Result<(), Errno>> {
    match trick {
        Trick::Spin(read, ns) if read == reads => {
            let end = now_ns() + ns;
            while now_ns() < end {}
        }
        Trick::Panic(read) if read == reads => panic!("the cable was cut"),
        Trick::Call(read, call) if read == reads => return Some(call()),
        Trick::Allocate(read) if read == reads => {
            let taken = vec![1_u8; 64 << 20];
            assert_eq!(std::hint::black_box(&taken)[1 << 20], 1);
        }
        _ => {}
    }
    None
}

/// A controller for `devices` devices, each with a tool, and one body, at 1 kHz.
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
    let tool = ToolCouplingConfig {
        tool: ToolConfig {
            turns: true,
            hull: Hull::POINT,
            radius: 5e-3,
            period: 1e-3,
            stiffest: 1e3,
            most_damping: 10.0,
            parting: 0.02,
        },
        age_limit: 1000.0,
        decay: 0.1,
        recovery: 0.01,
        hold_damping: 1.0,
        take_buttons: 0,
        passivity: PassivityConfig::new(1e-3),
    };
    for place in config.tools.iter_mut().take(devices) {
        *place = Some(tool);
    }
    Controller::new(&config)
}

/// A patch of an obstacle on which a ball of the tool at the origin rests, 1 mm deep.
pub(crate) fn floor(sequence: u64, time_ns: u64) -> Patch {
    let mut patch = Patch::empty();
    (patch.head.sequence, patch.head.time_ns) = (sequence, time_ns);
    (patch.head.site_count, patch.head.triangle_count) = (3, 1);
    patch.head.period = 0.01;
    patch.head.triangles[0].corners = [0, 1, 2];
    patch.head.floor.fill_diagonal(1e-3);
    for (site, place) in patch
        .sites
        .iter_mut()
        .zip([[-0.1, -0.1], [0.1, -0.1], [0.0, 0.1]])
    {
        site.place = Vec3::new(place[0], place[1], -4e-3);
    }
    patch
}

/// A model of one handle that pushes with one newton along x at every pose.
pub(crate) fn pushing(sequence: u64, time_ns: u64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head = ModelHead {
        sequence,
        time_ns,
        period: 0.01,
        handle_count: 1,
        ..ModelHead::empty()
    };
    model.handles[0] = HandleReference {
        wrench: Wrench {
            force: Vec3::new(1.0, 0.0, 0.0),
            moment: Vec3::zeros(),
        },
        ..HandleReference::zero()
    };
    model
}

/// A model like [`pushing`], for two devices: the first is pushed along x, the second against x.
pub(crate) fn pushing_both(sequence: u64, time_ns: u64) -> LocalModel {
    let mut model = pushing(sequence, time_ns);
    model.head.handle_count = 2;
    model.handles[1] = HandleReference {
        device: 1,
        wrench: Wrench {
            force: Vec3::new(-1.0, 0.0, 0.0),
            moment: Vec3::zeros(),
        },
        ..HandleReference::zero()
    };
    model
}
