//! The reference of a cell: the same hands, devices and physics steps, with the physics inside the tick.
//!
//! Each tick reads the true poses of the hands, takes a step to these poses, and renders the wrenches of the step at
//! once. The reference has no local model, no encoder and no latency. The trouble of the world occurs here, too: the
//! body softens; the device vanishes, and resumes at its last pose.
//!
//! [`follow`] moves the same bodies along the path of a run instead. It finds the wrenches that the body itself exerts
//! at the poses of that run, whatever moved the hand there.

use super::draw::Softening;
use super::measure::Trace;
use super::world::{World, exerted, handle, probe};
use crate::StudyError;
use host::bodies;
use host::run::timeline::{Host, Timeline};
use host::scene::LoadedScene;
use nalgebra::Matrix3;
use physics::linear::dense::Square;
use physics::{Body, BodyMap, Condenser, HandlePose, Stepper, StepperOptions, Vec3};
use rt_core::clutch::Clutch;
use rt_core::safety::Limiter;
use rt_core::{DeviceState, MAX_DEVICES, Wrench};

/// The bodies with their steppers.
pub(in crate::stress) struct Bodies(Vec<(Body, Stepper<f64>)>);

impl Bodies {
    pub(in crate::stress) fn new(loaded: &LoadedScene) -> Result<Self, StudyError> {
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
        Ok(Self(each.collect::<Result<_, StudyError>>()?))
    }
}

/// The bodies of a world, stepped once a tick.
struct Copy<'a> {
    world: &'a World,
    bodies: Bodies,
    /// For each body and handle, the device that holds it.
    held: Vec<Vec<usize>>,
    /// The softening that is still to come.
    softening: Option<Softening>,
    targets: Vec<HandlePose>,
}

impl<'a> Copy<'a> {
    fn new(world: &'a World) -> Result<Self, StudyError> {
        Ok(Self {
            bodies: Bodies::new(&world.loaded)?,
            held: world.held(),
            softening: world.draw.softening,
            targets: Vec::new(),
            world,
        })
    }

    /// Takes the step of the tick, with each handle at the pose that `place` gives for its device.
    fn place(
        &mut self,
        now_ns: u64,
        place: impl Fn(usize) -> HandlePose,
    ) -> Result<(), StudyError> {
        if let (Some(change), Some(soft)) = (self.softening, &self.world.soft)
            && now_ns as f64 * 1e-9 >= change.at
        {
            self.softening = None;
            let mut others = Bodies::new(soft)?;
            for ((other, _), (body, _)) in others.0.iter_mut().zip(&self.bodies.0) {
                other.continue_from(body, &BodyMap::identity(body))?;
            }
            self.bodies = others;
        }
        let step = self.world.period();
        for ((body, stepper), held) in self.bodies.0.iter_mut().zip(&self.held) {
            self.targets.clear();
            self.targets
                .extend(held.iter().map(|device| place(*device)));
            stepper.step(body, step, &self.targets, || false)?;
        }
        Ok(())
    }

    fn all(&self) -> impl Iterator<Item = &Body> {
        self.bodies.0.iter().map(|(body, _)| body)
    }
}

/// All work is done in the ticks.
impl Host for Copy<'_> {
    type Error = StudyError;

    fn next_ns(&self) -> Option<u64> {
        None
    }

    fn step(&mut self) -> Result<(), StudyError> {
        Ok(())
    }

    fn deliver(&mut self, _: u64) {}
}

impl Bodies {
    /// The largest stiffness and damping that each device meets along its axes in the present state of the bodies of
    /// `world`, in a model for the period `period` (s), in N/m and N s/m at the device.
    pub(in crate::stress) fn stiffest(
        &mut self,
        world: &World,
        period: f64,
    ) -> Result<Vec<[f64; 2]>, StudyError> {
        let held = world.held();
        let frames = world.frames()?;
        let models = &world.loaded.models;
        let mut most = vec![[0.0; 2]; frames.len()];
        for ((body, _), held) in self.0.iter_mut().zip(&held) {
            body.assemble();
            let mut condenser = Condenser::new(body)?;
            let condensed = condenser.condense(body, period)?;
            for (handle, device) in held.iter().enumerate() {
                let (frame, axes) = (&frames[*device], models[*device].axes);
                let scale = frame.motion_scale;
                let found = [&condensed.stiffness, &condensed.damping];
                for (most, matrix) in most[*device].iter_mut().zip(found) {
                    let mut block = translational(matrix, handle);
                    if let Some(axes) = axes {
                        // The mechanism bears the rest.
                        let turn = frame.rotation.to_rotation_matrix();
                        let part = Matrix3::from_diagonal(&axes.part(&Vec3::repeat(1.0)));
                        block = part * turn.matrix().transpose() * block * turn.matrix() * part;
                    }
                    *most += scale * scale * block.symmetric_eigenvalues().max();
                }
            }
        }
        Ok(most)
    }
}

/// The largest eigenvalue of the translational block of `handle` in a condensed matrix.
pub(in crate::stress) fn largest(matrix: &Square, handle: usize) -> f64 {
    translational(matrix, handle).symmetric_eigenvalues().max()
}

/// The translational block of `handle` in a condensed matrix.
fn translational(matrix: &Square, handle: usize) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| matrix[(6 * handle + r, 6 * handle + c)])
}

/// Moves the bodies along the path of `run`, and stores the wrenches that they exert. Returns the bodies at the end of
/// the path.
pub(in crate::stress) fn follow(world: &World, run: &mut Trace) -> Result<Bodies, StudyError> {
    let mut copy = Copy::new(world)?;
    for device in &mut run.devices {
        device.own.clear();
        device.own.reserve(device.proxy.len());
    }
    let frames = world.frames()?;
    let timeline = Timeline {
        ticks: run.out.len() as u64,
        ..world.timeline()
    };
    timeline.drive(&mut copy, |copy, now_ns| {
        let tick = (now_ns / timeline.period_ns) as usize;
        copy.place(now_ns, |device| handle(&run.devices[device].proxy[tick]))?;
        let (wrenches, _) = exerted(copy.all(), &copy.held);
        let specs = frames.iter().zip(&world.loaded.models);
        for ((device, (frame, model)), wrench) in run.devices.iter_mut().zip(specs).zip(wrenches) {
            let Wrench { force, moment } = frame.to_device(&wrench);
            device.own.push(Wrench {
                // The mechanism of a device of one or two degrees of freedom bears the rest.
                force: model.freedom().part(&force),
                // A device whose handle does not turn renders no moment.
                moment: moment * f64::from(u8::from(model.rotation.is_some())),
            });
        }
        Ok(())
    })?;
    Ok(copy.bodies)
}

/// Runs the reference of the cell of `world`.
pub(crate) fn run(world: &World) -> Result<Trace, StudyError> {
    let mut copy = Copy::new(world)?;
    let stored = copy.all().map(Body::total_energy).sum();
    let (config, mut devices, mut kept) = world.devices(stored)?;
    let mut limiters: Vec<_> = config
        .devices
        .iter()
        .map(|device| Limiter::new(device.safety))
        .collect();
    let mut frames: Vec<_> = config.devices.iter().map(|d| d.frame).collect();
    let mut left = vec![DeviceState::resting(); frames.len()];
    let mut clutches = vec![Clutch::new(); frames.len()];
    let mut seen = vec![false; frames.len()];
    world.timeline().drive(&mut copy, |copy, now| {
        let mut readings = [None; MAX_DEVICES];
        for (index, device) in devices.iter_mut().enumerate() {
            let state = device.read(now).ok();
            let pose = probe(device).pose;
            let state = state.map(|state| DeviceState { pose, ..state });
            readings[index] = state;
            if let Some(state) = state {
                if std::mem::replace(&mut seen[index], true) {
                    let frame = &mut frames[index];
                    clutches[index].follow(&limiters[index], frame, &left[index], &state);
                }
                left[index] = state;
            }
        }
        copy.place(now, |device| {
            handle(&frames[device].to_scene(&left[device]).0)
        })?;
        let (wrenches, weight) = kept.exerted_by(copy.all());

        let each = devices.iter_mut().zip(&mut limiters).zip(&frames);
        for (index, ((device, limiter), frame)) in each.enumerate() {
            let asked = frame.to_device(&wrenches[index]);
            let command = limiter.pass(&asked, readings[index].as_ref());
            // A simulated device takes every wrench.
            let _ = device.write(now, &command);
        }
        let states = limiters.iter().map(Limiter::state);
        kept.keep(&devices, states, &wrenches, weight, [0.0; 2]);
        Ok(())
    })?;
    Ok(kept.finish(0))
}

#[cfg(test)]
mod tests {
    use super::super::draw::Draw;
    use super::*;
    use host::scene::Scene;
    use std::collections::BTreeMap;

    const PADDLE: &str = include_str!("../../../../scenes/paddle.toml");

    #[test]
    fn a_paddle_meets_the_stiffness_along_its_axis_alone() {
        // The paddle rubs the block, which resists a press more.
        let text = PADDLE.replace("degrees = 90", "degrees = 180");
        let loaded = Scene::load_texts("paddle.toml", &text, &BTreeMap::new());
        let loaded = loaded.expect("the scene is sound");
        let period = 0.01;
        let condenser = bodies::condense::<StudyError>(&loaded, 0, period).expect("it condenses");
        let stiffness = &condenser.condensed().stiffness;
        let world = World {
            draw: Draw::untroubled(1.0 / period, 0.0),
            soft: None,
            loaded: loaded.clone(),
        };
        let axis = world.frames().expect("it is mounted")[0].rotation * Vec3::x();
        let along = axis.dot(&(translational(stiffness, 0) * axis));
        let mut bodies = Bodies::new(&loaded).expect("it is sound");
        let found = bodies.stiffest(&world, period).expect("it condenses")[0][0];
        // The body has settled under its weight, by little.
        assert!((found / along - 1.0).abs() < 0.1, "{found} {along}");
        assert!(largest(stiffness, 0) > 1.2 * along, "both are alike");
    }
}
