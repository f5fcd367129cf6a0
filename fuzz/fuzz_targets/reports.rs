//! Reports from and to a device: what is accepted is written again as it was.
#![no_main]

use firmware_proto::report::{StateReport, WrenchReport};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(report) = StateReport::decode(bytes) {
        assert_eq!(StateReport::decode(&report.encode()), Ok(report));
        let _ = report.to_si();
    }
    if let Ok(report) = WrenchReport::decode(bytes) {
        assert_eq!(WrenchReport::decode(&report.encode()), Ok(report));
        let _ = report.to_si();
    }
});
