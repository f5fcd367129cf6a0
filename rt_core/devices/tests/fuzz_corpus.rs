//! Reads the corpora of the fuzzers again, without fuzzing tools.
//!
//! The least numbers of inputs that reach the rules are half of those of the first corpora.

use fuzz_rules::device;
use std::io;

/// Runs a target on all its inputs. At least `reached` inputs must reach the rules of the target, so that the target
/// does not refuse all inputs at once.
fn replay(target: &str, reached: usize, run: impl Fn(&[u8]) -> usize) -> io::Result<()> {
    let inputs = corpus::inputs(target)?;
    let mut count = 0;
    for input in &inputs {
        // A panic of the target is shown below the name of its input.
        println!("{target}: {}", input.name);
        count += usize::from(run(&input.bytes) > 0);
    }
    let all = inputs.len();
    println!("{target}: {count} of {}", inputs.len());
    assert!(
        count >= reached,
        "{target}: {count} of {all} inputs, expected {reached}"
    );
    Ok(())
}

/// Runs a target of texts. The fuzzer gives it no other bytes.
fn replay_text(target: &str, reached: usize, run: impl Fn(&str) -> usize) -> io::Result<()> {
    replay(target, reached, |bytes| {
        std::str::from_utf8(bytes).map_or(0, &run)
    })
}

#[test]
fn a_device_of_the_firmware_protocol_applies_no_wrench_of_a_hostile_host() -> io::Result<()> {
    replay("firmware_device", 35, device::firmware_device)
}

#[test]
fn the_driver_of_the_firmware_protocol_stands_a_hostile_device() -> io::Result<()> {
    replay("firmware_host", 50, device::firmware_host)
}

#[test]
fn the_driver_of_the_falcon_stands_a_hostile_device() -> io::Result<()> {
    replay("falcon", 130, device::falcon)
}

#[test]
fn the_upload_to_the_falcon_stands_a_hostile_boot_loader() -> io::Result<()> {
    replay("falcon_boot", 90, device::falcon_boot)
}

#[test]
fn the_driver_of_woodenhaptics_stands_a_hostile_device() -> io::Result<()> {
    replay("woodenhaptics", 60, device::woodenhaptics)
}

#[test]
fn the_state_of_a_plug_in_is_a_state_or_refused() -> io::Result<()> {
    replay("plugin_state", 65, device::plugin_state)
}

#[test]
fn connections_are_read_or_refused() -> io::Result<()> {
    replay_text("connection", 50, device::connection)
}

#[test]
fn what_the_kernel_tells_of_a_device_is_read_or_refused() -> io::Result<()> {
    replay_text("sysfs", 50, device::sysfs)
}

#[test]
fn profiles_are_written_again_or_refused() -> io::Result<()> {
    replay_text("profile", 3, device::profile)
}
