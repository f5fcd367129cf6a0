//! What the summary of a run says, against the log of the same run.

use host::engine::faults::{FaultKind, HostFault};
use host::log::Log;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use std::collections::BTreeMap;
use std::error::Error;

const STRETCH: &str = include_str!("../../scenes/stretch.toml");

/// The built-in scene with pieces of its text replaced.
fn with(changes: &[(&str, &str)]) -> Result<LoadedScene, Box<dyn Error>> {
    let mut text = STRETCH.to_owned();
    for (piece, instead) in changes {
        assert!(text.contains(piece), "{piece} is not in the scene");
        text = text.replace(piece, instead);
    }
    Ok(Scene::load_texts("x.toml", &text, &BTreeMap::new())?)
}

/// Runs a scene for `duration` seconds with faults of the host, and reads its log.
// A controller takes half a megabyte and passes over the stack when it is made. A frame of its own keeps it out of the
// frame of a test.
#[inline(never)]
fn logged(
    scene: &LoadedScene,
    clock: Clock,
    duration: f64,
    faults: &[(FaultKind, f64, f64)],
) -> Result<(RunSummary, Log), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let fault = |&(kind, at, duration): &_| HostFault { kind, at, duration };
    let options = RunOptions {
        duration: Some(duration),
        log: Some(path.clone()),
        faults: faults.iter().map(fault).collect(),
        ..RunOptions::new(clock)
    };
    let summary = run(&World::new(scene).unwrap(), &options, &mut |_| {})?;
    let log = Log::parse(&std::fs::read(&path)?)?;
    Ok((summary, log))
}

#[test]
fn a_force_that_the_cap_holds_back_is_told_with_its_size_and_time() -> Result<(), Box<dyn Error>> {
    // After a long stall the sheet claims energy that the hands have not supplied.
    let scene = with(&[])?;
    let stall = [(FaultKind::Stall, 1.5, 2.8)];
    let (summary, log) = logged(&scene, Clock::Virtual, 6.0, &stall)?;
    let capped = summary.held_back.iter().find(|held| held.cause == "cap");
    let capped = capped.ok_or("the cap held nothing back")?;
    // The log has the force that the cap withholds in each tick. Trust in the model scales it.
    let smooth = |x: f64| x * x * (3.0 - 2.0 * x);
    let mut sum = 0.0;
    let mut ticks = 0;
    let mut most = (0.0, 0.0);
    for row in &log.rows {
        let body = &row.bodies[0];
        let [force, of] = [body.withheld.force, body.withheld.of].map(|f| f * smooth(body.trust));
        if force > 0.02_f64.max(0.01 * of) {
            ticks += 1;
            sum += force;
            if force > most.0 {
                most = (force, row.time_ns as f64 * 1e-9);
            }
        }
    }
    println!("{capped:?}");
    assert!(ticks > 10, "{ticks}");
    // The trust of a tick's record is that of its wrench. Rounding moves ticks across the threshold.
    assert!(
        capped.ticks.abs_diff(ticks) <= 1,
        "{} {ticks}",
        capped.ticks
    );
    assert!((capped.mean - sum / ticks as f64).abs() < 1e-2 * capped.mean);
    assert!((capped.most - most.0).abs() < 1e-9 && (capped.most_time - most.1).abs() < 1e-9);
    assert!((capped.duration - 1e-3 * capped.ticks as f64).abs() < 1e-9);
    let printed = summary.to_string();
    assert!(
        printed.contains("  held back  sheet: for ") && printed.contains("the cap lets a body"),
        "{printed}"
    );
    Ok(())
}

#[test]
fn a_run_whose_forces_all_pass_holds_nothing_back() -> Result<(), Box<dyn Error>> {
    let (summary, _) = logged(&with(&[])?, Clock::Virtual, 1.0, &[])?;
    assert_eq!(summary.held_back, []);
    assert!(!summary.to_string().contains("held back"));
    Ok(())
}

/// The controller knows the work on the hand by its commands and by the counts of the encoder. The simulation integrates
/// it between ticks.
#[test]
fn the_work_is_that_on_the_hand_whatever_the_scale_of_motions() -> Result<(), Box<dyn Error>> {
    let scene = with(&[("motion_scale = 1.0", "motion_scale = 0.5")])?;
    let scales = scene.scene.devices.iter().map(|device| device.motion_scale);
    assert_eq!(scales.collect::<Vec<_>>(), [0.5, 1.0]);
    let (summary, _) = logged(&scene, Clock::Virtual, 2.0, &[])?;
    for device in &summary.devices {
        let integrated = device.motor_work.ok_or("a simulated device")?;
        assert!(integrated.abs() > 1e-3, "{integrated}");
        // A force that is held over a tick is late by half a tick.
        assert!(
            (device.work / integrated - 1.0).abs() < 0.05,
            "{}: {} {integrated}",
            device.name,
            device.work
        );
    }
    Ok(())
}

#[test]
fn the_energy_line_adds_up() -> Result<(), Box<dyn Error>> {
    let (summary, log) = logged(&with(&[])?, Clock::Virtual, 2.0, &[])?;
    let energy = &summary.energy[0];
    let (stored, dissipated) = (
        energy.stored.ok_or("capped stores")?,
        energy.dissipated.ok_or("capped stores")?,
    );
    let balance = energy.supplied + energy.initial - energy.raised - stored - dissipated;
    assert!(balance.abs() < 1e-15 + 1e-12 * energy.supplied.abs());
    let last = &log.rows.last().ok_or("rows")?.bodies[0].energy;
    assert_eq!(
        (energy.credited, energy.initial),
        (last.credited, last.initial)
    );
    // As printed: the terms of one line, each rounded to a tenth of a millijoule.
    let printed = summary.to_string();
    let line = printed.lines().find(|line| line.starts_with("  energy"));
    let line = line.ok_or("an energy line")?;
    let numbers: Vec<f64> = line
        .split_whitespace()
        .filter(|word| word.starts_with(['+', '-']))
        .map(str::parse)
        .collect::<Result<_, _>>()?;
    let [supplied, initial, raised, stored, dissipated] = numbers[..] else {
        return Err(format!("five terms in {line}").into());
    };
    assert!(
        (supplied + initial - raised - stored - dissipated).abs() < 0.26,
        "{line}"
    );
    assert!(printed.contains("of the devices' own losses credited"));
    Ok(())
}

#[test]
fn the_counts_of_a_host_that_panics_are_those_before_the_panic() -> Result<(), Box<dyn Error>> {
    let scene = with(&[])?;
    let (whole, _) = logged(&scene, Clock::Virtual, 1.0, &[])?;
    let panic = [(FaultKind::Panic, 1.0, 0.0)];
    let (summary, log) = logged(&scene, Clock::Virtual, 1.5, &panic)?;
    assert_eq!(summary.tick.count, 1500);
    assert!(summary.failures[0].starts_with("the host panicked"));
    // The step that was due at 1 s did not begin.
    assert_eq!(summary.host.publications, whole.host.publications);
    assert_eq!(summary.host.steps, whole.host.steps);
    assert_eq!(summary.host.iterations, whole.host.iterations);
    assert_eq!(summary.host.solvers, whole.host.solvers);
    assert!(summary.host.publications > 200 && !log.models.is_empty());
    Ok(())
}

#[test]
fn under_the_real_clock_the_counts_before_a_panic_are_kept_too() -> Result<(), Box<dyn Error>> {
    let panic = [(FaultKind::Panic, 1.0, 0.0)];
    // Without all optimizations, moves of the controller fill the stack of a test. The stack of a program is this large.
    let scene = with(&[])?;
    let (summary, log) = std::thread::scope(|scope| {
        let real = || logged(&scene, Clock::Real, 1.5, &panic).map_err(|e| e.to_string());
        let thread = std::thread::Builder::new().stack_size(8 << 20);
        let thread = thread.spawn_scoped(scope, real).expect("a thread");
        thread.join().expect("the run does not panic")
    })?;
    assert!(summary.failures[0].starts_with("the host panicked"));
    // The number of steps depends on the machine.
    assert!(summary.host.steps > 0 && !summary.host.solvers.is_empty());
    let newest = log.rows.iter().map(|row| row.bodies[0].sequence).max();
    assert!(summary.host.publications >= newest.ok_or("rows")?);
    Ok(())
}

/// A block above another one, which hands hold: nothing moves until the second hand does.
const APART: &str = r#"name = "apart"
gravity = [0.0, 0.0, 0.0]

[[body]]
name = "low"
mesh.box = { size = [0.04, 0.04, 0.04], cells = [4, 4, 4] }
position = [0, 0, -0.02003]
material = { young = 20000.0, poisson = 0.3, density = 1000 }
damping = { mass = 0.0, stiffness = 0.005 }

[[body.handle]]
name = "bottom"
group = "bottom"
device = "a"

[[body]]
name = "high"
mesh.box = { size = [0.04, 0.04, 0.04], cells = [3, 3, 3] }
position = [0, 0, 0.02003]
material = { young = 20000.0, poisson = 0.3, density = 1000 }
damping = { mass = 0.0, stiffness = 0.005 }

[[body.handle]]
name = "top"
group = "top"
device = "b"

[[contact]]
between = ["low", "high"]
friction = 0.3

[[device]]
name = "a"
model = "omega3"
hand = { grip = "rigid", waypoints = [[0.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]] }

[[device]]
name = "b"
model = "omega3"
hand = { grip = "rigid", waypoints = [[0.2, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -0.004]] }
"#;

#[test]
fn forces_that_are_rounding_leave_no_residual() -> Result<(), Box<dyn Error>> {
    let scene = Scene::load_texts("x.toml", APART, &BTreeMap::new())?;
    let (summary, _) = logged(&scene, Clock::Virtual, 0.6, &[])?;
    let host = &summary.host;
    assert_eq!(host.unconverged_steps, 0, "{}", host.worst_residual);
    assert!(host.worst_residual <= 1e-6, "{}", host.worst_residual);
    Ok(())
}

/// A cube of half a millimetre presses with a millionth of a newton.
#[test]
fn small_forces_of_contacts_are_told_with_their_digits() -> Result<(), Box<dyn Error>> {
    let text = r#"name = "small"

[[obstacle]]
name = "floor"
shape = "plane"

[[body]]
name = "cube"
mesh.box = { size = [0.0005, 0.0005, 0.0005], cells = [2, 2, 2] }
position = [0, 0, 0.00026]
material = { young = 50000.0, poisson = 0.3, density = 1000 }
damping = { mass = 0.0, stiffness = 0.005 }

[[device]]
name = "idle"
model = "falcon"
hand = {}
"#;
    let scene = Scene::load_texts("x.toml", text, &BTreeMap::new())?;
    let (summary, _) = logged(&scene, Clock::Virtual, 0.5, &[])?;
    let text = summary.to_string();
    // The weight is 1.226 uN.
    assert!(
        text.contains("cube with floor: 9 at the end, normal 1.22"),
        "{text}"
    );
    assert!(
        text.contains(" uN, friction ") && text.contains(" taken by contacts"),
        "{text}"
    );
    Ok(())
}
