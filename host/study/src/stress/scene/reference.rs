//! The reference of a cell: the same hands, devices and physics steps, with the physics inside the tick.
//!
//! Each tick reads the true poses of the hands, takes a step to these poses, and renders the wrenches of the step at
//! once. The reference has no local model, no encoder and no latency. Its bodies tear and touch as those of the host do. The trouble
//! of the trial occurs here, too: the body softens; the device vanishes, and resumes at its last pose.
//!
//! A body that is stiffer than its device shakes a hand by itself, whatever the scheme. In such directions the reference
//! renders what the device can render: the handles follow proxies behind springs (the module `rendered`), and the wrench is
//! that of the body at the proxies.
//!
//! [`follow`] moves the same bodies, behind the same springs, along the path of a run instead. It finds the wrenches that
//! the body itself exerts at the poses of that run, whatever moved the hand there.

use super::draw::Softening;
use super::measure::{Apart, HOLD, Trace};
use super::rendered::Rendered;
use super::touching::{Stepped, Touching};
use super::trial::{Trial, exerted, handle, probe};
use crate::StudyError;
use crate::tearing::rig::renew;
use host::engine::plan::BodyPlan;
use host::engine::tears::{self, MOST_PAIRS};
use host::run::prepare;
use host::scene::LoadedScene;
use host::world::grasps;
use nalgebra::{Matrix3, UnitQuaternion};
use physics::{Body, BodyMap, HandlePose, Stepper, StepperOptions, Tearing, Vec3};
use rt_core::clutch::Clutch;
use rt_core::safety::Limiter;
use rt_core::{DeviceState, MAX_DEVICES, Mat6, Pose, Wrench};

/// Steps in which a body comes to rest, and their length (s).
const RESTS: usize = 40;
const REST: f64 = 0.05;

/// A body with its stepper and the springs of its devices.
struct Held {
    body: Body,
    stepper: Stepper<f64>,
    /// Its tears; none of a body that does not tear.
    tearing: Option<Tearing>,
    rendered: Rendered,
    /// For each handle, the device that holds it.
    devices: Vec<usize>,
}

/// The bodies of a scene, and their contacts.
pub(in crate::stress) struct Bodies {
    held: Vec<Held>,
    touching: Option<Touching>,
}

/// The options of the steppers of a scene's bodies. A body that something may wake does not sleep.
fn options(loaded: &LoadedScene) -> StepperOptions {
    let host = &loaded.scene.host;
    let may_touch = loaded.scene.has_contact();
    let options = StepperOptions {
        tolerance: host.tolerance,
        max_iterations: host.max_iterations,
        may_touch,
        ..StepperOptions::default()
    };
    StepperOptions {
        sleep_speed: if may_touch { 0.0 } else { options.sleep_speed },
        ..options
    }
}

/// Takes a step of `h` (s), of bodies that touch or do not, to the poses of their handles. Obstacles move for `moves` (s).
fn step(
    bodies: &mut [Stepped<'_>],
    touching: &mut Option<Touching>,
    targets: &[Vec<HandlePose>],
    [h, moves]: [f64; 2],
) -> Result<(), StudyError> {
    for ((body, stepper), targets) in bodies.iter_mut().zip(targets) {
        stepper.predict(body, h)?;
        stepper.constrain(body, targets)?;
    }
    if let Some(touching) = touching {
        touching.solve(bodies, h, moves)?;
    }
    for (body, stepper) in bodies {
        if !stepper.is_solved() {
            stepper.solve(|| false)?;
        }
        stepper.finish(body, || false)?;
    }
    Ok(())
}

impl Bodies {
    pub(in crate::stress) fn new(loaded: &LoadedScene) -> Result<Self, StudyError> {
        let scene = &loaded.scene;
        let options = options(loaded);
        let built = host::world::World::new(loaded)?;
        let each = scene.bodies.iter().enumerate().map(|(index, spec)| {
            let mut body = built.start(index).clone();
            let horizon = BodyPlan::new(&built, index).horizon;
            let grasps = grasps(scene, spec).into_iter();
            let devices: Vec<_> = grasps.map(|grasp| grasp.device).collect();
            let tearing = tears::tearing(&built, index, &mut body)?;
            let mut stepper = Stepper::new(&body, options)?;
            if tearing.is_some() {
                stepper.reserve_pairs(MOST_PAIRS);
            }
            Ok(Held {
                stepper,
                tearing,
                rendered: Rendered::new(&built, &devices, &mut body, horizon)?,
                body,
                devices,
            })
        });
        let held: Vec<Held> = each.collect::<Result<_, StudyError>>()?;
        let bodies: Vec<&Body> = held.iter().map(|held| &held.body).collect();
        Ok(Self {
            touching: Touching::new(&built, &bodies, 0.0)?,
            held,
        })
    }

    /// Takes a step of `step` (s), with each handle held by a device at the pose that `place` gives for it.
    pub(in crate::stress) fn step(
        &mut self,
        step: f64,
        place: impl Fn(usize) -> HandlePose,
    ) -> Result<(), StudyError> {
        let mut targets = Vec::new();
        for held in &mut self.held {
            let each = held.devices.iter();
            let mut own: Vec<_> = each.map(|device| place(*device)).collect();
            held.rendered.aim(&mut own, &mut held.body, step)?;
            renew(&mut held.body, &mut held.stepper, step)?;
            targets.push(own);
        }
        let each = self.held.iter_mut();
        let mut bodies: Vec<_> = each
            .map(|held| (&mut held.body, &mut held.stepper))
            .collect();
        self::step(&mut bodies, &mut self.touching, &targets, [step; 2])?;
        for held in &mut self.held {
            if let Some(tearing) = &mut held.tearing {
                tearing.advance(&mut held.body, &mut held.stepper);
            }
        }
        if let Some(touching) = &mut self.touching {
            let bodies: Vec<&Body> = self.held.iter().map(|held| &held.body).collect();
            touching.follow(&bodies)?;
        }
        Ok(())
    }

    /// The wrenches of the bodies on the devices (axes of the scene), and the potential of their weight (J).
    pub(in crate::stress) fn exerted(&self) -> ([Wrench; MAX_DEVICES], f64) {
        let each = self.held.iter();
        exerted(each.map(|held| (&held.body, &held.devices[..])))
    }

    fn all(&self) -> impl Iterator<Item = &Body> {
        self.held.iter().map(|held| &held.body)
    }

    /// The change of the force of each device (N, at the device) by one count of its encoder in the present state, of
    /// what the devices render: by the stiffness, and by a velocity that gives `rate` (1/s) times the count.
    pub(in crate::stress) fn counts(
        &mut self,
        trial: &Trial,
        rate: f64,
        most_damping: impl Fn(usize) -> f64,
    ) -> Result<Vec<f64>, StudyError> {
        let frames = trial.frames()?;
        let models = &trial.loaded.models;
        let mut counts = vec![0.0; frames.len()];
        for held in &mut self.held {
            held.rendered.renew(&mut held.body)?;
            let model = held.rendered.model();
            for (handle, &device) in held.devices.iter().enumerate() {
                let (frame, axes) = (&frames[device], models[device].axes);
                let largest = |block: &Mat6| {
                    let mut block: Matrix3<f64> = block.fixed_view::<3, 3>(0, 0).into();
                    if let Some(axes) = axes {
                        // The mechanism carries the rest.
                        let turn = frame.rotation.to_rotation_matrix();
                        let part = Matrix3::from_diagonal(&axes.part(&Vec3::repeat(1.0)));
                        block = part * turn.matrix().transpose() * block * turn.matrix() * part;
                    }
                    frame.motion_scale * frame.motion_scale * block.symmetric_eigenvalues().max()
                };
                let spring = largest(&model.stiffness[handle][handle]);
                let damper = largest(&model.damping[handle][handle]).min(most_damping(device));
                counts[device] += models[device].position_step * (spring + damper * rate);
            }
        }
        Ok(counts)
    }

    /// The force on each device (N, axes of the scene) that would explain, in the directions that the devices render as
    /// they are, where the handles of a run were: `apart` gives for each body and handle the displacement from its device.
    fn leaves(&mut self, apart: &[Vec<Apart>]) -> Result<[Vec3; MAX_DEVICES], StudyError> {
        let mut forces = [Vec3::zeros(); MAX_DEVICES];
        for (held, apart) in self.held.iter_mut().zip(apart) {
            held.rendered.renew(&mut held.body)?;
            let apart: Vec<_> = apart.iter().map(|apart| apart.mean).collect();
            for (force, device) in held.rendered.soft(&apart).iter().zip(&held.devices) {
                forces[*device] += force;
            }
        }
        Ok(forces)
    }
}

/// The bodies of a trial, stepped once a tick.
struct Copy<'a> {
    trial: &'a Trial,
    bodies: Bodies,
    /// The softening that is still to come.
    softening: Option<Softening>,
}

impl<'a> Copy<'a> {
    fn new(trial: &'a Trial) -> Result<Self, StudyError> {
        Ok(Self {
            bodies: Bodies::new(&trial.loaded)?,
            softening: trial.draw.softening,
            trial,
        })
    }

    /// Takes the step of the tick, with each handle held by a device at the pose that `place` gives for it.
    fn place(
        &mut self,
        now_ns: u64,
        place: impl Fn(usize) -> HandlePose,
    ) -> Result<(), StudyError> {
        if let (Some(change), Some(soft)) = (self.softening, &self.trial.soft)
            && now_ns as f64 * 1e-9 >= change.at
        {
            self.softening = None;
            let mut others = Bodies::new(soft)?;
            for (other, held) in others.held.iter_mut().zip(&self.bodies.held) {
                other
                    .body
                    .continue_from(&held.body, &BodyMap::identity(&held.body))?;
                other.rendered.renew(&mut other.body)?;
            }
            others.touching = self.bodies.touching.take();
            self.bodies = others;
        }
        self.bodies.step(self.trial.period(), place)
    }
}

/// Moves the bodies along the path of `run`, and stores the wrenches that they exert. Returns the bodies at the end of
/// the path.
pub(in crate::stress) fn follow(trial: &Trial, run: &mut Trace) -> Result<Bodies, StudyError> {
    let mut copy = Copy::new(trial)?;
    for device in &mut run.devices {
        device.own.clear();
        device.own.reserve(device.proxy.len());
    }
    let frames = trial.frames()?;
    for tick in 0..run.out.len() {
        copy.place(tick as u64 * trial.period_ns(), |device| {
            handle(&run.devices[device].proxy[tick])
        })?;
        let (wrenches, _) = copy.bodies.exerted();
        let specs = frames.iter().zip(&trial.loaded.models);
        for ((device, (frame, model)), wrench) in run.devices.iter_mut().zip(specs).zip(wrenches) {
            let Wrench { force, moment } = frame.to_device(&wrench);
            device.own.push(Wrench {
                // The mechanism of a device of one or two degrees of freedom carries the rest.
                force: model.freedom().part(&force),
                // A device whose handle does not turn renders no moment.
                moment: moment * f64::from(u8::from(model.rotation.is_some())),
            });
        }
    }
    let leaves = copy.bodies.leaves(&run.apart)?;
    for ((device, force), frame) in run.devices.iter_mut().zip(leaves).zip(&frames) {
        let force = Wrench {
            force,
            ..Wrench::zero()
        };
        device.leaves = frame.to_device(&force).force;
    }
    Ok(copy.bodies)
}

/// Lets the `bodies` of the host, as they are at the begin of the hold of `run`, come to rest with their handles where they
/// are in the mean of the hold, and stores the forces that they then exert on the devices.
///
/// A body that has folded or wrinkled has several equilibria, and which of them it takes depends on its whole past. So the
/// force of a hold is that of the host's body, in the equilibrium in which it is, found by another solver.
pub(super) fn rest(trial: &Trial, run: &mut Trace, bodies: Vec<Body>) -> Result<(), StudyError> {
    let mut bodies = bodies;
    let built = host::world::World::new(&trial.loaded)?;
    let hold = trial.loaded.scene.duration - HOLD;
    let places = |apart: &Vec<Apart>| {
        let places = apart.iter().map(|apart| {
            let begin = apart.begin.unwrap_or_else(Pose::identity);
            let [moved, turned] =
                [0, 3].map(|first| Vec3::from(apart.moved.fixed_rows::<3>(first)));
            HandlePose {
                position: begin.position + moved,
                rotation: UnitQuaternion::from_scaled_axis(turned) * begin.rotation,
            }
        });
        places.collect::<Vec<_>>()
    };
    let targets: Vec<_> = run.apart.iter().map(places).collect();
    let own: Vec<&Body> = bodies.iter().collect();
    let mut touching = Touching::new(&built, &own, hold)?;
    let mut steppers = Vec::new();
    for body in &mut bodies {
        // A body that has torn is without the matrix of its present vertices.
        body.reassemble();
        steppers.push(Stepper::<f64>::new(body, options(&trial.loaded))?);
    }
    for _ in 0..RESTS {
        let mut each: Vec<_> = bodies.iter_mut().zip(&mut steppers).collect();
        step(&mut each, &mut touching, &targets, [REST, 0.0])?;
    }
    let held = trial.held();
    let (wrenches, _) = exerted(bodies.iter().zip(held.iter().map(Vec::as_slice)));
    let specs = trial.frames()?.into_iter().zip(&trial.loaded.models);
    for ((device, (frame, model)), wrench) in run.devices.iter_mut().zip(specs).zip(wrenches) {
        device.rest = model.freedom().part(&frame.to_device(&wrench).force);
    }
    Ok(())
}

/// Runs the reference of the cell of `trial`.
pub(crate) fn run(trial: &Trial) -> Result<Trace, StudyError> {
    if let Some(tool) = trial.loaded.scene.tools.first() {
        return Err(StudyError::Tool(tool.name.clone()));
    }
    let mut copy = Copy::new(trial)?;
    let stored = copy.bodies.all().map(Body::total_energy).sum();
    let built = host::world::World::new(&trial.loaded)?;
    let (config, devices) = prepare::controls(&built, trial.loaded.scene.seed)?;
    let mut devices = trial.faulty(devices);
    let mut kept = trial.kept(stored)?;
    let mut limiters: Vec<_> = config
        .devices
        .iter()
        .map(|device| Limiter::new(device.safety))
        .collect();
    let mut frames: Vec<_> = config.devices.iter().map(|d| d.frame).collect();
    let mut left = vec![DeviceState::resting(); frames.len()];
    let mut clutches = vec![Clutch::new(); frames.len()];
    let mut seen = vec![false; frames.len()];
    for number in 0..trial.ticks() {
        let now = number * trial.period_ns();
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
        let (wrenches, weight) = copy.bodies.exerted();

        let each = devices.iter_mut().zip(&mut limiters).zip(&frames);
        for (index, ((device, limiter), frame)) in each.enumerate() {
            let asked = frame.to_device(&wrenches[index]);
            let command = limiter.pass(&asked, readings[index].as_ref());
            // A simulated device takes every wrench.
            let _ = device.write(now, &command);
        }
        let states = limiters.iter().map(Limiter::state);
        kept.keep(&devices, states, &wrenches, weight, [0.0; 2]);
    }
    Ok(kept.finish(0))
}

#[cfg(test)]
mod tests {
    use super::super::draw::Draw;
    use super::*;
    use host::scene::Scene;
    use host::world::condense;
    use std::collections::BTreeMap;

    const PADDLE: &str = include_str!("../../../../scenes/paddle.toml");

    #[test]
    fn a_paddle_meets_the_stiffness_along_its_axis_alone() {
        // The paddle rubs the block, which resists a press more.
        let text = PADDLE.replace("degrees = 90", "degrees = 180");
        let loaded = Scene::load_texts("paddle.toml", &text, &BTreeMap::new());
        let loaded = loaded.expect("the scene is sound");
        let built = host::world::World::new(&loaded).expect("it is sound");
        let period = BodyPlan::new(&built, 0).horizon;
        let condenser = condense(&built.bodies[0], period).expect("it condenses");
        let stiffness = &condenser.condensed().stiffness;
        let trial = Trial {
            draw: Draw::untroubled(1.0 / period, 0.0),
            soft: None,
            loaded: loaded.clone(),
        };
        let axis = trial.frames().expect("it is mounted")[0].rotation * Vec3::x();
        let block =
            |handle: usize| Matrix3::from_fn(|r, c| stiffness[(6 * handle + r, 6 * handle + c)]);
        let along = axis.dot(&(block(0) * axis));
        let mut bodies = Bodies::new(&loaded).expect("it is sound");
        let counts = bodies.counts(&trial, 0.0, |_| 0.0);
        let found = counts.expect("it condenses")[0] / loaded.models[0].position_step;
        // The body has settled under its weight, by little.
        assert!((found / along - 1.0).abs() < 0.1, "{found} {along}");
        assert!(
            block(0).symmetric_eigenvalues().max() > 1.2 * along,
            "both are alike"
        );
    }
}
