//! Hosts that are late, and quick ones: at every rate and latency a hand that shakes a soft block feels the block's own
//! stiffness and viscosity, and no step is left out.

use host::log::Log;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use std::collections::BTreeMap;
use std::error::Error;

/// Frequency of the hand (Hz).
const FREQUENCY: f64 = 4.0;
/// Static stiffness of the block along x (N/m), by a static solve.
const STIFFNESS: f64 = 111.0;

/// What a hand feels of the block at [`FREQUENCY`]: stiffness over the static stiffness, and viscosity over it (s).
fn felt(
    damping: f64,
    scheme: &str,
    [steps, publications, latency]: [f64; 3],
) -> Result<(f64, f64), Box<dyn Error>> {
    let text = format!(
        "name = 'shaken'
duration = 2.5
loop.scheme = '{scheme}'
host = {{ step_rate = {steps:?}, publish_rate = {publications:?}, latency = {latency:?} }}
[[body]]
name = 'b'
damping = {{ mass = 0.5, stiffness = {damping:?} }}
mesh.box = {{ size = [0.04, 0.04, 0.02], cells = [5, 5, 3] }}
material = {{ law = 'corotational', young = 5e3, poisson = 0.45, density = 1000 }}
[[body.support]]
name = 's'
group = 'bottom'
[[body.handle]]
name = 'h'
box = [[-0.013, -0.013, 0.0099], [0.013, 0.013, 0.0101]]
device = 'd'
[[device]]
name = 'd'
model = 'pantograph'
[device.hand]
grip = 'typical'
sines = [{{ amplitude = [0.008, 0.004, 0], frequency = {FREQUENCY:?}, phase = 0.0 }}]
"
    );
    let loaded = Scene::load_texts("shaken.toml", &text, &BTreeMap::new())?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(&loaded).unwrap(), &options, &mut |_| {})?;
    assert_eq!(summary.host.skipped_steps, 0, "{steps} {latency}");
    let log = Log::parse(&std::fs::read(path)?)?;
    // The ratio of force and displacement at the frequency, over the last two seconds: a whole number of periods.
    let omega = 2.0 * core::f64::consts::PI * FREQUENCY;
    let [mut x, mut f] = [[0.0; 2]; 2];
    for row in log.rows.iter().skip(log.rows.len() - 2000) {
        let (sin, cos) = (omega * row.time_ns as f64 * 1e-9).sin_cos();
        let state = row.readings[0]
            .reading()
            .map_err(|error| format!("{error:?}"))?;
        let position = state.pose.position.x;
        let force = row.devices[0].wrench.force.x;
        for (sum, number) in [(&mut x, position), (&mut f, force)] {
            sum[0] += number * cos;
            sum[1] -= number * sin;
        }
    }
    // -F / X as complex numbers.
    let square = x[0] * x[0] + x[1] * x[1];
    let real = -(f[0] * x[0] + f[1] * x[1]) / square;
    let imaginary = -(f[1] * x[0] - f[0] * x[1]) / square;
    Ok((real / STIFFNESS, imaginary / (omega * STIFFNESS)))
}

/// What a hand feels of the block at 4 Hz: the block alone, moved along the felt path by implicit steps of a millisecond
/// (and to 0.001 by steps of an eighth of a millisecond), with a stiffness damping of 1 ms and without.
const DAMPED: (f64, f64) = (1.058, 1.25e-3);
const UNDAMPED: (f64, f64) = (1.059, 0.12e-3);

/// The stiffness is right within 2 %. The viscosity is right within a millisecond, half of which `capped` adds on purpose:
/// it makes up for the half tick for which a device holds a force.
fn judge(felt: (f64, f64), right: (f64, f64), rates: [f64; 3]) {
    let (stiffness, viscosity) = (felt.0 / right.0, felt.1 - right.1);
    assert!((stiffness - 1.0).abs() < 0.02, "{stiffness} {rates:?}");
    assert!(viscosity.abs() < 1e-3, "{viscosity} s {rates:?}");
}

#[test]
fn a_late_host_renders_the_stiffness_and_the_viscosity_of_the_body() -> Result<(), Box<dyn Error>> {
    for rates in [
        // Before: 1.13 and -0.2 ms, 1.16 and -1.3, 0.86 and -8.9, 0.62 and 9.0, 0.80 and -2.8.
        [1000.0, 250.0, 0.004],
        [1000.0, 125.0, 0.008],
        [1000.0, 250.0, 0.006],
        [1000.0, 1000.0, 0.010],
        [500.0, 100.0, 0.012],
        // Hosts that were right.
        [1000.0, 250.0, 0.003],
        [250.0, 250.0, 0.004],
    ] {
        judge(felt(1e-3, "linear", rates)?, DAMPED, rates);
    }
    Ok(())
}

#[test]
fn a_quick_host_renders_the_stiffness_and_adds_no_viscosity() -> Result<(), Box<dyn Error>> {
    for rates in [
        // Before: 1.023 and 1.4 ms, 1.030 and 1.3, 1.027 and 1.4. At these rates the hand's distance from the filtered path
        // of its handle met the inertia of the body.
        [1000.0, 1000.0, 0.0],
        [500.0, 500.0, 0.0],
        [1000.0, 1000.0, 0.001],
        // Hosts that were right.
        [1000.0, 1000.0, 0.002],
        [250.0, 250.0, 0.004],
    ] {
        judge(felt(0.0, "capped", rates)?, UNDAMPED, rates);
        judge(felt(1e-3, "linear", rates)?, DAMPED, rates);
    }
    Ok(())
}
