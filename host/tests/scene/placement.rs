//! Placement: the scale of a mesh file, and the position and the rotation of a body.

use host::scene::spec::Rotation;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use physics::Vec3;
use std::collections::BTreeMap;
use std::convert::Infallible;

/// A square of two triangles, 40 mm wide and 20 mm high, in millimetres.
const PATCH: &str = "v 0 0 0\nv 40 0 0\nv 40 20 0\nv 0 20 0\nf 1 2 3\nf 1 3 4\n";

fn load(body: &str) -> Result<LoadedScene, String> {
    let text = format!(
        "name = 'placed'\n[[body]]\nname = 'patch'\n\
         material = {{ young = 1e6, poisson = 0.3, thickness = 1e-3, density = 1000 }}\n{body}\n"
    );
    let files = BTreeMap::from([("patch.obj".to_owned(), PATCH.as_bytes().to_vec())]);
    Scene::load_texts("p.toml", &text, &files).map_err(|error| error.to_string())
}

/// The positions of the body as it is built (m).
fn positions(body: &str) -> Vec<Vec3> {
    let loaded = load(body).unwrap();
    let built = World::new(&loaded).unwrap().bodies.remove(0);
    assert!(
        built
            .body
            .positions()
            .eq(built.mesh.positions().iter().copied())
    );
    built.mesh.positions().to_vec()
}

#[test]
fn scale_rotation_and_position_act_in_this_order() {
    let scaled = "mesh = { file = 'patch.obj', scale = 0.001 }";
    assert_eq!(
        positions(scaled)[2],
        Vec3::new(40.0 * 0.001, 20.0 * 0.001, 0.0)
    );
    // A quarter of a turn about z brings x to y exactly; then the mesh moves.
    let placed = format!(
        "{scaled}\nposition = [0.5, 0, 0.25]\nrotation = {{ axis = [0, 0, 3], degrees = 90 }}"
    );
    assert_eq!(
        positions(&placed),
        [
            Vec3::new(0.5, 0.0, 0.25),
            Vec3::new(0.5, 40.0 * 0.001, 0.25),
            Vec3::new(0.5 - 20.0 * 0.001, 40.0 * 0.001, 0.25),
            Vec3::new(0.5 - 20.0 * 0.001, 0.0, 0.25),
        ]
    );
    // A third of a turn about the diagonal exchanges the axes.
    let turned = format!("{scaled}\nrotation = {{ axis = [1, 1, 1], degrees = -120 }}");
    let expected = Vec3::new(20.0 * 0.001, 0.0, 40.0 * 0.001);
    // A few rounding errors of numbers of 0.04.
    assert!((positions(&turned)[2] - expected).norm() < 1e-16);
}

#[test]
fn doubled_vertices_are_merged_within_a_distance_in_metres() {
    // The seam of a texture: both triangles have their own vertices, 0.02 mm apart at one end.
    let doubled =
        "v 0 0 0\nv 40 0 0\nv 40 20 0\nv 0 0 0\nv 40 20.02 0\nv 0 20 0\nf 1 2 3\nf 4 5 6\n";
    let load = |mesh: &str| {
        let text = format!(
            "name = 'merged'\n[[body]]\nname = 'patch'\n\
             material = {{ young = 1e6, poisson = 0.3, thickness = 1e-3, density = 1000 }}\n{mesh}\n"
        );
        let files = BTreeMap::from([("patch.obj".to_owned(), doubled.as_bytes().to_vec())]);
        let loaded = Scene::load_texts("p.toml", &text, &files).unwrap();
        let built = World::new(&loaded)
            .map_err(|error| error.to_string())?
            .bodies
            .remove(0);
        Ok::<_, String>(built.mesh.positions().to_vec())
    };
    let merged = load("mesh = { file = 'patch.obj', scale = 0.001, merge = 3e-5 }").unwrap();
    assert_eq!(
        merged,
        positions("mesh = { file = 'patch.obj', scale = 0.001 }")
    );
    // The distance counts after the scale: this one is a hundredth of it.
    let half = load("mesh = { file = 'patch.obj', scale = 0.001, merge = 3e-7 }").unwrap();
    assert_eq!(half.len(), 5);
    let error = load("mesh = { file = 'patch.obj', scale = 0.001 }").unwrap_err();
    assert!(
        error.ends_with(
            "line 4: vertices 0 and 3 lie at one place, where the mesh is not connected; merge the two vertices, as \
             mesh.merge of a scene does (a slit needs a gap)"
        ),
        "{error}"
    );
}

#[test]
fn a_turn_and_its_negative_cancel_and_full_turns_do_nothing() {
    for degrees in [0.0, 360.0, -720.0] {
        let turned = format!(
            "mesh = {{ file = 'patch.obj', scale = 0.01 }}\n\
             rotation = {{ axis = [0.3, -1, 2], degrees = {degrees} }}"
        );
        let start = positions("mesh = { file = 'patch.obj', scale = 0.01 }");
        assert_eq!(positions(&turned), start);
    }
    for degrees in [33.3, 90.0, 180.0, 270.0, 1234.5] {
        let rotation = |degrees| Rotation {
            axis: [0.3, -1.0, 2.0],
            degrees,
        };
        let product = rotation(degrees).matrix() * rotation(-degrees).matrix();
        let identity = physics::Mat3::identity();
        assert!((product - identity).norm() < 1e-15, "{degrees}: {product}");
        // The quaternion, which a device's mounting uses, is the same rotation.
        let turned = rotation(degrees).quaternion() * Vec3::new(1.0, 2.0, 3.0);
        let expected = rotation(degrees).matrix() * Vec3::new(1.0, 2.0, 3.0);
        assert!((turned - expected).norm() < 1e-14, "{degrees}");
    }
}

#[test]
fn boxes_are_in_the_world_and_groups_follow_the_body() {
    // A strip along x is turned to lie along y, and moved. Its right end, at x = 0.1, is then at y = 1.1.
    let body = "mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }\nposition = [0, 1, 0]\n\
        rotation = { axis = [0, 0, 1], degrees = 90 }\n\
        [[body.handle]]\nname = 'end'\ndevice = 'd'\n";
    let device = "\n[[device]]\nname = 'd'\nmodel = 'falcon'\nhand = {}";
    let held = |select: &str| {
        let loaded = load(&format!("{body}{select}{device}")).unwrap();
        let built = World::new(&loaded).unwrap().bodies.remove(0);
        built.handles[0].vertices.clone()
    };
    let by_box = held("box = [[-1, 1.0999, -1], [1, 1.1001, 1]]");
    assert_eq!(by_box.len(), 3);
    assert_eq!(by_box, held("group = 'right'"));
}

/// The largest displacement (m) of a sheet, held at its left end and pulled at its right end, in its own axes.
fn stretched(weave: &str, placement: &str, pull: &str) -> f64 {
    let text = format!(
        "name = 'pull'\ngravity = [0, 0, 0]\n[[body]]\nname = 'cloth'\n{placement}\n\
         mesh.sheet = {{ length = 0.2, width = 0.1, cells = [8, 4], pattern = 'alternating' }}\n\
         [body.material]\nyoung = 2e6\npoisson = 0.2\nthickness = 1e-3\ndensity = 300\n{weave}\n\
         [[body.support]]\nname = 'wall'\ngroup = 'left'\n\
         [[body.load]]\nname = 'pull'\ngroup = 'right'\nforce = {pull}\n"
    );
    let loaded = Scene::load_texts("p.toml", &text, &BTreeMap::new()).unwrap();
    let solution = host::solve::solve(
        &World::new(&loaded).unwrap(),
        false,
        &mut |_| {},
        &mut |_| Ok::<(), Infallible>(()),
    )
    .unwrap();
    assert!(solution.failures.is_empty(), "{:?}", solution.failures);
    solution.bodies[0].displacement.value
}

#[test]
fn a_placed_body_behaves_as_the_same_body_at_the_origin() {
    let weave = "weave = { warp = [1, 0, 0], young_weft = 0.2e6, shear = 0.1e6 }";
    for weave in ["", weave] {
        let here = stretched(weave, "", "[1, 0, 0]");
        let there = stretched(
            weave,
            "position = [0.3, -0.2, 0.1]\nrotation = { axis = [0, 1, 0], degrees = -90 }",
            "[0, 0, 1]",
        );
        // The solver stops at a residual of 1e-8 of the forces.
        assert!((here - there).abs() < 1e-6 * here, "{here} {there}");
    }
    // The warp turns with the body: in the world's axes the turned cloth would be pulled along its weft.
    let along_weft = stretched(
        "weave = { warp = [0, 1, 0], young_weft = 0.2e6, shear = 0.1e6 }",
        "",
        "[1, 0, 0]",
    );
    assert!(along_weft > 5.0 * stretched(weave, "", "[1, 0, 0]"));
}

#[test]
fn a_placement_without_a_meaning_is_refused() {
    let cases = [
        (
            "mesh.file = 'patch.obj'\nrotation = { axis = [0, 0, 0], degrees = 9 }",
            "p.toml:6: body[0].rotation.axis: found [0, 0, 0], allowed: a direction: any length but 0",
        ),
        (
            "mesh.file = 'patch.obj'\nrotation = [0, 0, 90]",
            "p.toml:6: body[0].rotation: found [0, 0, 90], allowed: a table, such as rotation = { axis = [0, 0, 1], degrees = 90 }",
        ),
        (
            "mesh.file = 'patch.obj'\nrotation = { axis = [0, 0, 1] }",
            "p.toml:6: body[0].rotation: missing field `degrees`",
        ),
        (
            "mesh.file = 'patch.obj'\nrotation = { axis = [0, 0, 1], radians = 1 }",
            "p.toml:6: body[0].rotation.radians: unknown field, allowed: `axis` or `degrees`",
        ),
        (
            "mesh = { file = 'patch.obj', scale = 0 }",
            "p.toml:5: body[0].mesh.scale: found 0, allowed: a number above 0",
        ),
        (
            "mesh = { sheet = { length = 1, width = 1, cells = [1, 1] }, scale = 0.1 }",
            "p.toml:5: body[0].mesh.scale: found a scale for a mesh that is built in, allowed: `file`: the \
             lengths of a built-in mesh are in metres",
        ),
        (
            "mesh = { file = 'patch.obj', merge = -1 }",
            "p.toml:5: body[0].mesh.merge: found -1, allowed: a number above 0",
        ),
        (
            "mesh = { sheet = { length = 1, width = 1, cells = [1, 1] }, merge = 0.1 }",
            "p.toml:5: body[0].mesh.merge: found a distance for a mesh that is built in, allowed: `file`: a built-in \
             mesh has no doubled vertices",
        ),
        (
            "mesh.file = 'patch.obj'\nposition = [0, 0]",
            "p.toml:6: body[0].position: found [0, 0], allowed: a list of 3, such as position = [0, 0, 0.1]",
        ),
    ];
    for (body, expected) in cases {
        assert_eq!(load(body).expect_err(body), expected);
    }
}
