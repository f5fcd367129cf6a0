//! Writes the golden vectors (`firmware_proto/vectors`) anew, after a change of the protocol.

#[path = "../tests/transcript/mod.rs"]
mod transcript;

use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors");
    for (name, text) in transcript::golden::vectors() {
        std::fs::write(folder.join(name), text)?;
    }
    Ok(())
}
