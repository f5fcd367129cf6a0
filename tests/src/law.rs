//! A control law for measurements and tests: one body with up to eight handles, each held by a device that moves and
//! turns, and models in which every block is full.

use nalgebra::UnitQuaternion;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Controller, ControllerConfig, DeviceState, Freedom, LocalModel, MAX_DEVICES, MAX_HANDLES, Mat6,
    PassivityConfig, Port, Pose, Scheme, Twist, Vec3,
};

/// The schemes, by name.
pub const SCHEMES: [&str; 6] = ["hold", "thesis", "linear", "proxy", "classic", "capped"];
/// The numbers of handles in tests.
pub const HANDLES: [usize; 5] = [1, 2, 4, 6, 8];
/// Successive ticks in which a device may be silent.
pub const PATIENCE: u32 = 10;
/// Age above which a model is no longer trusted (ns).
pub const AGE_LIMIT_NS: u64 = 100_000_000;
/// Time stamp of the models of [`model`] (ns).
pub const MODEL_NS: u64 = 1_000_000;

/// The limits of the last stage.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest force (N).
    pub force: f64,
    /// Largest moment (N m).
    pub moment: f64,
    /// Speed beyond which the force fades (m/s).
    pub speed: f64,
}

impl Limits {
    /// Limits that [`model`] never reaches.
    pub const WIDE: Self = Self {
        force: 1000.0,
        moment: 1000.0,
        speed: 10.0,
    };
    /// Limits that [`model`] reaches at once.
    pub const NARROW: Self = Self {
        force: 1e-6,
        moment: 1e-6,
        speed: 10.0,
    };
}

/// The scheme named `name`; `linear` for any other name.
pub fn scheme(name: &str) -> Scheme {
    match name {
        "hold" => Scheme::Hold,
        "thesis" => Scheme::Thesis {
            stiffness: 200.0,
            damping: 1.0,
        },
        "proxy" => Scheme::Proxy,
        "classic" => Scheme::Classic,
        "capped" => Scheme::Capped,
        _ => Scheme::Linear,
    }
}

/// A controller for one body, held by as many devices as it has handles.
pub fn law(scheme: Scheme, handles: usize, limits: Limits) -> Box<Controller> {
    let period = 1e-3;
    let mut config = ControllerConfig::default();
    for _ in 0..handles {
        let device = DeviceConfig {
            frame: DeviceFrame {
                rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.0, 0.0, 1.0)),
                ..DeviceFrame::at(Vec3::zeros())
            },
            safety: SafetyConfig {
                actuated: Freedom::Six,
                max_force: limits.force,
                max_moment: limits.moment,
                max_speed: limits.speed,
                max_reach: 5.0,
                max_slew: limits.force * 1e3,
                patience: PATIENCE,
                decay: 0.3,
                recovery: 0.2,
                ..SafetyConfig::unlimited(period)
            },
        };
        let _ = config.devices.push(device);
    }
    let mut passivity = PassivityConfig::new(period);
    // The hands of a measurement move at will. They must not have to pay for what the body then stores.
    passivity.allowance = 1e3;
    // More than the damping of the models, and far less than the force limits allow at the speeds of the readings.
    passivity.ports = [Port {
        most_damping: 10.0,
        most_turning_damping: 10.0,
        ..Port::UNKNOWN
    }; MAX_DEVICES];
    let _ = config.bodies.push(CouplingConfig {
        scheme,
        period,
        blend: 0.5,
        age_limit: AGE_LIMIT_NS as f64 * 1e-9,
        decay: 0.3,
        recovery: 0.2,
        hold_damping: [2.0; MAX_DEVICES],
        passivity,
    });
    Box::new(Controller::new(&config))
}

/// A model in which every block is full, published every `period` (s).
pub fn model(handles: usize, period: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = 1;
    model.head.time_ns = MODEL_NS;
    model.head.period = period;
    model.head.energy = 0.1;
    model.head.handle_count = handles as u8;
    for i in 0..MAX_HANDLES {
        model.handles[i].device = i as u8;
        model.handles[i].wrench.force = Vec3::new(0.5, -1.0, 1.5);
        model.handles[i].wrench.moment = Vec3::new(0.01, 0.02, -0.01);
        model.handles[i].weight = Vec3::new(0.0, 0.0, -0.1);
        for j in 0..MAX_HANDLES {
            let own = if i == j { 100.0 } else { -20.0 };
            model.stiffness[i][j] = Mat6::from_fn(|r, c| own / (1.0 + r.abs_diff(c) as f64));
            model.damping[i][j] = model.stiffness[i][j] * 0.01;
        }
    }
    model
}

/// The readings of devices whose hands have moved and turned for `phase` (rad). Each device is at another place.
pub fn reading(phase: f64) -> [Reading; MAX_DEVICES] {
    core::array::from_fn(|device| {
        let s = phase + device as f64;
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
    })
}
