//! Scene files on disk: those shipped with the program, and files that are missing or wrong.

use host::run::prepare::{Options, Prepared};
use host::scene::{LoadedScene, Scene, recording};
use host::world::World;
use physics::mesh::Mesh;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;

type Outcome = Result<(), Box<dyn Error>>;

const SCENES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes");

fn error(loaded: Result<LoadedScene, impl Error>) -> String {
    loaded.map_or_else(|error| error.to_string(), |_| "no error".to_owned())
}

#[test]
fn every_shipped_scene_loads() -> Outcome {
    let mut names = Vec::new();
    for entry in fs::read_dir(SCENES)? {
        let path = entry?.path();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let loaded = Scene::load(&path)?;
            World::new(&loaded)?;
            names.push(loaded.scene.name);
        }
    }
    names.sort();
    assert_eq!(
        names,
        [
            "banknote",
            "banknote_shear",
            "belt",
            "block_on_incline",
            "burst",
            "cloth",
            "cube",
            "edge",
            "finger",
            "folded_banknote",
            "groove",
            "inclined",
            "inclusion",
            "lift",
            "paddle",
            "pantograph",
            "perforated",
            "pierce",
            "plate",
            "press",
            "pressed_blocks",
            "sheet_on_edge",
            "sheet_on_sphere",
            "sleeve",
            "stack",
            "stretch",
            "take",
            "tear_cloth",
            "thread",
            "touch",
            "trousers",
            "twist",
            "two_people",
        ]
    );
    Ok(())
}

#[test]
fn the_default_scene_is_built_in() -> Outcome {
    let built_in = Scene::embedded_default()?;
    assert_eq!(built_in.scene.name, "stretch");
    assert!(built_in.meshes.iter().all(Option::is_none));
    assert!(built_in.recordings.iter().all(Option::is_none));
    let path = Path::new(SCENES).join("stretch.toml");
    assert_eq!(built_in.source.text, fs::read_to_string(path)?);
    Ok(())
}

#[test]
fn a_scene_brings_the_files_that_it_names() -> Outcome {
    let cloth = Scene::load(&Path::new(SCENES).join("cloth.toml"))?;
    let mesh = cloth.meshes[0]
        .as_ref()
        .ok_or("the cloth has a mesh file")?;
    assert!(mesh.bytes.starts_with(b"$MeshFormat"));
    for recording in &cloth.recordings {
        let recording = recording.as_ref().ok_or("both hands have a recording")?;
        assert!(recording.len() > 100);
    }
    Ok(())
}

#[test]
fn a_mesh_file_is_read_once_for_all_bodies_and_devices() -> Outcome {
    const MESH: &str = "meshes/cloth_notched.msh";
    let folder = tempfile::tempdir()?;
    fs::create_dir(folder.path().join("meshes"))?;
    fs::copy(Path::new(SCENES).join(MESH), folder.path().join(MESH))?;
    let parts = [("first", "left"), ("second", "right")].map(|(body, device)| {
        format!(
            "[[body]]\nname = \"{body}\"\nmesh = {{ file = \"{MESH}\" }}\n\
             material = {{ young = 0.4e6, poisson = 0.3, thickness = 0.0008, density = 500.0 }}\n\
             [[body.handle]]\nname = \"edge\"\ngroup = \"left\"\ndevice = \"{device}\"\n\
             [[device]]\nname = \"{device}\"\nmodel = \"falcon\"\nhand = {{ grip = \"firm\" }}\n"
        )
    });
    let text = format!("name = \"two\"\n{}", parts.concat());
    let path = folder.path().join("two.toml");
    fs::write(&path, text)?;
    let two = Scene::load(&path)?;
    let [Some(first), Some(second)] = &two.meshes[..] else {
        return Err("both bodies name a file".into());
    };
    assert!(Arc::ptr_eq(first, second), "one file, one reading");
    let before: *const Mesh = first.mesh().map_err(Clone::clone)?;
    // Copies of the scene, and everything that a run sets up, find the mesh that was read.
    let copy = two.clone();
    Prepared::new(&World::new(&copy).unwrap(), &Options::new(1.0, 1))?;
    for mesh in copy.meshes.iter().chain(&two.meshes).flatten() {
        assert!(std::ptr::eq(mesh.mesh().map_err(Clone::clone)?, before));
    }
    Ok(())
}

#[test]
fn a_file_that_cannot_be_read_is_named_with_the_field_that_names_it() -> Outcome {
    let folder = tempfile::tempdir()?;
    let text = fs::read_to_string(Path::new(SCENES).join("cloth.toml"))?;
    let path = folder.path().join("cloth.toml");
    let at = |file: &str| folder.path().join(file).display().to_string();
    let missing = "No such file or directory (os error 2)";

    let expected = format!("{}: cannot read this scene: {missing}", at("cloth.toml"));
    assert_eq!(error(Scene::load(&path)), expected);

    fs::write(&path, &text)?;
    let line = |piece: &str| {
        1 + text
            .lines()
            .take_while(|line| !line.contains(piece))
            .count()
    };
    let expected = format!(
        "{}:{}: body[0].mesh.file: cannot read {}: {missing}",
        at("cloth.toml"),
        line("mesh = {"),
        at("meshes/cloth_notched.msh"),
    );
    assert_eq!(error(Scene::load(&path)), expected);

    fs::create_dir(folder.path().join("meshes"))?;
    fs::write(folder.path().join("meshes/cloth_notched.msh"), "")?;
    let expected = format!(
        "{}:{}: device[0].hand.recording: cannot read {}: {missing}",
        at("cloth.toml"),
        line("recording = \"hands/pull_left.csv\""),
        at("hands/pull_left.csv"),
    );
    assert_eq!(error(Scene::load(&path)), expected);

    fs::create_dir(folder.path().join("hands"))?;
    fs::write(
        folder.path().join("hands/pull_left.csv"),
        "time,x,y,z\n0,0,0,0\n1,0,o,0\n",
    )?;
    let expected = format!(
        "{}:3: y: found o, allowed: a finite number",
        at("hands/pull_left.csv"),
    );
    assert_eq!(error(Scene::load(&path)), expected);
    Ok(())
}

#[test]
fn a_device_of_ones_own_is_read_from_its_file() -> Outcome {
    let folder = tempfile::tempdir()?;
    let scene = fs::read_to_string(Path::new(SCENES).join("stretch.toml"))?;
    let path = folder.path().join("scene.toml");
    let device = folder.path().join("mine.toml");
    fs::write(
        &path,
        scene.replacen("model = \"falcon\"", "model = \"mine.toml\"", 1),
    )?;
    let line = 1 + scene
        .lines()
        .take_while(|line| !line.starts_with("model = "))
        .count();
    let expected = format!(
        "{}:{line}: device[0].model: cannot read {}: No such file or directory (os error 2)",
        path.display(),
        device.display(),
    );
    assert_eq!(error(Scene::load(&path)), expected);

    let (_, falcon) = sim::models::FILES[0];
    fs::write(&device, falcon.replace("mass = 0.15 ", "mass = 0.25 "))?;
    let loaded = Scene::load(&path)?;
    let masses: Vec<_> = loaded.models.iter().map(|model| model.mass).collect();
    assert_eq!(masses, [0.25, 0.15]);
    // A log keeps the file, so that the run can be repeated.
    assert!(loaded.files.contains_key("mine.toml"));

    // Errors in the file are reported with the lines of the file.
    let line = 1 + falcon
        .lines()
        .take_while(|line| !line.starts_with("mass = "))
        .count();
    for (instead, expected) in [
        (
            "mass = -1 ",
            "mass: found -1, allowed: a number above 0 and up to 1e6",
        ),
        (
            "mess = 0.15 ",
            "mess: unknown field, allowed: rate, mass, damping, friction, \
            position_step, max_force, workspace_radius, output_delay, driver_stiffness, driver_damping, name, \
            protocol, axes, estimated, rotation, sources",
        ),
    ] {
        fs::write(&device, falcon.replace("mass = 0.15 ", instead))?;
        let expected = format!("{}:{line}: {expected}", device.display());
        assert_eq!(error(Scene::load(&path)), expected);
    }
    Ok(())
}

#[test]
fn errors_found_later_can_be_placed_too() -> Outcome {
    let stretch = Scene::embedded_default()?;
    let line = 1 + stretch
        .source
        .text
        .lines()
        .take_while(|l| *l != "group = \"left\"")
        .count();
    let error = stretch
        .source
        .error("body[0].handle[0].group", "left", "a group of the mesh");
    assert_eq!(
        error.to_string(),
        format!(
            "stretch.toml (built in):{line}: body[0].handle[0].group: found left, allowed: a group of the mesh"
        ),
    );
    Ok(())
}

#[test]
fn a_recording_is_read() -> Outcome {
    let text = "# a comment\n\n time, x ,y,z\r\n0.5,1,2,3\n# another\n0.75, 4e-3, -5, .5\n";
    let samples = recording::parse(text, "a.csv")?;
    assert_eq!(
        samples,
        [(0.5, [1.0, 2.0, 3.0]), (0.75, [0.004, -5.0, 0.5])]
    );
    Ok(())
}

#[test]
fn invalid_recordings_are_refused() {
    let cases = [
        (
            "",
            "1: found 0 rows, allowed: the header time,x,y,z and at least 2 rows",
        ),
        (
            "time,x,y,z\n0,0,0,0\n",
            "2: found 1 row, allowed: the header time,x,y,z and at least 2 rows",
        ),
        (
            "0,0,0,0\n",
            "1: found 0,0,0,0, allowed: the header time,x,y,z, whose names are separated by commas",
        ),
        (
            "#\ntime,y,x,z\n",
            "2: found time,y,x,z, allowed: the header time,x,y,z, whose names are separated by commas",
        ),
        (
            "time,x,y,z\n0,0,0\n",
            "2: found 3 columns, allowed: 4 columns, time,x,y,z: numbers with decimal points, separated by commas",
        ),
        (
            "time,x,y,z\n0,0,0,nan\n",
            "2: z: found nan, allowed: a finite number",
        ),
        (
            "time,x,y,z\n0,,0,0\n",
            "2: x: found nothing, allowed: a finite number",
        ),
        (
            "time,x,y,z\n1,0,0,0\n\n1,0,0,0\n",
            "4: time: found 1.0, allowed: a time after 1.0",
        ),
        (
            "time,x,y,z\n0,0,0,0\n3601,0,0,0\n",
            "3: time: found one of 3601.0 s, allowed: a recording of at most 3600.0 s",
        ),
    ];
    for (text, expected) in cases {
        let found =
            recording::parse(text, "a.csv").map_or_else(|e| e.to_string(), |_| String::new());
        assert_eq!(found, format!("a.csv:{expected}"));
    }
}
