//! Groups of a mesh that cannot be told apart: a conversion may have put every element into every group.

use crate::scene::LoadedScene;
use crate::scene::plausible::Warning;
use physics::mesh::{Group, Mesh};
use std::collections::BTreeMap;
use std::fmt;

/// Groups of one dimension with the same members.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Equal<'a> {
    /// The names, in the order of the mesh.
    pub names: Vec<&'a str>,
    /// How many members each has, in words.
    members: String,
}

/// The likely cause of equal groups, and what to do.
pub const ADVICE: &str = "did a program that converts meshes put every element into every group? Use the file from which it \
                          converted; Gmsh 2.2 and 4.1 files are read as they are";

impl fmt::Display for Equal<'_> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.names.iter().map(|name| format!("{name:?}")).collect();
        write!(
            to,
            "groups {} with the same {}",
            names.join(" and "),
            self.members
        )
    }
}

/// The groups of `mesh` that have the same elements, then those that have the same vertices and no elements.
pub fn equal(mesh: &Mesh) -> Vec<Equal<'_>> {
    let (elements, name) = match mesh {
        Mesh::Thread(mesh) => (&mesh.line_groups, "lines"),
        Mesh::Sheet(mesh) => (&mesh.triangle_groups, "triangles"),
        Mesh::Solid(mesh) => (&mesh.cell_groups, "tetrahedra"),
    };
    let is_of_elements = |group: &&Group| elements.iter().any(|other| other.name == group.name);
    let of_vertices = mesh
        .vertex_groups()
        .iter()
        .filter(|group| !is_of_elements(group));
    let mut found = alike(elements.iter(), name);
    found.extend(alike(of_vertices, "vertices"));
    found
}

fn alike<'a>(groups: impl Iterator<Item = &'a Group>, name: &str) -> Vec<Equal<'a>> {
    let mut by_members: BTreeMap<&[u32], Vec<&str>> = BTreeMap::new();
    for group in groups {
        by_members
            .entry(&group.members)
            .or_default()
            .push(&group.name);
    }
    let several = by_members.into_iter().filter(|(_, names)| names.len() > 1);
    let each = several.map(|(members, names)| Equal {
        names,
        members: format!("{} {name}", members.len()),
    });
    each.collect()
}

/// The warnings about equal groups of a body's mesh if the scene names one of them.
pub(super) fn warnings(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Vec<Warning> {
    let body = &loaded.scene.bodies[index];
    let named: Vec<&str> = (body.handles.iter().map(|place| &place.group))
        .chain(body.supports.iter().map(|place| &place.group))
        .chain(body.loads.iter().map(|place| &place.group))
        .chain(body.regions.iter().map(|place| &place.group))
        .flatten()
        .map(String::as_str)
        .collect();
    let equal = equal(mesh).into_iter();
    let used = equal.filter(|equal| equal.names.iter().any(|name| named.contains(name)));
    let each = used.map(|equal| Warning {
        location: loaded.source.location(&format!("body[{index}].mesh")),
        found: equal.to_string(),
        usual: "groups that differ".to_owned(),
        advice: ADVICE.to_owned(),
    });
    each.collect()
}
