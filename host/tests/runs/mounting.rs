//! Mountings: a device stands anywhere in the scene, turned in any way. Positions pass in, and forces pass back.

use host::run::prepare::controls;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::Vec3;
use std::collections::BTreeMap;

/// A block on a table whose upper face is held by a device. The handle rests at (0, 0, 0.05).
fn load(device: &str) -> Result<LoadedScene, String> {
    let text = format!(
        "name = 'block'\nduration = 0.5\n[[body]]\nname = 'block'\ndamping = {{ stiffness = 0.02 }}\n\
         mesh.box = {{ size = [0.1, 0.06, 0.1], cells = [3, 2, 3] }}\n\
         material = {{ young = 1e4, poisson = 0.3, density = 1000 }}\n\
         [[body.support]]\nname = 'table'\ngroup = 'bottom'\n\
         [[body.handle]]\nname = 'plate'\ngroup = 'top'\ndevice = 'd'\n\
         [[device]]\nname = 'd'\nmodel = 'omega3'\n{device}\n"
    );
    Scene::load_texts("m.toml", &text, &BTreeMap::new()).map_err(|error| error.to_string())
}

/// A run in which the hand moves by `aim` (m, device axes) in 0.3 s.
fn moved(mounting: &str, aim: [f64; 3]) -> RunSummary {
    let [x, y, z] = aim;
    let device = format!(
        "{mounting}\nhand = {{ grip = 'firm', waypoints = [[0.05, 0, 0, 0], [0.3, {x}, {y}, {z}]] }}"
    );
    let mut loaded = load(&device).unwrap();
    loaded.scene.duration = 0.5;
    let summary = run(
        &World::new(&loaded).unwrap(),
        &RunOptions::new(Clock::Virtual),
        &mut |_| (),
    )
    .unwrap();
    assert!(summary.failures.is_empty(), "{:?}", summary.failures);
    summary
}

/// Two runs in which the body was moved alike. Encoders count along the axes of the device, so readings differ by counts
/// of 0.01 mm in motions of 10 mm.
fn assert_alike(a: &RunSummary, b: &RunSummary) {
    for (what, a, b) in [
        ("force", a.devices[0].peak_force, b.devices[0].peak_force),
        ("reach", a.devices[0].reach, b.devices[0].reach),
        ("work", a.energy[0].supplied, b.energy[0].supplied),
    ] {
        assert!((a - b).abs() < 0.01 * a.abs(), "{what}: {a} {b}");
    }
}

#[test]
fn a_turned_device_moves_the_handle_along_the_scene_and_feels_the_force_in_its_own_axes() {
    // A quarter of a turn about x brings the device's z to the scene's -y, and its y to the scene's z.
    let turned = "mounting = { rotation = { axis = [1, 0, 0], degrees = 90 } }";
    let plain = moved("", [0.003, 0.002, -0.01]);
    let alike = moved(turned, [0.003, -0.01, -0.002]);
    assert_alike(&plain, &alike);
    // The same motion of the device without the turn shears the block; with the turn it compressed the block.
    let other = moved("", [0.003, -0.01, -0.002]);
    let forces = [&plain, &other].map(|run| run.devices[0].peak_force);
    assert!(
        (forces[0] - forces[1]).abs() > 0.1 * forces[0],
        "{forces:?}"
    );
}

#[test]
fn a_device_with_an_origin_starts_where_its_handle_is() {
    // The handle lies 20 mm above the origin of the device, along the device's own x.
    let mounting = "motion_scale = 2\nmounting = { origin = [0, 0, 0.03], rotation = { axis = [0, 1, 0], degrees = -90 } }";
    let loaded = load(&format!("{mounting}\nhand = {{}}")).unwrap();
    assert_eq!(World::new(&loaded).unwrap().warnings, []);
    let mount = World::new(&loaded).unwrap().mounts[0];
    let expected = Vec3::new(0.01, 0.0, 0.0);
    assert!((mount.start - expected).norm() < 1e-15, "{}", mount.start);
    let (config, mut devices) = controls(&World::new(&loaded).unwrap(), 1).unwrap();
    let state = devices[0].read(0).unwrap();
    // The encoder counts 0.01 mm, and the wire rounds to millionths.
    assert!(
        (state.pose.position - expected).norm() < 1e-5,
        "{:?}",
        state.pose
    );
    let (proxy, _) = config.devices[0].frame.to_scene(&state);
    assert!((proxy.position - Vec3::new(0.0, 0.0, 0.05)).norm() < 2e-5);
    // Where the origin is does not matter to the motion.
    let turned = "motion_scale = 2\nmounting.rotation = { axis = [0, 1, 0], degrees = -90 }";
    let aim = [-0.004, 0.001, 0.0];
    assert_alike(&moved(turned, aim), &moved(mounting, aim));
}

#[test]
fn a_handle_outside_of_the_workspace_is_refused_or_warned_of() {
    let judged = |device: &str| {
        let loaded = match load(&format!("{device}\nhand = {{}}")) {
            Ok(loaded) => loaded,
            Err(error) => return format!("error {error}"),
        };
        let warnings = match World::new(&loaded) {
            Ok(world) => world.warnings,
            Err(error) => return format!("error {error}"),
        };
        warnings
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("\n")
    };
    let cases = [
        ("workspace = [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]]", ""),
        ("mounting.origin = [0, 0, 0.1]", ""),
        (
            "mounting.origin = [0, 0, 0.25]",
            "m.toml:18: device[0].mounting.origin: found 0.2 m from the handle at rest to the origin of the device, usual: \
             up to 0.075 m; set device.mounting.origin such that the handle lies in the workspace of its device, or omit \
             the field",
        ),
        (
            "mounting.origin = [0, 0, 0.25]\nworkspace = [[-0.1, -0.1, -0.3], [0.1, 0.1, 0.1]]",
            "",
        ),
        (
            "mounting.origin = [0, 0, 0.25]\nworkspace = [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]]",
            "error m.toml:19: device[0].workspace: found a box without the handle, which is at (0.0000, 0.0000, -0.2000) m \
             of the device at rest, allowed: a box around the handle: correct the box, or move the device by \
             mounting.origin",
        ),
        (
            "workspace = [[0.1, -0.1, -0.1], [-0.1, 0.1, 0.1]]",
            "error m.toml:18: device[0].workspace: found x from 0.1 to -0.1, allowed: the lowest corner first, then the \
             highest corner",
        ),
        (
            "mounting.rotation = { axis = [0, 0, 0], degrees = 90 }",
            "error m.toml:18: device[0].mounting.rotation.axis: found [0, 0, 0], allowed: a direction: any length but 0",
        ),
        (
            "mounting.place = [0, 0, 0]",
            "error m.toml:18: device[0].mounting.place: unknown field, allowed: `origin` or `rotation`",
        ),
        (
            "mounting.origin = [0, 0, 250]",
            "m.toml:18: device[0].mounting.origin: found 250 m, usual: up to 10 m; is the value in millimetres? positions are in \
             metres\n\
             m.toml:18: device[0].mounting.origin: found 249.95 m from the handle at rest to the origin of the device, \
             usual: up to 0.075 m; set device.mounting.origin such that the handle lies in the workspace of its device, \
             or omit the field",
        ),
    ];
    for (device, expected) in cases {
        assert_eq!(judged(device), expected, "{device}");
    }
}
