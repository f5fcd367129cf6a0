//! Warnings about the bodies of a scene that only their meshes show: their sizes, parts that they share, and bodies that
//! overlap.

use super::mesh::Notched;
use super::mount::Mount;
use super::{groups, material, mesh, mount, notch, press, selection, shapes, tear};
use crate::scene::LoadedScene;
use crate::scene::plausible::Warning;
use physics::mesh::{Bounds, Mesh};

/// Fraction of the smaller body by which two bodies must overlap along every axis. Bodies that touch do not overlap.
const OVERLAP: f64 = 0.01;

/// All warnings of a scene: those of its fields, then those of its meshes and mounts.
pub(super) fn warnings(
    loaded: &LoadedScene,
    meshes: &[Notched<'_>],
    mounts: &[Mount],
) -> Vec<Warning> {
    let mut warnings = loaded.warnings.clone();
    let mut boxes = Vec::new();
    for (index, Notched { mesh, cuts }) in meshes.iter().enumerate() {
        warnings.extend(mesh::extent(loaded, index, mesh).ok().flatten());
        warnings.extend(material::warnings(loaded, index, mesh));
        warnings.extend(held_twice(loaded, index, mesh));
        warnings.extend(tear::coarse(loaded, index, mesh));
        warnings.extend(notch::moved(loaded, index, cuts));
        warnings.extend(tear::short(loaded, index, mesh, cuts));
        warnings.extend(press::warnings(loaded, index, mesh));
        warnings.extend(material::locks(loaded, index, mesh));
        warnings.extend(shapes::needles(loaded, index, mesh));
        warnings.extend(groups::warnings(loaded, index, mesh));
        boxes.push(Bounds::of(mesh.positions()));
    }
    for second in 0..boxes.len() {
        for first in 0..second {
            if let (Some(a), Some(b)) = (&boxes[first], &boxes[second])
                && overlap(a, b)
                && !touch(loaded, first, second)
            {
                warnings.push(through_each_other(loaded, first, second));
            }
        }
    }
    warnings.extend(mount::warnings(loaded, mounts));
    warnings
}

/// Warnings about handles that hold vertices of a support. A support that leaves an axis free is often a plane of
/// symmetry, to which a handle may extend.
fn held_twice(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Vec<Warning> {
    let body = &loaded.scene.bodies[index];
    let mut warnings = Vec::new();
    for (number, handle) in body.handles.iter().enumerate() {
        let field = format!("body[{index}].handle[{number}]");
        let group = handle.group.as_deref();
        let Ok(held) = selection::vertices(loaded, &field, group, handle.in_box, mesh) else {
            continue;
        };
        // The supports that share vertices with the handle, and what the first of them shares.
        let (mut others, mut first) = (0, None);
        for (number, support) in body.supports.iter().enumerate() {
            if support.axes != [true; 3] || support.rotation.is_some() {
                continue;
            }
            let at = format!("body[{index}].support[{number}]");
            let group = support.group.as_deref();
            let Ok(guided) = selection::vertices(loaded, &at, group, support.in_box, mesh) else {
                continue;
            };
            let shared = selection::shared(&held, &guided);
            if shared == 0 {
                continue;
            }
            match first {
                None => first = Some((shared, &support.name)),
                Some(_) => others += 1,
            }
        }
        if let Some((shared, support)) = first {
            let more = match others {
                0 => String::new(),
                1 => ", and some in 1 other support".to_owned(),
                _ => format!(", and some in {others} other supports"),
            };
            warnings.push(Warning {
                location: loaded.source.location(&field),
                found: format!(
                    "{shared} vertices in both handle {:?} ({} vertices) and support {support:?}{more}",
                    handle.name,
                    held.len(),
                ),
                usual: "no shared vertices".to_owned(),
                advice: "the hand moves these vertices, and the support does not hold them: make the group or the \
                         box of one of the two smaller"
                    .to_owned(),
            });
        }
    }
    warnings
}

/// Whether two boxes overlap along every axis, by more than a touch.
fn overlap(a: &Bounds, b: &Bounds) -> bool {
    (0..3).all(|axis| {
        let sizes = [a, b].map(|bounds| bounds.size()[axis]);
        let common = a.max[axis].min(b.max[axis]) - a.min[axis].max(b.min[axis]);
        let (smaller, larger) = (sizes[0].min(sizes[1]), sizes[0].max(sizes[1]));
        if smaller > OVERLAP * larger {
            return common > OVERLAP * smaller;
        }
        // The smaller one is flat along this axis, so it overlaps if it lies inside, not on a face. Two flat ones
        // overlap if they lie at the same height.
        let deep = OVERLAP * larger;
        let inside = |flat: &Bounds, thick: &Bounds| {
            flat.min[axis] >= thick.min[axis] + deep && flat.max[axis] <= thick.max[axis] - deep
        };
        if sizes[0] <= sizes[1] {
            inside(a, b)
        } else {
            inside(b, a)
        }
    })
}

/// Whether a contact names two bodies. If they start in each other, they are refused.
fn touch(loaded: &LoadedScene, first: usize, second: usize) -> bool {
    let scene = &loaded.scene;
    let names = [first, second].map(|index| &scene.bodies[index].name);
    let mut contacts = scene.contacts.iter();
    contacts.any(|contact| names.iter().all(|name| contact.between.contains(name)))
}

fn through_each_other(loaded: &LoadedScene, first: usize, second: usize) -> Warning {
    let bodies = &loaded.scene.bodies;
    Warning {
        location: loaded.source.location(&format!("body[{second}]")),
        found: format!(
            "body {:?} in the space of body {:?}: the boxes around the two bodies overlap",
            bodies[second].name, bodies[first].name
        ),
        usual: "bodies beside each other".to_owned(),
        advice: format!(
            "no force acts between two bodies without a [[contact]], so the two pass through each other: set \
             body[{second}].position"
        ),
    }
}
