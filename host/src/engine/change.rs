//! A change of a body's handles, supports or mesh while the body moves.
//!
//! A change begins a topology epoch, and every epoch needs another solver: another order of elimination, another
//! factor, other shapes. The construction of a solver takes many times as long as a step. A thread therefore makes the
//! change in the background, on a copy of the body, while the body and its solver continue. When the new solver is ready,
//! the new body continues the motion of the old one ([`Body::continue_from`]). Under the real clock the change lands with
//! the first step after the work; in virtual time it lands at a fixed step.
//!
//! **A body that tears** may tear on meanwhile: the changed copy then makes the same edits when the change lands. If its mesh
//! is replaced, no edit would fit, so tears rest until the change lands. The new mesh then takes over as a whole, intact or
//! with edits of its own: tears go on where a vertex of its border continues a tip
//! ([`Tearing::continued`](physics::Tearing::continued)).

use super::background::{Lost, Work};
use super::recipe::Recipe;
use super::solver::Solver;
use super::stats::StepFault;
use super::virtual_coupling::Spring;
use physics::contact::{Skin, Surfaces};
use physics::mesh::MeshError;
use physics::topology::{Origin, Reserve, Surface};
use physics::{Body, BodyError, BodyMap, HandleSpec, TearingError};
use rt_core::{MAX_DEVICES, MAX_HANDLES};

/// A new handle for a hand.
#[derive(Clone, Debug, PartialEq)]
pub struct Grip {
    /// The vertices and motions of the handle. The handle holds the vertices where they are when the change lands. Its
    /// origin is then the hand; `origin` counts only if no record of the hand has come by then.
    pub spec: HandleSpec,
    /// The device that holds it.
    pub device: u8,
    /// The link between the device and its proxy, under a scheme with proxies.
    pub link: Option<Spring>,
}

/// Makes another body from a copy of the present one, such as one with a torn mesh, and the map that leads from the
/// copy to it.
pub type Replace = Box<dyn FnOnce(Body) -> Result<(Body, BodyMap), BodyError> + Send>;

/// A part of a change.
pub enum Edit {
    /// Adds a handle. Its number is the number of handles before.
    Grab(Grip),
    /// Removes a handle. The numbers of later handles decrease by one.
    Release {
        /// The handle.
        handle: usize,
    },
    /// Adds a support that guides vertices along the axes that are `true`, where they are when the change lands.
    Guide {
        /// The vertices.
        vertices: Vec<u32>,
        /// The guided world axes.
        axes: [bool; 3],
    },
    /// Adds a support that holds vertices along all axes, where they are when the change lands, and clamps the border of a
    /// sheet between them.
    Clamp {
        /// The vertices.
        vertices: Vec<u32>,
    },
    /// Removes a support. The numbers of later supports decrease by one.
    Lift {
        /// The support.
        support: usize,
    },
    /// Replaces the body.
    Replace(Replace),
}

/// Why a change cannot be made. The body and its solver stay as they were.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChangeError {
    /// There is no such body.
    #[error("body {body} does not exist: the engine has {count} bodies, counted from 0")]
    NoBody {
        /// The number of the requested body.
        body: usize,
        /// Number of bodies.
        count: usize,
    },
    /// An earlier change of the same body has not landed.
    #[error(
        "an earlier change of the body has not landed yet; request this change again after that"
    )]
    UnderWay,
    /// A border of a sheet that tears is to be clamped.
    #[error(
        "the body tears, so its border cannot be clamped; hold it hinged, or guide its vertices along all axes"
    )]
    Clamped,
    /// A body that tears is to be replaced by one that cannot.
    #[error("the body tears, and its replacement cannot: {0}; replace it by such a sheet")]
    Replacement(TearingError),
    /// The tear has grown where the change holds the sheet.
    #[error("the body has torn on since the change was requested: {0}; request the change again")]
    Overtaken(TearingError),
    /// The triangles of a replaced body that may touch are no surface.
    #[error("the replaced body may touch, and its triangles are no surface: {0}")]
    Surface(#[from] MeshError),
    /// A device that does not exist is to hold a handle.
    #[error("device {device} cannot hold a handle: devices are 0 to {}", MAX_DEVICES - 1)]
    NoDevice {
        /// The number of the device.
        device: u8,
    },
    /// The scheme couples devices through proxies, but a grip has no link to its proxy.
    #[error(
        "the grip of device {device} has no link, but the scheme couples devices through proxies"
    )]
    NoLink {
        /// The number of the device.
        device: u8,
    },
    /// The body would have more handles than a local model.
    #[error("the body would have {found} handles; at most {MAX_HANDLES} are allowed")]
    TooManyHandles {
        /// The number of handles after the change.
        found: usize,
    },
    /// A replaced body has a handle that continues no handle.
    #[error("no device holds handle {handle} of the new body; grab it in an edit of its own")]
    Unheld {
        /// The handle.
        handle: usize,
    },
    /// An edit is refused by the physics.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The work was lost.
    #[error("the thread that makes solvers has ended")]
    Lost,
}

impl From<Lost> for ChangeError {
    fn from(_: Lost) -> Self {
        Self::Lost
    }
}

/// The source of the hand that holds a handle after a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Held {
    /// The handle of the old body.
    Kept(usize),
    /// The grip of the change, by number.
    Joined(usize),
}

/// What a changed body does beside its steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    /// The number of edits so far of a body that tears.
    pub(super) edits: Option<usize>,
    /// Whether it may touch.
    pub(super) may_touch: bool,
}

/// The result of a change.
pub(super) struct Made {
    pub(super) body: Body,
    pub(super) map: BodyMap,
    /// Whether an edit replaced the body, so that `body` is no copy with other handles and supports.
    pub(super) replaced: bool,
    /// The number of edits that the body has made, if it tears.
    pub(super) edits: Option<usize>,
    /// For each handle of `body`, its hand.
    pub(super) hands: Vec<Held>,
    pub(super) solver: Solver,
}

/// A change as background work: edits of a copy of the body, and its new solver.
pub(super) struct Rebuild {
    recipe: Recipe,
    /// The time over which models predict the response of the body (s).
    response: f64,
    course: Course,
    /// The copy and the edits, until the work begins.
    asked: Option<(Body, Vec<Edit>)>,
    /// The result; `None` before the work has ended.
    made: Option<Result<Made, StepFault>>,
}

impl Rebuild {
    /// The work of `edits` on `body`, a copy.
    pub(super) fn new(
        recipe: Recipe,
        (response, course): (f64, Course),
        body: Body,
        edits: Vec<Edit>,
    ) -> Self {
        Self {
            recipe,
            response,
            course,
            asked: Some((body, edits)),
            made: None,
        }
    }

    /// Takes the result, once.
    pub(super) fn take(&mut self) -> Option<Result<Made, StepFault>> {
        self.made.take()
    }

    /// Keeps an old body and its solver until this value is dropped.
    pub(super) fn keep(&mut self, spent: Made) {
        self.made = Some(Ok(spent));
    }
}

impl Work for Box<Rebuild> {
    const THREAD: &'static str = "solver";
    const TIME: f64 = 0.05;

    fn work(&mut self) {
        if let Some((body, edits)) = self.asked.take() {
            let how = (self.response, self.course);
            self.made = Some(make(&self.recipe, how, body, edits));
        }
    }
}

fn make(
    recipe: &Recipe,
    (response, course): (f64, Course),
    mut body: Body,
    edits: Vec<Edit>,
) -> Result<Made, StepFault> {
    let mut map = BodyMap::identity(&body);
    let mut hands: Vec<Held> = (0..body.handle_count()).map(Held::Kept).collect();
    let (mut joined, mut replaced) = (0, false);
    for edit in edits {
        match edit {
            Edit::Grab(grip) => {
                body.grab(&grip.spec).map_err(ChangeError::from)?;
                map.handles.push(None);
                hands.push(Held::Joined(joined));
                joined += 1;
            }
            Edit::Release { handle } => {
                body.release(handle).map_err(ChangeError::from)?;
                map.handles.remove(handle);
                hands.remove(handle);
            }
            Edit::Guide { vertices, axes } => {
                body.add_support(&vertices, axes)
                    .map_err(ChangeError::from)?;
                map.supports.push(None);
            }
            Edit::Clamp { vertices } => {
                body.add_clamp(&vertices).map_err(ChangeError::from)?;
                map.supports.push(None);
            }
            Edit::Lift { support } => {
                body.lift_support(support).map_err(ChangeError::from)?;
                map.supports.remove(support);
            }
            Edit::Replace(replace) => {
                let before = body.clone();
                let (mut after, step) = replace(body).map_err(ChangeError::from)?;
                step.check(&before, &after).map_err(ChangeError::from)?;
                after.follow_epochs(&before);
                if course.edits.is_some() {
                    make_tearable(&before, &mut after).map_err(ChangeError::Replacement)?;
                }
                if course.may_touch {
                    check_surface(&after)?;
                }
                hands = continued(&hands, &step)?;
                map = map.then(&step);
                body = after;
                replaced = true;
            }
        }
    }
    if hands.len() > MAX_HANDLES {
        let found = hands.len();
        return Err(ChangeError::TooManyHandles { found }.into());
    }
    if course.edits.is_some() {
        body = body.copy_with_room();
        body.reassemble();
    }
    let mut solver = recipe.make(&body)?;
    if let Some(edits) = course.edits {
        solver.begin_tears(&body, edits);
    }
    // The first shapes take as long as many steps. If they fail here, they fail again and are reported after the
    // change has landed.
    let _ = solver.condense(&body, response, None);
    Ok(Made {
        body,
        map,
        replaced,
        edits: course.edits,
        hands,
        solver,
    })
}

/// Gives a body that replaces a sheet that tears as much room for edits as the sheet had at first, unless it has room of its own.
fn make_tearable(before: &Body, after: &mut Body) -> Result<(), TearingError> {
    if after.node_positions().len() != after.vertex_count() {
        let found = "clamped borders";
        return Err(TearingError::Kind { found });
    }
    let room = |surface: &Surface| {
        let first = surface.origins().iter();
        let first = first.filter(|origin| **origin == Origin::Original);
        surface.limits().vertices - first.count()
    };
    if after.surface().is_some() {
        return Ok(());
    }
    let vertices = before.surface().map_or(0, room);
    // Every vertex that a cut adds comes with two triangles at most.
    after.make_tearable(Reserve {
        vertices,
        triangles: 2 * vertices,
    })
}

/// Refuses a body that contacts could not follow.
fn check_surface(body: &Body) -> Result<(), ChangeError> {
    let skin = Skin {
        radius: 0.0,
        touches_itself: false,
        is_obstacle: false,
    };
    let surface = body.mesh().map(|mesh| Surfaces::default().add(&mesh, skin));
    surface.transpose()?;
    Ok(())
}

/// The hands of a replaced body's handles.
fn continued(hands: &[Held], step: &BodyMap) -> Result<Vec<Held>, ChangeError> {
    let numbered = step.handles.iter().enumerate();
    numbered
        .map(|(handle, from)| {
            from.and_then(|from| hands.get(from).copied())
                .ok_or(ChangeError::Unheld { handle })
        })
        .collect()
}
