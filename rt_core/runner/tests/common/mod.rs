//! A device that follows a script, and a controller for it.

// Each test file uses a part of this module.
#![allow(dead_code)]

use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device::DeviceError;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Capabilities, Controller, ControllerConfig, Device, DeviceState, Freedom, HandleReference,
    LocalModel, PassivityConfig, Scheme, Vec3, Wrench,
};

/// The action of a [`Puppet`] in one of its reads.
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

/// A device at rest.
#[derive(Debug)]
pub(crate) struct Puppet {
    pub(crate) trick: Trick,
    pub(crate) reads: u64,
    pub(crate) writes: u64,
    /// The last command; shared, so that it is visible after a panic.
    pub(crate) last: std::sync::Arc<std::sync::Mutex<Option<Wrench>>>,
    pub(crate) times_ns: Vec<u64>,
}

impl Puppet {
    pub(crate) fn new(trick: Trick) -> Self {
        let times_ns = Vec::with_capacity(10_000);
        Self {
            trick,
            reads: 0,
            writes: 0,
            last: std::sync::Arc::default(),
            times_ns,
        }
    }
}

impl Device for Puppet {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            sensed: Freedom::Three,
            actuated: Freedom::Three,
            max_force: 8.0,
            max_moment: 0.0,
            workspace_radius: 0.1,
            position_step: 1e-5,
        }
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.reads += 1;
        self.times_ns.push(now_ns);
        match self.trick {
            Trick::Spin(read, ns) if read == self.reads => {
                let end = runner::clock::now_ns() + ns;
                while runner::clock::now_ns() < end {}
            }
            Trick::Panic(read) if read == self.reads => panic!("the cable was cut"),
            Trick::Call(read) if read == self.reads => {
                std::hint::black_box(rustix::process::getppid());
            }
            Trick::Allocate(read) if read == self.reads => {
                let taken = vec![1_u8; 64 << 20];
                self.writes += u64::from(std::hint::black_box(&taken)[1 << 20]);
            }
            _ => {}
        }
        Ok(DeviceState {
            device_time_ns: now_ns,
            ..DeviceState::resting()
        })
    }

    fn write(&mut self, _now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.writes += 1;
        if let Ok(mut last) = self.last.lock() {
            *last = Some(*wrench);
        }
        Ok(())
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
            max_speed: f64::INFINITY,
            max_reach: f64::INFINITY,
            max_slew: f64::INFINITY,
            patience: 3,
            decay: 0.1,
            recovery: 0.1,
            period: 1e-3,
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
        hold_damping: 1.0,
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
