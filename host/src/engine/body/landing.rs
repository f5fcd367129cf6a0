//! A change of a body in the host's loop, from its beginning to its landing.
//!
//! A landing gives the body another mesh, handles or supports and another solver between two steps. Positions,
//! velocities, the paths of the hands that stay, the sequence of models and the energy that hands can recover continue
//! without a jump. Models name the new handles from the next publication on, in a new epoch.

use super::{HostBody, Joining};
use crate::engine::background::Background;
use crate::engine::change::{ChangeError, Edit, Hand, Made, Rebuild};
use crate::engine::path::HandlePath;
use crate::engine::stats::StepFault;
use crate::engine::stiff::SeriesSprings;
use crate::engine::stored::Stored;
use crate::engine::virtual_coupling::{Link, VirtualCoupling};
use physics::{Body, HandlePose};
use rt_core::{HandleReference, LocalModel, MAX_DEVICES, MAX_HANDLES, Pose, Vec3};

impl HostBody {
    /// Whether a change is under way.
    pub fn is_changing(&self) -> bool {
        self.joining.is_some()
    }

    /// Begins a change: `edits` in their order.
    ///
    /// # Errors
    /// [`ChangeError`]; nothing has begun then.
    pub(in crate::engine) fn change(&mut self, edits: Vec<Edit>) -> Result<(), ChangeError> {
        if self.joining.is_some() {
            return Err(ChangeError::UnderWay);
        }
        // The copy on which the change is made would miss the edits of the tears.
        if self.tears.is_some() {
            return Err(ChangeError::Tears);
        }
        let mut joining = Vec::new();
        for edit in &edits {
            if let Edit::Grab(grip) = edit {
                let device = grip.device;
                if usize::from(device) >= MAX_DEVICES {
                    return Err(ChangeError::NoDevice { device });
                }
                if self.coupling.is_some() && grip.link.is_none() {
                    return Err(ChangeError::NoLink { device });
                }
                let start = Pose::at(grip.spec.origin);
                joining.push(Joining {
                    device,
                    link: grip.link,
                    path: HandlePath::joining(usize::from(device), self.smoothing, start),
                });
            }
        }
        let (recipe, step) = (self.recipe, self.step);
        let background = self
            .background
            .get_or_insert_with(|| Background::new(recipe.is_real(), step));
        let copy = self.body.clone();
        background.begin(Box::new(Rebuild::new(recipe, self.response, copy, edits)));
        self.joining = Some(joining);
        Ok(())
    }

    /// Lands the change that is under way, if its solver is ready. Returns whether it has landed.
    ///
    /// # Errors
    /// [`StepFault`] for a change that cannot be made. The change is over then, and the body continues as it was.
    pub(in crate::engine) fn land(&mut self) -> Result<bool, StepFault> {
        if self.joining.is_none() {
            return Ok(false);
        }
        let done = match self
            .background
            .as_mut()
            .map(|background| background.done(1))
        {
            Some(Ok(None)) => return Ok(false),
            Some(Ok(done)) => done,
            Some(Err(_)) | None => None,
        };
        let joining = self.joining.take().unwrap_or_default();
        let Some((mut rebuild, made)) = done.and_then(|mut rebuild| {
            let made = rebuild.take()?;
            Some((rebuild, made))
        }) else {
            self.background = None;
            return Err(ChangeError::Lost.into());
        };
        let spent = self.continue_as(made?, &joining)?;
        rebuild.keep(spent);
        if let Some(background) = &mut self.background {
            background.drop(rebuild);
        }
        Ok(true)
    }

    /// Continues with the body, the handles and the solver of `made`. Returns those of before.
    fn continue_as(&mut self, made: Made, joining: &[Joining]) -> Result<Made, ChangeError> {
        let Made {
            mut body,
            map,
            replaced,
            hands,
            solver,
        } = made;
        body.continue_from(&self.body, &map)?;
        let now_ns = self.time_ns.unwrap_or(0);
        for (handle, join) in joined(&hands, joining) {
            if join.path.time_ns().is_some() {
                let pose = join.path.pose_at(now_ns);
                body.hold_at(
                    handle,
                    &HandlePose {
                        position: pose.position,
                        rotation: pose.rotation,
                    },
                )?;
            }
        }

        let model = self.renamed(&hands, joining);
        if let Some(stored) = &mut self.stored {
            let origins = origins(stored, &hands, &body);
            // The elements of a copy store the same energy, and a sum over all of them takes as long as a step.
            let before = self.solver.elastic_energy();
            let after = if replaced {
                body.elastic_energy()
            } else {
                before
            };
            *stored = stored.rebuilt(
                (&self.body, before, &self.model),
                (&body, after, &model),
                origins,
            );
        }
        self.model = model;
        self.devices = each(&hands, joining, &self.devices, |join| join.device);
        self.springs = SeriesSprings::of(&self.devices, &self.renderable);
        if let Some(coupling) = &mut self.coupling {
            let links: Vec<Option<Link>> = coupling.links().iter().copied().map(Some).collect();
            let links = each(&hands, joining, &links, |join| join.link);
            *coupling = VirtualCoupling::new(links.into_iter().flatten().collect());
        }
        self.paths = each(&hands, joining, &self.paths, |join| join.path.clone());
        Ok(Made {
            body: core::mem::replace(&mut self.body, body),
            solver: core::mem::replace(&mut self.solver, solver),
            map,
            replaced,
            hands,
        })
    }

    /// The model with the handles of `hands`, in a new epoch. The next publication fills in the rest. A handle that
    /// joins bears no weight: the hand took hold of it wherever it was.
    fn renamed(&self, hands: &[Hand], joining: &[Joining]) -> LocalModel {
        let mut model = self.model;
        model.head.epoch = model.head.epoch.saturating_add(1);
        let handles = each(hands, joining, &self.model.handles, |join| {
            HandleReference {
                device: join.device,
                ..HandleReference::zero()
            }
        });
        model.head.handle_count = handles.len().min(MAX_HANDLES) as u8;
        for (mine, handle) in model.handles.iter_mut().zip(handles) {
            *mine = handle;
        }
        model
    }
}

/// For each hand after a change, its entry in `kept` or the entry that `join` makes.
fn each<V: Clone>(
    hands: &[Hand],
    joining: &[Joining],
    kept: &[V],
    join: impl Fn(&Joining) -> V,
) -> Vec<V> {
    let entry = |hand: &Hand| match *hand {
        Hand::Kept(old) => kept.get(old).cloned(),
        Hand::Joined(number) => joining.get(number).map(&join),
    };
    hands.iter().filter_map(entry).collect()
}

/// The handles that join, each with its hand.
fn joined<'a>(
    hands: &'a [Hand],
    joining: &'a [Joining],
) -> impl Iterator<Item = (usize, &'a Joining)> {
    let numbered = hands.iter().enumerate();
    numbered.filter_map(|(handle, hand)| match *hand {
        Hand::Joined(number) => joining.get(number).map(|join| (handle, join)),
        Hand::Kept(_) => None,
    })
}

/// For each handle of `body`, the position from which the potential of its weight counts (m).
fn origins(stored: &Stored, hands: &[Hand], body: &Body) -> Vec<Vec3> {
    let numbered = hands.iter().enumerate();
    numbered
        .map(|(handle, hand)| {
            let kept = match *hand {
                Hand::Kept(old) => stored.origin(old),
                Hand::Joined(_) => None,
            };
            let held = || {
                body.handle_report(handle)
                    .map(|report| report.pose.position)
            };
            kept.or_else(held).unwrap_or_default()
        })
        .collect()
}
