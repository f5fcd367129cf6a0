//! Loads a scene: from its file to a checked scene with the files that the scene names.

use super::advice;
use super::consistency;
use super::contact;
use super::error::SceneError;
use super::plausible::{self, Warning};
use super::poses;
use super::recording::{self, Sample};
use super::silent;
use super::source::Source;
use super::spec::{MeshSource, ModelName, Scene, Tool};
use super::tool;
use meshio::{Choices, MeshFileError};
use physics::contact::obstacle::TimedPose;
use physics::mesh::Mesh;
use sim::{DeviceFile, DeviceModel};
use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// The built-in scene.
const DEFAULT: &str = include_str!("../../scenes/stretch.toml");
/// The name of the built-in scene in messages.
const DEFAULT_NAME: &str = "stretch.toml (built in)";
/// Largest file that is read (bytes).
const LARGEST: u64 = 64 << 20;
/// Most frames of an obstacle.
const MOST_FRAMES: usize = 10_000;
/// Most bytes of all frames of an obstacle.
const LARGEST_FRAMES: usize = 256 << 20;

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
    /// The device file of each device, which has its model too, in the order of the devices.
    pub profiles: Vec<DeviceFile>,
    /// The recording of each device's hand that names one, in the order of the devices.
    pub recordings: Vec<Option<Vec<Sample>>>,
    /// The files of each obstacle, in the order of the obstacles.
    pub obstacles: Vec<ObstacleFiles>,
    /// The content of each file that the scene names, by the name of the file in the scene. A log keeps these files.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Values of the scene and its device files that few scenes mean. `host::world::World::warnings` adds those that the
    /// meshes show.
    pub warnings: Vec<Warning>,
}

/// The files of an obstacle.
#[derive(Clone, Debug, Default)]
pub struct ObstacleFiles {
    /// The mesh, or the frames of a mesh that is animated vertex by vertex; empty for a shape.
    pub frames: Vec<Arc<MeshFile>>,
    /// The table of poses; `None` for an obstacle that follows none.
    pub poses: Option<Vec<TimedPose>>,
}

/// A mesh file: read when its mesh is first asked for, and never again. All copies of a [`LoadedScene`] have it in
/// common.
#[derive(Debug)]
pub struct MeshFile {
    /// The name of the file in the scene. If the beginning of the file does not tell the format, the end of the name does.
    name: String,
    /// The path of the file.
    pub path: PathBuf,
    /// The content of the file, in any format, text or binary.
    pub bytes: Vec<u8>,
    /// How the scene reads it.
    choices: Choices,
    mesh: OnceLock<Result<Mesh, MeshFileError>>,
}

impl MeshFile {
    /// The file `name` of a scene, with its path and content.
    fn new(name: &str, (path, bytes): (PathBuf, Vec<u8>), choices: Choices) -> Arc<Self> {
        Arc::new(Self {
            name: name.to_owned(),
            path,
            bytes,
            choices,
            mesh: OnceLock::new(),
        })
    }

    /// The mesh that the file holds.
    ///
    /// # Errors
    /// The reason why the file is no mesh.
    pub fn mesh(&self) -> Result<&Mesh, &MeshFileError> {
        self.mesh
            .get_or_init(|| meshio::read_mesh_as(&self.name, &self.bytes, self.choices))
            .as_ref()
    }
}

impl LoadedScene {
    /// The path of a file that the scene names: relative to the folder of the scene file.
    pub fn beside(&self, file: &str) -> PathBuf {
        let folder = Path::new(&self.source.name).parent();
        folder.unwrap_or(Path::new("")).join(file)
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
    /// use scene::Scene;
    ///
    /// let error = Scene::parse("name = 7", "my.toml").expect_err("a name is text");
    /// assert!(error.to_string().starts_with("my.toml:1: name: found 7"));
    /// ```
    pub fn parse(text: &str, name: &str) -> Result<Self, SceneError> {
        parse(&Source::new(name, text))
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
        load(Source::new(name, text), folder, read_bytes)
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
        load(Source::new(name, text), Path::new(""), |path| {
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
            Source::new(DEFAULT_NAME, DEFAULT),
            Path::new(""),
            read_bytes,
        )
    }
}

fn parse(source: &Source) -> Result<Scene, SceneError> {
    let document = toml::Deserializer::parse(&source.text)
        .map_err(|error| SceneError::syntax(source, &error))?;
    let mut scene: Scene = serde_path_to_error::deserialize(document).map_err(|error| {
        SceneError::refused(
            source,
            &error.path().to_string(),
            error.inner(),
            advice::SCENE,
        )
    })?;
    let tools: Vec<_> = scene.tools.iter().map(Tool::obstacle).collect();
    scene.obstacles.extend(tools);
    consistency::check(&scene)
        .and_then(|()| tool::check(&scene))
        .and_then(|()| contact::check(&scene))
        .map_err(|conflict| source.error(&conflict.field, conflict.found, conflict.allowed))?;
    Ok(scene)
}

/// Loads a scene from its text. `read` returns the content of a file; paths are relative to `folder`.
pub(super) fn load(
    source: Source,
    folder: &Path,
    read: impl Fn(&Path) -> io::Result<Vec<u8>>,
) -> Result<LoadedScene, SceneError> {
    let scene = parse(&source)?;
    let mut reader = Reader {
        source: &source,
        folder,
        read,
        files: BTreeMap::new(),
    };
    let meshes = meshes(&mut reader, &scene)?;
    let mut warnings = Vec::new();
    let profiles = profiles(&mut reader, &scene, &mut warnings)?;
    let models = profiles.iter().map(|file| file.model).collect::<Vec<_>>();
    let recordings = recordings(&mut reader, &scene)?;
    let obstacles = obstacles(&mut reader, &scene)?;
    warnings.extend(plausible::check(&scene, &source, &models, &recordings)?);
    warnings.extend(silent::check(&scene, &source, &models)?);
    warnings.extend(silent::weaker(&scene, &source, &profiles));
    let files = reader.files;
    Ok(LoadedScene {
        scene,
        source,
        meshes,
        models,
        profiles,
        recordings,
        obstacles,
        files,
        warnings,
    })
}

/// Reads the files that a scene names, and keeps their contents.
struct Reader<'a, R> {
    source: &'a Source,
    folder: &'a Path,
    read: R,
    /// The content of each file, under the name in the scene.
    files: BTreeMap<String, Vec<u8>>,
}

impl<R: Fn(&Path) -> io::Result<Vec<u8>>> Reader<'_, R> {
    /// The path and the content of the file that `field` names.
    fn bytes(&mut self, file: &str, field: &str) -> Result<(PathBuf, Vec<u8>), SceneError> {
        let path = self.folder.join(file);
        match (self.read)(&path) {
            Ok(bytes) => {
                self.files.insert(file.to_owned(), bytes.clone());
                Ok((path, bytes))
            }
            Err(error) => Err(self.refused(field, path, error)),
        }
    }

    /// The content of a text file.
    fn text(&mut self, file: &str, field: &str) -> Result<(PathBuf, String), SceneError> {
        let (path, bytes) = self.bytes(file, field)?;
        match text_of(bytes) {
            Ok(text) => Ok((path, text)),
            Err(error) => Err(self.refused(field, path, error)),
        }
    }

    fn refused(&self, field: &str, path: PathBuf, source: io::Error) -> SceneError {
        SceneError::File {
            location: self.source.location(field),
            path,
            source,
        }
    }
}

/// The mesh file of each body; none for a generated mesh. A file that several bodies name in the same way is read once.
fn meshes(
    reader: &mut Reader<'_, impl Fn(&Path) -> io::Result<Vec<u8>>>,
    scene: &Scene,
) -> Result<Vec<Option<Arc<MeshFile>>>, SceneError> {
    let mut meshes: Vec<Option<Arc<MeshFile>>> = Vec::new();
    for (index, body) in scene.bodies.iter().enumerate() {
        let MeshSource::File(file) = &body.mesh.source else {
            meshes.push(None);
            continue;
        };
        let choices = Choices {
            texture_unit: body.mesh.flat_pattern.map(|pattern| pattern.texture_unit),
            merge: body
                .mesh
                .merge
                .map(|merge| merge / body.mesh.scale.unwrap_or(1.0)),
        };
        let same = |mesh: &&Arc<MeshFile>| mesh.name == *file && mesh.choices == choices;
        let known = meshes.iter().flatten().find(same);
        let mesh = if let Some(mesh) = known {
            Arc::clone(mesh)
        } else {
            let read = reader.bytes(file, &format!("body[{index}].mesh.file"))?;
            MeshFile::new(file, read, choices)
        };
        meshes.push(Some(mesh));
    }
    Ok(meshes)
}

/// The device file of each device. `warnings` receives those about device files.
fn profiles(
    reader: &mut Reader<'_, impl Fn(&Path) -> io::Result<Vec<u8>>>,
    scene: &Scene,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<DeviceFile>, SceneError> {
    let each = scene.devices.iter().enumerate().map(|(index, device)| {
        let field = format!("device[{index}].model");
        match &device.model {
            ModelName::BuiltIn(name) => DeviceFile::named(name)
                .ok_or_else(|| reader.source.error(&field, *name, "a built-in device")),
            ModelName::File(file) => {
                let (path, text) = reader.text(file, &field)?;
                let (file, _, found) = read_device(path.display().to_string(), text)?;
                // Two devices may have the same file.
                let new = found.into_iter().filter(|one| !warnings.contains(one));
                warnings.extend(new.collect::<Vec<_>>());
                Ok(file)
            }
        }
    });
    each.collect()
}

/// The device file with the content `text`, which messages call `name`, and the warnings about it.
pub(super) fn read_device(
    name: String,
    text: String,
) -> Result<(DeviceFile, Source, Vec<Warning>), SceneError> {
    match DeviceFile::parse(&text) {
        Ok(file) => {
            let source = Source::new(name, text);
            let warnings = plausible::check_device_file(&source, &file.model)?;
            Ok((file, source, warnings))
        }
        Err(error) => Err(SceneError::model(name, error)),
    }
}

/// The recording of each device's hand; none for a hand that does something else.
fn recordings(
    reader: &mut Reader<'_, impl Fn(&Path) -> io::Result<Vec<u8>>>,
    scene: &Scene,
) -> Result<Vec<Option<Vec<Sample>>>, SceneError> {
    let each = scene.devices.iter().enumerate().map(|(index, device)| {
        let hand = device.hand.as_ref();
        let Some(file) = hand.and_then(|hand| hand.recording.as_ref()) else {
            return Ok(None);
        };
        let (path, text) = reader.text(file, &format!("device[{index}].hand.recording"))?;
        Ok(Some(recording::parse(&text, &path.display().to_string())?))
    });
    each.collect()
}

/// The files of each obstacle.
fn obstacles(
    reader: &mut Reader<'_, impl Fn(&Path) -> io::Result<Vec<u8>>>,
    scene: &Scene,
) -> Result<Vec<ObstacleFiles>, SceneError> {
    let mut all = Vec::new();
    for (index, obstacle) in scene.obstacles.iter().enumerate() {
        let mut files = ObstacleFiles::default();
        if let Some(file) = &obstacle.poses {
            let (path, text) = reader.text(file, &format!("obstacle[{index}].poses"))?;
            files.poses = Some(poses::parse(&text, &path.display().to_string())?);
        }
        if let Some(mesh) = &obstacle.mesh {
            let at = scene.field_of_obstacle(index);
            let field = format!("{at}.mesh.file");
            let choices = Choices {
                texture_unit: None,
                merge: mesh.merge.map(|merge| merge / mesh.scale.unwrap_or(1.0)),
            };
            files.frames = if mesh.frame_rate.is_some() {
                frames(reader, &mesh.file, &field, choices)?
            } else {
                let read = reader.bytes(&mesh.file, &field).map_err(|error| {
                    let is_tool = index >= scene.given_obstacles().len();
                    if is_missing(&error) && !is_tool && contact::digits(&mesh.file).is_some() {
                        let field = format!("{at}.mesh.frame_rate");
                        let allowed = format!(
                            "the rate (Hz) of the frames that {:?} stands for; without a rate, this would be the name of one \
                             file, which does not exist",
                            mesh.file
                        );
                        return reader.source.error(&field, "none", allowed);
                    }
                    error
                })?;
                vec![MeshFile::new(&mesh.file, read, choices)]
            };
        }
        all.push(files);
    }
    Ok(all)
}

/// Whether a file does not exist.
fn is_missing(error: &SceneError) -> bool {
    matches!(error, SceneError::File { source, .. } if source.kind() == io::ErrorKind::NotFound)
}

/// The frames of an animated mesh, whose files are numbered without a gap from 0 or from 1.
fn frames(
    reader: &mut Reader<'_, impl Fn(&Path) -> io::Result<Vec<u8>>>,
    pattern: &str,
    field: &str,
    choices: Choices,
) -> Result<Vec<Arc<MeshFile>>, SceneError> {
    // The consistency of the scene was checked: the name has digits.
    let (before, width, after) = contact::digits(pattern).unwrap_or((pattern, 0, ""));
    let name = |number: usize| format!("{before}{number:0width$}{after}");
    let (mut frames, mut bytes) = (Vec::new(), 0);
    for number in 0..=MOST_FRAMES {
        let file = name(number);
        match reader.bytes(&file, field) {
            Ok(read) => {
                bytes += read.1.len();
                frames.push(MeshFile::new(&file, read, choices));
            }
            Err(error) if is_missing(&error) && number == 0 => {}
            Err(error) if is_missing(&error) => {
                // The files after a gap are no frames, so a log does not keep them.
                let mut later = (number + 1..=MOST_FRAMES).map(name);
                let is_there = |file: &String| (reader.read)(&reader.folder.join(file)).is_ok();
                let (found, allowed) = match (frames.is_empty(), later.find(is_there)) {
                    (true, None) => return Err(error),
                    (false, None) => break,
                    (true, Some(next)) => (
                        format!("{next} as the first frame"),
                        format!("frames that begin with {} or {file}", name(0)),
                    ),
                    (false, Some(next)) => (
                        format!("{next}, but no {file} before it"),
                        "frames that are numbered without a gap".to_owned(),
                    ),
                };
                return Err(reader.source.error(field, found, allowed));
            }
            Err(error) => return Err(error),
        }
        if frames.len() > MOST_FRAMES || bytes > LARGEST_FRAMES {
            let found = format!("{} frames of {} MiB", frames.len(), bytes >> 20);
            let allowed = format!(
                "up to {MOST_FRAMES} frames of up to {} MiB in all",
                LARGEST_FRAMES >> 20
            );
            return Err(reader.source.error(field, found, allowed));
        }
    }
    Ok(frames)
}

/// Reads a text file of at most [`LARGEST`] bytes.
pub(super) fn read(path: &Path) -> io::Result<String> {
    text_of(read_bytes(path)?)
}

/// A file's bytes as text. The error names the likely kind of the file, or the place of the first byte that is no text.
fn text_of(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let place = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        let problem = if bytes.starts_with(b"\x89MCAP") {
            "this file is a log and not a text; `palpate run --replay FILE` runs the ticks of a log again".to_owned()
        } else if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
            "the text is in UTF-16; save it as UTF-8".to_owned()
        } else {
            let line = 1 + bytes.iter().take(place).filter(|&&b| b == b'\n').count();
            let byte = bytes.get(place).copied().unwrap_or_default();
            format!(
                "line {line} has the byte 0x{byte:02X}, which is not UTF-8; save the text as UTF-8"
            )
        };
        io::Error::new(io::ErrorKind::InvalidData, problem)
    })
}

/// Reads a file of a scene, of at most 64 MiB.
///
/// # Errors
/// [`io::Error`] for a larger file, and for a named pipe or a socket, which could wait without end.
pub fn read_bytes(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    devices::input::open(path)?
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
