//! `palpate device`: an emulated device, found by its connection, probed, and held in a run under the real clock.

use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

fn palpate(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.args(arguments);
    command
}

/// An emulator, ended with the test.
struct Emulated(Child);

impl Drop for Emulated {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts an emulator, and returns the connection that it prints.
fn emulate(model: &str, on: &str) -> (Emulated, String) {
    emulate_with(&[model, "--on", on, "--tremor", "0.0005"])
}

/// Starts an emulator with these arguments, and returns the connection that it prints.
fn emulate_with(arguments: &[&str]) -> (Emulated, String) {
    let mut child = palpate(&["device", "emulate"])
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let output = child.stdout.take().expect("it is piped");
    let emulated = Emulated(child);
    let mut line = String::new();
    BufReader::new(output)
        .read_line(&mut line)
        .expect("it prints");
    let connect = line.trim().strip_prefix("connect = \"");
    let connect = connect.and_then(|text| text.strip_suffix('"'));
    (
        emulated,
        connect.unwrap_or_else(|| panic!("{line}")).to_owned(),
    )
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("it was written")).expect("it is JSON")
}

const SCENE: &str = r#"
name = "emulated"
duration = 2
[[body]]
name = "sheet"
mesh.sheet = { length = 0.2, width = 0.1, cells = [8, 4] }
material = { young = 1e5, poisson = 0.3, thickness = 0.001, density = 1000 }
[[body.handle]]
name = "left"
group = "left"
device = "hand"
[[body.support]]
name = "right"
group = "right"
[[device]]
name = "hand"
model = "MODEL"
connect = "CONNECT"
"#;

/// The threads of a device run on the core that the settings of the machine name, also in a probe.
#[test]
fn a_probe_takes_the_settings_of_the_machine() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let settings = folder.path().join("palpate.toml");
    let probe = |connect: &str, text: &str| {
        std::fs::write(&settings, text).expect("a temporary folder");
        let mut command = palpate(&["device", "probe", connect, "--model", "omega3"]);
        command.arg("--settings").arg(&settings);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("the program runs")
    };
    let wrong = probe("tcp:localhost:1", "device_threads.cores = [4000]");
    let wrong = wrong.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(said.contains("device_threads.cores"), "{said}");
    assert_eq!(wrong.status.code(), Some(2), "{said}");

    let (_emulated, connect) = emulate("omega3", "pty");
    let mut probe = Emulated(probe(&connect, "device_threads.cores = [0]"));
    let tasks = format!("/proc/{}/task", probe.0.id());
    let on_core_0 = |task: &Path| {
        let status = std::fs::read_to_string(task.join("status")).unwrap_or_default();
        let mut lines = status.lines();
        lines.any(|line| line.starts_with("Cpus_allowed_list:") && line.ends_with("\t0"))
    };
    let mut found = false;
    while !found && probe.0.try_wait().expect("a process").is_none() {
        let tasks = std::fs::read_dir(&tasks).into_iter().flatten().flatten();
        found = tasks.map(|task| task.path()).any(|task| on_core_0(&task));
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(found, "no thread of the probe is confined to core 0");
}

/// Probes an emulated device, and runs a scene with it, with its log and a replay.
fn probed_and_held(model: &str, on: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name);
    let (_emulated, connect) = emulate(model, on);
    // The operator calibrates the device within this time.
    let result = palpate(&[
        "device",
        "probe",
        &connect,
        "--model",
        model,
        "--duration",
        "2",
    ])
    .arg("--json")
    .arg(file("probe.json"))
    .output()
    .expect("the program runs");
    let printed = String::from_utf8_lossy(&result.stdout).into_owned();
    let probed = json(&file("probe.json"));
    assert_eq!(probed["ticks"], 2000);
    // Whether the device is ready depends on what else this machine does.
    let last = printed.lines().last().unwrap_or_default();
    let ready = last.starts_with("  verdict    ready: ");
    assert!(
        ready || last.starts_with("  verdict    NOT ready: "),
        "{printed}"
    );
    assert_eq!(result.status.code(), Some(i32::from(!ready)), "{result:?}");
    let stated = &probed["device"];
    assert!(stated["max_force"].as_f64() > Some(0.0), "{probed}");
    assert!(stated["profile_rate"].as_f64() > Some(0.0), "{probed}");
    // Of these devices, those of the firmware protocol state a name and a firmware.
    let states = model != "woodenhaptics";
    assert_eq!(stated["name"].is_string(), states, "{probed}");
    assert_eq!(stated["firmware"].is_string(), states, "{probed}");
    assert_eq!(printed.contains("calls itself"), states, "{printed}");
    assert!(
        probed["states"].as_u64().is_some_and(|states| states > 0),
        "{probed}"
    );
    // The smallest displacement is not below a hundredth of a count of any of these devices.
    assert!(
        probed["step"].as_f64().is_some_and(|step| step > 1e-8),
        "{probed}"
    );

    let scene = SCENE.replace("MODEL", model).replace("CONNECT", &connect);
    std::fs::write(file("scene.toml"), scene).expect("a temporary folder");
    let result = palpate(&["run", "--clock", "real", "--armed"])
        .arg(file("scene.toml"))
        .arg("--json")
        .arg(file("run.json"))
        .arg("--log")
        .arg(file("run.mcap"))
        .output()
        .expect("the program runs");
    assert!(result.status.success(), "{result:?}");
    let summary = json(&file("run.json"));
    assert_eq!(summary["failures"], Value::Array(vec![]), "{summary}");
    // A log of a real device replays without the device.
    let result = palpate(&["run", "--replay"])
        .arg(file("run.mcap"))
        .output()
        .expect("the program runs");
    assert!(result.status.success(), "{result:?}");
    // The same scene runs in virtual time with a simulated device.
    let result = palpate(&["run", "--device", "hand=sim", "--duration", "0.2"])
        .arg(file("scene.toml"))
        .output()
        .expect("the program runs");
    assert!(result.status.success(), "{result:?}");
}

#[test]
fn an_emulated_woodenhaptics_is_probed_and_held_over_tcp() {
    probed_and_held("woodenhaptics", "tcp");
}

#[test]
fn an_emulated_woodenhaptics_is_probed_and_held_over_a_pty() {
    probed_and_held("woodenhaptics", "pty");
}

#[test]
fn an_emulated_device_of_the_firmware_protocol_is_probed_and_held_over_tcp() {
    probed_and_held("omega3", "tcp");
}

#[test]
fn an_emulated_device_of_the_firmware_protocol_is_probed_and_held_over_a_pty() {
    probed_and_held("touch", "pty");
}

/// Two hands of a scene, which pull a sheet apart twice and hold it.
const TWO_HANDS: &str = r#"
name = "rehearsed"
duration = 4
[[body]]
name = "sheet"
mesh.sheet = { length = 0.2, width = 0.1, cells = [8, 4] }
material = { young = 1e5, poisson = 0.3, thickness = 0.001, density = 1000 }
handle = [
  { name = "left edge", group = "left", device = "left" },
  { name = "right edge", group = "right", device = "right" },
]
[[device]]
name = "left"
model = "falcon"
hand.waypoints = [[0.3, 0, 0, 0], [0.8, -0.01, 0, 0], [2.0, -0.01, 0, 0], [2.5, 0, 0, 0], [3.0, -0.01, 0, 0]]
[[device]]
name = "right"
model = "falcon"
hand.waypoints = [[0.3, 0, 0, 0], [0.8, 0.01, 0, 0], [2.0, 0.01, 0, 0], [2.5, 0, 0, 0], [3.0, 0.01, 0, 0]]
"#;

#[test]
fn a_scene_with_two_emulated_devices_is_rehearsed_in_its_own_hands() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, TWO_HANDS).expect("a temporary folder");
    let at = scene.to_str().expect("a path");
    let [left, right] = [("left", "tcp"), ("right", "pty")].map(|(name, on)| {
        emulate_with(&[
            "--scene",
            at,
            "--name",
            name,
            "--on",
            on,
            "--protocol",
            "firmware",
        ])
    });
    let run = |name: &str, options: &[&str]| {
        let file = folder.path().join(name);
        let mut command = palpate(&["run", "--json"]);
        let result = command.arg(&file).args(options).arg(&scene).output();
        let result = result.expect("the program runs");
        assert!(result.status.success(), "{result:?}");
        json(&file)
    };
    let simulated = run("virtual.json", &[]);
    let [first, second] = [("left", &left.1), ("right", &right.1)]
        .map(|(name, connect)| format!("--device={name}={connect}"));
    let rehearsed = run(
        "real.json",
        &["--clock", "real", "--armed", &first, &second],
    );
    // If this machine stands still for a while, a hand continues alone, and the reach leaves out the part of its way
    // that the device did not follow. The second pull then still stretches the sheet.
    let events = rehearsed["events"].as_array().expect("a list");
    let stalled = events
        .iter()
        .any(|event| !event["what"].as_str().expect("text").contains("engaging"));
    for device in 0..2 {
        let reach = |summary: &Value| {
            let reach = summary["devices"][device]["reach"].as_f64();
            reach.expect("a number")
        };
        let (expected, found) = (reach(&simulated), reach(&rehearsed));
        // The hand holds the sheet for a second, so that the time at which it began does not matter. Its arm (300 N/m)
        // stretches under the force of the sheet, by the friction of 0.3 N up to 1 mm less or more, on each side.
        assert!(
            stalled || (found - expected).abs() < 2e-3,
            "{found} {expected}: {rehearsed}"
        );
        assert!(found > 2e-3, "{found}: {rehearsed}");
        assert!(expected > 5e-3, "{expected}");
    }
    let wrong = palpate(&[
        "device", "emulate", "--on", "tcp", "--scene", at, "--name", "middle",
    ]);
    let wrong = { wrong }.output().expect("the program runs");
    let said = String::from_utf8_lossy(&wrong.stderr);
    assert!(
        said.contains("--name: found middle, allowed: the devices of the scene: left, right"),
        "{said}"
    );
}

/// A scene with a second device.
fn scene_of_two(first: &str, second: &str) -> String {
    let first = SCENE.replace("MODEL", "omega3").replace("CONNECT", first);
    format!("{first}\n[[device]]\nname = \"other\"\nmodel = \"omega3\"\nconnect = \"{second}\"\n")
}

#[test]
fn one_connection_of_two_devices_is_refused_before_anything_is_opened() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("scene.toml");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.set_nonblocking(true).expect("ours");
    let port = listener.local_addr().expect("a port").port();
    let (name, number) = (
        format!("tcp:localhost:{port}"),
        format!("tcp:127.0.0.1:{port}"),
    );
    let line = folder.path().join("line");
    std::fs::write(&line, "").expect("ours");
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(&line, &link).expect("ours");
    let tty = |path: &Path| format!("tty:{}", path.display());
    for (first, second) in [
        (name.clone(), name.clone()),
        (name.clone(), number.clone()),
        (tty(&line), tty(&link)),
        (
            "hid:/dev/hidraw97".to_owned(),
            "hid:/dev/hidraw97".to_owned(),
        ),
    ] {
        std::fs::write(&scene, scene_of_two(&first, &second)).expect("ours");
        let override_scene = folder.path().join("override.toml");
        std::fs::write(
            &override_scene,
            scene_of_two("tcp:localhost:1", "tcp:localhost:2"),
        )
        .expect("ours");
        let log = folder.path().join("run.mcap");
        let (log_at, over) = (
            log.display().to_string(),
            override_scene.display().to_string(),
        );
        let given = format!("--device=hand={first}");
        let also = format!("--device=other={second}");
        let at = scene.display().to_string();
        for arguments in [
            vec!["plan", "--no-timing", &at],
            vec!["run", "--clock", "real", "--armed", "--log", &log_at, &at],
            vec![
                "run", "--clock", "real", "--log", &log_at, &given, &also, &over,
            ],
        ] {
            let result = palpate(&arguments).output().expect("the program runs");
            let said = String::from_utf8_lossy(&result.stderr).into_owned();
            assert_eq!(result.status.code(), Some(2), "{arguments:?}: {said}");
            assert!(
                said.contains("device[1].connect: found the connection of device[0]"),
                "{arguments:?}: {said}"
            );
            assert!(!log.exists(), "{arguments:?}");
        }
    }
    let connected = listener.accept().expect_err("nobody has connected");
    assert_eq!(connected.kind(), std::io::ErrorKind::WouldBlock);
}

/// The names of the ptys that a process has open.
fn ptys(process: &Child) -> Vec<String> {
    let files = std::fs::read_dir(format!("/proc/{}/fd", process.id()))
        .into_iter()
        .flatten();
    let names = files.filter_map(|file| std::fs::read_link(file.ok()?.path()).ok());
    let names = names.map(|name| name.display().to_string());
    names.filter(|name| name.starts_with("/dev/pts/")).collect()
}

/// The device is switched off and on again while a run holds it. The system gives the new pty the old name only if
/// nobody has the old one open.
fn comes_back_on_a_pty(model: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name);
    let (emulated, connect) = emulate(model, "pty");
    let scene = SCENE.replace("MODEL", model).replace("CONNECT", &connect);
    std::fs::write(file("scene.toml"), scene).expect("a temporary folder");
    let mut run = palpate(&["run", "--clock", "real", "--armed", "--duration", "300"])
        .arg(file("scene.toml"))
        .arg("--csv")
        .arg(file("run.csv"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let mut until = |what: &str, holds: &dyn Fn(&Child, &[bool]) -> bool| {
        while !holds(&run, &silent(&file("run.csv"))) {
            let ended = run.try_wait().expect("a child");
            assert!(ended.is_none(), "{model}: the run ended before {what}");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    until("the device gave a state", &|_, silent| {
        silent.contains(&false)
    });
    drop(emulated);
    until("the device was lost", &|run, _| ptys(run).is_empty());
    // The table is up to half a second late.
    let lost = |silent: &[bool]| {
        let last = silent.rchunks_exact(1000).next();
        last.is_some_and(|last| !last.contains(&false))
    };
    until("the table had the loss", &|_, silent| lost(silent));
    let before = silent(&file("run.csv")).len();
    // Other tests may take the name first.
    let mut others = Vec::new();
    let back = loop {
        let (emulated, found) = emulate(model, "pty");
        if found == connect {
            break emulated;
        }
        others.push(emulated);
        assert!(others.len() < 50, "{model}: nobody gets {connect} again");
    };
    // The operator calibrates it.
    until("it came back", &|_, silent| {
        silent.iter().skip(before).any(|silent| !silent)
    });
    let signal = Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status();
    assert!(signal.is_ok_and(|status| status.success()));
    run.wait().expect("a child");
    drop(back);
}

/// Whether the device was silent in each tick of a table that is written.
fn silent(table: &Path) -> Vec<bool> {
    let table = std::fs::read_to_string(table).unwrap_or_default();
    let mut lines = table.lines().filter(|line| !line.starts_with('#'));
    let head = lines.next().unwrap_or_default();
    let column = head.split(',').position(|name| name == "hand_silent");
    let column = column.unwrap_or(usize::MAX);
    let cells = lines.filter_map(|line| line.split(',').nth(column));
    cells.map(|cell| cell == "1").collect()
}

#[test]
fn a_woodenhaptics_that_is_switched_off_comes_back_on_its_pty() {
    comes_back_on_a_pty("woodenhaptics");
}

#[test]
fn a_device_of_the_firmware_protocol_that_is_switched_off_comes_back_on_its_pty() {
    comes_back_on_a_pty("omega3");
}

/// Another built-in device than that of the profile, which only its name tells: it is stronger.
#[test]
fn a_device_that_calls_itself_another_is_refused() {
    let (_emulated, connect) = emulate("omega3", "tcp");
    let refused = palpate(&["device", "probe", &connect, "--model", "falcon"]).output();
    let said = String::from_utf8_lossy(&refused.expect("the program runs").stderr).into_owned();
    for part in ["\"omega3\"", "Novint Falcon", "another device's profile"] {
        assert!(said.contains(part), "{part} in {said}");
    }
}

/// Builds the example of a plug-in, with another force than the 5 N that it states; `None` without a C compiler.
fn plugin(folder: &Path, force: &str) -> Option<()> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rt_core/devices/plugin");
    let text = std::fs::read_to_string(source.join("example.c")).expect("the example");
    let text = text.replace("max_force = 5.0", &format!("max_force = {force}"));
    std::fs::write(folder.join("arm.c"), text).expect("ours");
    let built = Command::new("cc")
        .args([
            "-std=c99", "-shared", "-fPIC", "-o", "arm.so", "arm.c", "-lm", "-I",
        ])
        .arg(source.canonicalize().expect("a folder"))
        .current_dir(folder)
        .status();
    match built {
        Ok(status) => {
            assert!(status.success());
            Some(())
        }
        Err(error) => {
            println!("!! SKIPPED: a plug-in: no C compiler `cc` ({error})");
            None
        }
    }
}

#[test]
fn a_plug_in_is_held_against_its_profile() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("scene.toml");
    let text = SCENE
        .replace("MODEL", "falcon")
        .replace("CONNECT", "plugin:arm.so");
    std::fs::write(&scene, text).expect("ours");
    let run = || {
        palpate(&["run", "--clock", "real", "--armed", "--duration", "0.5"])
            .arg(&scene)
            .output()
            .expect("the program runs")
    };
    // The profile states 8 N.
    let Some(()) = plugin(folder.path(), "0.1") else {
        return;
    };
    let result = run();
    let said = String::from_utf8_lossy(&result.stderr).into_owned();
    assert_eq!(result.status.code(), Some(2), "{said}");
    for part in ["arm.so", "0.1 N", "8 N", "another device's profile"] {
        assert!(said.contains(part), "{part} in {said}");
    }
    // A limit that is only lower holds, and is told.
    plugin(folder.path(), "5.0").expect("it was built before");
    let result = run();
    let said = String::from_utf8_lossy(&result.stdout).into_owned();
    assert!(
        said.contains("a largest force of 5 N, and its profile 8 N: the lower limit holds"),
        "{result:?}"
    );
}

/// A device that lets go is an event. A fault of another device, which holds nothing, is an event and fails the run.
#[test]
fn a_device_that_lets_go_is_an_event_and_a_fault_of_a_device_fails_the_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let Some(()) = plugin(folder.path(), "12.0") else {
        return;
    };
    // No two devices have one connection.
    std::fs::copy(folder.path().join("arm.so"), folder.path().join("other.so")).expect("ours");
    let scene = folder.path().join("scene.toml");
    for (second, code) in [("sound", 0), ("fault", 1)] {
        let text = scene_of_two(
            "plugin:arm.so:release",
            &format!("plugin:other.so:{second}"),
        );
        std::fs::write(&scene, text).expect("ours");
        let result = palpate(&["run", "--clock", "real", "--armed", "--duration", "1"])
            .arg(&scene)
            .args(["--json", "run.json"])
            .current_dir(folder.path())
            .output()
            .expect("the program runs");
        assert_eq!(result.status.code(), Some(code), "{second}: {result:?}");
        let summary = json(&folder.path().join("run.json"));
        let events = summary["events"].as_array().expect("events");
        // A busy machine may interrupt a device, and so tell an event twice.
        let told = |text: &str| events.iter().any(|event| event["what"] == text);
        assert!(told("hand: the device renders no force"), "{summary}");
        let failures = summary["failures"].as_array().expect("failures");
        assert_eq!(
            (told("other: fault of the device, no force"), failures.len()),
            (code == 1, code as usize),
            "{summary}"
        );
        for failure in failures {
            let failure = failure.as_str().expect("a text");
            assert!(
                failure.starts_with("the device other reported the fault 7 at "),
                "{failure}"
            );
            let said = String::from_utf8_lossy(&result.stdout).into_owned();
            assert!(said.contains(failure), "{result:?}");
        }
    }
}

#[test]
fn a_wrong_device_is_an_error_before_anything_moves() {
    for (arguments, expected) in [
        (
            ["probe", "hdi:1209:c0de", "--model", "falcon"],
            "found the driver \"hdi\", allowed: hid, tty, tcp, woodenhaptics, falcon",
        ),
        (
            ["probe", "woodenhaptics", "--model", "falcon"],
            "woodenhaptics: profile: found Novint Falcon, allowed: a device file with `protocol = \"woodenhaptics\"`",
        ),
        (
            ["probe", "falcon", "--model", "falcon"],
            "a Falcon needs its firmware: name the file",
        ),
        (
            ["emulate", "woodenhaptics", "--on", "bus"],
            "--on: found \"bus\", allowed: pty, tcp, tcp:PORT, uhid, usb",
        ),
        (
            ["emulate", "falcon", "--on", "usb"],
            "name the file of the scene by --firmware FILE",
        ),
    ] {
        let result = palpate(&["device"])
            .args(arguments)
            .output()
            .expect("the program runs");
        let said = String::from_utf8_lossy(&result.stderr).into_owned();
        assert!(
            !result.status.success() && said.contains(expected),
            "{said}"
        );
    }
    let listed = palpate(&["device", "list"])
        .output()
        .expect("the program runs");
    assert!(listed.status.success(), "{listed:?}");
}
