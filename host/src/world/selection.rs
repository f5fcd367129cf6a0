//! Selects parts of a mesh, by group or by box.

use crate::scene::source::cut;
use crate::scene::{LoadedScene, SceneError};
use physics::Vec3;
use physics::mesh::{Group, Mesh};

/// Largest number of groups of a mesh that an error lists.
const MOST_NAMES: usize = 16;
/// Longest name in such a list, in characters.
const LONGEST_NAME: usize = 64;

/// Lowest and highest corner of a box (m).
type Box3 = [[f64; 3]; 2];

/// The vertices in the group or box that `field` gives.
pub(super) fn vertices(
    loaded: &LoadedScene,
    field: &str,
    name: Option<&str>,
    in_box: Option<Box3>,
    mesh: &Mesh,
) -> Result<Vec<u32>, SceneError> {
    let groups = mesh.vertex_groups();
    select(loaded, field, name, in_box, groups, "vertex", || {
        mesh.positions().iter().copied()
    })
}

/// The elements in the group `name`, or else those with their barycentre in the box. `field` is the field of the scene
/// that selects them.
pub(super) fn elements(
    loaded: &LoadedScene,
    field: &str,
    name: Option<&str>,
    in_box: Option<Box3>,
    mesh: &Mesh,
) -> Result<Vec<u32>, SceneError> {
    let centre = |corners: &[u32], positions: &[Vec3]| {
        let sum: Vec3 = corners.iter().map(|&v| positions[v as usize]).sum();
        sum / corners.len() as f64
    };
    match mesh {
        Mesh::Thread(mesh) => {
            let what = "line's middle";
            let centres = || mesh.lines.iter().map(|line| centre(line, &mesh.positions));
            let groups = &mesh.line_groups;
            select(loaded, field, name, in_box, groups, what, centres)
        }
        Mesh::Sheet(mesh) => {
            let member = "triangle's barycentre";
            let centres = || mesh.triangles.iter().map(|t| centre(t, &mesh.positions));
            let groups = &mesh.triangle_groups;
            select(loaded, field, name, in_box, groups, member, centres)
        }
        Mesh::Solid(mesh) => {
            let member = "cell's barycentre";
            let cells = || mesh.cells.vertices();
            let centres = || cells().map(|cell| centre(&cell[..4], &mesh.positions));
            let groups = &mesh.cell_groups;
            select(loaded, field, name, in_box, groups, member, centres)
        }
    }
}

/// Number of vertices that two sorted lists have in common.
pub(super) fn shared(a: &[u32], b: &[u32]) -> usize {
    a.iter().filter(|v| b.binary_search(v).is_ok()).count()
}

fn select<P: Iterator<Item = Vec3>>(
    loaded: &LoadedScene,
    field: &str,
    name: Option<&str>,
    in_box: Option<Box3>,
    groups: &[Group],
    member: &str,
    points: impl Fn() -> P,
) -> Result<Vec<u32>, SceneError> {
    // The consistency of the scene was checked: either a group or a box is given.
    if let Some(name) = name {
        return Ok(group(loaded, &format!("{field}.group"), name, groups)?.to_vec());
    }
    let [low, high] = in_box.unwrap_or_default();
    let inside = |p: &Vec3| (0..3).all(|axis| (low[axis]..=high[axis]).contains(&p[axis]));
    let members: Vec<u32> = (0_u32..)
        .zip(points())
        .filter(|(_, point)| inside(point))
        .map(|(member, _)| member)
        .collect();
    if members.is_empty() {
        let field = format!("{field}.box");
        let found = format!("a box that contains no {member}");
        let around = points().fold(None, |around: Option<(Vec3, Vec3)>, p| {
            Some(around.map_or((p, p), |(low, high)| (low.inf(&p), high.sup(&p))))
        });
        // Metres to a tenth of a millimetre tell a unit and a place.
        let corner = |p: Vec3| format!("[{:.4}, {:.4}, {:.4}]", p.x, p.y, p.z);
        let allowed = around.map_or("a mesh with elements".to_owned(), |(low, high)| {
            let around = format!("[{}, {}] m", corner(low), corner(high));
            format!("a box that contains at least one {member}; each {member} lies in {around}")
        });
        return Err(loaded.source.error(&field, found, allowed));
    }
    Ok(members)
}

fn group<'a>(
    loaded: &LoadedScene,
    field: &str,
    name: &str,
    groups: &'a [Group],
) -> Result<&'a [u32], SceneError> {
    let names = groups.iter().map(|group| &group.name);
    let nothing = "a box (the mesh has no such groups)";
    let found = named(loaded, field, name, names, "group", nothing)?;
    let members = &groups[found].members;
    if members.is_empty() {
        let allowed = "a group that is not empty";
        return Err(loaded.source.error(field, format!("\"{name}\""), allowed));
    }
    Ok(members)
}

/// The index of `name` among `names`. An error calls the named parts of the mesh `kind`; `nothing` is the text of the
/// allowed values if `names` is empty.
pub(super) fn named<'a>(
    loaded: &LoadedScene,
    field: &str,
    name: &str,
    names: impl Iterator<Item = &'a String> + Clone,
    kind: &str,
    nothing: &str,
) -> Result<usize, SceneError> {
    let found = names.clone().position(|other| other == name);
    found.ok_or_else(|| {
        // The names come from a file: they may be many and hold any text.
        let count = names.clone().count();
        let listed: Vec<_> = names
            .take(MOST_NAMES)
            .map(|name| format!("\"{}\"", cut(name, LONGEST_NAME)))
            .collect();
        let more = if count > MOST_NAMES { ", ..." } else { "" };
        let allowed = if listed.is_empty() {
            nothing.to_owned()
        } else {
            format!("a {kind} of the mesh: {}{more}", listed.join(", "))
        };
        loaded.source.error(field, format!("\"{name}\""), allowed)
    })
}
