//! Advice for the writer of a scene: the likely name for a name that does not exist, the table that has a field, and an
//! example for a value of the wrong type.

/// Names that people use for fields of this format.
const SYNONYMS: [(&str, &str); 31] = [
    ("E", "young"),
    ("youngs_modulus", "young"),
    ("young_modulus", "young"),
    ("modulus", "young"),
    ("nu", "poisson"),
    ("poisson_ratio", "poisson"),
    ("poissons_ratio", "poisson"),
    ("rho", "density"),
    ("t", "thickness"),
    ("h", "thickness"),
    ("cross_section", "area"),
    ("model", "law"),
    ("Gc", "toughness"),
    ("G_c", "toughness"),
    ("dt", "step"),
    ("time_step", "step"),
    ("frequency", "rate"),
    ("type", "model"),
    ("port", "connect"),
    ("address", "connect"),
    ("translation", "position"),
    ("fixed", "support"),
    ("path", "file"),
    ("filename", "file"),
    ("speed", "max_speed"),
    ("scale", "motion_scale"),
    ("collision", "contact"),
    ("collisions", "contact"),
    ("self_collision", "self_contact"),
    ("mu", "friction"),
    ("bodies", "between"),
];

/// Solvers that scenes could once name.
const SOLVERS: [&str; 2] = ["assembled", "frozen_single"];

/// The fields of each table of a format, by the table's name.
pub(super) type Format = &'static [(&'static str, &'static [&'static str])];

/// The tables of the machine's settings.
pub(super) const SETTINGS: Format = &[
    ("", &["tick", "device_threads", "log", "serve"]),
    ("tick", &["core", "priority", "idle_sibling"]),
    ("device_threads", &["cores", "priority"]),
    ("log", &["folder"]),
    (
        "serve",
        &[
            "scene",
            "log",
            "file_mib",
            "file_minutes",
            "total_mib",
            "retry",
            "socket",
        ],
    ),
];

/// The tables of a scene.
pub(super) const SCENE: Format = &[
    (
        "",
        &[
            "name",
            "description",
            "duration",
            "seed",
            "loop",
            "host",
            "solve",
            "machine",
            "gravity",
            "body",
            "obstacle",
            "tool",
            "contact",
            "device",
        ],
    ),
    (
        "loop",
        &[
            "rate",
            "scheme",
            "thesis_stiffness",
            "thesis_damping",
            "proxy_stiffness",
            "proxy_damping",
            "blend",
            "age_limit",
            "decay",
            "recovery",
            "hold_damping",
        ],
    ),
    (
        "host",
        &[
            "step_rate",
            "publish_rate",
            "latency",
            "smoothing",
            "solver",
            "budget",
            "tolerance",
            "max_iterations",
            "threads",
        ],
    ),
    (
        "solve",
        &[
            "analysis",
            "load_steps",
            "step",
            "ramp",
            "frames",
            "refuse_inversion",
        ],
    ),
    ("machine", &["tick", "device_threads"]),
    ("machine.tick", &["core", "idle_sibling"]),
    ("machine.device_threads", &["cores", "priority"]),
    ("machine.log", &["folder"]),
    (
        "body",
        &[
            "mesh",
            "rotation",
            "material",
            "region",
            "damping",
            "bending",
            "handle",
            "support",
            "load",
            "contact_thickness",
            "self_contact",
            "tear",
        ],
    ),
    (
        "body.mesh",
        &[
            "sheet",
            "plate",
            "thread",
            "file",
            "scale",
            "flat_pattern",
            "order",
        ],
    ),
    (
        "body.material",
        &[
            "law",
            "young",
            "poisson",
            "thickness",
            "area",
            "tension_only",
            "density",
            "weave",
            "fields",
        ],
    ),
    ("body.support", &["displacement"]),
    ("body.load", &["force", "traction"]),
    (
        "body.tear",
        &[
            "strength",
            "toughness",
            "starts",
            "snapping",
            "room",
            "notch",
        ],
    ),
    (
        "device",
        &[
            "model",
            "connect",
            "firmware",
            "wire",
            "max_force",
            "max_speed",
            "max_reach",
            "max_slew",
            "continuous_force",
            "heat_time",
            "grip_weight",
            "square_wave",
            "engage",
            "motion_scale",
            "mounting",
            "workspace",
            "hand",
        ],
    ),
    ("obstacle", &["shape", "poses", "friction"]),
    ("tool", &["radius", "take_button"]),
    ("contact", &["between", "friction"]),
    (
        "device.engage",
        &["arm", "arm_button", "dead_man_button", "stop_button"],
    ),
    ("device.mounting", &["origin"]),
    ("device.square_wave", &["half_period"]),
    (
        "device.hand",
        &[
            "grip",
            "tremor",
            "task",
            "waypoints",
            "turns",
            "sines",
            "presses",
            "traces",
            "recording",
        ],
    ),
];

/// Examples of fields that are tables or lists.
const EXAMPLES: [(&str, &str); 21] = [
    ("mesh", "mesh.file = \"liver.msh\""),
    (
        "material",
        "material = { young = 1e4, poisson = 0.45, density = 1000 }",
    ),
    ("damping", "damping = { mass = 1.0, stiffness = 0.01 }"),
    ("gravity", "gravity = [0, 0, -9.81]"),
    (
        "box",
        "box = [[0, 0, 0], [0.1, 0.1, 0.1]], the lowest and the highest corner",
    ),
    ("position", "position = [0, 0, 0.1]"),
    ("rotation", "rotation = { axis = [0, 0, 1], degrees = 90 }"),
    ("displacement", "displacement = [0, 0, -0.01]"),
    ("force", "force = [0, 0, -1]"),
    ("square_wave", "square_wave = { force = [0, 0, 1] }"),
    ("hand", "hand = { grip = \"typical\" }"),
    (
        "waypoints",
        "waypoints = [[0, 0, 0, 0], [1, 0, 0, -0.02]], rows of time, x, y, z",
    ),
    ("tear", "tear = { strength = 1e5, toughness = 1e3 }"),
    ("handle", "[[body.handle]]"),
    ("support", "[[body.support]]"),
    ("between", "between = [\"cloth\", \"ball\"]"),
    ("body", "[[body]]"),
    ("obstacle", "[[obstacle]]"),
    ("tool", "[[tool]]"),
    ("contact", "[[contact]]"),
    ("device", "[[device]]"),
];

/// The names in backticks of a list of allowed names.
fn names(allowed: &str) -> impl Iterator<Item = &str> {
    allowed.split('`').skip(1).step_by(2)
}

/// A name without what people write differently.
fn plain(name: &str) -> String {
    let letters = name.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|c| c.to_ascii_lowercase()).collect()
}

/// The name among `allowed` that is nearest to `found`; `None` if no name is near.
fn nearest<'a>(found: &str, allowed: &'a str) -> Option<&'a str> {
    let plain_found = plain(found);
    if plain_found.is_empty() {
        return None;
    }
    let distance = |name: &str| {
        let name = plain(name);
        let shorter = name.len().min(plain_found.len());
        if name == plain_found {
            0
        } else if shorter > 3 && (name.contains(&plain_found) || plain_found.contains(&name)) {
            1
        } else {
            // A letter that is wrong, missing or swapped, or two in a long name.
            let most = if shorter > 5 {
                2
            } else {
                usize::from(shorter > 2)
            };
            let found = strsim::damerau_levenshtein(&name, &plain_found);
            if found <= most { 1 + found } else { usize::MAX }
        }
    };
    let each = names(allowed).map(|name| (distance(name), name));
    let near = each.filter(|(distance, _)| *distance < usize::MAX);
    near.min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// The likely name for the `found` name of a field or a value that is not among the `allowed` names, as the end of a
/// message; empty if nothing is likely.
pub(super) fn meant(found: &str, allowed: &str) -> String {
    let found = found.trim_matches('"');
    if SOLVERS.contains(&found) && allowed.contains("`incomplete`") {
        return "; leave the field out: the host then chooses the solver, which is faster at the same \
                tolerance"
            .to_owned();
    }
    let synonym = SYNONYMS.iter().find(|(other, _)| *other == found);
    let known = synonym.map(|(_, name)| *name);
    let known = known.filter(|name| names(allowed).any(|allowed| allowed == *name));
    match known.or_else(|| nearest(found, allowed)) {
        Some(name) => format!("; did you mean `{name}`?"),
        None => String::new(),
    }
}

/// As [`meant`] for the field at the path `field`, such as `body[0].scale`; otherwise the tables that have a field of this
/// name.
pub(super) fn of_field(field: &str, allowed: &str, format: Format) -> String {
    let name = field.rsplit('.').next().unwrap_or(field);
    let name = name.split('[').next().unwrap_or(name);
    let lives = format.iter().filter(|(_, fields)| fields.contains(&name));
    let lives: Vec<_> = lives
        .map(|(table, _)| match *table {
            "" => format!("`{name}` at the top of the file"),
            table => format!("`{table}.{name}`"),
        })
        .collect();
    match lives.as_slice() {
        [] => meant(name, allowed),
        tables => format!("; did you mean {}?", tables.join(" or ")),
    }
}

/// An example of the field at the path `field`, whose value has the wrong type, as the end of a message; empty if there
/// is none.
pub(super) fn example(field: &str, allowed: &str) -> String {
    if !["a table", "a list", "an array", "a sequence"]
        .iter()
        .any(|kind| allowed.starts_with(kind))
    {
        return String::new();
    }
    // An entry of a list has the example of the list.
    let name = field.rsplit('.').next().unwrap_or(field);
    let name = name.split('[').next().unwrap_or(name);
    let found = EXAMPLES.iter().find(|(other, _)| *other == name);
    found.map_or_else(String::new, |(_, example)| format!(", such as {example}"))
}

#[cfg(test)]
mod tests {
    use crate::Scene;
    use std::collections::BTreeMap;

    const SCENE: &str = "\
name = 'a'
[loop]
[host]
[solve]
[machine]
[machine.tick]
[machine.device_threads]
[machine.log]
[[body]]
name = 'b'
mesh.box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1] }
[body.material]
young = 1e3
poisson = 0.3
density = 1000
[[body.support]]
name = 's'
group = 'bottom'
[[body.load]]
name = 'l'
group = 'top'
force = [0, 0, -1]
[[obstacle]]
name = 'o'
shape = 'plane'
[[tool]]
name = 't'
device = 'd'
radius = 0.01
position = [0, 0, 0.2]
[[contact]]
between = ['b', 'o']
[[device]]
name = 'd'
model = 'falcon'
[device.engage]
[device.mounting]
[device.square_wave]
force = [0, 0, 1]
[device.hand]
";

    /// The message for a scene in which `line` is added to the table `table`.
    fn said(table: &str, line: &str) -> String {
        let head = match table {
            "" => "name = 'a'\n".to_owned(),
            "body.mesh" => "cells = [1, 1, 1] }\n".to_owned(),
            "body" | "device" | "obstacle" | "tool" | "contact" | "body.support" | "body.load" => {
                format!("[[{table}]]\n")
            }
            _ => format!("[{table}]\n"),
        };
        assert!(SCENE.contains(&head), "{head}");
        let line = if table == "body.mesh" {
            format!("mesh.{line}")
        } else {
            line.to_owned()
        };
        // A field that the scene has gets the new value.
        let scene = match line.strip_prefix("model") {
            Some(_) => SCENE.replace("model = 'falcon'\n", ""),
            None => SCENE.to_owned(),
        };
        let text = scene.replacen(&head, &format!("{head}{line}\n"), 1);
        let loaded = Scene::load_texts("a.toml", &text, &BTreeMap::new());
        loaded.expect_err("a fault").to_string()
    }

    #[test]
    fn every_field_of_the_tables_exists() {
        for (table, fields) in super::SCENE {
            if *table == "body.tear" {
                continue; // A solid has none.
            }
            let said = said(table, "zzzzzz = 1");
            let allowed = said.split_once("allowed: ").expect(&said).1;
            for field in *fields {
                assert!(
                    allowed.contains(&format!("`{field}`")),
                    "{table}.{field}: {said}"
                );
            }
        }
    }

    #[test]
    fn a_likely_name_or_the_table_of_a_field_is_told() {
        for (table, line, end) in [
            ("body.material", "E = 1e4", "; did you mean `young`?"),
            ("body.material", "nu = 0.3", "; did you mean `poisson`?"),
            (
                "body.material",
                "thicknes = 0.3",
                "; did you mean `thickness`?",
            ),
            (
                "body.material",
                "law = 'neo_hookean'",
                "; did you mean `stable_neo_hookean`?",
            ),
            ("device", "model = 'omega.3'", "; did you mean `omega3`?"),
            (
                "device",
                "model = 'Novint Falcon'",
                "; did you mean `falcon`?",
            ),
            ("loop", "scheme = 'thessis'", "; did you mean `thesis`?"),
            ("body", "scale = 0.001", "; did you mean `body.mesh.scale`?"),
            ("", "handle = []", "; did you mean `body.handle`?"),
            ("", "hand = {}", "; did you mean `device.hand`?"),
            ("body", "notch = []", "; did you mean `body.tear.notch`?"),
            ("host", "rate = 100", "; did you mean `loop.rate`?"),
            ("", "collision = {}", "; did you mean `contact`?"),
            ("", "tools = []", "; did you mean `tool`?"),
            (
                "body",
                "contact = true",
                "; did you mean `contact` at the top of the file?",
            ),
            ("body", "friction = 0.3", "`contact.friction`?"),
            ("", "zzzzzz = 1", "`device`"),
            (
                "body",
                "damping = 0.1",
                "a table, such as damping = { mass = 1.0, stiffness = 0.01 }",
            ),
            ("body", "position = 0.1", ", such as position = [0, 0, 0.1]"),
        ] {
            let said = said(table, line);
            assert!(said.ends_with(end), "{said}");
        }
    }
}
