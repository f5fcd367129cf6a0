//! `palpate device identify`: the mechanics of a device, from a guided motion that nobody holds.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::super::progress_bar;
use super::super::signals::Ending;
use super::open::DeviceArguments;
use super::{DeviceCommandError, open};
use devices::identify::{Estimate, Guide, Identified};
use host::atomic_file::{write_atomically, write_json};
use rt_core::Wrench;
use runner::schedule::realtime;
use serde::Serialize;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

/// Period of the ticks (s).
const PERIOD: f64 = 1e-3;
/// Ticks between two positions of the progress bar.
const DRAWN: u32 = 250;

/// Arguments of `palpate device identify`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct IdentifyArguments {
    #[command(flatten)]
    device: DeviceArguments,
    /// Date for the sources of the numbers, such as 2026-11-25. Default: today (UTC)
    #[arg(long, value_name = "DATE")]
    date: Option<String>,
    /// Write the device file with the identified numbers (TOML)
    #[arg(long, value_name = "FILE")]
    profile: Option<PathBuf>,
    /// Write the result as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Confirm that nobody holds the device, and that it has room to move by 20 mm
    #[arg(long)]
    nobody_holds_it: bool,
}

/// The JSON that `--json` writes.
#[derive(Serialize)]
struct IdentifiedJson {
    /// Version of this layout.
    schema: &'static str,
    /// The connection of the device.
    connect: String,
    /// Date that was given, or that of the day (UTC).
    date: String,
    /// Mass that moves with the handle, with the ends of its 95 % interval (kg).
    mass: [f64; 3],
    /// Viscous damping, with the ends of its 95 % interval (N s/m).
    damping: [f64; 3],
    /// Coulomb friction, with the ends of its 95 % interval (N).
    friction: [f64; 3],
    /// Time from the command of a force to its rendering, with the delay of the readings (s); `None` if the motion does
    /// not tell it.
    delay: Option<f64>,
}

pub(super) fn run(arguments: &IdentifyArguments) -> Result<(), CommandError> {
    let ending = Ending::begin(false)?;
    let _held = Declared::default()
        .file("--profile", arguments.profile.as_ref(), Format::Toml)
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    if !arguments.nobody_holds_it {
        return Err(DeviceCommandError::Unconfirmed.into());
    }
    let open::Opened {
        mut device,
        file: base,
        priority,
        ..
    } = open::device(&arguments.device)?;
    let refused = |error: devices::identify::IdentifyError| {
        CommandError::from(DeviceCommandError::Unidentified(error.to_string()))
    };
    let mut guide = Guide::new(&device.capabilities(), PERIOD).map_err(refused)?;
    let (force, distance, speed) = guide.limits();
    errln!(
        "the device moves by itself for about a minute: at most {force:.1} N, {:.0} mm and {speed:.1} m/s. Ctrl-C stops it",
        1e3 * distance
    );
    open::wait_for_state(&mut *device, PERIOD, ending.stop())?;
    // A tick that comes late is a force that lasts too long. Without the privilege the motion may end early.
    let _ = realtime(priority);
    let bar = progress_bar();
    let start = Instant::now();
    for tick in 0_u32.. {
        let due = Duration::from_secs_f64(PERIOD) * tick;
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let now = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let reading = device.read(now);
        let stopped = ending.stop().is_requested();
        let wrench = if stopped {
            Wrench::zero()
        } else {
            guide.tick(&reading)
        };
        let _ = device.write(now, &wrench);
        if stopped || guide.ended() {
            break;
        }
        if tick.is_multiple_of(DRAWN) {
            bar.set_position((1e3 * guide.progress()) as u64);
        }
    }
    drop(device);
    bar.finish_and_clear();
    ending.result()?;
    let Some(found) = guide.result() else {
        return Err(DeviceCommandError::NoState(0.0).into());
    };
    let found = found.map_err(refused)?;
    let date = arguments.date.clone().unwrap_or_else(today);
    print(&arguments.device.connect, &found);
    if let Some(path) = &arguments.profile {
        write_atomically(path, found.profile(&base, &date).as_bytes())?;
        outln!("  {:<10} {}", "profile", path.display());
    }
    if let Some(path) = &arguments.json {
        write_json(path, &json(arguments, date, &found))?;
    }
    Ok(())
}

/// The date of today (UTC), such as 2026-11-25.
fn today() -> String {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let [year, month, day] = date_of(now.map_or(0, |now| now.as_secs() / 86_400));
    format!("{year:04}-{month:02}-{day:02}")
}

/// Year, month and day of a day after 1970-01-01, in the calendar of Gregory, whose 400 years have 146,097 days. Years
/// begin in March, so that the leap day is their last.
fn date_of(day: u64) -> [u64; 3] {
    let day = day + 719_468;
    let (era, day) = (day / 146_097, day % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day_of_month = day - (153 * month + 2) / 5 + 1;
    let (year, month) = if month < 10 {
        (year, month + 3)
    } else {
        (year + 1, month - 9)
    };
    [400 * era + year, month, day_of_month]
}

fn print(connect: &str, found: &Identified) {
    outln!("{connect}: identified by a guided motion");
    let line = |title: &str, estimate: &Estimate, unit: &str| {
        outln!(
            "  {title:<10} {:.4} {unit}, 95 % interval {:.4} to {:.4}",
            estimate.value,
            estimate.low,
            estimate.high
        );
    };
    line("mass", &found.mass, "kg");
    line("damping", &found.damping, "N s/m");
    line("friction", &found.friction, "N");
    if let Some(delay) = found.delay_periods {
        outln!(
            "  {:<10} {delay:.2} ticks from the command of a force to its rendering",
            "delay"
        );
    }
}

fn json(arguments: &IdentifyArguments, date: String, found: &Identified) -> IdentifiedJson {
    let numbers = |estimate: &Estimate| [estimate.value, estimate.low, estimate.high];
    IdentifiedJson {
        schema: "palpate.identified/1",
        connect: arguments.device.connect.clone(),
        date,
        mass: numbers(&found.mass),
        damping: numbers(&found.damping),
        friction: numbers(&found.friction),
        delay: found.delay_periods.map(|periods| periods * found.period),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_their_dates() {
        for (day, date) in [
            (0, [1970, 1, 1]),
            (59, [1970, 3, 1]),
            (11_016, [2000, 2, 29]),
            (11_017, [2000, 3, 1]),
            (20_782, [2026, 11, 25]),
            (47_540, [2100, 2, 28]),
            (47_541, [2100, 3, 1]),
        ] {
            assert_eq!(date_of(day), date);
        }
    }
}
