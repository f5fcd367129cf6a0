//! An emulated Falcon as a USB device of the kernel, with the operator who homes it.

use super::super::super::CommandError;
use super::super::super::signals::Ending;
use super::super::DeviceCommandError;
use super::{EmulateArguments, PRIORITY, Simulated, report};
use devices::falcon::Firmware;
use emulator::Served;
use emulator::usb::Chip;
use runner::schedule::realtime;
use sim::emulate::Operated;
use sim::emulate::falcon::{Falcon, Settings};
use std::sync::Mutex;

pub(super) fn run(
    arguments: &EmulateArguments,
    simulated: Simulated,
    ending: &Ending,
) -> Result<(), CommandError> {
    let refused = |problem: &str| DeviceCommandError::NotEmulated(problem.to_owned());
    if arguments.on != "usb" {
        return Err(
            refused("a Falcon is a USB device: name --on usb, or --protocol firmware").into(),
        );
    }
    if arguments.free {
        return Err(refused("a Falcon is homed by a hand: leave --free out").into());
    }
    let Some(path) = &arguments.firmware else {
        let problem = "a Falcon gets its firmware from the host: name the file of the scene by --firmware FILE. For a \
                       rehearsal, any file of 1 to 262144 bytes will do";
        return Err(refused(problem).into());
    };
    let firmware = Firmware::load(path).map_err(DeviceCommandError::Firmware)?;
    let Simulated {
        device,
        name,
        moves,
        ..
    } = simulated;
    let mut falcon = Operated::new(Falcon::new(device, firmware.image(), Settings::default()));
    if moves {
        falcon = falcon.then_moving();
    }
    let falcon = Mutex::new(falcon);
    let chip = Chip::create(&arguments.serial).map_err(DeviceCommandError::Gadget)?;
    outln!("connect = \"{}\"", chip.connection());
    outln!("firmware = \"{}\"", path.display());
    errln!("emulating {name} until Ctrl-C");
    // The device stands for hardware, which no other program delays. Its threads inherit the priority.
    let _ = realtime(PRIORITY);
    let mut served = Served::default();
    // The gadget is removed after the signal.
    let result = chip.serve(&falcon, &ending.stop().flag(), &mut served);
    report(&served);
    result.map_err(|error| DeviceCommandError::Gadget(error).into())
}
