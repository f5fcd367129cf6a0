//! Reports from and to a device: what is accepted is written again as it was.
#![no_main]

use firmware_proto::report::{ReportError, StateReport, WrenchReport};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    check(bytes);
    // A fuzzer hardly finds a check sum; with the right one, the fields are reached.
    let mut sealed = bytes.to_vec();
    if let Err(ReportError::Crc { expected, .. }) = StateReport::decode(bytes)
        && let Some(end) = sealed.last_chunk_mut()
    {
        *end = expected.to_le_bytes();
        check(&sealed);
    }
});

fn check(bytes: &[u8]) {
    if let Ok(report) = StateReport::decode(bytes) {
        assert_eq!(report.encode(), bytes);
        let _ = report.to_si();
    }
    if let Ok(report) = WrenchReport::decode(bytes) {
        assert_eq!(report.encode(), bytes);
        let _ = report.to_si();
    }
}
