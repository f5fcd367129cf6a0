//! `palpate stress wall`: maps over stiffness and damping, with the boundary in theory and the measured one.

use super::{CommandError, Common, Declared, declare_devices, devices};
use study::stress::devices::StudyDevice;
use study::stress::wall::{self, Study};

/// Arguments of `palpate stress wall`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct WallArguments {
    /// Devices to study: device files (TOML) or names of built-in devices. Each is measured at its own rate and at four
    /// times its rate. Default: the built-in devices, at 1 and 4 kHz
    #[arg(value_name = "DEVICE")]
    devices: Vec<String>,
    #[command(flatten)]
    common: Common,
    /// Rate of the map (Hz). Default: the rate of each device
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(100..=20_000))]
    rate: Option<u32>,
    /// Output delay of the map (ticks)
    #[arg(long, value_name = "TICKS", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=3))]
    delay: u8,
}

pub(super) fn run(arguments: &WallArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let named = devices(&arguments.devices)?;
    named.iter().try_for_each(wall::check)?;
    let study = Study {
        devices: StudyDevice::chosen(&named)?,
        quick: common.quick,
        seed: common.cells.seed,
        map_rate: arguments.rate,
        map_delay: usize::from(arguments.delay),
    };
    let declared = declare_devices(Declared::default(), &named);
    let _held = common.declare(declared).check()?;
    common.run(&study)
}
