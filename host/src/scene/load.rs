//! From a scene file to a checked scene with the files that it names.

use super::consistency;
use super::error::SceneError;
use super::recording::{self, Sample};
use super::source::Source;
use super::spec::{MeshSource, Scene};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The scene that the program carries with it.
const DEFAULT: &str = include_str!("../../scenes/stretch.toml");
/// What messages call it.
const DEFAULT_NAME: &str = "stretch.toml (built in)";
/// Largest file that is read (bytes).
const LARGEST: u64 = 64 << 20;

/// A scene, checked, with what its files say.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The scene.
    pub scene: Scene,
    /// Its text, for errors that are found later: see [`Source::error`].
    pub source: Source,
    /// The mesh file of each body that names one, in the order of the bodies.
    pub meshes: Vec<Option<MeshFile>>,
    /// The recording of each device's hand that names one, in the order of the devices.
    pub recordings: Vec<Option<Vec<Sample>>>,
}

/// A mesh file, not parsed.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// Where it was found.
    pub path: PathBuf,
    /// What it holds. Which format that is, and whether it is text, shows once it is parsed.
    pub bytes: Vec<u8>,
}

impl Scene {
    /// Reads a scene's text and checks it, without opening the files that it names. Messages call it
    /// `name`.
    ///
    /// # Errors
    ///
    /// Says at which line and field the text is wrong, what was found there and what is allowed.
    pub fn parse(text: &str, name: &str) -> Result<Self, SceneError> {
        parse(&Source {
            name: name.to_owned(),
            text: text.to_owned(),
        })
    }

    /// Reads a scene file and the files that it names, whose paths are relative to its folder.
    ///
    /// # Errors
    ///
    /// As [`Scene::parse`]; also where a file cannot be read, or a recording is wrong.
    pub fn load(path: &Path) -> Result<LoadedScene, SceneError> {
        let name = path.display().to_string();
        let text = match read(path) {
            Ok(text) => text,
            Err(source) => return Err(SceneError::Read { file: name, source }),
        };
        load(
            Source { name, text },
            path.parent().unwrap_or(Path::new("")),
        )
    }

    /// The scene that the program carries with it; it names no files.
    ///
    /// # Errors
    ///
    /// As [`Scene::parse`]; the tests show that there is none.
    pub fn embedded_default() -> Result<LoadedScene, SceneError> {
        load(
            Source {
                name: DEFAULT_NAME.to_owned(),
                text: DEFAULT.to_owned(),
            },
            Path::new(""),
        )
    }
}

fn parse(source: &Source) -> Result<Scene, SceneError> {
    let document = toml::Deserializer::parse(&source.text)
        .map_err(|error| SceneError::syntax(source, &error))?;
    let scene = serde_path_to_error::deserialize(document)
        .map_err(|error| SceneError::refused(source, &error.path().to_string(), error.inner()))?;
    consistency::check(&scene)
        .map_err(|conflict| source.error(&conflict.field, conflict.found, conflict.allowed))?;
    Ok(scene)
}

fn load(source: Source, folder: &Path) -> Result<LoadedScene, SceneError> {
    let scene = parse(&source)?;

    let mut meshes = Vec::new();
    for (index, body) in scene.bodies.iter().enumerate() {
        meshes.push(match &body.mesh {
            MeshSource::Sheet { .. } => None,
            MeshSource::File(file) => {
                let path = folder.join(file);
                let field = format!("body[{index}].mesh.file");
                let bytes = read_bytes(&path).map_err(|e| unreadable(&source, &field, &path, e))?;
                Some(MeshFile { path, bytes })
            }
        });
    }

    let mut recordings = Vec::new();
    for (index, device) in scene.devices.iter().enumerate() {
        recordings.push(match &device.hand.recording {
            None => None,
            Some(file) => {
                let path = folder.join(file);
                let field = format!("device[{index}].hand.recording");
                let text = read(&path).map_err(|e| unreadable(&source, &field, &path, e))?;
                Some(recording::parse(&text, &path.display().to_string())?)
            }
        });
    }
    Ok(LoadedScene {
        scene,
        source,
        meshes,
        recordings,
    })
}

/// The file that `field` names cannot be read.
fn unreadable(source: &Source, field: &str, path: &Path, error: io::Error) -> SceneError {
    SceneError::File {
        place: source.place(field),
        path: path.to_owned(),
        source: error,
    }
}

/// Reads a text file, unless it is unreasonably large.
fn read(path: &Path) -> io::Result<String> {
    // As the standard library words it where it reads text itself.
    let no_text = |_| {
        io::Error::new(
            io::ErrorKind::InvalidData,
            "stream did not contain valid UTF-8",
        )
    };
    String::from_utf8(read_bytes(path)?).map_err(no_text)
}

/// Reads a file, unless it is unreasonably large.
fn read_bytes(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(LARGEST + 1)
        .read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST {
        return Err(io::Error::other(format!(
            "larger than {} MiB",
            LARGEST >> 20
        )));
    }
    Ok(bytes)
}
