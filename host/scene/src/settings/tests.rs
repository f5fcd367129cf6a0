use super::*;
use crate::Scene;
use crate::load::LoadedScene;
use runner::{CoreChoice, Cores, ThreadPlace};
use std::collections::BTreeMap;

const FILE: &str = "\
tick.core = 1
tick.priority = 70
[device_threads]
cores = [2, 1, 2]
[log]
folder = '/var/log/palpate'
[serve]
scene = 'lab.toml'
total_mib = 500
";

fn scene(tables: &str) -> LoadedScene {
    // The smallest scene: a tool above a plane.
    let text = format!(
        "name = 'a'\n{tables}[[device]]\nname = 'd'\nmodel = 'falcon'\nhand = {{}}\n[[obstacle]]\nname = 'o'\nshape = 'plane'\n\
         [[tool]]\nname = 't'\ndevice = 'd'\nradius = 0.01\nposition = [0, 0, 0.2]\n"
    );
    Scene::load_texts("a.toml", &text, &BTreeMap::new()).expect("a scene")
}

fn file(text: &str) -> MachineFile {
    MachineFile::parse("/etc/palpate/palpate.toml", text).expect("settings")
}

fn resolved(flags: Flags, scene: Option<&LoadedScene>, file: &MachineFile) -> Settings {
    let cores = Cores::new(vec![0, 1, 2, 3], vec![3]);
    Settings::resolve(flags, scene, file, None, &cores).expect("all cores exist")
}

#[test]
fn a_value_comes_from_the_flag_before_the_scene_before_the_machine_before_the_default() {
    let scene = scene("[machine.tick]\ncore = 'last'\npriority = 60\n");
    let (none, given) = (file(""), file(FILE));
    let flags = Flags {
        core: Some(3),
        priority: None,
    };
    let plain = Flags::default();
    let scene = Some(&scene);
    for (flags, scene, file, core, core_from, priority, priority_from) in [
        (
            plain,
            None,
            &none,
            CoreChoice::Isolated,
            "default",
            80,
            "default",
        ),
        (
            plain,
            None,
            &given,
            CoreChoice::Id(1),
            "machine, /etc/palpate/palpate.toml:1",
            70,
            "machine, /etc/palpate/palpate.toml:2",
        ),
        (
            plain,
            scene,
            &given,
            CoreChoice::Last,
            "scene, a.toml:3",
            60,
            "scene, a.toml:4",
        ),
        (
            flags,
            scene,
            &given,
            CoreChoice::Id(3),
            "flag, --core",
            60,
            "scene, a.toml:4",
        ),
        (
            flags,
            None,
            &none,
            CoreChoice::Id(3),
            "flag, --core",
            80,
            "default",
        ),
    ] {
        let settings = resolved(flags, scene, file);
        assert_eq!(settings.core.value, core);
        assert_eq!(settings.core.from.to_string(), core_from);
        assert_eq!(settings.priority.value, priority);
        assert_eq!(settings.priority.from.to_string(), priority_from);
    }
}

#[test]
fn every_value_reaches_its_place_and_the_others_are_the_defaults() {
    let settings = resolved(Flags::default(), None, &file(FILE));
    let threads = ThreadPlace {
        cores: vec![1, 2],
        priority: 45,
    };
    assert_eq!(settings.device_threads(), threads);
    assert!(settings.idle_sibling.value);
    for (name, path) in [
        ("run.mcap", "/var/log/palpate/run.mcap"),
        ("/tmp/run.mcap", "/tmp/run.mcap"),
    ] {
        assert_eq!(settings.log(Path::new(name)), Path::new(path));
    }
    let rows: Vec<_> = settings
        .rows()
        .into_iter()
        .map(|row| format!("{} {} {}", row.field, row.value, row.from.kind()))
        .collect();
    for row in [
        "tick.idle_sibling true default",
        "device_threads.cores [1, 2] machine",
        "log.folder \"/var/log/palpate\" machine",
        "serve.scene \"/etc/palpate/lab.toml\" machine",
        "serve.total_mib 500 machine",
        "serve.socket \"/run/palpate/status.sock\" default",
    ] {
        assert!(rows.iter().any(|found| found == row), "{row} in {rows:?}");
    }
    let settings = resolved(Flags::default(), None, &file(""));
    assert_eq!(settings.log(Path::new("run.mcap")), Path::new("run.mcap"));
    assert_eq!(settings.device_threads(), ThreadPlace::default());
}

#[test]
fn the_folder_of_the_service_manager_has_the_socket_unless_the_file_names_one() {
    let socket = |text: &str| {
        let runtime = Some(Path::new("/run/lab"));
        let cores = Cores::default();
        let settings = Settings::resolve(Flags::default(), None, &file(text), runtime, &cores);
        settings.expect("no core is named").socket
    };
    let given = socket("serve.socket = '/tmp/s'");
    assert_eq!(given.value, Path::new("/tmp/s"));
    let made = socket("");
    assert_eq!(made.value, Path::new("/run/lab/status.sock"));
    assert_eq!(made.from, Origin::Environment("RUNTIME_DIRECTORY"));
}

#[test]
fn every_wrong_value_is_refused_with_its_line_its_column_and_the_allowed_values() {
    for (text, said) in [
        (
            "tick.core = 'first'",
            "1:13: tick.core: found 'first', allowed: the number of a core, or",
        ),
        (
            "tick.core = -1",
            "1:13: tick.core: found -1, allowed: the number",
        ),
        (
            "tick.core = 1024",
            "tick.core: found 1024, allowed: the number",
        ),
        (
            "tick.core = 1.5",
            "tick.core: found 1.5, allowed: the number",
        ),
        (
            "tick.priority = 0",
            "tick.priority: found 0, allowed: a whole number from 1 to 99",
        ),
        (
            "tick.priority = 100",
            "tick.priority: found 100, allowed: a whole number from 1",
        ),
        (
            "\ntick.priority = '80'",
            "2:17: tick.priority: found '80', allowed: a whole number",
        ),
        (
            "tick.idle_sibling = 1",
            "tick.idle_sibling: found 1, allowed: true or false",
        ),
        (
            "device_threads.cores = []",
            "device_threads.cores: found [], allowed: a list of the numbers",
        ),
        (
            "device_threads.cores = 1",
            "device_threads.cores: found 1, allowed: a list",
        ),
        (
            "device_threads.cores = [0, -1]",
            "found -1, allowed: the number of a core",
        ),
        (
            "device_threads.priority = 1e3",
            "found 1e3, allowed: a whole number from 1 to 99",
        ),
        (
            "log.folder = 'logs'",
            "log.folder: found 'logs', allowed: an absolute path",
        ),
        (
            "log.folder = 7",
            "log.folder: found 7, allowed: an absolute path",
        ),
        ("log = 7", "log: found 7, allowed: a table"),
        (
            "serve.file_mib = 0",
            "serve.file_mib: found 0, allowed: a whole number from 1",
        ),
        (
            "serve.file_minutes = 10081",
            "serve.file_minutes: found 10081, allowed: a whole number",
        ),
        (
            "serve.total_mib = -5",
            "serve.total_mib: found -5, allowed: a whole number",
        ),
        (
            "serve.retry = nan",
            "serve.retry: found nan, allowed: a number from 0.1 to 3600",
        ),
        (
            "serve.socket = 's.sock'",
            "serve.socket: found 's.sock', allowed: an absolute path",
        ),
        (
            "serve.log = 'yes'",
            "serve.log: found 'yes', allowed: true or false",
        ),
        (
            "core = 1",
            "core: unknown field, allowed: `tick`, `device_threads`, `log`, `serve`; did you mean `tick.core`?",
        ),
        (
            "tick.prio = 1",
            "tick.prio: unknown field, allowed: `core`, `priority`, `idle_sibling`",
        ),
        ("tick = ", "1:"),
    ] {
        let error = MachineFile::parse("p.toml", text)
            .expect_err(text)
            .to_string();
        assert!(
            error.starts_with("p.toml:") && error.contains(said),
            "{error}\n{said}"
        );
    }
}

#[test]
fn a_core_that_the_machine_has_not_is_refused_where_it_is_named() {
    let cores = Cores::new(vec![0, 1], vec![]);
    let scene = scene("machine.tick.core = 3\n");
    let refused = |scene: Option<&LoadedScene>, text: &str| {
        let settings = Settings::resolve(Flags::default(), scene, &file(text), None, &cores);
        settings.expect_err("no such core").to_string()
    };
    for (scene, text, said) in [
        (
            None,
            "tick.core = 2",
            "palpate.toml:1:13: tick.core: found 2, allowed: an online core (0-1)",
        ),
        (
            None,
            "device_threads.cores = [0, 5]",
            "device_threads.cores: found 5, allowed: an online",
        ),
        (
            Some(&scene),
            "",
            "a.toml:2: machine.tick.core: found 3, allowed: an online core (0-1)",
        ),
    ] {
        let error = refused(scene, text);
        assert!(error.contains(said), "{error}\n{said}");
    }
}

#[test]
fn a_named_file_must_exist_and_the_tables_have_every_field() {
    let error = MachineFile::load(Some(Path::new("/nonexistent/p.toml"))).expect_err("none");
    assert!(
        error.to_string().contains("cannot read these settings"),
        "{error}"
    );
    for (table, fields) in advice::SETTINGS {
        let dot = if table.is_empty() { "" } else { "." };
        let error = MachineFile::parse("p.toml", &format!("{table}{dot}zzzzzz = 1"));
        let error = error.expect_err("unknown").to_string();
        for field in *fields {
            assert!(
                error.contains(&format!("`{field}`")),
                "{table}.{field}: {error}"
            );
        }
    }
}
