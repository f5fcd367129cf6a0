//! One body in the host's loop: the paths of its handles, its step, and the local model that it publishes.

mod landing;

use super::background::Background;
use super::balance::Balance;
use super::change::Rebuild;
use super::clock::BodyClock;
use super::damped::{Damped, DampedDirection};
use super::path::HandlePath;
use super::projected::Projected;
use super::recipe::Recipe;
use super::solver::Solver;
use super::stats::{StepFault, Stopwatch, Tally};
use super::stiff::{Renderable, SeriesSprings, StiffDirection};
use super::stored::Stored;
use super::tears::BodyTears;
use super::virtual_coupling::{Link, VirtualCoupling};
use nalgebra::UnitQuaternion;
use physics::linear::dense::Square;
use physics::{Body, BodyError, BodyMap, Condensed, Equation, HandlePose, HandleReport};
use rt_core::{
    HandleReference, LocalModel, MAX_HANDLES, Mat6, Pose, TearLimit, TickRecord, Twist, Vec6,
    Wrench,
};

/// Speed of a handle in excess of its hand's speed while it catches up (m/s).
const CATCH_UP: f64 = 0.5;
/// Time for which a model places the handles behind springs, as a multiple of its horizon. The stiffness of a model holds the
/// inertia of the body for its horizon. The wrench of a younger model holds the inertia of the last change of a handle's
/// velocity, which is larger: handles that such a wrench places swing from model to model. Over longer times than
/// [`LONGEST_PLACED`] (s) inertia is small beside stiffness, and a body that is not linear would be placed by the past.
const PLACES: f64 = 2.0;
const LONGEST_PLACED: f64 = 0.015;
/// Angular velocity of a handle in excess of its hand's while it catches up (rad/s).
const TURN_AFTER: f64 = 5.0;

/// A body with the paths of its handles, its solver and its local model.
pub struct HostBody {
    name: String,
    solved: String,
    body: Body,
    solver: Solver,
    paths: Vec<HandlePath>,
    devices: Vec<u8>,
    /// What devices of one or two degrees of freedom render.
    projected: Projected,
    targets: Vec<HandlePose>,
    /// Length of a step (s).
    step: f64,
    clock: BodyClock,
    /// The time of the newest record (ns); `None` before the first. A body that nobody holds has a time, too.
    newest_ns: Option<u64>,
    /// The time at the end of the present step (ns); `None` before the first record.
    time_ns: Option<u64>,
    /// Whether a handle stays behind its hand in the present step.
    behind: bool,
    /// Whether nothing has failed in the present step.
    sound: bool,
    /// Whether a group of joined bodies has solved the present step's equation.
    is_joined: bool,
    /// The fault of the present stage.
    pub(super) fault: Option<StepFault>,
    /// Whether the present step publishes.
    publishes: bool,
    tally: Tally,
    /// The time over which models foresee the response of the body (s).
    response: f64,
    model: LocalModel,
    stored: Option<Stored>,
    coupling: Option<VirtualCoupling>,
    /// What each device of the scene can render.
    renderable: Vec<Renderable>,
    /// Springs in series with the directions that the devices cannot render.
    springs: Option<SeriesSprings>,
    /// The part of the damping that the devices render.
    damped: Damped,
    /// The model by which the springs place the handles, for [`PLACES`] of its horizon at most.
    placing: LocalModel,
    /// How solvers of the body are made.
    recipe: Recipe,
    /// Cut-off of the handles' paths (Hz).
    smoothing: f64,
    /// Makes the solvers of changes; `None` before the first change.
    background: Option<Background<Box<Rebuild>>>,
    /// The hands that join with the change that is under way.
    joining: Option<Vec<Joining>>,
    /// The tears of the body; `None` for a body that does not tear.
    tears: Option<BodyTears>,
}

/// A hand that is to hold a handle when a change lands.
struct Joining {
    device: u8,
    link: Option<Link>,
    path: HandlePath,
}

/// The parts of which a [`HostBody`] is made.
pub struct HostBodyParts {
    /// Name of the body.
    pub name: String,
    /// How it is solved and why so, for people.
    pub solved: String,
    /// The physics, at rest.
    pub body: Body,
    /// The solver that steps and condenses the body.
    pub(super) solver: Solver,
    /// How the solver is made again when the body's topology changes.
    pub recipe: Recipe,
    /// Cut-off of the handles' paths (Hz).
    pub smoothing: f64,
    /// The handles' paths, in the body's order.
    pub paths: Vec<HandlePath>,
    /// The device of each handle.
    pub devices: Vec<u8>,
    /// What devices of one or two degrees of freedom render.
    pub projected: Projected,
    /// Length of a step (s).
    pub step: f64,
    /// Publication period (s).
    pub period: f64,
    /// The largest age at which models must be good (s): from a model's reference to the last tick that uses the
    /// model.
    pub horizon: f64,
    /// The time over which models foresee the response of the body (s).
    pub response: f64,
    /// Whether models say how much energy they store.
    pub publishes_energy: bool,
    /// The virtual coupling between devices and body; without one, devices render the body's local model itself.
    pub coupling: Option<VirtualCoupling>,
    /// What each device of the scene can render; empty where the devices render the body's local model whatever its
    /// stiffness.
    pub renderable: Vec<Renderable>,
    /// The tears of the body; `None` for a body that does not tear.
    pub tears: Option<BodyTears>,
}

impl HostBody {
    /// A body at rest that has published no model.
    pub fn new(parts: HostBodyParts) -> Self {
        let mut model = LocalModel::empty();
        model.head.period = parts.period;
        model.head.handle_count = parts.paths.len().min(MAX_HANDLES) as u8;
        model.head.horizon = parts.horizon;
        let weights = parts.body.handle_weights();
        let origins = (0..parts.paths.len()).filter_map(|handle| {
            let report = parts.body.handle_report(handle);
            report.map(|report| report.pose.position)
        });
        let stored = parts
            .publishes_energy
            .then(|| Stored::new(origins.collect()));
        for ((reference, device), weight) in
            model.handles.iter_mut().zip(&parts.devices).zip(weights)
        {
            reference.device = *device;
            reference.weight = weight;
            parts.projected.weight(reference);
        }
        Self {
            stored,
            coupling: parts.coupling,
            springs: SeriesSprings::of(&parts.devices, &parts.renderable),
            damped: Damped::default(),
            placing: model,
            renderable: parts.renderable,
            name: parts.name,
            solved: parts.solved,
            targets: Vec::with_capacity(parts.paths.len()),
            body: parts.body,
            solver: parts.solver,
            paths: parts.paths,
            devices: parts.devices,
            projected: parts.projected,
            step: parts.step,
            clock: BodyClock::new(parts.step),
            newest_ns: None,
            time_ns: None,
            behind: false,
            sound: true,
            is_joined: false,
            fault: None,
            publishes: false,
            tally: Tally::default(),
            response: parts.response,
            model,
            recipe: parts.recipe,
            smoothing: parts.smoothing,
            background: None,
            joining: None,
            tears: parts.tears,
        }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it is solved and why so, for people.
    pub fn solved(&self) -> &str {
        &self.solved
    }

    /// The physics.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The device of each hand on the body, and the pose of its handle.
    pub(super) fn hands(&self) -> impl Iterator<Item = (usize, Pose)> {
        let devices = self.devices.iter().enumerate();
        devices.filter_map(|(handle, device)| {
            let report = self.body.handle_report(handle)?;
            Some((usize::from(*device), reference_of(*device, report).pose))
        })
    }

    /// Gives the body the physics and the solver of `other` from now on. Its hands, paths and sequence of models
    /// continue. A change that is under way is dropped, because it is a change of the old physics.
    ///
    /// # Errors
    /// [`BodyError`] if the two bodies are not of the same mesh. Nothing is changed in this case.
    pub fn exchange(&mut self, mut other: Self) -> Result<(), BodyError> {
        other
            .body
            .continue_from(&self.body, &BodyMap::identity(&self.body))?;
        if let Some(stored) = &mut self.stored {
            let [before, after] = [&self.body, &other.body].map(Body::elastic_energy);
            stored.exchange(&self.body, before, after, &self.model);
        }
        self.body = other.body;
        self.solver = other.solver;
        self.recipe = other.recipe;
        (self.background, self.joining) = (None, None);
        if let Some(tears) = &mut self.tears {
            // The same shape stores another energy.
            tears.balance = Balance::default();
            tears.tearing.begin_balance();
        }
        Ok(())
    }

    /// Takes one tick's record.
    pub fn follow(&mut self, record: &TickRecord) {
        self.newest_ns = Some(record.time_ns);
        for path in &mut self.paths {
            path.follow(record);
        }
        for hand in self.joining.iter_mut().flatten() {
            hand.path.follow(record);
        }
    }

    /// Begins a step towards the poses of the hands at the end of the step.
    pub(super) fn predict(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        self.tally = Tally::default();
        self.publishes = false;
        self.time_ns = self.newest_ns.map(|newest| self.clock.step(newest));
        self.behind = self.aim(self.time_ns.unwrap_or(0));
        self.sound = false;
        if let Some(tears) = &self.tears {
            tears.balance.check()?;
        }
        self.solver
            .predict(&mut self.body, self.step, watch, &mut self.tally)?;
        self.sound = true;
        Ok(())
    }

    /// Sets up the step's equation. Does nothing where an earlier stage of the step failed.
    pub(super) fn constrain(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        if core::mem::take(&mut self.sound) {
            self.solver
                .constrain(&mut self.body, &self.targets, watch)?;
            self.sound = true;
        }
        Ok(())
    }

    /// Wakes a body that sleeps.
    pub(super) fn wake(&mut self) {
        self.solver.wake();
    }

    /// Lends the step's equation to a group of joined bodies; `None` if an earlier stage of the step failed.
    pub(super) fn equation(&mut self) -> Option<Equation<'_, f64>> {
        if !core::mem::take(&mut self.sound) {
            return None;
        }
        self.solver.equation()
    }

    /// Notes that a group has solved the body's equation, or could not, in `time` (ns).
    pub(super) fn solved_in(&mut self, time: u64) {
        self.sound = self.solver.solved_in(time);
        self.is_joined = true;
    }

    /// Length of a step (s).
    pub(super) fn step(&self) -> f64 {
        self.step
    }

    /// Solves the step's equation, unless a group has solved it. Does nothing where an earlier stage of the step failed.
    pub(super) fn solve(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        if core::mem::take(&mut self.is_joined) {
            return Ok(());
        }
        if core::mem::take(&mut self.sound) {
            self.solver.solve(watch)?;
            self.sound = true;
        }
        Ok(())
    }

    /// Takes the step, and makes the model to publish, if one is due. Does nothing where an earlier stage of the step
    /// failed.
    pub(super) fn finish(
        &mut self,
        publishes: bool,
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        if !self.sound {
            return Ok(());
        }
        self.solver.finish(&mut self.body, watch, &mut self.tally)?;
        self.tear(watch);
        self.weigh()?;
        let solved = watch.now_ns();

        // Before the first record the state has no time.
        let Some(time_ns) = self.time_ns else {
            return Ok(());
        };
        // Where no record comes for long, the body's time stops. The tick would refuse a second model of the same
        // time.
        let published = self.model.head.sequence > 0 && time_ns == self.model.head.time_ns;
        // No hand feels a body that has no handle. When the last hand lets go, its force fades with the age of the last
        // model.
        let held = !self.devices.is_empty();
        if !publishes || published || self.behind || !held {
            return Ok(());
        }
        self.condense()?;
        self.limit();
        let elapsed = time_ns.saturating_sub(self.model.head.time_ns) as f64 * 1e-9;
        self.model.head.sequence += 1;
        self.model.head.time_ns = time_ns;
        for (i, reference) in self
            .model
            .handles
            .iter_mut()
            .take(self.devices.len())
            .enumerate()
        {
            if let Some(report) = self.body.handle_report(i) {
                *reference = HandleReference {
                    piece: reference.piece,
                    weight: reference.weight,
                    drift: reference.drift,
                    tear_slope: reference.tear_slope,
                    ..reference_of(reference.device, report)
                };
                self.projected.wrench(reference);
            }
        }
        if let Some(stored) = &mut self.stored {
            let elastic = self.solver.elastic_energy();
            match &mut self.tears {
                Some(tears) if tears.parting.groups() > 1 => {
                    let sums = tears.parting.sum(&self.body);
                    stored.publish_pieces(&self.body, sums, &mut self.model);
                }
                _ => stored.publish(&self.body, elastic, &mut self.model),
            }
            stored.publish_tear_area(&mut self.model);
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.through(&self.model);
        }
        if let Some(springs) = &mut self.springs {
            let acted = springs.model().is_some();
            springs.through(&self.model, elapsed);
            let age = time_ns.saturating_sub(self.placing.head.time_ns) as f64 * 1e-9;
            if !acted || age >= (PLACES * self.model.head.horizon).min(LONGEST_PLACED) {
                self.placing.copy_used_from(&self.model);
            }
        }
        let springs = self.springs.as_ref().and_then(SeriesSprings::model);
        let felt = springs.unwrap_or(&self.model);
        self.damped.see(felt, &self.renderable);
        self.publishes = true;
        self.tally.condense = Some(watch.now_ns().saturating_sub(solved));
        Ok(())
    }

    /// The stiffest direction so far that the devices could not render.
    pub fn stiffest(&self) -> Option<StiffDirection> {
        self.springs.as_ref().and_then(SeriesSprings::stiffest)
    }

    /// The handle and the direction of whose damping the devices have rendered the least part so far; `None` where they
    /// rendered the whole.
    pub fn least_damped(&self) -> Option<DampedDirection> {
        self.damped.least()
    }

    /// The directions of the last model that the devices cannot render, stiffest first.
    pub fn stiff_directions(&self) -> Vec<StiffDirection> {
        let springs = self.springs.iter();
        springs.flat_map(SeriesSprings::directions).collect()
    }

    /// Reads ahead what a later step will need.
    pub(super) fn read_ahead(&mut self) {
        self.solver.read_ahead();
    }

    /// The counts and times of the present step.
    pub(crate) fn tally(&self) -> &Tally {
        &self.tally
    }

    /// The model that the present step publishes, if one is due.
    pub(super) fn published(&self) -> Option<&LocalModel> {
        let coupled = self.coupling.as_ref().map(VirtualCoupling::model);
        let softened = || self.springs.as_ref().and_then(SeriesSprings::model);
        let model = coupled.or_else(softened).unwrap_or(&self.model);
        self.publishes.then_some(model)
    }

    /// Sets the targets of the handles for the next step: the poses of the hands at `time_ns`, or of the proxies where
    /// springs lie between the hands and the body. A handle moves no
    /// faster than its hand plus [`CATCH_UP`], and turns no faster than its hand plus [`TURN_AFTER`]. Returns whether
    /// a handle stays behind its hand. After a stall a hand may be anywhere. If its handle went there at once, the
    /// model would show the impact and not the body.
    fn aim(&mut self, time_ns: u64) -> bool {
        let mut behind = false;
        self.targets.clear();
        let poses = self.paths.iter().map(|path| path.pose_at(time_ns));
        self.targets.extend(poses.map(|pose| HandlePose {
            position: pose.position,
            rotation: pose.rotation,
        }));
        if let Some(springs) = &self.springs {
            springs.aim(
                &mut self.targets,
                &self.placing,
                self.placing.ahead(time_ns),
            );
        }
        for (index, (path, target)) in self.paths.iter().zip(&mut self.targets).enumerate() {
            if let Some(report) = self.body.handle_report(index) {
                let from = &report.pose;
                let speed = path.velocity().norm() + CATCH_UP;
                let displacement = target.position - from.position;
                if let Some(fraction) = shortened(displacement.norm(), speed * self.step) {
                    target.position = from.position + displacement * fraction;
                    behind = true;
                }
                // A device that senses no rotation reports the same quaternion in every tick.
                if target.rotation != from.rotation {
                    let speed = path.turning().norm() + TURN_AFTER;
                    let turn = (target.rotation * from.rotation.inverse()).scaled_axis();
                    if let Some(fraction) = shortened(turn.norm(), speed * self.step) {
                        let part = UnitQuaternion::from_scaled_axis(turn * fraction);
                        target.rotation = part * from.rotation;
                        behind = true;
                    }
                }
            }
        }
        behind
    }

    /// Lets the tears grow. A torn body begins an epoch.
    fn tear(&mut self, watch: &dyn Stopwatch) {
        let Some(tears) = &mut self.tears else {
            return;
        };
        let start = watch.now_ns();
        let torn = self
            .solver
            .tear(&mut self.body, &mut tears.tearing, &mut self.tally);
        if torn {
            self.model.head.epoch = self.model.head.epoch.saturating_add(1);
            let parted = tears.tearing.report().parted;
            if let Some(from) = tears.parting.follow(&self.body, parted) {
                self.part(from);
            }
        }
        if let Some(tears) = &mut self.tears {
            tears.parting.dismiss(&mut self.body);
        }
        self.tally.torn = torn;
        self.tally.tear = Some(watch.now_ns().saturating_sub(start));
    }

    /// Checks the energy of a body that tears.
    fn weigh(&mut self) -> Result<(), StepFault> {
        let Some(tears) = &mut self.tears else {
            return Ok(());
        };
        let elastic = self.solver.elastic_energy();
        tears.balance.take(&self.body, elastic, self.step)
    }

    /// Parts the account of energy with the groups of the handles; `from` is the old group of each new group.
    fn part(&mut self, from: [u8; MAX_HANDLES]) {
        let Some(tears) = &mut self.tears else {
            return;
        };
        let elastic = self.solver.elastic_energy();
        let (body, model) = (&self.body, &mut self.model);
        // The energies of the old groups are those of the latest sums, which the last publication took.
        let (sums, before) = tears.parting.latest();
        if let Some(stored) = &self.stored {
            stored.energies(body, elastic, sums, model, before);
        }
        tears.parting.sum(body);
        tears.parting.name(body, model);
        let (sums, before) = tears.parting.latest();
        if let Some(stored) = &mut self.stored {
            stored.part(before, &from[..sums.len()], body, sums, model);
        }
        for reference in &mut self.model.handles[..usize::from(self.model.head.handle_count)] {
            self.projected.weight(reference);
        }
    }

    /// Says in the model how far the handles can move before the next tear goes on.
    fn limit(&mut self) {
        let Some(tears) = &mut self.tears else {
            return;
        };
        let handles = &mut self.model.handles;
        for handle in handles.iter_mut() {
            handle.tear_slope = Vec6::zeros();
        }
        let tearing = &mut tears.tearing;
        let limit = self
            .solver
            .tear_limit(&self.body, tearing, &mut |handle, motion, slope| {
                if let Some(handle) = handles.get_mut(handle) {
                    handle.tear_slope[motion] = slope;
                }
            });
        self.model.head.tear_limit = match limit {
            Some(limit) => TearLimit {
                root: limit.root,
                critical: limit.critical,
                area: 0.0,
            },
            None => TearLimit::none(),
        };
    }

    /// The tears of the body; `None` for a body that does not tear.
    pub fn tears(&self) -> Option<&BodyTears> {
        self.tears.as_ref()
    }

    fn condense(&mut self) -> Result<(), StepFault> {
        let Some(condensed) = self.solver.condense(&self.body, self.response)? else {
            return Ok(());
        };
        fill_blocks(&mut self.model, condensed);
        self.projected.blocks(&mut self.model);
        if let Some(stored) = &mut self.stored {
            stored.keep(&self.model, condensed.length);
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.set_length(condensed.length);
        }
        let clips = [condensed.stiffness_clip, condensed.damping_clip];
        if clips.iter().any(|clip| clip.count > 0) {
            let worst = clips.iter().fold(0.0_f64, |worst, c| worst.max(c.fraction));
            self.tally.clip = Some(worst);
        }
        Ok(())
    }
}

/// The fraction of a displacement or a turn of `length` that is as long as `most`; `None` if the whole is no longer.
fn shortened(length: f64, most: f64) -> Option<f64> {
    (length > most).then(|| most / length)
}

/// Copies condensed stiffness, damping and drift into a local model.
pub fn fill_blocks(model: &mut LocalModel, condensed: &Condensed) {
    let handles = usize::from(model.head.handle_count);
    for i in 0..handles {
        for j in 0..handles {
            let block = |matrix: &Square| Mat6::from_fn(|r, c| matrix[(6 * i + r, 6 * j + c)]);
            model.stiffness[i][j] = block(&condensed.stiffness);
            model.damping[i][j] = block(&condensed.damping);
        }
        let drift = Vec6::from_column_slice(&condensed.drift[6 * i..6 * i + 6]);
        model.handles[i].drift = Wrench::from_stacked(&drift);
    }
}

/// A handle's reference in a local model, from the last step's report on that handle.
pub fn reference_of(device: u8, report: &HandleReport) -> HandleReference {
    HandleReference {
        device,
        pose: Pose {
            position: report.pose.position,
            rotation: report.pose.rotation,
        },
        twist: Twist {
            linear: report.linear_velocity,
            angular: report.angular_velocity,
        },
        wrench: Wrench {
            force: report.wrench_on_hand.force,
            moment: report.wrench_on_hand.moment,
        },
        ..HandleReference::zero()
    }
}
