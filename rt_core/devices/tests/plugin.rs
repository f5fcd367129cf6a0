//! Plug-ins, built by the C compiler of the machine, as devices. The process of a plug-in is the program `palpate-plugin`.

use devices::conformance::Suite;
use devices::plugin::Plugins;
use devices::registry::Notes;
use devices::{DeviceModel, Exchanged, Registry, Request};
use rt_core::{Device, DeviceError, Rendering, Vec3, Wrench};
use std::path::{Path, PathBuf};
use std::process::Command;

const FOLDER: &str = env!("CARGO_TARGET_TMPDIR");

/// Builds a C source; `None` if the machine has no C compiler. Each test has a file of its own.
fn build(test: &str, source: &Path) -> Option<PathBuf> {
    let library = Path::new(FOLDER).join(format!("{test}.so"));
    let built = Command::new("cc")
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-pedantic",
            "-O1",
            "-shared",
            "-fPIC",
        ])
        .arg("-I")
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("plugin"))
        .arg("-o")
        .args([&library, source])
        .status();
    match built {
        Ok(status) => {
            assert!(status.success(), "the plug-in does not compile");
            Some(library)
        }
        Err(error) => {
            println!("!! SKIPPED: a plug-in: no C compiler `cc` ({error})");
            None
        }
    }
}

/// Builds the example.
fn example(test: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("plugin");
    build(test, &folder.join("example.c"))
}

/// Builds a plug-in that runs `loaded` when it is loaded, `open` when it opens a device and `exchange` in each exchange. It
/// states the capabilities in `states`, which `open` may change. The static `exchanges` counts the exchanges of a process.
fn made(test: &str, [loaded, open, exchange]: [&str; 3]) -> Option<PathBuf> {
    let source = Path::new(FOLDER).join(format!("{test}.c"));
    let text = format!(
        r#"
#define _POSIX_C_SOURCE 200809L
#include "palpate_device.h"
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
struct palpate_device {{ int unused; }};
static struct palpate_device one;
static int exchanges;
static char mark[512]; /* a file that is made when the device is closed, if `open` names one */
static void nap(void) {{ struct timespec ms = {{0, 1000000}}; nanosleep(&ms, NULL); }}
static void hang(void) {{ for (;;) nap(); }}
static int opened(const char *address, palpate_device **device, palpate_capabilities *states, char *message, size_t length) {{
    (void)address; (void)message; (void)length; (void)hang;
    states->sensed = states->actuated = 7;
    states->max_force = 8.0;
    states->workspace_radius = 0.05;
    states->position_step = 1e-5;
    {open}
    *device = &one;
    return PALPATE_OK;
}}
static int exchanged(palpate_device *device, const palpate_wrench *wrench, palpate_state *state) {{
    (void)device; (void)wrench;
    nap();
    exchanges += 1;
    memset(state, 0, sizeof *state);
    state->orientation[0] = 1.0;
    state->position[0] = wrench->force[0] * 1e-3;
    state->time_ns = exchanges * 1000000u;
    {exchange}
    return PALPATE_OK;
}}
static void closed(palpate_device *device) {{
    (void)device;
    FILE *file = mark[0] ? fopen(mark, "w") : NULL;
    if (file) fclose(file);
}}
const palpate_plugin *palpate_plugin_entry(void) {{
    static const palpate_plugin plugin = {{PALPATE_DEVICE_ABI, 0, "made", opened, exchanged, closed}};
    {loaded}
    return &plugin;
}}
"#
    );
    std::fs::write(&source, text).expect("a folder of ours");
    build(test, &source)
}

/// The driver, in the folder of these libraries.
fn driver() -> Plugins {
    Plugins::new(FOLDER).served_by(env!("CARGO_BIN_EXE_palpate-plugin"))
}

fn falcon() -> DeviceModel {
    DeviceModel::named("falcon").expect("it is carried along")
}

/// Opens the device of a library with the profile of the Falcon.
fn open(library: &Path, address: &str) -> Result<Exchanged, String> {
    let address = format!("{}:{address}", library.display());
    let opened = driver().connect(&Request::new(&falcon(), &address));
    opened.map_err(|error| error.to_string())
}

fn opened(library: &Path, address: &str) -> Exchanged {
    open(library, address).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(library: &Path) -> String {
    open(library, "").map(drop).expect_err("it is refused")
}

/// Reads until `done` accepts a result. The test waits without a limit, because the thread of the device needs time.
fn until(
    device: &mut impl Device,
    wrench: &Wrench,
    done: impl Fn(&Result<rt_core::DeviceState, DeviceError>) -> bool,
) {
    loop {
        let result = device.read(0);
        if done(&result) {
            return;
        }
        let _ = device.write(0, wrench);
        std::thread::yield_now();
    }
}

fn push() -> Wrench {
    Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    }
}

#[test]
fn the_example_conforms() {
    let Some(library) = example("conforms") else {
        return;
    };
    // A state comes when the thread of the device has had time, so no number of states is certain.
    let suite = Suite::new("plugin").states(0);
    suite.check(|| Box::new(opened(&library, "")));
}

#[test]
fn the_example_moves_under_its_force() {
    let Some(library) = example("moves") else {
        return;
    };
    let mut device = opened(&library, "");
    // The spring of 50 N/m holds 1 N at 20 mm. If the machine is busy, the thread commands zero now and then, for an
    // exchange of 1 ms: the mass of 0.1 kg then gets 10 mm/s, and swings by half a millimetre.
    until(&mut device, &push(), |result| {
        result.is_ok_and(|state| {
            (state.pose.position.x - 0.02).abs() < 1e-3 && state.twist.linear.norm() < 0.02
        })
    });
}

/// The example states 5 N, and the profile of the Falcon 8 N.
#[test]
fn the_lower_limit_holds_and_is_told() {
    let Some(library) = example("limits") else {
        return;
    };
    let address = library.display().to_string();
    let held = |model: &DeviceModel, name: &str| {
        let notes = Notes::default();
        let request = Request {
            name,
            notes: Some(&notes),
            ..Request::new(model, &address)
        };
        let device = driver()
            .connect(&request)
            .unwrap_or_else(|error| panic!("{error}"));
        (device.capabilities(), notes.into_vec())
    };
    let (found, notes) = held(&falcon(), "example");
    assert_eq!(
        (found.max_force, found.workspace_radius),
        (5.0, falcon().workspace_radius)
    );
    let told = "the device \"example\" states a largest force of 5 N, and its profile 8 N: the lower limit holds";
    assert_eq!(notes, [told]);
    // The limit of the profile is the lower one.
    let weak = DeviceModel {
        max_force: 3.0,
        ..falcon()
    };
    let (found, notes) = held(&weak, "Example");
    assert_eq!((found.max_force, notes), (3.0, vec![]));
    // An unknown name is reported.
    let (_, notes) = held(&weak, "Novint Falcon");
    assert!(
        notes.len() == 1 && notes[0].contains("\"example\"") && notes[0].contains("Novint Falcon"),
        "{notes:?}"
    );
}

#[test]
fn a_plug_in_that_states_another_device_is_refused() {
    for (test, open, part) in [
        (
            "weak",
            "states->max_force = 0.1;",
            "is 0.1 N, and that of its profile 8 N",
        ),
        (
            "planar",
            "states->sensed = states->actuated = 3;",
            "senses the axes x y, and its profile x y z",
        ),
        (
            "turning",
            "states->sensed = states->actuated = 15; states->max_moment = 1.0;",
            "senses the axes x y z rx ry rz, and its profile x y z",
        ),
        (
            "passive",
            "states->actuated = 4;",
            "actuates the axes z, and its profile x y z",
        ),
        (
            "far",
            "states->workspace_radius = 1e300;",
            "has a radius of 1e300 m",
        ),
        (
            "near",
            "states->workspace_radius = 1e-9;",
            "has a radius of 1e-9 m",
        ),
    ] {
        let Some(library) = made(test, ["", open, ""]) else {
            return;
        };
        let text = refused(&library);
        for part in [part, "another device's profile", test] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }
}

#[test]
fn a_plug_in_that_fails_is_a_silent_device() {
    let Some(library) = example("fails") else {
        return;
    };
    let mut device = opened(&library, "nan");
    until(&mut device, &push(), |result| {
        assert!(result.is_err(), "a state that is no number");
        matches!(result, Err(DeviceError::Corrupt(_)))
    });
    let mut device = opened(&library, "lost");
    let lost = Err(DeviceError::Disconnected(19));
    until(&mut device, &push(), |result| *result == lost);
    // It comes back by itself.
    until(&mut device, &push(), Result::is_ok);
}

#[test]
fn a_plug_in_tells_that_its_device_let_go_or_has_a_fault() {
    let Some(library) = example("tells") else {
        return;
    };
    for (address, expected) in [
        ("release", Rendering::LetGo),
        ("fault", Rendering::Fault(7)),
    ] {
        let mut device = opened(&library, address);
        until(&mut device, &push(), |result| {
            result.is_ok_and(|state| state.rendering == Rendering::Commanded)
        });
        until(&mut device, &push(), |result| {
            result.is_ok_and(|state| state.rendering == expected)
        });
    }
}

#[test]
fn a_plug_in_that_hangs_is_silent_and_holds_up_nobody() {
    let Some(library) = example("hangs") else {
        return;
    };
    let mut device = opened(&library, "hang");
    // The ring of wrenches fills, because no thread takes them any more.
    while device.write(0, &push()) != Err(DeviceError::Busy) {
        let _ = device.read(0);
        std::thread::yield_now();
    }
    until(&mut device, &push(), |result| {
        *result == Err(DeviceError::NoReport)
    });
    // After a second its process is ended, and the device is opened again.
    until(&mut device, &push(), |result| {
        matches!(result, Err(DeviceError::Disconnected(110)))
    });
    until(&mut device, &push(), Result::is_ok);
    // Neither the tick nor the end of the run waits for the plug-in.
    drop(device);
}

/// The device of a process that ended is lost, and a new process opens it again. The other device continues.
#[test]
fn a_plug_in_that_ends_its_process_ends_no_run() {
    let endings = [
        ("exits", "if (exchanges > 20) exit(0);"),
        ("exits_at_once", "if (exchanges > 20) _exit(3);"),
        ("aborts", "if (exchanges > 20) abort();"),
        (
            "crashes",
            "volatile int *none = NULL; if (exchanges > 20) *none = 1;",
        ),
        ("is_killed", "if (exchanges > 20) raise(SIGKILL);"),
    ];
    let Some(sound) = made("sound", ["", "", ""]) else {
        return;
    };
    let mut other = opened(&sound, "");
    for (test, exchange) in endings {
        let Some(library) = made(test, ["", "", exchange]) else {
            return;
        };
        let mut device = opened(&library, "");
        until(&mut device, &push(), Result::is_ok);
        until(&mut device, &push(), |result| {
            matches!(result, Err(DeviceError::Disconnected(19)))
        });
        until(&mut device, &push(), Result::is_ok);
        until(&mut other, &push(), |result| {
            assert!(
                !matches!(result, Err(DeviceError::Disconnected(_))),
                "{test}"
            );
            result.is_ok()
        });
    }
}

#[test]
fn a_plug_in_that_ends_its_process_while_it_opens_is_told() {
    for (test, loaded, open, how) in [
        ("exits_loaded", "exit(7);", "", "exit status: 7"),
        ("exits_opening", "", "exit(0);", "exit status: 0"),
        ("aborts_opening", "", "abort();", "signal: 6"),
        (
            "crashes_opening",
            "",
            "volatile int *none = NULL; *none = 1;",
            "signal: 11",
        ),
    ] {
        let Some(library) = made(test, [loaded, open, ""]) else {
            return;
        };
        let text = refused(&library);
        for part in [how, test, "ended its process"] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }
}

#[test]
fn a_plug_in_that_hangs_while_it_opens_is_told_and_ended() {
    let Some(library) = made("hangs_opening", ["", "hang();", ""]) else {
        return;
    };
    let text = refused(&library);
    assert!(
        text.contains("hangs_opening.so has neither opened its device nor refused within 10 s"),
        "{text}"
    );
}

/// A run that is killed leaves no process behind, not even that of a plug-in that hangs.
#[test]
fn the_process_of_a_plug_in_ends_with_its_run() {
    use std::io::Read;
    use std::os::fd::OwnedFd;
    let Some(library) = made("hangs_for_ever", ["", "hang();", ""]) else {
        return;
    };
    // The socket of a run that has ended.
    let (near, far) = std::os::unix::net::UnixStream::pair().expect("a socket");
    let mut served = Command::new(env!("CARGO_BIN_EXE_palpate-plugin"))
        .arg("serve-plug-in")
        .arg(library)
        .arg("")
        .arg("45")
        .stdin(OwnedFd::from(far))
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("it runs");
    drop(near);
    // The standard output ends with the process.
    let mut said = String::new();
    let mut output = served.stdout.take().expect("it is piped");
    output.read_to_string(&mut said).expect("it ends");
    let status = served.wait().expect("it ended");
    assert!(!status.success(), "{status}");
}

#[test]
fn a_file_that_is_cut_off_is_told() {
    let Some(library) = example("whole") else {
        return;
    };
    let whole = std::fs::read(&library).expect("it was built");
    let cut = Path::new(FOLDER).join("cut.so");
    // From nothing to half: no part of a library is enough.
    for length in [
        0,
        1,
        63,
        64,
        200,
        1000,
        4096,
        whole.len() / 3,
        whole.len() / 2,
    ] {
        std::fs::write(&cut, &whole[..length.min(whole.len() / 2)]).expect("a folder of ours");
        let text = refused(&cut);
        assert!(text.contains("cut.so"), "{length}: {text}");
    }
}

#[test]
fn a_plug_in_that_changes_its_folder_changes_no_other() {
    let Some(library) = made("moves_away", ["if (chdir(\"/\")) abort();", "", ""]) else {
        return;
    };
    let folder = std::env::current_dir().expect("a folder");
    let mut device = opened(&library, "");
    until(&mut device, &push(), Result::is_ok);
    assert_eq!(std::env::current_dir().expect("a folder"), folder);
}

/// The process of a plug-in that comes back states something else.
#[test]
fn a_plug_in_that_comes_back_as_another_device_stays_lost() {
    for (test, other) in [
        ("back_planar", "states->sensed = states->actuated = 3;"),
        ("back_passive", "states->actuated = 3;"),
        ("back_weaker", "states->max_force = 7.0;"),
        ("back_far", "states->workspace_radius = 1e300;"),
    ] {
        let marker = Path::new(FOLDER).join(format!("{test}.opened"));
        let _ = std::fs::remove_file(&marker);
        // The file has a letter for each attempt to open the device. Without the file the device is itself.
        let open = format!(
            "FILE *marker = fopen(address, \"r\"); if (marker != NULL) {{ fclose(marker); {other} }} \
             marker = fopen(address, \"a\"); if (marker != NULL) {{ fputc('x', marker); fclose(marker); }}"
        );
        let Some(library) = made(test, ["", &open, "if (exchanges > 5) return -5;"]) else {
            return;
        };
        let mut device = opened(&library, &marker.display().to_string());
        until(&mut device, &push(), Result::is_ok);
        until(&mut device, &push(), |result| {
            matches!(result, Err(DeviceError::Disconnected(5)))
        });
        // Some attempts to open it again.
        while std::fs::metadata(&marker).is_ok_and(|marker| marker.len() < 4) {
            assert!(device.read(0).is_err(), "{test}");
            std::thread::yield_now();
        }
        // It comes back when it is itself again.
        std::fs::remove_file(&marker).expect("it was opened");
        until(&mut device, &push(), Result::is_ok);
    }
}

#[test]
fn a_plug_in_that_cannot_be_opened_says_why() {
    let Some(library) = example("refuses") else {
        return;
    };
    let model = falcon();
    let registry = Registry::new().with(driver());
    let open = |address: &str| match registry.open("plugin", &Request::new(&model, address)) {
        Ok(_) => "open".to_owned(),
        Err(error) => error.to_string(),
    };
    assert_eq!(library.parent(), Some(Path::new(FOLDER)));
    assert_eq!(open("refuses.so"), "open");
    let refused = open("refuses.so:refuse");
    for part in ["refuses.so", "\"refuse\"", "check its power", "error -19"] {
        assert!(refused.contains(part), "{part} in {refused}");
    }
    assert!(open("").starts_with("address: found nothing"));
    let missing = open("missing.so");
    assert!(missing.contains("missing.so cannot be loaded"), "{missing}");
    // A library that is no plug-in.
    let source = Path::new(FOLDER).join("other.c");
    std::fs::write(&source, "int other(void);\nint other(void) { return 1; }\n")
        .expect("a folder of ours");
    if build("other", &source).is_some() {
        assert!(open("other.so").contains("is no plug-in for devices"));
    }
}

/// A motor that is not switched off keeps its last current.
#[test]
fn the_end_of_a_run_closes_each_device() {
    let name_the_mark = r#"snprintf(mark, sizeof mark, "%s", address);"#;
    let Some(library) = made("closes", ["", name_the_mark, ""]) else {
        return;
    };
    let marks = ["left", "right"].map(|name| Path::new(FOLDER).join(format!("closed-{name}")));
    for mark in &marks {
        let _ = std::fs::remove_file(mark);
    }
    let [left, right] = marks
        .each_ref()
        .map(|mark| opened(&library, &mark.display().to_string()));
    assert!(marks.iter().all(|mark| !mark.exists()));
    drop(left);
    assert!(marks[0].exists() && !marks[1].exists());
    drop(right);
    assert!(marks[1].exists());
}
