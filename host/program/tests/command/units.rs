//! Values in the wrong unit, as a user meets them: what the program prints, and how it ends.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// A sheet in a hand, without weight.
fn scene(young: &str, hand: &str) -> String {
    format!(
        "name = 'sheet'\nduration = 0.4\ngravity = [0, 0, 0]\n[[body]]\nname = 'sheet'\n\
         mesh.sheet = {{ length = 0.1, width = 0.1, cells = [2, 2] }}\n\
         material = {{ young = {young}, poisson = 0.3, thickness = 0.001, density = 1000 }}\n\
         [[body.handle]]\nname = 'edge'\ngroup = 'left'\ndevice = 'touch'\n\
         [[device]]\nname = 'touch'\nmodel = 'touch'\nhand = {{ {hand} }}\n"
    )
}

/// Runs `palpate` with `arguments` in `folder`, in which `scene` is the file `scene.toml`.
fn palpate(folder: &Path, scene: &str, arguments: &[&str]) -> Output {
    fs::write(folder.join("scene.toml"), scene).unwrap();
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn every_command_warns_before_it_starts_and_in_its_json() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene("5e10", "");
    let warning = "scene.toml:7: body[0].material.young: found 5e10 Pa, usual: 1000 to 1e10 Pa; is the exponent right? \
                   rubber has 1e6 to 1e8 Pa, cloth 1e5 to 1e9 Pa, paper 3e9 Pa";
    for arguments in [
        &[
            "run",
            "scene.toml",
            "--duration",
            "0.01",
            "--json",
            "out.json",
        ][..],
        &["plan", "scene.toml", "--json", "out.json"],
        &["solve", "scene.toml", "--json", "out.json"],
        &["mesh", "scene.toml", "out.msh"],
    ] {
        let output = palpate(folder.path(), &scene, arguments);
        let printed = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {printed}");
        assert_eq!(
            printed,
            format!("palpate: warning: {warning}\n"),
            "{arguments:?}"
        );
        if arguments.contains(&"--json") {
            let json = fs::read(folder.path().join("out.json")).unwrap();
            let json: Value = serde_json::from_slice(&json).unwrap();
            assert_eq!(
                json["warnings"],
                Value::from(vec![warning]),
                "{arguments:?}"
            );
        }
    }
}

#[test]
fn what_no_scene_can_mean_ends_every_command_with_exit_code_2() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene("1e6", "").replace("length = 0.1", "length = 100");
    let expected = "palpate: scene.toml:6: body[0].mesh: found 100 m along the longest side of the mesh, allowed: 1e-6 \
                    to 20 m; is the value in millimetres? lengths are in metres: 1 mm is 0.001\n";
    for arguments in [
        &["run", "scene.toml"][..],
        &["plan", "scene.toml"],
        &["solve", "scene.toml"],
        &["mesh", "scene.toml", "out.msh"],
    ] {
        let output = palpate(folder.path(), &scene, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(
            String::from_utf8(output.stderr).unwrap(),
            expected,
            "{arguments:?}"
        );
    }
}

#[test]
fn a_run_without_most_of_its_readings_ends_with_exit_code_1() {
    let folder = tempfile::tempdir().unwrap();
    let hand = "grip = 'rigid', waypoints = [[0, 0, 0, 0], [0.1, 1.9, 0, 0], [0.2, 0, 0, 0], [0.3, 1.9, 0, 0], \
                [0.4, 0, 0, 0]]";
    let output = palpate(folder.path(), &scene("1e6", hand), &["run", "scene.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let printed = String::from_utf8(output.stdout).unwrap();
    let line = printed.lines().last().unwrap();
    assert!(
        line.starts_with("  FAILED     device \"touch\" gave no usable reading in "),
        "{printed}"
    );
}
