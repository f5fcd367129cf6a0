//! Values that no scene can mean are refused; values that few scenes mean are warned of. Each message in full.

use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use sim::models::FILES;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A scene without a warning. Each case changes one piece of it.
const BASE: &str = r#"name = "base"
gravity = [0, 0, -9.81]

[[body]]
name = "organ"
mesh = { file = "organ.obj" }
material = { young = 2e4, poisson = 0.4, thickness = 0.002, density = 1000 }

[[body.handle]]
name = "grip"
box = [[-1, -1, -1], [0.001, 1, 1]]
device = "hand"

[[device]]
name = "hand"
model = "mine.toml"
hand = { task = "tap", direction = [0, 0, -1] }
"#;

/// A patch of 80 mm by 40 mm, in metres.
const ORGAN: &str = "v 0 0 0\nv 0.08 0 0\nv 0.08 0.04 0\nv 0 0.04 0\nf 1 2 3\nf 1 3 4\n";

/// The same in millimetres.
const IN_MILLIMETRES: &str = "v 0 0 0\nv 80 0 0\nv 80 40 0\nv 0 40 0\nf 1 2 3\nf 1 3 4\n";

/// The error of a scene, or else its warnings, one a line. Scenes of these tests may leave a device without a handle.
fn judged(text: &str, files: &[(&str, &str)]) -> String {
    let mut all = BTreeMap::from([
        ("organ.obj".to_owned(), ORGAN.as_bytes().to_vec()),
        ("mine.toml".to_owned(), FILES[1].1.as_bytes().to_vec()),
    ]);
    let given = files.iter();
    all.extend(given.map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec())));
    let loaded = match Scene::load_texts("x.toml", text, &all) {
        Ok(loaded) => loaded,
        Err(error) => return format!("error {error}"),
    };
    let mut warnings = match World::new(&loaded) {
        Ok(world) => world.warnings,
        Err(error) => return format!("error {error}"),
    };
    warnings.retain(|warning| !warning.found.starts_with("no handle of the device"));
    let lines: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

/// Checks cases of a piece of [`BASE`], its replacement and the resulting message.
fn check(cases: &[(&str, &str, &str)]) {
    let mut wrong = Vec::new();
    for (piece, instead, expected) in cases {
        assert_eq!(BASE.matches(piece).count(), 1, "{piece:?} is not one place");
        let found = judged(&BASE.replace(piece, instead), &[]);
        if found != *expected {
            wrong.push(format!("{instead}\n  is  {found}\n  not {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_base_scene_has_no_warning() {
    assert_eq!(judged(BASE, &[]), "");
}

#[test]
fn linear_tetrahedra_of_a_material_that_keeps_its_volume_are_warned_of() {
    let solid = |order: &str, poisson: &str| {
        let text = format!(
            "name = 'block'\n[[body]]\nname = 'b'\nmesh = {{ box = {{ size = [0.1, 0.1, 0.05], cells = [1, 1, 1] }}{order} }}\n\
             material = {{ young = 1e4, density = 1000, poisson = {poisson} }}\n"
        );
        judged(&text, &[])
    };
    assert_eq!(
        solid("", "0.45"),
        "x.toml:4: body[0].mesh: found linear tetrahedra with a Poisson's ratio of 0.45, usual: up to 0.4 for linear \
         tetrahedra; linear tetrahedra lock where the volume hardly changes, and forces are far too large: set \
         mesh.order = 2"
    );
    assert_eq!(solid("", "0.4"), "");
    assert_eq!(solid(", order = 2", "0.499"), "");
    // The ratio of a region counts, too.
    let text = solid(
        "",
        "0.3 }\n[[body.region]]\nbox = [[-1, -1, -1], [1, 1, 1]]\npoisson = 0.49\n#",
    );
    assert!(text.contains("a Poisson's ratio of 0.49"), "{text}");
}

#[test]
fn needles_are_counted_with_their_worst_place_and_the_expected_harm() {
    let sheet = |cells: &str| {
        let mesh = format!("mesh.sheet = {{ length = 0.08, width = 0.04, cells = {cells} }}");
        judged(&BASE.replace("mesh = { file = \"organ.obj\" }", &mesh), &[])
    };
    assert_eq!(sheet("[2, 32]"), "");
    assert_eq!(
        sheet("[2, 128]"),
        "x.toml:6: body[0].mesh: found 512 of 512 triangles with a quality below 0.05, over 100 % of the area, the worst \
         triangle 24 at [-0.0133, -0.018, 0] with 0.0156, usual: 0.05 or above; forces may err by -95 to +100 % where \
         the sheet bends, and be 12 times too large where it bends in its plane: mesh the shape anew with sides of \
         similar lengths; `palpate mesh check` names the worst places"
    );
}

#[test]
fn groups_that_cannot_be_told_apart_are_warned_of_where_the_scene_names_one() {
    let region = |name: &str| {
        let region = format!("[[body.region]]\ngroup = \"{name}\"\nyoung = 3e4\n[[body.handle]]");
        let organ = ORGAN.replace("f 1 2 3", "g soft stiff\nf 1 2 3");
        judged(
            &BASE.replace("[[body.handle]]", &region),
            &[("organ.obj", &organ)],
        )
    };
    for name in ["soft", "stiff"] {
        assert_eq!(
            region(name),
            "x.toml:6: body[0].mesh: found groups \"soft\" and \"stiff\" with the same 2 triangles, usual: groups that \
             differ; did a program that converts meshes put every element into every group? Use the file from which it \
             converted; Gmsh 2.2 and 4.1 files are read as they are"
        );
    }
    // Groups that the scene does not name do no harm.
    assert_eq!(
        judged(
            BASE,
            &[("organ.obj", &ORGAN.replace("f 1 2 3", "g a b\nf 1 2 3"))]
        ),
        ""
    );
}

/// The scenes under `folder`, and in the folders in it.
fn scenes(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            scenes(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "toml") {
            found.push(path);
        }
    }
}

#[test]
fn no_shipped_scene_has_a_warning() {
    let mut paths = Vec::new();
    scenes(
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes")),
        &mut paths,
    );
    assert!(paths.len() >= 13, "{paths:?}");
    for path in paths {
        let loaded = Scene::load(&path).unwrap();
        let warnings = World::new(&loaded).unwrap().warnings;
        assert!(warnings.is_empty(), "{}: {warnings:?}", path.display());
    }
}

#[test]
fn a_mesh_in_millimetres_is_refused_and_scaled_it_is_usual() {
    let millimetres = [("organ.obj", IN_MILLIMETRES)];
    assert_eq!(
        judged(BASE, &millimetres),
        "error x.toml:6: body[0].mesh.file: found 80 m along the longest side of the mesh, allowed: 1e-6 to 20 m; is \
         the mesh in millimetres (set mesh.scale = 0.001) or in centimetres (0.01)?"
    );
    let scaled = BASE.replace("\"organ.obj\" }", "\"organ.obj\", scale = 0.001 }");
    assert_eq!(judged(&scaled, &millimetres), "");
    // A small part in millimetres may be as large as a room.
    let part = [("organ.obj", &*IN_MILLIMETRES.replace("80", "8"))];
    let handle = BASE.replace("[0.001, 1, 1]", "[0.001, 100, 1]");
    let large = judged(&handle, &[(part[0].0, &part[0].1.replace("40", "4"))]);
    assert_eq!(
        large,
        "x.toml:6: body[0].mesh.file: found 8 m along the longest side of the mesh, usual: 0.001 to 3 m; is the mesh \
         in millimetres (set mesh.scale = 0.001) or in centimetres (0.01)?"
    );
    // A mesh in metres that is scaled all the same.
    assert_eq!(
        judged(&scaled, &[]),
        "x.toml:6: body[0].mesh.scale: found 8e-5 m along the longest side of the mesh, usual: 0.001 to 3 m; is the \
         mesh in metres already? leave out mesh.scale"
    );
}

#[test]
fn bodies_out_of_range_are_named_with_the_likely_cause() {
    check(&[
        (
            "mesh = { file = \"organ.obj\" }",
            "mesh.sheet = { length = 100, width = 60, cells = [2, 2] }",
            "error x.toml:6: body[0].mesh: found 100 m along the longest side of the mesh, allowed: 1e-6 to 20 m; is the \
             value in millimetres? lengths are in metres: 1 mm is 0.001",
        ),
        (
            "young = 2e4",
            "young = 2e14",
            "error x.toml:7: body[0].material.young: found 2e14 Pa, allowed: 0.001 to 1e13 Pa; is the exponent right? \
             rubber has 1e6 to 1e8 Pa, cloth 1e5 to 1e9 Pa, paper 3e9 Pa",
        ),
        (
            "young = 2e4",
            "young = 5e10",
            "x.toml:7: body[0].material.young: found 5e10 Pa, usual: 1000 to 1e10 Pa; is the exponent right? rubber has \
             1e6 to 1e8 Pa, cloth 1e5 to 1e9 Pa, paper 3e9 Pa",
        ),
        (
            "mesh = { file = \"organ.obj\" }\nmaterial = { young = 2e4, poisson = 0.4, thickness = 0.002, density = 1000 }",
            "mesh.box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1] }\n\
             material = { young = 5e9, poisson = 0.4, density = 1000 }",
            "x.toml:7: body[0].material.young: found 5e9 Pa, usual: 100 to 1e9 Pa; is the exponent right? tissue has \
             1e3 to 1e6 Pa, rubber 1e6 to 1e8 Pa",
        ),
        (
            "density = 1000",
            "density = 1.06",
            "x.toml:7: body[0].material.density: found 1.06 kg/m3, usual: 5 to 25000 kg/m3; is the value in g/cm3? 1 g/cm3 is \
             1000 kg/m3",
        ),
        (
            "thickness = 0.002",
            "thickness = 2",
            "x.toml:7: body[0].material.thickness: found 2 m, usual: 1e-6 to 0.05 m; is the value in millimetres? 1 mm is 0.001 \
             m",
        ),
        (
            "-9.81]",
            "-9810]",
            "error x.toml:2: gravity: found 9810 m/s2, allowed: up to 1000 m/s2; is the value in mm/s2? gravity on earth is \
             9.81 m/s2",
        ),
        (
            "[[body.handle]]",
            "position = [0, 0, -2500]\n[[body.handle]]",
            "error x.toml:9: body[0].position: found 2500 m, allowed: up to 1000 m; is the value in millimetres? positions are in \
             metres",
        ),
        (
            "[[body.handle]]",
            "[[body.region]]\nbox = [[-1, -1, -1], [1, 1, 1]]\ndensity = 1e7\n[[body.handle]]",
            "error x.toml:11: body[0].region[0].density: found 1e7 kg/m3, allowed: 0.001 to 1e6 kg/m3; is the value in g/m3? \
             water has 1000 kg/m3, lead 11300 kg/m3",
        ),
    ]);
}

#[test]
fn devices_and_hands_out_of_range_are_named_with_the_likely_cause() {
    check(&[
        (
            "direction = [0, 0, -1] }",
            "direction = [0, 0, -1], depth = 10 }",
            "error x.toml:17: device[0].hand.depth: found 10 m from the start of the hand, allowed: up to 2 m; is the value in \
             millimetres? motions of hands are in metres of the device",
        ),
        (
            "direction = [0, 0, -1] }",
            "direction = [0, 0, -1], depth = 0.4 }",
            "x.toml:17: device[0].hand.depth: found 0.4 m from the start of the hand, usual: up to 0.075 m; is the value in \
             millimetres? motions of hands are in metres of the device",
        ),
        (
            "direction = [0, 0, -1] }",
            "direction = [0, 0, -1], waypoints = [[0, 0, 0, 0], [1, 0.3, 0.4, 0]], mass = 300 }",
            "x.toml:17: device[0].hand.mass: found 300 kg, usual: 0.01 to 10 kg; is the value in grams? the grips have 0.1 to 2 \
             kg\n\
             x.toml:17: device[0].hand.waypoints[1]: found 0.5 m from the start of the hand, usual: up to 0.075 m; is the \
             value in millimetres? motions of hands are in metres of the device",
        ),
        (
            "model = \"mine.toml\"",
            "model = \"mine.toml\"\nmotion_scale = 1000",
            "x.toml:17: device[0].motion_scale: found 1000, usual: 0.01 to 100; the scale is metres in the scene per metre of \
             the device",
        ),
    ]);
    let touch = FILES[1].1;
    let file = |piece: &str, instead: &str| {
        assert_eq!(
            touch.matches(piece).count(),
            1,
            "{piece:?} is not one place"
        );
        judged(BASE, &[("mine.toml", &touch.replace(piece, instead))])
    };
    assert_eq!(
        file("position_step = 0.055e-3", "position_step = 0.01"),
        "error mine.toml:7: position_step: found 0.01 m, allowed: 1e-12 to 0.005 m; is the value in millimetres? haptic devices \
         count 1e-6 to 1e-4 m"
    );
    assert_eq!(
        file("mass = 0.045 ", "mass = 45 "),
        "mine.toml:4: mass: found 45 kg, usual: 0.005 to 20 kg; is the value in grams? the handle of a haptic device moves with \
         0.01 to 2 kg"
    );
}

#[test]
fn a_recording_in_millimetres_is_refused_or_warned_of() {
    let text = BASE.replace(
        "hand = { task = \"tap\", direction = [0, 0, -1] }",
        "hand = { recording = \"hand.csv\" }",
    );
    let cases = [
        (
            "time,x,y,z\n0,0,0,0\n1.25,12,0,-5\n2,0,0,0\n",
            "error x.toml:17: device[0].hand.recording: found 13 m from the start of the hand, at time 1.25 s, allowed: \
             up to 2 m; is the value in millimetres? motions of hands are in metres of the device",
        ),
        (
            "time,x,y,z\n0,0,0,0\n1.25,0.404,0,0\n2,0,0,0\n",
            "x.toml:17: device[0].hand.recording: found 0.404 m from the start of the hand, at time 1.25 s, usual: up to \
             0.075 m; is the value in millimetres? motions of hands are in metres of the device",
        ),
        ("time,x,y,z\n0,0,0,0\n1.25,0.012,0,-0.005\n2,0,0,0\n", ""),
    ];
    for (csv, expected) in cases {
        assert_eq!(judged(&text, &[("hand.csv", csv)]), expected);
    }
}

/// A block whose lower face is on a table, with the handles `handles`.
fn block(rest: &str) -> String {
    format!(
        "name = 'block'\n[[body]]\nname = 'block'\n\
         mesh.box = {{ size = [0.1, 0.1, 0.1], cells = [4, 4, 4] }}\n\
         material = {{ young = 1e4, poisson = 0.4, density = 1000 }}\n\
         [[body.support]]\nname = 'table'\ngroup = 'bottom'\n{rest}\n\
         [[device]]\nname = 'a'\nmodel = 'touch'\nhand = {{}}\n\
         [[device]]\nname = 'b'\nmodel = 'touch'\nhand = {{}}\n"
    )
}

#[test]
fn parts_that_share_vertices_are_named_with_their_number() {
    let thumb = "[[body.handle]]\nname = 'thumb'\ngroup = 'left'\ndevice = 'a'\n";
    let finger =
        "[[body.handle]]\nname = 'finger'\nbox = [[-1, -1, 0.04], [1, 1, 1]]\ndevice = 'b'\n";
    assert_eq!(
        judged(&block(&format!("{thumb}{finger}")), &[]),
        "error x.toml:13: body[0].handle[1]: found 5 vertices in both handle \"finger\" (25 vertices) and handle \
         \"thumb\" (25 vertices), allowed: vertices that only one of the two holds: make the group or the box of one of \
         the two smaller"
    );
    // A handle on a support takes its vertices from the support.
    assert_eq!(
        judged(&block(thumb), &[]),
        "x.toml:9: body[0].handle[0]: found 5 vertices in both handle \"thumb\" (25 vertices) and support \
         \"table\", usual: no shared vertices; the hand moves these vertices, and the support does not hold them: make \
         the group or the box of one of the two smaller"
    );
    assert_eq!(judged(&block(finger), &[]), "");
    // Many supports give one warning, and their body is built once.
    let tables = (0..1000).map(|n| format!("[[body.support]]\nname = 's{n}'\ngroup = 'bottom'\n"));
    let many = block(&format!("{thumb}{}", tables.collect::<String>()));
    assert_eq!(
        judged(&many, &[]),
        "x.toml:9: body[0].handle[0]: found 5 vertices in both handle \"thumb\" (25 vertices) and support \
         \"table\", and some in 1000 other supports, usual: no shared vertices; the hand moves these vertices, and the \
         support does not hold them: make the group or the box of one of the two smaller"
    );
    let loaded = Scene::load_texts("x.toml", &many, &BTreeMap::new()).unwrap();
    assert_eq!(World::new(&loaded).unwrap().bodies[0].body.epoch(), 1);
    // A support that slides may be a plane of symmetry: a handle may extend to it.
    let sliding = block(thumb).replace("group = 'bottom'", "group = 'bottom'\naxes = ['z']");
    assert_eq!(judged(&sliding, &[]), "");
    // A support that turns is rigid, as a handle is.
    let wrench = "[[body.support]]\nname = 'wrench'\ngroup = 'top'\nrotation = [0, 0, 1]\n";
    let turned = judged(&block(&format!("{wrench}{thumb}")), &[]);
    assert_eq!(
        turned,
        "error x.toml:9: body[0].support[1]: found 5 vertices in both support \"wrench\", which turns, (25 vertices) and \
         handle \"thumb\" (25 vertices), allowed: vertices that only one of the two holds: make the group or the box of \
         one of the two smaller"
    );
}

#[test]
fn a_press_that_leaves_little_of_a_solid_is_warned_of() {
    let handle = "[[body.handle]]\nname = 'h'\ngroup = 'top'\ndevice = 'a'\n";
    let pressed = |row: &str| {
        let text =
            block(handle).replacen("hand = {}", &format!("hand = {{ waypoints = {row} }}"), 1);
        judged(&text, &[])
    };
    assert_eq!(
        pressed("[[0, 0, 0, 0], [1, 0, 0, -0.072]]"),
        "x.toml:17: device[0].hand.waypoints[1]: found a motion of 0.0720 m towards supports that are 0.1000 m ahead, usual: \
         up to 0.7 of that distance; is the value in metres? the body would be pressed nearly flat, and its elements may \
         invert"
    );
    for row in [
        "[[0, 0, 0, 0], [1, 0, 0, -0.069]]",
        // Away from the table, and along it.
        "[[0, 0, 0, 0], [1, 0, 0, 0.073]]",
        "[[0, 0, 0, 0], [1, 0.073, 0, 0]]",
    ] {
        assert_eq!(pressed(row), "", "{row}");
    }
    // The same motion of a support of `palpate solve`.
    let lid = "[[body.support]]\nname = 'lid'\ngroup = 'top'\ndisplacement = [0, 0, -0.08]\n";
    let found = judged(&block(lid), &[]);
    let told = "displacement: found a motion of 0.0800 m towards supports that are 0.1000 m ahead";
    assert!(found.contains(told), "{found}");
}

#[test]
fn bodies_in_each_other_are_named_and_placed_ones_are_not() {
    let second = |position: &str, mesh: &str| {
        block(&format!(
            "[[body]]\nname = 'second'\nposition = {position}\n{mesh}\n\
             [[body.handle]]\nname = 'h'\ngroup = 'right'\ndevice = 'a'\n"
        ))
    };
    let solid = "mesh.box = { size = [0.1, 0.1, 0.1], cells = [2, 2, 2] }\n\
                 material = { young = 1e4, poisson = 0.4, density = 1000 }";
    let sheet = "mesh.sheet = { length = 0.1, width = 0.1, cells = [2, 2] }\n\
                 material = { young = 1e6, poisson = 0.4, thickness = 0.001, density = 1000 }";
    let warning = "x.toml:9: body[1]: found body \"second\" in the space of body \"block\": the boxes around the two \
                   bodies overlap, usual: bodies beside each other; no force acts between two bodies without a \
                   [[contact]], so the two pass through each other: set body[1].position";
    for (position, mesh, expected) in [
        ("[0, 0, 0]", solid, warning),
        ("[0.09, 0.09, 0.09]", solid, warning),
        ("[0.1, 0, 0]", solid, ""),
        ("[0, 0, 0.1]", solid, ""),
        ("[0, 0, 0]", sheet, warning),
        ("[0, 0, 0.05]", sheet, ""),
        ("[0, 0, 0.06]", sheet, ""),
    ] {
        assert_eq!(
            judged(&second(position, mesh), &[]),
            expected,
            "{position} {mesh}"
        );
    }
}

#[test]
fn a_run_that_missed_most_of_its_readings_has_failed() {
    // A hand that moves 1.9 m in a tenth of a second: no hand can, so the readings are not used.
    let text = BASE.replace(
        "task = \"tap\", direction = [0, 0, -1]",
        "grip = \"rigid\", waypoints = [[0, 0, 0, 0], [0.1, 1.9, 0, 0], [0.2, 0, 0, 0], [0.3, 1.9, 0, 0], [0.4, 0, 0, 0]]",
    );
    let files = BTreeMap::from([
        ("organ.obj".to_owned(), ORGAN.as_bytes().to_vec()),
        ("mine.toml".to_owned(), FILES[1].1.as_bytes().to_vec()),
    ]);
    let loaded = Scene::load_texts("x.toml", &text, &files).unwrap();
    let mut options = RunOptions::new(Clock::Virtual);
    options.duration = Some(0.4);
    let summary = run(&World::new(&loaded).unwrap(), &options, &mut |_| ()).unwrap();
    let missed = summary.devices[0].missed_reads;
    assert!(missed > 200, "{missed}");
    assert_eq!(
        summary.failures,
        [format!(
            "device \"hand\" gave no usable reading in {missed} of 400 ticks (1000 states a second, and its \
             profile says 1000): the device was silent, or moved as no hand can; \
             are the motions of its hand in metres?"
        )]
    );
    assert_eq!(summary.warnings.len(), 1, "{:?}", summary.warnings);
    assert!(
        summary
            .to_string()
            .contains("  FAILED     device \"hand\" gave no usable reading in ")
    );
}

#[test]
fn values_of_the_mesh_are_judged_as_those_of_the_scene() {
    let mesh = |young: &str| {
        format!(
            "# vtk DataFile Version 3.0\npatch\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0 0.08 0 0 \
             0.08 0.04 0 0 0.04 0\nCELLS 2 8\n3 0 1 2\n3 0 2 3\nCELL_TYPES 2\n5\n5\nCELL_DATA 2\nSCALARS stiffness \
             double 1\nLOOKUP_TABLE default\n{young}\n"
        )
    };
    let text = BASE.replace("organ.obj", "organ.vtk").replace(
        "young = 2e4",
        "young = 2e4, fields = { young = \"stiffness\" }",
    );
    let judged = |young: &str| judged(&text, &[("organ.vtk", &mesh(young))]);
    assert_eq!(judged("2e4 3e4"), "");
    assert_eq!(
        judged("20 2e4"),
        "x.toml:7: body[0].material.fields.young: found 20 Pa in element 0 of the mesh, usual: 1000 to 1e10 Pa; is the value in \
         kPa, MPa or N/m? rubber has 1e6 to 1e8 Pa, cloth 1e5 to 1e9 Pa"
    );
    assert_eq!(
        judged("2e4 1e20"),
        "error x.toml:7: body[0].material.fields.young: found 1e20 Pa in element 1 of the mesh, allowed: 0.001 to 1e13 \
         Pa; is the exponent right? rubber has 1e6 to 1e8 Pa, cloth 1e5 to 1e9 Pa, paper 3e9 Pa"
    );
}
