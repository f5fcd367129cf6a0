//! Reports from and to a device of the firmware protocol, and streams of reports.

use firmware_proto::report::{LENGTH, Report, ReportError, VERSION};
use firmware_proto::stream::{Decoder, packet};

/// Reads the bytes as a report, and as a stream of reports. Returns how many reports were accepted.
///
/// # Panics
/// If a report that is accepted is written otherwise than it was read.
pub fn reports(bytes: &[u8]) -> usize {
    let mut accepted = report(bytes);
    // A fuzzer hardly finds a check sum or a version. With the right ones, the input reaches the fields.
    if let Ok(mut bytes) = <[u8; LENGTH]>::try_from(bytes) {
        bytes[0] = VERSION;
        if let Err(ReportError::Crc { expected, .. }) = Report::decode(&bytes) {
            bytes[LENGTH - 2..].copy_from_slice(&expected.to_le_bytes());
        }
        report(&bytes);
    }
    let mut decoder = Decoder::new();
    let mut last = Vec::new();
    for &byte in bytes {
        last.push(byte);
        if let Some(report) = decoder.push(byte) {
            assert_eq!(&packet(report)[..], &last[..]);
            accepted += 1;
        }
        if byte == 0 {
            last.clear();
        }
    }
    accepted
}

fn report(bytes: &[u8]) -> usize {
    let Ok(report) = Report::decode(bytes) else {
        return 0;
    };
    assert_eq!(report.encode(), bytes);
    match report {
        Report::State(state) => _ = state.to_si(),
        Report::Wrench(wrench) => _ = wrench.to_si(),
        _ => {}
    }
    1
}
