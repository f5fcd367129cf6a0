//! The example plug-in, built by the C compiler of the machine, as a device.

use devices::conformance::Suite;
use devices::plugin::{self, Plugins};
use devices::{DeviceModel, Driver, Request};
use rt_core::{Device, DeviceError, Rendering, Vec3, Wrench};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Builds the example; `None` where the machine has no C compiler. Each test has a file of its own.
fn example(test: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("plugin");
    let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{test}.so"));
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
        .arg("-o")
        .args([&library, &folder.join("example.c")])
        .status();
    match built {
        Ok(status) => {
            assert!(status.success(), "the example does not compile");
            Some(library)
        }
        Err(error) => {
            println!("!! SKIPPED: the example plug-in: no C compiler `cc` ({error})");
            None
        }
    }
}

/// Reads until `done` accepts a result. The test ends only when that happens: the thread of the device needs time.
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
    suite.check(|| Box::new(plugin::open(&library, "").expect("it can be opened")));
}

#[test]
fn the_example_moves_under_its_force() {
    let Some(library) = example("moves") else {
        return;
    };
    let mut device = plugin::open(&library, "").expect("it can be opened");
    assert_eq!(device.capabilities().max_force, 5.0);
    // The spring of 50 N/m holds 1 N at 20 mm. Where the machine is busy, the thread commands zero now and then, for an
    // exchange of 1 ms: the mass of 0.1 kg then gets 10 mm/s, and swings by half a millimetre.
    until(&mut device, &push(), |result| {
        result.is_ok_and(|state| {
            (state.pose.position.x - 0.02).abs() < 1e-3 && state.twist.linear.norm() < 0.02
        })
    });
}

#[test]
fn a_plug_in_that_fails_is_a_silent_device() {
    let Some(library) = example("fails") else {
        return;
    };
    let mut device = plugin::open(&library, "nan").expect("it can be opened");
    until(&mut device, &push(), |result| {
        assert!(result.is_err(), "a state that is no number");
        matches!(result, Err(DeviceError::Corrupt(_)))
    });
    let mut device = plugin::open(&library, "lost").expect("it can be opened");
    let lost = Err(DeviceError::Disconnected(19));
    until(&mut device, &push(), |result| *result == lost);
    // It comes back by itself.
    until(&mut device, &push(), Result::is_ok);
    assert_eq!(device.counts().returns(), 1);
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
        let mut device = plugin::open(&library, address).expect("it can be opened");
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
    let mut device = plugin::open(&library, "hang").expect("it can be opened");
    // The ring of wrenches fills, because nobody takes them any more.
    while device.write(0, &push()) != Err(DeviceError::Busy) || device.counts().states() < 100 {
        let _ = device.read(0);
        std::thread::yield_now();
    }
    until(&mut device, &push(), |result| {
        *result == Err(DeviceError::NoReport)
    });
    // Neither the tick nor the end of the run waits for it.
    drop(device);
}

#[test]
fn a_plug_in_that_cannot_be_opened_says_why() {
    let Some(library) = example("refuses") else {
        return;
    };
    let model = DeviceModel::named("falcon").expect("it is carried along");
    let open = |address: &str| {
        let request = Request {
            index: 0,
            model: &model,
            period: 1e-3,
            address,
            firmware: None,
        };
        let driver = Plugins::new(library.parent().expect("a folder"));
        match driver.open(&request) {
            Ok(_) => "open".to_owned(),
            Err(error) => error.to_string(),
        }
    };
    assert_eq!(open("refuses.so"), "open");
    let refused = open("refuses.so:refuse");
    for part in ["refuses.so", "\"refuse\"", "check its power", "error -19"] {
        assert!(refused.contains(part), "{part} in {refused}");
    }
    assert!(open("").starts_with("address: found nothing"));
    let missing = open("missing.so");
    assert!(missing.contains("missing.so cannot be loaded"), "{missing}");
    // A library that is no plug-in.
    let other = Path::new(env!("CARGO_TARGET_TMPDIR")).join("other.so");
    let source = Path::new(env!("CARGO_TARGET_TMPDIR")).join("other.c");
    std::fs::write(&source, "int other(void) { return 1; }\n").expect("a folder of ours");
    let built = Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .args([&other, &source])
        .status();
    assert!(built.is_ok_and(|status| status.success()));
    assert!(open("other.so").contains("is no plug-in for devices"));
}
