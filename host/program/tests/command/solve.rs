//! `palpate solve` and `palpate mesh`: their output, files and exit codes.

use host::world::World;

use host::scene::Scene;
use host::solve::{Frame, solve};
use std::convert::Infallible;
use std::fmt::Write as _;
use std::process::Command;
use support::solve::{body, cube, force};

/// The output, the files and the exit codes of the program.
#[test]
fn the_program_writes_the_requested_files() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let palpate = |scene: &str| {
        std::fs::write(file("scene.toml"), scene).unwrap();
        Command::new(env!("CARGO_BIN_EXE_palpate"))
            .arg("solve")
            .arg(file("scene.toml"))
            .arg("--vtu")
            .arg(file("frames"))
            .arg("--plot")
            .arg(file("plot.svg"))
            .arg("--json")
            .arg(file("solution.json"))
            .output()
            .unwrap()
    };
    let output = palpate(&cube("linear", r#"["z"]"#));
    assert_eq!(output.status.code(), Some(0));
    let printed = String::from_utf8(output.stdout).unwrap();
    let bottom = printed
        .lines()
        .find(|line| line.contains("bottom"))
        .unwrap();
    assert!(
        bottom.contains("force (0.000, 0.000, 20.000) N"),
        "{bottom}"
    );
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(file("solution.json")).unwrap()).unwrap();
    assert_eq!(json["schema"], "palpate.solve/1");
    assert_eq!(json["bodies"][0]["elements"], 1296);
    assert_eq!(json["bodies"][0]["reactions"][1]["name"], "top");
    assert!(
        std::fs::read_to_string(file("plot.svg"))
            .unwrap()
            .contains("cube, bottom")
    );
    let list = std::fs::read_to_string(file("frames/frames.pvd")).unwrap();
    for number in 0..=2 {
        let name = format!("cube_{number:04}.vtu");
        assert!(list.contains(&name), "{list}");
        let frame = std::fs::read_to_string(file("frames").join(name)).unwrap();
        assert!(frame.ends_with("</VTKFile>\n"));
    }

    // A solve that stops early: its results so far are written, and the exit code is 1.
    let stuck = cube("st_venant_kirchhoff", r#"["x", "y", "z"]"#).replace("-0.01", "-0.09");
    let output = palpate(&stuck);
    assert_eq!(output.status.code(), Some(1));
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("not solved cube: at 0."), "{printed}");
    assert!(file("frames/cube_0000.vtu").exists());

    // A wrong scene.
    let output = palpate("name = 3");
    assert_eq!(output.status.code(), Some(2));
}

/// The output of the program for a scene, and its exit code.
fn solved(folder: &std::path::Path, scene: &str) -> (String, Option<i32>) {
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("solve")
        .arg(&path)
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    (printed, output.status.code())
}

/// Steel under a very small load: the solution moves, the program reports that rounding limits the digits, or that
/// there are too few digits.
#[test]
fn a_load_below_rounding_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |analysis: &str, force: f64| {
        format!(
            r#"
name = "block"
gravity = [0, 0, 0]
{analysis}
[[body]]
name = "block"
mesh.box = {{ size = [0.1, 0.1, 0.1], cells = [4, 4, 4] }}
material = {{ law = "linear", young = 210e9, poisson = 0.3, density = 7850 }}
[[body.support]]
name = "floor"
group = "bottom"
[[body.load]]
name = "push"
group = "top"
force = [{force}, 0, 0]
"#
        )
    };
    let moved = |force: f64| body(&scene("", force)).displacement.value / force;
    let (far, near) = (moved(1e4), moved(1e-4));
    // Strains of 5e-14 are known to 1.1e-16, which is 0.2 %. The tolerance is three times that.
    assert!((near - far).abs() < 7e-3 * far, "{near:e} {far:e}");
    let (printed, code) = solved(folder.path(), &scene("", 1e-4));
    assert_eq!(code, Some(0), "{printed}");
    assert!(printed.contains("limited by rounding: "), "{printed}");
    let (printed, code) = solved(folder.path(), &scene("", 1e4));
    assert_eq!(code, Some(0), "{printed}");
    assert!(!printed.contains("limited by rounding"), "{printed}");

    let motion = "duration = 1e-4\n[solve]\nanalysis = \"dynamic\"\nstep = 1e-5";
    for analysis in ["", motion] {
        let (printed, code) = solved(folder.path(), &scene(analysis, 1e-9));
        assert_eq!(code, Some(1), "{printed}");
        assert!(printed.contains("too few digits"), "{printed}");
    }
}

/// A strip a kilometre from the origin. Rubber deforms as at the origin; steel under a very small load is reported.
#[test]
fn a_strip_far_away_is_solved_as_far_as_its_digits_allow() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |far: u32, young: f64, force: f64| {
        let mut mesh = String::new();
        for column in 0..=8 {
            for row in 0..=2 {
                let (x, y) = (f64::from(column) / 64.0, f64::from(row) / 64.0);
                writeln!(mesh, "v {} {y} 0", f64::from(far) + x).expect("a string takes it");
            }
        }
        for column in 0..8 {
            for row in 1..=2 {
                let a = 3 * column + row;
                writeln!(mesh, "f {a} {} {}\nf {a} {} {}", a + 3, a + 4, a + 4, a + 1)
                    .expect("a string takes it");
            }
        }
        std::fs::write(folder.path().join("strip.obj"), mesh).unwrap();
        format!(
            r#"
name = "strip"
gravity = [0, 0, 0]
[[body]]
name = "strip"
mesh.file = "strip.obj"
material = {{ young = {young:e}, poisson = 0.3, thickness = 1e-3, density = 1000 }}
[[body.support]]
name = "wall"
box = [[{far}, -1, -1], [{far}.001, 1, 1]]
[[body.support]]
name = "plane"
box = [[{far}, -1, -1], [{}, 1, 1]]
axes = ["z"]
[[body.load]]
name = "pull"
box = [[{far}.124, -1, -1], [{}, 1, 1]]
force = [{force:e}, 0, 0]
"#,
            far + 1,
            far + 1,
        )
    };
    let moved = |far: u32| {
        let text = scene(far, 1e6, 1.0);
        let (printed, code) = solved(folder.path(), &text);
        assert_eq!(code, Some(0), "{printed}");
        let mut keep = |_: Frame<'_>| Ok::<(), Infallible>(());
        let loaded = Scene::load(&folder.path().join("scene.toml")).unwrap();
        solve(&World::new(&loaded).unwrap(), false, &mut |_| {}, &mut keep)
            .unwrap()
            .bodies[0]
            .displacement
            .value
    };
    let (near, far) = (moved(0), moved(1000));
    // Coordinates of 1 km are rounded to 6e-14 m, for a motion of 4 mm: 1.5e-11. Each of eight cells adds as much.
    assert!((near - far).abs() < 1e-9 * near, "{near} {far}");
    let (printed, code) = solved(folder.path(), &scene(1000, 210e9, 1e-4));
    assert_eq!(code, Some(1), "{printed}");
    assert!(printed.contains("too few digits"), "{printed}");
    assert!(printed.contains("nearer to the origin"), "{printed}");
}

/// A mesh that is written in each format and read again, with its material by element, gives the same solution.
#[test]
fn a_mesh_keeps_its_material_through_every_format() {
    let scene = |mesh: &str, material: &str, region: &str, hold: &str, pull: &str| {
        format!(
            r#"
name = "bar"
[solve]
tolerance = 1e-10
[[body]]
name = "bar"
mesh = {{ {mesh} }}
material = {{ law = "linear", young = 1e6, poisson = 0.3, density = 1000{material} }}
{region}
[[body.support]]
name = "wall"
{hold}
[[body.load]]
name = "pull"
{pull}
force = [1, 0, -1]
"#
        )
    };
    let boxes = [
        "box = [[-1, -1, -1], [-0.0999, 1, 1]]",
        "box = [[0.0999, -1, -1], [1, 1, 1]]",
    ];
    let core = r"
[[body.region]]
box = [[-0.05, -1, -1], [0.05, 1, 1]]
young = 3e6
poisson = 0.4
";
    let generated = "box = { size = [0.2, 0.04, 0.04], cells = [8, 2, 2] }, order = 2";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let text = scene(generated, "", core, boxes[0], boxes[1]);
    std::fs::write(&path, &text).unwrap();
    let expected = body(&text);
    for (ending, by) in [
        ("msh", ["group = \"left\"", "group = \"right\""]),
        ("vtk", boxes),
        ("vtu", boxes),
    ] {
        let file = format!("bar.{ending}");
        let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .arg("mesh")
            .arg(&path)
            .arg(folder.path().join(&file))
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{ending}");
        let printed = String::from_utf8(output.stdout).unwrap();
        assert!(printed.contains("young 1000000 to 3000000"), "{printed}");

        let fields = ", fields = { young = \"young\", poisson = \"poisson\" }";
        let text = scene(&format!("file = \"{file}\""), fields, "", by[0], by[1]);
        let second = folder.path().join("second.toml");
        std::fs::write(&second, text).unwrap();
        let mut keep = |_: Frame<'_>| Ok::<(), Infallible>(());
        let solution = solve(
            &World::new(&Scene::load(&second).unwrap()).unwrap(),
            false,
            &mut |_| {},
            &mut keep,
        )
        .unwrap();
        let found = &solution.bodies[0];
        assert_eq!(
            (found.elements, found.vertices),
            (expected.elements, expected.vertices)
        );
        // Formats number the vertices in another order, so sums round differently. The tolerance of the solve is 1e-10.
        let (a, b) = (found.displacement.value, expected.displacement.value);
        assert!((a - b).abs() < 1e-8 * b, "{ending}: {a} {b}");
        let (a, b) = (force(found, "wall"), force(&expected, "wall"));
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-8, "{ending}: {a} {b}");
        }
    }
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("mesh")
        .arg(&path)
        .arg(folder.path().join("bar.stl"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn a_mesh_is_judged_with_and_without_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let check = |file: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .current_dir(folder.path())
            .args(["mesh", "check", file])
            .output()
            .unwrap();
        let [printed, warned] =
            [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        (output.status.code(), printed, warned)
    };
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    // A vertex 1 mm beside another one makes two needles of three triangles.
    write(
        "thin.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.999 1 0\ng soft stiff\nf 1 2 5\nf 2 3 5\nf 1 5 4\n",
    );
    let (code, printed, warned) = check("thin.obj");
    assert_eq!(code, Some(0));
    let worst = "  quality    0.002 to 0.829, median 0.828; 1 for equal sides, 0 without an area or a volume\n  \
                 needles    1 of 3 triangles with a quality below 0.05, over 0.05 % of the area\n  \
                 worst      triangle 1 at [1, 0.667, 0] with 0.002\n";
    let open = "  surface    an open mesh: the edge from [0, 0, 0] to [1, 0, 0] has one triangle; an obstacle needs a closed \
                mesh\n";
    assert!(printed.ends_with(&format!("{worst}{open}")), "{printed}");
    let lines: Vec<_> = warned.lines().collect();
    assert_eq!(lines.len(), 2, "{warned}");
    assert!(
        lines[0].starts_with("palpate: warning: thin.obj: found 1 of 3 triangles"),
        "{warned}"
    );
    assert!(
        lines[1].contains("groups \"soft\" and \"stiff\" with the same 3 triangles"),
        "{warned}"
    );

    write(
        "scene.toml",
        "name = 'x'\n[[body]]\nname = 'cloth'\nmesh.file = 'thin.obj'\n\
         material = { young = 1e6, poisson = 0.3, thickness = 1e-3, density = 1000 }\n",
    );
    let (code, printed, warned) = check("scene.toml");
    assert_eq!(code, Some(0));
    assert!(
        printed.starts_with("cloth: 3 triangles") && printed.ends_with(worst),
        "{printed}"
    );
    assert!(
        warned.starts_with("palpate: warning: scene.toml:4: body[0].mesh"),
        "{warned}"
    );

    let contact = "self_contact = true\ncontact_thickness = 5e-4\n[[obstacle]]\nname = 'floor'\nshape = 'plane'\nposition = [0, 0, HEIGHT]\n";
    let scene = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let on_floor = |height: &str| {
        write(
            "floor.toml",
            &(scene.clone() + &contact.replace("HEIGHT", height)),
        );
        check("floor.toml")
    };
    let (code, printed, _) = on_floor("-0.001");
    let end = "floor: obstacle, plane, still\ncloth and cloth: touch at 0.0005 m, friction 0.3\ncloth and floor: touch at \
               0.00025 m, friction 0.3\n";
    assert!(code == Some(0) && printed.ends_with(end), "{printed}");
    let (code, printed, warned) = on_floor("0.01");
    assert_eq!((code, &printed[..]), (Some(2), ""));
    let said = "palpate: floor.toml:8: obstacle[0]: found body \"cloth\" 0.01 m inside obstacle \"floor\" at ";
    assert!(warned.contains(said), "{warned}");

    write("slit.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n");
    let (code, printed, warned) = check("slit.obj");
    assert_eq!((code, &printed[..]), (Some(2), ""));
    assert!(warned.contains("slit.obj: line 3"), "{warned}");
}
