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
    assert!(line.ends_with("N/m; it keeps its attitude"), "{line}");
    // 256 blocks of nine numbers are most of a patch.
    assert!(ball.bytes > 256 * 72 && ball.bytes < 24_000, "{line}");
}

#[test]
fn a_plan_says_by_which_spring_a_device_turns_its_tool() {
    let text = include_str!("../../scenes/plate.toml");
    let loaded = Scene::load_texts("plate.toml", text, &BTreeMap::new()).unwrap();
    let world = World::new(&loaded).unwrap();
    let [plate] = &ToolPlan::all(&world)[..] else {
        panic!("one tool");
    };
    let turning = plate.turning.unwrap();
    assert!(turning > 0.0 && turning <= 30.0, "{turning}");
    let said = plate.to_string();
    let end = said.split("N/m, and ").nth(1).unwrap();
    let spring: f64 = end.split(' ').next().unwrap().parse().unwrap();
    // Three digits are printed.
    assert!((spring / turning - 1.0).abs() < 5e-3, "{said} {turning}");
    assert!(end.ends_with("N m/rad as the device turns it"), "{said}");
}

/// The warnings of two balls at rest, of which the hand of the second one leads it by this way (m) within 0.1 s, at this publication rate (Hz).
fn warnings(way: f64, rate: f64) -> Vec<String> {
    let text = include_str!("../../scenes/touch.toml");
    let text = text.replace("publish_rate = 60.0", &format!("publish_rate = {rate:?}"));
    let text = text.replace(
        "step_rate = 120.0",
        &format!("step_rate = {:?}", 2.0 * rate),
    );
    let (head, ball) = text.split_at(text.find("[[tool]]").unwrap());
    let other = ball.split_at(ball.find("waypoints").unwrap()).0;
    let other = other
        .replace("\"ball\"", "\"other\"")
        .replace("\"omega\"", "\"second\"")
        .replace("[0.0, 0.0, 0.045]", "[-0.03, 0.0, 0.045]");
    let text = format!("{head}{ball}\n{other}waypoints = [[0.5, 0, 0, 0], [0.6, {way:?}, 0, 0]]\n");
    let loaded = Scene::load_texts("two.toml", &text, &BTreeMap::new()).unwrap();
    let world = World::new(&loaded).unwrap();
    let warnings = world.warnings.iter().map(ToString::to_string);
    warnings
        .filter(|warning| warning.contains("next patch"))
        .collect()
}

/// The largest way of a reach of `length` (m) in 0.1 s until the next patch, over how far a patch of that moment has the surface.
fn farthest(length: f64, horizon: f64) -> f64 {
    let place = |time: f64| {
        let part = (time / 0.1).clamp(0.0, 1.0);
        length * part.powi(3) * (10.0 - 15.0 * part + 6.0 * part * part)
    };
    let ratios = (0..1000).map(|number| {
        let from = 1e-4 * f64::from(number);
        let speed = (place(from + 1e-7) - place(from)) / 1e-7;
        (place(from + horizon) - place(from)) / (2.0 * horizon * speed.max(0.5))
    });
    ratios.fold(0.0, f64::max)
}

/// The number after a text.
fn number_after(text: &str, before: &str) -> f64 {
    let rest = text.split(before).nth(1).unwrap();
    rest.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn a_plan_warns_of_a_hand_that_leaves_the_surface_near_its_tool() {
    let [warning] = &warnings(0.12, 60.0)[..] else {
        panic!("{:?}", warnings(0.12, 60.0));
    };
    assert!(warning.starts_with("two.toml:"), "{warning}");
    let found = "device[1].hand: found a hand that moves the tool \"other\" by ";
    let found = number_after(warning, found) / number_after(warning, "usual: up to ");
    let expected = farthest(0.12, 1.0 / 60.0 + 0.004);
    // The path is looked at every 0.65 ms, within which the speed of 0.5 m/s changes by a twentieth.
    assert!(
        expected > 1.1 && (found / expected - 1.0).abs() < 0.03,
        "{warning} {expected}"
    );
    assert!(
        warning.contains("raise `host.publish_rate`, lower `host.latency`"),
        "{warning}"
    );
    // Slower hands, and hosts that tell more often.
    assert!(farthest(0.03, 1.0 / 60.0 + 0.004) < 0.9 && farthest(0.12, 0.008) < 0.9);
    assert_eq!(warnings(0.03, 60.0).len(), 0);
    assert_eq!(warnings(0.12, 250.0).len(), 0);
}

#[test]
fn a_plan_warns_of_a_hand_that_turns_a_long_tool_too_fast() {
    let text = include_str!("../../scenes/plate.toml").replace("length = 0.03", "length = 0.2");
    let (head, _) = text.split_at(text.find("turns = [").unwrap());
    // The hand rests while it turns, so that the corner of the plate goes by `way` (m).
    let warned = |way: f64| {
        let lever = 0.5 * (0.2_f64 - 0.008).hypot(0.02 - 0.008);
        let turns = format!("turns = [[2.0, 0, 0, 0], [2.1, 0, 0, {:?}]]\n", way / lever);
        let files = BTreeMap::new();
        let loaded = Scene::load_texts("plate.toml", &format!("{head}{turns}"), &files).unwrap();
        let world = World::new(&loaded).unwrap();
        let mut warnings = world.warnings.iter().map(ToString::to_string);
        warnings.find(|warning| warning.contains("next patch"))
    };
    let warning = warned(0.12).unwrap();
    let found = number_after(&warning, "moves the tool \"plate\" by ");
    let found = found / number_after(&warning, "usual: up to ");
    let expected = farthest(0.12, 1.0 / 60.0 + 0.004);
    assert!(
        (found / expected - 1.0).abs() < 0.03,
        "{warning} {expected}"
    );
    assert_eq!(warned(0.03), None);
}
