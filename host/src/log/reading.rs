//! A device's reading in a tick, as the log keeps it. A run is replayed from these readings.
//!
//! The message ([`super::tick`]) has the reason why there was no state (`status`), and what the device said of its wrenches
//! (`rendering`, `fault`).

use crate::record::{LoggedReading, ReadFault};
use rt_core::{DeviceState, Rendering};

use super::cdr::{CdrReader, CdrWriter};

/// The faults in the order of the constants in the message definition, from one.
const FAULTS: [ReadFault; 8] = [
    ReadFault::NoReport,
    ReadFault::Disconnected(0),
    ReadFault::Busy,
    ReadFault::BadLength,
    ReadFault::BadCheckSum,
    ReadFault::BadVersion,
    ReadFault::BadKind,
    ReadFault::OutOfRange,
];

impl LoggedReading {
    pub(super) fn encode(&self, out: &mut CdrWriter) {
        let (state, status, system_error) = match &self.0 {
            Ok(state) => (*state, 0, 0),
            Err(fault) => {
                let (kind, number) = match fault {
                    ReadFault::Disconnected(number) => (ReadFault::Disconnected(0), *number),
                    other => (*other, 0),
                };
                let place = FAULTS.iter().position(|f| *f == kind);
                // The state is all zero: a rotation of zero length cannot be mistaken for a rotation that was read.
                let mut nothing = DeviceState::resting();
                nothing.pose.rotation.as_mut_unchecked().coords.fill(0.0);
                (nothing, place.map_or(u8::MAX, |i| i as u8 + 1), number)
            }
        };
        out.pose(&state.pose);
        out.twist(&state.twist);
        out.u64(state.device_time_ns);
        out.u32(state.buttons);
        out.u32(system_error as u32);
        out.u8(status);
        let (rendering, fault) = match state.rendering {
            Rendering::Commanded => (0, 0),
            Rendering::LetGo => (1, 0),
            Rendering::Fault(fault) => (2, fault),
        };
        out.u8(rendering);
        out.u8(fault);
    }

    pub(super) fn decode(from: &mut CdrReader) -> Option<Self> {
        let (pose, twist) = (from.pose()?, from.twist()?);
        let (device_time_ns, buttons) = (from.u64()?, from.u32()?);
        let system_error = from.u32()? as i32;
        let status = from.u8()?;
        let rendering = match (from.u8()?, from.u8()?) {
            (0, 0) => Rendering::Commanded,
            (1, 0) => Rendering::LetGo,
            (2, fault) => Rendering::Fault(fault),
            _ => return None,
        };
        let Some(place) = usize::from(status).checked_sub(1) else {
            return Some(Self(Ok(DeviceState {
                pose,
                twist,
                buttons,
                device_time_ns,
                rendering,
            })));
        };
        let fault = match *FAULTS.get(place)? {
            ReadFault::Disconnected(_) => ReadFault::Disconnected(system_error),
            other => other,
        };
        Some(Self(Err(fault)))
    }
}
