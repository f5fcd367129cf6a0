//! Equilibrium of bodies that touch: all bodies of the scene are driven together.

use super::SolveError;
use super::drive::{Drive, DriveError, State, equilibrium};
use super::result::{PairRow, PairSolution, Solution};
use crate::scene::spec::Analysis;
use crate::scene::{LoadedScene, SceneError};
use crate::world::World;
use crate::world::contact::Thing;
use physics::motion::contacts::{Contacts, Pressed, Side};
use physics::motion::{ContactEquilibrium, Goal};
use physics::{Body, Vec3};

/// Keeps a frame: of a body, by its number in the scene, at a fraction of the loads, with the pressure of its contacts (Pa).
type Keep<'a, E> =
    dyn FnMut(&Drive<'_>, usize, usize, f64, Option<Vec<f64>>) -> Result<(), SolveError<E>> + 'a;

/// Refuses a motion in time in which things touch.
///
/// # Errors
/// [`SceneError`] at the analysis.
pub fn check_solved(loaded: &LoadedScene) -> Result<(), SceneError> {
    let scene = &loaded.scene;
    if scene.solve.analysis == Analysis::Static || !scene.has_contact() {
        return Ok(());
    }
    let problem = "`palpate solve` solves contact in equilibrium (`analysis = \"static\"`), and `palpate run` in motion";
    Err(loaded.source.problem("solve.analysis", problem))
}

/// Solves the bodies of a world. Rest is at the fraction `rest` of the loads.
pub(super) fn solve<E>(
    world: &World<'_>,
    rest: f64,
    solution: &mut Solution,
    progress: &mut dyn FnMut(f64),
    keep: &mut Keep<'_, E>,
) -> Result<(), SolveError<E>> {
    check_solved(world.loaded)?;
    let scene = &world.loaded.scene;
    let bodies = world.bodies.iter().enumerate();
    let mut drives: Vec<Drive<'_>> = bodies
        .map(|(index, built)| Drive::new(scene, index, built.clone(), true))
        .collect::<Result<_, _>>()?;
    let at_rest: Vec<&Body> = drives.iter().map(Drive::body).collect();
    let contacts = world.touching(&at_rest)?;
    let sides = contacts.sides();
    let mut joint = ContactEquilibrium::new(&at_rest, contacts, equilibrium(&scene.solve))?;
    drop(at_rest);
    solution.contacts = (world.contacts.pairs.iter())
        .map(|pair| PairSolution {
            between: pair.between.map(|thing| thing.name(scene).to_owned()),
            steps: Vec::new(),
        })
        .collect();
    for (index, drive) in drives.iter().enumerate() {
        keep(
            drive,
            index,
            0,
            rest,
            Some(vec![0.0; drive.body().vertex_count()]),
        )?;
    }
    while !drives.iter().all(Drive::is_done) {
        let failure = advance(&mut drives, &mut joint).err();
        let report = *joint.report();
        let mut reached = None;
        for (index, drive) in drives.iter_mut().enumerate() {
            let Some(state) = drive.take(report, failure.is_some()) else {
                continue;
            };
            reached = Some((state.at, state.done));
            if let State {
                frame: Some(number),
                at,
                ..
            } = state
            {
                let mut pressed = Vec::new();
                joint.contacts().press(index, &mut pressed);
                let pressure = pressed.iter().map(Pressed::pressure).collect();
                keep(drive, index, number, at, Some(pressure))?;
            }
        }
        if let Some((at, done)) = reached {
            sum_up(world, &sides, joint.contacts(), at, &mut solution.contacts);
            progress(done);
        }
        if let Some(error) = failure {
            let at = drives.first().map(Drive::place).unwrap_or_default();
            solution
                .failures
                .push(format!("bodies in contact: {at}: {error}"));
            break;
        }
    }
    solution.bodies = drives.into_iter().map(Drive::finish).collect();
    Ok(())
}

/// Takes the next step of all bodies.
fn advance(drives: &mut [Drive<'_>], joint: &mut ContactEquilibrium) -> Result<(), DriveError> {
    let each: Vec<(&mut Body, Goal<'_>)> = drives
        .iter_mut()
        .map(Drive::next)
        .collect::<Result<_, _>>()?;
    let (mut bodies, goals): (Vec<_>, Vec<_>) = each.into_iter().unzip();
    joint.solve(&mut bodies, &goals)?;
    Ok(())
}

/// Adds the sums of the contacts at a fraction of the loads to the pairs.
fn sum_up(
    world: &World<'_>,
    sides: &[Side],
    contacts: &Contacts,
    at: f64,
    pairs: &mut [PairSolution],
) {
    let thing = |side: usize| match sides[side] {
        Side::Body(body) => Thing::Body(body),
        Side::Obstacle(number) => Thing::Obstacle(number),
    };
    for (pair, solved) in world.contacts.pairs.iter().zip(pairs) {
        let found = contacts.touching().iter().find(|found| {
            let [one, other] = found.sides.map(thing);
            [one.min(other), one.max(other)] == pair.between
        });
        let mut row = PairRow {
            at,
            ..PairRow::default()
        };
        if let Some(found) = found {
            let is_turned = thing(found.sides[0]) != pair.between[0];
            let force: Vec3 = if is_turned { -found.force } else { found.force };
            row.count = found.count;
            row.normal = found.normal;
            row.friction = found.friction;
            row.force = force.into();
            row.depth = found.depth;
        }
        solved.steps.push(row);
    }
}
