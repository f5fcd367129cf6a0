//! Reads the corpus of the fuzzers again, without fuzzing tools.

use firmware_proto::report::{StateReport, WrenchReport};
use std::io;

#[test]
fn reports() -> io::Result<()> {
    let mut accepted = 0;
    for input in corpus::inputs("reports")? {
        let bytes = &input.bytes[..];
        if let Ok(report) = StateReport::decode(bytes) {
            assert_eq!(report.encode(), bytes);
            accepted += 1;
        }
        if let Ok(report) = WrenchReport::decode(bytes) {
            assert_eq!(report.encode(), bytes);
            accepted += 1;
        }
    }
    assert!(accepted >= 2, "a state and a wrench are among the seeds");
    Ok(())
}
