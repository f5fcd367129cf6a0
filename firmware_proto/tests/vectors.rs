//! The golden vectors equal the present output of the protocol: devices in use cannot follow a change.

mod transcript;

use std::path::Path;

#[test]
fn the_golden_vectors_have_not_changed() {
    for (name, text) in transcript::golden::vectors() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("vectors")
            .join(name);
        let golden = std::fs::read_to_string(&path).expect("the vectors are in the repository");
        let mut lines = text.lines().zip(golden.lines());
        let different = lines.find(|(found, golden)| found != golden);
        assert!(
            different.is_none() && text == golden,
            "vectors/{name}: found and golden differ: {different:?}. If the protocol shall change, write the vectors \
             anew with `cargo run -p palpate-firmware-proto --example vectors`"
        );
        // The answers follow from the commands alone.
        assert_eq!(transcript::run(&golden), golden);
    }
}
