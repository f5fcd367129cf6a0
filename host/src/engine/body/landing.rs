//! A change of a body in the host's loop, from its beginning to its landing.
//!
//! A landing gives the body another mesh, handles or supports and another solver between two steps. Positions,
//! velocities, the paths of the hands that stay, the sequence of models and the energy that hands can recover continue
//! without a jump. Models name the new handles from the next publication on, in a new epoch. The energy account of a torn
//! body goes with its hands to the pieces that they hold then.

use super::HostBody;
use crate::engine::background::Background;
use crate::engine::change::{ChangeError, Course, Edit, Made, Rebuild};
use crate::engine::hands::{Joining, Regrip};
use crate::engine::stats::StepFault;
use crate::engine::tears::UnderWay;
use physics::{BodyMap, Border, HandlePose};
use rt_core::{MAX_DEVICES, Pose};

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
        let tears = self.stepping.tears.as_ref();
        let course = Course {
            edits: tears.map(|tears| tears.tearing.journal().len()),
            may_touch: self.stepping.recipe.may_touch(),
        };
        let clamps = |edit: &Edit| match edit {
            Edit::Clamp { .. } => true,
            Edit::Grab(grip) => grip.spec.border == Border::Clamped,
            _ => false,
        };
        if tears.is_some() && edits.iter().any(clamps) {
            return Err(ChangeError::Clamped);
        }
        let mut joining = Vec::new();
        for edit in &edits {
            if let Edit::Grab(grip) = edit {
                let device = grip.device;
                if usize::from(device) >= MAX_DEVICES {
                    return Err(ChangeError::NoDevice { device });
                }
                if self.publisher.is_coupled() && grip.link.is_none() {
                    return Err(ChangeError::NoLink { device });
                }
                let start = Pose::at(grip.spec.origin);
                joining.push(self.hands.join(device, grip.link, start));
            }
        }
        let (recipe, step) = (self.stepping.recipe, self.stepping.step);
        let background = self
            .background
            .get_or_insert_with(|| Background::new(recipe.is_real(), step));
        if let Some(tears) = &mut self.stepping.tears {
            let replaces = |edit: &Edit| matches!(edit, Edit::Replace(_));
            tears.under_way = if edits.iter().any(replaces) {
                UnderWay::Mesh
            } else {
                UnderWay::Handles
            };
        }
        let (how, copy) = ((self.stepping.response, course), self.stepping.body.clone());
        background.begin(Box::new(Rebuild::new(recipe, how, copy, edits)));
        self.joining = Some(joining);
        Ok(())
    }

    /// Lands the change that is under way, if its solver is ready. Returns whether it has landed. If the mesh of the body
    /// has been replaced, `follow` is called with the map from the new body to the old one.
    ///
    /// # Errors
    /// [`StepFault`] for a change that cannot be made. The change is over then, and the body continues as it was.
    pub(in crate::engine) fn land(
        &mut self,
        follow: &mut dyn FnMut(&BodyMap),
    ) -> Result<bool, StepFault> {
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
        if let Some(tears) = &mut self.stepping.tears {
            tears.under_way = UnderWay::Nothing;
        }
        let Some((mut rebuild, made)) = done.and_then(|mut rebuild| {
            let made = rebuild.take()?;
            Some((rebuild, made))
        }) else {
            self.background = None;
            return Err(ChangeError::Lost.into());
        };
        let spent = self.continue_as(made?, &joining)?;
        if spent.replaced {
            follow(&spent.map);
        }
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
            mut map,
            replaced,
            edits,
            hands: made_hands,
            mut solver,
        } = made;
        let stepping = &mut self.stepping;
        if let (Some(tears), Some(edits), false) = (&stepping.tears, edits, replaced) {
            let journal = tears.tearing.journal();
            let newer = journal.get(edits..).unwrap_or_default();
            let overtaken = solver.catch_up(&mut body, newer);
            overtaken.map_err(ChangeError::Overtaken)?;
            map.vertices = (0..body.vertex_count() as u32).collect();
        }
        body.continue_from(&stepping.body, &map)?;
        let tears = stepping.tears.as_ref().map(|tears| {
            let continues = replaced.then_some(map.vertices.as_slice());
            let continued = tears.continued(&body, continues);
            continued.map_err(ChangeError::Replacement)
        });
        let mut continued = tears.transpose()?;
        let hands = Regrip {
            hands: &made_hands,
            joining,
        };
        let now_ns = self.hands.time_ns.unwrap_or(0);
        for (handle, join) in hands.joined() {
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
        // The elements of a copy store the same energy, and a sum over all of them takes as long as a step.
        let before = stepping.solver.elastic_energy();
        let after = if replaced {
            body.elastic_energy()
        } else {
            before
        };
        let partings = stepping.tears.as_mut().zip(continued.as_mut());
        let partings = partings.map(|(tears, (_, parting))| (&mut tears.parting, parting));
        let old = (&stepping.body, before);
        self.publisher.regrip(hands, old, (&body, after), partings);
        self.hands.regrip(hands);
        if let Some((tears, continued)) = stepping.tears.as_mut().zip(continued) {
            tears.go_on(continued);
            if !replaced {
                solver.take_pairs(&mut stepping.solver, &body);
            }
        }
        Ok(Made {
            body: core::mem::replace(&mut stepping.body, body),
            solver: stepping.solver.replace(solver),
            map,
            replaced,
            edits,
            hands: made_hands,
        })
    }
}
