//! The inputs of the fuzz targets, for the tests that replay them without fuzzing tools.
//!
//! A target has two sets of inputs: seeds, which people wrote (a file each, in `fuzz/seeds/TARGET`), and its
//! corpus, which the fuzzers found worth keeping (one archive, `fuzz/corpus/TARGET.tar.gz`). `fuzz/archive`
//! unpacks and packs the archives.

use flate2::read::GzDecoder;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;
use tar::Archive;

/// The folder `fuzz` of the repository.
const FUZZ: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz");

/// One input of a fuzz target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// The name of its file.
    pub name: String,
    /// What the target reads.
    pub bytes: Vec<u8>,
}

/// The seeds of a target, sorted by name.
///
/// # Errors
/// Where the target has no folder of seeds, or one of them cannot be read. The message names the path.
pub fn seeds(target: &str) -> io::Result<Vec<Input>> {
    let folder = Path::new(FUZZ).join("seeds").join(target);
    let read = || {
        let mut seeds = Vec::new();
        for entry in fs::read_dir(&folder)? {
            let entry = entry?;
            seeds.push(Input {
                name: entry.file_name().to_string_lossy().into_owned(),
                bytes: fs::read(entry.path())?,
            });
        }
        seeds.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(seeds)
    };
    read().map_err(|error| naming(&folder, &error))
}

/// The corpus of a target, sorted by name.
///
/// # Errors
/// Where the target has no archive, or the archive is damaged. The message names the path.
pub fn corpus(target: &str) -> io::Result<Vec<Input>> {
    let path = Path::new(FUZZ)
        .join("corpus")
        .join(format!("{target}.tar.gz"));
    let read = || {
        let mut inputs = Vec::new();
        let mut archive = Archive::new(GzDecoder::new(File::open(&path)?));
        for entry in archive.entries()? {
            let mut entry = entry?;
            let name = entry.path()?.to_string_lossy().into_owned();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes)?;
            inputs.push(Input { name, bytes });
        }
        inputs.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(inputs)
    };
    read().map_err(|error| naming(&path, &error))
}

/// All inputs of a target: its seeds, then its corpus.
///
/// # Errors
/// As [`seeds`] and [`corpus`].
pub fn inputs(target: &str) -> io::Result<Vec<Input>> {
    let mut inputs = seeds(target)?;
    inputs.extend(corpus(target)?);
    Ok(inputs)
}

/// The input of a target's corpus with this name.
///
/// # Errors
/// As [`corpus`], and where the corpus has no input of that name.
pub fn named(target: &str, name: &str) -> io::Result<Input> {
    corpus(target)?
        .into_iter()
        .find(|input| input.name == name)
        .ok_or_else(|| {
            let message =
                format!("expected the input {name} in the corpus of {target}, found none");
            io::Error::new(io::ErrorKind::NotFound, message)
        })
}

fn naming(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}
