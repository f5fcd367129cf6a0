//! A replay compares every field of every tick: a difference planted in any field is found and named.
//!
//! The fields are listed by destructuring the records without `..`. A field that is added to a record and not to this
//! list is a compile error.

use host::log::Log;
use host::record::TickRow;
use host::run::replay::{ReplayError, ReplayReport, replay, scene_of};
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::coupling::HostState;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::safety::SafetyState;
use rt_core::{EnergyAccount, Pose, Twist, Vec3, Withheld, Wrench};
use std::error::Error;

type Outcome = Result<(), Box<dyn Error>>;

/// A field of a record, to be changed.
enum Leaf<'a> {
    Number(&'a mut f64),
    Count(&'a mut u64),
    Small(&'a mut u32),
    Flag(&'a mut bool),
    Safety(&'a mut SafetyState),
    Host(&'a mut HostState),
}

/// The change of a number.
#[derive(Clone, Copy, Debug)]
enum Bit {
    /// The last bit: the smallest possible difference.
    Last,
    /// The sign: a zero then still equals itself as a number.
    Sign,
}

impl Leaf<'_> {
    fn change(self, bit: Bit) {
        match self {
            Leaf::Number(x) => {
                let mask = match bit {
                    Bit::Last => 1,
                    Bit::Sign => 1 << 63,
                };
                *x = f64::from_bits(x.to_bits() ^ mask);
            }
            Leaf::Count(n) => *n ^= 1,
            Leaf::Small(n) => *n ^= 1,
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
}

fn vector<'a>(name: &str, v: &'a mut Vec3, leaves: &mut Vec<(String, Leaf<'a>)>) {
    for (component, x) in ["x", "y", "z"].iter().zip(v.iter_mut()) {
        leaves.push((format!("{name}.{component}"), Leaf::Number(x)));
    }
}

fn of_device<'a>(
    part: &str,
    device: &'a mut DeviceTelemetry,
    leaves: &mut Vec<(String, Leaf<'a>)>,
) {
    let DeviceTelemetry {
        pose: Pose { position, rotation },
        twist: Twist { linear, angular },
        wrench: Wrench { force, moment },
        slip,
        slip_angle,
        buttons,
        device_time_ns,
        fresh,
        safety,
    } = device;
    vector(&format!("{part} position"), position, leaves);
    let rotation = &mut rotation.as_mut_unchecked().coords;
    for (component, x) in ["x", "y", "z", "w"].iter().zip(rotation.iter_mut()) {
        leaves.push((format!("{part} orientation.{component}"), Leaf::Number(x)));
    }
    for (name, v) in [
        ("linear", linear),
        ("angular", angular),
        ("force", force),
        ("torque", moment),
        ("slip", slip),
    ] {
        vector(&format!("{part} {name}"), v, leaves);
    }
    leaves.push((format!("{part} slip_angle"), Leaf::Number(slip_angle)));
    leaves.push((format!("{part} buttons"), Leaf::Small(buttons)));
    let time = Leaf::Count(device_time_ns);
    leaves.push((format!("{part} device_time_ns"), time));
    leaves.push((format!("{part} fresh"), Leaf::Flag(fresh)));
    leaves.push((format!("{part} safety"), Leaf::Safety(safety)));
}

fn of_body<'a>(part: &str, body: &'a mut BodyTelemetry, leaves: &mut Vec<(String, Leaf<'a>)>) {
    let BodyTelemetry {
        // The number of the model in use. With another number, the log would lack the model.
        sequence: _,
        epoch,
        age_ns,
        trust,
        state,
        withheld: Withheld { force, of },
        energy:
            EnergyAccount {
                supplied,
                raised,
                least,
                initial,
                stored,
                credited,
                available,
                capped,
            },
    } = body;
    leaves.push((format!("{part} epoch"), Leaf::Small(epoch)));
    leaves.push((format!("{part} age_ns"), Leaf::Count(age_ns)));
    leaves.push((format!("{part} state"), Leaf::Host(state)));
    for (name, x) in [
        ("trust", trust),
        ("withheld", force),
        ("of", of),
        ("supplied", supplied),
        ("raised", raised),
        ("least", least),
        ("initial", initial),
        ("stored", stored),
        ("credited", credited),
        ("available", available),
    ] {
        leaves.push((format!("{part} {name}"), Leaf::Number(x)));
    }
    leaves.push((format!("{part} capped"), Leaf::Count(capped)));
}

/// Every output field of a tick, with its name in a replay.
fn leaves(row: &mut TickRow) -> Vec<(String, Leaf<'_>)> {
    let TickRow {
        // The numbers of the tick and the models are compared before the replay.
        tick: _,
        // The inputs of the tick: the replay uses them.
        time_ns: _,
        lateness_ns: _,
        took_ns: _,
        readings: _,
        devices,
        bodies,
    } = row;
    let mut leaves = Vec::new();
    for (index, device) in devices.iter_mut().enumerate() {
        of_device(&format!("device {index}"), device, &mut leaves);
    }
    for (index, body) in bodies.iter_mut().enumerate() {
        of_body(&format!("body {index}"), body, &mut leaves);
    }
    leaves
}

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
    let count = leaves(&mut log.rows[STRUCK]).len();
    // Two devices of 7 + 6 + 6 + 4 numbers and 4 others, one body of 14: the fields of the message definition.
    assert_eq!(count, 2 * (7 + 6 + 6 + 4 + 4) + 14);
    for bit in [Bit::Last, Bit::Sign] {
        for index in 0..count {
            log.rows[STRUCK] = whole.clone();
            let (name, leaf) = leaves(&mut log.rows[STRUCK]).swap_remove(index);
            leaf.change(bit);
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
