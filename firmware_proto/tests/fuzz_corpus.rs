//! Reads the corpus of the fuzzers again, without fuzzing tools.

use firmware_proto::report::{StateReport, WrenchReport};
use std::path::Path;
use std::{fs, io};

#[test]
fn reports() -> io::Result<()> {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz");
    let mut accepted = 0;
    for folder in ["seeds/reports", "corpus/reports"] {
        for entry in fs::read_dir(fuzz.join(folder))? {
            let bytes = fs::read(entry?.path())?;
            if let Ok(report) = StateReport::decode(&bytes) {
                assert_eq!(report.encode(), bytes[..]);
                accepted += 1;
            }
            if let Ok(report) = WrenchReport::decode(&bytes) {
                assert_eq!(report.encode(), bytes[..]);
                accepted += 1;
            }
        }
    }
    assert!(accepted >= 2, "a state and a wrench are among the seeds");
    Ok(())
}
