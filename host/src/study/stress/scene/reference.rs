//! The reference of a cell: the same hands, devices and physics steps, the physics inside the tick.
//!
//! Each tick reads where the hands truly are, takes a step to there, and renders what the step says, at once: no
//! model, no encoder, no host that is late. What happens to the world happens here, too: the body softens, the
//! device is gone, and goes on from where it was left.

use super::StressError;
use super::measure::Trace;
use super::world::World;
use crate::bodies;
use crate::scene::LoadedScene;
use physics::Vec3;
use physics::fast::{Stepper, StepperOptions};
use physics::fem::{Body, HandlePose};
use rt_core::clutch::Clutch;
use rt_core::safety::{Limiter, SafetyState};
use rt_core::{DeviceState, MAX_DEVICES, Pose, Wrench};

/// The bodies with what steps them.
struct Bodies(Vec<(Body, Stepper<f64>)>);

impl Bodies {
    fn new(loaded: &LoadedScene) -> Result<Self, StressError> {
        let host = &loaded.scene.host;
        let options = StepperOptions {
            tolerance: host.tolerance,
            max_iterations: host.max_iterations,
            ..StepperOptions::default()
        };
        let each = (0..loaded.scene.bodies.len()).map(|index| {
            let body = bodies::build_settled(loaded, index)?.body;
            let stepper = Stepper::new(&body, options)?;
            Ok((body, stepper))
        });
        Ok(Self(each.collect::<Result<_, StressError>>()?))
    }
}

/// Runs the reference of the cell of `world`.
pub(super) fn run(world: &World) -> Result<Trace, StressError> {
    let mut bodies = Bodies::new(&world.loaded)?;
    let stored = bodies.0.iter().map(|(body, _)| body.total_energy()).sum();
    let (config, mut devices) = world.devices(stored)?;
    let mut limiters: Vec<_> = config
        .devices
        .iter()
        .map(|device| Limiter::new(device.safety))
        .collect();
    let mut softening = world.draw.softening;
    let step = world.period_ns() as f64 * 1e-9;
    let mut proxies: Vec<_> = config.devices.iter().map(|d| d.proxy).collect();
    let mut left = vec![DeviceState::resting(); proxies.len()];
    let mut clutches = vec![Clutch::new(); proxies.len()];
    let mut seen = vec![false; proxies.len()];
    let mut targets = Vec::new();
    for k in 0..world.ticks() {
        let now = k * world.period_ns();
        if let (Some(change), Some(soft)) = (softening, &world.soft)
            && now as f64 * 1e-9 >= change.at
        {
            softening = None;
            let mut others = Bodies::new(soft)?;
            for ((other, _), (body, _)) in others.0.iter_mut().zip(&bodies.0) {
                other.continue_from(body)?;
            }
            bodies = others;
        }
        let mut readings = [None; MAX_DEVICES];
        devices.read(now, |device, state, position| {
            let state = state.map(|state| DeviceState {
                pose: Pose::at(position),
                ..state
            });
            readings[device] = state;
            if let Some(state) = state {
                if std::mem::replace(&mut seen[device], true) {
                    let proxy = &mut proxies[device];
                    clutches[device].follow(&limiters[device], proxy, &left[device], &state);
                }
                left[device] = state;
            }
        });
        let place = |device: usize| proxies[device].to_scene(&left[device]).0.position;

        for ((body, stepper), held) in bodies.0.iter_mut().zip(&devices.held) {
            targets.clear();
            targets.extend(held.iter().map(|device| HandlePose::at(place(*device))));
            stepper.step(body, step, &targets, || false)?;
        }
        let (forces, weight) = devices.exerted_by(bodies.0.iter().map(|(body, _)| body));

        let mut commands = [Wrench::zero(); MAX_DEVICES];
        let mut states = [SafetyState::Normal; MAX_DEVICES];
        let each = limiters.iter_mut().zip(&proxies).enumerate();
        for (device, (limiter, proxy)) in each {
            let asked = Wrench {
                force: forces[device],
                moment: Vec3::zeros(),
            };
            commands[device] = limiter.pass(&proxy.to_device(&asked), readings[device].as_ref());
            states[device] = limiter.state();
        }
        devices.write(now, &commands, |device| {
            states[device] == SafetyState::Limited
        });
        devices.keep(&forces, weight, [0.0; 2]);
    }
    Ok(devices.finish(0))
}
