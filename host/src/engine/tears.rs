//! The tears of one body in the host's loop.

use super::balance::Balance;
use super::parting::Parting;
use crate::scene::spec::TearLawName;
use crate::scene::{LoadedScene, SceneError};
use crate::world::{TearSpec, World};
use physics::tear::{TearLaw, TearMaterial};
use physics::topology::{Pieces, Reserve};
use physics::{Body, ShapeOptions, Starts, TearOptions, Tearing, TearingError};

/// How the shapes of a body that tears are kept current: one shape with each local model, in a few iterations, and all of them
/// if that leaves too much.
///
/// An edit changes all shapes a little. To renew them all to the usual tolerance takes 24 to 38 iterations a model for the
/// cloth of `tear_cloth`; these options take two or three. In a period of 4 ms the force of the hands, 4 N, then errs by
/// 0.00004 N (median) and 0.016 N (99th percentile; `cargo bench -p palpate-physics --bench motion_tear`). With a bound of 0.1
/// the models of `banknote_shear` fail: paper is a thousand times as stiff along itself as across.
pub(super) const SHAPES: ShapeOptions = ShapeOptions {
    tolerance: 1e-3,
    max_iterations: 3,
    at_a_time: 1,
    bound: 1e-2,
};

/// Most pairs of vertices of a body that let each other go at the same time: room for [`Stepper::reserve_pairs`].
///
/// [`Stepper::reserve_pairs`]: physics::Stepper::reserve_pairs
pub const MOST_PAIRS: usize = 64;

/// The change of a body that is under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum UnderWay {
    /// None.
    #[default]
    Nothing,
    /// Its handles and supports change: it tears on, and no stepper for a new topology is made.
    Handles,
    /// Its mesh is replaced: no tear grows.
    Mesh,
}

/// The tears of a body.
pub struct BodyTears {
    /// Tips and edits.
    pub(crate) tearing: Tearing,
    /// The pieces.
    pub(super) parting: Parting,
    /// The balance of energy.
    pub(super) balance: Balance,
    pub(super) under_way: UnderWay,
}

impl BodyTears {
    /// The tears of the scene's body number `index`, or `None` for a body that does not tear.
    ///
    /// # Errors
    /// [`SceneError`], naming the line and the field that cannot be built.
    pub(super) fn new(
        world: &World<'_>,
        index: usize,
        body: &mut Body,
    ) -> Result<Option<Self>, SceneError> {
        let Some(tearing) = tearing(world, index, body)? else {
            return Ok(None);
        };
        let parting = Parting::new(body, 0);
        Ok(parting.map(|parting| Self {
            tearing,
            parting,
            balance: Balance::default(),
            under_way: UnderWay::Nothing,
        }))
    }

    /// What continues the tears on `body` after a change: the pieces, and new tears if `replaced` names the vertices that those
    /// of a new mesh continue.
    ///
    /// # Errors
    /// [`TearingError`] for a new mesh that cannot tear.
    pub(super) fn continued(
        &self,
        body: &Body,
        replaced: Option<&[u32]>,
    ) -> Result<(Option<Tearing>, Parting), TearingError> {
        let tearing = replaced.map(|vertices| self.tearing.continued(body, vertices));
        let parting = Parting::new(body, self.tearing.report().parted);
        let parting = parting.ok_or(TearingError::Kind {
            found: "no surface that can tear",
        })?;
        Ok((tearing.transpose()?, parting))
    }

    /// Goes on with what [continues](Self::continued) the tears.
    pub(super) fn go_on(&mut self, (tearing, parting): (Option<Tearing>, Parting)) {
        if let Some(tearing) = tearing {
            self.tearing = tearing;
            // The same shape stores another energy.
            self.balance = Balance::default();
        }
        self.parting = parting;
    }

    /// The pieces of the body.
    pub fn pieces(&self) -> &Pieces {
        self.parting.pieces()
    }

    /// Tips and edits.
    pub fn tearing(&self) -> &Tearing {
        &self.tearing
    }
}

/// The tips of the world's body number `index`, whose copy `body` gets room for the edits of its tears; `None` for a body that does
/// not tear.
///
/// # Errors
/// [`SceneError`], naming the line and the field that cannot be built.
pub fn tearing(
    world: &World<'_>,
    index: usize,
    body: &mut Body,
) -> Result<Option<Tearing>, SceneError> {
    make_tearable(world, index, body)?;
    let Some(spec) = &world.bodies[index].tear else {
        return Ok(None);
    };
    let tearing = Tearing::new(body, options(spec), &spec.tips);
    Ok(Some(
        tearing.map_err(|error| refused(world.loaded, index, &error))?,
    ))
}

/// Gives `body`, a copy of the world's body number `index`, room for the edits of its tears, if it tears.
///
/// # Errors
/// [`SceneError`], naming the line and the field, for a body that is no sheet that can tear.
pub(crate) fn make_tearable(
    world: &World<'_>,
    index: usize,
    body: &mut Body,
) -> Result<(), SceneError> {
    let Some(spec) = &world.bodies[index].tear else {
        return Ok(());
    };
    // Every vertex that a cut adds comes with two triangles at most.
    let reserve = Reserve {
        vertices: spec.room,
        triangles: 2 * spec.room,
    };
    let made = body.make_tearable(reserve);
    made.map_err(|error| refused(world.loaded, index, &error))
}

fn refused(loaded: &LoadedScene, index: usize, error: &TearingError) -> SceneError {
    let field = format!("body[{index}].tear");
    let allowed = "a sheet that can tear";
    loaded.source.error(&field, error.to_string(), allowed)
}

/// The options of the physics for what a scene says about tearing.
pub fn options(spec: &TearSpec) -> TearOptions {
    let material = spec.materials[0];
    TearOptions {
        material: TearMaterial {
            strength: spec.strength,
            toughness: spec.toughness,
            thickness: material.thickness,
            young: material.young,
            poisson: material.poisson,
            law: match spec.law {
                TearLawName::Toughness => TearLaw::Toughness,
                TearLawName::Thesis => TearLaw::Thesis,
            },
        },
        starts: match spec.starts {
            scene::spec::Starts::Tips => Starts::Tips,
            scene::spec::Starts::Anywhere => Starts::Anywhere,
        },
        snapping: spec.snapping,
        skips: true,
    }
}
