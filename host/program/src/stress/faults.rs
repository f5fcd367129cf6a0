//! `palpate stress faults`: runs the tick on invalid input of devices, host and clock.

use super::{CommandError, Common, Declared, declare_devices, devices, number};
use study::stress::devices::StudyDevice;
use study::stress::faults::{CELLS, Study};

/// Arguments of `palpate stress faults`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct FaultsArguments {
    /// Devices with whose rate, limits, friction and counts the controllers run, in turn: device files (TOML) or names
    /// of built-in devices. Default: devices of random limits
    #[arg(value_name = "DEVICE")]
    devices: Vec<String>,
    /// Number of controllers. Default: 1000, of a hundred thousand ticks each; 10 with --quick
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &FaultsArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let named = devices(&arguments.devices)?;
    let declared = declare_devices(Declared::default(), &named);
    let _held = common.declare(declared).check()?;
    common.run(&Study {
        seed: common.cells.seed,
        cells: number(arguments.runs, common.quick, CELLS),
        devices: StudyDevice::chosen(&named)?,
    })
}
