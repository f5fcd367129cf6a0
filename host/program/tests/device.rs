//! `palpate device`: an emulated device, found by its connection, probed, and held in a run under the real clock.

use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

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
    let mut child = palpate(&["device", "emulate", model, "--on", on, "--tremor", "0.0005"])
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
    assert!(result.status.success(), "{result:?}");
    let probed = json(&file("probe.json"));
    assert_eq!(probed["ticks"], 2000);
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
