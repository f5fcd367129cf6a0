//! Reads the corpus of the fuzzers again, without fuzzing tools.

use firmware_proto::report::Report;
use std::io;

#[test]
fn reports() -> io::Result<()> {
    let mut accepted = 0;
    for input in corpus::inputs("reports")? {
        let bytes = &input.bytes[..];
        if let Ok(report) = Report::decode(bytes) {
            assert_eq!(report.encode(), bytes);
            accepted += 1;
        }
    }
    assert!(accepted >= 7, "a report of each kind is among the seeds");
    Ok(())
}
