//! `palpate mesh`: writes the mesh of a scene's body to a file for other programs. `palpate mesh check` judges the meshes of
//! a scene and how they touch, or the mesh of a file that no scene names yet.

use super::outputs::{self, Declared};
use super::sets::Sets;
use super::{CommandError, build, load, progress_bar};
use host::atomic_file::write_atomically;
use host::scene::read_bytes;
use host::scene::spec::contact::ShapeName;
use host::world::contact::Thing;
use host::world::groups;
use host::world::shapes::{Needles, round};
use host::world::{Built, World};
use meshio::write_vtu::UnstructuredGrid;
use meshio::{write_gmsh, write_vtk};
use physics::contact::obstacle::{ClosedMesh, Motion};
use physics::contact::start::{Fault, Touching, faults};
use physics::contact::{Skin, Surfaces};
use physics::mesh::quality::shapes;
use physics::mesh::{Bounds, Field, Group, Mesh, TriMesh};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Arguments of `palpate mesh`.
#[derive(Clone, Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct MeshArguments {
    #[command(subcommand)]
    command: Option<MeshCommand>,
    /// Scene file (TOML)
    #[arg(required = true)]
    scene: Option<PathBuf>,
    /// The file to write: .msh (Gmsh 4.1, with groups), .vtk (legacy) or .vtu. Each has the fields `young`,
    /// `poisson` and `quality`, by element; a thread whose scene gives no `poisson` has the first alone
    #[arg(required = true)]
    file: Option<PathBuf>,
    /// Name of the body. Default: the first body
    #[arg(long, value_name = "NAME")]
    body: Option<String>,
    #[command(flatten)]
    sets: Sets,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum MeshCommand {
    /// Print what the meshes of a scene or a mesh file hold, how well shaped their elements are, and warnings
    Check(CheckArguments),
}

/// Arguments of `palpate mesh check`.
#[derive(Clone, Debug, clap::Args)]
struct CheckArguments {
    /// Scene file (.toml), or a mesh file
    file: PathBuf,
    #[command(flatten)]
    sets: Sets,
}

pub(super) fn run(arguments: &MeshArguments) -> Result<(), CommandError> {
    match (&arguments.command, &arguments.scene, &arguments.file) {
        (Some(MeshCommand::Check(arguments)), ..) => check(arguments),
        (None, Some(scene), Some(file)) => write(arguments, scene, file),
        // Both are required.
        (None, ..) => Ok(()),
    }
}

/// The worst elements that `palpate mesh check` names.
const WORST: usize = 5;

fn check(arguments: &CheckArguments) -> Result<(), CommandError> {
    let file = &arguments.file;
    let is_scene = |ending: &std::ffi::OsStr| ending.eq_ignore_ascii_case("toml");
    if file.extension().is_some_and(is_scene) {
        // This prints the warnings.
        let loaded = load(Some(file), &arguments.sets)?;
        let world = build(&loaded, &progress_bar())?;
        for (body, built) in loaded.scene.bodies.iter().zip(&world.bodies) {
            let mesh = &built.mesh;
            out!("{}", summary(&body.name, mesh, " m"));
            out!("{}", quality(&Needles::of(mesh, true)));
        }
        out!("{}", contacts(&world));
        return Ok(());
    }
    let refused = |reason: String| CommandError::MeshFile {
        path: file.clone(),
        reason,
    };
    if let Some((given, _)) = arguments.sets.given()?.first() {
        return Err(refused(format!(
            "{given} replaces a field of a scene, and this is a mesh file"
        )));
    }
    let bytes = read_bytes(file).map_err(|error| refused(error.to_string()))?;
    let name = file.display().to_string();
    let mesh = meshio::read_mesh(&name, &bytes).map_err(|error| refused(error.to_string()))?;
    out!("{}", summary(&name, &mesh, ", in units of the file"));
    let needles = Needles::of(&mesh, true);
    out!("{}", quality(&needles));
    out!("{}", surface(&mesh));
    if let Some(harm) = &needles.harm {
        errln!("warning: {name}: found {needles}: {harm}");
    }
    for equal in groups::equal(&mesh) {
        errln!("warning: {name}: found {equal}; {}", groups::ADVICE);
    }
    Ok(())
}

/// The obstacles of a world, and its pairs that may touch. Pairs that do not fit a scene are refused when it is built.
fn contacts(world: &World<'_>) -> String {
    let scene = &world.loaded.scene;
    let mut text = String::new();
    for (spec, obstacle) in scene.obstacles.iter().zip(&world.obstacles) {
        let what = spec.shape.map_or("mesh", ShapeName::name);
        let moves = match obstacle.motion() {
            Motion::Still(_) => "still".to_owned(),
            Motion::Poses(rows) => format!("{} poses", rows.len()),
            Motion::Frames(frames) => format!("{} frames", frames.positions.len()),
        };
        let _ = writeln!(text, "{}: obstacle, {what}, {moves}", spec.name);
    }
    let name = |thing: Thing| match thing {
        Thing::Body(index) => &scene.bodies[index].name,
        Thing::Obstacle(index) => &scene.obstacles[index].name,
    };
    for pair in &world.contacts.pairs {
        let [one, other] = pair.between.map(name);
        let _ = writeln!(
            text,
            "{one} and {other}: touch at {} m, friction {}",
            round(pair.distance),
            pair.friction
        );
    }
    text
}

/// Whether the surface of a mesh bounds a volume, as that of an obstacle must, and where it crosses itself.
fn surface(mesh: &Mesh) -> String {
    let triangles = match mesh {
        Mesh::Thread(_) => return String::new(),
        Mesh::Sheet(mesh) => mesh.triangles.clone(),
        Mesh::Solid(mesh) => mesh.boundary(),
    };
    let positions = mesh.positions().to_vec();
    let mut text = match ClosedMesh::new(positions, triangles) {
        Ok(closed) => format!(
            "  {:<10} closed, volume {}\n",
            "surface",
            round(closed.volume())
        ),
        Err(error) => format!(
            "  {:<10} {error}; an obstacle needs a closed mesh\n",
            "surface"
        ),
    };
    let mut surfaces = Surfaces::default();
    let skin = Skin {
        radius: 0.0,
        touches_itself: true,
        is_obstacle: false,
    };
    if surfaces.add(mesh, skin).is_ok() {
        let touching = Touching {
            distance: &|_, _| Some(0.0),
            walls: &[None],
        };
        if let Some(Fault::Crossed { at, .. }) =
            faults(&surfaces, mesh.positions(), &touching).first()
        {
            let [x, y, z]: [f64; 3] = at.map(round).into();
            let _ = writeln!(
                text,
                "  {:<10} crosses itself at [{x}, {y}, {z}]",
                "surface"
            );
        }
    }
    text
}

/// How well shaped the elements are: the range, the median, the needles and the worst places.
fn quality(needles: &Needles) -> String {
    let mut sorted: Vec<f64> = needles.shapes.iter().map(|shape| shape.quality).collect();
    sorted.sort_by(f64::total_cmp);
    let (Some(least), Some(most)) = (sorted.first(), sorted.last()) else {
        return String::new();
    };
    let median = sorted[sorted.len() / 2];
    let mut text = format!(
        "  {:<10} {} to {}, median {}; 1 for equal sides, 0 without an area or a volume\n  {:<10} \
         {needles}\n",
        "quality",
        round(*least),
        round(*most),
        round(median),
        "needles"
    );
    for &number in needles.worst.iter().take(WORST) {
        let _ = writeln!(text, "  {:<10} {}", "worst", needles.described(number));
    }
    text
}

fn write(arguments: &MeshArguments, scene: &Path, file: &PathBuf) -> Result<(), CommandError> {
    let format = Format::of(file)?;
    let loaded = load(Some(scene), &arguments.sets)?;
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
        .scene(Some(scene), &loaded)
        .file("FILE", Some(file), outputs::Format::Mesh)
        .check()?;
    let mut world = build(&loaded, &progress_bar())?;
    let mesh = with_material(world.bodies.swap_remove(index));
    out!("{}", summary(&loaded.scene.bodies[index].name, &mesh, " m"));
    write_atomically(file, format.write(&mesh).as_bytes())?;
    outln!("  {:<10} {}", "file", file.display());
    Ok(())
}

/// The mesh with the body's material and the quality of the elements as fields, which replace fields of the same names.
fn with_material(built: Built) -> Mesh {
    let quality = shapes(&built.mesh)
        .iter()
        .map(|shape| shape.quality)
        .collect();
    let own = [
        ("young", built.young),
        ("poisson", built.poisson),
        ("quality", quality),
    ];
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
            (Self::Xml, Mesh::Thread(mesh)) => UnstructuredGrid::of_thread(mesh).vtu(),
            (Self::Xml, Mesh::Sheet(mesh)) => UnstructuredGrid::of_sheet(mesh).vtu(),
            (Self::Xml, Mesh::Solid(mesh)) => UnstructuredGrid::of_solid(mesh).vtu(),
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

/// A summary of the mesh: its kind, its size, whose `unit` is said, its groups and its fields.
fn summary(name: &str, mesh: &Mesh, unit: &str) -> String {
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
            "{name}: {elements} {kind}, {} vertices, {:.4} x {:.4} x {:.4}{unit}\n",
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
