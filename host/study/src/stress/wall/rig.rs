//! The wall in the real controller, as the adversary and the simulated hand meet it.

use crate::adversary::{Mechanism, Rendering};
use host::engine::virtual_coupling::Spring;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::velocity::{VelocityEstimator, most_damping};
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, Freedom, LocalModel, MAX_DEVICES,
    PassivityConfig, Pose, Scheme, Twist, Vec3,
};
use sim::DeviceModel;

/// Ticks until the wall is complete: the model blends in over a few ticks.
const WARM_UP: u32 = 20;

/// A wall on a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// The device.
    pub model: DeviceModel,
    /// The tick's rate (Hz).
    pub rate: u32,
    /// Ticks between a command and the tick in which the device holds it.
    pub delay: usize,
    /// With the device's friction and counts, and its driver's estimate of velocity; otherwise without them, and the
    /// velocity is the difference of positions over the period.
    pub whole: bool,
    /// The scheme that renders the wall.
    pub scheme: Scheme,
    /// Stiffness (N/m).
    pub stiffness: f64,
    /// Damping (N s/m).
    pub damping: f64,
}

impl Wall {
    /// The tick's period (s).
    pub fn period(&self) -> f64 {
        1.0 / f64::from(self.rate)
    }

    /// The port between the controller and the hand.
    pub fn port(&self) -> Mechanism {
        Mechanism {
            period: self.period(),
            damping: self.model.damping,
            friction: if self.whole { self.model.friction } else { 0.0 },
            delay: self.delay,
        }
    }

    /// Encoder count (m); zero without an encoder.
    pub fn count(&self) -> f64 {
        if self.whole {
            self.model.position_step
        } else {
            0.0
        }
    }

    /// The axis across which the wall stands: the first along which the device moves.
    fn axis(&self) -> usize {
        let axes = self.model.axes.map(|axes| axes.free());
        let first = axes.and_then(|free| free.iter().position(|free| *free));
        first.unwrap_or(0)
    }

    fn config(&self) -> ControllerConfig {
        let period = self.period();
        let mut passivity = PassivityConfig::new(period);
        passivity.delay = self.delay;
        let late = if self.whole {
            estimator(self).delay()
        } else {
            0.5 * period
        } + self.delay as f64 * period;
        passivity.ports[0] = rt_core::Port {
            damping: self.model.damping,
            friction: self.port().friction,
            count: self.count(),
            most_damping: most_damping(self.model.mass, period, late),
            ..rt_core::Port::UNKNOWN
        };
        let mut config = ControllerConfig::default();
        let _ = config.devices.push(DeviceConfig {
            frame: DeviceFrame::at(Vec3::zeros()),
            safety: SafetyConfig {
                actuated: self.model.axes.map_or(Freedom::Three, Freedom::Along),
                max_force: self.model.max_force,
                max_moment: 0.0,
                patience: 10,
                decay: 0.1,
                recovery: period,
                ..SafetyConfig::unlimited(period)
            },
        });
        let _ = config.bodies.push(CouplingConfig {
            scheme: self.scheme,
            period,
            blend: 0.5,
            // The plane is published once, before contact, and stays valid.
            age_limit: 1e6,
            decay: 0.1,
            recovery: period,
            hold_damping: [0.0; MAX_DEVICES],
            passivity,
        });
        config
    }

    fn local_model(&self) -> LocalModel {
        let mut model = LocalModel::empty();
        model.head.sequence = 1;
        model.head.time_ns = 1;
        model.head.period = self.period();
        model.head.handle_count = 1;
        let axis = self.axis();
        model.handles[0].contact[axis] = 1.0;
        let [stiffness, damping] = self.published();
        model.stiffness[0][0][(axis, axis)] = stiffness;
        model.damping[0][0][(axis, axis)] = damping;
        model
    }

    /// Stiffness and damping that the host publishes: those of the wall, or under `proxy` those of wall and virtual
    /// coupling in series, as in `engine::virtual_coupling`.
    fn published(&self) -> [f64; 2] {
        if self.scheme != Scheme::Proxy {
            return [self.stiffness, self.damping];
        }
        let link = Spring::recommended(&self.model);
        let fraction = link.stiffness / (link.stiffness + self.stiffness);
        let rest = 1.0 - fraction;
        let damping = fraction * fraction * self.damping + rest * rest * link.damping;
        [fraction * self.stiffness, damping]
    }
}

/// The controller with a wall that begins at zero and pushes towards positive positions, and the device's encoder.
#[derive(Clone, Debug)]
pub struct Rig {
    wall: Wall,
    /// The controller at rest at the wall's surface, with the wall complete.
    ready: Box<Controller>,
    controller: Box<Controller>,
    estimator: VelocityEstimator,
    last: f64,
    period_ns: u64,
    now_ns: u64,
}

impl Rig {
    /// A rig at rest at the wall's surface.
    pub fn new(wall: Wall) -> Self {
        let mut controller = Box::new(Controller::new(&wall.config()));
        // The controller accepts any sound model of one handle for a new body.
        let _ = controller.accept(0, &wall.local_model());
        let period_ns = (1e9 * wall.period()).round() as u64;
        let mut rig = Self {
            wall,
            ready: controller.clone(),
            controller,
            estimator: estimator(&wall),
            last: 0.0,
            period_ns,
            now_ns: 0,
        };
        for _ in 0..WARM_UP {
            rig.tick(0.0);
        }
        rig.ready.clone_from(&rig.controller);
        rig
    }

    /// The wall.
    pub fn wall(&self) -> &Wall {
        &self.wall
    }
}

fn estimator(wall: &Wall) -> VelocityEstimator {
    VelocityEstimator::for_encoder(wall.period(), wall.model.position_step)
}

impl Rendering for Rig {
    fn reset(&mut self) {
        self.controller.clone_from(&self.ready);
        self.estimator = estimator(&self.wall);
        self.estimator.update(&Vec3::zeros());
        self.last = 0.0;
        self.now_ns = u64::from(WARM_UP) * self.period_ns;
    }

    fn tick(&mut self, position: f64) -> f64 {
        self.now_ns += self.period_ns;
        let count = self.wall.count();
        let shown = if count > 0.0 {
            (position / count).round() * count
        } else {
            position
        };
        let axis = self.wall.axis();
        let along = |size: f64| Vec3::ith(axis, size);
        let place = along(shown);
        let linear = if self.wall.whole {
            self.estimator.update(&place)
        } else {
            along((shown - self.last) / self.wall.period())
        };
        self.last = shown;
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        readings[0] = Ok(DeviceState {
            pose: Pose::at(place),
            twist: Twist {
                linear,
                ..Twist::zero()
            },
            ..DeviceState::resting()
        });
        let (commands, _) = self.controller.tick(self.now_ns, &readings);
        commands[0].force[axis]
    }
}
