//! The answers of an emulated FTDI chip to the requests on its control pipe.
//!
//! The chip of the emulated Falcon knows the requests that our driver makes. Other programs (libftdi, the kernel's
//! `ftdi_sio`) make some more requests. The chip takes these without an effect, or answers with its present values. The
//! chip refuses a request that no such chip has, in the manner of USB: with a stall.

use super::functionfs::HostRequest;
use devices::ftdi::{Buffer, Control};
use sim::emulate::Operated;
use sim::emulate::falcon::MODEM;

/// Type of a request to the device with no bytes, or bytes, from the host.
const FROM_HOST: u8 = 0x40;
/// Type of a request that the device answers with bytes.
const TO_HOST: u8 = 0xc0;

/// The answer to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The request is taken.
    Taken,
    /// The request is taken, and the bytes on their way to the host are dropped.
    Purged,
    /// The request is answered with one byte or two.
    Bytes([u8; 2], usize),
    /// The request is refused.
    Refused,
}

/// The answer of the chip to a request, which acts at `now_ns`.
pub fn answer(device: &mut Operated, request: HostRequest, now_ns: u64) -> Answer {
    let setup = request.setup;
    match (setup.kind, setup.request) {
        (FROM_HOST, _) if request.length > 0 => Answer::Refused,
        // A reset of the chip empties both buffers.
        (FROM_HOST, 0) if setup.value == 0 => {
            for buffer in [Buffer::One, Buffer::Two] {
                let _ = device.control(Control::Purge(buffer).setup(), now_ns);
            }
            Answer::Purged
        }
        (FROM_HOST, _) if device.control(setup, now_ns).is_ok() => {
            match Control::from_setup(setup) {
                Some(Control::Purge(Buffer::One)) => Answer::Purged,
                _ => Answer::Taken,
            }
        }
        // Flow control, the format of the line, the error character, the mode of the pins.
        (FROM_HOST, 2 | 4 | 7 | 11) => Answer::Taken,
        // The state of the modem lines.
        (TO_HOST, 5) => Answer::Bytes(MODEM, MODEM.len()),
        (TO_HOST, 10) => Answer::Bytes([device.falcon().latency_ms(), 0], 1),
        // A word of an empty EEPROM.
        (TO_HOST, 0x90) => Answer::Bytes([0xff; 2], 2),
        _ => Answer::Refused,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use devices::DeviceModel;
    use devices::ftdi::SetupPacket;
    use sim::SimDevice;
    use sim::emulate::falcon::{Falcon, Settings};

    /// A request of the host without bytes.
    fn request(kind: u8, request: u8, value: u16) -> HostRequest {
        HostRequest {
            setup: SetupPacket {
                kind,
                request,
                value,
                index: 0,
            },
            length: 0,
        }
    }

    #[test]
    fn requests_of_our_driver_and_of_other_programs_are_answered() {
        let model = DeviceModel::named("falcon").unwrap();
        let device = SimDevice::new(model, None, 1e-3).unwrap();
        let mut device = Operated::new(Falcon::new(device, &[1, 2, 3], Settings::default()));
        let mut ask = |kind, number, value| answer(&mut device, request(kind, number, value), 0);
        // The chip starts with a latency of 16 ms.
        assert_eq!(ask(TO_HOST, 10, 0), Answer::Bytes([16, 0], 1));
        assert_eq!(ask(FROM_HOST, 9, 1), Answer::Taken);
        assert_eq!(ask(TO_HOST, 10, 0), Answer::Bytes([1, 0], 1));
        assert_eq!(ask(TO_HOST, 5, 0), Answer::Bytes([0x31, 0x60], 2));
        assert_eq!(ask(TO_HOST, 0x90, 0), Answer::Bytes([0xff; 2], 2));
        for (number, value, expected) in [
            (0, 0, Answer::Purged),
            (0, 1, Answer::Purged),
            (0, 2, Answer::Taken),
            (1, 0x0101, Answer::Taken),
            (2, 0x1311, Answer::Taken),
            (3, 0x4138, Answer::Taken),
            (4, 8, Answer::Taken),
            (4, 0x0107, Answer::Taken),
            (6, 0x013e, Answer::Taken),
            (7, 0, Answer::Taken),
            (11, 0x40ff, Answer::Taken),
            (0, 3, Answer::Refused),
            (0x91, 0, Answer::Refused),
        ] {
            assert_eq!(
                ask(FROM_HOST, number, value),
                expected,
                "{number} {value:#x}"
            );
        }
        // A request to an interface, or with bytes.
        assert_eq!(ask(0x41, 9, 1), Answer::Refused);
        let bytes = HostRequest {
            length: 1,
            ..request(FROM_HOST, 9, 1)
        };
        assert_eq!(answer(&mut device, bytes, 0), Answer::Refused);
    }
}
