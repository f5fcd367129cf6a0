//! Wrong scenes: the exact error line for each kind of mistake. If another case of the same kind is above, a case says
//! the place and the finding alone, and ends in ` ...`.

use host::scene::Scene;

/// A small valid scene. Each case changes one piece of it.
const BASE: &str = r#"name = "base"
duration = 1.0
gravity = [0, 0, -9.81]

[loop]
rate = 1000

[host]
step_rate = 250.0
publish_rate = 125.0

[[body]]
name = "sheet"
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }

[body.material]
young = 1e6
poisson = 0.3
thickness = 0.001
density = 1000

[[body.region]]
box = [[0, 0, 0], [1, 1, 1]]
young = 2e6

[[body.handle]]
name = "a"
group = "left"
device = "left"

[[body.handle]]
name = "b"
group = "right"
device = "right"

[[device]]
name = "left"
model = "falcon"
hand = {}

[[device]]
name = "right"
model = "touch"

[device.hand]
waypoints = [
    [0.5, 0, 0, 0],
    [1.5, 0.01, 0, 0],
]
sines = [{ amplitude = [0.001, 0, 0], frequency = 2 }]
"#;

fn error(text: &str) -> String {
    match Scene::parse(text, "x.toml") {
        Ok(_) => "no error".to_owned(),
        Err(error) => error.to_string(),
    }
}

/// Checks cases of three lines: a piece of the base, its replacement, the resulting error. `¶` is the end of a line of
/// the scene.
fn check(cases: &str) {
    let lines: Vec<String> = cases
        .trim()
        .lines()
        .map(|line| line.replace('¶', "\n"))
        .collect();
    let mut wrong = Vec::new();
    for case in lines.chunks(3) {
        let [piece, instead, expected] = case else {
            panic!("{case:?} is no case");
        };
        let instead = instead.trim_start_matches("  ->").trim_start_matches(' ');
        let expected = expected.trim();
        let places = BASE.matches(piece).count();
        assert_eq!(places, 1, "{piece:?} is not one place of the base");
        let found = error(&BASE.replace(piece, instead));
        let is_expected = match expected.strip_suffix(" ...") {
            Some(begin) => found.starts_with(&format!("{begin}, allowed: ")),
            None => found == expected,
        };
        if !is_expected {
            wrong.push(format!(
                "{piece:?} -> {instead:?}\n  is  {found}\n  not {expected}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn deep_nesting_is_refused() {
    let found = error(&format!("{}a = {}", BASE, "[".repeat(100_000)));
    assert!(found.starts_with("x.toml:51: not valid TOML: "), "{found}");
}

#[test]
fn the_base_scene_is_valid() {
    assert_eq!(error(BASE), "no error");
}

#[test]
fn values_out_of_range_are_refused() {
    check(
        r"
young = 1e6
  -> young = -5
  x.toml:17: body[0].material.young: found -5, allowed: a number above 0
young = 2e6
  -> young = 0
  x.toml:24: body[0].region[0].young: found 0 ...
young = 1e6
  -> young = inf
  x.toml:17: body[0].material.young: found inf ...
poisson = 0.3
  -> poisson = 0.5
  x.toml:18: body[0].material.poisson: found 0.5, allowed: a number above -1 and below 0.5
duration = 1.0
  -> duration = nan
  x.toml:2: duration: found nan, allowed: a number above 0 and up to 86400 (s)
duration = 1.0
  -> duration = 1e9
  x.toml:2: duration: found 1e9 ...
-9.81]
  -> -inf]
  x.toml:3: gravity[2]: found -inf, allowed: a finite number
rate = 1000
  -> rate = 20e3
  x.toml:6: loop.rate: found 20e3, allowed: a number from 100 to 10000 (Hz)
step_rate = 250.0
  -> step_rate = 0
  x.toml:9: host.step_rate: found 0, allowed: a number from 0.1 to 1000 (Hz)
[host]
  -> [host]¶latency = 2
  x.toml:9: host.latency: found 2, allowed: a number from 0 to 1 (s)
[host]
  -> [host]¶max_iterations = 0
  x.toml:9: host.max_iterations: found 0, allowed: a whole number from 1 to 100000
[host]
  -> [host]¶threads = 65
  x.toml:9: host.threads: found 65, allowed: a whole number from 1 to 64
[host]
  -> [host]¶tolerance = 1.0
  x.toml:9: host.tolerance: found 1.0, allowed: a number between 0 and 1
[loop]
  -> [loop]¶blend = 1.5
  x.toml:6: loop.blend: found 1.5, allowed: a number from 0 to 1
[loop]
  -> [loop]¶proxy_stiffness = 0
  x.toml:6: loop.proxy_stiffness: found 0 ...
[loop]
  -> [loop]¶proxy_damping = -1
  x.toml:6: loop.proxy_damping: found -1, allowed: a number not below 0
[loop]
  -> [loop]¶hold_damping = -1
  x.toml:6: loop.hold_damping: found -1 ...
cells = [4, 2]
  -> cells = [4, -2]
  x.toml:14: body[0].mesh.sheet.cells[1]: found -2, allowed: a whole number from 1 to 10000
hand = {}
  -> max_force = 0¶hand = {}
  x.toml:39: device[0].max_force: found 0 ...
frequency = 2
  -> frequency = 8
  x.toml:50: device[1].hand.sines[0].frequency: found 8, allowed: a number above 0 and up to 5 (Hz)
frequency = 2
  -> frequency = 2, phase = nan
  x.toml:50: device[1].hand.sines[0].phase: found nan ...
[1.5, 0.01, 0, 0]
  -> [1.5, nan, 0, 0]
  x.toml:48: device[1].hand.waypoints[1][1]: found nan ...
[1, 1, 1]]
  -> [1, inf, 1]]
  x.toml:23: body[0].region[0].box[1][1]: found inf ...
hand = {}
  -> hand.mass = 1e999
  x.toml:39: device[0].hand.mass: found 1e999, allowed: a number below 1.8e308
hand = {}
  -> hand.mass = -99999999999999999999
  x.toml:39: device[0].hand.mass: found -99999999999999999999 ...
",
    );
}

#[test]
fn values_of_another_type_are_refused() {
    check(
        r#"
young = 1e6
  -> young = "soft"
  x.toml:17: body[0].material.young: found "soft" ...
young = 1e6
  -> young = "a, expected b"
  x.toml:17: body[0].material.young: found "a, expected b" ...
young = 1e6
  -> young = { a = 1 }
  x.toml:17: body[0].material.young: found { a = 1 } ...
name = "base"
  -> name = 3
  x.toml:1: name: found 3, allowed: a string
duration = 1.0
  -> duration = 1¶seed = -1
  x.toml:3: seed: found -1, allowed: a whole number, 0 or above
-9.81]
  -> -9.81, 1]
  x.toml:3: gravity: found [0, 0, -9.81, 1], allowed: a list of 3, such as gravity = [0, 0, -9.81]
[1, 1, 1]]
  -> [1, 1]]
  x.toml:23: body[0].region[0].box[1]: found [1, 1], allowed: a list of 3, such as box = [[0, 0, 0], [0.1, 0.1, 0.1]], the lowest and the highest corner
[0.5, 0, 0, 0]
  -> [0.5, 0, 0]
  x.toml:47: device[1].hand.waypoints[0]: found [0.5, 0, 0], allowed: a list of 4, such as waypoints = [[0, 0, 0, 0], [1, 0, 0, -0.02]], rows of time, x, y, z
model = "touch"
  -> model = 3
  x.toml:43: device[1].model: found 3, allowed: `falcon`, `touch`, `phantom_premium`, `omega3`, `delta3`, `virtuose6d`, `hapkit`, `pantograph`, `woodenhaptics`, or the name of a device's file, which ends in .toml
model = "touch"
  -> model = "tuch"
  x.toml:43: device[1].model: found "tuch", allowed: `falcon`, `touch`, `phantom_premium`, `omega3`, `delta3`, `virtuose6d`, `hapkit`, `pantograph`, `woodenhaptics`, or the name of a device's file, which ends in .toml; did you mean `touch`?
[loop]
  -> [loop]¶scheme = "Hold"
  x.toml:6: loop.scheme: found "Hold", allowed: `hold`, `thesis`, `linear`, `proxy`, `classic`, `capped`; did you mean `hold`?
hand = {}
  -> hand = {}¶wire = 1
  x.toml:40: device[0].wire: found 1, allowed: true or false
hand = {}
  -> hand = [1]
  x.toml:39: device[0].hand: found [1], allowed: a table, such as hand = { grip = "typical" }
hand = {}
  -> hand.turns = [[0, 0, 0, 0], [1, 0, 4, 0]]
  x.toml:39: device[0].hand.turns[1]: found an angle of 4.00 rad, allowed: half a turn from the start at most; angles are in rad
hand = {}
  -> hand.turns = [[0, 0, 0, 0], [1, 0, 1, 0], [1, 0, 0, 0]]
  x.toml:39: device[0].hand.turns[2]: found time 1.0, allowed: a time after 1.0
hand = {}
  -> hand.traces = [{ from = 1, to = 0.5, direction = [0, 0, -1], heading = [1, 0, 0], force = 1, speed = 0.02 }]
  x.toml:39: device[0].hand.traces[0].to: found 0.5, allowed: a time after 1.0
hand = {}
  -> hand.traces = [{ from = 0, to = 1, direction = [0, 0, -1], heading = [0, 0, 0], force = 1, speed = 0.02 }]
  x.toml:39: device[0].hand.traces[0].heading: found [0.0, 0.0, 0.0], allowed: a vector that is not zero
hand = {}
  -> hand.traces = [{ from = 0, to = 1, direction = [0, 0, -1], heading = [1, 0, 0], force = -1, speed = 0.02 }]
  x.toml:39: device[0].hand.traces[0].force: found -1, allowed: a number above 0
hand = {}
  -> hand = { stiffness = 0, traces = [{ from = 0, to = 1, direction = [0, 0, -1], heading = [1, 0, 0], force = 1, speed = 0.02 }] }
  x.toml:39: device[0].hand.traces[0]: found an arm without stiffness, allowed: a `stiffness` above 0 of the hand: its spring presses the surface
hand = {}
  -> hand.waypoints = 1
  x.toml:39: device[0].hand.waypoints: found 1, allowed: a list, such as waypoints = [[0, 0, 0, 0], [1, 0, 0, -0.02]], rows of time, x, y, z
sines = [{
  -> sines = [[1], {
  x.toml:50: device[1].hand.sines[0]: found [1], allowed: a table
[loop]
  -> loop = 3¶[lop]
  x.toml:5: loop: found 3 ...
[[body]]
  -> [body]
  x.toml:12: body: found [body], allowed: a list of tables, each [[...]] or {...}, such as [[body]]
"#,
    );
}

#[test]
fn invalid_mesh_sources_are_refused() {
    check(
        r#"
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh = 3
  x.toml:14: body[0].mesh: found 3, allowed: a table, such as mesh.file = "liver.msh"
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh = {}
  x.toml:14: body[0].mesh: found {}, allowed: a table with exactly one of `sheet`, `box`, `plate`, `thread` and `file`, such as mesh.file = "liver.msh"
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh = "file"
  x.toml:14: body[0].mesh: found "file" ...
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.file = 3
  x.toml:14: body[0].mesh.file: found 3 ...
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.file = ''
  x.toml:14: body[0].mesh.file: found "", allowed: the name of a file
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.cube = 3
  x.toml:14: body[0].mesh.cube: unknown field, allowed: `sheet`, `box`, `plate`, `thread`, `file`, `scale`, `merge`, `order`, `flat_pattern`
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.sheet = 3
  x.toml:14: body[0].mesh.sheet: found 3 ...
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.sheet = [0.2, 0.1, [4, 2]]
  x.toml:14: body[0].mesh.sheet: found [0.2, 0.1, [4, 2]] ...
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.sheet = { length = 0.2, width = 0.1 }
  x.toml:14: body[0].mesh.sheet: missing field `cells`
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.sheet = { length = 0.2, depth = 0.1 }
  x.toml:14: body[0].mesh.sheet.depth: unknown field, allowed: `length`, `width`, `cells`, `pattern`
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2], pattern = "crossed" }
  x.toml:14: body[0].mesh.sheet.pattern: found "crossed", allowed: `regular` or `alternating`
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.plate = { width = 0.2, height = 0.1, radius = 0, cells = [4, 2] }
  x.toml:14: body[0].mesh.plate.radius: found 0 ...
mesh.sheet = { length = 0.2, width = 0.1, cells = [4, 2] }
  -> mesh.plate = { width = 0.2, height = 0.1, radius = 0.01, cells = [4000, 2000] }
  x.toml:14: body[0].mesh.plate.cells: found 4000 x 2000 = 8000000, allowed: up to 1000000 cells in all
cells = [4, 2] }
  -> cells = [4, 2] }¶mesh.file = 'x'
  x.toml:14: body[0].mesh: found mesh ...
cells = [4, 2]
  -> cells = [4000, 2000]
  x.toml:14: body[0].mesh.sheet.cells: found 4000 x 2000 = 8000000 ...
"#,
    );
}

#[test]
fn unknown_and_missing_fields_are_named() {
    check(
        r#"
step_rate = 250.0
  -> step_rate = 250.0¶solver = "fast"
  x.toml:10: host.solver: found "fast", allowed: `auto`, `frozen`, `incomplete`
step_rate = 250.0
  -> step_rate = 250.0¶budget = 0
  x.toml:10: host.budget: found 0 ...
young = 1e6
  ->
  x.toml:16: body[0].material: missing field `young`
young = 1e6
  -> yong = 1e6
  x.toml:17: body[0].material.yong: unknown field, allowed: `law`, `young`, `poisson`, `thickness`, `area`, `tension_only`, `density`, `weave`, `fields`; did you mean `young`?
young = 1e6
  -> "yo\nung" = 1
  x.toml:17: body[0].material.yo...: unknown field ...
name = "base"
  ->
  x.toml:1: missing field `name`
[loop]
  -> [lop]
  x.toml:5: lop: unknown field, allowed: `name`, `description`, `duration`, `seed`, `loop`, `host`, `solve`, `machine`, `gravity`, `body`, `obstacle`, `tool`, `contact`, `device`; did you mean `loop`?
[body.material]
  -> [body.metal]
  x.toml:16: body[0].metal: unknown field, allowed: `name`, `mesh`, `position`, `rotation`, `material`, `region`, `damping`, `bending`, `handle`, `support`, `load`, `contact_thickness`, `self_contact`, `tear`
hand = {}
  ->
  x.toml:36: device[0].hand: found none, allowed: the hand that holds this simulated device (`hand = {}` suffices)
hand = {}
  -> hand.weight = 2
  x.toml:39: device[0].hand.weight: unknown field, allowed: `grip`, `mass`, `stiffness`, `damping`, `tremor`, `task`, `direction`, `depth`, `speed`, `pause`, `width`, `frequency`, `variation`, `waypoints`, `turns`, `sines`, `presses`, `traces`, `recording`
"#,
    );
}

#[test]
fn text_that_is_not_toml_is_refused_with_its_line() {
    check(
        r#"
name = "base"
  -> name = "base
  x.toml:1: not valid TOML: invalid basic string, expected `"`; found name = "base
[host]
  -> [host
  x.toml:8: not valid TOML: unclosed table, expected `]`; found [host
[host]
  -> [loop]
  x.toml:8: not valid TOML: duplicate key; found [loop]
young = 1e6
  -> young
  x.toml:17: not valid TOML: key with no value, expected `=`; found young
young = 1e6
  -> young = 1e6¶young = 2
  x.toml:18: not valid TOML: duplicate key; found young = 2
young = 1e6
  -> young = 1,5
  x.toml:17: not valid TOML: unexpected key or value, expected newline, `#`; found young = 1,5
[[device]]¶name = "left"
  -> [device]¶name = "left"
  x.toml:41: not valid TOML: duplicate key; found [[device]]
"#,
    );
}

#[test]
fn fields_that_contradict_each_other_are_refused() {
    check(
        r#"
publish_rate = 125.0
  -> publish_rate = 60.0
  x.toml:10: host.publish_rate: found 60.0, allowed: host.step_rate, 250.0, divided by a whole number
publish_rate = 125.0
  -> publish_rate = 500.0
  x.toml:10: host.publish_rate: found 500.0 ...
step_rate = 250.0
  -> step_rate = 60.0
  x.toml:10: host.publish_rate: found 125.0, allowed: host.step_rate, 60.0, divided by a whole number
rate = 1000
  -> rate = 200
  x.toml:9: host.step_rate: found 250.0, allowed: at most loop.rate, 200.0
name = "base"
  -> name = " "
  x.toml:1: name: found " ", allowed: a name of 1 to 64 characters
name = "right"
  -> name = "left"
  x.toml:42: device[1].name: found "left", allowed: another name than that of device[0]
name = "b"
  -> name = "a"
  x.toml:32: body[0].handle[1].name: found "a", allowed: another name than that of body[0].handle[0]
name = "b"
  -> name = "b\u0007"
  x.toml:32: body[0].handle[1].name: found "b\u{7}" ...
device = "right"
  -> device = "left"¶border = "clamped"
  x.toml:35: body[0].handle[1].border: found another border than that of body[0].handle[0], allowed: the same border: the device "left" holds both, as one rigid handle
device = "right"
  -> device = "rihgt"
  x.toml:34: body[0].handle[1].device: found "rihgt", allowed: "left", "right"
group = "right"
  ->
  x.toml:31: body[0].handle[1]: found neither `group` nor `box`, allowed: exactly one of the two
group = "right"
  -> group = ""
  x.toml:33: body[0].handle[1].group: found "" ...
group = "right"
  -> group = "right"¶box = [[0,0,0],[1,1,1]]
  x.toml:31: body[0].handle[1]: found both `group` and `box` ...
device = "right"
  -> device = "right"¶border = "welded"
  x.toml:35: body[0].handle[1].border: found "welded", allowed: `hinged` or `clamped`
device = "right"
  -> device = "right"¶[[body.support]]¶name = "s"¶group = "top"¶axes = ["z"]¶border = "clamped"
  x.toml:38: body[0].support[0].axes: found some axes, and a clamped border, allowed: all axes for a support that clamps the border
box = [[0, 0, 0], [1, 1, 1]]
  ->
  x.toml:22: body[0].region[0]: found neither `group` nor `box` ...
[1, 1, 1]]
  -> [1, -1, 1]]
  x.toml:23: body[0].region[0].box: found y from 0.0 to -1.0, allowed: the lowest corner first, then the highest corner
[1.5, 0.01
  -> [0.5, 0.01
  x.toml:48: device[1].hand.waypoints[1]: found time 0.5, allowed: a time after 0.5
[0.5, 0, 0, 0]
  -> [-0.5, 0, 0, 0]
  x.toml:47: device[1].hand.waypoints[0]: found time -0.5, allowed: a time not below 0
[0.5, 0, 0, 0]
  -> [0.5, 0.02, 0, 0]
  x.toml:47: device[1].hand.waypoints[0]: found [0.5, 0.02, 0.0, 0.0], where the path begins, allowed: zeros after the time of the first row, because the rows are relative to where the hand starts: begin with the row [0, 0, 0, 0], and let this row come later
hand = {}
  -> hand = { grip = "tight" }
  x.toml:39: device[0].hand.grip: found "tight", allowed: `relaxed`, `typical`, `firm`, `rigid`
hand = {}
  -> hand = { grip = "rigid", task = "tap", direction = [0, 0, -1], depth = 0 }
  x.toml:39: device[0].hand.depth: found 0 ...
hand = {}
  -> hand = { task = "tap" }
  x.toml:39: device[0].hand.task: found a task without a `direction`, allowed: a task with a `direction`
hand = {}
  -> hand = { task = "tap", direction = [0, 0, -1], width = 0.01 }
  x.toml:39: device[0].hand.width: found 0.01, allowed: no such field: the task tap has no width
hand = {}
  -> hand = { task = "shake", direction = [0, 0, -1], speed = 0.1 }
  x.toml:39: device[0].hand.speed: found 0.1, allowed: no such field: the task shake has no speed
hand = {}
  -> hand = { direction = [0, 0, -1] }
  x.toml:39: device[0].hand.direction: found [0.0, 0.0, -1.0], allowed: no such field without a `task`
hand = {}
  -> hand = { task = "pat", direction = [0, 0, -1] }
  x.toml:39: device[0].hand.task: found "pat", allowed: `tap`, `press_and_hold`, `rub`, `pull_apart`, `move_together`, `shake`
hand = {}
  -> hand.recording = ''
  x.toml:39: device[0].hand.recording: found "" ...
[[device]]¶name = "right"¶model = "touch"¶
  -> [[device]]¶name = "c"¶model = "touch"¶hand = {}¶[[device]]¶name = "d"¶model = "touch"¶hand = {}¶[[device]]¶name = "e"¶model = "touch"¶hand = {}¶[[device]]¶name = "f"¶model = "touch"¶hand = {}¶[[device]]¶name = "g"¶model = "touch"¶hand = {}¶[[device]]¶name = "h"¶model = "touch"¶hand = {}¶[[device]]¶name = "i"¶model = "touch"¶hand = {}¶[[device]]¶name = "right"¶model = "touch"¶
  x.toml:36: device: found 9 entries, allowed: up to 8 entries
"#,
    );
}
