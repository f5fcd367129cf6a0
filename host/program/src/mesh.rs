//! `palpate mesh`: writes the mesh of a scene's body to a file for other programs.

use super::outputs::{self, Declared};
use super::sets::Sets;
use super::{CommandError, load};
use host::atomic_file::write_atomically;
use host::bodies::{self, Built};
use meshio::write_vtu::Snapshot;
use meshio::{write_gmsh, write_vtk};
use physics::mesh::{Bounds, Field, Group, Mesh, TriMesh};
use std::path::{Path, PathBuf};

/// Arguments of `palpate mesh`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct MeshArguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// The file to write: .msh (Gmsh 4.1, with groups), .vtk (legacy) or .vtu. Each has the fields `young` and
    /// `poisson`, by element; a thread whose scene gives no `poisson` has the first alone
    file: PathBuf,
    /// Name of the body. Default: the first body
    #[arg(long, value_name = "NAME")]
    body: Option<String>,
    #[command(flatten)]
    sets: Sets,
}

pub(super) fn run(arguments: &MeshArguments) -> Result<(), CommandError> {
    let format = Format::of(&arguments.file)?;
    let loaded = load(Some(&arguments.scene), &arguments.sets)?;
    let names = || loaded.scene.bodies.iter().map(|body| &body.name);
    let index = match &arguments.body {
        None => 0,
        Some(name) => {
            names()
                .position(|other| other == name)
                .ok_or_else(|| CommandError::NoSuchBody {
                    found: name.clone(),
                    allowed: names().cloned().collect(),
                })?
        }
    };
    let _held = Declared::default()
        .scene(Some(&arguments.scene), &loaded)
        .file("FILE", Some(&arguments.file), outputs::Format::Mesh)
        .check()?;
    let built = bodies::build(&loaded, index)?;
    let mesh = with_material(built);
    out!("{}", summary(&loaded.scene.bodies[index].name, &mesh));
    write_atomically(&arguments.file, format.write(&mesh).as_bytes())?;
    outln!("  {:<10} {}", "file", arguments.file.display());
    Ok(())
}

/// The mesh with the body's material as fields, which replace fields of the same names.
fn with_material(built: Built) -> Mesh {
    let own = [("young", built.young), ("poisson", built.poisson)];
    let mut mesh = built.mesh;
    let fields = mesh.fields_mut();
    for (name, values) in own.into_iter().filter(|(_, values)| !values.is_empty()) {
        fields.retain(|field| field.name != name);
        fields.push(Field {
            name: name.to_owned(),
            values,
        });
    }
    mesh
}

enum Format {
    Gmsh,
    Legacy,
    Xml,
}

impl Format {
    fn of(file: &Path) -> Result<Self, CommandError> {
        let ending = file.extension().and_then(|ending| ending.to_str());
        match ending.map(str::to_ascii_lowercase).as_deref() {
            Some("msh") => Ok(Self::Gmsh),
            Some("vtk") => Ok(Self::Legacy),
            Some("vtu") => Ok(Self::Xml),
            _ => Err(CommandError::MeshFormat(file.to_owned())),
        }
    }

    fn write(&self, mesh: &Mesh) -> String {
        match (self, mesh) {
            (Self::Gmsh, mesh) => write_gmsh::write(mesh),
            (Self::Legacy, mesh) => write_vtk::write(mesh),
            (Self::Xml, Mesh::Thread(mesh)) => Snapshot::of_thread(mesh).vtu(),
            (Self::Xml, Mesh::Sheet(mesh)) => Snapshot::of_sheet(mesh).vtu(),
            (Self::Xml, Mesh::Solid(mesh)) => Snapshot::of_solid(mesh).vtu(),
        }
    }
}

/// A line about the flat pattern, if there is one. Areas that differ by far show a wrong unit of the pattern.
fn pattern(mesh: &Mesh) -> String {
    let Mesh::Sheet(mesh) = mesh else {
        return String::new();
    };
    if mesh.flat_pattern.is_none() {
        return String::new();
    }
    let start = TriMesh {
        flat_pattern: None,
        ..mesh.clone()
    };
    let (rest, start) = (mesh.area(), start.area());
    format!("  pattern    {rest:.4} m2 of flat cloth, {start:.4} m2 at the start\n")
}

/// A summary of the mesh: its kind, its size, its groups and its fields.
fn summary(name: &str, mesh: &Mesh) -> String {
    let (kind, parts) = match mesh {
        Mesh::Thread(mesh) => ("lines", &mesh.line_groups),
        Mesh::Sheet(mesh) => ("triangles", &mesh.triangle_groups),
        Mesh::Solid(mesh) => ("tetrahedra", &mesh.cell_groups),
    };
    let (elements, positions) = (mesh.element_count(), mesh.positions());
    let (groups, fields) = (mesh.vertex_groups(), mesh.fields());
    let size = Bounds::of(positions).map_or([0.0; 3], |bounds| bounds.size().into());
    let counted = |groups: &[Group]| {
        let groups = groups.iter();
        groups
            .map(|group| format!("{} ({})", group.name, group.members.len()))
            .collect::<Vec<_>>()
    };
    let range = |field: &Field| {
        let low = field.values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = field
            .values
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        if low == high {
            format!("{} {low}", field.name)
        } else {
            format!("{} {low} to {high}", field.name)
        }
    };
    let line = |title: &str, names: &[String]| {
        let names = if names.is_empty() {
            "none".to_owned()
        } else {
            names.join(", ")
        };
        format!("  {title:<10} {names}\n")
    };
    [
        format!(
            "{name}: {elements} {kind}, {} vertices, {:.4} x {:.4} x {:.4} m\n",
            positions.len(),
            size[0],
            size[1],
            size[2]
        ),
        pattern(mesh),
        line("vertices", &counted(groups)),
        line("elements", &counted(parts)),
        line("values", &fields.iter().map(range).collect::<Vec<_>>()),
    ]
    .concat()
}
