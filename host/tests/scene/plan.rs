//! The plan of a scene: which stages of a host step the scene needs, and why.

use host::engine::plan::{BodyPlan, ContactPlan, Stage, ToolPlan, stages};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use std::collections::BTreeMap;

const SHEET: &str = "mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
material = { young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }
";
const SOLID: &str = "mesh.box = { size = [0.2, 0.1, 0.1], cells = [2, 1, 1] }
material = { young = 1e6, poisson = 0.3, density = 1000 }
";
const THREAD: &str = "mesh.thread = { length = 0.2, segments = 4 }
material = { young = 1e6, area = 1e-6, density = 1000 }
";

/// A scene of one body that a device holds: `top` are the fields of the scene, `body` those of the body, `rest` the
/// tables after them.
fn scene(top: &str, body: &str, rest: &str) -> LoadedScene {
    let text = format!(
        "name = \"planned\"\n{top}\n[[body]]\nname = \"body\"\n{body}\n\
         [[body.handle]]\nname = \"grip\"\ngroup = \"left\"\ndevice = \"hand\"\n{rest}\n\
         [[device]]\nname = \"hand\"\nmodel = \"falcon\"\nhand = {{}}\n"
    );
    match Scene::load_texts("x.toml", &text, &BTreeMap::new()) {
        Ok(loaded) => loaded,
        Err(error) => panic!("{error} in\n{text}"),
    }
}

fn planned(loaded: &LoadedScene) -> Vec<Stage> {
    let world = World::new(loaded).expect("a world");
    stages(&loaded.scene, &[BodyPlan::new(&world, 0)])
}

/// The names of the stages that are needed.
fn needed(loaded: &LoadedScene) -> Vec<&'static str> {
    let planned = planned(loaded);
    let needed = planned.iter().filter(|stage| stage.needed);
    needed.map(|stage| stage.name).collect()
}

fn why(loaded: &LoadedScene, name: &str) -> String {
    let planned = planned(loaded);
    let stage = planned.iter().find(|stage| stage.name == name);
    stage.expect("a stage").why.clone()
}

#[test]
fn several_threads_are_named() {
    let solve = |host: &str| why(&scene("", SHEET, host), "solve");
    assert!(solve("[host]\nthreads = 3\n").starts_with("implicit Euler at 250 Hz on 3 threads, "));
    assert!(solve("").starts_with("implicit Euler at 250 Hz, "));
}

#[test]
fn a_scene_pays_for_what_it_names() {
    // A small sheet without weight, bending and damping.
    let (top, host) = ("gravity = [0, 0, 0]", "[host]\nsolver = \"frozen\"\n");
    let bare = format!("{SHEET}bending = 0\ndamping = {{ mass = 0, stiffness = 0 }}");
    let base = needed(&scene(top, &bare, host));
    assert_eq!(
        base,
        [
            "handles", "elements", "solve", "sleep", "condense", "publish"
        ]
    );
    let support = "[[body.support]]\nname = \"far\"\ngroup = \"right\"\n";
    let load = "[[body.load]]\nname = \"push\"\ngroup = \"right\"\nforce = [0, 0, 1]\n";
    let undamped = format!("{SHEET}damping = {{ mass = 0, stiffness = 0 }}\nbending = 1");
    let damped = format!("{SHEET}bending = 0\ndamping = {{ mass = 0.1, stiffness = 0 }}");
    for (added, loaded) in [
        ("supports", scene(top, &bare, &format!("{support}{host}"))),
        ("loads", scene(top, &bare, &format!("{load}{host}"))),
        ("gravity", scene("gravity = [0, 0, -9.81]", &bare, host)),
        ("bending", scene(top, &undamped, host)),
        ("damping", scene(top, &damped, host)),
    ] {
        let mut found = needed(&loaded);
        assert!(found.contains(&added), "{added}: {found:?}");
        found.retain(|name| *name != added);
        assert_eq!(found, base, "{added} and nothing more");
    }
}

#[test]
fn a_scheme_without_extrapolation_condenses_nothing() {
    let under = |scheme: &str| {
        let loaded = scene("", SHEET, &format!("[loop]\nscheme = \"{scheme}\"\n"));
        (
            needed(&loaded).contains(&"condense"),
            why(&loaded, "condense"),
        )
    };
    let (condensed, reason) = under("linear");
    assert!(
        condensed && reason.starts_with("scheme \"linear\""),
        "{reason}"
    );
    assert_eq!(
        under("hold"),
        (
            false,
            "the scheme renders no published stiffness".to_owned()
        )
    );
}

#[test]
fn the_reasons_name_the_kind_of_the_body() {
    for (body, elements, bending) in [
        (SOLID, "tetrahedra of 1 body", "no sheet"),
        (THREAD, "bars of 1 body", "no sheet"),
        (SHEET, "isotropic membranes of 1 body", "bending"),
    ] {
        let loaded = scene("", body, "");
        assert_eq!(
            why(&loaded, "elements"),
            format!("forces and tangent: {elements}")
        );
        assert!(why(&loaded, "bending").contains(bending));
    }
}

#[test]
fn the_pairs_that_may_touch_are_named() {
    let floor = "[[obstacle]]\nname = \"floor\"\nshape = \"plane\"\n";
    let loaded = scene("", &format!("position = [0, 0, 0.01]\n{SHEET}"), floor);
    assert!(why(&loaded, "collision").starts_with("1 pair may touch: "));
    let world = World::new(&loaded).expect("a world");
    let pairs: Vec<_> = ContactPlan::all(&world)
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(
        pairs,
        ["body with floor: friction 0.3, from a distance of 0.5 mm"]
    );
    assert!(!needed(&scene("", SHEET, "")).contains(&"collision"));
}

#[test]
fn a_tool_is_planned_with_its_reach_and_its_message() {
    let text = include_str!("../../scenes/touch.toml");
    let loaded = Scene::load_texts("touch.toml", text, &BTreeMap::new()).unwrap();
    let world = World::new(&loaded).unwrap();
    let [ball] = &ToolPlan::all(&world)[..] else {
        panic!("one tool");
    };
    // Twice the way in a period of 1/60 s and a latency of 4 ms, at 0.5 m/s at least.
    let time = 2.0 * (1.0 / 60.0 + 0.004);
    assert!((ball.reach - 0.5 * time).abs() < 1e-12 && ball.device == "omega");
    assert!((ball.reach_time - time).abs() < 1e-12);
    let line = ball.to_string();
    let start = "ball on omega: the surface within 20.7 mm, or its way in 41.3 ms if that is more";
    assert!(line.starts_with(start), "{line}");
    // 256 blocks of nine numbers are most of a patch.
    assert!(ball.bytes > 256 * 72 && ball.bytes < 24_000, "{line}");
}
