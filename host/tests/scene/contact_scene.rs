//! Obstacles and contacts of a scene: what is refused and with which words, and the world that a scene makes.

use host::run::prepare::{Options, Prepared};
use host::scene::Scene;
use host::solve::check_solved;
use host::world::World;
use host::world::contact::{ContactPair, Thing};
use nalgebra::Isometry3;
use physics::contact::obstacle::{Geometry, Motion};
use physics::contact::shape::Shape;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// A scene with contacts of each kind. Each case changes one piece of it.
const BASE: &str = r#"name = "base"

[[body]]
name = "cloth"
mesh.sheet = { length = 0.2, width = 0.2, cells = [8, 8] }
position = [0, 0, 0.06]
self_contact = true
material = { young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }

[[body]]
name = "block"
mesh.box = { size = [0.1, 0.1, 0.1], cells = [2, 2, 2] }
position = [0.5, 0, 0.1]
material = { young = 1e4, poisson = 0.3, density = 1000 }

[[body]]
name = "cord"
mesh.thread = { length = 0.1, segments = 4 }
position = [0, 0.5, 0.1]
contact_thickness = 0.004
material = { young = 1e6, area = 3e-6, density = 1000 }

[[obstacle]]
name = "ball"
shape = "sphere"
radius = 0.05
friction = 0.7

[[obstacle]]
name = "die"
mesh = { file = "die.obj", scale = 0.1 }
position = [0.5, 0.5, 0]

[[contact]]
between = ["block", "cloth"]
friction = 0.1
thickness = 0.002

[[contact]]
between = ["cloth", "cloth"]
friction = 0.2

[[device]]
name = "d"
model = "falcon"
hand = {}
"#;

/// A cube of side 1 about the origin, with outward normals, moved along x and taller by `by`.
fn die(by: f64) -> String {
    let mut text = String::new();
    for (x, y, z) in [
        (-0.5, -0.5, -0.5),
        (0.5, -0.5, -0.5),
        (0.5, 0.5, -0.5),
        (-0.5, 0.5, -0.5),
        (-0.5, -0.5, 0.5),
        (0.5, -0.5, 0.5),
        (0.5, 0.5, 0.5),
        (-0.5, 0.5, 0.5),
    ] {
        let z: f64 = z;
        let _ = writeln!(text, "v {} {y} {}", x + by, z * (1.0 + by));
    }
    for face in [
        "1 3 2", "1 4 3", "5 6 7", "5 7 8", "1 2 6", "1 6 5", "3 4 8", "3 8 7", "2 3 7", "2 7 6",
        "4 1 5", "4 5 8",
    ] {
        let _ = writeln!(text, "f {face}");
    }
    text
}

fn files(more: &[(&str, String)]) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::from([("die.obj".to_owned(), die(0.0).into_bytes())]);
    all.extend((more.iter()).map(|(name, text)| ((*name).to_owned(), text.clone().into_bytes())));
    all
}

/// The error of a scene whose piece is replaced.
fn said(piece: &str, instead: &str, more: &[(&str, String)]) -> String {
    assert_eq!(BASE.matches(piece).count(), 1, "{piece:?}");
    let text = BASE.replace(piece, instead);
    let loaded = match Scene::load_texts("x.toml", &text, &files(more)) {
        Ok(loaded) => loaded,
        Err(error) => return error.to_string(),
    };
    World::new(&loaded).map_or_else(|error| error.to_string(), |_| "no error".to_owned())
}

/// Cases of a piece, its replacement and the message. A message that ends in ` ...` is the beginning.
fn check(cases: &[(&str, &str, &str)]) {
    let mut wrong = Vec::new();
    for (piece, instead, expected) in cases {
        let found = said(piece, instead, &[]);
        let is_expected = match expected.strip_suffix(" ...") {
            Some(begin) => found.starts_with(begin),
            None => found == *expected,
        };
        if !is_expected {
            wrong.push(format!("{instead}\n  is  {found}\n  not {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn wrong_fields_are_refused_with_their_line() {
    check(&[
        ("name = \"base\"", "name = \"base\"", "no error"),
        (
            "radius = 0.05",
            "radius = -0.05",
            "x.toml:26: obstacle[0].radius: found -0.05, allowed: a number above 0",
        ),
        (
            "friction = 0.7",
            "friction = -0.7",
            "x.toml:27: obstacle[0].friction: found -0.7, allowed: a number not below 0",
        ),
        (
            "thickness = 0.002",
            "thickness = -0.002",
            "x.toml:37: contact[0].thickness: found -0.002, allowed: a number above 0",
        ),
        (
            "contact_thickness = 0.004",
            "contact_thickness = 0",
            "x.toml:20: body[2].contact_thickness: found 0, allowed: a number above 0",
        ),
        ("friction = 0.2", "friction = 30", "no error"),
        (
            "friction = 0.2",
            "friction = 300",
            "x.toml:41: contact[1].friction: found 300, allowed: up to 100; is the value in percent? a coefficient of \
             friction is mostly 0 to 1",
        ),
        (
            "shape = \"sphere\"",
            "shape = \"ball\"",
            "x.toml:25: obstacle[0].shape: found \"ball\", allowed: `plane`, `sphere`, `capsule`, `cylinder`, `box`",
        ),
        (
            "shape = \"sphere\"\n",
            "",
            "x.toml:23: obstacle[0]: found neither `shape` nor `mesh`, allowed: exactly one of the two",
        ),
        (
            "radius = 0.05\n",
            "",
            "x.toml:23: obstacle[0].radius: found none, allowed: a `radius`, which a sphere has",
        ),
        (
            "radius = 0.05",
            "radius = 0.05\nlength = 0.1",
            "x.toml:27: obstacle[0].length: found 0.1, allowed: no such field: a sphere has no length",
        ),
        (
            "name = \"die\"",
            "name = \"cloth\"",
            "x.toml:30: obstacle[1].name: found \"cloth\", allowed: another name than that of body[0]",
        ),
        (
            "scale = 0.1",
            "scale = 0.1, frame_rate = 10",
            "x.toml:31: obstacle[1].mesh.file: found \"die.obj\", allowed: the name of a file with `#` for each digit of the \
             number of a frame, such as \"run/hand_####.obj\"",
        ),
        (
            "position = [0.5, 0.5, 0]",
            "position = [0.5, 0.5, 0]\nposes = \"p.csv\"",
            "x.toml:32: obstacle[1].position: found `position` and `poses`, allowed: one of the two: `poses` has the whole \
             motion",
        ),
        (
            "between = [\"cloth\", \"cloth\"]\n",
            "",
            "x.toml:39: contact[1]: missing field `between`",
        ),
        (
            "[\"block\", \"cloth\"]",
            "[\"block\"]",
            "x.toml:35: contact[0].between: found [\"block\"], allowed: a list of 2, such as between = [\"cloth\", \"ball\"]",
        ),
        (
            "[\"block\", \"cloth\"]",
            "[\"block\", \"clot\"]",
            "x.toml:35: contact[0].between[1]: found \"clot\", allowed: \"cloth\", \"block\", \"cord\", \"ball\", \"die\"",
        ),
        (
            "[\"block\", \"cloth\"]",
            "[\"die\", \"ball\"]",
            "x.toml:35: contact[0].between: found [\"die\", \"ball\"], allowed: a body, or a tool and an obstacle: \
             obstacles do not touch each other, nor do tools",
        ),
        (
            "[\"block\", \"cloth\"]",
            "[\"block\", \"block\"]",
            "x.toml:35: contact[0].between: found [\"block\", \"block\"], allowed: two names, or a body with `self_contact = \
             true`",
        ),
        (
            "[\"block\", \"cloth\"]\nfriction = 0.1\nthickness = 0.002",
            "[\"ball\", \"cloth\"]\n[[contact]]\nbetween = [\"cloth\", \"ball\"]",
            "x.toml:37: contact[1].between: found [\"cloth\", \"ball\"], allowed: another pair than that of contact[0]",
        ),
        (
            "mesh = { file = \"die.obj\", scale = 0.1 }",
            "mesh = { file = \"dice.obj\" }",
            "x.toml:31: obstacle[1].mesh.file: cannot read dice.obj: ...",
        ),
    ]);
}

#[test]
fn faults_of_the_start_are_refused_with_their_place() {
    check(&[
        (
            "position = [0, 0, 0.06]",
            "position = [0, 0, 0.04]",
            "x.toml:23: obstacle[0]: found body \"cloth\" 0.01 m inside obstacle \"ball\" at [0, 0, 0.04], allowed: surfaces \
             that are apart at the start, best by 0.0005 m, the distance at which contact begins",
        ),
        (
            "position = [0, 0.5, 0.1]",
            "position = [0.001, 0.049, 0]",
            "x.toml:23: obstacle[0]: found body \"cord\" 0.001 m inside obstacle \"ball\" at [0, 0.049, 0] ...",
        ),
        (
            "position = [0.5, 0, 0.1]",
            "position = [0.07, 0, 0.1]",
            "x.toml:10: body[1]: found body \"block\" crosses body \"cloth\" at [ ...",
        ),
        (
            "position = [0.5, 0, 0.1]",
            "position = [0.47, 0.53, 0.08]",
            "x.toml:29: obstacle[1]: found obstacle \"die\" crosses body \"block\" at [ ...",
        ),
        (
            "position = [0, 0.5, 0.1]",
            "position = [0.51, 0.5, 0.011]",
            "x.toml:29: obstacle[1]: found obstacle \"die\" crosses body \"cord\" at [ ...",
        ),
        (
            "mesh.thread = { length = 0.1,",
            "mesh.thread = { length = 0.01,",
            "no error",
        ),
        (
            "mesh.thread = { length = 0.1, segments = 4 }\nposition = [0, 0.5, 0.1]",
            "mesh.thread = { length = 0.02, segments = 4 }\nposition = [0.5, 0.5, 0.01]",
            "x.toml:29: obstacle[1]: found body \"cord\" inside obstacle \"die\", at [0.49, 0.5, 0.01], allowed: surfaces that \
             are apart at the start, best by 0.002 m, the distance at which contact begins",
        ),
        (
            "radius = 0.05",
            "radius = 0.02\nposition = [0.5, 0, 0.1]",
            "x.toml:23: obstacle[0]: found obstacle \"ball\" inside body \"block\", at [0.5, 0, 0.1] ...",
        ),
        (
            "[0.1, 0.1, 0.1], cells",
            "[0.1, 0.1, 0.0015], cells",
            "x.toml:10: body[1]: found two places of body \"block\" that are 0.0015 m apart at [ ...",
        ),
        ("thickness = 0.001,", "thickness = 0.001, ", "no error"),
        (
            "self_contact = true",
            "self_contact = true\ncontact_thickness = 0.04",
            "x.toml:3: body[0]: found two places of body \"cloth\" that are 0.025 m apart at [ ...",
        ),
        (
            "position = [0.5, 0.5, 0]",
            "rotation = { axis = [1, 0, 0], degrees = 45 }\nposition = [0, 0, 0.1]",
            "x.toml:29: obstacle[1]: found obstacle \"die\" crosses body \"cloth\" at [ ...",
        ),
    ]);
}

#[test]
fn meshes_of_obstacles_are_closed_and_frames_have_one_topology() {
    let mesh = "mesh = { file = \"die.obj\", scale = 0.1 }";
    let with = |file: &str, text: String| {
        let instead = format!("mesh = {{ file = {file:?}, scale = 0.1 }}");
        said(mesh, &instead, &[(file, text)])
    };
    let open = die(0.0).replace("f 4 5 8\n", "");
    assert_eq!(
        with("a.obj", open),
        "x.toml:31: obstacle[1].mesh.file: found an open mesh: the edge from [-0.05, 0.05, -0.05] to [-0.05, -0.05, 0.05] \
         has one triangle, allowed: a closed mesh with its normals outwards"
    );
    let mirrored = die(0.0).replace("v -0.5", "v 1.5");
    let inverted = with("a.obj", mirrored);
    assert!(
        inverted.contains("found an inverted mesh: its normals point inwards"),
        "{inverted}"
    );
    let frames = |second: String, rate: u32| {
        let instead =
            format!("mesh = {{ file = \"run_##.obj\", scale = 0.1, frame_rate = {rate} }}");
        let more = [("run_01.obj", die(0.0)), ("run_02.obj", second)];
        said(mesh, &instead, &more)
    };
    assert_eq!(frames(die(0.1), 10), "no error");
    let other = die(0.0).replace("f 1 3 2\nf 1 4 3\n", "f 1 4 2\nf 2 4 3\n");
    assert_eq!(
        frames(other, 10),
        "x.toml:31: obstacle[1].mesh.file: found other triangles in run_02.obj than in run_01.obj, allowed: frames that have \
         the same triangles: only the vertices move"
    );
    let jump = frames(die(0.5), 600);
    assert!(
        jump.starts_with("x.toml:31: obstacle[1].mesh.file: found a jump: ")
            && jump.ends_with(" m/s to run_02.obj, allowed: up to 20 m/s: is `frame_rate` right?"),
        "{jump}"
    );
    assert!(frames("f 1".to_owned(), 10).contains("obstacle[1].mesh.file: cannot use run_02.obj"));
    let inverted = frames(die(0.0).replace("v -0.5", "v 1.5"), 1);
    assert!(
        inverted
            .contains("mesh.file: found run_02.obj: an inverted mesh: its normals point inwards")
            && inverted.ends_with("allowed: frames whose normals point outwards"),
        "{inverted}"
    );
}

#[test]
fn the_numbers_and_the_rate_of_frames_are_checked() {
    let mesh = "mesh = { file = \"die.obj\", scale = 0.1 }";
    for (file, rate, numbers, expected) in [
        ("run_##.obj", ", frame_rate = 10", &[0, 1][..], "no error"),
        (
            "run_##.obj",
            ", frame_rate = 10",
            &[0, 1, 3],
            "file: found run_03.obj, but no run_02.obj before it, allowed: frames that are numbered without a gap",
        ),
        (
            "run_##.obj",
            ", frame_rate = 10",
            &[5, 6],
            "file: found run_05.obj as the first frame, allowed: frames that begin with run_00.obj or run_01.obj",
        ),
        (
            "run_##_##.obj",
            ", frame_rate = 10",
            &[0],
            "file: found \"run_##_##.obj\", allowed: one group of `#`, which stands for the number of a frame",
        ),
        (
            "run_##.obj",
            ", frame_rate = 1e9",
            &[0, 1],
            "frame_rate: found 1000000000.0, allowed: up to 1000 Hz: the steps of the host would skip the frames of a faster \
             mesh",
        ),
        (
            "run_##.obj",
            "",
            &[0, 1],
            "frame_rate: found none, allowed: the rate (Hz) of the frames that \"run_##.obj\" stands for; without a rate, \
             this would be the name of one file, which does not exist",
        ),
    ] {
        let instead = format!("mesh = {{ file = {file:?}, scale = 0.1{rate} }}");
        let names: Vec<_> = (numbers.iter())
            .map(|number| format!("run_{number:02}.obj"))
            .collect();
        let more: Vec<_> = names.iter().map(|name| (name.as_str(), die(0.0))).collect();
        let found = said(mesh, &instead, &more);
        let found = found.trim_start_matches("x.toml:31: obstacle[1].mesh.");
        let found = found.trim_start_matches("x.toml:29: obstacle[1].mesh.");
        assert_eq!(found, expected, "{file}");
    }
}

#[test]
fn a_world_has_its_obstacles_and_pairs() {
    let poses = "time,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n2,0,0,-1,1,0,0,0\n";
    let text = BASE.replace("radius = 0.05", "radius = 0.05\nposes = \"p.csv\"");
    let loaded = Scene::load_texts("x.toml", &text, &files(&[("p.csv", poses.to_owned())]))
        .expect("a scene");
    // A log keeps the files.
    assert!(loaded.files.contains_key("p.csv") && loaded.files.contains_key("die.obj"));
    let world = World::new(&loaded).expect("a world");
    let [ball, die] = &world.obstacles[..] else {
        panic!("{:?}", world.obstacles);
    };
    assert_eq!(*ball.geometry(), Geometry::Shape(Shape::sphere(0.05)));
    assert_eq!(ball.pose(0.5), Isometry3::translation(0.0, 0.0, -0.25));
    assert!(matches!(die.motion(), Motion::Still(pose) if pose.translation.y == 0.5));
    let Geometry::Mesh(mesh) = die.geometry() else {
        panic!("a mesh");
    };
    assert!((mesh.volume() - 1e-3).abs() < 1e-15);

    // Half of 1 mm, of a thousandth of 0.1 m, and of 4 mm.
    let expected = [0.0005, 0.00005, 0.002];
    for (radius, expected) in world.contacts.radii.iter().zip(expected) {
        assert!((radius - expected).abs() < 1e-15, "{radius}");
    }
    let pair = |one: Thing, other: Thing| {
        let pair = world.contacts.pair(one, other);
        pair.map(|pair| (pair.friction, (pair.distance * 1e9).round()))
    };
    let [cloth, block, cord] = [0, 1, 2].map(Thing::Body);
    let [ball, die] = [0, 1].map(Thing::Obstacle);
    assert_eq!(pair(cloth, cloth), Some((0.2, 1e6)));
    assert_eq!(pair(block, cloth), Some((0.1, 2e6)));
    assert_eq!(pair(block, block), None);
    assert_eq!(pair(cord, cloth), None);
    assert_eq!(pair(ball, cloth), Some((0.7, 5e5)));
    assert_eq!(pair(cord, die), Some((0.3, 2e6)));
    assert_eq!(pair(block, die), Some((0.3, 5e4)));
    let ordered = |pairs: &[ContactPair]| pairs.is_sorted_by_key(|pair| pair.between);
    assert!(world.contacts.pairs.len() == 8 && ordered(&world.contacts.pairs));
}

#[test]
fn a_run_takes_a_scene_with_contact_and_solve_refuses_its_motion() {
    let loaded = Scene::load_texts("x.toml", BASE, &files(&[])).expect("a scene");
    let world = World::new(&loaded).expect("a world");
    Prepared::new(&world, &Options::of(&world)).expect("a run");
    assert!(check_solved(&loaded).is_ok());
    let text = format!("{BASE}\n[solve]\nanalysis = \"dynamic\"\nstep = 0.01\n");
    let moving = Scene::load_texts("x.toml", &text, &files(&[])).expect("a scene");
    let said = check_solved(&moving).expect_err("a motion").to_string();
    let expected = "solve.analysis: `palpate solve` solves contact in equilibrium";
    assert!(said.contains(expected), "{said}");
    assert!(
        World::new(&Scene::embedded_default().expect("a scene")).is_ok_and(|world| {
            world.contacts.is_empty()
                && world.contacts.radii.is_empty()
                && world.obstacles.is_empty()
        })
    );
}

#[test]
fn a_round_obstacle_that_fits_between_vertices_is_told() {
    // The longest edges: of the cloth 35 mm, of the block 71 mm, of the cord 25 mm.
    for (shape, told) in [
        ("shape = \"sphere\"\nradius = 0.01", &[][..]),
        (
            "shape = \"cylinder\"\nradius = 0.02\nlength = 0.06",
            &["block"],
        ),
        (
            "shape = \"cylinder\"\nradius = 0.01\nlength = 0.06",
            &["block", "cloth", "cord"],
        ),
        // Rounded hulls meet facets.
        ("shape = \"capsule\"\nradius = 0.01\nlength = 0.06", &[]),
        (
            "shape = \"cylinder\"\nradius = 0.04\nlength = 0.025",
            &["block", "cloth"],
        ),
        ("shape = \"box\"\nsize = [0.01, 0.01, 0.01]", &[]),
    ] {
        let text = BASE.replace("shape = \"sphere\"\nradius = 0.05", shape);
        let loaded = Scene::load_texts("base.toml", &text, &files(&[])).unwrap();
        let world = World::new(&loaded).unwrap();
        let narrow = world.warnings.iter().map(ToString::to_string);
        let narrow: Vec<_> = narrow.filter(|text| text.contains("vertices")).collect();
        for body in ["block", "cloth", "cord"] {
            let name = format!("body {body:?}");
            let found = narrow.iter().find(|text| text.contains(&name));
            assert_eq!(found.is_some(), told.contains(&body), "{shape} {narrow:?}");
            let names = |text: &String| text.contains("base.toml:23: obstacle[0]");
            assert!(found.is_none_or(names), "{found:?}");
        }
    }
}
