//! Checks of obstacles and contacts: whether each obstacle is one thing, and whether each contact names a pair.

use super::consistency::{Check, at_most, check_rotation, file_name, names, require};
use super::spec::contact::ObstacleMesh;
use super::spec::{Contact, Obstacle, Scene};
use std::collections::BTreeMap;

/// Largest number of obstacles.
const MAX_OBSTACLES: usize = 64;
/// Largest rate of frames (Hz).
const MOST_FRAME_RATE: f64 = 1000.0;

/// Checks the obstacles and the contacts of a scene; stops at the first conflict.
pub(super) fn check(scene: &Scene) -> Check {
    at_most("obstacle", scene.obstacles.len(), MAX_OBSTACLES)?;
    names("obstacle", scene.obstacles.iter().map(|one| &one.name))?;
    for (index, obstacle) in scene.given_obstacles().iter().enumerate() {
        let at = format!("obstacle[{index}]");
        let mut bodies = scene.bodies.iter();
        let same = bodies.position(|body| body.name == obstacle.name);
        require(
            same.is_none(),
            &format!("{at}.name"),
            format!("{:?}", obstacle.name),
            format!("another name than that of body[{}]", same.unwrap_or(0)),
        )?;
        check_obstacle(&at, obstacle)?;
    }
    check_contacts(scene)
}

fn check_obstacle(at: &str, obstacle: &Obstacle) -> Check {
    let found = match (obstacle.shape, &obstacle.mesh) {
        (None, None) => Some("neither `shape` nor `mesh`"),
        (Some(_), Some(_)) => Some("both `shape` and `mesh`"),
        _ => None,
    };
    require(
        found.is_none(),
        at,
        found.unwrap_or_default(),
        "exactly one of the two",
    )?;
    let (what, has) = obstacle
        .shape
        .map_or(("mesh", [false; 3]), |shape| (shape.name(), shape.sizes()));
    let given = [
        ("radius", obstacle.radius.map(|r| format!("{r:?}"))),
        ("length", obstacle.length.map(|l| format!("{l:?}"))),
        ("size", obstacle.size.map(|s| format!("{s:?}"))),
    ];
    check_sizes(at, what, given.into_iter().zip(has))?;
    check_rotation(&format!("{at}.rotation"), obstacle.rotation)?;
    if let Some(mesh) = &obstacle.mesh {
        check_mesh(&format!("{at}.mesh"), mesh)?;
    }
    let Some(poses) = &obstacle.poses else {
        return Ok(());
    };
    file_name(&format!("{at}.poses"), poses)?;
    let is_animated = (obstacle.mesh.as_ref()).is_some_and(|mesh| mesh.frame_rate.is_some());
    for (name, is_given) in [
        ("position", obstacle.position.is_some()),
        ("rotation", obstacle.rotation.is_some()),
        ("mesh.frame_rate", is_animated),
    ] {
        require(
            !is_given,
            &format!("{at}.{name}"),
            format!("`{name}` and `poses`"),
            "one of the two: `poses` has the whole motion",
        )?;
    }
    Ok(())
}

/// Checks that a shape has the fields of its kind, `what`, and no other: each with its name, its value, and whether the kind has it.
pub(super) fn check_sizes<'a>(
    at: &str,
    what: &str,
    fields: impl Iterator<Item = ((&'a str, Option<String>), bool)>,
) -> Check {
    for ((name, given), has) in fields {
        let allowed = match &given {
            None => format!("a `{name}`, which a {what} has"),
            Some(_) => format!("no such field: a {what} has no {name}"),
        };
        require(
            given.is_some() == has,
            &format!("{at}.{name}"),
            given.unwrap_or_else(|| "none".to_owned()),
            allowed,
        )?;
    }
    Ok(())
}

fn check_mesh(at: &str, mesh: &ObstacleMesh) -> Check {
    let field = format!("{at}.file");
    file_name(&field, &mesh.file)?;
    let Some(rate) = mesh.frame_rate else {
        return Ok(());
    };
    let digits = digits(&mesh.file);
    let found = format!("{:?}", mesh.file);
    let allowed = "the name of a file with `#` for each digit of the number of a frame, such as \"run/hand_####.obj\"";
    require(digits.is_some(), &field, found.as_str(), allowed)?;
    let is_one = digits.is_none_or(|(before, ..)| !before.contains('#'));
    require(
        is_one,
        &field,
        found,
        "one group of `#`, which stands for the number of a frame",
    )?;
    require(
        rate <= MOST_FRAME_RATE,
        &format!("{at}.frame_rate"),
        format!("{rate:?}"),
        format!(
            "up to {MOST_FRAME_RATE} Hz: the steps of the host would skip the frames of a faster mesh"
        ),
    )
}

/// The last run of `#` in the name of a file: the text before it, its length, the text after it.
pub(super) fn digits(file: &str) -> Option<(&str, usize, &str)> {
    let (before, after) = file.rsplit_once('#')?;
    let begin = before.trim_end_matches('#');
    Some((begin, before.len() - begin.len() + 1, after))
}

fn check_contacts(scene: &Scene) -> Check {
    let mut seen: BTreeMap<[&str; 2], usize> = BTreeMap::new();
    for (index, contact) in scene.contacts.iter().enumerate() {
        let at = format!("contact[{index}]");
        check_pair(&at, scene, contact)?;
        let [one, other] = [0, 1].map(|side| contact.between[side].as_str());
        let first = *seen
            .entry([one.min(other), one.max(other)])
            .or_insert(index);
        require(
            first == index,
            &format!("{at}.between"),
            format!("{:?}", contact.between),
            format!("another pair than that of contact[{first}]"),
        )?;
    }
    Ok(())
}

/// A contact names two bodies, a body and an obstacle or a tool, a tool and an obstacle, or a body that touches itself.
fn check_pair(at: &str, scene: &Scene, contact: &Contact) -> Check {
    let body = |name: &String| scene.bodies.iter().find(|body| body.name == *name);
    let [one, other] = &contact.between;
    for (side, name) in contact.between.iter().enumerate() {
        let bodies = scene.bodies.iter().map(|body| &body.name);
        let all = bodies.chain(scene.obstacles.iter().map(|obstacle| &obstacle.name));
        let names: Vec<_> = all.map(|name| format!("{name:?}")).collect();
        let field = format!("{at}.between[{side}]");
        let found = format!("{name:?}");
        require(names.contains(&found), &field, found, names.join(", "))?;
    }
    let found = format!("{:?}", contact.between);
    let bodies = [body(one), body(other)];
    // A tool touches bodies and obstacles.
    let is_tool = |name: &&String| scene.tools.iter().any(|tool| tool.name == **name);
    let tools = [one, other].iter().filter(|name| is_tool(name)).count();
    require(
        bodies.iter().any(Option::is_some) || tools == 1,
        &format!("{at}.between"),
        found.as_str(),
        "a body, or a tool and an obstacle: obstacles do not touch each other, nor do tools",
    )?;
    let touches_itself = bodies[0].is_some_and(|body| body.self_contact);
    require(
        one != other || touches_itself,
        &format!("{at}.between"),
        found,
        "two names, or a body with `self_contact = true`",
    )
}
