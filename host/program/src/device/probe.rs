//! `palpate device probe`: the states of a device, measured without force, and the delay from a force to the motion.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::super::progress_bar;
use super::super::signals::Ending;
use super::DeviceCommandError;
use super::open::{self, DeviceArguments, Opened};
use devices::DeviceModel;
use devices::response::{Pulses, Response, ResponseError};
use host::atomic_file::write_json;
use host::run::prepare::patience;
use rt_core::{Device, Wrench};
use runner::Stop;
use runner::schedule::realtime;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use study::probe::{Known, Motion, Probed, Seen};

/// Ticks between two positions of the progress bar.
const DRAWN: u64 = 250;

/// Arguments of `palpate device probe`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ProbeArguments {
    #[command(flatten)]
    device: DeviceArguments,
    /// Duration of the measurement (s)
    #[arg(long, value_name = "SECONDS", default_value_t = 3.0, value_parser = super::super::run::seconds)]
    duration: f64,
    /// Also measure the delay from a force to the first motion, by twenty short pulses of at most 1.5 N. Let nobody hold the
    /// device
    #[arg(long)]
    pulse: bool,
    /// Write the result as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(arguments: &ProbeArguments) -> Result<(), CommandError> {
    let ending = Ending::begin(false)?;
    let stop = ending.stop();
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let Opened {
        mut device,
        file,
        identity,
        priority,
    } = open::device(&arguments.device)?;
    let bar = progress_bar();
    let period = Duration::from_millis(1);
    let ticks = (arguments.duration * 1e3).ceil() as u64;
    let mut seen = Seen::new(ticks as usize);
    // The intervals are those of the clock of the device, so a refusal costs states, and no accuracy.
    let _ = realtime(priority);
    let start = Instant::now();
    for tick in 0..ticks {
        let due = period * tick as u32;
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let now = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        seen.take(now, &device.read(now));
        let _ = device.write(now, &Wrench::zero());
        if stop.is_requested() {
            break;
        }
        if tick.is_multiple_of(DRAWN) {
            bar.set_position(1000 * tick / ticks);
        }
    }
    let capabilities = device.capabilities();
    let known = Known {
        profile: file.name.clone(),
        name: identity.as_ref().map(|identity| identity.name.clone()),
        firmware: identity.and_then(|identity| identity.firmware),
        max_force: capabilities.max_force,
        max_moment: capabilities.max_moment,
        workspace_radius: capabilities.workspace_radius,
        position_step: capabilities.position_step,
        profile_rate: f64::from(file.model.rate_hz),
        patience: patience(&file.model, period.as_secs_f64()).into(),
    };
    let tick_rate = 1.0 / period.as_secs_f64();
    let mut probed = Probed::new(&arguments.device.connect, known, tick_rate, &seen);
    let mut unmoved = None;
    if arguments.pulse && probed.states > 0 && !stop.is_requested() {
        match pulses(&mut *device, &file.model, stop) {
            Some(Ok(response)) => probed.motion = Some(Motion::from(response)),
            Some(Err(error)) => unmoved = Some(DeviceCommandError::NoMotion(error.to_string())),
            None => {}
        }
    }
    drop(device);
    bar.finish_and_clear();
    out!("{}", probed.words());
    if let Some(path) = &arguments.json {
        write_json(path, &probed)?;
    }
    ending.result()?;
    if let Some(error) = unmoved {
        return Err(error.into());
    }
    if !probed.problems().is_empty() {
        return Err(DeviceCommandError::NotReady.into());
    }
    Ok(())
}

/// Moves the device by pulses of force, until the end or until `stop` is requested. `None` if the end came first.
fn pulses(
    device: &mut dyn Device,
    model: &DeviceModel,
    stop: &Stop,
) -> Option<Result<Response, ResponseError>> {
    let period = Duration::from_millis(1);
    let mut pulses = Pulses::new(model, period.as_secs_f64());
    let start = Instant::now();
    for tick in 0_u32.. {
        std::thread::sleep((period * tick).saturating_sub(start.elapsed()));
        let now = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let reading = device.read(now);
        let wrench = if stop.is_requested() {
            Wrench::zero()
        } else {
            pulses.tick(&reading)
        };
        let _ = device.write(now, &wrench);
        if stop.is_requested() || pulses.ended() {
            break;
        }
    }
    pulses.result()
}
