//! Rooms of the sources import downwards only. No room imports, directly or through others, a room that imports it.
//!
//! A room is a folder of `src`, or a file beside `lib.rs`. `crate::room` in the code counts as an import, and
//! `crate::Name` as an import of the room from which `lib.rs` exports the name. Comments and tests may name any room.
//! Files of one room may import each other.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

type Graph = BTreeMap<String, BTreeSet<String>>;

/// The sources under `path`, one after another, without comments.
fn code(path: &Path) -> String {
    if path.is_dir() {
        let mut entries: Vec<_> = fs::read_dir(path)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        entries.sort();
        return entries.iter().map(|path| code(path)).collect();
    }
    if path.extension().is_none_or(|extension| extension != "rs") || path.ends_with("tests.rs") {
        return String::new();
    }
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]\nmod tests").next();
    let lines = text
        .unwrap_or_default()
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default());
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// The room after each `crate::` in `code`, or the rooms of a list in braces.
fn named(code: &str) -> BTreeSet<String> {
    let word = |text: &str| -> String {
        text.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let mut found = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let Some(list) = rest.strip_prefix('{') else {
            found.insert(word(rest));
            continue;
        };
        let (mut depth, mut begins) = (0, true);
        for (at, c) in list.char_indices() {
            if begins && !c.is_whitespace() {
                found.insert(word(&list[at..]));
                begins = false;
            }
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => begins = true,
                _ => {}
            }
        }
    }
    found
}

/// The names that `lib` exports from its rooms, each with its room.
fn exports(lib: &str) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for statement in lib.split("pub use ").skip(1) {
        let statement = statement.split(';').next().unwrap_or_default();
        if let Some((room, names)) = statement.split_once("::") {
            let names = names.split(|c: char| !c.is_alphanumeric() && c != '_');
            found.extend(names.map(|name| (name.to_owned(), room.to_owned())));
        }
    }
    found
}

/// The rooms under `src`, and the rooms that each of them imports.
fn rooms(src: &Path) -> Graph {
    let mut paths = BTreeMap::new();
    for entry in fs::read_dir(src).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if name != "lib" {
            paths.insert(name, path);
        }
    }
    let exports = exports(&code(&src.join("lib.rs")));
    paths
        .iter()
        .map(|(room, path)| {
            let named = named(&code(path)).into_iter();
            let imports = named.map(|name| match exports.get(&name) {
                Some(room) if !paths.contains_key(&name) => room.clone(),
                _ => name,
            });
            let imports = imports.filter(|name| name != room && paths.contains_key(name));
            (room.clone(), imports.collect())
        })
        .collect()
}

/// Rooms on a cycle or above one. The function repeatedly removes rooms that import no remaining room; these rooms
/// remain.
fn circles(graph: &Graph) -> Vec<String> {
    let mut left = graph.clone();
    loop {
        let kept: BTreeSet<String> = left.keys().cloned().collect();
        left.retain(|_, imports| imports.iter().any(|room| kept.contains(room)));
        if left.len() == kept.len() {
            return kept.into_iter().collect();
        }
    }
}

/// The crates whose rooms import downwards only.
const CRATES: [&str; 18] = [
    "firmware_proto",
    "fuzz/lib",
    "host",
    "host/doctor",
    "host/meshio",
    "host/physics",
    "host/plot",
    "host/program",
    "host/scene",
    "host/study",
    "host/view",
    "rt_core",
    "rt_core/devices",
    "rt_core/runner",
    "sim",
    "sim/emulator",
    "tests/corpus",
    "tests/qemu_board",
];

#[test]
fn rooms_import_downwards_only() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for name in CRATES {
        let graph = rooms(&root.join(name).join("src"));
        // A reader that finds no imports finds no circle, either. Two crates have rooms that stand alone.
        let imports: usize = graph.values().map(BTreeSet::len).sum();
        let alone = ["tests/corpus", "tests/qemu_board"].contains(&name);
        assert_eq!(imports == 0, alone, "{name}: {graph:#?}");
        assert_eq!(circles(&graph), Vec::<String>::new(), "{name}: {graph:#?}");
    }
}

/// The ground of the host stands on no other of its rooms.
#[test]
fn records_import_no_room_of_the_host() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/src");
    let graph = rooms(&root);
    assert!(graph["record"].is_empty(), "{:?}", graph["record"]);
    assert!(graph["world"].is_empty(), "{:?}", graph["world"]);
}

#[test]
fn a_cycle_of_rooms_is_found() {
    let imports = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let mut graph = Graph::from([
        ("body".to_owned(), imports(&["element", "mesh"])),
        ("element".to_owned(), imports(&["mesh"])),
        ("mesh".to_owned(), imports(&[])),
    ]);
    assert!(circles(&graph).is_empty());
    graph.insert("mesh".to_owned(), imports(&["body"]));
    assert_eq!(circles(&graph), ["body", "element", "mesh"]);
}

#[test]
fn names_of_rooms_are_read_from_code() {
    let code = "use crate::{Vec3, mesh::{a, b}, body::Body};\nlet x = crate::linear::dense::f();";
    let expected = ["Vec3", "body", "linear", "mesh"];
    assert_eq!(named(code), expected.map(str::to_owned).into());
}

#[test]
fn names_that_the_root_exports_belong_to_their_rooms() {
    let found =
        exports("pub use error::StudyError;\npub use mesh::{\n    Mesh,\n    solid::Solid,\n};\n");
    let room = |name: &str| found.get(name).map(String::as_str);
    assert_eq!(room("StudyError"), Some("error"));
    assert_eq!(room("Solid"), Some("mesh"));
    assert_eq!(room("Mesh"), Some("mesh"));
}
