//! A scene with a bad mesh: the program prints one line, returns exit code 2, and writes nothing.

use std::error::Error;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

type Outcome = Result<(), Box<dyn Error>>;

/// A scene of one body; its mesh file is named in line 7.
const SCENE: &str = r#"name = "bad"
duration = 0.02
host = { step_rate = 250.0, publish_rate = 125.0 }

[[body]]
name = "sheet"
mesh.file = "MESH"
material = { young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }
handle = [{ name = "a", group = "a", device = "hand" }]

[[device]]
name = "hand"
model = "falcon"
hand = {}
"#;

const VTK: &str = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n";
const VTU: &str = "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>\n\
    <Piece NumberOfPoints=\"1000000000\" NumberOfCells=\"1\"><Points>\
    <DataArray type=\"Float32\" format=\"ascii\">0 0 0</DataArray></Points>\
    </Piece></UnstructuredGrid></VTKFile>\n";
const MSH: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

fn palpate(arguments: &[&str], scene: &Path) -> std::io::Result<Output> {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .arg(scene)
        .current_dir(scene.parent().unwrap_or(scene))
        .output()
}

/// Runs a scene with this mesh file. Returns the message that follows the name of the file.
fn refused(name: &str, mesh: &[u8]) -> Result<String, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let scene = folder.path().join("scene.toml");
    fs::write(&scene, SCENE.replace("MESH", name))?;
    fs::write(folder.path().join(name), mesh)?;
    let writing = [
        "run", "--json", "r.json", "--plot", "r.svg", "--log", "r.mcap",
    ];
    let runs = [
        &writing[..],
        &["run", "--clock", "real", "--log", "r.mcap"],
        &["plan", "--json", "r.json"],
    ];
    let mut said = Vec::new();
    for arguments in runs {
        let output = palpate(arguments, &scene)?;
        let text = String::from_utf8(output.stderr)?;
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(output.stdout.is_empty(), "{arguments:?} printed a result");
        assert!(text.lines().count() <= 2, "{text}");
        said.push(text);
    }
    said.dedup();
    assert_eq!(said.len(), 1, "all commands say the same: {said:?}");

    let mut left: Vec<_> = fs::read_dir(&folder)?
        .map(|entry| entry.map(|entry| entry.file_name()))
        .collect::<Result<_, _>>()?;
    left.sort();
    let mut expected = [OsString::from(name), OsString::from("scene.toml")];
    expected.sort();
    assert_eq!(left, expected, "nothing was written");

    let scene = scene.display();
    let mesh = folder.path().join(name);
    let start = format!(
        "palpate: {scene}:7: body[0].mesh.file: cannot use {}: ",
        mesh.display()
    );
    let text = said.concat();
    let rest = text.strip_prefix(&start).ok_or(text.clone())?;
    Ok(rest.trim_end().to_owned())
}

#[test]
fn a_bad_mesh_is_refused_in_one_line_before_anything_is_written() -> Outcome {
    let obj = |text: &str| format!("{OBJ}{text}").into_bytes();
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "nan.obj",
            b"v 0 0 nan".to_vec(),
            "line 1: expected a finite coordinate, found \"nan\"",
        ),
        (
            "range.obj",
            obj("f 1 2 4"),
            "line 4: expected a vertex from 1 to 3, found 4",
        ),
        (
            "flat.obj",
            obj("v 2 0 0\nf 1 2 4"),
            "line 5: triangle 0 is flat: its height is 0.000e0 of its longest edge; at least 1e-6 is needed",
        ),
        (
            "crowded.obj",
            obj("v 0 0 1\nv 0 0 -1\nf 1 2 3\nf 1 2 4\nf 1 2 5"),
            "line 8: edge 0-1: triangles 0, 1 and 2 meet there; at most two triangles may share an edge",
        ),
        (
            "twins.obj",
            obj("v 0 0 0\nv 1 1 1\nf 1 2 3\nf 4 5 2"),
            "line 4: vertices 0 and 3 lie at one place, where the mesh is not connected; merge the two vertices, as mesh.merge of a scene does (a slit needs a gap)",
        ),
        (
            "empty.obj",
            Vec::new(),
            "line 1: the mesh has no triangles; at least one is needed",
        ),
        (
            "latin.obj",
            b"# \xe9".to_vec(),
            "line 1: expected OBJ text in UTF-8, found bytes that are no text",
        ),
        (
            "empty.vtk",
            Vec::new(),
            "line 1: expected # vtk DataFile Version 2.0 to 5.1, found the end of the file",
        ),
        (
            "billion.vtk",
            format!("{VTK}POINTS 1000000000 float\n0 0 0").into(),
            "line 5: expected 3000000000 numbers after this line, as it says, found 3 up to the end of the file",
        ),
        (
            "billion_binary.vtk",
            format!(
                "{}POINTS 1000000000 float\n0 0 0",
                VTK.replace("ASCII", "BINARY")
            )
            .into(),
            "byte 53: expected 3000000000 numbers after this line, as it says, found 5 bytes up to the end of the file",
        ),
        (
            "billion.vtu",
            VTU.into(),
            "line 2: expected 3000000000 coordinates, as this Piece says, found 3 in the DataArray",
        ),
        (
            "cut.vtu",
            VTU.as_bytes()[..120].to_vec(),
            "line 2: expected well-formed XML, found \"syntax error: tag not closed: `>` not fo\"...",
        ),
        (
            "empty.vtp",
            Vec::new(),
            "line 1: expected a VTKFile, found the end of the tags",
        ),
        (
            "empty.msh",
            Vec::new(),
            "line 1: expected $MeshFormat, found the end of the file",
        ),
        (
            "billion.msh",
            format!("{MSH}$Nodes\n1 1000000000 1 1000000000\n2 1 0 1000000000\n1\n").into(),
            "line 7: expected a node's tag, found the end of the file",
        ),
        (
            "empty.stl",
            b"solid".to_vec(),
            "line 1: the mesh has no triangles; at least one is needed",
        ),
        (
            "unknown.step",
            b"ISO-10303-21;".to_vec(),
            "expected a mesh file whose name ends in .obj, .stl, .vtk, .vtu, .vtp or .msh, found another name and a file that begins with \"ISO-10303-21;\"",
        ),
    ];
    let mut wrong = Vec::new();
    for (name, mesh, expected) in cases {
        let found = refused(name, &mesh)?;
        if found != expected {
            wrong.push(format!("{name}\n  is  {found}\n  not {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

#[test]
fn a_good_mesh_of_another_format_runs() -> Outcome {
    let folder = tempfile::tempdir()?;
    let scene = folder.path().join("scene.toml");
    fs::write(&scene, SCENE.replace("MESH", "sheet.obj"))?;
    let mesh = "v 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\ng a\nf 1 2 3\ng b\nf 1 3 4\n";
    fs::write(folder.path().join("sheet.obj"), mesh)?;
    let output = palpate(&["run", "--json", "r.json"], &scene)?;
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(folder.path().join("r.json").is_file());
    Ok(())
}
