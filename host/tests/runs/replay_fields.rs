//! A replay compares every field of every tick: a difference planted in any field is found and named.

use host::log::Log;
use host::record::TickRow;
use host::record::field::{Each, Leaf, Record, name};
use host::run::replay::{ReplayError, ReplayReport, replay, scene_of};
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::coupling::HostState;
use rt_core::record::BodyTelemetry;
use rt_core::safety::SafetyState;
use std::error::Error;

type Outcome = Result<(), Box<dyn Error>>;

/// The change of a number.
#[derive(Clone, Copy, Debug)]
enum Bit {
    /// The last bit: the smallest possible difference.
    Last,
    /// The sign: a zero then still equals itself as a number.
    Sign,
}

fn change(leaf: Leaf<'_>, bit: Bit) {
    match leaf {
        Leaf::Number(x) => {
            let mask = match bit {
                Bit::Last => 1,
                Bit::Sign => 1 << 63,
            };
            *x = f64::from_bits(x.to_bits() ^ mask);
        }
        Leaf::Count(n) => *n ^= 1,
        Leaf::Small(n) => *n ^= 1,
        Leaf::Byte(n) => *n ^= 1,
        Leaf::Flag(flag) => *flag = !*flag,
        Leaf::Safety(state) => {
            *state = match state {
                SafetyState::Slewed => SafetyState::TooFast,
                _ => SafetyState::Slewed,
            }
        }
        Leaf::Host(state) => {
            *state = match state {
                HostState::Held => HostState::Fading,
                _ => HostState::Held,
            }
        }
    }
}

/// Gives every output field of a tick to `see`, with its name in a replay.
fn outputs(row: &mut TickRow, see: &mut impl FnMut(String, Leaf<'_>)) {
    let mut part = |part: String, record: &mut dyn FnMut(&mut Named<'_>)| {
        record(&mut |line, component, leaf| {
            let dot = if component.is_empty() { "" } else { "." };
            // With another number of the model in use, the log would lack the model.
            if name(line) != "sequence" {
                see(format!("{part} {}{dot}{component}", name(line)), leaf);
            }
        });
    };
    for (index, device) in row.devices.iter_mut().enumerate() {
        part(format!("device {index}"), &mut |named| {
            device.fields(&mut Each(named)).expect("all fields");
        });
    }
    for (index, body) in row.bodies.iter_mut().enumerate() {
        part(format!("body {index}"), &mut |named| {
            body.fields(&mut Each(named)).expect("all fields");
        });
    }
}

/// Takes the line of a field, a component and a number.
type Named<'a> = dyn FnMut(&'static str, &'static str, Leaf<'_>) + 'a;

/// A short run of the built-in scene with a model in use, and the scene.
fn logged() -> Result<(Log, LoadedScene), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(0.06),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(
        &World::new(&Scene::embedded_default()?).unwrap(),
        &options,
        &mut |_| {},
    )?;
    let log = Log::parse(&std::fs::read(path)?)?;
    let scene = scene_of(&log, "a log")?;
    Ok((log, scene))
}

/// The tick in which differences are planted.
const STRUCK: usize = 41;

#[test]
fn a_difference_in_any_field_is_found_and_named() -> Outcome {
    let (mut log, scene) = logged()?;
    let replayed = |log: &Log| replay(log, &scene, &mut |_| {});
    assert!(replayed(&log)?.is_exact());
    let whole = log.rows[STRUCK].clone();
    let mut names = Vec::new();
    outputs(&mut log.rows[STRUCK], &mut |name, _| names.push(name));
    // Two devices of at least 7 + 6 + 6 + 4 numbers and 4 others, and one body of 14.
    assert!(names.len() >= 2 * (7 + 6 + 6 + 4 + 4) + 14);
    for bit in [Bit::Last, Bit::Sign] {
        for name in &names {
            log.rows[STRUCK] = whole.clone();
            outputs(&mut log.rows[STRUCK], &mut |found, leaf| {
                if found == *name {
                    change(leaf, bit);
                }
            });
            let ReplayReport {
                differing, first, ..
            } = replayed(&log)?;
            let found = first.map_or("nothing".into(), |first| first.to_string());
            let expected = format!("tick {STRUCK} (0.041 s): {name}: log ");
            assert!(found.starts_with(&expected), "{name} ({bit:?}): {found}");
            assert_eq!(differing, 1, "{name} ({bit:?})");
        }
    }
    Ok(())
}

#[test]
fn a_device_or_a_body_too_many_is_found() -> Outcome {
    let (whole, scene) = logged()?;
    let first = |log: &Log| -> Result<String, ReplayError> {
        let report = replay(log, &scene, &mut |_| {})?;
        Ok(report.first.map_or("nothing".into(), |f| f.to_string()))
    };
    let mut log = whole.clone();
    log.rows[STRUCK].devices.pop();
    assert!(first(&log)?.contains(": devices: log 1, now 2"));
    let mut log = whole;
    for row in &mut log.rows[STRUCK..] {
        let body = row.bodies[0];
        row.bodies.push(BodyTelemetry {
            sequence: 0,
            ..body
        });
    }
    assert!(first(&log)?.contains(": bodies: log 2, now 1"));
    Ok(())
}

#[test]
fn another_number_of_a_tick_or_a_model_is_refused() -> Outcome {
    let (whole, scene) = logged()?;
    let mut log = whole.clone();
    log.rows[STRUCK].tick ^= 1;
    assert!(matches!(
        replay(&log, &scene, &mut |_| {}),
        Err(ReplayError::MissingTick { expected: 41, .. })
    ));
    let mut log = whole;
    log.rows[STRUCK].bodies[0].sequence += 1000;
    assert!(matches!(
        replay(&log, &scene, &mut |_| {}),
        Err(ReplayError::MissingModel { tick: 41, .. })
    ));
    Ok(())
}
