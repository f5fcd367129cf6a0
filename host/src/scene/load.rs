//! Loads a scene: from its file to a checked scene with the files that the scene names.

use super::consistency;
use super::error::SceneError;
use super::recording::{self, Sample};
use super::source::Source;
use super::spec::{MeshSource, ModelName, Scene};
use meshio::MeshFileError;
use physics::mesh::Mesh;
use sim::{DeviceFile, DeviceModel};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// The built-in scene.
const DEFAULT: &str = include_str!("../../scenes/stretch.toml");
/// The name of the built-in scene in messages.
const DEFAULT_NAME: &str = "stretch.toml (built in)";
/// Largest file that is read (bytes).
const LARGEST: u64 = 64 << 20;

/// A checked scene, with the contents of the files that it names.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The scene.
    pub scene: Scene,
    /// The text of the scene, for errors that are found later: see [`Source::error`].
    pub source: Source,
    /// The mesh file of each body that names one, in the order of the bodies. Bodies that name the same file have it
    /// in common.
    pub meshes: Vec<Option<Arc<MeshFile>>>,
    /// The model of each device, in the order of the devices.
    pub models: Vec<DeviceModel>,
    /// The recording of each device's hand that names one, in the order of the devices.
    pub recordings: Vec<Option<Vec<Sample>>>,
    /// The content of each file that the scene names, by the name of the file in the scene. A log keeps these files.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// A mesh file: read when its mesh is first asked for, and never again. All copies of a [`LoadedScene`] have it in
/// common.
#[derive(Debug)]
pub struct MeshFile {
    /// What the scene calls it: its end says which format it is in.
    name: String,
    /// Where it was found.
    pub path: PathBuf,
    /// What it holds. Which format that is, and whether it is text, shows once it is read.
    pub bytes: Vec<u8>,
    mesh: OnceLock<Result<Mesh, MeshFileError>>,
}

impl MeshFile {
    /// The mesh that the file holds.
    ///
    /// # Errors
    /// Why the file is no mesh.
    pub fn mesh(&self) -> Result<&Mesh, &MeshFileError> {
        self.mesh
            .get_or_init(|| meshio::read_mesh(&self.name, &self.bytes))
            .as_ref()
    }
}

impl Scene {
    /// Reads and checks the text of a scene, without the files that the scene names. Messages call the scene
    /// `name`.
    ///
    /// # Errors
    ///
    /// [`SceneError`] with the line, the field, the value found and the allowed values.
    ///
    /// ```
    /// use host::scene::Scene;
    ///
    /// let error = Scene::parse("name = 7", "my.toml").expect_err("a name is text");
    /// assert!(error.to_string().starts_with("my.toml:1: name: found 7"));
    /// ```
    pub fn parse(text: &str, name: &str) -> Result<Self, SceneError> {
        parse(&Source {
            name: name.to_owned(),
            text: text.to_owned(),
        })
    }

    /// Reads a scene file and the files that the scene names. Their paths are relative to the folder of the scene
    /// file.
    ///
    /// # Errors
    ///
    /// As [`Scene::parse`]; also if a file cannot be read, or if a device file or a recording is invalid.
    pub fn load(path: &Path) -> Result<LoadedScene, SceneError> {
        let name = path.display().to_string();
        let text = match read(path) {
            Ok(text) => text,
            Err(source) => return Err(SceneError::Read { file: name, source }),
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        load(Source { name, text }, folder, read_bytes)
    }

    /// Reads a scene from its text and from the contents of the files that the scene names, as a log keeps them.
    /// Messages call the scene `name`.
    ///
    /// # Errors
    ///
    /// As [`Scene::load`].
    pub fn load_texts(
        name: &str,
        text: &str,
        files: &BTreeMap<String, Vec<u8>>,
    ) -> Result<LoadedScene, SceneError> {
        let source = Source {
            name: name.to_owned(),
            text: text.to_owned(),
        };
        load(source, Path::new(""), |path| {
            let file = path.to_str().and_then(|name| files.get(name)).cloned();
            file.ok_or_else(|| io::ErrorKind::NotFound.into())
        })
    }

    /// The built-in scene, which names no files.
    ///
    /// # Errors
    ///
    /// As [`Scene::parse`]. The tests show that the built-in scene has no error.
    pub fn embedded_default() -> Result<LoadedScene, SceneError> {
        load(
            Source {
                name: DEFAULT_NAME.to_owned(),
                text: DEFAULT.to_owned(),
            },
            Path::new(""),
            read_bytes,
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

/// Loads a scene from its text. `read` returns the content of a file; paths are relative to `folder`.
fn load(
    source: Source,
    folder: &Path,
    read: impl Fn(&Path) -> io::Result<Vec<u8>>,
) -> Result<LoadedScene, SceneError> {
    let scene = parse(&source)?;
    let mut files = BTreeMap::new();
    // Reads the file that `field` names, and keeps its content under the name in the scene.
    let mut named = |file: &str, field: &str| {
        let path = folder.join(file);
        match read(&path) {
            Ok(bytes) => {
                files.insert(file.to_owned(), bytes.clone());
                Ok((path, bytes))
            }
            Err(error) => Err(SceneError::File {
                place: source.place(field),
                path,
                source: error,
            }),
        }
    };

    let mut meshes: Vec<Option<Arc<MeshFile>>> = Vec::new();
    for (index, body) in scene.bodies.iter().enumerate() {
        let MeshSource::File(file) = &body.mesh.source else {
            meshes.push(None);
            continue;
        };
        let known = meshes.iter().flatten().find(|mesh| mesh.name == *file);
        let mesh = if let Some(mesh) = known {
            Arc::clone(mesh)
        } else {
            let (path, bytes) = named(file, &format!("body[{index}].mesh.file"))?;
            Arc::new(MeshFile {
                name: file.clone(),
                path,
                bytes,
                mesh: OnceLock::new(),
            })
        };
        meshes.push(Some(mesh));
    }

    let mut models = Vec::new();
    for (index, device) in scene.devices.iter().enumerate() {
        let field = format!("device[{index}].model");
        models.push(match &device.model {
            ModelName::BuiltIn(name) => DeviceModel::named(name)
                .ok_or_else(|| source.error(&field, *name, "a built-in device"))?,
            ModelName::File(file) => {
                let (path, bytes) = named(file, &field)?;
                let text = text_of(bytes).map_err(|error| SceneError::File {
                    place: source.place(&field),
                    path: path.clone(),
                    source: error,
                })?;
                DeviceFile::parse(&text)
                    .map_err(|error| SceneError::model(path.display().to_string(), error))?
                    .model
            }
        });
    }

    let mut recordings = Vec::new();
    for (index, device) in scene.devices.iter().enumerate() {
        let hand = device.hand.as_ref();
        recordings.push(match hand.and_then(|hand| hand.recording.as_ref()) {
            None => None,
            Some(file) => {
                let field = format!("device[{index}].hand.recording");
                let (path, bytes) = named(file, &field)?;
                let text = text_of(bytes).map_err(|error| SceneError::File {
                    place: source.place(&field),
                    path: path.clone(),
                    source: error,
                })?;
                Some(recording::parse(&text, &path.display().to_string())?)
            }
        });
    }
    Ok(LoadedScene {
        scene,
        source,
        meshes,
        models,
        recordings,
        files,
    })
}

/// Reads a text file of at most [`LARGEST`] bytes.
fn read(path: &Path) -> io::Result<String> {
    text_of(read_bytes(path)?)
}

/// A file's bytes as text.
fn text_of(bytes: Vec<u8>) -> io::Result<String> {
    // The wording of the standard library, where the library reads text itself.
    String::from_utf8(bytes).map_err(|_| {
        io::Error::new(
            io::ErrorKind::InvalidData,
            "stream did not contain valid UTF-8",
        )
    })
}

/// Reads a file of at most [`LARGEST`] bytes.
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
