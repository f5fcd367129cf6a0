//! Publishes local models of a body: what its devices render.
//!
//! A publisher belongs to a body of the physics. It keeps the data that outlast one model: the sequence, the topology epoch,
//! the account of the energy that hands can recover, and the springs between devices and body. The engine, a study or another
//! host steps and condenses the body, and gives the result to the publisher.

use super::damped::{Damped, DampedDirection};
use super::hands::Regrip;
use super::parting::Parting;
use super::projected::Projected;
use super::stiff::{Renderable, SeriesSprings, StiffDirection};
use super::stored::Stored;
use super::virtual_coupling::{Spring, VirtualCoupling};
use physics::linear::dense::Square;
use physics::{Body, Condensed, HandlePose, HandleReport, PieceSums};
use rt_core::{
    HandleReference, LocalModel, MAX_HANDLES, Mat6, Pose, TearLimit, Twist, Vec6, Wrench,
};

/// Time for which a model places the handles behind springs, as a multiple of its horizon. The stiffness of a model holds the
/// inertia of the body for its horizon. The wrench of a younger model holds the inertia of the last change of a handle's
/// velocity, which is larger: handles that such a wrench places swing from model to model. Over longer times than
/// [`LONGEST_PLACED`] (s) inertia is small compared with stiffness, and the past of a body that is not linear would
/// place its handles.
const PLACES: f64 = 2.0;
const LONGEST_PLACED: f64 = 0.015;

/// How the models of a body are published.
#[derive(Default)]
pub struct Publishing {
    /// Publication period (s).
    pub period: f64,
    /// The largest age at which models must be good (s): from a model's reference to the last tick that uses the
    /// model.
    pub horizon: f64,
    /// Whether models say how much energy they store.
    pub energy: bool,
    /// The axes along which the devices move; by default, all devices move along all axes.
    pub projected: Projected,
    /// The virtual coupling between devices and body; without one, devices render the body's local model itself.
    pub coupling: Option<VirtualCoupling>,
    /// What each device can render; empty if the devices render the body's local model whatever its stiffness.
    pub renderable: Vec<Renderable>,
}

/// The elastic energy of a body (J).
#[derive(Clone, Copy, Debug)]
pub enum Elastic<'a> {
    /// The energy of the whole body.
    Whole(f64),
    /// The energies of the groups of handles of a body that has come apart, among the sums over each group.
    Pieces(&'a [PieceSums]),
}

/// Publishes the local models of one body.
pub struct Publisher {
    /// The model of the body itself.
    model: LocalModel,
    projected: Projected,
    stored: Option<Stored>,
    coupling: Option<VirtualCoupling>,
    renderable: Vec<Renderable>,
    /// Springs in series with the directions that the devices cannot render.
    springs: Option<SeriesSprings>,
    /// The model by which the springs place the handles, for [`PLACES`] of its horizon at most.
    placing: LocalModel,
    /// The part of the damping that the devices render.
    damped: Damped,
}

impl Publisher {
    /// A publisher that has published no model of `body`, whose handles the `devices` hold, in the body's order.
    pub fn new(body: &Body, devices: &[u8], publishing: Publishing) -> Self {
        let mut model = LocalModel::empty();
        model.head.period = publishing.period;
        model.head.handle_count = devices.len().min(MAX_HANDLES) as u8;
        model.head.horizon = publishing.horizon;
        let origins = (0..devices.len()).filter_map(|handle| {
            let report = body.handle_report(handle);
            report.map(|report| report.pose.position)
        });
        let origins: Vec<_> = origins.collect();
        let handles = model.handles.iter_mut().zip(devices);
        for ((reference, device), weight) in handles.zip(body.handle_weights()) {
            reference.device = *device;
            reference.weight = weight;
            publishing.projected.weight(reference);
        }
        let stored = publishing
            .energy
            .then(|| Stored::new(body, body.elastic_energy(), origins, &model));
        Self {
            placing: model,
            model,
            stored,
            springs: SeriesSprings::of(devices, &publishing.renderable),
            projected: publishing.projected,
            coupling: publishing.coupling,
            renderable: publishing.renderable,
            damped: Damped::default(),
        }
    }

    /// The model that the devices render, as it was published last.
    pub fn model(&self) -> &LocalModel {
        let coupled = self.coupling.as_ref().map(VirtualCoupling::model);
        let softened = || self.springs.as_ref().and_then(SeriesSprings::model);
        coupled.or_else(softened).unwrap_or(&self.model)
    }

    /// Whether a model of the body at `time_ns` can be published. The tick would refuse a second model of the same time. No
    /// hand feels a body that has no handle: when the last hand lets go, its force fades with the age of the last model.
    pub fn is_due(&self, time_ns: u64) -> bool {
        let published = self.model.head.sequence > 0 && time_ns == self.model.head.time_ns;
        !published && self.model.head.handle_count > 0
    }

    /// Takes the stiffness, the damping and the drift of the models from now on.
    pub fn take(&mut self, condensed: &Condensed) {
        fill_blocks(&mut self.model, condensed);
        self.projected.blocks(&mut self.model);
        if let Some(stored) = &mut self.stored {
            stored.keep(&self.model, condensed.length);
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.set_length(condensed.length);
        }
    }

    /// Whether the models have a limit.
    pub(super) fn has_limit(&self) -> bool {
        self.model.head.tear_limit.is_some()
    }

    /// States in the next models how far the handles can move before a tear grows, or before contacts part or close. `find` gives the limit, and calls
    /// its argument with the handle, the motion and the slope of each motion.
    pub fn limit(
        &mut self,
        find: impl FnOnce(&mut dyn FnMut(usize, usize, f64)) -> Option<physics::TearLimit>,
    ) {
        let handles = &mut self.model.handles;
        for handle in handles.iter_mut() {
            handle.tear_slope = Vec6::zeros();
        }
        let limit = find(&mut |handle, motion, slope| {
            if let Some(handle) = handles.get_mut(handle) {
                handle.tear_slope[motion] = slope;
            }
        });
        self.model.head.tear_limit = limit.map_or(TearLimit::none(), |limit| TearLimit {
            root: limit.root,
            critical: limit.critical,
            area: if limit.is_touch { -1.0 } else { 0.0 },
        });
    }

    /// Notes the work that contacts with other bodies did on the body in a step (J).
    pub(super) fn receive(&mut self, work: f64) {
        self.model.head.received += work;
    }

    /// Publishes a model of `body`, which has the energy `elastic`, at `time_ns`.
    pub fn publish(&mut self, body: &Body, elastic: Elastic<'_>, time_ns: u64) -> &LocalModel {
        let elapsed = time_ns.saturating_sub(self.model.head.time_ns) as f64 * 1e-9;
        self.model.head.sequence += 1;
        self.model.head.time_ns = time_ns;
        let count = usize::from(self.model.head.handle_count);
        for (i, reference) in self.model.handles[..count].iter_mut().enumerate() {
            if let Some(report) = body.handle_report(i) {
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
            match elastic {
                Elastic::Whole(elastic) => stored.publish(body, elastic, &mut self.model),
                Elastic::Pieces(sums) => stored.publish_pieces(body, sums, &mut self.model),
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
        self.model()
    }

    /// Makes the `targets` of the handles, the poses of the devices at `time_ns`, the poses of the proxies if springs lie
    /// between the devices and the body.
    pub fn place(&self, targets: &mut [HandlePose], time_ns: u64) {
        if let Some(springs) = &self.springs {
            springs.aim(targets, &self.placing, self.placing.ahead(time_ns));
        }
    }

    /// The device of each handle, in the body's order.
    pub fn devices(&self) -> impl Iterator<Item = u8> {
        self.model.handles().map(|handle| handle.device)
    }

    /// Whether models say how much energy they store.
    pub fn has_energy(&self) -> bool {
        self.stored.is_some()
    }

    /// Whether devices touch the body through a virtual coupling.
    pub(super) fn is_coupled(&self) -> bool {
        self.coupling.is_some()
    }

    /// Begins a topology epoch.
    pub fn begin_epoch(&mut self) {
        self.model.head.epoch = self.model.head.epoch.saturating_add(1);
    }

    /// The stiffest direction so far that the devices could not render.
    pub fn stiffest(&self) -> Option<StiffDirection> {
        self.springs.as_ref().and_then(SeriesSprings::stiffest)
    }

    /// The handle and the direction of whose damping the devices have rendered the least part so far; `None` if they
    /// rendered the whole.
    pub fn least_damped(&self) -> Option<DampedDirection> {
        self.damped.least()
    }

    /// The directions of the last model that the devices cannot render, stiffest first.
    pub fn stiff_directions(&self) -> Vec<StiffDirection> {
        let springs = self.springs.iter();
        springs.flat_map(SeriesSprings::directions).collect()
    }

    /// Continues with the body `after` in place of `before`, at the same shape and with the same handles.
    pub(super) fn exchange(&mut self, before: &Body, after: &Body) {
        if let Some(stored) = &mut self.stored {
            let energies = [before, after].map(Body::elastic_energy);
            stored.exchange(before, energies, &self.model);
        }
    }

    /// Parts the account of energy with the groups of the handles; `from` is the old group of each new group. The elastic
    /// energy of the whole body is `elastic` (J).
    pub(super) fn part(
        &mut self,
        parting: &mut Parting,
        from: [u8; MAX_HANDLES],
        body: &Body,
        elastic: f64,
    ) {
        let model = &mut self.model;
        // The energies of the old groups are those of the latest sums, which the last publication took.
        let (sums, before) = parting.latest();
        if let Some(stored) = &self.stored {
            stored.energies(body, elastic, sums, model, before);
        }
        parting.sum(body);
        parting.name(body, model);
        let (sums, before) = parting.latest();
        if let Some(stored) = &mut self.stored {
            let leads =
                |old: usize, new: usize| from.get(new).is_some_and(|of| usize::from(*of) == old);
            stored.part(before, &leads, body, sums, model);
        }
        for reference in &mut model.handles[..usize::from(model.head.handle_count)] {
            self.projected.weight(reference);
        }
    }

    /// Continues with other handles, in a new epoch. `before` and `after` are the body with its elastic energy (J) on either
    /// side of the change. The next publication fills in the rest. A handle that joins carries no weight: the hand took hold of
    /// the handle at its present position. A body that tears has `partings` before and after the change, by which its account goes
    /// to the new groups of its handles.
    pub(super) fn regrip(
        &mut self,
        regrip: Regrip<'_>,
        before: (&Body, f64),
        after: (&Body, f64),
        partings: Option<(&mut Parting, &mut Parting)>,
    ) {
        let mut model = self.model;
        model.head.epoch = model.head.epoch.saturating_add(1);
        let handles = regrip.each(&self.model.handles, |join| HandleReference {
            device: join.device,
            ..HandleReference::zero()
        });
        model.head.handle_count = handles.len().min(MAX_HANDLES) as u8;
        for (mine, handle) in model.handles.iter_mut().zip(handles) {
            *mine = handle;
        }
        let sums = partings.and_then(|(old, new)| {
            new.number(&mut model);
            (old.groups().max(new.groups()) > 1).then(|| [old.sum(before.0), new.sum(after.0)])
        });
        if let Some(stored) = &mut self.stored {
            let held = |handle| {
                let report = after.0.handle_report(handle);
                report.map(|report| report.pose.position)
            };
            let origins = regrip.numbered().map(|(handle, kept)| {
                let kept = kept.and_then(|old| stored.origin(old));
                kept.or_else(|| held(handle)).unwrap_or_default()
            });
            let origins = origins.collect();
            let (old, new) = (&self.model, &model);
            *stored = if let Some([sums, next]) = sums {
                let leads = |from: usize, to: usize| {
                    let of = |of: &LocalModel, handle: usize| usize::from(of.handles[handle].piece);
                    let mut kept = regrip.numbered();
                    kept.any(|(new_one, kept)| {
                        kept.is_some_and(|kept| of(old, kept) == from) && of(new, new_one) == to
                    })
                };
                let states = [(before, old, sums), (after, new, next)];
                let [old, new] =
                    states.map(|((body, elastic), model, sums)| (body, elastic, model, sums));
                stored.regrouped(old, new, &leads, origins)
            } else {
                stored.rebuilt((before.0, before.1, old), (after.0, after.1, new), origins)
            };
        }
        self.model = model;
        let devices: Vec<u8> = self.devices().collect();
        self.springs = SeriesSprings::of(&devices, &self.renderable);
        if let Some(coupling) = &mut self.coupling {
            let links: Vec<Option<Spring>> = coupling.links().iter().copied().map(Some).collect();
            let links = regrip.each(&links, |join| join.link);
            *coupling = VirtualCoupling::new(links.into_iter().flatten().collect());
        }
    }
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
