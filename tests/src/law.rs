//! A control law to measure and to try: one body with up to four handles, each held by a device that
//! moves and turns, and models whose every block is full.

use nalgebra::UnitQuaternion;
use rt_core::controller::{DeviceConfig, Reading};
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Controller, ControllerConfig, DeviceState, Freedom, LocalModel, MAX_DEVICES, MAX_HANDLES, Mat6,
    PassivityConfig, Port, Pose, Scheme, Twist, Vec3,
};

/// The schemes, by name.
pub const SCHEMES: [&str; 6] = ["hold", "thesis", "linear", "proxy", "classic", "capped"];
/// Numbers of handles worth telling apart.
pub const HANDLES: [usize; 3] = [1, 2, 4];
/// Ticks in a row that a device may stay silent.
pub const PATIENCE: u32 = 10;
/// Age from which a model is no longer trusted (ns).
pub const AGE_LIMIT_NS: u64 = 100_000_000;
/// When the models of [`model`] hold (ns).
pub const MODEL_NS: u64 = 1_000_000;

/// What may leave for a device.
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
    /// Never reached by [`model`].
    pub const WIDE: Self = Self {
        force: 1000.0,
        moment: 1000.0,
        speed: 10.0,
    };
    /// Reached at once.
    pub const NARROW: Self = Self {
        force: 1e-6,
        moment: 1e-6,
        speed: 10.0,
    };
}

/// A scheme by its name; anything else is `linear`.
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

/// One body, held by as many devices as it has handles.
pub fn law(scheme: Scheme, handles: usize, limits: Limits) -> Controller {
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
                period,
            },
        };
        let _ = config.devices.push(device);
    }
    let mut passivity = PassivityConfig::new(period);
    // More than the models damp, and far less than the limits of force at the speeds of the readings.
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
        hold_damping: 2.0,
        passivity,
    });
    Controller::new(&config)
}

/// A model whose every block is full, published every `period` (s).
pub fn model(handles: usize, period: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.sequence = 1;
    model.time_ns = MODEL_NS;
    model.period = period;
    model.energy = 0.1;
    model.handle_count = handles as u8;
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

/// What devices say whose hands have moved and turned for `phase` (rad); each is elsewhere.
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
